# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add, change and remove populations of plants, and cover their ground; write them to files and read them."""

from collections.abc import Generator

import bpy
from bpy.props import BoolProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..tetflora_addon.blender.placing.cover import (
    CoverResult,
    cover_steps,
    cover_with_snow,
    covered_population,
    strew_steps,
)
from ..tetflora_addon.blender.placing.population_files import read_populations, write_populations
from ..tetflora_addon.blender.placing.populations import (
    PlacedPlants,
    add_population,
    make_plants_steps,
    own_objects,
    remove_population,
    reroll_steps,
)
from ..tetflora_addon.blender.placing.rules import active_population, copy_settings, set_grounds
from ..tetflora_addon.blender.viewport import points
from ..tetflora_addon.errors import readable
from ..tetflora_addon.jobs import Progress
from .base import FileTool, ModalJob, Reporting, counted, in_object_mode, need, select_only, show_shapes


def selected_grounds(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected meshes; those of fields are plants, not ground."""
    return [obj for obj in context.selected_objects if obj.type == 'MESH' and not obj.tetflora.is_field]


ground_selected = need(selected_grounds, "Select a mesh to plant on")
_population_exists = need(lambda context: active_population(context.scene), "Add a population first")
_not_frozen = need(
    lambda context: not active_population(context.scene).frozen,
    "The population is frozen; turn off Freeze to change it",
)
_ACTIVE = (in_object_mode, _population_exists)
_REPLACING = (*_ACTIVE, _not_frozen)


class Placing(ModalJob):
    """Mix-in for operators that place the plants of a population."""

    def finish(self, _context: bpy.types.Context, result: PlacedPlants) -> set[str]:
        where = ""
        if result.objects and result.objects[0].tetflora.is_field:
            where = f' in the field "{result.objects[0].name}"'
        placed = f"{counted(result.number, 'plant')} of {result.wanted:,} placed{where}: {result.reason}"
        if result.reason:
            self.report({'WARNING'}, placed)
            return {'FINISHED'}
        returned = f"; {counted(result.returned, 'deleted plant')} restored" if result.returned else ""
        erased = f"; {result.erased:,} omitted where you erased" if result.erased else ""
        return self.done(f"{counted(result.number, 'plant')} placed{where}{returned}{erased}")


class TETFLORA_OT_add_population(Reporting, bpy.types.Operator):
    """Add a population without plants on the selected meshes, with the settings of the active one.

    Adjust the settings, then click Update.
    """

    bl_label = "Add Population"
    needs = (in_object_mode, ground_selected)

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.tetflora
        number = settings.populations_index if active_population(context.scene) else None
        population = add_population(context.scene, selected_grounds(context))
        if number is not None:
            # Fetched again: adding to a list moves what is in it.
            copy_settings(settings.populations[number], population)
        points.schedule()
        return {'FINISHED'}


class TETFLORA_OT_update_population(Placing, bpy.types.Operator):
    """Place the plants of the active population again according to its settings.

    Plants that you moved, changed or deleted are replaced too, except where you erased with the brush; other plants
    keep their space.
    """

    bl_label = "Update Population"
    needs = _REPLACING

    def steps(self, context: bpy.types.Context) -> Generator[Progress, object, PlacedPlants]:
        depsgraph = context.evaluated_depsgraph_get()
        return make_plants_steps(context.scene, depsgraph, active_population(context.scene))


class TETFLORA_OT_reroll_population(Placing, bpy.types.Operator):
    """Place the plants of the active population with a new seed, for a different arrangement."""

    bl_label = "Re-roll Population"
    needs = _REPLACING

    def steps(self, context: bpy.types.Context) -> Generator[Progress, object, PlacedPlants]:
        depsgraph = context.evaluated_depsgraph_get()
        return reroll_steps(context.scene, depsgraph, active_population(context.scene))


class TETFLORA_OT_freeze_population(Reporting, bpy.types.Operator):
    """Protect the plants of the active population from updates and removal.

    Use again to unfreeze: the next update then replaces the plants, with all your changes.
    """

    bl_label = "Freeze Population"
    needs = _ACTIVE

    def run(self, context: bpy.types.Context) -> set[str]:
        population = active_population(context.scene)
        population.frozen = not population.frozen
        state = "frozen and keeps its plants" if population.frozen else "no longer frozen; Update replaces its plants"
        return self.done(f'"{population.name}" is {state}')


class TETFLORA_OT_remove_population(Reporting, bpy.types.Operator):
    """Remove the active population and its plants. Plants of a frozen population remain."""

    bl_label = "Remove Population"
    needs = _ACTIVE

    keep_plants: BoolProperty(
        name="Keep Plants",
        description="Remove only the settings, and keep the plants as individual plants",
        options={'SKIP_SAVE'},
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        index = context.scene.tetflora.populations_index
        name = active_population(context.scene).name
        number = remove_population(context.scene, index, self.keep_plants)
        points.schedule()
        return self.done(f'"{name}" removed with {counted(number, "plant")}')


class TETFLORA_OT_select_population(Reporting, bpy.types.Operator):
    """Select the plants of the active population, or its field."""

    bl_label = "Select Population"
    needs = _ACTIVE

    def run(self, context: bpy.types.Context) -> set[str]:
        own = own_objects(context.scene, active_population(context.scene))
        if not own:
            return self.refused("The population has no plants; click Update")
        select_only(context, own)
        return {'FINISHED'}


class TETFLORA_OT_set_population_ground(Reporting, bpy.types.Operator):
    """Use the selected meshes as ground of the active population. Click Update to place its plants."""

    bl_label = "Use Selected Meshes"
    needs = (*_ACTIVE, ground_selected)

    def run(self, context: bpy.types.Context) -> set[str]:
        set_grounds(active_population(context.scene), selected_grounds(context))
        points.schedule()
        return {'FINISHED'}


class TETFLORA_OT_forget_erased(Reporting, bpy.types.Operator):
    """Allow plants of the active population to grow again where you erased with the brush.

    Click Update to place them.
    """

    bl_label = "Clear Erased Places"
    needs = (
        *_ACTIVE,
        need(lambda context: active_population(context.scene).erased, "No plants of this population were erased"),
        _not_frozen,
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        population = active_population(context.scene)
        population.erased = population.placed_by = ""  # so that the panel asks for an update
        points.schedule()
        return self.done(f'"{population.name}" has no more erased places; click Update to place plants')


class TETFLORA_OT_preview_population(Reporting, bpy.types.Operator):
    """Show a dot in the viewport for each plant that the current settings would place, colored by species, updated with
    every change.

    Creates no objects.
    """

    bl_label = "Preview Points"
    bl_options = {'REGISTER'}

    def run(self, context: bpy.types.Context) -> set[str]:
        points.show(context.scene, not points.shown_in(context.scene))
        return {'FINISHED'}


class TETFLORA_OT_export_populations(FileTool, bpy.types.Operator, ExportHelper):
    """Export the settings of the populations in this scene to a file, for use in other scenes.

    Plants are not exported.
    """

    bl_label = "Export Populations"
    needs = (need(lambda context: context.scene.tetflora.populations, "Add a population first"),)
    bl_options = {'REGISTER'}

    only_active: BoolProperty(name="Only Active", description="Export the active population only")

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.tetflora
        chosen = list(settings.populations)
        if self.only_active:
            chosen = chosen[settings.populations_index :][:1]
        path = write_populations(chosen, self.path)
        return self.done(f"{counted(len(chosen), 'population')} written to {path}")


class TETFLORA_OT_import_populations(FileTool, bpy.types.Operator, ImportHelper):
    """Import populations from a file, without plants; click Update for each.

    They grow on meshes with the names in the file, or else on the selected meshes.
    """

    bl_label = "Import Populations"

    def run(self, context: bpy.types.Context) -> set[str]:
        number, missing = read_populations(context.scene, self.path, selected_grounds(context))
        points.schedule()
        added = f"{counted(number, 'population')} added"
        if not missing:
            return self.done(f"{added}; click Update to place plants")
        self.report({'WARNING'}, readable(f"{added}; missing in this file and left empty: {', '.join(missing)}"))
        return {'FINISHED'}


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

    def steps(self, context: bpy.types.Context) -> Generator[Progress, bool | None, CoverResult]:
        scene, depsgraph = context.scene, context.evaluated_depsgraph_get()
        made = yield from cover_steps(scene, depsgraph, covered_population(scene), self.soil)
        if self.fallen and scene.tetflora.year.enabled:
            yield from strew_steps(scene, depsgraph, covered_population(scene))
        return made

    def finish(self, context: bpy.types.Context, result: CoverResult) -> set[str]:
        points.schedule()
        show_shapes(context.scene)
        kept = f'; "{result.bare[0]}" keeps its own material' if result.bare else ""
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
