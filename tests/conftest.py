# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures for tests that need Blender; those in tests/engine use none of them and never import bpy."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import HealthCheck, settings

from devtools import build, session
from tests.durations import Durations

# Nothing is timed in a test: by itself an example may take 200 ms, which it exceeds where other processes are at work.
# Examples are drawn at random on a desk; what CI says follows from the commit alone.
settings.register_profile(
    "untimed",
    max_examples=30,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize="CI" in os.environ,
)
settings.load_profile("untimed")

# Tests that run beside others have a core each, and start no other processes unless they are about these.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("TETFLORA_THREADS", "1")


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--quick``: only what has not taken long the last time."""
    parser.addoption("--quick", action="store_true", help="leave out tests that took long in the last run")


def pytest_configure(config: pytest.Config) -> None:
    """Say at the end what tests cost."""
    config.pluginmanager.register(Durations(config.rootpath / "out"))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """With ``--dist loadfile``, see tests/schedule.py; Blender's own Python has no xdist."""
    from tests.schedule import FileScheduling

    return FileScheduling(config, log) if config.getvalue("dist") == "loadfile" else None


@pytest.fixture(scope="session")
def blender() -> Iterator[ModuleType]:
    """The extension's package, enabled from the source tree; one Blender serves all tests of a process."""
    yield session.start()
    session.stop()


@pytest.fixture(scope="session")
def empty_file(blender: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What Blender starts with, of which `session.clean_file` makes an empty one, as that: read in half the time."""
    import bpy

    session.clean_file()
    path = tmp_path_factory.mktemp("empty") / "empty.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=False)
    return path


@pytest.fixture
def clean_file(blender: ModuleType, empty_file: Path) -> ModuleType:
    """The same, with an empty file: one scene, nothing in it."""
    import bpy

    bpy.ops.wm.read_homefile(filepath=str(empty_file), load_ui=False)
    return blender


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip that users install. ``TETFLORA_ZIP`` names one that stands already."""
    ready = os.environ.get("TETFLORA_ZIP")
    return Path(ready).resolve() if ready else build.build(tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="session")
def full_blender() -> str:
    """The full Blender that ``BLENDER`` names; tests that use it are only run where there is one."""
    path = os.environ.get("BLENDER")
    if not path:
        pytest.fail("tests in a full Blender need BLENDER=/path/to/blender", pytrace=False)
    return str(Path(path).absolute())
