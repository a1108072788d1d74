# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that results replace: hidden while there are results, and shown again as they were.

Their earlier visibility is stored in custom properties, so that it survives saving, renaming, and deleting results by
hand. An object can be hidden for several scenes: it is shown when the last of them has no results any more.

Switches of what is linked are the library's, and those that are animated are set in each frame. Such an object is taken
out of collections of this file, and collections of the library are excluded; what else these hold, another shows
meanwhile. The scene remembers all of it in a custom property.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
from bpy.types import Collection, Depsgraph, LayerCollection, Object, Scene, ViewLayer

from ...errors import SceneError
from ..main_thread import in_main_thread, restore_in_main_thread
from ..materials.nodes import MADE, is_ours, is_own, tag, untag
from ..scene.motion import curves_of
from ..scene.objects import may_take_part
from . import output

#: Custom properties of scenes: one entry for what is hidden.
HIDDEN_LINKED = {'VIEW': "tetflora_hidden_linked", 'RENDER': "tetflora_hidden_linked_for_render"}
_FLAGS = ("hide_render", "hide_viewport", "hide_select")
_LAYER_FLAGS = ("holdout", "indirect_only", "hide_viewport")


def linked_hidden(scene: Scene, purpose: str) -> list[Object]:
    """Linked objects that are hidden for a scene's results."""
    record = scene.get(HIDDEN_LINKED[purpose])
    return [] if record is None else [e["object"] for e in record["objects"] if e["object"] is not None]


def is_switched(obj: Object) -> bool:
    """Whether an animation sets the visibility of an object."""
    animation = obj.animation_data
    if animation is None:
        return False
    actions = [strip.action for track in animation.nla_tracks for strip in track.strips if strip.action is not None]
    bags = [bag for action in actions for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    curves = (*curves_of(obj), *animation.drivers, *(curve for bag in bags for curve in bag.fcurves))
    return any(curve.data_path in _FLAGS for curve in curves)


def _hide_linked(scene: Scene, purpose: str, originals: Sequence[Object]) -> None:
    """Hide linked objects too, or none where one cannot be: then the error names it and says what to do."""
    hidden, homes = linked_hidden(scene, purpose), _collections(scene)
    wanted = list(dict.fromkeys([*hidden, *originals]))
    if len(wanted) == len(hidden):
        return
    known = {o for which in HIDDEN_LINKED for other in bpy.data.scenes for o in linked_hidden(other, which)}
    for obj in originals:
        if obj.library is None or obj in known:
            continue
        if scene.library is not None or not any(obj in c.objects[:] for c in homes):
            raise SceneError(
                f'"{obj.name}" is linked and in no collection of the scene "{scene.name}", so it cannot be hidden '
                "while results replace it; refine the object that instances its collection instead, or choose Object > "
                "Library Override > Make"
            )
    show_linked(scene, purpose)
    taken, excluded = [], set()
    for obj in wanted:
        for home in _collections(scene):
            if obj not in home.objects[:]:
                continue
            if home.library is None:
                taken.append({"collection": home, "object": obj})
            else:
                excluded.add(home)
    before = {key: layer.exclude for key, layer in _layers(scene)}
    beside = [copy for home in sorted(excluded, key=lambda c: c.name_full) if (copy := _beside(scene, home, wanted))]
    for entry in taken:
        entry["collection"].objects.unlink(entry["object"])
    _exclude(scene, before | {key: True for key, layer in _layers(scene) if layer.collection in excluded})
    paths = {key for key, layer in _layers(scene) if layer.collection in excluded}
    # ID properties hold pointers only in groups, and of scenes only those of collections that have users.
    scene[HIDDEN_LINKED[purpose]] = {
        "objects": [{"object": obj} for obj in wanted],
        "taken": [entry for entry in taken if entry["collection"] != scene.collection],
        "from_scene": [{"object": e["object"]} for e in taken if e["collection"] == scene.collection],
        "beside": [{"collection": copy} for copy in beside],
        "exclusions": json.dumps([[*key, value] for key, value in before.items() if key in paths]),
    }


def show_linked(scene: Scene, purpose: str) -> None:
    """Show what `_hide_linked` hid, as it was."""
    record = scene.get(HIDDEN_LINKED[purpose])
    if record is None:
        return
    for entry in record["beside"]:
        if entry["collection"] is not None:
            bpy.data.collections.remove(entry["collection"])
    exclusions = {key: layer.exclude for key, layer in _layers(scene)}
    stored = {tuple(key): value for *key, value in json.loads(record["exclusions"])}
    _exclude(scene, exclusions | {key: value for key, value in stored.items() if key in exclusions})
    homes = [(entry["collection"], entry["object"]) for entry in record["taken"]]
    homes += [(scene.collection, entry["object"]) for entry in record["from_scene"]]
    for home, obj in homes:
        if home is not None and obj is not None and obj not in home.objects[:]:
            home.objects.link(obj)
    del scene[HIDDEN_LINKED[purpose]]


def scenes_hiding() -> Iterator[tuple[Scene, str]]:
    """Scenes of this file for which linked objects are hidden, and for which results; those of renders first."""
    for purpose in ('RENDER', 'VIEW'):
        for scene in bpy.data.scenes:
            if scene.library is None and HIDDEN_LINKED[purpose] in scene:
                yield scene, purpose


def _collections(scene: Scene) -> list[Collection]:
    return [scene.collection, *scene.collection.children_recursive]


def _layers(scene: Scene) -> Iterator[tuple[tuple[str, str], LayerCollection]]:
    """All layer collections but the first ones, parents first, by view layer and path."""
    for view_layer in scene.view_layers:
        waiting = [(child.collection.name_full, child) for child in view_layer.layer_collection.children]
        while waiting:
            path, layer = waiting.pop()
            yield (view_layer.name, path), layer
            waiting += [(f"{path}\n{child.collection.name_full}", child) for child in layer.children]


def _exclude(scene: Scene, wanted: dict[tuple[str, str], bool]) -> None:
    """Exclude collections from view layers; what is set for one also sets those within it, which come later here."""
    for key, layer in _layers(scene):
        if layer.exclude != wanted.get(key, layer.exclude):
            layer.exclude = wanted[key]


def _beside(scene: Scene, home: Collection, hidden: Sequence[Object]) -> Collection | None:
    """A collection with all of another but what is hidden, as visible; None where nothing else is in it."""
    others = [obj for obj in home.objects if obj not in hidden]
    if not others:
        return None
    copy = bpy.data.collections.new(f"{home.name} (TetFlora)")
    tag(copy)
    for obj in others:
        copy.objects.link(obj)
    scene.collection.children.link(copy)
    for flag in _FLAGS:
        setattr(copy, flag, getattr(home, flag))
    for view_layer in scene.view_layers:
        copy_layer = next(child for child in view_layer.layer_collection.children if child.collection == copy)
        shown = [layer for (name, _), layer in _layers(scene) if name == view_layer.name and layer.collection == home]
        copy_layer.exclude = all(layer.exclude for layer in shown)
        for layer in shown[:1]:
            for flag in _LAYER_FLAGS:
                setattr(copy_layer, flag, getattr(layer, flag))
    return copy


#: Custom properties of hidden objects, as JSON: hide_render and hide_viewport before ("flags"), and the names of the
#: scenes with the results ("scenes"). Results of a render come last and go first.
HIDDEN = {'VIEW': "tetflora_hidden", 'RENDER': "tetflora_hidden_for_render"}
#: Custom property of scenes in files: marks of library overrides, which Blender does not store with these.
OVERRIDES = "tetflora_hidden_overrides"


def hide_originals(scene: Scene, purpose: str, originals: Sequence[Object]) -> None:
    """Hide objects that results replace, in viewports too unless the results are only for a render.

    Raises
    ------
    SceneError
        One is linked in such a way that it cannot be hidden: see `check_linked`. None is hidden then.
    """
    apart = [original for original in originals if original.library is not None or is_switched(original)]
    _hide_linked(scene, purpose, apart)
    for original in originals:
        if original in apart:
            continue
        # Where it is hidden for another scene already, its current visibility is not the artist's.
        flags, scenes = _marker(original, purpose) or ([original.hide_render, original.hide_viewport], [])
        if scene.name in scenes and original.hide_render:
            continue  # writing equal values would make Blender evaluate it again
        _mark(original, purpose, flags, sorted({*scenes, scene.name}))
        original.hide_render = True
        original.hide_viewport = original.hide_viewport or purpose == 'VIEW'


def remove_results(scene: Scene, purpose: str | None = None, keep: Sequence[Collection] = ()) -> int:
    """Remove result collections and show what they replace; returns the number of datablocks removed."""
    adopt_copies()
    for which in ('RENDER', 'VIEW'):
        if purpose in {None, which}:
            show_originals(scene, which)
    return sum(output.remove_collection(scene, c) for c in output.result_collections(scene, purpose) if c not in keep)


def adopt_copies() -> None:
    """Mark results of full copies of scenes as these scenes' own, before results are changed or removed.

    Copies inherit marks but not names, and what their originals hide is hidden for the scene that was copied.
    """
    for scene in bpy.data.scenes:
        every = output.result_collections(scene)
        copies = [c for c in every if not is_ours(c) and (c[MADE], None) in bpy.data.collections]
        for collection in copies:
            every = [collection, *collection.objects, *(o.data for o in collection.objects if o.data is not None)]
            ours = [d for d in every if MADE in d and d.library is None]
            # The artist's own copies of results come later in a collection than these.
            for datablock in {(type(d), d[MADE]): d for d in reversed(ours)}.values():
                tag(datablock)
        for original in scene.objects if copies else ():
            for purpose in HIDDEN:
                if (marker := _marker(original, purpose)) is not None and list(original.users_scene) == [scene]:
                    _mark(original, purpose, marker[0], [scene.name])


def hidden_originals(scene: Scene, purpose: str | None = None) -> list[Object]:
    """Objects hidden for a scene's results, or for results that are gone; they may be in the scene no more."""
    purposes = HIDDEN if purpose is None else [purpose]
    marked = [o for which in purposes for o in _marked(which) if _concerns(scene, o, which)]
    return marked + [o for which in purposes for o in linked_hidden(scene, which)]


def show_originals(scene: Scene, purpose: str) -> None:
    """Show what is hidden for a scene's results of one purpose."""
    show_linked(scene, purpose)
    for original in hidden_originals(scene, purpose):
        flags, _ = _marker(original, purpose)
        others = _others(scene, original, purpose)
        if others:
            _mark(original, purpose, flags, others)
        else:
            _show(original, purpose)


def artists_flags(original: Object) -> list[bool]:
    """Whether an object is hidden in renders and in viewports, as the artist left it."""
    marks = [marker for purpose in HIDDEN if (marker := _marker(original, purpose)) is not None]
    return marks[0][0] if marks else [original.hide_render, original.hide_viewport]


def _show(original: Object, purpose: str) -> None:
    original.hide_render, original.hide_viewport = _marker(original, purpose)[0]
    del original[HIDDEN[purpose]]


def _marked(purpose: str) -> list[Object]:
    """Objects of this file, not of its libraries, that are hidden."""
    return [o for o in bpy.data.objects if HIDDEN[purpose] in o and o.library is None]


def _marker(original: Object, purpose: str) -> tuple[list[bool], list[str]] | None:
    """Flags before it was hidden, and names of scenes; None for an object that is not hidden."""
    stored = original.get(HIDDEN[purpose])
    if stored is None:
        return None
    marker = json.loads(stored)
    return marker["flags"], marker["scenes"]


def _mark(original: Object, purpose: str, flags: list[bool], scenes: list[str]) -> None:
    original[HIDDEN[purpose]] = json.dumps({"flags": flags, "scenes": scenes})


def _concerns(scene: Scene, original: Object, purpose: str) -> bool:
    return scene.name in _marker(original, purpose)[1] or not _others(scene, original, purpose)


def _others(scene: Scene, original: Object, purpose: str) -> list[str]:
    """Names of other scenes whose results replace an object."""
    return [other.name for other in _replacing(original, purpose) if other != scene]


def _replacing(original: Object, purpose: str) -> list[Scene]:
    """Scenes whose results replace an object; where one was renamed, those that the object is in."""
    names = _marker(original, purpose)[1]
    renamed = any(name not in bpy.data.scenes for name in names)
    scenes = [scene for scene in bpy.data.scenes if output.result_collections(scene, purpose)]
    return [s for s in scenes if s.name in names or (renamed and s.objects.get(original.name) == original)]


def keep_results(scene: Scene) -> int:
    """Turn a scene's results into ordinary meshes; returns their number. Objects that they replace stay hidden."""
    adopt_copies()
    for original in _marked('VIEW'):
        if _concerns(scene, original, 'VIEW') and not _others(scene, original, 'VIEW'):
            del original[HIDDEN['VIEW']]
    if (record := scene.get(HIDDEN_LINKED['VIEW'])) is not None:
        for entry in record["beside"]:
            if entry["collection"] is not None:
                untag(entry["collection"])
        del scene[HIDDEN_LINKED['VIEW']]
    kept = 0
    for collection in output.result_collections(scene, 'VIEW'):
        output.mark_runtime(collection, False)
        for source in output.sources_of(collection.objects):
            untag(source)
        for obj in collection.objects:
            if is_own(obj):
                kept += obj.get(output.KIND) != output.PARENT
                obj.hide_select = False
                for datablock in (obj, obj.data):
                    if datablock is not None:
                        untag(datablock)
        output.release_copies(collection)
        del collection[output.PURPOSE]
        untag(collection)
        collection.name = "TetFlora kept"
    return kept


def lift_marks() -> dict[tuple, str | list]:
    """Show what is hidden for results that files do not hold: those of renders, and the artist's unless saved.

    Returns
    -------
    dict
        Marks by purpose and object, and linked objects by purpose, name of the scene and None, for `restore_marks`.
    """
    lifted = {}
    for scene, purpose in list(scenes_hiding()):
        if purpose == 'RENDER' or not scene.tetflora.output.save_results:
            lifted[purpose, scene.name, None] = [name_of(o) for o in linked_hidden(scene, purpose)]
            show_linked(scene, purpose)
    for purpose in ('RENDER', 'VIEW'):
        for original in _marked(purpose):
            replacing = _replacing(original, purpose)
            if purpose == 'RENDER' or not any(scene.tetflora.output.save_results for scene in replacing):
                lifted[purpose, original.name] = original[HIDDEN[purpose]]
                _show(original, purpose)
    return lifted


def name_of(obj: Object) -> tuple[str, str]:
    """Names of an object and of its library, empty for this file. Saving a file may change the paths of libraries."""
    return obj.name, "" if obj.library is None else obj.library.name


def object_named(key: tuple[str, str]) -> Object | None:
    """The object that `name_of` names; None where it is gone."""
    name, home = key
    library = bpy.data.libraries.get(home) if home else None
    if home and library is None:
        return None
    return bpy.data.objects.get((name, None if library is None else library.filepath))


def restore_marks(lifted: dict[tuple, str | list]) -> None:
    """Hide again what `lift_marks` showed."""
    for (purpose, name, *linked), mark in reversed(lifted.items()):
        if linked:
            scene, objects = bpy.data.scenes.get((name, None)), [object_named(key) for key in mark]
            if scene is not None:
                _hide_linked(scene, purpose, [obj for obj in objects if obj is not None])
            continue
        original = bpy.data.objects.get((name, None))
        if original is not None:
            original[HIDDEN[purpose]] = mark
            original.hide_render = True
            original.hide_viewport = original.hide_viewport or purpose == 'VIEW'


def show_left_over() -> None:
    """Show what is hidden for results that the file that was just read does not hold."""
    for scene, purpose in list(scenes_hiding()):
        if purpose == 'RENDER' or not output.result_collections(scene, 'VIEW'):
            show_linked(scene, purpose)
    for original in _marked('RENDER'):
        _show(original, 'RENDER')
    for original in _marked('VIEW'):
        names = _marker(original, 'VIEW')[1]
        homes = [s for s in bpy.data.scenes if s.name in names or s.objects.get(original.name) == original]
        if not any(output.result_collections(scene, 'VIEW') for scene in homes):
            _show(original, 'VIEW')


def pack_override_marks() -> None:
    """Store marks of library overrides, whose new properties Blender does not save, with a scene.

    Only while a file is written, because objects that a property refers to cannot be deleted.
    """
    packed = [{"object": o, "mark": o[HIDDEN['VIEW']]} for o in _marked('VIEW') if o.override_library is not None]
    home = next((scene for scene in bpy.data.scenes if scene.library is None), None)
    if packed and home is not None:
        home[OVERRIDES] = packed


def unpack_override_marks() -> None:
    """Restore the marks that `pack_override_marks` stored."""
    for scene in bpy.data.scenes:
        if scene.library is not None or OVERRIDES not in scene:
            continue
        for entry in scene[OVERRIDES]:
            original = entry["object"]
            if original is not None and original.library is None:
                original[HIDDEN['VIEW']] = entry["mark"]
        del scene[OVERRIDES]


def _not_evaluated(scene: Scene, layer: ViewLayer) -> dict[Object, tuple[bool, bool]]:
    """What renders but is disabled in viewports, or its collections are: whether it is itself, and its eye closed."""
    disabled = [c for c in scene.collection.children_recursive if c.hide_viewport and not c.hide_render]
    within = {o for c in disabled for o in c.all_objects}
    off = [o for o in layer.objects if o.hide_viewport or (o in within and not o.visible_get(view_layer=layer))]
    read = [o for o in off if (may_take_part(o) or o.tetflora.is_occluder) and o.type != 'EMPTY' and not o.hide_render]
    return {o: (o.hide_viewport, o.hide_get(view_layer=layer)) for o in read if not is_switched(o)}


@contextmanager
def originals_shown(scene: Scene, depsgraph: Depsgraph | None = None) -> Iterator[None]:
    """Show objects that results of any scene hide as the artist left them, while the context lasts.

    The dependency graph is updated if it is given, which only evaluated data requires. What renders but is disabled in
    viewports, which Blender evaluates nothing of, then has a closed eye instead, in a collection that is not disabled.
    """
    linked = [(scene, purpose, linked_hidden(scene, purpose)) for scene, purpose in scenes_hiding()]
    marked = [(o, purpose) for purpose in ('RENDER', 'VIEW') for o in _marked(purpose)]
    before = {o: (o.hide_render, o.hide_viewport) for o, _ in marked}
    layer, closed, apart = getattr(depsgraph, "view_layer", None), {}, []

    def show() -> None:
        for home, purpose, _ in linked:
            show_linked(home, purpose)
        for o, purpose in marked:
            o.hide_render, o.hide_viewport = _marker(o, purpose)[0]
        closed.update({} if layer is None else _not_evaluated(scene, layer))
        apart.extend([bpy.data.collections.new("shown")] if closed else [])
        for collection in apart:
            scene.collection.children.link(collection)
        for o in closed:
            apart[0].objects.link(o)
            o.hide_viewport = False
            o.hide_set(True, view_layer=layer)

    def restore() -> None:
        for collection in apart:
            bpy.data.collections.remove(collection)
        for o, (off, eye) in closed.items():
            o.hide_viewport = off
            o.hide_set(eye, view_layer=layer)
        for o, flags in before.items():
            o.hide_render, o.hide_viewport = flags
        for home, purpose, every in reversed(linked):
            _hide_linked(home, purpose, every)

    try:
        in_main_thread(show)
        if (before or linked or closed) and layer is not None:
            depsgraph.update()
        yield
    finally:
        restore_in_main_thread(restore)
