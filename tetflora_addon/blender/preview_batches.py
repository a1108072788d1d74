# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From arrays to what the graphics card draws: edges and translucent triangles of tetrahedra, plants, a view's pyramid.

Only called while a viewport is drawn; nothing here decides what is shown.
"""

from __future__ import annotations

import gpu
import numpy as np
from numpy.typing import NDArray

from ..preview.colours import as_shown, colours_of
from ..preview.levels import Level, Levels
from ..preview.light_plants import Shapes
from ..preview.projected import THICK, drawable, project
from ..refinement.camera import Camera
from ..refinement.decisions import Decision
from ..tetrahedra.geometry import EDGES

#: Tetrahedra whose edges are drawn; of more, those that change most pixels.
MOST_WIRES = 60_000
_WIRE_ALPHA = 0.7
#: Opacity under which a translucent tetrahedron is left out: less than a screen tells apart.
_FAINT = 0.004


def batch(kind: str, positions: NDArray, colours: NDArray, indices: NDArray) -> gpu.types.GPUBatch:
    """A batch of 'LINES' or 'TRIS' with a colour (v, 4) for each corner (v, 3)."""
    layout = gpu.types.GPUVertFormat()
    layout.attr_add(id="pos", comp_type='F32', len=3, fetch_mode='FLOAT')
    layout.attr_add(id="color", comp_type='F32', len=4, fetch_mode='FLOAT')
    corners = gpu.types.GPUVertBuf(layout, len(positions))
    corners.attr_fill("pos", np.ascontiguousarray(positions, np.float32))
    corners.attr_fill("color", np.ascontiguousarray(colours, np.float32))
    elements = gpu.types.GPUIndexBuf(type=kind, seq=np.ascontiguousarray(indices, np.int32))
    return gpu.types.GPUBatch(type=kind, buf=corners, elem=elements)


def chosen_by_worth(level: Level, forms: set[str], most: int) -> NDArray[np.intp]:
    """Places (k,) in a level of tetrahedra of some forms, at most so many, those that change most pixels first."""
    wanted = np.flatnonzero(np.isin(level.decision, [Decision[name] for name in forms]))
    if len(wanted) <= most:
        return wanted
    return wanted[np.argsort(-level.contribution[wanted], kind="stable")[:most]]


def wires(levels: Levels, level: Level, colour: str, forms: set[str]) -> gpu.types.GPUBatch | None:
    """Edges of a level's tetrahedra; None where there are none."""
    some = chosen_by_worth(level, forms, MOST_WIRES)
    if len(some) == 0:
        return None
    vertices = levels.vertices(level, some)
    shown = colours_of(level, colour, int(levels.levels[-1].depth.max()))[some]
    indices = EDGES[None] + 4 * np.arange(len(some))[:, None, None]
    return batch(
        'LINES', vertices.reshape(-1, 3), np.repeat(_opaque(shown, _WIRE_ALPHA), 4, axis=0), indices.reshape(-1, 2)
    )


def translucent(
    levels: Levels, level: Level, forms: set[str], camera: Camera, most: int
) -> tuple[gpu.types.GPUBatch | None, int]:
    """Projected tetrahedra of a level as a camera sees them, farthest first, and how many they are."""
    some = chosen_by_worth(level, forms, most)
    some = some[drawable(levels.vertices(level, some), camera)]
    if len(some) == 0:
        return None, 0
    some = levels.back_to_front(level, camera, some)
    projected = project(levels.vertices(level, some).astype(np.float64), level.extinction[some], camera)
    colours = np.zeros((len(some), 5, 4), np.float32)
    colours[:, :, :3] = as_shown(level.colour[some])[:, None]
    colours[:, THICK, 3] = projected.opacity
    triangles = projected.triangles[projected.opacity[projected.triangles[:, 0] // 5] > _FAINT]
    if len(triangles) == 0:
        return None, 0
    return batch('TRIS', projected.corners.reshape(-1, 3), colours.reshape(-1, 4), triangles), len(some)


def plants(shapes: Shapes) -> gpu.types.GPUBatch | None:
    """All plants; None where there are none."""
    if shapes.plants == 0:
        return None
    kind = 'TRIS' if shapes.indices.shape[1] == 3 else 'LINES'
    return batch(kind, shapes.positions, _opaque(shapes.colours, 1.0), shapes.indices)


def pyramid(camera: Camera, far: float, colour: tuple[float, float, float, float]) -> gpu.types.GPUBatch:
    """Edges of what a camera sees between its near plane and a distance; its place and directions for a panorama."""
    if camera.kind == "PANO":
        axes = np.concatenate([camera.frame.T, -camera.frame.T]) * far / 10.0 + camera.position
        ends = np.concatenate([axes, camera.position[None]])
        return batch('LINES', ends, np.tile(colour, (7, 1)), np.array([(6, i) for i in range(6)]))
    left, right, bottom, top = camera.window
    rim = np.array([(left, bottom), (right, bottom), (right, top), (left, top)])
    parts = []
    for depth in (camera.near, max(far, 2.0 * camera.near)):
        wide = rim * depth if camera.kind == "PERSP" else rim
        local = np.concatenate([wide, np.full((4, 1), -depth)], axis=1)
        parts.append(local @ camera.frame.T + camera.position)
    ring = [(i, (i + 1) % 4) for i in range(4)]
    edges = [*ring, *((a + 4, b + 4) for a, b in ring), *((i, i + 4) for i in range(4))]
    return batch('LINES', np.concatenate(parts), np.tile(colour, (8, 1)), np.array(edges))


def _opaque(colours: NDArray[np.float32], alpha: float) -> NDArray[np.float32]:
    return np.concatenate([colours, np.full((len(colours), 1), alpha, np.float32)], axis=1)
