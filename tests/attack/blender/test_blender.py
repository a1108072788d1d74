# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An attack through Blender, from a fixed seed; ``python -m benchmarks attack`` runs far more cases."""

from __future__ import annotations

from pathlib import Path

import pytest

from devtools import session

# Before the cases are imported: they import bpy and the extension at the top of the file.
session.start()

from tests.attack import scene_cases  # noqa: E402
from tests.attack.watch import attack  # noqa: E402

CASES = 90


@pytest.mark.parametrize("kind", scene_cases.SHARES)
def test_attack(clean_file: object, kind: str, tmp_path: Path) -> None:
    findings = attack({kind: scene_cases.kinds(CASES)[kind]}, tmp_path)
    assert not findings.raw
    assert not findings.outside
    assert not findings.slow
    assert findings.refused < findings.cases
    assert findings.figures()["grown_mb"] < 1000
