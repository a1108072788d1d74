# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A mixed wood at the edge of a meadow, on covered ground, from 400 m to one leaf of an oak.

    python -m examples.wood            # docs/images/dolly.jpg
    python -m examples.wood --out out/dolly.jpg --width 240

Every picture is refined for its own camera, from one and the same scene.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from . import stage
from .close_ups import face_on_leaf, render
from .paper.pictures import save_sheet

SIZE, SAMPLES = (480, 270), 32
#: Width of a picture on the sheet, pixels.
_CELL = 372
#: Distances of the eight pictures from the leaf, meters.
DISTANCES = tuple(np.geomspace(400.0, 0.15, 8).tolist())
#: Relative numbers of the species; how far from each other they stand at least, meters, and how many on a hectare.
TREES = {"beech": 0.32, "oak": 0.2, "birch": 0.14, "hornbeam": 0.12, "hazel": 0.12, "spruce": 0.06, "rowan": 0.04}
_APART, _DENSITY = 3.4, 520.0
#: How much the trees have grown as between others.
_HABIT = 0.6
#: Brightness of the sky to the camera over that of its light: on film it is not as bright as its light on leaves.
_SEEN = 0.62
#: Side of the land, and of the part around the oak and the eye of which every blade is planted, meters.
LAND, NEAR = 800.0, 150.0
#: Where the camera stands in the wood, and where it looks.
_EYE, _AHEAD = (24.0, 22.0, 1.65), (38.0, 52.0, 3.6)
#: Direction from the leaf to the camera.
TOWARD = np.array([0.16, -0.98, 0.12]) / np.linalg.norm([0.16, 0.98, 0.12])
_ELEVATION, _AZIMUTH = 38.0, 236.0
_SKY = 0.9
#: Mean of the picture of what is seen from afar, which lies in the sun, and from nearer.
_WIDE, _CLOSER = 0.4, 0.34
_MASK = "wood"
#: Of places x, y (n,) in meters.
Heights = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def height(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the land, meters: a meadow that waves a little, and a hill behind the wood."""
    waves = 0.9 * np.sin(0.021 * x + 0.4) * np.cos(0.027 * y + 0.3) + 0.16 * np.sin(0.11 * x - 0.09 * y)
    hill = 46.0 * np.clip((y - 40.0) / 340.0, 0.0, 1.0) ** 1.5 * (1.0 + 0.3 * np.sin(0.012 * x + 1.2))
    return waves * np.clip(np.hypot(x, y) / 30.0, 0.15, 1.0) + hill


def wooded(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the wood is, 0 to 1: its edge waves behind the oak."""
    edge = 13.0 + 7.0 * np.sin(0.043 * x + 0.8) + 3.0 * np.sin(0.13 * x)
    return np.clip((y - edge) / 5.0, 0.0, 1.0)


def build(scene: bpy.types.Scene) -> None:
    """Fill an empty scene with land, wood, meadow, an oak of its own at the origin, sun and sky."""
    from tetflora_addon.blender.placing import first_forest

    stage.plant(scene, "oak", 1, (0.0, 0.0, float(height(np.zeros(1), np.zeros(1))[0])), name="The oak")
    for name, side, step, hole in (("Near", NEAR, 2.5, 0.0), ("Far", LAND, 5.0, NEAR)):
        ground = land(scene, name, side, step, hole, height, {_MASK: wooded})
        cover_all(scene, add_wood(scene, ground, _MASK, TREES, _APART, _DENSITY, (0.6, 1.15), _HABIT))
    stage.sun(scene, _ELEVATION, _AZIMUTH - 180.0)
    scene.world = first_forest.sky("Sky over the wood")
    background = next(node for node in scene.world.node_tree.nodes if node.type == 'BACKGROUND')
    seen_less(scene.world.node_tree, background, _SKY, _SEEN)
    stage.camera(scene, _EYE, _AHEAD, near=0.01, far=2000.0)
    scene.view_settings.look = 'AgX - Medium High Contrast'
    scene.tetflora.refine_at_render = False


def grid(
    name: str,
    side: float,
    step: float,
    hole: float,
    height: Heights,
    nearest: float = -np.inf,
) -> tuple[bpy.types.Mesh, NDArray[np.float64], NDArray[np.float64]]:
    """A mesh of squares with a square hole in its middle, of sides in meters, and the places x, y (n,) of its vertices.

    Faces in front of a ``nearest`` y are left out.
    """
    number = round(side / step) + 1
    along = np.linspace(-side / 2, side / 2, number)
    x, y = (values.reshape(-1) for values in np.meshgrid(along, along))
    first = (np.arange(number - 1)[:, None] * number + np.arange(number - 1)).reshape(-1)
    faces = np.stack([first, first + 1, first + number + 1, first + number], axis=1)
    middle = np.maximum(np.abs(x[faces].mean(axis=1)), np.abs(y[faces].mean(axis=1)))
    kept = faces[(middle >= hole / 2) & (y[faces].mean(axis=1) > nearest)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.stack([x, y, height(x, y)], axis=1).tolist(), [], kept.tolist(), shade_flat=False)
    return mesh, x, y


def land(
    scene: bpy.types.Scene,
    name: str,
    side: float,
    step: float,
    hole: float,
    height: Heights,
    masks: dict[str, Heights],
    nearest: float = -np.inf,
) -> bpy.types.Object:
    """An object as of `grid`, with an attribute for each mask, which says from 0 to 1 where something grows."""
    from tetflora_addon.blender.attributes import write

    mesh, x, y = grid(name, side, step, hole, height, nearest)
    for mask, values in masks.items():
        write(mesh, mask, values(x, y).astype(np.float32))
    made = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(made)
    return made


def add_wood(
    scene: bpy.types.Scene,
    ground: bpy.types.Object,
    mask: str,
    mix: dict[str, float],
    apart: float,
    density: float,
    scales: tuple[float, float],
    habit: float,
) -> bpy.types.PropertyGroup:
    """Plant species with relative numbers where an attribute says, some meters apart, at most so many on a hectare."""
    from tetflora_addon.blender.placing import populations
    from tetflora_addon.blender.species.edits import in_wood
    from tetflora_addon.blender.worker import run_to_end

    some = populations.add_population(scene, [ground], name=f"{ground.name} {mask}")
    for species, weight in mix.items():
        entry = some.mix.add()
        entry.species, entry.weight = in_wood(scene, species, habit), weight
    some.vertex_group, some.min_distance = mask, apart
    some.by_density, some.density = True, density
    some.scale_min, some.scale_max, some.seed = *scales, 3
    run_to_end(populations.make_plants_steps(scene, bpy.context.evaluated_depsgraph_get(), some))
    bpy.context.view_layer.update()
    return some


def cover_all(scene: bpy.types.Scene, population: bpy.types.PropertyGroup) -> None:
    """Cover all of a population's ground."""
    from tetflora_addon.blender.placing import cover
    from tetflora_addon.blender.worker import run_to_end

    depsgraph = bpy.context.evaluated_depsgraph_get()
    run_to_end(cover.cover_steps(scene, depsgraph, population, masks={"vertex_group": ""}))


def seen_less(tree: bpy.types.NodeTree, background: bpy.types.ShaderNode, strength: float, seen: float) -> None:
    """A sky of some strength that the camera sees by a factor less bright."""
    path, factor = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeMapRange")
    factor.inputs["To Min"].default_value, factor.inputs["To Max"].default_value = strength, strength * seen
    tree.links.new(path.outputs["Is Camera Ray"], factor.inputs["Value"])
    tree.links.new(factor.outputs[0], background.inputs["Strength"])


def aim(scene: bpy.types.Scene, target: Vector, eye: Vector, lens: float) -> None:
    """Look from one place to another."""
    scene.camera.data.lens = lens
    stage.look(scene, eye, target)
    bpy.context.view_layer.update()


def leaf_of_the_oak(scene: bpy.types.Scene) -> Vector:
    """Middle of a leaf of the oak that stands out toward the camera and faces it and the sun."""
    from tetflora_addon.compiled.flora import compile_species
    from tetflora_addon.species import catalog

    flora = compile_species([catalog.load_species("oak")])
    return Vector(face_on_leaf(flora, "oak", TOWARD, lowest=1.2)) + scene.objects["The oak"].location


def render_dolly(path: Path, size: tuple[int, int] = SIZE, samples: int = SAMPLES) -> None:
    """Eight pictures from 400 m to the leaf, as a sheet of two rows; in an empty scene."""
    scene = bpy.context.scene
    build(scene)
    leaf = leaf_of_the_oak(scene)
    with tempfile.TemporaryDirectory() as folder:
        cells = []
        for distance in DISTANCES:
            # A lens that shows the whole oak at 16 m, and a leaf at a hand's width.
            aim(scene, leaf, leaf + Vector(TOWARD * distance), 40.0)
            cells.append((Path(folder) / f"{len(cells)}.png", f"{float(f'{distance:.2g}'):g} m"))
            render(cells[-1][0], size, samples, gray=_WIDE if distance > NEAR else _CLOSER)
        save_sheet(cells, 4, path, _CELL)


if __name__ == "__main__":
    stage.make_picture(__doc__, "dolly.jpg", SIZE, SAMPLES, render_dolly)
