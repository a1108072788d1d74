# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions of frames: ``1-24``, ``7``, ``1-99:2``, or several with commas."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ...errors import VALUE, readable

#: First, last and step of frames.
Run = tuple[int, int, int]

#: Last frame in Blender.
LAST_FRAME = 1_048_574

_NUMBER = r"[0-9]{1,9}"  # what Python makes of more digits, or of others, is of no use
_RUN = re.compile(rf"(-?{_NUMBER})(?:-(-?{_NUMBER})(?::({_NUMBER}))?)?")
#: Frames of Blender, those below zero included.
_MOST_FRAMES = 2 * LAST_FRAME + 1


def frame_runs(text: str) -> list[Run]:
    """Read a range expression: ``1-10``, ``7``, ``1-99:2``, or several with commas.

    Parameters
    ----------
    text : str
        As in the specification (section 3.4.1.1.1), without negative steps.

    Returns
    -------
    list of tuple
        First, last and step, in the order of the text; the last is a frame of its run.

    Raises
    ------
    ValueError
        Another expression, a range that runs backwards, a frame that Blender does not have, or more frames than it has.
    """
    runs, number = [], 0
    quoted = readable(text, VALUE)
    for part in text.split(","):
        match = _RUN.fullmatch(part.strip())
        if match is None:
            raise ValueError(f"{quoted} is not a range of frames such as 1-24, 7 or 1-99:2")
        first = int(match[1])
        last = first if match[2] is None else int(match[2])
        step = int(match[3] or 1)
        if last < first or step < 1:
            raise ValueError(f"{quoted} is not a range of frames such as 1-24, 7 or 1-99:2")
        if max(-first, last) > LAST_FRAME:
            raise ValueError(f"{quoted} exceeds the last frame that Blender supports, {LAST_FRAME:,}")
        number += (last - first) // step + 1
        if number > _MOST_FRAMES:
            raise ValueError(f"{quoted} names frames again and again: Blender has only {_MOST_FRAMES:,}")
        runs.append((first, last - (last - first) % step, step))
    return runs


def frame_numbers(runs: Sequence[Run]) -> list[int]:
    """All frames of runs, repeated ones included."""
    return [frame for first, last, step in runs for frame in range(first, last + 1, step)]
