# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Longest-edge bisection: the cut that keeps tetrahedra from becoming slivers (paper, section 4).

The paper cuts by a plane and picks the division by the aspect ratio of what results. A plane through the midpoint of
the longest edge and the two vertices opposite it crosses one edge, gives two tetrahedra, and is one node of the binary
tree. M.-C. Rivara and C. Levin, "A 3-D refinement algorithm suitable for adaptive and multi-grid techniques",
Communications in Applied Numerical Methods 8 (1992).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .geometry import EDGES, plane_through, squared_edges

#: Squared lengths that differ by less than this share count as equal, so that the choice of the edge does not hang on
#: the last bit, which differs between processors and versions of numpy.
TIE = 1e-9


def longest_edge(vertices: NDArray[np.float64]) -> NDArray[np.intp]:
    """Index into `geometry.EDGES` of the longest edge; the first of those that are equally long.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Tetrahedra, metres.

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
        Positively oriented tetrahedra, metres.

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
