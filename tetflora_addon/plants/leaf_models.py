# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample leaves: a small polygon list that is copied to every leaf of a plant.

A leaf model lies with its base at the origin, its midrib along +y, one unit long, its upper side towards +z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SpeciesError

MAX_LEAF_POLYGONS = 2000
MAX_LEAF_CORNERS = 4 * MAX_LEAF_POLYGONS  # of all faces; and vertices
MAX_COORDINATE = 100.0  # in leaf lengths; keeps areas and bounds far from what floats can hold
MAX_UV = 10_000.0


@dataclass(frozen=True, eq=False)
class LeafModel:
    """Polygons of one leaf.

    Attributes
    ----------
    positions : (v, 3) float64
        Vertices in units of the leaf's size.
    corner_verts : (c,) int32
        Vertex of each corner, face after face.
    face_offsets : (f + 1,) int32
        First corner of each face.
    uv : (c, 2) float32
        Texture coordinates by corner.
    material_index : (f,) int32, optional
        Material of each face, of models that have several.
    """

    positions: NDArray[np.float64]
    corner_verts: NDArray[np.int32]
    face_offsets: NDArray[np.int32]
    uv: NDArray[np.float32]
    material_index: NDArray[np.int32] | None = None

    @property
    def polygons(self) -> int:
        """Number of faces."""
        return len(self.face_offsets) - 1

    @cached_property
    def content(self) -> bytes:
        """Bytes that are equal for equal models; what caches are keyed by."""
        arrays = (self.positions, self.corner_verts, self.face_offsets, self.uv, self.material_index)
        return b"".join(a.tobytes() for a in arrays if a is not None)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, LeafModel) and self.content == other.content

    def __hash__(self) -> int:
        return hash(self.content)

    @cached_property
    def next_corner(self) -> NDArray[np.int32]:
        """(c,) int32: the corner that follows each corner in its face."""
        following = np.arange(1, len(self.corner_verts) + 1, dtype=np.int32)
        following[self.face_offsets[1:] - 1] = self.face_offsets[:-1]
        return following

    @cached_property
    def edges(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Edges (e, 2) int32 and the edge of each corner (c,) int32."""
        pairs = np.sort(np.stack([self.corner_verts, self.corner_verts[self.next_corner]], axis=1), axis=1)
        edges, corner_edges = np.unique(pairs, axis=0, return_inverse=True)
        return edges.astype(np.int32), corner_edges.reshape(-1).astype(np.int32)

    @cached_property
    def face_vectors(self) -> NDArray[np.float64]:
        """(f, 3) float64: area vector (normal times area) of each face, by Newell's formula."""
        here, there = self.positions[self.corner_verts], self.positions[self.corner_verts[self.next_corner]]
        return 0.5 * np.add.reduceat(np.cross(here, there), self.face_offsets[:-1], axis=0)

    @cached_property
    def area(self) -> float:
        """One-sided area of a leaf of size 1."""
        return float(np.linalg.norm(self.face_vectors, axis=1).sum())

    @cached_property
    def moment(self) -> NDArray[np.float64]:
        """(3, 3) float64: area-weighted mean of n nᵀ over the faces, in the leaf's own axes; its trace is 1."""
        areas = np.linalg.norm(self.face_vectors, axis=1)
        scaled = self.face_vectors / np.sqrt(np.maximum(areas, 1e-300))[:, None]
        return scaled.T @ scaled / areas.sum()

    @cached_property
    def reach(self) -> float:
        """Distance of the farthest vertex from the leaf's base, in units of its size."""
        return float(np.linalg.norm(self.positions, axis=1).max())

    @cached_property
    def width(self) -> float:
        """Extent across the midrib, in units of the leaf's size; what its size on the picture is judged by."""
        return float(np.ptp(self.positions[:, 0]))


def leaf_model(positions: ArrayLike, faces: list[list[int]], uv: ArrayLike | None = None) -> LeafModel:
    """Build and check a leaf model.

    Parameters
    ----------
    positions : (v, 3) float
        Vertices.
    faces : list of list of int
        Vertex indices of each face.
    uv : (v, 2) float, optional
        Texture coordinates by vertex; x and y of the vertices where not given.

    Returns
    -------
    LeafModel
        With the vertices that faces use, in the order given.

    Raises
    ------
    SpeciesError
        No face, too many, one that names a vertex twice or one that is not there, coordinates out of range, no area.
    """
    positions = np.asarray(positions, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise SpeciesError("leaf model: vertices must be a list of [x, y, z]")
    if not (np.abs(positions) <= MAX_COORDINATE).all():  # false for NaN as well
        raise SpeciesError(f"leaf model: vertices must be finite, each coordinate within ±{MAX_COORDINATE:g}")
    sizes = [len(f) for f in faces]
    if not 1 <= len(faces) <= MAX_LEAF_POLYGONS or min(sizes) < 3:
        raise SpeciesError(f"leaf model: needs 1 to {MAX_LEAF_POLYGONS} faces of 3 or more vertices, has {len(faces)}")
    if max(sum(sizes), len(positions)) > MAX_LEAF_CORNERS:
        raise SpeciesError(f"leaf model: at most {MAX_LEAF_CORNERS} vertices and corners of faces are allowed")
    named = [v for f in faces for v in f]
    if wrong := [v for v in named if not 0 <= v < len(positions)]:
        raise SpeciesError(f"leaf model: faces name vertex {wrong[0]}, but there are {len(positions)}, counted from 0")
    if any(len(set(f)) < len(f) for f in faces):
        raise SpeciesError("leaf model: a face names a vertex twice")
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
    by_vertex = np.asarray(uv, dtype=np.float64) if uv is not None else positions[:, :2] + [0.5, 0.0]
    if by_vertex.shape != (len(positions), 2) or not (np.abs(by_vertex) <= MAX_UV).all():
        raise SpeciesError(f"leaf model: uv must hold one [u, v] within ±{MAX_UV:g} for each vertex")
    used, corners = np.unique(np.array(named, dtype=np.int32), return_inverse=True)
    corners = corners.reshape(-1).astype(np.int32)
    model = LeafModel(positions[used], corners, offsets, by_vertex[used][corners].astype(np.float32))
    if not model.area > 0:
        raise SpeciesError("leaf model: all faces have zero area")
    return model


def _folded(half_width: float, fold: float, droop: float) -> LeafModel:
    """Two quads that meet at the midrib and rise from it: a broad leaf with a hexagonal outline."""
    base, tip = (0.0, 0.0, 0.0), (0.0, 1.0, -droop)
    low, high = (half_width, 0.28, fold), (0.8 * half_width, 0.66, 0.7 * fold - 0.5 * droop)
    mirrored = [(-x, y, z) for x, y, z in (low, high)]
    return leaf_model([base, tip, low, high, *mirrored], [[0, 2, 3, 1], [0, 1, 5, 4]])


def _spray(blades: int, half_width: float) -> LeafModel:
    """Narrow quads fanned out in a plane and tilted out of it: a bundle of needles."""
    positions, faces = [], []
    for i in range(blades):
        turn = np.radians(-55 + 110 * (i + 0.5) / blades)
        lift = 0.25 * (1 if i % 2 else -1)
        along = np.array([np.sin(turn), np.cos(turn), lift])
        along /= np.linalg.norm(along)
        across = half_width * np.array([np.cos(turn), -np.sin(turn), 0.0])
        faces.append([4 * i + k for k in range(4)])
        positions += [0 * along - across, 0 * along + across, along + across, along - across]
    return leaf_model(np.array(positions), faces, np.tile([[0, 0], [1, 0], [1, 1], [0, 1]], (blades, 1)))


def _kite(half_width: float, fold: float, droop: float) -> LeafModel:
    """One quad, bent along the midrib: the least that still looks like a leaf."""
    corners = [(0.0, 0.0, 0.0), (half_width, 0.4, fold), (0.0, 1.0, -droop), (-half_width, 0.4, fold)]
    return leaf_model(corners, [[0, 1, 2, 3]])


LEAF_MODELS: dict[str, LeafModel] = {
    "kite": _kite(0.32, 0.05, 0.05),
    "ovate": _folded(0.30, 0.08, 0.10),
    "round": _folded(0.42, 0.05, 0.06),
    "lanceolate": _folded(0.13, 0.03, 0.12),
    "needles": _spray(4, 0.035),
}
"""The built-in polygon lists by name."""
