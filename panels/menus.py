# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Entries in Blender's menus, the pie menu, and the menu that a render without plants opens; an inventory's columns."""

import bpy

from ..operators.places import column_row
from ..tetflora_addon.blender.species.edits import catalog
from ..tetflora_addon.species.catalog import FIRST
from .base import Button, draw_buttons, menu, thumbnail
from .layers import FALLBACK_ICON, IMPORTS, TETFLORA_MT_add_biome, TETFLORA_MT_layers


def _catalog_menu(name: str, label: str, operator: str) -> type[bpy.types.Menu]:
    """A menu with an entry for each species of the catalog, which calls an operator with it."""

    def draw(layout: bpy.types.UILayout, _context: bpy.types.Context) -> None:
        # Menus execute operators by default; tools need the mouse, and the others have nothing to ask.
        layout.operator_context = 'INVOKE_DEFAULT'
        known = catalog()
        for info in known.values():
            icon = thumbnail(info.identifier)
            layout.operator(f"tetflora.{operator}", text=info.name, **icon).species = info.identifier
            if info.identifier == FIRST:  # the others follow by name
                layout.separator()
        if not known:
            layout.label(text="The catalog has no species", icon='ERROR')

    draw.__name__ = f"TETFLORA_MT_{name}"
    return menu(label)(draw)


TETFLORA_MT_species = _catalog_menu("species", "Change Species", "assign_species")
TETFLORA_MT_add_plant = _catalog_menu("add_plant", "TetFlora Plant", "add_plant")
TETFLORA_MT_place_plant = _catalog_menu("place_plant", "Place Plants by Clicking", "place_plant")


_POPULATE = Button("populate", 'OUTLINER_OB_POINTCLOUD', "Scatter Plants")
_PAINT = Button("paint_plants", 'BRUSH_DATA')
_DROP = Button("drop_to_ground", 'TRIA_DOWN_BAR')
_FIRST_FOREST = Button("first_forest", 'WORLD')


def draw_in_add_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """The entry in Blender's Add menu."""
    menu.layout.separator()
    _FIRST_FOREST.draw(menu.layout)
    menu.layout.menu(TETFLORA_MT_add_biome.__name__, icon=FALLBACK_ICON)
    menu.layout.menu(TETFLORA_MT_place_plant.__name__, icon='RESTRICT_SELECT_OFF')
    menu.layout.menu(TETFLORA_MT_add_plant.__name__, icon='OUTLINER_OB_FORCE_FIELD')


@menu("Use Selected As")
def TETFLORA_MT_marks(layout: bpy.types.UILayout, _context: bpy.types.Context) -> None:
    """What selected objects are to TetFlora."""
    draw_buttons(
        layout,
        Button("mark", 'MOD_MASK', "Occluder, or Not", {"what": 'OCCLUDER'}),
        Button("mark", 'MESH_ICOSPHERE', "Meshes to Refine, or Not", {"what": 'EXPLICIT'}),
        Button("mark", 'OUTLINER_OB_POINTCLOUD', "Scatter to Refine, or Not", {"what": 'SCATTER'}),
        Button("mark", 'POINTCLOUD_DATA', "Field of Plants, or Not", {"what": 'FIELD'}),
        Button("use_as_skeleton", 'CURVE_DATA'),
        Button("use_as_species", 'ASSET_MANAGER'),
        Button("use_as_species", 'X', "Species No More", {"stop": True}),
    )


@menu("TetFlora")
def TETFLORA_MT_object(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Operators for plants and ground, also because Blender's search (F3) finds only what a menu lists."""
    layout.menu(TETFLORA_MT_species.__name__, icon='OUTLINER_OB_EMPTY')
    draw_buttons(
        layout,
        Button("reseed", 'FILE_REFRESH'),
        _DROP,
        Button("select_plants", 'RESTRICT_SELECT_OFF', "Select All of This Species"),
        Button("convert_plants", 'POINTCLOUD_DATA', "Convert Plants to Field", {"to": 'FIELD'}),
        Button("convert_plants", 'OUTLINER_OB_EMPTY', "Convert Field to Objects", {"to": 'OBJECTS'}),
        Button("make_plant_mesh", 'OUTLINER_OB_MESH'),
        Button("remove_plants", 'X', "Remove Selected Plants", {"which": 'SELECTED'}),
        Button("remove_plants", 'TRASH', "Remove All Plants", {"which": 'ALL'}),
        None,
    )
    layout.menu(TETFLORA_MT_marks.__name__)
    layout.menu(TETFLORA_MT_layers.__name__)
    draw_buttons(layout, _POPULATE, Button("grow_stand", 'TIME'), Button("ground_cover", 'OUTLINER_OB_CURVES'), _PAINT)
    layout.menu(TETFLORA_MT_place_plant.__name__, icon='RESTRICT_SELECT_OFF')
    layout.prop(context.scene.tetflora.species_editor, "shown", text="Species Editor")
    draw_buttons(
        layout,
        None,
        Button("look", 'VIEW_CAMERA'),
        Button("daylight", 'LIGHT_SUN'),
        Button("preview_levels", 'MOD_REMESH'),
        Button("refine", 'MOD_DECIM', "Refine Plants"),
        Button("keep_results", 'MESH_DATA'),
        Button("clear", 'TRASH', "Clear Results"),
    )


def draw_in_object_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """The entry in the 3D view's Object menu."""
    menu.layout.separator()
    menu.layout.menu(TETFLORA_MT_object.__name__, icon='OUTLINER_OB_FORCE_FIELD')


def draw_in_outliner(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """Entries in the Outliner's menus of objects and collections."""
    menu.layout.separator()
    draw_buttons(
        menu.layout,
        Button("use_as_species", 'ASSET_MANAGER', "Use as TetFlora Species"),
        Button("use_as_species", 'X', "Stop Using as TetFlora Species", {"stop": True}),
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


@menu("TetFlora")
def TETFLORA_MT_pie(layout: bpy.types.UILayout, _context: bpy.types.Context) -> None:
    """The pie menu of the 3D view."""
    pie = layout.menu_pie()
    # West, east, south, north, north-west, north-east, south-west, south-east: Blender's own order.
    draw_buttons(pie, _PAINT, Button("refine", 'MOD_DECIM'), _POPULATE)
    pie.menu(TETFLORA_MT_place_plant.__name__, icon='RESTRICT_SELECT_OFF')
    draw_buttons(pie, _DROP, Button("clear", 'TRASH'), _FIRST_FOREST)
    pie.menu(TETFLORA_MT_species.__name__, icon='OUTLINER_OB_EMPTY')


@menu("The Render Shows No Plants")
def TETFLORA_MT_nothing_refined(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Nothing is refined."""
    layout.label(text="Nothing is refined, and Refine at Render is off", icon='INFO')
    layout.operator("tetflora.refine", icon='MOD_DECIM')
    layout.prop(context.scene.tetflora, "refine_at_render")
