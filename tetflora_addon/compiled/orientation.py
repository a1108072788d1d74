# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the surfaces of sub-plants are turned on the mean: moments of their normals, by where the sky is.

They are the orientations of the paper's summaries (section 6.5). Leaves that turn to the sky, and boughs that bend to
it, do not turn with their branch. So the mean of n nᵀ in the branch's own axes is kept as a function of the sky's
direction in these axes: a polynomial, and the first harmonics of its azimuth. It is found from the highest order down:
that of a sub-plant is the mean over its own leaves and over the sub-plants on it, whose own are known by then. It is
fitted for skies all around the branch, but half of them are where an upright plant has them, so that what the functions
cannot follow is missed where no branch stands.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from ..arrays import Floats, Integers, Table, columns, cross, perpendicular, spiral
from ..growth import foliage
from ..growth.axes import Axes, axes
from ..growth.growth import branch_counts, chosen_children, drawn_children, fullness, leaf_counts, radius_at
from ..growth.hashing import Draw, key_of_seed, mix, thinned, uniform
from ..growth.rows import DEAD, FORK, LATERAL, SPUR, ranged
from ..growth.seeds import Branches
from ..leaves.models import Forms, LeafModel
from .averages import NODES, quadratic

_PIECE = 128
_BRANCHES = 2048  # of each row that are looked at, each with the sky elsewhere
_MET = 256  # of each row that are grown upwards from the trunk, to see how they stand
_LEAVES = 4  # on each of them,
_INCLINED = 32  # or so many that stand all around by chance
_SORTS = (LATERAL, FORK, SPUR, DEAD)
_ALONG, _CHILD = 111, 112  # draws of this module, beyond those of growth
# Exponents of x, y, z: all polynomials of degree 4 on the sphere are sums of these.
_EXPONENTS = np.array([(a, b, d - a - b) for d in (3, 4) for a in range(d + 1) for b in range(d + 1 - a)])
_TERMS = len(_EXPONENTS) + 8
_UPRIGHT = 1e-3  # squared sine of the tilt at which a branch begins to have sides
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class Orientation:
    """Polynomials of moments; arrays by row."""

    #: leaves and own_leaves, (r, 3, 33, 6): coefficients of xx, yy, zz, xy, xz, yz of the mean of n nᵀ: over all leaves
    #: of the sub-plant, and over those of its branch itself where that is straight; at `averages.NODES` between inside
    #: and outside of the crown, or (r, 1, 33, 6) where no leaves turn to the sky otherwise outside than inside.
    leaves: Floats
    own_leaves: Floats
    wood: Floats  # (r, 1, 33, 6): the same over its wood


def leaf_moments(orientation: Orientation, subplants: Branches) -> Floats:
    """Mean of n nᵀ over the leaves of sub-plants, (n, 3, 3) float64 of trace 1 (0 for rows without leaves)."""
    return _evaluated(orientation.leaves, subplants.row, subplants.frame, subplants.outward)


def own_leaf_moments(orientation: Orientation, row: Integers, axis: Floats, outward: Floats) -> Floats:
    """The same (n, 3, 3) over the leaves that straight pieces of branches bear.

    They are given by row (n,), axis (n, 3), and place (n,) between inside and outside of the crown.
    """
    return _evaluated(orientation.own_leaves, row, _frames_along(axis), outward)


def wood_moments(orientation: Orientation, subplants: Branches) -> Floats:
    """Mean of n nᵀ over the branches of sub-plants, (n, 3, 3) float64 of trace 1."""
    return _evaluated(orientation.wood, subplants.row, subplants.frame, subplants.outward)


def _evaluated(coefficients: Floats, row: Integers, frame: Floats, outward: Floats) -> Floats:
    """Moments (n, 3, 3) of branches with frames (n, 3, 3), from polynomials (r, 1 or 3 `NODES`, 33, 6) of rows (n,)."""
    basis = _basis(frame[:, 2, :])
    local = np.zeros((len(row), 6))
    for r in np.unique(row):
        chosen = slice(None) if (row == r).all() else np.flatnonzero(row == r)
        nodes = coefficients[r]
        if (nodes == nodes[0]).all():
            local[chosen] = _product(basis[chosen], nodes[0])
            continue
        for weight, node in zip(quadratic(outward[chosen]).T, nodes, strict=True):
            local[chosen] += weight[:, None] * _product(basis[chosen], node)
    trace = local[:, :3].sum(axis=1, keepdims=True)
    # R M Rᵀ of symmetric M, given by six numbers each.
    moments = (local / np.where(trace > 0, trace, 1))[:, [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(-1, 3, 3)
    return frame @ moments @ frame.transpose(0, 2, 1)


def _basis(sky: Floats) -> Floats:
    """Functions (n, 33) of directions (n, 3): polynomials of degree 4, and the first harmonics of the azimuth."""
    out = np.empty((_TERMS, len(sky)))
    powers = [[np.ones(len(sky))] for _ in range(3)]
    for axis, values in enumerate(np.ascontiguousarray(sky.T)):
        for _ in range(_EXPONENTS.max()):
            powers[axis].append(powers[axis][-1] * values)
    for k, (a, b, c) in enumerate(_EXPONENTS):
        np.multiply(powers[0][a], powers[1][b], out=out[k])
        out[k] *= powers[2][c]
    # Level sprays turn with the azimuth of the sky, however little the branch leans.
    x, y, z = (powers[axis][1] for axis in range(3))
    level = np.sqrt(x * x + y * y + _UPRIGHT)
    c, s = x / level, y / level
    for k, values in enumerate((c, s, c * c - s * s, 2 * c * s)):
        out[len(_EXPONENTS) + k] = values
        np.multiply(values, z, out=out[len(_EXPONENTS) + 4 + k])
    return out.T


def _product(a: Floats, b: Floats) -> Floats:
    """Product of a tall array (n, k) and a small one, in pieces so small that no library starts threads for them."""
    whole = len(a) // _PIECE * _PIECE
    pieces = np.ascontiguousarray(a[:whole]).reshape(-1, _PIECE, a.shape[1]) @ b
    return np.concatenate([pieces.reshape(whole, b.shape[1]), a[whole:] @ b])


def _frames_along(axis: Floats) -> Floats:
    """Frames (n, 3, 3) whose third column is an axis (n, 3), turned about it as may be."""
    x = perpendicular(axis)
    return columns(x, cross(axis, x), axis)


def orientation_of(rows: Table, forms: Sequence[Forms], leaf: Floats, wood: Floats, length: Floats) -> Orientation:
    """Orientation of every row.

    Parameters
    ----------
    rows : (r,) parameter table
    forms : by species and kind
        Models of leaves.
    leaf : (r, r) float64
        Expected area of leaves in a sub-plant by the row that bears them.
    wood : (r, r) float64
        Expected surface of branches by row, over length × radius of the sub-plant's own branch.
    length : (r,) float64
        Typical length of a branch at plant scale 1, meters.
    """
    nodes = NODES if rows["sunlit"].any() else NODES[:1]
    out = Orientation(*np.zeros((2, len(rows), len(nodes), _TERMS, 6)), np.zeros((len(rows), 1, _TERMS, 6)))
    turn = _model_moments(rows, forms)
    leaf_area, wood_area = leaf.sum(axis=1), wood.sum(axis=1)
    skies = _skies_met(rows, length)
    for i in range(len(rows) - 1, -1, -1):
        # Directions (n, 3) of the sky, every other one of those that are met, the rest all around.
        cos = 1 - 2 * (np.arange(_BRANCHES) + 0.5) / _BRANCHES
        if bool(rows["order"][i] == 0):  # most plants stand, and few lie
            cos = 1 - 2 * ((1 - cos) / 2) ** 3
        sky = spiral(cos, np.arange(_BRANCHES))
        sky[1::2] = skies[i][thinned(len(skies[i]), len(sky[1::2]))]
        branches = _sample_branches(i, float(length[i]), sky)
        lines = axes(rows, branches)
        children, owner, stands = _some_children(rows, branches, lines)
        row, scale = children.row, branches.scale[0]
        basis = _basis(branches.frame[:, 2, :])
        # What grows on the children is turned as they are; own leaves and the own branch are looked at one by one.
        beyond = rows["order"][i] > 1  # the limbs: all that grows here is as far outside as the branch
        for node, place in enumerate(nodes if leaf_area[i] > 0 else ()):
            outward = np.full(len(row), place) if beyond else children.outward
            weight = stands * fullness(rows, children) * leaf_area[row] * scale**2
            leaves = _Sums.of(len(branches), owner, _evaluated(out.leaves, row, children.frame, outward), weight)
            if leaf[i, i] > 0:
                branch_leaves = _own_leaves(rows, branches, lines, turn[i], place if beyond else None)
                leaves = branch_leaves.mixed(leaves, leaf[i, i] / leaf_area[i])
                knots = np.stack([branches.position, branches.position + branches.frame[:, :, 2]], axis=1)
                straight = Axes(knots, branches.frame[:, None], np.ones(len(branches), np.int64))
                out.own_leaves[i, node] = _own_leaves(rows, branches, straight, turn[i], place).fitted(branches, basis)
            out.leaves[i, node] = leaves.fitted(branches, basis)
        weight = stands * children.length * children.radius * wood_area[row]
        bark = _Sums.of(len(branches), owner, _evaluated(out.wood, row, children.frame, children.outward), weight)
        if not rows["phantom"][i]:
            # A place on each branch.
            t = uniform(branches.key, _ALONG)
            _, frame = lines.at(np.arange(len(branches)), t)
            axis = frame[:, :, 2]
            moment = (np.eye(3) - axis[:, :, None] * axis[:, None, :]) / 2
            radius = radius_at(rows, branches, t)
            bark = _Sums(moment * radius[:, None, None], radius).mixed(bark, wood[i, i] / wood_area[i])
        out.wood[i, 0] = bark.fitted(branches, basis)
    return out


@dataclass(frozen=True)
class _Sums:
    """What was met on each of n branches: sums of moments × weights (n, 3, 3), and of weights (n,)."""

    moment: Floats
    weight: Floats

    @classmethod
    def of(cls, n: int, owner: Integers, moment: Floats, weight: Floats) -> Self:
        """Sums over things (m,) on branches (m,) of n, with moments (m, 3, 3)."""
        values = (moment * weight[:, None, None]).reshape(-1, 9).T
        sums = np.stack([np.bincount(owner, one, n) for one in values], axis=1)
        return cls(sums.reshape(n, 3, 3), np.bincount(owner, weight, n))

    def mixed(self, other: Self, fraction: float) -> Self:
        """Both together; this one has a known fraction of all."""
        if other.weight.sum() <= 0:
            return self
        a, b = (part / max(p.weight.sum(), 1e-300) for p, part in ((self, fraction), (other, 1 - fraction)))
        return _Sums(self.moment * a + other.moment * b, self.weight * a + other.weight * b)

    def fitted(self, branches: Branches, basis: Floats) -> Floats:
        """Coefficients (33, 6), by weighted least squares; ``basis`` (n, 33) for the sky of the branches."""
        whole = max(self.weight.sum(), 1e-300)
        normal = _inner(basis, basis * (self.weight / whole)[:, None])
        # Where branches can only stand in some ways, others are left to the least coefficients.
        normal += 1e-9 * np.trace(normal) / len(normal) * np.eye(len(normal))
        # Rᵀ M R as six numbers (n, 6) of symmetric M (n, 3, 3).
        local = branches.frame.transpose(0, 2, 1) @ (self.moment / whole) @ branches.frame
        return np.linalg.solve(normal, _inner(basis, np.stack([local[:, i, j] for i, j in _PAIRS], axis=1)))


def _inner(a: Floats, b: Floats) -> Floats:
    """aᵀ b of tall arrays, in pieces so small that no library starts threads for them."""
    whole = len(a) // _PIECE * _PIECE
    left, right = (x[:whole].reshape(-1, _PIECE, x.shape[1]) for x in (a, b))
    return (left.transpose(0, 2, 1) @ right).sum(axis=0) + a[whole:].T @ b[whole:]


def _skies_met(rows: Table, length: Floats) -> list[Floats]:
    """Directions (m, 3) of the sky in the axes of some branches of each row, on plants that stand as they should."""
    met: list[list[Floats]] = [[] for _ in rows]
    out = []
    for i in range(len(rows)):
        if met[i]:
            directions = np.concatenate(met[i])
            sky = directions[thinned(len(directions), _MET)]
        else:  # a trunk
            tilt = ranged(rows, "angle", np.full(_MET, i), key_of_seed(np.arange(_MET)), Draw.ANGLE)
            sky = np.stack([-np.sin(tilt), np.zeros(_MET), np.cos(tilt)], axis=1)
        out.append(sky)
        if (rows["next"][i] >= 0).any() or rows["phantom"][i]:
            branches = _sample_branches(i, float(length[i]), sky)
            children, *_ = _some_children(rows, branches, axes(rows, branches))
            for row in np.unique(children.row):
                met[row].append(children.frame[children.row == row, 2])
    return out


def _sample_branches(row: int, length: float, sky: Floats) -> Branches:
    """Branches of a row, of length 1, with the sky in given directions (n, 3) of their axes."""
    key = mix(key_of_seed(np.arange(len(sky))) ^ np.uint64(0x0E1E))
    return Branches.apart(row, key, _frames_along(sky).transpose(0, 2, 1), 1.0, 1 / max(length, 1e-9))


def _some_children(rows: Table, branches: Branches, lines: Axes) -> tuple[Branches, Integers, Floats]:
    """One child of each sort of branches, or all that are drawn by hand; parents, and how many each stands for."""
    if rows["phantom"][branches.row[0]]:
        children, owner = drawn_children(rows, branches)
        return children, owner, np.ones(len(owner))
    grown, owners, stands = [Branches.empty()], [np.zeros(0, np.int64)], [np.zeros(0)]
    for sort in _SORTS:
        if rows["next"][branches.row[0], sort] < 0:
            continue
        counts = branch_counts(rows, branches, sort)
        if not counts.any():  # so rare that no branch has any
            counts = np.ones_like(counts)
        parents = np.flatnonzero(counts)
        index = (uniform(branches.key[parents], _CHILD + sort) * counts[parents]).astype(np.int64)
        grown.append(chosen_children(rows, branches, lines, parents, index, counts, sort))
        owners.append(parents)
        stands.append(counts[parents].astype(np.float64))
    return Branches.concatenate(grown), np.concatenate(owners), np.concatenate(stands)


def _own_leaves(rows: Table, branches: Branches, lines: Axes, turn: Floats, place: float | None) -> _Sums:
    """Some leaves of each branch, all turned to the sky as leaves in one place between inside and outside, if so."""
    counts = leaf_counts(rows, branches)
    if not counts.any():
        counts = np.ones_like(counts)
    bearers, row = np.flatnonzero(counts), branches.row[:1]
    leaves = _INCLINED if rows["inclination"][row[0]] else _LEAVES
    owner, each = np.repeat(bearers, leaves), np.tile(np.arange(leaves), len(bearers))
    number = counts[owner]
    # Evenly over the leaves of each branch, beginning anywhere.
    index = ((uniform(branches.key, _CHILD)[owner] + each / leaves) % 1.0 * number).astype(np.int64)
    if rows["leaf_spray"][row[0]] > 0:  # one leaf after the other, so that both sides of the spray have as many
        index = (index - index % _LEAVES + each) % number
    key = foliage.leaf_keys(branches, owner, index)
    t = foliage.leaf_places(rows, branches, owner, index, counts, key)
    roll = uniform(branches.key, Draw.ROLL)[owner]
    if rows["leaf_spray"][row[0]] == 0:
        # The first leaf stands anywhere around the branch, and so does any other: evenly, a good deal of chance goes.
        roll, index = roll + each / leaves, np.zeros_like(index)
    _, along = lines.at(owner, foliage.axis_places(rows, branches, row, owner, t))
    frame = foliage.leaf_frames(rows, row, along.astype(np.float32), roll, index, key)
    outward = foliage.outwardness(rows, branches, owner, t)
    light = foliage.leaf_lights(rows, row, key, outward if place is None else np.full(len(t), place))
    frame = foliage.settled(rows, row, frame, light, foliage.SKY)
    weight = number * (foliage.leaf_sizes(rows, row, key, outward, t) * branches.scale[owner]) ** 2
    # F T Fᵀ, summed over the leaves of each branch: their frames side by side.
    left = _product(frame.reshape(-1, 3).astype(np.float64), turn).reshape(-1, 3, 3) * weight[:, None, None]
    left, right = (f.reshape(-1, leaves, 3, 3).swapaxes(1, 2).reshape(-1, 3, 3 * leaves) for f in (left, frame))
    out = _Sums(np.zeros((len(branches), 3, 3)), np.zeros(len(branches)))
    out.moment[bearers] = left @ right.transpose(0, 2, 1)
    out.weight[bearers] = weight.reshape(-1, leaves).sum(axis=1)
    return out


def _model_moments(rows: Table, forms: Sequence[Forms]) -> Floats:
    """Orientation moment (r, 3, 3) of the leaf that each row bears, in the leaf's own axes."""
    table = np.zeros((len(forms), max(len(one) for one in forms), 3, 3))
    for s, one in enumerate(forms):
        for k, models in enumerate(one):
            areas = np.array([m.area for m in models])
            table[s, k] = np.einsum("f,fij->ij", areas / areas.sum(), np.array([m.moment for m in models]))
    return table[rows["species"], rows["leaf_kind"]]


_PLANES = 32  # planes of each kind of leaf: quantiles of the areas of its faces


def face_planes(rows: Table, forms: Sequence[Forms]) -> Floats:
    """Rotations (r, `_PLANES`, 3, 3) from axes of a face to those of the leaf that each row's own branch bears.

    The third axis is the normal of the face, the second as near as can be to the midrib. Each stands for the same area.
    """
    kinds, kind = np.unique(np.stack([rows["species"], rows["leaf_kind"]], axis=1), axis=0, return_inverse=True)
    return np.array([_planes_of(forms[s][k]) for s, k in kinds.tolist()])[kind.ravel()]


def _planes_of(models: Sequence[LeafModel]) -> Floats:
    """Rotations (`_PLANES`, 3, 3) of one kind of leaves."""
    vectors = np.concatenate([np.zeros((0, 3)), *(model.face_vectors for model in models)])
    areas = np.linalg.norm(vectors, axis=1)
    if areas.sum() <= 0.0:
        return np.tile(np.eye(3), (_PLANES, 1, 1))
    # Faces that are turned alike lie side by side, so that quantiles tell them apart.
    normals = vectors / np.maximum(areas, 1e-300)[:, None]
    order = np.lexsort(np.round(normals, 6).T)
    share = np.cumsum(areas[order]) / areas.sum()
    normal = normals[order[np.searchsorted(share, (np.arange(_PLANES) + 0.5) / _PLANES)]]
    along = np.array([0.0, 1.0, 0.0]) - normal[:, 1:2] * normal
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.where(length > 1e-6, along / np.maximum(length, 1e-6), perpendicular(normal))
    return np.stack([np.cross(along, normal), along, normal], axis=2)
