# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances of assets shared among tetrahedra: all of their area is somewhere, however they stand and in any order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from tests.engine import support
from tests.engine.assets import trees
from tetflora_addon.assets.asset import Asset, AssetTable, Instances
from tetflora_addon.refinement.contents import sums
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement, refine
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.refinement.shared_parts import AssetParts, PlacedAssets, SharedAssets
from tetflora_addon.tetrahedra.geometry import squared_edges
from tetflora_addon.tetrahedra.roots import view_root
from tetflora_addon.tetrahedra.tree import TetrahedralTree

FAST = {"visibility_resolution": 64, "max_tetrahedra": 20_000}
SEEDS = st.integers(0, 2**31)


def instances(position: ArrayLike, linear: ArrayLike | None = None, asset: ArrayLike = 0, first: int = 0) -> Instances:
    """Instances at places (n, 3), upright and of size 1 if nothing else is said."""
    position = np.atleast_2d(np.asarray(position, float))
    n = len(position)
    linear = np.tile(np.eye(3), (n, 1, 1)) if linear is None else np.asarray(linear, float)
    keys = np.arange(first, first + n, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    return Instances(np.broadcast_to(np.asarray(asset, np.int32), n).copy(), linear, position, keys)


def placed_of(*assets: Asset, at: ArrayLike = (0, 0, 0), linear: ArrayLike | None = None) -> PlacedAssets:
    """All assets at all places in turn."""
    at = np.atleast_2d(np.asarray(at, float))
    own = instances(at, linear, np.arange(len(at)) % len(assets))
    return PlacedAssets(AssetTable.of(assets), own)


def grove(
    count: int, spacing: float, seed: int = 0, kinds: tuple[str, ...] = ("tree", "varied", "closed")
) -> PlacedAssets:
    """A square of trees, turned and of several sizes."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(count)))
    index = np.arange(count)
    at = np.stack([index % side, index // side, 0 * index], axis=1) * spacing - np.array([1, 1, 0]) * side * spacing / 2
    turn = rng.uniform(0, 2 * np.pi, count)
    linear = np.tile(np.eye(3), (count, 1, 1))
    linear[:, 0, 0] = linear[:, 1, 1] = np.cos(turn)
    linear[:, 1, 0] = np.sin(turn)
    linear[:, 0, 1] = -np.sin(turn)
    return placed_of(*map(trees.compiled, kinds), at=at, linear=linear * rng.uniform(0.7, 1.3, count)[:, None, None])


def any_linear(seed: int, count: int) -> NDArray[np.float64]:
    """Turned, stretched, sheared and mirrored (n, 3, 3)."""
    rng = np.random.default_rng(seed)
    linear = trees.turns(rng, count) * rng.uniform(0.5, 2.0, (count, 1, 1))
    kind = rng.integers(0, 4, count)
    linear[kind == 1] *= rng.uniform(0.4, 2.0, (int((kind == 1).sum()), 1, 3))
    linear[kind == 2, :, 0] *= -1.0
    sheared = np.tile(np.eye(3), (int((kind == 3).sum()), 1, 1))
    sheared[:, 0, 2] = rng.uniform(-1, 1, len(sheared))
    linear[kind == 3] = linear[kind == 3] @ sheared
    return linear


def opened_to_the_end(placed: PlacedAssets) -> AssetParts:
    """The smallest clusters of all instances."""
    shared = SharedAssets(placed, support.camera((0, -9, 2), (0, 0, 2)))
    left, done = shared.parts, [AssetParts.empty()]
    while len(left):
        again = shared.can_open(left)
        done.append(left.take(~again))
        left = AssetParts.concatenate([AssetParts.empty(), *(new for new, *_ in shared.opened(left.take(again)))])
    return AssetParts.concatenate(done)


def in_a_tree(placed: PlacedAssets, seed: int, rounds: int = 2) -> tuple[TetrahedralTree, SharedAssets]:
    """Instances in a tree that random choices divide until some are opened, twice."""
    rng = np.random.default_rng(seed)
    eye = rng.uniform(-12, 12, 3) * [1, 1, 0.3] + [0, 0, 2]
    camera = support.camera(eye, rng.uniform(-3, 3, 3))
    shared = SharedAssets(placed, camera)
    tree = view_root(camera, support.box_around(shared.parts))
    root = np.arange(len(tree)) == 0
    shared.update(tree, root, np.where(root, np.inf, 0.0))
    while rounds > 0:
        rounds -= len(shared.parts) > len(placed)
        nodes = np.unique(shared.points.cell)
        divide(tree, shared, nodes[rng.random(len(nodes)) < 0.7])
    return tree, shared


def divide(tree: TetrahedralTree, shared: SharedAssets, nodes: NDArray[np.integer]) -> NDArray[np.bool_]:
    edge = np.sqrt(squared_edges(tree.vertices(nodes)).max(axis=1))
    parents = nodes
    for _ in range(2):
        nodes = tree.split(nodes).ravel()
    dividing, edges = np.zeros(len(tree), bool), np.zeros(len(tree))
    dividing[parents], edges[parents] = True, edge
    return shared.update(tree, dividing, edges)


def check_cover(placed: PlacedAssets, parts: AssetParts) -> None:
    """Every face of every instance is in exactly one part."""
    clusters = placed.assets.clusters
    asset = placed.instances.asset[parts.instance]
    first = clusters.first_face[parts.cluster]
    last = first + clusters.faces[parts.cluster]
    assert (np.searchsorted(placed.assets.root, parts.cluster, side="right") - 1 == asset).all()
    for instance in range(len(placed)):
        own = np.flatnonzero(parts.instance == instance)
        own = own[np.argsort(first[own])]
        assert first[own[0]] == 0
        assert np.array_equal(first[own[1:]], last[own[:-1]])
        assert last[own[-1]] == placed.assets.every[placed.instances.asset[instance]].faces


def check(placed: PlacedAssets, shared: SharedAssets, tree: TetrahedralTree, even: bool = True) -> None:
    parts, points = shared.parts, shared.points
    check_cover(placed, parts)
    for own, whole in ((points.leaf, parts.totals.leaf_area), (points.wood, parts.totals.wood_area)):
        assert np.bincount(points.part, own, len(parts)) == pytest.approx(whole, rel=1e-5, abs=1e-9)
        assert (own >= 0).all()
    assert (tree.children[points.cell, 0] < 0).all()
    nodes = len(tree)
    found = sums(*shared.totals(np.ones(nodes, bool)), nodes)
    held = shared.held(nodes)
    of_held = sums(held.totals, held.cell, nodes)
    wholes = placed.wholes().totals
    for name in ("leaf_area", "wood_area", "polygons"):
        assert getattr(of_held, name) == pytest.approx(getattr(found, name), rel=1e-6, abs=1e-9)
        if even:
            assert getattr(found, name).sum() == pytest.approx(getattr(wholes, name).sum(), rel=1e-5)
    away = np.linalg.norm(points.position - parts.center[points.part], axis=1)
    assert (away <= parts.reach[points.part] * (1 + 1e-5) + 1e-5).all()


@given(SEEDS, st.integers(1, 12))
@settings(max_examples=10)
def test_nothing_is_lost_or_held_twice(seed: int, count: int) -> None:
    placed = grove(count, 3.0, seed)
    tree, shared = in_a_tree(placed, seed)
    assert len(shared.parts) > len(placed)
    check(placed, shared, tree)


@given(SEEDS)
@settings(max_examples=10)
def test_children_are_all_of_their_parent(seed: int) -> None:
    """Area, faces and bounds, at every level; also of those that are stretched, to some percent."""
    placed = placed_of(
        *map(trees.compiled, ("tree", "closed", "skeleton")), at=np.zeros((9, 3)), linear=any_linear(seed, 9)
    )
    shared = SharedAssets(placed, support.camera((0, -9, 2), (0, 0, 2)))
    left = shared.parts
    while True:
        left = left.take(shared.can_open(left))
        if not len(left):
            return
        ((new, of, _),) = shared.opened(left)
        area = np.bincount(of, new.totals.area, len(left))
        even = ~placed.stretched[left.instance]
        assert area[even] == pytest.approx(left.totals.area[even], rel=1e-6)
        assert area[~even] == pytest.approx(left.totals.area[~even], rel=0.35)
        assert np.array_equal(np.bincount(of, new.totals.polygons, len(left)), left.totals.polygons)
        away = np.linalg.norm(new.center - left.center[of], axis=1)
        assert (away <= left.reach[of] * (1 + 1e-9)).all()
        left = new


@given(SEEDS)
@settings(max_examples=10)
def test_areas_and_bounds_are_those_of_real_triangles(seed: int) -> None:
    """However an instance is stretched, sheared or mirrored."""
    kinds = ("tree", "varied", "closed", "skeleton")
    linear = any_linear(seed, 8)
    placed = placed_of(*map(trees.compiled, kinds), at=np.random.default_rng(seed).normal(size=(8, 3)), linear=linear)
    parts = opened_to_the_end(placed)
    wholes = placed.wholes()
    for i in range(8):
        corners, *_, coverage = trees.triangles_of(trees.source(kinds[i % 4]))
        world = corners @ linear[i].T + placed.instances.position[i]
        true = (trees.areas_of(world) * coverage).sum()
        own = parts.take(parts.instance == i)
        assert own.totals.area.sum() == pytest.approx(true, rel=0.03 if placed.stretched[i] else 1e-6)
        assert wholes.totals.area[i] == pytest.approx(true, rel=0.12 if placed.stretched[i] else 1e-6)
        away = np.linalg.norm(world.reshape(-1, 3) - wholes.center[i], axis=1)
        assert away.max() <= wholes.reach[i] * (1 + 1e-9)


@given(SEEDS)
def test_no_length_becomes_larger_than_is_said(seed: int) -> None:
    own = instances(np.zeros((40, 3)), any_linear(seed, 40))
    spectral = np.linalg.norm(own.linear, 2, axis=(1, 2))
    assert (own.largest >= spectral * (1 - 1.1e-3)).all()
    assert (own.largest <= spectral * 1.74).all()
    assert own.scale == pytest.approx(np.abs(np.linalg.det(own.linear)) ** (1 / 3))


@given(SEEDS)
@settings(max_examples=6)
def test_points_and_parts_of_stretched_instances_are_within_bounds(seed: int) -> None:
    placed = placed_of(*map(trees.compiled, ("tree", "skeleton")), at=np.zeros((6, 3)), linear=any_linear(seed, 6))
    tree, shared = in_a_tree(placed, seed)
    check(placed, shared, tree, even=False)


@given(SEEDS)
@settings(max_examples=6)
def test_the_order_of_instances_does_not_matter(seed: int) -> None:
    placed = grove(7, 3.0, seed)
    order = np.random.default_rng(seed).permutation(7)
    found = []
    for own in (placed, placed.take(order)):
        _, shared = in_a_tree(own, seed)
        points, parts = shared.points, shared.parts
        key = placed.keys(parts) if own is placed else own.keys(parts)
        rows = np.lexsort([points.wood, points.leaf, *points.position.T, key[points.part]])
        found.append((key[points.part][rows], points.position[rows], points.leaf[rows], np.sort(key)))
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other)


def test_keys_tell_all_parts_apart() -> None:
    parts = opened_to_the_end(placed := grove(30, 3.0))
    assert len(set(placed.keys(parts).tolist())) == len(parts)


def test_an_empty_scene_has_nothing() -> None:
    shared = SharedAssets(PlacedAssets.none(), support.camera((0, -9, 2), (0, 0, 2)))
    assert len(shared.parts) == len(shared.points) == len(PlacedAssets.none()) == 0
    totals, cell = shared.totals(np.ones(3, bool))
    assert len(totals) == len(cell) == 0
    assert len(shared.held(3).items) == 0


def test_several_assets_are_each_what_they_are_alone() -> None:
    kinds = ("tree", "card", "closed")
    table = AssetTable.of([trees.compiled(kind) for kind in kinds])
    assert AssetTable.none().root.tolist() == [0] and len(AssetTable.none().clusters) == 0
    for number, kind in enumerate(kinds):
        alone, first = trees.compiled(kind), int(table.root[number])
        count = len(alone.clusters)
        own = table.clusters.take(slice(first, first + count))
        assert (np.searchsorted(table.root, np.arange(first, first + count), side="right") - 1 == number).all()
        assert np.array_equal(own.optical_area, alone.clusters.optical_area)
        assert np.array_equal(
            own.meshes if number == 0 else table.clusters.meshes[first : first + count], alone.clusters.meshes
        )
        mesh = AssetTable.of([alone]).mesh_of
        assert np.array_equal(table.mesh_of[first : first + count], np.where(mesh >= 0, mesh + first, -1))
        for row in range(count):
            if own.leaf_samples[row]:
                a, b = int(own.leaf_sample[row]), int(alone.clusters.leaf_sample[row])
                assert np.array_equal(table.samples.position[a], alone.samples.position[b])


def test_meshes_that_clusters_lie_in_are_above_them() -> None:
    table = AssetTable.of([trees.compiled("closed"), trees.compiled("tree")])
    for cluster, mesh in enumerate(table.mesh_of.tolist()):
        above = cluster
        while above >= 0 and not table.clusters.meshes[above]:
            above = int(table.clusters.parent[above])
        assert mesh == above or (mesh < 0 and above < 0)


# The loop.


def run(placed: PlacedAssets, camera: object, seeds: object = None, **options: float) -> Refinement:
    flora = support.small_flora()
    seeds = support.plants(np.zeros(0)) if seeds is None else seeds
    loop = refine(flora, seeds, camera, RefinementSettings(**{**FAST, **options}), placed=placed)
    while True:
        try:
            next(loop)
        except StopIteration as stop:
            return stop.value


def check_result(placed: PlacedAssets, result: Refinement) -> None:
    check(placed, result.assets, result.tree)
    assert np.isin(result.assets.points.cell, result.nodes).all()
    area = result.plants.parts.totals.area.sum() + result.assets.parts.totals.area.sum()
    assert result.totals.area.sum() == pytest.approx(area, rel=1e-5)


@pytest.mark.parametrize("place", ["before", "far", "within", "turned away", "orthographic"])
@pytest.mark.parametrize("plants", [False, True])
def test_the_loop_loses_nothing(place: str, plants: bool) -> None:
    camera = {
        "before": lambda: support.camera((0, -14, 3), (0, 0, 2)),
        "far": lambda: support.camera((0, -400, 30), (0, 0, 2)),
        "within": lambda: support.camera((0.5, 0.2, 2.5), (3, 3, 2.5), view=1.2),
        "turned away": lambda: support.camera((0, -14, 3), (0, -40, 3)),
        "orthographic": lambda: support.camera((0, -14, 3), (0, 0, 2), kind="ORTHO", view=8.0),
    }[place]()
    placed = grove(9, 4.0)
    result = run(placed, camera, support.grove(4, 4.0) if plants else None)
    check_result(placed, result)
    assert result.complete
    seen = np.isin(result.decision, (Decision.EXPLICIT, Decision.PROXY))
    assert seen.any() == (place != "turned away")
    assert (len(result.plants.parts) > 0) == plants


def test_the_same_scene_is_refined_in_the_same_way() -> None:
    one, other = (run(grove(5, 3.0), support.camera((0, -14, 3), (0, 0, 2))) for _ in range(2))
    assert np.array_equal(one.decision, other.decision)
    assert np.array_equal(one.assets.points.cell, other.assets.points.cell)
    assert np.array_equal(one.transmittance, other.transmittance)


def test_what_stands_behind_a_wall_of_trees_is_hidden() -> None:
    wall = [(x, 0, z) for x in np.arange(-6, 7, 0.5) for z in np.arange(-4, 5, 0.75)]
    at = np.array([*wall, (0, 60, 0), (0.5, 61, 0)])
    placed = placed_of(trees.compiled("tree"), at=at)
    result = run(placed, support.camera((0, -14, 3), (0, 0, 3), view=0.5))
    check_result(placed, result)
    points, parts = result.assets.points, result.assets.parts
    decision = np.full(len(result.tree), -1)
    decision[result.nodes] = result.decision
    behind = np.isin(parts.instance[points.part], [len(at) - 2, len(at) - 1])
    assert (decision[points.cell[behind]] == Decision.HIDDEN).mean() > 0.9
    assert (decision[points.cell[~behind]] != Decision.HIDDEN).any()


def test_strays_are_left_out_and_named() -> None:
    placed = grove(20, 4.0)
    far = placed.instances.position.copy()
    far[7] = (0, 2e6, 0)
    placed = PlacedAssets(placed.assets, replace(placed.instances, position=far))
    result = run(placed, support.camera((0, -14, 3), (0, 0, 2)))
    assert result.outliers.assets.tolist() == [7] and len(result.outliers.plants) == 0
    assert result.outliers.away == pytest.approx(2e6, rel=0.01)
    assert len(result.assets.placed) == 19
    check_result(result.assets.placed, result)


def test_moving_the_origin_moves_nothing_else() -> None:
    own = instances([(1e6, 2e6, 0.0), (1e6 + 3, 2e6, 1.0)])
    moved = own.counted_from(np.array([1e6, 2e6, 0.0]))
    assert moved.position.tolist() == [[0, 0, 0], [3, 0, 1]]
    assert own.counted_from(np.zeros(3)) is own
