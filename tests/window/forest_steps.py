# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's way from bare ground to a rendered forest, by mouse and keys; tests/window/test_forest.py judges it."""

import bpy
import numpy as np
from mathutils import Vector

PLANTS = 14


def steps(ui):
    """See devtools/window_driver.py."""
    scene = bpy.context.scene
    build_ground(scene)
    scene.render.resolution_x, scene.render.resolution_y = 480, 270
    yield from look(ui)
    yield from ui.show_sidebar("TetFlora")
    ui.values["bare"] = state()

    with ui.override():
        bpy.ops.tetflora.populate('INVOKE_DEFAULT')
    yield from ui.until(lambda: len(plants()) > 0 and not running(ui), 10, "plants")
    ui.values["populated"] = state()
    ui.values["locked"] = scene.render.use_lock_interface
    yield from ui.picture("populated")

    yield from press_button(ui, "tetflora.refine")
    # Asked for now, answered from outside while the job runs.
    (ui.out_dir / "progress.request").touch()
    yield from ui.until(lambda: scene.tetflora.statistics != "", 90, "refinement")
    ui.values["refined"] = state()
    ui.values["statistics"] = scene.tetflora.statistics
    ui.values["running_after"] = running(ui)
    yield from ui.picture("refined")

    # Again, and stopped in the middle. Larger and finer, so that it lasts.
    scene.tetflora.cutoff, scene.tetflora.leaf_limit = 0.1, 0.02
    small = scene.render.resolution_x, scene.render.resolution_y
    scene.render.resolution_x, scene.render.resolution_y = 3840, 2160
    yield from press_button(ui, "tetflora.refine")
    ui.values["running_before_esc"] = running(ui)
    ui.press('ESC')
    yield from ui.until(lambda: not running(ui), 30, "end of the job after Esc")
    scene.render.resolution_x, scene.render.resolution_y = small
    ui.values["escaped"] = state()
    yield from ui.picture("escaped")

    for name in ("refine_undone", "populate_undone"):
        yield from press_key(ui, 'Z', ctrl=True)
        ui.values[name] = state()
    yield from press_key(ui, 'Z', ctrl=True, shift=True)
    ui.values["populate_redone"] = state()

    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = 4, False
    scene.render.resolution_percentage = 50
    ui.values["green"] = yield from render(ui, "render")
    ui.values["after_render"] = state()
    yield from ui.picture("rendered")
    bpy.context.scene.tetflora.refine_at_render = False
    ui.values["green_without"] = yield from render(ui, "render_without")
    yield 1.0
    yield from ui.picture("nothing_refined")  # a menu says so, with what mends it
    ui.press('ESC')
    yield 1.0

    # Without the sidebar: search, type, Return.
    yield from press_key(ui, 'Z', ctrl=True)
    bpy.context.view_layer.objects.active = bpy.data.objects["Hill"]
    bpy.data.objects["Hill"].select_set(True)
    before = len(plants())
    yield from press_key(ui, 'F3')
    ui.type_text("scatter plants")
    yield 1.0
    yield from ui.picture("search")
    ui.press('RET')
    yield 1.0
    ui.values["planted_by_search"] = len(plants()) - before

    # What the Adjust Last Operation box does when its numbers change.
    last = bpy.context.window_manager.operators[-1]
    last.count, last.species = 5, "bush"
    with ui.override():
        bpy.ops.ed.undo_redo()
    yield 0.5
    ui.values["adjusted"] = state()["plants"][before:]


def build_ground(scene):
    """A hill of 30 m, the startup file's camera and lamp moved to where it is seen and lit, and what to plant there."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    u, v = (0.5 * a.ravel() for a in np.meshgrid(np.arange(-30.0, 31.0, 5.0), np.arange(-30.0, 31.0, 5.0)))
    side = 13
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    mesh = bpy.data.meshes.new("Hill")
    height = 3.0 * np.cos(u / 6.0) * np.cos(v / 8.0)
    faces = np.stack([corner, corner + 1, corner + side + 1, corner + side], axis=1)
    mesh.from_pydata(np.stack([u, v, height], axis=1).tolist(), [], faces.tolist())
    hill = bpy.data.objects.new("Hill", mesh)
    scene.collection.objects.link(hill)
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    hill.select_set(True)
    bpy.context.view_layer.objects.active = hill
    camera = scene.camera
    camera.location = (26.0, -26.0, 9.0)
    camera.rotation_euler = (Vector((0.0, 0.0, 4.0)) - camera.location).to_track_quat('-Z', 'Y').to_euler()
    lamp = bpy.data.objects["Light"]
    lamp.data.type = 'SUN'
    lamp.data.energy = 4.0
    settings = scene.tetflora.populate
    settings.count, settings.min_distance = PLANTS, 3.0
    for species in ("broadleaf_tree", "conifer", "bush"):
        settings.mix.add().species = species
    scene.view_layers[0].update()
    bpy.ops.ed.undo_push(message="Hill")


def look(ui):
    """Look through the camera, by the key that artists press."""
    ui.move(*ui.center())
    ui.press('NUMPAD_0')
    yield from ui.until(
        lambda: ui.area().spaces.active.region_3d.view_perspective == 'CAMERA', 10, "view through the camera"
    )
    yield 0.5


def press_button(ui, operator, popup=()):
    """Find an operator's button in the sidebar, or among places in a popup, and click on it."""
    _, y = yield from ui.find(f"bpy.ops.{operator}(", popup or None, bool(popup))
    if not popup:
        region = next(r for r in ui.area().regions if r.type == 'UI')
        ui.values.setdefault("below_top", {})[operator] = region.y + region.height - y
    ui.press('LEFTMOUSE')
    yield 0.1
    ui.move(*ui.center())
    yield 0.1


def press_key(ui, key, **modifiers):
    """Press a key over the 3D view and wait until Blender has acted on it."""
    ui.move(*ui.center())
    yield 0.2
    ui.press(key, **modifiers)
    yield 1.5


def render(ui, name):
    """F12; the share of the picture's pixels that are green."""
    done = []

    def note(*_arguments):
        done.append(True)

    bpy.app.handlers.render_complete.append(note)
    yield from press_key(ui, 'F12')
    yield from ui.until(lambda: done and not bpy.app.is_job_running('RENDER'), 90, "render")
    bpy.app.handlers.render_complete.remove(note)
    yield 1.0
    path = str(ui.out_dir / f"{name}.png")
    bpy.data.images["Render Result"].save_render(path)
    image = bpy.data.images.load(path)
    pixels = np.zeros(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    red, green, blue, _ = pixels.reshape(-1, 4).T
    bpy.data.images.remove(image)
    return float(((green > 1.1 * red) & (green > 1.1 * blue)).mean())


def running(ui):
    """Whether Refine, Populate or Update runs as a modal job."""
    jobs = {"TETFLORA_OT_refine", "TETFLORA_OT_populate", "TETFLORA_OT_update_layers"}
    return any(operator.bl_idname in jobs for operator in ui.window.modal_operators)


def plants():
    """Names of all plants."""
    return sorted(obj.name for obj in bpy.context.scene.objects if obj.tetflora.is_plant)


def state():
    """All that TetFlora could have changed in the file."""
    return {
        "plants": [
            [name, bpy.data.objects[name].tetflora.species, bpy.data.objects[name].tetflora.seed] for name in plants()
        ],
        "objects": sorted(
            [obj.name, len(getattr(obj.data, {'MESH': "polygons", 'POINTCLOUD': "points"}.get(obj.type, ""), ()))]
            for obj in bpy.context.scene.objects
        ),
        "materials": sorted(material.name for material in bpy.data.materials),
        "collections": sorted(collection.name for collection in bpy.context.scene.collection.children_recursive),
        "statistics": bpy.context.scene.tetflora.statistics,
    }
