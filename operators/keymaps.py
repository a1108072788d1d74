# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys: few, free in Blender's own keymaps, changed in Preferences > Keymap or > Add-ons > TetFlora."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .refine import TETFLORA_OT_refine

KEYMAP = "Object Mode"
PIE = "TETFLORA_MT_pie"


@dataclass(frozen=True)
class Shortcut:
    """A key of ours.

    Attributes
    ----------
    operator : str
    key : str
    ctrl, alt, shift : bool
    menu : str
        What the operator opens, if it is one that opens menus.
    """

    operator: str
    key: str
    ctrl: bool = False
    alt: bool = False
    shift: bool = False
    menu: str = ""


KEYS = (
    Shortcut("wm.call_menu_pie", 'F', alt=True, shift=True, menu=PIE),
    Shortcut(TETFLORA_OT_refine.bl_idname, 'F', ctrl=True, alt=True, shift=True),
)

_made: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def items() -> list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]]:
    """Our keys as the user has them now, each with its keymap; empty where Blender has no keymaps."""
    user = bpy.context.window_manager.keyconfigs.user
    keymap = user.keymaps.get(KEYMAP) if user is not None else None
    if keymap is None:
        return []
    wanted = {(key.operator, key.menu) for key in KEYS}
    return [
        (keymap, item) for item in keymap.keymap_items if (item.idname, getattr(item.properties, "name", "")) in wanted
    ]


def add_keys() -> None:
    """Add the keys, where there is a configuration for add-ons (not in every background Blender)."""
    config = bpy.context.window_manager.keyconfigs.addon
    if config is None:
        return
    keymap = config.keymaps.new(name=KEYMAP, space_type='EMPTY')
    for key in KEYS:
        item = keymap.keymap_items.new(
            key.operator, key.key, 'PRESS', ctrl=int(key.ctrl), alt=int(key.alt), shift=int(key.shift)
        )
        if key.menu:
            item.properties.name = key.menu
        _made.append((keymap, item))


def remove_keys() -> None:
    """Take the keys back."""
    for keymap, item in reversed(_made):
        keymap.keymap_items.remove(item)
    _made.clear()
