# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Command line of the benchmarks; exit code 0 when every target holds, 1 when one does not."""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from pathlib import Path

from devtools import session

#: Benchmarks by name, in the order of ``all``.
NAMES = (
    "row80",
    "forms",
    "plants",
    "bounds",
    "averages",
    "looks",
    "tetrahedra",
    "landscape",
    "growth",
    "budget",
    "stages",
    "foreign",
)


def main() -> int:
    """Run the benchmarks that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("name", choices=(*NAMES, "all"))
    parser.add_argument("--quick", action="store_true", help="smaller pictures and fewer samples, about a minute each")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write the record here (a list for all)")
    arguments = parser.parse_args()
    session.start()
    from .report import missed, report, table  # after the session has prepared Blender

    records = []
    for name in NAMES if arguments.name == "all" else (arguments.name,):
        module = importlib.import_module(f"{__package__}.{name}")
        session.clean_file()
        record = report(name, module.run(arguments.quick), module.QUICK_TARGETS if arguments.quick else module.TARGETS)
        records.append(record)
        print(table(record), flush=True)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(records[0] if len(records) == 1 else records, indent=1) + "\n")
    failures = [f"{r['name']}: {text}" for r in records for text in missed(r)]
    for text in failures:
        print("missed:", text, file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
