# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frontier: parts of plants, opened front to back until what becomes of each is known.

Parts wait in a pool. Those that begin before a depth are tested against the coverage of all that was drawn before:
what is hidden or outside stays whole, what is seen and large is opened, what is seen and small is to be drawn, and
covers the image in its turn. Then the next depths follow. Each part is opened once, and everything that is made follows
from it. The loop's tetrahedra say what to open before anything is drawn (`refinement`); what is hidden is decided here.
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
from .coverage import Coverage
from .plants import Transition

#: Pixels, and facets, down to which parts that are seen are opened: smaller ones are drawn at their samples.
DETAIL, FEW = 3.0, 3.0
#: Facets for each pixel that lie between two depths, about, and how many are made at least: what these hide of each
#: other is not known when they are made.
SLAB, LEAST = 0.5, 20_000.0
#: Depths that a pool is divided into at first.
_SLABS = 200


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
    """

    parts: PlantParts = field(metadata=nested(PlantParts))
    centre: NDArray[np.float64] = field(metadata=column(3))
    radius: NDArray[np.float64]
    near: NDArray[np.float64]


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
        return Waiting(parts, centre, radius, self.coverage.project(centre)[2] - radius)

    def slabs(self, parts: PlantParts, most: float = np.inf) -> Iterator[Waiting]:
        """Parts that are to be drawn, some at a time; what they cover is to be drawn before more are asked for.

        Each time they have no more than about so many facets.
        """
        pool, step = self.pool(parts), 0.0
        wanted = min(max(SLAB * self.coverage.depth.size, LEAST), max(most, 1.0))
        while len(pool):
            first = float(pool.near.min())
            step = step or max((float(pool.near.max()) - first) / _SLABS, 1e-3)
            depth = max(first, 0.0) + step
            ready, later = self._decided(pool.take(np.flatnonzero(pool.near <= depth)), depth)
            pool = Waiting.concatenate([pool.take(np.flatnonzero(pool.near > depth)), *later])
            # The next slab is as much deeper as this one had fewer facets than it should.
            number = float(self.count(ready).sum()) if len(ready) else 0.0
            step *= float(np.clip(wanted / max(number, 1.0), 0.5, 2.0))
            if len(ready):
                yield ready

    def _decided(self, slab: Waiting, depth: float) -> tuple[Waiting, list[Waiting]]:
        """What is to be drawn of parts that begin before a depth, and what of theirs begins beyond."""
        ready, later = [Waiting.empty()], []
        while len(slab):
            prints = self.coverage.of_spheres(slab.centre, slab.radius)
            outside = self.coverage.outside(prints)
            hidden = ~outside & self.coverage.hidden(prints)
            self.outside.append(slab.take(np.flatnonzero(outside)))
            self.hidden.append(slab.take(np.flatnonzero(hidden)))
            slab = slab.take(np.flatnonzero(~outside & ~hidden))
            large = self.large(slab)
            ready.append(slab.take(np.flatnonzero(~large)))
            some = slab.parts.take(np.flatnonzero(large))
            new = self.pool(PlantParts.concatenate([made for made, _, _ in opened(self.flora, some)]))
            later.append(new.take(np.flatnonzero(new.near > depth)))
            slab = new.take(np.flatnonzero(new.near <= depth))
        return Waiting.concatenate(ready), later

    def count(self, pool: Waiting) -> NDArray[np.float64]:
        """Facets (n,) that parts would have, all of them."""
        side = self.facet * self.coverage.camera.extent_around(pool.centre)
        return pool.parts.totals.optical_area / np.maximum(side**2, 1e-12)

    def large(self, pool: Waiting) -> NDArray[np.bool_]:
        """Parts (n,) that are to be opened: more of them shows than their samples tell."""
        pixels = 2.0 * pool.radius / self.coverage.camera.extent_around(pool.centre)
        shows = (pixels > DETAIL) & (self.count(pool) > FEW)
        return pool.parts.can_open(self.flora) & (shows | (self.transition.of_branches(pool.parts.branches) > 0.0))
