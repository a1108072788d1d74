# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Forests of USD files as fields: those that were exported bit by bit, points of any other file as places of plants."""

from collections.abc import Mapping

import bpy
import numpy as np
from mathutils import Matrix

from ...errors import SceneError, listed
from ...export.forest import PointAttributes
from ...growth.hashing import child_key, key_of_seed, uniform
from ...jobs import Progress
from ...planting.rules import species_by_weight
from ..attributes import write
from ..geodata.origin import Import, Imported, Steps, importing
from ..placing.plant_objects import link_field
from .usd import FORMAT, read_parts

_SPECIES, _SEED = 1, 2
_TRANSFORM = {"rotation_mode", "location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale"}


@importing
def forest_steps(order: Import, mix: Mapping[str, float]) -> Steps:
    """Make a field for each object whose plants a file holds; yields progress. Closing the steps leaves all as it was.

    Parameters
    ----------
    mix : mapping
        Weights of species by identifier, for points that do not tell theirs.

    Raises
    ------
    SceneError
        The file holds no points, or is of a newer TetFlora.
    """
    yield Progress(0.0, f"Reading {order.path.name}")
    made: list[bpy.types.Object] = []
    whole, missing, number = False, [], 0
    try:
        for name, data, points in read_parts(order.path):
            if data and int(data.get("format", 0)) > FORMAT:
                raise SceneError(f"{order.what}was written by a newer TetFlora; update the extension")
            points, kinds = (points, _kinds(data)) if data else _completed(points, mix)
            made.append(_field(name, data, points, kinds))
            missing += [form for _, form in kinds if form and bpy.data.objects.get(form) is None]
            number += len(points["position"][1])
            yield Progress(0.5, f"{number:,} plants")
        for field in made:
            link_field(order.scene, field)
        whole = True
    finally:
        if not whole:
            meshes = [field.data for field in made]
            bpy.data.batch_remove(made)
            bpy.data.batch_remove(meshes)
    told = [f"{number:,} plants imported", f"{len(made):,} field{'s' * (len(made) > 1)}"]
    if missing:
        told.append(f"without their forms, which this file has no objects for: {listed(sorted(set(missing)))}")
    return Imported(made[0], told, bool(missing))


def _kinds(data: Mapping) -> list[tuple[str, str]]:
    """Species that an exported part counts through, each with the name of the object of its form."""
    return list(zip(map(str, data["species"]), map(str, data["forms"]), strict=True))


def _completed(points: PointAttributes, mix: Mapping[str, float]) -> tuple[PointAttributes, list[tuple[str, str]]]:
    """Points of another program with seeds and species, by chance where they tell none."""
    number, names = len(points["position"][1]), list(mix)
    keys = child_key(key_of_seed(0), np.arange(number))
    found = dict(points)
    if "seed" not in found:
        found["seed"] = 'INT', (uniform(keys, _SEED) * 2**31).astype(np.int32)
    known = found.get("species")
    if known is None or not ((known[1] >= 0) & (known[1] < len(names))).all():
        found["species"] = 'INT', species_by_weight(tuple(mix.values()), uniform(keys, _SPECIES)).astype(np.int32)
    return found, [(name, "") for name in names]


def _field(name: str, data: Mapping, points: PointAttributes, kinds: list[tuple[str, str]]) -> bpy.types.Object:
    """A field that is in no collection yet."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(points["position"][1]))
    for key, (kind, values) in points.items():
        write(mesh, key, values, data_type=kind)
    mesh.update()
    obj = bpy.data.objects.new(name, mesh)
    group = obj.tetflora
    if data:
        obj.matrix_world = Matrix(np.array(data["matrix"]).T.tolist())
        for key, value in dict(data.get("object", {})).items():
            if key in {"age", "seed"}:
                setattr(group, key, value)
            elif key in _TRANSFORM:
                setattr(obj, key, value if isinstance(value, str) else list(value))
    group.is_field = True
    for species, form in kinds:
        entry = group.field_species.add()
        entry.species, entry.skeleton = species, bpy.data.objects.get(form) if form else None
    return obj
