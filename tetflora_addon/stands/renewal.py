# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How plants come: planted, or from seeds of the plants around and of the woods outside, where there is light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import TetFloraError
from ..growth.hashing import child_key, uniform
from .guilds import Guilds
from .light import LightGrid
from .plants import Plants, StandDraw, keys_of, newcomers
from .site import StandSite

#: Most plants at once.
MOST_PLANTS = 12_000_000
_PLANTED, _SOWN = 0, 1
#: Planted plants have this part of the girth of one that is 1.3 m high, those from seeds that; and are so many years.
_PLANTED_GIRTH, _SOWN_GIRTH = 0.35, 0.25
_PLANTED_AGE, _SOWN_AGE = 3.0, 3.0
#: Metres of the grid on which seeds are spread, at least; and seeds on a square metre that make half as many plants as
#: can come at all.
_SEED_CELL, _HALF = 4.0, 20.0
#: Part of the ground beyond that is below crowns of each species that bear seeds.
_OUTSIDE = 0.1


def planted(site: StandSite, guilds: Guilds, suits: NDArray[np.float64], density: float, seed: int) -> Plants:
    """Plants evenly spread, each somewhere in a square of its own.

    Parameters
    ----------
    suits : (g, cells) float64
        How well each guild grows.
    density : float
        Plants on a hectare.
    """
    if density <= 0.0 or guilds.planted.sum() <= 0.0:
        return Plants.empty()
    width, depth = site.size
    side = 100.0 / np.sqrt(density)
    columns, rows = max(round(width / side), 1), max(round(depth / side), 1)
    if columns * rows > MOST_PLANTS:
        raise TetFloraError(
            f"{columns * rows:,} plants would be planted, the limit is {MOST_PLANTS:,}; lower Planted, or choose a "
            "smaller ground"
        )
    index = np.arange(columns * rows)
    key = child_key(keys_of(seed, _PLANTED), index)
    x = (index % columns + 0.1 + 0.8 * uniform(key, StandDraw.X)) * (width / columns)
    y = (index // columns + 0.1 + 0.8 * uniform(key, StandDraw.Y)) * (depth / rows)
    limits = np.cumsum(guilds.planted) / guilds.planted.sum()
    guild = np.minimum(np.searchsorted(limits, uniform(key, StandDraw.GUILD), side="right"), len(limits) - 1)
    cells = site.cells(x, y)
    quality = suits[guild, cells]
    there = quality > 0.0
    if site.plantable is not None:
        there &= uniform(key, StandDraw.PLANTABLE) < site.plantable.ravel()[cells]
    kept = np.flatnonzero(there)
    girth = _PLANTED_GIRTH * guilds.first[guild]
    return newcomers(key[kept], 0, guild[kept], x[kept], y[kept], girth[kept], quality[kept], _PLANTED_AGE, guilds)


class SeedRain:
    """Seeds that fall on a site, and where they can become plants.

    Attributes
    ----------
    cell : float
        Metres of the grid on which seeds are spread.
    """

    def __init__(
        self, site: StandSite, guilds: Guilds, suits: NDArray[np.float64], most: float, outside: float
    ) -> None:
        """Of a site, for guilds that grow so well on its cells.

        Parameters
        ----------
        most : float
            Plants that come on a hectare and year at most.
        outside : float
            Factor on the seeds from outside.
        """
        self.site, self.guilds, self.suits, self.most = site, guilds, suits, most
        width, depth = site.size
        self.columns, self.rows = max(round(width / _SEED_CELL), 1), max(round(depth / _SEED_CELL), 1)
        self.outside = outside * _OUTSIDE * guilds.rain * guilds.seeds

    def fallen(self, plants: Plants) -> NDArray[np.float64]:
        """Seeds (g, cells) on a square metre and year."""
        width, depth = self.site.size
        column = np.minimum((plants.x * (self.columns / width)).astype(np.int64), self.columns - 1)
        row = np.minimum((plants.y * (self.rows / depth)).astype(np.int64), self.rows - 1)
        place = row * self.columns + column
        area = width * depth / (self.rows * self.columns)
        out = np.empty((len(self.outside), self.rows, self.columns))
        bears = plants.age >= np.take(self.guilds.mature, plants.guild)
        # Whole numbers, whose sum does not depend on the order: hundredths of a square metre of crown.
        crown = np.rint(np.where(bears, 100.0 * np.pi * plants.radius**2, 0.0))
        for guild in range(len(self.outside)):
            own = plants.guild == guild
            sums = np.bincount(place[own], crown[own], self.rows * self.columns).reshape(self.rows, self.columns)
            # About a normal distribution, whose mean distance is √(π / 2) standard deviations.
            width = np.sqrt(1.0 + 12.0 / np.pi * self.guilds.dispersal[guild] ** 2 / area)
            for axis in (0, 1, 0, 1):
                sums = _smoothed(sums, round((width - 1.0) / 2.0), axis)
            out[guild] = sums * (0.01 * self.guilds.seeds[guild] / area) + self.outside[guild]
        return out.reshape(len(self.outside), -1)

    def plants(self, plants: Plants, light: LightGrid, year: int, first: int, seed: int) -> Plants:
        """Plants that come in a year; ``light`` is what there is below the others."""
        site = self.site
        width, depth = site.size
        rows, columns = (max(round(size / light.cell), 1) for size in (depth, width))
        cells = rows * columns
        key = child_key(keys_of(seed, _SOWN), np.arange(cells) + year * cells)
        come = uniform(key, StandDraw.COME)
        # One plant at most in each cell and year: only where the dice allow it, all else is asked.
        most = min(self.most * (width * depth / cells) / 1e4, 1.0)
        index = np.flatnonzero(come < most)
        key, come = key[index], come[index] / most
        x = (index % columns + uniform(key, StandDraw.X)) * (width / columns)
        y = (index // columns + uniform(key, StandDraw.Y)) * (depth / rows)
        here = site.cells(x, y)
        ground = light.at(x, y, np.zeros(len(x)))
        column = np.minimum((x * (self.columns / width)).astype(np.int64), self.columns - 1)
        row = np.minimum((y * (self.rows / depth)).astype(np.int64), self.rows - 1)
        seeds = self.fallen(plants)[:, row * self.columns + column]
        # Light that seedlings need, and that in which they do well, falls with the tolerance of shade.
        least = (0.9 * self.guilds.limit)[:, None]
        lit = np.clip((ground[None, :] - least) / (3.0 * least), 0.0, 1.0)
        able = seeds * lit * self.suits[:, here]
        total = able.sum(axis=0)
        chance = total / (total + _HALF)
        if site.plantable is not None:
            chance *= site.plantable.ravel()[here]
        kept = np.flatnonzero(come < chance)
        limits = np.cumsum(able[:, kept], axis=0)
        guild = (uniform(key[kept], StandDraw.GUILD) * total[kept] >= limits).sum(axis=0)
        guild = np.minimum(guild, len(self.outside) - 1)
        quality = self.suits[guild, here[kept]]
        girth = _SOWN_GIRTH * self.guilds.first[guild]
        return newcomers(key[kept], first, guild, x[kept], y[kept], girth, quality, _SOWN_AGE, self.guilds)


def _smoothed(values: NDArray[np.float64], reach: int, axis: int) -> NDArray[np.float64]:
    """Means of the cells within a reach along an axis; what leaves on one side enters on the other."""
    size = values.shape[axis]
    reach = min(reach, (size - 1) // 2)
    if reach < 1:
        return values
    wide = np.concatenate(
        [values.take(range(size - reach - 1, size), axis), values, values.take(range(reach), axis)], axis
    )
    sums = np.cumsum(wide, axis)
    span = 2 * reach + 1
    return (sums.take(range(span, span + size), axis) - sums.take(range(size), axis)) / span
