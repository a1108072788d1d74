# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in Blender's window: open the sidebar at TetFlora's tab and look at it, at the menus and at the preferences."""

import addon_utils
import bpy

MODULE = "bl_ext.user_default.tetflora"
MENUS = (*("VIEW3D_MT_add", "TETFLORA_MT_object", "TETFLORA_MT_species_files", "TETFLORA_MT_layers"),)


def steps(ui):
    """See devtools/window_driver.py."""
    ui.values["enabled"] = all(addon_utils.check(MODULE))
    yield from ui.show_sidebar("TetFlora")
    region = next(r for r in ui.area().regions if r.type == 'UI')
    ui.values["tab"] = region.active_panel_category
    ui.values["sidebar_width"] = region.width
    ui.values["version"] = bpy.app.version_string
    yield from ui.picture("sidebar")
    yield from _menus(ui)
    # A key reaches the window: N closes the sidebar.
    ui.press('N')
    yield from ui.until(lambda: not ui.area().spaces.active.show_region_ui, 20, "closed sidebar")
    ui.values["open_after_n"] = ui.area().spaces.active.show_region_ui
    yield from _preferences(ui)


def _menus(ui):
    """Open each menu; the log shows whether one of them could not be drawn."""
    for name in MENUS:
        with ui.override():
            bpy.ops.wm.call_menu(name=name)
        yield 0.5
        if name == "TETFLORA_MT_object":
            yield from ui.picture("menu")
        ui.press('ESC')
        yield 0.5


def _preferences(ui):
    """Open the page in the preferences, and count how often Blender draws it."""
    page = type(bpy.context.preferences.addons[MODULE].preferences)
    draw, drawn = page.draw, []

    def counting_draw(self, context):
        draw(self, context)
        drawn.append(self.species_folder)

    page.draw = counting_draw
    with ui.override():
        bpy.ops.preferences.addon_show(module=MODULE)
    yield from ui.until(lambda: drawn, 30, "page in the preferences")
    yield from ui.picture("preferences")
    page.draw = draw
    ui.values["preferences_drawn"] = len(drawn)
