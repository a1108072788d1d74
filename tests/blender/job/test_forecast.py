# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The line about what refining will take: plants of all kinds of storage count, and changes show."""

from __future__ import annotations

import re
import sys

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, select
from tetflora_addon import memory
from tetflora_addon.blender.job import contents, forecast, refine
from tetflora_addon.blender.scene.camera import read_camera
from tetflora_addon.jobs import run_to_end
from tetflora_addon.processes import pool

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture(autouse=True)
def _afresh():
    forecast._on_load()


def _forecast():
    bpy.context.view_layer.update()
    bpy.context.evaluated_depsgraph_get()
    return forecast.forecast(bpy.context.scene, bpy.context.view_layer)


def _wood(count, **options):
    ground = add_mesh("ground", size=60.0)
    select(ground)
    bpy.ops.tetflora.populate(count=count, **{"min_distance": 0.0, "species": "birch", **options})


def test_without_camera_or_plants_there_is_nothing_to_tell():
    assert _forecast() is None
    add_camera()
    assert _forecast() is None
    assert forecast.forecast_text(bpy.context.scene, bpy.context.view_layer) == ""
    add_plant(species="birch")
    assert _forecast().plants == 1
    bpy.context.scene.camera = None
    assert _forecast() is None


def test_the_last_run_teaches_the_next_estimate():
    add_camera()
    add_plant(species="birch")
    found = _forecast()
    shown = bpy.context.scene, bpy.context.view_layer
    forecast.learn(found, 60.0 * found.seconds)
    assert forecast.seconds_text(60.0 * found.seconds) in forecast.forecast_text(*shown)
    forecast.learn(found, 0.01)  # too short to tell
    forecast.learn(None, 1000.0)
    assert forecast.seconds_text(60.0 * found.seconds) in forecast.forecast_text(*shown)
    forecast._on_load()
    assert forecast.seconds_text(found.seconds) in forecast.forecast_text(*shown)


def test_a_run_teaches_though_crowns_were_not_known_when_it_began(monkeypatch):
    add_camera()
    add_plant(species="birch")
    operator, unknown, taught = sys.modules[bpy.types.TETFLORA_OT_refine.__module__], [None], []
    monkeypatch.setattr(operator, "forecast", lambda *given: unknown.pop() if unknown else forecast.forecast(*given))
    monkeypatch.setattr(operator, "learn", lambda expected, _: taught.append(expected.plants))
    bpy.ops.tetflora.refine()
    assert taught == [1]


def test_while_crowns_are_looked_for_a_text_says_so(monkeypatch):
    add_camera()
    add_plant(species="birch")
    monkeypatch.setattr(forecast, "crown_to_draw", lambda *_, **__: None)
    assert run_to_end(forecast._text_for(bpy.context.scene, bpy.context.view_layer)) == "Estimating…"


@pytest.mark.parametrize("hidden", [False, True])
def test_many_plants_are_counted_one_by_one_between_redraws(hidden):
    """At once, 100,000 of them stopped the window for a fifth of a second."""
    add_camera()
    away = bpy.data.collections.new("away")
    bpy.context.scene.collection.children.link(away)
    away.hide_render = hidden
    for number in range(150):
        add_plant(f"plant {number}", location=(0.0, float(number), 0.0))
        add_plant(f"other {number}", location=(1.0, float(number), 0.0), collection=away)
    expected = _forecast()
    assert expected.plants == (150 if hidden else 300)
    forecast._on_change()
    shown, steps = (bpy.context.scene, bpy.context.view_layer), 0
    found = forecast.forecast_steps(*shown)
    try:
        while True:
            next(found)
            steps += 1
    except StopIteration as stop:
        assert stop.value.plants == expected.plants
    assert steps >= expected.plants


@pytest.mark.parametrize("as_field", ["EMPTIES", "FIELD"])
def test_plants_of_both_kinds_count_alike(as_field):
    add_camera()
    _wood(300, as_field=as_field, species="birch:3, bush:1")
    found = _forecast()
    assert found.plants == 300
    empties = {'EMPTIES': found}.get(as_field)
    if empties is None:
        bpy.ops.tetflora.convert_plants(to='OBJECTS')
        empties = _forecast()
    assert found.primitives == pytest.approx(empties.primitives, rel=0.01)
    assert found.primitives > 10_000


def test_what_is_expanded_takes_what_was_told():
    """Plants at hand have up to a hundred times the polygons of the same ones from afar."""
    add_camera(location=(0.0, -2.0, 1.7))
    for number in range(3):
        add_plant(f"p{number}", seed=number, location=(1.5 * number - 1.5, 0.0, 0.0))
    scene = bpy.context.scene
    scene.tetflora.expand_everything = True
    found = _forecast()
    made = refine.refine(scene, depsgraph()).polygons_meshed
    assert 1 / 1.5 < found.primitives / made < 1.5


@pytest.mark.parametrize("kind", ["beech", "hornbeam"])
def test_trees_with_the_narrow_crowns_of_a_stand_have_its_few_leaves(kind):
    """Those of a grown beech wood counted with fifty times their leaves: 1.66 times what was made was expected."""
    add_camera()
    _wood(20, as_field='FIELD', species=kind)
    points = next(obj for obj in bpy.data.objects if obj.tetflora.is_field).data
    leaves = {}
    for name, width in (("narrow", 5.0), ("free", 16.0)):
        for attribute, value in (("tf_height", 20.0), ("tf_crown_width", width)):
            values = points.attributes.get(attribute) or points.attributes.new(attribute, 'FLOAT', 'POINT')
            values.data.foreach_set("value", np.full(20, value, np.float32))
        forecast._layer = None
        _forecast()
        stand = forecast._stand
        leaves[name] = stand.number @ (np.array([crown.leaves for crown in stand.crowns])[stand.which] * stand.scale**2)
    assert 0.0 < leaves["narrow"] < 0.3 * leaves["free"]


def test_large_fields_are_known_by_a_sample():
    add_camera()
    _wood(30_000, as_field='FIELD')
    found = _forecast()
    assert found.plants == 30_000
    assert len(forecast._stand.foot) == forecast._LOOKED_AT
    add_plant(species="oak")
    assert _forecast().plants == 30_001


def test_few_trees_are_not_lost_in_much_cover():
    """Two of a hundred were looked at beside the cover of First Forest."""
    add_camera()
    _wood(30_000, as_field='FIELD', species="bush")
    for number in range(40):
        add_plant(f"p{number}", species="birch", location=(0.5 * number, 9.0, 0.0))
    assert _forecast().plants == 30_040
    stand = forecast._stand
    trees = stand.radius > 1.5
    assert 20 <= trees.sum() <= 40 and len(stand.foot) <= forecast._LOOKED_AT + 1
    assert stand.number[trees].sum() == pytest.approx(40.0)


def test_instances_of_collections_count():
    add_camera()
    plant = add_plant(species="birch")
    trees = bpy.data.collections.new("trees")
    trees.objects.link(plant)
    bpy.context.scene.collection.objects.unlink(plant)
    for number in range(3):
        copy = bpy.data.objects.new(f"copy {number}", None)
        copy.instance_type, copy.instance_collection = 'COLLECTION', trees
        bpy.context.scene.collection.objects.link(copy)
    assert _forecast().plants == 3


def test_what_does_not_render_does_not_count():
    add_camera()
    plants = [add_plant(f"p{i}", species="birch") for i in range(4)]
    plants[0].hide_render = True
    plants[1].tetflora.enabled = False
    assert _forecast().plants == 2
    add_plant("missing", species="gone")
    assert _forecast().plants == 3


def test_settings_and_camera_show_at_once():
    camera = add_camera()
    _wood(500)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 1920, 1080
    before = _forecast()
    scene.render.resolution_percentage *= 2
    # Leaves that are large enough to be drawn as they are do not become more.
    assert _forecast().primitives > before.primitives
    scene.render.resolution_percentage //= 2
    scene.tetflora.quality = 'DRAFT'
    assert _forecast().primitives <= before.primitives
    scene.tetflora.quality = 'FINAL'
    scene.tetflora.max_polygons = 1000
    assert 700 < _forecast().primitives < 1000
    scene.tetflora.max_polygons = 0
    scene.tetflora.expand_everything = True
    assert _forecast().primitives > 20_000_000
    scene.tetflora.expand_everything = False
    camera.rotation_euler = (3.14159, 0.0, 0.0)
    assert _forecast().primitives < before.primitives


def test_what_a_limit_leaves_is_what_is_drawn():
    """Of birches and spruces at full HD a third fewer were drawn than the panel said, with half of the memory."""
    add_camera((0.0, -60.0, 10.0))
    _wood(200)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 640, 360
    scene.tetflora.max_polygons = 60_000
    expected = _forecast()
    made = refine.refine(scene, depsgraph())
    assert expected.limit == "Max Polygons"
    assert made.polygons_meshed + made.polygons_proxy == pytest.approx(expected.primitives, rel=0.15)


def test_an_estimate_makes_nothing_in_the_file_where_the_camera_moves():
    camera = add_camera()
    _wood(50)
    scene = bpy.context.scene
    before = _forecast()
    for frame in (0, 2):
        camera.location.x = frame
        camera.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    camera.location.x = 0.0
    used = []
    for scene.render.use_motion_blur in (False, True):
        first = bpy.data.texts.new("number").session_uid
        assert _forecast().primitives == pytest.approx(before.primitives, rel=0.1)
        used.append(bpy.data.texts.new("number").session_uid - first)
    assert used[0] == used[1]


def test_the_text_says_that_it_is_an_estimate(monkeypatch):
    add_camera()
    _wood(500)
    scene, layer = bpy.context.scene, bpy.context.view_layer
    _forecast()
    text = forecast.forecast_text(scene, layer)
    assert re.fullmatch(r"About \d+ (s|min), [\d.,]+( [kM])? polygons, (\d\.\d|\d\d+) GB", text)
    scene.tetflora.max_polygons = 1000
    assert forecast.forecast_text(scene, layer).endswith("\nLimited by Max Polygons")
    scene.tetflora.max_polygons, scene.tetflora.max_memory = 0, 0.01
    monkeypatch.setattr(memory, "LEAST", 1e5)
    assert forecast.forecast_text(scene, layer).endswith("\nLimited by Max Memory")


@pytest.mark.parametrize(
    ("seconds", "shown"),
    [(0.2, "1 s"), (7.4, "7 s"), (33.0, "35 s"), (100.0, "2 min"), (3000.0, "50 min"), (9000.0, "2.5 h")],
)
def test_times_are_rounded(seconds, shown):
    assert forecast.seconds_text(seconds) == shown


@pytest.mark.parametrize(
    ("number", "shown"),
    [
        *((0.0, "0"), (987.0, "990"), (8_449.0, "8,400"), (123_456.0, "120 k"), (999_999.0, "1 M")),
        *((4_120_000.0, "4.1 M"), (3.66e7, "37 M"), (4.42e9, "4,400 M"), (3e12, "3,000,000 M")),
    ],
)
def test_polygons_are_rounded(number, shown):
    assert forecast.polygons_text(number) == f"{shown} polygons"


def test_the_automatic_limit_is_told(monkeypatch):
    scene = bpy.context.scene
    monkeypatch.setattr(memory, "total", lambda: 23_400_000_000)
    assert forecast.memory_text(scene) == "Automatic: 11.7 GB"
    scene.tetflora.max_memory = 4.0
    assert forecast.memory_text(scene) == "4.0 GB by the preferences"
    scene.tetflora.max_memory = 0.0
    monkeypatch.setattr(memory, "total", lambda: None)
    assert forecast.memory_text(scene) == "Automatic: no limit"


def test_plants_are_counted_again_only_when_something_has_changed(monkeypatch):
    add_camera()
    add_plant(species="birch")
    assert _forecast().plants == 1
    counted, count = [], forecast._count
    monkeypatch.setattr(forecast, "_count", lambda *given: counted.append(1) or count(*given))
    for _ in range(3):
        assert forecast.forecast(bpy.context.scene, bpy.context.view_layer).plants == 1
    assert not counted
    add_plant("other", species="birch")
    assert _forecast().plants == 2 and counted


def test_denoising_needs_memory_that_results_cannot_have(monkeypatch):
    add_camera()
    scene = bpy.context.scene
    monkeypatch.setattr(memory, "resident", lambda: 1_000_000_000)
    scene.render.engine, scene.tetflora.max_memory = 'CYCLES', 4.0
    bpy.context.view_layer.update()
    seen = read_camera(scene, bpy.context.evaluated_depsgraph_get())
    scene.cycles.use_denoising = False
    plain = contents.memory_left(scene, seen)
    scene.cycles.use_denoising = True
    denoised = contents.memory_left(scene, seen)
    pixels = seen.width * seen.height
    assert plain == 3e9 - pixels * memory.BYTES_PER_PIXEL - pool.share(4e9)
    assert plain - denoised == pixels * memory.BYTES_PER_DENOISED_PIXEL
