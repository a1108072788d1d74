# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The plants of a scene as arrays: single objects, instances and fields.

Plants whose species is an asset do not grow and are read apart, with all of their transform. Only this file and
`objects` loop over plants, and only over those that are objects.
"""

from collections.abc import Container
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Self

import bpy
import numpy as np
from bpy.types import Depsgraph, Object, Scene

from ...arrays import Floats, Integers, Integers32
from ...errors import SceneError, TetFloraError, listed
from ...growth.hashing import child_key, key_of_seed
from ...growth.seasons import is_gone
from ...growth.seeds import Seeds, crown_shapes
from ...growth.wind import rotation_vectors
from ...species.kinds import Kind, species_of
from ..attributes import frames_of, moves, world_matrix
from ..settings import season_of
from ..species.asset_species import PREFIX, asset_of, asset_species, find_asset, name_of
from ..species.edits import catalog, edited_infos, species_for
from .ages import Part, classed
from .fields import read_aged_field, read_field_matrices, stored_ages
from .looks import LayerLooks
from .motion import at_moments, exposure
from .objects import Copies, copies_of, is_drop, may_instance, may_take_part, name_keys, renderable_objects
from .skeletons import kind_of, kind_of_choice


def gone_species(scene: Scene) -> set[str]:
    """Identifiers of those that populations of the scene strew, or that its file holds."""
    group, season = scene.tetflora, season_of(scene)
    names = set(edited_infos())
    names |= {e.species for p in group.layers for e in p.mix if e.habitat == 'FALLEN'}
    gone = set()
    for name in names:
        with suppress(TetFloraError):  # which is told elsewhere
            if is_gone(species_for(scene, name), season):
                gone.add(name)
    return gone


_NAMED = 3  # objects that a message names before it only counts


class NoPlantsError(SceneError):
    """There is nothing to refine; a render may go on without a message."""


def read_plants(scene: Scene, depsgraph: Depsgraph) -> tuple[Seeds, tuple[tuple[str, int], ...], str]:
    """Enabled plants of a view layer that render: single ones by name, then instances, then fields.

    Plants and fields that collections or geometry nodes instance take part; each instance is an individual of its own.

    A plant has the direction of its z axis, the azimuth of its x axis, and the mean of its absolute scales: plants are
    neither stretched nor mirrored. With motion blur they are where they are amid the exposure, and have their motion.

    Returns
    -------
    seeds : Seeds
    owners : tuple of (str, int)
        Names of the objects that they belong to, in their order, each with the number of its own.
    unknown : str
        Names plants of which nobody has the species: they are left out, unless there are no others.

    Raises
    ------
    NoPlantsError
        No plant is left; the message says how to get some.
    SceneError
        No plant is of a known species, or one has a scale of 0 or an invalid transform; the message names them.
    """
    read = partial(_read_plants, scene, depsgraph)
    movers = scene.render.use_motion_blur and [o for o in bpy.data.objects if may_take_part(o) and moves(o)]
    if not movers:
        return read()
    first, last = exposure(scene)
    seconds = (last - first) * scene.render.fps_base / scene.render.fps
    moments = at_moments(depsgraph, movers, (first, last, (first + last) / 2.0), read)
    (before, *_), (after, *_), (seeds, owners, unknown) = moments
    turned = after.frame @ before.frame.transpose(0, 2, 1)
    motion = np.concatenate([after.position - before.position, rotation_vectors(turned)], axis=1) / max(seconds, 1e-9)
    return replace(seeds, motion=motion) if motion.any() else seeds, owners, unknown


@dataclass(frozen=True)
class Source:
    """Plants that one object brings, or single ones of one look."""

    look: str
    part: Part
    #: The field whose own points they are; None of instances and single plants.
    field: Object | None = None

    def without(self, species: Container[str]) -> Self:
        """The same without plants of some species."""
        name, seeds, ages, sizes = self.part
        kept = np.array([species_of(kind) not in species for kind in seeds.identifiers], bool)
        if kept.all():
            return self
        plants = np.flatnonzero(kept[seeds.species])
        left = seeds.take(plants), None if ages is None else ages[plants], None if sizes is None else sizes.take(plants)
        return replace(self, part=(name, *left))


@dataclass
class _Found:
    """What takes part, before anybody asks whether its species are known."""

    sources: list[Source]
    single: dict[str, list[Object]]  # plants that are objects, by look: they come first
    odd: list[tuple[str, str]]  # names of objects with species that nobody has
    owners: list[Object]  # plants and fields of the view layer
    copies: list[Copies]

    def nothing(self, scene: Scene) -> SceneError:
        """The error where no plant is left."""
        if self.odd:
            return SceneError(_unknown(self.odd))
        every = (*self.owners, *(c.owner for c in self.copies))
        if every and not any(o.tetflora.enabled for o in every):
            return NoPlantsError("All plants in the scene are disabled; enable some in Properties > Object")
        if fields := [o.name for o in self.owners if o.tetflora.is_field]:
            return NoPlantsError(
                f"{listed(fields)}: the field of plants has no points; add vertices, or populate a mesh"
            )
        if hidden := sum(o.tetflora.is_plant or o.tetflora.is_field for o in scene.objects) - len(self.owners):
            return NoPlantsError(
                f"No plants to render; {hidden:,} are hidden in renders or excluded from the view layer. Enable them "
                "or their collections in the Outliner"
            )
        to_add = "add some with Add > TetFlora Plant, or with + under Layers in the TetFlora tab"
        return NoPlantsError(f"No plants to render; {to_add}")


def read_sources(scene: Scene, depsgraph: Depsgraph) -> list[Source]:
    """What `read_plants` reads, object by object, with ages and recorded sizes as they are stored.

    Raises
    ------
    SceneError
        As `read_plants`, and where nobody has the species of a plant.
    """
    survey = _find_plants(scene, depsgraph)
    if survey.odd or not survey.sources:
        raise survey.nothing(scene)
    return survey.sources


def _read_plants(scene: Scene, depsgraph: Depsgraph) -> tuple[Seeds, tuple[tuple[str, int], ...], str]:
    survey = _find_plants(scene, depsgraph)
    unknown = {species for _, species in survey.odd}
    read = [plants for source in survey.sources if len((plants := source.without(unknown)).part[1])]
    if not read:
        raise survey.nothing(scene)
    owners = [(source.part[0], len(source.part[1])) for source in read]
    owners[: len(survey.single)] = [(obj.name, 1) for plants in survey.single.values() for obj in plants]
    aged = classed(scene, [source.part for source in read], depsgraph)
    seen = [
        replace(seeds, identifiers=tuple(str(replace(Kind.read(kind), look=source.look)) for kind in seeds.identifiers))
        for source, (_, seeds) in zip(read, aged, strict=True)
    ]
    return merged(seen), tuple(owners), f"Left out {_unknown(survey.odd)}" if survey.odd else ""


def _find_plants(scene: Scene, depsgraph: Depsgraph) -> _Found:
    known, assets = catalog(), {*asset_species(scene), *gone_species(scene)}
    odd: list[tuple[str, str]] = []  # names of objects, each with a species
    objects = sorted(renderable_objects(depsgraph.view_layer), key=lambda o: o.name_full)
    grouped = [(o, o.tetflora) for o in objects]  # asking an object for its group is half of the time
    grouped = [(o, group) for o, group in grouped if group.is_plant or group.is_field]
    owners = [o for o, _ in grouped]
    single = [o for o, group in grouped if group.is_plant and group.enabled and group.species not in assets]
    odd += [(o.name, o.tetflora.species) for o in single if o.tetflora.species not in known]
    looks, alike = LayerLooks(depsgraph.view_layer), {}
    for obj in single:
        if obj.tetflora.species in known:
            alike.setdefault(looks.of(obj), []).append(obj)
    given = [
        Source(look, (plants[0].name, single_plants(plants, depsgraph), stored_ages(plants), None))
        for look, plants in alike.items()
    ]
    copies = copies_of([o for o in objects if may_instance(o)], depsgraph)
    enabled = [c for c in copies if c.owner.tetflora.enabled]
    for c in enabled:
        if c.owner.tetflora.is_plant and c.geometry is None and c.owner.tetflora.species not in assets:
            given.append(Source(looks.of(c.owner, c.instancer), (c.owner.name, *_copied_plants(c))))
    for obj in owners:
        if obj.tetflora.is_field and obj.tetflora.enabled:
            part = read_aged_field(obj, depsgraph, world_matrix(obj, depsgraph)[None])
            given.append(Source(looks.of(obj), (obj.name, *part), obj))
    for c in enabled:
        if c.owner.tetflora.is_field:
            part = read_aged_field(c.owner, depsgraph, c.matrices, c.keys, c.geometry)
            given.append(Source(looks.of(c.owner, c.instancer), (c.owner.name, *part)))
    sources = [plants for source in given if len((plants := source.without(assets)).part[1])]
    for source in sources:
        name, seeds, *_ = source.part
        odd += [(name, one) for one in dict.fromkeys(map(species_of, _occurring(seeds))) if one not in known]
    return _Found(sources, alike, odd, owners, copies)


@dataclass(frozen=True)
class AssetPlants:
    """Plants of one species that is an asset."""

    species: str  # identifier
    #: The original object that they are, are instances of, or whose points they are; or several, one for each place
    owners: tuple[Object, ...]
    seed: Integers  # (n,)
    #: (n, 4, 4): To world space; stretched and mirrored as the objects, points and instances are
    matrices: Floats


def read_asset_plants(scene: Scene, depsgraph: Depsgraph) -> list[AssetPlants]:
    """Enabled plants of a view layer that render and whose species is an asset, in the order of `read_plants`.

    Objects that show a collection which is a species count as plants of it, each by itself, seeded by its name.

    Raises
    ------
    SceneError
        A transform that is not a number; the message names the object.
    """
    assets = asset_species(scene)
    if not assets:
        return []
    objects = sorted(renderable_objects(depsgraph.view_layer), key=lambda o: o.name_full)
    single: dict[tuple[str, str], list[Object]] = {}
    looks, fields, drops = LayerLooks(depsgraph.view_layer), [], []
    for obj in objects:
        group = obj.tetflora
        if group.is_plant and group.enabled and group.species in assets:
            single.setdefault((group.species, looks.of(obj, model=True)), []).append(obj)
        elif group.is_field and group.enabled:
            fields.append(obj)
        elif is_drop(obj):
            drops.append(obj)
    groups = []
    for (species, _), owners in single.items():
        seed = np.array([o.tetflora.seed for o in owners], dtype=np.int64)
        matrices = np.array([world_matrix(o, depsgraph) for o in owners], dtype=np.float64)
        groups.append(AssetPlants(species, tuple(owners), seed, matrices))
    for obj in drops:  # one by one: each shows its plant itself
        species = asset_of(obj.instance_collection, scene).identifier
        placed = world_matrix(obj, depsgraph)[None].astype(np.float64)
        groups.append(AssetPlants(species, (obj,), name_keys([obj]).view(np.int64), placed))
    copies = [c for c in copies_of([o for o in objects if may_instance(o)], depsgraph) if c.owner.tetflora.enabled]
    for c in copies:
        if c.owner.tetflora.is_plant and c.geometry is None and c.owner.tetflora.species in assets:
            seed = child_key(key_of_seed(c.owner.tetflora.seed), c.keys).view(np.int64)
            groups.append(AssetPlants(c.owner.tetflora.species, (c.owner,), seed, c.matrices))
    read = [(obj, world_matrix(obj, depsgraph)[None], None, None) for obj in fields]
    read += [(c.owner, c.matrices, c.keys, c.geometry) for c in copies if c.owner.tetflora.is_field]
    for obj, matrices, keys, geometry in read:
        for kind, seed, placed in read_field_matrices(obj, depsgraph, matrices, assets, keys, geometry):
            groups.append(AssetPlants(species_of(kind), (obj,), seed, placed))
    for plants in groups:
        bad = ~np.isfinite(plants.matrices).all(axis=(1, 2))
        if bad.any():
            names = [plants.owners[min(i, len(plants.owners) - 1)].name for i in np.flatnonzero(bad).tolist()[:_NAMED]]
            named = listed(list(dict.fromkeys(names)))
            raise SceneError(f"{named}: an invalid position; clear it with Alt S and Alt G")
    return groups


def single_plants(plants: list[Object], depsgraph: Depsgraph) -> Seeds:
    """Plants that are objects, in their order. Errors are those of `read_plants`."""
    groups = [obj.tetflora for obj in plants]
    names, kinds, known = [obj.name for obj in plants], [kind_of_choice(group) for group in groups], catalog()
    odd = [(name, group.species) for name, group in zip(names, groups, strict=True) if group.species not in known]
    if odd:
        raise SceneError(_unknown(odd))
    number = {kind: i for i, kind in enumerate(sorted(set(kinds)))}
    species = np.array([number[kind] for kind in kinds], dtype=np.int32)
    seeds = np.array([group.seed for group in groups], dtype=np.int64)
    # Some versions of Blender give single precision.
    matrices = np.array([world_matrix(obj, depsgraph) for obj in plants], dtype=np.float64).reshape(-1, 4, 4)
    return _placed(names, tuple(number), species, seeds, matrices)


def _copied_plants(copies: Copies) -> tuple[Seeds, Floats | None, None]:
    """Instances of a plant, each an individual of its own: its key is added to the seed. And their ages."""
    plant = copies.owner
    seeds = child_key(key_of_seed(plant.tetflora.seed), copies.keys).view(np.int64)
    age = stored_ages([plant])
    individuals = _placed([plant.name], (kind_of(plant),), np.zeros(len(seeds), np.int32), seeds, copies.matrices)
    return individuals, None if age is None else np.repeat(age, len(seeds)), None


def _placed(names: list[str], kinds: tuple[str, ...], species: Integers32, seeds: Integers, matrices: Floats) -> Seeds:
    frame, scale, sound = frames_of(matrices[:, :3, :3])
    sound &= np.isfinite(matrices).all(axis=(1, 2))
    if not sound.all():
        bad = [names[min(i, len(names) - 1)] for i in np.flatnonzero(~sound)[: _NAMED * len(names)].tolist()]
        raise SceneError(
            f"{listed(list(dict.fromkeys(bad)))}: zero scale, a scale above 100,000, or an invalid position; clear "
            "them with Alt S and Alt G"
        )
    return Seeds(kinds, species, seeds, matrices[:, :3, 3].copy(), frame, scale)


def _occurring(seeds: Seeds) -> list[str]:
    return [seeds.identifiers[i] for i in np.flatnonzero(np.bincount(seeds.species)).tolist()]


def merged(read: list[Seeds]) -> Seeds:
    """Plants of all objects as one, with the kinds that occur."""
    identifiers = tuple(sorted({kind for seeds in read for kind in _occurring(seeds)}))
    number = {kind: i for i, kind in enumerate(identifiers)}
    parts, shaped = [], any(seeds.crown is not None for seeds in read)
    for seeds in read:
        to_all = np.array([number.get(kind, 0) for kind in seeds.identifiers], np.int32)
        crown = crown_shapes(len(seeds)) if shaped and seeds.crown is None else seeds.crown
        parts.append(replace(seeds, identifiers=identifiers, species=to_all[seeds.species], crown=crown))
    # Do not copy millions of frames where there is nothing to join.
    return parts[0] if len(parts) == 1 else Seeds.concatenate(parts)


def _unknown(odd: list[tuple[str, str]]) -> str:
    """What is said of objects with the species that nobody has, of the first of these."""
    species = odd[0][1]
    names = listed([name for name, other in odd if other == species])
    if species.startswith(PREFIX):
        gone = "the object or collection that was their species is not used as one; click Use as Species on it again"
        if find_asset(None, species) is not None:
            gone = f'"{name_of(species)}", which was used as their species, was deleted; undo'
        return f"{names}: {gone}, or choose another species in the TetFlora tab of the sidebar"
    more, file = len({other for _, other in odd}) - 1, f"{species}.json" if species else "its file"
    told = f'{names}: unknown species "{species}"{f" and {more} more" if more else ""}; choose another'
    return f"{told} in the TetFlora tab of the sidebar, or add {file} with Load Species"
