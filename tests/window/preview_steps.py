# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist looks at levels and plants in the viewport; tests/window/test_preview.py judges it by its pictures."""

import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

sys.path.append(str(Path(__file__).resolve().parents[2]))

from devtools.aliases import INSTALLED, alias

alias(INSTALLED)
from tests.window.forest_steps import press_button  # noqa: E402  (found only now)
from tests.window.slow import slowly  # noqa: E402
from tetflora_addon.blender.viewport import levels as levels_job  # noqa: E402
from tetflora_addon.blender.viewport import state  # noqa: E402

SPECIES = ("broadleaf_tree", "conifer", "bush")


def through_the_year(ui, scene):
    """The day and the years change, by hand and by keyframes: plants are read again by themselves."""
    year = scene.tetflora.year

    def size():
        return float(np.ptp(shapes(scene).positions[:, 2]))

    def changes():
        return state.find(scene).changes

    tall, before = size(), changes()
    with ui.override():
        scene.tetflora.year.season = 'WINTER'
    yield from ui.until(lambda: changes() > before, 20, "winter")
    ui.values["winter"] = [year.enabled, year.day]
    for frame, years in ((1, 0.0), (2, 3.0)):
        year.years = years
        year.keyframe_insert("years", frame=frame)
    scene.frame_set(1)
    yield from ui.until(lambda: size() > 0.9 * tall, 20, "full-grown plants")
    scene.frame_set(2)
    yield from ui.until(lambda: size() < 0.5 * tall, 20, "plants of three years")
    scene.frame_set(1)
    scene.animation_data_clear()
    year.years, year.enabled = 0.0, False
    yield from ui.until(lambda: size() > 0.9 * tall, 20, "plants as before")


def steps(ui):
    """See devtools/window_driver.py."""
    scene = bpy.context.scene
    build(scene)
    settings = scene.tetflora.preview
    space = ui.area().spaces.active
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_cursor = False
    space.show_object_viewport_empty = False
    shown = only_panel()
    try:
        yield from preview_steps(ui, scene, settings, space)
    finally:
        for cls in shown:
            bpy.utils.register_class(cls)


def preview_steps(ui, scene, settings, space):
    """Plants as shapes, levels, and a camera that is frozen."""
    yield from ui.show_sidebar("TetFlora")
    region = next(r for r in ui.area().regions if r.type == 'WINDOW')
    ui.values["view"] = [region.x, region.y, region.width, region.height]
    yield from ui.picture("panel")
    ui.values["before"] = names()

    yield from press_button(ui, "tetflora.look")
    ui.values["through"] = space.region_3d.view_perspective
    yield from ui.picture("bare")

    settings.plants = 'LIGHT'
    yield from ui.until(lambda: shapes(scene) is not None, 20, "plants")
    ui.values["plants"] = shapes(scene).plants
    yield from ui.picture("light")
    settings.plants = 'BOUNDS'
    yield from ui.until(lambda: shapes(scene).indices.shape[1] == 2, 20, "bounds")
    yield from ui.picture("bounds")
    # A plant is moved, another is deleted: they are read again by themselves.
    plants = [obj for obj in scene.objects if obj.tetflora.is_plant]
    height = shapes(scene).positions[:, 2].max()
    plants[0].location.z += 30.0
    yield from ui.until(lambda: shapes(scene).positions[:, 2].max() > height + 20.0, 20, "moved plant")
    plants[0].location.z -= 30.0
    bpy.data.objects.remove(plants[-1])
    yield from ui.until(lambda: shapes(scene).plants == len(plants) - 1, 20, "deleted plant")
    settings.plants = 'LIGHT'
    yield from ui.until(lambda: shapes(scene).indices.shape[1] == 3, 20, "plants")
    yield from through_the_year(ui, scene)
    settings.plants = 'NONE'
    yield 0.5
    ui.values["after_none"] = shapes(scene) is None

    original = levels_job.refine_loop
    levels_job.refine_loop = lambda *given: slowly(original, *given)
    yield from press_button(ui, "tetflora.preview_levels")
    ui.values["running"] = running(ui)
    yield from ui.until(lambda: not running(ui), 90, "levels")
    levels = state.find(scene).levels
    ui.values["levels"] = [[level.number, len(level)] for level in levels.levels]
    ui.values["forms"] = np.bincount(levels.levels[-1].decision, minlength=5).tolist()
    settings.projected = False
    last = settings.level
    ui.values["last"] = last
    for mode in ("FORM", "LEVEL", "VISIBILITY", "CONTRIBUTION"):
        settings.color = mode
        yield from ui.picture(f"wires_{mode.lower()}")
    settings.color = 'FORM'
    for number in (0, last // 2):
        settings.level = number
        yield from ui.picture(f"level_{number}")
    ui.values["middle"] = last // 2
    settings.level, settings.wires, settings.projected = last, False, True
    yield from ui.picture("translucent")
    settings.wires, settings.forms = True, {'HIDDEN'}
    settings.projected = False
    yield from ui.picture("hidden")
    settings.forms = {'EXPLICIT', 'PROXY', 'HIDDEN', 'SPLIT'}

    # Stopped in the middle: what was there stays.
    scene.tetflora.cutoff, scene.tetflora.leaf_limit = 0.4, 0.1
    yield from press_button(ui, "tetflora.preview_levels")
    ui.values["running_before_esc"] = running(ui)
    ui.press('ESC')
    yield from ui.until(lambda: not running(ui), 30, "end after Esc")
    levels_job.refine_loop = original
    ui.values["kept"] = state.find(scene).levels is levels

    # Frozen, and seen from above (figure 5).
    settings.freeze = True
    space.region_3d.view_perspective = 'ORTHO'
    space.region_3d.view_rotation = (1.0, 0.0, 0.0, 0.0)
    space.region_3d.view_location = (0.0, 5.0, 0.0)
    space.region_3d.view_distance = 160.0
    settings.projected = True
    yield from ui.picture("frozen")
    scene.camera.location = (60.0, 0.0, 3.0)
    yield 0.5
    ui.values["outdated_frozen"] = state.is_outdated(scene)
    yield from press_button(ui, "tetflora.look")
    eye = space.region_3d.view_matrix.inverted().translation
    ui.values["looks_from"] = [round(value, 3) for value in eye]
    yield from ui.picture("frozen_view")
    settings.freeze = False
    yield 0.5
    ui.values["outdated"] = state.is_outdated(scene)
    yield from ui.picture("outdated")
    with ui.override():
        bpy.ops.tetflora.preview_levels('INVOKE_DEFAULT', clear=True)
    yield 0.5
    ui.values["forgotten"] = state.find(scene).levels is None
    yield from ui.picture("forgotten")
    ui.values["after"] = names()
    ui.values["broken"] = "broken" in state.find(scene).cache


def build(scene):
    """Three rows of plants; the camera looks along them."""
    for name in ("Cube", "Light"):
        bpy.data.objects.remove(bpy.data.objects[name])
    for i in range(24):
        plant = bpy.data.objects.new(f"plant {i}", None)
        plant.location = (6.0 * (i % 3) - 6.0, 6.0 * (i // 3) - 15.0, 0.0)
        plant.tetflora.is_plant, plant.tetflora.species, plant.tetflora.seed = True, SPECIES[i % 3], i
        scene.collection.objects.link(plant)
    camera = scene.camera
    camera.location = (14.0, -34.0, 7.0)
    camera.rotation_euler = (Vector((0.0, 0.0, 4.0)) - camera.location).to_track_quat('-Z', 'Y').to_euler()
    scene.render.resolution_x, scene.render.resolution_y = 320, 200
    scene.tetflora.quality, scene.tetflora.preview.plants = 'DRAFT', 'NONE'
    scene.view_layers[0].update()


def only_panel():
    """Show the panel of levels alone, open: a copy under another name, as Blender keeps closed ones; gives others."""
    shown = [getattr(bpy.types, name) for name in dir(bpy.types) if name.startswith("TETFLORA_PT_")]
    ours = next(cls for cls in shown if cls.__name__ == "TETFLORA_PT_developer")
    for cls in shown:
        bpy.utils.unregister_class(cls)
    members = {"bl_options": set(), "bl_idname": "TETFLORA_PT_preview_open"}
    members["poll"] = classmethod(lambda cls, context: True)
    members |= {"bl_space_type": 'VIEW_3D', "bl_region_type": 'UI', "bl_category": "TetFlora", "bl_context": ""}
    bpy.utils.register_class(type("TETFLORA_PT_preview_open", (ours,), members))
    return shown


def shapes(scene):
    """The plants that are shown."""
    preview = state.find(scene)
    return None if preview is None else preview.shapes


def running(ui):
    """Whether levels are being computed."""
    return any(operator.bl_idname == "TETFLORA_OT_preview_levels" for operator in ui.window.modal_operators)


def names():
    """All datablocks that a preview could have made."""
    kinds = ("objects", "meshes", "collections", "materials", "node_groups", "cameras")
    return {kind: sorted(d.name for d in getattr(bpy.data, kind)) for kind in kinds}
