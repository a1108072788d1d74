# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants painted and set one by one, by mouse and keys; tests/window/test_paint.py judges them."""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parent))
from forest_steps import press_key


def steps(ui):
    """See devtools/window_driver.py."""
    # Bare ground seen from above, so that what the brush does can be told from where the mouse is.
    yield from bare_ground(ui)
    settings = bpy.context.scene.tetflora.brush
    settings.source, settings.species = 'ONE', "bush"
    settings.radius, settings.density, settings.min_distance, settings.store = 5.0, 12.0, 0.0, 'EMPTIES'
    with ui.override():
        bpy.ops.ed.undo_push(message="Ground")
        bpy.ops.tetflora.paint_plants('INVOKE_DEFAULT', mode='PAINT')
    yield 0.3
    ui.values["painting"] = painting(ui)
    x, y = ui.center()
    yield from drag(ui, (x - 200, y), (x + 100, y))
    ui.values["painted"] = places()
    yield from ui.picture("painted")
    yield from drag(ui, (x - 40, y - 60), (x - 40, y + 60), shift=True)
    ui.values["erased"] = places()
    yield from ui.picture("erased")
    yield from press_key(ui, 'Z', ctrl=True)
    ui.values["undone"] = places()
    yield from press_key(ui, 'Z', ctrl=True, shift=True)
    ui.values["redone"] = places()
    yield from press_key(ui, 'Z', ctrl=True)

    # Wider, by key and by mouse; thin; and out again.
    ui.press('RIGHT_BRACKET')
    yield 0.3
    ui.values["wider"] = bpy.context.scene.tetflora.brush.radius
    ui.press('F')
    yield 0.2
    ui.move(x + 60, y)
    yield 0.2
    ui.press('LEFTMOUSE')
    yield 0.3
    ui.values["widest"] = bpy.context.scene.tetflora.brush.radius
    bpy.context.scene.tetflora.brush.density = 2.0
    ui.press('T')
    yield 0.2
    ui.values["mode"] = bpy.context.scene.tetflora.brush.mode
    yield from drag(ui, (x - 200, y), (x + 100, y))
    ui.values["thinned"] = places()
    yield from ui.picture("thinned")
    ui.press('ESC')
    yield 0.5
    ui.values["painting_after"] = painting(ui)
    ui.values["kept"] = places()
    yield from press_key(ui, 'Z', ctrl=True)
    ui.values["undone_outside"] = places()

    # One by one, turned and scaled.
    with ui.override():
        bpy.ops.tetflora.place_plant('INVOKE_DEFAULT', species="conifer")
    before = len(places())
    ui.move(x, y + 150)
    yield 0.3
    for key, ctrl in (('WHEELUPMOUSE', False), ('WHEELUPMOUSE', False), ('WHEELUPMOUSE', True)):
        ui.press(key, ctrl=ctrl)
        yield 0.2
    yield from ui.picture("placing")
    ui.press('LEFTMOUSE')
    yield 0.5
    ui.press('ESC')
    yield 0.5
    ui.values["placed"] = len(places()) - before
    new = bpy.context.view_layer.objects.active
    ui.values["new"] = [new.tetflora.species, float(np.degrees(new.rotation_euler.z)), new.scale.x, new.location.z]
    yield from press_key(ui, 'F', alt=True, shift=True)
    yield from ui.picture("pie")
    ui.press('ESC')
    yield 0.3


def bare_ground(ui):
    """A new scene of level ground, 60 m wide, seen from above."""
    scene = bpy.data.scenes.new("Painting")
    ui.window.scene = scene
    mesh = bpy.data.meshes.new("Meadow")
    mesh.from_pydata([(-30, -30, 0), (30, -30, 0), (30, 30, 0), (-30, 30, 0)], [], [(0, 1, 2, 3)])
    scene.collection.objects.link(bpy.data.objects.new("Meadow", mesh))
    yield 0.3
    with ui.override():
        bpy.ops.view3d.view_axis(type='TOP')
        bpy.ops.view3d.view_all()
    yield 1.0


def drag(ui, start, end, shift=False):
    """Drag with the left button, in steps as a hand does."""
    ui.move(*start)
    yield 0.2
    ui.window.event_simulate(type='LEFTMOUSE', value='PRESS', x=start[0], y=start[1], shift=shift)
    for share in np.linspace(0.0, 1.0, 13)[1:]:
        x, y = (round(a + share * (b - a)) for a, b in zip(start, end, strict=True))
        ui.window.event_simulate(type='MOUSEMOVE', value='NOTHING', x=x, y=y, shift=shift)
        yield 0.05
    ui.window.event_simulate(type='LEFTMOUSE', value='RELEASE', x=end[0], y=end[1], shift=shift)
    ui.move(*end)
    yield 0.8


def painting(ui):
    """Whether the brush is taken up."""
    return any(operator.bl_idname == "TETFLORA_OT_paint_plants" for operator in ui.window.modal_operators)


def plants():
    """Plants of the window's scene."""
    return [obj for obj in bpy.context.scene.objects if obj.tetflora.is_plant]


def places():
    """Where they stand, in order."""
    return sorted([round(c, 3) for c in obj.location] for obj in plants())
