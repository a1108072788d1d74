# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of plants as the frontier draws them: leaves, wood and facets.

A leaf is drawn as itself where a facet would be about as large (`plants.Transition`). Branches that are opened are
tubes while they are macroscopic, and else one thin triangle each, with the direction and the area of the branch.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from ..arrays import Floats, Integers, Mask, column, length
from ..camera.camera import Camera
from ..compiled.bounds import own_leaf_reaches
from ..compiled.flora import Flora
from ..compiled.placed import extents
from ..growth.axes import Axes, axes
from ..growth.growth import WholeBranches
from ..growth.hashing import Draw, uniform
from ..growth.seeds import Branches
from ..proxies.facet_weights import FacetWeights, leaf_shares
from ..proxies.hotspots import LightRatios, light_ratios
from ..proxies.microsurfaces import Facets, piece_facets, subplant_facets
from ..refinement.contents import PlantParts, as_pieces
from ..refinement.decisions import explicit_fraction
from ..refinement.lights import Light
from ..refinement.shared_parts import opened
from ..species.species import LEAF_KINDS
from ..subplants.leaf_meshes import leaf_meshes
from ..subplants.pieces import Pieces, Thin, whole_pieces
from ..subplants.tubes import tube_buffers, twig_buffers
from .coverage import Coverage, Footprints
from .frontier import Canvas, FrontierKind, Shown, Waiting, Whose, opaque_fractions
from .plants import Transition

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
        own = (getattr(parts, each.name) for each in fields(PlantParts))
        return cls(*own, *ends, across + branches.radius)


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
        whole = parts.branch_only | ~parts.can_open(self.flora)
        return np.where(whole, 1.0, opaque_fractions(silhouette, parts.totals.optical_area))

    def can_open(self, parts: PlantParts) -> Mask:
        """As of `FrontierKind`."""
        return parts.can_open(self.flora)

    def opened(self, parts: PlantRows) -> tuple[PlantRows, Integers]:
        """As of `FrontierKind`."""
        made = [(PlantRows.of(self.flora, new, lines), of) for new, of, lines in opened(self.flora, parts)]
        owner = np.concatenate([np.zeros(0, np.int64), *(of for _, of in made)])
        return PlantRows.concatenate([new for new, _ in made]), owner

    def to_be_opened(self, parts: PlantParts) -> Mask:
        """Those of which leaves are real."""
        return self.transition.of_branches(parts.branches) > 0.0

    def ordered(self, parts: PlantParts) -> PlantParts:
        """As of `FrontierKind`."""
        return parts.take(np.lexsort([*parts.branches.position.T, parts.branches.key]))

    def draw(self, canvas: Canvas, slab: Waiting, side: Floats, _shown: list[Shown]) -> None:
        """As of `FrontierKind`."""
        parts, branches = slab.parts, slab.parts.branches
        extent = self.camera.extent_around(slab.center)
        lines = parts.branch_only | ~parts.can_open(self.flora)
        lines &= parts.branch_only | (2.0 * slab.radius > LINES * extent) | (self.transition.of_branches(branches) > 0)
        self._draw_subplants(canvas, branches.take(np.flatnonzero(~lines)), side[~lines])
        self._draw_branches(canvas, branches.take(np.flatnonzero(lines)), side[lines])

    def unseen(
        self, parts: PlantParts, side: Floats, kept: Floats, _shown: list[Shown]
    ) -> Iterator[tuple[Whose, Facets]]:
        """As of `FrontierKind`."""
        species = self.flora.species_of(parts.branches.row)
        for s in np.flatnonzero(np.bincount(species)).tolist():
            some = np.flatnonzero((species == s) & ~parts.branch_only)
            if len(some):
                yield (s, ""), self._of_subplants(parts.branches.take(some), side[some], side[some], 1.0 - kept[some])
            some = np.flatnonzero((species == s) & parts.branch_only)
            if len(some):
                yield (s, ""), self._of_pieces(as_pieces(parts.branches.take(some)), side[some])

    def _draw_subplants(self, canvas: Canvas, branches: Branches, side: Floats) -> None:
        if not len(branches):
            return
        leaf = np.maximum(side, np.sqrt(self.flora.one_leaf_area(branches)))
        species = self.flora.species_of(branches.row)
        for s in np.flatnonzero(np.bincount(species)).tolist():
            some = np.flatnonzero(species == s)
            own = branches.take(some)
            canvas.add_facets((s, ""), self._of_subplants(own, leaf[some], side[some], thin=canvas.thin))

    def _of_subplants(
        self, branches: Branches, leaf: Floats, wood: Floats, left_out: Floats | None = None, thin: Thin | None = None
    ) -> Facets:
        count = self._optical(branches) / np.maximum(leaf, 1e-12) ** 2
        weight = self.weights.of_subplants(branches.row, count, leaf_shares(self.flora, branches))
        lit = None if thin is None else self._lit(branches, leaf)
        return subplant_facets(self.flora, branches, leaf, wood, weight, left_out, lit, thin)

    def _draw_branches(self, canvas: Canvas, branches: Branches, side: Floats) -> None:
        """Branches alone: leaves that are large are real, wood is tubes or thin triangles, the rest is facets."""
        if not len(branches):
            return
        flora, transition = self.flora, self.transition
        branches = replace(branches, plant=np.arange(len(branches), dtype=np.int32))
        whole, explicit = WholeBranches(branches, axes(flora.rows, branches)), transition.of_own_leaves(branches)
        pieces, owner = whole_pieces(flora.rows, whole)
        species = flora.species_of(branches.row)
        extent = np.maximum(transition.camera.extent_around(branches.position), 1e-300)
        wide = 2.0 * branches.radius / extent
        tubes = uniform(branches.key, Draw.TRANSITION) < explicit_fraction(wide, TUBES)
        thin, detail = wide < BROAD, transition.detail
        for s in np.flatnonzero(np.bincount(species)).tolist():
            own = species == s
            left = np.flatnonzero(own[owner] & (explicit[owner] < 1.0))
            if len(left):
                of = whole, owner[left]
                canvas.add_facets((s, ""), self._of_pieces(pieces.take(left), side, explicit, of, canvas.thin))
            some = whole.take(np.flatnonzero(own & (explicit > 0.0)))
            given = lambda b: (explicit[b.plant], *transition.of_kites(b)), detail.lengths, canvas.thin
            for one in leaf_meshes(flora, s, [some], *given) if len(some) else ():
                canvas.add_mesh((LEAF_KINDS[one.kind], one.form, s), one.buffers, True)
            # What is a few pixels wide has few sides; of wider wood all is drawn, or its shading would end at holes.
            slender, broad = (whole.take(np.flatnonzero(own & tubes & (thin == is_thin))) for is_thin in (True, False))
            canvas.add_mesh(("bark", 0, s), tube_buffers(flora, [slender], None, SIDES), True)
            canvas.add_mesh(("bark", 0, s), tube_buffers(flora, [broad], detail.wood))
            self._draw_twigs(canvas, s, whole.take(np.flatnonzero(own & ~tubes)), side, extent)

    def _draw_twigs(self, canvas: Canvas, species: int, whole: WholeBranches, side: Floats, extent: Floats) -> None:
        """One thin triangle or ribbon each, or of very thin ones wider ones of fewer."""
        branches = whole.branches
        area = np.pi * branches.radius * branches.length
        likely = np.clip(area / (TWIG * side[branches.plant] ** 2), 0.02, 1.0)
        some = np.flatnonzero(uniform(branches.key, _THIN) < likely)
        if not len(some):
            return
        whole = whole.take(some)
        # The parts of a bow are off their chords by the square of their share of it.
        off = whole.lines.bend() / (BENT * extent[branches.plant[some]])
        parts = np.clip(np.ceil(np.sqrt(off)).astype(np.int64), 1, whole.lines.segments)
        canvas.add_mesh(("bark", 0, species), twig_buffers(self.flora, whole, 1.0 / likely[some], parts), True)

    def _of_pieces(
        self,
        pieces: Pieces,
        side: Floats,
        explicit: Floats | None = None,
        whole: tuple[WholeBranches, Integers] | None = None,
        thin: Thin | None = None,
    ) -> Facets:
        """Facets of pieces: of their leaves where whole branches (n,) are seen, else of their wood as well.

        Sides (n,) and real fractions (n,) are those of branches.
        """
        flora, branches = self.flora, pieces.branches if whole is None else whole[0].branches
        leaf = np.maximum(side, np.sqrt(flora.one_leaf_area(branches)))
        count = self._optical(branches) / np.maximum(leaf, 1e-12) ** 2
        weight = self.weights.of_pieces(branches.row, count, leaf_shares(self.flora, branches))
        if whole is None:
            return piece_facets(flora, pieces, leaf, side, weight, explicit)
        own = (of[whole[1]] for of in (leaf, side, weight, explicit))
        return piece_facets(flora, pieces, *own, self._lit(branches, leaf).take(whole[1]), thin, whole)

    def _optical(self, branches: Branches) -> Floats:
        return self.flora.leaf_areas(branches) + self.flora.wood_areas(branches) / 2

    def _lit(self, branches: Branches, side: Floats) -> LightRatios:
        """Light on facets of sides (n,) over that on the leaves of branches."""
        return light_ratios(self.flora, branches, side, self.camera, self.lights)
