# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects and collections as species, and objects as scatterers: what the artist marks, and what can be marked.

Which objects are species is stored with the scene and not with them, so that those that are linked can be species too.
An identifier follows from the name of the asset when it becomes a species: put on the list again, it is the same.

How large they are, and a small picture of them for menus, follow from points on their surface, within a moment: nothing
is compiled and no renderer is asked. Materials count by their mean color.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from hashlib import blake2b
from itertools import count
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, srgb_of
from ...errors import SceneError
from ..attributes import members, read
from ..materials.face_looks import GRAY, Looks
from ..materials.nodes import is_ours
from ..scene.objects import SURFACE_TYPES, may_instance
from ..species.asset_species import (
    FILLED,
    PICTURE_SIDE,
    PREFIX,
    Datablock,
    TetFloraAssetSpecies,
    asset_of,
    asset_species,
    datablock_of,
    entries_of,
    stored_picture,
)
from ..species.edits import tell_listeners
from .places import Scatter, Target, read_scatters, variants_of

_POINTS = 60_000  # of a picture
_TRIANGLES = 200_000  # of one mesh that are looked at
_LEAST = 1e-3  # meters that a crown is wide and tall
_FINER = 2  # pixels of the picture that is made for one that is kept
_BASE = 0.1  # fraction of the area that lies below the crown's base
_UP, _SIDE = np.array([0.0, -0.26, 0.966]), np.array([1.0, 0.0, 0.0])  # axes of the picture: a little from above
_SUN = np.array([-0.45, -0.55, 0.7])


@dataclass
class _Mesh:
    """A mesh in its places (k, 4, 4): corners of triangles (t, 3, 3), area (t,), color (t, 3), coverage (t,).

    ``faces`` and ``leaves``, the area of leaves, are those of one place.
    """

    places: Floats
    corners: Floats
    area: Floats
    color: Floats
    coverage: Floats
    low: Floats
    high: Floats
    faces: int
    leaves: float

    @property
    def sizes(self) -> float:
        """Sum over places of how many times larger areas are there."""
        return float((np.abs(np.linalg.det(self.places[:, :3, :3])) ** (2.0 / 3.0)).sum())


def _read_one(mesh: bpy.types.Mesh, materials: list[bpy.types.Material | None], places: Floats, looks: Looks) -> _Mesh:
    mesh.calc_loop_triangles()
    positions = np.nan_to_num(read(mesh, "position").astype(np.float64))
    triangles = members(mesh.loop_triangles, "loops", 3, np.int32)
    faces = members(mesh.loop_triangles, "polygon_index", dtype=np.int32)
    factor = 1.0
    if len(triangles) > _TRIANGLES:
        sample = np.linspace(0, len(triangles) - 1, _TRIANGLES).astype(np.int64)
        triangles, faces, factor = triangles[sample], faces[sample], len(triangles) / _TRIANGLES
    corners = positions[read(mesh, ".corner_vert")[triangles]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * factor * np.sqrt(np.einsum("ni,ni->n", normal, normal))
    seen = [looks.of(material, {}) for material in materials]
    slot = np.clip(members(mesh.polygons, "material_index", dtype=np.int32)[faces], 0, len(seen) - 1)
    coverage = np.array([look.coverage for look in seen])[slot]
    # Of closed leaves both sides have area; each edge of theirs has two faces.
    loose = min(max(2.0 * len(mesh.edges) / len(mesh.loops) - 1.0, 0.0), 1.0)
    color, leaves = np.array([look.color for look in seen])[slot], (0.5 + 0.5 * loose) * float(area @ coverage)
    low, high = positions.min(axis=0), positions.max(axis=0)
    return _Mesh(places, corners, area, color, coverage, low, high, len(mesh.polygons), leaves)


def _measure(variants: Iterable[tuple[Target, Floats]], depsgraph: bpy.types.Depsgraph) -> dict[str, Any]:
    """Means over the variants of a species, by the properties of `TetFloraAssetSpecies`, and a picture of the first.

    Each variant has a matrix (4, 4) from its space to that of the plant. Nothing where none has a face.
    """
    figures, looks = [], Looks()
    for target, matrix in variants:
        meshes = [_read_one(*one, matrix @ part.matrices, looks) for part, *one in target.meshes(depsgraph)]
        if meshes:
            figures.append(_measured(meshes, picture=not figures))
    if not figures:
        return {}
    means = {name: np.mean([one[name] for one in figures], axis=0).tolist() for name in figures[0] if name != "picture"}
    return means | {"picture": figures[0]["picture"]}


def size_of(variants: Iterable[tuple[Target, Floats]], depsgraph: bpy.types.Depsgraph) -> tuple[float, float]:
    """Radius and height alone, as `_measure` finds them, at a fraction of the cost; zeros where nothing has a face."""
    extents = []
    for target, matrix in variants:
        boxes = [(low, high, matrix @ places) for low, high, places in _boxes(target, depsgraph)]
        if boxes:
            extents.append(_extent(*_around(boxes)))
    return tuple(np.mean(extents, axis=0).tolist()) if extents else (0.0, 0.0)


def reach_of(target: Target, depsgraph: bpy.types.Depsgraph) -> float:
    """Distance from an asset's origin within which all of it lies, meters in its own space.

    Raises
    ------
    SceneError
        It instances itself.
    """
    boxes = [np.linalg.norm(_corners(*box), axis=-1).max() for box in _boxes(target, depsgraph)]
    return float(max(boxes, default=0.0))


def _boxes(target: Target, depsgraph: bpy.types.Depsgraph) -> Iterator[tuple[NDArray, NDArray, NDArray]]:
    """Extent of each mesh of a target, and its places."""
    for part, mesh, _ in target.meshes(depsgraph):
        positions = np.nan_to_num(read(mesh, "position"))
        yield positions.min(axis=0), positions.max(axis=0), part.matrices


def _extent(low: Floats, high: Floats) -> tuple[float, float]:
    """Radius and height of a plant that fills a box."""
    height = float(high[2] if high[2] > 0.0 else high[2] - low[2])
    return max(0.5 * float((high - low)[:2].max()), _LEAST), max(height, _LEAST)


def _corners(low: NDArray, high: NDArray, places: Floats) -> Floats:
    """Corners (k, 8, 3) of a box in some places."""
    corner = np.array(np.meshgrid(*zip(low, high, strict=True)), np.float64).reshape(3, -1).T
    return corner @ places[:, :3, :3].transpose(0, 2, 1) + places[:, None, :3, 3]


def _around(boxes: list[tuple[NDArray, NDArray, Floats]]) -> tuple[Floats, Floats]:
    """Extent (3,) of boxes in their places."""
    corners = np.concatenate([_corners(*box) for box in boxes])
    return corners.min(axis=(0, 1)), corners.max(axis=(0, 1))


def _measured(meshes: list[_Mesh], picture: bool) -> dict[str, Any]:
    """Of a plant of scale 1: meters, number of faces, m², linear RGB, and a stored picture."""
    low, high = _around([(mesh.low, mesh.high, mesh.places) for mesh in meshes])
    points, normals, colors = _sampled(meshes)
    radius, height = _extent(low, high)
    base = float(np.clip(np.quantile(points[:, 2], _BASE), 0.0, height)) if len(points) else 0.0
    return {
        "radius": radius,
        "base": base,
        "height": height,
        "polygons": float(sum(len(mesh.places) * mesh.faces for mesh in meshes)),
        "leaves": sum(mesh.sizes * mesh.leaves for mesh in meshes),
        "color": colors.mean(axis=0) if len(colors) else GRAY,
        "picture": stored_picture(_drawn(points, normals, colors, low, high)) if picture else "",
    }


def _sampled(meshes: list[_Mesh]) -> tuple[Floats, Floats, Floats]:
    """Points evenly on what covers, with the normals and colors there, (n, 3) each."""
    total = sum(mesh.sizes * float(mesh.area.sum()) for mesh in meshes)
    draw = np.random.default_rng(1)
    out: list[tuple[NDArray, NDArray, NDArray]] = []
    for mesh in meshes:
        area = float(mesh.area.sum())
        number = int(np.ceil(_POINTS * mesh.sizes * area / total)) if area > 0.0 else 0
        if not number:
            continue
        triangle = draw.choice(len(mesh.area), number, p=mesh.area / area)
        triangle = triangle[draw.random(number) < mesh.coverage[triangle]]
        place = mesh.places[draw.integers(len(mesh.places), size=len(triangle))]
        corners = mesh.corners[triangle]
        u, v = draw.random((2, len(triangle), 1))
        u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
        edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        point = corners[:, 0] + u * edges[0] + v * edges[1]
        turned = [np.einsum("nij,nj->ni", place[:, :3, :3], edge) for edge in edges]
        position = np.einsum("nij,nj->ni", place[:, :3, :3], point) + place[:, :3, 3]
        out.append((position, np.cross(*turned), mesh.color[triangle]))
    if not out:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3))
    position, normal, color = (np.concatenate(column) for column in zip(*out, strict=True))
    return position, normal / np.maximum(np.sqrt(np.einsum("ni,ni->n", normal, normal)), 1e-12)[:, None], color


def _drawn(points: Floats, normals: Floats, colors: Floats, low: Floats, high: Floats) -> NDArray[np.uint8]:
    """Points as a picture, each hiding what is behind it."""
    side = PICTURE_SIDE * _FINER
    middle, extent = 0.5 * (low + high), max(float((high - low).max()), 1e-9)
    away = points - middle
    scale = FILLED * side / extent
    column = np.floor(0.5 * side + scale * (away @ _SIDE)).astype(np.int64)
    row = np.floor(0.5 * side + scale * (away @ _UP)).astype(np.int64)
    depth = away @ np.cross(_SIDE, _UP)
    inside = (column >= 0) & (column < side) & (row >= 0) & (row < side)
    column, row, depth, normals, colors = (a[inside] for a in (column, row, depth, normals, colors))
    light = 0.4 + 0.6 * np.abs(normals @ (_SUN / np.linalg.norm(_SUN)))
    order = np.argsort(depth, kind="stable")  # the nearest is written last
    picture = np.zeros((side, side, 4))
    picture[row[order], column[order], :3] = np.clip(colors * light[:, None], 0.0, 1.0)[order]
    picture[row[order], column[order], 3] = 1.0
    small = picture.reshape(PICTURE_SIDE, _FINER, PICTURE_SIDE, _FINER, 4).mean(axis=(1, 3))
    with np.errstate(invalid="ignore"):
        small[..., :3] = np.nan_to_num(small[..., :3] / small[..., 3:])
    small[..., :3] = srgb_of(small[..., :3])
    return np.round(255.0 * small).astype(np.uint8)


_NO_FACES = "it has no faces. Choose a mesh, curve or collection with a surface, or add faces"
_SAME = 1e-4  # relative difference of sizes that is none


def can_be_species(datablock: Datablock) -> bool:
    """Whether an object or collection may be used as a species; cheap."""
    if isinstance(datablock, bpy.types.Collection):
        return not is_ours(datablock)
    plant = datablock.tetflora.is_plant or datablock.tetflora.is_field or is_ours(datablock)
    return not plant and (datablock.type in SURFACE_TYPES or may_instance(datablock))


def use_as_species(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, datablock: Datablock, variants: bool = False
) -> TetFloraAssetSpecies:
    """Make an object or a collection a species of this file; one that is a species already is measured anew.

    Parameters
    ----------
    datablock : bpy.types.Object or bpy.types.Collection
        Original; may be linked from a library.
    variants : bool
        Each object of the collection, and each collection within it, is a plant of its own, and not all together one.
        Where an empty is given that shows a collection, the collection is one plant, and so are all such empties.

    Raises
    ------
    SceneError
        Nothing of it has faces; the message names it.
    """
    if isinstance(datablock, bpy.types.Object) and datablock.type == 'EMPTY' and datablock.instance_collection:
        datablock, variants = datablock.instance_collection, False  # it shows all of it
    if not can_be_species(datablock):
        raise SceneError(f'"{datablock.name}" cannot be used as a species: {_NO_FACES}')
    entry = asset_of(datablock, scene)
    new = entry is None or entry.id_data.library is not None
    if new:
        entry = scene.tetflora.asset_species.add()
        entry.identifier = _identifier(datablock)
    before = entry.variants
    entry.object = datablock if isinstance(datablock, bpy.types.Object) else None
    entry.collection = None if entry.object else datablock
    entry.variants = variants and entry.object is None
    try:
        if not measure_again(depsgraph, entry):
            raise SceneError(f'"{datablock.name}" cannot be used as a species: {_NO_FACES}')
    except SceneError:
        if new:
            _remove(entry)
        else:
            entry.variants = before
        raise
    tell_listeners()
    return entry


def _identifier(datablock: Datablock) -> str:
    taken = {entry.identifier for entry in entries_of()}
    kind = "collection" if isinstance(datablock, bpy.types.Collection) else "object"
    texts = (f"{kind}:{datablock.name_full}:{number}".encode(errors="backslashreplace") for number in count())
    candidates = (PREFIX + blake2b(text, digest_size=6).hexdigest() for text in texts)
    return next(identifier for identifier in candidates if identifier not in taken)


def measure_again(depsgraph: bpy.types.Depsgraph, entry: TetFloraAssetSpecies) -> bool:
    """Measure an asset and draw its picture; false where it has no faces."""
    means = _measure(variants_of(entry, depsgraph), depsgraph)
    for name, value in ({"name": (entry.object or entry.collection).name} | means if means else {}).items():
        setattr(entry, name, value)
    return bool(means)


def measure_all(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, identifiers: Iterable[str]) -> None:
    """Measure those assets anew that plants are to be placed of, and whose size has changed.

    What has no faces any more stays as it was. Errors are those of `places.variants_of`.
    """
    known = asset_species(scene)
    for identifier in identifiers:
        entry = known.get(identifier)
        if entry is not None and entry.id_data.library is None:
            size = size_of(variants_of(entry, depsgraph), depsgraph)
            if not np.allclose(size, (entry.radius, entry.height), rtol=_SAME, atol=0.0):
                measure_again(depsgraph, entry)


def stop_using(datablock: Datablock) -> int:
    """Use an object or a collection as a species no more; how many entries there were. Plants of it stay."""
    removed = 0
    while (entry := asset_of(datablock)) is not None and entry.id_data.library is None:
        _remove(entry)
        removed += 1
    if removed:
        tell_listeners()
    return removed


def _remove(entry: TetFloraAssetSpecies) -> None:
    home = entry.id_data
    entries = home.tetflora.asset_species if isinstance(home, bpy.types.Scene) else home.tetflora_assets
    entries.remove(next(i for i, other in enumerate(entries) if other.identifier == entry.identifier))


def is_species(datablock: Datablock | None) -> bool:
    """Whether an object or a collection is used as a species, or an empty shows one that is; cheap."""
    entry = None if datablock is None else asset_of(datablock)
    return entry is not None and datablock_of(entry) is not None


def scattered(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Scatter:
    """What an object scatters.

    Raises
    ------
    SceneError
        Nothing that has faces, or as `places.read_scatters`; the message says what to do.
    """
    scatter = read_scatters([obj], depsgraph)[obj]
    if not scatter.places:
        if scatter.left:
            raise SceneError(
                f'"{obj.name}" scatters only objects without faces ({", ".join(sorted(scatter.left)[:3])}); nothing of '
                "them can be refined"
            )
        raise SceneError(
            f'"{obj.name}" shows no instances now. Show its modifiers in viewports, and keep them from realizing '
            "instances; for a mesh of its own use Refine This Mesh"
        )
    return scatter
