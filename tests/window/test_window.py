# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The installed zip in the window of a full Blender: its tab, menus, keys and preferences; errors are reported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from devtools import window

HERE = Path(__file__).parent


def test_programs_for_a_window_are_there() -> None:
    assert window.missing_tools() == []


@pytest.fixture(scope="module")
def shown(full_blender: str, resources: Path, pictures: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict]:
    """What two scripts have seen in one Blender: one that fails, and the sidebar's after it; and what Blender said."""
    folder = tmp_path_factory.mktemp("broken")
    script = folder / "broken.py"
    script.write_text("def steps(ui):\n    yield\n    raise ValueError('raised on purpose')\n", encoding="utf-8")
    scripts = {script: folder, HERE / "sidebar_steps.py": pictures / "sidebar"}
    found = window.run_scripts(full_blender, scripts, 300, resources)
    return [*found, {"log": (folder / "blender.log").read_text(encoding="utf-8", errors="replace")}]


def test_sidebar(shown: list[dict], pictures: Path, colors: Callable[[Path], int]) -> None:
    result = shown[1]
    assert result["ok"], result["error"]
    assert result["values"]["enabled"]
    assert result["values"]["tab"] == "TetFlora"
    assert result["values"]["sidebar_width"] > 100
    assert result["values"]["open_after_n"] is False
    assert result["values"]["preferences_drawn"] > 0
    assert "sidebar.png" in result["pictures"]
    assert colors(pictures / "sidebar" / "sidebar.png") > 200


def test_a_driver_that_cannot_be_opened_ends_blender_at_once(
    full_blender: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(window, "DRIVER", tmp_path / "driver.py")
    result = window.run_in_window(full_blender, HERE / "sidebar_steps.py", tmp_path / "out", 60)
    assert "ended (code 1)" in result["error"]


def test_an_error_in_a_script_is_reported_and_the_next_is_run(shown: list[dict]) -> None:
    assert not shown[0]["ok"]
    assert "raised on purpose" in shown[0]["error"]
    assert shown[1]["ok"]
    assert shown[2]["log"].count("Traceback") == 1
