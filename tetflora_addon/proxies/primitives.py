# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What renderers draw for facets: triangles or spheres, in the precision in which meshes and point clouds keep them.

They take half of the memory of facets, or less, which matters where another process has made them.

Microspheres are opaque spheres, the particles of the paper's volumes (section 7). A facet covers the more the more it
faces the eye; a sphere covers the same from everywhere. A sphere can therefore cover what its facet covers for the
camera, but not for all lights as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..arrays import Arrays, Floats, Floats32
from ..buffers import MeshBuffers, PointBuffers, separate_polygons
from ..camera.camera import Camera
from .microsurfaces import CIRCUMRADIUS, SIN_60, Facets

#: Minimum fraction of a facet's area that its sphere covers, where the facet is seen from its edge.
LEAST_COVER = 0.1
#: Mean of |cos| for a level facet and an upright one over light that falls on level ground from an even sky:
#: directions above, weighted by the cosine to the zenith.
LEVEL_COVER, UPRIGHT_COVER = 2.0 / 3.0, 4.0 / (3.0 * np.pi)
#: Light of a clear sky on level ground, over that of the sun at the zenith.
SKYLIGHT = 0.2


@dataclass(frozen=True)
class DrawnShapes(Arrays):
    """Equilateral triangles, or spheres."""

    place: Floats32  # (n, 3, 3): corners of triangles, or (n, 3): centers of spheres; world space, meters
    color: Floats32  # (n, 3)
    transmission: Floats32  # (n,)
    #: velocity, roughness and dull, (n, 3), (n,) and (n,): as of facets.
    velocity: Floats32 | None = None
    roughness: Floats32 | None = None
    dull: Floats32 | None = None
    radius: Floats32 | None = None  # (n,): of spheres, meters; None for triangles


#: Facets, or what is drawn in their place.
Primitive = Facets | DrawnShapes
_Drawn = TypeVar("_Drawn", Facets, DrawnShapes)


def triangle_corners(facets: Facets) -> Floats32:
    """Corners (n, 3, 3) of a triangle for each facet."""
    reach = CIRCUMRADIUS * facets.side[:, None]
    longer = 1.0 if facets.stretch is None else facets.stretch[:, None]
    a, b = reach / longer * facets.across, reach * longer * facets.along
    corners = [facets.center + b, facets.center - SIN_60 * a - b / 2, facets.center + SIN_60 * a - b / 2]
    return np.stack([c.astype(np.float32) for c in corners], 1)


def triangles_of(facets: Facets) -> DrawnShapes:
    """A triangle for each facet: it takes half of a renderer's memory and time for a square of the same area."""
    return DrawnShapes(triangle_corners(facets), *_shaded(facets))


def spheres_of(facets: Facets, camera: Camera | None, disc: float = np.pi, sun: Floats | None = None) -> DrawnShapes:
    """A sphere for each facet.

    Parameters
    ----------
    facets : Facets of n
    camera : Camera or None
        That for which each sphere covers what its facet covers. Without, it covers what its facet covers for light
        from above: for facets that only cast shadows and light up others.
    disc : float
        Area that a renderer draws for a sphere of radius 1; some draw fewer pixels than a circle has.
    sun : (3,) float64, optional
        Where the strongest sunlight comes from, a unit vector. Without, light comes from an even sky.
    """
    cover = cover_for_light(facets, sun) if camera is None else np.maximum(facing(facets, camera), LEAST_COVER)
    radius = facets.side * np.sqrt(cover / disc)
    return DrawnShapes(facets.center.astype(np.float32), *_shaded(facets), radius.astype(np.float32))


def joined(parts: Sequence[_Drawn]) -> _Drawn:
    """One or more parts of one kind as one, in their order."""
    if len(parts) == 1:
        return parts[0]
    if any(part.velocity is not None for part in parts):  # meshes from elsewhere stand still beside plants that move
        still = [np.zeros((len(part), 3), part.color.dtype) for part in parts]
        parts = [replace(p, velocity=zero) if p.velocity is None else p for p, zero in zip(parts, still, strict=True)]
    return type(parts[0]).concatenate(parts)


def shape_buffers(shapes: DrawnShapes) -> MeshBuffers | PointBuffers:
    """A mesh of triangles, or spheres as points, with the attributes that the material of proxies reads."""
    names = ("color", "transmission", "roughness", "dull")
    looks = {f"tf_{name}": column for name in names if (column := getattr(shapes, name)) is not None}
    if shapes.radius is not None:
        still = shapes.velocity is None
        return PointBuffers(shapes.place, shapes.radius, looks if still else {**looks, "velocity": shapes.velocity})
    attributes = {name: ("FACE", values) for name, values in looks.items()}
    if shapes.velocity is not None:
        attributes["velocity"] = "POINT", np.repeat(shapes.velocity, 3, axis=0)
    return separate_polygons(shapes.place, attributes)


def cover_for_light(facets: Facets, sun: Floats | None) -> Floats:
    """Fraction (n,) of its area that each facet covers for the light of a sun and of the sky, by what each brings."""
    cover = UPRIGHT_COVER + (LEVEL_COVER - UPRIGHT_COVER) * facets.normal[:, 2] ** 2
    if sun is None or sun[2] <= 0.0:
        return cover
    direct = sun[2] / (sun[2] + SKYLIGHT)
    return direct * np.abs(facets.normal @ sun) + (1.0 - direct) * cover


def facing(facets: Facets, camera: Camera) -> Floats:
    """Fraction (n,) of its area that each facet shows to the camera, 0 to 1."""
    if camera.kind == "ORTHO":
        return np.abs(facets.normal @ camera.frame[:, 2])
    ray = facets.center - camera.eye
    return np.abs(np.einsum("ni,ni->n", facets.normal, ray)) / np.maximum(np.linalg.norm(ray, axis=1), 1e-300)


def _shaded(facets: Facets) -> tuple[Floats32 | None, ...]:
    more = (None if o is None else o.astype(np.float32) for o in (facets.velocity, facets.roughness, facets.dull))
    return facets.color.astype(np.float32), facets.transmission.astype(np.float32), *more
