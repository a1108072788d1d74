# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked light: the radiance of a refined scene as the camera sees it, without a renderer (paper, section 7).

All surfaces that will be drawn are collected first, as sheets (`SheetList`). `baked_light` then renders them from each
light, which is the paper's shadow pass, and `BakedLight` gives the light of facets, spheres, shells and faces.
"""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Floats32, Integers
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..light.buffers import LightBuffer
from ..light.illumination import Illumination, LampBuffers
from ..light.receivers import MediumCells, SurfaceElements, cell_of_node
from ..light.scattering import DIRECTIONS
from ..light.sources import Near, World, buffers_of, light_resolution, split_areas, to_eye
from ..proxies.microsurfaces import Facets
from ..refinement.decisions import Decision
from ..refinement.lights import Light
from ..refinement.loop import Refinement

#: Longer side in pixels of the sky's buffers, for each pixel of a lamp's: what comes from all sides has no edges.
SKY_FRACTION = 0.1
#: Its limits, pixels, of clouds alone and of sheets.
SKY_PIXELS, SKY_SHEET_PIXELS = (32, 96), (32, 384)
#: Maximum number of sheets in the sky's light, each for several: details do not show in light from all sides.
SKY_SHEETS = 40_000
#: Orders of scattering that are gathered one by one.
ORDERS = 2
#: Attributes of baked light: linear radiance of the side to which normals point, and of the other side.
FRONT, BACK = "tf_light_front", "tf_light_back"
#: Facets and faces whose light is computed together; some 2 kB each.
BATCH = 1 << 16
#: Maximum longer side in pixels of a lamp's buffer, with ground in it and without.
GROUND_PIXELS, OPEN_PIXELS = 1024, 4096
#: Suns have views of their own of what is nearer to the camera than these fractions of the distance to the farthest
#: leaf, if so many sheets are there.
NEAR_FRACTIONS, NEAR_SHEETS = (1 / 32, 1 / 8), 1000


def shadow_steps(
    clouds: MediumCells,
    lights: Sequence[Light],
    world: World,
    occluders: Floats | None = None,
    resolution: int = 512,
    ground: ArrayLike = (0.0, 0.0, 0.0),
    orders: int = ORDERS,
    sheets: SurfaceElements | None = None,
    near: Near | None = None,
) -> Generator[float, None, Illumination]:
    """Render a scene from all of its lights; yields the fraction that is done.

    Penumbras of the sun and of lamps that are no areas are as sharp as the buffer.

    Parameters
    ----------
    clouds : MediumCells
        All tetrahedra that hold something.
    lights : sequence of Light
    world : World
    occluders : (t, 3, 3) float64, optional
        Triangles of opaque polygons, meters.
    resolution : int
        Longer side of a lamp's buffer, pixels; see `light_resolution`. The sky's are `SKY_FRACTION` of it.
    ground : (3,) float
        Mean color of the polygons, which lights crowns from below.
    orders : int
        Orders of scattering that are gathered one by one, at least 1.
    sheets : SurfaceElements, optional
        Facets and leaves as they are drawn. Clumps smaller than tetrahedra shadow themselves, which an even cloud does
        not; a pixel should be about as large as a sheet.
    near : Near, optional
        Part of the scene that gets buffers of its own from suns.
    """
    sheets = SurfaceElements.none(len(clouds)) if sheets is None else sheets
    lamps = []
    split = split_areas(tuple(lights))
    for number, light in enumerate(split):
        buffers = buffers_of(light, clouds, sheets, occluders, resolution, near) if light.shadow else []
        lamps.append(LampBuffers(light, buffers))
        yield 0.3 * (number + 1) / len(split)
    fewer, number = sheets.thinned(SKY_SHEETS)
    # Between sheets there are gaps that coarse pixels do not see.
    fine = fewer.pixels(SKY_SHEET_PIXELS) if len(sheets) else int(np.clip(resolution * SKY_FRACTION, *SKY_PIXELS))
    sky: list[LightBuffer | None] = []
    for toward in DIRECTIONS:
        light = Light("SUN", np.zeros(3), -toward)
        views = buffers_of(light, clouds, fewer, occluders, fine)
        sky.append(views[0] if views else None)
        yield 0.3 + 0.3 * len(sky) / len(DIRECTIONS)
    found = Illumination(clouds, sheets, lamps, sky, world, (fewer, number))
    for fraction in found.scatter(np.asarray(ground, np.float64), max(orders, 1)):
        yield 0.6 + 0.4 * fraction
    return found


@dataclass(frozen=True)
class Sources:
    """Lights and opaque polygons of a scene."""

    lights: tuple[Light, ...]
    world: World
    occluders: Floats  # (t, 3, 3): triangles of ground and buildings, meters
    ground: Floats  # (3,): their mean color, linear

    def counted_from(self, origin: Floats) -> Self:
        """The same in coordinates that begin at a place (3,) of the present ones."""
        lights = tuple(light.counted_from(origin) for light in self.lights)
        return replace(self, lights=lights, occluders=self.occluders - origin)


class SheetList:
    """Small opaque surfaces that will be drawn, in the order in which they are added."""

    def __init__(self) -> None:
        self._parts: list[Floats32] = []

    def __len__(self) -> int:
        return sum(len(part) for part in self._parts)

    def add_facets(self, facets: Facets) -> None:
        """Facets, as squares of the same area."""
        half = 0.5 * facets.side[:, None]
        a, b, c = half * facets.across, half * facets.along, facets.center
        self._parts.append(np.stack([c - a - b, c + a - b, c + a + b, c - a + b], axis=1).astype(np.float32))

    def add_faces(self, positions: NDArray[np.floating], corner_verts: Integers, offsets: Integers) -> None:
        """Add faces of a mesh: positions (v, 3) in meters, ``corner_verts`` (c,), first corners (f + 1,)."""
        self._parts.append(positions[corner_verts[_four_corners(offsets)]].astype(np.float32))

    def corners(self) -> Floats32:
        """All of them, (m, 4, 3), meters."""
        return np.concatenate(self._parts) if self._parts else np.zeros((0, 4, 3), np.float32)


def _four_corners(offsets: Integers) -> Integers:
    """Corners (f, 4) of faces: of more than four, four that lie apart; triangles repeat their last."""
    first, size = offsets[:-1].astype(np.int64), np.diff(offsets)
    spread = np.where(size[:, None] <= 4, np.arange(4), np.arange(4) * size[:, None] // 4)
    return first[:, None] + np.minimum(spread, size[:, None] - 1)


@dataclass(frozen=True)
class BakedLight:
    """Light in a refined scene, as `baked_light` finds it."""

    illumination: Illumination
    #: (m,): tetrahedron (index into the clouds) of each sheet, −1 where it lies in none that holds something.
    cell: Integers
    camera: Camera

    def of_facets(self, facets: Facets, sheets: Integers) -> tuple[NDArray, NDArray]:
        """Radiance (n, 3) of the fronts and of the backs of facets, which are these sheets (n,) of the list."""
        surface = facets.center, facets.normal, facets.color, facets.transmission
        return self.illumination.facet_radiance(*surface, self.cell[sheets], self.camera, sheets, facets.dull)

    def of_spheres(self, facets: Facets, sheets: Integers) -> NDArray:
        """Radiance (n, 3) of spheres in the place of facets, which are these sheets (n,) of the list.

        A sphere covers what its facet covers for the camera, and shows what the camera would see of the facet.
        """
        front, back = self.of_facets(facets, sheets)
        toward = np.sum(facets.normal * to_eye(self.camera, facets.center), axis=1) > 0.0
        return np.where(toward[:, None], front, back)

    def of_shells(self) -> NDArray:
        """Radiance (t, 4, 3) of tetrahedra at their vertices, in the order of ``refinement.nodes``."""
        return self.illumination.cell_sources(self.camera)

    def of_faces(
        self,
        positions: NDArray[np.floating],
        corner_verts: Integers,
        offsets: Integers,
        color: NDArray[np.floating],
        transmission: NDArray[np.floating],
        sheets: Integers,
    ) -> tuple[NDArray, NDArray]:
        """Radiance (f, 3) of the fronts and of the backs of a mesh's faces, which are these sheets (f,) of the list.

        The mesh is in the layout of `buffers.MeshBuffers`, with a color (f, 3) and transmission (f,) for each face.
        """
        corners = positions[corner_verts[_four_corners(offsets)]].astype(np.float64)
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        surface = _middles(corners), normal, color.astype(np.float64), transmission.astype(np.float64)
        return self.illumination.facet_radiance(*surface, self.cell[sheets], self.camera, sheets)


def at_vertices(values: NDArray[np.floating], corner_verts: NDArray, offsets: NDArray, vertices: int) -> NDArray:
    """Means (v, 3) at vertices of values (f, 3) of the faces around them, so that what is round looks round."""
    of_corner = np.repeat(values, np.diff(offsets), axis=0)
    number = np.maximum(np.bincount(corner_verts, minlength=vertices), 1)
    return np.stack([np.bincount(corner_verts, column, vertices) / number for column in of_corner.T], axis=1)


def baked_attributes(
    domain: str, front: NDArray[np.floating], back: NDArray[np.floating] | None = None
) -> Mapping[str, tuple[str, Floats32]]:
    """Attributes of baked light on a domain 'FACE' or 'POINT', in the layout of `buffers.MeshBuffers`.

    ``front`` (n, 3) is the linear radiance of the side to which normals point, ``back`` that of the other; by default
    both are the same.
    """
    back = front if back is None else back
    return {FRONT: (domain, front.astype(np.float32)), BACK: (domain, back.astype(np.float32))}


def _middles(corners: NDArray[np.floating]) -> Floats:
    """Centers of area (m, 3) of quadrilaterals and of triangles that repeat their last corner."""
    triangle = (corners[:, 2] == corners[:, 3]).all(axis=1)[:, None]
    return np.where(triangle, corners[:, :3].mean(axis=1), corners.mean(axis=1))


def baked_light(
    flora: Flora, refinement: Refinement, camera: Camera, sources: Sources, made: SheetList, facets: bool
) -> Generator[float, None, BakedLight]:
    """Render a refined scene from all of its lights; yields the fraction that is done.

    All that is drawn as facets or polygons is in ``made``. Without ``facets``, proxies are clouds in the light instead.
    """
    corners, cell = made.corners(), cell_of_node(refinement)
    replaced = ~np.isin(refinement.decision, (Decision.PROXY, Decision.HIDDEN)) | facets
    replaced &= len(corners) > 0
    clouds = MediumCells.of(flora, refinement, ~replaced)
    inside = np.full(len(corners), -1, np.int64)
    for start in range(0, len(corners), BATCH):
        part = slice(start, start + BATCH)
        inside[part] = cell[refinement.tree.locate(_middles(corners[part].astype(np.float64)))]
    # A leaf that reaches out of all tetrahedra that hold something has no cell; it shadows like the others.
    sheets = replace(SurfaceElements.of(corners, inside, len(clouds)), replaced=replaced)
    yield 0.05
    resolution, near = light_resolution(camera), None
    if len(corners):
        # Ground is drawn into each pixel, sheets only where they are.
        most = GROUND_PIXELS if len(sources.occluders) else OPEN_PIXELS
        resolution = sheets.pixels((resolution // 2, most))
        if resolution == most and camera.kind != "ORTHO":
            away = np.linalg.norm(corners[:, 0] - camera.eye, axis=1)
            radii = (fraction * away.max() for fraction in NEAR_FRACTIONS)
            near = Near(camera.eye, tuple(r for r in radii if (away < r).sum() >= NEAR_SHEETS))
    scene = sources.lights, sources.world, sources.occluders
    found = yield from shadow_steps(clouds, *scene, resolution, sources.ground, sheets=sheets, near=near)
    return BakedLight(found, inside, camera)
