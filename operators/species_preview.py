# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Switch the live preview of the edited species on and off."""

import bpy

from ..tetflora_addon.blender import species_preview
from .base import Reporting
from .species_edit import species_shown


class TETFLORA_OT_preview_species(Reporting, bpy.types.Operator):
    """Show one plant of the edited species."""

    bl_idname = "tetflora.preview_species"
    bl_label = "Preview Species"
    bl_description = (
        "Show one plant of the species at the 3D cursor, updated with every change. "
        "It is never rendered or saved. Use again to hide it"
    )
    # No undo: the preview is no part of the file.
    bl_options = {'REGISTER'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return species_preview.shown_in(context.scene) or species_shown(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        species_preview.show(context.scene, not species_preview.shown_in(context.scene))
        return {'FINISHED'}


CLASSES = (TETFLORA_OT_preview_species,)
