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


#: Operations of nodes *Math* and, for each component, *Vector Math*; with as many operands as they need.
MATHS: dict[str, Callable[..., Values]] = {
    'ADD': lambda a, b: a + b,
    'SUBTRACT': lambda a, b: a - b,
    'MULTIPLY': lambda a, b: a * b,
    'DIVIDE': _ratio,
    'MULTIPLY_ADD': lambda a, b, c: a * b + c,
    'POWER': lambda a, b: np.where((a > 0) | (b == np.rint(b)), np.power(np.where(a == 0, 1e-30, a), b), 0),
    'SQRT': lambda a: np.sqrt(np.maximum(a, 0)),
    'ABSOLUTE': np.abs,
    'MINIMUM': np.minimum,
    'MAXIMUM': np.maximum,
    'LESS_THAN': lambda a, b: (a < b).astype(np.float32),
    'GREATER_THAN': lambda a, b: (a > b).astype(np.float32),
    'COMPARE': lambda a, b, c: (np.abs(a - b) <= np.maximum(c, 1e-5)).astype(np.float32),
    'ROUND': lambda a: np.floor(a + np.float32(0.5)),
    'FLOOR': np.floor,
    'CEIL': np.ceil,
    'FRACT': lambda a: a - np.floor(a),
    'FRACTION': lambda a: a - np.floor(a),
}
#: Operations whose mean over a piece of an image is far from that of the mean.
STEPS = {'LESS_THAN', 'GREATER_THAN', 'COMPARE', 'ROUND', 'FLOOR', 'CEIL', 'FRACT', 'FRACTION'}
STEPS |= {'POWER', 'MINIMUM', 'MAXIMUM'}


def _overlay(a: Values, b: Values, t: Values) -> Values:
    low = a * ((1 - t) + 2 * t * b)
    return np.where(a < 0.5, low, 1 - ((1 - t) + 2 * t * (1 - b)) * (1 - a))


def _hsv_blend(parts: tuple[bool, bool, bool], needed: int) -> Callable[[Values, Values, Values], Values]:
    """Takes some of hue, saturation and value from b; nothing where the saturation of a (0) or b (1) is zero."""

    def blend(a: Values, b: Values, t: Values) -> Values:
        both = to_hsv(a), to_hsv(b)
        other = from_hsv(np.stack(np.broadcast_arrays(*(both[part][i] for i, part in enumerate(parts)))))
        return np.where(both[needed][1] != 0, a + t * (other - a), a)

    return blend


#: Ways to mix two colours by a factor.
BLENDS: dict[str, Callable[[Values, Values, Values], Values]] = {
    'MIX': lambda a, b, t: a + t * (b - a),
    'DARKEN': lambda a, b, t: a + t * (np.minimum(a, b) - a),
    'MULTIPLY': lambda a, b, t: a * (1 - t + t * b),
    'LIGHTEN': lambda a, b, t: a + t * (np.maximum(a, b) - a),
    'SCREEN': lambda a, b, t: 1 - (1 - t + t * (1 - b)) * (1 - a),
    'ADD': lambda a, b, t: a + t * b,
    'OVERLAY': _overlay,
    'SOFT_LIGHT': lambda a, b, t: (1 - t) * a + t * ((1 - a) * b * a + a * (1 - (1 - b) * (1 - a))),
    'LINEAR_LIGHT': lambda a, b, t: a + t * (2 * b - 1),
    'DIFFERENCE': lambda a, b, t: a + t * (np.abs(a - b) - a),
    'SUBTRACT': lambda a, b, t: a - t * b,
    'DIVIDE': lambda a, b, t: np.where(b != 0, (1 - t) * a + t * _ratio(a, b), a),
    'HUE': _hsv_blend((True, False, False), 1),
    'SATURATION': _hsv_blend((False, True, False), 0),
    'COLOR': _hsv_blend((True, True, False), 1),
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
