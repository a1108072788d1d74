# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Assets: use objects and collections as species."""

import bpy

from ..tetflora_addon.blender.assets.marks import can_be_species, is_species, stop_using, use_as_species
from ..tetflora_addon.blender.declare import boolean, once
from ..tetflora_addon.blender.placing.plant_objects import prepare_scene
from ..tetflora_addon.blender.species.asset_species import Datablock, asset_of
from ..tetflora_addon.errors import SceneError
from .base import Reporting, counted, in_object_mode

_NAMED = 3  # species that a report names


def chosen(context: bpy.types.Context, name: str = "") -> list[Datablock]:
    """What an operator is for: the collection of that name, else what is selected in the Outliner or the 3D view."""
    if name:
        found = bpy.data.collections.get(name)
        return [] if found is None else [found]
    if context.area is not None and context.area.type == 'OUTLINER':
        return [i for i in context.selected_ids if isinstance(i, bpy.types.Object | bpy.types.Collection)]
    return list(context.selected_objects)


class TETFLORA_OT_use_as_species(Reporting, bpy.types.Operator):
    """Use the selected objects or collections as species: plants of them look as they do.

    They are offered wherever species are, in this file. Use again after a change of their shape.
    """

    bl_label = "Use as Species"
    told = "stop"

    collection: once.string("Collection", "Name of a collection to use instead of what is selected")
    variants: boolean(
        "Objects Are Variants",
        "Each object of a collection, and each collection in it, is a plant; the seed of a plant chooses one. "
        "Otherwise the whole collection is one plant",
        True,
    )
    stop: once.boolean("Stop", "Use them as species no more. Plants of them stay, and need another species")

    @classmethod
    def missing(cls, context: bpy.types.Context) -> str:
        # A script may name a collection, whatever is selected.
        by_script = context.area is None or context.area.type != 'VIEW_3D'
        found = (by_script and bpy.data.collections) or any(
            can_be_species(one) or is_species(one) for one in chosen(context)
        )
        nothing = "Select objects with faces, or a collection in the Outliner, first"
        return in_object_mode(context) or ("" if found else nothing)

    def draw(self, _context: bpy.types.Context) -> None:
        self.layout.prop(self, "variants")

    def run(self, context: bpy.types.Context) -> set[str]:
        found = chosen(context, self.collection)
        if self.stop:
            return self._stop(context, [one for one in found if is_species(one)])
        if not found:
            wrong = f'There is no collection "{self.collection}"' if self.collection else "Select an object first"
            return self.refused(wrong)
        depsgraph = context.evaluated_depsgraph_get()
        names, wrong = [], []
        for datablock in found:
            try:
                made = use_as_species(context.scene, depsgraph, datablock, self.variants)
                names.append(made.name)
            except SceneError as error:
                wrong.append(str(error))
        if not names:
            return self.failed(wrong[0])
        prepare_scene(context.scene)
        text = ", ".join(f'"{name}"' for name in names[:_NAMED])
        text += f" and {len(names) - _NAMED:,} more" if len(names) > _NAMED else ""
        text += " can now be planted as a species" if len(names) == 1 else " can now be planted as species"
        return self.done(f"{text}; {wrong[0]}" if wrong else text)

    def _stop(self, context: bpy.types.Context, found: list[Datablock]) -> set[str]:
        if not found:
            return self.refused("Select an object that is used as a species first")
        species = {asset.identifier for one in found if (asset := _asset_of(one)) is not None}
        number = sum(stop_using(one) > 0 for one in found)
        plants = sum(o.tetflora.is_plant and o.tetflora.species in species for o in context.scene.objects)
        rest = f"; {counted(plants, 'plant')} of it need another species" if plants else ""
        return self.done(f"{counted(number, 'asset')} no longer used as species{rest}")


def _asset_of(datablock: Datablock) -> bpy.types.PropertyGroup | None:
    found = asset_of(datablock)
    if found is None and isinstance(datablock, bpy.types.Object) and datablock.instance_collection is not None:
        return asset_of(datablock.instance_collection)
    return found
