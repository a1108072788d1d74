# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes of the trees of the benchmark `assets`, as other tools make them: branches, tubes, leaves, cards. numpy only.

Nothing here is one of our plants: no species, no seeds, no sub-plants.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Closed leaf of 16 triangles: a rim of six points, two above and two below the midrib. Along, across, up, for a length
#: of 1; the width comes in when it is placed.
_RIM = ((0.0, 0.0), (0.28, 0.42), (0.64, 0.4), (1.0, 0.0), (0.64, -0.4), (0.28, -0.42))
_RIBS = (0.3, 0.66)
_THICK = 0.012
#: Half of one side: rim 0 to 3, and the two points of the midrib as 6 and 7.
_HALF = ((0, 1, 6), (6, 1, 2), (6, 2, 7), (7, 2, 3))
#: Cells of an open leaf along and across: 40 triangles.
_CELLS = 5, 4


@dataclass(frozen=True)
class Order:
    """Branches of one order.

    Attributes
    ----------
    number : int
        Of each branch of the order before.
    length : float
        Relative to the parent's; of the trunk meters.
    first : float
        Where along the parent they begin, 0 to 1.
    lean : tuple of float
        Least and greatest angle to the parent, degrees.
    rise : float
        How much each segment turns up; negative hangs.
    segments, sides : int
        Of tubes.
    thick : float
        Radius relative to the parent's where it begins.
    """

    number: int
    length: float
    first: float
    lean: tuple[float, float]
    rise: float
    segments: int
    sides: int
    thick: float = 0.5


@dataclass(frozen=True)
class Branches:
    """Polylines of one order.

    Attributes
    ----------
    points : (n, s + 1, 3) float64
        Meters.
    radius : (n, s + 1) float64
        Meters.
    """

    points: Array
    radius: Array


@dataclass(frozen=True)
class Surface:
    """Triangles with what a mesh needs.

    Attributes
    ----------
    positions : (v, 3) float64
    triangles : (t, 3) int64
    uv : (t, 3, 2) float64
        Of each corner.
    material : (t,) int64
    """

    positions: Array
    triangles: NDArray[np.int64]
    uv: Array
    material: NDArray[np.int64]


def joined(surfaces: list[Surface]) -> Surface:
    """All of some surfaces in one."""
    first = np.cumsum([0] + [len(s.positions) for s in surfaces[:-1]])
    return Surface(
        np.concatenate([s.positions for s in surfaces]),
        np.concatenate([s.triangles + f for s, f in zip(surfaces, first, strict=True)]),
        np.concatenate([s.uv for s in surfaces]),
        np.concatenate([s.material for s in surfaces]),
    )


def branches(orders: tuple[Order, ...], rng: np.random.Generator, radius: float = 0.2) -> list[Branches]:
    """A tree of so many orders; the first is the trunk, from the origin upward."""
    base, heading = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    length, thick = np.array([orders[0].length]), np.array([radius])
    made: list[Branches] = []
    for number, order in enumerate(orders):
        if number:
            parent = made[-1]
            base, heading, length, thick = _children(parent, order, rng, crown=number == 1)
        points = [base]
        for _ in range(order.segments):
            heading = _unit(heading + rng.normal(0.0, 0.11, heading.shape) + [0.0, 0.0, order.rise / order.segments])
            points.append(points[-1] + heading * (length / order.segments)[:, None])
        taper = 1.0 - 0.85 * np.linspace(0.0, 1.0, order.segments + 1) ** 0.9
        made.append(Branches(np.stack(points, axis=1), np.maximum(thick[:, None] * taper, 0.0012)))
    return made


def _children(parent: Branches, order: Order, rng: np.random.Generator, crown: bool) -> tuple[Array, ...]:
    """Where branches begin, where to, their lengths and radii; those of a crown are longest in its lower middle."""
    number = len(parent.points)
    of = np.repeat(np.arange(number), order.number)
    rank = np.tile((np.arange(order.number) + 0.5) / order.number, number)
    t = np.clip(order.first + (1.0 - order.first) * (rank + rng.uniform(-0.5, 0.5, len(of)) / order.number), 0.0, 0.999)
    points, along = on(parent, of, t)
    turn = 2.399963 * np.arange(len(of)) + rng.uniform(-0.5, 0.5, len(of))
    side, up = _across(along)
    out = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up
    lean = np.radians(rng.uniform(*order.lean, len(of)) * (1.0 - 0.35 * t if crown else 1.0))[:, None]
    whole = np.linalg.norm(np.diff(parent.points, axis=1), axis=2).sum(axis=1)[of]
    shape = np.sqrt(np.clip(1.0 - ((rank - 0.3) / 0.72) ** 2, 0.06, 1.0)) if crown else 1.0 - 0.55 * t
    length = order.length * whole * shape * rng.uniform(0.8, 1.15, len(of))
    cell = np.minimum((t * (parent.radius.shape[1] - 1)).astype(int), parent.radius.shape[1] - 2)
    return points, np.cos(lean) * along + np.sin(lean) * out, length, order.thick * parent.radius[of, cell]


def on(parent: Branches, of: NDArray[np.int64], t: Array) -> tuple[Array, Array]:
    """Points at fractions of the lengths of branches, and the unit vectors along there."""
    cells = parent.points.shape[1] - 1
    cell = np.minimum((t * cells).astype(int), cells - 1)
    a, b = parent.points[of, cell], parent.points[of, cell + 1]
    return a + (b - a) * (t * cells - cell)[:, None], _unit(b - a)


def tubes(made: list[Branches], orders: tuple[Order, ...], material: int = 0) -> Surface:
    """Bark around branches, open at both ends."""
    return joined([_tubes(some, order.sides, material) for some, order in zip(made, orders, strict=True)])


def _tubes(some: Branches, sides: int, material: int) -> Surface:
    number, rings = some.radius.shape
    heading = _unit(some.points[:, -1] - some.points[:, 0])
    a, b = _across(heading)
    turn = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = np.cos(turn)[:, None] * a[:, None] + np.sin(turn)[:, None] * b[:, None]
    positions = some.points[:, :, None] + some.radius[:, :, None, None] * ring[:, None]
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
    cell = np.stack([i, i, i + 1, i, i + 1, i + 1], axis=-1).reshape(-1, 3)
    beside = np.stack([j, j + 1, j + 1, j, j + 1, j], axis=-1).reshape(-1, 3)
    one = cell * sides + beside % sides
    triangles = (one + (np.arange(number) * rings * sides)[:, None, None]).reshape(-1, 3)
    uv = np.broadcast_to(np.stack([beside / sides, cell / (rings - 1)], axis=-1), (number, len(one), 3, 2))
    return Surface(positions.reshape(-1, 3), triangles, uv.reshape(-1, 3, 2), np.full(len(triangles), material))


@dataclass(frozen=True)
class Stalks:
    """Where leaves or cards are.

    Attributes
    ----------
    base : (n, 3) float64
        Meters.
    along, across, up : (n, 3) float64
        Unit vectors of each: where its tip is, its width, what it turns to the sky.
    """

    base: Array
    along: Array
    across: Array
    up: Array

    @property
    def frames(self) -> Array:
        """(n, 3, 3), the axes as columns."""
        return np.stack([self.along, self.across, self.up], axis=2)


def stalks(twigs: Branches, number: int, rng: np.random.Generator, first: float = 0.15, droop: float = 0.25) -> Stalks:
    """So many on twigs, alternating along each, most of them level and somewhat hanging."""
    each = -(-number // len(twigs.points))
    of = np.repeat(np.arange(len(twigs.points)), each)
    rank = np.tile(np.arange(each), len(twigs.points))
    t = first + (1.0 - first) * (rank + rng.uniform(0.1, 0.9, len(of))) / each
    base, heading = on(twigs, of, np.minimum(t, 0.999))
    keep = np.sort(rng.permutation(len(of))[:number])
    of, rank, base, heading = of[keep], rank[keep], base[keep], heading[keep]
    side = _unit(np.cross(heading, [0.0, 0.0, 1.0]) + rng.normal(0.0, 0.15, heading.shape))
    along = _unit(0.6 * heading + np.where(rank % 2, 1.0, -1.0)[:, None] * side + [0.0, 0.0, -droop])
    along = _unit(along + rng.normal(0.0, 0.22, along.shape))
    across = _unit(np.cross([0.0, 0.0, 1.0] + rng.normal(0.0, 0.45, along.shape), along))
    return Stalks(base, along, across, np.cross(along, across))


def closed_leaves(places: Stalks, size: Array, material: int = 1) -> Surface:
    """Thin closed bodies of 16 triangles; size (n, 2): length and width, meters."""
    rim = np.array([(x, y, 0.05 * abs(y) - 0.1 * x * x) for x, y in _RIM])
    ribs = np.array([(x, 0.0, 0.02 + sign * _THICK - 0.1 * x * x) for sign in (1.0, -1.0) for x in _RIBS])
    half = np.array(_HALF)
    mirrored = np.array([0, 5, 4, 3, 0, 0, 6, 7])[half][:, ::-1]
    above = np.concatenate([half, mirrored])[:, ::-1]
    below = np.where(above >= 6, above + 2, above)[:, ::-1]
    return _placed(np.concatenate([rim, ribs]), np.concatenate([above, below]), places, size, material)


def open_leaf() -> Surface:
    """One lobed leaf of 40 triangles, a length of 1, in its own space: along x, with y across."""
    long, wide = _CELLS
    u, v = np.meshgrid(np.linspace(0.0, 1.0, long + 1), np.linspace(-1.0, 1.0, wide + 1), indexing="ij")
    width = (
        0.5 * np.sin(np.pi * np.clip(u, 0.02, 0.985) ** 0.8) ** 0.8 * (1.0 - 0.22 * (np.arange(long + 1) % 2))[:, None]
    )
    y = v * width
    z = 0.25 * np.abs(y) - 0.22 * u**2
    i, j = np.meshgrid(np.arange(long), np.arange(wide), indexing="ij")
    a = (i * (wide + 1) + j).ravel()
    corners = np.stack([a, a + wide + 1, a + wide + 2, a + 1], axis=1)
    triangles = corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    positions = np.stack([u, y, z], axis=-1).reshape(-1, 3)
    uv = np.stack([0.5 + 0.98 * positions[:, 1], 0.01 + 0.98 * positions[:, 0]], axis=1)[triangles]
    return Surface(positions, triangles, uv, np.zeros(len(triangles), np.int64))


def cards(places: Stalks, size: Array, tile: NDArray[np.int64], tiles: int = 2, material: int = 1) -> Surface:
    """Quads that show a tile of a square texture of ``tiles²`` each; size (n, 2): length and width, meters."""
    corners = np.array([(0.0, -0.5, 0.0), (1.0, -0.5, 0.0), (1.0, 0.5, 0.0), (0.0, 0.5, 0.0)])
    made = _placed(corners, np.array([(0, 1, 2), (0, 2, 3)]), places, size, material)
    own = np.array([(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)])[[[0, 1, 2], [0, 2, 3]]]
    origin = np.stack([tile % tiles, tile // tiles], axis=1)
    uv = (own[None] + origin[:, None, None, :]) / tiles
    return Surface(made.positions, made.triangles, uv.reshape(-1, 3, 2), made.material)


def _placed(points: Array, triangles: NDArray, places: Stalks, size: Array, material: int) -> Surface:
    """Copies of a leaf; its first coordinate is along, the second across, and both are its UV."""
    number = len(size)
    scale = np.stack([size[:, 0], size[:, 1], size[:, 0]], axis=1)
    frames = places.frames * scale[:, None, :]
    positions = np.einsum("nij,kj->nki", frames, points) + places.base[:, None]
    whole = (triangles[None] + (np.arange(number) * len(points))[:, None, None]).reshape(-1, 3)
    one = np.stack([0.5 + points[:, 1], points[:, 0]], axis=1)[triangles]
    uv = np.broadcast_to(one, (number, *one.shape)).reshape(-1, 3, 2)
    return Surface(positions.reshape(-1, 3), whole, uv, np.full(len(whole), material))


def areas(surface: Surface) -> Array:
    """Of each triangle, m²."""
    a, b, c = (surface.positions[surface.triangles[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0


def sprigs(pixels: int = 1024, leaves: int = 13) -> NDArray[np.float32]:
    """A painted texture (pixels, pixels, 4), linear and alpha: four sprigs, from old and dark to young and light.

    Each is a stem with pairs of leaves, transparent between them; in each, leaves grow lighter toward the tip.
    """
    half = pixels // 2
    tints = (((0.10, 0.16, 0.05), (0.20, 0.27, 0.08)), ((0.12, 0.22, 0.06), (0.28, 0.38, 0.10)))
    tints += (((0.17, 0.30, 0.07), (0.42, 0.52, 0.15)), ((0.30, 0.33, 0.10), (0.62, 0.58, 0.22)))
    painted = [_sprig(half, leaves, np.random.default_rng(n), *tint) for n, tint in enumerate(tints)]
    return np.concatenate([np.concatenate(painted[:2], axis=1), np.concatenate(painted[2:], axis=1)]).astype(np.float32)


def _sprig(size: int, leaves: int, rng: np.random.Generator, dark: tuple, light: tuple) -> Array:
    """A tile (size, size, 4); row 0 is where the stem begins, v grows along it."""
    v, u = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size - 0.5, indexing="ij")
    dark, light = np.array(dark), np.array(light)
    color = np.broadcast_to(0.6 * dark + [0.12, 0.06, 0.02], (size, size, 3)).copy()
    edge = 1.5 / size
    alpha = np.clip((0.006 - np.abs(u - 0.03 * np.sin(5 * v))) / edge, 0, 1) * (v < 0.9)
    for n in range(leaves):
        t, side = 0.05 + 0.82 * n / (leaves - 1), 1 if n % 2 else -1
        angle = np.radians(0.0 if n == leaves - 1 else rng.uniform(42, 68)) * side
        long = (0.16 if n == leaves - 1 else rng.uniform(0.28, 0.36)) * (1.0 - 0.3 * t)
        x, y = u - 0.03 * np.sin(5 * t), v - t
        along, across = np.sin(angle) * x + np.cos(angle) * y, np.cos(angle) * x - np.sin(angle) * y
        s = along / long
        width = 0.27 * long * np.sin(np.pi * np.clip(s, 0, 1) ** 0.85)
        inside = np.clip((width - np.abs(across)) / edge, 0, 1) * ((s > 0) & (s < 1))
        vein = 1.0 + 0.35 * np.exp(-((across / (0.01 * 1.5)) ** 2)) + 0.12 * np.cos(60 * s + 220 * np.abs(across))
        mix = np.clip(t + 0.2 * rng.uniform(-1, 1) + 0.25 * (s - 0.5), 0, 1)[..., None]
        leaf = (dark + (light - dark) * mix) * vein[..., None] * rng.uniform(0.85, 1.1)
        color = np.where(inside[..., None] > 0, leaf, color)
        alpha = np.maximum(alpha, inside)
    return np.concatenate([np.clip(color, 0, 1), alpha[..., None]], axis=2)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _across(heading: Array) -> tuple[Array, Array]:
    """Two unit vectors that are square to each of some."""
    other = np.where(np.abs(heading[:, :1]) < 0.8, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    side = _unit(np.cross(heading, other))
    return side, np.cross(heading, side)
