# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender and the extension are there before the tests are collected, so they import both at the top of the file."""

from collections.abc import Callable, Iterator

import pytest

from devtools import session

session.start()


@pytest.fixture
def coarsely_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Levels of exported plants follow from views of few cells, for tests of files: their colors are none of it."""
    from tetflora_addon.export import levels, opaque

    monkeypatch.setattr(opaque, "_CELLS", 48)
    monkeypatch.setattr(levels, "_FEWEST_CELLS", 40)
    monkeypatch.setattr(levels, "_MOST_CELLS", 80)


@pytest.fixture
def keep_memory() -> Iterator[Callable[[float], None]]:
    """Sets the size of the frame cache in the preferences, in gigabytes, for one test."""
    from tetflora_addon.blender import preferences

    own = preferences.preferences()
    before = own.kept_memory
    yield lambda gigabytes: setattr(own, "kept_memory", gigabytes)
    own.kept_memory = before
