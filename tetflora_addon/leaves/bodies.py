# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed parts of models, such as berries and fleshy leaves, made round: the surface that their corners suggest.

Faces are divided as by Loop ("Smooth subdivision surfaces based on triangles", 1987). Points of spines and leaves stay
where they are, and each part keeps its area. What is open, such as stalks, stays as it is. Up close spines grow from
areoles that are spread evenly over closed parts.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import GOLDEN_ANGLE, Floats, Floats32, Integers, connected, cross, perpendicular, spread
from .models import LeafModel, Spines

#: Angle of all faces around a vertex below which it is a point, and stays: a full turn on flat ground, 4/3 π on an
#: octahedron.
_POINTED = np.pi


def closed_parts(model: LeafModel) -> Integers:
    """Which closed part each face (f,) belongs to, by the number of one of its faces; -1 for what is open.

    A part is closed where each edge has two faces; it may share a vertex with a stalk.
    """
    of_corner = model.edges[1]
    face = np.repeat(np.arange(model.polygons), np.diff(model.face_offsets))
    order = np.argsort(of_corner, kind="stable")
    paired = np.bincount(of_corner) == 2
    pairs = face[order][paired[of_corner[order]]].reshape(-1, 2)
    part = connected(model.polygons, *pairs.T)
    return np.where(np.isin(part, part[face[~paired[of_corner]]]), -1, part)


def rounded(model: LeafModel, times: int) -> tuple[LeafModel, float]:
    """A model whose closed parts are divided so many times, each with the area that it had.

    Parameters
    ----------
    model : LeafModel
    times : int
        Each makes four faces of a triangle.

    Returns
    -------
    LeafModel
        Triangles where parts are closed, and the faces of all others.
    error : float
        How far the middles of its edges are from the round surface, about, in units of the leaf's size.
    """
    of_face = closed_parts(model)
    chosen = np.flatnonzero(of_face >= 0)
    corners, uv, owner = _triangles(model, chosen)
    points, part = model.positions, np.full(len(model.positions), -1)
    part[corners] = of_face[chosen][owner, None]
    fixed = _turns(points, corners) < _POINTED
    area, middle = _areas(points, corners, part), _middles(points, part)

    def scaled(points: NDArray, corners: NDArray, part: NDArray) -> Floats:
        larger = np.sqrt(area / np.maximum(_areas(points, corners, part, len(area)), 1e-300))
        out = np.where((part >= 0)[:, None], middle[part] + larger[part, None] * (points - middle[part]), points)
        return out * np.minimum(model.reach / np.maximum(np.linalg.norm(out, axis=1), 1e-300), 1.0)[:, None]

    for _ in range(times):
        points, corners, uv, part, fixed, _ = _divided(points, corners, uv, part, fixed)
    finer, fine_corners, _, fine_part, _, edges = _divided(points, corners, uv, part, fixed)
    now, then = scaled(points, corners, part), scaled(finer, fine_corners, fine_part)
    off = np.linalg.norm(then[len(points) :] - now[edges].mean(axis=1), axis=1).max(initial=0.0)
    # Each division leaves a quarter of the distance.
    return _with_faces(model, now, corners, uv, np.flatnonzero(of_face < 0)), float(off * 4.0 / 3.0)


def _divided(
    points: NDArray, corners: NDArray, uv: NDArray, part: NDArray, fixed: NDArray
) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Triangles (t, 3) with texture (t, 3, 2) divided once, with vertices, their parts, and whether they stay.

    The last ones of the vertices are those of the edges (e, 2), which come as well.
    """
    count = len(points)
    pairs = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, of_side = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    of_side = of_side.reshape(-1, 3)
    across = np.zeros_like(points, shape=(len(edges), 3))
    np.add.at(across, of_side, points[np.roll(corners, 1, axis=1)])
    new = 0.375 * points[edges].sum(axis=1) + 0.125 * across
    number = np.bincount(edges.ravel(), minlength=count)
    around = np.zeros_like(points)
    np.add.at(around, edges, points[edges[:, ::-1]])
    weight = 0.625 - (0.375 + 0.25 * np.cos(2.0 * np.pi / np.maximum(number, 1))) ** 2
    moved = (1.0 - weight)[:, None] * points + (weight / np.maximum(number, 1))[:, None] * around
    points = np.where(((part >= 0) & ~fixed)[:, None], moved, points)
    a, b, c = corners.T
    ab, bc, ca = (count + of_side).T
    texture = np.stack([uv, 0.5 * (uv + np.roll(uv, -1, axis=1))], axis=1)  # (t, corner or middle, 3, 2)
    (ta, tb, tc), (tab, tbc, tca) = (texture[:, i].transpose(1, 0, 2) for i in range(2))
    faces = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    textures = [(ta, tab, tca), (tab, tb, tbc), (tca, tbc, tc), (tab, tbc, tca)]
    return (
        np.concatenate([points, new]),
        np.concatenate([np.stack(face, axis=1) for face in faces]),
        np.concatenate([np.stack(one, axis=1) for one in textures]),
        np.append(part, part[edges[:, 0]]),
        np.append(fixed, np.zeros(len(edges), bool)),
        edges,
    )


def _triangles(model: LeafModel, faces: Integers) -> tuple[Integers, Floats, Integers]:
    """Vertices (t, 3), texture (t, 3, 2) and owners (t,) of the triangles of faces: fans around their first corners."""
    first, size = model.face_offsets[:-1][faces], np.diff(model.face_offsets)[faces]
    owner, step = spread(size - 2)
    corner = np.stack([first[owner], first[owner] + step + 1, first[owner] + step + 2], axis=1)
    return model.corner_verts[corner].astype(np.int64), model.uv[corner].astype(np.float64), owner


def _with_faces(model: LeafModel, points: NDArray, corners: NDArray, uv: NDArray, others: Integers) -> LeafModel:
    """A model of triangles and of some faces of another one."""
    size = np.diff(model.face_offsets)[others]
    kept = np.repeat(model.face_offsets[:-1][others] - np.cumsum(size) + size, size) + np.arange(size.sum())
    return replace(
        model,
        positions=points,
        corner_verts=np.append(corners.ravel(), model.corner_verts[kept]).astype(np.int32),
        face_offsets=np.cumsum(np.concatenate([[0], np.full(len(corners), 3), size])).astype(np.int32),
        uv=np.concatenate([uv.reshape(-1, 2), model.uv[kept]]).astype(np.float32),
    )


def _turns(points: Floats, corners: Integers) -> Floats:
    """Angle (v,) of all triangles (t, 3) around vertices, radians."""
    place = points[corners]
    ahead, behind = np.roll(place, -1, axis=1) - place, np.roll(place, 1, axis=1) - place
    cosine = (ahead * behind).sum(axis=2)
    sine = np.linalg.norm(np.cross(ahead, behind), axis=2)
    return np.bincount(corners.ravel(), np.arctan2(sine, cosine).ravel(), len(points))


def _areas(points: NDArray, corners: NDArray, part: NDArray, count: int | None = None) -> Floats:
    """Area (count,) of the triangles of each closed part, by its number."""
    a, b, c = points[corners].transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.bincount(part[corners[:, 0]], area, part.max(initial=0) + 1 if count is None else count)


def _middles(points: Floats, part: Integers) -> Floats:
    """Mean place (count, 3) of the vertices of each closed part, by its number."""
    own = np.flatnonzero(part >= 0)
    number = np.maximum(np.bincount(part[own]), 1)
    return np.stack([np.bincount(part[own], axis[own]) for axis in points.T], axis=1) / number[:, None]


#: What the color of the leaf is times that of spines, straw on green, and of the felt on areoles.
_SPINE, _FELT = (3.6, 1.9, 2.7), (1.7, 0.85, 0.9)
#: Height and radius of an areole over the distance of areoles, sides of it, and of a spine.
_CUSHION, _SIDES, _EDGES = (0.07, 0.11), 5, 3
#: Part at the base of the leaf that is bare.
_BARE = 0.08


def spined(model: LeafModel, spines: Spines, part: Integers) -> tuple[LeafModel, Floats32]:
    """A model with spines on it.

    Parameters
    ----------
    model : LeafModel
    spines : Spines
    part : (f,) int64
        Its `bodies.closed_parts`, on which spines stand.

    Returns
    -------
    LeafModel
        Spines and areoles come after its own faces.
    tint : (f, 3) float32
        What the color of the leaf is times that of each face.
    """
    place, normal = _areoles(model, part, spines.distance)
    height, wide = (spines.distance * size for size in _CUSHION)
    x = perpendicular(normal)
    felt = _pyramids(place - 0.5 * height * normal, place + height * normal, x, np.cross(normal, x), wide, _SIDES)
    # A few spines of each areole, evenly around it: each a little longer or shorter than the others.
    turn = GOLDEN_ANGLE * np.arange(len(place) * spines.number)
    owner = np.repeat(np.arange(len(place)), spines.number)
    lean = np.radians(spines.lean) * (0.7 + 0.6 * (0.381966 * np.arange(len(owner)) % 1.0))
    side = np.cos(turn)[:, None] * x[owner] + np.sin(turn)[:, None] * np.cross(normal, x)[owner]
    along = np.cos(lean)[:, None] * normal[owner] + np.sin(lean)[:, None] * side
    length = spines.length * (0.65 + 0.45 * (0.7548777 * np.arange(len(owner)) % 1.0))
    across = perpendicular(along)
    root = place[owner]
    needles = _pyramids(
        root, root + length[:, None] * along, across, cross(along, across), spines.thickness / 2, _EDGES
    )
    made, tints = model, [np.ones((model.polygons, 3))]
    for points, color in ((felt, _FELT), (needles, _SPINE)):
        far = np.linalg.norm(points, axis=-1, keepdims=True)  # none reaches farther than the model, as bounds know it
        made = _with_triangles(made, points * np.minimum(model.reach / np.maximum(far, 1e-300), 1.0))
        tints.append(np.tile(color, (len(points), 1)))
    return made, np.concatenate(tints).astype(np.float32)


def _areoles(body: LeafModel, part: Integers, distance: float) -> tuple[Floats, Floats]:
    """Places (n, 3) on a body at least a distance apart, and its unit normals (n, 3) there."""
    first = body.corner_verts[body.face_offsets[:-1]]
    corners = np.add.reduceat(body.positions[body.corner_verts], body.face_offsets[:-1])
    middle = corners / np.diff(body.face_offsets)[:, None]
    area = np.linalg.norm(body.face_vectors, axis=1)
    own = np.flatnonzero((part >= 0) & (area > 0) & (body.positions[first, 1] > _BARE))
    # From face to face far away from it, so that places are dense soon; each takes those around it away.
    own = own[np.argsort(0.6180339887 * np.arange(len(own)) % 1.0)]
    chosen: list[int] = []
    free = np.ones(len(own), bool)
    while free.any():
        one = int(np.argmax(free))
        chosen.append(int(own[one]))
        free &= np.linalg.norm(middle[own] - middle[own[one]], axis=1) >= distance
    return middle[chosen], body.face_vectors[chosen] / area[chosen, None]


def _pyramids(base: Floats, tip: Floats, x: Floats, y: Floats, radius: float, sides: int) -> Floats:
    """Sides (n * sides, 3, 3) of pyramids from bases to tips (n, 3), around axes perpendicular to x and y (n, 3)."""
    angle = 2.0 * np.pi * np.arange(sides + 1) / sides
    ring = base[:, None] + radius * (np.cos(angle)[:, None] * x[:, None] + np.sin(angle)[:, None] * y[:, None])
    top = np.broadcast_to(tip[:, None], ring[:, 1:].shape)
    return np.stack([ring[:, :-1], ring[:, 1:], top], axis=2).reshape(-1, 3, 3)


def _with_triangles(model: LeafModel, points: Floats) -> LeafModel:
    """A model with triangles (t, 3, 3) more, whose texture lies below that of leaves, as that of stalks."""
    corners = len(model.positions) + np.arange(3 * len(points))
    ends = model.face_offsets[-1] + 3 * np.arange(1, len(points) + 1)
    return replace(
        model,
        positions=np.concatenate([model.positions, points.reshape(-1, 3)]),
        corner_verts=np.append(model.corner_verts, corners).astype(np.int32),
        face_offsets=np.append(model.face_offsets, ends).astype(np.int32),
        uv=np.concatenate([model.uv, np.tile([[0.5, -0.5]], (3 * len(points), 1))]).astype(np.float32),
    )
