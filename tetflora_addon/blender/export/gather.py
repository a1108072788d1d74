# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The plants of a scene as they are exported: read, given to variants, and these made in their levels."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...arrays import Floats, Integers, Integers32, quaternions
from ...camera.camera import origin_near
from ...compiled.flora import Flora
from ...export.forest import ForestPart, PointAttributes, Variant, identifiers
from ...export.levels import PlantLevel, levels_of
from ...export.variants import choose_variants
from ...growth.seeds import Seeds
from ...jobs import Job, Progress
from ...species.species import Species
from ..attributes import world_matrix
from ..job.contents import compile_for, in_year
from ..runtime import JobData
from ..scene.ages import classed
from ..scene.field_sizes import FIT, NUMBERS, OFFSET
from ..scene.fields import stored_points
from ..scene.own_ages import AGE, Sizes
from ..scene.plants import Source, merged, read_sources
from ..scene.skeletons import skeleton_object_of, species_of
from ..worker import call_in_thread
from .usd import halves


@dataclass(frozen=True)
class PlantKind:
    """Plants that are compiled as one species."""

    name: str  # as of `skeletons.kind_of`
    flora: Flora
    plants: Integers  # (m,): of all that are exported
    variants: int  # that it gets at most

    @property
    def species(self) -> Species:
        """The species, as plants of the kind are."""
        return self.flora.species[0]


@dataclass(frozen=True)
class Shown:
    """Variants, and what shows each of all plants (n)."""

    variants: tuple[Variant, ...]
    variant: Integers32  # (n,)
    scale: Floats  # (n,)


def kinds_of(data: JobData, seeds: Seeds, most: int) -> Job[list[PlantKind]]:
    """Kinds of plants, each compiled, and how many variants each gets of those of its species."""
    scene, found = data.scene, []
    counts = np.bincount(seeds.species, minlength=len(seeds.identifiers))
    species = [species_of(kind) for kind in seeds.identifiers]
    of_species = {one: sum(counts[n] for n, other in enumerate(species) if other == one) for one in species}
    for number in np.flatnonzero(counts).tolist():
        kind = seeds.identifiers[number]
        yield Progress(0.0, f"compiling {species[number]}")
        flora = in_year(scene, compile_for((kind,), scene, data.depsgraph))
        share = max(1, round(most * counts[number] / of_species[species[number]]))
        found.append(PlantKind(kind, flora, np.flatnonzero(seeds.species == number), share))
    return found


def variants_of(
    seeds: Seeds,
    kinds: Sequence[PlantKind],
    number_of_levels: int,
    most_polygons: int,
) -> Job[Shown]:
    """Choose variants of all kinds, and make these."""
    variant, scale = np.zeros(len(seeds), np.int32), np.ones(len(seeds))
    made: list[tuple[str, tuple[PlantLevel, ...], PlantKind]] = []
    for number, kind in enumerate(kinds):
        progress = Progress(number / len(kinds), f"variants of {kind.species.name}")
        yield progress
        own = replace(seeds.take(kind.plants), identifiers=(kind.name,), species=np.zeros(len(kind.plants), np.int32))
        chosen = yield from call_in_thread(progress, choose_variants, kind.flora, own, kind.variants)
        variant[kind.plants], scale[kind.plants] = len(made) + chosen.variant, chosen.scale
        like: tuple[PlantLevel, ...] = ()
        for count, plant in enumerate(chosen.plants.tolist()):
            share = (number + count / len(chosen.plants)) / len(kinds)
            progress = Progress(share, f"{kind.species.name}, variant {count + 1} of {len(chosen.plants)}")
            one = own.take(slice(plant, plant + 1))
            like = yield from call_in_thread(progress, levels_of, kind.flora, one, number_of_levels, like)
            made.append((f"{species_of(kind.name)}_{count + 1}", like, kind))
    names = identifiers([name for name, *_ in made])
    variants = []
    for name, (_, own, kind) in zip(names, made, strict=True):
        small = tuple(level for level in own if level.polygons <= most_polygons) if most_polygons else own
        variants.append(Variant(name, kind.species.identifier, small or own[-1:], _height(own), {}))
    return Shown(tuple(variants), variant, scale)


def _height(levels: Sequence[PlantLevel]) -> float:
    return max(float(mesh.positions[:, 2].max()) for _, mesh in levels[0].parts)


def read_plants(data: JobData) -> tuple[list[Source], Seeds]:
    """Plants object by object, and all of them, one after another, with their kinds."""
    sources = read_sources(data.scene, data.depsgraph)
    aged = classed(data.scene, [source.part for source in sources])
    return sources, merged([seeds for _, seeds in aged])


def forest_parts(data: JobData, sources: Sequence[Source], seeds: Seeds, shown: Shown) -> Job[tuple[ForestPart, ...]]:
    """Plants of each object as they are written."""
    made, first = [], 0
    for number, source in enumerate(sources):
        yield Progress(number / len(sources), f'plants of "{source.part[0]}"')
        some = slice(first, first + len(source.part[1]))
        made.append(
            _forest_part(data.depsgraph, source, seeds.take(some), shown.variant[some], shown.scale[some], shown)
        )
        first = some.stop
    return tuple(made)


def _forest_part(
    depsgraph: bpy.types.Depsgraph, source: Source, grown: Seeds, variant: Integers32, scale: Floats, shown: Shown
) -> ForestPart:
    name, seeds, ages, sizes = source.part
    obj = source.field
    stored = {} if obj is None else stored_points(obj, depsgraph)
    whole = stored and len(stored["position"][1]) == len(seeds)
    matrix = world_matrix(obj, depsgraph).astype(np.float64) if whole else np.eye(4)
    origin = matrix[:3, 3] if whole else origin_near(seeds.position)
    if not whole:
        matrix[:3, 3] = origin
    position = (seeds.position - origin).astype(np.float32)
    rotation = quaternions(seeds.frame).astype(np.float32)
    heights = np.array([one.height for one in shown.variants])[variant] * scale
    return ForestPart(
        name,
        tuple((species_of(kind), getattr(skeleton_object_of(kind), "name_full", "")) for kind in seeds.identifiers),
        origin,
        position,
        rotation,
        scale.astype(np.float32),
        variant,
        seeds.species.astype(np.int32),
        seeds.seed,
        np.zeros(len(seeds), np.float32) if ages is None else ages.astype(np.float32),
        heights.astype(np.float32),
        stored if whole else _points(position, rotation, seeds, ages, sizes),
        matrix,
        _settings(obj, matrix) if whole else {},
    )


def _settings(field: bpy.types.Object, matrix: Floats) -> dict[str, float | int | str | list[float]]:
    """What plants of a field follow from beside its points: its age and seed, and the transform as it is stored.

    Blender cannot find that again from a matrix without an error in the last digit.
    """
    found = {"age": field.tetflora.age, "seed": field.tetflora.seed}
    if not np.array_equal(np.array(field.matrix_basis), matrix):  # it has a parent or constraints
        return found
    mode = field.rotation_mode
    name = {'QUATERNION': "rotation_quaternion", 'AXIS_ANGLE': "rotation_axis_angle"}.get(mode, "rotation_euler")
    return found | {"rotation_mode": mode} | {key: list(getattr(field, key)) for key in ("location", name, "scale")}


def _points(
    position: Floats, rotation: Floats, seeds: Seeds, ages: Floats | None, sizes: Sizes | None
) -> PointAttributes:
    """Attributes of a field with some plants, in single precision."""
    small = np.array_equal(seeds.seed, seeds.seed.astype(np.int32))
    found = {
        "position": ('FLOAT_VECTOR', position),
        "rotation": ('QUATERNION', rotation),
        "scale": ('FLOAT', seeds.scale.astype(np.float32)),
        "species": ('INT', seeds.species.astype(np.int32)),
        "seed": ('INT', seeds.seed.astype(np.int32)) if small else ('INT32_2D', halves(seeds.seed)),
    }
    if ages is not None:
        found[AGE] = 'FLOAT', ages.astype(np.float32)
    if sizes is not None:
        columns = (sizes.height, sizes.diameter, sizes.width, sizes.base, sizes.dead)
        found |= {key: ('FLOAT', of.astype(np.float32)) for key, of in zip(NUMBERS, columns, strict=True)}
        for key, of in ((OFFSET, sizes.offset), (FIT, sizes.fit)):
            found[key] = 'FLOAT_VECTOR', np.pad(of, ((0, 0), (0, 1))).astype(np.float32)
    return found
