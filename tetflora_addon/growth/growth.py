# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Growing branches: trunks from seeds, children of branches, all as arrays (paper, section 5).

A branch is also a *sub-plant*: it and all that grows on it. Functions take any mix of species and orders.
`WholeBranches` have their axes with them, from which wood and leaves are made; each axis is computed once.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Integers, Integers32, Keys, Table, by_component, columns, dot, spread
from ..species.members import dead_vigor
from ..species.species import NodeLaw
from . import crown_effects
from . import rows as table
from .axes import Axes, axes, profile
from .hashing import Draw, child_key, key_of_seed, signed, uniform
from .rows import DEAD, FORK, LATERAL, SPUR, Grown, child_number, fullness_of, lengths, ranged, varied
from .seasons import plant_years
from .seeds import BASE, LEAVES, Branches, Pose, Seeds
from .wind import axis_and_angle, is_windy, moment, turned_by, turned_vectors

_PLACE_JITTER = 0.5  # of the distance from one child to the next: together children lie evenly along the whole parent
# Each sort of children has child indices of its own, below those of leaves.
_PATHS = np.array([0, 1 << 30, 1 << 31, 3 << 30])
_DRAWN_PATH = 1 << 29
_COUNT = (Draw.BRANCHES, Draw.FORKS, Draw.SPURS, Draw.DEAD)
_ROUND = (Draw.BRANCHES_ROUND, Draw.FORKS_ROUND, Draw.SPURS_ROUND, Draw.DEAD_ROUND)
_START = (Draw.BRANCH_START, Draw.BRANCH_START, Draw.SPUR_START)


def turned(frame: Floats, azimuth: Floats, angle: Floats) -> Floats:
    """Frames (n, 3, 3) turned by an azimuth (n,) about their z and then tilted by an angle (n,) away from it, radians.

    The third column leans by the angle; the first is the same lean a right angle further.
    """
    x, y, z = frame[:, :, 0], frame[:, :, 1], frame[:, :, 2]
    ca, sa, cd, sd = (f(v)[:, None] for v in (azimuth, angle) for f in (np.cos, np.sin))
    radial = ca * x + sa * y
    return columns(cd * radial - sd * z, ca * y - sa * x, sd * radial + cd * z)


def level_azimuth(frame: NDArray[np.floating], sky: NDArray[np.floating] | None = None) -> NDArray[np.floating]:
    """Azimuth (n,) about the z of frames (n, 3, 3) at which one looks level to the side; any for upright ones.

    ``sky`` (n, 3) is where up is, if not along z.
    """
    if sky is None:
        return np.arctan2(-frame[:, 2, 0], frame[:, 2, 1])
    return np.arctan2(-dot(frame[:, :, 0], sky)[:, 0], dot(frame[:, :, 1], sky)[:, 0])


def trunk_lengths(rows: Table, seeds: Seeds) -> tuple[Integers32, Keys, Floats]:
    """Rows (n,), keys (n,) and lengths (n,) of the trunks of plants, before crown shapes; meters."""
    first = np.flatnonzero(np.diff(rows["species"], prepend=-1))  # of each species
    row = first.astype(np.int32)[seeds.species]
    key = key_of_seed(np.where(rows["exact"][row], 0, seeds.seed))
    return row, key, seeds.scale * ranged(rows, "length", row, key, Draw.LENGTH)


def trunks(rows: Table, seeds: Seeds) -> Branches:
    """Trunks of plants (order 0)."""
    row, key, length = trunk_lengths(rows, seeds)
    radius = length * ranged(rows, "thickness", row, key, Draw.THICKNESS)
    straight = rows["phantom"][row] | (rows["envelope"][row] == table.BOX)
    roll = np.where(straight, 0.0, 2 * np.pi * uniform(key, Draw.ROLL))
    frame = turned(seeds.frame, roll, ranged(rows, "angle", row, key, Draw.ANGLE))
    plant = np.arange(len(seeds), dtype=np.int32)
    scale = np.asarray(seeds.scale, dtype=np.float64)
    one, none = np.ones(len(seeds)), np.zeros(len(seeds))
    sky = by_component(np.tile([0.0, 0.0, 1.0], (len(seeds), 1))) if is_windy(rows) else None
    later = _later(seeds, frame, sky, moment(rows)) if moment(rows) else None
    year, crown = plant_years(rows, row, key), None
    if seeds.crown is not None:
        crown, thickness = crown_effects.shaped_trunks(rows, row, frame, seeds.crown)
        length, radius = length * crown_effects.length_factors(rows, row, crown), radius * thickness
    return Branches(row, plant, key, seeds.position, frame, length, radius, scale, one, none, sky, later, year, crown)


def _later(seeds: Seeds, frame: Floats, sky: Floats, seconds: float) -> Pose:
    """Trunks so many seconds later: the foot of a plant stands still unless the whole plant moves."""
    if seeds.motion is None:
        return Pose(seeds.position, frame, sky)
    step = seconds * seeds.motion
    turn = axis_and_angle(step[:, 3:])
    return Pose(seeds.position + step[:, :3], turned_by(frame, *turn), turned_vectors(sky, *turn))


def drawn_children(rows: Table, plants: Branches) -> tuple[Branches, Integers]:
    """Branches (m,) drawn by hand of plants (n,) that have such a form, and the plant (m,) of each."""
    first, last = rows["drawn_rows"][plants.row].T
    owner, index = spread((last - first).astype(np.int64))
    return chosen_drawn(rows, plants, owner, index), owner


def chosen_drawn(rows: Table, plants: Branches, owner: Integers, index: Integers) -> Branches:
    """Some of the branches drawn by hand, given by plant (m,) and number (m,)."""
    plant = plants.take(owner)
    row = (rows["drawn_rows"][plant.row, 0] + index).astype(np.int32)
    length, radius, vigor, outward = rows["size"][row].T

    def begun(pose: Branches | Pose) -> tuple[Floats, Floats]:
        start = np.einsum("nij,nj->ni", pose.frame, rows["knots"][row, 0]) * plant.scale[:, None]
        return pose.position + start, pose.frame @ rows["frames"][row, 0]

    position, frame = begun(plant)
    # The drawing is bent when its lines are asked for.
    later = None if plant.later is None else Pose(*begun(plant.later), plant.later.sky)
    key = child_key(plant.key, index + _DRAWN_PATH)
    size = {"length": length * plant.scale, "radius": radius * plant.scale}
    where = {"position": position, "frame": frame, "later": later}
    return replace(plant, row=row, key=key, vigor=vigor, outward=outward, **where, **size)


def fullness(rows: Table, branches: Branches, wood: bool = False) -> Floats:
    """Factor (n,) on the numbers of leaves, or of branches: 1 for the longest branches of a crown, less for others.

    What a crown shape has more or less of is half in the number of twigs on limbs and half in that of leaves on each.
    """
    vigor, crown = branches.vigor, branches.crown
    if crown is None:
        return fullness_of(rows, branches.row, vigor)
    order, leafy = rows["order"][branches.row], np.sqrt(crown[:, LEAVES].astype(np.float64))
    leafy = np.where(order == 1, leafy if wood else leafy**2, 1.0 if wood else np.where(order > 1, leafy, 1.0))
    return leafy * fullness_of(rows, branches.row, vigor, vigor / crown[:, 0])


def branch_counts(rows: Table, branches: Branches, sort: int = LATERAL) -> Integers:
    """Number (n,) of children of one sort, in whole whorls; its expectation is exactly the range's mean."""
    row, key = branches.row, branches.key
    wanted = varied(rows["count"][row, sort], key, _COUNT[sort])
    child = rows["next"][row, sort]
    if sort == FORK:
        number = np.maximum(np.floor(wanted + uniform(key, _ROUND[sort])), 1)  # what divides goes on
        return np.where(child >= 0, number, 0).astype(np.int64)
    whorl = np.maximum(rows["whorl"][child], 1)
    if crown_effects.are_shaped(rows, branches):
        start = rows["start"][row, DEAD, 0] if sort == DEAD else _started(rows, branches, sort)
        wanted = wanted * crown_effects.count_factors(rows, row, branches.crown[:, BASE], sort, start)
    full = fullness(rows, branches, wood=True)
    nodes = np.floor(wanted * full / whorl + uniform(key, _ROUND[sort])).astype(np.int64)
    grown = living_nodes(rows, branches, sort)
    if grown is not None:
        nodes = np.where(grown.on, grown.number.sum(axis=0), nodes)
    return np.where(child >= 0, nodes * whorl, 0)


def living_nodes(rows: Table, branches: Branches, sort: int) -> Grown | None:
    """Living nodes of branches that are not full-grown; None where all are."""
    row, key, path = branches.row, branches.key, int(_PATHS[sort])
    if sort == FORK or not rows["growing"][row, sort, table.NOW].any():
        return None
    nodes = rows["growing"][row, sort]
    on = nodes[:, table.NOW] > 0
    now, power = (np.where(on, nodes[:, column], 1.0) for column in (table.NOW, table.POWER))
    whorl = np.maximum(rows["whorl"][rows["next"][row, sort]], 1)
    wanted = varied(rows["count"][row, sort], key, _COUNT[sort]) * fullness(rows, branches, wood=True) / whorl
    draw = np.zeros(len(row)) if sort == DEAD else signed(key, _START[sort])
    mean, variation = rows["start"][row, sort].T
    start = mean + variation * draw
    last = nodes[:, table.UNTIL]
    if crown_effects.are_shaped(rows, branches):
        base = branches.crown[:, BASE]
        bare = crown_effects.bare_part(rows, row, base)
        if sort == LATERAL:
            start, wanted = np.maximum(start, bare), wanted * crown_effects.limb_count_factors(rows, row, base)
        elif sort == DEAD:
            last = np.where(last > start, np.maximum(last, bare), last)
    begin = table.varied_begin(nodes[:, table.BEGIN], nodes[:, table.VARIES], draw)
    whole = wanted * nodes[:, table.WHOLE]
    law = NodeLaw(begin, np.maximum(nodes[:, table.END], begin), power, whole, wanted * nodes[:, table.BELOW])
    # Nodes of the full-grown branch are rounded.
    settled, chance = rows["settled"][row], uniform(key, _ROUND[sort])
    rounded = (1 - settled) * whole + settled * np.floor(whole + chance)
    density = np.where(whole > 0, rounded / np.maximum(whole, 1e-12), 1.0), nodes[:, table.EXTRA]
    ends = np.stack([law.number_at(place * now) for place in (start, nodes[:, table.FRESH], last)])
    extent, fades = np.stack([start, np.maximum(last, start)]), nodes[:, table.FADES :].T
    ends = np.maximum(ends, ends[0])

    def passed(place: Floats, begin: int) -> Integers:
        node = np.floor(place)
        first = child_key(key, child_number((node * whorl).astype(np.int64), path + begin))
        within = 0.5 + 0.5 * signed(first, Draw.PLACE)  # where in their node children sit, 0 to 1
        return node.astype(np.int64) + (within < place - node)

    stay = [passed(np.where(place > 0, place * density[0], place), 0) for place in (ends[0], ends[2])]
    extra = [passed(place * density[1], table.EXTRA_PATH) for place in ends[1:]]
    first, last = np.stack([stay, extra], axis=1)
    return Grown(on, first, np.maximum(last - first, 0), now, law, np.stack(density), extent, fades)


def _started(rows: Table, branches: Branches, sort: int) -> Floats:
    """Part (n,) of branches that their species leaves bare of children of a sort."""
    return varied(rows["start"][branches.row, sort], branches.key, _START[sort])


def leaf_counts(rows: Table, branches: Branches) -> Integers:
    """Number (n,) of leaves on branches' own axes, in whole whorls; its expectation is exactly the range's mean."""
    wanted = ranged(rows, "leaves", branches.row, branches.key, Draw.LEAVES) * fullness(rows, branches)
    whorl = rows["leaf_whorl"][branches.row]
    return np.floor(wanted / whorl + uniform(branches.key, Draw.LEAVES_ROUND)).astype(np.int64) * whorl


def radius_at(rows: Table, branches: Branches, t: Floats) -> Floats:
    """Radius at fractions t (n,) of the branches (n,), meters."""
    return branches.radius * profile(rows, branches.row, branches.key, t)


def chosen_children(
    rows: Table, parents: Branches, lines: Axes, owner: Integers, index: Integers, counts: Integers, sort: int = LATERAL
) -> Branches:
    """Some children (m,) of branches.

    Parameters
    ----------
    parents : Branches of n
    lines : Axes of the same n
    owner : (m,) int
        Which parent.
    index : (m,) int
        Which of its children of this sort.
    counts : (n,) int
        Number of children of this sort of each parent.
    sort : int
        ``rows.LATERAL``, ``rows.FORK``, ``rows.SPUR`` or ``rows.DEAD``.
    """
    parent = parents.take(owner)
    path = int(_PATHS[sort])
    row = rows["next"][parent.row, sort]
    grown = living_nodes(rows, parents, sort)
    if grown is not None:
        index, more, extra = grown.chosen(owner, index, rows["whorl"][row])
        path = path + more
    key = child_key(parent.key, child_number(index, path))
    fading, shaped = 1.0, crown_effects.are_shaped(rows, parents)
    if sort == FORK:
        whorl, node, within, fraction = counts[owner], np.zeros_like(index), index, np.ones(len(index))
        t = np.ones(len(index))
    else:
        # Branches of a whorl share their place: that of the first of them.
        whorl = rows["whorl"][row]
        node, within = index // whorl, index % whorl
        first = child_key(parent.key, child_number(node * whorl, path))
        place = signed(np.where(within > 0, first, key), Draw.PLACE)
        fraction = (node + 0.5 + _PLACE_JITTER * place) / np.maximum(counts[owner] // whorl, 1)
        base = parent.crown[:, BASE] if shaped else None
        if sort == DEAD:
            start, end = rows["start"][parent.row, sort].T
            end = crown_effects.dead_end(rows, parent.row, base) if shaped else end
        else:
            start, end = _started(rows, parent, sort), 1.0
            if shaped and sort == LATERAL:
                start = np.maximum(start, crown_effects.bare_part(rows, parent.row, base))
        t = start + (end - start) * fraction
        if grown is not None:
            along, part, fading = grown.places(owner, node, 0.5 + _PLACE_JITTER * place, extra)
            on = grown.on[owner]
            t, fraction = np.where(on, along, t), np.where(on, part, fraction)
        among = rows["fraction"][parent.row, sort]
        low, high = (crown_effects.lateral_fractions(rows, parent.row, base) if shaped and sort == LATERAL else among).T
        fraction = low + (high - low) * fraction
    position, frame = lines.at(owner, t)
    sky = lines.sky_at(owner, t)
    angle_base, angle_spread = rows["angle"][row].T
    angle = angle_base + (rows["angle_tip"][row] - angle_base) * fraction + angle_spread * signed(key, Draw.ANGLE)
    step, jitter = rows["azimuth"][row].T
    turn = uniform(parent.key, Draw.AZIMUTH)
    azimuth = 2 * np.pi * (turn + within / whorl) + node * step + jitter * signed(key, Draw.AZIMUTH)
    spray = rows["spray"][row]
    if spray.any():
        # Level to the sides, as far as the order asks for; 0 turns whole parents at random, as ``turn`` does.
        level = level_azimuth(frame, sky) + 2 * np.pi * ((1 - spray) * (turn - 0.5) - turn)
        azimuth += np.where(spray > 0, level, 0.0)
    if sort == FORK:
        angle = np.where(counts[owner] > 1, angle, 0.0)
    full_length, reach = parent.length, 1.0
    if shaped:
        lean, reach = crown_effects.child_factors(rows, parent, azimuth, sort)
        angle = angle * lean
        full_length = full_length / crown_effects.length_factors(rows, parent.row, parent.crown)
    frame = turned(frame, azimuth, angle)
    around = parent.outward
    limb = (rows["order"][parent.row] == 1) & (sort != FORK)
    if limb.any():
        first, last = rows["part"][parent.row].T
        around = np.where(limb, first + (last - first) * t, around)
    radius = radius_at(rows, parent, t)
    if sort == LATERAL:
        vigor = lengths(rows, parent.row, fraction) * fading
        radius = np.where(rows["pipe"][parent.row] > 0, parent.radius * rows["pipe_radius"][parent.row] * vigor, radius)
        vigor = vigor * reach
        measure = full_length * rows["nominal"][parent.row] * vigor
    elif sort == DEAD:
        vigor = dead_vigor(fraction) * reach
        measure = full_length * rows["nominal"][parent.row] * vigor
    elif sort == FORK:
        vigor, measure = parent.vigor, full_length  # which follows the crown already
        if shaped:
            measure = measure * crown_effects.length_factors(rows, row, parent.crown)
        radius = radius * np.maximum(whorl, 1) ** (-1 / rows["fork_power"][parent.row])
    else:
        vigor, measure = np.ones(len(index)), parent.scale
    length = measure * ranged(rows, "length", row, key, Draw.LENGTH)
    radius = (length if sort == SPUR else radius) * ranged(rows, "thickness", row, key, Draw.THICKNESS)
    later = None
    if lines.later is not None:
        again = chosen_children(rows, parents.moved(), lines.later, owner, index, counts, sort)
        later = Pose(again.position, again.frame, again.sky)
    crown = None if parent.crown is None else crown_effects.handed_on(rows, parent, sort, reach, azimuth, angle)
    place = position, frame, length, radius, parent.scale, vigor, around, sky, later
    return Branches(row, parent.plant, key, *place, parent.year, crown)


def children(rows: Table, parents: Branches, lines: Axes | None = None) -> tuple[Branches, Integers]:
    """All children (m,) of branches (n,), and the parent (m,) of each; ``lines`` are the branches' axes if known."""
    lines = axes(rows, parents) if lines is None else lines
    grown, owners = [Branches.empty()], [np.zeros(0, np.int64)]
    for sort in np.flatnonzero((rows["next"][parents.row] >= 0).any(axis=0)).tolist():
        counts = branch_counts(rows, parents, sort)
        owner, index = spread(counts)
        grown.append(chosen_children(rows, parents, lines, owner, index, counts, sort))
        owners.append(owner)
    return (grown[1], owners[1]) if len(grown) == 2 else (Branches.concatenate(grown), np.concatenate(owners))


@dataclass(frozen=True)
class WholeBranches(Arrays):
    """Whole branches and their axes."""

    branches: Branches  # of n
    lines: Axes  # of the same n

    def knots(self, rows: Table) -> tuple[Integers, Floats, Floats]:
        """Where segments begin and end; a flared base has some more.

        Returns
        -------
        owner : (m,) int64
            Branch of each place, in order; those of a branch from base to tip.
        t : (m,) float64
            Fraction of its axis.
        position : (m, 3) float64
        """
        rings = rows["rings"][self.branches.row]
        owner, index = spread(self.lines.segments + rings + 1)
        knot = index if not rings.any() else np.maximum(index - np.take(rings, owner), 0)
        t = knot / np.take(self.lines.segments, owner)
        position = self.lines.knot(owner, knot)
        if rings.any():  # the first segment is cut where the flare bends most
            fractions = np.array([0.0, *table.FLARE_RINGS[: int(rings.max())]])
            cut = np.flatnonzero((index <= rings[owner]) & (index > 0) & (rings[owner] > 0))
            t[cut] = fractions[index[cut]]
            position[cut] = self.lines.at(owner[cut], t[cut])[0]
        return owner, t, position


def open_branches(rows: Table, subplants: Branches) -> tuple[WholeBranches, Integers, Branches, Integers]:
    """Branches of sub-plants with the index of the sub-plant of each, and their children with that of their parent."""
    phantom = rows["phantom"][subplants.row]
    if phantom.any():  # a form drawn by hand: its branches are known, and opened with the plant
        plants, rest = np.flatnonzero(phantom), np.flatnonzero(~phantom)
        drawn, plant = drawn_children(rows, subplants.take(plants))
        bodies, body = Branches.concatenate([subplants.take(rest), drawn]), np.concatenate([rest, plants[plant]])
    else:
        bodies, body = subplants, np.arange(len(subplants))
    lines = axes(rows, bodies)
    return WholeBranches(bodies, lines), body, *children(rows, bodies, lines)
