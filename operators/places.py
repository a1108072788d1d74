# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Import real places: terrain, trees that were measured or seen from above, and outlines of a map."""

from collections.abc import Generator
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ..tetflora_addon.blender.places.columns import (
    TetFloraInventoryColumn,
    chosen_columns,
    columns_in,
    show_columns,
)
from ..tetflora_addon.blender.places.origin import EXISTING, MIDDLE, WHOLE
from ..tetflora_addon.blender.places.outlines import Drawn, outline_steps, told
from ..tetflora_addon.blender.places.rasters import PATTERN
from ..tetflora_addon.blender.places.terrain import ImportedGround, terrain_steps
from ..tetflora_addon.blender.places.trees import GENERIC, LEFT_OUT, Planted, canopy_steps, inventory_steps
from ..tetflora_addon.blender.species.catalogue import NO_SPECIES, operator_items
from ..tetflora_addon.errors import TetFloraError, readable
from ..tetflora_addon.jobs import Progress
from ..tetflora_addon.places.inventories import IMPERIAL, METRIC
from ..tetflora_addon.places.species_names import told as names_told
from .add import mix_in, parse_weights
from .base import ModalJob, counted, in_object_mode, select_only
from .populations import selected_grounds

_UNLINKED = {'SKIP_SAVE'}


class _Importing(ModalJob, ImportHelper):
    """Mix-in for operators that import a place from a file."""

    needs = (in_object_mode,)

    code: IntProperty(
        name="Coordinate System",
        description=(
            "EPSG code of the coordinates in the file: 4326 for longitude and latitude, 326xx and 327xx for UTM, 3857 "
            "for Web Mercator. 0 uses what the file says"
        ),
        default=0,
        min=0,
        max=999_999,
        options=_UNLINKED,
    )
    new_origin: BoolProperty(
        name="New Origin",
        description=(
            "Put the middle of this file at the world origin. Otherwise it lies where it is in relation to what was "
            "imported before"
        ),
        options=_UNLINKED,
    )

    chosen: BoolProperty(options={'HIDDEN', 'SKIP_SAVE'})

    _browsing = False

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.chosen:
            return ModalJob.invoke(self, context, event)
        self._browsing = True
        return ImportHelper.invoke(self, context, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._browsing or bpy.app.background:
            return ModalJob.execute(self, context)
        # Blender frees what the file browser has called: the steps are those of another call, with its undo step.
        again = getattr(bpy.ops.tetflora, type(self).bl_idname.partition(".")[2])
        # A menu of species that was never opened has an empty value, which is none of its items.
        settings = {name: value for name, value in self.as_keywords().items() if value != ""}
        try:
            again('INVOKE_DEFAULT', **{**settings, "chosen": True})
        except RuntimeError as error:  # what that call reported, which must not end as a traceback
            return self.failed(str(error).strip().removeprefix("Error: "))
        return {'CANCELLED'}

    @property
    def path(self) -> Path:
        """The chosen file."""
        return Path(bpy.path.abspath(self.filepath))


class _Raster(_Importing):
    """Mix-in for those that read rasters."""

    filter_glob: StringProperty(default=PATTERN, options={'HIDDEN'})
    factor: FloatProperty(
        name="Meters per Value",
        description="Factor on the values of the file: 0.3048 for feet, 0.1 for decimeters",
        default=1.0,
        min=1e-6,
        soft_max=10.0,
        max=1e6,
        precision=4,
        options=_UNLINKED,
    )
    shift: FloatProperty(
        name="Height of 0",
        description="What is added to all values, meters",
        default=0.0,
        min=-20_000.0,
        max=20_000.0,
        unit='LENGTH',
        options=_UNLINKED,
    )


class TETFLORA_OT_import_terrain(_Raster, bpy.types.Operator):
    """Make ground from a raster of elevations: an ASCII grid, a GeoTIFF or a PNG with a world file."""

    bl_label = "Import Terrain"

    most: IntProperty(
        name="Most Faces",
        description="Number of faces at most; a finer raster is averaged in blocks",
        default=500_000,
        min=100,
        soft_max=4_000_000,
        max=20_000_000,
        options=_UNLINKED,
    )

    def steps(self, context: bpy.types.Context) -> Generator[Progress, Any, ImportedGround]:
        return terrain_steps(context.scene, self.path, self.most, self.code, self.factor, self.shift, self.new_origin)

    def finish(self, context: bpy.types.Context, result: ImportedGround) -> set[str]:
        select_only(context, [result.object])
        faces = counted(len(result.object.data.polygons), "face")
        coarser = "; the file is finer, see Most Faces" if result.coarser else ""
        return self.done(f'Ground "{result.object.name}" of {faces}, one every {result.step:.2f} m{coarser}')


class _Trees(_Importing):
    """Mix-in for those that make fields of trees."""

    def finish(self, context: bpy.types.Context, result: Planted) -> set[str]:
        select_only(context, [result.object])
        parts = [f"{counted(result.number, 'tree')} imported"]
        inventory = result.inventory
        if inventory is not None and inventory.left_out:
            parts.append(f"rows without a tree left out: {names_told(inventory.left_out)}")
        if result.completed:
            parts.append(f"heights of {result.completed:,} follow from trunk or crown")
        if result.beside:
            parts.append(f"{result.beside:,} stand beside the ground")
        if result.kin:
            parts.append(f"{result.kin.total():,} stand as their nearest kin: {names_told(result.kin)}")
        parts += result.notes
        if inventory is not None and inventory.skipped:
            parts.append(f"{counted(inventory.skipped, 'broken row')} skipped, the first: {inventory.first}")
        if result.unknown:
            left = " and left out" if result.left_out else ""
            parts.insert(1, f"{result.unknown.total():,} of unknown species{left}: {names_told(result.unknown, 25)}")
        text = readable("; ".join(parts))
        if not result.unknown and not (inventory is not None and inventory.skipped):
            return self.done(text)
        self.report({'WARNING'}, text)
        return {'FINISHED'}


class TETFLORA_OT_import_inventory(_Trees, bpy.types.Operator):
    """Make a field of the trees of an inventory, CSV or GeoJSON: species, place and sizes of each.

    They stand on the selected meshes, or on imported terrain.
    """

    bl_label = "Import Tree Inventory"

    filter_glob: StringProperty(default="*.csv;*.tsv;*.txt;*.geojson;*.json", options={'HIDDEN'})
    units: EnumProperty(
        name="Units",
        description="Units of columns that do not name theirs",
        items=(
            (METRIC, "Metric", "Meters; trunks in centimeters, unless they are too thin for that"),
            (IMPERIAL, "Imperial", "Feet; trunks in inches"),
        ),
        default=METRIC,
        options=_UNLINKED,
    )
    unknown: EnumProperty(
        name="Unknown Species",
        description="What stands for trees whose species is not known here",
        items=(
            (GENERIC, "Generic Tree", "A conifer where the name tells that it is one, else a broadleaf tree"),
            ('SPECIES', "Species", "The species below"),
            (LEFT_OUT, "Leave Out", "No tree"),
        ),
        default=GENERIC,
        options=_UNLINKED,
    )
    species: EnumProperty(
        name="Species", description="Species that stands for unknown ones", items=operator_items, options=_UNLINKED
    )
    skip: BoolProperty(
        name="Skip Broken Rows",
        description="Leave out rows with values that cannot be, instead of refusing the file",
        options=_UNLINKED,
    )

    columns: StringProperty(
        name="Columns",
        description=(
            "JSON object of what columns hold, for those whose titles and values do not tell it: "
            '{"Hoogte dm": "height", "X1": "crown_width ft", "X2": ""}'
        ),
        options=_UNLINKED,
    )
    crop: EnumProperty(
        name="Crop",
        description="What to leave out of a large area",
        items=(
            (WHOLE, "Nothing", "All of the file"),
            (MIDDLE, "To Its Middle", "A square around the middle"),
            (EXISTING, "To the Scene", "The selected meshes or imported terrain, or else all that the scene has"),
        ),
        default=WHOLE,
        options=_UNLINKED,
    )
    crop_size: FloatProperty(
        name="Side",
        description="Side of the square",
        default=2000.0,
        min=1.0,
        soft_max=20_000.0,
        max=500_000.0,
        unit='LENGTH',
        options=_UNLINKED,
    )
    table: CollectionProperty(type=TetFloraInventoryColumn, options={'HIDDEN', 'SKIP_SAVE'})
    active: IntProperty(options={'HIDDEN', 'SKIP_SAVE'})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.chosen or self.columns:
            return super().invoke(context, event)
        try:
            show_columns(self.table, self.path)
        except (OSError, TetFloraError) as error:
            return self.failed(str(error))
        self._browsing = True
        return context.window_manager.invoke_props_dialog(self, width=720, title="Columns of the Inventory")

    def as_keywords(self, *, ignore: tuple[str, ...] = ()) -> dict[str, Any]:
        """Settings of another call, which takes columns as the table has them."""
        found = super().as_keywords(ignore=(*ignore, "table", "active"))
        return found | ({"columns": chosen_columns(self.table)} if self.table else {})

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        if self.table:
            rows = min(max(len(self.table), 4), 16)
            layout.template_list(
                "TETFLORA_UL_inventory_columns", "", self, "table", self, "active", rows=rows, maxrows=rows
            )
        layout.use_property_split = True
        for name in ("units", "unknown", "species", "skip", "code", "new_origin", "crop", "crop_size"):
            if (name != "species" or self.unknown == 'SPECIES') and (name != "crop_size" or self.crop == MIDDLE):
                layout.prop(self, name)

    def steps(self, context: bpy.types.Context) -> Generator[Progress, Any, Planted]:
        chosen = self.species if self.unknown == 'SPECIES' and self.species != NO_SPECIES else self.unknown
        return inventory_steps(
            context.scene,
            context.evaluated_depsgraph_get(),
            self.path,
            selected_grounds(context),
            chosen,
            self.code,
            self.units,
            self.skip,
            self.new_origin,
            columns=columns_in(self.columns),
            crop=(self.crop, self.crop_size),
        )


class TETFLORA_OT_import_canopy(_Raster, _Trees, bpy.types.Operator):
    """Make a field of the trees that a canopy height model shows, each with its height and the width of its crown.

    They stand on the selected meshes, or on imported terrain.
    """

    bl_label = "Import Canopy Height"

    species: StringProperty(
        name="Species",
        description=(
            "Comma-separated identifiers of species with optional weights: beech:3, spruce. Empty for the species of "
            "Populate"
        ),
        options=_UNLINKED,
    )
    least: FloatProperty(
        name="Smallest Tree",
        description="Lower canopy is left out",
        default=3.0,
        min=0.5,
        soft_max=10.0,
        max=100.0,
        unit='LENGTH',
        options=_UNLINKED,
    )

    def steps(self, context: bpy.types.Context) -> Generator[Progress, Any, Planted]:
        self.species = self.species or mix_in(context.scene.tetflora.populate)
        return canopy_steps(
            context.scene,
            context.evaluated_depsgraph_get(),
            self.path,
            selected_grounds(context),
            parse_weights(self.species),
            self.least,
            self.code,
            self.factor,
            self.shift,
            self.new_origin,
        )


class TETFLORA_OT_import_outlines(_Importing, bpy.types.Operator):
    """Make curves of woods, meadows, water, roads and buildings from GeoJSON, with the keys of OpenStreetMap.

    They lie on the selected meshes, or on imported terrain. Populations can be limited to them.
    """

    bl_label = "Import Outlines"

    filter_glob: StringProperty(default="*.geojson;*.json", options={'HIDDEN'})

    def steps(self, context: bpy.types.Context) -> Generator[Progress, Any, Drawn]:
        return outline_steps(
            context.scene,
            context.evaluated_depsgraph_get(),
            self.path,
            selected_grounds(context),
            self.code,
            self.new_origin,
        )

    def finish(self, _context: bpy.types.Context, result: Drawn) -> set[str]:
        return self.done(f"Outlines imported: {told(result.number)}")
