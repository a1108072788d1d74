# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refine at render: each frame gets its plants, and nothing of them stays."""

from __future__ import annotations

import contextlib
import json
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, depsgraph, tiny_render
from tetflora_addon import errors
from tetflora_addon.blender import compat, runtime
from tetflora_addon.blender.job import refine, render
from tetflora_addon.blender.materials import nodes
from tetflora_addon.blender.results import collection, hiding, proxy_kinds
from tetflora_addon.blender.scene import plants
from tetflora_addon.blender.scene.camera import read_camera

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def stage(tmp_path):
    """A camera above a plant, white sky, pictures in a temporary folder; gives the scene."""
    scene = tiny_render()
    add_camera(location=(0.0, 0.0, 10.0), rotation=(0.0, 0.0, 0.0))
    add_plant()
    world = bpy.data.worlds.new("sky")
    scene.world = world
    background = compat.shader_tree(world).nodes["Background"]
    background.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    scene.render.filepath = str(tmp_path / "frame_####")
    return scene


class _Stub:
    """A job that makes a black square below the camera and remembers what it was asked for."""

    def __init__(self):
        self.cameras, self.plants, self.error = [], [], None

    def __call__(self, scene, depsgraph, *, view_layer=None, for_render=False, **_options):
        assert for_render
        if self.error is not None:
            raise self.error
        camera = read_camera(scene, depsgraph)
        seeds = plants.read_plants(scene, depsgraph)[0]
        self.cameras.append(camera.position.round(4).tolist())
        self.plants.append(seeds.position.round(4).tolist())
        x, y, _ = camera.position
        square = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]) + [x, y, 0.0]
        mesh = bpy.data.meshes.new("square")
        mesh.from_pydata(square.tolist(), [], [(0, 1, 2, 3)])
        black = bpy.data.materials.new("black")
        tree = compat.shader_tree(black)
        tree.nodes.clear()
        holdout = tree.nodes.new("ShaderNodeEmission")
        holdout.inputs["Strength"].default_value = 0.0
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(holdout.outputs["Emission"], output.inputs["Surface"])
        mesh.materials.append(black)
        results = collection.Results(scene, 'RENDER')
        results.open()
        made = bpy.data.objects.new("square", mesh)
        for datablock in (mesh, made, black):
            nodes.tag(datablock)
        results.collection.objects.link(made)
        results.finish()
        return refine.Statistics()


@pytest.fixture
def stub(monkeypatch):
    stub = _Stub()
    monkeypatch.setattr(refine, "refine", stub)
    return stub


def _center(path) -> float:
    """Mean of the middle of a picture: 0 where the square is, 1 where it is not."""
    image = bpy.data.images.load(str(path))
    try:
        pixels = np.array(image.pixels).reshape(image.size[1], image.size[0], -1)
        return float(pixels[7:9, 7:9, :3].mean())
    finally:
        bpy.data.images.remove(image)


def _still(scene, path):
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return _center(path)


def test_animations_are_refined_for_the_camera_and_plants_of_each_frame(stage, stub, tmp_path):
    for obj, way in ((stage.camera, (6.0, 0.0, 10.0)), (bpy.data.objects["plant"], (0.0, 4.0, 0.0))):
        obj.keyframe_insert("location", frame=1)
        obj.location = way
        obj.keyframe_insert("location", frame=3)
    stage.frame_start, stage.frame_end = 1, 3
    before = datablocks()
    bpy.ops.render.render(animation=True)
    assert [c[0] for c in stub.cameras] == [0.0, 3.0, 6.0]
    assert [p[0][1] for p in stub.plants] == [0.0, 2.0, 4.0]
    assert [_center(tmp_path / f"frame_{n:04d}.png") for n in (1, 2, 3)] == [0.0] * 3
    assert datablocks() == before


@pytest.mark.parametrize("draws", [False, True])
def test_a_frame_is_made_in_the_main_thread_while_nothing_locks_the_window(
    stage, stub, tmp_path, draws, monkeypatch, capfd
):
    """Which waits for it, and so cannot draw; and the artist is told which setting does without."""
    handed = []

    def in_main_thread(function=lambda: None):
        handed.append(getattr(function, "func", function))
        return function()

    monkeypatch.setattr(render, "window_draws", lambda: draws)
    monkeypatch.setattr(render, "in_main_thread", in_main_thread)
    assert _still(stage, tmp_path / "a.png") == 0.0
    assert (render._make in handed) == draws
    said = capfd.readouterr().err
    assert said.count(f'Lock Interface of the scene "{stage.name}" is off') == draws


@pytest.mark.parametrize("persistent", [False, True])
def test_stills_leave_nothing_behind_render_after_render(stage, stub, tmp_path, persistent):
    stage.render.use_persistent_data = persistent
    before = datablocks()
    for n in range(3):
        stage.camera.location.x = 5.0 * n
        assert _still(stage, tmp_path / f"{n}.png") == 0.0
        assert datablocks() == before
    assert [c[0] for c in stub.cameras] == [0.0, 5.0, 10.0]


def test_a_scene_without_the_setting_or_without_plants_is_left_alone(stage, stub, tmp_path):
    stage.tetflora.refine_at_render = False
    assert _still(stage, tmp_path / "a.png") == pytest.approx(1.0, abs=0.3)
    stage.tetflora.refine_at_render = True
    bpy.data.objects.remove(bpy.data.objects["plant"])
    _still(stage, tmp_path / "b.png")
    assert stub.cameras == []
    assert render.render_errors() == []


def test_a_render_that_will_show_no_plants_says_so_once(stage, tmp_path, capfd):
    """And says nothing where somebody refined, or kept the meshes."""
    stage.tetflora.refine_at_render = False
    for _ in range(2):
        _still(stage, tmp_path / "a.png")
    assert capfd.readouterr().err.count("nothing is refined") == 2
    assert render.render_errors() == []
    refine.refine(stage, bpy.context.evaluated_depsgraph_get())
    _still(stage, tmp_path / "b.png")
    hiding.keep_results(stage)
    _still(stage, tmp_path / "c.png")
    assert "nothing is refined" not in capfd.readouterr().err


def test_the_window_says_how_far_plants_are_until_they_are_there(stage, monkeypatch, tmp_path):
    said = []
    monkeypatch.setattr(render, "later", lambda function: said.append(getattr(function, "args", ("",))[0]))
    monkeypatch.setattr(render, "_OFTEN", 0.0)
    _still(stage, tmp_path / "a.png")
    assert len(said) > 3 and said[-1] == "" and "" not in said[:-1]
    assert any("Making polygons" in text for text in said) and all(text.startswith("TetFlora ") for text in said[:-1])
    said.clear()
    bpy.data.objects["plant"].tetflora.enabled = False
    _still(stage, tmp_path / "b.png")
    assert said[-1] == ""


def test_status_bars_and_the_picture_that_is_rendered_show_a_text(monkeypatch):
    """As far as there are windows; a text of none takes it away."""
    shown, usual = [], []

    def editor(kind, *image):
        active = SimpleNamespace(image=next((SimpleNamespace(type=one) for one in image), None))
        return SimpleNamespace(type=kind, spaces=SimpleNamespace(active=active), header_text_set=shown.append)

    areas = [editor('IMAGE_EDITOR', 'RENDER_RESULT'), editor('IMAGE_EDITOR', 'IMAGE'), editor('IMAGE_EDITOR')]
    screen = SimpleNamespace(areas=[*areas, SimpleNamespace(type='VIEW_3D')])
    window = SimpleNamespace(screen=screen, workspace=SimpleNamespace(status_text_set=usual.append))
    context = SimpleNamespace(temp_override=lambda **_: contextlib.nullcontext())
    context.window_manager = SimpleNamespace(windows=[window])
    monkeypatch.setattr(runtime, "bpy", SimpleNamespace(context=context))
    runtime.show_status("half   |   keys")
    runtime.show_status()
    assert shown == ["half", None] and usual == ["half   |   keys", None]


def test_panels_learn_what_the_refinement_of_a_render_took(stage, monkeypatch, tmp_path):
    learned = []
    monkeypatch.setattr(render, "learn", lambda expected, seconds: learned.append(seconds))
    monkeypatch.setattr(render, "redraw", lambda: learned.append("redrawn"))
    _still(stage, tmp_path / "a.png")
    took = sum(json.loads(stage.tetflora.statistics)["seconds"].values())
    assert learned == [pytest.approx(took), "redrawn"]
    stage.tetflora.refine_at_render = False
    _still(stage, tmp_path / "b.png")
    assert len(learned) == 2


def test_a_scene_that_undo_took_is_left_alone():
    """What was to be shown again in it, as soon as the main thread looks."""
    scene = bpy.data.scenes.new("other")
    bpy.data.scenes.remove(scene)
    render._take_back(scene)


def test_disabled_plants_are_no_error(stage, tmp_path):
    bpy.data.objects["plant"].tetflora.enabled = False
    _still(stage, tmp_path / "a.png")
    assert render.render_errors() == []


def _refined_by_hand(scene):
    """A result of Refine that covers the picture, as if made for another view."""
    results = collection.Results(scene, 'VIEW')
    results.open()
    cover = add_mesh("cover", size=50.0, z=5.0)
    nodes.tag(cover)
    nodes.tag(cover.data)
    results.collection.objects.link(cover)
    scene.collection.objects.unlink(cover)
    results.finish()
    return results.collection


def test_results_made_by_hand_are_hidden_while_rendering_only(stage, stub, tmp_path):
    made = _refined_by_hand(stage)
    # The black square on the ground is seen, not the cover above it.
    assert _still(stage, tmp_path / "a.png") == 0.0
    assert not made.hide_render
    assert [o.name for o in made.objects] == ["cover"]
    stage.tetflora.refine_at_render = False
    assert _still(stage, tmp_path / "b.png") > 0.0


def test_an_error_is_said_and_earlier_results_are_rendered(stage, stub, tmp_path, capfd):
    made = _refined_by_hand(stage)
    stub.error = errors.SpeciesError('Unknown species "quercus"')
    covered = _still(stage, tmp_path / "a.png")
    assert covered > 0.0
    assert not made.hide_render
    assert len(render.render_errors()) == 1
    assert 'TetFlora: error: frame 1 was rendered without plants: Unknown species "quercus"' in capfd.readouterr().err
    stub.error = None
    _still(stage, tmp_path / "b.png")
    assert render.render_errors() == []


def test_scenes_in_a_sequencer_forget_no_errors(stage, stub):
    stub.error = errors.SpeciesError('Unknown species "quercus"')
    outer, empty = bpy.data.scenes.new("outer"), bpy.data.scenes.new("empty")
    render.on_render_init(outer)
    for inner in (stage, empty):  # in the order in which Blender calls: a render within each frame of the other
        render.on_render_pre(outer)
        render.on_render_init(inner)
        render.on_render_pre(inner)
        render.on_render_end(inner)
    render.on_render_end(outer)
    assert len(render.render_errors()) == 1
    render.on_render_init(outer)
    assert render.render_errors() == []


def test_bounces_of_each_scene_come_back(stage, stub):
    other = bpy.data.scenes.new("other")
    other.camera = stage.camera
    other.collection.objects.link(bpy.data.objects["plant"])
    for n, scene in enumerate((stage, other)):
        scene.tetflora.proxy_kind = 'SHELLS'
        scene.cycles.transparent_max_bounces = 10 + n
        render.on_render_pre(scene)
        assert scene.cycles.transparent_max_bounces > 100
    for scene in (other, stage):
        render.on_render_end(scene)
    assert [scene.cycles.transparent_max_bounces for scene in (stage, other)] == [10, 11]


@pytest.mark.parametrize("refined_before", [False, True])
def test_eevee_traces_rays_while_plants_are_rendered(stage, stub, refined_before):
    """Or the sky would shine into crowns. A choice of the artist's among the methods of tracing stays."""
    stage.render.engine, eevee = compat.eevee_engine(), stage.eevee
    stage.tetflora.refine_at_render = not refined_before
    if refined_before:
        results = collection.Results(stage, 'VIEW')
        results.open()
        results.finish()
    for traced, fast in ((False, False), (False, True), (True, False)):
        eevee.use_raytracing, eevee.use_fast_gi = traced, fast
        render.on_render_pre(stage)
        assert (eevee.use_raytracing, eevee.use_fast_gi) == (True, not traced or fast)
        render.on_save_pre("")
        assert (eevee.use_raytracing, eevee.use_fast_gi) == (traced, fast)
        render.on_save_post("")
        assert eevee.use_raytracing
        render.on_render_end(stage)
        assert (eevee.use_raytracing, eevee.use_fast_gi) == (traced, fast)


def test_eevee_without_plants_is_as_the_artist_set_it(stage, stub):
    bpy.data.objects.remove(bpy.data.objects["plant"])
    stage.render.engine, stage.eevee.use_raytracing = compat.eevee_engine(), False
    render.on_render_pre(stage)
    assert not stage.eevee.use_raytracing
    render.on_render_end(stage)


def test_a_scene_that_is_deleted_in_the_middle_of_a_render_stops_neither_saving_nor_its_end(stage, stub):
    stage.render.engine = 'CYCLES'
    stage.tetflora.proxy_kind = 'SHELLS'
    stage.cycles.transparent_max_bounces = 10
    other = bpy.data.scenes.new("other")
    render.on_render_pre(stage)
    assert stage.cycles.transparent_max_bounces > 10
    bpy.data.scenes.remove(stage)
    render.on_save_pre("")
    render.on_save_post("")
    render.on_render_end(other)
    render._rendering.outer = 0
    render.on_load_post("")


def test_an_unexpected_error_does_not_stop_later_frames(stage, stub, tmp_path, capfd):
    stub.error = ZeroDivisionError("oops")
    _still(stage, tmp_path / "a.png")
    assert "ZeroDivisionError" in capfd.readouterr().err
    assert len(render.render_errors()) == 1
    stub.error = None
    assert _still(stage, tmp_path / "b.png") == 0.0


def test_a_file_saved_in_the_middle_of_a_render_holds_nothing_of_it(stage, stub, tmp_path):
    hand = _refined_by_hand(stage)
    stage.tetflora.output.save_results = True
    path = str(tmp_path / "middle.blend")
    seen = []

    def save(_scene, _depsgraph=None):
        seen.append((hand.hide_render, len(bpy.data.objects)))
        bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
        seen.append((hand.hide_render, len(bpy.data.objects)))

    bpy.app.handlers.render_post.append(save)
    try:
        _still(stage, tmp_path / "a.png")
    finally:
        bpy.app.handlers.render_post.remove(save)
    assert seen[0] == seen[1] == (True, 4)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert sorted(o.name for o in bpy.data.objects) == ["camera", "cover", "plant"]
    assert [c.name for c in bpy.data.collections] == ["TetFlora"]
    assert not bpy.data.collections[0].hide_render


def test_a_file_saved_in_the_middle_of_a_render_holds_meshes_as_the_artist_left_them(stage, tmp_path):
    """And the render goes on without them; a mark that a crash left behind is taken back on load."""
    rock, path = add_mesh("rock"), str(tmp_path / "middle.blend")
    rock.tetflora.is_explicit = True
    render.on_render_pre(stage)
    mark = rock["tetflora_hidden_for_render"]
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    assert (rock.hide_render, rock["tetflora_hidden_for_render"]) == (True, mark)
    render.on_render_end(stage)
    assert not rock.hide_render
    with bpy.data.libraries.load(path) as (_, wanted):
        wanted.objects = ["rock"]
    (stored,) = wanted.objects
    assert not stored.hide_render
    assert "tetflora_hidden_for_render" not in stored
    rock["tetflora_hidden_for_render"], rock.hide_render = mark, True  # as a crash leaves it
    render.on_load_post("")
    assert not rock.hide_render
    assert "tetflora_hidden_for_render" not in rock


def test_a_library_override_comes_back_after_its_file_was_saved_and_read(stage, tmp_path):
    """Blender stores that it is hidden, but not the property that says how it was."""
    rock, library, path = add_mesh("rock"), str(tmp_path / "rocks.blend"), str(tmp_path / "forest.blend")
    rock.tetflora.is_explicit = True
    bpy.data.libraries.write(library, {rock})
    bpy.data.batch_remove([rock])
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["rock"]
    override = wanted.objects[0].override_create(remap_local_usages=True)
    stage.collection.objects.link(override)
    stage.tetflora.output.save_results = True
    refine.refine(stage, depsgraph())
    assert override.hide_render
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert "tetflora_hidden_overrides" not in stage
    bpy.ops.wm.open_mainfile(filepath=path)
    scene, rock = bpy.context.scene, bpy.data.objects["rock", None]
    assert rock.hide_render
    assert "tetflora_hidden_overrides" not in scene
    refine.clear(scene)
    assert not (rock.hide_render or rock.hide_viewport)


def test_the_real_job_puts_plants_into_the_picture_and_leaves_none_behind(stage, tmp_path):
    before = datablocks()
    stage.camera.location.z = 6.0
    with_plant = _still(stage, tmp_path / "a.png")
    assert datablocks() == before
    figures = json.loads(stage.tetflora.statistics)
    assert figures["plants"] == 1
    stage.tetflora.refine_at_render = False
    assert with_plant < 0.9 * _still(stage, tmp_path / "b.png")
    assert render.render_errors() == []


@pytest.mark.parametrize("baked", ['OFF', 'PROXIES'])
def test_shells_are_rendered_with_enough_transparent_bounces_and_the_settings_come_back(stage, tmp_path, baked):
    """Baked shells need as many as others do."""
    scene = bpy.context.scene
    scene.cycles.transparent_max_bounces, scene.cycles.min_transparent_bounces = 8, 2
    scene.tetflora.proxy_kind, scene.tetflora.baked_light = 'SHELLS', baked
    assert "renders shells black" in proxy_kinds.few_bounces(scene)
    seen = []

    def read(*_):
        seen.append((scene.cycles.transparent_max_bounces, scene.cycles.min_transparent_bounces))

    bpy.app.handlers.render_post.append(read)
    try:
        scene.render.filepath = str(tmp_path / "shells.png")
        bpy.ops.render.render(write_still=True)
    finally:
        bpy.app.handlers.render_post.remove(read)
    assert seen == [(256, 256)]
    assert (scene.cycles.transparent_max_bounces, scene.cycles.min_transparent_bounces) == (8, 2)
    scene.cycles.transparent_max_bounces = 128
    assert not proxy_kinds.few_bounces(scene)


def test_baked_light_is_made_for_each_render_and_outlives_the_file(stage, tmp_path):
    scene = bpy.context.scene
    scene.tetflora.baked_light = 'ALL'
    before = datablocks()
    _still(scene, tmp_path / "baked.png")
    assert "light" in json.loads(scene.tetflora.statistics)["seconds"]
    assert datablocks() == before
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "baked.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "baked.blend"))
    assert bpy.context.scene.tetflora.baked_light == 'ALL'


def test_a_scene_that_is_renamed_in_the_middle_of_a_render_is_left_as_it_was(stage, stub):
    stage.render.engine = 'CYCLES'
    stage.tetflora.proxy_kind = 'SHELLS'
    stage.cycles.transparent_max_bounces = 10
    render.on_render_pre(stage)
    assert stage.cycles.transparent_max_bounces > 10
    stage.name = "renamed"
    render.on_render_end(stage)
    assert stage.cycles.transparent_max_bounces == 10
    assert not render._rendering.outer and not collection.result_collections(stage, 'RENDER')
