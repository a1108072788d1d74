# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shaders and nodes of materials, evaluated by numpy at points of a surface.

Nodes that only a renderer knows let the first color that feeds them pass; where none does, as in noise, they count with
one half. What depends on the direction of a ray, or on which instance it is, counts with its mean.

Numbers are arrays (p, k), colors (3, p, k); what is the same everywhere is (1, 1) and (3, 1, 1).
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from bpy.types import ColorRamp, CurveMapping, Node, NodeSocket
from mathutils import Euler

from ...arrays import Floats32
from .nodes import SNOW, find_socket

Values = Floats32
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def settings_of(table: ColorRamp | CurveMapping) -> tuple:
    """All that the values of a ramp or of curves follow from."""
    if isinstance(table, ColorRamp):
        parts = [(e.position, *e.color) for e in table.elements]
        return table.interpolation, table.color_mode, table.hue_interpolation, parts
    ends = table.clip_min_x, table.clip_min_y, table.clip_max_x, table.clip_max_y
    points = [[(*p.location, p.handle_type) for p in curve.points] for curve in table.curves]
    return table.extend, table.use_clip, ends, points


def luminance(color: Values) -> Values:
    """Lightness (p, k) of linear Rec. 709."""
    return np.tensordot(_LUMINANCE, color, axes=1)


def _ratio(a: Values, b: Values) -> Values:
    return np.divide(a, b, out=np.zeros(np.broadcast_shapes(a.shape, b.shape), np.float32), where=b != 0)


def _fraction(a: Values) -> Values:
    return a - np.floor(a)


#: Operations of nodes *Math* and, for each component, *Vector Math*; with as many operands as they need.
MATHS: dict[str, Callable[..., Values]] = {
    'ADD': lambda a, b: a + b,
    'SUBTRACT': lambda a, b: a - b,
    'MULTIPLY': lambda a, b: a * b,
    'DIVIDE': _ratio,
    'MULTIPLY_ADD': lambda a, b, c: a * b + c,
    'POWER': lambda a, b: np.where((a > 0) | (b == np.rint(b)), np.power(np.where(a == 0, 1e-30, a), b), 0),
    'LOGARITHM': lambda a, b: _ratio(np.log(np.where(a > 0, a, 1)), np.log(np.where(b > 0, b, 1))),
    'SQRT': lambda a: np.sqrt(np.maximum(a, 0)),
    'INVERSE_SQRT': lambda a: _ratio(np.float32(1), np.sqrt(np.maximum(a, 0))),
    'ABSOLUTE': np.abs,
    'EXPONENT': lambda a: np.exp(np.minimum(a, 80)),
    'MINIMUM': np.minimum,
    'MAXIMUM': np.maximum,
    'LESS_THAN': lambda a, b: (a < b).astype(np.float32),
    'GREATER_THAN': lambda a, b: (a > b).astype(np.float32),
    'SIGN': np.sign,
    'COMPARE': lambda a, b, c: (np.abs(a - b) <= np.maximum(c, 1e-5)).astype(np.float32),
    'ROUND': lambda a: np.floor(a + np.float32(0.5)),
    'FLOOR': np.floor,
    'CEIL': np.ceil,
    'TRUNC': np.trunc,
    'FRACT': _fraction,
    'FRACTION': _fraction,
    'MODULO': lambda a, b: np.where(b != 0, a - np.trunc(_ratio(a, b)) * b, 0),
    'FLOORED_MODULO': lambda a, b: np.where(b != 0, a - np.floor(_ratio(a, b)) * b, 0),
    'WRAP': lambda a, high, low: np.where(high != low, a - (high - low) * np.floor(_ratio(a - low, high - low)), low),
    'SNAP': lambda a, b: np.floor(_ratio(a, b)) * b,
    'PINGPONG': lambda a, b: np.where(b != 0, np.abs(_fraction(_ratio(a - b, 2 * b)) * b * 2 - b), 0),
    'SINE': np.sin,
    'COSINE': np.cos,
    'RADIANS': np.deg2rad,
    'DEGREES': np.rad2deg,
}
#: Operations whose mean over a piece of an image is far from that of the mean.
STEPS = {'LESS_THAN', 'GREATER_THAN', 'COMPARE', 'SIGN', 'ROUND', 'FLOOR', 'CEIL', 'TRUNC', 'FRACT', 'FRACTION'}
STEPS |= {'MODULO', 'FLOORED_MODULO', 'WRAP', 'SNAP', 'PINGPONG', 'POWER', 'MINIMUM', 'MAXIMUM'}


def _overlay(a: Values, b: Values, t: Values) -> Values:
    return np.where(a < 0.5, a * ((1 - t) + 2 * t * b), 1 - ((1 - t) + 2 * t * (1 - b)) * (1 - a))


def _burn(a: Values, b: Values, t: Values) -> Values:
    under = 1 - t + t * b
    return np.where(under <= 0, 0, np.clip(1 - _ratio(1 - a, np.broadcast_to(under, a.shape)), 0, 1))


def _dodge(a: Values, b: Values, t: Values) -> Values:
    under = 1 - t * b
    return np.where(a == 0, 0, np.where(under <= 0, 1, np.minimum(_ratio(a, under), 1)))


def _tinted(channels: tuple[int, ...]) -> Callable[[Values, Values, Values], Values]:
    """A mix by a factor with what has some of another color's hue, saturation and value; grays give no hue."""

    def blend(a: Values, b: Values, t: Values) -> Values:
        first, second = to_hsv(a), to_hsv(b)
        other = from_hsv(_stacked(*((second if n in channels else first)[n] for n in range(3))))
        return np.where(second[1] != 0, (1 - t) * a + t * other, a)

    return blend


def _graded(channel: int) -> Callable[[Values, Values, Values], Values]:
    """A mix of saturations or values alone; grays have no saturation that could be changed."""

    def blend(a: Values, b: Values, t: Values) -> Values:
        parts, second = list(to_hsv(a)), to_hsv(b)
        known = (parts[1] != 0) | (channel == 2)
        parts[channel] = (1 - t) * parts[channel] + t * second[channel]
        return np.where(known, from_hsv(_stacked(*parts)), a)

    return blend


def _stacked(*parts: Values) -> Values:
    return np.stack(np.broadcast_arrays(*parts))


#: Ways to mix two colors by a factor.
BLENDS: dict[str, Callable[[Values, Values, Values], Values]] = {
    'MIX': lambda a, b, t: a + t * (b - a),
    'DARKEN': lambda a, b, t: a + t * (np.minimum(a, b) - a),
    'MULTIPLY': lambda a, b, t: a * (1 - t + t * b),
    'BURN': _burn,
    'LIGHTEN': lambda a, b, t: a + t * (np.maximum(a, b) - a),
    'SCREEN': lambda a, b, t: 1 - (1 - t + t * (1 - b)) * (1 - a),
    'DODGE': _dodge,
    'ADD': lambda a, b, t: a + t * b,
    'OVERLAY': _overlay,
    'SOFT_LIGHT': lambda a, b, t: (1 - t) * a + t * ((1 - a) * b * a + a * (1 - (1 - b) * (1 - a))),
    'LINEAR_LIGHT': lambda a, b, t: a + t * (2 * b - 1),
    'DIFFERENCE': lambda a, b, t: a + t * (np.abs(a - b) - a),
    'EXCLUSION': lambda a, b, t: np.maximum(a + t * (a + b - 2 * a * b - a), 0),
    'SUBTRACT': lambda a, b, t: a - t * b,
    'DIVIDE': lambda a, b, t: np.where(b != 0, (1 - t) * a + t * _ratio(a, b), a),
    'HUE': _tinted((0,)),
    'SATURATION': _graded(1),
    'COLOR': _tinted((0, 1)),
    'VALUE': _graded(2),
}


def to_hsv(color: Values) -> Values:
    """Hue, saturation and value of RGB."""
    most, least = color.max(axis=0), color.min(axis=0)
    span = most - least
    r, g, b = _ratio(most - color, np.broadcast_to(span, color.shape))
    hue = np.where(color[0] == most, b - g, np.where(color[1] == most, 2 + r - b, 4 + g - r)) / 6
    return np.stack([np.where(span > 0, hue - np.floor(hue), 0), _ratio(span, most), most])


def from_hsv(color: Values) -> Values:
    """RGB of hue, saturation and value."""
    hue, saturation, value = color
    turn = (hue * 6 + np.array([0, 4, 2], np.float32).reshape(3, *[1] * hue.ndim)) % 6
    return value * (1 - saturation * (1 - np.clip(np.abs(turn - 3) - 1, 0, 1)))


Stack = tuple[Node, ...]  # groups that the walk is in
_CURVE = 1025  # points at which ramps and curves are known
# Means over directions of diffuse light, of Fresnel's fraction for 1.45 and 1 less the cosine; and over instances.
_MEANS = {(kind, "Random"): 0.5 for kind in ('OBJECT_INFO', 'PARTICLE_INFO', 'HAIR_INFO')}
_MEANS |= {('FRESNEL', "Fac"): 0.09, ('LAYER_WEIGHT', "Fresnel"): 0.09, ('LAYER_WEIGHT', "Facing"): 0.33}
_MEANS |= {('NEW_GEOMETRY', "Backfacing"): 0.5, ('NEW_GEOMETRY', "Random Per Island"): 0.5}
_MEANS |= {('LIGHT_PATH', "Is Camera Ray"): 1.0}


class ImageMissing(Exception):
    """An image that cannot be read; the text tells the artist."""


#: Shaders by the input of their color, and what they let through of the light that they scatter.
_SIMPLE = {
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
    """What points of a surface do with light."""

    cover: Values  # (p, k): fraction that is not transparent
    color: Values  # (3, p, k): fraction of light that is scattered to either side; none where transparent
    through: Values  # (p, k): lightness of the part that leaves on the other side


_ONE, _NONE = np.ones((1, 1), np.float32), np.zeros((1, 1), np.float32)
_BLACK = np.zeros((3, 1, 1), np.float32)
_UNLIT = Scattered(_ONE, _BLACK, _NONE)


class NodeValues:
    """Evaluates a material at some points.

    Parameters
    ----------
    points : face_looks.Plan
        Of the material: its one point that stands for all, or points (p, k) of k triangles.
    curves : dict
        Ramps and curves as tables, by `settings_of`; kept from one call to the next.
    """

    def __init__(self, points: Any, curves: dict[str, Floats32]) -> None:
        self._points, self._curves = points, curves
        self._images: dict[tuple[int, ...], tuple[Values, Values]] = {}
        self._scale, self._size = 1.0, np.zeros((1, 1), np.float32)

    # Shaders by type.

    def shader(self, socket: NodeSocket, stack: Stack = ()) -> Scattered:
        """What all points do with light by the shader that feeds a socket."""
        source, stack = source_of(socket, stack)
        if source is None or not source.is_output:
            return _UNLIT
        node = source.node
        if (simple := _SIMPLE.get(node.type)) is not None:
            color = self._tint(node, simple[0], stack)
            if node.type == 'EMISSION':
                color = color * self._part(node, "Strength", stack)
            return _solid(_ONE, color, np.full((1, 1), simple[1], np.float32))
        work = getattr(self, f"_shade_{node.type.lower()}", None)
        return _UNLIT if work is None else work(node, stack)

    def _shade_bsdf_principled(self, node: Node, stack: Stack) -> Scattered:
        color = self._tint(node, "Base Color", stack)
        glass, inside = (self._part(node, f"{name} Weight", stack) for name in ("Transmission", "Subsurface"))
        through = np.clip(np.maximum(glass, inside / 2), 0, 1)
        return _solid(np.clip(self._part(node, "Alpha", stack), 0, 1), color, through)

    def _shade_eevee_specular(self, node: Node, stack: Stack) -> Scattered:
        gone = np.clip(self._part(node, "Transparency", stack), 0, 1)
        return _solid(1 - gone, self._tint(node, "Base Color", stack), _NONE)

    def _shade_bsdf_transparent(self, node: Node, stack: Stack) -> Scattered:
        return Scattered(1 - luminance(self._tint(node, "Color", stack)), _BLACK, _NONE)

    def _shade_mix_shader(self, node: Node, stack: Stack) -> Scattered:
        if stack and stack[-1].node_tree.name.startswith(SNOW):  # looks are those without snow
            return self.shader(find_socket(node.inputs, "Shader"), stack)
        factor = np.clip(self._part(node, "Fac", stack), 0, 1)
        a, b = (self.shader(find_socket(node.inputs, key), stack) for key in ("Shader", "Shader_001"))
        return Scattered(*(x + factor * (y - x) for x, y in zip(a, b, strict=True)))

    def _shade_add_shader(self, node: Node, stack: Stack) -> Scattered:
        a, b = (self.shader(find_socket(node.inputs, key), stack) for key in ("Shader", "Shader_001"))
        # Light that either lets pass straight passes; more than all of it cannot.
        return Scattered(np.clip(a.cover + b.cover - 1, 0, 1), a.color + b.color, a.through + b.through)

    def _tint(self, node: Node, key: str, stack: Stack) -> Values:
        return np.clip(self._or_told(self.color, node, key, stack, self._points.viewport.reshape(3, 1, 1)), 0, 1)

    def _part(self, node: Node, key: str, stack: Stack) -> Values:
        missing = np.full((1, 1), {"Alpha": 1.0, "Strength": 1.0, "Fac": 0.5}.get(key, 0.0), np.float32)
        return self._or_told(self.number, node, key, stack, missing)

    def _or_told(self, read: Callable, node: Node, key: str, stack: Stack, missing: Values) -> Values:
        """An input; what stands for it where it needs an image that cannot be read, which is told."""
        try:
            return read(node, key, stack)
        except ImageMissing as error:
            self._points.tell(str(error))
            return missing

    # Sockets.

    def number(self, node: Node, key: str, stack: Stack) -> Values:
        """An input as a number (p, k)."""
        values, kind = self._input(node, key, stack)
        if values.ndim == 2:
            return values
        return values.mean(axis=0) if kind == 'VECTOR' else luminance(values)

    def color(self, node: Node, key: str, stack: Stack) -> Values:
        """An input as a color or vector (3, p, k)."""
        values, _ = self._input(node, key, stack)
        return np.broadcast_to(values, (3, *values.shape)) if values.ndim == 2 else values

    def _input(self, node: Node, key: str, stack: Stack) -> tuple[Values, str]:
        socket = find_socket(node.inputs, key)
        source, stack = source_of(socket, stack)
        if source is None or not source.is_output:  # what nothing feeds, of a group or of a node that is switched off
            return _constant(source or socket), (source or socket).type
        return self._output(source, stack), source.type

    def _output(self, socket: NodeSocket, stack: Stack) -> Values:
        node = socket.node
        if node.type == 'TEX_IMAGE':
            color, alpha = self._image(node, stack)
            return alpha if socket.identifier == "Alpha" else color
        if (mean := _MEANS.get((node.type, socket.identifier))) is not None:
            return np.full((1, 1), mean, np.float32)
        if node.type == 'LIGHT_PATH' and socket.identifier.startswith("Is "):
            return np.zeros((1, 1), np.float32)
        if node.type in {'RGB', 'VALUE'}:
            return _constant(node.outputs[0])
        with np.errstate(all="ignore"):
            return getattr(self, f"_of_{node.type.lower()}", self._unknown)(node, socket, stack)

    def _image(self, node: Node, stack: Stack) -> tuple[Values, Values]:
        key = tuple(n.as_pointer() for n in (node, *stack))
        if key not in self._images:
            outer, self._scale = self._scale, 1.0
            if source_of(find_socket(node.inputs, "Vector"), stack)[0] is None:
                u, v, self._size = self._points.uv("")
            else:
                self._size = np.zeros((1, 1), np.float32)
                u, v = self.color(node, "Vector", stack)[:2]
            pyramid = self._points.pyramid(node, self._scale)
            self._images[key] = pyramid.look(u, v, self._size * np.float32(self._scale), node.extension)
            self._scale = outer
        return self._images[key]

    def _uv(self, name: str) -> Values:
        u, v, self._size = self._points.uv(name)
        return np.stack([u, v, np.zeros_like(u)])

    # What nodes do, by type; each gets the node, the output that is asked for, and the groups that it is in.

    def _unknown(self, node, socket, stack) -> Values:
        self._points.unknown()
        if socket.type == 'RGBA' and (colors := [s for s in node.inputs if s.type == 'RGBA' and s.is_linked]):
            return self.color(node, colors[0].identifier, stack)
        return np.full((1, 1) if socket.type == 'VALUE' else (3, 1, 1), 0.5, np.float32)

    def _of_uvmap(self, node, _socket, _stack) -> Values:
        return self._uv(node.uv_map)

    def _of_tex_coord(self, node, socket, stack) -> Values:
        return self._uv("") if socket.identifier == "UV" else self._unknown(node, socket, stack)

    def _of_attribute(self, node, socket, stack) -> Values:
        if node.type == 'ATTRIBUTE' and node.attribute_type != 'GEOMETRY':
            return self._unknown(node, socket, stack)
        name = node.attribute_name if node.type == 'ATTRIBUTE' else node.layer_name
        if self._points.layers.types.get(name) == 'FLOAT2' and socket.identifier in {"Color", "Vector"}:
            return self._uv(name)
        values = self._points.attribute(name)
        if socket.identifier == "Alpha":
            return values[3]
        return values[:3].mean(axis=0) if socket.identifier == "Fac" else values[:3]

    def _of_mapping(self, node, _socket, stack) -> Values:
        vector = self.color(node, "Vector", stack)
        shift, turn, scale = (self.color(node, key, stack) for key in ("Location", "Rotation", "Scale"))
        shift, turn, scale = (values.mean(axis=(1, 2), keepdims=True) for values in (shift, turn, scale))
        scale = scale if node.vector_type != 'NORMAL' else _ratio(np.ones_like(scale), scale)
        linear = np.array(Euler(turn.ravel().tolist()).to_matrix()) @ np.diag(scale.ravel().astype(np.float64))
        move = shift if node.vector_type in {'POINT', 'TEXTURE'} else np.zeros_like(shift)
        if node.vector_type == 'TEXTURE':
            linear, vector, move = np.linalg.pinv(linear), vector - move, np.zeros_like(shift)
        self._scale *= float(np.sqrt(abs(np.linalg.det(linear[:2, :2]))))
        mapped = np.tensordot(linear.astype(np.float32), vector, axes=1) + move
        return mapped if node.vector_type != 'NORMAL' else _ratio(mapped, np.linalg.norm(mapped, axis=0, keepdims=True))

    def _of_mix(self, node, socket, stack) -> Values:
        kind = node.data_type
        if kind not in {'FLOAT', 'VECTOR', 'RGBA'}:
            return self._unknown(node, socket, stack)
        word = {'FLOAT': "Float", 'VECTOR': "Vector", 'RGBA': "Color"}[kind]
        if kind == 'VECTOR' and node.factor_mode == 'NON_UNIFORM':
            factor = self.color(node, "Factor_Vector", stack)
        else:
            factor = self.number(node, "Factor_Float", stack)
        factor = np.clip(factor, 0, 1) if node.clamp_factor else factor
        read = self.number if kind == 'FLOAT' else self.color
        a, b = read(node, f"A_{word}", stack), read(node, f"B_{word}", stack)
        mixed = self._blend(node.blend_type if kind == 'RGBA' else 'MIX', a, b, factor)
        return np.clip(mixed, 0, 1) if kind == 'RGBA' and node.clamp_result else mixed

    def _of_mix_rgb(self, node, _socket, stack) -> Values:
        a, b = self.color(node, "Color1", stack), self.color(node, "Color2", stack)
        mixed = self._blend(node.blend_type, a, b, np.clip(self.number(node, "Fac", stack), 0, 1))
        return np.clip(mixed, 0, 1) if node.use_clamp else mixed

    def _blend(self, kind: str, a: Values, b: Values, factor: Values) -> Values:
        if kind not in {'MIX', 'MULTIPLY', 'ADD', 'SUBTRACT', 'SCREEN', 'LINEAR_LIGHT'}:
            self._points.uneven = True
        return BLENDS[kind](a, b, factor)

    def _of_hue_sat(self, node, _socket, stack) -> Values:
        color, keys = self.color(node, "Color", stack), ("Hue", "Saturation", "Value", "Fac")
        hue, saturation, value, factor = (self.number(node, key, stack) for key in keys)
        h, s, v = to_hsv(color)
        h = h + hue + np.float32(0.5)
        shifted = from_hsv(_stacked(h - np.floor(h), np.clip(s * saturation, 0, 1), v * value))
        return np.maximum(color + factor * (shifted - color), 0)

    def _of_gamma(self, node, _socket, stack) -> Values:
        return np.maximum(self.color(node, "Color", stack), 0) ** self.number(node, "Gamma", stack)

    def _of_brightcontrast(self, node, _socket, stack) -> Values:
        bright, contrast = self.number(node, "Bright", stack), self.number(node, "Contrast", stack)
        return np.maximum((1 + contrast) * self.color(node, "Color", stack) + bright - contrast * 0.5, 0)

    def _of_invert(self, node, _socket, stack) -> Values:
        color, factor = self.color(node, "Color", stack), self.number(node, "Fac", stack)
        return color + factor * (1 - 2 * color)

    def _of_math(self, node, socket, stack) -> Values:
        values = self._compute(node, socket, [s for s in node.inputs if s.enabled], stack, self.number)
        return np.clip(values, 0, 1) if node.use_clamp else values

    def _of_vect_math(self, node, socket, stack) -> Values:
        if node.operation == 'SCALE':
            scale = self.number(node, "Scale", stack)
            self._scale *= abs(float(scale.mean()))
            return self.color(node, "Vector", stack) * scale
        operands = [s for s in node.inputs if s.enabled and s.type == 'VECTOR']
        if node.operation in {'DOT_PRODUCT', 'LENGTH', 'DISTANCE'}:
            first, *rest = (self.color(node, s.identifier, stack) for s in operands)
            if node.operation == 'DOT_PRODUCT':
                return (first * rest[0]).sum(axis=0)
            return np.sqrt(((first - (rest[0] if rest else 0)) ** 2).sum(axis=0))
        values = self._compute(node, socket, operands, stack, self.color)
        if node.operation == 'MULTIPLY' and not operands[1].is_linked:
            self._scale *= float(np.sqrt(abs(np.prod(operands[1].default_value[:2]))))
        return values

    def _compute(self, node, socket, operands, stack: Stack, read: Callable) -> Values:
        work = MATHS.get(node.operation)
        if work is None:
            return self._unknown(node, socket, stack)
        if node.operation in STEPS:
            self._points.uneven = True
        return work(*(read(node, socket.identifier, stack) for socket in operands))

    def _of_valtorgb(self, node, socket, stack) -> Values:
        self._points.uneven = True
        table = self._table(node.color_ramp, node.color_ramp.evaluate)
        rgba = _looked_up(table, self.number(node, "Fac", stack))
        return rgba[3] if socket.identifier == "Alpha" else rgba[:3]

    def _of_curve_rgb(self, node, _socket, stack) -> Values:
        mapping = node.mapping
        mapping.initialize()
        # The last curve of colors is for all of them, and comes first.
        curves = list(mapping.curves)
        if node.type == 'CURVE_FLOAT':
            table = self._table(mapping, lambda x: [mapping.evaluate(curves[0], x)])
            value, factor = self.number(node, "Value", stack), self.number(node, "Factor", stack)
            return value + factor * (_looked_up(table, value)[0] - value)
        table = self._table(
            mapping, lambda x: [mapping.evaluate(c, mapping.evaluate(curves[3], x)) for c in curves[:3]]
        )
        color, factor = self.color(node, "Color", stack), self.number(node, "Fac", stack)
        return color + factor * (np.stack([_looked_up(table[:, i : i + 1], color[i])[0] for i in range(3)]) - color)

    def _table(self, of: ColorRamp | CurveMapping, value: Callable[[float], Sequence[float]]) -> Floats32:
        key = repr(settings_of(of))  # between two steps a node may change, or another may have its address
        if key not in self._curves:
            self._curves[key] = np.array([list(value(x)) for x in np.linspace(0, 1, _CURVE).tolist()], np.float32)
        return self._curves[key]

    def _of_map_range(self, node, socket, stack) -> Values:
        if node.data_type != 'FLOAT' or node.interpolation_type == 'STEPPED':
            return self._unknown(node, socket, stack)
        self._points.uneven = True
        keys, kind = ("Value", "From Min", "From Max", "To Min", "To Max"), node.interpolation_type
        value, low, high, to_low, to_high = (self.number(node, key, stack) for key in keys)
        x = _ratio(value - low, high - low)
        if kind != 'LINEAR':
            x = np.clip(x, 0, 1)
            x = x * x * (3 - 2 * x) if kind == 'SMOOTHSTEP' else x * x * x * (x * (x * 6 - 15) + 10)
        mapped = to_low + x * (to_high - to_low)
        clamped = node.clamp and kind == 'LINEAR'
        return np.clip(mapped, np.minimum(to_low, to_high), np.maximum(to_low, to_high)) if clamped else mapped

    def _of_clamp(self, node, _socket, stack) -> Values:
        value, low, high = (self.number(node, key, stack) for key in ("Value", "Min", "Max"))
        self._points.uneven = True
        low, high = (low, high) if node.clamp_type == 'MINMAX' else (np.minimum(low, high), np.maximum(low, high))
        return np.minimum(np.maximum(value, low), high)

    def _of_rgbtobw(self, node, _socket, stack) -> Values:
        return luminance(self.color(node, "Color", stack))

    def _of_separate_color(self, node, socket, stack) -> Values:
        if getattr(node, "mode", 'RGB') != 'RGB':
            return self._unknown(node, socket, stack)
        part = [s.identifier for s in node.outputs].index(socket.identifier)
        return self.color(node, node.inputs[0].identifier, stack)[part]

    def _of_combine_color(self, node, socket, stack) -> Values:
        if getattr(node, "mode", 'RGB') != 'RGB':
            return self._unknown(node, socket, stack)
        return _stacked(*(self.number(node, s.identifier, stack) for s in node.inputs[:3]))

    _of_vertex_color, _of_curve_float = _of_attribute, _of_curve_rgb
    _of_sepxyz, _of_combxyz = _of_separate_color, _of_combine_color


def source_of(socket: NodeSocket, stack: Stack) -> tuple[NodeSocket | None, Stack]:
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


def _constant(socket: NodeSocket) -> Values:
    value = getattr(socket, "default_value", 0.0)
    if hasattr(value, "__len__"):
        return np.array(value[:3], np.float32).reshape(3, 1, 1)
    return np.full((1, 1), float(value), np.float32)


def _solid(cover: Values, color: Values, through: Values) -> Scattered:
    scattered = np.clip(color, 0, 1) * cover
    return Scattered(cover, scattered, luminance(scattered) * through)


def _looked_up(table: Floats32, place: Values) -> Values:
    """Rows of a table over [0, 1] at some places: (columns, p, k), linear between rows."""
    x = np.clip(np.nan_to_num(place), 0, 1) * np.float32(_CURVE - 1)
    row = np.minimum(x.astype(np.int32), _CURVE - 2)
    x = x - row
    return np.stack([column[row] * (1 - x) + column[row + 1] * x for column in table.T])
