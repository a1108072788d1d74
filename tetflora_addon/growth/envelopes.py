# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves that fill a solid around their branch evenly, and leaves that stand by an inclination distribution.

Such are the plants of canopies that radiative transfer models are compared on (Widlowski et al., "The RAMI On-line
Model Checker", Remote Sensing of Environment, 2008), and hedges and topiary. A place *t* along a branch is then the
fraction of the solid below the leaf, between where leaves begin and the tip: leaves are as many on any stretch of t as
on a bare axis, so that all that is known of them along the branch holds for solids too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Keys, Mask, Table
from ..species.species import LEAF_ENVELOPES, LEAF_INCLINATIONS
from .axes import Axes
from .branches import Branches
from .hashing import Draw, uniform
from .rows import ranged

#: Leaves of a solid are displaced along it so far, in distances between them, that they lie evenly.
EVEN_JITTER = 0.5
BOX = LEAF_ENVELOPES.index("box")
_TABLE = np.linspace(0.0, np.pi / 2, 4097)
#: Weights of cos 2θ and cos 4θ in densities 2 (1 + a cos 2θ + b cos 4θ) / π of the inclination (Goel and Strebel,
#: "Simple beta distribution representation of leaf orientation in vegetation canopies", Agronomy Journal, 1984; the
#: names are those of de Wit, "Photosynthesis of leaf canopies", 1965).
_COSINES = {
    "planophile": (1.0, 0.0),
    "erectophile": (-1.0, 0.0),
    "plagiophile": (0.0, -1.0),
    "extremophile": (0.0, 1.0),
    "uniform": (0.0, 0.0),
}


def leaf_start(rows: Table, branches: Branches) -> Floats:
    """Fraction (n,) of each branch's axis that is bare of leaves."""
    return ranged(rows, "leaf_start", branches.row, branches.key, Draw.LEAF_START)


def envelope_reach(rows: Table) -> Floats:
    """How far the solids that leaves fill reach from the axes of branches (r,), in lengths of these."""
    return rows["envelope_radius"] * np.where(rows["envelope"] == BOX, np.sqrt(2.0), 1.0)


def are_solids(rows: Table) -> Mask:
    """Rows (r,) of branches that bear nothing but leaves in a solid."""
    return (rows["envelope"] > 0) & (rows["next"] < 0).all(axis=1)


def axis_places(rows: Table, branches: Branches, row: Integers, owner: NDArray, t: Floats) -> Floats:
    """Fractions (m,) of axes at the height of leaves at places t (m,) of branches, of rows (m,) or (1,).

    The inverses of the fractions of the solids below a height u, from 0 to 1: u²(3 − 2u) of a sphere, 1 − (1 − u)³ of a
    cone.
    """
    shape = rows["envelope"][row]
    if not shape.any():
        return t
    start = np.take(leaf_start(rows, branches), owner)
    below = np.clip((t - start) / (1.0 - start), 0.0, 1.0)
    sphere = 0.5 - np.sin(np.arcsin(1.0 - 2.0 * below) / 3.0)
    up = np.choose(shape, [below, sphere, below, 1.0 - np.cbrt(1.0 - below), below])
    return np.where(shape > 0, start + (1.0 - start) * up, t)


def leaf_sites(
    rows: Table, branches: Branches, lines: Axes, row: Integers, owner: Integers, key: Keys, t: Floats
) -> tuple[Floats, NDArray, Floats]:
    """Where leaves are: the middles of those in solids, the bases of others.

    Parameters
    ----------
    rows : parameter table
    branches, lines : Branches of n and their Axes
    row : (m,) or (1,) int
    owner : (m,) int
        Branch of each leaf.
    key : (m,) uint64
    t : (m,) float64
        From `foliage.leaf_places`.

    Returns
    -------
    position (m, 3), frame (m, 3, 3) of the branch there, and fraction (m,) of its axis
    """
    at = axis_places(rows, branches, row, owner, t)
    position, frame = lines.at(owner, at)
    shape = rows["envelope"][row]
    if shape.any():
        start = np.take(leaf_start(rows, branches), owner)
        up = (at - start) / (1.0 - start)
        width = np.choose(shape, [0.0, 2.0 * np.sqrt(np.clip(up * (1.0 - up), 0.0, None)), 1.0, 1.0 - up, 1.0])
        a, b = uniform(key, Draw.ENVELOPE_ACROSS), uniform(key, Draw.ENVELOPE_AROUND)
        out, turn = np.sqrt(a), 2.0 * np.pi * b
        x = np.where(shape == BOX, 2.0 * a - 1.0, out * np.cos(turn))
        y = np.where(shape == BOX, 2.0 * b - 1.0, out * np.sin(turn))
        radius = width * rows["envelope_radius"][row] * np.take(branches.length, owner)
        position = position + (radius * x)[:, None] * frame[:, :, 0] + (radius * y)[:, None] * frame[:, :, 1]
    return position, frame, at


def inclinations(kind: Integers, number: Floats) -> Floats:
    """Angles (m,) between normals and axis, 0 to π/2, from even random numbers (m,), of kinds (m,) or (1,)."""
    out = np.arccos(1.0 - number)  # of a sphere
    for name, (a, b) in _COSINES.items():
        own = kind == LEAF_INCLINATIONS.index(name)
        if own.any():
            below = (2.0 * _TABLE + a * np.sin(2.0 * _TABLE) + 0.5 * b * np.sin(4.0 * _TABLE)) / np.pi
            out = np.where(own, np.interp(number, below, _TABLE), out)
    return out


def inclined(frame: Floats32, kind: Integers, key: Keys) -> Floats32:
    """Frames (m, 3, 3) of leaves that stand by a distribution, all around their branch and turned in their own plane.

    Parameters
    ----------
    frame : (m, 3, 3) float32
        Of the branch where each leaf is.
    kind : (m,) or (1,) int
        Index into `LEAF_INCLINATIONS`.
    key : (m,) uint64
    """
    angle = inclinations(kind, uniform(key, Draw.LEAF_INCLINATION))
    angle = np.where(uniform(key, Draw.LEAF_SIDE) < 0.5, angle, np.pi - angle)
    bearing, twist = (2.0 * np.pi * uniform(key, draw) for draw in (Draw.LEAF_BEARING, Draw.LEAF_TWIST))
    sa, ca, sb, cb, st, ct = (f(v).astype(np.float32) for v in (angle, bearing, twist) for f in (np.sin, np.cos))
    down, level = (ca * cb, ca * sb, -sa), (-sb, cb, np.zeros_like(sb))  # in the leaf's plane
    across = [st * d - ct * e for d, e in zip(down, level, strict=True)]
    along = [ct * d + st * e for d, e in zip(down, level, strict=True)]
    axes = frame.transpose(2, 1, 0)
    out = np.zeros((3, 3, len(key)), np.float32)
    for column, parts in zip(out.swapaxes(0, 1), (across, along, (sa * cb, sa * sb, ca)), strict=True):
        for axis, part in zip(axes, parts, strict=True):
            column += part * axis
    return out.transpose(2, 0, 1)
