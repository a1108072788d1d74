# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refinement: how fine, and in which form."""

import bpy

from ..operators.mark_explicit import can_be_explicit
from ..tetflora_addon.blender.proxy_forms import form_of
from ..tetflora_addon.blender.shell_bounces import few_bounces
from .base import SidebarPanel, split_layout
from .lists import TETFLORA_UL_leaf_objects, draw_list


class TETFLORA_PT_refinement(SidebarPanel, bpy.types.Panel):
    """Refinement."""

    bl_label = "Refinement"
    bl_order = 2

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        settings = context.scene.tetflora
        column = layout.column()
        column.active = not settings.expand_everything
        column.prop(settings, "quality")
        column.prop(settings, "cutoff")
        column.prop(settings, "shadow_cutoff")
        column.prop(settings, "proxy_form")
        column.prop(settings, "baked_light")
        column.prop(settings, "max_polygons")
        cycles = getattr(context.scene, "cycles", None)
        if form_of(context.scene).bounces and cycles is not None:
            column.prop(cycles, "transparent_max_bounces", text="Transparent")
            if few_bounces(context.scene):
                column.label(text="Too few: Cycles draws proxies black", icon='ERROR')
        active = context.active_object
        if active is not None and (can_be_explicit(active) or active.tetflora.is_explicit):
            layout.prop(active.tetflora, "is_explicit")
        layout.prop(settings, "refine_at_render")
        layout.prop(settings, "auto_refine")


class TETFLORA_PT_films(SidebarPanel, bpy.types.Panel):
    """Animation."""

    bl_label = "Animation"
    bl_parent_id = "TETFLORA_PT_refinement"
    bl_options = {'DEFAULT_CLOSED'}

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.tetflora, "share_frames", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        settings = context.scene.tetflora
        column = layout.column()
        column.active = settings.share_frames and settings.refine_at_render
        column.prop(settings, "cell_length")
        column.prop(settings, "cell_turn")
        column.prop(settings, "kept_memory")
        column.prop(context.scene.render, "use_persistent_data")  # Cycles then loads what frames share only once


class TETFLORA_PT_limits(SidebarPanel, bpy.types.Panel):
    """Limits."""

    bl_label = "Limits"
    bl_parent_id = "TETFLORA_PT_refinement"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        settings = context.scene.tetflora
        column = layout.column()
        column.active = not settings.expand_everything
        names = ("leaf_limit", "facet", "visibility_resolution", "few_polygons", "block", "hidden")
        for name in (*names, "max_memory", "max_tetrahedra", "max_levels", "max_passes", "anchored"):
            column.prop(settings, name)
        layout.prop(settings, "expand_everything")


class TETFLORA_PT_proxy_shading(SidebarPanel, bpy.types.Panel):
    """Proxy shading."""

    bl_label = "Proxy Shading"
    bl_parent_id = "TETFLORA_PT_refinement"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(form_of(context.scene).sockets)

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.tetflora
        column = split_layout(self).column()
        column.active = not settings.expand_everything and settings.baked_light == 'OFF'
        for name in form_of(context.scene).sockets.values():
            column.prop(settings, name)


class TETFLORA_PT_leaf_objects(SidebarPanel, bpy.types.Panel):
    """Leaf objects."""

    bl_label = "Leaf Objects"
    bl_parent_id = "TETFLORA_PT_refinement"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        draw_list(
            self.layout,
            TETFLORA_UL_leaf_objects,
            context.scene.tetflora,
            ("leaf_objects", "leaf_objects_index"),
            'LEAVES',
        )


CLASSES = (
    TETFLORA_PT_refinement,
    TETFLORA_PT_films,
    TETFLORA_PT_limits,
    TETFLORA_PT_proxy_shading,
    TETFLORA_PT_leaf_objects,
)
