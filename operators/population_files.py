# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Populations written to files and read from them."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..tetflora_addon.blender import point_preview, population_files
from .base import Reporting, counted
from .populations import selected_grounds


class TETFLORA_OT_export_populations(Reporting, bpy.types.Operator, ExportHelper):
    """Write populations to a file."""

    bl_idname = "tetflora.export_populations"
    bl_label = "Export Populations"
    bl_description = (
        "Export the settings of the populations in this scene to a file, for use in other scenes. Plants are not "
        "exported"
    )
    bl_options = {'REGISTER'}

    filename_ext = population_files.ENDING
    filter_glob: StringProperty(default="*.json", options={'HIDDEN'})
    only_active: BoolProperty(name="Only Active", description="Export the active population only")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.tetflora.populations:
            cls.poll_message_set("Add a population first")
            return False
        return True

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.tetflora
        chosen = list(settings.populations)
        if self.only_active:
            chosen = chosen[settings.populations_index :][:1]
        path = population_files.write_populations(chosen, Path(bpy.path.abspath(self.filepath)))
        self.report({'INFO'}, f"{counted(len(chosen), 'population')} written to {path}")
        return {'FINISHED'}


class TETFLORA_OT_import_populations(Reporting, bpy.types.Operator, ImportHelper):
    """Add the populations of a file."""

    bl_idname = "tetflora.import_populations"
    bl_label = "Import Populations"
    bl_description = (
        "Import populations from a file, without plants; click Update for each. They grow on meshes with the names in "
        "the file, or else on the selected meshes"
    )
    bl_options = {'REGISTER', 'UNDO'}

    filename_ext = population_files.ENDING
    filter_glob: StringProperty(default="*.json", options={'HIDDEN'})

    def run(self, context: bpy.types.Context) -> set[str]:
        path = Path(bpy.path.abspath(self.filepath))
        number, missing = population_files.read_populations(context.scene, path, selected_grounds(context))
        point_preview.schedule()
        if missing:
            self.report(
                {'WARNING'},
                f"{counted(number, 'population')} added; missing in this file and left empty: {', '.join(missing)}",
            )
        else:
            self.report({'INFO'}, f"{counted(number, 'population')} added; click Update to place plants")
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_export_populations, TETFLORA_OT_import_populations)
