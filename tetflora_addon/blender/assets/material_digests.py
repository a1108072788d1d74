# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Digests of materials: of all nodes, what they are set to and how they are linked, and of images."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..attributes import image_pixels
from ..compat import tree_in_use

#: Of nodes, where they stand in the editor and how they look there.
_IDLE = {"rna_type", "name", "label", "width", "height", "color", "location", "location_absolute", "parent", "select"}
_IDLE |= {"bl_idname", "bl_label", "bl_description", "bl_icon", "bl_static_type", "warning_propagation", "dimensions"}
_IDLE |= {"bl_width_default", "bl_width_min", "bl_width_max", "bl_height_default", "bl_height_min", "bl_height_max"}
_IDLE |= {"internal_links", "inputs", "outputs", "color_tag", "hide", "use_custom_color", "show_options"}
_IDLE |= {"show_preview", "show_texture", "image_user", "texture_mapping", "color_mapping"}
_VALUES = {'BOOLEAN', 'INT', 'FLOAT', 'STRING', 'ENUM'}
# Content of packed images by identity and length: they are read once.
_packed: dict[tuple[int, int], str] = {}


def material_digest(material: bpy.types.Material | None) -> str:
    """Hexadecimal digest of what a material looks like."""
    if material is None:
        return ""
    content = hashlib.sha256(repr(tuple(material.diffuse_color)).encode())
    tree = tree_in_use(material)
    if tree is not None:
        _add_tree(content, tree)
    return content.hexdigest()


def attributes_of(material: bpy.types.Material | None) -> Iterator[str]:
    """Names of attributes that a material asks for, groups included."""
    waiting = [] if material is None or (tree := tree_in_use(material)) is None else [tree]
    while waiting:
        for node in waiting.pop().nodes:
            if node.type == 'ATTRIBUTE':
                yield node.attribute_name
            elif node.type == 'VERTEX_COLOR':
                yield node.layer_name
            elif node.type == 'GROUP' and node.node_tree is not None:
                waiting.append(node.node_tree)


def _add_tree(content: hashlib._Hash, tree: bpy.types.NodeTree) -> None:
    nodes = {node.as_pointer(): i for i, node in enumerate(tree.nodes)}
    for node in tree.nodes:
        if node.type in {'FRAME', 'REROUTE'}:
            continue
        content.update(node.bl_idname.encode())
        for name in _settings(node):
            _add(content, name, getattr(node, name))
        for socket in node.inputs:
            if not socket.is_linked and hasattr(socket, "default_value"):
                _add(content, socket.identifier, socket.default_value)
        if node.type in {'RGB', 'VALUE'}:
            _add(content, "value", node.outputs[0].default_value)
    for link in tree.links:
        ends = (link.from_node, link.from_socket), (link.to_node, link.to_socket)
        named = [(nodes[node.as_pointer()], socket.identifier) for node, socket in ends]
        content.update(f"{named}{link.is_muted}".encode())


def _settings(node: bpy.types.Node) -> list[str]:
    kind = node.bl_idname
    if kind not in _known:
        properties = node.bl_rna.properties
        _known[kind] = [p.identifier for p in properties if p.identifier not in _IDLE and p.type != 'COLLECTION']
    return _known[kind]


_known: dict[str, list[str]] = {}


def _add(content: hashlib._Hash, name: str, value: Any) -> None:
    if isinstance(value, bpy.types.Image):
        value = image_digest(value)
    elif isinstance(value, bpy.types.NodeTree):
        content.update(name.encode())
        _add_tree(content, value)
        return
    elif isinstance(value, bpy.types.ColorRamp):
        parts = [(e.position, *e.color) for e in value.elements]
        value = (value.interpolation, value.color_mode, value.hue_interpolation, parts)
    elif isinstance(value, bpy.types.CurveMapping):
        value = [[(*p.location, p.handle_type) for p in curve.points] for curve in value.curves]
    elif isinstance(value, bpy.types.ID):
        value = value.name_full
    elif isinstance(value, bpy.types.bpy_struct):
        return
    elif hasattr(value, "__len__") and not isinstance(value, str):
        value = tuple(value)
    content.update(f"{name}={value!r};".encode())


def image_digest(image: bpy.types.Image) -> str:
    """Digest of an image: of its pixels if only this file has them, else of the file that it is in."""
    how = f"{tuple(image.size)} {image.source} {image.alpha_mode} {image.colorspace_settings.name} "
    if image.is_dirty and image.size[0]:
        return how + hashlib.sha256(np.ascontiguousarray(image_pixels(image))).hexdigest()
    packed = image.packed_file
    if packed is not None:
        key = image.session_uid, packed.size
        if key not in _packed:
            _packed[key] = hashlib.sha256(packed.data).hexdigest()
        return how + _packed[key]
    if image.source == 'GENERATED':
        return how + f"{image.generated_type} {tuple(image.generated_color)}"
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    try:
        stat = path.stat()
    except OSError:
        return how + f"{path}"
    return how + f"{path} {stat.st_size} {stat.st_mtime_ns}"
