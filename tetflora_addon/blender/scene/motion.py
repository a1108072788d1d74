# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where objects are while the shutter is open.

Nothing is evaluated and the scene does not change: only curves of actions of objects and of their parents are read at
other times; what constraints, drivers, simulations and the NLA do stays as it is now.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import bpy
import numpy as np
from mathutils import Euler, Matrix, Quaternion

from ...arrays import Floats
from .. import attributes

#: Paths of animation that place an object, and how many values each has.
_CHANNELS = {"location": 3, "rotation_euler": 3, "rotation_quaternion": 4, "rotation_axis_angle": 4, "scale": 3}


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


@contextmanager
def moment(frame: float) -> Iterator[None]:
    """Let `attributes.world_matrix` tell where objects are at another frame, while the context lasts."""
    attributes.elsewhere = partial(_displaced, frame)
    try:
        yield
    finally:
        attributes.elsewhere = None


def _displaced(frame: float, obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Floats:
    """Matrix (4, 4) that takes an object from where it is now to where it is at a frame."""
    if not attributes.moves(obj):
        return np.eye(4)
    outer = np.eye(4) if obj.parent is None else _displaced(frame, obj.parent, depsgraph)
    now, then = (_animated_basis(obj, at) for at in (depsgraph.scene.frame_current_final, frame))
    if now is None or abs(now.determinant()) < 1e-12:
        return outer
    # What parents and constraints make of the object's own transform, as it is now.
    here = attributes.matrix_now(obj, depsgraph).astype(np.float64)
    carried = here @ np.array(now.inverted(), np.float64)
    return outer @ carried @ np.array(then, np.float64) @ np.linalg.pinv(here)


def _animated_basis(obj: bpy.types.Object, frame: float) -> Matrix | None:
    """An object's own transform at a time, from the curves of its action; None if it has none."""
    values = {path: list(getattr(obj, path)) for path in _CHANNELS}
    curves = 0
    for curve in curves_of(obj):
        if not curve.mute and curve.array_index < _CHANNELS.get(curve.data_path, 0):
            values[curve.data_path][curve.array_index] = curve.evaluate(frame)
            curves += 1
    if not curves:
        return None
    return Matrix.LocRotScale(values["location"], _rotation(obj, values), values["scale"])


def _rotation(obj: bpy.types.Object, values: dict[str, list[float]]) -> Quaternion:
    if obj.rotation_mode == 'QUATERNION':
        return Quaternion(values["rotation_quaternion"]).normalized()
    if obj.rotation_mode == 'AXIS_ANGLE':
        angle, *axis = values["rotation_axis_angle"]
        return Quaternion(axis, angle)
    return Euler(values["rotation_euler"], obj.rotation_mode).to_quaternion()
