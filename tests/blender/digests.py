# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a file holds, datablock by datablock, as values that can be compared: to tell that undo restored all of it.

Every list of `bpy.data` is visited, and of every datablock all properties that RNA has, its groups, lists and arrays
included, and its custom properties. Other datablocks count by type and name. Meshes and point clouds count by their
attributes. Left out is what is no part of the file: see `PASSING`.
"""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import bpy
import numpy as np

from tetflora_addon.blender.biomes import library
from tetflora_addon.blender.species import catalog
from tetflora_addon.blender.species.edits import looked_at_once

#: Properties that are not what a file says: where things lie in memory, what is evaluated, what is drawn.
PASSING = frozenset(
    {
        "rna_type",
        "session_uid",
        "original",
        "is_evaluated",
        "is_updated",
        "is_updated_data",
        "id_data",
        "tag",
        "preview",
        "users",
        "is_embedded_data",
        "is_library_indirect",
        "depsgraph",
        "view_layer_hash",
        # Blender's memory of undo does not hold this mark; TetFlora sets it again before it writes a file.
        "is_runtime_data",
        "bl_rna",
        "internal_links",
        # A cache of what `objects` and `children` say. After undo of deleted objects Blender can leave it stale:
        # reading it then gives None or ends in a crash (5.2 and 4.5).
        "all_objects",
        "particle_edit",  # its object follows the mouse
        # The same as `species`, for panels. Blender lists the whole catalog, with pictures, each time it is read.
        "species_choice",
    }
)
#: Lists of `bpy.data` that belong to the window or the session and not to what the artist makes.
LEFT_OUT = frozenset({"all_ids", "window_managers", "screens", "workspaces", "libraries"})
#: Properties that hold the bulk of a datablock, which `_bulk` reads at once.
_BULK = {
    "Mesh": frozenset(
        {
            "vertices",
            "edges",
            "loops",
            "polygons",
            "attributes",
            "color_attributes",
            "uv_layers",
            "loop_triangles",
            "loop_triangle_polygons",
            "vertex_normals",
            "polygon_normals",
            "corner_normals",
            "vertex_colors",
            "uv_layer_clone",
            "uv_layer_stencil",
        }
    ),
    "PointCloud": frozenset({"points", "attributes", "color_attributes"}),
}
_FIELDS = ("value", "vector", "color")


def everything() -> dict[str, dict[str, Any]]:
    """All datablocks of the file by kind and name: nested tuples and dictionaries of plain values."""
    with warnings.catch_warnings(), _libraries_at_rest():
        warnings.simplefilter("ignore")  # of what Blender means to drop, as long as it has it
        return _everything()


@contextmanager
def _libraries_at_rest() -> Iterator[None]:
    """Species, biomes and their pictures are looked for once: each enumeration of them would, whenever it is read."""
    library.look_again()
    before = catalog._TRUSTED, library._TRUSTED
    catalog._TRUSTED = library._TRUSTED = float("inf")
    try:
        with looked_at_once():
            yield
    finally:
        catalog._TRUSTED, library._TRUSTED = before


def these(datablocks: Iterable[bpy.types.ID]) -> dict[str, dict[str, Any]]:
    """Some datablocks by name, as in `everything`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {d.name_full: _struct(d, 0) for d in datablocks}


def _everything() -> dict[str, dict[str, Any]]:
    bpy.context.view_layer.update()
    found: dict[str, dict[str, Any]] = {}
    for prop in bpy.data.bl_rna.properties:
        if prop.type != 'COLLECTION' or prop.identifier in LEFT_OUT:
            continue
        found[prop.identifier] = {d.name_full: _struct(d, 0) for d in getattr(bpy.data, prop.identifier)}
    found["images"].pop("Render Result", None)
    found["selection"] = {
        layer.name: (
            sorted(o.name for o in layer.objects if o.select_get(view_layer=layer)),
            layer.objects.active.name if layer.objects.active is not None else None,
        )
        for scene in bpy.data.scenes
        for layer in scene.view_layers
    }
    return found


def difference(before: dict[str, dict[str, Any]], after: dict[str, dict[str, Any]]) -> list[str]:
    """Paths at which two of these differ; empty where nothing does."""
    return _difference(before, after, "")


def _difference(before: Any, after: Any, path: str) -> list[str]:
    if before == after:
        return []
    if isinstance(before, dict) and isinstance(after, dict):
        keys = sorted(set(before) | set(after), key=str)
        gone = [f"{path}/{k}: gone" for k in keys if k not in after]
        new = [f"{path}/{k}: new" for k in keys if k not in before]
        return (
            gone
            + new
            + [
                line
                for k in keys
                if k in before and k in after
                for line in _difference(before[k], after[k], f"{path}/{k}")
            ]
        )
    return [f"{path}: {before!r} became {after!r}"[:300]]


def _struct(value: Any, depth: int) -> dict[str, Any]:
    """All properties of a datablock, or of a group within one."""
    bulk = _BULK.get(type(value).__name__, frozenset())
    found = {}
    for prop in _properties(value):
        if prop.name in bulk:
            continue
        try:
            held = getattr(value, prop.name)
        except (AttributeError, TypeError, RuntimeError):
            continue  # what this Blender does not tell here
        found[prop.name] = held if prop.is_itself else _plain(held, prop, depth)
    if bulk:
        found["attributes"] = _bulk(value)
    if isinstance(value, (bpy.types.ID, bpy.types.PropertyGroup)):
        found["custom"] = _custom(value)
    return found


class _Property(NamedTuple):
    """What `_plain` asks of a property."""

    name: str
    type: str
    is_array: bool
    is_flag: bool
    is_itself: bool  # what it holds needs no rounding, and nothing is within it


def _properties(value: Any) -> list[_Property]:
    """Properties of a kind of data; Blender takes longer to tell of these than of what they hold."""
    kind = value.bl_rna.identifier
    if kind not in _known:
        every = (p for p in value.bl_rna.properties if p.identifier not in PASSING)
        _known[kind] = [
            _Property(p.identifier, p.type, array, flag, not (array or flag) and p.type in _ITSELF)
            for p in every
            for array, flag in [(getattr(p, "is_array", False), getattr(p, "is_enum_flag", False))]
        ]
    return _known[kind]


_known: dict[str, list[_Property]] = {}
_ITSELF = {'BOOLEAN', 'INT', 'STRING', 'ENUM'}


def _plain(held: Any, prop: _Property, depth: int) -> Any:
    if prop.name == "species_editor":
        # Its sliders show what is stored elsewhere, in the list of the file's own species: reading them takes long.
        return held.species, held.order_index
    if held is None:
        return None
    if prop.type == 'POINTER':
        embedded = isinstance(held, bpy.types.ID) and held.is_embedded_data
        if isinstance(held, bpy.types.ID) and not embedded:
            return (type(held).__name__, held.name_full)
        if isinstance(held, (bpy.types.Node, bpy.types.NodeSocket, bpy.types.NodeTreeInterfaceItem)):
            return held.name  # where links lead; the node itself is told in its tree
        return _struct(held, depth + 1) if depth < 6 else None
    if prop.type == 'COLLECTION':
        if depth >= 6:
            return len(held)
        return {n: _item(item, depth) for n, item in enumerate(held)}
    if prop.is_array and len(held) and isinstance(held[0], (int, float)):
        return tuple([round(number, 6) for number in held])
    if prop.is_array:
        return tuple(np.array(held, dtype=float).reshape(-1).round(6).tolist())
    if prop.is_flag:
        return tuple(sorted(held))
    if prop.type == 'FLOAT':
        return round(held, 6)
    return held


def _item(item: Any, depth: int) -> Any:
    if item is None:
        return None  # an empty slot of materials
    if isinstance(item, bpy.types.ID) and not item.is_embedded_data:
        return (type(item).__name__, item.name_full)
    return _struct(item, depth + 1)


def _custom(value: Any) -> dict[str, str]:
    """Custom properties, those of add-ons excepted where they are properties of RNA as well."""
    try:
        names = [k for k in value.keys() if k not in value.bl_rna.properties]  # noqa: SIM118 (no mapping)
    except TypeError:
        return {}
    return {k: repr(value[k].to_dict() if hasattr(value[k], "to_dict") else value[k]) for k in names}


def _bulk(data: Any) -> dict[str, tuple[int, str, str, str]]:
    """Attributes: how many values, on what, of which type, and a hash of them; the topology of faces among them."""
    found = {}
    for layer in data.attributes:
        if not len(layer.data) or layer.name.startswith(".select") or layer.name.startswith(".hide"):
            continue
        field = next((f for f in _FIELDS if hasattr(layer.data[0], f)), None)
        if field is None:
            found[layer.name] = (len(layer.data), layer.domain, layer.data_type, "")
            continue
        width = np.size(np.array(getattr(layer.data[0], field)))
        values = np.empty(width * len(layer.data), np.float64)
        layer.data.foreach_get(field, values)
        found[layer.name] = (len(layer.data), layer.domain, layer.data_type, _hashed(values))
    if isinstance(data, bpy.types.Mesh):
        starts = np.empty(len(data.polygons), np.int32)
        data.polygons.foreach_get("loop_start", starts)
        found["faces"] = (len(starts), 'FACE', 'INT', _hashed(starts))
    return found


def _hashed(values: np.ndarray) -> str:
    return hashlib.sha1(values.tobytes()).hexdigest()
