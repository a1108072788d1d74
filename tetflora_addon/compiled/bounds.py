# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounding volumes of sub-plants of every order, from the ranges alone (paper, section 5).

Computed from the highest order down to the trunk: the longest possible branch at every angle that it may take. The
volume is a cylinder about the axis of a branch of length 1; what does not scale with it (leaves, thickness) is a pad.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Table
from ..growth.foliage import envelope_reach
from ..growth.rows import DEAD, FORK, LATERAL, NOW, SPUR
from ..growth.wind import widest_sway
from ..species.species import crown_ratio
from .samples import LIMB, Points

_SLABS = 48
_ANGLES = 33
_CROWN_SLOPE = 1 / 0.3  # steepest of the crown shapes


def _axis_envelope(row: Table) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """At each knot of a unit branch: widest radius, lowest and highest z; and the widest turn of each segment."""
    segments = int(row["segments"])
    # Turns of joints add up at most. The joint in the middle of an even number belongs to the outer half.
    joint = np.repeat(_joint_turns(row), [(segments + 1) // 2, segments // 2])
    joint[0] = widest_sway(row) / segments  # the first segment sets out straight, but for the wind
    turn = np.minimum(np.cumsum(joint), np.pi)
    radius = np.concatenate([[0], np.cumsum(np.sin(np.minimum(turn, np.pi / 2)) / segments)])
    return radius, np.concatenate([[0], np.cumsum(np.cos(turn)) / segments]), np.linspace(0, 1, segments + 1), turn


def _joint_turns(row: Table) -> Floats:
    """Widest turn (..., 2) of a joint of the inner and of the outer half of branches of rows (...)."""
    back = np.stack([np.abs(row["curvature"][..., 0]), np.abs(row["curvature_tip"])], axis=-1)
    variation = row["curvature"][..., 1, None]
    # A joint bends back by a, then aside by b: cos c = cos a cos b, and c² ≤ a² + b².
    pulled = np.abs(row["attraction"]).sum(axis=-1)[..., None]
    return (np.hypot(back + variation, variation) + pulled + widest_sway(row)[..., None]) / row["segments"][..., None]


def _ring_stretch(rows: Table) -> Floats:
    """Greatest distance (r,) of a tube's vertices from its axis at joints, in radii.

    A ring at a joint lies along the means of both segments' axes, made unit vectors. These need not be at right angles:
    between frames that a rotation by c separates, the cosine of their angle is at most (1 - cos c) / (3 + cos c),
    where the rotation's axis lies half way between them. A circle becomes an ellipse with the half axis √(1 + cosine).
    """
    turn = np.minimum(_joint_turns(rows).max(axis=-1), np.pi)
    return np.where(rows["segments"] > 1, 2 / np.sqrt(3 + np.cos(turn)), 1.0)


def widest_radii(rows: Table) -> Floats:
    """Greatest distance (r,) of the wood of sub-plants from their axes, in radii of the base; without short shoots."""
    out = np.maximum(1 + rows["flare"], np.where(rows["drawn"], np.sqrt(2.0), _ring_stretch(rows)))
    for index in range(len(rows) - 1, -1, -1):
        for sort in (LATERAL, FORK, DEAD):
            child = rows["next"][index, sort]
            if child >= 0:  # no thicker than its parent, but it may flare more
                out[index] = max(out[index], rows["thickness"][child].sum() * out[child])
        if rows["drawn"][index]:
            out[index] *= max(rows["radii"][index].max(), 1.0)
        if rows["phantom"][index]:  # as thick as the thickest that is drawn
            out[index] = out[slice(*rows["drawn_rows"][index])].max()
    return out


def own_leaf_reaches(rows: Table, model_reach: Floats) -> Floats:
    """How far leaves stick out beyond the axes that bear them (r,), at plant scale 1, meters; see `leaf_reaches`."""
    factor = np.maximum(rows["leaf_size_tip"], 1) * np.maximum(rows["leaf_size_young"], 1)
    largest = rows["leaf_size"].sum(axis=1) * factor
    beyond = model_reach + np.where(rows["envelope"] > 0, 0.5, 0.0)  # solids hold the middles of leaves
    return np.where(rows["leaves"].sum(axis=1) > 0, largest * beyond, 0.0)


def _tilted(bound: NDArray, angle: NDArray, scale: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Radius, lowest and highest z of cylinders scaled by (m,) and tilted by any angles (m, a), with their base."""
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


def unit_bounds(rows: Table, raised: bool = False) -> Floats:
    """Cylinders that hold every axis of every sub-plant whose branch has unit length.

    Parameters
    ----------
    rows : (r,) table of `rows.build_rows`
    raised : bool
        Also with crown bases (see `growth.crown_effects`), so that any limb may be anywhere above where they begin.

    Returns
    -------
    (r, 3) float64
        Radius, lowest and highest z, in the frame of the base; z is at most 0 at the bottom and at least 0 on top.
    """
    bounds = np.zeros((len(rows), 3))
    for index in range(len(rows) - 1, -1, -1):
        bounds[index] = _unit_bound(rows, index, bounds, raised and rows["order"][index] == 0)
    return bounds


def limb_reaches(rows: Table, bounds: Floats) -> Floats:
    """How far anything is from where its limb leaves the trunk (r,), for trunks of length 1; 0 for other rows."""
    out = np.zeros(len(rows))
    for index in np.flatnonzero(rows["order"] == 0)[::-1]:
        for sort in (LATERAL, DEAD, FORK):
            child = rows["next"][index, sort]
            if child >= 0:
                far = np.hypot(bounds[child, 0], max(bounds[child, 2], -bounds[child, 1])) * rows["nominal"][index]
                out[index] = max(out[index], rows["length"][child].sum() * (out[child] if sort == FORK else far))
    return out


def leaf_reaches(rows: Table, bounds: Floats, model_reach: Floats) -> Floats:
    """How far leaves and short shoots stick out beyond the axes of sub-plants at plant scale 1, meters.

    Parameters
    ----------
    rows : (r,) table
    bounds : (r, 3) float64
        Of `unit_bounds`.
    model_reach : (r,) float64
        Distance of the farthest vertex from the base of the leaf that each row bears, for a leaf of size 1.
    """
    reach, widest = own_leaf_reaches(rows, model_reach), widest_radii(rows)
    for index in range(len(rows) - 1, -1, -1):
        for sort in np.flatnonzero(rows["next"][index] >= 0):
            child = rows["next"][index, sort]
            farther = reach[child]
            if sort == SPUR:
                radius, low, high = bounds[child]
                length, thickness = rows["length"][child].sum(), rows["thickness"][child].sum()
                farther += length * (np.hypot(radius, max(high, -low)) + thickness * widest[child])
            reach[index] = max(reach[index], farther)
        if rows["phantom"][index]:
            reach[index] = reach[slice(*rows["drawn_rows"][index])].max()
    return reach


def _unit_bound(rows: Table, index: int, bounds: Floats, raised: bool) -> Floats:
    row = rows[index]
    radius, low, high, turn = _axis_envelope(row)
    solid = float(envelope_reach(row))
    rises = solid * np.sin(min(turn.max(), np.pi / 2))
    bound = np.array([radius.max() + solid, min(low.min(), 0.0) - rises, max(high.max(), 0.0) + rises])
    knot_t = np.linspace(0, 1, len(radius))
    for sort in (LATERAL, FORK, DEAD):
        if row["next"][sort] < 0:
            continue
        child = rows[row["next"][sort]]
        fraction = np.linspace(0, 1, _SLABS + 1)
        start, latest, end = max(row["start"][sort, 0] - row["start"][sort, 1], 0.0), row["start"][sort].sum(), 1.0
        if sort == DEAD:
            start, latest, end = row["start"][sort][[0, 0, 1]]
            end = 1.0 if raised and end > start else end
        t = start + (end - start) * fraction
        # Of branches whose bare part is longer, earlier children are at the same place.
        later = np.clip((latest - start) / np.maximum(end - start, 1e-9), 0.0, 0.99)
        earlier = np.maximum((fraction - later) / (1 - later), 0.0)
        among, width = row["fraction"][sort], np.ptp(row["fraction"][sort])
        first_fraction, last_fraction = (among[0] + width * one for one in (earlier[:-1], fraction[1:]))
        anywhere = raised or row["growing"][sort, NOW] > 0
        if anywhere:
            among = (0.0, 1.0) if raised else among
            first_fraction, last_fraction = np.tile(np.reshape(among, (2, 1)), _SLABS)
        r, lo, hi = (np.interp(t, knot_t, v) for v in (radius, low, high))
        first = np.minimum((t[:-1] * row["segments"]).astype(int), len(turn) - 1)
        dev = np.maximum(turn[first], turn[np.minimum((t[1:] * row["segments"]).astype(int), len(turn) - 1)])
        base, variation = child["angle"]
        lean = [base + (child["angle_tip"] - base) * one for one in (first_fraction, last_fraction)]
        most = np.clip(np.maximum(*lean) + variation + dev, 0, np.pi)
        least = np.clip(np.minimum(*lean) - variation - dev, 0, np.pi)
        longest = np.full(_SLABS, child["length"].sum() * row["nominal"])
        if sort == FORK:
            longest[:] = child["length"].sum()
            least[:] = 0.0  # a single stem goes straight on
        elif sort == DEAD:
            pass  # no crown's shape makes them shorter
        elif row["start"][sort, 1] > 0 or anywhere:
            longest *= _crown_most(row, np.zeros(1), np.ones(1))[0]  # where children sit is not known
        else:
            longest *= _crown_most(row, first_fraction, last_fraction)
        angle = np.linspace(least, most, _ANGLES, axis=1)
        far, bottom, top = _tilted(bounds[row["next"][sort]], angle, longest)
        # Between a slab's ends nothing sticks out: radius and height grow along the axis, the lowest height is concave.
        bound[0] = max(bound[0], (np.maximum(r[:-1], r[1:]) + far).max())
        bound[1] = min(bound[1], (np.minimum(lo[:-1], lo[1:]) + bottom).min())
        bound[2] = max(bound[2], (np.maximum(hi[:-1], hi[1:]) + top).max())
    return bound


def _crown_most(row: Table, low: Floats, high: Floats) -> Floats:
    """Greatest length ratio of children between two fractions (n,) of them."""
    inner = np.linspace(low, high, 5, axis=1)
    return np.minimum(crown_ratio(row["crown"], 1 - inner).max(axis=1) + _CROWN_SLOPE * (high - low) / 8, 1)


def sampled_bounds(parts: Sequence[Points], rows: int) -> Floats:
    """Cylinders (r, 6) that hold the samples of each row.

    Radius across the branch, and lowest and highest place along it; then the same of its limbs from where they are.
    """
    out = np.zeros((rows, 6))
    for points in parts:
        root = np.where((points.limbs.kind >= LIMB)[:, None], points.limbs.root, points.position)
        along, way = points.position[:, 2], points.position[:, 2] - root[:, 2]
        across, leaves = (np.hypot(place[:, 0], place[:, 1]) for place in (points.position, root))
        extents = np.stack([across, -along, along, leaves, -way, way], axis=1)
        for row, (first, number) in enumerate(zip(points.first, points.number, strict=True)):
            span = slice(int(first.min()), int((first + number).max()))  # the runs of a row follow one another
            out[row] = np.maximum(out[row], extents[span].max(axis=0, initial=0.0))
    out[:, [1, 4]] *= -1
    return out
