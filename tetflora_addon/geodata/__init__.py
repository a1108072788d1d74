# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real places: files of surveys and cities, coordinate systems, and trees seen from above.

Texts called ``what`` or ``where`` begin messages of a `SceneError`, which says what to do.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any


@cache
def table(name: str) -> dict[str, Any]:
    """What a JSON file of this room holds."""
    return json.loads(Path(__file__).with_name(f"{name}.json").read_text(encoding="utf-8"))
