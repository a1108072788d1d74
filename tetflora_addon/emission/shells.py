# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shells: proxies as closed tetrahedra with the attributes that a shader needs to show the cloud inside (paper, 7)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import GOLDEN_TURN, Arrays, Floats, Mask, spiral, unit
from ..buffers import MeshBuffers
from ..compiled.flora import Flora
from ..growth.hashing import mix, uniform
from ..light.illumination import BakedLight
from ..parallel import blocks
from ..proxies.summaries import extinction_matrices, summarize
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..tetrahedra.geometry import EDGES, FACES, volume

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
# Directions of the mean over the sphere, and cells at a time, to bound memory.
_DIRECTIONS = 64
_CHUNK = 65_536


def directional_mean(S: Floats) -> Floats:
    """Mean (n,) over all directions of κ(ω) = √(ωᵀSω), 1/m, with S (n, 6) as of `Cells`.

    Within 1.3 % of the integral, which single orientations reach: a mean over points of a Fibonacci lattice on the half
    sphere; κ(ω) = κ(−ω). The form of κ is that of Heitz, Dupuy, Crassin and Dachsbacher, "The SGGX Microflake
    Distribution", 2015.
    """
    index = np.arange(_DIRECTIONS) + 0.5
    x, y, z = spiral(index / _DIRECTIONS, index, GOLDEN_TURN).T
    basis = np.stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z])
    result = np.zeros(len(S))
    for part in blocks(len(S), _CHUNK):
        result[part] = np.sqrt(np.maximum(S[part] @ basis, 0.0)).mean(axis=1)
    return result


def cell_gradients(vertices: Floats) -> tuple[Floats, Mask]:
    """Gradients (n, 3, 3) of the barycentric coordinates of vertices 1 to 3, and cells (n,) without volume.

    In 1/m; zero for flat cells. Only differences of vertices (n, 4, 3) are used: the distance from the origin costs no
    precision.
    """
    a, b, c = (vertices[:, k] - vertices[:, 0] for k in (1, 2, 3))
    normals = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    determinant = np.einsum("ij,ij->i", a, normals[:, 0])
    edges = np.stack([a, b, c, b - a, c - a, c - b], axis=1)
    longest = np.sqrt(np.einsum("ijk,ijk->ij", edges, edges).max(axis=1, initial=0.0))
    flat = np.abs(determinant) <= _FLAT * longest**3
    gradients = normals / np.where(flat, 1.0, determinant)[:, None, None]
    gradients[flat] = 0.0
    return gradients, flat


def _cell_noise(corners: Floats) -> Floats:
    """Random number (n,) in [0, 1) of each cell (n, 4, 3): the same wherever the same cell comes up again."""
    # Corners as Blender stores them, without the last bits of doubles; a sum does not depend on their order.
    places = np.ascontiguousarray(corners, dtype=np.float32) + np.float32(0.0)  # no negative zeros
    bits = places.view(np.uint32).astype(np.uint64)
    key = mix(bits[..., 0])
    for axis in (1, 2):
        key = mix(key ^ bits[..., axis])
    return uniform(key.sum(axis=1, dtype=np.uint64), 0)


@dataclass(frozen=True)
class Cells(Arrays):
    """Proxy tetrahedra (n), and what the cloud inside each is like."""

    vertices: Floats  # (n, 4, 3): corners in either orientation, meters, world space
    color: Floats  # (n, 3): mean color of the contents, linear
    transmission: Floats  # (n,): fraction of the scattered light that passes through the sheets, 0 to 1
    S: Floats  # (n, 6): (Sxx, Syy, Szz, Sxy, Sxz, Syz) with κ(ω) = √(ωᵀSω), 1/m²
    normal: Floats  # (n, 3): axis of the largest eigenvalue of the contents' moment, of any length and sign
    plane: Floats  # (n,): weight of the plane term against the particle term, 0 to 1
    #: (n, 4, 3): radiance that the contents scatter toward the camera at each corner, albedo and phase included,
    #: W/(m² sr); becomes ``tf_light0`` to ``tf_light3`` for the material of baked light.
    light: Floats | None = None


def shell_buffers(cells: Cells, rank: NDArray | None = None) -> MeshBuffers:
    """One mesh of all proxy tetrahedra, with the attributes of the shell material (paper, section 7).

    Names and units of the attributes are in ``docs/architecture.md``. Each cell has vertices of its own: barycentric
    coordinates differ from cell to cell at a shared corner.

    Parameters
    ----------
    cells : Cells of n
    rank : (n,) number, optional
        Place of each cell front to back as the camera sees them, in any unit. Cells are then written back to front:
        EEVEE blends the faces of a mesh in their order. Without it cells keep theirs.

    Returns
    -------
    MeshBuffers
        Four triangles, four vertices and six edges a cell, facing outwards. Flat cells get no extinction, because
        their thickness has no meaning.
    """
    if rank is not None:
        cells = cells.take(np.argsort(rank, kind='stable')[::-1])
    corners, count = np.asarray(cells.vertices, np.float64), len(cells)
    spans = corners[:, 1:] - corners[:, :1]
    inverted = np.einsum("ij,ij->i", spans[:, 0], np.cross(spans[:, 1], spans[:, 2])) < 0.0

    def outwards(of_corners: Floats) -> Floats:
        return np.where(inverted[:, None, None], of_corners[:, [0, 2, 1, 3]], of_corners)

    random, corners = _cell_noise(corners), outwards(corners)
    gradients, flat = cell_gradients(corners)
    matrices = np.where(flat[:, None], 0.0, cells.S)
    of_cells = {
        "color": cells.color,
        "transmission": cells.transmission,
        "kappa": directional_mean(matrices),
        "s0": matrices[:, :3],
        "s1": matrices[:, 3:],
        "normal": unit(cells.normal),
        "plane": cells.plane,
        "random": random,
        **{f"g{k + 1}": gradients[:, k] for k in range(3)},
    }
    if cells.light is not None:
        of_cells |= {f"light{k}": outwards(cells.light)[:, k] for k in range(4)}
    faces = {f"tf_{k}": ("FACE", np.repeat(own.astype(np.float32), 4, axis=0)) for k, own in of_cells.items()}
    first = np.arange(count, dtype=np.int32)[:, None, None]
    return MeshBuffers(
        positions=corners.reshape(-1, 3).astype(np.float32),
        edge_verts=(_EDGES + 4 * first).reshape(-1, 2),
        corner_verts=(_FACES + 4 * first).ravel(),
        corner_edges=(_FACE_EDGES + 6 * first).ravel(),
        face_offsets=np.arange(0, 12 * count + 1, 3, dtype=np.int32),
        attributes={"tf_bary": ("POINT", np.tile(_BARYCENTRIC, (count, 1))), **faces},
    )


def proxy_shells(flora: Flora, result: Refinement, light: BakedLight | None = None) -> MeshBuffers | None:
    """Proxies as shells: the tetrahedra themselves, filled with a cloud of their extinction, color and orientation.

    They are written back to front, as EEVEE blends them. Tetrahedra with nothing but large polygons have an extinction
    of 0. With ``light`` shells carry the radiance of their contents, for the material of baked light.
    """
    proxies = np.isin(result.decision, (Decision.PROXY, Decision.HIDDEN))
    nodes = result.nodes[proxies]
    if len(nodes) == 0:
        return None
    index = np.full(len(result.tree), -1, dtype=np.int64)
    index[nodes] = np.arange(len(nodes))
    contents = result.contents
    # Large polygons are drawn as they are; a fog in their place would be no wall.
    fine = np.isfinite(contents.polygons.totals.width)
    if not fine.all():
        contents = replace(contents, polygons=contents.polygons.take(fine))
    assets = result.assets.placed, result.assets.held(len(result.tree))
    summaries = summarize(flora, contents, index, len(nodes), assets)
    vertices = result.tree.vertices(nodes)
    matrices, *resembled = extinction_matrices(summaries, volume(vertices))
    vertices, matrices = set_apart(vertices, matrices)
    baked = None if light is None else light.of_shells()[proxies]
    cells = Cells(vertices, summaries.color, summaries.transmission, matrices, *resembled, baked)
    return shell_buffers(cells, result.rank[proxies])


def set_apart(vertices: Floats, matrices: Floats) -> tuple[Floats, Floats]:
    """Tetrahedra (n, 4, 3) a little smaller, and their S (n, 6) so much larger that they are as dark as before.

    Of faces at the same distance Cycles meets only one: where a ray leaves one shell and enters the next through a
    common face, the second would be lost, and with it a good part of a crown.
    """
    middle = vertices.mean(axis=1, keepdims=True)
    away = vertices - middle
    inwards = np.maximum(np.abs(away).max(axis=(1, 2)) / 8.0, 1e-300)  # a slender one is about so thick
    step = np.abs(vertices).max(axis=(1, 2), initial=0.0) * np.finfo(np.float32).eps
    fraction = np.clip(_STEPS * step / inwards, GAP, MOST_GAP)
    return middle + away * (1.0 - fraction)[:, None, None], matrices / ((1.0 - fraction) ** 2)[:, None]
