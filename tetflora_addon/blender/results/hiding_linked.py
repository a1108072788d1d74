# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Linked objects that results replace: hidden and shown again without a change to what is linked.

Their own switches belong to the library, or to an animation, which sets them again in each frame. What belongs to this
file is which collections hold them: an object is taken out of collections of this file, and collections of the library
are excluded from the view layers. What else these hold is shown by a collection of this file meanwhile. The scene
remembers all of it in a custom property.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

import bpy

from ...errors import SceneError
from ..materials.nodes import tag, untag
from ..scene.motion import curves_of

#: Custom properties of scenes: one entry for what is hidden.
HIDDEN = {'VIEW': "tetflora_hidden_linked", 'RENDER': "tetflora_hidden_linked_for_render"}
_FLAGS = ("hide_render", "hide_viewport", "hide_select")
_LAYER_FLAGS = ("holdout", "indirect_only", "hide_viewport")


def linked_hidden(scene: bpy.types.Scene, purpose: str) -> list[bpy.types.Object]:
    """Linked objects that are hidden for a scene's results."""
    record = scene.get(HIDDEN[purpose])
    return [] if record is None else [e["object"] for e in record["objects"] if e["object"] is not None]


def is_switched(obj: bpy.types.Object) -> bool:
    """Whether an animation sets the visibility of an object."""
    animation = obj.animation_data
    if animation is None:
        return False
    actions = [strip.action for track in animation.nla_tracks for strip in track.strips if strip.action is not None]
    bags = [bag for action in actions for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    curves = (*curves_of(obj), *animation.drivers, *(curve for bag in bags for curve in bag.fcurves))
    return any(curve.data_path in _FLAGS for curve in curves)


def check_linked(scene: bpy.types.Scene, originals: Sequence[bpy.types.Object]) -> None:
    """See whether `hide_linked` can hide objects.

    Raises
    ------
    SceneError
        It cannot hide one; the message names it and says what to do.
    """
    known = {o for purpose in HIDDEN for other in bpy.data.scenes for o in linked_hidden(other, purpose)}
    homes = _collections(scene)
    for obj in originals:
        if obj.library is None or obj in known:
            continue
        if scene.library is not None or not any(obj in c.objects[:] for c in homes):
            raise SceneError(
                f'"{obj.name}" is linked and in no collection of the scene "{scene.name}", so it cannot be hidden '
                "while results replace it; refine the object that instances its collection instead, or choose Object > "
                "Library Override > Make"
            )


def hide_linked(scene: bpy.types.Scene, purpose: str, originals: Sequence[bpy.types.Object]) -> None:
    """Hide linked objects too.

    Raises
    ------
    SceneError
        As `check_linked`, before anything is hidden.
    """
    hidden = linked_hidden(scene, purpose)
    wanted = list(dict.fromkeys([*hidden, *originals]))
    if len(wanted) == len(hidden):
        return
    check_linked(scene, originals)
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
    before = _exclusions(scene)
    beside = [made for home in sorted(excluded, key=lambda c: c.name_full) if (made := _beside(scene, home, wanted))]
    for entry in taken:
        entry["collection"].objects.unlink(entry["object"])
    _exclude(scene, before | {key: True for key, layer in _layers(scene) if layer.collection in excluded})
    paths = {key for key, layer in _layers(scene) if layer.collection in excluded}
    # ID properties hold pointers only in groups, and of scenes only those of collections that have users.
    scene[HIDDEN[purpose]] = {
        "objects": [{"object": obj} for obj in wanted],
        "taken": [entry for entry in taken if entry["collection"] != scene.collection],
        "from_scene": [{"object": e["object"]} for e in taken if e["collection"] == scene.collection],
        "beside": [{"collection": made} for made in beside],
        "exclusions": json.dumps([[*key, value] for key, value in before.items() if key in paths]),
    }


def show_linked(scene: bpy.types.Scene, purpose: str) -> None:
    """Show what `hide_linked` hid, as it was."""
    record = scene.get(HIDDEN[purpose])
    if record is None:
        return
    for entry in record["beside"]:
        if entry["collection"] is not None:
            bpy.data.collections.remove(entry["collection"])
    there = {key: layer.exclude for key, layer in _layers(scene)}
    stored = {tuple(key): value for *key, value in json.loads(record["exclusions"])}
    _exclude(scene, there | {key: value for key, value in stored.items() if key in there})
    homes = [(entry["collection"], entry["object"]) for entry in record["taken"]]
    homes += [(scene.collection, entry["object"]) for entry in record["from_scene"]]
    for home, obj in homes:
        if home is not None and obj is not None and obj not in home.objects[:]:
            home.objects.link(obj)
    del scene[HIDDEN[purpose]]


def leave_hidden(scene: bpy.types.Scene) -> None:
    """Let what is hidden for the artist's results stay so: they are kept."""
    record = scene.get(HIDDEN['VIEW'])
    if record is not None:
        for entry in record["beside"]:
            if entry["collection"] is not None:
                untag(entry["collection"])
        del scene[HIDDEN['VIEW']]


def scenes_hiding() -> Iterator[tuple[bpy.types.Scene, str]]:
    """Scenes of this file for which linked objects are hidden, and for which results; those of renders first."""
    for purpose in ('RENDER', 'VIEW'):
        for scene in bpy.data.scenes:
            if scene.library is None and HIDDEN[purpose] in scene:
                yield scene, purpose


def _collections(scene: bpy.types.Scene) -> list[bpy.types.Collection]:
    return [scene.collection, *scene.collection.children_recursive]


def _layers(scene: bpy.types.Scene) -> Iterator[tuple[tuple[str, str], bpy.types.LayerCollection]]:
    """All layer collections but the first ones, parents first, by view layer and path."""
    for view_layer in scene.view_layers:
        waiting = [(child.collection.name_full, child) for child in view_layer.layer_collection.children]
        while waiting:
            path, layer = waiting.pop()
            yield (view_layer.name, path), layer
            waiting += [(f"{path}\n{child.collection.name_full}", child) for child in layer.children]


def _exclusions(scene: bpy.types.Scene) -> dict[tuple[str, str], bool]:
    return {key: layer.exclude for key, layer in _layers(scene)}


def _exclude(scene: bpy.types.Scene, wanted: dict[tuple[str, str], bool]) -> None:
    """Exclude collections from view layers; what is set for one also sets those within it, which come later here."""
    for key, layer in _layers(scene):
        if layer.exclude != wanted.get(key, layer.exclude):
            layer.exclude = wanted[key]


def _beside(
    scene: bpy.types.Scene, home: bpy.types.Collection, hidden: Sequence[bpy.types.Object]
) -> bpy.types.Collection | None:
    """A collection with all of another but what is hidden, as visible; None where nothing else is in it."""
    others = [obj for obj in home.objects if obj not in hidden]
    if not others:
        return None
    made = bpy.data.collections.new(f"{home.name} (TetFlora)")
    tag(made)
    for obj in others:
        made.objects.link(obj)
    scene.collection.children.link(made)
    for flag in _FLAGS:
        setattr(made, flag, getattr(home, flag))
    for view_layer in scene.view_layers:
        own = next(child for child in view_layer.layer_collection.children if child.collection == made)
        shown = [layer for (name, _), layer in _layers(scene) if name == view_layer.name and layer.collection == home]
        own.exclude = all(layer.exclude for layer in shown)
        for layer in shown[:1]:
            for flag in _LAYER_FLAGS:
                setattr(own, flag, getattr(layer, flag))
    return made
