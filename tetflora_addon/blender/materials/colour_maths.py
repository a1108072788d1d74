# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What shader nodes compute with numbers and colours, as Cycles does it, on arrays.

Numbers are arrays (p, k), colours (3, p, k); what is the same everywhere is (1, 1) and (3, 1, 1).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float32]
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def luminance(colour: Values) -> Values:
    """Lightness (p, k) of linear Rec. 709."""
    return np.tensordot(_LUMINANCE, colour, axes=1)


def _ratio(a: Values, b: Values) -> Values:
    return np.divide(a, b, out=np.zeros(np.broadcast_shapes(a.shape, b.shape), np.float32), where=b != 0)


def _mod(a: Values, b: Values) -> Values:
    return a - np.trunc(_ratio(a, b)) * b


def _wrap(a: Values, high: Values, low: Values) -> Values:
    span = high - low
    return np.where(span != 0, a - span * np.floor(_ratio(a - low, span)), low)


def _ping_pong(a: Values, b: Values) -> Values:
    turns = _ratio(a - b, 2 * b)
    return np.where(b != 0, np.abs((turns - np.floor(turns)) * b * 2 - b), 0)


#: Operations of nodes *Math* and, for each component, *Vector Math*; with as many operands as they need.
MATHS: dict[str, Callable[..., Values]] = {
    'ADD': lambda a, b: a + b,
    'SUBTRACT': lambda a, b: a - b,
    'MULTIPLY': lambda a, b: a * b,
    'DIVIDE': _ratio,
    'MULTIPLY_ADD': lambda a, b, c: a * b + c,
    'POWER': lambda a, b: np.where((a > 0) | (b == np.rint(b)), np.power(np.where(a == 0, 1e-30, a), b), 0),
    'LOGARITHM': lambda a, b: _ratio(np.log(np.maximum(a, 1e-30)), np.log(np.maximum(b, 1e-30))),
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
    'FRACT': lambda a: a - np.floor(a),
    'FRACTION': lambda a: a - np.floor(a),
    'MODULO': _mod,
    'FLOORED_MODULO': lambda a, b: a - np.floor(_ratio(a, b)) * b,
    'WRAP': _wrap,
    'SNAP': lambda a, b: np.floor(_ratio(a, b)) * b,
    'PINGPONG': _ping_pong,
    'SINE': np.sin,
    'COSINE': np.cos,
    'RADIANS': np.deg2rad,
    'DEGREES': np.rad2deg,
}
#: Operations whose mean over a piece of an image is far from that of the mean.
STEPS = {'LESS_THAN', 'GREATER_THAN', 'COMPARE', 'SIGN', 'ROUND', 'FLOOR', 'CEIL', 'TRUNC', 'FRACT', 'FRACTION'}
STEPS |= {'MODULO', 'FLOORED_MODULO', 'WRAP', 'SNAP', 'PINGPONG', 'POWER', 'MINIMUM', 'MAXIMUM'}


def _overlay(a: Values, b: Values, t: Values) -> Values:
    low = a * ((1 - t) + 2 * t * b)
    return np.where(a < 0.5, low, 1 - ((1 - t) + 2 * t * (1 - b)) * (1 - a))


def _burn(a: Values, b: Values, t: Values) -> Values:
    under = 1 - t + t * b
    return np.where(under <= 0, 0, np.clip(1 - _ratio(1 - a, np.broadcast_to(under, a.shape)), 0, 1))


def _dodge(a: Values, b: Values, t: Values) -> Values:
    under = 1 - t * b
    return np.where(a == 0, 0, np.where(under <= 0, 1, np.minimum(_ratio(a, under), 1)))


def _hue_of(a: Values, b: Values, t: Values) -> Values:
    first, second = to_hsv(a), to_hsv(b)
    other = from_hsv(np.stack(np.broadcast_arrays(second[0], first[1], first[2])))
    return np.where(second[1] != 0, (1 - t) * a + t * other, a)


def _saturation_of(a: Values, b: Values, t: Values) -> Values:
    first, second = to_hsv(a), to_hsv(b)
    other = (1 - t) * first[1] + t * second[1]
    return np.where(first[1] != 0, from_hsv(np.stack(np.broadcast_arrays(first[0], other, first[2]))), a)


def _value_of(a: Values, b: Values, t: Values) -> Values:
    first, second = to_hsv(a), to_hsv(b)
    return from_hsv(np.stack(np.broadcast_arrays(first[0], first[1], (1 - t) * first[2] + t * second[2])))


def _colour_of(a: Values, b: Values, t: Values) -> Values:
    first, second = to_hsv(a), to_hsv(b)
    other = from_hsv(np.stack(np.broadcast_arrays(second[0], second[1], first[2])))
    return np.where(second[1] != 0, (1 - t) * a + t * other, a)


#: Ways to mix two colours by a factor.
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
    'HUE': _hue_of,
    'SATURATION': _saturation_of,
    'COLOR': _colour_of,
    'VALUE': _value_of,
}


def to_hsv(colour: Values) -> Values:
    """Hue, saturation and value of RGB."""
    most, least = colour.max(axis=0), colour.min(axis=0)
    span = most - least
    r, g, b = _ratio(most - colour, np.broadcast_to(span, colour.shape))
    hue = np.where(colour[0] == most, b - g, np.where(colour[1] == most, 2 + r - b, 4 + g - r)) / 6
    hue = np.where(span > 0, hue - np.floor(hue), 0)
    return np.stack([hue, _ratio(span, most), most])


def from_hsv(colour: Values) -> Values:
    """RGB of hue, saturation and value."""
    hue, saturation, value = colour
    shift = np.array([0, 4, 2], np.float32).reshape(3, *[1] * hue.ndim)
    turn = (hue * 6 + shift) % 6
    return value * (1 - saturation * (1 - np.clip(np.abs(turn - 3) - 1, 0, 1)))


def hue_saturation(colour: Values, hue: Values, saturation: Values, value: Values, factor: Values) -> Values:
    """The node *Hue/Saturation/Value*."""
    h, s, v = to_hsv(colour)
    h = h + hue + np.float32(0.5)
    made = from_hsv(np.stack(np.broadcast_arrays(h - np.floor(h), np.clip(s * saturation, 0, 1), v * value)))
    return np.maximum(colour + factor * (made - colour), 0)


def map_range(value: Values, low: Values, high: Values, to_low: Values, to_high: Values, kind: str) -> Values:
    """The node *Map Range*, but for steps."""
    x = _ratio(value - low, high - low)
    if kind != 'LINEAR':
        x = np.clip(x, 0, 1)
        x = x * x * (3 - 2 * x) if kind == 'SMOOTHSTEP' else x * x * x * (x * (x * 6 - 15) + 10)
    return to_low + x * (to_high - to_low)
