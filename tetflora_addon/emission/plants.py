# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to buffers: polygons of explicit plants, block by block, and the transition from leaves to facets.

Blocks are runs of tetrahedra in front-to-back order: each is one region of space, and only one block's buffers are in
memory at a time. Proxies are in `facets` and `shells`.

A leaf whose width in pixels is below the limit is a facet, one that is wider by `decisions.BAND` is real; in between
a fraction of them is real that grows with the width. Real leaves and facets are thinned out by hashes of their own
keys: what has become real stays real as the camera comes closer, nothing pops, and the area is the same on average.
Real leaves are single kites first, and have their faces from a few pixels of width on, one after another; where
these can be told from what they stand for, finer ones, see `leaf_detail`.
Wood goes by its own width or that of its leaves, whichever is larger: a trunk is a tube even among invisible leaves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..buffers import BLOCK_POLYGONS, MeshBuffers, concatenate_buffers
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..growth.axes import axes
from ..growth.branches import Branches
from ..growth.growth import WholeBranches, trunks
from ..growth.hashing import Draw, uniform
from ..growth.seeds import Seeds
from ..processes.pool import WORTH_PROCESSES, in_processes
from ..refinement.contents import TWIGS, feature_width
from ..refinement.decisions import real_fraction
from ..refinement.loop import Refinement
from ..species.species import LEAF_KINDS
from ..subplants.leaf_meshes import leaf_meshes
from ..subplants.pieces import chunks, expand
from ..subplants.tubes import tube_buffers
from ..subplants.twigs import twig_buffers
from .leaf_detail import FADING, TOLERANCE, LeafDetail
from .portions import MIXED, Portions, Sight, in_chunks

#: Fraction of leaves that counts at least: opening sub-plants for a few real leaves is work as well.
_LEAST_REAL = 0.1
#: Width in pixels up to which real leaves are kites.
KITES = 2.0
#: Width in pixels from which wood is tubes however little is seen of it: its facets would be a row of shards. A budget
#: that makes leaves facets at more than so many pixels takes tubes in the same proportion.
SHARDS, _GIVES_WAY = 1.4, 2.2


@dataclass(frozen=True)
class Transition:
    """Fractions of leaves and wood that are real.

    Attributes
    ----------
    flora : Flora
    camera : Camera
    limit : float
        Width in pixels up to which leaves are facets, where nothing hides them. What is hidden in part counts as
        smaller: the roots of its visibility.
    tolerance : float
        Pixels by which margins of near leaves may be off.
    """

    flora: Flora
    camera: Camera
    limit: float
    tolerance: float = TOLERANCE

    @property
    def detail(self) -> LeafDetail:
        """How finely near leaves are drawn."""
        return LeafDetail(self.flora, self.camera, self.tolerance)

    def fraction(
        self, width: NDArray[np.float64], position: NDArray[np.float64], visibility: NDArray[np.float64] | float = 1.0
    ) -> NDArray[np.float64]:
        """Real fraction (n,) of things of a width (n,) in metres at places (n, 3): a smooth step in the logarithm."""
        pixels = width / np.maximum(self.camera.extent_around(position), 1e-300) * visibility**FADING
        return real_fraction(pixels, self.limit)

    def of_kites(self, branches: Branches, visibility: NDArray[np.float64] | float = 1.0) -> NDArray[np.float64]:
        """Fraction (n,) of the real leaves of branches that are single kites."""
        small = self.limit / KITES
        return 1.0 - self.fraction(feature_width(self.flora, branches) * small, branches.position, visibility)

    def of_branches(self, branches: Branches, visibility: NDArray[np.float64] | float = 1.0) -> NDArray[np.float64]:
        """Real fraction (n,) of the leaves and the wood of sub-plants; of leafless ones by the base of their branch."""
        return self.fraction(feature_width(self.flora, branches), branches.position, visibility)

    def of_thickness(self, branches: Branches, visibility: NDArray[np.float64] | float = 1.0) -> NDArray[np.float64]:
        """Fraction (n,) of branches like these that are tubes."""
        width = 2.0 * branches.radius
        pixels = width / np.maximum(self.camera.extent_around(branches.position), 1e-300)
        whole = real_fraction(pixels, SHARDS * max(1.0, self.limit / _GIVES_WAY)) * (np.asarray(visibility) > 0.0)
        return np.maximum(self.fraction(width, branches.position, visibility), whole)

    def of_bare_wood(self, branches: Branches, visibility: NDArray[np.float64] | float = 1.0) -> NDArray[np.bool_]:
        """Branches (n,) that are tubes although none of their leaves is real."""
        return uniform(branches.key, Draw.TRANSITION) < self.of_thickness(branches, visibility)

    def of_wood(
        self, branches: Branches, visibility: NDArray[np.float64] | float = 1.0
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Branches (n,) that are tubes, if their leaves may be real, and (n,) that are triangles then."""
        number = uniform(branches.key, Draw.TRANSITION)
        own, leaves = 2.0 * branches.radius, self.of_branches(branches, visibility)
        among = self.fraction(
            np.minimum(TWIGS * own, feature_width(self.flora, branches)), branches.position, visibility
        )
        tubes = number < np.maximum(among, self.of_thickness(branches, visibility))
        return tubes, ~tubes & (number < leaves)


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


def explicit_blocks(
    flora: Flora,
    result: Refinement,
    camera: Camera,
    transition: Transition | None = None,
    tolerance: float = np.inf,
    sight: Sight | None = None,
) -> Iterator[Block]:
    """Polygons of explicit tetrahedra, and thick wood of all that is seen, in blocks from front to back.

    With a transition, small leaves are left to facets, by a random number of each leaf. Without, everything that lies
    in explicit tetrahedra for the most part is polygons, and the margins of near leaves may be off by a tolerance.
    A sight of the result with a transition may be given where there is one.
    """
    sight = sight or Sight(flora, result, camera, facets=transition is not None)
    yield from portion_blocks(sight, sight.portions(), transition, tolerance)


def portion_blocks(
    sight: Sight,
    portions: Portions,
    transition: Transition | None = None,
    tolerance: float = np.inf,
    form: Callable[[Block], Any] | None = None,
) -> Iterator[Any]:
    """The polygons of `explicit_blocks` of some portions (n,), or what a form makes of each block where it is made."""
    flora = sight.flora
    detail = LeafDetail(flora, sight.camera, tolerance) if transition is None else transition.detail
    portions = portions.take(np.flatnonzero(_may_be_real(portions, transition)))
    expected = portions.parts.totals.polygons + detail.more(
        portions.parts, np.where(portions.best > 0, portions.best, 1.0)
    )
    expected *= portions.within * np.maximum(_real_leaves(portions, transition), _LEAST_REAL)
    done, whole = np.cumsum(expected), max(float(expected.sum()), 1.0)
    runs = (
        (number, float(done[run[-1]]) / whole if len(run) else 1.0, portions.take(run))
        for number, run in enumerate(in_chunks(expected, BLOCK_POLYGONS))
    )
    made_of = _MadeOf(sight, transition, detail, form)
    for made in in_processes(_blocks_of_run, made_of, runs, float(expected.sum()) > WORTH_PROCESSES):
        while made:
            yield made.pop(0)


@dataclass(frozen=True)
class _MadeOf:
    """What all blocks are made of."""

    sight: Sight
    transition: Transition | None
    detail: LeafDetail
    form: Callable[[Block], Any] | None


def _blocks_of_run(made_of: _MadeOf, run: tuple[int, float, Portions]) -> list[Any]:
    """The meshes of one run of portions: its number, the fraction that is done with it, and the portions."""
    number, fraction, portions = run
    sight, transition = made_of.sight, made_of.transition
    parts = _real_parts(sight, portions, transition)
    blocks = _block(sight.flora, *parts, number, fraction, made_of.detail, transition)
    return list(blocks if made_of.form is None else map(made_of.form, blocks))


def _may_be_real(portions: Portions, transition: Transition | None) -> NDArray[np.bool_]:
    """Portions (n,) of which leaves or wood may be polygons."""
    may = _real_leaves(portions, transition) > 0
    if transition is not None:
        may |= (portions.best > 0) & (transition.of_thickness(portions.parts.branches, portions.best) > 0)
    return may


def _real_leaves(portions: Portions, transition: Transition | None) -> NDArray[np.float64]:
    """Fraction (n,) of the leaves of portions that is real where they are seen best."""
    if transition is None:
        return portions.real.astype(float)
    return np.where(
        portions.real & (portions.best > 0), transition.of_branches(portions.parts.branches, portions.best), 0.0
    )


def _real_parts(
    sight: Sight, portions: Portions, transition: Transition | None
) -> tuple[list[WholeBranches], WholeBranches | None, NDArray[np.float64]]:
    """Branches with all that is to be real of them, branches of which only the wood is, and visibilities.

    The ``plant`` of branches is their place among the visibilities.
    """
    flora = sight.flora
    full, bodies, bare, visibility, count = [], [], [], [np.zeros(0)], 0
    while len(portions):
        parts = portions.parts
        mixed = portions.mixed & (sight.pixels(portions) > MIXED)
        open_here = parts.can_open(flora) & mixed
        if transition is None:
            real, wood = portions.real & (portions.visibility >= 0.5), np.zeros(len(parts), bool)
        else:
            real = portions.real & (transition.of_branches(parts.branches, portions.visibility) > 0)
            wood = ~real & (transition.of_thickness(parts.branches, portions.visibility) > 0)
        # A sub-plant with small leaves may grow on a thick branch.
        open_here |= wood & parts.can_open(flora)
        ready = ~open_here & (real | wood)
        at = np.flatnonzero(ready)
        own = parts.branches.take(at)
        own = replace(own, plant=np.arange(count, count + len(at), dtype=np.int32))
        visibility.append(portions.visibility[at])
        count += len(at)
        alone, only_wood = parts.alone[at], wood[at]
        full.append(own.take(np.flatnonzero(~alone & ~only_wood)))
        bodies.append(own.take(np.flatnonzero(alone & ~only_wood)))
        bare.append(own.take(np.flatnonzero(alone & only_wood)))
        # What is opened for its thick wood alone keeps one visibility, as its facets do.
        portions = sight.opened(replace(portions, mixed=mixed).take(np.flatnonzero(open_here)))
        portions = portions.take(np.flatnonzero(_may_be_real(portions, transition)))
    made = list(expand(flora, Branches.concatenate(full)))
    bodies, bare = (Branches.concatenate(some) for some in (bodies, bare))
    if len(bodies):
        made.append(WholeBranches(bodies, axes(flora.rows, bodies)))
    thin = WholeBranches(bare, axes(flora.rows, bare)) if len(bare) else None
    return made, thin, np.concatenate(visibility)


def expanded_blocks(flora: Flora, seeds: Seeds, camera: Camera | None = None) -> Iterator[Block]:
    """Polygons of all plants, seen or not; for comparison. A camera sees what is near as finely as everywhere."""
    plants = trunks(flora.rows, seeds)
    detail = None if camera is None else LeafDetail(flora, camera)
    full = flora.polygons[plants.row] if plants.crown is None else flora.face_counts(plants)
    parts = list(chunks(full, BLOCK_POLYGONS))
    runs = ((number, (number + 1) / len(parts), plants.take(run)) for number, run in enumerate(parts))
    worth = len(parts) > 1 and float(full.sum()) > WORTH_PROCESSES
    for made in in_processes(_expanded, (flora, detail), runs, worth):
        while made:
            yield made.pop(0)


def _expanded(given: tuple[Flora, LeafDetail | None], run: tuple[int, float, Branches]) -> list[Block]:
    """The meshes of one run of whole plants."""
    (flora, detail), (number, fraction, plants) = given, run
    whole = list(expand(flora, plants))
    return list(_block(flora, whole, None, np.zeros(0), number, fraction, detail))


def _block(
    flora: Flora,
    branches: list[WholeBranches],
    bare: WholeBranches | None,
    visibility: NDArray[np.float64],
    number: int,
    fraction: float,
    detail: LeafDetail | None = None,
    transition: Transition | None = None,
) -> Iterator[Block]:
    """Meshes of branches of any species, and of the wood alone of ``bare`` ones."""
    of_branches = [flora.species_of(some.branches.row) for some in branches]
    of_bare = np.zeros(0, int) if bare is None else flora.species_of(bare.branches.row)

    def fractions_of(some: Branches) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        seen = visibility[some.plant]
        return transition.of_branches(some, seen), transition.of_kites(some, seen)

    def lengths_of(some: WholeBranches) -> NDArray[np.float64]:
        return detail.lengths(some, visibility[some.branches.plant] if len(visibility) else 1.0)

    made: list[tuple[str, int, int, MeshBuffers | None]] = []
    for s in np.unique(np.concatenate([np.zeros(0, int), of_bare, *of_branches])):
        whole = [some.take(np.flatnonzero(kind == s)) for some, kind in zip(branches, of_branches, strict=True)]
        leaves = leaf_meshes(
            flora, int(s), whole, None if transition is None else fractions_of, None if detail is None else lengths_of
        )
        made += [(LEAF_KINDS[m.kind], m.form, int(s), m.buffers) for m in leaves]
        twigs = []
        if transition is not None:
            wood = [transition.of_wood(some.branches, visibility[some.branches.plant]) for some in whole]
            twigs = [some.take(np.flatnonzero(thin)) for some, (_, thin) in zip(whole, wood, strict=True)]
            whole = [some.take(np.flatnonzero(tubes)) for some, (tubes, _) in zip(whole, wood, strict=True)]
        if bare is not None:
            own = bare.take(np.flatnonzero(of_bare == s))
            tubes = transition.of_bare_wood(own.branches, visibility[own.branches.plant])
            whole.append(own.take(np.flatnonzero(tubes)))
        bark = [tube_buffers(flora, whole, None if detail is None else detail.wood), twig_buffers(flora, twigs)]
        made.append(("bark", 0, int(s), concatenate_buffers([some for some in bark if some is not None])))
        del whole
    # The caller copies each block into Blender; meanwhile its sources and the blocks already taken are not kept.
    del branches, bare
    while made:
        kind, form, s, buffers = made.pop(0)
        if buffers is not None:
            yield Block(kind, form, s, number, buffers, fraction)
        del buffers
