# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of two processes runs a test: one runs all of a file, whose tests share scenes, and one all that EEVEE draws.

A process that draws with EEVEE for the first time compiles its shaders, for a processor where there is no graphics
card: that takes longer than drawing all pictures of the tests.
"""

from __future__ import annotations

from xdist.scheduler import LoadFileScheduling

from tests.durations import draws_with_eevee


class FileScheduling(LoadFileScheduling):
    """xdist's ``--dist loadfile``, with what EEVEE draws as one file."""

    def _split_scope(self, nodeid: str) -> str:
        return "EEVEE" if draws_with_eevee(nodeid) else super()._split_scope(nodeid)
