# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample leaves: a small polygon list that is copied to every leaf of a plant.

A leaf model lies with its base at the origin, its midrib along +y, one unit long, its upper side toward +z.

Closed parts of models, such as berries and fleshy leaves, are made round: faces are divided as by Loop ("Smooth
subdivision surfaces based on triangles", 1987). Points of spines and leaves stay where they are, and each part keeps
its area. What is open, such as stalks, stays as it is. Up close spines grow from areoles, evenly over closed parts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import GOLDEN_ANGLE, Floats, Floats32, Integers, Integers32, connected, perpendicular, spiral, spread
from ..errors import SpeciesError
from ..files import beside
from ..parameters import limited
from .outlines import Blade
from .surfaces import Compound, Needles, next_corners

MAX_LEAF_POLYGONS = 2000
MAX_LEAF_CORNERS = 4 * MAX_LEAF_POLYGONS  # of all faces; and vertices
MAX_FACE_CORNERS = 128  # polygons are what blocks, budgets and limits count, so none may be much larger than another
MAX_COORDINATE = 100.0  # in leaf lengths; keeps areas and bounds far from what floats can hold
MAX_UV = 10_000.0
#: Mean square of the second axis of normals up to which a model is flat, and part of the faces' area that silhouettes
#: show up to which these hide each other.
_FLAT_LEAF, _SOLID = 0.02, 0.55
#: Width of an ovate leaf over the root of its area. With their full width, shoots of pines were drawn one by one in
#: triangles of a tenth of a pixel: 5.2 million of 1,500 trees at 480 x 270, and 42 primitives a pixel in all.
_OVATE = 1.13
_DIRECTIONS, _CELLS = 16, 32  # directions of silhouettes, and cells along each side of their images


@dataclass(frozen=True)
class Spines:
    """Spines on a closed body; lengths are fractions of the leaf's."""

    distance: float = limited(0.1, 0.03, 1, "distance of areoles, from which spines grow")
    number: int = limited(2, 1, 12, "spines of an areole")
    length: float = limited(0.07, 0.005, 1, "length of a spine")
    thickness: float = limited(0.003, 0.0005, 0.05, "thickness of a spine at its base")
    lean: float = limited(35.0, 0, 85, "angle between a spine and what is perpendicular to the leaf, degrees")


@dataclass(frozen=True, eq=False)
class LeafModel:
    """Polygons of one leaf."""

    positions: Floats  # (v, 3): vertices in units of the leaf's size
    corner_verts: Integers32  # (c,): vertex of each corner, face after face
    face_offsets: Integers32  # (f + 1,): first corner of each face
    uv: Floats32  # (c, 2): texture coordinates by corner
    material_index: Integers32 | None = None  # (f,): material of each face, of models that have several
    textured: bool = False  # drawn as it is at any size: a texture may cut it out
    #: What it stands for, which leaves are drawn as that are near; see `levels`.
    shape: Blade | Needles | Compound | None = None
    spines: Spines | None = None  # what grows on its closed parts up close

    @property
    def polygons(self) -> int:
        """Number of faces."""
        return len(self.face_offsets) - 1

    @property
    def triangles(self) -> int:
        """Number of triangles that faces consist of."""
        return len(self.corner_verts) - 2 * self.polygons

    @cached_property
    def content(self) -> bytes:
        """Bytes that are equal for models that look the same from afar; what stored tables are keyed by."""
        arrays = (self.positions, self.corner_verts, self.face_offsets, self.uv, self.material_index)
        return b"".join(a.tobytes() for a in arrays if a is not None) + (b"textured" if self.textured else b"")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, LeafModel) and self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self._identity)

    @property
    def _identity(self) -> tuple[bytes, Blade | Needles | Compound | None, Spines | None]:
        return self.content, self.shape, self.spines

    @cached_property
    def next_corner(self) -> Integers32:
        """(c,) int32: the corner that follows each corner in its face."""
        return next_corners(self.face_offsets)

    @cached_property
    def edges(self) -> tuple[Integers32, Integers32]:
        """Edges (e, 2) int32 and the edge of each corner (c,) int32."""
        pairs = np.sort(np.stack([self.corner_verts, self.corner_verts[self.next_corner]], axis=1), axis=1)
        edges, corner_edges = np.unique(pairs, axis=0, return_inverse=True)
        return edges.astype(np.int32), corner_edges.reshape(-1).astype(np.int32)

    @cached_property
    def closed(self) -> bool:
        """Whether every edge belongs to two faces, as of fruit: half of the surface is never seen."""
        return bool((np.bincount(self.edges[1]) == 2).all())

    @cached_property
    def face_vectors(self) -> Floats:
        """(f, 3) float64: area vector (normal times area) of each face, by Newell's formula."""
        here, following = self.positions[self.corner_verts], self.positions[self.corner_verts[self.next_corner]]
        return 0.5 * np.add.reduceat(np.cross(here, following), self.face_offsets[:-1], axis=0)

    @cached_property
    def area(self) -> float:
        """One-sided area of a leaf of size 1."""
        return float(np.linalg.norm(self.face_vectors, axis=1).sum())

    @cached_property
    def shown_area(self) -> float:
        """One-sided area of flat leaves of size 1 that would show as much, turned all ways: twice the mean silhouette.

        Faces of cones and fruit hide each other; those of leaves count in full.
        """
        if np.linalg.eigvalsh(self.moment)[1] < _FLAT_LEAF:
            return self.area
        shown = 2.0 * mean_silhouette(self)
        return shown if shown < _SOLID * self.area else self.area

    @property
    def solid(self) -> bool:
        """Whether half of the surface or more is never seen, as of fruit and cones."""
        return self.shown_area < self.area

    @cached_property
    def moment(self) -> Floats:
        """(3, 3) float64: area-weighted mean of n nᵀ over the faces, in the leaf's own axes; its trace is 1."""
        areas = np.linalg.norm(self.face_vectors, axis=1)
        scaled = self.face_vectors / np.sqrt(np.maximum(areas, 1e-300))[:, None]
        return scaled.T @ scaled / areas.sum()

    @cached_property
    def reach(self) -> float:
        """Distance of the farthest vertex from the leaf's base, in units of its size."""
        return float(np.linalg.norm(self.positions, axis=1).max())

    @cached_property
    def width(self) -> float:
        """Extent across the midrib, in units of the leaf's size, which decides on its size in the image.

        Tufts and shoots of needles reach farther than what they show, and count as wide as an ovate leaf of that area.
        """
        return min(float(np.ptp(self.positions[:, [0, 2]], axis=0).max()), _OVATE * float(np.sqrt(self.shown_area)))


def fans(model: LeafModel) -> tuple[Integers, Floats]:
    """Faces (c,) of triangles that fan out over them, one for each corner, and the corners (3, c, 3) of these."""
    first = model.corner_verts[model.face_offsets[:-1]]
    face = np.repeat(np.arange(model.polygons), np.diff(model.face_offsets))
    return face, model.positions[np.stack([first[face], model.corner_verts, model.corner_verts[model.next_corner]])]


def mean_silhouette(model: LeafModel) -> float:
    """Mean over directions of the area that a leaf of size 1 covers, seen from each, to a few percent.

    A quarter of the surface of what is convex (Cauchy, "Note sur divers théorèmes relatifs à la rectification des
    courbes et à la quadrature des surfaces", 1841). Directions follow a spiral over half of a sphere; faces are fans.
    """
    corners = fans(model)[1]
    # The first and the last of each fan have no area.
    corners = np.delete(corners, np.concatenate([model.face_offsets[:-1], model.face_offsets[1:] - 1]), axis=1)
    number = np.arange(_DIRECTIONS)
    total = 0.0
    for toward in spiral((number + 0.5) / _DIRECTIONS, number):
        across = perpendicular(toward[None])[0]
        flat = corners @ np.stack([across, np.cross(toward, across)], axis=1)
        low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
        # In cells, the middles of which are whole numbers.
        flat = (flat - low) * (_CELLS / np.maximum(high - low, 1e-12)) - 0.5
        least = np.ceil(flat.min(axis=0)).astype(np.int64).clip(0, _CELLS)
        wide = np.maximum(np.floor(flat.max(axis=0)).astype(np.int64).clip(-1, _CELLS - 1) - least + 1, 0)
        owner, index = spread(wide.prod(axis=1))
        x, y = np.divmod(index, np.maximum(wide[:, 1], 1)[owner])
        x, y = least[:, 0][owner] + x, least[:, 1][owner] + y
        a, b, c = ((u[owner] - x, v[owner] - y) for u, v in np.ascontiguousarray(flat.transpose(0, 2, 1)))
        one, two, three = (u[0] * v[1] - u[1] * v[0] for u, v in ((a, b), (b, c), (c, a)))
        inside = (np.minimum(np.minimum(one, two), three) >= 0.0) | (np.maximum(np.maximum(one, two), three) <= 0.0)
        covered = np.zeros((_CELLS, _CELLS), np.bool_)
        covered[x[inside], y[inside]] = True
        total += np.count_nonzero(covered) / _CELLS**2 * np.prod(high - low)
    return float(total / _DIRECTIONS)


#: Models of a species, by kind of leaves.
Forms = Sequence[Sequence[LeafModel]]


def leaf_model(positions: ArrayLike, faces: list[list[int]], uv: ArrayLike | None = None) -> LeafModel:
    """Build and check a leaf model.

    Parameters
    ----------
    positions : (v, 3) float
        Vertices.
    faces : list of list of int
        Vertex indices of each face.
    uv : (v, 2) float, optional
        Texture coordinates by vertex; x and y of the vertices where not given.

    Returns
    -------
    LeafModel
        With the vertices that faces use, in the order given.

    Raises
    ------
    SpeciesError
        No face, too many, one that names a vertex twice or one that is not there, coordinates out of range, no area.
    """
    positions = np.asarray(positions, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise SpeciesError("leaf model: vertices must be a list of [x, y, z]")
    if not (np.abs(positions) <= MAX_COORDINATE).all():  # false for NaN as well
        raise SpeciesError(f"leaf model: vertices must be finite, each coordinate within ±{MAX_COORDINATE:g}")
    sizes = [len(f) for f in faces]
    if not 1 <= len(faces) <= MAX_LEAF_POLYGONS or min(sizes) < 3:
        raise SpeciesError(
            f"leaf model: must have 1 to {MAX_LEAF_POLYGONS} faces of 3 or more vertices, has {len(faces)}"
        )
    if max(sizes) > MAX_FACE_CORNERS:
        raise SpeciesError(
            f"leaf model: a face has {max(sizes):,} corners; {MAX_FACE_CORNERS} is the limit, so triangulate the face"
        )
    if max(sum(sizes), len(positions)) > MAX_LEAF_CORNERS:
        raise SpeciesError(f"leaf model: must have at most {MAX_LEAF_CORNERS} vertices and face corners")
    named = [v for f in faces for v in f]
    if wrong := [v for v in named if not 0 <= v < len(positions)]:
        raise SpeciesError(f"leaf model: faces refer to vertex {wrong[0]}, but vertices are 0 to {len(positions) - 1}")
    if any(len(set(f)) < len(f) for f in faces):
        raise SpeciesError("leaf model: a face uses a vertex twice")
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
    by_vertex = np.asarray(uv, dtype=np.float64) if uv is not None else positions[:, :2] + [0.5, 0.0]
    if by_vertex.shape != (len(positions), 2) or not (np.abs(by_vertex) <= MAX_UV).all():
        raise SpeciesError(f"leaf model: uv must have one [u, v] within ±{MAX_UV:g} for each vertex")
    used, corners = np.unique(np.array(named, dtype=np.int32), return_inverse=True)
    corners = corners.reshape(-1).astype(np.int32)
    model = LeafModel(positions[used], corners, offsets, by_vertex[used][corners].astype(np.float32))
    if not model.area > 0:
        raise SpeciesError("leaf model: all faces have zero area")
    return model


#: Kinds of outlines by their name in species files; the first is meant where none is given.
OUTLINES: dict[str, type] = {"blade": Blade, "needles": Needles, "compound": Compound}


def _outline(page: dict[str, Any]) -> Blade | Needles | Compound:
    fields = {key: _outline(value) if key == "leaflet" else value for key, value in page.items() if key != "kind"}
    return OUTLINES[page["kind"]](**fields)


_PAGES: dict[str, dict[str, Any]] = beside(__file__, "models.json")
LEAF_MODELS = {
    name: replace(leaf_model(page["vertices"], page["faces"], page.get("uv")), shape=_outline(page["outline"]))
    for name, page in _PAGES.items()
}
"""The built-in leaves by name: as species files have leaves, polygons and the outline that they stand for."""


#: Angle of all faces around a vertex below which it is a point, and stays: 2 π on flat ground, 4/3 π on an octahedron.
_POINTED = np.pi


def closed_parts(model: LeafModel) -> Integers:
    """Which closed part each face (f,) belongs to, by the number of one of its faces; -1 for what is open.

    A part is closed where each edge has two faces; it may share a vertex with a stalk.
    """
    of_corner = model.edges[1]
    face = np.repeat(np.arange(model.polygons), np.diff(model.face_offsets))
    order = np.argsort(of_corner, kind="stable")
    paired = np.bincount(of_corner) == 2
    part = connected(model.polygons, *face[order][paired[of_corner[order]]].reshape(-1, 2).T)
    return np.where(np.isin(part, part[face[~paired[of_corner]]]), -1, part)


def rounded(model: LeafModel, times: int) -> tuple[LeafModel, float]:
    """A model whose closed parts are divided so many times, each with the area that it had.

    Parameters
    ----------
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
    # Angle (v,) of all triangles (t, 3) around vertices, radians.
    place = points[corners]
    ahead, behind = np.roll(place, -1, axis=1) - place, np.roll(place, 1, axis=1) - place
    cosine = (ahead * behind).sum(axis=2)
    sine = np.linalg.norm(np.cross(ahead, behind), axis=2)
    fixed = np.bincount(corners.ravel(), np.arctan2(sine, cosine).ravel(), len(points)) < _POINTED
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
    corners, uv = (np.concatenate([np.stack(one, axis=1) for one in every]) for every in (faces, textures))
    part, fixed = np.append(part, part[edges[:, 0]]), np.append(fixed, np.zeros(len(edges), bool))
    return np.concatenate([points, new]), corners, uv, part, fixed, edges


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
    verts = np.append(corners.ravel(), model.corner_verts[kept]).astype(np.int32)
    offsets = np.cumsum(np.concatenate([[0], np.full(len(corners), 3), size])).astype(np.int32)
    uv = np.concatenate([uv.reshape(-1, 2), model.uv[kept]]).astype(np.float32)
    return replace(model, positions=points, corner_verts=verts, face_offsets=offsets, uv=uv)


def _areas(points: NDArray, corners: NDArray, part: NDArray, count: int | None = None) -> Floats:
    """Area (count,) of the triangles of each closed part, by its number."""
    a, b, c = points[corners].transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.bincount(part[corners[:, 0]], area, part.max(initial=0) + 1 if count is None else count)


def _middles(points: Floats, part: Integers) -> Floats:
    """Mean place (count, 3) of the vertices of each closed part, by its number."""
    vertices = np.flatnonzero(part >= 0)
    number = np.maximum(np.bincount(part[vertices]), 1)
    return np.stack([np.bincount(part[vertices], axis[vertices]) for axis in points.T], axis=1) / number[:, None]


#: What the color of the leaf is times that of spines, straw on green, and of the felt on areoles.
_SPINE, _FELT = (3.6, 1.9, 2.7), (1.7, 0.85, 0.9)
#: Height and radius of an areole over the distance of areoles, sides of it, and of a spine.
_CUSHION, _SIDES, _EDGES = (0.07, 0.11), 5, 3
_BARE = 0.08  # part at the base of the leaf that is bare


def spined(model: LeafModel, spines: Spines, part: Integers) -> tuple[LeafModel, Floats32]:
    """A model with spines on it.

    Parameters
    ----------
    part : (f,) int64
        Its `closed_parts`, on which spines stand.

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
    root, across = place[owner], perpendicular(along)
    axes = across, np.cross(along, across)
    needles = _pyramids(root, root + length[:, None] * along, *axes, spines.thickness / 2, _EDGES)
    whole, tints = model, [np.ones((model.polygons, 3))]
    for points, color in ((felt, _FELT), (needles, _SPINE)):
        far = np.linalg.norm(points, axis=-1, keepdims=True)  # none reaches farther than the model, as bounds know it
        whole = _with_triangles(whole, points * np.minimum(model.reach / np.maximum(far, 1e-300), 1.0))
        tints.append(np.tile(color, (len(points), 1)))
    return whole, np.concatenate(tints).astype(np.float32)


def _areoles(body: LeafModel, part: Integers, distance: float) -> tuple[Floats, Floats]:
    """Places (n, 3) on a body at least a distance apart, and its unit normals (n, 3) there."""
    first = body.corner_verts[body.face_offsets[:-1]]
    corners = np.add.reduceat(body.positions[body.corner_verts], body.face_offsets[:-1])
    middle = corners / np.diff(body.face_offsets)[:, None]
    area = np.linalg.norm(body.face_vectors, axis=1)
    faces = np.flatnonzero((part >= 0) & (area > 0) & (body.positions[first, 1] > _BARE))
    # From face to face far away from it, so that places are dense soon; each takes those around it away.
    faces = faces[np.argsort(0.6180339887 * np.arange(len(faces)) % 1.0)]
    chosen: list[int] = []
    free = np.ones(len(faces), bool)
    while free.any():
        one = int(np.argmax(free))
        chosen.append(int(faces[one]))
        free &= np.linalg.norm(middle[faces] - middle[faces[one]], axis=1) >= distance
    return middle[chosen], body.face_vectors[chosen] / area[chosen, None]


def _pyramids(base: Floats, tip: Floats, x: Floats, y: Floats, radius: float, sides: int) -> Floats:
    """Sides (n * sides, 3, 3) of pyramids from bases to tips (n, 3), around axes perpendicular to x and y (n, 3)."""
    angle = 2.0 * np.pi * np.arange(sides + 1) / sides
    ring = base[:, None] + radius * (np.cos(angle)[:, None] * x[:, None] + np.sin(angle)[:, None] * y[:, None])
    top = np.broadcast_to(tip[:, None], ring[:, 1:].shape)
    return np.stack([ring[:, :-1], ring[:, 1:], top], axis=2).reshape(-1, 3, 3)


def _with_triangles(model: LeafModel, points: Floats) -> LeafModel:
    """A model with triangles (t, 3, 3) more, whose texture lies below that of leaves, as that of stalks."""
    positions = np.concatenate([model.positions, points.reshape(-1, 3)])
    verts = np.append(model.corner_verts, np.arange(len(model.positions), len(positions))).astype(np.int32)
    ends = model.face_offsets[-1] + 3 * np.arange(1, len(points) + 1)
    offsets = np.append(model.face_offsets, ends).astype(np.int32)
    uv = np.concatenate([model.uv, np.tile([[0.5, -0.5]], (3 * len(points), 1))]).astype(np.float32)
    return replace(model, positions=positions, corner_verts=verts, face_offsets=offsets, uv=uv)
