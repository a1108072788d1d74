# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An attack on the engine, from a fixed seed; ``python -m benchmarks attack`` runs far more cases."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from tests.attack import engine_cases
from tests.attack.watch import attack

CASES = 2400
#: Of kinds whose cases take longest.
FEWER = {"species": 120, "polygons": 120, "cache": 400}


@pytest.mark.parametrize("kind", engine_cases.SHARES)
def test_attack(kind: str, tmp_path: Path) -> None:
    findings = attack({kind: engine_cases.kinds(FEWER.get(kind, CASES))[kind]}, tmp_path)
    assert not findings.raw
    assert not findings.outside
    assert not findings.slow
    assert findings.refused < findings.cases
    assert findings.figures()["grown_mb"] < 1000


def test_what_python_compiles_is_not_written_outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module that a case imports first is kept in a folder of its own, where one is named."""
    compiled, folder = tmp_path / "compiled", tmp_path / "jail"
    compiled.mkdir()
    folder.mkdir()
    (tmp_path / "imported_late.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "pycache_prefix", str(compiled))
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    findings = attack({"late": (lambda rng, jail: importlib.import_module("imported_late"), 1)}, folder)
    assert list(compiled.rglob("imported_late*.pyc"))
    assert not findings.raw
    assert not findings.outside
