# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Formats of files: each number is read by the steps from it, and none that this version does not know."""

from __future__ import annotations

import pytest

from tetflora_addon import formats


def test_data_of_earlier_formats_takes_each_step(monkeypatch) -> None:
    monkeypatch.setitem(formats.FORMATS, "biome", 3)
    monkeypatch.setitem(formats.STEPS, ("biome", 1), lambda data: data | {"b": data["a"] + 1})
    monkeypatch.setitem(formats.STEPS, ("biome", 2), lambda data: data | {"c": data["b"] + 1})
    assert formats.newest("biome", {"a": 1}, 1) == {"a": 1, "b": 2, "c": 3}
    assert formats.newest("biome", {"b": 5}, 2) == {"b": 5, "c": 6}
    assert formats.newest("biome", {"a": 1}, 3) == {"a": 1}


@pytest.mark.parametrize("number", [0, 2, -1, True, None, "1", 1.5, [1], float("nan")])
def test_numbers_that_are_no_known_format_are_refused(number) -> None:
    with pytest.raises(ValueError, match=r"must be 1 for this version of TetFlora.*; update the extension"):
        formats.newest("species", {}, number)
