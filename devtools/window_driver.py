# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside Blender's window: executes a script's ``steps(ui)``, a generator, from a timer.

Between two steps Blender handles events and draws. A step ends with ``yield``: ``yield`` waits a moment, ``yield 2.0``
two seconds, ``yield from ui.picture("name")`` until the picture of the screen is taken::

    def steps(ui):
        yield from ui.show_sidebar("TetFlora")
        yield from ui.click("ops.tetflora.refine(")
        ui.press('F3')
        yield 0.5
        ui.type_text("populate")
        yield from ui.picture("search")
        ui.values["objects"] = len(bpy.data.objects)

Started by devtools/window.py as ``blender --enable-event-simulate -P window_driver.py -- SCRIPT OUT_DIR ...``. Of
several scripts each begins with the startup file, whether or not the one before has failed.
"""

from __future__ import annotations

import faulthandler
import importlib.util
import json
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import bpy

MOMENT = 0.2  # seconds, enough for a redraw under software OpenGL
ROW = 10  # pixels between two looks for a button; buttons are twice as high
NOTE = 'F20'  # a key that nothing in Blender listens to
NAMES = {" ": 'SPACE', ".": 'PERIOD', ",": 'COMMA', "-": 'MINUS', "_": 'MINUS'}
DIGITS = ('ZERO', 'ONE', 'TWO', 'THREE', 'FOUR', 'FIVE', 'SIX', 'SEVEN', 'EIGHT', 'NINE')


class _Note(bpy.types.Operator):
    """Keep what the clipboard holds, and empty it."""

    bl_idname, bl_label = "wm.tetflora_note", "Note"
    notes: list[str] = []

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.notes.append(context.window_manager.clipboard)
        context.window_manager.clipboard = ""
        return {'FINISHED'}


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

    def places(self, region: str = 'UI', kind: str = 'VIEW_3D', across: Sequence[int] = ()) -> list[tuple[int, int]]:
        """Where to look for buttons in a region: from above, at pixels from its left edge, or its right if below 0."""
        found = next(r for r in self.area(kind).regions if r.type == region)
        columns = [x % found.width for x in across] or [found.width // 3, found.width * 2 // 3]
        rows = range(found.y + found.height - ROW, found.y, -ROW)
        return [(found.x + x, y) for x in columns for y in rows]

    def copied(self, places: Sequence[tuple[int, int]], popup: bool = False, **modifiers: bool) -> Iterator[float]:
        """What Ctrl C copies at each place, gives a list: Blender tells nobody where its buttons are.

        It is an operator's Python command, or with ``shift`` a setting's data path. All places are looked at between
        two redraws, which take long under software OpenGL. A popup keeps keys to itself: there it is one at a time.
        """
        manager = bpy.context.window_manager
        _Note.notes.clear()
        manager.clipboard = ""
        for x, y in places:
            self.move(x, y)
            self.move(x + 1, y)  # the first leaves one button, the second enters another
            self.press('C', ctrl=True, **modifiers)
            if not popup:
                self.press(NOTE)
                continue
            yield 0.0
            _Note.notes.append(manager.clipboard)
            manager.clipboard = ""
        yield 0.0
        return list(_Note.notes)

    def find(
        self, said: str, places: Sequence[tuple[int, int]] | None = None, popup: bool = False, **modifiers: bool
    ) -> Iterator[float]:
        """Move to the first button of whose copy something is part, gives its place; LookupError if there is none."""
        places = self.places() if places is None else places
        texts = []
        for some in [[place] for place in places] if popup else [places]:
            texts += yield from self.copied(some, popup, **modifiers)
            if found := next((place for place, text in zip(places, texts, strict=False) if said in text), None):
                self.move(*found)
                self.move(found[0] + 1, found[1])
                yield 0.0
                return found
        yield from self.picture("not_found")
        raise LookupError(f"there is no button for {said} among {sorted(set(texts))}")

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


def _report(ui: Ui, error: str | None) -> None:
    answer = {"ok": error is None, "error": error, "values": ui.values}
    part = ui.out_dir / "result.part"
    part.write_text(json.dumps(answer, indent=1), encoding="utf-8")
    part.rename(ui.out_dir / "result.json")
    if error:
        print(error, file=sys.stderr, flush=True)


def _steps(script: Path, ui: Ui) -> Iterator[float | None]:
    spec = importlib.util.spec_from_file_location("window_script", script)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    ui.move(*ui.center())
    yield from module.steps(ui)


def _all_steps(runs: Sequence[tuple[Path, Path]]) -> Iterator[float | None]:
    for number, (script, out_dir) in enumerate(runs):
        if number:
            bpy.ops.wm.read_homefile(use_empty=False)
            yield 1.0
        ui, error = Ui(out_dir), None
        try:
            yield from _steps(script, ui)
        except Exception:
            error = traceback.format_exc()
        _report(ui, error)


def main(runs: Sequence[tuple[Path, Path]]) -> None:
    """Load scripts, one after the other, and run their steps."""
    faulthandler.enable()  # the log tells what all threads did when Blender crashed
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.system.viewport_aa = 'OFF'  # eight draws otherwise, and each takes half a second
    bpy.utils.register_class(_Note)
    keys = bpy.context.window_manager.keyconfigs.addon.keymaps.new("Window")
    keys.keymap_items.new(_Note.bl_idname, NOTE, 'PRESS')
    steps = _all_steps(runs)

    def step() -> float | None:
        try:
            pause = next(steps)
        except BaseException as end:
            if not isinstance(end, StopIteration):
                traceback.print_exc()
            try:
                bpy.ops.wm.quit_blender()
            except RuntimeError:
                os._exit(1)
            return None
        return MOMENT if pause is None else pause

    # The window is up and drawn once by then. Persistent: a script may open files.
    bpy.app.timers.register(step, first_interval=1.0, persistent=True)


if __name__ == "__main__":
    given = list(map(Path, sys.argv[sys.argv.index("--") + 1 :]))
    main(list(zip(given[::2], given[1::2], strict=True)))
