# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the paper's figures and tables: ``python -m examples.paper [FIGURE ...]`` (``make results`` makes all).

Without names it makes what this commit has not made yet, so that it goes on where it was stopped. Each figure is made
in a process of its own. Images go to docs/images, tables into docs/results.md, their records to docs/results/paper,
single images and the frames of the animation to out/paper.
"""

from __future__ import annotations

import argparse
import importlib
import json
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.report import head, report
from devtools import session

ROOT = Path(__file__).resolve().parents[2]
OUT, IMAGES, PAGE = ROOT / "out" / "paper", ROOT / "docs" / "images", ROOT / "docs" / "results.md"
RECORDS = ROOT / "docs" / "results" / "paper"

#: Modules by the name that the command line knows them by, and what they make.
FIGURES = {
    "figure4": "the catalog of plants",
    "figure5": "the partition of the row of eighty from above",
    "figure6": "the row of eighty, its polygons stored (figure 6) and deferred to the render (figure 7)",
    "figure8": "the states of refinement, pass by pass",
    "figure9": "the landscape of 8,636 plants in haze",
    "animation": "a film of a walk past the row (section 8.2)",
}


def say(text: str) -> None:
    """Progress, at once even when the output is a file."""
    print(f"[{time.strftime('%H:%M:%S')}] {text}", flush=True)


def make(name: str) -> None:
    """Make one figure in this process, and write its record."""
    session.start()
    OUT.mkdir(parents=True, exist_ok=True)
    IMAGES.mkdir(parents=True, exist_ok=True)
    RECORDS.mkdir(parents=True, exist_ok=True)
    _record(name).unlink(missing_ok=True)  # what is interrupted has not been made
    start = time.perf_counter()
    figures = importlib.import_module(f"{__package__}.{name}").make(OUT, IMAGES, small=False)
    figures["seconds"] = time.perf_counter() - start
    _record(name).write_text(json.dumps(report(name, figures, {}), indent=1) + "\n")


def is_made(name: str) -> bool:
    """Whether this commit has made a figure; images that it wrote into the repository do not count as a change."""
    return _record(name).exists() and json.loads(_record(name).read_text())["commit"].rstrip("+") == head()


def _record(name: str) -> Path:
    return RECORDS / f"{name}.json"


def main() -> int:
    """Command line; exit code 1 when a figure could not be made."""
    parser = argparse.ArgumentParser(
        prog="python -m examples.paper",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="\n".join(f"{name:10s} {what}" for name, what in FIGURES.items()) + "\ntables     docs/results.md",
    )
    parser.add_argument("names", nargs="*", metavar="FIGURE", help="by default all that are missing")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    names = ["figure6" if name == "figure7" else name for name in arguments.names]
    for name in set(names) - {*FIGURES, "tables"}:
        parser.error(f"there is no {name!r}; known are {', '.join(FIGURES)} and tables")
    if arguments.here:
        make(*names)
        return 0
    wanted = [n for n in names if n in FIGURES] if names else [n for n in FIGURES if not is_made(n)]
    failed = []
    for number, name in enumerate(wanted, start=1):
        say(f"{number} of {len(wanted)}: {name}, {FIGURES[name]}")
        command = [sys.executable, "-m", __package__, name, "--here"]
        with open(_log(name), "w") as log:
            code = subprocess.run(command, check=False, cwd=ROOT, stdout=log, stderr=subprocess.STDOUT).returncode
        if code:
            failed.append(name)
            say(f"{name} could not be made; {_log(name).relative_to(ROOT)} says why")
        else:
            say(f"made in {json.loads(_record(name).read_text())['figures']['seconds']:.0f} s")
    if not failed:
        from .tables import write_tables

        write_tables(RECORDS, PAGE)
        say(f"Pictures are in {IMAGES.relative_to(ROOT)}, tables in {PAGE.relative_to(ROOT)}, the rest in out/paper")
    return 1 if failed else 0


def _log(name: str) -> Path:
    OUT.mkdir(parents=True, exist_ok=True)
    return OUT / f"{name}.log"


if __name__ == "__main__":
    sys.exit(main())
