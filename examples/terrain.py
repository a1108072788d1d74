# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground from a real elevation model: the Jacksboro fault, Tennessee, from matplotlib's sample data."""

from __future__ import annotations

import bpy
import numpy as np
from matplotlib import cbook
from numpy.typing import NDArray

from . import stage

METERS_PER_DEGREE = 111_320.0


def elevation() -> tuple[NDArray[np.float64], float]:
    """Heights in meters, north to south by west to east, and meters from one sample to the next (north to south)."""
    with cbook.get_sample_data("jacksboro_fault_dem.npz") as data:
        heights, spacing = data["elevation"], float(data["dy"])
    return np.asarray(heights, dtype=np.float64), spacing * METERS_PER_DEGREE


class Terrain:
    """A rectangle cut from the elevation model and scaled down as a whole, so that slopes stay as they are.

    Parameters
    ----------
    corner : tuple of int
        Row and column of the model at the rectangle's near left corner.
    shape : tuple of int
        Rows (along y) and columns (along x).
    scale : float
        Size of the copy relative to the land itself.
    """

    def __init__(self, corner: tuple[int, int], shape: tuple[int, int], scale: float) -> None:
        heights, spacing = elevation()
        (r, c), (rows, columns) = corner, shape
        self.heights = heights[r : r + rows, c : c + columns] * scale
        self.heights -= self.heights.mean()
        self.step = spacing * scale

    def height(self, x: NDArray, y: NDArray) -> NDArray[np.float64]:
        """Height at points, by cubic (Catmull-Rom) interpolation; x and y from 0, meters."""
        rows, columns = self.heights.shape
        v, u = np.asarray(y) / self.step, np.asarray(x) / self.step
        j, i = np.floor(v).astype(int), np.floor(u).astype(int)
        total = np.zeros(np.broadcast(u, v).shape)
        for dj, wj in zip(range(-1, 3), _catmull_rom(v - j), strict=True):
            for di, wi in zip(range(-1, 3), _catmull_rom(u - i), strict=True):
                total += wj * wi * self.heights[np.clip(j + dj, 0, rows - 1), np.clip(i + di, 0, columns - 1)]
        return total

    @property
    def size(self) -> tuple[float, float]:
        """Extent along x and y, meters."""
        rows, columns = self.heights.shape
        return (columns - 1) * self.step, (rows - 1) * self.step

    def add_object(self, scene: bpy.types.Scene, name: str, spacing: float) -> bpy.types.Object:
        """Add the ground as a grid mesh that hides what is behind it, with vertices about ``spacing`` meters apart."""
        width, length = self.size
        nx, ny = int(width / spacing) + 1, int(length / spacing) + 1
        x, y = np.meshgrid(np.linspace(0, width, nx), np.linspace(0, length, ny))
        points = np.stack([x, y, self.height(x, y)], axis=2).reshape(-1, 3)
        first = (np.arange(ny - 1)[:, None] * nx + np.arange(nx - 1)).reshape(-1)
        faces = np.stack([first, first + 1, first + nx + 1, first + nx], axis=1)
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(points.tolist(), [], faces.tolist(), shade_flat=False)
        mesh.materials.append(ground_material())
        ground = bpy.data.objects.new(name, mesh)
        ground.tetflora.is_occluder = True
        scene.collection.objects.link(ground)
        return ground


def _catmull_rom(t: NDArray) -> tuple[NDArray, ...]:
    return (
        ((-0.5 * t + 1.0) * t - 0.5) * t,
        (1.5 * t - 2.5) * t * t + 1.0,
        ((-1.5 * t + 2.0) * t + 0.5) * t,
        (0.5 * t - 0.5) * t * t,
    )


def ground_material() -> bpy.types.Material:
    """Meadow: greens and browns by noise, down to tufts and blades of a centimeter."""
    material = bpy.data.materials.new("Meadow")
    nodes, links = stage.cleared(material)
    place = nodes.new("ShaderNodeTexCoord")
    noise = nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 0.15
    noise.inputs["Detail"].default_value = 8.0
    links.new(place.outputs["Object"], noise.inputs["Vector"])
    ramp = nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.38, 0.66
    ramp.color_ramp.elements[0].color = (0.085, 0.13, 0.035, 1)
    ramp.color_ramp.elements[1].color = (0.17, 0.175, 0.07, 1)
    links.new(noise.outputs[0], ramp.inputs[0])
    tufts = nodes.new("ShaderNodeTexNoise")
    for name, value in (("Scale", 4.0), ("Detail", 7.0), ("Roughness", 0.85)):
        tufts.inputs[name].default_value = value
    links.new(place.outputs["Object"], tufts.inputs["Vector"])
    shade = nodes.new("ShaderNodeMapRange")
    shade.inputs["From Min"].default_value, shade.inputs["From Max"].default_value = 0.3, 0.7
    shade.inputs["To Min"].default_value, shade.inputs["To Max"].default_value = 0.45, 1.35
    links.new(tufts.outputs[0], shade.inputs["Value"])
    scaled = nodes.new("ShaderNodeVectorMath")
    scaled.operation = 'SCALE'
    links.new(ramp.outputs["Color"], scaled.inputs[0])
    links.new(shade.outputs[0], scaled.inputs["Scale"])
    bump = nodes.new("ShaderNodeBump")
    bump.inputs["Distance"].default_value = 0.08
    links.new(tufts.outputs[0], bump.inputs["Height"])
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    links.new(scaled.outputs[0], diffuse.inputs["Color"])
    links.new(bump.outputs[0], diffuse.inputs["Normal"])
    out = nodes.new("ShaderNodeOutputMaterial")
    links.new(diffuse.outputs[0], out.inputs["Surface"])
    return material
