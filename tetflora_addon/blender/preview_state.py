# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What viewports preview of each scene: levels of refinement, plants of few faces. Of this session, never of a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import bpy

from ..errors import TetFloraError
from ..preview.levels import Levels
from ..preview.light_plants import Shapes
from ..refinement.camera import Camera
from .camera_reader import read_camera
from .runtime import Listeners, redraw

#: What `camera_reader` reads of a camera, of its depth of field, and of the picture.
_LENS = (
    *("type", "lens", "ortho_scale", "shift_x", "shift_y", "sensor_fit", "sensor_width", "sensor_height"),
    *("clip_start", "clip_end", "panorama_type", "longitude_min", "longitude_max", "latitude_min", "latitude_max"),
    *("fisheye_fov", "fisheye_lens"),
)
_FOCUS = "use_dof", "aperture_fstop", "focus_distance"
_PICTURE = (
    *("resolution_x", "resolution_y", "resolution_percentage", "pixel_aspect_x", "pixel_aspect_y"),
    *("use_multiview", "use_motion_blur", "motion_blur_shutter", "motion_blur_position"),
)

#: Called when plants are to be shown in another form, without arguments; `preview_job` listens.
listeners = Listeners()


@dataclass
class Preview:
    """What is shown of one scene.

    Attributes
    ----------
    levels : Levels, optional
        All levels of the last refinement that was asked for.
    looked : tuple
        How the scene's camera was then, see `camera_now`.
    frozen : Camera, optional
        Camera that stays whatever becomes of the scene's.
    shapes : Shapes, optional
        All plants in the form that is chosen.
    objects : int
        Objects of the scene when they were read.
    message : str
        Why plants cannot be shown; empty if they can.
    seconds : float
        What reading them took.
    made : int
        Counts changes of levels and shapes, so that what was handed to the graphics card can be told from what is new.
    cache : dict
        Room for the overlay.
    """

    levels: Levels | None = None
    looked: tuple = ()
    frozen: Camera | None = None
    shapes: Shapes | None = None
    objects: int = 0
    message: str = ""
    seconds: float = 0.0
    made: int = 0
    cache: dict = field(default_factory=dict)


_previews: dict[int, Preview] = {}


def find(scene: bpy.types.Scene) -> Preview | None:
    """What is previewed of a scene, if anything."""
    return _previews.get(scene.session_uid)


def of(scene: bpy.types.Scene) -> Preview:
    """The same, made if there is none."""
    return _previews.setdefault(scene.session_uid, Preview())


def forget_all() -> None:
    """Forget everything: another file is opened, or TetFlora is switched off."""
    _previews.clear()


def longest_reading() -> float:
    """Seconds that reading the plants of any scene took last."""
    return max((preview.seconds for preview in _previews.values()), default=0.0)


def forget(scene: bpy.types.Scene) -> None:
    """Forget the levels of a scene; its frozen camera and its plants stay."""
    preview = find(scene)
    if preview is not None:
        preview.levels, preview.looked = None, ()
        preview.made += 1
    redraw()


def camera_now(scene: bpy.types.Scene) -> tuple:
    """What of the scene's camera and picture decides on levels; cheap, to see whether it has changed.

    Not where an object in focus is, and how far apart the eyes of a stereoscopic picture are.
    """
    camera, render = scene.camera, scene.render
    if camera is None or camera.type != 'CAMERA':
        return ()
    data = camera.data
    matrix = tuple(round(value, 6) for row in camera.matrix_world for value in row)
    lens = (*(getattr(data, name) for name in _LENS), *(getattr(data.dof, name) for name in _FOCUS))
    return camera.name, matrix, lens, tuple(getattr(render, name) for name in _PICTURE)


def is_outdated(scene: bpy.types.Scene) -> bool:
    """Whether the scene's camera has changed since its levels were computed, and nothing is frozen."""
    preview = find(scene)
    if preview is None or preview.levels is None or preview.frozen is not None:
        return False
    return preview.looked != camera_now(scene)


def freeze(scene: bpy.types.Scene, on: bool, depsgraph: Callable[[], bpy.types.Depsgraph]) -> None:
    """Keep the camera of the levels that are shown, or the scene's where there are none; or let go of it."""
    preview = of(scene)
    preview.frozen = None
    if on:
        try:
            preview.frozen = preview.levels.camera if preview.levels else read_camera(scene, depsgraph())
        except TetFloraError as error:
            preview.message = str(error)
    redraw()


def bring_in_step(scene: bpy.types.Scene) -> None:
    """After undo, which changes settings without a word: what is frozen, and shown of plants, follows them."""
    preview, settings = find(scene), scene.tetflora.preview
    if preview is not None:
        if not settings.freeze:
            preview.frozen = None
        elif preview.frozen is None and preview.levels is not None:
            preview.frozen = preview.levels.camera
    if preview is not None or settings.plants != 'NONE':
        plants_wanted(scene)


def plants_wanted(scene: bpy.types.Scene) -> None:
    """The form of plants was chosen: show them soon, or take them away at once."""
    if scene.tetflora.preview.plants == 'NONE':
        preview = of(scene)
        preview.shapes, preview.message = None, ""
        preview.made += 1
        redraw()
    else:
        listeners.notify()
