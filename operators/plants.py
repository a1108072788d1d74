# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Change, re-roll, select and remove plants, and drop them to the ground."""

from bpy.types import Context, Operator

from ..tetflora_addon.blender.biomes.layers import active_layer, children_of, forget_gone
from ..tetflora_addon.blender.declare import choice, once
from ..tetflora_addon.blender.placing import plant_objects
from ..tetflora_addon.blender.placing.ground import DropResult, drop_steps
from ..tetflora_addon.blender.placing.populations import own_number, own_objects
from ..tetflora_addon.blender.scene.fields import fields_of, stored_size
from ..tetflora_addon.blender.settings import SCATTER
from ..tetflora_addon.blender.species.catalog import NO_SPECIES, operator_items
from ..tetflora_addon.jobs import Job
from ..tetflora_addon.parameters import within
from .base import LINKED, ModalJob, Reporting, counted, in_object_mode, plants_or_fields_selected, selected_plants


class TETFLORA_OT_assign_species(Reporting, Operator, label="Change Species", needs=(plants_or_fields_selected,)):
    """Assign this species to all selected plants and to all plants of selected fields.

    Seeds, scales and positions do not change.
    """

    species: choice("Species", "Species from the catalog", operator_items)

    def run(self, context: Context) -> set[str]:
        if self.species in {"", NO_SPECIES}:
            return self.failed("Choose a species")
        changed = plant_objects.assign_species(selected_plants(context), self.species)
        fields = fields_of(context.selected_objects)
        changed += sum(stored_size(o) for o in fields if plant_objects.assign_field_species(o, self.species))
        return self.done(f"{counted(changed, 'plant')} changed")


class TETFLORA_OT_reseed(Reporting, Operator, label="Re-roll Seeds", needs=(plants_or_fields_selected,)):
    """Turn each selected plant, and each plant of selected fields, into a different individual of its species.

    Copies with the same seed become different.
    """

    roll: once.integer("Roll", "A different number gives different plants", **within(0, 100))

    def run(self, context: Context) -> set[str]:
        number = plant_objects.reseed(selected_plants(context), self.roll)
        fields = sorted((o for o in fields_of(context.selected_objects) if o.library is None), key=lambda o: o.name)
        for place, field in enumerate(fields):
            plant_objects.reseed_field(field, place, self.roll)
            number += stored_size(field)
        return self.done(f"{counted(number, 'plant')} re-rolled")


class TETFLORA_OT_select_plants(Reporting, Operator, label="Select Plants", needs=(in_object_mode,)):
    """Select all plants of the same species as the active plant, or those of the active layer."""

    species: once.string("Species", "Identifier of any species; that of the active plant if not set")
    layer: once.boolean("Of Layer", "Those of the active layer, or its fields")
    extend: once.boolean("Extend", "Extend the current selection")

    def run(self, context: Context) -> set[str]:
        if self.layer:
            layer, plants = active_layer(context.scene), []
            for one in () if layer is None else (layer, *children_of(layer)):
                plants += own_objects(context.scene, one) if one.kind == SCATTER else [one.field] if one.field else []
            if not plants:
                return self.refused("The layer has no plants; click Update")
        else:
            active = context.active_object
            if not self.species and (active is None or not active.tetflora.is_plant):
                return self.failed("The active object must be a plant; select one")
            self.species = self.species or active.tetflora.species
            every = plant_objects.plants_of(context.view_layer.objects)
            plants = [o for o in every if o.tetflora.species == self.species]
        if not self.extend:
            for obj in context.selected_objects:
                obj.select_set(False)
        for obj in set(plants) & set(context.view_layer.objects):
            obj.select_set(True)
        of = "" if self.layer else f' of species "{self.species}"'
        return self.done(f"{counted(len(plants), 'plant')}{of} selected")


class TETFLORA_OT_remove_plants(Reporting, Operator, label="Remove Plants", told="which", needs=(in_object_mode,)):
    """Delete plants from the scene."""

    which: choice(
        "Which",
        "Plants to remove",
        (
            ('SELECTED', "Selected", "Delete the selected plants; other selected objects stay"),
            ('SPECIES', "Species", "Delete all plants of one species in the scene"),
            ('ALL', "All", "Delete all plants in the scene"),
        ),
    )
    species: once.string("Species", "Identifier of the species to remove")

    def run(self, context: Context) -> set[str]:
        objects = context.selected_objects if self.which == 'SELECTED' else context.scene.objects
        every = plant_objects.plants_of(objects)
        plants = [o for o in every if self.which != 'SPECIES' or o.tetflora.species == self.species]
        fields = [] if self.which == 'SPECIES' else fields_of(objects)
        local = [o for o in (*plants, *fields) if o.library is None]
        if (plants or fields) and not local:
            return self.refused(f"{LINKED}; nothing removed")
        if not local:
            none = "Select plants first" if self.which == 'SELECTED' else "The scene has no plants"
            of = f' of species "{self.species}"' if self.which == 'SPECIES' else ""
            return self.refused(f"{none}{of}; nothing removed")
        number = plant_objects.remove_plants(plants) + plant_objects.remove_fields(fields)
        for layer in context.scene.tetflora.layers:  # some of its plants may be gone
            layer.made = own_number(own_objects(context.scene, layer))
        forget_gone(context.scene)
        return self.done(f"{counted(number, 'plant')} removed")


class TETFLORA_OT_drop_to_ground(
    ModalJob, Operator, label="Drop Plants to Ground", needs=(in_object_mode, plants_or_fields_selected)
):
    """Move the selected plants, and the plants of selected fields, vertically to the nearest visible mesh.

    Plants, results and refined meshes do not count as ground.
    """

    def steps(self, context: Context) -> Job[DropResult]:
        fields = [field for field in fields_of(context.selected_objects) if plant_objects.editable(field)]
        return drop_steps(context.scene, context.evaluated_depsgraph_get(), selected_plants(context), fields)

    def finish(self, context: Context, result: DropResult) -> set[str]:
        left = [field.name for field in fields_of(context.selected_objects) if not plant_objects.editable(field)]
        notes = [f"{counted(result.missed, 'plant')} had no ground below or above"] if result.missed else []
        if left:
            notes.append(f'"{left[0]}" was not moved: it has modifiers, or was not created by TetFlora')
        moves = f"{counted(result.moved, 'plant')} moved to the ground"
        done = self.done("; ".join([moves, *notes]), warns=notes)
        return done if result.moved else {'CANCELLED'}
