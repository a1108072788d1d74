# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of all species as one table: the same array operations grow branches of every kind.

A row describes one kind of branch: an order of a species, a part of it between forks, or the short shoot. It names the
rows of its children, of four sorts: laterals of the next order, the stems that continue beyond a fork, short shoots,
dead branches. Children follow their parents in the table. Each branch drawn by hand has a row too: a line of even
segments with frames. Angles are in radians.

``growing`` of a row whose axis is not full-grown holds for each sort of children: the present length of the row over
the full-grown one; the `Nodes` of the row, begin, end, until (of the present length), power, whole and below, where
those that live for a while are (of the present length), and how many there are for each of the others; variation of the
begin over its mean; and the fraction of the order's children at which those begin that live for a while.

Which children a branch has that is not full-grown: those whose place it has reached and that are not dead yet. Each has
its number and place for life. Which numbers those are depends on the places alone, so that nothing appears but at the
very top and nothing goes but at the very base; how many there are is exact on average.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Integers, Keys, Mask, Table, perpendicular
from ..errors import SpeciesError
from ..parameters import keys_of
from ..species.members import expected_forks, least_length, part_segments
from ..species.skeletons import DrawnBranches, drawn_branches
from ..species.species import (
    EVEN,
    LEAF_ENVELOPES,
    LEAF_INCLINATIONS,
    Dead,
    NodeLaw,
    Nodes,
    Order,
    Range,
    Species,
    crown_ratio,
    faded,
    fork_cuts,
    shortened,
    some_nodes,
    whole_cuts,
)
from .hashing import signed

NOW, BEGIN, END, UNTIL, POWER, WHOLE, BELOW, FRESH, EXTRA, VARIES, FADES, LASTS = range(12)
"""Columns of ``growing``."""
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5) / np.array([[1], [2]])


def _grow_children(
    row: np.void, sort: int, nodes: Nodes, start: Range, now: float, cuts: Sequence[float], p: int
) -> None:
    """Set what a row knows of its children of one sort: numbers, ends, ``growing``.

    Its count and ``nodes`` are those of the whole axis, of which the row is part ``p``: ``cuts`` are the ends of all,
    as fractions of the full-grown length. ``start`` is the part of the present axis, ``now`` so long, without children.
    """
    number = float(row["count"][sort, 0])
    if number <= 0:
        return
    law = nodes.law(number)
    low, full = cuts[p], cuts[p + 1] - cuts[p]
    high = now if p + 2 == len(cuts) else min(cuts[p + 1], now)
    here = high - low
    foot, fresh, highest = nodes.ends(law, start[0], now)
    fraction = (np.clip([low, high], foot, highest) - foot) / max(nodes.until * now - foot, 1e-9)
    fades = (fresh - low) / here, (highest - fresh) / here
    begin = float(np.clip((nodes.begin - low) / full, 0, 1))
    end = float(np.clip((nodes.end - low) / full, begin, 1))
    whole = law.whole * (full * (end - begin) / (nodes.end - nodes.begin))
    below = float(np.diff(law.number_at([low, min(nodes.begin, cuts[p + 1])]))[0]) if low < nodes.begin else 0.0
    power = nodes.power if p == 0 else 1.0
    inside = low < start[0] * now < high
    mean = float(np.clip((start[0] * now - low) / here, 0, 0.999))
    fresh, until = np.clip((np.array([fresh, highest]) - low) / here, mean, 1)
    variation = min(start[1] * now / here, mean, 0.999 - mean) if inside else 0.0
    starts = mean + variation * _GAUSS  # numbers are not linear in the start, so that their mean is not that of it
    varies = start[1] / start[0] if start[0] > 0 else 0.0
    begins = varied_begin(begin, varies, _GAUSS)
    part_law = NodeLaw(begins, np.maximum(end, begins), power, whole, below)
    alive = _alive(part_law, (starts, fresh, until), here / full, nodes.extra)
    row["fraction"][sort] = fraction
    row["count"][sort] *= alive / number
    row["start"][sort] = mean, variation
    if alive > 0:
        row["growing"][sort] = (
            *(here / full, begin, end, until, power, whole / alive, below / alive),
            *(fresh, nodes.extra, varies, *fades),
        )


def _alive(law: NodeLaw, places: tuple, now: float, extra: float) -> float:
    """Mean number of living nodes, by where they begin, where those that live for a while do, and where they end."""
    base, fresh, tip = (law.number_at(place * now) for place in places)
    return float(_WEIGHTS @ (np.maximum(tip - base, 0) + extra * np.maximum(tip - np.maximum(fresh, base), 0)))


def living(row: np.void, sort: int, bare: float = 0.0, dead: float | None = None) -> float:
    """Mean number of children of one sort of branches of a row that is not full-grown.

    ``bare`` is where the lowest are at least, by a crown shape; or of dead ones ``dead`` where the topmost are.
    """
    nodes, number, (mean, variation) = row["growing"][sort], row["count"][sort, 0], row["start"][sort]
    begins = varied_begin(nodes[BEGIN], nodes[VARIES], _GAUSS)
    law = NodeLaw(begins, np.maximum(nodes[END], begins), nodes[POWER], nodes[WHOLE] * number, nodes[BELOW] * number)
    starts = np.maximum(mean + (0.0 if dead is not None else variation) * _GAUSS, bare)
    until = max(nodes[UNTIL], dead or 0.0) if nodes[UNTIL] > mean else nodes[UNTIL]
    return _alive(law, (starts, nodes[FRESH], until), nodes[NOW], nodes[EXTRA])


def varied_begin(begin: ArrayLike, varies: ArrayLike, draw: Floats) -> Floats:
    """Where nodes of branches (n,) begin, by random numbers (n,) between -1 and 1."""
    return np.minimum(begin * (1 + varies * draw), np.maximum(begin, 0.999))


def spread_children(
    row: np.void, sort: int, bare: float = 0.0, dead: float = 0.0, among: Floats | None = None
) -> tuple[Floats, ...]:
    """Children of one sort of a mean branch of a row that is not full-grown, as many as stand for all.

    ``bare`` and ``dead`` are as in `living`; ``among`` (2,) is where its children begin and end, by a crown shape.

    Returns
    -------
    t, fraction : (512,) float64
        Where they are on the branch, and among those of the order's branch.
    weight : (512,) float64
        How many each stands for; 1 on the mean.
    fading : (512,) float64
        Factor on their lengths.
    """
    nodes, number = row["growing"][sort], row["count"][sort, 0]
    law = NodeLaw(nodes[BEGIN], nodes[END], nodes[POWER], nodes[WHOLE] * number, nodes[BELOW] * number)
    start = row["start"][sort, 0]
    until = max(nodes[UNTIL], dead) if nodes[UNTIL] > start else nodes[UNTIL]
    foot = max(start, bare)
    place, weight, extra = some_nodes(law, np.array([foot, max(nodes[FRESH], foot), until]) * nodes[NOW], nodes[EXTRA])
    t = np.clip(place / nodes[NOW], 0, 1)
    low, high = row["fraction"][sort] if among is None else among
    return t, low + (high - low) * (t - foot) / max(until - foot, 1e-9), weight, faded(t, *nodes[FADES:], extra)


def lengths(rows: Table, row: Integers, fraction: Floats) -> Floats:
    """Length ratios (n,) of laterals at fractions (n,) of those of their parents, which are of rows (n,)."""
    out = crown_ratio(rows["crown"][row], 1 - fraction)
    ramps = rows["ramps"][row]
    if ramps.any():
        out = out * shortened(fraction, *ramps.T)
    return out


def fullness_of(rows: Table, row: Integers, vigor: Floats, described: Floats | None = None) -> Floats:
    """Factor (n,) on the numbers of branches and leaves on branches of rows (n,) and vigors (n,).

    ``described`` (n,) are their vigors without the crown shapes of their plants.
    """
    weight = rows["count_by_length"][row]
    full = 1 - weight + weight * vigor
    least = rows["least"][row]
    if least.any():  # what has just begun to grow bears nothing yet
        described = vigor if described is None else described
        full = full * np.where(least > 0, np.clip(described / np.maximum(least, 1e-9), 0, 1), 1.0)
    return full


#: Where numbers of nodes that live for a while begin, and those below the first are counted back from: no child
#: index of one is that of another, nor of another sort.
EXTRA_PATH, _NEGATIVE = 1 << 27, 1 << 28


def child_number(index: Integers, path: int) -> Integers:
    """Child indices (n,), for `hashing.child_key`, of children (n,) of a sort; negative ones have some of their own."""
    return np.where(index < 0, index + _NEGATIVE, index) + path if (index < 0).any() else index + path


@dataclass(frozen=True)
class Grown:
    """Living nodes of branches (n,)."""

    on: Mask  # (n,): whether they are still growing; if not, the rest has no meaning
    #: first and number, (2, n): number of the lowest node, and how many there are: of those that stay, and those that
    #: live for a while.
    first: Integers
    number: Integers
    now: Floats  # (n,): length over that when full-grown
    law: NodeLaw  # of (n,) float64
    density: Floats  # (2, n): nodes above the begin, and nodes that live for a while, over those of the law
    ends: Floats  # (2, n): where nodes begin and end, fractions of the present length
    fades: Floats  # (2, n): where those begin that live for a while, and on how long a part they are

    def chosen(self, owner: Integers, index: Integers, whorl: Integers) -> tuple[Integers, Integers, Mask]:
        """Index that is theirs for life, where child numbers begin, and which live for a while (m,), of children (m,).

        These are given by branch and index among the living; a node bears as many as a whorl has.
        """
        node, within = index // whorl, index % whorl
        on, stay = self.on[owner], self.number[0][owner]
        extra = on & (node >= stay)
        node = node + np.where(on, np.where(extra, self.first[1][owner] - stay, self.first[0][owner]), 0)
        return node * whorl + within, np.where(extra, EXTRA_PATH, 0), extra

    def places(self, owner: Integers, node: Integers, within: Floats, extra: Mask) -> tuple[Floats, Floats, Floats]:
        """Fractions (m,) of branches (m,) and of their children at nodes (m,), and factors (m,) on lengths."""
        number = node + within
        dense = np.where(extra, self.density[1][owner], np.where(number >= 0, self.density[0][owner], 1.0))
        number = number / np.maximum(dense, 1e-9)
        t = np.clip(NodeLaw(*(one[owner] for one in self.law)).place_of(number) / self.now[owner], 0, 1)
        begin, end = self.ends[:, owner]
        return t, np.clip((t - begin) / np.maximum(end - begin, 1e-9), 0, 1), faded(t, *self.fades[:, owner], extra)


MAX_SEGMENTS = 24
"""Straight pieces of a drawn branch at most; more are made even."""
_FINER = 3  # segments for one that is drawn: even ones must not cut the corners of uneven ones
MAX_DRAWN = 1000
"""Drawn branches of a plant at most: higher orders are for the computer."""


@dataclass(frozen=True)
class DrawnLines:
    """Drawn branches as arrays of one width, meters in the plant's space; parents come before children."""

    order: Integers  # (b,)
    segments: Integers  # (b,)
    knots: Floats  # (b, MAX_SEGMENTS + 1, 3): evenly spaced along the branch; beyond its segments the last one again
    radii: Floats  # (b, MAX_SEGMENTS + 1)
    #: (b, MAX_SEGMENTS, 3, 3): columns are local axes; the third is the segment's, the others go along untwisted.
    frames: Floats
    #: length, radius and outward, (b,): of the whole line; at its base; and where between inside and outside of the
    #: crown it leaves its limb.
    length: Floats
    radius: Floats
    outward: Floats


def drawn_lines(branches: DrawnBranches) -> DrawnLines:
    """Drawn branches with even segments, as many as they have themselves, at most `MAX_SEGMENTS`.

    Raises
    ------
    SpeciesError
        More than `MAX_DRAWN` branches.
    """
    number = len(branches)
    if number > MAX_DRAWN:
        raise SpeciesError(
            f"The form has {number:,} branches, the limit is {MAX_DRAWN:,}; "
            "remove the thinnest ones, the species grows them"
        )
    segments = np.clip(_FINER * (np.diff(branches.first) - 1), 1, MAX_SEGMENTS)
    # Fractions of the length at which knots lie, one row a branch; the last one is repeated.
    wanted = np.minimum(np.arange(MAX_SEGMENTS + 1) / segments[:, None], 1.0)
    # One rising scale for all branches: that of branch b runs from 2 b to 2 b + 1.
    place = 2 * branches.owner + branches.arc / np.maximum(branches.length, 1e-300)[branches.owner]
    marks = (2 * np.arange(number)[:, None] + wanted).ravel()
    values = [np.interp(marks, place, v).reshape(number, -1) for v in (*branches.knots.T, branches.radius)]
    knots, radii = np.stack(values[:3], axis=-1), np.maximum(values[3], 1e-6)
    chords = np.linalg.norm(np.diff(knots, axis=1), axis=2).sum(axis=1)
    order, outward = branches.order.astype(np.int64), np.asarray(branches.outward, dtype=np.float64)
    return DrawnLines(order, segments, knots, radii, _frames(knots, segments), chords, radii[:, 0], outward)


def _frames(knots: Floats, segments: Integers) -> Floats:
    """Frames along lines, each turned from the one before by the least rotation (Bishop, 1975)."""
    step = np.diff(knots, axis=1)
    size = np.linalg.norm(step, axis=2, keepdims=True)
    last = np.minimum(np.arange(step.shape[1]), segments[:, None] - 1)[..., None]
    direction = np.take_along_axis(step / np.maximum(size, 1e-12), last, axis=1)
    z = np.where(np.linalg.norm(direction[:, 0], axis=1, keepdims=True) > 0.5, direction[:, 0], [0.0, 0.0, 1.0])
    x = perpendicular(z)
    out = np.empty((*direction.shape, 3))
    for s in range(direction.shape[1]):
        ahead = direction[:, s]
        z = np.where(np.linalg.norm(ahead, axis=1, keepdims=True) > 0.5, ahead, z)
        x = x - (x * z).sum(axis=1, keepdims=True) * z
        lost = np.linalg.norm(x, axis=1) < 1e-6  # a line that turns back upon itself
        x[lost] = np.cross(z[lost], [0.3, 0.5, 0.8])
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        out[:, s] = np.stack([x, np.cross(z, x), z], axis=2)
    return out


LATERAL, FORK, SPUR, DEAD = range(4)
"""Sorts of children, the axis of ``next``, ``count``, ``start`` and ``fraction``."""

SPUR_ORDER, DEAD_ORDER = 100, 101
BOX = LEAF_ENVELOPES.index("box")
#: Columns that are keys of an order; what they hold follows from its fields.
_NAMES = (
    "length thickness taper curvature attraction angle azimuth leaves leaf_start leaf_size leaf_angle leaf_azimuth "
    "leaf_light curvature_tip count_by_length angle_tip spray flare pipe leaf_spray leaf_droop leaf_size_tip "
    "leaf_size_young leaf_light_tip branch_color leaf_color leaf_color_tip leaf_color_young segments sides whorl "
    "leaf_whorl crown leaf_kind"
)
_COLUMNS = {name: keys_of(Order)[name] for name in _NAMES.split()}
_FORMS = {
    "range": (np.float64, (2,)), "number": (np.float64,), "integer": (np.int64,), "choice": (np.int64,),
    "color": (np.float64, (2, 3)), "rgb": (np.float64, (3,)),
}  # fmt: skip
#: Where a flared base gets rings of its own, fractions of the length; as far as they lie on the first segment.
FLARE_RINGS = (0.012, 0.035, 0.08)
FADED, FLARE_FALL = np.log(100.0), 8 * np.log(100.0)  # the flare falls to a hundredth over the first eighth
# A fork that no pipe model describes keeps the cross-section.
_FORK_POWER = 2.0

ROW_DTYPE = np.dtype(
    [(name, *_FORMS[key.kind]) for name, key in _COLUMNS.items()]
    + [(name, np.int64) for name in ("species", "order", "rings")]
    + [("envelope", np.int64), ("envelope_radius", np.float64), ("inclination", np.int64)]
    + [("next", np.int32, (4,)), ("count", np.float64, (4, 2)), ("start", np.float64, (4, 2))]
    + [("fraction", np.float64, (4, 2)), ("part", np.float64, (2,))]
    + [("growing", np.float64, (4, 12)), ("settled", np.float64), ("fall", np.float64)]
    + [("ramps", np.float64, (2,)), ("least", np.float64)]
    + [("nominal", np.float64), ("pipe_radius", np.float64), ("fork_power", np.float64)]
    + [("continues", np.bool_), ("outward", np.bool_), ("tropic", np.bool_), ("gradient", np.bool_)]
    + [("sunlit", np.bool_)]
    + [("exact", np.bool_), ("phantom", np.bool_), ("dead", np.bool_), ("drawn", np.bool_)]
    + [("drawn_rows", np.int32, (2,))]
    + [("knots", np.float64, (MAX_SEGMENTS + 1, 3)), ("radii", np.float64, (MAX_SEGMENTS + 1,))]
    + [("frames", np.float64, (MAX_SEGMENTS, 3, 3)), ("size", np.float64, (4,))]
)
"""One kind of branch.

Ranges are (mean, variation), colors ((r, g, b), variation of each). Beyond the keys of an order: ``rings`` are those
that a flared base gets besides its joints; ``next`` the rows of children, -1 for none, ``count`` how many, ``start``
the part that stays bare, or of dead ones where they begin and end, ``fraction`` where these begin and end among all
children of the order's branch; ``part`` the ends of this row on the order's branch and ``nominal`` the length of that
in lengths of this; ``pipe_radius`` the radius of a lateral by the pipe model in radii of this; ``continues`` marks
stems beyond a fork; ``outward`` branches whose own axis leads from the inside of the crown to the outside; ``tropic``
sub-plants whose shape depends on how they stand to the sky; ``gradient`` leaves whose size or color differs between
inside and outside, or old and young; ``sunlit`` leaves that turn to the sky otherwise outside than inside; ``exact``
plants that are all the same; ``dead`` branches that are broken off or bare. Of axes that are not full-grown ``growing``
says where children of each sort are, ``settled`` and ``ramps`` are those of `species.PartGrown`, and ``least`` is the
vigor below which a branch is new, or about to die. A flare falls as e^(-``fall`` t).

A plant whose form is drawn by hand begins with a ``phantom`` row: a branch without wood, whose children are the
``drawn`` rows from the first to before the last of ``drawn_rows``. Each of these is one branch with ``knots`` (meters,
in the plant's space, evenly spaced), ``radii`` over that of the base, ``frames`` along it, and its ``size``: length,
radius, vigor and place between inside and outside.
"""


def build_rows(species: Sequence[Species]) -> Table:
    """Table of parameters, (r,) of `ROW_DTYPE`: the rows of each species follow one another, its trunk first."""
    kinds: list[np.void] = []
    for s, one in enumerate(species):
        kinds += _rows_of_species(one, s, len(kinds))
    rows = np.array(kinds, dtype=ROW_DTYPE)
    for i in range(len(rows) - 1, -1, -1):
        row = rows[i]
        here = row["attraction"].any() or row["spray"] > 0 or row["leaf_spray"] > 0
        children = np.concatenate([row["next"][row["next"] >= 0], np.arange(*row["drawn_rows"])])
        row["tropic"] = here or rows["tropic"][children].any()
    return rows


def with_columns(rows: Table, columns: list[tuple]) -> Table:
    """A copy of rows (r,) with other columns besides, which are 0."""
    out = np.zeros(len(rows), np.dtype(rows.dtype.descr + columns))
    for name in rows.dtype.names:
        out[name] = rows[name]
    return out


def _rows_of_species(one: Species, number: int, first: int) -> list[np.void]:
    """Rows of one species; ``first`` is the index of its trunk in the table."""
    if one.exact:
        one = without_variation(one)
    drawn = None if one.skeleton is None else drawn_lines(drawn_branches(one.skeleton))
    has_spurs = one.spur is not None and any(order.spurs.high > 0 for order in one.orders)
    cuts = [fork_cuts(order) for order in one.orders]
    ahead = 0 if drawn is None else 1 + len(drawn.order)
    begin = first + ahead + np.concatenate([[0], np.cumsum([len(c) - 1 for c in cuts])])
    spur = int(begin[-1])
    dead = spur + has_spurs
    out = [] if drawn is None else _drawn_rows(one, drawn, number, first, begin, spur)
    for o, order in enumerate(one.orders):
        whole = _row(order, number, o)
        for p, (low, high) in enumerate(zip(cuts[o][:-1], cuts[o][1:], strict=True)):
            row = whole.copy()
            if order.branches.high > 0:
                row["next"][LATERAL] = begin[o + 1]
            if p < len(cuts[o]) - 2:
                row["next"][FORK] = begin[o] + p + 1
                row["count"][FORK] = order.forks
                row["start"][FORK] = 1.0, 0.0
            if order.spurs.high > 0 and one.spur is not None:
                row["next"][SPUR] = spur
            if one.dead is not None and drawn is None and o <= 1:
                number_dead = one.dead.on_limbs if o else one.dead.number
                if number_dead.high > 0:
                    row["next"][DEAD], row["count"][DEAD] = dead, number_dead
                    row["start"][DEAD] = one.dead.part(order.branch_start.mean)
            row = _part(row, order, p, low, high, cuts[o][p - 1] if p else 0.0)
            if order.growing is not None:
                _grow(row, order, p, one.dead if o <= 1 else None)
            if o:
                row["least"] = least_length(one.orders[o - 1])
            out.append(row)
            if row["next"][LATERAL] >= 0 and row["pipe"] > 0:
                row["pipe_radius"] = _pipe_radius(row, one.orders[o + 1].thickness.high)
    if has_spurs:
        out.append(_row(one.spur, number, SPUR_ORDER))
    if one.dead is not None and drawn is None:
        out += _dead_rows(one.dead, number, first + len(out))
    for row in out:
        row["exact"] = one.exact
    return out


def _dead_rows(dead: Dead, species: int, first: int) -> list[np.void]:
    """Rows of dead branches, and of the twigs on them; ``first`` is the index of the first one."""
    out = []
    for o, order in enumerate(dead.orders):
        row = _row(order, species, DEAD_ORDER + o)
        row["dead"] = True
        if o + 1 < len(dead.orders) and order.branches.high > 0:
            row["next"][LATERAL] = first + o + 1
        out.append(row)
    return out


def _drawn_rows(one: Species, drawn: DrawnLines, number: int, first: int, begin: Integers, spur: int) -> list[np.void]:
    """The phantom row of a plant that is drawn by hand, and a row for each of its branches."""
    height = max(float(np.ptp(drawn.knots[:, :, 2])), 1e-6)
    whole = np.zeros((), dtype=ROW_DTYPE)
    whole["next"], whole["species"], whole["segments"], whole["sides"], whole["whorl"] = -1, number, 1, 3, 1
    whole["phantom"], whole["length"], whole["part"], whole["nominal"] = True, (height, 0), (0, 1), 1
    whole["thickness"], whole["taper"], whole["leaf_whorl"] = (drawn.radius.max() / height, 0), (1, 0), 1
    whole["leaf_size_tip"] = whole["leaf_size_young"] = 1
    whole["drawn_rows"] = first + 1, first + 1 + len(drawn.order)
    out = [whole]
    highest = int(drawn.order.max())
    longest = np.maximum.reduceat(drawn.length, np.searchsorted(drawn.order, np.arange(highest + 1)))
    for b, o in enumerate(np.minimum(drawn.order, len(one.orders) - 1)):
        order = one.orders[o]
        row = _row(order, number, int(o))
        row["rings"], row["flare"], row["pipe"] = 0, 0, 0
        if drawn.order[b] == highest and order.branches.high > 0:
            row["next"][LATERAL] = begin[o + 1]
        if order.spurs.high > 0 and one.spur is not None:
            row["next"][SPUR] = spur
        row["drawn"], row["segments"] = True, drawn.segments[b]
        row["knots"], row["frames"] = drawn.knots[b], drawn.frames[b]
        row["radii"] = drawn.radii[b] / drawn.radius[b]
        row["taper"] = min(row["radii"][-1], 1.0), 0
        vigor = drawn.length[b] / longest[drawn.order[b]]
        row["size"] = drawn.length[b], drawn.radius[b], vigor, drawn.outward[b]
        out.append(row)
    return out


def _row(order: Order, species: int, number: int) -> np.void:
    """Row of an order whose branches do not fork."""
    row = np.zeros((), dtype=ROW_DTYPE)
    for name, key in _COLUMNS.items():
        value = getattr(order, name)
        value = key.choices.index(value) if key.choices else value
        row[name] = np.radians(value) if key.unit == "degrees" else value
    sizes, colors = {order.leaf_size_tip, order.leaf_size_young}, {order.leaf_color_tip, order.leaf_color_young}
    row["gradient"] = sizes != {1.0} or colors != {order.leaf_color.mean}
    row["sunlit"] = order.leaf_light_tip != order.leaf_light.mean
    row["envelope"] = LEAF_ENVELOPES.index(order.leaf_envelope)
    row["envelope_radius"] = order.leaf_envelope_radius if row["envelope"] else 0.0
    row["inclination"] = LEAF_INCLINATIONS.index(order.leaf_inclination)
    row["species"], row["order"], row["outward"], row["next"] = species, number, number <= 1, -1
    row["count"] = order.branches, (0, 0), order.spurs, (0, 0)
    row["start"] = order.branch_start, (0, 0), order.spur_start, (0, 0)
    row["fraction"], row["part"], row["nominal"] = (0, 1), (0, 1), 1
    if order.pipe > 0:
        row["pipe"] = max(order.pipe, 1.0)
    row["fork_power"], row["fall"] = row["pipe"] or _FORK_POWER, FLARE_FALL
    row["rings"] = _flare_rings(row)
    return row


def _grow(row: np.void, order: Order, p: int, dead: Dead | None) -> None:
    """Where children of a part are, number ``p`` of an order that is not full-grown."""
    growing, cuts = order.growing, whole_cuts(order)
    row["settled"], row["ramps"] = growing.settled, growing.ramps
    sorts = [(LATERAL, growing.laterals, order.branches, order.branch_start)]
    sorts += [(SPUR, growing.spurs, order.spurs, order.spur_start)]
    if dead is not None and row["next"][DEAD] >= 0:
        low, high = dead.part(order.branch_start.mean)
        nodes = growing.dead._replace(until=high)
        sorts += [(DEAD, nodes, dead.on_limbs if row["order"] else dead.number, Range(low))]
    for sort, nodes, number, start in sorts:
        if row["next"][sort] >= 0:
            row["count"][sort] = number
            _grow_children(row, sort, nodes, start, growing.now, cuts, p)
            if sort == DEAD:
                row["start"][DEAD, 1] = max(row["start"][DEAD, 0], row["growing"][DEAD, UNTIL])


def _part(row: np.void, order: Order, p: int, low: float, high: float, before: float) -> np.void:
    """Turn the row of an order into that of its part from ``low`` to ``high``; the part below begins at ``before``."""
    if order.forks.high <= 0:
        return row
    length, tip = high - low, order.taper.mean
    row["part"], row["nominal"] = (low, high), 1 / length
    row["segments"] = part_segments(order)[p]
    radius = [_radius(order, u) for u in (low, high)]
    row["taper"] = radius[1] / radius[0], row["taper"][1] * (1.0 if tip == 0 else min(1.0, radius[1] / radius[0]))
    row["taper"][1] = min(row["taper"][1], row["taper"][0], 1 - row["taper"][0])
    begin, end = whole_cuts(order)[p : p + 2]  # a part that is still growing bends as it will
    middle = np.clip((0.5 - begin) / (end - begin), 0, 1)  # of the order's branch, where its outer half begins
    inner, outer = row["curvature"][0], row["curvature_tip"]
    row["curvature"][0] = (inner if middle >= 0.5 else outer) * (end - begin)
    row["curvature_tip"] = (inner if middle > 0.5 else outer) * (end - begin)
    row["curvature"][1] *= end - begin
    row["attraction"] *= end - begin
    for sort, start in ((LATERAL, order.branch_start), (SPUR, order.spur_start)):
        fraction = np.clip((np.array([low, high]) - start.mean) / (1 - start.mean), 0, 1)
        row["fraction"][sort] = fraction
        row["count"][sort] *= fraction[1] - fraction[0]
        row["start"][sort] = _local_start(start, low, high)
    if row["next"][DEAD] >= 0:
        ends = row["start"][DEAD].copy()
        row["fraction"][DEAD] = np.clip((np.array([low, high]) - ends[0]) / np.ptp(ends), 0, 1)
        row["count"][DEAD] *= np.ptp(row["fraction"][DEAD])
        row["start"][DEAD] = np.clip((ends - low) / length, 0, 1)
    leaf_fraction = np.clip((np.array([low, high]) - order.leaf_start.mean) / (1 - order.leaf_start.mean), 0, 1)
    row["leaves"] *= leaf_fraction[1] - leaf_fraction[0]
    row["leaf_start"] = _local_start(order.leaf_start, low, high)
    if low > 0:
        relative = order.length.variation / order.length.mean
        factor = length / (low - before)
        row["length"], row["thickness"] = (factor, factor * relative), (1, 0)
        row["angle"] = np.radians(order.fork_angle)
        row["angle_tip"], row["azimuth"] = row["angle"][0], (0, 0.35)
        # As wide at its base as what it comes from, or the fork would be an open pipe.
        row["whorl"], row["continues"] = 1, True
        row["flare"] = expected_forks(order.forks) ** (1 / row["fork_power"]) - 1
        if row["order"] == 0:  # not within less than its own radius, or at an angle it would still be an open pipe
            base = order.thickness.mean * radius[0] * (1 + row["flare"]) ** (1 - p)
            row["fall"] = np.clip(length / base, FADED, FLARE_FALL)
    else:
        row["length"] *= length
        if row["order"] == 0:  # whose thickness is a fraction of its length
            row["thickness"] /= length
    row["rings"] = _flare_rings(row)
    return row


def _local_start(start: Range, low: float, high: float) -> tuple[float, float]:
    mean = float(np.clip((start.mean - low) / (high - low), 0, 0.999))
    inside = low < start.mean < high
    return mean, (min(start.variation / (high - low), mean, 0.999 - mean) if inside else 0.0)


def _radius(order: Order, u: float) -> float:
    """Radius at a fraction of the branch, in radii of its base (`axes.profile` without flare)."""
    if order.pipe <= 0:
        return 1 - (1 - order.taper.mean) * u
    fraction = float(np.clip((u - order.branch_start.mean) / (1 - order.branch_start.mean), 0, 1))
    power = max(order.pipe, 1.0)
    tip = order.taper.mean**power
    return (tip + (1 - tip) * (1 - fraction)) ** (1 / power)


def _flare_rings(row: np.void) -> int:
    return sum(ring < 0.98 / row["segments"] for ring in FLARE_RINGS) if row["flare"] > 0 else 0


def _pipe_radius(row: np.void, thickest: float) -> float:
    """Radius of a lateral of vigor 1 such that all together have what the taper takes away, in r^p."""
    low, high = row["fraction"][LATERAL]
    fraction, weight, fading = low + (high - low) * EVEN, 1.0, 1.0
    if row["growing"][LATERAL, NOW] > 0:
        _, fraction, weight, fading = spread_children(row, LATERAL)
    vigor = lengths(row[None], np.zeros(fraction.shape, np.int64), fraction) * fading
    lost = 1 - row["taper"][0] ** row["pipe"]
    number = max(row["count"][LATERAL, 0], 1.0) * (weight * vigor ** row["pipe"]).mean()
    return min((lost / max(number, 1e-12)) ** (1 / row["pipe"]), 1 / max(thickest, 1e-9))


def without_variation(species: Species) -> Species:
    """The exact plant of a species: every range has its mean."""
    orders, dead = tuple(_exact(order) for order in species.orders), species.dead
    if dead is not None:
        dead = replace(_exact(dead), orders=tuple(_exact(order) for order in dead.orders))
    return replace(species, orders=orders, spur=None if species.spur is None else _exact(species.spur), dead=dead)


def _exact(order: Order | Dead) -> Order | Dead:
    still = {name: Range(value.mean) for name, value in vars(order).items() if isinstance(value, Range)}
    return replace(order, **still)


def ranged(rows: Table, name: str, row: Integers, key: Keys, draw: int) -> NDArray:
    """Value of one parameter for each branch: mean + variation × a signed random number of its key.

    Parameters
    ----------
    rows : table of `build_rows`
    name : str
        A range of `ROW_DTYPE`.
    row : (n,) int
        Or (1,), which stands for all.
    key : (n,) uint64
    draw : int
        See `hashing.Draw`.

    Returns
    -------
    (n,) float64
        Or (1,) where it is the same for all of one row.
    """
    return varied(rows[name][row], key, draw)


def varied(values: Floats, key: Keys, draw: int) -> Floats:
    """Mean + variation × a signed random number, of ranges (n, 2) or (1, 2) and keys (n,)."""
    mean, variation = values[..., 0], values[..., 1]
    if not variation.any():  # most are exact, and hashing is most of the time that this takes
        return mean if len(mean) == 1 else mean + np.zeros(len(key))
    return mean + variation * signed(key, draw)
