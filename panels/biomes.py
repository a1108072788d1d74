# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Biomes: the library with its pictures, the biomes of the scene, and where each of them lies."""

import bpy

from ..operators.biomes import (
    TETFLORA_OT_add_biome,
    TETFLORA_OT_delete_biome,
    TETFLORA_OT_import_biome,
    TETFLORA_OT_remove_biome,
    TETFLORA_OT_save_biome,
    TETFLORA_OT_update_biome,
)
from ..tetflora_addon.blender.biomes.biome import active_biome, layers_of
from ..tetflora_addon.blender.biomes.library import FALLBACK_ICON, biomes, icon_of
from ..tetflora_addon.blender.placing.rules import awaits_update
from .base import Button, SidebarPanel, draw_buttons, draw_limits, draw_mask, draw_properties, split_layout


class TETFLORA_MT_add_biome(bpy.types.Menu):
    """Biomes to add to the selected ground, or with land of their own."""

    bl_label = "TetFlora Biome"

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator_context = 'INVOKE_DEFAULT'
        for info in biomes().values():
            number = icon_of(info)
            icon = {"icon_value": number} if number else {"icon": FALLBACK_ICON}
            layout.operator(TETFLORA_OT_add_biome.bl_idname, text=info.name, **icon).biome = info.identifier


class TETFLORA_MT_biomes(bpy.types.Menu):
    """Less common operators for biomes."""

    bl_label = "Biomes"

    def draw(self, _context: bpy.types.Context) -> None:
        draw_buttons(
            self.layout,
            Button(TETFLORA_OT_save_biome, 'FILE_TICK', "Save as Biome..."),
            Button(TETFLORA_OT_import_biome, 'IMPORT', "Import Biome..."),
            Button(TETFLORA_OT_delete_biome, 'TRASH'),
        )


class TETFLORA_UL_biomes(bpy.types.UIList):
    """A biome's name, how many plants it has, and whether an update would change them."""

    def draw_item(self, context, layout, _data, item, _icon, _active_data, _active_property, _index, _flag) -> None:
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon=FALLBACK_ICON)
        layers = layers_of(context.scene, item.uid)
        right = row.row()
        right.alignment = 'RIGHT'
        icon = 'FILE_REFRESH' if any(awaits_update(layer) for layer in layers) else 'NONE'
        right.label(text=f"{sum(layer.made for layer in layers):,}", icon=icon)


class TETFLORA_PT_biomes(SidebarPanel, bpy.types.Panel):
    """Biomes."""

    bl_label = "Biomes"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout, group = self.layout, context.scene.tetflora
        layout.template_icon_view(group, "new_biome", show_labels=True, scale=6.0, scale_popup=7.0)
        row = layout.row(align=True)
        row.prop(group, "new_biome", text="")
        row.menu(TETFLORA_MT_biomes.__name__, text="", icon='DOWNARROW_HLT')
        Button(TETFLORA_OT_add_biome, 'ADD', values={"biome": group.new_biome}).draw(layout)
        if not group.biomes:
            return
        row = layout.row()
        name = TETFLORA_UL_biomes.__name__
        row.template_list(name, "", group, "biomes", group, "biomes_index", rows=2)
        Button(TETFLORA_OT_remove_biome, 'REMOVE', "").draw(row.column(align=True))
        Button(TETFLORA_OT_update_biome, 'FILE_REFRESH').draw(layout)


class TETFLORA_PT_biome_limits(SidebarPanel, bpy.types.Panel):
    """Which part of the ground the active biome takes."""

    bl_label = "Where"
    bl_parent_id = "TETFLORA_PT_biomes"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_biome(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, biome = split_layout(self), active_biome(context.scene)
        if biome is None:
            layout.label(text="Add a biome first", icon='INFO')
            return
        layout.prop(biome, "gives_way")
        draw_mask(layout, biome)
        draw_limits(layout, biome, "slope", "softness")
        layout.prop(biome, "use_altitude")
        if biome.use_altitude:
            draw_limits(layout, biome, "altitude", "softness")
        draw_limits(layout, biome, "wetness", "softness")
        draw_properties(layout, biome, "paths")
        if biome.paths is not None:
            draw_limits(layout, biome, "path", "softness")


CLASSES = (
    TETFLORA_MT_add_biome,
    TETFLORA_MT_biomes,
    TETFLORA_UL_biomes,
    TETFLORA_PT_biomes,
    TETFLORA_PT_biome_limits,
)
