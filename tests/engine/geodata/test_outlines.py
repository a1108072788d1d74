# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines of a map: kinds, widths, holes, and what is broken in a file."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests import places_files as files
from tetflora_addon.errors import SceneError
from tetflora_addon.geodata.outlines import BUILDING, MEADOW, OTHER, ROAD, WATER, WOOD, denser, one_ring, read_outlines
from tetflora_addon.planting.plane import inside_any

_LINE = [[0.0, 0.0], [0.0, 1.0]]
_AREA = [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]]


def _read(tmp_path, *features):
    path = tmp_path / "a.geojson"
    path.write_text(files.collection(*features))
    return read_outlines(path)[0]


def test_kinds_widths_and_heights(tmp_path):
    found = _read(tmp_path, *files.OUTLINES, files.feature("Point", [1.0, 2.0], natural="tree"))
    assert [(o.kind, o.closed, o.width, o.height, len(o.rings)) for o in found] == [
        (WOOD, True, 0.0, 0.0, 2),
        (ROAD, False, 3.0, 0.0, 1),
        (BUILDING, True, 0.0, 7.0, 1),
        (BUILDING, True, 0.0, 7.0, 1),
        (WATER, True, 0.0, 0.0, 1),
    ]
    assert [len(ring) for ring in found[0].rings] == [4, 4]  # the last point is not repeated
    assert found[0].name == "Wald"


@pytest.mark.parametrize(
    ("kind", "coordinates", "properties", "expected"),
    [
        ("LineString", _LINE, {"highway": "residential"}, (ROAD, 5.5, 0.0)),
        ("LineString", _LINE, {"highway": "residential", "lanes": "2"}, (ROAD, 5.5, 0.0)),
        ("LineString", _LINE, {"highway": "busway", "lanes": 2}, (ROAD, 6.5, 0.0)),
        ("LineString", _LINE, {"highway": "path", "width": "10 ft"}, (ROAD, 3.048, 0.0)),
        ("LineString", _LINE, {"waterway": "stream"}, (WATER, 2.0, 0.0)),
        ("LineString", _LINE, {"barrier": "fence"}, (OTHER, 0.0, 0.0)),
        ("Polygon", _AREA, {"building": "yes", "building:levels": "3"}, (BUILDING, 0.0, 9.0)),
        ("Polygon", _AREA, {"building": "no", "landuse": "meadow"}, (MEADOW, 0.0, 0.0)),
        ("Polygon", _AREA, {"building": "yes", "height": "about 20"}, (BUILDING, 0.0, 7.0)),
        ("Polygon", _AREA, {"building": "yes", "roof:height": "3", "height": "~12m"}, (BUILDING, 0.0, 12.0)),
        ("Polygon", _AREA, {"tags": '{"building": "yes", "height": "9"}'}, (BUILDING, 0.0, 9.0)),
        ("Polygon", _AREA, {"other_tags": '"name"=>"a \\"b\\"","building"=>"yes"'}, (BUILDING, 0.0, 7.0)),
        ("Polygon", _AREA, {"Funktion": "Wohnhaus", "HOEHE": "12,4"}, (BUILDING, 0.0, 12.4)),
    ],
)
def test_what_features_are(tmp_path, kind, coordinates, properties, expected):
    (found,) = _read(tmp_path, files.feature(kind, coordinates, **properties))
    assert (found.kind, found.width, found.height) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], '"type" is None'),
        ({"type": "Topology"}, "'Topology'"),
        ({"type": "FeatureCollection", "features": 3}, "must be a list"),
        ({"type": "FeatureCollection", "features": []}, "no areas and no lines"),
        (files.feature("Polygon", 3), "feature 1: its coordinates are 3"),
        (files.feature("Polygon", [[[0, 0], [1, 1]]]), "no areas and no lines but 1 of too few"),
        (files.feature("LineString", [[0, 0]]), "no areas and no lines but 1 of too few"),
        (files.feature("LineString", [[0, 0], [0, "1"]]), "no positions"),
        (files.feature("LineString", [[0, 0], [0, 95.0]]), "no longitude and latitude"),
        (files.feature("Curve", _LINE), "'Curve' is no geometry"),
        ({**files.feature("LineString", _LINE), "crs": {"type": "name", "properties": {"name": "x"}}}, None),
    ],
)
def test_a_broken_file_is_told_by_its_feature(tmp_path, data, message):
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps(data))
    if message is None:  # members of features mean nothing
        assert len(read_outlines(path)[0]) == 1
        return
    with pytest.raises(SceneError, match=message):
        read_outlines(path)


def test_systems_of_before_2016(tmp_path):
    path, crs = tmp_path / "a.geojson", {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}
    data = {
        "type": "FeatureCollection",
        "crs": crs,
        "features": [files.feature("LineString", [[5e5, 5e6], [5e5, 6e6]])],
    }
    path.write_text(json.dumps(data))
    assert read_outlines(path)[1].epsg == 25832
    crs["properties"]["name"] = "local"
    path.write_text(json.dumps(data))
    with pytest.raises(SceneError, match='"crs" is'):
        read_outlines(path)


def test_holes_are_outside_of_the_one_ring():
    outer = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    holes = [np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]]), np.array([[6.0, 6.0], [8.0, 6.0], [7.0, 9.0]])]
    points = np.random.default_rng(0).uniform(-1.0, 11.0, (4000, 2))
    expected = inside_any(points, [outer]) & ~inside_any(points, holes)
    ring = one_ring((outer, *holes))
    assert (inside_any(points, [ring]) == expected).all()
    # Bridges are the shortest from where a hole is farthest east, there and back.
    lengths = [np.linalg.norm(np.diff(one, axis=0, append=one[:1]), axis=1).sum() for one in (ring, outer, *holes)]
    bridges = [np.linalg.norm(outer - hole[hole[:, 0].argmax()], axis=1).min() for hole in holes]
    assert lengths[0] == pytest.approx(sum(lengths[1:]) + 2.0 * sum(bridges))


@pytest.mark.parametrize("closed", [False, True])
def test_denser_lines_keep_their_points_and_length(closed):
    line = np.random.default_rng(2).uniform(0.0, 50.0, (6, 2))
    line = np.concatenate([line, line[:1]]) if closed else line
    found = denser(line, 4.0)
    steps = np.linalg.norm(np.diff(found, axis=0), axis=1)
    assert steps.max() <= 4.0
    assert steps.sum() == pytest.approx(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    assert all((np.abs(found - point).max(axis=1) < 1e-9).any() for point in line)
