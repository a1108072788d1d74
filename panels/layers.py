# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers: one list of all that grows on the grounds of a scene, and what and where the active one is."""

import bpy
from bpy.utils import units

from ..operators.layers import ground_names
from ..tetflora_addon.blender.biomes.layers import GROUP, STAND, active_layer, is_due, is_gone, kind_of, plants_in
from ..tetflora_addon.blender.biomes.library import FALLBACK_ICON, biomes, icon_of, items
from ..tetflora_addon.blender.placing.distances import follows_species, suggestion
from ..tetflora_addon.blender.placing.rules import grounds_seen
from ..tetflora_addon.blender.scene.crowns import crown_to_draw
from ..tetflora_addon.blender.scene.fields import has_history
from ..tetflora_addon.blender.settings import BIOME, FIELD, SCATTER, active_in, named, rules_of
from ..tetflora_addon.blender.viewport import points
from . import base

#: Imports of real places, in the order in which a place is built.
IMPORTS = (
    base.Button("import_terrain", 'RNDCURVE'),
    base.Button("import_canopy", 'OUTLINER_OB_POINTCLOUD'),
    base.Button("import_inventory", 'SPREADSHEET'),
    base.Button("import_outlines", 'OUTLINER_OB_CURVE'),
)


class TETFLORA_UL_layers(bpy.types.UIList):
    """What a layer is, its name, how many plants it has, whether it is due, frozen or hidden."""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index, _flag) -> None:
        row, kind = layout.row(align=True), kind_of(item)
        row.use_property_split = False  # which would indent names
        if kind == GROUP:
            row.prop(item, "folded", text="", emboss=False, icon='RIGHTARROW' if item.folded else 'DOWNARROW_HLT')
        elif item.biome:
            row.separator()
        handle = row.row()
        handle.scale_x, icon = (0.5, 'GRIP') if kind == GROUP else (1.0, kind)  # what it is, and where it is dragged
        base.Button("move_layer", icon, "", {"direction": 'DRAG', "layer": item.uid}).draw(handle, emboss=False)
        row.prop(named(item), "name", text="", emboss=False)
        right = row.row(align=True)
        right.alignment = 'RIGHT'
        due = is_due(item)  # then the number is about to change, and names need the room
        right.label(text="" if due else _short(plants_in(item)), icon='FILE_REFRESH' if due else 'NONE')
        if item.frozen:
            right.prop(item, "frozen", text="", emboss=False, icon='FREEZE')
        right.prop(item, "shown", text="", emboss=False, icon='HIDE_OFF' if item.shown else 'HIDE_ON')

    def filter_items(self, _context, data, propname) -> tuple[list[int], list[int]]:
        layers = getattr(data, propname)
        folded = {layer.uid for layer in layers if layer.kind == BIOME and layer.folded}
        gone = (layer.biome in folded or is_gone(layer) for layer in layers)
        return [0 if one else self.bitflag_filter_item for one in gone], []


def _short(number: int) -> str:
    """A number in few letters, beside names: ``960``, ``1.2k``, ``82k``, ``1.2M``."""
    if number < 1000:
        return f"{number}"
    return f"{number / 1e3:.{int(number < 9950)}f}k" if number < 999_500 else f"{number / 1e6:.1f}M"


@base.menu("TetFlora Biome")
def TETFLORA_MT_add_biome(layout: bpy.types.UILayout, _context: bpy.types.Context) -> None:
    """Biomes to add to the selected ground, or with land of their own."""
    layout.operator_context = 'INVOKE_DEFAULT'
    for info in biomes().values():
        number = icon_of(info)
        icon = {"icon_value": number} if number else {"icon": FALLBACK_ICON}
        layout.operator("tetflora.add_biome", text=info.name, **icon).biome = info.identifier


@base.popover("Add Layer", 30)
def TETFLORA_PT_add_layer(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What can grow on the selected meshes; opened from the list of layers."""
    names, text = ground_names(context), "A biome brings land of its own; select a mesh to plant on it"
    layout.label(text=f"On {names}" if names else text, icon='MESH_GRID')
    pictures = layout.grid_flow(row_major=True, columns=4, even_columns=True, even_rows=True)
    known = biomes()
    for identifier, name, _, icon, _ in items():
        cell = pictures.column(align=True)
        cell.template_icon(icon if isinstance(icon, int) else 0, scale=5.0)
        row = cell.row(align=True)
        base.Button("add_biome", 'NONE', name, {"biome": identifier}).draw(row)
        if identifier in known and known[identifier].is_own:
            base.Button("delete_file", 'TRASH', "", {"biome": True, "identifier": identifier}).draw(row)
    layout.separator()
    columns = layout.split()
    base.draw_buttons(
        columns.column(),
        base.Button("populate", 'OUTLINER_OB_POINTCLOUD', "Scatter", {"by_density": True}),
        base.Button("grow_stand", 'TIME', "Stand"),
        base.Button("ground_cover", 'OUTLINER_OB_CURVES'),
        base.Button("paint_plants", 'BRUSH_DATA'),
    )
    base.draw_buttons(columns.column(), *IMPORTS)


@base.menu("Layers")
def TETFLORA_MT_layers(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Less common operators for layers."""
    layer = active_layer(context.scene)
    base.draw_buttons(
        layout,
        base.Button("update_layers", 'FILE_REFRESH', "Update This Layer", {"which": 'ACTIVE'}),
        base.Button("update_layers", 'LOOP_BACK', "Clear Erased Places", {"which": 'ACTIVE', "forget_erased": True}),
        base.Button("update_layers", 'OUTLINER_OB_FORCE_FIELD', "Grown in a Wood", {"which": 'WOOD'}),
        base.Button("ground_cover", 'OUTLINER_OB_CURVES'),
        base.Button("ground_snow", 'FREEZE'),
        None,
        base.Button("duplicate_layer", 'DUPLICATE'),
        base.Button("duplicate_layer", 'MESH_GRID', "Copy to Selected Meshes", {"to_selected": True}),
        base.Button("set_layer_ground", 'MESH_GRID'),
        base.Button("move_layer", 'GROUP', "Group with Layer Above", {"direction": 'IN'}),
        base.Button("move_layer", 'X', "Take Out of Group", {"direction": 'OUT'}),
        base.Button("select_plants", 'RESTRICT_SELECT_OFF', "Select Plants of Layer", {"layer": True}),
        base.Button("remove_layer", 'REMOVE', "Remove but Keep Plants", {"keep_plants": True}),
        None,
        base.Button("save_biome", 'FILE_TICK', "Save as Biome..."),
        base.Button("import_biome", 'IMPORT', "Import Biome..."),
    )
    if layer is None:
        return
    layout.separator()
    layout.prop(layer, "frozen")
    if layer.kind == SCATTER:
        base.draw_properties(layout, layer, "seed", "tilt", "ground_collection")
        layout.prop_menu_enum(layer, "as_field")


@base.panel("Layers", "landscapes.md#layers")
def TETFLORA_PT_layers(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Layers."""
    scene = context.scene
    group, layer = scene.tetflora, active_layer(scene)
    layer = None if layer is None or is_gone(layer) else layer
    row = layout.row()
    row.template_list(TETFLORA_UL_layers.__name__, "", group, "layers", group, "layers_index", rows=6)
    column = row.column(align=True)
    # Not a popover, which would stay after a click until another one beside it.
    added = column.operator("wm.call_panel", text="", icon='ADD')
    added.name, added.keep_open = TETFLORA_PT_add_layer.__name__, False
    base.Button("remove_layer", 'REMOVE', "").draw(column)
    column.separator()
    for direction in ('UP', 'DOWN'):
        base.Button("move_layer", f"TRIA_{direction}", "", {"direction": direction}).draw(column)
    column.menu(TETFLORA_MT_layers.__name__, text="", icon='DOWNARROW_HLT')
    row = layout.row(align=True)
    row.scale_y = 1.2
    base.Button("update_layers", 'FILE_REFRESH').draw(row)
    base.Button("update_layers", 'MOD_NOISE', "", {"which": 'ACTIVE', "reroll": True}).draw(row)
    row.prop(context.window_manager, "tetflora_points", text="", icon='PARTICLE_POINT')
    layout.label(text=_status(layer, not all(map(is_gone, group.layers))), icon='INFO')
    if layer is None:
        return
    column = layout.column()
    column.active = not layer.frozen
    owner, kind = rules_of(layer), kind_of(layer)
    if layer.kind == SCATTER:
        _draw_scatter(column, layer)
    elif kind == STAND:
        _draw_stand(column, layer.field)
    elif kind == GROUP:
        column.prop(layer, "gives_way")
    if (layer.kind != FIELD or kind == STAND) and (body := base.section(column, "Where", closed=False)):
        seen = grounds_seen(layer)
        base.draw_below(body, seen.names or "None", "Ground")
        for name in seen.missing[:3]:
            base.draw_message(context, body, f'"{name}" is not in the scene; choose Use Selected Meshes in the menu')
        base.draw_where(body, owner)
    if layer.kind == SCATTER and (body := base.section(column, "Spacing and Size")):
        _draw_spacing(body, layer)
        for text in points.complaints(layer):
            base.draw_message(context, body, text)


def _status(layer: bpy.types.PropertyGroup | None, others: bool) -> str:
    """What is due, or wrong, or how many plants there will be: one line, so that no row moves."""
    if layer is None:
        return "Select a layer, or click + to add one" if others else "Click + to let something grow"
    if layer.kind != SCATTER:
        return "Settings or ground changed: Update" if is_due(layer) else f"{plants_in(layer):,} plants"
    text = points.status(layer)
    few = text.partition(", as ")[0]  # a sidebar of usual width has room for no more
    if points.complaints(layer):
        return f"{few}; see Spacing"
    return f"Update: {few}" if is_due(layer) else text


def _draw_scatter(layout: bpy.types.UILayout, layer: bpy.types.PropertyGroup) -> None:
    """How many plants of which species."""
    row = layout.row(align=True)
    if layer.by_density:
        row.prop(layer, "density", text="Per Hectare")
    else:
        row.prop(layer, "count")
    row.prop(layer, "by_density", text="", icon='MESH_GRID')
    base.draw_species(layout, layer, "mix")
    if entry := active_in(layer, "mix"):
        layout.prop(entry, "habitat")
        layout.prop(entry, "companion_choice")
        if entry.companion:
            base.draw_properties(layout.column(align=True), entry, "companion_strength", "companion_distance")


def _draw_spacing(layout: bpy.types.UILayout, layer: bpy.types.PropertyGroup) -> None:
    draw_distance(layout, layer)
    layout.prop(layer, "clumping")
    if layer.clumping:
        layout.prop(layer, "clump_size")
    base.draw_numbers(layout, layer, "scale_range")
    column = layout.column(align=True)
    column.prop(layer, "age")
    if layer.age > 0.0:
        column.prop(layer, "age_spread", slider=True)


def draw_distance(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """The switch between the distance that suits the species and the artist's own, and the one that counts."""
    layout.row(heading="Min Distance").prop(settings, "distance_by_species")
    if follows_species(settings):
        distance = suggestion(settings, crown_to_draw)  # None for a moment, until the crowns of the species are known
        unit, length = settings.id_data.unit_settings, "…"
        if distance is not None:
            length = units.to_string(unit.system, 'LENGTH', distance * unit.scale_length, precision=2)
        base.draw_below(layout, length)
    else:
        layout.prop(settings, "min_distance", text=" ")


def _draw_stand(layout: bpy.types.UILayout, field: bpy.types.Object) -> None:
    """The year of a stand, and what it grows from."""
    stand = field.tetflora.stand
    if has_history(field):
        last = stand.last_year
        text = f"Year of {last:g}" if last else "Year"
        layout.prop(field.tetflora, "stand_year", text=text)
        row = layout.row(align=True)
        base.Button("animate_growth", 'KEYFRAME').draw(row)
        base.Button("keep_year", 'PINNED').draw(row)
    base.draw_properties(layout.column(), stand, "years", "density")
    base.draw_species(layout, stand)
    if entry := active_in(stand, "species"):
        layout.prop(entry, "incoming_seeds")
    if body := base.section(layout, "Site"):
        base.draw_properties(body.column(align=True), stand, "recruits", "outside")
        base.draw_properties(body.column(align=True), stand, "degree_days", "coldest_month")
        base.draw_properties(body.column(align=True), stand, "moisture", "relief", "fertility")
