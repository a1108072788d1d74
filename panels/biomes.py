# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Biomes: the library with its pictures, the biomes of the scene, and where each of them lies."""

import bpy

from ..tetflora_addon.blender.biomes.files import active_biome, layers_of
from ..tetflora_addon.blender.biomes.library import FALLBACK_ICON, biomes, icon_of
from ..tetflora_addon.blender.placing.rules import awaits_update
from .base import Button, LayerList, SidebarPanel, draw_buttons, draw_list, draw_where, section, split_layout


class TETFLORA_MT_add_biome(bpy.types.Menu):
    """Biomes to add to the selected ground, or with land of their own."""

    bl_label = "TetFlora Biome"

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator_context = 'INVOKE_DEFAULT'
        for info in biomes().values():
            number = icon_of(info)
            icon = {"icon_value": number} if number else {"icon": FALLBACK_ICON}
            layout.operator("tetflora.add_biome", text=info.name, **icon).biome = info.identifier


class TETFLORA_MT_biomes(bpy.types.Menu):
    """Less common operators for biomes."""

    bl_label = "Biomes"

    def draw(self, _context: bpy.types.Context) -> None:
        draw_buttons(
            self.layout,
            Button("save_biome", 'FILE_TICK', "Save as Biome..."),
            Button("import_biome", 'IMPORT', "Import Biome..."),
            Button("delete_biome", 'TRASH'),
        )


class TETFLORA_UL_biomes(LayerList, bpy.types.UIList):
    """A biome's name, how many plants it has, and whether an update would change them."""

    icon = FALLBACK_ICON

    @staticmethod
    def state(item: bpy.types.PropertyGroup) -> tuple[int, str]:
        layers = layers_of(item.id_data, item.uid)
        outdated = any(awaits_update(layer) for layer in layers)
        return sum(layer.made for layer in layers), 'FILE_REFRESH' if outdated else 'NONE'


class TETFLORA_PT_biomes(SidebarPanel, bpy.types.Panel):
    """Biomes: the library, those of the scene, and which part of the ground the active one takes."""

    bl_label = "Biomes"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout, group = self.layout, context.scene.tetflora
        layout.template_icon_view(group, "new_biome", show_labels=True, scale=6.0, scale_popup=7.0)
        row = layout.row(align=True)
        row.prop(group, "new_biome", text="")
        row.menu(TETFLORA_MT_biomes.__name__, text="", icon='DOWNARROW_HLT')
        Button("add_biome", 'ADD', values={"biome": group.new_biome}).draw(layout)
        if not group.biomes:
            return
        draw_list(layout, TETFLORA_UL_biomes, group, "biomes", Button("remove_biome", 'REMOVE', ""))
        Button("update_biome", 'FILE_REFRESH').draw(layout)
        biome = active_biome(context.scene)
        if biome is not None and (body := section(split_layout(self), "Where")):
            body.prop(biome, "gives_way")
            draw_where(body, biome)
