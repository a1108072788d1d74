# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frontier: parts of all that there is, opened front to back until what becomes of each is known.

Parts of plants, clusters of instances and faces of your own meshes wait in pools, one for each kind. In each cell of
the image the nearest ones are tested against the coverage of all that was drawn before: what is hidden or outside stays
whole, what is seen and large is opened, what is seen and small is to be drawn, and covers the image in its turn. Then
the next ones follow. Each part is opened once, and everything that is made follows from it. The loop's tetrahedra say
what to open before anything is drawn (`refinement`); what is hidden is decided here.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Keys, Mask, gathered
from ..buffers import MeshBuffers
from ..growth.hashing import uniform
from ..proxies.microsurfaces import Facets
from ..proxies.primitives import triangle_corners
from .coverage import CELL, Coverage, Footprints

#: Pixels, and facets, down to which parts that are seen are opened: smaller ones are drawn at their samples.
DETAIL, FEW = 3.0, 3.0
#: Where facets are larger than asked for, there are fewer by this power of their side: each reaches more pixels, one of
#: which may be open. 1.0 up to one and a half times the side, 1.35 up to four times (birches, full HD).
FEWER = 1.3
#: Facets for each pixel of a cell that are made at a time, about, and how many are made at least in all cells: what
#: these hide of each other is not known when they are made. With four times as many, spruces at full HD took a tenth
#: longer and .25 GB more; with .4 of the least, small images a fifth.
SLAB, LEAST = 0.8, 100_000.0
#: So many times as many before anything is known of what parts hide of each other.
FIRST = 2.0
#: One-sided layers of leaves that are enough where nothing is seen, and how much of its box a crown fills.
LAYERS, FILLED = 6.0, 0.6
#: How many primitives that are hidden when they are about to be made become one.
SOONER = (4.0, 16.0)
_THIN = 233  # draw of this module

#: Whose facets some are: a species, assets, or None for your own meshes; and the look of those that are no plants.
Whose = tuple[int | None, str]
#: Facets, and whose they are.
Owned = tuple[Whose, Facets]
#: Things that are drawn as they are, and how.
Shown = tuple[str, Arrays]


@dataclass(frozen=True)
class Waiting(Arrays):
    """Parts (n) of one kind, and spheres around them."""

    parts: Arrays  # of n
    center: Floats  # (n, 3)
    radius: Floats  # (n,): meters
    near: Floats  # (n,): least depth of the sphere, meters
    cell: Integers  # (n,): cell of the image that its middle is in
    count: Floats  # (n,): facets that they would have, all of them


class _Pool:
    """Parts (n) of one kind that wait, in runs: what leaves is cleared, and what comes is joined, only now and then."""

    def __init__(self, first: Waiting) -> None:
        self._runs = [(first, np.arange(len(first)))]

    def __len__(self) -> int:
        return sum(len(rows) for _, rows in self._runs)

    def column(self, name: str) -> NDArray:
        """A column (n,) of `Waiting`."""
        return np.concatenate([getattr(run, name)[rows] for run, rows in self._runs])

    def _within(self, index: Integers) -> list[tuple[Waiting, Integers]]:
        """Each run, and its rows among some (k,) of all."""
        ends = np.cumsum([0, *(len(rows) for _, rows in self._runs)])
        of = np.searchsorted(ends, index, side="right") - 1
        return [(run, rows[index[of == k] - ends[k]]) for k, (run, rows) in enumerate(self._runs)]

    def take(self, index: Integers) -> Waiting:
        """Some (k,) of them, in that order: depths of their cells come in it, too."""
        runs = np.searchsorted(np.cumsum([len(rows) for _, rows in self._runs]), index, side="right")
        waiting = Waiting.concatenate([run.take(rows) for run, rows in self._within(index)])
        return waiting.take(np.argsort(np.argsort(runs, kind="stable"))) if len(self._runs) > 1 else waiting

    def keep(self, index: Integers, later: Sequence[Waiting]) -> int:
        """Only some (k,) wait still, and others do from now on; how many there were."""
        number, new = len(self), Waiting.concatenate(later) if later else self.take(np.arange(0))
        self._runs = [*self._within(index), (new, np.arange(len(new)))]
        for k in range(len(self._runs) - 1, 0, -1):
            if 2 * len(self._runs[k][1]) >= len(self._runs[k - 1][1]):
                joined = Waiting.concatenate([run.take(rows) for run, rows in self._runs[k - 1 : k + 1]])
                self._runs[k - 1 : k + 1] = [(joined, np.arange(len(joined)))]
            elif not len(self._runs[k][1]):
                del self._runs[k]
        return number


class Canvas:
    """Where kinds draw what is seen of them: a tile of the image."""

    def __init__(self, coverage: Coverage) -> None:
        self.coverage, self.number = coverage, 0.0  # of polygons and facets
        self.meshes: dict[tuple[str, int, int], list[MeshBuffers]] = {}
        # What was made between two depths: whose facets, or kinds and meshes, and their corners.
        self.waiting: list[tuple[Any, Any, Floats32]] = []

    def add_facets(self, whose: Whose, facets: Facets) -> None:
        """Facets, to be tested and drawn together with all else of the slab."""
        if len(facets):
            self.waiting.append((whose, facets, triangle_corners(facets)))

    def thin(self, key: Keys, center: NDArray[np.floating], radius: NDArray[np.floating]) -> tuple[Integers, Floats]:
        """As of `pieces.Thin`: few large ones are made in the place of many that are hidden already."""
        times, left = np.ones(len(key)), np.arange(len(key))
        center = center.astype(np.float32)
        for more in SOONER:
            reach = np.sqrt(more) * radius[left]
            left = left[self.coverage.hidden(self.coverage.of_spheres(gathered(center, left), reach))]
            times[left] = more
        kept = np.flatnonzero(uniform(key, _THIN) < 1.0 / times)
        return kept, times[kept]

    def add_shown(self, corners: NDArray[np.floating], number: float = 0.0) -> None:
        """Polygons with corners (n, k, 3) of what is drawn as it is; they count as so many."""
        self.number += number
        _, *drawn = self.coverage.of_corners(corners)
        self.fill(*drawn)

    def add_mesh(self, what: tuple[str, int, int], buffers: MeshBuffers | None, culled: bool = False) -> None:
        """A mesh of a species, without faces behind full pixels if it is culled."""
        if buffers is None or not buffers.polygons:
            return
        corners, _ = corners_of_faces(buffers)
        if culled:
            self.waiting.append((what, buffers, corners))
            return
        self.add_shown(corners, buffers.polygons)
        self.meshes.setdefault(what, []).append(buffers)

    def fill(self, column: NDArray, row: NDArray, depth: NDArray) -> None:
        """Cover what polygons with corners (k, n) cover."""
        for k in range(1, len(column) - 1):
            fan = [0, k, k + 1]
            self.coverage.draw(column[fan], row[fan], depth[fan])


def corners_of_faces(mesh: MeshBuffers) -> tuple[Floats32, Integers]:
    """Corners (f, k, 3) of one or more faces, the last of which repeats beyond their size (f,), and that."""
    size, first = np.diff(mesh.face_offsets), mesh.face_offsets[:-1]
    every = first[:, None] + np.minimum(np.arange(int(size.max())), size[:, None] - 1)
    return mesh.positions[mesh.corner_verts[every]], size


class FrontierKind:
    """One kind of things. Parts are `Arrays`; each kind says what is different about its own."""

    larger = 1.0  # sides of its facets over those of plants
    stays = False  # whether parts that nobody sees may stay as they are: then none of them can stand for others

    def coarser(self, _times: float) -> Self:
        """The same, of which what is drawn as itself is so many times as large before it is."""
        return self

    def spheres(self, parts: Arrays) -> tuple[Floats, Floats]:
        """Middles (n, 3) of spheres around parts, and radii (n,), meters."""
        return parts.center, parts.reach

    def prints(self, coverage: Coverage, slab: Waiting) -> Footprints:
        """What parts may touch of the image."""
        return coverage.of_spheres(slab.center, slab.radius)

    def optical(self, parts: Arrays) -> Floats:
        """Area (n,) that parts block, of which something is to be drawn still, m²."""
        raise NotImplementedError

    def one_leaf(self, parts: Arrays) -> Floats:
        """Area (n,) of a leaf, m²; 0 where none is known."""
        return np.zeros(len(parts))

    def draw(self, canvas: Canvas, slab: Waiting, side: Floats, shown: list[Shown]) -> None:
        """Draw parts that are seen, with facets of sides (n,), meters."""
        raise NotImplementedError

    def unseen(self, parts: Arrays, side: Floats, kept: Floats, shown: list[Shown]) -> Iterator[Owned]:
        """Facets of sides (n,), meters, of a fraction (n,) of parts that nobody sees."""
        raise NotImplementedError

    def enough(self, parts: Arrays) -> Floats:
        """Fraction (n,) of their area with which parts keep out as much light as with all."""
        return np.ones(len(parts))

    def can_open(self, parts: Arrays) -> Mask:
        """Parts (n,) that consist of others."""
        return np.zeros(len(parts), bool)

    def opened(self, parts: Arrays) -> tuple[Arrays, Integers]:
        """What parts consist of, and of which (m,) each is."""
        return parts.take(slice(0)), np.zeros(0, np.int64)

    def to_be_opened(self, parts: Arrays) -> Mask:
        """Parts (n,) of which some is drawn as it is, however small they are."""
        return np.zeros(len(parts), bool)

    def met(self, parts: Arrays, shown: list[Shown]) -> Arrays:
        """Parts that are seen, after it was decided which of them are drawn as they are."""
        return parts

    def ordered(self, parts: Arrays) -> Arrays:
        """Parts by their places, so that the order of things in the scene does not matter."""
        return parts.take(np.lexsort(self.spheres(parts)[0].T))


def opaque_fractions(silhouette: Floats, optical: Floats) -> Floats:
    """Fraction (n,) of optical areas (n,) behind silhouettes (n,), m², that lets through a few hundredths of light.

    A spruce has twenty layers of needles across its crown. Where it is hidden, the first of them cast its shadow.
    """
    return np.minimum(LAYERS * FILLED * silhouette / np.maximum(optical, 1e-300), 1.0)


class Frontier:
    """Parts as they are decided, for one coverage.

    Parameters
    ----------
    facet : float
        Side of facets, pixels; it and the kinds may change on the way to what is coarser.

    Attributes
    ----------
    hidden, outside : list of list of Waiting
        What is not seen of each kind, as whole as it was left.
    shown : list of Shown
    """

    def __init__(self, kinds: Sequence[FrontierKind], coverage: Coverage, facet: float) -> None:
        self.kinds, self.coverage, self.facet = kinds, coverage, facet
        self.hidden: list[list[Waiting]] = [[] for _ in kinds]
        self.outside: list[list[Waiting]] = [[] for _ in kinds]
        self.shown: list[Shown] = []
        self.empty, self._filling = coverage.depth.copy(), np.zeros(1)

    def layers(self) -> float:
        """Layers that were drawn, on average, in the pixels that are full or will be, were each drawn at random."""
        row, column = np.nonzero(self.coverage.depth == self.empty)
        open_ = self._filling.take(self.coverage.cells(column + self.coverage.first, row), mode="clip").sum()
        return float(np.log1p((self.empty.size - len(row)) / max(open_, 1.0)))

    def pool(self, kind: FrontierKind, parts: Arrays) -> Waiting:
        """Parts (n,) of a kind with spheres around them."""
        center, radius = kind.spheres(parts)
        column, row, depth = self.coverage.project(center)
        side = kind.larger * self.facet * self.coverage.camera.extent_around(center)
        count = kind.optical(parts) / np.maximum(side**2, 1e-12)
        return Waiting(parts, center, radius, depth - radius, self.coverage.cells(column, row), count)

    def slabs(self, parts: Sequence[Arrays], most: float = np.inf) -> Iterator[list[Waiting]]:
        """Parts of each kind that are to be drawn, some at a time; what they cover is to be drawn before more follow.

        In each cell of the image these are the nearest ones, which have no more than about so many facets in all.
        """
        pools = [_Pool(self.pool(kind, rows)) for kind, rows in zip(self.kinds, parts, strict=True)]
        cells = len(np.unique(np.concatenate([pool.column("cell") for pool in pools])))
        dense = min(SLAB * CELL**2, FIRST * most / max(cells, 1))
        for pool, *left in zip(pools, self.hidden, self.outside, strict=True):
            for one in left:
                one.append(pool.take(np.arange(0)))
        while any(map(len, pools)):
            near, depth, order, cells = self._depths(pools, dense)
            ready, first = [], 0
            for number, pool in enumerate(pools):
                # In their order, so that the next sorting finds most of it done.
                rows = order[(order >= first) & (order < first + len(pool))]
                begun = (near <= depth)[rows]
                slab, later = self._decided(number, pool.take(rows[begun] - first), depth[rows[begun]])
                first += pool.keep(rows[~begun] - first, later)
                ready.append(slab)
            # Where much was hidden, or little is left, the next ones are so many more.
            wanted = min(max(SLAB * CELL**2 * cells, LEAST), max(most, 1.0))
            number = float(sum(one.count.sum() for one in ready))
            dense *= float(np.clip(wanted / max(number, 1.0), 0.5, 2.0))
            if any(map(len, ready)):
                yield ready

    def _depths(self, pools: Sequence[_Pool], number: float) -> tuple[Floats, Floats, Integers, int]:
        """Least depths (n,) of parts, those before which a cell has so many facets, order (n,) by both, and cells."""
        names = ("cell", "near", "count", "radius")
        every, nearest, count, radius = (np.concatenate([pool.column(name) for pool in pools]) for name in names)
        self._filling = -np.expm1(-np.append(np.bincount(every, count * self.facet**2), 0.0) / CELL**2)
        deepest = float(np.ptp(nearest)) + 1.0
        order = np.argsort(every * deepest + (nearest - nearest.min()), kind="stable")
        cells, near = every[order], nearest[order]
        first = np.flatnonzero(np.diff(cells, prepend=-1))
        count = count[order]
        before = np.cumsum(count) - count
        group = np.repeat(np.arange(len(first)), np.diff(first, append=len(cells)))
        left = number - (before - before[first][group])
        # The part that the number ends in counts by the share of its depth; that is the last with any left.
        last = np.maximum.reduceat(np.where(left > 0.0, np.arange(len(cells)), -1), first)
        end = near[last] + 2.0 * radius[order][last] * np.minimum(left[last] / np.maximum(count[last], 1e-12), 1.0)
        depth = np.empty(len(cells))
        depth[order] = end[group]
        return nearest, depth, order, len(first)

    def _decided(self, number: int, slab: Waiting, depth: Floats) -> tuple[Waiting, list[Waiting]]:
        """What is to be drawn of parts that begin before depths (n,), and what of theirs begins beyond."""
        kind, ready, later = self.kinds[number], [slab.take(slice(0))], []
        while len(slab):
            prints = kind.prints(self.coverage, slab)
            outside = self.coverage.outside(prints)
            hidden = ~outside & self.coverage.hidden(prints)
            self.outside[number].append(slab.take(outside))
            self.hidden[number].append(slab.take(hidden))
            seen = ~outside & ~hidden
            slab, depth = slab.take(seen), depth[seen]
            slab = replace(slab, parts=kind.met(slab.parts, self.shown))
            # More of these shows than their samples tell.
            pixels = 2.0 * slab.radius / self.coverage.camera.extent_around(slab.center)
            large = ((pixels > DETAIL) & (slab.count > FEW)) | kind.to_be_opened(slab.parts)
            large &= kind.can_open(slab.parts)
            ready.append(slab.take(~large))
            parents = np.flatnonzero(large)
            parts, owner = kind.opened(slab.parts.take(parents))
            new, depth = self.pool(kind, parts), depth[parents][owner]
            soon = new.near <= depth
            later.append(new.take(new.near > depth))
            slab, depth = new.take(soon), depth[soon]
        return Waiting.concatenate(ready), later
