# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Edit species and their orders, keep them as files, preview them, and write the catalog as an asset library."""

import copy
from pathlib import Path

import bpy
from bpy.props import BoolProperty
from bpy.types import Operator
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..tetflora_addon import storage
from ..tetflora_addon.assets import asset_cache
from ..tetflora_addon.blender.biomes import library
from ..tetflora_addon.blender.declare import choice, once, string
from ..tetflora_addon.blender.placing.assets import add_to_preferences, write_asset_library
from ..tetflora_addon.blender.placing.plant_objects import assign_species
from ..tetflora_addon.blender.species import edits
from ..tetflora_addon.blender.species.catalog import OWN_FILES, load_species_file, save_species, write_species
from ..tetflora_addon.blender.species.editor import orders_of, present_species
from ..tetflora_addon.species.catalog import DEFAULT_SPUR
from ..tetflora_addon.species.skeletons import MAX_ORDERS
from .base import FileTool, Reporting, counted, need, selected_plants


def shown(context: bpy.types.Context) -> str:
    """Identifier of the species that the editor shows."""
    return present_species(context.scene.tetflora.species_editor)


species_shown = need(lambda context: shown(context) in edits.catalog(), "Choose a species from the catalog first")


class TETFLORA_OT_duplicate_species(Reporting, Operator, label="Duplicate as New Species", needs=(species_shown,)):
    """Duplicate the shown species. The copy belongs to this file until you save it to your species."""

    name: once.string("Name", "Name of the new species; the old name with a number if empty")
    assign: once.boolean("Assign to Selected Plants", "Assign the new species to the selected plants")

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if not self.name:
            self.name = self._suggestion(context)
        return context.window_manager.invoke_props_dialog(self)

    def run(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        editor = scene.tetflora.species_editor
        data = copy.deepcopy(edits.species_data(scene, present_species(editor)))
        data["name"] = self.name.strip() or self._suggestion(context)
        identifier = edits.new_identifier(data["name"], edits.catalog().__contains__)
        edits.store_species(scene, identifier, data)
        editor.species = identifier
        changed = assign_species(selected_plants(context), identifier) if self.assign else 0
        given = f", assigned to {counted(changed, 'plant')}" if self.assign else ""
        return self.done(f'New species "{data["name"]}" ({identifier}){given}')

    @staticmethod
    def _suggestion(context: bpy.types.Context) -> str:
        known = edits.catalog()
        old = known[shown(context)].name
        names = {info.name for info in known.values()}
        return next(name for n in range(2, len(names) + 3) if (name := f"{old} {n}") not in names)


_edited = need(lambda context: edits.find_edit(context.scene, shown(context)), "The species has no changes to revert")


class TETFLORA_OT_revert_species(Reporting, Operator, label="Revert", needs=(_edited,)):
    """Discard the changes in this file and restore the species from the catalog.

    Deletes a species that exists only in this file.
    """

    def run(self, context: bpy.types.Context) -> set[str]:
        editor = context.scene.tetflora.species_editor
        identifier = present_species(editor)
        edits.revert_species(identifier)
        if identifier in edits.catalog():
            return self.done(f'"{identifier}" reverted to the catalog')
        editor.species = ""
        return self.done(f'Species "{identifier}" removed from this file')


class TETFLORA_OT_edit_orders(Reporting, Operator, label="Edit Orders", told="action", needs=(species_shown,)):
    """Add or remove an order of branches or the short shoots of the species."""

    action: choice(
        "Action",
        "Change to make",
        (
            ('ADD', "Add", "Add an order with three branches on each branch of the last order, half as long"),
            ('REMOVE', "Remove", "Remove the last order and its branches"),
            ('SPUR', "Short Shoots", "Add or remove short shoots with blossoms, fruit or leaves"),
        ),
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        editor = scene.tetflora.species_editor
        number = len(orders_of(editor))
        if not number:
            return self.refused("The species has orders that cannot be read; revert it first")
        if self.action == 'SPUR':
            edits.change_species(scene, present_species(editor), _toggle_spur)
            return {'FINISHED'}
        if self.action == 'ADD' and number >= MAX_ORDERS:
            return self.refused(f"A species cannot have more than {MAX_ORDERS} orders")
        if self.action == 'REMOVE' and number < 2:
            return self.refused("The trunk cannot be removed: a species has at least one order")
        edits.change_species(scene, present_species(editor), _add if self.action == 'ADD' else _remove)
        editor.order_index = number if self.action == 'ADD' else min(editor.order_index, number - 2)
        return {'FINISHED'}


def _add(data: dict) -> None:
    orders = data["orders"]
    order = copy.deepcopy(orders[-1])
    orders[-1]["branches"] = [3, 1]
    order |= {"length": [0.5, 0.1], "thickness": [0.5, 0.1], "angle": [45, 15], "branches": [0, 0]}
    order.pop("angle_tip", None)
    orders.append(order)


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


class TETFLORA_OT_save_species(
    Reporting, Operator, label="Save to My Species", needs=(species_shown,), options={'REGISTER'}
):
    """Save the species to your species folder, for use in all files.

    It replaces a built-in species of the same identifier, and an earlier version of your own.
    """

    def run(self, context: bpy.types.Context) -> set[str]:
        return self.done(f"Saved as {save_species(context.scene, shown(context))}")


class TETFLORA_OT_load_species(FileTool, Operator, ImportHelper, label="Load Species"):
    """Copy a species file to your species folder, to use it in all files."""

    replace: once.boolean("Replace", "Replace your own species of the same file name")

    def run(self, context: bpy.types.Context) -> set[str]:
        identifier = load_species_file(self.path, self.replace)
        context.scene.tetflora.species_editor.species = identifier
        return self.done(f'Species "{edits.catalog()[identifier].name}" loaded')


class TETFLORA_OT_export_species(
    FileTool, Operator, ExportHelper, label="Export Species", needs=(species_shown,), options={'REGISTER'}
):
    """Export the species to a file, to share it. The file name is the identifier of the species."""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.filepath:
            self.filepath = shown(context) + self.filename_ext
        return super().invoke(context, event)

    def run(self, context: bpy.types.Context) -> set[str]:
        return self.done(f"Written to {write_species(context.scene, shown(context), self.path)}")


class TETFLORA_OT_delete_file(Reporting, Operator, label="Delete from My Files", told="cache", options={'REGISTER'}):
    """Delete the file of the shown species, or of the chosen biome, from your folder. Built-in ones remain. This cannot
    be undone.
    """

    biome: once.boolean("Biome", "A biome instead of a species")
    identifier: once.string("File", "Name of the file without its ending; the shown species or chosen biome if empty")
    cache: once.boolean("Cache", "Delete all cached species analysis; it is computed again when needed")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self.execute(context) if self.cache else context.window_manager.invoke_confirm(self, event)

    def run(self, context: bpy.types.Context) -> set[str]:
        if self.cache:
            if storage.current_folder() is None:
                return self.refused("The cache folder does not exist")
            number = storage.clear() + asset_cache.clear()
            return self.done(f"{counted(number, 'file')} deleted from {storage.current_folder()}")
        chosen = self.identifier or (context.scene.tetflora.new_biome if self.biome else shown(context))
        return self.done(f"{(library.OWN_FILES if self.biome else OWN_FILES).delete(chosen).name} deleted")


class TETFLORA_OT_create_asset_library(Reporting, Operator, label="Create Asset Library", options={'REGISTER'}):
    """Create a file with one plant of each species, marked as assets with previews, in a folder of your choice.

    Assets refer to species by name: using them requires TetFlora and the same species.
    """

    directory: string("Folder", "Folder of the library", subtype='DIR_PATH')
    filter_folder: BoolProperty(default=True, options={'HIDDEN', 'SKIP_SAVE'})
    add_library: once.boolean("Add to Asset Libraries", "Add the folder to Preferences > File Paths > Asset Libraries")

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {'RUNNING_MODAL'}

    def run(self, _context: bpy.types.Context) -> set[str]:
        if not self.directory:
            return self.failed("Choose a folder")
        path, number = write_asset_library(Path(bpy.path.abspath(self.directory)))
        shown = self.add_library and add_to_preferences(path.parent)
        more = "; folder added to the asset libraries" if shown else ""
        return self.done(f"{counted(number, 'plant')} written to {path}{more}")
