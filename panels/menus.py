# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Entries in Blender's menus, the pie menu, and the menu that a render without plants opens; an inventory's columns."""

import bpy

from ..operators.places import column_row
from ..tetflora_addon.blender.runtime import open_menu
from ..tetflora_addon.blender.species.edits import catalog
from ..tetflora_addon.species.catalog import FIRST
from .base import Button, draw_buttons, thumbnail
from .layers import FALLBACK_ICON, IMPORTS, TETFLORA_MT_add_biome, TETFLORA_MT_layers
from .preferences import PIE


class _SpeciesMenu:
    """Mix-in for menus with an entry for each species of the catalog, which calls ``operator`` with it."""

    operator: str

    def draw(self, _context: bpy.types.Context) -> None:
        # Menus execute operators by default; tools need the mouse, and the others have nothing to ask.
        self.layout.operator_context = 'INVOKE_DEFAULT'
        known = catalog()
        for info in known.values():
            icon = thumbnail(info.identifier)
            self.layout.operator(f"tetflora.{self.operator}", text=info.name, **icon).species = info.identifier
            if info.identifier == FIRST:  # the others follow by name
                self.layout.separator()
        if not known:
            self.layout.label(text="The catalog has no species", icon='ERROR')


class TETFLORA_MT_species(_SpeciesMenu, bpy.types.Menu):
    """Species to assign to the selected plants."""

    bl_label = "Change Species"
    operator = "assign_species"


class TETFLORA_MT_add_plant(_SpeciesMenu, bpy.types.Menu):
    """Species to add a plant of."""

    bl_label = "TetFlora Plant"
    operator = "add_plant"


class TETFLORA_MT_place_plant(_SpeciesMenu, bpy.types.Menu):
    """Species to place by clicking on the ground."""

    bl_label = "Place Plants by Clicking"
    operator = "place_plant"


_POPULATE = Button("populate", 'OUTLINER_OB_POINTCLOUD', "Scatter Plants")
_PAINT = Button("paint_plants", 'BRUSH_DATA')
_DROP = Button("drop_to_ground", 'TRIA_DOWN_BAR')
_FIRST_FOREST = Button("first_forest", 'WORLD')


def draw_place_menu(layout: bpy.types.UILayout) -> None:
    """The menu of plants to place by clicking."""
    layout.menu(TETFLORA_MT_place_plant.__name__, icon='RESTRICT_SELECT_OFF')


def draw_species_menu(layout: bpy.types.UILayout) -> None:
    """The menu of species to assign to selected plants."""
    layout.menu(TETFLORA_MT_species.__name__, icon='OUTLINER_OB_EMPTY')


def draw_in_add_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """The entry in Blender's Add menu."""
    menu.layout.separator()
    _FIRST_FOREST.draw(menu.layout)
    menu.layout.menu(TETFLORA_MT_add_biome.__name__, icon=FALLBACK_ICON)
    draw_place_menu(menu.layout)
    menu.layout.menu(TETFLORA_MT_add_plant.__name__, icon='OUTLINER_OB_FORCE_FIELD')


class TETFLORA_MT_marks(bpy.types.Menu):
    """What selected objects are to TetFlora."""

    bl_label = "Use Selected As"

    def draw(self, _context: bpy.types.Context) -> None:
        draw_buttons(
            self.layout,
            Button("mark", 'MOD_MASK', "Occluder, or Not", {"what": 'OCCLUDER'}),
            Button("mark", 'MESH_ICOSPHERE', "Meshes to Refine, or Not", {"what": 'EXPLICIT'}),
            Button("mark", 'OUTLINER_OB_POINTCLOUD', "Scatter to Refine, or Not", {"what": 'SCATTER'}),
            Button("mark", 'POINTCLOUD_DATA', "Field of Plants, or Not", {"what": 'FIELD'}),
            Button("use_as_skeleton", 'CURVE_DATA'),
            Button("use_as_species", 'ASSET_MANAGER'),
            Button("use_as_species", 'X', "Species No More", {"stop": True}),
        )


class TETFLORA_MT_object(bpy.types.Menu):
    """Operators for plants and ground, also because Blender's search (F3) finds only what a menu lists."""

    bl_label = "TetFlora"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        draw_species_menu(layout)
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
        draw_buttons(
            layout, _POPULATE, Button("grow_stand", 'TIME'), Button("ground_cover", 'OUTLINER_OB_CURVES'), _PAINT
        )
        draw_place_menu(layout)
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


class TETFLORA_MT_pie(bpy.types.Menu):
    """The pie menu of the 3D view."""

    bl_idname = PIE
    bl_label = "TetFlora"

    def draw(self, _context: bpy.types.Context) -> None:
        pie = self.layout.menu_pie()
        # West, east, south, north, north-west, north-east, south-west, south-east: Blender's own order.
        draw_buttons(pie, _PAINT, Button("refine", 'MOD_DECIM'), _POPULATE)
        draw_place_menu(pie)
        draw_buttons(pie, _DROP, Button("clear", 'TRASH'), _FIRST_FOREST)
        draw_species_menu(pie)


class TETFLORA_MT_nothing_refined(bpy.types.Menu):
    """Nothing is refined."""

    bl_idname = "TETFLORA_MT_nothing_refined"
    bl_label = "The Render Shows No Plants"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.label(text="Nothing is refined, and Refine at Render is off", icon='INFO')
        self.layout.operator("tetflora.refine", icon='MOD_DECIM')
        self.layout.prop(context.scene.tetflora, "refine_at_render")


def open_nothing_refined() -> None:
    """Open the menu, where there is a window."""
    open_menu(TETFLORA_MT_nothing_refined.bl_idname)
