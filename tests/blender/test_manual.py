# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual keeps step with what the artist sees: settings, labels, options of the command line."""

from __future__ import annotations

import math
import re

import pytest

from devtools import build
from devtools import labels as screen
from farm import write_job
from tetflora_addon.blender import preferences, properties
from tetflora_addon.blender.cli.command import main
from tetflora_addon.blender.placing.properties import TetFloraBrush, TetFloraLayer, TetFloraMixEntry
from tetflora_addon.blender.results import collection
from tetflora_addon.blender.settings import TetFloraWind, TetFloraYear
from tetflora_addon.blender.stands.properties import TetFloraStand, TetFloraStandEntry
from tetflora_addon.blender.viewport import state

PAGES = {
    path.name: path.read_text(encoding="utf-8")
    for path in (build.ROOT / "docs" / "manual.md", *sorted((build.ROOT / "docs" / "manual").glob("*.md")))
}
MANUAL = "\n".join(PAGES.values())

# What the manual sets in bold or italics, as it does with labels; "Add > First Forest" holds two of them.
LABELS = {
    label for _, text in re.findall(r"(\*\*?)([^*|]+?)\1", MANUAL) for label in " ".join(text.split()).split(" > ")
}

#: Bold words that are keys, buttons with a sign, and pages' own emphasis.
KEYS = re.compile(r"(?:(?:Alt|Ctrl|Shift) ?)*(?:F\d+|[A-Z]|Esc|Return|Tab|Home|Shift|\[|\])")
SIGNS = {"+", "−", "?", "⌄"}
OTHERS = {"Bold", "for the active camera", "Inventories", "Canopy height", "Outlines"}

GROUPS = (
    properties.TetFloraScene,
    properties.TetFloraLeafObject,
    TetFloraLayer,
    TetFloraMixEntry,
    collection.TetFloraOutput,
    collection.TetFloraSpeciesOutput,
    state.TetFloraPreview,
    TetFloraBrush,
    TetFloraWind,
    TetFloraYear,
    TetFloraStand,
    TetFloraStandEntry,
    preferences.TetFloraPreferences,
)


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.__name__)
def test_every_setting_is_explained(clean_file, group):
    settings = [p for p in group.bl_rna.properties if not p.is_hidden and p.identifier not in {"rna_type", "bl_idname"}]
    # Groups of settings within the group have no label, but a case of their own here.
    shown = {p.name for p in settings if p.type != 'POINTER' or p.fixed_type not in {g.bl_rna for g in GROUPS}}
    assert shown
    assert sorted(shown - LABELS - {"Name"}) == []


@pytest.mark.parametrize("page", PAGES)
def test_every_bold_label_is_on_the_screen(page):
    known = screen.labels()
    for text in sorted({" ".join(bold.split()) for bold in re.findall(r"\*\*([^*]+?)\*\*", PAGES[page])}):
        label = text.removeprefix("⌄ ")
        assert label in known | SIGNS | OTHERS or KEYS.fullmatch(label), label


def test_every_default_is_the_one_that_is_told(clean_file):
    settings = properties.TetFloraScene.bl_rna.properties
    rows = dict(re.findall(r"^\| \*\*(.+?)\*\* \| [^|]+ \| ([\d,.]+) \|", MANUAL, flags=re.MULTILINE))
    told = {p.identifier: rows[p.name] for p in settings if p.name in rows}
    assert {"cutoff", "shadow_cutoff", "max_polygons"} <= set(told)
    for identifier, text in told.items():
        default = settings[identifier].default
        if settings[identifier].subtype == 'ANGLE':
            default = math.degrees(default)
        assert float(text.replace(",", "")) == pytest.approx(default), identifier


def test_every_option_of_the_command_line_is_told(blender, capsys):
    told = set(re.findall(r"`(--[a-z-]+)", MANUAL))
    for command in ("refine", "render", "stats", None):
        assert (main([command, "--help"]) if command else write_job.main(["--help"])) == 0
        options = set(re.findall(r"^ +(--[a-z-]+)", capsys.readouterr().out, re.MULTILINE))
        assert "--json" in options
        assert sorted(options - told) == []
