# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants of few faces, or as the bounds of what was compiled: all plants of a forest as two arrays for the viewport.

Nothing is grown. A crown is two rings of corners between its lowest and its highest leaves, as wide as the samples of
its species; a trunk is two crossed triangles. Every plant has its own length, as its seed says.

Plants of which only the size is known, such as assets, as double cones or boxes for the viewport. Of very many, all are
points with the form of their crowns, and those that look largest have faces.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from ..arrays import Floats, Floats32, Integers, Integers32
from ..camera.camera import origin_near
from ..compiled.flora import Flora, extents, outlines
from ..growth.growth import trunk_lengths, trunks
from ..growth.seeds import Branches, Seeds
from .levels import as_shown

#: Plants that a preview shows as meshes; of more, `thinned` chooses.
MOST_PLANTS = 50_000
#: Plants that are crowns with faces; of more, `nearest` chooses.
MOST_FACES = 10_000
#: Corners of each of a crown's rings.
SIDES = 4
#: Heights of the rings, and of the band around each whose leaves set its width, as fractions of the crown's height.
_RINGS, _BAND = (0.25, 0.65), 0.2
#: Fraction of the leaves that lie below a crown, and above it, and within its rings.
_BELOW, _ABOVE, _WITHIN = 0.03, 0.995, 0.85
#: Width of the crown of a bare plant over that in leaf, so that it is seen to be bare.
_BARE = 0.45
#: Direction to the light, and the fraction of light in its shade.
_SUN, _SHADE = np.array([-0.45, -0.35, 0.82]), 0.45
#: Radius of a trunk over its length, at least; plants of a species that its looks are taken from.
_THIN, _SOME = 0.012, 64
#: From so far out of the upright on, what a plant is does not stand but lies, as fallen branches do; radians.
_LYING = 0.25 * np.pi
_known: WeakKeyDictionary[Flora, Floats] = WeakKeyDictionary()
_ANGLE = np.arange(SIDES) * 2.0 * np.pi / SIDES
_AROUND = np.stack([np.cos(_ANGLE), np.sin(_ANGLE), 0 * _ANGLE], axis=1)
#: Corners of a plant: the crown's lowest, its rings, its highest, the foot of the trunk, and its middle.
_LOWER, _UPPER, _FOOT = (slice(first, first + SIDES) for first in (1, 1 + SIDES, 2 + 2 * SIDES))
_CROWN = slice(_FOOT.start)
_HEIGHTS = np.array([0.0, *np.repeat(_RINGS, SIDES), 1.0])  # of those of the crown, as fractions of its height
#: Directions out of a plant at its corners; the middle of the trunk is in the shade.
_OUTWARD = [(_AROUND + [0.0, 0.0, up]) / np.hypot(1.0, up) for up in (-0.1, 0.5)]
_AXIAL = np.array([[[0.0, 0.0, up]] for up in (-1.0, 1.0, 0.0)])
_NORMALS = np.concatenate([_AXIAL[0], *_OUTWARD, _AXIAL[1], _AROUND, _AXIAL[2]]).astype(np.float32)


@dataclass(frozen=True)
class CrownPoints:
    """Very many plants as points."""

    positions: Floats32  # (n, 3): where they stand, meters from the origin of their `Shapes`
    axes: Floats32  # (n, 3): unit vectors along trunks
    forms: Floats32  # (n, 4): heights of the lowest and the highest leaves, radii of the crown's rings in leaf; meters
    kinds: Integers32  # (n,): rows of ``looks``
    looks: Floats32  # (k, 7): color of leaves, width of the crown over that in leaf, color of wood; linear RGB


@dataclass(frozen=True)
class Shapes:
    """Many plants in one mesh, or as points."""

    positions: Floats32  # (v, 3): meters from ``origin``
    colors: Floats32  # (v, 3): as a screen shows them, shaded by a fixed light
    indices: Integers32  # (m, 3) for faces, or (m, 2) int32 for edges
    plants: int  # plants that are shown
    of: int  # plants that there are
    origin: Floats  # (3,): near most plants, meters, world space
    crowns: CrownPoints | None = None  # all plants, instead of the mesh


def light_plants(flora: Flora, seeds: Seeds, most: int = MOST_FACES) -> Shapes:
    """Plants as crowns and trunks of some twenty triangles each, in the mean colors of their species.

    More than ``most`` plants are points with the form and color of their crowns, of which `nearest` has the faces;
    ``flora`` has the species in the order of ``seeds.identifiers``.
    """
    if len(seeds) > most:
        return crowns_of(flora, seeds)
    of, origin, trunk = _shown(flora, seeds, most)
    low, high, *radii = _profiles(flora)[flora.rows["species"][trunk.row]].T
    length, low, wider, light = outlines(flora, trunk, low, high)
    leaves, left, wood = _looks(flora, trunk)
    heights = length[:, None] * np.column_stack([low, high])
    widths = (length * wider * left)[:, None] * np.column_stack(radii)
    # The wood's own radius would be less than a pixel in the view of a forest.
    foot = np.maximum(trunk.radius, _THIN * length)
    reach = 1.0 + light @ _AROUND[:, :2].T
    forms = np.column_stack([heights, widths])
    positions, colors = _crowns(trunk.position, trunk.frame, forms, foot, leaves, wood, reach)
    return Shapes(positions, colors, _repeated(_faces(), len(_NORMALS), len(trunk)), len(trunk), of, origin)


def _looks(flora: Flora, trunk: Branches) -> tuple[Floats, Floats, Floats]:
    """Of plants (n,): colors of crowns (n, 3), linear; their width over that in leaf (n,); colors of wood (n, 3)."""
    wood, leaves, width = flora.wood_color[trunk.row], flora.leaf_colors(trunk), np.ones(len(trunk))
    if trunk.year is not None:
        left = np.minimum(flora.day.leaf_share(trunk), 1.0)
        width = _BARE + (1.0 - _BARE) * left
        leaves = wood + left[:, None] * (leaves - wood)
    return np.where((flora.leaf_count[trunk.row] > 0)[:, None], leaves, wood), width, wood


def _crowns(
    feet: Floats, frame: Floats, forms: Floats, foot: Floats, leaves: Floats, wood: Floats, reach: Floats | float = 1.0
) -> tuple[Floats32, Floats32]:
    """Corners (v, 3) of crowns and trunks of n plants, and their colors as a screen shows them.

    Meters: feet (n, 3), axes of trunks (n, 3, 3), heights of the lowest and highest leaves and radii of two rings
    (n, 4), radii of trunks (n,), and factors on radii to all sides (n, `SIDES`). Linear RGB (n, 3) of leaves and wood.
    """
    # Of single precision, as screens need no more: seasons go by while one looks on.
    local = np.zeros((len(feet), len(_NORMALS), 3), np.float32)
    low, high, *radii = forms.T
    for ring, radius in zip((_LOWER, _UPPER), radii, strict=True):
        local[:, ring] = (radius[:, None] * reach)[:, :, None] * _AROUND
    local[:, _FOOT] = foot[:, None, None] * _AROUND
    local[:, _CROWN, 2] = low[:, None] + (high - low)[:, None] * _HEIGHTS
    local[:, -1, 2] = low + 0.5 * (high - low)
    frame = frame.astype(np.float32)
    positions = local @ frame.transpose(0, 2, 1)
    positions += feet[:, None].astype(np.float32)
    sun = np.einsum("i,nij->nj", (_SUN / np.linalg.norm(_SUN)).astype(np.float32), frame)
    shone = _SHADE + (1.0 - _SHADE) * np.clip(np.einsum("nj,vj->nv", sun, _NORMALS), 0.0, 1.0)
    colors = shone[:, :, None] * leaves[:, None].astype(np.float32)
    colors[:, _FOOT.start :] = shone[:, _FOOT.start :, None] * wood[:, None].astype(np.float32)
    return positions.reshape(-1, 3), as_shown(colors).reshape(-1, 3)


def crowns_of(flora: Flora, seeds: Seeds) -> Shapes:
    """All plants as points, as `light_plants` makes many."""
    # Some tell where most are, as well as all.
    origin, rows = origin_near(seeds.position[:: max(len(seeds) // MOST_FACES, 1)]), flora.rows
    if seeds.crown is None:
        row, _, length = trunk_lengths(rows, seeds)
        forms = _profiles(flora).astype(np.float32)[rows["species"][row]] * length.astype(np.float32)[:, None]
    else:
        trunk = trunks(rows, seeds)
        low, high, *radii = _profiles(flora)[rows["species"][trunk.row]].T
        length, low, wider, _ = outlines(flora, trunk, low, high)
        forms = np.column_stack([low, high, *(wider * radius for radius in radii)]) * length[:, None]
    axes = seeds.frame[:, :, 2].astype(np.float32)
    lies = rows["angle"][flora.first_row, 0] > _LYING
    if lies.any():
        lying = np.flatnonzero(lies[seeds.species])
        axes[lying] = trunks(rows, seeds.take(lying)).frame[:, :, 2]
    place, looks = (seeds.position - origin).astype(np.float32), _looks_of_kinds(flora, seeds)
    crowns = CrownPoints(place, axes, forms.astype(np.float32, copy=False), seeds.species, looks)
    nothing = np.zeros((0, 3))
    return Shapes(nothing.astype(np.float32), nothing, nothing.astype(np.int32), len(seeds), len(seeds), origin, crowns)


def _looks_of_kinds(flora: Flora, seeds: Seeds) -> Floats32:
    """`CrownPoints.looks` of the species of a flora: means over `_SOME` plants of each, of fewer some twice."""
    order = np.argsort(seeds.species.astype(np.int16), kind="stable")  # of so few bits it counts instead of comparing
    number = np.bincount(seeds.species)
    places = (np.arange(_SOME) + 0.5) / _SOME * number[:, None] + (np.cumsum(number) - number)[:, None]
    sample = seeds.take(order[places[number > 0].astype(np.int64).ravel()])
    looks = np.zeros((len(flora.species), 7), np.float32)
    sample_looks = np.column_stack(_looks(flora, trunks(flora.rows, sample))).reshape(-1, _SOME, 7)
    looks[sample.species[::_SOME]] = sample_looks.mean(axis=1)
    return looks


def nearest(shapes: Shapes, eye: Floats, most: int = MOST_FACES) -> tuple[Shapes, float]:
    """Plants that look largest from a place (3,) in the world, with faces; the height over distance of the least."""
    crowns = shapes.crowns
    away = crowns.positions - (eye - shapes.origin).astype(np.float32)
    size = crowns.forms[:, 1] ** 2 / np.maximum(np.einsum("ni,ni->n", away, away), 1e-6)
    largest = np.argpartition(size, -most)[-most:] if len(size) > most else np.arange(len(size))
    largest = largest[np.argsort(-size[largest])]  # the nearest hide what is drawn after them, which then costs little
    return with_faces(shapes, largest), float(np.sqrt(size[largest].min(initial=np.inf)))


def with_faces(shapes: Shapes, points: Integers | slice = slice(None)) -> Shapes:
    """Points, or some (k,) of them, as crowns and trunks with faces."""
    crowns = shapes.crowns
    looks, forms, up = crowns.looks[crowns.kinds[points]], crowns.forms[points], crowns.axes[points]
    across = np.cross(up, np.where(np.abs(up[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    frame = np.stack([across, np.cross(up, across), up], axis=2)
    shown = np.column_stack([forms[:, :2], looks[:, 3:4] * forms[:, 2:]])
    foot, leaves, wood = _THIN * forms[:, 1], looks[:, :3], looks[:, 4:]
    positions, colors = _crowns(crowns.positions[points], frame, shown, foot, leaves, wood)
    return Shapes(positions, colors, _repeated(_faces(), len(_NORMALS), len(up)), len(up), shapes.of, shapes.origin)


def bounds_of_plants(flora: Flora, seeds: Seeds, most: int = MOST_PLANTS) -> Shapes:
    """Compiled bounds of plants as edges of boxes: the extent of their samples in the direction of their trunks."""
    of, origin, trunk = _shown(flora, seeds, most)
    radius, low, high = extents(flora, trunk).T * trunk.length
    corner, edges = _box(1.0, 0.0, 1.0)
    local = corner * [1.0, 1.0, 0.0] * radius[:, None, None]
    local[:, :, 2] = np.where(corner[:, 2] > 0.0, high[:, None], low[:, None])
    positions = np.einsum("nij,nvj->nvi", trunk.frame, local) + trunk.position[:, None]
    colors = np.repeat(as_shown(np.maximum(flora.leaf_colors(trunk), flora.wood_color[trunk.row])), 8, axis=0)
    indices = _repeated(edges, 8, len(trunk))
    return Shapes(positions.reshape(-1, 3).astype(np.float32), colors, indices, len(trunk), of, origin)


def thinned(seeds: Seeds, heights: Floats, most: int = MOST_PLANTS) -> Seeds:
    """At most so many plants, in proportion to how large they look: of a meadow under trees the grass is thinned.

    Parameters
    ----------
    heights : (s,) float64
        Of each kind, meters.
    """
    if len(seeds) <= most:
        return seeds
    order = np.argsort(seeds.species.astype(np.int16), kind="stable")  # so that each kind is thinned evenly
    size = (heights[seeds.species] * seeds.scale)[order] ** 2
    falling = np.sort(np.partition(size, -most)[-most:])[::-1]
    rest = size.sum() - np.cumsum(falling) + falling
    whole = int(np.argmax((most - np.arange(most)) * falling <= rest))  # so many are all shown
    places = np.floor(np.cumsum(np.minimum(size * ((most - whole) / rest[whole]), 1.0)))
    return seeds.take(np.sort(order[np.diff(places, prepend=0.0) > 0.0]))


def _shown(flora: Flora, seeds: Seeds, most: int) -> tuple[int, Floats, Branches]:
    """How many plants there are, where coordinates begin (3,), and the trunks of at most so many."""
    origin = origin_near(seeds.position)
    shown = thinned(seeds, flora.rows["length"][flora.first_row, 0], most).counted_from(origin)
    return len(seeds), origin, trunks(flora.rows, shown)


def _profiles(flora: Flora) -> Floats:
    """Of each species (s, 4): lowest and highest leaves, and radii of its crown's rings, for a trunk of length 1."""
    summer = flora.in_leaf
    if summer not in _known:
        profiles, number = np.stack([_profile(flora, int(row)) for row in flora.first_row]), len(flora.first_row)
        alike = np.zeros(number, np.int64), np.zeros((number, 3)), np.tile(np.eye(3), (number, 1, 1)), np.ones(number)
        plants = trunks(summer.rows, Seeds(("",) * number, np.arange(number, dtype=np.int32), *alike))
        # Of what is turned all ways, a half of leaves and a π-th of the surface of wood shows.
        area = 0.5 * summer.leaf_areas(plants) + summer.wood_areas(plants) / np.pi
        # What is seen through covers as much as it does, and is narrower for that.
        profiles[:, 2:] *= -np.expm1(-area / np.maximum(_from_the_side(profiles) * plants.length**2, 1e-9))[:, None]
        _known[summer] = profiles
    return _known[summer]


def _from_the_side(profiles: Floats) -> Floats:
    """Areas (s,) of crowns of profiles (s, 4): a cone below the rings, one above, the mean of both between them."""
    low, high, *radii = profiles.T
    return (high - low) * sum(radii) * 0.5 * (1.0 + _RINGS[1] - _RINGS[0])


def crown_areas(flora: Flora) -> Floats:
    """Areas (s,) of the crowns of species from the side, of mean length and on the flora's day, m²."""
    area = _from_the_side(_profiles(flora)) * flora.rows["length"][flora.first_row, 0] ** 2
    if flora.day is None:
        return area
    left = [np.mean(flora.day.share_range(flora.rows, number)) for number in range(len(area))]
    return (_BARE + (1.0 - _BARE) * np.minimum(left, 1.0)) * area


def _profile(flora: Flora, row: int) -> Floats:
    """Lowest and highest leaves of a species, and radii of its crown's rings, for a trunk of length 1."""
    points = flora.samples.leaves if flora.leaf_count[row] > 0 else flora.samples.wood
    first = int(points.first[row, -1])  # of an upright trunk
    position = points.position[first : first + int(points.number[row, -1])].astype(np.float64)
    across, along = np.hypot(position[:, 0], position[:, 1]), position[:, 2]
    low, high = np.quantile(along, [_BELOW, _ABOVE])
    high = max(high, low + 0.05)
    radii = []
    for fraction in _RINGS:
        band = np.abs((along - low) / (high - low) - fraction) <= _BAND
        radii.append(np.quantile(across[band] if band.any() else across, _WITHIN))
    return np.array([low, high, *radii])


def _faces() -> Integers:
    """Triangles of one plant: crown from its lowest corner over two rings to the highest, then the trunk."""
    i = np.arange(SIDES)
    j = (i + 1) % SIDES
    lower, upper, top, foot = 1 + i, 1 + SIDES + i, 2 * SIDES + 1, 2 * SIDES + 2
    parts = [
        (0 * i, 1 + j, lower),
        (lower, 1 + j, upper),
        (1 + j, 1 + SIDES + j, upper),
        (upper, 1 + SIDES + j, np.full(SIDES, top)),
        (foot + i, foot + j, np.full(SIDES, foot + SIDES)),
    ]
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def _repeated(indices: Integers, corners: int, times: int) -> Integers32:
    """The same faces or edges for each of many plants of so many corners."""
    return (indices[None] + corners * np.arange(times)[:, None, None]).reshape(-1, indices.shape[1]).astype(np.int32)


def simple_crowns(
    matrices: Floats, size: tuple[float, float, float], colors: Sequence[Sequence[float]], boxes: bool = False
) -> Shapes:
    """Plants of one size as crowns, stretched and turned as their places are; of very many every second, or third.

    Parameters
    ----------
    matrices : (n, 4, 4) float64
        To world space.
    size : tuple of float
        Radius of the crown, its base and its top above the ground, meters.
    colors : (2, 3) float
        Of leaves and wood, linear RGB.
    boxes : bool
        Edges of boxes instead of faces.
    """
    of, origin = len(matrices), origin_near(matrices[:, :3, 3])
    shown = matrices[:: max(-(-of // MOST_PLANTS), 1)]
    feet, frame = shown[:, :3, 3] - origin, shown[:, :3, :3]
    leaves, wood = (np.tile(color, (len(shown), 1)) for color in colors)
    if boxes:
        corners, indices = _box(*size)
        positions = (corners @ frame.transpose(0, 2, 1) + feet[:, None]).reshape(-1, 3).astype(np.float32)
        colors = np.repeat(as_shown(leaves), len(corners), axis=0)
    else:
        radius, base, top = np.full((3, len(shown)), np.array(size)[:, None])
        forms = np.column_stack([base, top, radius, radius])
        positions, colors = _crowns(feet, frame, forms, _THIN * top, leaves, wood)
        indices = _faces()
    indices = _repeated(indices, len(positions) // max(len(shown), 1), len(shown))
    return Shapes(positions, colors, indices, len(shown), of, origin)


def joined(parts: Sequence[Shapes]) -> Shapes:
    """Shapes of the same kind, at least one, as one."""
    origin = parts[0].origin
    firsts = np.cumsum([0, *(len(part.positions) for part in parts)]).tolist()
    points = [part for part in parts if part.crowns is not None]
    crowns = None
    if points:
        kinds = np.cumsum([0, *(len(part.crowns.looks) for part in points)]).tolist()
        places = [part.crowns.positions + (part.origin - origin).astype(np.float32) for part in points]
        numbers = [part.crowns.kinds + np.int32(n) for part, n in zip(points, kinds, strict=False)]
        names = ("axes", "forms", "looks")
        axes, forms, looks = (np.concatenate([getattr(part.crowns, name) for part in points]) for name in names)
        crowns = CrownPoints(np.concatenate(places), axes, forms, np.concatenate(numbers), looks)
    positions = np.concatenate([(part.positions + (part.origin - origin)).astype(np.float32) for part in parts])
    indices = [part.indices + np.int32(first) for part, first in zip(parts, firsts, strict=False)]
    colors = np.concatenate([part.colors for part in parts])
    counts = sum(part.plants for part in parts), sum(part.of for part in parts)
    return Shapes(positions, colors, np.concatenate(indices), *counts, origin, crowns)


def _box(radius: float, base: float, top: float) -> tuple[Floats, Integers]:
    """Corners (8, 3) and edges (12, 2) of the box around a crown."""
    corners = [(x * radius, y * radius, z) for z in (base, top) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    edges = [(i, (i + 1) % 4) for i in range(4)]
    edges += [(a + 4, b + 4) for a, b in edges] + [(i, i + 4) for i in range(4)]
    return np.array(corners, np.float64), np.array(edges)
