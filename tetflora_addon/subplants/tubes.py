# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tubes around branches: rings of vertices, joined by quads (paper, section 5).

Twigs thinner than a pixel are one triangle from base to tip each, or a ribbon along those that bend. It has half of the
surface of the twig's tube, turned about its line at random: over many twigs the area seen is that of tubes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Integers32, chunks, spread, unit
from ..buffers import MeshBuffers, concatenate_buffers
from ..compiled.flora import Flora
from ..growth.axes import Axes
from ..growth.growth import WholeBranches, radius_at
from ..growth.hashing import Draw, uniform
from ..growth.seasons import branch_colors
from ..growth.seeds import Branches
from ..growth.wind import moment
from .pieces import Pieces, wood_areas
from .rings import BESIDES, Fineness, Pixels, Rings, fine_counts, fine_rings, fineness, keep_inside, ring_sums, rings_of

_RING_BATCH = 48_000  # rings that are worked on at a time: some ten megabytes
_ABOVE = 4.0  # how high stems beyond a fork begin, for materials, meters


def tube_buffers(
    flora: Flora, whole: Sequence[WholeBranches], pixels: Pixels | None = None, most_sides: int | None = None
) -> MeshBuffers | None:
    """Tubes of whole branches of any rows.

    Parameters
    ----------
    pixels : Pixels, optional
        How large they are; near branches are rounder then, and bent, and have feet.
    most_sides : int, optional
        Sides of a tube at most, for what is a few pixels wide.

    Returns
    -------
    MeshBuffers or None
        Quads with ``UVMap``, ``tf_color``, ``tf_transmission`` and ``tf_girth``; None without branches.
    """
    sorts = [sort for wood in whole for sort in _sorts(flora, wood, pixels, most_sides)]
    sorts.sort(key=attrgetter("sides"))
    if not sorts:
        return None
    vertices, faces = (sum(numbers) for numbers in zip(*(sort.numbers() for sort in sorts), strict=True))
    tubes = _Tubes(vertices, faces, moment(flora.rows) > 0)
    while sorts:
        for rings, sides, inside in sorts.pop(0).ring_batches(flora):
            tubes.add(flora, rings, sides, inside)
    return tubes.buffers()


def tube_faces(flora: Flora, whole: WholeBranches, pixels: Pixels | None = None) -> int:
    """Faces that `tube_buffers` makes, without making them."""
    return sum(sort.numbers()[1] for sort in _sorts(flora, whole, pixels))


@dataclass(frozen=True)
class _TubeGroup:
    """Branches (n,) of one number of sides.

    ``rings`` (n,) are those of tubes. Where branches are more than coarse tubes, ``beside`` are the rings (n,) of each
    of `BESIDES`, and ``counts`` (n, S) are parts of their segments.
    """

    whole: WholeBranches
    sides: int
    rings: Integers
    beside: tuple[Integers, ...] = ()
    fine: Fineness | None = None
    counts: Integers | None = None

    def numbers(self) -> tuple[int, int]:
        """Vertices and faces."""
        vertices, faces = self.sides * int(self.rings.sum()), self.sides * int((self.rings - 1).sum())
        for number, (_, sides_of, each) in zip(self.beside, BESIDES, strict=False):
            rings, sides = int(number.sum()), int(sides_of(self.sides))
            vertices, faces = vertices + sides * rings, faces + sides * (rings - rings // each)
        return vertices, faces

    def ring_batches(self, flora: Flora) -> Iterator[tuple[Rings, int, WholeBranches | None]]:
        """Rings, how many vertices they have, and branches within whose bounds they have to stay."""
        if self.fine is None:
            for chunk in chunks(self.rings, _RING_BATCH):
                yield rings_of(flora, self.whole.take(chunk)), self.sides, None
            return
        for chunk in chunks(self.rings * self.sides, 8 * _RING_BATCH):
            whole, fine = self.whole.take(chunk), self.fine.take(chunk)
            yield fine_rings(flora, whole, fine, self.counts[chunk]), self.sides, whole
            for rings_beside, sides_of, _ in BESIDES:
                if (rings := rings_beside(flora, whole, fine)) is not None:
                    yield rings[0], int(sides_of(self.sides)), whole.take(rings[1])


def _sorts(
    flora: Flora, whole: WholeBranches, pixels: Pixels | None, most_sides: int | None = None
) -> Iterator[_TubeGroup]:
    """Branches by their sides."""
    if not len(whole):
        return
    sides = flora.rows["sides"][whole.branches.row]
    sides = sides if most_sides is None else np.minimum(sides, most_sides)
    fine = None if pixels is None else fineness(flora, whole, pixels)
    near = np.zeros(len(whole), bool) if fine is None else fine.weight > 0
    far = np.flatnonzero(~near)
    rings = whole.lines.segments + flora.rows["rings"][whole.branches.row] + 1
    for k in np.unique(sides[far]):
        group = far[sides[far] == k]
        yield _TubeGroup(whole.take(group), int(k), rings[group])
    near = np.flatnonzero(near)
    for k in np.unique(fine.sides[near]) if len(near) else ():
        group = near[fine.sides[near] == k]
        wood, how = whole.take(group), fine.take(group)
        counts = fine_counts(flora, wood, how, pixels)
        yield _TubeGroup(wood, int(k), *ring_sums(flora, wood, counts), how, counts)


class _Tubes:
    """Tubes under construction: the arrays of the whole mesh, and how far they are filled.

    There are as many edges as vertices and faces together; vertices that are ``moving`` have velocities.
    """

    def __init__(self, vertices: int, faces: int, moving: bool) -> None:
        self.vertices = self.edges = self.faces = 0
        self.positions = np.zeros((vertices, 3), np.float32)
        self.velocity = np.zeros_like(self.positions) if moving else None
        self.edge_verts = np.zeros((vertices + faces, 2), np.int32)
        self.corner_verts, self.corner_edges = np.zeros((2, faces, 4), np.int32)
        self.uv = np.zeros((faces, 8), np.float32)
        self.color = np.zeros((faces, 3), np.float32)
        self.girth = np.zeros(faces, np.float32)

    def buffers(self) -> MeshBuffers:
        """The mesh."""
        return MeshBuffers(
            positions=self.positions,
            edge_verts=self.edge_verts,
            corner_verts=self.corner_verts.reshape(-1),
            corner_edges=self.corner_edges.reshape(-1),
            face_offsets=np.arange(0, 4 * len(self.corner_verts) + 1, 4, dtype=np.int32),
            attributes=wood_attributes(self.uv.reshape(-1, 2), self.color, self.girth, self.velocity),
            smooth=True,
        )

    def add(self, flora: Flora, rings: Rings, sides: int, inside: WholeBranches | None = None) -> None:
        """Tubes of one number of sides; ``inside`` whose bounds they have to stay, if that is not certain."""
        branches, number = rings.branches, len(rings.t)
        lower = np.flatnonzero(rings.goes_on)
        self._add_shape(self.positions, rings.center.T.astype(np.float32), rings.reach, sides, rings.swelling)
        if inside is not None:
            points = self.positions[self.vertices : self.vertices + number * sides]
            keep_inside(flora, inside.branches, np.repeat(rings.branch, sides), points)
        if rings.later is not None:
            seconds = moment(flora.rows)
            center = ((rings.later[0] - rings.center) / seconds).T.astype(np.float32)
            moved = (rings.later[1] - rings.reach) / np.float32(seconds)
            self._add_shape(self.velocity, center, moved, sides, rings.swelling)
        self._add_topology(lower.astype(np.int32), number, sides)
        # v counts lengths of the perimeter at the branch's base, so that a texture is as wide as it is high.
        girth = base_girth(branches)
        # Stems beyond a fork do not begin at the ground, where materials have moss.
        above = np.where(flora.rows["continues"][branches.row], _ABOVE, 0.0) / np.maximum(girth, 1e-9)
        v = rings.t * np.take(branches.length / np.maximum(girth, 1e-9), rings.branch) + above[rings.branch]
        color = branch_colors(flora.rows, branches.row, branches.key) if rings.color is None else rings.color
        color = color.astype(np.float32)
        color = np.ascontiguousarray(color)[np.take(rings.branch, lower)]
        self._add_looks(v[lower], v[lower + 1], color, sides)
        every = slice(self.faces, self.faces + len(lower) * sides)
        self.girth[every] = np.repeat(np.take(girth, np.take(rings.branch, lower)), sides)
        self.vertices += number * sides
        self.edges += (number + len(lower)) * sides
        self.faces += len(lower) * sides

    def _add_shape(
        self, out: Floats32, center: Floats32, reach: Floats32, sides: int, swelling: Floats32 | None
    ) -> None:
        """Vertices around centers (3, rings), along both axes (2, 3, rings) of each ring; or, as well, velocities."""
        rings = center.shape[1]
        angle = 2 * np.pi * np.arange(sides) / sides
        points = np.zeros((sides, 3, rings), np.float32)
        for k, (point, x, y) in enumerate(zip(points, np.cos(angle), np.sin(angle), strict=True)):  # a tube's sides
            np.multiply(reach[0], np.float32(x), out=point)
            point += reach[1] * np.float32(y)
            if swelling is not None:
                point *= swelling[k]
            point += center
        new = out[self.vertices : self.vertices + rings * sides]
        new.reshape(rings, -1)[...] = points.reshape(-1, rings).T

    def _add_topology(self, base: Integers32, rings: int, sides: int) -> None:
        """Edges around all rings, then edges from those where pieces start (p,) to the next; faces between."""
        here = np.arange(sides, dtype=np.int32)
        beside = np.roll(here, -1)
        lower = np.int32(self.vertices) + base * np.int32(sides)
        ring_edge = np.int32(self.edges) + base * np.int32(sides)
        long_edge = np.int32(self.edges + rings * sides) + np.arange(0, len(base) * sides, sides, dtype=np.int32)

        new = self.edge_verts[self.edges : self.edges + (rings + len(base)) * sides].reshape(-1, 2 * sides)
        first = np.arange(self.vertices, self.vertices + rings * sides, sides, dtype=np.int32)
        np.add(first[:, None], _interleaved(here, beside), out=new[:rings])
        np.add(lower[:, None], _interleaved(here, here + sides), out=new[rings:])
        faces = slice(self.faces, self.faces + len(base) * sides)
        new = self.corner_verts[faces].reshape(len(base), -1)
        np.add(lower[:, None], _interleaved(here, beside, beside + sides, here + sides), out=new)
        new = self.corner_edges[faces].reshape(len(base), -1)
        np.add(ring_edge[:, None], _interleaved(here, here + sides), out=new[:, ::2])
        np.add(long_edge[:, None], _interleaved(beside, here), out=new[:, 1::2])

    def _add_looks(self, low: NDArray, high: NDArray, color: Floats32, sides: int) -> None:
        """Texture coordinates between the v (p,) at both ends of pieces, their colors (p, 3)."""
        number = len(low) * sides
        new = self.uv[self.faces : self.faces + number].reshape(len(low), -1)
        u0, u1, zero = np.arange(sides) / sides, np.arange(1, sides + 1) / sides, np.zeros(sides)
        u = _interleaved(u0, zero, u1, zero, u1, zero, u0, zero).astype(np.float32)
        weights = np.array([[0, 1, 0, 1, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1, 0, 1]], np.float32)
        at_low, at_high = np.tile(weights, sides)
        np.multiply(low.astype(np.float32)[:, None], at_low, out=new)
        new += high.astype(np.float32)[:, None] * at_high
        new += u
        self.color[self.faces : self.faces + number] = np.repeat(color, sides, axis=0)


def wood_attributes(
    uv: Floats32, color: Floats32, girth: Floats32, velocity: NDArray | None
) -> dict[str, tuple[str, NDArray]]:
    """Attributes of a mesh of wood: of its corners, of its faces, and of its vertices where these move."""
    motion = {} if velocity is None else {"velocity": ("POINT", velocity)}
    faces = {"tf_color": color, "tf_transmission": np.zeros(len(color), np.float32), "tf_girth": girth}
    return {"UVMap": ("CORNER", uv), **{name: ("FACE", values) for name, values in faces.items()}, **motion}


def base_girth(branches: Branches) -> Floats:
    """Length (n,) around branches at their base, without flare, meters: what v counts."""
    return 2 * np.pi * branches.radius


def _interleaved(*columns: NDArray) -> NDArray:
    """First of each, then second of each, and so on."""
    return np.stack(columns, axis=1).reshape(-1)


def twig_buffers(flora: Flora, whole: WholeBranches, wider: Floats, parts: Integers) -> MeshBuffers | None:
    """Triangles and ribbons in the place of tubes.

    Parameters
    ----------
    whole : WholeBranches of n
        Of any rows.
    wider : (n,) float64
        How many times as wide each is: it stands for so many twigs.
    parts : (n,) int64
        Quadrilaterals that ribbons consist of; 1 for triangles.

    Returns
    -------
    MeshBuffers or None
        Attributes as of `tubes.tube_buffers`; None without branches.
    """
    straight, curved = np.flatnonzero(parts <= 1), np.flatnonzero(parts > 1)
    buffers = [_triangles(flora, whole.take(straight), wider[straight])] if len(straight) else []
    if len(curved):
        buffers.append(_ribbons(flora, whole.take(curved), wider[curved], parts[curved]))
    return concatenate_buffers(buffers)


def _triangles(flora: Flora, whole: WholeBranches, times: Floats) -> MeshBuffers:
    """A triangle from base to tip of each of branches (n,), so many times (n,) as wide."""
    branches, number = whole.branches, len(whole)
    base, tip = _ends(whole.lines)
    along = tip - base
    length = np.linalg.norm(along, axis=1)
    direction = unit(along)
    across = _turned(branches, branches.frame)
    across = unit(across - (across * direction).sum(axis=1, keepdims=True) * direction)
    # A triangle is half as wide on average as at its base.
    none = np.zeros(number)
    surface = wood_areas(flora, Pieces(branches, none, none + 1.0, base, tip))
    half = 0.5 * (times * surface / np.maximum(length, 1e-12))[:, None] * across
    corners = np.stack([base - half, base + half, tip], axis=1)
    velocity = None
    if whole.lines.later is not None:
        then = _ends(whole.lines.later)
        speed = [(end - now) / moment(flora.rows) for end, now in zip(then, (base, tip), strict=True)]
        velocity = np.stack([speed[0], speed[0], speed[1]], axis=1).reshape(-1, 3)
    each = np.arange(3 * number, dtype=np.int32)
    uv = np.zeros((number, 3, 2))
    uv[:, 1, 0], uv[:, 2, 0], uv[:, 2, 1] = 1.0, 0.5, _height(branches)
    edges = np.stack([each, each + np.tile(np.array([1, 1, -2], np.int32), number)], axis=1)
    topology = edges, each, each, 3 * np.arange(number + 1)
    corners, uv = corners.reshape(-1, 3), uv.reshape(-1, 2)
    return _buffers(flora, branches, np.arange(number), corners, velocity, uv, topology)


def _ribbons(flora: Flora, whole: WholeBranches, times: Floats, parts: Integers) -> MeshBuffers:
    """A chain of quadrilaterals (n,) along each of branches (n,), so many times (n,) as wide, as girths taper."""
    branches, lines = whole.branches, whole.lines
    ring, number = spread(parts + 1)
    place = number / parts[ring]
    middle, frame = lines.at(ring, place)
    owners = branches.take(ring)
    sides = flora.rows["sides"][owners.row]
    around = times[ring] * sides * np.sin(np.pi / sides) * radius_at(flora.rows, owners, place)
    half = 0.5 * around[:, None] * _turned(owners, frame)
    corners = np.stack([middle - half, middle + half], axis=1).reshape(-1, 3)
    velocity = None
    if lines.later is not None:
        velocity = np.repeat((lines.later.at(ring, place)[0] - middle) / moment(flora.rows), 2, axis=0)
    # Each ring has an edge of its own; behind all but the last are two more, and a face.
    first = np.flatnonzero(number < parts[ring])
    low = 2 * first
    quads = np.stack([low, low + 1, low + 3, low + 2], axis=1)
    rungs, beside = len(ring), np.arange(len(first))
    edges = np.concatenate([np.arange(2 * rungs).reshape(-1, 2), quads[:, [0, 3]], quads[:, [1, 2]]])
    left, right = rungs + beside, rungs + len(first) + beside
    border = np.stack([first, right, first + 1, left], axis=1)
    high = place * _height(branches)[ring]
    across = np.array([0.0, 1.0, 1.0, 0.0])[None] + np.zeros((len(first), 1))
    uv = np.stack([across, np.stack([high[first], high[first], high[first + 1], high[first + 1]], axis=1)], axis=2)
    topology = edges, quads.ravel(), border.ravel(), 4 * np.arange(len(first) + 1)
    return _buffers(flora, branches, ring[first], corners, velocity, uv.reshape(-1, 2), topology)


def _buffers(
    flora: Flora,
    branches: Branches,
    owner: Integers,
    corners: Floats,
    velocity: Floats | None,
    uv: Floats,
    topology: tuple[Integers, ...],
) -> MeshBuffers:
    """Buffers of faces (f,) of branches (f,), with vertices (v, 3) that move at velocities (v, 3).

    ``topology`` are the four arrays of `MeshBuffers`, in their order.
    """
    color, girth = branch_colors(flora.rows, branches.row, branches.key), base_girth(branches)
    light = (None if of is None else of.astype(np.float32) for of in (uv, color[owner], girth[owner], velocity))
    whole = (of.astype(np.int32) for of in topology)
    return MeshBuffers(corners.astype(np.float32), *whole, wood_attributes(*light), smooth=True)


def _turned(branches: Branches, frame: Floats) -> Floats:
    """Unit vectors (n, 3) across lines with frames (n, 3, 3), turned about these at random."""
    turn = 2.0 * np.pi * uniform(branches.key, Draw.TWIG_TURN)[:, None]
    return np.cos(turn) * frame[:, :, 0] + np.sin(turn) * frame[:, :, 1]


def _height(branches: Branches) -> Floats:
    """Length (n,) of the texture along branches, in girths."""
    return branches.length / np.maximum(base_girth(branches), 1e-9)


def _ends(lines: Axes) -> tuple[Floats, Floats]:
    """First and last knots (n, 3) of lines."""
    every = np.arange(len(lines.segments))
    return lines.knot(every, np.zeros(len(every), np.int64)), lines.knot(every, lines.segments)
