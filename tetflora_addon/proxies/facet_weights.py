# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights of facets: the fraction of its area that the facets of a sub-plant need to block as much light as it does.

Leaves sit in clusters and hide each other. A few large facets spread over the same sub-plant do so less: with the full
area they would be up to three times as opaque. Rays are cast through grown sub-plants of each row of a species and
through their facets, at several numbers of facets; with the right weight as many rays are blocked. Weights are for
facets what `compiled.clumping` is for evenly filled cells.

Those of shipped species are tables, measured with all rays. Others, new or changed by an artist, are measured when
their first facet is drawn, in steps of a fraction of a second, with fewer rays where more would say the same: within
.02 of what all rays say (`tests/engine/proxies/test_quick_weights.py`). They follow from the species alone and are
never refined later, so that no two frames of a film, and no two computers of a farm, have different ones.

Sub-plants are tested together with all that grow around them, of any parent, because facets spill over and reach
across the gaps between neighbours. Next siblings alone asked for up to a twentieth more area, and made aspens too
dense. Facets of pieces are compared in the same way with what branches themselves bear.

What a day of the year or another age makes of a species lies between variants that are measured, `weight_variants`.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Generator, Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..compiled.flora import Flora
from ..growth.branches import Branches
from ..growth.envelopes import are_solids
from ..growth.growth import trunks
from ..growth.hashing import mix
from ..growth.seeds import Seeds
from ..jobs import at_once
from ..species.fingerprints import fingerprint
from ..storage import remembered
from ..subplants.pieces import open_subplants
from .sights import FAMILIES, LARGEST, Families, View, least_weights, look
from .weight_variants import SHARES, needed, states_of, weights_of

#: Weights of the shipped species, made by ``python -m devtools.facet_tables``. Raise `_METHOD` when facets or weights
#: are made differently.
TABLE = Path(__file__).resolve().parent.parent / "catalogue" / "tables" / "facet_weights.json"
_METHOD = 3
#: Facets of a sub-plant for which weights are known; in between, weights are linear in the logarithm.
COUNTS = 2.0 ** np.arange(-4, 11)
#: Polygons of all families of a row, and the most members of one.
_POLYGONS, _NEIGHBOURS = 150_000.0, 60
#: The same of solids of leaves, which have no parts that would tell as much with fewer.
_POLYGONS_OF_SOLIDS = 400_000.0
#: Facets for each number, over all families: copies are made up to the first; with fewer than the second a number is
#: skipped; after more than the third no larger number is tried.
_WANTED, _NEEDED, _MOST = 250.0, 60.0, 5_000.0
_COPIES = 16
#: Blocked rays from which the weights of species that are not shipped follow, about; and the facets, over all views,
#: that may lie in the way of each.
RAYS, _PAIRS = 6_000.0, 40.0
#: Name of the results in the cache folder. The first method, with all rays, had another.
_KIND = "facet_shares"


@dataclass(frozen=True)
class FacetWeights:
    """Fraction of their area that facets get, by row and number of facets.

    Attributes
    ----------
    whole, own : (s, r, k) float64
        For the first s of `SHARES`, and each of `COUNTS`, of sub-plants, and of what branches themselves bear, by the
        facets of a whole branch.
    solid : (r,) bool, optional
        Rows of which a branch has more facets than that: its leaves fill a solid and nothing else grows on it. Facets
        reach beyond its surface by a part of their side, so what is missing falls as the root of their number.
    """

    whole: NDArray[np.float64]
    own: NDArray[np.float64]
    solid: NDArray[np.bool_] | None = None

    def of_subplants(
        self, row: NDArray[np.integer], count: NDArray[np.float64], share: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Weights (n,) for sub-plants of rows (n,), numbers of facets (n,), and parts of their leaves (n,)."""
        return _with_share(self.whole, row, count, share)

    def of_pieces(
        self, row: NDArray[np.integer], count: NDArray[np.float64], share: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Weights (n,) for pieces of branches, by rows (n,) and the numbers of facets (n,) of whole branches."""
        out = _with_share(self.own, row, count, share)
        if self.solid is None or not self.solid.any():
            return out
        return np.where(self.solid[row], 1.0 - (1.0 - out) * np.sqrt(COUNTS[-1] / np.maximum(count, COUNTS[-1])), out)


def _with_share(
    tables: NDArray[np.float64], row: NDArray[np.integer], count: NDArray[np.float64], share: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Weights (n,) between those of two shares, where the inverse is nearly linear in the share."""
    if share is None or len(tables) == 1:
        return _between(tables[0], row, count)
    out, shares = _between(tables[0], row, count), np.array(SHARES)
    # Parts that bear little besides cones or blossoms may have fewer leaves than any plant has.
    low = np.clip(np.searchsorted(-shares, -share), 1, len(tables) - 1)
    for node in np.unique(low[share < 1.0]).tolist():
        some = np.flatnonzero((low == node) & (share < 1.0))
        less, more = (1.0 / _between(tables[i], row[some], count[some]) for i in (node, node - 1))
        place = np.maximum(share[some] - shares[node], 0.0) / (shares[node - 1] - shares[node])
        out[some] = 1.0 / (less + place * (more - less))
    return out


def _between(table: NDArray[np.float64], row: NDArray[np.integer], count: NDArray[np.float64]) -> NDArray[np.float64]:
    place = np.log(np.maximum(count, 1e-12) / COUNTS[0]) / np.log(COUNTS[1] / COUNTS[0])
    place = np.clip(place, 0.0, len(COUNTS) - 1.0)
    low = np.minimum(place.astype(np.int64), len(COUNTS) - 2)
    return table[row, low] + (place - low) * (table[row, low + 1] - table[row, low])


#: Weights (2, r, k) of other species by digest: a scene is compiled anew for each refinement.
_found: dict[str, NDArray[np.float64]] = {}
_REMEMBERED = 256


def facet_weights(flora: Flora, species: Collection[int] | None = None) -> FacetWeights:
    """Weights for a flora, cached in memory, of some of its species (index) or of all; the others' are 1.

    Those of the shipped species are read from `TABLE`. Others take a second or two each, and are cached on disk too.
    """
    every = sorted(set(range(len(flora.species)) if species is None else species))
    return _of_states(flora.in_leaf, tuple((number, states_of(flora, number)) for number in every))


@lru_cache(maxsize=8)
def _of_states(flora: Flora, species: tuple[tuple[int, tuple[int, ...]], ...]) -> FacetWeights:
    number = 1 + max((state for _, states in species for state in states), default=0)
    weights = np.ones((2, number, len(flora.rows), len(COUNTS)))
    for one, states in species:
        found = weights_of(flora, one, states, _found_of)
        weights[:, : found.shape[1], flora.rows["species"] == one] = found
    return FacetWeights(*weights, are_solids(flora.rows))


def _found_of(flora: Flora, number: int) -> NDArray[np.float64]:
    """Weights (2, r, k) of one species, measured if need be."""
    at_once(_measuring(flora, number))
    return _known(flora, number)


def unmeasured(flora: Flora) -> list[int]:
    """Species (index) whose weights, as of the day of the flora, nobody has measured yet."""
    every = range(len(flora.species))
    return [n for n in every if any(_known(*variant) is None for variant in needed(flora, n))]


def measuring(flora: Flora, species: Collection[int]) -> Generator[tuple[str, float], None, None]:
    """Measure weights that are not known yet; `facet_weights` has them afterwards.

    Yields
    ------
    str, float
        Name of the species at work, and the fraction of its measurement that is done.
    """
    for number in sorted(set(species) & set(unmeasured(flora))):
        every = needed(flora, number)
        for i, variant in enumerate(every):
            for name, done in _measuring(*variant):
                yield name, (i + done) / len(every)


def _measuring(flora: Flora, number: int) -> Generator[tuple[str, float], None, None]:
    """Measure the weights of one species, unless they are known."""
    if _known(flora, number) is not None:
        return
    work, name = fitting(flora, number, RAYS), flora.species[number].name
    while True:
        try:
            yield name, next(work)
        except StopIteration as stop:
            found = stop.value
            break
    content = digest(flora, number)
    _keep(content, remembered(_KIND, content, found.shape, lambda: found))


def _known(flora: Flora, number: int) -> NDArray[np.float64] | None:
    """Weights (2, r, k) of one species, which do not depend on the others of the flora; None if nobody has measured."""
    name = digest(flora, number)
    table = shipped().get(name)
    if table is not None:
        return table.astype(np.float64)
    if name not in _found:
        rows = int((flora.rows["species"] == number).sum())
        try:
            _keep(name, remembered(_KIND, name, (2, rows, len(COUNTS)), _unknown))
        except LookupError:
            return None
    return _found[name]


def _unknown() -> NDArray[np.float64]:
    raise LookupError("not measured yet")


def _keep(name: str, found: NDArray[np.float64]) -> None:
    if len(_found) >= _REMEMBERED:
        _found.clear()
    _found[name] = found


def digest(flora: Flora, number: int) -> str:
    """Fingerprint of a species of a flora: its parameters and the forms of its leaves."""
    return fingerprint(flora.rows[flora.rows["species"] == number], flora.forms[number], _METHOD)


@cache
def shipped() -> dict[str, NDArray[np.float32]]:
    """Weights (2, r, k) of the shipped species and their variants by `digest`."""
    try:
        table = json.loads(TABLE.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    return {digest: np.array([one["whole"], one["own"]], np.float32) for digest, one in table.items()}


def fitting(flora: Flora, number: int, rays: float = np.inf) -> Generator[float, None, NDArray[np.float64]]:
    """Measure the weights (2, r, k) of one species: of sub-plants, and of what branches themselves bear.

    Parameters
    ----------
    flora : Flora
    number : int
        Index of the species.
    rays : float
        Blocked rays that each weight is to follow from, about; the lattice is made coarser where there are more.

    Yields
    ------
    float
        Fraction that is done.
    """
    rows = np.flatnonzero(flora.rows["species"] == number)
    out, seen, done = np.ones((2, len(rows), len(COUNTS))), {}, 0
    for row, families in _families(flora, number).items():
        apart = _apart(flora, families)
        for kind, make in enumerate((Families.of_subplants, Families.of_branches)):
            fitted = _fitted(make(flora, *apart), rays, seen)
            while True:
                try:
                    yield min((done + next(fitted)) / (2 * len(rows)), 1.0)
                except StopIteration as stop:
                    out[kind, row - rows[0]] = stop.value
                    break
            done += 1
    return out


def _families(flora: Flora, number: int) -> dict[int, list[Branches]]:
    """Sub-plants of each row of a species that grow together, in a few plants."""
    n = FAMILIES
    which = np.full(n, number, np.int32)
    names = tuple(s.identifier for s in flora.species)
    seeds = Seeds(names, which, np.arange(n), np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), np.ones(n))
    level, plant, found = trunks(flora.rows, seeds), np.arange(n), {}
    while len(level):
        some = []
        for row in np.unique(level.row):
            own, most = np.flatnonzero(level.row == row), _POLYGONS / FAMILIES / max(flora.polygons[row], 1.0)
            for members in _neighbours(level, own, plant, most):
                some.append(members)
                found.setdefault(int(row), []).append(level.take(members))
        chosen = np.concatenate(some)
        level, parent, _, _ = open_subplants(flora, level.take(chosen))
        plant = plant[chosen][parent]
    return {row: _affordable(flora, families) for row, families in found.items()}


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
    families = [families[i] for i in np.argsort(mix(np.arange(len(families)).astype(np.uint64)))][:FAMILIES]
    total = np.cumsum([flora.face_counts(family).sum() for family in families])
    most = _POLYGONS_OF_SOLIDS if are_solids(flora.rows)[families[0].row[0]] else _POLYGONS
    return [family for family, sum_ in zip(families, total, strict=True) if sum_ <= most] or families[:1]


def _apart(flora: Flora, families: list[Branches]) -> tuple[Branches, NDArray[np.float64]]:
    """All families, so far from each other that no ray meets two of them, and the way (3,) beyond the last."""
    reach = np.hypot(flora.bound[:, 0], np.maximum(-flora.bound[:, 1], flora.bound[:, 2]))
    extent = max(float(np.ptp(f.position, axis=0).max() + 2 * (reach[f.row] * f.length).max()) for f in families)
    # Level, and long enough to stay apart in a view from a sixth above the horizon.
    step = 8.0 * extent * np.array([0.8, 0.6, 0.0])
    moved = [replace(f, position=f.position - f.position.mean(axis=0) + n * step) for n, f in enumerate(families)]
    return Branches.concatenate(moved), len(families) * step


def _fitted(
    sight: Families,
    rays: float,
    seen: dict[object, list[tuple[View, NDArray[np.int64]]]],
) -> Generator[float, None, NDArray[np.float64]]:
    """Weights (k,) for one row; yields the fraction that is done.

    What rays meet is looked up in ``seen``, and noted there.
    """
    out = np.full(len(COUNTS), np.nan)
    if sight.area.mean() <= 0.0:
        return np.ones(len(COUNTS))
    if sight.content not in seen:
        looked = []
        for view in look(sight.grown(), sight.beyond):
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
        least = [least_weights(view.coarser(stride), facets) for view in views]
        out[k] = _weight(np.concatenate(least), max(round(blocked / stride**2), 1))
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


def _weight(least: NDArray[np.float64], met: int) -> float:
    """Weight with which ``met`` rays are blocked, from the least weight (n,) with which each ray is."""
    return float(np.partition(least, met - 1)[met - 1]) if met <= len(least) else LARGEST
