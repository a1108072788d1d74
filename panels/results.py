# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The year, wind, output, previews, and statistics of the last refinement."""

import json
from functools import lru_cache

import bpy

from ..tetflora_addon.blender.job.forecast import polygons_text, seconds_text
from ..tetflora_addon.blender.placing.plant_objects import plant_collections
from ..tetflora_addon.blender.settings import active_in, date_text
from ..tetflora_addon.blender.viewport import state
from .base import (
    SidebarPanel,
    TETFLORA_UL_output_species,
    draw_below,
    draw_message,
    draw_properties,
    section,
    split_layout,
)


class TETFLORA_PT_wind(SidebarPanel, bpy.types.Panel):
    """Wind."""

    bl_label = "Wind"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.tetflora.wind, "enabled", text="")

    def draw(self, context: bpy.types.Context) -> None:
        wind = context.scene.tetflora.wind
        column = split_layout(self).column()
        column.active = wind.enabled
        column.use_property_decorate = True  # they can be animated
        draw_properties(column, wind, "speed", "direction", "gusts", "loop")


class TETFLORA_MT_seasons(bpy.types.Menu):
    """Days in the middle of the seasons."""

    bl_label = "Season"

    def draw(self, _context: bpy.types.Context) -> None:
        self.layout.operator_enum("tetflora.set_season", "season")


class TETFLORA_PT_year(SidebarPanel, bpy.types.Panel):
    """The day of the year, and the years that have passed."""

    bl_label = "Year and Age"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        year = context.scene.tetflora.year
        layout = split_layout(self)
        row = layout.row(heading="Seasons")
        row.prop(year, "enabled", text="")
        row.menu(TETFLORA_MT_seasons.__name__)
        column = layout.column()
        column.active = year.enabled
        column.use_property_decorate = True  # they can be animated
        column.prop(year, "day")
        draw_below(column, date_text(year.day))
        draw_properties(column, year, "latitude", "spread", "snow")
        layout.use_property_decorate = True
        layout.prop(year, "years")


class TETFLORA_PT_output(SidebarPanel, bpy.types.Panel):
    """Output."""

    bl_label = "Output"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        output = context.scene.tetflora.output
        layout.prop(output, "save_results")
        column = layout.column(heading="Results")  # one below the other: two in a row are cut off
        column.prop(output, "show_viewport", text="Viewports")
        column.prop(output, "show_render", text="Renders")
        for collection in plant_collections(context.scene):
            column = layout.column(heading=collection.name)
            column.prop(collection, "hide_viewport", text="Viewports", toggle=False, invert_checkbox=True)
            column.prop(collection, "hide_render", text="Renders", toggle=False, invert_checkbox=True)
        layout.operator("tetflora.keep_results", icon='MESH_DATA')
        if body := section(layout, "Ray Visibility"):
            draw_properties(body, output, "camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
        if body := section(layout, "Passes and Materials"):
            _draw_passes(body, context)


def _draw_passes(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Pass index, light groups and materials, of all and by species."""
    output, layer = context.scene.tetflora.output, context.view_layer
    layout.prop(output, "pass_index")
    layout.prop_search(output, "light_group", layer, "lightgroups")
    TETFLORA_UL_output_species.draw_in(layout, output)
    if entry := active_in(output, "species"):
        layout.prop(entry, "pass_index")
        layout.prop_search(entry, "light_group", layer, "lightgroups")
        for name in ("leaf", "blossom", "bark"):
            layout.prop(entry, name, text=name.capitalize())  # the field itself says Material


class TETFLORA_PT_preview(SidebarPanel, bpy.types.Panel):
    """Preview."""

    bl_label = "Preview"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        settings = context.scene.tetflora.preview
        preview = state.find(context.scene)
        column = layout.column()
        column.prop(settings, "plants")
        if settings.plants != 'NONE':
            # Blender's own setting of this viewport: thousands of empties cost more than the plants that are drawn.
            column.prop(context.space_data, "show_object_viewport_empty", text="Empties")
            if preview is not None and preview.message:
                draw_message(context, column, preview.message)
        row = layout.row(align=True)
        row.operator("tetflora.preview_levels", icon='MOD_REMESH')
        row.operator("tetflora.forget_levels", text="", icon='X')
        layout.prop(settings, "freeze")
        layout.operator("tetflora.look_through", icon='VIEW_CAMERA')
        if preview is None or preview.levels is None:
            return
        column = layout.column()
        last = preview.levels.levels[-1].number
        column.prop(settings, "level", text=f"Level of {last}", slider=True)
        column.prop(settings, "wires")
        row = column.row()
        row.active = settings.wires
        row.prop(settings, "color")
        column.prop(settings, "projected")
        column.column(align=True).prop(settings, "forms")
        column.prop(settings, "statistics")
        if state.is_outdated(context.scene):
            draw_message(context, layout, "The camera has changed; compute the levels again, or freeze the camera")


@lru_cache(maxsize=8)
def rows_of(text: str) -> tuple[tuple[str, str], ...]:
    """Rows of the table, (name, value), from the stored JSON; none if there is none or it is not ours.

    Cached, because a panel is drawn at every movement of the mouse.
    """
    try:
        figures = json.loads(text)
        seconds = figures["seconds"]
        full = figures["polygons_full"]
        fraction = f"{figures['polygons_meshed'] / full:.1%}" if full else "–"
        instances = (
            ("Instances", "instances"),
            ("    Originals", "instances_whole"),
            ("    Clusters", "instances_clusters"),
        )
        return (
            ("Plants", f"{figures['plants']:,}"),
            *((name, f"{figures[key]:,}") for name, key in instances if figures.get("instances")),
            ("Polygons If Expanded", f"{full:,}"),
            ("Polygons", f"{figures['polygons_meshed']:,}"),
            ("    Fraction of All", fraction),
            ("Proxy Faces", f"{figures['polygons_proxy']:,}"),
            ("    Pixels per Face", f"{figures.get('facet_pixels', 0.0):.2g}"),
            ("Tetrahedra", f"{figures['tetrahedra_made']:,}"),
            ("    Terminal", f"{figures['tetrahedra_terminal']:,}"),
            ("    Proxies", f"{figures['tetrahedra_proxy']:,}"),
            ("Seconds", f"{sum(seconds.values()):.2f}"),
            ("Estimated Memory", f"{figures['memory_mb']:,.0f} MB"),
        )
    except (ValueError, KeyError, TypeError, AttributeError):
        return ()


def made_of(text: str) -> str:
    """The stored figures in one line, counted as an estimate and Max Polygons count; empty if there are none."""
    if not rows_of(text):
        return ""
    figures = json.loads(text)
    polygons = figures["polygons_meshed"] + figures["polygons_proxy"]
    if not polygons and figures.get("instances"):
        return f"{figures['instances']:,} instances stay the originals"
    made = f"{polygons_text(polygons)} made in {seconds_text(sum(figures['seconds'].values()))}"
    return f"{made}, facets of {figures['facet_pixels']:.2g} pixels" if figures.get("coarser") else made


@lru_cache(maxsize=8)
def steps_of(text: str) -> tuple[tuple[str, ...], ...]:
    """Rows of the table of passes: number, tetrahedra, those to split, polygons, seconds; none if there are none."""
    try:
        return tuple(
            (f"{n}", *(f"{s[key]:,}" for key in ("tetrahedra_made", "split", "polygons")), f"{s['seconds']:.1f}")
            for n, s in enumerate(json.loads(text)["steps"], start=1)
        )
    except (ValueError, KeyError, TypeError):
        return ()


class TETFLORA_PT_statistics(SidebarPanel, bpy.types.Panel):
    """Statistics."""

    bl_label = "Statistics"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        rows = rows_of(context.scene.tetflora.statistics)
        if not rows:
            layout.label(text="Nothing refined yet", icon='INFO')
            return
        split = layout.split(factor=0.58)
        names, values = split.column(align=True), split.column(align=True)
        values.alignment = 'RIGHT'
        for name, value in rows:
            names.label(text=name)
            values.label(text=value)
        steps = steps_of(context.scene.tetflora.statistics)
        if steps and (body := section(layout, "Passes")):
            grid = body.grid_flow(row_major=True, columns=5, even_columns=False, align=True)
            for text in (text for row in (("Pass", "Tetrahedra", "To Split", "Polygons", "s"), *steps) for text in row):
                grid.label(text=text)
