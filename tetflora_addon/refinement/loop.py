# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The main loop: visibility, refinement, update, until the picture gains nothing more (paper, section 6.2)."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..plants.compiled import Flora
from ..plants.seeds import Seeds
from ..tetrahedra.geometry import volume
from ..tetrahedra.roots import view_root
from ..tetrahedra.tree import TetrahedralTree
from .camera import Camera
from .contents import Amounts, Contents, bounding_box, node_amounts, push_down
from .decisions import Decision, decide, feature_pixels
from .rasterise import buffer_size, occluder_depth
from .settings import RefinementSettings
from .silhouette import silhouette_pixels
from .statistics import Stopwatch
from .visibility import Visibility, visibility

#: Bisections between two visibility steps; three together divide a tetrahedron into eight.
GENERATIONS = 3


@dataclass(frozen=True)
class Refinement:
    """State of the loop after a pass; the last one is the result.

    Attributes
    ----------
    tree : TetrahedralTree
    contents : Contents
        All plants, in terminal nodes.
    nodes : (t,) int
        Terminal nodes that hold something.
    decision : (t,) int8
        `Decision` for each of them.
    rank : (t,) int32
        Front-to-back order of them.
    amounts : Amounts of t
    seen : Visibility of t
    passes : int
        Passes so far.
    complete : bool
        False where a limit of the settings stopped the loop.
    seconds : dict of str to float
        Wall clock by step.
    """

    tree: TetrahedralTree
    contents: Contents
    nodes: NDArray[np.intp]
    decision: NDArray[np.int8]
    rank: NDArray[np.int32]
    amounts: Amounts
    seen: Visibility
    passes: int
    complete: bool
    seconds: dict[str, float]

    def chosen(self, *decisions: Decision) -> NDArray[np.bool_]:
        """Mask over all nodes of the tree (nodes,) of those with one of the decisions."""
        mask = np.zeros(len(self.tree), dtype=bool)
        mask[self.nodes[np.isin(self.decision, decisions)]] = True
        return mask


def mean_extinction(amounts: Amounts, volumes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Extinction κ (n,) of tetrahedra in 1/m, as if surfaces faced all ways.

    Notes
    -----
    Randomly turned, a leaf shows half its one-sided area and a closed branch a quarter of its surface (Cauchy 1832).
    """
    return (amounts.leaf_area / 2 + amounts.wood_area / 4) / volumes


def refine(
    flora: Flora,
    seeds: Seeds,
    camera: Camera,
    settings: RefinementSettings,
    occluders: NDArray[np.float64] | None = None,
) -> Generator[Refinement, None, Refinement]:
    """Run the loop; yields the state after the decisions of each pass and returns the last.

    Parameters
    ----------
    flora : Flora
        Compiled species, in the order of ``seeds.identifiers``.
    seeds : Seeds
        At least one plant.
    camera : Camera
    settings : RefinementSettings
    occluders : (t, 3, 3) float64, optional
        Triangles of explicit polygons that hide what is behind them, metres.
    """
    clock = Stopwatch()
    camera = camera.widened(settings.margin)
    contents = Contents.of_plants(flora, seeds)
    tree = view_root(camera, bounding_box(flora, contents.subplants))
    contents = push_down(flora, tree, contents)
    clock.lap("update")
    depth = None
    if occluders is not None and len(occluders):
        depth = occluder_depth(occluders, camera, *buffer_size(camera, settings.visibility_resolution))
    clock.lap("visibility")
    direction = {"eye": camera.position} if camera.kind == "PERSP" else {"direction": -camera.frame[:, 2]}
    # Generations count from the root's own pieces. Passes do not count: a late one may divide what is still coarse.
    deepest = tree.levels - 1 + settings.max_levels
    passes = 0
    while True:
        passes += 1
        every = node_amounts(flora, contents, len(tree))
        nodes = np.flatnonzero(every.leaf_area + every.wood_area > 0)
        amounts = _of(every, nodes)
        vertices = tree.vertices(nodes)
        rank = tree.order(**direction)[nodes]
        clock.lap("update")
        extinction = mean_extinction(amounts, volume(vertices))
        seen = visibility(vertices, extinction, rank, camera, settings.visibility_resolution, depth)
        clock.lap("visibility")
        decision = decide(vertices, amounts, seen, camera, settings)
        splitting = decision == Decision.SPLIT
        room = settings.max_tetrahedra - tree.tetrahedra_made
        full = bool(room < 2 * splitting.sum())
        barred = splitting & (full | (tree.level[nodes] >= deepest))
        limited = bool(barred.any())
        if limited:
            decision = np.where(barred, _without_splits(decision, vertices, amounts, camera, settings), decision)
            splitting &= ~barred
        clock.lap("refinement")
        state = Refinement(
            tree, contents, nodes, decision, rank, amounts, seen, passes, not limited, dict(clock.seconds)
        )
        if not splitting.any():
            return state
        yield state
        _split(
            tree, nodes[splitting], seen.transmittance[splitting] * seen.opacity[splitting], camera, settings, deepest
        )
        clock.lap("refinement")
        divided = tree.children[:, 0] >= 0
        moving = contents.within(divided)
        contents = Contents.joined(contents.within(~divided), push_down(flora, tree, moving))
        clock.lap("update")


def _split(
    tree: TetrahedralTree, nodes: NDArray, share: NDArray, camera: Camera, settings: RefinementSettings, deepest: int
) -> None:
    """Bisect nodes several times, each as long as its pixels, seen as well as its ancestor, exceed the cutoff."""
    for _ in range(GENERATIONS):
        if len(nodes) == 0 or tree.tetrahedra_made + 2 * len(nodes) > settings.max_tetrahedra:
            return
        nodes = tree.split(nodes).reshape(-1)
        share = np.repeat(share, 2)
        pixels, whole = silhouette_pixels(tree.vertices(nodes), camera)
        large = ~whole | (pixels * share > settings.cutoff**2)  # pixels are not known for what leaves the view
        large &= tree.level[nodes] < deepest
        nodes, share = nodes[large], share[large]


def _without_splits(
    decision: NDArray[np.int8], vertices: NDArray, amounts: Amounts, camera: Camera, settings: RefinementSettings
) -> NDArray[np.int8]:
    """What becomes of tetrahedra that would be split when a limit forbids it: leaves of a pixel stay leaves."""
    leafy = feature_pixels(vertices, amounts.width, camera) >= settings.leaf_limit
    instead = np.where(leafy, Decision.EXPLICIT, Decision.PROXY)
    return np.where(decision == Decision.SPLIT, instead, decision).astype(np.int8)


def _of(amounts: Amounts, nodes: NDArray) -> Amounts:
    return Amounts(amounts.leaf_area[nodes], amounts.wood_area[nodes], amounts.polygons[nodes], amounts.width[nodes])
