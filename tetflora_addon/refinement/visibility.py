# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The visibility step (paper, section 6.3): how many pixels a tetrahedron affects, and how much hides it.

The paper draws the tree front to back and reads an alpha buffer along the way. Since optical depths add up, the same
numbers come from sorting all fragments by pixel and front-to-back rank: what stands before a fragment is a cumulative
sum within its pixel. No pixel is visited in a loop. A tetrahedron's fragments stay until it is divided.

Panoramas have six square views, the faces of a cube, with an alpha buffer each. The views have one eye, so that the
tree's front-to-back order is that of all of them. What a tetrahedron affects is summed over the faces: the solid angle
of each fragment times the pixels that the image has for a solid angle there, which in an equirectangular panorama grow
with one over the cosine of the latitude.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Integers, Mask
from ..camera.camera import LEAST_COSINE, Camera, blur_margins, silhouette_pixels
from ..compiled.flora import Flora
from ..growth.seeds import Branches
from .contents import bounding_capsules
from .polygons import Polygons
from .rasterize import buffer_size, occluder_depth, pixel_rays, tetrahedron_fragments
from .settings import RefinementSettings
from .shared_parts import AssetParts

#: Optical depth of one fragment at most. e^−60 is no light at all, and larger or infinite numbers would cost the
#: cumulative sum over the whole image its precision.
OPAQUE = 60.0
#: Longer side of the coarsest buffer, pixels.
COARSEST = 32
#: Pixels of a buffer along each side for every tetrahedron along it, were they spread over the image side by side.
_ACROSS = 8.0


def depth_in_front(pixel: Integers, depth: Floats) -> tuple[Integers, NDArray]:
    """First fragment of its pixel, and optical depth before it, for each of fragments (n,).

    Fragments are sorted by ``pixel`` and front to back. What all earlier pixels hold is subtracted again from one
    cumulative sum; rounding must not leave less than nothing.
    """
    summed = np.cumsum(depth)
    begins = np.flatnonzero(np.diff(pixel, prepend=-1))
    first = np.repeat(begins, np.diff(begins, append=len(pixel)))
    return first, np.maximum(summed - depth - (summed - depth)[first], 0.0)


@dataclass(frozen=True)
class Outline:
    """What is known of each tetrahedron (n,) without the others."""

    pixels: Floats  # (n,): area in pixels of the final image that the tetrahedron affects, hidden or not; 0 out of view
    opacity: Floats  # (n,): mean of 1 − e^−τ over its own silhouette, 0 to 1; 0 out of view
    fully_inside: Mask  # (n,): whether all of it is in view


class AlphaBuffer:
    """The fragments of all tetrahedra in a small image, as they come and go.

    Parameters
    ----------
    camera : Camera
        The view, and the size of the final image.
    resolution : int
        Longer side of the buffer, pixels; `buffer_size` gives both sides.
    occluders_depth : (height · width,) float64, optional
        Where each pixel's ray ends at an opaque polygon, as `occluder_depth` gives it for the same size.
    pixel_weight : (height · width,) float64, optional
        Pixels of the final image that each pixel stands for, where the image is not the camera's own.
    """

    def __init__(
        self, camera: Camera, resolution: int, occluders_depth: Floats | None = None, pixel_weight: Floats | None = None
    ) -> None:
        self.camera, self.pixel_weight = camera, pixel_weight
        self.width, self.height = buffer_size(camera, resolution)
        self.end = occluders_depth
        self._cell, self._pixel = np.zeros((2, 0), np.int32)
        # Optical depth of a fragment, the visible fraction of its tetrahedron that it covers, and transmittance before.
        self._depth, self._fraction, self._before = np.zeros((3, 0))
        self._changed = np.zeros(self.width * self.height, bool)

    def add(self, cells: Integers, vertices: Floats, extinction: ArrayLike) -> Outline:
        """Draw tetrahedra.

        Parameters
        ----------
        cells : (n,) int
            Their numbers from now on, zero or positive, each new.
        vertices : (n, 4, 3) float64
            Positively oriented, overlapping with none that is there, meters, world space.
        extinction : (n,) float64
            κ ≥ 0 along the way from the eye, 1/m; may be infinite.
        """
        count = len(vertices)
        fragments = tetrahedron_fragments(vertices, self.camera, self.width, self.height)
        cell, pixel, coverage = fragments.cell, fragments.pixel, fragments.coverage
        fraction = np.ones(len(fragments))
        if self.end is not None:
            behind = (self.end[pixel] - fragments.entry) / np.maximum(fragments.thickness, 1e-12)
            fraction = np.clip(behind, 0.0, 1.0)
        with np.errstate(invalid="ignore"):
            depth = np.asarray(extinction, np.float64)[cell] * fragments.thickness
        # 0 · ∞ where a ray touches an opaque cell in a point: nothing.
        optical = np.nan_to_num(np.minimum(depth, OPAQUE), nan=0.0)
        counted = coverage if self.pixel_weight is None else coverage * self.pixel_weight[pixel]
        weight = np.bincount(cell, counted, count)
        opacity = np.bincount(cell, -counted * np.expm1(-optical), count) / np.where(weight > 0.0, weight, 1.0)
        pixels, whole = silhouette_pixels(vertices, self.camera)
        final = self.camera.width * self.camera.height / (self.width * self.height)
        exact = whole & (weight > 0.0)
        if self.pixel_weight is not None:
            exact, final = np.zeros(count, bool), 1.0
        # What lies behind an occluder is neither seen nor hides anything.
        open_ones = slice(None) if self.end is None else np.flatnonzero(fraction)
        self._changed[pixel[open_ones]] = True
        hides = fragments.entry >= self.camera.min_occluding_depth
        for name, values in (
            ("_cell", np.asarray(cells, np.int32)[cell]),
            ("_pixel", pixel),
            ("_depth", optical * np.minimum(coverage * fraction, 1.0) * hides),
            ("_fraction", counted * fraction / np.maximum(weight, 1e-300)[cell]),
            ("_before", np.ones(len(cell))),
        ):
            setattr(self, name, np.concatenate([getattr(self, name), values[open_ones]]))
        pixels = np.where(exact, pixels, weight * final) * self.camera.pixel_gain(np.asarray(vertices).mean(axis=1))
        return Outline(pixels, opacity, whole)

    def remove(self, chosen: Mask) -> None:
        """Remove tetrahedra; ``chosen`` is a mask (m,) by their numbers."""
        go = chosen[self._cell]
        if go.any():
            self._changed[self._pixel[go]] = True
            stay = np.flatnonzero(~go)
            for name in ("_cell", "_pixel", "_depth", "_fraction", "_before"):
                setattr(self, name, np.take(getattr(self, name), stay))

    def transmittance(self, rank: Integers) -> Floats:
        """Fraction (numbers,) of each tetrahedron's light, 0 to 1, that nothing in front blocks; 0 out of view.

        ``rank`` (numbers,) is the front-to-back rank by number, as `TetrahedralTree.order` gives it; smaller is nearer,
        none negative. What has been ranked before keeps its place relative to each other.
        """
        # Only where something has come or gone is there anything to sort again.
        stale = np.flatnonzero(self._changed[self._pixel])
        self._changed[:] = False
        pixel, depth = np.take(self._pixel, stale), np.take(self._depth, stale)
        # One number to sort by is several times as fast as two.
        key = pixel.astype(np.int64) * (int(rank.max(initial=0)) + 1) + np.take(rank, np.take(self._cell, stale))
        order = np.argsort(key)
        before = np.zeros_like(depth)
        before[order] = depth_in_front(np.take(pixel, order), np.take(depth, order))[1]
        self._before[stale] = np.exp(-before)
        return np.bincount(self._cell, self._fraction * self._before, len(rank))


def hiding(camera: Camera) -> Camera:
    """A camera that sees only opaque polygons that hide others from all eyes that it stands for."""
    return replace(camera, near=max(camera.near, camera.min_occluding_depth))


def fitting(cells: int, finest: int) -> int:
    """Longer side, in pixels, of a buffer for a number of tetrahedra."""
    wanted = COARSEST
    while wanted < finest and wanted < _ACROSS * np.sqrt(cells):
        wanted *= 2
    return min(wanted, finest)


class Buffers:
    """Alpha buffers as fine as what is drawn into them: a few large tetrahedra need few pixels.

    Parameters
    ----------
    resolution : int
        Longer side of the finest buffer, pixels.
    occluders : (t, 3, 3) float64, optional
        Triangles of explicit polygons that hide what is behind them, meters.
    """

    def __init__(self, camera: Camera, resolution: int, occluders: Floats | None = None) -> None:
        self.camera, self.occluders, self.depth, self.around = camera, occluders, None, camera.kind == "PANO"
        self.finest, self.size = face_side(resolution) if self.around else resolution, buffer_size(camera, resolution)
        if not self.around and occluders is not None and len(occluders):
            self.depth = occluder_depth(occluders, hiding(camera), *self.size)

    def fit(self, buffer: "AlphaBuffer | _PanoramaBuffer | None", cells: int) -> "AlphaBuffer | _PanoramaBuffer":
        """The buffer itself if it is fine enough for a number of tetrahedra, or a finer one that is empty."""
        wanted = fitting(cells // 2 if self.around else cells, self.finest)
        if buffer is not None and max(buffer.width, buffer.height) >= wanted:
            return buffer
        if self.around:
            return _PanoramaBuffer(self.camera, wanted, self.occluders)
        return AlphaBuffer(self.camera, wanted, None if self.depth is None else self._reduced(wanted))

    def _reduced(self, resolution: int) -> Floats:
        """Occluders' depth in a coarser buffer: that of the pixel of the finest one in the middle."""
        (width, height), (columns, rows) = self.size, buffer_size(self.camera, resolution)
        row = ((np.arange(rows) + 0.5) * height / rows).astype(np.int64)
        column = ((np.arange(columns) + 0.5) * width / columns).astype(np.int64)
        return self.depth.reshape(height, width)[np.ix_(row, column)].ravel()


#: Side of a face, a quarter of the way round, for the longer side of a buffer; in its corners pixels are denser.
FACE_FRACTION = 0.5

#: Directions and upward directions of the six faces in camera space (x right, y up, z back).
_FACES = (
    ((0, 0, -1), (0, 1, 0)), ((1, 0, 0), (0, 1, 0)), ((0, 0, 1), (0, 1, 0)), ((-1, 0, 0), (0, 1, 0)),
    ((0, 1, 0), (0, 0, 1)), ((0, -1, 0), (0, 0, -1)),
)  # fmt: skip


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
    longitude, latitude = camera.longitude_latitude((directions @ camera.frame) * np.array([1.0, 1.0, -1.0]))
    left, right, bottom, top = camera.window
    seen = (longitude >= left) & (longitude <= right) & (latitude >= bottom) & (latitude <= top)
    return np.where(seen, 1.0 / (camera.pixel_size**2 * np.maximum(np.cos(latitude), LEAST_COSINE)), 0.0)


class _PanoramaBuffer:
    """The fragments of all tetrahedra around the eye, in six faces; to be used as an `AlphaBuffer`."""

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
                occluded = occluders is not None and len(occluders)
                end = occluder_depth(occluders, hiding(face), side, side) if occluded else None
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
            inside = np.flatnonzero(np.logical_and.reduce([(wall > 0.0).any(axis=1) for wall in walls]))
            outline = face.add(cells[inside], vertices[inside], extinction[inside])
            self._weight[number, cells[inside]] = outline.pixels
            pixels[inside] += outline.pixels
            opacity[inside] += outline.pixels * outline.opacity
        whole = (self.camera.distance_to_view(vertices.reshape(-1, 3)).reshape(-1, 4) <= 0.0).all(axis=1)
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


def face_side(resolution: int) -> int:
    """Side in pixels of the faces, given the longer side of a flat image's buffer."""
    return max(1, round(FACE_FRACTION * resolution))


def widened_for(
    camera: Camera, margin: float, flora: Flora, subplants: Branches, polygons: Polygons, assets: AssetParts
) -> Camera:
    """The camera with a margin, in fractions of the image, and what depth of field and motion blur add to it.

    Polygons count by their centers: one large face from the eye to the horizon needs no margin.
    """
    if not (camera.lens_radius > 0.0 or camera.shutter):
        return camera.widened(margin)
    capsules = bounding_capsules(flora, subplants)
    reach = np.hypot(capsules[6] + capsules[8], capsules[7] + capsules[8])
    reach = np.concatenate([reach, np.zeros(len(polygons)), assets.reach])
    across, up = blur_margins(camera, np.concatenate([capsules[:3].T, polygons.center, assets.center]), reach)
    return camera.widened(margin + across, margin + up)


def is_anchored(camera: Camera, settings: RefinementSettings) -> bool:
    """Whether the root stays where it is in the world; a panorama has no pyramid that a root could begin with."""
    return settings.anchored or camera.kind == "PANO"


def pixels_of_buffer(camera: Camera, resolution: int) -> float:
    """Side of a pixel of the finest alpha buffer, in pixels of the final image."""
    if camera.kind == "PANO":
        return 2.0 / face_side(resolution) / camera.pixel_size
    return camera.width / buffer_size(camera, resolution)[0]
