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

import numpy as np

from ..arrays import Floats, Integers, Mask, spread
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..compiled.placed import placed_samples
from ..compiled.samples import Points
from ..growth.axes import Axes, axes
from ..growth.branches import Branches
from ..growth.foliage import are_solids, leaf_keys, leaf_sites, leaf_start
from ..growth.growth import open_branches, radius_at, trunks
from ..growth.hashing import uniform
from ..growth.seeds import Seeds
from ..subplants.pieces import Pieces
from .contents import InCells, PlantParts, as_pieces
from .shared_parts import SharedParts, SharePoints

#: Pixels along a part for each of its points on leaves; fewest and most of these; points on wood for each of them.
PIXELS_A_POINT, FEWEST, MOST, WOOD = 6.0, 4, 64, 0.25
#: The same of leaves that fill a solid, which cannot be opened: there is a point in each square of so many pixels.
PIXELS_IN_SOLID, FEWEST_IN_SOLID, MOST_IN_SOLID = 3.0, 16, 2048
#: Wood that is wider in the view than this part of the image is looked for where it is, whatever share of its plant it
#: has: such sub-plants are opened at once, and their branches have points so many widths apart, at most so many.
THICK, APART, MOST_ALONG = 0.08, 1.0, 96
#: Places on a branch at which it is asked how wide it is.
_PLACES = np.linspace(0.0, 1.0, 9)
#: How many times as many points there are where proxies fill their tetrahedra.
FILLED = 4
#: Sub-plants that are opened at a time; bounds what that takes to some hundred megabytes.
OPEN_BATCH = 40_000
#: Draw of this module: where a part's run of samples starts.
_START = 221


def share_points(
    flora: Flora,
    parts: PlantParts,
    pixels: Floats,
    lines: Axes | None = None,
    times: int = 1,
    along: Integers | int = 0,
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
    times : int
        How many times as many points as usual.
    along : (n,) int64, optional
        Points on the wood of branches alone at least.
    """
    number = times * np.ceil(np.clip(pixels / PIXELS_A_POINT, FEWEST, MOST)).astype(np.int64)
    wood = np.maximum(np.ceil(WOOD * number).astype(np.int64), along)
    solid = are_solids(flora.rows)[parts.branches.row]
    squares = (pixels[solid] / PIXELS_IN_SOLID) ** 2
    # Cells that are filled are smaller than what cannot be opened: too few points make holes and lumps of it.
    number[solid] = times**2 * np.ceil(np.clip(squares, FEWEST_IN_SOLID, MOST_IN_SOLID)).astype(np.int64)
    made = []
    for leafy in (True, False):
        area = parts.totals.leaf_area if leafy else parts.totals.wood_area
        count = np.where(area > 0, number if leafy else wood, 0)
        owner, index = spread(count)
        even = (area / np.maximum(count, 1))[owner]
        if lines is not None:
            t = (index + 0.5) / count[owner]
            if leafy:
                position = _along_leaves(flora, parts.branches, lines, owner, index, t)
            else:  # thicker parts have more of the wood
                thick = radius_at(flora.rows, parts.branches.take(owner), t)
                mean = np.bincount(owner, thick, len(parts)) / np.maximum(count, 1)
                even = even * thick / np.maximum(mean, 1e-300)[owner]
                position = lines.at(owner, t)[0]
        else:
            points = flora.samples.leaves if leafy else flora.samples.wood
            position, share = _sampled(flora, points, parts.branches, owner, index)
            even = even if share is None else even * share
            some = np.flatnonzero(solid[owner])
            if leafy and len(some):  # more places than samples
                given = owner[some], index[some], (index[some] + 0.5) / count[owner[some]]
                position[some] = _along_leaves(flora, parts.branches, axes(flora.rows, parts.branches), *given)
        none = np.zeros(len(owner), np.float32)
        areas = (even.astype(np.float32), none) if leafy else (none, even.astype(np.float32))
        made.append(SharePoints(owner.astype(np.int32), none.astype(np.int32), position.astype(np.float32), *areas))
    return SharePoints.concatenate(made)


def _along_leaves(
    flora: Flora, branches: Branches, lines: Axes, owner: Integers, index: Integers, part: Floats
) -> Floats:
    """Places (m, 3) of leaves on branches, after parts (m,) of them; ``index`` (m,) numbers those of a branch."""
    start = leaf_start(flora.rows, branches)[owner]
    t, key = start + (1.0 - start) * part, leaf_keys(branches, owner, index)
    return leaf_sites(flora.rows, branches, lines, branches.row[owner], owner, key, t)[0]


def _sampled(
    flora: Flora, points: Points, branches: Branches, owner: Integers, index: Integers
) -> tuple[Floats, Floats | None]:
    """Places (m, 3) of samples of sub-plants, and what they stand for; runs of samples are spread over them."""
    first, number = points.runs(branches)
    start = (uniform(branches.key, _START) * number).astype(np.int64)
    pick = first[owner] + (start[owner] + index) % np.maximum(number[owner], 1)
    local, share = placed_samples(flora, points, branches, owner, pick)
    local = local.astype(np.float32) * branches.length[owner, None].astype(np.float32)
    frame = branches.frame.astype(np.float32)
    out = np.take(branches.position, owner, axis=0)
    for axis in range(3):
        for column_ in range(3):
            out[:, axis] += np.take(frame[:, axis, column_], owner) * local[:, column_]
    return out, share


def opened(flora: Flora, parts: PlantParts) -> Iterator[tuple[PlantParts, Integers, Axes | None]]:
    """Open sub-plants into branches alone and the sub-plants of the next order.

    Yields
    ------
    PlantParts of m, (m,) int64, Axes or None
        Some of the new parts, of one of the two kinds, the part that each comes from, and the axes of branches alone.
    """
    segments = flora.rows["segments"][parts.branches.row]
    for number in np.flatnonzero(np.bincount(segments)):  # bending takes as long for all as for the most
        some = np.flatnonzero(segments == number)
        for chosen in np.split(some, np.arange(OPEN_BATCH, len(some), OPEN_BATCH)):
            whole, body, grown, parent = open_branches(flora.rows, parts.branches.take(chosen))
            yield PlantParts.of_branches(flora, whole.branches), chosen[body], whole.lines
            if len(grown):
                yield PlantParts.of_subplants(flora, grown), chosen[body[parent]], None


class SharedPlants(SharedParts[PlantParts]):
    """All plants of a refinement, as parts and the points on them.

    Parameters
    ----------
    flora : Flora
    seeds : Seeds
    camera : Camera
    filled : bool
        Whether proxies fill their tetrahedra, so that small ones without points would be holes.
    """

    def __init__(self, flora: Flora, seeds: Seeds, camera: Camera, filled: bool = False) -> None:
        super().__init__(camera)
        self.flora, self._times = flora, FILLED if filled else 1
        parts = PlantParts.of_subplants(flora, trunks(flora.rows, seeds)) if len(seeds) else PlantParts.empty()
        self.hold(parts, self.points_on(parts, None) if len(seeds) else SharePoints.empty())
        while (near := self.thick(self.parts) & self.parts.can_open(flora)).any():
            self.open(near, None)

    def can_open(self, parts: PlantParts) -> Mask:
        """As `SharedParts.can_open`."""
        return parts.can_open(self.flora)

    def branch_only(self, parts: PlantParts) -> Mask:
        """Branches without what grows on them."""
        return parts.branch_only

    def opened(self, parts: PlantParts) -> Iterator[tuple[PlantParts, Integers, Axes | None]]:
        """As `opened` of this module."""
        return opened(self.flora, parts)

    def pixels(self, parts: PlantParts) -> Floats:
        """Extent (n,) of parts in the image."""
        return parts.extent / self.camera.extent_around(parts.branches.position)

    def thick(self, parts: PlantParts) -> Mask:
        """Parts (n,) whose own branch is wide in the view somewhere, as if it were straight."""
        branches, camera = parts.branches, self.camera
        axis = branches.length[:, None] * branches.frame[:, :, 2]
        # As far from a place as its branch may come into view.
        beside = branches.radius + 0.5 * branches.length / (len(_PLACES) - 1)
        width = 2.0 * branches.radius / (THICK * min(camera.width, camera.height))
        out = np.zeros(len(parts), bool)
        for place in _PLACES:
            at = branches.position + place * axis
            out |= (width > camera.extent_around(at)) & (camera.distance_to_view(at) < beside)
        return out

    def points_on(self, parts: PlantParts, lines: Axes | None) -> SharePoints:
        """As `SharedParts.points_on`."""
        along = 0
        if lines is not None:
            along = parts.branches.length / np.maximum(2.0 * APART * parts.branches.radius, 1e-300)
            along = np.where(self.thick(parts), np.minimum(along, MOST_ALONG), 0.0).astype(np.int64)
        return share_points(self.flora, parts, self.pixels(parts), lines, times=self._times, along=along)

    def held_apart(self, nodes: int) -> tuple[InCells[Branches], InCells[Pieces]]:
        """As `held`: sub-plants, and branches alone as one piece each."""
        every = self.held(nodes)
        own, opened = (every.take(np.flatnonzero(every.items.branch_only == alone)) for alone in (False, True))
        pieces = as_pieces(opened.items.branches)
        return InCells(own.items.branches, own.cell, own.totals), InCells(pieces, opened.cell, opened.totals)
