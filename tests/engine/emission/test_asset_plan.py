# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What instances of assets are drawn as: each part of each instance in one form, and what is real stays so nearby."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.assets import trees
from tests.engine.emission.test_emission import with_decision
from tests.engine.refinement.test_asset_parts import check_cover, grove, placed_of, run
from tetflora_addon.camera.camera import Camera
from tetflora_addon.emission import asset_plan
from tetflora_addon.emission.asset_costs import NEVER
from tetflora_addon.emission.asset_expected import SHARED, AssetExpected
from tetflora_addon.emission.asset_plan import FARTHER, AssetPlan, Keeping, plan_of, planned_facets
from tetflora_addon.emission.asset_sight import AssetPortions, AssetSight
from tetflora_addon.emission.seen import SOME, SeenNodes
from tetflora_addon.proxies import asset_facets
from tetflora_addon.proxies.facet_sizes import FacetPixels
from tetflora_addon.refinement.asset_parts import AssetParts, PlacedAssets, SharedAssets
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement

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


def keeping(fraction: float = NEVER, *always: bool, **options: bool) -> Keeping:
    return Keeping(np.array(always or (False,) * 4), fraction, **options)


def patchwork(seed: int) -> Refinement:
    _, result = scene()
    rng = np.random.default_rng(seed)
    count = len(result.nodes)
    decisions = rng.choice(np.array([EXPLICIT, PROXY, HIDDEN]), count, p=rng.dirichlet([1, 1, 1]))
    return with_decision(result, decisions, rng.uniform(0.05, 1.0, count))


def check_plan(placed: PlacedAssets, plan: AssetPlan) -> None:
    """Each face of an instance that is not the original is in one mesh, or stood for by kites or facets."""
    parts = AssetParts.concatenate([plan.meshes, plan.kites, plan.facets.parts])
    assert not np.isin(parts.instance, plan.whole).any()
    assert len(np.unique(plan.whole)) == len(plan.whole)
    others = np.setdiff1d(np.arange(len(placed)), plan.whole)
    if len(others):
        number = np.cumsum(np.isin(np.arange(len(placed)), others)) - 1
        check_cover(placed.take(others), replace(parts, instance=number[parts.instance].astype(np.int32)))
    else:
        assert not len(parts)
    clusters = placed.assets.clusters
    for own in (plan.meshes, plan.kites):
        assert clusters.meshes[own.cluster].all()
    assert (clusters.leaves[plan.kites.cluster] > 0).all()
    bark = clusters.optical_area - clusters.leaf_optical
    assert (bark[plan.kites.cluster] <= 1e-6 * clusters.optical_area[plan.kites.cluster]).all()


def test_the_scene_has_every_decision() -> None:
    camera, result = scene()
    assert {EXPLICIT, PROXY, HIDDEN} == set(result.decision.tolist())
    plan = plan_of(AssetSight(result, camera), 0.2, keeping())
    check_plan(result.assets.placed, plan)
    assert not len(plan.whole)
    assert len(plan.meshes) and len(plan.kites) and len(plan.facets)


@given(st.integers(0, 2**31), st.sampled_from([None, 0.01, 1.0, 4.0, 100.0]), st.sampled_from([0.3, 0.6, 1.0, NEVER]))
@settings(max_examples=25)
def test_every_part_of_every_instance_is_drawn_once(seed: int, limit: float | None, fraction: float) -> None:
    camera, _ = scene()
    result = patchwork(seed)
    always = tuple(np.random.default_rng(seed).random(4) < 0.2)
    plan = plan_of(AssetSight(result, camera, limit is not None), limit, keeping(fraction, *always))
    placed = result.assets.placed
    check_plan(placed, plan)
    assert np.isin(np.flatnonzero(np.array(always)[placed.instances.asset]), plan.whole).all()
    if fraction == NEVER:
        assert np.array(always)[placed.instances.asset[plan.whole]].all()


def test_what_is_empty_is_explicit_where_most_around_it_is() -> None:
    """One explicit tetrahedron after the other: no region without points follows more than one of them."""
    _, result = scene()
    follows = np.zeros(len(result.tree), int)
    for one in range(40):
        alone = np.where(np.arange(len(result.nodes)) == one, EXPLICIT, PROXY)
        follows += SeenNodes(with_decision(result, alone, 1.0), True).explicit
    assert follows.max() == 1 and follows.sum() > 40


def test_originals_are_those_of_which_most_is_real() -> None:
    camera, result = scene()
    placed, sight = result.assets.placed, AssetSight(with_decision(result, EXPLICIT, 1.0), camera)
    some = plan_of(sight, 1.0, keeping())
    faces = np.bincount(some.meshes.instance, some.meshes.totals.polygons, len(placed))
    part = faces / placed.wholes().totals.polygons
    for fraction in (0.2, 0.6, 0.95):
        plan = plan_of(sight, 1.0, keeping(fraction))
        check_plan(placed, plan)
        assert plan.whole.tolist() == np.flatnonzero(part >= fraction).tolist()
    assert len(plan_of(sight, 1e-6, keeping(0.999, kites=False)).whole) == len(placed)
    assert not len(plan_of(sight, 1e6, keeping(0.001)).whole)
    everything = plan_of(sight, 1e6, keeping(NEVER, True, True, True, True))
    assert everything.whole.tolist() == list(range(len(placed))) and not len(everything.facets)


def real(placed: PlacedAssets, plan: AssetPlan, kites: bool = False) -> set[tuple[int, int]]:
    """Instance and cluster of all meshes, those of originals too."""
    own = [plan.meshes, plan.kites] if kites else [plan.meshes]
    found = {pair for parts in own for pair in zip(parts.instance.tolist(), parts.cluster.tolist(), strict=True)}
    root, meshes = placed.assets.root, placed.assets.clusters.meshes
    for instance in plan.whole.tolist():
        asset = placed.instances.asset[instance]
        found |= {(instance, c) for c in np.flatnonzero(meshes[: root[asset + 1]]).tolist() if c >= root[asset]}
    return found


@pytest.mark.parametrize("fraction", [0.6, NEVER])
@pytest.mark.parametrize("sharper", ["nearer", "more pixels", "lower limit"])
def test_what_is_real_stays_real_as_the_camera_comes_closer(fraction: float, sharper: str) -> None:
    camera, result = scene()
    result = with_decision(result, EXPLICIT, 1.0)
    placed, before, numbers = result.assets.placed, (set(), set()), []
    for step in range(9):
        times = 1.5**step
        own, limit = replace(camera, width=800, height=800), 2.0
        if sharper == "nearer":
            own = replace(camera, position=np.array([0, -40.0 + 3.5 * step, 2]))
        elif sharper == "more pixels":
            own = replace(camera, width=int(40 * times), height=int(40 * times))
        else:
            limit = 20.0 / times
        plan = plan_of(AssetSight(result, own), limit, keeping(fraction))
        check_plan(placed, plan)
        now = real(placed, plan), real(placed, plan, kites=True)
        assert before[0] <= now[0] and before[1] <= now[1]
        before = now
        numbers.append(len(now[1]))
    assert numbers[0] < numbers[-1]


def test_the_order_of_instances_does_not_matter() -> None:
    camera, result = scene()
    order = np.random.default_rng(2).permutation(COUNT)
    shared = result.assets
    inverse = np.argsort(order).astype(np.int32)
    parts = replace(shared.parts, instance=inverse[shared.parts.instance])
    moved = SharedAssets(shared.placed.take(order), camera).with_parts(parts, shared.points)
    found = []
    for own in (shared, moved):
        placed = own.placed
        plan = plan_of(AssetSight(replace(result, assets=own), camera), 1.0, keeping(0.6))
        made = [f for f, _ in planned_facets(AssetSight(replace(result, assets=own), camera), plan, FacetPixels(1.0))]
        keys = [np.sort(placed.keys(p)) for p in (plan.meshes, plan.kites)] + [placed.keys(plan.facets.parts)]
        found.append(
            [np.sort(placed.instances.key[plan.whole]), *keys, *(f.centre for f in made), *(f.side for f in made)]
        )
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other)


def test_without_facets_only_what_is_explicit_is_drawn() -> None:
    camera, result = scene()
    for decision in (PROXY, HIDDEN):
        plan = plan_of(AssetSight(with_decision(result, decision), camera, False), None, keeping(0.6))
        assert not len(plan.whole) and not len(plan.meshes)
        check_plan(result.assets.placed, plan)
    plan = plan_of(AssetSight(with_decision(result, EXPLICIT), camera, False), None, keeping(0.6))
    assert len(plan.whole) == len(result.assets.placed)


def test_nothing_hidden_is_real_and_nothing_at_all_makes_nothing() -> None:
    camera, result = scene()
    sight = AssetSight(with_decision(result, HIDDEN, 0.0), camera)
    plan = plan_of(sight, 1.0, keeping(0.6))
    check_plan(result.assets.placed, plan)
    assert not len(plan.whole)
    portions = sight.portions()
    assert (portions.visibility > 0).mean() < 0.2  # thick wood close to the camera
    none = SharedAssets(PlacedAssets.none(), camera)
    plan = plan_of(AssetSight(replace(result, assets=none), camera), 1.0, Keeping(np.zeros(0, bool)))
    assert not any(map(len, (plan.whole, plan.meshes, plan.kites, plan.facets)))


@given(st.integers(0, 2**31))
@settings(max_examples=8)
def test_what_is_seen_of_clusters_is_the_mean_over_their_points(seed: int) -> None:
    result = patchwork(seed)
    camera, _ = scene()
    sight = AssetSight(result, camera)
    found, points = sight.portions(), result.assets.points
    assert (np.diff(found.rank) >= 0).all()
    seen = np.zeros(len(result.tree))
    shown = result.decision != HIDDEN
    seen[result.nodes[shown]] = result.transmittance[shown]
    place = {key: i for i, key in enumerate(result.assets.placed.keys(result.assets.parts).tolist())}
    for row, key in enumerate(result.assets.placed.keys(found.parts).tolist()):
        own = np.flatnonzero(points.part == place[key])
        weight = points.optical_area[own].astype(float)
        weight /= weight.sum()
        if weight @ (seen[points.cell[own]] > 0) > SOME:
            # What is hidden and near counts a little.
            assert found.visibility[row] >= weight @ seen[points.cell[own]] - 1e-6
            assert found.visibility[row] <= weight @ seen[points.cell[own]] + 1 / 200


@given(st.integers(0, 2**31))
@settings(max_examples=8)
def test_opening_keeps_all_that_there_is(seed: int) -> None:
    camera, _ = scene()
    sight = AssetSight(patchwork(seed), camera)
    left = sight.portions()
    before = left.parts.totals.optical_area @ left.visibility
    done = [AssetPortions.empty()]
    while len(left):
        again = sight.assets.can_open(left.parts)
        done.append(left.take(~again))
        left, _ = sight.opened(left.take(again))
    after = AssetPortions.concatenate(done)
    check_cover(sight.placed, after.parts)
    whole = sight.portions().parts.totals.optical_area.sum()
    assert after.parts.totals.optical_area.sum() == pytest.approx(whole, rel=1e-5)
    assert after.parts.totals.optical_area @ after.visibility == pytest.approx(before, abs=0.1 * whole)


# Facets.


def facets_of(sight: AssetSight, plan: AssetPlan, pixels: FacetPixels) -> tuple[float, int, float, int]:
    """Area and number of facets of what is seen, and of what is not."""
    out = [0.0, 0, 0.0, 0]
    for facets, seen in planned_facets(sight, plan, pixels):
        for column in (facets.centre, facets.across, facets.along, facets.side, facets.colour):
            assert np.isfinite(column).all()
        assert np.linalg.norm(facets.normal, axis=1) == pytest.approx(1.0, abs=1e-6)
        assert (facets.side > 0).all()
        out[0 if seen else 2] += float((facets.side**2).sum())
        out[1 if seen else 3] += len(facets)
    return tuple(out)


def by_chance(sight: AssetSight, plan: AssetPlan, pixels: float) -> float:
    """What an area of facets may be off, as their numbers are whole: four deviations."""
    sizes = asset_plan.sizes_of(sight, plan.facets)
    leaf, wood = sizes.sides(FacetPixels(pixels))
    return 2.0 * float(np.sqrt((sizes.totals.leaf_area * leaf**2 + sizes.totals.wood_area / 2 * wood**2).sum()))


@pytest.mark.parametrize("pixels", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("visibility", [1.0, 0.2])
def test_facets_have_the_optical_area_of_what_they_stand_for(
    pixels: float, visibility: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera, result = scene()
    sight = AssetSight(with_decision(result, PROXY, visibility), camera)
    plan = plan_of(sight, 1.0, keeping())
    assert not len(plan.meshes) and not len(plan.kites)
    whole = plan.facets.parts.totals.optical_area.sum()
    weighted = facets_of(sight, plan, FacetPixels(pixels))[0]
    assert 0.2 * whole < weighted < 1.02 * whole + by_chance(sight, plan, pixels)
    monkeypatch.setattr(asset_facets, "asset_weights", lambda _placed, parts, _number: np.ones(len(parts)))
    assert facets_of(sight, plan, FacetPixels(pixels))[0] == pytest.approx(
        whole, abs=0.01 * whole + by_chance(sight, plan, pixels)
    )


def test_facets_that_are_few_have_the_weights_of_their_clusters() -> None:
    """Those of clusters that are not opened, one by one."""
    placed = placed_of(big(), at=[(0, 40.0 + 4 * i, 0) for i in range(200)])
    camera = support.camera((0, -7, 2), (0, 60, 1.0), pixels=160, view=1.0)
    sight = AssetSight(with_decision(run(placed, camera), PROXY, 1.0), camera)
    plan = plan_of(sight, 1.0, Keeping(np.zeros(1, bool)))
    sizes = asset_plan.sizes_of(sight, plan.facets)
    pixels = FacetPixels(4.0)
    assert (sizes.counts(pixels) < asset_plan.MANY).all()
    leaf, _ = sizes.sides(pixels)
    weight = asset_facets.asset_weights(placed, plan.facets.parts, sizes.whole_optical / leaf**2)
    wanted = plan.facets.parts.totals.optical_area @ weight
    found = facets_of(sight, plan, pixels)[0]
    assert found == pytest.approx(wanted, abs=0.01 * wanted + by_chance(sight, plan, pixels.seen))


def test_facets_of_stretched_and_mirrored_instances_face_as_their_faces() -> None:
    """Moments of normals by area against those of the real triangles."""
    for stretch in ((1, 1, 3), (-1, 1, 1), (-2, 0.5, 1)):
        linear = np.diag(stretch).astype(float)
        placed = placed_of(trees.compiled("tree"), at=[(0, 30.0, 0)], linear=linear[None])
        camera = support.camera((0, -7, 2), (0, 60, 1.0), pixels=400, view=1.0)
        sight = AssetSight(with_decision(run(placed, camera), PROXY, 1.0), camera)
        plan = plan_of(sight, 1.0, Keeping(np.zeros(1, bool)))
        made = [f for f, _ in planned_facets(sight, plan, FacetPixels(0.5))]
        normal, area = np.concatenate([f.normal for f in made]), np.concatenate([f.side**2 for f in made])
        found = (normal * area[:, None]).T @ normal / area.sum()
        corners, *_ = trees.triangles_of(trees.source("tree"))
        vector = np.cross(*np.moveaxis((corners[:, 1:] - corners[:, :1]) @ linear.T, 1, 0))
        size = np.linalg.norm(vector, axis=1)
        optical = np.where(np.arange(len(size)) < 176, 0.5, 1.0) * size
        unit = vector / size[:, None]
        assert found == pytest.approx((unit * optical[:, None]).T @ unit / optical.sum(), abs=0.06)
        centre = np.concatenate([f.centre for f in made])
        world = corners.reshape(-1, 3) @ linear.T + placed.instances.position[0]
        assert (centre >= world.min(axis=0) - 0.1).all() and (centre <= world.max(axis=0) + 0.1).all()


def test_colours_of_facets_are_those_of_faces() -> None:
    placed = placed_of(trees.compiled("card"), at=[(x, 30.0, 0) for x in range(20)])
    camera = support.camera((0, -7, 2), (0, 60, 1.0), pixels=400, view=1.0)
    sight = AssetSight(with_decision(run(placed, camera), PROXY, 1.0), camera)
    plan = plan_of(sight, 1.0, Keeping(np.zeros(1, bool)))
    colours = np.concatenate([f.colour for f, _ in planned_facets(sight, plan, FacetPixels(1.0))])
    assert len(colours)
    assert colours.mean(axis=0) == pytest.approx(trees.GREEN, rel=0.1)


@pytest.mark.parametrize("limit", [0.2, 1.0, 5.0, 1e3])
@pytest.mark.parametrize("pixels", [0.7, 2.0])
def test_what_is_expected_is_about_what_is_made(limit: float, pixels: float) -> None:
    """Never far fewer; more where wood and leaves of a tree that is seen as a whole differ in width."""
    camera, result = scene()
    sight = AssetSight(result, camera)
    for kites in (True, False):
        own = keeping(NEVER, False, True, False, False, kites=kites)
        plan = plan_of(sight, limit, own)
        assert kites or not len(plan.kites)
        _, seen, _, hidden = facets_of(sight, plan, FacetPixels(pixels))
        made = plan.meshes.totals.polygons.sum() + sight.placed.assets.clusters.leaves[plan.kites.cluster].sum()
        expected = AssetExpected(sight, own)
        assert expected.seen(pixels, limit, 0.0) > 0.7 * made - 2500.0
        assert expected.seen(pixels, limit, 1.0) > 0.7 * (made + seen) - 2500.0
        if limit / (1.0 if kites else FARTHER) >= 1.0:
            assert expected.seen(pixels, limit, 1.0) == pytest.approx(made + seen, rel=0.3, abs=2500.0)
        assert expected.unseen(FacetPixels(pixels)) == pytest.approx(hidden, rel=0.35, abs=200.0)


def test_of_leaves_alone_it_is_what_is_made() -> None:
    at = np.array([((i % 8 - 4) * 3.0, 6.0 + 3 * (i // 8), 0) for i in range(64)])
    placed = placed_of(trees.compiled("leaves"), at=at)
    camera = support.camera((0, -7, 2), (0, 60, 1.0), pixels=300, view=1.0)
    sight = AssetSight(run(placed, camera), camera)
    own = Keeping(np.zeros(1, bool), NEVER)
    expected = AssetExpected(sight, own)
    for limit in (0.5, 1.0, 2.0, 4.0):
        plan = plan_of(sight, limit, own)
        made = plan.meshes.totals.polygons.sum() + sight.placed.assets.clusters.leaves[plan.kites.cluster].sum()
        assert expected.seen(1.0, limit, 0.0) == pytest.approx(made, rel=0.15, abs=1500.0)


def test_meshes_in_many_places_cost_memory_once() -> None:
    camera, result = scene()
    sight = AssetSight(with_decision(result, EXPLICIT, 1.0), camera)
    each, shared = (AssetExpected(sight, keeping(shared=shared, kites=False)) for shared in (False, True))
    there = sum(one.faces for one in sight.placed.assets.every)
    whole = sight.placed.wholes().totals.polygons.sum()
    assert each.seen(1.0, 1e-9, 0.0) == each.seen(1.0, 1e-9, 0.0, memory=True) == pytest.approx(whole)
    assert shared.seen(1.0, 1e-9, 0.0) == pytest.approx(SHARED * whole)
    assert shared.seen(1.0, 1e-9, 0.0, memory=True) == pytest.approx(SHARED * whole + there)
    none = AssetExpected(
        AssetSight(replace(result, assets=SharedAssets(PlacedAssets.none(), camera)), camera), keeping()
    )
    assert none.seen(1.0, 1.0, 1.0, memory=True) == none.unseen(FacetPixels(1.0)) == 0.0


def test_more_is_expected_of_finer_detail() -> None:
    camera, result = scene()
    expected = AssetExpected(AssetSight(result, camera), keeping())
    by_limit = [expected.seen(1.0, limit, 0.0) for limit in (0.01, 0.1, 1.0, 10.0, 100.0)]
    assert by_limit == sorted(by_limit, reverse=True)
    by_pixels = [expected.seen(pixels, 1e6, 1.0) for pixels in (0.3, 1.0, 3.0, 9.0)]
    assert by_pixels == sorted(by_pixels, reverse=True)
    everything = AssetExpected(AssetSight(result, camera), keeping(NEVER, True, True, True, True))
    assert everything.seen(1.0, 0.1, 1.0) == everything.unseen(FacetPixels(1.0)) == 0.0
