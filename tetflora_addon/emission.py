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
from .refinement.contents import Contents
from .refinement.decisions import Decision
from .refinement.loop import Refinement
from .refinement.transition import Transition


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


def explicit_blocks(flora: Flora, result: Refinement, transition: Transition | None = None) -> Iterator[Block]:
    """Polygons of all tetrahedra that are flagged for them, and thick wood of those that are drawn as proxies.

    With a transition, leaves that are small all the same are left to facets, by a number of each one's own.
    """
    explicit = result.decision == Decision.EXPLICIT
    nodes, rank, polygons = result.nodes, result.rank, np.where(explicit, result.amounts.polygons, 0.0)
    wood = Contents() if transition is None else _thick_wood(result, transition)
    number_of = np.full(len(result.tree), -1, dtype=np.int64)
    number_of[nodes] = np.arange(len(nodes))
    tubes = np.bincount(number_of[wood.pieces.cell], flora.rows["sides"][wood.pieces.items.branches.row], len(nodes))
    polygons = polygons + tubes
    order = np.argsort(rank, kind="stable")
    order = order[explicit[order] | (tubes[order] > 0)]
    block_of_node = np.full(len(result.tree), -1, dtype=np.int64)
    runs = list(chunks(polygons[order], BLOCK_POLYGONS))
    for number, run in enumerate(runs):
        block_of_node[nodes[order[run]]] = number
    contents = result.contents.within(result.chosen(Decision.EXPLICIT))
    of_subplant, of_piece = block_of_node[contents.subplants.cell], block_of_node[contents.pieces.cell]
    of_wood = block_of_node[wood.pieces.cell]
    for number in range(len(runs)):
        cut = contents.pieces.items.take(of_piece == number)
        whole = contents.subplants.items.take(of_subplant == number)
        bare = wood.pieces.items.take(of_wood == number)
        yield from _block(flora, cut, list(expand(flora, whole)), number, (number + 1) / len(runs), bare, transition)


def _thick_wood(result: Refinement, transition: Transition) -> Contents:
    """Pieces of branches that are wide enough to be seen where all else is drawn as proxies."""
    contents = result.contents.within(result.chosen(Decision.PROXY) & result.in_view)
    return Contents(pieces=contents.pieces.take(transition.of_wood(contents.pieces.items, among_leaves=False)))


def expanded_blocks(flora: Flora, seeds: Seeds) -> Iterator[Block]:
    """Polygons of all plants, whatever the camera sees; for comparison."""
    plants = trunks(flora.rows, seeds)
    runs = list(chunks(flora.polygons[plants.row], BLOCK_POLYGONS))
    for number, run in enumerate(runs):
        whole = list(expand(flora, plants.take(run)))
        yield from _block(flora, Pieces.empty(), whole, number, (number + 1) / len(runs))


def _block(
    flora: Flora,
    pieces: Pieces,
    stems: list[Stems],
    number: int,
    fraction: float,
    bare: Pieces | None = None,
    transition: Transition | None = None,
) -> Iterator[Block]:
    """Meshes of pieces and stems of any species, and of the wood alone of others."""
    bare = Pieces.empty() if bare is None else bare
    of_pieces, of_bare = flora.species_of(pieces.branches.row), flora.species_of(bare.branches.row)
    of_stems = [flora.species_of(some.branches.row) for some in stems]
    share_of = None if transition is None else transition.of_branches
    made: list[tuple[str, int, int, MeshBuffers | None]] = []
    for s in np.unique(np.concatenate([of_pieces, of_bare, *of_stems])):
        cut = pieces.take(of_pieces == s)
        whole = [some.take(species == s) for some, species in zip(stems, of_stems, strict=True)]
        leaves = leaf_meshes(flora, cut, int(s), whole, share_of)
        made += [(LEAF_KINDS[m.kind], m.form, int(s), m.buffers) for m in leaves]
        if transition is not None:
            cut = cut.take(transition.of_wood(cut))
            whole = [some.take(transition.of_twigs(some.branches)) for some in whole]
        cut = Pieces.concatenate([cut, bare.take(of_bare == s)])
        made.append(("bark", 0, int(s), tube_buffers(flora, cut, whole)))
        del cut, whole
    # Whoever takes a block copies it into Blender: what it was made from, and what was taken, is not kept meanwhile.
    del pieces, stems, bare
    while made:
        kind, form, s, buffers = made.pop(0)
        if buffers is not None:
            yield Block(kind, form, s, number, buffers, fraction)
        del buffers
