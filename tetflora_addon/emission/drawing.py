# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From the frontier to buffers: leaves, wood and facets of what is seen, and few facets of all else.

The image is divided into upright tiles, whose number follows from its size alone. Each has a frontier and a coverage of
its own and may be drawn in another process: results do not depend on how many there are. What is drawn is tested again,
primitive by primitive. What nobody sees only casts shadows and sends light back: few large facets stand for many, each
of which lies behind full pixels as a whole.

A leaf is drawn as itself where a facet would be about as large (`plants.Transition`). Branches that are opened are
tubes while they are macroscopic, and else one thin triangle each, with the direction and the area of the branch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import unit
from ..buffers import MeshBuffers, concatenate_buffers, kept_faces
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..growth.axes import axes
from ..growth.branches import Branches
from ..growth.growth import WholeBranches
from ..growth.hashing import Draw, mix, uniform
from ..processes.pool import in_processes
from ..proxies.drawn import Drawn, Triangles, joined, triangle_corners
from ..proxies.facet_sizes import HIDDEN_LEAVES, opaque_fractions
from ..proxies.facet_weights import FacetWeights
from ..proxies.hotspots import light_ratios
from ..proxies.microsurfaces import Facets, kept_out_of_view, piece_facets, subplant_facets
from ..proxies.thrown_shadows import ThrownShadows
from ..refinement.contents import PlantParts, as_pieces
from ..refinement.decisions import real_fraction
from ..refinement.loop import Refinement
from ..refinement.shares import opened
from ..species.species import LEAF_KINDS
from ..subplants.leaf_meshes import leaf_meshes
from ..subplants.pieces import Pieces, whole_pieces
from ..subplants.tubes import tube_buffers
from ..subplants.twigs import twig_buffers
from .coverage import Coverage, Footprints
from .frontier import DETAIL, FEW, Frontier, Waiting
from .plants import Block, Transition
from .shade import Shade

#: Least width of a tile, pixels, and pixels around it that its coverage knows.
TILE, AROUND = 240, 64
#: Pixels from which on a branch that nothing else grows on has a line of its own; smaller ones are as straight.
LINES = 6.0
#: Batches, front to back, in which the parts of a slab are tested and cover the image.
_BATCHES = 6
#: Width in pixels up to which wood is thin triangles; tubes take their place up to `decisions.BAND` times that.
TUBES = 0.8
#: Pixels that the axis of a branch may be off a straight line; ribbons follow those that bend more.
BENT = 0.5
#: Width in pixels from which on tubes have all of their sides, and how many they have below.
BROAD, SIDES = 4.0, 4
#: Fraction of a facet's area from which on each branch has a triangle; of smaller ones fewer have a wider one.
TWIG = 0.6
#: How many primitives nobody sees become one, as many as lie behind full pixels together.
MERGED = (64.0, 16.0, 4.0)
#: Side of facets of hidden parts where the light reaches them, in sides of those that are seen; the optical depth in
#: the shade over which it grows by e; and the largest.
HIDDEN, SHADED, LARGEST = 4.0, 1.5, 32.0
#: Optical depth in the shade from which on hidden facets shrink instead of being divided.
DARK = 1.0
#: Facets of hidden parts, and of those outside, for each pixel of the image, at most.
HIDDEN_A_PIXEL, OUTSIDE_A_PIXEL = 0.6, 0.3
#: So many of each are never too many.
NEVER_TOO_MANY = 50_000.0
#: Optical depth in the shade up to which shadows are refined where somebody asks for it, and how many times as many
#: facets outside there may be then.
LIT, SHADOWS = 1.5, 6.0
#: Largest side of facets outside over their distance from the view; metres that count least, and from which on it grows
#: faster. The same of those whose shadows fall into the view, over the metres that these fall, and the least of these.
_BESIDE, _THROWN = (0.1, 8.0, 15.0), (0.02, 1.0)
#: Parts outside that are drawn at a time.
_OUTSIDE_BATCH = 20_000
#: Fraction of what a tile may have from which on all that is left counts as hidden.
_FULL = 0.85
#: Part of what a tile may have that is made between two depths, at most.
_SLAB = 0.06
#: Part of all that may be drawn which plants out of view have.
_UNSEEN = 0.05
#: Draws of this module.
_MERGE, _THIN, _LEFT = 230, 231, 232

#: What becomes of facets, which the camera sees or not. Another process may call it.
Form = Callable[[Facets, bool], Any]


@dataclass(frozen=True)
class Parts:
    """Facets of one species, of assets, or of other meshes where that is None; and whether the camera sees them.

    ``look`` is that of assets and of the surfaces of other meshes.
    """

    species: int | None
    facets: tuple[tuple[Drawn, bool], ...]
    look: str = ""

    def __iter__(self) -> Iterator[tuple[Drawn, bool]]:
        return iter(self.facets)


@dataclass(frozen=True)
class Drawing:
    """What all tiles are drawn with.

    Attributes
    ----------
    flora : Flora
    camera : Camera
    transition : Transition
    facet : float
        Side of facets that are seen, pixels.
    hidden : float
        Sides of facets over those that are asked for: the larger, the fewer stand for what is not seen.
    weights : FacetWeights
    shadows : ThrownShadows
    shade : Shade
    occluders : (t, 3, 3) float64
        Triangles of opaque polygons, metres.
    form : callable or None
        What becomes of facets where they are made; without, they stay what they are.
    most : float
        Polygons and facets that there may be, should what is expected be wrong.
    shadow : float
        Pixels down to which shadows of what is not seen are refined; 0 leaves them coarse.
    """

    flora: Flora
    camera: Camera
    transition: Transition
    facet: float
    hidden: float
    weights: FacetWeights
    shadows: ThrownShadows
    shade: Shade
    occluders: NDArray[np.float64]
    form: Form | None = None
    most: float = np.inf
    shadow: float = 0.0


def drawing(
    flora: Flora,
    result: Refinement,
    camera: Camera,
    transition: Transition,
    facet: float,
    weights: FacetWeights,
    hidden: float = 1.0,
    occluders: NDArray[np.float64] | None = None,
    form: Form | None = None,
    most: float = np.inf,
    shadow: float = 0.0,
) -> Drawing:
    """What a refinement is drawn with, see `Drawing`."""
    points = result.plants.points
    lowest = result.plants.parts.branches.position[:, 2].min(initial=np.inf)
    shadows = ThrownShadows(camera, result.lights, float(lowest))
    shade = Shade(points.position, points.optical_area, result.lights)
    occluders = np.zeros((0, 3, 3)) if occluders is None else occluders
    return Drawing(flora, camera, transition, facet, hidden, weights, shadows, shade, occluders, form, most, shadow)


def drawn_blocks(given: Drawing, parts: PlantParts, few: bool = False) -> Iterator[Block | Parts]:
    """Everything that plants are drawn as: meshes of leaves and wood, and facets, tile by tile.

    few: so little that other processes are not worth it.
    """
    tiles, outside = _tiles(given, parts)
    items: list[tuple] = [(number, *tile) for number, tile in enumerate(tiles)]
    items += [
        (len(tiles), None, outside.take(slice(start, start + _OUTSIDE_BATCH)), 1.0 / len(outside))
        for start in range(0, len(outside), _OUTSIDE_BATCH)
    ]
    whole = max(len(items), 1)
    for number, made in enumerate(in_processes(_drawn_tile, given, items, not few)):
        while made:
            one = made.pop(0)
            yield replace(one, fraction=(number + 1) / whole) if isinstance(one, Block) else one


def _tiles(given: Drawing, parts: PlantParts) -> tuple[list[tuple[tuple[int, int], PlantParts, float]], PlantParts]:
    """Columns, parts and share of all that may be drawn for each tile, and parts out of view.

    A part belongs to the tile that its middle is in; what is wider than half a tile is opened first.
    """
    whole = Coverage(given.camera, (0, 1))
    number = max(given.camera.width // TILE, 1)
    ends = np.linspace(0, whole.width, number + 1).astype(np.int64)
    frontier = Frontier(given.flora, whole, given.transition, given.facet)
    found, outside = [PlantParts.empty()], [PlantParts.empty()]
    columns = [np.zeros(0, np.int64)]
    while len(parts):
        pool = frontier.pool(parts)
        prints = whole.of_spheres(pool.centre, pool.radius)
        beyond = whole.outside(prints)
        low, high = np.clip(prints.low[:, 0], 0, whole.width), np.clip(prints.high[:, 0], 0, whole.width)
        wide = ~beyond & (high - low > TILE / 2) & parts.can_open(given.flora)
        outside.append(parts.take(np.flatnonzero(beyond)))
        stay = np.flatnonzero(~beyond & ~wide)
        found.append(parts.take(stay))
        middle = np.clip(whole.project(pool.centre[stay])[0], 0, whole.width - 1)
        columns.append(np.searchsorted(ends, middle, side="right") - 1)
        parts = PlantParts.concatenate([new for new, _, _ in opened(given.flora, parts.take(np.flatnonzero(wide)))])
    every, column = PlantParts.concatenate(found), np.clip(np.concatenate(columns), 0, number - 1)
    tiles = []
    for tile in range(number):
        own = every.take(np.flatnonzero(column == tile))
        if len(own):
            share = 0.5 * len(own) / len(every) + 0.5 / number
            tiles.append(((int(ends[tile]), int(ends[tile + 1])), _ordered(own), share))
    return tiles, _ordered(PlantParts.concatenate(outside))


def _ordered(parts: PlantParts) -> PlantParts:
    """Parts in an order of their own, so that that of plants in the scene does not matter."""
    return parts.take(np.lexsort([*parts.branches.position.T, parts.branches.key]))


def _drawn_tile(given: Drawing, item: tuple[int, tuple[int, int] | None, PlantParts, float]) -> list[Block | Parts]:
    """All meshes and facets of one tile, or of parts that are out of view."""
    number, columns, parts, share = item
    tile = _Tile(given, columns)
    if columns is None:
        tile.draw_outside(parts, share * len(parts))
    else:
        tile.draw(parts, (columns[1] - columns[0]) / tile.coverage.width, share * given.most)
    return tile.made(number)


class _Tile:
    """One tile while it is drawn."""

    def __init__(self, given: Drawing, columns: tuple[int, int] | None) -> None:
        self.given, self.flora = given, given.flora
        around = None if columns is None else (columns[0] - AROUND, columns[1] + AROUND)
        self.coverage = Coverage(given.camera, around or (0, 1))
        self._meshes: dict[tuple[str, int, int], list[MeshBuffers]] = {}
        self._facets: dict[tuple[int, bool], list[Drawn]] = {}
        # What was made between two depths: species and facets, or kinds and meshes, and their corners.
        self._waiting: list[tuple[Any, Any, NDArray[np.float32]]] = []
        self.number = 0

    def made(self, number: int) -> list[Block | Parts]:
        """Meshes by kind, and facets by species."""
        blocks = [
            Block(kind, form, species, number, whole, 1.0)
            for (kind, form, species), some in sorted(self._meshes.items())
            if (whole := concatenate_buffers(some)) is not None
        ]
        species = sorted({one for one, _ in self._facets})
        return blocks + [
            Parts(
                one,
                tuple((joined(self._facets[one, seen]), seen) for seen in (True, False) if (one, seen) in self._facets),
            )
            for one in species
        ]

    def draw(self, parts: PlantParts, share: float, most: float) -> None:
        """All parts of a tile, a share of the image, with no more than so many polygons and facets."""
        given = self.given
        if len(given.occluders):
            _, *corners = self.coverage.of_corners(given.occluders)
            self.coverage.draw(*corners)
        frontier = Frontier(self.flora, self.coverage, given.transition, given.facet)
        for slab in frontier.slabs(parts, _SLAB * most):
            if self.number > _FULL * most:
                frontier.hidden.append(slab)
                continue
            extent = given.camera.extent_around(slab.centre)
            side, branches = given.facet * extent, slab.parts.branches
            lines = slab.parts.alone | ~slab.parts.can_open(self.flora)
            lines &= (
                slab.parts.alone | (2.0 * slab.radius > LINES * extent) | (given.transition.of_branches(branches) > 0)
            )
            self._draw_subplants(branches.take(np.flatnonzero(~lines)), side[~lines])
            self._draw_branches(branches.take(np.flatnonzero(lines)), side[lines])
            self._cover()
        self._draw_hidden(
            Waiting.concatenate([Waiting.empty(), *frontier.hidden]), self._few(HIDDEN_A_PIXEL, share, most)
        )
        # What is outside of a tile's own image was part of something inside: it lies near the border.
        self._draw_outside(
            Waiting.concatenate([Waiting.empty(), *frontier.outside]), self._few(OUTSIDE_A_PIXEL, share, most)
        )
        self._leave_out(self.number - most)

    def _leave_out(self, number: float) -> None:
        """Leave out so many of the facets that nobody sees, should there be more than allowed; all alike by a hash."""
        unseen = {what: joined(some) for what, some in self._facets.items() if not what[1]}
        there = sum(map(len, unseen.values()))
        if number <= 0 or not there:
            return
        keys = np.concatenate([uniform(_keys_of(_places(some)), _LEFT) for some in unseen.values()])
        left = max(there - int(np.ceil(number)), 0)
        kept = np.zeros(there, bool)
        kept[np.argsort(keys, kind="stable")[:left]] = True
        start = 0
        for what, some in unseen.items():
            self._facets[what] = [some.take(np.flatnonzero(kept[start : start + len(some)]))]
            start += len(some)
        self._facets = {what: some for what, some in self._facets.items() if sum(map(len, some))}
        self.number -= there - left

    def draw_outside(self, parts: PlantParts, share: float) -> None:
        """Parts out of view, a share of all of them."""
        pool = Frontier(self.flora, self.coverage, self.given.transition, self.given.facet).pool(parts)
        self._draw_outside(pool, self._few(OUTSIDE_A_PIXEL, share, _UNSEEN * share * self.given.most))

    # -- what is seen ---------------------------------------------------------------------------------------------

    def _draw_subplants(self, branches: Branches, side: NDArray[np.float64]) -> None:
        if not len(branches):
            return
        leaf, species = (
            np.maximum(side, np.sqrt(self.flora.one_leaf_area(branches))),
            self.flora.species_of(branches.row),
        )
        for s in np.unique(species).tolist():
            some = np.flatnonzero(species == s)
            own = branches.take(some)
            self._add_seen(s, self._of_subplants(own, leaf[some], side[some], seen=True))

    def _of_subplants(
        self,
        branches: Branches,
        leaf: NDArray[np.float64],
        wood: NDArray[np.float64],
        left_out: NDArray[np.float64] | None = None,
        seen: bool = False,
    ) -> Facets:
        count = self._optical(branches) / np.maximum(leaf, 1e-12) ** 2
        weight = self.given.weights.of_subplants(branches.row, count, self._share(branches))
        once = self._once(branches, leaf) if seen else None
        return subplant_facets(self.flora, branches, leaf, wood, weight, left_out, once)

    def _draw_branches(self, branches: Branches, side: NDArray[np.float64]) -> None:
        """Branches alone: leaves that are large are real, wood is tubes or thin triangles, the rest is facets."""
        if not len(branches):
            return
        flora, transition = self.flora, self.given.transition
        branches = replace(branches, plant=np.arange(len(branches), dtype=np.int32))
        whole, real = WholeBranches(branches, axes(flora.rows, branches)), transition.of_own_leaves(branches)
        pieces, owner = whole_pieces(flora.rows, whole)
        species = flora.species_of(branches.row)
        extent = np.maximum(transition.camera.extent_around(branches.position), 1e-300)
        wide = 2.0 * branches.radius / extent
        tubes = uniform(branches.key, Draw.TRANSITION) < real_fraction(wide, TUBES)
        thin, detail = wide < BROAD, transition.detail
        for s in np.unique(species).tolist():
            own = species == s
            left = np.flatnonzero(own[owner] & (real[owner] < 1.0))
            if len(left):
                self._add_seen(s, self._of_pieces(pieces.take(left), side[owner[left]], real[owner[left]], seen=True))
            some = whole.take(np.flatnonzero(own & (real > 0.0)))
            made = leaf_meshes(flora, s, [some], lambda b: (real[b.plant], transition.of_kites(b)), detail.lengths)
            for one in made if len(some) else ():
                self._add_mesh((LEAF_KINDS[one.kind], one.form, s), one.buffers, True)
            # What is a few pixels wide has few sides; of wider wood all is drawn, or its shading would end at holes.
            slender, broad = (whole.take(np.flatnonzero(own & tubes & (thin == is_thin))) for is_thin in (True, False))
            self._add_mesh(("bark", 0, s), tube_buffers(flora, [slender], None, SIDES), True)
            self._add_mesh(("bark", 0, s), tube_buffers(flora, [broad], detail.wood))
            self._draw_twigs(s, whole.take(np.flatnonzero(own & ~tubes)), side, extent)

    def _draw_twigs(
        self, species: int, whole: WholeBranches, side: NDArray[np.float64], extent: NDArray[np.float64]
    ) -> None:
        """One thin triangle or ribbon each, or of very thin ones wider ones of fewer."""
        branches = whole.branches
        area = np.pi * branches.radius * branches.length
        likely = np.clip(area / (TWIG * side[branches.plant] ** 2), 0.02, 1.0)
        some = np.flatnonzero(uniform(branches.key, _THIN) < likely)
        if not len(some):
            return
        whole = whole.take(some)
        # The parts of a bow are off their chords by the square of their share of it.
        off = whole.lines.bend() / (BENT * extent[branches.plant[some]])
        parts = np.clip(np.ceil(np.sqrt(off)).astype(np.int64), 1, whole.lines.segments)
        self._add_mesh(("bark", 0, species), twig_buffers(self.flora, whole, 1.0 / likely[some], parts), True)

    def _of_pieces(
        self, pieces: Pieces, side: NDArray[np.float64], real: NDArray[np.float64] | None = None, seen: bool = False
    ) -> Facets:
        """Facets of pieces: of their leaves where they are seen, of their wood as well where they are not."""
        flora, branches = self.flora, pieces.branches
        leaf = np.maximum(side, np.sqrt(flora.one_leaf_area(branches)))
        count = self._optical(branches) / np.maximum(leaf, 1e-12) ** 2
        weight = self.given.weights.of_pieces(branches.row, count, self._share(branches))
        wood = np.ones(len(pieces), bool) if seen else None
        once = self._once(branches, leaf) if seen else None
        return piece_facets(flora, pieces, leaf, side, weight, real, wood, once)

    def _optical(self, branches: Branches) -> NDArray[np.float64]:
        return self.flora.leaf_areas(branches) + self.flora.wood_areas(branches) / 2

    def _share(self, branches: Branches) -> NDArray[np.float64] | None:
        """Part (n,) of their leaves that branches have on the day; None in summer."""
        return None if branches.year is None else self.flora.day.leaf_share(branches)

    def _once(self, branches: Branches, side: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light (n,) that leaves of branches send to the eye once over what facets do."""
        return light_ratios(self.flora, branches, side, self.given.camera, self.given.shadows.lights)

    def _add_seen(self, species: int, facets: Facets) -> None:
        """Facets, to be tested and drawn together with all else of the slab."""
        if len(facets):
            self._waiting.append((species, facets, triangle_corners(facets)))

    def _add_mesh(self, what: tuple[str, int, int], buffers: MeshBuffers | None, culled: bool = False) -> None:
        """A mesh, without faces behind full pixels if it is culled."""
        if buffers is None or not buffers.polygons:
            return
        size, first = np.diff(buffers.face_offsets), buffers.face_offsets[:-1]
        every = first[:, None] + np.minimum(np.arange(int(size.max())), size[:, None] - 1)
        corners = buffers.positions[buffers.corner_verts[every]]
        if culled:
            self._waiting.append((what, buffers, corners))
            return
        _, *drawn = self.coverage.of_corners(corners)
        self._fill(*drawn)
        self.number += buffers.polygons
        self._meshes.setdefault(what, []).append(buffers)

    def _fill(self, column: NDArray, row: NDArray, depth: NDArray) -> None:
        """Cover what polygons with corners (n, k) cover."""
        for k in range(1, column.shape[1] - 1):
            fan = [0, k, k + 1]
            self.coverage.draw(column[:, fan], row[:, fan], depth[:, fan])

    def _cover(self) -> None:
        """Test what was made, front to back, and let what is seen cover the image; few stand for the rest."""
        waiting, self._waiting = self._waiting, []
        groups = sorted({corners.shape[1] for _, _, corners in waiting})
        tested = [
            self.coverage.of_corners(np.concatenate([of for _, _, of in waiting if of.shape[1] == group]))
            for group in groups
        ]
        ends = np.cumsum([0, *(len(prints) for prints, *_ in tested)])
        hidden = np.zeros(ends[-1], bool)
        for batch in self._batches(tested):
            seen = []
            for first, end, (prints, *corners) in zip(ends, ends[1:], tested, strict=False):
                some = batch[(batch >= first) & (batch < end)] - first
                gone = self.coverage.hidden(prints.take(some))
                hidden[first + some[gone]] = True
                seen.append([of[some[~gone]] for of in corners])
            for corners in seen:
                self._fill(*corners)
        flags = dict(zip(groups, np.split(hidden, ends[1:-1]), strict=True)) if waiting else {}
        for what, made, corners in waiting:
            gone, flags[corners.shape[1]] = np.split(flags[corners.shape[1]], [len(corners)])
            species = what if isinstance(made, Facets) else what[2]
            lost = np.flatnonzero(gone)
            if isinstance(made, Facets):
                self._keep(made.take(np.flatnonzero(~gone)), True, species)
                self._merge(made.take(lost), species)
                continue
            if len(lost):
                size = np.diff(made.face_offsets)[lost]
                self._merge(_facets_of_faces(corners[lost], size, made, lost), species)
                made = kept_faces(made, ~gone)
            if made.polygons:
                self.number += made.polygons
                self._meshes.setdefault(what, []).append(made)

    def _batches(self, tested: list[tuple[Footprints, NDArray, NDArray, NDArray]]) -> list[NDArray[np.intp]]:
        """Numbers of what was tested in batches: in each cell of the image the nearest come first."""
        if not tested:
            return []
        near = np.concatenate([prints.near for prints, *_ in tested])
        cell = self.coverage.cells(*(np.concatenate([of[k][:, 0] for of in tested]) for k in (1, 2)))
        order = np.lexsort((near, cell))
        count = np.bincount(cell)
        own = cell[order]
        place = np.arange(len(near)) - (np.cumsum(count) - count)[own]
        batch = _BATCHES * place // np.maximum(count[own], 1)
        return [order[batch == number] for number in range(_BATCHES)]

    def _few(self, a_pixel: float, share: float, most: float) -> float:
        """Facets that nobody sees, for each pixel of a share of the image, of the few that are left of so many.

        Fewer where they are to be larger.
        """
        camera = self.given.camera
        number = share * max(a_pixel * camera.width * camera.height, NEVER_TOO_MANY) / self.given.hidden**2
        return min(number, max(0.5 * (most - self.number), 0.0))

    # -- what is not seen -----------------------------------------------------------------------------------------

    def _merge(self, facets: Facets, species: int) -> None:
        """Few large facets for many that are hidden; each lies behind full pixels as a whole, or is as it was."""
        number = uniform(_keys_of(facets.centre), _MERGE)
        # Where there are few, all of the last are kept; where there are many, as if they had been merged as well.
        likely = 1.0 / (MERGED[-1] * self.given.hidden**2)
        some = np.flatnonzero(number < max(1.0 / MERGED[-1], likely))
        facets, number = facets.take(some), number[some]
        for times in MERGED:
            larger = replace(facets, side=facets.side * np.sqrt(times))
            hidden = self._hidden(larger)
            self._keep(larger.take(np.flatnonzero(hidden & (number < 1.0 / times))), False, species)
            rest = np.flatnonzero(~hidden)
            facets, number = facets.take(rest), number[rest]
        # A facet has another outline than the face for which it stands.
        self._keep(facets.take(np.flatnonzero((number < likely) & self._hidden(facets))), False, species)

    def _hidden(self, facets: Facets) -> NDArray[np.bool_]:
        """Facets (n,) behind full pixels."""
        return self.coverage.hidden(self.coverage.of_corners(triangle_corners(facets))[0])

    def _draw_hidden(self, pool: Waiting, most: float) -> None:
        """Hidden parts: facets that grow with their depth in the shade, as many as are allowed."""
        if not len(pool):
            return
        given = self.given
        pixels = np.minimum(HIDDEN * np.exp(given.shade.depth(pool.centre) / SHADED), LARGEST)
        side = pixels * given.facet * given.camera.extent_around(pool.centre)
        self._draw_unseen(pool, side, most, self._add_hidden)

    def _add_hidden(self, facets: Facets, species: int) -> None:
        """Facets of hidden parts, smaller until they lie behind full pixels; what would show even so is left out.

        Where light reaches them they are divided; in the shade each shrinks: what lies before it keeps the light out.
        """
        dark = self.given.shade.depth(facets.centre) > DARK
        while len(facets):
            hidden = self._hidden(facets)
            self._keep(facets.take(np.flatnonzero(hidden)), False, species)
            large = facets.side > self.given.facet * self.given.camera.extent_around(facets.centre)
            lit, rest = (np.flatnonzero(~hidden & large & own) for own in (~dark, dark))
            smaller = facets.take(rest)
            facets = Facets.concatenate([quarters(facets.take(lit)), replace(smaller, side=0.5 * smaller.side)])
            dark = np.repeat([False, True], [4 * len(lit), len(rest)])

    def _draw_outside(self, pool: Waiting, most: float) -> None:
        """Parts out of view: facets as large as their distance and the shadows that they throw allow."""
        if not len(pool):
            return

        def add(facets: Facets, species: int) -> None:
            self._keep(kept_out_of_view(facets, self.coverage.camera.clearance), False, species)

        if self.given.shadow > 0.0:
            fine, pool = self._for_shadows(pool)
            side = np.minimum(
                self._sides_outside(fine), self.given.shadow * self.given.camera.extent_around(fine.centre)
            )
            self._draw_unseen(fine, side, SHADOWS * most, add, 1.0)
        self._draw_unseen(pool, self._sides_outside(pool), most, add)

    def _sides_outside(self, pool: Waiting) -> NDArray[np.float64]:
        """Sides (n,) of facets of parts out of view, metres."""
        away = self.given.camera.clearance(pool.centre)
        fallen = self.given.shadows.distance(pool.centre, away, pool.radius)
        part, nearest, far = _BESIDE
        away = np.maximum(away, nearest)
        soft, least = _THROWN
        return np.minimum(part * away * (1.0 + (away / far) ** 2), soft * np.maximum(fallen, least))

    def _for_shadows(self, pool: Waiting) -> tuple[Waiting, Waiting]:
        """Parts that throw shadows which are to be fine, opened as far as these show, and all others."""
        given, fine, left = self.given, [Waiting.empty()], [Waiting.empty()]
        frontier = Frontier(self.flora, self.coverage, given.transition, given.shadow)
        pool = frontier.pool(pool.parts)
        while len(pool):
            away = given.camera.clearance(pool.centre)
            lit = given.shade.depth(pool.centre, pool.radius) < LIT
            lit &= np.isfinite(given.shadows.distance(pool.centre, away, pool.radius))
            left.append(pool.take(np.flatnonzero(~lit)))
            pool = pool.take(np.flatnonzero(lit))
            pixels = 2.0 * pool.radius / given.camera.extent_around(pool.centre)
            large = pool.parts.can_open(self.flora) & (pixels > DETAIL * given.shadow) & (pool.count > FEW)
            fine.append(pool.take(np.flatnonzero(~large)))
            some = opened(self.flora, pool.parts.take(np.flatnonzero(large)))
            pool = frontier.pool(PlantParts.concatenate([new for new, _, _ in some]))
        return Waiting.concatenate(fine), Waiting.concatenate(left)

    def _draw_unseen(
        self,
        pool: Waiting,
        side: NDArray[np.float64],
        most: float,
        add: Callable[[Facets, int], None],
        leaves: float = HIDDEN_LEAVES,
    ) -> None:
        """Facets of parts that nobody sees, of sides (n,) in metres or so many leaves; no more than so many."""
        flora, parts = self.flora, pool.parts
        single = parts.alone
        kept = np.where(single | ~parts.can_open(flora), 1.0, opaque_fractions(flora, parts.branches, parts.totals))
        side = np.maximum(self.given.hidden * side, np.sqrt(leaves * flora.one_leaf_area(parts.branches)))
        number = float((kept * parts.totals.optical_area / np.maximum(side, 1e-9) ** 2).sum())
        side = side * max(np.sqrt(number / max(most, 1.0)), 1.0)
        species = flora.species_of(parts.branches.row)
        for s in np.unique(species).tolist():
            some = np.flatnonzero((species == s) & ~single)
            if len(some):
                made = self._of_subplants(parts.branches.take(some), side[some], side[some], 1.0 - kept[some])
                add(made, s)
            some = np.flatnonzero((species == s) & single)
            if len(some):
                add(self._of_pieces(as_pieces(parts.branches.take(some)), side[some]), s)

    def _keep(self, facets: Facets, seen: bool, species: int) -> None:
        facets = facets.take(np.flatnonzero(facets.side > 0.0))
        self.number += len(facets)
        if len(facets):
            form = self.given.form
            self._facets.setdefault((species, seen), []).append(facets if form is None else form(facets, seen))


def _keys_of(centre: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Keys (n,) of things by their places (n, 3), to a tenth of a millimetre."""
    key = np.zeros(len(centre), np.uint64)
    for axis in range(3):
        key = mix(key ^ np.rint(centre[:, axis] * 1e4).astype(np.int64).view(np.uint64))
    return key


def _places(drawn: Drawn) -> NDArray[np.float64]:
    """A place (n, 3) of each facet, or of what is drawn for it."""
    return drawn.corners[:, 0].astype(np.float64) if isinstance(drawn, Triangles) else drawn.centre.astype(np.float64)


def quarters(facets: Facets) -> Facets:
    """Four facets (4 n,) in the place of each of facets (n,): what lines between the middles of its sides divide."""
    corners = triangle_corners(facets).astype(np.float64)
    half = replace(facets, side=0.5 * facets.side)
    parts = [replace(half, centre=0.5 * (facets.centre + corners[:, k])) for k in range(3)]
    return Facets.concatenate([*parts, replace(half, across=-facets.across, along=-facets.along)])


def _facets_of_faces(
    corners: NDArray[np.float32], size: NDArray[np.integer], buffers: MeshBuffers, faces: NDArray[np.intp]
) -> Facets:
    """Facets in the place of faces (n,) with corners (n, k, 3), the last of which repeats beyond their size (n,)."""
    corners = corners.astype(np.float64)

    def middle(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return (values.sum(axis=1) - (values.shape[1] - size)[:, None] * values[:, -1]) / size[:, None]

    centre = middle(corners)
    along = unit(corners[:, 1] - corners[:, 0])
    vector = np.zeros_like(centre)
    for k in range(1, corners.shape[1] - 1):
        vector += 0.5 * np.cross(corners[:, k] - corners[:, 0], corners[:, k + 1] - corners[:, 0])
    area = np.linalg.norm(vector, axis=1)
    across = unit(np.cross(along, vector))
    colour = buffers.attributes["tf_colour"][1][faces].astype(np.float64)
    through = buffers.attributes["tf_transmission"][1][faces].astype(np.float64)
    velocity = None
    if "velocity" in buffers.attributes:
        moving = buffers.attributes["velocity"][1].astype(np.float64)
        every = np.minimum(np.arange(corners.shape[1]), size[:, None] - 1) + buffers.face_offsets[faces, None]
        velocity = middle(moving[buffers.corner_verts[every]])
    return Facets(centre, across, along, np.sqrt(area), colour, through, velocity, stretch=np.ones(len(area)))
