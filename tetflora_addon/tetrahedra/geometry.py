# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be measured on many tetrahedra at once: volume, quality, faces, silhouette, barycentric coordinates.

A *tetrahedron* is ``(4, 3)`` float64, meters; face ``i`` is the one opposite vertex ``i``. Positive orientation means
that the edges from vertex 0 to vertices 1, 2 and 3 form a right-handed system.
"""

import numpy as np

from ..arrays import Floats

#: Vertices of the six edges; edge ``i`` and edge ``5 - i`` are opposite.
EDGES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])

#: Vertices of the face opposite each vertex, counter-clockwise seen from outside a positive tetrahedron.
FACES = np.array([(1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)])


def signed_volume(vertices: Floats) -> Floats:
    """Volume, positive where the tetrahedron is positively oriented.

    Parameters
    ----------
    vertices : (..., 4, 3) float64

    Returns
    -------
    (...) float64
        det(v1 − v0, v2 − v0, v3 − v0) / 6, cubic meters.
    """
    a, b, c = (vertices[..., i, :] - vertices[..., 0, :] for i in (1, 2, 3))
    return np.sum(np.cross(a, b) * c, axis=-1) / 6.0


def volume(vertices: Floats) -> Floats:
    """Absolute volume ``(...)`` of tetrahedra ``(..., 4, 3)``, cubic meters."""
    return np.abs(signed_volume(vertices))


def squared_edges(vertices: Floats) -> Floats:
    """Squared lengths ``(..., 6)`` of the edges of tetrahedra ``(..., 4, 3)``, in the order of `EDGES`, m²."""
    # By component, because six short differences in a row are faster than one gather of (n, 6, 3) and its sum.
    x, y, z = (vertices[..., i] for i in range(3))
    first, second = EDGES.T
    dx, dy, dz = (c[..., second] - c[..., first] for c in (x, y, z))
    return dx * dx + dy * dy + dz * dz


def quality(vertices: Floats) -> Floats:
    """Mean-ratio quality η = 12 (3V)^(2/3) / Σ l², 1 for the regular tetrahedron and 0 for a flat one.

    Parameters
    ----------
    vertices : (..., 4, 3) float64

    Returns
    -------
    (...) float64
        Quality, without unit. A tetrahedron that is a single point has quality 0.

    Notes
    -----
    Liu and Joe, "Relationship between tetrahedron shape measures", BIT 34 (1994).
    """
    total = np.sum(squared_edges(vertices), axis=-1)
    return 12.0 * np.cbrt(3.0 * volume(vertices)) ** 2 / np.where(total > 0.0, total, 1.0)


def face_area_vectors(vertices: Floats) -> Floats:
    """Outward normals times area of the four faces of positive tetrahedra.

    Parameters
    ----------
    vertices : (..., 4, 3) float64

    Returns
    -------
    (..., 4, 3) float64
        Vector ``i`` is of the face opposite vertex ``i``, m²; they add up to zero, and point inwards if it is negative.
    """
    a, b, c, d = (vertices[..., i, :] for i in range(4))
    ab, ac, ad = b - a, c - a, d - a
    sides = np.stack([np.cross(ad, ac), np.cross(ab, ad), np.cross(ac, ab)], axis=-2) / 2.0
    # The faces of a closed surface add up to nothing: that gives the face opposite vertex 0.
    return np.concatenate([-np.sum(sides, axis=-2, keepdims=True), sides], axis=-2)


def projected_area(vertices: Floats, direction: Floats) -> Floats:
    """Area of the silhouette in parallel projection: half of Σ |A_i · ω|.

    Parameters
    ----------
    vertices : (..., 4, 3) float64
        Of either orientation.
    direction : (3,) or (..., 3) float64
        Unit viewing directions.

    Returns
    -------
    (...) float64
        Square meters, measured across the direction.
    """
    areas = face_area_vectors(vertices)
    return np.sum(np.abs(np.sum(areas * np.asarray(direction)[..., None, :], axis=-1)), axis=-1) / 2.0


def barycentric_gradients(vertices: Floats) -> Floats:
    """Gradients of the four barycentric coordinates.

    Parameters
    ----------
    vertices : (..., 4, 3) float64
        Of either orientation.

    Returns
    -------
    (..., 4, 3) float64
        ∇λ_i = −A_i / (3V), 1/m; zero for tetrahedra without volume.
    """
    triple = 3.0 * signed_volume(vertices)[..., None, None]
    flat = triple == 0.0
    return np.where(flat, 0.0, -face_area_vectors(vertices) / np.where(flat, 1.0, triple))


def barycentric(vertices: Floats, points: Floats) -> Floats:
    """Barycentric coordinates of points, one tetrahedron each (leading axes broadcast).

    Parameters
    ----------
    vertices : (..., 4, 3) float64
    points : (..., 3) float64
        Points, meters.

    Returns
    -------
    (..., 4) float64
        λ with Σ λ = 1 and Σ λ_i v_i = point.
    """
    gradients = barycentric_gradients(vertices)[..., 1:, :]
    rest = np.sum(gradients * (points - vertices[..., 0, :])[..., None, :], axis=-1)
    return np.concatenate([1.0 - np.sum(rest, axis=-1, keepdims=True), rest], axis=-1)


def plane_through(points: Floats, negative: Floats) -> Floats:
    """Planes through three points each, turned so that a fourth one is on the negative side.

    Parameters
    ----------
    points : (..., 3, 3) float64
        Three points of each plane, meters; not on one line.
    negative : (..., 3) float64
        A point on side 0 of each plane.

    Returns
    -------
    (..., 4) float64
        ``(nx, ny, nz, d)`` with unit normal.
    """
    a, b, c = (points[..., i, :] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = normal / np.where(length > 0.0, length, 1.0)
    normal = np.where(np.sum(normal * (negative - a), axis=-1, keepdims=True) > 0.0, -normal, normal)
    # The mean of the three points carries less rounding error into the offset than any one of them.
    return np.concatenate([normal, -np.sum(normal * (a + b + c), axis=-1, keepdims=True) / 3.0], axis=-1)


def plane_distance(planes: Floats, points: Floats) -> Floats:
    """Signed distances ``(...)`` of points ``(..., 3)`` from planes ``(..., 4)``, meters; side 1 is ``>= 0``."""
    n, p = planes, points
    return n[..., 0] * p[..., 0] + n[..., 1] * p[..., 1] + n[..., 2] * p[..., 2] + n[..., 3]
