# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Esc in the middle of what reads and writes files and adds biomes, and H; tests/window/test_stop.py judges it."""

import sys
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).resolve().parents[2]))

from devtools.aliases import INSTALLED, alias

alias(INSTALLED)
from tests import places_files  # noqa: E402  (found only now)
from tests.blender.scenes import add_mesh, add_plant, datablocks, select  # noqa: E402
from tetflora_addon.blender import compat  # noqa: E402
from tetflora_addon.blender.viewport import auto  # noqa: E402

#: Imports, by kinds of files.
KINDS = "grid", "csv", "big_tiff", "outlines"


def steps(ui):
    """See devtools/window_driver.py."""
    scene = bpy.context.scene
    for n in range(3):
        add_plant(f"p{n}", seed=n, location=(3.0 * n, 0.0, 0.0))
    ui.move(*ui.center())
    yield 0.5
    yield from hide(ui, scene)
    calls = {kind: places_files.write(ui.out_dir, kind) for kind in KINDS}
    calls = {
        kind: (name, {"filepath": str(path), "chosen": True, "new_origin": True})
        for kind, (name, path) in calls.items()
    }
    calls["csv"][1]["columns"] = "{}"
    for ending in (".usdc", ".glb", ".obj")[compat.usd() is None :]:
        options = {"filepath": str(ui.out_dir / f"forest{ending}"), "chosen": True, "variants": 1, "polygons": 3000}
        calls[ending] = "export_forest", options
    calls["biome"] = "add_biome", {"biome": "meadow"}
    scene.render.use_lock_interface = False
    for kind, (name, options) in calls.items():
        for number in (2, 5, 8) if kind != "biome" else (30,):
            before, files = state(), sorted(ui.out_dir.iterdir())
            held = hold(getattr(bpy.types, f"TETFLORA_OT_{name}"), number)
            with ui.override():
                getattr(bpy.ops.tetflora, name)('INVOKE_DEFAULT', **options)
            yield from ui.until(lambda held=held: held["there"] or not running(ui), 120, f"step {number} of {kind}")
            key = f"{kind} {number}"
            if not held["there"]:  # it has fewer steps
                held["free"]()
                ui.values[key] = "ended"
                break
            ui.press('ESC')
            yield from ui.until(lambda: not running(ui), 30, f"end of {kind} after Esc")
            held["free"]()
            yield 0.3
            now = state()
            ui.values[key] = [what for what in before if before[what] != now[what]]
            ui.values[key] += [path.name for path in sorted(ui.out_dir.iterdir()) if path not in files]
    yield from strew(ui)


def strew(ui):
    """Esc while leaves are strewn over a cover that is done, and undo; layers that cover something after each."""
    ground = add_mesh("wood ground", size=12.0)
    ground.location.x = 100.0
    select(ground)
    bpy.context.scene.tetflora.year.enabled, bpy.context.scene.tetflora.year.day = True, 300.0
    with ui.override():
        bpy.ops.tetflora.populate(count=8, species="birch", min_distance=1.0)
        bpy.ops.ed.undo_push(message="Planted")
    held = hold(bpy.types.TETFLORA_OT_ground_cover, 1, lambda job: "without fallen leaves" in job.cancelled)
    with ui.override():
        bpy.ops.tetflora.ground_cover('INVOKE_DEFAULT')
    yield from ui.until(lambda: held["there"] or not running(ui), 120, "leaves that are strewn")
    ui.press('ESC')
    yield from ui.until(lambda: not running(ui), 30, "end of Ground Cover after Esc")
    held["free"]()
    yield 0.5
    number = [sum(bool(one.covers) for one in bpy.context.scene.tetflora.layers)]
    ui.move(*ui.center())
    ui.press('Z', ctrl=True)
    yield 2.0
    number.append(sum(bool(one.covers) for one in bpy.context.scene.tetflora.layers))
    ui.values["strewn"] = number


def hide(ui, scene):
    """H, Refine, Alt H; what results say after each."""
    select(bpy.data.objects["p1"])
    yield from ui.show_sidebar("TetFlora")
    ui.press('H')
    yield from ui.until(lambda: not bpy.data.objects["p1"].visible_get(), 20, "hidden plant")
    with ui.override():
        bpy.ops.tetflora.refine()
    yield 3.0
    said = [auto.changed_since(scene)]
    ui.move(*ui.center())
    ui.press('H', alt=True)
    yield from ui.until(lambda: bpy.data.objects["p1"].visible_get(), 20, "plant that is shown again")
    yield 3.0
    said.append(auto.changed_since(scene))
    yield from ui.picture("shown_again")
    with ui.override():
        bpy.ops.tetflora.refine()
        bpy.ops.tetflora.clear()
    ui.values["said"] = said


def hold(cls, number, late=lambda _job: True):
    """Let an operator's steps stay at one of them, or where it is late, until Esc comes."""
    usual, held = cls.steps, {"there": False}

    def stays(self, context):
        running, enough, count = usual(self, context), None, 0
        try:
            while True:
                progress = running.send(enough)
                count += 1
                held["there"] = count >= number and late(self)
                enough = yield progress
                while held["there"]:
                    yield progress
        except StopIteration as stop:
            return stop.value
        finally:
            running.close()

    cls.steps = stays
    held["free"] = lambda: setattr(cls, "steps", usual)
    return held


def running(ui):
    """Whether anything runs as a modal operator."""
    return any(operator.bl_idname.startswith("TETFLORA_OT") for operator in ui.window.modal_operators)


def state():
    """What is in the file."""
    scene = bpy.context.scene
    more = [one.name for one in bpy.data.scenes], [one.name for one in bpy.data.objects if not one.hide_viewport]
    return datablocks() | {
        "scenes": more,
        "lock": scene.render.use_lock_interface,
        "layers": len(scene.tetflora.layers),
        "species": len(scene.tetflora.species_edits),
    }
