# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests cost is kept from run to run, and quick runs leave out what cost much."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.durations import QUICK, Durations


def run(folder: Path, quick: bool = False, **seconds: float) -> list[str]:
    """The tests that run, of those named, if each takes so long."""
    plugin, left_out, said = Durations(folder / "out"), [], []
    for name in seconds:
        (folder / name.split("::")[0]).touch()
    hook = SimpleNamespace(pytest_deselected=lambda items: left_out.extend(items))
    config = SimpleNamespace(getoption={"quick": quick}.get, hook=hook)
    items = [SimpleNamespace(nodeid=name) for name in seconds]
    plugin.pytest_collection_modifyitems(config, items)
    for item in items:
        for part in (0.25, 0.75):
            report = SimpleNamespace(nodeid=item.nodeid, cpu_seconds=part * seconds[item.nodeid])
            plugin.pytest_runtest_logreport(report)
    plugin.pytest_terminal_summary(SimpleNamespace(section=lambda *_, **__: None, line=said.append))
    assert len(items) + len(left_out) == len(seconds)
    return [item.nodeid for item in items]


@pytest.fixture(autouse=True)
def _alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PYTEST_XDIST_WORKER", raising=False)


def test_a_quick_run_leaves_out_what_was_slow(tmp_path: Path) -> None:
    """Preparing and tidying count; what is new is run, and a run of some tests forgets no others."""
    assert run(tmp_path, slow=1.5 * QUICK, fast=0.5 * QUICK) == ["slow", "fast"]
    assert run(tmp_path, other=0.0) == ["other"]
    assert run(tmp_path, quick=True, slow=0.0, fast=2 * QUICK, new=0.0) == ["fast", "new"]
    assert run(tmp_path, quick=True, fast=0.0, slow=0.0) == []


def test_nothing_is_left_out_by_itself(tmp_path: Path) -> None:
    run(tmp_path, slow=1.5 * QUICK)
    assert run(tmp_path, slow=0.0) == ["slow"]
    path = Durations(tmp_path / "out").path
    assert list(path.parent.iterdir()) == [path]


def test_files_that_took_longest_begin(tmp_path: Path) -> None:
    run(tmp_path, **{"a::one": 0.1, "b::one": 0.2, "b::two": 0.9, "c::one": 0.3})
    again = {"new::one": 0.0, "a::one": 0.0, "b::one": 0.0, "b::two": 0.0, "c::one": 0.0}
    assert run(tmp_path, **again) == ["b::one", "b::two", "c::one", "a::one", "new::one"]


def test_what_eevee_draws_comes_before_them(tmp_path: Path) -> None:
    run(tmp_path, **{"a::one": 0.1, "b::one": 0.2, "a::two[EEVEE]": 0.0})
    again = {"a::one": 0.0, "a::two[EEVEE]": 0.0, "b::one": 0.0, "c::in_eevee": 0.0}
    assert run(tmp_path, **again) == ["a::two[EEVEE]", "c::in_eevee", "b::one", "a::one"]


def test_tests_whose_file_has_gone_are_forgotten(tmp_path: Path) -> None:
    run(tmp_path, gone=1.0, there=1.0)
    (tmp_path / "gone").unlink()
    run(tmp_path, other=0.0)
    assert set(Durations(tmp_path / "out").kept()) == {"there", "other"}
