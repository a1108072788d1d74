# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators share: tooltips, conditions, reports, the selection, and work in steps between redraws."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, StringProperty

from ..tetflora_addon.blender.file_library import ENDING
from ..tetflora_addon.blender.job.forecast import seconds_text
from ..tetflora_addon.blender.placing.plant_objects import plants_of
from ..tetflora_addon.blender.runtime import remember
from ..tetflora_addon.blender.worker import run_to_end
from ..tetflora_addon.errors import TetFloraError, readable
from ..tetflora_addon.jobs import Job, Pace, Progress

LINKED = (
    "The plants are linked from another file; use Object > Relations > Make Local, or Object > Library Override > Make"
)
NO_VIEWPORT = "This tool requires a 3D viewport"
NO_CAMERA = "The scene has no active camera; click Look from Here to add one"
_SLICE = 0.01  # seconds of work between two looks at the keyboard

#: A condition of an operator: why it is not available in a context, or an empty text.
Need = Callable[[bpy.types.Context], str]


def _told(cls: type, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
    """The tooltip of an operator whose choice or switch says what it does."""
    prop, value = properties.bl_rna.properties[cls.told], getattr(properties, cls.told)
    if prop.type == 'ENUM':
        return prop.enum_items[value].description
    return prop.description if value else cls.bl_description


class Tool:
    """Mix-in for operators: the identifier follows from the class's name, the docstring is the tooltip, and `needs`
    decides whether the operator is available. These, the label, options of Blender's, and the choice or switch of
    which the tooltip tells, where it is set, stand in the head of a class.
    """

    needs: tuple[Need, ...] = ()
    told = ""

    def __init_subclass__(
        cls, label: str = "", needs: tuple[Need, ...] = (), told: str = "", options: set[str] | None = None
    ) -> None:
        super().__init_subclass__()
        attributes = {"bl_label": label, "needs": needs, "told": told, "bl_options": options}
        for name, value in attributes.items():
            if value:
                setattr(cls, name, value)
        if cls.__name__.startswith("TETFLORA_OT_"):
            cls.bl_idname = cls.__name__.replace("TETFLORA_OT_", "tetflora.", 1)
        if "bl_description" not in vars(cls):
            cls.bl_description = " ".join((cls.__doc__ or "").split()).removesuffix(".")
        if cls.told:  # of others, Blender translates the tooltip
            cls.description = classmethod(_told)

    @classmethod
    def missing(cls, context: bpy.types.Context) -> str:
        """Why the operator is not available; an empty text where it is."""
        return next(filter(None, (need(context) for need in cls.needs)), "")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        changes = 'UNDO' in cls.bl_options and cls.bl_idname != "tetflora.first_forest"  # which makes a scene
        reason = (scene_here(context) if changes else "") or cls.missing(context)
        if reason:
            cls.poll_message_set(reason)
        return not reason

    @property
    def path(self) -> Path:
        """The file that the artist has chosen, of operators with a file browser."""
        return Path(bpy.path.abspath(self.filepath))

    def done(self, text: str, warns: object = False) -> set[str]:
        """Report what was done, perhaps as a warning; the operator's result."""
        self.report({'WARNING' if warns else 'INFO'}, readable(text))
        return {'FINISHED'}

    def refused(self, text: str) -> set[str]:
        """Warn that there is nothing to do; the operator's result."""
        self.report({'WARNING'}, readable(text))
        return {'CANCELLED'}

    def failed(self, error: TetFloraError | str) -> set[str]:
        """Report an error; the operator's result, for which Blender pushes no undo step."""
        remember(str(error))
        self.report({'ERROR'}, readable(str(error)))
        return {'CANCELLED'}


class Reporting(Tool):
    """Mix-in for operators whose ``run`` does the work; a `TetFloraError` becomes a report."""

    bl_options = {'REGISTER', 'UNDO'}

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            return self.run(context)
        except TetFloraError as error:
            return self.failed(error)
        except Exception as error:  # Blender shows it
            remember(repr(error), error)
            raise

    def run(self, context: bpy.types.Context) -> set[str]:
        """Do it; the result of ``execute``."""
        raise NotImplementedError


class FileTool(Reporting):
    """Mix-in for operators that read or write a JSON file which the artist chooses."""

    filename_ext = ENDING
    filter_glob: StringProperty(default="*.json", options={'HIDDEN'})


def need(test: Callable[[bpy.types.Context], object], message: str) -> Need:
    """The condition that a test of the context is true."""
    return lambda context: "" if test(context) else message


in_object_mode = need(lambda context: context.mode == 'OBJECT', "Only available in Object Mode")
scene_here = need(lambda context: context.scene.library is None, "The scene is linked; open its file, or append it")


def plants_selected(context: bpy.types.Context) -> str:
    """At least one plant is selected that this file may change."""
    return _editable(plants_of(context.selected_objects), "Select plants first")


def plants_or_fields_selected(context: bpy.types.Context) -> str:
    """At least one plant or field of plants is selected that this file may change."""
    selected = [obj for obj in context.selected_objects if obj.tetflora.is_plant or obj.tetflora.is_field]
    return _editable(selected, "Select plants or a field of plants first")


def _editable(objects: list[bpy.types.Object], message: str) -> str:
    if any(obj.library is None for obj in objects):
        return ""
    return LINKED if objects else message


def selected_plants(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Selected plants that this file may change: those that are linked would be as before when it is opened again."""
    return [obj for obj in plants_of(context.selected_objects) if obj.library is None]


def select_only(context: bpy.types.Context, objects: list[bpy.types.Object]) -> None:
    """Select these objects and no others, as far as the view layer has them; the first becomes active."""
    for obj in context.selected_objects:
        obj.select_set(False)
    within = set(context.view_layer.objects)
    shown = [obj for obj in objects if obj in within]
    for obj in shown:
        obj.select_set(True)
    if shown:
        context.view_layer.objects.active = shown[0]


def counted(number: int, what: str) -> str:
    """``1 plant``, ``2 plants``, ``2 proxies``."""
    if number != 1:
        what = what[:-1] + "ies" if what == "proxy" else what + "s"
    return f"{number:,} {what}"


class ModalJob(Reporting):
    """Mix-in for operators: `steps` yields progress, returns what `finish` reports, and if closed changes nothing."""

    #: What is reported after Esc, and the status bar's text about keys.
    cancelled = "Cancelled; the scene is unchanged"
    keys = "Esc: Cancel"
    expected = 0.0  # seconds of the whole job; 0 where they are not known

    _steps: Job[Any] | None = None
    _timer: bpy.types.Timer | None = None
    _enough = False

    def steps(self, context: bpy.types.Context) -> Job[Any]:
        """The work; True is sent to it when the artist presses Return."""
        raise NotImplementedError

    def finish(self, context: bpy.types.Context, result: Any) -> set[str]:
        """Report; the operator's result."""
        raise NotImplementedError

    def run(self, context: bpy.types.Context) -> set[str]:
        return self.finish(context, run_to_end(self.steps(context)))

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self._steps, self._pace = self.steps(context), Pace(_SLICE)
        try:
            # The scene is read in the second step: its errors are reported at once, while the artist still looks here.
            for _ in range(2):
                progress = next(self._steps)
        except StopIteration as stop:
            self._steps = None
            return self.finish(context, stop.value)
        except TetFloraError as error:
            return self.failed(error)
        manager = context.window_manager
        manager.progress_begin(0.0, 1.0)
        self._show(context, progress)
        self._timer = manager.event_timer_add(_SLICE / 5.0, window=context.window)
        manager.modal_handler_add(self)
        return {'RUNNING_MODAL'}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == 'ESC' and event.value == 'PRESS':
            self.cancel(context)
            self.report({'INFO'}, self.cancelled)
            return {'CANCELLED'}
        if event.type in {'RET', 'NUMPAD_ENTER'} and event.value == 'PRESS':
            self._enough = True
        if event.type != 'TIMER':
            # Everything else waits: the scene must not change under the job.
            return {'RUNNING_MODAL'}
        self._pace.begin()
        try:
            progress = self._next()
            while self._pace.goes_on(progress):
                progress = self._next()
        except StopIteration as stop:
            self._leave(context)
            return self.finish(context, stop.value)
        except TetFloraError as error:
            self.cancel(context)
            return self.failed(error)
        except BaseException as error:
            remember(repr(error), error)
            self.cancel(context)
            raise
        if self._pace.tells():
            self._show(context, progress)
        return {'RUNNING_MODAL'}

    def cancel(self, context: bpy.types.Context) -> None:
        """Discard what is half made, after Esc or when Blender ends the operator."""
        if self._steps is not None:
            self._steps.close()
        self._leave(context)

    def _next(self) -> Progress:
        enough, self._enough = self._enough, False
        return self._steps.send(enough)

    def _show(self, context: bpy.types.Context, progress: Progress) -> None:
        context.window_manager.progress_update(progress.fraction)
        left = self._pace.remaining(progress.fraction, self.expected)
        done = f"{progress.fraction:4.0%}" + (f", {seconds_text(left)} left" if left else "")
        context.workspace.status_text_set(f"TetFlora {done}   {progress.message}   |   {self.keys}")

    def _leave(self, context: bpy.types.Context) -> None:
        self._steps = None
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
            context.window_manager.progress_end()
            context.workspace.status_text_set(None)


class FileJob(ModalJob):
    """Mix-in for jobs on a file that the artist chooses, beside a helper of Blender's, whose ``invoke`` is `browse`."""

    chosen: BoolProperty(options={'HIDDEN', 'SKIP_SAVE'})

    #: Opens the file browser.
    browse: Callable[..., set[str]]
    _browsing = False

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.chosen:
            return ModalJob.invoke(self, context, event)
        self._browsing = True
        return self.browse(context, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._browsing or bpy.app.background:
            return ModalJob.execute(self, context)
        # Blender frees what the file browser has called: the steps are those of another call, with its undo step.
        again = getattr(bpy.ops.tetflora, type(self).bl_idname.partition(".")[2])
        # A menu of species that was never opened has an empty value, which is none of its items.
        settings = {name: value for name, value in self.as_keywords().items() if value != ""}
        try:
            again('INVOKE_DEFAULT', **{**settings, "chosen": True})
        except RuntimeError as error:  # what that call reported, which must not end as a traceback
            return self.failed(str(error).strip().removeprefix("Error: "))
        return {'CANCELLED'}
