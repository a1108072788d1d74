# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants as they are drawn: which leaves as themselves and how finely, parts of the frontier, and expanded plants.

A leaf whose width in pixels is below the limit is a facet, one that is wider by `decisions.BAND` is real; in between
a fraction of them is real that grows with the width. Real leaves and facets are thinned out by hashes of their own
keys: what has become real stays real as the camera comes closer, and the area is the same on average. Real leaves are
single kites first, those with many planes a kite for each then, and have their faces from a few pixels of width on.

Where these can be told from what they stand for, lengths in the image say the level of `leaves.levels`: the coarsest
whose margin is within a tolerance of the leaf's own, where leaves of a branch come nearest. Branches that the frontier
opens are tubes while they are macroscopic, and else one thin triangle each, with their direction and area.
"""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Self

import numpy as np

from ..arrays import Arrays, Floats, Integers, Mask, chunks, column, length
from ..buffers import BLOCK_POLYGONS, MeshBuffers
from ..camera.camera import Camera
from ..compiled.bounds import own_leaf_reaches
from ..compiled.flora import Flora, extents
from ..growth.axes import Axes, axes
from ..growth.foliage import envelope_reach
from ..growth.growth import WholeBranches, trunks
from ..growth.hashing import Draw, uniform
from ..growth.seeds import Branches, Seeds
from ..leaves.levels import coarse_error, leaf_kites
from ..leaves.models import LeafModel
from ..processes.pool import WORTH_PROCESSES, in_processes
from ..proxies.facet_weights import FacetWeights, leaf_shares
from ..proxies.hotspots import light_ratios
from ..proxies.microsurfaces import FacetRules, piece_facets, subplant_facets
from ..refinement.contents import PlantParts, as_pieces, piece_totals
from ..refinement.decisions import Decision, explicit_fraction
from ..refinement.lights import Light
from ..refinement.loop import Refinement
from ..refinement.shared_parts import SharedParts, SharePoints, opened
from ..species.species import LEAF_KINDS
from ..subplants.leaf_meshes import leaf_meshes
from ..subplants.pieces import Thin, expand, whole_pieces
from ..subplants.rings import Pixels
from ..subplants.tubes import tube_buffers, twig_buffers
from .coverage import Coverage, Footprints
from .frontier import Canvas, FrontierKind, Owned, Shown, Waiting, opaque_fractions

#: Pixels by which the margin of a leaf may be off.
TOLERANCE = 0.5
#: A leaf is no more than so many times as near as its branch, as far as this counts.
NEARER = 4.0


@dataclass(frozen=True)
class LeafDetail:
    """Lengths of leaves in the image."""

    flora: Flora
    camera: Camera
    tolerance: float = TOLERANCE  # pixels by which margins may be off; infinite for none but the models of the species
    beside: float = 0.0  # meters that a pixel spans at least at what is out of view, over the distance from the view

    @property
    def wood(self) -> Pixels | None:
        """How large pixels are at wood, that is as fine as leaves; None where it is coarse everywhere."""
        coarser, camera = self.tolerance / TOLERANCE, self.camera
        if not np.isfinite(coarser):
            return None
        slope = 0.0 if camera.kind == "ORTHO" else camera.pixel_size
        return Pixels(lambda points, reach: coarser * self._extent(points, reach), coarser * slope)

    def lengths(self, whole: WholeBranches) -> Floats:
        """Lengths (n,) of leaves of branches in tolerances, where they come nearest; 0 where models are fine enough."""
        branches, camera = whole.branches, self.camera
        out = np.zeros(len(branches))
        forms = ([f for kind in range(len(LEAF_KINDS)) for f in models[kind]] for models in self.flora.forms)
        errors = np.array([max((coarse_error(f) for f in models), default=0.0) for models in forms])
        most = 1.0 / np.maximum(errors[self.flora.rows["species"][branches.row]], 1e-300)
        size = self.flora.rows["leaf_size"][branches.row].sum(axis=1) * branches.scale
        for factor in ("leaf_size_tip", "leaf_size_young"):
            size = size * np.maximum(self.flora.rows[factor][branches.row], 1.0)
        beside = size + envelope_reach(self.flora.rows)[branches.row] * branches.length
        # The base tells of most branches that they are too far away.
        around = camera.extent_around(branches.position)
        pixels = size / self._nearest(around, branches.length + beside) / self.tolerance
        near = np.flatnonzero(pixels > most)
        if not len(near):
            return out
        knots = whole.lines.knots[near]
        reach = np.linalg.norm(np.diff(knots, axis=1), axis=2).max(axis=1) / 2.0 + beside[near]
        extent = self._extent(knots.reshape(-1, 3), np.repeat(reach, knots.shape[1])).reshape(len(near), -1).min(axis=1)
        out[near] = size[near] / np.maximum(self._nearest(extent, reach), extent / NEARER) / self.tolerance
        return out

    def _extent(self, points: Floats, reach: Floats | float) -> Floats:
        """Meters (n,) that a pixel spans at what reaches so far around points (n, 3), in view or not."""
        moments = self.camera, *self.camera.shutter
        away = np.min([moment.distance_to_view(points) for moment in moments], axis=0) - reach
        return np.maximum(self.camera.extent_around(points), self.beside * np.maximum(away, 0.0))

    def _nearest(self, extent: Floats, away: Floats) -> Floats:
        """Meters (n,) that a pixel spans at things up to a distance (n,) nearer than where it spans ``extent`` (n,)."""
        if self.camera.kind == "ORTHO":
            return extent
        return np.maximum(extent - self.camera.pixel_size * away, 1e-9)


#: Pixels from which on a part that lies in explicit tetrahedra in part is opened.
MIXED = 24.0
#: Width in pixels up to which real leaves are kites, and the same of those that are solid: a kite that shows as much on
#: average is half as wide again where it is seen from its front, and has one side, in the light or not.
KITES, SOLID_KITES = 2.0, 0.8
#: Squared width in pixels for each plane from which on leaves with many have a kite for each, as a spray of shoots: one
#: for all has the place and the side of none. As such up to two pixels, near spruces were too bright and coarse (2,442
#: blobs a megapixel, 2,129 so; ``benchmarks exact --cases edge --species birch,spruce --seeds 2``).
PLANE = 0.15
#: Meters that a pixel spans at least at leaves and wood out of view, over the distance from it: their shadows are seen.
BESIDE = 0.02


@dataclass(frozen=True)
class Transition:
    """Fractions of leaves that are real."""

    flora: Flora
    camera: Camera
    limit: float  # width in pixels up to which leaves are facets
    tolerance: float = TOLERANCE  # pixels by which margins of near leaves may be off

    @property
    def detail(self) -> LeafDetail:
        """How finely near leaves are drawn."""
        return LeafDetail(self.flora, self.camera, self.tolerance, BESIDE)

    def of_branches(self, branches: Branches) -> Floats:
        """Real fraction (n,) of the leaves of sub-plants: a smooth step in the logarithm of their width."""
        return self._fraction(branches, np.where(self.flora.leaf_count > 0, self.flora.leaf_width, 0.0), self.limit)

    def of_own_leaves(self, branches: Branches) -> Floats:
        """Real fraction (n,) of the leaves that branches themselves bear."""
        return self._fraction(branches, self._own_width, self.limit)

    def of_kites(self, branches: Branches) -> Iterator[Floats]:
        """Fractions (n,) of the real leaves of branches themselves that are single kites, and those or one a plane."""
        for widths in np.moveaxis(self.kite_widths, -1, 0):
            yield 1.0 - self._fraction(branches, self._own_width * KITES / widths, KITES)

    @cached_property
    def kite_widths(self) -> Floats:
        """Widths in pixels (r, 2) up to which the leaves of rows are kites, and have one for each plane."""
        limits = [[kite_widths(kinds) for kinds in one] for one in self.flora.forms]
        return np.array(limits)[self.flora.rows["species"], self.flora.rows["leaf_kind"]]

    @property
    def _own_width(self) -> Floats:
        """Width (r,) of the leaves that branches of rows bear, meters."""
        return self.flora.rows["leaf_size"][:, 0] * self.flora.leaf.width

    def _fraction(self, branches: Branches, widths: Floats, limit: float) -> Floats:
        width = widths[branches.row] * branches.scale
        return explicit_fraction(width / np.maximum(self.camera.extent_around(branches.position), 1e-300), limit)


def kite_widths(forms: Sequence[LeafModel]) -> tuple[float, float]:
    """Widths in pixels up to which leaves of one kind are kites, and have one for each plane."""
    if any(form.solid for form in forms):  # half of their surface is never seen
        return SOLID_KITES, SOLID_KITES
    planes = max((len(leaf_kites(form).share) for form in forms), default=1)
    return (min(KITES, float(np.sqrt(PLANE * planes))) if planes > 1 else KITES), KITES


@dataclass(frozen=True)
class Block:
    """One mesh of a block of space."""

    kind: str
    form: int  # which of the species' forms of leaves or blossoms
    species: int  # index into the flora's species
    number: int  # of the block, front to back
    buffers: MeshBuffers
    fraction: float  # fraction of all polygons that is done with this block


def inside_explicit(
    shared: SharedParts, result: Refinement, opening: Callable[[Arrays, Floats], Mask]
) -> tuple[Arrays, Floats]:
    """All parts (n) of one kind, opened where ``opening`` wants it, and the fraction (n,) in explicit tetrahedra."""
    explicit, shared = result.chosen(Decision.EXPLICIT), copy(shared)
    shared.hold(shared.parts, SharePoints.concatenate([shared.points]))  # those of the refinement stay as they are
    while True:
        parts, points = shared.parts, shared.points
        area = points.optical_area.astype(np.float64)
        whole = np.maximum(np.bincount(points.part, area, len(parts)), 1e-300)
        inside = np.bincount(points.part, area * explicit[points.cell], len(parts)) / whole
        again = (inside > 0.0) & shared.can_open(parts) & opening(parts, inside)
        if not again.any():
            return parts, inside
        shared.open(again, result.tree)


def explicit_blocks(flora: Flora, result: Refinement, camera: Camera, tolerance: float = np.inf) -> Iterator[Block]:
    """Polygons of all that lies in explicit tetrahedra for the most part, where shells stand for the rest.

    Parts that lie in explicit tetrahedra in part are opened; margins of near leaves may be off by a tolerance, pixels.
    """
    plants, runs = result.plants, []
    parts, inside = inside_explicit(plants, result, lambda rows, inside: (inside < 1.0) & (plants.pixels(rows) > MIXED))
    for alone in (False, True):
        branches = parts.branches.take(np.flatnonzero((inside >= 0.5) & (parts.branch_only == alone)))
        # Front to back, ties by the plants themselves, so that their order in the scene does not matter.
        branches = branches.take(np.lexsort([branches.key, np.linalg.norm(branches.position - camera.eye, axis=1)]))
        polygons = piece_totals(flora, as_pieces(branches)).polygons if alone else flora.face_counts(branches)
        runs += [(alone, branches.take(run)) for run in chunks(polygons, BLOCK_POLYGONS)]
    yield from _blocks(flora, LeafDetail(flora, camera, tolerance), runs, len(runs) > 1)


def expanded_blocks(flora: Flora, seeds: Seeds, camera: Camera | None = None) -> Iterator[Block]:
    """Polygons of all plants, seen or not; for comparison. A camera sees what is near as finely as everywhere."""
    plants = trunks(flora.rows, seeds)
    full = flora.polygons[plants.row] if plants.crown is None else flora.face_counts(plants)
    runs = [(False, plants.take(run)) for run in chunks(full, BLOCK_POLYGONS)]
    worth = len(runs) > 1 and float(full.sum()) > WORTH_PROCESSES
    yield from _blocks(flora, None if camera is None else LeafDetail(flora, camera), runs, worth)


def _blocks(flora: Flora, detail: LeafDetail | None, runs: list[tuple[bool, Branches]], worth: bool) -> Iterator[Block]:
    """The meshes of runs of branches, which are alone or with all that grows on them."""
    number = len(runs)
    items = ((n, (n + 1) / number, *runs.pop(0)) for n in range(number))
    for blocks in in_processes(_expanded, (flora, detail), items, worth):
        while blocks:
            yield blocks.pop(0)


def _expanded(given: tuple[Flora, LeafDetail | None], run: tuple[int, float, bool, Branches]) -> list[Block]:
    """The meshes of one run of whole sub-plants, or of branches alone."""
    (flora, detail), (number, fraction, alone, plants) = given, run
    whole = [WholeBranches(plants, axes(flora.rows, plants))] if alone else list(expand(flora, plants))
    species = [flora.species_of(group.branches.row) for group in whole]
    blocks: list[Block] = []
    for s in np.unique(np.concatenate([np.zeros(0, int), *species])).tolist():
        branches = [group.take(np.flatnonzero(kind == s)) for group, kind in zip(whole, species, strict=True)]
        for leaves in leaf_meshes(flora, s, branches, None, None if detail is None else detail.lengths):
            blocks.append(Block(LEAF_KINDS[leaves.kind], leaves.form, s, number, leaves.buffers, fraction))
        bark = tube_buffers(flora, branches, None if detail is None else detail.wood)
        if bark is not None:
            blocks.append(Block("bark", 0, s, number, bark, fraction))
    return blocks


#: Pixels from which on a branch that nothing else grows on has a line of its own; smaller ones are as straight.
LINES = 6.0
#: Width in pixels up to which wood is thin triangles; tubes take their place up to `decisions.BAND` times that. A flat
#: branch has one side for all of its length, bright or dark: with .8, twice as many pixels were off beside the truth.
TUBES = 0.25
#: Pixels that the axis of a branch may be off a straight line; ribbons follow those that bend more.
BENT = 0.5
#: Width in pixels from which on tubes have all of their sides, and how many they have below.
BROAD, SIDES = 4.0, 4
#: Fraction of a facet's area from which on each branch has a triangle; of smaller ones fewer have a wider one.
TWIG = 0.6
#: Draw of this module.
_THIN = 231


@dataclass(frozen=True)
class PlantRows(PlantParts):
    """Parts of plants (n) as the frontier has them: about straight lines."""

    #: start and end, (n, 3): of the line, meters.
    start: Floats = column(3)
    end: Floats = column(3)
    beside: Floats  # (n,): how far they reach from it, meters

    @classmethod
    def of(cls, flora: Flora, parts: PlantParts, lines: Axes | None = None) -> Self:
        """Parts (n,), of which the axes are known where they are branches alone that were opened just now.

        Sub-plants reach as far as samples of their leaves and wood.
        """
        branches, across = parts.branches, 0.5 * parts.extent
        low, high = np.zeros(len(parts)), branches.length
        if lines is None:
            whole, (wide, first, last) = ~parts.branch_only, extents(flora, branches).T * branches.length
            low, high = np.where(whole, np.minimum(first, 0.0), low), np.where(whole, last, high)
            across = np.where(whole, wide, across)
        ends = [branches.position + of[:, None] * branches.frame[:, :, 2] for of in (low, high)]
        if lines is not None:
            leaf = own_leaf_reaches(flora.rows, flora.leaf.reach)[branches.row] * branches.scale
            solid = flora.rows["envelope"][branches.row] > 0
            ends, across = [lines.knots[:, 0], lines.knots[:, -1]], np.where(solid, across, 0.0) + lines.bend() + leaf
        return cls(*(getattr(parts, each.name) for each in fields(PlantParts)), *ends, across + branches.radius)


@dataclass(frozen=True)
class GrownPlants(FrontierKind):
    """Sub-plants, and branches without what grows on them."""

    flora: Flora
    camera: Camera
    transition: Transition
    weights: FacetWeights
    lights: Sequence[Light]

    def coarser(self, times: float) -> Self:
        """As of `FrontierKind`."""
        limit, tolerance = times * self.transition.limit, times**2 * self.transition.tolerance
        return replace(self, transition=replace(self.transition, limit=limit, tolerance=tolerance))

    def spheres(self, parts: PlantRows) -> tuple[Floats, Floats]:
        """As of `FrontierKind`."""
        return 0.5 * (parts.start + parts.end), np.hypot(0.5 * length(parts.end - parts.start), parts.beside)

    def prints(self, coverage: Coverage, slab: Waiting) -> Footprints:
        """As of `FrontierKind`: most parts are long and thin."""
        return coverage.of_lines(slab.parts.start, slab.parts.end, slab.parts.beside, super().prints(coverage, slab))

    def optical(self, parts: PlantParts) -> Floats:
        """As of `FrontierKind`."""
        return parts.totals.optical_area

    def one_leaf(self, parts: PlantParts) -> Floats:
        """As of `FrontierKind`."""
        return self.flora.one_leaf_area(parts.branches)

    def enough(self, parts: PlantParts) -> Floats:
        """As of `FrontierKind`."""
        bound = extents(self.flora, parts.branches, farthest=False)
        silhouette = 2.0 * bound[:, 0] * (bound[:, 2] - bound[:, 1]) * parts.branches.length**2
        return np.where(parts.can_open(self.flora), opaque_fractions(silhouette, parts.totals.optical_area), 1.0)

    def can_open(self, parts: PlantParts) -> Mask:
        """As of `FrontierKind`."""
        return parts.can_open(self.flora)

    def opened(self, parts: PlantRows) -> tuple[PlantRows, Integers]:
        """As of `FrontierKind`."""
        children = [(PlantRows.of(self.flora, new, lines), of) for new, of, lines in opened(self.flora, parts)]
        owner = np.concatenate([np.zeros(0, np.int64), *(of for _, of in children)])
        return PlantRows.concatenate([new for new, _ in children]), owner

    def to_be_opened(self, parts: PlantParts) -> Mask:
        """Those of which leaves are real."""
        return self.transition.of_branches(parts.branches) > 0.0

    def draw(self, canvas: Canvas, slab: Waiting, side: Floats, _shown: list[Shown]) -> None:
        """As of `FrontierKind`."""
        parts, branches = slab.parts, slab.parts.branches
        extent = self.camera.extent_around(slab.center)
        lines = parts.branch_only | ~parts.can_open(self.flora)
        lines &= parts.branch_only | (2.0 * slab.radius > LINES * extent) | (self.transition.of_branches(branches) > 0)
        for s, every in self._by_species(branches):
            index = every[~lines[every]]
            if len(index):
                subplants = branches.take(index)
                rules = self._rules(subplants, side[index], False, thin=canvas.thin)
                canvas.add_facets((s, ""), subplant_facets(self.flora, subplants, rules))
        self._draw_branches(canvas, branches.take(np.flatnonzero(lines)), side[lines])

    def unseen(self, parts: PlantParts, side: Floats, kept: Floats, _shown: list[Shown]) -> Iterator[Owned]:
        """As of `FrontierKind`."""
        for s, every in self._by_species(parts.branches):
            for alone in (False, True):
                index = every[parts.branch_only[every] == alone]
                plants = parts.branches.take(index)
                if len(plants) and alone:
                    yield (s, ""), piece_facets(self.flora, as_pieces(plants), self._rules(plants, side[index], alone))
                elif len(plants):
                    rules = self._rules(plants, side[index], alone, 1.0 - kept[index])
                    yield (s, ""), subplant_facets(self.flora, plants, rules)

    def _by_species(self, branches: Branches) -> Iterator[tuple[int, Integers]]:
        """Each species that there is, and its branches (k,)."""
        species = self.flora.species_of(branches.row)
        for s in np.flatnonzero(np.bincount(species)).tolist():
            yield s, np.flatnonzero(species == s)

    def _rules(
        self, branches: Branches, side: Floats, alone: bool, explicit: Floats | None = None, thin: Thin | None = None
    ) -> FacetRules:
        """How facets of sides (n,), meters, are made of branches (n,) beside real leaves; ``thin`` is of seen ones."""
        flora = self.flora
        leaf = np.maximum(side, np.sqrt(flora.one_leaf_area(branches)))
        count = (flora.leaf_areas(branches) + flora.wood_areas(branches) / 2) / np.maximum(leaf, 1e-12) ** 2
        weights = self.weights.of_pieces if alone else self.weights.of_subplants
        lit = None if thin is None else light_ratios(flora, branches, leaf, self.camera, self.lights)
        return FacetRules(leaf, side, weights(branches.row, count, leaf_shares(flora, branches)), explicit, lit, thin)

    def _draw_branches(self, canvas: Canvas, branches: Branches, side: Floats) -> None:
        """Branches alone: leaves that are large are real, wood is tubes or thin triangles, the rest is facets."""
        if not len(branches):
            return
        flora, transition = self.flora, self.transition
        branches = replace(branches, plant=np.arange(len(branches), dtype=np.int32))
        whole, explicit = WholeBranches(branches, axes(flora.rows, branches)), transition.of_own_leaves(branches)
        pieces, owner = whole_pieces(flora.rows, whole)
        rules = self._rules(branches, side, True, explicit, canvas.thin)
        extent = np.maximum(transition.camera.extent_around(branches.position), 1e-300)
        wide = 2.0 * branches.radius / extent
        tubes = uniform(branches.key, Draw.TRANSITION) < explicit_fraction(wide, TUBES)
        thin, detail = wide < BROAD, transition.detail
        for s, every in self._by_species(branches):
            kin = np.zeros(len(branches), bool)
            kin[every] = True
            left = np.flatnonzero(kin[owner] & (explicit[owner] < 1.0))
            if len(left):
                of = owner[left]
                canvas.add_facets((s, ""), piece_facets(flora, pieces.take(left), rules.take(of), (whole, of)))
            bearers = whole.take(np.flatnonzero(kin & (explicit > 0.0)))
            given = lambda b: (explicit[b.plant], *transition.of_kites(b)), detail.lengths, canvas.thin
            for one in leaf_meshes(flora, s, [bearers], *given) if len(bearers) else ():
                canvas.add_mesh((LEAF_KINDS[one.kind], one.form, s), one.buffers, True)
            # What is a few pixels wide has few sides; of wider wood all is drawn, or its shading would end at holes.
            slender, broad = (whole.take(np.flatnonzero(kin & tubes & (thin == is_thin))) for is_thin in (True, False))
            canvas.add_mesh(("bark", 0, s), tube_buffers(flora, [slender], None, SIDES), True)
            canvas.add_mesh(("bark", 0, s), tube_buffers(flora, [broad], detail.wood))
            self._draw_twigs(canvas, s, whole.take(np.flatnonzero(kin & ~tubes)), side, extent)

    def _draw_twigs(self, canvas: Canvas, species: int, whole: WholeBranches, side: Floats, extent: Floats) -> None:
        """One thin triangle or ribbon each, or of very thin ones wider ones of fewer."""
        branches = whole.branches
        few = TWIG * side[branches.plant] ** 2
        likely = np.clip(np.pi * branches.radius * branches.length / few, 0.02, 1.0)
        twigs = np.flatnonzero(uniform(branches.key, _THIN) < likely)
        if not len(twigs):
            return
        whole = whole.take(twigs)
        # The parts of a bow are off their chords by the square of their share of it.
        off = whole.lines.bend() / (BENT * extent[branches.plant[twigs]])
        parts = np.clip(np.ceil(np.sqrt(off)).astype(np.int64), 1, whole.lines.segments)
        canvas.add_mesh(("bark", 0, species), twig_buffers(self.flora, whole, 1.0 / likely[twigs], parts), True)
