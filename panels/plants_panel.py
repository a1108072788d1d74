# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tab's first panels: species and seed of the active plant, and what can be done to selected ones."""

import bpy

from ..operators import ids
from ..tetflora_addon.blender.plant_form import FORM_TYPES
from ..tetflora_addon.blender.species_items import catalogue
from .base import SidebarPanel, picture, split_layout


class TETFLORA_MT_species(bpy.types.Menu):
    """Species to give to the selected plants."""

    bl_label = "Change Species"

    def draw(self, _context: bpy.types.Context) -> None:
        for info in catalogue().values():
            icon = picture(info.identifier)
            self.layout.operator(ids.ASSIGN_SPECIES, text=info.name, **icon).species = info.identifier


class TETFLORA_PT_plants(SidebarPanel, bpy.types.Panel):
    """Plants."""

    bl_label = "Plants"
    bl_order = 0

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        active = context.active_object
        column = layout.column()
        if active is not None and active.tetflora.is_plant:
            plant = active.tetflora
            column.prop(plant, "species_choice")
            if plant.species not in catalogue():
                column.label(text=f'The catalogue has no "{plant.species}"', icon='ERROR')
            column.prop(plant, "seed")
            column.prop(plant, "enabled")
            column.prop(plant, "form")
        else:
            column.label(text="The active object is not a plant", icon='INFO')
        layout.menu("TETFLORA_MT_add_plant", text="Add Plant", icon='ADD')
        if context.active_object is not None and context.active_object.type in FORM_TYPES:
            layout.operator(ids.USE_AS_FORM, icon='CURVE_DATA')


class TETFLORA_PT_selected_plants(SidebarPanel, bpy.types.Panel):
    """What can be done to many plants at once; closed at first, so that the panels below stay in sight."""

    bl_label = "Selected Plants"
    bl_parent_id = "TETFLORA_PT_plants"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, _context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        column.menu(TETFLORA_MT_species.__name__, text="Change Species", icon='OUTLINER_OB_EMPTY')
        column.operator(ids.RESEED, icon='FILE_REFRESH')
        column.operator(ids.SELECT_SPECIES, text="Select All of This Species", icon='RESTRICT_SELECT_OFF')
        column.operator(ids.MAKE_PLANT_MESH, text="Make Real Meshes", icon='OUTLINER_OB_MESH')
        column = self.layout.column(align=True)
        column.operator(ids.REMOVE_PLANTS, text="Remove Selected", icon='X').which = 'SELECTED'
        column.operator(ids.REMOVE_PLANTS, text="Remove All Plants", icon='TRASH').which = 'ALL'
