# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Assets: use objects and collections as species, and refine what objects scatter."""

import bpy
from bpy.props import BoolProperty, StringProperty

from ..tetflora_addon.blender.assets.marks import (
    can_be_species,
    is_species,
    scattered,
    stop_using,
    use_as_species,
)
from ..tetflora_addon.blender.placing.plant_objects import prepare_scene
from ..tetflora_addon.blender.scene.objects import is_scatter, mark_scatter, may_scatter
from ..tetflora_addon.blender.species.asset_species import Datablock, asset_of
from ..tetflora_addon.errors import SceneError
from .base import Reporting, counted, in_object_mode, need
from .marks import action_property

_NAMED = 3  # species that a report names


def chosen(context: bpy.types.Context, name: str = "") -> list[Datablock]:
    """What an operator is for: the collection of that name, else what is selected in the Outliner or the 3D view."""
    if name:
        found = bpy.data.collections.get(name)
        return [] if found is None else [found]
    if context.area is not None and context.area.type == 'OUTLINER':
        return [i for i in context.selected_ids if isinstance(i, bpy.types.Object | bpy.types.Collection)]
    return list(context.selected_objects)


class _OnAssets(Reporting):
    """Mix-in for operators on selected objects, or on a collection."""

    nothing: str

    @staticmethod
    def fits(datablock: Datablock) -> bool:
        """Whether the operator can do something with it."""
        raise NotImplementedError

    @classmethod
    def missing(cls, context: bpy.types.Context) -> str:
        # A script may name a collection, whatever is selected.
        by_script = context.area is None or context.area.type != 'VIEW_3D'
        found = (by_script and bpy.data.collections) or any(cls.fits(one) for one in chosen(context))
        return in_object_mode(context) or ("" if found else cls.nothing)


class TETFLORA_OT_use_as_species(_OnAssets, bpy.types.Operator):
    """Use the selected objects or collections as species: plants of them look as they do.

    They are offered wherever species are, in this file. Use again after a change of their shape.
    """

    bl_label = "Use as Species"
    nothing = "Select objects with faces, or a collection in the Outliner, first"

    collection: StringProperty(
        name="Collection",
        description="Name of a collection to use instead of what is selected",
        options={'SKIP_SAVE'},
    )
    variants: BoolProperty(
        name="Objects Are Variants",
        description=(
            "Each object of a collection, and each collection in it, is a plant; the seed of a plant chooses one. "
            "Otherwise the whole collection is one plant"
        ),
        default=True,
    )

    fits = staticmethod(can_be_species)

    def draw(self, _context: bpy.types.Context) -> None:
        self.layout.prop(self, "variants")

    def run(self, context: bpy.types.Context) -> set[str]:
        found = chosen(context, self.collection)
        if not found:
            return self.refused(f'There is no collection "{self.collection}"' if self.collection else self.nothing)
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


class TETFLORA_OT_stop_using_as_species(_OnAssets, bpy.types.Operator):
    """Use the selected objects or collections as species no more. Plants of them stay, and need another species."""

    bl_label = "Stop Using as Species"
    nothing = "Select an object that is used as a species first"

    collection: StringProperty(
        name="Collection",
        description="Name of a collection, instead of what is selected",
        options={'SKIP_SAVE'},
    )

    fits = staticmethod(is_species)

    def run(self, context: bpy.types.Context) -> set[str]:
        found = [one for one in chosen(context, self.collection) if is_species(one)]
        if not found:
            return self.refused(self.nothing)
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


def _scatterers(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected objects that scatter, or else the active one: results hide it, and nobody can select it then."""
    for objects in (context.selected_objects, [context.view_layer.objects.active]):
        if found := [o for o in objects if o is not None and (may_scatter(o) or is_scatter(o))]:
            return found
    return []


class TETFLORA_OT_refine_scatter(Reporting, bpy.types.Operator):
    """Refine what the modifiers or particles of the selected objects scatter, where it stands.

    The objects go on scattering by their own rules. Use again to keep the scatter plain.
    """

    bl_label = "Refine Scatter"
    needs = (
        need(
            _scatterers,
            "Select an object that scatters others first, by geometry nodes, particles, instancing or as a collection "
            "instance",
        ),
    )

    action: action_property("Refine what the objects scatter", "Keep the scatter plain, as it is without TetFlora")

    def run(self, context: bpy.types.Context) -> set[str]:
        found = _scatterers(context)
        marked = all(is_scatter(o) for o in found)
        if self.action == 'UNMARK' or (self.action == 'TOGGLE' and marked):
            for obj in found:
                mark_scatter(context.scene, obj, False)
            return self.done(f"The scatter of {counted(len(found), 'object')} stays plain")
        depsgraph = context.evaluated_depsgraph_get()
        instances, assets, left, wrong, done = 0, set(), 0, [], 0
        for obj in found:
            try:
                scatter = scattered(obj, depsgraph)
            except SceneError as error:
                wrong.append(str(error))
                continue
            mark_scatter(context.scene, obj, True)
            done += 1
            assets.update(one.target for one in scatter.places)
            instances += sum(len(one) for one in scatter.places)
            left += sum(scatter.left.values())
        if not done:
            return self.failed(wrong[0])
        prepare_scene(context.scene)
        text = f"{counted(instances, 'instance')} of {counted(len(assets), 'asset')} will be refined"
        text += f"; {counted(left, 'instance')} without faces will not show in results" if left else ""
        return self.done(f"{text}; {wrong[0]}" if wrong else text)
