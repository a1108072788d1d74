# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make a new species of the shown one, take edits back, add and remove orders."""

import copy

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ..tetflora_addon.blender.plant_objects import assign_species
from ..tetflora_addon.blender.species_edits import (
    catalogue,
    change_species,
    find_edit,
    new_identifier,
    revert_species,
    species_data,
    store_species,
)
from ..tetflora_addon.blender.species_values import orders_of, present_species
from ..tetflora_addon.plants.schema import DEFAULT_SPUR
from ..tetflora_addon.plants.skeletons import MAX_ORDERS
from .base import Reporting, counted, selected_plants


def species_shown(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Poll: the editor shows a species that this user or this file has."""
    if present_species(context.scene.tetflora.species_editor) in catalogue():
        return True
    cls.poll_message_set("Choose a species from the catalog first")
    return False


class TETFLORA_OT_duplicate_species(Reporting, bpy.types.Operator):
    """Make a new species in this file."""

    bl_idname = "tetflora.duplicate_species"
    bl_label = "Duplicate as New Species"
    bl_description = "Duplicate the shown species. The copy belongs to this file until you save it to your species"
    bl_options = {'REGISTER', 'UNDO'}

    name: StringProperty(
        name="Name",
        description="Name of the new species; the old name with a number if empty",
        options={'SKIP_SAVE'},
    )
    assign: BoolProperty(
        name="Assign to Selected Plants",
        description="Assign the new species to the selected plants",
        options={'SKIP_SAVE'},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return species_shown(cls, context)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if not self.name:
            self.name = self._suggestion(context)
        return context.window_manager.invoke_props_dialog(self)

    def run(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        editor = scene.tetflora.species_editor
        data = copy.deepcopy(species_data(scene, present_species(editor)))
        data["name"] = self.name.strip() or self._suggestion(context)
        known = catalogue()
        identifier = new_identifier(data["name"], known.__contains__)
        store_species(scene, identifier, data)
        editor.species = identifier
        changed = assign_species(selected_plants(context), identifier) if self.assign else 0
        given = f", assigned to {counted(changed, 'plant')}" if self.assign else ""
        self.report({'INFO'}, f'New species "{data["name"]}" ({identifier}){given}')
        return {'FINISHED'}

    @staticmethod
    def _suggestion(context: bpy.types.Context) -> str:
        known = catalogue()
        old = known[present_species(context.scene.tetflora.species_editor)].name
        names = {info.name for info in known.values()}
        return next(name for n in range(2, len(names) + 3) if (name := f"{old} {n}") not in names)


class TETFLORA_OT_revert_species(Reporting, bpy.types.Operator):
    """Forget the edits of a species."""

    bl_idname = "tetflora.revert_species"
    bl_label = "Revert"
    bl_description = (
        "Discard the changes in this file and restore the species from the catalog. Deletes a species that exists "
        "only in this file"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if find_edit(context.scene, present_species(context.scene.tetflora.species_editor)) is None:
            cls.poll_message_set("The species has no changes to revert")
            return False
        return True

    def run(self, context: bpy.types.Context) -> set[str]:
        editor = context.scene.tetflora.species_editor
        identifier = present_species(editor)
        revert_species(identifier)
        if identifier in catalogue():
            self.report({'INFO'}, f'"{identifier}" reverted to the catalog')
        else:
            editor.species = ""
            self.report({'INFO'}, f'Species "{identifier}" removed from this file')
        return {'FINISHED'}


class TETFLORA_OT_edit_orders(Reporting, bpy.types.Operator):
    """Add an order of branches to the species, or remove the last one."""

    bl_idname = "tetflora.edit_orders"
    bl_label = "Edit Orders"
    bl_options = {'REGISTER', 'UNDO'}

    action: EnumProperty(
        name="Action",
        description="Change to make",
        items=(
            ('ADD', "Add", "Add an order with three branches on each branch of the last order, half as long"),
            ('REMOVE', "Remove", "Remove the last order and its branches"),
            ('SPUR', "Short Shoots", "Add or remove short shoots with blossoms, fruit or leaves"),
        ),
    )

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return properties.bl_rna.properties["action"].enum_items[properties.action].description

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return species_shown(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        editor = scene.tetflora.species_editor
        number = len(orders_of(editor))
        if self.action == 'SPUR':
            change_species(scene, present_species(editor), _toggle_spur)
            return {'FINISHED'}
        if self.action == 'ADD' and not 0 < number < MAX_ORDERS:
            self.report({'WARNING'}, f"A species cannot have more than {MAX_ORDERS} orders")
            return {'CANCELLED'}
        if self.action == 'REMOVE' and number < 2:
            self.report({'WARNING'}, "The trunk cannot be removed: a species has at least one order")
            return {'CANCELLED'}
        change_species(scene, present_species(editor), _add if self.action == 'ADD' else _remove)
        editor.order_index = number if self.action == 'ADD' else min(editor.order_index, number - 2)
        return {'FINISHED'}


def _add(data: dict) -> None:
    orders = data["orders"]
    made = copy.deepcopy(orders[-1])
    orders[-1]["branches"] = [3, 1]
    made |= {"length": [0.5, 0.1], "thickness": [0.5, 0.1], "angle": [45, 15], "branches": [0, 0]}
    made.pop("angle_tip", None)
    orders.append(made)


def _toggle_spur(data: dict) -> None:
    if "spur" in data:
        del data["spur"]
        for order in data["orders"]:
            order.pop("spurs", None)
        return
    kind = {"leaf_kind": "blossom"} if "blossom" in data else {}
    data["spur"] = {**DEFAULT_SPUR, **kind}
    data["orders"][-1]["spurs"] = [3, 1]


def _remove(data: dict) -> None:
    data["orders"].pop()
    data["orders"][-1]["branches"] = [0, 0]


CLASSES = (TETFLORA_OT_duplicate_species, TETFLORA_OT_revert_species, TETFLORA_OT_edit_orders)
