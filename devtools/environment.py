# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the virtual environment that development needs: ``python -m devtools.environment .venv``.

Runs in a plain Python, with the version that the environment shall have. What goes in is the group ``dev`` of
pyproject.toml. A stamp remembers what was installed, so that a second call does nothing.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def requirements() -> list[str]:
    """Requirements of development, as pyproject.toml lists them."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]["dev"]


def make(folder: Path) -> None:
    """Make or complete the environment in ``folder``.

    Raises
    ------
    subprocess.CalledProcessError
        pip could not install something; its own message is on stderr.
    """
    stamp = folder / ".ready"
    wanted = "\n".join([f"python {sys.version.split()[0]} {sys.base_prefix}", *requirements()]) + "\n"
    if stamp.exists() and stamp.read_text(encoding="utf-8") == wanted:
        stamp.touch()
        return
    present = stamp.read_text(encoding="utf-8").splitlines()[:1] if stamp.exists() else []
    stamp.unlink(missing_ok=True)
    if present != wanted.splitlines()[:1]:
        print(f"Making {folder} with Python {sys.version.split()[0]}", flush=True)
        venv.create(folder, with_pip=True, clear=True)
    print("Installing what development needs; Blender's wheel alone is some 300 MB", flush=True)
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", *requirements()], check=True)
    stamp.write_text(wanted, encoding="utf-8")


def main(arguments: list[str]) -> int:
    """Make the environment in the folder that the first argument names; the exit code."""
    try:
        make(Path(arguments[0] if arguments else ".venv"))
    except subprocess.CalledProcessError as error:
        print(f"The environment is incomplete: pip ended with exit code {error.returncode}.", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
