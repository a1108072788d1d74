# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make ordinary meshes of the selected plants."""

import bpy

from ..tetflora_addon.blender.plant_mesh import make_plant_meshes
from . import ids
from .base import Reporting, counted, in_object_mode, plants_selected, select_only, selected_plants


class TETFLORA_OT_make_plant_mesh(Reporting, bpy.types.Operator):
    """Turn the selected plants into meshes to edit, export and keep."""

    bl_idname = ids.MAKE_PLANT_MESH
    bl_label = "Make Plants Real Meshes"
    bl_description = (
        "Make an ordinary mesh object of each selected plant, with every branch and leaf, to edit, export or animate. "
        "The plant itself stays, disabled; Clear leaves the mesh alone"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context) and plants_selected(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        made = make_plant_meshes(context.scene, context.evaluated_depsgraph_get(), selected_plants(context))
        context.view_layer.update()
        select_only(context, made)
        polygons = sum(len(obj.data.polygons) for obj in made)
        self.report({'INFO'}, f"{counted(len(made), 'mesh object')} of {polygons:,} polygons made")
        return {'FINISHED'}
