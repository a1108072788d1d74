# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The installed zip in the window of a full Blender; pictures go to ``TETFLORA_PICTURES`` (default out/window)."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from devtools import build, window

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def resources(full_blender: str, extension_zip: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home of Blender in which TetFlora is installed and enabled."""
    folder = tmp_path_factory.mktemp("resources")
    command = [full_blender, "-b", "--command", "extension", "install-file", "-r", "user_default", "-e", extension_zip]
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def pictures() -> Path:
    return Path(os.environ.get("TETFLORA_PICTURES", build.ROOT / "out" / "window"))


def pixel_kinds(picture: Path) -> int:
    """How many different colours a picture has; a window that was never drawn has one or two."""
    command = ["identify", "-format", "%k", str(picture)]
    return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def test_programs_for_a_window_are_there() -> None:
    assert window.missing_tools() == []


def test_sidebar(full_blender: str, resources: Path, pictures: Path) -> None:
    result = window.run_in_window(full_blender, HERE / "sidebar_steps.py", pictures / "sidebar", 180, resources)
    assert result["ok"], result["error"]
    assert result["values"]["enabled"]
    assert result["values"]["tab"] == "TetFlora"
    assert result["values"]["sidebar_width"] > 100
    assert result["values"]["open_after_n"] is False
    assert "sidebar.png" in result["pictures"]
    assert pixel_kinds(pictures / "sidebar" / "sidebar.png") > 200


def test_an_error_in_the_script_is_told(full_blender: str, tmp_path: Path) -> None:
    script = tmp_path / "broken.py"
    script.write_text("def steps(ui):\n    yield\n    raise ValueError('told on purpose')\n", encoding="utf-8")
    result = window.run_in_window(full_blender, script, tmp_path / "out", 120)
    assert not result["ok"]
    assert "told on purpose" in result["error"]
