# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Help opens pages of the manual that exist: of panels, settings and operators."""

from __future__ import annotations

from fnmatch import fnmatchcase
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import bpy
import pytest

from devtools import interface
from devtools.build import ROOT
from devtools.layouts import Layout
from devtools.readability import anchors
from panels import help as pages

pytestmark = pytest.mark.usefixtures("clean_file")


def _exists(page: str) -> bool:
    path, _, anchor = page.partition("#")
    text = (ROOT / "docs" / path).read_text(encoding="utf-8")
    return not anchor or anchor in anchors(text)


def test_every_panel_opens_its_page():
    for cls in interface.classes("TETFLORA_PT_"):
        if 'INSTANCED' in getattr(cls, "bl_options", ()):
            continue  # a popover has no header
        assert _exists(cls.manual), cls.__name__
        layout = Layout()
        cls.draw_header_preset(type("Drawn", (), {"layout": layout, "manual": cls.manual})(), bpy.context)
        assert [args[0] for name, args, _ in layout.drawn if name == "operator"] == ["wm.url_open"], cls.__name__


def test_every_setting_and_operator_has_a_page():
    assert [page for _, page in pages.PAGES if not _exists(page)] == []
    names = [f"bpy.ops.tetflora.{name}" for name in interface.operator_types()]
    names += [f"bpy.types.{group.__name__}.x".lower() for group in interface.groups()]
    used = {next(pattern for pattern, _ in pages.PAGES if fnmatchcase(name, pattern)) for name in names}
    assert {pattern for pattern, _ in pages.PAGES} - used <= {"bpy.types.tetflorafield*"}
    assert pages._map in [maker for maker in bpy.utils.manual_map.__globals__["_manual_map"]]


def test_pages_are_copies_until_the_release_has_a_website(monkeypatch):
    address = urlsplit(pages.base())
    assert address.scheme == "file"
    assert Path(url2pathname(address.path), "manual.md").is_file()
    monkeypatch.setattr(pages, "PLACEHOLDER", "nowhere.invalid")
    pages.base.cache_clear()
    try:
        assert pages.base() == "https://example.org/tetflora/blob/main/docs/"
    finally:
        pages.base.cache_clear()
