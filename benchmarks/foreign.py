# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees that no species of ours grew, as explicit meshes: refined against the originals at three distances.

The trees are plain triangles as other tools export them: open tubes, a card for each leaf, some faces without area and
some edges with three faces.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from examples.daylight import add_daylight
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import refine

from .compare import difference, plant_mask
from .report import Targets, peak_mb
from .row80 import timed_refine, timed_render

TREES, QUICK_TREES = 18, 6
SAMPLES, QUICK_SAMPLES = 64, 8
#: Meters from the eye to the foremost trees.
DISTANCES = (15.0, 60.0, 240.0)
#: Children of a branch, their length in relation to it, segments and sides of their tubes, by order.
ORDERS = ((1, 9.0, 12, 8), (26, 0.42, 6, 6), (12, 0.4, 4, 5), (9, 0.45, 3, 4))
LEAVES, LEAF_LENGTH = 26, 0.11

TARGETS: Targets = {
    "triangles": {"min": 4_000_000},
    "area_error": {"max": 1e-6},
    "flip_max": {"max": 0.08},
}
QUICK_TARGETS: Targets = {"area_error": {"max": 1e-6}}


def foreign_tree() -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """A tree by recursion.

    Returns
    -------
    positions : (v, 3) float64
    triangles : (t, 3) int64
    uv : (v, 2) float64
    material : (t,) int64
        0 bark, 1 leaves.
    """
    rng = np.random.default_rng(7)
    base, axis, length, radius = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.array([9.0]), np.array([0.22])
    parts = []
    for order, (number, ratio, segments, sides) in enumerate(ORDERS):
        if order:
            parent = np.repeat(np.arange(len(base)), number)
            t = rng.uniform(0.3 if order == 1 else 0.15, 1.0, len(parent))
            out = _across(axis[parent], rng)
            lean = np.radians(rng.uniform(40, 75, len(parent)))[:, None]
            base = base[parent] + (t * length[parent])[:, None] * axis[parent]
            axis = np.cos(lean) * axis[parent] + np.sin(lean) * out
            length = ratio * length[parent] * (1.1 - 0.6 * t) * rng.uniform(0.7, 1.2, len(parent))
            radius = radius[parent] * 0.35
        parts.append((*_tubes(base, axis, length, radius, segments, sides), 0))
    parent = np.repeat(np.arange(len(base)), LEAVES)
    stalk = base[parent] + (rng.uniform(0, 1, len(parent)) * length[parent])[:, None] * axis[parent]
    parts.append((*_cards(stalk, axis[parent], rng), 1))
    first = np.cumsum([0] + [len(p[0]) for p in parts[:-1]])
    material = np.concatenate([np.full(len(p[1]), p[3]) for p in parts])
    triangles = np.concatenate([p[1] + f for p, f in zip(parts, first, strict=True)])
    return np.concatenate([p[0] for p in parts]), triangles, np.concatenate([p[2] for p in parts]), material


def _across(axis: NDArray, rng: np.random.Generator) -> NDArray[np.float64]:
    out = np.cross(axis, rng.normal(size=axis.shape))
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def _tubes(base: NDArray, axis: NDArray, length: NDArray, radius: NDArray, segments: int, sides: int) -> tuple:
    a = np.cross(axis, np.where(np.abs(axis[:, :1]) < 0.8, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(axis, a)
    t, turn = np.linspace(0, 1, segments + 1), np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.cos(turn)[None, :, None] * a[:, None] + np.sin(turn)[None, :, None] * b[:, None]
    middle = base[:, None] + (length[:, None] * t)[:, :, None] * axis[:, None]
    thick = (radius[:, None] * (1 - 0.7 * t))[:, :, None, None]
    positions = (middle[:, :, None] + thick * ring[:, None]).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(segments), np.arange(sides), indexing="ij")
    here, beside = i * sides + j, i * sides + (j + 1) % sides
    one = np.stack([here, beside, beside + sides, here, beside + sides, here + sides], axis=-1).reshape(-1, 3)
    triangles = (one[None] + (np.arange(len(base)) * (segments + 1) * sides)[:, None, None]).reshape(-1, 3)
    uv = np.stack(np.broadcast_arrays(turn[None, None] / 6.28, t[None, :, None], length[:, None, None])[:2], axis=-1)
    return positions, triangles, uv.reshape(-1, 2)


def _cards(stalk: NDArray, axis: NDArray, rng: np.random.Generator) -> tuple:
    out = _across(axis, rng)
    along = LEAF_LENGTH * rng.uniform(0.7, 1.2, (len(stalk), 1)) * (out + 0.5 * axis)
    wide = 0.25 * np.cross(along, rng.normal(size=along.shape) + [0.0, 0.0, 1.5])
    wide *= 0.2 * np.linalg.norm(along, axis=1, keepdims=True) / np.linalg.norm(wide, axis=1, keepdims=True)
    corners = np.stack([stalk - wide, stalk + wide, stalk + along + wide, stalk + along - wide], axis=1)
    corners[::400, 1] = corners[::400, 0]  # leaves that somebody scaled away across
    corners[::400, 2] = corners[::400, 3]
    first = 4 * np.arange(len(stalk))[:, None]
    triangles = np.concatenate(
        [first + [0, 1, 2], first + [0, 2, 3], first[::300] + [0, 2, 1]]
    )  # the last: three faces
    return corners.reshape(-1, 3), triangles, np.tile([[0, 0], [1, 0], [1, 1], [0, 1]], (len(stalk), 1))


def build(scene: bpy.types.Scene, trees: int) -> list[bpy.types.Object]:
    """A grove of instances of the tree, three deep, with camera and light; returns them."""
    positions, triangles, uv, material = foreign_tree()
    mesh = bpy.data.meshes.new("Foreign tree")
    mesh.vertices.add(len(positions))
    mesh.loops.add(triangles.size)
    mesh.polygons.add(len(triangles))
    mesh.attributes["position"].data.foreach_set("vector", positions.astype(np.float32).ravel())
    mesh.attributes[".corner_vert"].data.foreach_set("value", triangles.astype(np.int32).ravel())
    mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    mesh.polygons.foreach_set("material_index", material.astype(np.int32))
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uv[triangles.ravel()].astype(np.float32).ravel())
    mesh.update(calc_edges=True)
    mesh.shade_flat()
    for name, color in (("Foreign bark", (0.16, 0.11, 0.07)), ("Foreign leaf", (0.13, 0.3, 0.06))):
        mesh.materials.append(_material(name, color))
    rng = np.random.default_rng(3)
    made = []
    for i in range(trees):
        tree = bpy.data.objects.new(f"Foreign tree {i:02d}", mesh)
        tree.location = (9.0 * (i // 3) - 4.5 * (trees // 3) + rng.uniform(-2, 2), 8.0 * (i % 3), 0.0)
        tree.rotation_euler.z, tree.scale = rng.uniform(0, 6.28), (rng.uniform(0.8, 1.15),) * 3
        tree.tetflora.is_explicit = True
        scene.collection.objects.link(tree)
        made.append(tree)
    bpy.ops.mesh.primitive_plane_add(size=4000.0)
    bpy.context.object.data.materials.append(_material("Meadow", (0.12, 0.16, 0.06)))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.clip_end = 3000.0
    scene.collection.objects.link(camera)
    scene.camera = camera
    add_daylight(scene, elevation=38.0, azimuth=140.0)
    scene.view_settings.exposure = 0.8
    return made


def _material(name: str, color: tuple[float, float, float]) -> bpy.types.Material:
    """Principled with an image, as exporters write it."""
    image = bpy.data.images.new(name, 64, 64)
    shade = 0.7 + 0.6 * np.random.default_rng(1).random((64, 64, 1))
    encoded = 1.055 * (shade * np.array(color)) ** (1 / 2.4) - 0.055
    image.pixels.foreach_set(np.concatenate([encoded, np.ones((64, 64, 1))], axis=2).astype(np.float32).ravel())
    image.pack()
    material = bpy.data.materials.new(name)
    tree = compat.shader_tree(material)
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    principled = next(node for node in tree.nodes if node.type == 'BSDF_PRINCIPLED')
    principled.inputs["Roughness"].default_value = 1.0
    principled.inputs["Specular IOR Level"].default_value = 0.0
    tree.links.new(texture.outputs["Color"], principled.inputs["Base Color"])
    return material


def _area(tree: bpy.types.Object) -> float:
    """Area of a tree in the world, m², computed here alone."""
    mesh = tree.data
    positions, verts = np.zeros((len(mesh.vertices), 3), np.float32), np.zeros((len(mesh.polygons), 3), np.int32)
    mesh.vertices.foreach_get("co", positions.ravel())
    mesh.loops.foreach_get("vertex_index", verts.ravel())
    corners = positions.astype(np.float64)[verts] @ np.array(tree.matrix_world)[:3, :3].T
    return float(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    )


def _aim(scene: bpy.types.Scene, distance: float) -> None:
    eye, target = Vector((-distance / 6, -distance, 1.7 + distance / 25)), Vector((0.0, 8.0, 4.5))
    scene.camera.location = eye
    scene.camera.rotation_euler = (target - eye).to_track_quat('-Z', 'Y').to_euler()
    scene.camera.data.lens = 30.0 if distance < 100 else 70.0


def run(quick: bool) -> dict[str, float]:
    """Measure; `flip_<distance>` are masked means, `area_error` and `flip_noise` those of the middle one."""
    scene = bpy.context.scene
    trees = build(scene, QUICK_TREES if quick else TREES)
    samples = QUICK_SAMPLES if quick else SAMPLES
    scene.render.resolution_x, scene.render.resolution_y = 480, 270
    scene.render.resolution_percentage = 50 if quick else 100
    scene.tetflora.refine_at_render = False
    bpy.context.view_layer.update()
    area = sum(map(_area, trees))
    figures: dict[str, float] = {"triangles": len(trees) * len(trees[0].data.polygons)}
    flips, seconds = [], []
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        for distance in DISTANCES:
            _aim(scene, distance)
            name = f"{distance:g}m"
            refine.clear(scene)
            original_s = timed_render(scene, out / "original.png", samples)
            if distance == DISTANCES[1]:
                timed_render(scene, out / "again.png", samples, seed=1)
            statistics, refine_s = timed_refine(scene)
            figures[f"polygons_{name}"] = statistics.polygons_meshed + statistics.polygons_proxy
            figures[f"refine_s_{name}"] = refine_s
            refined_s = timed_render(scene, out / "refined.png", samples)
            mask = plant_mask(scene, out / "mask.png")
            flips.append(difference(out / "original.png", out / "refined.png", mask).flip)
            figures[f"flip_{name}"] = flips[-1]
            if distance == DISTANCES[1]:
                figures["flip_noise"] = difference(out / "original.png", out / "again.png", mask).flip
            seconds.append((original_s, refined_s))
        refine.clear(scene)
        _aim(scene, DISTANCES[1])
        _, refinement = refine.partition(scene, bpy.context.evaluated_depsgraph_get())
        held = refinement.contents.polygons.items
        figures["fragments"] = int((held.part >= 0).sum())
        figures["area_error"] = abs(held.areas().sum() / area - 1)
    return {
        **figures,
        "flip_max": max(flips),
        "render_original_s": sum(s for s, _ in seconds),
        "render_refined_s": sum(s for _, s in seconds),
        "peak_mb": peak_mb(),
    }
