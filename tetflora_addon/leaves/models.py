# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample leaves: a small polygon list that is copied to every leaf of a plant.

A leaf model lies with its base at the origin, its midrib along +y, one unit long, its upper side toward +z.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import GOLDEN_ANGLE, Floats, Integers, perpendicular, spiral, spread
from ..errors import SpeciesError
from ..parameters import limited
from .compounds import Compound
from .needles import Needles
from .outlines import Blade
from .surfaces import next_corners

MAX_LEAF_POLYGONS = 2000
MAX_LEAF_CORNERS = 4 * MAX_LEAF_POLYGONS  # of all faces; and vertices
MAX_FACE_CORNERS = 128  # polygons are what blocks, budgets and limits count, so none may be much larger than another
MAX_COORDINATE = 100.0  # in leaf lengths; keeps areas and bounds far from what floats can hold
MAX_UV = 10_000.0
#: Mean square of the second axis of normals up to which a model is flat, and part of the faces' area that silhouettes
#: show up to which these hide each other.
_FLAT_LEAF, _SOLID = 0.02, 0.55
#: Directions of silhouettes, and cells along each side of their images.
_DIRECTIONS, _CELLS = 16, 32


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
    """Polygons of one leaf.

    Attributes
    ----------
    positions : (v, 3) float64
        Vertices in units of the leaf's size.
    corner_verts : (c,) int32
        Vertex of each corner, face after face.
    face_offsets : (f + 1,) int32
        First corner of each face.
    uv : (c, 2) float32
        Texture coordinates by corner.
    material_index : (f,) int32, optional
        Material of each face, of models that have several.
    textured : bool
        Drawn as it is at any size: a texture may cut it out.
    shape : Blade, Needles or Compound, optional
        What it stands for, which leaves are drawn as that are near; see `levels`.
    spines : Spines, optional
        What grows on its closed parts up close.
    """

    positions: Floats
    corner_verts: NDArray[np.int32]
    face_offsets: NDArray[np.int32]
    uv: NDArray[np.float32]
    material_index: NDArray[np.int32] | None = None
    textured: bool = False
    shape: Blade | Needles | Compound | None = None
    spines: Spines | None = None

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
    def next_corner(self) -> NDArray[np.int32]:
        """(c,) int32: the corner that follows each corner in its face."""
        return next_corners(self.face_offsets)

    @cached_property
    def edges(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
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
        here, there = self.positions[self.corner_verts], self.positions[self.corner_verts[self.next_corner]]
        return 0.5 * np.add.reduceat(np.cross(here, there), self.face_offsets[:-1], axis=0)

    @cached_property
    def area(self) -> float:
        """One-sided area of a leaf of size 1."""
        return float(np.linalg.norm(self.face_vectors, axis=1).sum())

    @cached_property
    def shown_area(self) -> float:
        """One-sided area of flat leaves of size 1 that would show as much, turned all ways: twice the mean silhouette.

        Faces of cones and fruit hide each other; those of leaves count in full.
        """
        spread = np.linalg.eigvalsh(self.moment)
        if spread[1] < _FLAT_LEAF:
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
        """Extent across the midrib, in units of the leaf's size, which decides on its size in the image."""
        return float(np.ptp(self.positions[:, [0, 2]], axis=0).max())


def fans(model: LeafModel) -> tuple[Integers, Floats]:
    """Faces (c,) of triangles that fan out over them, one for each corner, and the corners (3, c, 3) of these."""
    first = model.corner_verts[model.face_offsets[:-1]]
    face = np.repeat(np.arange(model.polygons), np.diff(model.face_offsets))
    return face, model.positions[np.stack([first[face], model.corner_verts, model.corner_verts[model.next_corner]])]


def mean_silhouette(model: LeafModel) -> float:
    """Mean over directions of the area that a leaf of size 1 covers, seen from each, to a few percent.

    A quarter of the surface of what is convex (Cauchy, "Note sur divers théorèmes relatifs à la rectification des
    courbes et à la quadrature des surfaces", 1841). Directions follow a spiral over half of a sphere, as both sides
    show the same; faces are drawn as fans of triangles.
    """
    corners = fans(model)[1]
    number = np.arange(_DIRECTIONS)
    total = 0.0
    for toward in spiral((number + 0.5) / _DIRECTIONS, number, GOLDEN_ANGLE):
        across = perpendicular(toward[None])[0]
        flat = corners @ np.stack([across, np.cross(toward, across)], axis=1)
        low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
        # In cells, the middles of which are whole numbers.
        flat = (flat - low) * (_CELLS / np.maximum(high - low, 1e-12)) - 0.5
        least = np.ceil(flat.min(axis=0)).astype(np.int64).clip(0, _CELLS)
        wide = np.maximum(np.floor(flat.max(axis=0)).astype(np.int64).clip(-1, _CELLS - 1) - least + 1, 0)
        owner, index = spread(wide.prod(axis=1))
        cell = least[owner] + np.stack(np.divmod(index, np.maximum(wide[owner, 1], 1)), axis=1)
        a, b, c = flat[:, owner] - cell
        sides = np.stack([u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] for u, v in ((a, b), (b, c), (c, a))])
        covered = cell[(sides >= 0.0).all(axis=0) | (sides <= 0.0).all(axis=0)]
        total += len(np.unique(covered @ [_CELLS, 1])) / _CELLS**2 * np.prod(high - low)
    return float(total / _DIRECTIONS)


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
        raise SpeciesError(
            f"leaf model: faces refer to vertex {wrong[0]}, but the vertices are 0 to {len(positions) - 1}"
        )
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


def _folded(half_width: float, fold: float, droop: float) -> LeafModel:
    """Two quads that meet at the midrib and rise from it: a broad leaf with a hexagonal outline."""
    base, tip = (0.0, 0.0, 0.0), (0.0, 1.0, -droop)
    low, high = (half_width, 0.28, fold), (0.8 * half_width, 0.66, 0.7 * fold - 0.5 * droop)
    mirrored = [(-x, y, z) for x, y, z in (low, high)]
    return leaf_model([base, tip, low, high, *mirrored], [[0, 2, 3, 1], [0, 1, 5, 4]])


def _spray() -> LeafModel:
    """Four narrow quads fanned out in a plane, tilted out of it, and turned by turns: a bundle of needles."""
    positions = []
    for i in range(4):
        turn = np.radians(-55 + 110 * (i + 0.5) / 4)
        along = np.array([np.sin(turn), np.cos(turn), 0.25 * (1 if i % 2 else -1)])
        along /= np.linalg.norm(along)
        across = np.array([np.cos(turn), -np.sin(turn), 0.0])
        across = 0.025 / np.sqrt(2.0) * (across + (1 if i // 2 % 2 else -1) * np.cross(across, along))
        positions += [0 * along - across, 0 * along + across, along + across, along - across]
    faces = np.arange(16).reshape(4, 4).tolist()
    return leaf_model(np.array(positions), faces, np.tile([[0, 0], [1, 0], [1, 1], [0, 1]], (4, 1)))


def _outlined(half: list[tuple[float, float]], fold: float, droop: float) -> LeafModel:
    """Two polygons that meet at the midrib and rise from it, of a leaf whose right half has the outline given.

    The outline leads from behind the base to before the tip; ``fold`` is the rise and ``droop`` the fall over one unit.
    """
    right = [(x, y, fold * x - droop * y * y) for x, y in half]
    left = [(-x, y, z) for x, y, z in reversed(right)]
    ends = [(0.0, 0.0, 0.0), (0.0, 1.0, -droop)]
    n = len(half)
    faces = [[0, *range(2, n + 2), 1], [0, 1, *range(n + 2, 2 * n + 2)]]
    return leaf_model([*ends, *right, *left], faces)


def _flower() -> LeafModel:
    """Quads around a point half a unit along: an open flower that looks up, its petals raised at their tips."""
    petals, half_width, cup, center = 5, 0.24, 0.12, np.array([0.0, 0.5, 0.0])
    turn = 2 * np.pi * (np.arange(petals) + 0.5) / petals - np.pi / 2
    along = np.stack([np.cos(turn), np.sin(turn), np.zeros(petals)], axis=1)
    across = np.stack([-along[:, 1], along[:, 0], along[:, 2]], axis=1)
    rise = np.array([0.0, 0.0, cup])
    right, left = (center + 0.36 * along + side * across + 0.9 * rise for side in (-half_width, half_width))
    corners = np.stack([right, center + 0.52 * along + 0.7 * rise, left], axis=1)
    faces = [[0, 3 * i + 1, 3 * i + 2, 3 * i + 3] for i in range(petals)]
    return leaf_model(np.concatenate([center[None], corners.reshape(-1, 3)]), faces)


_LOBED = [(0.17, 0.2), (0.1, 0.34), (0.28, 0.5), (0.16, 0.62), (0.28, 0.8), (0.14, 0.96)]
_MAPLE = [(0.2, -0.05), (0.4, 0.12), (0.29, 0.22), (0.56, 0.56), (0.24, 0.5), (0.2, 0.74)]
_DELTOID = [(0.3, 0.1), (0.37, 0.3), (0.19, 0.66)]

#: What the built-in models stand for: the leaves that they are when they are near.
LEAF_SHAPES: dict[str, Blade | Needles | Compound] = {
    # A silver birch: rhombic, drawn out to a tip, doubly serrate.
    "kite": Blade(
        width=0.68, widest=0.34, base="cuneate", apex="acuminate", teeth=13, tooth="doubly serrate", tooth_size=0.035,
        fold=0.16, curl=0.06, wave=0.012, waves=3.5, petiole=0.1,
    ),
    # A beech: entire, with a shallow wave for each vein.
    "ovate": Blade(
        width=0.62, widest=0.42, base="rounded", apex="acute", teeth=8, tooth="sinuate", tooth_size=0.012,
        fold=0.24, curl=0.1, wave=0.014, waves=8.0, petiole=0.06,
    ),
    # An aspen: as broad as it is long, on a long stalk, with blunt teeth.
    "round": Blade(
        width=0.88, widest=0.38, base="truncate", apex="acute", teeth=15, tooth="crenate", tooth_size=0.022,
        fold=0.11, curl=0.06, wave=0.018, waves=2.5, petiole=0.12,
    ),
    # A willow: narrow, finely serrate.
    "lanceolate": Blade(
        width=0.27, widest=0.38, base="cuneate", apex="acuminate", teeth=34, tooth="serrate", tooth_size=0.006,
        fold=0.22, curl=0.12, wave=0.006, waves=5.0, petiole=0.03,
    ),
    # Four shoots of a conifer.
    "needles": Needles(
        needles=200, length=0.11, thickness=0.011, angle=48.0, angle_tip=24.0, flat=0.45, bend=0.1,
        shoot=0.95, shoots=4, spread=82.5, lift=0.25, stem=0.016,
    ),
    # An oak: rounded lobes, the largest beyond the middle.
    "lobed": Blade(
        width=0.58, widest=0.62, base="cuneate", apex="rounded", lobes=4, lobe_depth=0.5, lobe_round=1.0,
        fold=0.16, curl=0.08, wave=0.018, waves=3.5, petiole=0.04,
    ),
    # A Norway maple: five pointed lobes with few large teeth.
    "maple": Blade(
        width=1.12, widest=0.4, base="truncate", apex="acute", lobing="palmate", lobes=5, lobe_depth=0.44,
        lobe_round=0.1, teeth=10, tooth="serrate", tooth_size=0.075, fold=0.14, curl=0.1, wave=0.015, waves=2.0,
    ),
    # A poplar or downy birch: triangular, doubly serrate.
    "deltoid": Blade(
        width=0.76, widest=0.24, base="truncate", apex="acuminate", teeth=14, tooth="doubly serrate", tooth_size=0.03,
        fold=0.16, curl=0.08, wave=0.012, waves=3.0, petiole=0.08,
    ),
    # A cherry blossom: five petals around a cup.
    "blossom": Compound(
        leaflet=Blade(
            width=0.85, widest=0.6, base="cuneate", apex="rounded", fold=0.1, curl=-0.12, wave=0.03, waves=2.0,
        ),
        pairs=0, around=5, first=0.5, terminal=0, length=0.5, cup=0.22, curl=0.0, stem=0.02,
    ),
}  # fmt: skip

_COARSE: dict[str, LeafModel] = {
    # One quad, bent along the midrib: the least that still looks like a leaf.
    "kite": leaf_model([(0.0, 0.0, 0.0), (0.32, 0.4, 0.05), (0.0, 1.0, -0.05), (-0.32, 0.4, 0.05)], [[0, 1, 2, 3]]),
    "ovate": _folded(0.30, 0.08, 0.10),
    "round": _folded(0.42, 0.05, 0.06),
    "lanceolate": _folded(0.13, 0.03, 0.12),
    "needles": _spray(),
    "lobed": _outlined(_LOBED, 0.16, 0.08),
    "maple": _outlined(_MAPLE, 0.14, 0.1),
    "deltoid": _outlined(_DELTOID, 0.14, 0.08),
    "blossom": _flower(),
}
LEAF_MODELS: dict[str, LeafModel] = {n: replace(model, shape=LEAF_SHAPES.get(n)) for n, model in _COARSE.items()}
"""The built-in polygon lists by name, with what they stand for."""
