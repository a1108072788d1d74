# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From the frontier to buffers: leaves, wood and facets of what is seen, and few facets of all else.

The image is divided into upright tiles, whose number follows from its size alone. Each has a frontier and a coverage of
its own and may be drawn in another process: results do not depend on how many there are. What is drawn is tested again,
primitive by primitive. What nobody sees only casts shadows and sends light back: few large facets stand for many, each
of which lies behind full pixels as a whole.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Arrays, Floats, Floats32, Integers, Mask, unit
from ..buffers import MeshBuffers, concatenate_buffers, kept_faces
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..growth.hashing import place_keys, uniform
from ..parallel import blocks
from ..processes.pool import in_processes
from ..proxies.facet_weights import FacetWeights
from ..proxies.microsurfaces import CIRCUMRADIUS, STRETCH, Facets, pushed_outside_view
from ..proxies.primitives import Primitive, joined, triangle_corners
from ..refinement.contents import polygon_totals
from ..refinement.decisions import contributions
from ..refinement.lights import ShadowReach
from ..refinement.loop import Refinement
from ..refinement.shared_parts import SharePoints
from .asset_plan import PlacedClusters
from .coverage import Coverage, Shade
from .frontier import DETAIL, FEW, FEWER, Canvas, Frontier, FrontierKind, Shown, Waiting, Whose, corners_of_faces
from .plants import Block, GrownPlants, PlantRows, Transition
from .polygons import FaceRows, Faces

#: Least width of a tile, pixels, and pixels around it that its coverage knows. A first look has the tiles of what it
#: stands for, so that these are narrower; what is so many pixels wide stays whole at their borders.
TILE, AROUND, AT_BORDER = 240, 64, 4.0
#: Pixels by which what was made is tested as if it were wider: full pixels are open beside their centers. With none,
#: 8.3 % of 16 points in each pixel of a wood see what counts as hidden; with .12 they are 7.5 %, so 6.7 %.
_WIDER = 0.25
#: How many primitives nobody sees become one, as many as lie behind full pixels together.
MERGED = (4.0, 16.0, 64.0)
#: Side of facets of hidden parts where the light reaches them, in sides of those that are seen; the optical depth in
#: the shade over which it grows by e, and up to which things are lit; and the largest.
HIDDEN, SHADED, LARGEST = 4.0, 1.5, 32.0
#: Leaves that a facet which nobody sees stands for at least.
HIDDEN_LEAVES = 8
#: Facets of hidden parts, and of those outside, for each pixel of the image, at most.
HIDDEN_A_PIXEL, OUTSIDE_A_PIXEL = 0.3, 0.2
#: So many of each are never too many.
NEVER_TOO_MANY = 50_000.0
#: Pixels down to which shadows that fall into the view are refined where nobody asks for finer ones, leaves that a
#: facet stands for there at least, and how many times as many there may be as of all else out of view. Without, crowns
#: beside the image shade its borders too much.
SHADOW, LIT_LEAVES, LIT_TIMES = 4.0, 3.0, 9.0
#: Meters from which on shadows are the coarser the farther they fall: most of what they reach lies in other shade.
FALLEN = 8.0
#: Largest side of facets outside over their distance from the view; meters that count least, and from which on it grows
#: faster. The same of those whose shadows fall into the view, over the meters that these fall, and the least of these.
_BESIDE, _THROWN = (0.1, 8.0, 15.0), (0.02, 1.0)
#: Largest side of facets outside, meters, and how many have it at least, of all. Those of plants 150 m behind an eye in
#: a wood were spheres of up to 37 m, few and by chance; one of them shaded all that was seen.
LARGEST_OUTSIDE, _LEAST_OUTSIDE = 3.0, 0.5
#: Parts outside that are drawn at a time.
_OUTSIDE_BATCH = 20_000
#: Fraction of what a tile may have that is for what is seen; beyond, all that is left counts as hidden.
FULL = 0.85
#: Layers of all that a tile draws, were they drawn at random: pixels stay open with the probability exp(-_LAYERS), 4.1
#: to 5.4 layers for birches and spruces. What was expected counts as this part of them.
_LAYERS, _EXPECTED = 5.0, 0.5
#: Largest sides in a tile over those that it began with: shards would show among fine leaves. A tile that is not
#: complete so, or whose sides are so many times what they may be, is drawn again, so often at most.
UNEVEN, _LARGER, _TRIES = 2.0, 1.4, 4
#: Part of what a tile may have that is made between two depths, at most.
_SLAB = 0.06
#: Part of what tiles have on average that each has besides.
_LEAST_SHARE = 0.1
#: Part of all that may be drawn which plants out of view have.
_UNSEEN = 0.05
#: Draws of this module.
_MERGE, _LEFT, _SCARCE, _DROPPED = 230, 232, 234, 235

#: What becomes of facets, which the camera sees or not. Another process may call it.
FacetConverter = Callable[[Facets, bool], Any]


@dataclass(frozen=True)
class Parts:
    """Facets of one species, of assets (`ASSETS`), or of other meshes where that is None; and whether they are seen.

    ``look`` is that of assets and of the surfaces of other meshes. ``coarser`` are sides of what is seen over those of
    the drawing, where more was needed than there was room for.
    """

    species: int | None
    facets: tuple[tuple[Primitive, bool], ...]
    look: str = ""
    coarser: float = 1.0

    def __iter__(self) -> Iterator[tuple[Primitive, bool]]:
        return iter(self.facets)


@dataclass(frozen=True)
class Drawing:
    """What all tiles are drawn with."""

    kinds: Sequence[FrontierKind]  # of all that there is
    parts: Sequence[Arrays]  # what there is of each, to begin with
    camera: Camera
    shadows: ShadowReach
    shade: Shade
    occluders: Floats  # (t, 3, 3): triangles of opaque polygons, meters
    covered: Floats  # (columns,): pixels in each column that the loop found covered
    facet: float  # side of facets that are seen, pixels
    hidden: float = 1.0  # sides of facets over those that are asked for: the larger, the fewer for what is not seen
    finest: float = 1.0  # sides over those at which a tile may draw that has room for more
    form: FacetConverter | None = None  # what becomes of facets where they are made; without, they stay what they are
    most: float = np.inf  # polygons and facets that there may be, should what is expected be wrong
    shadow: float = 0.0  # pixels down to which shadows of what is not seen are refined; 0 leaves them coarse
    tiles: int = 0  # how many, nearest first; 0 for as many as fit, from left to right

    @property
    def smaller(self) -> float:
        """Width of its tiles over that of others, where an image is too small to have so many."""
        return min(self.camera.width / (self.tiles * TILE), 1.0) if self.tiles > 1 else 1.0


def tiles_of(camera: Camera) -> int:
    """How many tiles fit into the image of a camera."""
    return max(camera.width // TILE, 1)


def drawing(
    flora: Flora,
    result: Refinement,
    transition: Transition,
    weights: FacetWeights,
    assets: PlacedClusters | None = None,
    occluders: Floats | None = None,
    **options: Any,
) -> Drawing:
    """What a refinement is drawn with for the camera of a transition; options are other fields of `Drawing`."""
    camera, points = transition.camera, SharePoints.concatenate([result.plants.points, result.assets.points])
    polygons = result.polygons
    places = np.concatenate([points.position, polygons.center])
    shade = Shade(places, np.concatenate([points.optical_area, polygon_totals(polygons).optical_area]), result.lights)
    lowest = result.plants.parts.branches.position[:, 2].min(initial=places[:, 2].min(initial=np.inf))
    shadows = ShadowReach(camera, result.lights, float(lowest))
    kinds: list[FrontierKind] = [GrownPlants(flora, camera, transition, weights, result.lights)]
    parts: list[Arrays] = [PlantRows.of(flora, result.plants.parts)]
    if assets is not None:
        kinds.append(assets)
        parts.append(assets.everything())
    occluders = np.zeros((0, 3, 3)) if occluders is None else occluders
    if len(polygons):
        faces = Faces.of(polygons.meshes, camera, transition.limit)
        kinds.append(faces)
        parts.append(rows := FaceRows.of(polygons))
        occluders = np.concatenate([occluders, faces.triangles(rows, TILE / 2)])
    return Drawing(kinds, parts, camera, shadows, shade, occluders, _covered_columns(result, camera), **options)


def _covered_columns(result: Refinement, camera: Camera) -> Floats:
    """Pixels (width,) in each column of the image that the loop found covered, by the middles of its tetrahedra."""
    seen = np.flatnonzero(result.in_view[result.nodes])
    covered = contributions(result.cells, result.transmittance)[seen]
    middle = result.tree.vertices(result.nodes[seen]).mean(axis=1)
    coverage = Coverage(camera, (0, 1))
    column = np.clip(np.nan_to_num(coverage.project(middle)[0]), 0, coverage.width - 1).astype(np.int64)
    return np.bincount(column, covered, coverage.width)


def drawn_blocks(given: Drawing) -> Iterator[int | Block | Parts | Shown]:
    """Everything that is drawn, tile by tile: meshes of plants, facets, and what of other things is drawn as it is.

    The number of each tile comes before all of it; what is out of view is the last.
    """
    items, outside, shown = _tiles(given)
    given, beyond = replace(given, parts=()), given.tiles or tiles_of(given.camera)
    yield from shown
    for kind, rows in enumerate(outside):
        for run in blocks(len(rows), _OUTSIDE_BATCH):
            parts = [other.take(slice(0)) for other in outside]
            parts[kind] = rows.take(run)
            items.append((beyond, None, parts, len(parts[kind]) / sum(map(len, outside))))
    del outside
    numbers, before = [number for number, *_ in items], None
    # What was sent is let go: the parts of all tiles are a fifth of what is there before anything is made of them.
    given_away = (items.pop(0) for _ in range(len(items)))
    for place, drawn in enumerate(in_processes(_drawn_tile, given, given_away)):
        if numbers[place] != before:
            yield (before := numbers[place])
        while drawn:
            one = drawn.pop(0)
            yield replace(one, fraction=(place + 1) / len(numbers)) if isinstance(one, Block) else one


#: Number, columns, parts and share of all that may be drawn of a tile; what is out of view has no columns.
_Item = tuple[int, tuple[int, int] | None, list[Arrays], float]


def _tiles(given: Drawing) -> tuple[list[_Item], list[Arrays], list[Shown]]:
    """Tiles in the order in which they are drawn, parts out of view, and what is shown already.

    A part belongs to the tile that its middle is in; what is wider than half a tile is opened first, and of a first
    look what crosses a border, as its parts are on either side when they are fine.
    """
    whole = Coverage(given.camera, (0, 1))
    number = given.tiles or tiles_of(given.camera)
    ends = np.linspace(0, whole.width, number + 1).astype(np.int64)
    frontier = Frontier(given.kinds, whole, given.facet)
    inside, outside = [], []
    for kind, parts in zip(given.kinds, given.parts, strict=True):
        by_tile, beyond = [[parts.take(slice(0))] for _ in range(number)], [parts.take(slice(0))]
        while len(parts):
            pool = frontier.pool(kind, parts)
            prints = whole.of_spheres(pool.center, pool.radius)
            out = whole.outside(prints)
            low, high = np.clip(prints.low[:, 0], 0, whole.width), np.clip(prints.high[:, 0], 0, whole.width)
            wide = high - low > given.smaller * TILE / 2
            if given.smaller < 1.0:
                left, right = np.searchsorted(ends[1:-1], [low, high])
                wide |= (left < right) & (high - low > AT_BORDER)
            wide &= ~out & kind.can_open(parts)
            beyond.append(parts.take(np.flatnonzero(out)))
            stay = np.flatnonzero(~out & ~wide)
            middle = np.clip(whole.project(pool.center[stay])[0], 0, whole.width - 1)
            column = np.clip(np.searchsorted(ends, middle, side="right") - 1, 0, number - 1)
            for tile, contents in enumerate(by_tile):
                contents.append(parts.take(stay[column == tile]))
            parts = kind.opened(kind.met(parts.take(np.flatnonzero(wide)), frontier.shown))[0]
        inside.append([kind.ordered(type(parts).concatenate(by_tile.pop(0))) for _ in range(number)])
        outside.append(kind.ordered(type(parts).concatenate(beyond)))
    covered, tiles = given.covered + _LEAST_SHARE * max(given.covered.mean(), 1.0), []
    for tile, (first, end) in enumerate(itertools.pairwise(ends.tolist())):
        contents = [of[tile] for of in inside]
        if any(map(len, contents)):
            tiles.append((tile, (first, end), contents, float(covered[first:end].sum() / covered.sum())))
    if given.tiles:
        tiles.sort(key=lambda item: min(p.near.min(initial=np.inf) for p in map(frontier.pool, given.kinds, item[2])))
    return tiles, outside, frontier.shown


def _drawn_tile(given: Drawing, item: _Item) -> list[Block | Parts | Shown]:
    """All that is drawn of one tile, or of parts that are out of view."""
    number, columns, parts, share = item
    most = share * given.most
    expected, known = FULL * most, None
    for left in reversed(range(_TRIES)):
        tile = _Tile(given, columns, not left)
        if columns is None:  # parts out of view, a share of all of them
            tile._draw_outside(list(map(tile.frontier.pool, given.kinds, parts)), share, _UNSEEN * most)
        else:
            tile.draw(parts, (columns[1] - columns[0]) / tile.coverage.width, most, expected, known)
        if tile.again is None:
            break
        expected, known = tile.asked, tile.again
    return tile.release(number)


class _Tile(Canvas):
    """One tile while it is drawn."""

    def __init__(self, given: Drawing, columns: tuple[int, int] | None, last: bool) -> None:
        more = int(given.smaller * AROUND)
        around = None if columns is None else (columns[0] - more, columns[1] + more)
        super().__init__(Coverage(given.camera, around or (0, 1)))
        self.given, self.last, self.frontier = given, last, Frontier(given.kinds, self.coverage, given.facet)
        self._facets: dict[tuple[Whose, bool], list[Primitive]] = {}
        self._left = 0.5 / given.hidden**2  # part of hidden facets that stay where nothing near can stand for them
        self._drawn = 0.0  # those of what is seen
        self.asked = 0.0  # polygons and facets that there would be of what is seen, with the sides of the drawing
        self.again: bool | None = None  # whether what it asked for is known now, where it is to be drawn again

    def release(self, number: int) -> list[Block | Parts | Shown]:
        """Meshes by kind, facets by whose they are, and what is drawn as it is; the tile lets go of each."""
        blocks = [
            Block(*what, number, whole, 1.0)
            for what in sorted(self.meshes)
            if (whole := concatenate_buffers(self.meshes.pop(what))) is not None
        ]
        owners = sorted({one for one, _ in self._facets}, key=lambda one: (one[0] is None, one[0] or 0, one[1]))
        facets = []
        for whose in owners:
            states = [seen for seen in (True, False) if (whose, seen) in self._facets]
            parts = tuple((joined(self._facets.pop((whose, seen))), seen) for seen in states)
            facets.append(Parts(whose[0], parts, whose[1], self.coarser))
        return [*blocks, *facets, *self.frontier.shown]

    @property
    def coarser(self) -> float:
        """Sides of what is seen over those of the drawing, on average."""
        return float(self.asked / max(self._drawn, 1.0)) ** (1.0 / FEWER) if self._drawn else 1.0

    def draw(self, parts: Sequence[Arrays], share: float, most: float, expected: float, known: bool | None) -> None:
        """All parts of a tile, a share of the image, with no more than so many polygons and facets.

        So many are expected to be asked for, or known. Where they turn out to be far fewer, or too many, it stops once.
        """
        given, frontier, room, least = self.given, self.frontier, FULL * most, 0.0
        if len(given.occluders):
            self.add_shown(given.occluders)
            frontier.empty = self.coverage.depth.copy()  # plants before a ground need as many layers as before the sky
        for slabs in frontier.slabs(parts, _SLAB * most):
            follow, before = self._following(expected, bool(known)) if np.isfinite(most) else 0.0, self.number
            # Rounded: what memory there is, to the byte, shall not change the last bit of each side.
            times = round((follow / max(room - before, 1.0)) ** (1.0 / FEWER), 9)
            least, times = least or times, max(min(times, UNEVEN * (least or times)), given.finest)
            few = known is None and before and _LARGER * max(times, ((self.asked + follow) / room) ** (1 / FEWER)) < 1.0
            if few or (before > room and not known):  # what is not drawn hides nothing: all behind it would be opened
                self.asked, self.again = self.asked + follow, not few
                return
            if before > room and not self.last:  # drawn to know how many there would be, and let go
                self.again, self.meshes, self._facets = True, {}, {}
            frontier.facet, frontier.kinds = times * given.facet, [kind.coarser(times) for kind in given.kinds]
            for number, (kind, slab) in enumerate(zip(frontier.kinds, slabs, strict=True)):
                if self.number > room and self.last:
                    frontier.hidden[number].append(slab)
                    self.asked += times**FEWER * float(slab.count.sum())  # sides are told of all that is seen
                elif len(slab):
                    side = kind.larger * frontier.facet * given.camera.extent_around(slab.center)
                    kind.draw(self, slab, side, frontier.shown)
            self._cover()
            self.asked += times**FEWER * (self.number - before)
        self._drawn = self.number
        if self.again or (self.coarser > _LARGER * max((self.asked / room) ** (1 / FEWER), given.finest) and not known):
            self.again = True
            return
        self._draw_hidden(list(map(Waiting.concatenate, frontier.hidden)), self._few(HIDDEN_A_PIXEL, share, most))
        # What is outside of a tile's own image was part of something inside: it lies near the border.
        self._draw_outside(list(map(Waiting.concatenate, frontier.outside)), share, most)
        self._leave_out(self.number - most)

    def _following(self, expected: float, known: bool) -> float:
        """Polygons and facets still to be drawn, by those drawn before for each layer, and the pixels left open."""
        if known:
            return max(expected - self.asked, _EXPECTED / _LAYERS * expected)
        layers = self.frontier.layers()
        return (self.asked + _EXPECTED * expected) / (layers + _EXPECTED * _LAYERS) * max(_LAYERS - layers, 1.0)

    def _leave_out(self, number: float) -> None:
        """Leave out so many: facets that nobody sees by a hash, the smallest faces, then seen facets by a hash."""
        if number <= 0.0:
            return

        def rank(what: tuple, one: Primitive | MeshBuffers) -> Floats:
            if not isinstance(one, MeshBuffers):
                place = one.center if isinstance(one, Facets) else one.place.reshape(len(one), -1, 3)[:, 0]
                return 2.0 * what[1] + uniform(place_keys(place.astype(np.float64)), _LEFT)
            faces = _facets_of_faces(*corners_of_faces(one), one, np.arange(one.polygons))
            pixels = faces.side / self.given.camera.extent_around(faces.center)
            return 1.0 + pixels / (1.0 + pixels)

        shapes: dict[Any, Any] = {what: joined(group) for what, group in self._facets.items()}
        shapes |= {what: concatenate_buffers(group) for what, group in self.meshes.items()}
        ranks = [rank(what, one) for what, one in shapes.items()]
        kept = np.ones(sum(map(len, ranks)), bool)
        kept[np.argsort(np.concatenate(ranks), kind="stable")[: int(np.ceil(number))]] = False
        self._facets, self.meshes = {}, {}
        for (what, one), stay in zip(shapes.items(), np.split(kept, np.cumsum([*map(len, ranks)])[:-1]), strict=True):
            if isinstance(one, MeshBuffers) and stay.any():
                self.meshes[what] = [kept_faces(one, stay)]
            elif stay.any():
                self._facets[what] = [one.take(np.flatnonzero(stay))]

    # -- what is seen ---------------------------------------------------------------------------------------------

    def _cover(self) -> None:
        """Let what was made cover the image and test it; few stand for what is hidden."""
        waiting, self.waiting = self.waiting, []
        tested = [self.coverage.tested(corners, _WIDER) for _, _, corners in waiting]
        for *_, drawn in tested:
            for polygons in drawn:
                self.fill(*polygons)
        lost: dict[Whose, list[tuple[Facets, Floats]]] = {}
        for (what, shape, corners), (prints, gone, _) in zip(waiting, tested, strict=True):
            seen = np.flatnonzero(~gone)
            gone[seen] = self.coverage.hidden(prints.take(seen))
            hidden = np.flatnonzero(gone)
            number = uniform(place_keys(corners[hidden, 0]), _MERGE)
            likely = np.flatnonzero(number < max(0.5, self._left))
            hidden, number = hidden[likely], number[likely]
            if isinstance(shape, Facets):
                self._keep(shape.take(np.flatnonzero(~gone)), True, what)
                lost.setdefault(what, []).append((shape.take(hidden), number))
                continue
            if len(hidden):
                facets = _facets_of_faces(corners[hidden], np.diff(shape.face_offsets)[hidden], shape, hidden)
                lost.setdefault((what[2], ""), []).append((facets, number))
            shape = kept_faces(shape, ~gone) if gone.any() else shape
            if shape.polygons:
                self.number += shape.polygons
                self.meshes.setdefault(what, []).append(shape)
        for whose, every in lost.items():
            self._merge(joined([facets for facets, _ in every]), np.concatenate([n for _, n in every]), whose)

    def _few(self, a_pixel: float, share: float, most: float) -> float:
        """Facets that nobody sees, for each pixel of a share of the image, of what is left of so many."""
        camera = self.given.camera
        number = share * max(a_pixel * camera.width * camera.height, NEVER_TOO_MANY) / self.given.hidden**2
        return min(number, max(0.5 * (most - self.number), 0.0))

    # -- what is not seen -----------------------------------------------------------------------------------------

    def _merge(self, facets: Facets, number: Floats, whose: Whose) -> None:
        """Few large facets behind full pixels, for many hidden ones of their kind and cell, by random numbers (n,)."""
        prints, column, row, _ = self.coverage.of_corners(triangle_corners(facets))
        # A facet has another outline than the face for which it stands.
        left = np.flatnonzero(self.coverage.hidden(prints))
        times = np.zeros(len(facets))
        times[left] = 1.0
        for more in MERGED:
            larger = facets.take(left)
            left = left[self._hidden(replace(larger, side=larger.side * np.sqrt(more)))]
            times[left] = more
        cell, area = 2 * self.coverage.cells(column[0], row[0]) + (facets.transmission > 0.0), facets.side**2
        large, alike = (np.where(of, area, 0.0) for of in (times > 1.0, times == 1.0))
        lost, borne, most, single = (np.bincount(cell, of) for of in (area, large, large * times, alike))
        rest = np.maximum(lost - min(max(0.5, self._left), 1.0) * most, 0.0) / np.maximum(single, 1e-300)
        likely = (lost / np.maximum(borne, 1e-300))[cell] / np.maximum(times, 1.0)
        likely = np.where(times > 1.0, likely, np.minimum(rest[cell], self._left) * times)
        kept = np.flatnonzero(number < likely)
        facets = facets.take(kept)
        self._keep(replace(facets, side=facets.side * np.sqrt(times[kept])), False, whose)

    def _hidden(self, facets: Facets) -> Mask:
        """Facets (n,) behind full pixels, also as spheres: those reach nearer, and farther to the sides."""
        cover, spheres = self.coverage, (facets.center.astype(np.float64), facets.side / np.sqrt(np.pi))
        return cover.hidden(cover.of_corners(triangle_corners(facets))[0]) & cover.hidden(cover.of_spheres(*spheres))

    def _draw_hidden(self, pools: list[Waiting], most: float) -> None:
        """Hidden parts: facets that grow with their depth in the shade, as many as are allowed."""
        given, sides = self.given, []
        for pool in pools:
            pixels = np.minimum(HIDDEN * np.exp(given.shade.depth(pool.center) / SHADED), LARGEST)
            sides.append(pixels * given.facet * given.camera.extent_around(pool.center))
        self._draw_unseen(pools, sides, most, False)

    def _add_hidden(self, facets: Facets, whose: Whose) -> None:
        """Facets of hidden parts, smaller until they lie behind full pixels; what would show even so is left out."""
        # Where light reaches them they are divided; in the shade each shrinks: what lies before it keeps the light out.
        dark = self.given.shade.depth(facets.center) > SHADED
        while len(facets):
            hidden = self._hidden(facets)
            self._keep(facets.take(np.flatnonzero(hidden)), False, whose)
            large = facets.side > self.given.facet * self.given.camera.extent_around(facets.center)
            lit, rest = (np.flatnonzero(~hidden & large & zone) for zone in (~dark, dark))
            smaller = facets.take(rest)
            facets = Facets.concatenate([quarters(facets.take(lit)), replace(smaller, side=0.5 * smaller.side)])
            dark = np.repeat([False, True], [4 * len(lit), len(rest)])

    def _draw_outside(self, pools: list[Waiting], share: float, most: float) -> None:
        """Parts out of view: facets as large as their distance and the shadows that they throw allow."""
        few, free = (self._few(OUTSIDE_A_PIXEL, share, of) for of in (most, np.inf))
        fine, pools = map(list, zip(*map(self._for_shadows, self.given.kinds, pools), strict=True))
        extents = [(self.given.shadow or SHADOW) * self.given.camera.extent_around(pool.center) for pool in fine]
        sides = list(map(np.minimum, map(self._sides_outside, fine), extents))
        leaves = 1.0 if self.given.shadow else LIT_LEAVES
        # Of what a limit leaves, all else has half (`_few`) and these have three times that, since they are opened.
        room = max(1.5 * (most - self.number), 0.0)
        self._draw_unseen(fine, sides, min(LIT_TIMES * free, room), True, leaves)
        self._draw_unseen(pools, list(map(self._sides_outside, pools)), few, True)

    def _sides_outside(self, pool: Waiting) -> Floats:
        """Sides (n,) of facets of parts out of view, meters."""
        away = self.given.camera.distance_to_view(pool.center)
        fallen = self.given.shadows.distance(pool.center, away, pool.radius)
        (part, nearest, far), (soft, least) = _BESIDE, _THROWN
        away = np.maximum(away, nearest)
        fallen = np.maximum(fallen, least) * np.maximum(fallen / FALLEN, 1.0)
        return np.minimum(part * away * (1.0 + (away / far) ** 2), soft * fallen)

    def _for_shadows(self, kind: FrontierKind, pool: Waiting) -> tuple[Waiting, Waiting]:
        """Parts that throw shadows which are to be fine, opened as far as these show, and all others."""
        given, fine, left = self.given, [pool.take(slice(0))], [pool.take(slice(0))]
        frontier = Frontier(given.kinds, self.coverage, given.shadow or SHADOW)
        pool = frontier.pool(kind, pool.parts)
        while len(pool):
            away = given.camera.distance_to_view(pool.center)
            lit = given.shade.depth(pool.center, pool.radius) < SHADED
            lit &= np.isfinite(given.shadows.distance(pool.center, away, pool.radius))
            left.append(pool.take(np.flatnonzero(~lit)))
            pool = pool.take(np.flatnonzero(lit))
            pixels = 2.0 * pool.radius / given.camera.extent_around(pool.center)
            large = kind.can_open(pool.parts) & (pixels > DETAIL * frontier.facet) & (pool.count > FEW)
            fine.append(pool.take(np.flatnonzero(~large)))
            pool = frontier.pool(kind, kind.opened(pool.parts.take(np.flatnonzero(large)))[0])
        return Waiting.concatenate(fine), Waiting.concatenate(left)

    def _draw_unseen(
        self, pools: list[Waiting], sides: list[Floats], most: float, outside: bool, leaves: float = HIDDEN_LEAVES
    ) -> None:
        """Facets of parts that nobody sees, of sides (n,) in meters or so many leaves; about so many at most."""
        # Were there more, they are larger; where they would be larger than the largest, some parts have none.
        largest = LARGEST_OUTSIDE if outside else np.inf
        drawn = []
        for kind, pool, side in zip(self.given.kinds, pools, sides, strict=True):
            kept = kind.enough(pool.parts)
            side = np.maximum(self.given.hidden * side, np.sqrt(leaves * kind.one_leaf(pool.parts)))
            drawn.append((kind, pool, np.maximum(side, 1e-9), kept, kept * kind.optical(pool.parts)))
        number = sum(float((area / side**2).sum()) for *_, side, _, area in drawn)
        times = max(np.sqrt(number / max(most, 1.0)), 1.0)
        numbers = [area / np.minimum(times * side, largest) ** 2 for *_, side, _, area in drawn]
        large = [(times * side > largest) & (not kind.stays) for kind, _, side, _, _ in drawn]
        of_large = sum(float(count[of].sum()) for count, of in zip(numbers, large, strict=True))
        room = max(most - sum(float(count.sum()) for count in numbers) + of_large, _LEAST_OUTSIDE * most)
        for (kind, pool, side, kept, _), count, of in zip(drawn, numbers, large, strict=True):
            stay = ~of | (uniform(place_keys(pool.center), _DROPPED) * of_large < room)
            # Most parts have a small part of a facet each: so many fewer of them have so much more, which is as much.
            scarce = stay & (count > 0.0) & (count < 0.5 / leaves) & (not kind.stays)
            chosen = scarce & (uniform(place_keys(pool.center), _SCARCE) < 1.0 / leaves)
            for more, index in ((1.0, np.flatnonzero(stay & ~scarce)), (np.sqrt(leaves), np.flatnonzero(chosen))):
                size = np.minimum(times * side[index], largest) / more
                given = pool.parts.take(index), size, kept[index], self.frontier.shown
                for whose, facets in kind.unseen(*given) if len(index) else ():
                    facets = replace(facets, side=more * facets.side)
                    if outside:
                        self._keep(pushed_outside_view(facets, self.coverage.camera.distance_to_view), False, whose)
                    else:
                        self._add_hidden(facets, whose)

    def _keep(self, facets: Facets, seen: bool, whose: Whose) -> None:
        facets = facets.take(np.flatnonzero(facets.side > 0.0))
        self.number += len(facets)
        if len(facets):
            form = self.given.form
            self._facets.setdefault((whose, seen), []).append(facets if form is None else form(facets, seen))


def quarters(facets: Facets) -> Facets:
    """Four facets (4 n,) in the place of each of facets (n,): what lines between the middles of its sides divide."""
    corners = triangle_corners(facets).astype(np.float64)
    half = replace(facets, side=0.5 * facets.side)
    parts = [replace(half, center=0.5 * (facets.center + corners[:, k])) for k in range(3)]
    return Facets.concatenate([*parts, replace(half, across=-facets.across, along=-facets.along)])


def _facets_of_faces(corners: Floats32, size: Integers, buffers: MeshBuffers, faces: Integers) -> Facets:
    """Facets in the place of faces (n,) with corners (n, k, 3), the last of which repeats beyond their size (n,)."""
    corners = corners.astype(np.float64)

    def middle(values: Floats) -> Floats:
        return (values.sum(axis=1) - (values.shape[1] - size)[:, None] * values[:, -1]) / size[:, None]

    center = middle(corners)
    edges = np.stack([corners[:, b] - corners[:, a] for a, b in ((0, 1), (0, 2), (1, 2))])
    longest = np.sqrt(np.einsum("kni,kni->kn", edges, edges))
    along = unit(edges[longest.argmax(axis=0), np.arange(len(center))])
    vector = np.zeros_like(center)
    for k in range(1, corners.shape[1] - 1):
        vector += 0.5 * np.cross(corners[:, k] - corners[:, 0], corners[:, k + 1] - corners[:, 0])
    area = np.linalg.norm(vector, axis=1)
    across = unit(np.cross(along, vector))
    color = buffers.attributes["tf_color"][1][faces].astype(np.float64)
    through = buffers.attributes["tf_transmission"][1][faces].astype(np.float64)
    velocity = None
    if "velocity" in buffers.attributes:
        moving = buffers.attributes["velocity"][1].astype(np.float64)
        every = np.minimum(np.arange(corners.shape[1]), size[:, None] - 1) + buffers.face_offsets[faces, None]
        velocity = middle(moving[buffers.corner_verts[every]])
    side = np.sqrt(area)
    # As long as the face, as far as facets of wood are.
    stretch = np.clip(longest.max(axis=0) / np.maximum(1.5 * CIRCUMRADIUS * side, 1e-12), 1.0, STRETCH)
    return Facets(center, across, along, side, color, through, velocity, stretch=stretch, dull=np.zeros(len(area)))
