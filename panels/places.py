# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real Places: what can be imported, and where on Earth the scene is; the same in Blender's File > Import."""

import bpy

from ..operators.places import column_row
from ..tetflora_addon.blender.geodata.origin import origin_of
from ..tetflora_addon.errors import TetFloraError
from .base import Button, SidebarPanel, draw_buttons, draw_message

#: In the order in which a place is built.
IMPORTS = (
    Button("import_terrain", 'RNDCURVE'),
    Button("import_canopy", 'OUTLINER_OB_POINTCLOUD'),
    Button("import_inventory", 'SPREADSHEET'),
    Button("import_outlines", 'OUTLINER_OB_CURVE'),
)


class TETFLORA_UL_inventory_columns(bpy.types.UIList):
    """Columns of an inventory that is about to be imported."""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index, _flag) -> None:
        row = column_row(layout, item.name, item.values)
        row.prop(item, "field", text="")
        row.prop(item, "unit", text="")


class TETFLORA_PT_places(SidebarPanel, bpy.types.Panel):
    """Real places."""

    bl_label = "Real Places"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        draw_buttons(self.layout.column(), *IMPORTS)
        try:
            place = origin_of(context.scene)
        except TetFloraError as error:
            draw_message(context, self.layout, str(error))
            return
        if place is not None:
            where = f"{place.east:,.0f}, {place.north:,.0f} of " if place.system.code >= 0 else ""
            draw_message(context, self.layout, f"Origin: {where}{place.system.name}", 'WORLD')


def draw_in_import_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """Entries in Blender's File > Import."""
    menu.layout.separator()
    for kind, ending, icon in (
        ("import_terrain", "Terrain (.tif, .asc, .hgt)", 'RNDCURVE'),
        ("import_canopy", "Canopy Height (.tif, .asc, .xyz)", 'OUTLINER_OB_POINTCLOUD'),
        ("import_inventory", "Tree Inventory (.csv, .geojson)", 'SPREADSHEET'),
        ("import_outlines", "Map Outlines (.geojson, .shp, .gpkg)", 'OUTLINER_OB_CURVE'),
    ):
        Button(kind, icon, ending).draw(menu.layout)
