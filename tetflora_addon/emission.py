# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to buffers: polygons of what is explicit, block by block, and proxies of the rest.

Blocks are runs of tetrahedra in front-to-back order, so that each is one region of space and one block's buffers at a
time are held in memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .buffers import BLOCK_POLYGONS, MeshBuffers, PointBuffers
from .plants.compiled import Flora
from .plants.expansion import chunks, expand
from .plants.growth import trunks
from .plants.meshing import leaf_meshes
from .plants.pieces import Pieces
from .plants.seeds import Seeds
from .plants.species import LEAF_KINDS
from .plants.stems import Stems
from .plants.tubes import tube_buffers
from .refinement.camera import Camera
from .refinement.decisions import Decision
from .refinement.loop import Refinement
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
from .shading.shells import shell_buffers
from .shading.summaries import extinction_matrices, summarise
from .tetrahedra.geometry import volume

#: Facets that are made at a time, about; thick wood close to the eye is cut into very many.
FACETS_AT_ONCE = 200_000


@dataclass(frozen=True)
class Block:
    """One mesh of a block of space.

    Attributes
    ----------
    kind : {'leaf', 'blossom', 'bark'}
    form : int
        Which of the species' forms of leaves or blossoms.
    species : int
        Index into the flora's species.
    number : int
        Of the block, front to back.
    buffers : MeshBuffers
    fraction : float
        Share of all polygons that is done with this block.
    """

    kind: str
    form: int
    species: int
    number: int
    buffers: MeshBuffers
    fraction: float


def explicit_blocks(flora: Flora, result: Refinement) -> Iterator[Block]:
    """Polygons of all tetrahedra that are flagged for them."""
    explicit = result.decision == Decision.EXPLICIT
    nodes, rank, polygons = (a[explicit] for a in (result.nodes, result.rank, result.amounts.polygons))
    order = np.argsort(rank)
    block_of_node = np.full(len(result.tree), -1, dtype=np.int64)
    runs = list(chunks(polygons[order], BLOCK_POLYGONS))
    for number, run in enumerate(runs):
        block_of_node[nodes[order[run]]] = number
    contents = result.contents.within(block_of_node >= 0)
    of_subplant, of_piece = block_of_node[contents.subplant_cell], block_of_node[contents.piece_cell]
    for number in range(len(runs)):
        cut, whole = contents.pieces.take(of_piece == number), contents.subplants.take(of_subplant == number)
        yield from _block(flora, cut, list(expand(flora, whole)), number, (number + 1) / len(runs))


def expanded_blocks(flora: Flora, seeds: Seeds) -> Iterator[Block]:
    """Polygons of all plants, whatever the camera sees; for comparison."""
    plants = trunks(flora.rows, seeds)
    runs = list(chunks(flora.polygons[plants.row], BLOCK_POLYGONS))
    for number, run in enumerate(runs):
        whole = list(expand(flora, plants.take(run)))
        yield from _block(flora, Pieces.empty(), whole, number, (number + 1) / len(runs))


def _block(flora: Flora, pieces: Pieces, stems: list[Stems], number: int, fraction: float) -> Iterator[Block]:
    of_pieces = flora.species_of(pieces.branches.row)
    of_stems = [flora.species_of(some.branches.row) for some in stems]
    made: list[tuple[str, int, int, MeshBuffers | None]] = []
    for s in np.unique(np.concatenate([of_pieces, *of_stems])):
        cut = pieces.take(of_pieces == s)
        whole = [some.take(species == s) for some, species in zip(stems, of_stems, strict=True)]
        made += [(LEAF_KINDS[m.kind], m.form, int(s), m.buffers) for m in leaf_meshes(flora, cut, int(s), whole)]
        made.append(("bark", 0, int(s), tube_buffers(flora, cut, whole)))
        del cut, whole
    # Whoever takes a block copies it into Blender: what it was made from, and what was taken, is not kept meanwhile.
    del pieces, stems
    while made:
        kind, form, s, buffers = made.pop(0)
        if buffers is not None:
            yield Block(kind, form, s, number, buffers, fraction)
        del buffers


def facet_blocks(flora: Flora, result: Refinement, camera: Camera, facet_pixels: float = 0.6) -> Iterator[MeshBuffers]:
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
    for parts in _facet_parts(flora, result, camera, facet_pixels):
        yield facet_mesh(concatenate_facets([facets for facets, _ in parts]))


def sphere_blocks(
    flora: Flora, result: Refinement, camera: Camera, facet_pixels: float = 0.6, disc: float = np.pi
) -> Iterator[PointBuffers]:
    """Proxies as microspheres, one for each facet of `facet_blocks`; parameters and size of blocks are the same.

    What is drawn of a sphere of radius 1 has the area ``disc``, see `shading.microspheres`.
    """
    for parts in _facet_parts(flora, result, camera, facet_pixels):
        yield spheres(parts, camera, disc)


#: Some facets, and whether the camera sees them: neither hidden nor beside the view.
_Part = tuple[Facets, bool]


def _facet_parts(flora: Flora, result: Refinement, camera: Camera, facet_pixels: float) -> Iterator[list[_Part]]:
    """Facets in blocks of about `BLOCK_POLYGONS`, none of them empty."""
    parts: list[_Part] = []
    for made in _facets(flora, result, camera, facet_pixels):
        if len(made[0]):
            parts.append(made)
        if sum(len(facets) for facets, _ in parts) >= BLOCK_POLYGONS:
            yield parts
            parts = []
    if parts:
        yield parts


def _facets(flora: Flora, result: Refinement, camera: Camera, facet_pixels: float) -> Iterator[_Part]:
    """Facets in runs of about `FACETS_AT_ONCE`."""
    contents = result.contents.within(result.chosen(Decision.PROXY, Decision.HIDDEN))
    hidden = result.chosen(Decision.HIDDEN)
    for things, cell, make, sizes_of in (
        (contents.subplants, contents.subplant_cell, subplant_facets, subplant_facet_sizes),
        (contents.pieces, contents.piece_cell, piece_facets, piece_facet_sizes),
    ):
        sizes = sizes_of(flora, contents, camera, hidden)
        leaf, wood = sizes.sides(facet_pixels)
        expected = sizes.counts(facet_pixels) + 1
        inside = result.in_view[cell]
        for nobody_looks in (False, True):
            for i in _runs(expected, np.flatnonzero(inside & (sizes.hidden == nobody_looks))):
                yield make(flora, things.take(i), leaf[i], wood[i]), not nobody_looks
        # What is beside the view must not reach into the picture.
        for i in _runs(expected, np.flatnonzero(~inside)):
            made = make(flora, things.take(i), leaf[i], wood[i])
            yield kept_out_of_view(made, camera.clearance, HIDDEN_LEAVES**-0.5), False
    if len(contents.polygons):
        yield from polygon_facets(contents, result, camera, facet_pixels)


def _runs(expected: NDArray[np.float64], chosen: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    """Chosen things (m,) in runs of about `FACETS_AT_ONCE` expected facets."""
    for run in chunks(expected[chosen], FACETS_AT_ONCE):
        yield chosen[run]


def proxy_shells(flora: Flora, result: Refinement) -> MeshBuffers | None:
    """Proxies as shells: the tetrahedra themselves, filled with a cloud of their extinction, colour and orientation.

    Tetrahedra that hold nothing but large polygons have an extinction of 0.
    """
    proxies = np.isin(result.decision, (Decision.PROXY, Decision.HIDDEN))
    nodes = result.nodes[proxies]
    if len(nodes) == 0:
        return None
    index = np.full(len(result.tree), -1, dtype=np.int64)
    index[nodes] = np.arange(len(nodes))
    contents = result.contents
    # Large polygons are drawn as they are; a fog in their place would be no wall.
    fine = np.isfinite(contents.polygon_amounts.width)
    if not fine.all():
        contents = contents.take(*(np.ones(len(c), bool) for c in contents.cells[:2]), fine)
    summaries = summarise(flora, contents, index, len(nodes))
    vertices = result.tree.vertices(nodes)
    matrices, normal, plane = extinction_matrices(summaries, volume(vertices))
    return shell_buffers(vertices, summaries.colour, summaries.transmission, matrices, normal, plane)
