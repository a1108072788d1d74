# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves as polygons: placed copies of the species' models (paper, section 5)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..arrays import spread
from ..buffers import MeshBuffers
from .axes import axes
from .branches import Branches
from .compiled import Flora
from .copies import LeafCopies
from .expansion import chunks
from .foliage import (
    in_wind,
    leaf_colours,
    leaf_forms,
    leaf_keys,
    leaf_places,
    leaf_range,
    outwardness,
    place_leaves,
    settled,
)
from .growth import leaf_counts
from .hashing import Draw, uniform
from .pieces import Pieces
from .stems import Stems
from .wind import moment

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
    pieces: Pieces,
    species: int,
    stems: Sequence[Stems] = (),
    share_of: Callable[[Branches], NDArray[np.float64]] | None = None,
) -> Iterator[LeafMesh]:
    """Copies of the leaf models for the leaves on branches of one species, form by form.

    Parameters
    ----------
    flora : Flora
    pieces : Pieces
        Parts of branches; a leaf belongs to the piece that holds its base, at the branch's tip to the last one.
    species : int
        Index into the flora's species.
    stems : sequence of Stems
        Whole branches.
    share_of : callable, optional
        Share (n,) of the leaves of branches that are wanted; numbers of the leaves' own say which.
    """
    groups = [*_of_pieces(flora, pieces), *(group for some in stems for group in _of_stems(flora, some))]
    if share_of is not None:
        for group in groups:
            group.share = share_of(group.stems.branches)
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


def _of_pieces(flora: Flora, pieces: Pieces) -> Iterator[_Bearers]:
    first, last = pieces.runs()
    row = np.take(pieces.branches.row, first)
    order = np.argsort(row, kind="stable")
    order = order[_bears(flora, row[order])]
    first, last = first[order], last[order]
    branches = pieces.branches.take(first)
    counts = leaf_counts(flora.rows, branches)
    low, high = leaf_range(flora.rows, branches, counts, pieces.t0[first], pieces.t1[last])
    for row, own in _by_row(branches.row):
        lines = axes(flora.rows, branches.take(own))
        yield _Bearers(flora, row, Stems(branches.take(own), lines), counts[own], low[own], (high - low)[own])


def _of_stems(flora: Flora, stems: Stems) -> Iterator[_Bearers]:
    order = np.argsort(stems.branches.row, kind="stable")
    order = order[_bears(flora, stems.branches.row[order])]
    for row, own in _by_row(stems.branches.row[order]):
        some = stems.take(order[own])
        counts = leaf_counts(flora.rows, some.branches)
        yield _Bearers(flora, row, some, counts, np.zeros_like(counts), counts)


def _bears(flora: Flora, row: NDArray[np.integer]) -> NDArray[np.bool_]:
    return flora.rows["leaves"][row].sum(axis=1) > 0


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
    stems : Stems of n
    counts, low, number : (n,) int64
        Leaves of each whole branch, the first one wanted and how many.
    """

    def __init__(
        self, flora: Flora, row: int, stems: Stems, counts: NDArray, low: NDArray, number: NDArray[np.int64]
    ) -> None:
        self.flora, self.stems, self.counts, self.low, self.number = flora, stems, counts, low, number
        self.share: NDArray[np.float64] | None = None
        self.row = np.array([row])
        self.kind = int(flora.rows["leaf_kind"][row])

    def numbers(self, forms: int) -> NDArray[np.int64]:
        """How many leaves there are of each form."""
        if forms == 1 and self.share is None:
            return np.array([self.number.sum()])
        out = np.zeros(forms, np.int64)
        for part in self._chunks(1):
            key = self._leaves(part)[2]
            out += np.bincount(leaf_forms(forms, key), minlength=forms)
        return out

    def add(self, copies: LeafCopies, form: int, forms: int) -> None:
        """Place all leaves of one of the forms."""
        rows = self.flora.rows
        for part in self._chunks(len(copies.model.positions)):
            bearers = self.stems.take(part)
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
        for run in chunks(self.number * vertices, _VERTICES_AT_ONCE):
            if self.number[run].any():
                yield run

    def _leaves(self, part: slice) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint64]]:
        """Branch within the run, number on it, and key of each wanted leaf."""
        owner, index = spread(self.number[part])
        index += np.take(self.low[part], owner)
        key = leaf_keys(self.stems.branches.take(part), owner, index)
        if self.share is None or (self.share[part] >= 1.0).all():
            return owner, index, key
        kept = np.flatnonzero(uniform(key, Draw.TRANSITION) < np.take(self.share[part], owner))
        return owner[kept], index[kept], key[kept]
