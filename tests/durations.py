# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each test costs: shown at the end of a run, and kept in out/durations for the next who makes them faster.

The measure is CPU time, of the process and of those it waited for: beside other work, the clock says little. Nothing
is asserted about it.
"""

from __future__ import annotations

import json
import os
from collections import defaultdict
from collections.abc import Generator, Iterable
from pathlib import Path

import pytest

SHOWN = 15


def _cpu() -> float:
    return sum(os.times()[:4])


class Durations:
    """A plugin of pytest: CPU seconds of each test, its fixtures included."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.seconds: dict[str, float] = defaultdict(float)
        self._last = _cpu()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Mark a report with what it cost; reports travel from the processes of xdist with all they carry."""
        report = yield
        now = _cpu()
        report.cpu_seconds, self._last = now - self._last, now
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add up preparing, calling and tidying."""
        self.seconds[report.nodeid] += getattr(report, "cpu_seconds", 0.0)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Show the slowest, and keep all."""
        total = sum(self.seconds.values())
        if "PYTEST_XDIST_WORKER" in os.environ or len(self.seconds) <= 2 * SHOWN:
            return
        terminalreporter.section(f"{total:.0f} CPU seconds in {len(self.seconds)} tests", sep="-")
        slowest = sorted(self.seconds.items(), key=lambda item: -item[1])
        for name, seconds in slowest[:SHOWN]:
            terminalreporter.line(f"{seconds:7.1f}  {name}")
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{label(self.seconds)}.json"
        path.write_text(json.dumps({name: round(seconds, 3) for name, seconds in slowest}, indent=1))
        terminalreporter.line(f"all of them: {path}")


def label(tests: Iterable[str]) -> str:
    """Name of a run, by the folders of its tests: blender-examples."""
    return "-".join(sorted({Path(test.split("::")[0]).parts[1:2][0] for test in tests}))
