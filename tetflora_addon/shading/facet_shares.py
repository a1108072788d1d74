# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which share of its area the facets of a sub-plant need, to hold up as much light as the sub-plant itself.

Leaves sit in clusters and hide each other. Few large facets that are spread over the same sub-plant do so less: with
the full area they would be up to three times as opaque. Rays are cast through grown sub-plants of each row of a species
and through their facets, at several numbers of them; the share is the one with which as many rays are held up. So it is
for facets what `plants.clumping` is for cells that are filled evenly.

Sub-plants are looked at together with their next siblings: facets that are larger than a sub-plant spill over. Facets
of pieces are compared in the same way with what branches themselves bear.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..plants.cells import basis, covered
from ..plants.compiled import Flora
from ..plants.expansion import open_subplants
from ..plants.growth import Branches, spread, trunks
from ..plants.hashing import mix
from ..plants.outlines import things_of
from ..plants.seeds import Seeds
from ..refinement.amounts import piece_amounts, subplant_amounts
from .microsurfaces import Facets, piece_facets, subplant_facets

#: Facets of a sub-plant for which shares are known; between them they follow the logarithm.
COUNTS = 4.0 ** np.arange(-2, 6)
#: Families of siblings of a row that are looked at, members of one at most, and the polygons that all may have.
_FAMILIES, _MEMBERS, _POLYGONS = 3, 16, 40_000.0
#: Facets that stand for each number, over all families, at least and at most, about.
_LEAST, _MOST = 300.0, 6_000.0
#: Rays across a family, and directions of rays.
_RAYS, _DIRECTIONS = 40, 3
#: Shares are never more than this.
_LARGEST_SHARE = 1.6


@dataclass(frozen=True)
class FacetShares:
    """Shares of the area by row and number of facets.

    Attributes
    ----------
    whole : (r, k) float64
        Of sub-plants, for each of `COUNTS`.
    own : (r, k) float64
        Of what branches themselves bear, by the number of facets of a whole branch.
    """

    whole: NDArray[np.float64]
    own: NDArray[np.float64]

    def of_subplants(self, row: NDArray[np.integer], count: NDArray[np.float64]) -> NDArray[np.float64]:
        """Shares (n,) for sub-plants of rows (n,) that are cut into so many (n,) facets each."""
        return _between(self.whole, row, count)

    def of_pieces(self, row: NDArray[np.integer], count: NDArray[np.float64]) -> NDArray[np.float64]:
        """Shares (n,) for pieces of branches of which a whole one would be cut into so many (n,) facets."""
        return _between(self.own, row, count)


def _between(table: NDArray[np.float64], row: NDArray[np.integer], count: NDArray[np.float64]) -> NDArray[np.float64]:
    place = np.log(np.maximum(count, 1e-12) / COUNTS[0]) / np.log(COUNTS[1] / COUNTS[0])
    place = np.clip(place, 0.0, len(COUNTS) - 1.0)
    low = np.minimum(place.astype(np.int64), len(COUNTS) - 2)
    return table[row, low] + (place - low) * (table[row, low + 1] - table[row, low])


@lru_cache(maxsize=8)
def facet_shares(flora: Flora) -> FacetShares:
    """Shares for a flora; found when first asked for, and kept as long as the flora may be asked for again."""
    whole, own = np.ones((2, len(flora.rows), len(COUNTS)))
    for row, families in _families(flora).items():
        whole[row], own[row] = _fitted(flora, families)
    return FacetShares(whole, own)


def _families(flora: Flora) -> dict[int, list[Branches]]:
    """Some siblings of each row as they grow together, for a few parents."""
    species = len(flora.first_row)
    which = np.repeat(np.arange(species, dtype=np.int32), _FAMILIES)
    n = len(which)
    names = tuple(s.identifier for s in flora.species)
    seeds = Seeds(names, which, np.arange(n), np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), np.ones(n))
    level, parent, found = trunks(flora.rows, seeds), np.arange(n), {}
    while len(level):
        some = []
        for row in np.unique(level.row):
            own = np.flatnonzero(level.row == row)
            members = int(np.clip(_POLYGONS / _FAMILIES / max(flora.polygons[row], 1.0), 1, _MEMBERS))
            parents = np.unique(parent[own])
            parents = parents[np.argsort(mix(parents.astype(np.uint64)))[:_FAMILIES]]
            for p in parents:
                siblings = own[parent[own] == p]
                first = (len(siblings) - min(members, len(siblings))) // 2
                chosen = siblings[first : first + members]
                found.setdefault(int(row), []).append(level.take(chosen))
                some.append(chosen)
        level, parent, _, _ = open_subplants(flora, level.take(np.concatenate(some)))
    return {row: _affordable(flora, families) for row, families in found.items()}


def _affordable(flora: Flora, families: list[Branches]) -> list[Branches]:
    """As many of the families as their polygons allow, one at least; parents of several orders take turns."""
    families = [families[i] for i in np.argsort(mix(np.arange(len(families)).astype(np.uint64)))][:_FAMILIES]
    total = np.cumsum([flora.face_counts(f).sum() for f in families])
    return [f for f, t in zip(families, total, strict=True) if t <= _POLYGONS] or families[:1]


def _fitted(flora: Flora, families: list[Branches]) -> NDArray[np.float64]:
    """Shares (2, k) for one row: of sub-plants, and of what their branches themselves bear."""
    out = np.ones((2, len(COUNTS)))
    for kind, look in enumerate((_Whole, _Own)):
        looks = [look(flora, family) for family in families]
        area = np.concatenate([one.area for one in looks])
        if area.mean() <= 0.0:
            continue
        views = [(one, view) for one in looks for view in one.views(_DIRECTIONS)]
        met = sum(one.met(view) for one, view in views)
        for k, count in enumerate(COUNTS):
            # Facets of too many members would take long, of too few the mean would not settle.
            copies = int(np.clip(np.ceil(_LEAST / (count * len(area))), 1, 12))
            side = np.sqrt(area.mean() / count)
            least = [one.least_shares(view, side, copy) for one, view in views for copy in range(copies)]
            out[kind, k] = _share(np.concatenate(least), met * copies)
            if count * len(area) > _MOST or all((one.leaf > side**2).all() for one in looks):
                out[kind, k + 1 :] = out[kind, k]
                break
    return out


def _share(least: NDArray[np.float64], met: int) -> float:
    """Share with which so many rays are held up, from the least share (n,) with which each ray is."""
    if met == 0:
        return 1.0
    if met > len(least):
        return _LARGEST_SHARE
    return float(np.partition(least, met - 1)[met - 1])


@dataclass(frozen=True)
class _View:
    """Parallel rays through the points of a lattice on the plane of two axes."""

    u: NDArray[np.float64]
    v: NDArray[np.float64]
    spacing: float


class _Whole:
    """A family of sub-plants, to the last leaf."""

    def __init__(self, flora: Flora, family: Branches) -> None:
        self.flora, self.family = flora, replace(family, position=family.position - family.position.mean(axis=0))
        self._measure()
        first = int(flora.first_row[flora.rows["species"][family.row[0]]])
        rows = flora.rows
        group = np.zeros(len(rows), np.intp)
        forms = flora.forms[rows["species"][first]]
        self.things = self._grown(rows, forms, group)
        self.leaf = flora.one_leaf_area(family)

    def _measure(self) -> None:
        amounts = subplant_amounts(self.flora, self.family)
        self.area = amounts.leaf_area + amounts.wood_area / 2

    def _grown(self, rows, forms, group):
        return things_of(rows, forms, self.family, group, 0, np.ones(len(rows)))

    def views(self, number: int) -> list[_View]:
        middle = self.things.middle
        extent = float(np.max(middle.max(axis=1) - middle.min(axis=1)) + 2 * self.things.radius.max())
        out = []
        for i in range(number):
            z = (i + 0.5) / number
            turn = np.pi * (1 + np.sqrt(5)) * (i + 0.5)
            direction = np.array([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z])
            out.append(_View(*basis(direction), extent / _RAYS))
        return out

    def met(self, view: _View) -> int:
        """How many rays meet anything."""
        flat = np.stack([sum(axis[k] * self.things.middle[k] for k in range(3)) for axis in (view.u, view.v)])
        place = flat / view.spacing
        near = (np.abs(place - np.rint(place)) <= self.things.radius / view.spacing).all(axis=0)
        begin, rays = 0, []
        for part in self.things.parts:
            end = begin + len(part)
            corners, first, number = part.outlines(np.flatnonzero(near[begin:end]), view.u, view.v)
            begin = end
            rays.append(covered(corners / view.spacing, first, number)[1])
        return len(np.unique(_ray_number(np.concatenate(rays))))

    def least_shares(self, view: _View, side: float, copy: int) -> NDArray[np.float64]:
        """For each ray that facets of this side can hold up, the least share of their area with which they do."""
        facets = self.facets(side, copy)
        centre = np.stack([facets.centre @ view.u, facets.centre @ view.v], axis=1) / view.spacing
        half = facets.side[:, None] * np.sqrt(_LARGEST_SHARE) / 2 / view.spacing
        a = np.stack([facets.across @ view.u, facets.across @ view.v], axis=1) * half
        b = np.stack([facets.along @ view.u, facets.along @ view.v], axis=1) * half
        reach = np.abs(a) + np.abs(b)
        low = np.ceil(centre - reach).astype(np.int64)
        sizes = np.maximum(np.floor(centre + reach).astype(np.int64) - low + 1, 0)
        facet, step = spread(sizes[:, 0] * sizes[:, 1])
        across = sizes[facet, 1]
        point = low[facet] + np.stack([step // across, step % across], axis=1)
        x, y = (point - centre[facet]).T
        (ax, ay), (bx, by) = a[facet].T, b[facet].T
        area = ax * by - ay * bx
        with np.errstate(divide="ignore", invalid="ignore"):
            place = np.maximum(np.abs(x * by - y * bx), np.abs(ax * y - ay * x)) / np.abs(area)
        inside = np.flatnonzero(place <= 1.0)
        ray, which = np.unique(_ray_number(point[inside]), return_inverse=True)
        least = np.full(len(ray), np.inf)
        np.minimum.at(least, which.reshape(-1), place[inside] ** 2 * _LARGEST_SHARE)
        return least

    def facets(self, side: float, copy: int) -> Facets:
        some = replace(self.family, key=mix(self.family.key + np.uint64(copy + 1)))
        return subplant_facets(self.flora, some, np.full(len(some), side))


class _Own(_Whole):
    """What the branches of a family themselves bear."""

    def _measure(self) -> None:
        self.pieces, self.owner = open_subplants(self.flora, self.family)[2:]
        amounts = piece_amounts(self.flora, self.pieces)
        area = amounts.leaf_area + amounts.wood_area / 2
        self.area = np.bincount(self.owner, area, len(self.family))

    def _grown(self, rows, forms, group):
        return things_of(rows, forms, self.family, group, 0, np.ones(len(rows)), orders=1)

    def facets(self, side: float, copy: int) -> Facets:
        branches = self.pieces.branches
        some = replace(self.pieces, branches=replace(branches, key=mix(branches.key + np.uint64(copy + 1))))
        return piece_facets(self.flora, some, np.full(len(some), side))


def _ray_number(point: NDArray[np.int64]) -> NDArray[np.int64]:
    return (point[:, 0] << 32) + point[:, 1]
