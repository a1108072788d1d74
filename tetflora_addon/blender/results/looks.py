# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What results that stand for an object of the artist take over from it: who sees it, what lights it, its passes."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import bpy

#: Custom property of result objects, as JSON: which rays do not see what they stand for, and its light group.
LIKE = "tetflora_like"
#: Ends of the names of properties that begin with ``visible_``; the last is there from 5.1 on.
RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow", "raycast")
_OWN = ("is_holdout", "is_shadow_catcher", "pass_index", "color", "display_type", "show_bounds")
_LINKING = ("receiver_collection", "blocker_collection")


def look_like(made: bpy.types.Object, like: bpy.types.Object | None) -> None:
    """Give a result the visibility, passes, light linking and settings of Cycles of an object; nothing for None.

    Output settings may hide it from more rays, but show it to none that the object is hidden from.
    """
    if like is None:
        return
    off = [ray for ray in RAYS if not getattr(like, f"visible_{ray}", True)]
    _copy([f"visible_{ray}" for ray in off] + [*_OWN, "lightgroup"], like, made)
    _copy(_LINKING, like.light_linking, made.light_linking)
    own, others = getattr(made, "cycles", None), getattr(like, "cycles", None)
    if own is not None and others is not None:
        _copy(
            [p.identifier for p in own.bl_rna.properties if not p.is_readonly and p.identifier != "name"], others, own
        )
    made[LIKE] = json.dumps({"off": off, "light_group": like.lightgroup})


def _copy(names: Iterable[str], source: bpy.types.bpy_struct, target: bpy.types.bpy_struct) -> None:
    """Copy what differs: each change makes Blender look at all that depends on it."""
    for name in names:
        value = getattr(source, name)
        value = tuple(value) if getattr(source.bl_rna.properties[name], "is_array", False) else value
        now = getattr(target, name)
        if (tuple(now) if isinstance(value, tuple) else now) != value:
            setattr(target, name, value)


def likeness(made: bpy.types.Object) -> dict[str, Any] | None:
    """What `look_like` stored: ``off``, the rays that do not see it, and ``light_group``; None for other results."""
    stored = made.get(LIKE)
    return None if stored is None else json.loads(stored)
