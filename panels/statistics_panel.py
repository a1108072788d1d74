# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistics of the last refinement, from the figures that it left in the scene."""

import json
from functools import lru_cache

import bpy

from .base import SidebarPanel


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
        return (
            ("Plants", f"{figures['plants']:,}"),
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


class TETFLORA_PT_steps(SidebarPanel, bpy.types.Panel):
    """Passes."""

    bl_label = "Passes"
    bl_parent_id = "TETFLORA_PT_statistics"
    bl_options = {'DEFAULT_CLOSED'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(steps_of(context.scene.tetflora.statistics))

    def draw(self, context: bpy.types.Context) -> None:
        grid = self.layout.grid_flow(row_major=True, columns=5, even_columns=False, align=True)
        for row in (("Pass", "Tetrahedra", "To Split", "Polygons", "s"), *steps_of(context.scene.tetflora.statistics)):
            for text in row:
                grid.label(text=text)


CLASSES = (TETFLORA_PT_statistics, TETFLORA_PT_steps)
