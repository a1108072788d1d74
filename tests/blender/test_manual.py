# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual keeps step with what the artist sees: settings, buttons, options of the command line, pictures."""

from __future__ import annotations

import math
import re

import pytest

from devtools import build
from tetflora_addon.blender import (
    brush_properties,
    output_properties,
    population_properties,
    preferences,
    preview_properties,
    properties,
    wind_properties,
)

MANUAL = (build.ROOT / "docs" / "manual.md").read_text(encoding="utf-8")


GROUPS = (
    properties.TetFloraScene,
    properties.TetFloraLeafObject,
    population_properties.TetFloraPopulation,
    population_properties.TetFloraMixEntry,
    output_properties.TetFloraOutput,
    output_properties.TetFloraSpeciesOutput,
    preview_properties.TetFloraPreview,
    brush_properties.TetFloraBrush,
    wind_properties.TetFloraWind,
    preferences.TetFloraPreferences,
)


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.__name__)
def test_every_setting_is_explained(clean_file, group):
    properties = group.bl_rna.properties
    hidden = {"rna_type", "bl_idname"}
    shown = {p.name for p in properties if not p.is_hidden and p.identifier not in hidden and p.name != "Name"}
    internal = {"Populate", "Species"}
    assert [name for name in sorted(shown - internal) if name not in MANUAL] == []


def test_every_default_is_the_one_that_is_told(clean_file):
    settings = properties.TetFloraScene.bl_rna.properties
    rows = dict(re.findall(r"^\| \*\*(.+?)\*\* \| [^|]+ \| ([\d,.]+) \|", MANUAL, flags=re.MULTILINE))
    told = {p.identifier: rows[p.name] for p in settings if p.name in rows}
    assert {"cutoff", "leaf_limit", "block", "hidden", "max_tetrahedra"} <= set(told)
    for identifier, text in told.items():
        default = settings[identifier].default
        if settings[identifier].subtype == 'ANGLE':
            default = math.degrees(default)
        assert float(text.replace(",", "")) == pytest.approx(default), identifier


def test_every_option_of_the_command_line_is_told(clean_file):
    source = (build.ROOT / "tetflora_addon" / "blender" / "command_line.py").read_text(encoding="utf-8")
    options = re.findall(r'add_argument\("(--\w+)"', source)
    assert len(options) > 5
    assert [option for option in options if option not in MANUAL] == []


def test_pictures_and_links_lead_somewhere():
    targets = re.findall(r"\]\(([^)#]+)\)", MANUAL)
    assert len(targets) >= 8
    assert [t for t in targets if not (build.ROOT / "docs" / t).is_file()] == []
    headings = {re.sub(r"[^a-z ]", "", h.lower()).replace(" ", "-") for h in re.findall(r"^#+ (.+)$", MANUAL, re.M)}
    assert set(re.findall(r"\]\(#([^)]+)\)", MANUAL)) <= headings
