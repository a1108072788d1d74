# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Wind: how strong, where to, and how gusty."""

import bpy

from .base import SidebarPanel, split_layout


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
        for name in ("speed", "direction", "gusts", "loop"):
            column.prop(wind, name)


CLASSES = (TETFLORA_PT_wind,)
