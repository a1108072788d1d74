# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Variants of species of which weights of facets are measured, and what lies between them.

Nobody measures anew for a day or an age. Plants with fewer leaves have greater weights, as less hides behind them: the
same species is measured with all of its leaves, some, and none (`SHARES`), and in a few stages of its life. The inverse
of a weight is nearly linear in the share of leaves that is left; between two ages it is so in their logarithm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..compiled.flora import Flora, compile_species
from ..species.ages import ages_of, with_age
from ..species.species import Order, Range, Species

SHARES = (1.0, 0.4, 0.1, 0.0)
"""Parts of their leaves that plants have, of which weights are measured."""
#: Ages of which weights are measured: fractions of the full one, of the lifespan, and years after death.
_YOUNG, _OLD, _DEAD = (0.04, 0.1, 0.25, 0.5), (0.9, 0.995), (1.0, 8.0, 30.0)
#: No plant has weights beyond, however few leaves it has.
_LEAST, _MOST = 0.02, 1.8

#: Weights (2, r, k) of a species (index) of a flora.
Known = Callable[[Flora, int], NDArray[np.float64]]


def states_of(flora: Flora, number: int) -> tuple[int, ...]:
    """Indices of `SHARES` between which plants of a species are on the day of a flora; those in summer have all."""
    if flora.day is None:
        return (0,)
    low, high = flora.day.share_range(flora.rows, number)
    shares = np.array(SHARES)
    first = int(np.flatnonzero(shares >= min(high, 1.0) - 1e-9)[-1])
    last = int(np.flatnonzero(shares <= low + 1e-9)[0])
    return tuple(range(first, last + 1))


def variants(species: Species) -> Iterator[tuple[str, Flora]]:
    """All variants of a species of which weights are needed on any day and at any age, each with a name."""
    plain = compile_species([species])
    shares = SHARES if species.year is not None else SHARES[:1]
    for share in shares:
        yield f"{species.identifier} {share:g}", _with_leaves(plain.species[0], share)
    for years in ages_measured(species):
        if years != 0.0:
            yield f"{species.identifier} {years:g} years", _at_age(species, years)


def ages_measured(species: Species) -> list[float]:
    """Ages of which weights are measured, rising; 0.0 stands for the full one."""
    ages = ages_of(species)
    if ages.scaled or species.form is not None:
        return [0.0]
    found = [(part * ages.full, part * ages.full) for part in _YOUNG] + [(ages.full, 0.0)]
    if np.isfinite(ages.lifespan):
        found += [(y, y) for y in (part * ages.lifespan for part in _OLD) if y > ages.full]
        found += [(y, y) for y in (ages.lifespan + after for after in _DEAD)]
    return [years for _, years in sorted(found)]


def needed(flora: Flora, number: int) -> list[tuple[Flora, int]]:
    """What has to be known for the weights of a species of a flora on its day, in summer or not."""
    plain, states = flora.in_leaf, states_of(flora, number)
    own = plain.species[number]
    if own.aged is None:
        return [(plain, number) if s == 0 else (_with_leaves(own, SHARES[s]), 0) for s in states]
    described, years = own.aged
    around, _ = _around(described, years)
    out = [(_at_age(described, one), 0) for one in around]
    if states != (0,):
        full = _at_age(described, 0.0)
        out += [(_with_leaves(full.species[0], SHARES[s]), 0) for s in {0, *states}]
    return out


def weights_of(flora: Flora, number: int, states: tuple[int, ...], known: Known) -> NDArray[np.float64]:
    """Weights (2, s, r, k) of a species of a flora in summer, in some states; 1 in the others.

    Parameters
    ----------
    flora : Flora
        In summer.
    number : int
        Index of the species.
    states : tuple of int
        Indices of `SHARES`.
    known : callable
        What was measured of those that are `needed`.
    """
    own, last = flora.species[number], max(states)
    if own.aged is None:
        found = [known(flora, number) if s == 0 else known(_with_leaves(own, SHARES[s]), 0) for s in states]
        out = np.ones((2, last + 1, *found[0].shape[1:]))
        for state, one in zip(states, found, strict=True):
            out[:, state] = one
        return out
    described, years = own.aged
    rows = flora.rows[flora.rows["species"] == number]

    def inverse(some: Flora) -> NDArray[np.float64]:
        return 1.0 / np.clip(known(some, 0)[:, _alike(rows, some.rows)], _LEAST, _MOST)

    around, place = _around(described, years)
    ends = [inverse(_at_age(described, one)) for one in around]
    grown = ends[0] + place * (ends[-1] - ends[0])
    out = np.ones((2, last + 1, *grown.shape[1:]))
    full = _at_age(described, 0.0)
    for state in states:
        if state == 0:
            out[:, 0] = 1.0 / grown
            continue
        # Leaves that are gone change as much of what hides behind others as when the plant is full-grown.
        all_leaves, some = inverse(full), inverse(_with_leaves(full.species[0], SHARES[state]))
        hidden = np.maximum(all_leaves - 1.0, 0.05)
        left = np.clip((some - all_leaves) / hidden, -1.0, 0.5)
        out[:, state] = 1.0 / np.clip(grown + left * np.maximum(grown - 1.0, 0.05), 1.0 / _MOST, 1.0 / _LEAST)
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


def _alike(rows: NDArray[np.void], other: NDArray[np.void]) -> NDArray[np.int64]:
    """For each row (r,) of a species, that of a variant which is its order and the nearest part of it."""
    out = np.zeros(len(rows), np.int64)
    for order in np.unique(rows["order"]):
        own, there = np.flatnonzero(rows["order"] == order), np.flatnonzero(other["order"] == order)
        if not len(there):  # none of these branches yet, or no more
            there = np.flatnonzero(other["order"] <= order)[-1:]
        middle = other["part"][there].mean(axis=1)
        away = np.abs(rows["part"][own].mean(axis=1)[:, None] - middle)
        out[own] = there[np.argmin(away, axis=1)]
    return out


@lru_cache(maxsize=64)
def _at_age(described: Species, years: float) -> Flora:
    return compile_species([with_age(described, years)])


@lru_cache(maxsize=64)
def _with_leaves(species: Species, share: float) -> Flora:
    """A compiled species with a part of its leaves."""
    # What is compiled has its quality and habit already.
    species = replace(species, quality=1.0, habit=0.0)
    if share != 1.0:
        orders = tuple(_with_part(order, share) for order in species.orders)
        spur = None if species.spur is None else _with_part(species.spur, share)
        species = replace(species, orders=orders, spur=spur)
    return compile_species([species])


def _with_part(order: Order, share: float) -> Order:
    return replace(order, leaves=Range(share * order.leaves.mean, share * order.leaves.variation))
