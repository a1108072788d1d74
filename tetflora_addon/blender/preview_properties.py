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
            "Level of refinement that is shown: 0 is the view as two halves and what is around it, each further one a "
            "pass of the refinement. Beyond the last level the last one is shown"
        ),
        min=0,
        soft_max=_USUAL_LEVELS,
        max=1000,
        options=set(),
        update=_redraw,
    )
    wires: BoolProperty(
        name="Tetrahedra",
        description="Draw the edges of the tetrahedra that hold something",
        default=True,
        options=set(),
        update=_redraw,
    )
    colour: EnumProperty(
        name="Colour By",
        description="What the colours of tetrahedra tell",
        items=(
            ('FORM', "Form", "Green becomes polygons, orange proxies, blue is hidden, white will be divided", 0),
            ('LEVEL', "Level", "How often space was divided: dark rarely, bright often", 1),
            ('VISIBILITY', "Visibility", "Share that the camera sees: dark is hidden by what is in front", 2),
            ('CONTRIBUTION', "Contribution", "Pixels that the picture would change: dark few, bright many", 3),
        ),
        default='FORM',
        options=set(),
        update=_redraw,
    )
    projected: BoolProperty(
        name="Translucent",
        description=(
            "Draw tetrahedra as clouds of the colour and density of what they hold, made anew for each view from at "
            "most four triangles each. Those that matter most are drawn first, as many as keep the viewport quick"
        ),
        default=False,
        options=set(),
        update=_redraw,
    )
    forms: EnumProperty(
        name="Show",
        description="Tetrahedra that are drawn, by what becomes of them; Shift click for several",
        items=(
            ('EXPLICIT', "Explicit", "Those in which leaves and branches become polygons", 1),
            ('PROXY', "Proxies", "Those that are drawn as proxies because they change few pixels", 2),
            ('HIDDEN', "Hidden", "Those that the camera sees next to nothing of", 4),
            ('SPLIT', "To Divide", "Those that the next level divides", 8),
        ),
        default={'EXPLICIT', 'PROXY', 'HIDDEN', 'SPLIT'},
        options={'ENUM_FLAG'},
        update=_redraw,
    )
    plants: EnumProperty(
        name="Plants",
        description="How plants are shown in viewports. Nothing of it renders, and no object is made",
        items=(
            ('NONE', "As They Are", "Only their empties, or the points of their fields", 0),
            ('LIGHT', "Light Proxies", "A crown and a trunk of some twenty triangles, in the species' colour", 1),
            ('BOUNDS', "Bounds", "Boxes around what the compiled species reaches", 2),
        ),
        default='NONE',
        options=set(),
        update=_plants_changed,
    )
    statistics: BoolProperty(
        name="Figures",
        description="Write level, numbers of tetrahedra and polygons into the corner of the viewport",
        default=True,
        options=set(),
        update=_redraw,
    )
    freeze: BoolProperty(
        name="Freeze Camera",
        description=(
            "Keep the camera as it is now for the preview: it stays as it is, also when levels are computed again, "
            "while you move the scene's camera or fly around. Its view is drawn as a pyramid. Not saved in the file"
        ),
        options=set(),
        update=_freeze_changed,
    )


CLASSES = (TetFloraPreview,)
