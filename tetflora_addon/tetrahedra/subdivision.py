# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Division of tetrahedra without slivers: bisection of the longest edge, and the canonical eight (paper, section 4).

Bisection: the plane through the midpoint of the longest edge and the two vertices opposite it. M.-C. Rivara and C.
Levin, "A 3-D refinement algorithm suitable for adaptive and multi-grid techniques", Communications in Applied Numerical
Methods 8 (1992).

Eight (fig. 2): midpoints of the six edges cut off four corners and leave an octahedron, which one of its diagonals
divides into four. With vertices a, b, c, d and the diagonal from the middle of ac to that of bd, the plane through the
middles of ac, ad, bc and bd parts a and b from c and d; the plane through the diagonal and the middles of ab and cd
parts a from b and c from d; the planes of the corners do the rest. Every child is three planes below its parent, as
after three bisections. Faces are divided at the middles of their edges whatever the diagonal, so neighbors conform.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .geometry import EDGES, plane_through, quality, signed_volume, squared_edges

#: Squared lengths that differ by less than this fraction count as equal, so that the choice of the edge does not depend
#: on the last bit, which differs between processors and versions of numpy.
TIE = 1e-9


def longest_edge(vertices: NDArray[np.float64]) -> NDArray[np.intp]:
    """Index into `geometry.EDGES` of the longest edge; the first of those that are equally long.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Tetrahedra, meters.

    Returns
    -------
    (n,) intp
    """
    squared = squared_edges(vertices)
    return np.argmax(squared >= np.max(squared, axis=1, keepdims=True) * (1.0 - TIE), axis=1)


def bisect(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cut tetrahedra in two at the midpoint of their longest edges.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Positively oriented tetrahedra, meters.

    Returns
    -------
    planes : (n, 4) float64
        Cutting planes ``(nx, ny, nz, d)``, unit normals.
    children : (n, 2, 4, 3) float64
        Child 0 on the negative side of the plane, child 1 on the positive one; positively oriented, half the volume
        each. A child keeps its parent's vertices in their places but for the midpoint, so that what both share has
        the same coordinates to the last bit.
    """
    every = np.arange(len(vertices))
    edge = longest_edge(vertices)
    start, end = EDGES[edge].T
    opposite = EDGES[5 - edge]
    middle = (vertices[every, start] + vertices[every, end]) / 2.0
    corners = np.concatenate([middle[:, None], vertices[every[:, None], opposite]], axis=1)
    planes = plane_through(corners, vertices[every, start])
    children = np.repeat(vertices[:, None], 2, axis=1)
    children[every, 0, end] = middle
    children[every, 1, start] = middle
    return planes, children


#: Vertices (a, b, c, d) for each diagonal ``k``, which joins the middles of ac, ``EDGES[k]``, and bd, ``EDGES[5 - k]``.
_NAMES = tuple((EDGES[k][0], EDGES[5 - k][0], EDGES[k][1], EDGES[5 - k][1]) for k in range(3))

#: A tetrahedron of better quality than the first counts as compact. Bisection must leave a compact one a worst quality
#: better by the second to be preferred, as what it leaves loses more later on than what the eight leave. Of thresholds
#: and factors tried, these kept most at .8 of their quality over eight divisions: all halves of view pyramids, and all
#: but a few in a thousand of the pieces around views, those at .79. Without, some fall to .74.
COMPACT, HANDICAP = 0.5, 1.15


def _tables() -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Points of the children ``(3, 8, 4)`` and of the planes, with one on side 0, ``(3, 7, 4)``, for each diagonal.

    Points 0 to 3 are the vertices, 4 + i is the middle of edge ``i``.
    """
    middle = {frozenset(edge): 4 + i for i, edge in enumerate(EDGES.tolist())}
    corner = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
    points = np.concatenate([corner, corner[EDGES].mean(axis=1)])
    children, planes = [], []
    for a, b, c, d in _NAMES:
        ab, ac, ad, bc, bd, cd = (middle[frozenset(e)] for e in ((a, b), (a, c), (a, d), (b, c), (b, d), (c, d)))
        corners = ((a, ab, ac, ad), (b, ab, bc, bd), (c, ac, bc, cd), (d, ad, bd, cd))
        inner = ((ac, bd, ab, ad), (ac, bd, ab, bc), (ac, bd, cd, bc), (ac, bd, cd, ad))
        eight = np.array([piece for pair in zip(corners, inner, strict=True) for piece in pair])
        # Which way round a child is depends on the numbering alone, so it is settled here and not by rounded volumes.
        turned = signed_volume(points[eight]) < 0.0
        eight[turned] = eight[turned][:, [0, 1, 3, 2]]
        children.append(eight)
        planes.append([(ac, bd, ad, a), (ac, bd, ab, a), (ac, bd, cd, c), *(near[1:] + near[:1] for near in corners)])
    return np.array(children, np.intp), np.array(planes, np.intp)


_CHILDREN, _PLANES = _tables()


def best_diagonal(vertices: NDArray[np.float64]) -> NDArray[np.intp]:
    """Diagonal along which the worst of the inner tetrahedra has the best quality.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Tetrahedra, meters.

    Returns
    -------
    (n,) intp
        Diagonal ``k`` joins the middles of edges ``k`` and ``5 - k`` of `geometry.EDGES`; the first of those that are
        equally good.

    Notes
    -----
    All children have the same volume. Let S be the sum of the squared edges, D² the squared diagonal, and p and q the
    squares of the edges whose middles it joins. Two of the inner tetrahedra have edges of (S − p + 4 D²) / 4, two of
    (S − q + 4 D²) / 4, where 4 D² = S − 2 (p + q). The three 4 D² add up to S, so that of the shortest diagonal is
    S / 3 at most, and one division keeps more than three quarters of the quality. But for min(p, q), the shortest
    diagonal is the best. On choices of the diagonal: S. Zhang, "Successive subdivisions of tetrahedra and multigrid
    methods on tetrahedral meshes", Houston Journal of Mathematics 21 (1995).
    """
    squared = squared_edges(vertices)
    p, q = squared[:, :3], squared[:, :2:-1]
    spared = 2.0 * (p + q) + np.minimum(p, q)
    return np.argmax(spared >= np.max(spared, axis=1, keepdims=True) * (1.0 - TIE), axis=1)


def divide_in_eight(
    vertices: NDArray[np.float64], diagonal: NDArray[np.intp] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Divide tetrahedra into eight of the same volume.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Positively oriented tetrahedra, meters.
    diagonal : (n,) int, optional
        Which diagonal of the inner octahedron to cut along; `best_diagonal` if None.

    Returns
    -------
    planes : (n, 7, 4) float64
        Cutting planes ``(nx, ny, nz, d)``, unit normals, in the order of a heap: plane ``i`` is followed by plane
        ``2 i + 1`` on side 0 and by plane ``2 i + 2`` on side 1.
    children : (n, 8, 4, 3) float64
        Positively oriented; child ``4 s + 2 t + u`` lies on sides ``s``, ``t`` and ``u`` of the three planes that lead
        to it. Even ones are the corners.
    """
    diagonal = best_diagonal(vertices) if diagonal is None else diagonal
    middles = (vertices[:, EDGES[:, 0]] + vertices[:, EDGES[:, 1]]) / 2.0
    points = np.concatenate([vertices, middles], axis=1)
    every = np.arange(len(vertices))[:, None, None]
    through = points[every, _PLANES[diagonal]]
    return plane_through(through[..., :3, :], through[..., 3, :]), points[every, _CHILDREN[diagonal]]


def divide_by_shape(
    vertices: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Divide tetrahedra into eight in the way that keeps them in better shape, so that no slivers arise.

    Both ways give eight of equal volume, three planes deep. Worst qualities are compared, with a `HANDICAP` on the
    bisection of compact tetrahedra.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Positively oriented tetrahedra, meters.

    Returns
    -------
    planes : (n, 7, 4) float64
        In the order of a heap, see `divide_in_eight`.
    children : (n, 8, 4, 3) float64
        Positively oriented, of equal volume.
    eight : (n,) bool
        Which were divided into the canonical eight; the others were bisected three times along their longest edges.

    Notes
    -----
    The paper "chooses a subdivision depending on the aspect ratio of the resulting tetrahedra in order to avoid sliver
    subvolumes" (section 4). The eight leave compact shapes at least three quarters of their quality, but cannot help
    with long ones: where opposite edges differ much, all three diagonals are equally bad. Those gain by bisection.
    """
    (planes, children), (other, halves) = divide_in_eight(vertices), bisect_thrice(vertices)
    handicap = np.where(quality(vertices) > COMPACT, HANDICAP, 1.0 + TIE)
    chosen = handicap * np.min(quality(children), axis=1) >= np.min(quality(halves), axis=1)
    bisected = ~chosen
    planes[bisected], children[bisected] = other[bisected], halves[bisected]
    return planes, children, chosen


def bisect_thrice(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Longest-edge bisection of tetrahedra ``(n, 4, 3)`` three times; planes and children as `divide_in_eight`."""
    planes, pieces = [], vertices
    for cuts in (1, 2, 4):
        cutting, pieces = bisect(pieces)
        planes.append(cutting.reshape(len(vertices), cuts, 4))
        pieces = pieces.reshape(-1, 4, 3)
    return np.concatenate(planes, axis=1), pieces.reshape(len(vertices), 8, 4, 3)
