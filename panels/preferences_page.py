# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The page in Preferences > Add-ons > TetFlora."""

import os

import bpy

from ..operators import keymaps
from ..operators.clear_cache import TETFLORA_OT_clear_cache
from ..tetflora_addon import cache_folder
from ..tetflora_addon.blender.preferences import CACHE_VARIABLE, TetFloraPreferences, species_folders


def _draw(self: TetFloraPreferences, context: bpy.types.Context) -> None:
    layout = self.layout
    layout.use_property_split = True
    layout.prop(self, "species_folder")
    if self.species_folder and not species_folders():
        layout.label(text="This folder does not exist", icon='ERROR')
    layout.prop(self, "new_quality")
    layout.prop(self, "new_memory")
    _draw_cache(layout.column(), self)
    _draw_keys(layout.column(), context)


def _draw_cache(column: bpy.types.UILayout, own: TetFloraPreferences) -> None:
    if CACHE_VARIABLE in os.environ:
        column.label(text=f"{CACHE_VARIABLE} is set: {os.environ[CACHE_VARIABLE]}", icon='INFO')
    column.prop(own, "use_cache")
    row = column.row()
    row.active = own.use_cache
    row.prop(own, "cache_folder")
    column.operator(TETFLORA_OT_clear_cache.bl_idname)
    if cache_folder.trouble():
        column.label(text=cache_folder.trouble(), icon='ERROR')


def _draw_keys(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Our keys as in Preferences > Keymap, to be changed here."""
    import rna_keymap_ui  # Blender's own; only there while its interface is

    column.label(text=f"Keys in {keymaps.KEYMAP}")
    config = context.window_manager.keyconfigs.user
    for keymap, item in keymaps.items():
        column.context_pointer_set("keymap", keymap)
        rna_keymap_ui.draw_kmi([], config, keymap, item, column, 0)


def register() -> None:
    """Draw the page, whose class below the operators only stores the settings, and add the keys."""
    TetFloraPreferences.draw = _draw
    keymaps.add_keys()


def unregister() -> None:
    """Remove the keys, and draw the page no longer."""
    keymaps.remove_keys()
    del TetFloraPreferences.draw
