# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines that a tool draws on the ground while it runs: the brush's circle, the plant that a click would set."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import NDArray

Colour = tuple[float, float, float, float]

WIDTH = 2.0  # pixels, times the interface's scale


class GroundCursor:
    """Line strips in one window, from `start` to `stop`; change ``lines`` and redraw the area."""

    def __init__(self) -> None:
        self.lines: list[tuple[NDArray[np.float64], Colour]] = []
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
        for points, colour in self.lines:
            batch = batch_for_shader(shader, 'LINE_STRIP', {"pos": np.ascontiguousarray(points, np.float32)})
            # A dark line below makes the bright one seen on any ground.
            for line, width in (((0.0, 0.0, 0.0, 0.5 * colour[3]), 2.0 * WIDTH), (colour, WIDTH)):
                shader.uniform_float("lineWidth", width * scale)
                shader.uniform_float("color", line)
                batch.draw(shader)
        gpu.state.blend_set('NONE')


def circle(centre: Sequence[float], radius: float, sides: int = 32) -> NDArray[np.float64]:
    """A level circle, (sides + 1, 3) with the first corner twice."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(sides + 1)], axis=1) * radius + np.asarray(centre, float)
