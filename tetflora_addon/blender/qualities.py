# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Qualities: names for sets of values; which one the settings have is read from the values themselves."""

import bpy

from ..refinement.settings import QUALITIES


def quality_number(group: bpy.types.PropertyGroup) -> int:
    """Index of the quality whose values the settings have; the last one is that of others."""
    for number, values in enumerate(QUALITIES.values()):
        if all(abs(getattr(group, name) - value) < 1e-6 * max(value, 1) for name, value in values.items()):
            return number
    return len(QUALITIES)


def set_quality(group: bpy.types.PropertyGroup, number: int) -> None:
    """Give the settings the values of a quality; beyond the last one they stay as they are."""
    for name, value in list(QUALITIES.values())[number].items() if number < len(QUALITIES) else ():
        setattr(group, name, value)
