# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light from all sides as spherical harmonics, and how leaves, bark and clouds scatter light (paper, section 7).

Irradiance changes so slowly with the normal that nine numbers a color hold it within a few percent (Ramamoorthi and
Hanrahan, "An Efficient Representation for Irradiance Environment Maps", 2001).

A facet is a sheet that scatters as the material of proxies does: evenly over the side of the light or, for the fraction
of its transmission, over the other side, with a little gloss. A cloud is the paper's blend of a particle term and a
plane term, in the forms of `docs/architecture.md`. In light of radiance 1 from all sides, white has radiance 1.
"""

from itertools import permutations, product

import numpy as np

from ..arrays import Floats
from ..optics import GLOSS, THROUGH_TINT

#: Reflected (n, 3), transmitted (n, 3) and mirrored (n,) fractions of light, see `scattered_fractions`.
Fractions = tuple[Floats, Floats, Floats]
#: Radiance of the front, where normals point, and of the back (n, 3 each).
Sides = tuple[Floats, Floats]

#: Number of harmonics up to the second band, and the band of each.
HARMONICS = 9
BAND = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2])
#: Factors of the cosine lobe max(0, n·l) on each band (Ramamoorthi and Hanrahan 2001, equation 8).
_COSINE = np.array([np.pi, 2.0 * np.pi / 3.0, np.pi / 4.0])[BAND]
# McLaren's improved snub cube (Hardin and Sloane, "McLaren's Improved Snub Cube and Other New Spherical Designs in
# Three Dimensions", 1996): means over its 24 points are exact for polynomials up to degree 7.
_SNUB = (0.8662468181078206, 0.4225186537611115, 0.2666354015167047)
#: Roughness of the waxy surface's own, colorless reflection.
GLOSS_ROUGHNESS = 0.6


def _directions() -> Floats:
    points = []
    for order in permutations(range(3)):
        odd = sum(order[i] > order[j] for i, j in ((0, 1), (0, 2), (1, 2))) % 2
        signs = (sign for sign in product((1.0, -1.0), repeat=3) if sign.count(1.0) % 2 == odd)
        points += [[sign[i] * _SNUB[order[i]] for i in range(3)] for sign in signs]
    return np.array(points)


#: Unit vectors (24, 3) toward the sky, each of the same solid angle.
DIRECTIONS = _directions()
#: Solid angle of each, steradians.
SOLID_ANGLE = 4.0 * np.pi / len(DIRECTIONS)


def harmonics(directions: Floats) -> Floats:
    """Real spherical harmonics up to the second band (..., 9) of unit vectors (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    linear = (0.4886025119029199 * axis for axis in (y, z, x))
    xy, yz, xz = (1.0925484305920792 * a * b for a, b in ((x, y), (y, z), (x, z)))
    zz, xx_yy = 0.31539156525252005 * (3.0 * z * z - 1.0), 0.5462742152960396 * (x * x - y * y)
    return np.stack([np.full_like(x, 0.28209479177387814), *linear, xy, yz, zz, xz, xx_yy], axis=-1)


def irradiance(light: Floats, normals: Floats) -> Floats:
    """Irradiance (..., 3), W/m², of surfaces with unit normals (..., 3), by radiance (..., 9, 3) in harmonics."""
    return np.maximum(np.einsum("...k,...kc->...c", harmonics(normals) * _COSINE, light), 0.0)


def fluence(light: Floats) -> Floats:
    """Light that passes through a point (..., 3), W/m²: the integral of the radiance over all directions."""
    return light[..., 0, :] * np.sqrt(4.0 * np.pi)


def scattered_fractions(color: Floats, transmission: Floats, dull: Floats | float = 0.0) -> Fractions:
    """Fractions that sheets reflect and transmit diffusely (n, 3), and mirror (n,); ``dull`` (n,) of gloss is lost."""
    through = transmission[:, None]
    gloss = np.where(transmission > 0.0, GLOSS * (1.0 - dull), 0.0)
    rest = (1.0 - gloss)[:, None]
    return rest * (1.0 - through) * color, rest * through * np.minimum(color * THROUGH_TINT, 1.0), gloss


def albedo(color: Floats, transmission: Floats) -> Floats:
    """Fraction (n, 3) of light that sheets scatter in any way."""
    reflected, through, gloss = scattered_fractions(color, transmission)
    return reflected + through + gloss[:, None]


def sphere_phase(cosine: Floats) -> Floats:
    """Phase function 1/sr of a white Lambert sphere by the cosine of the angle α between light and eye, ∫ p = 1.

    p = 2 (sin α + (π − α) cos α) / (3π²). Leaves that face all ways and reflect scatter alike; those that let light
    through do so with π − α (Ross, "The radiation regime and architecture of plant stands", 1981).
    """
    cosine = np.clip(cosine, -1.0, 1.0)
    alpha = np.arccos(cosine)
    return 2.0 / (3.0 * np.pi**2) * (np.sin(alpha) + (np.pi - alpha) * cosine)


def _bands() -> Floats:
    """2π ∫ p(x) Pₗ(x) dx for l = 0, 1, 2: factors of the phase function on the bands of harmonics."""
    x, weight = np.polynomial.legendre.leggauss(64)
    return np.array([2.0 * np.pi * (weight * sphere_phase(x) * p).sum() for p in (1.0, x, (3.0 * x * x - 1.0) / 2.0)])


_PHASE_BANDS = _bands()


def facet_direct(normal: Floats, fractions: Fractions, toward: Floats, arriving: Floats, view: Floats) -> Sides:
    """Radiance of the front, where normals point, and of the back of facets (n, 3 each) by one light.

    All vectors (n, 3) are unit vectors, ``view`` to the eye; ``arriving`` (n, 3) is W/m² on what faces the light.
    """
    reflected, through, gloss = fractions
    cosine = np.sum(normal * toward, axis=1)
    same = reflected * arriving / np.pi * np.abs(cosine)[:, None]
    other = through * arriving / np.pi * np.abs(cosine)[:, None]
    same = same + (gloss * _mirrored(normal, toward, view))[:, None] * arriving
    lit = (cosine > 0.0)[:, None]
    return np.where(lit, same, other), np.where(lit, other, same)


def facet_ambient(normal: Floats, fractions: Fractions, light: Floats, view: Floats) -> Sides:
    """Radiance of the front and the back of facets (n, 3 each) by light from all sides, as harmonics (n, 9, 3)."""
    reflected, through, gloss = fractions
    front, back = irradiance(light, normal) / np.pi, irradiance(light, -normal) / np.pi
    # The lobe is about as broad as a cosine's.
    across = np.sum(normal * view, axis=1, keepdims=True)
    mirrored = gloss[:, None] * (irradiance(light, 2.0 * across * normal - view) / np.pi)
    return reflected * front + through * back + mirrored, reflected * back + through * front + mirrored


def _mirrored(normal: Floats, toward: Floats, view: Floats) -> Floats:
    """BRDF times cosine (n,) of a rough mirror on the side of the light (GGX; Walter et al. 2007), Fresnel 1."""
    light, eye = np.sum(normal * toward, axis=1), np.sum(normal * view, axis=1)
    half = toward + view
    half = half / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)
    alpha = GLOSS_ROUGHNESS**4
    spread = np.sum(normal * half, axis=1) ** 2 * (alpha - 1.0) + 1.0
    density = alpha / (np.pi * spread * spread)
    inwards, outwards = np.abs(light), np.abs(eye)
    of_eye, of_light = (np.sqrt(alpha + (1.0 - alpha) * one * one) for one in (eye, light))
    masking = inwards * of_eye + outwards * of_light
    # None where light and eye are on different sides.
    return np.where(light * eye > 0.0, density * inwards / (2.0 * np.maximum(masking, 1e-9)), 0.0)


def particle_direct(fractions: Fractions, toward: Floats, arriving: Floats, view: Floats) -> Floats:
    """Radiance (n, 3) of a thick cloud of sheets that face all ways, by one light; the gloss is even."""
    reflected, through, gloss = fractions
    cosine = np.sum(toward * view, axis=1)
    phase = reflected * sphere_phase(cosine)[:, None] + through * sphere_phase(-cosine)[:, None]
    return (phase + gloss[:, None] / (4.0 * np.pi)) * arriving


def particle_ambient(fractions: Fractions, light: Floats, view: Floats) -> Floats:
    """Radiance (n, 3) of such a cloud by light from all sides, as harmonics (n, 9, 3)."""
    reflected, through, gloss = fractions
    basis = harmonics(view)
    result = np.zeros_like(reflected)
    for band in range(3):
        in_band = np.einsum("nk,nkc->nc", basis[:, band == BAND], light[:, band == BAND])
        mirrored = gloss[:, None] if band == 0 else 0.0
        result += (_PHASE_BANDS[band] * (reflected + (-1) ** band * through) + mirrored) * in_band
    return np.maximum(result, 0.0)
