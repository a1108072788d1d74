# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders in the window with *Lock Interface* on and off; tests/window/test_lock.py judges which thread refines."""

import sys
import threading
from pathlib import Path

import addon_utils
import bpy

sys.path.append(str(Path(__file__).resolve().parents[2]))

from devtools.aliases import INSTALLED, alias

alias(INSTALLED)
from tests.blender.scenes import add_mesh, add_plant  # noqa: E402  (found only now)
from tetflora_addon.blender import main_thread  # noqa: E402
from tetflora_addon.blender.job import refine, render  # noqa: E402
from tetflora_addon.blender.results import hiding  # noqa: E402


def steps(ui):
    """See devtools/window_driver.py."""
    scene = bpy.context.scene
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    scene.camera.location, scene.camera.rotation_euler = (0.0, -20.0, 2.0), (1.5708, 0.0, 0.0)
    scene.render.engine, scene.cycles.samples = 'CYCLES', 1
    scene.render.resolution_x, scene.render.resolution_y = 32, 18
    scene.frame_start, scene.frame_end = 1, 3
    for frame in (1, 3):
        scene.camera.location.x = float(frame)
        scene.camera.keyframe_insert("location", frame=frame)
    scene.tetflora.share_frames = False
    scene.render.filepath = str(ui.out_dir / "frame_####")
    for i in range(3):
        add_plant(f"p{i}", seed=i, location=(3.0 * i, 3.0 * i, 0.0))
    sheet = add_mesh("sheet")  # enabled for a moment while each frame is read
    sheet.modifiers.new("array", 'ARRAY').count = 4
    sheet.tetflora.is_explicit = sheet.hide_viewport = True
    # As its collection is; and a plant moves by a constraint, for which it is evaluated in a scene of its own.
    home = bpy.data.collections.new("home")
    scene.collection.children.link(home)
    home.objects.link(sheet)
    scene.collection.objects.unlink(sheet)
    home.hide_viewport = scene.render.use_motion_blur = True
    follows = bpy.data.objects["p0"].constraints.new('COPY_LOCATION')
    follows.target, follows.use_y, follows.use_z = scene.camera, False, False
    refine.refine(scene, bpy.context.evaluated_depsgraph_get())  # results hide it
    seen, original = [], refine.refine

    def watched(*given, **named):
        found = original(*given, **named)
        seen.append((threading.current_thread() is threading.main_thread(), main_thread.window_draws()))
        ui.values["meshes"] = named["given"].explicit.meshes.faces
        ui.values["moving"] = int((abs(named["given"].seeds.motion[:, 0]) > 1.0).sum())
        return found

    refine.refine = watched
    ui.values["timer"] = bpy.app.timers.is_registered(main_thread.make_changes)
    for locked in (True, False):
        scene.render.use_lock_interface = locked
        seen.clear()
        done = []
        bpy.app.handlers.render_complete.append(end := lambda *_, done=done: done.append(1))
        bpy.ops.render.render('INVOKE_DEFAULT', animation=True)
        yield from ui.until(lambda done=done: done and not bpy.app.is_job_running('RENDER'), 120, "the render")
        bpy.app.handlers.render_complete.remove(end)
        ui.values["locked" if locked else "unlocked"] = [*seen, render.render_errors()]
    ui.values["disabled"] = *hiding.artists_flags(sheet), sheet.hide_get()
    ui.values["scenes"] = len(bpy.data.scenes), len(bpy.data.collections["home"].objects)
    ui.values["timers_at_end"] = bpy.app.timers.is_registered(main_thread.make_changes)
    addon_utils.disable(INSTALLED)  # and not in the preferences, which other tests share
    ui.values["timer_after"] = bpy.app.timers.is_registered(main_thread.make_changes)
