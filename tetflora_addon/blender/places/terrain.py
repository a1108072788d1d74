# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground from a raster of elevations: a smooth mesh with UV and soil."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import SceneError
from ...jobs import Progress
from ...places.rasters import Raster
from ...planting.height_grid import HeightGrid, cell_for, height_grid
from ..attributes import write
from ..materials.soil import soil_material
from ..placing.terrain import read_ground
from ..runtime import JobData, guarded
from ..worker import call_in_thread
from .origin import in_scene, origin_for, remember
from .rasters import read_raster

#: On objects that are imported ground.
TERRAIN = "tetflora_terrain"
#: Colors of soil and of what grows on it, linear RGB, and the fraction that is green.
_SOIL, _GREEN, _COVERED = (0.06, 0.043, 0.028), (0.05, 0.075, 0.018), 0.8
_FINEST, _MOST_CELLS = 0.5, 4_000_000  # of the grid that heights are read from: metres


@dataclass(frozen=True)
class ImportedGround:
    """What importing made.

    Attributes
    ----------
    object : bpy.types.Object
    step : float
        Distance of its vertices, metres.
    coarser : bool
        Whether that is more than in the file.
    """

    object: bpy.types.Object
    step: float
    coarser: bool


def terrain_steps(
    scene: bpy.types.Scene, path: Path, most: int, code: int, factor: float, shift: float, new: bool
) -> Generator[Progress, Any, ImportedGround]:
    """Make ground; yields progress. Closing the steps leaves all as it was.

    Parameters
    ----------
    most : int
        Faces.
    code, factor, shift
        As of `read_raster`.
    new : bool
        Let its middle be the scene's origin, whatever was imported before.

    Raises
    ------
    SceneError
        The file is broken, or cannot lie in this scene.
    """
    return guarded(JobData("Importing", scene), _steps(scene, path, most, code, factor, shift, new))


def _steps(
    scene: bpy.types.Scene, path: Path, most: int, code: int, factor: float, shift: float, new: bool
) -> Generator[Progress, Any, ImportedGround]:
    raster = yield from read_raster(path, code, factor, shift)
    what = f"{path.name}: "
    place = origin_for(scene, raster.system, raster.outline, new, what)
    coarse = yield from call_in_thread(Progress(0.7, "Making the ground"), raster.coarser, most)
    h, w = coarse.values.shape
    column, row = np.tile(np.arange(w), h), np.repeat(np.arange(h), w)
    flat = in_scene(place, coarse.places(column, row), coarse.system, what)
    points = np.column_stack([flat, coarse.values.ravel()])
    yield Progress(0.8, "Making the ground")
    faces = _faces(coarse)
    if not len(faces):
        raise SceneError(f"{what}no four neighboring cells have values")
    used = np.unique(faces)
    number = np.zeros(h * w, np.int64)
    number[used] = np.arange(len(used))
    uv = np.column_stack([column / (w - 1), 1.0 - row / (h - 1)])[used]
    made = _mesh(path.stem, points[used], number[faces], uv)
    scene.collection.objects.link(made)
    remember(scene, place)
    step = float(np.linalg.norm(points[faces[:, 0], :2] - points[faces[:, 1], :2], axis=1).mean())
    return ImportedGround(made, step, coarse is not raster)


def _faces(raster: Raster) -> NDArray[np.int64]:
    """Cells at the corners of quads, (f, 4), counter-clockwise from above, between cells that have values."""
    known = np.isfinite(raster.values)
    whole = known[:-1, :-1] & known[1:, :-1] & known[1:, 1:] & known[:-1, 1:]
    w = raster.values.shape[1]
    first = (np.arange(whole.shape[0])[:, None] * w + np.arange(w - 1))[whole]
    quads = np.stack([first, first + w, first + w + 1, first + 1], axis=1)
    down_then_along = raster.down[0] * raster.along[1] - raster.down[1] * raster.along[0]
    return quads if down_then_along > 0.0 else quads[:, ::-1]


def _mesh(name: str, points: NDArray, faces: NDArray, uv: NDArray) -> bpy.types.Object:
    middle = np.round((points.min(axis=0) + points.max(axis=0)) / 2.0)
    middle[2] = 0.0
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(points))
    mesh.loops.add(faces.size)
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 4, dtype=np.int32))
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(faces.ravel(), np.int32))
    write(mesh, "position", points - middle)
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    layer = mesh.uv_layers.new(name="UVMap")
    write(mesh, layer.name, uv[faces.ravel()])
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    shape = (2, 2)
    colours, green = np.broadcast_to(_SOIL, (*shape, 3)), np.full(shape, _COVERED)
    mesh.materials.append(soil_material(f"{name} soil", colours, green, np.array(_GREEN), low, high - low))
    made = bpy.data.objects.new(name, mesh)
    made.location = middle
    made[TERRAIN] = True
    made.tetflora.is_occluder = True
    return made


def grounds_in(scene: bpy.types.Scene, selected: list[bpy.types.Object]) -> list[bpy.types.Object]:
    """Meshes to put things on: those that are selected, else what was imported as ground."""
    return selected or [obj for obj in scene.objects if obj.type == 'MESH' and obj.get(TERRAIN)]


def heights_steps(
    objects: list[bpy.types.Object], depsgraph: bpy.types.Depsgraph, progress: Progress
) -> Generator[Progress, Any, HeightGrid | None]:
    """Heights of some ground; None where there is none."""
    if not objects:
        return None
    triangles = read_ground(objects, depsgraph).triangles
    cell = cell_for(triangles, _FINEST, _MOST_CELLS)
    return (yield from call_in_thread(progress, height_grid, triangles, cell))
