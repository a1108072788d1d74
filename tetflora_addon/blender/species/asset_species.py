# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species that are assets: objects and collections of this file that stand for plants as they are.

A list of the scene holds them, each with an identifier as species files have, and not the objects themselves: what is
linked from a library cannot be written to. As with edits of species, those of the scene at hand come before those of
the file's other scenes, and those that came with collections of plants last (`edits.pack`). What of their measures
plants need, such as the size of the crown, is measured when an object becomes a species and when plants are placed.
"""

import base64
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy.props import FloatVectorProperty
from numpy.typing import NDArray

from ...arrays import Floats, linear_of
from ...errors import NAME, SpeciesError, readable
from ...files import is_identifier
from ...species.catalog import FileInfo
from ..compat import node_inputs
from ..declare import PURPOSE, boolean, pointer_to, real, string

#: What identifiers of assets begin with.
PREFIX = "asset-"
#: Side of stored pictures in pixels, and the fraction of it that the asset fills.
PICTURE_SIDE, FILLED = 64, 0.92

Datablock = bpy.types.Object | bpy.types.Collection


class TetFloraAssetSpecies(bpy.types.PropertyGroup):
    """An object or collection that is a species."""

    identifier: string("Identifier", "Identifier that plants store")
    name: string("Name", "Name of the asset when it was used last")
    object: pointer_to(bpy.types.Object, "Object", "What plants of the species look like")
    collection: pointer_to(bpy.types.Collection, "Collection", "What plants of the species look like")
    variants: boolean("Variants", "Each object of the collection is a plant by itself, chosen by the plant's seed")
    # Of a plant of scale 1.
    radius: real("Crown Radius", "Half of the width, meters", 1.0)
    base: real("Crown Base", "Height below which there is little, meters")
    height: real("Height", "Height above the asset's origin, meters", 5.0)
    polygons: real("Polygons", "Number of faces")
    leaves: real("Leaf Area", "One-sided area, square meters")
    color: FloatVectorProperty(name="Color", description="Mean color, linear", size=3, default=(0.1, 0.2, 0.05))
    picture: string("Picture", "Small picture for menus, as compressed pixels")


def listed_in(entries: str, scene: bpy.types.Scene | None = None) -> Iterator[Any]:
    """Entries of a list that all scenes have, those of a scene first.

    Those whose identifiers break the rule are as good as absent, for paths are made of them.
    """
    # While add-ons are enabled at startup bpy.data has nothing.
    others = [s for s in getattr(bpy.data, "scenes", ()) if s != scene]
    for one in ([scene] if scene is not None else []) + others:
        yield from (entry for entry in getattr(one.tetflora, entries) if is_identifier(entry.identifier))


def entries_of(scene: bpy.types.Scene | None = None) -> Iterator[TetFloraAssetSpecies]:
    """Asset species of this file, those of a scene first, those that collections of plants brought last."""
    yield from listed_in("asset_species", scene)
    for home in getattr(bpy.data, "collections", ()):
        yield from (entry for entry in home.tetflora_assets if is_identifier(entry.identifier))


def find_asset(scene: bpy.types.Scene | None, identifier: str) -> TetFloraAssetSpecies | None:
    """The asset species with an identifier, whether its object is still there or not; None for grown species."""
    if not identifier.startswith(PREFIX):
        return None
    return next((entry for entry in entries_of(scene) if entry.identifier == identifier), None)


def datablock_of(entry: TetFloraAssetSpecies, references: Counter[object] | None = None) -> Datablock | None:
    """What stands for plants of an asset species; None where it was deleted, though these lists keep it in the file."""
    if entry.object is None or entry.id_data.library is not None:
        return entry.object or entry.collection
    references = _references() if references is None else references
    return entry.object if entry.object.users > references[entry.object] else None


def _references() -> Counter[object]:
    """How often entries of the file, and results that show instances, refer to each object."""
    named = [entry.object for entry in entries_of()]
    results = (o for home in (bpy.data.collections if named else ()) if PURPOSE in home for o in home.objects)
    return Counter(named + [value for o in results for modifier in o.modifiers for value in node_inputs(modifier)])


def asset_species(scene: bpy.types.Scene | None = None) -> dict[str, TetFloraAssetSpecies]:
    """All asset species whose object or collection is there, by identifier; empty, at no cost, in most files."""
    references = _references()
    entries: dict[str, TetFloraAssetSpecies] = {}
    for entry in entries_of(scene):
        if datablock_of(entry, references) is not None:
            entries.setdefault(entry.identifier, entry)
    return entries


def asset_of(datablock: Datablock, scene: bpy.types.Scene | None = None) -> TetFloraAssetSpecies | None:
    """The species that an object or a collection is, or the collection that an empty shows."""
    inner = datablock.instance_collection if getattr(datablock, "type", "") == 'EMPTY' else None
    datablock = inner or datablock
    return next((entry for entry in entries_of(scene) if datablock in (entry.object, entry.collection)), None)


def copy_asset(source: TetFloraAssetSpecies, entries: bpy.types.bpy_prop_collection) -> None:
    """Add an asset species to a list as it is in another."""
    added = entries.add()
    for prop in source.bl_rna.properties:
        if not prop.is_readonly:
            setattr(added, prop.identifier, getattr(source, prop.identifier))


def asset_infos() -> dict[str, FileInfo]:
    """What menus show of asset species."""
    infos: dict[str, FileInfo] = {}
    for identifier, entry in asset_species().items():
        datablock = entry.object or entry.collection
        what = "Object" if entry.object else "Variants in a collection" if entry.variants else "Collection"
        text = f"{what} of this file, used as it is; {entry.height:.3g} m tall"
        infos[identifier] = FileInfo(identifier, readable(datablock.name, NAME), text, Path())
    return infos


def name_of(identifier: str) -> str:
    """What to call an asset species in messages, even one whose object was deleted; the identifier of any other."""
    entry = find_asset(None, identifier)
    if entry is None:
        return identifier
    datablock = datablock_of(entry)
    return entry.name if datablock is None else datablock.name


def refuse_asset(scene: bpy.types.Scene | None, identifier: str) -> None:
    """Refuse an asset where a species is needed that grows.

    Raises
    ------
    SpeciesError
        It is one; or it was one, and its object was deleted.
    """
    entry = find_asset(scene, identifier)
    if entry is not None:
        name = readable(name_of(identifier), NAME)
        if datablock_of(entry) is None:
            raise SpeciesError(f'"{name}", which was used as a species, was deleted; undo, or choose another species')
        raise SpeciesError(f'"{name}" is an asset: it does not grow, and there is nothing to change in it here')


def stored_picture(pixels: NDArray[np.uint8]) -> str:
    """A picture (`PICTURE_SIDE`, `PICTURE_SIDE`, 4), the lowest row first, as text."""
    return base64.b85encode(zlib.compress(np.ascontiguousarray(pixels, np.uint8).tobytes(), 9)).decode()


def picture_of(entry: TetFloraAssetSpecies) -> NDArray[np.uint8] | None:
    """The stored picture; None where there is none that could be read."""
    size = PICTURE_SIDE * PICTURE_SIDE * 4
    try:
        pixels = zlib.decompressobj().decompress(base64.b85decode(entry.picture.encode()), size)
    except (ValueError, zlib.error):
        return None
    return np.frombuffer(pixels, np.uint8).reshape(PICTURE_SIDE, PICTURE_SIDE, 4) if len(pixels) == size else None


def wood_color(entry: TetFloraAssetSpecies) -> Floats:
    """Linear RGB (3,) of the lower half of what bears the crown, by the picture; else of the crown in its shade."""
    share = 0.5 * (entry.base - entry.height) / max(entry.height, 2.0 * entry.radius)
    if (picture := picture_of(entry)) is not None:
        seen = picture[: max(int(PICTURE_SIDE * (0.5 + FILLED * share)), 0)].reshape(-1, 4) / 255.0
        if cover := seen[:, 3:].sum():
            return (linear_of(seen[:, :3]) * seen[:, 3:]).sum(axis=0) / cover
    return 0.45 * np.array(entry.color)
