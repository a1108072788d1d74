# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Small assets as other tools make them: trees of leaf quads, cards with holes, closed leaves, leaves on a skeleton."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tetflora_addon.assets.asset import Asset, AssetSource, AssetSurface
from tetflora_addon.assets.compiled import compile_steps
from tetflora_addon.jobs import run_to_end

GREEN, BROWN = (0.1, 0.3, 0.05), (0.2, 0.12, 0.08)


def surface(
    positions: ArrayLike,
    faces: Sequence[Sequence[int]],
    color: ArrayLike = GREEN,
    transmission: ArrayLike = np.nan,
    coverage: ArrayLike = 1.0,
    name: str = "surface",
) -> AssetSurface:
    """A surface of polygons, which become fans of triangles; looks broadcast against faces."""
    triangles = [(f[0], f[i], f[i + 1]) for f in faces for i in range(1, len(f) - 1)]
    owner = np.repeat(np.arange(len(faces)), [len(f) - 2 for f in faces])
    return AssetSurface(
        name,
        np.asarray(positions, np.float32).reshape(-1, 3),
        np.array(triangles, np.int32).reshape(-1, 3),
        owner.astype(np.int32),
        np.broadcast_to(np.asarray(color, np.float16), (len(faces), 3)).copy(),
        np.broadcast_to(np.asarray(transmission, np.float16), len(faces)).copy(),
        np.broadcast_to(np.asarray(coverage, np.float16), len(faces)).copy(),
    )


def joined(*some: AssetSurface, name: str = "tree") -> AssetSurface:
    """Several surfaces as one mesh."""
    vertices = np.cumsum([0, *(len(s.positions) for s in some)])
    faces = np.cumsum([0, *(s.faces for s in some)])
    return AssetSurface(
        name,
        np.concatenate([s.positions for s in some]),
        np.concatenate([s.triangles + np.int32(v) for s, v in zip(some, vertices, strict=False)]),
        np.concatenate([s.face + np.int32(f) for s, f in zip(some, faces, strict=False)]),
        *(np.concatenate([getattr(s, name) for s in some]) for name in ("color", "transmission", "coverage")),
    )


def source_of(
    *surfaces: AssetSurface,
    shown: ArrayLike | None = None,
    matrices: ArrayLike | None = None,
    digest: str = "ab",
    name: str = "tree",
) -> AssetSource:
    """A source that shows each surface once where it is, or as said."""
    shown = np.arange(len(surfaces)) if shown is None else np.asarray(shown)
    matrices = np.tile(np.eye(4), (len(shown), 1, 1)) if matrices is None else np.asarray(matrices, float)
    return AssetSource(name, surfaces, shown.astype(np.int32), matrices, digest)


def trunk(height: float = 3.0, radius: float = 0.12, rings: int = 12, sides: int = 8) -> AssetSurface:
    """A tube that becomes thinner, open at its ends."""
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    at = np.linspace(0, 1, rings)
    positions = np.concatenate([radius * (1 - 0.7 * t) * ring + [0, 0, height * t] for t in at])
    faces = [
        [i * sides + j, i * sides + (j + 1) % sides, (i + 1) * sides + (j + 1) % sides, (i + 1) * sides + j]
        for i in range(rings - 1)
        for j in range(sides)
    ]
    return surface(positions, faces, BROWN, 0.0)


def turns(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Rotations (n, 3, 3), none preferred."""
    q = rng.normal(size=(count, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def crown(rng: np.random.Generator, count: int, middle: float = 3.0, radius: float = 1.2) -> NDArray[np.float64]:
    """Places (n, 3) in a ball on a trunk."""
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return radius * np.cbrt(rng.random(count))[:, None] * direction + [0, 0, middle]


QUAD = np.array([[-0.5, 0, 0], [0, -0.3, 0.05], [0.5, 0, 0], [0, 0.3, 0.05]])
#: A leaf with two sides: eight triangles around a flat octahedron.
CLOSED = np.array([[0.5, 0, 0], [-0.5, 0, 0], [0, 0.3, 0], [0, -0.3, 0], [0, 0, 0.02], [0, 0, -0.02]])
CLOSED_FACES = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]


def leaves(
    seed: int = 1, count: int = 400, size: float = 0.15, closed: bool = False, varied: bool = False, radius: float = 1.2
) -> AssetSurface:
    """Leaves in a crown, each an island of its own; ``varied``: of many colors and coverages."""
    rng = np.random.default_rng(seed)
    form, own = (CLOSED, CLOSED_FACES) if closed else (QUAD, [(0, 1, 2, 3)])
    place = crown(rng, count, radius=radius)
    sizes = size * rng.uniform(0.7, 1.3, count)
    points = np.einsum("nij,kj->nki", turns(rng, count), form) * sizes[:, None, None] + place[:, None]
    faces = [[len(form) * i + k for k in f] for i in range(count) for f in own]
    if not varied:
        return surface(points, faces, transmission=0.3 if not closed else 0.4)
    looks = rng.uniform(0.02, 0.5, (len(faces), 3)), rng.uniform(0.1, 0.6, len(faces)), rng.uniform(0, 1, len(faces))
    return surface(points, faces, *looks)


def tree(seed: int = 1, count: int = 1500, **options: object) -> AssetSurface:
    """A trunk and leaves as one mesh."""
    return joined(trunk(), leaves(seed, count, **options))


def on_a_skeleton(seed: int = 1, count: int = 900) -> AssetSource:
    """A trunk, and a leaf that is shown many times: turned, stretched, and mirrored."""
    rng = np.random.default_rng(seed)
    matrices = np.tile(np.eye(4), (count + 1, 1, 1))
    stretch = rng.uniform(0.1, 0.3, (count, 3)) * rng.choice([-1, 1], (count, 3))
    matrices[1:, :3, :3] = turns(rng, count) * stretch[:, None, :]
    matrices[1:, :3, 3] = crown(rng, count)
    shown = np.concatenate([[0], np.ones(count)])
    leaf = surface(QUAD, [(0, 1, 2), (0, 2, 3)], coverage=[0.8, 0.4])
    return source_of(trunk(), leaf, shown=shown, matrices=matrices)


def degenerate(seed: int = 1) -> AssetSurface:
    """Leaves, and faces of no area: points, lines, twice the same."""
    rng = np.random.default_rng(seed)
    spots = crown(rng, 60)
    bad = surface(
        np.repeat(spots, 3, axis=0) + np.where(np.arange(180)[:, None] % 3 == 2, 0.05 * (spots[0] > 0), 0.0),
        [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(60)],
    )
    return joined(leaves(seed, 300), bad)


SOURCES = {
    "leaves": lambda: source_of(leaves()),
    "tree": lambda: source_of(tree(), digest="ab01"),
    "varied": lambda: source_of(tree(2, 1200, varied=True), digest="ab02"),
    "closed": lambda: source_of(joined(trunk(), leaves(3, 800, size=0.1, closed=True)), digest="ab03"),
    "skeleton": lambda: on_a_skeleton(),
    "degenerate": lambda: source_of(degenerate(), digest="ab04"),
    "card": lambda: source_of(surface(QUAD, [(0, 1, 2, 3)]), digest="ab05"),
    "trunk": lambda: source_of(trunk(rings=120, sides=12), digest="ab06"),
}


@cache
def source(kind: str) -> AssetSource:
    """One of `SOURCES`."""
    return SOURCES[kind]()


def compile_asset(one: AssetSource) -> Asset:
    """An asset, compiled at once."""
    return run_to_end(compile_steps(one))


@cache
def compiled(kind: str) -> Asset:
    """The same, compiled."""
    return compile_asset(source(kind))


def triangles_of(one: AssetSource) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray]:
    """Corners (t, 3, 3) of all triangles in the asset's space, their parts and faces (t,), and coverage (t,)."""
    found: list[list[NDArray]] = [[], [], [], []]
    for part, (number, matrix) in enumerate(zip(one.surface.tolist(), one.matrices, strict=True)):
        own = one.surfaces[number]
        corners = own.positions[own.triangles].astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
        columns = corners, np.full(len(corners), part), own.face, own.coverage[own.face].astype(float)
        for all_, column in zip(found, columns, strict=True):
            all_.append(column)
    return tuple(np.concatenate(column) for column in found)


def areas_of(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Areas (t,) of triangles."""
    return 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
