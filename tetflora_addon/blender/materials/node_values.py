# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers and colours that flow into a shader, at many points of a surface at once.

Nodes that only a renderer knows let the first color that feeds them pass; where none does, as in noise, they count with
one half. What depends on the direction of a ray, or on which instance it is, counts with its mean.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import bpy
import numpy as np
from mathutils import Euler
from numpy.typing import NDArray

from .colour_maths import BLENDS, MATHS, STEPS, Values, hue_saturation, luminance, map_range
from .image_pyramids import Pyramid
from .nodes import find_socket

Stack = tuple[bpy.types.Node, ...]  # groups that the walk is in
_CURVE = 1025  # points at which ramps and curves are known
# Means over directions from which diffuse light comes: of Fresnel's fraction for 1.45, of the angle's cosine taken
# from 1; and over instances or islands.
_MEANS = {
    ('FRESNEL', "Fac"): 0.09,
    ('LAYER_WEIGHT', "Fresnel"): 0.09,
    ('LAYER_WEIGHT', "Facing"): 0.33,
    ('NEW_GEOMETRY', "Backfacing"): 0.5,
    ('NEW_GEOMETRY', "Random Per Island"): 0.5,
    ('OBJECT_INFO', "Random"): 0.5,
    ('PARTICLE_INFO', "Random"): 0.5,
    ('HAIR_INFO', "Random"): 0.5,
    ('LIGHT_PATH', "Is Camera Ray"): 1.0,
}


class ImageMissing(Exception):
    """An image that cannot be read; the text tells the artist."""


class SurfacePoints(Protocol):
    """Places on a surface, (p, k): p in each of k triangles."""

    def uv(self, name: str) -> tuple[Values, Values, Values]:
        """Texture coordinates u and v, and the side (1, k) of what each place stands for; '' is the first map."""

    def attribute(self, name: str) -> Values:
        """A colour attribute (4, p, k)."""

    def is_map(self, name: str) -> bool:
        """Whether an attribute holds texture coordinates."""

    def pyramid(self, node: bpy.types.Node, scale: float) -> Pyramid:
        """The image of a node, whose coordinates are stretched by a factor."""

    def uneven(self) -> None:
        """Say that the mean of what comes out is not what comes out for the mean."""

    def unknown(self) -> None:
        """Say that only a renderer knows what comes out of a node."""


class NodeValues:
    """Evaluates sockets of node trees at some points.

    Parameters
    ----------
    points : SurfacePoints
    curves : dict
        Ramps and curves as tables; kept from one call to the next.
    """

    def __init__(self, points: SurfacePoints, curves: dict[int, NDArray[np.float32]]) -> None:
        self._points, self._curves = points, curves
        self._images: dict[tuple[int, ...], tuple[Values, Values]] = {}
        self._scale, self._size = 1.0, np.zeros((1, 1), np.float32)

    def number(self, node: bpy.types.Node, key: str, stack: Stack) -> Values:
        """An input as a number (p, k)."""
        return self._as(*self._input(find_socket(node.inputs, key), stack), 'VALUE')

    def colour(self, node: bpy.types.Node, key: str, stack: Stack) -> Values:
        """An input as a colour or vector (3, p, k)."""
        return self._as(*self._input(find_socket(node.inputs, key), stack), 'RGBA')

    def _as(self, values: Values, kind: str, wanted: str) -> Values:
        if (wanted == 'VALUE') == (values.ndim == 2):
            return values
        if wanted == 'VALUE':
            return values.mean(axis=0) if kind == 'VECTOR' else luminance(values)
        return np.broadcast_to(values, (3, *values.shape))

    def _input(self, socket: bpy.types.NodeSocket, stack: Stack) -> tuple[Values, str]:
        source, stack = source_of(socket, stack)
        if source is None:
            return _constant(socket), socket.type
        if not source.is_output:  # an input that nothing feeds, of a group or of a node that is switched off
            return _constant(source), source.type
        return self._output(source, stack), source.type

    def _output(self, socket: bpy.types.NodeSocket, stack: Stack) -> Values:
        node = socket.node
        if node.type == 'TEX_IMAGE':
            colour, alpha = self._image(node, stack)
            return alpha if socket.identifier == "Alpha" else colour
        if (mean := _MEANS.get((node.type, socket.identifier))) is not None:
            return np.full((1, 1), mean, np.float32)
        if node.type == 'LIGHT_PATH' and socket.identifier.startswith("Is "):
            return np.zeros((1, 1), np.float32)
        if node.type in {'RGB', 'VALUE'}:
            return _constant(node.outputs[0])
        with np.errstate(all="ignore"):
            return _NODES.get(node.type, NodeValues._unknown)(self, node, socket, stack)

    def _image(self, node: bpy.types.Node, stack: Stack) -> tuple[Values, Values]:
        key = tuple(n.as_pointer() for n in (node, *stack))
        if key not in self._images:
            outer, self._scale = self._scale, 1.0
            vector = find_socket(node.inputs, "Vector")
            if source_of(vector, stack)[0] is None:
                u, v, self._size = self._points.uv("")
            else:
                self._size = np.zeros((1, 1), np.float32)
                u, v = self.colour(node, "Vector", stack)[:2]
            pyramid = self._points.pyramid(node, self._scale)
            self._images[key] = pyramid.look(u, v, self._size * np.float32(self._scale), node.extension)
            self._scale = outer
        return self._images[key]

    def _uv(self, name: str) -> Values:
        u, v, self._size = self._points.uv(name)
        return np.stack([u, v, np.zeros_like(u)])

    # What nodes do, by type; each gets the node, the output that is asked for, and the groups it is in.

    def _unknown(self, node, socket, stack) -> Values:
        self._points.unknown()
        if socket.type == 'RGBA' and (colours := [s for s in node.inputs if s.type == 'RGBA' and s.is_linked]):
            return self.colour(node, colours[0].identifier, stack)
        return np.full((1, 1) if socket.type == 'VALUE' else (3, 1, 1), 0.5, np.float32)

    def _uv_map(self, node, _socket, _stack) -> Values:
        return self._uv(node.uv_map)

    def _coordinates(self, node, socket, stack) -> Values:
        return self._uv("") if socket.identifier == "UV" else self._unknown(node, socket, stack)

    def _attribute(self, node, socket, stack) -> Values:
        if node.type == 'ATTRIBUTE' and node.attribute_type != 'GEOMETRY':
            return self._unknown(node, socket, stack)
        name = node.attribute_name if node.type == 'ATTRIBUTE' else node.layer_name
        if self._points.is_map(name) and socket.identifier in {"Color", "Vector"}:
            return self._uv(name)
        values = self._points.attribute(name)
        if socket.identifier == "Alpha":
            return values[3]
        return values[:3].mean(axis=0) if socket.identifier == "Fac" else values[:3]

    def _mapping(self, node, _socket, stack) -> Values:
        vector = self.colour(node, "Vector", stack)
        shift, turn, scale = (self.colour(node, key, stack) for key in ("Location", "Rotation", "Scale"))
        shift, turn, scale = (values.mean(axis=(1, 2), keepdims=True) for values in (shift, turn, scale))
        linear = np.array(Euler(turn.ravel().tolist()).to_matrix()) @ np.diag(scale.ravel().astype(np.float64))
        move = shift if node.vector_type in {'POINT', 'TEXTURE'} else np.zeros_like(shift)
        if node.vector_type == 'TEXTURE':
            linear, vector = np.linalg.pinv(linear), vector - move
            move = np.zeros_like(shift)
        self._scale *= float(np.sqrt(abs(np.linalg.det(linear[:2, :2]))))
        return np.tensordot(linear.astype(np.float32), vector, axes=1) + move

    def _mix(self, node, socket, stack) -> Values:
        kind = node.data_type
        if kind not in {'FLOAT', 'VECTOR', 'RGBA'}:
            return self._unknown(node, socket, stack)
        word = {'FLOAT': "Float", 'VECTOR': "Vector", 'RGBA': "Color"}[kind]
        if kind == 'VECTOR' and node.factor_mode == 'NON_UNIFORM':
            factor = self.colour(node, "Factor_Vector", stack)
        else:
            factor = self.number(node, "Factor_Float", stack)
        factor = np.clip(factor, 0, 1) if node.clamp_factor else factor
        read = self.number if kind == 'FLOAT' else self.colour
        a, b = read(node, f"A_{word}", stack), read(node, f"B_{word}", stack)
        made = self._blend(node.blend_type if kind == 'RGBA' else 'MIX', a, b, factor)
        return np.clip(made, 0, 1) if kind == 'RGBA' and node.clamp_result else made

    def _mix_rgb(self, node, _socket, stack) -> Values:
        a, b = self.colour(node, "Color1", stack), self.colour(node, "Color2", stack)
        made = self._blend(node.blend_type, a, b, np.clip(self.number(node, "Fac", stack), 0, 1))
        return np.clip(made, 0, 1) if node.use_clamp else made

    def _blend(self, kind: str, a: Values, b: Values, factor: Values) -> Values:
        if kind not in {'MIX', 'MULTIPLY', 'ADD', 'SUBTRACT', 'SCREEN', 'LINEAR_LIGHT'}:
            self._points.uneven()
        return BLENDS[kind](a, b, factor)

    def _hue_saturation(self, node, _socket, stack) -> Values:
        keys = ("Hue", "Saturation", "Value", "Fac")
        return hue_saturation(self.colour(node, "Color", stack), *(self.number(node, key, stack) for key in keys))

    def _gamma(self, node, _socket, stack) -> Values:
        return np.maximum(self.colour(node, "Color", stack), 0) ** self.number(node, "Gamma", stack)

    def _contrast(self, node, _socket, stack) -> Values:
        bright, contrast = self.number(node, "Bright", stack), self.number(node, "Contrast", stack)
        return np.maximum((1 + contrast) * self.colour(node, "Color", stack) + bright - contrast * 0.5, 0)

    def _invert(self, node, _socket, stack) -> Values:
        colour, factor = self.colour(node, "Color", stack), self.number(node, "Fac", stack)
        return colour + factor * (1 - 2 * colour)

    def _math(self, node, socket, stack) -> Values:
        made = self._compute(node, socket, [s for s in node.inputs if s.enabled], stack, self.number)
        return np.clip(made, 0, 1) if node.use_clamp else made

    def _vector_math(self, node, socket, stack) -> Values:
        if node.operation == 'SCALE':
            scale = self.number(node, "Scale", stack)
            self._scale *= abs(float(scale.mean()))
            return self.colour(node, "Vector", stack) * scale
        operands = [s for s in node.inputs if s.enabled and s.type == 'VECTOR']
        if node.operation in {'DOT_PRODUCT', 'LENGTH', 'DISTANCE'}:
            first, *rest = (self.colour(node, s.identifier, stack) for s in operands)
            if node.operation == 'DOT_PRODUCT':
                return (first * rest[0]).sum(axis=0)
            return np.sqrt(((first - (rest[0] if rest else 0)) ** 2).sum(axis=0))
        made = self._compute(node, socket, operands, stack, self.colour)
        if node.operation == 'MULTIPLY' and not operands[1].is_linked:
            self._scale *= float(np.sqrt(abs(np.prod(operands[1].default_value[:2]))))
        return made

    def _compute(self, node, socket, operands, stack: Stack, read: Callable) -> Values:
        work = MATHS.get(node.operation)
        if work is None:
            return self._unknown(node, socket, stack)
        if node.operation in STEPS:
            self._points.uneven()
        return work(*(read(node, socket.identifier, stack) for socket in operands))

    def _ramp(self, node, socket, stack) -> Values:
        self._points.uneven()
        table = self._table(node, lambda x: node.color_ramp.evaluate(x))
        made = _looked_up(table, self.number(node, "Fac", stack))
        return made[3] if socket.identifier == "Alpha" else made[:3]

    def _curve(self, node, _socket, stack) -> Values:
        mapping = node.mapping
        mapping.initialize()
        single = node.type == 'CURVE_FLOAT'
        # The last curve of colours is for all of them, and comes first.
        curves = list(mapping.curves)
        if single:
            table = self._table(node, lambda x: [mapping.evaluate(curves[0], x)])
            value, factor = self.number(node, "Value", stack), self.number(node, "Factor", stack)
            return value + factor * (_looked_up(table, value)[0] - value)
        table = self._table(node, lambda x: [mapping.evaluate(c, mapping.evaluate(curves[3], x)) for c in curves[:3]])
        colour, factor = self.colour(node, "Color", stack), self.number(node, "Fac", stack)
        made = np.stack([_looked_up(table[:, i : i + 1], colour[i])[0] for i in range(3)])
        return colour + factor * (made - colour)

    def _table(self, node: bpy.types.Node, value: Callable[[float], list[float]]) -> NDArray[np.float32]:
        key = node.as_pointer()
        if key not in self._curves:
            self._curves[key] = np.array([list(value(x)) for x in np.linspace(0, 1, _CURVE).tolist()], np.float32)
        return self._curves[key]

    def _map_range(self, node, socket, stack) -> Values:
        if node.data_type != 'FLOAT' or node.interpolation_type == 'STEPPED':
            return self._unknown(node, socket, stack)
        self._points.uneven()
        keys = ("Value", "From Min", "From Max", "To Min", "To Max")
        values = [self.number(node, key, stack) for key in keys]
        made = map_range(*values, node.interpolation_type)
        if node.clamp and node.interpolation_type == 'LINEAR':
            made = np.clip(made, np.minimum(values[3], values[4]), np.maximum(values[3], values[4]))
        return made

    def _clamp(self, node, _socket, stack) -> Values:
        value, low, high = (self.number(node, key, stack) for key in ("Value", "Min", "Max"))
        self._points.uneven()
        return np.minimum(np.maximum(value, low), high)

    def _grey(self, node, _socket, stack) -> Values:
        return luminance(self.colour(node, "Color", stack))

    def _separate(self, node, socket, stack) -> Values:
        if getattr(node, "mode", 'RGB') != 'RGB':
            return self._unknown(node, socket, stack)
        part = [s.identifier for s in node.outputs].index(socket.identifier)
        return self.colour(node, node.inputs[0].identifier, stack)[part]

    def _combine(self, node, socket, stack) -> Values:
        if getattr(node, "mode", 'RGB') != 'RGB':
            return self._unknown(node, socket, stack)
        parts = [self.number(node, s.identifier, stack) for s in node.inputs[:3]]
        return np.stack(np.broadcast_arrays(*parts))


_NODES: dict[str, Callable[..., Values]] = {
    'UVMAP': NodeValues._uv_map,
    'TEX_COORD': NodeValues._coordinates,
    'ATTRIBUTE': NodeValues._attribute,
    'VERTEX_COLOR': NodeValues._attribute,
    'MAPPING': NodeValues._mapping,
    'MIX': NodeValues._mix,
    'MIX_RGB': NodeValues._mix_rgb,
    'HUE_SAT': NodeValues._hue_saturation,
    'GAMMA': NodeValues._gamma,
    'BRIGHTCONTRAST': NodeValues._contrast,
    'INVERT': NodeValues._invert,
    'MATH': NodeValues._math,
    'VECT_MATH': NodeValues._vector_math,
    'VALTORGB': NodeValues._ramp,
    'CURVE_RGB': NodeValues._curve,
    'CURVE_FLOAT': NodeValues._curve,
    'MAP_RANGE': NodeValues._map_range,
    'CLAMP': NodeValues._clamp,
    'RGBTOBW': NodeValues._grey,
    'SEPARATE_COLOR': NodeValues._separate,
    'SEPXYZ': NodeValues._separate,
    'COMBINE_COLOR': NodeValues._combine,
    'COMBXYZ': NodeValues._combine,
}


def source_of(socket: bpy.types.NodeSocket, stack: Stack) -> tuple[bpy.types.NodeSocket | None, Stack]:
    """The output that feeds an input, through groups, reroutes and what is switched off, and the groups it is in.

    None where nothing feeds it. An input where nothing feeds that one, of a group or of a node that is switched off.
    """
    entered = False
    while True:
        link = next((link for link in socket.links if link.is_valid and not link.is_muted), None)
        if link is None:
            return (socket if entered else None), stack
        source, node = link.from_socket, link.from_node
        if node.type == 'REROUTE':
            socket = node.inputs[0]
            if not socket.is_linked:
                return None, stack
        elif node.type == 'GROUP_INPUT' and stack:
            socket, stack, entered = find_socket(stack[-1].inputs, source.identifier), stack[:-1], True
        elif node.mute:
            inside = next((pair for pair in node.internal_links if pair.to_socket == source), None)
            if inside is None:
                return None, stack
            socket, entered = inside.from_socket, True
        elif node.type == 'GROUP' and node.node_tree is not None:
            end = next((n for n in node.node_tree.nodes if n.type == 'GROUP_OUTPUT' and n.is_active_output), None)
            if end is None:
                return None, stack
            stack = (*stack, node)
            socket, entered = find_socket(end.inputs, source.identifier), True
        else:
            return source, stack


def _constant(socket: bpy.types.NodeSocket) -> Values:
    value = getattr(socket, "default_value", 0.0)
    if hasattr(value, "__len__"):
        return np.array(value[:3], np.float32).reshape(3, 1, 1)
    return np.full((1, 1), float(value), np.float32)


def _looked_up(table: NDArray[np.float32], place: Values) -> Values:
    """Rows of a table over [0, 1] at some places: (columns, p, k), linear between rows."""
    x = np.clip(np.nan_to_num(place), 0, 1) * np.float32(_CURVE - 1)
    row = np.minimum(x.astype(np.int32), _CURVE - 2)
    x = x - row
    return np.stack([column[row] * (1 - x) + column[row + 1] * x for column in table.T])
