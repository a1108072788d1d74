# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tetrahedra cut by any plane, into tetrahedra again (paper, section 4, figure 1).

A plane through one, two, three or four edges leaves 2, 3, 4 or 6 tetrahedra: through two vertices and an edge, two;
through a vertex and two edges, a tetrahedron and a pyramid of two; through three edges, a corner and a prism of three;
through four, two prisms of three. For other planes nothing is divided.

A quadrilateral on a face is divided from its lexicographically lowest corner. That is a matter of its corners alone,
and these of the edges alone, so two tetrahedra with a common face divide it alike to the last bit. As all corners stand
in one order, no prism gets three diagonals that turn the same way round, which none of its divisions has (Schönhardt).
Only the quadrilateral within a tetrahedron that is cut through four edges is free: there the shape of the six decides,
as in the paper, which "chooses a subdivision depending on the aspect ratio of the resulting tetrahedra".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .geometry import plane_distance, plane_through, quality, signed_volume
from .subdivision import TIE

#: Vertices nearer to a plane than this, in metres, count as on it. It is absolute, so that neighbours of different size
#: agree; much more than rounding tens of kilometres from the origin, and much less than any leaf.
TOLERANCE = 1e-7

_Labels = tuple[int, ...]


@dataclass(frozen=True)
class CutTetrahedra:
    """What planes leave of tetrahedra: pieces in the order of owner, side and place in the chain of that side.

    Attributes
    ----------
    vertices : (m, 4, 3) float64
        Positively oriented tetrahedra, metres.
    owner : (m,) intp
        Which of the tetrahedra that were cut each is a part of.
    side : (m,) int8
        0 on the negative side of the plane, 1 on the positive one.
    step : (m,) int8
        Place among the pieces of the same owner and side, from 0; there are three at most.
    last : (m,) bool
        Whether it is the last of them.
    plane : (m, 4) float64
        Has the piece on side 0 and those that follow it on side 1; zeros where it is the last.
    divided : (n,) bool
        For each tetrahedron that was to be cut, whether its plane divides it.
    """

    vertices: NDArray[np.float64]
    owner: NDArray[np.intp]
    side: NDArray[np.int8]
    step: NDArray[np.int8]
    last: NDArray[np.bool_]
    plane: NDArray[np.float64]
    divided: NDArray[np.bool_]


def _chain(body: _Labels, diagonals: dict[frozenset[int], frozenset[int]]) -> list[_Labels] | None:
    """Tetrahedra of a body; all but the last begin with the vertex that those after them do not have.

    A body is a tetrahedron (4 labels), a pyramid (apex, then around its base) or a prism (two triangles). None if the
    diagonals of a prism turn the same way round.
    """
    if len(body) == 4:
        return [body]
    if len(body) == 5:
        apex, *base = body
        along = diagonals[frozenset(base)]
        one, two = sorted(along)
        return [(end, one, two, apex) for end in base if end not in along]
    lower, upper = body[:3], body[3:]
    # One lower corner after the other is replaced by the one above it; each upper one then sees the lower ones left.
    for a, b, c in permutations(range(3)):
        seen = ((upper[i], lower[j], lower[i], upper[j]) for i, j in ((a, b), (a, c), (b, c)))
        if all(diagonals[frozenset(quad)] == frozenset(quad[:2]) for quad in seen):
            one = (lower[a], lower[b], lower[c], upper[a])
            return [one, (lower[b], lower[c], upper[a], upper[b]), (lower[c], upper[a], upper[b], upper[c])]
    return None


class _Case:
    """One way that a plane passes: by signs, bodies on both sides, and tetrahedra for each choice of diagonals.

    Labels 0 to 3 are the vertices, those on side 0 first, then those on the plane, then those on side 1; the cut edges
    follow. Tables are made by trying on one example, as which way round a piece is depends on labels alone.

    Parameters
    ----------
    signs : str
        Sides of the four vertices: ``-``, ``0`` or ``+``.
    edges : sequence of pairs of int
        Cut edges, negative end first.
    bodies : pair of labels
        On sides 0 and 1.
    quads : sequence of labels
        Quadrilaterals of the bodies, each around; the first is free if ``free``.
    free : bool
        Whether no neighbour has the first quadrilateral.
    """

    def __init__(
        self,
        signs: str,
        edges: Sequence[tuple[int, int]],
        bodies: tuple[_Labels, _Labels],
        quads: Sequence[_Labels] = (),
        free: bool = False,
    ) -> None:
        self.signs = np.array([{"-": -1, "0": 0, "+": 1}[sign] for sign in signs], np.int8)
        self.negative, self.positive = np.array(edges).T
        self.quads, self.free = np.array(quads, np.intp).reshape(-1, 4), free
        corner = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
        example = np.concatenate([corner, (corner[self.negative] + corner[self.positive]) / 2.0])
        found: list[NDArray[np.intp] | None] = []
        for pattern in range(1 << len(quads)):
            diagonals = {frozenset(quad): frozenset(quad[(pattern >> i) & 1 :: 2]) for i, quad in enumerate(quads)}
            chains = [_chain(body, diagonals) for body in bodies]
            if chains[0] is None or chains[1] is None:
                found.append(None)
                continue
            labels = np.array(chains[0] + chains[1], np.intp)
            turned = signed_volume(example[labels]) < 0.0
            labels[turned] = labels[turned][:, [0, 1, 3, 2]]
            found.append(labels)
            lengths = [len(chain) for chain in chains if chain]
        self.possible = np.array([labels is not None for labels in found])
        count = sum(lengths)
        nothing = np.zeros((count, 4), np.intp)
        self.labels = np.array([nothing if labels is None else labels for labels in found])
        self.side = np.repeat(np.array([0, 1], np.int8), lengths)
        self.step = np.concatenate([np.arange(length, dtype=np.int8) for length in lengths])
        self.last = self.step == np.array(lengths)[self.side] - 1


#: All ways that divide, up to exchange of the sides.
_CASES = (
    _Case("-00+", [(0, 3)], ((0, 1, 2, 4), (3, 1, 2, 4))),
    _Case("-0++", [(0, 2), (0, 3)], ((0, 1, 4, 5), (1, 4, 5, 3, 2)), [(4, 5, 3, 2)]),
    _Case(
        "-+++",
        [(0, 1), (0, 2), (0, 3)],
        ((0, 4, 5, 6), (4, 5, 6, 1, 2, 3)),
        [(4, 5, 2, 1), (5, 6, 3, 2), (6, 4, 1, 3)],
    ),
    _Case(
        "--++",
        [(0, 2), (0, 3), (1, 2), (1, 3)],
        ((0, 4, 5, 1, 6, 7), (2, 4, 6, 3, 5, 7)),
        [(4, 5, 7, 6), (0, 4, 6, 1), (0, 5, 7, 1), (2, 4, 5, 3), (2, 6, 7, 3)],
        free=True,
    ),
)


def cut_tetrahedra(vertices: ArrayLike, planes: ArrayLike, tolerance: float = TOLERANCE) -> CutTetrahedra:
    """Cut each tetrahedron by its plane.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Positively oriented tetrahedra, metres, much thicker than ``tolerance``.
    planes : (n, 4) float64
        ``(nx, ny, nz, d)`` with unit normals.
    tolerance : float
        Vertices nearer to the plane than this, in metres, count as on it, so that no piece is thinner. It should
        exceed the rounding error of coordinates ten thousand times.

    Returns
    -------
    CutTetrahedra
        A tetrahedron that its plane does not divide is one piece, on the side where it is, or on side 1 if all of it
        is within the tolerance. Parents' vertices and points on edges that neighbours share keep their coordinates to
        the last bit.

    Raises
    ------
    ValueError
        If the shapes do not fit.
    """
    vertices, planes = np.asarray(vertices, np.float64), np.asarray(planes, np.float64)
    if vertices.ndim != 3 or vertices.shape[1:] != (4, 3) or planes.shape != (len(vertices), 4):
        raise ValueError(
            f"tetrahedra {vertices.shape} and planes {planes.shape}: must have shapes (n, 4, 3) and (n, 4)"
        )
    distance = plane_distance(planes[:, None], vertices)
    sign = np.where(np.abs(distance) <= tolerance, 0.0, np.sign(distance)).astype(np.int8)
    below, above = (sign < 0).sum(axis=1), (sign > 0).sum(axis=1)
    divided = (below > 0) & (above > 0)
    whole = np.flatnonzero(~divided)
    found = [_undivided(vertices[whole], whole, (below[whole] == 0).astype(np.int8))]
    # A plane with more vertices on side 0 is looked at from behind.
    behind = below > above
    sign, distance = (np.where(behind[:, None], -values, values) for values in (sign, distance))
    order = np.argsort(sign, axis=1, kind="stable")
    sign = np.take_along_axis(sign, order, axis=1)
    for case in _CASES:
        some = np.flatnonzero(divided & (sign == case.signs).all(axis=1))
        if len(some):
            found.append(_cut_case(case, vertices, distance, order, behind, some))
    joined = [np.concatenate(parts) for parts in zip(*found, strict=True)]
    sorting = np.argsort(2 * joined[1] + joined[2], kind="stable")
    return CutTetrahedra(*(values[sorting] for values in joined), divided)


#: Vertices, owner, side, step, last and plane, as in `CutTetrahedra`.
_Found = tuple[
    NDArray[np.float64], NDArray[np.intp], NDArray[np.int8], NDArray[np.int8], NDArray[np.bool_], NDArray[np.float64]
]


def _undivided(vertices: NDArray[np.float64], owner: NDArray[np.intp], side: NDArray[np.int8]) -> _Found:
    n = len(owner)
    return vertices, owner, side, np.zeros(n, np.int8), np.ones(n, np.bool_), np.zeros((n, 4))


def _cut_case(
    case: _Case,
    vertices: NDArray[np.float64],
    distance: NDArray[np.float64],
    order: NDArray[np.intp],
    behind: NDArray[np.bool_],
    some: NDArray[np.intp],
) -> _Found:
    """Pieces of tetrahedra ``some`` that are cut in one way; vertices are taken in the given order."""
    order = order[some]
    corners = np.take_along_axis(vertices[some], order[:, :, None], axis=1)
    distance = np.take_along_axis(distance[some], order, axis=1)
    # Weighted means do not change when ends or sides are exchanged: each tetrahedron at an edge gets the same point.
    low, high = -distance[:, case.negative, None], distance[:, case.positive, None]
    cuts = (high * corners[:, case.negative] + low * corners[:, case.positive]) / (high + low)
    points = np.concatenate([corners, cuts], axis=1)
    labels = _labels(case, points)
    # An odd order of the vertices turns all pieces over.
    first, second = np.triu_indices(4, 1)
    odd = (order[:, first] > order[:, second]).sum(axis=1) % 2 == 1
    labels[odd] = labels[odd][:, :, [0, 1, 3, 2]]
    pieces = points[np.arange(len(some))[:, None, None], labels]
    planes = np.zeros((*pieces.shape[:2], 4))
    planes[:, ~case.last] = plane_through(pieces[:, ~case.last, 1:], pieces[:, ~case.last, 0])
    count, size = pieces.shape[:2]
    return (
        pieces.reshape(-1, 4, 3),
        np.repeat(some, size),
        (case.side ^ behind[some, None]).astype(np.int8).reshape(-1),
        np.tile(case.step, count),
        np.tile(case.last, count),
        planes.reshape(-1, 4),
    )


def _labels(case: _Case, points: NDArray[np.float64]) -> NDArray[np.intp]:
    """Points ``(n, pieces, 4)`` of each piece, by the diagonals that the coordinates and shapes ask for."""
    pattern = np.zeros(len(points), np.intp)
    if len(case.quads):
        ranked = np.lexsort((points[..., 2], points[..., 1], points[..., 0]), axis=-1)
        rank = np.empty_like(ranked)
        np.put_along_axis(rank, ranked, np.arange(points.shape[1])[None], axis=1)
        for i, quad in enumerate(case.quads):
            pattern |= (np.argmin(rank[:, quad], axis=1) % 2) << i
    if case.free:
        other = np.flatnonzero(case.possible[pattern ^ 1])
        both = (case.labels[pattern[other] ^ flip] for flip in (0, 1))
        worst = [quality(points[other[:, None, None], labels]).min(axis=1) for labels in both]
        pattern[other[worst[1] > worst[0] * (1.0 + TIE)]] ^= 1
    return case.labels[pattern]
