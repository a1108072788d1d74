# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Projected tetrahedra: each tetrahedron as at most four triangles with opacity (paper, section 4, figure 3).

The method is that of Shirley and Tuchman, "A polygonal approximation to direct scalar volume rendering", 1990. Cases
are told apart without projecting anything. Let c be the barycentric coordinates of the eye in a tetrahedron with the
vertices v: Σ c v is the eye itself, so that the directions from the eye to the vertices weigh up to nothing under c.
Vertices with positive c therefore span the very ray that those with negative c span: one ray that meets a vertex and
the face opposite it (one sign against three), or two opposite edges (two against two). This is the ray on which the
tetrahedron is thickest. For parallel rays the barycentric coordinates of their direction take the eye's place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers32, Mask
from ..camera.camera import Camera
from ..tetrahedra.geometry import barycentric_gradients

#: Corner of the thick point among the five corners of a projected tetrahedron.
THICK = 4
#: Corners of a case have this number where there is no triangle.
_NONE = -1


def _cases() -> NDArray[np.int8]:
    """Triangles (16, 4, 3) by the signs of c, bit i for vertex i: the thick point and an edge of the silhouette."""
    table = np.full((16, 4, 3), _NONE, np.int8)
    for case in range(1, 15):  # with 0 or 15 the eye is within, and there is no silhouette
        positive = [i for i in range(4) if case >> i & 1]
        negative = [i for i in range(4) if not case >> i & 1]
        if len(positive) == 2:
            edges = [(p, n) for p in positive for n in negative]
        else:
            a, b, c = positive if len(positive) == 3 else negative
            edges = [(a, b), (b, c), (c, a)]
        for i, edge in enumerate(edges):
            table[case, i] = (*edge, THICK)
    return table


_CASES = _cases()


@dataclass(frozen=True)
class Projected:
    """Tetrahedra as triangles, in the order of the tetrahedra."""

    #: (n, 5, 3): the four vertices, on which opacity is 0, and the nearest point of the ray on which each tetrahedron
    #: is thickest; world space, meters.
    corners: Floats
    opacity: Floats  # (n,): of the thick point: 1 − e^(−κ · thickness)
    thickness: Floats  # (n,): along that ray, meters
    #: (m, 3): corners of triangles, counted through all tetrahedra (five each); those of one follow one another. They
    #: face either way.
    triangles: Integers32


def drawable(vertices: NDArray[np.floating], camera: Camera) -> Mask:
    """Tetrahedra (n, 4, 3) that lie whole in front of the near plane of a flat camera; others have no projection."""
    back = camera.frame[:, 2]
    depth = (np.asarray(camera.position) @ back) - vertices @ back.astype(vertices.dtype)
    return depth.min(axis=1) > camera.near


def project(vertices: Floats, extinction: Floats, camera: Camera) -> Projected:
    """Triangles of tetrahedra as a camera sees them.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
        Of either orientation, meters, world space, all `drawable`. In the order in which they are to be drawn.
    extinction : (n,) float64
        κ ≥ 0, 1/m.
    camera : Camera
        Perspective or orthographic; panoramas have no straight edges.

    Raises
    ------
    ValueError
        If the camera is a panorama.
    """
    if camera.kind == "PANO":
        raise ValueError("a panorama bends the edges of tetrahedra; use a perspective or orthographic camera")
    vertices = np.asarray(vertices, np.float64)
    gradients = barycentric_gradients(vertices)
    if camera.kind == "ORTHO":
        weights, origin = -gradients @ camera.frame[:, 2], vertices.mean(axis=1)
    else:
        # Every coordinate is 0 on the face opposite its vertex, so any vertex of that face may be the origin.
        on_face = vertices[:, [1, 2, 3, 0]]
        weights, origin = ((camera.position - on_face) * gradients).sum(axis=2), camera.position[None]
    sides = np.stack([np.maximum(weights, 0.0), np.maximum(-weights, 0.0)])
    total = sides.sum(axis=2)
    # From the origin, so that what lies far from it, or is as thin as a needle, loses no precision.
    reach = np.einsum("snk,nkj->snj", sides, vertices - origin[:, None])
    reach /= np.where(total > 0.0, total, 1.0)[:, :, None]
    toward = -camera.frame[:, 2]
    first = (reach[0] @ toward > reach[1] @ toward).astype(np.intp)
    front = reach[first, np.arange(len(vertices))] + origin
    thickness = np.linalg.norm(reach[0] - reach[1], axis=1)
    # What has no volume has neither thickness nor triangles.
    flat = (total <= 0.0).any(axis=0)
    thickness = np.where(flat, 0.0, thickness)
    front[flat] = vertices[flat, 0]
    case = (weights >= 0.0) @ np.array([1, 2, 4, 8])
    triangles = _CASES[np.where(flat, 0, case)]
    owner, which = np.nonzero(triangles[:, :, 0] != _NONE)
    corners = np.concatenate([vertices, front[:, None]], axis=1)
    indices = triangles[owner, which] + 5 * owner[:, None]
    return Projected(corners, -np.expm1(-extinction * thickness), thickness, indices.astype(np.int32))
