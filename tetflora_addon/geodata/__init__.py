# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real places: files of surveys and cities, coordinate systems, and trees seen from above.

Texts called ``what`` or ``where`` begin messages of a `SceneError`, which says what to do.
"""

from functools import cache
from typing import Any

from ..files import beside


@cache
def table(name: str) -> dict[str, Any]:
    """What a JSON file of this room holds."""
    return beside(__file__, f"{name}.json")
