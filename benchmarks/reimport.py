# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Exported plants in Blender's own importers beside the same polygons with TetFlora's materials, in sun and sky.

Light falls at 45 degrees from the sun, from a blue sky, and from ground that reflects a fifth of both. Four views from
beside show the lit side, the dark one and both halves. Only materials differ: polygons are those of the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from devtools import session
from tests.blender.renders import EEVEE_SAMPLES, few_directions
from tests.blender.scenes import add_camera, add_plant, depsgraph
from tetflora_addon.blender import compat
from tetflora_addon.blender.export.forest import ExportOrder, export_steps, kinds_of, variants_of
from tetflora_addon.blender.results.leaf_objects import materials_of
from tetflora_addon.blender.results.meshes import write_mesh
from tetflora_addon.blender.runtime import JobData
from tetflora_addon.blender.scene.plants import read_plants
from tetflora_addon.blender.species.edits import species_for
from tetflora_addon.blender.worker import run_to_end

from .pictures import read_picture, render
from .side_views import eyes, frame_of

#: Side of a picture, pixels; samples; polygons of the level that is shown.
_SIDE, _SAMPLES, _POLYGONS = 64, 32, 40_000
_SUN, _SKY, _GROUND = np.array([4.0, 3.8, 3.4]), np.array([0.45, 0.6, 1.0]), 0.2
_SEED = 3


def color_errors(folder: Path, species: Sequence[str], engine: str) -> None:
    """Print how far mean colors of reimported plants are off ours: each channel, and their mean over that of ours."""
    engine = session.eevee() if engine == "EEVEE" else engine
    for name in species:
        for key, ending in (("usd", "usdc"), ("gltf", "glb")):
            path = folder / f"{name}.{ending}"
            session.clean_file()
            add_plant("plant", name, _SEED)
            order = ExportOrder(path, variants=1, polygons=_POLYGONS)
            run_to_end(export_steps(bpy.context.scene, depsgraph(), order))
            if key == "usd":
                _draw_own(name)
                points = _points()
                truth = _color(points, folder, engine)
            session.clean_file()
            read_by_blender(path)
            off = _color(points, folder, engine) - truth
            told = ", ".join(f"{100.0 * own:+.1f}" for own in off / truth)
            mean = 100.0 * np.abs(off).mean() / truth.mean()
            print(f"{name}, {key}, {engine}: red, green, blue {told} % off; {mean:.1f} % in all", flush=True)


def _draw_own(species: str) -> None:
    """The finest level of the file's plant as meshes with TetFlora's materials, in place of the plant."""
    scene = bpy.context.scene
    data = JobData("Export Forest", scene, depsgraph())
    seeds = read_plants(scene, data.depsgraph)[0]
    shown = run_to_end(variants_of(seeds, run_to_end(kinds_of(data, seeds, 1)), 0, _POLYGONS))
    bpy.data.objects.remove(bpy.data.objects["plant"])  # or it would be refined for the picture
    for part, mesh in shown.variants[0].levels[0].parts:
        materials = materials_of(scene, species_for(scene, species), part, 0)[:1]
        scene.collection.objects.link(bpy.data.objects.new(part, write_mesh(part, mesh, materials)))


def read_by_blender(path: Path) -> None:
    """Import a file by what Blender has for it; of levels that stand beside each other only the finest stays."""
    upright = partial(bpy.ops.wm.obj_import, forward_axis='Y', up_axis='Z')
    imports = {".usdc": bpy.ops.wm.usd_import, ".glb": bpy.ops.import_scene.gltf, ".obj": upright}
    imports[path.suffix](filepath=str(path))
    for obj in [o for o in bpy.data.objects if "_LOD" in o.name and "_LOD0" not in o.name]:
        bpy.data.objects.remove(obj)


def _points() -> NDArray:
    """Corners (n, 3) of boxes around all meshes."""
    meshes = [obj for obj in bpy.context.scene.objects if obj.type == 'MESH']
    bpy.context.view_layer.update()
    return np.array([obj.matrix_world @ Vector(corner) for obj in meshes for corner in obj.bound_box])


def _color(points: NDArray, folder: Path, engine: str) -> NDArray:
    """Mean color (3,) of what is covered in all views."""
    every = np.concatenate([view.reshape(-1, 4) for view in pictures(points, folder / "view.exr", engine)])
    return every[:, :3].sum(axis=0) / every[:, 3].sum()


def pictures(points: NDArray, path: Path, engine: str = 'CYCLES', number: int = 4, side: int = _SIDE) -> list[NDArray]:
    """Pictures (h, w, 4) of the scene around points, in linear RGB and alpha, top row first."""
    scene = bpy.context.scene
    _light(scene)
    few_directions(scene.world)
    scene.world.probe_resolution = '128'
    # A sample takes EEVEE .3 s. Shadows that its Shadow Pool has no room for are left out without a word: of a beech
    # in 16 MB nearly all, in 64 MB none.
    samples = _SAMPLES if engine == 'CYCLES' else EEVEE_SAMPLES
    camera = add_camera().data
    camera.type = 'ORTHO'
    scene.render.resolution_x = scene.render.resolution_y = side
    scene.render.film_transparent, scene.view_settings.view_transform = True, 'Raw'
    middle, camera.ortho_scale = frame_of(points)
    # EEVEE spreads the shadows of a sun over all of the camera's depth: too deep, and there are none.
    camera.clip_start, camera.clip_end = (part * camera.ortho_scale for part in (1.0, 5.0))
    made = []
    for eye in eyes(number):
        scene.camera.location = middle + 3.0 * camera.ortho_scale * eye
        scene.camera.rotation_euler = Vector(-eye).to_track_quat('-Z', 'Y').to_euler()
        render(scene, path, samples, engine=engine, form='OPEN_EXR')
        made.append(read_picture(path).astype(np.float64))
    return made


def _light(scene: bpy.types.Scene) -> None:
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", 'SUN'))
    sun.data.energy, sun.data.color = float(_SUN.max()), _SUN / _SUN.max()
    sun.rotation_euler = (np.radians(45.0), 0.0, 0.0)
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("sky")
    tree = compat.shader_tree(scene.world)
    height, mix, place = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("SeparateXYZ", "MixRGB", "TexCoord"))
    above = tree.nodes.new("ShaderNodeMath")
    above.operation = 'GREATER_THAN'
    above.inputs[1].default_value = 0.0
    ground = _GROUND * (_SUN * np.sqrt(0.5) / np.pi + _SKY)
    mix.inputs[1].default_value, mix.inputs[2].default_value = (*ground, 1.0), (*_SKY, 1.0)
    for one, other in (
        (place.outputs["Generated"], height.inputs[0]),
        (height.outputs["Z"], above.inputs[0]),
        (above.outputs[0], mix.inputs[0]),
        (mix.outputs[0], tree.nodes["Background"].inputs[0]),
    ):
        tree.links.new(one, other)
