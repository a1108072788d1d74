# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights of facets: the fraction of its area that the facets of a sub-plant need to block as much light as it does.

Leaves sit in clusters and hide each other. A few large facets spread over the same sub-plant do so less: with the full
area they would be up to three times as opaque. Rays are cast through grown sub-plants of each row of a species and
through their facets, at several numbers of facets; with the right weight as many rays are blocked. Weights are for
facets what `compiled.clumping` is for evenly filled cells.

Sub-plants are tested together with their next siblings, because facets spill over. Where few facets stand for one,
all that grow around it take part, because facets then reach across the gaps between neighbours of any parent. Facets
of pieces are compared in the same way with what branches themselves bear.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..arrays import GOLDEN_TURN, spiral, spread
from ..compiled.flora import Flora
from ..compiled.rays import Things, basis, covered, things_of
from ..growth.branches import Branches
from ..growth.growth import trunks
from ..growth.hashing import mix
from ..growth.seeds import Seeds
from ..refinement.contents import piece_totals, subplant_totals
from ..species.species import fingerprint
from ..storage import remembered
from ..subplants.pieces import Pieces, open_subplants
from .microsurfaces import CIRCUMRADIUS, SIN_60, Facets, piece_facets, subplant_facets

#: Weights of the shipped species, made by ``python -m devtools.facet_tables``. Raise `_METHOD` when facets or weights
#: are made differently.
TABLE = Path(__file__).resolve().parent.parent / "catalogue" / "tables" / "facet_weights.json"
_METHOD = 2
#: Facets of a sub-plant for which weights are known; in between, weights are linear in the logarithm.
COUNTS = 4.0 ** np.arange(-2, 6)
#: With fewer facets for a sub-plant its neighbours count, and not only its siblings.
_FEW = 4.0
#: Families of a row that are tested, and polygons of all of them; maximum members of one, siblings or neighbours.
_FAMILIES, _POLYGONS = 6, 50_000.0
_SIBLINGS, _NEIGHBOURS = 12, 60
#: Facets for each number, over all families: copies are made up to the first; with fewer than the second a number is
#: skipped; after more than the third no larger number is tried.
_WANTED, _NEEDED, _MOST = 250.0, 60.0, 5_000.0
_COPIES = 16
#: Rays across a family, and directions of rays.
_RAYS, _DIRECTIONS = 36, 4
#: Maximum weight.
_LARGEST = 1.6


@dataclass(frozen=True)
class FacetWeights:
    """Fraction of their area that facets get, by row and number of facets.

    Attributes
    ----------
    whole, own : (r, k) float64
        For each of `COUNTS`, of sub-plants, and of what branches themselves bear, by the facets of a whole branch.
    """

    whole: NDArray[np.float64]
    own: NDArray[np.float64]

    def of_subplants(self, row: NDArray[np.integer], count: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weights (n,) for sub-plants of rows (n,) and numbers of facets (n,)."""
        return _between(self.whole, row, count)

    def of_pieces(self, row: NDArray[np.integer], count: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weights (n,) for pieces of branches, by rows (n,) and the numbers of facets (n,) of whole branches."""
        return _between(self.own, row, count)


def _between(table: NDArray[np.float64], row: NDArray[np.integer], count: NDArray[np.float64]) -> NDArray[np.float64]:
    place = np.log(np.maximum(count, 1e-12) / COUNTS[0]) / np.log(COUNTS[1] / COUNTS[0])
    place = np.clip(place, 0.0, len(COUNTS) - 1.0)
    low = np.minimum(place.astype(np.int64), len(COUNTS) - 2)
    return table[row, low] + (place - low) * (table[row, low + 1] - table[row, low])


#: Weights (2, r, k) of other species by digest: a scene is compiled anew for each refinement.
_found: dict[str, NDArray[np.float64]] = {}
_REMEMBERED = 256


def facet_weights(flora: Flora) -> FacetWeights:
    """Weights for a flora, cached in memory.

    Those of the shipped species are read from `TABLE`. Others take some seconds a species and are cached on disk too.
    """
    return _of_flora(flora.at_rest)


@lru_cache(maxsize=8)
def _of_flora(flora: Flora) -> FacetWeights:
    weights = np.ones((2, len(flora.rows), len(COUNTS)))
    for number, first in enumerate(flora.first_row):
        name = digest(flora, number)
        known = shipped().get(name)
        found = _of_species(flora, number, name) if known is None else np.array([known["whole"], known["own"]])
        weights[:, first : first + found.shape[1]] = found
    return FacetWeights(*weights)


def _of_species(flora: Flora, number: int, name: str) -> NDArray[np.float64]:
    """Weights (2, r, k) of one species, which do not depend on the other species of the flora."""
    if name not in _found:
        rows = np.flatnonzero(flora.rows["species"] == number)

        def find_out() -> NDArray[np.float64]:
            fitted = fitted_weights(flora, np.array([number], np.int32))
            return np.stack([fitted.get(int(row), np.ones((2, len(COUNTS)))) for row in rows], axis=1)

        found = remembered("facet_weights", name, (2, len(rows), len(COUNTS)), find_out)
        if len(_found) >= _REMEMBERED:
            _found.clear()
        _found[name] = found
    return _found[name]


def digest(flora: Flora, number: int) -> str:
    """Fingerprint of a species of a flora: its parameters and the forms of its leaves."""
    return fingerprint(flora.rows[flora.rows["species"] == number], flora.forms[number], _METHOD)


@cache
def shipped() -> dict[str, dict[str, list[list[float]]]]:
    """Weights of the shipped species by `digest`: ``whole`` and ``own`` (r, k) as lists, and their ``species``."""
    try:
        return json.loads(TABLE.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}


def fitted_weights(
    flora: Flora, species: NDArray[np.int32]
) -> dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Weights (k,), (k,) by row of some species, of sub-plants and of what branches themselves bear."""
    few, out = COUNTS < _FEW, {}
    for siblings, counts in ((False, few), (True, ~few)):
        for row, families in _families(flora, species, siblings).items():
            apart = _apart(flora, families)
            sights = _Sight.of_subplants(flora, *apart), _Sight.of_branches(flora, *apart)
            for weights, sight in zip(out.setdefault(row, np.ones((2, len(COUNTS)))), sights, strict=True):
                weights[counts] = _fitted(sight)[counts]
    return out


def _families(flora: Flora, species: NDArray[np.int32], siblings: bool) -> dict[int, list[Branches]]:
    """Sub-plants of each row of some species that grow together, in a few plants or on a few parents of each row."""
    which = np.repeat(species, _FAMILIES)
    n = len(which)
    names = tuple(s.identifier for s in flora.species)
    seeds = Seeds(names, which, np.arange(n), np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), np.ones(n))
    level, plant, found = trunks(flora.rows, seeds), np.arange(n), {}
    parent = plant
    while len(level):
        some = []
        for row in np.unique(level.row):
            own, most = np.flatnonzero(level.row == row), _POLYGONS / _FAMILIES / max(flora.polygons[row], 1.0)
            choose = _siblings if siblings else _neighbours
            for members in choose(level, own, parent if siblings else plant, most):
                some.append(members)
                found.setdefault(int(row), []).append(level.take(members))
        chosen = np.concatenate(some)
        level, parent, _, _ = open_subplants(flora, level.take(chosen))
        plant = plant[chosen][parent]
    return {row: _affordable(flora, families) for row, families in found.items()}


def _siblings(
    level: Branches, own: NDArray[np.int64], parent: NDArray[np.int64], most: float
) -> Iterator[NDArray[np.int64]]:
    """Sub-plants in the middle of some parents."""
    members = int(np.clip(most, 1, _SIBLINGS))
    parents = np.unique(parent[own])
    for p in parents[np.argsort(mix(parents.astype(np.uint64)))[:_FAMILIES]]:
        born = own[parent[own] == p]
        first = (len(born) - min(members, len(born))) // 2
        yield born[first : first + members]


def _neighbours(
    level: Branches, own: NDArray[np.int64], plant: NDArray[np.int64], most: float
) -> Iterator[NDArray[np.int64]]:
    """Sub-plants next to one of each plant."""
    members = int(np.clip(most, 1, _NEIGHBOURS))
    for p in np.unique(plant[own]):
        kin = own[plant[own] == p]
        first = kin[np.argmin(mix(level.key[kin]))]
        away = np.linalg.norm(level.position[kin] - level.position[first], axis=1)
        yield kin[np.argsort(away, kind="stable")[:members]]


def _affordable(flora: Flora, families: list[Branches]) -> list[Branches]:
    """As many of the families as their polygons allow, and at least one."""
    families = [families[i] for i in np.argsort(mix(np.arange(len(families)).astype(np.uint64)))][:_FAMILIES]
    total = np.cumsum([flora.face_counts(family).sum() for family in families])
    return [family for family, sum_ in zip(families, total, strict=True) if sum_ <= _POLYGONS] or families[:1]


def _apart(flora: Flora, families: list[Branches]) -> tuple[Branches, NDArray[np.float64]]:
    """All families, so far from each other that no ray meets two of them, and the way (3,) beyond the last."""
    reach = np.hypot(flora.bound[:, 0], np.maximum(-flora.bound[:, 1], flora.bound[:, 2]))
    extent = max(float(np.ptp(f.position, axis=0).max() + 2 * (reach[f.row] * f.length).max()) for f in families)
    # Level, and long enough to stay apart in a view from a sixth above the horizon.
    step = 8.0 * extent * np.array([0.8, 0.6, 0.0])
    moved = [replace(f, position=f.position - f.position.mean(axis=0) + n * step) for n, f in enumerate(families)]
    return Branches.concatenate(moved), len(families) * step


def _fitted(sight: _Sight) -> NDArray[np.float64]:
    """Weights (k,) for one row."""
    out = np.full(len(COUNTS), np.nan)
    if sight.area.mean() <= 0.0:
        return np.ones(len(COUNTS))
    views = sight.views()
    met = sum(sight.met(view) for view in views)
    for k, count in enumerate(COUNTS):
        expected = count * len(sight.area)
        copies = int(np.clip(np.ceil(_WANTED / expected), 1, _COPIES))
        if expected * copies < _NEEDED or met == 0:
            continue
        side = np.sqrt(sight.area.mean() / count)
        facets = sight.facets(side, copies)
        out[k] = _weight(np.concatenate([sight.least_weights(view, facets) for view in views]), met * copies)
        if expected > _MOST or (sight.leaf > side**2).all():
            break
    known = np.flatnonzero(np.isfinite(out))
    return np.interp(np.arange(len(out)), known, out[known]) if len(known) else np.ones(len(out))


def _weight(least: NDArray[np.float64], met: int) -> float:
    """Weight with which ``met`` rays are blocked, from the least weight (n,) with which each ray is."""
    return float(np.partition(least, met - 1)[met - 1]) if met <= len(least) else _LARGEST


@dataclass(frozen=True)
class _View:
    """Parallel rays through the points of a lattice on the plane of two axes."""

    u: NDArray[np.float64]
    v: NDArray[np.float64]
    spacing: float

    def flat(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vectors (n, 3) on the plane (n, 2), in units of the lattice."""
        return vectors @ np.stack([self.u, self.v], axis=1) / self.spacing


@dataclass(frozen=True)
class _Sight:
    """Families of sub-plants, or what their branches themselves bear, as rays see it.

    Attributes
    ----------
    flora : Flora
    some : Branches of n
    beyond : (3,) float64
        Offset at which a copy meets none of them, metres.
    things : Things
        The real leaves and wood.
    area, leaf : (n,) float64
        Optical area of each, and area of one of its leaves, m².
    pieces : Pieces or None
        Of the branches, where only these count.
    """

    flora: Flora
    some: Branches
    beyond: NDArray[np.float64]
    things: Things
    area: NDArray[np.float64]
    leaf: NDArray[np.float64]
    pieces: Pieces | None

    @classmethod
    def of_subplants(cls, flora: Flora, some: Branches, beyond: NDArray[np.float64]) -> _Sight:
        """Whole sub-plants."""
        area = subplant_totals(flora, some).optical_area
        return cls(flora, some, beyond, _grown(flora, some), area, flora.one_leaf_area(some), None)

    @classmethod
    def of_branches(cls, flora: Flora, some: Branches, beyond: NDArray[np.float64]) -> _Sight:
        """Branches with their own leaves only."""
        pieces, owner = open_subplants(flora, some)[2:]
        area = np.bincount(owner, piece_totals(flora, pieces).optical_area, len(some))
        return cls(flora, some, beyond, _grown(flora, some, orders=1), area, flora.one_leaf_area(some), pieces)

    def views(self) -> list[_View]:
        """Directions spread over the half sphere, with a lattice that is as fine for all of them."""
        place = self.things.middle.T @ self.beyond
        along = np.floor(place / (self.beyond @ self.beyond) * _FAMILIES + 0.5)
        extent = 2.0 * float(self.things.radius.max())  # one straight branch has no extent but its own
        for family in np.unique(along):
            middle = self.things.middle[:, along == family]
            extent = max(extent, float(np.ptp(middle, axis=1).max()))
        index = np.arange(_DIRECTIONS) + 0.5
        directions = spiral(index / _DIRECTIONS, index, GOLDEN_TURN)
        return [_View(*basis(direction), extent / _RAYS) for direction in directions]

    def met(self, view: _View) -> int:
        """How many rays meet anything."""
        place = view.flat(self.things.middle.T)
        near = (np.abs(place - np.rint(place)) <= (self.things.radius / view.spacing)[:, None]).all(axis=1)
        begin, rays = 0, []
        for part in self.things.parts:
            end = begin + len(part)
            corners, first, number = part.outlines(np.flatnonzero(near[begin:end]), view.u, view.v)
            rays.append(covered(corners / view.spacing, first, number)[1])
            begin = end
        return len(np.unique(_ray_numbers(np.concatenate(rays))))

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

    @staticmethod
    def least_weights(view: _View, facets: Facets) -> NDArray[np.float64]:
        """For each ray that any of the facets can block, the least weight with which one does."""
        reach = CIRCUMRADIUS * facets.side[:, None]
        centre, a, b = view.flat(facets.centre), view.flat(facets.across * reach), view.flat(facets.along * reach)
        largest = np.sqrt(_LARGEST)
        across = SIN_60 * np.abs(a)
        low = np.ceil(centre - largest * np.maximum(across + np.abs(b) / 2, np.abs(b))).astype(np.int64)
        high = np.floor(centre + largest * np.maximum(across + np.abs(b) / 2, np.abs(b))).astype(np.int64)
        sizes = np.maximum(high - low + 1, 0)
        facet, step = spread(sizes[:, 0] * sizes[:, 1])
        columns = sizes[facet, 1]
        point = low[facet] + np.stack([step // columns, step % columns], axis=1)
        x, y = (point - centre[facet]).T
        (ax, ay), (bx, by) = a[facet].T, b[facet].T
        with np.errstate(divide="ignore", invalid="ignore"):
            aside, up = (x * by - y * bx) / (ax * by - ay * bx), (ax * y - ay * x) / (ax * by - ay * bx)
        # How many times as large the triangle has to be to reach the point: its sides are half a circumradius away.
        scale = 2.0 * np.maximum(-up, SIN_60 * np.abs(aside) + up / 2)
        inside = np.flatnonzero(scale <= largest)
        ray, which = np.unique(_ray_numbers(point[inside]), return_inverse=True)
        least = np.full(len(ray), np.inf)
        np.minimum.at(least, which.reshape(-1), scale[inside] ** 2)
        return least


def _grown(flora: Flora, some: Branches, orders: int | None = None) -> Things:
    """Leaves and wood of sub-plants of one species, of all orders or the given number."""
    rows = len(flora.rows)
    forms = flora.forms[int(flora.species_of(some.row[:1])[0])]
    return things_of(flora.rows, forms, some, np.zeros(rows, np.intp), 0, np.ones(rows), orders)


def _ray_numbers(point: NDArray[np.int64]) -> NDArray[np.int64]:
    return (point[:, 0] << 32) + point[:, 1]
