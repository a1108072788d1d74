# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add layers to a ground: a biome, a cover, a stand and its years. `add` scatters populations."""

import bpy
from bpy_extras.io_utils import ImportHelper

from ..tetflora_addon.blender.biomes.adding import BiomeResult, add_biome_steps, make_land
from ..tetflora_addon.blender.biomes.files import import_biome, read_biome
from ..tetflora_addon.blender.biomes.layers import active_layer
from ..tetflora_addon.blender.biomes.library import BIOMES, NO_BIOME, biomes
from ..tetflora_addon.blender.declare import boolean, once
from ..tetflora_addon.blender.placing.cover import CoverResult, cover_steps, covered_population, strew_steps
from ..tetflora_addon.blender.placing.first_forest import is_startup
from ..tetflora_addon.blender.placing.rules import active_population
from ..tetflora_addon.blender.runtime import is_there
from ..tetflora_addon.blender.stands.growing import GrownStand, animate, is_stand, keep_year, new_stand_steps
from ..tetflora_addon.blender.viewport import points
from ..tetflora_addon.errors import SceneError
from ..tetflora_addon.jobs import Job, Progress
from .base import FileTool, ModalJob, Reporting, counted, in_object_mode, need, select_only, show_shapes
from .layers import ground_found, grounds_to_plant, selected_grounds, tell_layers


class TETFLORA_OT_add_biome(ModalJob, bpy.types.Operator):
    """Add a biome with all of its layers of plants, ground cover and soil to the selected meshes.

    Without a selected mesh, a hectare of land is made at the 3D cursor.
    """

    bl_label = "Add Biome"
    needs = (in_object_mode,)

    biome: BIOMES()
    seed: once.integer("Seed", "A different seed gives a different arrangement")
    season: once.boolean(
        "Set Season", "Turn on Seasons and go to the day of the year that the biome is made for, if it has one"
    )

    def steps(self, context: bpy.types.Context) -> Job[BiomeResult]:
        yield Progress(0.0, "Reading the biome")
        scene = context.scene
        if not self.properties.is_property_set("biome"):
            self.biome = scene.tetflora.new_biome
        if self.biome == NO_BIOME:
            raise SceneError("There are no biomes; reinstall TetFlora, or import one")
        biome = read_biome(biomes()[self.biome].path)
        grounds, land = selected_grounds(context), None
        cube = scene.objects.get("Cube") if is_startup(scene) else None
        if cube is not None or not grounds:
            land = make_land(scene, biome.ground, self.seed)
            grounds = [land]
        hidden = [] if cube is None else [(cube, cube.hide_viewport, cube.hide_render)]
        for obj, *_ in hidden:
            obj.hide_viewport = obj.hide_render = True
        try:
            context.view_layer.update()
            made = yield from add_biome_steps(scene, context.evaluated_depsgraph_get(), biome, grounds, self.seed)
        except BaseException:  # an error, or Esc
            if is_there(land):
                bpy.data.meshes.remove(land.data)
            for obj, viewport, render in hidden:
                if is_there(obj):
                    obj.hide_viewport, obj.hide_render = viewport, render
            raise
        if self.season and "day" in biome.season:
            year = scene.tetflora.year
            year.enabled, year.day = True, biome.season["day"]
            year.latitude = biome.season.get("latitude", year.latitude)
        select_only(context, grounds)
        return made

    def finish(self, context: bpy.types.Context, result: BiomeResult) -> set[str]:
        points.schedule()
        show_shapes(context.scene)
        sun = any(o.type == 'LIGHT' and o.data.type == 'SUN' for o in context.scene.objects)
        more = ". Click Refine to see them" if sun else ". Click Daylight, then Refine, to see them"
        numbers = [number for _, number in result.layers]
        return tell_layers(self, f'"{result.name}": ', numbers, result.bare, result.kept, more)


class TETFLORA_OT_ground_cover(ModalJob, bpy.types.Operator):
    """Cover the ground under the active layer with grass, moss and herbs by the light there, and with leaves, branches
    and logs of its species where they fall.

    The cover is a layer of its own; use again to renew it after changes above.
    """

    bl_label = "Ground Cover"
    needs = (
        in_object_mode,
        need(lambda context: active_population(context.scene), "Add a layer first; its ground is then covered"),
    )

    soil: boolean(
        "Soil", "Give the ground a material in the colors of what lies there, unless it has one of yours", True
    )

    fallen: boolean(
        "Fallen Leaves",
        "With Seasons on, strew in a layer of their own the leaves that the plants above shed in autumn, "
        "as many as are no longer on them",
        True,
    )

    def steps(self, context: bpy.types.Context) -> Job[CoverResult]:
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


class TETFLORA_OT_grow_stand(ModalJob, bpy.types.Operator):
    """Grow a wood on the selected meshes, year by year: plants compete for light, die, fall and come up from seed.

    The result is one field of plants with its whole history. Change the settings of its years, species and site, then
    use Update.
    """

    bl_label = "Grow Stand"
    needs = (in_object_mode, ground_found)

    def steps(self, context: bpy.types.Context) -> Job[GrownStand]:
        return new_stand_steps(context.scene, context.evaluated_depsgraph_get(), grounds_to_plant(context))

    def finish(self, context: bpy.types.Context, result: GrownStand) -> set[str]:
        select_only(context, [result.field])
        show_shapes(context.scene)
        context.scene.update_tag()
        return self.done(f"{counted(result.plants, 'plant')} after {counted(result.years, 'year')}")


def active_stand(context: bpy.types.Context) -> bpy.types.Object | None:
    """The stand that is the active object, or else the active layer."""
    layer = active_layer(context.scene)
    found = (context.active_object, None if layer is None else layer.field)
    return next((obj for obj in found if is_stand(obj)), None)


_ACTIVE = (
    in_object_mode,
    need(active_stand, "The active layer must be a stand; use Grow Stand first"),
    need(
        lambda context: active_stand(context).library is None and active_stand(context).data.library is None,
        "The stand is linked from another file; use Object > Relations > Make Local",
    ),
)


class TETFLORA_OT_animate_growth(Reporting, bpy.types.Operator):
    """Key the year of the active stand from its first year to its last, and turn on Smooth Growth."""

    bl_label = "Animate Growth"
    needs = _ACTIVE

    first: once.integer("First Frame", "Frame of the first year; that of the scene if not set")
    last: once.integer("Last Frame", "Frame of the last year; that of the scene if not set")

    def run(self, context: bpy.types.Context) -> set[str]:
        scene, properties = context.scene, self.properties
        if not properties.is_property_set("first"):
            self.first = scene.frame_start
        if not properties.is_property_set("last"):
            self.last = scene.frame_end
        if self.last <= self.first:
            return self.refused("Last Frame must be after First Frame")
        begin, end = animate(active_stand(context), self.first, self.last)
        scene.frame_set(scene.frame_current)
        return self.done(f"Year {begin:g} at frame {self.first}, year {end:g} at frame {self.last}")


class TETFLORA_OT_keep_year(Reporting, bpy.types.Operator):
    """Keep the active stand as it is in its present year, as an ordinary field of plants, and forget all other years
    and their keys.

    The brush and other tools can then change it. Update brings the years back.
    """

    bl_label = "Keep Year"
    needs = _ACTIVE

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        text = "All other years of the stand and their keys are removed. Update brings the years back"
        return context.window_manager.invoke_confirm(self, event, message=text, confirm_text=self.bl_label)

    def run(self, context: bpy.types.Context) -> set[str]:
        number = keep_year(active_stand(context))
        context.scene.update_tag()
        return self.done(f"{counted(number, 'plant')} kept")


class TETFLORA_OT_import_biome(FileTool, bpy.types.Operator, ImportHelper):
    """Copy a biome's file to your folder of biomes, with the picture of the same name beside it."""

    bl_label = "Import Biome"
    bl_options = {'REGISTER'}

    replace: once.boolean("Replace", "Replace your own biome of the same file name")

    def run(self, context: bpy.types.Context) -> set[str]:
        identifier = import_biome(self.path, self.replace)
        context.scene.tetflora.new_biome = identifier
        return self.done(f'Biome "{biomes()[identifier].name}" imported; click Add Biome to use it')
