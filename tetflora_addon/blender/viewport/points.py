# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn on the ground: dots where a population's plants would stand, and the lines of a tool's cursor.

Dots belong to the session and are forgotten when a file is loaded. The state holds no references: undo ends these.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...arrays import Floats, Floats32
from ...camera.camera import origin_near
from ...errors import TetFloraError
from .. import compat
from ..placing import properties
from ..placing.populations import own_objects
from ..placing.rules import awaits_update, makes_field, read_search, shown_population
from ..runtime import SceneSwitch, handlers, in_order, listening, redraw
from ..species import edits

Color = tuple[float, float, float, float]

WIDTH = 2.0  # of a cursor's lines, pixels times the interface's scale
#: Dots that are drawn at most, evenly chosen among the plants.
MOST_DOTS = 20_000
#: Plants that are placed at most for a preview.
MOST_PLACED = 200_000
#: One after the other for the species of the mixture; linear RGB, distinguishable by color-blind eyes as well
#: (the palette of Okabe and Ito, "Color Universal Design", 2008).
PALETTE = np.array(
    [[0.0, 0.62, 0.45], [0.9, 0.62, 0.0], [0.34, 0.71, 0.91], [0.94, 0.89, 0.26], [0.84, 0.37, 0.0], [0.8, 0.47, 0.65]]
)
_SIZE = 6.0  # pixels
_LIFT = 0.1  # meters above the ground, which would hide half of each dot
_SOON = 0.08  # seconds from a change to new dots


@dataclass(frozen=True)
class Dots:
    """The dots of a population."""

    position: Floats32  # (n, 3), meters from the origin
    color: Floats32  # (n, 4)
    plants: int  # that would be placed; at least, where ``more``
    more: bool
    message: str  # why there are fewer than asked for; empty if there are not
    origin: Floats  # (3,), near most of them, meters in world space


@dataclass
class _State:
    """How the last placing went."""

    uid: str = ""
    dots: Dots | None = None
    error: str = ""
    handle: object = None
    batch: object = field(default=None, repr=False)


_state = _State()


def _dots_of(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Dots:
    """Dots for the population that the panel shows; an error where its settings leave no place."""
    population = shown_population(scene)
    if population.frozen:
        raise TetFloraError(f'"{population.name}" is frozen and keeps its plants; turn off Freeze to preview changes')
    grounds = None
    if not population.uid:  # settings for a new population, which would grow on what is selected
        layer = depsgraph.view_layer
        chosen = [o for o in layer.objects if o.select_get(view_layer=layer)]
        grounds = [o for o in chosen if o.type == 'MESH' and not o.tetflora.is_field]
    plants = set(own_objects(scene, population))
    placement = read_search(scene, depsgraph, population, plants, grounds, MOST_PLACED).placement()
    number = len(placement)
    drawn = np.linspace(0, number - 1, min(number, MOST_DOTS)).astype(np.int64) if number else np.zeros(0, np.int64)
    origin = origin_near(placement.position)
    position = (placement.position[drawn] - origin).astype(np.float32)
    position[:, 2] += _LIFT
    color = np.ones((len(drawn), 4), np.float32)
    color[:, :3] = PALETTE[placement.species[drawn] % len(PALETTE)]
    return Dots(position, color, number, number >= MOST_PLACED, placement.reason, origin)


def status(population: bpy.types.PropertyGroup) -> str:
    """How many plants there are or will be, and as what; reads no geometry, so that panels may call it."""
    dots = _state.dots if switch.scene is not None and population.uid == _state.uid else None
    if dots is not None and (population.by_density or not dots.more):
        number = dots.plants
    elif dots is None and population.uid and not awaits_update(population):
        number = population.made
    elif population.by_density:
        return "As many plants as fit"
    else:
        number = population.count
    made_as = "one field" if makes_field(population, number) else "empties"
    more = "more than " if dots is not None and dots.more and population.by_density else ""
    return f"{more}{number:,} plant{'' if number == 1 else 's'}, as {made_as}"


def complaints(population: bpy.types.PropertyGroup) -> list[str]:
    """What is wrong with a population, for the panel; reads no geometry."""
    if switch.scene is not None and population.uid == _state.uid:
        text = _state.error or (_state.dots.message if _state.dots is not None else "")
    else:
        text = population.message
    return [text] if text else []


def _place(scene: bpy.types.Scene | None) -> None:
    if scene is None or scene != bpy.context.scene:
        _clear()
        return
    try:
        dots = _dots_of(scene, bpy.context.evaluated_depsgraph_get())
        _state.error = ""
    except TetFloraError as wrong:
        dots, _state.error = None, str(wrong)
    _clear()
    _state.dots, _state.uid = dots, shown_population(scene).uid
    if dots is not None and len(dots.position):
        _state.handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), 'WINDOW', 'POST_VIEW')
    redraw()


def _draw() -> None:
    context = bpy.context
    if _state.dots is None or not switch.shown_in(context.scene) or not context.space_data.overlay.show_overlays:
        return
    shader = gpu.shader.from_builtin(compat.dot_shader())
    if _state.batch is None:
        _state.batch = batch_for_shader(shader, 'POINTS', {"pos": _state.dots.position, "color": _state.dots.color})
    gpu.state.depth_test_set('LESS_EQUAL')
    gpu.state.point_size_set(_SIZE * context.preferences.system.ui_scale)
    with gpu.matrix.push_pop():
        gpu.matrix.translate(_state.dots.origin.tolist())
        _state.batch.draw(shader)
    gpu.state.point_size_set(1.0)
    gpu.state.depth_test_set('NONE')


def _clear() -> None:
    """Take the dots and their handler away."""
    if _state.handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_state.handle, 'WINDOW')
    _state.handle = _state.batch = _state.dots = None
    redraw()


_TOOLTIP = (
    "Show a dot in the viewport for each plant that the active layer would place by its present settings, "
    "colored by species, updated with every change. Creates no objects"
)
switch = SceneSwitch("tetflora_points", "Preview Points", _TOOLTIP, _place, _clear, _SOON, drawn=True)
schedule = switch.schedule
_HANDLERS = handlers(
    undo_post=lambda *_: schedule(), redo_post=lambda *_: schedule(), load_pre=lambda *_: switch.forget()
)
register, unregister = in_order(switch, listening(schedule, properties.listeners, edits.listeners), _HANDLERS)


class GroundCursor:
    """Line strips in one window, from `start` to `stop`; change ``lines`` and redraw the area."""

    def __init__(self) -> None:
        self.lines: list[tuple[Floats, Color]] = []
        self._window: int | None = None
        self._handle: object | None = None

    def start(self, window: bpy.types.Window) -> None:
        """Draw from now on, in this window only."""
        self._window = window.as_pointer()
        self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), 'WINDOW', 'POST_VIEW')

    def stop(self) -> None:
        """Draw no more."""
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, 'WINDOW')
            self._handle = None
        self.lines = []

    def _draw(self) -> None:
        context = bpy.context
        if not self.lines or context.window is None or context.window.as_pointer() != self._window:
            return
        shader = gpu.shader.from_builtin('POLYLINE_UNIFORM_COLOR')
        size = gpu.state.viewport_get()[2:]
        gpu.state.blend_set('ALPHA')
        gpu.state.depth_test_set('NONE')
        scale = context.preferences.system.ui_scale
        shader.bind()
        shader.uniform_float("viewportSize", size)
        for points, color in self.lines:
            origin = origin_near(points)
            batch = batch_for_shader(shader, 'LINE_STRIP', {"pos": np.ascontiguousarray(points - origin, np.float32)})
            with gpu.matrix.push_pop():
                gpu.matrix.translate(origin.tolist())
                # A dark line below makes the bright one seen on any ground.
                for line, width in (((0.0, 0.0, 0.0, 0.5 * color[3]), 2.0 * WIDTH), (color, WIDTH)):
                    shader.uniform_float("lineWidth", width * scale)
                    shader.uniform_float("color", line)
                    batch.draw(shader)
        gpu.state.blend_set('NONE')


def circle(center: Sequence[float], radius: float, sides: int = 32) -> Floats:
    """A level circle, (sides + 1, 3) with the first corner twice."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(sides + 1)], axis=1) * radius + np.asarray(center, float)
