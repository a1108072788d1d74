# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry on the map: areas, nearness to lines, distances between points, and noise for clumps.

Points are kept apart by grids whose cells are as large as the distance. Noise comes from hashes of a lattice, so that
a seed gives the same clumps everywhere. Plants may stand on triangles, masks on them, and areas, paths and borders.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Floats32, Integers, Keys, Mask, bilinear, spread
from ..errors import SceneError
from ..growth.hashing import child_key, uniform

_SLABS = 4096  # at most, into which a polygon is cut
_CELLS = 4_000_000  # at most, of the grid of a set of lines
_ENTRIES = 3_000_000  # about as many pieces of lines are noted in the cells


def inside_any(points: Floats, polygons: Sequence[Floats]) -> Mask:
    """Which points (n, 2) lie in at least one polygon, (n,).

    Polygons (k, 2) go on from the last corner to the first. Of one that crosses itself, what is wound twice is outside.
    """
    inside = np.zeros(len(points), bool)
    for polygon in polygons:
        low, high = polygon.min(axis=0), polygon.max(axis=0)
        asked = np.flatnonzero(~inside & ((points >= low) & (points <= high)).all(axis=1))
        if len(asked):
            inside[asked] = _inside(points[asked], polygon)
    return inside


def _inside(points: Floats, polygon: Floats) -> Mask:
    """Whether a line to the east crosses the border an odd number of times; only edges of the own slab are asked."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    slabs, base = min(len(polygon), _SLABS), low.min()
    height = max((high.max() - base) / slabs, np.finfo(np.float64).tiny)

    def slab(y: Floats) -> Integers:
        return np.clip((y - base) / height, 0, slabs - 1).astype(np.int64)

    first = slab(low)
    edge, offset = spread(slab(high) - first + 1)
    order = np.argsort(first[edge] + offset, kind="stable")
    begins = np.searchsorted((first[edge] + offset)[order], np.arange(slabs + 1))
    edge = edge[order]
    odd = np.zeros(len(points), bool)
    place, stop = begins[slab(points[:, 1])], begins[slab(points[:, 1]) + 1]
    asking = np.flatnonzero(place < stop)
    while len(asking):  # as often as the fullest slab has edges
        e, x, y = edge[place[asking]], points[asking, 0], points[asking, 1]
        spans = (start[e, 1] <= y) != (end[e, 1] <= y)
        rise = np.where(spans, end[e, 1] - start[e, 1], 1.0)
        odd[asking] ^= spans & (x < start[e, 0] + (y - start[e, 1]) * (end[e, 0] - start[e, 0]) / rise)
        place[asking] += 1
        asking = asking[place[asking] < stop[asking]]
    return odd


class Lines:
    """Straight pieces on the map, noted in the cells of a grid within their reach.

    A cell keeps only pieces that can be the nearest of a point in it: a long border costs no more than a short one.
    """

    def __init__(self, start: Floats, end: Floats, reach: Floats) -> None:
        """Pieces from ``start`` to ``end``, (e, 2) each, and how far from them it matters, (e,) above 0; meters."""
        low = (np.minimum(start, end) - reach[:, None]).min(axis=0)
        span = (np.maximum(start, end) + reach[:, None]).max(axis=0) - low
        cell = max(reach.max() / 4.0, np.sqrt(span.prod() / _CELLS), span.max() / _CELLS)
        start, end, reach = _cut(start, end, reach, 2.0 * max(reach.max(), cell))
        reached = np.abs(end - start) + 2.0 * reach[:, None]
        while cell < span.max() and (reached / cell + 1.0).prod(axis=1).sum() > _ENTRIES:
            cell *= 1.5
        self.start, self.along, self.reach = start, end - start, reach
        self.low, self.cell = low, cell
        self.columns, self.rows = (np.floor(span / cell).astype(np.int64) + 1).tolist()
        first = self._column_row(np.minimum(start, end) - reach[:, None])
        wide = self._column_row(np.maximum(start, end) + reach[:, None]) - first + 1
        piece, offset = spread(wide.prod(axis=1))
        place = first[piece] + np.stack([offset % wide[piece, 0], offset // wide[piece, 0]], axis=1)
        number = place[:, 1] * self.columns + place[:, 0]
        # What is farther from a cell's middle than another's farthest place from it is nowhere in the cell the nearest.
        gap = self._gap(low + (place + 0.5) * cell, piece)
        half = cell * np.sqrt(0.5)
        surely = np.full(self.columns * self.rows, np.inf)
        np.minimum.at(surely, number, (gap + half) / reach[piece])
        useful = gap - half <= np.minimum(surely[number], 1.0) * reach[piece]
        order = np.argsort(number[useful], kind="stable")
        self.piece = piece[useful][order]
        self.begins = np.searchsorted(number[useful][order], np.arange(self.columns * self.rows + 1))

    def nearness(self, points: Floats) -> Floats:
        """Least ratio of distance to reach over all pieces, (n,) between 0 and 1; 1 where nothing is within reach."""
        ratio = np.ones(len(points))
        place = np.floor((points - self.low) / self.cell)
        within = np.flatnonzero(((place >= 0) & (place < (self.columns, self.rows))).all(axis=1))
        column, row = place[within].astype(np.int64).T
        cursor, stop = self.begins[row * self.columns + column], self.begins[row * self.columns + column + 1]
        while len(within):  # as often as the fullest cell has pieces
            open_ = cursor < stop
            within, cursor, stop = within[open_], cursor[open_], stop[open_]
            piece = self.piece[cursor]
            ratio[within] = np.minimum(ratio[within], self._gap(points[within], piece) / self.reach[piece])
            cursor = cursor + 1
        return ratio

    def _column_row(self, points: Floats) -> Integers:
        place = np.floor((points - self.low) / self.cell).astype(np.int64)
        return np.clip(place, 0, (self.columns - 1, self.rows - 1))

    def _gap(self, points: Floats, piece: Integers) -> Floats:
        """Distance of each point from its piece, meters."""
        start, along = self.start[piece], self.along[piece]
        length = np.maximum((along * along).sum(axis=1), np.finfo(np.float64).tiny)
        fraction = np.clip(((points - start) * along).sum(axis=1) / length, 0.0, 1.0)
        rest = points - start - fraction[:, None] * along
        return np.hypot(rest[:, 0], rest[:, 1])


def lines_along(lines: Sequence[Floats], reach: Sequence[float]) -> Lines | None:
    """Lines through points (k, 2) each, and how far from them it matters, meters; None without any.

    A line of one point is a place of its own.
    """
    ends = [np.repeat(line, 2, axis=0) if len(line) == 1 else line for line in lines]
    if not ends:
        return None
    far = np.repeat(np.asarray(reach, np.float64), [len(line) - 1 for line in ends])
    return Lines(np.concatenate([e[:-1] for e in ends]), np.concatenate([e[1:] for e in ends]), far)


def _cut(start: Floats, end: Floats, reach: Floats, longest: float) -> tuple[Floats, Floats, Floats]:
    """Pieces of at most the given length in the place of long ones."""
    parts = np.ceil(np.linalg.norm(end - start, axis=1) / longest).astype(np.int64).clip(min=1)
    piece, offset = spread(parts)
    step = ((end - start) / parts[:, None])[piece]
    begin = start[piece] + offset[:, None] * step
    return begin, begin + step, reach[piece]


NO_DISTANCE = 1e-4  # meters; less is none, and its cells could not be counted

# Points that are too close lie at most two cells apart. The own cell comes first: whoever is there is near.
_NEAR = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if abs(i) + abs(j) < 4]
_NEAR.sort(key=lambda step: step[0] ** 2 + step[1] ** 2)


class Neighbors:
    """Points on the map, (m, 2), that others are asked to keep near or far."""

    def __init__(self, points: Floats, distance: float) -> None:
        """Sort the points by cell; the distance is at least `NO_DISTANCE`, meters."""
        self.distance = distance
        self.cell = distance / np.sqrt(2.0)
        cells = cells_of(points, self.cell)
        order = np.argsort(cells)
        self.points, cells = points[order], cells[order]
        first = np.flatnonzero(np.diff(cells, prepend=cells[:1] - 1))
        self.cells, self.first = cells[first], np.append(first, len(points))

    def near(self, points: Floats, least: int = 1) -> Mask:
        """Which points, (n, 2), are closer than the distance to at least so many of the others, (n,)."""
        if not len(self.points) or not len(points):
            return np.zeros(len(points), bool)
        met_so_far = np.zeros(len(points), np.int64)
        far = np.arange(len(points))
        for step in _NEAR:
            wanted = cells_of(points[far], self.cell, step)
            place = np.minimum(np.searchsorted(self.cells, wanted), len(self.cells) - 1)
            met = np.flatnonzero(self.cells[place] == wanted)
            asking, place, end = far[met], self.first[place[met]], self.first[place[met] + 1]
            while len(asking):  # as often as the fullest cell holds points
                gap = points[asking] - self.points[place]
                met_so_far[asking] += gap[:, 0] ** 2 + gap[:, 1] ** 2 < self.distance**2
                place = place + 1
                more = (place < end) & (met_so_far[asking] < least)
                asking, place, end = asking[more], place[more], end[more]
            far = far[met_so_far[far] < least]
        return met_so_far >= least


class Spacing:
    """Keeps points apart with a grid whose cells hold one point at most.

    The diagonal of cells is the distance: two points of a cell are too close, and such points at most two cells apart.
    """

    def __init__(self, distance: float, occupied: Floats) -> None:
        self.distance, self.cell = distance, distance / np.sqrt(2.0)  # meters
        self.points = occupied  # (m, 2): those that stand; they may crowd cells

    @property
    def free(self) -> bool:
        """Whether there is no distance to keep."""
        return self.distance < NO_DISTANCE

    def admit(self, candidates: Floats, most: int) -> Integers:
        """Indices of candidates, (k,) and at most ``most``, that keep their distance; earlier ones go first."""
        if self.free:
            return np.arange(min(most, len(candidates)))
        undecided = np.flatnonzero(~Neighbors(self.points, self.distance).near(candidates))
        chosen = []
        while len(undecided):
            # One speaker a cell, the earliest; those with no earlier speaker around are in. What is close to one may be
            # another of that speaker's cell, which has to be decided before.
            _, first = np.unique(cells_of(candidates[undecided], self.cell), return_index=True)
            speakers = np.sort(undecided[first])
            winners = speakers[~self._outranked(candidates[speakers])]
            chosen.append(winners)
            undecided = undecided[~Neighbors(candidates[winners], self.distance).near(candidates[undecided])]
        kept = np.sort(np.concatenate(chosen))[:most] if chosen else np.zeros(0, np.int64)
        self.points = np.concatenate([self.points, candidates[kept]])
        return kept

    def _outranked(self, speakers: Floats) -> Mask:
        """Which speakers, one a cell and in order of rank, have an earlier one in cells that are close."""
        outranked = np.zeros(len(speakers), bool)
        homes = cells_of(speakers, self.cell)
        order = np.argsort(homes)
        cells = homes[order]
        for step in _NEAR:
            wanted = cells_of(speakers, self.cell, step)
            place = np.minimum(np.searchsorted(cells, wanted), len(cells) - 1)
            outranked |= (cells[place] == wanted) & (order[place] < np.arange(len(speakers)))
        return outranked


def cells_of(points: Floats, cell: float, step: tuple[int, int] = (0, 0)) -> Integers:
    """`packed` cells (n,) of a side that points (n, 2) are in, or those so many cells beside."""
    return packed(np.floor(points / cell).astype(np.int64) + np.array(step))


def packed(cells: Integers) -> Integers:
    """One number (n,) for each cell (n, 2)."""
    return cells[:, 0] * np.int64(2**32) + cells[:, 1]


# The lattice's cell for a meter from clump to clump: peaks of the noise are counted in the tests.
CELL = 0.73
_OCTAVES = ((1.0, 1.0), (2.17, 0.35))  # frequency and weight; not a multiple, or lattices would coincide
_BARE, _FULL = -0.1, 0.25  # values of the noise below which nothing grows, and above which all does


def gradient_noise(points: Floats, key: Keys) -> Floats:
    """Smooth noise with mean 0 between -1 and 1 (K. Perlin, "Improving noise", SIGGRAPH 2002, in two dimensions).

    Parameters
    ----------
    points : (n, 2) float64
        In cells of the lattice.
    key : uint64
        Of the whole lattice.
    """
    corner = np.floor(points)
    part = points - corner
    corner = corner.astype(np.int64)
    sides = []
    for i in (0, 1):
        ends = []
        for j in (0, 1):
            name = (corner[:, 0] + i) * np.int64(2**32) + corner[:, 1] + j
            turn = 2.0 * np.pi * uniform(child_key(key, name.view(np.uint64)), 0)
            ends.append(np.cos(turn) * (part[:, 0] - i) + np.sin(turn) * (part[:, 1] - j))
        sides.append(ends)
    fade = part**3 * (part * (part * 6.0 - 15.0) + 10.0)
    along = [low + fade[:, 1] * (high - low) for low, high in sides]
    # A gradient of length 1 gives at most √½.
    return np.sqrt(2.0) * (along[0] + fade[:, 0] * (along[1] - along[0]))


def clumps(points: Floats, size: float, clumping: float, key: Keys) -> Floats:
    """How suitable places are, 0 to 1, for plants that grow in clumps, (n,).

    Parameters
    ----------
    points : (n, 2) float64
        Places on the map, meters.
    size : float
        Meters from clump to clump, on average.
    clumping : float
        0: suitable everywhere; 1: nothing between the clumps.
    key : uint64
    """
    value = np.zeros(len(points))
    for octave, (frequency, weight) in enumerate(_OCTAVES):
        value += weight * gradient_noise(points * (frequency / (CELL * size)), child_key(key, octave))
    fraction = np.clip((value - _BARE) / (_FULL - _BARE), 0.0, 1.0)
    return 1.0 - clumping + clumping * fraction * fraction * (3.0 - 2.0 * fraction)


@dataclass(frozen=True)
class Path:
    """A line on the map to keep free."""

    points: Floats  # (k, 2): meters, k at least 1; a cyclic line repeats its first point
    half_width: float  # meters to either side in which nothing grows; 0 keeps nothing free


@dataclass(frozen=True)
class Terrain:
    """A terrain with everything that is drawn on it. Only the triangles are needed."""

    triangles: Floats  # (t, 3, 3): corners, meters in world space; either side may be up
    weight: Floats | None = None  # (t, 3): how suitable the corners are, 0 to 1 (vertex groups); linear between
    uv: Floats | None = None  # (t, 3, 2): where the corners are in the image; it repeats beyond 0 and 1
    #: (h, w): how suitable texels are, 0 to 1; the first row is at the bottom. Read between texels (bilinear).
    image: Floats32 | None = None
    #: tuple of (k, 2): closed polygons on the map. If there are any, plants grow in at least one of them.
    areas: tuple[Floats, ...] = ()
    paths: tuple[Path, ...] = ()
    #: (e, 2, 3): edges where the ground ends; found from the triangles if they are asked for and not given.
    border: Floats | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be stood on.

        Raises
        ------
        SceneError
            No triangles, or some with places that are no numbers.
        ValueError
            Arrays that do not fit each other: a mistake of the caller, not of the artist.
        """
        count = len(self.triangles)
        if not count:
            raise SceneError("The ground has no faces; select a mesh with faces")
        broken = int((~np.isfinite(self.triangles).all(axis=(1, 2))).sum())
        if broken:
            raise SceneError(
                f"{broken:,} of {count:,} triangles of the ground have corners that are not finite numbers; "
                "check its transform, modifiers and drivers, or run Mesh > Clean Up > Degenerate Dissolve"
            )
        if self.weight is not None and np.shape(self.weight) != (count, 3):
            raise ValueError(f"weight has shape {np.shape(self.weight)}, expected ({count}, 3)")
        if (self.uv is None) != (self.image is None):
            raise ValueError("image and uv must be given together")
        if self.uv is not None and np.shape(self.uv) != (count, 3, 2):
            raise ValueError(f"uv has shape {np.shape(self.uv)}, expected ({count}, 3, 2)")

    @property
    def map_area(self) -> float:
        """Area of all triangles on the map, m²; what lies above other ground counts as well."""
        return float(map_areas(self.triangles).sum())


def map_areas(triangles: Floats) -> Floats:
    """Areas (t,) of triangles (t, 3, 3) on the map, m²."""
    a, b, c = np.moveaxis(triangles[..., :2], 1, 0)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return 0.5 * np.abs(ux * vy - uy * vx)


def border_of(triangles: Floats) -> Floats:
    """Edges of only one triangle, (e, 2, 3); corners at exactly the same place are one."""
    # Adding 0 makes -0.0 and 0.0 the same bytes.
    rows = np.ascontiguousarray(triangles.reshape(-1, 3) + 0.0).view(np.dtype((np.void, 24)))[:, 0]
    _, corner = np.unique(rows, return_inverse=True)
    corner = corner.reshape(-1, 3)
    ends = np.stack([corner, np.roll(corner, -1, axis=1)], axis=2).reshape(-1, 2)
    places = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    key = ends.min(axis=1) * np.int64(len(rows)) + ends.max(axis=1)
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    return places[first[(count == 1)]]


def sampled(image: Floats32, uv: Floats) -> Floats:
    """Values of an image (h, w) at places (n, 2), linear between the middles of texels, (n,).

    It repeats, but opposite borders do not mix: a mask that is black on one side would let plants stray to the other.
    """
    return bilinear(image, (uv - np.floor(uv)) * image.shape[::-1] - 0.5)
