# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine says so when plants are out of sight: beyond the range, 100 m in a new file, or where nobody looks."""

from __future__ import annotations

import bpy
import pytest

from tests.blender.scenes import add_camera, add_plant, depsgraph
from tetflora_addon.blender.viewport import warnings

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def far_row():
    """A camera that looks along +Y from the origin; plants 50, 150 and 250 m away, and one that is switched off."""
    camera = add_camera(location=(0.0, 0.0, 2.0))
    camera.scale = (3.0, 3.0, 3.0)  # a camera's scale does not move its range
    for distance in (50.0, 150.0, 250.0, 350.0):
        add_plant(f"p{distance:g}", location=(0.0, distance, 0.0))
    bpy.data.objects["p350"].tetflora.enabled = False
    depsgraph()
    return camera


@pytest.mark.parametrize(("clip_end", "beyond"), [(100.0, 2), (200.0, 1)])
def test_plants_beyond_the_range_are_counted(far_row, clip_end, beyond):
    far_row.data.clip_end = clip_end
    text, _ = warnings.cut_off(bpy.context.scene)
    assert text.startswith(f"{beyond} of 3 plants")
    assert f'raise the Clip End of "camera", which is {clip_end:g} m' in text


def test_no_warning_where_all_are_in_range(far_row):
    far_row.data.clip_end = 251.0
    assert warnings.cut_off(bpy.context.scene)[0] == ""


@pytest.mark.parametrize("distance", [20.0, 250.0])
def test_a_camera_that_sees_none_of_the_plants_is_told(clean_file, capfd, distance):
    camera = add_camera(location=(0.0, 0.0, 2.0))
    camera.data.clip_end = 1000.0
    add_plant("plant", location=(0.0, distance, 0.0))
    bpy.context.scene.tetflora.quality = 'DRAFT'
    depsgraph()
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    assert "sees no plants" not in capfd.readouterr().out
    camera.rotation_euler.z += 3.0
    depsgraph()
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    assert 'The camera "camera" sees no plants' in capfd.readouterr().out
    bpy.context.scene.tetflora.max_passes = 1
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    assert "sees no plants" not in capfd.readouterr().out
