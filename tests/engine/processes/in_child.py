# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests let other processes do."""

from __future__ import annotations

import os
import signal
import sys
import time


def after_a_while(seconds: float, item: object) -> object:
    """The item, after some seconds."""
    time.sleep(seconds)
    return item


def dies(survivor: int, item: object) -> object:
    """The item, in the one process that survives this."""
    if os.getpid() != survivor:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def surroundings(_shared: object, _item: object) -> tuple[list[str], bool, str]:
    """Paths for imports, whether bytecode is written, and where the process was started from."""
    return sys.path, not sys.dont_write_bytecode, sys.argv[0]
