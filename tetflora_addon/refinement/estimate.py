# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What refining will take, before it is done: seconds, polygons and bytes, from a few numbers in less than 1 ms.

A covered pixel gets so many leaves, whatever stands behind them. Those that are wide enough in the picture have the
polygons of their levels of detail, which near the camera are hundreds; of the others it gets facets. A plant covers the
picture with the slices of its crown, and plants together cover the rows in which they are as if they stood at random.
What is out of view and casts shadows adds a fraction. All together is never more than the picture can show. Time is
linear in plants and in what is made.

The seconds are meant for woods at 1920 × 1080 on two cores, the cases of ``python -m benchmarks forest``, to which they
are fitted whenever refinement changes; other machines differ by their speed. Numbers are within a factor of two for
trees next to the camera, woods at eye height and woods far away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Integers
from ..camera.camera import Camera
from ..compiled.crowns import Crown
from .settings import RefinementSettings

#: Seconds of any refinement, of each plant, and of each polygon or facet.
SECONDS = 1.0
SECONDS_PER_PLANT = 2.5e-5
SECONDS_PER_PRIMITIVE = 5.5e-6
#: Leaves or facets of a covered pixel, one behind the other, if they are as large as one; numbers go with the inverse
#: square of their size.
FACETS_PER_PIXEL = 7.2
#: Slices of a crown: up close the camera sees some of them.
SLICES = 6
#: Pixels by which the margin of a leaf may be off.
TOLERANCE = 0.5
#: Polygons and facets that are never too many: facets are finer than asked for as long as there are no more, up to so
#: many times.
NEVER_TOO_MANY, FINEST = 1_200_000.0, 3.0
#: Of what is seen, for plants that are out of view or hidden.
UNSEEN = 0.3
#: Bytes of each plant, and of each polygon or facet in Blender and the renderer together.
BYTES_PER_PLANT = 500.0
BYTES_PER_PRIMITIVE = 610.0


@dataclass(frozen=True)
class Stand:
    """Plants of a scene, or some of them that stand for all.

    Attributes
    ----------
    number : int
        All plants.
    foot : (k, 3) float64
        Where some of them stand, meters.
    scale : (k,) float64
    which : (k,) int64
        Their crowns, as indices into the next.
    crowns : tuple of Crown
    """

    number: int
    foot: Floats
    scale: Floats
    which: Integers
    crowns: tuple[Crown, ...]

    def of_crowns(self, name: str) -> Floats:
        """An attribute (k,) of each plant's crown, at scale 1."""
        return np.array([getattr(crown, name) for crown in self.crowns], dtype=np.float64)[self.which]

    @property
    def weight(self) -> float:
        """Plants that each of those that are known stands for."""
        return self.number / max(len(self.foot), 1)


@dataclass(frozen=True)
class Estimate:
    """What a refinement will take.

    Attributes
    ----------
    plants : int
    primitives : float
        Polygons and facets.
    seconds : float
    memory : float
        Bytes of the whole process with the result, and rendering it.
    limited : bool
        Whether a limit of the settings makes plants coarser.
    """

    plants: int
    primitives: float
    seconds: float
    memory: float
    limited: bool


def estimate(
    stand: Stand,
    camera: Camera,
    settings: RefinementSettings,
    used: float,
    allowed: float,
    shown: float = np.inf,
    everything: bool = False,
) -> Estimate:
    """Estimate a refinement.

    Parameters
    ----------
    stand : Stand
    camera : Camera
    settings : RefinementSettings
    used : float
        Bytes that are taken already, and that the renderer will need for its picture.
    allowed : float
        Bytes left for results, see `memory.allowance`; infinite without a limit.
    shown : float
        Polygons and facets that the picture can show, see `emission.budget.enough`.
    everything : bool
        Whether plants are expanded instead of refined; limits do not hold then.
    """
    if everything:
        wanted = float(stand.of_crowns("polygons").sum() * stand.weight)
    else:
        wanted = min(_primitives(stand, camera, settings), shown)
    most = np.inf if everything else min(settings.max_polygons or np.inf, allowed / BYTES_PER_PRIMITIVE)
    made = min(wanted, most)
    seconds = SECONDS + SECONDS_PER_PLANT * stand.number + SECONDS_PER_PRIMITIVE * made
    memory = used + BYTES_PER_PLANT * stand.number + BYTES_PER_PRIMITIVE * made
    return Estimate(stand.number, made, seconds, memory, wanted > most)


def _primitives(stand: Stand, camera: Camera, settings: RefinementSettings) -> float:
    """Polygons and facets that a picture needs without limits."""
    pixel, each, rows = seen(stand, camera)
    wide = stand.of_crowns("leaf") * stand.scale / pixel
    leaves, finer = np.ones((2, *wide.shape))
    for number, crown in enumerate(stand.crowns):
        own = stand.which == number
        leaves[:, own] = crown.leaf_polygons(wide[:, own].ravel() / TOLERANCE).reshape(SLICES, -1)
        finer[:, own] = leaves[:, own] / (1 if crown.form is None else crown.form.polygons)
    picture = camera.width * camera.height
    shown = stand.weight * each.sum()
    covered = -rows * picture * np.expm1(-shown / max(rows * picture, 1e-9))
    asked = FACETS_PER_PIXEL * covered / settings.facet**2 + picture
    facet = settings.facet / np.clip(np.sqrt(NEVER_TOO_MANY / asked), 1.0, FINEST)
    # Leaves are drawn as they are, where each of their polygons is larger than a facet.
    dense = FACETS_PER_PIXEL / np.maximum(facet**2, wide**2 / leaves)
    whole = finer * stand.of_crowns("polygons") / SLICES
    made = np.minimum(whole, covered / max(shown, 1e-9) * dense * each)
    return float((1.0 + UNSEEN) * stand.weight * made.sum())


def seen(stand: Stand, camera: Camera) -> tuple[Floats, Floats, float]:
    """Of slices of crowns: meters (SLICES, k) that a pixel spans there, pixels (SLICES, k) that each covers.

    Last comes the fraction of the rows of the picture between the lowest and the highest of them.
    """
    radius, base, height = (stand.of_crowns(name) * stand.scale for name in ("radius", "base", "height"))
    tall = np.maximum(height - base, 2.0 * radius) / SLICES
    middle = np.repeat(stand.foot[None], SLICES, axis=0)
    middle[..., 2] += base + (height - base) * (np.arange(SLICES)[:, None] + 0.5) / SLICES
    reach, points = np.maximum(radius, tall / 2.0), middle.reshape(-1, 3)
    _, up, depth = camera.to_camera_space(points).T.reshape(3, SLICES, -1)
    if camera.kind == "PANO":
        away = np.linalg.norm(middle - camera.position, axis=2)
    else:
        away = np.ones(depth.shape) if camera.kind == "ORTHO" else depth
    inside = np.clip(
        0.5 - camera.distance_to_view(points).reshape(SLICES, -1) / (2.0 * np.maximum(reach, 1e-9)), 0.0, 1.0
    )
    if camera.kind != "PANO":
        inside[(depth + reach < camera.near) | (depth - reach > camera.far)] = 0.0
    away = away if camera.kind == "ORTHO" else np.maximum(away, reach)
    pixel = camera.pixel_size * away
    seen, (bottom, top) = inside > 0.0, camera.window[2:]
    low, high = (
        np.min((up - reach) / away, where=seen, initial=top),
        np.max((up + reach) / away, where=seen, initial=bottom),
    )
    rows = float(max(min(high, top) - max(low, bottom), 0.0) / (top - bottom))
    # A slice has its part of the ellipse that is as wide and as tall as the crown.
    area = np.pi / 2.0 * radius * tall
    return pixel, np.minimum(inside * area / pixel**2, camera.width * camera.height), rows
