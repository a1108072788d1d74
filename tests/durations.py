# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each test costs: shown at the end of a run, and kept in out/ for who makes them faster, and for ``--quick``.

The measure is CPU time, of the process and of those it waited for: beside other work, the clock says little. Nothing
is asserted about it.
"""

from __future__ import annotations

import json
import os
import sys
from collections import defaultdict
from collections.abc import Generator
from pathlib import Path

import pytest

#: Of so many tests of a run the cost is shown.
SHOWN = 10
#: CPU seconds that a test may have taken to be one of the quick ones: these are most, and take a minute together.
QUICK = 0.06


def draws_with_eevee(test: str) -> bool:
    """Whether a test says by its name that EEVEE draws in it."""
    return "eevee" in test.lower()


def cpu_s() -> float:
    """Seconds of processors so far, of this process and of those it waited for."""
    return sum(os.times()[:4])


class Durations:
    """A plugin of pytest: CPU seconds of each test, its fixtures included.

    folder : where they are kept, for each version of Python, as Blender's follows from that.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / f"durations-{sys.version_info.major}.{sys.version_info.minor}.json"
        self.seconds: dict[str, float] = defaultdict(float)
        self._last = cpu_s()

    def kept(self) -> dict[str, float]:
        """Those of earlier runs; of tests that their files do not have any more as well."""
        return json.loads(self.path.read_text(encoding="utf-8")) if self.path.is_file() else {}

    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Files that took longest the last time begin, so that no process is left alone with one of them at the end.

        Before them comes what EEVEE draws, which one process does, see tests/schedule.py. A quick run leaves out what
        took long; what nobody has run yet is run.
        """
        kept, files = self.kept(), defaultdict(float)
        for name, seconds in kept.items():
            files[name.split("::")[0]] += seconds
        # Those of a file stay together: sorts are stable.
        items.sort(key=lambda item: (not draws_with_eevee(item.nodeid), -files[item.nodeid.split("::")[0]]))
        if not config.getoption("quick"):
            return
        slow = {name for name, seconds in kept.items() if seconds > QUICK}
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in slow])
        items[:] = [item for item in items if item.nodeid not in slow]

    def pytest_runtest_logstart(self) -> None:
        """Begin to count: collecting is nobody's."""
        self._last = cpu_s()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Mark a report with what it cost; reports travel from the processes of xdist with all they carry."""
        report = yield
        now = cpu_s()
        report.cpu_seconds, self._last = now - self._last, now
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add up preparing, calling and tidying."""
        self.seconds[report.nodeid] += getattr(report, "cpu_seconds", 0.0)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Show the slowest, where there are many, and keep all."""
        if "PYTEST_XDIST_WORKER" in os.environ or not self.seconds:
            return
        slowest = sorted(self.seconds.items(), key=lambda item: -item[1])
        if len(slowest) > SHOWN:
            total = sum(self.seconds.values())
            terminalreporter.section(f"{total:.0f} CPU seconds in {len(slowest)} tests, most of them in", sep="-")
            for name, seconds in slowest[:SHOWN]:
                terminalreporter.line(f"{seconds:7.1f}  {name}")
            terminalreporter.line(f"all of them: {self.path}")
        known = self.kept() | {name: round(seconds, 3) for name, seconds in slowest}
        root = self.path.parent.parent
        known = {name: seconds for name, seconds in known.items() if (root / name.split("::")[0]).exists()}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        new = self.path.with_suffix(f".{os.getpid()}")  # two runs may end at once
        new.write_text(json.dumps(known, indent=1), encoding="utf-8")
        new.replace(self.path)
