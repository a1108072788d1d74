# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of proxies in the engine: buffers, sizes and memory. `results.proxy_kinds` has their labels."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Self

import numpy as np

from ..arrays import Floats
from ..assets.costs import OriginalPolicy
from ..buffers import MeshBuffers, PointBuffers
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..light.illumination import BakedLight, baked_attributes
from ..proxies.microsurfaces import Facets
from ..proxies.primitives import DrawnShapes, joined, shape_buffers, spheres_of, triangles_of
from ..refinement.lights import sun_of
from ..refinement.loop import Refinement
from .asset_plan import AssetPlan, explicit_plan
from .drawing import Drawing, FacetConverter, Parts, drawn_blocks
from .frontier import Shown
from .plants import TOLERANCE, Block, explicit_blocks
from .polygons import FaceRows, PolygonBlock, kept_polygons, polygon_blocks
from .shells import proxy_shells

Buffers = MeshBuffers | PointBuffers


@dataclass(frozen=True)
class EmissionInput:
    """A refined scene, the input of all forms of proxies."""

    flora: Flora
    refinement: Refinement
    camera: Camera
    drawing: Drawing | None = None  # what all is drawn with; None in forms without facets
    tolerance: float = TOLERANCE  # pixels by which the margins of near leaves may be off, in forms without facets
    #: When instances of assets are the originals; None where there are no instances.
    originals: OriginalPolicy | None = None
    disc: float = np.pi  # area that the renderer draws of a sphere of radius 1
    _waiting: list[Parts] = field(default_factory=list, compare=False)
    _shown: list[tuple[int, Shown]] = field(default_factory=list, compare=False)  # with their tiles
    # Of what was made: how many facets are seen, and the sum of their areas over those that the drawing asks for.
    _seen: list[tuple[int, float]] = field(default_factory=list, compare=False)

    @property
    def facet_pixels(self) -> float | None:
        """Side in pixels of facets that are seen, as it came out, after `mesh_blocks`; None in forms without facets."""
        if self.drawing is None:
            return None
        number, area = map(sum, zip((0, 0.0), *self._seen, strict=True))
        scale = self.drawing.camera.pixel_size / self.camera.pixel_size
        return scale * self.drawing.facet * float(np.sqrt(area / number if number else 1.0))

    def mesh_blocks(self) -> Iterator[Block]:
        """Meshes of plants. Facets and what of other things is drawn as it is can be asked for after that."""
        return (block for block in self.tiles(None) if isinstance(block, Block))

    def tiles(self, proxies: Callable[[Self], Iterator[Buffers]] | None) -> Iterator[int | Block | Buffers]:
        """The same with the number of each tile before its meshes, and what becomes of its facets after them."""
        if self.drawing is None:
            yield from explicit_blocks(self.flora, self.refinement, self.camera, self.tolerance)
            return
        self._waiting.clear()
        self._shown.clear()
        self._seen.clear()
        tile = -1
        for drawn in drawn_blocks(self.drawing):
            if isinstance(drawn, Parts):
                self._waiting.append(drawn)
                self._seen.extend((len(facets), drawn.coarser**2 * len(facets)) for facets, seen in drawn if seen)
                yield from () if proxies is None else proxies(self)
            elif isinstance(drawn, tuple):
                self._shown.append((tile, drawn))
            else:
                tile = drawn if isinstance(drawn, int) else tile
                yield drawn
        self._shown.sort(key=lambda one: one[0])

    def polygon_blocks(self) -> Iterator[PolygonBlock]:
        """Polygons of your own meshes that stay, after `mesh_blocks`."""
        if self.drawing is None:
            return polygon_blocks(kept_polygons(self.refinement))
        rows = FaceRows.concatenate([FaceRows.empty(), *(rows for _, (what, rows) in self._shown if what == "face")])
        return polygon_blocks(rows.whole(self.refinement.polygons.meshes))

    def asset_plan(self) -> AssetPlan:
        """Instances of assets that are drawn as they are, after `mesh_blocks`."""
        if self.drawing is None:
            return explicit_plan(self.refinement, self.originals)
        return AssetPlan.of(self.refinement.assets.placed, self.originals, [shown for _, shown in self._shown])

    def facet_parts(self, again: bool = False) -> Iterator[Parts]:
        """Facets, block by block, after `mesh_blocks`; they stay if they will be asked for again."""
        waiting = list(self._waiting)
        if not again:
            self._waiting.clear()
        while waiting:
            yield waiting.pop(0)


@dataclass(frozen=True)
class ProxyEmitter:
    """How one form of proxies becomes buffers."""

    #: Makes the buffers of a `EmissionInput`, for proxies that the renderer lights.
    blocks: Callable[[EmissionInput], Iterator[Buffers]]
    #: Given camera, `EmissionInput.disc` and the way to the sun: what becomes of facets as they are made; None without.
    form: Callable[[Camera, float, Floats | None], FacetConverter] | None = None
    #: The same with baked light, given that light and the number of the first facet in its list of sheets. None:
    #: proxies of this form are always lit by the renderer.
    baked_blocks: Callable[[EmissionInput, BakedLight, int], Iterator[Buffers]] | None = None
    #: Faces per proxy tetrahedron; None where the proxies are facets, whose number follows from Facet Size.
    faces: float | None = None
    #: hidden_block and proxy_block: as in `RefinementSettings`.
    hidden_block: float = math.inf
    proxy_block: float = math.inf

    @property
    def facets(self) -> bool:
        """Whether the proxies are facets, or one sphere for each."""
        return self.faces is None


@dataclass(frozen=True)
class FacetForm:
    """What facets become where they are made: triangles, but spheres where they are seen, where they are not, or both.

    In the fidelity benchmark facets come closer to the plants wherever they are seen. Hidden proxies only cast shadows
    and light other plants; spheres do that as well with a third of the memory.
    """

    camera: Camera
    disc: float
    sun: Floats | None
    spheres: tuple[bool, ...]  # for those that are seen (True), and for those that are not

    def __call__(self, facets: Facets, seen: bool) -> DrawnShapes:
        """Spheres or triangles."""
        if seen not in self.spheres:
            return triangles_of(facets)
        return spheres_of(facets, self.camera if seen else None, self.disc, self.sun)


def facet_blocks(refined: EmissionInput) -> Iterator[Buffers]:
    """Facets as the form of the drawing has made them: triangles, spheres, or triangles where they are seen."""
    for parts in refined.facet_parts():
        for round_ in (False, True):
            shapes = [group for group, _ in parts if (group.radius is not None) == round_]
            if shapes:
                yield replace(shape_buffers(joined(shapes)), species=parts.species, look=parts.look)


def shell_blocks(refined: EmissionInput, light: BakedLight | None = None, _first: int = 0) -> Iterator[MeshBuffers]:
    """Proxies as shells, in one block."""
    shells = proxy_shells(refined.flora, refined.refinement, light)
    if shells is not None:
        yield shells


def baked_facet_blocks(given: EmissionInput, light: BakedLight, first: int, round_: bool = False) -> Iterator[Buffers]:
    """Facets, or a sphere for each, with baked light, in which the first of them is that sheet."""
    form = FacetForm(given.camera, given.disc, sun_of(given.refinement.lights), (True, False) if round_ else ())
    for parts in given.facet_parts():
        facets = joined([group for group, _ in parts])
        sheets = np.arange(first, first + len(facets))
        first += len(facets)
        buffers = shape_buffers(joined([form(group, seen) for group, seen in parts]))
        if round_:
            baked = baked_attributes('POINT', light.of_spheres(facets, sheets))
            values = {name: array for name, (_, array) in baked.items()}
        else:
            values = baked_attributes('FACE', *light.of_facets(facets, sheets))
        yield replace(buffers, attributes={**buffers.attributes, **values}, species=parts.species, look=parts.look)


MICROSURFACES = ProxyEmitter(facet_blocks, partial(FacetForm, spheres=()), baked_facet_blocks)
MICROSPHERES = ProxyEmitter(
    facet_blocks, partial(FacetForm, spheres=(True, False)), partial(baked_facet_blocks, round_=True)
)
#: Facets where they are seen, spheres elsewhere. Where light is baked, all are facets.
AUTOMATIC = ProxyEmitter(facet_blocks, partial(FacetForm, spheres=(False,)), baked_facet_blocks)
#: Shells fill their tetrahedra evenly: hidden ones are divided as well; seen ones further, because their shape shows.
SHELLS = ProxyEmitter(shell_blocks, None, shell_blocks, faces=4.0, hidden_block=16.0, proxy_block=4.0)
