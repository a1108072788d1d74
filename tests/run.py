# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run pytest inside a full Blender: ``blender -b --factory-startup -P tests/run.py -- ARGUMENTS OF PYTEST``.

pytest comes from the folder that ``TETFLORA_SITE`` names, made by ``python -m devtools.environment --inside BLENDER
FOLDER``. It is searched last, so that numpy and all else that Blender brings is Blender's own.
"""

from __future__ import annotations

import os
import sys
import traceback
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def main() -> int:
    """Run what stands behind ``--``; pytest's exit code."""
    site = os.environ.get("TETFLORA_SITE")
    if site:
        sys.path.append(site)
    os.chdir(ROOT)
    sys.dont_write_bytecode = True
    import pytest

    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    return int(pytest.main(["-p", "no:cacheprovider", *arguments]))


if __name__ == "__main__":
    try:
        code = main()
    except BaseException:
        traceback.print_exc()
        code = 3
    sys.stdout.flush()
    sys.stderr.flush()
    # sys.exit() is reported, but does not become Blender's exit code in every version.
    os._exit(code)
