# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shells: proxies as closed tetrahedra with the attributes that a shader needs to show the cloud inside (paper, 7)."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import GOLDEN_TURN, Floats, Floats32, Mask, spiral
from ..buffers import MeshBuffers
from ..compiled.flora import Flora
from ..growth.hashing import mix, uniform
from ..light.illumination import BakedLight
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


def directional_mean(S: ArrayLike) -> Floats:
    """Mean (n,) over all directions of κ(ω) = √(ωᵀSω), 1/m, with S (n, 6) as in `shell_buffers`.

    Within 1.3 % of the integral, which single orientations reach: a mean over points of a Fibonacci lattice on the half
    sphere; κ(ω) = κ(−ω). The form of κ is that of Heitz, Dupuy, Crassin and Dachsbacher, "The SGGX Microflake
    Distribution", 2015.
    """
    matrices = np.asarray(S, dtype=np.float64)
    index = np.arange(_DIRECTIONS) + 0.5
    x, y, z = spiral(index / _DIRECTIONS, index, GOLDEN_TURN).T
    basis = np.stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z])
    result = np.zeros(len(matrices))
    for start in range(0, len(matrices), _CHUNK):
        part = slice(start, start + _CHUNK)
        result[part] = np.sqrt(np.maximum(matrices[part] @ basis, 0.0)).mean(axis=1)
    return result


def cell_gradients(vertices: ArrayLike) -> tuple[Floats, Mask]:
    """Gradients (n, 3, 3) of the barycentric coordinates of vertices 1 to 3, and cells (n,) without volume.

    In 1/m; zero for flat cells. Only differences of vertices (n, 4, 3) are used: the distance from the origin costs no
    precision.
    """
    corners = np.asarray(vertices, dtype=np.float64)
    a, b, c = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
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


def shell_buffers(
    vertices: ArrayLike,
    color: ArrayLike,
    transmission: ArrayLike,
    S: ArrayLike,
    normal: ArrayLike,
    plane: ArrayLike,
    *,
    rank: ArrayLike | None = None,
    light: ArrayLike | None = None,
) -> MeshBuffers:
    """One mesh of all proxy tetrahedra, with the attributes of the shell material (paper, section 7).

    Names and units of the attributes are in ``docs/architecture.md``. Each cell has vertices of its own: barycentric
    coordinates differ from cell to cell at a shared corner.

    Parameters
    ----------
    vertices : (n, 4, 3) float
        Corners of the cells in either orientation, meters, world space.
    color : (n, 3) float
        Mean color of the contents, linear.
    transmission : (n,) float
        Fraction of the scattered light that passes through the sheets, 0 to 1.
    S : (n, 6) float
        (Sxx, Syy, Szz, Sxy, Sxz, Syz) with κ(ω) = √(ωᵀSω), 1/m².
    normal : (n, 3) float
        Axis of the largest eigenvalue of the contents' moment; any length and sign.
    plane : (n,) float
        Weight of the plane term against the particle term, 0 to 1.
    rank : (n,) number, optional
        Place of each cell front to back as the camera sees them, in any unit. Cells are then written back to front:
        EEVEE blends the faces of a mesh in their order. Without it cells keep theirs.
    light : (n, 4, 3) float, optional
        Radiance that the contents scatter toward the camera at each corner, albedo and phase included, W/(m² sr);
        becomes ``tf_light0`` to ``tf_light3`` for the material of baked light.

    Returns
    -------
    MeshBuffers
        Four triangles, four vertices and six edges a cell, facing outwards. Flat cells get no extinction, because
        their thickness has no meaning.

    Raises
    ------
    ValueError
        If shapes do not fit together.
    """
    corners = np.asarray(vertices, dtype=np.float64)
    if corners.ndim != 3 or corners.shape[1:] != (4, 3):
        raise ValueError(f"vertices must have shape (n, 4, 3), not {corners.shape}")
    count = len(corners)
    columns = {"color": (3,), "transmission": (), "S": (6,), "normal": (3,), "plane": (), "light": (4, 3), "rank": ()}
    given = dict(zip(columns, (color, transmission, S, normal, plane, light, rank), strict=True))
    values = {name: np.asarray(value, np.float64) for name, value in given.items() if value is not None}
    for name, array in values.items():
        shape = (count, *columns[name])
        if array.shape != shape:
            raise ValueError(f"{name} must have shape {shape} for {count} tetrahedra, not {array.shape}")

    if rank is not None:
        order = np.argsort(values["rank"], kind='stable')[::-1]
        corners = corners[order]
        values = {name: array[order] for name, array in values.items()}
    spans = corners[:, 1:] - corners[:, :1]
    inverted = np.einsum("ij,ij->i", spans[:, 0], np.cross(spans[:, 1], spans[:, 2])) < 0.0
    random = _cell_noise(corners)
    corners = np.where(inverted[:, None, None], corners[:, [0, 2, 1, 3]], corners)
    gradients, flat = cell_gradients(corners)
    matrices = np.where(flat[:, None], 0.0, values["S"])
    axes = values["normal"]
    length = np.sqrt(np.einsum("ij,ij->i", axes, axes))
    axes = np.where(length[:, None] > 0.0, axes / np.where(length > 0.0, length, 1.0)[:, None], (0.0, 0.0, 1.0))

    def per_face(array: NDArray) -> tuple[str, Floats32]:
        return "FACE", np.repeat(array.astype(np.float32), 4, axis=0)

    baked = {}
    if light is not None:
        shown = values["light"]
        shown = np.where(inverted[:, None, None], shown[:, [0, 2, 1, 3]], shown)
        baked = {f"tf_light{k}": per_face(shown[:, k]) for k in range(4)}
    first_vertex = np.arange(count, dtype=np.int32)[:, None, None] * 4
    first_edge = np.arange(count, dtype=np.int32)[:, None, None] * 6
    return MeshBuffers(
        positions=corners.reshape(-1, 3).astype(np.float32),
        edge_verts=(_EDGES + first_vertex).reshape(-1, 2),
        corner_verts=(_FACES + first_vertex).ravel(),
        corner_edges=(_FACE_EDGES + first_edge).ravel(),
        face_offsets=np.arange(0, 12 * count + 1, 3, dtype=np.int32),
        attributes={
            "tf_color": per_face(values["color"]),
            "tf_transmission": per_face(values["transmission"]),
            "tf_kappa": per_face(directional_mean(matrices)),
            "tf_s0": per_face(matrices[:, :3]),
            "tf_s1": per_face(matrices[:, 3:]),
            "tf_normal": per_face(axes),
            "tf_plane": per_face(values["plane"]),
            "tf_random": per_face(random),
            "tf_bary": ("POINT", np.tile(_BARYCENTRIC, (count, 1))),
            "tf_g1": per_face(gradients[:, 0]),
            "tf_g2": per_face(gradients[:, 1]),
            "tf_g3": per_face(gradients[:, 2]),
            **baked,
        },
        smooth=False,
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
    matrices, normal, plane = extinction_matrices(summaries, volume(vertices))
    vertices, matrices = set_apart(vertices, matrices)
    rank = result.rank[proxies]
    baked = None if light is None else light.of_shells()[proxies]
    color, transmission = summaries.color, summaries.transmission
    return shell_buffers(vertices, color, transmission, matrices, normal, plane, rank=rank, light=baked)


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
