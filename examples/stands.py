# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants of several species by their height in pixels, side by side under one of four lights.

Proxies are judged by such images. Each species has its own columns of the image.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, tan

import bpy

from tetflora_addon.blender.job.plant_mesh import single_seed
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.emission.plants import expanded_blocks
from tetflora_addon.species import catalog

from . import stage

SPECIES = ("oak", "birch", "spruce", "aspen")
#: Directions of the sun's light as its azimuth over the direction of view, degrees: 0 shines over the viewer's
#: shoulder. None: nothing but an even sky.
LIGHTS: dict[str, float | None] = {"front": 25.0, "side": 95.0, "back": 170.0, "overcast": None}
#: Height that every plant is scaled to, meters.
HEIGHT = 12.0
_ELEVATION = 40.0
_FIELD_OF_VIEW = radians(30.0)
_EYE = 0.35 * HEIGHT


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
        scale = HEIGHT / height_of(identifier)
        for i in range(each):
            place = (s * each + i + 0.5) * slot - width / 2, 0.0, 0.0
            stage.plant(scene, identifier, 100 * s + i, place, 2.399963 * i, scale)
    stage.ground(40.0 * width)
    set_light(scene, light)
    _add_camera(scene, pixels, width)
    columns = scene.render.resolution_x // len(species)
    return Stand(scene, {name: slice(s * columns, (s + 1) * columns) for s, name in enumerate(species)})


def height_of(identifier: str, seed: int = 0) -> float:
    """Height of one plant of a species, meters."""
    flora = compile_species([catalog.load_species(identifier)])
    return max(float(b.buffers.positions[:, 2].max()) for b in expanded_blocks(flora, single_seed(identifier, seed)))


def set_light(scene: bpy.types.Scene, light: str) -> None:
    """Give a scene one of `LIGHTS`; the one that it had from here is replaced."""
    azimuth = LIGHTS[light]
    for old in [o for o in scene.collection.objects if o.type == 'LIGHT']:
        bpy.data.lights.remove(old.data)
    if scene.world is not None:
        bpy.data.worlds.remove(scene.world)
    stage.even_sky(scene, (0.75, 0.85, 1.0), 1.0 if azimuth is None else 0.35)
    if azimuth is not None:
        stage.sun(scene, _ELEVATION, -azimuth, 3.5, (1.0, 0.95, 0.88))


def _add_camera(scene: bpy.types.Scene, pixels: int, width: float) -> None:
    """All plants fill the image's width; the ground before and behind them is seen as well."""
    distance, scale = width / 2 / tan(_FIELD_OF_VIEW / 2), pixels / HEIGHT
    size = round(width * scale), round(1.6 * HEIGHT * scale)
    eye, far = (0.0, -distance, _EYE), 10.0 * distance + 1000.0
    camera = stage.camera(scene, eye, (0.0, 0.0, _EYE), size, view=_FIELD_OF_VIEW, far=far)
    # The horizon is a third up, where the eye is level.
    camera.data.shift_y = (0.5 * HEIGHT - _EYE) / width
    scene.view_settings.view_transform = 'Standard'
    scene.view_settings.look = 'None'
    scene.tetflora.refine_at_render = False
    scene.eevee.use_raytracing = True  # or the sky would shine through crowns
    scene.eevee.fast_gi_thickness_near = 3.0
