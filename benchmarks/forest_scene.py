# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The wood of the benchmark `forest`, made as somebody makes it who tries the extension for the first time.

A grid of 300 m is the ground, Populate is asked for 100,000 plants at the distance that it suggested in 2026, and the
camera stands at the edge, 30 m up. Everything else is as in a new file, with the sun and sky of First Forest.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from examples import million
from tetflora_addon.blender.job.plant_mesh import single_seed
from tetflora_addon.blender.placing.first_forest import sky
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.emission.plants import expanded_blocks
from tetflora_addon.species import catalog

#: Ground: meters along each side, and faces. With these 14,891 plants have room, 2,446 at 5 m.
SIDE, SUBDIVISIONS = 300.0, 120
WIDTH, HEIGHT = 1920, 1080
MIX = ("birch", "spruce", "oak", "beech", "scots_pine")
#: The catalog does not say what a tree is: all that grow at least so high, meters.
TREE = 4.0
MILLION_GB = 6.0
#: The eye looks at this height above the middle of the ground, meters.
_CROWNS = 7.0


@dataclass(frozen=True)
class Case:
    """A wood and where it is seen from.

    Attributes
    ----------
    species : tuple of str
        In equal parts.
    asked : int
        Plants that Populate is asked for; as many come as have room.
    distance : float
        Minimum distance between plants, meters.
    eye : float
        Height of the camera, meters.
    inside : bool
        The camera stands in the middle of the wood and looks ahead, not at the edge.
    side : float
        Of the ground, meters.
    away : float
        Least distance of the camera from the middle of the ground, meters, and how far ahead it then looks. 0: to the
        middle.
    cover : bool
        The ground is covered.
    """

    species: tuple[str, ...]
    asked: int = 100_000
    distance: float = 2.0
    eye: float = 30.0
    inside: bool = False
    side: float = SIDE
    away: float = 0.0
    cover: bool = False


def case_of(name: str) -> Case:
    """A case by its name: that of a species, ``mix`` or ``eye``."""
    if name == "mix":
        return Case(MIX, distance=5.0)
    if name == "eye":
        return Case(MIX, asked=20_000, eye=1.7, inside=True)
    return Case((name,))


def height_of(identifier: str) -> float:
    """Height of one plant of a species, meters."""
    flora = compile_species([catalog.load_species(identifier)])
    return max(float(b.buffers.positions[:, 2].max()) for b in expanded_blocks(flora, single_seed(identifier, 1)))


def trees() -> tuple[str, ...]:
    """Species of the catalog that are trees."""
    return tuple(name for name in catalog.list_species() if height_of(name) >= TREE)


def build(scene: bpy.types.Scene, case: Case, size: tuple[int, int] = (WIDTH, HEIGHT)) -> int:
    """Fill an empty scene with ground, plants, camera, sun and sky; how many plants there are."""
    bpy.ops.mesh.primitive_grid_add(size=case.side, x_subdivisions=SUBDIVISIONS, y_subdivisions=SUBDIVISIONS)
    bpy.ops.tetflora.populate(count=case.asked, min_distance=case.distance, species=", ".join(case.species))
    if case.cover:
        bpy.ops.tetflora.ground_cover()
    add_camera(scene, case)
    add_light(scene)
    render = scene.render
    render.engine = 'CYCLES'  # before plants are refined: engines draw spheres of different sizes
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    scene.tetflora.refine_at_render = False
    bpy.context.view_layer.update()
    return sum(population.made for population in scene.tetflora.layers)


def add_camera(scene: bpy.types.Scene, case: Case) -> None:
    """The camera that Blender adds, where the case has it; its range reaches to the end of the wood."""
    eye = Vector((0.0, 0.0 if case.inside else -max(case.side / 2, case.away), case.eye))
    ahead = Vector((0.0, case.away or case.side / 2, 0.0 if case.inside else min(_CROWNS, case.eye) - case.eye))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = eye, ahead.to_track_quat('-Z', 'Y').to_euler()
    camera.data.clip_end = max(1000.0, 2.0 * case.side)
    scene.collection.objects.link(camera)
    scene.camera = camera


def add_light(scene: bpy.types.Scene) -> None:
    """Sun and sky of First Forest."""
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", 'SUN'))
    sun.data.energy, sun.data.angle, sun.data.color = 5.0, np.radians(0.6), (1.0, 0.93, 0.82)
    sun.rotation_euler = np.radians(52.0), 0.0, np.radians(-68.0)
    scene.collection.objects.link(sun)
    scene.world = sky("Sky")
    scene.view_settings.exposure = 0.9


def build_million(scene: bpy.types.Scene, plants: int | None = None) -> int:
    """The forest of a million plants of the README, within the gigabytes of its image; how many plants there are."""
    plants = plants or million.PLANTS
    million.build(scene, plants)
    scene.tetflora.refine_at_render, scene.tetflora.max_memory = False, MILLION_GB
    return plants
