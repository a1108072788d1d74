# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of trees from inventories, and from rasters of canopy height: each tree has the size that is recorded.

A dialog shows the columns of an inventory, with their titles and some values, and what they are taken for.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import tau
from pathlib import Path

import bpy
import numpy as np

from ...arrays import Floats, Floats32, Integers32
from ...compiled.flora import compile_species
from ...compiled.recorded_sizes import Sizes, fits_of
from ...compiled.sizes import crown_of
from ...errors import SceneError, SpeciesError
from ...geodata.canopy import checked_canopy, find_trees, heights_above, without_areas
from ...geodata.inventories import FIELDS, Inventory, preview, read_inventory
from ...geodata.projection import MapOrigin
from ...geodata.species_names import GENUS, KIN, KIND, best_of, name_counts, words_of
from ...growth.axes import profile
from ...growth.growth import trunks
from ...growth.hashing import child_key, key_of_seed, uniform
from ...growth.seeds import Seeds
from ...jobs import Job, Progress
from ...planting.places import Placement
from ...planting.rules import species_by_weight
from ...species.ages import ages_of
from ...species.species import Species
from ..attributes import write
from ..declare import HIDDEN, choice, string
from ..placing.plant_objects import add_field
from ..scene.fields import FIT, HEIGHT, NUMBERS, OFFSET, SIZE_ATTRIBUTES
from ..species.edits import catalog, grown, species_for
from ..worker import call_in_thread, steps_in_thread
from .origin import Import, Imported, Steps, importing
from .terrain import building_areas, heights_steps, read_raster

_UNITS = {"AUTO": "Automatic", "m": "Meters", "cm": "Centimeters", "mm": "Millimeters", "ft": "Feet", "in": "Inches"}


class TetFloraInventoryColumn(bpy.types.PropertyGroup):
    """A column, whose title is the name."""

    field: choice(
        "Meaning", "What the column holds", [(name.upper() or 'NONE', label, "") for name, label in FIELDS.items()]
    )
    unit: choice(
        "Unit",
        "Unit of its numbers, where neither they nor the title name one",
        [(unit, label, "") for unit, label in _UNITS.items()],
    )
    values: string("Values", **HIDDEN)


def show_columns(table: bpy.types.bpy_prop_collection, path: Path) -> None:
    """Fill a table with the columns of a file. Errors are those of `preview`."""
    for column in preview(path):
        row = table.add()
        row.name, row.field, row.values = column.title, column.field.upper() or 'NONE', ", ".join(column.values)


def chosen_columns(table: Iterable[TetFloraInventoryColumn]) -> str:
    """What was chosen for columns, as scripts write it."""
    chosen = {row.name: row.field.lower() if row.field != 'NONE' else "" for row in table}
    return json.dumps(chosen | {row.name: f"{chosen[row.name]} {row.unit}" for row in table if row.unit != 'AUTO'})


def columns_in(text: str) -> dict[str, str]:
    """What columns hold by their titles, from JSON.

    Raises
    ------
    SceneError
        It is none.
    """
    try:
        columns = json.loads(text or "{}")
    except (ValueError, RecursionError) as error:
        raise SceneError(f"Columns is not valid JSON: {error}") from None
    if not isinstance(columns, dict) or not all(isinstance(value, str) for value in columns.values()):
        raise SceneError('Columns is not a JSON object of texts, such as {"H": "height"}')
    return columns


_AGES, _BREAST, _PLANTS = 96, 1.3, 16
_TALLER = 1.6  # at most, than what the curves of a species come to
_SLENDER = 60.0  # height above breast height over the diameter there, of the thinnest trunks, at most a meter in all


@dataclass(frozen=True)
class Curves:
    """Sizes of a species by age, each (a,) float64, ascending; meters."""

    height: Floats
    diameter: Floats
    width: Floats


@lru_cache(maxsize=64)
def curves_of(species: Species) -> Curves:
    """Sizes of a species at ages from a seedling to the oldest in good health.

    Limbs grow as a power of the trunk's diameter, within limits that its height sets, as in `species.ages`.
    """
    ages, crown = ages_of(species), crown_of(species)
    years = np.geomspace(0.5, ages.full if ages.scaled else ages.decline * ages.lifespan, _AGES).tolist()
    height = np.array([ages.heights(year) for year in years])
    diameter = height if ages.scaled else np.array([ages.diameters(year) for year in years])
    width = height if ages.scaled else np.clip(diameter**ages.spread, 0.45 * height, 1.4 * height**0.8)
    rows = compile_species([species]).rows
    trunk = trunks(rows, Seeds.upright(_PLANTS))
    breast = np.minimum(_BREAST / trunk.length, 0.5)
    full = float(2.0 * (trunk.radius * profile(rows, trunk.row, trunk.key, breast)).mean())
    return Curves(crown.height * height, full * diameter, 2.0 * crown.radius * width)


def complete(
    sizes: dict[str, Floats32], kinds: Integers32, identifiers: list[str], find: Callable[[str], Species]
) -> tuple[Floats32, int]:
    """Heights (n,) with those that follow from the trunk, or else from the crown; and how many these are.

    Species that are assets, or cannot be found, have none.
    """
    height = sizes["height"].copy()
    for number, identifier in enumerate(identifiers):
        lacking = (kinds == number) & (height == 0.0)
        for name in ("diameter", "width"):
            known = sizes["diameter" if name == "diameter" else "crown_width"]
            trees = np.flatnonzero(lacking & (known > 0.0) & (height == 0.0))
            if not len(trees):
                continue
            try:
                curves = curves_of(find(identifier))
            except SpeciesError:
                break
            by = getattr(curves, name)
            log_height = np.interp(np.log(known[trees]), np.log(by), np.log(curves.height))
            height[trees] = np.exp(log_height) * np.minimum(np.clip(known[trees] / by[-1], 1.0, None) ** 0.5, _TALLER)
            if name == "diameter":  # it is measured at that height
                height[trees] = np.maximum(height[trees], _BREAST + np.minimum(_SLENDER * known[trees], 1.0))
    return height, int((height != sizes["height"]).sum())


#: What to do with species that nobody knows.
GENERIC, LEFT_OUT = 'GENERIC', 'LEAVE_OUT'
_GENERIC = "broadleaf_tree"


@importing
def inventory_steps(
    order: Import, unknown: str, units: str, skip: bool, columns: Mapping[str, str] | None = None
) -> Steps:
    """Make a field of the trees of a file; see `importing`.

    Parameters
    ----------
    unknown : str
        `GENERIC`, `LEFT_OUT`, or the identifier of a species for trees of species that nobody knows.
    units, skip, columns
        As of `read_inventory`.
    """
    progress = Progress(0.0, f"Reading {order.path.name}")
    yield progress
    inventory = yield from call_in_thread(progress, read_inventory, order.path, order.epsg, units, skip, columns)
    if (box := order.box(inventory.points, inventory.system)) is not None:
        inside = box.holds(inventory.points)
        if not inside.any():
            raise order.nothing_left()
        sizes = {name: values[inside] for name, values in inventory.sizes.items()}
        inventory = replace(inventory, name=inventory.name[inside], points=inventory.points[inside], sizes=sizes)
        inventory = replace(inventory, notes=[*inventory.notes, f"{(~inside).sum():,} beyond the Crop"])
    place = order.origin(inventory.points, inventory.system)
    flat = order.local(place, inventory.points, inventory.system)
    identifiers, kinds, kin, others = _species(inventory, unknown)
    kept = np.flatnonzero(kinds >= 0)
    if not len(kept):
        raise SceneError(f"{order.what}none of its trees is of a known species; choose what stands for unknown ones")
    kinds, sizes = kinds[kept], {name: values[kept] for name, values in inventory.sizes.items()}
    yield Progress(0.5, "Completing sizes")
    sizes["height"], completed = complete(sizes, kinds, identifiers, lambda name: species_for(order.scene, name))
    imported = yield from _plant(order, place, flat[kept], kinds, identifiers, sizes)
    left = " and left out" * (len(kept) < len(flat))
    imported.told[1:1] = [
        *[f"{others.total():,} of unknown species{left}: {name_counts(others, 25)}"] * bool(others),
        *[f"rows without a tree left out: {name_counts(inventory.left_out)}"] * bool(inventory.left_out),
        *[f"heights of {completed:,} follow from trunk or crown"] * bool(completed),
        *[f"{kin.total():,} stand as their nearest kin: {name_counts(kin)}"] * bool(kin),
    ]
    imported.told += [*inventory.notes, f"coordinates: {inventory.system.name}"]
    if number := inventory.skipped:
        imported.told.append(f"{number:,} broken row{'s' * (number > 1)} skipped, the first: {inventory.first}")
    imported.warning = bool(others or number)
    return imported


def _species(inventory: Inventory, unknown: str) -> tuple[list[str], Integers32, Counter, Counter]:
    """Species of the catalog, and the index (n,) of each tree's, -1 for those to leave out; and names that stand for
    others, with how many trees have them: of other species, and of no known one.
    """
    kin, others = Counter(), Counter()
    known, counts = catalog(), np.bincount(inventory.name, minlength=len(inventory.names))
    chosen: list[str] = []
    for names, count in zip(inventory.names, counts.tolist(), strict=True):
        if not count:  # of rows that were left out
            chosen.append("")
            continue
        match, name = best_of(names, known)
        if match is None or match.certainty == KIND:
            others[names[0] if names else ""] += count
            kind = match.species if match is not None else _GENERIC
            kind = {GENERIC: kind, LEFT_OUT: ""}.get(unknown, unknown)
        else:
            kind = match.species
            # A bare genus says no more than what it gets.
            if match.certainty == KIN or (match.certainty == GENUS and len(words_of(name)) > 1):
                kin[name] += count
        chosen.append(kind)
    identifiers = sorted({kind for kind in chosen if kind})
    index = {kind: number for number, kind in enumerate(identifiers)}
    return identifiers, np.array([index.get(kind, -1) for kind in chosen], np.int32)[inventory.name], kin, others


@importing
def canopy_steps(order: Import, mix: Mapping[str, float], least: float, below: Path | None = None) -> Steps:
    """Make a field of the trees that a raster of canopy height shows; see `importing`.

    Parameters
    ----------
    mix : mapping
        Weights of species by identifier.
    least : float
        Height of the smallest tree, meters.
    below : Path, optional
        Elevations of the ground, which are subtracted.
    """
    raster, what = (yield from read_raster(order)), order.what
    if below is not None:
        ground = yield from read_raster(order, below)
        progress = Progress(0.05, "Subtracting the ground")
        raster = yield from call_in_thread(progress, heights_above, raster, ground, what)
    values, notes = checked_canopy(raster.values, what)
    raster = replace(raster, values=values)
    notes = [*raster.notes, f"coordinates: {raster.system.name}", *notes]
    place = order.origin(raster.outline, raster.system)
    h, w = raster.values.shape
    # Steps from a cell in the middle to the next ones, in meters of the scene.
    near = raster.places(np.array([0, 1, 0]) + w // 2, np.array([0, 0, 1]) + h // 2)
    middle, along, down = order.local(place, near, raster.system)
    along, down = along - middle, down - middle
    cell = float(np.sqrt(abs(along[0] * down[1] - along[1] * down[0])))
    if roofs := building_areas(order.scene):
        flat = replace(raster, corner=middle - along * (w // 2) - down * (h // 2), along=along, down=down)
        flat, number = yield from call_in_thread(Progress(0.1, "Leaving out roofs"), without_areas, flat, roofs)
        raster = replace(raster, values=flat.values)
        notes += [f"{number:,} cells on buildings left out"] * (number > 0)
    if cell > _COARSEST:
        raise SceneError(f"{what}its cells are {cell:.1f} m wide; trees can be told apart up to {_COARSEST:g} m")
    trees = yield from steps_in_thread(find_trees(raster.values, cell, least), Progress(0.1, "Looking for treetops"))
    number = len(trees.height)
    if not number:
        raise SceneError(f"{what}nothing in it is {least:g} m high; check its unit, or lower Min Height")
    flat = order.local(place, raster.places(trees.column, trees.row), raster.system)
    identifiers = list(mix)
    keys = child_key(child_key(key_of_seed(0), _SPECIES), np.arange(number))
    kinds = species_by_weight(tuple(mix.values()), uniform(keys, 0))
    unit = np.stack([along / np.linalg.norm(along), down / np.linalg.norm(down)])
    offset = np.column_stack([trees.offset @ unit, np.zeros(number)])
    sizes = {"height": trees.height, "crown_width": trees.width, "offset": offset}
    sizes = {name: values.astype(np.float32) for name, values in sizes.items()}
    imported = yield from _plant(order, place, flat, kinds, identifiers, sizes)
    imported.told += notes
    return imported


_COARSEST = 3.0  # meters
_SPECIES, _AZIMUTH, _SEED = 1, 2, 3


def _plant(
    order: Import, place: MapOrigin, flat: Floats, kinds: Integers32, identifiers: list[str], sizes: dict[str, Floats32]
) -> Steps:
    """Make the field; its plants stand on the ground, those beside it as high as the ground is on average."""
    progress = Progress(0.8, "Standing trees on the ground")
    yield progress
    heights = yield from heights_steps(order, progress)
    parts, z = [f"{len(flat):,} tree{'s' * (len(flat) > 1)} imported"], np.zeros(len(flat))
    if heights is not None:
        z = heights.at(heights.height, flat)
        beside, corner = ~np.isfinite(z), np.array([heights.west, heights.south])
        # Beyond its box the ground goes on as at its border.
        beyond = ((flat < corner) | (flat > corner + heights.cell * np.array(heights.height.shape[::-1]))).any(axis=1)
        number = (beside | beyond).sum()
        parts += [f"{number:,} stand beside the ground"] * bool(number)
        z[beside] = z[~beside].mean() if not beside.all() else 0.0
    keys = child_key(key_of_seed(0), np.arange(len(flat)))
    seeds = (uniform(keys, _SEED) * 2**31).astype(np.int32)
    turns = tau * uniform(keys, _AZIMUTH)
    placement = Placement(np.column_stack([flat, z]), turns, np.ones(len(flat)), kinds, seeds, len(flat))
    age = sizes.get("age")
    ages = None if age is None else np.where(sizes["height"] > 0.0, 0.0, age)
    columns = {name: sizes[key] for name in NUMBERS if (key := name.removeprefix("tf_")) in sizes and sizes[key].any()}
    columns |= {OFFSET: sizes["offset"]} if "offset" in sizes else {}
    if HEIGHT in columns:
        columns[FIT] = yield from _fit_steps(order.scene, placement, identifiers, columns)
    yield Progress(0.95, "Making the field")
    field = add_field(order.scene, placement, identifiers, ages=ages)
    field.name = field.data.name = order.path.stem
    for name, values in columns.items():
        write(field.data, name, values, data_type=SIZE_ATTRIBUTES[name])
    order.remember(place)
    return Imported(field, parts)


def _fit_steps(
    scene: bpy.types.Scene, placement: Placement, identifiers: list[str], columns: dict[str, Floats32]
) -> Job[Floats32]:
    """Factors on height and crown width, (n, 3), that make up for what is random in each plant."""
    none, number = np.zeros((len(placement), 3)), len(placement)
    numbers = (columns.get(name, none[:, 0]).astype(np.float64) for name in NUMBERS)
    sizes = Sizes(*numbers, columns.get(OFFSET, none)[:, :2], none[:, :2] + 1.0)
    turn, frame = placement.azimuth, np.zeros((number, 3, 3))
    frame[:, 0, 0] = frame[:, 1, 1] = np.cos(turn)
    frame[:, 1, 0], frame[:, 0, 1], frame[:, 2, 2] = np.sin(turn), -np.sin(turn), 1.0
    given = placement.species, placement.seed.astype(np.int64), none, frame, np.ones(number)
    species = {name: species_for(scene, name) for name in set(identifiers) & grown().keys()}

    def find(name: str) -> Species:
        if name not in species:  # an asset
            raise SpeciesError(name)
        return species[name]

    progress = Progress(0.85, "Fitting plants to their sizes")
    fits = yield from call_in_thread(progress, fits_of, Seeds(tuple(identifiers), *given), sizes, find)
    return np.pad(fits, ((0, 0), (0, 1))).astype(np.float32)
