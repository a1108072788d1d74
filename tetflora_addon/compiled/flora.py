# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of sub-plants before any is grown: bounds, mean areas, colors and orientation (paper, section 5).

Areas, counts and colors are expectations in closed form. Orientation and the places of leaves and wood within a
sub-plant are kept as a few hundred sample points, drawn by following random paths from the branch outwards.

Where the samples of given sub-plants are, how far these reach, and within which bounds they stay is what is known of
their rows, unless they have crown shapes. A form moves the place where a limb leaves the trunk up, and what is on the
limb away from there, as it does when plants grow. Where limbs are longer, more is on each: samples there stand for
more, but all together for as much as is expected.
"""

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Mask, Table, gathered
from ..errors import SpeciesError
from ..growth.crown_effects import LIGHT, MOST_LEANING, are_stools, bare_part, first_forks, length_factors, trunk_ratios
from ..growth.foliage import YOUTH, envelope_reach
from ..growth.growth import fullness
from ..growth.rows import FORK, LATERAL, build_rows, lengths
from ..growth.seasons import Season
from ..growth.seeds import BASE, WIDTH, Branches
from ..growth.wind import Wind, is_windy, widest_sway, windy_rows
from ..leaves.models import LeafModel
from ..species.ages import with_habit
from ..species.quality import with_quality
from ..species.species import LEAF_KINDS, Species
from .averages import Averages, DayTotals, RowLeaves, ShapedTotals, average, quadratic, row_leaves, totals_of_day
from .bounds import leaf_reaches, limb_reaches, sampled_bounds, unit_bounds, widest_radii
from .clumping import Clumping, fit_clumping
from .orientation import Orientation, face_planes, orientation_of
from .samples import LIMB, STEM, STEM_LIMB, Limbs, Points, Samples, Shares, draw_samples


def _in_summer(compute: "Callable[[Flora], Any]") -> Any:
    """A property of the flora in summer without wind that few scenes need, and that is found when first asked for."""
    name = compute.__name__
    return cached_property(lambda flora: compute(flora) if flora.in_leaf is flora else getattr(flora.in_leaf, name))


@dataclass(frozen=True, eq=False)
class Flora:
    """The compiled species of a scene; arrays have one entry for each row (species and order).

    Totals are those of a sub-plant where the crown's branches are longest (vigor 1); of what follows the length, a
    shorter one has the fraction that `growth.fullness` gives.
    """

    species: tuple[Species, ...]
    forms: tuple[tuple[tuple[LeafModel, ...], ...], ...]  # by species and kind of leaf
    rows: Table  # (r,) structured array: parameters, see `rows.ROW_DTYPE`
    first_row: Integers  # (species,): row of each species' trunk
    leaf: RowLeaves  # means over the forms of the leaf that each row's own branch bears
    #: (r, 3): radius, lowest and highest z of the sub-plant's axes for a branch of length 1, see `bounds.unit_bounds`.
    bound: Floats
    #: (r,): greatest distance of the sub-plant's wood from its axes, in radii of its base, see `bounds.widest_radii`.
    widest: Floats
    #: (r,): how far leaves and short shoots of the sub-plant stick out beyond its axes at plant scale 1, meters.
    leaf_reach: Floats
    leaf_width: Floats  # (r,): mean width of its leaves at plant scale 1, meters; 0 without leaves
    leaf_count: Floats  # (r,): expected number of the leaves of the sub-plant
    #: fixed_wood and full_wood, (r,): expected surface of the branches of the sub-plant divided by length × radius of
    #: its own branch: what every one has, and what follows its fullness.
    fixed_wood: Floats
    full_wood: Floats
    spur_wood: Floats  # (r,): surface of its short shoots, m² at plant scale 1; follows the fullness
    #: polygons, leaf_faces and fixed_faces, (r,): expected number of faces of the sub-plant, leaves and branches; those
    #: of the leaves; and those of the tubes that every one has.
    polygons: Floats
    leaf_faces: Floats
    fixed_faces: Floats
    wood_color: Floats  # (r, 3): area-weighted mean
    transmission: Floats  # (r,): fraction of scattered light that goes through the leaves of the sub-plant
    averages: Averages  # all expected totals by the row that contributes them
    area_nodes: Floats  # (r, 3): expected one-sided area of leaves at `averages.NODES`, m² at plant scale 1
    calm: Self | None = None  # the same without the wind that this one is in
    summer: Self | None = None  # the same in summer, where this one is on another day of the year
    day: DayTotals | None = None  # what the day leaves of leaves; with ``summer``

    @property
    def at_rest(self) -> Self:
        """The flora without wind: what is inside of sub-plants is known of plants that do not move."""
        return self.calm or self

    @property
    def in_leaf(self) -> Self:
        """The flora in summer without wind: what takes rays or samples to know is known of it."""
        return self.at_rest.summer or self.at_rest

    def in_year(self, season: Season) -> Self:
        """The flora on a day of the year, without wind; itself in summer where nothing differs on that day."""
        return _on_day(self.in_leaf, replace(season, snow=0.0))

    def in_wind(self, wind: Wind) -> Self:
        """The flora in a wind; bounds hold at all times. Without speed plants may still move as a whole."""
        if wind.speed == 0 and not wind.moving:
            return self.at_rest
        windy = _windy(self.at_rest, replace(wind, time=0.0))
        rows = windy.rows.copy()
        rows["air"]["time"] = wind.time
        return replace(windy, rows=rows)

    @cached_property
    def has_young(self) -> bool:
        """Whether any leaves at the ends of branches differ from others."""
        colored = (self.rows["leaf_color_young"] != self.rows["leaf_color"][:, 0]).any()
        return bool(colored or (self.rows["leaf_size_young"] != 1).any())

    @_in_summer
    def samples(self) -> Samples:
        """Points on the leaves and wood of sub-plants."""
        return self.samples_of(range(len(self.rows)), 1)[0]

    def samples_of(self, sampled: Container[int], *times: int) -> list[Samples]:
        """Samples of some rows alone, so many times as many each, of plants in summer."""
        totals = self.averages
        return draw_samples(self.rows, totals.leaf_area[:, 1], _wood_totals(totals), totals.length, sampled, *times)

    @_in_summer
    def of_several_kinds(self) -> Integers:
        """Species (k,) that bear leaves of several kinds, such as blossoms."""
        bearing = np.diagonal(self.averages.leaf_area[:, 1]) > 0
        pairs = np.unique(np.column_stack([self.rows["species"], self.rows["leaf_kind"]])[bearing], axis=0)
        return np.flatnonzero(np.bincount(pairs[:, 0]) > 1)

    @_in_summer
    def samples_by_kind(self) -> dict[int, Samples]:
        """Of these species, `samples` with leaves of one kind alone, by kind."""
        totals, sampled = self.averages, np.flatnonzero(np.isin(self.rows["species"], self.of_several_kinds))
        areas = ((kind, totals.leaf_area[:, 1] * (self.rows["leaf_kind"] == kind)) for kind in range(len(LEAF_KINDS)))
        given = _wood_totals(totals), totals.length, sampled, 1
        return {kind: draw_samples(self.rows, area, *given)[0] for kind, area in areas if area[sampled].any()}

    @_in_summer
    def sampled_bound(self) -> Floats:
        """`bounds.sampled_bounds` of all samples (r, 6); unit is the branch's length."""
        return sampled_bounds((self.samples.leaves, self.samples.wood), len(self.rows))

    @_in_summer
    def orientation(self) -> Orientation:
        """How the surfaces of sub-plants are turned."""
        totals = self.averages
        return orientation_of(self.rows, self.forms, totals.leaf_area[:, 1], _wood_totals(totals), totals.length)

    @_in_summer
    def clumping(self) -> Clumping:
        """How much lighter sub-plants are than even fogs of their area."""
        totals = self.averages
        wood = _wood_totals(totals) * (totals.length * totals.radius)[:, None]
        area = totals.leaf_area[:, 1] + wood / 2
        return fit_clumping(self.rows, self.forms, area, self.polygons, self.leaf_width, totals.length)

    @cached_property
    def face_planes(self) -> Floats:
        """Planes (r, k, 3, 3) of the faces of the leaves that branches bear, see `orientation.face_planes`."""
        return face_planes(self.rows, self.forms)

    @cached_property
    def raised_bound(self) -> Floats:
        """`bound` of plants with crown bases."""
        return unit_bounds(self.rows, raised=True)

    @cached_property
    def limb_reach(self) -> Floats:
        """How far anything is from where its limb leaves the trunk (r,), for trunks of length 1."""
        return limb_reaches(self.rows, self.bound)

    def species_of(self, row: Integers) -> Integers:
        """Index (n,) of the species that rows (n,) belong to."""
        return self.rows["species"][row]

    def leaf_areas(self, subplants: Branches, kind: int | None = None) -> Floats:
        """Expected one-sided area (n,) of the leaves of sub-plants, m²; on a day of the year of one kind, if told."""
        if subplants.year is None:
            area = self._at_place(self.area_nodes, subplants) * self._shaped_leaves(subplants)
        else:
            area = self.day.leaf_areas(subplants, self._shaped_leaves(subplants, kinds=True), kind)
        return fullness(self.rows, subplants) * area * subplants.scale**2

    def leaf_colors(self, subplants: Branches) -> Floats:
        """Mean linear RGB (n, 3) of the leaves of sub-plants, weighted by area; black where they have none."""
        if subplants.year is not None:
            return self.day.leaf_colors(subplants)
        area = self._at_place(self.area_nodes, subplants)
        return self._at_place(self.averages.leaf_color, subplants) / np.maximum(area, 1e-300)[:, None]

    def wood_areas(self, subplants: Branches) -> Floats:
        """Expected surface (n,) of the branches of sub-plants, m²."""
        row, full = subplants.row, fullness(self.rows, subplants, wood=True)
        relative, spurs = self.fixed_wood[row] + full * self.full_wood[row], full * self.spur_wood[row]
        shaped = self._shaped(subplants)
        if len(shaped):
            wood, short = self.shaped_totals.wood(subplants.take(shaped))
            relative[shaped] *= wood
            spurs[shaped] *= short
        return relative * subplants.length * subplants.radius + spurs * subplants.scale**2

    def face_counts(self, subplants: Branches) -> Floats:
        """Expected number (n,) of the faces of sub-plants, leaves and branches."""
        if subplants.year is None:
            leaves = self.leaf_faces[subplants.row] * self._shaped_leaves(subplants, faces=True)
        else:
            leaves = self.day.leaf_faces(subplants, self._shaped_leaves(subplants, faces=True, kinds=True))
        return self.branch_faces(subplants) + fullness(self.rows, subplants) * leaves

    def branch_faces(self, subplants: Branches) -> Floats:
        """Expected number (n,) of the faces of the branches of sub-plants."""
        fixed, wood = self.fixed_faces[subplants.row], (self.polygons - self.leaf_faces)[subplants.row]
        counts = fixed + fullness(self.rows, subplants, wood=True) * (wood - fixed)
        shaped = self._shaped(subplants)
        if len(shaped):
            counts[shaped] += (self.shaped_totals.faces(subplants.take(shaped)) - 1.0) * wood[shaped]
        return counts

    @_in_summer
    def shaped_totals(self) -> ShapedTotals:
        """What crown shapes change."""
        return ShapedTotals.of(self.rows, self.averages, self.leaf.polygons)

    def _shaped(self, subplants: Branches) -> Integers:
        """Sub-plants (k,) of (n,) whose totals crown shapes change."""
        if subplants.crown is None or not (self.rows["order"] == 0)[subplants.row].any():
            return np.zeros(0, np.intp)
        return np.flatnonzero(self.shaped_totals.shaped[subplants.row])

    def _shaped_leaves(self, subplants: Branches, faces: bool = False, kinds: bool = False) -> Floats | float:
        """`ShapedTotals.leaves` (n,) or (n, k) of sub-plants, 1 where nothing is formed."""
        shaped = self._shaped(subplants)
        if not len(shaped):
            return 1.0
        out = np.ones((len(subplants), len(LEAF_KINDS)) if kinds else len(subplants))
        out[shaped] = self.shaped_totals.leaves(subplants.take(shaped), faces, kinds)
        return out

    def one_leaf_area(self, branches: Branches, kind: int | None = None) -> Floats:
        """Mean one-sided area (n,) of a single leaf of sub-plants, m², likewise; 0 where they have none."""
        if branches.year is not None:
            area, count = self.day.leaf_areas(branches, kind=kind), self.day.leaf_counts(branches, kind)
        else:
            area, count = self._at_place(self.area_nodes, branches), self.leaf_count[branches.row]
        return area / np.maximum(count, 1e-300) * branches.scale**2

    def _at_place(self, nodes: Floats, subplants: Branches) -> Floats:
        """Values at the places of sub-plants between the inside and the outside of the crown."""
        return np.einsum("nk,nk...->n...", quadratic(subplants.outward), nodes[subplants.row])


def compile_species(species: Sequence[Species]) -> Flora:
    """Compile the species of a scene; the last few results are kept, by content.

    Raises
    ------
    SpeciesError
        A species whose leaf is still the name of a Blender object (the bridge to Blender has to replace it first).
    """
    return _compiled(tuple(with_quality(with_habit(one, one.habit), one.quality) for one in species))


@lru_cache(maxsize=8)
def _compiled(species: tuple[Species, ...]) -> Flora:
    for one in species:
        for kind in LEAF_KINDS:
            for form in one.forms(kind):
                if not isinstance(form, LeafModel):
                    raise SpeciesError(f'{one.identifier}: the {kind} object "{form}" was not replaced with a mesh')
    rows = build_rows(species)
    forms = tuple(tuple(one.forms(kind) for kind in LEAF_KINDS) for one in species)
    leaf = row_leaves(rows, forms, np.array([[one.leaf_transmission, one.blossom_transmission] for one in species]))
    totals = average(rows, leaf)
    bound = _with_drawn(rows, unit_bounds(rows))
    leaves, area = totals.leaves, totals.leaf_area[:, 1]
    wood = _wood_totals(totals)
    leaf_count, leaf_area = leaves.sum(axis=1), area.sum(axis=1)
    bare = rows["leaf_start"][:, 0]
    young = (1 - bare ** (YOUTH + 1)) / (1 - bare) / (YOUTH + 1)  # mean over the leaves of a branch
    smaller = 1 + (rows["leaf_size_young"] - 1) * young
    size = rows["leaf_size"][:, 0] * (1 + rows["leaf_size_tip"]) / 2 * smaller
    fixed, full = totals.fixed_faces.sum(axis=1), totals.full_faces.sum(axis=1)
    polygons = fixed + full + leaves @ leaf.polygons
    return Flora(
        species=tuple(species),
        forms=forms,
        rows=rows,
        first_row=np.flatnonzero(np.diff(rows["species"], prepend=-1)),
        leaf=leaf,
        bound=bound,
        widest=widest_radii(rows),
        leaf_reach=leaf_reaches(rows, bound, leaf.reach),
        leaf_width=leaves @ (size * leaf.width) / np.maximum(leaf_count, 1e-300),
        leaf_count=leaf_count,
        fixed_wood=totals.fixed_wood.sum(axis=1),
        full_wood=totals.full_wood.sum(axis=1),
        spur_wood=totals.spur_wood.sum(axis=1),
        polygons=polygons,
        leaf_faces=leaves @ leaf.polygons,
        fixed_faces=fixed,
        wood_color=wood @ rows["branch_color"][:, 0] / wood.sum(axis=1, keepdims=True),
        transmission=area @ leaf.transmission / np.maximum(leaf_area, 1e-300),
        averages=totals,
        area_nodes=totals.leaf_area.sum(axis=2),
    )


@lru_cache(maxsize=8)
def _on_day(flora: Flora, season: Season) -> Flora:
    """A flora in summer on a day of the year."""
    changes = totals_of_day(flora.rows, flora.species, season, flora.averages, flora.leaf)
    return flora if changes is None else replace(flora, rows=changes[0], summer=flora, day=changes[1])


@lru_cache(maxsize=8)
def _windy(flora: Flora, wind: Wind) -> Flora:
    """A flora at rest in a wind at one time."""
    totals = flora.averages
    rows = windy_rows(flora.rows, totals.length, totals.radius, wind)
    bound = _with_drawn(rows, unit_bounds(rows))
    reach = leaf_reaches(rows, bound, flora.leaf.reach)
    return replace(flora, rows=rows, bound=bound, widest=widest_radii(rows), leaf_reach=reach, calm=flora)


def _with_drawn(rows: Table, bound: Floats) -> Floats:
    """Bounds in which plants drawn by hand have theirs: the drawing, and what grows on it in any direction."""
    bound = bound.copy()
    for i in np.flatnonzero(rows["phantom"]):
        drawn = rows[slice(*rows["drawn_rows"][i])]
        child = drawn["next"][:, LATERAL]
        farthest = np.hypot(bound[child, 0], np.maximum(bound[child, 2], -bound[child, 1]))
        reach = np.where(child >= 0, drawn["size"][:, 0] * rows["length"][child].sum(axis=1) * farthest, 0.0)
        reach = np.maximum(reach, drawn["size"][:, 0] * envelope_reach(drawn))
        across, height = np.hypot(drawn["knots"][..., 0], drawn["knots"][..., 1]), drawn["knots"][..., 2]
        if is_windy(rows):  # no point moves farther than an arc that turns as its height does
            above = np.maximum(height.max(), 0.0)
            reach = reach + widest_sway(drawn[0]) * above * (above / 2 + across.max())
        low, high = (height - reach[:, None]).min(), (height + reach[:, None]).max()
        bound[i] = np.array([(across + reach[:, None]).max(), min(low, 0.0), max(high, 0.0)]) / rows["length"][i, 0]
    return bound


def _wood_totals(totals: Averages) -> Floats:
    """Expected surface (r, r) of branches of typical size by contributing row, over length × radius of the own one."""
    size = np.maximum(totals.length * totals.radius, 1e-300)
    return totals.fixed_wood + totals.full_wood + totals.spur_wood / size[:, None]


def shaped_subplants(rows: Table, subplants: Branches) -> Integers:
    """Sub-plants (k,) of (n,) that are trunks, or stems of these, with a crown shape other than the plain one."""
    crown = subplants.crown
    if crown is None:
        return np.zeros(0, np.intp)
    trunk = np.flatnonzero((rows["order"] == 0)[subplants.row])
    return trunk[(crown[trunk, WIDTH] != 1) | crown[trunk, BASE : LIGHT.stop].any(axis=1)]


def placed_samples(
    flora: Flora, points: Points, subplants: Branches, owner: Integers, pick: Integers, turn: Floats | None = None
) -> tuple[NDArray[np.floating], Floats | None]:
    """Samples of sub-plants: places in units of their lengths and in their axes, and what each stands for.

    Parameters
    ----------
    points : Points
        Leaves or wood of its samples.
    subplants : Branches of n
    owner, pick : (m,) int
        Sub-plants, and samples of these.
    turn : (m,) float64, optional
        By how much the axes of the sub-plant are turned about the third for each.

    Returns
    -------
    (m, 3) float
    (m,) float64 or None
        Area over that of other samples of the same sub-plant, 1 on the mean; None where all stand for as much.
    """
    place, rows = gathered(points.position, pick), flora.rows
    shaped = shaped_subplants(rows, subplants)
    if not len(shaped):
        return place, None
    place, share = place.astype(np.float64), np.ones(len(owner))
    number = np.full(len(subplants), -1)
    number[shaped] = np.arange(len(shaped))
    mine = np.flatnonzero(number[owner] >= 0)
    tree, which = subplants.take(shaped), number[owner[mine]]
    light = tree.crown[which][:, LIGHT].astype(np.float64)[:, :2]
    if turn is not None:
        c, s = np.cos(turn[mine]), np.sin(turn[mine])
        light = np.stack([c * light[:, 0] + s * light[:, 1], c * light[:, 1] - s * light[:, 0]], axis=1)
    moved, reach, sparse = _moved(rows, tree, points.limbs.take(pick[mine]), place[mine], which, light)
    place[mine] = moved / length_factors(rows, tree.row, tree.crown)[which, None]
    leafy = points is not flora.samples.wood
    share[mine] = _shares(flora, tree, points.shares, points.limbs.take(pick[mine]), which, reach, sparse, leafy)
    return place, share


def _moved(
    rows: Table, tree: Branches, on: Limbs, place: Floats, which: Integers, light: Floats
) -> tuple[Floats, Floats, Floats]:
    """Places (m, 3) of samples on limbs, ``which`` (m,) of sub-plants (n,), in lengths of those as described; how far
    limbs reach over what they do then (m,), more in the ``light`` (m, 2); and how many are left (n, 4) by class.
    """
    row, root = tree.row, np.where((on.kind >= LIMB)[:, None], on.root, place)
    crown = tree.crown.astype(np.float64)
    start = rows["start"][row, LATERAL, 0]
    bare = np.maximum(start, bare_part(rows, row, crown[:, BASE]))
    left = (1 - bare) / np.maximum(1 - start, 1e-9)
    below, above = trunk_ratios(crown[:, BASE], first_forks(rows, row))
    stretch = np.where(rows["continues"][row], above, below)
    stool, limb, stem = are_stools(rows, row)[which], on.kind >= LIMB, (on.kind == STEM) | (on.kind == STEM_LIMB)

    def reach(way: Floats) -> Floats:
        level = way[:, :2] / np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)[:, None]
        return crown[which, WIDTH] * (1 + level[:, 0] * light[:, 0] + level[:, 1] * light[:, 1])

    height = root[:, 2]
    higher = 1 - (1 - height) * left[which]
    lower = height * (bare / np.maximum(start, 1e-9))[which]  # dead branches
    begins = start[which]
    moved = root.copy()
    moved[:, 2] = np.where(limb & ~stool & ~stem, np.where(height >= begins, higher, np.minimum(lower, higher)), height)
    described = moved
    moved = moved * stretch[which, None]
    fork = np.array([0.0, 0.0, 1.0])  # about where the stems begin
    stems = above[which, None] * _tilted(root - fork, np.minimum(reach(root - fork), 1.0)) + stretch[which, None] * fork
    moved = np.where(stem[:, None], stems, moved)
    way = place - root
    longer = np.where(limb & ~stool, reach(way), 1.0)
    along_limb = longer * np.where(limb, _other_lengths(rows, tree, which, root, described[:, 2], stem), 1.0)
    leaning = np.sqrt(np.minimum(reach(way), MOST_LEANING))  # half of what is aside is on stems that lean
    moved += np.where(stool[:, None], _tilted(way, leaning), along_limb[:, None] * way)
    # Trunks and stems are longer or shorter themselves, limbs are fewer.
    return moved, longer, np.stack([stretch, above, np.where(rows["continues"][row], above, left), above], axis=1)


def _other_lengths(
    rows: Table, tree: Branches, which: Integers, root: Floats, height: Floats, stem: Mask
) -> Floats | float:
    """Factors (m,) on limbs' lengths as these, at ``root`` (m, 3), are at another ``height`` (m,) or on a ``stem``."""
    if not ((rows["next"][tree.row, FORK] >= 0) | rows["continues"][tree.row]).any():
        return 1.0
    first = np.flatnonzero(np.diff(rows["species"], prepend=-1))[rows["species"][tree.row]]
    start = rows["start"][first, LATERAL, 0] * first_forks(rows, tree.row)
    base = np.maximum(start, np.minimum(tree.crown[:, BASE], first_forks(rows, tree.row)))
    low, high = rows["part"][tree.row].T[:, which]
    above = np.linalg.norm(root - [0.0, 0.0, 1.0], axis=1) * (high - low) / np.maximum(1 - high, 1e-9)
    above = high + (1 - high) * np.minimum(above, 1.0)
    ratio = []
    for place, begin in ((height, base[which]), (root[:, 2], start[which])):
        place = np.where(stem, above, low + (high - low) * np.clip(place, 0.0, 1.0))
        fraction = np.clip((place - begin) / np.maximum(1 - begin, 1e-9), 0.0, 1.0)
        ratio.append(np.maximum(lengths(rows, tree.row[which], fraction), 0.1))
    return np.clip(ratio[0] / ratio[1], 0.5, 2.0)


def _tilted(way: Floats, factor: Floats) -> Floats:
    """Vectors (m, 3) of the same lengths whose level parts are so many times (m,) as long, as far as they can be."""
    level = way[:, :2] * factor[:, None]
    rest = (way**2).sum(axis=1) - (level**2).sum(axis=1)
    upright = np.sign(way[:, 2]) * np.sqrt(np.maximum(rest, 0.09 * way[:, 2] ** 2))
    return np.concatenate([level, upright[:, None]], axis=1)


def _shares(
    flora: Flora, tree: Branches, shares: Shares, on: Limbs, which: Integers, reach: Floats, sparse: Floats, leafy: bool
) -> Floats:
    """What samples (m,) stand for, 1 on the mean; see `_moved`."""
    totals, crown = flora.shaped_totals, tree.crown.astype(np.float64)
    ratio = np.where(totals.shaped[tree.row], totals.leaves(tree) if leafy else totals.wood(tree)[0], 1.0)
    follows, width = shares.follows[tree.row], crown[:, WIDTH]
    bears = 1 - follows + follows * width
    if leafy:
        sparse = sparse.copy()
        sparse[:, :LIMB] = 1.0
    else:
        ratio = ratio * length_factors(flora.rows, tree.row, tree.crown)
        square = 1 + (crown[:, LIGHT][:, :2] ** 2).sum(axis=1) / 2
        bears = width * (1 - follows) + width**2 * square * follows
    each = shares.kinds[tree.row] * sparse
    trunk, limbs = each[:, :LIMB].sum(axis=1), each[:, LIMB:].sum(axis=1) * bears
    # How many limbs there are is known exactly, by the sum that is expected.
    more = np.maximum(ratio - trunk, 0.0) / np.maximum(limbs, 1e-9)
    many = np.where(np.arange(4) < LIMB, 1.0, more[:, None]) * sparse / np.maximum(ratio, 1e-9)[:, None]
    bearing = 1 - on.follows + on.follows * reach
    bearing = np.where(on.kind < LIMB, 1.0, bearing if leafy else bearing * reach)
    return np.where(are_stools(flora.rows, tree.row)[which], 1.0, many[which, on.kind] * bearing)


def extents(flora: Flora, subplants: Branches, farthest: bool = True) -> Floats:
    """Radius, lowest and highest place (n, 3) that hold the samples of sub-plants, in units of their lengths.

    Without ``farthest``, the radius of crowns that lean is about the mean of all sides.
    """
    bound = flora.sampled_bound[subplants.row]
    shaped = shaped_subplants(flora.rows, subplants)
    if len(shaped):
        tree, rows = subplants.take(shaped), flora.rows
        crown, stool = tree.crown.astype(np.float64), are_stools(rows, tree.row)
        stretch = length_factors(rows, tree.row, tree.crown)
        lean = np.hypot(*crown[:, LIGHT].T[:2]) if farthest else 0.0
        reach = crown[:, WIDTH] * (1 + lean)
        reach = np.where(stool, np.sqrt(np.minimum(reach, MOST_LEANING)), reach)
        radius, low, high, root, down, up = bound[shaped].T
        start = rows["start"][tree.row, LATERAL, 0]
        left = (1 - np.maximum(start, bare_part(rows, tree.row, crown[:, BASE]))) / np.maximum(1 - start, 1e-9)
        longer = np.where(stool, 0.0, np.maximum(reach - 1, 0.0))
        top = high + longer * up
        top += (1 - left) * np.maximum(1 + reach * up - top, 0.0) + np.maximum(stretch - 1, 0.0)
        top = np.where(stool & (reach < 1), np.hypot(radius, high), top)
        radius = reach * radius + np.where(farthest, np.abs(reach - 1) * root, 0.0)
        bound[shaped, :3] = np.stack([radius, low + longer * down, top], axis=1) / stretch[:, None]
    return bound[:, :3]


def outlines(flora: Flora, plants: Branches, low: Floats, high: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """About how the crowns of plants (n,) differ from those of their species, whose ends are at heights (n,), (n,).

    Returns
    -------
    length : (n,) float64
        Unit of heights and widths of the species, meters.
    low : (n,) float64
        Where the crown begins, in such units.
    width : (n,) float64
        Factor on its width.
    light : (n, 2) float64
        By how much it reaches farther along the first two of the plant's axes.
    """
    if plants.crown is None:
        return plants.length, low, np.ones(len(plants)), np.zeros((len(plants), 2))
    rows, crown = flora.rows, plants.crown.astype(np.float64)
    start = rows["start"][plants.row, LATERAL, 0] * first_forks(rows, plants.row)
    left = np.minimum((1 - crown[:, BASE]) / (1 - start), 1.0)
    length = plants.length / length_factors(rows, plants.row, plants.crown)
    return length, high - (high - low) * left, crown[:, WIDTH], crown[:, LIGHT][:, :2]


def bounds(flora: Flora, subplants: Branches) -> tuple[Floats, Floats]:
    """Bounds of sub-plants (n, 3) as `Flora.bound`, and how far (n,) these may reach beyond that; meters."""
    bound = flora.bound[subplants.row] * subplants.length[:, None]
    out = subplants.radius * flora.widest[subplants.row] + flora.leaf_reach[subplants.row] * subplants.scale
    shaped = shaped_subplants(flora.rows, subplants)
    if len(shaped):
        tree, rows = subplants.take(shaped), flora.rows
        crown = tree.crown.astype(np.float64)
        raised = crown[:, BASE] > 0
        bound[shaped[raised]] = flora.raised_bound[tree.row[raised]] * tree.length[raised, None]
        stretch = length_factors(rows, tree.row, tree.crown)
        longer = crown[:, WIDTH] * (1 + np.linalg.norm(crown[:, LIGHT], axis=1))
        longer = np.where(are_stools(rows, tree.row), np.minimum(longer, MOST_LEANING), longer)
        # Nothing on a limb moves farther than that is longer, and forks move as far as the trunk is to them.
        reach = flora.limb_reach[tree.row] * np.maximum(longer - 1, 0.0)
        out[shaped] += (reach + 3 * np.abs(stretch - 1)) * tree.length / stretch
        bound[shaped] /= stretch[:, None]
    return bound, out
