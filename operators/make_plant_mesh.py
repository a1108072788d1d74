# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make ordinary meshes of the selected plants."""

from collections.abc import Generator

import bpy

from ..tetflora_addon.blender.plant_mesh import make_plant_mesh_steps
from ..tetflora_addon.refinement.statistics import Progress
from .base import counted, in_object_mode, plants_selected, select_only, selected_plants
from .modal_job import ModalJob


class TETFLORA_OT_make_plant_mesh(ModalJob, bpy.types.Operator):
    """Turn the selected plants into meshes to edit, export and keep."""

    bl_idname = "tetflora.make_plant_mesh"
    bl_label = "Convert Plants to Meshes"
    bl_description = (
        "Create an ordinary mesh object of each selected plant, with every branch and leaf, to edit, export or "
        "animate. The plant remains, but disabled; Clear does not remove the mesh. Esc cancels without changes"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context) and plants_selected(cls, context)

    def steps(self, context: bpy.types.Context) -> Generator[Progress, bool | None, list[bpy.types.Object]]:
        return make_plant_mesh_steps(context.scene, context.evaluated_depsgraph_get(), selected_plants(context))

    def finish(self, context: bpy.types.Context, made: list[bpy.types.Object]) -> set[str]:
        context.view_layer.update()
        select_only(context, made)
        polygons = sum(len(obj.data.polygons) for obj in made)
        self.report({'INFO'}, f"{counted(len(made), 'mesh object')} of {polygons:,} polygons made")
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_make_plant_mesh,)
