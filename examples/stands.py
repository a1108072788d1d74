# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants of several species by their height in pixels, under one of four lights: side by side, in rows, as a forest.

Proxies are judged by such images. Side by side, each species has its own columns of the image.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians, tan

import bpy
import numpy as np
from numpy.typing import NDArray

from tetflora_addon.blender import compat
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.emission import plants
from tetflora_addon.growth import seeds
from tetflora_addon.growth.hashing import signed, uniform
from tetflora_addon.species import catalog

SPECIES = ("oak", "birch", "spruce", "aspen")
#: Directions of the sun's light as its azimuth over the direction of view, degrees: 0 shines over the viewer's
#: shoulder. None: nothing but an even sky.
LIGHTS: dict[str, float | None] = {"front": 25.0, "side": 95.0, "back": 170.0, "overcast": None}
#: Height that every plant is scaled to, meters.
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
        Columns of the image that hold a species.
    """

    scene: bpy.types.Scene
    columns: dict[str, slice]


@dataclass(frozen=True)
class Above:
    """A scene with plants seen from above.

    Attributes
    ----------
    scene : bpy.types.Scene
    kind : (height, width) int
        Species (index) of the plant that is nearest to each pixel, top row first.
    """

    scene: bpy.types.Scene
    kind: NDArray[np.integer]


def build(scene: bpy.types.Scene, pixels: int, light: str, each: int, species: tuple[str, ...] = SPECIES) -> Stand:
    """Fill an empty scene.

    Parameters
    ----------
    scene : bpy.types.Scene
    pixels : int
        Height of every plant in the image.
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
            place = (s * each + i + 0.5) * slot - width / 2, 0.0, 0.0
            _add_plant(scene, f"{identifier} {i + 1:02d}", identifier, 100 * s + i, place, 2.399963 * i, scale)
    _add_ground(scene, 20.0 * width)
    set_light(scene, light)
    _add_camera(scene, pixels, width)
    columns = scene.render.resolution_x // len(species)
    return Stand(scene, {name: slice(s * columns, (s + 1) * columns) for s, name in enumerate(species)})


def receding(scene: bpy.types.Scene, largest: int, smallest: int, light: str) -> None:
    """Fill an empty scene with plants from left to right, each farther away than the one before.

    Parameters
    ----------
    scene : bpy.types.Scene
    largest, smallest : int
        Heights of the first and of the last plant in the image, pixels.
    light : str
        One of `LIGHTS`.
    """
    step = 0.92
    heights = largest * step ** np.arange(int(np.log(smallest / largest) / np.log(step)) + 1)
    centers = 0.4 * (heights.cumsum() - heights / 2) + 0.25 * largest
    columns = round(centers[-1] + heights[-1])
    focal = columns / 2 / tan(_FIELD_OF_VIEW / 2)
    distance = focal * HEIGHT / heights
    x = (centers - columns / 2) * HEIGHT / heights
    scales = {identifier: HEIGHT / _height(identifier) for identifier in SPECIES}
    for i, place in enumerate(zip(x.tolist(), distance.tolist(), strict=True)):
        identifier = SPECIES[i % len(SPECIES)]
        _add_plant(scene, f"{identifier} {i + 1:02d}", identifier, i, (*place, 0.0), 2.399963 * i, scales[identifier])
    _add_ground(scene, 20.0 * float(distance[-1]))
    set_light(scene, light)
    _aim(scene, (columns, round(1.3 * largest)), _EYE, float(distance[-1]))
    # The horizon is at the height of the eyes, a third up the first plant.
    scene.camera.data.shift_y = 0.2 * largest / columns


def forest(scene: bpy.types.Scene, count: int, light: str, columns: int = 512) -> None:
    """Fill an empty scene with a forest of plants 40 to 12 pixels high, seen from over their tops.

    Parameters
    ----------
    scene : bpy.types.Scene
    count : int
        Plants, of all `SPECIES` turns about.
    light : str
        One of `LIGHTS`.
    columns : int
        Width of the image, pixels.
    """
    focal = columns / 2 / tan(_FIELD_OF_VIEW / 2)
    near, far = focal * HEIGHT / 40.0, focal * HEIGHT / 12.0
    scales = [HEIGHT / _height(identifier) for identifier in SPECIES]
    # A sequence of low discrepancy (Roberts, 2018), even over the ground that is seen.
    u, v = np.mod(0.5 + np.arange(1, count + 1)[:, None] * [0.7548776662, 0.5698402910], 1.0).T
    distance = np.sqrt(near**2 + u * (far**2 - near**2))
    x = (v - 0.5) * 0.94 * columns / focal * distance
    for i, place in enumerate(zip(x.tolist(), distance.tolist(), strict=True)):
        s = i % len(SPECIES)
        _add_plant(scene, f"{SPECIES[s]} {i + 1:03d}", SPECIES[s], i, (*place, 0.0), 2.399963 * i, scales[s])
    _add_ground(scene, 20.0 * far)
    set_light(scene, light)
    eye = 1.6 * HEIGHT
    _aim(scene, (columns, columns // 4), eye, far)
    middle = focal / 2 * ((eye - HEIGHT) / far + eye / near)
    scene.camera.data.shift_y = -middle / columns


def above(scene: bpy.types.Scene, species: tuple[str, ...], each: int, side: float, pixels: int, light: str) -> Above:
    """Fill an empty scene with plants of their own heights on a square, seen from above by an orthographic camera.

    Parameters
    ----------
    scene : bpy.types.Scene
    species : tuple of str
    each : int
        Plants of each species.
    side : float
        Of the square that the image shows, meters.
    pixels : int
        The same in pixels.
    light : str
        One of `LIGHTS`.
    """
    count = each * len(species)
    # One in each cell of a grid, anywhere in the middle of it; which species is in which is drawn too.
    columns = round(np.sqrt(count))
    rows = -(-count // columns)
    key = np.arange(count).astype(np.uint64)
    kind = np.argsort(uniform(key, 1)) % len(species)
    cell = np.stack([np.arange(count) % columns, np.arange(count) // columns], axis=1)
    moved = cell + 0.5 + 0.5 * np.stack([signed(key, 2), signed(key, 3)], axis=1)
    place = (moved / [columns, rows] - 0.5) * side
    for i, (s, (x, y)) in enumerate(zip(kind.tolist(), place.tolist(), strict=True)):
        _add_plant(scene, f"{species[s]} {i + 1:02d}", species[s], i, (x, y, 0.0), 2.399963 * i, 1.0)
    _add_ground(scene, 2.0 * side)
    set_light(scene, light)
    _aim(scene, (pixels, pixels), 100.0, 100.0)
    scene.camera.data.type, scene.camera.data.ortho_scale = 'ORTHO', side
    scene.camera.rotation_euler = (0.0, 0.0, 0.0)
    middle = ((np.arange(pixels) + 0.5) / pixels - 0.5) * side
    away = np.hypot(middle[None, :, None] - place[:, 0], -middle[:, None, None] - place[:, 1])
    return Above(scene, kind[away.argmin(axis=2)])


def _add_plant(
    scene: bpy.types.Scene, name: str, species: str, seed: int, place: tuple, turn: float, scale: float
) -> None:
    empty = bpy.data.objects.new(name, None)
    empty.location, empty.rotation_euler.z, empty.scale = place, turn, (scale,) * 3
    empty.tetflora.is_plant, empty.tetflora.species, empty.tetflora.seed = True, species, seed
    scene.collection.objects.link(empty)


def _height(identifier: str) -> float:
    """Height of a plant of a species, meters."""
    flora = compile_species([catalog.load_species(identifier)])
    one = seeds.Seeds(
        (identifier,), np.zeros(1, np.int32), np.zeros(1, np.int64), np.zeros((1, 3)), np.eye(3)[None], np.ones(1)
    )
    return float(max(block.buffers.positions[:, 2].max() for block in plants.expanded_blocks(flora, one)))


def _add_ground(scene: bpy.types.Scene, side: float) -> None:
    ground = bpy.data.meshes.new("Ground")
    ground.from_pydata([(-side, -side, 0), (side, -side, 0), (side, side, 0), (-side, side, 0)], [], [(0, 1, 2, 3)])
    material = bpy.data.materials.new("Ground")
    tree = compat.shader_tree(material)
    tree.nodes.clear()
    diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = _GROUND
    tree.links.new(diffuse.outputs[0], output.inputs[0])
    ground.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("Ground", ground))


def set_light(scene: bpy.types.Scene, light: str) -> None:
    """Give a scene one of `LIGHTS`; the one that it had from here is replaced."""
    azimuth = LIGHTS[light]
    for old in [o for o in scene.collection.objects if o.type == 'LIGHT']:
        bpy.data.lights.remove(old.data)
    if scene.world is not None:
        bpy.data.worlds.remove(scene.world)
    world = bpy.data.worlds.new("Sky")
    scene.world = world
    tree = compat.shader_tree(world)
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
    """All plants fill the image's width; the ground before and behind them is seen as well."""
    distance, scale = width / 2 / tan(_FIELD_OF_VIEW / 2), pixels / HEIGHT
    _aim(scene, (round(width * scale), round(1.6 * HEIGHT * scale)), _EYE, distance)
    scene.camera.location.y = -distance
    # The horizon is a third up, where the eye is level.
    scene.camera.data.shift_y = (0.5 * HEIGHT - _EYE) / width


def _aim(scene: bpy.types.Scene, size: tuple[int, int], height: float, distance: float) -> None:
    """A level camera over the origin that looks along +y, for an image of a size in pixels."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.angle, camera.data.clip_end = _FIELD_OF_VIEW, 10.0 * distance + 1000.0
    camera.location = (0.0, 0.0, height)
    camera.rotation_euler = (pi / 2, 0.0, 0.0)
    render = scene.render
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.view_settings.view_transform = 'Standard'
    scene.view_settings.look = 'None'
    scene.tetflora.refine_at_render = False
    scene.eevee.use_raytracing = True  # or the sky would shine through crowns
    scene.eevee.fast_gi_thickness_near = 3.0
