# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Explicit polygons: whatever cuts them, area, colors, directions and texture coordinates stay what they were."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.engine import support
from tests.engine.subplants.test_leaf_meshes import check_topology
from tetflora_addon.assets.patches import mesh_features
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.emission.budget import fit_to_budget
from tetflora_addon.emission.polygons import PolygonBlock, kept_polygons, polygon_blocks, polygon_buffers
from tetflora_addon.emission.shells import proxy_shells
from tetflora_addon.growth.seeds import Branches
from tetflora_addon.proxies.microsurfaces import Facets
from tetflora_addon.refinement.contents import Contents, InCells, _cut, in_the_root, sort_into_children
from tetflora_addon.refinement.contents import sums as sums_by_node
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement, refine
from tetflora_addon.refinement.polygons import Meshes, Polygons, Surface, area_fractions, mended
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.refinement.shared_parts import AssetParts
from tetflora_addon.refinement.summaries import summarize
from tetflora_addon.refinement.visibility import widened_for
from tetflora_addon.tetrahedra.roots import view_root
from tetflora_addon.tetrahedra.tree import TetrahedralTree

#: u, v and a number at a place in the mesh's own space: affine, so that they must be so after any cut.
AFFINE = np.array([[0.3, -0.2, 0.9], [0.5, 0.1, 0.2], [-1.0, 0.4, 0.3]])
SEEDS = st.integers(0, 2**31)


def surface(positions: np.ndarray, faces: list[list[int]], **changes: object) -> Surface:
    """A mesh of two materials with texture coordinates and another attribute that follow from the place."""
    sizes = np.array([len(f) for f in faces])
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    verts = np.concatenate([np.asarray(f) for f in faces])
    triangles = [[s, s + k, s + k + 1] for s, n in zip(offsets, sizes, strict=False) for k in range(1, n - 1)]
    values = (positions @ AFFINE.T)[verts].astype(np.float32)
    solid, leaf, width = mesh_features(positions, verts, offsets)
    given = {
        "name": "rock",
        "positions": positions,
        "corner_verts": verts.astype(np.int32),
        "face_offsets": offsets.astype(np.int32),
        "triangles": np.array(triangles, np.int32),
        "material": (np.arange(len(faces)) % 2).astype(np.int32),
        "colors": np.array([[0.1, 0.4, 0.05], [0.3, 0.2, 0.1]]),
        "transmission": np.array([0.3, 0.0]),
        "coverage": np.ones(2),
        "solid": solid,
        "leaf": leaf,
        "width": width,
        "attributes": {"UVMap": values[:, :2], "number": values[:, 2:]},
    }
    return Surface(**{**given, **changes})


def sound(mesh: MeshBuffers) -> None:
    """A valid mesh, but for edges of many faces, which check_topology does not want to see; Blender finds its edges."""
    after = np.arange(1, len(mesh.corner_verts) + 1)
    after[mesh.face_offsets[1:] - 1] = mesh.face_offsets[:-1]
    ends = np.sort(np.stack([mesh.corner_verts, mesh.corner_verts[after]], axis=1), axis=1)
    edges, number = np.unique(ends, axis=0, return_inverse=True)
    mesh = replace(mesh, edge_verts=edges, corner_edges=number.reshape(-1).astype(np.int32))
    floats = {name: (domain, v) for name, (domain, v) in mesh.attributes.items() if v.dtype == np.float32}
    check_topology(replace(mesh, attributes=floats))


def thicket(seed: int, faces: int = 60, fans: bool = True) -> Surface:
    """Quads, triangles and pentagons all over the place: with gaps, edges of many faces, and faces of no area."""
    rng = np.random.default_rng(seed)
    positions = [rng.uniform(-3, 3, (faces, 1, 3)) + rng.uniform(-1, 1, (faces, 5, 3)), np.zeros((1, 1, 3))]
    positions = np.concatenate([p.reshape(-1, 3) for p in positions])
    own = [list(range(5 * i, 5 * i + 3 + i % 3)) for i in range(faces)]
    own += [[2, 2, 3], [4, 4, 4], [8, 9, 8]] + fans * [[0, 1, 5], [0, 1, 6], [0, 1, 7]]  # none and four at one edge
    return surface(positions, own)


def placed(one: Surface, seed: int, number: int = 3) -> Meshes:
    """Instances, turned, sheared, stretched, and the last one mirrored."""
    rng = np.random.default_rng(seed)
    matrices = np.tile(np.eye(4), (number, 1, 1))
    matrices[:, :3, :3] += 0.3 * rng.uniform(-1, 1, (number, 3, 3))
    matrices[-1, 0] *= -1
    matrices[:, :3, 3] = rng.uniform(-4, 4, (number, 3))
    return Meshes([one], np.zeros(number, int), matrices)


def sums(polygons: Polygons) -> np.ndarray:
    """Area, color, transmission, orientation moment, all as sums."""
    nothing = np.zeros(1, np.int64)
    summary = summarize(support.small_flora(), Contents(polygons=in_the_root(polygons)), nothing, 1)
    return np.concatenate([[1], summary.color[0], summary.transmission, summary.moment.ravel()]) * summary.optical_area


def divided(polygons: Polygons, seed: int, slack: float, rounds: int = 4) -> tuple[TetrahedralTree, InCells]:
    """Polygons in a tree that a camera roots and random choices divide."""
    rng = np.random.default_rng(seed)
    camera = support.camera(rng.uniform(-9, 9, 3), rng.uniform(-3, 3, 3))
    tree = view_root(camera, support.box_around(polygons))

    def loose(points: np.ndarray) -> np.ndarray:
        return np.full(len(points), slack)

    held = sort_into_children(tree, in_the_root(polygons), loose)
    for _ in range(rounds):
        nodes = np.unique(held.cell)
        nodes = nodes[rng.random(len(nodes)) < 0.7]
        for _ in range(2):
            nodes = tree.split(nodes).ravel()
        held = sort_into_children(tree, held, loose)
    return tree, held


@given(SEEDS, st.sampled_from([0.0, 0.02, 0.5]))
@settings(deadline=None, max_examples=12)
def test_area_color_and_moment_are_exact_under_any_cuts(seed: int, slack: float) -> None:
    """To 1e-6, as sums over all tetrahedra; totals are those of the fragments, and all is in terminal nodes."""
    polygons = Polygons.everything(placed(thicket(seed), seed))
    tree, held = divided(polygons, seed, slack)
    parts = held.items
    assert (tree.children[held.cell, 0] < 0).all()
    assert len(parts) > len(polygons)
    assert parts.areas().sum() == pytest.approx(polygons.areas().sum(), rel=1e-9)
    assert sums(parts) == pytest.approx(sums(polygons), rel=1e-6, abs=1e-9)
    totals = sums_by_node(held.totals, held.cell, len(tree))
    assert totals.area.sum() == pytest.approx(polygons.areas().sum(), rel=1e-9)
    assert totals.polygons.sum() == len(parts)


@given(SEEDS)
@settings(deadline=None, max_examples=8)
def test_everything_is_on_the_right_side(seed: int) -> None:
    """Every corner of every polygon lies within its tetrahedron's planes, up to the root; within the slack if any."""
    for slack in (0.0, 0.1):
        tree, held = divided(Polygons.everything(placed(thicket(seed, 30), seed)), seed, slack)
        polygons, node = held.items, held.cell.astype(np.intp)
        assert (tree.parent[node] >= 0).any()
        while (tree.parent[node] >= 0).any():
            parent = np.maximum(tree.parent[node], 0)
            low, high = polygons.distances(tree.planes(parent))
            beyond = np.where(tree.children[parent, 1] == node, -low, high)
            assert beyond[tree.parent[node] >= 0].max() < 1e-7 + slack
            node = np.where(tree.parent[node] >= 0, parent, node)


@given(SEEDS)
@settings(deadline=None, max_examples=25)
def test_texture_coordinates_and_attributes_are_interpolated(seed: int) -> None:
    """What was an affine function of the place before is the same function after cuts."""
    one = thicket(seed, 30, fans=False)
    meshes = Meshes([one], np.zeros(1, int), np.eye(4)[None])
    _, held = divided(Polygons.everything(meshes), seed, 0.0)
    mesh = polygon_buffers(held.items)
    sound(mesh)
    expected = mesh.positions[mesh.corner_verts].astype(np.float64) @ AFFINE.T
    assert mesh.attributes["UVMap"][0] == "CORNER"
    np.testing.assert_allclose(mesh.attributes["UVMap"][1], expected[:, :2], atol=1e-5)
    np.testing.assert_allclose(mesh.attributes["number"][1], expected[:, 2], atol=1e-5)


@given(SEEDS)
@settings(deadline=None, max_examples=25)
def test_a_plane_leaves_each_piece_on_one_side(seed: int) -> None:
    """Fractions of a face's triangles add up to 1, and no fragment reaches across."""
    rng = np.random.default_rng(seed)
    polygons = Polygons.everything(placed(thicket(seed), seed))
    normal = rng.normal(size=(len(polygons), 3))
    planes = np.c_[normal / np.linalg.norm(normal, axis=1, keepdims=True), rng.uniform(-1, 1, len(polygons))]
    owner, side, parts = _cut(polygons, planes)
    total = np.bincount(owner, area_fractions(parts.weights)[parts.part], len(polygons))
    np.testing.assert_allclose(total, polygons.meshes.face_size[polygons.face] - 2, atol=1e-12)
    distance = parts.corner_distances(planes[owner]) * np.where(side, 1, -1)[:, None]
    assert distance.min() > -1e-8


def test_a_cut_face_of_which_all_is_there_is_mended() -> None:
    """What need not be cut comes out as it went in: faces, materials, even those without area."""
    one = thicket(1)
    meshes = placed(one, 1)
    polygons = Polygons.everything(meshes)
    _, held = divided(polygons, 1, 0.0)
    assert len(held) > 2 * len(polygons)
    whole = mended(held.items)
    assert (whole.part == -1).all()
    key = np.sort(whole.instance.astype(np.int64) * 1000 + whole.face)
    assert (key == np.sort(polygons.instance.astype(np.int64) * 1000 + polygons.face)).all()
    some = held.items.take(np.random.default_rng(0).random(len(held)) < 0.8)
    assert mended(some).areas().sum() == pytest.approx(some.areas().sum(), rel=1e-9)


def test_whole_faces_share_vertices_and_mirrored_ones_are_turned() -> None:
    cube = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    mirror = np.diag([-2.0, 1.0, 1.0, 1.0])
    box = surface(cube, faces)
    box = surface(cube, faces, normals=np.repeat(support.face_vectors(plain(box)), 4, axis=0).astype(np.float32))
    meshes = Meshes([box], np.zeros(2, int), np.stack([np.eye(4), mirror]))
    mesh = polygon_buffers(Polygons.everything(meshes))
    assert (len(mesh.positions), mesh.polygons) == (16, 12)
    sound(mesh)
    normal = support.face_vectors(mesh) / support.face_areas(mesh)[:, None]
    np.testing.assert_allclose(np.repeat(normal, 4, axis=0), mesh.attributes["custom_normal"][1], atol=1e-6)
    middle = np.repeat([[0.5, 0.5, 0.5], [-1.0, 0.5, 0.5]], 6, axis=0)
    assert (np.einsum("ni,ni->n", normal, support.face_centers(mesh) - middle) > 0).all()
    assert (mesh.attributes["material_index"][1] == np.tile(np.arange(6) % 2, 2)).all()


def plain(one: Surface) -> MeshBuffers:
    """A surface as a mesh by itself."""
    return polygon_buffers(Polygons.everything(Meshes([one], np.zeros(1, int), np.eye(4)[None])))


@pytest.mark.parametrize("what", ["vertex", "transform"])
def test_what_is_no_number_is_refused_by_name(what: str) -> None:
    one, matrix = thicket(0), np.eye(4)[None]
    if what == "vertex":
        one.positions[3, 1] = np.nan
    else:
        matrix[0, 2, 3] = np.inf
    with pytest.raises(ValueError, match="rock"):
        Meshes([one], np.zeros(1, int), matrix)


def grove(number: int = 40) -> tuple[Meshes, object]:
    """Heaps of small leaves from near to far."""
    rng = np.random.default_rng(5)
    faces = 300
    middle = rng.uniform([-2, -2, 0], [2, 2, 4], (faces, 1, 3))
    a, b = 0.06 * rng.normal(size=(2, faces, 1, 3))
    corners = np.concatenate([middle, middle + a, middle + a + b, middle + b], axis=1)
    leaves = surface(corners.reshape(-1, 3), np.arange(4 * faces).reshape(-1, 4).tolist())
    matrices = np.tile(np.eye(4), (number, 1, 1))
    matrices[:, 1, 3] = np.linspace(0, 14, number) ** 2
    matrices[:, 0, 3] = rng.uniform(-1, 1, number) * (3 + 0.3 * matrices[:, 1, 3])
    return Meshes([leaves], np.zeros(number, int), matrices), support.camera((0, -6, 2), (0, 60, 2), 160, 1.0)


def refined(meshes: Meshes, camera: object, **options: float) -> Refinement:
    flora = support.small_flora()
    given = {"visibility_resolution": 64, "max_tetrahedra": 20_000, **options}
    loop = refine(flora, support.plants([]), camera, RefinementSettings(**given), None, Polygons.everything(meshes))
    while True:
        try:
            next(loop)
        except StopIteration as stop:
            return stop.value


def emitted(
    result: Refinement, camera: object, facet: float, limit: float = 1e9, most: float = np.inf
) -> tuple[list[PolygonBlock], Facets]:
    """Meshes of faces that stay, and facets of all others."""
    flora = support.small_flora()
    scene = support.refined(flora, result, camera, facet, limit, most=most)
    assert not list(scene.mesh_blocks())
    facets = [some for parts in scene.facet_parts() for some, _ in parts]
    return list(scene.polygon_blocks()), Facets.concatenate(facets) if facets else Facets.empty()


@pytest.mark.parametrize("anchored", [False, True])
def test_near_polygons_stay_and_far_ones_become_facets_of_the_same_area(anchored: bool) -> None:
    """No plant is needed. Leaves near the eye are there as they were, all others are there as area, but for chance."""
    meshes, camera = grove()
    result = refined(meshes, camera, anchored=anchored)
    whole = Polygons.everything(meshes)
    assert result.cell_polygons.polygons.items.areas().sum() == pytest.approx(whole.areas().sum(), rel=1e-9)
    assert {Decision.PROXY, Decision.EXPLICIT} <= set(result.decision.tolist())
    blocks, facets = emitted(result, camera, 0.4)
    kept = sum(support.face_areas(b.buffers).sum() for b in blocks)
    drawn = (facets.side**2).sum()
    chance = 2 * np.sqrt((facets.side**4).sum())  # facets are there or not; of a mesh, not independently
    assert chance < 0.1 * drawn
    assert 0.1 < kept / (kept + drawn) < 0.95
    # Facets beside the view may have been made smaller, so that they do not reach into it.
    loss = 0.5 * whole.areas()[camera.distance_to_view(whole.center) > 0.0].sum()
    assert whole.areas().sum() - loss - chance <= kept + drawn <= whole.areas().sum() + chance
    assert sum(b.buffers.polygons for b in blocks) + len(facets) < 0.7 * len(whole)
    near = whole.take(np.linalg.norm(whole.center - camera.position, axis=1) < 7)
    inside = camera.distance_to_view(near.center) < -0.5
    points = np.concatenate([b.buffers.positions for b in blocks])
    away = np.abs(points[None] - meshes.corners(meshes.face_triangle[near.face], near.instance)[inside][:60, :1]).max(2)
    assert away.min(axis=1).max() < 1e-5


def test_faces_behind_a_wall_are_few_and_the_wall_stays() -> None:
    """One coverage for all: what another mesh hides is merged into large facets, wherever the loop's cells are."""
    meshes, camera = grove()
    wall = surface(np.array([[-9.0, 0, -3], [9, 0, -3], [9, 0, 12], [-9, 0, 12]]), [[0, 1, 2, 3]])
    matrices = np.tile(np.eye(4), (1 + len(meshes.surface), 1, 1))
    matrices[1:, :3, 3] = meshes.origin
    matrices[0, 1, 3] = 10.0
    both = Meshes([wall, meshes.surfaces[0]], np.minimum(np.arange(len(matrices)), 1), matrices)
    seen, hidden = (emitted(refined(one, camera), camera, 1.5, 0.5) for one in (meshes, both))
    behind = [
        sum((b.buffers.positions[:, 1] > 11.0).sum() for b in blocks if len(b.buffers.positions) != 4)
        for blocks, _ in (seen, hidden)
    ]
    assert behind[0] > 20 * max(behind[1], 1)
    assert any(b.surface == 0 and b.buffers.polygons == 1 for b in hidden[0])
    away = [(facets.center[:, 1] > 11.0).sum() for _, facets in (seen, hidden)]
    assert away[1] < 0.5 * (away[0] + behind[0] / 4)


def test_explicit_everywhere_is_the_original() -> None:
    meshes, camera = grove(6)
    result = refined(meshes, camera, leaf_limit=1e-6, hidden=-1.0, cutoff=1e-3, few_polygons=100)
    seen = result.tree.inside[result.cell_polygons.polygons.cell]
    assert np.isin(result.decision, [Decision.EXPLICIT, Decision.HIDDEN]).all()
    blocks = list(polygon_blocks(kept_polygons(result)))
    assert sum(b.buffers.polygons for b in blocks) == len(Polygons.everything(meshes))
    total = sum(support.face_areas(b.buffers).sum() for b in blocks)
    assert total == pytest.approx(Polygons.everything(meshes).areas().sum())
    assert seen.any()
    assert [b.fraction for b in blocks] == sorted(b.fraction for b in blocks)


def test_lens_and_shutter_widen_the_view_for_polygons_alone() -> None:
    meshes, camera = grove(6)
    flora, polygons = support.small_flora(), Polygons.everything(meshes)
    nobody = Branches.empty()
    no_assets = AssetParts.empty()
    sharp = widened_for(camera, 0.04, flora, nobody, polygons, no_assets)
    assert sharp.window == camera.widened(0.04).window
    blurring = replace(camera, lens_radius=0.2, focus=20.0)
    blurred = widened_for(blurring, 0.04, flora, nobody, polygons, no_assets)
    assert blurred.width > sharp.width
    empty = polygons.take(slice(0))
    assert widened_for(blurring, 0.04, flora, nobody, empty, no_assets).width == sharp.width


def rough(number: int = 30, size: float = 40.0) -> Meshes:
    """A rough plain of large faces through the grove."""
    step = np.linspace(-size, size, number)
    x, y = (a.ravel() for a in np.meshgrid(step, step + size, indexing="ij"))
    faces = [[i, i + number, i + number + 1, i + 1] for i in range(number * (number - 1)) if (i + 1) % number]
    plain_ = surface(np.stack([x, y, 0.2 * np.sin(3 * x)], axis=1), faces)
    leaves = grove()[0]
    matrices = np.tile(np.eye(4), (1 + len(leaves.surface), 1, 1))
    matrices[1:, :3, 3] = leaves.origin
    return Meshes([plain_, leaves.surfaces[0]], np.minimum(np.arange(len(matrices)), 1), matrices)


@pytest.mark.parametrize("shells", [False, True])
def test_large_polygons_stay_whole_among_proxies(shells: bool) -> None:
    """Ground is neither fog nor facets because leaves above it are, and does not make leaves explicit."""
    meshes, camera = rough(), grove()[1]
    result = refined(meshes, camera)

    def kept(one: Refinement) -> list[PolygonBlock]:
        return list(polygon_blocks(kept_polygons(one))) if shells else emitted(one, camera, 2.0, 2.0)[0]

    blocks = kept(result)
    near = [b.buffers for b in blocks if b.surface == 0]
    alone = refined(grove()[0], camera)
    ground = Polygons.everything(meshes).areas()[: 29**2]
    assert sum(support.face_areas(b).sum() for b in near) > 0.9 * ground.sum()
    assert sum(b.polygons for b in near) < 1.5 * 29**2
    leaves = [sum(b.buffers.polygons for b in every if b.surface == s) for every, s in ((blocks, 1), (kept(alone), 0))]
    assert leaves[0] == pytest.approx(leaves[1], rel=0.4)
    shells = proxy_shells(support.small_flora(), result)
    assert np.isfinite(shells.attributes["tf_kappa"][1]).all()


@pytest.mark.parametrize(("number", "size", "most"), [(30, 40.0, np.inf), (60, 400.0, 2000.0)])
def test_ground_behind_the_eye_is_whole(number: int, size: float, most: float) -> None:
    """Its faces stay as they are, so none of them can stand for others: a third of it was left."""
    meshes, camera = rough(number, size), support.camera((0, -6, 2), (0, -60, 2), 160, 1.0)
    blocks, facets = emitted(refined(meshes, camera), camera, 1.0, 1.0, most=most)
    ground = Polygons.everything(meshes).areas()[: (number - 1) ** 2].sum()
    kept = sum(support.face_areas(b.buffers).sum() for b in blocks if b.surface == 0)
    assert 0.98 * ground < kept + (facets.side**2).sum() < 1.02 * ground
    assert kept > 0.9 * ground


def test_a_budget_leaves_polygons_their_place() -> None:
    """What your own meshes have is taken off first."""
    meshes, camera = grove()
    result = refined(meshes, camera)
    number = len(result.cell_polygons.polygons)
    assert fit_to_budget(result, camera, RefinementSettings(max_polygons=2 * number)).most < 2 * number - number + 1
