# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Heights and crown widths of single plants as one would measure them, and crown shapes of plants that were measured.

Of the limbs of a plant the few that are likely to end outermost or on top are grown. How far what grows on these
reaches beyond them is known from a few whole limbs of their kind. Means of a species are for distances and estimates.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Self
from weakref import WeakKeyDictionary

import numpy as np

from ..arrays import GOLDEN_TURN, Arrays, Floats, Floats32, Integers, Integers32, Mask, Table, column, spiral, spread
from ..growth.axes import Axes, axes
from ..growth.crown_effects import MOST_LEANING, are_stools, bare_part, child_factors, lateral_fractions, length_factors
from ..growth.foliage import envelope_reach, leaf_keys, leaf_places, place_leaves, settled
from ..growth.growth import branch_counts, chosen_children, leaf_counts, living_nodes, open_branches, trunks
from ..growth.hashing import Draw, uniform
from ..growth.rows import FORK, LATERAL, lengths
from ..growth.seeds import BASE, LEAST, MOST, PLAIN, WIDTH, Branches, Seeds
from ..leaves.levels import level_errors
from ..leaves.models import LeafModel
from ..parallel import each_on_all_cores
from ..species.members import expected_polygons
from ..species.species import Species
from .flora import Flora, compile_species
from .samples import Points

_WITHIN = 0.9  # of the leaves are in what counts as the crown; single shoots beyond it take no room
_TALLEST = 0.98  # of the leaves are lower than the plant is tall
_LEAF_LEANS = 0.25  # of the length of leaves, which makes the crown of grass: its axes are next to nothing
LEVEL = 0.7  # of the area of leaves is seen from above, between those that stand in all directions and those that lie
_LOWEST = 0.03  # of the leaves are lower than the crown's base
_PLANTS = 16  # whose trunks' lengths stand for all
_MOST = 256  # crowns that are kept
_REACH = 0.25  # of a line's length is how far its nearer end is to one side of any point of it, on average
_PARTS = 4096  # leaves, and branches, of a crown that stand for all: few of a tree's are at the height of eyes
_FINER = 8  # times as many samples, of which these are

_known: "dict[Species, Crown]" = {}


@dataclass(frozen=True)
class CrownParts(Arrays):
    """Some leaves and branches (n) of a plant of scale 1, each of which stands for a number of its like."""

    position: Floats = column(3)  # (n, 3): in the axes of the plant, meters
    number: Floats  # (n,): how many it stands for
    area: Floats  # (n,): one-sided area of one leaf, half the surface of one branch, m²
    #: width and length, (n,): of the leaf, or the branch; meters.
    width: Floats
    length: Floats
    #: (n,): how far the branch that bears a leaf reaches with all its leaves, and a branch itself, from any point of it
    #: and turned any way; meters.
    reach: Floats
    #: sides and segments, (n,): of the tube of a branch.
    sides: Integers = column(dtype=np.int64)
    segments: Integers = column(dtype=np.int64)
    buds: Floats  # (n,): on a branch
    form: Integers = column(dtype=np.int64)  # (n,): which of `Crown.forms` a leaf has; -1 of branches

    def with_leaves(self, fraction: float) -> Self:
        """The same with a fraction of the leaves."""
        return replace(self, number=np.where(self.form < 0, 1.0, fraction) * self.number)


@dataclass(frozen=True)
class Crown:
    """Of a plant of scale 1."""

    #: radius and height: meters.
    radius: float
    height: float
    polygons: float  # expected number of the whole plant
    base: float = 0.0  # meters below which there are next to no leaves
    #: leaves and wood: expected one-sided area of the leaves and surface of the branches, m².
    leaves: float = 0.0
    wood: float = 0.0
    #: Mean linear RGB of both, weighted by how much of them is seen from above.
    color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    forms: tuple[LeafModel | None, ...] = (None,)  # one of its leaves and one of its blossoms, where these are known
    #: Where nobody has looked, all its polygons are leaves that fill the crown evenly.
    parts: CrownParts = field(default_factory=CrownParts.empty, compare=False)

    def __post_init__(self) -> None:
        """Leaves in place of parts that nobody knows."""
        if not len(self.parts):
            object.__setattr__(self, "parts", _even_parts(self))

    @property
    def seen(self) -> float:
        """Area that leaves and wood hide from above, counted singly, m²."""
        return LEVEL * self.leaves + self.wood / np.pi


def known_crown(species: Species) -> Crown | None:
    """What `crown_of` has found already, at once; None where it has not been asked."""
    return _known.get(species)


def crown_of(species: Species) -> Crown:
    """The mean crown of a species; its samples are drawn at the first time, which takes some tenths of a second.

    Raises
    ------
    SpeciesError
        A leaf is still the name of a Blender object.
    """
    crown = _known.get(species)
    if crown is None:
        while len(_known) >= _MOST:
            _known.pop(next(iter(_known)), None)
        crown = _known[species] = _crown_of(species)
    return crown


def prepare(species: Species) -> None:
    """Find the mean crown of a species, and how finely its leaves may be drawn: what an estimate may have to wait for.

    Errors are those of `crown_of`.
    """
    for form in crown_of(species).forms:
        if form is not None:
            level_errors(form)


def _crown_of(species: Species) -> Crown:
    flora = compile_species([species])
    trunk = trunks(flora.rows, Seeds.upright(_PLANTS))
    row, length = int(trunk.row[0]), float(trunk.length.mean())
    coarse, fine = flora.samples_of((row,), 1, _FINER)
    points = coarse.leaves if flora.leaf_count[row] > 0 else coarse.wood
    first, samples = int(points.first[row, -1]), int(points.number[row, -1])
    place = length * points.position[first : first + samples].astype(np.float64)
    reach = _LEAF_LEANS * float(flora.leaf_reach[row])
    radius = float(np.quantile(np.hypot(place[:, 0], place[:, 1]), _WITHIN)) + reach
    height = max(float(np.quantile(place[:, 2], _TALLEST)), radius)
    base = max(float(np.quantile(place[:, 2], _LOWEST)), 0.0) if flora.leaf_count[row] > 0 else 0.0
    leaves, wood = flora.leaf_areas(trunk), flora.wood_areas(trunk)
    areas = np.array([LEVEL * leaves.mean(), wood.mean() / np.pi])
    colors = np.stack([flora.leaf_colors(trunk).mean(axis=0), flora.wood_color[row]])
    color = tuple((areas @ colors / areas.sum()).tolist())
    polygons = expected_polygons(flora.species[0])
    forms = tuple(next(iter(group), None) for group in flora.forms[0])
    group = _leaf_parts(flora, fine.leaves, row, trunk.length), _branch_parts(flora, fine.wood, row, trunk.length)
    parts = CrownParts.concatenate(group)
    return Crown(radius, height, polygons, base, float(leaves.mean()), float(wood.mean()), color, forms, parts)


def _even_parts(crown: Crown) -> CrownParts:
    """Leaves of one polygon each, evenly in a spheroid."""
    index, none = np.arange(_PARTS), np.zeros(_PARTS, np.int64)
    place = spiral(1.0 - (2.0 * index + 1.0) / _PARTS, index)
    place *= np.cbrt((index * GOLDEN_TURN) % 1.0)[:, None]
    half = (crown.height - crown.base) / 2.0
    place = place * (crown.radius, crown.radius, half) + (0.0, 0.0, crown.base + half)
    area = np.full(_PARTS, crown.leaves / max(crown.polygons, 1.0))
    number, size = np.full(_PARTS, crown.polygons / _PARTS), np.sqrt(area)
    return CrownParts(place, number, area, size, size, np.zeros(_PARTS), none, none, np.zeros(_PARTS), none)


def _samples(points: Points, row: int, lengths: Floats) -> tuple[Floats, Integers, Floats, Floats]:
    """Places (n, 3) of samples of upright trunks of lengths (k,), rows (n,), samples of each row (n,), leaves' ways."""
    # Few of large branches, which have most of the samples, so that there are as many of small ones.
    first, number = int(points.first[row, -1]), int(points.number[row, -1])
    rows = points.row[first : first + number]
    most = _PARTS // len(np.unique(rows))
    chosen = np.concatenate([np.flatnonzero(rows == one)[:most] for one in np.unique(rows)])
    rows, chosen = rows[chosen], first + chosen
    place, along = (of[chosen].astype(np.float64) for of in (points.position, points.frame[:, :, 1]))
    return np.resize(lengths, (len(chosen), 1)) * place, rows, np.bincount(rows)[rows].astype(np.float64), along


def _leaf_parts(flora: Flora, points: Points, row: int, lengths: Floats) -> CrownParts:
    if not flora.leaf_count[row] > 0:
        return CrownParts.empty()
    place, rows, like, along = _samples(points, row, lengths)
    totals, leaf = flora.averages, flora.leaf
    number, area = totals.leaves[row][rows], totals.leaf_area[row, 1][rows]
    area = area / np.maximum(number, 1e-300)
    width = np.sqrt(area / np.maximum(leaf.area[rows], 1e-300)) * leaf.width[rows]
    # The level of detail is that of the largest leaf of a branch.
    table = flora.rows[rows]
    size = table["leaf_size"].sum(axis=1) * np.maximum(table["leaf_size_tip"], 1.0)
    reach = _REACH * totals.length[rows] + envelope_reach(table) * totals.length[rows] + size
    none = np.zeros(len(rows), np.int64)
    place = place + 0.5 * size[:, None] * along  # the middle of the leaf
    form = table["leaf_kind"].astype(np.int64)
    return CrownParts(place, number / like, area, width, size, reach, none, none, none.astype(float), form)


def _branch_parts(flora: Flora, points: Points, row: int, lengths: Floats) -> CrownParts:
    place, rows, like, _ = _samples(points, row, lengths)
    length = float(lengths.mean())
    trunk_radius = float(flora.averages.radius[row]) * length / float(flora.averages.length[row])
    totals, bud = flora.averages, flora.species[0].bud
    sides, segments = flora.rows["sides"][rows].astype(np.int64), flora.rows["segments"][rows].astype(np.int64)
    number = (totals.fixed_faces + totals.full_faces)[row][rows] / (sides * (segments + flora.rows["rings"][rows]))
    leaves = totals.leaves[row][rows] / np.maximum(number, 1e-300)
    buds = np.zeros(len(rows)) if bud is None else np.where(leaves > 0.0, 1.0 + bud.lateral * leaves, 0.0)
    surface = (totals.fixed_wood + totals.full_wood)[row][rows] * length * trunk_radius + totals.spur_wood[row][rows]
    # They are larger than a typical one by as much as all have more surface.
    radius, along, surface = totals.radius[rows], totals.length[rows], surface / np.maximum(number, 1e-300)
    larger = np.sqrt(surface / np.maximum(np.diag(totals.fixed_wood)[rows] * radius * along, 1e-300))
    width, along, form = 2.0 * larger * radius, larger * along, np.full(len(rows), -1)
    return CrownParts(place, number / like, surface / 2.0, width, along, _REACH * along, sides, segments, buds, form)


_BATCH = 2_000
_BISECTIONS = 11
_CLOSE = 0.015  # factors that would change by less are found
_reaches: "WeakKeyDictionary[Flora, dict[int, TwigReach]]" = WeakKeyDictionary()


def measured(flora: Flora, seeds: Seeds) -> tuple[Floats, Floats]:
    """Heights of plants, to the highest leaf or wood, and means of the extents of their crowns to east and north.

    Returns
    -------
    height, width : (n,) float64
        Meters, about as plants are when all of them has grown.
    """
    height, width = np.zeros((2, len(seeds)))

    def work(plants: Integers) -> None:
        height[plants], width[plants], _ = _sizes(flora.in_leaf, seeds.take(plants))

    _by_kind(flora, seeds, work)
    return height, width


def fitted(flora: Flora, seeds: Seeds, height: Floats, width: Floats, times: int = 4) -> Floats:
    """Factors that give plants the heights and crown widths that were measured.

    Parameters
    ----------
    seeds : Seeds of n
    height, width : (n,) float64
        Meters.
    times : int
        How often plants are measured at most.

    Returns
    -------
    (n, 2) float64
        Factors on the scale, and on lengths of limbs (first column of crown shapes), within limits; heights are met.
    """
    out = np.ones((len(seeds), 2))

    def work(plants: Integers) -> None:
        batch, wanted, factor = seeds.take(plants), width[plants] / height[plants], np.ones(len(plants))
        crown = np.tile(PLAIN, (len(batch), 1)) if batch.crown is None else batch.crown
        most = np.where(are_stools(flora.rows, flora.first_row[batch.species]), MOST_LEANING, MOST[WIDTH])
        tall, left = np.ones(len(batch)), np.arange(len(batch))
        for _ in range(times):
            shaped = crown[left]
            shaped[:, WIDTH] *= factor[left]
            tall[left], _, outer_limbs = _sizes(flora.in_leaf, replace(batch.take(left), crown=shaped))
            if outer_limbs is None:
                break
            more = _solved(outer_limbs, wanted[left], LEAST[WIDTH] / shaped[:, WIDTH], most[left] / shaped[:, WIDTH])
            far = np.abs(more - 1) > _CLOSE  # plants that are close are left alone, whatever others need
            tall[left] = np.where(far, outer_limbs.sizes(more)[0], tall[left])
            factor[left] *= np.where(far, more, 1.0)
            left = left[far]
            if not len(left):
                break
        out[plants] = np.stack([height[plants] / tall, factor], axis=1)

    _by_kind(flora, seeds, work)
    return out


def _by_kind(flora: Flora, seeds: Seeds, work: Callable[[Integers], None]) -> None:
    """Do some work on some plants (k,) at a time, each kind apart, as kinds have more or fewer limbs."""
    order = np.argsort(seeds.species, kind="stable")
    kinds = np.split(order, np.flatnonzero(np.diff(seeds.species[order])) + 1)
    for plants in kinds:
        if len(plants):
            _beyond(flora.in_leaf, int(seeds.species[plants[0]]))
    each_on_all_cores(work, [plants[i : i + _BATCH] for plants in kinds for i in range(0, len(plants), _BATCH)])


def _beyond(flora: Flora, species: int) -> "TwigReach":
    known = _reaches.setdefault(flora, {})
    if species not in known:
        known[species] = beyond_limbs(flora.rows, int(flora.first_row[species]), species)
    return known[species]


def _sizes(flora: Flora, seeds: Seeds) -> "tuple[Floats, Floats, OuterLimbs | None]":
    """Heights and crown widths (n,), (n,) of plants of one species, and what reaches farthest, if they have limbs."""
    plants, beyond = trunks(flora.rows, seeds), _beyond(flora, int(seeds.species[0]))
    if beyond.whole[0] > 0:
        shaped = 1.0 if plants.crown is None else length_factors(flora.rows, plants.row, plants.crown)
        return beyond.whole[0] * (plants.length / shaped), beyond.whole[1] * (plants.length / shaped), None
    outer_limbs = outermost(flora.rows, plants, beyond)
    return *outer_limbs.sizes(), outer_limbs


def _solved(outer_limbs: "OuterLimbs", wanted: Floats, least: Floats, most: Floats) -> Floats:
    """Factors (n,) on limbs, between limits (n,), by which crown widths over heights become what is wanted (n,)."""
    low, high = least, np.maximum(most, least)
    for _ in range(_BISECTIONS):
        middle = np.sqrt(low * high)
        height, width = outer_limbs.sizes(middle)
        narrow = width < wanted * height
        low, high = np.where(narrow, middle, low), np.where(narrow, high, middle)
    return np.sqrt(low * high)


#: East, west, north, south and up.
DIRECTIONS = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
UP = 4
_LIKELY = (6, 6, 6, 6, 8)  # limbs that are grown for each of these
#: Plants, and limbs of these, that tell how far twigs and leaves reach; factors on the lengths of the limbs.
_KNOWN_PLANTS, _LONG, _HIGH, _FACTORS = 8, 27, 15, (0.6, 1.0, 1.7)
#: Of limbs that reach almost as far, that one wins whose twigs do: so many standard deviations more than on the mean.
_LUCK = 0.6
_ASIDE = 0.4  # part of the way that stems of shrubs reach to the sides which is not their own lean


@dataclass(frozen=True)
class TwigReach:
    """How far twigs and leaves of a species reach beyond its limbs."""

    #: side and up: meters at plant scale 1, and fraction of the limb's length.
    side: tuple[float, float] = (0.0, 0.0)
    up: tuple[float, float] = (0.0, 0.0)
    top: float = 0.0  # how far leaves of trunks and stems reach beyond these, meters at plant scale 1
    #: Height and crown width of plants without limbs, in lengths of their trunks; 0 where there are limbs.
    whole: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class OuterLimbs:
    """What reaches farthest on plants (n)."""

    plant: Integers32  # (m,): whose limb it is; in order
    #: root and limb, (5, m): how far limbs begin in each of `DIRECTIONS`, and how much farther they lead; meters.
    root: Floats
    limb: Floats
    stem: Mask  # (m,): whether they begin on stems beyond a fork, which lean more or less
    width: Floats  # (n,): factor on the lengths of limbs that plants have already

    def sizes(self, factor: Floats | None = None) -> tuple[Floats, Floats]:
        """Heights and crown widths (n,), (n,) if limbs were so many times (n,) as long, about; meters."""
        if factor is None:
            reach = self.root + self.limb
        else:
            lean = np.minimum(factor * self.width, 1.0) / np.minimum(self.width, 1.0)
            reach = factor[self.plant] * self.limb
            reach[:UP] += np.where(self.stem, lean[self.plant], 1.0) * self.root[:UP]
            reach[UP] += self.root[UP]
        far = np.maximum.reduceat(reach, np.flatnonzero(np.diff(self.plant, prepend=-1)), axis=1)
        return far[UP], far[:UP].sum(axis=0) / 2


def outermost(rows: Table, plants: Branches, beyond: TwigReach) -> OuterLimbs:
    """What reaches farthest on plants (n) of one species, trunks of which are given."""
    stems = _stems(rows, plants)
    chosen = _likely(rows, stems, len(plants))
    owner, root, limb, stem = [], [], [], []
    for (grown, lines), (counts, which, index) in zip(stems, chosen, strict=True):
        origin = plants.position[grown.plant]
        owner.append(grown.plant)
        reach = _farthest(lines, origin)
        reach[:, UP] += beyond.top * grown.scale
        root.append(reach)
        limb.append(np.zeros((len(grown), len(DIRECTIONS))))
        stem.append(rows["continues"][grown.row])
        limbs = chosen_children(rows, grown, lines, which, index, counts)
        if not len(limbs):
            continue
        origin, axis = plants.position[limbs.plant], axes(rows, limbs)
        begin = _in_ways(limbs.position - origin)
        leads = _farthest(axis, origin) - begin
        end = axis.knot(np.arange(len(limbs)), axis.segments) - limbs.position
        level = end[:, :2] / np.maximum(np.hypot(end[:, 0], end[:, 1]), 1e-9)[:, None]
        side, up = (a * limbs.scale + b * limbs.length for a, b in (beyond.side, beyond.up))
        leads[:, :UP] += np.maximum(level @ DIRECTIONS[:UP, :2].T, 0.0) * side[:, None]
        leads[:, UP] += up
        # Wider crowns of shrubs are stems that lean more, which bear as much to the sides as before.
        lean, part = are_stools(rows, grown.row[which]), np.array([_ASIDE] * UP + [1.0])
        begin[lean], leads[lean] = begin[lean] + part * leads[lean], (1 - part) * leads[lean]
        stem.append(rows["continues"][grown.row[which]])
        owner.append(limbs.plant)
        root.append(begin)
        limb.append(leads)
    width = np.ones(len(plants)) if plants.crown is None else plants.crown[:, WIDTH].astype(np.float64)
    plant, root, limb, stem = (np.concatenate(blocks) for blocks in (owner, root, limb, stem))
    order = np.argsort(plant, kind="stable")
    root, limb = (np.ascontiguousarray(blocks[order].T) for blocks in (root, limb))
    return OuterLimbs(plant[order], root, limb, stem[order], width)


def _stems(rows: Table, plants: Branches) -> list[tuple[Branches, Axes]]:
    """Trunks and the stems beyond their forks, a generation at a time, numbered by plant, with their axes."""
    out, grown = [], replace(plants, plant=np.arange(len(plants), dtype=np.int32))
    while len(grown):
        lines = axes(rows, grown)
        out.append((grown, lines))
        counts = branch_counts(rows, grown, FORK)
        owner, index = spread(counts)
        grown = chosen_children(rows, grown, lines, owner, index, counts, FORK)
    return out


def _farthest(lines: Axes, origin: Floats) -> Floats:
    """How far axes (n,) reach in each of `DIRECTIONS` (n, 5) from places (n, 3)."""
    return np.maximum(_in_ways(lines.knots.max(axis=1) - origin), _in_ways(lines.knots.min(axis=1) - origin))


def _in_ways(place: Floats) -> Floats:
    """Places (n, 3) along each of `DIRECTIONS` (n, 5)."""
    x, y, z = place.T
    return np.stack([x, -x, y, -y, z]).T


def _likely(rows: Table, stems: list[tuple[Branches, Axes]], n: int) -> list[tuple[Integers, Integers, Integers]]:
    """Limbs of stems that are likely to reach farthest: by generation counts, stems (m,) and limbs (m,) of these."""
    limbs = [_mean_tips(rows, *one) for one in stems]
    tree = np.concatenate([grown.plant[owner] for (grown, _), (_, owner, _, _) in zip(stems, limbs, strict=True)])
    tips = np.concatenate([tip for *_, tip in limbs])
    order = np.argsort(tree, kind="stable")
    number = np.bincount(tree, minlength=n)
    of, place = spread(number)
    most = int(number.max(initial=0))
    chosen = np.zeros((n, most), bool)
    if most > max(_LIKELY):
        for way, likely in enumerate(_LIKELY):
            padded = np.full((n, most), -np.inf, np.float32)
            padded[of, place] = tips[order, way]
            best = np.argpartition(padded, most - likely, axis=1)[:, most - likely :]
            np.put_along_axis(chosen, best, True, axis=1)
    else:
        chosen[:] = True
    kept = np.zeros(len(tree), bool)
    kept[order] = chosen[of, place]
    out, start = [], 0
    for counts, owner, index, _ in limbs:
        mine = np.flatnonzero(kept[start : start + len(owner)])
        out.append((counts, owner[mine], index[mine]))
        start += len(owner)
    return out


def _mean_tips(rows: Table, stems: Branches, lines: Axes) -> tuple[Integers, Integers, Integers, Floats32]:
    """Limbs of stems (n,), stems and numbers (m,) of all limbs, and about where they end (m, 5) in `DIRECTIONS`."""
    # As `growth.chosen_children` has it, but for what differs at random from limb to limb.
    counts = branch_counts(rows, stems)
    owner, index = spread(counts)
    row, child = stems.row, np.maximum(rows["next"][stems.row, LATERAL], 0)
    whorl = np.maximum(rows["whorl"][child], 1)[owner]
    crown = stems.crown
    base = np.zeros(len(stems)) if crown is None else crown[:, BASE]
    start = np.maximum(rows["start"][row, LATERAL, 0], bare_part(rows, row, base))
    part = (index // whorl + 0.5) / np.maximum(counts[owner] // whorl, 1)
    t, number, fading = start[owner] + (1 - start[owner]) * part, index, 1.0
    grown = living_nodes(rows, stems, LATERAL)
    if grown is not None:
        number, _, extra = grown.chosen(owner, index, whorl)
        place, among, fading = grown.places(owner, number // whorl, np.full(len(owner), 0.5), extra)
        on = grown.on[owner]
        least = whorl / np.maximum(counts, 1)[owner]  # the lowest may be anywhere in their node
        t, part = np.where(on, place, t), np.where(on, np.maximum(among, least), part)
    low, high = lateral_fractions(rows, row, base).T
    fraction = low[owner] + (high - low)[owner] * part
    angle = rows["angle"][child, 0][owner]
    angle = angle + (rows["angle_tip"][child][owner] - angle) * fraction
    turn = 2 * np.pi * uniform(stems.key, Draw.AZIMUTH)
    azimuth = turn[owner] + 2 * np.pi * (number % whorl) / whorl + number // whorl * rows["azimuth"][child, 0][owner]
    length = (stems.length * rows["nominal"][row] * rows["length"][child, 0])[owner]
    length = length * lengths(rows, row[owner], fraction) * fading
    if crown is not None:
        length /= length_factors(rows, row, crown)[owner]
        few = replace(Branches.empty(), row=row[owner], crown=crown[owner])
        lean, reach = child_factors(rows, few, azimuth, LATERAL)
        length, angle = length * reach, angle * lean
    sine, cosine = length * np.sin(angle), length * np.cos(angle)
    rise = lines.knot(np.arange(len(stems)), lines.segments) - stems.position
    c, s = sine * np.cos(azimuth), sine * np.sin(azimuth)
    tips = np.empty((len(owner), 3))
    for k in range(3):
        across, aside, upright = stems.frame[:, k].T
        tips[:, k] = stems.position[owner, k] + t * rise[owner, k]
        tips[:, k] += c * across[owner] + s * aside[owner] + cosine * upright[owner]
    return counts, owner, index, _in_ways(tips).astype(np.float32)


def beyond_limbs(rows: Table, first: int, species: int) -> TwigReach:
    """How far twigs and leaves of a species reach, whose trunk is row ``first``."""
    n, plants = _KNOWN_PLANTS, trunks(rows, Seeds.upright(_KNOWN_PLANTS, species))
    limbs, over = [], 0.0
    for grown, lines in [] if rows["phantom"][first] else _stems(rows, plants):
        owner, tip = _leaf_tips(rows, grown, lines)
        stem_top = lines.knots[:, :, 2].max(axis=1)
        highest = stem_top.copy()
        np.maximum.at(highest, owner, tip[:, 2])
        over = max(over, float((highest - stem_top).mean()))
        if (rows["next"][grown.row, LATERAL] >= 0).any():
            counts = branch_counts(rows, grown)
            owner, index = spread(counts)
            limbs.append(chosen_children(rows, grown, lines, owner, index, counts))
    limbs = Branches.concatenate(limbs)
    if not len(limbs):
        far = _all_extremes(rows, plants, np.broadcast_to(DIRECTIONS, (n, *DIRECTIONS.shape))) / plants.length[:, None]
        return TwigReach(whole=(float(far[:, UP].mean()), float(far[:, :UP].sum(axis=1).mean() / 2)))
    order = np.argsort(limbs.length, kind="stable")
    longest = np.flatnonzero(limbs.length[order] > 0.5 * limbs.length.max())
    side = order[longest[np.linspace(0, len(longest) - 1, _LONG).astype(np.int64)]]
    top = np.argsort(limbs.position[:, 2] + limbs.length * limbs.frame[:, 2, 2], kind="stable")
    high = top[np.linspace(len(top) - 1 - min(4 * n, len(top) - 1), len(top) - 1, _HIGH).astype(np.int64)]
    return TwigReach(_fitted(rows, limbs.take(side), False), _fitted(rows, limbs.take(high), True), over)


def _fitted(rows: Table, limbs: Branches, up: bool) -> tuple[float, float]:
    """How far what grows on limbs reaches beyond them, in the way that they lead or up: meters, and of their length."""
    factor = np.resize(_FACTORS, len(limbs))
    limbs = replace(limbs, length=limbs.length * factor, vigor=limbs.vigor * factor)
    lines, every = axes(rows, limbs), np.arange(len(limbs))
    end = lines.knot(every, lines.segments) - limbs.position
    way = end * [1.0, 1.0, 0.0] if not up else np.broadcast_to(DIRECTIONS[UP], end.shape)
    way = way / np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None]
    reach = np.einsum("nsi,ni->ns", lines.knots - limbs.position[:, None], way).max(axis=1)
    over = _all_extremes(rows, limbs, way[:, None])[:, 0] - reach
    terms = np.stack([np.ones(len(limbs)), limbs.length], axis=1)
    (meters, part), *_ = np.linalg.lstsq(terms, over, rcond=None)
    return float(meters), float(part + _LUCK * (over - terms @ [meters, part]).std() / limbs.length.mean())


def _leaf_tips(rows: Table, branches: Branches, lines: Axes) -> tuple[Integers, Floats]:
    """Branch (m,) and end (m, 3) of the leaves of branches."""
    counts = leaf_counts(rows, branches)
    owner, index = spread(counts)
    key = leaf_keys(branches, owner, index)
    t = leaf_places(rows, branches, owner, index, counts, key)
    leaves = place_leaves(rows, branches, lines, owner, index, key, t)
    frame = settled(rows, branches.row[owner], leaves.frame, leaves.light, leaves.sky)
    return owner, leaves.position + leaves.size[:, None] * frame[:, :, 1]


def _all_extremes(rows: Table, base: Branches, ways: Floats) -> Floats:
    """How far wood and leaves of sub-plants (n,) reach from their bases in directions (n, k, 3) of each."""
    out = np.zeros(ways.shape[:2])

    def meet(owner: Integers, place: Floats) -> None:
        np.maximum.at(out, owner, np.einsum("mi,mki->mk", place - base.position[owner], ways[owner]))

    grown = replace(base, plant=np.arange(len(base), dtype=np.int32))
    while len(grown):
        whole, _, grown, _ = open_branches(rows, grown)
        bodies, lines = whole.branches, whole.lines
        for s in range(lines.knots.shape[1]):
            meet(bodies.plant, lines.knots[:, s])
        owner, tip = _leaf_tips(rows, bodies, lines)
        meet(bodies.plant[owner], tip)
    return out
