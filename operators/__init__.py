# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist can do: all operators of these files; a new one is registered by itself."""

from importlib import import_module
from pkgutil import iter_modules

import bpy

from ..tetflora_addon.blender.runtime import classes_in

_MODULES = (import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__))
CLASSES = classes_in(_MODULES, bpy.types.Operator)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
