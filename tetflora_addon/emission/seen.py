# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the loop has found for all nodes of the tree, and what that means for parts by the points on them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, column
from ..proxies.facet_sizes import coarseness
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..refinement.shared_parts import SharePoints

#: Pixels from which on leaves are real although they are hidden, at a limit of a pixel.
CLOSE = 16.0
#: Fraction of its area from which on a part counts as seen here and there.
SOME = 0.01


@dataclass(frozen=True)
class Seen(Arrays):
    """What is seen of parts (n).

    Attributes
    ----------
    visibility : (n,) float64
        Mean fraction of light that nothing in front blocks, 0 where all of it is hidden or beside the view.
    best : (n,) float64
        The largest visibility in any of its tetrahedra.
    real : (n,) bool
        Whether some of it may be drawn as it is: it reaches into an explicit tetrahedron.
    mixed, beside : (n,) bool
        Seen in part only; all of it is out of view.
    coarse : (n,) float64
        How much larger its facets are where it is hidden, see `facet_sizes.coarseness`.
    rank : (n,) int32
        Front-to-back order of the tetrahedra that they begin in.
    """

    visibility: NDArray[np.float64]
    best: NDArray[np.float64]
    real: NDArray[np.bool_] = field(metadata=column(dtype=bool))
    mixed: NDArray[np.bool_] = field(metadata=column(dtype=bool))
    beside: NDArray[np.bool_] = field(metadata=column(dtype=bool))
    coarse: NDArray[np.float64]
    rank: NDArray[np.int32] = field(metadata=column(dtype=np.int32))


class SeenNodes:
    """What is seen of all nodes.

    Parameters
    ----------
    result : Refinement
    facets : bool
        Whether proxies are facets or spheres. If not, only what is explicit counts as seen: the rest are shells.

    Attributes
    ----------
    visibility, coarse : (nodes,) float64
    explicit, inside, close : (nodes,) bool
        Decided to be explicit; within the view; hidden within it, and near enough at least in places.
    rank : (nodes,) int32
        Front-to-back order.
    """

    def __init__(self, result: Refinement, facets: bool) -> None:
        nodes, explicit = result.nodes, result.decision == Decision.EXPLICIT
        seen = np.isin(result.decision, (Decision.EXPLICIT, Decision.PROXY)) if facets else explicit
        size = len(result.tree)
        self.visibility, self.rank = np.zeros(size), np.zeros(size, np.int32)
        # What is explicit although it is hidden is so for its shadow; without facets all that is explicit is drawn.
        shown = np.where(explicit & ((result.transmittance <= 0.0) | (not facets)), 1.0, result.transmittance)
        self.visibility[nodes] = np.where(seen, np.maximum(shown, 1e-3), 0.0)
        self.rank[nodes] = result.rank
        self.explicit = result.chosen(Decision.EXPLICIT)
        self.inside = result.in_view | self.explicit
        self.coarse = coarseness(result)
        self._fill_empty(result)
        self.close = np.zeros(size, bool)
        if facets:
            self.close[nodes] = (result.decision == Decision.HIDDEN) & (result.cells.feature >= CLOSE)
            self.close &= result.in_view

    def _fill_empty(self, result: Refinement) -> None:
        """Give nodes that hold no point what the nearest ones that do have on average, or most of them, in the view.

        A plant has a few points in the loop, so that parts of it lie in nodes of which the loop knows nothing. They are
        no more hidden than what is around them.
        """
        tree, known = result.tree, np.zeros(len(result.tree), bool)
        known[result.nodes] = result.decision != Decision.EMPTY
        every = np.zeros(len(tree))
        every[result.nodes] = np.maximum(result.cells.totals.optical_area, 1e-12)
        every[~known] = 0.0
        weight = np.where(result.in_view, every, 0.0)
        sums = np.stack([every, weight, *(weight * v for v in (self.visibility, self.explicit, self.coarse))], axis=1)
        levels = [np.flatnonzero(tree.level == level) for level in range(1, tree.levels)]
        for nodes in reversed(levels):
            np.add.at(sums, tree.parent[nodes], sums[nodes])
        for nodes in levels:
            bare = nodes[sums[nodes, 1] <= 0.0]
            sums[bare] = sums[tree.parent[bare]]
        # A view's own root knows which of its pieces are in the view; elsewhere they are where those around are.
        within = tree.inside if tree.inside.any() else sums[:, 1] > 0.5 * sums[:, 0]
        empty = np.flatnonzero((tree.children[:, 0] < 0) & ~known & within & (sums[:, 1] > 0.0))
        mean = sums[empty, 2:] / sums[empty, 1:2]
        self.visibility[empty], self.explicit[empty], self.coarse[empty] = mean[:, 0], mean[:, 1] > 0.5, mean[:, 2]
        self.inside[empty] = True

    def of(self, points: SharePoints, count: int, close: NDArray[np.intp]) -> Seen:
        """What is seen of so many parts with points (m,) on them, of which some (k,) count as if they were near."""
        cell, area = points.cell, points.optical_area.astype(np.float64)
        total = np.bincount(points.part, area, count)
        total = np.where(total > 0, total, 1.0)

        def mean(values: NDArray) -> NDArray[np.float64]:
            return np.bincount(points.part, area * values, count) / total

        visibility, explicit = self.visibility[cell], self.explicit[cell]
        visibility[close], explicit[close] = CLOSE**-2.0, True
        seen = mean(visibility > 0)
        unseen = np.maximum(1.0 - seen, 1e-12)
        first = np.full(count, -1, np.int64)
        first[points.part[::-1]] = np.arange(len(points))[::-1]
        best = np.zeros(count)
        np.maximum.at(best, points.part, visibility)
        return Seen(
            np.where(seen > SOME, mean(visibility), 0.0),
            np.where(seen > SOME, best, 0.0),
            mean(explicit) > 0,
            (seen > SOME) & (seen < 1.0 - SOME),
            mean(self.inside[cell]) <= 0.0,
            np.where(seen < 1.0, mean(self.coarse[cell] * (visibility <= 0)) / unseen, 1.0),
            np.where(first >= 0, self.rank[cell[first]], 0).astype(np.int32),
        )
