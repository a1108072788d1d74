# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How well tetrahedra keep their shape as they are divided, and how many kinds of them there are.

*worst*: mean-ratio quality of the worst of all descendants, level by level, for the two halves of a view pyramid of 16
by 9. *share*: the same for the pieces of views' roots, over the quality that each piece began with; *under_80* counts
pieces that fall under .8. Of tetrahedra that differ by a turn, a move and their size only one is divided further, so
that eight levels, sixteen million tetrahedra, are looked at whole where there are few *shapes*, and by a sample
otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tetflora_addon.camera import camera
from tetflora_addon.tetrahedra import geometry, roots, subdivision

from .report import Targets

LEVELS, GENERATIONS = 8, 30
#: Shapes that are followed from level to level.
MOST, QUICK_MOST = 100_000, 10_000
#: Views whose roots are divided.
VIEWS, QUICK_VIEWS = 12, 3

TARGETS: Targets = {
    "pyramid_shape_worst": {"min": 0.746},
    "pyramid_eight_worst": {"min": 0.746},
    "pyramid_bisection_worst": {"min": 0.337},
    "pieces_shape_share": {"min": 0.8},
    "inverted": {"max": 0},
}
QUICK_TARGETS: Targets = TARGETS

Divide = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def run(quick: bool) -> dict[str, float]:
    """Divide by each way; no targets for time."""

    def along(choose: Callable[[NDArray[np.float64]], NDArray[np.intp]]) -> Divide:
        return lambda v: subdivision.divide_in_eight(v, choose(squared_diagonals(v), axis=1))[1]

    ways: dict[str, tuple[Divide, int]] = {
        "shape": (lambda v: subdivision.divide_by_shape(v)[1], LEVELS),
        "eight": (lambda v: subdivision.divide_in_eight(v)[1], LEVELS),
        "shortest": (along(np.argmin), LEVELS),
        "longest": (along(np.argmax), LEVELS),
        "bisection": (lambda v: subdivision.bisect(v)[1], GENERATIONS),
    }
    most = QUICK_MOST if quick else MOST
    pyramid, pieces = halves(), around_views(QUICK_VIEWS if quick else VIEWS)
    figures: dict[str, float] = {"pieces": len(pieces), "inverted": 0}
    for name, (divide, levels) in ways.items():
        worst, shapes, inverted = descend(pyramid, divide, levels, most)
        figures["inverted"] += inverted
        figures[f"pyramid_{name}_worst"] = worst.min()
        figures[f"pyramid_{name}_shapes"] = shapes
        for level in (0, 1, 2, 4, 8) if levels == LEVELS else (0, 3, 6, 12, 24, 30):
            figures[f"pyramid_{name}_{level}"] = worst[level].min()
    for name in ("shape", "eight", "shortest", "bisection"):
        divide, levels = ways[name]
        worst, _, inverted = descend(pieces, divide, levels if levels == LEVELS else 3 * LEVELS, most)
        figures["inverted"] += inverted
        share = (worst / worst[0]).min(axis=0)
        figures[f"pieces_{name}_share"] = share.min()
        figures[f"pieces_{name}_under_80"] = int((share < 0.8).sum())
    return figures


def squared_diagonals(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared lengths ``(n, 3)`` of the three diagonals of the inner octahedron of tetrahedra ``(n, 4, 3)``, m².

    Diagonal ``k`` joins the middles of edges ``k`` and ``5 - k`` of the tetrahedron: four times its square is the sum
    of the other four edges' squares less the sum of these two.
    """
    squared = geometry.squared_edges(vertices)
    return (np.sum(squared, axis=1, keepdims=True) - 2.0 * (squared[:, :3] + squared[:, :2:-1])) / 4.0


def halves() -> NDArray[np.float64]:
    """Two halves (2, 4, 3) of a view pyramid."""
    far = [(-0.5, -0.28, 1.0), (0.5, -0.28, 1.0), (0.5, 0.28, 1.0), (-0.5, 0.28, 1.0)]
    eye = (0.0, 0.0, 0.0)
    return np.array([(eye, far[1], far[0], far[2]), (eye, far[2], far[0], far[3])])[:, [1, 0, 2, 3]]


def around_views(number: int) -> NDArray[np.float64]:
    """Pieces (n, 4, 3) of the roots of views at random places, half of them orthographic."""
    rng = np.random.default_rng(0)
    found = []
    for view in range(number):
        kind, scale = (("PERSP", 1.0), ("ORTHO", 20.0))[view % 2]
        frame, upper = np.linalg.qr(rng.normal(size=(3, 3)))
        frame *= np.sign(np.diag(upper))
        frame[:, 0] *= np.linalg.det(frame)
        window = tuple(np.array((-0.5, 0.5, -0.28, 0.28)) * scale)
        far = float(rng.choice([25.0, 1000.0]))
        eye = camera.Camera(kind, rng.uniform(-30, 30, 3), frame, window, 0.1, far, 640, 360)
        corner = rng.uniform(-60, 40, 3)
        tree: Any = roots.view_root(eye, np.array([corner, corner + rng.uniform(5, 60, 3)]))
        found.append(tree.vertices(tree.terminals()))
    return np.concatenate(found)


def descend(
    vertices: NDArray[np.float64], divide: Divide, levels: int, most: int
) -> tuple[NDArray[np.float64], int, int]:
    """Worst quality (levels + 1, n) of the descendants of each, most shapes at a level, and how many were inverted."""
    rng = np.random.default_rng(0)
    root, shapes, inverted = np.arange(len(vertices)), 0, 0
    worst = [geometry.quality(vertices)]
    for _ in range(levels):
        children = divide(vertices)
        root = np.repeat(root, children.shape[1])
        # Children are kept at the size of their parents, so that coordinates do not vanish.
        vertices = children.reshape(-1, 4, 3) * np.cbrt(children.shape[1])
        inverted += int((geometry.signed_volume(vertices) <= 0).sum())
        worst.append(np.full(len(worst[0]), np.inf))
        np.minimum.at(worst[-1], root, geometry.quality(vertices))
        vertices = vertices - vertices[:, :1]
        alike = np.round(np.log(geometry.squared_edges(vertices)) * 1e6)
        kept = np.unique(np.column_stack([alike, root]), axis=0, return_index=True)[1]
        shapes = max(shapes, len(kept))
        kept = rng.permutation(kept)[:most]
        vertices, root = vertices[kept], root[kept]
    return np.array(worst), shapes, inverted
