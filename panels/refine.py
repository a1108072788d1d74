# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine: First Forest while the scene has no plants, then buttons, state and quality; what is wrong, with a remedy."""

import bpy

from ..tetflora_addon.blender.job.forecast import forecast_text
from ..tetflora_addon.blender.placing.first_forest import FIRST_FOREST
from ..tetflora_addon.blender.results.output import KIND
from ..tetflora_addon.blender.scene.objects import has_contents, has_plants
from ..tetflora_addon.blender.viewport import auto
from ..tetflora_addon.blender.viewport.warnings import Warned, warned
from .base import Button, draw_message, draw_properties, panel, popover
from .outputs import made_of

_FEW = 200  # objects to look through at every movement of the mouse; a larger scene is not a new one


@panel("Refine", "rendering.md#refine")
def TETFLORA_PT_refine(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Refine: above the others, because it is what one comes back to."""
    scene = context.scene
    many = bpy.data.objects[_FEW : _FEW + 1]  # Blender counts them all for their number
    if not many and not has_contents(scene):
        column = layout.box().column()
        column.scale_y = 1.6
        Button("first_forest", 'WORLD').draw(column)
        layout.label(text="Then press F12 to render it")
    row = layout.row(align=True)
    row.scale_y = 1.4
    row.operator("tetflora.refine", icon='MOD_DECIM')
    row.operator("tetflora.clear", text="", icon='TRASH')
    _draw_warnings(layout.row(align=True), warned(context))
    # One line each, whatever they say: rows never move under the mouse.
    layout.label(text=state_of(scene), icon='SORTTIME' if scene.tetflora.auto_refine else 'INFO')
    expected = forecast_text(scene, context.view_layer).splitlines()
    layout.label(text=expected[0] if expected else "", icon='TIME' if expected else 'BLANK1')
    draw_properties(layout, scene.tetflora, "quality", "refine_at_render", "auto_refine")
    row = layout.row(align=True)
    Button("look", 'VIEW_CAMERA', values={"where": 'EYE'}).draw(row)
    Button("daylight", 'LIGHT_SUN').draw(row)


def _draw_warnings(row: bpy.types.UILayout, warnings: list[Warned]) -> None:
    """The first warning with what mends it, and how many there are: always one line."""
    if not warnings:
        row.label(text="Nothing to mend", icon='CHECKMARK')
        return
    first = warnings[0]
    more = f" (+{len(warnings) - 1})" if len(warnings) > 1 else ""
    row = row.split(factor=0.55, align=True)
    row.label(text=first.short + more, icon='ERROR')
    row = row.row(align=True)
    if first.button:
        Button("mend", 'MODIFIER', first.button, {"what": first.key}).draw(row)
    row.popover(panel=TETFLORA_PT_warnings.__name__, text="", icon='COLLAPSEMENU')


@popover("Warnings", 18)
def TETFLORA_PT_warnings(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What is wrong, at length; opened from Refine."""
    for one in warned(context):
        box = layout.box()
        draw_message(context, box, one.text, width=340)
        if one.button:
            Button("mend", 'MODIFIER', one.button, {"what": one.key}).draw(box)


def state_of(scene: bpy.types.Scene) -> str:
    """What results there are, in one line."""
    settings = scene.tetflora
    if settings.auto_refine:
        return auto.message() or "Refine Automatically is on"
    if scene.camera is not None and (changed := auto.changed_since(scene)):
        return f"Out of date: {changed[0]} {'and more' if len(changed) > 1 else 'changed'}"
    return hint(scene) or made_of(settings.statistics) or "Nothing refined yet"


def hint(scene: bpy.types.Scene) -> str:
    """Text for a scene with plants of which nothing is refined; otherwise empty. Cheap as a rule."""
    settings = scene.tetflora
    if settings.statistics:
        return ""
    if settings.refine_at_render:
        first = any(FIRST_FOREST in collection for collection in scene.collection.children)
        return "F12 renders, Refine shows it here" if first and has_contents(scene) else ""
    # The first object of a collection shows whether it was kept as meshes: a panel cannot look through all objects.
    first = (part.objects[0] if part.objects else None for part in scene.collection.children_recursive)
    kept = any(obj is not None and KIND in obj for obj in first)
    return "" if kept or not has_plants(scene) else "Not refined: renders show no plants"
