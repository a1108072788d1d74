# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The job: what it makes, replaces and takes back, and that the refined picture is the picture of the plants."""

from __future__ import annotations

import json
import threading
from collections import deque

import bpy
import numpy as np
import pytest

from tests.blender.renders import picture
from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks
from tetflora_addon import errors
from tetflora_addon.blender import compat, worker
from tetflora_addon.blender.attributes import read
from tetflora_addon.blender.job import contents, refine
from tetflora_addon.blender.results.collection import has_results
from tetflora_addon.blender.species.edits import species_data, store_species

pytestmark = pytest.mark.usefixtures("clean_file")


def _forest(count=3):
    """Some trees, and one far away that is proxies only."""
    add_camera(location=(0.0, -60.0, 4.0))
    for i in range(count):
        add_plant(f"tree {i}", seed=i, location=(4.0 * i - 4.0, 500.0 if i == 0 else 3.0 * i, 0.0))
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 320, 240
    return scene


def _refine(scene, **settings):
    for name, value in settings.items():
        setattr(scene.tetflora, name, value)
    return refine.refine(scene, bpy.context.evaluated_depsgraph_get())


def _made(scene):
    return [o for o in scene.objects if o.get("tetflora_kind", "species") != "species"]


def test_clear_removes_all_that_was_made_and_nothing_else():
    scene = _forest()
    before = datablocks()
    _refine(scene)
    assert _made(scene)
    assert has_results(scene)
    refine.clear(scene)
    assert datablocks() == before
    assert not has_results(scene)


def test_refining_again_replaces():
    scene = _forest()
    first = _refine(scene)
    names = datablocks()
    assert "TetFlora" in names["collections"]
    second = _refine(scene)
    assert datablocks() == names  # not with numbers after them, as long as the earlier ones had them
    for key, value in first.as_dict().items():
        if key == "steps":
            assert [{**s, "seconds": 0} for s in second.as_dict()[key]] == [{**s, "seconds": 0} for s in value]
            assert len(value) == first.passes
        elif key != "seconds":
            assert second.as_dict()[key] == value


def test_statistics_say_what_is_in_the_scene():
    scene = _forest()
    statistics = _refine(scene)
    meshed = sum(len(o.data.polygons) for o in _made(scene) if o["tetflora_kind"] in {"leaf", "bark"})
    proxies = [o for o in _made(scene) if o["tetflora_kind"] == "proxy"]
    assert statistics.polygons_meshed == meshed > 0
    assert all(len(o.data.materials) == 1 for o in proxies)
    # Where Python cannot resize point clouds, nodes make them of the vertices of a mesh without faces.
    numbers = [
        (len(o.data.polygons) or len(o.data.vertices)) if o.type == 'MESH' else len(o.data.points) for o in proxies
    ]
    assert statistics.polygons_proxy == sum(numbers) > 0
    assert statistics.plants == 3
    assert json.loads(scene.tetflora.statistics) == json.loads(json.dumps(statistics.as_dict()))


@pytest.mark.parametrize("form", ['MICROSURFACES', 'SHELLS'])
def test_the_result_fits_the_budget(form):
    """In the scene, not in expectation; and the statistics say how coarse the facets became."""
    scene = _forest()
    free = _refine(scene, proxy_kind=form, leaf_limit=0.2)
    whole = free.polygons_meshed + free.polygons_proxy
    for share in (0.5, 0.2):
        fitted = _refine(scene, max_polygons=int(share * whole))
        faces = sum(len(o.data.polygons) for o in _made(scene))
        assert faces == fitted.polygons_meshed + fitted.polygons_proxy <= share * whole
        assert fitted.polygons_meshed < free.polygons_meshed
        assert (fitted.facet_pixels >= free.facet_pixels > 0) == (form == 'MICROSURFACES')


def test_shadows_of_what_is_behind_the_camera_are_refined_if_asked_for():
    """A tree behind the camera, the sun behind the tree: its shadow is in the picture."""
    camera = add_camera(location=(0.0, -12.0, 4.0))
    camera.rotation_euler = (1.2, 0.0, 0.0)
    add_plant("tree", location=(0.0, -18.0, 0.0))
    scene = bpy.context.scene
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", 'SUN'))
    sun.rotation_euler = (1.52, 0.0, 0.0)  # low: all of the shadow falls to where the camera looks
    scene.collection.objects.link(sun)
    scene.render.resolution_x, scene.render.resolution_y = 320, 240
    coarse = _refine(scene)
    fine = _refine(scene, shadow_cutoff=4.0)
    assert coarse.polygons_meshed == 0
    assert fine.polygons_proxy > 2 * coarse.polygons_proxy
    assert _refine(scene, shadow_cutoff=0.0).polygons_proxy == coarse.polygons_proxy


@pytest.mark.fine
def test_results_carry_uvs_materials_and_smooth_tubes():
    scene = _forest()
    _refine(scene)
    assert {made["tetflora_kind"] for made in _made(scene)} == {"leaf", "bark", "proxy"}
    for made in _made(scene):
        mesh = made.data
        assert len(mesh.materials) == 1
        assert mesh.materials[0] is not None
        if made["tetflora_kind"] == "proxy":
            continue
        assert mesh.uv_layers.active.name == "UVMap"
        smooth = np.zeros(len(mesh.polygons), bool)
        mesh.polygons.foreach_get("use_smooth", smooth)
        assert smooth.all() == (made["tetflora_kind"] == "bark")


@pytest.mark.parametrize("steps", [1, 2, 5, 1000])
def test_closing_the_job_leaves_the_scene_as_it_was(steps):
    """As Esc does; 1,000 steps are more than there are, so that the last close comes at the last step."""
    scene = _forest()
    before = datablocks()
    running = refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get())
    done = 0
    for _ in range(steps):
        progress = next(running)
        done += 1
        if progress.fraction >= 0.95 and "proxies" in progress.message:
            break
    running.close()
    assert done > 0
    assert datablocks() == before


def test_closing_the_job_before_a_material_is_used_leaves_none():
    scene = _forest()
    before = datablocks()
    running = refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get())
    while datablocks()["materials"] == before["materials"]:
        next(running)
    assert datablocks()["meshes"] == before["meshes"]
    running.close()
    assert datablocks() == before


def test_closing_the_job_in_the_middle_of_a_pass_does_not_wait_for_it(monkeypatch):
    """As Esc does: the pass goes on in its thread until it notices, and the scene is as it was at once."""
    scene = _forest()
    before = datablocks()
    begun, go = threading.Event(), threading.Event()

    original = refine.loop.refine

    def slow(*given):
        begun.set()
        assert go.wait(60.0)
        return (yield from original(*given))

    with monkeypatch.context() as patch:
        patch.setattr(refine.loop, "refine", slow)
        running = refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get())
        while not begun.is_set():
            progress = next(running)
        while not progress.waiting:
            progress = next(running)
        running.close()
        assert datablocks() == before
        go.set()
    assert _refine(scene).polygons_meshed > 0


def test_steps_give_what_is_made_at_once():
    """To the last bit, although one has a thread and the other has none."""
    scene = _forest()
    digests = []
    for run in (lambda steps: deque(steps, maxlen=0), worker.run_to_end):
        run(refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get()))
        made = sorted(_made(scene), key=lambda o: o.name.split(".")[0])
        digests.append([(o.name.split(".")[0], read(o.data, "position").tobytes()) for o in made])
    assert digests[0] == digests[1]


def test_an_error_while_writing_leaves_nothing(monkeypatch):
    """As a full memory would."""
    scene = _forest()
    before = datablocks()

    def broken(*_arguments):
        raise MemoryError

    monkeypatch.setattr(refine, "proxy_writer", lambda *_: broken)
    with pytest.raises(MemoryError):
        _refine(scene)
    assert datablocks() == before


def test_objects_that_the_artist_puts_among_the_results_survive():
    scene = _forest()
    _refine(scene)
    rock = add_mesh("rock")
    for collection in list(rock.users_collection):
        collection.objects.unlink(rock)
    next(c for c in scene.collection.children if c.name == "TetFlora").objects.link(rock)
    refine.clear(scene)
    assert rock.name in scene.collection.objects


def test_any_mesh_serves_as_a_leaf():
    scene = _forest(1)
    plain = _refine(scene, expand_everything=True)
    leaf = add_mesh("my leaf", faces=[(0, 1, 2)])
    entry = scene.tetflora.leaf_objects.add()
    entry.species, entry.leaf = scene.objects["tree 0"].tetflora.species, leaf
    _refine(scene)
    leaves = next(o for o in _made(scene) if o["tetflora_kind"] == "leaf")
    assert {len(p.vertices) for p in leaves.data.polygons} == {3}
    assert plain.polygons_meshed > 0
    bpy.data.objects.remove(leaf)
    assert _refine(scene).polygons_meshed == plain.polygons_meshed  # the species' own leaf again


def test_a_leaf_that_cannot_be_used_is_named():
    scene = _forest(1)
    empty = add_mesh("bare leaf", faces=[])
    entry = scene.tetflora.leaf_objects.add()
    entry.species, entry.leaf = scene.objects["tree 0"].tetflora.species, empty
    before = datablocks()
    with pytest.raises(errors.SpeciesError, match=r"bare leaf.*no faces"):
        _refine(scene)
    assert datablocks() == before


def test_estimates_agree_with_what_is_made():
    scene = _forest()
    estimate = contents.estimate(scene, bpy.context.evaluated_depsgraph_get())
    expanded = _refine(scene, expand_everything=True)
    assert estimate.polygons_full == expanded.polygons_full
    assert expanded.polygons_meshed == pytest.approx(estimate.polygons_full, rel=0.1)


def test_the_refined_picture_is_that_of_the_plants():
    """Mean radiance over blocks of the picture, refined against expanded; the leaf limit makes most of it proxies."""

    add_camera(location=(2.0, -32.0, 6.0))
    for i in range(3):
        add_plant(f"tree {i}", "broadleaf_tree", i, (6.0 * i - 4.0, 4.0 * i, 0.0))
    scene = bpy.context.scene
    world = bpy.data.worlds.new("sky")
    scene.world = world
    compat.shader_tree(world).nodes["Background"].inputs["Color"].default_value = (0.8, 0.8, 0.8, 1.0)
    scene.render.engine = 'CYCLES'
    scene.render.resolution_x, scene.render.resolution_y = 96, 72
    scene.cycles.samples = 24  # and blocks of 64 pixels: noise is a fifth of the least bound
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.transparent_max_bounces = 256
    scene.tetflora.refine_at_render = False

    def blocks():
        image = picture()[..., :3].mean(axis=2)
        return image.reshape(9, 8, 12, 8).mean(axis=(1, 3))

    _refine(scene, expand_everything=True)
    truth = blocks()
    assert np.ptp(truth) > 0.2  # the plants are seen at all
    for form, bound in (('MICROSURFACES', 0.03), ('MICROSPHERES', 0.04), ('SHELLS', 0.06)):
        statistics = _refine(scene, expand_everything=False, leaf_limit=4.0, proxy_kind=form)
        assert statistics.polygons_meshed < 0.3 * statistics.polygons_full, form
        assert np.sqrt(((blocks() - truth) ** 2).mean()) < bound, form


def test_a_job_that_is_told_to_stop_refining_makes_what_it_has():
    scene = _forest()
    scene.tetflora.cutoff = 0.5
    steps = refine.refine_steps(scene, bpy.context.evaluated_depsgraph_get())
    while (progress := next(steps)).waiting or not progress.message.startswith("Refining"):
        pass
    with pytest.raises(StopIteration) as stop:
        progress = steps.send(True)
        while True:
            assert progress.waiting or not progress.message.startswith("Refining")
            progress = next(steps)
    statistics = stop.value.value
    assert not statistics.complete
    assert has_results(scene)
    whole = _refine(scene)
    assert whole.complete
    assert whole.passes > statistics.passes


def test_materials_show_the_colors_of_their_species_in_solid_viewports():
    """Once: a color that an artist gives stays."""
    add_camera(location=(0.0, -20.0, 4.0))
    for i, species in enumerate(("cherry_blossom", "cypress")):
        add_plant(species, seed=i, location=(6.0 * i - 3.0, 0.0, 0.0), species=species)
    scene = bpy.context.scene
    _refine(scene, expand_everything=True)
    shown = {o.data.materials[0].name: tuple(o.data.materials[0].diffuse_color) for o in _made(scene)}
    leaves = [color for name, color in shown.items() if name.endswith("leaf")]
    assert len(leaves) == len(set(leaves)) == 3
    blossom, leaf = (next(color for name, color in shown.items() if f"cherry {of}" in name) for of in ("b", "leaf"))
    assert blossom[0] > blossom[1] and leaf[1] > leaf[0]  # pink, and green
    material = next(o.data.materials[0] for o in _made(scene) if o["tetflora_kind"] == "bark")
    material.diffuse_color = (0.0, 0.0, 1.0, 1.0)
    _refine(scene)
    assert tuple(material.diffuse_color) == (0.0, 0.0, 1.0, 1.0)


def test_leaves_of_a_species_are_the_object_that_its_file_names():
    """With its texture coordinates and materials; where the file has no such object it is told, and nothing made."""
    scene = _forest(1)
    page = species_data(scene, scene.objects["tree 0"].tetflora.species)
    store_species(scene, "own", {**page, "name": "Own", "leaf": {"object": "my leaf"}})
    scene.objects["tree 0"].tetflora.species = "own"
    before = datablocks()
    with pytest.raises(errors.SpeciesError, match=r'"Own" uses the object "my leaf" as its leaf.*no such object'):
        _refine(scene, expand_everything=True)
    assert datablocks() == before
    leaf = add_mesh("my leaf", faces=[(0, 1, 2), (0, 2, 3)], size=0.5)
    for name in ("upper", "lower"):
        leaf.data.materials.append(bpy.data.materials.new(name))
    leaf.data.polygons[1].material_index = 1
    corners = np.float32([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)])
    leaf.data.uv_layers.new(name="own map").uv.foreach_set("vector", corners.ravel())
    leaf.hide_render = leaf.hide_viewport = True
    _refine(scene)
    (made,) = [o for o in _made(scene) if o["tetflora_kind"] == "leaf"]
    uv = np.zeros(2 * len(made.data.loops), np.float32)
    made.data.uv_layers["UVMap"].uv.foreach_get("vector", uv)
    np.testing.assert_allclose(uv.reshape(-1, 6, 2), np.tile(corners, (len(uv) // 12, 1, 1)))
    slots = np.zeros(len(made.data.polygons), np.int32)
    made.data.polygons.foreach_get("material_index", slots)
    assert slots.tolist() == [0, 1] * (len(slots) // 2)
    assert [slot.material.name for slot in made.material_slots] == ["upper", "lower"]
    areas = np.array([polygon.area for polygon in made.data.polygons]).reshape(-1, 2)
    np.testing.assert_allclose(areas[:, 0], areas[:, 1], rtol=1e-3)
