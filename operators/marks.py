# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What objects are to TetFlora: marks, and species; convert fields; edit the lists of the panels."""

import bpy
from bpy.types import Operator

from ..tetflora_addon.blender.assets.marks import can_be_species, is_species, scattered, stop_using, use_as_species
from ..tetflora_addon.blender.biomes.layers import forget_gone
from ..tetflora_addon.blender.declare import boolean, choice, once, string
from ..tetflora_addon.blender.placing import plant_objects
from ..tetflora_addon.blender.placing.populations import adopt, collection_of, owner_of
from ..tetflora_addon.blender.placing.properties import MOST_EMPTIES
from ..tetflora_addon.blender.scene.fields import FIELD_TYPES, fields_of
from ..tetflora_addon.blender.scene.objects import SURFACE_TYPES, is_scatter, mark_scatter, may_instance, may_scatter
from ..tetflora_addon.blender.species.asset_species import Datablock, asset_of
from ..tetflora_addon.blender.species.catalog import default_species
from ..tetflora_addon.blender.species.edits import catalog
from ..tetflora_addon.errors import SceneError, listed
from .base import Reporting, counted, in_object_mode, plants_or_fields_selected, select_only, selected_plants


def can_be_explicit(obj: bpy.types.Object) -> bool:
    """Whether an object has a surface of its own that could be refined, or instances some."""
    group = obj.tetflora
    return not (group.is_plant or group.is_field) and (obj.type in SURFACE_TYPES or may_instance(obj))


def can_be_field(obj: bpy.types.Object | None) -> bool:
    """Whether an object has points that could be plants, or is marked as a field although it has none any more."""
    return obj is not None and (obj.type in FIELD_TYPES or obj.tetflora.is_field)


_NO_SURFACE = "Select meshes, or objects that instance them, first"
#: Properties of objects that are marks, which objects may bear them, and what is said where none may and of others.
_MARKS = {
    'OCCLUDER': ("is_occluder", lambda obj: obj.type == 'MESH', "Select meshes first", "{} marked as occluder"),
    'EXPLICIT': ("is_explicit", can_be_explicit, _NO_SURFACE, "{} will be refined"),
}


class TETFLORA_OT_mark(Reporting, Operator, label="Use Selected Objects As", told="what", needs=(in_object_mode,)):
    """Let selected objects be something to TetFlora, or no more."""

    what: choice(
        "What",
        "What the objects are",
        (
            (
                'OCCLUDER',
                "Occluder",
                "Plants behind the selected meshes, such as terrain and buildings, count as hidden and cost next to "
                "nothing. Use again to unmark",
            ),
            (
                'EXPLICIT',
                "Meshes to Refine",
                "Refine the polygons of the selected objects together with the plants: imported trees, rocks, scans, "
                "and objects that instance them. Use again to unmark",
            ),
            (
                'SCATTER',
                "Scatter to Refine",
                "Refine what the modifiers or particles of the selected objects scatter, where it stands; they go on "
                "scattering by their own rules. Use again to keep the scatter plain",
            ),
            (
                'FIELD',
                "Field of Plants",
                "Each point of the active mesh or point cloud, after modifiers, is a plant, defined by the attributes "
                "species, seed, rotation and scale. Use again to turn it off",
            ),
        ),
    )
    action: once.choice(
        "Action",
        "How to change the mark",
        (
            ('TOGGLE', "Toggle", "Mark all, or unmark them if all are marked"),
            ('MARK', "Mark", "Mark all"),
            ('UNMARK', "Unmark", "Unmark all"),
        ),
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        if self.what == 'FIELD':
            return self._mark_field(context)
        if self.what == 'SCATTER':
            return self._mark_scatters(context)
        name, fits, nothing, marked = _MARKS[self.what]
        # Something marked that has since become something else can still be unmarked.
        chosen = [o for o in context.selected_objects if fits(o) or getattr(o.tetflora, name)]
        if not chosen:
            return self.failed(nothing)
        wanted = self._wanted(all(getattr(o.tetflora, name) for o in chosen))
        for obj in chosen:
            setattr(obj.tetflora, name, wanted and fits(obj))
        number = counted(len(chosen), "object")
        return self.done(marked.format(number) if wanted else f"{number} unmarked")

    def _wanted(self, marked: bool) -> bool:
        return self.action == 'MARK' or (self.action == 'TOGGLE' and not marked)

    def _mark_field(self, context: bpy.types.Context) -> set[str]:
        obj = context.active_object
        if not can_be_field(obj):
            return self.failed("The active object must be a mesh or point cloud; select it last")
        field = obj.tetflora
        field.is_field = self._wanted(field.is_field)
        if not field.is_field:
            forget_gone(context.scene)
            return self.done(f'"{obj.name}" is no longer a field of plants')
        field.is_plant = False
        if not field.field_species:
            field.field_species.add().species = field.species or default_species()
        plant_objects.note_field(context.scene, obj)
        plant_objects.prepare_scene(context.scene)
        return self.done(f'The points of "{obj.name}" are now plants')

    def _mark_scatters(self, context: bpy.types.Context) -> set[str]:
        scatterers = _scatterers(context)
        if not scatterers:
            return self.failed(
                "Select an object that scatters others first, by geometry nodes, particles, instancing or as a "
                "collection instance"
            )
        if not self._wanted(all(is_scatter(o) for o in scatterers)):
            for obj in scatterers:
                mark_scatter(context.scene, obj, False)
            return self.done(f"The scatter of {counted(len(scatterers), 'object')} stays plain")
        depsgraph = context.evaluated_depsgraph_get()
        instances, assets, left, wrong, done = 0, set(), 0, [], 0
        for obj in scatterers:
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
        plant_objects.prepare_scene(context.scene)
        text = f"{counted(instances, 'instance')} of {counted(len(assets), 'asset')} will be refined"
        text += f"; {counted(left, 'instance')} without faces will not show in results" if left else ""
        return self.done(f"{text}; {wrong[0]}" if wrong else text)


def _scatterers(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected objects that scatter, or else the active one: results hide it, and nobody can select it then."""
    for objects in (context.selected_objects, [context.view_layer.objects.active]):
        if scatterers := [o for o in objects if o is not None and (may_scatter(o) or is_scatter(o))]:
            return scatterers
    return []


class TETFLORA_OT_convert_plants(
    Reporting, Operator, label="Convert Plants", told="to", needs=(in_object_mode, plants_or_fields_selected)
):
    """Replace the selected plants with one object whose vertices are the same plants, or take fields apart again."""

    to: choice(
        "To",
        "What the plants become",
        (
            (
                'FIELD',
                "Field",
                "Replace the selected plants with one object whose vertices are the same plants. This keeps Blender "
                "fast with many plants; parents, constraints and animation of single plants are lost",
            ),
            ('OBJECTS', "Objects", f"Replace the fields with one empty per plant. At most {MOST_EMPTIES:,} plants"),
        ),
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        return self._to_field(context) if self.to == 'FIELD' else self._to_objects(context)

    def _to_field(self, context: bpy.types.Context) -> set[str]:
        if not (selected := plant_objects.plants_of(context.selected_objects)):
            return self.refused("Select plants first")
        plants = [o for o in selected_plants(context) if o.tetflora.enabled and not o.hide_render]
        if not plants:
            return self.refused("The selected plants are disabled, hidden in renders, or linked; enable them first")
        left = len(selected) - len(plants)
        owner = owner_of(context.scene, plants)
        home = collection_of(context.scene, owner) if owner else None
        field = plant_objects.field_from_plants(context.scene, context.evaluated_depsgraph_get(), plants, home)
        if owner:  # or its next update would plant them once more
            adopt(context.scene, owner, [field])
        select_only(context, [field])
        rest = f"; {counted(left, 'plant')} not converted: disabled, hidden in renders, or linked" if left else ""
        return self.done(f'{counted(len(plants), "plant")} converted to the field "{field.name}"{rest}')

    def _to_objects(self, context: bpy.types.Context) -> set[str]:
        depsgraph = context.evaluated_depsgraph_get()
        objects: list[bpy.types.Object] = []
        for field in [o for o in fields_of(context.selected_objects) if o.library is None]:
            owner = owner_of(context.scene, [field])
            home = collection_of(context.scene, owner) if owner else None
            plants = plant_objects.plants_from_field(context.scene, depsgraph, field, MOST_EMPTIES - len(objects), home)
            if owner:
                adopt(context.scene, owner, plants)
            objects += plants
        if not objects:
            return self.refused("Select a field of plants first; those that are linked must be made local")
        forget_gone(context.scene)
        select_only(context, objects)
        return self.done(f"{counted(len(objects), 'plant')} made")


class TETFLORA_OT_edit_list(
    Reporting, Operator, label="Edit List", told="action", options={'REGISTER', 'UNDO', 'INTERNAL'}
):
    """Add an entry to a list of species, or remove the active one."""

    owner: string("Owner", "Where in the context the owner of the list is, such as scene.tetflora.populate")
    entries: string("List", "Name of the list")
    action: choice(
        "Action",
        "Change to make",
        (
            ('ADD', "Add", "Add an entry, if possible with a species that is not yet in the list"),
            ('REMOVE', "Remove", "Remove the active entry"),
        ),
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        try:
            owner, index = context.path_resolve(self.owner), f"{self.entries}_index"
            entries = getattr(owner, self.entries)
        except (AttributeError, ValueError):
            return self.failed(f'There is no list "{self.entries}" of "{self.owner}"; click the buttons beside a list')
        if self.action == 'ADD':
            present = {entry.species for entry in entries}
            entries.add().species = next((s for s in catalog() if s not in present), None) or default_species()
            setattr(owner, index, len(entries) - 1)
            return {'FINISHED'}
        active = getattr(owner, index)
        if not 0 <= active < len(entries):
            return self.refused("No active entry to remove")
        entries.remove(active)
        setattr(owner, index, max(min(active, len(entries) - 1), 0))
        return {'FINISHED'}


def chosen(context: bpy.types.Context, name: str = "") -> list[Datablock]:
    """What an operator is for: the collection of that name, else what is selected in the Outliner or the 3D view."""
    if name:
        return [collection] if (collection := bpy.data.collections.get(name)) else []
    if context.area is not None and context.area.type == 'OUTLINER':
        return [i for i in context.selected_ids if isinstance(i, bpy.types.Object | bpy.types.Collection)]
    return list(context.selected_objects)


class TETFLORA_OT_use_as_species(Reporting, Operator, label="Use as Species", told="stop"):
    """Use the selected objects or collections as species: plants of them look as they do.

    They are offered wherever species are, in this file. Use again after a change of their shape.
    """

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
        valid = (by_script and bpy.data.collections) or any(can_be_species(o) or is_species(o) for o in chosen(context))
        nothing = "Select objects with faces, or a collection in the Outliner, first"
        return in_object_mode(context) or ("" if valid else nothing)

    def draw(self, _context: bpy.types.Context) -> None:
        self.layout.prop(self, "variants")

    def run(self, context: bpy.types.Context) -> set[str]:
        datablocks = chosen(context, self.collection)
        if self.stop:
            return self._stop(context, [one for one in datablocks if is_species(one)])
        if not datablocks:
            wrong = f'There is no collection "{self.collection}"' if self.collection else "Select an object first"
            return self.refused(wrong)
        depsgraph = context.evaluated_depsgraph_get()
        names, wrong = [], []
        for datablock in datablocks:
            try:
                names.append(use_as_species(context.scene, depsgraph, datablock, self.variants).name)
            except SceneError as error:
                wrong.append(str(error))
        if not names:
            return self.failed(wrong[0])
        plant_objects.prepare_scene(context.scene)
        text = listed(names)
        text += " can now be planted as a species" if len(names) == 1 else " can now be planted as species"
        return self.done(f"{text}; {wrong[0]}" if wrong else text)

    def _stop(self, context: bpy.types.Context, datablocks: list[Datablock]) -> set[str]:
        if not datablocks:
            return self.refused("Select an object that is used as a species first")
        species = {asset.identifier for one in datablocks if (asset := asset_of(one)) is not None}
        number = sum(stop_using(one) > 0 for one in datablocks)
        plants = sum(o.tetflora.is_plant and o.tetflora.species in species for o in context.scene.objects)
        rest = f"; {counted(plants, 'plant')} of it need another species" if plants else ""
        return self.done(f"{counted(number, 'asset')} no longer used as species{rest}")
