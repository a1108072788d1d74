# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add, plant again, remove and save biomes; import files of biomes and delete them."""

from collections.abc import Generator

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ..tetflora_addon.blender.biomes.adding import (
    BiomeResult,
    add_biome_steps,
    plant_biome_steps,
    remove_biome,
)
from ..tetflora_addon.blender.biomes.files import active_biome, import_biome, read_biome, save_biome, saved_populations
from ..tetflora_addon.blender.biomes.ground import make_land
from ..tetflora_addon.blender.biomes.library import NO_BIOME, OWN_FILES, biome_property, biomes
from ..tetflora_addon.blender.placing.first_forest import is_startup
from ..tetflora_addon.blender.runtime import is_there
from ..tetflora_addon.blender.viewport import points
from ..tetflora_addon.errors import SceneError
from ..tetflora_addon.jobs import Progress
from .base import FileTool, ModalJob, Reporting, counted, in_object_mode, need, select_only, show_shapes
from .populations import selected_grounds

_biome_exists = need(lambda context: active_biome(context.scene), "Add a biome first")


class _Planting(ModalJob):
    """Mix-in for operators that plant a biome."""

    def finish(self, context: bpy.types.Context, result: BiomeResult) -> set[str]:
        points.schedule()
        show_shapes(context.scene)
        number = sum(number for _, number in result.layers)
        text = f'"{result.name}": {counted(number, "plant")} in {counted(len(result.layers), "layer")}'
        if result.kept:
            text += f'; "{result.kept[0]}" keeps its own material'
        if result.bare:
            more = f"; and {counted(len(result.bare) - 1, 'other layer')}" if len(result.bare) > 1 else ""
            self.report({'WARNING'}, f"{text}; without plants: {result.bare[0]}{more}")
            return {'FINISHED'}
        return self.done(f"{text}{self.next_step(context)}")

    def next_step(self, context: bpy.types.Context) -> str:
        """What to do now, for the report."""
        sun = any(o.type == 'LIGHT' and o.data.type == 'SUN' for o in context.scene.objects)
        return ". Click Refine to see them" if sun else ". Add a sun (Add > Light > Sun), then click Refine"


class TETFLORA_OT_add_biome(_Planting, bpy.types.Operator):
    """Add a biome with all of its layers of plants, ground cover and soil to the selected meshes.

    Without a selected mesh, a hectare of land is made at the 3D cursor.
    """

    bl_label = "Add Biome"
    needs = (in_object_mode,)

    biome: biome_property(options={'SKIP_SAVE'})
    seed: IntProperty(name="Seed", description="A different seed gives a different arrangement", options={'SKIP_SAVE'})
    season: BoolProperty(
        name="Set Season",
        description="Turn on Seasons and go to the day of the year that the biome is made for, if it has one",
        options={'SKIP_SAVE'},
    )

    def steps(self, context: bpy.types.Context) -> Generator[Progress, object, BiomeResult]:
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


class TETFLORA_OT_update_biome(_Planting, bpy.types.Operator):
    """Plant all layers of the active biome again by their settings, its mask and its limits, and renew the soil.

    Frozen layers, and stands of which a year is kept, stay as they are.
    """

    bl_label = "Update Biome"
    needs = (in_object_mode, _biome_exists)
    cancelled = "Stopped; layers that were done already keep their new plants"

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        result = {'CANCELLED'}
        try:
            result = super().modal(context, event)
        finally:
            # What was done so far can be undone. Not in `cancel`: Blender calls that also as it loads files and quits.
            if result == {'CANCELLED'} and bpy.ops.ed.undo_push.poll():
                bpy.ops.ed.undo_push(message=self.bl_label)
        return result

    def steps(self, context: bpy.types.Context) -> Generator[Progress, object, BiomeResult]:
        return plant_biome_steps(context.scene, context.evaluated_depsgraph_get(), active_biome(context.scene))

    def next_step(self, _context: bpy.types.Context) -> str:
        return ""


class TETFLORA_OT_remove_biome(Reporting, bpy.types.Operator):
    """Remove the active biome from the scene, with its layers and their plants.

    Plants of frozen layers, and stands of which a year is kept, remain, and so does the ground.
    """

    bl_label = "Remove Biome"
    needs = (in_object_mode, _biome_exists)

    def run(self, context: bpy.types.Context) -> set[str]:
        biome = active_biome(context.scene)
        name = biome.name
        number = remove_biome(context.scene, biome)
        points.schedule()
        return self.done(f'"{name}" removed with {counted(number, "plant")}')


class TETFLORA_OT_save_biome(Reporting, bpy.types.Operator):
    """Save the layers of the active biome to your folder of biomes, for use in all files and to share it; without a
    biome, the populations on the ground of the active population.
    """

    bl_label = "Save as Biome"
    needs = (need(lambda context: saved_populations(context.scene), "Add a biome or populate a ground first"),)
    bl_options = {'REGISTER'}

    name: StringProperty(name="Name", description="Name of the biome, from which that of its file follows")
    description: StringProperty(name="Description", description="What grows there, for the tooltip in menus")
    picture: BoolProperty(name="Last Render", description="Use the last render as the picture of the biome")
    replace: BoolProperty(
        name="Replace", description="Replace your own biome of the same file name", options={'SKIP_SAVE'}
    )

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        biome = active_biome(context.scene)
        self.name = self.name or (biome.name if biome is not None else "My biome")
        return context.window_manager.invoke_props_dialog(self)

    def run(self, context: bpy.types.Context) -> set[str]:
        return self.done(
            f"Saved as {save_biome(context.scene, self.name, self.description, self.picture, self.replace)}"
        )


class TETFLORA_OT_import_biome(FileTool, bpy.types.Operator, ImportHelper):
    """Copy a biome's file to your folder of biomes, with the picture of the same name beside it."""

    bl_label = "Import Biome"
    bl_options = {'REGISTER'}

    replace: BoolProperty(
        name="Replace", description="Replace your own biome of the same file name", options={'SKIP_SAVE'}
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        identifier = import_biome(self.path, self.replace)
        context.scene.tetflora.new_biome = identifier
        return self.done(f'Biome "{biomes()[identifier].name}" imported; click Add Biome to use it')


class TETFLORA_OT_delete_biome(Reporting, bpy.types.Operator):
    """Delete the file of the chosen biome from your folder of biomes. Built-in biomes remain. This cannot be undone."""

    bl_label = "Delete from My Biomes"
    bl_options = {'REGISTER'}
    needs = (
        need(
            lambda context: (info := biomes().get(context.scene.tetflora.new_biome)) is not None and info.is_own,
            "The chosen biome has no file in your folder of biomes",
        ),
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_confirm(self, event)

    def run(self, context: bpy.types.Context) -> set[str]:
        return self.done(f"{OWN_FILES.delete(context.scene.tetflora.new_biome).name} deleted")
