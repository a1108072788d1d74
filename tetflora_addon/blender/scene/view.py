# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The view of a 3D viewport as a camera, so that plants can be refined for what the artist looks at."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...camera.camera import Camera

#: Depths, of the far clipping depth, from which on an orthographic view shows things.
_NEAREST = 1e-6


def viewport_of(scene: bpy.types.Scene) -> tuple[bpy.types.SpaceView3D, bpy.types.Region] | None:
    """The viewport of a scene that has a view of its own: one with rendered shading if there is one, else the largest.

    None where all look through the camera, or where there is no window.
    """
    found = []
    manager = bpy.context.window_manager
    for window in [] if manager is None else manager.windows:
        for area in window.screen.areas if window.scene == scene else ():
            if area.type != 'VIEW_3D' or area.spaces.active.region_3d.view_perspective == 'CAMERA':
                continue
            region = next((r for r in area.regions if r.type == 'WINDOW'), None)
            if region is not None and min(region.width, region.height) > 1:
                rendered = area.spaces.active.shading.type == 'RENDERED'
                found.append(((rendered, region.width * region.height), area.spaces.active, region))
    return max(found, key=lambda one: one[0])[1:] if found else None


def view_camera(scene: bpy.types.Scene) -> Camera | None:
    """The view of the viewport that `viewport_of` finds; None where there is none."""
    found = viewport_of(scene)
    if found is None:
        return None
    space, region = found
    view, projection = (np.array(m, np.float64) for m in (space.region_3d.view_matrix, space.region_3d.window_matrix))
    return camera_of(view, projection, (space.clip_start, space.clip_end), (region.width, region.height))


def camera_of(
    view: NDArray[np.float64], projection: NDArray[np.float64], clip: tuple[float, float], size: tuple[int, int]
) -> Camera:
    """The camera of the matrices that OpenGL draws with.

    Parameters
    ----------
    view, projection : (4, 4) float64
        From world to camera space, and from there to the cube that is drawn.
    clip : tuple of float
        Near and far clipping depths, metres. Orthographic views also show what is as far behind them.
    size : tuple of int
        Pixels.
    """
    to_world = np.linalg.inv(view)
    frame = to_world[:3, :3] / np.linalg.norm(to_world[:3, :3], axis=0)
    position, (near, far) = to_world[:3, 3], clip
    ortho = abs(projection[3, 3] - 1.0) < 1e-6
    middle = -projection[:2, 3] if ortho else projection[:2, 2]
    scale = np.array([projection[0, 0], projection[1, 1]])
    (left, bottom), (right, top) = ((end + middle) / scale for end in (-1.0, 1.0))
    if ortho:
        position, far = position + far * frame[:, 2], 2.0 * far
        near = _NEAREST * far
    kind = "ORTHO" if ortho else "PERSP"
    window = float(left), float(right), float(bottom), float(top)
    return Camera(kind, position, frame, window, float(near), float(far), *size)
