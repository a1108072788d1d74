# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many polygons and facets a refinement would be drawn with, at any detail: expected, and checked on a sample."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
from .portions import MIXED, Portions, Sight

#: Fraction of the faces of twigs that are made where leaves are real.
_TWIGS = 0.15
#: Fraction of the faces of bare sub-plants that are drawn: a factor and a power of the root of the mean area of a face
#: in the image, over the limit for leaves. Measured on dead trees of 15 to 500 m; .3 of them at the nearest.
_THIN = 0.21, 1.4
#: Parts of plants that are drawn to find out what to expect: where only the image limits them, and where a limit that
#: must hold is near; polygons that are too few to tell; and how far expectations may be corrected.
_DRAWN, _SOME, _ROUGH = (80, 400), 100.0, (0.05, 20.0)
#: Parts from which on other processes draw some of them.
_WORTH = 300
#: Draw of this module: which parts. That of the transition would choose those whose wood is real.
_SAMPLE = 224
#: Parts, seen and not, that tell about all at a detail that is tried, to half a per cent; and which of them.
_TELLING, _CHOSEN = 40_000, 225


#: Polygons and facets that are drawn at least.
_WORK = 15_000.0
#: Parts that are seen, up to so many, are opened so many times where they are a larger part than that.
_FEW_PARTS, _LEVELS = 2000, 4
#: Parts that have so many times as many polygons and facets are another layer, of which more are drawn.
_LAYER, _NOTHING = 16.0, 1e-9


class Expected:
    """Expected polygons and facets of a refinement."""

    def __init__(self, flora: Flora, result: Refinement, camera: Camera, assets: AssetExpected | None = None) -> None:
        self.assets = assets
        self.sight = Sight(flora, result, camera)
        portions = self._smaller(self.sight.portions())
        # Of polygons, and of facets that are seen or not, what was found over what was expected.
        self.found = np.ones(3)
        self.undrawn = 1.0
        some = portions.visibility > 0
        self.flora, self.camera = flora, camera
        self.portions, self.sizes, self.times = self._telling(portions.take(np.flatnonzero(some)))
        self.faces_coarse = _real_faces(flora, self.portions, Transition(flora, camera, 1.0, np.inf))
        self.any_bare = bool((flora.leaf_count[self.portions.parts.branches.row] <= 0).any())
        self.tolerance = TOLERANCE
        self.unseen_portions, *self.unseen_sizes = self._telling(portions.take(np.flatnonzero(~some)))
        self.result, held, hidden = result, result.holdings.polygons, result.chosen(Decision.HIDDEN)
        self.cell = held.cell
        self.hidden = hidden[held.cell] | ~result.in_view[held.cell]
        self.faces = polygon_facet_sizes(held, camera, hidden)

    def _smaller(self, portions: Portions) -> Portions:
        """Portions, of which those that are seen are opened as they will be where they are few: each tells a little."""
        sight = self.sight
        for _ in range(_LEVELS):
            seen = portions.visibility > 0
            share = np.where(seen, portions.parts.extent**2, 0.0)
            large = portions.parts.can_open(sight.flora) & (share * _FEW_PARTS > share.sum())
            large &= sight.flora.leaf_count[portions.parts.branches.row] > 0  # `_bare` is of whole trees
            if seen.sum() >= _FEW_PARTS or not large.any():
                break
            mixed = portions.mixed & (sight.pixels(portions) > MIXED)
            opened = sight.opened(replace(portions, mixed=mixed).take(np.flatnonzero(large)))
            portions = Portions.concatenate([portions.take(np.flatnonzero(~large)), opened])
        return portions

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
        faces, facets = self._of_each(FacetPixels(pixels), limit)
        of_assets = self.assets.seen(pixels, limit, weight, safe) if self.assets else 0.0
        return float(self.times @ (self.found[0] * faces + self.found[1] * weight * facets)) + of_assets

    def unseen(self, pixels: FacetPixels, safe: bool = False) -> float:
        """Facets of all plants and assets that are not seen; safe as for `seen`."""
        sizes, times = self.unseen_sizes
        of_assets = self.assets.unseen(pixels) if self.assets else 0.0
        return float(self.found[2]) * float(times @ sizes.counts(pixels)) + of_assets

    def together(self, settings: RefinementSettings) -> float:
        """Expected polygons and facets of all, seen or not, at the details of the settings."""
        pixels, limit = settings.facet, settings.leaf_limit
        of_meshes = self.polygons(pixels, limit, 1.0, True)
        return self.seen(pixels, limit, 1.0, True) + of_meshes + self.unseen(FacetPixels(pixels), True)

    def calibrate(self, pixels: FacetPixels, limit: float, exactly: bool) -> None:
        """Draw some of the plants, or more of them, and expect of all what was found of these.

        What has many polygons and facets is drawn more likely. Parts of about as many are a layer: what was found of
        those of a layer that were drawn speaks for its others.
        """
        transition = Transition(self.flora, self.camera, limit, self.tolerance)
        (faces, facets), seen = self._of_each(pixels, limit), (self.portions, self.unseen_portions)
        hidden = self.unseen_sizes[0].counts(pixels)
        layers = [_layers(number, some) for number, some in zip((faces + facets, hidden), seen, strict=True)]
        wanted, groups, expected = _DRAWN[int(exactly)], [], []
        whole = float(np.sqrt(faces + facets + 1.0).sum() + np.sqrt(hidden + 1.0).sum())
        least = _WORK / max(float(self.times @ (faces + facets) + self.unseen_sizes[1] @ hidden), 1.0)
        for some, layer, counts in zip(seen, layers, ((faces, facets), (hidden,)), strict=True):
            times = self.times if some is self.portions else self.unseen_sizes[1]
            for number in np.unique(layer):
                own = np.flatnonzero(layer == number)
                each = _LAYER ** (0.5 * number + 0.25) / whole if number >= 0 else 1.0 / len(own)
                likely = min(max(wanted * each, least), 1.0)
                drawn = own[uniform(some.parts.branches.key[own], _SAMPLE) < likely]
                for kind, count in enumerate(counts, start=2 if some is not self.portions else 0):
                    groups.append((kind, some.take(drawn)))
                    expected.append((kind, float(count[drawn].sum()), float((times * count)[own].sum()), likely))
        sample = _Sample(self.sight, transition, facet_weights(self.flora, ()), pixels)
        number = sum(len(portions) for _, portions in groups)
        if not groups:
            return
        found = np.array(list(in_processes(_drawn_of, sample, groups, number > _WORTH)))
        kind, drawn, every, likely = np.array(expected).T
        kind = kind.astype(int)
        speaks = every / np.maximum(drawn, _NOTHING) * (drawn > 0.0)

        def whole(of: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.bincount(kind, of, 3)

        # What few were drawn of is as wrong as the rest.
        mean = (whole(speaks * found) + _SOME) / (whole(speaks * drawn) + _SOME)
        rough = np.where(likely < 1.0, _SOME, _NOTHING)
        truly = every * (found + rough * mean[kind]) / (drawn + rough)
        self.found = np.clip((whole(truly) + _NOTHING) / (whole(every) + _NOTHING), *_ROUGH)
        self.undrawn = float((truly * (1.0 - likely)).sum() / max(truly.sum(), _NOTHING))

    def _of_each(self, pixels: FacetPixels, limit: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Polygons (n,) and facets (n,) that are expected of each portion that is seen, before `calibrate`."""
        transition = Transition(self.flora, self.camera, limit)
        real = np.where(
            self.portions.real, transition.of_branches(self.portions.parts.branches, self.portions.visibility), 0.0
        )
        bare = _bare(self.flora, self.portions, self.camera, limit) if self.any_bare else 0.0
        faces = self.portions.within * real * (self.faces_coarse + self.faces_finer + bare)
        facets = self.portions.within * (1.0 - real) * self.sizes.counts(pixels)
        return faces + _tubes(self.flora, self.portions, transition, real), facets

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


def _layers(number: NDArray[np.float64], portions: Portions) -> NDArray[np.int64]:
    """Layer (n,) of portions with so many polygons and facets (n,).

    What no point tells about is a layer of its own: it has almost nothing within the view, or very much.
    """
    layer = np.log(np.maximum(number, 1.0)) / np.log(_LAYER)
    return np.where(portions.within >= 1.0, np.floor(layer), -1.0).astype(np.int64)


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
