# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygons of a leaf in several variants that share their faces: what blades, needles and leaflets are made of.

Needles on a shoot are brushes, flat sprays, bundles of two to five: fewer and broader ones from afar, then all of them,
flat, and prisms with a bend up close. Blades are outlines within a tolerance, with columns of faces beside the midrib,
and bent as the leaf is. Compound leaves are leaflets in pairs along a rachis (ash, fern) or around a point (petals).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self

import numpy as np

from ..arrays import Floats, Integers, Integers32, Mask
from ..errors import SpeciesError
from ..parameters import described, limited
from .outlines import Blade, simplified, traced

#: Leaves of a form that are bent, folded and grown in different ways.
VARIANTS = 6
#: Steps toward an area at most, and the relative difference from which on it is reached.
_FITS, _FITTED = 12, 1e-7
_GOLDEN = 0.6180339887498949


def variant_offsets(number: int) -> Floats:
    """Even numbers (k,) from -1 to 1, one for each variant; others for each number that they are drawn by."""
    step = (_GOLDEN * (number + 1) ** 2 + 0.31 * number) % 1.0
    return 2.0 * ((np.arange(VARIANTS) * (_GOLDEN + 0.4 * step) + step) % 1.0) - 1.0


def next_corners(offsets: Integers32) -> Integers32:
    """The corner (c,) that follows each corner in its face, by where faces start (f + 1,)."""
    following = np.arange(1, offsets[-1] + 1, dtype=np.int32)
    following[offsets[1:] - 1] = offsets[:-1]
    return following


@dataclass(frozen=True)
class LeafSurface:
    """Faces of a leaf."""

    positions: Floats  # (k, v, 3): vertices of each variant, in units of the leaf's size
    corner_verts: Integers32  # (c,)
    face_offsets: Integers32  # (f + 1,)
    uv: Floats  # (c, 2)
    solid: Mask  # (f,): faces of closed bodies, as needles: half of their surface counts as one-sided area
    error: float = 0.0  # largest distance from the shape that it stands for

    @property
    def polygons(self) -> int:
        """Number of faces."""
        return len(self.solid)

    def areas(self) -> Floats:
        """One-sided areas (k,) of the variants."""
        return self._areas_of(self._area_vectors())

    def widened_to(self, area: float) -> Self:
        """The surface with its variants wider or narrower along x, until each has a one-sided area.

        Of a face's area vector, x does not depend on widths, and y and z are in proportion to them.
        """
        vectors, wide = self._area_vectors(), np.ones(len(self.positions))
        for _ in range(_FITS):
            ratio = area / self._areas_of(vectors * _along(1.0, wide, wide))
            if np.abs(ratio - 1.0).max() < _FITTED:
                break
            wide = wide * ratio
        return replace(self, positions=self.positions * _along(wide, 1.0, 1.0))

    def _area_vectors(self) -> Floats:
        """Twice the area vectors (k, f, 3) of all faces."""
        following = next_corners(self.face_offsets)
        points = self.positions[:, self.corner_verts]
        origin = np.repeat(points[:, self.face_offsets[:-1]], np.diff(self.face_offsets), axis=1)
        return np.add.reduceat(np.cross(points - origin, points[:, following] - origin), self.face_offsets[:-1], axis=1)

    def _areas_of(self, vectors: Floats) -> Floats:
        return (np.linalg.norm(vectors, axis=2) * np.where(self.solid, 0.25, 0.5)).sum(axis=1)

    def moved(self, matrix: Floats, place: Floats) -> Self:
        """The surface with its points times a matrix (3, 3) or (k, 3, 3), whose columns are its axes, at a place."""
        return replace(self, positions=self.positions @ np.swapaxes(matrix, -1, -2) + np.reshape(place, (-1, 1, 3)))


def _along(*factors: float | Floats) -> Floats:
    """Factors of the axes, each one number or one of each variant (k,), for vectors (k, n, 3)."""
    return np.stack(np.broadcast_arrays(*factors), axis=-1)[..., None, :]


def _surface(positions: Floats, faces: Integers, uv: Floats, solid: bool = False, error: float = 0.0) -> LeafSurface:
    """A surface of triangles and quads (f, 4), with positions (k, v, 3) and texture (v, 2) of vertices.

    Of triangles a vertex is named twice in a row. Less than three different ones are none.
    """
    kept = faces != np.roll(faces, -1, axis=1)
    whole = kept.sum(axis=1) >= 3
    faces, kept = faces[whole], kept[whole]
    used, corners = np.unique(faces[kept], return_inverse=True)
    corners = corners.reshape(-1).astype(np.int32)
    offsets = np.concatenate([[0], np.cumsum(kept.sum(axis=1))]).astype(np.int32)
    return LeafSurface(positions[:, used], corners, offsets, uv[used][corners], np.full(len(faces), solid), error)


def joined(parts: Sequence[LeafSurface]) -> LeafSurface:
    """Several surfaces with equal numbers of variants as one."""
    vertices = np.cumsum([0, *(part.positions.shape[1] for part in parts)])
    corners = np.cumsum([0, *(len(part.corner_verts) for part in parts)])
    return LeafSurface(
        np.concatenate([part.positions for part in parts], axis=1),
        np.concatenate([p.corner_verts + v for p, v in zip(parts, vertices, strict=False)]).astype(np.int32),
        np.concatenate([[0], *(p.face_offsets[1:] + c for p, c in zip(parts, corners, strict=False))]).astype(np.int32),
        np.concatenate([part.uv for part in parts]),
        np.concatenate([part.solid for part in parts]),
        max(part.error for part in parts),
    )


def tube(points: Floats, radius: Floats, sides: int) -> LeafSurface:
    """A tube along points (k, n, 3), which do not lead upwards, with radii (n,); its texture runs around and along."""
    variants, rings, _ = points.shape
    along = np.gradient(points, axis=1)
    along /= np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-12)
    side = np.cross(along, [0.0, 0.0, 1.0])
    side /= np.maximum(np.linalg.norm(side, axis=2, keepdims=True), 1e-12)
    up = np.cross(side, along)
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.cos(turn)[:, None] * side[:, :, None] + np.sin(turn)[:, None] * up[:, :, None]
    places = (points[:, :, None] + radius[:, None, None] * ring).reshape(variants, rings * sides, 3)
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
    after = (j + 1) % sides
    quads = np.stack([i * sides + j, i * sides + after, (i + 1) * sides + after, (i + 1) * sides + j], axis=-1)
    u = np.tile(0.5 + 0.5 * np.cos(turn), rings)
    v = np.repeat(np.linspace(0.0, 1.0, rings), sides)
    return _surface(places, quads.reshape(-1, 4), np.stack([u, v], axis=1), solid=True)


_GOLDEN_ANGLE = np.radians(137.508)
_GAP = 0.6  # what is not seen of the gaps between needles, of their distance along the shoot
#: Error from which on there are fewer needles, needles are flat, and prisms have three sides.
SPARSE, FLAT, _THREE = 0.05, 0.004, 0.0012
#: One of so many needles stands for them all where there are fewer; what is not seen of the gaps then.
_OF, _SPARSE_GAP = 3, 2.4
_TAPER = 0.55  # radius of shoots over that of needles, and of both at their ends
#: Places along a needle and its widths there, for errors above the first number.
_PROFILES = (
    (SPARSE, (0.0, 1.0), (1.0, 0.0)),
    (FLAT, (0.0, 0.35, 1.0), (0.55, 1.0, 0.0)),
    (_THREE, (0.0, 0.6, 1.0), (0.6, 1.0, 0.0)),
    (0.0, (0.0, 0.4, 0.85, 1.0), (0.5, 1.0, 0.75, 0.0)),
)


@dataclass(frozen=True)
class Needles:
    """Needles around one shoot or several; lengths are fractions of the whole."""

    needles: int = limited(100, 4, 400, "needles, all together")
    bundle: int = limited(1, 1, 5, "needles that stand together: 2, 3 or 5 in pines")
    length: float = limited(0.16, 0.01, 1, "length of a needle")
    thickness: float = limited(0.012, 0.001, 0.1, "thickness of a needle before it is given the area of the far form")
    angle: float = limited(50.0, 0, 120, "angle between shoot and needle at the base of the shoot, degrees")
    angle_tip: float = limited(25.0, 0, 120, "the same at its tip")
    flat: float = limited(0.3, 0, 1, "0: needles all around the shoot, 1: in one plane")
    bend: float = limited(0.12, -0.5, 0.5, "how far needles bend toward the tip of the shoot, fraction of their length")
    shoot: float = limited(0.9, 0.01, 1, "length of a shoot that bears them")
    shoots: int = limited(1, 1, 12, "shoots, spread as a fan")
    spread: float = limited(0.0, 0, 180, "angle between the outer shoots of a fan, degrees")
    lift: float = limited(0.0, 0, 1, "how far shoots of a fan stand out of its plane in turns")
    stem: float = limited(0.016, 0.001, 0.1, "thickness of a shoot")
    turn: float = limited(0.0, -180, 180, "turn of the whole about its axis, degrees")

    @property
    def gap(self) -> float:
        """Error of a level that has them all."""
        return _GAP * self.shoot * self.shoots / self.needles


def needle_surface(needles: Needles, tolerance: float, factor: float = 1.0) -> LeafSurface:
    """Needles within a tolerance, in units of the whole leaf's length; all are thicker by a factor."""
    parts = []
    step = needles.spread / max(needles.shoots - 1, 1)
    for i in range(needles.shoots):
        turn = np.radians(step * (i - (needles.shoots - 1) / 2.0))
        lift = needles.lift * (1 if i % 2 else -1) if needles.shoots > 1 else 0.0
        along = np.array([np.sin(turn), np.cos(turn), lift]) / np.sqrt(1.0 + lift**2)
        across = np.array([np.cos(turn), -np.sin(turn), 0.0])
        frame = np.stack([across, along, np.cross(across, along)], axis=1)
        parts.append(_shoot(needles, i, tolerance, factor).moved(frame, np.zeros(3)))
    error = needles.gap * (_SPARSE_GAP if tolerance > SPARSE else 1.0)
    return replace(joined(parts), error=error if tolerance > FLAT else min(tolerance, error))


def _shoot(needles: Needles, number: int, tolerance: float, factor: float) -> LeafSurface:
    """One shoot along y with its needles."""
    count = max(needles.needles // needles.shoots, needles.bundle)
    i = np.arange(0, count, _OF if tolerance > SPARSE else 1)
    node, within = i // needles.bundle, i % needles.bundle
    last = max((count - 1) // needles.bundle, 1)
    place = (node + 0.5 + 0.4 * np.stack([np.sin(i * 7.1 + 3.0 * k + number) for k in range(VARIANTS)])) / (last + 1)
    angle = np.radians(needles.angle + (needles.angle_tip - needles.angle) * place)
    angle = angle * (1.0 + 0.18 * np.sin(5.3 * i + 1.7 * np.arange(VARIANTS)[:, None]))
    turn = node * _GOLDEN_ANGLE + 1.3 * variant_offsets(3 + number)[:, None] + 0.25 * np.sin(11.7 * i)
    side, up = np.cos(turn), np.sin(turn) * (1.0 - needles.flat)
    size = np.maximum(np.hypot(side, up), 1e-9)
    zero = np.zeros_like(side)
    out = np.stack([side / size, zero, up / size], axis=2)
    if needles.bundle > 1:  # needles of a bundle lean apart
        apart = 2.0 * np.pi * within / needles.bundle
        out = out + 0.3 * (np.cos(apart)[:, None] * np.stack([-out[..., 2], zero, out[..., 0]], axis=2))
        angle = angle + 0.12 * np.sin(apart)
    axis = np.array([0.0, 1.0, 0.0])
    cos, sin = np.cos(angle)[..., None], np.sin(angle)[..., None]
    direction = cos * axis + sin * out
    direction /= np.linalg.norm(direction, axis=2, keepdims=True)
    length = needles.length * (1.0 + 0.15 * np.sin(3.1 * i + np.arange(VARIANTS)[:, None]))
    length = length * np.clip(0.75 + 1.5 * np.minimum(place, 1.15 - place), 0.0, 1.0)
    start = place[..., None] * needles.shoot * axis
    toward = axis - (direction * axis).sum(-1, keepdims=True) * direction
    parts = [_needles(start, direction, toward, length, needles, tolerance, factor)]
    rings = 2 if tolerance > FLAT else 5
    stem = np.zeros((VARIANTS, rings, 3))
    stem[..., 1] = np.linspace(0.0, needles.shoot, rings)
    radius = needles.stem / 2.0 * np.linspace(1.0, _TAPER, rings)
    parts.append(tube(stem, radius, 3 if tolerance > _THREE else 5))
    parts[-1].uv[:, 1] -= 1.0  # below that of needles, as petioles
    return joined(parts)


def _needles(
    start: Floats, direction: Floats, toward: Floats, length: Floats, needles: Needles, tolerance: float, factor: float
) -> LeafSurface:
    """Needles from starts (k, n, 3) in directions, of lengths (k, n), bent toward vectors (k, n, 3)."""
    flat, three = tolerance > FLAT, tolerance > _THREE
    along, wide = next((np.array(along), np.array(wide)) for error, along, wide in _PROFILES if tolerance > error)
    rings, (variants, count) = len(along), length.shape
    way = along[:, None] * direction[:, :, None] + needles.bend * (along**2)[:, None] * toward[:, :, None]
    axis = start[:, :, None] + length[..., None, None] * way
    across = np.cross(direction, toward + 1e-3)
    across /= np.maximum(np.linalg.norm(across, axis=2, keepdims=True), 1e-9)
    other = np.cross(across, direction)
    radius = factor * needles.thickness / 2.0 * wide
    sides = 2 if flat else 3 if three else 4
    turn = np.pi * np.arange(2) if flat else 2 * np.pi * (np.arange(sides) + 0.5) / sides
    ring = np.cos(turn)[:, None] * across[:, :, None, :] + 0.8 * np.sin(turn)[:, None] * other[:, :, None, :]
    body = axis[:, :, :-1, None] + radius[:-1, None, None] * ring[:, :, None]
    points = np.concatenate([body.reshape(variants, count, -1, 3), axis[:, :, -1:]], axis=2)
    each, tip = points.shape[2], points.shape[2] - 1
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(1 if flat else sides), indexing="ij")
    corners = [i * sides + j, i * sides + (j + 1) % sides, (i + 1) * sides + (j + 1) % sides, (i + 1) * sides + j]
    quads = np.minimum(np.stack(corners, axis=-1).reshape(-1, 4), tip)
    faces = (quads + np.arange(count)[:, None, None] * each).reshape(-1, 4)
    v = np.append(np.repeat(along[:-1], sides), 1.0)
    u = np.append(np.tile(0.5 + 0.5 * np.cos(turn), rings - 1), 0.5)
    uv = np.tile(np.stack([u, v], axis=1), (count, 1))
    return _surface(points.reshape(variants, -1, 3), faces, uv, solid=not flat)


#: Tolerance of the outline that all others are taken from.
FINEST = 2e-4
_ROUND = 0.02  # how far the fold along the midrib is rounded
_REPAIRS = 16
#: Distance of rays over the root of the tolerance: what a surface that is bent as leaves are sags between them.
_STEP = 1.6
_MOST_COLUMNS = 8
_PETIOLE = 0.011  # radius at the blade, in leaf lengths


@lru_cache(maxsize=64)
def _dense(blade: Blade, side: int) -> tuple[Floats, Floats]:
    """Parameters (n,) and points (n, 2) of one half's margin, to the finest tolerance."""
    s = traced(blade, side, FINEST / 2)
    return s, blade.margin(s, side)


def outline(blade: Blade, tolerance: float = FINEST) -> Floats:
    """Closed outline (n, 2) of a flat blade within a tolerance, from the base along its right half and back."""
    right, left = (_dense(blade, side)[1] for side in (1, -1))
    right, left = (points[simplified(points[:, None], tolerance)] for points in (right, left))
    return np.concatenate([right, left[-2:0:-1]])


def check_outline(blade: Blade) -> None:
    """Refuse outlines that cross themselves.

    Raises
    ------
    SpeciesError
        Names what may be changed.
    """
    if crossings(outline(blade, 0.002)):
        raise SpeciesError(
            "the outline crosses itself; use a smaller tooth_size or lobe_depth, fewer teeth, or a rounded base"
        )


def crossings(points: Floats) -> int:
    """Number of pairs of links of a closed line (n, 2) that cross each other."""
    a, b = points, np.roll(points, -1, axis=0)
    link = b - a

    def side(p: Floats) -> Floats:
        """Which side of link i (rows) points j (columns) lie on."""
        away = p[None] - a[:, None]
        return link[:, None, 0] * away[..., 1] - link[:, None, 1] * away[..., 0]

    first, last = side(a), side(b)
    return int(((first * last < -1e-18) & (first.T * last.T < -1e-18)).sum() // 2)


def blade_surface(blade: Blade, tolerance: float, amount: float = 1.0) -> LeafSurface:
    """A blade as polygons, in units of the whole leaf's length.

    Parameters
    ----------
    tolerance : float
        Of the outline, in lengths of the blade.
    amount : float
        How much its variants differ, 0 to 1.
    """
    step = _STEP * np.sqrt(tolerance)
    rows = max(int(np.ceil(1.0 / step)), 1)
    # Fractions of the way from the midrib to the margin at which columns of faces end, for rays a step apart.
    number = min(int((1.0 if blade.palmate else blade.width / 2.0) / (3.0 * step)), _MOST_COLUMNS)
    beside_midrib = [0.07] if number and step < 0.05 else []
    columns = np.concatenate([beside_midrib, 0.85 * np.arange(1, number + 1) / number])
    flat, faces = [], []
    count, middle = 0, np.linspace(0.0, 1.0, rows + 1)
    ribs = np.stack([np.zeros(rows + 1), middle], axis=1)
    for side in (1, -1):
        s, points = _dense(blade, side)
        chosen = simplified(bend(blade, points, amount).swapaxes(0, 1), tolerance)
        half, quads = _half(blade, side, s[chosen], points[chosen], ribs, columns, step)
        faces.append(quads + count)
        flat.append(half)
        count += len(half)
    places = np.concatenate(flat)
    # Both halves share the midrib; what is the same place is one vertex.
    _, first, inverse = np.unique(np.round(places, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    every = inverse.reshape(-1)[np.concatenate(faces)]
    places = places[first]
    bent = bend(blade, places, amount)
    scale, start = 1.0 - blade.petiole, np.array([0.0, blade.petiole, 0.0])
    quads = _surface(bent * scale + start, every, places + [0.5, 0.0], error=tolerance * scale)
    return joined([quads, _petiole(blade, rows)]) if blade.petiole and tolerance < 0.02 else quads


def _half(
    blade: Blade, side: int, s: Floats, margin: Floats, ribs: Floats, columns: Floats, step: float
) -> tuple[Floats, Integers]:
    """Flat places (v, 2) and faces (f, 4) of one half whose margin has points (n, 2) of parameters (n,)."""
    if blade.palmate:  # rays begin at the base, and the last one is the midrib
        ribs, rib_s = ribs[:1], np.ones(1)
    else:
        fine = np.linspace(0.0, 1.0, 1025)
        rib_s = np.interp(ribs[:, 1], blade.feet(fine), fine)
    feet = np.stack([np.zeros_like(s), blade.feet(s)], axis=1)
    key = np.zeros(len(s), bool)
    key[simplified(margin[:, None], min(step, 0.03))] = True
    key[np.searchsorted(s, np.arange(step / 2, 1.0, step))] = True
    last = key.copy()  # rays that lead on to the column beside the margin
    for _ in range(_REPAIRS):
        chosen = [np.flatnonzero(key)] * (len(columns) - 1) + [np.flatnonzero(last)] * min(len(columns), 1)
        inner = [feet[index] + t * (margin[index] - feet[index]) for index, t in zip(chosen, columns, strict=True)]
        rays = [np.arange(0), *chosen, np.arange(len(s))]
        lines = [(rib_s, ribs), *((s[index], line) for index, line in zip(chosen, inner, strict=True)), (s, margin)]
        starts = np.cumsum([0, *(len(line) for _, line in lines)])
        strips = [_strip(lines[i][0], lines[i + 1][0], starts[i], starts[i + 1]) for i in range(len(lines) - 1)]
        places, faces = np.concatenate([line for _, line in lines]), np.concatenate(strips)
        # Signed areas (f,) of flat quads (f, 4, 2).
        corners = places[faces]
        one, two = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        wrong = side * ((one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / 2.0) < -1e-12
        if not wrong.any() or key.all() or not len(columns):
            break
        # Where a face is turned over, rays lead on from its corners at the margin; from all of them if that is not it.
        used = np.zeros(len(places), bool)
        used[faces[wrong]] = True
        bad = np.zeros(len(s), bool)
        bad[rays[-1][used[starts[-2] : starts[-1]]]] = True
        if (bad & ~last).any():
            last = last | bad
        else:
            for index, start in zip(chosen, starts[1:], strict=False):
                bad[index[used[start : start + len(index)]]] = True
            bad |= np.roll(bad, 1) | np.roll(bad, -1)
            last = last | bad if (bad & ~last).any() else np.ones_like(last)
            key = key | (bad & last) if (bad & ~key).any() else last
    return places, faces if side > 0 else faces[:, ::-1]


def _strip(inner: Floats, outer: Floats, first: int, second: int) -> Integers:
    """Faces (f, 4) between two lines of vertices from numbers on, with parameters (a,) and (b,)."""
    if len(inner) == len(outer) and (inner == outer).all():
        i = np.arange(len(inner) - 1)
        return np.stack([first + i, second + i, second + i + 1, first + i + 1], axis=1)
    middle = np.concatenate([(inner[1:] + inner[:-1]) / 2, (outer[1:] + outer[:-1]) / 2])
    inside = np.arange(len(middle)) < len(inner) - 1
    inside = inside[np.argsort(middle, kind="stable")]
    a, b = np.cumsum(inside) - inside, np.cumsum(~inside) - ~inside  # links of either line that are done
    a, b = first + a, second + b
    return np.stack([a, b, np.where(inside, a + 1, b + 1), np.where(inside, a + 1, b + 1)], axis=1)


def bend(blade: Blade, flat: Floats, amount: float = 1.0) -> Floats:
    """Points (k, v, 3) of the variants of a blade whose flat places are given (v, 2), in lengths of the blade.

    One half is larger than the other; the blade leans, folds along its midrib, curls, waves and twists.
    """
    x, y = flat[:, 0], flat[:, 1]
    # Of each variant (k, 1), from -1 to 1.
    offsets = (amount * variant_offsets(i)[:, None] for i in range(8))
    lean, larger, folded, curled, waved, phase, turned, cupped = offsets
    half = max(blade.width / 2.0, 1e-6)
    across = np.abs(x) / half
    wide = x * (1.0 + 0.06 * larger * np.sign(x) * 4.0 * np.clip(y * (1.0 - y), 0.0, 1.0))
    wide = wide + 0.035 * lean * y**2 + 0.012 * turned * np.sin(2.0 * np.pi * y)
    high = y + 0.015 * lean * across * x
    z = blade.fold * (1.0 + 0.5 * folded) * (np.sqrt(x**2 + _ROUND**2 * half) - _ROUND * np.sqrt(half))
    z = z - (blade.curl + 0.04 * curled) * y**2 + 0.08 * cupped * x**2 / half
    waves = np.sin(2.0 * np.pi * (blade.waves * y + phase / 2.0) + np.where(x < 0, 1.7, 0.0))
    z = z + blade.wave * (1.0 + 0.5 * waved) * np.minimum(across, 1.3) ** 2 * waves
    turn = (np.radians(blade.twist) + 0.2 * turned) * y
    cos, sin = np.cos(turn), np.sin(turn)
    bow = -blade.curl * y**2  # the midrib itself does not turn
    aside, rise = wide * cos + (z - bow) * sin, bow + (z - bow) * cos - wide * sin
    return np.stack([aside, np.broadcast_to(high, z.shape), rise], 2)


def _petiole(blade: Blade, rows: int) -> LeafSurface:
    """The petiole: a tube from the twig to the blade, a little bent; its texture lies below that of the blade."""
    rings = 4 if rows > 8 else 2
    along = np.linspace(0.0, 1.0, rings)
    points = np.zeros((VARIANTS, rings, 3))
    points[..., 1] = blade.petiole * along
    points[..., 2] = -0.1 * blade.petiole * np.sin(np.pi * along) * (1.0 + 0.5 * variant_offsets(9)[:, None])
    points[..., 0] = 0.06 * blade.petiole * np.sin(np.pi * along) * variant_offsets(10)[:, None]
    radius = _PETIOLE * (1.0 - blade.petiole) * np.linspace(1.25, 0.8, rings) * min(1.0, 3.0 * blade.width)
    petiole = tube(points, radius, 5 if rows > 8 else 3)
    petiole.uv[:] = np.stack([petiole.uv[:, 0], (petiole.uv[:, 1] - 1.0) * blade.petiole], axis=1)
    return petiole


@dataclass(frozen=True)
class Compound:
    """Leaflets on a rachis; lengths are fractions of the whole leaf."""

    leaflet: Blade = described(Blade(), "outline of a leaflet, as of a simple leaf")
    pairs: int = limited(6, 0, 40, "pairs of leaflets; 0 for leaflets around a point")
    around: int = limited(0, 0, 12, "leaflets around a point, as petals or the leaflets of a chestnut")
    circle: float = limited(360.0, 30, 360, "angle that leaflets around a point take up, degrees")
    terminal: int = limited(1, 0, 1, "1: a leaflet at the tip")
    first: float = limited(0.2, 0, 0.95, "where on the rachis the first pair sits, or the point around which they are")
    last: float = limited(0.85, 0.02, 1, "where the last pair sits")
    length: float = limited(0.28, 0.01, 1, "length of the longest leaflets")
    longest: float = limited(0.5, 0, 1, "which pair is the longest: 0 the first, 1 the last")
    ends: float = limited(0.7, 0.02, 1, "length of the shortest leaflets over that of the longest")
    angle: float = limited(65.0, 5, 120, "angle between rachis and leaflet, degrees")
    cup: float = limited(0.1, -1, 1, "how far leaflets rise from the plane of the leaf, over their length")
    curl: float = limited(0.05, -1, 1, "how far the tip of the rachis bends down")
    stem: float = limited(0.012, 0, 0.1, "thickness of the rachis")
    turn: float = limited(0.0, -180, 180, "turn of the whole leaf about its rachis, degrees")


def compound_surface(compound: Compound, tolerance: float, amount: float = 1.0, factor: float = 1.0) -> LeafSurface:
    """A compound leaf within a tolerance, in units of its length; its leaflets are wider by a factor."""
    place, angle, length = _leaflets(compound)
    blade = blade_surface(compound.leaflet, tolerance / compound.length, amount)
    parts, petals = [], compound.around > 0
    for i in range(len(place)):
        lean = angle[i] + 0.06 * amount * variant_offsets(20 + i)
        rise = np.arctan(compound.cup) + 0.1 * amount * variant_offsets(60 + i)
        cos, sin, high, flat = np.cos(lean), np.sin(lean), np.sin(rise), np.cos(rise)
        along = np.stack([sin * flat, cos * flat, high], axis=1)
        across = np.stack([cos, -sin, np.zeros(VARIANTS)], axis=1)
        up = np.cross(across, along)
        size = length[i] * (1.0 + 0.05 * amount * variant_offsets(100 + i))
        frame = np.stack([factor * across, along, up], axis=2) * size[:, None, None]
        foot = np.zeros((VARIANTS, 3))
        foot[:, 1], foot[:, 2] = place[i], 0.0 if petals else -compound.curl * place[i] ** 2
        # Each variant's leaflets are those of others: one after the other.
        parts.append(replace(blade, positions=np.roll(blade.positions, i, axis=0)).moved(frame, foot))
    if compound.stem and tolerance < 0.02:
        parts.append(_rachis(compound, float(place.max()), tolerance))
    return replace(joined(parts), error=tolerance)


def _leaflets(compound: Compound) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places on the rachis, angles to it and lengths (n,) of leaflets."""
    if compound.around:
        n = compound.around
        turn = np.radians(compound.circle) * ((np.arange(n) + 0.5) / n - 0.5)
        return np.full(n, compound.first), turn, np.full(n, compound.length)
    rank = np.linspace(0.0, 1.0, max(compound.pairs, 1))
    below, above = rank / max(compound.longest, 1e-6), (1.0 - rank) / max(1.0 - compound.longest, 1e-6)
    share = 1.0 - (1.0 - np.minimum(below, above).clip(0.0, 1.0)) ** 2
    size = compound.length * (compound.ends + (1.0 - compound.ends) * share)
    place = compound.first + (compound.last - compound.first) * rank
    turn = np.radians(compound.angle) * np.where(rank > 0.7, 1.0 - 0.5 * (rank - 0.7), 1.0)
    places, turns, sizes = np.zeros((3, 0))
    if compound.pairs:
        places, sizes = np.repeat(place, 2) + np.tile([0.0, 0.012], len(rank)), np.repeat(size, 2)
        turns = np.stack([turn, -turn], axis=1).ravel()
    if compound.terminal or not len(places):
        end = max(1.0 - compound.length * compound.ends, compound.last if compound.pairs else 0.0)
        places, turns = np.append(places, end), np.append(turns, 0.0)
        sizes = np.append(sizes, 1.0 - end if end < 1.0 else compound.length)
    return places, turns, sizes


def _rachis(compound: Compound, end: float, tolerance: float) -> LeafSurface:
    rings = 3 if tolerance > 0.004 else 8
    points = np.zeros((VARIANTS, rings, 3))
    points[..., 1] = np.linspace(0.0, end, rings)
    if not compound.around:
        points[..., 2] = -compound.curl * points[..., 1] ** 2
    rachis = tube(points, compound.stem / 2 * np.linspace(1.0, 0.45, rings), 3 if tolerance > 0.001 else 5)
    rachis.uv[:] = rachis.uv * [1.0, 0.0] + [0.0, -0.5]  # below that of blades, as petioles
    return rachis
