# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole loop on small scenes: it ends, keeps its limits, loses nothing, and finds out what is hidden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.refinement.test_shares import check_points, check_whole
from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.refinement import loop
from tetflora_addon.refinement.contents import Totals, bounding_box
from tetflora_addon.refinement.decisions import Decision, feature_pixels, mean_extinction
from tetflora_addon.refinement.loop import Refinement, refine, step_of
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.tetrahedra.geometry import volume
from tetflora_addon.tetrahedra.roots import view_root

FAST = {"visibility_resolution": 64, "max_tetrahedra": 20_000}


def run(
    flora: Flora, seeds: Seeds, camera: Camera, occluders: np.ndarray | None = None, **options: float
) -> tuple[list[Refinement], Refinement]:
    """All states that the loop shows on its way, and its result."""
    states = []
    loop = refine(flora, seeds, camera, RefinementSettings(**{**FAST, **options}), occluders)
    while True:
        try:
            states.append(next(loop))
        except StopIteration as stop:
            return states, stop.value


def check(flora: Flora, seeds: Seeds, result: Refinement) -> None:
    """What holds for every result; nothing is lost."""
    check_whole(flora, seeds, result.plants)
    check_points(result.tree, result.plants)
    tree = result.tree
    assert (tree.children[result.nodes, 0] < 0).all()
    assert np.isin(result.decision, [Decision.PROXY, Decision.HIDDEN, Decision.EXPLICIT]).all()
    assert len(np.unique(result.rank)) == len(result.rank)
    assert np.isin(result.plants.points.cell, result.nodes).all()
    assert np.isin(result.nodes, result.plants.points.cell).all()
    for name in ("leaf_area", "wood_area", "polygons"):
        whole = getattr(result.plants.parts.totals, name).sum()
        assert getattr(result.totals, name).sum() == pytest.approx(whole, rel=1e-6)
    assert volume(tree.vertices(tree.terminals())).min() > 0
    for array in (result.cells.pixels, result.transmittance, result.totals.leaf_area, result.totals.width):
        assert len(array) == len(result.nodes)
        assert np.isfinite(array).all()
    masks = [result.chosen(d) for d in (Decision.PROXY, Decision.HIDDEN, Decision.EXPLICIT)]
    assert sum(m.sum() for m in masks) == len(result.nodes)


CAMERAS = {
    "before it": ((0, -9, 2), (0, 0, 1.5), "PERSP", 0.8),
    "far away": ((0, -200, 20), (0, 0, 1.5), "PERSP", 0.8),
    "turned away": ((0, -9, 2), (0, -20, 2), "PERSP", 0.8),
    "in the crown": ((0.2, 0.1, 2.2), (3, 3, 2), "PERSP", 1.2),
    "above": ((0, 0, 20), (0, 0, 0), "PERSP", 0.5),
    "orthographic": ((0, -9, 2), (0, 0, 1.5), "ORTHO", 6.0),
    "orthographic in it": ((0, 0, 2), (0, 5, 1.5), "ORTHO", 6.0),
    "orthographic turned away": ((0, -9, 2), (0, -20, 2), "ORTHO", 6.0),
}


@pytest.mark.parametrize("place", CAMERAS)
@pytest.mark.parametrize("number", [1, 5])
@pytest.mark.parametrize("anchored", [False, True])
def test_cameras(place: str, number: int, anchored: bool) -> None:
    flora = support.small_flora()
    eye, target, kind, view = CAMERAS[place]
    seeds = support.grove(number, 2.0)
    _, result = run(flora, seeds, support.camera(eye, target, kind=kind, view=view), anchored=anchored)
    check(flora, seeds, result)
    assert result.complete
    seen = (result.decision == Decision.PROXY) | (result.decision == Decision.EXPLICIT)
    assert result.in_view[result.nodes[seen]].all()
    if "turned away" in place and anchored:
        # A piece of space that reaches into the view may keep a few polygons rather than be divided.
        assert (result.totals.polygons[result.decision != Decision.HIDDEN] <= RefinementSettings().few_polygons).all()
    elif "turned away" in place:
        assert (result.decision == Decision.HIDDEN).all()
        assert result.passes == 1
    elif place == "before it":
        assert (result.decision == Decision.EXPLICIT).any()
    elif place == "far away":
        # A root that reaches to the eye may keep a few polygons rather than be divided.
        few = RefinementSettings().few_polygons
        assert (result.totals.polygons[result.decision == Decision.EXPLICIT] <= few).all()


@pytest.mark.parametrize("eye", [(0.2, 0.1, 2.2), (0.0, 0.0, 0.5), (0.0, 0.0, 2.0)])
@pytest.mark.parametrize("sort", ["view", "anchored", "panorama"])
def test_an_eye_in_the_crown(sort: str, eye: tuple[float, ...]) -> None:
    """It ends, nothing is lost, and nothing large that is seen is left to a proxy."""
    flora, seeds = support.small_flora(), support.grove(5, 2.0)
    camera = support.camera(eye, (3, 3, 2), view=1.2, pixels=256, near=0.02)
    if sort == "panorama":
        sphere = (-np.pi, np.pi, -np.pi / 2, np.pi / 2)
        camera = replace(camera, kind="PANO", window=sphere, width=512, height=256)
    _, result = run(flora, seeds, camera, anchored=sort == "anchored")
    check(flora, seeds, result)
    assert result.complete
    large = feature_pixels(result.tree.vertices(result.nodes), result.totals.width, camera)[0] >= 0.5
    seen = result.transmittance > RefinementSettings().hidden
    assert not (large & seen & (result.decision == Decision.PROXY)).any()
    assert not (seen & (result.decision == Decision.HIDDEN)).any()
    if sort == "panorama":
        assert result.in_view[result.nodes].all()
        assert (result.decision == Decision.EXPLICIT).any()


@given(st.integers(0, 2**31), st.sampled_from([1.0, 4.0, 10.0]))
@settings(deadline=None, max_examples=8)
def test_random_views(seed: int, cutoff: float) -> None:
    """Nothing lost; no large leaf that is seen is left to a proxy; decisions are those of the last visibility."""
    flora = support.compiled(support.SMALL, support.shipped("bush"))
    rng = np.random.default_rng(seed)
    seeds = support.grove(6, 2.5, rng.integers(0, 2, 6))
    camera = support.camera(rng.uniform(-12, 12, 3) + [0, 0, 13], rng.uniform(-2, 2, 3), pixels=200)
    states, result = run(flora, seeds, camera, cutoff=cutoff)
    check(flora, seeds, result)
    assert [s.passes for s in [*states, result]] == list(range(1, len(states) + 2))
    large = feature_pixels(result.tree.vertices(result.nodes), result.totals.width, camera)[0] >= 0.5
    seen = result.transmittance > RefinementSettings().hidden
    assert not (large & seen & (result.decision == Decision.PROXY)).any()
    assert not (seen & (result.decision == Decision.HIDDEN)).any()


def test_states_on_the_way_are_ever_finer() -> None:
    flora = support.small_flora()
    states, result = run(flora, support.grove(9, 2.0), support.camera((0, -14, 3), (0, 0, 1.5), pixels=256))
    assert len(states) > 1
    assert all((s.decision == Decision.SPLIT).any() for s in states)
    numbers = [len(s.nodes) for s in [*states, result]]
    assert numbers[-1] > numbers[0]
    assert set(result.seconds) == {"visibility", "refinement", "update"}
    assert all(v >= 0 for v in result.seconds.values())


@pytest.mark.parametrize("limit", [60, 200, 1000])
def test_tetrahedra_are_limited(limit: int) -> None:
    """The limit holds from the second level on; what would have been split is decided all the same."""
    flora = support.small_flora()
    camera = support.camera((0, -14, 3), (0, 0, 1.5), pixels=600)
    seeds = support.grove(9, 2.0)
    _, result = run(flora, seeds, camera, max_tetrahedra=limit, cutoff=0.5, few_polygons=0, block=4)
    check(flora, seeds, result)
    assert result.tree.tetrahedra_made <= limit
    assert not result.complete
    assert not (result.decision == Decision.SPLIT).any()


def test_each_pass_is_reported_and_can_be_the_last() -> None:
    """Figures of every state on the way; a limit on passes gives the very same states, decided without divisions."""
    flora = support.small_flora()
    camera, seeds = support.camera((0, -14, 3), (0, 0, 1.5), pixels=256), support.grove(9, 2.0)
    loop = refine(flora, seeds, camera, RefinementSettings(**FAST))
    steps = []
    while True:
        try:
            steps.append(step_of(next(loop)))
        except StopIteration as stop:
            steps.append(step_of(stop.value))
            break
    assert len(steps) > 2
    for name in ("tetrahedra_made", "levels", "seconds"):
        values = [getattr(step, name) for step in steps]
        assert values == sorted(values)
        assert values[-1] > 0
    assert [step.split > 0 for step in steps] == [True] * (len(steps) - 1) + [False]
    assert all(step.memory_mb > 0 for step in steps)
    for passes, step in enumerate(steps, start=1):
        _, result = run(flora, seeds, camera, max_passes=passes)
        check(flora, seeds, result)
        last = step_of(result)
        assert result.passes == passes
        assert result.complete == (step.split == 0)
        for name in ("tetrahedra_made", "subplants", "pieces"):
            assert getattr(last, name) == getattr(step, name)
        assert last.split == 0
        assert last.proxy + last.explicit == step.proxy + step.explicit + step.split


@pytest.mark.parametrize("limit", [0, 1, 4, 7])
def test_generations_are_limited(limit: int) -> None:
    """Counted from the deepest piece of the root; with none, the root's own pieces are the result."""
    flora = support.small_flora()
    seeds = support.grove(9, 2.0)
    camera = support.camera((0, -14, 3), (0, 0, 1.5), pixels=600)
    root = view_root(camera, bounding_box(flora, trunks(flora.rows, seeds)))
    _, result = run(flora, seeds, camera, max_levels=limit, cutoff=0.5, few_polygons=0, block=4)
    check(flora, seeds, result)
    assert not result.complete
    if limit == 0:
        assert result.tree.levels == root.levels
    else:
        assert root.levels < result.tree.levels <= root.levels + limit


def test_a_finer_cutoff_divides_more() -> None:
    flora = support.small_flora()
    camera = support.camera((0, -60, 6), (0, 0, 1.5), pixels=256, view=0.3)
    limits = {"leaf_limit": 1e9}  # leaves divide space for reasons of their own
    made = [
        run(flora, support.grove(16, 2.5), camera, cutoff=c, **limits)[1].tree.tetrahedra_made for c in (8.0, 4.0, 2.0)
    ]
    assert made == sorted(made)
    assert made[-1] > made[0]


def test_what_stands_behind_a_wall_is_hidden() -> None:
    """A wall before half of the plants: theirs is hidden, the others are as without it."""
    flora = support.small_flora()
    seeds = support.plants(np.arange(8), position=[(x, 4.0, 0) for x in (-7, -5, -3.5, -2, 2, 3.5, 5, 7)])
    camera = support.camera((0, -14, 1.5), (0, 0, 1.5), pixels=256, view=1.6)
    low, high = (-40.0, 0.0, -20.0), (0.0, 0.0, 40.0)
    corners = [(low[0], 0, low[2]), (high[0], 0, low[2]), (high[0], 0, high[2]), (low[0], 0, high[2])]
    wall = np.array([[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]], float)
    _, free = run(flora, seeds, camera)
    _, walled = run(flora, seeds, camera, wall)
    for result, expected in ((free, False), (walled, True)):
        vertices = result.tree.vertices(result.nodes)
        behind = (vertices[:, :, 0].max(axis=1) < -0.5) & (vertices[:, :, 1].min(axis=1) > 0)
        assert behind.any()
        assert (result.decision[behind] == Decision.HIDDEN).all() == expected
        assert (result.decision == Decision.EXPLICIT).any()
    assert walled.tree.tetrahedra_made < free.tree.tetrahedra_made


def test_dense_plants_hide_those_behind() -> None:
    """Two rows of bushes: the fraction that is hidden grows toward the back."""
    flora = support.alone("bush")
    rows = np.repeat([0.0, 30.0], 12)
    seeds = support.plants(np.arange(24), 0, np.stack([np.tile(np.arange(12) - 5.5, 2), rows, 0 * rows], axis=1))
    _, result = run(flora, seeds, support.camera((0, -12, 0.8), (0, 0, 0.8), pixels=200, view=0.5))
    depth = result.tree.vertices(result.nodes).mean(axis=1)[:, 1]
    fraction, area, seen = result.transmittance, result.totals.leaf_area + 1e-12, result.cells.pixels > 0
    front, back = (np.average(fraction[m], weights=area[m]) for m in (seen & (depth < 10), seen & (depth > 20)))
    assert back < 0.5 * front


def test_the_same_scene_twice_is_the_same_result() -> None:
    flora = support.small_flora()
    camera = support.camera((3, -10, 3), (0, 0, 1.5))
    a, b = (run(flora, support.grove(5, 2.0), camera)[1] for _ in range(2))
    assert (a.decision == b.decision).all()
    assert (a.nodes == b.nodes).all()
    assert (a.rank == b.rank).all()
    assert (a.plants.points.position == b.plants.points.position).all()


def test_mean_extinction() -> None:
    """3 m² of leaf and a closed box in 5 m³, against the mean of the shadows that they cast in all directions."""
    ways = np.random.default_rng(1).normal(size=(100_000, 3))
    ways = np.abs(ways) / np.linalg.norm(ways, axis=1)[:, None]
    a, b, c = 0.2, 0.3, 4.0
    shadows = 3.0 * ways[:, 2] + ways @ [b * c, a * c, a * b]
    one = np.ones(1)
    held = Totals(leaf_area=3.0 * one, wood_area=2.0 * (b * c + a * c + a * b) * one, polygons=one, width=one)
    assert mean_extinction(held, 5.0 * one) == pytest.approx(shadows.mean() / 5.0, rel=0.01)


def test_a_loop_that_is_stopped_returns_what_it_has() -> None:
    """Everything is decided, nothing is left to divide, and all plants are still there."""
    flora = support.small_flora()
    camera = support.camera((0, -30, 6), (0, 0, 1.5), pixels=128, view=0.4)
    seeds = support.grove(9, 2.5)
    steps = refine(flora, seeds, camera, RefinementSettings(cutoff=1.0))
    next(steps)
    state = next(steps)
    assert (state.decision == Decision.SPLIT).any()
    with pytest.raises(StopIteration) as stop:
        steps.send(True)
    result = stop.value.value
    assert not result.complete
    assert not (result.decision == Decision.SPLIT).any()
    assert result.passes == state.passes
    check(flora, seeds, result)


@given(st.integers(0, 2**31))
@settings(deadline=None, max_examples=6)
def test_the_order_of_plants_does_not_matter(seed: int) -> None:
    """The same parts, and the same totals and decisions of the same tetrahedra."""
    flora = support.compiled(support.SMALL, support.shipped("bush"))
    rng = np.random.default_rng(seed)
    seeds = support.grove(8, 2.2, rng.integers(0, 2, 8))
    order = rng.permutation(8)
    camera = support.camera(rng.uniform(-12, 12, 3) + [0, 0, 13], rng.uniform(-2, 2, 3), pixels=200)
    one, other = (run(flora, some, camera)[1] for some in (seeds, seeds.take(order)))
    np.testing.assert_array_equal(one.nodes, other.nodes)
    np.testing.assert_array_equal(one.decision, other.decision)
    for name in ("leaf_area", "wood_area", "polygons", "width"):
        np.testing.assert_allclose(getattr(one.totals, name), getattr(other.totals, name), rtol=1e-6)
    branches = [r.plants.parts.branches.take(np.argsort(r.plants.parts.branches.key)) for r in (one, other)]
    np.testing.assert_array_equal(branches[0].key, branches[1].key)
    np.testing.assert_array_equal(branches[0].position, branches[1].position)
    np.testing.assert_array_equal(branches[0].plant, order[branches[1].plant])


@pytest.mark.parametrize("species", ["birch", "conifer", "bush"])
@pytest.mark.parametrize("view", [((0, -22, 2), (0, 0, 4)), ((1, 1, 1.7), (9, 9, 4))], ids=("edge", "within"))
def test_what_is_hidden_is_not_opened_more_than_what_is_seen(species: str, view: tuple) -> None:
    """In a small wood, hidden tetrahedra hold no more of the parts that plants have been opened into than seen ones."""
    flora = support.alone(species, 50_000.0)
    _, result = run(flora, support.grove(49, 4.0), support.camera(*view, pixels=480, view=1.0))
    subplants, bodies = result.plants.held_apart(len(result.tree))
    of_opened = subplants.cell[subplants.items.row != flora.first_row[0]]
    cell = np.concatenate([of_opened, bodies.cell])
    hidden = result.chosen(Decision.HIDDEN)[cell]
    assert (~hidden).sum() > 500
    assert hidden.sum() <= (~hidden).sum()


def test_buffers_are_no_finer_than_the_image(monkeypatch: pytest.MonkeyPatch) -> None:
    """A picture of 64 pixels took 9 s for occluders in a buffer of 4,096: found by an attack."""
    asked: list[int] = []
    plain = loop.Buffers
    monkeypatch.setattr(loop, "Buffers", lambda camera, size, *rest: asked.append(size) or plain(camera, size, *rest))
    flora, seeds = support.small_flora(), support.plants([1], position=[(0, 0, 0)])
    found = [
        run(flora, seeds, support.camera((0, -8, 2), (0, 0, 2), pixels=pixels), visibility_resolution=size)
        for pixels, size in ((64, 4096), (64, 256), (600, 4096), (600, 64))
    ]
    assert asked[:3] == [256, 256, asked[2]]
    assert 600 <= asked[2] < 700  # a margin around it
    assert asked[3] == 64
    assert np.array_equal(found[0][1].nodes, found[1][1].nodes)
