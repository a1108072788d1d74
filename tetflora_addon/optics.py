# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light that leaves of a cluster send to each other, and what is left of it for those who see the cluster as one.

Of what one surface scatters, the fraction p meets another of its cluster and is scattered again: a cluster of
surfaces of the albedo w sends on w (1 − p) / (1 − p w) (Smolander and Stenberg, "Simple parameterizations of the
radiation budget of uniform broadleaved and coniferous canopies", 2005).
"""

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats

#: Fraction of light that the waxy surface of leaves mirrors without color (4 % at a refractive index of 1.5); what they
#: scatter is the rest times their color.
GLOSS = 0.04
#: What of `GLOSS` is mirrored at all angles; the rest comes at grazing ones.
FACING = 0.85
#: Light that has passed through a leaf lost more of its blue than light that was reflected: chlorophyll and carotenoids
#: absorb on the whole way. Products over 1 are cut off.
THROUGH_TINT = np.array([1.15, 1.1, 0.55])
#: How much more than the mean of both sides a leaf's underside reflects diffusely, and the upper side less: fewer
#: pigments lie under its surface, hence most in blue. A third of what three species show (docs/species.md), because
#: spheres and shells have no sides: where leaves become proxies, light must not jump.
PALER = (0.16, 0.12, 0.3)
#: How much rougher the gloss of the underside is.
HAIRY = 0.2


def recollision_albedo(albedo: Floats, weight: Floats) -> Floats:
    """Albedo (n, 3) of clusters of surfaces of albedos (n, 3) that are seen by a fraction ``weight`` (n,)."""
    p = np.clip(1.0 - weight, 0.0, 1.0)[:, None]
    return albedo * (1.0 - p) / (1.0 - p * albedo)


def cluster_color(color: Floats, gloss: Floats, weight: Floats) -> Floats:
    """Color (n, 3) of clusters of leaves that mirror ``gloss`` (n,), of which they mirror ``weight`` (n,) as clusters.

    The rest of what is mirrored meets other leaves and is scattered by them: no light is lost on its way.
    """
    whole = recollision_albedo(_albedo(color, gloss[:, None]), weight)
    return _color(whole, (gloss * np.clip(weight, 0.0, 1.0))[:, None])


def needle_color(color: NDArray[np.floating], p: NDArray[np.floating]) -> NDArray[np.floating]:
    """Color (..., 3) of needles whose shoots have colors (..., 3), by their recollision probability (..., 1)."""
    whole = _albedo(color, GLOSS * (1.0 - p))
    return _color(whole / (1.0 - p + p * whole), np.where(p > 0.0, GLOSS, 0.0))


def _albedo(color: NDArray[np.floating], gloss: NDArray[np.floating]) -> NDArray[np.floating]:
    return (1.0 - gloss) * color + gloss


def _color(albedo: NDArray[np.floating], gloss: NDArray[np.floating]) -> NDArray[np.floating]:
    return np.clip((albedo - gloss) / (1.0 - gloss), 0.0, 1.0)
