# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does with populations: make them, change them, let them go."""

import bpy
from bpy.props import BoolProperty

from ..tetflora_addon.blender import point_preview
from ..tetflora_addon.blender.population_rules import active_population, copy_settings
from ..tetflora_addon.blender.populations import (
    Made,
    add_population,
    make_plants,
    own_objects,
    remove_population,
    reroll,
    set_grounds,
)
from .base import Reporting, counted, in_object_mode, select_only


def selected_grounds(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected meshes; those of fields are plants, not ground."""
    return [obj for obj in context.selected_objects if obj.type == 'MESH' and not obj.tetflora.is_field]


def ground_selected(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Poll: at least one mesh to grow on is selected."""
    if selected_grounds(context):
        return True
    cls.poll_message_set("Select the mesh on which plants shall grow")
    return False


def report_made(operator: bpy.types.Operator, made: Made) -> None:
    """Tell how many plants there are, as what, and why not more."""
    where = ""
    if made.objects and made.objects[0].tetflora.is_field:
        where = f' in the field "{made.objects[0].name}"'
    if made.reason:
        operator.report({'WARNING'}, f"{counted(made.number, 'plant')} of {made.wanted:,} placed{where}: {made.reason}")
        return
    returned = f"; {made.returned:,} that you had deleted are back" if made.returned else ""
    erased = f"; {made.erased:,} stay away, where you erased" if made.erased else ""
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
            cls.poll_message_set("The population is frozen; press Freeze again to go on with it")
        return not population.frozen


class TETFLORA_OT_add_population(Reporting, bpy.types.Operator):
    """Add a population without plants."""

    bl_idname = "tetflora.add_population"
    bl_label = "Add Population"
    bl_description = (
        "Add a population on the selected meshes, with the settings of the one that is shown, and no plants yet. "
        "Set it up, with the preview of points if you like, then press Update"
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
        point_preview.schedule()
        return {'FINISHED'}


class TETFLORA_OT_update_population(_Replacing, bpy.types.Operator):
    """Place plants by the settings."""

    bl_idname = "tetflora.update_population"
    bl_label = "Update Population"
    bl_description = (
        "Place the plants of the active population by its settings, in place of those that it has. Plants of it that "
        "you moved, changed or deleted by hand are placed anew too, except where the brush has erased; other plants "
        "keep their room"
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
    bl_description = "Place the plants of the active population by its settings with another seed: another arrangement"
    bl_options = {'REGISTER', 'UNDO'}

    def run(self, context: bpy.types.Context) -> set[str]:
        report_made(self, reroll(context.scene, context.evaluated_depsgraph_get(), active_population(context.scene)))
        return {'FINISHED'}


class TETFLORA_OT_freeze_population(_OfPopulation, bpy.types.Operator):
    """Keep a population's plants as they are."""

    bl_idname = "tetflora.freeze_population"
    bl_label = "Freeze Population"
    bl_description = (
        "The plants of the active population are yours: no update replaces them, and they stay if the population is "
        "removed. Pressed again, the next update may replace them, with all that you did to them"
    )
    bl_options = {'REGISTER', 'UNDO'}

    def run(self, context: bpy.types.Context) -> set[str]:
        population = active_population(context.scene)
        population.frozen = not population.frozen
        state = "frozen: its plants are yours" if population.frozen else "no longer frozen: Update replaces its plants"
        self.report({'INFO'}, f'"{population.name}" is {state}')
        return {'FINISHED'}


class TETFLORA_OT_remove_population(_OfPopulation, bpy.types.Operator):
    """Remove a population with its plants."""

    bl_idname = "tetflora.remove_population"
    bl_label = "Remove Population"
    bl_description = "Remove the active population and its plants. Plants of a frozen population stay"
    bl_options = {'REGISTER', 'UNDO'}

    keep_plants: BoolProperty(
        name="Keep Plants",
        description="Only the settings go; the plants stay as if they had been set by hand",
        options={'SKIP_SAVE'},
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        index = context.scene.tetflora.populations_index
        name = active_population(context.scene).name
        number = remove_population(context.scene, index, self.keep_plants)
        self.report({'INFO'}, f'"{name}" removed with {counted(number, "plant")}')
        point_preview.schedule()
        return {'FINISHED'}


class TETFLORA_OT_select_population(_OfPopulation, bpy.types.Operator):
    """Select a population's plants."""

    bl_idname = "tetflora.select_population"
    bl_label = "Select Plants of Population"
    bl_description = "Select the plants of the active population, or its field"
    bl_options = {'REGISTER', 'UNDO'}

    def run(self, context: bpy.types.Context) -> set[str]:
        own = own_objects(context.scene, active_population(context.scene))
        if not own:
            self.report({'WARNING'}, "The population has no plants; press Update")
            return {'CANCELLED'}
        select_only(context, own)
        return {'FINISHED'}


class TETFLORA_OT_set_population_ground(_OfPopulation, bpy.types.Operator):
    """Grow on the selected meshes."""

    bl_idname = "tetflora.set_population_ground"
    bl_label = "Use Selected Meshes"
    bl_description = "Let the active population grow on the selected meshes instead. Press Update to place its plants"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll_population(cls, context: bpy.types.Context, _population: bpy.types.PropertyGroup) -> bool:
        return ground_selected(cls, context)

    def run(self, context: bpy.types.Context) -> set[str]:
        set_grounds(active_population(context.scene), selected_grounds(context))
        point_preview.schedule()
        return {'FINISHED'}


class TETFLORA_OT_forget_erased(_Replacing, bpy.types.Operator):
    """Let plants grow again where they were erased."""

    bl_idname = "tetflora.forget_erased"
    bl_label = "Forget Erased Places"
    bl_description = (
        "Let plants of the active population grow again where the brush has erased some. Press Update to place them"
    )
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll_population(cls, context: bpy.types.Context, population: bpy.types.PropertyGroup) -> bool:
        if not population.erased:
            cls.poll_message_set("The brush has erased nothing of this population")
            return False
        return super().poll_population(context, population)

    def run(self, context: bpy.types.Context) -> set[str]:
        population = active_population(context.scene)
        population.erased = population.placed_by = ""  # so that the panel asks for an update
        self.report({'INFO'}, f'"{population.name}" may grow everywhere again; press Update')
        point_preview.schedule()
        return {'FINISHED'}


class TETFLORA_OT_preview_population(Reporting, bpy.types.Operator):
    """Show where plants would stand."""

    bl_idname = "tetflora.preview_population"
    bl_label = "Preview Points"
    bl_description = (
        "Show a dot in the viewport for each plant that the shown settings would place, coloured by species, and "
        "follow every change of them. Nothing is made"
    )
    bl_options = {'REGISTER'}

    def run(self, context: bpy.types.Context) -> set[str]:
        point_preview.show(context.scene, not point_preview.shown_in(context.scene))
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
)
