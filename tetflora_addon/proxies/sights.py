# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Families of sub-plants as parallel rays see them: which meet leaves and wood, and which would meet facets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import GOLDEN_TURN, spiral, spread
from ..compiled.flora import Flora
from ..compiled.rays import Things, basis, covered, things_of
from ..growth.branches import Branches
from ..growth.hashing import mix
from ..refinement.contents import piece_totals, subplant_totals
from ..subplants.pieces import Pieces, open_subplants
from .microsurfaces import CIRCUMRADIUS, SIN_60, Facets, piece_facets, subplant_facets

#: Families that are seen side by side, at most.
FAMILIES = 6
#: Rays across a family, and directions of rays.
_RAYS, _DIRECTIONS = 36, 6
#: Maximum weight.
LARGEST = 1.6


@dataclass(frozen=True)
class View:
    """Parallel rays through the points of a lattice on the plane of two axes."""

    u: NDArray[np.float64]
    v: NDArray[np.float64]
    spacing: float

    def flat(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vectors (n, 3) on the plane (n, 2), in units of the lattice."""
        return vectors @ np.stack([self.u, self.v], axis=1) / self.spacing

    def coarser(self, stride: int) -> View:
        """The same with each so many-th line of the lattice only."""
        return replace(self, spacing=self.spacing * stride)

    def covered(self, facets: Facets) -> float:
        """How many rays facets of the maximum weight block, from all directions, one behind the other."""
        return 0.5 * _DIRECTIONS * LARGEST * float((facets.side**2).sum()) / self.spacing**2


@dataclass(frozen=True)
class Families:
    """Families of sub-plants, or what their branches themselves bear.

    Attributes
    ----------
    flora : Flora
    some : Branches of n
    beyond : (3,) float64
        Offset at which a copy meets none of them, metres.
    area, leaf : (n,) float64
        Optical area of each, and area of one of its leaves, m².
    pieces : Pieces or None
        Of the branches, where only these count.
    """

    flora: Flora
    some: Branches
    beyond: NDArray[np.float64]
    area: NDArray[np.float64]
    leaf: NDArray[np.float64]
    pieces: Pieces | None

    @classmethod
    def of_subplants(cls, flora: Flora, some: Branches, beyond: NDArray[np.float64]) -> Families:
        """Whole sub-plants."""
        return cls(flora, some, beyond, subplant_totals(flora, some).optical_area, flora.one_leaf_area(some), None)

    @classmethod
    def of_branches(cls, flora: Flora, some: Branches, beyond: NDArray[np.float64]) -> Families:
        """Branches with their own leaves only."""
        pieces, owner = open_subplants(flora, some)[2:]
        area = np.bincount(owner, piece_totals(flora, pieces).optical_area, len(some))
        return cls(flora, some, beyond, area, flora.one_leaf_area(some), pieces)

    @property
    def content(self) -> tuple[bytes, bool]:
        """What follows from all that is grown: equal for whole sub-plants and branches on which nothing grows."""
        rows = self.flora.rows[np.unique(self.some.row)]
        bare = not ((rows["next"] >= 0).any() or rows["phantom"].any())
        return self.some.key.tobytes() + self.some.position.tobytes(), bare or self.pieces is not None

    def grown(self) -> Things:
        """The real leaves and wood."""
        forms = self.flora.forms[int(self.flora.species_of(self.some.row[:1])[0])]
        rows, orders = len(self.flora.rows), None if self.pieces is None else 1
        return things_of(self.flora.rows, forms, self.some, np.zeros(rows, np.intp), 0, np.ones(rows), orders)

    def facets(self, side: float, copies: int) -> Facets:
        """Facets of a side in metres for several copies of all side by side, each copy with other facets."""
        if self.pieces is None:
            several = Branches.concatenate([self._copy(self.some, n) for n in range(copies)])
            return subplant_facets(self.flora, several, np.full(len(several), side))
        several = []
        for n in range(copies):
            start, end = (place + n * self.beyond for place in (self.pieces.start, self.pieces.end))
            several.append(replace(self.pieces, branches=self._copy(self.pieces.branches, n), start=start, end=end))
        pieces = Pieces.concatenate(several)
        return piece_facets(self.flora, pieces, np.full(len(pieces), side))

    def _copy(self, branches: Branches, number: int) -> Branches:
        key = mix(branches.key + np.uint64(number + 1))
        return replace(branches, key=key, position=branches.position + number * self.beyond)


def look(things: Things, beyond: NDArray[np.float64]) -> Iterator[tuple[View, NDArray[np.int64]]]:
    """Views of families, and the numbers (m,) of the rays of each that meet anything.

    Directions are spread over the half sphere; the lattice is as fine for all of them.
    """
    along = np.floor(beyond @ things.middle / (beyond @ beyond) * FAMILIES + 0.5)
    extent = 2.0 * float(things.radius.max())  # one straight branch has no extent but its own
    for family in np.unique(along):
        extent = max(extent, float(np.ptp(things.middle[:, along == family], axis=1).max()))
    index = np.arange(_DIRECTIONS) + 0.5
    for direction in spiral(index / _DIRECTIONS, index, GOLDEN_TURN):
        view = View(*basis(direction), extent / _RAYS)
        yield view, _met(view, things)


def _met(view: View, things: Things) -> NDArray[np.int64]:
    place = view.flat(things.middle.T)
    near = (np.abs(place - np.rint(place)) <= (things.radius / view.spacing)[:, None]).all(axis=1)
    begin, rays = 0, []
    for part in things.parts:
        end = begin + len(part)
        corners, first, number = part.outlines(np.flatnonzero(near[begin:end]), view.u, view.v)
        rays.append(_ray_numbers(*covered(corners / view.spacing, first, number)[1].T))
        begin = end
    return np.unique(np.concatenate(rays))


def least_weights(view: View, facets: Facets) -> NDArray[np.float64]:
    """For each ray that any of the facets can block, the least weight with which one does."""
    reach, largest = CIRCUMRADIUS * facets.side[:, None], np.sqrt(LARGEST)
    centre, a, b = (view.flat(v).T for v in (facets.centre, facets.across * reach, facets.along * reach))
    # A triangle's sides are where these three numbers are 1: each is linear in x and y, and grows by x and y by (3, n).
    with np.errstate(divide="ignore", invalid="ignore"):
        aside, up = np.stack([[b[1], -b[0]], [-a[1], a[0]]]) / (a[0] * b[1] - a[1] * b[0])
    grow = 2.0 * SIN_60 * aside
    by_x, by_y = (np.stack([-2.0 * u, u + v, u - v]) for u, v in zip(up, grow, strict=True))
    wide = SIN_60 * np.abs(a[0])
    low = np.ceil(centre[0] + largest * np.minimum(b[0], -b[0] / 2 - wide)).astype(np.int64)
    high = np.floor(centre[0] + largest * np.maximum(b[0], -b[0] / 2 + wide)).astype(np.int64)
    facet, step = spread(np.maximum(high - low + 1, 0))
    # On each line of the lattice, rays from where the last of the sides is entered to where the first is left.
    column = low[facet] + step
    x = column - centre[0][facet]
    at, slope = by_x[:, facet] * x, by_y[:, facet]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (largest - at) / slope
    enter = np.where(slope < 0, ends, -np.inf).max(axis=0) + centre[1][facet]
    leave = np.where(slope > 0, ends, np.inf).min(axis=0) + centre[1][facet]
    first = np.ceil(np.where(enter <= leave, enter, 0.0)).astype(np.int64)
    last = np.floor(np.where(enter <= leave, leave, -1.0)).astype(np.int64)
    line, step = spread(np.maximum(last - first + 1, 0))
    row = first[line] + step
    y = row - centre[1][facet[line]]
    # How many times as large the triangle has to be to reach the ray.
    scale = (at[:, line] + slope[:, line] * y).max(axis=0)
    inside = np.flatnonzero(scale <= largest)  # a side along the line has neither been entered nor left
    ray, scale = _ray_numbers(column[line[inside]], row[inside]), scale[inside]
    order = np.argsort(ray, kind="stable")
    begin = np.flatnonzero(np.diff(ray[order], prepend=np.iinfo(np.int64).min))
    return np.minimum.reduceat(scale[order], begin) ** 2 if len(begin) else np.zeros(0)


def _ray_numbers(column: NDArray[np.int64], row: NDArray[np.int64]) -> NDArray[np.int64]:
    return (column << 32) + row
