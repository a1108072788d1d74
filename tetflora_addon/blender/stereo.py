# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The other eyes of a stereoscopic render, so that what only one of them sees is refined too."""

from __future__ import annotations

import math
from dataclasses import replace

import bpy
import numpy as np

from ..refinement.camera import Camera
from .transforms import frames_of, world_matrix


def stereo_views(scene: bpy.types.Scene, camera: Camera, depsgraph: bpy.types.Depsgraph) -> tuple[Camera, ...]:
    """Cameras that a scene renders beside its active one; none without stereoscopy.

    Parameters
    ----------
    camera : Camera
        The active one.

    Notes
    -----
    *Stereo 3D* moves the camera by half of the distance of the eyes to either side (or all of it, by the pivot), and
    lets the views meet at the distance of convergence: by shifting the window, by turning the camera, or not at all.
    *Multi-View* has a camera for each suffix of a name.
    """
    render = scene.render
    if not render.use_multiview or camera.kind == "PANO":
        return ()
    if render.views_format == 'MULTIVIEW':
        return _by_suffix(scene, camera, depsgraph)
    stereo = scene.camera.data.stereo
    eyes = {'CENTER': (-0.5, 0.5), 'LEFT': (0.0, 1.0), 'RIGHT': (-1.0, 0.0)}[stereo.pivot]
    found = []
    for side in (eye * stereo.interocular_distance for eye in eyes):
        if side == 0.0:
            continue
        moved = replace(camera, position=camera.position + side * camera.frame[:, 0])
        away = max(stereo.convergence_distance, 1e-3)
        if stereo.convergence_mode == 'OFFAXIS':
            left, right, bottom, top = camera.window
            shift = -side / away if camera.kind == "PERSP" else 0.0
            moved = replace(moved, window=(left + shift, right + shift, bottom, top))
        elif stereo.convergence_mode == 'TOE':
            angle = math.atan2(side, away)
            c, s = math.cos(angle), math.sin(angle)
            turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
            moved = replace(moved, frame=camera.frame @ turn)
        found.append(moved)
    return tuple(found)


def _by_suffix(scene: bpy.types.Scene, camera: Camera, depsgraph: bpy.types.Depsgraph) -> tuple[Camera, ...]:
    """Cameras whose names differ from the active one's by the suffixes of the scene's views."""
    suffixes = [view.camera_suffix for view in scene.render.views if view.use and view.camera_suffix]
    name = scene.camera.name
    base = next((name.removesuffix(s) for s in suffixes if name.endswith(s)), None)
    if base is None:
        return ()
    found = []
    for other in (scene.objects.get(base + suffix) for suffix in suffixes):
        if other is None or other.type != 'CAMERA' or other == scene.camera:
            continue
        matrix = np.array(world_matrix(other, depsgraph), np.float64)
        frame, _, sound = frames_of(matrix[None, :3, :3])
        if sound[0] and np.isfinite(matrix).all():
            found.append(replace(camera, position=matrix[:3, 3].copy(), frame=frame[0]))
    return tuple(found)
