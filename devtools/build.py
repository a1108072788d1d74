# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the extension's zip with Blender's own tool: ``python -m devtools.build [FOLDER]`` (default ``dist``).

The manifest is validated against Blender's list of tags first, and the zip that came out is validated once more.
Neither step starts Blender: its extension tool, part of the bpy wheel, is a separate script.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def manifest() -> dict:
    """The extension's manifest."""
    return tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))


def _bundled(pattern: str) -> Path:
    spec = importlib.util.find_spec("bpy")
    if spec is None or spec.origin is None:
        raise FileNotFoundError("This Python has no bpy; `make build` uses one that has.")
    found = sorted(Path(spec.origin).parent.glob(pattern))
    if not found:
        raise FileNotFoundError(f"The bpy wheel in {Path(spec.origin).parent} holds no {pattern}.")
    return found[0]


def _tool(*arguments: str | Path) -> None:
    script = _bundled("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    done = subprocess.run([sys.executable, script, *arguments], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"`extension {arguments[0]}` failed:\n{done.stdout}{done.stderr}".rstrip())


def validate(target: Path) -> None:
    """Check a source tree or a zip as Blender's extensions platform does.

    Raises
    ------
    RuntimeError
        It is not valid; the message is that of Blender's tool.
    """
    tags = _bundled("*/scripts/modules/_bpy_internal/extensions/tags.py")
    _tool("validate", f"--valid-tags={tags}", target)


def build(folder: Path) -> Path:
    """Validate the source tree, build the zip into ``folder`` and validate that.

    Returns
    -------
    Path
        The zip, ``tetflora-<version>.zip``; one of the same name is replaced.

    Raises
    ------
    RuntimeError
        Blender's tool reported an error, which is the message.
    """
    folder.mkdir(parents=True, exist_ok=True)
    about = manifest()
    target = folder.resolve() / f"{about['id']}-{about['version']}.zip"
    target.unlink(missing_ok=True)
    validate(ROOT)
    _tool("build", "--source-dir", ROOT, "--output-filepath", target)
    validate(target)
    return target


def main(arguments: list[str]) -> int:
    """Build and say where the zip is; the exit code."""
    try:
        target = build(Path(arguments[0] if arguments else ROOT / "dist"))
    except (RuntimeError, FileNotFoundError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{target} ({target.stat().st_size / 1024:.0f} KiB)")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
