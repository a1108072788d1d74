# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the manual's pictures of the window anew: ``BLENDER=/path/to/blender python -m devtools.window_pictures``.

One file with two lives: run as a module it builds the zip, installs it in a home of its own and opens Blender's window;
devtools/window_driver.py then loads it again inside Blender for `steps`. Without ``BLENDER`` it says so and does
nothing, as the other pictures of the documentation need no full Blender.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

LARGEST = 300_000  # bytes
TABS = 24  # pixels at the sidebar's right edge with the names of its tabs

WINDOWS = ("first-forest", "add-menu")  # pictures of all of it

# The panel of each picture, and its sections that are open.
PANELS = {
    "plants": ("TETFLORA_PT_plant",),
    "brush": ("brush",),
    "refinement": ("TETFLORA_PT_refine",),
    "season": ("TETFLORA_PT_season",),
    "animation": ("TETFLORA_PT_render", "Animation", "Leaf Objects"),
    "output": ("TETFLORA_PT_view_layer", "Ray Visibility", "By Species"),
    "species": ("TETFLORA_PT_species", "Name, Leaf and Bark"),
    "stand": ("TETFLORA_PT_layers", "Site", "Where"),
    "layers": ("TETFLORA_PT_layers", "Where", "Spacing and Size"),
}


def steps(ui: Any) -> Iterator[float | None]:
    """Inside Blender: populate, and show the panels one after the other."""
    import bpy

    bpy.context.preferences.system.viewport_aa = '8'  # as an artist sees it
    yield from ui.show_sidebar("TetFlora")
    with ui.override():
        bpy.ops.tetflora.first_forest('INVOKE_DEFAULT')
    bpy.context.scene.tetflora.preview.plants = 'LIGHT'
    yield 2.0
    yield from ui.picture("first-forest")
    bpy.ops.wm.read_homefile(use_empty=False)
    yield 1.0
    scene = bpy.context.scene
    bpy.context.preferences.system.use_region_overlap = False  # an even background, so that panels can be cut out
    _hill(scene)
    with ui.override():
        bpy.ops.view3d.view_camera()
    yield from ui.show_sidebar("TetFlora")
    with ui.override():
        bpy.ops.tetflora.populate('INVOKE_DEFAULT')
    yield from ui.until(lambda: not ui.window.modal_operators, 120, "plants")
    with ui.override():
        bpy.ops.wm.call_menu(name="TETFLORA_MT_add_plant")
    yield 1.0
    yield from ui.picture("add-menu")
    ui.press('ESC')
    yield 0.5
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    plant = next(obj for obj in scene.objects if obj.tetflora.is_plant)
    plant.select_set(True)
    bpy.context.view_layer.objects.active = plant
    leaf = scene.tetflora.leaf_objects.add()
    leaf.species = "broadleaf_tree"
    own = scene.tetflora.output.species.add()
    own.species = "conifer"
    scene.tetflora.species_editor.shown = True
    registered = [getattr(bpy.types, name) for name in dir(bpy.types) if name.startswith("TETFLORA_PT_")]
    for cls in registered:
        if 'INSTANCED' in getattr(cls, "bl_options", ()):
            continue
        bpy.utils.unregister_class(cls)
    for name, (shown, *sections) in PANELS.items():
        if name == "stand":
            yield from _stand(ui, scene)
        elif name == "layers":
            scene.tetflora.layers_index = 0
            with ui.override():
                bpy.ops.tetflora.ground_cover('INVOKE_DEFAULT')
            yield from ui.until(lambda: not ui.window.modal_operators, 300, "cover")
        panel = _brush_panel() if shown == "brush" else next(cls for cls in registered if cls.__name__ == shown)
        opened = _opened(panel, name, sections)
        bpy.utils.register_class(opened)
        yield from ui.show_sidebar("TetFlora")
        yield from ui.picture(f"panel-{name}")
        bpy.utils.unregister_class(opened)
    region = next(r for r in ui.area().regions if r.type == 'UI')
    ui.values["sidebar"] = [region.x, region.y, region.width, region.height]


def _stand(ui: Any, scene: Any) -> Iterator[float | None]:
    """A stand on the hill, which is then active."""
    import bpy

    bpy.context.view_layer.objects.active = None
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    bpy.data.objects["Hill"].select_set(True)
    with ui.override():
        bpy.ops.tetflora.grow_stand('INVOKE_DEFAULT')
    yield from ui.until(lambda: not ui.window.modal_operators, 300, "stand")
    bpy.context.active_object.tetflora.stand_year = 60.0
    yield 1.0


def _hill(scene: Any) -> None:
    """Ground of 80 m with a clearing in front of the camera, and the species to plant there."""
    import bpy
    import numpy as np
    from mathutils import Vector

    bpy.data.objects.remove(bpy.data.objects["Cube"])
    side = 41
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-40.0, 40.0, side), np.linspace(-40.0, 40.0, side)))
    z = 4.0 * np.cos(x / 13.0) * np.cos(y / 17.0)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    mesh = bpy.data.meshes.new("Hill")
    mesh.from_pydata(
        np.stack([x, y, z], axis=1).tolist(),
        [],
        np.stack([corner, corner + 1, corner + side + 1, corner + side], axis=1).tolist(),
        shade_flat=False,
    )
    hill = bpy.data.objects.new("Hill", mesh)
    hill.tetflora.is_occluder = True
    scene.collection.objects.link(hill)
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    hill.select_set(True)
    bpy.context.view_layer.objects.active = hill
    camera = scene.camera
    camera.location = (52.0, -50.0, 14.0)
    camera.rotation_euler = (Vector((0.0, 0.0, 4.0)) - camera.location).to_track_quat('-Z', 'Y').to_euler()
    camera.data.clip_end = 1000.0
    settings = scene.tetflora.populate
    settings.count = 60
    for species, weight in (("broadleaf_tree", 2.0), ("conifer", 1.0), ("bush", 2.0)):
        entry = settings.mix.add()
        entry.species, entry.weight = species, weight


def _brush_panel() -> Any:
    """The settings of the brush as a panel, as the Tool tab shows them."""
    import bpy

    tools = next(module for name, module in sys.modules.items() if name.endswith("tetflora.panels.tools"))

    def draw(self: Any, context: Any) -> None:
        self.layout.use_property_split, self.layout.use_property_decorate = True, False
        tools.PaintTool.draw_settings(context, self.layout, None)

    members = {"bl_label": "Paint Plants", "draw": draw, "__module__": tools.__name__}
    return type("TETFLORA_PT_brush", (bpy.types.Panel,), members)


def _opened(cls: Any, picture: str, sections: list[str]) -> Any:
    """A copy of a panel that is open; under another name, because Blender remembers what was closed.

    The panel must not be registered with it: Blender forgets the class of a panel whose copy is unregistered.
    """
    base = sys.modules[f"{cls.__module__.rpartition('.')[0]}.base"]
    plain = getattr(base.section, "plain", base.section)

    def section(layout: Any, title: str, closed: bool = True, switch: Any = None) -> Any:
        return plain(layout, title, title not in sections, switch)

    section.plain = plain
    # Some panels import the function, others its module.
    base.section = sys.modules[cls.__module__].section = section
    name = f"{cls.__name__}_{picture.replace('-', '_')}"
    place = {"bl_space_type": 'VIEW_3D', "bl_region_type": 'UI', "bl_category": "TetFlora", "bl_context": ""}
    return type(name, (cls,), {"bl_options": set(), "bl_idname": name, **place})


def _convert(*arguments: str | Path) -> None:
    subprocess.run(["convert", *map(str, arguments)], check=True)


def _store(out: Path, sidebar: list[int], images: Path, height: int) -> None:
    """Cut and compress what the window showed."""
    x, y, width, tall = sidebar
    for name in PANELS:
        cut = f"{width - TABS}x{tall}+{x}+{height - y - tall}"
        source, target = out / f"panel-{name}.png", images / f"panel-{name}.png"
        trimmed = ("-crop", cut, "+repage", "-shave", "4x4", "-fuzz", "2%", "-trim", "+repage")
        _convert(source, *trimmed, "-strip", "+dither", "-colors", "200", target)
    for name in WINDOWS:
        _convert(out / f"{name}.png", "-resize", "1280x", "-strip", "-quality", "84", images / f"panel-{name}.jpg")


def main() -> int:
    """Make the pictures; exit code 1 if Blender failed or a picture is too large."""
    from . import build, window

    blender = os.environ.get("BLENDER")
    if not blender:
        print("Pictures of the window are left as they are: set BLENDER=/path/to/blender to make them anew.")
        return 0
    images = build.ROOT / "docs" / "images"
    images.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="tetflora-pictures-") as folder:
        home, out = Path(folder) / "home", Path(folder) / "out"
        home.mkdir()
        archive = build.build(Path(folder) / "dist")
        install = [blender, "-b", "--command", "extension", "install-file", "-r", "user_default", "-e", archive]
        environment = {**os.environ, "BLENDER_USER_RESOURCES": str(home)}
        subprocess.run(install, env=environment, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        result = window.run_in_window(blender, Path(__file__), out, 1200, home)
        if not result["ok"]:
            print(result["error"], json.dumps(result["values"]), file=sys.stderr)
            return 1
        _store(out, result["values"]["sidebar"], images, window.SIZE[1])
    made = sorted(images.glob("panel-*"))
    for path in made:
        print(f"{path.stat().st_size:>8,} {path.relative_to(build.ROOT)}")
    large = [path.name for path in made if path.stat().st_size > LARGEST]
    if large:
        print(f"larger than {LARGEST:,} bytes: {', '.join(large)}", file=sys.stderr)
    return 1 if large else 0


if __name__ == "__main__":
    sys.exit(main())
