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


@pytest.fixture(scope="session")
def results(request: pytest.FixtureRequest, full_blender: str, resources: Path, pictures: Path) -> dict[str, dict]:
    """What came of the ``STEPS`` of all files of tests that are run: one Blender does them, from its startup file each.

    A start of Blender, with what it compiles for the first redraws, takes as long as some of them.
    """
    files = {item.module.STEPS for item in request.session.items if hasattr(getattr(item, "module", None), "STEPS")}
    # The last one disables the extension.
    ordered = sorted(files, key=lambda steps: (steps[0] == "lock_steps", steps))
    scripts = {Path(__file__).parent / f"{steps}.py": pictures / folder for steps, folder, _ in ordered}
    seconds = sum(most for _, _, most in ordered)
    found = window.run_scripts(full_blender, scripts, seconds, resources)
    return {steps: result for (steps, _, _), result in zip(ordered, found, strict=True)}


@pytest.fixture(scope="module")
def seen(request: pytest.FixtureRequest, results: dict[str, dict]) -> dict:
    """What the steps of a file of tests have seen in the window."""
    result = results[request.module.STEPS[0]]
    assert result["ok"], result["error"]
    return result["values"]


@pytest.fixture(scope="session")
def colors() -> Callable[[Path], int]:
    """Counts the different colors of a picture; a window that was never drawn has one or two."""

    def count(picture: Path) -> int:
        command = ["identify", "-format", "%k", str(picture)]
        return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    return count
