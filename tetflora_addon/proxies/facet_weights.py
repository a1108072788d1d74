# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights of facets: the fraction of its area that the facets of a sub-plant need to block as much light as it does.

Leaves sit in clusters and hide each other. A few large facets spread over the same sub-plant do so less: with the full
area they would be up to three times as opaque. Rays are cast through grown sub-plants of each row of a species and
through their facets, at several numbers of facets; with the right weight as many are blocked. Sub-plants are tested
together with all that grow around them, of any parent, because facets spill over: next siblings alone asked for up to
a twentieth more area. Facets of pieces are compared in the same way with what branches themselves bear.

Those of shipped species are tables, measured with all rays. Others are measured when their first facet is drawn, with
fewer rays where more would say the same: within .02 (`tests/engine/proxies/test_quick_weights.py`). They follow from
the species alone, so that no two frames of a film, and no two computers of a farm, have different ones.

Nobody measures anew for a day or an age. Plants with fewer leaves have greater weights, as less hides behind them: the
same species is measured with all of its leaves, some, and none (`SHARES`), and in a few stages of its life. The inverse
of a weight is nearly linear in the share of leaves that is left; between two ages it is so in their logarithm.
"""

import json
from collections.abc import Callable, Collection, Generator, Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Self

import numpy as np

from ..arrays import GOLDEN_TURN, Floats, Floats32, Integers, Mask, Table, spiral, spread
from ..compiled.clumping import PlantElements, basis, elements_of, fingerprint
from ..compiled.flora import Flora, compile_species
from ..growth.foliage import are_solids
from ..growth.growth import trunks
from ..growth.hashing import mix
from ..growth.seeds import LEAVES, WIDTH, Branches, Seeds
from ..jobs import mapped, run_to_end
from ..refinement.contents import piece_totals, subplant_totals
from ..species.ages import ages_of, with_age
from ..species.species import Species
from ..storage import cached
from ..subplants.pieces import Pieces, open_subplants
from .microsurfaces import CIRCUMRADIUS, SIN_60, FacetRules, Facets, by_number, piece_facets, subplant_facets

#: Weights of the shipped species, by ``python -m devtools.facet_tables``. Raise `_METHOD` when they are made otherwise.
TABLE = Path(__file__).resolve().parent.parent / "catalog" / "tables" / "facet_weights.json"
_METHOD = 3
#: Facets of a sub-plant for which weights are known; in between, weights are linear in the logarithm.
COUNTS = 2.0 ** np.arange(-4, 11)
#: Polygons of all families of a row, and the most members of one.
_POLYGONS, _NEIGHBORS = 150_000.0, 60
#: The same of solids of leaves, which have no parts that would tell as much with fewer.
_POLYGONS_OF_SOLIDS = 400_000.0
#: Facets for each number, over all families: copies are made up to the first; with fewer than the second a number is
#: skipped; after more than the third no larger number is tried.
_WANTED, _NEEDED, _MOST = 250.0, 60.0, 5_000.0
_COPIES = 16
#: Blocked rays that weights of other species follow from, about; facets, over all views, that may block each.
RAYS, _PAIRS = 6_000.0, 40.0
#: Name of the results in the cache folder. The first method, with all rays, had another.
_KIND = "facet_shares"


@dataclass(frozen=True)
class FacetWeights:
    """Fraction of their area that facets get, by row and number of facets."""

    #: whole and branch_only, (s, r, k): for the first s of `SHARES`, and each of `COUNTS`, of sub-plants, and of what
    #: branches themselves bear, by the facets of a whole branch.
    whole: Floats
    branch_only: Floats
    #: (r,): rows of which a branch has more facets than that: its leaves fill a solid and nothing else grows on it.
    #: Facets reach beyond its surface by a part of their side, so what is missing falls as the root of their number.
    solid: Mask | None = None

    def of_subplants(self, row: Integers, count: Floats, share: Floats | None = None) -> Floats:
        """Weights (n,) for sub-plants of rows (n,), numbers of facets (n,), and parts of their leaves (n,)."""
        return _with_share(self.whole, row, count, share)

    def of_pieces(self, row: Integers, count: Floats, share: Floats | None = None) -> Floats:
        """Weights (n,) for pieces of branches, by rows (n,) and the numbers of facets (n,) of whole branches."""
        out = _with_share(self.branch_only, row, count, share)
        if self.solid is None or not self.solid.any():
            return out
        return np.where(self.solid[row], 1.0 - (1.0 - out) * np.sqrt(COUNTS[-1] / np.maximum(count, COUNTS[-1])), out)


def _with_share(tables: Floats, row: Integers, count: Floats, share: Floats | None) -> Floats:
    """Weights (n,) between those of two shares, where the inverse is nearly linear in the share."""
    if share is None or len(tables) == 1:
        return by_number(tables[0], row, count, COUNTS)
    out, shares = by_number(tables[0], row, count, COUNTS), np.array(SHARES)
    # Parts that bear little besides cones or blossoms may have fewer leaves than any plant has.
    low = np.clip(np.searchsorted(-shares, -share), 1, len(tables) - 1)
    for node in np.unique(low[share != 1.0]).tolist():
        index = np.flatnonzero((low == node) & (share != 1.0))
        less, more = (1.0 / by_number(tables[i], row[index], count[index], COUNTS) for i in (node, node - 1))
        place = np.maximum(share[index] - shares[node], 0.0) / (shares[node - 1] - shares[node])
        out[index] = 1.0 / (less + place * (more - less))
    return out


#: Weights (2, r, k) of other species by digest: a scene is compiled anew for each refinement.
_measured: dict[str, Floats] = {}


def facet_weights(flora: Flora, species: Collection[int] | None = None) -> FacetWeights:
    """Weights for a flora, cached in memory, of some of its species (index) or of all; the others' are 1.

    Those of the shipped species are read from `TABLE`. Others take a second or two each, and are cached on disk too.
    """
    every = sorted(set(range(len(flora.species)) if species is None else species))
    run_to_end(measuring(flora, every))
    return _of_states(flora.in_leaf, tuple((number, _states_of(flora, number)) for number in every))


@lru_cache(maxsize=8)
def _of_states(flora: Flora, species: tuple[tuple[int, tuple[int, ...]], ...]) -> FacetWeights:
    number = 1 + max((state for _, states in species for state in states), default=0)
    weights = np.ones((2, number, len(flora.rows), len(COUNTS)))
    for one, states in species:
        table = _weights_of(flora, one, states, _known)
        weights[:, : table.shape[1], flora.rows["species"] == one] = table
    return FacetWeights(*weights, are_solids(flora.rows))


def unmeasured(flora: Flora) -> list[int]:
    """Species (index) whose weights, as of the day of the flora, nobody has measured yet."""
    return [n for n in range(len(flora.species)) if any(_known(*variant) is None for variant in needed(flora, n))]


def measuring(flora: Flora, species: Collection[int]) -> Generator[tuple[str, float], None, None]:
    """Measure weights that are not known yet; `facet_weights` has them afterward.

    Yields
    ------
    str, float
        Name of the species at work, and the fraction of its measurement that is done.
    """
    for number in sorted(set(species)):
        left = [variant for variant in needed(flora, number) if _known(*variant) is None]
        for i, (compiled, one) in enumerate(left):
            name, content = compiled.species[one].name, digest(compiled, one)
            steps = fitting(compiled, one, RAYS)
            table = yield from mapped(steps, lambda done, i=i, name=name, left=left: (name, (i + done) / len(left)))
            _measured[content] = cached(_KIND, content, table.shape, lambda table=table: table)


def _known(flora: Flora, number: int) -> Floats | None:
    """Weights (2, r, k) of one species, which do not depend on the others of the flora; None if nobody has measured."""
    name = digest(flora, number)
    table = shipped().get(name)
    if table is not None:
        return table.astype(np.float64)
    if name not in _measured:
        stored = cached(_KIND, name, (2, int((flora.rows["species"] == number).sum()), len(COUNTS)), lambda: None)
        if stored is None:
            return None
        _measured[name] = stored
    return _measured[name]


def digest(flora: Flora, number: int) -> str:
    """Fingerprint of a species of a flora: its parameters and the forms of its leaves."""
    return fingerprint(flora.rows[flora.rows["species"] == number], flora.forms[number], _METHOD)


@cache
def shipped() -> dict[str, Floats32]:
    """Weights (2, r, k) of the shipped species and their variants by `digest`."""
    table = json.loads(TABLE.read_text(encoding="utf-8"))
    return {digest: np.array([one["whole"], one["own"]], np.float32) for digest, one in table.items()}


def fitting(flora: Flora, number: int, rays: float = np.inf) -> Generator[float, None, Floats]:
    """Measure the weights (2, r, k) of one species: of sub-plants, and of what branches themselves bear.

    Parameters
    ----------
    rays : float
        Blocked rays that each weight is to follow from, about; the lattice is made coarser where there are more.

    Yields
    ------
    float
        Fraction that is done.
    """
    rows = np.flatnonzero(flora.rows["species"] == number)
    out, seen, done, every = np.ones((2, len(rows), len(COUNTS))), {}, 0, 2 * len(rows)
    for row, families in _families(flora, number).items():
        apart = _apart(flora, families)
        for kind, make in enumerate((SiblingGroups.of_subplants, SiblingGroups.of_branches)):
            steps = _fitted(make(flora, *apart), rays, seen)
            out[kind, row - rows[0]] = yield from mapped(steps, lambda part, done=done: min((done + part) / every, 1.0))
            done += 1
    return out


def _families(flora: Flora, number: int) -> dict[int, list[Branches]]:
    """Sub-plants of each row of a species that grow together, in a few plants."""
    level, plant, by_row = trunks(flora.rows, Seeds.upright(FAMILIES, number)), np.arange(FAMILIES), {}
    while len(level):
        groups = []
        for row in np.unique(level.row):
            subplants, most = np.flatnonzero(level.row == row), _POLYGONS / FAMILIES / max(flora.polygons[row], 1.0)
            for members in _neighbors(level, subplants, plant, most):
                groups.append(members)
                by_row.setdefault(int(row), []).append(level.take(members))
        chosen = np.concatenate(groups)
        level, parent, _, _ = open_subplants(flora, level.take(chosen))
        plant = plant[chosen][parent]
    return {row: _affordable(flora, families) for row, families in by_row.items()}


def _neighbors(level: Branches, subplants: Integers, plant: Integers, most: float) -> Iterator[Integers]:
    """Sub-plants next to one of each plant."""
    members = int(np.clip(most, 1, _NEIGHBORS))
    for p in np.unique(plant[subplants]):
        kin = subplants[plant[subplants] == p]
        away = np.linalg.norm(level.position[kin] - level.position[kin[np.argmin(mix(level.key[kin]))]], axis=1)
        yield kin[np.argsort(away, kind="stable")[:members]]


def _affordable(flora: Flora, families: list[Branches]) -> list[Branches]:
    """As many of the families as their polygons allow, and at least one."""
    families = [families[i] for i in np.argsort(mix(np.arange(len(families)).astype(np.uint64)))][:FAMILIES]
    total = np.cumsum([flora.face_counts(family).sum() for family in families])
    most = _POLYGONS_OF_SOLIDS if are_solids(flora.rows)[families[0].row[0]] else _POLYGONS
    return [family for family, sum_ in zip(families, total, strict=True) if sum_ <= most] or families[:1]


def _apart(flora: Flora, families: list[Branches]) -> tuple[Branches, Floats]:
    """All families, so far from each other that no ray meets two of them, and the way (3,) beyond the last."""
    reach = np.hypot(flora.bound[:, 0], np.maximum(-flora.bound[:, 1], flora.bound[:, 2]))
    extent = max(float(np.ptp(f.position, axis=0).max() + 2 * (reach[f.row] * f.length).max()) for f in families)
    # Level, and long enough to stay apart in a view from a sixth above the horizon.
    step = 8.0 * extent * np.array([0.8, 0.6, 0.0])
    moved = [replace(f, position=f.position - f.position.mean(axis=0) + n * step) for n, f in enumerate(families)]
    return Branches.concatenate(moved), len(families) * step


def _fitted(
    sight: "SiblingGroups", rays: float, seen: "dict[object, list[tuple[View, Integers]]]"
) -> Generator[float, None, Floats]:
    """Weights (k,) for one row, by what rays meet, which ``seen`` remembers; yields the fraction that is done."""
    out = np.full(len(COUNTS), np.nan)
    if sight.area.mean() <= 0.0:
        return np.ones(len(COUNTS))
    if sight.content not in seen:
        looked = []
        for view in _cast_rays(sight.grown(), sight.beyond):
            looked.append(view)
            yield 0.05 * len(looked)
        seen[sight.content] = looked
    views, met = zip(*seen[sight.content], strict=True)
    for k, count in enumerate(COUNTS.tolist()):
        expected = count * len(sight.area)
        copies = int(np.clip(np.ceil(_WANTED / expected), 1, _COPIES))
        if expected * copies < _NEEDED or not any(map(len, met)):
            continue
        side = np.sqrt(sight.area.mean() / count)
        facets = sight.facets(side, copies)
        blocked = copies * sum(map(len, met))
        stride = _stride(blocked, rays, views[0].covered(facets))
        coarser = (replace(view, spacing=view.spacing * stride) for view in views)
        least = [least_weights(view, facets) for view in coarser]
        least, number = np.concatenate(least), max(round(blocked / stride**2), 1)
        out[k] = np.partition(least, number - 1)[number - 1] if number <= len(least) else LARGEST
        yield 0.5 + 0.5 * (k + 1) / len(COUNTS)
        if expected > _MOST or (sight.leaf > side**2).all():
            break
    known = np.flatnonzero(np.isfinite(out))
    return np.interp(np.arange(len(out)), known, out[known]) if len(known) else np.ones(len(out))


def _stride(blocked: float, rays: float, pairs: float) -> int:
    """Each so many-th line of the lattice that is enough, given how many rays are blocked, and by how many facets."""
    if not np.isfinite(rays):
        return 1
    most = np.sqrt(max(blocked / rays, pairs / (_PAIRS * rays)))
    return int(np.clip(most, 1.0, max(1.0, np.sqrt(4.0 * blocked / rays))))


#: Siblings that are seen side by side, at most.
FAMILIES = 6
#: Rays across a family, and directions of rays.
_RAYS, _DIRECTIONS = 36, 6
#: Maximum weight.
LARGEST = 1.6


@dataclass(frozen=True)
class View:
    """Parallel rays through the points of a lattice on the plane of two axes."""

    u: Floats
    v: Floats
    spacing: float

    def flat(self, vectors: Floats) -> Floats:
        """Vectors (n, 3) on the plane (n, 2), in units of the lattice."""
        return vectors @ np.stack([self.u, self.v], axis=1) / self.spacing

    def covered(self, facets: Facets) -> float:
        """How many rays facets of the maximum weight block, from all directions, one behind the other."""
        return 0.5 * _DIRECTIONS * LARGEST * float((facets.side**2).sum()) / self.spacing**2


@dataclass(frozen=True)
class SiblingGroups:
    """Siblings of sub-plants, or what their branches themselves bear."""

    flora: Flora
    kin: Branches  # of n
    beyond: Floats  # (3,): offset at which a copy meets none of them, meters
    #: area and leaf, (n,): optical area of each, and area of one of its leaves, m².
    area: Floats
    leaf: Floats
    pieces: Pieces | None  # of the branches, where only these count

    @classmethod
    def of_subplants(cls, flora: Flora, kin: Branches, beyond: Floats) -> Self:
        """Whole sub-plants."""
        return cls(flora, kin, beyond, subplant_totals(flora, kin).optical_area, flora.one_leaf_area(kin), None)

    @classmethod
    def of_branches(cls, flora: Flora, kin: Branches, beyond: Floats) -> Self:
        """Branches with their own leaves only."""
        pieces, owner = open_subplants(flora, kin)[2:]
        area = np.bincount(owner, piece_totals(flora, pieces).optical_area, len(kin))
        return cls(flora, kin, beyond, area, flora.one_leaf_area(kin), pieces)

    @property
    def content(self) -> tuple[bytes, bool]:
        """What follows from all that is grown: equal for whole sub-plants and branches on which nothing grows."""
        rows = self.flora.rows[np.unique(self.kin.row)]
        bare = not ((rows["next"] >= 0).any() or rows["phantom"].any())
        return self.kin.key.tobytes() + self.kin.position.tobytes(), bare or self.pieces is not None

    def grown(self) -> PlantElements:
        """The real leaves and wood."""
        forms = self.flora.forms[int(self.flora.species_of(self.kin.row[:1])[0])]
        rows, orders = len(self.flora.rows), -1 if self.pieces is None else 1
        return elements_of(self.flora.rows, forms, self.kin, np.zeros(rows, np.intp), 0, np.ones(rows), orders)

    def facets(self, side: float, copies: int) -> Facets:
        """Facets of a side in meters for several copies of all side by side, each copy with other facets."""
        if self.pieces is None:
            several = Branches.concatenate([self._copy(self.kin, n) for n in range(copies)])
            return subplant_facets(self.flora, several, FacetRules(np.full(len(several), side)))
        several = []
        for n in range(copies):
            start, end = (place + n * self.beyond for place in (self.pieces.start, self.pieces.end))
            several.append(replace(self.pieces, branches=self._copy(self.pieces.branches, n), start=start, end=end))
        pieces = Pieces.concatenate(several)
        return piece_facets(self.flora, pieces, FacetRules(np.full(len(pieces), side)))

    def _copy(self, branches: Branches, number: int) -> Branches:
        key = mix(branches.key + np.uint64(number + 1))
        return replace(branches, key=key, position=branches.position + number * self.beyond)


def _cast_rays(things: PlantElements, beyond: Floats) -> Iterator[tuple[View, Integers]]:
    """Views of families from all around, and the numbers (m,) of the rays of each that meet anything."""
    along = np.floor(beyond @ things.middle / (beyond @ beyond) * FAMILIES + 0.5)
    extent = 2.0 * float(things.radius.max())  # one straight branch has no extent but its own
    for family in np.unique(along):
        extent = max(extent, float(np.ptp(things.middle[:, along == family], axis=1).max()))
    index = np.arange(_DIRECTIONS) + 0.5
    for direction in spiral(index / _DIRECTIONS, index, GOLDEN_TURN):
        view = View(*basis(direction), extent / _RAYS)
        place = view.flat(things.middle.T)
        near = (np.abs(place - np.rint(place)) <= (things.radius / view.spacing)[:, None]).all(axis=1)
        yield view, np.unique(_ray_numbers(*things.covered(near, view.u, view.v, view.spacing).T))


def least_weights(view: View, facets: Facets) -> Floats:
    """For each ray that any of the facets can block, the least weight with which one does."""
    reach, largest = CIRCUMRADIUS * facets.side[:, None], np.sqrt(LARGEST)
    center, a, b = (view.flat(v).T for v in (facets.center, facets.across * reach, facets.along * reach))
    # A triangle's sides are where these three numbers are 1: each is linear in x and y, and grows by x and y by (3, n).
    with np.errstate(divide="ignore", invalid="ignore"):
        aside, up = np.stack([[b[1], -b[0]], [-a[1], a[0]]]) / (a[0] * b[1] - a[1] * b[0])
    grow = 2.0 * SIN_60 * aside
    by_x, by_y = (np.stack([-2.0 * u, u + v, u - v]) for u, v in zip(up, grow, strict=True))
    wide = SIN_60 * np.abs(a[0])
    low = np.ceil(center[0] + largest * np.minimum(b[0], -b[0] / 2 - wide)).astype(np.int64)
    high = np.floor(center[0] + largest * np.maximum(b[0], -b[0] / 2 + wide)).astype(np.int64)
    facet, step = spread(np.maximum(high - low + 1, 0))
    # On each line of the lattice, rays from where the last of the sides is entered to where the first is left.
    column = low[facet] + step
    intercept, slope = by_x.take(facet, axis=1) * (column - center[0][facet]), by_y.take(facet, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (largest - intercept) / slope
    enter = np.where(slope < 0, ends, -np.inf).max(axis=0) + center[1][facet]
    leave = np.where(slope > 0, ends, np.inf).min(axis=0) + center[1][facet]
    first = np.ceil(np.where(enter <= leave, enter, 0.0)).astype(np.int64)
    last = np.floor(np.where(enter <= leave, leave, -1.0)).astype(np.int64)
    line, step = spread(np.maximum(last - first + 1, 0))
    row = first[line] + step
    # How many times as large the triangle has to be to reach the ray.
    up = row - center[1][facet[line]]
    scale = np.maximum.reduce([i.take(line) + s.take(line) * up for i, s in zip(intercept, slope, strict=True)])
    inside = np.flatnonzero(scale <= largest)  # a side along the line has neither been entered nor left
    ray, scale = _ray_numbers(column[line[inside]], row[inside]), scale[inside]
    order = np.argsort(ray, kind="stable")
    begin = np.flatnonzero(np.diff(ray[order], prepend=np.iinfo(np.int64).min))
    return np.minimum.reduceat(scale[order], begin) ** 2 if len(begin) else np.zeros(0)


def _ray_numbers(column: Integers, row: Integers) -> Integers:
    return (column << 32) + row


SHARES = (1.0, 0.4, 0.1, 0.0)
"""Parts of their leaves that plants have, of which weights are measured."""
#: Leaves over those with which plants were measured, up to which the inverse of weights goes on in a line.
DENSEST = 4.0
#: Power of how dense a narrow crown is with which its limbs are. With .5, refined oak woods are a fifth too dark inside
#: (``python -m benchmarks light_inside``); with 1, limbs of beeches let up to a third more through than their leaves.
_IN_LIMBS = 0.75
#: Ages of which weights are measured: fractions of the full one, of the lifespan, and years after death.
_YOUNG, _OLD, _DEAD = (0.04, 0.1, 0.25, 0.5), (0.9, 0.995), (1.0, 8.0, 30.0)
#: No plant has weights beyond, however few leaves it has.
_LOWEST_WEIGHT, _HIGHEST_WEIGHT = 0.02, 1.8

#: Weights (2, r, k) of a species (index) of a flora.
Known = Callable[[Flora, int], Floats]


def leaf_shares(flora: Flora, subplants: Branches) -> Floats | None:
    """Leaves (n,) of sub-plants over those with which they were measured, on their day; None where all have as many.

    In narrow crowns of a dense stand, seen as a whole, they lie the closer together.
    """
    share = None if subplants.year is None else flora.day.leaf_share(subplants)
    crowded = np.array([one.crowded for one in flora.species])[flora.species_of(subplants.row)]
    if subplants.crown is None or not crowded.any():
        return share
    rows, row, crown = flora.rows, subplants.row, subplants.crown.astype(np.float64)
    denser = np.minimum(crown[:, LEAVES] / np.maximum(crown[:, WIDTH], 1e-3) ** 2, DENSEST)
    # Of what is more, twigs that stand closer are a part, and leaves on each the rest.
    whole = (rows["order"][row] == 0) & ~rows["continues"][row]
    leafiness = np.where(crowded, np.where(whole, denser, denser**_IN_LIMBS), 1.0)
    return leafiness if share is None else share * leafiness


def _states_of(flora: Flora, number: int) -> tuple[int, ...]:
    """Indices of `SHARES` between which plants of a species are on the day of a flora, or in a dense stand."""
    low, high = (1.0, 1.0) if flora.day is None else flora.day.share_range(flora.rows, number)
    shares = np.array(SHARES)
    first = int(np.flatnonzero(shares >= min(high, 1.0) - 1e-9)[-1])
    last = int(np.flatnonzero(shares <= low + 1e-9)[0])
    return tuple(range(first, max(last, int(flora.species[number].crowded)) + 1))


def ages_measured(species: Species) -> list[float]:
    """Ages of which weights are measured, rising; 0.0 stands for the full one."""
    ages = ages_of(species)
    if ages.scaled or species.skeleton is not None:
        return [0.0]
    pairs = [(part * ages.full, part * ages.full) for part in _YOUNG] + [(ages.full, 0.0)]
    if np.isfinite(ages.lifespan):
        pairs += [(y, y) for y in (part * ages.lifespan for part in _OLD) if y > ages.full]
        pairs += [(y, y) for y in (ages.lifespan + after for after in _DEAD)]
    return [years for _, years in sorted(pairs)]


def needed(flora: Flora, number: int) -> list[tuple[Flora, int]]:
    """What has to be known for the weights of a species of a flora on its day, in summer or not."""
    asked: dict[tuple[Flora, int], None] = {}

    def known(compiled: Flora, one: int) -> Floats:
        asked[compiled, one] = None
        return np.ones((2, int((compiled.rows["species"] == one).sum()), len(COUNTS)))

    _weights_of(flora.in_leaf, number, _states_of(flora, number), known)
    return list(asked)


def _weights_of(flora: Flora, number: int, states: tuple[int, ...], known: Known) -> Floats:
    """Weights (2, s, r, k) of a species of a flora in summer, in some states of `SHARES`; 1 in the others."""
    species, rows = flora.species[number], flora.rows[flora.rows["species"] == number]
    out = np.ones((2, max(states) + 1, len(rows), len(COUNTS)))
    if species.aged is None:
        for state in states:
            out[:, state] = known(flora, number) if state == 0 else known(with_leaves(species, SHARES[state]), 0)
        return out
    described, years = species.aged

    def inverse(compiled: Flora) -> Floats:
        return 1.0 / np.clip(known(compiled, 0)[:, _alike(rows, compiled.rows)], _LOWEST_WEIGHT, _HIGHEST_WEIGHT)

    around, place = _around(described, years)
    ends = [inverse(compiled_at_age(described, one)) for one in around]
    grown = ends[0] + place * (ends[-1] - ends[0])
    out[:, 0] = 1.0 / grown if 0 in states else 1.0
    full = compiled_at_age(described, 0.0)
    for state in sorted({*states} - {0}):
        # Leaves that are gone change as much of what hides behind others as when the plant is full-grown.
        all_leaves, few_leaves = inverse(full), inverse(with_leaves(full.species[0], SHARES[state]))
        left = np.clip((few_leaves - all_leaves) / np.maximum(all_leaves - 1.0, 0.05), -1.0, 0.5)
        less = grown + left * np.maximum(grown - 1.0, 0.05)
        out[:, state] = 1.0 / np.clip(less, 1.0 / _HIGHEST_WEIGHT, 1.0 / _LOWEST_WEIGHT)
    return out


def _around(described: Species, years: float) -> tuple[list[float], float]:
    """One or two of the `ages_measured` around an age, and its place between them, 0 to 1."""
    ages = ages_measured(described)
    real = np.array([ages_of(described).full if one == 0.0 else one for one in ages])
    if len(ages) == 1:
        return ages, 0.0
    high = int(np.clip(np.searchsorted(real, years), 1, len(real) - 1))
    low, dies = real[high - 1], ages_of(described).lifespan
    if low < dies <= real[high]:  # it dies at once
        return [ages[high if years >= dies else high - 1]], 0.0
    place = np.log(max(years, 1e-3) / low) / np.log(real[high] / low)
    return [ages[high - 1], ages[high]], float(np.clip(place, 0.0, 1.0))


def _alike(rows: Table, other: Table) -> Integers:
    """For each row (r,) of a species, that of a variant which is its order and the nearest part of it."""
    out = np.zeros(len(rows), np.int64)
    for order in np.unique(rows["order"]):
        parts, matches = np.flatnonzero(rows["order"] == order), np.flatnonzero(other["order"] == order)
        if not len(matches):  # none of these branches yet, or no more
            matches = np.flatnonzero(other["order"] <= order)[-1:]
        away = np.abs(rows["part"][parts].mean(axis=1)[:, None] - other["part"][matches].mean(axis=1))
        out[parts] = matches[np.argmin(away, axis=1)]
    return out


@lru_cache(maxsize=64)
def compiled_at_age(described: Species, years: float) -> Flora:
    """A species at an age, compiled; 0.0 stands for the full one."""
    return compile_species([with_age(described, years)])


@lru_cache(maxsize=64)
def with_leaves(species: Species, share: float) -> Flora:
    """A compiled species with a part of its leaves."""
    # What is compiled has its quality and habit already.
    species = replace(species, quality=1.0, habit=0.0)
    if share != 1.0:
        spur = species.spur and replace(species.spur, leaves=species.spur.leaves.scaled(share))
        orders = tuple(replace(order, leaves=order.leaves.scaled(share)) for order in species.orders)
        species = replace(species, orders=orders, spur=spur)
    return compile_species([species])
