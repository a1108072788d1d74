# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A million plants: the valleys of the Jacksboro fault around a lake, conifers above, broadleaved trees below.

``python -m examples.million`` renders it; ``--plants``, ``--width`` and ``--memory`` make it smaller. The eye is on a
summit, which is open, beside a figure of 1.70 m; the sun is low, ahead and to the left.
"""

# ruff: noqa: E402  (run as a program, it starts Blender before it imports what needs Blender)
from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from devtools import session

session.start()

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from tetflora_addon.blender.attributes import write
from tetflora_addon.blender.placing import cover, plant_objects, populations, terrain
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.planting import places, rules

from . import stage
from .close_ups import render
from .figure import add_figure
from .haze import add_haze
from .seasons import Look, sky
from .terrain import Terrain
from .wood import grid

PLANTS, WIDTH, MEMORY = 1_000_000, 1600, 15.0
#: Relative numbers of species in the valleys and on the heights.
VALLEYS = {"broadleaf_tree": 0.3, "oak": 0.1, "maple": 0.15, "birch": 0.1, "aspen": 0.1, "bush": 0.25}
HEIGHTS = {"spruce": 0.45, "conifer": 0.3, "birch": 0.1, "bush": 0.15}
#: Square meters for each plant.
_ROOM = 22.0
#: Row and column of the summit in the elevation model, and which part of the land is before and to the left of it.
_SUMMIT, _SCALE, _BEFORE, _LEFT = (167, 155), 0.5, 0.97, 0.72
#: Samples of the model along each side at least: what is around the eye.
_LEAST = 12
#: Where the camera looks, radians from the y axis; meters from the summit and above it; field of view.
_AZIMUTH, _AWAY, _UP, _VIEW = np.radians(-112.0), 140.0, 5.0, np.radians(56.0)
#: The summit is free of trees around a place so many meters ahead, within a radius, meters.
_AHEAD, _CLEAR = 52.0, 86.0
#: Side of the meadow that is densest, around that place, meters; all of it is twice as wide.
_MEADOW = 104.0
#: Fraction of the land that is not above the lake, and height of its shore, meters.
_LAKE, _SHORE = 0.16, 3.0
_LOOK = Look(
    200.0, 0.0, (19.0, -166.0), 6.0, (1.0, 0.80, 0.58),
    ((0.98, 0.84, 0.68), (0.40, 0.57, 0.85), (0.08, 0.22, 0.52)), 0.8, 0.45, (0.00022, (0.54, 0.57, 0.64)), 0.46,
)  # fmt: skip
#: Around the summit: species, seed, meters ahead and to the right, size.
_NEAR = (
    ("spruce", 2, (44.0, -22.0), 0.55),
    ("spruce", 5, (52.0, -27.0), 0.8),
    ("spruce", 7, (58.0, -24.0), 0.65),
    ("spruce", 4, (24.0, 9.5), 0.16),
    ("birch", 3, (40.0, 17.5), 0.75),
    ("birch", 8, (46.0, 21.0), 0.65),
    ("rowan", 1, (50.0, -14.0), 0.5),
    ("bush", 1, (28.0, -9.0), 0.6),
    ("bush", 2, (35.0, -14.0), 0.8),
    ("bush", 6, (33.0, 14.0), 0.6),
)
_FIGURE = (24.0, 3.8)
#: By how much the meadow is above the coarser land, meters; where trees may grow.
_LIFT, _MASK = 0.35, "open"


def build(scene: bpy.types.Scene, plants: int = PLANTS, width: int = WIDTH) -> None:
    """Fill an empty scene with ground, a lake, two fields of plants, a summit, camera, sun, sky and haze."""
    samples = max(int(np.sqrt(plants * _ROOM) / (93.0 * _SCALE)) + 3, _LEAST)
    corner = _SUMMIT[0] - int(_LEFT * samples), _SUMMIT[1] - int(_BEFORE * samples)
    land = Terrain(corner=corner, shape=(samples, samples), scale=_SCALE)
    surface = land.add_object(scene, "Ground", spacing=12.0)
    summit = land.step * np.array([_SUMMIT[1] - corner[1], _SUMMIT[0] - corner[0]])
    forward = np.array([np.sin(_AZIMUTH), np.cos(_AZIMUTH)])
    eye = summit + _AWAY * forward
    level = float(np.quantile(land.heights, _LAKE))
    _open_summit(scene, land, eye, forward)
    _forbid(surface, eye + _AHEAD * forward, level)
    _plant(scene, surface, land, plants)
    _lake(scene, land, level)
    up = float(land.height(*eye)) + _UP
    target = Vector((*(eye + forward), up - 0.14))
    stage.camera(scene, (*eye, up), target, (width, width * 9 // 16), view=_VIEW, near=0.5, far=20_000.0)
    stage.sun(scene, _LOOK.sun[0], _LOOK.sun[1] - 180.0, _LOOK.energy, _LOOK.tint, 0.8)
    scene.world = sky(_LOOK)
    add_haze(scene, *_LOOK.haze)


def _open_summit(scene: bpy.types.Scene, land: Terrain, eye: NDArray[np.float64], forward: NDArray[np.float64]) -> None:
    """A meadow with a few trees before the eye, and a figure that looks over the valley."""
    right = np.array([forward[1], -forward[0]])

    def place(ahead: float, beside: float) -> tuple[float, float, float]:
        x, y = (eye + ahead * forward + beside * right).tolist()
        return x, y, float(land.height(x, y)) + _LIFT

    for species, seed, (ahead, beside), scale in _NEAR:
        stage.plant(scene, species, seed, place(ahead, beside), 2.4 * seed, scale)
    add_figure(scene, place(*_FIGURE)).rotation_euler.z = np.pi - _AZIMUTH
    middle = eye + _AHEAD * forward
    for name, side, hole in (("Near", _MEADOW, 0.0), ("Summit", 2.0 * _MEADOW, _MEADOW)):
        mesh, _, _ = grid(name, side, 2.0, hole, lambda x, y: land.height(x + middle[0], y + middle[1]) + _LIFT)
        top = bpy.data.objects.new(name, mesh)
        top.location = *middle, 0.0
        scene.collection.objects.link(top)
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        some = populations.add_population(scene, [top], name=name)
        run_to_end(cover.cover_steps(scene, depsgraph, some, grounds=[top]))


def _forbid(surface: bpy.types.Object, middle: NDArray[np.float64], level: float) -> None:
    """Let no tree grow on the summit or in the lake."""
    points = np.zeros(3 * len(surface.data.vertices), np.float32)
    surface.data.vertices.foreach_get("co", points)
    x, y, z = points.reshape(-1, 3).T
    dry = np.clip((z - level) / _SHORE - 0.5, 0.0, 1.0)
    away = np.clip((np.hypot(x - middle[0], y - middle[1]) - _CLEAR) / 12.0, 0.0, 1.0)
    write(surface.data, _MASK, (dry * away).astype(np.float32))


def _lake(scene: bpy.types.Scene, land: Terrain, level: float) -> None:
    """Still water where the land is lowest."""
    (width, length), mesh = land.size, bpy.data.meshes.new("Lake")
    corners = [(0.0, 0.0), (width, 0.0), (width, length), (0.0, length)]
    mesh.from_pydata([(x, y, level) for x, y in corners], [], [(0, 1, 2, 3)])
    mesh.materials.append(_water())
    scene.collection.objects.link(bpy.data.objects.new("Lake", mesh))


def _water() -> bpy.types.Material:
    """Dark, and as smooth as wind on a calm morning leaves it."""
    material = bpy.data.materials.new("Water")
    nodes, links = stage.cleared(material)
    surface, output = nodes.new("ShaderNodeBsdfPrincipled"), nodes.new("ShaderNodeOutputMaterial")
    surface.inputs["Base Color"].default_value = (0.012, 0.02, 0.02, 1.0)
    surface.inputs["Roughness"].default_value, surface.inputs["IOR"].default_value = 0.12, 1.33
    links.new(surface.outputs[0], output.inputs["Surface"])
    return material


def _plant(scene: bpy.types.Scene, surface: bpy.types.Object, land: Terrain, plants: int) -> None:
    """Broadleaved trees up to two thirds of the height, conifers from the middle on, both in stands and glades."""
    add_field = plant_objects.add_field
    bpy.context.view_layer.update()
    ground = terrain.read_ground([surface], bpy.context.evaluated_depsgraph_get(), vertex_group=_MASK)
    low, high = float(land.heights.min()), float(land.heights.max())
    common = {"min_distance": 2.0, "scale_min": 0.75, "scale_max": 1.4, "clump_size": 110.0}
    valleys = places.place(
        ground,
        rules.Rules(
            count=plants * 3 // 5,
            seed=1,
            altitude_max=low + 0.7 * (high - low),
            altitude_falloff=0.25 * (high - low),
            clumping=0.95,
            weights=tuple(VALLEYS.values()),
            **common,
        ),
    )
    heights = places.place(
        ground,
        rules.Rules(
            count=plants - len(valleys),
            seed=2,
            altitude_min=low + 0.35 * (high - low),
            altitude_falloff=0.25 * (high - low),
            clumping=0.8,
            scale_at_top=0.8,
            weights=tuple(HEIGHTS.values()),
            **common,
        ),
        valleys.position,
    )
    add_field(scene, valleys, tuple(VALLEYS))
    add_field(scene, heights, tuple(HEIGHTS))


def render_million(
    path: Path, plants: int = PLANTS, width: int = WIDTH, samples: int = 24, memory: float = MEMORY
) -> dict[str, float]:
    """Refine and render it in a file of its own, in Cycles, within so many gigabytes.

    Returns
    -------
    dict
        Plants, polygons if expanded, polygons and facets that were made, and seconds.
    """
    session.clean_file()
    scene = bpy.context.scene
    build(scene, plants, width)
    scene.tetflora.max_memory = memory
    begin = time.perf_counter()
    statistics = render(path, (width, width * 9 // 16), samples, gray=_LOOK.gray)
    refine_s = sum(statistics.seconds.values())
    return {
        "plants": statistics.plants,
        "polygons_full": statistics.polygons_full,
        "polygons": statistics.polygons_meshed,
        "facets": statistics.polygons_proxy,
        "refine_s": refine_s,
        "render_s": time.perf_counter() - begin - refine_s,
    }


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=PLANTS)
    parser.add_argument("--width", type=int, default=WIDTH)
    parser.add_argument("--samples", type=int, default=24)
    parser.add_argument("--memory", type=float, default=MEMORY, help="gigabytes for plants and renderer")
    parser.add_argument("--output", type=Path, default=Path("out") / "million.png")
    arguments = parser.parse_args()
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    made = render_million(
        arguments.output.resolve(), arguments.plants, arguments.width, arguments.samples, arguments.memory
    )
    print(", ".join(f"{name} {value:,.1f}" for name, value in made.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
