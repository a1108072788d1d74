# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What depends on the type of camera: the margin of the view, the root of space, and the buffers that are drawn into.

Panoramas have six square views, the faces of a cube, with an alpha buffer each. The views have one eye, so that the
tree's front-to-back order is that of all of them. What a tetrahedron affects is summed over the faces: the solid angle
of each fragment times the pixels that the image has for a solid angle there, which in an equirectangular panorama grow
with one over the cosine of the latitude.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Integers, Mask
from ..camera.camera import LEAST_COSINE, Camera, blur_margins
from ..compiled.flora import Flora
from ..growth.branches import Branches
from .asset_parts import AssetParts
from .contents import bounding_cylinders
from .polygons import Polygons
from .rasterize import buffer_size, occluder_depth, pixel_rays
from .settings import RefinementSettings
from .visibility import AlphaBuffer, Outline, fitting, hiding

#: Side of a face for the longer side of a buffer. A face spans a quarter of the way round; in its corners its pixels
#: are several times as dense as in the middle.
FACE_FRACTION = 0.5

#: Directions and upward directions of the six faces in camera space (x right, y up, z back).
_FACES = (
    ((0, 0, -1), (0, 1, 0)),
    ((1, 0, 0), (0, 1, 0)),
    ((0, 0, 1), (0, 1, 0)),
    ((-1, 0, 0), (0, 1, 0)),
    ((0, 1, 0), (0, 0, 1)),
    ((0, -1, 0), (0, 0, -1)),
)


def face_cameras(camera: Camera, side: int) -> list[Camera]:
    """Six perspective cameras at the eye of a panorama, whose square images fill the sphere.

    Their near planes lie within the panorama's near sphere and touch it at the corners.
    """
    turns = [np.stack([np.cross(ahead, up), up, np.negative(ahead)], axis=1).astype(np.float64) for ahead, up in _FACES]
    window, near, radius = (-1, 1, -1, 1), camera.near / np.sqrt(3.0), camera.cell_radius
    return [
        Camera("PERSP", camera.position, camera.frame @ t, window, near, camera.far, side, side, cell_radius=radius)
        for t in turns
    ]


def pixels_per_solid_angle(camera: Camera, directions: Floats) -> Floats:
    """Pixels (n,) of a panorama for each steradian around directions (n, 3) in world space; 0 beside the image."""
    local = (directions @ camera.frame) * np.array([1.0, 1.0, -1.0])
    longitude, latitude = camera.longitude_latitude(local)
    left, right, bottom, top = camera.window
    seen = (longitude >= left) & (longitude <= right) & (latitude >= bottom) & (latitude <= top)
    return np.where(seen, 1.0 / (camera.pixel_size**2 * np.maximum(np.cos(latitude), LEAST_COSINE)), 0.0)


class PanoramaBuffer:
    """The fragments of all tetrahedra around the eye; to be used as an `AlphaBuffer`.

    Parameters
    ----------
    camera : Camera
        A panorama.
    side : int
        Of each of the six faces, pixels.
    occluders : (t, 3, 3) float64, optional
        Opaque triangles, meters.
    """

    def __init__(self, camera: Camera, side: int, occluders: Floats | None = None) -> None:
        self.camera = camera
        self.width = self.height = side
        self.faces: list[AlphaBuffer] = []
        for face in face_cameras(camera, side):
            directions = pixel_rays(face, side, side)[1]
            # Seen from the eye, a pixel at the side of a face is smaller than one in the middle.
            solid = (2.0 / side) ** 2 * (directions @ -face.frame[:, 2]) ** 3
            pixel_weight = solid * pixels_per_solid_angle(camera, directions)
            if pixel_weight.any():
                some = occluders is not None and len(occluders)
                end = occluder_depth(occluders, hiding(face), side, side) if some else None
                self.faces.append(AlphaBuffer(face, side, end, pixel_weight))
        self._weight = np.zeros((len(self.faces), 0))

    def add(self, cells: Integers, vertices: Floats, extinction: ArrayLike) -> Outline:
        """Draw tetrahedra (n, 4, 3); parameters and result as for `AlphaBuffer.add`."""
        count, extinction = len(vertices), np.asarray(extinction, np.float64)
        pixels, opacity = np.zeros((2, count))
        if count:
            self._grow(int(np.max(cells)) + 1)
        for number, face in enumerate(self.faces):
            x, y, depth = np.moveaxis(face.camera.to_camera_space(vertices), -1, 0)
            walls = (depth - x, depth + x, depth - y, depth + y)  # of the face's pyramid
            some = np.flatnonzero(np.logical_and.reduce([(wall > 0.0).any(axis=1) for wall in walls]))
            outline = face.add(cells[some], vertices[some], extinction[some])
            self._weight[number, cells[some]] = outline.pixels
            pixels[some] += outline.pixels
            opacity[some] += outline.pixels * outline.opacity
        outside = self.camera.distance_to_view(vertices.reshape(-1, 3)).reshape(-1, 4)
        whole = (outside <= 0.0).all(axis=1)
        return Outline(pixels, opacity / np.where(pixels > 0.0, pixels, 1.0), whole)

    def remove(self, chosen: Mask) -> None:
        """Remove tetrahedra; ``chosen`` is a mask (m,) by their numbers."""
        for face in self.faces:
            face.remove(chosen)

    def transmittance(self, rank: Integers) -> Floats:
        """Fraction (m,) of each tetrahedron's light that nothing in front blocks, as `AlphaBuffer.transmittance`."""
        self._grow(len(rank))
        weight = self._weight[:, : len(rank)]
        seen = sum(w * face.transmittance(rank) for w, face in zip(weight, self.faces, strict=True))
        total = weight.sum(axis=0)
        return seen / np.where(total > 0.0, total, 1.0)

    def _grow(self, numbers: int) -> None:
        if numbers > self._weight.shape[1]:
            grown = np.zeros((len(self.faces), max(numbers, 2 * self._weight.shape[1])))
            grown[:, : self._weight.shape[1]] = self._weight
            self._weight = grown


class PanoramaBuffers:
    """Panorama buffers as fine as what is drawn into them; parameters and use as for `visibility.Buffers`."""

    def __init__(self, camera: Camera, resolution: int, occluders: Floats | None = None) -> None:
        self.camera, self.occluders = camera, occluders
        self.side = face_side(resolution)

    def fit(self, buffer: PanoramaBuffer | None, cells: int) -> PanoramaBuffer:
        """As `visibility.Buffers.fit`."""
        wanted = fitting(cells // 2, self.side)
        if buffer is not None and buffer.width >= wanted:
            return buffer
        return PanoramaBuffer(self.camera, wanted, self.occluders)


def face_side(resolution: int) -> int:
    """Side in pixels of the faces, given the longer side of a flat image's buffer."""
    return max(1, round(FACE_FRACTION * resolution))


def widened_for(
    camera: Camera,
    margin: float,
    flora: Flora,
    subplants: Branches,
    polygons: Polygons | None = None,
    assets: AssetParts | None = None,
) -> Camera:
    """The camera with a margin, in fractions of the image, and what depth of field and motion blur add to it.

    Polygons count by their centers: one large face from the eye to the horizon needs no margin.
    """
    if not (camera.lens_radius > 0.0 or camera.shutter):
        return camera.widened(margin)
    center, radius, half_height = bounding_cylinders(flora, subplants)
    reach = np.hypot(radius, half_height)
    if polygons is not None:
        center, reach = np.concatenate([center, polygons.center]), np.append(reach, np.zeros(len(polygons)))
    if assets is not None:
        center, reach = np.concatenate([center, assets.center]), np.append(reach, assets.reach)
    across, up = blur_margins(camera, center, reach)
    return camera.widened(margin + across, margin + up)


def is_anchored(camera: Camera, settings: RefinementSettings) -> bool:
    """Whether the root stays where it is in the world; a panorama has no pyramid that a root could begin with."""
    return settings.anchored or camera.kind == "PANO"


def pixels_of_buffer(camera: Camera, resolution: int) -> float:
    """Side of a pixel of the finest alpha buffer, in pixels of the final image."""
    if camera.kind == "PANO":
        return 2.0 / face_side(resolution) / camera.pixel_size
    return camera.width / buffer_size(camera, resolution)[0]
