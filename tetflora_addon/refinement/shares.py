# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants as the loop holds them: parts of plants, shared among tetrahedra by points on their leaves and wood.

The paper opens a sub-plant as soon as a plane crosses it (section 6.5). Most of what is so opened is never seen: a
plane of the first tetrahedra runs through the crowns of a whole forest. Here a sub-plant that crosses planes stays
whole. Points on it, which stand for equal fractions of its area, go down the tree, and each tetrahedron holds the
fraction whose points it holds. Only where a tetrahedron is divided that is not much larger than a sub-plant is the
sub-plant opened: into the branch itself and the sub-plants of the next order, with points of their own. The number of
points follows the size in the image, so that the work is bounded by what the image shows.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Chunks, Growing, column, renumber, rows_within, spread
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..compiled.samples import Points
from ..growth.axes import Axes
from ..growth.branches import Branches
from ..growth.foliage import leaf_start
from ..growth.growth import radius_at, trunks
from ..growth.hashing import uniform
from ..growth.seeds import Seeds
from ..parallel import blocks, each_on_all_cores
from ..subplants.pieces import Pieces, open_branches
from ..tetrahedra.tree import TetrahedralTree
from .contents import Held, PlantParts, Totals, as_pieces, sums

#: Sub-plants larger than this many times the longest edge of a tetrahedron that is divided are opened.
LARGE = 1.6
#: Pixels along a part for each of its points on leaves; fewest and most of these; points on wood for each of them.
PIXELS_A_POINT, FEWEST, MOST, WOOD = 6.0, 4, 64, 0.25
#: Wood that is wider in the view than this part of the image is looked for where it is, whatever share of its plant it
#: has: such sub-plants are opened at once, and their branches have points so many widths apart, at most so many.
THICK, APART, MOST_ALONG = 0.08, 1.0, 96
#: Places on a branch at which it is asked how wide it is.
_PLACES = np.linspace(0.0, 1.0, 9)
#: How many times as many points there are where proxies fill their tetrahedra.
FILLED = 4
#: Sub-plants that are opened, and points that are lowered, at a time; bounds what that takes to some hundred megabytes.
OPENED_AT_ONCE, LOWERED_AT_ONCE = 40_000, 200_000
#: Parts that have been opened are dropped once they are more than one in so many.
_OPENED = 3
#: Draw of this module: where a part's run of samples starts.
_START = 221


@dataclass(frozen=True)
class SharePoints(Arrays):
    """Points (m) on parts of plants; each stands for a fraction of its part's area.

    Attributes
    ----------
    part : (m,) int32
    cell : (m,) int32
        Node of the tree that the point is in.
    position : (m, 3) float32
        Metres, world space.
    leaf, wood : (m,) float32
        Area that it stands for, m²; one of the two is 0.
    """

    part: NDArray[np.int32] = field(metadata=column(dtype=np.int32))
    cell: NDArray[np.int32] = field(metadata=column(dtype=np.int32))
    position: NDArray[np.float32] = field(metadata=column(3, dtype=np.float32))
    leaf: NDArray[np.float32] = field(metadata=column(dtype=np.float32))
    wood: NDArray[np.float32] = field(metadata=column(dtype=np.float32))

    @property
    def optical_area(self) -> NDArray[np.float32]:
        """Area (m,) that can block light, m²."""
        return self.leaf + self.wood / 2


def share_points(
    flora: Flora,
    parts: PlantParts,
    pixels: NDArray[np.float64],
    lines: Axes | None = None,
    most: int = MOST,
    times: int = 1,
    along: NDArray[np.int64] | int = 0,
) -> SharePoints:
    """Points on parts of plants, all in the root.

    Parameters
    ----------
    flora : Flora
    parts : PlantParts of n
        Sub-plants, or if ``lines`` are given branches alone.
    pixels : (n,) float64
        Extent of the parts in the image.
    lines : Axes of n, optional
    most : int
        Points on the leaves of a part at most.
    times : int
        How many times as many as that.
    along : (n,) int64, optional
        Points on the wood of branches alone at least.
    """
    number = times * np.ceil(np.clip(pixels / PIXELS_A_POINT, FEWEST, most)).astype(np.int64)
    made = []
    for leafy in (True, False):
        area = parts.totals.leaf_area if leafy else parts.totals.wood_area
        wood = np.maximum(np.ceil(WOOD * number).astype(np.int64), along)
        count = np.where(area > 0, number if leafy else wood, 0)
        owner, index = spread(count)
        even = (area / np.maximum(count, 1))[owner]
        if lines is not None:
            t = (index + 0.5) / count[owner]
            if leafy:
                start = leaf_start(flora.rows, parts.branches)[owner]
                t = start + (1.0 - start) * t
            else:  # thicker parts have more of the wood
                thick = radius_at(flora.rows, parts.branches.take(owner), t)
                mean = np.bincount(owner, thick, len(parts)) / np.maximum(count, 1)
                even = even * thick / np.maximum(mean, 1e-300)[owner]
            position = lines.at(owner, t)[0]
        else:
            position = _sampled(flora.samples.leaves if leafy else flora.samples.wood, parts.branches, owner, index)
        none = np.zeros(len(owner), np.float32)
        areas = (even.astype(np.float32), none) if leafy else (none, even.astype(np.float32))
        made.append(SharePoints(owner.astype(np.int32), none.astype(np.int32), position.astype(np.float32), *areas))
    return SharePoints.concatenate(made)


def _sampled(
    points: Points, branches: Branches, owner: NDArray[np.int64], index: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Places (m, 3) of samples of sub-plants; runs of samples are spread over them."""
    first, number = points.runs(branches)
    start = (uniform(branches.key, _START) * number).astype(np.int64)
    pick = first[owner] + (start[owner] + index) % np.maximum(number[owner], 1)
    local = points.position[pick] * branches.length[owner, None].astype(np.float32)
    frame = branches.frame.astype(np.float32)
    out = np.take(branches.position, owner, axis=0)
    for axis in range(3):
        for column_ in range(3):
            out[:, axis] += np.take(frame[:, axis, column_], owner) * local[:, column_]
    return out


def opened(flora: Flora, parts: PlantParts) -> Iterator[tuple[PlantParts, NDArray[np.int64], Axes | None]]:
    """Open sub-plants into branches alone and the sub-plants of the next order.

    Yields
    ------
    PlantParts of m, (m,) int64, Axes or None
        Some of the new parts, of one of the two kinds, the part that each comes from, and the axes of branches alone.
    """
    segments = flora.rows["segments"][parts.branches.row]
    for number in np.unique(segments):  # bending takes as long for all as for the most
        some = np.flatnonzero(segments == number)
        for chosen in np.split(some, np.arange(OPENED_AT_ONCE, len(some), OPENED_AT_ONCE)):
            whole, body, grown, parent = open_branches(flora, parts.branches.take(chosen))
            yield PlantParts.of_bodies(flora, whole.branches), chosen[body], whole.lines
            if len(grown):
                yield PlantParts.of_subplants(flora, grown), chosen[body[parent]], None


def lowered(tree: TetrahedralTree, points: SharePoints, some: NDArray[np.intp] | None = None) -> NDArray[np.int32]:
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

    each_on_all_cores(lower, blocks(len(every), LOWERED_AT_ONCE))
    return cell


@dataclass(frozen=True)
class _Figures(Arrays):
    """What a pass asks of all parts (n).

    Attributes
    ----------
    reach : (n,) float64
        Extent of those that can be opened, metres; 0 of others.
    area, polygons, width : (n,) float64
        Of their totals.
    """

    reach: NDArray[np.float64]
    area: NDArray[np.float64]
    polygons: NDArray[np.float64]
    width: NDArray[np.float64]

    @classmethod
    def of(cls, flora: Flora, parts: PlantParts) -> _Figures:
        reach, totals = np.where(parts.can_open(flora), parts.extent, 0.0), parts.totals
        return cls(reach, totals.area, totals.polygons, totals.width)


class SharedPlants:
    """All plants of a refinement, as parts and the points on them; changes as the tree is divided.

    A pass costs what it changes. Parts that it opens are only marked, and new ones stay in chunks of their own, until
    somebody asks for `parts` or `points`; new points take the places of those on opened parts.

    Parameters
    ----------
    flora : Flora
    seeds : Seeds
    camera : Camera
    filled : bool
        Whether proxies fill their tetrahedra, so that small ones without points would be holes.
    """

    def __init__(self, flora: Flora, seeds: Seeds, camera: Camera, filled: bool = False) -> None:
        self.flora, self.camera, self._times = flora, camera, FILLED if filled else 1
        parts = PlantParts.of_subplants(flora, trunks(flora.rows, seeds)) if len(seeds) else PlantParts.empty()
        self._hold(parts, self._points_on(parts, None) if len(seeds) else SharePoints.empty())
        while (near := self.thick(self.parts) & self.parts.can_open(flora)).any():
            self._open(near, None)

    def _hold(self, parts: PlantParts, points: SharePoints) -> None:
        self._parts, self._figures = Chunks(parts), Growing(_Figures.of(self.flora, parts))
        self._points, self._bodies = Growing(points), int(parts.alone.sum())

    @property
    def parts(self) -> PlantParts:
        """All parts, in one piece: asking costs a copy of them where a pass has opened some, and changes no result."""
        return self._drop_opened()

    @property
    def points(self) -> SharePoints:
        """All points, of `parts`; valid until the next pass."""
        self._drop_opened()
        return self._points.rows

    @property
    def numbers(self) -> tuple[int, int]:
        """How many sub-plants and how many branches alone there are."""
        return len(self._parts) - self._parts.marked - self._bodies, self._bodies

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays, with what waits to be dropped and room to spare."""
        return self._parts.nbytes + self._figures.nbytes + self._points.nbytes

    def with_parts(self, parts: PlantParts, points: SharePoints) -> SharedPlants:
        """The same with other parts and the points on them."""
        made = copy(self)
        made._hold(parts, points)
        return made

    def without_parts(self) -> SharedPlants:
        """The same with no plants, for what asks only how large other parts are."""
        return self.with_parts(PlantParts.empty(), SharePoints.empty())

    def pixels(self, parts: PlantParts) -> NDArray[np.float64]:
        """Extent (n,) of parts in the image."""
        return parts.extent / self.camera.extent_around(parts.branches.position)

    def thick(self, parts: PlantParts) -> NDArray[np.bool_]:
        """Parts (n,) whose own branch is wide in the view somewhere, as if it were straight."""
        branches, camera = parts.branches, self.camera
        axis = branches.length[:, None] * branches.frame[:, :, 2]
        # As far from a place as its branch may come into view.
        beside = branches.radius + 0.5 * branches.length / (len(_PLACES) - 1)
        width = 2.0 * branches.radius / (THICK * min(camera.width, camera.height))
        out = np.zeros(len(parts), bool)
        for place in _PLACES:
            at = branches.position + place * axis
            out |= (width > camera.extent_around(at)) & (camera.clearance(at) < beside)
        return out

    def update(self, tree: TetrahedralTree, dividing: NDArray[np.bool_], edge: NDArray[np.float64]) -> NDArray:
        """Hand points in divided nodes on, and open what is large there.

        Parameters
        ----------
        tree : TetrahedralTree
        dividing : (nodes,) bool
            Nodes that have been divided.
        edge : (nodes,) float64
            Their longest edge, metres.

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
        points.cell[inside] = cell = lowered(tree, points, inside)
        changed[cell] = True
        if large.any():
            opening = np.zeros(len(self._parts), bool)
            opening[part[large]] = True
            changed[self._open(opening, tree)] = True
        return changed

    def _open(self, opening: NDArray[np.bool_], tree: TetrahedralTree | None) -> NDArray[np.int32]:
        """Open parts (n,); returns nodes (k,) of points that leave or come. Without a tree these stay in the root."""
        gone = rows_within(opening, self._points.rows.part)
        count, parts, points = len(self._parts), [], []
        for new, _, lines in opened(self.flora, self._parts.take_out(np.flatnonzero(opening))):
            made = self._points_on(new, lines)
            points.append(replace(made, part=made.part + np.int32(count)))
            parts.append(new)
            count += len(new)
        new_parts, new_points = PlantParts.concatenate(parts), SharePoints.concatenate(points)
        if tree is not None:
            new_points = replace(new_points, cell=lowered(tree, new_points))
        left = np.take(self._points.rows.cell, gone)
        self._points.exchange(gone, new_points)
        self._parts.append(new_parts)
        self._figures.append(_Figures.of(self.flora, new_parts))
        self._bodies += int(new_parts.alone.sum())
        if _OPENED * self._parts.marked > len(self._parts):
            self._drop_opened()
        return np.concatenate([left, new_points.cell])

    def _drop_opened(self) -> PlantParts:
        """All parts, after those that have been opened are dropped and the others numbered anew."""
        if self._parts.marked:
            there = self._parts.there
            renumber(self._points.rows.part, (np.cumsum(there) - 1).astype(np.int32))
            self._figures = Growing(self._figures.rows.take(there))
        return self._parts.joined()

    def _points_on(self, parts: PlantParts, lines: Axes | None) -> SharePoints:
        along = 0
        if lines is not None:
            along = parts.branches.length / np.maximum(2.0 * APART * parts.branches.radius, 1e-300)
            along = np.where(self.thick(parts), np.minimum(along, MOST_ALONG), 0.0).astype(np.int64)
        return share_points(self.flora, parts, self.pixels(parts), lines, times=self._times, along=along)

    def totals(self, chosen: NDArray[np.bool_]) -> tuple[Totals, NDArray[np.int32]]:
        """Totals (k,) of points in chosen nodes, a mask (nodes,), and their nodes (k,)."""
        points, figures = self._points.rows, self._figures.rows
        cell, part, leaf, wood = points.cell, points.part, points.leaf, points.wood
        if not chosen.all():
            some = rows_within(chosen, cell)
            cell, part, leaf, wood = (np.take(own, some) for own in (cell, part, leaf, wood))
        fraction = (leaf + wood) / np.maximum(np.take(figures.area, part), 1e-300)
        return Totals(leaf, wood, np.take(figures.polygons, part) * fraction, np.take(figures.width, part)), cell

    def held(self, nodes: int) -> tuple[Held[Branches], Held[Pieces]]:
        """Sub-plants and branches alone, once for each node that holds some of them, with the totals of that."""
        parts, points = self.parts, self.points
        pair, row = np.unique(points.part.astype(np.int64) * nodes + points.cell, return_inverse=True)
        totals, _ = self.totals(np.ones(nodes, bool))
        found = sums(totals, row, len(pair))
        part, cell = pair // nodes, (pair % nodes).astype(np.int32)
        alone = parts.alone[part]
        made = []
        for chosen in (np.flatnonzero(~alone), np.flatnonzero(alone)):
            made.append((parts.branches.take(part[chosen]), cell[chosen], found.take(chosen)))
        subplants, bodies = made
        return Held(*subplants), Held(as_pieces(bodies[0]), *bodies[1:])
