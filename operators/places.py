# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Import real places: terrain, trees that were measured or seen from above, and outlines of a map."""

from pathlib import Path
from typing import Any

import bpy
from bpy.props import CollectionProperty, IntProperty, StringProperty
from bpy.types import Context, Event, Operator, OperatorFileListElement, UILayout
from bpy_extras.io_utils import ImportHelper

from ..tetflora_addon.blender.declare import once
from ..tetflora_addon.blender.export.usd import ENDINGS as USD_ENDINGS
from ..tetflora_addon.blender.export.usd import forest_steps
from ..tetflora_addon.blender.geodata import trees
from ..tetflora_addon.blender.geodata.origin import EXISTING, MIDDLE, WHOLE, Import, Imported, Steps
from ..tetflora_addon.blender.geodata.terrain import PATTERN, outline_steps, terrain_steps
from ..tetflora_addon.blender.species.catalog import NO_SPECIES, operator_items
from ..tetflora_addon.errors import TetFloraError
from ..tetflora_addon.geodata import inventories, layers, outlines, projection
from ..tetflora_addon.parameters import within
from .add import mix_in, parse_weights
from .base import FileJob, in_object_mode, select_only
from .layers import selected_grounds

_LAYERS, _FORESTS = (";".join(f"*{ending}" for ending in endings) for endings in (layers.ENDINGS, USD_ENDINGS))


def _file(text: str) -> Path | None:
    """A file that was chosen beside the first; None for none."""
    return Path(bpy.path.abspath(text)) if text else None


def column_row(layout: UILayout, title: str, values: str, translate: bool = False) -> UILayout:
    """Begin a row of the table of columns; what they are taken for, and the unit, come next."""
    row = layout.split(factor=0.25)
    row.label(text=title, translate=translate)
    row = row.split(factor=0.45)
    row.label(text=values, translate=translate)
    return row


class _Importing(FileJob, ImportHelper):
    """Mix-in for operators that import a place from a file."""

    needs = (in_object_mode,)
    browse = ImportHelper.invoke

    epsg: once.integer(
        "Coordinate System",
        "EPSG code of the coordinates in the file, such as 4326 for longitude and latitude, or 25832 for a zone of "
        "UTM. 0 uses what the file says",
        **within(0, high=999_999),
    )
    plain: once.boolean("Plain Meters", "Take coordinates for meters of a plane, whatever the file says of them")
    new_origin: once.boolean(
        "New Origin",
        "Put the middle of this file at the world origin. Otherwise it lies where it is in relation to what was "
        "imported before",
    )
    crop: once.choice(
        "Crop",
        "What to leave out of a large area",
        (
            (WHOLE, "Nothing", "All of the file"),
            (MIDDLE, "To Its Middle", "A square around the middle"),
            (EXISTING, "To the Scene", "The selected meshes or imported terrain, or else all that the scene has"),
        ),
    )
    crop_size: once.real("Side", "Side of the square", 2000.0, **within(1.0, 20_000.0, 500_000.0), unit='LENGTH')

    def order(self, context: Context, **others: Any) -> Import:
        """What is to be imported."""
        epsg = projection.PLAIN if self.plain else self.epsg
        selected, graph = tuple(selected_grounds(context)), context.evaluated_depsgraph_get()
        crop = {"crop": self.crop, "side": self.crop_size}
        return Import(context.scene, graph, self.path, epsg, self.new_origin, selected, **crop, **others)

    def finish(self, context: Context, result: Imported) -> set[str]:
        if result.object is not None:
            select_only(context, [result.object])
        return self.done("; ".join(result.told), result.warning)


class _Raster(_Importing):
    """Mix-in for those that read rasters, or several tiles of one."""

    filter_glob: StringProperty(default=PATTERN, options={'HIDDEN'})
    files: CollectionProperty(type=OperatorFileListElement, options={'HIDDEN', 'SKIP_SAVE'})
    directory: StringProperty(subtype='DIR_PATH', options={'HIDDEN', 'SKIP_SAVE'})
    scale: once.real(
        "Meters per Value",
        "Factor on the values of the file: 0.3048 for feet, 0.1 for decimeters",
        1.0,
        **within(1e-6, 10.0, 1e6),
        precision=4,
    )
    offset: once.real("Height Offset", "Added to all values", **within(-20_000.0, high=20_000.0), unit='LENGTH')

    def order(self, context: Context, **others: Any) -> Import:
        """What is to be imported, with the other chosen files as tiles."""
        folder = Path(bpy.path.abspath(self.directory)) if self.directory else self.path.parent
        tiles = (folder / file.name for file in self.files if file.name)
        tiles = tuple(tile for tile in tiles if tile != self.path)
        return super().order(context, scale=self.scale, offset=self.offset, tiles=tiles, **others)

    def as_keywords(self, *, ignore: tuple[str, ...] = ()) -> dict[str, Any]:
        """Settings of another call, with files by their names."""
        keywords = super().as_keywords(ignore=(*ignore, "files"))
        return keywords | {"files": [{"name": file.name} for file in self.files]}


class TETFLORA_OT_import_terrain(_Raster, Operator, label="Import Terrain"):
    """Make ground from a raster of elevations, or from several tiles of one."""

    max_faces: once.integer(
        "Max Faces", "Face limit; finer rasters are averaged in blocks", 500_000, **within(100, 4_000_000, 20_000_000)
    )
    image: once.string(
        "Orthophoto",
        "Image of the same place that becomes the color of the ground: GeoTIFF, or JPEG or PNG with a world file",
        subtype='FILE_PATH',
    )

    def steps(self, context: Context) -> Steps:
        return terrain_steps(self.order(context), self.max_faces, _file(self.image))


class TETFLORA_OT_import_inventory(_Importing, Operator, label="Import Tree Inventory"):
    """Make a field of the trees of an inventory, CSV or GeoJSON: species, place and sizes of each. They stand on the
    selected meshes, or on imported terrain. Of USD, make fields of a forest that was exported, or of any points.
    """

    filter_glob: StringProperty(default=f"*.csv;*.tsv;*.txt;{_LAYERS};{_FORESTS}", options={'HIDDEN'})
    units: once.choice(
        "Units",
        "Units of columns that do not name theirs",
        (
            (inventories.METRIC, "Metric", "Meters; trunks in centimeters, unless they are too thin for that"),
            (inventories.IMPERIAL, "Imperial", "Feet; trunks in inches"),
        ),
    )
    unknown: once.choice(
        "Unknown Species",
        "What stands for trees whose species is not known here",
        (
            (trees.GENERIC, "Generic Tree", "A conifer where the name tells that it is one, else a broadleaf tree"),
            ('SPECIES', "Species", "The species below"),
            (trees.LEFT_OUT, "Leave Out", "No tree"),
        ),
    )
    species: once.choice("Species", "Species that stands for unknown ones", operator_items)
    skip: once.boolean("Skip Broken Rows", "Leave out rows with values that cannot be, instead of refusing the file")

    columns: once.string(
        "Columns",
        "JSON object of what columns hold, for those whose titles and values do not tell it: "
        '{"Hoogte dm": "height", "X1": "crown_width ft", "X2": ""}',
    )
    table: CollectionProperty(type=trees.TetFloraInventoryColumn, options={'HIDDEN', 'SKIP_SAVE'})
    active: IntProperty(options={'HIDDEN', 'SKIP_SAVE'})

    def invoke(self, context: Context, event: Event) -> set[str]:
        if not self.chosen or self.columns or self._is_forest:
            return super().invoke(context, event)
        try:
            trees.show_columns(self.table, self.path)
        except (OSError, TetFloraError) as error:
            return self.failed(str(error))
        self._browsing = True
        return context.window_manager.invoke_props_dialog(self, width=720, title="Columns of the Inventory")

    def as_keywords(self, *, ignore: tuple[str, ...] = ()) -> dict[str, Any]:
        """Settings of another call, which takes columns as the table has them."""
        keywords = super().as_keywords(ignore=(*ignore, "table", "active"))
        return keywords | ({"columns": trees.chosen_columns(self.table)} if self.table else {})

    def draw(self, _context: Context) -> None:
        layout = self.layout
        if self.table:
            rows = min(max(len(self.table), 4), 16)
            heads = column_row(layout, "Column in the File", "Some of Its Values", translate=True)
            heads.label(text="Taken For")
            heads.label(text="Unit")
            layout.template_list(
                "TETFLORA_UL_inventory_columns", "", self, "table", self, "active", rows=rows, maxrows=rows
            )
        layout.use_property_split = True
        for name in ("units", "unknown", "species", "skip", "epsg", "plain", "new_origin", "crop", "crop_size"):
            if (name != "species" or self.unknown == 'SPECIES') and (name != "crop_size" or self.crop == MIDDLE):
                layout.prop(self, name)

    @property
    def _is_forest(self) -> bool:
        return self.path.suffix.lower() in USD_ENDINGS

    def steps(self, context: Context) -> Steps:
        if self._is_forest:
            return forest_steps(self.order(context), parse_weights(mix_in(context.scene.tetflora.populate)))
        chosen = self.species if self.unknown == 'SPECIES' and self.species != NO_SPECIES else self.unknown
        return trees.inventory_steps(self.order(context), chosen, self.units, self.skip, trees.columns_in(self.columns))


class TETFLORA_OT_import_canopy(_Raster, Operator, label="Import Canopy Height"):
    """Make a field of the trees that a canopy height model shows, each with its height and the width of its crown.

    They stand on the selected meshes, or on imported terrain.
    """

    species: once.string(
        "Species",
        "Comma-separated identifiers of species with optional weights: beech:3, spruce. Empty for the species of "
        "new layers",
    )
    min_height: once.real("Min Height", "Lower canopy is left out", 3.0, **within(0.5, 10.0, 100.0), unit='LENGTH')
    below: once.string(
        "Ground Below",
        "Raster of the elevations of the ground, to subtract from those of a surface model; empty for none",
        subtype='FILE_PATH',
    )

    def steps(self, context: Context) -> Steps:
        self.species = self.species or mix_in(context.scene.tetflora.populate)
        return trees.canopy_steps(self.order(context), parse_weights(self.species), self.min_height, _file(self.below))


class TETFLORA_OT_import_outlines(_Importing, Operator, label="Import Outlines"):
    """Make curves of woods, meadows, water, roads and buildings from GeoJSON, a shapefile or a GeoPackage.

    They lie on the selected meshes, or on imported terrain. Populations can be limited to them.
    """

    filter_glob: StringProperty(default=_LAYERS, options={'HIDDEN'})
    kind: once.choice(
        "Take All As",
        "What all areas and lines of the file are",
        (
            ('KEYS', "Told by Their Keys", "What each says that it is, by the keys of OpenStreetMap or others"),
            *((kind.upper(), kind, f"All are {kind.lower()}") for kind in outlines.KINDS),
        ),
    )

    def steps(self, context: Context) -> Steps:
        return outline_steps(self.order(context), "" if self.kind == 'KEYS' else self.kind.title())
