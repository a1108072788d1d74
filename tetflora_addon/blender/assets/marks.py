# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects and collections as species, and objects as scatterers: what the artist marks, and what can be marked.

Which objects are species is stored with the scene and not with them, so that those that are linked can be species too.
An identifier follows from the name that the asset has when it becomes a species: taken off the list and put on again,
it is the species of the same plants.
"""

from __future__ import annotations

from collections.abc import Iterable
from hashlib import blake2b

import bpy
import numpy as np

from ...errors import SceneError
from ..materials.nodes import is_ours
from ..scene.objects import SURFACE_TYPES, may_instance
from ..species.asset_species import (
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
from .measures import measure, size_of
from .places import Scatter, read_scatters, variants_of

_NO_FACES = "it has no faces. Choose a mesh, curve or collection with a surface, or add faces"
_SAME = 1e-4  # relative difference of sizes that is none


def can_be_species(datablock: Datablock) -> bool:
    """Whether an object or collection may be used as a species; cheap."""
    if isinstance(datablock, bpy.types.Collection):
        return not is_ours(datablock)
    group = datablock.tetflora
    plant = group.is_plant or group.is_field
    return not plant and not is_ours(datablock) and (datablock.type in SURFACE_TYPES or may_instance(datablock))


def use_as_species(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, datablock: Datablock, variants: bool = False
) -> TetFloraAssetSpecies:
    """Make an object or a collection a species of this file; one that is a species already is measured anew.

    Parameters
    ----------
    scene : bpy.types.Scene
        Receives the entry.
    depsgraph : bpy.types.Depsgraph
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
    new = entry is None
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
    number = 0
    while True:
        text = f"{kind}:{datablock.name_full}:{number}"
        identifier = PREFIX + blake2b(text.encode(errors="backslashreplace"), digest_size=6).hexdigest()
        if identifier not in taken:
            return identifier
        number += 1


def measure_again(depsgraph: bpy.types.Depsgraph, entry: TetFloraAssetSpecies) -> bool:
    """Measure an asset and draw its picture; false where it has no faces."""
    found = measure(variants_of(entry, depsgraph), depsgraph)
    if found is None:
        return False
    entry.name = (entry.object or entry.collection).name
    for name in ("radius", "base", "height", "polygons", "leaves", "colour"):
        setattr(entry, name, getattr(found, name))
    entry.picture = stored_picture(found.picture)
    return True


def measure_all(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, identifiers: Iterable[str]) -> None:
    """Measure those assets anew that plants are to be placed of, and whose size has changed.

    What has no faces any more stays as it was.

    Raises
    ------
    SceneError
        As `places.variants_of`.
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
    if isinstance(datablock, bpy.types.Object) and asset_of(datablock) is None and datablock.instance_collection:
        datablock = datablock.instance_collection
    removed = 0
    while (entry := asset_of(datablock)) is not None and entry.id_data.library is None:
        _remove(entry)
        removed += 1
    if removed:
        tell_listeners()
    return removed


def _remove(entry: TetFloraAssetSpecies) -> None:
    entries = entry.id_data.tetflora.asset_species
    entries.remove(next(i for i, other in enumerate(entries) if other.identifier == entry.identifier))


def is_species(datablock: Datablock | None) -> bool:
    """Whether an object or a collection is used as a species, or an empty shows one that is; cheap."""
    if datablock is None:
        return False
    within = datablock.instance_collection if isinstance(datablock, bpy.types.Object) else None
    if within is not None and asset_of(within) is not None:
        return True
    entry = asset_of(datablock)
    return entry is not None and datablock_of(entry) is not None


def scattered(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Scatter:
    """What an object scatters.

    Raises
    ------
    SceneError
        Nothing that has faces, or as `places.read_scatters`; the message says what to do.
    """
    found = read_scatters([obj], depsgraph)[obj]
    if not found.places:
        if found.left:
            raise SceneError(
                f'"{obj.name}" scatters only objects without faces ({", ".join(sorted(found.left)[:3])}); nothing of '
                "them can be refined"
            )
        raise SceneError(
            f'"{obj.name}" shows no instances now. Show its modifiers in viewports, and keep them from realizing '
            "instances; for a mesh of its own use Refine This Mesh"
        )
    return found
