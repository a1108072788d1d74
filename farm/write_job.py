# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the open file as a job for a render farm (Open Job Description), see docs/farm.md.

    blender --background FILE --python farm/write_job.py -- OUT_DIR [options]

Exit codes and statistics are those of ``--command tetflora``, but Blender may print a line of its own after these.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import bpy

if __package__:
    from .bundle import LIMIT_GB, write_bundle
    from .extension import command
else:  # Blender runs it as a script
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    from farm.bundle import LIMIT_GB, write_bundle
    from farm.extension import command

#: Warnings of a kind that are printed one by one.
_WARNINGS = 20


def main(arguments: Sequence[str]) -> int:
    """Write a job with what follows ``--``; returns the exit code."""
    return command.run(_parser(), arguments)


def _parser() -> argparse.ArgumentParser:
    parser = command.Parser(
        prog="blender --background FILE --python farm/write_job.py --",
        description="Write a job for a render farm (Open Job Description).",
    )
    parser.add_argument("folder", type=Path, metavar="OUT_DIR", help="new or empty folder for the job")
    parser.add_argument(
        "--chunk", type=command.whole, default=1, metavar="N", help="frames that a worker renders per task"
    )
    parser.add_argument(
        "--frames", type=command.frames, metavar="A-B", help="frames of the job (default: those of the scene)"
    )
    parser.add_argument("--copy", action="store_true", help="copy the file and its assets into the job")
    about = "include files that lie outside the folder of the .blend"
    parser.add_argument("--outside", action="store_true", help=about)
    about = "refuse a job whose files are larger together (default: %(default)g)"
    parser.add_argument("--max-size", type=command.positive, default=LIMIT_GB, metavar="GB", help=about)
    parser.set_defaults(run=_write)
    parser.add_argument("--json", action="store_true", help="print statistics as a JSON object in one line")
    return parser


def _write(options: argparse.Namespace) -> dict:
    written = write_bundle(
        bpy.context.scene,
        options.folder,
        options.chunk,
        options.frames,
        options.copy,
        options.outside,
        options.max_size * 1e9,
        lambda text: print(text, flush=True),
    )
    for key, what, remedy in (
        ("missing", "missing file", ""),
        ("skipped", "not a file that Blender reads, so not in the job", ""),
        (
            "absolute_paths",
            "absolute path",
            "; use File > External Data > Make Paths Relative if other machines cannot access it",
        ),
    ):
        for number, path in enumerate(written[key]):
            if number == _WARNINGS:
                print(f"tetflora: warning: {what}: {len(written[key]) - number:,} more", file=sys.stderr, flush=True)
                break
            print(f"tetflora: warning: {what}: {path}{remedy}", file=sys.stderr, flush=True)
    return written


if __name__ == "__main__":
    sys.exit(main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []))
