# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of what is refined, shared among tetrahedra by points on them: what plants and assets have in common.

A part that crosses planes stays whole. Points on it, which stand for equal fractions of its area, go down the tree,
and each tetrahedron holds the fraction whose points it holds. Only where a tetrahedron is divided that is not much
larger than a part is the part opened, see `shares` and `asset_parts`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import (
    Arrays,
    Chunks,
    Floats,
    Floats32,
    Growing,
    Integers,
    Integers32,
    Mask,
    column,
    renumber,
    rows_within,
)
from ..camera.camera import Camera
from ..parallel import blocks, each_on_all_cores
from ..tetrahedra.tree import TetrahedralTree
from .contents import InCells, Totals, sums

#: Parts larger than this many times the longest edge of a tetrahedron that is divided are opened.
LARGE = 1.6
#: Points that are lowered at a time; bounds what that takes.
DESCEND_BATCH = 200_000
#: Parts that have been opened are dropped once they are more than one in so many.
_OPENED = 3

Parts = TypeVar("Parts", bound=Arrays)


@dataclass(frozen=True)
class SharePoints(Arrays):
    """Points (m) on parts of plants; each stands for a fraction of its part's area."""

    part: Integers32 = column(dtype=np.int32)  # (m,)
    cell: Integers32 = column(dtype=np.int32)  # (m,): node of the tree that the point is in
    position: Floats32 = column(3, dtype=np.float32)  # (m, 3): meters, world space
    #: leaf and wood, (m,): area that it stands for, m²; one of the two is 0.
    leaf: Floats32 = column(dtype=np.float32)
    wood: Floats32 = column(dtype=np.float32)

    @property
    def optical_area(self) -> Floats32:
        """Area (m,) that can block light, m²."""
        return self.leaf + self.wood / 2


def descend(tree: TetrahedralTree, points: SharePoints, some: Integers | None = None) -> Integers32:
    """Terminal nodes (m,) that points are in, below those that they are known to be in.

    some: indices (k,) of points, by default all, of which alone they are wanted (k,).
    """
    cell, children = points.cell if some is None else points.cell[some], tree.children.reshape(-1)
    every = np.flatnonzero(np.take(children, 2 * cell) >= 0)
    cell = cell.copy()

    def lower(block: slice) -> None:
        moving = every[block]
        place = np.take(points.position, moving if some is None else some[moving], axis=0).astype(np.float64)
        while len(moving):
            at = np.take(cell, moving)
            plane = tree.planes(at)
            side = plane[:, 3] + np.einsum("ni,ni->n", plane[:, :3], place) >= 0.0
            at = np.take(children, 2 * at + side)
            cell[moving] = at
            left = np.flatnonzero(np.take(children, 2 * at) >= 0)
            if len(left) < len(moving):
                moving, place = moving[left], np.take(place, left, axis=0)

    each_on_all_cores(lower, blocks(len(every), DESCEND_BATCH))
    return cell


@dataclass(frozen=True)
class _Figures(Arrays):
    """What a pass asks of all parts (n): the extent of those that can be opened (meters, else 0), their totals."""

    reach: Floats
    area: Floats
    polygons: Floats
    width: Floats


class SharedParts(Generic[Parts]):
    """All parts of one kind, and the points on them; changes as the tree is divided.

    A pass costs what it changes. Parts that it opens are only marked, and new ones stay in chunks of their own, until
    somebody asks for `parts` or `points`; new points take the places of those on opened parts.

    Parts are `Arrays` with the columns ``totals`` and ``extent``, meters. Subclasses say what can be opened, into what,
    and which points are on it.

    Parameters
    ----------
    camera : Camera
    """

    def __init__(self, camera: Camera) -> None:
        self.camera = camera

    def can_open(self, parts: Parts) -> Mask:
        """Parts (n,) that consist of others."""
        raise NotImplementedError

    def opened(self, parts: Parts) -> Iterator[tuple[Parts, Integers, Any]]:
        """New parts, some at a time, with those (m,) that they come from, and what `points_on` wants to know."""
        raise NotImplementedError

    def points_on(self, parts: Parts, known: Any) -> SharePoints:
        """Points on parts (n,), all in the root; ``known`` is of `opened`, None at first."""
        raise NotImplementedError

    def branch_only(self, parts: Parts) -> Mask:
        """Parts (n,) that count apart from others, as branches without what grows on them."""
        raise NotImplementedError

    def hold(self, parts: Parts, points: SharePoints) -> None:
        """Begin with parts and the points on them."""
        self._parts, self._figures = Chunks(parts), Growing(self._figures_of(parts))
        self._points, self._alone = Growing(points), int(self.branch_only(parts).sum())

    def _figures_of(self, parts: Parts) -> _Figures:
        reach, totals = np.where(self.can_open(parts), parts.extent, 0.0), parts.totals
        return _Figures(reach, totals.area, totals.polygons, totals.width)

    @property
    def parts(self) -> Parts:
        """All parts, in one piece: asking costs a copy of them where a pass has opened some, and changes no result."""
        return self._drop_opened()

    @property
    def points(self) -> SharePoints:
        """All points, of `parts`; valid until the next pass."""
        self._drop_opened()
        return self._points.rows

    @property
    def numbers(self) -> tuple[int, int]:
        """How many parts there are that do not, and that do count apart."""
        return len(self._parts) - self._parts.marked - self._alone, self._alone

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays, with what waits to be dropped and room to spare."""
        return self._parts.nbytes + self._figures.nbytes + self._points.nbytes

    def update(self, tree: TetrahedralTree, dividing: Mask, edge: Floats) -> NDArray:
        """Hand points in divided nodes on, and open what is large there.

        Parameters
        ----------
        tree : TetrahedralTree
        dividing : (nodes,) bool
            Nodes that have been divided.
        edge : (nodes,) float64
            Their longest edge, meters.

        Returns
        -------
        (nodes,) bool
            Nodes whose contents have changed.
        """
        points = self._points.rows
        changed = dividing.copy()
        inside = rows_within(dividing, points.cell)
        part = np.take(points.part, inside)
        large = np.take(self._figures.rows.reach, part) > LARGE * np.take(edge, np.take(points.cell, inside))
        # Handed on in place: millions of points that stay where they are are not looked at.
        points.cell[inside] = cell = descend(tree, points, inside)
        changed[cell] = True
        if large.any():
            opening = np.zeros(len(self._parts), bool)
            opening[part[large]] = True
            changed[self.open(opening, tree)] = True
        return changed

    def open(self, opening: Mask, tree: TetrahedralTree | None) -> Integers32:
        """Open parts (n,); returns nodes (k,) of points that leave or come. Without a tree these stay in the root."""
        gone = rows_within(opening, self._points.rows.part)
        count, parts, points = len(self._parts), [], []
        for new, _, known in self.opened(self._parts.take_out(np.flatnonzero(opening))):
            made = self.points_on(new, known)
            points.append(replace(made, part=made.part + np.int32(count)))
            parts.append(new)
            count += len(new)
        new_parts, new_points = self._parts.kind.concatenate(parts), SharePoints.concatenate(points)
        if tree is not None:
            new_points = replace(new_points, cell=descend(tree, new_points))
        left = np.take(self._points.rows.cell, gone)
        self._points.exchange(gone, new_points)
        self._parts.append(new_parts)
        self._figures.append(self._figures_of(new_parts))
        self._alone += int(self.branch_only(new_parts).sum())
        if _OPENED * self._parts.marked > len(self._parts):
            self._drop_opened()
        return np.concatenate([left, new_points.cell])

    def _drop_opened(self) -> Parts:
        """All parts, after those that have been opened are dropped and the others numbered anew."""
        if self._parts.marked:
            there = self._parts.there
            renumber(self._points.rows.part, (np.cumsum(there) - 1).astype(np.int32))
            self._figures = Growing(self._figures.rows.take(there))
        return self._parts.joined()

    def held(self, nodes: int) -> InCells[Parts]:
        """Parts, once for each node that holds some of them, with the totals of that."""
        parts, points = self.parts, self.points
        pair, row = np.unique(points.part.astype(np.int64) * nodes + points.cell, return_inverse=True)
        totals, _ = self.totals(np.ones(nodes, bool))
        return InCells(parts.take(pair // nodes), (pair % nodes).astype(np.int32), sums(totals, row, len(pair)))

    def totals(self, chosen: Mask) -> tuple[Totals, Integers32]:
        """Totals (k,) of points in chosen nodes, a mask (nodes,), and their nodes (k,)."""
        points, figures = self._points.rows, self._figures.rows
        cell, part, leaf, wood = points.cell, points.part, points.leaf, points.wood
        if not chosen.all():
            some = rows_within(chosen, cell)
            cell, part, leaf, wood = (np.take(own, some) for own in (cell, part, leaf, wood))
        fraction = (leaf + wood) / np.maximum(np.take(figures.area, part), 1e-300)
        return Totals(leaf, wood, np.take(figures.polygons, part) * fraction, np.take(figures.width, part)), cell
