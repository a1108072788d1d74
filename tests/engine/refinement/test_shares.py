# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants shared among tetrahedra: however space is divided, each branch is in one part, and all area is somewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.engine import support
from tests.engine.growth.test_drawn import flora as drawn_flora
from tetflora_addon.arrays import Arrays
from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seeds import Branches, Seeds
from tetflora_addon.growth.wind import Wind
from tetflora_addon.refinement import shared_parts
from tetflora_addon.refinement.contents import PlantParts, Totals, bounding_box, subplant_totals, sums
from tetflora_addon.refinement.loop import refine, step_of
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.refinement.shared_parts import LARGE, SharedPlants, _share_points, opened
from tetflora_addon.subplants.pieces import expand
from tetflora_addon.tetrahedra.geometry import squared_edges, volume
from tetflora_addon.tetrahedra.roots import view_root
from tetflora_addon.tetrahedra.tree import TetrahedralTree

VIEWS = st.tuples(st.integers(0, 2**31), st.sampled_from(["PERSP", "ORTHO"]))


def bare() -> Flora:
    """Plants without leaves, of which the first order has none to bear either."""
    return support.compiled(support.small(order1={"leaves": [0, 0]}, order2={"leaves": [0, 0]}))


FLORAS = {
    "small": support.small_flora,
    "rich": lambda: support.compiled(support.RICH),
    "bare": bare,
    "drawn": drawn_flora,
    "windy": lambda: support.compiled(support.RICH).in_wind(Wind(12.0, 0.4, 0.5, 3.0)),
    "moving": lambda: support.small_flora().in_wind(Wind(12.0, 0.4, 0.5, 3.0, 0.0, moving=True)),
    "drawn in the wind": lambda: drawn_flora().in_wind(Wind(12.0, 0.4, 0.5, 3.0)),
}


def camera_of(rng: np.random.Generator, kind: str) -> Camera:
    """Beside, among, above and below the plants."""
    eye = rng.uniform(-12, 12, 3) * [1, 1, 0.3] + [0, 0, 2]
    return support.camera(eye, rng.uniform(-3, 3, 3), kind=kind, view=0.8 if kind == "PERSP" else 6.0)


def divide(tree: TetrahedralTree, plants: SharedPlants, nodes: NDArray[np.integer], times: int = 2) -> NDArray:
    """Divide nodes of the tree and hand on what is in them, as a pass of the loop does; which nodes have changed."""
    edge = np.sqrt(squared_edges(tree.vertices(nodes)).max(axis=1))
    parents = nodes
    for _ in range(times):
        nodes = tree.split(nodes).ravel()
    dividing, edges = np.zeros(len(tree), bool), np.zeros(len(tree))
    dividing[parents], edges[parents] = True, edge
    return plants.update(tree, dividing, edges)


def shared(
    flora: Flora, seeds: Seeds, seed: int, kind: str = "PERSP", rounds: int = 2
) -> tuple[TetrahedralTree, SharedPlants]:
    """Plants in a tree that a random camera roots and random choices divide until some are opened, and then again."""
    rng = np.random.default_rng(seed)
    camera = camera_of(rng, kind)
    plants = SharedPlants(flora, seeds, camera)
    tree = view_root(camera, bounding_box(flora, plants.parts.branches))
    root = np.arange(len(tree)) == 0
    plants.update(tree, root, np.where(root, np.inf, 0.0))
    opened_first = plants.parts.branch_only.sum()  # thick wood in view is opened before anything is divided
    closed = plants.parts.can_open(flora).any()  # not where the camera is that near to all of them
    while rounds > 0:
        rounds -= bool(plants.parts.branch_only.sum() > opened_first or not closed)
        nodes = np.unique(plants.points.cell)
        divide(tree, plants, nodes[rng.random(len(nodes)) < 0.7])
    return tree, plants


def names(*some: Branches) -> NDArray[np.uint64]:
    """Plant and key (n, 2) of branches, sorted."""
    every = np.concatenate([np.stack([b.plant.astype(np.uint64), b.key], axis=1) for b in some])
    return every[np.lexsort(every.T)]


def check_whole(flora: Flora, seeds: Seeds, plants: SharedPlants) -> None:
    """Each branch of the plants, grown whole, is in one part; nothing is lost or held twice."""
    parts = plants.parts
    closed = parts.branches.take(np.flatnonzero(~parts.branch_only))
    grown = [some.branches for some in expand(flora, closed)]
    found = names(parts.branches.take(np.flatnonzero(parts.branch_only)), *grown)
    wanted = names(*(some.branches for some in expand(flora, trunks(flora.rows, seeds))))
    np.testing.assert_array_equal(found, wanted)


def check_points(tree: TetrahedralTree, plants: SharedPlants) -> None:
    """Points carry the areas of their parts, and are where they are said to be."""
    parts, points = plants.parts, plants.points
    for own, whole in ((points.leaf, parts.totals.leaf_area), (points.wood, parts.totals.wood_area)):
        np.testing.assert_allclose(np.bincount(points.part, own, len(parts)), whole, rtol=1e-6)
        assert (own >= 0).all()
    assert (tree.children[points.cell, 0] < 0).all()
    size = np.abs(tree.vertices(tree.terminals())).max()
    vertices, place = tree.vertices(points.cell), points.position.astype(np.float64)
    distance = np.einsum("nfi,ni->nf", support.face_planes(vertices)[..., :3], place)
    assert (distance + support.face_planes(vertices)[..., 3]).max() < 1e-6 * size


@pytest.mark.parametrize("kind", FLORAS)
@given(VIEWS)
@settings(deadline=None, max_examples=4)
def test_nothing_is_lost_or_held_twice(kind: str, view: tuple[int, str]) -> None:
    """Every branch is in one part; points carry all area, each in the tetrahedron that contains it."""
    flora, seeds = FLORAS[kind](), support.grove(4, 2.5)
    tree, plants = shared(flora, seeds, *view)
    assert plants.parts.branch_only.any()
    check_whole(flora, seeds, plants)
    check_points(tree, plants)


@given(VIEWS)
@settings(deadline=None, max_examples=10)
def test_sums_over_nodes_are_sums_over_parts(view: tuple[int, str]) -> None:
    """Of areas and polygons, whichever way they are asked for; nodes outside the choice have nothing."""
    flora = support.compiled(support.SMALL, support.shipped("bush"))
    tree, plants = shared(flora, support.grove(6, 2.0, [0, 1, 0, 0, 1, 0]), *view)
    nodes, whole = len(tree), plants.parts.totals
    every = sums(*plants.totals(np.ones(nodes, bool)), nodes)
    chosen = np.random.default_rng(view[0]).random(nodes) < 0.5
    some = sums(*plants.totals(chosen), nodes)
    subplants, bodies = plants.held_apart(nodes)
    cells = np.concatenate([subplants.cell, bodies.cell])
    held = sums(Totals.concatenate([subplants.totals, bodies.totals]), cells, nodes)
    for name in ("leaf_area", "wood_area", "polygons", "width"):
        by_node = getattr(every, name)
        np.testing.assert_allclose(getattr(some, name), np.where(chosen, by_node, 0.0), rtol=1e-9)
        np.testing.assert_allclose(getattr(held, name), by_node, rtol=1e-6, atol=1e-12)
        if name != "width":
            assert by_node.sum() == pytest.approx(getattr(whole, name).sum(), rel=1e-6)
    filled = every.area > 0
    assert every.width[filled].min() > 0
    assert every.width.max() <= whole.width.max() * (1 + 1e-6)
    # Each part once for each node that holds some of it.
    table = np.stack([subplants.items.key, subplants.cell.astype(np.uint64)], axis=1)
    assert len(np.unique(table, axis=0)) == len(table)
    assert (bodies.items.t0 == 0).all()
    assert (bodies.items.t1 == 1).all()


def test_opening_keeps_areas_on_average() -> None:
    """Of many plants: what is expected of a sub-plant is about what is expected of its parts."""
    flora, seeds = support.small_flora(), support.grove(300, 1.5)
    whole = subplant_totals(flora, trunks(flora.rows, seeds))
    _, plants = shared(flora, seeds, 3)
    assert plants.parts.branch_only.mean() > 0.05
    for name in ("leaf_area", "wood_area"):
        assert getattr(plants.parts.totals, name).sum() == pytest.approx(getattr(whole, name).sum(), rel=0.03)


@given(VIEWS)
@settings(deadline=None, max_examples=8)
def test_only_what_is_large_beside_its_tetrahedron_is_opened(view: tuple[int, str]) -> None:
    """A sub-plant is opened where a tetrahedron that holds some of it is divided and is not much larger.

    All others stay whole, and nodes that are not said to have changed hold what they held.
    """
    flora = support.compiled(support.RICH)
    tree, plants = shared(flora, support.grove(4, 2.5), *view, rounds=1)
    rng = np.random.default_rng(view[0])
    for _ in range(3):
        nodes = np.unique(plants.points.cell)
        nodes = nodes[rng.random(len(nodes)) < 0.4]
        if len(nodes) == 0:
            continue
        parts, points = plants.parts, plants.points
        edge = np.zeros(len(tree))
        edge[nodes] = np.sqrt(squared_edges(tree.vertices(nodes)).max(axis=1))
        cell = points.cell
        beside = np.isin(cell, nodes) & (parts.extent[points.part] > LARGE * edge[cell])
        large = np.bincount(points.part[beside], minlength=len(parts)) > 0
        before = sums(*plants.totals(np.ones(len(tree), bool)), len(tree))
        changed = divide(tree, plants, nodes)
        kept = np.isin(parts.branches.key, plants.parts.branches.key[~plants.parts.branch_only]) & ~parts.branch_only
        np.testing.assert_array_equal(kept, ~parts.branch_only & ~(large & parts.can_open(flora)))
        assert changed[nodes].all()
        after = sums(*plants.totals(np.ones(len(tree), bool)), len(tree))
        same = np.flatnonzero(~changed[: len(before.area)])
        np.testing.assert_array_equal(after.leaf_area[same], before.leaf_area[same])
        np.testing.assert_array_equal(after.polygons[same], before.polygons[same])


@pytest.mark.parametrize("kind", FLORAS)
def test_points_are_on_their_parts(kind: str) -> None:
    """Those of sub-plants within the bound of their samples; those of branches alone on their axes, leaves beyond
    where these begin."""
    flora, camera = FLORAS[kind](), support.camera((0, -9, 2), (0, 0, 2))
    plants = SharedPlants(flora, support.grove(4, 2.5), camera)
    parts, lines, seen = plants.parts, None, set()
    level = [(parts, lines)]
    while level:
        parts, lines = level.pop()
        points = _share_points(flora, parts, plants.pixels(parts), lines)
        assert len(np.unique(points.part)) == len(parts)
        branches = parts.branches.take(points.part)
        if lines is None:
            seen.add("whole")
            local = np.einsum("nij,ni->nj", branches.frame, points.position - branches.position)
            bound = flora.sampled_bound[branches.row] * branches.length[:, None]
            reach = 1e-5 * (1.0 + branches.length)
            assert (np.hypot(local[:, 0], local[:, 1]) <= bound[:, 0] + reach).all()
            assert (local[:, 2] >= bound[:, 1] - reach).all()
            assert (local[:, 2] <= bound[:, 2] + reach).all()
            closed = parts.take(np.flatnonzero(parts.can_open(flora))[:200])
            level += [(new, axes) for new, _, axes in opened(flora, closed)]
        else:
            seen.add("alone")
            t = np.linspace(0, 1, 400)
            for i in np.flatnonzero(points.leaf >= 0)[:: max(len(points) // 50, 1)]:
                own = np.full(len(t), points.part[i])
                way = np.linalg.norm(lines.at(own, t)[0] - points.position[i], axis=1)
                assert way.min() <= branches.length[i] / 300
                if points.leaf[i] > 0:
                    assert t[way.argmin()] >= flora.rows["leaf_start"][branches.row[i]] @ [1, -1] - 0.01
    assert seen == {"whole", "alone"}


def test_more_points_where_there_are_more_pixels() -> None:
    """Their number is limited on both sides; a part without leaves, or without wood, has points for the other only."""
    flora = support.small_flora()
    parts = PlantParts.of_subplants(flora, trunks(flora.rows, support.plants(np.zeros(6, int))))
    numbers = np.bincount(_share_points(flora, parts, np.array([0.0, 1.0, 50.0, 200.0, 1e4, 1e9])).part)
    assert (np.diff(numbers) >= 0).all()
    assert numbers[0] == numbers[1] < numbers[2] < numbers[3] <= numbers[4] == numbers[5]
    leafless = replace(parts, totals=replace(parts.totals, leaf_area=np.zeros(6)))
    points = _share_points(flora, leafless, np.full(6, 100.0))
    assert (points.leaf == 0).all()
    np.testing.assert_allclose(np.bincount(points.part, points.wood), parts.totals.wood_area, rtol=1e-6)
    assert np.allclose(points.optical_area, points.wood / 2)


def columns_of(rows: Arrays) -> list[NDArray]:
    """All arrays of a structure."""
    own = [value for value in vars(rows).values() if value is not None]
    return [a for value in own for a in (columns_of(value) if isinstance(value, Arrays) else [value])]


def check_same(one: SharedPlants, other: SharedPlants) -> None:
    """To the bit, and in the same order."""
    for a, b in ((one.parts, other.parts), (one.points, other.points)):
        assert len(columns_of(a)) == len(columns_of(b)) > 4
        for mine, its in zip(columns_of(a), columns_of(b), strict=True):
            np.testing.assert_array_equal(mine, its)


#: What may be asked of plants between two passes.
QUESTIONS = {
    "parts": lambda plants, tree: plants.parts,
    "points": lambda plants, tree: plants.points,
    "held": lambda plants, tree: plants.held_apart(len(tree)),
    "numbers": lambda plants, tree: plants.numbers,
    "bytes": lambda plants, tree: plants.nbytes,
}


@given(VIEWS, st.lists(st.lists(st.sampled_from(sorted(QUESTIONS)), max_size=3), min_size=3, max_size=5))
@settings(deadline=None, max_examples=4)
def test_what_is_asked_on_the_way_changes_nothing(view: tuple[int, str], asked: list[list[str]]) -> None:
    """Each pass changes the same nodes and gives them the same totals, and the same parts and points are left.

    What is asked is right, and no area is lost.
    """
    flora, seeds, rng = support.compiled(support.RICH), support.grove(4, 2.5), np.random.default_rng(view[0])
    camera = camera_of(rng, view[1])
    one, other = (SharedPlants(flora, seeds, camera) for _ in range(2))
    tree = view_root(camera, bounding_box(flora, one.parts.branches))
    root = np.arange(len(tree)) == 0
    for plants in (one, other):
        plants.update(tree, root, np.where(root, np.inf, 0.0))
    opened_first, rounds = one.numbers[1], 0
    for _ in range(len(asked) + 7):  # where the camera sees little, nothing is opened at all
        if rounds == len(asked):
            break
        nodes = np.unique(one.totals(np.ones(len(tree), bool))[1])
        nodes = nodes[rng.random(len(nodes)) < 0.5]
        longest = np.sqrt(squared_edges(tree.vertices(nodes)).max(axis=1))
        tree.split(tree.split(nodes).ravel())
        edge = np.zeros(len(tree))
        edge[nodes] = longest
        changed = [plants.update(tree, edge > 0.0, edge) for plants in (one, other)]
        np.testing.assert_array_equal(*changed)
        if one.numbers[1] == opened_first:
            continue  # nothing is opened so far
        questions, rounds = asked[rounds], rounds + 1
        for question in questions:
            QUESTIONS[question](other, tree)
        if "parts" in questions:
            check_whole(flora, seeds, other)
            check_points(tree, other)
        (mine, cell), (its, same_cell) = (plants.totals(changed[0]) for plants in (one, other))
        np.testing.assert_array_equal(cell, same_cell)
        for a, b in zip(columns_of(mine), columns_of(its), strict=True):
            np.testing.assert_array_equal(a, b)
        assert one.numbers == other.numbers
    every, _ = one.totals(np.ones(len(tree), bool))
    assert one.numbers == ((~one.parts.branch_only).sum(), one.parts.branch_only.sum())
    for name in ("leaf_area", "wood_area", "polygons"):
        assert getattr(every, name).sum(dtype=float) == pytest.approx(getattr(one.parts.totals, name).sum(), rel=1e-6)
    check_same(one, other)
    check_whole(flora, seeds, one)
    check_points(tree, one)


def test_what_is_asked_of_a_state_of_the_loop_changes_nothing() -> None:
    """Parts of each state are right; the result is that of a loop of which nobody asks anything."""
    flora, seeds = support.compiled(support.RICH), support.grove(9, 2.0)
    camera, given = support.camera((0, -7, 3), (0, 0, 1.5), pixels=256), RefinementSettings(visibility_resolution=64)
    results, pieces = [], set()
    for asking in (False, True):
        states = refine(flora, seeds, camera, given)
        while True:
            try:
                state = next(states)
            except StopIteration as stop:
                results.append(stop.value)
                break
            step = step_of(state)
            pieces.add(step.pieces)
            if asking:
                check_whole(flora, seeds, state.plants)
                check_points(state.tree, state.plants)
                assert step.pieces == state.plants.parts.branch_only.sum()
                assert step.subplants + step.pieces == len(state.plants.parts)
    one, other = results
    assert len(pieces) > 2  # some are opened more than once
    check_same(one.plants, other.plants)
    np.testing.assert_array_equal(one.decision, other.decision)
    np.testing.assert_array_equal(one.transmittance, other.transmittance)


#: A solid of leaves, which cannot be opened.
SOLID = {"length": [2, 0], "thickness": [0.1, 0], "leaves": [90, 0], "leaf_size": [0.1, 0], "leaf_envelope": "box"}


def test_parts_in_front_of_each_other_have_no_more_points_than_a_limit() -> None:
    """A tuft of 5,000 solids had ten million points; one alone has as many as it had, and no area is lost."""
    flora = support.compiled({**support.small(), "orders": [SOLID]})
    numbers = []
    for count in (1, 50):
        parts = PlantParts.of_subplants(flora, trunks(flora.rows, support.grove(count, 0.5)))
        points = _share_points(flora, parts, np.full(count, 1e4), room=5_000)
        leaves = points.take(np.flatnonzero(points.leaf > 0))
        area = np.bincount(leaves.part, leaves.leaf, count)
        np.testing.assert_allclose(area, parts.totals.leaf_area, rtol=1e-5)
        assert np.bincount(leaves.part, minlength=count).min() >= shared_parts.FEWEST_IN_SOLID
        numbers.append(len(leaves) - count * shared_parts.FEWEST_IN_SOLID)
    assert numbers[0] == shared_parts.MOST_IN_SOLID - shared_parts.FEWEST_IN_SOLID
    assert 4_900 < numbers[1] <= 5_000


@pytest.mark.parametrize("solid", [True, False])
def test_the_limit_of_points_holds_for_all_calls_together(solid: bool) -> None:
    """Solids, or plants as large as the image, that come some at a time have no more than all at once."""
    flora = support.compiled({**support.small(), "orders": [SOLID]} if solid else support.small())
    camera = support.camera((0, -1e-2, 0), (0, 0, 0))
    plants = SharedPlants(flora, support.plants([]), camera)
    parts = PlantParts.of_subplants(flora, trunks(flora.rows, support.grove(2_000, 1e-3)))
    least = shared_parts.FEWEST_IN_SOLID if solid else shared_parts.FEWEST
    made = sum(len(plants.points_on(parts, None)) - 2_000 * least for _ in range(9))
    assert made <= (1.0 + shared_parts.WOOD) * shared_parts.MOST_BEYOND + 9 * 2_000 * (1 + shared_parts.WOOD * least)


def test_nobody_is_shared_by_nobody() -> None:
    flora = support.small_flora()
    plants = SharedPlants(flora, support.plants([]), support.camera((0, -9, 2), (0, 0, 2)))
    tree = view_root(plants.camera, np.array([[-1.0, -1, 0], [1, 1, 2]]))
    dividing = np.arange(len(tree)) == 0
    assert (plants.update(tree, dividing, np.ones(len(tree))) == dividing).all()
    assert [len(held) for held in plants.held_apart(len(tree))] == [0, 0]
    assert plants.nbytes == 0


@given(VIEWS)
@settings(deadline=None, max_examples=20)
def test_terminals_fill_the_root(view: tuple[int, str]) -> None:
    """Volumes before and after division agree to 1e-12, and no terminal is flat or turned inside out."""
    flora = support.small_flora()
    rng = np.random.default_rng(view[0])
    camera = support.camera(rng.uniform(-9, 9, 3), rng.uniform(-2, 2, 3), kind=view[1], view=2.0)
    tree = view_root(camera, bounding_box(flora, trunks(flora.rows, support.grove(3, 2.0))))
    before = volume(tree.vertices(tree.terminals())).sum()
    divided_at = tree.terminals()
    for _ in range(6):
        divided_at = tree.split(divided_at[rng.random(len(divided_at)) < 0.7]).ravel()
    after = volume(tree.vertices(tree.terminals()))
    assert (after > 0).all()
    assert after.sum() == pytest.approx(before, rel=1e-12)
