# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors that a user can cause; their message names the thing and says what to do next.

What they name comes from files of anybody: texts are made `readable`, and values `quoted`, before they are told.
"""

import re
from collections.abc import Sequence
from typing import Any

#: Most characters of a message, of a name in menus, and of a value within a message.
MESSAGE, NAME, VALUE = 2000, 100, 60
_NAMED = 3  # things that a message names before it only counts

#: Control characters, marks that turn the direction of writing, and halves of surrogate pairs.
_UNREADABLE = re.compile("[\0-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufeff]+")


def readable(text: str, most: int = MESSAGE) -> str:
    """A text that every window and terminal can show: on one line, without control characters, not too long."""
    text = _UNREADABLE.sub(" ", text[: 2 * most])
    return text if len(text) <= most else text[: most - 3] + "..."


def quoted(value: Any) -> str:
    """A value of a file, as messages quote it."""
    try:
        text = repr(value[: 2 * VALUE] if isinstance(value, str) else value)
    except (RecursionError, ValueError):  # nested too deep, or an integer of thousands of digits
        return f"a {type(value).__name__} too large to show"
    return readable(text, VALUE)


def listed(names: Sequence[str]) -> str:
    """The first names, quoted, and how many more there are."""
    text = ", ".join(f'"{name}"' for name in names[:_NAMED])
    return text if len(names) <= _NAMED else f"{text} and {len(names) - _NAMED:,} more"


class TetFloraError(Exception):
    """Something the user gave or asked for cannot be used as it is."""

    def __init__(self, message: object = "") -> None:
        super().__init__(readable(str(message)))


class SpeciesError(TetFloraError):
    """A species file or leaf model is broken or unknown."""


class UnansweredError(TetFloraError):
    """Blender's window did not answer what another thread asked for."""


class SceneError(TetFloraError):
    """The scene lacks something that refinement needs, or holds something that it cannot use."""
