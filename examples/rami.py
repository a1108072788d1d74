# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of RAMI, the radiation transfer model intercomparison, in Blender: canopies of discs under a sun, no sky.

``python -m examples.rami HET01 --zenith -20 --output out/rami.exr`` renders a view of explicit polygons and prints its
bidirectional reflectance factor beside the published one. What stands where is in `rami_discs`.
"""

# ruff: noqa: E402  (run as a program, it starts Blender before it imports what needs Blender)
from __future__ import annotations

import argparse
import sys
from math import cos, pi, radians, sin
from pathlib import Path

from devtools import session

session.start()

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from benchmarks import pictures
from devtools.formats import set_format
from tetflora_addon.blender.compat import shader_tree

from . import stage
from .rami_discs import CORNERS, Canopy, Solid, canopy, discs, polygons, published

#: Crowns of a kind that differ; the others are turned copies.
VARIANTS = 4
_FAR = 2000.0
_BOUNCES = 64
_GROUND = 1500.0


def build(scene: bpy.types.Scene, stand: Canopy, rings: int | None = None, plants: bool = True) -> None:
    """Ground, sun, camera, and with `plants` the crowns as meshes of polygons, into an empty scene.

    Parameters
    ----------
    scene : bpy.types.Scene
    stand : Canopy
    rings : int, optional
        Copies around the scene on each side; by default its own padding.
    plants : bool
    """
    _set_light(scene, stand)
    if stand.ground:
        # Open borders end with the ground; a periodic scene goes on.
        reach = _GROUND if stand.padding else stand.side / 2
        stage.ground(2.0 * reach, (stand.ground,) * 3)
    stage.camera(scene, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), near=1.0, far=2 * _FAR, across=stand.side)
    if plants:
        place(
            scene,
            stand,
            {
                kind: [[crown_mesh(kind, solid, seed)] for seed in range(VARIANTS if solid.shape != "box" else 1)]
                for kind, solid in stand.solids.items()
            },
            rings,
        )


def place(
    scene: bpy.types.Scene, stand: Canopy, crowns: dict[str, list[list[bpy.types.Mesh]]], rings: int | None = None
) -> None:
    """Objects at all places of a canopy that share some meshes, each turned about its vertical.

    Parameters
    ----------
    crowns : dict of str to list
        For each kind some crowns, each one mesh or several.
    """
    for kind, solid in stand.solids.items():
        places = stand.padded(kind, rings)
        turns = np.random.default_rng(1).uniform(0, 2 * pi, len(places))
        for number, origin in enumerate(places.tolist()):
            # A copy repeats its original: number in the scene, not in the padding.
            own = number % len(stand.places[kind])
            for mesh in crowns[kind][own % len(crowns[kind])]:
                crown = bpy.data.objects.new(kind, mesh)
                crown.location = origin
                if solid.shape != "box":
                    crown.rotation_euler.z = turns[own]
                scene.collection.objects.link(crown)


def crown_mesh(kind: str, solid: Solid, seed: int) -> bpy.types.Mesh:
    """All discs of a crown as polygons, and its trunk."""
    corners = polygons(*discs(solid, seed), solid.disc_radius).reshape(-1, 3)
    mesh = bpy.data.meshes.new(f"{kind} {seed}")
    faces = np.full(solid.discs, CORNERS)
    mesh.materials.append(lambertian(f"{kind} disc", solid.reflectance, solid.transmittance))
    if solid.trunk:
        height, radius, reflectance = solid.trunk
        sides = _tube(height, radius)
        corners, faces = np.concatenate([corners, sides]), np.concatenate([faces, np.full(len(sides) // 4, 4)])
        mesh.materials.append(lambertian(f"{kind} trunk", reflectance))
    _fill(mesh, corners, faces)
    material = np.zeros(len(faces), np.int32)
    material[solid.discs :] = 1
    mesh.polygons.foreach_set("material_index", material)
    mesh.update()
    return mesh


def _tube(height: float, radius: float, sides: int = 16) -> NDArray[np.float32]:
    """Corners (4 * sides, 3) of the wall of a cylinder on the ground."""
    turn = np.arange(sides + 1) * (2 * pi / sides)
    ring = radius * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    top = ring + (0.0, 0.0, height)
    return np.stack([ring[:-1], ring[1:], top[1:], top[:-1]], axis=1).reshape(-1, 3).astype(np.float32)


def _fill(mesh: bpy.types.Mesh, corners: NDArray[np.float32], faces: NDArray[np.int64]) -> None:
    """Faces of so many corners each that share none."""
    mesh.vertices.add(len(corners))
    mesh.vertices.foreach_set("co", corners.ravel())
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", np.arange(len(corners), dtype=np.int32))
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", (np.cumsum(faces) - faces).astype(np.int32))
    mesh.update(calc_edges=True)


def lambertian(name: str, reflectance: float, transmittance: float = 0.0) -> bpy.types.Material:
    """A gray surface that scatters so much evenly to the side of the light and so much to the other."""
    made = bpy.data.materials.get(name) or bpy.data.materials.new(name)
    tree = shader_tree(made)
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*[reflectance] * 3, 1.0)
    if transmittance:
        through, both = tree.nodes.new("ShaderNodeBsdfTranslucent"), tree.nodes.new("ShaderNodeAddShader")
        through.inputs["Color"].default_value = (*[transmittance] * 3, 1.0)
        tree.links.new(shader.outputs[0], both.inputs[0])
        tree.links.new(through.outputs[0], both.inputs[1])
        shader = both
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return made


def _set_light(scene: bpy.types.Scene, stand: Canopy) -> None:
    """The sun above +x, no sky, and a renderer that leaves nothing out."""
    lamp = bpy.data.lights.new("Sun", 'SUN')
    lamp.energy, lamp.angle = pi, 0.0
    sun = bpy.data.objects.new("Sun", lamp)
    sun.rotation_euler = (0.0, radians(stand.sun_zenith), 0.0)
    scene.collection.objects.link(sun)
    scene.world = None
    render, cycles = scene.render, scene.cycles
    render.engine = 'CYCLES'
    set_bounces(scene, _BOUNCES)
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.light_sampling_threshold = 0.0
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.pixel_filter_type = 'BOX'
    render.film_transparent = False
    render.use_compositing = render.use_sequencer = False
    scene.view_settings.view_transform = 'Raw'
    scene.display_settings.display_device = "sRGB"


def set_bounces(scene: bpy.types.Scene, bounces: int) -> None:
    """How often light may be scattered again after it was once."""
    cycles = scene.cycles
    cycles.max_bounces = cycles.diffuse_bounces = cycles.transmission_bounces = bounces
    cycles.glossy_bounces = bounces
    cycles.transparent_max_bounces = 256
    cycles.caustics_reflective = cycles.caustics_refractive = True


def set_view(scene: bpy.types.Scene, stand: Canopy, zenith: float, pixels: int) -> None:
    """Let the image show exactly the target from a zenith (degrees, negative on the sun's side), so many pixels wide.

    A view from the side is lower by the cosine; pixels are not quite square where the number of rows is rounded.
    """
    camera, render = scene.camera, scene.render
    angle = radians(zenith)
    toward = Vector((-sin(angle), 0.0, cos(angle)))
    camera.location = Vector((0.0, 0.0, stand.top)) + _FAR * toward
    # The image's horizontal is y, so that its vertical lies in the principal plane.
    across = Vector((0.0, 1.0, 0.0))
    camera.rotation_euler = Matrix((across, toward.cross(across), toward)).transposed().to_euler()
    camera.data.sensor_fit = 'HORIZONTAL'
    height = pixels * cos(angle)
    # Blender renders no fewer than four rows.
    rows = max(round(height), 4)
    render.resolution_x, render.resolution_y, render.resolution_percentage = pixels, rows, 100
    render.pixel_aspect_x, render.pixel_aspect_y = max(rows / height, 1.0), max(height / rows, 1.0)


def radiance(scene: bpy.types.Scene, path: Path, samples: int, seed: int = 0) -> NDArray[np.float32]:
    """Render what the scene holds into a file of floats and read it: RGBA (height, width, 4)."""
    settings = scene.render.image_settings
    set_format(settings, 'OPEN_EXR')
    settings.color_depth, settings.color_mode = '32', 'RGBA'
    pictures.render(scene, path, samples, seed, form='OPEN_EXR')
    return pictures.read_picture(path)


def reflectance_factor(pixels: NDArray[np.floating], stand: Canopy, strength: float = pi) -> float:
    """Bidirectional reflectance factor of a target that fills an image: π L / (E cos θ), E across the sun's rays."""
    return float(pixels[:, :, :3].mean(dtype=np.float64)) * pi / (strength * cos(radians(stand.sun_zenith)))


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name")
    parser.add_argument("--zenith", type=float, nargs="*", default=[0.0])
    parser.add_argument("--pixels", type=int, default=160)
    parser.add_argument("--samples", type=int, default=4)
    parser.add_argument("--rings", type=int)
    parser.add_argument("--output", type=Path, default=Path("out") / "rami" / "view.exr")
    arguments = parser.parse_args()
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    session.clean_file()
    scene, stand = bpy.context.scene, canopy(arguments.name)
    build(scene, stand, arguments.rings)
    scene.render.use_persistent_data = True
    for zenith in arguments.zenith:
        set_view(scene, stand, zenith, arguments.pixels)
        found = reflectance_factor(radiance(scene, arguments.output.resolve(), arguments.samples), stand)
        angles, factors = published(arguments.name)
        reference = float(np.interp(zenith, angles, factors))
        print(f"{zenith:6.1f}  {found:.4f}  published {reference:.4f}  {found / reference - 1:+.4f}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
