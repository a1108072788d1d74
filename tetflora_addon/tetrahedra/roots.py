# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Roots: the view as tetrahedra, and the space around it within a box (paper, section 6.1).

The perspective pyramid from the eye to just beyond the scene is two tetrahedra; what is behind the eye, beside the
pyramid and beyond the far clipping plane is cut into hexahedra and prisms, and these into tetrahedra, always by
planes, so that the whole is one binary tree. All is laid out in camera space (x right, y up, depth), in a box aligned
with the camera, and then carried to the world.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .geometry import plane_through, quality, signed_volume
from .tree import TetrahedralTree

#: Room between the scene or the view and the walls of the box, as a share of their size, so that nothing lies on a wall
#: and no piece beside the view is thinner than this.
MARGIN = 0.05


class ViewingCamera(Protocol):
    """What a root needs of `tetflora_addon.refinement.camera.Camera`, which this room must not import."""

    kind: str
    position: NDArray[np.float64]
    frame: NDArray[np.float64]
    window: tuple[float, float, float, float]
    near: float
    far: float

    def to_camera_space(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """World points ``(..., 3)`` to (x right, y up, depth)."""


@dataclass(frozen=True)
class _Cut:
    """A convex piece cut in two by the plane through three points, which has ``negative`` on side 0."""

    through: NDArray[np.float64]
    negative: _Piece
    positive: _Piece


@dataclass(frozen=True)
class _View:
    """A piece that is what the camera sees."""

    piece: _Piece


#: A tetrahedron (4, 3), or a piece that is cut further.
_Piece = NDArray[np.float64] | _Cut | _View


def view_root(camera: ViewingCamera, bounds: ArrayLike) -> TetrahedralTree:
    """Tree whose terminals are the view and the space around it.

    Parameters
    ----------
    camera : Camera or alike
        Whose view it is; the window may be asymmetric and need not contain the axis. What is nearer than ``near``
        counts as part of the view.
    bounds : (2, 3) float64
        Lowest and highest corner of the world box that holds plants, polygons and lights, metres.

    Returns
    -------
    TetrahedralTree
        The pyramid of a perspective view is two terminals, the box of an orthographic one six. They are marked
        `inside`, all others are not; children inherit it.

    Raises
    ------
    ValueError
        If bounds or camera are not finite.
    """
    bounds = np.asarray(bounds, np.float64)
    if not (np.isfinite(bounds).all() and np.isfinite(camera.position).all() and np.isfinite(camera.window).all()):
        raise ValueError("the bounds of the scene and the camera must be finite")
    low, high, far = _box(camera, bounds)
    if camera.kind == "ORTHO":
        front = _around_box(camera.window, low, high, far)
    else:
        front = _around_pyramid(camera.window, low, high, far)
    if far < high[2]:
        front = _Cut(_rectangle(low, high, far)[:3], front, _slab(low, high, far, high[2]))
    whole = _Cut(_rectangle(low, high, 0.0)[:3], _slab(low, high, low[2], 0.0), front)
    tree = TetrahedralTree()
    _hang(tree, 0, whole, camera)
    return tree


def _box(camera: ViewingCamera, bounds: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Camera-aligned box ``low``, ``high`` around scene and view, and the depth at which the view ends."""
    corners = np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3)
    corners = camera.to_camera_space(corners)
    deepest = corners[:, 2].max() + MARGIN * max(np.ptp(corners[:, 2]), camera.near)
    # A scene that lies behind the camera still needs a view, though there will be nothing in it.
    deepest = max(deepest, 2.0 * camera.near)
    far = min(camera.far, deepest)
    if far < deepest:
        # What lies beyond the far clipping plane is a piece of its own; it should not be a thin slice.
        deepest = max(deepest, far * (1.0 + MARGIN))
    left, right, bottom, top = np.array(camera.window) * (1.0 if camera.kind == "ORTHO" else far)
    view = np.array([(left, bottom, 0.0), (left, top, 0.0), (right, bottom, far), (right, top, far), (0.0, 0.0, 0.0)])
    points = np.concatenate([corners, view])
    low, high = points.min(axis=0), points.max(axis=0)
    room = MARGIN * (high - low)
    low, high = low - room, high + room
    high[2] = deepest
    return low, high, far


def _to_world(camera: ViewingCamera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    return (points * np.array([1.0, 1.0, -1.0])) @ camera.frame.T + camera.position


def _rectangle(low: NDArray[np.float64], high: NDArray[np.float64], depth: float) -> NDArray[np.float64]:
    """Corners ``(4, 3)`` around the box's section at a depth."""
    (x0, y0, _), (x1, y1, _) = low, high
    return np.array([(x0, y0, depth), (x1, y0, depth), (x1, y1, depth), (x0, y1, depth)])


def _slab(low: NDArray[np.float64], high: NDArray[np.float64], near: float, far: float) -> _Piece:
    return _hexahedron(np.concatenate([_rectangle(low, high, near), _rectangle(low, high, far)]))


def _around_pyramid(
    window: tuple[float, float, float, float], low: NDArray[np.float64], high: NDArray[np.float64], far: float
) -> _Piece:
    """Box from the eye's depth to ``far``: left, right, below, above, and the pyramid in two halves."""
    (x0, y0, _), (x1, y1, _) = low, high
    left, right, bottom, top = np.array(window) * far
    eye = np.zeros(3)
    far_corners = np.array([(left, bottom, far), (right, bottom, far), (right, top, far), (left, top, far)])

    def side(wall: float, edge: float) -> _Piece:
        """Trapezoid in (x, depth), extruded from the lowest to the highest y."""
        trapezoid = [(wall, 0.0), (0.0, 0.0), (edge, far), (wall, far)]
        return _hexahedron(np.array([(x, y, z) for y in (y0, y1) for x, z in trapezoid]))

    def end(wall: float, first: int, second: int) -> _Piece:
        """Skew prism between the pyramid's lower or upper face and the box's wall there."""
        triangle = np.array([eye, far_corners[first], far_corners[second]])
        on_wall = triangle.copy()
        on_wall[:, 1] = wall
        return _prism(np.concatenate([on_wall, triangle]))

    one = np.array([eye, far_corners[0], far_corners[1], far_corners[2]])
    two = np.array([eye, far_corners[0], far_corners[2], far_corners[3]])
    pyramid = _View(_Cut(np.array([eye, far_corners[0], far_corners[2]]), one, two))
    middle = _Cut(np.array([eye, far_corners[3], far_corners[2]]), pyramid, end(y1, 3, 2))
    middle = _Cut(np.array([eye, far_corners[0], far_corners[1]]), end(y0, 0, 1), middle)
    middle = _Cut(np.array([eye, far_corners[1], far_corners[2]]), middle, side(x1, right))
    return _Cut(np.array([eye, far_corners[0], far_corners[3]]), side(x0, left), middle)


def _around_box(
    window: tuple[float, float, float, float], low: NDArray[np.float64], high: NDArray[np.float64], far: float
) -> _Piece:
    """Box from depth 0 to ``far``: left, right, below, above, and the orthographic view in the middle."""
    (x0, y0, _), (x1, y1, _) = low, high
    left, right, bottom, top = window

    def block(x: tuple[float, float], y: tuple[float, float]) -> _Piece:
        return _slab(np.array([x[0], y[0], 0.0]), np.array([x[1], y[1], 0.0]), 0.0, far)

    def wall(a: tuple[float, float], b: tuple[float, float]) -> NDArray[np.float64]:
        return np.array([(*a, 0.0), (*b, 0.0), (*b, far)])

    middle = _Cut(
        wall((left, top), (right, top)), _View(block((left, right), (bottom, top))), block((left, right), (top, y1))
    )
    middle = _Cut(wall((left, bottom), (right, bottom)), block((left, right), (y0, bottom)), middle)
    middle = _Cut(wall((right, bottom), (right, top)), middle, block((right, x1), (y0, y1)))
    return _Cut(wall((left, bottom), (left, top)), block((x0, left), (y0, y1)), middle)


def _hexahedron(corners: NDArray[np.float64]) -> _Piece:
    """Two quadrilaterals ``(8, 3)``, one shifted against the other, as two prisms, cut at the better diagonal."""
    halves = [
        (
            turn,
            [
                _best_prism(corners[[i + 4 * end for end in (0, 1) for i in triangle]])
                for triangle in ((turn, turn + 1, turn + 2), (turn, turn + 2, (turn + 3) % 4))
            ],
        )
        for turn in (0, 1)
    ]
    turn, ((_, one), (_, two)) = max(halves, key=lambda half: min(half[1][0][0], half[1][1][0]))
    return _Cut(corners[[turn, turn + 2, turn + 4]], one, two)


def _prism(corners: NDArray[np.float64]) -> _Piece:
    return _best_prism(corners)[1]


def _best_prism(corners: NDArray[np.float64]) -> tuple[float, _Piece]:
    """Prism between two triangles ``(6, 3)`` as three tetrahedra, of the twelve ways the one of best quality.

    The paper as well "chooses a subdivision depending on the aspect ratio of the resulting tetrahedra".
    """
    best: tuple[float, _Piece] = (-1.0, corners[:4])
    for turn in permutations(range(3)):
        for lower, upper in ((0, 3), (3, 0)):
            a, b = corners[[lower + i for i in turn]], corners[[upper + i for i in turn]]
            three = np.array([(*a, b[0]), (b[0], a[1], a[2], b[2]), (b[0], a[1], b[2], b[1])])
            worst = float(quality(three).min())
            if worst > best[0] * (1.0 + 1e-9):
                rest = _Cut(np.array([b[0], a[1], b[2]]), three[1], three[2])
                best = (worst, _Cut(np.array([b[0], a[1], a[2]]), three[0], rest))
    return best


def _hang(tree: TetrahedralTree, node: int, piece: _Piece, camera: ViewingCamera) -> None:
    """Put a piece, given in camera space, at a terminal node; the pieces of a root are some dozens."""
    if isinstance(piece, _View):
        tree.mark_inside([node])
        _hang(tree, node, piece.piece, camera)
    elif isinstance(piece, _Cut):
        plane = plane_through(_to_world(camera, piece.through), _to_world(camera, _centre(piece.negative)))
        first, second = tree.divide([node], plane[None])[0]
        _hang(tree, int(first), piece.negative, camera)
        _hang(tree, int(second), piece.positive, camera)
    else:
        vertices = _to_world(camera, piece)
        if signed_volume(vertices) < 0.0:
            vertices = vertices[[1, 0, 2, 3]]
        tree.place([node], vertices[None])


def _centre(piece: _Piece) -> NDArray[np.float64]:
    """A point inside a piece."""
    while not isinstance(piece, np.ndarray):
        piece = piece.piece if isinstance(piece, _View) else piece.negative
    return piece.mean(axis=0)
