# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Looks of faces whose materials only Cycles knows: baked, in a scene of its own that is gone afterwards.

Each triangle gets a block of an image. Shaders of a copy of the material become lamps that shine with what is asked
for, so that mixes, groups and patterns count as they are: once with the colour, and once with the coverage and what
goes through.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..attributes import image_pixels, values_of, write
from ..compat import shader_tree
from ..materials.colour_maths import luminance
from ..materials.nodes import Graph, find_socket
from ..materials.surface_shaders import SIMPLE

#: Texels along an edge of a block. The triangle is half a texel shorter, so that the mean place of the texels that it
#: covers is its middle.
_BLOCK = 5
#: Blocks along an edge of the image: of triangles that are baked at once.
_BLOCKS = 128
_SAMPLES = 4
_COLOURS = {'FLOAT_COLOR', 'BYTE_COLOR'}
_TYPES = {'FLOAT', 'FLOAT2', 'FLOAT_VECTOR', *_COLOURS}
_LAYOUT = "TetFlora Bake"
_NAME = "TetFlora Bake"


@dataclass(frozen=True)
class BakeInput:
    """Triangles whose materials are to be baked, read from their mesh.

    Attributes
    ----------
    materials : dict of int to bpy.types.Material
        By slot.
    rows : dict of int to (n,) int64
        Triangles of each slot.
    corners : (t, 3, 3) float32
        Of all triangles.
    attributes : dict of str to (str, (t, 3, width) float32)
        Types and values at corners.
    first : str
        UV map that renders first.
    box : tuple of (3,)
        Middle and half size of generated coordinates.
    face : (t,) int32
    """

    materials: dict[int, bpy.types.Material]
    rows: dict[int, NDArray[np.int64]]
    corners: NDArray[np.float32]
    attributes: dict[str, tuple[str, NDArray[np.float32]]]
    first: str
    box: tuple[tuple[float, ...], tuple[float, ...]]
    face: NDArray[np.int32]

    @classmethod
    def of(
        cls,
        mesh: bpy.types.Mesh,
        materials: dict[int, bpy.types.Material],
        slot: NDArray[np.int32],
        first: str,
        positions: NDArray[np.float32],
        loops: NDArray[np.int32],
        corner_verts: NDArray[np.int32],
        face: NDArray[np.int32],
    ) -> BakeInput:
        """Copy what baking needs of a mesh, whose faces have slots (f,); see `AssetSurface` for the arrays."""
        slot = slot[face]
        kept = np.flatnonzero(np.isin(slot, list(materials)))
        loops, slot, face = loops[kept], slot[kept], face[kept]
        verts = corner_verts[loops]
        attributes = {}
        for attribute in mesh.attributes:
            domain, kind = attribute.domain, attribute.data_type
            if kind not in _TYPES or attribute.name.startswith(".") or attribute.name == "position":
                continue
            rows = {'CORNER': loops, 'POINT': verts, 'FACE': np.repeat(face[:, None], 3, axis=1)}.get(domain)
            if rows is not None:
                values = values_of(attribute, "color" if kind in _COLOURS else "").astype(np.float32)
                attributes[attribute.name] = ('FLOAT_COLOR' if kind in _COLOURS else kind), values[rows]
        return cls(
            materials=materials,
            rows={one: np.flatnonzero(slot == one) for one in materials},
            corners=positions[verts],
            attributes=attributes,
            first=first,
            box=(tuple(mesh.texspace_location), tuple(mesh.texspace_size)),
            face=face,
        )


def bake_steps(
    baking: BakeInput, colour: NDArray[np.float16], transmission: NDArray[np.float16], coverage: NDArray[np.float16]
) -> Generator[float, None, list[str]]:
    """Bake materials and write their looks over those of faces (f, 3), (f,), (f,); yields 1.0 between pieces.

    Returns
    -------
    list of str
        Warnings: what could not be baked.
    """
    warnings = []
    for slot, material in baking.materials.items():
        rows = baking.rows[slot]
        if not len(rows):
            continue
        values = np.zeros((len(rows), 5), np.float32)
        try:
            for start in range(0, len(rows), _BLOCKS * _BLOCKS):
                piece = slice(start, start + _BLOCKS * _BLOCKS)
                values[piece] = _baked(baking, material, rows[piece])
                yield 1.0
        except RuntimeError as error:  # Cycles is switched off, or out of memory
            warnings.append(f'Material "{material.name}" cannot be baked, means stand for it: {error}'.strip())
            continue
        faces, (cover, *seen, through) = _by_face(baking.face[rows], _areas(baking.corners[rows]), values)
        seen = np.stack(seen, axis=1)
        light = luminance(seen.T.astype(np.float32))
        coverage[faces] = np.clip(cover, 0, 1)
        colour[faces] = np.clip(seen / np.maximum(cover, 1e-4)[:, None], 0, 1)
        transmission[faces] = np.clip(through / np.maximum(light, 1e-6), 0, 1)
    return warnings


def _by_face(
    face: NDArray[np.int32], areas: NDArray[np.float64], values: NDArray[np.float32]
) -> tuple[NDArray[np.int32], list[NDArray[np.float64]]]:
    """Faces, and for each column of values its means over them."""
    faces, which = np.unique(face, return_inverse=True)
    total = np.bincount(which, areas)
    return faces, [np.bincount(which, column * areas) / total for column in values.T]


def _areas(corners: NDArray[np.float32]) -> NDArray[np.float64]:
    a, b, c = (corners[:, i].astype(np.float64) for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) + 1e-30


def _baked(baking: BakeInput, material: bpy.types.Material, rows: NDArray[np.int64]) -> NDArray[np.float32]:
    """Cover, colour and what goes through (n, 5) of some triangles."""
    side = _BLOCK * int(np.ceil(np.sqrt(len(rows))))
    with _removing() as made:
        image = made(bpy.data.images.new(_NAME, side, side, float_buffer=True))
        image.colorspace_settings.name = 'Non-Color'
        mesh = made(_mesh(baking, rows, side))
        obj = made(bpy.data.objects.new(_NAME, mesh))
        scene = made(bpy.data.scenes.new(_NAME))
        scene.collection.objects.link(obj)
        scene.render.engine = 'CYCLES'
        scene.cycles.device, scene.cycles.samples = 'CPU', _SAMPLES
        scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
        mesh.materials.append(None)
        found = []
        for kind in ("colour", "cover"):
            copy = _Lamps(kind, made).of(material)
            tree = shader_tree(copy)
            tree.nodes.active = target = tree.nodes.new("ShaderNodeTexImage")
            target.image = image
            mesh.materials[0] = copy
            _bake(scene, obj)
            found.append(_blocks(image, len(rows), side))
    colour, cover = found
    return np.column_stack([np.minimum(cover[:, 0], 1), colour, cover[:, 1]])


def _bake(scene: bpy.types.Scene, obj: bpy.types.Object) -> None:
    layer = scene.view_layers[0]
    layer.update()
    given = {"scene": scene, "view_layer": layer, "active_object": obj, "object": obj}
    with bpy.context.temp_override(**given, selected_objects=[obj], selected_editable_objects=[obj]):
        bpy.ops.object.bake(
            type='EMIT', target='IMAGE_TEXTURES', save_mode='INTERNAL', margin=0, use_clear=True, uv_layer=_LAYOUT
        )


def _mesh(baking: BakeInput, rows: NDArray[np.int64], side: int) -> bpy.types.Mesh:
    """Loose triangles with all that a material may ask for, and the layout of their blocks."""
    count = len(rows)
    mesh = bpy.data.meshes.new(_NAME)
    mesh.vertices.add(3 * count)
    mesh.loops.add(3 * count)
    mesh.polygons.add(count)
    write(mesh, "position", baking.corners[rows].reshape(-1, 3))
    write(mesh, ".corner_vert", np.arange(3 * count, dtype=np.int32))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    names = sorted(baking.attributes, key=lambda name: name != baking.first)
    for name in names:
        kind, values = baking.attributes[name]
        if kind == 'FLOAT2':
            mesh.uv_layers.new(name=name, do_init=False)
        write(mesh, name, values[rows].reshape(3 * count, -1).squeeze(), 'CORNER', kind)
    if baking.first in mesh.uv_layers:
        mesh.uv_layers[baking.first].active_render = True
    across = side // _BLOCK
    place = np.stack([np.arange(count) % across, np.arange(count) // across], axis=1) * _BLOCK
    long = _BLOCK - 0.5
    corners = place[:, None] + np.array([[0.0, 0.0], [long, 0.0], [0.0, long]])
    layer = mesh.uv_layers.new(name=_LAYOUT, do_init=False)
    write(mesh, layer.name, (corners / side).astype(np.float32).reshape(-1, 2))
    mesh.uv_layers.active = mesh.uv_layers[_LAYOUT]
    mesh.use_auto_texspace = False
    mesh.texspace_location, mesh.texspace_size = baking.box
    mesh.update(calc_edges=True)
    return mesh


def _blocks(image: bpy.types.Image, count: int, side: int) -> NDArray[np.float32]:
    """Mean colours (n, 3) over triangles."""
    across = side // _BLOCK
    pixels = image_pixels(image)[..., :3].reshape(across, _BLOCK, across, _BLOCK, 3).swapaxes(1, 2)
    row, column = np.meshgrid(np.arange(_BLOCK), np.arange(_BLOCK), indexing="ij")
    inside = row + column < _BLOCK - 1
    return pixels.reshape(across * across, _BLOCK, _BLOCK, 3)[:count, inside].mean(axis=1)


@contextmanager
def _removing() -> Iterator:
    """Gives a function that takes datablocks, which are removed at the end, the last first."""
    made: list[bpy.types.ID] = []

    def keep(datablock: bpy.types.ID) -> bpy.types.ID:
        made.append(datablock)
        return datablock

    try:
        yield keep
    finally:
        for datablock in reversed(made):
            if isinstance(datablock, bpy.types.Scene):
                bpy.data.scenes.remove(datablock)
            else:
                bpy.data.batch_remove([datablock])


class _Lamps:
    """Copies of materials whose shaders shine with what they scatter, or with how much they cover.

    Parameters
    ----------
    kind : {'colour', 'cover'}
    made : callable
        Takes copies.
    """

    def __init__(self, kind: str, made) -> None:
        self._kind, self._made = kind, made
        self._groups: dict[bpy.types.NodeTree, bpy.types.NodeTree] = {}

    def of(self, material: bpy.types.Material) -> bpy.types.Material:
        """The copy of a material."""
        copy = self._made(material.copy())
        self._convert(shader_tree(copy))
        return copy

    def _group(self, tree: bpy.types.NodeTree) -> bpy.types.NodeTree:
        if tree not in self._groups:
            self._groups[tree] = self._made(tree.copy())
            self._convert(self._groups[tree])
        return self._groups[tree]

    def _convert(self, tree: bpy.types.NodeTree) -> None:
        graph = Graph.__new__(Graph)  # of a tree that is not emptied
        graph.tree = tree
        for node in list(tree.nodes):
            if node.type == 'GROUP' and node.node_tree is not None:
                node.node_tree = self._group(node.node_tree)
            elif any(s.type == 'SHADER' for s in node.outputs) and node.type not in {'MIX_SHADER', 'ADD_SHADER'}:
                self._replace(graph, node)

    def _replace(self, graph: Graph, node: bpy.types.Node) -> None:
        if node.type in {'GROUP_INPUT', 'GROUP_OUTPUT', 'REROUTE'} or node.mute:
            return
        colour, alpha, through = (0.0, 0.0, 0.0, 1.0), 0.0, 0.0
        if node.type == 'BSDF_PRINCIPLED':
            colour, alpha = _feed(node, "Base Color"), _feed(node, "Alpha")
            half = graph.math('MULTIPLY', _feed(node, "Subsurface Weight"), 0.5)
            through = graph.math('MAXIMUM', _feed(node, "Transmission Weight"), half)
        elif node.type in SIMPLE:
            key, through = SIMPLE[node.type]
            colour, alpha = _feed(node, key), 1.0
        elif node.type != 'BSDF_TRANSPARENT':
            alpha = 1.0
        if self._kind == "cover":
            grey = graph.node("ShaderNodeRGBToBW", {"Color": colour}).outputs[0]
            passed = graph.math('MULTIPLY', grey, through)
            colour = graph.node("ShaderNodeCombineColor", {"Red": 1.0, "Green": passed, "Blue": 0.0}).outputs[0]
        lamp = graph.node("ShaderNodeEmission", {"Color": colour, "Strength": alpha})
        for output in node.outputs:
            for link in list(output.links):
                graph.tree.links.new(lamp.outputs[0], link.to_socket)
        graph.tree.nodes.remove(node)


def _feed(node: bpy.types.Node, key: str):
    """What feeds an input, or its value."""
    socket = find_socket(node.inputs, key)
    if socket.is_linked:
        return socket.links[0].from_socket
    value = socket.default_value
    return tuple(value) if hasattr(value, "__len__") else float(value)
