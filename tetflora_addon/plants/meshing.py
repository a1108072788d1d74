# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of plants: tubes for branches, placed copies of the leaf model for leaves (paper, section 5)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..buffers import MeshBuffers
from .compiled import Flora
from .copies import Copies
from .foliage import (
    Leaves,
    branch_colours,
    leaf_colours,
    leaf_forms,
    leaf_keys,
    leaf_places,
    leaf_range,
    outwardness,
    place_leaves,
    settled,
)
from .growth import Axes, Branches, axes, leaf_counts, radius_at, spread
from .leaf_models import LeafModel
from .pieces import Pieces, along_branches
from .vectors import gathered, unit

_SKY = np.array([0.0, 0.0, 1.0])
_AT_JOINT = 1e-6  # fractions of a segment closer to a joint than this are at it
#: Vertices of leaves, and rings of tubes, that are worked on at a time: some ten megabytes.
_VERTICES_AT_ONCE = 120_000
_RINGS_AT_ONCE = 48_000


def concatenate_buffers(parts: Sequence[MeshBuffers]) -> MeshBuffers | None:
    """Several meshes as one; they carry the same attributes. None where there are none."""
    parts = [p for p in parts if p.polygons]
    if len(parts) < 2:
        return parts[0] if parts else None

    def joined(name: str, offset_by: str) -> NDArray[np.int32]:
        sizes = np.cumsum([0] + [len(getattr(p, offset_by)) for p in parts[:-1]])
        return np.concatenate([getattr(p, name) + np.int32(s) for p, s in zip(parts, sizes, strict=True)])

    corners = np.cumsum([0] + [len(p.corner_verts) for p in parts]).astype(np.int32)
    starts = [p.face_offsets[:-1] + c for p, c in zip(parts, corners[:-1], strict=True)]
    return MeshBuffers(
        positions=np.concatenate([p.positions for p in parts]),
        edge_verts=joined("edge_verts", "positions"),
        corner_verts=joined("corner_verts", "positions"),
        corner_edges=joined("corner_edges", "edge_verts"),
        face_offsets=np.concatenate([*starts, corners[-1:]]),
        attributes={
            name: (domain, np.concatenate([p.attributes[name][1] for p in parts]))
            for name, (domain, _) in parts[0].attributes.items()
        },
        smooth=parts[0].smooth,
    )


def tube_buffers(flora: Flora, pieces: Pieces) -> MeshBuffers | None:
    """Tubes of pieces of branches; pieces that touch share a ring.

    Parameters
    ----------
    flora : Flora
    pieces : Pieces of n
        Any rows; no two may overlap. Those without length are passed over.

    Returns
    -------
    MeshBuffers or None
        Quads with ``UVMap``, ``tf_colour`` and ``tf_transmission``; None without pieces.
    """
    pieces = along_branches(pieces.take(pieces.t1 > pieces.t0))
    if len(pieces) == 0:
        return None
    first, last = pieces.runs()
    sides = flora.rows["sides"][pieces.branches.row[first]]
    # One ring at the start of each piece, and one more at the end of each run of pieces.
    rings = last - first + 2
    tubes = _Tubes(int((sides * rings).sum()), int((sides * (rings - 1)).sum()))
    for k in np.unique(sides):
        runs = np.flatnonzero(sides == k)
        ends = np.cumsum(rings[runs])
        for chunk in np.split(runs, np.searchsorted(ends, np.arange(_RINGS_AT_ONCE, ends[-1], _RINGS_AT_ONCE))):
            if len(chunk):
                tubes.add(flora, pieces, first[chunk], last[chunk], int(k))
    return tubes.buffers()


class _Tubes:
    """Tubes under construction: the arrays of the whole mesh, and how far they are filled.

    Parameters
    ----------
    vertices, faces : int
        How many there will be; there are as many edges as both together.
    """

    def __init__(self, vertices: int, faces: int) -> None:
        self.vertices = self.edges = self.faces = 0
        self.positions = np.zeros((vertices, 3), np.float32)
        self.edge_verts = np.zeros((vertices + faces, 2), np.int32)
        self.corner_verts, self.corner_edges = np.zeros((2, faces, 4), np.int32)
        self.uv = np.zeros((faces, 8), np.float32)
        self.colour = np.zeros((faces, 3), np.float32)

    def buffers(self) -> MeshBuffers:
        """The mesh."""
        faces = len(self.corner_verts)
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
            },
            smooth=True,
        )

    def add(self, flora: Flora, pieces: Pieces, first: NDArray[np.int64], last: NDArray[np.int64], sides: int) -> None:
        """Tubes of one number of sides along runs of pieces, from their first to their last."""
        number = last - first + 1
        owner, step = spread(number)
        piece = np.take(first, owner) + step
        branches = pieces.branches.take(first)
        # Rings: those of the pieces' starts, and between them those that close each run.
        base = np.arange(len(piece)) + owner
        closing = np.cumsum(number + 1) - 1
        t, of_branch, of_piece = (np.zeros(len(piece) + len(first), kind) for kind in (float, int, int))
        t[base], t[closing] = np.take(pieces.t0, piece), np.take(pieces.t1, last)
        of_branch[base], of_branch[closing] = owner, np.arange(len(first))
        of_piece[base], of_piece[closing] = piece, last
        centre = gathered(pieces.start, of_piece).T
        centre[:, closing] = gathered(pieces.end, last).T
        across = _ring_axes(axes(flora.rows, branches), of_branch, t)
        radius = radius_at(flora.rows, _without_places(branches, of_branch), t)
        self._add_shape(centre.astype(np.float32), (radius * across).astype(np.float32), sides)
        self._add_topology(base.astype(np.int32), len(t), sides)
        # v counts lengths of the perimeter at the branch's base, so that a texture is as wide as it is high.
        v = t * np.take(branches.length / np.maximum(2 * np.pi * branches.radius, 1e-9), of_branch)
        colour = branch_colours(flora.rows, branches.row, branches.key).astype(np.float32)
        self._add_looks(v[base], v[base + 1], np.ascontiguousarray(colour)[owner], sides)
        self.vertices += len(t) * sides
        self.edges += (len(t) + len(piece)) * sides
        self.faces += len(piece) * sides

    def _add_shape(self, centre: NDArray[np.float32], reach: NDArray[np.float32], sides: int) -> None:
        """Vertices around centres (3, rings), along both axes (2, 3, rings) of each ring."""
        rings = centre.shape[1]
        angle = 2 * np.pi * np.arange(sides) / sides
        points = np.zeros((sides, 3, rings), np.float32)
        for point, x, y in zip(points, np.cos(angle), np.sin(angle), strict=True):  # over a tube's few sides
            np.multiply(reach[0], np.float32(x), out=point)
            point += reach[1] * np.float32(y)
            point += centre
        new = self.positions[self.vertices : self.vertices + rings * sides]
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


@dataclass(frozen=True)
class LeafMesh:
    """Copies of one form of leaf.

    Attributes
    ----------
    kind : int
        Index into `species.LEAF_KINDS`.
    form : int
        Which of the species' forms of that kind.
    buffers : MeshBuffers
        Faces with ``UVMap``, ``tf_colour`` and ``tf_transmission``.
    """

    kind: int
    form: int
    buffers: MeshBuffers


def leaf_meshes(flora: Flora, pieces: Pieces, species: int) -> Iterator[LeafMesh]:
    """Copies of the leaf models for the leaves on pieces of branches of one species, form by form.

    A leaf belongs to the piece that holds its base; the tip of the branch belongs to the last piece.
    """
    first, last = pieces.runs()
    row = np.take(pieces.branches.row, first)
    # Row after row, so that parameters are the same for all leaves that are worked on at a time.
    order = np.argsort(row, kind="stable")
    order = order[flora.rows["leaves"][row[order]].sum(axis=1) > 0]
    first, last = first[order], last[order]
    branches = pieces.branches.take(first)
    counts = leaf_counts(flora.rows, branches)
    low, high = leaf_range(flora.rows, branches, counts, pieces.t0[first], pieces.t1[last])
    kinds = flora.rows["leaf_kind"][branches.row]
    for kind in np.unique(kinds[high > low]):
        own = np.flatnonzero(kinds == kind)
        bearers = _Bearers(flora, branches.take(own), counts[own], low[own], high[own])
        forms = flora.forms[species][kind]
        if len(forms) == 1:
            yield LeafMesh(int(kind), 0, bearers.copies(forms[0], int(bearers.number.sum())))
            continue
        numbers = np.zeros(len(forms), np.int64)
        for part in bearers.chunks(1):
            owner, index = bearers.leaves(part)
            key = leaf_keys(bearers.branches.take(part), owner, index)
            numbers += np.bincount(leaf_forms(len(forms), key), minlength=len(forms))
        for form in np.flatnonzero(numbers):
            yield LeafMesh(int(kind), int(form), bearers.copies(forms[form], int(numbers[form]), int(form)))


class _Bearers:
    """Branches of one species whose leaves are of one kind, row after row, and which of their leaves are wanted."""

    def __init__(self, flora: Flora, branches: Branches, counts: NDArray, low: NDArray, high: NDArray) -> None:
        self.flora, self.branches, self.counts, self.low = flora, branches, counts, low
        self.number = high - low

    def chunks(self, vertices: int) -> Iterator[slice]:
        """Runs of branches of one row each, for leaves of a number of vertices."""
        ends = np.cumsum(self.number)
        limit = max(_VERTICES_AT_ONCE // vertices, 1)
        cuts = np.searchsorted(ends, np.arange(limit, ends[-1], limit))
        new_row = np.flatnonzero(np.diff(self.branches.row)) + 1
        for chunk in np.split(np.arange(len(ends)), np.union1d(cuts, new_row)):
            if self.number[chunk].sum():
                yield slice(int(chunk[0]), int(chunk[-1]) + 1)

    def leaves(self, part: slice) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Branch within the run, and number on it, of each wanted leaf."""
        owner, index = spread(self.number[part])
        index += np.take(self.low[part], owner)
        return owner, index

    def copies(self, model: LeafModel, number: int, form: int | None = None) -> MeshBuffers:
        """Mesh of all leaves, or of those of one form."""
        rows = self.flora.rows
        copies = Copies(model, number, float(self.flora.leaf.transmission[self.branches.row[0]]))
        forms = len(self.flora.forms[rows["species"][self.branches.row[0]]][rows["leaf_kind"][self.branches.row[0]]])
        for part in self.chunks(len(model.positions)):
            bearers = self.branches.take(part)
            owner, index = self.leaves(part)
            key = leaf_keys(bearers, owner, index)
            if form is not None:
                chosen = np.flatnonzero(leaf_forms(forms, key) == form)
                owner, index, key = owner[chosen], index[chosen], key[chosen]
            t = leaf_places(rows, bearers, owner, index, self.counts[part], key)
            leaves = place_leaves(rows, bearers, axes(rows, bearers), owner, index, key, t)
            self._add(copies, bearers, leaves, t)
        return copies.buffers()

    def _add(self, copies: Copies, bearers: Branches, leaves: Leaves, t: NDArray[np.float64]) -> None:
        rows, row = self.flora.rows, bearers.row[:1]
        frame = settled(rows, row, leaves.frame, leaves.light, _SKY)
        outward = outwardness(rows, bearers, leaves.branch, t) if rows["gradient"][row[0]] else None
        copies.add(leaves.position, frame, leaves.size, leaf_colours(rows, row, leaves.key, outward))
