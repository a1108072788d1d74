# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many polygons and facets a refinement would be drawn with, at any detail: expected, and checked on a sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..growth.hashing import uniform
from ..processes.pool import in_processes
from ..proxies.facet_sizes import FacetPixels, FacetSizes, polygon_facet_sizes
from ..proxies.facet_weights import FacetWeights, facet_weights
from ..proxies.microsurfaces import Facets
from ..refinement.contents import LARGE
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..refinement.settings import RefinementSettings
from ..subplants.wood_detail import finer
from .asset_expected import AssetExpected
from .facets import portion_facets, sizes_of
from .leaf_detail import TOLERANCE, LeafDetail
from .plants import Block, Transition, portion_blocks
from .portions import Portions, Sight

#: Fraction of the faces of twigs that are made where leaves are real.
_TWIGS = 0.15
#: Fraction of the faces of bare sub-plants that are drawn: a factor and a power of the root of the mean area of a face
#: in the image, over the limit for leaves. Measured on dead trees of 15 to 500 m; .3 of them at the nearest.
_THIN = 0.21, 1.4
#: Parts of plants that are drawn to find out what to expect: where only the image limits them, and where a limit that
#: must hold is near; polygons that are too few to tell; and how far expectations may be corrected.
_DRAWN, _SOME, _ROUGH = (800, 3000), 300.0, (0.4, 2.5)
#: Parts from which on other processes draw some of them.
_WORTH = 300
#: Draw of this module: which parts. That of the transition would choose those whose wood is real.
_SAMPLE = 224
#: Parts, seen and not, that tell about all at a detail that is tried, to half a per cent; and which of them.
_TELLING, _CHOSEN = 40_000, 225


class Expected:
    """Expected polygons and facets of a refinement."""

    def __init__(self, flora: Flora, result: Refinement, camera: Camera, assets: AssetExpected | None = None) -> None:
        self.assets = assets
        self.sight = Sight(flora, result, camera)
        self.every = portions = self.sight.portions()
        # Of polygons, and of facets that are seen or not, what was found over what was expected.
        self.found = np.ones(3)
        some = portions.visibility > 0
        self.flora, self.camera = flora, camera
        self.portions, self.sizes, self.times = self._telling(portions.take(np.flatnonzero(some)))
        self.faces_coarse = _real_faces(flora, self.portions, Transition(flora, camera, 1.0, np.inf))
        self.any_bare = bool((flora.leaf_count[self.portions.parts.branches.row] <= 0).any())
        self.tolerance = TOLERANCE
        _, *self.unseen_sizes = self._telling(portions.take(np.flatnonzero(~some)))
        self.result, held, hidden = result, result.holdings.polygons, result.chosen(Decision.HIDDEN)
        self.cell = held.cell
        self.hidden = hidden[held.cell] | ~result.in_view[held.cell]
        self.faces = polygon_facet_sizes(held, camera, hidden)

    def _telling(self, portions: Portions) -> tuple[Portions, FacetSizes, NDArray[np.float64]]:
        """As many portions (n,) as tell about all, the sizes of their facets, and for how many each of them speaks.

        What has many facets is chosen more likely, and speaks for fewer.
        """
        sizes = sizes_of(self.sight.flora, portions, self.sight.shadows)
        if len(portions) <= _TELLING:
            return portions, sizes, np.ones(len(portions))
        many = sizes.counts(FacetPixels(1.0)) + portions.parts.totals.polygons**0.5
        likely = np.minimum(_TELLING * many / float(many.sum()), 1.0)
        chosen = np.flatnonzero(uniform(portions.parts.branches.key, _CHOSEN) < likely)
        return portions.take(chosen), sizes.take(chosen), 1.0 / likely[chosen]

    @property
    def tolerance(self) -> float:
        """Pixels by which the margins of near leaves may be off."""
        return self._tolerance

    @tolerance.setter
    def tolerance(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self.faces_finer = LeafDetail(self.flora, self.camera, tolerance).more(
            self.portions.parts, self.portions.visibility
        )

    def finer(self, limit: float) -> float:
        """Polygons of near leaves beyond those of their models."""
        branches = self.portions.parts.branches
        fraction = Transition(self.flora, self.camera, limit).of_branches(branches, self.portions.visibility)
        real = np.where(self.portions.real, fraction, 0.0)
        return float((self.times * real * self.portions.within * self.faces_finer).sum())

    def seen(self, pixels: float, limit: float, weight: float, safe: bool = False) -> float:
        """Polygons, and facets counted with a weight, of all plants and assets that are seen.

        safe: never fewer than were expected before `calibrate`; some plants do not tell exactly about all.
        """
        transition = Transition(self.flora, self.camera, limit)
        branches = self.portions.parts.branches
        real = np.where(self.portions.real, transition.of_branches(branches, self.portions.visibility), 0.0)
        found = np.maximum(self.found, float(safe))
        facets = found[1] * weight * self.sizes.counts(FacetPixels(pixels))
        bare = _bare(self.flora, self.portions, self.camera, limit) if self.any_bare else 0.0
        faces = found[0] * (self.faces_coarse + self.faces_finer + bare)
        tubes = found[0] * _tubes(self.flora, self.portions, transition, real)
        of_assets = self.assets.seen(pixels, limit, weight, safe) if self.assets else 0.0
        of_plants = self.times * (self.portions.within * (real * faces + (1.0 - real) * facets) + tubes)
        return float(of_plants.sum()) + of_assets

    def unseen(self, pixels: FacetPixels, safe: bool = False) -> float:
        """Facets of all plants and assets that are not seen; safe as for `seen`."""
        sizes, times = self.unseen_sizes
        of_assets = self.assets.unseen(pixels) if self.assets else 0.0
        return float(max(self.found[2], float(safe))) * float(times @ sizes.counts(pixels)) + of_assets

    def together(self, settings: RefinementSettings) -> float:
        """Expected polygons and facets of all, seen or not, at the details of the settings."""
        pixels, limit = settings.facet, settings.leaf_limit
        of_meshes = self.polygons(pixels, limit, 1.0, True)
        return self.seen(pixels, limit, 1.0, True) + of_meshes + self.unseen(FacetPixels(pixels), True)

    def calibrate(self, pixels: FacetPixels, limit: float, exactly: bool) -> None:
        """Draw some of the plants, or more of them, and expect of all what was found of these."""
        share = _DRAWN[int(exactly)] / max(len(self.every), 1)
        # What no point tells about has almost nothing within the view, or very much: one of them would speak for all.
        chosen = (uniform(self.every.parts.branches.key, _SAMPLE) < share) & (self.every.within >= 1.0) | (share >= 1.0)
        some = self.every.take(np.flatnonzero(chosen))
        transition = Transition(self.flora, self.camera, limit, self.tolerance)
        weights = facet_weights(self.flora, ())
        seen, sample = some.visibility > 0, _Sample(self.sight, transition, weights, pixels)
        groups = [(kind, some.take(np.flatnonzero(group))) for kind, group in enumerate((seen | True, seen, ~seen))]
        # The longest first.
        facets_seen, real, facets_hidden = in_processes(
            _drawn_of, sample, (groups[1], groups[0], groups[2]), len(some) > _WORTH
        )
        sizes, fraction = sizes_of(self.flora, some, self.sight.shadows), np.where(some.real, 1.0, 0.0)
        fraction *= np.where(seen, transition.of_branches(some.parts.branches, some.visibility), 0.0)
        faces = _real_faces(self.flora, some, transition) + transition.detail.more(some.parts, some.visibility)
        faces += _bare(self.flora, some, self.camera, limit)
        expected = (some.within * fraction * faces).sum() + _tubes(self.flora, some, transition, fraction).sum()
        left = np.bincount(~seen, some.within * (1.0 - fraction) * sizes.counts(pixels), minlength=2)
        found = np.array([real, facets_seen, facets_hidden])
        self.found = np.clip((found + _SOME) / (np.array([expected, *left]) + _SOME), *_ROUGH)

    def polygons(self, pixels: float, limit: float, weight: float, every: bool) -> float:
        """Polygons of other meshes, and facets in their place; of what is seen, or of all."""
        explicit = np.zeros(len(self.result.tree), bool)
        explicit[self.result.nodes] = (self.result.decision == Decision.EXPLICIT) & ~self.too_small(limit)
        kept = explicit[self.cell] | self.faces.kept(pixels)
        counts = np.where(kept, 1.0, weight * self.faces.counts(pixels))
        return float(counts[every | ~self.hidden].sum())

    def too_small(self, limit: float) -> NDArray[np.bool_]:
        """Explicit tetrahedra (cells,) with polygons of other meshes that are proxies under a larger limit."""
        cells, held = self.result.cells, np.zeros(len(self.result.tree), bool)
        held[self.cell] = True
        # What is large there stays as it is as long as facets are smaller.
        feature = np.where(np.isinf(cells.feature), LARGE, cells.feature)
        return held[cells.nodes] & (self.result.decision == Decision.EXPLICIT) & (feature < limit)


@dataclass(frozen=True)
class _Sample:
    """What parts that are drawn as a sample are drawn with."""

    sight: Sight
    transition: Transition
    weights: FacetWeights
    pixels: FacetPixels


def _drawn_of(sample: _Sample, group: tuple[int, Portions]) -> float:
    """Polygons of some portions (kind 0), or facets."""
    kind, portions = group
    if kind == 0:
        return sum(portion_blocks(sample.sight, portions, sample.transition, form=_cost))
    made = portion_facets(sample.sight, portions, sample.weights, sample.pixels, sample.transition, _count)
    return float(sum(number for _, number, _ in made))


def _cost(block: Block) -> float:
    """Polygons of a block; those of more than two triangles count by these."""
    return float(np.maximum((np.diff(block.buffers.face_offsets) - 2) / 2.0, 1.0).sum())


def _count(facets: Facets, _seen: bool) -> int:
    return len(facets)


def _tubes(flora: Flora, portions: Portions, transition: Transition, real: NDArray[np.float64]) -> NDArray[np.float64]:
    """Expected polygons (n,) of thick wood of portions of whose leaves a fraction (n,) is real."""
    branches, rows = portions.parts.branches, flora.rows
    faces = rows["sides"] * (rows["segments"] + rows["rings"]).astype(np.float64) * ~rows["phantom"]
    return transition.of_thickness(branches, portions.best) * faces[branches.row] * (1.0 - real)


def _real_faces(flora: Flora, portions: Portions, transition: Transition) -> NDArray[np.float64]:
    """Expected polygons (n,) of portions, were all of their leaves real; large faces count by their triangles."""
    parts, row = portions.parts, portions.parts.branches.row
    leafy = flora.leaf_count[row] > 0
    each = np.where(leafy, flora.leaf_faces[row] / np.maximum(flora.leaf_count[row], 1e-300), 0.0)
    leaves = np.where(leafy, parts.totals.leaf_area / np.maximum(flora.one_leaf_area(parts.branches), 1e-300), 0.0)
    wood = np.maximum(parts.totals.polygons - leaves * each, 0.0)
    if (pixels := transition.detail.wood) is not None:
        wood = wood * finer(flora, parts.branches, parts.alone, pixels)
    kites = transition.of_kites(parts.branches, portions.visibility)
    full = each * _weights(flora)[flora.rows["species"][row]]
    # Among real leaves, hardly any twig is wide enough to be real. What has no leaves is in `_bare`.
    return leaves * (full + kites * (1.0 - full)) + np.where(parts.alone, 1.0, leafy * _TWIGS) * wood


def _bare(flora: Flora, portions: Portions, camera: Camera, limit: float) -> NDArray[np.float64]:
    """Expected polygons (n,) of sub-plants without leaves, were their base real.

    Twigs are thinner than the base, by how much only the faces tell on which their surface is spread.
    """
    parts, out = portions.parts, np.zeros(len(portions))
    at = np.flatnonzero(~parts.alone & (flora.leaf_count[parts.branches.row] <= 0))
    totals = parts.totals.take(at)
    width = np.sqrt(totals.wood_area / np.maximum(totals.polygons, 1.0))
    pixels = width / np.maximum(camera.extent_around(parts.branches.position[at]), 1e-300)
    factor, power = _THIN
    out[at] = totals.polygons * np.minimum(factor * (pixels / limit) ** power, 1.0)
    return out


def _weights(flora: Flora) -> NDArray[np.float64]:
    """Triangles (species,) of a face of leaves over those of a quad: a spray of needles may be one face of many."""
    forms = [[form for kind in kinds for form in kind] for kinds in flora.forms]
    triangles = [sum(len(form.corner_verts) - 2 * form.polygons for form in own) for own in forms]
    faces = [sum(form.polygons for form in own) for own in forms]
    return np.maximum(np.array(triangles) / (2.0 * np.maximum(faces, 1)), 1.0)
