# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The catalog as an asset library for Blender's asset browser: ``python -m examples.asset_library --out FOLDER``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from devtools import session


def main() -> int:
    """Write the library."""
    parser = argparse.ArgumentParser(prog="python -m examples.asset_library", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out") / "assets", help="folder of the library")
    options = parser.parse_args()
    session.start()
    from tetflora_addon.blender.placing import assets

    session.clean_file()
    path, number = assets.write_asset_library(options.out.absolute())
    print(f"{path}: {number} plants, {path.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
