# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shells: proxies as closed tetrahedra with the attributes that a shader needs to show the cloud inside (paper, 7)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..buffers import MeshBuffers
from ..compiled.flora import Flora
from ..growth.hashing import place_keys, uniform
from ..light.illumination import BakedLight
from ..light.receivers import MediumCells
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..tetrahedra.geometry import EDGES, FACES, squared_edges, volume

#: Fraction of its size by which a shell is smaller than its tetrahedron, minimum and maximum.
GAP, MOST_GAP = 1e-3, 0.05
# Minimum distance of faces, in steps between neighboring numbers of single precision.
_STEPS = 8.0
# As a mesh stores them, with the edge from each corner to the next, in the order of faces.
_FACES, _EDGES = FACES.astype(np.int32), EDGES.astype(np.int32)
_FACE_EDGES = np.array([[3, 5, 4], [2, 5, 1], [0, 4, 2], [1, 3, 0]], dtype=np.int32)
_BARYCENTRIC = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32)

# Six times the volume over the cube of the longest edge: below this a cell is flat within the precision of doubles.
_FLAT = 1e-13


def _shell_buffers(cells: MediumCells, rank: NDArray | None = None, light: Floats | None = None) -> MeshBuffers:
    """One mesh of all proxy tetrahedra, with the attributes of the shell material (paper, section 7).

    Names and units of the attributes are in ``docs/architecture.md``. Each cell has vertices of its own: barycentric
    coordinates differ from cell to cell at a shared corner. Flat cells get no extinction. By a rank (n,) front to back
    they are written back to front: EEVEE blends the faces of a mesh in their order. Light (n, 4, 3) is the radiance
    that contents scatter toward the camera at corners, albedo and phase included, W/(m² sr), for baked light.
    """
    order = np.arange(len(cells)) if rank is None else np.argsort(rank, kind='stable')[::-1]
    cells = cells.take(order)
    longest = np.sqrt(squared_edges(cells.vertices).max(axis=1, initial=0.0))
    flat = 6.0 * volume(cells.vertices) <= _FLAT * longest**3
    cells = replace(cells, matrices=np.where(flat[:, None], 0.0, cells.matrices))
    gradients = np.where(flat[:, None, None], 0.0, cells.gradients)
    of_cells = {
        "tf_color": cells.color,
        "tf_transmission": cells.transmission,
        "tf_kappa": cells.mean_extinction,
        "tf_s0": cells.matrices[:, :3],
        "tf_s1": cells.matrices[:, 3:],
        "tf_normal": cells.normal,
        "tf_plane": cells.plane,
        # The same wherever the same cell comes up again, with its corners in any order.
        "tf_random": uniform(place_keys(cells.vertices.reshape(-1, 3)).reshape(-1, 4).sum(axis=1), 0),
        **dict(zip(("tf_g1", "tf_g2", "tf_g3"), gradients[:, 1:].swapaxes(0, 1), strict=True)),
    }
    if light is not None:
        of_cells |= {f"tf_light{k}": light[order, k] for k in range(4)}
    faces = {name: ("FACE", np.repeat(values.astype(np.float32), 4, axis=0)) for name, values in of_cells.items()}
    first = np.arange(len(cells), dtype=np.int32)[:, None, None]
    return MeshBuffers(
        positions=cells.vertices.reshape(-1, 3).astype(np.float32),
        edge_verts=(_EDGES + 4 * first).reshape(-1, 2),
        corner_verts=(_FACES + 4 * first).ravel(),
        corner_edges=(_FACE_EDGES + 6 * first).ravel(),
        face_offsets=np.arange(0, 12 * len(cells) + 1, 3, dtype=np.int32),
        attributes={"tf_bary": ("POINT", np.tile(_BARYCENTRIC, (len(cells), 1))), **faces},
    )


def proxy_shells(flora: Flora, result: Refinement, light: BakedLight | None = None) -> MeshBuffers | None:
    """Proxies as shells: the tetrahedra themselves, filled with a cloud of their extinction, color and orientation.

    They are written back to front, as EEVEE blends them. Tetrahedra with nothing but large polygons have an extinction
    of 0. With ``light`` shells carry the radiance of their contents, for the material of baked light.
    """
    proxies = np.flatnonzero(np.isin(result.decision, (Decision.PROXY, Decision.HIDDEN)))
    if not len(proxies):
        return None
    cells = set_apart(MediumCells.of(flora, result, result.nodes[proxies]))
    radiance = None if light is None else light.illumination.cell_sources(light.camera)[proxies]
    return _shell_buffers(cells, result.rank[proxies], radiance)


def set_apart(cells: MediumCells) -> MediumCells:
    """Cells a little smaller, whose S are so much larger that they are as dark as before.

    Of faces at the same distance Cycles meets only one: where a ray leaves one shell and enters the next through a
    common face, the second would be lost, and with it a good part of a crown.
    """
    vertices = cells.vertices
    middle = vertices.mean(axis=1, keepdims=True)
    away = vertices - middle
    inwards = np.maximum(np.abs(away).max(axis=(1, 2)) / 8.0, 1e-300)  # a slender one is about so thick
    step = np.abs(vertices).max(axis=(1, 2), initial=0.0) * np.finfo(np.float32).eps
    part = 1.0 - np.clip(_STEPS * step / inwards, GAP, MOST_GAP)
    return replace(cells, vertices=middle + away * part[:, None, None], matrices=cells.matrices / (part**2)[:, None])
