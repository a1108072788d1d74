# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody could hand over, thirty thousand times: does anything get out, stick, or end in a traceback?

The cases of ``tests/attack``, of which the tests run a tenth, from another seed. What is found is printed on stderr.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.attack import engine_cases, scene_cases
from tests.attack.watch import attack

from .report import Targets

ENGINE, BLENDER = 24_000, 6_000
QUICK = 0.1
SEED = 2

TARGETS: Targets = {
    "raw_exceptions": {"max": 0},
    "writes_outside": {"max": 0},
    "over_5s": {"max": 0},
    "peak_mb": {"max": 2_000},
}


def run(quick: bool) -> dict[str, float]:
    """Attack; see ``docs/measurements.md`` for what the figures mean."""
    part = QUICK if quick else 1.0
    kinds = engine_cases.kinds(round(ENGINE * part)) | scene_cases.kinds(round(BLENDER * part))
    with tempfile.TemporaryDirectory() as folder:
        findings = attack(kinds, Path(folder), SEED)
    for text in (*findings.raw, *findings.outside, *findings.slow):
        print(text, file=sys.stderr, flush=True)
    return findings.figures()
