# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What results take over from the objects that they stand for: who sees them, what lights them, their passes.

A look is that as JSON, which settles what of several objects may become one result; empty for what new objects have.
"""

import json
from collections.abc import Callable, Iterable
from functools import cached_property
from typing import Any

import bpy
from mathutils import Matrix

from ..attributes import moves
from ..main_thread import on_main_thread

#: Custom property of result objects: their look.
LIKE = "tetflora_like"
#: Ends of the names of properties that begin with ``visible_``; the last is there from 5.1 on.
RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow", "raycast")
#: Properties of objects in a look. Instances have these of who shows them as well.
_FLAGS = ("is_holdout", "is_shadow_catcher", "hide_viewport")
_OWN = ("pass_index", "lightgroup")
_LINKING = ("receiver_collection", "blocker_collection")
_OTHERS = ("color", "display_type", "show_bounds")


class LayerLooks:
    """Looks of objects in a view layer, whose collections may say more than the objects."""

    def __init__(self, layer: bpy.types.ViewLayer, viewports: bool = True) -> None:
        self._layer, self._viewports = layer, viewports  # whether these matter, where eyes may be closed as well

    @cached_property
    def _unlike(self) -> tuple[bool, bool]:
        """Whether any collection is only indirect, or a holdout: else no object has to be asked."""
        collections = [self._layer.layer_collection]
        for one in collections:
            collections += one.children
        return any(one.indirect_only for one in collections), any(one.holdout for one in collections)

    @cached_property
    def _shows(self) -> Callable[[bpy.types.Object], bool]:
        if on_main_thread():
            return set(shown_objects(self._layer)).__contains__
        # In a render's thread, which must not change the context that windows draw from.
        return lambda obj: obj.visible_get(view_layer=self._layer)

    def of(self, obj: bpy.types.Object, instancer: bpy.types.Object | None = None, model: bool = False) -> str:
        """The look of an object, or of its instances that another shows, whose collections and holdout then count."""
        look = self._read(mover := instancer or obj)
        # What moves carries its results, which are blurred with it.
        if model and self._layer.id_data.render.use_motion_blur and moves(mover):
            here = mover.evaluated_get(self._layer.depsgraph).matrix_world
            look["carried_by"] = mover.name_full, [list(row) for row in here]
        if instancer is not None:
            inner = _of_object(obj)
            off = {*look.get("off", ()), *inner.pop("off", ())}
            inner.pop("is_holdout", None)
            look = inner | {n: v for n, v in look.items() if n not in _OWN} | ({"off": sorted(off)} if off else {})
        return json.dumps(look, sort_keys=True) if look else ""

    def _read(self, obj: bpy.types.Object) -> dict[str, Any]:
        look, (indirect, holdout) = _of_object(obj), self._unlike
        if indirect and obj.indirect_only_get(view_layer=self._layer):
            look["off"] = sorted({*look.get("off", ()), "camera"})
        if holdout and obj.holdout_get(view_layer=self._layer):
            look["is_holdout"] = True
        if self._viewports and not self._shows(obj):
            look["hide_viewport"] = True
        return look


def shown_objects(layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """Objects of a view layer that viewports show, but for what one alone leaves out, as in its local view.

    Blender lists them five times as fast as we ask each, but not while it renders without a window.
    """
    with bpy.context.temp_override(area=None, scene=layer.id_data, view_layer=layer):
        visible = getattr(bpy.context, "visible_objects", None)
    return [obj for obj in layer.objects if obj.visible_get(view_layer=layer)] if visible is None else visible


def _of_object(obj: bpy.types.Object) -> dict[str, Any]:
    """What an object says itself, but for what new objects say."""
    look = {name: value for name in (*_FLAGS, *_OWN) if (value := getattr(obj, name))}
    if off := [ray for ray in RAYS if not getattr(obj, f"visible_{ray}", True)]:
        look["off"] = sorted(off)
    linked = ((name, getattr(obj.light_linking, name)) for name in _LINKING)
    return look | {name: value.name_full for name, value in linked if value is not None}


def look_like(result: bpy.types.Object, like: bpy.types.Object | None, look: str | None = None) -> None:
    """Give a result the look, color and settings of Cycles of an object; nothing for None.

    Without a look it is what the object says itself, but for viewports: what is instanced may be hidden there.
    Output settings may hide it from more rays, but show it to none that the object is hidden from.
    """
    if like is None:
        return
    _copy(_OTHERS, like, result)
    cycles, others = getattr(result, "cycles", None), getattr(like, "cycles", None)
    if cycles is not None and others is not None:
        names = [p.identifier for p in cycles.bl_rna.properties if not p.is_readonly and p.identifier != "name"]
        _copy(names, others, cycles)
    said = json.loads(look or "{}")
    if look is None:
        said = _of_object(like)
        said.pop("hide_viewport", None)
    result[LIKE] = json.dumps({"pass_index": like.pass_index} | said)
    wear(result)


def wear(result: bpy.types.Object) -> dict[str, Any]:
    """Give a result what its look says, but for what output settings have a say in; returns the look."""
    look = json.loads(result.get(LIKE) or "{}")
    said = {name: look[name] for name in (*_FLAGS, *_OWN) if name in look}
    said |= {f"visible_{ray}": False for ray in look.get("off", ())}
    for name, value in said.items():
        if getattr(result, name) != value:  # each change makes Blender list all objects anew
            setattr(result, name, value)
    for name in _LINKING:
        if name in look and getattr(result.light_linking, name) is None:
            collection = next((c for c in bpy.data.collections if c.name_full == look[name]), None)
            setattr(result.light_linking, name, collection)
    if "carried_by" in look and not result.constraints:
        name, here = look["carried_by"]
        carried = result.constraints.new('CHILD_OF')
        carried.target = next((o for o in bpy.data.objects if o.name_full == name), None)
        carried.inverse_matrix = Matrix(here).inverted_safe()
    return look


def _copy(names: Iterable[str], source: bpy.types.bpy_struct, target: bpy.types.bpy_struct) -> None:
    """Copy what differs: each change makes Blender look at all that depends on it."""
    for name in names:
        value = getattr(source, name)
        value = tuple(value) if getattr(source.bl_rna.properties[name], "is_array", False) else value
        now = getattr(target, name)
        if (tuple(now) if isinstance(value, tuple) else now) != value:
            setattr(target, name, value)
