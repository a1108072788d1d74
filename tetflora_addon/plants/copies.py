# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of a leaf model, one for each leaf, written straight into the arrays of their mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..buffers import MeshBuffers
from .leaf_models import LeafModel

_ROWS_AT_ONCE = 4096


class LeafCopies:
    """A mesh of copies under construction.

    Parameters
    ----------
    model : LeafModel
    number : int
        Of copies in the end.
    transmission : float
        Share of the light scattered through the leaf, the same for all.
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
        position: NDArray[np.float64],
        frame: NDArray[np.float32],
        size: NDArray[np.float64],
        colour: NDArray[np.float64],
        motion: tuple[NDArray[np.float64], NDArray[np.float32]] | None = None,
    ) -> None:
        """Place the next n copies.

        Parameters
        ----------
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
        self.positions[new] = self._placed(position, frame, size)
        if motion is not None:
            self.velocity[new] = self._placed(*motion, size)
        self.colour[new] = colour[:, None]

    def _placed(
        self, position: NDArray[np.float64], frame: NDArray[np.float32], size: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """Vertices (n, 3 × vertices) of copies; linear in position and frame, so that it serves velocities as well."""
        shape = self.model.positions.astype(np.float32)
        scaled = frame.transpose(1, 2, 0) * size.astype(np.float32)  # (3, 3, n)
        points = np.zeros((len(shape), 3, len(size)), np.float32)
        for axis in range(3):
            point = points[:, axis]
            np.multiply(shape[:, 0, None], scaled[axis, 0], out=point)
            for column in (1, 2):
                point += shape[:, column, None] * scaled[axis, column]
            point += position[:, axis].astype(np.float32)
        return points.reshape(3 * len(shape), len(size)).T

    def buffers(self) -> MeshBuffers:
        """The mesh, once all copies are placed."""
        model, n = self.model, len(self.positions)
        edges, edge_of_corner = model.edges
        vertices, corners = len(model.positions), len(model.corner_verts)
        starts = _stepped(model.face_offsets[:-1], corners, n)
        materials = (
            {} if model.material_index is None else {"material_index": ("FACE", _stepped(model.material_index, 0, n))}
        )
        motion = {} if self.velocity is None else {"velocity": ("POINT", self.velocity.reshape(-1, 3))}
        return MeshBuffers(
            positions=self.positions.reshape(-1, 3),
            edge_verts=_stepped(edges.reshape(-1), vertices, n).reshape(-1, 2),
            corner_verts=_stepped(model.corner_verts, vertices, n),
            corner_edges=_stepped(edge_of_corner, len(edges), n),
            face_offsets=np.append(starts, np.int32(n * corners)),
            attributes={
                "UVMap": ("CORNER", _stepped(model.uv.reshape(-1), 0, n).reshape(-1, 2)),
                "tf_colour": ("FACE", self.colour.reshape(-1, 3)),
                "tf_transmission": ("FACE", np.full(n * model.polygons, self.transmission, np.float32)),
                **materials,
                **motion,
            },
        )


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
