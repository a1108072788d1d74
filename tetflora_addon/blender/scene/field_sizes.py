# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded sizes of the plants of a field, and fields whose points are records of plants in the years of a stand.

All names have the prefix ``tf_``: without it, they belong to other tools. Attributes that are absent, and numbers that
are 0, say nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Integers
from ...compiled.recorded_sizes import Lives, Sizes
from ...errors import SceneError
from ..attributes import values_of
from .field_points import FieldPoints, Points, joined, point_count, refuse
from .motion import bags_of, curves_of

HEIGHT = "tf_height"
#: Attributes of numbers, with the most that is sound: meters, and years since death.
NUMBERS = {HEIGHT: 200.0, "tf_diameter": 20.0, "tf_crown_width": 200.0, "tf_crown_base": 200.0, "tf_dead": 10_000.0}
OFFSET, FIT = "tf_crown_offset", "tf_fit"
#: Attributes of histories: the year of the stand that a point is a record of, and the plant whose record it is.
YEAR, PLANT = "tf_year", "tf_plant"
#: Where an object has the year at which its history is shown.
YEAR_PATH = "tetflora.stand_year"
#: All of them with their types, in the order in which they are written.
SIZE_ATTRIBUTES = {
    **dict.fromkeys(NUMBERS, 'FLOAT'),
    OFFSET: 'FLOAT_VECTOR',
    FIT: 'FLOAT_VECTOR',
    YEAR: 'FLOAT',
    PLANT: 'INT',
}
_MOST_FIT, _MOST_OFFSET = 10.0, 10.0
_STEADY = np.cos(np.radians(30.0))  # trunks that turn further from one record to the next have fallen


@dataclass(frozen=True)
class History:
    """Which points are records of which plant."""

    year: Floats  # (n,)
    first: Integers  # (n,): first record of the same plant

    def chosen(self, now: float) -> tuple[Integers, Integers, Floats]:
        """Records (m,) before and after a year of those plants that are there, and how far it is from the first."""
        first, last = self.year.min(initial=np.inf), self.year.max(initial=-np.inf)
        now = last if first == last else min(float(now), last)  # what has one year has no others
        plant, before = self.first, self.year <= now
        following = np.append(plant[1:] == plant[:-1], False)
        there = before & (self.year == now)
        between = before & following & ~there & (np.append(self.year[1:], now) > now)
        a = np.flatnonzero(there | between)
        b = a + between[a]
        return a, b, (now - self.year[a]) / np.maximum(self.year[b] - self.year[a], 1e-9)


def has_history(obj: bpy.types.Object) -> bool:
    """Whether the points that a field stores are records of a history; cheap."""
    return isinstance(obj.data, Points) and YEAR in obj.data.attributes


def year_curves(obj: bpy.types.Object) -> list[bpy.types.FCurve]:
    """Curves of keys of a stand's year."""
    return [curve for curve in curves_of(obj) if curve.data_path == YEAR_PATH]


def clear_years(obj: bpy.types.Object) -> None:
    """Remove all keys of a stand's year."""
    for bag in bags_of(obj):
        for curve in [curve for curve in bag.fcurves if curve.data_path == YEAR_PATH]:
            bag.fcurves.remove(curve)


def year_now(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> float:
    """Year in which a history is shown; also where the object is disabled in viewports, and Blender evaluates none."""
    evaluated = obj.evaluated_get(depsgraph) if obj.animation_data else obj
    curve = next((curve for curve in year_curves(obj) if not curve.mute), None)
    if curve is None or evaluated.is_evaluated:
        return evaluated.tetflora.stand_year
    return max(curve.evaluate(depsgraph.scene.frame_current_final), 0.0)


def stand_years(scene: bpy.types.Scene) -> list[float]:
    """Present years of all histories of a scene."""
    meshes = (obj for obj in scene.objects if isinstance(obj.data, Points))
    return [group.stand_year for obj in meshes if (group := obj.tetflora).is_field and has_history(obj)]


def stored_now(obj: bpy.types.Object) -> Integers:
    """Numbers (m,) of the stored points of a field that are plants now: of a history, those of the present year."""
    points = obj.data
    if not has_history(obj):
        return np.arange(point_count(points))
    try:
        records = read_records(obj, [points])
    except SceneError:  # told where the field is read
        return np.zeros(0, np.int64)
    return records.chosen(obj.tetflora.stand_year)[0]


def read_sizes(obj: bpy.types.Object, parts: Sequence[Points]) -> Sizes | None:
    """Recorded sizes of the points of a field; None where none are stored.

    Raises
    ------
    SceneError
        An attribute of the wrong type, or values that are no sizes; names the object, their number and the first one.
    """
    names = (*NUMBERS, OFFSET, FIT)
    if not any(name in part.attributes for part in parts for name in names):
        return None
    found = []
    for name in names:
        values = joined([_values(obj, part, name) for part in parts], (0,) if name in NUMBERS else (0, 3))
        most = NUMBERS.get(name, _MOST_FIT if name == FIT else _MOST_OFFSET)
        least = -most if name == OFFSET else 0.0
        bad = ~((values >= least) & (values <= most))
        bad = bad.any(axis=1) if bad.ndim > 1 else bad
        refuse(obj, bad, f"{name} that is not from {least:g} to {most:,.0f}")
        found.append(values[:, :2] if values.ndim > 1 else values)
    *rest, fit = found
    return Sizes(*rest, np.where(fit > 0.0, fit, 1.0))  # in the order of the names


def read_records(obj: bpy.types.Object, parts: Sequence[Points]) -> History | None:
    """Which records the points of a field are; None where they are plants.

    Raises
    ------
    SceneError
        As `read_sizes`; years of a plant that do not ascend; years without numbers of plants.
    """
    if not any(YEAR in part.attributes for part in parts):
        return None
    if not all(name in part.attributes for part in parts for name in (YEAR, PLANT)):
        raise SceneError(f'"{obj.name}": a field with {YEAR} requires {PLANT} too; add it, or rename {YEAR}')
    year = joined([_values(obj, part, YEAR) for part in parts], (0,))
    plant = joined([_values(obj, part, PLANT) for part in parts], (0,))
    refuse(obj, ~(np.abs(year) <= 1e6), f"{YEAR} that is not a year")
    same = np.zeros(len(plant), bool)
    same[1:] = plant[1:] == plant[:-1]
    back = np.zeros(len(plant), bool)
    back[1:] = same[1:] & (year[1:] <= year[:-1])
    refuse(obj, back, f"{YEAR} that is not after that of the record before, of the same plant")
    return History(year, np.maximum.accumulate(np.where(same, 0, np.arange(len(plant)))))


def in_year(
    points: FieldPoints, sizes: Sizes | None, records: History, now: float, smooth: bool
) -> tuple[FieldPoints, Sizes | None]:
    """The plants that are there in a year, between their records.

    Positions and sizes go evenly from one record to the next. A trunk that falls between two records stands until the
    second.
    """
    a, b, part = records.chosen(now)
    scale = points.scale[:, a] + part * (points.scale[:, b] - points.scale[:, a])
    age = points.age
    chosen = replace(
        points,
        position=_between(points.position, a, b, part),
        rotation=_turned(points.rotation, a, b, part),
        scale=scale,
        species=points.species[a],
        seed=points.seed[a],
        age=None if age is None else _between(age, a, b, part),
    )
    if sizes is None:
        return chosen, None
    columns = {
        f.name: _between(getattr(sizes, f.name), a, b, part) for f in fields(sizes) if f.name not in {"plant", "lives"}
    }
    for name in ("height", "diameter", "width"):  # what is known of one of them only holds for both
        one, other = getattr(sizes, name)[a], getattr(sizes, name)[b]
        columns[name] = np.where((one > 0.0) & (other > 0.0), columns[name], np.maximum(one, other))
    left = (1.0 - part) * (records.year[b] - records.year[a])
    columns["dead"] = np.where(sizes.dead[b] > 0.0, np.maximum(sizes.dead[b] - left, 0.0), sizes.dead[a])
    if smooth:
        columns["plant"] = records.first[a]
        own = sizes.height, sizes.width, sizes.base, sizes.dead
        columns["lives"] = Lives(now, records.year, *own, records.first, points.species)
    return chosen, Sizes(**columns)


def _between(values: NDArray, a: Integers, b: Integers, part: Floats) -> NDArray:
    one, other = values[a], values[b]
    return one + part.reshape(-1, *[1] * (values.ndim - 1)) * (other - one)


def _turned(rotation: NDArray, a: Integers, b: Integers, part: Floats) -> NDArray:
    """Rotations (3, 3, m) between those of records; those before where a trunk falls."""
    one, other = rotation[:, :, a], rotation[:, :, b]
    upright = (one[:, 2] * other[:, 2]).sum(axis=0)
    leans = np.flatnonzero((upright > _STEADY) & (one != other).any(axis=(0, 1)))
    if len(leans):
        mixed = one[:, :, leans] + part[leans] * (other[:, :, leans] - one[:, :, leans])
        z = mixed[:, 2] / np.linalg.norm(mixed[:, 2], axis=0)
        x = mixed[:, 0] - z * (z * mixed[:, 0]).sum(axis=0)
        x /= np.maximum(np.linalg.norm(x, axis=0), 1e-9)
        one = one.copy()
        one[:, :, leans] = np.stack([x, np.cross(z, x, axis=0), z], axis=1)
    return one


def _values(obj: bpy.types.Object, points: Points, name: str) -> Floats:
    """An attribute in double precision; 0 where it is absent."""
    size, vector = point_count(points), SIZE_ATTRIBUTES[name] == 'FLOAT_VECTOR'
    found = points.attributes.get(name)
    if found is None:
        return np.zeros((size, 3) if vector else size)
    kinds = {'FLOAT_VECTOR'} if vector else {'FLOAT', 'INT'}
    if found.domain != 'POINT' or found.data_type not in kinds:
        raise SceneError(
            f'"{obj.name}": attribute "{name}" is {found.data_type} on {found.domain}; a field requires '
            f"{' or '.join(sorted(kinds))} on POINT. Convert or rename it"
        )
    return values_of(found).astype(np.float64)
