# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Grow a Stand: species, years and site of a wood that grows, and the slider through its years."""

import bpy

from ..tetflora_addon.blender.scene.field_sizes import has_history
from ..tetflora_addon.blender.settings import active_in
from ..tetflora_addon.blender.stands.growing import is_stand, shown_stand
from .base import (
    Button,
    SidebarPanel,
    TETFLORA_UL_stand_species,
    draw_properties,
    draw_where,
    section,
    split_layout,
)


class TETFLORA_PT_stand(SidebarPanel, bpy.types.Panel):
    """Grow a stand."""

    bl_label = "Grow a Stand"
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context: bpy.types.Context) -> None:
        layout = split_layout(self)
        stand, active = shown_stand(context), context.active_object
        if is_stand(active):
            if has_history(active):
                column = layout.column()
                column.scale_y = 1.4
                last = active.tetflora.stand.last_year
                text = f"Year of {last:g}" if last else "Year"
                column.prop(active.tetflora, "stand_year", text=text, slider=True)
                layout.prop(active.tetflora, "stand_smooth")
                row = layout.row(align=True)
                Button("animate_growth", 'KEYFRAME').draw(row)
                Button("keep_year", 'PINNED').draw(row)
            Button("grow_again", 'FILE_REFRESH').draw(layout)
        else:
            Button("grow_stand", 'TIME', "Grow Stand on Selected Meshes").draw(layout)
        draw_properties(layout.column(), stand, "years", "density", "recruits", "outside", "seed")
        TETFLORA_UL_stand_species.draw_in(layout, stand)
        if not stand.species:
            layout.label(text="Default: a mixed forest of central Europe", icon='INFO')
        elif entry := active_in(stand, "species"):
            draw_properties(layout.column(align=True), entry, "planted", "incoming_seeds")
        if body := section(layout, "Site"):
            draw_properties(body.column(align=True), stand, "degree_days", "coldest_month")
            draw_properties(body.column(align=True), stand, "moisture", "relief", "fertility")
            draw_where(body, stand)
        if body := section(layout, "Detail"):
            draw_properties(body, stand, "interval", "min_height", "cell", "open_edges")
