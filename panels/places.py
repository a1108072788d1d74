# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Entries of File > Import and File > Export, real places and forests; and the table of an inventory's columns."""

import bpy

from ..operators.places import column_row
from .base import Button

#: In the order in which a place is built.
IMPORTS = (
    Button("import_terrain", 'RNDCURVE'),
    Button("import_canopy", 'OUTLINER_OB_POINTCLOUD'),
    Button("import_inventory", 'SPREADSHEET'),
    Button("import_outlines", 'OUTLINER_OB_CURVE'),
)
_ENDINGS = (
    *("Terrain (.tif, .asc, .hgt)", "Canopy Height (.tif, .asc, .xyz)"),
    *("Tree Inventory (.csv, .geojson, .usd)", "Map Outlines (.geojson, .shp, .gpkg)"),
)


class TETFLORA_UL_inventory_columns(bpy.types.UIList):
    """Columns of an inventory that is about to be imported."""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index, _flag) -> None:
        row = column_row(layout, item.name, item.values)
        row.prop(item, "field", text="")
        row.prop(item, "unit", text="")


def draw_in_import_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """Entries in Blender's File > Import."""
    menu.layout.separator()
    for button, text in zip(IMPORTS, _ENDINGS, strict=True):
        button._replace(text=text).draw(menu.layout)


def draw_in_export_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """The entry in Blender's File > Export."""
    menu.layout.separator()
    Button("export_forest", 'OUTLINER_OB_FORCE_FIELD', "TetFlora Forest (.usd, .glb, .obj)").draw(menu.layout)
