# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounding volumes of sub-plants of every order, from the ranges alone (paper, section 5).

Computed from the highest order down to the trunk: the longest possible branch at every angle that it may take. The
volume is a cylinder about the branch's axis for a branch of unit length; what does not scale with the length (leaves,
thickness) is a pad.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .crown_shapes import crown_ratio
from .species import MAX_ORDERS

_SLABS = 48
_ANGLES = 33
_CROWN_SLOPE = 1 / 0.3  # steepest of the crown shapes


def _axis_envelope(row: NDArray[np.void]) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """At each knot of a unit branch: widest radius, lowest and highest z; and the widest turn of each segment."""
    segments = int(row["segments"])
    mean, variation = row["curvature"]
    back = np.where(2 * np.arange(segments) < segments, abs(mean), abs(row["curvature_tip"]))
    # A joint bends back by a, then aside by b: cos c = cos a cos b, and c² ≤ a² + b². Turns of joints add up at most.
    joint = np.hypot(back + variation, variation) / segments
    joint[0] = 0  # the first segment sets out straight
    turn = np.minimum(np.cumsum(joint), np.pi)
    sideways = np.sin(np.minimum(turn, np.pi / 2)) / segments
    radius = np.concatenate([[0], np.cumsum(sideways)])
    low = np.concatenate([[0], np.cumsum(np.cos(turn)) / segments])
    high = np.linspace(0, 1, segments + 1)
    return radius, low, high, turn


def _tilted(bound: NDArray, angle: NDArray, scale: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Radius, lowest and highest z of scaled cylinders tilted by angles; the cylinders contain their base point.

    ``angle`` is (m, a), samples of the interval that each may take; ``scale`` is (m,).
    """
    radius, z0, z1 = bound
    sin, cos = np.sin(angle), np.cos(angle)
    reach = max(z1, -z0)
    # Farthest from the axis: on the rim, where the gradient along the rim vanishes or at its outermost point.
    c = np.clip(reach * cos / np.maximum(radius * sin, 1e-12), -1, 1)
    far = np.sqrt((reach * sin + radius * c * cos) ** 2 + radius**2 * (1 - c**2))
    top = np.maximum(z1 * cos, z0 * cos) + radius * sin
    bottom = np.minimum(z0 * cos, z1 * cos) - radius * sin
    # Between two samples nothing moves farther than half a step times the distance from the base.
    slack = 0.5 * np.ptp(angle, axis=1) / (_ANGLES - 1) * np.hypot(reach, radius)
    return scale * (far.max(1) + slack), scale * (bottom.min(1) - slack), scale * (top.max(1) + slack)


def unit_bounds(rows: NDArray[np.void]) -> NDArray[np.float64]:
    """Cylinders that hold every axis of every sub-plant whose branch has unit length.

    Parameters
    ----------
    rows : (r,) table of `rows.build_rows`

    Returns
    -------
    (r, 3) float64
        Radius, lowest and highest z, in the frame of the branch's base; z is at most 0 at the bottom and at least 0 on
        top.
    """
    bounds = np.zeros((len(rows), 3))
    for order in range(MAX_ORDERS - 1, -1, -1):
        for index in range(order, len(rows), MAX_ORDERS):
            if rows["used"][index]:
                child = index + 1 if rows["branches"][index].sum() > 0 else None
                bounds[index] = _unit_bound(rows, index, None if child is None else bounds[child])
    return bounds


def _unit_bound(rows: NDArray[np.void], index: int, child_bound: NDArray | None) -> NDArray[np.float64]:
    row = rows[index]
    radius, low, high, turn = _axis_envelope(row)
    bound = np.array([radius.max(), min(low.min(), 0.0), max(high.max(), 0.0)])
    if child_bound is None:
        return bound
    child = rows[index + 1]
    share = np.linspace(0, 1, _SLABS + 1)
    t = row["branch_start"] + (1 - row["branch_start"]) * share
    knot_t = np.linspace(0, 1, len(radius))
    r, lo, hi = (np.interp(t, knot_t, v) for v in (radius, low, high))
    first = np.minimum((t[:-1] * row["segments"]).astype(int), len(turn) - 1)
    last = np.minimum((t[1:] * row["segments"]).astype(int), len(turn) - 1)
    dev = np.maximum(turn[first], turn[last])
    base, variation = child["angle"]
    lean = base + (child["angle_tip"] - base) * share
    least = np.clip(np.minimum(lean[:-1], lean[1:]) - variation - dev, 0, np.pi)
    most = np.clip(np.maximum(lean[:-1], lean[1:]) + variation + dev, 0, np.pi)
    angle = np.linspace(least, most, _ANGLES, axis=1)
    inner = np.linspace(share[:-1], share[1:], 5, axis=1)
    crown = crown_ratio(np.full(inner.shape, row["crown"]), 1 - inner).max(1) + _CROWN_SLOPE / _SLABS / 8
    far, bottom, top = _tilted(child_bound, angle, np.minimum(crown, 1) * child["length"].sum())
    # Between a slab's ends nothing sticks out: radius and height grow along the axis, the lowest height is concave.
    bound[0] = max(bound[0], (np.maximum(r[:-1], r[1:]) + far).max())
    bound[1] = min(bound[1], (np.minimum(lo[:-1], lo[1:]) + bottom).min())
    bound[2] = max(bound[2], (np.maximum(hi[:-1], hi[1:]) + top).max())
    return bound
