# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write a report of a fault."""

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from ..tetflora_addon.blender.report import report_text
from ..tetflora_addon.errors import TetFloraError
from ..tetflora_addon.files import write_whole
from .base import FileTool


class TETFLORA_OT_write_report(FileTool, bpy.types.Operator, ExportHelper):
    """Write versions, cores, memory, settings and the last error to a text file, to report a fault with.

    Nothing of the scene is in it, and no names or folders.
    """

    bl_label = "Write Report"
    bl_options = {'REGISTER'}

    filename_ext = ".txt"
    filter_glob: StringProperty(default="*.txt", options={'HIDDEN'})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.filepath = self.filepath or "tetflora_report.txt"
        return super().invoke(context, event)

    def run(self, context: bpy.types.Context) -> set[str]:
        path = self.path
        try:
            write_whole(path, report_text(context.scene))
        except OSError as error:
            raise TetFloraError(f"Cannot write {path}: {error.strerror}. Choose another folder") from None
        return self.done(f"Written to {path}; look through it before you send it")
