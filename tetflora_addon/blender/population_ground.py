# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a population to places for its plants: its ground and masks, what stands there already, and the engine."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import bpy
import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..planting.places import Placement, place, without
from .erased_places import erased_places
from .ground_reader import read_ground
from .plant_fields import fields_of, read_field
from .plant_kinds import species_of
from .plant_objects import plants_of
from .population_rules import rules_from, unknown_species
from .species_edits import catalogue
from .transforms import world_matrix
from .view_layers import objects_within


def grounds_of(scene: bpy.types.Scene, population: bpy.types.PropertyGroup) -> list[bpy.types.Object]:
    """Meshes of the scene that a population grows on.

    What was deleted from the scene does not count, although the population's pointer keeps it in the file.
    """
    named = [entry.object for entry in population.grounds]
    if population.ground_collection is not None:
        named += objects_within(population.ground_collection)
    meshes = dict.fromkeys(o for o in named if o is not None and o.type == 'MESH' and not o.tetflora.is_field)
    return [o for o in meshes if scene in o.users_scene]


def place_population(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    population: bpy.types.PropertyGroup,
    own: Collection[bpy.types.Object],
    grounds: Sequence[bpy.types.Object] | None = None,
    most: int | None = None,
) -> tuple[Placement, tuple[str, ...]]:
    """Find places for the plants of a population.

    Parameters
    ----------
    own : set of bpy.types.Object
        Its present plants, which take no room.
    grounds : sequence of bpy.types.Object, optional
        Grow on these meshes instead of the population's own.
    most : int, optional
        Plants that are enough, for a preview.

    Returns
    -------
    placement : Placement
    species : tuple of str
        Identifiers that the placement counts through.

    Raises
    ------
    SceneError
        No ground, a species that the catalogue does not have, or settings that leave no place; says what to do.
    """
    unknown = unknown_species(population)
    if unknown:
        raise SceneError(f'Unknown species "{unknown[0]}"; choose one of {", ".join(catalogue())}')
    grounds = grounds_of(scene, population) if grounds is None else grounds
    if not grounds:
        raise SceneError(
            f'"{population.name}" has no ground in this scene; select meshes and click Use Selected Meshes'
            if population.uid
            else "Select a mesh to plant on"
        )
    rules, species = rules_from(population)
    if most is not None:
        rules = replace(rules, count=min(rules.count, most))
    ground = read_ground(
        grounds,
        depsgraph,
        vertex_group=population.vertex_group,
        image=population.image,
        uv_layer=population.uv_layer,
        invert_group=population.invert_group,
        invert_image=population.invert_image,
        areas=population.areas,
        paths=population.paths,
        path_distance=population.path_distance,
    )
    found = place(ground, rules, *standing(scene, depsgraph, own, species))
    return without(found, erased_places(population)), species


def standing(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    without: Collection[bpy.types.Object],
    species: Sequence[str],
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Places (m, 3) and species (m,) of the plants of a scene, those that are objects and those of fields.

    Parameters
    ----------
    without : set of bpy.types.Object
        Plants and fields that do not count.
    species : sequence of str
        Identifiers that the result counts through; others have -1.
    """
    numbers = {identifier: number for number, identifier in enumerate(species)}
    objects = [o for o in scene.objects if o not in without] if without else scene.objects
    single = plants_of(objects)
    position = [np.array([o.matrix_world.translation for o in single], dtype=np.float64).reshape(-1, 3)]
    kinds = [np.array([numbers.get(o.tetflora.species, -1) for o in single], dtype=np.int32)]
    for field in fields_of(objects):
        read = read_field(field, depsgraph, world_matrix(field, depsgraph)[None])
        position.append(read.position)
        own_numbers = np.array([numbers.get(species_of(kind), -1) for kind in read.identifiers], dtype=np.int32)
        kinds.append(own_numbers[read.species])
    return np.concatenate(position), np.concatenate(kinds)
