# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine between the redraws of the real window: its end, Return, Esc and errors, by modal_steps.py."""

from __future__ import annotations

#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "modal_steps", "modal", 240


def test_steps_in_the_window_give_what_the_script_gives(seen: dict) -> None:
    assert seen["running"]
    assert seen["in_window"]["plants"] == 2
    assert seen["in_window"] == seen["in_script"]


def test_escape_in_the_middle_leaves_the_scene_as_it_was(seen: dict) -> None:
    assert seen["running_before_esc"]
    assert seen["left_by_esc"] == []


def test_escape_does_not_wait_for_a_pass(seen: dict) -> None:
    assert seen["running_in_pass"]
    assert seen["left_by_esc_in_pass"] == []


def test_return_stops_refining_and_makes_what_there_is(seen: dict) -> None:
    assert seen["stopped"] == [True, False]
    assert "Stopped early" in seen["reports"]


def test_what_is_wrong_is_said_before_the_window_waits(seen: dict) -> None:
    assert '"odd": zero scale' in seen["refused"]
    assert not seen["running_refused"]


def test_errors_in_the_middle_are_reported(seen: dict) -> None:
    assert seen["running_broken"]
    assert "leaf without faces" in seen["reports"]
    assert seen["left_by_error"] == []


def test_columns_of_an_inventory_are_asked_for(seen: dict) -> None:
    assert seen["fields_after_ESC"] == []
    assert seen["fields_after_RET"] == ["trees"]
    assert seen["columns"] == {"Art": "name", "top": "", "x": "x", "y": "y"}
