# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make a curve or skeleton that the artist drew the form of plants."""

import bpy
import numpy as np

from ..tetflora_addon.blender.plant_form import FORM_TYPES, read_skeleton, upright_turn
from ..tetflora_addon.blender.plant_objects import add_plants, plants_of
from ..tetflora_addon.blender.species_edits import catalogue
from ..tetflora_addon.blender.species_items import default_species
from ..tetflora_addon.blender.species_values import present_species
from ..tetflora_addon.blender.transforms import world_matrix
from ..tetflora_addon.planting.places import Placement, new_seeds
from .base import Reporting, counted, in_object_mode, select_only, selected_plants


class TETFLORA_OT_use_as_form(Reporting, bpy.types.Operator):
    """Make the active curve or mesh of edges the form of the selected plants, or of a new one in its place."""

    bl_idname = "tetflora.use_as_form"
    bl_label = "Make Plant from Form"
    bl_description = (
        "Use the active curve, hair curves or mesh of edges as trunk and limbs of the selected plants or, if none is "
        "selected, of a new plant in its place; the species grows the rest. The form is no longer rendered"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not in_object_mode(cls, context):
            return False
        if context.active_object is not None and context.active_object.type in FORM_TYPES:
            return True
        cls.poll_message_set("The active object must be a curve, hair curves or a mesh of edges; select it last")
        return False

    def run(self, context: bpy.types.Context) -> set[str]:
        form, depsgraph = context.active_object, context.evaluated_depsgraph_get()
        skeleton = read_skeleton(form, depsgraph)  # refuses what cannot be one before anything changes
        plants = selected_plants(context)
        if not plants:
            plants = add_plants(context.scene, _in_place_of(form, context.scene, depsgraph), [_species(context.scene)])
        height = float(skeleton.points[:, 2].max())
        for plant in plants:
            plant.tetflora.form = form
            if plant.type == 'EMPTY' and height > 0.0:
                plant.empty_display_size = height  # the arrow was as tall as the species grows by itself
        form.hide_render = True
        select_only(context, plants)
        made = f"{counted(len(skeleton.points), 'point')} drawn"
        self.report({'INFO'}, f'"{form.name}" is now the form of {counted(len(plants), "plant")}: {made}')
        return {'FINISHED'}


def _in_place_of(form: bpy.types.Object, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Placement:
    matrix = world_matrix(form, depsgraph)
    return Placement(
        position=matrix[None, :3, 3],
        azimuth=np.array([upright_turn(matrix)]),
        scale=np.ones(1),
        species=np.zeros(1, np.int32),
        seed=new_seeds(np.array([len(plants_of(scene.objects))])),
        wanted=1,
    )


def _species(scene: bpy.types.Scene) -> str:
    """The species that the editor shows."""
    present = present_species(scene.tetflora.species_editor)
    return present if present in catalogue() else default_species()


CLASSES = (TETFLORA_OT_use_as_form,)
