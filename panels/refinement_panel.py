# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sub-panels of Refine: proxies, visibility, limits, animation and leaf objects."""

import bpy

from ..tetflora_addon.blender.proxy_forms import form_of
from ..tetflora_addon.blender.shell_bounces import few_bounces
from .base import SidebarPanel, split_layout
from .lists import TETFLORA_UL_leaf_objects, draw_list


class _PartOfRefine(SidebarPanel):
    """Mix-in for sub-panels of Refine, closed at first."""

    bl_parent_id = "TETFLORA_PT_refine"
    bl_options = {'DEFAULT_CLOSED'}

    def column(self, context: bpy.types.Context, *names: str) -> bpy.types.UILayout:
        """A column with settings of the scene, inactive where everything is expanded."""
        settings = context.scene.tetflora
        column = split_layout(self).column()
        column.active = not settings.expand_everything
        for name in names:
            column.prop(settings, name)
        return column


class TETFLORA_PT_proxies(_PartOfRefine, bpy.types.Panel):
    """Proxies."""

    bl_label = "Proxies"

    def draw(self, context: bpy.types.Context) -> None:
        column = self.column(context, "leaf_limit", "facet")
        cycles = getattr(context.scene, "cycles", None)
        if form_of(context.scene).bounces and cycles is not None:
            column.prop(cycles, "transparent_max_bounces", text="Transparent")
            if few_bounces(context.scene):
                column.label(text="Too few: Cycles renders proxies black", icon='ERROR')


class TETFLORA_PT_proxy_shading(_PartOfRefine, bpy.types.Panel):
    """Proxy shading."""

    bl_label = "Proxy Shading"
    bl_parent_id = "TETFLORA_PT_proxies"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(form_of(context.scene).sockets)

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.tetflora
        column = split_layout(self).column()
        column.active = not settings.expand_everything and settings.baked_light == 'OFF'
        for name in form_of(context.scene).sockets.values():
            column.prop(settings, name)


class TETFLORA_PT_visibility(_PartOfRefine, bpy.types.Panel):
    """Visibility."""

    bl_label = "Visibility"

    def draw(self, context: bpy.types.Context) -> None:
        self.column(context, "visibility_resolution", "hidden", "block", "few_polygons")


class TETFLORA_PT_limits(_PartOfRefine, bpy.types.Panel):
    """Limits."""

    bl_label = "Limits"

    def draw(self, context: bpy.types.Context) -> None:
        self.column(context, "max_memory", "max_tetrahedra", "max_levels", "max_passes")
        self.layout.prop(context.scene.tetflora, "expand_everything")


class TETFLORA_PT_films(_PartOfRefine, bpy.types.Panel):
    """Animation."""

    bl_label = "Animation"

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
        layout.prop(settings, "anchored")


class TETFLORA_PT_leaf_objects(_PartOfRefine, bpy.types.Panel):
    """Leaf objects."""

    bl_label = "Leaf Objects"

    def draw(self, context: bpy.types.Context) -> None:
        draw_list(
            self.layout,
            TETFLORA_UL_leaf_objects,
            context.scene.tetflora,
            ("leaf_objects", "leaf_objects_index"),
            'LEAVES',
        )


CLASSES = (
    TETFLORA_PT_proxies,
    TETFLORA_PT_proxy_shading,
    TETFLORA_PT_visibility,
    TETFLORA_PT_limits,
    TETFLORA_PT_films,
    TETFLORA_PT_leaf_objects,
)
