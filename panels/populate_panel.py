# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Populate: scatter plants over terrain, and say what hides them."""

import bpy

from ..operators import ids
from .base import SidebarPanel, split_layout
from .lists import TETFLORA_UL_mix, draw_list


class TETFLORA_PT_populate(SidebarPanel, bpy.types.Panel):
    """Populate."""

    bl_label = "Populate"
    bl_order = 1

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        settings = context.scene.tetflora.populate
        draw_list(layout, TETFLORA_UL_mix, settings, ("mix", "mix_index"), 'MIX')
        if not settings.mix:
            layout.label(text="First species of the catalogue", icon='INFO')
        column = layout.column(align=True)
        column.prop(settings, "count")
        column.prop(settings, "as_field")
        column.prop(settings, "min_distance")
        column.prop(settings, "slope_limit")
        column = layout.column(align=True)
        column.prop(settings, "scale_min")
        column.prop(settings, "scale_max")
        layout.prop(settings, "seed")
        layout.operator(ids.POPULATE, text="Populate Selected Meshes", icon='OUTLINER_OB_POINTCLOUD')
        active = context.active_object
        marked = active is not None and active.tetflora.is_occluder
        layout.operator(
            ids.MARK_OCCLUDER,
            text="Hides Plants" if marked else "Mark as Hiding Plants",
            icon='CHECKMARK' if marked else 'MOD_MASK',
            depress=marked,
        )
