# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside Blender's window: executes a script's ``steps(ui)``, a generator, from a timer.

Between two steps Blender handles events and draws. A step ends with ``yield``: ``yield`` waits a moment, ``yield 2.0``
two seconds, ``yield from ui.picture("name")`` until the picture of the screen is taken::

    def steps(ui):
        yield from ui.show_sidebar("TetFlora")
        ui.press('F3')
        yield 0.5
        ui.type_text("populate")
        yield from ui.picture("search")
        ui.values["objects"] = len(bpy.data.objects)

Started by devtools/window.py as ``blender --enable-event-simulate -P window_driver.py -- SCRIPT OUT_DIR``.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy

MOMENT = 0.2  # seconds, enough for a redraw under software OpenGL
NAMES = {" ": 'SPACE', ".": 'PERIOD', ",": 'COMMA', "-": 'MINUS', "_": 'MINUS'}
DIGITS = ('ZERO', 'ONE', 'TWO', 'THREE', 'FOUR', 'FIVE', 'SIX', 'SEVEN', 'EIGHT', 'NINE')


class Ui:
    """What a script can do to the window; pixels count from the lower left corner.

    Attributes
    ----------
    values : dict
        Whatever the script wants to hand out; must be fit for JSON.
    """

    def __init__(self, out_dir: Path) -> None:
        self.out_dir = out_dir
        self.values: dict[str, Any] = {}

    @property
    def window(self) -> bpy.types.Window:
        """Blender's first window; asked for anew, because loading a file replaces it."""
        return bpy.context.window_manager.windows[0]

    def area(self, kind: str = 'VIEW_3D') -> bpy.types.Area:
        """The largest editor of a kind."""
        found = [a for a in self.window.screen.areas if a.type == kind]
        return max(found, key=lambda a: a.width * a.height)

    def center(self, region: str = 'WINDOW', kind: str = 'VIEW_3D') -> tuple[int, int]:
        """The middle of an editor's region."""
        found = next(r for r in self.area(kind).regions if r.type == region)
        return found.x + found.width // 2, found.y + found.height // 2

    def override(self, kind: str = 'VIEW_3D'):
        """A context, for ``with``, in which operators act as if called in an editor."""
        area = self.area(kind)
        region = next(r for r in area.regions if r.type == 'WINDOW')
        return bpy.context.temp_override(window=self.window, area=area, region=region)

    def move(self, x: int, y: int) -> None:
        """Move the mouse."""
        self._mouse = (x, y)
        self.window.event_simulate(type='MOUSEMOVE', value='NOTHING', x=x, y=y)

    def press(self, key: str, **modifiers: bool) -> None:
        """Press and release a key where the mouse is; modifiers are ``shift``, ``ctrl``, ``alt``."""
        x, y = self._mouse
        for value in ('PRESS', 'RELEASE'):
            self.window.event_simulate(type=key, value=value, x=x, y=y, **modifiers)

    def type_text(self, text: str) -> None:
        """Type letters, digits and simple punctuation."""
        x, y = self._mouse
        for letter in text:
            key = NAMES.get(letter) or (DIGITS[int(letter)] if letter.isdigit() else letter.upper())
            self.window.event_simulate(type=key, value='PRESS', unicode=letter, x=x, y=y)
            self.window.event_simulate(type=key, value='RELEASE', x=x, y=y)

    def show_sidebar(self, tab: str | None = None) -> Iterator[float]:
        """Open the 3D view's sidebar, at the given tab; the mouse goes to the middle of the view."""
        area = self.area()
        area.spaces.active.show_region_ui = True
        self.move(*self.center())
        yield MOMENT  # the region gets its size, and its tabs, when it is drawn
        yield MOMENT
        if tab is not None:
            region = next(r for r in self.area().regions if r.type == 'UI')
            region.active_panel_category = tab
            region.tag_redraw()
        yield MOMENT

    def until(self, condition: Callable[[], bool], seconds: float, what: str) -> Iterator[float]:
        """Wait until something is true; TimeoutError after some seconds, naming what was waited for."""
        for _ in range(max(1, round(seconds / MOMENT))):
            if condition():
                return
            yield MOMENT
        if not condition():
            raise TimeoutError(f"{what}: not within {seconds:g} s")

    def picture(self, name: str) -> Iterator[float]:
        """Redraw, and have a picture of the screen taken as ``<name>.png``."""
        for area in self.window.screen.areas:
            area.tag_redraw()
        yield 2 * MOMENT
        request = self.out_dir / f"{name}.request"
        request.touch()
        yield from self.until(lambda: not request.exists(), 30, f"picture {name}")


def _finish(ui: Ui, error: str | None) -> None:
    answer = {"ok": error is None, "error": error, "values": ui.values}
    part = ui.out_dir / "result.part"
    part.write_text(json.dumps(answer, indent=1), encoding="utf-8")
    part.rename(ui.out_dir / "result.json")
    if error:
        print(error, file=sys.stderr, flush=True)
    try:
        bpy.ops.wm.quit_blender()
    except RuntimeError:
        os._exit(1)


def main(script: Path, out_dir: Path) -> None:
    """Load the script and run its steps."""
    bpy.context.preferences.view.show_splash = False
    spec = importlib.util.spec_from_file_location("window_script", script)
    module = importlib.util.module_from_spec(spec)
    ui = Ui(out_dir)
    steps: Iterator[float | None] | None = None

    def step() -> float | None:
        nonlocal steps
        try:
            if steps is None:
                spec.loader.exec_module(module)
                ui.move(*ui.center())
                steps = module.steps(ui)
            pause = next(steps)
        except StopIteration:
            _finish(ui, None)
        except BaseException:
            _finish(ui, traceback.format_exc())
        else:
            return MOMENT if pause is None else pause
        return None

    # The window is up and drawn once by then. Persistent: a script may open files.
    bpy.app.timers.register(step, first_interval=1.0, persistent=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[sys.argv.index("--") + 1 :][:2]))
