# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scatter of assets, refined from end to end: what is best left is left, the rest is replaced, and comes back."""

from __future__ import annotations

from collections import deque
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from benchmarks import pictures
from tests.blender.assets.scatters import Nodes, scattered, species
from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, depsgraph
from tests.engine.assets import trees
from tetflora_addon import storage
from tetflora_addon.assets import asset_cache
from tetflora_addon.assets.costs import AssetCosts
from tetflora_addon.blender.compat import eevee_engine
from tetflora_addon.blender.job import contents, refine
from tetflora_addon.blender.results.collection import has_results
from tetflora_addon.errors import TetFloraError

pytestmark = pytest.mark.usefixtures("clean_file", "nothing_known")

COUNT = 30


@pytest.fixture
def nothing_known():
    asset_cache.forget()
    yield
    asset_cache.forget()


def birch(name="birch", count=500, **options):
    """A tree of 588 faces that is in no collection of the scene."""
    one = trees.tree(1, count, **options)
    offsets = np.flatnonzero(np.diff(one.face, prepend=-1))
    triangles = one.triangles.tolist()
    faces = triangles
    if len(triangles) == 2 * len(offsets):  # leaves that are not closed are quads
        faces = [[*triangles[first], triangles[first + 1][2]] for first in offsets.tolist()]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(one.positions.tolist(), [], faces)
    mesh.materials.append(bpy.data.materials.new("bark and leaf"))
    made = bpy.data.objects.new(name, mesh)
    held = bpy.data.collections.get("sources") or bpy.data.collections.new("sources")
    held.objects.link(made)
    return made


def forest(engine='CYCLES', detail='REFINE', away=25.0, **options):
    """Thirty of them by nodes, a meter apart, before a camera."""
    tree = birch(**options)
    ground = scattered(tree, COUNT)
    ground.location.x = -COUNT / 2
    add_camera(location=(0.0, -away, 3.0))
    scene = bpy.context.scene
    scene.camera.data.clip_end = 10_000.0
    scene.render.engine = engine
    scene.render.resolution_x, scene.render.resolution_y = 200, 100
    scene.tetflora.asset_detail = detail
    return scene, ground, tree


def run(scene, **settings):
    for name, value in settings.items():
        setattr(scene.tetflora, name, value)
    return refine.refine(scene, depsgraph())


def shown():
    """Mesh and world matrix of all that is drawn as an instance; spheres are instances too in Blender 4.5."""
    return [
        (i.object.original.data.name, np.array(i.matrix_world))
        for i in depsgraph().object_instances
        if i.is_instance and "proxies" not in i.object.original.data.name
    ]


def area(mesh):
    return sum(p.area for p in bpy.data.meshes[mesh].polygons)


def drawn_area():
    """Area of all instances, meters squared, were none of them scaled."""
    return sum(area(mesh) for mesh, _ in shown())


@pytest.mark.parametrize("engine", ['CYCLES', eevee_engine()])
def test_what_is_best_left_stays_as_it_is(engine):
    scene, ground, tree = forest(engine, 'AUTO')
    before = shown()
    assert len(before) == COUNT
    statistics = run(scene)
    assert (statistics.instances, statistics.instances_whole) == (COUNT, COUNT)
    assert not ground.hide_render and not ground.hide_viewport
    after = shown()
    assert [mesh for mesh, _ in after] == [mesh for mesh, _ in before] == [tree.data.name] * COUNT
    for (_, one), (_, other) in zip(before, after, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("engine", ['CYCLES', eevee_engine()])
def test_results_take_the_place_of_the_scatterer_until_they_are_cleared(engine):
    scene, ground, _ = forest(engine)
    names, before = datablocks(), shown()
    statistics = run(scene)
    assert statistics.instances == COUNT and statistics.polygons_proxy > 0
    assert ground.hide_render and ground.hide_viewport
    assert has_results(scene)
    stand_ins = [o for o in scene.objects if o.name.startswith("ground 0")]
    assert len(stand_ins) == 1 and not stand_ins[0].tetflora.is_scatter
    refine.clear(scene)
    assert (ground.hide_render, ground.hide_viewport) == (False, False)
    assert datablocks() == names
    for (mesh, one), (other_mesh, other) in zip(before, shown(), strict=True):
        assert mesh == other_mesh and np.array_equal(one, other)


def test_far_away_there_are_facets_and_nearby_all_is_real():
    scene, _, tree = forest(away=2500.0)
    far = run(scene)
    assert far.instances_whole == far.instances_clusters == 0 and far.polygons_proxy > 0
    assert not shown()
    scene.camera.location.y = -12.0
    scene.render.resolution_x = scene.render.resolution_y = 1000
    near = run(scene, leaf_limit=0.1)
    assert near.instances_whole + near.instances_clusters > 0
    assert drawn_area() > 0.3 * COUNT * area(tree.data.name)
    assert drawn_area() <= COUNT * area(tree.data.name) * (1 + 1e-5)


def test_originals_stand_where_they_stood_stretched_and_mirrored():
    """Instances of the object itself, with its own mesh."""
    scene, ground, tree = forest(away=12.0)
    on_points = next(n for n in ground.modifiers[0].node_group.nodes if n.bl_idname == "GeometryNodeInstanceOnPoints")
    on_points.inputs["Scale"].default_value = (-1.0, 1.0, 1.5)
    ground.rotation_euler, ground.scale = (0.1, 0.0, 0.05), (1.0, 1.0, 1.2)
    before = [matrix for _, matrix in shown()]
    scene.render.resolution_x = scene.render.resolution_y = 1000
    statistics = run(scene, leaf_limit=0.02, cutoff=0.5)
    originals = [matrix for mesh, matrix in shown() if mesh == tree.data.name]
    assert statistics.instances_whole == len(originals) > 5
    for matrix in originals:
        assert np.linalg.det(matrix[:3, :3]) < 0
        assert min(np.abs(matrix - other).max() for other in before) < 1e-4
    clusters = [matrix for mesh, matrix in shown() if mesh != tree.data.name]
    for matrix in clusters:
        assert min(np.abs(matrix - other).max() for other in before) < 1e-4


def test_refining_again_replaces_and_compiles_nothing(monkeypatch):
    scene, *_ = forest()
    first = run(scene)
    names = datablocks()
    monkeypatch.setattr(contents, "compile_steps", lambda source: pytest.fail(f"compiled {source.name} again"))
    second = run(scene)
    assert datablocks() == names
    one, other = first.as_dict(), second.as_dict()
    assert {k: v for k, v in one.items() if k not in {"seconds", "steps"}} == {
        k: v for k, v in other.items() if k not in {"seconds", "steps"}
    }


def test_another_session_finds_what_was_compiled(monkeypatch, tmp_path):
    folder = storage.current_folder()
    storage.set_folder(tmp_path / "cache")
    try:
        scene, *_ = forest()
        first = run(scene)
        asset_cache.forget()
        monkeypatch.setattr(contents, "compile_steps", lambda source: pytest.fail(f"compiled {source.name} again"))
        assert run(scene).polygons_proxy == first.polygons_proxy
    finally:
        storage.set_folder(folder)


def test_an_asset_that_changes_is_compiled_anew():
    scene, _, tree = forest()
    first = run(scene)
    for vertex in tree.data.vertices:
        vertex.co *= 1.7
    tree.data.update()
    second = run(scene)
    assert len(asset_cache._known) == 2
    assert second.polygons_proxy != first.polygons_proxy


def test_steps_give_what_is_made_at_once():
    scene, *_ = forest()
    found = []
    for go in (lambda steps: deque(steps, maxlen=0), refine.run_to_end):
        go(refine.refine_steps(scene, depsgraph()))
        found.append([(mesh.split(".")[0], matrix.tobytes()) for mesh, matrix in shown()])
    assert found[0] == found[1]


@pytest.mark.parametrize("again", [False, True])
def test_closing_the_job_at_any_step_leaves_the_scene_as_it_was(again):
    scene, ground, _ = forest()
    if again:
        run(scene)
    before, flags = datablocks(), (ground.hide_render, ground.hide_viewport)
    for steps in (1, 2, 3, 5, 8, 13, 21, 34):
        running = refine.refine_steps(scene, depsgraph())
        for _ in range(steps):
            if next(running, None) is None:
                break
        else:
            running.close()
            assert datablocks() == before
            assert (ground.hide_render, ground.hide_viewport) == flags
            continue
        break


def test_the_material_of_kites_goes_with_what_is_made_before_the_first_of_them():
    """Esc may come between them."""
    used = []
    bound = SimpleNamespace(placed=SimpleNamespace(assets=SimpleNamespace(every=[None])))
    form = SimpleNamespace(asset_material=lambda: bpy.data.materials.new("leaves"))
    refine._kites(SimpleNamespace(form=form, bound=bound, results=SimpleNamespace(use=used.extend)), 0)
    assert used == [bpy.data.materials["leaves"]]


def test_an_error_while_writing_loses_nothing(monkeypatch):
    scene, ground, _ = forest()
    before = datablocks()

    def broken(*_arguments):
        raise MemoryError

    for name, writer in (("proxy_writer", lambda *_: broken), ("write_assets", broken)):
        with monkeypatch.context() as patch:
            patch.setattr(refine, name, writer)
            with pytest.raises(MemoryError):
                run(scene)
        assert datablocks() == before
        assert not ground.hide_render and not ground.hide_viewport and len(shown()) == COUNT


def test_an_asset_that_lost_its_faces_is_named():
    """After it was made a species, and its plants were placed."""
    tree = birch()
    own = species(tree)
    add_camera()
    add_plant(species=own)
    tree.data.clear_geometry()
    before = datablocks()
    bpy.context.scene.tetflora.asset_detail = 'REFINE'
    with pytest.raises(TetFloraError, match="birch"):
        run(bpy.context.scene)
    assert datablocks() == before


def test_an_asset_all_of_whose_faces_have_no_area_is_named():
    scene, ground, tree = forest()
    for vertex in tree.data.vertices:
        vertex.co = (0.0, 0.0, 0.0)
    tree.data.update()
    before = datablocks()
    with pytest.raises(TetFloraError, match='"birch"'):
        run(scene)
    assert datablocks() == before and not ground.hide_render


def test_an_asset_with_a_place_that_is_no_number_is_told_or_left_out():
    scene, _, tree = forest()
    tree.data.vertices[200].co.x = np.nan
    tree.data.update()
    try:
        run(scene)
    except TetFloraError as error:
        assert "birch" in str(error)


def test_a_deleted_asset_of_a_scatterer_leaves_an_empty_scatterer():
    scene, _ground, tree = forest()
    run(scene)
    bpy.data.objects.remove(tree)
    with pytest.raises(TetFloraError):
        run(scene)
    refine.clear(scene)
    assert not has_results(scene)


def test_plants_of_an_asset_beside_grown_ones_and_scatter():
    scene, ground, tree = forest()
    own = species(tree)
    plants = [add_plant(f"plant {n}", own, n, (n - 2.0, 4.0, 0.0), scale=(1.0, -1.0, 1.3)) for n in range(5)]
    add_plant("bush", seed=3, location=(0.0, -3.0, 0.0))
    statistics = run(scene)
    assert statistics.instances == COUNT + 5 and statistics.plants == 1
    assert ground.hide_render and statistics.polygons_meshed > 0
    for detail in ('AUTO', 'REFINE'):
        statistics = run(scene, asset_detail=detail)
        assert statistics.instances == COUNT + 5
        if detail == 'AUTO':
            whole = [matrix for mesh, matrix in shown() if mesh == tree.data.name]
            assert statistics.instances_whole == len(whole) == COUNT + 5
            mirrored = [m for m in whole if np.linalg.det(m[:3, :3]) < 0]
            assert sorted(m[0, 3] for m in mirrored) == pytest.approx(sorted(p.location.x for p in plants))
            assert not ground.hide_render
    refine.clear(scene)
    assert len([1 for mesh, _ in shown() if mesh == tree.data.name]) == COUNT


def test_all_as_it_is_where_everything_is_expanded():
    scene, ground, tree = forest()
    statistics = run(scene, expand_everything=True)
    assert statistics.instances_whole == COUNT and not ground.hide_render
    assert [mesh for mesh, _ in shown()] == [tree.data.name] * COUNT


def test_two_scatterers_of_one_asset_are_both_replaced():
    scene, ground, tree = forest(eevee_engine())
    other = add_mesh("other", faces=())
    nodes = Nodes(other)
    source, socket = nodes.asset(tree)
    nodes.show(nodes.scatter(source, 7, socket=socket))
    other.tetflora.is_scatter, other.location.y = True, 300.0
    statistics = run(scene)
    assert statistics.instances == COUNT + 7
    assert ground.hide_render and other.hide_render
    assert len(asset_cache._known) == 1
    refine.clear(scene)
    assert not ground.hide_render and not other.hide_render


def test_undo_brings_the_scatterer_back_and_redo_the_results():
    scene, ground, _ = forest()
    bpy.ops.ed.undo_push(message="before")
    run(scene)
    bpy.ops.ed.undo_push(message="refined")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    ground = scene.objects["ground"]
    assert ground.tetflora.is_scatter
    run(scene)
    refine.clear(scene)
    ground = bpy.context.scene.objects["ground"]
    assert not ground.hide_render and not ground.hide_viewport
    assert len(shown()) == COUNT


def test_what_a_layer_collection_says_of_a_scatterer_holds_for_its_instances_each_time():
    scene, ground, tree = forest()
    tree.hide_viewport = True  # as sources of scatters often are
    home = bpy.data.collections.new("scattered")
    scene.collection.children.link(home)
    scene.collection.objects.unlink(ground)
    home.objects.link(ground)
    bpy.context.view_layer.layer_collection.children["scattered"].holdout = True
    for _ in range(2):
        run(scene)
        made = [o for o in scene.objects if o.get("tetflora_kind") in ("asset", "asset clusters", "stand-in")]
        assert made and all(o.is_holdout and not o.hide_viewport for o in made)
        assert shown()


@pytest.mark.fine
def test_facets_of_scatterers_that_look_otherwise_are_apart():
    scene, ground, tree = forest(away=2500.0)
    other = scattered(tree, COUNT)
    other.location = ground.location
    other.location.y += 20.0
    other.is_holdout, other.pass_index = True, 5
    run(scene)
    made = [o for o in scene.objects if o.get("tetflora_kind") == "proxy"]
    assert {(o.is_holdout, o.pass_index) for o in made} == {(True, 5), (False, 0)}


def _covered(scene, path):
    """Part of each pixel that trees cover."""
    scene.render.film_transparent, scene.render.engine = True, 'CYCLES'
    scene.tetflora.refine_at_render = False
    scene.render.image_settings.color_mode = 'RGBA'
    pictures.render(scene, path, 16)
    return pictures.read_picture(path)[:, :, 3]


def _faces(mesh):
    """Places and areas (n, 4) of the faces of a mesh, sorted."""
    found = np.array([(*p.center, p.area) for p in mesh.polygons])
    return found[np.lexsort(found.round(4).T)]


@pytest.mark.parametrize("closed", [False, True])
def test_clusters_are_faces_of_the_original_where_they_were(closed, monkeypatch, tmp_path):
    """So they are drawn where memory has no room for originals; small leaves are kites if they have many faces."""
    scene, _, tree = forest(away=8.0, count=1500, closed=closed)
    before = [matrix for _, matrix in shown()]
    picture = _covered(scene, tmp_path / "before.png")
    monkeypatch.setattr(AssetCosts, "plain", lambda *_: False)
    statistics = run(scene)
    assert statistics.instances_whole == 0 and statistics.instances_clusters == len(shown()) > 0
    for mesh, matrix in shown():
        assert mesh.startswith("birch ")
        assert min(np.abs(matrix - other).max() for other in before) < 1e-4
    used = {mesh for mesh, _ in shown()}
    kites, own = ({mesh for mesh in used if ("kites" in mesh) == of} for of in (True, False))
    assert bool(kites) == closed
    faces = np.concatenate([_faces(bpy.data.meshes[mesh]) for mesh in own])
    every = _faces(tree.data)
    assert len(faces) == statistics.polygons_meshed <= len(every)
    nearest = np.array([np.abs(every - face).max(axis=1).argmin() for face in faces[::37]])
    np.testing.assert_allclose(faces[::37], every[nearest], atol=1e-4)
    assert len(np.unique(faces.round(5), axis=0)) >= 0.999 * len(faces)  # none is in two clusters
    assert _covered(scene, tmp_path / "after.png").mean() == pytest.approx(picture.mean(), rel=0.04)
