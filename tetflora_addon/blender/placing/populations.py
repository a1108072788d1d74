# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Populations of a scene: plants that were placed together, and can be placed again by the stored rules.

A plant or field stores the identity of its population and its number in it, so names and places in lists do not matter.
A copy made by hand has its original's number: the oldest with a number is the population's, the others the artist's.
"""

import uuid
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from bpy.types import Collection, Depsgraph, Object, Scene

from ...arrays import Floats32
from ...errors import SceneError
from ...growth.hashing import child_key, key_of_seed, uniform
from ...jobs import Job, Progress
from ...planting.places import Placement, plant_ages
from ...species.kinds import MOST_YEARS, Kind
from ..assets.marks import measure_all
from ..runtime import JobData, is_there, job
from ..scene.crowns import crown_steps
from ..scene.fields import stored_size
from ..settings import BIOME, SCATTER, with_identity
from ..species.edits import revert_species
from ..worker import call_in_thread, run_to_end
from . import plant_objects
from .canopy import canopy_steps, is_cover
from .properties import MOST_EMPTIES, TetFloraLayer
from .rules import copy_settings, fingerprint, forms_of, grounds_of, makes_field, read_search, set_grounds
from .terrain import ground_form

NAME = "Scatter"


@dataclass(frozen=True)
class PlacedPlants:
    """The plants that placing a population made."""

    objects: list[Object]  # in the order of the placement, or one field
    number: int
    wanted: int
    reason: str  # why there are fewer than wanted; empty if there are not
    returned: int  # plants among them that had been deleted by hand
    erased: int  # plants omitted where the brush has erased


def owner_of(scene: Scene, objects: Iterable[Object]) -> TetFloraLayer | None:
    """The population that all of these plants and fields belong to; None if there is no such one."""
    objects = set(objects)
    uids = {o.tetflora.population for o in objects}
    owner = next((p for p in scene.tetflora.layers if {p.uid} == uids), None)
    return owner if owner is not None and objects <= set(own_objects(scene, owner)) else None


def adopt(scene: Scene, population: TetFloraLayer, objects: Iterable[Object]) -> None:
    """Let plants and fields belong to a population, after those that it has."""
    numbers = [o.tetflora.population_number for o in own_objects(scene, population)]
    for number, obj in enumerate(objects, max(numbers, default=-1) + 1):
        obj.tetflora.population, obj.tetflora.population_number = population.uid, number


def add_population(scene: Scene, grounds: Iterable[Object] = (), name: str = NAME) -> TetFloraLayer:
    """Add a population without plants, with the scene's settings for new ones, and make it the active one.

    Parameters
    ----------
    name : str
        A number is added if another population has it.
    """
    group = scene.tetflora
    population = group.layers.add()
    group.layers_index = len(group.layers) - 1
    population.uid = uuid.uuid4().hex
    population.name = free_name(group.layers, name)
    copy_settings(group.populate, population)
    set_grounds(population, grounds)
    return population


def own_objects(scene: Scene, population: TetFloraLayer) -> list[Object]:
    """Plants and fields that belong to a population, in the order of their numbers."""
    return _sorted_out(scene, population)[0]


def own_number(objects: Iterable[Object]) -> int:
    """How many plants there are in plants and fields."""
    return sum(stored_size(o) if o.tetflora.is_field else 1 for o in objects)


@job("Placing plants")
def make_plants_steps(data: JobData, population: TetFloraLayer, later: Sequence[str] = ()) -> Job[PlacedPlants]:
    """Place a population's plants by its settings, in place of those that it has.

    Closing it, or an error, changes nothing. Plants of populations that are planted later keep nobody away.

    Raises
    ------
    SceneError
        It is frozen, or no plants can be placed by its settings, as the message says; or it was deleted meanwhile.
    """
    scene, depsgraph, uid = data.scene, data.depsgraph, population.uid
    yield (progress := Progress(0.0, "Reading the ground"))
    refuse_frozen(population)
    species = {entry.species for entry in population.mix}
    measure_all(scene, depsgraph, species)
    kinds = {str(Kind(identifier, age=population.age)) for identifier in species}
    above = (yield from canopy_steps(progress, scene, depsgraph)) if is_cover(population) else None
    yield from crown_steps(progress, scene, kinds)
    population = still_there(data, uid)
    present = [o for o in scene.objects if later and o.tetflora.population in later] + _sorted_out(scene, population)[0]
    search = read_search(scene, depsgraph, population, set(present), above=above)
    stood_on = forms_of(grounds_of(scene, population), lambda obj: ground_form(obj, depsgraph))
    progress = Progress(0.1, "Looking for places")
    yield progress
    placement = yield from call_in_thread(progress, search.placement)
    population = still_there(data, uid)
    if population.as_field == 'EMPTIES' and len(placement) > MOST_EMPTIES:
        raise SceneError(
            f"{len(placement):,} plants exceed the limit of {MOST_EMPTIES:,} empties; "
            "set Create As to Field, or use fewer plants"
        )
    present, copies = _sorted_out(scene, population)
    returned = max(population.made - own_number(present), 0)
    field = makes_field(population, len(placement)) and len(placement)
    objects: list[Object] = []
    ages = None
    if population.age > 0.0:
        ages = np.minimum(plant_ages(placement.seed, population.age, population.age_spread), np.float32(MOST_YEARS))
    if not present and not field:  # otherwise they go first, or their successors could not have their names
        objects = yield from _new_plants(scene, placement, search.species, collection_of(scene, population), ages)
    _release(copies)
    _remove(present)
    collection = collection_of(scene, population)
    if field:
        objects = [plant_objects.add_field(scene, placement, search.species, collection, ages)]
        objects[0].display_type = 'BOUNDS'  # its points would turn the ground black, and many take long to draw
    elif present:
        objects = run_to_end(plant_objects.add_plants_steps(scene, placement, search.species, collection, ages))
    adopt(scene, population, objects)
    if not objects:
        plant_objects.remove_empty_collections()
    population.made, population.message = len(placement), placement.reason
    population.placed_by, population.stood_on = fingerprint(population), stood_on
    returned = min(returned, len(placement))
    return PlacedPlants(objects, len(placement), placement.wanted, placement.reason, returned, placement.erased)


def still_there(data: JobData, uid: str) -> TetFloraLayer:
    """A population, fetched again: adding to the list moves what is in it."""
    population = with_identity(data.scene.tetflora.layers, uid)
    if population is None:
        data.stop("its population was deleted")
        data.check()
    return population


def _new_plants(
    scene: Scene, placement: Placement, species: Sequence[str], collection: Collection, ages: Floats32 | None
) -> Job[list[Object]]:
    """Plants where none have to go before."""
    steps, plants = plant_objects.add_plants_steps(scene, placement, species, collection, ages), []
    try:
        while True:
            plants = next(steps)
            yield Progress(0.4 + 0.6 * len(plants) / len(placement), f"Creating plants: {len(plants):,}")
    except StopIteration as stop:
        return stop.value
    except BaseException:
        bpy.data.batch_remove([obj for obj in plants if is_there(obj)])
        plant_objects.remove_empty_collections()
        raise


def reroll_steps(
    scene: Scene, depsgraph: Depsgraph, population: TetFloraLayer, later: Sequence[str] = ()
) -> Job[PlacedPlants]:
    """Place a population anew with another seed, which follows from the one that it has.

    Closing the steps, or an error, leaves the seed as it was as well. Errors are those of `make_plants_steps`.
    """
    with restored(scene):
        # A hash and not the next number: populations with neighboring seeds would follow each other's arrangements.
        population.seed = int(uniform(child_key(key_of_seed(population.seed), 1), 0) * 2**31)
        return (yield from make_plants_steps(scene, depsgraph, population, later))


def remove_layer(scene: Scene, index: int, keep_plants: bool = False) -> int:
    """Remove a layer; its plants go with it, unless they are frozen or shall be kept. How many went.

    What stays is the artist's own.
    """
    group = scene.tetflora
    layer = group.layers[index]
    kept, field, number = keep_plants or layer.frozen, layer.field, 0
    present, copies = _sorted_out(scene, layer) if layer.kind == SCATTER else ([], [])
    _release([*present, *copies] if kept else copies)
    if not kept:
        number = own_number(present)
        _remove(present)
        _dissolve(scene, layer.collection)
        number += plant_objects.remove_fields([field], tidy=False) if field is not None else 0
    group.layers.remove(index)
    group.layers_index = max(min(group.layers_index, len(group.layers) - 1), 0)
    plant_objects.remove_empty_collections()
    return number


@contextmanager
def restored(scene: Scene) -> Iterator[None]:
    """Where what is done ends early, forget new layers and species, and what was set for them."""
    group = scene.tetflora
    before = {layer.uid: (len(layer.mix), layer.density, layer.seed) for layer in group.layers}
    active, species = group.layers_index, {edit.identifier for edit in group.species_edits}
    locked = scene.render.use_lock_interface
    try:
        yield
    except BaseException:  # an error, or Esc
        for index in reversed(range(len(group.layers))) if is_there(scene) else ():
            layer = group.layers[index]
            if layer.uid not in before:
                if layer.kind == BIOME and layer.paths is not None:
                    bpy.data.batch_remove([*layer.paths.objects, layer.paths])
                remove_layer(scene, index)
                continue
            number, layer.density, layer.seed = before[layer.uid]
            while len(layer.mix) > number:
                layer.mix.remove(len(layer.mix) - 1)
        if is_there(scene):
            group.layers_index, scene.render.use_lock_interface = active, locked
            for identifier in [e.identifier for e in group.species_edits if e.identifier not in species]:
                revert_species(identifier)
        raise


def refuse_frozen(population: TetFloraLayer) -> None:
    """Keep the plants of a frozen population from being replaced.

    Raises
    ------
    SceneError
        It is frozen.
    """
    if population.frozen:
        raise SceneError(f'"{population.name}" is frozen and keeps its plants; turn off Freeze to change it')


def _sorted_out(scene: Scene, population: TetFloraLayer) -> tuple[list[Object], list[Object]]:
    """A population's own plants and fields by number, and copies of them that the artist made."""
    uid = population.uid
    marked = [o for o in scene.objects if o.tetflora.population == uid] if uid else []
    marked = [o for o in marked if o.library is None and o.override_library is None]
    marked = [o for o in marked if o.tetflora.is_plant or o.tetflora.is_field]
    numbered: dict[int, Object] = {}
    copies = []
    for obj in sorted(marked, key=lambda o: o.session_uid):
        if numbered.setdefault(obj.tetflora.population_number, obj) is not obj:
            copies.append(obj)
    return [numbered[number] for number in sorted(numbered)], copies


def _release(objects: Iterable[Object]) -> None:
    """Make plants the artist's own."""
    for obj in objects:
        obj.tetflora.property_unset("population")
        obj.tetflora.property_unset("population_number")


def _remove(objects: Sequence[Object]) -> None:
    plants = plant_objects.plants_of(objects)
    plant_objects.remove_fields(objects, tidy=False)  # the collection keeps what the artist set for it
    bpy.data.batch_remove(plants)


def collection_of(scene: Scene, population: TetFloraLayer) -> Collection:
    """The collection of a population's plants, within the scene's for plants; made if there is none in the scene."""
    holder = population.collection
    if holder is None or holder.library is not None or holder not in set(scene.collection.children_recursive):
        holder = population.collection = bpy.data.collections.new(population.name)
        holder[plant_objects.POPULATION_MARK] = True
        plant_objects.plant_collection(scene).children.link(holder)
    holder.name = population.name
    return holder


def _dissolve(scene: Scene, collection: Collection | None) -> None:
    """Take a population's collection away; what else lies in it goes up to the scene's collection for plants."""
    if collection is None or collection.library is not None:
        return
    parent = plant_objects.plant_collection(scene)
    for obj in collection.objects:
        if obj.name not in parent.objects:
            parent.objects.link(obj)
    for child in collection.children:
        if child.name not in parent.children:
            parent.children.link(child)
    bpy.data.collections.remove(collection)


def free_name(group: Iterable[bpy.types.PropertyGroup], name: str) -> str:
    """A name, with a number as Blender's where another of the group has it, in place of the number that it has."""
    taken, (stem, dot, end) = {one.name for one in group if one.name}, name.rpartition(".")
    stem = stem if dot and end.isdecimal() else name
    numbered = (f"{stem}.{i:03d}" for i in range(1, len(taken) + 2))
    return name if name not in taken else next(n for n in numbered if n not in taken)
