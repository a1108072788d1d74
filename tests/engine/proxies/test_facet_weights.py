# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Facets block as many rays as the plants that they stand for, also those that nothing was fitted to."""

import json
from dataclasses import replace
from functools import partial
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devtools import facet_tables
from tests.engine import support
from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled import flora as flora_module
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.compiled.recorded_sizes import at_age
from tetflora_addon.emission.plants import expanded_blocks
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.rows import build_rows
from tetflora_addon.growth.seasons import Season
from tetflora_addon.jobs import run_to_end
from tetflora_addon.proxies import facet_weights as subject
from tetflora_addon.proxies.microsurfaces import CIRCUMRADIUS, FacetRules, piece_facets, subplant_facets
from tetflora_addon.refinement.contents import piece_totals, subplant_totals
from tetflora_addon.refinement.rasterize import occluder_depth
from tetflora_addon.species.catalog import list_species, load_species
from tetflora_addon.species.species import LEAF_KINDS, Species
from tetflora_addon.subplants.pieces import open_subplants


def triangles(buffers) -> np.ndarray:
    corner = buffers.positions[buffers.corner_verts].astype(float)
    first, number = buffers.face_offsets[:-1], np.diff(buffers.face_offsets)
    fans = []
    for k in range(1, int(number.max()) - 1):
        some = first[number > k + 1]
        fans.append(corner[np.stack([some, some + k, some + k + 1], axis=1)])
    return np.concatenate(fans)


def blocked(parts: list[np.ndarray], reach: float, pixels: int = 120) -> float:
    """Weight of level rays from four sides that meet something within a window around the origin."""
    total = 0.0
    for turn in (0.3, 1.1, 1.9, 2.7):
        right = np.array([np.cos(turn), np.sin(turn), 0.0])
        back = np.array([-np.sin(turn), np.cos(turn), 0.0])
        frame = np.stack([right, np.array([0.0, 0.0, 1.0]), back], axis=1)
        window = (-reach, reach, 0.0, 2.0 * reach)
        camera = Camera("ORTHO", back * 4 * reach, frame, window, 1e-3, 8 * reach, pixels, pixels)
        total += np.isfinite(occluder_depth(np.concatenate(parts), camera, pixels, pixels)).mean()
    return total / 4


def as_facets(flora: Flora, seeds, opened: int, side: float, weights: subject.FacetWeights | None) -> list[np.ndarray]:
    """A plant opened some orders deep, as facets."""
    some, out = trunks(flora.rows, seeds), []
    for _ in range(opened):
        some, _, pieces, _ = open_subplants(flora, some)
        totals = piece_totals(flora, pieces)
        whole = (totals.leaf_area + totals.wood_area / 2) / np.maximum(pieces.t1 - pieces.t0, 1e-12)
        share = subject.leaf_shares(flora, pieces.branches)
        weight = None if weights is None else weights.of_pieces(pieces.branches.row, whole / side**2, share)
        out.append(piece_facets(flora, pieces, FacetRules(np.full(len(pieces), side), weight=weight)))
    totals = subplant_totals(flora, some)
    area = totals.leaf_area + totals.wood_area / 2
    share = subject.leaf_shares(flora, some)
    weight = None if weights is None else weights.of_subplants(some.row, area / side**2, share)
    out.append(subplant_facets(flora, some, FacetRules(np.full(len(some), side), weight=weight)))
    return [triangles(support.facet_mesh(f)) for f in out if len(f)]


def test_opened_plants_of_other_seeds_are_as_opaque() -> None:
    """Of aspens, whose limbs lie closest to those of others."""
    flora = compile_species([load_species("aspen")])
    weights = subject.facet_weights(flora)
    truth, fitted, full = [], [], []
    for seed in (901, 905):
        seeds = replace(support.plants(seed), species=np.zeros(1, np.int32))
        real = [triangles(block.buffers) for block in expanded_blocks(flora, seeds)]
        reach = float(max(np.abs(part).max() for part in real)) / 2
        truth.append(blocked(real, reach))
        side = 2 * reach / 40
        fitted.append(blocked(as_facets(flora, seeds, 1, side, weights), reach))
        full.append(blocked(as_facets(flora, seeds, 1, side, None), reach))
    error = abs(np.mean(fitted) - np.mean(truth)) / np.mean(truth)
    assert error < 0.08
    assert error < abs(np.mean(full) - np.mean(truth)) / np.mean(truth)


def light_from_above(identifier: str, opened: int, crown: np.ndarray | None) -> list[float]:
    """Rays that trees of a dense stand stop, and that their facets do."""
    flora = compile_species([at_age(load_species(identifier), 0.0, crowded=True)])
    weights, real, facets = subject.facet_weights(flora), [], []
    for seed in (901, 905):
        seeds = replace(support.plants(seed), crown=crown)
        grown = [triangles(block.buffers) for block in expanded_blocks(flora, seeds)]
        reach = float(max(np.abs(part[..., :2]).max() for part in grown))
        top = max(part[..., 2].max() for part in grown)
        for out, made in ((real, grown), (facets, as_facets(flora, seeds, opened, reach / 10, weights))):
            # Tipped over, so that most rays come from above.
            out.append(blocked([part[..., [0, 2, 1]] + [0.0, reach - top, reach] for part in made], reach))
    return [float(np.mean(of)) for of in (real, facets)]


@pytest.mark.parametrize("opened", [0, 1])
def test_trees_of_a_dense_stand_are_as_opaque(opened: int) -> None:
    """They have weights of their own; in a narrow crown their limbs hide each other the more."""
    real, facets = light_from_above("beech", opened, np.array([[0.6, 0.5, 0.0, 0.0, 1.0, 0.7]]))
    assert facets == pytest.approx(real, rel=0.05)


@pytest.mark.parametrize(("identifier", "opened"), [("beech", 0), ("oak", 1), ("spruce", 0)])
def test_weights_of_free_trees_are_not_those_of_a_dense_stand(identifier: str, opened: int) -> None:
    """Had they these, as many leaves made up for, they would be 8 to 9 % off."""
    real, facets = light_from_above(identifier, opened, None)
    assert facets == pytest.approx(real, rel=0.05)


def test_tables_of_shipped_species_are_those_of_today() -> None:
    """Run ``python -m devtools.facet_tables`` and raise `_METHOD` after changes of species or of facets."""
    flora = compile_species([load_species("birch")])
    known = subject.shipped()[subject.digest(flora, 0)]
    whole, own = run_to_end(subject.fitting(flora, 0))
    np.testing.assert_allclose([whole, own], known, atol=0.02)


def described(species: tuple[Species, ...]) -> SimpleNamespace:
    """What a digest has of a flora."""
    forms = tuple(tuple(one.forms(kind) for kind in LEAF_KINDS) for one in species)
    return SimpleNamespace(species=species, rows=build_rows(species), forms=forms)


def test_every_shipped_species_has_a_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of ages by their names, and every fourth as it is measured: what is changed of a species changes all of its ages,
    and what is changed of ages those of all species. A table is of parameters and leaves: no more is compiled.
    """
    named = {one["species"] for one in json.loads(subject.TABLE.read_text(encoding="utf-8")).values()}
    whole, turn = subject.digest(compile_species([load_species("birch")]), 0), count()
    monkeypatch.setattr(flora_module, "_compiled", described)
    monkeypatch.setattr(facet_tables, "with_leaves", subject.with_leaves.__wrapped__)
    made = subject.compiled_at_age.__wrapped__
    monkeypatch.setattr(facet_tables, "compiled_at_age", lambda *given: partial(made, *given))
    assert subject.digest(compile_species([load_species("birch")]), 0) == whole
    for identifier in list_species():
        for name, flora in facet_tables.variants(load_species(identifier)):
            if not isinstance(flora, partial) or name not in named or next(turn) % 4 == 0:
                one = flora() if isinstance(flora, partial) else flora
                assert subject.digest(one, 0) in subject.shipped(), name


@pytest.mark.parametrize("day", [20.0, 200.0, 300.0])
def test_trees_of_stands_have_tables_on_all_days(day: float) -> None:
    species = [at_age(load_species(name), years, crowded=True) for name in ("oak", "spruce") for years in (0.0, 30.0)]
    flora = compile_species(species).in_year(Season(day))
    for number in range(len(species)):
        for variant in subject.needed(flora, number):
            assert subject.digest(*variant) in subject.shipped()


def test_dead_trees_of_stands_are_species_at_all_ages() -> None:
    """What has no ages of its own, such as bamboo, is as it was."""
    for name in ("oak", "bamboo"):
        for years in (0.0, 5.0, 40.0):
            assert compile_species([at_age(load_species(name), years, 6.0, crowded=True)]).polygons.max() > 0.0


@given(st.floats(0.05, 1.6), st.floats(1e-3, 1e6))
def test_between_known_numbers_weights_follow_the_logarithm(level: float, count: float) -> None:
    table = np.full((2, len(subject.COUNTS)), level)
    weights = subject.FacetWeights(table[None], table[None])
    assert weights.of_subplants(np.array([1]), np.array([count]))[0] == pytest.approx(level)
    rising = np.tile(np.arange(len(subject.COUNTS), dtype=float), (2, 1))
    weights = subject.FacetWeights(rising[None], rising[None])
    step = np.log(subject.COUNTS[1] / subject.COUNTS[0])
    place = np.clip(np.log(count / subject.COUNTS[0]) / step, 0, len(subject.COUNTS) - 1)
    assert weights.of_pieces(np.array([0]), np.array([count]))[0] == pytest.approx(place)


def test_the_least_weight_with_which_a_triangle_reaches_a_ray() -> None:
    """Seen face on: at its middle none is needed, at the middle of a side and at its corners all."""
    flora = support.small_flora()
    facets = subplant_facets(flora, trunks(flora.rows, support.plants(1)), FacetRules(np.array([1.0])))
    one = replace(
        facets,
        center=np.zeros((1, 3)),
        across=np.array([[1.0, 0.0, 0.0]]),
        along=np.array([[0.0, 1.0, 0.0]]),
        side=np.array([1.0 / CIRCUMRADIUS]),
        color=np.ones((1, 3)),
        transmission=np.zeros(1),
    )
    for point, expected in (((0.0, 0.0), 0.0), ((0.0, -0.5), 1.0), ((0.0, 1.0), 1.0), ((0.0, -0.25), 0.25)):
        moved = replace(one, center=np.array([[-point[0] * 1.0, -point[1] * 1.0, 0.0]]))
        view = subject.View(np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), 1000.0)
        far = replace(moved, center=moved.center + 0.0)
        least = subject.least_weights(view, far)
        assert len(least) == 1
        assert least[0] == pytest.approx(expected, abs=1e-9)


def test_a_species_is_looked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiled again, alone or beside others, it has the weights that were found before."""
    asked = []
    real = subject.fitting

    def noted(flora: Flora, number: int, rays: float):
        asked.append(flora.species[number].identifier)
        return real(flora, number, rays / 10)

    monkeypatch.setattr(subject, "fitting", noted)
    monkeypatch.setattr(subject, "shipped", dict)
    monkeypatch.setattr(subject, "_measured", {})
    subject._of_states.cache_clear()
    alone = subject.facet_weights(compile_species([load_species("grass")]))
    again = subject.facet_weights(compile_species([load_species("flower"), load_species("grass")]))
    assert asked == ["grass", "flower"]
    rows = alone.whole.shape[1]
    np.testing.assert_array_equal(again.whole[:, -rows:], alone.whole)
    np.testing.assert_array_equal(again.branch_only[:, -rows:], alone.branch_only)
