# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How far apart plants of a population or of the brush stand: as their species need, until the artist says otherwise.

``min_distance`` is the artist's own, and ``distance_from`` says whether it counts.
"""

from collections.abc import Callable, Iterable

import numpy as np
from bpy.types import PropertyGroup, Scene

from ...compiled.sizes import Crown
from ...errors import SpeciesError
from ...planting.rules import suggested_distance
from ...species.kinds import Kind
from ..scene.crowns import crown_for
from ..settings import active_in
from ..species.catalog import default_species

#: Square meters of the area that densities are counted on: foresters count trees by the hectare.
HECTARE = 10_000.0
#: Square meters of the area that densities of the brush are counted on.
SQUARE = 100.0
#: Whence the distance comes, as stored.
SOURCES = (('SPECIES', "Species", "From the crowns of the species", 0), ('OWN', "Own", "Set by the artist", 1))


def weights_of(population: PropertyGroup) -> dict[str, float]:
    """Relative frequency of each species of a population, at least one.

    Raises
    ------
    SpeciesError
        The catalog is empty.
    """
    return _summed((entry.species or default_species(), entry.weight) for entry in population.mix)


def painted_weights(scene: Scene) -> dict[str, float]:
    """Relative frequency of each species that the brush of a scene paints, at least one.

    Raises
    ------
    SpeciesError
        The catalog is empty.
    """
    brush = scene.tetflora.brush
    if brush.source == 'ONE' and brush.species:
        return {brush.species: 1.0}
    layer = active_in(scene.tetflora, "layers")
    mix = scene.tetflora.populate.mix if layer is None or not layer.mix else layer.mix
    return _summed((one.species, one.weight) for one in mix if one.species and brush.source == 'MIX')


def _summed(parts: Iterable[tuple[str, float]]) -> dict[str, float]:
    weights: dict[str, float] = {}
    for identifier, weight in parts:
        weights[identifier] = weights.get(identifier, 0.0) + weight
    return weights or {default_species(): 1.0}


def follows_species(settings: PropertyGroup) -> bool:
    """Whether a population or brush takes its distance from its species; cheap."""
    return settings.distance_from == 'SPECIES'


def distance_of(settings: PropertyGroup) -> float:
    """Distance in meters that counts for a population or brush: its own, or the one that suits its species."""
    return suggestion(settings) if follows_species(settings) else settings.min_distance


def suggestion(settings: PropertyGroup, find: Callable[[Scene, str], Crown | None] = crown_for) -> float | None:
    """Distance in meters that suits the species of a population or brush.

    Species are compiled at the first time, up to a tenth of a second each. None where a crown is not found.
    """
    scene, of_brush = settings.id_data, "strokes" in settings.bl_rna.properties
    try:
        weights = painted_weights(scene) if of_brush else weights_of(settings)
    except SpeciesError:  # an empty catalog, of which Populate and the brush complain
        return settings.min_distance
    age = 0.0 if of_brush else settings.age
    crowns = [find(scene, str(Kind(identifier, age=age))) for identifier in weights]
    if None in crowns:
        return None
    # Plants per square meter, if they are asked for.
    density = settings.density / (SQUARE if of_brush else HECTARE) if of_brush or settings.by_density else None
    scale = (settings.scale_min + settings.scale_max) / 2.0
    suited = suggested_distance([crown.radius for crown in crowns], list(weights.values()), scale, density)
    return float(np.float32(suited))  # as Blender stores it, so that it is the same when the artist takes it over


def choose(settings: PropertyGroup, by_species: bool) -> None:
    """Let a population or brush follow its species from now on, or keep the distance that it has."""
    if not by_species and follows_species(settings):
        settings.min_distance = suggestion(settings)  # what the artist sees is what there is to change
    settings.distance_from = 'SPECIES' if by_species else 'OWN'
