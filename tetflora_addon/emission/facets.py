# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to the facets of proxies, or to what is drawn in their place, block by block.

`proxies.drawn` says what that may be, and `forms` makes buffers of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..buffers import BLOCK_POLYGONS
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..growth.axes import axes
from ..growth.branches import Branches
from ..growth.growth import WholeBranches
from ..processes.pool import WORTH_PROCESSES, in_processes
from ..proxies.drawn import Drawn
from ..proxies.facet_sizes import HIDDEN_LEAVES, FacetPixels, FacetSizes, piece_facet_sizes, subplant_facet_sizes
from ..proxies.facet_weights import FacetWeights, facet_weights
from ..proxies.hotspots import light_ratios
from ..proxies.microsurfaces import Facets, kept_out_of_view, piece_facets, subplant_facets
from ..proxies.thrown_shadows import ThrownShadows
from ..refinement.contents import bounding_cylinders, piece_totals
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..subplants.pieces import whole_pieces
from .asset_plan import AssetPlan, planned_facets
from .asset_sight import AssetSight
from .plants import Transition
from .polygons import polygon_facets
from .portions import MIXED, Portions, Sight, in_chunks

#: Approximate number of facets that are made at a time; thick wood close to the eye is cut into very many.
FACETS_AT_ONCE = 200_000
#: Pixels, and facets, down to which visible sub-plants are opened for the places of their facets.
DETAIL, FEW = 2.0, 8.0
#: Extent over the metres that their shadows fall, from which on sub-plants beside the view are opened: such a shadow
#: shows trunk and limbs where they are.
THROWN = 0.25

#: Stands for a species where facets are of assets.
ASSETS = -1

#: Some facets or what is drawn for them, and whether the camera sees them: neither hidden nor beside the view.
Part = tuple[Drawn, bool]
#: What is made of some facets, which the camera sees or not. Another process may call it.
Form = Callable[[Facets, bool], Any]


@dataclass(frozen=True)
class Parts:
    """Facets of one species, of assets (`ASSETS`), or of other meshes where that is None."""

    species: int | None
    facets: tuple[Part, ...]

    def __iter__(self) -> Iterator[Part]:
        return iter(self.facets)


def facet_parts(
    flora: Flora,
    result: Refinement,
    camera: Camera,
    pixels: FacetPixels,
    transition: Transition | None = None,
    form: Form | None = None,
    sight: Sight | None = None,
    assets: tuple[AssetSight, AssetPlan] | None = None,
) -> Iterator[Parts]:
    """Facets of all that is not drawn as it is; no block is empty.

    Blocks have about `BLOCK_POLYGONS` facets each, so that only one of them is in memory beside Blender's own data.
    Each is of one species, or of other meshes.

    Parameters
    ----------
    flora : Flora
    result : Refinement
    camera : Camera
    pixels : FacetPixels
        Sides of facets, see `proxies.facet_sizes`.
    transition : Transition, optional
        `plants.explicit_blocks` with the same transition makes the rest: wide leaves of explicit tetrahedra, and thick
        wood of all that is seen. Without, all of every plant gets facets.
    form : callable, optional
        What becomes of facets where they are made; without, they stay what they are.
    sight : Sight, optional
        Of the result, where there is one.
    assets : AssetSight, AssetPlan, optional
        What instances of assets are drawn as.
    """
    sight = sight or Sight(flora, result, camera)
    parts: list[Part] = []
    current = None
    every = _facets(sight, result, pixels, transition, form)
    if assets is not None:
        every = chain(every, ((ASSETS, *made) for made in planned_facets(*assets, pixels, form)))
    for species, *made in every:
        full = sum(len(facets) for facets, _ in parts) >= BLOCK_POLYGONS
        if parts and (full or species != current):
            yield Parts(current, tuple(parts))
            parts = []
        current = species
        if len(made[0]):
            parts.append(tuple(made))
    if parts:
        yield Parts(current, tuple(parts))


def _facets(
    sight: Sight,
    result: Refinement,
    pixels: FacetPixels,
    transition: Transition | None,
    form: Form | None,
) -> Iterator[tuple[int | None, Any, bool]]:
    """Facets in runs of about `FACETS_AT_ONCE`, species by species."""
    camera, portions = sight.camera, sight.portions()
    weights = facet_weights(sight.flora, drawn_species(sight, transition))
    yield from portion_facets(sight, portions, weights, pixels, transition, form)
    explicit = result.chosen(Decision.EXPLICIT) if transition else np.zeros(len(result.tree), bool)
    held = result.holdings.polygons
    proxies = held.take((result.chosen(Decision.PROXY, Decision.HIDDEN) & ~explicit)[held.cell])
    if len(proxies):
        for facets, seen in polygon_facets(proxies, result, camera, pixels.seen, FACETS_AT_ONCE):
            yield None, facets if form is None else form(facets, seen), seen


def drawn_species(sight: Sight, transition: Transition | None) -> list[int]:
    """Species of which facets may be drawn, by index: leaves are not all real; where they are, so is all wood."""
    flora, portions = sight.flora, sight.portions()
    branches, visibility = portions.parts.branches, portions.visibility
    facets = np.ones(len(portions), bool)
    if transition is not None:
        real = portions.real & (visibility > 0) & ~portions.mixed
        facets = ~(real & (transition.of_branches(branches, visibility) >= 1.0))
    return np.unique(flora.rows["species"][branches.row[facets]]).tolist()


def portion_facets(
    sight: Sight,
    portions: Portions,
    weights: FacetWeights,
    pixels: FacetPixels,
    transition: Transition | None,
    form: Form | None = None,
) -> Iterator[tuple[int, Any, bool]]:
    """Facets of some portions (n,), species by species; weights do not change how many there are."""
    flora, maker = sight.flora, _Maker(sight, weights, pixels, transition, form)
    of_species = flora.rows["species"][portions.parts.branches.row]
    expected = sizes_of(flora, portions, sight.shadows).counts(pixels) + 1

    def runs() -> Iterator[tuple[int, Portions]]:
        for species in range(len(flora.species)):
            own = np.flatnonzero(of_species == species)
            for run in in_chunks(expected[own], FACETS_AT_ONCE):
                yield species, portions.take(own[run])

    for made in in_processes(_facets_of_run, maker, runs(), float(expected.sum()) > WORTH_PROCESSES):
        while made:
            yield made.pop(0)


def _facets_of_run(maker: _Maker, run: tuple[int, Portions]) -> list[tuple[int, Any, bool]]:
    """Facets of one run of portions, all of one species."""
    (species, portions), form = run, maker.form
    return [(species, facets if form is None else form(facets, seen), seen) for facets, seen in maker.facets(portions)]


def sizes_of(flora: Flora, portions: Portions, shadows: ThrownShadows) -> FacetSizes:
    """Sizes of the facets of portions (n,), were they drawn as they are."""
    parts = portions.parts
    given = parts.totals, shadows, portions.visibility, portions.coarse
    # A branch alone is placed by its middle; how long its pieces are decides nothing here.
    sizes = subplant_facet_sizes(flora, parts.branches, *given)
    sides = flora.rows["sides"][parts.branches.row] * flora.rows["segments"][parts.branches.row]
    alone = np.sqrt(parts.totals.wood_area / 2 / np.maximum(sides, 1))
    # What is in the view in part gets facets that may be in the view.
    clearance = np.where(portions.beside, sizes.clearance, np.minimum(sizes.clearance, 0.0))
    return replace(sizes, least_wood=np.where(parts.alone, alone, sizes.least_wood), clearance=clearance)


@dataclass(frozen=True)
class _Maker:
    """Makes the facets of parts of plants."""

    sight: Sight
    weights: FacetWeights
    pixels: FacetPixels
    transition: Transition | None
    form: Form | None = None

    def facets(self, portions: Portions) -> Iterator[tuple[Facets, bool]]:
        """Facets of portions, which are opened as far as their places show."""
        flora, sight, transition = self.sight.flora, self.sight, self.transition
        bodies = [Portions.empty()]
        while len(portions):
            parts, seen = portions.parts, portions.visibility > 0
            sizes = sizes_of(flora, portions, sight.shadows)
            extent = sight.pixels(portions)
            many = sizes.counts(self.pixels) > FEW
            detail = seen & (extent > DETAIL) & many
            real, thick = np.zeros((2, len(parts)))
            if transition is not None:
                real = np.where(portions.real & seen, transition.of_branches(parts.branches, portions.visibility), 0.0)
                thick = np.where(seen, transition.of_thickness(parts.branches, portions.visibility), 0.0)
            # A few large facets show no more where some of them are hidden; beside real leaves they must leave as many
            # places free as those take.
            mixed = seen & portions.mixed & (extent > MIXED) & (many | (real > 0))
            thrown = self._throws(portions) & many
            open_here = parts.can_open(flora) & (mixed | thrown | ((detail | (thick > 0)) & (real < 1.0)))
            bodies.append(portions.take(np.flatnonzero(parts.alone)))
            for group in (seen, ~seen & ~portions.beside, portions.beside & ~seen):
                some = np.flatnonzero(group & ~open_here & ~parts.alone & (real < 1.0))
                if len(some):
                    left_out = np.where(seen[some], real[some], 1.0 - sizes.enough(self.pixels)[some])
                    made = self._of_subplants(parts.branches.take(some), sizes.take(some), left_out)
                    yield self._placed(made, bool(seen[some[0]]), bool(portions.beside[some[0]]))
            # What is opened for its detail alone keeps one visibility, as its real leaves do.
            portions = replace(portions, mixed=mixed).take(np.flatnonzero(open_here))
            portions = sight.opened(portions) if len(portions) else portions
        every = Portions.concatenate(bodies)
        seen = every.visibility > 0
        for group in (seen, ~seen & ~every.beside, every.beside & ~seen):
            some = every.take(np.flatnonzero(group))
            if len(some):
                made = self._of_bodies(some)
                yield self._placed(made, bool(some.visibility[0] > 0), bool(some.beside[0]))

    def _throws(self, portions: Portions) -> NDArray[np.bool_]:
        """Portions (n,) beside the view with shadows in it that show trunk and limbs."""
        parts, sight = portions.parts, self.sight
        out = portions.beside & (portions.visibility <= 0)
        some = np.flatnonzero(out)
        centre, radius, half = bounding_cylinders(sight.flora, parts.branches.take(some))
        fallen = sight.shadows.distance(centre, sight.camera.clearance(centre), np.hypot(radius, half))
        out[some] = parts.extent[some] > THROWN * fallen
        return out

    def _placed(self, facets: Facets, seen: bool, beside: bool) -> tuple[Facets, bool]:
        """Facets, and whether they may be in the image; those beside the view must not reach into it.

        Of what is hidden at the border of the image, some are beside it too.
        """
        if seen:
            return facets, True
        return kept_out_of_view(facets, self.sight.camera.clearance, HIDDEN_LEAVES**-0.5, not beside), not beside

    def _of_subplants(self, subplants: Branches, sizes: FacetSizes, real: NDArray[np.float64]) -> Facets:
        leaf, wood = sizes.sides(self.pixels)
        count, share = sizes.whole_optical / np.maximum(leaf, 1e-12) ** 2, self._share(subplants)
        weight = self.weights.of_subplants(subplants.row, count, share)
        return subplant_facets(
            self.sight.flora, subplants, leaf, wood, weight, real, self._once(subplants, sizes, leaf)
        )

    def _share(self, branches: Branches) -> NDArray[np.float64] | None:
        """Part (n,) of their leaves that branches have on the day; None in summer."""
        return None if branches.year is None else self.sight.flora.day.leaf_share(branches)

    def _once(self, branches: Branches, sizes: FacetSizes, side: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light (n,) that leaves of branches send to the eye once over what facets do; 1 where nothing is seen."""
        out, seen, shadows = np.ones(len(branches)), np.flatnonzero(~sizes.hidden), self.sight.shadows
        out[seen] = light_ratios(self.sight.flora, branches.take(seen), side[seen], shadows.camera, shadows.lights)
        return out

    def _of_bodies(self, portions: Portions) -> Facets:
        """Facets of branches alone, without wood that is real."""
        flora, branches, transition = self.sight.flora, portions.parts.branches, self.transition
        pieces, owner = whole_pieces(flora.rows, WholeBranches(branches, axes(flora.rows, branches)))
        visibility, coarse = portions.visibility[owner], portions.coarse[owner]
        sizes = piece_facet_sizes(flora, pieces, piece_totals(flora, pieces), self.sight.shadows, visibility, coarse)
        leaf, wood = sizes.sides(self.pixels)
        count, share = sizes.whole_optical / np.maximum(leaf, 1e-12) ** 2, self._share(pieces.branches)
        weight = self.weights.of_pieces(pieces.branches.row, count, share)
        real = tubes = None
        if transition is not None:
            seen = portions.visibility > 0
            real = np.where(portions.real & seen, transition.of_branches(branches, portions.visibility), 0.0)
            tubes, twigs = transition.of_wood(branches, portions.visibility)
            bare = transition.of_bare_wood(branches, portions.visibility)
            tubes = (seen & np.where(real > 0, tubes | twigs, bare))[owner]
            real = real[owner]
        once = self._once(pieces.branches, sizes, leaf)
        return piece_facets(flora, pieces, leaf, wood, weight, real, tubes, once)
