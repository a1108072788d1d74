# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A light studio for images of single plants."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from devtools import session

from . import stage
from .paper.scenes import rendered

#: Degrees by which the camera looks down, and by which plants stand to its side of the sun.
_PITCH, _SUN = 9.0, -40.0
_FLOOR = (0.55, 0.57, 0.58)


def add_studio(points: np.ndarray, aspect: float) -> None:
    """Floor, sun, sky and a camera that frames points (n, 3).

    Parameters
    ----------
    points : (n, 3) float
        Of the plant that stands at the origin, meters.
    aspect : float
        Width of the image over its height.
    """
    scene = bpy.context.scene
    # A few twigs that reach far out must not make the rest small.
    low, high = np.quantile(points, 0.002, axis=0), np.quantile(points, 0.998, axis=0)
    low[2] = 0.0  # tips of blades that bend down that far are below the ground, as in a meadow
    pitch = math.radians(_PITCH)
    across = 2 * max(abs(low[0]), abs(high[0])) * 1.08
    depth = max(abs(low[1]), abs(high[1])) * math.sin(pitch)
    top, bottom = high[2] * math.cos(pitch) + depth, low[2] * math.cos(pitch) - depth
    height = max((top - bottom) / 0.94, across / aspect)
    middle = (top + bottom) / 2
    floor = bpy.data.meshes.new("Floor")
    side = 400 * height
    corners = [(-side, -side, 0), (side, -side, 0), (side, side, 0), (-side, side, 0)]
    floor.from_pydata([(x, y, z + low[2]) for x, y, z in corners], [], [(0, 1, 2, 3)])
    floor.materials.append(stage.dull("Floor", _FLOOR))
    scene.collection.objects.link(bpy.data.objects.new("Floor", floor))
    up = Vector((0.0, math.sin(pitch), math.cos(pitch)))
    forward = Vector((0.0, math.cos(pitch), -math.sin(pitch)))
    eye = middle * up - 20.0 * height * forward
    stage.camera(scene, eye, eye + forward, far=1000.0 * height, across=height * max(aspect, 1.0))
    stage.sun(scene, 48.0, 180.0 - _SUN)
    # The light of a clouded sky around the sun: colored shadows would color the plants.
    stage.even_sky(scene, (0.9, 0.95, 1.0), 0.7)


def render_cells(
    cells: Sequence[Callable[[], tuple[np.ndarray, str]]], folder: Path, size: tuple[int, int], samples: int
) -> list[tuple[Path, str]]:
    """Render images of single plants, and return them with their titles.

    Parameters
    ----------
    cells : sequence of callable
        Each puts one plant at the origin of an empty scene and returns its points (n, 3) and a title.
    folder : Path
    size : (int, int)
        Width and height of each image, pixels.
    samples : int
    """
    made = []
    for number, cell in enumerate(cells):
        session.clean_file()
        scene = bpy.context.scene
        points, title = cell()
        add_studio(points, size[0] / size[1])
        stage.film(scene)
        scene.tetflora.refine_at_render = False
        scene.render.resolution_x, scene.render.resolution_y = size
        made.append((folder / f"{number}.png", title))
        rendered(scene, made[-1][0], samples)
    return made
