# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The way to a forest on ground of one's own, as the README and the manual describe it, gives a picture that is lit."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Euler

from devtools.build import ROOT
from tests.blender.scenes import add_mesh, select, tiny_render
from tetflora_addon.blender.compat import shader_tree

pytestmark = [pytest.mark.usefixtures("clean_file"), pytest.mark.fine]


@pytest.mark.parametrize("page", ["README.md", "docs/manual/tutorials.md"])
def test_own_ground_is_lit(page, tmp_path):
    text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    assert "Click **Daylight** for a sun and a sky" in text
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    tree = shader_tree(scene.world)
    tree.nodes.clear()
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    background.inputs["Color"].default_value = (0.05, 0.05, 0.05, 1.0)  # a new file's
    bpy.ops.tetflora.daylight()
    select(add_mesh("ground", size=50.0))
    bpy.ops.tetflora.populate(count=60, species="beech")
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.rotation_euler = Euler((1.1, 0.0, 0.8))  # as a new file's view looks
    camera.location = camera.rotation_euler.to_matrix().col[2] * 150.0
    camera.data.clip_end = 1000.0
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.tetflora.quality = 'DRAFT'
    tiny_render(samples=4, size=24)
    scene.render.filepath = str(tmp_path / "picture.png")
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(scene.render.filepath)
    shown = np.array(picture.pixels).reshape(-1, 4)[:, :3].mean(axis=1)
    assert np.quantile(shown, 0.25) > 0.2  # .016 in the light of a new file
