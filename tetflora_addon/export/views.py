# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What meshes show from afar: cover, mean color and outline, in parallel views of small cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Floats32, Integers, Mask, in_axes, perpendicular, spiral, spread
from ..buffers import MeshBuffers
from ..subplants.pieces import chunks

#: Directions to look from: level ones and such that look down a little, as distant plants are seen.
VIEWS = spiral(np.array([0.0, 0.25, 0.1, 0.35]), np.arange(4), 2.4)
_BATCH = 2_000_000  # pairs of triangles and cells that are tested together
#: What of a row is beside its outline: single leaves beyond it are none.
_BESIDE = 0.02


@dataclass(frozen=True)
class PlantView:
    """A plant from one direction, in cells."""

    shown: Mask  # (h, w): cells that are covered
    color: tuple[float, float, float]  # mean of the surfaces that are seen, linear RGB

    @property
    def cover(self) -> int:
        """Cells that are covered."""
        return int(np.count_nonzero(self.shown))

    def _ends(self) -> Floats:
        """Left and right ends (h, 2) of what each row shows; single leaves beyond them count little."""
        total = np.cumsum(self.shown, axis=1)
        every = total[:, -1:]
        return np.stack([(total >= part * every).argmax(axis=1) for part in (_BESIDE, 1.0 - _BESIDE)], axis=1)

    def outline_off(self, other: PlantView) -> float:
        """How far ends of rows are off those of another view, in cells, on average over rows in which both show some;
        a row in which only one shows anything counts with half of its width.
        """
        some, all_of = (view.shown.sum(axis=1) for view in (self, other))
        both = (some > 0) & (all_of > 0)
        off = np.abs(self._ends() - other._ends()).mean(axis=1)
        alone = (some > 0) != (all_of > 0)
        return float((off[both].sum() + (some + all_of)[alone].sum() / 2.0) / max(both.sum() + alone.sum(), 1))


@dataclass(frozen=True)
class Grid:
    """Cells that several meshes are seen in from a direction."""

    toward: Floats  # (3,): unit, to the eye
    cell: float  # meters
    low: Integers  # (2,): first column and row
    shape: tuple[int, int]  # rows and columns

    @classmethod
    def around(cls, toward: Floats, cell: float, points: Floats32, margin: float) -> Grid:
        """Cells around points (v, 3), and so many meters beside them."""
        flat = in_axes(points, _axes(toward))[:, :2]
        low = np.floor((flat.min(axis=0) - margin) / cell).astype(np.int64)
        width, height = np.ceil((flat.max(axis=0) + margin) / cell).astype(np.int64) - low + 1
        return cls(toward, cell, low, (int(height), int(width)))

    def view(self, meshes: Sequence[MeshBuffers]) -> PlantView:
        """Meshes from the direction: a cell shows what is nearest to the eye at its middle."""
        rows, columns = self.shape
        depth, face = np.full(rows * columns, -np.inf, np.float32), np.zeros(rows * columns, np.int64)
        colors, first = [], 0
        for mesh in meshes:
            color = mesh.attributes["tf_color"][1]
            owner, corners = triangles(mesh)
            self._draw(mesh.positions[corners], owner + first, depth, face)
            colors.append(color)
            first += len(color)
        shown = depth > -np.inf
        mean = np.concatenate(colors)[face[shown]].mean(axis=0, dtype=np.float64) if shown.any() else np.zeros(3)
        return PlantView(shown.reshape(rows, columns), tuple(mean.tolist()))

    def _draw(self, corners: Floats32, owner: Integers, depth: Floats32, face: Integers) -> None:
        """Put triangles (t, 3, 3) of faces (t,) into the cells where they are the nearest."""
        rows, columns = self.shape
        x, y, z = (in_axes(corners, _axes(self.toward))[..., k].T for k in range(3))  # each (3, t)
        # Middles of cells are whole numbers.
        x, y = (of / np.float32(self.cell) - np.float32(low + 0.5) for of, low in zip((x, y), self.low, strict=True))
        left, below = (np.maximum(np.ceil(_least(of)), 0.0).astype(np.int32) for of in (x, y))
        wide = np.minimum(np.floor(-_least(-x)), columns - 1).astype(np.int32) - left + 1
        tall = np.minimum(np.floor(-_least(-y)), rows - 1).astype(np.int32) - below + 1
        some = np.flatnonzero((wide > 0) & (tall > 0))  # most triangles of fine plants have no middle of a cell
        for run in chunks((wide[some] * tall[some]).astype(np.float64), _BATCH):
            own = some[run]
            of, index = spread((wide[own] * tall[own]).astype(np.int64))
            of = own[of]
            column, row = left[of] + index % wide[of], below[of] + index // wide[of]
            ax, ay = x[:, of] - column, y[:, of] - row
            weights = [ax[i] * ay[j] - ay[i] * ax[j] for i, j in ((1, 2), (2, 0), (0, 1))]
            inside = np.flatnonzero((_least(weights) >= 0.0) | (-_least([-w for w in weights]) <= 0.0))
            of, weights = of[inside], [w[inside] for w in weights]
            total = weights[0] + weights[1] + weights[2]
            near = sum(w * z[k, of] for k, w in enumerate(weights)) / np.where(total == 0.0, 1.0, total)
            cell = row[inside] * columns + column[inside]
            order = np.lexsort([near, cell])  # of each cell the nearest comes last
            last = order[np.append(np.diff(cell[order]) > 0, True)] if len(order) else order
            last = last[near[last] > depth[cell[last]]]
            depth[cell[last]], face[cell[last]] = near[last], owner[of[last]]


def _least(parts: Sequence[Floats32]) -> Floats32:
    """The least of three arrays (t,)."""
    return np.minimum(np.minimum(parts[0], parts[1]), parts[2])


def triangles(mesh: MeshBuffers) -> tuple[Integers, Integers]:
    """Faces (t,) of the triangles that fan out over those of a mesh, and the vertices (t, 3) of these."""
    size = np.diff(mesh.face_offsets)
    owner, index = spread(np.maximum(size - 2, 0).astype(np.int64))
    first = mesh.face_offsets[owner]
    corner = np.stack([first, first + index + 1, first + index + 2], axis=1)
    return owner, mesh.corner_verts[corner]


def _axes(toward: Floats) -> Floats:
    """Columns (3, 3): to the right and up as seen from a direction (3,), and that itself."""
    upright = abs(toward[2]) < 0.99
    right = np.cross([0.0, 0.0, 1.0], toward) if upright else perpendicular(toward[None])[0]
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward], axis=1)
