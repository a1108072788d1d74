# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What viewports preview of each scene, levels of refinement and simple plants, and the settings of the preview.

The settings are saved in the file; what is shown lives in the session.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import bpy

from ...camera.camera import Camera
from ...errors import TetFloraError
from ...growth.seeds import Seeds
from ...parameters import within
from ...preview.levels import Levels
from ...preview.light_plants import Shapes
from ...preview.running import InView
from ..declare import FIXED, HIDDEN, boolean, choice, integer
from ..runtime import Listeners, redraw
from ..scene.camera import read_camera

#: What `scene.camera` reads of a camera, of its depth of field, and of the image.
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

#: Called when plants are to be shown in another form, without arguments; `viewport.levels` listens.
listeners = Listeners()


@dataclass
class Running:
    """Plants that stay the same while the timeline runs."""

    seeds: Seeds
    others: list[Shapes]  # plants that are assets
    known: tuple  # stands' years and species without plants, when they were read
    seen: InView | None = None  # those in the views of viewports
    views: tuple = ()  # how these looked then


@dataclass
class Preview:
    """What is shown of one scene."""

    levels: Levels | None = None  # all levels of the last refinement that was asked for
    looked: tuple = ()  # how the scene's camera was then, see `camera_now`
    frozen: Camera | None = None  # camera that stays whatever becomes of the scene's
    shapes: Shapes | None = None  # all plants in the form that is chosen
    objects: int = 0  # that viewports showed when they were read
    moment: tuple = ()  # its day of the year and years then
    running: Running | None = None  # what is read once while the timeline runs
    message: str = ""  # why plants cannot be shown; empty if they can
    seconds: float = 0.0  # of the processor that reading them took
    changes: int = 0  # counts those of levels and shapes, to know what the graphics card already has
    cache: dict = field(default_factory=dict)  # what the overlay keeps


previews: dict[int, Preview] = {}
"""By the scene's `session_uid`."""


def find(scene: bpy.types.Scene) -> Preview | None:
    """What is previewed of a scene, if anything."""
    return previews.get(scene.session_uid)


def of(scene: bpy.types.Scene) -> Preview:
    """The same, made if there is none."""
    return previews.setdefault(scene.session_uid, Preview())


def forget(scene: bpy.types.Scene) -> None:
    """Forget the levels of a scene; its frozen camera and its plants stay."""
    preview = find(scene)
    if preview is not None:
        preview.levels, preview.looked = None, ()
        preview.changes += 1
    redraw()


def camera_now(scene: bpy.types.Scene) -> tuple:
    """What of the scene's camera and image decides on levels; cheap, to see whether it has changed.

    Not where an object in focus is, and how far apart the eyes of a stereoscopic image are.
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


def on_undo(scene: bpy.types.Scene, *_: object) -> None:
    """After undo, which changes settings without a word: what is frozen, and shown of plants, follows them."""
    preview, settings = find(scene), scene.tetflora.preview
    if preview is not None:
        if not settings.freeze:
            preview.frozen = None
        elif preview.frozen is None and preview.levels is not None:
            preview.frozen = preview.levels.camera
        plants_wanted(scene)


def plants_wanted(scene: bpy.types.Scene) -> None:
    """The form of plants was chosen: show them soon, or take them away at once."""
    if scene.tetflora.preview.plants == 'NONE':
        preview = of(scene)
        preview.shapes, preview.message = None, ""
        preview.changes += 1
        redraw()
    else:
        listeners.notify()


#: Of settings that only panels for developers show.
_SHOWN = {"options": {'HIDDEN'}, "update": lambda _group, _context: redraw()}


class TetFloraPreview(bpy.types.PropertyGroup):
    """Preview of refine levels and of plants in 3D viewports."""

    level: integer(
        "Level",
        "Level of refinement to show: 0 is the view before any pass, each further level is one pass. Beyond the "
        "last level, the last one is shown",
        **within(0, 24, 1000),
        **_SHOWN,
    )
    wires: boolean("Tetrahedra", "Draw the edges of tetrahedra that contain plants", True, **_SHOWN)
    color: choice(
        "Color By",
        "What the colors of tetrahedra show",
        (
            ('FORM', "Representation", "Green becomes polygons, orange proxies; blue is hidden, white splits next", 0),
            ('LEVEL', "Level", "How often space was split: dark is rarely, bright is often", 1),
            ('VISIBILITY', "Visibility", "Fraction that the camera sees: dark is hidden", 2),
            ('CONTRIBUTION', "Contribution", "Number of pixels that it affects: dark is few, bright is many", 3),
        ),
        **_SHOWN,
    )
    projected: boolean(
        "Translucent",
        "Draw tetrahedra as clouds with the color and density of their contents. The most important ones are drawn "
        "first, as many as keep the viewport responsive",
        **_SHOWN,
    )
    forms: choice(
        "Show",
        "Tetrahedra to draw, by what they become; Shift-click to select several",
        (
            ('EXPLICIT', "Polygons", "Tetrahedra whose leaves and branches become polygons", 1),
            ('PROXY', "Proxies", "Tetrahedra drawn as proxies because they affect few pixels", 2),
            ('HIDDEN', "Hidden", "Tetrahedra that the camera barely sees", 4),
            ('SPLIT', "To Split", "Tetrahedra that the next level splits", 8),
        ),
        default={'EXPLICIT', 'PROXY', 'HIDDEN', 'SPLIT'},
        **{**_SHOWN, "options": {'ENUM_FLAG', 'HIDDEN'}},
    )
    plants: choice(
        "Plants",
        "How plants appear in viewports. Not rendered, and no objects are created",
        (
            ('LIGHT', "Simple Shapes", "A crown and a trunk of about twenty triangles, in the species' color", 1),
            ('BOUNDS', "Bounds", "Bounding boxes of the species", 2),
            ('NONE', "None", "Only their empties, or the points of their fields", 0),
        ),
        **FIXED,
        default='LIGHT',
        update=lambda group, _context: plants_wanted(group.id_data),
    )
    statistics: boolean(
        "Statistics", "Show the level and numbers of tetrahedra and polygons in the viewport's corner", True, **_SHOWN
    )
    freeze: boolean(
        "Freeze Camera",
        "Keep the current camera for the preview, even when levels are computed again, while you move the scene's "
        "camera or navigate. Its view is drawn as a pyramid. Not saved in the file",
        **HIDDEN,
        update=lambda group, context: freeze(group.id_data, group.freeze, context.evaluated_depsgraph_get),
    )
