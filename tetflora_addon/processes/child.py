# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs in each of the other Pythons: it calls functions of the engine that it is told to call.

It is started as a file, outside the package: ``python child.py PACKAGE PATHS``, where the package has the name that it
has in Blender, whatever that is, and the paths for imports are a list in JSON. It first says that it is there, or why
it cannot be. It ends with the one that started it, or when there has been nothing to do for a while.
"""

import importlib
import importlib.machinery
import importlib.util
import json
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

try:
    import resource
except ImportError:  # Windows
    resource = None

#: Seconds without work after which it gives memory back, and after which it ends.
PAUSE, IDLE = 1.0, 60.0


def engine(package: str) -> None:
    """Import the package that this file is in by a name; the packages around it, Blender's, stay empty."""
    *around, _ = package.split(".")
    for depth in range(len(around)):
        name = ".".join(around[: depth + 1])
        module = ModuleType(name)
        module.__path__ = []
        sys.modules[name] = module
    here = Path(__file__).resolve().parent.parent
    spec = importlib.util.spec_from_file_location(package, here / "__init__.py", submodule_search_locations=[str(here)])
    module = importlib.util.module_from_spec(spec)
    sys.modules[package] = module
    spec.loader.exec_module(module)


def peak() -> int:
    """Bytes that this process has held at most; 0 where the system does not tell."""
    if sys.platform == "linux":  # where the other call tells what the process that started this one had held
        for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    if resource is None:
        return 0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most * 1024


class _Clock:
    """Gives memory back, which takes time to get again, when there is a pause; ends the process after a longer one."""

    def __init__(self, give_back: Callable[[], None]) -> None:
        self.since = time.monotonic()
        self.busy = self.kept = False
        self._give_back = give_back
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        while self.busy or time.monotonic() - self.since < IDLE:
            time.sleep(PAUSE / 2.0)
            if self.kept and not self.busy and time.monotonic() - self.since > PAUSE:
                self.kept = False
                self._give_back()
        os._exit(0)


def main() -> None:
    """Answer messages until there are none."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is for the one who started this
    given, replies = os.fdopen(os.dup(0), "rb", 1 << 16), os.fdopen(os.dup(1), "wb", 1 << 16)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what prints is lost: this stream is for messages
    package, paths = sys.argv[1:]
    sys.path[:] = json.loads(paths)
    engine(package)
    messages = importlib.import_module(f"{package}.processes.messages")
    try:
        memory = importlib.import_module(f"{package}.memory")
        importlib.import_module("numpy")
    except Exception as error:
        messages.send(replies, ("failed", repr(error)))
        return
    messages.send(replies, ("ready", ""))
    shared: dict[int, object] = {}
    clock = _Clock(memory.give_back)
    while True:
        try:
            (kind, *rest) = messages.receive(given)
        except messages.Closed:
            return
        clock.busy = True
        if kind == "share":
            number, thing = rest
            shared[number] = thing
        elif kind == "forget":
            shared.pop(rest[0], None)
            clock.kept = True
        else:
            function, number, item = rest
            try:
                answer = messages.Packed(("made", function(shared[number], item), "", peak()))
            except BaseException as error:
                answer = messages.Packed(("failed", error, traceback.format_exc(), peak()))
            messages.send(replies, answer)
            del function, item, answer
        del rest
        clock.since, clock.busy = time.monotonic(), False


if __name__ == "__main__":
    main()
