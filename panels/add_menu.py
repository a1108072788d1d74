# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add > TetFlora Plant, > Place Plants by Clicking, with an entry for each species, and > First Forest."""

import bpy

from ..operators.add_plant import TETFLORA_OT_add_plant
from ..operators.assign_species import TETFLORA_OT_assign_species
from ..operators.first_forest import TETFLORA_OT_first_forest
from ..operators.place_plant import TETFLORA_OT_place_plant
from ..tetflora_addon.blender.species_edits import catalogue
from .base import picture


class TETFLORA_MT_species(bpy.types.Menu):
    """Species to give to the selected plants."""

    bl_label = "Change Species"

    def draw(self, _context: bpy.types.Context) -> None:
        for info in catalogue().values():
            icon = picture(info.identifier)
            self.layout.operator(TETFLORA_OT_assign_species.bl_idname, text=info.name, **icon).species = info.identifier


class TETFLORA_MT_add_plant(bpy.types.Menu):
    """Species to add a plant of."""

    bl_label = "TetFlora Plant"

    def draw(self, _context: bpy.types.Context) -> None:
        known = catalogue()
        for info in known.values():
            icon = picture(info.identifier)
            self.layout.operator(TETFLORA_OT_add_plant.bl_idname, text=info.name, **icon).species = info.identifier
        if not known:
            self.layout.label(text="The catalog has no species", icon='ERROR')


class TETFLORA_MT_place_plant(bpy.types.Menu):
    """Species to set by clicking on the ground."""

    bl_label = "Place Plants by Clicking"

    def draw(self, _context: bpy.types.Context) -> None:
        # Buttons of a menu are executed by default, and this tool needs the mouse.
        self.layout.operator_context = 'INVOKE_DEFAULT'
        for info in catalogue().values():
            icon = picture(info.identifier)
            self.layout.operator(TETFLORA_OT_place_plant.bl_idname, text=info.name, **icon).species = info.identifier


def draw_in_add_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """The entry in Blender's Add menu."""
    menu.layout.separator()
    menu.layout.operator(TETFLORA_OT_first_forest.bl_idname, icon='WORLD')
    menu.layout.menu(TETFLORA_MT_place_plant.__name__, icon='RESTRICT_SELECT_OFF')
    menu.layout.menu(TETFLORA_MT_add_plant.__name__, icon='OUTLINER_OB_FORCE_FIELD')


CLASSES = (TETFLORA_MT_species, TETFLORA_MT_add_plant, TETFLORA_MT_place_plant)
