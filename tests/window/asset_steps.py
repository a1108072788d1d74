# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A plant dragged by the mouse from the asset browser into the scene; tests/window/test_assets.py judges it."""

import bpy

STEPS = 12  # positions of the mouse on its way
ATTEMPTS = 5  # Blender reads the library in the background, and does not say when it is done


def steps(ui):
    """See devtools/window_driver.py."""
    bpy.ops.tetflora.create_asset_library(directory=str(ui.out_dir / "assets"), add_library=True)
    ui.values["libraries"] = [library.name for library in bpy.context.preferences.filepaths.asset_libraries]
    with ui.override():
        bpy.ops.screen.area_split(direction='HORIZONTAL', factor=0.4)
    yield 1.0
    browser = min((a for a in ui.window.screen.areas if a.type == 'VIEW_3D'), key=lambda a: a.y)
    browser.ui_type = 'ASSETS'
    yield 1.0
    params = browser.spaces.active.params
    params.asset_library_reference = "TetFlora"
    params.display_size = 96
    yield 4.0
    yield from ui.picture("browser")
    region = next(r for r in browser.regions if r.type == 'WINDOW')
    ui.values["browser"] = [region.x, region.y, region.width, region.height]
    ui.values["before"] = sorted(o.name for o in bpy.data.objects)
    for _ in range(ATTEMPTS):
        yield from dragged(ui, region.x + 60, region.y + region.height - 60)
        for _ in range(12):
            yield 0.5
            if dropped := len(bpy.data.objects) > len(ui.values["before"]):
                break
        if dropped:
            break
    yield 1.0
    yield from ui.picture("dropped")
    scene = bpy.context.scene
    new = [o for o in scene.objects if o.name not in ui.values["before"]]
    ui.values["plants"] = [(o.name, o.tetflora.is_plant, o.tetflora.species, o.library is None) for o in new]
    ui.values["marks"] = [key for o in new for key in list(o.keys()) if key != "tetflora"]
    ui.values["locked"] = scene.render.use_lock_interface


def dragged(ui, x, y):
    """Drag what is there to the middle of the viewport."""
    to_x, to_y = ui.center()
    ui.move(x, y)
    yield 0.5
    ui.window.event_simulate(type='LEFTMOUSE', value='PRESS', x=x, y=y)
    yield 0.3
    for step in range(1, STEPS + 1):
        ui.move(x + (to_x - x) * step // STEPS, y + (to_y - y) * step // STEPS)
        yield 0.2
    yield from ui.picture("dragging")
    ui.window.event_simulate(type='LEFTMOUSE', value='RELEASE', x=to_x, y=to_y)
