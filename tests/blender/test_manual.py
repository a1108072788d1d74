# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual keeps step with what the artist sees: settings, buttons, options of the command line."""

from __future__ import annotations

import math
import re

import pytest

from devtools import build
from farm import write_job
from tetflora_addon.blender import preferences, properties
from tetflora_addon.blender.cli.command import main
from tetflora_addon.blender.placing.properties import TetFloraBrush, TetFloraLayer, TetFloraMixEntry
from tetflora_addon.blender.results import collection
from tetflora_addon.blender.settings import TetFloraWind, TetFloraYear
from tetflora_addon.blender.stands.properties import TetFloraStand, TetFloraStandEntry
from tetflora_addon.blender.viewport import state

MANUAL = (build.ROOT / "docs" / "manual.md").read_text(encoding="utf-8")

# What the manual sets in bold or italics, as it does with labels; "Add > First Forest" holds two of them.
LABELS = {
    label for _, text in re.findall(r"(\*\*?)([^*|]+?)\1", MANUAL) for label in " ".join(text.split()).split(" > ")
}

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
