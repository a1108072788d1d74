# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which view layers of a scene a refinement serves, and results that only these show."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from .scene_reader import may_take_part, renderable_objects


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
