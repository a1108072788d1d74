# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inventories: what columns and names mean, units, and what is broken in a file."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import pytest

from tests import places_files as files
from tests import places_inventories as inventories
from tetflora_addon.errors import SceneError
from tetflora_addon.geodata import table, tables
from tetflora_addon.geodata.inventories import FIELDS, IMPERIAL, preview, read_inventory, read_title, said_of
from tetflora_addon.geodata.species_names import (
    GENUS,
    KIN,
    KIND,
    SPECIES,
    best_of,
    name_counts,
    names_in,
    species_named,
)

_CATALOG = Path(__file__).parents[3] / "tetflora_addon" / "catalog"


def _read(tmp_path, text, name="a.csv", **options):
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_inventory(path, **options)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
def test_a_german_table(tmp_path, encoding):
    found = _read(tmp_path, files.INVENTORY.encode(encoding), epsg=25832)
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
    assert found.system.epsg == 25832
    used = (
        "Höhe (m) (Height), Stammumfang [cm] (Trunk Girth), Kronendurchmesser (Crown Width), Alter (Age), X (X, East)"
    )
    assert found.notes == [f"columns used: Baumart (Species), {used}, Y (Y, North)", "columns not used: id"]


def test_points_of_geojson(tmp_path):
    found = _read(tmp_path, files.collection(*files.TREES), "a.geojson")
    assert found.system.epsg == 4326
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
    assert read_title(title)[:2] == (name, unit)


_TITLES = {
    "height": "TREE_HEIGH, TREEHEIGHTinMETRES, hauteurenm, height_range_id, H_TOT_M, 樹高",
    "diameter": "DBH_1_99_, D130, DIAM_BREAS, D_BH cm, StammDM",
    "girth": "StU, PAP",
    "crown_width": "CRN_DIA_M, kr_durchm, KronenDM, Schirmdurchmesser, canopyspre, diametre_houppier, diameter_crown",
    "crown_base": "crownBaseHeightM, Kronenansatzhöhe",
    "planted": "Pflanzjahr, annee de plantation, plant_date, Year Planted",
    "status": "Tree Status, condition",
    "dead": "is_dead",
    "name": "Name_lat, tradart_vet, SP_CODE, GATTUNG_ART",
    "common": "Gattung Deutsch, dansk_navn",
    "family": "familia",
    "x": "POINT_X, X_L93, Standort_X, RW, E_UTM, lv95_e",
    "y": "yRel, Y_LAMBERT93, HW, N_UTM",
    "place": "geo_point_2d, the_geom, WKT",
    "latitude": "LAT_WGS84",
    "longitude": "経度",
    "": "Street Name, tree_id, Page, start, village, Objectid, Standortnr, elevation, overhead_utilities, bezirk",
}


@pytest.mark.parametrize("name", _TITLES)
def test_words_within_titles(name):
    titles = _TITLES[name].split(", ")
    assert {title: read_title(title).field for title in titles} == dict.fromkeys(titles, name)


def test_titles_of_cities():
    assert inventories.titles_read() >= 0.95, inventories.titles_not_read()


def test_names_of_streets_and_parks():
    assert len(inventories.names_unknown()) <= 12, inventories.names_unknown()


def test_false_names_are_of_the_genus_before_them():
    names = "Robinier faux-acacia", "Érable faux platane", "Chêne faux-liège", "Falsa acacia"
    assert [species_named(name).species for name in names] == ["ash", "maple", "oak", "ash"]


def test_degrees_minutes_and_seconds(tmp_path):
    found = _read(tmp_path, "species\tlat\tlon\noak\t48°06'00\"N\t9°05′60\"W\n")
    assert found.points[0] == pytest.approx([-9.1, 48.1])


def test_degrees_in_german_and_below_addresses(tmp_path):
    found = _read(tmp_path, "Art;Länge;Breite\nEiche;9,1;48,1\n")
    assert found.points.tolist() == [[9.1, 48.1]] and not found.sizes["crown_width"].any()
    found = _read(tmp_path, 'species,Location\noak,"12 Main St\n(42.36, -71.05)"\n')
    assert found.points.tolist() == [[-71.05, 42.36]]


def test_rounded_degrees_called_x_and_y(tmp_path):
    text = "species,x,y\npine,12.49,41.89\npine,12.48,41.88\n"
    assert _read(tmp_path, text).system.epsg == 4326
    assert _read(tmp_path, text.replace("48,", "98,")).system.epsg == 0  # a plot


@pytest.mark.parametrize(
    "place",
    [
        "01010000003333333333332240CDCCCCCCCC0C4840",
        "0101000020E61000003333333333332240CDCCCCCCCC0C4840",
        "POLYGON (("
        + ", ".join(f"{9.1 + 1e-5 * a} {48.1 + 1e-5 * b}" for a, b in [(0, 0), (1, 0), (1, 1), (0, 1)] * 4)
        + "))",
    ],
)
def test_places_of_databases(tmp_path, place):
    found = _read(tmp_path, f'species,geom\noak,"{place}"\n')
    assert found.points[0] == pytest.approx([9.1, 48.1], abs=1e-4)


def test_who_planted_a_tree_is_no_year(tmp_path):
    found = _read(tmp_path, "species,planted by,x,y\noak,Jones,0,0\n")
    assert "columns not used: planted by" in found.notes


@pytest.mark.parametrize("name", inventories.cases())
def test_inventories_as_others_write_them(name):
    assert inventories.problems(name) == []


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
    assert found.system.epsg == 4326


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: 0 columns"),
        ("species,height,x,y\n", "it has no rows"),
        ("species,height\noak,3\n", "no columns of coordinates"),
        ("species,height,x,y\noak,3,1,2\n\noak,1x2,1,2\n", "line 4, column 'height': '1x2' is not a number"),
        ("species,height,x,y\noak,3,1,2\noak,1\n", "line 3: 2 values, and line 1 has 4"),
        ("species,height,x,y\noak,-3,1,2\n", "line 2, column 'height': '-3' is not from 0 to 150 m"),
        ("species,height,x,y\noak,1.5e3,1,2\noak,3,1,2\noak,4,1,2\n", "not from 0 to 150"),
        ("species,height,x,y\noak,3,,2\n", "line 2, column 'x': a tree without coordinates"),
        ("species,height,lon,lat\noak,3,9,200\n", "line 2, column 'lon': 9, 200 are no longitude"),
        ("species,height,crown base,x,y\noak,3,4,1,2\n", "column 'crown base': 4 m is not below the height of 3 m"),
        ('species,height,x,y\n"oak,3,1,2\n', "line 2"),
        (b"a\0b\0", "this is no text"),
        ("species,x,y\nvacant,1,2\nstump,1,2\n", "none of its rows is a tree"),
    ],
)
def test_a_broken_row_is_told_by_line_and_column(tmp_path, text, message):
    with pytest.raises(SceneError, match=message):
        _read(tmp_path, text)


def test_broken_rows_can_be_skipped(tmp_path):
    text = "species,height,x,y\noak,3,1,2\noak,1x,1,2\noak,999,1,2\noak,5,4,4\n"
    found = _read(tmp_path, text, skip=True)
    assert found.sizes["height"].tolist() == [3.0, 5.0]
    assert found.skipped == 2
    assert "line 3" in found.first
    with pytest.raises(SceneError, match="line 2"):
        _read(tmp_path, "species,height,x,y\noak,1x,1,2\n", skip=True)


@pytest.mark.parametrize(
    ("name", "species", "certainty"),
    [
        ("Quercus robur", "oak", SPECIES),
        ("QUERCUS ROBUR L.", "oak", SPECIES),
        ("Q. robur 'Fastigiata'", "oak", SPECIES),
        ("Stiel-Eiche", "oak", SPECIES),
        ("Chêne pédonculé", "oak", SPECIES),
        ("Tilia × europaea", "linden", SPECIES),
        ("Föhre", "scots_pine", SPECIES),
        ("Foehre", "scots_pine", SPECIES),
        ("FI", "spruce", SPECIES),
        ("Fagus sylvatica f. purpurea", "beech", SPECIES),
        ("Acer campestre", "maple", GENUS),
        ("Zerreiche", "oak", GENUS),
        ("Sumpfeiche", "black_oak", KIN),
        ("Robinia pseudoacacia", "ash", KIN),
        ("eastern redcedar", "juniper", GENUS),
        ("box elder", "maple", GENUS),
        ("oak, northern red (Quercus rubra)", "black_oak", KIN),
        ("Acacia de tres espinas", "ash", KIN),
        ("Pin parasol", "stone_pine", SPECIES),
        ("pin oak", "black_oak", KIN),
        ("Laurel oak", "oak", GENUS),
        ("Plantanus acerifolia", "maple", KIN),
        ("ACPL", "maple", SPECIES),
        ("A. rubrum", "maple", GENUS),
        ("Fagaceae", "oak", KIN),
        ("Phoenix canariensis", "palm", KIN),
        ("x Cupressocyparis leylandii", "cypress", KIN),
        ("Red Maple October Glory", "maple", GENUS),
        ("Betula spp.", "birch", GENUS),
        ("Ulmus glabra", "hornbeam", KIN),
        ("Gemeine Rosskastanie", "maple", KIN),
        ("Nadelbaum", "conifer", KIND),
        ("deciduous", "broadleaf_tree", KIND),
    ],
)
def test_names(name, species, certainty):
    assert species_named(name) == (species, certainty)


@pytest.mark.parametrize("name", ["pseudoacacia", "Primrose Tree", "Street", "Good", "unknown", "Unidentified tree"])
def test_parts_of_words_and_other_words_name_nothing(name):
    assert species_named(name) is None


def test_a_scientific_name_counts_before_a_common_one():
    assert best_of(["London Plane", "Juniperus virginiana"])[0].species == "juniper"
    assert best_of(["Quercus", "Northern red oak"])[0].species == "oak"
    assert best_of([]) == (None, "")


def test_the_table_of_names_fits_the_catalog():
    known, data = {path.stem for path in _CATALOG.glob("*.json")}, table("species_names")
    kin = {kin for groups in data["families"].values() for kin, _ in names_in(groups)}
    assert {*data["species"], *data["kin"], *data["kinds"], *kin} <= known
    # Each entry stands below a source that is explained.
    sources = {source for groups in (*data["families"].values(), *data["common"].values()) for source in groups}
    assert sources <= set(data["sources"])
    genera = [genus for groups in data["families"].values() for _, genus in names_in(groups)]
    assert len(genera) == len(set(genera)) > 1000
    common = {genus for groups in data["common"].values() for genus, _ in names_in(groups, ",")}
    assert common - {"arecaceae"} <= set(genera)
    assert species_named("Foo bar") is None
    assert name_counts({"a": 2, "b": 30}) == "b (30), a (2)"


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [
        ("12 m", 12.0, 1.0),
        ("5'6\"", 5.5, 0.3048),
        ("35cm", 35.0, 0.01),
        ("11-15 m", 13.0, 1.0),
        ("<5", 2.5, 0.0),
        ("de 10 à 20 m", 15.0, 1.0),
        ("Small (0-15 ft)", 7.5, 0.3048),
        ("< 5 m (jeune)", 2.5, 1.0),
        ("24+ in", 24.0, 0.0254),
        ("über 20 m", 20.0, 1.0),
        ("1.234,5", 1234.5, 0.0),
        ("23/15", 23.0, 0.0),
        ("#N/A", 0.0, 0.0),
        ("nicht gemessen", 0.0, 0.0),
        ("2018-03-04", np.nan, 0.0),
    ],
)
def test_numbers_as_people_write_them(text, value, unit):
    values, units, _ = tables.cells(np.array([text]))
    assert (values[0], units[0]) == pytest.approx((value, unit), nan_ok=True)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Dead", "dead"),
        ("dead tree", "dead"),
        ("Dead branches", ""),
        ("Vacant site small (vacant site small)", "vacant"),
        ("Stump for removal", "stump"),
        ("Baum gefällt", "removed"),
        ("Souche", "stump"),
        ("geplant", "planned"),
        ("To be removed", ""),
        ("Good", ""),
    ],
)
def test_what_cells_say_of_trees(text, said):
    assert said_of(text) == said


def test_a_dead_tree_may_stand_in_place_of_a_species(tmp_path):
    found = _read(tmp_path, "species,condition,x,y\nDead,,0,0\nTilia cordata,Good,5,5\nTilia cordata,Dead,9,5\n")
    assert (found.sizes["dead"] > 0.0).tolist() == [True, False, True]


def test_collections_of_geometry_and_features_without_a_place(tmp_path):
    square = [[[9.0, 48.0], [9.2, 48.0], [9.2, 48.2], [9.0, 48.2], [9.0, 48.0]]]
    point = {"type": "Point", "coordinates": ["9.5", "48.5"]}
    both = {"type": "GeometryCollection", "geometries": [{"type": "LineString", "coordinates": []}, point]}
    features = [files.feature("MultiPolygon", [square], species="oak"), files.feature("LineString", [[9, 48], [9, 49]])]
    features.append({"type": "Feature", "properties": {"tags": {"species": "Tilia cordata"}}, "geometry": both})
    found = _read(tmp_path, files.collection(*features), "a.geojson")
    assert found.points == pytest.approx(np.array([[9.1, 48.1], [9.5, 48.5]]))
    assert [found.names[i] for i in found.name] == [("oak",), ("Tilia cordata",)]
    assert found.notes[0] == "1 feature without a place"


def test_years_of_planting_become_ages(tmp_path):
    now = datetime.date.today().year
    for title, year in (("Pflanzjahr", "1990"), ("planting date", "12/03/1990"), ("age", "1990")):
        found = _read(tmp_path, f"species,{title},x,y\noak,{year},0,0\noak,,5,5\n")
        assert found.sizes["age"].tolist() == [now - 1990, 0.0]


def test_a_mapping_changes_what_columns_are_taken_for(tmp_path):
    text = "species,h1,h2,x,y\noak,30,5,0,0\noak,40,6,5,5\n"
    assert not _read(tmp_path, text).sizes["height"].any()
    columns = {"h1": "height ft", "h2": "crown_width", "species": ""}
    found = _read(tmp_path, text, columns=columns)
    assert found.sizes["height"] == pytest.approx([9.144, 12.192])
    assert found.sizes["crown_width"].tolist() == [5.0, 6.0]
    assert "no column of species" in found.notes
    text = "species,height,height 2,x,y\noak,30,5,0,0\noak,40,6,5,5\n"
    assert _read(tmp_path, text, columns={"height 2": "height"}).sizes["height"].tolist() == [5.0, 6.0]
    text = "species,h1,h2,x,y\noak,30,5,0,0\n"
    for columns in ({"h3": "height"}, {"h1": "size"}, {"h1": "height furlongs"}):
        with pytest.raises(SceneError, match="correct Columns"):
            _read(tmp_path, text, columns=columns)


def test_a_preview_has_each_column_with_three_values(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("id,H (m),Art\n" + "".join(f"{n},{n % 4},Tilia cordata\n" for n in range(400)))
    assert [tuple(column) for column in preview(path)] == [
        ("id", "", ("0", "1", "2")),
        ("H (m)", "height", ("0", "1", "2")),
        ("Art", "name", ("Tilia cordata",)),
    ]
    assert {column.field for column in preview(path)} <= set(FIELDS)


@pytest.mark.parametrize(
    "text",
    [
        "species,crown height,height,x,y\noak,4,30,0,0\noak,5,20,5,5\n",
        "species,height_class,height,x,y\noak,2,30,0,0\noak,3,20,5,5\n",
    ],
)
def test_what_a_preview_proposes_is_what_is_read_without_it(tmp_path, text):
    """The dialog hands over what it proposed for each column."""
    plain = _read(tmp_path, text)
    proposed = {column.title: column.field for column in preview(tmp_path / "a.csv")}
    chosen = _read(tmp_path, text, columns=proposed)
    assert plain.sizes["height"].tolist() == chosen.sizes["height"].tolist() == [30.0, 20.0]
    assert plain.notes == chosen.notes


def test_classes_without_their_sizes_do_not_count(tmp_path):
    found = _read(tmp_path, "species,height_class,x,y\noak,2,0,0\noak,3,5,5\n")
    assert not found.sizes["height"].any()
    assert "columns not used: height_class" in found.notes


def test_names_of_cultivars_are_found_by_their_values(tmp_path):
    found = _read(tmp_path, "foo,x,y\nTilia cordata,0,0\nAcer rubrum,5,5\n")
    assert [names[0] for names in found.names] == ["Acer rubrum", "Tilia cordata"]


@pytest.mark.parametrize(
    ("header", "cells_", "points", "epsg"),
    [
        ("geo", '"48.1, 111.5"', [111.5, 48.1], 4326),
        ("lon_lat", '"11.5, 48.1"', [11.5, 48.1], 4326),
        ("geom", '"SRID=25832;POINT(500000 5300000)"', [500000.0, 5300000.0], 25832),
        ("shape", '"MULTIPOLYGON (((0 0, 2 0, 2 2, 0 2, 0 0)))"', [1.0, 1.0], 4326),
        ("where", '"{""type"":""Point"",""coordinates"":[11.5,48.1]}"', [11.5, 48.1], 4326),
        ("latitude,longitude", "-111.5,48.1", [-111.5, 48.1], 4326),
        ("longitude,latitude", "500000,5300000", [500000.0, 5300000.0], 0),
    ],
)
def test_places_in_any_order(tmp_path, header, cells_, points, epsg):
    found = _read(tmp_path, f"species,{header}\noak,{cells_}\n")
    assert found.points[0].tolist() == points
    assert found.system.epsg == epsg
