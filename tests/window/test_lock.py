# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames are refined while the real window draws nothing, *Lock Interface* or not, see lock_steps.py."""

from __future__ import annotations

#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "lock_steps", "lock", 300


def test_a_locked_window_leaves_the_work_to_the_thread_of_the_render(seen: dict) -> None:
    *where, errors = seen["locked"]
    assert where == [[False, False]] * 3 and errors == []


def test_for_an_unlocked_one_the_main_thread_works_and_draws_nothing(seen: dict) -> None:
    *where, errors = seen["unlocked"]
    assert where == [[True, False]] * 3 and errors == []


def test_one_timer_lives_as_long_as_the_extension(seen: dict) -> None:
    assert (seen["timer"], seen["timers_at_end"], seen["timer_after"]) == (True, True, False)


def test_meshes_that_are_disabled_in_viewports_render_with_their_modifiers(seen: dict) -> None:
    assert seen["meshes"] == 4
    assert seen["disabled"] == [False, True, False]


def test_what_moves_is_evaluated_in_a_scene_that_is_gone_afterward(seen: dict) -> None:
    assert seen["moving"] == 1
    assert seen["scenes"] == [1, 1]
