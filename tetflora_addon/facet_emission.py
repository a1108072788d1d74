# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to buffers: proxies as facets or as microspheres, block by block."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .buffers import BLOCK_POLYGONS, MeshBuffers, PointBuffers
from .plants.compiled import Flora
from .plants.expansion import chunks
from .refinement.camera import Camera
from .refinement.decisions import Decision
from .refinement.loop import Refinement
from .shading.facet_shares import facet_shares
from .shading.facet_sizes import HIDDEN_LEAVES, piece_facet_sizes, subplant_facet_sizes
from .shading.microspheres import spheres
from .shading.microsurfaces import (
    Facets,
    concatenate_facets,
    facet_mesh,
    kept_out_of_view,
    piece_facets,
    subplant_facets,
)
from .shading.polygon_facets import polygon_facets

#: Facets that are made at a time, about; thick wood close to the eye is cut into very many.
FACETS_AT_ONCE = 200_000


def facet_blocks(flora: Flora, result: Refinement, camera: Camera, facet_pixels: float = 0.4) -> Iterator[MeshBuffers]:
    """Proxies as microsurfaces: facets of all that is not explicit, and of no polygon that is kept as it is.

    Meshes have about `BLOCK_POLYGONS` facets each, so that only one of them is held at a time beside Blender's own.

    Parameters
    ----------
    flora : Flora
    result : Refinement
    camera : Camera
    facet_pixels : float
        Side of a facet that is seen, in pixels; see `shading.facet_sizes` for the others.
    """
    for parts in facet_parts(flora, result, camera, facet_pixels):
        yield facet_mesh(concatenate_facets([facets for facets, _ in parts]))


def sphere_blocks(
    flora: Flora, result: Refinement, camera: Camera, facet_pixels: float = 0.4, disc: float = np.pi
) -> Iterator[PointBuffers]:
    """Proxies as microspheres, one for each facet of `facet_blocks`; parameters and size of blocks are the same.

    What is drawn of a sphere of radius 1 has the area ``disc``, see `shading.microspheres`.
    """
    for parts in facet_parts(flora, result, camera, facet_pixels):
        yield spheres(parts, camera, disc)


#: Some facets, and whether the camera sees them: neither hidden nor beside the view.
Part = tuple[Facets, bool]


def facet_parts(flora: Flora, result: Refinement, camera: Camera, facet_pixels: float) -> Iterator[list[Part]]:
    """Facets in blocks of about `BLOCK_POLYGONS`, none of them empty."""
    parts: list[Part] = []
    for made in _facets(flora, result, camera, facet_pixels):
        if len(made[0]):
            parts.append(made)
        if sum(len(facets) for facets, _ in parts) >= BLOCK_POLYGONS:
            yield parts
            parts = []
    if parts:
        yield parts


def _facets(flora: Flora, result: Refinement, camera: Camera, facet_pixels: float) -> Iterator[Part]:
    """Facets in runs of about `FACETS_AT_ONCE`."""
    contents = result.contents.within(result.chosen(Decision.PROXY, Decision.HIDDEN))
    hidden, shares = result.chosen(Decision.HIDDEN), facet_shares(flora)
    subplants, pieces = contents.subplants, contents.pieces
    for things, row, cell, sizes, make, share_of in (
        (
            subplants,
            subplants.row,
            contents.subplant_cell,
            subplant_facet_sizes(flora, contents, camera, hidden),
            subplant_facets,
            shares.of_subplants,
        ),
        (
            pieces,
            pieces.branches.row,
            contents.piece_cell,
            piece_facet_sizes(flora, contents, camera, hidden),
            piece_facets,
            shares.of_pieces,
        ),
    ):
        leaf, wood = sizes.sides(facet_pixels)
        share = share_of(row, sizes.whole_optical / np.maximum(leaf, 1e-12) ** 2)
        expected = sizes.counts(facet_pixels) + 1
        inside = result.in_view[cell]
        for nobody_looks in (False, True):
            for i in _runs(expected, np.flatnonzero(inside & (sizes.hidden == nobody_looks))):
                yield make(flora, things.take(i), leaf[i], wood[i], share[i]), not nobody_looks
        # What is beside the view must not reach into the picture.
        for i in _runs(expected, np.flatnonzero(~inside)):
            made = make(flora, things.take(i), leaf[i], wood[i], share[i])
            yield kept_out_of_view(made, camera.clearance, HIDDEN_LEAVES**-0.5), False
    if len(contents.polygons):
        yield from polygon_facets(contents, result, camera, facet_pixels)


def _runs(expected: NDArray[np.float64], chosen: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    """Chosen things (m,) in runs of about `FACETS_AT_ONCE` expected facets."""
    for run in chunks(expected[chosen], FACETS_AT_ONCE):
        yield chosen[run]
