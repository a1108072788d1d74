# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of a species file: what they may be, and complaints that name the file and the key."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from ..errors import NAME, SpeciesError, readable, shown
from .species import Colour, Range


class FileReader:
    """Reads values of one file; every complaint, a `SpeciesError`, names it and the key."""

    def __init__(self, source: str) -> None:
        self.source = source

    def fail(self, key: str, problem: str) -> SpeciesError:
        """The error for a problem with a key."""
        return SpeciesError(f"{self.source}: {key}: {problem}")

    def number(self, value: Any, key: str, low: float, high: float) -> float:
        """A number within limits."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(key, f"must be a number from {low:g} to {high:g}, not {shown(value)}")
        if not low <= value <= high:  # false for NaN as well
            raise self.fail(key, f"must be from {low:g} to {high:g}, not {shown(value)}")
        return float(value)

    def range(self, value: Any, key: str, low: float, high: float) -> Range:
        """A range: a mean alone, or with a variation."""
        if isinstance(value, int | float) and not isinstance(value, bool):
            return Range(self.number(value, key, low, high))
        if not isinstance(value, list) or len(value) != 2:
            raise self.fail(key, f"must be [mean, variation] within {low:g} to {high:g}, not {shown(value)}")
        mean = self.number(value[0], f"{key}[0] (mean)", low, high)
        variation = self.number(value[1], f"{key}[1] (variation)", 0, high - low)
        if mean - variation < low - 1e-12 or mean + variation > high + 1e-12:
            raise self.fail(
                key,
                f"mean ± variation is {mean - variation:g} to {mean + variation:g}, must be from {low:g} to {high:g}",
            )
        return Range(mean, variation)

    def colour(self, value: Any, key: str) -> Colour:
        """A colour with the variation of each channel."""
        form = "[[r, g, b], [variation of each]]"
        if not (
            isinstance(value, list) and len(value) == 2 and all(isinstance(v, list) and len(v) == 3 for v in value)
        ):
            raise self.fail(key, f"must be {form} with numbers from 0 to 1, not {shown(value)}")
        channels = [self.range([m, v], f"{key}.{c}", 0, 1) for m, v, c in zip(*value, "rgb", strict=True)]
        return Colour(tuple(c.mean for c in channels), tuple(c.variation for c in channels))

    def rgb(self, value: Any, key: str) -> tuple[float, float, float]:
        """A colour."""
        if not isinstance(value, list | tuple) or len(value) != 3:
            raise self.fail(key, f"must be [r, g, b] with numbers from 0 to 1, not {shown(value)}")
        return tuple(self.number(v, f"{key}.{c}", 0, 1) for v, c in zip(value, "rgb", strict=True))

    def truth(self, value: Any, key: str) -> bool:
        """True or false."""
        if not isinstance(value, bool):
            raise self.fail(key, f"must be true or false, not {shown(value)}")
        return value

    def choice(self, value: Any, key: str, choices: tuple[str, ...]) -> str:
        """One of a few names."""
        if value not in choices:
            raise self.fail(key, f"must be one of {', '.join(choices)}, not {shown(value)}")
        return value

    def keys(self, value: Any, key: str, allowed: Mapping[str, Any] | tuple[str, ...]) -> None:
        """Refuse what is no object, and keys that are not allowed."""
        if not isinstance(value, dict):
            raise self.fail(key, f"must be an object {{…}}, not {shown(value)}")
        for name in value:
            if name not in allowed:
                name = readable(name, NAME)
                near = get_close_matches(name.lower(), allowed, 1)
                meant = f'did you mean "{near[0]}"? Allowed' if near else "allowed"
                raise self.fail(f"{key}.{name}" if key else name, f"unknown key; {meant} keys: {', '.join(allowed)}")

    def text(self, value: Any, key: str, least: int = 1) -> str:
        """A text that people read."""
        text = readable(value) if isinstance(value, str) else ""
        if not isinstance(value, str) or len(text.strip()) < least or len(value) > 1000:
            raise self.fail(key, f"must be a string of {least} to 1000 characters, not {shown(value)}")
        return text
