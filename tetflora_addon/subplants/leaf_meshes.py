# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves as polygons: copies of the species' leaf models, written straight into the arrays of their mesh.

See section 5 of the paper. What is small in the image may be a triangle, see `species.leaf_triangles`.
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
from ..species.leaf_triangles import leaf_triangles
from .leaf_copies import LeafCopies, TriangleCopies
from .pieces import chunks

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
    fractions_of: Callable[[Branches], tuple[NDArray[np.float64], NDArray[np.float64]]] | None = None,
) -> Iterator[LeafMesh]:
    """Copies of the leaf models for the leaves on branches of one species, form by form.

    Parameters
    ----------
    flora : Flora
    species : int
        Index into the flora's species.
    whole : sequence of WholeBranches
    fractions_of : callable, optional
        Fractions (n,), (n,) of the leaves of branches that are wanted, and of these that are triangles; the leaves' own
        random numbers decide which.
    """
    groups = [group for some in whole for group in _bearers(flora, some)]
    if fractions_of is not None:
        groups = [part for group in groups for part in group.parts(*fractions_of(group.whole.branches))]
    for kind, small in sorted({(group.kind, group.small) for group in groups}):
        own = [group for group in groups if (group.kind, group.small) == (kind, small)]
        forms = flora.forms[species][kind]
        numbers = sum(group.numbers(len(forms)) for group in own)
        for form in np.flatnonzero(numbers):
            given = int(numbers[form]), float(flora.leaf.transmission[own[0].row[0]]), moment(flora.rows) > 0
            model = forms[form]
            triangles = small and not model.textured
            copies = TriangleCopies(leaf_triangles(model), *given) if triangles else LeafCopies(model, *given)
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
    small : bool
        The leaves that are wanted here are triangles.
    fraction, triangles : (n,) float64, optional
        Fraction of the leaves that is wanted at all, and of these as triangles.
    """

    def __init__(
        self,
        flora: Flora,
        row: int,
        whole: WholeBranches,
        small: bool = False,
        fraction: NDArray[np.float64] | None = None,
        triangles: NDArray[np.float64] | None = None,
    ) -> None:
        self.flora, self.whole, self.counts = flora, whole, leaf_counts(flora.rows, whole.branches)
        self.small, self.fraction, self.triangles = small, fraction, triangles
        self.row = np.array([row])
        self.kind = int(flora.rows["leaf_kind"][row])

    def parts(self, fraction: NDArray[np.float64], triangles: NDArray[np.float64]) -> Iterator[_Bearers]:
        """The branches some of whose leaves are wanted as they are, and those with leaves as triangles."""
        for small, share in ((False, 1.0 - triangles), (True, triangles)):
            own = np.flatnonzero((fraction > 0.0) & (share > 0.0))
            if len(own):
                given = fraction[own], triangles[own]
                yield _Bearers(self.flora, int(self.row[0]), self.whole.take(own), small, *given)

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
            colours = leaf_colours(rows, self.row, key, outward)
            copies.add(key, leaves.position, frame, leaves.size, colours, motion)

    def _chunks(self, vertices: int) -> Iterator[slice]:
        """Runs of branches, for leaves of a number of vertices."""
        for run in chunks(self.counts * vertices, _VERTICES_AT_ONCE):
            if self.counts[run].any():
                yield run

    def _leaves(self, part: slice) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint64]]:
        """Branch within the run, number on it, and key of each wanted leaf."""
        owner, index = spread(self.counts[part])
        key = leaf_keys(self.whole.branches.take(part), owner, index)
        if self.fraction is None:
            return owner, index, key
        wanted, triangles = self.fraction[part], self.triangles[part]
        kept = np.ones(len(key), bool)
        if (wanted < 1.0).any():
            kept &= uniform(key, Draw.TRANSITION) < wanted[owner]
        if (triangles < 1.0).any() if self.small else (triangles > 0.0).any():
            kept &= (uniform(key, Draw.LEAF_TRIANGLE) < triangles[owner]) == self.small
        kept = np.flatnonzero(kept)
        return owner[kept], index[kept], key[kept]
