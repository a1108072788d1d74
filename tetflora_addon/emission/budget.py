# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A budget of polygons: the finest image that fits (beyond the paper, whose only limit is the cutoff); and estimates of
what refining and expanding will take: seconds, polygons and bytes.

Where facets are larger, there are fewer, as their area is. Where there are few, they may be finer than they have to be:
what hides facets has to be known as finely as they are. Shells have one size; there, real leaves go to the tetrahedra
that gain most by them for each polygon.

Estimates look at a few thousand leaves and branches, which stand for all there are (`compiled.sizes.CrownParts`), more
of them on near plants. From their places and sizes in the image their polygons follow by the rules of drawing and the
budget; in each part of the image as many are drawn as fill it. Only how many layers fill a pixel is measured, and
seconds: fitted to the processor's of ``python -m benchmarks estimates``, so that the largest error is least, whenever
refinement changes; those of what is expanded to plants of three species. Other machines differ by their speed.

Where all is expanded, the nearest plants are grown to their twigs to ask each branch how fine it will be.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import GOLDEN_ANGLE, GOLDEN_TURN, Floats, Integers, Mask, spread
from ..camera.camera import Camera
from ..compiled.flora import Flora, extents
from ..compiled.sizes import LEVEL, Crown, CrownParts
from ..growth.growth import WholeBranches, leaf_counts, trunks
from ..growth.seeds import Branches, Seeds
from ..leaves.levels import chosen_polygons, leaf_planes
from ..leaves.models import LeafModel
from ..refinement.decisions import Decision, contributions, explicit_fraction
from ..refinement.loop import Refinement
from ..refinement.settings import RefinementSettings
from ..subplants.pieces import expand
from ..subplants.rings import BUD_RINGS, bud_sides, finer, round_up_to
from ..subplants.tubes import tube_faces
from . import drawing
from .coverage import Coverage
from .drawing import HIDDEN, HIDDEN_A_PIXEL, HIDDEN_LEAVES, LIT_LEAVES, NEVER_TOO_MANY, OUTSIDE_A_PIXEL, SHADOW, TILE
from .frontier import DETAIL, FEWER
from .plants import BENT, BROAD, NEARER, SIDES, TOLERANCE, TUBES, TWIG, LeafDetail, kite_widths

#: Approximate bytes of a polygon in Blender (110) and in a renderer (500) together.
BYTES_PER_POLYGON = 610
#: The same of a triangle of expanded plants, whose leaves have many corners: 310 to 380 in Blender and Cycles together.
BYTES_PER_TRIANGLE = 380
#: Polygons and facets for each pixel that plants cover, about, with facets of a pixel.
A_PIXEL = 12.0
#: Steps in which memory counts: a half of one is lost on average.
MEMORY_STEP = 1.05
#: Polygons and facets that are never too many with the facets of *Final*; how many times finer facets are at most.
PLENTY, FINEST = 2_400_000.0, 5.0
#: What an expected number may be off by.
RESERVE = 0.15
#: Leaves of what is instanced are real from widths so many times smaller on than those of plants.
ASSETS_FINER = 3.6
#: Least side of facets of instances over that which is asked for. In a wood of 100 trees from the middle distance of
#: ``benchmarks assets``, of which no original fits into memory, FLIP is .168 with .33, .168 with .67, .175 with 1.
ASSETS_FINEST = 0.67


@dataclass(frozen=True)
class Detail:
    """How finely a refined scene is drawn."""

    refinement: Refinement  # decisions that fit into the budget
    camera: Camera  # of an image whose pixels are no larger than facets; all else is in these pixels
    facet: float  # side of facets, pixels
    leaf_limit: float  # width in pixels up to which leaves are facets
    coarser: float = 1.0  # sides over those that are asked for
    #: Pixels by which the margins of near leaves may be off; infinite where only their models are drawn.
    tolerance: float = TOLERANCE
    most: float = np.inf  # polygons and facets that there may be
    finest: float = 1.0  # sides over those at which what there may be suffices for finer ones

    @property
    def asset_limit(self) -> float:
        """`leaf_limit` of instances, whose originals are at hand, and of your own meshes."""
        return self.leaf_limit * max(1.0 / self.coarser, 1.0) / ASSETS_FINER

    @property
    def asset_larger(self) -> float:
        """Sides of facets of instances over those of plants, which alone gain by being much finer than asked for."""
        return max(ASSETS_FINEST / self.coarser, 1.0)


def fit_to_budget(
    result: Refinement, camera: Camera, settings: RefinementSettings, faces: float | None = None, times: float = 1.0
) -> Detail:
    """Detail that fits into the budget of the settings.

    Parameters
    ----------
    faces : float, optional
        Faces of each proxy tetrahedron; by default proxies are facets or spheres, whose number follows their size.
    times : float
        Pixels of the camera for each of the loop's, which may have looked at a smaller image.
    """
    memory = settings.max_memory * 1e9 / BYTES_PER_POLYGON if settings.max_memory else np.inf
    # In steps: what is free differs by some megabytes from frame to frame, and facets shall not.
    memory = MEMORY_STEP ** np.floor(np.log(memory) / np.log(MEMORY_STEP)) if 0.0 < memory < np.inf else memory
    most = (1.0 - RESERVE) * min(memory, settings.max_polygons or np.inf)
    detail = Detail(result, camera, settings.facet, settings.leaf_limit)
    if faces is not None:
        if not np.isfinite(most):
            return detail
        return replace(detail, refinement=_fitted_shells(result, most, faces), tolerance=np.inf)
    polygons = float(len(result.cell_polygons.polygons))
    covered = times * float(contributions(result.cells, result.transmittance)[result.in_view[result.nodes]].sum())
    number = primitives(covered, camera, settings.facet)
    asked = _relative_side(number, settings.facet)
    left = max(most - polygons, 0.01 * most) if np.isfinite(most) else most
    coarser = max(asked, (number / left) ** (1.0 / FEWER))
    pixels = max(1.0 / (coarser * settings.facet), 1.0)
    return replace(
        detail,
        camera=camera.resized(pixels),
        facet=pixels * coarser * settings.facet,
        leaf_limit=pixels * coarser * settings.leaf_limit,
        coarser=coarser,
        tolerance=pixels * TOLERANCE * max(coarser, 1.0) ** 2,
        most=left,
        finest=max(asked, min(1.0 / settings.facet, coarser)) / coarser,  # never finer than the image
    )


def _relative_side(number: float, facet: float) -> float:
    """Side of facets over one of so many pixels that is asked for, with which there would be so many: 1, or less."""
    # What is asked to be coarser than *Final* is so in small images as well: they would take as long otherwise.
    few = PLENTY / max(facet / RefinementSettings().facet, 1.0) ** 2
    return float(np.clip(np.sqrt(number / few), 1.0 / FINEST, 1.0))


def primitives(covered: float, camera: Camera, facet: float) -> float:
    """Polygons and facets (expected) with facets of so many pixels, by the pixels that cells cover."""
    return A_PIXEL * covered / facet**2 + (HIDDEN_A_PIXEL + OUTSIDE_A_PIXEL) * camera.width * camera.height


def _fitted_shells(result: Refinement, allowed: float, faces: float) -> Refinement:
    """Decisions that fit where each proxy has so many faces."""
    explicit = result.decision == Decision.EXPLICIT
    polygons, fixed = np.where(explicit, result.totals.polygons, 0.0), faces + _large(result)
    if polygons.sum() + fixed[~explicit].sum() <= allowed:
        return result
    cost = polygons - fixed
    gain = contributions(result.cells, result.transmittance) / np.maximum(cost, 1.0)
    order = np.argsort(np.where(explicit, -gain, np.inf), kind="stable")[: explicit.sum()]
    spent = np.cumsum(np.maximum(cost[order], 0.0)) + fixed.sum()
    kept = np.zeros(len(explicit), bool)
    kept[order[spent <= allowed]] = True
    return replace(result, decision=np.where(explicit & ~kept, Decision.PROXY, result.decision).astype(np.int8))


def _large(result: Refinement) -> Floats:
    """Polygons (cells,) that stay polygons although their cell is a proxy."""
    held = result.cell_polygons.polygons
    large = np.isinf(held.totals.width)
    return np.bincount(held.cell[large], minlength=len(result.tree))[result.nodes].astype(np.float64)


#: Seconds of any refinement, of each plant, and of each polygon or facet.
SECONDS, SECONDS_PER_PLANT, SECONDS_MADE = 0.6, 2.5e-5, 1.92e-6
#: Of what is opened: the root of how many plants are seen, of which far ones are few parts, and what branches become.
SECONDS_OPENED = np.array([0.6, 2.18e-5])
#: Seconds of each polygon, and of each triangle of those that are expanded.
SECONDS_EXPANDED = np.array([5e-7, 1.2e-7])
#: Bytes of each plant, of each process that draws, and of each polygon or facet of the tile that it draws.
BYTES_PER_PLANT, BYTES_PER_PROCESS, BYTES_IN_TILE = 500.0, 130e6, 350.0
#: Leaves and branches that are looked at, about; those in a cell of the image, and in view for one beside it.
_PARTS, _IN_CELL, _IN_VIEW = 4096, 32, 16.0
#: Layers of leaves in a covered pixel of which something is drawn, with facets of a pixel, about; the larger these are,
#: the more of them reach beyond what hides them, by the fifth root of their side.
_LAYERS = 12.0
#: Pixels that cells cover, which overlap, over those that their leaves do.
_OVERLAP = 1.17
#: Hidden facets that stand for others which were made with what hides them, over all that is seen.
_MERGED = 0.1
#: Leaves out of view that a facet stands for. Part of these that is lit and throws its shadow into the view, drawn by
#: facets of `SHADOW` pixels; and how many times as many of those there are as of others out of view, at most.
_LEAVES, _THROWN, _THROWN_TIMES = 32.0, 0.5, 2.0
#: Leaves count as so much shorter than they are, about, see `leaf_meshes`.
_SHARE = 0.85
#: How far twigs are off their chords, in lengths of these: arcs of a radian.
_BEND = 1 / 8


@dataclass(frozen=True)
class Stand:
    """Plants of a scene, or some of them that stand for all."""

    number: Floats  # (k,): plants that each stands for
    foot: Floats  # (k, 3): where they stand, meters
    scale: Floats  # (k,)
    which: Integers  # (k,): their crowns, as indices into the next
    crowns: tuple[Crown, ...]

    def in_view(self, camera: Camera) -> Mask:
        """Plants (k,) of which something is in the image, as far as their crowns are upright spheroids."""
        radius, height = self.radius, self._of_crowns("height")
        return camera.distance_to_view(self.foot + height[:, None] * (0.0, 0.0, 0.5)) < radius

    @property
    def radius(self) -> Floats:
        """Radius (k,) of crowns, meters."""
        return self._of_crowns("radius")

    def _of_crowns(self, name: str) -> Floats:
        return np.array([getattr(crown, name) for crown in self.crowns])[self.which] * self.scale

    def parts(self, camera: Camera) -> tuple[CrownParts, Integers]:
        """Leaves and branches (n) of all plants as they stand, and the plant that each is on.

        Plants are turned any way. More stand for one that is near and in view.
        """
        away = np.linalg.norm(self.foot - camera.eye, axis=1)
        size = np.maximum(self.radius, self._of_crowns("height"))
        # Places and scales without a number, or with one too large, are for Refine to tell; here they count as nothing.
        finite = np.isfinite(away + size)
        away, size = (np.where(finite, of, 0.0) for of in (away, size))
        near = size / np.maximum(np.maximum(away, size), 1e-9)
        near = np.where(self.in_view(camera), near, near / _IN_VIEW)
        every = np.array([len(crown.parts) for crown in self.crowns])[self.which]
        counts = np.clip(np.ceil(_PARTS * near / max(near.sum(), 1e-9)), 1, every).astype(np.int64)
        order = np.empty(len(self.foot), np.int64)  # by places: that of a scene's objects is chance
        order[np.lexsort(np.round(self.foot.T, 4))] = np.arange(len(self.foot))
        turn = order * GOLDEN_TURN
        parts, plants = [CrownParts.empty()], [np.zeros(0, np.int64)]
        for number, crown in enumerate(self.crowns):
            members = np.flatnonzero((self.which == number) & finite)
            owner, index = spread(counts[members])
            plant = members[owner]
            each, scale = every[plant] / counts[plant], self.scale[plant]
            part = crown.parts.take(((index + turn[plant] % 1.0) * each).astype(np.int64) % every[plant])
            (x, y, z), angle = part.position.T * scale, order[plant] * GOLDEN_ANGLE
            x, y = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y
            part = replace(
                part,
                position=np.stack([x, y, z], axis=1) + self.foot[plant],
                number=part.number * each * self.number[plant],
                area=part.area * scale**2,
                width=part.width * scale,
                length=part.length * scale,
                reach=part.reach * scale,
            )
            parts.append(part)
            plants.append(plant)
        return CrownParts.concatenate(parts), np.concatenate(plants)


@dataclass(frozen=True)
class Estimate:
    """What a refinement will take."""

    plants: int
    primitives: float  # polygons and facets
    seconds: float
    memory: float  # bytes of the whole process with the result, and rendering it
    limit: str  # the setting that makes plants coarser; empty where none does


def estimate(
    stand: Stand,
    camera: Camera,
    settings: RefinementSettings,
    used: float,
    allowed: float,
    everything: bool = False,
    processes: int = 0,
) -> Estimate:
    """Estimate a refinement.

    Parameters
    ----------
    used : float
        Bytes that are taken already, and that the renderer will need for its picture.
    allowed : float
        Bytes left for results, see `memory.allowance`; infinite without a limit.
    everything : bool
        Whether plants are expanded instead of refined; limits do not hold then.
    processes : int
        That draw tiles beside Blender; 0 where it does so itself.
    """
    parts, plant = stand.parts(camera)
    whole = _polygons(stand.crowns, parts, stand.which[plant], camera)
    plants = round(stand.number.sum())
    seconds, memory = SECONDS + SECONDS_PER_PLANT * plants, used + BYTES_PER_PLANT * plants
    memory += BYTES_PER_PROCESS * processes
    if everything:
        faces = whole @ parts.number
        memory += BYTES_PER_TRIANGLE * float(faces[1])
        return Estimate(plants, float(faces[0]), seconds + float(SECONDS_EXPANDED @ faces), memory, "")
    wanted, opened = _numbers(stand, camera, settings, parts, plant, whole[0])
    most, limit = min((settings.max_polygons or np.inf, "Max Polygons"), (allowed / BYTES_PER_POLYGON, "Max Memory"))
    faces = min(wanted, (1.0 - RESERVE) * drawing.FULL * most)
    seconds += SECONDS_MADE * faces + float(SECONDS_OPENED @ opened) * faces / max(wanted, 1.0)
    busy = min(max(processes, 1) / max(camera.width // TILE, 1), 1.0)
    memory += (BYTES_PER_POLYGON + busy * BYTES_IN_TILE) * faces
    return Estimate(plants, faces, seconds, memory, limit if wanted > faces else "")


def _numbers(
    stand: Stand, camera: Camera, settings: RefinementSettings, parts: CrownParts, plant: Integers, whole: Floats
) -> tuple[float, Floats]:
    """Polygons and facets without limits, by `_polygons` (n,), and what is opened (2,), see `SECONDS_OPENED`."""
    pixels, extent = camera.width * camera.height, camera.extent_around(parts.position)
    inside = _inside(parts, camera, extent)
    outside = ~inside & (parts.form >= 0)
    leaves = np.where(outside, parts.number, 0.0) / _LEAVES
    beside = stand.in_view(camera)[plant]
    deep = _through(stand, parts, plant, extent)
    shadows, shadow = parts.take(outside), SHADOW * extent[outside]
    one, each, planes = _kites(stand.crowns, parts, stand.which[plant])[:, inside]
    parts = parts.take(inside)
    extent, whole = extent[inside], whole[inside]
    area, wide, wood = parts.area / extent**2, parts.width / extent, parts.form < 0
    before, here, covered = _in_depth(parts, camera, parts.number * area)
    coarser = _relative_side(primitives(_OVERLAP * covered, camera, settings.facet), settings.facet)
    facet = (coarser * settings.facet) ** 2
    most = _LAYERS * facet**0.1 + deep[inside]
    drawn = np.exp(-before / most) * -np.expm1(-here / most) * most / here
    # Leaves are facets, kites, or have their polygons; branches are triangles, or tubes.
    real = explicit_fraction(wide, coarser * settings.leaf_limit)
    faces = 1.0 + (planes - 1.0) * explicit_fraction(wide, one) + (whole - planes) * explicit_fraction(wide, each)
    leaf = (1.0 - real) * np.minimum(area / facet, 1.0) + real * faces
    tube = np.where(wide < BROAD, np.minimum(parts.sides, SIDES) * parts.segments, whole)
    tubes = explicit_fraction(wide, TUBES)
    bows = np.clip(np.sqrt(_BEND * parts.length / (BENT * extent)), 1.0, np.maximum(parts.segments, 1))
    branch = tubes * tube + (1.0 - tubes) * bows * np.clip(area / (TWIG * facet), 0.0, 1.0)
    drawn_number = drawn * parts.number
    seen = float(drawn_number @ np.where(wood, branch, leaf))
    # Areas without bounds are no number of facets.
    thrown = shadows.number / np.fmax((coarser * shadow) ** 2 / np.maximum(shadows.area, 1e-300), LIT_LEAVES)
    few = max(OUTSIDE_A_PIXEL * pixels, NEVER_TOO_MANY) / coarser**2
    unseen = _MERGED * seen + min(_THROWN * float(thrown.sum()), _THROWN_TIMES * few)
    # Of what is not seen a facet stands for several leaves.
    behind = (1.0 - drawn) * parts.number * area / np.maximum(HIDDEN_LEAVES * area, HIDDEN**2 * facet)
    for number, a_pixel in (
        (behind[~wood].sum(), HIDDEN_A_PIXEL),
        (leaves[beside].sum(), OUTSIDE_A_PIXEL),  # drawn with what is seen of the same plants
        (leaves[~beside].sum(), OUTSIDE_A_PIXEL),
    ):
        unseen += min(float(number), max(a_pixel * pixels, NEVER_TOO_MANY) / coarser**2)
    shown, total = (np.bincount(plant[inside], of, len(stand.number)) for of in (drawn_number, parts.number))
    plants = stand.number @ (shown / np.maximum(total, 1e-9))
    return seen + unseen, np.array([np.sqrt(plants), (drawn_number * branch)[wood].sum()])


def _inside(parts: CrownParts, camera: Camera, extent: Floats) -> Mask:
    """Leaves and branches (n,) of which something is in view."""
    # Of branches that are drawn as a whole, spheres around them are tested, as `Coverage.of_spheres` has them.
    sphere = np.sqrt(0.5) * parts.length
    away = np.inf if camera.kind == "ORTHO" else extent / camera.pixel_size
    branch = np.where(parts.width / extent < BROAD, parts.reach, sphere / np.maximum(1.0 - sphere / away, 0.1))
    reach = np.where(parts.form < 0, branch, 0.25 * parts.length)
    depth = camera.to_camera_space(parts.position)[:, 2]
    between = (camera.kind == "PANO") | ((depth + reach > camera.near) & (depth - reach < camera.far))
    return between & (camera.distance_to_view(parts.position) <= reach)


def _polygons(crowns: tuple[Crown, ...], parts: CrownParts, which: Integers, camera: Camera) -> Floats:
    """Polygons and triangles (2, n) of leaves and branches at the level of detail they have where they come nearest."""
    slope = 0.0 if camera.kind == "ORTHO" else camera.pixel_size
    extent = camera.extent_around(parts.position)
    extent = np.maximum(extent - slope * parts.reach, extent / NEARER)
    out = np.ones((2, len(parts)))
    for form, leaves in _by_form(crowns, parts, which):
        out[:, leaves] = chosen_polygons(form, _SHARE * parts.length[leaves] / extent[leaves] / TOLERANCE)
    wood = np.flatnonzero(parts.form < 0)
    sides, size = parts.sides[wood], parts.width[wood] / extent[wood] / 2.0
    around, along = finer(sides, size)
    buds = np.where(size > round_up_to(sides), parts.buds[wood], 0.0)
    out[:, wood] = around * parts.segments[wood] * along + buds * (BUD_RINGS - 1) * bud_sides(around)
    out[1, wood] *= 2.0
    return out


def _kites(crowns: tuple[Crown, ...], parts: CrownParts, which: Integers) -> Floats:
    """Widths in pixels up to which leaves are kites, and have one for each plane; how many planes that are (3, n)."""
    out = np.ones((3, len(parts)))
    for form, leaves in _by_form(crowns, parts, which):
        out[:, leaves] = np.array([[*kite_widths([form]), leaf_planes(form).polygons]]).T
    return out


def _by_form(crowns: tuple[Crown, ...], parts: CrownParts, which: Integers) -> Iterator[tuple[LeafModel, Integers]]:
    """Each known form of leaf, and those of parts (k,) that have it, of crowns (n,)."""
    for number, crown in enumerate(crowns):
        for kind, form in enumerate(crown.forms):
            leaves = np.flatnonzero((which == number) & (parts.form == kind))
            if form is not None and len(leaves):
                yield form, leaves


def _through(stand: Stand, parts: CrownParts, plant: Integers, extent: Floats) -> Floats:
    """Layers of leaves (n,) that are drawn beside those that fill pixels: of crowns that are small all are."""
    radius = np.maximum(stand.radius, 1e-9)
    # Of plants that stand for others as well, the leaves of one.
    through = np.bincount(plant, parts.number * parts.area, len(radius)) / (np.pi * radius**2 * stand.number)
    return through[plant] * np.minimum(DETAIL * extent / (2.0 * radius[plant]), 1.0)


def _in_depth(parts: CrownParts, camera: Camera, pixels: Floats) -> tuple[Floats, Floats, float]:
    """Layers (n,) before each of parts (n,) that have so many pixels (n,) in all, its own (n,), and covered pixels."""
    if not len(parts):
        return np.zeros(0), np.zeros(0), 0.0
    image = Coverage(camera, (0, 1))
    *place, depth = image.project(parts.position)
    sizes = (image.width, camera.width), (image.height, camera.height)  # with what lies around it, and without
    x, y = (np.clip((of - (all_ - core) / 2) / core, 0.0, 1.0) for of, (all_, core) in zip(place, sizes, strict=True))
    strips = max(round(np.sqrt(len(x) / _IN_CELL)), 1)
    column, wide = _groups(x, np.zeros(len(x), np.int64), strips)
    cell, tall = _groups(y, column, strips)
    size = np.maximum((wide[np.arange(len(tall)) // strips] * tall) * camera.width * camera.height, 1.0)
    order = np.lexsort((depth, cell))
    layers, cells = np.maximum(pixels / size[cell], 1e-12), cell[order]
    every = np.bincount(cell, layers, len(size))
    before = np.empty(len(parts))
    before[order] = np.cumsum(layers[order]) - layers[order] - (np.cumsum(every) - every)[cells]
    # A layer of what is turned all ways covers a part of its area.
    return before, layers, float(-(size * np.expm1(-LEVEL * every)).sum())


def _groups(place: Floats, group: Integers, number: int) -> tuple[Integers, Floats]:
    """Each group of things (n,) at places (n,) divided into so many of equally many: which (n,), and how wide (k,)."""
    order = np.lexsort((place, group))
    count = np.bincount(group)
    owner, rank = spread(count)
    out = np.empty(len(place), np.int64)
    out[order] = owner * number + rank * number // count[owner]
    many = np.bincount(out, minlength=len(count) * number)
    low, high = np.full(len(many), np.inf), np.full(len(many), -np.inf)
    np.minimum.at(low, out, place)
    np.maximum.at(high, out, place)
    # Those on the border stand for as much beyond it as is between two.
    return out, np.where(many > 1, (high - low) * many / np.maximum(many - 1, 1), 0.0)


#: Plants that are grown one and all, the nearest ones, and how many of the others tell about them.
_ALL, _SOME = 32, 16


def coarse_faces(flora: Flora, seeds: Seeds) -> Floats:
    """Expected polygons (2,) of plants far from any camera, and the triangles that these consist of."""
    plants = trunks(flora.rows, seeds)
    every, wood = flora.face_counts(plants), flora.branch_faces(plants)
    each = np.array([sum(f.triangles for f in leaf) / max(sum(f.polygons for f in leaf), 1) for leaf, _ in flora.forms])
    return np.array([every.sum(), (2.0 * wood + (every - wood) * each[flora.species_of(plants.row)]).sum()])


def expanded_faces(flora: Flora, seeds: Seeds, camera: Camera) -> Iterator[Floats]:
    """Expected polygons (2,) of all plants as `expanded_blocks` makes them for a camera, and triangles.

    Yields
    ------
    (2,) float64
        Numbers that are more with each item, of which the last ones count; who waits for a limit may stop before.
    """
    plants, total = trunks(flora.rows, seeds), coarse_faces(flora, seeds)
    yield total
    bound = extents(flora, plants)
    across = np.maximum(bound[:, 0], np.abs(bound[:, 1:3]).max(axis=1)) * plants.length
    order = np.argsort(np.linalg.norm(plants.position - camera.position, axis=1) - across, kind="stable")
    detail = LeafDetail(flora, camera)
    rest = order[_ALL:]
    sample = rest[np.linspace(0, len(rest) - 1, min(_SOME, len(rest))).round().astype(np.int64)]
    each = np.repeat([1.0, len(rest) / max(len(sample), 1)], [min(_ALL, len(order)), len(sample)])
    for one, times in zip(np.concatenate([order[:_ALL], sample]), each, strict=True):
        total = total + times * _more(flora, plants.take(one[None]), detail)
        yield total


def _more(flora: Flora, plants: Branches, detail: LeafDetail) -> Floats:
    """Polygons and triangles (2,) of plants beyond those of the models of their species."""
    faces = np.zeros(2)
    for whole in expand(flora, plants):
        wood = tube_faces(flora, whole, detail.wood) - tube_faces(flora, whole)
        faces += _finer_leaves(flora, whole, detail) + wood * np.array([1.0, 2.0])
    return faces


def _finer_leaves(flora: Flora, whole: WholeBranches, detail: LeafDetail) -> Floats:
    lengths, leaves = detail.lengths(whole), leaf_counts(flora.rows, whole.branches)
    faces, near = np.zeros(2), np.flatnonzero((lengths > 0.0) & (leaves > 0))
    species = flora.rows["species"][whole.branches.row[near]]
    for s in np.unique(species):
        branches = near[species == s]
        forms = flora.forms[s][0]
        each = [chosen_polygons(f, _SHARE * lengths[branches]) for f in forms]
        plain = np.mean([(f.polygons, f.triangles) for f in forms], axis=0)
        faces += (np.mean(each, axis=0) - plain[:, None]) @ leaves[branches]
    return faces
