# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions from which the sky is looked at, and light from all sides as few numbers: spherical harmonics.

Irradiance changes so slowly with the normal that nine numbers a colour hold it within a few percent (Ramamoorthi and
Hanrahan, "An Efficient Representation for Irradiance Environment Maps", 2001).
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

#: Numbers of harmonics up to the second band, and the band of each.
HARMONICS = 9
BAND = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2])
#: What the cosine lobe max(0, n·l) leaves of each band (Ramamoorthi and Hanrahan 2001, equation 8).
_COSINE = np.array([np.pi, 2.0 * np.pi / 3.0, np.pi / 4.0])[BAND]
# McLaren's improved snub cube (Hardin and Sloane, "McLaren's Improved Snub Cube and Other New Spherical Designs in
# Three Dimensions", 1996): means over its 24 points are exact for polynomials up to degree 7.
_SNUB = (0.8662468181078206, 0.4225186537611115, 0.2666354015167047)


def _directions() -> NDArray[np.float64]:
    points = []
    for order in permutations(range(3)):
        odd = sum(order[i] > order[j] for i, j in ((0, 1), (0, 2), (1, 2))) % 2
        points += [
            [sign[i] * _SNUB[order[i]] for i in range(3)]
            for sign in product((1.0, -1.0), repeat=3)
            if sign.count(1.0) % 2 == odd
        ]
    return np.array(points)


#: Unit vectors (24, 3) towards the sky, each of the same solid angle.
DIRECTIONS = _directions()
#: Solid angle of each, steradians.
SOLID_ANGLE = 4.0 * np.pi / len(DIRECTIONS)


def harmonics(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Real spherical harmonics up to the second band (..., 9) of unit vectors (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    return np.stack(
        [
            np.full_like(x, 0.28209479177387814),
            0.4886025119029199 * y,
            0.4886025119029199 * z,
            0.4886025119029199 * x,
            1.0925484305920792 * x * y,
            1.0925484305920792 * y * z,
            0.31539156525252005 * (3.0 * z * z - 1.0),
            1.0925484305920792 * x * z,
            0.5462742152960396 * (x * x - y * y),
        ],
        axis=-1,
    )


def irradiance(light: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Irradiance of surfaces in light from all sides.

    Parameters
    ----------
    light : (..., 9, 3) float
        Radiance by harmonic and colour.
    normals : (..., 3) float64
        Unit vectors.

    Returns
    -------
    (..., 3) float64
        W/m², not below 0.
    """
    return np.maximum(np.einsum("...k,...kc->...c", harmonics(normals) * _COSINE, light), 0.0)


def fluence(light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light that passes through a point (..., 3), W/m²: the integral of the radiance over all directions."""
    return light[..., 0, :] * np.sqrt(4.0 * np.pi)


def nearest_direction(directions: NDArray[np.float64]) -> NDArray[np.intp]:
    """Index (m,) of the direction among `DIRECTIONS` that is nearest to unit vectors (m, 3)."""
    return np.argmax(directions @ DIRECTIONS.T, axis=1)
