# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs in Blender's window for benchmarks/asset_window.py: seconds of redraws of a file from its camera, solid.

A wood is refined in here, since files are saved without results.
"""

import json
import statistics
import sys
import time
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from devtools import session  # noqa: E402  (found only now)


def steps(ui):
    """See devtools/window_driver.py."""
    wanted = json.loads((ui.out_dir / "wanted.json").read_text(encoding="utf-8"))
    session.start()
    from tetflora_addon.blender.job import refine

    with ui.override():
        bpy.ops.wm.open_mainfile(filepath=wanted["file"], load_ui=False)
    yield 2.0
    if wanted["refined"]:
        scene = bpy.context.scene
        scene.tetflora.asset_detail = 'REFINE'
        scene.objects["Scatter"].tetflora.is_scatter = True
        begin = time.perf_counter()
        with ui.override():
            refine.refine(scene, bpy.context.evaluated_depsgraph_get())
        ui.values["refine_s"] = time.perf_counter() - begin
        yield 1.0
    with ui.override():
        # Nothing but the viewport.
        bpy.ops.screen.screen_full_area(use_hide_panels=True)
    yield 1.0
    space = ui.area().spaces.active
    space.shading.type, space.clip_end = 'SOLID', 10_000.0
    space.region_3d.view_perspective = 'CAMERA'
    bpy.context.preferences.system.viewport_aa = 'OFF'
    space.overlay.show_overlays = False
    seconds = []
    for _ in range(wanted["redraws"] + 1):
        begin = time.perf_counter()
        with ui.override():
            bpy.ops.wm.redraw_timer(type='DRAW_WIN_SWAP', iterations=1)
        seconds.append(time.perf_counter() - begin)
        yield
    ui.values["first_redraw_s"] = seconds[0]  # hands all meshes to the graphics card
    ui.values["redraw_s"] = statistics.median(seconds[1:])
    yield from ui.picture("solid")
