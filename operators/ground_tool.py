# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What modal tools on the ground have in common: where the mouse points, keys that others keep, undo, leaving."""

from __future__ import annotations

import bpy
from bpy_extras import view3d_utils

from ..tetflora_addon.blender.ground import Ground, Hit
from ..tetflora_addon.blender.ground_cursor import GroundCursor
from ..tetflora_addon.blender.runtime import redraw
from .base import in_object_mode

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


class GroundTool:
    """Mix-in for modal operators in a 3D view that point at the ground."""

    _cursor: GroundCursor | None = None
    _ground: Ground | None = None
    _window: bpy.types.Window | None = None
    _steps: int = 0  # undo steps of this run that are done
    _undone: int = 0
    _hit: Hit | None = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context)

    def begin(self, context: bpy.types.Context) -> bool:
        """Start to listen and to draw; False, with a report, where that is impossible."""
        if bpy.app.background or context.window is None or _view_of(context.screen) is None:
            self.report({'ERROR'}, "This tool requires a 3D viewport")
            return False
        self._look_around(context)
        if not len(self._ground):
            self.report({'ERROR'}, "No mesh is visible to plant on; add a ground mesh, or show it")
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

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the tool."""
        self.end(context)

    def point(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        """Find the ground under the mouse; False where the mouse is not in a 3D view's picture."""
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
        self._ground = Ground(context.view_layer, context.evaluated_depsgraph_get())


def _view_of(screen: bpy.types.Screen | None) -> bpy.types.Area | None:
    return next((area for area in screen.areas if area.type == 'VIEW_3D'), None) if screen else None


def _region_at(screen: bpy.types.Screen, x: int, y: int) -> tuple[bpy.types.Region, bpy.types.RegionView3D] | None:
    """The picture of a 3D view at a place of the window, unless a sidebar, a header or a gizmo lies over it there."""
    for area in screen.areas:
        if area.type != 'VIEW_3D' or not _in(area, x, y):
            continue
        if any(r.type not in {'WINDOW', 'HUD', 'XR'} and r.height > 1 and _in(r, x, y) for r in area.regions):
            return None
        for region in area.regions:
            if region.type == 'WINDOW' and _in(region, x, y):
                return region, region.data or area.spaces.active.region_3d
    return None


def _in(part: bpy.types.Area | bpy.types.Region, x: int, y: int) -> bool:
    return part.x <= x < part.x + part.width and part.y <= y < part.y + part.height
