# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs in Blender's window for benchmarks/blocks.py: times all calls of TetFlora's operators, timers and handlers."""

import json
import sys
import time
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from devtools import session  # noqa: E402  (found only now)

SIDE = 1000.0  # meters of ground
MOVES = 20


def steps(ui):
    """See devtools/window_driver.py."""
    session.start()
    wanted = json.loads((ui.out_dir / "wanted.json").read_text(encoding="utf-8"))
    scene = bpy.context.scene
    for name in ("Cube", "Light"):
        bpy.data.objects.remove(bpy.data.objects[name])
    bpy.ops.mesh.primitive_grid_add(size=SIDE, x_subdivisions=100, y_subdivisions=100)
    scene.camera.location, scene.camera.rotation_euler = (0.0, -0.55 * SIDE, 40.0), (1.4, 0.0, 0.0)
    scene.camera.data.clip_end = 5000.0
    yield 1.0
    calls = Calls()
    calls.watch()
    found = {}

    settings = scene.tetflora.populate
    settings.count, settings.min_distance, settings.distance_by_species = wanted["plants"], 0.5, False
    begin = time.perf_counter()
    with ui.override():
        bpy.ops.tetflora.populate('INVOKE_DEFAULT')
    yield from ui.until(lambda: not ui.window.modal_operators, 300, "plants")
    ui.values["populate_s"] = time.perf_counter() - begin
    ui.values["plants"] = sum(population.made for population in scene.tetflora.layers)
    yield 1.0
    found["populate"] = calls.longest()

    begin = time.perf_counter()
    with ui.override():
        bpy.ops.tetflora.refine('INVOKE_DEFAULT')
    yield from ui.until(lambda: not ui.window.modal_operators, 600, "refinement")
    ui.values["refine_s"] = time.perf_counter() - begin
    yield 1.0
    found["refine"] = calls.longest()

    scene.tetflora.auto_refine = True
    for _ in range(MOVES):
        scene.camera.location.y += 0.5
        yield 0.3
    yield 20.0
    found["camera"] = calls.longest()
    ui.values["longest_ms"] = found


class Calls:
    """Milliseconds of the longest call of each function that Blender calls."""

    def __init__(self):
        self._longest, self._timers = {}, {}

    def longest(self):
        """By name, since this was last asked."""
        found, self._longest = self._longest, {}
        return found

    def watch(self):
        """Begin."""
        for name in dir(bpy.types):
            if name.startswith("TETFLORA_OT_"):
                kind = getattr(bpy.types, name)
                for method in ("invoke", "modal"):
                    if hasattr(kind, method):
                        setattr(kind, method, _of_events(self._timed(getattr(kind, method), f"{name}.{method}")))
        for name in dir(bpy.app.handlers):
            functions = getattr(bpy.app.handlers, name)
            for number, function in enumerate(functions if isinstance(functions, list) else ()):
                if "tetflora" in function.__module__:
                    timed = bpy.app.handlers.persistent(self._timed(function, f"{name}: {_name(function)}"))
                    functions[number] = timed
        timers, known = bpy.app.timers, self._timers
        register, unregister, is_registered = timers.register, timers.unregister, timers.is_registered

        def add(function, **options):
            if "tetflora" in getattr(function, "__module__", ""):
                known[function] = self._timed(function, f"timer: {_name(function)}")
            register(known.get(function, function), **options)

        timers.register = add
        timers.unregister = lambda function: unregister(known.get(function, function))
        timers.is_registered = lambda function: is_registered(known.get(function, function))
        make = sys.modules[f"{session.PACKAGE}.tetflora_addon.blender.main_thread"].make_changes
        unregister(make)  # there since the extension was enabled
        add(make, persistent=True)

    def _timed(self, function, label):
        def call(*given, **named):
            begin = time.perf_counter()
            try:
                return function(*given, **named)
            finally:
                spent = 1e3 * (time.perf_counter() - begin)
                self._longest[label] = max(self._longest.get(label, 0.0), spent)

        return call


def _of_events(function):
    """Blender passes as many arguments as the signature has."""
    return lambda self, context, event: function(self, context, event)


def _name(function):
    return f"{function.__module__.rpartition('tetflora_addon.')[2]}.{function.__qualname__}"
