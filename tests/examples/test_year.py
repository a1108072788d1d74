# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The benchmark of the year counts what proxies do beyond what plants do, and tells meshes apart."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from PIL import Image

from benchmarks import year
from tetflora_addon.blender.job import refine

STATES = tuple((day, 0.0) for day in (1.0, 6.0, 11.0))
SERIES = year.Series("year", lambda scene: None, STATES, 1)
TIMES = {f"{kind}_{what}": 1 for kind in year.KINDS for what in ("s", "render_s", "polygons", "facets")}


def frames(folder, refined, expanded):
    """Pictures of flat grays, and their record."""
    for gray, kind in ((refined, "refined"), (expanded, "expanded")):
        for state, value in zip(STATES, gray, strict=True):
            picture = Image.fromarray(np.full((16, 16, 3), value, np.uint8))
            picture.save(year._path(folder, state, kind))
    Image.fromarray(np.full((16, 16, 3), 255, np.uint8)).save(folder / "nothing.png")
    return year.figures(folder, SERIES, {year._key(state): TIMES for state in STATES})


def test_what_plants_do_does_not_count(tmp_path, clean_file):
    found = frames(tmp_path, (60, 120, 180), (60, 120, 180))
    assert found["year_flip_expanded_step_max"] > 0.1
    assert found["year_flip_steps_max"] == found["year_flip_other_change_max"] == found["year_flip"] == 0.0


def test_a_constant_difference_is_no_pop(tmp_path, clean_file):
    found = frames(tmp_path, (70, 130, 190), (60, 120, 180))
    assert found["year_flip_other_change_max"] == pytest.approx(0.0, abs=2e-3)
    assert found["year_flip"] > 0.01


def test_a_pop_of_proxies_counts_where_it_is(tmp_path, clean_file):
    found = frames(tmp_path, (60, 60, 120), (60, 60, 60))
    assert found["year_flip_steps_max"] > 0.1 and found["year_flip_steps_max_at"] == 11.0
    assert found["year_flip_other_change_max"] > 0.1
    assert found["year_flip_steps_max_where_plants"] == pytest.approx(found["year_flip_steps_max"])


def test_digests_are_of_what_was_made(clean_file):
    scene = bpy.context.scene
    year.lone(scene, "bush", 2.0, (64, 64), age=0.0)
    digests = []
    for day in (None, None, 15.0):
        year.set_day(scene, day)
        refine.refine(scene, bpy.context.evaluated_depsgraph_get())
        digests.append(year.digest(scene))
    assert digests[0] == digests[1] != digests[2]
