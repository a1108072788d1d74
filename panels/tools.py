# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools of the 3D view's toolbar: paint plants, and place them by clicking; their settings are in its header."""

import bpy

from .base import draw_numbers, draw_properties
from .layers import draw_distance


class _GroundTool:
    """Mix-in for tools in Object Mode that begin with a press of the mouse."""

    bl_space_type = 'VIEW_3D'
    bl_context_mode = 'OBJECT'
    bl_widget = None


class PaintTool(_GroundTool, bpy.types.WorkSpaceTool):
    """The brush."""

    bl_idname = "tetflora.paint_plants"
    bl_label = "Paint Plants"
    bl_description = "Paint, erase or thin plants on the visible meshes"
    bl_icon = "brush.particle.add"
    bl_keymap = (("tetflora.paint_plants", {"type": 'LEFTMOUSE', "value": 'PRESS'}, None),)

    @staticmethod
    def draw_settings(context: bpy.types.Context, layout: bpy.types.UILayout, _tool: bpy.types.WorkSpaceTool) -> None:
        """Draw the brush's settings: in the header's row, the rest in the Tool tab."""
        settings = context.scene.tetflora.brush
        layout.row().prop(settings, "mode", text="", expand=context.region.type != 'TOOL_HEADER')
        draw_properties(layout, settings, "radius", "density", "strength", "source")
        if settings.source == 'ONE':
            layout.prop(settings, "species_choice", text="")
        if context.region.type != 'TOOL_HEADER':
            draw_distance(layout, settings)
            draw_numbers(layout, settings, "scale_range")
            layout.prop(settings, "store")


class PlaceTool(_GroundTool, bpy.types.WorkSpaceTool):
    """Plants one by one."""

    bl_idname = "tetflora.place_plant"
    bl_label = "Place Plants by Clicking"
    bl_description = "Click on the ground to add plants one by one, each a different individual"
    bl_icon = "brush.particle.puff"
    bl_keymap = (("tetflora.place_plant", {"type": 'LEFTMOUSE', "value": 'PRESS'}, None),)

    @staticmethod
    def draw_settings(_context: bpy.types.Context, layout: bpy.types.UILayout, tool: bpy.types.WorkSpaceTool) -> None:
        """Draw the species."""
        layout.prop(tool.operator_properties("tetflora.place_plant"), "species")


def register() -> None:
    """Add the tools to the toolbar."""
    bpy.utils.register_tool(PaintTool, after={"builtin.measure"}, separator=True)
    bpy.utils.register_tool(PlaceTool, after={PaintTool.bl_idname})


def unregister() -> None:
    """Take them away."""
    for tool in (PlaceTool, PaintTool):
        bpy.utils.unregister_tool(tool)
