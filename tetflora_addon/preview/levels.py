# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The states of the loop, one after the other, as small as a preview needs them (paper, figure 8), and their colors.

Plants and pieces are gone; the number, extinction and color of the tetrahedra stay. Corners and the order of drawing
come from the last state's tree: nodes keep their numbers, and a tetrahedron that is divided later stands in the tree's
order where its parts stand. Colors are RGB as a screen shows them (sRGB), 0 to 1.

To be drawn, each tetrahedron is at most four triangles with opacity (paper, section 4, figure 3). The method is that of
Shirley and Tuchman, "A polygonal approximation to direct scalar volume rendering", 1990. Cases are told apart without
projecting anything. Let c be the barycentric coordinates of the eye in a tetrahedron with the vertices v: Σ c v is the
eye itself, so that the directions from the eye to the vertices weigh up to nothing under c. Vertices with positive c
therefore span the very ray that those with negative c span: one ray that meets a vertex and the face opposite it (one
sign against three), or two opposite edges (two against two). This is the ray on which the tetrahedron is thickest. For
parallel rays the barycentric coordinates of their direction take the eye's place.
"""

from collections.abc import Generator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers, Integers32, Mask, srgb_of
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..refinement.contents import Contents
from ..refinement.decisions import Decision, contributions, mean_extinction
from ..refinement.loop import Refinement, Step, step_of
from ..subplants.pieces import piece_leaf_colors
from ..tetrahedra.geometry import barycentric_gradients, volume
from ..tetrahedra.tree import TetrahedralTree

#: Bytes that all levels may take together, beside the tree; levels in between are left out beyond.
MOST_BYTES = 256_000_000
#: By what was decided; the overlay's text has the same colors. Blue and orange, which few eyes confuse.
FORMS: dict[Decision, tuple[float, float, float]] = {
    Decision.SPLIT: (0.95, 0.95, 0.95),
    Decision.EXPLICIT: (0.35, 0.85, 0.25),
    Decision.PROXY: (1.0, 0.6, 0.1),
    Decision.HIDDEN: (0.4, 0.6, 1.0),
}
#: From little to much, evenly apart in lightness.
_RAMP = np.array([(0.25, 0.1, 0.45), (0.2, 0.35, 0.75), (0.1, 0.65, 0.65), (0.5, 0.85, 0.35), (1.0, 0.92, 0.3)])
#: Contributions are shown by their logarithm between these, pixels.
_LEAST, _MOST = 0.25, 1_024.0


@dataclass(frozen=True)
class Level(Arrays):
    """The tetrahedra that hold something after one pass."""

    nodes: Integers32  # (t,): their nodes in the tree
    depth: NDArray[np.int16]  # (t,): planes between the root and each
    decision: NDArray[np.int8]  # (t,): `Decision`; in all levels but the last some are still to be divided
    visibility: Floats32  # (t,): fraction of each one's light that nothing in front blocks; 0 out of view
    contribution: Floats32  # (t,): pixels of the image that its contents change
    extinction: Floats32  # (t,): κ of its contents spread evenly, 1/m; optical depth is κ times the way through it
    color: Floats32  # (t, 3): mean color of its contents, linear RGB
    figures: Step  # counts for the overlay
    number: int  # pass of the loop, from 0


class Levels:
    """All levels of a refinement, and the tree in which they stand.

    Parameters
    ----------
    levels : list of Level
        From coarse to fine, at least one.
    tree : TetrahedralTree
        Of the last state.
    camera : Camera
        For which it was refined, and from whose `origin` all corners count.
    """

    def __init__(self, levels: list[Level], tree: TetrahedralTree, camera: Camera) -> None:
        self.levels, self.tree, self.camera = levels, tree, camera
        # A terminal below each node: its place in the tree's order is where the node itself would stand.
        below, children = np.arange(len(tree)), tree.children[:, 0]
        while (inner := np.flatnonzero(children[below] >= 0)).size:
            below[inner] = children[below[inner]]
        self._below = below

    def __len__(self) -> int:
        return len(self.levels)

    @property
    def nbytes(self) -> int:
        """Bytes of levels and tree."""
        return sum(level.nbytes for level in self.levels) + self.tree.nbytes + self._below.nbytes

    def at(self, number: int) -> Level:
        """A level, 0 for the root; beyond the last one, the last."""
        return self.levels[min(max(number, 0), len(self.levels) - 1)]

    def vertices(self, level: Level, chosen: NDArray | slice = slice(None)) -> Floats32:
        """Corners (t, 4, 3) float32 of a level's tetrahedra, or of some, meters from the camera's `origin`."""
        return self.tree.vertices(level.nodes[chosen]).astype(np.float32)

    def back_to_front(self, level: Level, camera: Camera, chosen: NDArray | None = None) -> Integers:
        """Exact back-to-front order of a level's places (t,), or of those ``chosen`` (k,), for any camera there."""
        places = np.arange(len(level)) if chosen is None else chosen
        rank = self.tree.order(**camera.line_of_sight, back_to_front=True)
        return places[np.argsort(rank[self._below[level.nodes[places]]], kind="stable")]


def gather(
    loop: Generator[Refinement, None, Refinement], flora: Flora, camera: Camera
) -> Generator[Level, None, Levels]:
    """Run the loop of `refinement.loop.refine` to its end; yields a level of each state, returns all."""
    levels: list[Level] = []
    while True:
        try:
            state, last = next(loop), False
        except StopIteration as stop:
            state, last = stop.value, True
        levels.append(_level(flora, state))
        if sum(level.nbytes for level in levels) > MOST_BYTES:
            levels = thinned(levels)
        yield levels[-1]
        if last:
            return Levels(levels, state.tree, camera)


def thinned(levels: list[Level]) -> list[Level]:
    """Every second level, and in any case the first and the last."""
    return levels[:-1:2] + levels[-1:]


def _level(flora: Flora, state: Refinement) -> Level:
    tree, nodes = state.tree, state.nodes
    extinction = mean_extinction(state.totals, volume(tree.vertices(nodes)))
    return Level(
        nodes=nodes.astype(np.int32),
        depth=tree.level[nodes].copy(),
        decision=state.decision.copy(),
        visibility=state.transmittance.astype(np.float32),
        contribution=contributions(state.cells, state.transmittance).astype(np.float32),
        extinction=extinction.astype(np.float32),
        color=_mean_colors(flora, state.contents, nodes, len(tree)).astype(np.float32),
        figures=step_of(state),
        number=state.passes - 1,
    )


def _mean_colors(flora: Flora, contents: Contents, nodes: Integers, size: int) -> Floats:
    """Mean colors (t, 3) of what nodes (t,) hold, weighted by what shows: leaves once, closed surfaces half."""
    row, piece_row = contents.subplants.items.row, contents.pieces.items.branches.row
    parts = []
    for held, leaf_colors, wood in (
        (contents.subplants, flora.leaf_colors, flora.wood_color[row]),
        (contents.pieces, partial(piece_leaf_colors, flora), flora.rows["branch_color"][piece_row, 0]),
    ):
        if len(held):
            parts.append((held.cell, held.totals.leaf_area, leaf_colors(held.items)))
            parts.append((held.cell, held.totals.wood_area / 2, wood))
    if len(contents.polygons.cell):
        polygons, totals = contents.polygons.items, contents.polygons.totals
        colors = polygons.meshes.colors[polygons.meshes.slot[polygons.face]]
        parts.append((contents.polygons.cell, totals.optical_area, colors))
    sums, area = np.zeros((size, 3)), np.zeros(size)
    for cells, weight, colors in parts:
        area += np.bincount(cells, weight, size)
        for k in range(3):
            sums[:, k] += np.bincount(cells, weight * colors[:, k], size)
    return sums[nodes] / np.where(area > 0.0, area, 1.0)[nodes, None]


def ramp(fraction: NDArray[np.floating]) -> Floats32:
    """Colors (n, 3) for fractions (n,): dark violet at 0, through green, to bright yellow at 1."""
    position = np.clip(fraction, 0.0, 1.0) * (len(_RAMP) - 1)
    low = np.minimum(position.astype(np.intp), len(_RAMP) - 2)
    return (_RAMP[low] + (_RAMP[low + 1] - _RAMP[low]) * (position - low)[:, None]).astype(np.float32)


def colors_of(level: Level, mode: str, deepest: int) -> Floats32:
    """Colors (t, 3) of a level's tetrahedra.

    Parameters
    ----------
    mode : {'LEVEL', 'VISIBILITY', 'FORM', 'CONTRIBUTION'}
        By how often space was divided, by visibility, by what was decided, or by the logarithm of pixels changed.
    deepest : int
        Depth of the brightest color: colors stay from level to level.

    Raises
    ------
    ValueError
        If there is no such mode.
    """
    if mode == "LEVEL":
        return ramp(level.depth / max(deepest, 1))
    if mode == "VISIBILITY":
        return ramp(level.visibility)
    if mode == "CONTRIBUTION":
        return ramp(np.log(np.maximum(level.contribution, _LEAST) / _LEAST) / np.log(_MOST / _LEAST))
    if mode == "FORM":
        return np.array([FORMS.get(one, (0.0, 0.0, 0.0)) for one in Decision], np.float32)[level.decision]
    raise ValueError(f'unknown color mode "{mode}"; use LEVEL, VISIBILITY, FORM or CONTRIBUTION')


def as_shown(linear: NDArray[np.floating]) -> Floats32:
    """Linear colors (..., 3) as a screen shows them (IEC 61966-2-1)."""
    return srgb_of(np.clip(np.asarray(linear, np.float32), 0.0, 1.0))


#: Corner of the thick point among the five corners of a projected tetrahedron.
THICK = 4
#: Corners of a case have this number where there is no triangle.
_NONE = -1


def _cases() -> NDArray[np.int8]:
    """Triangles (16, 4, 3) by the signs of c, bit i for vertex i: the thick point and an edge of the silhouette."""
    table = np.full((16, 4, 3), _NONE, np.int8)
    for case in range(1, 15):  # with 0 or 15 the eye is within, and there is no silhouette
        positive = [i for i in range(4) if case >> i & 1]
        negative = [i for i in range(4) if not case >> i & 1]
        if len(positive) == 2:
            edges = [(p, n) for p in positive for n in negative]
        else:
            a, b, c = positive if len(positive) == 3 else negative
            edges = [(a, b), (b, c), (c, a)]
        for i, edge in enumerate(edges):
            table[case, i] = (*edge, THICK)
    return table


_CASES = _cases()


@dataclass(frozen=True)
class Projected:
    """Tetrahedra as triangles, in the order of the tetrahedra."""

    #: (n, 5, 3): the vertices, where opacity is 0, and the nearest point of the ray on which each is thickest; meters.
    corners: Floats
    opacity: Floats  # (n,): of the thick point: 1 − e^(−κ · thickness)
    thickness: Floats  # (n,): along that ray, meters
    #: (m, 3): corners of triangles that face either way, through all tetrahedra (five each), one after another.
    triangles: Integers32


def drawable(vertices: NDArray[np.floating], camera: Camera) -> Mask:
    """Tetrahedra (n, 4, 3) that lie whole in front of the near plane of a flat camera; others have no projection."""
    back = camera.frame[:, 2]
    depth = (np.asarray(camera.position) @ back) - vertices @ back.astype(vertices.dtype)
    return depth.min(axis=1) > camera.near


def project(vertices: Floats, extinction: Floats, camera: Camera) -> Projected:
    """Triangles of tetrahedra as a camera sees them.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Of either orientation, meters, world space, all `drawable`. In the order in which they are to be drawn.
    extinction : (n,) float64
        κ ≥ 0, 1/m.

    Raises
    ------
    ValueError
        The camera is a panorama, where no edges are straight.
    """
    if camera.kind == "PANO":
        raise ValueError("a panorama bends the edges of tetrahedra; use a perspective or orthographic camera")
    vertices = np.asarray(vertices, np.float64)
    gradients = barycentric_gradients(vertices)
    if camera.kind == "ORTHO":
        weights, origin = -gradients @ camera.frame[:, 2], vertices.mean(axis=1)
    else:
        # Every coordinate is 0 on the face opposite its vertex, so any vertex of that face may be the origin.
        on_face = vertices[:, [1, 2, 3, 0]]
        weights, origin = ((camera.position - on_face) * gradients).sum(axis=2), camera.position[None]
    sides = np.stack([np.maximum(weights, 0.0), np.maximum(-weights, 0.0)])
    total = sides.sum(axis=2)
    # From the origin, so that what lies far from it, or is as thin as a needle, loses no precision.
    reach = np.einsum("snk,nkj->snj", sides, vertices - origin[:, None])
    reach /= np.where(total > 0.0, total, 1.0)[:, :, None]
    toward = -camera.frame[:, 2]
    front = reach[(reach[0] @ toward > reach[1] @ toward).astype(np.intp), np.arange(len(vertices))] + origin
    thickness = np.linalg.norm(reach[0] - reach[1], axis=1)
    # What has no volume has neither thickness nor triangles.
    flat = (total <= 0.0).any(axis=0)
    thickness = np.where(flat, 0.0, thickness)
    front[flat] = vertices[flat, 0]
    case = (weights >= 0.0) @ np.array([1, 2, 4, 8])
    triangles = _CASES[np.where(flat, 0, case)]
    owner, which = np.nonzero(triangles[:, :, 0] != _NONE)
    corners = np.concatenate([vertices, front[:, None]], axis=1)
    indices = triangles[owner, which] + 5 * owner[:, None]
    return Projected(corners, -np.expm1(-extinction * thickness), thickness, indices.astype(np.int32))
