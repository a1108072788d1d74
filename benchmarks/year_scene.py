# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of the benchmark `year`: a mixed forest at the height of the eye, and a birch by itself."""

from __future__ import annotations

import hashlib
from math import pi, radians, tan

import bpy
import numpy as np

from examples.daylight import add_daylight
from tetflora_addon.blender.results.output import result_collections
from tetflora_addon.growth.hashing import uniform

#: Species of the wood with their relative numbers: two that turn yellow, one that turns brown, one evergreen, a shrub.
MIX = {"birch": 0.3, "beech": 0.2, "oak": 0.2, "spruce": 0.15, "hazel": 0.15}
#: Nearest distance to the eye and height of the eye, meters; horizontal field of view.
_NEAREST, _EYE, _VIEW = 7.0, 1.7, radians(54.0)
_ELEVATION, _AZIMUTH = 35.0, -60.0


def wood(
    scene: bpy.types.Scene, plants: int, size: tuple[int, int], room: float, ages: tuple[float, float] | None = None
) -> None:
    """Fill an empty scene with plants before the camera, evenly over the ground that it sees.

    Parameters
    ----------
    scene : bpy.types.Scene
    plants : int
    size : tuple of int
        Of the image, pixels.
    room : float
        Ground for each plant, m².
    ages : tuple of float, optional
        Youngest and oldest, in years; a handful of ages between them. Without it, plants are full-grown.
    """
    half = 0.94 * tan(_VIEW / 2)
    farthest = np.sqrt(_NEAREST**2 + plants * room / half)
    # A sequence of low discrepancy (Roberts, 2018), even over the ground that is seen.
    u, v = np.mod(0.5 + np.arange(1, plants + 1)[:, None] * [0.7548776662, 0.5698402910], 1.0).T
    away = np.sqrt(_NEAREST**2 + u * (farthest**2 - _NEAREST**2))
    x = (2.0 * v - 1.0) * half * away
    key = np.arange(plants).astype(np.uint64)
    kinds = tuple(MIX)
    edges = np.cumsum(tuple(MIX.values()))
    kind = np.minimum(np.searchsorted(edges, uniform(key, 1) * edges[-1]), len(kinds) - 1)
    scale = 0.85 + 0.3 * uniform(key, 2)
    years = np.zeros(plants) if ages is None else np.round(ages[0] + (ages[1] - ages[0]) * (key % 4) / 3.0)
    for i in range(plants):
        add_plant(scene, kinds[kind[i]], i, (float(x[i]), float(away[i]), 0.0), float(scale[i]), float(years[i]))
    _ground(20.0 * float(farthest))
    _camera(scene, size, (0.0, 0.0, _EYE), radians(9.0), _VIEW)
    _finish(scene)


def lone(scene: bpy.types.Scene, species: str, height: float, size: tuple[int, int], age: float) -> None:
    """Fill an empty scene with one plant, and a camera that sees so many meters of its height."""
    add_plant(scene, species, 1, (0.0, 0.0, 0.0), 1.0, age)
    _ground(60.0 * height)
    view = radians(24.0)
    away = 0.55 * height / tan(view / 2)
    _camera(scene, size, (0.0, -away, _EYE), 0.0, view * size[0] / size[1])
    # The horizon is at the height of the eye.
    scene.camera.data.shift_y = (0.5 * height - _EYE) / (1.1 * height) * size[1] / max(size)
    _finish(scene)


def set_day(scene: bpy.types.Scene, day: float | None = None, years: float = 0.0) -> None:
    """Set the day of the year, or switch seasons off, and the years that have passed."""
    year = scene.tetflora.year
    year.enabled, year.years = day is not None, years
    if day is not None:
        year.day = day


def digest(scene: bpy.types.Scene) -> str:
    """Hash of all that Refine has made: every attribute of every mesh and point cloud, materials and places."""
    content = hashlib.sha256()
    for collection in result_collections(scene):
        for obj in sorted(collection.all_objects, key=lambda o: o.name):
            content.update(np.array(obj.matrix_world, np.float32).tobytes())
            content.update(" ".join(m.name if m else "" for m in getattr(obj.data, "materials", ())).encode())
            for attribute in sorted(getattr(obj.data, "attributes", ()), key=lambda a: a.name):
                content.update(attribute.name.encode() + _values(attribute).tobytes())
            if obj.type == 'MESH':
                offsets = np.zeros(len(obj.data.polygons), np.int32)
                obj.data.polygons.foreach_get("loop_start", offsets)
                content.update(offsets.tobytes())
    return content.hexdigest()


_FIELDS = {
    'FLOAT': ("value", 1, np.float32),
    'INT': ("value", 1, np.int32),
    'INT8': ("value", 1, np.int32),
    'BOOLEAN': ("value", 1, np.bool_),
    'FLOAT2': ("vector", 2, np.float32),
    'FLOAT_VECTOR': ("vector", 3, np.float32),
    'FLOAT_COLOR': ("color", 4, np.float32),
    'INT32_2D': ("value", 2, np.int32),
    'INT16_2D': ("value", 2, np.int32),
    'QUATERNION': ("value", 4, np.float32),
}


def _values(attribute: bpy.types.Attribute) -> np.ndarray:
    field, width, dtype = _FIELDS[attribute.data_type]
    out = np.zeros(width * len(attribute.data), dtype)
    attribute.data.foreach_get(field, out)
    return out


def add_plant(
    scene: bpy.types.Scene, species: str, seed: int, place: tuple[float, float, float], scale: float, age: float
) -> bpy.types.Object:
    """Plant something; an age of 0 is full-grown."""
    plant = bpy.data.objects.new(f"{species} {seed}", None)
    plant.location, plant.rotation_euler.z, plant.scale = place, 2.399963 * seed, (scale,) * 3
    plant.tetflora.is_plant, plant.tetflora.species, plant.tetflora.seed = True, species, seed
    plant.tetflora.age = age
    scene.collection.objects.link(plant)
    return plant


def _ground(side: float) -> None:
    bpy.ops.mesh.primitive_plane_add(size=side)
    material = bpy.data.materials.new("Ground")
    material.diffuse_color = (0.16, 0.14, 0.10, 1.0)
    if not material.node_tree:  # before Blender 5.0 new materials have no nodes
        material.use_nodes = True
    surface = next(node for node in material.node_tree.nodes if node.type == 'BSDF_PRINCIPLED')
    surface.inputs["Base Color"].default_value = (0.16, 0.14, 0.10, 1.0)
    surface.inputs["Roughness"].default_value = 1.0
    bpy.context.object.data.materials.append(material)


def _camera(
    scene: bpy.types.Scene, size: tuple[int, int], place: tuple[float, float, float], up: float, view: float
) -> None:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.sensor_fit, camera.data.angle = 'HORIZONTAL', view
    camera.data.clip_end = 5000.0
    camera.location, camera.rotation_euler = place, (pi / 2 + up, 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *size, 100


def _finish(scene: bpy.types.Scene) -> None:
    add_daylight(scene, elevation=_ELEVATION, azimuth=_AZIMUTH)
    scene.render.engine = 'CYCLES'
    scene.tetflora.refine_at_render = False
    bpy.context.view_layer.update()
