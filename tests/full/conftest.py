# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A full Blender in which the zip is installed, as a user or a render farm has it."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from devtools import session

# Before collection: the tests import bpy and the extension at the top of the file.
session.start()

Run = Callable[..., subprocess.CompletedProcess]


@pytest.fixture(scope="session")
def run(full_blender: str, extension_zip: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Blender with a home of its own, in which TetFlora was installed by Blender's own command."""
    home = tmp_path_factory.mktemp("home")

    def call(*arguments: str | int | Path, home: Path) -> subprocess.CompletedProcess:
        return subprocess.run(
            [full_blender, *map(str, arguments)],
            env={**os.environ, "BLENDER_USER_RESOURCES": str(home)},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=180,
        )

    # With the home within reach, for tests that start processes by themselves.
    here = partial(call, home=home)
    done = here("-b", "--command", "extension", "install-file", "-r", "user_default", "-e", extension_zip)
    assert done.returncode == 0, done.stdout + done.stderr
    return here
