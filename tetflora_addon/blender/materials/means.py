# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a material looks like from afar: mean colour, transmission and coverage.

The artist's node trees can be arbitrary. Only what nearly all of them have is read: the first shader with a colour and,
where that comes from an image or a colour attribute, its mean. Nodes in between that change colours are ignored.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..attributes import image_pixels, linear_rgb
from ..compat import tree_in_use
from .nodes import active_output, upstream

#: What Blender shows where there is no material.
GREY = (0.8, 0.8, 0.8)
#: Fraction of light that goes through a translucent shader, which is usually one of two that are mixed.
TRANSLUCENT = 0.5
#: Pixels of an image that are looked at, about.
_PIXELS = 1 << 18
_COLOUR_INPUTS = ("Base Color", "Color")
_TRANSPARENT = {'BSDF_TRANSPARENT'}


@dataclass(frozen=True)
class Look:
    """Means over a material: linear RGB, transmission (NaN if unknown), fraction that is not transparent."""

    colour: tuple[float, float, float] = GREY
    transmission: float = np.nan
    coverage: float = 1.0


class Looks:
    """Reads materials; each image is read once."""

    def __init__(self) -> None:
        self._images: dict[bpy.types.Image, tuple[NDArray, float] | None] = {}

    def of(self, material: bpy.types.Material | None, attributes: dict[str, NDArray]) -> Look:
        """Look of a material.

        Parameters
        ----------
        material : bpy.types.Material, optional
        attributes : mapping of str to (n, k) float32
            Of the mesh that wears it, for those that take their colour from one.
        """
        if material is None:
            return Look(transmission=0.0)
        tree = tree_in_use(material)
        output = active_output(tree, 'OUTPUT_MATERIAL')
        if output is None:
            return Look(tuple(material.diffuse_color[:3]))
        shaders = [n for n in upstream(output.inputs["Surface"]) if _colour_input(n) and n.type not in _TRANSPARENT]
        if not shaders:
            return Look(tuple(material.diffuse_color[:3]))
        first = shaders[0]
        colour, _ = self._mean(_colour_input(first), attributes)
        through = max(_value(first, "Transmission Weight"), _value(first, "Subsurface Weight") / 2)
        if any(n.type == 'BSDF_TRANSLUCENT' for n in shaders):
            through = max(through, TRANSLUCENT)
        return Look(tuple(np.clip(colour, 0, 1)), through, self._coverage(output, first, attributes))

    def _coverage(self, output: bpy.types.Node, shader: bpy.types.Node, attributes: dict[str, NDArray]) -> float:
        covered = 1.0
        if (alpha := shader.inputs.get("Alpha")) is not None:
            covered = self._number(alpha, attributes)
        for node in upstream(output.inputs["Surface"]):
            if node.type == 'MIX_SHADER':
                sides = [socket.links[0].from_node.type if socket.is_linked else "" for socket in node.inputs[1:3]]
                factor = self._number(node.inputs[0], attributes)
                if sides[0] in _TRANSPARENT:
                    covered *= factor
                elif sides[1] in _TRANSPARENT:
                    covered *= 1 - factor
        return float(np.clip(covered, 0, 1))

    def _number(self, socket: bpy.types.NodeSocket, attributes: dict[str, NDArray]) -> float:
        """Mean of a number; that of an image's alpha or lightness if it comes from there."""
        if not socket.is_linked:
            return float(socket.default_value)
        colour, alpha = self._mean(socket, attributes)
        return alpha if socket.links[0].from_socket.name == "Alpha" else float(np.mean(colour))

    def _mean(self, socket: bpy.types.NodeSocket, attributes: dict[str, NDArray]) -> tuple[NDArray, float]:
        """Mean colour and alpha of what feeds a socket."""
        for node in upstream(socket):
            if node.type == 'TEX_IMAGE' and node.image is not None:
                if (mean := self._image(node.image)) is not None:
                    return mean
            elif node.type in {'ATTRIBUTE', 'VERTEX_COLOR'}:
                name = node.attribute_name if node.type == 'ATTRIBUTE' else node.layer_name
                values = attributes.get(name)
                if values is not None and values.shape[1] >= 3:
                    return values[:, :3].mean(axis=0, dtype=np.float64), 1.0
            elif node.type == 'RGB':
                return np.array(node.outputs[0].default_value[:3]), 1.0
        value = socket.default_value
        return (np.array(value[:3]) if hasattr(value, "__len__") else np.full(3, float(value))), 1.0

    def _image(self, image: bpy.types.Image) -> tuple[NDArray, float] | None:
        if image not in self._images:
            self._images[image] = image_mean(image)
        return self._images[image]


def image_mean(image: bpy.types.Image) -> tuple[NDArray[np.float64], float] | None:
    """Mean linear colour (3,) of an image, weighted by its alpha, and the mean alpha; None if it has no pixels."""
    width, height, channels = *image.size, image.channels
    if not (width and height and channels):
        return None
    # An odd stride, so that a power of two of columns does not make a few of them stand for all.
    stride = max(1, width * height // _PIXELS) | 1
    pixels = image_pixels(image).reshape(-1, channels)[::stride].astype(np.float64)
    alpha, colour = pixels[:, 3] if channels == 4 else np.ones(len(pixels)), linear_rgb(image, pixels)
    weight = alpha if alpha.sum() > 0 else np.ones(len(alpha))
    return (colour * weight[:, None]).sum(axis=0) / weight.sum(), float(alpha.mean())


def _colour_input(node: bpy.types.Node) -> bpy.types.NodeSocket | None:
    if not any(s.type == 'SHADER' for s in node.outputs):
        return None
    return next((node.inputs[name] for name in _COLOUR_INPUTS if name in node.inputs), None)


def _value(node: bpy.types.Node, name: str) -> float:
    socket = node.inputs.get(name)
    return 0.0 if socket is None or socket.is_linked else float(socket.default_value)
