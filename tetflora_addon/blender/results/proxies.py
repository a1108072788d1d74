# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Proxies of a refinement as objects, in the scene's form, and baked light of proxies and meshes."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping

import bpy
import numpy as np

from ...buffers import MeshBuffers, PointBuffers
from ...emission.forms import Refined
from ...emission.light import AT_ONCE, BakedLight, SheetList, Sources, at_vertices, baked_attributes, baked_light
from ...refinement.statistics import Statistics
from ..attributes import face_offsets, read, write
from ..materials.nodes import find_socket, is_ours
from .collection import Results
from .forms import ProxyForm, form_of
from .output import KIND


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

        They are made again for the meshes: all of them at once may not fit into memory.
        """
        count = 0
        for parts in refined.facet_parts():
            for facets, _ in parts:
                self.sheets.add_facets(facets)
                count += len(facets)
            yield count

    def look(self, refined: Refined) -> Generator[float, None, None]:
        """Compute the light; yields the fraction that is done."""
        scene = refined.flora, refined.refinement, refined.camera
        facets = refined.facet_pixels is not None
        self.light = yield from baked_light(*scene, self.sources, self.sheets, facets)

    def light_meshes(self) -> Iterator[float]:
        """Write the light of meshes; yields the fraction that is done."""
        for number, (made, first) in enumerate(self._meshes):
            for part in _light_mesh(made.data, self.light, first, rounded=made[KIND] == "bark"):
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


def write_proxies(
    results: Results, form: ProxyForm, refined: Refined, statistics: Statistics, baking: Baking | None = None
) -> Generator[float, None, None]:
    """Make the proxies of a refined scene.

    Parameters
    ----------
    results : Results
    form : ProxyForm
    refined : Refined
    statistics : Statistics
        Gets the number of faces or points, and their memory.
    baking : Baking, optional
        With the light of proxies. Their facets must have been added last.

    Yields
    ------
    float
        Estimated fraction that is done.
    """
    scene, emission = results.scene, form.emission
    baked = baking is not None and emission.baked_blocks is not None
    blocks = emission.baked_blocks(refined, baking.light, baking.first_facet) if baked else emission.blocks(refined)
    statistics.facet_pixels = refined.facet_pixels or 0.0
    for number, buffers in enumerate(blocks):
        points = isinstance(buffers, PointBuffers)
        material = form.baked_material if baked else form.point_material if points else form.material
        made = material()
        if not baked:
            set_sockets(made, scene, form.sockets)
        species = None if buffers.species is None else refined.flora.species[buffers.species]
        name = f"{'TetFlora' if species is None else species.name} proxies {number:03d}"
        add = results.add_points if points else results.add
        add(name, "proxy", buffers, [made], species)
        statistics.polygons_proxy += buffers.polygons
        statistics.memory_mb += buffers.nbytes / 1e6
        yield 1 - 0.9**number


def set_sockets(material: bpy.types.Material, scene: bpy.types.Scene, sockets: Mapping[str, str]) -> None:
    """Set sockets of a material's group to the scene's settings, see `ProxyForm`; the artist's own changes stay."""
    if not sockets or not is_ours(material) or material.node_tree is None:
        return
    for node in material.node_tree.nodes:
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None and is_ours(node.node_tree):
            for name, identifier in sockets.items():
                value = getattr(scene.tetflora, identifier)
                if name in node.inputs and find_socket(node.inputs, name).default_value != value:
                    find_socket(node.inputs, name).default_value = value


def shade_again(scene: bpy.types.Scene, collection: bpy.types.Collection) -> None:
    """`set_sockets` for results from the frame cache, which share their material with later ones."""
    sockets = form_of(scene).sockets
    if not sockets or scene.tetflora.baked_light != 'OFF':
        return
    proxies = [obj for obj in collection.objects if obj.get(KIND) == "proxy"]
    for material in {material for obj in proxies for material in obj.data.materials if material is not None}:
        set_sockets(material, scene, sockets)
