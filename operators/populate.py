# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Populate a terrain with plants: a new population, and its plants, in one step."""

import bpy
from bpy.props import EnumProperty, StringProperty

from ..tetflora_addon.blender.generated import properties_of
from ..tetflora_addon.blender.population_properties import MOST_EMPTIES, STORAGE_ITEMS
from ..tetflora_addon.blender.population_rules import copy_companion
from ..tetflora_addon.blender.populations import add_population, make_plants, remove_population
from ..tetflora_addon.blender.species_edits import catalogue
from ..tetflora_addon.blender.species_items import default_species
from ..tetflora_addon.errors import SceneError, TetFloraError
from ..tetflora_addon.planting.rules import Rules
from .base import Reporting, in_object_mode, select_only
from .populations import ground_selected, report_made, selected_grounds

# Of what is not given, the panel's settings are taken: defaults do not matter here.
_RULES = properties_of(Rules, options={'SKIP_SAVE'})
# Names that the operator shares with the scene's settings for populating.
_SHARED = ("count", "as_field", "seed", "slope_limit", "min_distance", "scale_min", "scale_max")


class TETFLORA_OT_populate(Reporting, bpy.types.Operator):
    """Scatter plants over the selected meshes."""

    bl_idname = "tetflora.populate"
    bl_label = "Populate"
    bl_description = (
        "Scatter plants over the selected meshes as a new population, which can be changed later. Each plant is an "
        "empty, or a vertex of one mesh if there are many"
    )
    bl_options = {'REGISTER', 'UNDO'}

    count: _RULES.count
    as_field: EnumProperty(
        name="Create As",
        description="What the plants are created as",
        items=STORAGE_ITEMS,
        default='AUTOMATIC',
        options={'SKIP_SAVE'},
    )
    seed: _RULES.seed
    slope_limit: _RULES.slope_max
    min_distance: _RULES.min_distance
    scale_min: _RULES.scale_min
    scale_max: _RULES.scale_max
    species: StringProperty(
        name="Species",
        description="Comma-separated identifiers of species with optional weights: broadleaf_tree:3, bush:1",
        options={'SKIP_SAVE'},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not in_object_mode(cls, context):
            return False
        return ground_selected(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        self._complete_from(scene)
        shares = _parse_shares(self.species)
        if self.as_field == 'EMPTIES' and self.count > MOST_EMPTIES:
            raise SceneError(
                f"{self.count:,} plants exceed the limit of {MOST_EMPTIES:,} empties; "
                "set Create As to Field, or use fewer plants"
            )
        grounds = selected_grounds(context)
        population = self._population(scene, grounds, shares)
        try:
            made = make_plants(scene, context.evaluated_depsgraph_get(), population)
        except TetFloraError:
            remove_population(scene, scene.tetflora.populations_index)
            raise
        select_only(context, [*made.objects, *grounds])
        # The terrain stays selected and active, so that Populate can follow Populate.
        context.view_layer.objects.active = grounds[0]
        report_made(self, made)
        return {'FINISHED'}

    def _population(
        self, scene: bpy.types.Scene, grounds: list[bpy.types.Object], shares: dict[str, float]
    ) -> bpy.types.PropertyGroup:
        """A new population with the settings for new ones, and over them what was given."""
        population = add_population(scene, grounds)
        for name in _SHARED:
            setattr(population, "slope_max" if name == "slope_limit" else name, getattr(self, name))
        population.by_density = False
        population.mix.clear()
        given = {entry.species: entry for entry in scene.tetflora.populate.mix}
        for identifier, share in shares.items():
            entry = population.mix.add()
            entry.species, entry.weight = identifier, share
            if identifier in given:
                copy_companion(given[identifier], entry)
        return population

    def _complete_from(self, scene: bpy.types.Scene) -> None:
        """Take what was not given from the panel; the redo panel then shows what was really used."""
        settings = scene.tetflora.populate
        for name in _SHARED:
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(settings, "slope_max" if name == "slope_limit" else name))
        if not self.species:
            mix = [(entry.species, entry.weight) for entry in settings.mix if entry.species]
            self.species = ", ".join(f"{name}:{share:g}" for name, share in mix) or default_species()


def _parse_shares(text: str) -> dict[str, float]:
    """``oak:3, spruce`` to shares by identifier; a species named twice gets both shares."""
    known = catalogue()
    shares: dict[str, float] = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        identifier, _, share = (p.strip() for p in part.partition(":"))
        if identifier not in known:
            raise SceneError(f'Unknown species "{identifier}"; choose one of {", ".join(known)}')
        try:
            shares[identifier] = shares.get(identifier, 0.0) + (float(share) if share else 1.0)
        except ValueError:
            raise SceneError(f'"{part}" is not a species with a weight; write for example {identifier}:2') from None
    return shares


CLASSES = (TETFLORA_OT_populate,)
