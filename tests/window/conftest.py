# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The installed zip for tests in the window; pictures go to ``TETFLORA_PICTURES`` (default out/window)."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from devtools import build, window


@pytest.fixture(scope="session")
def resources(full_blender: str, extension_zip: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home of Blender in which TetFlora is installed and enabled."""
    folder = tmp_path_factory.mktemp("resources")
    command = [full_blender, "-b", "--command", "extension", "install-file", "-r", "user_default", "-e", extension_zip]
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="session")
def pictures() -> Path:
    """Where pictures of the window go, a folder for each script."""
    return Path(os.environ.get("TETFLORA_PICTURES", build.ROOT / "out" / "window"))


@pytest.fixture(scope="module")
def seen(request: pytest.FixtureRequest, full_blender: str, resources: Path, pictures: Path) -> dict:
    """What the steps of a file of tests have seen in the window: its ``STEPS``."""
    steps, folder, seconds = request.module.STEPS
    path = Path(__file__).parent / f"{steps}.py"
    result = window.run_in_window(full_blender, path, pictures / folder, seconds, resources)
    assert result["ok"], result["error"]
    return result["values"]


@pytest.fixture(scope="session")
def colors() -> Callable[[Path], int]:
    """Counts the different colors of a picture; a window that was never drawn has one or two."""

    def count(picture: Path) -> int:
        command = ["identify", "-format", "%k", str(picture)]
        return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    return count
