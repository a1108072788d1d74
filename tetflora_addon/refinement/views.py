# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the loop starts from: how wide the view is, the root of space, and the buffers into which it is drawn.

All that depends on the sort of camera, so that the loop itself need not know it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..plants.branches import Branches
from ..plants.compiled import Flora
from ..tetrahedra.roots import view_root
from ..tetrahedra.tree import TetrahedralTree
from ..tetrahedra.world_root import world_root
from .blur import blur_margins
from .camera import Camera
from .contents import bounding_cylinders
from .panorama import PanoramaBuffers, face_side
from .polygons import Polygons
from .rasterise import buffer_size
from .settings import RefinementSettings
from .visibility import Buffers


def widened_for(
    camera: Camera, margin: float, flora: Flora, subplants: Branches, polygons: Polygons | None = None
) -> Camera:
    """The camera with a margin, in shares of the picture, and what depth of field and motion blur add to it.

    Polygons count by their centres: what is one large face from the eye to the horizon asks for no margin.
    """
    if not (camera.lens_radius > 0.0 or camera.shutter):
        return camera.widened(margin)
    centre, radius, half_height = bounding_cylinders(flora, subplants)
    reach = np.hypot(radius, half_height)
    if polygons is not None:
        centre, reach = np.concatenate([centre, polygons.centre]), np.append(reach, np.zeros(len(polygons)))
    across, up = blur_margins(camera, centre, reach)
    return camera.widened(margin + across, margin + up)


def is_anchored(camera: Camera, settings: RefinementSettings) -> bool:
    """Whether the root stays where it is in the world; a panorama has no pyramid that a root could begin with."""
    return settings.anchored or camera.kind == "PANO"


def root_for(camera: Camera, settings: RefinementSettings, bounds: NDArray[np.float64]) -> TetrahedralTree:
    """Root for a box (2, 3) around all that is in the scene, metres."""
    return world_root(bounds) if is_anchored(camera, settings) else view_root(camera, bounds)


def buffers_for(
    camera: Camera, resolution: int, occluders: NDArray[np.float64] | None = None
) -> Buffers | PanoramaBuffers:
    """Alpha buffers of a camera, finest ``resolution`` pixels along the longer side; occluders as `Buffers` takes."""
    return (PanoramaBuffers if camera.kind == "PANO" else Buffers)(camera, resolution, occluders)


def pixels_of_buffer(camera: Camera, resolution: int) -> float:
    """Side of a pixel of the finest alpha buffer, in pixels of the final picture."""
    if camera.kind == "PANO":
        return 2.0 / face_side(resolution) / camera.pixel_size
    return camera.width / buffer_size(camera, resolution)[0]
