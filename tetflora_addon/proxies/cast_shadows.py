# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which things beside the view throw shadows into it, and from how far.

Of what stands beside the view, most can be noticed by little more than the light that it sends back. What stands
between a light and the view is noticed by the shape of its shadow, and wants finer facets: the space that the paper
refines "in order to calculate accurate shadows" (section 6.1).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..camera.camera import Camera
from ..refinement.lights import Light

#: Places along a shadow that are looked at; they lie the farther apart the longer it is.
_STEPS = 12
#: Meters to the first of them, and where a shadow without a floor ends.
_FIRST, _LONGEST = 1.0, 300.0
#: Where no light is known: length of shadows over the distance from the view.
_UNKNOWN = 2.5


@dataclass(frozen=True)
class ShadowReach:
    """Where shadows of things end up."""

    camera: Camera
    lights: Sequence[Light] = ()  # those that throw shadows
    floor: float = -np.inf  # height below which nothing receives any, meters

    def distance(self, points: Floats, distance_to_view: Floats, reach: Floats | float = 0.0) -> Floats:
        """Meters (n,) that shadows of points (n, 3) fall before they are in view; infinite where they never are.

        ``distance_to_view`` (n,) is that of the points from the view, meters; a shadow falls at least so far, and
        within the view it falls no meter. Where no light is known, as under an image of the sky, it is a multiple of
        that. ``reach`` (n,) is how far what casts the shadow extends around each point.
        """
        reach = np.broadcast_to(reach, len(points))
        if not any(light.shadow for light in self.lights):
            return _UNKNOWN * np.maximum(distance_to_view, 0.0)
        found = np.where(distance_to_view > 0.0, np.inf, 0.0)
        outside = np.flatnonzero(distance_to_view > 0.0)
        for light in self.lights:
            if len(outside) and light.shadow:
                found[outside] = np.minimum(found[outside], self._of(light, points[outside], reach[outside]))
        return np.maximum(found, np.maximum(distance_to_view, 0.0))

    def _of(self, light: Light, points: Floats, reach: Floats) -> Floats:
        if light.kind == "SUN":
            ray = np.broadcast_to(light.direction, points.shape)
        else:
            ray = points - light.position
            ray = ray / np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-12)
        # Nothing is seen below the floor.
        with np.errstate(divide="ignore", invalid="ignore"):
            down = np.where(ray[:, 2] < 0.0, (self.floor - points[:, 2] - reach) / ray[:, 2], np.inf)
        longest = np.clip(down, _FIRST, _LONGEST)
        found, before = np.full(len(points), np.inf), np.zeros(len(points))
        for step in range(1, _STEPS + 1):
            fallen = _FIRST * (longest / _FIRST) ** (step / _STEPS)
            # A place stands for the way from the one before.
            near = self.camera.distance_to_view(points + fallen[:, None] * ray) <= (fallen - before) / 2.0 + reach
            found = np.where(near, np.minimum(found, fallen), found)
            before = fallen
        return found
