# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Forests as glTF: a node for each variant with all of its places, and its levels as nodes beside it.

Coordinates are turned so that y is up.

Sources: Khronos Group, "glTF 2.0 Specification", and "EXT_mesh_gpu_instancing" and "MSFT_lod" beside it
(github.com/KhronosGroup/glTF, extensions/2.0/Vendor).
"""

import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats32
from ..buffers import MeshBuffers
from ..errors import TetFloraError
from .forest import BakedSurface, Forest, ForestPart, Variant
from .levels import corner_triangles, triangles

_FLOAT, _BYTE, _INT = 5126, 5121, 5125
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_VERTICES, _INDICES = 34962, 34963
#: The most that the length of a binary glTF can be.
_MOST = 2**32 - 1


class _Document:
    """A glTF document under construction, and the file of its binary part."""

    def __init__(self, file: Any) -> None:
        self.file, self.bytes = file, 0
        asset, scene = {"version": "2.0", "generator": "TetFlora"}, {"name": "Forest", "nodes": []}
        self.json: dict[str, Any] = {"asset": asset, "scene": 0, "scenes": [scene], "nodes": []}

    def add(self, key: str, what: dict[str, Any]) -> int:
        """Append to a list of the document; its index."""
        self.json.setdefault(key, []).append(what)
        return len(self.json[key]) - 1

    def data(self, content: bytes, **more: Any) -> int:
        """Write a view of the buffer; its index."""
        view = {"buffer": 0, "byteOffset": self.bytes, "byteLength": len(content), **more}
        content += b"\0" * (-len(content) % 4)
        self.file.write(content)
        self.bytes += len(content)
        return self.add("bufferViews", view)

    def accessor(self, values: NDArray, target: int | None = None, bounds: bool = False) -> int:
        """Write an array (n,) or (n, k) of float32, uint32 or uint8; the index of its accessor."""
        values = np.ascontiguousarray(values)
        kind = {np.dtype(np.float32): _FLOAT, np.dtype(np.uint32): _INT, np.dtype(np.uint8): _BYTE}[values.dtype]
        view = self.data(values.tobytes(), **({} if target is None else {"target": target}))
        shape = _TYPES[1 if values.ndim == 1 else values.shape[1]]
        accessor = {"bufferView": view, "componentType": kind, "count": len(values), "type": shape}
        if bounds:
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.add("accessors", accessor)


def write_gltf(path: Path, forest: Forest) -> Iterator[float]:
    """Write a binary file; yields how much of it is done.

    Raises
    ------
    TetFloraError
        It would be larger than such files can be.
    OSError
        It cannot be written.
    """
    with path.with_name(path.name + ".bin").open("wb+") as file:
        document = _Document(file)
        materials = {one.name: _add_material(document, path.parent, one) for one in forest.surfaces}
        for number, variant in enumerate(forest.variants):
            yield number / len(forest.variants)
            _add_variant(document, forest, number, variant, materials)
        document.json["extensionsUsed"] = ["EXT_mesh_gpu_instancing", "KHR_materials_ior", "MSFT_lod"]
        document.json["buffers"] = [{"byteLength": document.bytes}]
        told = json.dumps(document.json, separators=(",", ":"), allow_nan=False).encode()
        told += b" " * (-len(told) % 4)
        whole = 12 + 8 + len(told) + 8 + document.bytes
        if whole > _MOST:
            raise TetFloraError(f"{path.name} would be larger than 4 GB; lower Max Polygons or Variants, or choose USD")
        file.seek(0)
        with path.open("wb") as out:
            out.write(struct.pack("<4sII", b"glTF", 2, whole))
            out.write(struct.pack("<I4s", len(told), b"JSON") + told)
            out.write(struct.pack("<I4s", document.bytes, b"BIN\0"))
            while block := file.read(1 << 24):
                out.write(block)
                yield 0.95
    path.with_name(path.name + ".bin").unlink()


def upward(points: Floats32) -> Floats32:
    """Points (n, 3) with y up, of those with z up."""
    return np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)


def _add_material(document: _Document, folder: Path, surface: BakedSurface) -> int:
    textures, files = {}, dict(surface.textures)
    if surface.cut:
        files["color"] = files.pop("card")
        del files["opacity"]
    for name, file in files.items():
        view = document.data((folder / file).read_bytes())
        image = document.add("images", {"bufferView": view, "mimeType": "image/png", "name": Path(file).stem})
        textures[name] = {"index": document.add("textures", {"source": image})}
    metallic: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": surface.roughness}
    metallic |= {"baseColorTexture": textures["color"]} if "color" in textures else {}
    if "roughness" in textures:  # its blue would be the metallic part, which the factor makes 0
        metallic |= {"roughnessFactor": 1.0, "metallicRoughnessTexture": textures["roughness"]}
    # Twigs of coarse levels are sheets, as leaves are.
    material = {"name": surface.name, "pbrMetallicRoughness": metallic, "doubleSided": True}
    index = {"KHR_materials_ior": {"ior": surface.index}}
    material |= {"extensions": index, "extras": {"transmission": surface.transmission}}
    material |= {"normalTexture": textures["normal"]} if "normal" in textures else {}
    material |= {"alphaMode": "MASK", "alphaCutoff": surface.cut} if surface.cut else {}
    return document.add("materials", material)


def _add_variant(document: _Document, forest: Forest, number: int, variant: Variant, materials: dict[str, int]) -> None:
    """A node of the finest level with the others as its levels, each with all places: readers take one of them."""
    places = _places(document, forest, number)
    if places is None:
        return
    nodes = []
    for level, of in enumerate(variant.levels):
        parts = [_primitive(document, mesh, materials[variant.surfaces[kind].name]) for kind, mesh in of.parts]
        mesh = document.add("meshes", {"name": f"{variant.name}_LOD{level}", "primitives": parts})
        instancing = {"EXT_mesh_gpu_instancing": {"attributes": places}}
        node = {"name": f"{variant.name}_LOD{level}", "mesh": mesh, "extensions": instancing}
        nodes.append(document.add("nodes", node))
    document.json["scenes"][0]["nodes"].append(nodes[0])
    if len(nodes) > 1:
        first = document.json["nodes"][nodes[0]]
        first["extensions"]["MSFT_lod"] = {"ids": nodes[1:]}
        # The least share of the screen at which each level is shown; the last is shown however small it is.
        sizes = [round(level.screen_size(variant.height), 6) for level in variant.levels[1:]]
        first["extras"] = {"MSFT_screencoverage": [*sizes, 0.0]}


def _places(document: _Document, forest: Forest, number: int) -> dict[str, int] | None:
    """Accessors of the plants that a variant shows; None where it shows none."""
    chosen = [(part, np.flatnonzero(part.variant == number)) for part in forest.parts]
    chosen = [(part, plants) for part, plants in chosen if len(plants)]
    if not chosen:
        return None

    def joined(column: Callable[[ForestPart], NDArray]) -> NDArray:
        return np.concatenate([column(part)[plants] for part, plants in chosen])

    turn, seed = joined(lambda part: part.rotation), joined(lambda part: part.seed).view(np.uint64)
    quarters = [((seed >> np.uint64(16 * k)) & np.uint64(0xFFFF)).astype(np.float32) for k in range(4)]
    attributes = {
        "TRANSLATION": upward(joined(lambda part: part.origin + part.position)).astype(np.float32),
        "ROTATION": np.column_stack([turn[:, 1], turn[:, 3], -turn[:, 2], turn[:, 0]]).astype(np.float32),
        "SCALE": np.repeat(joined(lambda part: part.scale)[:, None], 3, axis=1),
        "_SPECIES": joined(lambda part: part.species).astype(np.float32),
        "_SEED": np.stack(quarters, axis=1),  # of 16 bits each, the lowest first
        "_AGE": joined(lambda part: part.age),
        "_HEIGHT": joined(lambda part: part.height),
    }
    return {name: document.accessor(values) for name, values in attributes.items()}


def _primitive(document: _Document, mesh: MeshBuffers, material: int) -> dict[str, Any]:
    """Triangles with a vertex for each corner that has a place, a normal and texture coordinates of its own."""
    owner, corner = corner_triangles(mesh)
    corners, owner = corner.reshape(-1), np.repeat(owner, 3)
    rows = np.column_stack([mesh.corner_verts[corners], mesh.attributes["UVMap"][1][corners].view(np.int32)])
    rows = rows if mesh.smooth else np.column_stack([rows, owner])
    key = np.ascontiguousarray(rows, np.int32).view([("", np.int32)] * rows.shape[1])[:, 0]
    _, first, index = np.unique(key, return_index=True, return_inverse=True)
    uv = mesh.attributes["UVMap"][1][corners[first]] * np.float32([1, -1]) + np.float32([0, 1])  # from the top
    position = upward(mesh.positions[mesh.corner_verts[corners[first]]])
    attributes = {
        "POSITION": document.accessor(position, _VERTICES, bounds=True),
        "NORMAL": document.accessor(upward(corner_normals(mesh)[corners[first]]), _VERTICES),
        "TEXCOORD_0": document.accessor(uv, _VERTICES),
    }
    indices = document.accessor(index.reshape(-1).astype(np.uint32), _INDICES)
    return {"attributes": attributes, "indices": indices, "material": material}


def face_normals(mesh: MeshBuffers) -> Floats32:
    """Unit normals (f, 3) of faces."""
    owner, corner = triangles(mesh)
    a, b, c = (mesh.positions[corner[:, k]] for k in range(3))
    across = np.cross(b - a, c - a).astype(np.float64)
    return _unit(np.stack([np.bincount(owner, across[:, k], mesh.polygons) for k in range(3)], axis=1))


def corner_normals(mesh: MeshBuffers) -> Floats32:
    """Unit normals (c, 3) of corners: of smooth meshes means of those of the faces around."""
    normal = np.repeat(face_normals(mesh), np.diff(mesh.face_offsets), axis=0)
    if not mesh.smooth:
        return normal
    sums = [np.bincount(mesh.corner_verts, normal[:, k], len(mesh.positions)) for k in range(3)]
    return _unit(np.stack(sums, axis=1))[mesh.corner_verts]


def _unit(vectors: NDArray[np.float64]) -> Floats32:
    """Vectors of length 1; upright ones where there is no direction."""
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(size > 1e-20, vectors / np.maximum(size, 1e-20), [[0.0, 0.0, 1.0]]).astype(np.float32)
