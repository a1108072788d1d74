# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How large assets are, and a small picture of them for menus: from points on their surface, within a moment.

Nothing is compiled and no renderer is asked, so that neither a window waits nor the background needs one. Materials
count by their mean colour.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..attributes import evaluated_mesh, members, read, world_matrix
from ..materials.means import Look, Looks
from ..scene.explicit import SURFACE_TYPES
from ..scene.instances import Reference, references_of
from ..scene.objects import DEEPEST, has_nodes, rendered_objects
from ..species.asset_species import PICTURE_SIDE
from .target import Target

_POINTS = 60_000  # of a picture
_TRIANGLES = 200_000  # of one mesh that are looked at
_INSTANCES = 4_000  # of one reference
_FINER = 2  # pixels of the picture that is made for one that is kept
_BASE = 0.1  # fraction of the area that lies below the crown's base
_UP, _SIDE = np.array([0.0, -0.26, 0.966]), np.array([1.0, 0.0, 0.0])  # axes of the picture: a little from above
_SUN = np.array([-0.45, -0.55, 0.7])


@dataclass(frozen=True)
class Measures:
    """Of a plant of scale 1: metres, number of faces, m², linear RGB; and a picture, the lowest row first."""

    radius: float
    base: float
    height: float
    polygons: float
    leaves: float
    colour: tuple[float, float, float]
    picture: NDArray[np.uint8]


@dataclass
class _Mesh:
    """Triangles of a mesh: corners (t, 3, 3), area (t,), color (t, 3), coverage (t,), and how many faces it has."""

    corners: NDArray[np.float64]
    area: NDArray[np.float64]
    colour: NDArray[np.float64]
    coverage: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    faces: int
    area_of_leaves: float


class _Collector:
    """Meshes that something shows, each with its places."""

    def __init__(self, depsgraph: bpy.types.Depsgraph, only_boxes: bool = False) -> None:
        self.depsgraph, self.looks, self.only_boxes = depsgraph, Looks(), only_boxes
        self.meshes: list[tuple[_Mesh, NDArray[np.float64], float]] = []  # places (k, 4, 4), each for so many

    def take(self, shown: Reference, places: NDArray[np.float64], weight: float = 1.0, depth: int = 0) -> None:
        """Take an original object or collection, or evaluated geometry, at places (k, 4, 4)."""
        if depth > DEEPEST:
            return
        if isinstance(shown, bpy.types.Collection):
            back = np.eye(4)
            back[:3, 3] = -np.array(shown.instance_offset)
            for obj in rendered_objects(shown):
                self.take(obj, places @ back @ world_matrix(obj, self.depsgraph), weight, depth + 1)
            return
        if isinstance(shown, bpy.types.Object):
            if shown.instance_type == 'COLLECTION' and shown.instance_collection is not None:
                self.take(shown.instance_collection, places, weight, depth + 1)
            if shown.type not in SURFACE_TYPES:
                return
            with evaluated_mesh(shown, self.depsgraph) as mesh:
                slots = [slot.material for slot in shown.material_slots]
                self._add(mesh, slots, places, weight)
            evaluated = shown.evaluated_get(self.depsgraph)
            if not has_nodes(shown) or shown.type != 'MESH' or not evaluated.is_evaluated:
                return
            shown = evaluated.evaluated_geometry()
        else:
            self._add(shown.mesh, [], places, weight)
        for target, rows in references_of(shown):
            below, _ = rows.within(places, np.zeros(len(places), np.uint64))
            step = 1 if self.only_boxes else max(-(-len(below) // _INSTANCES), 1)
            below = below[::step]
            original = target if isinstance(target, bpy.types.GeometrySet) else target.original
            self.take(original, below, weight * step, depth + 1)

    def _add(
        self, mesh: bpy.types.Mesh | None, slots: list[bpy.types.Material | None], places: NDArray, weight: float
    ) -> None:
        if mesh is not None and len(mesh.polygons):
            self.meshes.append((self._read(mesh, slots), places, weight))

    def _read(self, mesh: bpy.types.Mesh, slots: list[bpy.types.Material | None]) -> _Mesh:
        positions = np.nan_to_num(read(mesh, "position").astype(np.float64))
        low, high = positions.min(axis=0), positions.max(axis=0)
        if self.only_boxes:
            none = np.zeros(0)
            return _Mesh(none, none, none, none, low, high, len(mesh.polygons), 0.0)
        mesh.calc_loop_triangles()
        triangles = members(mesh.loop_triangles, "loops", 3, np.int32)
        faces = members(mesh.loop_triangles, "polygon_index", dtype=np.int32)
        if len(triangles) > _TRIANGLES:
            some = np.linspace(0, len(triangles) - 1, _TRIANGLES).astype(np.int64)
            triangles, faces, factor = triangles[some], faces[some], len(triangles) / _TRIANGLES
        else:
            factor = 1.0
        corners = positions[read(mesh, ".corner_vert")[triangles]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = 0.5 * factor * np.sqrt(np.einsum("ni,ni->n", normal, normal))
        materials = slots or list(mesh.materials)
        looks = [self.looks.of(m, {}) if m is not None else Look() for m in materials] or [Look()]
        slot = np.clip(members(mesh.polygons, "material_index", dtype=np.int32)[faces], 0, len(looks) - 1)
        coverage = np.array([look.coverage for look in looks])[slot]
        # Of closed leaves both sides have area; each edge of theirs has two faces.
        loose = min(max(2.0 * len(mesh.edges) / len(mesh.loops) - 1.0, 0.0), 1.0)
        return _Mesh(
            corners,
            area,
            np.array([look.colour for look in looks])[slot],
            coverage,
            low,
            high,
            len(mesh.polygons),
            (0.5 + 0.5 * loose) * float(area @ coverage),
        )


def measure(
    shown: Iterable[tuple[bpy.types.Object | bpy.types.Collection, NDArray[np.float64]]], depsgraph: bpy.types.Depsgraph
) -> Measures | None:
    """Means over the variants of a species, and a picture of the first.

    Parameters
    ----------
    shown : iterable
        Original objects and collections, each with the matrix (4, 4) from its space to that of the plant.
    depsgraph : bpy.types.Depsgraph

    Returns
    -------
    Measures or None
        None where nothing has a face.
    """
    found = []
    for datablock, matrix in shown:
        collector = _Collector(depsgraph)
        collector.take(datablock, matrix[None])
        if collector.meshes:
            found.append(_measured(collector.meshes, picture=not found))
    if not found:
        return None
    numbers = np.array([(m.radius, m.base, m.height, m.polygons, m.leaves) for m in found]).mean(axis=0).tolist()
    colour = tuple(np.mean([m.colour for m in found], axis=0).tolist())
    return Measures(*numbers, colour, found[0].picture)


def reach_of(target: Target, depsgraph: bpy.types.Depsgraph) -> float:
    """Distance from an asset's origin within which all of it lies, metres in its own space."""
    collector = _Collector(depsgraph, only_boxes=True)
    collector.take(target.datablock or target.geometry, np.eye(4)[None])
    reach = 0.0
    for mesh, places, _ in collector.meshes:
        reach = max(reach, float(np.linalg.norm(_corners(mesh, places), axis=-1).max()))
    return reach


def _corners(mesh: _Mesh, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners (k, 8, 3) of a mesh's box in its places."""
    corner = np.array(np.meshgrid(*zip(mesh.low, mesh.high, strict=True))).reshape(3, -1).T
    return corner @ places[:, :3, :3].transpose(0, 2, 1) + places[:, None, :3, 3]


def _measured(meshes: list[tuple[_Mesh, NDArray[np.float64], float]], picture: bool) -> Measures:
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    total = leaves = polygons = 0.0
    for mesh, places, weight in meshes:
        box = _corners(mesh, places)
        low, high = np.minimum(low, box.min(axis=(0, 1))), np.maximum(high, box.max(axis=(0, 1)))
        size = weight * float((np.abs(np.linalg.det(places[:, :3, :3])) ** (2.0 / 3.0)).sum())
        total += size * float(mesh.area.sum())
        leaves += size * mesh.area_of_leaves
        polygons += weight * len(places) * mesh.faces
    points, normals, colours = _sampled(meshes, total)
    height = float(high[2] if high[2] > 0.0 else high[2] - low[2])
    radius = max(0.5 * float((high - low)[:2].max()), 1e-3)
    base = float(np.clip(np.quantile(points[:, 2], _BASE), 0.0, height)) if len(points) else 0.0
    drawn = _drawn(points, normals, colours, low, high) if picture else np.zeros((0, 0, 4), np.uint8)
    colour = tuple(colours.mean(axis=0).tolist()) if len(colours) else (0.5, 0.5, 0.5)
    return Measures(radius, base, max(height, 1e-3), polygons, leaves, colour, drawn)


def _sampled(
    meshes: list[tuple[_Mesh, NDArray[np.float64], float]], total: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Points evenly on what covers, with the normals and colors there, (n, 3) each."""
    draw = np.random.default_rng(1)
    out: list[tuple[NDArray, NDArray, NDArray]] = []
    for mesh, places, weight in meshes:
        size = weight * float((np.abs(np.linalg.det(places[:, :3, :3])) ** (2.0 / 3.0)).sum())
        own = float(mesh.area.sum())
        number = int(np.ceil(_POINTS * size * own / total)) if total > 0.0 and own > 0.0 else 0
        if not number:
            continue
        triangle = draw.choice(len(mesh.area), number, p=mesh.area / own)
        triangle = triangle[draw.random(number) < mesh.coverage[triangle]]
        place = places[draw.integers(len(places), size=len(triangle))]
        corners = mesh.corners[triangle]
        u, v = draw.random((2, len(triangle), 1))
        u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
        edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        point = corners[:, 0] + u * edges[0] + v * edges[1]
        turned = [np.einsum("nij,nj->ni", place[:, :3, :3], edge) for edge in edges]
        position = np.einsum("nij,nj->ni", place[:, :3, :3], point) + place[:, :3, 3]
        out.append((position, np.cross(*turned), mesh.colour[triangle]))
    if not out:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3))
    position, normal, colour = (np.concatenate(column) for column in zip(*out, strict=True))
    length = np.sqrt(np.einsum("ni,ni->n", normal, normal))
    return position, normal / np.maximum(length, 1e-12)[:, None], colour


def _drawn(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    colours: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> NDArray[np.uint8]:
    """Points as a picture, each hiding what is behind it."""
    side = PICTURE_SIDE * _FINER
    middle, extent = 0.5 * (low + high), max(float((high - low).max()), 1e-9)
    away = points - middle
    scale = 0.92 * side / extent
    column = np.floor(0.5 * side + scale * (away @ _SIDE)).astype(np.int64)
    row = np.floor(0.5 * side + scale * (away @ _UP)).astype(np.int64)
    depth = away @ np.cross(_SIDE, _UP)
    inside = (column >= 0) & (column < side) & (row >= 0) & (row < side)
    column, row, depth, normals, colours = (a[inside] for a in (column, row, depth, normals, colours))
    light = 0.4 + 0.6 * np.abs(normals @ (_SUN / np.linalg.norm(_SUN)))
    order = np.argsort(depth, kind="stable")  # the nearest is written last
    picture = np.zeros((side, side, 4))
    picture[row[order], column[order], :3] = np.clip(colours * light[:, None], 0.0, 1.0)[order]
    picture[row[order], column[order], 3] = 1.0
    small = picture.reshape(PICTURE_SIDE, _FINER, PICTURE_SIDE, _FINER, 4).mean(axis=(1, 3))
    with np.errstate(invalid="ignore"):
        small[..., :3] = np.nan_to_num(small[..., :3] / small[..., 3:])
    small[..., :3] = np.where(
        small[..., :3] <= 0.0031308, 12.92 * small[..., :3], 1.055 * small[..., :3] ** (1 / 2.4) - 0.055
    )
    return np.round(255.0 * small).astype(np.uint8)
