# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Add a biome to ground, layer after layer; plant its layers again; remove it with its plants.

Layers become ordinary populations that know their biome: each can be changed, frozen, updated and painted over. Where
there is no ground, a hectare of land is made; soil has the colors of what stands and lies on it.
"""

import json
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from math import pi, radians, tan
from typing import Any

import bpy
import numpy as np
from bpy.types import Collection, Depsgraph, Object, PropertyGroup, Scene
from mathutils import Vector

from ...arrays import Floats, Integers
from ...errors import SceneError, TetFloraError
from ...growth.hashing import child_key, key_of_seed, uniform
from ...jobs import Job, Progress, part_of
from ...planting.cover import Sheet
from ...planting.plane import gradient_noise
from ...species.litter import FALLEN
from ...species.litter import KIND as FALLEN_LEAVES
from ..attributes import world_matrix
from ..materials.soil import SHADED, lay_soil, may_have_soil
from ..placing.cover import fallen_from
from ..placing.population_data import fill_population, set_setting
from ..placing.populations import add_population, free_name, make_plants_steps, own_objects, remove_layer, restored
from ..placing.rules import biomes_in, set_grounds
from ..placing.terrain import grid_mesh, read_ground
from ..runtime import GoneError, JobData, is_there, job
from ..scene.crowns import crown_for
from ..scene.fields import fields_of, has_history, read_field
from ..settings import BIOME, SCATTER, with_identity
from ..species.edits import catalog, new_identifier, species_data, store_species, unknown_text
from ..stands.growing import GrownStand, again_steps, new_stand_steps
from .files import Biome, layers_of, pages_of, stand_settings, stands_of
from .layers import index_of
from .library import GROUND, data_of

_STANDS, _SOIL = 0.5, 0.06  # fractions of the work, at the begin and the end


@dataclass(frozen=True)
class BiomeResult:
    """What adding or planting a biome made."""

    name: str
    layers: list[tuple[str, int]]  # names of the layers, and how many plants each has
    bare: list[str]  # why layers have no plants
    kept: list[str]  # grounds that keep a material of the artist's


@job("Adding the biome")
def add_biome_steps(data: JobData, biome: Biome, grounds: Sequence[Object], seed: int = 0) -> Job[BiomeResult]:
    """Add a biome to grounds, with all of its plants. Closing the steps, or an error, leaves everything as it was.

    Raises
    ------
    SceneError
        It needs a species that the catalog lacks, no layer finds any place, or something was deleted meanwhile.
    """
    scene, depsgraph = data.scene, data.depsgraph
    data.add_objects(grounds)
    yield Progress(0.0, "Reading the biome")
    with restored(scene):
        renamed = _own_species(scene, biome)
        group, uid = scene.tetflora, uuid.uuid4().hex
        zone = group.layers.add()
        zone.kind, zone.uid, zone.name, zone.source = BIOME, uid, free_name(group.layers, biome.name), biome.identifier
        zone.gives_way, zone.slope_max = biome.gives_way, pi / 2
        zone.data = json.dumps({"ground": biome.ground, "season": biome.season}, ensure_ascii=False)
        for obj in grounds:
            zone.grounds.add().object = obj
        for key, value in (biome.limits | biome.mask).items():
            set_setting(zone, key, value)
        _keep_found(zone, grounds)
        zone.use_altitude = bool({"altitude_min", "altitude_max"} & biome.limits.keys())
        if "path_max" in biome.limits:
            zone.paths = make_line(scene, f"{zone.name} line", grounds)
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
            fill_population(population, layer, scene)
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


def _lay_on(population: PropertyGroup, grounds: Sequence[Object]) -> None:
    """Let a layer that was read grow on those of the grounds that it names or, without any, on all of them."""
    named = {entry.object for entry in population.grounds}
    targets = [obj for obj in grounds if obj in named] or grounds
    set_grounds(population, targets)
    _keep_found(population, targets)


def _keep_found(layer: PropertyGroup, grounds: Sequence[Object]) -> None:
    """Of the masks of a layer that was read, which are those of other grounds, keep what these have."""
    if all(layer.vertex_group not in obj.vertex_groups for obj in grounds):
        layer.vertex_group = ""
    if all(layer.uv_layer not in obj.data.uv_layers for obj in grounds):
        layer.uv_layer = ""


@job("Planting the biome")
def plant_biome_steps(data: JobData, biome: PropertyGroup) -> Job[BiomeResult]:
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


def _grown(names: list[str], grow: Callable[[int], Job[GrownStand]]) -> Job[tuple[list[tuple[str, int]], list[str]]]:
    """Grow stands by their numbers: names and numbers of plants of those that grew, and why others did not."""
    stands, bare = [], []
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
        stands.append((name, grown.plants))
    return stands, bare


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
            with closing(make_plants_steps(scene, depsgraph, population, names[number + 1 :])) as steps:
                planted = yield from part_of(steps, begin, end, title)
        except GoneError:
            raise
        except SceneError as error:
            bare.append(f"{title}: {error}")
            continue
        if planted.number or not planted.reason:
            layers.append((title, planted.number))
        else:
            bare.append(f"{title}: {planted.reason}")
    if bare and not layers:
        raise SceneError(bare[0])
    yield Progress(1.0 - _SOIL, "Soil")
    depsgraph.update()
    biome = with_identity(scene.tetflora.layers, uid)
    grounds = [entry.object for entry in biome.grounds if entry.object is not None] if biome is not None else []
    kept = lay_biome_soil(depsgraph, grounds) if grounds else []
    return BiomeResult(biome.name if biome is not None else "", layers, bare, kept)


def _own_species(scene: Scene, biome: Biome) -> dict[str, str]:
    """Keep the biome's own species in this file, or tell that one is nowhere; what they are called if not alike."""
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


def growing_of(scene: Scene, uid: str) -> list[Object]:
    """Those of them that have their years, and may be grown again: *Keep Year* makes a stand the artist's own."""
    return [obj for obj in stands_of(scene, uid) if has_history(obj) and not (obj.library or obj.data.library)]


def _fill_stand(layer: dict[str, Any], uid: str, renamed: Mapping[str, str], seed: int, stand: PropertyGroup) -> None:
    """Give a stand the settings of a checked layer."""
    for name in stand_settings():
        if name in layer:
            set_setting(stand, name, layer[name])
    stand.biome, stand.seed = uid, (stand.seed + seed) % 2**31
    for part in layer["species"]:
        entry = stand.species.add()
        for key, value in part.items():
            setattr(entry, key, renamed.get(value, value) if key == "species" else value)


def remove_biome(scene: Scene, biome: PropertyGroup) -> int:
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


NAME = "Land"
#: Side of land that is made, and of its squares, meters.
SIDE, STEP = 100.0, 1.0
_CELL, _MOST = 0.5, 400_000  # of the map of the soil
#: Waves of hills: meters from one to the next, and their height over that of the hills.
_WAVES = ((46.0, 0.42), (17.0, 0.1), (5.0, 0.016))
#: Of a valley, meters: half of its level floor, and from there to where it has half of its depth left; half the width
#: and the depth of its brook.
_FLOOR, _BANK, _BROOK, _DEEP = 7.0, 22.0, 4.5, 0.16


def heights(x: Floats, y: Floats, ground: Mapping[str, Any], seed: int = 0) -> Floats:
    """Of land for a biome, meters: hills, a slope that rises to the north, and a valley from west to east."""
    value = {name: ground.get(name, GROUND[name][0]) for name in ("hills", "slope", "valley")}
    points, key = np.stack([x, y], axis=-1).reshape(-1, 2), key_of_seed(seed)
    waves = sum(part * gradient_noise(points / size, key).reshape(x.shape) for size, part in _WAVES)
    aside = np.abs(y - brook(x))
    deep = 1.0 / (1.0 + (np.maximum(aside - _FLOOR, 0.0) / _BANK) ** 2)
    bed = _DEEP * np.exp(-((aside / _BROOK) ** 2))
    rough = waves * (1.0 - 0.85 * deep * (value["valley"] > 0.0))
    # Water runs west.
    low = (value["valley"] > 0.0) * (0.012 * x - bed) - value["valley"] * deep
    return value["hills"] * 2.0 * rough + tan(radians(value["slope"])) * y + low


def brook(x: Floats) -> Floats:
    """Where the middle of a valley is, y by x, meters."""
    return 7.0 * np.sin(np.asarray(x) / 19.0) + 3.0 * np.sin(np.asarray(x) / 7.3 + 1.0)


def make_land(scene: Scene, ground: Mapping[str, Any], seed: int = 0) -> Object:
    """A hectare of land around the 3D cursor."""
    along = np.arange(-SIDE / 2, SIDE / 2 + 0.1, STEP)
    x, y = np.meshgrid(along, along)
    land = bpy.data.objects.new(NAME, grid_mesh(NAME, np.stack([x, y, heights(x, y, ground, seed)], axis=2)))
    land.location = scene.cursor.location
    land.tetflora.is_occluder = True
    scene.collection.objects.link(land)
    return land


def make_line(scene: Scene, name: str, grounds: Iterable[Object]) -> Collection:
    """A collection with a curve that winds across the grounds from west to east, for biomes that follow lines."""
    corners = np.array([obj.matrix_world @ Vector(corner) for obj in grounds for corner in obj.bound_box])
    (west, south, low), (east, north, _) = corners.min(axis=0), corners.max(axis=0)
    x = np.linspace(west, east, 60)
    y = 0.5 * (south + north) + 0.012 * (north - south) * brook(100.0 * (x - 0.5 * (west + east)) / (east - west))
    curve = bpy.data.curves.new(name, 'CURVE')
    curve.dimensions = '3D'
    spline = curve.splines.new('POLY')
    spline.points.add(len(x) - 1)
    spline.points.foreach_set("co", np.stack([x, y, 0.0 * x + low, 0.0 * x + 1.0], axis=1).ravel().tolist())
    collection = bpy.data.collections.new(name)
    scene.collection.children.link(collection)
    collection.objects.link(bpy.data.objects.new(name, curve))
    return collection


def lay_biome_soil(depsgraph: Depsgraph, grounds: Sequence[Object]) -> list[str]:
    """Give ground a soil in the colors of the low plants and the litter of all biomes on it.

    Returns
    -------
    list of str
        Names of grounds that keep a material of the artist's.
    """
    fits = [obj for obj in grounds if may_have_soil(obj)]
    if not fits:
        return [obj.name for obj in grounds]
    sheet = Sheet.over(read_ground(fits, depsgraph).triangles.reshape(-1, 3), _CELL, _MOST)
    cells = sheet.rows * sheet.columns
    on_it = set(fits)
    # Groups of the artist's own layers have no file, which says what soil is like.
    biomes = [b for b in biomes_in(depsgraph.scene) if b.source and on_it & {entry.object for entry in b.grounds}]
    if not biomes:
        return []
    earth, turf, share, here = np.zeros((cells, 3)), np.zeros((cells, 3)), np.zeros(cells), np.full(cells, 1e-9)
    hidden, color = np.zeros(cells), np.zeros((cells, 3))
    for biome in biomes:
        ground = data_of(biome).get("ground", {})
        value = {name: np.array(ground.get(name, GROUND[name][0])) for name in ("earth", "turf", "turf_share")}
        density = np.full(cells, 1e-6)
        for low, cell, area, colors in _low_plants(depsgraph, biome.uid, sheet):
            density += np.bincount(cell, minlength=cells)
            if low:
                hidden += np.bincount(cell, area, cells)
                color += np.stack([np.bincount(cell, area * c, cells) for c in colors.T], axis=1)
        density = _blurred(density.reshape(sheet.rows, sheet.columns)).reshape(-1)
        here += density
        earth += density[:, None] * value["earth"]
        turf += density[:, None] * value["turf"]
        share += density * value["turf_share"]
    earth, turf, share = earth / here[:, None], turf / here[:, None], share / here
    lying = 1.0 - np.exp(-hidden / sheet.cell**2)
    mean = SHADED * color / np.maximum(hidden, 1e-12)[:, None]
    ground = earth + (lying * (1.0 - share))[:, None] * (mean - earth)
    shape = sheet.rows, sheet.columns
    earth, share = ground.reshape(*shape, 3), share.reshape(shape)
    return lay_soil("Land", grounds, earth, share, turf.mean(axis=0), sheet.low, sheet.cell)


def _low_plants(depsgraph: Depsgraph, uid: str, sheet: Sheet) -> Iterable[tuple[bool, Integers, Floats, Floats]]:
    """Plants of the layers of a biome: whether they are low, their cells, what each hides, m², and its color."""
    scene = depsgraph.scene
    for population in scene.tetflora.layers:
        if population.biome != uid:
            continue
        for obj in fields_of(own_objects(scene, population)):
            read = read_field(obj, depsgraph, world_matrix(obj, depsgraph)[None])
            place = ((read.position[:, :2] - sheet.low) / sheet.cell).astype(np.int64)
            place = np.clip(place, 0, (sheet.columns - 1, sheet.rows - 1))
            crowns = [crown_for(scene, kind) for kind in read.identifiers]
            seen = np.array([crown.seen for crown in crowns])[read.species] * read.scale**2
            colors = np.array([crown.color for crown in crowns])[read.species]
            yield bool(population.covers), place[:, 1] * sheet.columns + place[:, 0], seen, colors


def _blurred(grid: Floats, reach: int = 8) -> Floats:
    """Means over squares of 2 · reach + 1 cells, (rows, columns)."""
    for axis in (0, 1):
        sums = np.cumsum(np.pad(grid, [(reach + 1, reach) if a == axis else (0, 0) for a in (0, 1)], mode="edge"), axis)
        long = sums.shape[axis]
        grid = np.take(sums, range(2 * reach + 1, long), axis) - np.take(sums, range(long - 2 * reach - 1), axis)
    return grid / (2 * reach + 1) ** 2
