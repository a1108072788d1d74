# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Set plants one by one by clicking on the ground."""

from __future__ import annotations

from math import radians, tau

import bpy
import numpy as np
from bpy.props import EnumProperty

from ..tetflora_addon.blender.ground_cursor import circle
from ..tetflora_addon.blender.plant_objects import add_plants, plants_of
from ..tetflora_addon.blender.runtime import redraw
from ..tetflora_addon.blender.species_edits import catalogue
from ..tetflora_addon.blender.species_items import NO_SPECIES, default_species, display_height, operator_items
from ..tetflora_addon.errors import TetFloraError
from ..tetflora_addon.planting.places import Placement, new_seeds
from .base import select_only
from .ground_tool import NAVIGATION, GroundTool

_NOTCH = radians(15.0)
_LARGER = 1.1
_COLOUR = (0.35, 0.95, 0.3, 1.0)
_KEYS = (
    "TetFlora {name}   |   Click: Add Plant   |   Wheel: Rotation {turn:.0f}°   |   Ctrl Wheel: Scale {scale:.2f}   "
    "|   Ctrl Z: Undo Plant   |   Esc or Right Click: Finish"
)


class TETFLORA_OT_place_plant(GroundTool, bpy.types.Operator):
    """Click on the ground to set plants."""

    bl_idname = "tetflora.place_plant"
    bl_label = "Place Plants by Clicking"
    bl_description = (
        "Click on the ground to add plants one by one, each a different individual. The wheel rotates, Ctrl and the "
        "wheel scale; each plant is one undo step; Esc finishes"
    )
    bl_options = {'REGISTER'}

    species: EnumProperty(name="Species", description="Species from the catalog", items=operator_items)

    _turn = 0.0
    _scale = 1.0
    _height = 1.0

    def execute(self, _context: bpy.types.Context) -> set[str]:
        self.report({'ERROR'}, "This tool requires a 3D viewport; use tetflora.add_plant in scripts")
        return {'CANCELLED'}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            chosen = default_species() if self.species in {"", NO_SPECIES} else self.species
        except TetFloraError as error:
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        if not self.begin(context):
            return {'CANCELLED'}
        self._chosen, self._turn, self._scale, self._height = chosen, 0.0, 1.0, display_height(chosen)
        self._changed = False
        self.point(context, event)
        self._show(context)
        return {'RUNNING_MODAL'}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            return self._handle(context, event)
        except BaseException:
            self.end(context)
            raise

    def _handle(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
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
        # The n-th plant of a scene, as Add > TetFlora Plant has it.
        seed = new_seeds(np.array([len(plants_of(context.scene.objects))]))
        placement = Placement(
            position=np.array([self._hit[0]], dtype=np.float64),
            azimuth=np.array([self._turn]),
            scale=np.array([self._scale]),
            species=np.zeros(1, np.int32),
            seed=seed,
            wanted=1,
        )
        made = add_plants(context.scene, placement, [self._chosen])
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
                (circle(foot, width), _COLOUR),
                (np.array([foot, foot + [0.0, 0.0, height]]), _COLOUR),
                (np.array([foot, foot + 1.6 * width * forward]), _COLOUR),
            ]
        known = catalogue()
        name = known[self._chosen].name if self._chosen in known else self._chosen
        turn = np.degrees(self._turn)
        context.workspace.status_text_set(_KEYS.format(name=name, turn=turn, scale=self._scale))
        redraw()


CLASSES = (TETFLORA_OT_place_plant,)
