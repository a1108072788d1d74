# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How wide and how tall plants of a species are, on average: for distances to plant at, and for estimates."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import GOLDEN_ANGLE, GOLDEN_TURN, Arrays, Floats, Integers, column, spiral
from ..growth.foliage import envelope_reach
from ..growth.growth import trunks
from ..growth.seeds import Seeds
from ..leaves.levels import level_errors
from ..leaves.models import LeafModel
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

_known: dict[Species, Crown] = {}


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

    def with_leaves(self, fraction: float) -> CrownParts:
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
    found = _known.get(species)
    if found is None:
        while len(_known) >= _MOST:
            _known.pop(next(iter(_known)), None)
        found = _known[species] = _crown_of(species)
    return found


def prepare(species: Species) -> None:
    """Find the mean crown of a species, and how finely its leaves may be drawn: what an estimate may have to wait for.

    Raises
    ------
    SpeciesError
        As `crown_of`.
    """
    for form in crown_of(species).forms:
        if form is not None:
            level_errors(form)


def _crown_of(species: Species) -> Crown:
    flora = compile_species([species])
    trunk = trunks(flora.rows, Seeds.upright(_PLANTS))
    row, length = int(trunk.row[0]), float(trunk.length.mean())
    points = flora.samples.leaves if flora.leaf_count[row] > 0 else flora.samples.wood
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
    forms = tuple(next(iter(own), None) for own in flora.forms[0])
    samples = flora.samples_of((row,), _FINER)
    own = _leaf_parts(flora, samples.leaves, row, trunk.length), _branch_parts(flora, samples.wood, row, trunk.length)
    parts = CrownParts.concatenate(own)
    return Crown(radius, height, polygons, base, float(leaves.mean()), float(wood.mean()), color, forms, parts)


def _even_parts(crown: Crown) -> CrownParts:
    """Leaves of one polygon each, evenly in a spheroid."""
    index, none = np.arange(_PARTS), np.zeros(_PARTS, np.int64)
    place = spiral(1.0 - (2.0 * index + 1.0) / _PARTS, index, GOLDEN_ANGLE)
    place *= np.cbrt((index * GOLDEN_TURN) % 1.0)[:, None]
    half = (crown.height - crown.base) / 2.0
    place = place * (crown.radius, crown.radius, half) + (0.0, 0.0, crown.base + half)
    area = np.full(_PARTS, crown.leaves / max(crown.polygons, 1.0))
    number, size = np.full(_PARTS, crown.polygons / _PARTS), np.sqrt(area)
    return CrownParts(place, number, area, size, size, np.zeros(_PARTS), none, none, np.zeros(_PARTS), none)


def _some(points: Points, row: int, lengths: Floats) -> tuple[Floats, Integers, Floats, Floats]:
    """Places (n, 3) of samples of upright trunks of lengths (k,), their rows (n,), of how many of its row (n,) each is
    one, and where leaves point (n, 3).

    Few of large branches, which have most of the samples, so that there are as many of small ones.
    """
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
    place, rows, like, along = _some(points, row, lengths)
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
    place, rows, like, _ = _some(points, row, lengths)
    length = float(lengths.mean())
    trunk_radius = float(flora.averages.radius[row]) * length / float(flora.averages.length[row])
    totals, bud = flora.averages, flora.species[0].bud
    sides, segments = flora.rows["sides"][rows].astype(np.int64), flora.rows["segments"][rows].astype(np.int64)
    faces = (totals.fixed_faces + totals.full_faces)[row][rows]
    number = faces / (sides * (segments + flora.rows["rings"][rows]))
    leaves = totals.leaves[row][rows] / np.maximum(number, 1e-300)
    buds = np.zeros(len(rows)) if bud is None else np.where(leaves > 0.0, 1.0 + bud.lateral * leaves, 0.0)
    surface = (totals.fixed_wood + totals.full_wood)[row][rows] * length * trunk_radius + totals.spur_wood[row][rows]
    # They are larger than a typical one by as much as all have more surface.
    radius, along, surface = totals.radius[rows], totals.length[rows], surface / np.maximum(number, 1e-300)
    larger = np.sqrt(surface / np.maximum(np.diag(totals.fixed_wood)[rows] * radius * along, 1e-300))
    width, along, form = 2.0 * larger * radius, larger * along, np.full(len(rows), -1)
    return CrownParts(place, number / like, surface / 2.0, width, along, _REACH * along, sides, segments, buds, form)
