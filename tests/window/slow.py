# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A loop of refinement that takes its time, or it would be over before a key comes."""

import time


def slowly(original, *given):
    """The loop, with a pause after each pass."""
    passes, enough = original(*given), None
    while True:
        try:
            state = passes.send(enough)
        except StopIteration as stop:
            return stop.value
        time.sleep(0.5)
        enough = yield state
