# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine: First Forest while the scene has no plants, then buttons, state and settings of refinement."""

from math import isclose

import bpy

from ..operators.marks import can_be_explicit
from ..tetflora_addon.blender.job.forecast import forecast_text, memory_text
from ..tetflora_addon.blender.job.render import render_errors
from ..tetflora_addon.blender.placing.first_forest import is_first_forest
from ..tetflora_addon.blender.results.output import KIND
from ..tetflora_addon.blender.results.proxy_kinds import few_bounces, proxy_kind_of
from ..tetflora_addon.blender.scene.objects import has_contents, has_plants, is_drop, is_scatter, may_scatter
from ..tetflora_addon.blender.viewport import auto
from .base import (
    Button,
    SidebarPanel,
    TETFLORA_UL_leaf_objects,
    draw_below,
    draw_message,
    draw_properties,
    section,
    shown_length,
    split_layout,
)
from .results import made_of

_FEW = 200  # objects to look through at every movement of the mouse; a larger scene is not a new one


class TETFLORA_PT_refine(SidebarPanel, bpy.types.Panel):
    """Refine: above the others, because the tab is longer than most screens are tall."""

    bl_label = "Refine"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.tetflora
        if len(context.scene.objects) <= _FEW and not has_contents(context.scene):
            column = layout.box().column()
            column.scale_y = 1.6
            Button("first_forest", 'WORLD').draw(column)
            layout.label(text="Then click Refine and press F12")
        row = layout.row(align=True)
        row.scale_y = 1.4
        row.operator("tetflora.refine", icon='MOD_DECIM')
        row.operator("tetflora.clear", icon='TRASH')
        if settings.auto_refine:  # a line of its own also while nothing is done: what comes and goes moves all below
            draw_message(context, layout, auto.message() or "Refine Automatically is on", 'SORTTIME')
        for error in render_errors()[-1:]:
            draw_message(context, layout, error)
        units = context.scene.unit_settings
        if units.system != 'NONE' and not isclose(units.scale_length, 1.0, rel_tol=1e-3):
            text = f"One unit is 1 m for plants, whatever Unit Scale says: a tree of 20 m shows as {shown_length(20.0)}"
            draw_message(context, layout, text)
            layout.prop(units, "scale_length")
        if context.scene.camera is None:
            draw_message(context, layout, "The scene has no camera; add one, and make it active with Ctrl Numpad 0")
        elif changed := [] if settings.auto_refine else auto.changed_since(context.scene):
            text = f"Results are out of date: {', '.join(changed)} changed since. Click Refine"
            draw_message(context, layout, text, 'FILE_REFRESH')
        elif text := hint(context.scene) or made_of(settings.statistics):
            draw_message(context, layout, text, 'INFO')
        expected = forecast_text(context.scene, context.view_layer)
        for number, text in enumerate(expected.splitlines()):
            draw_message(context, layout, text, 'BLANK1' if number else 'TIME')
        layout = split_layout(self)
        column = layout.column()
        column.active = not settings.expand_everything
        names = ("quality", "cutoff", "shadow_cutoff", "proxy_kind", "baked_light", "max_polygons")
        draw_properties(column, settings, *names)
        _draw_memory(column, context.scene)
        active = context.view_layer.objects.active  # and not the context's, which is None while results hide it
        if active is not None and (can_be_explicit(active) or active.tetflora.is_explicit):
            layout.prop(active.tetflora, "is_explicit")
        if active is not None and (may_scatter(active) or is_scatter(active)):
            _draw_scatter(layout, active)
        draw_properties(layout, settings, "refine_at_render", "auto_refine")
        if expected and settings.refine_at_render and not context.scene.render.use_lock_interface:
            draw_message(context, layout, "Lock Interface is off: the window stands still while frames are refined")
            layout.prop(context.scene.render, "use_lock_interface")
        row = layout.row()
        row.active = settings.auto_refine
        row.prop(settings, "follow_viewport")
        for title, draw in _SECTIONS.items():
            if body := section(layout, title):
                body.active = title == "Limits" or not settings.expand_everything
                draw(body, context.scene)
        if body := section(layout, "Animation", switch=(settings, "share_frames")):
            _draw_animation(body, context.scene)
        if body := section(layout, "Leaf Objects"):
            TETFLORA_UL_leaf_objects.draw_in(body, settings)


def _draw_scatter(layout: bpy.types.UILayout, obj: bpy.types.Object) -> None:
    """Whether what an object scatters is refined; the mark of a linked one is not its own."""
    if obj.library is None and is_drop(obj):
        layout.label(text="A plant of the species that it shows", icon='CHECKMARK')
    elif obj.library is None:
        layout.prop(obj.tetflora, "is_scatter")
    else:
        marked = is_scatter(obj)
        text, icon = ("Refine Scatter", 'CHECKBOX_HLT' if marked else 'CHECKBOX_DEHLT')
        Button("refine_scatter", icon, text).draw(layout, depress=marked)


def _draw_memory(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """The limit of memory, and what it is where the artist sets none."""
    row = layout.row(align=True)
    row.prop(scene.tetflora, "max_memory")
    unit = row.row()
    unit.ui_units_x = 1.4
    unit.label(text="GB")  # Blender has no unit for memory
    if text := memory_text(scene):
        draw_below(layout, text)


def hint(scene: bpy.types.Scene) -> str:
    """Text for a scene with plants of which nothing is refined; otherwise empty. Cheap as a rule."""
    settings = scene.tetflora
    if settings.statistics:
        return ""
    if settings.refine_at_render:
        return "Click Refine, then press F12" if is_first_forest(scene) and has_contents(scene) else ""
    # The first object of a collection shows whether it was kept as meshes: a panel cannot look through all objects.
    first = (next(iter(collection.objects), None) for collection in scene.collection.children_recursive)
    kept = any(obj is not None and KIND in obj for obj in first)
    return "" if kept or not has_plants(scene) else "Nothing is refined, so renders show no plants"


def _draw_proxies(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    settings, form, cycles = scene.tetflora, proxy_kind_of(scene), getattr(scene, "cycles", None)
    draw_properties(layout, settings, "leaf_limit", "facet")
    if form.bounces and cycles is not None:
        layout.prop(cycles, "transparent_max_bounces", text="Transparent")
        if few_bounces(scene):
            layout.label(text="Too few: Cycles renders proxies black", icon='ERROR')
    if form.sockets and (body := section(layout, "Proxy Shading")):
        body.active = settings.baked_light == 'OFF'
        draw_properties(body, settings, *form.sockets.values())


def _draw_assets(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Always there, because to look for any among all objects takes too long for a panel."""
    layout.prop(scene.tetflora, "asset_detail", text="Detail")  # the section's name is the rest of its name


def _draw_visibility(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    settings = scene.tetflora
    layout.prop(settings, "visibility_resolution", text="Resolution")  # the whole name is wider than labels are
    draw_properties(layout, settings, "hidden", "block", "few_polygons")


def _draw_limits(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    column = layout.column()
    column.active = not scene.tetflora.expand_everything
    draw_properties(column, scene.tetflora, "max_tetrahedra", "max_levels", "max_passes")
    layout.prop(scene.tetflora, "expand_everything")


#: Sections of Refine by title, most of them inactive where everything is expanded.
_SECTIONS = {
    "Proxies": _draw_proxies,
    "Assets": _draw_assets,
    "Visibility": _draw_visibility,
    "Limits": _draw_limits,
}


def _draw_animation(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    settings, column = scene.tetflora, layout.column()
    column.active = settings.share_frames and settings.refine_at_render
    draw_properties(column, settings, "cell_length", "cell_turn", "kept_memory")
    column.prop(scene.render, "use_persistent_data")  # Cycles then loads what frames share only once
    layout.prop(settings, "anchored")
