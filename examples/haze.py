# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Haze over a landscape, after Koschmieder's law.

Things at a distance d keep the fraction e^(−β d) of their light, and air adds its own light for the rest. A box of a
volume that absorbs and glows, but scatters nothing, does exactly that, without noise.
"""

from __future__ import annotations

import bpy
import numpy as np

from . import stage

#: How far the box reaches beyond the land to all sides, and above it, meters.
_BESIDE, _ABOVE = 300.0, 90.0


def add_haze(
    scene: bpy.types.Scene, extinction: float, airlight: tuple[float, float, float], land: str = "Ground"
) -> bpy.types.Object:
    """Put the scene's ground, and its camera, into a box of haze that throws no shadow.

    Parameters
    ----------
    scene : bpy.types.Scene
    extinction : float
        β, 1/m.
    airlight : tuple of float
        Radiance of air of which nobody sees the end, linear.
    land : str
        Name of the ground.

    Returns
    -------
    bpy.types.Object
        The box.
    """
    ground = scene.objects[land]
    points = np.zeros(3 * len(ground.data.vertices), np.float32)
    ground.data.vertices.foreach_get("co", points)
    points = np.vstack([points.reshape(-1, 3), scene.camera.location])
    low, high = points.min(axis=0) - _BESIDE, points.max(axis=0) + [_BESIDE, _BESIDE, _ABOVE]
    mesh = bpy.data.meshes.new("Haze")
    corners = [[(low, high)[bit >> axis & 1][axis] for axis in range(3)] for bit in range(8)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh.from_pydata(np.array(corners).tolist(), [], faces)
    mesh.materials.append(_air(extinction, airlight))
    box = bpy.data.objects.new("Haze", mesh)
    # Between the eye and what it sees alone: light that plants get from lamps and sky is as it was without.
    box.visible_shadow = box.visible_diffuse = box.visible_glossy = box.visible_transmission = False
    scene.collection.objects.link(box)
    return box


def _air(extinction: float, airlight: tuple[float, float, float]) -> bpy.types.Material:
    """A volume that is as bright as the airlight where nobody sees through."""
    material = bpy.data.materials.new("Haze")
    nodes, links = stage.cleared(material)
    kinds = "VolumeAbsorption", "Emission", "AddShader", "OutputMaterial"
    absorb, glow, both, output = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    absorb.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    absorb.inputs["Density"].default_value = extinction
    glow.inputs["Color"].default_value = (*airlight, 1.0)
    glow.inputs["Strength"].default_value = extinction
    links.new(absorb.outputs[0], both.inputs[0])
    links.new(glow.outputs[0], both.inputs[1])
    links.new(both.outputs[0], output.inputs["Volume"])
    return material
