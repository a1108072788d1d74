# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write files for others: the plants of a scene for other programs, and a report of a fault."""

from bpy.props import StringProperty
from bpy.types import Context, Event, Operator
from bpy_extras.io_utils import ExportHelper

from ..tetflora_addon.blender.declare import once
from ..tetflora_addon.blender.export import forest
from ..tetflora_addon.blender.report import report_text
from ..tetflora_addon.errors import TetFloraError
from ..tetflora_addon.files import write_whole
from ..tetflora_addon.jobs import Job
from ..tetflora_addon.parameters import within
from .base import FileJob, FileTool, counted, in_object_mode


class TETFLORA_OT_export_forest(
    FileJob, Operator, ExportHelper, label="Export Forest", needs=(in_object_mode,), options={'REGISTER'}
):
    """Write all plants that render as instances of a few, in levels of detail, for other renderers and engines.

    Import Tree Inventory reads them back from USD as they were.
    """

    browse = ExportHelper.invoke
    cancelled = "Cancelled; nothing was written"
    filter_glob: StringProperty(default=";".join(f"*{ending}" for ending in forest.WRITERS), options={'HIDDEN'})
    format: once.choice("Format", "What the file is for, if its name has no ending", forest.FORMATS)
    variants: once.integer(
        "Variants",
        "Plants of each species that stand for all others. No two plants are alike where there are no more than that",
        8,
        **within(1, 64, forest.MOST_VARIANTS),
    )
    levels: once.integer(
        "Levels", "Levels of detail with the full plant; 0: what suits each species", **within(0, high=forest.LEVELS)
    )
    polygons: once.integer(
        "Max Polygons", "Leave out levels with more polygons than this; 0 for none", **within(0, 1_000_000, 100_000_000)
    )
    bake: once.boolean("Bake Materials", "Bake veins, bark and relief with Cycles, not only colors and outlines", True)

    @property
    def filename_ext(self) -> str:
        """What is added to names without an ending."""
        return self.format

    def steps(self, context: Context) -> Job[forest.Exported]:
        path = self.path if self.path.suffix else self.path.with_suffix(self.format)
        order = forest.ExportOrder(path, self.variants, self.levels, self.polygons, self.bake)
        return forest.export_steps(context.scene, context.evaluated_depsgraph_get(), order)

    def finish(self, context: Context, result: forest.Exported) -> set[str]:
        counts = f"{counted(result.plants, 'plant')} as {counted(result.variants, 'variant')}"
        told = [f"{counts} written to {result.path}, {result.megabytes:,.1f} MB", *result.problems]
        return self.done(". ".join(told), warns=result.problems)


class TETFLORA_OT_write_report(FileTool, Operator, ExportHelper, label="Write Report", options={'REGISTER'}):
    """Write versions, cores, memory, settings and the last error to a text file, to report a fault with.

    Nothing of the scene is in it, and no names or folders.
    """

    filename_ext = ".txt"
    filter_glob: StringProperty(default="*.txt", options={'HIDDEN'})

    def invoke(self, context: Context, event: Event) -> set[str]:
        self.filepath = self.filepath or "tetflora_report.txt"
        return super().invoke(context, event)

    def run(self, context: Context) -> set[str]:
        path = self.path
        try:
            write_whole(path, report_text(context.scene))
        except OSError as error:
            raise TetFloraError(f"Cannot write {path}: {error.strerror}. Choose another folder") from None
        return self.done(f"Written to {path}; look through it before you send it")
