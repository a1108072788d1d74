# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf area by day, and height and girth by age, against published curves."""

from __future__ import annotations


def run() -> dict[str, float]:
    """Measure."""
    return {}
