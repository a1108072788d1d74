# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves on branches: where each sits, which way it grows and faces, and its size.

Some fill a solid around their branch evenly, and some stand by an inclination distribution. Such are the plants of
canopies that radiative transfer models are compared on (Widlowski et al., "The RAMI On-line Model Checker", Remote
Sensing of Environment, 2008), and hedges and topiary. A place *t* along a branch is then the fraction of the solid
below the leaf, between where leaves begin and the tip: leaves are as many on any stretch of t as on a bare axis, so
that all that is known of them along the branch holds for solids too.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Integers32, Keys, Mask, Table, cross, dot, gathered
from ..species.species import LEAF_INCLINATIONS
from .axes import Axes
from .growth import level_azimuth
from .hashing import Draw, child_key, signed, uniform
from .rows import BOX, ranged
from .seasons import Stages, leaf_stages, may_change
from .seeds import Branches
from .wind import fluttered, gusts, is_windy

#: Leaves of a solid are displaced along it so far, in distances between them, that they lie evenly.
EVEN_JITTER = 0.5
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

    Inverses of the fractions of solids below a height u, from 0 to 1: u²(3 − 2u) of a sphere, 1 − (1 − u)³ of a cone.
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
    place = axis_places(rows, branches, row, owner, t)
    position, frame = lines.at(owner, place)
    shape = rows["envelope"][row]
    if shape.any():
        start = np.take(leaf_start(rows, branches), owner)
        up = (place - start) / (1.0 - start)
        width = np.choose(shape, [0.0, 2.0 * np.sqrt(np.clip(up * (1.0 - up), 0.0, None)), 1.0, 1.0 - up, 1.0])
        a, b = uniform(key, Draw.ENVELOPE_ACROSS), uniform(key, Draw.ENVELOPE_AROUND)
        out, turn = np.sqrt(a), 2.0 * np.pi * b
        x = np.where(shape == BOX, 2.0 * a - 1.0, out * np.cos(turn))
        y = np.where(shape == BOX, 2.0 * b - 1.0, out * np.sin(turn))
        radius = width * rows["envelope_radius"][row] * np.take(branches.length, owner)
        position = position + (radius * x)[:, None] * frame[:, :, 0] + (radius * y)[:, None] * frame[:, :, 1]
    return position, frame, place


def _inclined(frame: Floats32, kind: Integers, key: Keys) -> Floats32:
    """Frames (m, 3, 3) of leaves that stand by a distribution, all around their branch and turned in their own plane.

    ``frame`` (m, 3, 3) is that of the branch there, ``kind`` (m,) or (1,) an index into `LEAF_INCLINATIONS`.
    """
    number = uniform(key, Draw.LEAF_INCLINATION)
    angle = np.arccos(1.0 - number)  # of a sphere
    for name, (a, b) in _COSINES.items():
        chosen = kind == LEAF_INCLINATIONS.index(name)
        if chosen.any():
            below = (2.0 * _TABLE + a * np.sin(2.0 * _TABLE) + 0.5 * b * np.sin(4.0 * _TABLE)) / np.pi
            angle = np.where(chosen, np.interp(number, below, _TABLE), angle)
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


_LEAF_PATH = 1 << 32  # child indices of leaves start here, so that they never meet those of branches
SKY = np.array([0.0, 0.0, 1.0])  # where it is without wind
YOUTH = 4
"""Power of the place along a branch by which leaves are young."""
_PLACE_JITTER = 0.4  # below a half, so that leaves keep their order along the branch


@dataclass(frozen=True)
class Leaves(Arrays):
    """Leaves as a structure of arrays."""

    branch: Integers  # (n,): index of the branch that bears the leaf
    key: Keys  # (n,)
    position: Floats  # (n, 3): base of the leaf, meters
    #: (n, 3, 3): columns: across, along the midrib, upper side; before it turns to the light. Single precision is off
    #: by some nanometers at the tip of a leaf, and its cosines are ten times as fast.
    frame: Floats32
    size: Floats  # (n,): meters by which the leaf model is scaled
    light: Floats  # (n,): how far it turns to the sky; (1,) where that is the same for all
    sky: NDArray[np.floating]  # (3,) or (n, 3) float32: where that is; with the branch in the wind
    stages: Stages | None = None  # on a day of the year; None where all are as in summer

    def take(self, index: Integers) -> Self:
        """As of `Arrays`; what is the same for all stays so."""
        light = self.light if len(self.light) < len(self.key) else self.light[index]
        sky = self.sky if self.sky.ndim == 1 else gathered(self.sky, index)
        columns = (gathered(of, index) for of in (self.branch, self.key, self.position, self.frame, self.size))
        return type(self)(*columns, light, sky, None if self.stages is None else self.stages.take(index))


def leaf_keys(branches: Branches, owner: Integers, index: Integers) -> Keys:
    """Hash keys (m,) of leaves given by branch and index."""
    return child_key(np.take(branches.key, owner), index + _LEAF_PATH)


def leaf_places(rows: Table, branches: Branches, owner: NDArray, index: NDArray, counts: NDArray, key: Keys) -> Floats:
    """Fractions (m,) of branches at which leaves sit; those of a whorl share that of the first."""
    row = _rows_of(branches, owner)
    whorl = rows["leaf_whorl"][row]
    number = np.take(counts, owner)
    node = index
    if (whorl > 1).any():
        node = index // whorl
        key = np.where(index % whorl > 0, leaf_keys(branches, owner, node * whorl), key)
        number = number // whorl
    jitter = np.where(rows["envelope"][row] > 0, EVEN_JITTER, _PLACE_JITTER)
    fraction = (node + 0.5 + jitter * signed(key, Draw.PLACE)) / number
    start = leaf_start(rows, branches)
    start = start[:1] if len(row) == 1 and (start == start[:1]).all() else np.take(start, owner)
    return start + (1 - start) * fraction


def outwardness(rows: Table, branches: Branches, owner: Integers, t: Floats) -> Floats:
    """Where leaves at fractions t (m,) of branches lie between the inside of the crown, 0, and the outside, 1."""
    row = _rows_of(branches, owner)
    first, last = rows["part"][row].T
    return np.where(rows["outward"][row], first + (last - first) * t, np.take(branches.outward, owner))


def youth(rows: Table, row: Integers, t: Floats) -> Floats:
    """How young leaves (m,) of rows (m,) or (1,) are, at fractions t (m,) of branches: 0 old to 1 at the very end.

    A power of the place along the branch of the order, so that what is seen as young are a few at the end.
    """
    first, last = rows["part"][row].T
    return (first + (last - first) * t) ** YOUTH


def leaf_sizes(rows: Table, row: Integers, key: Keys, outward: Floats, t: Floats) -> Floats:
    """Meters (m,) by which models of leaves are scaled at plant scale 1; (1,) where all are alike.

    They are on rows (m,) or (1,), at places (m,) between inside and outside, and fractions t (m,) of branches.
    """
    size = ranged(rows, "leaf_size", row, key, Draw.LEAF_SIZE)
    tip, young = rows["leaf_size_tip"][row], rows["leaf_size_young"][row]
    if (tip != 1).any():
        size = size * (1 + (tip - 1) * outward)
    if (young != 1).any():
        size = size * (1 + (young - 1) * youth(rows, row, t))
    return size


def leaf_lights(rows: Table, row: Integers, key: Keys, outward: Floats) -> Floats:
    """How far leaves at places (m,) between inside and outside turn to the sky; (1,) where all are alike."""
    light = ranged(rows, "leaf_light", row, key, Draw.LEAF_LIGHT)
    if not rows["sunlit"][row].any():
        return light
    return np.clip(light + (rows["leaf_light_tip"][row] - rows["leaf_light"][row, 0]) * outward, 0, 1)


def stages_of(rows: Table, branches: Branches, owner: Integers, key: Keys) -> Stages | None:
    """Stages of leaves with keys (m,) of branches (m,) on their plants' days; None where all are as in summer."""
    if branches.year is None or not may_change(rows, _rows_of(branches, np.arange(len(branches))), branches.year):
        return None
    return leaf_stages(rows, _rows_of(branches, owner), key, np.take(branches.year[:, 0], owner))


def _rows_of(branches: Branches, owner: Integers) -> Integers32:
    """Row (m,) of each branch's parameters, or the only one (1,), which is as good and need not be gathered."""
    row = branches.row
    return row[:1] if len(row) and (row == row[0]).all() else np.take(row, owner)


def place_leaves(
    rows: Table, branches: Branches, lines: Axes, owner: Integers, index: Integers, key: Keys, t: Floats
) -> Leaves:
    """Leaves at given fractions of their branches; call `settled` to turn them to the sky.

    Parameters
    ----------
    branches, lines : Branches of n and their Axes
        Fastest where all are of one row, because parameters are then the same for all.
    owner, index : (m,) int
        Branch, and index of the leaf on it.
    key : (m,) uint64
        From `leaf_keys`.
    t : (m,) float64
        From `leaf_places`.
    """
    row = _rows_of(branches, owner)
    skies = None if lines.skies is None else lines.skies.astype(np.float32)
    light = Axes(lines.knots, lines.frames.astype(np.float32), lines.segments, skies)
    position, frame, place = leaf_sites(rows, branches, light, row, owner, key, t)
    sky = light.sky_at(owner, place)
    frame = leaf_frames(rows, row, frame, np.take(uniform(branches.key, Draw.ROLL), owner), index, key, sky)
    alike = not (rows["gradient"][row].any() or rows["sunlit"][row].any())
    outward = np.zeros(1) if alike else outwardness(rows, branches, owner, t)
    size = np.take(branches.scale, owner) * leaf_sizes(rows, row, key, outward, t)
    stages = stages_of(rows, branches, owner, key)
    if stages is not None:
        size = size * stages.size
    solid = rows["envelope"][row] > 0
    if solid.any():  # from the middle to the base
        position -= (0.5 * size * solid)[:, None] * frame[:, :, 1]
    light = leaf_lights(rows, row, key, outward)
    return Leaves(owner, key, position, frame, size, light, SKY if sky is None else sky, stages)


def leaf_frames(
    rows: Table, row: Integers, frame: Floats32, roll: Floats, index: Integers, key: Keys, sky: Floats32 | None = None
) -> Floats32:
    """Frames (m, 3, 3) of leaves before they turn to the light.

    Parameters
    ----------
    row : (m,) or (1,) int
    frame : (m, 3, 3) float32
        Of the branch where each leaf sits.
    roll : (m,) float64
        Random number of the branch, 0 to 1: where around it its first leaf stands.
    index : (m,) int
        Number of the leaf on its branch.
    key : (m,) uint64
    sky : (m, 3) float32, optional
        Where up is, if not along z.
    """
    kind = rows["inclination"][row]
    if kind.all():
        return _inclined(frame, kind, key)
    step, jitter = rows["leaf_azimuth"][row].T
    whorl = rows["leaf_whorl"][row]
    node, within = (index // whorl, (index % whorl) / whorl) if (whorl > 1).any() else (index, 0.0)
    turns = roll + within + (node * step + jitter * signed(key, Draw.AZIMUTH)) / (2 * np.pi)
    spray = rows["leaf_spray"][row]
    if spray.any():
        level = level_azimuth(frame, sky) / (2 * np.pi) + (1 - spray) * (roll - 0.5) - roll
        turns += np.where(spray > 0, level, 0.0)
    turns -= np.rint(turns)  # whole turns would cost single precision its last digits
    azimuth = (turns * (2 * np.pi)).astype(np.float32)
    out = _leaf_frames(frame, azimuth, ranged(rows, "leaf_angle", row, key, Draw.ANGLE).astype(np.float32))
    return np.where(kind[:, None, None] > 0, _inclined(frame, kind, key), out) if kind.any() else out


def _leaf_frames(frame: Floats32, azimuth: Floats32, angle: Floats32) -> Floats32:
    """As `growth.turned`, with columns in the order of a leaf.

    The upper side of a leaf faces the tip of its branch: against the tilt, whose first column leads away from it.
    """
    x, y, z = frame.transpose(2, 1, 0)
    ca, sa, cd, sd = (f(v) for v in (azimuth, angle) for f in (np.cos, np.sin))
    out = np.zeros((3, 3, len(azimuth)), np.float32)
    across, along, up = out.swapaxes(0, 1)
    radial = ca * x
    radial += sa * y
    np.multiply(sa, x, out=across)
    across -= ca * y
    np.multiply(sd, radial, out=along)
    along += cd * z
    np.multiply(sd, z, out=up)
    up -= cd * radial
    return out.transpose(2, 0, 1)


def _face_light(frame: NDArray[np.floating], light: Floats, sky: Floats) -> NDArray:
    """Leaf frames (n, 3, 3) whose upper sides are turned to the sky; midribs follow by the least turn. As `settled`."""
    along, up, light, sky = _by_component(frame, light, sky)
    normal = _toward(up, light, sky, 1e-9)
    along_out = along - _inner(along, normal) * normal
    length = _length(along_out)
    # The midrib points straight up or down: turn about the blade. What is left of it must stand above rounding.
    lost = np.flatnonzero(length <= (1e-6 if frame.dtype == np.float64 else 1e-3))
    if len(lost):
        across, facing = gathered(frame[:, :, 0], lost), normal[:, lost].T
        along_out[:, lost] = cross(facing, across - dot(across, facing) * facing).T
        length = _length(along_out)
    along_out /= length
    return _frames(along_out, normal)


def settled(rows: Table, row: Integers, frame: NDArray[np.floating], light: Floats, sky: Floats) -> NDArray:
    """Leaf frames as they are in the end: turned to the light, then hanging, as far as their orders ask for.

    Parameters
    ----------
    row : (n,) or (1,) int
    frame : (n, 3, 3) float64 or float32
        Across, along, upper side.
    light : (n,) or (1,) float64
        0 leaves them as they are, 1 makes them level.
    sky : (3,) or (n, 3) float64
        Unit vector toward the sky.

    Returns
    -------
    (n, 3, 3), type of frame
        Right-handed.
    """
    frame = _face_light(frame, light, sky)
    droop = rows["leaf_droop"][row]
    return _hanging(frame, droop, sky) if droop.any() else frame


def settled_in_wind(rows: Table, branches: Branches, leaves: Leaves, ahead: float = 0.0) -> Floats32:
    """`settled` frames (m, 3, 3) of leaves (m) of branches, as the wind turns them if there is any.

    So many seconds after the moment of the rows; the branches are where they are then.
    """
    row = _rows_of(branches, leaves.branch)
    frame = settled(rows, row, leaves.frame, leaves.light, leaves.sky)
    if not is_windy(rows):
        return frame
    gust = np.take(gusts(rows, branches.position, ahead), leaves.branch)
    return fluttered(rows, row, frame, leaves.key, gust, ahead)


def _hanging(frame: NDArray[np.floating], droop: Floats, sky: Floats) -> NDArray:
    """Let leaves hang: the midrib turns down as far as ``droop`` (n,) or (1,), the blade follows it."""
    along, up, droop, sky = _by_component(frame, droop, sky)
    along_out = _toward(along, droop, -sky, 1e-6)
    # The upper side leads away from the old midrib, so that it never lies along the new one: a leaf may hang over.
    normal = up - _inner(up, along_out) * along_out
    lost = np.flatnonzero(_length(normal) < 1e-3)
    if len(lost):
        normal[:, lost] = -along[:, lost]
    normal /= _length(normal)
    return _frames(along_out, normal)


def _by_component(frame: NDArray[np.floating], share: Floats, sky: Floats) -> tuple[NDArray, ...]:
    """Midribs and upper sides (3, n) of leaf frames, shares (n,) or (1,), and skies (3, n) or (3, 1), of one type."""
    sky = sky.astype(frame.dtype).T
    return frame[:, :, 1].T, frame[:, :, 2].T, share.astype(frame.dtype), sky if sky.ndim == 2 else sky[:, None]


def _toward(vector: NDArray, share: NDArray, target: NDArray, least: float) -> NDArray:
    """Unit vectors (3, n) a share of the way to targets; what is half way to the opposite keeps its own direction."""
    out = (1 - share) * vector
    out += share * target
    out += out.dtype.type(least) * vector
    out /= _length(out)
    return out


def _frames(along: NDArray, normal: NDArray) -> NDArray:
    """Leaf frames (n, 3, 3) of midribs and upper sides (3, n)."""
    out = np.empty((3, 3, along.shape[1]), along.dtype)
    out[:, 1], out[:, 2] = along, normal
    np.multiply(along[[1, 2, 0]], normal[[2, 0, 1]], out=out[:, 0])
    out[:, 0] -= along[[2, 0, 1]] * normal[[1, 2, 0]]
    return out.transpose(2, 0, 1)


def _inner(a: NDArray, b: NDArray) -> NDArray:
    """Scalar products (n,) of vectors given by component (3, n)."""
    out = a[0] * b[0]
    out += a[1] * b[1]
    out += a[2] * b[2]
    return out


def _length(a: NDArray) -> NDArray:
    """Lengths (n,) of vectors given by component (3, n), never quite zero."""
    return np.maximum(np.sqrt(_inner(a, a)), np.finfo(a.dtype).tiny)


def leaf_forms(number: int, key: Keys) -> Integers:
    """Which of a number of forms each leaf (n,) has."""
    return (uniform(key, Draw.LEAF_FORM) * number).astype(np.int64)
