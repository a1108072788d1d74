# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of the shadow pass (paper, section 7): light in tetrahedra, and the radiance of facets and clouds in it.

Every lamp sees the scene through a buffer, and so does the sky from 24 directions, whose samples become harmonics.
Light that tetrahedra scatter to others is gathered in the same 24 buffers, order by order. Further orders are the sum
of the geometric series that the last ones begin. No factor scales any of it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Floats32, Integers
from ..camera.camera import Camera, to_eye
from ..refinement.lights import Light
from ..tetrahedra.geometry import volume
from . import scattering
from .buffers import LightBuffer
from .receivers import MediumCells, SurfaceElements
from .sources import World, arriving

#: Maximum ratio of an order of scattering to the one before: 1 would never end.
_MOST_AGAIN = 0.97
#: Facets that are shaded together; some 1 kB each.
_BATCH = 1 << 16


@dataclass(frozen=True)
class LampBuffers:
    """A lamp and its buffers: one, six all around, or none where nothing blocks its light."""

    light: Light
    buffers: list[LightBuffer]


class Illumination:
    """Light in a scene, as `emission.light.shadow_steps` finds it.

    Attributes
    ----------
    clouds : MediumCells of n
    sheets : SurfaceElements
        What blocks light in place of some of the clouds.
    lamps : list of LampBuffers
        Area lights are several of them.
    ambient : (n, 4, 9, 3) float32
        Light from the sky and from what is lit, at the tetrahedra's key points, by harmonic and color.
    """

    def __init__(
        self,
        clouds: MediumCells,
        sheets: SurfaceElements,
        lamps: list[LampBuffers],
        sky: list[LightBuffer | None],
        world: World,
        fewer: tuple[SurfaceElements, Integers],
    ) -> None:
        self.clouds, self.sheets, self.lamps = clouds, sheets, lamps
        # Sheets of the sky's buffers, and the number that each of ``sheets`` has among them.
        self._sky, self._world, (self._sky_sheets, self._number) = sky, world, fewer
        self._ground = np.zeros(3)
        self.ambient = np.zeros((len(clouds), 4, scattering.HARMONICS, 3), np.float32)

    @property
    def nbytes(self) -> int:
        """Memory of samples and buffers, bytes."""
        buffers = [b for lit in self.lamps for b in lit.buffers] + [b for b in self._sky if b is not None]
        return self.ambient.nbytes + sum(b.nbytes for b in buffers)

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
        for lit in self.lamps:
            toward, light = arriving(lit.light, points)
            if lit.buffers:
                light = light * self._through(lit.buffers, points, cells, toward, sheets)[:, None]
            yield toward, light

    def around(self, points: Floats, cells: Integers) -> Floats:
        """Light from all sides at points, as harmonics (m, 9, 3): sky, and what tetrahedra and polygons scatter.

        Linear between the samples of a tetrahedron's key points (paper, section 7); elsewhere the sky's buffers are
        looked up again. Parameters as for `direct`.
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

    def irradiance(self, points: Floats, normals: Floats) -> Floats:
        """Irradiance (m, 3) of vertices or faces of meshes, with unit normals, on the side of the normals, W/m²."""
        cells = np.full(len(points), -1)
        result = scattering.irradiance(self.around(points, cells), normals)
        for toward, light in self.direct(points, cells):
            result += light * np.maximum(np.sum(normals * toward, axis=1), 0.0)[:, None]
        return result

    def facet_radiance(
        self,
        center: Floats,
        normal: Floats,
        color: Floats,
        transmission: Floats,
        cells: Integers,
        camera: Camera,
        sheets: Integers | None = None,
        dull: Floats | None = None,
    ) -> tuple[Floats32, Floats32]:
        """Outgoing radiance of facets or leaves.

        Parameters
        ----------
        center, normal : (m, 3) float64
            Meters; unit vectors that point to the front.
        color : (m, 3) float64
            Linear RGB.
        transmission : (m,) float64
            Fraction of the scattered light that passes through; 0 for bark.
        cells : (m,) int
            As for `direct`.
        camera : Camera
            For the gloss.
        sheets : (m,) int, optional
            As for `direct`.
        dull : (m,) float64, optional
            Part of the gloss that is lost.

        Returns
        -------
        front, back : (m, 3) float32
            Linear RGB, as a pixel shows it.
        """
        front, back = np.zeros((2, len(center), 3), np.float32)
        for start in range(0, len(center), _BATCH):
            part = slice(start, start + _BATCH)
            hidden = 0.0 if dull is None else dull[part]
            fractions = scattering.scattered_fractions(color[part], transmission[part], hidden)
            view = to_eye(camera, center[part])
            sides = scattering.facet_ambient(normal[part], fractions, self.around(center[part], cells[part]), view)
            on = None if sheets is None else sheets[part]
            for toward, light in self.direct(center[part], cells[part], on):
                added = scattering.facet_direct(normal[part], fractions, toward, light, view)
                sides = sides[0] + added[0], sides[1] + added[1]
            front[part], back[part] = sides
        return front, back

    def cloud_radiance(
        self,
        points: Floats,
        color: Floats,
        transmission: Floats,
        cells: Integers,
        camera: Camera,
        normal: Floats,
        plane: Floats,
    ) -> Floats32:
        """Radiance (m, 3) of microspheres or, the same, of thick clouds around points, as the camera sees them.

        Parameters
        ----------
        points, color, transmission, cells
            As for `facet_radiance`.
        camera : Camera
        normal : (m, 3) float64
            Axis of the plane term; both ways are alike.
        plane : (m,) float64
            Weight of the plane term.
        """
        result = np.zeros((len(points), 3), np.float32)
        for start in range(0, len(points), _BATCH):
            part = slice(start, start + _BATCH)
            fractions = scattering.scattered_fractions(color[part], transmission[part])
            axis, view, around = normal[part], to_eye(camera, points[part]), self.around(points[part], cells[part])
            axis = axis * np.where(np.sum(axis * view, axis=1) < 0.0, -1.0, 1.0)[:, None]
            particles = scattering.particle_ambient(fractions, around, view)
            planes = scattering.facet_ambient(axis, fractions, around, view)[0]
            for toward, light in self.direct(points[part], cells[part]):
                particles += scattering.particle_direct(fractions, toward, light, view)
                planes += scattering.facet_direct(axis, fractions, toward, light, view)[0]
            weight = plane[part][:, None]
            result[part] = (1.0 - weight) * particles + weight * planes
        return result

    def cell_sources(self, camera: Camera) -> Floats32:
        """Radiance J (n, 4, 3) of each tetrahedron at its vertices, were it thick, as the camera sees it.

        The paper's blend of p cos φ and p cos α + s cos^spear β with the light of all lamps; linear between vertices.
        """
        cells = np.repeat(np.arange(len(self.clouds)), 4)
        c = self.clouds
        points, means = c.key_points.reshape(-1, 3), (c.color[cells], c.transmission[cells])
        return self.cloud_radiance(points, *means, cells, camera, c.normal[cells], c.plane[cells]).reshape(-1, 4, 3)

    def scatter(self, ground: Floats, orders: int) -> Iterator[float]:
        """Sample the sky at the key points, then scatter; the last step of `emission.light.shadow_steps`.

        Light is reflected by polygons of color ``ground`` (3,). So many ``orders`` are gathered one by one; the rest
        is their geometric series. Yields the fraction that is done.
        """
        count = len(self.clouds)
        points, cells, sheets, keys = self.sheets.samples(self.clouds)
        up = np.array([[0.0, 0.0, 1.0]])
        bright = scattering.irradiance(self._world.parts.sum(axis=0)[None], up)[0]
        for lit in self.lamps:
            if lit.light.kind == "SUN":
                bright += lit.light.color * max(-lit.light.direction[2], 0.0)
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
        own = np.where(empty, 0.0, self.clouds.own_depth(points, cells, toward))
        owner = np.where(empty, -1, cells) if sheets is None else np.where(sheets < 0, cells, sheets + len(self.clouds))
        result, waiting = np.exp(-own), np.ones(len(points), bool)
        for buffer in buffers:
            some = np.flatnonzero(waiting)
            through, seen = buffer.transmittance(points[some], owner[some], own[some])
            result[some[seen]] = through[seen]
            waiting[some[seen]] = False
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
