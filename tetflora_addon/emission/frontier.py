# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frontier: parts of plants, opened front to back until what becomes of each is known.

Parts wait in a pool. In each cell of the image the nearest ones are tested against the coverage of all that was drawn
before: what is hidden or outside stays whole, what is seen and large is opened, what is seen and small is to be drawn,
and covers the image in its turn. Then the next ones follow. Each part is opened once, and everything that is made
follows from it. The loop's tetrahedra say what to open before anything is drawn (`refinement`); what is hidden is
decided here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, column, nested
from ..compiled.flora import Flora
from ..compiled.placed import extents
from ..refinement.contents import PlantParts
from ..refinement.shares import opened
from .coverage import CELL, Coverage
from .plants import Transition

#: Pixels, and facets, down to which parts that are seen are opened: smaller ones are drawn at their samples.
DETAIL, FEW = 3.0, 3.0
#: Facets for each pixel of a cell that are made at a time, about, and how many are made at least in all cells: what
#: these hide of each other is not known when they are made.
SLAB, LEAST = 0.8, 40_000.0


@dataclass(frozen=True)
class Waiting(Arrays):
    """Parts (n), and spheres around them.

    Attributes
    ----------
    parts : PlantParts of n
    centre : (n, 3) float64
    radius : (n,) float64
        Metres.
    near : (n,) float64
        Least depth of the sphere, metres.
    cell : (n,) int64
        Cell of the image that its middle is in.
    count : (n,) float64
        Facets that they would have, all of them.
    """

    parts: PlantParts = field(metadata=nested(PlantParts))
    centre: NDArray[np.float64] = field(metadata=column(3))
    radius: NDArray[np.float64]
    near: NDArray[np.float64]
    cell: NDArray[np.int64]
    count: NDArray[np.float64]


class Frontier:
    """Parts as they are decided, for one coverage.

    Parameters
    ----------
    flora : Flora
    coverage : Coverage
    transition : Transition
        Parts of which leaves are drawn as they are have to be opened.
    facet : float
        Side of facets, pixels.

    Attributes
    ----------
    hidden, outside : list of Waiting
        What is not seen, as whole as it was left.
    """

    def __init__(self, flora: Flora, coverage: Coverage, transition: Transition, facet: float) -> None:
        self.flora, self.coverage, self.transition, self.facet = flora, coverage, transition, facet
        self.hidden: list[Waiting] = []
        self.outside: list[Waiting] = []

    def pool(self, parts: PlantParts) -> Waiting:
        """Parts (n,) with spheres around them, as far as samples of their leaves and wood reach."""
        branches, alone = parts.branches, parts.alone
        across, low, high = extents(self.flora, branches).T
        middle = np.where(alone, 0.5, 0.5 * (np.minimum(low, 0.0) + high)) * branches.length
        half = np.where(alone, 0.5, 0.5 * (high - np.minimum(low, 0.0)))
        across = np.where(alone, 0.5 * parts.extent / np.maximum(branches.length, 1e-12), across)
        centre = branches.position + middle[:, None] * branches.frame[:, :, 2]
        radius = branches.length * np.hypot(across, half) + branches.radius
        column, row, depth = self.coverage.project(centre)
        side = self.facet * self.coverage.camera.extent_around(centre)
        count = parts.totals.optical_area / np.maximum(side**2, 1e-12)
        return Waiting(parts, centre, radius, depth - radius, self.coverage.cells(column, row), count)

    def slabs(self, parts: PlantParts, most: float = np.inf) -> Iterator[Waiting]:
        """Parts that are to be drawn, some at a time; what they cover is to be drawn before more are asked for.

        In each cell of the image these are the nearest ones, which have no more than about so many facets in all.
        """
        pool, dense = self.pool(parts), SLAB * CELL**2
        while len(pool):
            depth, cells = self._depths(pool, dense)
            ready, later = self._decided(pool.take(np.flatnonzero(pool.near <= depth)), depth[pool.near <= depth])
            pool = Waiting.concatenate([pool.take(np.flatnonzero(pool.near > depth)), *later])
            # Where much was hidden, or little is left, the next ones are so many more.
            wanted = min(max(SLAB * CELL**2 * cells, LEAST), max(most, 1.0))
            number = float(ready.count.sum())
            dense *= float(np.clip(wanted / max(number, 1.0), 0.5, 2.0))
            if len(ready):
                yield ready

    def _depths(self, pool: Waiting, number: float) -> tuple[NDArray[np.float64], int]:
        """Depths (n,) for parts, before which these have so many facets in each cell, about; and how many cells."""
        deepest = float(np.ptp(pool.near)) + 1.0
        order = np.argsort(pool.cell * deepest + (pool.near - pool.near.min()), kind="stable")
        cells, near = pool.cell[order], pool.near[order]
        first = np.flatnonzero(np.diff(cells, prepend=-1))
        count = pool.count[order]
        before = np.cumsum(count) - count
        group = np.repeat(np.arange(len(first)), np.diff(first, append=len(cells)))
        left = number - (before - before[first][group])
        # The part that the number ends in counts by the share of its depth; that is the last with any left.
        last = np.maximum.reduceat(np.where(left > 0.0, np.arange(len(cells)), -1), first)
        end = near[last] + 2.0 * pool.radius[order][last] * np.minimum(left[last] / np.maximum(count[last], 1e-12), 1.0)
        depth = np.empty(len(cells))
        depth[order] = end[group]
        return depth, len(first)

    def _decided(self, slab: Waiting, depth: NDArray[np.float64]) -> tuple[Waiting, list[Waiting]]:
        """What is to be drawn of parts that begin before depths (n,), and what of theirs begins beyond."""
        ready, later = [Waiting.empty()], []
        while len(slab):
            prints = self.coverage.of_spheres(slab.centre, slab.radius)
            outside = self.coverage.outside(prints)
            hidden = ~outside & self.coverage.hidden(prints)
            self.outside.append(slab.take(np.flatnonzero(outside)))
            self.hidden.append(slab.take(np.flatnonzero(hidden)))
            seen = np.flatnonzero(~outside & ~hidden)
            slab, depth = slab.take(seen), depth[seen]
            large = self.large(slab)
            ready.append(slab.take(np.flatnonzero(~large)))
            some = np.flatnonzero(large)
            made = list(opened(self.flora, slab.parts.take(some)))
            new = self.pool(PlantParts.concatenate([parts for parts, _, _ in made]))
            depth = depth[some][np.concatenate([np.zeros(0, np.int64), *(owner for _, owner, _ in made)])]
            later.append(new.take(np.flatnonzero(new.near > depth)))
            soon = np.flatnonzero(new.near <= depth)
            slab, depth = new.take(soon), depth[soon]
        return Waiting.concatenate(ready), later

    def large(self, pool: Waiting) -> NDArray[np.bool_]:
        """Parts (n,) that are to be opened: more of them shows than their samples tell."""
        pixels = 2.0 * pool.radius / self.coverage.camera.extent_around(pool.centre)
        shows = (pixels > DETAIL) & (pool.count > FEW)
        return pool.parts.can_open(self.flora) & (shows | (self.transition.of_branches(pool.parts.branches) > 0.0))
