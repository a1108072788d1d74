# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled assets are their triangles: all area, faces and color are somewhere, within bounds, at every level."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.engine.assets import trees
from tetflora_addon.assets import compiled as subject
from tetflora_addon.assets.asset import COUNTS, MESH_FACES, Asset, AssetSource
from tetflora_addon.assets.measures import through_both_sides
from tetflora_addon.errors import TetFloraError

KINDS = sorted(trees.SOURCES)


@pytest.fixture(autouse=True, scope="module")
def few_views() -> Iterator[None]:
    """Weights of facets are in test_facet_weights.py; to find them is most of compiling."""
    trees.compiled.cache_clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(subject, "CLUSTERS", 1)
        patch.setattr(subject, "DIRECTIONS", subject.DIRECTIONS[:1])
        yield
    trees.compiled.cache_clear()  # other files have assets as they are


def triangles_by_cluster(source: AssetSource, asset: Asset) -> tuple[NDArray, NDArray, NDArray[np.int64]]:
    """Corners and coverage of all triangles, and the place (t,) of each one's face in the asset's order."""
    corners, part, face, coverage = trees.triangles_of(source)
    most = int(face.max()) + 1
    key, mine = asset.part.astype(np.int64) * most + asset.face, part * most + face
    order = np.argsort(key)
    place = order[np.searchsorted(key[order], mine)]
    assert np.array_equal(key[place], mine)
    return corners, coverage, place


def check(source: AssetSource, asset: Asset) -> None:
    clusters = asset.clusters
    assert asset.faces == source.faces
    assert len(set(zip(asset.part.tolist(), asset.face.tolist(), strict=True))) == asset.faces
    corners, coverage, place = triangles_by_cluster(source, asset)
    area = trees.areas_of(corners) * coverage
    for cluster in range(len(clusters)):
        first, number = int(clusters.first_face[cluster]), int(clusters.faces[cluster])
        own = (place >= first) & (place < first + number)
        found = clusters.leaf_area[cluster] + clusters.wood_area[cluster]
        assert found == pytest.approx(area[own].sum(), rel=1e-6, abs=1e-12)
        assert clusters.low[cluster] == pytest.approx(corners[own].min(axis=(0, 1)), abs=1e-12)
        assert clusters.high[cluster] == pytest.approx(corners[own].max(axis=(0, 1)), abs=1e-12)
        part, face = asset.faces_of(cluster)
        assert len(part) == len(face) == number
    every = clusters.children > 0
    for name in ("leaf_area", "wood_area", "closed_leaf_area", "faces", "leaves", "optical_area", "leaf_optical"):
        whole = getattr(clusters, name)
        below = np.bincount(clusters.parent[1:], whole[1:], len(clusters))
        assert below[every] == pytest.approx(whole[every], rel=1e-6, abs=1e-12)
    assert (clusters.closed_leaf_area <= clusters.wood_area).all()
    for f in vars(clusters).values():
        assert np.isfinite(f).all()
    filled = clusters.optical_area > 0
    assert clusters.moment[filled, :3].sum(axis=1) == pytest.approx(1.0, abs=1e-6)
    assert (clusters.width[filled] > 0).all()
    assert (clusters.width >= 0).all() and (clusters.one_leaf >= 0).all()
    assert clusters.weights.shape == (len(clusters), len(COUNTS))
    assert ((clusters.weights >= 0.1) & (clusters.weights <= 1.0)).all()
    # Means of parents are those of children, by optical area.
    for name in ("color", "transmission", "moment", "width"):
        value = getattr(clusters, name).reshape(len(clusters), -1) * clusters.optical_area[:, None]
        for k in range(value.shape[1]):
            below = np.bincount(clusters.parent[1:], value[1:, k], len(clusters))
            assert below[every] == pytest.approx(value[every, k], rel=1e-6, abs=1e-9)


def check_samples(asset: Asset) -> None:
    clusters, samples = asset.clusters, asset.samples
    filled = clusters.optical_area > 0
    assert ((clusters.leaf_samples + clusters.wood_samples)[filled] > 0).all()
    runs = ((clusters.leaf_sample, clusters.leaf_samples), (clusters.wood_sample, clusters.wood_samples))
    for leafy, (first, number) in zip((True, False), runs, strict=True):
        optical = clusters.leaf_optical if leafy else (clusters.wood_area - clusters.closed_leaf_area) / 2
        assert (number[optical > 1e-9 * clusters.optical_area[0]] > 0).all()
        for cluster in np.flatnonzero(number).tolist():
            own = samples.position[int(first[cluster]) : int(first[cluster] + number[cluster])]
            assert len(own) == number[cluster]
            size = np.abs([clusters.low[cluster], clusters.high[cluster]]).max()
            assert (own >= clusters.low[cluster] - 1e-6 * size).all()
            assert (own <= clusters.high[cluster] + 1e-6 * size).all()
    assert np.isfinite(samples.position).all() and np.isfinite(samples.normal).all()
    assert np.linalg.norm(samples.normal.astype(float), axis=1) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_all_of_every_cluster(kind: str) -> None:
    check(trees.source(kind), trees.compiled(kind))
    check_samples(trees.compiled(kind))


@given(st.integers(0, 2**31), st.integers(1, 60), st.integers(1, 80))
@settings(max_examples=8)
def test_any_mesh_compiles_or_is_named(seed: int, vertices: int, faces: int) -> None:
    """Faces of no area, transparent ones, and edges of many faces among them."""
    rng = np.random.default_rng(seed)
    positions = rng.integers(0, 4, (vertices, 3)) * rng.choice([0.0, 1.0, 1e-3, 1e4])
    own = [rng.integers(0, vertices, rng.integers(3, 6)).tolist() for _ in range(faces)]
    looks = rng.uniform(0, 1, (faces, 3)), rng.choice([0.0, 0.4, np.nan], faces), rng.choice([0.0, 0.3, 1.0], faces)
    source = trees.source_of(trees.surface(positions, own, *looks))
    try:
        asset = trees.compile_asset(source)
    except TetFloraError as error:
        assert '"tree"' in str(error)
        corners, *_, coverage = trees.triangles_of(source)
        assert not (trees.areas_of(corners) * coverage).any()
        return
    check(source, asset)
    check_samples(asset)


@pytest.mark.parametrize("kind", KINDS)
def test_samples_lie_on_faces_and_stand_for_equal_areas(kind: str) -> None:
    """Distance to the nearest triangle's plane, within it; and normals are those of faces."""
    source, asset = trees.source(kind), trees.compiled(kind)
    corners, coverage, _ = triangles_by_cluster(source, asset)
    corners = corners[trees.areas_of(corners) * coverage > 0]
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    twice = np.linalg.norm(normal, axis=1)
    normal /= twice[:, None]
    every = np.random.default_rng(0).permutation(len(asset.samples))[:300]
    for place, own in zip(
        asset.samples.position[every].astype(float), asset.samples.normal[every].astype(float), strict=True
    ):
        parts = [np.einsum("ni,ni->n", np.cross(q - p, place - p), normal) for p, q in ((a, b), (b, c), (c, a))]
        inside = np.min(parts, axis=0) / twice
        away = np.abs(np.einsum("ni,ni->n", place - a, normal))
        on = (inside > -1e-3) & (away < 1e-5) & (np.abs(normal @ own) > 0.995)
        assert on.any()


@pytest.mark.parametrize("kind", ["leaves", "tree", "varied", "skeleton"])
def test_means_over_samples_are_those_of_the_cluster(kind: str) -> None:
    """As samples stand for equal areas: half of the area is on either side of any plane, about."""
    source, asset = trees.source(kind), trees.compiled(kind)
    corners, coverage, place = triangles_by_cluster(source, asset)
    optical = trees.areas_of(corners) * coverage
    small = np.flatnonzero((asset.clusters.children == 0) & (asset.clusters.leaf_samples == 32))
    wrong = []
    for cluster in small.tolist():
        first, number = int(asset.clusters.first_face[cluster]), int(asset.clusters.faces[cluster])
        own = (place >= first) & (place < first + number)
        middle = (optical[own, None] * corners[own].mean(axis=1)).sum(axis=0) / optical[own].sum()
        at = int(asset.clusters.leaf_sample[cluster])
        found = asset.samples.position[at : at + 32].mean(axis=0)
        spread = np.std(asset.samples.position[at : at + 32], axis=0)
        wrong.append((found - middle) / spread)
    wrong = np.array(wrong)
    assert len(wrong) > 3 and np.sqrt((wrong**2).mean()) < 1.3 / np.sqrt(32)
    assert np.abs(wrong.mean(axis=0)).max() < 4 / np.sqrt(32 * len(wrong))


def test_moments_and_colors_are_those_of_faces() -> None:
    flat = trees.surface(trees.QUAD * [1, 1, 0], [(0, 1, 2, 3)], (0.2, 0.4, 0.6), 0.25)
    one = trees.compile_asset(trees.source_of(flat)).clusters
    assert one.moment[0] == pytest.approx([0, 0, 1, 0, 0, 0], abs=1e-7)
    assert one.color[0] == pytest.approx([0.2, 0.4, 0.6], abs=1e-3)
    assert one.transmission[0] == pytest.approx(0.25, abs=1e-3)
    whole = trees.compiled("varied").clusters
    corners, part, face, coverage = trees.triangles_of(trees.source("varied"))
    area = trees.areas_of(corners) * coverage
    solid = face < 88  # the trunk
    area = np.where(solid, area / 2, area)
    color = trees.source("varied").surfaces[0].color[face].astype(float)
    assert whole.color[0] == pytest.approx((area[:, None] * color).sum(axis=0) / area.sum(), rel=1e-4)
    assert not part.any()


def test_what_nobody_knows_lets_some_light_through_sheets_and_none_through_solids() -> None:
    tree = trees.joined(trees.trunk(), trees.leaves(1, 400))
    tree = replace(tree, transmission=np.full(tree.faces, np.nan, np.float16))
    own = trees.compile_asset(trees.source_of(tree)).clusters
    kinds = own.take(own.parent == 0)
    assert kinds.transmission[kinds.leaf_area > 0] == pytest.approx(0.3, abs=1e-6)
    assert (kinds.transmission[kinds.leaf_area == 0] == 0).all()


def test_closed_leaves_are_bodies_and_trunks_are_wood() -> None:
    source, asset = trees.source("closed"), trees.compiled("closed")
    corners, _, face, _ = trees.triangles_of(source)
    area = trees.areas_of(corners)
    whole = asset.clusters
    assert whole.leaf_area[0] == 0.0
    assert whole.wood_area[0] == pytest.approx(area.sum(), rel=1e-6)
    assert whole.closed_leaf_area[0] == pytest.approx(area[face >= 88].sum(), rel=1e-6)
    assert whole.leaf_optical[0] == pytest.approx(area[face >= 88].sum() / 2, rel=1e-6)
    assert whole.leaves[0] == len(asset.leaves) == 800
    kinds = whole.take(whole.parent == 0)
    assert len(kinds) == 2 and ((kinds.closed_leaf_area == 0) ^ (kinds.closed_leaf_area == kinds.wood_area)).all()
    assert not asset.leaves_of(int(np.flatnonzero((whole.parent == 0) & (whole.closed_leaf_area == 0))[0]))


def test_closed_leaves_are_as_dark_as_both_of_their_sides_together() -> None:
    """A facet in their place is one sheet: light that passes has met two walls, and walls swallow some each time."""
    whole = trees.compiled("closed").clusters
    leaves = whole.take((whole.parent == 0) & (whole.closed_leaf_area > 0))
    wall = np.array(trees.GREEN)
    back, through = 0.6 * wall, 0.4 * wall
    inner = 1.0 / (1.0 - back**2)
    passed = through**2 * inner
    sheet = back + through**2 * back * inner + passed
    assert leaves.color[0] == pytest.approx(sheet, rel=2e-3)
    assert leaves.transmission[0] == pytest.approx(passed.sum() / sheet.sum(), rel=2e-3)
    trunk = whole.take((whole.parent == 0) & (whole.closed_leaf_area == 0))
    assert trunk.color[0] == pytest.approx(trees.BROWN, rel=2e-3)


@given(st.floats(0, 1), st.floats(0, 1))
def test_light_through_both_sides_is_the_sum_of_all_ways(albedo: float, through: float) -> None:
    """Nothing is gained, and the series is summed by hand."""
    color, out = through_both_sides(np.full((1, 3), albedo), np.array([through]))
    r, t = albedo * (1 - through), albedo * through
    back, passed, light = r, 0.0, t
    for _ in range(400):
        passed += light * t
        light *= r
        back += light * t
        light *= r
    assert color[0] == pytest.approx(back + passed, abs=1e-3)
    assert (out * color[:, 0])[0] == pytest.approx(passed, abs=1e-3)
    assert 0.0 <= color[0, 0] <= 1.0 + 1e-6 and 0.0 <= out[0] <= 1.0 + 1e-6


@given(st.integers(0, 2**31))
@settings(max_examples=3)
def test_parts_that_are_turned_stretched_and_mirrored(seed: int) -> None:
    """Where parts stand is the same as if each were a mesh of its own."""
    rng = np.random.default_rng(seed)
    matrices = np.tile(np.eye(4), (40, 1, 1))
    matrices[:, :3] = rng.normal(size=(40, 3, 4))
    own = trees.leaves(seed % 100, 12), trees.trunk()
    source = trees.source_of(*own, shown=rng.integers(0, 2, 40), matrices=matrices)
    asset = trees.compile_asset(source)
    check(source, asset)
    check_samples(asset)


def test_the_same_source_is_the_same_asset() -> None:
    again = trees.compile_asset(trees.source("varied"))
    for name in ("clusters", "samples", "leaves"):
        for key, value in vars(getattr(trees.compiled("varied"), name)).items():
            assert np.array_equal(value, getattr(getattr(again, name), key)), (name, key)


def test_clusters_with_meshes_of_their_own_are_all_of_the_asset_once() -> None:
    big = trees.source_of(trees.tree(4, 9000, size=0.05))
    asset = trees.compile_asset(big)
    own = asset.clusters.meshes
    assert own.sum() > 2
    assert asset.clusters.faces[own].sum() == asset.faces
    assert asset.clusters.faces[own].max() <= MESH_FACES
    for kind in KINDS:
        clusters = trees.compiled(kind).clusters
        assert clusters.faces[clusters.meshes].sum() == trees.source(kind).faces


def test_meshes_of_leaves_have_no_wood_in_them() -> None:
    """As kites stand for leaves alone: a trunk that is in one mesh with them would vanish."""
    for kind in KINDS:
        clusters = trees.compiled(kind).clusters
        own = clusters.take(clusters.meshes)
        bark = (own.wood_area - own.closed_leaf_area) / 2
        mixed = (own.leaf_optical > 1e-9 * own.optical_area) & (bark > 1e-9 * own.optical_area)
        assert not mixed.any(), kind


@pytest.mark.parametrize("what", ["no faces", "no surfaces", "transparent", "no area"])
def test_what_cannot_be_refined_is_named(what: str) -> None:
    one = {
        "no faces": lambda: trees.source_of(trees.surface(np.zeros((0, 3)), [])),
        "no surfaces": lambda: trees.source_of(),
        "transparent": lambda: trees.source_of(trees.surface(trees.QUAD, [(0, 1, 2, 3)], coverage=0.0)),
        "no area": lambda: trees.source_of(trees.surface(np.ones((3, 3)), [(0, 1, 2)])),
    }[what]()
    with pytest.raises(TetFloraError, match='"tree"'):
        trees.compile_asset(one)


def test_a_surface_without_faces_beside_others_is_nothing() -> None:
    empty = trees.surface(np.zeros((2, 3)), [], name="empty")
    with_it = trees.source_of(empty, trees.leaves(), shown=[0, 1])
    assert trees.compile_asset(with_it).faces == 400
