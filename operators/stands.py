# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Grow stands, let them grow in an animation, and keep a year of them."""

from collections.abc import Generator

import bpy
from bpy.props import IntProperty

from ..tetflora_addon.blender.stands.growing import (
    GrownStand,
    again_steps,
    animate,
    is_stand,
    keep_year,
    new_stand_steps,
)
from ..tetflora_addon.jobs import Progress
from .base import ModalJob, Reporting, counted, in_object_mode, need, select_only, show_shapes
from .populations import ground_selected, selected_grounds

_ACTIVE = (
    in_object_mode,
    need(lambda context: is_stand(context.active_object), "The active object must be a stand; use Grow Stand first"),
    need(
        lambda context: context.active_object.library is None and context.active_object.data.library is None,
        "The stand is linked from another file; use Object > Relations > Make Local",
    ),
)


class _Growing(ModalJob):
    """Mix-in for operators that grow a stand."""

    def finish(self, context: bpy.types.Context, result: GrownStand) -> set[str]:
        select_only(context, [result.field])
        show_shapes(context.scene)
        context.scene.update_tag()
        return self.done(f"{counted(result.plants, 'plant')} after {counted(result.years, 'year')}")


class TETFLORA_OT_grow_stand(_Growing, bpy.types.Operator):
    """Grow a wood on the selected meshes, year by year: plants compete for light, die, fall and come up from seed.

    The result is one field of plants with its whole history. Change the settings of its years, species and site, then
    use Grow Again.
    """

    bl_label = "Grow Stand"
    needs = (in_object_mode, ground_selected)

    def steps(self, context: bpy.types.Context) -> Generator[Progress, bool | None, GrownStand]:
        return new_stand_steps(context.scene, context.evaluated_depsgraph_get(), selected_grounds(context))


class TETFLORA_OT_grow_again(_Growing, bpy.types.Operator):
    """Grow the active stand again by its present settings, in place of all its plants."""

    bl_label = "Grow Again"
    needs = _ACTIVE

    def steps(self, context: bpy.types.Context) -> Generator[Progress, bool | None, GrownStand]:
        return again_steps(context.scene, context.evaluated_depsgraph_get(), context.active_object)


class TETFLORA_OT_animate_growth(Reporting, bpy.types.Operator):
    """Key the year of the active stand from its first year to its last, and turn on Smooth Growth."""

    bl_label = "Animate Growth"
    needs = _ACTIVE

    first: IntProperty(
        name="First Frame", description="Frame of the first year; that of the scene if not set", options={'SKIP_SAVE'}
    )
    last: IntProperty(
        name="Last Frame", description="Frame of the last year; that of the scene if not set", options={'SKIP_SAVE'}
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        scene, properties = context.scene, self.properties
        if not properties.is_property_set("first"):
            self.first = scene.frame_start
        if not properties.is_property_set("last"):
            self.last = scene.frame_end
        if self.last <= self.first:
            return self.refused("Last Frame must be after First Frame")
        begin, end = animate(context.active_object, self.first, self.last)
        scene.frame_set(scene.frame_current)
        return self.done(f"Year {begin:g} at frame {self.first}, year {end:g} at frame {self.last}")


class TETFLORA_OT_keep_year(Reporting, bpy.types.Operator):
    """Keep the active stand as it is in its present year, as an ordinary field of plants, and forget all other years
    and their keys.

    The brush and other tools can then change it. Grow Again brings the years back.
    """

    bl_label = "Keep Year"
    needs = _ACTIVE

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        text = "All other years of the stand and their keys are removed. Grow Again brings the years back"
        return context.window_manager.invoke_confirm(self, event, message=text, confirm_text=self.bl_label)

    def run(self, context: bpy.types.Context) -> set[str]:
        number = keep_year(context.active_object)
        context.scene.update_tag()
        return self.done(f"{counted(number, 'plant')} kept")
