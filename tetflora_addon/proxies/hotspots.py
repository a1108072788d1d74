# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light on facets that stand for many leaves: they send to the eye what these would, no more and no less.

What is seen from where it is lit hides its own shadows, the more widely the larger it is: the hotspot.

Light and eye share gaps within an angle of about the size of leaves over the distance between them. Facets that are
larger than the leaves for which they stand have a wider hotspot, and crowns around the shadow of the viewer's head were
a twentieth too bright. The color of facets makes up for that by view and light, as the visibility of aggregates does
for Zhou, Huang, Ramamoorthi, Sen and Yan ("Appearance-Preserving Scene Aggregation for Level-of-Detail Rendering"), so
that crowns send back as much light in all directions together as before.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Arrays, Floats, Integers, column
from ..camera.camera import Camera, to_eye
from ..compiled.flora import Flora, extents
from ..growth.seeds import Branches
from ..refinement.lights import Light

#: Probability that light which a leaf of a crown scatters meets another, about.
_RECOLLISION = 0.62
#: Fraction of its box that a crown fills.
_FILLED = 0.6
#: Mean chord of a sheet over the root of its area: .89 of a disc that faces the eye, two thirds of it facing any way.
_CHORD = 0.6
#: What is seen is lit once and again by all the rest, of which a part is seen too: between the first power of the light
#: that is scattered once, were only these surfaces to change, and the second, were all to.
_POWER = 1.5
#: All other light over that of a lamp on a sheet that faces it: of what reaches facets in a wood, 46 % comes straight
#: from the sun, 24 % from the sky, the rest from leaves. With .4, woods were 1 % too bright. And the power of its own
#: light by which a facet is evened: without, blobs of ``exact --cases edge --species birch,spruce --seeds 2`` are 1,984
#: and FLIP over noise .035; 1,570 and .032 with .9.
_AMBIENT, _EVENED = 0.6, 0.9
#: Arguments for which `overlap` and its mean are known, and points of quadratures.
_KNOWN, _POINTS = np.geomspace(1e-3, 1e4, 141), 48


def _overlaps() -> Floats:
    x, weight = np.polynomial.laguerre.laggauss(_POINTS)
    a = _KNOWN[:, None]
    # ∫ 2 exp(−2x + a (1 − e^{−x / a})) dx, of which the quadrature's weights contain e^{−x}.
    return (2.0 * weight * np.exp(np.minimum(-a * np.expm1(-x / a), x) - x)).sum(axis=1)


def overlap(size: Floats) -> Floats:
    """How much more (n,) of a deep medium is lit and seen than if light and eye had gaps of their own: 1 to 2.

    ``size`` (n,) is the extinction times the chord of a leaf over 2 sin(ψ / 2), with the angle ψ between light and eye.
    Both reach a place at optical depth x with the probability exp(−2x + a (1 − e^{−x / a})) (Kuusk, "The hot spot
    effect of a uniform vegetative cover", Soviet Journal of Remote Sensing, 1985).
    """
    return np.interp(np.log(np.maximum(size, _KNOWN[0])), np.log(_KNOWN), _OVERLAPS)


def mean_overlap(size: Floats) -> Floats:
    """Mean (n,) of `overlap` over all light through a surface that faces the lamp, by extinction times chord (n,)."""
    return np.interp(np.log(np.maximum(size, _KNOWN[0])), np.log(_KNOWN), _MEANS)


def _means() -> Floats:
    place, weight = np.polynomial.legendre.leggauss(_POINTS)
    chord = (place + 1.0) / np.sqrt(2.0)  # from 0 to √2; directions are as dense as that
    dense = weight * chord * (1.0 - chord**2 / 2.0) * np.sqrt(2.0)
    return (dense * overlap(_KNOWN[:, None] / chord)).sum(axis=1)


_OVERLAPS = _overlaps()
_MEANS = _means()


def _balance(chord: Floats, extinction: Floats, leaf: Floats, facet: Floats) -> Floats:
    """Light (n,) that leaves send to the eye once over what facets do, which send as much in all directions.

    ``chord`` is 2 sin(ψ / 2) of the angle ψ between light and eye; extinction is in 1/m, and roots of areas, of
    leaves and of facets that are no smaller, in meters.
    """
    chord = np.maximum(chord, 1e-3)
    small, large = _CHORD * extinction * leaf, _CHORD * extinction * np.maximum(facet, leaf)
    return overlap(small / chord) / overlap(large / chord) * mean_overlap(large) / mean_overlap(small)


def balanced_colors(color: Floats, hotspot_factor: Floats) -> Floats:
    """Colors (n, 3) with which light scattered once, 1 − pω of all for an albedo ω, changes by factors (n,)."""
    single = 1.0 - _RECOLLISION * np.clip(color, 0.0, 1.0)
    return np.clip(color * hotspot_factor[:, None] ** single**_POWER, 0.0, 1.0)


@dataclass(frozen=True)
class LightRatios(Arrays):
    """How light on the facets of sub-plants (n) differs from that on their leaves."""

    hotspot: Floats  # (n,): light that leaves send to the eye once over what facets do, see `_balance`
    toward: Floats = column(3)  # (n, 3): unit vectors to the strongest lamp
    part: Floats  # (n,): its part of the light of all lamps; 0 where there is none

    def colors(self, color: Floats, owner: Integers, normal: Floats, leaves: Floats) -> Floats:
        """Colors (m, 3) of facets of owners (m,) with normals (m, 3) that stand for so many leaves (m,) each.

        They have their share of the hotspot, see `balanced_colors`, and are as bright as these leaves are together. On
        average over all ways to face that is as much light as without.
        """
        power = _EVENED * self.part[owner] * (1.0 - 1.0 / np.maximum(leaves, 1.0))
        # What sends on nearly all of its light cannot make up for what it does not get.
        brightest = np.clip(color.max(axis=1, initial=0.0), 1e-3, 1.0)
        power = np.minimum(power, np.log(brightest) / np.log(_AMBIENT / (_AMBIENT + 0.5)))
        lit = _AMBIENT + np.abs(np.einsum("ni,ni->n", normal, self.toward[owner]))
        # The cosine of normals that face anywhere is as often small as large.
        left = 2.0 - power
        mean = (0.5 + _AMBIENT) * left / ((1.0 + _AMBIENT) ** left - _AMBIENT**left)
        return np.clip(balanced_colors(color, self.hotspot[owner]) * (mean * lit**-power)[:, None], 0.0, 1.0)


def light_ratios(flora: Flora, plants: Branches, facet: Floats, camera: Camera, lights: Sequence[Light]) -> LightRatios:
    """Those of sub-plants (n) with facets of sides (n,), meters; of hotspots the mean over lamps by their strength.

    The sky has no hotspot. Where there are lamps, it is taken for little.
    """
    place = plants.position + 0.5 * plants.length[:, None] * plants.frame[:, :, 2]
    radius, low, high = extents(flora, plants, farthest=False).T
    volume = _FILLED * np.pi * radius**2 * (high - low) * plants.length**3
    extinction = 0.5 * flora.leaf_areas(plants) / np.maximum(volume, 1e-300)
    leaf, eye = np.sqrt(flora.one_leaf_area(plants)), to_eye(camera, place)
    total, strength, most = (np.zeros(len(place)) for _ in range(3))
    strongest = np.zeros_like(place)
    for light in lights:
        toward, away = -light.direction, 1.0
        if light.kind != "SUN":
            away = np.maximum(np.linalg.norm(light.position - place, axis=1), 1e-9)
            toward = (light.position - place) / away[:, None]
        irradiance = np.broadcast_to(float(np.mean(light.color)) / away**2, len(place))
        total += irradiance * _balance(np.linalg.norm(eye - toward, axis=1), extinction, leaf, facet)
        strength += irradiance
        strongest = np.where((irradiance > most)[:, None], toward, strongest)
        most = np.maximum(most, irradiance)
    divisor = np.maximum(strength, 1e-300)
    return LightRatios(np.where(strength > 0.0, total / divisor, 1.0), strongest, most / divisor)
