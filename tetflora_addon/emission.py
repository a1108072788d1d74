# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to buffers: polygons of what is explicit, block by block.

Blocks are runs of tetrahedra in front-to-back order, so that each is one region of space and one block's buffers at a
time are held in memory. Proxies have files of their own: `facet_emission` and `shell_emission`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .buffers import BLOCK_POLYGONS, MeshBuffers
from .plants.compiled import Flora
from .plants.expansion import chunks, expand
from .plants.growth import trunks
from .plants.meshing import leaf_meshes
from .plants.pieces import Pieces
from .plants.seeds import Seeds
from .plants.species import LEAF_KINDS
from .plants.stems import Stems
from .plants.tubes import tube_buffers
from .refinement.decisions import Decision
from .refinement.loop import Refinement


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
