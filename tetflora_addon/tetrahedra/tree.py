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

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Integers, Integers32, Mask
from .geometry import EDGES, plane_distance, plane_through, quality, signed_volume, squared_edges

#: Squared lengths that differ by less than this fraction count as equal, so that the choice of the edge does not depend
#: on the last bit, which differs between processors and versions of numpy.
TIE = 1e-9


def longest_edge(vertices: Floats) -> Integers:
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


def bisect(vertices: Floats) -> tuple[Floats, Floats]:
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


def best_diagonal(vertices: Floats) -> Integers:
    """Diagonal along which the worst of the inner tetrahedra has the best quality.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Tetrahedra, meters.

    Returns
    -------
    (n,) intp
        Diagonal ``k`` joins the middles of edges ``k`` and ``5 - k`` of `geometry.EDGES`; the first of equal ones.

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


def divide_in_eight(vertices: Floats, diagonal: Integers | None = None) -> tuple[Floats, Floats]:
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
        Positively oriented; child ``4 s + 2 t + u`` on sides ``s``, ``t``, ``u`` of three planes; the even are corners.
    """
    diagonal = best_diagonal(vertices) if diagonal is None else diagonal
    points = np.concatenate([vertices, (vertices[:, EDGES[:, 0]] + vertices[:, EDGES[:, 1]]) / 2.0], axis=1)
    every = np.arange(len(vertices))[:, None, None]
    through = points[every, _PLANES[diagonal]]
    return plane_through(through[..., :3, :], through[..., 3, :]), points[every, _CHILDREN[diagonal]]


def divide_by_shape(vertices: Floats) -> tuple[Floats, Floats]:
    """Divide tetrahedra ``(n, 4, 3)`` into eight in the way that keeps them in better shape, so that no slivers arise.

    Both ways give eight of equal volume, three planes deep. The worst quality counts, bisection's with a `HANDICAP`.

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

    Notes
    -----
    The paper "chooses a subdivision depending on the aspect ratio of the resulting tetrahedra in order to avoid sliver
    subvolumes" (section 4). The eight leave compact shapes at least three quarters of their quality, but cannot help
    with long ones: where opposite edges differ much, all three diagonals are equally bad. Those gain by bisection.
    """
    (planes, children), (other, halves) = divide_in_eight(vertices), bisect_thrice(vertices)
    handicap = np.where(quality(vertices) > COMPACT, HANDICAP, 1.0 + TIE)
    bisected = handicap * np.min(quality(children), axis=1) < np.min(quality(halves), axis=1)
    planes[bisected], children[bisected] = other[bisected], halves[bisected]
    return planes, children


def bisect_thrice(vertices: Floats) -> tuple[Floats, Floats]:
    """Longest-edge bisection of tetrahedra ``(n, 4, 3)`` three times; planes and children as `divide_in_eight`."""
    planes, pieces = [], vertices
    for cuts in (1, 2, 4):
        cutting, pieces = bisect(pieces)
        planes.append(cutting.reshape(len(vertices), cuts, 4))
        pieces = pieces.reshape(-1, 4, 3)
    return np.concatenate(planes, axis=1), pieces.reshape(len(vertices), 8, 4, 3)


#: Points that `TetrahedralTree.locate` takes down the tree at a time; bounds its memory to some tens of megabytes.
POINT_BATCH = 1 << 18


class TetrahedralTree:
    """Binary tree of planes over a convex region of space.

    Node 0 is the root. Inner nodes near it may be convex regions without a tetrahedron; terminal nodes are tetrahedra
    once `split` is used (`tetflora_addon.tetrahedra.roots` sees to that). Between a tetrahedron and those that
    `split_by_shape` makes of it there may be such regions too.

    Parameters
    ----------
    vertices : (4, 3) float64, optional
        Tetrahedron of the root, positively oriented, meters. Without it the root is a region for `divide`.
    """

    def __init__(self) -> None:
        self._size = 0
        self._made = 0
        self._rows = {
            "plane": np.zeros((0, 4)),
            "children": np.zeros((0, 2), np.int32),
            "parent": np.zeros(0, np.int32),
            "level": np.zeros(0, np.int16),
            "inside": np.zeros(0, np.bool_),
            "vertices": np.zeros((0, 4, 3)),
        }
        self._inner_by_level: tuple[int, list[Integers]] = (-1, [])
        self._append(np.full(1, -1, np.int32), np.zeros(1, np.int16), np.zeros(1, np.bool_))

    def __len__(self) -> int:
        return self._size

    @property
    def children(self) -> Integers32:
        """Node numbers ``(len, 2)`` of the children on sides 0 and 1; −1 where the node is terminal."""
        return self._rows["children"][: self._size]

    @property
    def parent(self) -> Integers32:
        """Parent ``(len,)`` of each node; −1 for the root."""
        return self._rows["parent"][: self._size]

    @property
    def level(self) -> NDArray[np.int16]:
        """Steps ``(len,)`` from the root to each node."""
        return self._rows["level"][: self._size]

    @property
    def inside(self) -> Mask:
        """Whether each node ``(len,)`` lies within the view for which the root was made."""
        return self._rows["inside"][: self._size]

    @property
    def tetrahedra_made(self) -> int:
        """Number of nodes that are tetrahedra, terminal or divided."""
        return self._made

    @property
    def levels(self) -> int:
        """Number of levels; 1 for a root alone."""
        return int(self.level.max()) + 1

    @property
    def nbytes(self) -> int:
        """Bytes that the arrays take, spare rows included."""
        return sum(rows.nbytes for rows in self._rows.values())

    def vertices(self, nodes: ArrayLike) -> Floats:
        """Tetrahedra ``(n, 4, 3)`` float64 of nodes ``(n,)``, meters; NaN for regions without one."""
        return np.take(self._rows["vertices"][: self._size], nodes, axis=0)

    def planes(self, nodes: ArrayLike) -> Floats:
        """Cutting planes ``(n, 4)`` float64 of nodes ``(n,)``; zeros where the node is terminal."""
        return np.take(self._rows["plane"][: self._size], nodes, axis=0)

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
        planes, halves = bisect(self._tetrahedra(nodes))
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
            Terminals three levels further down, see `tree.divide_by_shape`; they inherit `inside`.

        Raises
        ------
        ValueError
            If a node is not terminal, has no tetrahedron, or occurs twice.
        """
        nodes = np.asarray(nodes, np.intp)
        planes, pieces = divide_by_shape(self._tetrahedra(nodes))
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
        first = self._size
        self._append(
            np.repeat(nodes.astype(np.int32), 2),
            np.repeat(self.level[nodes] + np.int16(1), 2),
            np.repeat(self.inside[nodes], 2),
        )
        made = np.arange(first, self._size, dtype=np.int32).reshape(-1, 2)
        self.children[nodes] = made
        self._rows["plane"][nodes] = planes
        return made

    def place(self, nodes: ArrayLike, vertices: ArrayLike) -> None:
        """Give nodes ``(n,)`` that have none their tetrahedra ``(n, 4, 3)``, positively oriented, meters."""
        self._rows["vertices"][nodes] = vertices
        self._made += len(np.atleast_1d(nodes))

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
        count = np.ones(self._size, np.int32)
        for nodes in reversed(inner):
            count[nodes] = count[children[nodes, 0]] + count[children[nodes, 1]]
        place = np.zeros(self._size, np.int32)
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
        found = np.zeros(len(points), np.int32)
        for start in range(0, len(points), POINT_BATCH):
            part = slice(start, start + POINT_BATCH)
            found[part] = self._descend(points[part])
        return found

    def _tetrahedra(self, nodes: Integers) -> Floats:
        vertices = self.vertices(nodes)
        if np.isnan(vertices[:, 0, 0]).any():
            raise ValueError("only nodes with a tetrahedron can be bisected; split regions by a plane instead")
        return vertices

    def _descend(self, points: Floats) -> Integers32:
        node = np.zeros(len(points), np.int32)
        moving = np.arange(len(points) if self.children[0, 0] >= 0 else 0)
        while len(moving):
            at = node[moving]
            side = plane_distance(self.planes(at), points[moving]) >= 0.0
            node[moving] = at = self.children[at, side.astype(np.intp)]
            moving = moving[self.children[at, 0] >= 0]
        return node

    def _levels_of_inner(self) -> list[Integers]:
        """Inner nodes of each level that has some, from the root down; kept until the tree grows."""
        if self._inner_by_level[0] != self._size:
            inner = np.flatnonzero(self.children[:, 0] >= 0)
            levels = self.level[inner]
            # Stable sorting of 16-bit integers is a radix sort: linear in the number of nodes.
            by_level = inner[np.argsort(levels, kind="stable")]
            groups = np.split(by_level, np.cumsum(np.bincount(levels))[:-1]) if len(inner) else []
            self._inner_by_level = (self._size, groups)
        return self._inner_by_level[1]

    def _append(self, parent: Integers32, level: NDArray[np.int16], inside: Mask) -> None:
        """Add terminal nodes without tetrahedra; capacity doubles, so that each row is copied twice on average."""
        start, end = self._size, self._size + len(parent)
        if end > len(self._rows["parent"]):
            capacity = max(64, end, 2 * len(self._rows["parent"]))
            for name, rows in self._rows.items():
                grown = np.zeros((capacity, *rows.shape[1:]), rows.dtype)
                grown[:start] = rows[:start]
                self._rows[name] = grown
        new = slice(start, end)
        self._rows["parent"][new] = parent
        self._rows["level"][new] = level
        self._rows["inside"][new] = inside
        self._rows["children"][new] = -1
        self._rows["vertices"][new] = np.nan
        self._size = end
