# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add one plant."""

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty, IntProperty

from ..tetflora_addon.blender.plant_objects import add_plants, plants_of
from ..tetflora_addon.blender.species_items import NO_SPECIES, default_species, operator_items
from ..tetflora_addon.planting.places import Placement, new_seeds
from .base import Reporting, in_object_mode, select_only


class TETFLORA_OT_add_plant(Reporting, bpy.types.Operator):
    """Add an empty that stands for a plant at the 3D cursor."""

    bl_idname = "tetflora.add_plant"
    bl_label = "Add Plant"
    bl_description = (
        "Add a plant at the 3D cursor. It is stored as an empty with a species and seed; Refine or rendering creates "
        "its branches and leaves"
    )
    bl_options = {'REGISTER', 'UNDO'}

    species: EnumProperty(name="Species", description="Species from the catalog", items=operator_items)
    seed: IntProperty(
        name="Seed",
        description="Individual of the species; random for each plant if not set",
        options={'SKIP_SAVE'},
    )
    location: FloatVectorProperty(
        name="Location",
        description="Base of the trunk in world space; the 3D cursor if not set",
        subtype='TRANSLATION',
        unit='LENGTH',
        options={'SKIP_SAVE'},
    )
    azimuth: FloatProperty(
        name="Azimuth", description="Rotation around the vertical axis", subtype='ANGLE', options={'SKIP_SAVE'}
    )
    scale: FloatProperty(
        name="Scale",
        description="Scale of the plant; 1 is the size in the species file",
        default=1.0,
        min=0.01,
        soft_max=4.0,
        options={'SKIP_SAVE'},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        properties = self.properties
        if not properties.is_property_set("location"):
            self.location = context.scene.cursor.location
        if not properties.is_property_set("seed"):
            # The n-th plant of a scene: another one each time, but the same when the script runs again.
            self.seed = int(new_seeds(np.array([len(plants_of(context.scene.objects))]))[0])
        species = default_species() if self.species in {"", NO_SPECIES} else self.species
        placement = Placement(
            position=np.array([self.location]),
            azimuth=np.array([self.azimuth]),
            scale=np.array([self.scale]),
            species=np.zeros(1, np.int32),
            seed=np.array([self.seed]),
            wanted=1,
        )
        select_only(context, add_plants(context.scene, placement, [species]))
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_add_plant,)
