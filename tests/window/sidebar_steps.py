# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in Blender's window: open the sidebar at TetFlora's tab and look at it."""

import addon_utils
import bpy


def steps(ui):
    """See devtools/window_driver.py."""
    ui.values["enabled"] = all(addon_utils.check("bl_ext.user_default.tetflora"))
    yield from ui.show_sidebar("TetFlora")
    region = next(r for r in ui.area().regions if r.type == 'UI')
    ui.values["tab"] = region.active_panel_category
    ui.values["sidebar_width"] = region.width
    ui.values["version"] = bpy.app.version_string
    yield from ui.picture("sidebar")
    # A key reaches the window: N closes the sidebar.
    ui.press('N')
    yield from ui.until(lambda: not ui.area().spaces.active.show_region_ui, 20, "closed sidebar")
    ui.values["open_after_n"] = ui.area().spaces.active.show_region_ui
