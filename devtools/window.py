# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a full Blender in a real window on a screen of its own, drive it by a script, and take pictures of the screen.

The screen is a virtual one (Xvfb). Inside Blender, devtools/window_driver.py runs the script's steps. Pictures are
taken from here, because Blender's own screenshot is black under software OpenGL: the driver leaves a request in the
output folder, this side answers it with ImageMagick's ``import``.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

DRIVER = Path(__file__).with_name("window_driver.py")
SIZE = (1600, 1000)


def missing_tools() -> list[str]:
    """Programs that a window needs and that this machine does not have."""
    return [tool for tool in ("Xvfb", "import") if shutil.which(tool) is None]


@contextmanager
def screen() -> Iterator[str]:
    """A virtual screen; gives the name of its display, for instance ``":3"``."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{SIZE[0]}x{SIZE[1]}x24", "+extension", "GLX"]
    server = subprocess.Popen(command, pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as answer:
            number = answer.readline().strip()
        if not number:
            raise RuntimeError("Xvfb could not open a screen")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait(timeout=10)


def _answer(folders: list[Path], environment: dict[str, str]) -> None:
    for request in (path for folder in folders for path in folder.glob("*.request")):
        picture = request.with_suffix(".png")
        subprocess.run(["import", "-window", "root", str(picture)], env=environment, check=False, timeout=60)
        request.unlink()


def run_in_window(
    blender: str, script_path: Path, out_dir: Path, timeout: float = 180.0, resources: Path | None = None
) -> dict:
    """Run one script; see `run_scripts`."""
    return run_scripts(blender, {script_path: out_dir}, timeout, resources)[0]


def run_scripts(blender: str, scripts: dict[Path, Path], timeout: float, resources: Path | None = None) -> list[dict]:
    """Open Blender's window, run scripts in it, close it.

    Parameters
    ----------
    blender : str
        The executable of a full Blender.
    scripts : dict of Path to Path
        Python files with a generator function ``steps(ui)``; see devtools/window_driver.py for what ``ui`` does. For
        each a folder, which receives ``result.json`` and a ``<name>.png`` for each picture; the first ``blender.log``.
    timeout : float
        Seconds after which Blender is ended.
    resources : Path, optional
        Folder of preferences and extensions (``BLENDER_USER_RESOURCES``), with TetFlora installed or not. An empty one
        by default.

    Returns
    -------
    list of dict
        Of each ``{"ok": bool, "error": str or None, "values": dict, "pictures": [str]}``; ``ok`` is false when the
        script raised, when Blender ended early, or when time was up.
    """
    folders = list(scripts.values())
    for folder in folders:
        folder.mkdir(parents=True, exist_ok=True)
        for old in [*folder.glob("*.request"), folder / "result.json"]:
            old.unlink(missing_ok=True)
    log_path = folders[0] / "blender.log"
    with tempfile.TemporaryDirectory(prefix="tetflora-window-") as empty, screen() as display:
        environment = {**os.environ, "DISPLAY": display, "BLENDER_USER_RESOURCES": str(resources or empty)}
        # Otherwise Blender would open on the developer's own Wayland screen.
        environment.pop("WAYLAND_DISPLAY", None)
        environment["LIBGL_ALWAYS_SOFTWARE"] = "1"  # a virtual screen has no graphics card
        command = [blender, "--gpu-backend", "opengl", "-p", "0", "0", *map(str, SIZE), "--enable-event-simulate"]
        command += ["--python-exit-code", "1"]  # if the driver cannot be opened
        command += ["-P", str(DRIVER), "--", *(str(path.resolve()) for pair in scripts.items() for path in pair)]
        with log_path.open("w") as log:
            process = subprocess.Popen(
                command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
            )
            end = time.monotonic() + timeout
            while process.poll() is None and time.monotonic() < end:
                _answer(folders, environment)
                time.sleep(0.1)
            late = process.poll() is None
            if late:
                _end_group(process)
    ended = f"was still busy after {timeout:g} s" if late else f"ended (code {process.returncode}) before the script"
    return [_result(folder, f"Blender {ended}; see {log_path}") for folder in folders]


def _result(folder: Path, otherwise: str) -> dict:
    result = {"ok": False, "error": otherwise, "values": {}}
    if (folder / "result.json").exists():
        result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    return {**result, "pictures": sorted(path.name for path in folder.glob("*.png"))}


def _end_group(process: subprocess.Popen) -> None:
    # The executable may be a wrapper: its session holds Blender too, and nothing else.
    with suppress(ProcessLookupError):
        os.killpg(process.pid, 15)
    try:
        process.wait(timeout=10)
    except subprocess.TimeoutExpired:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, 9)
        process.wait(timeout=10)
