# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tubes around branches: rings of vertices, joined by quads (paper, section 5)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import unit
from ..buffers import MeshBuffers
from ..compiled.flora import Flora
from ..growth.axes import Axes
from ..growth.branches import Branches
from ..growth.foliage import branch_colours
from ..growth.growth import WholeBranches, radius_at
from ..growth.wind import moment
from .pieces import chunks

_AT_JOINT = 1e-6  # fractions of a segment closer to a joint than this are at it
#: Rings that are worked on at a time: some ten megabytes.
_RINGS_AT_ONCE = 48_000


def tube_buffers(flora: Flora, whole: Sequence[WholeBranches]) -> MeshBuffers | None:
    """Tubes of whole branches of any rows.

    Returns
    -------
    MeshBuffers or None
        Quads with ``UVMap``, ``tf_colour``, ``tf_transmission`` and ``tf_girth``; None without branches.
    """
    sides_of = [flora.rows["sides"][some.branches.row] for some in whole]
    rings_of = [some.lines.segments + flora.rows["rings"][some.branches.row] + 1 for some in whole]
    sides, rings = (np.concatenate([np.zeros(0, np.int64), *each]) for each in (sides_of, rings_of))
    if len(sides) == 0:
        return None
    tubes = _Tubes(int((sides * rings).sum()), int((sides * (rings - 1)).sum()), moment(flora.rows) > 0)
    for k in np.unique(sides):
        for group, group_sides, group_rings in zip(whole, sides_of, rings_of, strict=True):
            own = np.flatnonzero(group_sides == k)
            for some in _chunks(group_rings[own]):
                tubes.add(flora, _rings_of(flora, group.take(own[some])), int(k))
    return tubes.buffers()


def _chunks(rings: NDArray[np.int64]) -> Iterator[slice]:
    return chunks(rings, _RINGS_AT_ONCE)


@dataclass(frozen=True)
class _Rings:
    """Places on branches (k) around which there are rings of vertices.

    Attributes
    ----------
    branches : Branches of k
    lines : Axes of k
    branch : (r,) int64
        Rings of a branch follow one another.
    t : (r,) float64
    centre : (r, 3) float64
    goes_on : (r,) bool
        Whether a tube leads from a ring to the next.
    later : (r, 3) float64 or None
        Centres a moment later, where it is asked how plants move.
    """

    branches: Branches
    lines: Axes
    branch: NDArray[np.int64]
    t: NDArray[np.float64]
    centre: NDArray[np.float64]
    goes_on: NDArray[np.bool_]
    later: NDArray[np.float64] | None = None


def _rings_of(flora: Flora, whole: WholeBranches) -> _Rings:
    owner, t, centre = whole.knots(flora.rows)
    goes_on = np.zeros(len(owner), bool)
    goes_on[:-1] = owner[1:] == owner[:-1]
    later = None
    if whole.lines.later is not None:
        later = WholeBranches(whole.branches, whole.lines.later).knots(flora.rows)[2]
    return _Rings(whole.branches, whole.lines, owner, t, centre, goes_on, later)


class _Tubes:
    """Tubes under construction: the arrays of the whole mesh, and how far they are filled.

    Parameters
    ----------
    vertices, faces : int
        How many there will be; there are as many edges as both together.
    moving : bool
        Whether vertices have velocities.
    """

    def __init__(self, vertices: int, faces: int, moving: bool = False) -> None:
        self.vertices = self.edges = self.faces = 0
        self.positions = np.zeros((vertices, 3), np.float32)
        self.velocity = np.zeros_like(self.positions) if moving else None
        self.edge_verts = np.zeros((vertices + faces, 2), np.int32)
        self.corner_verts, self.corner_edges = np.zeros((2, faces, 4), np.int32)
        self.uv = np.zeros((faces, 8), np.float32)
        self.colour = np.zeros((faces, 3), np.float32)
        self.girth = np.zeros(faces, np.float32)

    def buffers(self) -> MeshBuffers:
        """The mesh."""
        faces = len(self.corner_verts)
        motion = {} if self.velocity is None else {"velocity": ("POINT", self.velocity)}
        return MeshBuffers(
            positions=self.positions,
            edge_verts=self.edge_verts,
            corner_verts=self.corner_verts.reshape(-1),
            corner_edges=self.corner_edges.reshape(-1),
            face_offsets=np.arange(0, 4 * faces + 1, 4, dtype=np.int32),
            attributes={
                "UVMap": ("CORNER", self.uv.reshape(-1, 2)),
                "tf_colour": ("FACE", self.colour),
                "tf_transmission": ("FACE", np.zeros(faces, np.float32)),
                "tf_girth": ("FACE", self.girth),
                **motion,
            },
            smooth=True,
        )

    def add(self, flora: Flora, rings: _Rings, sides: int) -> None:
        """Tubes of one number of sides."""
        branches, number = rings.branches, len(rings.t)
        lower = np.flatnonzero(rings.goes_on)
        across = _ring_axes(rings.lines, rings.branch, rings.t)
        radius = radius_at(flora.rows, _without_places(branches, rings.branch), rings.t)
        reach = radius.astype(np.float32) * across
        self._add_shape(self.positions, rings.centre.T.astype(np.float32), reach, sides)
        if rings.later is not None:
            seconds = moment(flora.rows)
            away = radius.astype(np.float32) * _ring_axes(rings.lines.later, rings.branch, rings.t)
            centre = ((rings.later - rings.centre) / seconds).T.astype(np.float32)
            self._add_shape(self.velocity, centre, (away - reach) / np.float32(seconds), sides)
        self._add_topology(lower.astype(np.int32), number, sides)
        # v counts lengths of the perimeter at the branch's base, so that a texture is as wide as it is high.
        girth = base_girth(branches)
        v = rings.t * np.take(branches.length / np.maximum(girth, 1e-9), rings.branch)
        colour = branch_colours(flora.rows, branches.row, branches.key).astype(np.float32)
        colour = np.ascontiguousarray(colour)[np.take(rings.branch, lower)]
        self._add_looks(v[lower], v[lower + 1], colour, sides)
        every = slice(self.faces, self.faces + len(lower) * sides)
        self.girth[every] = np.repeat(np.take(girth, np.take(rings.branch, lower)), sides)
        self.vertices += number * sides
        self.edges += (number + len(lower)) * sides
        self.faces += len(lower) * sides

    def _add_shape(
        self, out: NDArray[np.float32], centre: NDArray[np.float32], reach: NDArray[np.float32], sides: int
    ) -> None:
        """Vertices around centres (3, rings), along both axes (2, 3, rings) of each ring; or, as well, velocities."""
        rings = centre.shape[1]
        angle = 2 * np.pi * np.arange(sides) / sides
        points = np.zeros((sides, 3, rings), np.float32)
        for point, x, y in zip(points, np.cos(angle), np.sin(angle), strict=True):  # over a tube's few sides
            np.multiply(reach[0], np.float32(x), out=point)
            point += reach[1] * np.float32(y)
            point += centre
        new = out[self.vertices : self.vertices + rings * sides]
        new.reshape(rings, -1)[...] = points.reshape(-1, rings).T

    def _add_topology(self, base: NDArray[np.int32], rings: int, sides: int) -> None:
        """Edges around all rings, then edges from those where pieces start (p,) to the next; faces between."""
        here = np.arange(sides, dtype=np.int32)
        there = np.roll(here, -1)
        lower = np.int32(self.vertices) + base * np.int32(sides)
        ring_edge = np.int32(self.edges) + base * np.int32(sides)
        long_edge = np.int32(self.edges + rings * sides) + np.arange(0, len(base) * sides, sides, dtype=np.int32)

        new = self.edge_verts[self.edges : self.edges + (rings + len(base)) * sides].reshape(-1, 2 * sides)
        first = np.arange(self.vertices, self.vertices + rings * sides, sides, dtype=np.int32)
        np.add(first[:, None], _interleaved(here, there), out=new[:rings])
        np.add(lower[:, None], _interleaved(here, here + sides), out=new[rings:])
        faces = slice(self.faces, self.faces + len(base) * sides)
        new = self.corner_verts[faces].reshape(len(base), -1)
        np.add(lower[:, None], _interleaved(here, there, there + sides, here + sides), out=new)
        new = self.corner_edges[faces].reshape(len(base), -1)
        np.add(ring_edge[:, None], _interleaved(here, here + sides), out=new[:, ::2])
        np.add(long_edge[:, None], _interleaved(there, here), out=new[:, 1::2])

    def _add_looks(self, low: NDArray, high: NDArray, colour: NDArray[np.float32], sides: int) -> None:
        """Texture coordinates between the v (p,) at both ends of pieces, their colours (p, 3)."""
        number = len(low) * sides
        new = self.uv[self.faces : self.faces + number].reshape(len(low), -1)
        u0, u1, zero = np.arange(sides) / sides, np.arange(1, sides + 1) / sides, np.zeros(sides)
        u = _interleaved(u0, zero, u1, zero, u1, zero, u0, zero).astype(np.float32)
        weights = np.array([[0, 1, 0, 1, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1, 0, 1]], np.float32)
        at_low, at_high = np.tile(weights, sides)
        np.multiply(low.astype(np.float32)[:, None], at_low, out=new)
        new += high.astype(np.float32)[:, None] * at_high
        new += u
        self.colour[self.faces : self.faces + number] = np.repeat(colour, sides, axis=0)


def base_girth(branches: Branches) -> NDArray[np.float64]:
    """Length (n,) around branches at their base, without flare, metres: what v counts."""
    return 2 * np.pi * branches.radius


def _interleaved(*columns: NDArray) -> NDArray:
    """First of each, then second of each, and so on."""
    return np.stack(columns, axis=1).reshape(-1)


def _without_places(branches: Branches, index: NDArray[np.int64]) -> Branches:
    """Selection of all that numbers and radii depend on; places and frames, which are most of the memory, are zero."""
    n = len(index)
    names = ("row", "plant", "key", "length", "radius", "scale", "vigour", "outward")
    rest = {name: np.take(getattr(branches, name), index) for name in names}
    return Branches(position=np.broadcast_to(0.0, (n, 3)), frame=np.broadcast_to(0.0, (n, 3, 3)), **rest)


def _ring_axes(lines: Axes, branch: NDArray[np.int64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Both axes (2, 3, n) across a branch at rings; at a joint, half way between those of the two segments."""
    frames = lines.frames[:, :, :, :2].astype(np.float32)
    number = np.take(lines.segments, branch)
    along = t * number
    joint = np.rint(along).astype(np.int64)
    at_joint = np.flatnonzero((np.abs(along - joint) < _AT_JOINT) & (joint > 0) & (joint < number))
    segment = np.minimum(along.astype(np.int64), number - 1)
    segment[at_joint] = joint[at_joint]
    light = Axes(lines.knots, frames, lines.segments)
    out = light.frame(branch, segment).transpose(2, 1, 0)
    if len(at_joint):
        before = light.frame(branch[at_joint], joint[at_joint] - 1)
        for axis in range(2):
            out[axis][:, at_joint] = unit(before[:, :, axis] + out[axis][:, at_joint].T).T
    return out
