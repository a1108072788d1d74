# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A small complete forest to begin with."""

import bpy
from bpy.props import IntProperty

from ..tetflora_addon.blender.first_forest import build
from .base import Reporting, in_object_mode


class TETFLORA_OT_first_forest(Reporting, bpy.types.Operator):
    """Make a small complete forest."""

    bl_idname = "tetflora.first_forest"
    bl_label = "First Forest"
    bl_description = (
        "Create a small complete scene with ground, about ninety plants of four species, camera, sun and sky, ready "
        "for Refine and F12. Existing objects remain: if the scene is not empty, a new scene is added"
    )
    bl_options = {'REGISTER', 'UNDO'}

    seed: IntProperty(name="Seed", description="A different seed gives a different forest", options={'SKIP_SAVE'})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        scene, said = build(context, self.seed)
        _activate_ground(scene)
        plants = sum(o.tetflora.is_plant for o in scene.objects)
        screen = context.screen
        for area in screen.areas if screen and not bpy.app.background else ():
            if area.type == 'VIEW_3D':
                area.spaces.active.region_3d.view_perspective = 'CAMERA'
        said = f" ({said})" if said else ""
        self.report(
            {'INFO'}, f"Created a forest of {plants} plants{said}. Click Refine to show it, press F12 to render it"
        )
        return {'FINISHED'}


def _activate_ground(scene: bpy.types.Scene) -> None:
    """Select the ground, so that Populate and the brush go on from there, and not the startup's hidden cube."""
    layer = scene.view_layers[0]
    layer.update()  # what was just linked is not in it before
    ground = next((obj for obj in layer.objects if obj.tetflora.is_occluder), None)
    if ground is not None:
        for obj in layer.objects.selected:
            obj.select_set(False, view_layer=layer)
        ground.select_set(True, view_layer=layer)
        layer.objects.active = ground


CLASSES = (TETFLORA_OT_first_forest,)
