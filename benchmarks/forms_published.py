# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shipped species against published figures: height, trunk, crown and leaves, each with its range and source.

``devtools.forms`` measures the plants, ``tests/data/published.json`` keeps the figures.
"""

from __future__ import annotations

from devtools import forms

from .report import Targets

TARGETS: Targets = {"out_of_range": {"max": 0}}


def run(quick: bool) -> dict[str, object]:
    """Measure all species; ``table`` has a row for each figure: species, habit, figure, unit, range, source, value."""
    rows = [row for identifier in forms.species() for row in forms.compared(identifier)]
    return {
        "species": len({row.species for row in rows}),
        "figures": len(rows),
        "out_of_range": sum(not row.within for row in rows),
        "table": [
            {
                "species": row.species,
                "habit": row.habit,
                "figure": row.figure,
                "unit": forms.FIGURES[row.figure][1],
                "low": round(row.low, 4),
                "high": round(row.high, 4),
                "source": row.source,
                "measured": round(row.value, 4),
            }
            for row in rows
        ],
    }
