# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The refinement step: what becomes of each terminal tetrahedron that holds something (paper, section 6.4)."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Integers, Mask, column, nested, smoothstep
from ..camera.camera import Camera
from ..tetrahedra.geometry import squared_edges, volume
from ..tetrahedra.tree import TetrahedralTree
from .contents import Totals
from .settings import RefinementSettings
from .visibility import AlphaBuffer

#: Longest edge, in sides of a block, from which on what crosses the border of the view is divided for its unseen part.
ACROSS_THE_BORDER = 1.5
#: Fraction of all cells, fraction of the image, and polygons, for which a pass of the loop is not worth its time.
FEW, NO_GAIN, NO_POLYGONS = 0.005, 0.002, 20_000
#: Of a tetrahedron of more blocks than this on each side, too little is known to make it explicit.
UNKNOWN = 4.0
#: How much smaller than the limit leaves are at the far end of a tetrahedron that is divided for it.
DEEP = 1.5
#: Width from which on all leaves are real over the width up to which none is.
BAND = 2.5


def explicit_fraction(pixels: Floats, limit: float) -> Floats:
    """Fraction (n,) of leaves that are real by their width (n,) in pixels: a smooth step in its logarithm.

    It is 0 up to a limit in pixels and 1 from `BAND` times that on (beyond the paper, which switches at once).
    """
    return smoothstep(np.log(np.maximum(pixels, 1e-300) / limit) / np.log(BAND))


class Decision(IntEnum):
    """What is done with a terminal tetrahedron."""

    EMPTY = 0
    PROXY = 1  # small in the image: drawn as an approximation
    HIDDEN = 2  # not seen, or hardly: a coarse approximation
    EXPLICIT = 3  # polygons are made of all in it
    SPLIT = 4


@dataclass(frozen=True)
class Terminals(Arrays):
    """Terminal tetrahedra that hold something, and what is known of each until it is divided."""

    nodes: Integers = column(dtype=np.int64)  # (n,): their nodes in the tree
    totals: Totals = nested(Totals)  # of n
    #: pixels and opacity, (n,): as in `visibility.Outline`.
    pixels: Floats
    opacity: Floats
    feature_px: Floats  # (n,): width in pixels of what they hold, where it is nearest to the eye
    min_feature_px: Floats  # (n,): the same where it is farthest away
    longest_edge_px: Floats  # (n,): longest edge in pixels at their distance
    #: (n,): whether all of each is in view. What crosses the border has the pixels of its visible part only.
    fully_inside: Mask = column(dtype=bool)

    @classmethod
    def seen(cls, tree: TetrahedralTree, nodes: Integers, totals: Totals, camera: Camera, buffer: AlphaBuffer) -> Self:
        """Draw tetrahedra ``nodes`` (n,) of the tree into the alpha buffer and keep what it finds for each."""
        vertices = tree.vertices(nodes)
        outline = buffer.add(nodes, vertices, mean_extinction(totals, volume(vertices)))
        span = np.sqrt(squared_edges(vertices).max(axis=1)) / camera.extent_around(vertices.mean(axis=1))
        features = feature_pixels(vertices, totals.width, camera)
        return cls(nodes, totals, outline.pixels, outline.opacity, *features, span, outline.fully_inside)


def mean_extinction(totals: Totals, volumes: Floats) -> Floats:
    """Extinction κ (n,) of tetrahedra in 1/m, as if surfaces faced all ways.

    Notes
    -----
    Randomly turned, a leaf shows half its one-sided area and a closed branch a quarter of its surface (Cauchy 1832).
    """
    return (totals.leaf_area / 2 + totals.wood_area / 4) / volumes


def feature_pixels(vertices: Floats, width: Floats, camera: Camera) -> tuple[Floats, Floats]:
    """Widths (n,) in meters as pixels, where tetrahedra (n, 4, 3) are nearest to the eye and where farthest."""
    extent = camera.pixel_extent(vertices)
    return width / extent.min(axis=1), width / extent.max(axis=1)


def decide(cells: Terminals, transmittance: Floats, settings: RefinementSettings) -> NDArray[np.int8]:
    """Values (n,) of `Decision` for terminal tetrahedra (n,).

    ``transmittance`` (n,) is the fraction of each one's light that nothing in front blocks; 0 out of view.

    Notes
    -----
    A tetrahedron's *contribution* is the number of pixels that its contents change: its pixels × the fraction of them
    that is not hidden × its own opacity. Of leaves wider than ``leaf_limit`` pixels some are drawn as leaves. A
    tetrahedron full of them is divided down to ``block`` pixels to find its hidden parts, and in depth until they are
    about as large at its far end. Then it is made explicit; `emission.plants.Transition` picks the real leaves in it.

    What crosses the border of the view counts by its visible part. That may be small while the tetrahedron is not: then
    it is divided until the rest is out of view, or all of it would be made as fine as the visible part.
    """
    totals = cells.totals
    holds = totals.area > 0
    hidden = transmittance <= settings.hidden  # out of view: transmittance is 0
    large_leaves = cells.feature_px >= settings.leaf_limit
    few = totals.polygons <= settings.few_polygons
    # Leaves that are large at the near end may be tiny at the far end, as in all of a small image's view.
    deep = large_leaves & (cells.min_feature_px < settings.leaf_limit / DEEP) & ~few
    crossing = ~cells.fully_inside & ~few & (cells.longest_edge_px > ACROSS_THE_BORDER * settings.block)
    no_gain = few | ((cells.pixels <= settings.block**2) & ~crossing)
    small = (contributions(cells, transmittance) <= settings.cutoff**2) & ~crossing
    # Facets take their places from the plants, not from their tetrahedra, which only tell how much is seen.
    done = small | (no_gain & (cells.pixels <= settings.block**2)) if np.isinf(settings.proxy_block) else small
    out = np.full(len(holds), Decision.SPLIT, dtype=np.int8)
    # Large leaves never become a proxy: a barely visible block of them is divided until its hidden parts show.
    out[done & ~large_leaves & (cells.longest_edge_px <= settings.proxy_block)] = Decision.PROXY
    out[large_leaves & no_gain & (~deep | small)] = Decision.EXPLICIT
    out[hidden] = Decision.HIDDEN
    out[hidden & (cells.longest_edge_px > settings.hidden_block)] = Decision.SPLIT
    out[~holds] = Decision.EMPTY
    return out


def contributions(cells: Terminals, transmittance: Floats) -> Floats:
    """Pixels (n,) that the contents of tetrahedra change."""
    return cells.pixels * transmittance * cells.opacity


def gains_nothing(splitting: Mask, cells: Terminals, transmittance: Floats, camera: Camera) -> bool:
    """Whether dividing some cells, a mask (n,), changes few pixels, by transmittance (n,), and few polygons."""
    if splitting.sum() > FEW * len(cells):
        return False
    gain = contributions(cells, transmittance)[splitting].sum() / (camera.width * camera.height)
    return bool(gain <= NO_GAIN and cells.totals.polygons[splitting].sum() <= NO_POLYGONS)


def without_splits(
    decision: NDArray[np.int8], cells: Terminals, transmittance: Floats, settings: RefinementSettings
) -> NDArray[np.int8]:
    """Decisions (n,) without divisions, where a limit forbids them: leaves of a pixel stay leaves.

    Very many leaves in a tetrahedron that is still large become a proxy: most may be far away or hidden.
    """
    leafy = cells.feature_px >= settings.leaf_limit
    known = (cells.pixels <= (UNKNOWN * settings.block) ** 2) | (cells.totals.polygons <= NO_POLYGONS)
    instead = np.where(leafy & known, Decision.EXPLICIT, Decision.PROXY)
    instead = np.where(transmittance <= settings.hidden, Decision.HIDDEN, instead)
    return np.where(decision == Decision.SPLIT, instead, decision).astype(np.int8)
