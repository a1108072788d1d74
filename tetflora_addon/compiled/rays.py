# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parallel rays: through a lattice of tetrahedra, and against the outlines of leaves and wood.

The lattice is made of unit cubes, each divided into six tetrahedra around its diagonal (Kuhn, "Some combinatorial
lemmas in topology", 1960): the order of a point's coordinates within the cube tells which one it is in. Outlines stand
for the meshes of grown plants and are much faster, because only what lies in the way of a ray gets corners.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Mask, Table, spread
from ..growth.axes import Axes
from ..growth.foliage import leaf_forms, leaf_keys, leaf_places, place_leaves, settled
from ..growth.growth import leaf_counts, open_branches, radius_at
from ..growth.seeds import Branches
from ..leaves.models import LeafModel
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
    there = np.arange(1, len(x) + 1)
    there[first + number - 1] = first
    # Sides cross the lines of the lattice from the one above their lower end to the last below their upper end.
    ends = np.ceil(y)
    low, high = np.minimum(ends, ends[there]), np.maximum(ends, ends[there])
    side, step = spread((high - low).astype(np.int64))
    row = low[side].astype(np.int64) + step
    x0, y0, x1, y1 = x[side], y[side], x[there[side]], y[there[side]]
    at = x0 + (x1 - x0) * (row - y0) / (y1 - y0)
    polygon = np.repeat(np.arange(len(first)), number)[side]
    if len(at) == 0:
        return np.zeros(0, np.intp), np.zeros((0, 2), np.int64)
    # On each line a polygon begins and ends in turn. One key is sorted many times faster than three.
    lines = polygon * float(np.ptp(row) + 1) + (row - row.min())
    order = np.argsort(lines + (at - at.min()) * (0.5 / max(float(np.ptp(at)), 1e-300)))
    begin, end = np.ceil(at[order]).astype(np.int64).reshape(-1, 2).T
    part, step = spread(np.maximum(end - begin, 0))
    some = order[::2][part]
    return polygon[some], np.stack([begin[part] + step, row[some]], axis=1)


def cell_numbers(points: Sequence[Floats], shape: Integers) -> Integers:
    """Tetrahedron (n,) of 6 × x × y × z that each point (3, n) is in; those beside the lattice are moved into it."""
    cube = [np.clip(along.astype(np.int64), 0, most - 1) for along, most in zip(points, shape, strict=True)]
    x, y, z = (along - low for along, low in zip(points, cube, strict=True))
    kind = _NUMBER[(x > y) + 2 * (y > z) + 4 * (x > z)]
    return ((cube[0] * shape[1] + cube[1]) * shape[2] + cube[2]) * 6 + kind


def path_lengths(origin: Floats, direction: Floats, shape: Integers) -> tuple[Integers, Integers, Floats]:
    """Ways of parallel rays through the tetrahedra of a lattice.

    Parameters
    ----------
    origin : (n, 3) float64
        In units of the lattice's cubes.
    direction : (3,) float64
        Unit vector.
    shape : (3,) int64
        Cubes along each axis.

    Returns
    -------
    ray, cell : (m,) int64
    length : (m,) float64
        In the same units.
    """
    steep = np.where(np.abs(direction) < 1e-9, 1e-9, direction)
    ends = np.sort(np.stack([-origin / steep, (shape - origin) / steep]), axis=0)
    enter, leave = ends[0].max(axis=1), ends[1].min(axis=1)
    inside = np.flatnonzero(leave > enter)
    enter, leave, origin = enter[inside], leave[inside], origin[inside]
    every = np.arange(len(inside))
    ray, at = [every, every], [enter, leave]
    for plane in _PLANES:
        start, slope = origin @ plane, float(steep @ plane)
        if abs(slope) < 1e-9:
            continue
        reach = np.sort(np.stack([start + slope * enter, start + slope * leave]), axis=0)
        low = np.ceil(reach[0])
        owner, step = spread(np.maximum(np.floor(reach[1]) - low + 1, 0).astype(np.int64))
        ray.append(owner)
        at.append((low[owner] + step - start[owner]) / slope)
    ray, at = np.concatenate(ray), np.concatenate(at)
    order = np.lexsort([at, ray])
    ray, at = ray[order], at[order]
    part = np.flatnonzero((ray[1:] == ray[:-1]) & (at[1:] > at[:-1]))
    ray, length, middle = ray[part], at[part + 1] - at[part], (at[part] + at[part + 1]) / 2
    points = [np.take(origin[:, k], ray) + steep[k] * middle for k in range(3)]
    cell = cell_numbers(points, shape)
    return inside[ray], cell, length


_SKY = np.array([0.0, 0.0, 1.0])
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
        flat = [
            (base @ axis)[:, None] + size[:, None] * (_inwards(frame, axis).T @ model.positions.T) for axis in (u, v)
        ]
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
        across = along - (along @ direction)[:, None] * direction
        return self.radii.sum(axis=1) * np.linalg.norm(across, axis=1)

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
        found, begin = [], 0
        for part in self.parts:
            corners, first, number = part.outlines(np.flatnonzero(near[begin : begin + len(part)]), u, v)
            found.append(covered(corners / spacing - low, first, number)[1])
            begin += len(part)
        return np.concatenate(found)


def elements_of(
    rows: Table,
    forms: Sequence[Sequence[LeafModel]],
    subplants: Branches,
    group: Integers,
    first: int,
    length: Floats,
    orders: int | None = None,
) -> PlantElements:
    """Grow a sub-plant to its last leaf.

    Parameters
    ----------
    rows : parameter table
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
    while len(subplants) and orders != 0:
        whole, _, subplants, _ = open_branches(rows, subplants)
        bodies, lines = whole.branches, whole.lines
        orders = None if orders is None else orders - 1
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
    some, number = bodies.take(owner), lines.segments[owner]
    ends = np.stack([lines.knot(owner, index + k) for k in (0, 1)], axis=1)
    radii = np.stack([radius_at(rows, some, (index + k) / number) for k in (0, 1)], axis=1)
    return WoodOutlines(ends, radii * (tube_perimeter(rows["sides"][some.row]) / (2 * np.pi))[:, None]), owner


def _leaves(
    rows: Table, forms: Sequence[Sequence[LeafModel]], bodies: Branches, lines: Axes
) -> Iterator[tuple[LeafOutlines, Integers]]:
    counts = leaf_counts(rows, bodies)
    for row in np.unique(bodies.row[counts > 0]):
        some = np.flatnonzero((bodies.row == row) & (counts > 0))
        branches, own = bodies.take(some), lines.take(some)
        owner, index = spread(counts[some])
        key = leaf_keys(branches, owner, index)
        t = leaf_places(rows, branches, owner, index, counts[some], key)
        leaves = place_leaves(rows, branches, own, owner, index, key, t)
        frame = settled(rows, branches.row[:1], leaves.frame, leaves.light, _SKY)
        models = forms[int(rows["leaf_kind"][row])]
        form = leaf_forms(len(models), key)
        for k, model in enumerate(models):
            of = np.flatnonzero(form == k)
            if len(of):
                yield LeafOutlines(model, leaves.position[of], frame[of], leaves.size[of]), some[owner[of]]
