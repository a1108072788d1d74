# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of Blender, declared as the engine declares its settings: label, tooltip, default, then other options.

The first three need no names: ``real("Age", "Age in years", 5.0, min=0.0)``.
"""

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

from bpy import props

#: Options of what cannot be animated, and of what panels do not show.
FIXED, HIDDEN = {"options": set()}, {"options": {'HIDDEN'}}
#: Custom property of a result collection: 'VIEW' for the artist's results, 'RENDER' for those of a running render.
PURPOSE = "tetflora_purpose"


def _kind(make: Callable[..., Any], *names: str) -> Callable[..., Any]:
    """Blender's way to make a property, with names for what is given in order."""
    return lambda *given, **options: make(**dict(zip(names, given, strict=False)), **options)


boolean, integer, real, string = (
    _kind(make, "name", "description", "default")
    for make in (props.BoolProperty, props.IntProperty, props.FloatProperty, props.StringProperty)
)
choice = _kind(props.EnumProperty, "name", "description", "items")
#: A datablock or a group of properties, and a list of groups.
pointer_to, list_of = (
    _kind(make, "type", "name", "description") for make in (props.PointerProperty, props.CollectionProperty)
)

_once = partial(partial, options={'SKIP_SAVE'})
#: The same of what is not stored: settings that the next call of an operator does not begin with, and views of others.
once = SimpleNamespace(
    boolean=_once(boolean), integer=_once(integer), real=_once(real), string=_once(string), choice=_once(choice)
)
