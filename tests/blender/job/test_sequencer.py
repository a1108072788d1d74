# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An animation whose sequencer shows scenes with plants: each has its own, in all frames, and nothing stays."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from devtools.formats import set_format
from tests.blender.scenes import add_camera, add_plant, datablocks, depsgraph, tiny_render
from tetflora_addon import errors
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import frame_cache, refine, render

pytestmark = pytest.mark.usefixtures("clean_file")

FRAMES = 4


@pytest.fixture
def animation(tmp_path):
    """A scene without plants whose sequencer shows one with a plant, past which the camera flies; gives both."""
    wood = tiny_render()
    camera = add_camera(location=(-1.0, 0.0, 12.0), rotation=(0.0, 0.0, 0.0))
    camera.keyframe_insert("location", frame=1)
    camera.location.x = 1.0
    camera.keyframe_insert("location", frame=FRAMES)
    add_plant()
    settings = wood.tetflora
    settings.leaf_limit, settings.cutoff, settings.cell_length = 4.0, 8.0, 1.0
    world = bpy.data.worlds.new("sky")
    wood.world = world
    compat.shader_tree(world).nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    wood.frame_start, wood.frame_end = 1, FRAMES  # which the strip is as long as
    animation = bpy.data.scenes.new("animation")
    animation.camera = camera
    animation.frame_start, animation.frame_end = 1, FRAMES
    animation.render.resolution_x = animation.render.resolution_y = 16
    animation.render.engine, animation.cycles.samples = 'CYCLES', 1
    set_format(animation.render.image_settings, "PNG")
    animation.render.filepath = str(tmp_path / "frame_####")
    strips = animation.sequence_editor_create().strips
    strips.new_scene("wood", wood, 1, 1)
    depsgraph()
    return animation, wood


def picture(folder, frame):
    image = bpy.data.images.load(str(folder / f"frame_{frame:04d}.png"))
    values = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    bpy.data.images.remove(image)
    return values


def test_scenes_in_a_sequencer_show_their_plants(animation, tmp_path):
    outer, _ = animation
    before = datablocks()
    bpy.ops.render.render(animation=True, scene=outer.name)
    pictures = [picture(tmp_path, n) for n in range(1, FRAMES + 1)]
    assert datablocks() == before
    assert frame_cache._entries == {}
    assert render.render_errors() == []
    for values in pictures:  # white sky and the plant before it
        assert values.max() > 0.7
        assert values.min() < 0.6
    assert np.abs(pictures[0] - pictures[-1]).max() > 0.1  # the camera has moved


def test_errors_of_a_scene_in_a_sequencer_are_told(animation, monkeypatch):
    def refuse(*_arguments, **_options):
        raise errors.SpeciesError("no such species")

    monkeypatch.setattr(refine, "refine", refuse)
    before = datablocks()
    bpy.ops.render.render(animation=True, scene=animation[0].name)
    assert len(render.render_errors()) == FRAMES
    assert datablocks() == before
