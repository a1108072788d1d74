# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Between real leaves and facets nothing pops: fractions grow smoothly, what is real stays real, and areas add up."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.emission.test_emission import unweighted, with_decision
from tests.engine.refinement.test_loop import run
from tetflora_addon.buffers import concatenate_buffers
from tetflora_addon.emission.facets import facet_parts
from tetflora_addon.emission.plants import FADING, Transition, explicit_blocks
from tetflora_addon.growth.growth import trunks
from tetflora_addon.proxies.facet_sizes import FacetPixels
from tetflora_addon.proxies.microsurfaces import Facets
from tetflora_addon.refinement import shares
from tetflora_addon.refinement.decisions import BAND, Decision


def scene(**options):
    flora = support.small_flora()
    camera = support.camera((0, -60, 6), (0, 0, 1.5), pixels=256, view=0.3)
    return flora, camera, run(flora, support.grove(6, 3.0), camera, **options)[1]


@given(st.floats(0.01, 100.0), st.floats(0.01, 100.0), st.floats(0.1, 4.0))
def test_fractions_grow_with_the_width(a: float, b: float, limit: float) -> None:
    """None up to the limit, all beyond the band, monotonous between."""
    flora = support.small_flora()
    camera = support.camera((0, -50, 0), (0, 0, 0))
    transition = Transition(flora, camera, limit)
    place = np.zeros((2, 3))
    width = np.array([a, b]) * camera.extent_around(place)
    fraction = transition.fraction(width, place)
    assert ((fraction >= 0) & (fraction <= 1)).all()
    for one, pixels in zip(fraction, (a, b), strict=True):
        if pixels <= limit:
            assert one == pytest.approx(0.0, abs=1e-12)
        if pixels >= limit * BAND * (1 + 1e-9):
            assert one == pytest.approx(1.0)
    assert (fraction[0] - fraction[1]) * (a - b) >= 0


def leaf_meshes(blocks) -> list:
    return [b.buffers for b in blocks if b.kind == "leaf"]


def leaf_area(blocks) -> float:
    return float(sum(support.face_areas(mesh).sum() for mesh in leaf_meshes(blocks)))


def wood_area(blocks) -> float:
    """That facets would stand for: closed tubes, of quads, show half, triangles all."""
    meshes = [b.buffers for b in blocks if b.kind == "bark"]
    return float(sum((support.face_areas(m) * np.where(np.diff(m.face_offsets) == 3, 1.0, 0.5)).sum() for m in meshes))


def all_facets(flora, result, camera, transition, pixels: float = 0.3) -> Facets:
    return Facets.concatenate(
        [f for block in facet_parts(flora, result, camera, FacetPixels(pixels), transition) for f, _ in block]
    )


EXPLICIT, PROXY, HIDDEN = Decision.EXPLICIT, Decision.PROXY, Decision.HIDDEN


@pytest.mark.parametrize(
    ("decisions", "visibility"),
    [
        ((EXPLICIT,), 1.0),
        ((EXPLICIT,), 0.3),
        ((EXPLICIT,), 0.03),
        ((EXPLICIT,), None),
        ((PROXY,), None),
        ((HIDDEN,), None),
        ((EXPLICIT, HIDDEN), None),
        ((EXPLICIT, PROXY, HIDDEN), None),
    ],
)
def test_real_leaves_and_facets_together_are_all_leaves(
    monkeypatch: pytest.MonkeyPatch, decisions: tuple[Decision, ...], visibility: float | None
) -> None:
    """And wood; whatever the limit, the decisions and what is seen of each cell, but for what a cluster hides."""
    flora, camera, result = scene()
    rng = np.random.default_rng(2)
    seen = rng.random(len(result.nodes)) if visibility is None else visibility
    every = with_decision(result, rng.choice(np.array(decisions), len(result.nodes)), seen)
    blocks = list(explicit_blocks(flora, with_decision(result, EXPLICIT), camera))
    whole, whole_wood = leaf_area(blocks), wood_area(blocks)
    unweighted(monkeypatch, flora)
    pixels = float(np.median(result.cells.feature))
    fractions = []
    for limit in pixels * np.array([3.0, 0.9, 0.7, 0.5, 0.01]):
        transition = Transition(flora, camera, float(limit))
        blocks = list(explicit_blocks(flora, every, camera, transition))
        made = all_facets(flora, every, camera, transition)
        leafy, real = made.transmission > 0, leaf_area(blocks)
        fractions.append(real / whole)
        assert real + (made.side**2)[leafy].sum() == pytest.approx(whole, rel=0.08)
        assert wood_area(blocks) + (made.side**2)[~leafy].sum() == pytest.approx(whole_wood, rel=0.08)
    assert fractions == sorted(fractions)
    assert fractions[0] == 0.0
    if decisions == (EXPLICIT,):
        assert fractions[-1] == pytest.approx(1.0)
        assert visibility != 1.0 or 0.02 < fractions[2] < 0.98
    elif EXPLICIT in decisions:
        assert 0.1 < fractions[-1] < 1.0
    else:
        assert fractions[-1] == 0.0


@pytest.mark.parametrize("visibility", [1.0, 0.5])
def test_each_leaf_is_real_or_a_facet_in_the_right_fraction(monkeypatch: pytest.MonkeyPatch, visibility: float) -> None:
    """Plant by plant: as many leaves are real as widths say, and facets have what is left of its area."""
    flora, camera, result = scene()
    seeds = support.grove(6, 3.0)
    every = with_decision(result, EXPLICIT, visibility)
    unweighted(monkeypatch, flora)
    limit = 0.7 * float(np.median(result.cells.feature)) * visibility**FADING
    transition = Transition(flora, camera, limit)
    real = concatenate_buffers(leaf_meshes(explicit_blocks(flora, every, camera, transition)))
    made = all_facets(flora, every, camera, transition, 0.05)
    made = made.take(np.flatnonzero(made.transmission > 0))

    def owner(places: np.ndarray) -> np.ndarray:
        away = np.linalg.norm(places[:, None, :2] - seeds.position[None, :, :2], axis=2)
        return away.argmin(axis=1)

    areas = np.bincount(owner(support.face_centres(real)), support.face_areas(real), len(seeds))
    rest = np.bincount(owner(made.centre), made.side**2, len(seeds))
    for plant in range(len(seeds)):
        _, pieces = support.grown(flora, seeds.take(np.array([plant])))
        branches = pieces.branches.take(np.flatnonzero(pieces.t0 == 0))
        fraction = transition.of_branches(branches, visibility)
        leaf, _, size = support.leaves_of(flora, branches)
        shape = float(size @ size)
        expected = float(size**2 @ fraction[leaf]) / shape
        assert 0.1 < expected < 0.9
        whole = areas[plant] + rest[plant]
        assert areas[plant] / whole == pytest.approx(expected, abs=4 * 0.5 / np.sqrt(len(size)) + 0.02)


def test_what_is_real_stays_real_as_the_limit_falls_and_as_more_is_seen() -> None:
    flora, camera, result = scene()
    pixels = float(np.median(result.cells.feature))
    leaves = []
    for limit, visibility in ((0.8, 0.8), (0.8, 1.0), (0.7, 1.0)):
        every = with_decision(result, Decision.EXPLICIT, visibility)
        made = leaf_meshes(explicit_blocks(flora, every, camera, Transition(flora, camera, limit * pixels)))
        leaves.append({tuple(p) for m in made for p in m.positions.round(4)})
    assert set() < leaves[0] < leaves[1] < leaves[2]


@pytest.mark.parametrize("place", [0.4, 0.6, 0.8])
def test_a_larger_limit_adds_facets_and_moves_none(place: float) -> None:
    """Also where the loop asks anew what is seen: facets are where they were, as large as they were, and leaves go."""
    width = float(np.median(scene()[2].cells.feature))
    facets, leaves = [], []
    for limit in place * width * np.array([1.0, 1.1]):
        flora, camera, result = scene(leaf_limit=float(limit))
        transition = Transition(flora, camera, float(limit))
        made = all_facets(flora, result, camera, transition)
        facets.append({tuple(f) for f in np.column_stack([made.centre, made.side]).round(4)})
        leaves.append(
            {
                tuple(p)
                for m in leaf_meshes(explicit_blocks(flora, result, camera, transition))
                for p in m.positions.round(4)
            }
        )
    assert len(facets[0] - facets[1]) < 0.02 * len(facets[0]) < len(facets[1] - facets[0])
    assert leaves[1] < leaves[0]


def test_thick_wood_is_real_among_proxies() -> None:
    """A trunk of many pixels is a tube, and has no facets, although all around it is drawn as proxies."""
    flora, camera, result = scene()
    proxies = with_decision(result, Decision.PROXY)
    trunk = trunks(flora.rows, support.grove(6, 3.0))
    wide = 2 * trunk.radius.max() / camera.extent_around(trunk.position).min()
    near = Transition(flora, camera, wide / 10)
    blocks = list(explicit_blocks(flora, proxies, camera, near))
    assert {b.kind for b in blocks} == {"bark"}
    wood = []
    for transition in (None, near):
        made = all_facets(flora, proxies, camera, transition)
        wood.append(float((made.side**2)[made.transmission == 0].sum()))
    assert wood[1] < wood[0]
    assert list(explicit_blocks(flora, proxies, camera, Transition(flora, camera, 100 * wide))) == []


def test_facets_do_not_depend_on_how_space_is_divided() -> None:
    """Those of plants that are seen are the same after a coarser cutoff, but for what hides and is hidden."""
    made = []
    for cutoff in (2.0, 2.6):
        flora, camera, result = scene(cutoff=cutoff, hidden=-1.0)
        seen = with_decision(result, Decision.PROXY, 1.0)
        centres = all_facets(flora, seen, camera, Transition(flora, camera, 50.0)).centre
        made.append({tuple(c) for c in centres.round(5)})
    assert len(made[0] & made[1]) > 0.8 * len(made[0] | made[1])


def test_few_are_opened_at_a_time_and_it_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    flora, camera, result = scene()
    transition, opened, inner = Transition(flora, camera, 50.0), [], shares.open_branches

    def facets() -> np.ndarray:
        made = all_facets(flora, result, camera, transition)
        every = np.column_stack([made.centre, made.along, made.side])
        return every[np.lexsort(every.T)]

    def counted(flora, subplants):
        opened.append(len(subplants))
        return inner(flora, subplants)

    once = facets()
    monkeypatch.setattr(shares, "open_branches", counted)
    monkeypatch.setattr(shares, "OPENED_AT_ONCE", 3)
    assert np.array_equal(facets(), once)
    assert max(opened) == 3


@pytest.mark.parametrize("seed", range(4))
def test_a_trunk_that_fills_the_picture_is_there_whatever_share_it_has(seed: int) -> None:
    """Hardly any of a tall birch is seen from so near: none of its few points need be there."""
    flora = support.flora()
    birch = support.SPECIES.index("birch")
    seeds = support.plants([seed], birch)
    radius = float(trunks(flora.rows, seeds).radius[0])
    camera = support.camera((0.0, -8.0 * radius, 1.3), (0.0, 0.0, 1.3), pixels=256)
    result = run(flora, seeds, camera)[1]
    blocks = list(explicit_blocks(flora, result, camera, Transition(flora, camera, 0.5)))
    bark = [b.buffers.positions for b in blocks if b.kind == "bark"]
    assert bark
    points = np.concatenate(bark)
    assert (np.hypot(points[:, 0], points[:, 1]) < 3.0 * radius).any()
