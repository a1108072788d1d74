# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs that end early in the real window: Esc, by stop_steps.py, and Blender that quits, by quit_steps.py."""

from __future__ import annotations

from pathlib import Path

from devtools import window

#: What is done in the window, where its pictures go, and the seconds that it may take.
STEPS = "stop_steps", "stop", 240


def test_escape_leaves_nothing_of_imports_exports_and_biomes(seen: dict) -> None:
    left = {name: left for name, left in seen.items() if name not in {"said", "strewn"}}
    assert {name: what for name, what in left.items() if what not in ([], "ended")} == {}
    stopped = {name.split()[0] for name, what in left.items() if what == []}
    assert stopped >= {"grid", "csv", "big_tiff", "outlines", ".glb", ".obj", "biome"}


def test_results_are_out_of_date_when_hidden_plants_are_shown_again(seen: dict) -> None:
    assert seen["said"] == [[], ["the plants"]]


def test_a_cover_stays_where_its_leaves_are_stopped_and_can_be_undone(seen: dict) -> None:
    assert seen["strewn"] == [1, 0]


def test_blender_quits_in_the_middle_of_refine(full_blender: str, resources: Path, tmp_path: Path) -> None:
    steps = Path(__file__).with_name("quit_steps.py")
    result = window.run_in_window(full_blender, steps, tmp_path, 120, resources)
    assert "TETFLORA_OT_refine" in (tmp_path / "running").read_text()
    assert "ended (code 0)" in result["error"]
    log = (tmp_path / "blender.log").read_text(encoding="utf-8", errors="replace")
    assert not [word for word in ("Traceback", "Error", "crash", "Not freed") if word in log], log
