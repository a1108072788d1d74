# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Paint, erase and thin plants with a brush."""

import time

import bpy
import numpy as np

from ..tetflora_addon.blender.declare import once, string
from ..tetflora_addon.blender.placing.brush import Stroke, draped_circle
from ..tetflora_addon.blender.placing.plant_objects import remove_empty_collections
from ..tetflora_addon.blender.placing.properties import MODES
from ..tetflora_addon.blender.runtime import GoneError, redraw
from ..tetflora_addon.errors import SceneError, TetFloraError
from ..tetflora_addon.planting.strokes import dabs_along
from .base import NO_VIEWPORT, counted
from .ground_tools import NAVIGATION, GroundTool

_SPACING = 0.25  # radii from dab to dab
_PATIENCE = 4.0  # multiple of the time that showing the plants took last, before it happens again
_FINER = 1.1  # factor of the radius for a key or a notch of the wheel
_PIXELS = 0.01  # fraction of the radius that a pixel of the mouse adds after F
_COLORS = {'PAINT': (0.35, 0.95, 0.3, 1.0), 'ERASE': (1.0, 0.3, 0.2, 1.0), 'THIN': (1.0, 0.8, 0.2, 1.0)}
_MODE_KEYS = {'P': 'PAINT', 'E': 'ERASE', 'T': 'THIN'}
_KEYS = (
    "TetFlora {mode}   |   Drag: {does}   |   Shift: Erase   |   P, E, T: Paint, Erase, Thin   |   F or [ ]: Radius "
    "{radius:.3g} m   |   Ctrl Z: Undo Stroke   |   Esc or Right Click: Finish   {done}"
)
_DOES = {'PAINT': "Add Plants", 'ERASE': "Remove Plants", 'THIN': "Remove Some"}
_DONE = {'PAINT': "painted", 'ERASE': "erased", 'THIN': "thinned out"}


class TETFLORA_OT_paint_plants(GroundTool, bpy.types.Operator):
    """Paint, erase or thin plants with a brush on the visible meshes.

    Each stroke is one undo step; Esc or a right click finishes and keeps what was painted.
    """

    bl_label = "Paint Plants"

    mode: once.choice("Mode", "Brush mode; that of the panel if not set", MODES)
    stroke: string(
        "Stroke",
        "For scripts: path of the brush on the ground in world space, three numbers per point, for example 0 "
        "0 0, 5 2.5 0",
        options={'SKIP_SAVE', 'HIDDEN'},
    )

    _stroke: Stroke | None = None
    _last: tuple[float, float, float] | None = None
    _resizing: tuple[int, float] | None = None  # where the mouse was, and the radius
    _shown = 0.0
    _cost = 0.0
    _done = ""
    _changed = False

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self.stroke:
            return self.failed(f"{NO_VIEWPORT}, or a stroke from a script")
        if self.properties.is_property_set("mode"):
            context.scene.tetflora.brush.mode = self.mode
        try:
            places = _places(self.stroke)
            stroke = self._begin_stroke(context, context.scene.tetflora.brush.mode)
            for place in places:
                self._dab(context, place, 1.0)
            stroke.finish()
        except TetFloraError as error:
            return self.failed(error)
        self._stroke = None
        remove_empty_collections()
        return self.done(_result_of(stroke))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.stroke:
            return self.execute(context)
        if not self.begin(context):
            return {'CANCELLED'}
        if self.properties.is_property_set("mode"):
            context.scene.tetflora.brush.mode = self.mode
        self._done, self._changed = "", False
        self.point(context, event)
        if (event.type, event.value) == ('LEFTMOUSE', 'PRESS'):  # as the tool of the toolbar begins
            self._key(context, event)
        self._show(context, event)
        return {'RUNNING_MODAL'}

    def handle(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            return self._handle(context, event)
        except GoneError:
            raise
        except TetFloraError as error:
            self._stroke = None
            self.failed(error)
            return {'RUNNING_MODAL'}

    def end(self, context: bpy.types.Context) -> None:
        if self._stroke is not None and self._stroke.changed:  # what was painted before something went away
            bpy.ops.ed.undo_push(message=f"{_DONE[self._stroke.mode].capitalize()} Plants")
        self._stroke = None
        super().end(context)

    def _handle(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self._resizing is not None:
            return self._resize(context, event)
        if self._stroke is None and event.type in {'ESC', 'RIGHTMOUSE', 'RET', 'NUMPAD_ENTER'}:
            if event.value != 'PRESS':
                return {'RUNNING_MODAL'}
            self.end(context)
            # What was done is done by undo steps of its own; without any, nothing happened.
            return {'FINISHED'} if self._changed else {'CANCELLED'}
        over = self.point(context, event)
        if self._stroke is not None:
            if (event.type == 'LEFTMOUSE' and event.value == 'RELEASE') or event.type == 'ESC':
                self._end_stroke(context)
            elif event.type == 'MOUSEMOVE' and self._hit is not None:
                self._drag(context, event)
            self._show(context, event)
            return {'RUNNING_MODAL'}
        if not over:
            # Panels, headers and other editors stay usable.
            self._show(context, event)
            return {'PASS_THROUGH'}
        if event.value == 'PRESS' and self._key(context, event):
            self._show(context, event)
            return {'RUNNING_MODAL'}
        self._show(context, event)
        return {'PASS_THROUGH'} if event.type in NAVIGATION or event.type == 'TIMER' else {'RUNNING_MODAL'}

    def _key(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        """Act on a key or button; whether it was for the brush."""
        settings = context.scene.tetflora.brush
        if event.type == 'LEFTMOUSE':
            self._last = None
            self._begin_stroke(context, 'ERASE' if event.shift else settings.mode)
            if self._hit is not None:
                self._drag(context, event)
        elif event.type in _MODE_KEYS and not (event.ctrl or event.alt or event.oskey):
            settings.mode = _MODE_KEYS[event.type]
        elif event.type in {'LEFT_BRACKET', 'RIGHT_BRACKET'}:
            settings.radius *= _FINER if event.type == 'RIGHT_BRACKET' else 1.0 / _FINER
        elif event.ctrl and event.type in {'WHEELUPMOUSE', 'WHEELDOWNMOUSE'}:
            settings.radius *= _FINER if event.type == 'WHEELUPMOUSE' else 1.0 / _FINER
        elif event.type == 'F':
            self._resizing = (event.mouse_x, settings.radius)
        elif self.undo(context, event):
            self._done = ""
        else:
            return False
        return True

    def _resize(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """After F: the mouse makes the circle, which stays where it is, wider or narrower until a click."""
        settings, (x, before) = context.scene.tetflora.brush, self._resizing
        if event.type == 'MOUSEMOVE':
            settings.radius = max(0.05, before * float(np.exp(_PIXELS * (event.mouse_x - x))))
        elif event.type in {'LEFTMOUSE', 'RET', 'F'} and event.value == 'PRESS':
            self._resizing = None
        elif event.type in {'ESC', 'RIGHTMOUSE'} and event.value == 'PRESS':
            settings.radius, self._resizing = before, None
        self._show(context, event)
        return {'RUNNING_MODAL'}

    def _begin_stroke(self, context: bpy.types.Context, mode: str) -> Stroke:
        context.view_layer.update()
        self._stroke = Stroke(context.scene, context.evaluated_depsgraph_get(), mode)
        self._last, self._shown, self._cost = None, time.monotonic(), 0.0
        return self._stroke

    def _drag(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        self._dab(context, self._hit[0], event.pressure if event.is_tablet else 1.0)
        if self._stroke.pending and time.monotonic() - self._shown > _PATIENCE * self._cost:
            self._flush()

    def _dab(self, context: bpy.types.Context, place: tuple[float, float, float], pressure: float) -> None:
        if self._last is None:
            way = [tuple(place)]
        else:
            way = dabs_along(self._last, place, _SPACING * context.scene.tetflora.brush.radius).tolist()
        for center in way:
            self._stroke.dab(center, pressure)
        self._last = tuple(place)

    def _flush(self) -> None:
        begin = time.monotonic()
        self._stroke.flush()
        self._shown = time.monotonic()
        self._cost = self._shown - begin

    def _end_stroke(self, context: bpy.types.Context) -> None:
        stroke, self._stroke = self._stroke, None
        stroke.finish()
        self._done = _result_of(stroke)
        if stroke.added or stroke.removed:
            remove_empty_collections()
            self._changed = True
            context.view_layer.update()
            self.pushed(context, f"{_DONE[stroke.mode].capitalize()} Plants")

    def _show(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        settings = context.scene.tetflora.brush
        mode = self._stroke.mode if self._stroke else 'ERASE' if event.shift else settings.mode
        self._cursor.lines = []
        if self._hit is not None:
            place, normal = self._hit
            self._cursor.lines = [(draped_circle(self._ground, place, normal, settings.radius), _COLORS[mode])]
            stalk = np.array([place, place + normal * 0.2 * settings.radius])
            self._cursor.lines.append((stalk, _COLORS[mode]))
        done = f"   |   {self._done}" if self._done else ""
        text = _KEYS.format(mode=mode.capitalize(), does=_DOES[mode], radius=settings.radius, done=done)
        context.workspace.status_text_set(text)
        redraw()


def _places(text: str) -> list[tuple[float, float, float]]:
    """Points of a stroke given as text."""
    try:
        places = [tuple(float(number) for number in part.split()) for part in text.split(",") if part.strip()]
    except ValueError:
        places = []
    if not places or any(len(place) != 3 for place in places):
        raise SceneError(f'"{text}" is not a stroke; use three numbers per point, for example 0 0 0, 5 2.5 0')
    return places


def _result_of(stroke: Stroke) -> str:
    number = stroke.added if stroke.mode == 'PAINT' else stroke.removed
    return f"{counted(number, 'plant')} {_DONE[stroke.mode]}"
