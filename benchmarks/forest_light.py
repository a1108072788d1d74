# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light that comes from plants which nobody sees: on the ground under a wood, in shadows, and in a pond.

Three small scenes. Of each the mean luminance of what receives the light, where no plant stands before it, is compared
between refined and expanded plants. Facets are as large, seen and hidden ones, as in the wood of `forest`, since
these scenes would not exhaust what an image can afford. Images are of light, not of colors as a film shows them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from devtools import session
from tetflora_addon.blender.compat import shader_tree
from tetflora_addon.blender.placing.first_forest import sky
from tetflora_addon.blender.placing.plant_objects import add_field
from tetflora_addon.emission.budget import Detail
from tetflora_addon.planting.places import Placement

from .compare import coverage, read_picture, render
from .forest_case import as_fine_as, detail_of
from .forest_scene import build as build_wood
from .forest_scene import case_of
from .row80 import timed_refine

#: Of the image, of which refinement takes every pixel for as many as this on each side.
WIDTH, HEIGHT, FINER = 480, 270, 4
#: Pixels that plants cover by more than this are not those of the receiver.
_BARE = 0.005
#: The wood.
WOOD = "birch"
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Scene:
    """Where plants stand and what receives their light; the camera stands at the origin and looks north.

    Attributes
    ----------
    wood, receiver : tuple of float
        West, east, south and north border, meters.
    sun : tuple of float
        Elevation, and azimuth from which its light comes (0: north), degrees.
    pitch : float
        Of the camera, degrees below the horizon.
    pond : bool
        The receiver is a mirror.
    """

    wood: Box
    receiver: Box
    sun: tuple[float, float]
    pitch: float
    pond: bool = False


SCENES = {
    "ground": Scene((-14.0, 14.0, 3.0, 31.0), (-10.0, 10.0, 3.0, 25.0), (50.0, 110.0), 8.0),
    "shadow": Scene((-18.0, 18.0, -16.0, -3.0), (-6.0, 6.0, 3.0, 14.0), (30.0, 180.0), 12.0),
    "pond": Scene((-18.0, 18.0, 27.0, 42.0), (-8.0, 8.0, 4.0, 24.0), (45.0, 150.0), 14.0, pond=True),
}
_EYE, _SPACING = 1.7, 5.0
#: Trees that can be expanded by the dozen.
_SPECIES = ("broadleaf_tree", "aspen", "conifer")


def run(folder: Path, samples: int, names: tuple[str, ...] = tuple(SCENES), again: bool = True) -> dict[str, float]:
    """Compare all scenes; again: and expanded plants with themselves, of another seed of the renderer."""
    build_wood(bpy.context.scene, case_of(WOOD))
    detail = detail_of(bpy.context.scene)
    figures = {"light_facet_pixels": detail.facet, "light_hidden_factor": detail.coarser}
    for name in names:
        session.clean_file()
        found = _compared(SCENES[name], detail, folder, samples, again)
        figures |= {f"{key}_{name}": value for key, value in found.items()}
    figures["light_error_max"] = max(abs(figures[f"light_error_{name}"]) for name in names)
    return figures


def _compared(given: Scene, detail: Detail, folder: Path, samples: int, again: bool) -> dict[str, float]:
    scene = bpy.context.scene
    plants = build(scene, given)
    receiver = _within(scene, given.receiver)

    def light(seed: int = 0) -> NDArray[np.float32]:
        return _luminance(scene, folder / "light.exr", samples, seed)

    bare = light()
    scene.render.resolution_percentage = 100 * FINER
    with as_fine_as(detail):
        refined, _ = timed_refine(scene, expand_everything=False)
    scene.render.resolution_percentage = 100
    seen, covered = light(), coverage(scene, folder / "covered.png", 16)
    timed_refine(scene, expand_everything=True)
    expanded, covered = light(), np.maximum(covered, coverage(scene, folder / "covered.png", 16))
    mask = receiver & (covered < _BARE)
    mean = expanded[mask].mean()
    figures = {
        "light_error": float(seen[mask].mean() / mean - 1.0),
        "light_kept": float(mean / bare[mask].mean()),
        "pixels": int(mask.sum()),
        "plants": plants,
        "polygons": refined.polygons_meshed + refined.polygons_proxy,
    }
    if again:
        figures["light_noise"] = float(light(1)[mask].mean() / mean - 1.0)
    return figures


def build(scene: bpy.types.Scene, given: Scene) -> int:
    """Fill an empty scene; how many plants there are."""
    bpy.ops.mesh.primitive_plane_add(size=400.0)
    bpy.context.object.data.materials.append(_material("Earth", "ShaderNodeBsdfDiffuse", (0.3, 0.3, 0.3, 1.0)))
    if given.pond:
        west, east, south, north = given.receiver
        bpy.ops.mesh.primitive_plane_add(size=1.0, location=((west + east) / 2, (south + north) / 2, 0.02))
        pond = bpy.context.object
        pond.scale = east - west, north - south, 1.0
        pond.data.materials.append(_material("Water", "ShaderNodeBsdfGlossy", (0.9, 0.9, 0.9, 1.0)))
    west, east, south, north = given.wood
    x, y = (m.ravel() for m in np.meshgrid(np.arange(west, east + 0.1, _SPACING), np.arange(south, north, _SPACING)))
    rng = np.random.default_rng(4)
    place = np.column_stack([x, y, np.zeros(len(x))])
    place[:, :2] += rng.uniform(-1.0, 1.0, (len(x), 2))
    species = (np.arange(len(x)) % len(_SPECIES)).astype(np.int32)
    turn, size = rng.uniform(0.0, 2.0 * np.pi, len(x)), rng.uniform(0.8, 1.2, len(x))
    add_field(scene, Placement(place, turn, size, species, np.arange(len(x), dtype=np.int32), len(x)), _SPECIES)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    down = np.radians(given.pitch)
    camera.location.z, camera.data.lens, camera.data.clip_end = _EYE, 28.0, 1000.0
    camera.rotation_euler = Vector((0.0, np.cos(down), -np.sin(down))).to_track_quat('-Z', 'Y').to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", 'SUN'))
    elevation, azimuth = np.radians(given.sun)
    sun.data.energy, sun.data.angle = 5.0, np.radians(0.6)
    sun.rotation_euler = np.pi / 2 - elevation, 0.0, np.pi - azimuth
    scene.collection.objects.link(sun)
    scene.world = sky("Sky")
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    scene.tetflora.refine_at_render = False
    bpy.context.view_layer.update()
    return len(x)


def _material(name: str, kind: str, color: tuple[float, float, float, float]) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    tree = shader_tree(material)
    tree.nodes.clear()
    shader, output = tree.nodes.new(kind), tree.nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Color"].default_value, shader.inputs["Roughness"].default_value = color, 0.0
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def _within(scene: bpy.types.Scene, box: Box) -> NDArray[np.bool_]:
    """Pixels (height, width) whose middle is in a box on the ground."""
    camera = scene.camera
    (right, top), (left, low) = (
        np.array(corner)[:2] for corner in (camera.data.view_frame(scene=scene)[i] for i in (0, 2))
    )
    depth = -camera.data.view_frame(scene=scene)[0].z
    x = left + (right - left) * (np.arange(WIDTH) + 0.5) / WIDTH
    y = top + (low - top) * (np.arange(HEIGHT) + 0.5) / HEIGHT
    local = np.stack([*np.meshgrid(x, y), np.full((HEIGHT, WIDTH), -depth)], axis=-1)
    ray = local @ np.array(camera.matrix_world.to_3x3(), np.float64).T
    eye = np.array(camera.matrix_world.translation)
    down = ray[:, :, 2] < -1e-6
    hit = eye[:2] + ray[:, :, :2] * (eye[2] / np.where(down, -ray[:, :, 2], 1.0))[:, :, None]
    west, east, south, north = box
    return down & (hit[:, :, 0] > west) & (hit[:, :, 0] < east) & (hit[:, :, 1] > south) & (hit[:, :, 1] < north)


def _luminance(scene: bpy.types.Scene, path: Path, samples: int, seed: int) -> NDArray[np.float32]:
    """Luminance (height, width) of the light of an image, top row first."""
    render(scene, path, samples, seed, form='OPEN_EXR')
    return read_picture(path)[:, :, :3] @ _LUMINANCE
