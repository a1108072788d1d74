# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender quits in the middle of Refine; tests/window/test_stop.py judges it."""

import sys
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).resolve().parents[2]))

from devtools.aliases import INSTALLED, alias

alias(INSTALLED)
from tests.blender.scenes import add_plant  # noqa: E402  (found only now)
from tests.window.slow import slowly  # noqa: E402
from tetflora_addon.blender.job import refine  # noqa: E402


def steps(ui):
    """See devtools/window_driver.py."""
    scene = bpy.context.scene
    for n in range(240):
        add_plant(f"p{n}", seed=n, location=(n % 40 - 20.0, 10.0 + n // 40, 0.0))
    scene.camera.location, scene.camera.rotation_euler = (0.0, -60.0, 2.0), (1.5708, 0.0, 0.0)
    scene.tetflora.cutoff, scene.tetflora.leaf_limit = 0.5, 0.1
    original = refine.loop.refine
    refine.loop.refine = lambda *given: slowly(original, *given)  # or it would be over before
    ui.move(*ui.center())
    yield 0.5
    before = len(bpy.data.objects)
    with ui.override():
        bpy.ops.tetflora.refine('INVOKE_DEFAULT')
    yield from ui.until(lambda: len(bpy.data.objects) > before, 60, "first objects")
    yield 1.0
    (ui.out_dir / "running").write_text(str([one.bl_idname for one in ui.window.modal_operators]))
    with ui.override():
        bpy.ops.wm.quit_blender()
    yield 60.0
