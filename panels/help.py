# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages of the manual: a button in the header of each panel, and Online Manual in the menu of a right click.

Pages are those of the website in the manifest. While that is a placeholder, they are the copies in the extension's
folder, which have no pictures.
"""

import tomllib
from functools import cache
from pathlib import Path

import bpy

_ROOT = Path(__file__).resolve().parent.parent
#: Host of the manifest's website until a release has one.
PLACEHOLDER = "example.org"
#: Where a website has the documents of the source tree: as GitHub shows them.
_DOCUMENTS = "blob/main/docs"

#: Pages of settings and operators, by patterns of their names in Python; the first that fits counts.
PAGES = (
    ("bpy.types.tetfloralayer.*", "manual/landscapes.md#layers"),
    ("bpy.types.tetfloramix*", "manual/landscapes.md#species-of-a-layer"),
    ("bpy.types.tetfloraground.*", "manual/landscapes.md#where-it-grows"),
    ("bpy.types.tetflorastand*", "manual/landscapes.md#grown-forests"),
    ("bpy.types.tetfloraobject.*", "manual/plants.md#single-plants"),
    ("bpy.types.tetflorafield*", "manual/plants.md#fields"),
    ("bpy.types.tetflorabrush.*", "manual/plants.md#paint"),
    ("bpy.types.tetfloraspecieseditor.*", "manual/seasons.md#species-editor"),
    ("bpy.types.tetflorayear.*", "manual/seasons.md#seasons"),
    ("bpy.types.tetflorawind.*", "manual/seasons.md#wind"),
    ("bpy.types.tetfloraoutput.*", "manual/rendering.md#output"),
    ("bpy.types.tetfloraspeciesoutput.*", "manual/rendering.md#output"),
    ("bpy.types.tetflorapreview.*", "manual/rendering.md#preview-and-statistics"),
    ("bpy.types.tetflorapreferences.*", "manual/reference.md#preferences"),
    ("bpy.types.tetflora*", "manual/rendering.md#detail"),
    ("bpy.ops.tetflora.import_biome*", "manual/landscapes.md#biomes"),
    ("bpy.ops.tetflora.import_*", "manual/landscapes.md#real-places"),
    ("bpy.ops.tetflora.*biome*", "manual/landscapes.md#biomes"),
    ("bpy.ops.tetflora.ground_*", "manual/landscapes.md#ground-cover"),
    ("bpy.ops.tetflora.grow_stand*", "manual/landscapes.md#grown-forests"),
    ("bpy.ops.tetflora.animate_growth*", "manual/landscapes.md#grown-forests"),
    ("bpy.ops.tetflora.keep_year*", "manual/landscapes.md#grown-forests"),
    ("bpy.ops.tetflora.*layer*", "manual/landscapes.md#layers"),
    ("bpy.ops.tetflora.populate*", "manual/landscapes.md#species-of-a-layer"),
    ("bpy.ops.tetflora.paint_plants*", "manual/plants.md#paint"),
    ("bpy.ops.tetflora.place_plant*", "manual/plants.md#place-by-hand"),
    ("bpy.ops.tetflora.use_as_skeleton*", "manual/plants.md#drawn-plants"),
    ("bpy.ops.tetflora.use_as_species*", "manual/models.md#models-as-species"),
    ("bpy.ops.tetflora.mark*", "manual/models.md"),
    ("bpy.ops.tetflora.first_forest*", "manual.md#first-forest"),
    ("bpy.ops.tetflora.*species*", "manual/seasons.md#species-editor"),
    ("bpy.ops.tetflora.edit_*", "manual/seasons.md#species-editor"),
    ("bpy.ops.tetflora.*library*", "manual/seasons.md#species-editor"),
    ("bpy.ops.tetflora.*plant*", "manual/plants.md#single-plants"),
    ("bpy.ops.tetflora.drop_*", "manual/plants.md#single-plants"),
    ("bpy.ops.tetflora.reseed*", "manual/plants.md#single-plants"),
    ("bpy.ops.tetflora.keep_results*", "manual/rendering.md#output"),
    ("bpy.ops.tetflora.preview_levels*", "manual/rendering.md#preview-and-statistics"),
    ("bpy.ops.tetflora.write_report*", "manual/troubleshooting.md#report-a-fault"),
    ("bpy.ops.tetflora.export_forest*", "manual/rendering.md#export"),
    ("bpy.ops.tetflora.delete_file*", "manual/reference.md#files"),
    ("bpy.ops.tetflora.*", "manual/rendering.md#refine"),
)


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


def register() -> None:
    """Tell Blender the pages of settings and operators."""
    bpy.utils.register_manual_map(_map)


def unregister() -> None:
    """Take them back."""
    bpy.utils.unregister_manual_map(_map)
