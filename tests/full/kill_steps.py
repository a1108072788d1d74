# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a Blender that is about to be killed does: ``blender -b FILE --python kill_steps.py -- WHAT MOMENT TIMES``.

It says NOW at the moment, having saved the file there, and goes on until it is killed.
"""

import sys
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).resolve().parents[2]))

from devtools.aliases import INSTALLED, alias

alias(INSTALLED)
from tetflora_addon.blender.job.refine import refine, refine_steps  # noqa: E402  (the same)

what, moment, times = sys.argv[-3:]
left = int(times)
scene = bpy.context.scene


def now() -> None:
    """The moment has come."""
    print("NOW", flush=True)


def save() -> None:
    """As the artist, or another add-on, may do at any time.

    Not once more after the last time: the kill is to meet what follows a save, not the next save, in which Blender
    has no file of this name for a moment.
    """
    global left
    if left:
        left -= 1
        bpy.ops.wm.save_mainfile(compress=False)
        now()


def save_between_steps() -> None:
    """Save where the message of a step begins with the moment."""
    for step in refine_steps(scene, bpy.context.evaluated_depsgraph_get()):
        if step.message.startswith(moment):
            save()


def save_again_and_again() -> None:
    """Files of some megabytes."""
    refine(scene, bpy.context.evaluated_depsgraph_get())
    bpy.app.handlers.save_pre.append(lambda *_: now())
    while True:
        bpy.ops.wm.save_mainfile(compress=moment == "compressed")


def render() -> None:
    """Save before or after a frame is rendered, with what was made for it."""
    getattr(bpy.app.handlers, moment).append(lambda *_: save())
    bpy.ops.render.render(animation=True)


{"refine": save_between_steps, "save": save_again_and_again, "render": render}[what]()
while True:
    pass
