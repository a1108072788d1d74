# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Top view of the partition (the paper's figure 5): tetrahedra by decision, polygons that were made, view pyramid."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from devtools.partition import partition
from tetflora_addon.blender.scene.plants import read_plants
from tetflora_addon.refinement import decisions

from . import stage

#: Colors of the lines by decision, linear RGB, and the height at which they lie, so that the rarer are on top.
STYLES = {
    "PROXY": ((0.95, 0.45, 0.05), 2.0, 0.3),
    "HIDDEN": ((0.35, 0.38, 0.45), 1.0, 0.25),
    "EXPLICIT": ((0.02, 0.30, 0.75), 3.0, 0.25),
    "PYRAMID": ((0.75, 0.02, 0.05), 4.0, 0.9),
}
_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])


def render_top_view(scene: bpy.types.Scene, path: Path, width: int = 1600, samples: int = 16) -> None:
    """Render a scene from above with its partition drawn over it; the scene is left as it was.

    Parameters
    ----------
    scene : bpy.types.Scene
        Holds the results of Refine, whose meshes are shown.
    path : Path
        PNG to write.
    width : int
        Pixels; the height follows from the partition's shape.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    camera, result = partition(scene, depsgraph)
    decision = decisions.Decision
    drawing = bpy.data.scenes.new("Top view")
    try:
        plants = read_plants(scene, depsgraph)[0]
        far = np.linalg.norm(plants.position[:, :2] - camera.position[:2], axis=1).max() + 20
        center_line = plants.position[:, :2].mean(axis=0) - camera.position[:2]
        center_line /= np.linalg.norm(center_line)
        top = 500.0
        for name, (color, layer, thickness) in STYLES.items():
            if name == "PYRAMID":
                lines = _pyramid(camera, far)
            else:
                nodes = result.nodes[(result.decision == decision[name]) & result.tree.inside[result.nodes]]
                lines = result.tree.vertices(nodes)[:, _EDGES].reshape(-1, 2, 3)[:, :, :2]
            _add_lines(drawing, name, lines, top + layer, thickness, color)
        for shown in scene.objects:
            if "tetflora_kind" in shown:
                drawing.collection.objects.link(shown)
        _add_camera(drawing, camera.position[:2], center_line, far, width)
        _settings(drawing, path, samples)
        bpy.ops.render.render(write_still=True, scene=drawing.name)
    finally:
        _remove(drawing)


def _pyramid(camera: object, far: float) -> NDArray[np.float64]:
    """The outline of the view pyramid, seen from above, (3, 2, 2)."""
    left, right, _, _ = camera.window
    ends = [camera.position + far * (camera.frame @ np.array([x, 0.0, -1.0])) for x in (left, right)]
    return np.array([[camera.position, ends[0]], [camera.position, ends[1]], ends])[:, :, :2]


def _add_lines(
    scene: bpy.types.Scene, name: str, lines: NDArray, z: float, thickness: float, color: tuple[float, float, float]
) -> None:
    """Lines (n, 2, 2) as flat, glowing rectangles."""
    along = lines[:, 1] - lines[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    keep = length[:, 0] > 1e-6
    lines, along = lines[keep], along[keep] / length[keep]
    aside = np.stack([-along[:, 1], along[:, 0]], axis=1) * thickness / 2
    corners = np.stack([lines[:, 0] - aside, lines[:, 1] - aside, lines[:, 1] + aside, lines[:, 0] + aside], axis=1)
    points = np.concatenate([corners.reshape(-1, 2), np.full((4 * len(lines), 1), z)], axis=1)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], np.arange(4 * len(lines)).reshape(-1, 4).tolist())
    material = bpy.data.materials.new(name)
    nodes, links = stage.cleared(material)
    glow, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    glow.inputs["Color"].default_value = (*color, 1.0)
    links.new(glow.outputs[0], out.inputs["Surface"])
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new(name, mesh))


def _add_camera(scene: bpy.types.Scene, eye: NDArray, forward: NDArray, far: float, width: int) -> None:
    """Look down with the viewer at the left, as in the paper."""
    camera = bpy.data.objects.new("Top", bpy.data.cameras.new("Top"))
    camera.data.type, camera.data.ortho_scale, camera.data.clip_end = 'ORTHO', far * 1.06, 5000.0
    middle = eye + forward * far * 0.5
    turn = Matrix.Rotation(float(np.arctan2(forward[1], forward[0])), 4, 'Z')
    camera.matrix_world = Matrix.Translation((*middle, 1000.0)) @ turn
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = width, int(width * 0.34)
    sun = bpy.data.objects.new("Top sun", bpy.data.lights.new("Top sun", 'SUN'))
    sun.data.energy = 3.0
    scene.collection.objects.link(sun)
    stage.even_sky(scene)


def _settings(scene: bpy.types.Scene, path: Path, samples: int) -> None:
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising = samples, False
    scene.cycles.max_bounces = 1
    scene.view_settings.view_transform = 'Standard'
    scene.render.image_settings.file_format = 'PNG'
    scene.render.filepath = str(path)


def _remove(scene: bpy.types.Scene) -> None:
    """Remove the drawing scene and what only it uses."""
    own = [o for o in scene.objects if "tetflora_kind" not in o]
    data = [o.data for o in own]
    materials = [m for d in data if isinstance(d, bpy.types.Mesh) for m in d.materials]
    bpy.data.batch_remove([*own, *([scene.world] if scene.world else []), *data, *materials])
    bpy.data.scenes.remove(scene)
