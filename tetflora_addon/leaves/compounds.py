# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compound leaves: leaflets in pairs along a rachis, as of ash and fern, or around a point, as petals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..parameters import described, limited
from .blades import blade_surface
from .outlines import Blade
from .surfaces import VARIANTS, LeafSurface, joined, tube, variant_offsets


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
