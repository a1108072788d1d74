# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The forest of a million plants, tiny: all are there, on dry ground; the summit is free, and conifers grow above."""

from __future__ import annotations

import bpy
import numpy as np

from examples import million
from tests.blender.scenes import depsgraph
from tetflora_addon.blender.placing import cover
from tetflora_addon.blender.scene import plants


def test_forest_stands_as_it_is_described(clean_file, tmp_path, monkeypatch):
    monkeypatch.setattr(million, "_CLEAR", 25.0)  # what covers the summit takes longest
    monkeypatch.setattr(million, "_MEADOW", 52.0)
    monkeypatch.setattr(cover, "MOST", 300)
    made = million.render_million(tmp_path / "forest.png", plants=200, width=32, samples=1)
    assert made["polygons"] + made["facets"] > 0
    assert (tmp_path / "forest.png").is_file()
    scene = bpy.context.scene
    seeds = plants.read_plants(scene, depsgraph())[0]
    names, place = np.array(seeds.identifiers)[seeds.species], seeds.position
    trees = np.isin(names, [*million.VALLEYS, *million.HEIGHTS])
    conifers = np.isin(names, ["spruce", "conifer"])
    ground, lake = scene.objects["Ground"], scene.objects["Lake"]
    below = np.array([ground.ray_cast((x, y, 1e4), (0, 0, -1))[1].z for x, y, _ in place.tolist()])
    forest = trees & (np.abs(place[:, 2] - below) < 0.1)
    assert forest.sum() == 200
    assert place[:, 2].min() > lake.data.vertices[0].co.z
    assert place[forest & conifers, 2].mean() > place[forest & ~conifers, 2].mean() + 10.0
    eye, summit = scene.camera.location, scene.objects["Summit"].location
    assert np.hypot(*(place[forest, :2] - summit[:2]).T).min() > 24.0
    assert 2.0 < eye.z - ground.ray_cast((eye.x, eye.y, 1e4), (0, 0, -1))[1].z < 10.0
