# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Microsurfaces: few facets that stand for the many surfaces of what is not made explicit (paper, sections 1 and 7).

Each facet takes its place, orientation and color from a leaf or branch that the compiled species expects in the
sub-plant, or from a sample on the faces of an asset. Facets are about a pixel large; mean area and orientation stay.

Each lies in a plane of the faces of leaves, drawn in proportion to their areas: a folded leaf shows less to the sky
than a flat one, and a spray of needles has no plane. With leaves' own axes beeches were a quarter too bright.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import GOLDEN_ANGLE, Arrays, Floats, Integers, Keys, gathered, perpendicular, products, spread, unit
from ..assets.asset import COUNTS
from ..compiled.flora import Flora, placed_samples
from ..compiled.samples import Points
from ..growth.axes import axes
from ..growth.foliage import Leaves, leaf_start, outwardness, place_leaves, settled, youth
from ..growth.growth import WholeBranches
from ..growth.hashing import Draw, child_key, mix, signed, uniform
from ..growth.seasons import AREA, PRESENT, leaf_colors_at, leaf_stages, mean_leaf_colors
from ..growth.seeds import Branches
from ..growth.wind import moment
from ..optics import GLOSS, cluster_color, recollision_albedo
from ..refinement.contents import Totals, piece_leaves
from ..refinement.shared_parts import AssetParts, PlacedAssets
from ..subplants.pieces import Pieces, Thin, wood_areas
from .hotspots import LightRatios

# Where child indices of facets of leaves and of wood start, and draws. None may coincide, or facets bunch up.
_PATHS = {True: (1 << 40, 201), False: (1 << 41, 202)}
_TURN, _START, _PLACE = 203, 204, 205
_MOVE = 211  # three draws from here on
_FACE = 214
_GOLDEN = (np.sqrt(5) - 1) / 2
_MOVED = 0.04  # of the length of a sub-plant's branch
_SKY = np.array([0.0, 0.0, 1.0])
#: Length of facets of wood over that of equilateral triangles of their area: a facet of a pixel is four long.
STRETCH = 3.0
#: Reaches by which facets beside the view are moved at most, and the least squared slope of the way out that counts.
_MOST_MOVED, _LEAST_SLOPE = 3.0, 0.25
SIN_60 = np.sqrt(3) / 2
#: Distance of the corners of an equilateral triangle of area 1 from its middle.
CIRCUMRADIUS = 2 / 27**0.25


@dataclass(frozen=True)
class Facets(Arrays):
    """Triangles as a structure of arrays, with two sides of equal length."""

    center: Floats  # (n, 3)
    #: across and along, (n, 3): unit vectors in the facet's plane.
    across: Floats
    along: Floats
    side: Floats  # (n,): root of the area, meters
    color: Floats  # (n, 3)
    transmission: Floats  # (n,)
    velocity: Floats | None = None  # (n, 3): meters a second; None for plants at rest
    roughness: Floats | None = None  # (n,): of the gloss of assets; None where the material knows
    #: (n,): length along ``along`` over that of an equilateral triangle of the same area; None for 1.
    stretch: Floats | None = None
    dull: Floats | None = None  # (n,): part of the gloss of leaves that these hide from each other, 0 to 1; None for 0

    @property
    def normal(self) -> Floats:
        """Unit vectors (n, 3) that facets are perpendicular to."""
        return np.cross(self.across, self.along)


#: Whole branches, and that (n,) of each piece.
Bearers = tuple[WholeBranches, Integers]


@dataclass(frozen=True)
class FacetRules(Arrays):
    """How facets of things (n) are made: sub-plants, or pieces of branches."""

    leaf: Floats  # (n,): side of a facet for leaves, meters; facets for leaves are never smaller than the leaves
    wood: Floats | None = None  # (n,): the same for wood; None where it is the same
    weight: Floats | None = None  # (n,): fraction of their area that facets get, see `facet_weights`; None for all
    #: (n,): fraction of each, of pieces that of their leaves, drawn as it is; so many facets are left out at random.
    explicit: Floats | None = None
    lit: LightRatios | None = None  # of n
    thin: Thin | None = None

    @property
    def wood_side(self) -> Floats:
        """`wood`, known."""
        return self.leaf if self.wood is None else self.wood

    def weights(self, owner: Integers) -> Floats:
        """`weight` of some (m,), known."""
        return np.ones(len(owner)) if self.weight is None else self.weight[owner]


@dataclass(frozen=True)
class FacetSites(Arrays):
    """Facets (m) to be made of things, and what is known of each so far; the rest is None."""

    owner: Integers  # (m,): thing that each is of
    index: Integers  # (m,): its number there
    key: Keys  # (m,)
    area: Floats  # (m,): m²
    row: Integers | None = None  # (m,): of the branch that bears it
    center: Floats | None = None  # (m, 3): meters
    frame: Floats | None = None  # (m, 3, 3): axes of its leaf, or of the sub-plant
    sample: Integers | None = None  # (m,): that it lies at
    t: Floats | None = None  # (m,): place along the branch that bears it, 0 to 1
    leaves: Leaves | None = None  # of m

    def thinned(self, thin: Thin | None, longer: float = 1.0) -> Self:
        """Those that are worth making, which stand for the others, if facets are so many times as long."""
        if thin is None:
            return self
        kept, times = thin(self.key, self.center, longer * CIRCUMRADIUS * np.sqrt(self.area))
        sites = self.take(kept)
        return replace(sites, area=times * sites.area)


def subplant_facets(flora: Flora, subplants: Branches, rules: FacetRules) -> Facets:
    """Facets of sub-plants (n), by rules of n."""
    leaves, wood = _leaves_of_subplants(flora, subplants, rules), _wood_of_subplants(flora, subplants, rules)
    facets = Facets.concatenate([leaves, wood])
    return facets.take(facets.side > 0)


def piece_facets(flora: Flora, pieces: Pieces, rules: FacetRules, whole: Bearers | None = None) -> Facets:
    """Facets of pieces (n) of branches, by rules of n; of leaves alone where whole branches are given, and drawn."""
    leaves = _leaves_of_pieces(flora, pieces, rules, whole)
    return leaves if whole is not None else Facets.concatenate([leaves, _wood_of_pieces(flora, pieces, rules)])


def pushed_outside_view(facets: Facets, distance_to_view: Callable[[NDArray], NDArray]) -> Facets:
    """Facets that are out of view, moved away from it where they would reach into it, so that they keep their area.

    Long ones are shorter and wider there. Where there is no room beside it, they are shrunk, or left out.
    ``distance_to_view`` gives the distance (n,) of points (n, 3) from the view in meters.
    """
    reach, center = CIRCUMRADIUS * facets.side, facets.center
    away = distance_to_view(center)
    if facets.stretch is not None:
        facets = replace(facets, stretch=np.clip(away / np.maximum(reach, 1e-12), 1.0, np.maximum(facets.stretch, 1.0)))
    short = reach - away
    moved = np.flatnonzero((short > 0.0) & (short < _MOST_MOVED * reach))
    if len(moved):
        here, step = center[moved], 0.1 * reach[moved, None]
        slope = [distance_to_view(here + step * axis) - distance_to_view(here) for axis in np.eye(3)]
        slope = np.stack(slope, axis=1) / step
        steep = np.maximum(np.einsum("ni,ni->n", slope, slope), _LEAST_SLOPE)
        center = center.copy()
        center[moved] += (short[moved] / steep)[:, None] * slope
    fraction = np.clip(distance_to_view(center) / np.maximum(reach, 1e-12), 0.0, 1.0)
    return replace(facets, center=center, side=facets.side * fraction).take(np.flatnonzero(fraction > 0.0))


def facet_sites(key: Keys, area: Floats, facet: Floats, path: int, draw: int, real: Floats | None = None) -> FacetSites:
    """Facets that areas (n,) are cut into, by the area (n,) of one; their expected number is area / facet.

    From 1 on they divide the area evenly; below, one stands for several sub-plants. The real fraction (n,) gets none.
    """
    expected = area / np.maximum(facet, 1e-300)  # leafless plants have no size of leaves
    counts = np.floor(expected + uniform(key, draw)).astype(np.int64)
    owner, index = spread(counts)
    one = facet * np.where(expected >= 1.0, expected / np.maximum(counts, 1), 1.0)
    every = FacetSites(owner, index, child_key(key[owner], index + path), one[owner])
    if real is None or not real.any():
        return every
    return every.take(np.flatnonzero(uniform(every.key, Draw.TRANSITION) >= real[owner]))


def _in_a_face(flora: Flora, row: NDArray, key: Keys, frame: NDArray) -> tuple[NDArray, NDArray]:
    """Two axes (n, 3), (n, 3) in a face of leaves with axes (n, 3, 3) that branches of the rows (n,) bear."""
    planes = flora.face_planes
    number = row * planes.shape[1] + (uniform(key, _FACE) * planes.shape[1]).astype(np.int64)
    # By component, see `products`.
    x, y, z = np.moveaxis(frame, 2, 0)
    across, along = (
        sum(gathered(planes[:, :, k, axis].ravel(), number)[:, None] * v for k, v in enumerate((x, y, z)))
        for axis in (0, 1)
    )
    return across, along


def _at_samples(flora: Flora, points: Points, subplants: Branches, sites: FacetSites) -> FacetSites:
    """Facets of sub-plants at samples: their places, and the axes of the sub-plants.

    Runs of samples are spread over a sub-plant, and each starts its run elsewhere. Where there are more facets than
    samples, none may lie upon another: whole plants are turned about their trunk, which gives an equally likely plant;
    in others places are moved a little.
    """
    first, number = points.runs(subplants)
    owner, start = sites.owner, (uniform(subplants.key, _START) * number).astype(np.int64)
    pick = first[owner] + (start[owner] + sites.index) % number[owner]
    base = gathered(subplants.frame, owner)
    again = sites.index // number[owner]
    whole = ((flora.rows["order"] == 0) & ~flora.rows["phantom"])[subplants.row]
    turn = None if subplants.crown is None else again * whole[owner] * GOLDEN_ANGLE
    place, share = placed_samples(flora, points, subplants, owner, pick, turn)
    place = place.astype(np.float64)
    if again.any():
        _turned(base, again, np.flatnonzero((again > 0) & whole[owner]))
        moved = np.flatnonzero((again > 0) & ~whole[owner])
        place[moved] += _MOVED * np.stack([signed(sites.key[moved], _MOVE + axis) for axis in range(3)], axis=1)
    along = sum(base[:, :, k] * place[:, k, None] for k in range(3))
    place = gathered(subplants.position, owner) + subplants.length[owner, None] * along
    area = sites.area if share is None else sites.area * share
    return replace(sites, area=area, row=points.row[pick], center=place, frame=base, sample=pick)


def _turned(base: Floats, again: Integers, index: Integers) -> None:
    """Turn some of rotations (m, 3, 3) about their third axes, in place, by as many golden angles as numbers (m,)."""
    angle = again[index] * GOLDEN_ANGLE
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = base[index, :, 0], base[index, :, 1]
    base[index, :, 0], base[index, :, 1] = c * x + s * y, c * y - s * x


def _leaves_of_subplants(flora: Flora, subplants: Branches, rules: FacetRules) -> Facets:
    """Where species bear several kinds of leaves each has its own, as a day leaves another part of each."""
    several = np.isin(flora.species_of(subplants.row), flora.of_several_kinds)
    if subplants.year is None or not several.any():
        return _leaves_of_kind(flora, subplants, rules, flora.samples.leaves, None)
    kinds = [(None, flora.samples, ~several), *((kind, pool, several) for kind, pool in flora.samples_by_kind.items())]
    given = ((subplants.take(chosen), rules.take(chosen), pool.leaves, kind) for kind, pool, chosen in kinds)
    return Facets.concatenate([_leaves_of_kind(flora, *one) for one in given])


def _leaves_of_kind(flora: Flora, subplants: Branches, rules: FacetRules, points: Points, kind: int | None) -> Facets:
    rows, (path, draw) = flora.rows, _PATHS[True]
    one, all_ = flora.one_leaf_area(subplants, kind), flora.leaf_areas(subplants, kind)
    path += (kind or 0) << 32
    sites = facet_sites(subplants.key, all_, np.maximum(rules.leaf**2, one), path, draw, rules.explicit)
    sites = _at_samples(flora, points, subplants, sites)
    frame = products(sites.frame, gathered(points.frame, sites.sample).astype(np.float64))
    frame = settled(rows, sites.row, frame, points.light[sites.sample].astype(np.float64), _SKY)
    half_leaf = 0.5 * rows["leaf_size"][sites.row, 0] * subplants.scale[sites.owner]
    sites = replace(sites, center=sites.center + half_leaf[:, None] * frame[:, :, 1], frame=frame).thinned(rules.thin)
    owner = sites.owner
    # Sub-plants beyond the limbs know how far outside they are, which holds for all that grows on them.
    outward = np.where(rows["outward"][subplants.row[owner]], points.outward[sites.sample], subplants.outward[owner])
    facets = _leaf_facets(flora, subplants, sites, rules, one, (outward, points.young[sites.sample]))
    return replace(facets, velocity=_carried(flora, subplants, sites))


def _leaf_facets(
    flora: Flora, branches: Branches, sites: FacetSites, rules: FacetRules, one: Floats, places: tuple[Floats, Floats]
) -> Facets:
    """Facets at rest at sites (m) at leaves of branches (n).

    A leaf of these has an area ``one`` (n,), m²; ``places`` (m,) are those between inside and outside and on the shoot.
    """
    row, owner = sites.row, sites.owner
    across, along = _in_a_face(flora, row, sites.key, sites.frame)
    many = sites.area / one.clip(1e-300)[owner]
    weight, dull, lit = rules.weights(owner), flora.leaf.dull[row], rules.lit
    color = cluster_color(_leaf_colors(flora, branches, sites, many, *places), GLOSS * (1.0 - dull), weight)
    if lit is not None:
        color = lit.colors(color, owner, np.cross(across, along), many)
    # What is mirrored and meets another leaf is lost as such.
    left = np.minimum(weight if lit is None else weight * lit.hotspot[owner], 1.0)
    side, stretch = np.sqrt(sites.area * weight), np.ones(len(owner))
    look = color, flora.leaf.transmission[row]
    return Facets(sites.center, across, along, side, *look, stretch=stretch, dull=1.0 - left * (1.0 - dull))


def _leaves_of_pieces(flora: Flora, pieces: Pieces, rules: FacetRules, whole: Bearers | None) -> Facets:
    branches, rows = pieces.branches, flora.rows
    row = branches.row
    size, variation = rows["leaf_size"][row].T
    one = (size**2 + variation**2 / 3) * flora.leaf.area[row] * branches.scale**2
    if branches.year is not None:
        shown, number = flora.day.left(branches, rows["leaf_kind"][row], AREA, PRESENT)
        one = one * shown / np.maximum(number, 1e-300)
    facet, areas = np.maximum(rules.leaf**2, one), piece_leaves(flora, pieces)[1]
    sites = _along(flora, pieces, areas, facet, leaf_start(rows, branches), True, rules.explicit)
    if whole is None:
        bearers = np.flatnonzero(np.bincount(sites.owner, minlength=len(branches)))  # many pieces get no facet
        shoots, of = branches.take(bearers), np.searchsorted(bearers, sites.owner)
        lines = axes(rows, shoots)
    else:
        shoots, lines, of = whole[0].branches, whole[0].lines, whole[1][sites.owner]
    leaves = place_leaves(rows, shoots, lines, of, sites.index, sites.key, sites.t)
    frame = settled(rows, sites.row, leaves.frame, leaves.light, leaves.sky)
    center = leaves.position + 0.5 * leaves.size[:, None] * frame[:, :, 1]
    sites = replace(sites, center=center, frame=frame, leaves=leaves)
    sites = sites.thinned(None if rows["envelope"][row].any() else rules.thin)
    places, velocity = (outwardness(rows, branches, sites.owner, sites.t), youth(rows, sites.row, sites.t)), None
    if shoots.later is not None:
        later = place_leaves(rows, shoots.moved(), lines.later, sites.leaves.branch, sites.index, sites.key, sites.t)
        velocity = (later.position - sites.leaves.position) / moment(rows)
    return replace(_leaf_facets(flora, branches, sites, rules, one, places), velocity=velocity)


def _wood_of_subplants(flora: Flora, subplants: Branches, rules: FacetRules) -> Facets:
    points, wood = flora.samples.wood, flora.wood_areas(subplants) / 2
    sites = facet_sites(subplants.key, wood, rules.wood_side**2, *_PATHS[False], rules.explicit)
    sites = _at_samples(flora, points, subplants, sites).thinned(rules.thin, STRETCH)
    axis = np.einsum("nij,nj->ni", sites.frame, points.frame[sites.sample, :, 2].astype(np.float64))
    return _strips(flora, sites, rules, axis, _carried(flora, subplants, sites))


def _wood_of_pieces(flora: Flora, pieces: Pieces, rules: FacetRules) -> Facets:
    none, wood = np.zeros(len(pieces)), wood_areas(flora, pieces) / 2
    sites = _along(flora, pieces, wood, rules.wood_side**2, none, False, None)
    owner, t, velocity = sites.owner, sites.t, None
    part = (t - pieces.t0[owner]) / np.maximum(pieces.t1 - pieces.t0, 1e-12)[owner]
    span = (pieces.end - pieces.start)[owner]
    if pieces.branches.later is not None:
        lines = axes(flora.rows, pieces.branches)
        velocity = (lines.later.at(owner, t)[0] - lines.at(owner, t)[0]) / moment(flora.rows)
    sites = replace(sites, center=pieces.start[owner] + part[:, None] * span)
    return _strips(flora, sites, rules, unit(span), velocity)


def _strips(flora: Flora, sites: FacetSites, rules: FacetRules, axis: Floats, velocity: Floats | None) -> Facets:
    """Facets of wood: long and thin, as branches are, along axes (m, 3)."""
    stretch, none = np.full(len(axis), STRETCH), np.zeros(len(axis))
    # Turned about their axes at random, since closed tubes face all ways around.
    aside, turn = perpendicular(axis), 2 * np.pi * uniform(sites.key, _TURN)[:, None]
    across, weight = np.cos(turn) * aside + np.sin(turn) * np.cross(axis, aside), rules.weights(sites.owner)
    look = cluster_color(flora.rows["branch_color"][sites.row, 0], none, weight), none, velocity
    return Facets(sites.center, across, axis, np.sqrt(sites.area * weight), *look, stretch=stretch, dull=none)


def _carried(flora: Flora, subplants: Branches, sites: FacetSites) -> Floats | None:
    """Velocities (m, 3) of facets of sub-plants that move with their bases; None for plants at rest."""
    if subplants.later is None:
        return None
    owners = subplants.take(sites.owner)
    local = np.einsum("nji,nj->ni", owners.frame, sites.center - owners.position)
    later = owners.later.position + np.einsum("nij,nj->ni", owners.later.frame, local)
    return (later - sites.center) / moment(flora.rows)


def _along(
    flora: Flora, pieces: Pieces, area: Floats, facet: Floats, start: Floats, leafy: bool, explicit: Floats | None
) -> FacetSites:
    """Facets of pieces, and their places along the branch; see `facet_sites`.

    They are those of whole segments of branches, of which a piece has what lies on it: they do not depend on where a
    branch is cut. What they stand for begins at fractions ``start`` (n,) of the branches. Along a segment they follow
    the golden section and stay when others are added.
    """
    segments = flora.rows["segments"][pieces.branches.row]
    number = np.minimum(np.floor((pieces.t0 + pieces.t1) / 2 * segments), segments - 1)
    low, high = np.maximum(number / segments, start), (number + 1) / segments
    first = np.maximum(pieces.t0, start)
    length = np.maximum(pieces.t1 - first, 0.0)
    part = np.where(length > 0, np.maximum(high - low, length) / np.maximum(length, 1e-12), 0.0)
    numbered = mix(pieces.branches.key ^ (number.astype(np.uint64) + np.uint64(_PATHS[leafy][0])))
    sites = facet_sites(numbered, area * part, facet, *_PATHS[leafy], explicit)
    owner = sites.owner
    t = low[owner] + (high - low)[owner] * ((uniform(numbered, _PLACE)[owner] + sites.index * _GOLDEN) % 1.0)
    sites = replace(sites, t=t, row=pieces.branches.row[owner])
    return sites.take(np.flatnonzero((t >= first[owner]) & (t < pieces.t1[owner])))


def _leaf_colors(flora: Flora, branches: Branches, sites: FacetSites, leaves: Floats, *places: Floats) -> Floats:
    """Colors (m, 3) of facets that stand for several leaves (m,) of branches each: a mean varies less than one leaf."""
    several, row = np.sqrt(np.maximum(leaves, 1)), sites.row
    deviation = signed(sites.key, Draw.LEAF_COLOR) / several
    mean = mean_leaf_colors(flora.rows, row, *places)
    if branches.year is not None:
        summer, mean = mean, flora.day.own_colors(branches, flora.rows["leaf_kind"][row], mean, sites.owner)
        day, hue = (gathered(branches.year[:, i], sites.owner) for i in range(2))
        stages = leaf_stages(flora.rows, row, sites.key, day)
        one = leaf_colors_at(flora.rows, row, summer, stages, hue)
        mean = mean + np.where(stages.present, 1.0 / several, 0.0)[:, None] * (one - mean)
    return np.clip(mean + gathered(flora.rows["leaf_color"][:, 1], row) * deviation[:, None], 0, 1)


def by_number(table: NDArray[np.floating], row: Integers, count: Floats, counts: Floats) -> Floats:
    """Weights (n,) of rows (n,) of a table (r, k) for ``counts`` (k,) of facets, for numbers of facets (n,) between."""
    place = np.log(np.maximum(count, 1e-12) / counts[0]) / np.log(counts[1] / counts[0])
    place = np.clip(place, 0.0, len(counts) - 1.0)
    low = np.minimum(place.astype(np.int64), len(counts) - 2)
    return table[row, low] + (place - low) * (table[row, low + 1] - table[row, low])


#: As `_PATHS`, and draws of turns and places.
_ASSET_PATHS = {True: (1 << 42, 252), False: (1 << 43, 253)}
_ASSET_TURN, _ASSET_MOVE = 254, 255
#: Sides of a facet by which one is moved that has the sample of another.
_ASSET_MOVED = 1.5


def facet_totals(placed: PlacedAssets, parts: AssetParts) -> Totals:
    """Totals (n,) of clusters, with closed leaves as if they were sheets: half of each is never seen."""
    totals, closed_leaves = parts.totals, placed.closed_leaves(parts)
    return replace(totals, leaf_area=totals.leaf_area + closed_leaves / 2, wood_area=totals.wood_area - closed_leaves)


def asset_weights(placed: PlacedAssets, parts: AssetParts, number: Floats) -> Floats:
    """Fraction (n,) of their area that facets of clusters (n,) get, of which there are so many (n,) each."""
    return by_number(placed.assets.clusters.weights, parts.cluster, number, COUNTS)


def facets_of_assets(
    placed: PlacedAssets, parts: AssetParts, totals: Totals, leaf: Floats, wood: Floats, left_out: Floats | None = None
) -> Facets:
    """Facets of clusters (n,) with `facet_totals`, of sides for leaves and wood (n,), meters, less a part (n,)."""
    weight = asset_weights(placed, parts, totals.optical_area / np.maximum(leaf, 1e-12) ** 2)
    key, facets = placed.keys(parts), []
    for leafy, area, side in ((True, totals.leaf_area, leaf), (False, totals.wood_area / 2, wood)):
        sites = facet_sites(key, area, side**2, *_ASSET_PATHS[leafy], left_out)
        sample = placed.picked(parts, key, leafy, sites.owner, sites.index)
        facets.append(_placed(placed, parts, replace(sites, sample=sample), leafy, weight[sites.owner]))
    return Facets.concatenate(facets)


def _placed(placed: PlacedAssets, parts: AssetParts, sites: FacetSites, leafy: bool, weight: Floats) -> Facets:
    """Facets (m) of clusters: each at a sample, turned about its normal as may be."""
    samples, clusters = placed.assets.samples, placed.assets.clusters
    pick, key, instance = sites.sample, sites.key, parts.instance[sites.owner]
    center, side = placed.to_world(samples.position[pick], instance), np.sqrt(sites.area * weight)
    local = samples.normal[pick].astype(np.float64)
    linear, stretched = placed.instances.linear, placed.stretched[instance]
    normal = np.zeros_like(center)
    for i in range(3):
        for k in range(3):
            normal[:, i] += linear[instance, i, k] * local[:, k]
    if stretched.any():
        index = np.flatnonzero(stretched)
        normal[index] = np.einsum("nij,nj->ni", placed.cofactors(instance[index]), local[index])
        # Faces of one cluster grow by different factors, and so do their facets.
        owner, cluster = sites.owner[index], parts.cluster[sites.owner[index]]
        mean = parts.totals.area[owner] / (clusters.leaf_area[cluster] + clusters.wood_area[cluster])
        side[index] *= np.sqrt(np.linalg.norm(normal[index], axis=1) / mean)
    normal = unit(normal)
    across = perpendicular(normal)
    turn = 2 * np.pi * uniform(key, _ASSET_TURN)[:, None]
    across = np.cos(turn) * across + np.sin(turn) * np.cross(normal, across)
    along = np.cross(normal, across)
    # Where there are more facets than samples, none may lie upon another.
    number = (clusters.leaf_samples if leafy else clusters.wood_samples)[parts.cluster]
    again = np.flatnonzero(sites.index >= number[sites.owner])
    if len(again):
        for axis, by in ((across, _ASSET_MOVE), (along, _ASSET_MOVE + 1)):
            center[again] += (_ASSET_MOVED * side[again] * signed(key[again], by))[:, None] * axis[again]
    looks = samples.color, samples.transmission, samples.roughness
    color, through, rough = (of[pick].astype(np.float64) for of in looks)
    look = recollision_albedo(color, weight), through
    return Facets(center, across, along, side, *look, roughness=rough, dull=1.0 - np.clip(weight, 0.0, 1.0))
