# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The plants of a scene as what stands over the ground, and the maps of light and litter under them.

Populations that cover the ground of others are left out: they stand under the crowns.
"""

from collections.abc import Callable, Generator
from dataclasses import fields
from hashlib import blake2b

import bpy
import numpy as np

from ...arrays import Floats
from ...compiled.recorded_sizes import sized
from ...growth.seeds import BASE, LEAVES, WIDTH
from ...jobs import Job, Progress
from ...planting.cover import Canopy, Floor, Habitat, Sheet, Suits, mapping
from ...species.kinds import species_of
from ..attributes import world_matrix
from ..scene.ages import crown_kinds, finder
from ..scene.crowns import crown_for, crown_steps
from ..scene.fields import fields_of, read_aged_field, stored_ages
from ..worker import call_in_thread, run_to_end

#: What stands over the ground, and the identifiers of its species.
Above = tuple[Canopy, tuple[str, ...]]
_kept: dict[str, Floor] = {}  # the last one, by content: settings change more often than the plants above


def is_cover(population: bpy.types.PropertyGroup) -> bool:
    """Whether a population grows under others: some of its species ask for light, shade or what falls."""
    return bool(population.covers) or any(entry.habitat != 'ANYWHERE' for entry in population.mix)


def not_of_covers(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Objects of a scene less those of populations that cover the ground."""
    covers = {p.uid for p in scene.tetflora.layers if is_cover(p)}
    return [o for o in scene.objects if o.tetflora.population not in covers] if covers else list(scene.objects)


def canopy_of(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Above:
    """What stands in a scene."""
    return run_to_end(canopy_steps(Progress(0.0, ""), scene, depsgraph))


def canopy_steps(progress: Progress, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Job[Above]:
    """The same as a job: plants are read at once, and measured in the background, as that may take seconds."""
    objects = not_of_covers(scene)
    single = [o for o in objects if o.tetflora.is_plant]
    places = np.array([np.array(o.matrix_world) for o in single], dtype=np.float64).reshape(-1, 4, 4)
    names = list(dict.fromkeys(o.tetflora.species for o in single))
    index = np.array([names.index(o.tetflora.species) for o in single], dtype=np.int32)
    scale = np.cbrt(np.abs(np.linalg.det(places[:, :3, :3])))
    parts = [(places[:, :3, 3], scale, None, *crown_kinds(scene, names, index, stored_ages(single)))]
    fields = [read_aged_field(o, depsgraph, world_matrix(o, depsgraph)[None]) for o in fields_of(objects)]
    find = finder(scene, (kind for seeds, *_ in fields for kind in seeds.identifiers), depsgraph)
    for read, ages in (yield from call_in_thread(progress, lambda: [sized(*one, find) for one in fields])):
        parts.append((read.position, read.scale, read.crown, *crown_kinds(scene, read.identifiers, read.species, ages)))
    yield from crown_steps(progress, scene, {kind for _, _, _, kinds, *_ in parts for kind in kinds})
    numbers: dict[str, int] = {}
    species, crowns = [], []
    for _, _, form, kinds, which, taller in parts:
        per_kind = [crown_for(scene, kind) for kind in kinds]
        known = np.array([(c.radius, c.base, c.height, c.leaves) for c in per_kind]).reshape(-1, 4)[which]
        crowns.append(_shaped(known, form) * taller[:, None] ** [1, 1, 1, 2])
        per_kind = [numbers.setdefault(species_of(kind), len(numbers)) for kind in kinds]
        species.append(np.array(per_kind, dtype=np.int32)[which])
    position, size = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
    radius, base, top, area = np.concatenate(crowns).T
    canopy = Canopy(position, radius * size, base * size, top * size, area * size**2, np.concatenate(species))
    return canopy, tuple(numbers)


def _shaped(crowns: Floats, form: Floats | None) -> Floats:
    """Radius, base, top and leaf area (n, 4) of crowns that have forms (n, 6) of their own."""
    if form is None:
        return crowns
    radius, base, top, area = crowns.T
    higher = np.maximum(base, form[:, BASE] * top)
    left = (top - higher) / np.maximum(top - base, 1e-9)
    return np.stack([radius * form[:, WIDTH], higher, top, area * form[:, WIDTH] * left * form[:, LEAVES]], axis=1)


def floor_steps(canopy: Canopy, triangles: Floats, kinds: int) -> Generator[float, object, Floor]:
    """Maps of the ground (t, 3, 3) under plants; those of the same ground and plants are made once."""
    sheet = Sheet.over(triangles.reshape(-1, 3))
    content = blake2b(repr((sheet, kinds)).encode(), digest_size=16)
    ordered = canopy.ordered()
    for column in fields(ordered):
        content.update(np.ascontiguousarray(getattr(ordered, column.name)).tobytes())
    key = content.hexdigest()
    if key not in _kept:
        floor = yield from mapping(sheet, ordered, kinds)
        _kept.clear()
        _kept[key] = floor
    return _kept[key]


def read_suits(
    population: bpy.types.PropertyGroup, triangles: Floats, species: tuple[str, ...], above: Above | None
) -> Callable[[], dict[int, Suits]]:
    """What finds, without Blender, how suitable the ground (t, 3, 3) is for those species that do not grow anywhere."""
    wanted = {e.species: e for e in population.mix if e.habitat != 'ANYWHERE' and e.species in species}
    if above is None or not wanted:
        return dict
    canopy, names = above
    entries = [(number, wanted[name]) for number, name in enumerate(species) if name in wanted]
    asked = {n: (Habitat[e.habitat], shedder_of(e, names), population.seed + n) for n, e in entries}

    def suits() -> dict[int, Suits]:
        floor = run_to_end(floor_steps(canopy, triangles, len(names)))
        return {number: floor.suits(*one) for number, one in asked.items()}

    return suits


def shedder_of(entry: bpy.types.PropertyGroup, above: tuple[str, ...]) -> int | None:
    """Index of the species that sheds an entry's plants: None for any, -1 where no plant of it stands."""
    if not entry.shed_by:
        return None
    return above.index(entry.shed_by) if entry.shed_by in above else -1
