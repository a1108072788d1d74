# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Command line of the benchmarks; exit code 0 when every target holds, 1 when one does not."""

from __future__ import annotations

import argparse
import importlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from devtools import session

#: Benchmarks by name, in the order of ``all``.
NAMES = (
    "row80",
    "time_to_picture",
    "plants",
    "bounds",
    "averages",
    "forms_published",
    "cover_published",
    "extinction",
    "looks",
    "leaf_looks",
    "leaf_instances",
    "tetrahedra",
    "landscape",
    "scaling",
    "instances",
    "growth",
    "budget",
    "stages",
    "forest",
    "curves",
    "foreign",
    "assets",
    "closed_form",
    "edited_species",
    "exact",
    "fidelity",
    "rami",
    "above",
    "populate",
    "viewport",
    "blocks",
    "animation",
    "wind",
    "year",
    "stands",
    "places",
    "biomes",
    "dolly",
    "endurance",
    "limits",
    "farm",
    "attack",
)
#: Modules that are not called as their benchmark.
MODULES = {"curves": "forest_curves"}


def main() -> int:
    """Run the benchmarks that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("name", choices=(*NAMES, "all"))
    parser.add_argument("--quick", action="store_true", help="smaller pictures and fewer samples, about a minute each")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write the record here (a list for all)")
    arguments = parser.parse_args()
    if arguments.name == "all":
        return _each_in_its_own_process(arguments)
    session.start()
    from .report import missed, report, table  # after the session has prepared Blender

    module = importlib.import_module(f"{__package__}.{MODULES.get(arguments.name, arguments.name)}")
    session.clean_file()
    targets = module.QUICK_TARGETS if arguments.quick else module.TARGETS
    record = report(arguments.name, module.run(arguments.quick), targets)
    print(table(record), flush=True)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(record, indent=1) + "\n")
    failures = [f"{arguments.name}: {text}" for text in missed(record)]
    for text in failures:
        print("missed:", text, file=sys.stderr)
    return 1 if failures else 0


def _each_in_its_own_process(arguments: argparse.Namespace) -> int:
    """Run all, so that the memory of one is not that of those before it; their records as a list."""
    records, code = [], 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.json"
        for name in NAMES:
            quick = ["--quick"] if arguments.quick else []
            command = [sys.executable, "-m", __package__, name, "--json", str(path), *quick]
            code = max(code, subprocess.run(command, check=False).returncode)
            if path.exists():
                records.append(json.loads(path.read_text()))
                path.unlink()
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(records, indent=1) + "\n")
    return code


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
