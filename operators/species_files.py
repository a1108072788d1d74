# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species as presets: save, load, share and delete their files."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..tetflora_addon.blender import species_files
from ..tetflora_addon.blender.species_edits import catalogue
from ..tetflora_addon.blender.species_values import present_species
from .base import Reporting
from .species_edit import species_shown


class TETFLORA_OT_save_species(Reporting, bpy.types.Operator):
    """Save the shown species for all files."""

    bl_idname = "tetflora.save_species"
    bl_label = "Save to My Species"
    bl_description = (
        "Save the species to your species folder, for use in all files. It replaces a built-in species of the same "
        "identifier, and an earlier version of your own"
    )
    bl_options = {'REGISTER'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return species_shown(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        path = species_files.save_species(context.scene, present_species(context.scene.tetflora.species_editor))
        self.report({'INFO'}, f"Saved as {path}")
        return {'FINISHED'}


class TETFLORA_OT_load_species(Reporting, bpy.types.Operator, ImportHelper):
    """Take a species file into the user's own species."""

    bl_idname = "tetflora.load_species"
    bl_label = "Load Species"
    bl_description = "Copy a species file to your species folder, to use it in all files"
    bl_options = {'REGISTER', 'UNDO'}

    filename_ext = species_files.ENDING
    filter_glob: StringProperty(default="*.json", options={'HIDDEN'})
    replace: BoolProperty(
        name="Replace", description="Replace your own species of the same file name", options={'SKIP_SAVE'}
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        identifier = species_files.load_species_file(Path(bpy.path.abspath(self.filepath)), self.replace)
        context.scene.tetflora.species_editor.species = identifier
        self.report({'INFO'}, f'Species "{catalogue()[identifier].name}" loaded')
        return {'FINISHED'}


class TETFLORA_OT_export_species(Reporting, bpy.types.Operator, ExportHelper):
    """Write the shown species to a file of the artist's choice."""

    bl_idname = "tetflora.export_species"
    bl_label = "Export Species"
    bl_description = "Export the species to a file, to share it. The file name is the identifier of the species"
    bl_options = {'REGISTER'}

    filename_ext = species_files.ENDING
    filter_glob: StringProperty(default="*.json", options={'HIDDEN'})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return species_shown(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.filepath:
            self.filepath = present_species(context.scene.tetflora.species_editor) + self.filename_ext
        return super().invoke(context, event)

    def run(self, context: bpy.types.Context) -> set[str]:
        identifier = present_species(context.scene.tetflora.species_editor)
        path = Path(bpy.path.abspath(self.filepath))
        self.report({'INFO'}, f"Written to {species_files.write_species(context.scene, identifier, path)}")
        return {'FINISHED'}


class TETFLORA_OT_delete_species(Reporting, bpy.types.Operator):
    """Delete a species file of the user's own."""

    bl_idname = "tetflora.delete_species"
    bl_label = "Delete from My Species"
    bl_description = (
        "Delete the file of the species from your species folder. Built-in species remain. This cannot be undone"
    )
    bl_options = {'REGISTER'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if species_files.own_file(present_species(context.scene.tetflora.species_editor)) is None:
            cls.poll_message_set("The species has no file in your species folder")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_confirm(self, event)

    def run(self, context: bpy.types.Context) -> set[str]:
        path = species_files.delete_species_file(present_species(context.scene.tetflora.species_editor))
        self.report({'INFO'}, f"{path.name} deleted")
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_save_species, TETFLORA_OT_load_species, TETFLORA_OT_export_species, TETFLORA_OT_delete_species)
