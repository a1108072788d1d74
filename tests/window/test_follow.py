# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What Rendered shading refines by itself in the real window, while it is turned and changed, see follow_steps.py."""

from __future__ import annotations

#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "follow_steps", "follow", 500


def test_plants_are_refined_for_the_view_without_a_camera(seen: dict) -> None:
    assert not seen["camera"] and not seen["on_before"]
    assert seen["message"] == ""


def test_a_coarse_result_comes_first(seen: dict) -> None:
    assert 0 < seen["first"] < seen["near"] / 2


def test_it_is_sharp_by_parts(seen: dict) -> None:
    """How many of them follow one by one depends on how long the window takes to draw: not all, but some do."""
    assert len(set(seen["parts"])) > 2, "tiles between the first look and the end"
    assert seen["parts"] == sorted(seen["parts"])


def test_what_was_made_for_another_view_is_not_seen_while_it_moves(seen: dict) -> None:
    assert seen["moving"] == 0


def test_what_is_sharp_stays_where_the_view_moves_a_little(seen: dict) -> None:
    assert seen["moved_little"] == seen["near"]
    assert seen["least_meanwhile"] > seen["near"] / 2


def test_a_view_from_afar_needs_fewer_polygons(seen: dict) -> None:
    assert 0 < seen["far"] < seen["near"] / 2


def test_a_view_that_is_turned_meanwhile_is_begun_anew(seen: dict) -> None:
    assert seen["turned"] == ""


def test_undo_meanwhile_leaves_results_and_solid_shading_keeps_them(seen: dict) -> None:
    assert seen["on_after_undo"]
    assert seen["undone"] > 0
    assert seen["kept"] == seen["undone"]
