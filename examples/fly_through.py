# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk past the row of eighty, or through the landscape, at eye height (the paper's animation, section 8.2)."""

from __future__ import annotations

import math

import bpy
import numpy as np
from bpy_extras import anim_utils
from mathutils import Vector
from numpy.typing import NDArray

from tetflora_addon.blender.scene.plants import read_plants

from . import landscape, row80

FRAMES, RATE = 96, 24
#: Meters a second that somebody walks.
SPEED = 1.4
SCENES = ("row80", "landscape")
#: Height of the eye over the ground in the landscape, and how far ahead it looks, meters.
_EYE, _AHEAD = 1.7, 60.0
#: In the landscape the walk begins so many meters from its near border, at most so many aside of its middle.
_BEGIN, _ASIDE = 60.0, 60.0


def build(scene: bpy.types.Scene, frames: int = FRAMES, of: str = "row80") -> None:
    """Fill an empty scene with plants, and let its camera walk past them from frame 1 on.

    The first frame of the row is the row's still image. Every frame has a key, with straight lines between.

    Parameters
    ----------
    scene : bpy.types.Scene
    frames : int
        Number of frames.
    of : str
        One of `SCENES`.

    Raises
    ------
    ValueError
        No such scene.
    """
    length = SPEED * (frames - 1) / RATE
    if of == "row80":
        row80.build(scene)
        start = np.array(scene.camera.location[:2])
        height = scene.camera.location.z - _ground(scene, start[None])[0]
    elif of == "landscape":
        landscape.build(scene)
        start, height = _lane(scene, length), _EYE
        _look_ahead(scene, start)
    else:
        raise ValueError(f"there is no walk through {of!r}; known are {', '.join(SCENES)}")
    scene.render.fps = RATE
    scene.frame_start, scene.frame_end = 1, frames
    path = start + np.linspace(0.0, length, frames)[:, None] * [0.0, 1.0]
    _walk(scene.camera, np.column_stack([path, _ground(scene, path) + height]))
    scene.frame_set(1)


def _ground(scene: bpy.types.Scene, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights (n,) of the scene's ground at places (n, 2), meters; it lies where its mesh does."""
    ground = next(o for o in scene.objects if o.tetflora.is_occluder)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    down = Vector((0.0, 0.0, -1.0))
    hits = [ground.ray_cast((*place, 1e4), down, depsgraph=depsgraph) for place in places.tolist()]
    if not all(hit for hit, *_ in hits):
        raise ValueError("the walk leaves the ground: ask for fewer frames")
    return np.array([point.z for _, point, *_ in hits])


def _lane(scene: bpy.types.Scene, length: float) -> NDArray[np.float64]:
    """Where a walk along +y begins that keeps farther from all plants than others near the middle, (2,)."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    plants = read_plants(scene, depsgraph)[0].position[:, :2]
    begin = np.linspace(-_ASIDE, _ASIDE, 481) + scene.camera.location.x
    beyond = np.maximum(np.maximum(_BEGIN - plants[:, 1], plants[:, 1] - _BEGIN - length), 0.0)
    nearest = [np.hypot(plants[:, 0] - x, beyond).min() for x in begin]
    return np.array([begin[int(np.argmax(nearest))], _BEGIN])


def _look_ahead(scene: bpy.types.Scene, start: NDArray[np.float64]) -> None:
    """Turn the camera along +y, as steep as the land ahead."""
    here, there = _ground(scene, np.array([start, start + [0.0, _AHEAD]]))
    scene.camera.rotation_euler = (math.pi / 2 + math.atan2(there - here, _AHEAD), 0.0, 0.0)


def _walk(camera: bpy.types.Object, places: NDArray[np.float64]) -> None:
    """Be at places (n, 3), one a frame from frame 1 on."""
    for frame, place in enumerate(places.tolist(), start=1):
        camera.location = place
        camera.keyframe_insert("location", frame=frame)
    animation = camera.animation_data
    for curve in anim_utils.action_get_channelbag_for_slot(animation.action, animation.action_slot).fcurves:
        for key in curve.keyframe_points:
            key.interpolation = 'LINEAR'
