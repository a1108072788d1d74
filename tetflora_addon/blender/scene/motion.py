# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where objects are while the shutter is open.

Blender evaluates what moves at other times in a scene of its own, which nobody sees: whatever moves an object counts,
and the scene that is read stays as it is. Only rigid bodies, which belong to their scene, stand still there.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import TypeVar

import bpy
import numpy as np

from ...arrays import Floats
from .. import attributes
from ..main_thread import in_main_thread

_Seen = TypeVar("_Seen")


def exposure(scene: bpy.types.Scene) -> tuple[float, float]:
    """Frames at which the shutter opens and closes around the scene's frame."""
    open_at = {'START': 0.0, 'CENTER': -0.5, 'END': -1.0}[scene.render.motion_blur_position]
    first = scene.frame_current_final + open_at * scene.render.motion_blur_shutter
    return first, first + scene.render.motion_blur_shutter


def bags_of(datablock: bpy.types.ID) -> list[bpy.types.ActionChannelbag]:
    """What holds the curves of a datablock's action."""
    animation = datablock.animation_data
    if animation is None or animation.action is None or animation.action_slot is None:
        return []
    strips = [strip for layer in animation.action.layers for strip in layer.strips]
    return [bag for strip in strips if (bag := strip.channelbag(animation.action_slot)) is not None]


def curves_of(datablock: bpy.types.ID) -> Iterator[bpy.types.FCurve]:
    """Curves of a datablock's action."""
    return (curve for bag in bags_of(datablock) for curve in bag.fcurves)


def at_moments(
    depsgraph: bpy.types.Depsgraph, movers: list[bpy.types.Object], frames: Iterable[float], look: Callable[[], _Seen]
) -> list[_Seen]:
    """What a function finds at each of some frames, where `attributes.world_matrix` tells where movers are then."""
    now, *others = in_main_thread(partial(_placed, depsgraph, movers, (depsgraph.scene.frame_current_final, *frames)))
    back, seen = np.linalg.pinv(now), []
    try:
        for then in others:
            attributes.elsewhere = dict(zip((obj.session_uid for obj in movers), then @ back, strict=True))
            seen.append(look())
    finally:
        attributes.elsewhere = {}
    return seen


def _placed(depsgraph: bpy.types.Depsgraph, movers: list[bpy.types.Object], frames: Iterable[float]) -> list[Floats]:
    """Matrices (n, 4, 4) of objects at each of some frames; unit where one is not a number."""
    scene = bpy.data.scenes.new("moments")
    # Of what children hang on Blender evaluates where it is, hidden or not, and not its geometry.
    children = [bpy.data.objects.new("moments", None) for _ in movers]
    # What watches the scene shall not look again: nothing has changed.
    every = bpy.app.handlers
    handlers = every.depsgraph_update_pre, every.depsgraph_update_post, every.frame_change_pre, every.frame_change_post
    kept, matrices = [list(hooks) for hooks in handlers], []
    try:
        for hooks in handlers:
            hooks.clear()
        for child, obj in zip(children, movers, strict=True):
            scene.collection.objects.link(child)
            child.parent = obj
        for frame in frames:
            # Not by an update of the view layer: that would leave animated values of this frame in the file.
            scene.frame_set(math.floor(frame), subframe=frame % 1.0)
            graph = scene.view_layers[0].depsgraph
            placed = np.array([obj.evaluated_get(graph).matrix_world for obj in movers], np.float64).reshape(-1, 4, 4)
            matrices.append(np.where(np.isfinite(placed).all(axis=(1, 2), keepdims=True), placed, np.eye(4)))
    finally:
        bpy.data.batch_remove([*children, scene])
        depsgraph.update()
        for hooks, functions in zip(handlers, kept, strict=True):
            hooks.extend(functions)
    return matrices
