# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects whose instances are refined as assets: those that are marked, and dropped collections that are species.

The mark is a property of the object. Objects that are linked cannot keep one, so the scene has a list of those.
"""

from __future__ import annotations

import bpy
from bpy.props import PointerProperty

from ..species.asset_species import asset_of

#: Of the property `is_scatter`.
SCATTER_PROPERTY = {
    "name": "Refine Scatter",
    "description": (
        "Refine what the object's modifiers or particles scatter: instances stay as they are where they are near, and "
        "become proxies where they are far or hidden. The object goes on scattering by its own rules, and its own "
        "surface stays as it is"
    ),
    "options": set(),
}


class TetFloraLinkedScatter(bpy.types.PropertyGroup):
    """A linked object whose scatter is refined."""

    object: PointerProperty(name="Object", description="Linked object whose scatter is refined", type=bpy.types.Object)


def is_scatter(obj: bpy.types.Object) -> bool:
    """Whether an object is marked to have its scatter refined."""
    if obj.tetflora.is_scatter:
        return True
    return obj.library is not None and any(
        entry.object == obj for scene in bpy.data.scenes for entry in scene.tetflora.linked_scatters
    )


def mark_scatter(scene: bpy.types.Scene, obj: bpy.types.Object, on: bool) -> None:
    """Mark an object or take its mark away; one that is linked is noted with a scene."""
    if obj.library is None:
        obj.tetflora.is_scatter = on
        if on:
            obj.tetflora.is_explicit = False  # its instances would count twice
        return
    if on and not is_scatter(obj):
        scene.tetflora.linked_scatters.add().object = obj
    for other in bpy.data.scenes if not on else ():
        entries = other.tetflora.linked_scatters
        for number in [i for i, entry in enumerate(entries) if entry.object == obj][::-1]:
            entries.remove(number)


def scatters(obj: bpy.types.Object) -> bool:
    """Whether what an object instances is refined as assets: it is marked so, or is a dropped asset."""
    return is_scatter(obj) or is_drop(obj)


def is_drop(obj: bpy.types.Object) -> bool:
    """Whether an object shows a collection that is a species, as the asset browser makes them: it is a plant of it."""
    collection = obj.instance_collection if obj.instance_type == 'COLLECTION' else None
    if collection is None or obj.tetflora.is_plant or obj.tetflora.is_field or is_scatter(obj):
        return False
    species = asset_of(collection)
    return species is not None and not species.variants


CLASSES = (TetFloraLinkedScatter,)
