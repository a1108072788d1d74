# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the environments that development needs.

    python -m devtools.environment .venv                       with the version of the Python that runs this
    python -m devtools.environment --inside BLENDER FOLDER     a folder of packages for tests/run.py in a full Blender

Runs in a plain Python. What goes in is the group ``dev`` of pyproject.toml, or for a full Blender, which brings its
own numpy, only what runs tests. A stamp remembers what was installed, so that a second call does nothing.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
INSIDE = ("pytest", "hypothesis")


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


def make_inside(blender: str, folder: Path) -> None:
    """Put what runs tests into ``folder``, built for the Python of a full Blender, whichever that is.

    Raises
    ------
    subprocess.CalledProcessError
        Blender did not start, or pip has nothing for its Python; the message is on stderr.
    """
    ask = "import sys; print('python is', '%d.%d' % sys.version_info[:2])"
    command = [blender, "-b", "--factory-startup", "--python-expr", ask]
    output = subprocess.run(command, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True).stdout
    version = next(line.split()[-1] for line in output.splitlines() if line.startswith("python is"))
    stamp = folder / ".ready"
    wanted = " ".join([version, *INSIDE])
    if stamp.exists() and stamp.read_text(encoding="utf-8") == wanted:
        return
    shutil.rmtree(folder, ignore_errors=True)
    options = ["--quiet", "--target", folder, "--python-version", version, "--only-binary=:all:"]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, *INSIDE], check=True)
    stamp.write_text(wanted, encoding="utf-8")


def main(arguments: list[str]) -> int:
    """Make what the arguments name; the exit code."""
    try:
        if arguments[:1] == ["--inside"]:
            make_inside(arguments[1], Path(arguments[2]))
        else:
            make(Path(arguments[0] if arguments else ".venv"))
    except subprocess.CalledProcessError as error:
        print(f"The environment is incomplete: {error.cmd[0]} ended with code {error.returncode}.", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
