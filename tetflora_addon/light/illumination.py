# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked light: the radiance of a refined scene as the camera sees it, without a renderer (paper, section 7).

All surfaces that will be drawn are collected first, as sheets (`SheetList`). `baked_light` then renders them from each
light, which is the paper's shadow pass, and `BakedLight` gives the light of facets, spheres, shells and faces.

Every lamp sees the scene through a buffer, and so does the sky from 24 directions, whose samples become harmonics.
Light that tetrahedra scatter to others is gathered in the same 24 buffers, order by order. Further orders are the sum
of the geometric series that the last ones begin. No factor scales any of it.
"""

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays, Floats, Floats32, Integers
from ..camera.camera import Camera, to_eye
from ..compiled.flora import Flora
from ..parallel import blocks
from ..proxies.microsurfaces import Facets
from ..refinement.decisions import Decision
from ..refinement.lights import Light
from ..refinement.loop import Refinement
from ..tetrahedra.geometry import volume
from . import scattering
from .buffers import LightBuffer
from .receivers import MediumCells, SurfaceElements, numbers_of
from .scattering import DIRECTIONS
from .sources import Near, World, arriving, buffers_of, light_resolution, split_areas

#: Maximum ratio of an order of scattering to the one before: 1 would never end.
_MOST_AGAIN = 0.97
#: Facets and faces whose light is computed together; some 2 kB each.
BATCH = 1 << 16


@dataclass(frozen=True)
class Surfaces(Arrays):
    """Surfaces (m) in the light: facets, leaves and faces, or clouds around points."""

    center: Floats  # (m, 3): meters
    normal: Floats  # (m, 3): unit vectors that point to the front
    color: Floats  # (m, 3): linear RGB
    transmission: Floats  # (m,): fraction of the scattered light that passes through; 0 for bark
    cell: Integers  # (m,): tetrahedron (index into the clouds) that holds each, −1 for none
    sheet: Integers | None = None  # (m,): sheet (index) on which each lies, which does not shadow it
    dull: Floats | None = None  # (m,): part of the gloss that is lost; None for 0


#: A lamp and its buffers: one, six all around, or none where nothing blocks its light.
Lamp = tuple[Light, list[LightBuffer]]


class Illumination:
    """Light in a scene, as `_shadow_steps` finds it.

    Attributes
    ----------
    clouds : MediumCells of n
    sheets : SurfaceElements
        What blocks light in place of some of the clouds.
    lamps : list of Lamp
        Area lights are several of them.
    ambient : (n, 4, 9, 3) float32
        Light from the sky and from what is lit, at the tetrahedra's key points, by harmonic and color.
    """

    def __init__(
        self,
        clouds: MediumCells,
        sheets: SurfaceElements,
        lamps: list[Lamp],
        sky: list[LightBuffer | None],
        world: World,
        fewer: tuple[SurfaceElements, Integers],
    ) -> None:
        self.clouds, self.sheets, self.lamps = clouds, sheets, lamps
        # Sheets of the sky's buffers, and the number that each of ``sheets`` has among them.
        self._sky, self._world, (self._sky_sheets, self._number) = sky, world, fewer
        self._ground = np.zeros(3)
        self.ambient = np.zeros((len(clouds), 4, scattering.HARMONICS, 3), np.float32)

    def direct(
        self, points: Floats, cells: Integers, sheets: Integers | None = None
    ) -> Iterator[tuple[Floats, Floats]]:
        """Light of each lamp at points.

        Parameters
        ----------
        points : (m, 3) float64
            Meters.
        cells : (m,) int
            Tetrahedron (index into the clouds) that holds each, −1 for none.
        sheets : (m,) int, optional
            Sheet (index) on which each lies, which does not shadow it.

        Yields
        ------
        toward : (m, 3) float64
            Unit vectors to the lamp.
        irradiance : (m, 3) float64
            W/m² that arrive on a surface that faces it, shadows included.
        """
        for lamp, buffers in self.lamps:
            toward, light = arriving(lamp, points)
            if buffers:
                light = light * self._through(buffers, points, cells, toward, sheets)[:, None]
            yield toward, light

    def around(self, points: Floats, cells: Integers) -> Floats:
        """Light from all sides at points, as harmonics (m, 9, 3): sky, and what tetrahedra and polygons scatter.

        Linear between samples at key points (paper, section 7), else by the sky's buffers. See `direct`.
        """
        result = np.zeros((len(points), scattering.HARMONICS, 3))
        inside = np.flatnonzero(cells >= 0)
        weights = self.clouds.weights(points[inside], cells[inside])
        result[inside] = np.einsum("mk,mkhc->mhc", weights, self.ambient[cells[inside]])
        outside = np.flatnonzero(cells < 0)
        if len(outside):
            none = np.full(len(outside), -1)
            result[outside] = self._from_sky(points[outside], none) + self._from_clouds(points[outside])
        return result

    def facet_radiance(self, surfaces: Surfaces, camera: Camera) -> tuple[Floats32, Floats32]:
        """Radiance (m, 3) of fronts and backs of facets or leaves as a pixel shows it; the camera is for the gloss."""
        front, back = np.zeros((2, len(surfaces), 3), np.float32)
        for part in blocks(len(surfaces), BATCH):
            batch = surfaces.take(part)
            hidden = 0.0 if batch.dull is None else batch.dull
            fractions = scattering.scattered_fractions(batch.color, batch.transmission, hidden)
            view = to_eye(camera, batch.center)
            sides = scattering.facet_ambient(batch.normal, fractions, self.around(batch.center, batch.cell), view)
            for toward, light in self.direct(batch.center, batch.cell, batch.sheet):
                added = scattering.facet_direct(batch.normal, fractions, toward, light, view)
                sides = sides[0] + added[0], sides[1] + added[1]
            front[part], back[part] = sides
        return front, back

    def cloud_radiance(self, surfaces: Surfaces, camera: Camera, plane: Floats) -> Floats32:
        """Radiance (m, 3) of microspheres or, the same, of thick clouds around points, as the camera sees them.

        ``plane`` (m,) is the weight of the plane term, whose axis is the normal; both ways are alike.
        """
        result = np.zeros((len(surfaces), 3), np.float32)
        for part in blocks(len(surfaces), BATCH):
            batch, weight = surfaces.take(part), plane[part, None]
            fractions = scattering.scattered_fractions(batch.color, batch.transmission)
            view, around = to_eye(camera, batch.center), self.around(batch.center, batch.cell)
            axis = batch.normal * np.where(np.sum(batch.normal * view, axis=1) < 0.0, -1.0, 1.0)[:, None]
            particles = scattering.particle_ambient(fractions, around, view)
            planes = scattering.facet_ambient(axis, fractions, around, view)[0]
            for toward, light in self.direct(batch.center, batch.cell):
                particles += scattering.particle_direct(fractions, toward, light, view)
                planes += scattering.facet_direct(axis, fractions, toward, light, view)[0]
            result[part] = (1.0 - weight) * particles + weight * planes
        return result

    def cell_sources(self, camera: Camera) -> Floats32:
        """Radiance J (n, 4, 3) of each tetrahedron at its vertices, were it thick, as the camera sees it.

        The paper's blend of p cos φ and p cos α + s cos^spear β with the light of all lamps; linear between vertices.
        """
        cells, c = np.repeat(np.arange(len(self.clouds)), 4), self.clouds
        look = c.normal[cells], c.color[cells], c.transmission[cells]
        around = Surfaces(c.key_points.reshape(-1, 3), *look, cells)
        return self.cloud_radiance(around, camera, c.plane[cells]).reshape(-1, 4, 3)

    def scatter(self, ground: Floats, orders: int) -> Iterator[float]:
        """Sample the sky at the key points, then scatter; the last step of `_shadow_steps`.

        Light is reflected by polygons of color ``ground`` (3,). So many ``orders`` are gathered one by one; the rest
        is their geometric series. Yields the fraction that is done.
        """
        count = len(self.clouds)
        points, cells, sheets, keys = self.sheets.samples(self.clouds)
        bright = scattering.irradiance(self._world.parts.sum(axis=0)[None], np.array([[0.0, 0.0, 1.0]]))[0]
        for lamp, _ in self.lamps:
            if lamp.kind == "SUN":
                bright += lamp.color * max(-lamp.direction[2], 0.0)
        self._ground = np.asarray(ground, np.float64) * bright / np.pi
        if not count:
            return
        sky = keys.means(self._from_sky(points, cells, sheets))
        yield 1.0 / (orders + 1)
        first = scattering.fluence(sky)
        for _, light in self.direct(points, cells, sheets):
            first += keys.means(light)
        gathered = last = np.zeros_like(sky)
        for order in range(orders):
            passing = keys.by_cell(first + scattering.fluence(gathered))
            self._shine(self.clouds.albedo * passing / (4.0 * np.pi))
            before, every = last, keys.means(self._from_clouds(points))
            last, gathered = every - gathered, every
            if order == orders - 1:
                ratio = self._again(scattering.fluence(before), scattering.fluence(last))
                gathered = gathered + last * (ratio / (1.0 - ratio))
            yield (order + 2.0) / (orders + 1)
        passing = keys.by_cell(first + scattering.fluence(gathered))
        self._shine(self.clouds.albedo * passing / (4.0 * np.pi))
        self.ambient[:] = (sky + gathered).reshape(count, 4, scattering.HARMONICS, 3)

    def _again(self, before: Floats, last: Floats) -> Floats:
        """Ratio (3,) of each further order of scattering to the one before, from two: means over all surfaces."""
        c = self.clouds
        weight = np.repeat(np.sqrt(np.maximum(c.matrices[:, :3].sum(axis=1), 0.0)) * volume(c.vertices), 4)
        former = weight @ before
        return np.clip((weight @ last) / np.where(former > 0.0, former, np.inf), 0.0, _MOST_AGAIN)

    def _through(
        self, buffers: list[LightBuffer], points: Floats, cells: Integers, toward: Floats, sheets: Integers | None
    ) -> Floats:
        """Transmittance (m,) through the first of several views that sees each point."""
        empty = np.append(self.sheets.replaced, True)[cells]
        depth = np.where(empty, 0.0, self.clouds.own_depth(points, cells, toward))
        owner = np.where(empty, -1, cells) if sheets is None else np.where(sheets < 0, cells, sheets + len(self.clouds))
        result, waiting = np.exp(-depth), np.ones(len(points), bool)
        for buffer in buffers:
            rows = np.flatnonzero(waiting)
            through, seen = buffer.transmittance(points[rows], owner[rows], depth[rows])
            result[rows[seen]] = through[seen]
            waiting[rows[seen]] = False
        return result

    def _from_sky(self, points: Floats, cells: Integers, sheets: Integers | None = None) -> Floats:
        """Light of the sky (m, 9, 3) that nothing blocks."""
        result = np.zeros((len(points), scattering.HARMONICS, 3))
        if self._world.dark:
            return result
        if sheets is not None:
            sheets = np.append(self._number, -1)[sheets]
        for part, buffer, toward in zip(self._world.parts, self._sky, scattering.DIRECTIONS, strict=True):
            through = np.ones(len(points))
            if buffer is not None:
                through = self._through([buffer], points, cells, toward, sheets)
            result += through[:, None, None] * part
        return result

    def _shine(self, sources: Floats) -> None:
        """Let tetrahedra and their sheets emit their radiance (n, 3)."""
        emitted = np.concatenate([sources, sources[self._sky_sheets.cell]])
        for buffer in self._sky:
            if buffer is not None:
                buffer.light_up(emitted, self._ground)

    def _from_clouds(self, points: Floats) -> Floats:
        """Light (m, 9, 3) that tetrahedra and polygons scatter."""
        result = np.zeros((len(points), scattering.HARMONICS, 3))
        for buffer, toward in zip(self._sky, scattering.DIRECTIONS, strict=True):
            if buffer is not None:
                light = buffer.scattered(points)
                result += scattering.harmonics(toward)[:, None] * light[:, None, :] * scattering.SOLID_ANGLE
        return result


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
#: Maximum longer side in pixels of a lamp's buffer, with ground in it and without.
GROUND_PIXELS, OPEN_PIXELS = 1024, 4096
#: Suns have own views of what is nearer than these fractions of the distance to the farthest leaf, of so many sheets.
NEAR_FRACTIONS, NEAR_SHEETS = (1 / 32, 1 / 8), 1000


@dataclass(frozen=True)
class Sources:
    """Lights and opaque polygons of a scene."""

    lights: Sequence[Light]
    world: World
    occluders: Floats  # (t, 3, 3): triangles of ground and buildings, meters
    ground: Floats  # (3,): their mean color, linear, which lights crowns from below

    def counted_from(self, origin: Floats) -> Self:
        """The same in coordinates that begin at a place (3,) of the present ones."""
        lights = tuple(light.counted_from(origin) for light in self.lights)
        return replace(self, lights=lights, occluders=self.occluders - origin)


def _shadow_steps(
    clouds: MediumCells,
    sources: Sources,
    resolution: int = 512,
    sheets: SurfaceElements | None = None,
    near: Near | None = None,
    orders: int = ORDERS,
) -> Generator[float, None, Illumination]:
    """Render a scene from all of its lights; yields the fraction that is done.

    Penumbras of the sun and of lamps that are no areas are as sharp as the buffer, whose longer side has so many
    pixels; the sky's are `SKY_FRACTION` of it. Clumps of sheets shadow themselves, as no even cloud does. So many
    orders of scattering, at least 1, are gathered one by one.
    """
    sheets = SurfaceElements.none(len(clouds)) if sheets is None else sheets
    lamps, split, occluders = [], split_areas(tuple(sources.lights)), sources.occluders
    for number, light in enumerate(split):
        buffers = buffers_of(light, clouds, sheets, occluders, resolution, near) if light.shadow else []
        lamps.append((light, buffers))
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
    illumination = Illumination(clouds, sheets, lamps, sky, sources.world, (fewer, number))
    for fraction in illumination.scatter(sources.ground, max(orders, 1)):
        yield 0.6 + 0.4 * fraction
    return illumination


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
        look = facets.color, facets.transmission, self.cell[sheets], sheets, facets.dull
        return self.illumination.facet_radiance(Surfaces(facets.center, facets.normal, *look), self.camera)

    def of_spheres(self, facets: Facets, sheets: Integers) -> NDArray:
        """Radiance (n, 3) of spheres in the place of facets, which are these sheets (n,) of the list.

        A sphere covers what its facet covers for the camera, and shows what the camera would see of the facet.
        """
        front, back = self.of_facets(facets, sheets)
        toward = np.sum(facets.normal * to_eye(self.camera, facets.center), axis=1) > 0.0
        return np.where(toward[:, None], front, back)

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
        look = color.astype(np.float64), transmission.astype(np.float64), self.cell[sheets], sheets
        return self.illumination.facet_radiance(Surfaces(_middles(corners), normal, *look), self.camera)


def at_vertices(values: NDArray[np.floating], corner_verts: NDArray, offsets: NDArray, vertices: int) -> NDArray:
    """Means (v, 3) at vertices of values (f, 3) of the faces around them, so that what is round looks round."""
    of_corner = np.repeat(values, np.diff(offsets), axis=0)
    number = np.maximum(np.bincount(corner_verts, minlength=vertices), 1)
    return np.stack([np.bincount(corner_verts, column, vertices) / number for column in of_corner.T], axis=1)


def baked_attributes(
    domain: str, front: NDArray[np.floating], back: NDArray[np.floating] | None = None
) -> Mapping[str, tuple[str, Floats32]]:
    """Attributes of baked light on a domain 'FACE' or 'POINT', in the layout of `buffers.MeshBuffers`.

    ``front`` (n, 3) is the linear radiance of the side to which normals point, ``back`` that of the other, or the same.
    """
    back = front if back is None else back
    return {FRONT: (domain, front.astype(np.float32)), BACK: (domain, back.astype(np.float32))}


def _middles(corners: NDArray[np.floating]) -> Floats:
    """Centers of area (m, 3) of quadrilaterals and of triangles that repeat their last corner."""
    triangle = (corners[:, 2] == corners[:, 3]).all(axis=1)[:, None]
    return np.where(triangle, corners[:, :3].mean(axis=1), corners.mean(axis=1))


def baked_light(
    flora: Flora, refinement: Refinement, camera: Camera, sources: Sources, drawn: SheetList, facets: bool
) -> Generator[float, None, BakedLight]:
    """Render a refined scene from all of its lights; yields the fraction that is done.

    What is drawn as facets or polygons is in ``drawn``. Without ``facets``, proxies are clouds in the light instead.
    """
    corners, cell = drawn.corners(), numbers_of(refinement, refinement.nodes)
    replaced = ~np.isin(refinement.decision, (Decision.PROXY, Decision.HIDDEN)) | facets
    replaced &= len(corners) > 0
    clouds = MediumCells.of(flora, refinement, refinement.nodes, ~replaced)
    inside = np.full(len(corners), -1, np.int64)
    for part in blocks(len(corners), BATCH):
        inside[part] = cell[refinement.tree.locate(_middles(corners[part].astype(np.float64)))]
    # A leaf that reaches out of all tetrahedra that hold something has no cell; it shadows like the others.
    sheets = SurfaceElements(corners, np.maximum(inside, 0), replaced)
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
    illumination = yield from _shadow_steps(clouds, sources, resolution, sheets, near)
    return BakedLight(illumination, inside, camera)
