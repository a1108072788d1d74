# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of panels for the manual."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from devtools import window_pictures
from panels import base, layers


def test_sections_are_open_in_the_picture_that_names_them(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = {}

    def panel(title: str, default_closed: bool) -> tuple[SimpleNamespace, None]:
        asked[title] = default_closed
        return SimpleNamespace(label=lambda text: None), None

    monkeypatch.setattr(base, "section", base.section)
    monkeypatch.setattr(layers, "section", base.section, raising=False)
    for picture, sections in (("stand", ["Site"]), ("layers", ["Where"])):
        window_pictures._opened(layers.TETFLORA_PT_layers, picture, sections)
        for title in ("Site", "Where"):
            layers.base.section(SimpleNamespace(panel=panel), title)
        assert asked == {title: title not in sections for title in ("Site", "Where")}
