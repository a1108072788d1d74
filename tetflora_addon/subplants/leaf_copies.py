# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of copies of a leaf model, written straight into the arrays of the mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..buffers import MeshBuffers
from ..growth.hashing import Draw, uniform
from ..leaves.kites import KITE, LeafKites
from ..leaves.levels import LeafLevel
from ..leaves.models import LeafModel

_ROWS_AT_ONCE = 4096


class LeafCopies:
    """A mesh of copies under construction.

    Parameters
    ----------
    model : LeafModel
    number : int
        Of copies in the end.
    transmission : float
        Fraction of the light scattered through the leaf, the same for all.
    moving : bool
        Whether they have velocities.
    """

    def __init__(self, model: LeafModel, number: int, transmission: float, moving: bool = False) -> None:
        self.model = model
        self.done = 0
        self.transmission = transmission
        self.positions = np.zeros((number, 3 * len(model.positions)), np.float32)
        self.velocity = np.zeros_like(self.positions) if moving else None
        self.colour = np.zeros((number, model.polygons, 3), np.float32)

    def add(
        self,
        key: NDArray[np.uint64],
        position: NDArray[np.float64],
        frame: NDArray[np.float32],
        size: NDArray[np.float64],
        colour: NDArray[np.float64],
        motion: tuple[NDArray[np.float64], NDArray[np.float32]] | None = None,
    ) -> None:
        """Place the next n copies.

        Parameters
        ----------
        key : (n,) uint64
            Of the leaves.
        position : (n, 3) float64
            Of the model's origin, metres.
        frame : (n, 3, 3) float32
            Columns are the model's axes.
        size : (n,) float64
            Metres for one unit of the model.
        colour : (n, 3) float64
            Linear RGB.
        motion : (n, 3) float64 and (n, 3, 3) float32, optional
            How fast the origin moves and the columns change, a second.
        """
        new = slice(self.done, self.done + len(size))
        self.done = new.stop
        shape = self._shapes(key, new)
        self.positions[new] = _placed(shape, position, frame, size)
        if motion is not None:
            self.velocity[new] = _placed(shape, *motion, size)
        self.colour[new] = colour[:, None]

    def _shapes(self, key: NDArray[np.uint64], new: slice) -> NDArray[np.float32]:
        """Vertices (v, 3, n or 1) of copies with keys (n,) before they are placed."""
        return self.model.positions.astype(np.float32)[:, :, None]

    def buffers(self) -> MeshBuffers:
        """The mesh, once all copies are placed."""
        model, n = self.model, len(self.positions)
        edges, edge_of_corner = model.edges
        vertices, corners = len(model.positions), len(model.corner_verts)
        starts = _stepped(model.face_offsets[:-1], corners, n)
        index = self._materials()
        materials = {} if index is None else {"material_index": ("FACE", index)}
        motion = {} if self.velocity is None else {"velocity": ("POINT", self.velocity.reshape(-1, 3))}
        return MeshBuffers(
            positions=self.positions.reshape(-1, 3),
            edge_verts=_stepped(edges.reshape(-1), vertices, n).reshape(-1, 2),
            corner_verts=_stepped(model.corner_verts, vertices, n),
            corner_edges=_stepped(edge_of_corner, len(edges), n),
            face_offsets=np.append(starts, np.int32(n * corners)),
            attributes={
                "UVMap": ("CORNER", self._texture()),
                "tf_colour": ("FACE", self.colour.reshape(-1, 3)),
                "tf_transmission": ("FACE", np.full(n * model.polygons, self.transmission, np.float32)),
                **materials,
                **motion,
            },
            smooth=model.closed and not model.textured,  # fruit and fleshy leaves are round
        )

    def _texture(self) -> NDArray[np.float32]:
        """Texture coordinates (corners, 2)."""
        return _stepped(self.model.uv.reshape(-1), 0, len(self.positions)).reshape(-1, 2)

    def _materials(self) -> NDArray[np.int32] | None:
        """Material (faces,) of each face, where there are several."""
        model = self.model
        return None if model.material_index is None else _stepped(model.material_index, 0, len(self.positions))


class KiteCopies(LeafCopies):
    """Copies of a leaf model as one kite each, in planes that their keys choose.

    Parameters
    ----------
    kites : LeafKites
    number, transmission, moving
        As of `LeafCopies`.
    """

    def __init__(self, kites: LeafKites, number: int, transmission: float, moving: bool = False) -> None:
        super().__init__(KITE, number, transmission, moving)
        self.kites = kites
        self.plane = np.zeros(number, np.int8)

    def _shapes(self, key: NDArray[np.uint64], new: slice) -> NDArray[np.float32]:
        self.plane[new] = self.kites.chosen(uniform(key, Draw.LEAF_PLANE))
        return self.kites.positions.astype(np.float32).transpose(1, 2, 0)[:, :, self.plane[new]]

    def _texture(self) -> NDArray[np.float32]:
        return self.kites.uv[self.plane].reshape(-1, 2)

    def _materials(self) -> NDArray[np.int32] | None:
        index = self.kites.material_index
        return None if index is None else index[self.plane]


class LevelCopies(LeafCopies):
    """Copies of a finer level of a leaf, of which their keys choose a variant; shaded smooth.

    Parameters
    ----------
    level : LeafLevel
    number, transmission, moving
        As of `LeafCopies`.
    """

    def __init__(self, level: LeafLevel, number: int, transmission: float, moving: bool = False) -> None:
        super().__init__(level.model, number, transmission, moving)
        self.shapes, self.tint = level.shapes.transpose(1, 2, 0), level.tint

    def _shapes(self, key: NDArray[np.uint64], new: slice) -> NDArray[np.float32]:
        variants = self.shapes.shape[2]
        return self.shapes[:, :, (uniform(key, Draw.LEAF_VARIANT) * variants).astype(np.int64)]

    def buffers(self) -> MeshBuffers:
        """The mesh, once all copies are placed."""
        np.minimum(self.colour * self.tint, 1.0, out=self.colour)
        return replace(super().buffers(), smooth=True)


def _placed(
    shape: NDArray[np.float32], position: NDArray[np.float64], frame: NDArray[np.float32], size: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Vertices (n, 3 v) of copies of shapes (v, 3, n or 1); linear in position and frame, and so serves velocities."""
    scaled = frame.transpose(1, 2, 0) * size.astype(np.float32)  # (3, 3, n)
    points = np.zeros((len(shape), 3, len(size)), np.float32)
    for axis in range(3):
        point = points[:, axis]
        np.multiply(shape[:, 0], scaled[axis, 0], out=point)
        for column in (1, 2):
            point += shape[:, column] * scaled[axis, column]
        point += position[:, axis].astype(np.float32)
    return points.reshape(3 * len(shape), len(size)).T


def _stepped(pattern: NDArray, step: int, rows: int) -> NDArray:
    """A pattern (k,) over and over, greater by a step each time; as one row (rows * k,), in the pattern's own type.

    What is filled is the source of what follows: additions then run along many rows, not along one short pattern.
    """
    out = np.zeros((rows, len(pattern)), pattern.dtype)
    out[:1] = pattern
    done = 1
    while done < rows:
        more = min(done, _ROWS_AT_ONCE, rows - done)  # a source of no more than so many rows stays in the cache
        np.add(out[:more], out.dtype.type(done * step), out=out[done : done + more])
        done += more
    return out.reshape(-1)
