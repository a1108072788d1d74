# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants of several species side by side, all of one height in pixels, under one of four lights.

Proxies are judged by such pictures: each species has its own columns of the picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians, tan

import bpy
import numpy as np

from devtools import session

SPECIES = ("oak", "birch", "spruce", "aspen")
#: Directions of the sun's light as its azimuth over the direction of view, degrees: 0 shines over the viewer's
#: shoulder. None: nothing but an even sky.
LIGHTS: dict[str, float | None] = {"front": 25.0, "side": 95.0, "back": 170.0, "overcast": None}
#: Height that every plant is scaled to, metres.
HEIGHT = 12.0
_ELEVATION = 40.0
_FIELD_OF_VIEW = radians(30.0)
_EYE = 0.35 * HEIGHT
_GROUND = (0.16, 0.14, 0.10, 1.0)


@dataclass(frozen=True)
class Stand:
    """A scene with plants in columns.

    Attributes
    ----------
    scene : bpy.types.Scene
    columns : dict of str to slice
        Columns of the picture that hold a species.
    """

    scene: bpy.types.Scene
    columns: dict[str, slice]


def build(scene: bpy.types.Scene, pixels: int, light: str, each: int, species: tuple[str, ...] = SPECIES) -> Stand:
    """Fill an empty scene.

    Parameters
    ----------
    scene : bpy.types.Scene
    pixels : int
        Height of every plant in the picture.
    light : str
        One of `LIGHTS`.
    each : int
        Plants of each species.
    species : tuple of str
    """
    slot = 0.85 * HEIGHT
    width = slot * each * len(species)
    for s, identifier in enumerate(species):
        scale = HEIGHT / _height(identifier)
        for i in range(each):
            empty = bpy.data.objects.new(f"{identifier} {i + 1:02d}", None)
            empty.location = (s * each + i + 0.5) * slot - width / 2, 0.0, 0.0
            empty.rotation_euler.z = 2.399963 * i
            empty.scale = (scale,) * 3
            empty.tetflora.is_plant, empty.tetflora.species, empty.tetflora.seed = True, identifier, 100 * s + i
            scene.collection.objects.link(empty)
    _add_ground(scene, width)
    _add_light(scene, LIGHTS[light])
    _add_camera(scene, pixels, width)
    columns = scene.render.resolution_x // len(species)
    return Stand(scene, {name: slice(s * columns, (s + 1) * columns) for s, name in enumerate(species)})


def _height(identifier: str) -> float:
    """Height of a plant of a species, metres."""
    catalogue, compiled = (session.part(f"tetflora_addon.plants.{name}") for name in ("catalogue", "compiled"))
    seeds, emission = session.part("tetflora_addon.plants.seeds"), session.part("tetflora_addon.emission")
    flora = compiled.compile_species([catalogue.load_species(identifier)])
    one = seeds.Seeds(
        (identifier,), np.zeros(1, np.int32), np.zeros(1, np.int64), np.zeros((1, 3)), np.eye(3)[None], np.ones(1)
    )
    return float(max(block.buffers.positions[:, 2].max() for block in emission.expanded_blocks(flora, one)))


def _add_ground(scene: bpy.types.Scene, width: float) -> None:
    ground = bpy.data.meshes.new("Ground")
    side = 20.0 * width
    ground.from_pydata([(-side, -side, 0), (side, -side, 0), (side, side, 0), (-side, side, 0)], [], [(0, 1, 2, 3)])
    material = bpy.data.materials.new("Ground")
    tree = session.part("tetflora_addon.blender.compat").shader_tree(material)
    tree.nodes.clear()
    diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = _GROUND
    tree.links.new(diffuse.outputs[0], output.inputs[0])
    ground.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("Ground", ground))


def _add_light(scene: bpy.types.Scene, azimuth: float | None) -> None:
    world = bpy.data.worlds.new("Sky")
    scene.world = world
    tree = session.part("tetflora_addon.blender.compat").shader_tree(world)
    background = next(n for n in tree.nodes if n.type == 'BACKGROUND')
    background.inputs["Color"].default_value = (0.75, 0.85, 1.0, 1.0)
    background.inputs["Strength"].default_value = 1.0 if azimuth is None else 0.35
    if azimuth is None:
        return
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", 'SUN'))
    sun.data.energy, sun.data.angle, sun.data.color = 3.5, radians(0.6), (1.0, 0.95, 0.88)
    sun.rotation_euler = (pi / 2 - radians(_ELEVATION), 0.0, radians(azimuth))
    scene.collection.objects.link(sun)


def _add_camera(scene: bpy.types.Scene, pixels: int, width: float) -> None:
    """All plants fill the picture's width; the ground before and behind them is seen as well."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    distance = width / 2 / tan(_FIELD_OF_VIEW / 2)
    camera.data.angle, camera.data.clip_end = _FIELD_OF_VIEW, 10.0 * distance + 1000.0
    camera.location = (0.0, -distance, _EYE)
    camera.rotation_euler = (pi / 2, 0.0, 0.0)
    scale = pixels / HEIGHT
    render = scene.render
    render.resolution_x, render.resolution_y = round(width * scale), round(1.6 * HEIGHT * scale)
    render.resolution_percentage = 100
    # The horizon is a third up, where the eye is level.
    camera.data.shift_y = (0.5 * HEIGHT - _EYE) / width
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.view_settings.view_transform = 'Standard'
    scene.view_settings.look = 'None'
    scene.tetflora.refine_at_render = False
