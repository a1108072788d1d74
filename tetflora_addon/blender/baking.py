# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked light in a job: read the lights, collect what is drawn, and give meshes the light that the camera sees."""

from __future__ import annotations

from collections.abc import Generator, Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

from ..baked_emission import AT_ONCE, BakedLight, SheetList, Sources, at_vertices, baked_attributes, baked_light
from ..buffers import MeshBuffers
from ..emission_forms import Refined
from .attributes import read, write
from .compat import tree_in_use
from .light_reader import read_lights
from .material_means import Looks
from .meshes import face_offsets
from .surfaces import read_occluders
from .view_layers import renderable_objects
from .world_reader import read_world

#: Colour of ground whose material cannot be read.
_GROUND = (0.2, 0.2, 0.2)


def read_sources(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, view_layer: bpy.types.ViewLayer | None = None
) -> Sources:
    """Lights, world, and meshes that are marked as hiding plants, which throw shadows and send light up."""
    view_layer = view_layer or depsgraph.view_layer
    world = read_world(scene)
    colours = [_ground_colour(o) for o in renderable_objects(view_layer) if o.tetflora.is_occluder]
    ground = np.mean(colours, axis=0) if colours else np.zeros(3)
    lights = (*read_lights(depsgraph, view_layer), *world.suns)
    return Sources(lights, world.world, read_occluders(scene, depsgraph, view_layer), ground)


def _ground_colour(obj: bpy.types.Object) -> NDArray[np.float64]:
    """Mean colour of a mesh's first material."""
    material = obj.active_material
    if material is None:
        return np.array(Looks().of(None, {}).colour)
    tree = tree_in_use(material)
    nodes = tree.nodes if tree else ()
    if not any(n.type == 'TEX_IMAGE' and n.image is not None for n in nodes):
        # What nodes make of noise nobody can tell but by their ramps.
        stops = [stop.color[:3] for n in nodes if n.type == 'VALTORGB' for stop in n.color_ramp.elements]
        if stops:
            return np.mean(stops, axis=0)
        if any(n.type.startswith(("BSDF", "EMISSION")) and n.inputs[0].is_linked for n in nodes):
            return np.array(_GROUND)
    return np.array(Looks().of(material, {}).colour)


class Baking:
    """Baked light of one refinement: `add` all polygons, then `add_facets`, then `look`.

    Parameters
    ----------
    sources : Sources
    leaves : bool
        Whether real leaves, blossoms and bark get baked light as well.
    """

    def __init__(self, sources: Sources, leaves: bool) -> None:
        self.sources, self.leaves = sources, leaves
        self.sheets = SheetList()
        self.light: BakedLight | None = None
        self.first_facet = 0  # number of the first sheet that stands for a proxy
        self._meshes: list[tuple[bpy.types.Object, int]] = []

    def add(self, made: bpy.types.Object, buffers: MeshBuffers, lit: bool) -> None:
        """A mesh of the results; ``lit`` if it gets baked light when leaves do."""
        if lit and self.leaves:
            self._meshes.append((made, len(self.sheets)))
        self.sheets.add_faces(buffers.positions, buffers.corner_verts, buffers.face_offsets)
        self.first_facet = len(self.sheets)

    def add_facets(self, refined: Refined) -> Iterator[int]:
        """Add the facets of all proxies; yields how many there are so far.

        They are made once more for the meshes, not kept: all of them at once may not fit into memory.
        """
        count = 0
        for parts in refined.facet_parts():
            for facets, _ in parts:
                self.sheets.add_facets(facets)
                count += len(facets)
            yield count

    def look(self, refined: Refined) -> Generator[float, None, None]:
        """Find the light; yields the fraction that is done."""
        scene = refined.flora, refined.refinement, refined.camera
        facets = refined.facet_pixels is not None
        self.light = yield from baked_light(*scene, self.sources, self.sheets, facets)

    def light_meshes(self) -> Iterator[float]:
        """Give meshes their light, each to itself; yields the fraction that is done."""
        for number, (made, first) in enumerate(self._meshes):
            for part in _light_mesh(made.data, self.light, first, rounded=made["tetflora_kind"] == "bark"):
                yield (number + part) / len(self._meshes)


def _light_mesh(mesh: bpy.types.Mesh, light: BakedLight, first: int, rounded: bool) -> Iterator[float]:
    """Write the light of a mesh whose faces are the sheets from ``first`` on; at vertices where it is round."""
    faces = len(mesh.polygons)
    positions, corner_verts, offsets = read(mesh, "position"), read(mesh, ".corner_vert"), face_offsets(mesh)
    colour, transmission = read(mesh, "tf_colour"), read(mesh, "tf_transmission")
    front, back = np.zeros((2, faces, 3), np.float32)
    for start in range(0, faces, AT_ONCE):
        part = slice(start, min(start + AT_ONCE, faces))
        sheets = np.arange(first + part.start, first + part.stop)
        given = offsets[part.start : part.stop + 1], colour[part], transmission[part]
        front[part], back[part] = light.of_faces(positions, corner_verts, *given, sheets)
        yield part.stop / faces
    if rounded:
        front, back = (at_vertices(side, corner_verts, offsets, len(positions)) for side in (front, back))
    for name, (domain, values) in baked_attributes('POINT' if rounded else 'FACE', front, back).items():
        write(mesh, name, values, domain)
