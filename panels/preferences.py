# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The page in Preferences > Add-ons > TetFlora, and the keys: few, and free in Blender's own keymaps."""

import os
from dataclasses import dataclass

import bpy

from ..tetflora_addon import storage
from ..tetflora_addon.blender.preferences import CACHE_VARIABLE, TetFloraPreferences, species_folders
from ..tetflora_addon.blender.species.edits import skipped_files
from .base import Button, draw_properties
from .help import draw_help

KEYMAP = "Object Mode"
PIE = "TETFLORA_MT_pie"
_MOST_TOLD = 3  # files of the species folder that are not used


@dataclass(frozen=True)
class Shortcut:
    """A key, and the operator that it calls; ``menu`` is what that opens, if it opens menus."""

    operator: str
    key: str
    ctrl: bool = False
    alt: bool = False
    shift: bool = False
    menu: str = ""


KEYS = (
    Shortcut("wm.call_menu_pie", 'F', alt=True, shift=True, menu=PIE),
    Shortcut("tetflora.refine", 'F', ctrl=True, alt=True, shift=True),
)

_keymap_items: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def items() -> list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]]:
    """Our keys as the user has them, each with its keymap; empty where Blender has no keymaps."""
    user = bpy.context.window_manager.keyconfigs.user
    keymap = user.keymaps.get(KEYMAP) if user is not None else None
    if keymap is None:
        return []
    wanted = {(key.operator, key.menu) for key in KEYS}
    return [
        (keymap, item) for item in keymap.keymap_items if (item.idname, getattr(item.properties, "name", "")) in wanted
    ]


def _draw(self: TetFloraPreferences, context: bpy.types.Context) -> None:
    layout = self.layout
    layout.use_property_split = True
    layout.prop(self, "species_folder")
    if self.species_folder and not species_folders():
        layout.label(text="This folder does not exist", icon='ERROR')
    for text in skipped_files()[:_MOST_TOLD]:
        layout.label(text=text, icon='ERROR')
    draw_properties(layout, self, "threads", "new_quality", "max_memory", "kept_memory")
    _draw_cache(layout.column(), self)
    row = layout.row(align=True)
    row.operator("tetflora.write_report", icon='TEXT')
    draw_help(row, "manual/troubleshooting.md")
    _draw_keys(layout.column(), context)


def _draw_cache(column: bpy.types.UILayout, prefs: TetFloraPreferences) -> None:
    if CACHE_VARIABLE in os.environ:
        column.label(text=f"{CACHE_VARIABLE} is set: {os.environ[CACHE_VARIABLE]}", icon='INFO')
    column.prop(prefs, "use_cache")
    row = column.row()
    row.active = prefs.use_cache
    row.prop(prefs, "cache_folder")
    Button("delete_file", 'NONE', "Clear Cache", {"cache": True}).draw(column)
    if storage.last_problem():
        column.label(text=storage.last_problem(), icon='ERROR')


def _draw_keys(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Our keys as in Preferences > Keymap, to be changed here."""
    import rna_keymap_ui  # Blender's own; only there while its interface is

    column.label(text=f"Keys in {KEYMAP}")
    config = context.window_manager.keyconfigs.user
    for keymap, item in items():
        column.context_pointer_set("keymap", keymap)
        rna_keymap_ui.draw_kmi([], config, keymap, item, column, 0)


def register() -> None:
    """Draw the page, whose class only stores the settings, and add the keys."""
    TetFloraPreferences.draw = _draw
    config = bpy.context.window_manager.keyconfigs.addon
    if config is None:  # as in some background Blenders
        return
    keymap = config.keymaps.new(name=KEYMAP, space_type='EMPTY')
    for key in KEYS:
        item = keymap.keymap_items.new(
            key.operator, key.key, 'PRESS', ctrl=int(key.ctrl), alt=int(key.alt), shift=int(key.shift)
        )
        if key.menu:
            item.properties.name = key.menu
        _keymap_items.append((keymap, item))


def unregister() -> None:
    """Remove the keys, and draw the page no longer."""
    for keymap, item in reversed(_keymap_items):
        keymap.keymap_items.remove(item)
    _keymap_items.clear()
    del TetFloraPreferences.draw
