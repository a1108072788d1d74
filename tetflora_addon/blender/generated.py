# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's properties, generated from the engine's dataclasses of settings."""

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

from bpy.props import BoolProperty, FloatProperty, IntProperty

_MAKERS = {bool: BoolProperty, int: IntProperty, float: FloatProperty}


def properties_of(settings: type, **common: Any) -> SimpleNamespace:
    """A property for each field of a dataclass that is declared with `setting.setting`.

    Parameters
    ----------
    settings : type
        The dataclass.
    **common
        Further options of all of them, as ``options`` and ``update``.

    Returns
    -------
    SimpleNamespace
        The properties by the fields' names, to be used as annotations of a property group.
    """
    made = SimpleNamespace()
    for f in fields(settings):
        if f.metadata:
            setattr(made, f.name, _MAKERS[type(f.default)](**{"default": f.default, **f.metadata, **common}))
    return made
