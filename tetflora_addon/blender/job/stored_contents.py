# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants, meshes and lights of a scene as texts, which tell whether results are out of date.

`frame_cache.scene_digest` knows exactly, but reads the scene as refining does: ten seconds for 100,000 plants. Here all
is taken as it is stored, within a second, and only after Blender has told of a change. Who is seen is looked at always.
"""

from hashlib import blake2b

import bpy
import numpy as np

from ..assets.places import form_of
from ..attributes import members
from ..materials.nodes import is_ours
from ..results.hiding import artists_flags
from ..results.leaf_objects import leaf_objects
from ..runtime import handlers
from ..scene.fields import field_kinds
from ..scene.lights import sky_suns
from ..scene.looks import shown_objects
from ..scene.objects import may_take_part, objects_within
from ..species.asset_species import asset_species

# Who is there, and texts, by scene and layer.
_found: dict[tuple[int, str], tuple[tuple[int, int], dict[str, str]]] = {}


def stored_contents(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> dict[str, str]:
    """Texts that differ where what takes part does, by what to call it; those found last where nothing has changed."""
    key, who = (scene.session_uid, layer.name), (len(layer.objects), hash(tuple(shown_objects(layer))))
    if _found.get(key, ((),))[0] != who:
        _found[key] = who, _read(scene, layer)
    return _found[key][1]


def _read(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> dict[str, str]:
    shown, numbers, plants, kinds = set(shown_objects(layer)), [], [], set()
    lights: list[object] = [sky_suns(scene)]
    meshes: list[object] = [form_of(obj) for obj in leaf_objects(scene).values()]
    for number, obj in enumerate(layer.objects):
        group = obj.tetflora
        if group.is_plant or group.is_field:
            numbers.append(number)
            more = (field_kinds(obj), form_of(obj)) if group.is_field else group.skeleton and form_of(group.skeleton)
            kinds.update(more[0] if group.is_field else (group.species,))
            seen = obj in shown, obj.hide_render, group.enabled
            plants.append((group.species, group.seed, group.age, *seen, more))
        elif (lamp := obj.type == 'LIGHT') or ((group.is_occluder or may_take_part(obj)) and not is_ours(obj)):
            where = obj.matrix_world[:], obj.matrix_basis[:]  # what is hidden has but the latter
            (lights if lamp else meshes).append((obj.name_full, *where, artists_flags(obj), form_of(obj)))
    for identifier, asset in asset_species(scene).items():
        if identifier in kinds and asset.object is not None:  # it stands where its plants do
            meshes.append((identifier, asset.object.matrix_world.to_3x3()[:], form_of(asset.object)))
        elif identifier in kinds:
            meshes += [(identifier, o.matrix_world[:], form_of(o)) for o in objects_within(asset.collection)]
    place = members(layer.objects, "matrix_world", 16)[numbers]
    order = np.lexsort(place.T[12:])  # the order of objects is none of theirs
    standing = _digest(np.ascontiguousarray(place[order])), [plants[i] for i in order.tolist()]
    parts = {"the plants": standing, "the meshes": meshes, "the light": lights}
    return {name: _digest(repr(part).encode()) for name, part in parts.items()}


def _digest(content: bytes | np.ndarray) -> str:
    return blake2b(content, digest_size=8).hexdigest()


def _concerns(update: bpy.types.DepsgraphUpdate) -> bool:
    datablock, moved = update.id.original, update.is_updated_transform or update.is_updated_geometry
    told = isinstance(datablock, bpy.types.Object | bpy.types.Collection)  # that of how they look, too
    return (moved if told else not isinstance(datablock, bpy.types.Scene | bpy.types.Camera)) and not is_ours(datablock)


def _on_update(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if _found and any(map(_concerns, depsgraph.updates)):
        _found.clear()


def _forget(*_: object) -> None:
    _found.clear()


_ANEW = dict.fromkeys(("undo_post", "redo_post", "load_post", "frame_change_post"), _forget)
register, unregister = handlers(depsgraph_update_post=_on_update, **_ANEW)
