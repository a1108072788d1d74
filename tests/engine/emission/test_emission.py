# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to buffers: explicit polygons and proxies together are the plants, each part in one form."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from tests.engine import support
from tests.engine.refinement.test_loop import run
from tests.engine.subplants.test_leaf_meshes import check_topology
from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.emission import facets, plants
from tetflora_addon.emission.forms import Refined, facet_blocks
from tetflora_addon.emission.plants import expanded_blocks, explicit_blocks
from tetflora_addon.emission.shells import proxy_shells
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.proxies.facet_weights import COUNTS, FacetWeights
from tetflora_addon.proxies.summaries import summarise
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement
from tetflora_addon.tetrahedra.geometry import volume


@cache
def scene() -> tuple[Flora, Seeds, Camera, Refinement]:
    """Two species in depth, so that every decision occurs: near leaves, hidden ones, far ones."""
    flora = support.compiled(support.SMALL, support.shipped("bush"))
    count = 36
    depth = np.repeat(np.arange(9) ** 2 * 3.0, 4)
    place = np.stack([np.tile([-3.0, -1.0, 1.0, 3.0], 9) * (1 + depth / 60), depth, 0 * depth], axis=1)
    seeds = support.plants(np.arange(count), np.arange(count) % 2, place)
    camera = support.camera((0, -6, 2), (0, 60, 1.0), pixels=160, view=1.0)
    _, result = run(flora, seeds, camera)
    return flora, seeds, camera, result


def with_decision(result: Refinement, decision: Decision) -> Refinement:
    return replace(result, decision=np.full_like(result.decision, decision))


def test_the_scene_has_every_decision() -> None:
    *_, result = scene()
    assert {Decision.PROXY, Decision.HIDDEN, Decision.EXPLICIT} == set(result.decision.tolist())


def by_kind(blocks: list, kind: str, species: int) -> float:
    return sum(support.face_areas(b.buffers).sum() for b in blocks if (b.kind, b.species) == (kind, species))


def test_all_cells_explicit_are_the_plants_expanded(monkeypatch: pytest.MonkeyPatch) -> None:
    """By species and kind: leaves to the last one, bark's area; in blocks of any size."""
    flora, seeds, _, result = scene()
    whole = list(expanded_blocks(flora, seeds))
    for size in (250_000, 9_000):
        monkeypatch.setattr(plants, "BLOCK_POLYGONS", size)
        parts = list(explicit_blocks(flora, with_decision(result, Decision.EXPLICIT)))
        for block in parts:
            check_topology(block.buffers)
        for species in (0, 1):
            leaves = [
                sum(b.buffers.polygons for b in blocks if (b.kind, b.species) == ("leaf", species))
                for blocks in (whole, parts)
            ]
            assert leaves[0] == leaves[1] > 0
            for kind, tolerance in (("leaf", 1e-6), ("bark", 1e-3)):
                expected = by_kind(whole, kind, species)
                assert by_kind(parts, kind, species) == pytest.approx(expected, rel=tolerance)
    assert max(b.number for b in parts) > 3


def test_blocks_come_in_order_and_end_at_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each (block, species, kind) once; fractions rise to 1; regions lie front to back on the whole."""
    flora, seeds, _, result = scene()
    monkeypatch.setattr(plants, "BLOCK_POLYGONS", 4_000)
    for blocks in (list(explicit_blocks(flora, result)), list(expanded_blocks(flora, seeds))):
        names = [(b.number, b.species, b.kind) for b in blocks]
        assert len(set(names)) == len(names)
        assert [n for n, *_ in names] == sorted(n for n, *_ in names)
        fractions = [b.fraction for b in blocks]
        assert fractions == sorted(fractions)
        assert fractions[-1] == pytest.approx(1)
        assert fractions[0] > 0


def test_a_block_holds_about_as_many_polygons_as_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    flora, seeds, _, _ = scene()
    monkeypatch.setattr(plants, "BLOCK_POLYGONS", 20_000)
    sizes: dict[int, int] = {}
    for block in expanded_blocks(flora, seeds):
        sizes[block.number] = sizes.get(block.number, 0) + block.buffers.polygons
    assert max(sizes.values()) < 20_000 + 2 * flora.polygons.max()
    assert len(sizes) > 5


def test_explicit_polygons_are_about_as_many_as_expected() -> None:
    flora, _, _, result = scene()
    made = sum(b.buffers.polygons for b in explicit_blocks(flora, result))
    expected = result.totals.polygons[result.decision == Decision.EXPLICIT].sum()
    assert made == pytest.approx(expected, rel=0.05)


def test_facets_have_the_area_of_what_is_not_explicit(monkeypatch: pytest.MonkeyPatch) -> None:
    """But for what leaves of a cluster hide of each other."""
    flora, _, camera, result = scene()
    every = result.contents.sums(len(result.tree))
    proxies = result.chosen(Decision.PROXY, Decision.HIDDEN)
    mesh = support.facet_buffers(flora, result, camera)
    check_topology(mesh)
    optical = (every.leaf_area + every.wood_area / 2)[proxies].sum()
    assert 0.4 * optical < support.face_areas(mesh).sum() < 1.05 * optical
    ones = np.ones((len(flora.rows), len(COUNTS)))
    monkeypatch.setattr(facets, "facet_weights", lambda _: FacetWeights(ones, ones))
    mesh = support.facet_buffers(flora, result, camera)
    assert support.face_areas(mesh).sum() == pytest.approx(optical, rel=0.05)


def test_facets_are_as_large_as_asked_for_and_larger_where_hidden() -> None:
    """In pixels at their own distance, for wood; hidden wood of few faces gets larger facets still."""
    flora, _, camera, result = scene()
    numbers = {}
    for decision in (Decision.PROXY, Decision.HIDDEN):
        mesh = support.facet_buffers(flora, with_decision(result, decision), camera, facet_pixels=0.5)
        numbers[decision] = mesh.polygons
        wood = mesh.attributes["tf_transmission"][1] == 0
        centre = support.face_centres(mesh)[wood]
        pixels = np.sqrt(support.face_areas(mesh)[wood])
        pixels /= np.linalg.norm(centre - camera.position, axis=1) * camera.pixel_size
        if decision == Decision.PROXY:
            assert np.median(pixels) == pytest.approx(0.5, rel=0.25)
        else:
            assert np.quantile(pixels, 0.01) > 1.0 * 0.75
    assert numbers[Decision.HIDDEN] < numbers[Decision.PROXY]


def test_chunks_of_facets_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    flora, _, camera, result = scene()
    once = support.facet_buffers(flora, result, camera)
    monkeypatch.setattr(facets, "FACETS_AT_ONCE", 500)
    chunked = support.facet_buffers(flora, result, camera)
    assert chunked.polygons == once.polygons
    quads = [np.unique(m.positions.reshape(-1, 9), axis=0) for m in (once, chunked)]
    assert (quads[0] == quads[1]).all()


def test_facets_are_made_in_chunks_that_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """By facets, not by branches: thick wood close to the eye is cut into very many."""
    flora, _, camera, result = scene()
    made: dict[str, list[int]] = {"piece_facets": [], "subplant_facets": []}
    for name, numbers in made.items():
        inner = getattr(facets, name)

        def counted(*args: object, inner: object = inner, numbers: list[int] = numbers) -> object:
            out = inner(*args)
            numbers.append(len(out))
            return out

        monkeypatch.setattr(facets, name, counted)
    monkeypatch.setattr(facets, "FACETS_AT_ONCE", 2_000)
    total = support.facet_buffers(flora, with_decision(result, Decision.PROXY), camera, facet_pixels=0.15)
    assert sum(map(sum, made.values())) == total.polygons
    for numbers in made.values():
        assert sum(numbers) > 8_000
        # One thing alone may exceed the limit, but then it has a chunk of its own.
        assert len(numbers) > sum(numbers) / max(2_000, max(numbers)) / 2
        assert np.median(numbers) < 2 * 2_000


def test_facets_come_in_blocks_of_bounded_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Together they are all facets; each is of one species, of which only the last block is small."""
    flora, _, camera, result = scene()
    once = support.facet_buffers(flora, result, camera)
    monkeypatch.setattr(facets, "FACETS_AT_ONCE", 300)
    monkeypatch.setattr(facets, "BLOCK_POLYGONS", 700)
    blocks = list(facet_blocks(Refined(flora, result, camera, 0.33)))
    sizes = [b.polygons for b in blocks]
    assert sum(sizes) == once.polygons
    assert len(blocks) > 3
    assert min(a.polygons for a, b in pairwise(blocks) if a.species == b.species) >= 700
    assert max(sizes) < 2 * 700
    assert sorted({b.species for b in blocks}) == list(range(len(flora.species)))
    assert [b.species for b in blocks] == sorted(b.species for b in blocks)


def test_what_was_off_screen_comes_back_identical() -> None:
    """The camera turns away and back again: polygons and facets are the same to the last digit."""
    flora, seeds, camera, _ = scene()
    away = replace(camera, frame=camera.frame @ np.diag([-1.0, 1.0, -1.0]))
    made = []
    for view in (camera, away, camera):
        _, result = run(flora, seeds, view)
        blocks = [b.buffers for b in explicit_blocks(flora, result)]
        made.append([m.positions for m in (*blocks, support.facet_buffers(flora, result, view))])
    assert all(np.array_equal(a, b) for a, b in zip(made[0], made[2], strict=True))
    assert sum(map(len, made[1])) < sum(map(len, made[0])) / 2


def test_shells_are_the_cells_of_proxies() -> None:
    flora, _, _, result = scene()
    mesh = proxy_shells(flora, result)
    cells = np.isin(result.decision, (Decision.PROXY, Decision.HIDDEN))
    assert mesh.polygons == 4 * cells.sum()
    check_topology(mesh)
    kappa = mesh.attributes["tf_kappa"][1].reshape(-1, 4)[:, 0]
    volumes = volume(result.tree.vertices(result.nodes[cells]))
    index = np.full(len(result.tree), -1)
    index[result.nodes[cells]] = np.arange(cells.sum())
    area = summarise(flora, result.contents, index, int(cells.sum())).effective_area(volumes)
    # Half of the area as the mean over all directions, whatever the orientation, within what the form of κ allows.
    np.testing.assert_allclose(kappa, (area / 2 / volumes)[np.argsort(-result.rank[cells])], rtol=0.08)
    assert mesh.attributes["tf_colour"][1].min() >= 0
    assert mesh.attributes["tf_colour"][1].max() <= 1


def test_nothing_to_draw() -> None:
    """All explicit leaves no proxy, all proxies leave no block."""
    flora, _, camera, result = scene()
    explicit = with_decision(result, Decision.EXPLICIT)
    assert proxy_shells(flora, explicit) is None
    assert support.facet_buffers(flora, explicit, camera) is None
    assert list(explicit_blocks(flora, with_decision(result, Decision.PROXY))) == []
    # Facets so large that none of what there is makes one.
    proxies = with_decision(result, Decision.PROXY)
    assert list(facet_blocks(Refined(flora, proxies, camera, 1e9))) == []


def test_copies_of_a_seed_are_all_made() -> None:
    """Empties copied in the scene keep their seed: each is drawn where it stands."""
    flora = support.small_flora()
    place = [(0, 0, 0), (4, 0, 0), (8, 0, 0)]
    blocks = list(expanded_blocks(flora, support.plants([5, 5, 5], position=place)))
    one = list(expanded_blocks(flora, support.plants([5])))
    assert sum(b.buffers.polygons for b in blocks) == 3 * sum(b.buffers.polygons for b in one)
    bark = next(b.buffers for b in blocks if b.kind == "bark")
    nearest = np.bincount(np.rint(bark.positions[:, 0] / 4).astype(int).clip(0, 2), minlength=3)
    assert nearest.min() > 0.9 * nearest.max()
