# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs in Blender's window for benchmarks/viewport.py: seconds of redraws while the view turns, and of panels' draw."""

import json
import statistics
import sys
import time
from pathlib import Path

import bpy
import numpy as np
from mathutils import Quaternion

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from devtools import session  # noqa: E402  (found only now)

SPACING = 6.0
SPECIES = ("birch", "conifer", "bush", "oak")


def steps(ui):
    """See devtools/window_driver.py."""
    session.start()
    from tetflora_addon.blender.viewport import state

    wanted = json.loads((ui.out_dir / "wanted.json").read_text(encoding="utf-8"))
    scene = bpy.context.scene
    for name in ("Cube", "Light"):
        bpy.data.objects.remove(bpy.data.objects[name])
    with ui.override():
        # Nothing but the viewport: the outliner's list of all objects shall not be measured.
        bpy.ops.screen.screen_full_area(use_hide_panels=True)
    yield 1.0
    space = ui.area().spaces.active
    space.clip_end = 5000.0
    # What every redraw costs whatever is in the scene, most of all under software OpenGL, would hide the difference.
    bpy.context.preferences.system.viewport_aa = 'OFF'
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    yield from measure(ui, "nothing", wanted["redraws"])
    space.region_3d.view_perspective = 'PERSP'
    space.region_3d.view_distance = 0.6 * SPACING * np.sqrt(wanted["plants"])
    objects = plain_empties(scene, wanted["plants"])
    yield 2.0
    yield from measure(ui, "empties", wanted["redraws"])
    # The very same objects, as plants.
    for i, obj in enumerate(objects):
        obj.tetflora.is_plant, obj.tetflora.species, obj.tetflora.seed = True, SPECIES[i % len(SPECIES)], i
    begin = time.perf_counter()
    scene.tetflora.preview.plants = 'LIGHT'
    yield from ui.until(lambda: state.of(scene).shapes is not None, 120, "plants")
    ui.values["plants_s"] = time.perf_counter() - begin
    ui.values["plants"] = state.find(scene).shapes.plants
    ui.values["reading_s"] = state.find(scene).seconds
    yield 1.0
    yield from measure(ui, "both", wanted["redraws"])
    space.show_object_viewport_empty = False
    yield 1.0
    yield from measure(ui, "plants_alone", wanted["redraws"])
    yield from ui.picture("light")
    scene.tetflora.preview.plants = 'BOUNDS'
    yield from ui.until(lambda: state.of(scene).shapes.indices.shape[1] == 2, 120, "bounds")
    yield 1.0
    yield from measure(ui, "bounds", wanted["redraws"])
    yield from levels(ui, scene, state, wanted["redraws"])
    with ui.override():
        bpy.ops.screen.back_to_previous()
    yield 1.0
    yield from panels(ui, wanted["draws"])


def plain_empties(scene, number):
    """A square of empties around the origin."""
    side = int(np.ceil(np.sqrt(number)))
    made = []
    for i in range(number):
        obj = bpy.data.objects.new(f"empty {i}", None)
        obj.location = (SPACING * (i % side - side / 2), SPACING * (i // side - side / 2), 0.0)
        scene.collection.objects.link(obj)
        made.append(obj)
    return made


def measure(ui, name, redraws):
    """Median seconds of redrawing the window while the view turns, a degree each time."""
    region = ui.area().spaces.active.region_3d
    region.view_rotation = Quaternion((1.0, 0.0, 0.0), 1.2)
    turn = Quaternion((0.0, 0.0, 1.0), np.radians(1.0))
    seconds = []
    for _ in range(redraws + 2):
        region.view_rotation = turn @ region.view_rotation
        begin = time.perf_counter()
        with ui.override():
            bpy.ops.wm.redraw_timer(type='DRAW_WIN_SWAP', iterations=1)
        seconds.append(time.perf_counter() - begin)
    ui.values[f"{name}_s"] = statistics.median(seconds[2:])  # the first hand things to the graphics card
    yield


def levels(ui, scene, state, redraws):
    """The same for tetrahedra of a view of these plants; translucent ones are made anew at each redraw."""
    scene.tetflora.preview.plants = 'NONE'
    scene.tetflora.quality = 'DRAFT'
    camera = scene.camera
    camera.data.clip_end = 3000.0
    camera.location = (0.0, -0.5 * SPACING * np.sqrt(len(scene.objects)) - 30.0, 15.0)
    camera.rotation_euler = (1.45, 0.0, 0.0)
    bpy.context.view_layer.update()
    begin = time.perf_counter()
    with ui.override():
        bpy.ops.tetflora.preview_levels()
    ui.values["levels_s"] = time.perf_counter() - begin
    found = state.find(scene).levels
    ui.values["levels"], ui.values["tetrahedra"] = len(found), len(found.levels[-1])
    ui.values["levels_mb"] = found.nbytes / 1e6
    settings = scene.tetflora.preview
    settings.projected = False
    yield 1.0
    yield from measure(ui, "wires", redraws)
    settings.wires, settings.projected = False, True
    yield 1.0
    yield from measure(ui, "translucent", redraws)
    yield from ui.picture("translucent")


def panels(ui, draws):
    """Milliseconds of each panel's draw in a real redraw; panels that are closed are opened by copies of them."""
    shown = [getattr(bpy.types, name) for name in dir(bpy.types) if name.startswith("TETFLORA_PT_")]
    shown = [
        cls for cls in shown if 'INSTANCED' not in getattr(cls, "bl_options", ())
    ]  # popovers draw when they are opened
    bpy.context.scene.tetflora.species_editor.shown = True
    spent = {}
    for cls in shown:
        bpy.utils.unregister_class(cls)
    for cls in shown:
        members = {"bl_options": set(), "bl_idname": f"{cls.__name__}_open", "draw": timed(cls, spent)}
        members |= {"bl_space_type": 'VIEW_3D', "bl_region_type": 'UI', "bl_category": "TetFlora", "bl_context": ""}
        bpy.utils.register_class(type(f"{cls.__name__}_open", (cls,), members))
    plant = next(obj for obj in bpy.context.scene.objects if obj.tetflora.is_plant)
    plant.select_set(True)
    bpy.context.view_layer.objects.active = plant
    yield from ui.show_sidebar("TetFlora")
    for _ in range(draws):
        ui.area().tag_redraw()
        yield 0.2
    ui.values["panels_ms"] = {name: 1e3 * statistics.median(times[1:] or times) for name, times in spent.items()}
    ui.values["panels_drawn"] = min(len(times) for times in spent.values())


def timed(cls, spent):
    """A panel's draw that notes how long it takes."""
    drawn = cls.draw

    def draw(self, context):
        begin = time.perf_counter()
        drawn(self, context)
        spent.setdefault(cls.__name__, []).append(time.perf_counter() - begin)

    return draw
