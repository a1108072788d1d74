# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a bare ground to a lit wood at eye height by clicks in the sidebar; tests/window/test_layers.py judges it."""

import sys
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).resolve().parent))
sys.path.append(str(Path(__file__).resolve().parents[2]))

from forest_steps import press_button, press_key, running

from devtools.aliases import INSTALLED, alias

alias(INSTALLED)
from tetflora_addon.blender.biomes import layers  # noqa: E402  (found only now)


def steps(ui):
    """See devtools/window_driver.py."""
    scene = bpy.context.scene
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20, size=60.0)
    scene.tetflora.populate.density = 150.0
    yield from ui.show_sidebar("TetFlora")

    # What + opens, and a click on Scatter in it.
    with ui.override():
        bpy.ops.wm.call_panel(name="TETFLORA_PT_add_layer", keep_open=False)
    yield 0.5
    yield from ui.picture("add")
    x, middle = ui.center()  # in the left of two columns
    yield from press_button(ui, "tetflora.populate", [(x - 60, y) for y in range(middle + 300, middle - 400, -8)])
    yield from ui.until(lambda: len(scene.tetflora.layers) and not running(ui), 60, "plants")
    layer = scene.tetflora.layers[0]
    ui.values["planted"] = [layer.made, layer.by_density]
    yield 1.0
    yield from ui.picture("scattered")
    ui.values["rows"] = [(yield from row_of(ui, "tetflora.update_layers"))]

    yield from press_button(ui, "tetflora.daylight")
    yield from press_button(ui, "tetflora.look")
    yield 1.5
    camera = scene.camera.matrix_world.translation
    ui.values["camera"] = list(camera)
    ui.values["view"] = ui.area().spaces.active.region_3d.view_perspective
    ui.values["suns"] = sum(o.type == 'LIGHT' and o.data.type == 'SUN' for o in scene.objects)
    yield from ui.picture("lit")
    ui.values["rows"].append((yield from row_of(ui, "tetflora.update_layers")))

    # A setting changes: the layer is due, and Update does it.
    scene.tetflora.layers[0].density = 80.0
    before = scene.tetflora.layers[0].made
    yield from press_button(ui, "tetflora.update_layers")
    yield from ui.until(lambda: scene.tetflora.layers[0].made < before and not running(ui), 60, "update")
    ui.values["rows"].append((yield from row_of(ui, "tetflora.update_layers")))
    yield from lift_the_ground(ui)
    scene = bpy.context.scene
    ui.values["rows"].append((yield from row_of(ui, "tetflora.update_layers")))
    scene.tetflora.layers[0].shown = False
    yield from ui.picture("hidden")
    ui.values["hidden"] = scene.tetflora.layers[0].collection.hide_viewport
    with ui.override():
        bpy.ops.wm.tool_set_by_id(name="tetflora.paint_plants")
    yield 0.5
    yield from ui.picture("tool")
    tool = bpy.context.workspace.tools.from_space_view3d_mode('OBJECT')
    ui.values["tool"] = tool.idname


def lift_the_ground(ui):
    """G Z 5, undo, redo, and Update: whether the layer is due, and where its plants are in the end."""

    def due(wanted):
        yield from ui.until(lambda: layers.is_due(bpy.context.scene.tetflora.layers[0]) == wanted, 30, f"due: {wanted}")
        ui.values["due"].append(wanted)

    ui.values["due"] = []
    bpy.ops.object.select_all(action='DESELECT')
    bpy.data.objects["Grid"].select_set(True)
    yield from due(False)
    yield from press_key(ui, 'G')
    ui.press('Z')
    yield 0.5
    ui.type_text("5")
    yield 0.5
    ui.press('RET')
    yield from due(True)
    yield from ui.picture("lifted")
    yield from press_key(ui, 'Z', ctrl=True)
    yield from due(False)
    yield from press_key(ui, 'Z', ctrl=True, shift=True)
    yield from due(True)
    yield from press_button(ui, "tetflora.update_layers")
    yield from due(False)
    yield from ui.until(lambda: not running(ui), 60, "update")
    bpy.context.view_layer.update()  # new objects are at the origin until then
    plants = [obj for obj in bpy.context.scene.objects if obj.tetflora.is_plant]
    ui.values["lifted"] = [obj.matrix_world.translation.z for obj in plants]


def row_of(ui, operator):
    """How far below the top of the sidebar an operator's button is, pixels."""
    _, y = yield from ui.find(f"bpy.ops.{operator}(")
    region = next(r for r in ui.area().regions if r.type == 'UI')
    return region.y + region.height - y
