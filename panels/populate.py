# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Populate: populations of plants, the rules for placing them, occluders; Paint Plants: the brush."""

import bpy

from ..tetflora_addon.blender.placing.distances import distance_to_draw, follows_species
from ..tetflora_addon.blender.placing.properties import MODES
from ..tetflora_addon.blender.placing.rules import awaits_update, is_outdated, shown_population
from ..tetflora_addon.blender.settings import active_in
from ..tetflora_addon.blender.species.edits import catalog
from ..tetflora_addon.blender.viewport import points
from .base import (
    Button,
    LayerList,
    SidebarPanel,
    TETFLORA_UL_mix,
    draw_below,
    draw_buttons,
    draw_list,
    draw_message,
    draw_properties,
    draw_where,
    section,
    shown_length,
    split_layout,
)


class TETFLORA_UL_populations(LayerList, bpy.types.UIList):
    """A population's name, how many plants it has, and whether it is frozen or an update would change it."""

    icon = 'OUTLINER_OB_POINTCLOUD'

    @staticmethod
    def state(item: bpy.types.PropertyGroup) -> tuple[int, str]:
        return item.made, 'FREEZE' if item.frozen else 'FILE_REFRESH' if is_outdated(item) else 'NONE'


class TETFLORA_MT_populations(bpy.types.Menu):
    """Less common operators for populations."""

    bl_label = "Populations"

    def draw(self, _context: bpy.types.Context) -> None:
        draw_buttons(
            self.layout,
            Button("select_population", 'RESTRICT_SELECT_OFF'),
            Button("remove_population", 'REMOVE', "Remove but Keep Plants", {"keep_plants": True}),
            Button("forget_erased", 'LOOP_BACK'),
            Button("ground_snow", 'FREEZE'),
            None,
            Button("import_populations", 'IMPORT', "Import..."),
            Button("export_populations", 'EXPORT', "Export..."),
        )


class TETFLORA_PT_populate(SidebarPanel, bpy.types.Panel):
    """Populate."""

    bl_label = "Populate"

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        group, settings = context.scene.tetflora, shown_population(context.scene)
        buttons = [Button("add_population", 'ADD', ""), Button("remove_population", 'REMOVE', "")]
        buttons, rows = (buttons, 3) if group.populations else (buttons[:1], 1)
        beside = draw_list(layout, TETFLORA_UL_populations, group, "populations", *buttons, rows=rows)
        beside.menu(TETFLORA_MT_populations.__name__, text="", icon='DOWNARROW_HLT')
        if settings.uid:
            row = layout.row(align=True)
            Button("update_population", 'FILE_REFRESH', "Update").draw(row)
            Button("reroll_population", 'MOD_NOISE', "Re-roll").draw(row)
            Button("freeze_population", 'FREEZE', "Freeze").draw(row, depress=settings.frozen)
            Button("ground_cover", 'OUTLINER_OB_CURVES').draw(layout)
        else:
            Button("populate", 'OUTLINER_OB_POINTCLOUD', "Populate Selected Meshes").draw(layout)
        _draw_status(context, layout, settings)
        column = layout.column()
        column.active = not settings.frozen
        if settings.uid:
            _draw_grounds(column, settings)
        row = column.row(heading="Amount")
        row.prop(settings, "by_density")
        if settings.by_density:
            column.prop(settings, "density", text="Per Hectare")  # the whole name is wider than labels are
        else:
            column.prop(settings, "count")
        draw_below(column, f"At least {_distance(settings)} apart")
        draw_properties(column, settings, "as_field", "seed")
        active = context.active_object
        marked = active is not None and active.tetflora.is_occluder
        text, icon = ("Occluder", 'CHECKMARK') if marked else ("Mark as Occluder", 'MOD_MASK')
        Button("mark_occluder", icon, text).draw(layout, depress=marked)
        for title, draw in _SECTIONS.items():
            # What to plant is the first question.
            if body := section(layout, title, closed=title != "Species"):
                body.active = not settings.frozen
                draw(body, settings)


def _draw_species(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    TETFLORA_UL_mix.draw_in(layout, settings)
    if not settings.mix:
        known = catalog()
        text = f"Default: {next(iter(known.values())).name}" if known else "The catalog has no species"
        layout.label(text=text, icon='INFO')
    elif entry := active_in(settings, "mix"):
        layout.prop(entry, "companion_choice")
        if entry.companion:
            draw_properties(layout.column(align=True), entry, "companion_strength", "companion_distance")
        layout.prop(entry, "habitat")


def _draw_placement(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    draw_where(layout, settings)
    column = layout.column(align=True)
    column.prop(settings, "aspect")
    column.prop(settings, "aspect_spread", text="Spread")
    layout.prop(settings, "edge_falloff")


def _draw_spacing(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    _draw_distance(layout, settings)
    layout.prop(settings, "clumping")
    if settings.clumping:
        layout.prop(settings, "clump_size")


def _draw_size(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    draw_properties(layout.column(align=True), settings, "scale_min", "scale_max")
    draw_properties(layout, settings, "scale_at_top", "tilt")
    column = layout.column(align=True)
    column.prop(settings, "age")
    row = column.row()
    row.active = settings.age > 0.0
    row.prop(settings, "age_spread", slider=True)


#: Sections of Populate by title.
_SECTIONS = {
    "Species": _draw_species,
    "Placement": _draw_placement,
    "Spacing": _draw_spacing,
    "Size and Age": _draw_size,
}


def _distance(settings: bpy.types.PropertyGroup) -> str:
    found = distance_to_draw(settings)
    return "…" if found is None else shown_length(found)


def _draw_distance(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """The switch between the distance that suits the species and the artist's own, and the one that counts."""
    row = layout.row(heading="Min Distance")
    row.prop(settings, "distance_by_species")
    if follows_species(settings):
        right = row.row()
        right.alignment = 'RIGHT'
        right.label(text=_distance(settings))
    else:
        layout.prop(settings, "min_distance", text=" ")


def _draw_status(context: bpy.types.Context, layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """How many plants as what, and why not more; the switch of the preview."""
    shown = points.shown_in(context.scene)
    row = layout.row(align=True)
    waiting = awaits_update(settings)
    # In the place of the other text: a line that comes and goes would move the slider away from under the mouse.
    text = points.status(settings)
    row.label(text=f"Update: {text}" if waiting else text, icon='FILE_REFRESH' if waiting else 'INFO')
    Button("preview_population", 'HIDE_OFF' if shown else 'HIDE_ON', "").draw(row, depress=shown)
    for text in points.complaints(settings):
        draw_message(context, layout, text)


def _draw_grounds(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    names = [entry.object.name for entry in settings.grounds[:3] if entry.object is not None]
    more = len(settings.grounds) - 3
    row = layout.split(factor=0.4)
    left = row.row()
    left.alignment = 'RIGHT'
    left.label(text="Ground")
    row.label(text=", ".join(names) + (f" and {more:,} more" if more > 0 else "") or "None")
    layout.operator("tetflora.set_population_ground", icon='MESH_GRID')
    layout.prop(settings, "ground_collection", text="Collection")


class TETFLORA_PT_brush(SidebarPanel, bpy.types.Panel):
    """Paint plants."""

    bl_label = "Paint Plants"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        settings = context.scene.tetflora.brush
        row = layout.row(align=True)
        row.scale_y = 1.4
        for mode, name, _, icon, _ in MODES:
            Button("paint_plants", icon, name, {"mode": mode}).draw(row, depress=settings.mode == mode)
        column = layout.column(align=True)
        draw_properties(column, settings, "radius", "density")
        column.prop(settings, "strength", slider=True)
        _draw_distance(column, settings)
        column = layout.column()
        column.prop(settings, "source")
        if settings.source == 'ONE':
            column.prop(settings, "species_choice", text=" ")
        draw_properties(layout.column(align=True), settings, "scale_min", "scale_max")
        draw_properties(layout.column(), settings, "store", "seed")
