# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What Refine Automatically makes in the real window while the viewport is turned, see follow_steps.py."""

from __future__ import annotations

#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "follow_steps", "follow", 300


def test_plants_are_refined_for_the_view_without_a_camera(seen: dict) -> None:
    assert not seen["camera"]
    assert seen["message"] == ""


def test_a_coarse_result_comes_first(seen: dict) -> None:
    assert 0 < seen["first"] < seen["near"] / 2


def test_a_view_from_afar_needs_fewer_polygons(seen: dict) -> None:
    assert 0 < seen["far"] < seen["near"] / 2
