# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cover the ground of a population: with low plants and what falls on it, and with snow."""

from collections.abc import Generator

import bpy
from bpy.props import BoolProperty

from ..tetflora_addon.blender.placing.cover import (
    Covered,
    cover_steps,
    cover_with_snow,
    covered_population,
    strew_steps,
)
from ..tetflora_addon.blender.placing.rules import active_population
from ..tetflora_addon.blender.viewport import points
from ..tetflora_addon.jobs import Progress
from .base import ModalJob, Reporting, counted, in_object_mode, need, show_shapes


class TETFLORA_OT_ground_cover(ModalJob, bpy.types.Operator):
    """Cover the ground under the active population with grass, moss and herbs by the light there, and with leaves,
    branches and logs of its species where they fall.

    The cover is a population of its own; use again to renew it after changes above.
    """

    bl_label = "Ground Cover"
    needs = (
        in_object_mode,
        need(lambda context: active_population(context.scene), "Add a population first; its ground is then covered"),
    )

    soil: BoolProperty(
        name="Soil",
        description="Give the ground a material in the colors of what lies there, unless it has one of yours",
        default=True,
    )

    fallen: BoolProperty(
        name="Fallen Leaves",
        description="With Seasons on, strew in a population of their own the leaves that the plants above shed in "
        "autumn, as many as are no longer on them",
        default=True,
    )

    def steps(self, context: bpy.types.Context) -> Generator[Progress, bool | None, Covered]:
        scene, depsgraph = context.scene, context.evaluated_depsgraph_get()
        made = yield from cover_steps(scene, depsgraph, covered_population(scene), self.soil)
        if self.fallen and scene.tetflora.year.enabled:
            yield from strew_steps(scene, depsgraph, covered_population(scene))
        return made

    def finish(self, context: bpy.types.Context, result: Covered) -> set[str]:
        points.schedule()
        show_shapes(context.scene)
        kept = ""
        if result.bare:
            kept = f'; "{result.bare[0]}" keeps its own material'
        if not result.made.number:
            return self.refused(f"Nothing grows here: {result.made.reason}")
        return self.done(f"{counted(result.made.number, 'plant')} cover the ground{kept}")


class TETFLORA_OT_ground_snow(Reporting, bpy.types.Operator):
    """Add the snow of the scene to the materials of the active population's ground, as a node before their output.

    Soil of Ground Cover needs none of it.
    """

    bl_label = "Snow on Ground"
    needs = (
        in_object_mode,
        need(lambda context: active_population(context.scene), "Add a population first; its ground can then have snow"),
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        found = cover_with_snow(context.scene, covered_population(context.scene))
        if not found:
            return self.refused("The materials of the ground have snow already")
        return self.done(f"{counted(len(found), 'material')} can have snow; set Snow under Year and Age")
