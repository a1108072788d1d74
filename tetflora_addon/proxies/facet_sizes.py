# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes of the facets that stand for sub-plants, pieces and polygons, and how many that will make.

Facets are about a pixel wide where they are seen. Hidden ones are wider and stand for several leaves, because hidden
plants only cast shadows and light up others. They grow with the depth at which they are hidden and with
the distance from the view.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..compiled.placed import extents
from ..growth.branches import Branches
from ..refinement.contents import Held, Totals
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..refinement.polygons import Polygons

#: How much larger facets of hidden tetrahedra are: where the optical depth in front just hides them, and at most, in
#: proportion to the depth. For the depth alone they are never wider than so many pixels: some of what is deeply hidden
#: shows between crowns after all, and would be blots where a budget makes facets large.
COARSE, COARSEST = 3.0, 18.0
_WIDEST = 3.0
#: The same, in sides of facets that are seen.
_JUST_HIDDEN = 1.5
#: How much larger than `COARSE` facets are from where on a budget may make them as large as it needs.
_DEEP = 4.0
#: Pixels that no facet within the view exceeds, however deep it is, for all that a budget asks.
_BLOT = 8.0
#: One-sided layers of leaves that are enough where nothing is seen, and how much of its box a crown fills.
_LAYERS, _FILLED = 6.0, 0.6
#: Optical depth from which on fewer facets are enough, as little light comes from there, and the least fraction.
_DEEPEST, _LEAST_KEPT = 6.0, 0.15
#: Factor on hidden facets beyond which these limits give way: within the view by no more than a factor, from which on
#: facets of what is deeply hidden are left out, but no more of them than so many.
_LOOSE, _GIVES_WAY, _LEFT = 16.0, 1.5, 0.2
#: Largest side of facets beside the view over their distance from it; metres that count least, and from which on it
#: grows faster.
_BESIDE = 0.1, 8.0, 15.0
#: The same of those that throw shadows into the view, over the metres that these fall, and the metres that count least.
_THROWN, _SHARP = 0.02, 1.0
#: Powers of the visibility by which facets are larger where they are seen in part: of those within a pixel each then
#: draws as much of the image; of larger ones those that do show must not be blots. The visibility that counts least.
FADING, LEAST_VISIBILITY = (0.5, 0.3), 0.08
#: Sides of facets of wood, however little is seen of it, over those that are seen well.
_SHARD = 1.7
_HIDING_DEPTH = 4.0  # e^−4 = .02 is left
#: Side of facets per metre from the view: the sun is .0093 radians wide, so their shadows are half as soft as large.
_SOFT = 0.02
#: Facets that a sub-plant keeps, about, however far it is from the view.
_FEWEST = 8
#: Leaves that one of them stands for at least.
HIDDEN_LEAVES = 8
#: Leaves' faces of explicit polygons that a hidden facet stands for.
HIDDEN_FACES = 4


@dataclass(frozen=True)
class FacetPixels:
    """Sides of facets: in pixels where they are seen, and what multiplies those of hidden ones."""

    seen: float
    hidden: float = 1.0


@dataclass(frozen=True)
class FacetSizes(Arrays):
    """What determines sizes and numbers of facets of parts of plants.

    Attributes
    ----------
    extent : (n,) float64
        Metres that a pixel spans.
    one_leaf : (n,) float64
        Area of a leaf, m².
    least_wood : (n,) float64
        Side of facets that are as many as the faces of the wood, metres.
    visibility : (n,) float64
        Fraction of light that nothing in front blocks; 0 where nothing is seen.
    coarse : (n,) float64
        How much larger than seen ones facets are where nothing is seen.
    clearance : (n,) float64
        Metres from the space that the image shows; negative within.
    shadow : (n,) float64
        Metres from there to where its shadow enters that space, infinite where it does not.
    totals : Totals of n
    part : (n,) float64
        Which part of a branch, or of a sub-plant, each is.
    kept : (n,) float64
        Fraction of the area that is enough where nothing is seen, see `opaque_fractions`.
    """

    extent: NDArray[np.float64]
    one_leaf: NDArray[np.float64]
    least_wood: NDArray[np.float64]
    visibility: NDArray[np.float64]
    coarse: NDArray[np.float64]
    clearance: NDArray[np.float64]
    shadow: NDArray[np.float64]
    totals: Totals
    part: NDArray[np.float64]
    kept: NDArray[np.float64]

    @property
    def hidden(self) -> NDArray[np.bool_]:
        """Things (n,) that are not seen."""
        return self.visibility <= 0.0

    @property
    def whole_optical(self) -> NDArray[np.float64]:
        """Optical area (n,) of the whole of which each is a part, m²."""
        return self.totals.optical_area / np.maximum(self.part, 1e-12)

    def sides(self, pixels: FacetPixels) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Sides (n,), (n,) of facets of leaves and of wood, metres."""
        side = _seen_pixels(self.visibility, pixels.seen) * self.extent
        coarse = np.minimum(self.coarse * pixels.seen, max(_JUST_HIDDEN * pixels.seen, _WIDEST)) * self.extent
        blurred = np.minimum(_SOFT * np.maximum(self.clearance, 0.0), np.sqrt(self.totals.optical_area / _FEWEST))
        # Near the camera, some leaves together are large in the image, and what is hidden shows between others; beside
        # the view the shape of their shadow does.
        several, thrown = np.sqrt(HIDDEN_LEAVES * self.one_leaf), _THROWN * np.maximum(self.shadow, _SHARP)
        leaves = np.minimum(several, np.where(self.clearance > 0.0, thrown, _BLOT * self.extent))
        unseen = np.maximum(np.maximum(coarse, blurred), leaves)
        # What is only just hidden shows between crowns after all, and would be blots.
        deep = self._deep
        beside = self.clearance > 0.0
        near, nearest, far = _BESIDE
        away = np.maximum(self.clearance, nearest)
        most = np.where(beside, np.minimum(near * away * (1.0 + (away / far) ** 2), thrown), 0.0)
        blot = np.minimum((np.maximum(self.coarse, COARSE) / COARSE) ** 1.5 * max(_WIDEST, pixels.seen), _BLOT)
        # Where a forest has too many even so, these limits give way; within the view not far, or there would be shards.
        over = max(pixels.hidden / _LOOSE, 1.0)
        most = np.where(beside, over * most, min(over, _GIVES_WAY) * blot * self.extent)
        # Beside the view they must not reach into it, or they would lose area.
        unseen = np.clip(pixels.hidden ** np.where(beside, 1.0, deep) * unseen, unseen, np.maximum(unseen, most))
        # Wood is lighter or darker than leaves: where it shows after all, a large facet of it is a shard.
        shard = _SHARD * max(pixels.seen, 1.0) * np.where(self.hidden, min(over, _GIVES_WAY), 1.0) * self.extent
        wood = np.minimum(side, shard)
        side = np.where(self.hidden, unseen, side)
        # Out of view wood is cut into no more facets than it has faces. Elsewhere it is cut as fine as the side
        # requires, or thin twigs would become blots.
        least = np.minimum(self.least_wood, np.where(beside, thrown, shard))
        finest = np.where(beside, side, np.minimum(side, shard))
        wood = np.where(self.hidden, np.maximum(finest, least), wood)
        return np.maximum(side, np.sqrt(self.one_leaf)), wood

    def counts(self, pixels: FacetPixels) -> NDArray[np.float64]:
        """Expected number (n,) of facets."""
        leaf, wood = self.sides(pixels)
        # Branches are closed: half of their surface is never seen.
        leaves = self.totals.leaf_area / np.maximum(leaf, 1e-12) ** 2
        number = leaves + self.totals.wood_area / 2 / np.maximum(wood, 1e-12) ** 2
        return np.where(self.hidden, self.enough(pixels), 1.0) * number

    @property
    def _deep(self) -> NDArray[np.float64]:
        """How surely (n,) nothing shows of what is hidden, 0 to 1."""
        return np.clip((self.coarse - COARSE) / _DEEP, 0.0, 1.0)

    def enough(self, pixels: FacetPixels) -> NDArray[np.float64]:
        """Fraction (n,) of the facets of what is not seen that are made."""
        over = max(pixels.hidden / _LOOSE / _GIVES_WAY, 1.0)
        left = np.where(self.clearance > 0.0, 1.0, max(over**-2.0, _LEFT) ** self._deep)
        depth = np.where(self.clearance > 0.0, COARSE, self.coarse) / COARSE * _HIDING_DEPTH
        return left * self.kept * np.clip(_DEEPEST / np.maximum(depth, _HIDING_DEPTH), _LEAST_KEPT, 1.0)


@dataclass(frozen=True)
class PolygonFacetSizes:
    """What determines sizes and numbers of facets of explicit polygons.

    Attributes
    ----------
    extent : (n,) float64
        Metres that a pixel spans.
    face : (n,) float64
        Area of the face that each is, or is a fragment of, m².
    leaf, hidden : (n,) bool
        Faces of leaves; faces that are not seen.
    optical : (n,) float64
        Area that facets stand for, m²: of solids half, as the far side is never seen.
    solid : (n,) bool
    """

    extent: NDArray[np.float64]
    face: NDArray[np.float64]
    leaf: NDArray[np.bool_]
    hidden: NDArray[np.bool_]
    optical: NDArray[np.float64]
    solid: NDArray[np.bool_]

    def sides(self, pixels: float) -> NDArray[np.float64]:
        """Sides (n,) of facets, metres, where those of plants that are seen have so many pixels."""
        fine = pixels * self.extent
        coarse = COARSE * fine
        coarse = np.where(self.leaf, np.maximum(coarse, np.sqrt(HIDDEN_FACES * self.face)), coarse)
        return np.where(self.hidden, coarse, fine)

    def kept(self, pixels: float) -> NDArray[np.bool_]:
        """Polygons (n,) that are drawn as they are: a facet or more would take their place."""
        return self.face * np.where(self.solid, 0.5, 1.0) >= self.sides(pixels) ** 2

    def counts(self, pixels: float) -> NDArray[np.float64]:
        """Expected number (n,) of faces."""
        return np.where(self.kept(pixels), 1.0, self.optical / np.maximum(self.sides(pixels), 1e-12) ** 2)


def _seen_pixels(visibility: NDArray[np.float64], pixels: float) -> NDArray[np.float64]:
    """Sides (n,) in pixels of facets of which a fraction (n,) is seen, where those that nothing hides have so many."""
    small, large = (pixels * np.maximum(visibility, LEAST_VISIBILITY) ** -power for power in FADING)
    return np.minimum(small, np.maximum(large, 1.0))


def coarseness(result: Refinement) -> NDArray[np.float64]:
    """How much larger facets are (nodes,) than where they are seen: 1 there, `COARSE` to `COARSEST` where hidden.

    In proportion to the optical depth in front, −ln of the transmittance that the visibility step finds (paper, section
    6.3). Beside the view, where nothing is in front, `COARSE`; there `FacetSizes.clearance` makes them larger.
    """
    with np.errstate(divide="ignore"):
        deep = np.clip(-COARSE / _HIDING_DEPTH * np.log(result.transmittance), COARSE, COARSEST)
    coarse = np.full(len(result.tree), COARSE)
    coarse[result.nodes] = deep
    coarse[~result.in_view] = COARSE
    return np.where(result.chosen(Decision.HIDDEN), coarse, 1.0)


def polygon_facet_sizes(held: Held[Polygons], camera: Camera, hidden: NDArray[np.bool_]) -> PolygonFacetSizes:
    """Facets of polygons (n,); ``hidden`` (nodes,) marks nodes that are not seen."""
    own, totals = held.items, held.totals
    meshes = own.meshes
    return PolygonFacetSizes(
        camera.extent_around(own.centre),
        meshes.face_areas(own.face, own.instance),
        meshes.leaf[own.face],
        hidden[held.cell],
        totals.optical_area,
        meshes.solid[own.face],
    )


def opaque_fractions(flora: Flora, own: Branches, totals: Totals) -> NDArray[np.float64]:
    """Fraction (n,) of the optical area of sub-plants that makes them opaque to all but a few hundredths of light.

    A spruce has twenty layers of needles across its crown. Where it is hidden, the first of them cast its shadow.
    """
    bound = extents(flora, own, farthest=False)
    silhouette = _FILLED * 2.0 * bound[:, 0] * (bound[:, 2] - bound[:, 1]) * own.length**2
    return np.minimum(_LAYERS * silhouette / np.maximum(totals.optical_area, 1e-300), 1.0)
