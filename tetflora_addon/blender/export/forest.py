# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Export Forest as a job: the plants of a scene to a file of another program, whole or not at all.

Plants are read, given to variants, and these made in their levels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from bpy.types import Depsgraph, Object

from ...arrays import Floats, Integers, Integers32, quaternions
from ...camera.camera import origin_near
from ...compiled.flora import Flora
from ...compiled.recorded_sizes import Sizes
from ...errors import TetFloraError
from ...export.forest import Forest, ForestPart, PointAttributes, Variant, identifiers, written_whole
from ...export.gltf import write_gltf
from ...export.levels import PlantLevel, levels_of
from ...export.obj import write_obj
from ...export.variants import choose_variants
from ...growth.seeds import Seeds
from ...jobs import Job, Progress, part_of
from ...species.kinds import species_of
from ...species.species import Species
from ..attributes import world_matrix
from ..job.contents import check_fits, compile_for, in_year, memory_left
from ..runtime import JobData, job
from ..scene.ages import classed
from ..scene.fields import AGE, SIZE_ATTRIBUTES, size_columns, stored_points
from ..scene.plants import Source, merged, read_sources
from ..scene.skeletons import skeleton_object_of
from ..worker import call_in_thread, steps_in_thread
from .surfaces import with_surfaces
from .usd import ENDINGS, library, stored_seeds, write_usd


@dataclass(frozen=True)
class PlantKind:
    """Plants that are compiled as one species."""

    name: str  # as of `species.kinds`
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
    scene, kinds = data.scene, []
    counts = np.bincount(seeds.species, minlength=len(seeds.identifiers))
    species = [species_of(kind) for kind in seeds.identifiers]
    of_species = {one: sum(counts[n] for n, other in enumerate(species) if other == one) for one in species}
    for number in np.flatnonzero(counts).tolist():
        kind = seeds.identifiers[number]
        yield Progress(0.0, f"compiling {species[number]}")
        flora = in_year(scene, compile_for((kind,), scene, data.depsgraph))
        share = max(1, round(most * counts[number] / of_species[species[number]]))
        kinds.append(PlantKind(kind, flora, np.flatnonzero(seeds.species == number), share))
    return kinds


def variants_of(
    seeds: Seeds, kinds: Sequence[PlantKind], number_of_levels: int, most_polygons: int, left: float = np.inf
) -> Job[Shown]:
    """Choose variants of all kinds, and make these.

    Parameters
    ----------
    left : float
        Bytes that they may take.

    Raises
    ------
    SceneError
        They would not fit; the message says what to lower.
    """
    variant, scale, faces = np.zeros(len(seeds), np.int32), np.ones(len(seeds)), np.zeros(2)
    drafts: list[tuple[str, tuple[PlantLevel, ...], float, PlantKind]] = []
    for number, kind in enumerate(kinds):
        progress = Progress(number / len(kinds), f"variants of {kind.species.name}")
        yield progress
        alike = replace(seeds.take(kind.plants), identifiers=(kind.name,), species=np.zeros(len(kind.plants), np.int32))
        chosen = yield from call_in_thread(progress, choose_variants, kind.flora, alike, kind.variants)
        variant[kind.plants], scale[kind.plants] = len(drafts) + chosen.variant, chosen.scale
        like: tuple[PlantLevel, ...] = ()
        for count, plant in enumerate(chosen.plants.tolist()):
            share = (number + count / len(chosen.plants)) / len(kinds)
            progress = Progress(share, f"{kind.species.name}, variant {count + 1} of {len(chosen.plants)}")
            one = alike.take(slice(plant, plant + 1))
            like = yield from call_in_thread(progress, levels_of, kind.flora, one, number_of_levels, like)
            small = tuple(level for level in like if level.polygons <= most_polygons) if most_polygons else like
            high = max(float(mesh.positions[:, 2].max()) for _, mesh in like[0].parts)
            drafts.append((f"{species_of(kind.name)}_{count + 1}", small or like[-1:], high, kind))
            more = _faces(drafts[-1][1])  # and as many for each of those to come
            expected = faces + more * (len(chosen.plants) - count)
            check_fits(f"Variants of {kind.species.name}", expected, left, "or lower Variants or Max Polygons")
            faces += more
    variants = [
        Variant(name, kind.species.identifier, levels, height, {})
        for name, (_, levels, height, kind) in zip(identifiers([name for name, *_ in drafts]), drafts, strict=True)
    ]
    return Shown(tuple(variants), variant, scale)


def _faces(levels: Sequence[PlantLevel]) -> Floats:
    """Polygons of levels, and the triangles (2,) that they consist of."""
    meshes = [mesh for level in levels for _, mesh in level.parts]
    polygons = sum(mesh.polygons for mesh in meshes)
    return np.array([polygons, sum(len(mesh.corner_verts) for mesh in meshes) - 2.0 * polygons])


def forest_parts(data: JobData, sources: Sequence[Source], shown: Shown) -> Job[tuple[ForestPart, ...]]:
    """Plants of each object as they are written."""
    parts, first = [], 0
    for number, source in enumerate(sources):
        yield Progress(number / len(sources), f'plants of "{source.part[0]}"')
        span = slice(first, first + len(source.part[1]))
        parts.append(_forest_part(data.depsgraph, source, shown.variant[span], shown.scale[span], shown))
        first = span.stop
    return tuple(parts)


def _forest_part(depsgraph: Depsgraph, source: Source, variant: Integers32, scale: Floats, shown: Shown) -> ForestPart:
    name, seeds, ages, sizes = source.part
    obj = source.field
    stored = {} if obj is None else stored_points(obj, depsgraph)
    whole = stored and len(stored["position"][1]) == len(seeds)
    matrix = world_matrix(obj, depsgraph).astype(np.float64) if whole else np.eye(4)
    origin = matrix[:3, 3] if whole else origin_near(seeds.position)
    if not whole:
        matrix[:3, 3] = origin
    kinds = [(species_of(kind), getattr(skeleton_object_of(kind), "name_full", "")) for kind in seeds.identifiers]
    place = (seeds.position - origin).astype(np.float32), quaternions(seeds.frame).astype(np.float32)
    identity = variant, seeds.species.astype(np.int32), seeds.seed
    years = np.zeros(len(seeds), np.float32) if ages is None else ages.astype(np.float32)
    heights = (np.array([one.height for one in shown.variants])[variant] * scale).astype(np.float32)
    of_field = (stored, matrix, _settings(obj, matrix)) if whole else (_points(*place, seeds, ages, sizes), matrix, {})
    columns = *place, scale.astype(np.float32), *identity, years, heights
    return ForestPart(name, tuple(kinds), origin, *columns, *of_field)


def _settings(field: Object, matrix: Floats) -> dict[str, float | int | str | list[float]]:
    """What plants of a field follow from beside its points: its age and seed, and the transform as it is stored.

    Blender cannot find that again from a matrix without an error in the last digit.
    """
    settings = {"age": field.tetflora.age, "seed": field.tetflora.seed}
    if not np.array_equal(np.array(field.matrix_basis), matrix):  # it has a parent or constraints
        return settings
    mode = field.rotation_mode
    name = {'QUATERNION': "rotation_quaternion", 'AXIS_ANGLE': "rotation_axis_angle"}.get(mode, "rotation_euler")
    return settings | {"rotation_mode": mode} | {key: list(getattr(field, key)) for key in ("location", name, "scale")}


def _points(place: Floats, rotation: Floats, seeds: Seeds, ages: Floats | None, sizes: Sizes | None) -> PointAttributes:
    """Attributes of a field with some plants, in single precision."""
    attributes = {"position": ('FLOAT_VECTOR', place), "rotation": ('QUATERNION', rotation)}
    attributes["scale"] = 'FLOAT', seeds.scale.astype(np.float32)
    attributes |= {"species": ('INT', seeds.species.astype(np.int32)), "seed": stored_seeds(seeds.seed)}
    if ages is not None:
        attributes[AGE] = 'FLOAT', ages.astype(np.float32)
    if sizes is not None:
        columns = size_columns(sizes).items()
        attributes |= {name: (SIZE_ATTRIBUTES[name], values.astype(np.float32)) for name, values in columns}
    return attributes


#: Most variants of a species, and levels of detail of one.
MOST_VARIANTS, LEVELS = 1000, 6
#: What writes a file, by its ending; the first of each format is its own.
WRITERS = {**dict.fromkeys(ENDINGS, write_usd), ".glb": write_gltf, ".obj": write_obj}
#: Formats as choices: ending, name, and what they are for.
FORMATS = (
    (".usdc", "USD", "Houdini, Omniverse, Unreal, and back to Blender"),
    (".glb", "glTF", "Godot, Unity and the web"),
    (".obj", "OBJ", "Single plants for any program, and a table of their places"),
)


@dataclass(frozen=True)
class ExportOrder:
    """What is exported, and how."""

    path: Path
    variants: int = 8  # of each species
    levels: int = 0  # of detail, with the full plant; 0 for as many as suit each species
    polygons: int = 0  # that a level has at most; finer ones are left out. 0 for no limit
    bake: bool = True  # veins, bark and relief; otherwise textures have colors and outlines only


@dataclass(frozen=True)
class Exported:
    """What was written."""

    path: Path
    plants: int
    variants: int
    levels: tuple[dict, ...]  # figures of each level of each variant
    megabytes: float
    problems: tuple[str, ...]  # what of the artist's materials is not as it was


@job("Export Forest")
def export_steps(data: JobData, order: ExportOrder) -> Job[Exported]:
    """Write all plants of the scene that render; yields progress. Closing the steps early leaves no file.

    Raises
    ------
    TetFloraError
        There are no plants, or something cannot be read or written.
    """
    if (writer := WRITERS.get(order.path.suffix.lower())) is None:
        raise TetFloraError(f'"{order.path.name}": choose a name that ends in {", ".join(WRITERS)}')
    if writer is write_usd:
        library()  # or it would say after minutes that there is none
    with written_whole(order.path) as folder:
        yield Progress(0.0, "reading plants")
        sources = read_sources(data.scene, data.depsgraph)
        seeds = merged([seeds for _, seeds in classed(data.scene, [one.part for one in sources], data.depsgraph)])
        kinds = yield from part_of(kinds_of(data, seeds, order.variants), 0.05, 0.15)
        left = memory_left(data.scene)
        shown = yield from part_of(variants_of(seeds, kinds, order.levels, order.polygons, left), 0.15, 0.65)
        textures = f"{identifiers([order.path.stem])[0]}_textures"
        given = data.scene, shown.variants, folder, textures, order.bake
        variants = yield from part_of(with_surfaces(*given), 0.65, 0.75)
        data.check()
        parts = yield from part_of(forest_parts(data, sources, shown), 0.75, 0.8)
        forest = Forest(variants, parts)
        progress = Progress(0.8, f"writing {order.path.name}")
        steps = (Progress(0.8 + 0.2 * part, progress.message) for part in writer(folder / order.path.name, forest))
        yield from steps_in_thread(steps, progress)
        size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    problems = tuple(dict.fromkeys(problem for surface in forest.surfaces for problem in surface.problems))
    return Exported(order.path, len(forest), len(forest.variants), _levels(forest), size / 1e6, problems)


def _levels(forest: Forest) -> tuple[dict, ...]:
    figures = []
    for variant in forest.variants:
        for number, level in enumerate(variant.levels):
            one = {"variant": variant.name, "level": number, "polygons": level.polygons}
            one |= {"distance": round(level.distance, 2), "screen_size": round(level.screen_size(variant.height), 4)}
            one |= {"cover_error": abs(level.cover), "color_error": level.color, "outline_px": level.outline}
            figures.append(one)
    return tuple(figures)
