# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials as textures: Cycles bakes them on a square, in a scene of its own that is gone afterward."""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ...arrays import Floats, Floats32
from ..attributes import image_pixels, write

#: What is baked of a material: Blender's name, and whether it is a color.
PASSES = {"color": ('DIFFUSE', True), "roughness": ('ROUGHNESS', False), "normal": ('NORMAL', False)}
_NAME = "TetFlora bake"


def baked(
    material: bpy.types.Material, color: Floats, through: float, size: int, low: Floats, extent: Floats, meters: float
) -> dict[str, Floats32]:
    """Texels (size, size, 3) of a material by the names of `PASSES`, row 0 lowest.

    Parameters
    ----------
    color : (3,) float
        Of the faces, linear RGB.
    through : float
        Their transmission.
    low, extent : (2,) float
        Texture coordinates that the square shows.
    meters : float
        Side of the square.
    """
    found: dict[str, Floats32] = {}
    with _square(material, color, through, low, extent, meters) as (scene, obj):
        for name, (kind, is_color) in PASSES.items():
            image = bpy.data.images.new(_NAME, size, size, float_buffer=True, is_data=not is_color)
            node = material.node_tree.nodes.new("ShaderNodeTexImage")
            before = material.node_tree.nodes.active
            try:
                node.image, material.node_tree.nodes.active = image, node
                given = {"scene": scene, "view_layer": scene.view_layers[0], "active_object": obj, "object": obj}
                with bpy.context.temp_override(**given, selected_objects=[obj], selected_editable_objects=[obj]):
                    bpy.ops.object.bake(type=kind, pass_filter={'COLOR'} if is_color else set(), margin=0)
                found[name] = image_pixels(image)[..., :3].copy()
            finally:
                material.node_tree.nodes.remove(node)
                material.node_tree.nodes.active = before
                bpy.data.images.remove(image)
    return found


@contextmanager
def _square(
    material: bpy.types.Material, color: Floats, through: float, low: Floats, extent: Floats, meters: float
) -> Iterator[tuple[bpy.types.Scene, bpy.types.Object]]:
    """A square of the material in a scene with Cycles at one sample."""
    scene, mesh = bpy.data.scenes.new(_NAME), bpy.data.meshes.new(_NAME)
    obj = bpy.data.objects.new(_NAME, mesh)
    try:
        corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
        mesh.from_pydata(np.pad(meters * corners, ((0, 0), (0, 1))).tolist(), [], [(0, 1, 2, 3)])
        for name, uv in (("UVMap", low + corners * extent), ("bake", corners)):
            layer = mesh.uv_layers.new(name=name)
            layer.uv.foreach_set("vector", np.ascontiguousarray(uv, np.float32).reshape(-1))
        mesh.uv_layers.active = mesh.uv_layers["bake"]
        write(mesh, "tf_color", np.array([color], np.float32), 'FACE')
        write(mesh, "tf_transmission", np.array([through], np.float32), 'FACE')
        write(mesh, "tf_girth", np.array([meters], np.float32), 'FACE')
        mesh.materials.append(material)
        scene.collection.objects.link(obj)
        scene.render.engine = 'CYCLES'
        scene.cycles.samples, scene.cycles.use_denoising = 1, False
        scene.view_layers[0].update()
        yield scene, obj
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(obj)
        bpy.data.meshes.remove(mesh)
