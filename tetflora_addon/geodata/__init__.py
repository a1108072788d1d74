# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real places: files of surveys and cities, coordinate systems, and trees seen from above.

Whatever reads a file or looks at what came from one raises an `OSError` where that cannot be read, and a `SceneError`
where it is broken or cannot be used. Its message begins with texts called ``what`` or ``where``, names the line, the
feature or the tag, and says what to do.
"""

from functools import cache
from typing import Any

from ..files import beside


@cache
def table(name: str) -> dict[str, Any]:
    """What a JSON file of this room holds."""
    return beside(__file__, f"{name}.json")
