# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Blades as polygons: the outline within a tolerance, columns of faces beside the midrib, and how a leaf is bent.

Compound leaves: leaflets in pairs along a rachis, as of ash and fern, or around a point, as petals.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ..arrays import Floats, Integers
from ..errors import SpeciesError
from ..parameters import described, limited
from .outlines import Blade, simplified, traced
from .surfaces import VARIANTS, LeafSurface, joined, surface, tube, variant_offsets

#: Tolerance of the outline that all others are taken from.
FINEST = 2e-4
#: How far the fold along the midrib is rounded.
_ROUND = 0.02
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
    right, left = (
        points[simplified(points[:, None], tolerance)] for _, points in (_dense(blade, 1), _dense(blade, -1))
    )
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
    across = (first * last < -1e-18) & (first.T * last.T < -1e-18)
    return int(across.sum() // 2)


def blade_surface(blade: Blade, tolerance: float, amount: float = 1.0) -> LeafSurface:
    """A blade as polygons, in units of the whole leaf's length.

    Parameters
    ----------
    blade : Blade
    tolerance : float
        Of the outline, in lengths of the blade.
    amount : float
        How much its variants differ, 0 to 1.
    """
    step = _STEP * np.sqrt(tolerance)
    rows = max(int(np.ceil(1.0 / step)), 1)
    columns = _columns(blade, step)
    flat, faces = [], []
    count, middle = 0, np.linspace(0.0, 1.0, rows + 1)
    ribs = np.stack([np.zeros(rows + 1), middle], axis=1)
    for side in (1, -1):
        s, points = _dense(blade, side)
        chosen = simplified(bend(blade, points, amount).swapaxes(0, 1), tolerance)
        own, made = _half(blade, side, s[chosen], points[chosen], ribs, columns, step)
        faces.append(made + count)
        flat.append(own)
        count += len(own)
    places = np.concatenate(flat)
    # Both halves share the midrib; what is the same place is one vertex.
    _, first, inverse = np.unique(np.round(places, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    every = inverse.reshape(-1)[np.concatenate(faces)]
    places = places[first]
    bent = bend(blade, places, amount)
    scale, start = 1.0 - blade.petiole, np.array([0.0, blade.petiole, 0.0])
    made = surface(bent * scale + start, every, places + [0.5, 0.0], error=tolerance * scale)
    return joined([made, _petiole(blade, rows)]) if blade.petiole and tolerance < 0.02 else made


def _columns(blade: Blade, step: float) -> Floats:
    """Fractions of the way from the midrib to the margin at which columns of faces end, for rays a step apart."""
    wide = 1.0 if blade.palmate else blade.width / 2.0
    number = min(int(wide / (3.0 * step)), _MOST_COLUMNS)
    if number < 1:
        return np.zeros(0)
    return np.concatenate([[0.07] if step < 0.05 else [], 0.85 * np.arange(1, number + 1) / number])


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
        inner = [feet[own] + t * (margin[own] - feet[own]) for own, t in zip(chosen, columns, strict=True)]
        rays = [np.arange(0), *chosen, np.arange(len(s))]
        lines = [(rib_s, ribs), *((s[own], line) for own, line in zip(chosen, inner, strict=True)), (s, margin)]
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
            for own, start in zip(chosen, starts[1:], strict=False):
                bad[own[used[start : start + len(own)]]] = True
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
    order = np.argsort(middle, kind="stable")
    inside = inside[order]
    a, b = np.cumsum(inside) - inside, np.cumsum(~inside) - ~inside  # links of either line that are done
    a, b = first + a, second + b
    return np.stack([a, b, np.where(inside, a + 1, b + 1), np.where(inside, a + 1, b + 1)], axis=1)


def bend(blade: Blade, flat: Floats, amount: float = 1.0) -> Floats:
    """Points (k, v, 3) of the variants of a blade whose flat places are given (v, 2), in lengths of the blade.

    One half is larger than the other; the blade leans, folds along its midrib, curls, waves and twists.
    """
    x, y = flat[:, 0], flat[:, 1]
    # Of each variant (k, 1), from -1 to 1.
    lean, larger, folded, curled, waved, phase, turned, cupped = (
        amount * variant_offsets(i)[:, None] for i in range(8)
    )
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
    return np.stack(
        [wide * cos + (z - bow) * sin, np.broadcast_to(high, z.shape), bow + (z - bow) * cos - wide * sin], 2
    )


def _petiole(blade: Blade, rows: int) -> LeafSurface:
    """The petiole: a tube from the twig to the blade, a little bent; its texture lies below that of the blade."""
    rings = 4 if rows > 8 else 2
    along = np.linspace(0.0, 1.0, rings)
    points = np.zeros((len(variant_offsets(0)), rings, 3))
    points[..., 1] = blade.petiole * along
    points[..., 2] = -0.1 * blade.petiole * np.sin(np.pi * along) * (1.0 + 0.5 * variant_offsets(9)[:, None])
    points[..., 0] = 0.06 * blade.petiole * np.sin(np.pi * along) * variant_offsets(10)[:, None]
    radius = _PETIOLE * (1.0 - blade.petiole) * np.linspace(1.25, 0.8, rings) * min(1.0, 3.0 * blade.width)
    made = tube(points, radius, 5 if rows > 8 else 3)
    made.uv[:] = np.stack([made.uv[:, 0], (made.uv[:, 1] - 1.0) * blade.petiole], axis=1)
    return made


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
        at = np.zeros((VARIANTS, 3))
        at[:, 1], at[:, 2] = place[i], 0.0 if petals else -compound.curl * place[i] ** 2
        # Each variant's leaflets are those of others: one after the other.
        parts.append(replace(blade, positions=np.roll(blade.positions, i, axis=0)).moved(frame, at))
    if compound.stem and tolerance < 0.02:
        parts.append(_rachis(compound, float(place.max()), tolerance))
    return replace(joined(parts), error=tolerance)


def _leaflets(compound: Compound) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places on the rachis, angles to it and lengths (n,) of leaflets."""
    if compound.around:
        n = compound.around
        whole = np.radians(compound.circle)
        turn = whole * ((np.arange(n) + 0.5) / n - 0.5)
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
    made = tube(points, compound.stem / 2 * np.linspace(1.0, 0.45, rings), 3 if tolerance > 0.001 else 5)
    made.uv[:] = made.uv * [1.0, 0.0] + [0.0, -0.5]  # below that of blades, as petioles
    return made
