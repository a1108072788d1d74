# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What several engine tests share: the shipped species compiled once, rows of plants, measures of meshes."""

from __future__ import annotations

import copy
import json
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tetflora_addon.arrays import spread
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled.flora import Flora, compile_species
from tetflora_addon.emission.drawing import drawing
from tetflora_addon.emission.emitters import EmissionInput
from tetflora_addon.emission.plants import Block, Transition
from tetflora_addon.growth.axes import axes
from tetflora_addon.growth.foliage import leaf_keys, leaf_places, place_leaves
from tetflora_addon.growth.growth import WholeBranches, leaf_counts, trunks
from tetflora_addon.growth.seeds import Branches, Seeds
from tetflora_addon.proxies.facet_weights import COUNTS, FacetWeights, facet_weights
from tetflora_addon.proxies.microsurfaces import Facets
from tetflora_addon.proxies.primitives import joined, shape_buffers, triangles_of
from tetflora_addon.refinement.contents import bounding_capsules
from tetflora_addon.refinement.loop import Refinement
from tetflora_addon.refinement.polygons import Polygons
from tetflora_addon.refinement.shared_parts import AssetParts
from tetflora_addon.species.catalog import builtin_folder, load_species, species_from_dict
from tetflora_addon.species.members import expected_polygons
from tetflora_addon.species.quality import with_quality
from tetflora_addon.subplants.leaf_meshes import LeafMesh, leaf_meshes
from tetflora_addon.subplants.pieces import Pieces, expand, whole_pieces
from tetflora_addon.subplants.tubes import tube_buffers
from tetflora_addon.tetrahedra.geometry import FACES, barycentric, face_area_vectors

SPECIES = tuple(sorted(path.stem for path in builtin_folder().glob("*.json")))
#: Species of so many alike branches that a few plants settle means of place and direction (a palm has 30 fronds).
DENSE = (
    "bamboo",
    "birch",
    "broadleaf_tree",
    "bush",
    "cherry_blossom",
    "conifer",
    "cypress",
    "fern",
    "oak",
    "scots_pine",
)

#: Three orders, every feature, some 600 polygons: large enough to be a plant, small enough for hundreds of them.
SMALL: dict[str, Any] = {
    "format": 1,
    "name": "Small",
    "leaf": {"model": "kite"},
    "orders": [
        {"length": [3, 0.5], "thickness": [0.02, 0.004], "taper": 0.3, "segments": 3, "sides": 5, "curvature": [0, 30],
         "angle": [3, 3], "branches": [7, 2], "branch_start": 0.2, "crown": "spherical"},
        {"length": [0.35, 0.08], "thickness": [0.4, 0.08], "segments": 2, "sides": 4, "curvature": [20, 30],
         "angle": [70, 15], "angle_tip": 35, "branches": [4, 1], "crown": "tapered",
         "leaves": [3, 1], "leaf_start": 0.5, "leaf_size": [0.1, 0.03], "leaf_light": 0.4},
        {"length": [0.5, 0.1], "thickness": [0.5, 0.1], "segments": 1, "sides": 3, "angle": [50, 15],
         "leaves": [6, 2], "leaf_size": [0.1, 0.03], "leaf_light": 0.6},
    ],
}  # fmt: skip


#: Of one plant of the shipped species in most tests, and where any plant will do.
MOST_POLYGONS, FEW_POLYGONS = 25_000.0, 8_000.0


def shipped(identifier: str) -> dict[str, Any]:
    """A shipped species file as decoded JSON, a fresh copy."""
    return json.loads((builtin_folder() / f"{identifier}.json").read_text(encoding="utf-8"))


def small(**changes: Any) -> dict[str, Any]:
    """A fresh copy of `SMALL`; ``order1={"leaves": [0, 0]}`` changes keys of order 1, other names keys of the file."""
    data = copy.deepcopy(SMALL)
    for name, value in changes.items():
        if name.startswith("order"):
            data["orders"][int(name[5:])].update(value)
        else:
            data[name] = value
    return data


#: Everything that a species may ask for at once, some 4,000 polygons.
RICH: dict[str, Any] = small(
    order0={
        "forks": [2.3, 0.4], "fork_at": 0.4, "fork_angle": [25, 5], "fork_levels": 2, "flare": 0.8, "segments": 6,
        "branches": [8, 1], "branch_start": [0.2, 0.1], "taper": [0.4, 0.1], "spurs": [3, 1],
    },
    order1={
        "pipe": 2.4, "attraction": [60, 20], "spray": 0.8, "azimuth": [180, 10], "leaf_start": [0.3, 0.2],
        "leaf_whorl": 3, "leaf_spray": 0.7, "leaf_size_tip": 0.6, "leaf_color_tip": [0.3, 0.4, 0.1],
        "thickness": [0.6, 0.1], "segments": 4,
    },
    order2={
        "spurs": [2, 1], "leaf_droop": 0.6, "leaf_light": [0.4, 0.3], "leaf_size_tip": 1.7, "attraction": [-40, 10],
        "leaf_color_tip": [0.3, 0.4, 0.1], "count_by_length": 0.7,
    },
    leaf=[{"model": "kite"}, {"model": "ovate"}, {"model": "round"}],
    blossom={"model": "lanceolate"},
    spur={
        "length": [0.12, 0.04], "thickness": [0.05, 0.01], "sides": 3, "angle": [40, 20], "leaf_kind": "blossom",
        "leaves": [4, 0], "leaf_whorl": 4, "leaf_size": [0.06, 0.01], "leaf_color": [[0.8, 0.5, 0.5], [0.1, 0.1, 0.1]],
    },
    bud={"length": 0.008, "lateral": 0.5},
    dead={"number": [5, 2], "into": 0.5, "on_limbs": [2, 1]},
)  # fmt: skip


def compiled(*files: dict[str, Any]) -> Flora:
    """Flora of decoded species files."""
    return compile_species([species_from_dict(data, f"s{i}", f"s{i}.json") for i, data in enumerate(files)])


@cache
def described() -> Flora:
    """The shipped species as they are described, in the order of `SPECIES`."""
    return compile_species([load_species(name) for name in SPECIES])


@cache
def flora(most: float = MOST_POLYGONS) -> Flora:
    """The same, the largest with fewer polygons: what is true of every plant is true of these, and sooner seen."""
    species = [load_species(name) for name in SPECIES]
    return compile_species([with_quality(s, min(most / expected_polygons(s), 1.0)) for s in species])


@cache
def alone(name: str, most: float = MOST_POLYGONS) -> Flora:
    """One shipped species, with no more polygons: what is found out about a flora takes as long as it has species."""
    species = load_species(name)
    return compile_species([with_quality(species, min(most / expected_polygons(species), 1.0))])


def lean() -> Flora:
    """The same with fewer still, for what does not depend on how plants are divided."""
    return flora(FEW_POLYGONS)


@cache
def small_flora() -> Flora:
    """Only `SMALL`."""
    return compiled(SMALL)


def plants(seed: ArrayLike, species: ArrayLike = 0, position: ArrayLike = (0, 0, 0), scale: ArrayLike = 1.0) -> Seeds:
    """Upright plants; everything broadcasts against the seeds (n,)."""
    seed = np.atleast_1d(np.asarray(seed, np.int64))
    n = len(seed)
    kinds = np.broadcast_to(np.asarray(species, np.int32), n).copy()
    return Seeds(
        tuple(f"s{i}" for i in range(int(kinds.max(initial=0)) + 1)),
        kinds,
        seed,
        np.broadcast_to(np.asarray(position, float), (n, 3)).copy(),
        np.tile(np.eye(3), (n, 1, 1)),
        np.broadcast_to(np.asarray(scale, float), n).copy(),
    )


def grove(count: int, spacing: float, species: ArrayLike = 0) -> Seeds:
    """A square of plants about the origin, all different."""
    side = int(np.ceil(np.sqrt(count)))
    index = np.arange(count)
    places = np.stack([index % side, index // side, np.zeros(count)], axis=1) * spacing
    return plants(100 + index, species, places - np.array([1, 1, 0]) * (side - 1) * spacing / 2)


def camera(
    eye: ArrayLike, target: ArrayLike, pixels: int = 128, view: float = 0.8, kind: str = "PERSP", near: float = 0.1
) -> Camera:
    """A square picture; ``view`` is its side at depth 1 (perspective) or in meters (orthographic)."""
    eye, target = np.asarray(eye, float), np.asarray(target, float)
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 0.02, 1.0], back)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(back, right), back], axis=1)
    half = view / 2
    return Camera(kind, eye, frame, (-half, half, -half, half), near, 1000.0, pixels, pixels)


def expanded(one: Flora, subplants: Branches) -> Pieces:
    """All branches of sub-plants, to the last twig, as pieces."""
    parts = [whole_pieces(one.rows, some)[0] for some in expand(one, subplants)]
    return Pieces.concatenate([Pieces.empty(), *parts])


def grown(one: Flora, seeds: Seeds) -> tuple[Branches, Pieces]:
    """Trunks, and all branches of the plants as pieces."""
    whole = trunks(one.rows, seeds)
    return whole, expanded(one, whole)


def leaves_of(one: Flora, branches: Branches) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Branch, base (m, 3) and size (m,) of all leaves on branches' own axes."""
    counts = leaf_counts(one.rows, branches)
    owner, index = spread(counts)
    key = leaf_keys(branches, owner, index)
    t = leaf_places(one.rows, branches, owner, index, counts, key)
    leaves = place_leaves(one.rows, branches, axes(one.rows, branches), owner, index, key, t)
    return owner, leaves.position, leaves.size


def whole_of(one: Flora, pieces: Pieces) -> WholeBranches:
    """Branches of which all pieces are there, with their axes."""
    branches = pieces.branches.take(np.flatnonzero(pieces.t0 == 0))
    return WholeBranches(branches, axes(one.rows, branches))


def tube_mesh(one: Flora, pieces: Pieces) -> MeshBuffers | None:
    """Tubes of branches of which all pieces are there; None without any."""
    return tube_buffers(one, [whole_of(one, pieces)])


def leaf_forms_of(one: Flora, pieces: Pieces, species: int = 0) -> list[LeafMesh]:
    """Leaves of branches of a species of which all pieces are there, by their forms."""
    return list(leaf_meshes(one, species, [whole_of(one, pieces)]))


def meshes(one: Flora, pieces: Pieces) -> tuple[list[MeshBuffers], list[MeshBuffers]]:
    """Tubes and leaves of branches, a mesh for each species that has any, and for each form of its leaves."""
    tubes, leaves = [], []
    kinds = one.species_of(pieces.branches.row)
    for species in np.unique(kinds):
        own = pieces.take(kinds == species)
        tubes += [b for b in [tube_mesh(one, own)] if b is not None]
        leaves += [leaf.buffers for leaf in leaf_forms_of(one, own, int(species))]
    return tubes, leaves


def leaf_mesh(one: Flora, pieces: Pieces, species: int = 0) -> MeshBuffers | None:
    """Leaves of a species that has only one form of them; None where branches bear none."""
    found = [leaf.buffers for leaf in leaf_forms_of(one, pieces, species)]
    assert len(found) < 2
    return found[0] if found else None


def face_vectors(mesh: MeshBuffers) -> NDArray[np.float64]:
    """Area vectors (f, 3) by Newell's formula, m²."""
    points = mesh.positions[mesh.corner_verts].astype(np.float64)
    first, last = mesh.face_offsets[:-1], mesh.face_offsets[1:] - 1
    origin = np.repeat(points[first], np.diff(mesh.face_offsets), axis=0)
    points = points - origin  # float32 far from the origin would drown in the product
    following = np.roll(points, -1, axis=0)
    following[last] = points[first]
    (ax, ay, az), (bx, by, bz) = np.ascontiguousarray(points.T), np.ascontiguousarray(following.T)
    vectors = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx  # np.cross takes four times as long
    return np.stack([0.5 * np.add.reduceat(vector, first) for vector in vectors], axis=1)


def face_areas(mesh: MeshBuffers) -> NDArray[np.float64]:
    """Areas (f,) of faces, m²."""
    return np.linalg.norm(face_vectors(mesh), axis=1)


def face_centers(mesh: MeshBuffers) -> NDArray[np.float64]:
    """Means (f, 3) of the corners of faces, meters."""
    points = mesh.positions[mesh.corner_verts].astype(np.float64)
    return np.add.reduceat(points, mesh.face_offsets[:-1], axis=0) / np.diff(mesh.face_offsets)[:, None]


def moment(*meshes: MeshBuffers) -> NDArray[np.float64]:
    """Area-weighted mean (3, 3) of n nᵀ over the faces of all meshes."""
    vectors = np.concatenate([face_vectors(mesh) for mesh in meshes])
    areas = np.linalg.norm(vectors, axis=1)
    scaled = vectors / np.sqrt(np.maximum(areas, 1e-300))[:, None]
    return scaled.T @ scaled / areas.sum()


def refined(
    flora: Flora,
    result: Refinement,
    camera: Camera,
    facet: float = 1.0,
    limit: float = 1e9,
    weighted: bool = True,
    **options: Any,
) -> EmissionInput:
    """A scene to be drawn with facets of so many pixels, and leaves as facets up to a width of so many.

    weighted: facets have the area that leaves of a cluster show; else all of the area that they stand for.
    """
    ones = np.ones((1, len(flora.rows), len(COUNTS)))
    there = np.unique(flora.species_of(result.plants.parts.branches.row)).tolist()
    weights = facet_weights(flora, there) if weighted else FacetWeights(ones, ones)
    given = drawing(flora, result, Transition(flora, camera, limit, np.inf), weights, facet=facet, **options)
    return EmissionInput(flora, result, camera, given)


def drawn(
    flora: Flora, result: Refinement, camera: Camera, facet: float = 1.0, limit: float = 1e9, **options: Any
) -> tuple[list[Block], Facets, NDArray[np.bool_]]:
    """Meshes, facets (n,), and which of these (n,) are seen; options as of `refined`."""
    scene = refined(flora, result, camera, facet, limit, **options)
    blocks = list(scene.mesh_blocks())
    parts = [part for parts in scene.facet_parts() for part in parts]
    facets = joined([some for some, _ in parts]) if parts else Facets.empty()
    return blocks, facets, np.concatenate([np.zeros(0, bool), *(np.full(len(some), seen) for some, seen in parts)])


def facet_mesh(facets: Facets) -> MeshBuffers:
    """Facets as a mesh of triangles."""
    return shape_buffers(triangles_of(facets))


def bounding_cylinders(flora: Flora, subplants: Branches) -> tuple[NDArray, NDArray, NDArray]:
    """Centers (n, 3), radii and half heights (n,) of cylinders about branches that hold all of sub-plants."""
    capsules = bounding_capsules(flora, subplants)
    return capsules[:3].T, capsules[6] + capsules[8], capsules[7] + capsules[8]


def box_around(things: AssetParts | Polygons) -> NDArray[np.float64]:
    """Axis-aligned box (2, 3) around the spheres of one or more things, meters."""
    return np.stack([(things.center.T - things.reach).min(axis=1), (things.center.T + things.reach).max(axis=1)])


def face_planes(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Planes of the four faces of positive tetrahedra; distances are negative inside.

    Parameters
    ----------
    vertices : (..., 4, 3) float64
        Positively oriented tetrahedra, meters.

    Returns
    -------
    (..., 4, 4) float64
        Plane ``(nx, ny, nz, d)`` of the face opposite each vertex, outward unit normal. A face without area has the
        normal 0.
    """
    areas = face_area_vectors(vertices)
    length = np.linalg.norm(areas, axis=-1, keepdims=True)
    normals = areas / np.where(length > 0.0, length, 1.0)
    on_face = vertices[..., FACES[:, 0], :]
    return np.concatenate([normals, -np.sum(normals * on_face, axis=-1, keepdims=True)], axis=-1)


def contains(vertices: NDArray[np.float64], points: NDArray[np.float64], tolerance: float = 1e-9) -> NDArray[np.bool_]:
    """Whether each point ``(..., 3)`` lies in its tetrahedron ``(..., 4, 3)``; result ``(...)`` bool.

    ``tolerance`` is in barycentric coordinates, without unit: the faces belong to the tetrahedron.
    """
    return np.min(barycentric(vertices, points), axis=-1) >= -tolerance
