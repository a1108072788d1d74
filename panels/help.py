# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages of the manual: a button in the header of each panel, and Online Manual in the menu of a right click.

Pages are those of the website in the manifest; while that is a placeholder, copies in the extension, without pictures.
"""

import tomllib
from functools import cache, partial
from pathlib import Path

import bpy
from bpy import utils

from ..tetflora_addon.blender.runtime import Part
from ..tetflora_addon.files import beside

_ROOT = Path(__file__).resolve().parent.parent
#: Host of the manifest's website until a release has one.
PLACEHOLDER = "example.org"
#: Where a website has the documents of the source tree: as GitHub shows them.
_DOCUMENTS = "blob/main/docs"

#: Pages of settings and operators, by patterns of their names in Python; the first that fits counts.
PAGES = tuple(beside(__file__, "pages.json").items())


@cache
def base() -> str:
    """Address below which the pages are, with a slash at its end."""
    about = tomllib.loads((_ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    website = str(about.get("website", "")).rstrip("/")
    if website and PLACEHOLDER not in website:
        return f"{website}/{_DOCUMENTS}/"
    return (_ROOT / "docs").as_uri() + "/"


def draw_help(layout: bpy.types.UILayout, page: str) -> None:
    """A button that opens a page in the browser."""
    layout.operator("wm.url_open", text="", icon='QUESTION', emboss=False).url = base() + page


def _map() -> tuple[str, tuple[tuple[str, str], ...]]:
    return base(), PAGES


#: For the pages of settings and operators, which Blender opens.
register, unregister = Part(*(partial(tell, _map) for tell in (utils.register_manual_map, utils.unregister_manual_map)))
