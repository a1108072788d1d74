# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From 400 m to one leaf: nothing pops beside what pops in plants that are all there, and margins are true.

Each frame is refined on its own, and expanded with the detail that the same rule asks for. What counts is by how much
more refined frames differ from each other than expanded ones. Margins are measured on what was drawn: leaves that are
long in the image are laid over the finest evaluation of their own variant.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from examples import stage
from tetflora_addon import memory
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.job.plant_mesh import single_seed
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.emission.plants import expanded_blocks
from tetflora_addon.growth.hashing import Draw, uniform
from tetflora_addon.leaves.levels import LeafLevel, leaf_levels
from tetflora_addon.leaves.outlines import distance_to_links
from tetflora_addon.species import catalog
from tetflora_addon.subplants.leaf_meshes import LeafCopies

from .pictures import flip_map, read_picture, render
from .report import Targets, forget_peak, peak_mb

FRAMES, QUICK_FRAMES = 60, 6
FAR, NEAR = 400.0, 0.15
SIZE, QUICK_SIZE = (640, 360), (320, 180)
SAMPLES, QUICK_SAMPLES = 16, 4
#: The tree of the leaf, and what stands behind it.
TREE, BEHIND, NUMBER = "oak", ("oak", "beech", "birch", "spruce", "maple"), 14
#: Leaves of so many pixels are near, and so many of a frame are measured, the longest.
_LONG, _MEASURED = 40.0, 60

TARGETS: Targets = {
    "flip_steps_max": {"max": 0.01},
    "polygons_max": {"max": 6_000_000},
    "peak_mb": {"max": 3000},
    "silhouette_px_max": {"max": 2.0},
}


@dataclass(frozen=True)
class Drawn:
    """Leaves (n) of one finer level, as they were written."""

    shapes: NDArray[np.float32]
    model: object
    key: NDArray[np.uint64]
    position: NDArray[np.float64]
    frame: NDArray[np.float32]
    size: NDArray[np.float64]


def run(quick: bool) -> dict[str, float]:
    """Measure; see the table in ``docs/measurements.md`` for what the figures mean."""
    scene = bpy.context.scene
    target, toward = build(scene, QUICK_SIZE if quick else SIZE)
    distances = np.geomspace(FAR, NEAR, QUICK_FRAMES if quick else FRAMES)
    samples = QUICK_SAMPLES if quick else SAMPLES
    pictures: dict[bool, list[NDArray]] = {False: [], True: []}
    polygons, silhouettes, peak = [], [], 0.0
    with tempfile.TemporaryDirectory() as folder:
        for distance in distances:
            place(scene, target, toward, float(distance))
            refine.clear(scene)  # or what was expanded would count, and copies of it that the last render made
            bpy.context.view_layer.update()
            memory.give_back()
            forget_peak()
            with recording(scene) as drawn:
                statistics = _made(scene, expand=False)
            peak = max(peak, peak_mb())
            polygons.append(statistics.polygons_meshed + statistics.polygons_proxy)
            silhouettes.append(silhouette_pixels(scene, drawn))
            for expand in (False, True):
                if expand:
                    _made(scene, expand=True)
                render(scene, Path(folder) / "frame.png", samples)
                pictures[expand].append(read_picture(Path(folder) / "frame.png"))
    steps = np.array([[float(flip_map(a, b).mean()) for a, b in itertools.pairwise(p)] for p in pictures.values()])
    beyond = steps[0] - steps[1]
    apart = [float(flip_map(b, a).mean()) for a, b in zip(*pictures.values(), strict=True)]
    return {
        "frames": len(distances),
        "flip_steps_max": float(beyond.max()),
        "flip_steps_mean": float(beyond.mean()),
        "flip_steps_max_at_m": float(distances[1:][beyond.argmax()]),
        "flip": float(np.mean(apart)),
        "polygons_max": int(max(polygons)),
        "polygons_nearest": int(polygons[-1]),
        "peak_mb": peak,
        "silhouette_px_max": float(max(silhouettes)),
        "leaves_measured_frames": int(np.count_nonzero(silhouettes)),
    }


def build(scene: bpy.types.Scene, size: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A tree before others; a leaf of it (3,), and the direction (3,) from it to the camera."""
    toward = np.array([0.5, -0.85, 0.1]) / np.linalg.norm([0.5, -0.85, 0.1])
    number = np.arange(1, NUMBER + 1)
    away, turn = 6.0 * np.sqrt(number + 1.0), 2.399963 * number
    places = np.stack([away * np.cos(turn), away * np.sin(turn), np.zeros(NUMBER)], axis=1)
    places = places[places @ toward < -4.0]  # behind it, as seen from the camera
    for i, (x, y, z) in enumerate([(0.0, 0.0, 0.0), *places]):
        stage.plant(scene, BEHIND[i % len(BEHIND)] if i else TREE, 1 + i, (x, y, z), turn[i] if i else 0.0)
    bpy.ops.mesh.primitive_plane_add(size=2000.0)
    stage.camera(scene, toward, (0.0, 0.0, 0.0), size, lens=50.0, near=0.01, far=2000.0)
    stage.daylight(scene, elevation=40.0, azimuth=-60.0)
    scene.tetflora.refine_at_render = False
    return leaf_of(TREE, toward), toward


def leaf_of(species: str, toward: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the outermost leaf (3,) of the lower half of a plant is, as seen from a direction (3,)."""
    flora = compile_species([catalog.load_species(species)])
    blocks = expanded_blocks(flora, single_seed(species, 1))
    points = np.concatenate([block.buffers.positions for block in blocks if block.kind == "leaf"]).astype(np.float64)
    low = points[points[:, 2] < np.median(points[:, 2])]
    return low[(low @ (toward * [1.0, 1.0, 0.0])).argmax()]


def place(scene: bpy.types.Scene, target: NDArray[np.float64], toward: NDArray[np.float64], distance: float) -> None:
    """Move the camera."""
    scene.camera.location = target + distance * toward
    bpy.context.view_layer.update()


def _made(scene: bpy.types.Scene, expand: bool) -> object:
    scene.tetflora.expand_everything = expand
    return refine.refine(scene, bpy.context.evaluated_depsgraph_get())


@contextmanager
def recording(scene: bpy.types.Scene) -> Iterator[list[Drawn]]:
    """While it lasts, leaves of finer levels are noted as they are written; by this process, not by others."""
    drawn: list[Drawn] = []
    add, threads = LeafCopies.add, (scene.render.threads_mode, scene.render.threads)
    scene.render.threads_mode, scene.render.threads = 'FIXED', 1

    def noted(self: LeafCopies, key, position, frame, size, *rest: object) -> None:
        if isinstance(self.of, LeafLevel):
            drawn.append(Drawn(self.shapes, self.model, key, position, frame, size))
        add(self, key, position, frame, size, *rest)

    LeafCopies.add = noted
    try:
        yield drawn
    finally:
        LeafCopies.add = add
        scene.render.threads_mode = threads[0]
        if threads[0] == 'FIXED':
            scene.render.threads = threads[1]


def silhouette_pixels(scene: bpy.types.Scene, drawn: list[Drawn]) -> float:
    """Largest distance of the margins of leaves that are long in the image from their own curves, pixels; 0 without."""
    worst = 0.0
    view = np.array(scene.camera.matrix_world.inverted())
    focal = scene.render.resolution_x * scene.camera.data.lens / scene.camera.data.sensor_width
    half = np.array([scene.render.resolution_x, scene.render.resolution_y]) / 2.0
    finest = _finest(drawn)
    for some in drawn:
        middle = some.position @ view[:3, :3].T + view[:3, 3]
        depth = -middle[:, 2]
        pixels = focal * some.size / np.maximum(depth, 1e-6)
        inside = (np.abs(middle[:, :2]) * focal / np.maximum(depth, 1e-6)[:, None] < half).all(axis=1)
        chosen = np.flatnonzero((depth > 0.02) & inside & (pixels > _LONG))
        chosen = chosen[np.argsort(-pixels[chosen], kind="stable")[:_MEASURED]]
        fine = finest.get(id(some.model))
        if fine is None:
            continue
        own, curve = _margin(some.model), fine
        for i in chosen:
            variant = int(uniform(some.key[i : i + 1], Draw.LEAF_VARIANT)[0] * some.shapes.shape[2])
            axes = (some.frame[i].astype(float) * some.size[i]).T

            def seen(points: NDArray, axes: NDArray = axes, at: NDArray = some.position[i]) -> NDArray:
                points = (points @ axes + at) @ view[:3, :3].T + view[:3, 3]
                return focal * points[..., :2] / np.maximum(-points[..., 2:], 0.01)

            lines = seen(some.shapes[:, :, variant][own].astype(float))
            points = seen(curve.shapes[variant].astype(float)[np.unique(_margin(curve.model))])
            off = distance_to_links(points[:, None], lines[None, :, 0], lines[None, :, 1]).min(axis=1)
            worst = max(worst, float(off[(np.abs(points) < half).all(axis=1)].max(initial=0.0)))
    return worst


def _finest(drawn: list[Drawn]) -> dict[int, object]:
    """The finest level of the leaf that each level belongs to, by the identity of the level's model."""
    found = {}
    for name in (TREE, *BEHIND):
        for form in catalog.load_species(name).leaf:
            levels = leaf_levels(form)
            found |= {id(level.model): levels[-1] for level in levels}
    return found


def _margin(model: object) -> NDArray[np.int64]:
    """Edges (e, 2) of one face only, of blades: petioles lie below them in the texture."""
    edges, of_corner = model.edges
    stem = np.zeros(len(edges), bool)
    stem[of_corner[model.uv[:, 1] < -1e-6]] = True
    return edges[(np.bincount(of_corner, minlength=len(edges)) == 1) & ~stem]
