# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What refining will take, before it is done: seconds, polygons and bytes, from a few numbers in less than 1 ms.

A plant whose leaves are wide enough in the picture has polygons; of the others, a covered pixel gets so many
facets, whatever stands behind it. Such a plant covers the picture with the ellipse of its crown, and plants cover it
together as if they stood at random. What is out of view and casts shadows adds a fraction. All together is never more
than the picture can show. Time is linear in plants and in what is made.

The constants are meant for woods at 1920 × 1080 on two cores, the cases of ``python -m benchmarks forest``, to whose
seconds and numbers they are fitted whenever refinement changes; other machines differ by their speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import Camera
from .settings import RefinementSettings

#: Seconds of any refinement, of each plant, and of each polygon or facet.
SECONDS = 1.0
SECONDS_PER_PLANT = 2.5e-5
SECONDS_PER_PRIMITIVE = 5.5e-6
#: Facets of a covered pixel, one behind the other, if they are as large as one; numbers go with the inverse square of
#: their size.
FACETS_PER_PIXEL = 8.5
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
        Where some of them stand, metres.
    radius, height : (k,) float64
        Of their crowns, and of the whole plant, metres.
    polygons : (k,) float64
        Expected numbers of whole plants.
    leaf : (k,) float64
        Mean width of their leaves, metres.
    """

    number: int
    foot: NDArray[np.float64]
    radius: NDArray[np.float64]
    height: NDArray[np.float64]
    polygons: NDArray[np.float64]
    leaf: NDArray[np.float64]

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
        wanted = float(stand.polygons.sum() * stand.weight)
    else:
        wanted = min(_primitives(stand, camera, settings), shown)
    most = np.inf if everything else min(settings.max_polygons or np.inf, allowed / BYTES_PER_PRIMITIVE)
    made = min(wanted, most)
    seconds = SECONDS + SECONDS_PER_PLANT * stand.number + SECONDS_PER_PRIMITIVE * made
    memory = used + BYTES_PER_PLANT * stand.number + BYTES_PER_PRIMITIVE * made
    return Estimate(stand.number, made, seconds, memory, wanted > most)


def _primitives(stand: Stand, camera: Camera, settings: RefinementSettings) -> float:
    """Polygons and facets that a picture needs without limits."""
    _, pixel, each = _seen(stand, camera)
    # Leaves that are larger than facets are drawn as they are: there are fewer of them for each pixel.
    dense = FACETS_PER_PIXEL / np.maximum(settings.facet, stand.leaf / pixel) ** 2
    picture = camera.width * camera.height
    shown = stand.weight * each.sum()
    full = -picture * np.expm1(-shown / picture) / max(shown, 1e-9)
    return float((1.0 + UNSEEN) * stand.weight * np.minimum(stand.polygons, full * dense * each).sum())


def covered_pixels(stand: Stand, camera: Camera) -> NDArray[np.float64]:
    """Pixels (k,) of the picture that each known plant covers by itself."""
    return _seen(stand, camera)[2]


def _seen(stand: Stand, camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Fraction (k,) of each known plant in the picture, metres (k,) that a pixel spans there, pixels (k,) it covers."""
    middle = stand.foot + stand.height[:, None] * np.array([0.0, 0.0, 0.5])
    across = np.sqrt(stand.radius * np.maximum(stand.height / 2.0, stand.radius))  # of the disc of equal area
    depth = camera.to_camera_space(middle)[:, 2]
    if camera.kind == "PANO":
        away = np.linalg.norm(middle - camera.position, axis=1)
    else:
        away = np.ones(len(depth)) if camera.kind == "ORTHO" else depth
    inside = np.clip(0.5 - camera.clearance(middle) / (2.0 * np.maximum(across, 1e-9)), 0.0, 1.0)
    if camera.kind != "PANO":
        inside[(depth + across < camera.near) | (depth - across > camera.far)] = 0.0
    pixel = camera.pixel_size * (away if camera.kind == "ORTHO" else np.maximum(away, across))
    return inside, pixel, np.minimum(inside * np.pi * (across / pixel) ** 2, camera.width * camera.height)
