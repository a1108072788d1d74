# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip in a full Blender, from the command line, as a user or a render farm has it."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from devtools import build

PROBE = build.ROOT / "tests" / "packaging" / "probe.py"
Run = Callable[..., subprocess.CompletedProcess]


@pytest.fixture(scope="module")
def seen(run: Run, tmp_path_factory: pytest.TempPathFactory) -> dict:
    out = tmp_path_factory.mktemp("seen") / "seen.json"
    done = run("-b", "--python-exit-code", "1", "-P", PROBE, "--", out)
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(out.read_text(encoding="utf-8"))


def test_zip_is_valid(run: Run, extension_zip: Path) -> None:
    done = run("-b", "--command", "extension", "validate", extension_zip)
    assert done.returncode == 0, done.stdout + done.stderr


def test_enabled_after_a_restart(seen: dict) -> None:
    assert seen["enabled_by_install"]


def test_breaks_no_policy_of_blender(seen: dict) -> None:
    assert seen["enabled"]
    assert seen["warnings"] == {}


def test_disabling_leaves_nothing(seen: dict) -> None:
    assert {"property Scene.tetflora", "property Object.tetflora"} <= set(seen["added"])
    assert seen["commands"] == {"tetflora": 1}
    assert seen["left"] == []
    assert seen["lost"] == []


def test_nothing_is_said_at_start(run: Run) -> None:
    done = run("-b", "--python-expr", "pass")
    assert done.returncode == 0
    assert "Traceback" not in done.stdout + done.stderr


def test_command_line_helps(run: Run) -> None:
    done = run("-b", "--command", "tetflora", "--help")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "refine" in done.stdout


def test_translations_reach_the_interface(run: Run) -> None:
    """Only a full Blender has languages; a text that Blender has too would be in its words."""
    code = (
        "import bpy; view = bpy.context.preferences.view; view.language = 'de_DE'; "
        "view.use_translate_interface = True; print('said:', bpy.app.translations.pgettext('Shadow Cutoff'))"
    )
    done = run("-b", "--python-exit-code", "1", "--python-expr", code)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "said: Schwelle für Schatten" in done.stdout
