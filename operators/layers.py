# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers: update, move, duplicate, remove and save them; add biomes, covers and stands. `add` scatters."""

from contextlib import closing

import bpy
from bpy.props import StringProperty
from bpy.types import Operator
from bpy_extras.io_utils import ImportHelper

from ..tetflora_addon.blender.biomes import adding, layers
from ..tetflora_addon.blender.biomes.files import active_biome, import_biome, read_biome, saved_populations
from ..tetflora_addon.blender.biomes.files import save_biome as save_biome_file
from ..tetflora_addon.blender.biomes.library import BIOMES, NO_BIOME, biomes
from ..tetflora_addon.blender.declare import boolean, choice, once, string
from ..tetflora_addon.blender.placing import cover, populations
from ..tetflora_addon.blender.placing.first_forest import is_startup
from ..tetflora_addon.blender.placing.populations import PlacedPlants, make_plants_steps, remove_layer, reroll_steps
from ..tetflora_addon.blender.placing.rules import active_population, briefly, grounds_of, grounds_seen, set_grounds
from ..tetflora_addon.blender.runtime import is_there
from ..tetflora_addon.blender.settings import BIOME, FIELD, SCATTER, named, rules_of, with_identity
from ..tetflora_addon.blender.species.edits import grow_in_wood
from ..tetflora_addon.blender.stands import growing
from ..tetflora_addon.blender.viewport import points
from ..tetflora_addon.errors import SceneError, TetFloraError
from ..tetflora_addon.jobs import Job, Progress, part_of
from .base import FileTool, ModalJob, Reporting, counted, in_object_mode, need, select_only


def selected_grounds(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected meshes; those of fields are plants, not ground."""
    return [obj for obj in context.selected_objects if obj.type == 'MESH' and not obj.tetflora.is_field]


def grounds_to_plant(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected meshes or, without any, the ground of the active layer: what one adds next grows there too."""
    layer = layers.active_layer(context.scene)
    if (grounds := selected_grounds(context)) or layer is None:
        return grounds
    return grounds_of(context.scene, rules_of(layer))


def ground_names(context: bpy.types.Context) -> str:
    """Of the same, as a panel says them: those of a layer as they were found last."""
    grounds, layer = selected_grounds(context), layers.active_layer(context.scene)
    return briefly(grounds) if grounds or layer is None else grounds_seen(layer).names


ground_selected = need(selected_grounds, "Select a mesh to plant on")
ground_found = need(ground_names, "Select a mesh to plant on")
layer_exists = need(lambda context: layers.active_layer(context.scene), "Add a layer first")
scatter_active = need(lambda context: active_population(context.scene), "Click a Scatter or Cover layer first")
_ACTIVE = (in_object_mode, layer_exists)
_ROW = 20.0  # pixels of a row of a list at a scale of 1


def tell_placed(operator: Reporting, plants: PlacedPlants) -> set[str]:
    """Report how many plants of a layer were placed, and why not more."""
    where = ""
    if plants.objects and plants.objects[0].tetflora.is_field:
        where = f' in the field "{plants.objects[0].name}"'
    placed = f"{counted(plants.number, 'plant')} of {plants.wanted:,} placed{where}: {plants.reason}"
    if plants.reason:
        return operator.done(placed, warns=True)
    returned = f"; {counted(plants.returned, 'deleted plant')} restored" if plants.returned else ""
    erased = f"; {plants.erased:,} omitted where you erased" if plants.erased else ""
    return operator.done(f"{counted(plants.number, 'plant')} placed{where}{returned}{erased}")


def tell_layers(
    operator: Reporting, name: str, numbers: list[int], bare: list[str], kept: list[str], more: str = ""
) -> set[str]:
    """Report how many plants several layers have, and which have none."""
    text = f"{name}{counted(sum(numbers), 'plant')} in {counted(len(numbers), 'layer')}"
    if kept:
        text += f'; "{kept[0]}" keeps its own material'
    if bare:
        others = f"; and {counted(len(bare) - 1, 'other layer')}" if len(bare) > 1 else ""
        return operator.done(f"{text}; without plants: {bare[0]}{others}", warns=True)
    return operator.done(text + more)


#: What an update made: results of layers, why others have no plants, grounds that keep a material.
Updated = tuple[list[PlacedPlants | growing.GrownStand | int], list[str], list[str]]


class _InParts(ModalJob):
    """Mix-in for jobs whose parts stay once they are done, as `cancelled` says then."""

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        result = {'CANCELLED'}
        try:
            result = super().modal(context, event)
        finally:
            # What was done so far can be undone. Not in `cancel`: Blender calls that also as it loads files and quits.
            if result == {'CANCELLED'} and self.cancelled != ModalJob.cancelled and bpy.ops.ed.undo_push.poll():
                bpy.ops.ed.undo_push(message=self.bl_label)
        return result


class TETFLORA_OT_update_layers(_InParts, Operator, label="Update", needs=_ACTIVE):
    """Grow layers again by their settings.

    Plants that you moved, changed or deleted are replaced too, except where you erased with the brush; plants of other
    layers keep their space. Frozen layers, and stands of which a year is kept, stay as they are.
    """

    cancelled = "Stopped; layers that were done already keep their new plants"
    which: once.choice(
        "Layers",
        "Which layers to grow again",
        (
            ('DUE', "All That Are Due", "All whose settings or ground have changed, and those without plants"),
            ('ACTIVE', "Active", "The active layer, a biome with all of its layers and its soil, whatever has changed"),
            ('WOOD', "Grown in a Wood", "The active layer, with trees of a dense stand or, again, open-grown ones"),
        ),
    )
    reroll: once.boolean("Re-roll", "With a new seed, for another arrangement")
    forget_erased: once.boolean("Clear Erased Places", "Let plants grow again where you erased with the brush")

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        if properties.reroll or properties.forget_erased:
            name = "reroll" if properties.reroll else "forget_erased"
            return f"Grow the active layer again: {properties.bl_rna.properties[name].description}"
        if properties.which == 'WOOD':
            return "Give the active layer the slim, bare-stemmed trees of a dense stand, or open-grown ones again"
        return cls.bl_description

    def steps(self, context: bpy.types.Context) -> Job[Updated | None]:
        scene, depsgraph = context.scene, context.evaluated_depsgraph_get()
        active, one = layers.active_layer(scene), self.which != 'DUE'
        every = (*layers.children_of(active), active) if one else ()
        if self.which == 'WOOD':
            grown = (layer.mix for layer in every if layer.kind == SCATTER and not layer.frozen)
            grow_in_wood(scene, [entry for mix in grown for entry in mix])
        if one and active.kind == BIOME and not self.reroll:
            added = yield from adding.plant_biome_steps(scene, depsgraph, active)
            return [number for _, number in added.layers], added.bare, added.kept
        uids = [layer.uid for layer in every if layer.kind != BIOME] if one else layers.due_layers(scene)
        return (yield from self._each(scene, depsgraph, uids)) if uids else None

    def _each(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, uids: list[str]) -> Job[Updated]:
        grown, bare = [], []
        biomes = {with_identity(scene.tetflora.layers, uid).biome for uid in uids} - {""}
        for number, uid in enumerate(uids):
            depsgraph.update()  # plants of the layers before shade the ground, and keep others away
            layer = with_identity(scene.tetflora.layers, uid)
            if layer is None:
                continue
            name = named(layer).name
            try:
                with closing(self._steps_of(depsgraph, layer, uids[number + 1 :])) as steps:
                    one = yield from part_of(steps, number / len(uids), (number + 1) / len(uids), name)
                grown.append(one)
                if isinstance(one, PlacedPlants) and one.reason and not one.number:
                    bare.append(f"{name}: {one.reason}")
            except TetFloraError as error:
                if len(uids) == 1:
                    raise
                bare.append(f"{name}: {error}")
        kept = []
        for biome in filter(None, (with_identity(scene.tetflora.layers, uid) for uid in biomes)):
            depsgraph.update()
            kept += adding.lay_biome_soil(depsgraph, [e.object for e in biome.grounds if e.object is not None])
        return grown, bare, kept

    def _steps_of(
        self, depsgraph: bpy.types.Depsgraph, layer: bpy.types.PropertyGroup, later: list[str]
    ) -> Job[PlacedPlants | growing.GrownStand]:
        if layer.kind == FIELD:
            if not growing.is_stand(layer.field):
                raise SceneError(f'"{layer.field.name}" has no rules to grow by; use the brush or edit its points')
            populations.refuse_frozen(layer)
            if self.reroll:
                layer.field.tetflora.stand.seed += 1
            return growing.again_steps(layer.id_data, depsgraph, layer.field)
        if self.forget_erased:
            layer.erased = ""
        return (reroll_steps if self.reroll else make_plants_steps)(layer.id_data, depsgraph, layer, later)

    def finish(self, context: bpy.types.Context, result: Updated | None) -> set[str]:
        if result is None:
            text = "No setting and no ground has changed since the layers were grown. If a mask, area or path has, "
            text += "choose Update This Layer in the menu beside the list"
            if missing := [name for one in context.scene.tetflora.layers for name in grounds_seen(one).missing]:
                text = f'"{missing[0]}" is not in the scene; select a ground and choose Use Selected Meshes in the menu'
            self.report({'INFO'}, text)
            return {'CANCELLED'}
        points.schedule()
        context.scene.update_tag()
        grown, *rest = result
        if len(grown) == 1 and isinstance(grown[0], PlacedPlants):
            return tell_placed(self, grown[0])
        numbers = [n if isinstance(n, int) else n.number if isinstance(n, PlacedPlants) else n.plants for n in grown]
        return tell_layers(self, "", numbers, *rest)


class TETFLORA_OT_move_layer(Reporting, Operator, label="Move Layer", told="direction", needs=(layer_exists,)):
    """Move the active layer, a biome with all of its layers. Of biomes with limits, those above come first."""

    direction: choice(
        "Direction",
        "Where to move it",
        (
            ('UP', "Up", "Before the layer above"),
            ('DOWN', "Down", "After the layer below"),
            ('DRAG', "Drag", "Move it with the mouse; click to drop it, Esc to put it back"),
            ('IN', "Group", "Add it to the group above, or make a new group with the layer above"),
            ('OUT', "Ungroup", "Take it out of its group, and place it below"),
        ),
    )
    layer: StringProperty(options={'HIDDEN', 'SKIP_SAVE'})  # identity of the one to drag

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.direction != 'DRAG':
            return self.execute(context)
        if (index := layers.index_of(context.scene, self.layer)) >= 0:
            context.scene.tetflora.layers_index = index
        self._before, self._mouse_y = [one.uid for one in context.scene.tetflora.layers], event.mouse_y
        context.window_manager.modal_handler_add(self)
        context.window.cursor_modal_set('MOVE_Y')
        return {'RUNNING_MODAL'}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        scene, row = context.scene, _ROW * context.preferences.system.ui_scale
        while abs(self._mouse_y - event.mouse_y) >= row:
            step = 1 if event.mouse_y < self._mouse_y else -1
            self._mouse_y -= step * row
            layers.move_layer(scene, step)
            context.area.tag_redraw()
        done = event.type in {'LEFTMOUSE', 'RET'} and event.value == 'PRESS'
        if not done and event.type not in {'ESC', 'RIGHTMOUSE'}:
            return {'RUNNING_MODAL'}
        context.window.cursor_modal_restore()
        if not done:
            layers.sort_layers(scene, self._before, layers.active_layer(scene).uid)
        points.schedule()
        return {'FINISHED' if done else 'CANCELLED'}

    def run(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        if self.direction == 'IN' and not layers.group_layer(scene):
            return self.refused("Select a single layer to group")
        if self.direction == 'OUT' and not layers.ungroup_layer(scene):
            return self.refused("This layer is not in a group")
        if self.direction in {'UP', 'DOWN'} and not layers.move_layer(scene, -1 if self.direction == 'UP' else 1):
            return {'CANCELLED'}
        points.schedule()
        return {'FINISHED'}


class TETFLORA_OT_duplicate_layer(Reporting, Operator, label="Duplicate Layer", needs=_ACTIVE):
    """Copy the active layer with all of its settings, a biome with its layers; *Update* then grows the copy."""

    to_selected: once.boolean("To Selected Meshes", "Let the copy grow on the selected meshes")

    def run(self, context: bpy.types.Context) -> set[str]:
        grounds = selected_grounds(context) if self.to_selected else None
        if grounds == []:
            return self.failed("Select a mesh to copy the layer to")
        layer = layers.copy_layer(context.scene, layers.active_layer(context.scene), grounds)
        points.schedule()
        return self.done(f'"{named(layer).name}" added; click Update to grow it')


class TETFLORA_OT_remove_layer(Reporting, Operator, label="Remove Layer", needs=_ACTIVE):
    """Remove the active layer and its plants, a biome with all of its layers. Frozen plants and kept years remain."""

    keep_plants: once.boolean("Keep Plants", "Remove only the layer, and keep its plants as plants of your own")

    def run(self, context: bpy.types.Context) -> set[str]:
        scene, layer = context.scene, layers.active_layer(context.scene)
        name, number = named(layer).name, 0
        if layer.kind == BIOME and not self.keep_plants:
            number = adding.remove_biome(scene, layer)
        else:
            for uid in [*(one.uid for one in layers.children_of(layer)), layer.uid]:
                number += remove_layer(scene, layers.index_of(scene, uid), self.keep_plants)
        layers.forget_gone(scene)
        points.schedule()
        return self.done(f'"{name}" removed with {counted(number, "plant")}')


class TETFLORA_OT_set_layer_ground(Reporting, Operator, label="Use Selected Meshes", needs=(*_ACTIVE, ground_selected)):
    """Let the active layer grow on the selected meshes, a biome with all of its layers. Click Update to grow it."""

    def run(self, context: bpy.types.Context) -> set[str]:
        layer = layers.active_layer(context.scene)
        for one in (layer, *layers.children_of(layer)):
            set_grounds(rules_of(one), selected_grounds(context))
        points.schedule()
        return {'FINISHED'}


class TETFLORA_OT_ground_snow(Reporting, Operator, label="Snow on Ground", needs=(in_object_mode, scatter_active)):
    """Add the snow of the scene to the materials of the active layer's ground, as a node before their output.

    Soil of Ground Cover needs none of it.
    """

    def run(self, context: bpy.types.Context) -> set[str]:
        materials = cover.cover_with_snow(context.scene, cover.covered_population(context.scene))
        if not materials:
            return self.refused("The materials of the ground have snow already")
        return self.done(f"{counted(len(materials), 'material')} can have snow; set Snow under Season and Wind")


_may_be_saved = need(lambda context: saved_populations(context.scene), "Add a layer with plants first")


class TETFLORA_OT_save_biome(Reporting, Operator, label="Save as Biome", needs=(_may_be_saved,), options={'REGISTER'}):
    """Save the layers of the active biome, or those on the ground of the active layer, to your folder of biomes."""

    name: string("Name", "Name of the biome, from which that of its file follows")
    description: string("Description", "What grows there, for the tooltip in menus")
    picture: boolean("Last Render", "Use the last render as the picture of the biome")
    replace: once.boolean("Replace", "Replace your own biome of the same file name")

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        biome = active_biome(context.scene)
        shipped = biome is not None and any(one.name == biome.name and not one.is_own for one in biomes().values())
        # A file of a shipped biome's name would take its place in the menu.
        self.name = self.name or ("My biome" if biome is None else f"My {biome.name}" if shipped else biome.name)
        return context.window_manager.invoke_props_dialog(self)

    def run(self, context: bpy.types.Context) -> set[str]:
        path = save_biome_file(context.scene, self.name, self.description, self.picture, self.replace)
        return self.done(f"Saved as {path}")


class TETFLORA_OT_add_biome(ModalJob, Operator, label="Add Biome", needs=(in_object_mode,)):
    """Add a biome with all of its layers of plants, ground cover and soil to the selected meshes.

    Without a selected mesh, a hectare of land is made at the 3D cursor.
    """

    biome: BIOMES()
    seed: once.integer("Seed", "A different seed gives a different arrangement")
    season: once.boolean("Set Season", "Turn on Seasons and go to the day of the year that the biome is made for")

    def steps(self, context: bpy.types.Context) -> Job[adding.BiomeResult]:
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
            land = adding.make_land(scene, biome.ground, self.seed)
            grounds = [land]
        hidden = [] if cube is None else [(cube, cube.hide_viewport, cube.hide_render)]
        for obj, *_ in hidden:
            obj.hide_viewport = obj.hide_render = True
        try:
            context.view_layer.update()
            depsgraph = context.evaluated_depsgraph_get()
            planted = yield from adding.add_biome_steps(scene, depsgraph, biome, grounds, self.seed)
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
        return planted

    def finish(self, context: bpy.types.Context, result: adding.BiomeResult) -> set[str]:
        points.schedule()
        sun = any(o.type == 'LIGHT' and o.data.type == 'SUN' for o in context.scene.objects)
        before = "" if sun else "Daylight, then "
        before += "" if context.scene.camera else "Look from Here, then "
        more = f". Click {before}Refine to see them in full"
        numbers = [number for _, number in result.layers]
        return tell_layers(self, f'"{result.name}": ', numbers, result.bare, result.kept, more)


class TETFLORA_OT_ground_cover(_InParts, Operator, label="Ground Cover", needs=(in_object_mode, scatter_active)):
    """Cover the ground under the active layer with what grows in the light there and with what its species shed.

    The cover is a layer of its own; use again to renew it after changes above.
    """

    soil: boolean("Soil", "Color ground that has no material of yours like what lies on it", True)
    fallen: boolean("Fallen Leaves", "With Seasons on, add a layer of the leaves that the plants above shed", True)

    def steps(self, context: bpy.types.Context) -> Job[cover.CoverResult]:
        scene, depsgraph = context.scene, context.evaluated_depsgraph_get()
        covering = yield from cover.cover_steps(scene, depsgraph, cover.covered_population(scene), self.soil)
        self.cancelled = "Stopped; the cover stays, without fallen leaves"
        if self.fallen and scene.tetflora.year.enabled:
            yield from cover.strew_steps(scene, depsgraph, cover.covered_population(scene))
        return covering

    def finish(self, context: bpy.types.Context, result: cover.CoverResult) -> set[str]:
        points.schedule()
        kept = f'; "{result.bare[0]}" keeps its own material' if result.bare else ""
        if not result.placed.number:
            return self.refused(f"Nothing grows here: {result.placed.reason}")
        return self.done(f"{counted(result.placed.number, 'plant')} cover the ground{kept}")


class TETFLORA_OT_grow_stand(ModalJob, Operator, label="Grow Stand", needs=(in_object_mode, ground_found)):
    """Grow a wood on the selected meshes, year by year: plants compete for light, die, fall and come up from seed.

    The result is one field of plants with its whole history. Change its years, species and site, then use Update.
    """

    def steps(self, context: bpy.types.Context) -> Job[growing.GrownStand]:
        return growing.new_stand_steps(context.scene, context.evaluated_depsgraph_get(), grounds_to_plant(context))

    def finish(self, context: bpy.types.Context, result: growing.GrownStand) -> set[str]:
        select_only(context, [result.field])
        context.scene.update_tag()
        return self.done(f"{counted(result.plants, 'plant')} after {counted(result.years, 'year')}")


def active_stand(context: bpy.types.Context) -> bpy.types.Object | None:
    """The stand that is the active object, or else the active layer."""
    layer = layers.active_layer(context.scene)
    candidates = (context.active_object, None if layer is None else layer.field)
    return next((obj for obj in candidates if growing.is_stand(obj)), None)


_OF_STAND = (
    in_object_mode,
    need(active_stand, "The active layer must be a stand; use Grow Stand first"),
    need(
        lambda context: active_stand(context).library is None and active_stand(context).data.library is None,
        "The stand is linked from another file; use Object > Relations > Make Local",
    ),
)


class TETFLORA_OT_animate_growth(Reporting, Operator, label="Animate Growth", needs=_OF_STAND):
    """Key the year of the active stand from its first year to its last, and turn on Smooth Growth."""

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
        begin, end = growing.animate(active_stand(context), self.first, self.last)
        scene.frame_set(scene.frame_current)
        return self.done(f"Year {begin:g} at frame {self.first}, year {end:g} at frame {self.last}")


class TETFLORA_OT_keep_year(Reporting, Operator, label="Keep Year", needs=_OF_STAND):
    """Keep the active stand as it is this year, as an ordinary field of plants, and forget its other years and keys.

    The brush and other tools can then change it. Update brings the years back.
    """

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        text = "All other years of the stand and their keys are removed. Update brings the years back"
        return context.window_manager.invoke_confirm(self, event, message=text, confirm_text=self.bl_label)

    def run(self, context: bpy.types.Context) -> set[str]:
        number = growing.keep_year(active_stand(context))
        context.scene.update_tag()
        return self.done(f"{counted(number, 'plant')} kept")


class TETFLORA_OT_import_biome(FileTool, Operator, ImportHelper, label="Import Biome", options={'REGISTER'}):
    """Copy a biome's file to your folder of biomes, with the picture of the same name beside it."""

    replace: once.boolean("Replace", "Replace your own biome of the same file name")

    def run(self, context: bpy.types.Context) -> set[str]:
        identifier = import_biome(self.path, self.replace)
        context.scene.tetflora.new_biome = identifier
        return self.done(f'Biome "{biomes()[identifier].name}" imported; click Add Biome to use it')
