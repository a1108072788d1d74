# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Explicit polygons: each is in one tetrahedron as a whole, and drawn as it was."""

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
from tetflora_addon.proxies.summaries import summarize
from tetflora_addon.refinement.contents import Contents, PolygonsByCell
from tetflora_addon.refinement.contents import sums as sums_by_node
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.loop import Refinement, refine
from tetflora_addon.refinement.polygons import Meshes, Polygons, Surface
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.refinement.shared_parts import AssetParts
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
    """A valid mesh, but for edges of many faces, which check_topology does not want to see."""
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


def divided(polygons: Polygons, seed: int, rounds: int = 4) -> tuple[TetrahedralTree, PolygonsByCell]:
    """Polygons in a tree that a camera roots and random choices divide."""
    rng = np.random.default_rng(seed)
    camera = support.camera(rng.uniform(-9, 9, 3), rng.uniform(-3, 3, 3))
    tree, held = view_root(camera, polygons.bounding_box()), PolygonsByCell(polygons)
    divide(tree, held, np.zeros(1, int))
    for _ in range(rounds):
        nodes = np.unique(held.polygons.cell)
        nodes = parents = nodes[rng.random(len(nodes)) < 0.7]
        for _ in range(2):
            nodes = tree.split(nodes).ravel()
        divide(tree, held, parents)
    return tree, held


def divide(tree: TetrahedralTree, held: PolygonsByCell, parents: np.ndarray) -> None:
    """Hand on what lies in nodes that were divided; what changes is told."""
    dividing, before = np.zeros(len(tree), bool), held.polygons.cell.copy()
    dividing[parents] = True
    changed = held.update(tree, dividing, np.zeros(len(tree)))
    moved = before != held.polygons.cell
    assert changed[before[moved]].all() and changed[held.polygons.cell[moved]].all()
    assert not moved[~dividing[before]].any()


@given(SEEDS)
@settings(deadline=None, max_examples=12)
def test_each_is_in_the_terminal_that_holds_its_middle(seed: int) -> None:
    """Sums over all tetrahedra are those of the whole, and totals of a part are those of what lies there."""
    polygons = Polygons.everything(placed(thicket(seed), seed))
    tree, held = divided(polygons, seed)
    cell = held.polygons.cell
    assert (tree.children[cell, 0] < 0).all() and len(np.unique(cell)) > 10
    np.testing.assert_array_equal(cell, tree.locate(polygons.center))
    assert held.polygons.items is polygons
    chosen = np.random.default_rng(seed).random(len(tree)) < 0.5
    parts = [sums_by_node(*held.totals(some), len(tree)) for some in (chosen, ~chosen)]
    assert not parts[0].area[~chosen].any() and not parts[1].area[chosen].any()
    assert sum(part.area.sum() for part in parts) == pytest.approx(polygons.areas().sum(), rel=1e-9)
    assert sum(part.polygons.sum() for part in parts) == len(polygons)
    index = np.where(chosen, 0, 1)
    summary = summarize(support.small_flora(), Contents(polygons=held.polygons), index, 2)
    np.testing.assert_allclose(summary.optical_area, [part.optical_area.sum() for part in parts], rtol=1e-9)


@given(SEEDS)
@settings(deadline=None, max_examples=25)
def test_texture_coordinates_and_attributes_are_those_of_the_surface(seed: int) -> None:
    """What was an affine function of the place is the same function in the mesh that is made."""
    one = thicket(seed, 30, fans=False)
    mesh = plain(one)
    sound(mesh)
    expected = mesh.positions[mesh.corner_verts].astype(np.float64) @ AFFINE.T
    assert mesh.attributes["UVMap"][0] == "CORNER"
    np.testing.assert_allclose(mesh.attributes["UVMap"][1], expected[:, :2], atol=1e-5)
    np.testing.assert_allclose(mesh.attributes["number"][1], expected[:, 2], atol=1e-5)


def test_whole_faces_share_vertices_and_mirrored_ones_are_turned() -> None:
    cube = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    mirror = np.diag([-2.0, 1.0, 1.0, 1.0])
    box = surface(cube, faces)
    box = surface(cube, faces, normals=np.repeat(support.face_vectors(plain(box)), 4, axis=0).astype(np.float32))
    meshes = Meshes([box], np.zeros(2, int), np.stack([np.eye(4), mirror]))
    mesh = polygon_buffers(Polygons.everything(meshes))
    assert (len(mesh.positions), len(mesh.edge_verts), mesh.polygons) == (16, 24, 12)
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


def emitted(result: Refinement, camera: object, facet: float, limit: float = 1e9) -> tuple[list[PolygonBlock], Facets]:
    """Meshes of faces that stay, and facets of all others."""
    flora = support.small_flora()
    scene = support.refined(flora, result, camera, facet, limit)
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


def test_a_budget_leaves_polygons_their_place() -> None:
    """What your own meshes have is taken off first."""
    meshes, camera = grove()
    result = refined(meshes, camera)
    number = len(result.cell_polygons.polygons)
    assert fit_to_budget(result, camera, RefinementSettings(max_polygons=2 * number)).most < 2 * number - number + 1
