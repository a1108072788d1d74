# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tabs of Properties: how plants are refined for renders, what becomes of results, passes; extras for developers."""

import json
from functools import lru_cache

import bpy

from ..tetflora_addon.blender.job.forecast import memory_text, polygons_text, seconds_text
from ..tetflora_addon.blender.placing.plant_objects import plant_collections
from ..tetflora_addon.blender.results.proxy_kinds import proxy_kind_of
from ..tetflora_addon.blender.settings import active_in
from ..tetflora_addon.blender.viewport import state
from .base import Button, draw_below, draw_properties, draw_species, panel, section


@panel("TetFlora", "rendering.md#detail", tab="render")
def TETFLORA_PT_render(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """How finely plants are refined, and as what."""
    scene = context.scene
    settings, cycles = scene.tetflora, getattr(scene, "cycles", None)
    layout.prop(settings, "quality")
    column = layout.column()
    column.active = not settings.expand_everything
    names = ("cutoff", "shadow_cutoff", "proxy_kind", "baked_light", "max_polygons", "asset_detail")
    draw_properties(column, settings, *names)
    draw_below(column, memory_text(scene), "Memory")
    form = proxy_kind_of(scene)
    if form.bounces and cycles is not None:
        column.prop(cycles, "transparent_max_bounces", text="Transparent")
    layout.prop(settings, "refine_at_render")
    row = layout.row()
    row.active = settings.auto_refine
    row.prop(settings, "follow_viewport")
    if body := section(layout, "Animation", switch=(settings, "share_frames")):
        body.active = settings.share_frames and settings.refine_at_render
        body.prop(settings, "cell_length")
        body.prop(scene.render, "use_persistent_data")  # Cycles then loads what frames share only once
    if body := section(layout, "Leaf Objects"):
        draw_species(body, settings, "leaf_objects")


@panel("TetFlora Results", "rendering.md#output", tab="output", bl_options={'DEFAULT_CLOSED'})
def TETFLORA_PT_output(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What becomes of results."""
    layout.column().prop(context.scene.tetflora.output, "results_in")
    for collection in plant_collections(context.scene):
        column = layout.column(heading=collection.name)
        column.prop(collection, "hide_viewport", text="Viewports", toggle=False, invert_checkbox=True)
        column.prop(collection, "hide_render", text="Renders", toggle=False, invert_checkbox=True)
    layout.operator("tetflora.keep_results", icon='MESH_DATA')


@panel("TetFlora Results", "rendering.md#output", tab="view_layer", bl_options={'DEFAULT_CLOSED'})
def TETFLORA_PT_view_layer(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Rays, pass indices, light groups and materials of results, of all and by species."""
    output, layer = context.scene.tetflora.output, context.view_layer
    layout.prop(output, "pass_index")
    layout.prop_search(output, "light_group", layer, "lightgroups")
    if body := section(layout, "Ray Visibility"):
        body.use_property_split = False
        body.column(align=True).prop(output, "ray_visibility", expand=True)
    if body := section(layout, "By Species"):
        draw_species(body, output)
        if entry := active_in(output, "species"):
            body.prop(entry, "pass_index")
            body.prop_search(entry, "light_group", layer, "lightgroups")
            for name in ("leaf", "blossom", "bark"):
                body.prop(entry, name, text=name.capitalize())  # the field itself says Material


def draw_in_overlays(panel: bpy.types.Panel, context: bpy.types.Context) -> None:
    """As what viewports show plants, in Blender's popover of overlays; Blender's own Empties cost more than plants."""
    column = panel.layout.column()
    column.label(text="TetFlora Plants")
    column.prop(context.scene.tetflora.preview, "plants", text="")


@panel(
    "TetFlora Statistics",
    "rendering.md#preview-and-statistics",
    tab="render",
    poll=lambda context: context.preferences.view.show_developer_ui,
    bl_options={'DEFAULT_CLOSED'},
)
def TETFLORA_PT_developer(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Levels of refinement in viewports and figures of the last one; with Developer Extras in the preferences."""
    scene = context.scene
    if rows := rows_of(scene.tetflora.statistics):
        split = layout.split(factor=0.58)
        names, values = split.column(align=True), split.column(align=True)
        values.alignment = 'RIGHT'
        for name, value in rows:
            names.label(text=name)
            values.label(text=value)
    else:
        layout.label(text="Nothing refined yet", icon='INFO')
    steps = steps_of(scene.tetflora.statistics)
    if steps and (body := section(layout, "Passes")):
        grid = body.grid_flow(row_major=True, columns=5, even_columns=False, align=True)
        for text in (text for row in (("Pass", "Tetrahedra", "To Split", "Polygons", "s"), *steps) for text in row):
            grid.label(text=text)
    if body := section(layout, "Levels", closed=False):
        _draw_levels(body, scene)


def _draw_levels(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    settings, preview = scene.tetflora.preview, state.find(scene)
    row = layout.row(align=True)
    row.operator("tetflora.preview_levels", icon='MOD_REMESH')
    Button("preview_levels", 'X', "", {"clear": True}).draw(row)
    layout.prop(settings, "freeze")
    Button("look", 'VIEW_CAMERA', "Look Through Camera", {"where": 'BACK'}).draw(layout)
    if preview is None or preview.levels is None:
        return
    layout.prop(settings, "level", text=f"Level of {preview.levels.levels[-1].number}", slider=True)
    layout.prop(settings, "wires")
    row = layout.row()
    row.active = settings.wires
    row.prop(settings, "color")
    layout.prop(settings, "projected")
    layout.column(align=True).prop(settings, "forms")
    layout.prop(settings, "statistics")
    if state.is_outdated(scene):
        layout.label(text="The camera has changed: compute again", icon='ERROR')


@lru_cache(maxsize=8)
def rows_of(text: str) -> tuple[tuple[str, str], ...]:
    """Rows of the table, (name, value), from the stored JSON, for each redraw; none if there is none that is ours."""
    try:
        figures = json.loads(text)
        seconds = figures["seconds"]
        full = figures["polygons_full"]
        fraction = f"{figures['polygons_meshed'] / full:.1%}" if full else "–"
        instances = {"Instances": "instances", "    Originals": "instances_whole", "    Clusters": "instances_clusters"}
        return (
            ("Plants", f"{figures['plants']:,}"),
            *((name, f"{figures[key]:,}") for name, key in instances.items() if figures.get("instances")),
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
    if figures.get("coarser"):
        return f"{polygons_text(polygons)}, facets of {figures['facet_pixels']:.2g} pixels"
    return f"{polygons_text(polygons)} made in {seconds_text(sum(figures['seconds'].values()))}"


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
