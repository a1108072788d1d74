# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes beyond all measure, which an attack found: named, where they were numbers that linear algebra gave up on."""

from __future__ import annotations

import math

import bpy
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph
from tetflora_addon.blender.job import refine
from tetflora_addon.errors import SceneError

pytestmark = pytest.mark.usefixtures("clean_file")


def _refused(says: str) -> None:
    with pytest.raises(SceneError, match=says):
        refine.refine(bpy.context.scene, depsgraph())
    assert not [c for c in bpy.data.collections if c.get("tetflora_made")]


def test_a_plant_of_endless_scale_is_named():
    add_camera()
    add_plant().scale.z = -3.4e38
    _refused('"plant": zero scale, a scale above 100,000, or an invalid position')


@pytest.mark.parametrize("way", ["scale", "vertex"])
def test_a_mesh_of_endless_size_is_named(way):
    add_camera()
    mesh = add_mesh()
    mesh.tetflora.is_explicit = True
    if way == "scale":
        mesh.scale.x = 1e30
    else:
        mesh.data.vertices[0].co.x = 1e30
    _refused('"mesh" has vertices or a transform that are not finite, or beyond')


def test_a_panorama_whose_lens_is_no_number_is_named():
    add_plant()
    data = add_camera().data
    data.type, data.panorama_type, data.sensor_width = 'PANO', 'FISHEYE_EQUISOLID', math.nan
    _refused('"camera" sees nothing; raise its Field of View or Lens')
