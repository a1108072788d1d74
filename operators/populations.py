# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does with populations: make them, change them, let them go.

Populations written to files and read from them.
"""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..tetflora_addon.blender.placing import population_files
from ..tetflora_addon.blender.placing.populations import (
    Made,
    add_population,
    make_plants,
    own_objects,
    remove_population,
    reroll,
    set_grounds,
)
from ..tetflora_addon.blender.placing.rules import active_population, copy_settings
from ..tetflora_addon.blender.viewport import points
from .base import Reporting, counted, in_object_mode, select_only


def selected_grounds(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected meshes; those of fields are plants, not ground."""
    return [obj for obj in context.selected_objects if obj.type == 'MESH' and not obj.tetflora.is_field]


def ground_selected(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Poll: at least one mesh to grow on is selected."""
    if selected_grounds(context):
        return True
    cls.poll_message_set("Select a mesh to plant on")
    return False


def report_made(operator: bpy.types.Operator, made: Made) -> None:
    """Tell how many plants there are, as what, and why not more."""
    where = ""
    if made.objects and made.objects[0].tetflora.is_field:
        where = f' in the field "{made.objects[0].name}"'
    if made.reason:
        operator.report({'WARNING'}, f"{counted(made.number, 'plant')} of {made.wanted:,} placed{where}: {made.reason}")
        return
    returned = f"; {made.returned:,} deleted plants restored" if made.returned else ""
    erased = f"; {made.erased:,} omitted where you erased" if made.erased else ""
    operator.report({'INFO'}, f"{counted(made.number, 'plant')} placed{where}{returned}{erased}")


class _OfPopulation(Reporting):
    """Mix-in for operators on the active population."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not in_object_mode(cls, context):
            return False
        if active_population(context.scene) is None:
            cls.poll_message_set("Add a population first")
            return False
        return cls.poll_population(context, active_population(context.scene))

    @classmethod
    def poll_population(cls, _context: bpy.types.Context, _population: bpy.types.PropertyGroup) -> bool:
        """What else must be so."""
        return True


class _Replacing(_OfPopulation):
    """Mix-in for operators that replace a population's plants."""

    @classmethod
    def poll_population(cls, _context: bpy.types.Context, population: bpy.types.PropertyGroup) -> bool:
        if population.frozen:
            cls.poll_message_set("The population is frozen; turn off Freeze to change it")
        return not population.frozen


class TETFLORA_OT_add_population(Reporting, bpy.types.Operator):
    """Add a population without plants."""

    bl_idname = "tetflora.add_population"
    bl_label = "Add Population"
    bl_description = (
        "Add a population without plants on the selected meshes, with the settings of the active one. Adjust the "
        "settings, then click Update"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context) and ground_selected(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.tetflora
        number = settings.populations_index if active_population(context.scene) else None
        population = add_population(context.scene, selected_grounds(context))
        if number is not None:
            # Fetched again: adding to a list moves what is in it.
            copy_settings(settings.populations[number], population)
        points.schedule()
        return {'FINISHED'}


class TETFLORA_OT_update_population(_Replacing, bpy.types.Operator):
    """Place plants by the settings."""

    bl_idname = "tetflora.update_population"
    bl_label = "Update Population"
    bl_description = (
        "Place the plants of the active population again according to its settings. Plants that you moved, changed or "
        "deleted are replaced too, except where you erased with the brush; other plants keep their space"
    )
    bl_options = {'REGISTER', 'UNDO'}

    def run(self, context: bpy.types.Context) -> set[str]:
        report_made(
            self, make_plants(context.scene, context.evaluated_depsgraph_get(), active_population(context.scene))
        )
        return {'FINISHED'}


class TETFLORA_OT_reroll_population(_Replacing, bpy.types.Operator):
    """Place plants anew with another seed."""

    bl_idname = "tetflora.reroll_population"
    bl_label = "Re-roll Population"
    bl_description = "Place the plants of the active population with a new seed, for a different arrangement"
    bl_options = {'REGISTER', 'UNDO'}

    def run(self, context: bpy.types.Context) -> set[str]:
        report_made(self, reroll(context.scene, context.evaluated_depsgraph_get(), active_population(context.scene)))
        return {'FINISHED'}


class TETFLORA_OT_freeze_population(_OfPopulation, bpy.types.Operator):
    """Keep a population's plants as they are."""

    bl_idname = "tetflora.freeze_population"
    bl_label = "Freeze Population"
    bl_description = (
        "Protect the plants of the active population from updates and removal. Use again to unfreeze: the next update "
        "then replaces the plants, with all your changes"
    )
    bl_options = {'REGISTER', 'UNDO'}

    def run(self, context: bpy.types.Context) -> set[str]:
        population = active_population(context.scene)
        population.frozen = not population.frozen
        state = "frozen and keeps its plants" if population.frozen else "no longer frozen; Update replaces its plants"
        self.report({'INFO'}, f'"{population.name}" is {state}')
        return {'FINISHED'}


class TETFLORA_OT_remove_population(_OfPopulation, bpy.types.Operator):
    """Remove a population with its plants."""

    bl_idname = "tetflora.remove_population"
    bl_label = "Remove Population"
    bl_description = "Remove the active population and its plants. Plants of a frozen population remain"
    bl_options = {'REGISTER', 'UNDO'}

    keep_plants: BoolProperty(
        name="Keep Plants",
        description="Remove only the settings, and keep the plants as individual plants",
        options={'SKIP_SAVE'},
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        index = context.scene.tetflora.populations_index
        name = active_population(context.scene).name
        number = remove_population(context.scene, index, self.keep_plants)
        self.report({'INFO'}, f'"{name}" removed with {counted(number, "plant")}')
        points.schedule()
        return {'FINISHED'}


class TETFLORA_OT_select_population(_OfPopulation, bpy.types.Operator):
    """Select a population's plants."""

    bl_idname = "tetflora.select_population"
    bl_label = "Select Population"
    bl_description = "Select the plants of the active population, or its field"
    bl_options = {'REGISTER', 'UNDO'}

    def run(self, context: bpy.types.Context) -> set[str]:
        own = own_objects(context.scene, active_population(context.scene))
        if not own:
            self.report({'WARNING'}, "The population has no plants; click Update")
            return {'CANCELLED'}
        select_only(context, own)
        return {'FINISHED'}


class TETFLORA_OT_set_population_ground(_OfPopulation, bpy.types.Operator):
    """Grow on the selected meshes."""

    bl_idname = "tetflora.set_population_ground"
    bl_label = "Use Selected Meshes"
    bl_description = "Use the selected meshes as ground of the active population. Click Update to place its plants"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll_population(cls, context: bpy.types.Context, _population: bpy.types.PropertyGroup) -> bool:
        return ground_selected(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        set_grounds(active_population(context.scene), selected_grounds(context))
        points.schedule()
        return {'FINISHED'}


class TETFLORA_OT_forget_erased(_Replacing, bpy.types.Operator):
    """Let plants grow again where they were erased."""

    bl_idname = "tetflora.forget_erased"
    bl_label = "Clear Erased Places"
    bl_description = (
        "Allow plants of the active population to grow again where you erased with the brush. Click Update to place "
        "them"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll_population(cls, context: bpy.types.Context, population: bpy.types.PropertyGroup) -> bool:
        if not population.erased:
            cls.poll_message_set("No plants of this population were erased")
            return False
        return super().poll_population(context, population)

    def run(self, context: bpy.types.Context) -> set[str]:
        population = active_population(context.scene)
        population.erased = population.placed_by = ""  # so that the panel asks for an update
        self.report({'INFO'}, f'"{population.name}" has no more erased places; click Update to place plants')
        points.schedule()
        return {'FINISHED'}


class TETFLORA_OT_preview_population(Reporting, bpy.types.Operator):
    """Show where plants would stand."""

    bl_idname = "tetflora.preview_population"
    bl_label = "Preview Points"
    bl_description = (
        "Show a dot in the viewport for each plant that the current settings would place, colored by species, updated "
        "with every change. Creates no objects"
    )
    bl_options = {'REGISTER'}

    def run(self, context: bpy.types.Context) -> set[str]:
        points.show(context.scene, not points.shown_in(context.scene))
        return {'FINISHED'}


class TETFLORA_OT_export_populations(Reporting, bpy.types.Operator, ExportHelper):
    """Write populations to a file."""

    bl_idname = "tetflora.export_populations"
    bl_label = "Export Populations"
    bl_description = (
        "Export the settings of the populations in this scene to a file, for use in other scenes. Plants are not "
        "exported"
    )
    bl_options = {'REGISTER'}

    filename_ext = population_files.ENDING
    filter_glob: StringProperty(default="*.json", options={'HIDDEN'})
    only_active: BoolProperty(name="Only Active", description="Export the active population only")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.tetflora.populations:
            cls.poll_message_set("Add a population first")
            return False
        return True

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.tetflora
        chosen = list(settings.populations)
        if self.only_active:
            chosen = chosen[settings.populations_index :][:1]
        path = population_files.write_populations(chosen, Path(bpy.path.abspath(self.filepath)))
        self.report({'INFO'}, f"{counted(len(chosen), 'population')} written to {path}")
        return {'FINISHED'}


class TETFLORA_OT_import_populations(Reporting, bpy.types.Operator, ImportHelper):
    """Add the populations of a file."""

    bl_idname = "tetflora.import_populations"
    bl_label = "Import Populations"
    bl_description = (
        "Import populations from a file, without plants; click Update for each. They grow on meshes with the names in "
        "the file, or else on the selected meshes"
    )
    bl_options = {'REGISTER', 'UNDO'}

    filename_ext = population_files.ENDING
    filter_glob: StringProperty(default="*.json", options={'HIDDEN'})

    def run(self, context: bpy.types.Context) -> set[str]:
        path = Path(bpy.path.abspath(self.filepath))
        number, missing = population_files.read_populations(context.scene, path, selected_grounds(context))
        points.schedule()
        if missing:
            self.report(
                {'WARNING'},
                f"{counted(number, 'population')} added; missing in this file and left empty: {', '.join(missing)}",
            )
        else:
            self.report({'INFO'}, f"{counted(number, 'population')} added; click Update to place plants")
        return {'FINISHED'}


CLASSES = (
    TETFLORA_OT_add_population,
    TETFLORA_OT_update_population,
    TETFLORA_OT_reroll_population,
    TETFLORA_OT_freeze_population,
    TETFLORA_OT_remove_population,
    TETFLORA_OT_select_population,
    TETFLORA_OT_set_population_ground,
    TETFLORA_OT_forget_erased,
    TETFLORA_OT_preview_population,
    TETFLORA_OT_export_populations,
    TETFLORA_OT_import_populations,
)
