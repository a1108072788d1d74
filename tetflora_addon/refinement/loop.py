# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The main loop: visibility, refinement, update, until the image gains nothing more (paper, section 6.2); and sums.

A pass costs what it changes: only divided tetrahedra give their contents away, only new ones are drawn and summed up.

Outliers are a few things far beyond all others that nobody sees, such as a plant that slipped to the end of the world.
The root of the tree holds all that there is. One plant 1,000 km away takes twenty levels of division before there is
anything of the size of the others, and with that what the settings allow. Outliers are left out, and named.
"""

import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, Integers32, Mask
from ..camera.camera import Camera, expected_pixels
from ..compiled.flora import Flora
from ..errors import listed
from ..growth.growth import trunks
from ..growth.seeds import Branches, Seeds
from ..tetrahedra.geometry import squared_edges
from ..tetrahedra.roots import view_root, world_root
from ..tetrahedra.tree import TetrahedralTree
from .contents import Contents, PlantParts, PolygonsByCell, Totals, bounding_box, in_the_root, sort_into_children, sums
from .decisions import Decision, Terminals, decide, gains_nothing, without_splits
from .lights import Light, decide_by_shadows, seen_ground, shadows_of
from .polygons import Polygons
from .settings import QUALITIES, RefinementSettings
from .shared_parts import PlacedAssets, SharedAssets, SharedParts, SharedPlants
from .visibility import AlphaBuffer, Buffers, is_anchored, pixels_of_buffer, widened_for

#: How much coarser than asked for facets are before somebody is told.
COARSER = 1.5


@dataclass(frozen=True)
class Step:
    """The state after one pass through the loop."""

    #: tetrahedra_made and levels: all tetrahedra ever made, and how deep their tree is.
    tetrahedra_made: int
    levels: int
    #: split, proxy, hidden and explicit: tetrahedra that hold something, by what was decided on them.
    split: int
    proxy: int
    hidden: int
    explicit: int
    #: subplants and pieces: their contents: sub-plants, pieces of branches.
    subplants: int
    pieces: int
    polygons: int  # expected polygons of what is to be explicit
    seconds: float  # wall clock since the loop began
    memory_mb: float  # megabytes of the tree and of what it holds


@dataclass
class Statistics:
    """Counts and seconds of one refinement; ``as_dict`` is what JSON output holds."""

    plants: int = 0  # plants that took part
    polygons_full: int = 0  # polygons of all plants expanded (compiled estimate)
    #: polygons_meshed and polygons_proxy: polygons of the plants' meshes, and faces of proxies.
    polygons_meshed: int = 0
    polygons_proxy: int = 0
    #: instances, instances_whole and instances_clusters: instances of assets that took part; those that are drawn as
    #: the originals, and clusters as meshes of their own.
    instances: int = 0
    instances_whole: int = 0
    instances_clusters: int = 0
    #: tetrahedra_made, _terminal and _proxy: all that were ever made; those that are not divided; of these, proxies.
    tetrahedra_made: int = 0
    tetrahedra_terminal: int = 0
    tetrahedra_proxy: int = 0
    #: Passes through the loop; ``levels`` in `as_dict`, as in saved files and the output of the command line.
    passes: int = 0
    facet_pixels: float = 0.0  # side of the facets of proxies, pixels, which a budget may have increased; 0 for shells
    facet_asked: float = 0.0  # that which the settings ask for
    complete: bool = True  # false where a limit of the settings stopped the loop
    #: Wall clock by stage: ``read``, ``compile``, ``refine``, ``emit``.
    seconds: dict[str, float] = field(default_factory=dict)
    memory_mb: float = 0.0  # estimated megabytes of the meshes in Blender
    steps: list[Step] = field(default_factory=list)  # one for each pass through the loop
    #: Objects of which some was left out, as it is far beyond all others, and how far from the camera, meters.
    outliers: dict[str, float] = field(default_factory=dict)
    unknown: str = ""  # tells of plants that were left out because nobody has their species

    @property
    def left_out(self) -> str:
        """A warning about what is unknown, or about outliers; empty where there are none."""
        if not self.outliers or self.unknown:
            return self.unknown
        far = f"{listed(sorted(self.outliers))}, {min(self.outliers.values()) / 1e3:,.0f} km from the camera"
        return f"Left out, because too far to be seen: {far}, far beyond all else; move it closer or delete it"

    @property
    def coarser(self) -> str:
        """A warning where facets are coarser than asked for by a half or more; else an empty text."""
        if not self.facet_asked or self.facet_pixels < COARSER * self.facet_asked:
            return ""
        return (
            f"Facets are {self.facet_pixels:.2g} pixels large, where {self.facet_asked:.2g} are set: no more fit into "
            "Max Memory or Max Polygons. Raise these, or render a smaller image"
        )

    def as_dict(self) -> dict:
        """Plain dictionary, ready for JSON."""
        fields_ = {"levels" if name == "passes" else name: value for name, value in asdict(self).items()}
        return {**fields_, "coarser": self.coarser}


class Stopwatch:
    """Adds up wall clock by stage, in ``seconds``."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Add the time since the last lap to a stage."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now


#: Outliers are so many times as far from the camera as all others, or as so many meters if these are nearer.
GAP, NEAR = 16.0, 1000.0
#: There are at most so many, or that fraction of all things, and never more than of the others.
MOST, FRACTION = 8, 0.01
#: Pixels under which nobody sees a thing.
UNSEEN = 1.0
_NONE = np.zeros(0, np.int64)


@dataclass(frozen=True)
class Outliers:
    """What is left out of a scene."""

    #: plants, assets, instances, (k,), (l,), (m,): rows of seeds, of instances of assets, and of those of other meshes.
    plants: Integers = field(default_factory=lambda: _NONE)
    assets: Integers = field(default_factory=lambda: _NONE)
    instances: Integers = field(default_factory=lambda: _NONE)
    away: Floats = field(default_factory=lambda: np.zeros(0))  # (k + l + m,): how far they are from the camera, meters

    def others(self, seeds: Seeds, polygons: Polygons, placed: PlacedAssets) -> tuple[Seeds, Polygons, PlacedAssets]:
        """What is left of plants, polygons and instances of assets."""
        if len(self.plants):
            seeds = seeds.take(np.delete(np.arange(len(seeds)), self.plants))
        if len(self.instances):
            polygons = polygons.take(np.flatnonzero(~np.isin(polygons.instance, self.instances)))
        if len(self.assets):
            placed = placed.take(np.delete(np.arange(len(placed)), self.assets))
        return seeds, polygons, placed


def outliers_of(
    flora: Flora, seeds: Seeds, camera: Camera, polygons: Polygons | None = None, placed: PlacedAssets | None = None
) -> Outliers:
    """Outliers among plants, assets and instances of other meshes; nothing depends on their order."""
    center, reach = seeds.position, np.zeros(len(seeds))
    plants_end = assets_end = len(seeds)
    if placed is not None and len(placed):
        wholes = placed.wholes()
        center, reach = np.concatenate([center, wholes.center]), np.append(reach, wholes.reach)
        assets_end += len(placed)
    if polygons is not None and len(polygons):
        number = len(polygons.meshes.surface)
        low, high = np.full((number, 3), np.inf), np.full((number, 3), -np.inf)
        np.minimum.at(low, polygons.instance, polygons.center - polygons.reach[:, None])
        np.maximum.at(high, polygons.instance, polygons.center + polygons.reach[:, None])
        others = (low + high) / 2.0, np.linalg.norm(high - low, axis=1) / 2.0
        center, reach = np.concatenate([center, others[0]]), np.append(reach, others[1])
    away = np.linalg.norm(center - camera.eye, axis=1)
    far = far_off(away - reach)
    plants = far[far < plants_end]
    if len(plants):
        reach[plants] = PlantParts.of_subplants(flora, trunks(flora.rows, seeds.take(plants))).extent
    for eye in (camera, *camera.shutter):
        far = far[_unseen(eye, center[far], reach[far], away[far])]
    first, last = far < plants_end, far >= assets_end
    return Outliers(far[first], far[~first & ~last] - plants_end, far[last] - assets_end, away[far])


def far_off(away: Floats) -> Integers:
    """The few (k,) of things by their distances (n,) that are far beyond all others, meters."""
    most = min(max(MOST, int(FRACTION * len(away))), len(away) // 2)
    if most == 0:
        return _NONE
    first = len(away) - most - 1
    last = np.argpartition(away, first)[first:]
    last = last[np.argsort(away[last], kind="stable")]
    from_here = np.maximum(away[last], NEAR)
    gaps = np.flatnonzero(from_here[1:] > GAP * from_here[:-1])
    return np.sort(last[gaps[0] + 1 :]) if len(gaps) else _NONE


def _unseen(camera: Camera, center: Floats, reach: Floats, away: Floats) -> Mask:
    """Things (n,) that are specks, or out of the view and too far for their shadows to fall into it."""
    specks = 2.0 * reach < UNSEEN * camera.extent_around(center)
    depth = away if camera.kind == "PANO" else camera.to_camera_space(center)[:, 2]
    out = (depth - reach > camera.far) | (depth + reach < camera.near) | (camera.distance_to_view(center) > reach)
    return specks | (out & (GAP * reach < away))


#: Bisections between two visibility steps; three together divide a tetrahedron into eight parts.
GENERATIONS = 3
#: Pixels of the image by which things may always reach beyond a plane; smaller sub-plants stay whole.
SLACK = 2.0
#: Fragments of polygons, beside two for each polygon, from which on none are cut any more: each goes where most of it
#: is. Large faces that cross each other's space a thousand times would fill all memory.
MOST_FRAGMENTS = 200_000
#: Blocks are so many times as large where no plant has leaves: what is seen through hides little that is worth finding.
BARE_BLOCK = 1.5
#: Weight of the pixels of what is divided for its shadow: as often as possible, where it is in view.
ALWAYS = 1e30


@dataclass(frozen=True)
class Refinement:
    """State of the loop after a pass; the last one is the result.

    The tree and its contents grow with the loop: those of an intermediate state are valid until the next one is made.
    """

    tree: TetrahedralTree
    plants: SharedPlants  # all plants, shared among terminal nodes
    assets: SharedAssets  # all instances of assets, likewise
    cell_polygons: PolygonsByCell  # all polygons, in terminal nodes
    cells: Terminals  # of t: terminal nodes that hold something
    transmittance: Floats  # (t,): fraction of each one's light that nothing in front of it blocks
    decision: NDArray[np.int8]  # (t,): `Decision` for each of them
    rank: Integers32  # (t,): front-to-back order of them
    passes: int  # passes so far
    complete: bool  # false where a limit of the settings stopped the loop
    seconds: dict[str, float]  # wall clock by step
    outliers: Outliers = field(default_factory=Outliers)  # what is left out
    lights: Sequence[Light] = ()  # those that throw shadows
    polygons: Polygons = field(default_factory=Polygons.empty)  # all of them, whole

    @property
    def nodes(self) -> Integers:
        """Terminal nodes (t,) that hold something."""
        return self.cells.nodes

    @property
    def totals(self) -> Totals:
        """Totals (t,) of these nodes."""
        return self.cells.totals

    @property
    def contents(self) -> Contents:
        """All plants and polygons, in terminal nodes: a copy, with a sub-plant for each node that it is shared by."""
        subplants, branches = self.plants.held_apart(len(self.tree))
        return Contents(subplants, branches, self.cell_polygons.polygons)

    @property
    def in_view(self) -> Mask:
        """Mask over all nodes of the tree (nodes,): those that hold something and are within the view, if in part."""
        # The pieces of a view's own root know whether they are part of it; others are in view where they have pixels.
        if self.tree.inside.any():
            return self.tree.inside
        mask = np.zeros(len(self.tree), dtype=bool)
        mask[self.nodes[self.cells.pixels > 0.0]] = True
        return mask

    def chosen(self, *decisions: Decision) -> Mask:
        """Mask over all nodes of the tree (nodes,) of those with one of the decisions."""
        mask = np.zeros(len(self.tree), dtype=bool)
        mask[self.nodes[np.isin(self.decision, decisions)]] = True
        return mask


def refine(
    flora: Flora,
    seeds: Seeds,
    camera: Camera,
    settings: RefinementSettings,
    occluders: Floats | None = None,
    polygons: Polygons | None = None,
    lights: Sequence[Light] = (),
    placed: PlacedAssets | None = None,
) -> Generator[Refinement, bool | None, Refinement]:
    """Run the loop; yields the state after the decisions of each pass and returns the last.

    Sending True ends it there: what was to be divided stays as it is, and the result is not complete.

    Parameters
    ----------
    flora : Flora
        Compiled species, in the order of ``seeds.identifiers``.
    seeds : Seeds
        At least one plant, or none where there are polygons or assets.
    occluders : (t, 3, 3) float64, optional
        Triangles of explicit polygons that hide what is behind them, meters.
    polygons : Polygons, optional
        Explicit polygons to refine along with the plants.
    lights : sequence of Light
        What throws shadows into the view is finer; hidden tetrahedra are refined for theirs with a ``shadow_cutoff``.
    placed : PlacedAssets, optional
        Instances of assets.
    """
    clock = Stopwatch()
    placed = PlacedAssets.none() if placed is None else placed
    polygons = Polygons.empty() if polygons is None else polygons
    outliers = outliers_of(flora, seeds, camera, polygons, placed)
    seeds, polygons, placed = outliers.others(seeds, polygons, placed)
    filled = bool(np.isfinite(settings.proxy_block))
    plants, assets = SharedPlants(flora, seeds, camera, filled), SharedAssets(placed, camera, filled)
    settings = _on_day(settings, flora, plants.parts.branches)
    pixels = int(max(camera.width, camera.height, QUALITIES["FINAL"]["visibility_resolution"]))  # finer is of no use
    settings = replace(settings, visibility_resolution=min(settings.visibility_resolution, pixels))
    camera = widened_for(camera, settings.margin, flora, plants.parts.branches, polygons, assets.parts)
    slack = _slack(camera, settings.visibility_resolution)
    held = in_the_root(polygons, camera)
    bounds = _bounds(flora, plants, assets, polygons)
    tree = world_root(bounds, camera.origin) if is_anchored(camera, settings) else view_root(camera, bounds)
    cell_polygons, most = PolygonsByCell(sort_into_children(tree, held, slack)), MOST_FRAGMENTS + 2 * len(held)
    divided = np.arange(len(tree)) == 0
    shared = plants, assets
    for kind in shared:
        kind.update(tree, divided, np.where(divided, np.inf, 0.0))
    clock.lap("update")
    shadowed = bool(lights) and settings.shadow_cutoff > 0.0
    heights = [places[:, 2] for places in (seeds.position, placed.instances.position, polygons.center)]
    ground = seen_ground(camera, occluders, float(np.median(np.concatenate(heights)))) if shadowed else None
    buffers = Buffers(camera, settings.visibility_resolution, occluders)
    # Generations count from the root's own pieces. Passes do not count: a late one may divide what is still coarse.
    deepest = tree.levels - 1 + settings.max_levels
    every = _filled(tree, shared, cell_polygons, np.ones(len(tree), bool))
    cells, buffer = _drawn(tree, buffers, None, Terminals.empty(), *every)
    clock.lap("visibility")
    passes = 0
    while True:
        passes += 1
        rank = tree.order(**camera.line_of_sight)
        transmittance = buffer.transmittance(np.maximum(rank, 0))[cells.nodes]
        clock.lap("visibility")
        decision = decide(cells, transmittance, settings)
        splitting = decision == Decision.SPLIT
        if gains_nothing(splitting, cells, transmittance, camera):
            decision = without_splits(decision, cells, transmittance, settings)
            splitting[:] = False
        by_shadow = ground is not None and not splitting.any()
        if by_shadow:
            # Only now it is known what is seen, and can receive shadows.
            shadows = shadows_of(tree, cells, decision, lights, camera, ground, settings)
            decision = decide_by_shadows(decision, shadows, cells, settings)
            splitting = decision == Decision.SPLIT
        full = bool(settings.max_tetrahedra - tree.tetrahedra_made < 2 * splitting.sum())
        last = passes == settings.max_passes
        barred = splitting & (full | last | (tree.level[cells.nodes] >= deepest))
        limited = bool(barred.any())
        instead = Decision.HIDDEN if by_shadow else without_splits(decision, cells, transmittance, settings)
        if limited:
            decision = np.where(barred, instead, decision).astype(np.int8)
            splitting &= ~barred
        clock.lap("refinement")
        ranks, seconds = rank[cells.nodes], dict(clock.seconds)
        outcome = cells, transmittance, decision, ranks, passes, not limited, seconds, outliers, lights, polygons
        state = Refinement(tree, plants, assets, cell_polygons, *outcome)
        if not splitting.any():
            return state
        if (yield state):
            as_it_is = np.where(splitting, instead, decision).astype(np.int8)
            return replace(state, decision=as_it_is, complete=False)
        parents = cells.nodes[splitting]
        fractions = np.where(by_shadow, ALWAYS, transmittance * cells.opacity)[splitting]
        _split(tree, parents, fractions, camera, settings, deepest)
        clock.lap("refinement")
        dividing, edge = np.zeros(len(tree), bool), np.zeros(len(tree))
        dividing[parents] = True
        edge[parents] = np.sqrt(squared_edges(tree.vertices(parents)).max(axis=1))
        loose = slack if len(cell_polygons) <= most else lambda points: np.full(len(points), np.inf)
        new = sort_into_children(tree, cell_polygons.take_within(dividing), loose)
        cell_polygons.append(new)
        changed = plants.update(tree, dividing, edge) | assets.update(tree, dividing, edge)
        changed[new.cell] = True
        clock.lap("update")
        buffer.remove(changed)
        kept = cells.take(np.flatnonzero(~changed[cells.nodes]))
        cells, buffer = _drawn(tree, buffers, buffer, kept, *_filled(tree, shared, cell_polygons, changed))
        clock.lap("visibility")


def _bounds(flora: Flora, plants: SharedPlants, assets: SharedAssets, polygons: Polygons) -> Floats:
    """Axis-aligned box (2, 3) of all that is there, meters."""
    boxes = [bounding_box(flora, plants.parts.branches)] if len(plants.parts) else []
    for group in filter(len, (assets.parts, polygons)):
        boxes.append(((group.center.T - group.reach).min(axis=1), (group.center.T + group.reach).max(axis=1)))
    return np.stack([np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)])


def _filled(
    tree: TetrahedralTree, shared: Sequence[SharedParts], cell_polygons: PolygonsByCell, changed: Mask
) -> tuple[Integers, Totals]:
    """Nodes (n,) whose contents have changed and that hold something, and their totals."""
    pairs = [*(kind.totals(changed) for kind in shared), *cell_polygons.totals(changed)]
    every = sums(Totals.concatenate([t for t, _ in pairs]), np.concatenate([c for _, c in pairs]), len(tree))
    nodes = np.flatnonzero(every.area > 0)
    return nodes, every.take(nodes)


def _drawn(
    tree: TetrahedralTree, buffers: Buffers, old: AlphaBuffer | None, cells: Terminals, nodes: Integers, totals: Totals
) -> tuple[Terminals, AlphaBuffer]:
    """Terminals that are there and new ones, and the buffer into which all of them are drawn."""
    buffer = buffers.fit(old, len(cells) + len(nodes))
    if buffer is not old:
        nodes, totals = np.concatenate([cells.nodes, nodes]), Totals.concatenate([cells.totals, totals])
        cells = Terminals.empty()
    return Terminals.concatenate([cells, Terminals.seen(tree, nodes, totals, buffers.camera, buffer)]), buffer


def _slack(camera: Camera, resolution: int) -> Callable[[Floats], Floats]:
    """A pixel of the alpha buffer, in meters: nothing smaller changes decisions."""
    pixels = max(pixels_of_buffer(camera, resolution), SLACK)
    return lambda points: pixels * camera.extent_around(points)


def _on_day(settings: RefinementSettings, flora: Flora, plants: Branches) -> RefinementSettings:
    """Settings for plants (n,) with the leaves that they have on a day of the year."""
    if flora.day is None or not len(plants):
        return settings
    share = float(np.minimum(flora.day.leaf_share(plants), 1.0).mean())
    return replace(settings, block=settings.block * (BARE_BLOCK + share * (1.0 - BARE_BLOCK)))


def _split(
    tree: TetrahedralTree, nodes: NDArray, fraction: NDArray, camera: Camera, settings: RefinementSettings, deepest: int
) -> None:
    """Divide large nodes into eight as suits their shape, others in two as long as their pixels exceed the cutoff."""
    pixels, _ = expected_pixels(tree.vertices(nodes), camera)
    # An eighth has a quarter of the pixels: where that is above the cutoff, all eight would be made anyway.
    large = (pixels * fraction > 4.0 * settings.cutoff**2) & (tree.level[nodes] + GENERATIONS <= deepest)
    # In an anchored tree the same place must be divided alike, whatever the camera sees of it.
    large &= not is_anchored(camera, settings)
    if large.any() and tree.tetrahedra_made + 8 * large.sum() <= settings.max_tetrahedra:
        tree.split_by_shape(nodes[large])
        nodes, fraction = nodes[~large], fraction[~large]
    for _ in range(GENERATIONS):
        if len(nodes) == 0 or tree.tetrahedra_made + 2 * len(nodes) > settings.max_tetrahedra:
            return
        nodes = tree.split(nodes).reshape(-1)
        fraction = np.repeat(fraction, 2)
        pixels, whole = expected_pixels(tree.vertices(nodes), camera)
        # What is beside the view is divided for other reasons than its pixels.
        large = (pixels * fraction > settings.cutoff**2) | (~whole & (fraction == 0.0))
        large &= tree.level[nodes] < deepest
        nodes, fraction = nodes[large], fraction[large]


def step_of(state: Refinement) -> Step:
    """Figures of a state, valid only before the loop goes on."""
    numbers = np.bincount(state.decision, minlength=len(Decision)).tolist()
    explicit = state.decision == Decision.EXPLICIT
    subplants, branches = state.plants.numbers
    return Step(
        tetrahedra_made=int(state.tree.tetrahedra_made),
        levels=int(state.tree.levels),
        **{one.name.lower(): numbers[one] for one in Decision if one != Decision.EMPTY},
        subplants=subplants,
        pieces=branches,
        polygons=round(float(state.totals.polygons[explicit].sum())),
        seconds=sum(state.seconds.values()),
        memory_mb=(state.tree.nbytes + state.plants.nbytes + state.assets.nbytes + state.cell_polygons.nbytes) / 1e6,
    )
