# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the catalogue as an asset library."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ..tetflora_addon.blender.asset_library import add_to_preferences, write_asset_library
from .base import Reporting, counted


class TETFLORA_OT_create_asset_library(Reporting, bpy.types.Operator):
    """Write a .blend with a plant of each species, to drag into scenes."""

    bl_idname = "tetflora.create_asset_library"
    bl_label = "Create Asset Library"
    bl_description = (
        "Create a file with one plant of each species, marked as assets with previews, in a folder of your choice. "
        "Assets refer to species by name: using them requires TetFlora and the same species"
    )
    bl_options = {'REGISTER'}

    directory: StringProperty(name="Folder", description="Folder of the library", subtype='DIR_PATH')
    filter_folder: BoolProperty(default=True, options={'HIDDEN', 'SKIP_SAVE'})
    add_library: BoolProperty(
        name="Add to Asset Libraries",
        description="Add the folder to Preferences > File Paths > Asset Libraries",
        default=False,
        options={'SKIP_SAVE'},
    )

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {'RUNNING_MODAL'}

    def run(self, _context: bpy.types.Context) -> set[str]:
        if not self.directory:
            self.report({'ERROR'}, "Choose a folder")
            return {'CANCELLED'}
        path, number = write_asset_library(Path(bpy.path.abspath(self.directory)))
        shown = self.add_library and add_to_preferences(path.parent)
        more = "; folder added to the asset libraries" if shown else ""
        self.report({'INFO'}, f"{counted(number, 'plant')} written to {path}{more}")
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_create_asset_library,)
