# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers in the window of a full Blender: + and Scatter, Daylight, Look from Here, Update; rows stay where they are."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "layer_steps", "layers", 240


def test_scatter_plants_a_wood_by_density(seen: dict) -> None:
    made, by_density = seen["planted"]
    assert by_density and 30 <= made <= 60  # 150 on a hectare, on 60 m by 60 m


def test_two_clicks_light_the_ground_and_put_the_camera_on_it(seen: dict) -> None:
    assert seen["suns"] == 1
    assert seen["camera"][2] == pytest.approx(1.7, abs=0.01)
    assert max(map(abs, seen["camera"][:2])) < 30.0
    assert seen["view"] == 'CAMERA'


def test_a_ground_that_is_lifted_makes_its_layer_due_until_undo_or_update(seen: dict) -> None:
    assert seen["due"] == [False, True, False, True, False]
    assert len(seen["lifted"]) > 5
    assert set(seen["lifted"]) == {5.0}


def test_rows_never_move(seen: dict) -> None:
    assert min(seen["rows"]) > 0
    assert len(set(seen["rows"])) == 1


def test_the_eye_hides_and_the_tool_is_in_the_toolbar(seen: dict) -> None:
    assert seen["hidden"]
    assert seen["tool"] == "tetflora.paint_plants"


@pytest.mark.parametrize("name", ["add", "scattered", "lit", "lifted", "hidden", "tool"])
def test_the_window_was_drawn(seen: dict, pictures: Path, colors: Callable[[Path], int], name: str) -> None:
    assert colors(pictures / "layers" / f"{name}.png") > 200
