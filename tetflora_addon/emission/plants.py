# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to buffers: polygons of explicit plants, block by block, and the transition from leaves to facets.

Blocks are runs of tetrahedra in front-to-back order: each is one region of space, and only one block's buffers are in
memory at a time. Proxies are in `facets` and `shells`.

A leaf whose width in pixels is below the limit is a facet, one that is wider by `BAND` is real, and in between
a fraction of them is real that grows with the width. Real leaves and facets are thinned out by hashes of their own
keys: what has become real stays real as the camera comes closer, nothing pops, and the area is the same on average.
Wood goes by its own width or that of its leaves, whichever is larger: a trunk is a tube even among invisible leaves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..buffers import BLOCK_POLYGONS, MeshBuffers
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..growth.branches import Branches
from ..growth.growth import WholeBranches, trunks
from ..growth.hashing import Draw, uniform
from ..growth.seeds import Seeds
from ..refinement.contents import Contents
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..species.species import LEAF_KINDS
from ..subplants.leaf_meshes import leaf_meshes
from ..subplants.pieces import Pieces, chunks, expand
from ..subplants.tubes import tube_buffers

#: Width from which on all leaves are real over the width up to which none is.
BAND = 2.5


@dataclass(frozen=True)
class Transition:
    """Fractions of leaves and wood that are real.

    Attributes
    ----------
    flora : Flora
    camera : Camera
    limit : float
        Width in pixels up to which leaves are facets.
    """

    flora: Flora
    camera: Camera
    limit: float

    def fraction(self, width: NDArray[np.float64], position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Real fraction (n,) of things of a width (n,) in metres at places (n, 3): a smooth step in the logarithm."""
        pixels = width / np.maximum(self.camera.extent_around(position), 1e-300)
        place = np.log(np.maximum(pixels, 1e-300) / self.limit) / np.log(BAND)
        place = np.clip(place, 0.0, 1.0)
        return place * place * (3.0 - 2.0 * place)

    def of_branches(self, branches: Branches) -> NDArray[np.float64]:
        """Real fraction (n,) of the leaves and the wood of sub-plants; of leafless ones by the base of their branch."""
        return self.fraction(self._width(branches), branches.position)

    def of_wood(self, pieces: Pieces, among_leaves: bool = True) -> NDArray[np.bool_]:
        """Pieces (n,) whose wood is real, by its own width or also by that of the leaves on the branch."""
        return self._kept(pieces.branches, (pieces.start + pieces.end) / 2.0, among_leaves)

    def of_twigs(self, branches: Branches) -> NDArray[np.bool_]:
        """Whole branches (n,) whose wood is real."""
        return self._kept(branches, branches.position, among_leaves=True)

    def _kept(self, branches: Branches, position: NDArray[np.float64], among_leaves: bool) -> NDArray[np.bool_]:
        own = 2.0 * branches.radius
        width = np.maximum(own, self._width(branches)) if among_leaves else own
        return uniform(branches.key, Draw.TRANSITION) < self.fraction(width, position)

    def _width(self, branches: Branches) -> NDArray[np.float64]:
        row = branches.row
        leafy = self.flora.leaf_count[row] > 0
        return np.where(leafy, self.flora.leaf_width[row] * branches.scale, 2.0 * branches.radius)


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
        Fraction of all polygons that is done with this block.
    """

    kind: str
    form: int
    species: int
    number: int
    buffers: MeshBuffers
    fraction: float


def explicit_blocks(flora: Flora, result: Refinement, transition: Transition | None = None) -> Iterator[Block]:
    """Polygons of all explicit tetrahedra, and thick wood of those that are drawn as proxies.

    With a transition, small leaves are left to facets, by a random number of each leaf.
    """
    explicit = result.decision == Decision.EXPLICIT
    nodes, rank, polygons = result.nodes, result.rank, np.where(explicit, result.totals.polygons, 0.0)
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
    """Polygons of all plants, seen or not; for comparison."""
    plants = trunks(flora.rows, seeds)
    runs = list(chunks(flora.polygons[plants.row], BLOCK_POLYGONS))
    for number, run in enumerate(runs):
        whole = list(expand(flora, plants.take(run)))
        yield from _block(flora, Pieces.empty(), whole, number, (number + 1) / len(runs))


def _block(
    flora: Flora,
    pieces: Pieces,
    branches: list[WholeBranches],
    number: int,
    fraction: float,
    bare: Pieces | None = None,
    transition: Transition | None = None,
) -> Iterator[Block]:
    """Meshes of pieces and branches of any species, and of the wood alone of ``bare`` pieces."""
    bare = Pieces.empty() if bare is None else bare
    of_pieces, of_bare = flora.species_of(pieces.branches.row), flora.species_of(bare.branches.row)
    of_branches = [flora.species_of(some.branches.row) for some in branches]
    fraction_of = None if transition is None else transition.of_branches
    made: list[tuple[str, int, int, MeshBuffers | None]] = []
    for s in np.unique(np.concatenate([of_pieces, of_bare, *of_branches])):
        cut = pieces.take(of_pieces == s)
        whole = [some.take(species == s) for some, species in zip(branches, of_branches, strict=True)]
        leaves = leaf_meshes(flora, cut, int(s), whole, fraction_of)
        made += [(LEAF_KINDS[m.kind], m.form, int(s), m.buffers) for m in leaves]
        if transition is not None:
            cut = cut.take(transition.of_wood(cut))
            whole = [some.take(transition.of_twigs(some.branches)) for some in whole]
        cut = Pieces.concatenate([cut, bare.take(of_bare == s)])
        made.append(("bark", 0, int(s), tube_buffers(flora, cut, whole)))
        del cut, whole
    # The caller copies each block into Blender; meanwhile its sources and the blocks already taken are not kept.
    del pieces, branches, bare
    while made:
        kind, form, s, buffers = made.pop(0)
        if buffers is not None:
            yield Block(kind, form, s, number, buffers, fraction)
        del buffers
