# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add plants: a single one, one grown on a drawn skeleton, a first forest, or a population on a terrain."""

import bpy
from bpy.props import FloatVectorProperty
from bpy.types import Context, Object, Operator, PropertyGroup, Scene

from ..tetflora_addon.blender.attributes import world_matrix
from ..tetflora_addon.blender.declare import choice, once, real
from ..tetflora_addon.blender.placing.distances import distance_of, follows_species
from ..tetflora_addon.blender.placing.first_forest import build
from ..tetflora_addon.blender.placing.plant_objects import add_plant, next_seed
from ..tetflora_addon.blender.placing.populations import PlacedPlants, add_population, make_plants_steps, restored
from ..tetflora_addon.blender.placing.properties import CREATE_AS, MOST_EMPTIES
from ..tetflora_addon.blender.placing.rules import copy_entry, free_seed
from ..tetflora_addon.blender.scene.skeletons import SKELETON_TYPES, read_skeleton, upright_turn
from ..tetflora_addon.blender.settings import properties_of
from ..tetflora_addon.blender.species.catalog import NO_SPECIES, default_species, operator_items
from ..tetflora_addon.blender.species.editor import present_species
from ..tetflora_addon.blender.species.edits import catalog, unknown_text
from ..tetflora_addon.errors import SceneError
from ..tetflora_addon.jobs import Job, Progress
from ..tetflora_addon.parameters import within
from ..tetflora_addon.planting.rules import Rules
from .base import ModalJob, Reporting, counted, in_object_mode, need, select_only, selected_plants
from .layers import ground_found, grounds_to_plant, tell_placed


class TETFLORA_OT_add_plant(Reporting, Operator, label="Add Plant", needs=(in_object_mode,)):
    """Add a plant at the 3D cursor.

    It is stored as an empty with a species and seed; Refine or rendering creates its branches and leaves.
    """

    species: choice("Species", "Species from the catalog", operator_items)
    seed: once.integer("Seed", "Individual of the species; random for each plant if not set")
    location: FloatVectorProperty(
        name="Location",
        description="Base of the trunk in world space; the 3D cursor if not set",
        subtype='TRANSLATION',
        unit='LENGTH',
        options={'SKIP_SAVE'},
    )
    azimuth: once.real("Azimuth", "Rotation around the vertical axis", subtype='ANGLE')
    scale: once.real("Scale", "Scale of the plant; 1 is the size in the species file", 1.0, **within(0.01, 4.0))

    def run(self, context: Context) -> set[str]:
        properties = self.properties
        if not properties.is_property_set("location"):
            self.location = context.scene.cursor.location
        if not properties.is_property_set("seed"):
            self.seed = next_seed(context.scene)
        species = default_species() if self.species in {"", NO_SPECIES} else self.species
        plants = add_plant(context.scene, self.location, self.azimuth, self.scale, self.seed, species)
        select_only(context, plants)
        return {'FINISHED'}


_skeleton_active = need(
    lambda context: context.active_object is not None and context.active_object.type in SKELETON_TYPES,
    "The active object must be a curve, hair curves or a mesh of edges; select it last",
)


class TETFLORA_OT_use_as_skeleton(
    Reporting, Operator, label="Make Plant from Skeleton", needs=(in_object_mode, _skeleton_active)
):
    """Use the active curve, hair curves or mesh of edges as trunk and limbs of the selected plants or, if none is
    selected, of a new plant in its place; the species grows the rest.

    The skeleton is no longer rendered.
    """

    def run(self, context: Context) -> set[str]:
        form, depsgraph = context.active_object, context.evaluated_depsgraph_get()
        skeleton = read_skeleton(form, depsgraph)  # refuses what cannot be one before anything changes
        plants = selected_plants(context)
        if not plants:
            scene, matrix = context.scene, world_matrix(form, depsgraph)
            shown = present_species(scene.tetflora.species_editor)
            species = shown if shown in catalog() else default_species()
            plants = add_plant(scene, matrix[:3, 3], upright_turn(matrix), 1.0, next_seed(scene), species)
        height = float(skeleton.points[:, 2].max())
        for plant in plants:
            plant.tetflora.skeleton = form
            if plant.type == 'EMPTY' and height > 0.0:
                plant.empty_display_size = height  # the arrow was as tall as the species grows by itself
        form.hide_render = True
        select_only(context, plants)
        drawing = f"{counted(len(skeleton.points), 'point')} drawn"
        return self.done(f'"{form.name}" is now the skeleton of {counted(len(plants), "plant")}: {drawing}')


class TETFLORA_OT_first_forest(Reporting, Operator, label="First Forest", needs=(in_object_mode,)):
    """Create a small complete scene: a path through trees, ferns and ground cover, with a camera, the sun and a sky.

    Existing objects remain: if the scene is not empty, a new scene is added.
    """

    seed: once.integer("Seed", "A different seed gives a different forest")

    def run(self, context: Context) -> set[str]:
        scene, note = build(context, self.seed)
        # Select the ground, so that Scatter and the brush go on from there, and not the startup's hidden cube.
        layer = scene.view_layers[0]
        layer.update()  # what was just linked is not in it before
        ground = next((obj for obj in layer.objects if obj.tetflora.is_occluder), None)
        if ground is not None:
            for obj in layer.objects.selected:
                obj.select_set(False, view_layer=layer)
            ground.select_set(True, view_layer=layer)
            layer.objects.active = ground
        plants = sum(o.tetflora.is_plant for o in scene.objects)
        areas = context.screen.areas if context.screen and not bpy.app.background else ()
        for area in (area for area in areas if area.type == 'VIEW_3D'):
            area.spaces.active.region_3d.view_perspective = 'CAMERA'
        note = f" ({note})" if note else ""
        text = f"Created a forest of {plants} plants and ground cover{note}"
        return self.done(f"{text}. Press F12 to render it, click Refine to see it here")


# What is not given comes from the panel's settings: defaults do not matter here.
_RULES = properties_of(Rules, options={'SKIP_SAVE'})
# Names that the operator shares with the scene's settings for populating.
_SHARED = ("by_density", "count", "as_field", "seed", "slope_max", "min_distance", "scale_min", "scale_max")


class TETFLORA_OT_populate(ModalJob, Operator, label="Scatter", needs=(in_object_mode, ground_found)):
    """Scatter plants over the selected meshes as a new layer, which can be changed later.

    Each plant is an empty, or a vertex of one mesh if there are many.
    """

    by_density: _RULES.by_density
    count: _RULES.count
    as_field: CREATE_AS(options={'SKIP_SAVE'})
    seed: _RULES.seed
    slope_max: _RULES.slope_max
    min_distance: _RULES.min_distance
    scale_min: _RULES.scale_min
    scale_max: _RULES.scale_max
    species: once.string("Species", "Comma-separated species with optional weights: broadleaf_tree:3, bush:1")
    suited: real(
        "Suited Distance", "Min Distance by the species; another one was given", -1.0, options={'SKIP_SAVE', 'HIDDEN'}
    )

    def steps(self, context: Context) -> Job[PlacedPlants]:
        scene = context.scene
        yield Progress(0.0, "Reading the ground")
        # Take what was not given from the panel; the redo panel then shows what was really used.
        settings = scene.tetflora.populate
        if self.properties.is_property_set("count") and not self.properties.is_property_set("by_density"):
            self.by_density = False  # a script asks for so many
        for name in _SHARED:
            if not self.properties.is_property_set(name) and name != "min_distance":
                value = getattr(settings, name)
                setattr(self, name, free_seed(scene, value) if name == "seed" else value)
        if not self.species:
            self.species = mix_in(settings)
        weights = parse_weights(self.species)
        if self.as_field == 'EMPTIES' and self.count > MOST_EMPTIES:
            raise SceneError(
                f"{self.count:,} plants exceed the limit of {MOST_EMPTIES:,} empties; "
                "set Create As to Field, or use fewer plants"
            )
        with restored(scene):
            population = self._population(scene, grounds_to_plant(context), weights)
            return (yield from make_plants_steps(scene, context.evaluated_depsgraph_get(), population))

    def finish(self, context: Context, result: PlacedPlants) -> set[str]:
        grounds = grounds_to_plant(context)
        select_only(context, [*result.objects, *grounds])
        # The terrain stays selected and active, so that one Scatter can follow another.
        context.view_layer.objects.active = grounds[0]
        return tell_placed(self, result)

    def _population(self, scene: Scene, grounds: list[Object], weights: dict[str, float]) -> PropertyGroup:
        """A new population with the settings for new ones, and over them what was given."""
        population = add_population(scene, grounds)
        settings = scene.tetflora.populate
        if not self.properties.is_property_set("min_distance"):
            follows, self.min_distance = follows_species(settings), settings.min_distance
        else:
            follows = self.min_distance == self.suited
        for name in _SHARED:
            setattr(population, name, getattr(self, name))
        population.mix.clear()
        known = {entry.species: entry for entry in settings.mix}
        for identifier, weight in weights.items():
            entry = population.mix.add()
            if identifier in known:
                copy_entry(known[identifier], entry)
            entry.species, entry.weight = identifier, weight
        population.distance_by_species = follows
        if follows:  # the redo panel shows it, and tells by it whether the artist has changed it
            self.min_distance = self.suited = distance_of(population)
        return population


def mix_in(settings: PropertyGroup) -> str:
    """The species of a population with their weights, as `parse_weights` reads them."""
    mix = [(entry.species, entry.weight) for entry in settings.mix if entry.species]
    return ", ".join(f"{name}:{weight:g}" for name, weight in mix) or default_species()


def parse_weights(text: str) -> dict[str, float]:
    """``oak:3, spruce`` to weights by identifier; the weights of a species named twice add up."""
    known = catalog()
    weights: dict[str, float] = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        identifier, _, weight = (p.strip() for p in part.partition(":"))
        if identifier not in known:
            raise SceneError(unknown_text(identifier))
        try:
            weights[identifier] = weights.get(identifier, 0.0) + (float(weight) if weight else 1.0)
        except ValueError:
            raise SceneError(f'"{part}" is not a species with a weight; write for example {identifier}:2') from None
    return weights
