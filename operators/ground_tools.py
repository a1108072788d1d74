# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools that point at the ground: what they share, placing plants by clicking, and a brush that paints and thins."""

import time
from math import radians, tau

import bpy
import numpy as np
from bpy.types import Operator
from bpy_extras import view3d_utils

from ..tetflora_addon.blender.declare import choice, once, string
from ..tetflora_addon.blender.placing.brush import Stroke, draped_circle
from ..tetflora_addon.blender.placing.ground import Ground, Hit
from ..tetflora_addon.blender.placing.plant_objects import add_plant, next_seed, remove_empty_collections
from ..tetflora_addon.blender.placing.properties import MODES
from ..tetflora_addon.blender.runtime import GoneError, JobData, redraw
from ..tetflora_addon.blender.species.catalog import NO_SPECIES, default_species, operator_items
from ..tetflora_addon.blender.species.edits import catalog, display_height
from ..tetflora_addon.blender.viewport.points import GroundCursor, circle
from ..tetflora_addon.errors import SceneError, TetFloraError
from ..tetflora_addon.planting.strokes import dabs_along
from .base import NO_VIEWPORT, Tool, counted, in_object_mode, scene_here, select_only

# Turning and moving the view, which goes on while a tool runs.
NAVIGATION = {
    'MIDDLEMOUSE', 'WHEELUPMOUSE', 'WHEELDOWNMOUSE', 'TRACKPADPAN', 'TRACKPADZOOM', 'MOUSEROTATE', 'MOUSESMARTZOOM',
    'NDOF_MOTION', *(f'NUMPAD_{n}' for n in (*range(10), 'PERIOD', 'PLUS', 'MINUS')),
}  # fmt: skip


class GroundTool(Tool):
    """Mix-in for modal operators in a 3D view that point at the ground."""

    bl_options = {'REGISTER'}  # each plant or stroke is an undo step of its own
    needs = (in_object_mode, scene_here)

    _cursor: GroundCursor | None = None
    _ground: Ground | None = None
    _data: JobData | None = None
    _window: bpy.types.Window | None = None
    _steps: int = 0  # undo steps of this run that are done
    _undone: int = 0
    _hit: Hit | None = None
    _changed = False

    def begin(self, context: bpy.types.Context) -> bool:
        """Start listening and drawing; False, with a report, where that is impossible."""
        if bpy.app.background or context.window is None or not _views(context.screen):
            self.failed(NO_VIEWPORT)
            return False
        self._look_around(context)
        if not len(self._ground):
            self.failed("No mesh is visible to plant on; add a ground mesh, or show it")
            return False
        self._cursor, self._window = GroundCursor(), context.window
        self._steps = self._undone = 0
        self._cursor.start(context.window)
        context.window_manager.modal_handler_add(self)
        context.window.cursor_modal_set('PAINT_CROSS')
        return True

    def go_on(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Look where the mouse is, and act on its press, with which a tool of the toolbar begins; for ``invoke``."""
        self._changed = False
        self.point(context, event)
        if (event.type, event.value) == ('LEFTMOUSE', 'PRESS'):
            self.key(context, event)
        self.show(context, event)
        return {'RUNNING_MODAL'}

    def key(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        """Act on a key or button; whether it was for the tool."""
        raise NotImplementedError

    def show(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        """Draw the cursor on the ground, and say in the status bar what keys do."""
        raise NotImplementedError

    def end(self, context: bpy.types.Context) -> None:
        """Leave nothing behind but what was planted."""
        if self._cursor is not None:
            self._cursor.stop()
            self._cursor = None
        if self._window is not None:
            self._window.cursor_modal_restore()
            self._window = None
        self._ground = self._hit = None
        if context.workspace is not None:
            context.workspace.status_text_set(None)
        redraw()

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            with self._data.watched():
                return self.handle(context, event)
        except GoneError as error:
            self.end(context)
            return self.failed(error)
        except BaseException:
            self.end(context)
            raise

    def handle(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Do what an event asks for; the result of ``modal``."""
        if event.type in {'ESC', 'RIGHTMOUSE', 'RET', 'NUMPAD_ENTER'}:
            if event.value != 'PRESS':
                return {'RUNNING_MODAL'}
            self.end(context)
            # What was done is done by undo steps of its own; without any, nothing happened.
            return {'FINISHED'} if self._changed else {'CANCELLED'}
        over = self.point(context, event)
        handled = over and event.value == 'PRESS' and self.key(context, event)
        self.show(context, event)
        # Panels, headers and other editors stay usable.
        passes = not over or event.type in NAVIGATION or event.type == 'TIMER'
        return {'PASS_THROUGH'} if passes and not handled else {'RUNNING_MODAL'}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the tool."""
        self.end(context)

    def point(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        """Find the ground under the mouse; False where the mouse is not over a 3D view."""
        viewport = _region_at(context.screen, event.mouse_x, event.mouse_y)
        if viewport is None:
            self._hit = None
            return False
        region, view = viewport
        place = (event.mouse_x - region.x, event.mouse_y - region.y)
        origin = view3d_utils.region_2d_to_origin_3d(region, view, place)
        self._hit = self._ground.cast(origin, view3d_utils.region_2d_to_vector_3d(region, view, place))
        return True

    def pushed(self, context: bpy.types.Context, message: str) -> None:
        """One undo step is done."""
        bpy.ops.ed.undo_push(message=message)
        self._steps, self._undone = self._steps + 1, 0
        self._look_around(context)

    def undo(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        """Undo and redo within what the tool did; whether the key was for that."""
        if event.type != 'Z' or event.value != 'PRESS' or not (event.ctrl or event.oskey):
            return False
        if event.shift and self._undone:
            bpy.ops.ed.redo()
            self._steps, self._undone = self._steps + 1, self._undone - 1
        elif not event.shift and self._steps:
            bpy.ops.ed.undo()
            self._steps, self._undone = self._steps - 1, self._undone + 1
        self._look_around(bpy.context)  # objects of before are no more
        redraw()
        return True

    def _look_around(self, context: bpy.types.Context) -> None:
        depsgraph = context.evaluated_depsgraph_get()
        self._ground = Ground(depsgraph)
        self._data = JobData(self.bl_label, context.scene, depsgraph)
        self._data.add_objects(self._ground.objects)


def _views(screen: bpy.types.Screen | None) -> list[bpy.types.Area]:
    return [area for area in screen.areas if area.type == 'VIEW_3D'] if screen else []


def _region_at(screen: bpy.types.Screen, x: int, y: int) -> tuple[bpy.types.Region, bpy.types.RegionView3D] | None:
    """The main region of a 3D view at a place of the window, unless a sidebar, header or gizmo covers it there."""
    for area in (area for area in _views(screen) if _in(area, x, y)):
        if any(r.type not in {'WINDOW', 'HUD', 'XR'} and r.height > 1 and _in(r, x, y) for r in area.regions):
            return None
        for region in area.regions:
            if region.type == 'WINDOW' and _in(region, x, y):
                return region, region.data or area.spaces.active.region_3d
    return None


def _in(part: bpy.types.Area | bpy.types.Region, x: int, y: int) -> bool:
    return part.x <= x < part.x + part.width and part.y <= y < part.y + part.height


_NOTCH = radians(15.0)
_LARGER = 1.1
_COLOR = (0.35, 0.95, 0.3, 1.0)
_KEYS = (
    "TetFlora {name}   |   Click: Add Plant   |   Wheel: Rotation {turn:.0f}°   |   Ctrl Wheel: Scale {scale:.2f}   "
    "|   Ctrl Z: Undo Plant   |   Esc or Right Click: Finish"
)


class TETFLORA_OT_place_plant(GroundTool, Operator, label="Place Plants by Clicking"):
    """Click on the ground to add plants one by one, each a different individual.

    The wheel rotates, Ctrl and the wheel scale; each plant is one undo step; Esc finishes.
    """

    species: choice("Species", "Species from the catalog", operator_items)

    _turn = 0.0
    _scale = 1.0
    _height = 1.0

    def execute(self, _context: bpy.types.Context) -> set[str]:
        return self.failed(f"{NO_VIEWPORT}; use tetflora.add_plant in scripts")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            chosen = default_species() if self.species in {"", NO_SPECIES} else self.species
        except TetFloraError as error:
            return self.failed(error)
        if not self.begin(context):
            return {'CANCELLED'}
        self._chosen, self._turn, self._scale, self._height = chosen, 0.0, 1.0, display_height(chosen)
        return self.go_on(context, event)

    def key(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        wheel = {'WHEELUPMOUSE': 1, 'WHEELDOWNMOUSE': -1}.get(event.type, 0)
        if event.type == 'LEFTMOUSE':
            if self._hit is not None:
                self._plant(context)
        elif wheel and event.ctrl:
            self._scale = float(np.clip(self._scale * _LARGER**wheel, 0.05, 20.0))
        elif wheel and not event.shift and not event.alt:
            self._turn = (self._turn + wheel * _NOTCH) % tau
        else:
            return self.undo(context, event)
        return True

    def _plant(self, context: bpy.types.Context) -> None:
        scene = context.scene
        plants = add_plant(scene, self._hit[0], self._turn, self._scale, next_seed(scene), self._chosen)
        context.view_layer.update()
        select_only(context, plants)
        self._changed = True
        self.pushed(context, "Place Plant")

    def show(self, context: bpy.types.Context, _event: bpy.types.Event) -> None:
        self._cursor.lines = []
        if self._hit is not None:
            foot = np.array(self._hit[0], dtype=np.float64)
            height = self._height * self._scale
            forward = np.array([np.cos(self._turn), np.sin(self._turn), 0.0])
            width = max(0.12 * height, 0.15)
            self._cursor.lines = [
                (circle(foot, width), _COLOR),
                (np.array([foot, foot + [0.0, 0.0, height]]), _COLOR),
                (np.array([foot, foot + 1.6 * width * forward]), _COLOR),
            ]
        known = catalog()
        name = known[self._chosen].name if self._chosen in known else self._chosen
        turn = np.degrees(self._turn)
        context.workspace.status_text_set(_KEYS.format(name=name, turn=turn, scale=self._scale))
        redraw()


_SPACING = 0.25  # radii from dab to dab
_PATIENCE = 4.0  # multiple of the time that showing the plants took last, before it happens again
_FINER = 1.1  # factor of the radius for a key or a notch of the wheel
_PIXELS = 0.01  # fraction of the radius that a pixel of the mouse adds after F
_COLORS = {'PAINT': (0.35, 0.95, 0.3, 1.0), 'ERASE': (1.0, 0.3, 0.2, 1.0), 'THIN': (1.0, 0.8, 0.2, 1.0)}
_MODE_KEYS = {'P': 'PAINT', 'E': 'ERASE', 'T': 'THIN'}
_BRUSH_KEYS = (
    "TetFlora {mode}   |   Drag: {does}   |   Shift: Erase   |   P, E, T: Paint, Erase, Thin   |   F or [ ]: Radius "
    "{radius:.3g} m   |   Ctrl Z: Undo Stroke   |   Esc or Right Click: Finish   {done}"
)
_DOES = {'PAINT': "Add Plants", 'ERASE': "Remove Plants", 'THIN': "Remove Some"}
_DONE = {'PAINT': "painted", 'ERASE': "erased", 'THIN': "thinned out"}


class TETFLORA_OT_paint_plants(GroundTool, Operator, label="Paint Plants"):
    """Paint, erase or thin plants with a brush on the visible meshes.

    Each stroke is one undo step; Esc or a right click finishes and keeps what was painted.
    """

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
        self._done = ""
        return self.go_on(context, event)

    def handle(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            if self._resizing is not None:
                return self._resize(context, event)
            return super().handle(context, event) if self._stroke is None else self._go_on_stroke(context, event)
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

    def _go_on_stroke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.point(context, event)
        if (event.type == 'LEFTMOUSE' and event.value == 'RELEASE') or event.type == 'ESC':
            stroke, self._stroke = self._stroke, None
            stroke.finish()
            self._done = _result_of(stroke)
            if stroke.added or stroke.removed:
                remove_empty_collections()
                self._changed = True
                context.view_layer.update()
                self.pushed(context, f"{_DONE[stroke.mode].capitalize()} Plants")
        elif event.type == 'MOUSEMOVE' and self._hit is not None:
            self._drag(context, event)
        self.show(context, event)
        return {'RUNNING_MODAL'}

    def key(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
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
        self.show(context, event)
        return {'RUNNING_MODAL'}

    def _begin_stroke(self, context: bpy.types.Context, mode: str) -> Stroke:
        context.view_layer.update()
        self._stroke = Stroke(context.scene, context.evaluated_depsgraph_get(), mode)
        self._last, self._shown, self._cost = None, time.monotonic(), 0.0
        return self._stroke

    def _drag(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        self._dab(context, self._hit[0], event.pressure if event.is_tablet else 1.0)
        if self._stroke.pending and time.monotonic() - self._shown > _PATIENCE * self._cost:
            begin = time.monotonic()
            self._stroke.flush()
            self._shown = time.monotonic()
            self._cost = self._shown - begin

    def _dab(self, context: bpy.types.Context, place: tuple[float, float, float], pressure: float) -> None:
        if self._last is None:
            way = [tuple(place)]
        else:
            way = dabs_along(self._last, place, _SPACING * context.scene.tetflora.brush.radius).tolist()
        for center in way:
            self._stroke.dab(center, pressure)
        self._last = tuple(place)

    def show(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        settings = context.scene.tetflora.brush
        mode = self._stroke.mode if self._stroke else 'ERASE' if event.shift else settings.mode
        self._cursor.lines = []
        if self._hit is not None:
            place, normal = self._hit
            self._cursor.lines = [(draped_circle(self._ground, place, normal, settings.radius), _COLORS[mode])]
            stalk = np.array([place, place + normal * 0.2 * settings.radius])
            self._cursor.lines.append((stalk, _COLORS[mode]))
        done = f"   |   {self._done}" if self._done else ""
        text = _BRUSH_KEYS.format(mode=mode.capitalize(), does=_DOES[mode], radius=settings.radius, done=done)
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
