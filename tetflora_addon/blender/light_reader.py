# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Read the lights of a scene: where they are, and how much they give."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

from ..refinement.light_views import Light
from .compat import tree_in_use
from .node_tools import active_output
from .transforms import world_matrix
from .view_layers import renderable_objects


def read_lights(depsgraph: bpy.types.Depsgraph, view_layer: bpy.types.ViewLayer) -> tuple[Light, ...]:
    """Lights that render and shine, by name.

    Lights that collections or geometry nodes instance are not among them. A light that is placed nowhere is passed
    over. Light linking, textures and the spread of areas do not count; of nodes, strength and colour of the emission
    do where they are plain numbers.

    Notes
    -----
    Energies are as Cycles takes them, measured on a white plane within .1 %: a sun's is its irradiance; a point or spot
    of Φ watts sends Φ / 4π W/sr each way, an area Φ / π W/sr ahead.
    """
    found = []
    for obj in sorted(renderable_objects(view_layer), key=lambda o: o.name_full):
        if obj.type != 'LIGHT':
            continue
        data = obj.evaluated_get(depsgraph).data
        matrix = world_matrix(obj, depsgraph).astype(np.float64)
        length = float(np.linalg.norm(matrix[:3, 2]))
        colour = _colour(data)
        if not colour.any() or not np.isfinite(matrix).all() or length < 1e-9:
            continue
        given = {"position": matrix[:3, 3], "direction": -matrix[:3, 2] / length, "shadow": bool(data.use_shadow)}
        if data.type == 'SUN':
            found.append(Light('SUN', width=float(data.angle), colour=colour, **given))
        elif data.type == 'AREA':
            found.append(_area(data, matrix, colour, given))
        else:
            # Without "normalize" the energy is that of a unit surface.
            radius = data.shadow_soft_size
            share = 1.0 if data.normalize else np.pi * radius**2
            spot = {"angle": data.spot_size / 2.0, "blend": data.spot_blend} if data.type == 'SPOT' else {}
            colour = colour * share / (4.0 * np.pi)
            found.append(Light(data.type, width=2.0 * radius, colour=colour, **given, **spot))
    return tuple(found)


def _area(data: bpy.types.AreaLight, matrix: NDArray[np.float64], colour: NDArray[np.float64], given: dict) -> Light:
    ellipse = data.shape in {'DISK', 'ELLIPSE'}
    sides = np.array([data.size, data.size_y if data.shape in {'RECTANGLE', 'ELLIPSE'} else data.size])
    span = matrix[:3, :2].T * sides[:, None] / 2.0
    if not data.normalize:
        colour = colour * np.linalg.norm(np.cross(*span)) * (np.pi if ellipse else 4.0)
    width = 2.0 * float(np.linalg.norm(span, axis=1).max())
    return Light('AREA', width=width, colour=colour / np.pi, span=span, ellipse=ellipse, **given)


def _colour(data: bpy.types.Light) -> NDArray[np.float64]:
    """Linear RGB times energy, nodes and exposure included."""
    colour = np.array(data.color[:]) * data.energy * 2.0 ** getattr(data, "exposure", 0.0)
    if getattr(data, "use_temperature", False):
        colour = colour * np.array(data.temperature_color[:])
    for node in _emissions(data):
        plain = np.array(node.inputs["Color"].default_value[:3]), node.inputs["Strength"].default_value
        colour = colour * (1.0 if node.inputs["Color"].is_linked else plain[0])
        colour = colour * (1.0 if node.inputs["Strength"].is_linked else plain[1])
    return np.maximum(colour.astype(np.float64), 0.0)


def _emissions(data: bpy.types.Light) -> Iterator[bpy.types.Node]:
    """The emission that a light's own nodes lead to its output."""
    output = active_output(tree_in_use(data), 'OUTPUT_LIGHT')
    if output is not None and output.inputs["Surface"].is_linked:
        node = output.inputs["Surface"].links[0].from_node
        if node.type == 'EMISSION':
            yield node
