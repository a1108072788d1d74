# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From the settings of a population to places for its plants: rules for the engine, grounds, and what stands there.

Places where the brush has erased plants stay bare. The population has them as JSON: of each stroke radius and centers.

Each biome takes a part of its ground, its zone. Biomes with limits or a mask come first, in the order of the list;
those without take what is left. So a riparian wood that is added to a beech forest pushes it back from the water.
"""

import json
from collections.abc import Callable, Collection, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, lru_cache
from hashlib import blake2b
from itertools import takewhile
from math import inf
from typing import Any, NamedTuple

import bpy
import numpy as np
from bpy.types import ID, Depsgraph, Object, Property, PropertyGroup, Scene, ViewLayer

from ...arrays import Floats, Integers32
from ...errors import SceneError
from ...files import parse_json
from ...planting.cover import Suits
from ...planting.places import Placement, place, without
from ...planting.plane import Path, Terrain
from ...planting.rules import Companion, Rules
from ...planting.site import Limits, Spots, Zone, distance_lines
from ...planting.wetness import wet_ground
from ...species.kinds import species_of
from ..attributes import world_matrix
from ..runtime import Outlook
from ..scene.fields import fields_of, read_field
from ..scene.objects import objects_within
from ..settings import BIOME, SCATTER, active_in, check_limits, rules_of, with_identity
from ..species.catalog import default_species
from ..species.edits import catalog, unknown_text
from .canopy import Above, canopy_of, is_cover, not_of_covers, read_suits
from .distances import HECTARE, distance_of, weights_of
from .plant_objects import EMPTIES_UNASKED, plants_of
from .terrain import MASKS, ground_form, lies_elsewhere, lines_within, read_ground

#: Settings of a biome's mask, by the names that `read_ground` has for them.
MASK = ("vertex_group", "invert_group", "image", "invert_image", "uv_layer")


def biomes_in(scene: Scene) -> list[PropertyGroup]:
    """Biomes of a scene, those above first."""
    return [layer for layer in scene.tetflora.layers if layer.kind == BIOME]


def biome_of(scene: Scene, population: PropertyGroup) -> PropertyGroup | None:
    """The biome of which a population is a layer; None of others."""
    return with_identity(scene.tetflora.layers, population.biome) if population.biome else None


def limits_of_zone(biome: PropertyGroup) -> Limits:
    """The limits of a biome; those that are switched off are open."""
    given = {field.name: getattr(biome, field.name) for field in fields(Limits)}
    if not biome.use_altitude:
        given |= {"altitude_min": -inf, "altitude_max": inf}
    if biome.paths is None:
        given |= {"path_min": 0.0, "path_max": inf}
    return Limits(**given)


def is_limited(biome: PropertyGroup) -> bool:
    """Whether a biome takes only a part of its ground."""
    return bool(biome.vertex_group or biome.image or not limits_of_zone(biome).open)


def come_before(scene: Scene, biome: PropertyGroup) -> list[PropertyGroup]:
    """Biomes with limits on a shared ground to which one gives way: those above it or, if it has none itself, all."""
    if not biome.gives_way:
        return []
    grounds, others = {entry.object for entry in biome.grounds}, biomes_in(scene)
    if is_limited(biome):
        others = takewhile(lambda other: other.uid != biome.uid, others)
    limited = (other for other in others if other.uid != biome.uid and is_limited(other))
    return [other for other in limited if grounds & {entry.object for entry in other.grounds}]


def zone_values(scene: Scene, population: PropertyGroup) -> list[Any]:
    """All that decides the zone of a population or stand, for its fingerprint; empty without a biome."""
    biome = biome_of(scene, population)
    if biome is None:
        return []
    values = []
    for one in (biome, *come_before(scene, biome)):
        masks = [getattr(value, "name_full", value) for value in (getattr(one, name) for name in MASK)]
        limits = repr(limits_of_zone(one)) if is_limited(one) else ""
        values.append([*masks, limits, one.paths.name_full if one.paths else ""])
    return values if len(values) > 1 or is_limited(biome) else []


def _read_zones(depsgraph: Depsgraph, population: PropertyGroup, grounds: Sequence[Object]) -> tuple[Zone, ...]:
    """Zones that limit a population on its grounds: its biome's, and the inverse of those to which that gives way."""
    biome = biome_of(depsgraph.scene, population)
    if biome is None:
        return ()
    zones = [_zone(biome, grounds, depsgraph)] if is_limited(biome) else []
    others = [replace(_zone(other, grounds, depsgraph), inverse=True) for other in come_before(depsgraph.scene, biome)]
    return (*zones, *others)


def zoned(depsgraph: Depsgraph, owner: PropertyGroup, grounds: Sequence[Object], ground: Terrain) -> Terrain:
    """A ground with the zones of a layer, a population or a stand, in its weights: as they are at the corners.

    Raises
    ------
    SceneError
        A mask or a path cannot be read, as the message says.
    """
    zones = _read_zones(depsgraph, owner, grounds)
    if not zones:
        return ground
    corners, count = ground.triangles, len(ground.triangles)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.abs(normal) / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    each = np.repeat(np.arange(count), 3)
    spots = Spots(each, np.tile(np.eye(3), (count, 1)), corners.reshape(-1, 3), normal[each])
    wet = wet_ground(corners) if any(zone.limits.ask_for_water for zone in zones) else None
    share = np.prod([zone.share(spots, wet) for zone in zones], axis=0).reshape(count, 3)
    return replace(ground, weight=share if ground.weight is None else share * ground.weight)


def _zone(biome: PropertyGroup, grounds: Sequence[Object], depsgraph: Depsgraph) -> Zone:
    limits = limits_of_zone(biome)
    lines = () if biome.paths is None else lines_within(biome.paths, depsgraph)
    mask = {name: getattr(biome, name) for name in MASK}
    if not (biome.vertex_group or biome.image):
        return Zone(limits, lines=distance_lines(lines, limits))
    ground = read_ground(grounds, depsgraph, **mask)
    return Zone(limits, ground.weight, ground.uv, ground.image, distance_lines(lines, limits))


#: Settings of biomes only.
BIOME_ONLY = ("gives_way", "slope_softness", "altitude_softness", "path_min", "path_max", "path_softness")
#: Identity and state of a population; all else are settings, which can be copied and written to files.
IDENTITY = {
    *("rna_type", "name", "uid", "frozen", "collection", "made", "message", "placed_by", "stood_on", "erased"),
    *("mix_index", "add_species"),
    *("distance_from", "covers", "biome", "kind", "field", "source", "data", "shown", "folded"),
    *("limits", "limits_shown"),
    *BIOME_ONLY,
}
_DIGITS = 4  # of erased places: tenths of a millimeter
#: Settings of a species of a mixture.
ENTRY = ("species", "weight", "companion", "companion_strength", "companion_distance", "habitat", "shed_by")


def settings_of(group: type[PropertyGroup] | PropertyGroup) -> list[Property]:
    """Properties of a population that define how plants are placed; a range is those of its numbers."""
    return [p for p in group.bl_rna.properties if p.identifier not in IDENTITY and not p.identifier.endswith("_range")]


def fingerprint(population: PropertyGroup) -> str:
    """A short text that changes with the settings; those left at their default do not count.

    A setting that a later version adds changes nothing for populations that do not use it.
    """
    values: list[Any] = [[e.object.name_full for e in population.grounds if e.object is not None]]
    for entry in population.mix:
        values.append([getattr(entry, name) for name in ENTRY])
    for name, default in _defaults(type(population)):
        value = distance_of(population) if name == "min_distance" else getattr(population, name)
        if isinstance(value, ID):
            value = value.name_full
        if value != default:
            values.append([name, value])
    values += zone_values(population.id_data, population)
    return digest(values)


def digest(values: list[Any]) -> str:
    """A short text that changes with values."""
    return blake2b(repr(values).encode(), digest_size=8).hexdigest()


@lru_cache(maxsize=1)
def _defaults(kind: type[PropertyGroup]) -> tuple[tuple[str, Any], ...]:
    """Names and defaults of settings that are single values, with the distance itself; panels ask at every redraw."""
    simple = [p for p in settings_of(kind) if p.type != 'COLLECTION' and p.identifier != "distance_by_species"]
    return tuple((p.identifier, None if p.type == 'POINTER' else p.default) for p in simple)


def awaits_update(population: PropertyGroup) -> bool:
    """Whether a population has no plants yet, or others than an update would give it; grounds are not read."""
    if not population.uid or population.frozen:
        return False
    home, uid, every = population.collection, population.uid, population.id_data.objects
    gone = not (home and home.objects) and not bpy.data.objects[500:501]  # or a draw of panels would take too long
    outdated = not population.made or population.placed_by != fingerprint(population) or on_changed_ground(population)
    return outdated or (gone and all(o.tetflora.population != uid for o in every))


def forms_of(grounds: Iterable[Object], form: Callable[[Object], str]) -> str:
    """The forms of all grounds of a layer, as `ground_form` gives that of each; empty where one has none."""
    forms = list(map(form, grounds))
    return " ".join(forms) if all(forms) else ""


class SeenGrounds(NamedTuple):
    """Of a layer: names of its grounds, those not in the scene, and where plants stood if one was changed since."""

    names: str = "…"
    missing: tuple[str, ...] = ()
    stood_on: str = ""


def ground_steps(scene: Scene, view_layer: ViewLayer) -> Generator[None, None, dict[str, SeenGrounds]]:
    """What is to say of the grounds of each layer, by its identifier."""
    seen, form = {}, cache(lambda obj: ground_form(obj, view_layer.depsgraph))
    kept = [(one.uid, rules_of(one)) for one in scene.tetflora.layers]
    read = [(uid, one.stood_on, grounds_of(scene, one), [e.object for e in one.grounds]) for uid, one in kept]
    for uid, before, grounds, named in read:
        moved, present = before and lies_elsewhere(before, forms_of(grounds, form)), {None, *grounds}
        missing = tuple(obj.name for obj in named if obj not in present)
        seen[uid] = SeenGrounds(briefly(grounds), missing, before if moved else "")
        yield
    return seen


def briefly(objects: list[Object]) -> str:
    """Names of the first two, and how many follow."""
    return ", ".join(obj.name for obj in objects[:2]) + (f" and {len(objects) - 2:,} more" if len(objects) > 2 else "")


#: What `ground_steps` found, a moment after each change.
seen_grounds = Outlook(ground_steps)
register, unregister = seen_grounds.register, seen_grounds.unregister


def grounds_seen(layer: PropertyGroup) -> SeenGrounds:
    """What was found last of the grounds of a layer; cheap."""
    return (seen_grounds.of(layer.id_data, bpy.context.view_layer) or {}).get(layer.uid, SeenGrounds())


def on_changed_ground(layer: PropertyGroup) -> bool:
    """Whether a ground was changed, as it was found last, and the layer was not grown again since; cheap."""
    return grounds_seen(layer).stood_on == rules_of(layer).stood_on != ""


def free_seed(scene: Scene, seed: int) -> int:
    """A seed, or another if a population has it: where that one's plants stand there is no room."""
    taken = {layer.seed for layer in scene.tetflora.layers if layer.kind == SCATTER}
    return max(taken) % (2**31 - 1) + 1 if seed in taken else seed


def copy_settings(source: PropertyGroup, target: PropertyGroup) -> None:
    """Give a population the settings of another; identity, grounds and plants stay its own."""
    for prop in settings_of(source):
        if prop.type != 'COLLECTION':
            setattr(target, prop.identifier, getattr(source, prop.identifier))
    target.mix.clear()
    for entry in source.mix:
        copy_entry(entry, target.mix.add())


def copy_entry(source: PropertyGroup, target: PropertyGroup) -> None:
    """Let an entry of a mixture be as another."""
    for name in ENTRY:
        setattr(target, name, getattr(source, name))


def active_population(scene: Scene) -> PropertyGroup | None:
    """The population that buttons act on; None where the active layer is none."""
    active = active_in(scene.tetflora, "layers")
    return active if active is not None and active.kind == SCATTER else None


def shown_population(scene: Scene) -> PropertyGroup:
    """What the panel shows: the active population, or the settings for new ones where there is none."""
    return active_population(scene) or scene.tetflora.populate


def rules_from(population: PropertyGroup) -> tuple[Rules, tuple[str, ...]]:
    """A population's settings as the engine takes them, and the species that its weights refer to.

    Companions that are not in the mixture follow it with a weight of 0.
    """
    mix = [(e.species or default_species(), e) for e in population.mix]
    weights = weights_of(population)
    for _, entry in mix:
        if entry.companion:
            weights.setdefault(entry.companion, 0.0)
    species = tuple(weights)
    pairs = [(species.index(s), species.index(e.companion), e) for s, e in mix if e.companion and e.companion_strength]
    companions = tuple(Companion(a, b, e.companion_strength, e.companion_distance) for a, b, e in pairs)
    free = ("min_distance", "altitude_min", "altitude_max", "density", "weights", "companions")
    given = {name: getattr(population, name) for name in Rules.__dataclass_fields__ if name not in free}
    low, high = (population.altitude_min, population.altitude_max) if population.use_altitude else (-inf, inf)
    given |= {"min_distance": distance_of(population), "altitude_min": low, "altitude_max": high}
    density, every = population.density / HECTARE, tuple(weights.values())
    return Rules(**given, density=density, weights=every, companions=companions), species


def makes_field(population: PropertyGroup, number: int) -> bool:
    """Whether so many plants of a population are made as one field."""
    return population.as_field == 'FIELD' or (population.as_field == 'AUTOMATIC' and number > EMPTIES_UNASKED)


def note_erased(population: PropertyGroup, centers: Floats | Sequence, radius: float) -> None:
    """Keep circles on the map bare, with centers (n, 2) or more columns; meters."""
    flat = np.round(np.asarray(centers, dtype=np.float64)[:, :2], _DIGITS).ravel().tolist()
    population.erased = json.dumps([*_strokes(population), [round(radius, _DIGITS), *flat]], separators=(",", ":"))


def _strokes(population: PropertyGroup) -> list[list[float]]:
    try:
        strokes = parse_json(population.erased) if population.erased else []
        if all(len(stroke) % 2 and np.isfinite(np.array(stroke, np.float64)).all() for stroke in strokes):
            return strokes
    except (ValueError, TypeError):
        pass
    raise SceneError(f'"{population.name}": its erased places cannot be read; click Clear Erased Places')


def grounds_of(scene: Scene, population: PropertyGroup) -> list[Object]:
    """Meshes of the scene that a population grows on.

    What was deleted from the scene does not count, although the population's pointer keeps it in the file.
    """
    named = [entry.object for entry in population.grounds]
    if getattr(population, "ground_collection", None) is not None:  # stands have none
        named += objects_within(population.ground_collection)
    meshes = dict.fromkeys(o for o in named if o is not None and o.type == 'MESH' and not o.tetflora.is_field)
    # Most are seen in a view layer, which needs no look through all objects.
    seen = {o for o in meshes if any(o.visible_get(view_layer=one) for one in scene.view_layers)}
    present = seen if len(seen) == len(meshes) else {*scene.objects}
    return [o for o in meshes if o in present]


def checked_grounds(scene: Scene, population: PropertyGroup) -> list[Object]:
    """The same; a `SceneError` where there are none."""
    if not (grounds := grounds_of(scene, population)):
        raise SceneError(
            f'"{population.name}" has no ground in this scene; select meshes and click Use Selected Meshes'
            if population.uid
            else "Select a mesh to plant on"
        )
    return grounds


def set_grounds(population: PropertyGroup, grounds: Iterable[Object]) -> None:
    """Let a population grow on these meshes instead."""
    population.grounds.clear()
    for obj in grounds:
        population.grounds.add().object = obj


@dataclass(frozen=True)
class Search:
    """All that the places of a population's plants depend on, as it was read from Blender."""

    ground: Terrain
    rules: Rules
    present: tuple[Floats, Integers32]
    suits: Callable[[], Mapping[int, Suits]]
    erased: tuple[Path, ...]
    species: tuple[str, ...]  # identifiers that placements count through
    zones: tuple[Zone, ...] = ()

    def placement(self) -> Placement:
        """Find the places; no Blender in it.

        Raises
        ------
        SceneError
            Settings that leave no place.
        """
        placement = place(self.ground, self.rules, *self.present, suits=self.suits(), zones=self.zones)
        return without(placement, self.erased)


def read_search(
    scene: Scene,
    depsgraph: Depsgraph,
    population: PropertyGroup,
    ignored: Collection[Object],
    grounds: Sequence[Object] | None = None,
    most: int | None = None,
    above: Above | None = None,
) -> Search:
    """Read what the places of a population's plants depend on.

    Parameters
    ----------
    ignored : set of bpy.types.Object
        Its present plants, which do not count.
    grounds : sequence of bpy.types.Object, optional
        Meshes instead of the population's own.
    most : int, optional
        Upper limit of plants, for a preview.
    above : Above, optional
        What stands over the ground, if that was read already.

    Raises
    ------
    SceneError
        No ground, or a species that the catalog does not have.
    """
    known = catalog()
    for entry in population.mix:
        if entry.species and entry.species not in known:
            raise SceneError(unknown_text(entry.species))
    grounds = checked_grounds(scene, population) if grounds is None else grounds
    for group in (population, *population.mix):
        check_limits(group, f'"{population.name}"')
    rules, species = rules_from(population)
    if most is not None:
        rules = replace(rules, count=min(rules.count, most))
    ground = read_ground(grounds, depsgraph, **{name: getattr(population, name) for name in MASKS})
    if above is None and is_cover(population):
        above = canopy_of(scene, depsgraph)
    suits = read_suits(population, ground.triangles, species, above)
    present = _standing(depsgraph, ignored, species)
    zones = _read_zones(depsgraph, population, grounds)
    circles = [(radius, np.array(centers, np.float64).reshape(-1, 2)) for radius, *centers in _strokes(population)]
    erased = tuple(Path(center[None], radius) for radius, centers in circles for center in centers)  # of one point
    return Search(ground, rules, present, suits, erased, species, zones)


def _standing(depsgraph: Depsgraph, without: Collection[Object], species: Sequence[str]) -> tuple[Floats, Integers32]:
    """Places (m, 3) and species (m,) of plants of the scene, objects and fields; -1 for species that are not given."""
    numbers = {identifier: number for number, identifier in enumerate(species)}
    # What covers the ground keeps nobody away.
    objects = [o for o in not_of_covers(depsgraph.scene) if o not in without]
    single = plants_of(objects)
    position = [np.array([o.matrix_world.translation for o in single], dtype=np.float64).reshape(-1, 3)]
    kinds = [np.array([numbers.get(o.tetflora.species, -1) for o in single], dtype=np.int32)]
    for field in fields_of(objects):
        read = read_field(field, depsgraph, world_matrix(field, depsgraph)[None])
        position.append(read.position)
        own_numbers = np.array([numbers.get(species_of(kind), -1) for kind in read.identifiers], dtype=np.int32)
        kinds.append(own_numbers[read.species])
    return np.concatenate(position), np.concatenate(kinds)
