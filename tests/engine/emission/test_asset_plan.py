# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What instances of assets are drawn as: each part of each instance in one form, and what is real stays so nearby."""

from __future__ import annotations

import pickle
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.assets import trees
from tests.engine.emission.test_emission import with_decision
from tests.engine.refinement.test_asset_parts import check_cover, grove, placed_of, run
from tetflora_addon.assets.costs import NEVER, OriginalPolicy
from tetflora_addon.camera.camera import Camera
from tetflora_addon.emission import drawing
from tetflora_addon.emission.asset_plan import ASSETS, AssetPlan, ClusterRows, PlacedClusters, explicit_plan
from tetflora_addon.proxies import microsurfaces
from tetflora_addon.proxies.microsurfaces import Facets
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement
from tetflora_addon.refinement.shared_parts import AssetParts, PlacedAssets

EXPLICIT, PROXY, HIDDEN = Decision.EXPLICIT, Decision.PROXY, Decision.HIDDEN
KINDS = ("tree", "varied", "closed")
COUNT = 80


@cache
def big() -> trees.Asset:
    """Leaves of eight faces, too many for one mesh: twelve thousand."""
    source = trees.source_of(trees.joined(trees.trunk(), trees.leaves(5, 1500, size=0.08, closed=True)), digest="ab07")
    return trees.compile_asset(source)


@cache
def scene() -> tuple[Camera, Refinement]:
    """Trees in depth, so that every decision occurs."""
    placed = grove(COUNT, 3.0)
    index = np.arange(COUNT)
    at = placed.instances.position.copy()
    at[:, 1], at[:, 2] = (index // 5) ** 1.7 * 1.5, 0.0
    at[:, 0] = (index % 5 - 2) * (1.5 + at[:, 1] / 15)
    own = PlacedAssets(
        placed.assets.of([*(trees.compiled(kind) for kind in KINDS), big()]),
        replace(placed.instances, position=at, asset=(index % 4).astype(np.int32)),
    )
    camera = support.camera((0, -7, 2), (0, 60, 1.0), pixels=200, view=1.0)
    return camera, run(own, camera)


def originals(fraction: float = NEVER, *always: bool, **options: bool) -> OriginalPolicy:
    return OriginalPolicy(np.array(always or (False,) * 4), fraction, **options)


def patchwork(seed: int) -> Refinement:
    _, result = scene()
    rng = np.random.default_rng(seed)
    count = len(result.nodes)
    decisions = rng.choice(np.array([EXPLICIT, PROXY, HIDDEN]), count, p=rng.dirichlet([1, 1, 1]))
    return with_decision(result, decisions, rng.uniform(0.05, 1.0, count))


def drawn(
    result: Refinement, camera: Camera, limit: float, originals: OriginalPolicy, facet: float = 1.0, **options: object
) -> tuple[AssetPlan, Facets, Facets]:
    """What is drawn as it is, facets that are seen, and those that are not."""
    placed = result.assets.placed
    clusters = PlacedClusters(placed, camera, originals, limit, np.full(len(placed), ""))
    scene = support.refined(support.small_flora(), result, camera, facet, 1e9, assets=clusters, **options)
    scene = replace(scene, originals=originals)
    assert not list(scene.mesh_blocks())
    made: dict[bool, list[Facets]] = {True: [], False: []}
    for parts in scene.facet_parts():
        assert parts.species == ASSETS
        for facets, seen in parts:
            made[seen].append(facets)
    seen, unseen = (Facets.concatenate(some) if some else Facets.empty() for some in made.values())
    return scene.asset_plan(), seen, unseen


def check_plan(placed: PlacedAssets, plan: AssetPlan) -> None:
    """No face is in two meshes, and kites stand for leaves alone."""
    clusters = placed.assets.clusters
    assert len(np.unique(plan.originals)) == len(plan.originals)
    both = AssetParts.concatenate([plan.meshes, plan.kites])
    assert not np.isin(both.instance, plan.originals).any()
    assert len(np.unique(both.instance.astype(np.int64) * len(clusters) + both.cluster)) == len(both)
    for own in (plan.meshes, plan.kites):
        assert clusters.meshes[own.cluster].all()
    assert (clusters.leaves[plan.kites.cluster] > 0).all()
    bark = clusters.optical_area - clusters.leaf_optical
    assert (bark[plan.kites.cluster] <= 1e-6 * clusters.optical_area[plan.kites.cluster]).all()


def optical(placed: PlacedAssets, plan: AssetPlan) -> float:
    """Area that is drawn as it is, m²."""
    whole = placed.wholes().totals.optical_area[plan.originals].sum()
    return float(whole + plan.meshes.totals.optical_area.sum() + plan.kites.totals.optical_area.sum())


def area(*facets: Facets) -> float:
    return float(sum((own.side**2).sum() for own in facets))


@pytest.mark.parametrize(("limit", "fraction"), [(0.2, 0.3), (1.0, NEVER), (4.0, 0.3)])
def test_every_part_is_drawn_once(limit: float, fraction: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """All of the area is there, as what it is or as facets; what nobody sees may be less."""
    monkeypatch.setattr(microsurfaces, "asset_weights", lambda _placed, parts, _number: np.ones(len(parts)))
    camera, result = scene()
    placed = result.assets.placed
    plan, seen, unseen = drawn(result, camera, limit, originals(fraction))
    check_plan(placed, plan)
    assert len(seen) and len(unseen)
    assert limit > 0.2 or (len(plan.meshes) and len(plan.kites))
    assert fraction <= 1.0 or not len(plan.originals)
    whole = placed.wholes().totals.optical_area.sum()
    assert optical(placed, plan) + area(seen) < 1.01 * whole
    # Of hidden ones a few are drawn by chance for many, up to 64 times as large: the mean of several draws is meant.
    found = [optical(placed, plan) + area(seen, unseen)]
    monkeypatch.setenv("TETFLORA_THREADS", "1")  # other processes know nothing of the draws
    for draw in range(3):
        monkeypatch.setattr(drawing, "_MERGE", 300 + draw)
        plan, seen, unseen = drawn(result, camera, limit, originals(fraction))
        found.append(optical(placed, plan) + area(seen, unseen))
    assert 0.5 * whole < np.mean(found) < 1.02 * whole


def test_assets_that_are_always_originals_are_in_every_place() -> None:
    camera, result = scene()
    asset = result.assets.placed.instances.asset
    plan, seen, _ = drawn(result, camera, 1e6, originals(NEVER, True, False, True, True))
    assert plan.originals.tolist() == np.flatnonzero(asset != 1).tolist()
    assert not len(plan.meshes) and not len(plan.kites)
    everything, *facets = drawn(result, camera, 1e6, originals(NEVER, True, True, True, True))
    assert everything.originals.tolist() == list(range(COUNT)) and not sum(map(len, facets))
    # They hide what is behind all the same.
    alone = result.assets.placed.take(asset == 1)
    assert len(seen) < 0.8 * len(drawn(run(alone, camera), camera, 1e6, originals())[1])


def real(placed: PlacedAssets, plan: AssetPlan, kites: bool = False) -> set[tuple[int, int]]:
    """Instance and cluster of all meshes, those of originals too."""
    own = [plan.meshes, plan.kites] if kites else [plan.meshes]
    found = {pair for parts in own for pair in zip(parts.instance.tolist(), parts.cluster.tolist(), strict=True)}
    root, meshes = placed.assets.root, placed.assets.clusters.meshes
    for instance in plan.originals.tolist():
        asset = placed.instances.asset[instance]
        found |= {(instance, c) for c in np.flatnonzero(meshes[: root[asset + 1]]).tolist() if c >= root[asset]}
    return found


@pytest.mark.parametrize("fraction", [0.6, NEVER])
@pytest.mark.parametrize("sharper", ["nearer", "lower limit"])
def test_what_is_real_stays_real_as_the_camera_comes_closer(fraction: float, sharper: str) -> None:
    """Of trees that nothing hides."""
    placed = placed_of(*map(trees.compiled, KINDS), big(), at=[(x, 20.0, 0) for x in range(-15, 16, 5)])
    before, numbers = (set(), set()), []
    for step in range(6):
        own, limit = support.camera((0, -60.0 + 12 * step, 2), (0, 60, 2.0), pixels=200, view=1.0), 1.0
        if sharper == "lower limit":
            own, limit = support.camera((0, -20.0, 2), (0, 60, 2.0), pixels=400, view=1.0), 4.0 / 1.7**step
        plan, *_ = drawn(run(placed, own), own, limit, originals(fraction))
        check_plan(placed, plan)
        now = real(placed, plan), real(placed, plan, kites=True)
        assert before[0] <= now[0] and before[1] <= now[1]
        before = now
        numbers.append(len(now[1]))
    assert numbers[0] < numbers[-1]


def test_the_order_of_instances_does_not_matter() -> None:
    camera, result = scene()
    order = np.random.default_rng(2).permutation(COUNT)
    found = []
    for placed in (result.assets.placed, result.assets.placed.take(order)):
        plan, *facets = drawn(run(placed, camera), camera, 1.0, originals(0.6))
        keys = [np.sort(placed.keys(parts)) for parts in (plan.meshes, plan.kites)]
        places = [np.sort(own, axis=0) for one in facets for own in (one.center, one.side, one.color)]
        found.append([np.sort(placed.instances.key[plan.originals]), *keys, *places])
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other)


@given(st.integers(0, 2**31), st.sampled_from([0.3, 0.6, 1.0, NEVER]))
@settings(max_examples=3)
def test_where_shells_stand_for_all_else_what_is_explicit_is_drawn(seed: int, fraction: float) -> None:
    _, result = scene()
    placed = result.assets.placed
    for decision in (PROXY, HIDDEN):
        plan = explicit_plan(with_decision(result, decision), originals(fraction))
        assert not any(map(len, (plan.originals, plan.meshes, plan.kites)))
    assert len(explicit_plan(with_decision(result, EXPLICIT), originals(min(fraction, 1.0))).originals) == COUNT
    every = explicit_plan(with_decision(result, EXPLICIT), originals())
    check_cover(placed, every.meshes)
    mixed = explicit_plan(patchwork(seed), originals(fraction))
    check_plan(placed, mixed)
    part = np.bincount(mixed.meshes.instance, mixed.meshes.totals.polygons, COUNT)
    assert (part < fraction * placed.wholes().totals.polygons).all()


def test_what_is_behind_a_wall_is_few_large_facets_wherever_it_is() -> None:
    """Hidden means covered, by whatever it is: nothing behind is real, however near."""
    camera, result = scene()
    placed = result.assets.placed
    result = run(placed.take(placed.instances.position[:, 1] > 10.0), camera)
    wall = np.array([[[-40.0, -5.5, -20], [40, -5.5, -20], [0, -5.5, 60]]])
    open_, walled = (drawn(result, camera, 0.2, originals(), occluders=own) for own in (None, wall))
    plan, seen, unseen = walled
    assert not any(map(len, (plan.originals, plan.meshes, plan.kites, seen)))
    assert len(open_[0].meshes) > 10 and 0 < len(unseen) < 0.2 * len(open_[1])


def test_nothing_at_all_makes_nothing() -> None:
    camera, _ = scene()
    placed = placed_of(trees.compiled("tree"), at=[(0, -50.0, 0), (0, 30, 0)])
    plan, seen, unseen = drawn(run(placed, camera), camera, 1e6, OriginalPolicy(np.zeros(1, bool), NEVER))
    assert not any(map(len, (plan.originals, plan.meshes, plan.kites)))
    assert len(seen) and len(unseen)
    none = PlacedClusters(PlacedAssets.none(), camera, OriginalPolicy(np.zeros(0, bool)), 1.0, np.zeros(0, str))
    assert not len(none.everything()) and not list(none.unseen(ClusterRows.empty(), np.zeros(0), np.zeros(0), []))


def test_other_processes_get_what_they_draw_and_no_more() -> None:
    """Faces of all assets are gigabytes, and meshes of clusters are made here."""
    placed = scene()[1].assets.placed
    rows = placed.wholes()
    sent = pickle.loads(pickle.dumps(placed))
    assert np.array_equal(sent.kites(rows), placed.kites(rows))
    assert np.array_equal(sent.keys(rows), placed.keys(rows))
    assert sum(asset.part.nbytes + asset.face.nbytes for asset in sent.assets.every) == 0


# Facets.


def free(*, at: list, linear: np.ndarray | None = None, kind: str = "tree") -> tuple[PlacedAssets, Camera]:
    """Trees that nothing hides, and a camera."""
    return placed_of(trees.compiled(kind), at=at, linear=linear), support.camera((0, -7, 2), (0, 60, 1.0), 400, 1.0)


def by_chance(facets: Facets) -> float:
    """What an area of facets may be off, as their numbers are whole: four deviations."""
    return 4.0 * float(np.sqrt((facets.side**4).sum()))


def test_facets_have_the_weights_of_their_clusters() -> None:
    placed = placed_of(big(), at=[(0, 40.0 + 4 * i, 0) for i in range(200)])
    camera = support.camera((0, -7, 2), (0, 60, 1.0), pixels=160, view=1.0)
    clusters = PlacedClusters(placed, camera, OriginalPolicy(np.zeros(1, bool), NEVER), 1e6, np.full(200, ""))
    rows = clusters.everything()
    for side in (0.3, 1.0, 3.0):
        sides = np.full(len(rows), side)
        made = Facets.concatenate([own for _, own in clusters.unseen(rows, sides, np.ones(len(rows)), [])])
        assert np.linalg.norm(made.normal, axis=1) == pytest.approx(1.0, abs=1e-6)
        weight = microsurfaces.asset_weights(placed, rows, rows.totals.optical_area / side**2)
        assert area(made) == pytest.approx(rows.totals.optical_area @ weight, abs=by_chance(made))


def test_facets_of_stretched_and_mirrored_instances_face_as_their_faces() -> None:
    """Moments of normals by area against those of the real triangles."""
    for stretch in ((1, 1, 3), (-1, 1, 1), (-2, 0.5, 1)):
        linear = np.diag(stretch).astype(float)
        placed, camera = free(at=[(0, 30.0, 0)], linear=linear[None])
        _, *made = drawn(run(placed, camera), camera, 1e6, OriginalPolicy(np.zeros(1, bool), NEVER), 0.5)
        normal, size = (
            np.concatenate([of for of in own]) for own in zip(*((f.normal, f.side**2) for f in made), strict=True)
        )
        found = (normal * size[:, None]).T @ normal / size.sum()
        corners, *_ = trees.triangles_of(trees.source("tree"))
        vector = np.cross(*np.moveaxis((corners[:, 1:] - corners[:, :1]) @ linear.T, 1, 0))
        size = np.linalg.norm(vector, axis=1)
        blocked = np.where(np.arange(len(size)) < 176, 0.5, 1.0) * size
        unit = vector / size[:, None]
        assert found == pytest.approx((unit * blocked[:, None]).T @ unit / blocked.sum(), abs=0.06)
        center = np.concatenate([f.center for f in made])
        world = corners.reshape(-1, 3) @ linear.T + placed.instances.position[0]
        assert (center >= world.min(axis=0) - 0.1).all() and (center <= world.max(axis=0) + 0.1).all()


def test_colors_of_facets_are_those_of_faces() -> None:
    placed, camera = free(at=[(x, 30.0, 0) for x in range(20)], kind="card")
    _, seen, unseen = drawn(run(placed, camera), camera, 1e6, OriginalPolicy(np.zeros(1, bool), NEVER))
    assert len(seen)
    colors = np.concatenate([own.color for own in (seen, unseen) if len(own)])
    assert colors.mean(axis=0) == pytest.approx(trees.GREEN, rel=0.1)


def test_finer_facets_are_more_and_fewer_are_real_beyond_a_higher_limit() -> None:
    camera, result = scene()
    numbers = [len(drawn(result, camera, 1e6, originals(), pixels)[1]) for pixels in (0.5, 1.0, 2.0, 4.0)]
    assert all(a > b for a, b in pairwise(numbers))
    faces = [
        drawn(result, camera, limit, originals())[0].meshes.totals.polygons.sum() for limit in (0.05, 0.5, 5.0, 50.0)
    ]
    assert all(a >= b for a, b in pairwise(faces)) and faces[0] > faces[-1]


def test_parts_count_with_the_area_that_blocks_light() -> None:
    """Facets that only tell what is covered, of what is drawn as it is, are twice as large: a quarter as many."""
    camera, result = scene()
    placed = result.assets.placed
    rows = ClusterRows.of(placed.wholes(), np.arange(COUNT) % 2 == 0)
    kind = PlacedClusters(placed, camera, originals(), 1.0, np.full(COUNT, ""))
    np.testing.assert_array_equal(kind.optical(rows), rows.totals.optical_area * np.where(rows.shown, 0.25, 1.0))
