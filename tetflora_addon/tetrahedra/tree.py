# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The binary tree of planes: tetrahedra at its terminals, cutting planes at its inner nodes (paper, section 4).

A structure of arrays, one row a node. Rows are only ever appended: a node keeps its number, and children have higher
numbers than their parents. All walks go level by level over all nodes at once.

Tetrahedra are divided without slivers. Bisection: the plane through the midpoint of the longest edge and the two
vertices opposite it. M.-C. Rivara and C. Levin, "A 3-D refinement algorithm suitable for adaptive and multi-grid
techniques", Communications in Applied Numerical Methods 8 (1992).

Eight (fig. 2): midpoints of the six edges cut off four corners and leave an octahedron, which one of its diagonals
divides into four. With vertices a, b, c, d and the diagonal from the middle of ac to that of bd, the plane through the
middles of ac, ad, bc and bd parts a and b from c and d; the plane through the diagonal and the middles of ab and cd
parts a from b and c from d; the planes of the corners do the rest. Every child is three planes below its parent, as
after three bisections. Faces are divided at the middles of their edges whatever the diagonal, so neighbors conform.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Arrays, Floats, Growing, Integers, Integers32, Mask, column
from .geometry import EDGES, plane_distance, plane_through, quality, signed_volume, squared_edges

#: Squared lengths that differ by less than this fraction count as equal, so that the choice of the edge does not depend
#: on the last bit, which differs between processors and versions of numpy.
TIE = 1e-9


def _first_largest(values: Floats) -> Integers:
    """Index (n,) of the largest of values (n, k); the first of those that are equally large."""
    return np.argmax(values >= np.max(values, axis=1, keepdims=True) * (1.0 - TIE), axis=1)


def _longest_edge(vertices: Floats) -> Integers:
    """Index (n,) into `geometry.EDGES` of the longest edge of tetrahedra (n, 4, 3); the first of equal ones."""
    return _first_largest(squared_edges(vertices))


def _bisect(vertices: Floats) -> tuple[Floats, Floats]:
    """Planes (n, 4) through the midpoints of the longest edges of tetrahedra (n, 4, 3), and both halves (n, 2, 4, 3).

    Child 0 lies on the negative side. A child keeps its parent's vertices in their places but for the midpoint, so that
    what both share has the same coordinates to the last bit.
    """
    every = np.arange(len(vertices))
    edge = _longest_edge(vertices)
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


def _tables() -> tuple[Integers, Integers]:
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


def _best_diagonal(vertices: Floats) -> Integers:
    """Diagonal (n,) along which the worst inner piece of tetrahedra (n, 4, 3) has the best quality; the first of equal.

    All children have the same volume. Let S be the sum of the squared edges, D² the squared diagonal, and p and q the
    squares of the edges whose middles it joins. Two of the inner tetrahedra have edges of (S − p + 4 D²) / 4, two of
    (S − q + 4 D²) / 4, where 4 D² = S − 2 (p + q). The three 4 D² add up to S, so that of the shortest diagonal is
    S / 3 at most, and one division keeps more than three quarters of the quality. But for min(p, q), the shortest
    diagonal is the best. On choices of the diagonal: S. Zhang, "Successive subdivisions of tetrahedra and multigrid
    methods on tetrahedral meshes", Houston Journal of Mathematics 21 (1995).
    """
    squared = squared_edges(vertices)
    p, q = squared[:, :3], squared[:, :2:-1]
    return _first_largest(2.0 * (p + q) + np.minimum(p, q))


def _divide_in_eight(vertices: Floats, diagonal: Integers) -> tuple[Floats, Floats]:
    """Planes (n, 7, 4) and eight children (n, 8, 4, 3) of tetrahedra (n, 4, 3), along diagonals (n,) as of `_NAMES`.

    Planes are in the order of a heap: plane ``i`` is followed by plane ``2 i + 1`` on side 0 and by ``2 i + 2`` on side
    1. Child ``4 s + 2 t + u`` lies on sides ``s``, ``t``, ``u`` of three of them; the even ones are corners.
    """
    points = np.concatenate([vertices, (vertices[:, EDGES[:, 0]] + vertices[:, EDGES[:, 1]]) / 2.0], axis=1)
    every = np.arange(len(vertices))[:, None, None]
    through = points[every, _PLANES[diagonal]]
    return plane_through(through[..., :3, :], through[..., 3, :]), points[every, _CHILDREN[diagonal]]


def _divide_by_shape(vertices: Floats) -> tuple[Floats, Floats]:
    """Planes and children as of `_divide_in_eight`, or of three bisections where these leave better shapes.

    Both ways give eight of equal volume, three planes deep. The worst quality counts, bisection's with a `HANDICAP`.
    The paper "chooses a subdivision depending on the aspect ratio of the resulting tetrahedra in order to avoid sliver
    subvolumes" (section 4). The eight leave compact shapes at least three quarters of their quality, but cannot help
    with long ones: where opposite edges differ much, all three diagonals are equally bad. Those gain by bisection.
    """
    planes, children = _divide_in_eight(vertices, _best_diagonal(vertices))
    other, halves = _bisect_thrice(vertices)
    handicap = np.where(quality(vertices) > COMPACT, HANDICAP, 1.0 + TIE)
    bisected = handicap * np.min(quality(children), axis=1) < np.min(quality(halves), axis=1)
    planes[bisected], children[bisected] = other[bisected], halves[bisected]
    return planes, children


def _bisect_thrice(vertices: Floats) -> tuple[Floats, Floats]:
    """Longest-edge bisection of tetrahedra ``(n, 4, 3)`` three times; planes and children as `_divide_in_eight`."""
    planes, pieces = [], vertices
    for cuts in (1, 2, 4):
        cutting, pieces = _bisect(pieces)
        planes.append(cutting.reshape(len(vertices), cuts, 4))
        pieces = pieces.reshape(-1, 4, 3)
    return np.concatenate(planes, axis=1), pieces.reshape(len(vertices), 8, 4, 3)


#: Points that `TetrahedralTree.locate` takes down the tree at a time; bounds its memory to some tens of megabytes.
POINT_BATCH = 1 << 18


@dataclass(frozen=True)
class _Nodes(Arrays):
    """Nodes (n) of a tree; see its properties."""

    plane: Floats = column(4)
    children: Integers32 = column(2, dtype=np.int32)
    parent: Integers32 = column(dtype=np.int32)
    level: NDArray[np.int16] = column(dtype=np.int16)
    inside: Mask = column(dtype=bool)
    vertices: Floats = column(4, 3)

    @classmethod
    def terminal(cls, parent: Integers32, level: NDArray[np.int16], inside: Mask) -> Self:
        """Nodes that are not divided and have no tetrahedra."""
        new = replace(cls.zeros(len(parent)), parent=parent, level=level, inside=inside)
        new.children[:], new.vertices[:] = -1, np.nan
        return new


class TetrahedralTree:
    """Binary tree of planes over a convex region of space.

    Node 0 is the root. Inner nodes near it may be convex regions without a tetrahedron; terminal nodes are tetrahedra
    once `split` is used (`tetflora_addon.tetrahedra.roots` sees to that). Between a tetrahedron and those that
    `split_by_shape` makes of it there may be such regions too.
    """

    def __init__(self) -> None:
        root = _Nodes.terminal(np.full(1, -1, np.int32), np.zeros(1, np.int16), np.zeros(1, bool))
        self._nodes, self._placed = Growing(root), 0
        self._inner_by_level: tuple[int, list[Integers]] = (-1, [])

    def __len__(self) -> int:
        return len(self._nodes)

    @property
    def children(self) -> Integers32:
        """Node numbers ``(len, 2)`` of the children on sides 0 and 1; −1 where the node is terminal."""
        return self._nodes.rows.children

    @property
    def parent(self) -> Integers32:
        """Parent ``(len,)`` of each node; −1 for the root."""
        return self._nodes.rows.parent

    @property
    def level(self) -> NDArray[np.int16]:
        """Steps ``(len,)`` from the root to each node."""
        return self._nodes.rows.level

    @property
    def inside(self) -> Mask:
        """Whether each node ``(len,)`` lies within the view for which the root was made."""
        return self._nodes.rows.inside

    @property
    def tetrahedra_made(self) -> int:
        """Number of nodes that are tetrahedra, terminal or divided."""
        return self._placed

    @property
    def levels(self) -> int:
        """Number of levels; 1 for a root alone."""
        return int(self.level.max()) + 1

    @property
    def nbytes(self) -> int:
        """Bytes that the arrays take, spare rows included."""
        return self._nodes.nbytes

    def vertices(self, nodes: ArrayLike) -> Floats:
        """Tetrahedra ``(n, 4, 3)`` float64 of nodes ``(n,)``, meters; NaN for regions without one."""
        return np.take(self._nodes.rows.vertices, nodes, axis=0)

    def planes(self, nodes: ArrayLike) -> Floats:
        """Cutting planes ``(n, 4)`` float64 of nodes ``(n,)``; zeros where the node is terminal."""
        return np.take(self._nodes.rows.plane, nodes, axis=0)

    def terminals(self) -> Integers:
        """Numbers ``(t,)`` of the nodes that are not divided, ascending."""
        return np.flatnonzero(self.children[:, 0] < 0)

    def split(self, nodes: ArrayLike) -> Integers32:
        """Divide terminal tetrahedra by longest-edge bisection.

        Parameters
        ----------
        nodes : (n,) int
            Terminal nodes with a tetrahedron, each once.

        Returns
        -------
        (n, 2) int32
            The children on sides 0 and 1 of the planes; they inherit `inside`.

        Raises
        ------
        ValueError
            If a node is not terminal, has no tetrahedron, or occurs twice.
        """
        nodes = np.asarray(nodes, np.intp)
        planes, halves = _bisect(self._tetrahedra(nodes))
        children = self.divide(nodes, planes)
        self.place(children.ravel(), halves.reshape(-1, 4, 3))
        return children

    def split_by_shape(self, nodes: ArrayLike) -> Integers32:
        """Divide terminal tetrahedra into eight as suits their shape: the canonical eight, or three bisections.

        Parameters
        ----------
        nodes : (n,) int
            Terminal nodes with a tetrahedron, each once.

        Returns
        -------
        (n, 8) int32
            Terminals three levels further down; they inherit `inside`.

        Raises
        ------
        ValueError
            If a node is not terminal, has no tetrahedron, or occurs twice.
        """
        nodes = np.asarray(nodes, np.intp)
        planes, pieces = _divide_by_shape(self._tetrahedra(nodes))
        for first, end in ((0, 1), (1, 3), (3, 7)):  # planes are in the order of a heap
            nodes = self.divide(nodes, planes[:, first:end].reshape(-1, 4)).reshape(-1)
        self.place(nodes, pieces.reshape(-1, 4, 3))
        return nodes.reshape(-1, 8)

    def divide(self, nodes: ArrayLike, planes: ArrayLike) -> Integers32:
        """Divide terminal nodes by given planes; the children have no tetrahedra until `place` gives them some.

        Parameters
        ----------
        nodes : (n,) int
            Terminal nodes, each once.
        planes : (n, 4) float64
            Cutting planes ``(nx, ny, nz, d)``, unit normals.

        Returns
        -------
        (n, 2) int32
            The children on sides 0 and 1; they inherit `inside`.

        Raises
        ------
        ValueError
            If a node is not terminal or occurs twice.
        """
        nodes = np.asarray(nodes, np.intp)
        if (self.children[nodes, 0] >= 0).any() or (len(nodes) and np.bincount(nodes).max() > 1):
            raise ValueError("only terminal nodes can be split, and each only once")
        columns = nodes.astype(np.int32), self.level[nodes] + np.int16(1), self.inside[nodes]
        children = np.arange(len(self), len(self) + 2 * len(nodes), dtype=np.int32).reshape(-1, 2)
        self._nodes.append(_Nodes.terminal(*(np.repeat(values, 2) for values in columns)))
        self.children[nodes], self._nodes.rows.plane[nodes] = children, planes
        return children

    def place(self, nodes: ArrayLike, vertices: ArrayLike) -> None:
        """Give nodes ``(n,)`` that have none their tetrahedra ``(n, 4, 3)``, positively oriented, meters."""
        self._nodes.rows.vertices[nodes] = vertices
        self._placed += len(np.atleast_1d(nodes))

    def order(
        self, eye: ArrayLike | None = None, direction: ArrayLike | None = None, back_to_front: bool = False
    ) -> Integers32:
        """Front-to-back rank of each terminal; exact for any eye, as in a BSP tree (paper, section 4).

        At every plane the eye's side comes first. Ranks are offsets in that traversal, found without walking it:
        terminals are counted from the deepest level upwards, and places handed out from the root downwards.

        Parameters
        ----------
        eye : (3,) float64, optional
            Where rays start, meters, world space.
        direction : (3,) float64, optional
            Common direction of parallel rays; used if ``eye`` is None.
        back_to_front : bool
            Rank from the farthest terminal instead, as the paper draws its final image.

        Returns
        -------
        (len,) int32
            0 for the nearest terminal (the farthest if ``back_to_front``) and so on; −1 for inner nodes.

        Raises
        ------
        ValueError
            If neither an eye nor a direction is given.
        """
        if eye is None and direction is None:
            raise ValueError("a visibility order requires an eye or a direction")
        children, inner = self.children, self._levels_of_inner()
        count = np.ones(len(self), np.int32)
        for nodes in reversed(inner):
            count[nodes] = count[children[nodes, 0]] + count[children[nodes, 1]]
        place = np.zeros(len(self), np.int32)
        for nodes in inner:
            planes = self.planes(nodes)
            if eye is not None:
                near = plane_distance(planes, np.asarray(eye, np.float64)) >= 0.0
            else:
                # The eye is infinitely far back along the direction.
                near = planes[:, :3] @ np.asarray(direction, np.float64) < 0.0
            leading = (near != back_to_front).astype(np.intp)
            first, second = children[nodes, leading], children[nodes, 1 - leading]
            place[first] = place[nodes]
            place[second] = place[nodes] + count[first]
        place[children[:, 0] >= 0] = -1
        return place

    def locate(self, points: ArrayLike) -> Integers32:
        """Terminal that holds each point; points outside the root go to the one on their side of all planes.

        Parameters
        ----------
        points : (n, 3) float64
            Meters, world space.

        Returns
        -------
        (n,) int32
            Node numbers. A point on a plane belongs to side 1.
        """
        points = np.asarray(points, np.float64).reshape(-1, 3)
        terminals = np.zeros(len(points), np.int32)
        for start in range(0, len(points), POINT_BATCH):
            part = slice(start, start + POINT_BATCH)
            terminals[part] = self._descend(points[part])
        return terminals

    def _tetrahedra(self, nodes: Integers) -> Floats:
        vertices = self.vertices(nodes)
        if np.isnan(vertices[:, 0, 0]).any():
            raise ValueError("only nodes with a tetrahedron can be bisected; split regions by a plane instead")
        return vertices

    def _descend(self, points: Floats) -> Integers32:
        node = np.zeros(len(points), np.int32)
        moving = np.arange(len(points) if self.children[0, 0] >= 0 else 0)
        while len(moving):
            current = node[moving]
            side = plane_distance(self.planes(current), points[moving]) >= 0.0
            node[moving] = current = self.children[current, side.astype(np.intp)]
            moving = moving[self.children[current, 0] >= 0]
        return node

    def _levels_of_inner(self) -> list[Integers]:
        """Inner nodes of each level that has some, from the root down; kept until the tree grows."""
        if self._inner_by_level[0] != len(self):
            inner = np.flatnonzero(self.children[:, 0] >= 0)
            levels = self.level[inner]
            # Stable sorting of 16-bit integers is a radix sort: linear in the number of nodes.
            by_level = inner[np.argsort(levels, kind="stable")]
            groups = np.split(by_level, np.cumsum(np.bincount(levels))[:-1]) if len(inner) else []
            self._inner_by_level = (len(self), groups)
        return self._inner_by_level[1]
