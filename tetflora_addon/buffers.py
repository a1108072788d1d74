# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the engine hands to Blender: one mesh or cloud of points as plain arrays, in Blender's own memory layout."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats32, Integers32, Mask

#: Polygons in a block, about; some 60 MB of buffers.
BLOCK_POLYGONS = 250_000


@dataclass(frozen=True)
class MeshBuffers:
    """One mesh, ready to be copied into a Blender mesh without any further computation."""

    positions: Floats32  # (v, 3): vertices, meters, world space
    edge_verts: Integers32  # (e, 2): the two vertices of each edge
    #: corner_verts and corner_edges, (c,): vertex of each face corner, and the edge from it to the next corner.
    corner_verts: Integers32
    corner_edges: Integers32
    face_offsets: Integers32  # (f + 1,): where each face's corners start; the last entry is ``c``
    #: mapping of str to (str, ndarray): name to domain (``'POINT'``, ``'FACE'`` or ``'CORNER'``) and values: ``(n,)``,
    #: ``(n, 2)`` or ``(n, 3)`` float32, or ``(n,)`` int32.
    attributes: Mapping[str, tuple[str, NDArray]] = field(default_factory=dict)
    smooth: bool = False  # whether faces are shaded smooth
    species: int | None = None  # the species all of it is of, if that is known; −1 for assets
    look: str = ""  # of the surfaces or assets that it stands for, where it is of no species

    @property
    def polygons(self) -> int:
        """Number of faces."""
        return len(self.face_offsets) - 1

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays together."""
        arrays = [self.positions, self.edge_verts, self.corner_verts, self.corner_edges, self.face_offsets]
        return sum(a.nbytes for a in arrays) + sum(a.nbytes for _, a in self.attributes.values())


@dataclass(frozen=True)
class PointBuffers:
    """One cloud of points that are drawn as spheres."""

    positions: Floats32  # (n, 3): centers, meters, world space
    radius: Floats32  # (n,): meters
    #: Name to values of the points: ``(n,)`` or ``(n, 3)`` float32.
    attributes: Mapping[str, NDArray] = field(default_factory=dict)
    #: species and look: as of meshes.
    species: int | None = None
    look: str = ""

    @property
    def polygons(self) -> int:
        """Number of points: each takes the place of one polygon."""
        return len(self.radius)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays together."""
        return self.positions.nbytes + self.radius.nbytes + sum(a.nbytes for a in self.attributes.values())


def concatenate_buffers(parts: Sequence[MeshBuffers]) -> MeshBuffers | None:
    """Several meshes as one, with the attributes of all, 0 where one has none. None where there are none."""
    parts = [p for p in parts if p.polygons]
    if len(parts) < 2:
        return parts[0] if parts else None

    def joined(name: str, offset_by: str) -> Integers32:
        sizes = np.cumsum([0] + [len(getattr(p, offset_by)) for p in parts[:-1]])
        return np.concatenate([getattr(p, name) + np.int32(s) for p, s in zip(parts, sizes, strict=True)])

    every = {name: pair for part in reversed(parts) for name, pair in part.attributes.items()}
    corners = np.cumsum([0] + [len(p.corner_verts) for p in parts]).astype(np.int32)
    starts = [p.face_offsets[:-1] + c for p, c in zip(parts, corners[:-1], strict=True)]
    return MeshBuffers(
        positions=np.concatenate([p.positions for p in parts]),
        edge_verts=joined("edge_verts", "positions"),
        corner_verts=joined("corner_verts", "positions"),
        corner_edges=joined("corner_edges", "edge_verts"),
        face_offsets=np.concatenate([*starts, corners[-1:]]),
        attributes={
            name: (pair[0], np.concatenate([_values(p, name, *pair) for p in parts])) for name, pair in every.items()
        },
        smooth=parts[0].smooth,
    )


def separate_polygons(corners: Floats32, attributes: Mapping[str, tuple[str, NDArray]]) -> MeshBuffers:
    """Polygons with corners (n, k, 3), meters, of which none shares a vertex with another, as a mesh."""
    number, size = corners.shape[:2]
    every = np.arange(size * number, dtype=np.int32).reshape(number, size)
    return MeshBuffers(
        positions=corners.reshape(-1, 3),
        edge_verts=np.stack([every, np.roll(every, -1, axis=1)], axis=2).reshape(-1, 2),
        corner_verts=every.ravel(),
        corner_edges=every.ravel().copy(),
        face_offsets=np.arange(number + 1, dtype=np.int32) * np.int32(size),
        attributes=attributes,
    )


def kept_faces(mesh: MeshBuffers, kept: Mask) -> MeshBuffers:
    """Some faces of a mesh, a mask (f,), with the vertices and edges that they need."""
    size = np.diff(mesh.face_offsets)
    corner = np.flatnonzero(np.repeat(kept, size))
    verts, edges = np.zeros(len(mesh.positions), bool), np.zeros(len(mesh.edge_verts), bool)
    verts[mesh.corner_verts[corner]] = True
    edges[mesh.corner_edges[corner]] = True
    vert, edge = (np.cumsum(needed, dtype=np.int32) - np.int32(1) for needed in (verts, edges))
    needed = {"POINT": np.flatnonzero(verts), "FACE": np.flatnonzero(kept), "CORNER": corner}
    return MeshBuffers(
        positions=mesh.positions[needed["POINT"]],
        edge_verts=vert[mesh.edge_verts[edges]],
        corner_verts=vert[mesh.corner_verts[corner]],
        corner_edges=edge[mesh.corner_edges[corner]],
        face_offsets=np.concatenate([[0], np.cumsum(size[kept])]).astype(np.int32),
        attributes={name: (domain, values[needed[domain]]) for name, (domain, values) in mesh.attributes.items()},
        smooth=mesh.smooth,
        species=mesh.species,
    )


def _values(mesh: MeshBuffers, name: str, domain: str, like: NDArray) -> NDArray:
    """Values of an attribute of a mesh; zeros if it has none of that name."""
    if name in mesh.attributes:
        return mesh.attributes[name][1]
    sizes = {"POINT": len(mesh.positions), "FACE": mesh.polygons, "CORNER": len(mesh.corner_verts)}
    return np.zeros((sizes[domain], *like.shape[1:]), like.dtype)
