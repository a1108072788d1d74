# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves as polygons: copies of the species' leaf models, written straight into the arrays of their mesh.

See section 5 of the paper.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..arrays import spread
from ..buffers import MeshBuffers
from ..compiled.flora import Flora
from ..growth.branches import Branches
from ..growth.foliage import (
    in_wind,
    leaf_colours,
    leaf_forms,
    leaf_keys,
    leaf_places,
    outwardness,
    place_leaves,
    settled,
)
from ..growth.growth import WholeBranches, leaf_counts
from ..growth.hashing import Draw, uniform
from ..growth.wind import moment
from ..species.leaf_models import LeafModel
from .pieces import chunks

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


#: Vertices of leaves that are worked on at a time: some ten megabytes.
_VERTICES_AT_ONCE = 120_000


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


def leaf_meshes(
    flora: Flora,
    species: int,
    whole: Sequence[WholeBranches],
    fraction_of: Callable[[Branches], NDArray[np.float64]] | None = None,
) -> Iterator[LeafMesh]:
    """Copies of the leaf models for the leaves on branches of one species, form by form.

    Parameters
    ----------
    flora : Flora
    species : int
        Index into the flora's species.
    whole : sequence of WholeBranches
    fraction_of : callable, optional
        Fraction (n,) of the leaves of branches that are wanted; the leaves' own random numbers decide which.
    """
    groups = [group for some in whole for group in _bearers(flora, some)]
    if fraction_of is not None:
        for group in groups:
            group.fraction = fraction_of(group.whole.branches)
    for kind in sorted({group.kind for group in groups}):
        own = [group for group in groups if group.kind == kind]
        forms = flora.forms[species][kind]
        numbers = sum(group.numbers(len(forms)) for group in own)
        for form in np.flatnonzero(numbers):
            transmission = float(flora.leaf.transmission[own[0].row[0]])
            copies = LeafCopies(forms[form], int(numbers[form]), transmission, moment(flora.rows) > 0)
            for group in own:
                group.add(copies, int(form), len(forms))
            yield LeafMesh(kind, int(form), copies.buffers())


def _bearers(flora: Flora, whole: WholeBranches) -> Iterator[_Bearers]:
    """Those of branches that bear leaves, row by row."""
    order = np.argsort(whole.branches.row, kind="stable")
    order = order[flora.rows["leaves"][whole.branches.row[order]].sum(axis=1) > 0]
    for row, own in _by_row(whole.branches.row[order]):
        yield _Bearers(flora, row, whole.take(order[own]))


def _by_row(rows: NDArray[np.integer]) -> Iterator[tuple[int, slice]]:
    """Runs of equal numbers in a sorted array."""
    cuts = [0, *(np.flatnonzero(np.diff(rows)) + 1), len(rows)]
    for start, stop in pairwise(cuts):
        if stop > start:
            yield int(rows[start]), slice(int(start), int(stop))


class _Bearers:
    """Branches of one row, and which of their leaves are wanted.

    Parameters
    ----------
    flora : Flora
    row : int
    whole : WholeBranches of n
    """

    def __init__(self, flora: Flora, row: int, whole: WholeBranches) -> None:
        self.flora, self.whole, self.counts = flora, whole, leaf_counts(flora.rows, whole.branches)
        self.fraction: NDArray[np.float64] | None = None
        self.row = np.array([row])
        self.kind = int(flora.rows["leaf_kind"][row])

    def numbers(self, forms: int) -> NDArray[np.int64]:
        """How many leaves there are of each form."""
        if forms == 1 and self.fraction is None:
            return np.array([self.counts.sum()])
        out = np.zeros(forms, np.int64)
        for part in self._chunks(1):
            key = self._leaves(part)[2]
            out += np.bincount(leaf_forms(forms, key), minlength=forms)
        return out

    def add(self, copies: LeafCopies, form: int, forms: int) -> None:
        """Place all leaves of one of the forms."""
        rows = self.flora.rows
        for part in self._chunks(len(copies.model.positions)):
            bearers = self.whole.take(part)
            owner, index, key = self._leaves(part)
            if forms > 1:
                chosen = np.flatnonzero(leaf_forms(forms, key) == form)
                owner, index, key = owner[chosen], index[chosen], key[chosen]
            t = leaf_places(rows, bearers.branches, owner, index, self.counts[part], key)
            leaves = place_leaves(rows, bearers.branches, bearers.lines, owner, index, key, t)
            frame = in_wind(
                rows, bearers.branches, leaves, settled(rows, self.row, leaves.frame, leaves.light, leaves.sky)
            )
            gradient = rows["gradient"][self.row[0]]
            outward = outwardness(rows, bearers.branches, owner, t) if gradient else None
            motion = None
            if bearers.lines.later is not None:
                branches, seconds = bearers.branches.moved(), moment(rows)
                again = place_leaves(rows, branches, bearers.lines.later, owner, index, key, t)
                turned = settled(rows, self.row, again.frame, again.light, again.sky)
                turned = in_wind(rows, branches, again, turned, seconds)
                motion = (again.position - leaves.position) / seconds, (turned - frame) / np.float32(seconds)
            copies.add(leaves.position, frame, leaves.size, leaf_colours(rows, self.row, key, outward), motion)

    def _chunks(self, vertices: int) -> Iterator[slice]:
        """Runs of branches, for leaves of a number of vertices."""
        for run in chunks(self.counts * vertices, _VERTICES_AT_ONCE):
            if self.counts[run].any():
                yield run

    def _leaves(self, part: slice) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint64]]:
        """Branch within the run, number on it, and key of each wanted leaf."""
        owner, index = spread(self.counts[part])
        key = leaf_keys(self.whole.branches.take(part), owner, index)
        if self.fraction is None or (self.fraction[part] >= 1.0).all():
            return owner, index, key
        kept = np.flatnonzero(uniform(key, Draw.TRANSITION) < np.take(self.fraction[part], owner))
        return owner[kept], index[kept], key[kept]
