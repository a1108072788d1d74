# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a tree of shaders returns, lets through and leaves open, at many points of a surface at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import bpy
import numpy as np

from ..compat import tree_in_use
from .colour_maths import Values, luminance
from .node_values import ImageMissing, NodeValues, Stack, source_of
from .nodes import SNOW, active_output, find_socket

#: Shaders by what they let through of the light that they scatter, and the input of their colour.
SIMPLE = {
    'BSDF_DIFFUSE': ("Color", 0.0),
    'BSDF_TRANSLUCENT': ("Color", 1.0),
    'BSDF_GLOSSY': ("Color", 0.0),
    'BSDF_METALLIC': ("Base Color", 0.0),
    'BSDF_SHEEN': ("Color", 0.0),
    'BSDF_TOON': ("Color", 0.0),
    'BSDF_GLASS': ("Color", 1.0),
    'BSDF_REFRACTION': ("Color", 1.0),
    'BSDF_HAIR': ("Color", 0.5),
    'BSDF_HAIR_PRINCIPLED': ("Color", 0.5),
    'SUBSURFACE_SCATTERING': ("Color", 0.5),
    'EMISSION': ("Color", 0.0),
}


class Scattered(NamedTuple):
    """What points of a surface do with light.

    Attributes
    ----------
    cover : (p, k)
        Fraction that is not transparent.
    colour : (3, p, k)
        Fraction of light that is scattered to either side; none where transparent.
    through : (p, k)
        Lightness of the part that leaves on the other side.
    """

    cover: Values
    colour: Values
    through: Values


_ONE, _NONE = np.ones((1, 1), np.float32), np.zeros((1, 1), np.float32)
_BLACK = np.zeros((3, 1, 1), np.float32)
_UNLIT = Scattered(_ONE, _BLACK, _NONE)


class SurfaceShaders:
    """Evaluates the shaders of a material at some points.

    Parameters
    ----------
    material : bpy.types.Material
    tell : callable
        Takes problems, for the artist.
    """

    def __init__(self, material: bpy.types.Material, tell: Callable[[str], None]) -> None:
        self.material, self._tell = material, tell
        output = active_output(tree_in_use(material), 'OUTPUT_MATERIAL')
        self._surface = None if output is None else find_socket(output.inputs, "Surface")
        if self._surface is not None and source_of(self._surface, ())[0] is None:
            self._surface = None
            tell(
                f'Material "{material.name}" has no surface shader; its viewport color stands for it. Link a shader to '
                "the Surface of its Material Output"
            )

    def at(self, values: NodeValues) -> Scattered | None:
        """What all points do with light; None where the material has no shaders."""
        return None if self._surface is None else self._shader(values, self._surface, ())

    def _shader(self, values: NodeValues, socket: bpy.types.NodeSocket, stack: Stack) -> Scattered:
        source, stack = source_of(socket, stack)
        if source is None or not source.is_output:
            return _UNLIT
        node = source.node
        if (simple := SIMPLE.get(node.type)) is not None:
            colour = self._colour(values, node, simple[0], stack)
            if node.type == 'EMISSION':
                colour = colour * self._number(values, node, "Strength", stack)
            return _solid(_ONE, colour, np.full((1, 1), simple[1], np.float32))
        work = _SHADERS.get(node.type)
        return _UNLIT if work is None else work(self, values, node, stack)

    def _principled(self, values: NodeValues, node: bpy.types.Node, stack: Stack) -> Scattered:
        colour = self._colour(values, node, "Base Color", stack)
        glass = self._number(values, node, "Transmission Weight", stack)
        inside = self._number(values, node, "Subsurface Weight", stack)
        through = np.clip(np.maximum(glass, inside / 2), 0, 1)
        alpha = self._number(values, node, "Alpha", stack)
        return _solid(np.clip(alpha, 0, 1), colour, through)

    def _specular(self, values: NodeValues, node: bpy.types.Node, stack: Stack) -> Scattered:
        gone = np.clip(self._number(values, node, "Transparency", stack), 0, 1)
        return _solid(1 - gone, self._colour(values, node, "Base Color", stack), _NONE)

    def _transparent(self, values: NodeValues, node: bpy.types.Node, stack: Stack) -> Scattered:
        return Scattered(1 - luminance(self._colour(values, node, "Color", stack)), _BLACK, _NONE)

    def _mix(self, values: NodeValues, node: bpy.types.Node, stack: Stack) -> Scattered:
        if stack and stack[-1].node_tree.name.startswith(SNOW):  # looks are those without snow
            return self._shader(values, find_socket(node.inputs, "Shader"), stack)
        factor = np.clip(self._number(values, node, "Fac", stack), 0, 1)
        a, b = (self._shader(values, find_socket(node.inputs, key), stack) for key in ("Shader", "Shader_001"))
        return Scattered(*(x + factor * (y - x) for x, y in zip(a, b, strict=True)))

    def _add(self, values: NodeValues, node: bpy.types.Node, stack: Stack) -> Scattered:
        a, b = (self._shader(values, find_socket(node.inputs, key), stack) for key in ("Shader", "Shader_001"))
        # Light that either lets pass straight passes; more than all of it cannot.
        cover = np.clip(a.cover + b.cover - 1, 0, 1)
        return Scattered(cover, a.colour + b.colour, a.through + b.through)

    def _colour(self, values: NodeValues, node: bpy.types.Node, key: str, stack: Stack) -> Values:
        try:
            return np.clip(values.colour(node, key, stack), 0, 1)
        except ImageMissing as error:
            self._tell(str(error))
            return np.clip(np.array(self.material.diffuse_color[:3], np.float32), 0, 1).reshape(3, 1, 1)

    def _number(self, values: NodeValues, node: bpy.types.Node, key: str, stack: Stack) -> Values:
        try:
            return values.number(node, key, stack)
        except ImageMissing as error:
            self._tell(str(error))
            return np.full((1, 1), {"Alpha": 1.0, "Strength": 1.0, "Fac": 0.5}.get(key, 0.0), np.float32)


def _solid(cover: Values, colour: Values, through: Values) -> Scattered:
    scattered = np.clip(colour, 0, 1) * cover
    return Scattered(cover, scattered, luminance(scattered) * through)


_SHADERS: dict[str, Callable[[SurfaceShaders, NodeValues, bpy.types.Node, Stack], Scattered]] = {
    'BSDF_PRINCIPLED': SurfaceShaders._principled,
    'EEVEE_SPECULAR': SurfaceShaders._specular,
    'BSDF_TRANSPARENT': SurfaceShaders._transparent,
    'MIX_SHADER': SurfaceShaders._mix,
    'ADD_SHADER': SurfaceShaders._add,
}
