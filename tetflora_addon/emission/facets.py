# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to the facets of proxies, block by block, and to microspheres in their place; `forms` makes buffers.

Microspheres are opaque spheres, the particles of the paper's volumes (section 7). A facet covers the more the more it
faces the eye; a sphere covers the same from everywhere. A sphere can therefore cover what its facet covers for the
camera, but not for all lights as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays
from ..buffers import BLOCK_POLYGONS, PointBuffers
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..growth.branches import Branches
from ..proxies.facet_sizes import HIDDEN_LEAVES, coarseness, piece_facet_sizes, subplant_facet_sizes
from ..proxies.facet_weights import facet_weights
from ..proxies.microsurfaces import Facets, concatenate_facets, kept_out_of_view, piece_facets, subplant_facets
from ..refinement.contents import Contents
from ..refinement.decisions import Decision
from ..refinement.descent import OPENED_AT_ONCE
from ..refinement.loop import SLACK, Refinement
from ..subplants.pieces import Pieces, chunks, open_subplants
from .plants import Transition
from .polygons import polygon_facets

#: Approximate number of facets that are made at a time; thick wood close to the eye is cut into very many.
FACETS_AT_ONCE = 200_000
#: Pixels down to which visible sub-plants are opened; the loop does not open smaller ones either.
DETAIL = SLACK
#: Minimum fraction of a facet's area that its sphere covers, where the facet is seen from its edge.
LEAST_COVER = 0.1
#: Mean of |cos| over all directions.
MEAN_COVER = 0.5

#: Some facets, and whether the camera sees them: neither hidden nor beside the view.
Part = tuple[Facets, bool]


@dataclass(frozen=True)
class Parts:
    """Facets of one species, or of other meshes where that is None."""

    species: int | None
    facets: tuple[Part, ...]

    def __iter__(self) -> Iterator[Part]:
        return iter(self.facets)


def facet_parts(
    flora: Flora, result: Refinement, camera: Camera, facet_pixels: float, transition: Transition | None = None
) -> Iterator[Parts]:
    """Facets of all that is not explicit and of no polygon that is kept as it is; no block is empty.

    Blocks have about `BLOCK_POLYGONS` facets each, so that only one of them is in memory beside Blender's own data.
    Each is of one species, or of other meshes.

    Parameters
    ----------
    flora : Flora
    result : Refinement
    camera : Camera
    facet_pixels : float
        Side of a facet that is seen, in pixels; see `proxies.facet_sizes` for the others.
    transition : Transition, optional
        With it, what is too small in explicit tetrahedra gets facets too, and thick wood elsewhere gets none;
        `plants.explicit_blocks` with the same transition makes the rest.
    """
    parts: list[Part] = []
    current = None
    for species, *made in _facets(flora, result, camera, facet_pixels, transition):
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
    flora: Flora, result: Refinement, camera: Camera, facet_pixels: float, transition: Transition | None
) -> Iterator[tuple[int | None, Facets, bool]]:
    """Facets in runs of about `FACETS_AT_ONCE`, species by species."""
    hidden = result.chosen(Decision.HIDDEN)
    explicit = result.chosen(Decision.EXPLICIT) if transition else np.zeros(len(result.tree), bool)
    contents = result.contents.within(result.chosen(Decision.PROXY, Decision.HIDDEN) | explicit)
    if transition is not None:
        contents = _in_detail(contents, explicit, result.in_view & ~hidden, transition)
    weights, coarse = facet_weights(flora), coarseness(result)
    every = []
    for held, row, sizes_of, weight_of, make in (
        (
            contents.subplants,
            contents.subplants.items.row,
            subplant_facet_sizes,
            weights.of_subplants,
            _of_subplants,
        ),
        (contents.pieces, contents.pieces.items.branches.row, piece_facet_sizes, weights.of_pieces, _of_pieces),
    ):
        things, sizes = held.items, sizes_of(flora, contents, camera, coarse)
        inside, side = result.in_view[held.cell], sizes.sides(facet_pixels)
        weight = weight_of(row, sizes.whole_optical / np.maximum(side[0], 1e-12) ** 2)
        wanted = _Wanted(*side, weight, explicit[held.cell], inside & ~sizes.hidden)
        of_species = flora.rows["species"][row]
        order = np.argsort(of_species, kind="stable")
        first = np.searchsorted(of_species[order], np.arange(len(flora.species) + 1))
        every.append((things, wanted, inside, sizes.counts(facet_pixels) + 1, order, first, make))
    for species in range(len(flora.species)):
        for things, wanted, inside, expected, order, first, make in every:
            own = order[first[species] : first[species + 1]]
            for seen in (True, False):
                for i in _runs(expected, own[inside[own] & (wanted.seen[own] == seen)]):
                    yield species, make(flora, transition, things.take(i), wanted.take(i)), seen
            # Facets beside the view must not reach into the image.
            for i in _runs(expected, own[~inside[own]]):
                made = make(flora, transition, things.take(i), wanted.take(i))
                yield species, kept_out_of_view(made, camera.clearance, HIDDEN_LEAVES**-0.5), False
    proxies = contents.within(~explicit)
    if len(proxies.polygons):
        for facets, seen in polygon_facets(proxies, result, camera, facet_pixels, FACETS_AT_ONCE):
            yield None, facets, seen


def _in_detail(
    contents: Contents, explicit: NDArray[np.bool_], seen: NDArray[np.bool_], transition: Transition
) -> Contents:
    """Contents without what is entirely real, with sub-plants opened where they are seen.

    How far they are opened depends on their own size, not on the tetrahedra that they are in: facets stay the same
    while the division of space changes. Explicit tetrahedra are not divided as far as others anyway.
    """
    flora, camera = transition.flora, transition.camera
    some, cell = contents.subplants.items, contents.subplants.cell
    pieces, piece_cell = [contents.pieces.items], [contents.pieces.cell]
    placed, placed_cell = [], []
    while len(some):
        inside = explicit[cell]
        left = np.flatnonzero(~inside | (transition.of_branches(some) < 1.0))
        some, cell = some.take(left), cell[left]
        bound = flora.sampled_bound[some.row]
        extent = np.maximum(2.0 * bound[:, 0], bound[:, 2] - bound[:, 1]) * some.length
        large = seen[cell] & (extent > DETAIL * camera.extent_around(some.position))
        placed.append(some.take(~large))
        placed_cell.append(cell[~large])
        below, below_cell, large = [Branches.empty()], [cell[:0]], np.flatnonzero(large)
        for start in range(0, len(large), OPENED_AT_ONCE):
            opened = large[start : start + OPENED_AT_ONCE]
            grown, owner, own, own_owner = open_subplants(flora, some.take(opened))
            pieces.append(own)
            piece_cell.append(cell[opened[own_owner]])
            below.append(grown)
            below_cell.append(cell[opened[owner]])
        some, cell = Branches.concatenate(below), np.concatenate(below_cell)
    made = Contents.of(
        flora,
        Branches.concatenate(placed or [Branches.empty()]),
        np.concatenate(placed_cell or [contents.subplants.cell]),
        Pieces.concatenate(pieces),
        np.concatenate(piece_cell),
    )
    return replace(made, polygons=contents.polygons)


@dataclass(frozen=True)
class _Wanted(Arrays):
    """Properties that the facets of sub-plants or pieces (n,) are to have.

    ``leaf`` and ``wood`` are the sides of facets, metres; ``weight`` is the fraction of their area that they get.
    ``explicit`` marks what is in tetrahedra of which polygons are made, and ``seen`` what the camera sees.
    """

    leaf: NDArray[np.float64]
    wood: NDArray[np.float64]
    weight: NDArray[np.float64]
    explicit: NDArray[np.bool_]
    seen: NDArray[np.bool_]

    @property
    def sizes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Sides of facets of leaves and of wood, and the weight."""
        return self.leaf, self.wood, self.weight


def _of_subplants(flora: Flora, transition: Transition | None, subplants: Branches, wanted: _Wanted) -> Facets:
    """Facets of sub-plants; of those in explicit tetrahedra, what is too small to be real."""
    if not wanted.explicit.any():
        return subplant_facets(flora, subplants, *wanted.sizes)
    real = np.where(wanted.explicit, transition.of_branches(subplants), 0.0)
    some = np.flatnonzero(real < 1.0)
    return subplant_facets(flora, subplants.take(some), *wanted.take(some).sizes, real[some])


def _of_pieces(flora: Flora, transition: Transition | None, pieces: Pieces, wanted: _Wanted) -> Facets:
    """Facets of pieces; without thick wood, which is real wherever it is seen."""
    if transition is None:
        return piece_facets(flora, pieces, *wanted.sizes)
    real = np.where(wanted.explicit, transition.of_branches(pieces.branches), 0.0)
    bare = wanted.seen & transition.of_wood(pieces, among_leaves=False)
    tubes = np.where(wanted.explicit, transition.of_wood(pieces), bare)
    some = np.flatnonzero(~tubes | (real < 1.0))
    return piece_facets(flora, pieces.take(some), *wanted.take(some).sizes, real[some], tubes[some])


def _runs(expected: NDArray[np.float64], chosen: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    """Chosen things (m,) in runs of about `FACETS_AT_ONCE` expected facets."""
    for run in chunks(expected[chosen], FACETS_AT_ONCE):
        yield chosen[run]


def spheres(parts: Sequence[tuple[Facets, bool]], camera: Camera, disc: float = np.pi) -> PointBuffers:
    """Spheres in the place of facets, one each, with their colours, transmission and velocity.

    Parameters
    ----------
    parts : sequence of (Facets, bool)
        Facets, and whether the camera sees them. Spheres of those cover what the facets cover for the camera; others,
        which only cast shadows and light up others, cover the mean of their facets over all directions.
    camera : Camera
    disc : float
        Area that a renderer draws for a sphere of radius 1; some draw fewer pixels than a circle has.
    """
    cover = np.concatenate([cover_of(facets, camera if seen else None) for facets, seen in parts])
    facets = concatenate_facets([facets for facets, _ in parts])
    return PointBuffers(
        positions=facets.centre.astype(np.float32),
        radius=(facets.side * np.sqrt(cover / disc)).astype(np.float32),
        attributes={
            "tf_colour": facets.colour.astype(np.float32),
            "tf_transmission": facets.transmission.astype(np.float32),
            **({} if facets.velocity is None else {"velocity": facets.velocity.astype(np.float32)}),
        },
    )


def cover_of(facets: Facets, camera: Camera | None) -> NDArray[np.float64]:
    """Fraction (n,) of a facet's area that its sphere covers; without a camera, the mean over all directions."""
    if camera is None:
        return np.full(len(facets), MEAN_COVER)
    return np.maximum(facing(facets, camera), LEAST_COVER)


def facing(facets: Facets, camera: Camera) -> NDArray[np.float64]:
    """Fraction (n,) of its area that each facet shows to the camera, 0 to 1."""
    if camera.kind == "ORTHO":
        return np.abs(facets.normal @ camera.frame[:, 2])
    ray = facets.centre - camera.eye
    return np.abs(np.einsum("ni,ni->n", facets.normal, ray)) / np.maximum(np.linalg.norm(ray, axis=1), 1e-300)
