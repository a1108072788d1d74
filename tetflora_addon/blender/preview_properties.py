# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a preview in the viewport shows: settings of a scene; what is shown itself lives in the session alone."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty

from . import preview_state
from .runtime import redraw

#: Reached by the slider; more can be typed.
_USUAL_LEVELS = 24


def _redraw(_group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    redraw()


def _plants_changed(group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    preview_state.plants_wanted(group.id_data)


def _freeze_changed(group: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    preview_state.freeze(group.id_data, group.freeze, context.evaluated_depsgraph_get)


class TetFloraPreview(bpy.types.PropertyGroup):
    """Preview of refine levels and of plants in 3D viewports."""

    level: IntProperty(
        name="Level",
        description=(
            "Level of refinement to show: 0 is the view before any pass, each further level is one pass. Beyond the "
            "last level, the last one is shown"
        ),
        min=0,
        soft_max=_USUAL_LEVELS,
        max=1000,
        options=set(),
        update=_redraw,
    )
    wires: BoolProperty(
        name="Tetrahedra",
        description="Draw the edges of tetrahedra that contain plants",
        default=True,
        options=set(),
        update=_redraw,
    )
    colour: EnumProperty(
        name="Color By",
        description="What the colors of tetrahedra show",
        items=(
            (
                'FORM',
                "Representation",
                "Green becomes polygons, orange proxies, blue is hidden, white will be split",
                0,
            ),
            ('LEVEL', "Level", "How often space was split: dark is rarely, bright is often", 1),
            ('VISIBILITY', "Visibility", "Fraction that the camera sees: dark is hidden", 2),
            (
                'CONTRIBUTION',
                "Contribution",
                "Number of pixels it affects in the image: dark is few, bright is many",
                3,
            ),
        ),
        default='FORM',
        options=set(),
        update=_redraw,
    )
    projected: BoolProperty(
        name="Translucent",
        description=(
            "Draw tetrahedra as clouds with the color and density of their contents. The most important ones are drawn "
            "first, as many as keep the viewport responsive"
        ),
        default=False,
        options=set(),
        update=_redraw,
    )
    forms: EnumProperty(
        name="Show",
        description="Tetrahedra to draw, by what they become; Shift-click to select several",
        items=(
            ('EXPLICIT', "Polygons", "Tetrahedra whose leaves and branches become polygons", 1),
            ('PROXY', "Proxies", "Tetrahedra drawn as proxies because they affect few pixels", 2),
            ('HIDDEN', "Hidden", "Tetrahedra that the camera barely sees", 4),
            ('SPLIT', "To Split", "Tetrahedra that the next level splits", 8),
        ),
        default={'EXPLICIT', 'PROXY', 'HIDDEN', 'SPLIT'},
        options={'ENUM_FLAG'},
        update=_redraw,
    )
    plants: EnumProperty(
        name="Plants",
        description="How plants appear in viewports. Not rendered, and no objects are created",
        items=(
            ('NONE', "None", "Only their empties, or the points of their fields", 0),
            ('LIGHT', "Simple Shapes", "A crown and a trunk of about twenty triangles, in the species' color", 1),
            ('BOUNDS', "Bounds", "Bounding boxes of the species", 2),
        ),
        default='NONE',
        options=set(),
        update=_plants_changed,
    )
    statistics: BoolProperty(
        name="Statistics",
        description="Show the level and the numbers of tetrahedra and polygons in the corner of the viewport",
        default=True,
        options=set(),
        update=_redraw,
    )
    freeze: BoolProperty(
        name="Freeze Camera",
        description=(
            "Keep the current camera for the preview, even when levels are computed again, while you move the scene's "
            "camera or navigate. Its view is drawn as a pyramid. Not saved in the file"
        ),
        options=set(),
        update=_freeze_changed,
    )


CLASSES = (TetFloraPreview,)
