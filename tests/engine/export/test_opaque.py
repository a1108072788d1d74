# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Colors of leaves that let no light through are those with which they are as bright as leaves that do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine.export.test_levels import square
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.export import opaque as subject
from tetflora_addon.export.levels import PlantLevel
from tetflora_addon.export.opaque import opaque, sides_of
from tetflora_addon.optics import PALER, THROUGH_TINT


@pytest.fixture(autouse=True)
def coarse_views(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sheet needs no more cells across to be a sheet."""
    monkeypatch.setattr(subject, "_CELLS", 96)


COLOR, PASSED = np.array([0.1, 0.2, 0.05]), 0.4


def sheet(passed: float, z: float = 0.0, side: float = 1.0) -> MeshBuffers:
    made = square(z, tuple(COLOR), side)
    return replace(made, attributes={**made.attributes, "tf_transmission": ("FACE", np.float32([passed]))})


def recolored(*parts: tuple[str, MeshBuffers]) -> dict[str, np.ndarray]:
    levels = [PlantLevel(parts, 0.0)]
    (level,) = opaque(levels, sides_of(levels))
    return {kind: mesh.attributes["tf_color"][1][0] for kind, mesh in level.parts}


def test_what_lets_no_light_through_keeps_its_color():
    found = recolored(("leaf", sheet(PASSED)), ("bark", sheet(0.0, 2.0)))
    np.testing.assert_allclose(found["bark"], COLOR, rtol=1e-6)
    assert (found["leaf"] < 0.9 * COLOR).all()


def test_leaves_that_lie_level_show_their_darker_side_and_what_the_ground_sends_through_them():
    found = recolored(("leaf", sheet(PASSED)))["leaf"]
    upper = (1.0 - PASSED) * (1.0 - np.array(PALER))
    np.testing.assert_allclose(found, COLOR * (upper + 0.2 * PASSED * THROUGH_TINT), rtol=0.02)


def test_shade_of_the_plant_itself_counts():
    """Below a roof, light comes from beside and from the ground alone."""
    leaf = replace(sheet(PASSED), positions=sheet(PASSED).positions + np.float32([4.5, 4.5, 0.0]))
    open_, roofed = (
        recolored(("leaf", leaf), ("bark", roof))["leaf"] for roof in (sheet(0.0, -2, 10), sheet(0.0, 1, 10))
    )
    assert (roofed > 1.2 * open_).all()


def test_light_of_the_sky_falls_on_what_is_shaded_for_those_who_see_no_shadows_of_it():
    """Below a roof it would otherwise be light from the ground alone, which all passes through."""
    leaf = replace(sheet(PASSED), positions=sheet(PASSED).positions + np.float32([4.5, 4.5, 0.0]))
    _, _, through, _ = sides_of([PlantLevel((("leaf", leaf), ("bark", sheet(0.0, 1, 10))), 0.0)])["leaf"]
    assert 0.5 < through < 2.0


def test_all_levels_have_the_sides_of_the_first():
    leaf = sheet(PASSED)
    levels = [PlantLevel((("leaf", leaf), ("bark", sheet(0.0, -1.0))), 0.0)]
    levels.append(PlantLevel((("leaf", replace(leaf, positions=leaf.positions[:, [2, 1, 0]])),), 1.0))
    near, far = (level.parts[0][1].attributes["tf_color"][1] for level in opaque(levels, sides_of(levels)))
    np.testing.assert_array_equal(near, far)


def test_leaves_that_hang_show_as_much_light_through_them_as_they_reflect_to_all_sides():
    """Light and eyes that lay along each other would see more of the lit sides of some."""
    leaf, found = sheet(PASSED), []
    upright = leaf.positions[:, [2, 1, 0]]
    for turn in (0.0, 0.4 * np.pi, 0.7 * np.pi):
        x, y = np.cos(turn), np.sin(turn)
        turned = (upright @ np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])).astype(np.float32)
        found.append(recolored(("leaf", replace(leaf, positions=turned)))["leaf"])
    np.testing.assert_allclose(found, np.tile(COLOR * (1.0 - PASSED + PASSED * THROUGH_TINT), (3, 1)), rtol=0.03)


def test_light_that_leaves_send_to_each_other_is_scattered_as_often():
    """Of what is shaded all light comes from other leaves: what passes through these counts, seen or not."""
    level, shaded = PlantLevel((("leaf", sheet(PASSED)),), 0.0), 0.6
    once, often = (
        opaque([level], {"leaf": np.array([0.5, 0.5, 0.3, part])})[0].parts[0][1].attributes["tf_color"][1][0]
        for part in (0.0, shaded)
    )
    every = COLOR * (1.0 - PASSED + PASSED * THROUGH_TINT)
    np.testing.assert_allclose(often / (1.0 - shaded * often), once / (1.0 - shaded * every), rtol=1e-5)
    assert (often > once).all()
