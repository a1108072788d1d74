# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The day of the year of a scene: everything that shows plants shows them as they are on that day, and only then."""

from __future__ import annotations

import math
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from devtools.layouts import Layout
from panels import season as panel
from tests.blender.scene.test_wind import places
from tests.blender.scenes import add_camera, add_plant, depsgraph
from tetflora_addon import errors
from tetflora_addon.blender import settings
from tetflora_addon.blender.job import contents, forecast, frame_cache, plant_mesh, refine, render
from tetflora_addon.blender.results.output import result_collections
from tetflora_addon.blender.species import edits
from tetflora_addon.blender.viewport import auto, levels
from tetflora_addon.jobs import run_to_end

LEAF = {"appear": 118, "growth": 28, "turn": 280, "fall": 296, "fresh": [0.2, 0.4, 0.02], "autumn": [[0.6, 0.3, 0.02]]}
WINTER, SPRING, SUMMER, AUTUMN = 15.0, 125.0, 200.0, 285.0


@pytest.fixture
def scene(clean_file):
    """A bush that is bare in winter and yellow in autumn."""
    scene = bpy.context.scene
    add_camera(location=(0.0, -8.0, 1.0))
    add_plant("plant", seed=1)
    edits.change_species(scene, "bush", lambda data: data.update(year={"leaf": LEAF}))
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.tetflora.year.enabled, scene.tetflora.year.day = True, SUMMER
    yield scene
    render.on_render_end(scene)


def polygons(scene):
    return contents.estimate(scene, depsgraph()).polygons_full


def on(scene, day):
    scene.tetflora.year.day = day
    return polygons(scene)


def test_without_seasons_it_is_summer_whatever_the_day(scene):
    summer = places(scene, 1)
    scene.tetflora.year.enabled = False
    for day in (WINTER, SUMMER):
        scene.tetflora.year.day = day
        assert settings.season_of(scene) is None
        np.testing.assert_array_equal(places(scene, 1), summer)


def test_winter_is_bare_in_all_that_is_made(scene):
    def made(day):
        scene.tetflora.year.day = day
        (mesh,) = run_to_end(plant_mesh.make_plant_mesh_steps(scene, depsgraph(), [bpy.data.objects["plant"]]))
        number = len(mesh.data.polygons)
        bpy.data.objects.remove(mesh)
        bpy.data.objects["plant"].tetflora.enabled = True
        statistics = refine.refine(scene, depsgraph())
        return number, statistics.polygons_meshed + statistics.polygons_proxy, polygons(scene)

    for bare, full in zip(made(WINTER), made(SUMMER), strict=True):
        assert bare < 0.7 * full


def test_estimates_follow_the_day(scene):
    def expected(day):
        scene.tetflora.year.day = day
        forecast._stand = None
        return forecast.forecast(scene, bpy.context.view_layer).primitives

    scene.tetflora.expand_everything = True

    bare, full = expected(WINTER), expected(SUMMER)
    assert bare / full == pytest.approx(on(scene, WINTER) / on(scene, SUMMER), abs=0.15)
    scene.tetflora.year.latitude = -50.0
    assert expected(WINTER) == pytest.approx(full, rel=0.01)


def test_previews_have_the_colors_of_the_day(scene):
    scene.tetflora.preview.plants = 'LIGHT'

    def redness(day):
        scene.tetflora.year.day = day
        color = levels.read_shapes(scene, depsgraph()).colors.astype(float)
        return float((color[:, 0] / np.maximum(color[:, 1], 1e-6)).mean())

    assert redness(AUTUMN + 8.0) > 1.2 * redness(SUMMER)


def test_days_of_other_years_are_those_of_one(scene):
    year = scene.tetflora.year
    year.day = 12.0
    first = settings.season_of(scene)
    for later in (365.0, 730.0):
        year.day = 12.0 + later
        assert settings.season_of(scene) == first
        assert settings.date_text(year.day) == "12 January"


@pytest.mark.parametrize(
    ("day", "text"),
    [(1.0, "1 January"), (59.9, "28 February"), (60.0, "1 March"), (287.5, "14 October"), (365.9, "31 December")],
)
def test_dates_are_those_of_a_calendar(day, text):
    assert settings.date_text(day) == text


def test_the_south_has_other_seasons(scene):
    year = scene.tetflora.year
    names = {}
    for latitude in (50.0, -35.0):
        year.latitude = latitude
        names[latitude] = [settings.season_name(settings.season_of(scene)) for year.day in (15, 105, 196, 288)]
    assert names[50.0] == ["winter", "spring", "summer", "autumn"]
    assert names[-35.0] == ["summer", "autumn", "winter", "spring"]
    for season in ('WINTER', 'SPRING', 'SUMMER', 'AUTUMN'):
        bpy.context.scene.tetflora.year.season = season
        assert settings.season_name(settings.season_of(scene)) == season.lower()


def test_a_keyed_day_is_that_of_each_frame(scene):
    year = scene.tetflora.year
    for frame, day in ((1, 1.0), (73, 361.0)):
        year.day = day
        year.keyframe_insert("day", frame=frame)
    curve = year.id_data.animation_data.action
    for points in _curves(curve):
        for point in points.keyframe_points:
            point.interpolation = 'LINEAR'
    scene.frame_set(1)
    bare = polygons(scene)
    scene.frame_set(40, subframe=0.5)
    assert settings.season_of(scene).day == pytest.approx(198.5)
    assert polygons(scene) > 1.5 * bare


def _curves(action):
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    return [c for layer in action.layers for strip in layer.strips for bag in strip.channelbags for c in bag.fcurves]


def test_frames_of_one_day_share_and_others_do_not(scene):
    year = scene.tetflora.year
    for frame, day in ((1, WINTER), (2, SUMMER), (3, SUMMER + 365.0), (4, WINTER)):
        year.day = day
        year.keyframe_insert("day", frame=frame)
    names = {}
    for frame in (1, 2, 3, 4):
        scene.frame_set(frame)
        render.on_render_pre(scene)
        assert render.render_errors() == []
        names[frame] = [c.name for c in result_collections(scene, 'RENDER')]
    assert names[2] == names[3]
    assert names[1] == names[4]
    assert names[1] != names[2]


@pytest.mark.parametrize("name", ["day", "latitude", "spread", "snow", "years"])
def test_every_setting_of_the_year_counts_for_what_is_kept(scene, name):
    graph = depsgraph()
    before = frame_cache.scene_digest(scene, graph)
    value = getattr(scene.tetflora.year, name)
    setattr(scene.tetflora.year, name, value / 2 + 0.25)
    graph = depsgraph()
    assert frame_cache.scene_digest(scene, graph) != before
    setattr(scene.tetflora.year, name, value)
    assert frame_cache.scene_digest(scene, depsgraph()) == before


def test_refine_automatically_looks_again_on_other_days(scene, monkeypatch):
    asked = []
    monkeypatch.setattr(auto, "schedule", asked.append)
    scene.tetflora.auto_refine = True
    asked.clear()
    auto.on_frame(scene)
    assert asked == [scene]
    scene.tetflora.year.enabled = False
    auto.on_frame(scene)
    assert asked == [scene]


@pytest.mark.parametrize("name", ["day", "latitude", "years"])
def test_a_number_that_is_none_is_refused(scene, name):
    setattr(scene.tetflora.year, name, math.nan)
    label = scene.tetflora.year.bl_rna.properties[name].name
    with pytest.raises(errors.SceneError, match=f'Scene "Scene": {label} is nan; it must be'):
        contents.estimate(scene, depsgraph())


def test_the_panel_tells_the_date(scene):
    scene.tetflora.year.day = 287.0
    layout = Layout()
    panel.TETFLORA_PT_season.draw(SimpleNamespace(layout=layout), bpy.context)
    assert "14 October" in [options.get("text") for name, _, options in layout.drawn if name == "label"]


def test_bare_plants_are_thin_and_brown_in_previews(scene):
    scene.tetflora.preview.plants = 'LIGHT'

    def shown(day):
        scene.tetflora.year.day = day
        shapes = levels.read_shapes(scene, depsgraph())
        return np.ptp(shapes.positions[:, 0]), shapes.colors.astype(float)

    (bare, brown), (full, green) = shown(WINTER), shown(SUMMER)
    assert bare < 0.7 * full
    assert brown.max(axis=1).min() > 0.05
    assert (brown[0, 0] / brown[0, 1]) > (green[0, 0] / green[0, 1])
    scene.tetflora.year.enabled = False
    np.testing.assert_array_equal(shown(SUMMER)[1], green)
