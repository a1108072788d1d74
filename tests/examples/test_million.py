# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The forest of a million plants, tiny: all plants are there, on the ground, and conifers grow above the others."""

from __future__ import annotations

import bpy
import numpy as np

from examples import million
from tests.blender.scenes import depsgraph
from tetflora_addon.blender.scene import plants


def test_forest_stands_as_it_is_described(clean_file, tmp_path):

    made = million.render_million(tmp_path / "forest.png", plants=600, width=64, samples=1)
    assert made["plants"] == 600
    assert made["polygons"] + made["facets"] > 0
    assert (tmp_path / "forest.png").is_file()
    scene = bpy.context.scene
    seeds = plants.read_plants(scene, depsgraph())[0]
    conifers = np.isin(np.array(seeds.identifiers)[seeds.species], ["spruce", "conifer"])
    ground = scene.objects["Ground"]
    below = [ground.ray_cast((x, y, 1e4), (0, 0, -1))[1].z for x, y, _ in seeds.position.tolist()]
    assert np.allclose(seeds.position[:, 2], below, atol=0.1)
    assert seeds.position[conifers, 2].mean() > seeds.position[~conifers, 2].mean() + 10.0
    eye = scene.camera.location
    assert 30.0 < eye.z - ground.ray_cast((eye.x, eye.y, 1e4), (0, 0, -1))[1].z < 80.0
