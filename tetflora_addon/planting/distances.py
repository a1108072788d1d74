# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The distance at which plants are suggested to stand: crowns of trees meet, and tufts of grass do."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, log10, sqrt

#: Distance of neighbors in crown radii: a birch wood at 3 to 4 m is closed, and light still falls between the crowns.
CROWN_RADII = 1.2
#: The same in sides of the square that each plant has where a density is asked for: nine in ten then find a place.
SQUARE_SIDES = 0.25


def suggested_distance(
    radii: Sequence[float], weights: Sequence[float], scale: float = 1.0, density: float | None = None
) -> float:
    """Distance in meters that suits a mixture, in two digits.

    Each plant has the area that its crown needs; the distance is that of plants with the mean area.

    Parameters
    ----------
    radii : sequence of float
        Of the crowns of the species, meters.
    weights : sequence of float
        Relative frequency of each species; negative ones count as 0.
    scale : float
        Mean scale of the plants.
    density : float, optional
        Plants for each square meter that the artist asks for: then not so far that they do not fit.
    """
    shares = [max(weight, 0.0) for weight in weights]
    whole = sum(shares)
    if whole == 0.0:
        return 0.0
    area = sum(share * radius**2 for share, radius in zip(shares, radii, strict=True)) / whole
    distance = CROWN_RADII * scale * sqrt(area)
    if density is not None and density > 0.0:
        distance = min(distance, SQUARE_SIDES / sqrt(density))
    return _two_digits(distance)


def _two_digits(value: float) -> float:
    """A positive value in two digits, as an artist would write it."""
    return round(value, 1 - floor(log10(value))) if value > 0.0 else 0.0
