# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add a biome to ground, layer after layer; plant its layers again; remove it with its plants.

Layers become ordinary populations that know their biome: each can be changed, frozen, updated and painted over.
"""

import json
import uuid
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from math import pi
from typing import Any

import bpy

from ...errors import SceneError, TetFloraError
from ...growth.hashing import child_key, key_of_seed, uniform
from ...jobs import Job, Progress, part_of
from ...species.litter import FALLEN
from ...species.litter import KIND as FALLEN_LEAVES
from ..placing.cover import fallen_from
from ..placing.population_data import fill_population, set_setting
from ..placing.populations import add_population, free_name, make_plants_steps, remove_layer, restored
from ..placing.rules import set_grounds
from ..runtime import GoneError, JobData, is_there, job
from ..scene.field_sizes import has_history
from ..settings import BIOME, SCATTER, with_identity
from ..species.edits import catalog, new_identifier, species_data, store_species, unknown_text
from ..stands.growing import GrownStand, again_steps, new_stand_steps
from .files import Biome, find_biome, layers_of, pages_of, stand_settings, stands_of
from .ground import lay_biome_soil, make_line
from .layers import index_of

_STANDS, _SOIL = 0.5, 0.06  # fractions of the work, at the begin and the end


@dataclass(frozen=True)
class BiomeResult:
    """What adding or planting a biome made."""

    name: str
    layers: list[tuple[str, int]]  # names of the layers, and how many plants each has
    bare: list[str]  # why layers have no plants
    kept: list[str]  # grounds that keep a material of the artist's


@job("Adding the biome")
def add_biome_steps(
    data: JobData, biome: Biome, grounds: Sequence[bpy.types.Object], seed: int = 0
) -> Job[BiomeResult]:
    """Add a biome to grounds, with all of its plants. Closing the steps, or an error, leaves everything as it was.

    Raises
    ------
    SceneError
        It needs a species that the catalog does not have, or no layer finds any place; or something was deleted
        meanwhile.
    """
    scene, depsgraph = data.scene, data.depsgraph
    data.add_objects(grounds)
    yield Progress(0.0, "Reading the biome")
    with restored(scene):
        renamed = _own_species(scene, biome)
        group, uid = scene.tetflora, uuid.uuid4().hex
        made = group.layers.add()
        made.kind, made.uid, made.name, made.source = BIOME, uid, free_name(group.layers, biome.name), biome.identifier
        made.gives_way, made.slope_max = biome.gives_way, pi / 2
        made.data = json.dumps({"ground": biome.ground, "season": biome.season}, ensure_ascii=False)
        for obj in grounds:
            made.grounds.add().object = obj
        for key, value in biome.limits.items():
            set_setting(made, key, value)
        made.use_altitude = bool({"altitude_min", "altitude_max"} & biome.limits.keys())
        if "path_max" in biome.limits:
            made.paths = make_line(scene, f"{made.name} line", grounds)
        stands = [layer for layer in biome.layers if layer["kind"] == "stand"]
        grown = yield from _grown(
            [layer["name"] for layer in stands],
            lambda n: new_stand_steps(
                scene, depsgraph, grounds, stands[n]["name"], partial(_fill_stand, stands[n], uid, renamed, seed)
            ),
        )
        for number, layer in enumerate(biome.layers):
            if layer["kind"] == "stand":
                continue
            population = add_population(scene, grounds, name=layer["name"])
            fill_population(population, layer, scene, [])
            _lay_on(population, grounds)
            population.biome, population.covers = uid, uid if layer["kind"] == "cover" else ""
            if layer["kind"] == "cover" and "as_field" not in layer:
                population.as_field = 'FIELD'
            # A number of its own for each layer, or all would stand in the same places.
            key = child_key(key_of_seed(seed), number)
            population.seed = int(uniform(child_key(key, population.seed & 0xFFFFFFFF), 0) * 2**31)
            for entry in population.mix:
                entry.species = renamed.get(entry.species, entry.species)
                entry.shed_by = renamed.get(entry.shed_by, entry.shed_by)
        group.layers_index = index_of(scene, uid)
        return (yield from _plant(data, uid, *grown))


def _lay_on(population: bpy.types.PropertyGroup, grounds: Sequence[bpy.types.Object]) -> None:
    """Let a layer that was read grow on those of the grounds that it names or, without any, on all of them.

    Masks are those of the grounds that it was made for: it keeps what it finds.
    """
    named = {entry.object for entry in population.grounds}
    own = [obj for obj in grounds if obj in named] or grounds
    set_grounds(population, own)
    if all(population.vertex_group not in obj.vertex_groups for obj in own):
        population.vertex_group = ""
    if all(population.uv_layer not in obj.data.uv_layers for obj in own):
        population.uv_layer = ""


@job("Planting the biome")
def plant_biome_steps(data: JobData, biome: bpy.types.PropertyGroup) -> Job[BiomeResult]:
    """Plant all layers of a biome again by their settings, but frozen ones and stands of which a year is kept.

    Raises
    ------
    SceneError
        No layer finds any place.
    """
    scene, uid = data.scene, biome.uid
    data.add_objects(entry.object for entry in biome.grounds if is_there(entry.object))
    fields = growing_of(scene, uid)
    grown = yield from _grown([field.name for field in fields], lambda n: again_steps(scene, data.depsgraph, fields[n]))
    return (yield from _plant(data, uid, *grown))


def _grown(
    names: Sequence[str], grow: Callable[[int], Job[GrownStand]]
) -> Job[tuple[list[tuple[str, int]], list[str]]]:
    """Grow stands by their numbers: names and numbers of plants of those that grew, and why others did not."""
    made, bare = [], []
    for number, name in enumerate(names):
        begin, end = (_STANDS * n / len(names) for n in (number, number + 1))
        try:
            with closing(grow(number)) as steps:
                grown = yield from part_of(steps, begin, end, name)
        except GoneError:
            raise
        except TetFloraError as error:
            text = str(error)  # some begin with the name of the field
            bare.append(text if text.startswith(f'"{name}"') else f"{name}: {text}")
            continue
        made.append((name, grown.plants))
    return made, bare


def _plant(data: JobData, uid: str, stands: Sequence[tuple[str, int]], without: Sequence[str]) -> Job[BiomeResult]:
    """Plants of all layers, one after the other, and the soil under them; ``without`` tells of stands that failed."""
    scene, depsgraph, first = data.scene, data.depsgraph, _STANDS if stands else 0.0
    yield Progress(first, "Planting")
    names = [population.uid for population in layers_of(scene, uid) if not population.frozen]
    layers, bare = list(stands), list(without)
    for number, name in enumerate(names):
        depsgraph.update()  # plants of the layers before shade the ground, and keep others away
        population = with_identity(scene.tetflora.layers, name)
        if population is None:
            continue
        for entry in population.mix:  # litter is made where an entry needs it and nobody has it
            if entry.shed_by and entry.species not in catalog():
                kind = next((k for k in (*FALLEN, FALLEN_LEAVES) if entry.species.endswith(f"_{k}")), "")
                entry.species = (kind and fallen_from(scene, entry.shed_by, kind)) or entry.species
        title = population.name
        begin, end = (first + n / len(names) * (1.0 - _SOIL - first) for n in (number, number + 1))
        try:
            with closing(make_plants_steps(scene, depsgraph, population)) as steps:
                made = yield from part_of(steps, begin, end, title)
        except GoneError:
            raise
        except SceneError as error:
            bare.append(f"{title}: {error}")
            continue
        if made.number or not made.reason:
            layers.append((title, made.number))
        else:
            bare.append(f"{title}: {made.reason}")
    if bare and not layers:
        raise SceneError(bare[0])
    yield Progress(1.0 - _SOIL, "Soil")
    depsgraph.update()
    biome = find_biome(scene, uid)
    grounds = [entry.object for entry in biome.grounds if entry.object is not None] if biome is not None else []
    kept = lay_biome_soil(depsgraph, grounds) if grounds else []
    return BiomeResult(biome.name if biome is not None else "", layers, bare, kept)


def _own_species(scene: bpy.types.Scene, biome: Biome) -> dict[str, str]:
    """Keep the biome's own species in this file; what they are called here, where that differs.

    Raises
    ------
    SceneError
        A layer needs a species that is nowhere.
    """
    renamed = {}
    for identifier, page in pages_of(scene, biome).items():
        name, known = identifier, catalog()
        if identifier in known and dict(species_data(scene, identifier)) != page:
            name = renamed[identifier] = new_identifier(identifier, known.__contains__)
        if name not in known:
            store_species(scene, name, page)
    known = catalog()
    for layer in biome.layers:
        for part in layer.get("species", []):
            needed = part.get("shed_by") or part["species"]
            needed = renamed.get(needed, needed)
            if needed not in known:
                raise SceneError(f'"{biome.name}", layer "{layer["name"]}": {unknown_text(needed)}')
    return renamed


def growing_of(scene: bpy.types.Scene, uid: str) -> list[bpy.types.Object]:
    """Those of them that have their years, and may be grown again: *Keep Year* makes a stand the artist's own."""
    return [obj for obj in stands_of(scene, uid) if has_history(obj) and not (obj.library or obj.data.library)]


def _fill_stand(
    layer: Mapping[str, Any], uid: str, renamed: Mapping[str, str], seed: int, stand: bpy.types.PropertyGroup
) -> None:
    """Give a stand the settings of a checked layer."""
    for name in stand_settings():
        if name in layer:
            set_setting(stand, name, layer[name])
    stand.biome, stand.seed = uid, (stand.seed + seed) % 2**31
    for part in layer["species"]:
        entry = stand.species.add()
        for key, value in part.items():
            setattr(entry, key, renamed.get(value, value) if key == "species" else value)


def remove_biome(scene: bpy.types.Scene, biome: bpy.types.PropertyGroup) -> int:
    """Remove a biome with its plants; those of frozen populations and of kept years stay. How many plants went."""
    uid, number, grown = biome.uid, 0, set(growing_of(scene, biome.uid))
    for index in [i for i, one in enumerate(scene.tetflora.layers) if one.biome == uid][::-1]:
        layer = scene.tetflora.layers[index]
        if layer.kind == SCATTER or layer.field in grown:
            number += remove_layer(scene, index)
        else:
            layer.biome = ""
    remove_layer(scene, index_of(scene, uid))
    return number
