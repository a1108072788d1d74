# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add > TetFlora Plant: one entry for each species of the catalogue."""

import bpy

from ..operators import ids
from ..tetflora_addon.blender.species_items import catalogue
from .base import picture


class TETFLORA_MT_add_plant(bpy.types.Menu):
    """Species to add a plant of."""

    bl_label = "TetFlora Plant"

    def draw(self, _context: bpy.types.Context) -> None:
        known = catalogue()
        for info in known.values():
            icon = picture(info.identifier)
            self.layout.operator(ids.ADD_PLANT, text=info.name, **icon).species = info.identifier
        if not known:
            self.layout.label(text="The catalogue has no species", icon='ERROR')


def draw_in_add_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """The entry in Blender's Add menu."""
    menu.layout.separator()
    menu.layout.menu(TETFLORA_MT_add_plant.__name__, icon='OUTLINER_OB_FORCE_FIELD')
