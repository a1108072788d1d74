# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Chooses from each gallery of pictures by clicks; tests/window/test_gallery.py judges what the scene then has."""

import sys
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).resolve().parents[2]))

from devtools.aliases import INSTALLED, alias

alias(INSTALLED)
from panels.species import TETFLORA_PT_species  # noqa: E402  (found only now)

GALLERIES = {"species": (TETFLORA_PT_species, "species_choice", lambda group: (group.species_editor, "species"))}


def steps(ui):
    """See devtools/window_driver.py."""
    bpy.context.scene.tetflora.species_editor.shown = True
    for name, (panel, choice, place) in GALLERIES.items():
        # Alone and open at the top of a tab of its own, so that the picture lies below the panel's header.
        usual = panel.bl_category, getattr(panel, "bl_options", set()), panel.bl_region_type
        bpy.utils.unregister_class(panel)
        panel.bl_category, panel.bl_options, panel.bl_region_type = name, set(), 'UI'
        bpy.utils.register_class(panel)
        yield from ui.show_sidebar(name)
        group, stored = place(bpy.context.scene.tetflora)
        chosen = ui.values[name] = []
        for left in (150, 300):  # pixels; no item is wider than 150
            sidebar = next(region for region in ui.area().regions if region.type == 'UI')
            ui.move(sidebar.x + sidebar.width // 2, sidebar.y + sidebar.height - 80)
            yield 0.3
            ui.press('LEFTMOUSE')
            yield 1.0
            ui.move(sidebar.x + sidebar.width // 2 - left, sidebar.y + sidebar.height - 300)
            yield 0.5
            yield from ui.picture(f"{name}_{left}")
            ui.press('LEFTMOUSE')
            yield 0.5
            chosen.append([getattr(group, stored), getattr(group, choice)])
            ui.move(*ui.center())
            yield 0.5
        bpy.utils.unregister_class(panel)
        panel.bl_category, panel.bl_options, panel.bl_region_type = usual
        bpy.utils.register_class(panel)
