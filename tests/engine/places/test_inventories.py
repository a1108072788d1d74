# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inventories: what columns and names mean, units, and what is broken in a file."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from benchmarks import places_files as files
from tetflora_addon.errors import SceneError
from tetflora_addon.places.inventories import IMPERIAL, meaning, read_inventory
from tetflora_addon.places.species_names import (
    GENUS,
    KIN,
    KIND,
    SPECIES,
    key_of,
    plain_words,
    species_named,
    table,
    told,
)

_CATALOGUE = Path(__file__).parents[3] / "tetflora_addon" / "catalogue"


def _read(tmp_path, text, name="a.csv", **options):
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_inventory(path, **options)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
def test_a_german_table(tmp_path, encoding):
    found = _read(tmp_path, files.INVENTORY.encode(encoding), code=25832)
    assert [found.names[i][0] for i in found.name] == [
        "Stiel-Eiche",
        "Tilia cordata 'Greenspire'",
        "Foo bar",
        "Picea abies; Fichte",
    ]
    assert found.sizes["height"].tolist() == [14.5, 9.0, 0.0, 22.0]
    assert found.sizes["diameter"] == pytest.approx(np.array([2.1, 0.0, 0.88, 1.3]) / np.pi)
    assert found.sizes["crown_width"].tolist() == [11.0, 6.0, 0.0, 5.5]
    assert found.sizes["age"].tolist() == [90.0, 0.0, 0.0, 70.0]
    assert found.points[2].tolist() == [500030.0, 5316012.25]
    assert found.system.code == 25832
    assert found.notes == ["columns not used: id"]


def test_points_of_geojson(tmp_path):
    found = _read(tmp_path, files.collection(*files.TREES), "a.geojson")
    assert found.system.code == 4326
    assert [found.names[i][:1] for i in found.name] == [
        ("Quercus robur",),
        ("Fagus sylvatica",),
        ("Betula pendula",),
        (),
    ]
    assert found.sizes["diameter"] == pytest.approx(np.array([0.6, 0.7, 0.8, 0.9]) / np.pi, rel=1e-6)
    assert '"circumference" read as m' in found.notes


@pytest.mark.parametrize(
    ("title", "name", "unit"),
    [
        ("Height (m)", "height", 1.0),
        ("Höhe in m", "height", 1.0),
        ("BAUMHOEHE", "height", 0.0),
        ("dbh_cm", "diameter", 0.01),
        ("DBH in", "diameter", 0.0254),
        ("tree_dbh", "diameter", 0.0),
        ("Stammumfang [cm]", "girth", 0.01),
        ("CIRCONFERENCE (cm)", "girth", 0.01),
        ("Kronen-Durchmesser", "crown_width", 0.0),
        ("crown_radius_ft", "crown_radius", 0.3048),
        ("x", "x", 0.0),
        ("Longitude", "longitude", 0.0),
        ("Genre", "genus", 0.0),
        ("anything", "", 0.0),
        ("m", "", 0.0),
    ],
)
def test_what_columns_mean(title, name, unit):
    assert meaning(title) == (name, unit)


def test_no_title_has_two_meanings():
    titles = Counter("".join(plain_words(title)) for names in table()["fields"].values() for title in names)
    assert [title for title, number in titles.items() if number > 1] == []


@pytest.mark.parametrize(
    ("header", "values", "diameters", "options"),
    [
        ("dbh", (30, 55), (0.3, 0.55), {}),
        ("dbh", (0.3, 0.55), (0.3, 0.55), {}),
        ("dbh", (300, 550), (0.3, 0.55), {}),
        ("dbh", (10, 20), (0.254, 0.508), {"units": IMPERIAL}),
        ("girth", (100, 200), (1 / np.pi, 2 / np.pi), {}),
    ],
)
def test_units_that_nobody_tells(tmp_path, header, values, diameters, options):
    found = _read(tmp_path, f"species,{header},x,y\noak,{values[0]},0,0\noak,{values[1]},5,5\n", **options)
    assert found.sizes["diameter"] == pytest.approx(diameters)


def test_dead_trees_and_degrees_that_are_called_x_and_y(tmp_path):
    rows = "".join(f"oak,{text},9.{n}12345,48.{n}54321\n" for n, text in enumerate(("Alive", "dead", "Tot", "")))
    found = _read(tmp_path, "Species,Status,X,Y\n" + rows)
    assert (found.sizes["dead"] > 0.0).tolist() == [False, True, True, False]
    assert found.system.code == 4326


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: 0 columns"),
        ("species,height,x,y\n", "it has no rows"),
        ("species,height\noak,3\n", "no columns of coordinates"),
        ("species,height,x,y\noak,3,1,2\n\noak,high,1,2\n", "line 4, column 'height': 'high' is not a number"),
        ("species,height,x,y\noak,3,1,2\noak,1\n", "line 3: 2 values, and line 1 has 4"),
        ("species,height,x,y\noak,-3,1,2\n", "line 2, column 'height': '-3' is not from 0 to 150 m"),
        ("species,height,x,y\noak,1.5e3,1,2\n", "not from 0 to 150"),
        ("species,height,x,y\noak,3,,2\n", "line 2, column 'x': a tree without coordinates"),
        ("species,height,lon,lat\noak,3,9,200\n", "line 2, column 'lon': 9, 200 are no longitude"),
        ("species,height,crown base,x,y\noak,3,4,1,2\n", "column 'crown base': 4 m is not below the height of 3 m"),
        ('species,height,x,y\n"oak,3,1,2\n', "line 2"),
        (b"\xff\xfea\0b\0", "no text in UTF-8"),
    ],
)
def test_a_broken_row_is_told_by_line_and_column(tmp_path, text, message):
    with pytest.raises(SceneError, match=message):
        _read(tmp_path, text)


def test_broken_rows_can_be_skipped(tmp_path):
    text = "species,height,x,y\noak,3,1,2\noak,x,1,2\noak,999,1,2\noak,5,4,4\n"
    found = _read(tmp_path, text, skip=True)
    assert found.sizes["height"].tolist() == [3.0, 5.0]
    assert found.skipped == 2
    assert "line 3" in found.first
    with pytest.raises(SceneError, match="line 2"):
        _read(tmp_path, "species,height,x,y\noak,x,1,2\n", skip=True)


@pytest.mark.parametrize(
    ("name", "species", "certainty"),
    [
        ("Quercus robur", "oak", SPECIES),
        ("QUERCUS ROBUR L.", "oak", SPECIES),
        ("Q. robur 'Fastigiata'", "oak", SPECIES),
        ("Stiel-Eiche", "oak", SPECIES),
        ("Chêne pédonculé", "oak", SPECIES),
        ("Tilia × europaea", "lime", SPECIES),
        ("Föhre", "scots_pine", SPECIES),
        ("Foehre", "scots_pine", SPECIES),
        ("FI", "spruce", SPECIES),
        ("Fagus sylvatica f. purpurea", "beech", SPECIES),
        ("Acer campestre", "maple", GENUS),
        ("Sumpfeiche", "oak", GENUS),
        ("Betula spp.", "birch", GENUS),
        ("Ulmus glabra", "hornbeam", KIN),
        ("Gemeine Rosskastanie", "maple", KIN),
        ("Nadelbaum", "conifer", KIND),
        ("deciduous", "broadleaf_tree", KIND),
    ],
)
def test_names(name, species, certainty):
    assert species_named(name) == (species, certainty)


def test_the_table_of_names_fits_the_catalogue():
    known = {path.stem for path in _CATALOGUE.glob("*.json")}
    groups = {name: group for name, group in table().items() if name not in ("fields", "dead")}
    assert set().union(*groups.values()) <= known
    keys = [key_of(name) for group in groups.values() for names in group.values() for name in names]
    assert "" not in keys
    assert [key for key, number in Counter(keys).items() if number > 1] == []
    assert species_named("Foo bar") is None
    assert told({"a": 2, "b": 30}) == "b (30), a (2)"
