# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Questions that are measured: ``python -m benchmarks NAME [--quick] [--json PATH]``, or ``all`` of them.

Exit code 0 when every target holds, 1 when one does not. ``python -m benchmarks NAME --help`` tells what else a
benchmark can be asked for.
"""

from __future__ import annotations

import argparse
import importlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from devtools import session

#: Benchmarks in the order of ``all``: where docs have their answers of today, and what they ask.
NAMES = {
    "exact": (
        "measurements.md#a-forest-beside-its-truth",
        "Does a wood look like the same plants expanded, and what does it cost?",
    ),
    "forest": ("measurements.md#a-real-forest-at-full-hd", "Seconds and memory of woods at full HD, beside instances"),
    "fidelity": (
        "measurements.md#how-close-proxies-are-to-the-plants",
        "How far are proxies from plants, by height, light and form?",
    ),
    "rami": ("measurements.md#a-referee-from-outside", "Do canopies reflect as much light as is published?"),
    "assets": ("measurements.md#assets-that-others-scatter", "Are other people's trees as they were, and faster?"),
    "year": ("measurements.md#the-year-and-ages", "Does the year go by without jumps, and at what cost?"),
    "animation": ("measurements.md#later-frames-of-an-animation", "What does a later frame of an animation cost?"),
    "dolly": ("measurements.md#plants-up-close", "Does anything jump from 400 m to a leaf?"),
    "stands": ("measurements.md#forests-that-grew", "Do stands grow as in nature?"),
    "places": ("measurements.md#forests-that-grew", "Do real places arrive as they are?"),
    "forms_published": ("species.md#shipped-species-against-published-figures", "Are trees as they are published?"),
    "leaf_area": ("measurements.md#leaf-area", "Have trees as many leaves as is measured, and as take their light?"),
    "light_inside": ("measurements.md#light-inside-woods", "Is it as dark inside woods as is measured?"),
    "cover_published": ("measurements.md#plants-up-close", "Does a birch stand cover as much ground as is published?"),
    "export": ("measurements.md#out-of-blender", "Do a million plants come back, and are levels like their plants?"),
    "shapes": (
        "measurements.md#light-shapes-in-the-window",
        "Do light shapes follow the artist, a million of them too?",
    ),
    "endurance": ("measurements.md#two-hundred-frames", "Does memory or time grow over many frames?"),
    "estimates": ("measurements.md#what-refining-will-take", "Does refining take what the panel says?"),
    "limits": ("measurements.md#the-limit-of-memory", "What is refused rather than tried?"),
    "attack": ("measurements.md#an-attack", "Does anything break, write elsewhere, or take long?"),
}


def main() -> int:
    """Run the benchmark that the command line names."""
    width = max(map(len, NAMES))
    listed = "\n".join(f"  {name:{width}}  {question}" for name, (_, question) in NAMES.items())
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=f"{__doc__}\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("name", choices=(*NAMES, "all"), metavar="NAME")
    parser.add_argument("--quick", action="store_true", help="smaller pictures and fewer samples, about a minute each")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write the record here (a list for all)")
    call = {"nargs": 2, "metavar": ("FUNCTION", "JSON"), "help": "print what one of its functions makes of a list"}
    parser.add_argument("--call", **call)
    name = next((word for word in sys.argv[1:2] if word in NAMES), "")
    if not name:
        return _each_in_its_own_process(parser.parse_args())
    session.start()
    session.clean_file()
    from .report import missed, report, table, write  # after the session has prepared Blender

    module = importlib.import_module(f"{__package__}.{name}")
    own = hasattr(module, "options")
    if own:
        parser.description = module.__doc__
        module.options(parser)
    given = parser.parse_args()
    if given.call:
        function, words = given.call
        print(json.dumps(getattr(module, function)(*json.loads(words))), flush=True)
        return 0
    figures = module.run(given) if own else module.run(given.quick)
    if figures is None:  # a part of it, which has said what it found
        return 0
    record = report(name, figures, getattr(module, "QUICK_TARGETS", module.TARGETS) if given.quick else module.TARGETS)
    print(table(record), flush=True)
    write(given.json, record)
    failures = missed(record)
    for text in failures:
        print(f"missed: {name}: {text}", file=sys.stderr)
    return 1 if failures else 0


def _each_in_its_own_process(given: argparse.Namespace) -> int:
    """Run all, so that the memory of one is not that of those before it; their records as a list."""
    from .report import write

    records, code = [], 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.json"
        for name in NAMES:
            quick = ["--quick"] if given.quick else []
            command = [sys.executable, "-m", __package__, name, "--json", str(path), *quick]
            code = max(code, subprocess.run(command, check=False).returncode)
            if path.exists():
                records.append(json.loads(path.read_text()))
                path.unlink()
    write(given.json, records)
    return code


if __name__ == "__main__":
    sys.exit(main())
