# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of settings that carry what an interface needs to show them: a label, a tooltip, limits, a unit."""

from __future__ import annotations

from dataclasses import field
from typing import Any

#: Options of lengths in meters, and of what is from 0 to 1.
LENGTH = {"subtype": 'DISTANCE', "unit": 'LENGTH'}
FACTOR = {"subtype": 'FACTOR', "min": 0.0, "max": 1.0}


def setting(default: bool | int | float, label: str, description: str, /, **options: Any) -> Any:
    """A field of a dataclass of settings; the property of the scene is made from it.

    Parameters
    ----------
    default : bool, int or float
        The field's default; its type is the property's.
    label, description : str
        Name in panels, and tooltip.
    **options
        What else Blender's properties take: ``min``, ``max``, ``soft_min``, ``soft_max``, ``step``, ``precision``,
        ``subtype``, ``unit``; and ``default``, where an artist starts with another value than the engine.
    """
    return field(default=default, metadata={"name": label, "description": description, **options})


def script_setting(default: bool | int | float, /, **options: Any) -> Any:
    """The same for what only scripts set, as its value follows from others: panels do not show it."""
    return field(default=default, metadata={"options": {'HIDDEN', 'ANIMATABLE'}, **options})


def within(low: float, soft: float | None = None, high: float | None = None) -> dict[str, Any]:
    """Options of what has a lowest value, and maybe one that dragging does not exceed, and a highest."""
    return {"min": low} | ({} if soft is None else {"soft_max": soft}) | ({} if high is None else {"max": high})


def meters(low: float, soft: float, high: float | None = None) -> dict[str, Any]:
    """The same of lengths."""
    return within(low, soft, high) | LENGTH
