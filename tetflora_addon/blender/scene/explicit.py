# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's own objects that take part in refinement (``tetflora.is_explicit``): other trees, rocks, scans.

All evaluated surfaces count. An object that collections or nodes instance takes part with every instance, and so does
everything else that such an instancer shows, because an instancer can only be hidden as a whole. What an object shows
whose scatter is refined counts as assets instead.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...arrays import Floats, Floats32, Integers32
from ...assets.patches import mesh_features
from ...errors import SceneError
from ...refinement.polygons import Meshes, Surface
from ..attributes import face_offsets, members, mesh_of, read, values_of, world_matrix
from ..materials.face_looks import Looks
from ..materials.nodes import is_ours
from .looks import LayerLooks
from .objects import SURFACE_TYPES, materials_of, may_instance, renderable_objects, scatters

#: Transmission of sheets whose material leaves it open.
_SHEET_TRANSMISSION = 0.3
_TYPES = {'FLOAT', 'FLOAT2', 'FLOAT_VECTOR', 'FLOAT_COLOR', 'BYTE_COLOR'}
_OWN = {"position", "custom_normal"}


@dataclass(frozen=True)
class Explicit:
    """Explicit polygons of a scene."""

    meshes: Meshes
    materials: list[list[bpy.types.Material | None]]  # slots of each surface
    originals: list[bpy.types.Object]  # whose place the refined polygons take


def read_explicit(depsgraph: bpy.types.Depsgraph) -> Explicit | None:
    """Polygons of all marked objects of a view layer that render, and of their instances; None where there are none.

    Raises
    ------
    SceneError
        A marked object without faces, with invalid numbers, or linked and not to be hidden; the message names it.
    """
    if not any(o.tetflora.is_explicit for o in bpy.data.objects):
        return None
    rendered = set(renderable_objects(depsgraph.view_layer))
    marked = {o for o in rendered if o.tetflora.is_explicit}
    wanted = marked | _instancers_of_marked(rendered, depsgraph)
    if not wanted:
        return None
    reader, looks, owners = _Reader(), LayerLooks(depsgraph.view_layer), set()
    for instance in depsgraph.object_instances:
        owner = instance.parent.original if instance.is_instance else instance.object.original
        if owner not in wanted or not instance.show_self or instance.object.type not in SURFACE_TYPES:
            continue
        if instance.is_instance and (_unseen(instance) or scatters(owner)):
            continue
        look = looks.of(instance.object.original, owner if instance.is_instance else None, model=True)
        if reader.add(instance.object, np.array(instance.matrix_world, dtype=np.float64), look):
            owners.add(owner)
    # Objects whose eye is closed are listed nowhere; what a collection disables in viewports comes without modifiers.
    for obj in sorted(marked - owners, key=lambda o: o.name_full):
        unseen = obj.type in SURFACE_TYPES and not obj.visible_get(view_layer=depsgraph.view_layer)
        if unseen and reader.add(obj.evaluated_get(depsgraph), world_matrix(obj, depsgraph), looks.of(obj, model=True)):
            owners.add(obj)
        else:
            remedy = "add faces, or turn off Refine This Mesh in Properties > Object"
            raise SceneError(f'"{obj.name}" has no faces to refine; {remedy}')
    for obj in sorted(owners, key=lambda o: o.name_full):
        if obj.library is not None:
            raise SceneError(
                f'"{obj.name}" is linked, so it cannot be hidden while results replace it; choose '
                "Object > Relations > Make Local, or Object > Library Override > Make"
            )
    try:
        meshes = Meshes(reader.surfaces, np.array(reader.surface), np.array(reader.matrices))
    except ValueError as error:
        raise SceneError(str(error)) from error
    return Explicit(meshes, reader.materials, sorted(owners, key=lambda o: o.name_full))


def _instancers_of_marked(rendered: set[bpy.types.Object], depsgraph: bpy.types.Depsgraph) -> set[bpy.types.Object]:
    """Objects that show instances of marked ones."""
    if not any(may_instance(o) or len(o.particle_systems) for o in rendered):
        return set()
    instances = (instance for instance in depsgraph.object_instances if instance.is_instance)
    marked = (one for one in instances if one.object.original.tetflora.is_explicit and not _unseen(one))
    owners = {one.parent.original for one in marked}
    return {owner for owner in owners if owner in rendered and not scatters(owner)}


def _unseen(instance: bpy.types.DepsgraphObjectInstance) -> bool:
    """Whether an instance does not render: collections leave out what is hidden in renders, nodes do not."""
    return instance.object.original.hide_render and instance.parent.original.instance_type == 'COLLECTION'


class _Reader:
    """Collects surfaces, each mesh with its materials once, and instances of them."""

    def __init__(self) -> None:
        self.surfaces: list[Surface] = []
        self.materials: list[list[bpy.types.Material | None]] = []
        self.surface: list[int] = []
        self.matrices: list[Floats] = []
        self._known: dict[tuple, int | None] = {}
        self._looks = Looks()

    def add(self, obj: bpy.types.Object, matrix: Floats, look: str) -> bool:
        """Take an evaluated object, or an original that is not evaluated; False if it has no faces."""
        names = tuple(slot.material.name_full for slot in obj.material_slots if slot.link == 'OBJECT' and slot.material)
        key = obj.data.as_pointer(), obj.type, names, obj.original.as_pointer() if obj.type != 'MESH' else 0, look
        if key not in self._known:
            self._known[key] = self._read(obj, look)
        number = self._known[key]
        if number is None or is_ours(obj.original):
            return False
        self.surface.append(number)
        self.matrices.append(matrix)
        return True

    def _read(self, obj: bpy.types.Object, look: str) -> int | None:
        with mesh_of(obj) as mesh:
            if mesh is None or not len(mesh.polygons):
                return None
            materials = materials_of(obj, mesh)
            self.surfaces.append(replace(_surface(obj.original.name, mesh, materials, self._looks), look=look))
        self.materials.append(materials)
        return len(self.surfaces) - 1


def _surface(name: str, mesh: bpy.types.Mesh, materials: list[bpy.types.Material | None], looks: Looks) -> Surface:
    mesh.calc_loop_triangles()
    positions = read(mesh, "position").astype(np.float64)
    if not np.isfinite(positions).all():
        raise SceneError(f'"{name}" has vertices that are not finite numbers; delete them')
    corners, offsets = read(mesh, ".corner_vert"), face_offsets(mesh)
    triangles = members(mesh.loop_triangles, "loops", 3, np.int32)
    slot = np.clip(members(mesh.polygons, "material_index", dtype=np.int32), 0, len(materials) - 1)
    attributes = dict(_attributes(mesh, corners, np.diff(offsets)))
    solid, leaf, width = mesh_features(positions, corners, offsets)
    seen = [looks.of(material, attributes) for material in materials]
    transmission = np.array([look.transmission for look in seen], np.float64)
    # Unknown transmission: light goes through a material whose faces are mostly sheets.
    sheets = np.bincount(slot, ~solid, len(seen)) * 2 > np.bincount(slot, minlength=len(seen))
    transmission = np.where(np.isnan(transmission), np.where(sheets, _SHEET_TRANSMISSION, 0.0), transmission)
    sharp = mesh.attributes.get("sharp_face")
    smooth = sharp is None or not values_of(sharp).all()
    normals = members(mesh.corner_normals, "vector", 3) if smooth else None
    colors, coverage = (np.array([getattr(look, of) for look in seen], np.float64) for of in ("color", "coverage"))
    of_slots = slot, colors, transmission, coverage
    return Surface(name, positions, corners, offsets, triangles, *of_slots, solid, leaf, width, attributes, normals)


def _attributes(mesh: bpy.types.Mesh, corner_verts: Integers32, sizes: Integers32) -> Iterator[tuple[str, Floats32]]:
    """Attributes of floating point numbers at corners (c, k), the UV map that renders first."""
    first = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    for attribute in sorted(mesh.attributes, key=lambda a: a.name != first):
        if attribute.name.startswith(".") or attribute.name in _OWN or attribute.data_type not in _TYPES:
            continue
        if attribute.domain not in {'POINT', 'CORNER', 'FACE'}:
            continue
        values = values_of(attribute, "color" if "COLOR" in attribute.data_type else "")
        values = values[:, None] if values.ndim == 1 else values[:, :3]
        if attribute.domain == 'POINT':
            values = values[corner_verts]
        elif attribute.domain == 'FACE':
            values = np.repeat(values, sizes, axis=0)
        yield attribute.name, np.ascontiguousarray(values)
