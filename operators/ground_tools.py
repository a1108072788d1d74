# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools that point at the ground: what they share (pointing, undo, leaving), and placing plants by clicking."""

from math import radians, tau

import bpy
import numpy as np
from bpy_extras import view3d_utils

from ..tetflora_addon.blender.declare import choice
from ..tetflora_addon.blender.placing.ground import Ground, Hit
from ..tetflora_addon.blender.placing.plant_objects import add_plant, next_seed
from ..tetflora_addon.blender.runtime import GoneError, JobData, redraw
from ..tetflora_addon.blender.species.catalog import NO_SPECIES, default_species, operator_items
from ..tetflora_addon.blender.species.edits import catalog, display_height
from ..tetflora_addon.blender.viewport.points import GroundCursor, circle
from ..tetflora_addon.errors import TetFloraError
from .base import NO_VIEWPORT, Tool, in_object_mode, select_only

# Turning and moving the view, which goes on while a tool runs.
NAVIGATION = {
    'MIDDLEMOUSE',
    'WHEELUPMOUSE',
    'WHEELDOWNMOUSE',
    'TRACKPADPAN',
    'TRACKPADZOOM',
    'MOUSEROTATE',
    'MOUSESMARTZOOM',
    'NDOF_MOTION',
    *(f'NUMPAD_{n}' for n in (*range(10), 'PERIOD', 'PLUS', 'MINUS')),
}


class GroundTool(Tool):
    """Mix-in for modal operators in a 3D view that point at the ground."""

    bl_options = {'REGISTER'}  # each plant or stroke is an undo step of its own
    needs = (in_object_mode,)

    _cursor: GroundCursor | None = None
    _ground: Ground | None = None
    _data: JobData | None = None
    _window: bpy.types.Window | None = None
    _steps: int = 0  # undo steps of this run that are done
    _undone: int = 0
    _hit: Hit | None = None

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
        raise NotImplementedError

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the tool."""
        self.end(context)

    def point(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        """Find the ground under the mouse; False where the mouse is not over a 3D view."""
        found = _region_at(context.screen, event.mouse_x, event.mouse_y)
        if found is None:
            self._hit = None
            return False
        region, view = found
        place = (event.mouse_x - region.x, event.mouse_y - region.y)
        origin = view3d_utils.region_2d_to_origin_3d(region, view, place)
        direction = view3d_utils.region_2d_to_vector_3d(region, view, place)
        self._hit = self._ground.cast(origin, direction)
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


class TETFLORA_OT_place_plant(GroundTool, bpy.types.Operator):
    """Click on the ground to add plants one by one, each a different individual.

    The wheel rotates, Ctrl and the wheel scale; each plant is one undo step; Esc finishes.
    """

    bl_label = "Place Plants by Clicking"

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
        self._changed = False
        self.point(context, event)
        if (event.type, event.value) == ('LEFTMOUSE', 'PRESS'):  # as the tool of the toolbar begins
            self._key(context, event)
        self._show(context)
        return {'RUNNING_MODAL'}

    def handle(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type in {'ESC', 'RIGHTMOUSE', 'RET', 'NUMPAD_ENTER'}:
            if event.value != 'PRESS':
                return {'RUNNING_MODAL'}
            self.end(context)
            return {'FINISHED'} if self._changed else {'CANCELLED'}
        over = self.point(context, event)
        handled = over and event.value == 'PRESS' and self._key(context, event)
        self._show(context)
        passes = not over or event.type in NAVIGATION or event.type == 'TIMER'
        return {'PASS_THROUGH'} if passes and not handled else {'RUNNING_MODAL'}

    def _key(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
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
        made = add_plant(scene, self._hit[0], self._turn, self._scale, next_seed(scene), self._chosen)
        context.view_layer.update()
        select_only(context, made)
        self._changed = True
        self.pushed(context, "Place Plant")

    def _show(self, context: bpy.types.Context) -> None:
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
