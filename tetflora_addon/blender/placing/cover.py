# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground Cover: a population on the ground of another, of what grows in its light and shade and falls from its crowns.

What falls from a species is a species of its own, kept in the file as one that the artist edited. The population of
the cover is an ordinary one: it can be changed, updated, frozen and removed. Leaves that fall in autumn are another,
so that what grows there, and the litter of years before, keep their places.
"""

from collections.abc import Iterable, Mapping
from contextlib import closing
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from bpy.types import Object, PropertyGroup, Scene

from ...arrays import Floats
from ...errors import SceneError, TetFloraError
from ...files import is_identifier
from ...growth.hashing import child_key, key_of_seed, uniform
from ...jobs import Job, Progress, mapped, part_of
from ...planting.cover import FULL, Canopy, Floor, Habitat, Stratum, covered, tinted
from ...species.litter import FALLEN, KIND, leaves_page, shed_share
from ..materials.snow import add_snow
from ..materials.soil import SHADED, lay_soil
from ..runtime import JobData, job
from ..scene.crowns import crown_for
from ..settings import with_identity
from ..species.edits import catalog, species_data, species_for, store_species
from ..worker import steps_in_thread
from . import distances, populations, rules, terrain
from .canopy import Above, canopy_steps, floor_steps, is_cover, shedder_of

NAME, FALLEN_LEAVES = "Ground cover", "Fallen leaves"
_SQUARE = 0.976  # mean square of the scales of a cover's plants
#: What grows: species, habitat, plants on a square meter of ground that suits.
GROWN = (
    ("sward", 'LIGHT', 11.0),
    ("wood_grass", 'LIGHT', 1.5),
    ("grass", 'LIGHT', 0.3),
    ("flower", 'LIGHT', 0.15),
    ("fern", 'HALF_SHADE', 0.12),
    ("wood_sorrel", 'HALF_SHADE', 3.0),
    ("moss", 'SHADE', 4.0),
)
#: What falls: kind, habitat, pieces on a square meter of ground that is wholly covered, of how many species.
DROPPED = (("litter", 'LITTER', 12.0, 4), ("branch", 'DEAD_WOOD', 0.35, 2), ("log", 'DEAD_WOOD', 0.012, 1))
#: Plants that a cover has at most by itself; on larger ground they stand farther apart.
MOST = 1_000_000
#: Lower plants shed nothing that would be seen, meters.
_SHEDS = 1.2
#: What is covered where the plants above are of no population.
ANYBODY = "plants"
#: Fraction of the work after which plants are placed, and what is done before.
_PLANTING, _UNDER = 0.7, "Light and litter under the plants"
_PAGES = {**FALLEN, KIND: leaves_page}
#: Soil without anything on it, and dead grass between what grows in the light, in its shade; linear RGB.
HUMUS, THATCH = np.array([0.036, 0.025, 0.016]), np.array([0.108, 0.084, 0.044])


@dataclass(frozen=True)
class Ingredient:
    """One species of a cover."""

    species: str
    habitat: str
    number: float
    shed_by: str = ""


@dataclass(frozen=True)
class CoverResult:
    """What covering made."""

    placed: populations.PlacedPlants
    bare: list[str]  # grounds that keep a material of the artist's


def covered_population(scene: Scene) -> PropertyGroup | None:
    """The population whose ground the button covers: the active one, or the one under which the active one grows."""
    active = rules.active_population(scene)
    if active is None or not active.covers:
        return active
    return with_identity(scene.tetflora.layers, active.covers) or active


@job("Covering the ground")
def cover_steps(
    data: JobData,
    population: PropertyGroup,
    soil: bool = True,
    grounds: Iterable[Object] | None = None,
    masks: Mapping[str, Any] = MappingProxyType({}),
) -> Job[CoverResult]:
    """Cover the ground of a population.

    Replaces what an earlier run made for the same population; settings changed since stay. Closing it changes nothing.

    Parameters
    ----------
    population : TetFloraLayer
        A population, or the settings for new ones.
    soil : bool
        Give the ground a material.
    grounds : iterable of bpy.types.Object, optional
        Other ground than the population's.
    masks : mapping, optional
        Other values of some of `terrain.MASKS` than the population's, for a cover that is new.

    Raises
    ------
    SceneError
        It has no ground or no plants above it, or the cover is frozen; or something was deleted meanwhile.
    """
    scene, depsgraph, uid = data.scene, data.depsgraph, population.uid or ANYBODY
    grounds, (canopy, above) = yield from _begun(data, population, grounds)
    population = _again(data, population, uid)
    all_masks = {name: getattr(population, name) for name in terrain.MASKS} | dict(masks)
    ground = terrain.read_ground(grounds, depsgraph, **all_masks)
    if not len(canopy):
        raise SceneError(f'"{population.name}" has no plants whose ground could be covered; click Update first')
    yield (progress := Progress(0.05, _UNDER))
    mapping = floor_steps(canopy, ground.triangles, len(above))
    told = mapped(mapping, lambda done: Progress(0.05 + (_PLANTING - 0.05) * done, _UNDER))
    floor = yield from steps_in_thread(told, progress)
    yield Progress(_PLANTING, "Planting")
    population = _again(data, population, uid)
    with populations.restored(scene):
        parts = _parts(scene, canopy, above)
        cover = cover_of(scene, uid) or _add_cover(scene, population, grounds, masks)
        # What falls from crowns lies under these only, and takes no plants from the rest of the ground.
        suited = [floor.map_of(Habitat[part.habitat], shedder_of(part, above)).mean() for part in parts]
        area = ground.map_area * float(np.average(suited, weights=[part.number for part in parts]))
        _mix(cover, parts, area)
        with closing(populations.make_plants_steps(scene, depsgraph, cover)) as steps:
            placed = yield from part_of(steps, _PLANTING, 1.0)
        bare = _lay_soil(scene, cover_of(scene, uid), grounds, floor, above, area) if soil else []
    return CoverResult(placed, bare)


def _begun(
    data: JobData, population: PropertyGroup, grounds: Iterable[Object] | None = None, fallen: bool = False
) -> Job[tuple[list[Object], Above]]:
    """See whether a population can have a cover, and measure what stands above; with its ground, or that given."""
    scene = data.scene
    yield (progress := Progress(0.0, _UNDER))
    cover = cover_of(scene, population.uid or ANYBODY, fallen)
    if cover is not None:
        populations.refuse_frozen(cover)
    grounds = rules.checked_grounds(scene, population) if grounds is None else list(grounds)
    data.add_objects(grounds)
    return grounds, (yield from canopy_steps(progress, scene, data.depsgraph))


def _again(data: JobData, population: PropertyGroup, uid: str) -> PropertyGroup:
    """A population, fetched again after others may have been added; settings for new ones stay where they are."""
    return population if uid == ANYBODY else populations.still_there(data, uid)


def cover_of(scene: Scene, uid: str, fallen: bool = False) -> PropertyGroup | None:
    """What covers the ground of a population, or the leaves that fall on it in autumn."""
    covers = (p for p in scene.tetflora.layers if p.covers == uid or (p.uid == uid and is_cover(p)))
    return next((p for p in covers if (bool(p.mix) and all(e.habitat == 'FALLEN' for e in p.mix)) == fallen), None)


def _add_cover(
    scene: Scene, population: PropertyGroup, grounds: list[Object], masks: Mapping[str, Any], name: str = NAME
) -> PropertyGroup:
    """A population for the cover, on the same ground and within the same limits; the covered one stays active."""
    index, uid = scene.tetflora.layers_index, population.uid
    cover = populations.add_population(scene, grounds, name=name)
    # Fetched again: adding to a list moves what is in it.
    source = with_identity(scene.tetflora.layers, uid)
    if source is not None:
        rules.copy_settings(source, cover)
        scene.tetflora.layers_index = index
    for name, value in masks.items():
        setattr(cover, name, value)
    cover.covers, cover.as_field, cover.by_density, cover.density = uid or ANYBODY, 'FIELD', True, 0.0
    cover.min_distance, cover.distance_from = 0.0, 'OWN'
    cover.clumping = cover.edge_falloff = 0.0
    cover.scale_min, cover.scale_max, cover.scale_at_top, cover.tilt = 0.7, 1.25, 1.0, 1.0
    cover.seed = int(uniform(child_key(key_of_seed(cover.seed), 2), 0) * 2**31)
    cover.mix.clear()
    return cover


def _parts(scene: Scene, canopy: Canopy, above: tuple[str, ...]) -> list[Ingredient]:
    """Species of a cover; those of what falls are made where the file does not have them."""
    known = catalog()
    parts = [Ingredient(*one) for one in GROWN if one[0] in known]
    order = _shedders(canopy, above)
    for kind, habitat, number, most in DROPPED:
        dropped = [(name, fallen) for name in order if (fallen := fallen_from(scene, name, kind))][:most]
        parts += [Ingredient(fallen, habitat, number, name) for name, fallen in dropped]
    return parts


def _shedders(canopy: Canopy, above: tuple[str, ...]) -> list[str]:
    """Species from which anything falls that is seen; those that shed most come first."""
    leaves = np.bincount(canopy.species, canopy.area + 1e-6 * canopy.top, minlength=len(above))
    tall = np.zeros(len(above))
    np.maximum.at(tall, canopy.species, canopy.top)
    return [above[i] for i in np.argsort(-leaves, kind="stable") if tall[i] >= _SHEDS]


def fallen_from(scene: Scene, identifier: str, kind: str) -> str:
    """Identifier of what falls from a species, made if the file and the catalog do not have it; empty if nothing falls.

    One that is there stays as it is, because it may be the artist's own.
    """
    name = f"{identifier}_{kind}"
    if name in catalog():
        return name
    try:
        page = _PAGES[kind](species_for(scene, identifier), species_data(scene, identifier))
    except TetFloraError:  # broken, or not there: Refine says so
        return ""
    if page is None or not is_identifier(name):
        return ""
    store_species(scene, name, page)
    return name


def _mix(cover: PropertyGroup, parts: list[Ingredient], area: float) -> None:
    """Add what the mixture of a cover lacks; what it has stays as the artist left it."""
    present = {entry.species for entry in cover.mix}
    before = sum(entry.weight for entry in cover.mix)
    for part in parts:
        if part.species not in present:
            entry = cover.mix.add()
            entry.species, entry.weight = part.species, part.number
            entry.habitat, entry.shed_by = part.habitat, part.shed_by
    whole = sum(entry.weight for entry in cover.mix)
    if before and cover.density:
        cover.density *= whole / before
    else:
        cover.density = distances.HECTARE * min(whole, MOST / max(area, 1e-9))


def _lay_soil(
    scene: Scene, cover: PropertyGroup, grounds: list[Object], floor: Floor, above: tuple[str, ...], area: float
) -> list[str]:
    """Give the ground a soil in the colors of its cover; names of the grounds that keep a material of the artist's."""
    lying, growing = _strata(scene, cover, floor, above, area)
    sheet, cells = floor.sheet, len(floor.light)
    shape = sheet.rows, sheet.columns
    green = covered(growing, cells)
    areas = np.array([one.number * one.area * one.suits.mean() for one in growing] or [0.0])
    colors = np.stack([one.color for one in growing] or [HUMUS])
    # Seen from above, a meadow is darker than its blades, which shade each other.
    tint = SHADED * (areas @ colors / max(areas.sum(), 1e-12))
    open_ = floor.map_of(Habitat.LIGHT, None)[:, None]
    earth = tinted(lying, (1.0 - open_) * HUMUS + open_ * THATCH, cells).reshape(*shape, 3)
    return lay_soil(f"{cover.name} soil", grounds, earth, green.reshape(shape), tint, sheet.low, sheet.cell)


def _strata(
    scene: Scene, cover: PropertyGroup, floor: Floor, above: tuple[str, ...], area: float
) -> tuple[list[Stratum], list[Stratum]]:
    """What lies on the ground, and what grows on it: in numbers as if large ground had room for all that it should."""
    weights = sum(entry.weight for entry in cover.mix) or 1.0
    thin = cover.density / distances.HECTARE / weights
    thin = max(thin, min(thin * max(weights * area / MOST, 1.0), 1.0))
    lying: list[Stratum] = []
    growing: list[Stratum] = []
    for entry in cover.mix:
        habitat, crown = Habitat[entry.habitat], crown_for(scene, entry.species)
        suits: Floats = floor.map_of(habitat, shedder_of(entry, above))
        patch = 1.0 - 0.585 * habitat.value[1]  # of the ground is within patches, on average
        one = Stratum(patch * suits, thin * entry.weight, crown.seen, np.array(crown.color))
        (lying if habitat.falls else growing).append(one)
    return lying, growing


@job("Strewing leaves")
def strew_steps(data: JobData, population: PropertyGroup) -> Job[populations.PlacedPlants | None]:
    """Strew the leaves that fall in autumn under a population; None where nothing above sheds its leaves.

    Replaces what an earlier run made for the same population; settings changed since stay. Closing it changes nothing.

    Raises
    ------
    SceneError
        It has no ground, or the leaves are frozen; or something was deleted meanwhile.
    """
    scene, depsgraph, uid = data.scene, data.depsgraph, population.uid or ANYBODY
    grounds, (canopy, above) = yield from _begun(data, population, fallen=True)
    population = _again(data, population, uid)
    with populations.restored(scene):
        # Fallen leaves of each species: as many patches as have the area of what falls.
        parts = []
        for name in _shedders(canopy, above):
            patch = fallen_from(scene, name, KIND)
            share = shed_share(species_for(scene, name)) if patch else 0.0
            area = crown_for(scene, patch).leaves if share > 0.0 else 0.0
            if area > 0.0:
                parts.append(Ingredient(patch, 'FALLEN', FULL * share / (area * _SQUARE), name))
        if not parts:
            return None
        cover = cover_of(scene, uid, fallen=True) or _add_cover(scene, population, grounds, {}, FALLEN_LEAVES)
        # Ground that is wholly suited, of all that falls on it.
        _mix(cover, parts, canopy.area.sum() / FULL / len(parts))
        with closing(populations.make_plants_steps(scene, depsgraph, cover)) as steps:
            return (yield from steps)


def cover_with_snow(scene: Scene, population: PropertyGroup) -> list[str]:
    """Put the snow of the scene on all materials of a population's ground; names of those that had none before.

    Raises
    ------
    SceneError
        The population has no ground, or the ground has no material of this file.
    """
    slots = [slot for obj in rules.grounds_of(scene, population) for slot in obj.material_slots]
    materials = dict.fromkeys(slot.material for slot in slots if slot.material is not None)
    local = [one for one in materials if one.library is None and one.override_library is None and one.node_tree]
    if not local:
        raise SceneError(f'The ground of "{population.name}" has no material in this file; give it one first')
    return [material.name for material in local if add_snow(material)]
