# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The installed zip in the bpy wheel: it enables without a warning and leaves nothing behind."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

PROBE = Path(__file__).with_name("probe.py")


@pytest.fixture(scope="module")
def seen(extension_zip: Path, tmp_path_factory: pytest.TempPathFactory) -> dict:
    folder = tmp_path_factory.mktemp("installed")
    (folder / "home").mkdir()
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    environment["BLENDER_USER_RESOURCES"] = str(folder / "home")
    command = [sys.executable, PROBE, folder / "seen.json", extension_zip]
    # Away from the source tree: only the zip can be imported.
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads((folder / "seen.json").read_text(encoding="utf-8"))


def test_installs_and_enables(seen: dict) -> None:
    assert seen["installed"] == 0
    assert seen["enabled"]


def test_breaks_no_policy_of_blender(seen: dict) -> None:
    assert seen["warnings"] == {}


def test_adds_its_parts(seen: dict) -> None:
    assert {"property Scene.tetflora", "property Object.tetflora"} <= set(seen["added"])
    assert seen["commands"] == {"tetflora": 1}


def test_everything_it_adds_bears_its_name(seen: dict) -> None:
    assert [item for item in seen["added"] if "tetflora" not in item.lower()] == []


def test_disabling_leaves_nothing(seen: dict) -> None:
    assert seen["left"] == []
    assert seen["lost"] == []


def test_own_species_stay_when_it_is_removed(seen: dict) -> None:
    assert seen["kept"] == {"removed": True, "own": True, "inside": False}


def test_enables_a_second_time(seen: dict) -> None:
    assert seen["enabled_again"]
