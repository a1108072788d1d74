# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The installed zip in the window of a full Blender: its tab, menus, keys and preferences; errors are reported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from devtools import window

HERE = Path(__file__).parent


def test_programs_for_a_window_are_there() -> None:
    assert window.missing_tools() == []


def test_sidebar(full_blender: str, resources: Path, pictures: Path, colors: Callable[[Path], int]) -> None:
    result = window.run_in_window(full_blender, HERE / "sidebar_steps.py", pictures / "sidebar", 180, resources)
    assert result["ok"], result["error"]
    assert result["values"]["enabled"]
    assert result["values"]["tab"] == "TetFlora"
    assert result["values"]["sidebar_width"] > 100
    assert result["values"]["open_after_n"] is False
    assert result["values"]["preferences_drawn"] > 0
    assert "Traceback" not in (pictures / "sidebar" / "blender.log").read_text(encoding="utf-8", errors="replace")
    assert "sidebar.png" in result["pictures"]
    assert colors(pictures / "sidebar" / "sidebar.png") > 200


def test_an_error_in_the_script_is_reported(full_blender: str, tmp_path: Path) -> None:
    script = tmp_path / "broken.py"
    script.write_text("def steps(ui):\n    yield\n    raise ValueError('raised on purpose')\n", encoding="utf-8")
    result = window.run_in_window(full_blender, script, tmp_path / "out", 120)
    assert not result["ok"]
    assert "raised on purpose" in result["error"]
