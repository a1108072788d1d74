# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A real forest at full HD: seconds, memory and image of what an artist tries first.

    python -m benchmarks forest [--quick]          # everything, with targets
    python -m benchmarks.forest birch --no-render  # one case, as a line of JSON
    python -m benchmarks.forest mix --size 480x270 --side 50 --samples 2

A case is a species, ``mix`` (five species, 5 m apart) or ``eye`` (inside a wood of five species). Each is measured in a
process of its own, so that the largest memory is its own.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

from devtools import session


def one(arguments: argparse.Namespace) -> dict:
    """Measure one case in this process."""
    import tempfile

    import bpy

    from . import forest_case, forest_scene

    case = forest_scene.case_of(arguments.case)
    changes = {"asked": arguments.plants, "side": arguments.side}
    case = replace(case, **{name: value for name, value in changes.items() if value})
    scene = bpy.context.scene
    figures = {"case": arguments.case, "planted": forest_scene.build(scene, case, arguments.size)}
    for name, value in arguments.set:
        kind = type(getattr(scene.tetflora, name))
        setattr(scene.tetflora, name, value == "True" if kind is bool else kind(value))
    figures |= forest_case.refined(scene)
    if not arguments.no_render:
        with tempfile.TemporaryDirectory() as folder:
            figures |= forest_case.rendered(scene, Path(folder), arguments.samples)
    return figures


def _size(text: str) -> tuple[int, int]:
    width, height = text.lower().split("x")
    return int(width), int(height)


def _setting(text: str) -> tuple[str, str]:
    name, value = text.split("=")
    return name, value


def main() -> int:
    """Measure one case and print a line of JSON."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.forest", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", help="a species, mix or eye")
    parser.add_argument("--plants", type=int, help="plants that Populate is asked for, by default 100,000")
    parser.add_argument(
        "--side", type=float, help="of the ground, by default 300 m: a smaller wood of the same density"
    )
    parser.add_argument("--size", type=_size, default=(1920, 1080), metavar="WxH")
    parser.add_argument(
        "--set", type=_setting, nargs="+", default=[], metavar="NAME=VALUE", help="settings of the scene"
    )
    parser.add_argument("--no-render", action="store_true")
    parser.add_argument("--samples", type=int, default=4, help="of the image that is timed, beside one with one sample")
    arguments = parser.parse_args()
    session.start()
    session.clean_file()
    figures = one(arguments)
    print(json.dumps(figures), flush=True)
    return 0


if __name__ == "__main__":
    code = main()
    session.stop()
    sys.exit(code)
