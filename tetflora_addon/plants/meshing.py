# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of plants: tubes for branches, placed copies of the leaf model for leaves (paper, section 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..buffers import MeshBuffers
from .compiled import Flora
from .foliage import branch_colours, face_light, leaf_colours, leaf_keys, leaf_places, place_leaves
from .growth import Axes, Branches, axes, leaf_counts, radius_at, spread
from .leaf_models import LeafModel
from .pieces import Pieces
from .vectors import columns, unit

_SKY = np.array([0.0, 0.0, 1.0])
_SAME_T = 1e-9  # fractions of a branch closer than this are one place


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


def _distinct(pieces: Pieces) -> tuple[Pieces, Branches, NDArray[np.int64]]:
    """Pieces sorted along their branches, the distinct branches, and the index of the branch of each piece."""
    # The plant belongs to the order: plants of one seed (copies in the scene) have the same keys at different places.
    pieces = pieces.take(np.lexsort([pieces.t0, pieces.branches.key, pieces.branches.plant]))
    key, plant = pieces.branches.key, pieces.branches.plant
    first = np.concatenate([[True], (key[1:] != key[:-1]) | (plant[1:] != plant[:-1])])
    return pieces, pieces.branches.take(first), np.cumsum(first) - 1


def tube_buffers(flora: Flora, pieces: Pieces) -> MeshBuffers | None:
    """Tubes of pieces of branches; pieces that touch share a ring.

    Parameters
    ----------
    flora : Flora
    pieces : Pieces of n
        Any rows; no two may overlap.

    Returns
    -------
    MeshBuffers or None
        Quads with ``UVMap``, ``tf_colour`` and ``tf_transmission``; None without pieces.
    """
    if len(pieces) == 0:
        return None
    sides = flora.rows["sides"][pieces.branches.row]
    return concatenate_buffers([_tubes(flora, pieces.take(sides == k), int(k)) for k in np.unique(sides)])


def _tubes(flora: Flora, pieces: Pieces, sides: int) -> MeshBuffers:
    pieces, branches, branch = _distinct(pieces)
    lines = axes(flora.rows, branches)
    apart = np.abs(pieces.t0[1:] - pieces.t1[:-1]) > _SAME_T
    last = np.concatenate([(branch[1:] != branch[:-1]) | apart, [True]])
    # One ring at the start of each piece, and one more at the end of each run of pieces.
    ring_piece = np.repeat(np.arange(len(pieces)), 1 + last)
    closing = np.zeros(len(ring_piece), dtype=bool)
    closing[np.cumsum(1 + last) - 1] = last
    t = np.where(closing, pieces.t1[ring_piece], pieces.t0[ring_piece])
    owner = branch[ring_piece]
    centre, frame = _ring_frames(lines, owner, t)
    radius = radius_at(flora.rows, branches.take(owner), t)

    angle = 2 * np.pi * np.arange(sides) / sides
    cos, sin = (f(angle).astype(np.float32) for f in (np.cos, np.sin))
    reach = (radius[:, None, None] * frame[:, :, :2]).astype(np.float32)
    positions = np.zeros((len(t), sides, 3), np.float32)
    for axis in range(3):
        positions[:, :, axis] = reach[:, axis, :1] * cos + reach[:, axis, 1:] * sin
        positions[:, :, axis] += centre[:, axis, None].astype(np.float32)

    rings = len(t)
    base = np.flatnonzero(~closing).astype(np.int32)  # the ring that each piece starts with
    here, there = np.arange(sides, dtype=np.int32), (np.arange(1, sides + 1, dtype=np.int32)) % sides
    lower, upper = base[:, None] * sides, (base[:, None] + 1) * sides
    corner_verts = np.stack([lower + here, lower + there, upper + there, upper + here], axis=2)
    ring_edges = np.arange(rings, dtype=np.int32)[:, None] * sides
    long_edges = rings * sides + np.arange(len(base), dtype=np.int32)[:, None] * sides
    corner_edges = np.stack([lower + here, long_edges + there, upper + here, long_edges + here], axis=2)
    edge_verts = np.concatenate(
        [
            np.stack([ring_edges + here, ring_edges + there], axis=2).reshape(-1, 2),
            np.stack([lower + here, upper + here], axis=2).reshape(-1, 2),
        ]
    )
    # v counts lengths of the perimeter at the branch's base, so that a texture is as wide as it is high.
    v = t * branches.length[owner] / np.maximum(2 * np.pi * branches.radius[owner], 1e-9)
    low_v, high_v = (np.broadcast_to(v[base + k][:, None], (len(base), sides)) for k in (0, 1))
    u0, u1 = (np.broadcast_to((np.arange(sides) + k) / sides, (len(base), sides)) for k in (0, 1))
    uv = np.stack([np.stack(c, axis=2) for c in ((u0, low_v), (u1, low_v), (u1, high_v), (u0, high_v))], axis=2)
    faces = len(base) * sides
    colour = branch_colours(flora.rows, branches.row, branches.key)[owner[base]].astype(np.float32)
    return MeshBuffers(
        positions=positions.reshape(-1, 3),
        edge_verts=edge_verts,
        corner_verts=corner_verts.reshape(-1),
        corner_edges=corner_edges.reshape(-1),
        face_offsets=np.arange(faces + 1, dtype=np.int32) * np.int32(4),
        attributes={
            "UVMap": ("CORNER", uv.reshape(-1, 2).astype(np.float32)),
            "tf_colour": ("FACE", np.repeat(colour, sides, axis=0)),
            "tf_transmission": ("FACE", np.zeros(faces, np.float32)),
        },
        smooth=True,
    )


def _ring_frames(lines: Axes, branch: NDArray[np.int64], t: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Centres and frames of rings; at a joint the ring lies half way between the two segments."""
    centre, frame = lines.at(branch, t)
    along = t * lines.segments[branch]
    joint = np.rint(along).astype(np.int64)
    at_joint = (np.abs(along - joint) < _SAME_T * 1e3) & (joint > 0) & (joint < lines.segments[branch])
    if at_joint.any():
        b, j = branch[at_joint], joint[at_joint]
        centre[at_joint] = lines.knot(b, j)
        mean = lines.frame(b, j - 1) + lines.frame(b, j)
        frame[at_joint] = columns(*(unit(mean[:, :, k]) for k in range(3)))
    return centre, frame


def leaf_buffers(flora: Flora, pieces: Pieces, species: int) -> MeshBuffers | None:
    """Copies of the leaf model for the leaves on pieces of branches of one species.

    Returns
    -------
    MeshBuffers or None
        Faces with ``UVMap``, ``tf_colour`` and ``tf_transmission``; None where there are no leaves.
    """
    bearing = flora.rows["leaves"][pieces.branches.row].sum(axis=1) > 0
    if not bearing.any():
        return None
    pieces, branches, branch = _distinct(pieces.take(bearing))
    counts = leaf_counts(flora.rows, branches)
    of_piece, index = spread(counts[branch])
    owner = branch[of_piece]
    key = leaf_keys(branches, owner, index)
    t = leaf_places(flora.rows, branches, owner, index, counts, key)
    # A leaf belongs to the piece that holds its base; the tip of the branch belongs to the last piece.
    inside = (t >= pieces.t0[of_piece]) & ((t < pieces.t1[of_piece]) | (pieces.t1[of_piece] >= 1))
    owner, index, key, t = (a[inside] for a in (owner, index, key, t))
    if len(t) == 0:
        return None
    leaves = place_leaves(flora.rows, branches, axes(flora.rows, branches), owner, index, key, t)
    row = branches.row[owner]
    frame = face_light(leaves.frame, flora.rows["leaf_light"][row], _SKY)
    colour = leaf_colours(flora.rows, row, key).astype(np.float32)
    return _copies(
        flora.leaf_models[species], leaves.position, frame, leaves.size, colour, float(flora.transmission[row[0]])
    )


def _copies(
    model: LeafModel, position: NDArray, frame: NDArray, size: NDArray, colour: NDArray, transmission: float
) -> MeshBuffers:
    n, v, f = len(size), len(model.positions), model.polygons
    scaled = (frame * size[:, None, None]).astype(np.float32)
    points = np.zeros((n, v, 3), np.float32)
    shape = model.positions.astype(np.float32)
    for axis in range(3):
        offset = scaled[:, axis, :1] * shape[:, 0]
        offset += scaled[:, axis, 1:2] * shape[:, 1]
        offset += scaled[:, axis, 2:] * shape[:, 2]
        points[:, :, axis] = offset + position[:, axis, None].astype(np.float32)
    edges, edge_of_corner = model.edges
    copy = np.arange(n, dtype=np.int32)[:, None]
    corners = len(model.corner_verts)
    return MeshBuffers(
        positions=points.reshape(-1, 3),
        edge_verts=(edges[None] + copy[:, :, None] * np.int32(v)).reshape(-1, 2),
        corner_verts=(model.corner_verts[None] + copy * np.int32(v)).reshape(-1),
        corner_edges=(edge_of_corner[None] + copy * np.int32(len(edges))).reshape(-1),
        face_offsets=np.append(
            (model.face_offsets[None, :-1] + copy * np.int32(corners)).reshape(-1), np.int32(n * corners)
        ),
        attributes={
            "UVMap": ("CORNER", np.tile(model.uv, (n, 1))),
            "tf_colour": ("FACE", np.repeat(colour, f, axis=0)),
            "tf_transmission": ("FACE", np.full(n * f, transmission, np.float32)),
        },
    )
