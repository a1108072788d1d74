# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Colors of leaves for materials that let no light through, and whose two sides are alike.

Formats have no material of thin sheets that all readers know. So what passes through leaves, and that their undersides
are paler, goes into their color: the one with which they are as bright, on average over views from beside, in the light
of sun and sky. Which sides are lit and seen is counted in views of the plant, with its own shadows. Light that leaves
send on to each other is scattered again (see `optics`): what passes through counts there too, seen or not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Floats, spiral
from ..buffers import MeshBuffers
from ..optics import PALER, THROUGH_TINT
from .gltf import face_normals
from .levels import Grid, PlantLevel

#: Heights of light, each in how many directions; the irradiance of level ground from above or below, as much from the
#: sun at 45 degrees as from the sky, and what the ground reflects, a fifth; and the part that shadows let through. Of
#: the sky they let none through where paths are traced, all in EEVEE, where leaves are brighter for it: colors are in
#: between, as far off in one as in the other.
_PASSING = 0.375
_LIGHT = (
    (np.full(8, np.sqrt(0.5)), 1.0, 0.0),
    ((np.arange(12) + 0.5) / 12, 1.0, _PASSING),
    ((np.arange(6) + 0.5) / -6, 0.4, _PASSING),
)
#: Directions to look from, all around: those of light turn by another angle, or they would lie along these.
_VIEWS = spiral(np.full(4, 0.2), np.arange(4), np.pi / 2.0)
#: Cells along a plant, and in how many of these its leaves do not shade themselves.
_CELLS, _SLACK = 384, 1.5
#: Faces of the level that is looked at: it covers what the full plant does.
_MOST = 40_000
#: By the kind of parts (4,): how much is seen of light that falls on upper sides, and on undersides, together 1; beside
#: these of light from the other side of the faces that are seen; and the part of all light that the plant shades, from
#: where it sends light instead.
Sides = Mapping[str, Floats]
#: As much of light is seen from where it falls on an upper side, and on an underside, as comes through.
_EVEN = np.array([0.5, 0.5, 1.0, 0.0])


def opaque(levels: Sequence[PlantLevel], sides: Sides) -> tuple[PlantLevel, ...]:
    """Levels of a plant in such colors, by the sides that plants of its kind show."""
    return tuple(
        replace(level, parts=tuple((kind, _recolored(mesh, sides.get(kind, _EVEN))) for kind, mesh in level.parts))
        for level in levels
    )


def sides_of(levels: Sequence[PlantLevel]) -> Sides:
    """Which sides of leaves a plant shows."""
    level = next((level for level in levels if level.polygons <= _MOST), levels[-1])
    return dict(zip([kind for kind, _ in level.parts], _sides([mesh for _, mesh in level.parts]), strict=True))


def _recolored(mesh: MeshBuffers, sides: Floats) -> MeshBuffers:
    upper, under, through, shaded = sides
    passed = mesh.attributes["tf_transmission"][1][:, None]
    reflected = (1.0 - passed) * (1.0 - (passed > 0.0) * np.array(PALER) * (upper - under))
    color = mesh.attributes["tf_color"][1]
    seen = color * (reflected + passed * THROUGH_TINT * through)
    every = color * (1.0 - passed + passed * THROUGH_TINT)
    # Of the albedo c, what is scattered ever again adds up to c / (1 - p c), and seen / (1 - p every) it should be.
    color = seen / (1.0 - shaded * (every - seen))
    color = np.clip(color, 0.0, 1.0).astype(np.float32)
    return replace(mesh, attributes={**mesh.attributes, "tf_color": ("FACE", color)})


def _sides(meshes: Sequence[MeshBuffers]) -> Floats:
    """As `Sides`, (n, 4), for meshes (n) of a plant."""
    points, normal = (np.concatenate(of) for of in ([m.positions for m in meshes], [face_normals(m) for m in meshes]))
    part = np.repeat(np.arange(len(meshes)), [mesh.polygons for mesh in meshes])
    cell = float(np.ptp(points, axis=0).max()) / _CELLS
    # Of each, the irradiance of what faces it, and what of it shadows let through.
    lamps = [
        (Grid.around(toward, cell, points, cell), level / np.abs(z).sum(), passing)
        for z, level, passing in _LIGHT
        for toward in spiral(z, np.arange(len(z)))
    ]
    shadows = [lamp.nearest(meshes)[0] for lamp, *_ in lamps]
    lit, every = np.zeros((3, len(meshes))), np.zeros(len(meshes))
    flat = lit.reshape(-1)  # in which numpy adds up in a fifth of the time
    for grid in (Grid.around(toward, cell, points, cell) for toward in _VIEWS):
        depth, face = grid.nearest(meshes)
        face, place = face[depth > -np.inf], grid.places(depth)
        front = normal[face] @ grid.toward > 0.0
        for (lamp, bright, passing), shadow in zip(lamps, shadows, strict=True):
            falls = normal[face] @ lamp.toward
            light = bright * np.abs(falls)
            seen = light * np.where(lamp.reaches(place, shadow, _SLACK * cell), 1.0, passing)
            np.add.at(flat, np.where(front == (falls > 0.0), np.where(front, 0, 1), 2) * len(meshes) + part[face], seen)
            np.add.at(every, part[face], light)
    shaded = 1.0 - lit.sum(axis=0) / np.maximum(every, 1e-30)
    return np.column_stack([*(lit / np.maximum(lit[:2].sum(axis=0), 1e-30)), shaded])
