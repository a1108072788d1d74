# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How much more light passes between leaves that sit in clusters than through an even fog of the same area.

A cell that is filled evenly with the area of what it holds is too dark, the more the larger it is. Its extinction is
therefore multiplied by a factor (the clumping index of Nilson, "A theoretical analysis of the frequency of gaps in
plant stands", 1971), here as a function of the cell's size:

    c(h) = offset + density · ln λ + root / √h

with h the cube root of its volume, λ the length of the branch over the usual one of its row (leaves are no smaller on
shorter branches, so that these are denser). Each order has an offset, each species the other two. They are fitted
once, by parallel rays through a few plants that are divided into tetrahedra of several sizes: as many rays as meet
nothing in truth shall on the mean pass through the tetrahedra. What is fitted is what is seen: whole stacks of cells.

The tetrahedra are those of a lattice of unit cubes, six in each around its diagonal (Kuhn, "Some combinatorial lemmas
in topology", 1960): the order of a point's coordinates within the cube tells which one it is in. Outlines stand for the
meshes of grown plants and are much faster, because only what lies in the way of a ray gets corners.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..arrays import GOLDEN_TURN, Floats, Integers, Mask, Table, spiral, spread
from ..growth.axes import Axes
from ..growth.foliage import leaf_forms, leaf_keys, leaf_places, place_leaves, settled
from ..growth.growth import leaf_counts, open_branches, radius_at, trunks
from ..growth.hashing import key_of_seed, mix, uniform
from ..growth.seeds import Branches, Seeds
from ..leaves.models import Forms, LeafModel
from ..storage import cached
from .averages import tube_perimeter

#: Planes between the tetrahedra, as whole values of these sums.
_PLANES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, -1, 0], [0, 1, -1], [1, 0, -1]], dtype=np.float64)
# Number of the tetrahedron by (x > y) + 2 (y > z) + 4 (x > z); two of the eight do not occur.
_NUMBER = np.array([0, 1, 2, 0, 0, 3, 4, 5])


def basis(direction: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors across a unit vector (3,), and across one another."""
    helper = np.eye(3)[2] if abs(direction[2]) < 0.9 else np.eye(3)[0]
    u = np.cross(helper, direction)
    u /= np.linalg.norm(u)
    return u, np.cross(direction, u)


def covered(corners: Floats, first: Integers, number: Integers) -> tuple[Integers, Integers]:
    """Points of whole coordinates that flat polygons cover, by the even-odd rule.

    Parameters
    ----------
    corners : (c, 2) float64
        Polygon after polygon, each in order.
    first, number : (f,) int
        First corner of each polygon, and how many it has.

    Returns
    -------
    polygon : (m,) int
    point : (m, 2) int64
    """
    if len(first) == 0:
        return np.zeros(0, np.intp), np.zeros((0, 2), np.int64)
    x, y = np.ascontiguousarray(corners.T)
    following = np.arange(1, len(x) + 1)
    following[first + number - 1] = first
    # Sides cross the lines of the lattice from the one above their lower end to the last below their upper end.
    ends = np.ceil(y)
    low, high = np.minimum(ends, ends[following]), np.maximum(ends, ends[following])
    side, step = spread((high - low).astype(np.int64))
    row = low[side].astype(np.int64) + step
    x0, y0, x1, y1 = x[side], y[side], x[following[side]], y[following[side]]
    crossing = x0 + (x1 - x0) * (row - y0) / (y1 - y0)
    polygon = np.repeat(np.arange(len(first)), number)[side]
    if len(crossing) == 0:
        return np.zeros(0, np.intp), np.zeros((0, 2), np.int64)
    # On each line a polygon begins and ends in turn. One key is sorted many times faster than three.
    lines = polygon * float(np.ptp(row) + 1) + (row - row.min())
    order = np.argsort(lines + (crossing - crossing.min()) * (0.5 / max(float(np.ptp(crossing)), 1e-300)))
    begin, end = np.ceil(crossing[order]).astype(np.int64).reshape(-1, 2).T
    part, step = spread(np.maximum(end - begin, 0))
    entry = order[::2][part]
    return polygon[entry], np.stack([begin[part] + step, row[entry]], axis=1)


def cell_numbers(points: Sequence[Floats], shape: Integers) -> Integers:
    """Tetrahedron (n,) of 6 × x × y × z that each point (3, n) is in; those beside the lattice are moved into it."""
    cube = [np.clip(along.astype(np.int64), 0, most - 1) for along, most in zip(points, shape, strict=True)]
    x, y, z = (along - low for along, low in zip(points, cube, strict=True))
    kind = _NUMBER[(x > y) + 2 * (y > z) + 4 * (x > z)]
    return ((cube[0] * shape[1] + cube[1]) * shape[2] + cube[2]) * 6 + kind


def _path_lengths(origin: Floats, direction: Floats, shape: Integers) -> tuple[Integers, Integers, Floats]:
    """Ray, cell and length (m,) of parts of parallel rays from origins (n, 3) in a lattice of tetrahedra; in cubes."""
    steep = np.where(np.abs(direction) < 1e-9, 1e-9, direction)
    ends = np.sort(np.stack([-origin / steep, (shape - origin) / steep]), axis=0)
    enter, leave = ends[0].max(axis=1), ends[1].min(axis=1)
    inside = np.flatnonzero(leave > enter)
    enter, leave, origin = enter[inside], leave[inside], origin[inside]
    every = np.arange(len(inside))
    ray, along = [every, every], [enter, leave]
    for plane in _PLANES:
        start, slope = origin @ plane, float(steep @ plane)
        if abs(slope) < 1e-9:
            continue
        reach = np.sort(np.stack([start + slope * enter, start + slope * leave]), axis=0)
        low = np.ceil(reach[0])
        owner, step = spread(np.maximum(np.floor(reach[1]) - low + 1, 0).astype(np.int64))
        ray.append(owner)
        along.append((low[owner] + step - start[owner]) / slope)
    ray, along = np.concatenate(ray), np.concatenate(along)
    order = np.lexsort([along, ray])
    ray, along = ray[order], along[order]
    part = np.flatnonzero((ray[1:] == ray[:-1]) & (along[1:] > along[:-1]))
    ray, length, middle = ray[part], along[part + 1] - along[part], (along[part] + along[part + 1]) / 2
    points = [np.take(origin[:, k], ray) + steep[k] * middle for k in range(3)]
    return inside[ray], cell_numbers(points, shape), length


#: λ and 1 / λ, see `clumping`, are taken to be within e to this power.
WIDEST = 1.5


def _inwards(frame: NDArray[np.floating], direction: Floats) -> Floats:
    """A direction in the axes of frames (n, 3, 3), by component (3, n)."""
    return sum(direction[k] * frame[:, k].T for k in range(3))


@dataclass(frozen=True)
class LeafOutlines:
    """Leaves of one form: n of them."""

    model: LeafModel
    base: Floats
    frame: Floats
    size: Floats

    def __len__(self) -> int:
        return len(self.size)

    @property
    def middle(self) -> Floats:
        """Middle (n, 3) of each."""
        center = self.model.positions.mean(axis=0)
        return self.base + self.size[:, None] * sum(self.frame[:, :, k] * center[k] for k in range(3))

    @property
    def radius(self) -> Floats:
        """Distance (n,) within which all of each is."""
        positions = self.model.positions
        return self.size * np.linalg.norm(positions - positions.mean(axis=0), axis=1).max()

    def shown(self, direction: Floats) -> Floats:
        """Area (n,) that the faces of each show in a direction, m²."""
        local = _inwards(self.frame, direction)
        return sum(np.abs(face @ local) for face in self.model.face_vectors) * self.size**2

    def outlines(self, near: Integers, u: NDArray, v: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Corners (c, 2) of the faces of some, seen along the third of three axes, first corners and numbers (f,)."""
        model, base, frame, size = self.model, self.base[near], self.frame[near], self.size[near]
        local = (_inwards(frame, axis).T @ model.positions.T for axis in (u, v))
        flat = ((base @ axis)[:, None] + size[:, None] * along for axis, along in zip((u, v), local, strict=True))
        corners = np.stack([one[:, model.corner_verts].ravel() for one in flat], axis=1)
        first = np.arange(len(near))[:, None] * len(model.corner_verts) + model.face_offsets[:-1]
        return corners, first.ravel(), np.tile(np.diff(model.face_offsets), len(near))


@dataclass(frozen=True)
class WoodOutlines:
    """Straight parts of branches with the radii of circles that are as wide as their tubes on the mean."""

    ends: Floats
    radii: Floats

    def __len__(self) -> int:
        return len(self.radii)

    @property
    def middle(self) -> Floats:
        """Middle (n, 3) of each."""
        return self.ends.mean(axis=1)

    @property
    def radius(self) -> Floats:
        """Distance (n,) within which all of each is."""
        return np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1) / 2 + self.radii.max(axis=1)

    def shown(self, direction: Floats) -> Floats:
        """Area (n,) that each part shows in a direction, m²: that of its outline."""
        along = self.ends[:, 1] - self.ends[:, 0]
        return self.radii.sum(axis=1) * np.linalg.norm(along - (along @ direction)[:, None] * direction, axis=1)

    def outlines(self, near: Integers, u: NDArray, v: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Corners (4 n, 2), first corners and numbers (n,), as `LeafOutlines.outlines`; one quad each."""
        flat = self.ends[near] @ np.stack([u, v], axis=1)
        along = flat[:, 1] - flat[:, 0]
        aside = np.stack([-along[:, 1], along[:, 0]], axis=1)
        aside /= np.maximum(np.linalg.norm(aside, axis=1), 1e-12)[:, None]
        low, high = (aside * self.radii[near, k, None] for k in (0, 1))
        corners = np.stack([flat[:, 0] - low, flat[:, 1] - high, flat[:, 1] + high, flat[:, 0] + low], axis=1)
        return corners.reshape(-1, 2), np.arange(len(near)) * 4, np.full(len(near), 4)


@dataclass(frozen=True)
class PlantElements:
    """All leaves and parts of branches of a sub-plant: those of each of its parts, one after the other.

    ``middle`` (3, n) and ``radius`` (n,) are spheres around them, ``group`` (n,) is the number of their order, and
    ``dense`` (n,) the logarithm of λ of the branch that bears them.
    """

    parts: list[LeafOutlines | WoodOutlines]
    middle: Floats
    radius: Floats
    group: Integers
    dense: Floats

    def covered(self, near: Mask, u: Floats, v: Floats, spacing: float, low: Floats | float = 0.0) -> Integers:
        """Points (m, 2) of a lattice on the plane of two axes that outlines of some things, a mask (n,), cover."""
        points, begin = [], 0
        for part in self.parts:
            corners, first, number = part.outlines(np.flatnonzero(near[begin : begin + len(part)]), u, v)
            points.append(covered(corners / spacing - low, first, number)[1])
            begin += len(part)
        return np.concatenate(points)


def elements_of(
    rows: Table, forms: Forms, subplants: Branches, group: Integers, first: int, length: Floats, orders: int = -1
) -> PlantElements:
    """Grow a sub-plant to its last leaf, or so many orders of it.

    Parameters
    ----------
    forms : by kind
        Models of leaves of the species.
    subplants : Branches of one species
    group : (k,) int
        Number of the order of each of the species' rows.
    first : int
        First of these.
    length : (r,) float64
        Usual length of a branch of each row at plant scale 1, meters.
    """
    parts, groups, dense = [], [], []
    while len(subplants) and orders:
        whole, _, subplants, _ = open_branches(rows, subplants)
        bodies, lines = whole.branches, whole.lines
        orders -= 1
        ratio = np.log(np.maximum(bodies.length, 1e-12) / (bodies.scale * length[bodies.row]))
        ratio = np.clip(ratio, -WIDEST, WIDEST)
        for part, owner in (_wood(rows, bodies, lines), *_leaves(rows, forms, bodies, lines)):
            parts.append(part)
            groups.append(group[bodies.row[owner] - first])
            dense.append(ratio[owner])
    middle = np.concatenate([p.middle.T for p in parts], axis=1)
    radius = np.concatenate([p.radius for p in parts])
    return PlantElements(parts, middle, radius, np.concatenate(groups), np.concatenate(dense))


def _wood(rows: Table, bodies: Branches, lines: Axes) -> tuple[WoodOutlines, Integers]:
    owner, index = spread(lines.segments)
    branches, number = bodies.take(owner), lines.segments[owner]
    ends = np.stack([lines.knot(owner, index + k) for k in (0, 1)], axis=1)
    radii = np.stack([radius_at(rows, branches, (index + k) / number) for k in (0, 1)], axis=1)
    return WoodOutlines(ends, radii * (tube_perimeter(rows["sides"][branches.row]) / (2 * np.pi))[:, None]), owner


def _leaves(rows: Table, forms: Forms, bodies: Branches, lines: Axes) -> Iterator[tuple[LeafOutlines, Integers]]:
    counts = leaf_counts(rows, bodies)
    for row in np.unique(bodies.row[counts > 0]):
        bearers = np.flatnonzero((bodies.row == row) & (counts > 0))
        branches, branch_lines = bodies.take(bearers), lines.take(bearers)
        owner, index = spread(counts[bearers])
        key = leaf_keys(branches, owner, index)
        t = leaf_places(rows, branches, owner, index, counts[bearers], key)
        leaves = place_leaves(rows, branches, branch_lines, owner, index, key, t)
        frame = settled(rows, branches.row[:1], leaves.frame, leaves.light, leaves.sky)
        models = forms[int(rows["leaf_kind"][row])]
        form = leaf_forms(len(models), key)
        for k, model in enumerate(models):
            of = np.flatnonzero(form == k)
            if len(of):
                yield LeafOutlines(model, leaves.position[of], frame[of], leaves.size[of]), bearers[owner[of]]


_METHOD = 1  # raise it when factors are found in another way
#: Polygons that are grown of each species, if two plants have no more than a number, and plants at most; of plants that
#: are still larger than the last number some sub-plants are taken.
_POLYGONS, _PAIR, _PLANTS, _LARGEST = 200_000, 500_000, 6, 400_000
_VIEWS = 4  # directions that plants are seen from, distributed among them, but at least
_LEAST_VIEWS = 2  # for each
_RAYS = 28  # to a side of what is looked at
_SIZES = 4  # of cells,
_FINEST, _COARSEST = 2.0, 0.2  # from so many widths of a leaf to this fraction of the plant
_SEGMENTS = 50_000  # of rays, for each size: fewer rays through finer cells
#: Root (in widths of a leaf), density, offset, and difference of an order's from that where nothing is known; and the
#: weights that these have against what is seen.
_PRIOR = np.array([0.5, 0.3, 0.5, 0.0])
_RIDGE = np.array([5e-4, 3e-3, 5e-4, 0.02])
_STEPS = 15
_AT, _CELL = 121, 124  # draws of this module
_OFFSETS = 0.0, 1.5
#: Factors are never less or more than this.
LEAST, MOST = 0.1, 1.5


@dataclass(frozen=True)
class Clumping:
    """What the factor of every row follows from; arrays by row."""

    #: whole and branch_only, (r,): offsets: of a whole sub-plant, and of what its branch itself bears.
    whole: Floats
    branch_only: Floats
    root: Floats  # (r,): √m, at plant scale 1
    density: Floats  # (r,)
    length: Floats  # (r,): usual length of the branch at plant scale 1, meters

    def coefficients(self, branches: Branches, offset: Floats) -> Floats:
        """What is constant and what is divided by √h (n, 2), of branches; offsets are `whole` or `branch_only`."""
        row = branches.row
        relative = np.log(np.maximum(branches.length, 1e-12) / (branches.scale * self.length[row]))
        constant = offset[row] + self.density[row] * np.clip(relative, -WIDEST, WIDEST)
        return np.stack([constant, self.root[row] * np.sqrt(branches.scale)], axis=1)


def factors(coefficients: Floats, volumes: Floats) -> Floats:
    """Factor on the extinction (n,) of cells, from the area-weighted means (n, 2) of `Clumping.coefficients`."""
    return np.clip(coefficients[:, 0] + coefficients[:, 1] * volumes ** (-1 / 6), LEAST, MOST)


def fit_clumping(
    rows: Table, forms: Sequence[Forms], area: Floats, polygons: Floats, width: Floats, length: Floats
) -> Clumping:
    """Fit every species.

    Parameters
    ----------
    rows : (r,) parameter table
    forms : by species and kind
        Models of leaves.
    area : (r, r) float64
        Expected optical area of a sub-plant by the row that contributes it.
    polygons, width, length : (r,) float64
        Expected faces of a sub-plant, width of its leaves (or 0) and length of its branch, meters at plant scale 1.
    """
    root, density, bias = np.zeros((3, len(rows)))
    usual = np.where(length > 0, length, 1.0)
    trunk = np.flatnonzero(np.diff(rows["species"], prepend=-1))
    for first, end in zip(trunk, [*trunk[1:], len(rows)], strict=True):
        every, leaves = slice(int(first), int(end)), forms[rows["species"][first]]
        fit = partial(_fitted, rows, leaves, every, polygons, width[first], usual)
        name = fingerprint(rows[every], leaves, _METHOD)
        root[every], density[every], bias[every] = cached("clumping", name, (3, int(end - first)), fit)
    total = area.sum(axis=1)
    return Clumping(np.where(total > 0, area @ bias / np.where(total > 0, total, 1), bias), bias, root, density, usual)


def _fitted(rows: Table, forms: Forms, every: slice, polygons: Floats, width: float, usual: Floats) -> Floats:
    """Roots, densities and own offsets (3, r) of the rows of one species."""
    orders, group = np.unique(rows["order"][every], return_inverse=True)
    group = group.reshape(-1)
    things = [elements_of(rows, forms, one, group, every.start, usual) for one in _plants(rows, every.start, polygons)]
    finest = _FINEST * max(width, 0.0)
    parts = [seen for n, one in enumerate(things) for seen in _rays(one, len(orders), finest, n, len(things))]
    unit = np.sqrt(finest / _FINEST) if finest > 0 else np.sqrt(usual[every.start] / 100)
    coefficients = _solved(*(np.concatenate(values) for values in zip(*parts, strict=True)), unit)
    bias = np.clip(coefficients[2] + coefficients[3:][group], *_OFFSETS)
    return np.stack([np.full(len(bias), coefficients[0] * unit), np.full(len(bias), coefficients[1]), bias])


def _plants(rows: Table, first: int, polygons: Floats) -> list[Branches]:
    """Plants of a species, or the sub-plants of some that are large."""
    one = max(polygons[first], 1)
    number = int(np.clip(_POLYGONS / one, 2 if 2 * one <= _PAIR else 1, _PLANTS))
    seed = mix(key_of_seed(np.arange(number)) ^ np.uint64(0xC1A3)).view(np.int64)
    plants = trunks(rows, replace(Seeds.upright(number, rows["species"][first]), seed=seed))
    if one > _LARGEST:
        number = _PLANTS
    while polygons[plants.row].max() > _LARGEST:
        grown = open_branches(rows, plants)[2]
        if len(grown) == 0:
            break
        order = np.argsort(-polygons[grown.row], kind="stable")
        order = order[: (polygons[grown.row] >= 0.5 * polygons[grown.row].max()).sum()]
        plants = grown.take(order[(np.arange(min(number, len(order))) * len(order)) // min(number, len(order))])
    return [plants.take(slice(i, i + 1)) for i in range(len(plants))]


def _rays(
    things: PlantElements, groups: int, finest: float, plant: int, plants: int
) -> Iterator[tuple[NDArray, NDArray, NDArray]]:
    """Whether rays through a sub-plant meet anything (k,), their optical depths (k, 3 + groups) and weights (k,).

    Depths are those of cells evenly filled with what they hold: divided by √h, times ln λ, as they are, and by order.
    """
    key = key_of_seed(np.array([plant]))
    low, high = things.middle.min(axis=1), things.middle.max(axis=1)
    # A bare stem is one thing, and has no extent between middles.
    extent = max(float((high - low).max()), float(things.radius.max()))
    finest = max(finest, extent / 100)
    middling = float(np.maximum(high - low, extent / 100).prod() ** (1 / 3))
    sizes = np.geomspace(finest, max(_COARSEST * middling, 2 * finest), _SIZES)
    grids = []
    for s, h in enumerate(sizes):
        side = h * 6 ** (1 / 3)  # of the cube that is divided into six such tetrahedra
        corner = low - side * np.array([uniform(key, _CELL + 8 * (3 * s + k))[0] for k in range(3)])
        shape = np.maximum(np.ceil((high - corner) / side), 1).astype(np.int64)
        cells, within = np.unique(cell_numbers((things.middle - corner[:, None]) / side, shape), return_inverse=True)
        grids.append((h, side, corner, shape, cells, within.reshape(-1)))
    # Each plant is seen from other directions on the half sphere.
    views = max(_VIEWS // plants, _LEAST_VIEWS)
    i = plant + np.arange(views) * plants + 0.5
    segments = _SEGMENTS / (plants * views)
    for d, direction in enumerate(spiral(i / (views * plants), i, GOLDEN_TURN)):
        origin, met = _seen_along(things, direction, uniform(key, _AT + 8 * d)[0])
        shown = np.concatenate([p.shown(direction) for p in things.parts])
        pick = np.argsort(mix(key ^ np.arange(len(origin)).astype(np.uint64)), kind="stable")
        for h, side, corner, shape, cells, within in grids:
            count = len(cells)
            density = np.bincount(within * groups + things.group, shown, count * groups).reshape(-1, groups) / h**3
            dense = np.bincount(within, shown * things.dense, count) / h**3
            rays = np.sort(pick[: max(int(segments / (3.5 * extent / side + 1)), 100)])
            ray, cell, length = _path_lengths((origin[rays] - corner) / side, direction, shape)
            index = np.minimum(np.searchsorted(cells, cell), count - 1)
            full = np.flatnonzero(cells[index] == cell)
            ray, index = ray[full], index[full]
            held = np.concatenate([dense[index, None], density[index]], axis=1) * (length[full] * side)[:, None]
            depth = np.stack([np.bincount(ray, held[:, k], len(rays)) for k in range(groups + 1)], axis=1)
            total = depth[:, 1:].sum(axis=1)
            use = np.flatnonzero(met[rays] | (total > 0))
            depth = np.stack((total / np.sqrt(h), depth[:, 0], total, *depth[:, 1:].T), axis=1)[use]
            yield met[rays][use], depth, np.full(len(use), 1 / max(len(use), 1))


def _seen_along(things: PlantElements, direction: Floats, offset: float) -> tuple[Floats, Mask]:
    """Origins (k, 3) of parallel rays on a grid over a sub-plant, and whether each meets anything (k,)."""
    u, v = basis(direction)
    flat = np.stack([sum(axis[k] * things.middle[k] for k in range(3)) for axis in (u, v)])
    least, most = flat.min(axis=1), flat.max(axis=1)
    # Middles in a line have no area, and as fine a grid as they ask for would have no end.
    spacing = float(np.sqrt(np.maximum(most - least, things.radius.max()).prod())) / _RAYS
    low = np.floor(least / spacing - 1) + offset  # of rays: at spacing × (low + i)
    shape = np.ceil(most / spacing - low + 1).astype(np.int64)
    place = flat / spacing - low[:, None]
    near = (np.abs(place - np.rint(place)) <= things.radius / spacing).all(axis=0)
    met = np.zeros(shape.prod(), bool)
    ray = things.covered(near, u, v, spacing, low)
    inside = ((ray >= 0) & (ray < shape)).all(axis=1)
    met[ray[inside, 0] * shape[1] + ray[inside, 1]] = True
    i = np.arange(len(met))
    grid = (np.stack([i // shape[1], i % shape[1]], axis=1) + low) * spacing
    return grid[:, :1] * u + grid[:, 1:] * v, met


def _solved(met: Mask, depth: Floats, weight: Floats, unit: float) -> Floats:
    """Coefficients (k,) with which depths (n, k) let through as many rays as meet nothing, by Newton's method.

    Equations are weighted by the contribution of each coefficient to a ray's depth: one for each. The first coefficient
    is one of 1 / √h, with h in units whose square root is given.
    """
    depth = depth * np.where(np.arange(depth.shape[1]) == 0, unit, 1.0)
    weight = depth * (weight / weight.sum() / np.maximum(depth[:, 2], 1e-12))[:, None]
    kind = np.minimum(np.arange(depth.shape[1]), len(_PRIOR) - 1)
    prior, coefficients = _PRIOR[kind], _PRIOR[kind]
    for _ in range(_STEPS):
        through = np.exp(-np.maximum(depth @ coefficients, 0))
        error = weight.T @ (1 - through - met)
        slope = (weight * through[:, None]).T @ depth
        ridge = _RIDGE[kind] * slope[2, 2]
        step = np.linalg.solve(slope + np.diag(ridge), -error - ridge * (coefficients - prior))
        largest = float(np.abs(step).max())
        coefficients = coefficients + step / max(1.0, largest)
        if largest < 1e-4:
            break
    return coefficients


#: Fields that depend on what other species there are, one that others give, and one that changes no area.
_PLACES = {"species", "next", "drawn_rows", "sunlit", "dead"}


def fingerprint(rows: Table, forms: Forms, method: int) -> str:
    """Hash of a species' parameters and the forms of its leaves: 16 hexadecimal digits.

    Parameters
    ----------
    rows : (r,) parameter table
        Of this species alone.
    forms : by kind
        Models of leaves.
    method : int
        Counts the ways in which results were found so far.
    """
    content = hashlib.sha256(f"{method}".encode())
    for name in sorted(set(rows.dtype.names) - _PLACES):
        # Rounded, because versions of numpy may differ in the last digit.
        value = np.round(rows[name].astype(np.float64), 6) + 0.0
        content.update(name.encode() + np.ascontiguousarray(value).tobytes())
    for form in (model for models in forms for model in models):
        content.update(np.ascontiguousarray(form.positions).tobytes())
        content.update(np.ascontiguousarray(form.corner_verts).tobytes())
    return content.hexdigest()[:16]
