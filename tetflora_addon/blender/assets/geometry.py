# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An asset as arrays: what `compile` needs of all of its meshes, read from Blender."""

from __future__ import annotations

from collections.abc import Generator

import bpy
import numpy as np
from numpy.typing import NDArray

from ...assets.asset import AssetSource, AssetSurface
from ...errors import SceneError
from ...jobs import mapped
from ..attributes import members, read
from ..materials.face_looks import FaceReader
from .parts import AssetPart, Target, digest_of_parts

#: Triangles whose corners become vertices at once.
_TRIANGLES = 1 << 18


def read_source_steps(
    target: Target, depsgraph: bpy.types.Depsgraph
) -> Generator[float, None, tuple[AssetSource, tuple[str, ...]]]:
    """Read all surfaces of an asset; yields the fraction that is done.

    Parameters
    ----------
    target : Target
    depsgraph : bpy.types.Depsgraph
        Between two steps it may be evaluated again, but must be there.

    Returns
    -------
    AssetSource
    tuple of str
        Warnings for the artist: images that are missing, materials without shaders, and what is left out.

    Raises
    ------
    SceneError
        The asset has no faces, has vertices that are not finite numbers, or instances itself; the message names it.
    """
    parts, left = target.parts(depsgraph)
    reader = FaceReader()
    reader.warn(left)
    digest = digest_of_parts(parts, depsgraph)
    surfaces: list[AssetSurface] = []
    shown: list[AssetPart] = []
    for number, part in enumerate(parts):
        steps = _surface_steps(part, depsgraph, reader)
        surface = yield from mapped(steps, lambda done, before=number: (before + done) / len(parts))
        if surface is not None:
            surfaces.append(surface)
            shown.append(part)
    if not surfaces:
        raise SceneError(
            f'"{target.name}" has no faces, so there is nothing to refine as an asset; add faces, or choose another '
            "object or collection"
        )
    counts = [len(part.matrices) for part in shown]
    source = AssetSource(
        name=target.name,
        surfaces=tuple(surfaces),
        surface=np.repeat(np.arange(len(surfaces)), counts).astype(np.int32),
        matrices=np.concatenate([part.matrices for part in shown]),
        digest=digest,
    )
    if not np.isfinite(source.matrices).all():
        raise SceneError(
            f'"{target.name}" shows instances whose place is not a finite number; correct the nodes or particles that '
            "make them"
        )
    return source, tuple(reader.warnings)


def _surface_steps(
    part: AssetPart, depsgraph: bpy.types.Depsgraph, reader: FaceReader
) -> Generator[float, None, AssetSurface | None]:
    """Read one mesh; None if it has no faces. Between two steps nothing of Blender's meshes is held."""
    with part.opened(depsgraph) as opened:
        if opened is None:
            return None
        mesh, slots = opened
        positions = read(mesh, "position")
        if not np.isfinite(positions).all():
            raise SceneError(f'"{part.name}" has vertices that are not finite numbers; delete them')
        mesh.calc_loop_triangles()
        faces = len(mesh.polygons)
        loops = members(mesh.loop_triangles, "loops", 3, np.int32)
        face = members(mesh.loop_triangle_polygons, "value", dtype=np.int32)
        corner_verts = read(mesh, ".corner_vert")
        looks = reader.prepare(mesh, slots)
    yield 0.0
    found = yield from looks.steps(faces, positions, loops, corner_verts, face)
    return AssetSurface(
        name=part.name,
        positions=positions,
        triangles=_vertices(loops, corner_verts),
        face=face,
        colour=found.colour,
        transmission=found.transmission,
        coverage=found.coverage,
        roughness=found.roughness,
    )


def _vertices(loops: NDArray[np.int32], corner_verts: NDArray[np.int32]) -> NDArray[np.int32]:
    """Vertices of triangles from their corners, in the same array."""
    for start in range(0, len(loops), _TRIANGLES):
        piece = loops[start : start + _TRIANGLES]
        piece[:] = np.take(corner_verts, piece)
    return loops
