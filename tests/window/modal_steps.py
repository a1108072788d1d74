# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine between redraws: to its end, until Return or Esc, and into errors; tests/window/test_modal.py judges it."""

import json
import sys
import threading
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).resolve().parents[2]))

from devtools.aliases import INSTALLED, alias

alias(INSTALLED)
from tests.blender.scenes import add_plant, datablocks  # noqa: E402  (found only now)
from tests.window.slow import slowly  # noqa: E402
from tetflora_addon.blender.job import refine  # noqa: E402
from tetflora_addon.blender.results.collection import has_results  # noqa: E402
from tetflora_addon.errors import SpeciesError  # noqa: E402
from tetflora_addon.jobs import Progress  # noqa: E402


def steps(ui):
    """See devtools/window_driver.py."""
    usual = refine.refine_steps
    try:
        yield from all_steps(ui, bpy.context.scene)
    finally:
        refine.refine_steps = usual


def all_steps(ui, scene):
    """To the end, by hand and by a script, stopped, refused and failing."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    scene.camera.location, scene.camera.rotation_euler = (0.0, -60.0, 2.0), (1.5708, 0.0, 0.0)
    for i in range(2):
        add_plant(f"p{i}", seed=i, location=(3.0 * i, 3.0 * i, 0.0))
    ui.move(*ui.center())
    yield 0.5
    bare = datablocks()

    begin(ui)
    ui.values["running"] = running(ui)
    yield from ui.until(lambda: not running(ui), 60, "end of Refine")
    ui.values["in_window"] = figures(scene)
    with ui.override():
        bpy.ops.tetflora.refine()
    ui.values["in_script"] = figures(scene)
    refine.clear(scene)

    # Objects appear early, so there is something to take back; plants enough that Esc comes before the end.
    many = [add_plant(f"many {i}", seed=i, location=(i % 40 - 20.0, 10.0 + i // 40, 0.0)) for i in range(240)]
    bare = datablocks()
    scene.tetflora.expand_everything = True
    begin(ui)
    yield from ui.until(lambda: datablocks() != bare, 60, "first objects")
    ui.values["running_before_esc"] = running(ui)
    ui.move(*ui.center())
    ui.press('ESC')
    yield from ui.until(lambda: not running(ui), 30, "end after Esc")
    ui.values["left_by_esc"] = changes(bare)
    scene.tetflora.expand_everything = False
    bpy.data.batch_remove(many)

    scene.tetflora.cutoff, scene.tetflora.leaf_limit = 0.5, 0.1
    messages = listen()
    original = refine.loop.refine
    refine.loop.refine = lambda *given: slowly(original, *given)  # or the loop would be over before Return comes
    begin(ui)
    yield from ui.until(lambda: any("Refining, pass" in message for message in messages), 60, "first pass")
    ui.press('RET')
    yield from ui.until(lambda: not running(ui), 60, "end after Return")
    refine.loop.refine = original
    ui.values["stopped"] = [has_results(scene), json.loads(scene.tetflora.statistics)["complete"]]
    refine.clear(scene)

    # A pass that does not end by itself: Esc must not wait for it.
    bare = datablocks()
    begun, go = threading.Event(), threading.Event()
    refine.loop.refine = lambda *given: held(begun, go, original, *given)
    begin(ui)
    yield from ui.until(begun.is_set, 60, "beginning of the pass")
    yield 0.5
    ui.values["running_in_pass"] = running(ui)
    ui.press('ESC')
    yield from ui.until(lambda: not running(ui), 10, "end after Esc in a pass")
    ui.values["left_by_esc_in_pass"] = changes(bare)
    refine.loop.refine = original
    go.set()

    odd = add_plant("odd", scale=(1.0, 1.0, 0.0))
    bare = datablocks()
    try:
        begin(ui)
    except RuntimeError as error:
        ui.values["refused"] = str(error)
    ui.values["running_refused"] = running(ui)
    bpy.data.objects.remove(odd)

    # The columns of an inventory are asked for first; what they were taken for goes with the call that imports.
    table = ui.out_dir / "trees.csv"
    table.write_text("Art;top;x;y\nTilia cordata;12;0;0\nAcer rubrum;9;5;5\n")
    for key in ('ESC', 'RET'):
        with ui.override():
            bpy.ops.tetflora.import_inventory('INVOKE_DEFAULT', filepath=str(table), chosen=True)
        yield 1.0
        yield from ui.picture("columns")
        ui.press(key)
        yield 3.0
        ui.values[f"fields_after_{key}"] = [obj.name for obj in bpy.data.objects if obj.tetflora.is_field]
    ui.values["columns"] = json.loads(bpy.context.window_manager.operators[-1].columns)

    bare = datablocks()
    refine.refine_steps = broken
    begin(ui)
    ui.values["running_broken"] = running(ui)
    yield from ui.until(lambda: not running(ui), 30, "end after an error")
    ui.values["left_by_error"] = changes(bare)
    yield 0.5
    yield from ui.picture("error")
    ui.values["reports"] = reports(ui)


def begin(ui):
    """Start Refine as its button does."""
    with ui.override():
        bpy.ops.tetflora.refine('INVOKE_DEFAULT')


def running(ui):
    """Whether Refine runs as a modal operator."""
    return any(operator.bl_idname == "TETFLORA_OT_refine" for operator in ui.window.modal_operators)


def figures(scene):
    """What the refinement made; seconds differ from one to the next."""
    numbers = {k: v for k, v in json.loads(scene.tetflora.statistics).items() if k not in {"seconds", "steps"}}
    return numbers | {kind: len(names) for kind, names in datablocks().items()}


def changes(before):
    """Kinds of datablocks that are not what they were."""
    return [kind for kind, names in datablocks().items() if names != before[kind]]


def listen():
    """Messages of the steps, as they come."""
    messages, refine_steps = [], refine.refine_steps

    def noted(*arguments, **options):
        running, enough = refine_steps(*arguments, **options), None
        try:
            while True:
                progress = running.send(enough)
                messages.append(progress.message)
                enough = yield progress
        except StopIteration as stop:
            return stop.value
        finally:
            running.close()

    refine.refine_steps = noted
    return messages


def held(begun, go, original, *given):
    """The loop, which begins when it may."""
    begun.set()
    go.wait(120.0)
    return (yield from original(*given))


def broken(*_arguments, **_options):
    """Fails when the window has begun to wait."""
    for number in range(3):
        yield Progress(0.1 * number, "one step more")
    raise SpeciesError("leaf without faces")


def reports(ui):
    """Everything that Blender has reported, from its Info editor."""
    area = ui.area()
    area.type = 'INFO'
    with ui.override('INFO'):
        bpy.ops.info.select_all(action='SELECT')
        bpy.ops.info.report_copy()
    area.type = 'VIEW_3D'
    return bpy.context.window_manager.clipboard
