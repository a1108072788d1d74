# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Output: where results live, what sees them, and how they are told apart in compositing."""

import bpy

from ..operators.keep_results import TETFLORA_OT_keep_results
from ..tetflora_addon.blender.plant_objects import plant_collections
from .base import SidebarPanel, split_layout
from .lists import TETFLORA_UL_output_species, draw_list


class TETFLORA_PT_output(SidebarPanel, bpy.types.Panel):
    """Output."""

    bl_label = "Output"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        output = context.scene.tetflora.output
        layout.prop(output, "save_results")
        column = layout.column(heading="Results")  # one below the other: two in a row are cut off
        column.prop(output, "show_viewport", text="Viewports")
        column.prop(output, "show_render", text="Renders")
        for collection in plant_collections(context.scene):
            column = layout.column(heading=collection.name)
            column.prop(collection, "hide_viewport", text="Viewports", toggle=False, invert_checkbox=True)
            column.prop(collection, "hide_render", text="Renders", toggle=False, invert_checkbox=True)
        layout.operator(TETFLORA_OT_keep_results.bl_idname, icon='MESH_DATA')


class TETFLORA_PT_ray_visibility(SidebarPanel, bpy.types.Panel):
    """Ray visibility."""

    bl_label = "Ray Visibility"
    bl_parent_id = "TETFLORA_PT_output"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        column = split_layout(self).column()
        for name in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
            column.prop(context.scene.tetflora.output, name)


class TETFLORA_PT_passes(SidebarPanel, bpy.types.Panel):
    """Pass index, light groups and materials, of all and by species."""

    bl_label = "Passes and Materials"
    bl_parent_id = "TETFLORA_PT_output"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        output, layer = context.scene.tetflora.output, context.view_layer
        layout.prop(output, "pass_index")
        layout.prop_search(output, "light_group", layer, "lightgroups")
        draw_list(layout, TETFLORA_UL_output_species, output, ("species", "species_index"), 'OUTPUT')
        if 0 <= output.species_index < len(output.species):
            entry = output.species[output.species_index]
            layout.prop(entry, "pass_index")
            layout.prop_search(entry, "light_group", layer, "lightgroups")
            for name in ("leaf", "blossom", "bark"):
                layout.prop(entry, name, text=name.capitalize())  # the field itself says Material


CLASSES = (TETFLORA_PT_output, TETFLORA_PT_ray_visibility, TETFLORA_PT_passes)
