# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a scene renders and may take part in refinement, by view layer, and results that only some layers show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import bpy


def view_layer_groups(scene: bpy.types.Scene) -> list[list[bpy.types.ViewLayer]]:
    """Rendered view layers with something to refine, together where it is the same; at least one group.

    Layers that render the same plants share a refinement; where each has plants of its own, each gets one.
    """
    layers = [layer for layer in scene.view_layers if layer.use] or list(scene.view_layers)
    if len(layers) == 1:
        return [layers]  # at no cost: films of ten thousand objects have mostly one
    groups: dict[frozenset[int], list[bpy.types.ViewLayer]] = {}
    for layer in layers:
        rendered = list(renderable_objects(layer))
        if any(may_take_part(o) for o in rendered):
            held = frozenset(o.session_uid for o in rendered if may_take_part(o) or o.tetflora.is_occluder)
            groups.setdefault(held, []).append(layer)
    return list(groups.values()) or [layers[:1]]


def show_in(
    scene: bpy.types.Scene, results: Sequence[bpy.types.Collection], layers: Sequence[bpy.types.ViewLayer]
) -> None:
    """Leave results out of all rendered view layers of a scene but some."""
    for layer in scene.view_layers:
        if layer.use and layer not in layers:
            for child in layer.layer_collection.children:
                if child.collection in results:
                    child.exclude = True


def renderable_objects(view_layer: bpy.types.ViewLayer) -> Iterator[bpy.types.Object]:
    """Objects of a view layer that render: neither they nor all of their collections are hidden in renders."""
    seen: set[int] = set()
    open_layers = [view_layer.layer_collection]
    while open_layers:
        layer = open_layers.pop()
        if layer.exclude or layer.collection.hide_render:
            # Children of an excluded collection can be included again, those of a hidden one cannot be shown.
            open_layers += [] if layer.collection.hide_render else list(layer.children)
            continue
        open_layers += list(layer.children)
        for obj in layer.collection.objects:
            if not obj.hide_render and (pointer := obj.as_pointer()) not in seen:
                seen.add(pointer)
                yield obj


def takes_part(obj: bpy.types.Object) -> bool:
    """Whether an object is a plant, a field of plants, or a mesh that takes part in refinement."""
    return obj.tetflora.is_plant or obj.tetflora.is_field or obj.tetflora.is_explicit


def may_take_part(obj: bpy.types.Object) -> bool:
    """Whether an object takes part in refinement, or may instance some that do; cheap."""
    return takes_part(obj) or may_instance(obj)


def has_contents(scene: bpy.types.Scene) -> bool:
    """Whether a scene may hold something to refine; cheap, and never wrong where there is something."""
    if any(takes_part(o) for o in scene.objects):
        return True
    # What is instanced need not lie in the scene, but somewhere.
    return any(takes_part(o) for o in bpy.data.objects) and any(may_instance(o) for o in scene.objects)


def has_nodes(obj: bpy.types.Object) -> bool:
    """Whether geometry nodes may instance something on an object, or make points of it."""
    return any(modifier.type == 'NODES' for modifier in obj.modifiers)


def may_instance(obj: bpy.types.Object) -> bool:
    """Whether an object may stand for others."""
    return obj.is_instancer or has_nodes(obj)


def objects_within(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """Objects of a collection and of those within it, each once.

    What ``Collection.all_objects`` says; but that fills a cache which Blender 4.5 to 5.2 leaves stale at undo, and the
    next undo, or reading it, may then end in a crash.
    """
    homes = [collection, *collection.children_recursive]
    return list(dict.fromkeys(obj for home in homes for obj in home.objects))
