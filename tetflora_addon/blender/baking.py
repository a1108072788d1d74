# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked light in a job: collect what is drawn, and give meshes the light that the camera sees."""

from __future__ import annotations

from collections.abc import Generator, Iterator

import bpy
import numpy as np

from ..baked_emission import AT_ONCE, BakedLight, SheetList, Sources, at_vertices, baked_attributes, baked_light
from ..buffers import MeshBuffers
from ..emission_forms import Refined
from .attributes import read, write
from .meshes import face_offsets


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
