# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants, meshes and lights of a scene as texts, which tell whether results are out of date.

`frame_cache.scene_digest` knows exactly, but reads the scene as refining does: ten seconds for 100,000 plants. Here all
is taken as stored, in small steps of a second in all, after Blender told of a change. Who is seen is always looked at.
"""

from collections.abc import Generator, Iterator
from hashlib import blake2b

import numpy as np
from bpy.types import Camera, Collection, Depsgraph, DepsgraphUpdate, Object, Scene, ViewLayer

from ...jobs import run_to_end
from ..assets.places import form_steps
from ..materials.nodes import is_ours
from ..results.hiding import artists_flags
from ..results.leaf_objects import leaf_objects
from ..runtime import handlers
from ..scene.fields import field_kinds
from ..scene.lights import sky_suns
from ..scene.objects import in_parts, may_take_part, objects_within
from ..species.asset_species import asset_species

# Who is there, and texts, by scene and layer.
_contents: dict[tuple[int, str], tuple[int, dict[str, str]]] = {}


def stored_contents(scene: Scene, layer: ViewLayer) -> dict[str, str]:
    """Texts that differ where what takes part does, by what to call it; those found last where nothing has changed."""
    return run_to_end(stored_contents_steps(scene, layer))


def stored_contents_steps(scene: Scene, layer: ViewLayer) -> Generator[None, None, dict[str, str]]:
    """The same in small steps; if Blender tells of a change between two of them, what is found is good for nothing."""
    key, shown = (scene.session_uid, layer.name), {}
    for obj in in_parts(layer.objects):
        shown[obj.session_uid] = obj.visible_get(view_layer=layer)
        yield
    if _contents.get(key, (None,))[0] != (who := hash((*shown, *shown.values()))):
        _contents[key] = who, (yield from _read(scene, layer, shown))
    return _contents[key][1]


def _lineage(obj: Object | None) -> Iterator[Object]:
    while obj is not None:
        yield obj
        obj = obj.parent


def _read(scene: Scene, layer: ViewLayer, shown: dict[int, bool]) -> Generator[None, None, dict[str, str]]:
    kinds, sums = set(), dict.fromkeys(("the plants", "the meshes", "the light"), 0)

    def add(part: str, obj: Object | None, *said: object, hideable: bool = False) -> None:
        """Sums, as the order of objects is none of theirs. Nobody evaluates what is hidden, least of all after undo."""
        places = [] if obj is None else [obj.matrix_world]
        if obj is not None and (hideable or not shown.get(obj.session_uid)):
            places = [one.matrix_basis for one in _lineage(obj)]
        place = np.array(places, np.float32).tobytes()
        sums[part] += int.from_bytes(blake2b(repr(said).encode() + place, digest_size=8).digest())

    add("the light", None, sky_suns(scene))
    for leaf in leaf_objects(scene).values():
        add("the meshes", None, (yield from form_steps(leaf)))
    for obj in in_parts(layer.objects):
        group = obj.tetflora
        if group.is_plant or group.is_field:
            species = field_kinds(obj) if group.is_field else (group.species,)
            kinds.update(species)
            said = species, group.seed, group.age, shown.get(obj.session_uid), obj.hide_render, group.enabled
            form = obj if group.is_field else group.skeleton
            add("the plants", obj, said, (yield from form_steps(form)) if form else None)
        elif (lamp := obj.type == 'LIGHT') or ((group.is_occluder or may_take_part(obj)) and not is_ours(obj)):
            said = obj.name_full, artists_flags(obj), (yield from form_steps(obj))
            add("the light" if lamp else "the meshes", obj, said, hideable=not lamp and may_take_part(obj))
        yield
    for identifier, species, parts in [(key, one.object, one.collection) for key, one in asset_species(scene).items()]:
        if identifier in kinds and species is not None:  # it stands where its plants do
            turned = species.matrix_world if shown.get(species.session_uid) else species.matrix_basis
            add("the meshes", None, identifier, turned.to_3x3()[:], (yield from form_steps(species)))
        for obj in objects_within(parts) if identifier in kinds and species is None else ():
            add("the meshes", obj, identifier, (yield from form_steps(obj)))
    return {part: f"{total % 2**64:016x}" for part, total in sums.items()}


def _concerns(update: DepsgraphUpdate) -> bool:
    datablock, moved = update.id.original, update.is_updated_transform or update.is_updated_geometry
    told = isinstance(datablock, Object | Collection)  # that of how they look, too
    return (moved if told else not isinstance(datablock, Scene | Camera)) and not is_ours(datablock)


def _on_update(_scene: Scene, depsgraph: Depsgraph) -> None:
    if _contents and any(map(_concerns, depsgraph.updates)):
        _contents.clear()


def _forget(*_: object) -> None:
    _contents.clear()


_ANEW = dict.fromkeys(("undo_post", "redo_post", "load_post", "frame_change_post"), _forget)
register, unregister = handlers(depsgraph_update_post=_on_update, **_ANEW)
