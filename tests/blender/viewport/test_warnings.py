# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong before anybody renders is seen, and a click mends it; sun, sky and camera by one button each."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from types import SimpleNamespace

import blf
import bpy
import numpy as np
import pytest

from panels import outputs, refine
from tests.blender.scenes import add_camera, add_mesh, add_plant, select
from tetflora_addon import memory
from tetflora_addon.blender import runtime
from tetflora_addon.blender.biomes import layers
from tetflora_addon.blender.compat import shader_tree
from tetflora_addon.blender.job import forecast
from tetflora_addon.blender.placing import populations
from tetflora_addon.blender.viewport import auto, warnings
from tetflora_addon.blender.worker import calling
from tetflora_addon.emission.budget import Estimate

pytestmark = pytest.mark.usefixtures("clean_file")


def _keys():
    bpy.context.view_layer.update()
    return [one.key for one in warnings.warned(bpy.context)]


def _mend(key):
    assert bpy.ops.tetflora.mend(what=key) == {'FINISHED'}
    assert key not in _keys()


def test_an_empty_scene_has_nothing_to_mend():
    assert _keys() == []


def test_darkness_is_seen_and_daylight_ends_it():
    add_plant()
    add_camera()
    assert "light" in _keys()
    _mend("light")
    sun = next(o for o in bpy.context.scene.objects if o.type == 'LIGHT')
    assert sun.data.type == 'SUN' and sun.data.energy > 2.0


@pytest.mark.parametrize(("color", "dark"), [((0.05, 0.05, 0.05), True), ((0.5, 0.6, 0.9), False)])
def test_a_world_lights_by_its_color(color, dark):
    world = bpy.context.scene.world = bpy.data.worlds.new("own")
    shader_tree(world).nodes["Background"].inputs["Color"].default_value = (*color, 1.0)
    assert warnings.is_dark(bpy.context.scene, []) == dark


def test_daylight_never_touches_what_is_the_artists():
    scene = bpy.context.scene
    world = scene.world = bpy.data.worlds.new("own")
    shader_tree(world).nodes["Background"].inputs["Color"].default_value = (0.2, 0.3, 0.9, 1.0)
    sun = bpy.data.objects.new("mine", bpy.data.lights.new("mine", 'SUN'))
    sun.data.energy = 1.5
    scene.collection.objects.link(sun)
    bpy.ops.tetflora.daylight(hour=8.0)
    assert scene.world == world and sun.data.energy == 1.5
    assert [o for o in scene.objects if o.type == 'LIGHT'] == [sun]


@pytest.mark.parametrize("touched", [False, "moved", "dimmed", "animated"])
def test_daylight_hides_the_lamp_of_the_startup_file_but_none_of_the_artists(touched):
    scene = bpy.context.scene
    lamp = bpy.data.objects.new("Light", bpy.data.lights.new("Light", 'POINT'))
    lamp.data.energy, lamp.location = 1000.0, (4.076245, 1.005454, 5.903862)  # as in Blender's own file
    scene.collection.objects.link(lamp)
    if touched == "moved":
        lamp.location.x += 1.0
    elif touched == "dimmed":
        lamp.data.energy = 900.0
    elif touched:
        lamp.keyframe_insert("location", frame=1)
    bpy.ops.tetflora.daylight()
    assert lamp.hide_render == lamp.hide_viewport == (not touched)


def test_daylight_follows_hour_season_and_clouds():
    scene = bpy.context.scene
    energy, height = {}, {}
    for hour, clouds in ((12.0, 0.0), (20.0, 0.0), (12.0, 1.0)):
        bpy.ops.tetflora.daylight(hour=hour, clouds=clouds)
        (sun,) = [o for o in scene.objects if o.type == 'LIGHT']
        bpy.context.view_layer.update()
        energy[hour, clouds] = sun.data.energy
        height[hour, clouds] = sun.matrix_world.to_3x3().col[2].z
    assert energy[12.0, 0.0] > energy[20.0, 0.0] > 0.0
    assert energy[12.0, 1.0] == 0.0
    assert height[12.0, 0.0] == pytest.approx(np.sin(np.radians(61.0)), abs=0.03)  # at 50° north in July
    assert height[12.0, 0.0] > height[20.0, 0.0] > 0.0
    scene.tetflora.year.season = 'WINTER'
    bpy.ops.tetflora.daylight(hour=12.0)
    (sun,) = [o for o in scene.objects if o.type == 'LIGHT']
    bpy.context.view_layer.update()
    assert sun.matrix_world.to_3x3().col[2].z < height[12.0, 0.0]
    assert len(bpy.data.worlds) == 1


def test_the_camera_steps_out_of_a_crown_and_its_range_reaches_all_plants():
    scene = bpy.context.scene
    add_plant(species="bush")
    far = add_plant("far", species="bush", location=(0.0, 300.0, 0.0))
    camera = add_camera(location=(0.0, 0.0, 0.6))
    camera.data.clip_end = 100.0
    assert {"crown", "clip"} <= set(_keys())
    _mend("crown")
    assert np.hypot(*camera.matrix_world.translation[:2]) > 0.2
    assert camera.matrix_world.translation.z == pytest.approx(0.6, abs=1e-5)
    _mend("clip")
    assert scene.camera.data.clip_end > 300.0
    assert far.location.y == 300.0


def test_a_camera_below_the_ground_is_told_and_lifted():
    """After the ground was lifted it saw nothing but that from below, and was said to be in a dark wood."""
    ground = add_mesh("ground", size=50.0)
    select(ground)
    bpy.ops.tetflora.populate(count=3, min_distance=0.0, species="bush")
    camera = add_camera(location=(0.0, 0.0, 1.7))
    assert "below" not in _keys()
    ground.location.z, ground.scale.z = 6.0, 0.5
    assert "below" in _keys()
    assert "shade" not in _keys()
    _mend("below")
    assert tuple(camera.matrix_world.translation) == pytest.approx((0.0, 0.0, 7.7))
    camera.location.z = 3.0
    assert "below" in _keys()
    floor = add_mesh("floor", size=50.0)  # in a cave
    populations.set_grounds(bpy.context.scene.tetflora.layers[0], [ground, floor])
    assert "below" not in _keys()
    ground.hide_set(True)
    camera.location.z = -3.0
    floor.hide_set(True)
    assert "below" not in _keys()


def test_crowns_of_a_field_count_and_are_asked_for_by_species(monkeypatch):
    """Not by plant: ground cover has thousands around the camera, and looking took seconds after each change."""
    select(add_mesh("ground", size=16.0))
    bpy.ops.tetflora.populate(count=400, min_distance=0.0, species="bush:3, fern", as_field='FIELD')
    asked, crown_to_draw = [], warnings.crown_to_draw
    monkeypatch.setattr(warnings, "crown_to_draw", lambda scene, kind: asked.append(kind) or crown_to_draw(scene, kind))
    field = next(o for o in bpy.data.objects if o.tetflora.is_field)
    bush = next(n for n, one in enumerate(field.data.attributes["species"].data) if one.value == 0)
    foot = field.data.vertices[bush].co
    add_camera(location=(foot.x, foot.y, 0.5))
    assert "crown" in _keys()
    assert sorted(asked) == ["bush", "fern"]
    bpy.context.scene.camera.location.z = 10.0
    assert "crown" not in _keys()


def test_many_plants_are_looked_at_one_by_one_between_redraws():
    """At once, 100,000 of them stopped the window for a second."""
    for number in range(200):
        add_plant(f"plant {number}", location=(0.0, float(number), 0.0))
    add_camera(location=(0.0, -20.0, 1.7)).data.clip_end = 100.0
    bpy.context.view_layer.update()
    steps = warnings._steps(bpy.context.scene, bpy.context.view_layer)
    found, number = [], 0
    try:
        while True:
            next(steps)
            number += 1
    except StopIteration as stop:
        found = stop.value
    assert number >= 200
    assert [one.key for one in found] == _keys()
    assert {"clip", "light"} <= set(_keys())


def test_a_slow_first_look_does_not_delay_the_next(monkeypatch):
    clock, waits = [0.0], []
    monkeypatch.setattr(runtime, "time", SimpleNamespace(perf_counter=lambda: clock[0]))
    monkeypatch.setattr(runtime, "call_soon", lambda _function, seconds: waits.append(seconds))
    monkeypatch.setattr(runtime, "bpy", SimpleNamespace(app=SimpleNamespace(background=False), context=bpy.context))
    takes = iter((1.5, 0.01, 0.01, 2.0, 2.0, 0.0))

    def find(_scene, _layer):
        clock[0] += next(takes)

    outlook = runtime.Outlook(find)
    for _ in range(6):
        outlook.ask()
        outlook._look()
    assert waits == pytest.approx([0.2, 0.2, 0.3, 0.3, 0.3, 60.0])


def test_what_panels_say_draws_no_view_anew(monkeypatch):
    """Without a graphics card a view takes seconds, and while plants were refined it was drawn for each such text."""
    drawn, layer = [], bpy.context.view_layer
    windows = [SimpleNamespace(scene=bpy.context.scene, view_layer=layer)]
    context = SimpleNamespace(window_manager=SimpleNamespace(windows=windows))
    monkeypatch.setattr(runtime, "bpy", SimpleNamespace(context=context))
    monkeypatch.setattr(runtime, "redraw", lambda only="": drawn.append(only))
    runtime.Outlook(lambda _scene, _layer: "new")._look()
    assert drawn == ["UI"]


def test_grounds_that_are_small_or_scaled_are_mended():
    scene = bpy.context.scene
    small, scaled = add_mesh("small"), add_mesh("scaled", size=10.0)
    scaled.scale = (2.0, 2.0, 1.0)
    populations.add_population(scene, [small, scaled])
    assert {"small small", "scale scaled"} <= set(_keys())
    _mend("small small")
    assert small.dimensions.x == pytest.approx(100.0)
    _mend("scale scaled")
    assert tuple(scaled.scale) == (1.0, 1.0, 1.0)
    assert max(v.co.x for v in scaled.data.vertices) == pytest.approx(20.0)


@pytest.mark.parametrize("stand", [False, True])
def test_a_small_ground_is_mended_by_one_click_and_what_grows_on_it_is_due(stand):
    """Its plants stand where they stood, in the middle of a bare ground, and Update said that nothing was to do."""
    scene = bpy.context.scene
    small = add_mesh("small", size=4.0)
    select(small)
    scene.tetflora.stand.years, scene.tetflora.stand.density = 2, 2000.0
    made = bpy.ops.tetflora.grow_stand() if stand else bpy.ops.tetflora.populate(count=2, min_distance=1.0)
    assert made == {'FINISHED'}
    assert "small small" in _keys()
    assert layers.due_layers(scene) == []
    _mend("small small")
    assert small.dimensions.x == pytest.approx(100.0)
    assert tuple(small.scale) == (1.0, 1.0, 1.0)
    assert "scale small" not in _keys()
    assert len(layers.due_layers(scene)) == 1


def test_nothing_that_the_panel_says_is_cut_in_a_sidebar_of_usual_width(monkeypatch):
    """A mend read "Make 10...", and the memory of a forecast had no room; pixels are those of the window's sidebar."""
    blf.size(0, 11.0)
    calls = [node for node in ast.walk(ast.parse(Path(warnings.__file__).read_text())) if isinstance(node, ast.Call)]
    given = [call.args for call in calls if getattr(call.func, "id", "") == "Warned"]
    assert len(given) > 10
    for _, short, _, *button in given:
        assert blf.dimensions(0, f"{short.value} (+2)")[0] <= 97.0, short.value
        assert all(blf.dimensions(0, one.value)[0] <= 58.0 for one in button[:1]), button[0].value
    scene, layer = bpy.context.scene, bpy.context.view_layer
    found = Estimate(1, 870_000.0, 1500.0, 13.2 * memory.GIGABYTE, "")
    monkeypatch.setattr(forecast, "forecast_steps", lambda *_: calling(lambda: found))
    add_camera()
    said = [forecast.forecast_text(scene, layer), "Not refined: renders show no plants"]
    for names in (["the day or year", "settings"], ["the day or year"], ["settings"]):
        monkeypatch.setattr(auto, "changed_since", lambda _scene, names=names: names)
        said.append(refine.state_of(scene))
    coarse = {"polygons_meshed": 9e5, "polygons_proxy": 0, "coarser": "so", "facet_pixels": 1.3, "seconds": {}}
    monkeypatch.setattr(outputs, "rows_of", lambda _text: True)
    said.append(outputs.made_of(json.dumps(coarse)))
    assert [text for text in said if blf.dimensions(0, text)[0] > 204.0] == []
    assert all(said)


def test_the_panel_has_one_line_whatever_is_wrong():
    from devtools.layouts import Layout

    def lines():
        layout = Layout()
        context = SimpleNamespace(
            region=SimpleNamespace(width=300), scene=bpy.context.scene, view_layer=bpy.context.view_layer
        )
        refine.TETFLORA_PT_refine.draw(SimpleNamespace(layout=layout), context)
        return [name for name, *_ in layout.drawn if name in {"label", "prop"}]

    add_plant()
    add_camera()
    wrong = lines()
    bpy.ops.tetflora.daylight()
    bpy.context.scene.render.use_lock_interface = True
    assert lines() == wrong


@pytest.mark.parametrize("where", ['EYE', 'ABOVE'])
def test_a_camera_comes_to_the_ground_and_looks_at_it(where):
    scene = bpy.context.scene
    ground = add_mesh("ground", size=50.0, z=3.0)
    add_plant(location=(0.0, 0.0, 3.0))
    select(ground)
    assert bpy.ops.tetflora.look(where=where) == {'FINISHED'}
    bpy.context.view_layer.update()
    camera = scene.camera
    height = camera.matrix_world.translation.z - 3.0
    ahead = -camera.matrix_world.to_3x3().col[2]
    if where == 'EYE':
        assert height == pytest.approx(1.7, abs=1e-3)
        assert abs(ahead.z) < 0.2
    else:
        assert height > 20.0
        assert ahead.z < -0.4
    assert "crown" not in _keys() and "clip" not in _keys()


@pytest.mark.parametrize(("size", "ahead"), [(40.0, 30.0), (400.0, 55.0)])
def test_ground_lies_ahead_of_a_camera_at_eye_height(size, ahead):
    """On forty meters it stood in the middle, and saw little but the edge."""
    add_mesh("ground", size=size)
    bpy.ops.tetflora.look()
    bpy.context.view_layer.update()
    camera = bpy.context.scene.camera.matrix_world
    place, direction = camera.translation.xy, -camera.to_3x3().col[2].xy.normalized()
    assert max(map(abs, place)) <= size / 2.0
    assert max(map(abs, place + ahead * direction)) <= size / 2.0


@pytest.mark.parametrize("move", [bpy.ops.tetflora.look, lambda: warnings.mend(bpy.context.scene, "crown")])
def test_a_camera_at_eye_height_does_not_look_at_a_trunk(move):
    """In a beech forest a trunk two meters ahead filled four fifths of the picture."""
    add_mesh("ground", size=50.0)
    beeches = [add_plant(f"beech {y}", species="beech", location=(0.0, y, 0.0)) for y in (-3.0, -1.0, 2.0)]
    camera = add_camera(location=(0.0, -3.0, 1.7), rotation=(1.5708, 0.0, 0.0))
    move()
    bpy.context.view_layer.update()
    place, ahead = camera.matrix_world.translation, -camera.matrix_world.to_3x3().col[2]
    for beech in beeches:
        way = (beech.location - place).xy
        assert way.length > 5.0 or way.normalized() @ ahead.xy.normalized() < 0.9


def test_an_animated_camera_stays_and_nothing_to_stand_on_is_told():
    camera = add_camera(location=(5.0, 0.0, 2.0))
    with pytest.raises(RuntimeError, match="No mesh is visible to stand on"):
        bpy.ops.tetflora.look()
    camera.keyframe_insert("location", frame=1)
    add_mesh("ground", size=50.0)
    bpy.ops.tetflora.look()
    assert bpy.context.scene.camera != camera
    assert tuple(camera.location) == (5.0, 0.0, 2.0)


def test_a_mixed_wood_of_the_usual_density_is_dark_at_eye_height():
    """A first wood on one's own ground rendered nearly black, and nothing was to mend."""
    select(add_mesh("ground", size=50.0))
    bpy.ops.tetflora.populate(count=200, species="beech:1, rowan:1, spruce:1")
    bpy.ops.tetflora.daylight()
    bpy.ops.tetflora.look()
    assert _keys() == ["shade"]


def test_a_closed_wood_is_dark_inside_until_it_is_brightened():
    add_camera((0.0, 0.0, 1.7))
    beeches = [
        add_plant(f"{x} {y}", species="beech", location=(6.0 * x, 6.0 * y, 0.0)) for x in (-1, 1) for y in (-1, 1)
    ]
    assert "shade" not in _keys()
    for n, beech in enumerate(beeches * 5):
        near = beech.copy()
        near.location.x += 1.5 * n
        bpy.context.scene.collection.objects.link(near)
    _mend("shade")
    assert bpy.context.scene.view_settings.exposure > 2.0
