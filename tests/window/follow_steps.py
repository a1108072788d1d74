# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendered shading refines what a viewport shows by itself, while that is turned, plants are moved, and undone.

Blender's Workbench draws it, which takes no time; tests/window/test_follow.py judges what came of it.
"""

import math
import sys
import time
from pathlib import Path

import bpy
from mathutils import Euler, Vector

sys.path.append(str(Path(__file__).resolve().parents[2]))

from devtools.aliases import INSTALLED, alias

alias(INSTALLED)
from tetflora_addon.blender.results.collection import result_collections  # noqa: E402  (found only now)
from tetflora_addon.blender.viewport import auto, state  # noqa: E402

PLANTS, APART = 9, 9.0


def steps(ui):
    """See devtools/window_driver.py."""
    scene = bpy.context.scene
    bpy.ops.object.select_all(action='SELECT')
    bpy.ops.object.delete()
    scene.render.engine = 'BLENDER_WORKBENCH'
    side = math.isqrt(PLANTS)
    for i in range(PLANTS):
        plant = bpy.data.objects.new(f"plant {i}", None)
        plant.location = APART * (i % side - side / 2), APART * (i // side - side / 2), 0.0
        plant.tetflora.is_plant, plant.tetflora.species, plant.tetflora.seed = True, "oak", i
        scene.collection.objects.link(plant)
    space = ui.area().spaces.active
    space.clip_end = 1000.0
    ui.values["camera"] = scene.camera is not None
    look(space, 20.0, 3.0)
    scene.tetflora.quality = 'PREVIEW'
    bpy.ops.ed.undo_push(message="a wood")
    yield from ui.until(lambda: state.find(scene) is not None and state.find(scene).shapes is not None, 30, "shapes")
    ui.values["on_before"] = scene.tetflora.auto_refine
    begun = time.monotonic()
    space.shading.type = 'RENDERED'
    yield from ui.until(lambda: scene.tetflora.auto_refine, 10, "on by itself")
    yield from ui.until(lambda: finished(scene), 60, "first look")
    ui.values["first_look_s"] = time.monotonic() - begun
    ui.values["first"] = polygons(scene)
    yield from ui.picture("first")
    ui.values["parts"] = parts = [ui.values["first"]]
    while not quiet(scene):
        if polygons(scene) != parts[-1]:
            parts.append(polygons(scene))
        yield 0.01
    ui.values["near"] = polygons(scene)
    parts.append(ui.values["near"])
    yield from ui.picture("near")
    yield 2.0  # Blender tells of what was made, and nothing has changed

    look(space, 20.0, 2.9)
    yield 0.4
    ui.values["moved_little"] = polygons(scene)
    yield from ui.until(lambda: bool(auto.message()), 30, "it begins for the view that has moved a little")
    looks = set()
    while not quiet(scene):
        looks.add(polygons(scene))
        yield 0.1
    ui.values["least_meanwhile"] = min(looks)
    look(space, 70.0, 400.0)
    yield from ui.until(lambda: polygons(scene) == 0 or bool(auto.message()), 10, "what is out of date is hidden")
    ui.values["moving"] = polygons(scene)
    yield from ui.picture("moving")
    yield from ui.until(lambda: quiet(scene), 120, "far")
    ui.values["far"] = polygons(scene)
    yield from ui.picture("far")
    ui.values["message"] = auto.message()
    yield from changed_and_undone(ui, space)
    bpy.context.scene.tetflora.auto_refine = False


def changed_and_undone(ui, space):
    """Turn the view by a key while it is refined, move a plant, undo that in the middle, and look at Solid shading."""
    ui.move(*ui.center())
    look(space, 70.0, 60.0)
    yield from ui.until(lambda: bool(auto.message()), 30, "it begins anew")
    due = auto._state.due
    ui.press('NUMPAD_4')
    yield from ui.until(lambda: auto._state.due > due, 30, "it waits until the view is quiet")
    ui.values["turned"] = auto.message()
    bpy.data.objects["plant 0"].location.x += 500.0
    bpy.ops.ed.undo_push(message="moved")
    yield from ui.until(lambda: bool(auto.message()), 60, "it begins anew for the plant")
    ui.press('Z', ctrl=True)
    yield from ui.until(lambda: bpy.data.objects["plant 0"].location.x < 400.0, 30, "undone")
    yield from ui.until(lambda: quiet(bpy.context.scene) and auto._state.steps is None, 120, "after undo")
    ui.values["undone"] = polygons(bpy.context.scene)
    ui.values["on_after_undo"] = bpy.context.scene.tetflora.auto_refine
    yield from ui.picture("undone")
    ui.area().spaces.active.shading.type = 'SOLID'
    yield from ui.until(lambda: not bpy.context.scene.tetflora.auto_refine, 10, "off by itself")
    ui.values["kept"] = polygons(bpy.context.scene)


def look(space, tilt, distance):
    """Turn the viewport toward the middle of the plants."""
    view = space.region_3d
    view.view_perspective = 'PERSP'
    view.view_location = Vector((0.0, 0.0, 5.0))
    view.view_rotation = Euler((math.radians(90.0 - tilt), 0.0, 0.4)).to_quaternion()
    view.view_distance = distance


def finished(scene):
    """Whether a result is shown."""
    return bool(result_collections(scene, 'VIEW'))


def quiet(scene):
    """Whether nothing is left to do."""
    return finished(scene) and not auto.message()


def polygons(scene):
    """Those of all results."""
    made = [o for c in result_collections(scene, 'VIEW') for o in c.objects if o.type == 'MESH']
    return sum(len(o.data.polygons) for o in made)
