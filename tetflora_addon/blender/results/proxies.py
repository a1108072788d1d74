# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Proxies of a refinement as objects, in the scene's form, and baked light of proxies and meshes."""

from collections.abc import Callable, Generator, Iterator, Mapping
from itertools import count

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats32, Integers32
from ...buffers import MeshBuffers, PointBuffers
from ...emission.asset_plan import ASSETS
from ...emission.emitters import Buffers, EmissionInput
from ...jobs import Progress
from ...light.illumination import BATCH, BakedLight, SheetList, Sources, at_vertices, baked_attributes, baked_light
from ...refinement.loop import Statistics
from ..attributes import face_offsets, read, write
from ..materials.nodes import find_socket, is_ours
from ..worker import calling, in_thread
from .collection import Results
from .output import KIND
from .proxy_kinds import ProxyKind, proxy_kind_of


class Baking:
    """Baked light of one refinement, of leaves and bark too where asked: `add` all polygons, `add_facets`, `look`."""

    def __init__(self, sources: Sources, leaves: bool) -> None:
        self.sources, self.leaves = sources, leaves
        self.sheets = SheetList()
        self.light: BakedLight | None = None
        self.first_facet = 0  # number of the first sheet that stands for a proxy
        self._meshes: list[tuple[bpy.types.Object, int]] = []

    def add(self, obj: bpy.types.Object, buffers: MeshBuffers, lit: bool) -> None:
        """A mesh of the results; ``lit`` if it gets baked light when leaves do."""
        if lit and self.leaves:
            self._meshes.append((obj, len(self.sheets)))
        self.sheets.add_faces(buffers.positions, buffers.corner_verts, buffers.face_offsets)
        self.first_facet = len(self.sheets)

    def add_facets(self, refined: EmissionInput) -> Iterator[int]:
        """Add the facets of all proxies, to be written with their light later; yields how many there are so far."""
        count = 0
        for parts in refined.facet_parts(again=True):
            for facets, _ in parts:
                self.sheets.add_facets(facets)
                count += len(facets)
            yield count

    def look(self, refined: EmissionInput) -> Generator[float, None, None]:
        """Compute the light; yields the fraction that is done."""
        scene = refined.flora, refined.refinement, refined.camera
        self.light = yield from baked_light(*scene, self.sources, self.sheets, refined.facet_pixels is not None)

    def light_meshes(self) -> Generator[float | None, None, None]:
        """Write the light of meshes; yields the fraction that is done, and None while a thread computes."""
        for number, (obj, first) in enumerate(self._meshes):
            mesh = obj.data
            stored = [read(mesh, name) for name in ("position", ".corner_vert", "tf_color", "tf_transmission")]
            given = self.light, first, obj[KIND] == "bark", face_offsets(mesh), stored
            attributes = yield from in_thread(calling(_light_of_mesh, *given))
            for name, (domain, values) in attributes.items():
                write(mesh, name, values, domain)
            yield (number + 1) / len(self._meshes)


def _light_of_mesh(
    light: BakedLight, first: int, rounded: bool, offsets: Integers32, stored: list[NDArray]
) -> Mapping[str, tuple[str, Floats32]]:
    """Attributes of a mesh whose faces are the sheets from ``first`` on: its light, at vertices where it is round."""
    (positions, corner_verts, color, transmission), faces = stored, len(offsets) - 1
    front, back = np.zeros((2, faces, 3), np.float32)
    for start in range(0, faces, BATCH):
        part = slice(start, min(start + BATCH, faces))
        sheets = np.arange(first + part.start, first + part.stop)
        given = offsets[part.start : part.stop + 1], color[part], transmission[part]
        front[part], back[part] = light.of_faces(positions, corner_verts, *given, sheets)
    if rounded:
        front, back = (at_vertices(side, corner_verts, offsets, len(positions)) for side in (front, back))
    return baked_attributes('POINT' if rounded else 'FACE', front, back)


ProxyWriter = Callable[[Buffers], Generator[None, None, Progress]]


def proxy_writer(
    results: Results, form: ProxyKind, refined: EmissionInput, statistics: Statistics, baked: bool = False
) -> ProxyWriter:
    """What makes objects of proxies, numbered by tile or in order; the statistics get faces or points, and memory."""
    numbers = count()

    def write(buffers: Buffers) -> Generator[None, None, Progress]:
        number, of_assets = next(numbers), buffers.species == ASSETS
        species = None if buffers.species is None or of_assets else refined.flora.species[buffers.species]
        look = buffers.look or results.look_of(buffers.species)
        if baked:
            material = form.baked_material()
        else:
            kinds = (
                (form.asset_material, form.asset_point_material) if of_assets else (form.material, form.point_material)
            )
            material = kinds[isinstance(buffers, PointBuffers)]()
            set_sockets(material, results.scene, form.sockets)
        suffix = number if results.tile is None else results.tile
        name = f"{'TetFlora' if species is None else species.name} proxies {suffix:03d}"
        yield from results.add(name, "proxy", buffers, [material], species, look)
        statistics.polygons_proxy += buffers.polygons
        statistics.memory_mb += buffers.nbytes / 1e6
        return Progress(1.0 - 0.05 * 0.9**number, f"Making proxies: {statistics.polygons_proxy:,}")

    return write


def set_sockets(material: bpy.types.Material, scene: bpy.types.Scene, sockets: Mapping[str, str]) -> None:
    """Set sockets of a material's group to the scene's settings, see `ProxyKind`; the artist's own changes stay."""
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
    sockets = proxy_kind_of(scene).sockets
    if not sockets or scene.tetflora.baked_light != 'OFF':
        return
    proxies = [obj for obj in collection.objects if obj.get(KIND) == "proxy"]
    for material in {material for obj in proxies for material in obj.data.materials if material is not None}:
        set_sockets(material, scene, sockets)
