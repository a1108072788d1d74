# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Go to a season of the year."""

import bpy
from bpy.props import EnumProperty

from ..tetflora_addon.blender.settings import date_text
from .base import Reporting

#: Days in the middle of the seasons of a temperate wood, in the north.
_DAYS = {'WINTER': 20.0, 'SPRING': 125.0, 'SUMMER': 196.0, 'AUTUMN': 293.0}
_HALF = 182.0


class TETFLORA_OT_set_season(Reporting, bpy.types.Operator):
    """Set Day of Year to the middle of a season at the latitude of the scene, and turn on Seasons."""

    bl_label = "Set Season"

    season: EnumProperty(
        name="Season",
        description="Season to go to",
        items=(
            ('SPRING', "Spring", "Fresh leaves of early May, some still growing"),
            ('SUMMER', "Summer", "Full leaves of July"),
            ('AUTUMN', "Autumn", "Leaves of late October, most of them turned"),
            ('WINTER', "Winter", "Bare branches of January"),
        ),
        default='SUMMER',
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        year = context.scene.tetflora.year
        day = _DAYS[self.season] + (0.0 if year.latitude >= 0.0 else _HALF)
        year.enabled, year.day = True, (day - 1.0) % 365.0 + 1.0
        context.scene.update_tag()  # as a slider does: previews and Refine Automatically listen
        return self.done(date_text(year.day))
