# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The canonical eight: a tetrahedron in eight, as a balanced binary tree of seven planes (paper, section 4, fig. 2).

The midpoints of the six edges cut off four corners, each the whole at half its size; what is left is an octahedron, and
one of its three diagonals divides it into four. The paper starts from "a plane [that] intersects four edges" and halves
"the two unintersected edges", which "generates a balanced tree". So it is here. With vertices a, b, c, d and the
diagonal from the middle of ac to that of bd, the plane through the middles of ac, ad, bc and bd parts a and b from c
and d; the plane through the diagonal and the middle of ab, which is that of cd as well, parts a from b and c from d;
the planes of the corners do the rest. Every child is three planes below its parent, as after three bisections.

Faces are divided at the middles of their edges whatever the diagonal, so neighbours that are both divided conform.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .bisection import TIE, bisect
from .geometry import EDGES, plane_through, quality, signed_volume

#: Vertices (a, b, c, d) for each diagonal ``k``, which joins the middles of ac, ``EDGES[k]``, and bd, ``EDGES[5 - k]``.
_NAMES = tuple((EDGES[k][0], EDGES[5 - k][0], EDGES[k][1], EDGES[5 - k][1]) for k in range(3))


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


def squared_diagonals(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared lengths ``(n, 3)`` of the three diagonals of the inner octahedron of tetrahedra ``(n, 4, 3)``, m².

    Diagonal ``k`` joins the middles of edges ``k`` and ``5 - k`` of `geometry.EDGES`.
    """
    ends = [vertices[:, EDGES[edges, 0]] + vertices[:, EDGES[edges, 1]] for edges in ([0, 1, 2], [5, 4, 3])]
    return np.sum((ends[0] - ends[1]) ** 2, axis=-1) / 4.0


def shortest_diagonal(vertices: NDArray[np.float64]) -> NDArray[np.intp]:
    """Number ``(n,)`` of the shortest diagonal of tetrahedra ``(n, 4, 3)``; the first of those that are equally short.

    Notes
    -----
    The inner tetrahedra have the same volume whichever diagonal is taken, and all else but that edge adds up to the
    same as well, so the shortest one gives the best mean-ratio quality in the mean over the four.
    S. Zhang, "Successive subdivisions of tetrahedra and multigrid methods on tetrahedral meshes", Houston Journal of
    Mathematics 21 (1995), takes the longest one and finds that shapes then degenerate.
    """
    squared = squared_diagonals(vertices)
    return np.argmax(squared <= np.min(squared, axis=1, keepdims=True) * (1.0 + TIE), axis=1)


def divide_in_eight(
    vertices: NDArray[np.float64], diagonal: NDArray[np.intp] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Divide tetrahedra into eight of the same volume.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Positively oriented tetrahedra, metres.
    diagonal : (n,) int, optional
        Which diagonal of the inner octahedron to cut along, see `squared_diagonals`; the shortest if None.

    Returns
    -------
    planes : (n, 7, 4) float64
        Cutting planes ``(nx, ny, nz, d)``, unit normals, in the order of a heap: plane ``i`` is followed by plane
        ``2 i + 1`` on side 0 and by plane ``2 i + 2`` on side 1.
    children : (n, 8, 4, 3) float64
        Positively oriented; child ``4 s + 2 t + u`` lies on sides ``s``, ``t`` and ``u`` of the three planes that lead
        to it. Even ones are the corners.
    """
    diagonal = shortest_diagonal(vertices) if diagonal is None else diagonal
    middles = (vertices[:, EDGES[:, 0]] + vertices[:, EDGES[:, 1]]) / 2.0
    points = np.concatenate([vertices, middles], axis=1)
    every = np.arange(len(vertices))[:, None, None]
    through = points[every, _PLANES[diagonal]]
    return plane_through(through[..., :3, :], through[..., 3, :]), points[every, _CHILDREN[diagonal]]


def eight_is_better(vertices: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the eight, or else longest-edge bisection three times, leaves the better worst quality.

    Both give eight tetrahedra of equal volume, three planes deep.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Positively oriented tetrahedra, metres.

    Returns
    -------
    (n,) bool
        True for the eight; so too where both are equally good, up to rounding.

    Notes
    -----
    The paper "chooses a subdivision depending on the aspect ratio of the resulting tetrahedra in order to avoid sliver
    subvolumes" (section 4).
    """
    eight = np.min(quality(divide_in_eight(vertices)[1]), axis=1)
    bisected = vertices
    for _ in range(3):
        bisected = bisect(bisected)[1].reshape(-1, 4, 3)
    return eight >= np.min(quality(bisected).reshape(-1, 8), axis=1) * (1.0 - TIE)
