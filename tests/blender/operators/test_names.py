# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that files and scripts hold are those of docs/reference/names.md."""

from __future__ import annotations

import pytest

from devtools import names

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.mark.fine
def test_names_are_those_of_the_page():
    now, kept = (text.splitlines() for text in (names.page(), names.PAGE.read_text(encoding="utf-8")))
    gone = [line for line in kept if line not in now]
    assert gone == [], "a name has gone, or is new: if it is new only, run python -m devtools.names"
    assert now == kept
