# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results that are instances of the artist's own objects look like these, wherever those are, and leave nothing."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
import pytest

from devtools import session
from tests.blender.renders import picture, same_samples, small_scene
from tests.blender.scenes import add_mesh, datablocks, depsgraph
from tetflora_addon.blender import compat
from tetflora_addon.blender.materials.nodes import is_ours
from tetflora_addon.blender.results import instances
from tetflora_addon.blender.results.collection import Results, leave_out_of_file
from tetflora_addon.blender.results.hiding import keep_results, remove_results

CORNERS = np.array([(0, 0, 0), (0.5, 0, 0.1), (0.4, 0.3, 0), (0, 0.25, 0.2)], np.float64)
FACES = [(0, 1, 2), (0, 2, 3)]
#: Turned, mirrored, stretched and sheared.
LINEAR = np.array(
    [
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[1.6, 0, 0], [0, 0.6, 0], [0, 0, 2]],
        [[1, 0.7, 0], [0, 1, 0.2], [0.1, 0, 1]],
    ]
)
PLACES = np.array([(-0.3, 0.2, 0.1), (0.9, 0.3, 0), (-0.9, -0.8, 0), (0.1, -0.7, 0.2)])


def matrices():
    every = np.zeros((4, 4, 4))
    every[:, :3, :3], every[:, :3, 3], every[:, 3, 3] = LINEAR, PLACES, 1.0
    return every


def colored(color):
    made = bpy.data.materials.new("paint")
    nodes = compat.shader_tree(made).nodes
    nodes["Principled BSDF"].inputs["Base Color"].default_value = (*color, 1.0)
    nodes["Principled BSDF"].inputs["Roughness"].default_value = 1.0
    return made


def mesh_of(name, corners, colors=((0.8, 0.1, 0.1), (0.1, 0.7, 0.2))):
    """One or several kites of two triangles, each in two colors."""
    mesh = bpy.data.meshes.new(name)
    corners = np.asarray(corners).reshape(-1, 4, 3)
    faces = [tuple(4 * n + v for v in face) for n in range(len(corners)) for face in FACES]
    mesh.from_pydata(corners.reshape(-1, 3).tolist(), [], faces)
    for color in colors:
        mesh.materials.append(colored(color))
    mesh.polygons.foreach_set("material_index", np.tile([0, 1], len(corners)).astype(np.int32))
    mesh.polygons.foreach_set("use_smooth", np.zeros(len(mesh.polygons), bool))
    return mesh


def add(name, mesh):
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def opened(purpose='VIEW'):
    results = Results(bpy.context.scene, purpose)
    results.open()
    return results


def placed(every):
    """Corners of all instances, in the world."""
    return CORNERS @ every[:, :3, :3].transpose(0, 2, 1) + every[:, None, :3, 3]


def pictures_of(make, engine):
    """A picture of the instances that a function makes, and one of the same faces as a plain mesh."""
    if engine not in _expected:
        small_scene(0.7, same_samples(engine), 40.0, 32, engine, 3.0, shadows=True)
        add("truth", mesh_of("truth", placed(matrices())))
        _expected[engine] = picture()
        session.clean_file()
    small_scene(0.7, same_samples(engine), 40.0, 32, engine, 3.0, shadows=True)
    make()
    return picture(), _expected[engine]


#: The picture of the plain mesh, by render engine.
_expected: dict[str, np.ndarray] = {}


ENGINES = ["CYCLES", compat.eevee_engine()]


def hide_nothing(source):
    return source


def hide_in_both(source):
    source.hide_render = source.hide_viewport = True
    return source


def unlink(source):
    bpy.context.scene.collection.objects.unlink(source)
    return source


def exclude(source):
    home = bpy.data.collections.new("home")
    bpy.context.scene.collection.children.link(home)
    home.objects.link(unlink(source))
    bpy.context.view_layer.layer_collection.children["home"].exclude = True
    return source


@pytest.mark.parametrize(
    ("where", "engine"),
    # What is shown is the same for all engines: one draws what stands nowhere else.
    [*((where, ENGINES[0]) for where in (hide_nothing, hide_in_both, unlink, exclude)), (unlink, ENGINES[1])],
)
def test_instances_look_like_plain_geometry_wherever_the_original_is(clean_file, engine, where):
    def make():
        source = where(add("kite", mesh_of("kite", CORNERS)))
        source.location = (50.0, 0.0, 0.0)  # does not count
        results = opened()
        instances.add_instances(results, "kites 000", source, matrices(), np.arange(4, dtype=np.int32), source)
        results.finish()

    shown, expected = pictures_of(make, engine)
    assert expected.std() > 0.05
    assert np.abs(shown - expected).mean() < 0.01 * expected.mean()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_linked_original_is_shown(clean_file, engine, tmp_path):
    kite = add("kite", mesh_of("kite", CORNERS))
    kite.hide_render = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    session.clean_file()

    def make():
        with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
            wanted.objects = ["kite"]
        results = opened()
        instances.add_instances(results, "kites 000", wanted.objects[0], matrices(), np.arange(4, dtype=np.int32))
        results.finish()

    shown, expected = pictures_of(make, engine)
    assert np.abs(shown - expected).mean() < 0.01 * expected.mean()


@pytest.mark.parametrize("engine", ENGINES)
def test_the_space_of_a_collection_begins_at_its_offset(clean_file, engine):
    def make():
        asset = bpy.data.collections.new("asset")
        asset.instance_offset = (3.0, 4.0, 5.0)
        kite = bpy.data.objects.new("kite", mesh_of("kite", CORNERS))
        kite.location = asset.instance_offset
        asset.objects.link(kite)
        results = opened()
        results.origin = (0.2, -0.3, 0.4)
        every = matrices()
        every[:, :3, 3] -= results.origin
        instances.add_instances(results, "kites 000", asset, every, np.arange(4, dtype=np.int32))
        results.finish()

    shown, expected = pictures_of(make, engine)
    assert np.abs(shown - expected).mean() < 0.01 * expected.mean()


def test_clusters_are_picked_by_their_place_in_the_list(clean_file):
    results = opened()
    widths = [0.1 * (n + 1) for n in range(12)]
    clusters = [
        instances.add_cluster(results, "Oak 7", number, mesh_of("cluster", CORNERS * width))
        for number, width in zip([3, 100, 20, 7, 11, 1, 2, 10, 1000, 30, 5, 4], widths, strict=True)
    ]
    pick = np.arange(12, dtype=np.int32)[::-1].copy()
    every = np.broadcast_to(np.eye(4), (12, 4, 4)).copy()
    every[:, 0, 3] = np.arange(12)
    made = instances.add_cluster_instances(results, "clusters 000", clusters, pick, every, pick)
    results.finish()
    seen = {
        round(i.matrix_world.translation.x): i.object.dimensions.x / 0.5
        for i in depsgraph().object_instances
        if i.is_instance and i.parent.original == made
    }
    assert [seen[x] for x in range(12)] == pytest.approx([widths[p] for p in pick], rel=1e-5)


def test_sheared_instances_keep_their_matrix_and_id(clean_file):
    results, source = opened(), add_mesh("tree")
    made = instances.add_instances(results, "trees 000", source, matrices(), np.array([9, 4, 7, 2], np.int32))
    results.finish()
    geometry = made.evaluated_get(depsgraph()).evaluated_geometry()
    assert [r.original for r in geometry.instance_references()] == [source]
    names = {a.name for a in geometry.instances_pointcloud().attributes if a.data_type != 'BOOLEAN'}
    assert names == {".reference_index", "id", "instance_transform", "position"}
    found = {i.persistent_id[0]: np.array(i.matrix_world) for i in depsgraph().object_instances if i.is_instance}
    assert sorted(found) == [2, 4, 7, 9]
    for number, matrix in zip([9, 4, 7, 2], matrices(), strict=True):
        assert found[number] == pytest.approx(matrix, abs=1e-6)


def test_the_instancer_looks_like_the_artists_and_output_settings_count_too(clean_file):
    results, source = opened(), add_mesh("tree")
    like = add_mesh("scatter")
    like.visible_shadow, like.is_holdout, like.pass_index, like.color = False, True, 12, (0.5, 0.25, 0.0, 1.0)
    lamps = bpy.data.collections.new("lamps")
    like.light_linking.receiver_collection, like.cycles.use_motion_blur = lamps, False
    made = instances.add_instances(results, "trees 000", source, matrices(), np.zeros(4, np.int32), like)
    results.finish()
    scene = bpy.context.scene
    assert (made.visible_shadow, made.visible_camera, made.is_holdout, made.pass_index) == (False, True, True, 12)
    assert made.light_linking.receiver_collection == lamps and not made.cycles.use_motion_blur
    assert tuple(made.color) == (0.5, 0.25, 0.0, 1.0)
    scene.tetflora.output.camera, scene.tetflora.output.pass_index = False, 3
    assert (made.visible_shadow, made.visible_camera, made.pass_index) == (False, False, 12)
    scene.tetflora.output.camera = True
    assert (made.visible_shadow, made.visible_camera) == (False, True)


@dataclass(frozen=True)
class Bare:
    """Geometry that nodes instance; the same where the name is."""

    name: str
    geometry: object = field(compare=False)


@pytest.fixture
def sources(clean_file):
    add_mesh("tree")
    bare = add_mesh("bare")
    bare.data.materials.append(colored((0.5, 0.5, 0.5)))
    return bpy.context.scene


def make_everything(purpose='VIEW'):
    """Instances of an object, of bare geometry and of clusters."""
    results, source = opened(purpose), bpy.data.objects["tree"]
    geometry = bpy.data.objects["bare"].evaluated_get(depsgraph()).evaluated_geometry()
    ids = np.arange(4, dtype=np.int32)
    instances.add_instances(results, "trees 000", source, matrices(), ids, source)
    carrier = instances.carrier_of(results, Bare("bare", geometry))
    assert carrier == instances.carrier_of(results, Bare("bare", geometry))
    assert carrier.data.materials[0] == bpy.data.objects["bare"].data.materials[0]
    for number in range(2):
        instances.add_instances(results, f"bare {number:03d}", carrier, matrices(), ids)
    clusters = [instances.add_cluster(results, "tree", n, mesh_of("cluster", CORNERS, ())) for n in range(3)]
    for number in range(2):
        instances.add_cluster_instances(results, f"clusters {number:03d}", clusters, ids % 3, matrices(), ids)
    instances.add_cluster(results, "tree", 3, mesh_of("cluster", CORNERS, ()))  # that nothing shows
    return results


def shown():
    """Number of instances by the name of their data."""
    found = {}
    for i in depsgraph().object_instances:
        if i.is_instance:
            name = i.object.data.name.split(" ")[0]
            found[name] = found.get(name, 0) + 1
    return found


EVERYTHING = {"tree": 12, "bare": 8}


@pytest.mark.parametrize("purpose", ['VIEW', 'RENDER'])
def test_nothing_is_left_of_results(sources, purpose):
    before = datablocks()
    make_everything(purpose).discard()
    assert datablocks() == before
    for _ in range(2):  # the second take the place of the first
        results = make_everything(purpose)
        remove_results(sources, keep=(results.collection,))
        results.finish()
        assert shown() == EVERYTHING
    assert {"tree 000000", "tree 000002", "trees 000", "bare 0", "bare 000"} <= {o.name for o in bpy.data.objects}
    remove_results(sources)
    # One cluster was made that nothing shows.
    orphans = [o for o in bpy.data.objects if o.name == "tree 000003"]
    assert not orphans
    assert datablocks() == before


@pytest.mark.parametrize("saved", [False, True])
def test_files_hold_all_of_the_results_or_nothing(sources, tmp_path, saved):
    path = str(tmp_path / "forest.blend")
    before = datablocks()
    sources.tetflora.output.save_results = saved
    make_everything().finish()
    leave_out_of_file()
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    if saved:
        assert shown() == EVERYTHING
    remove_results(bpy.context.scene)
    after = datablocks()
    after["node_groups"] = before["node_groups"]
    assert after == before


def test_kept_results_are_the_artists(sources):
    make_everything().finish()
    assert keep_results(sources) == 5
    assert shown() == EVERYTHING
    remove_results(sources)
    assert shown() == EVERYTHING
    made = [*bpy.data.objects, *bpy.data.meshes, *bpy.data.collections]
    assert not [d.name for d in made if is_ours(d)]


def test_undo_and_redo(sources):
    bpy.ops.ed.undo_push(message="before")
    make_everything().finish()
    bpy.ops.ed.undo_push(message="results")
    bpy.ops.ed.undo()
    assert shown() == {}
    bpy.ops.ed.redo()
    assert shown() == EVERYTHING
    remove_results(bpy.context.scene)
    assert shown() == {}
    assert not [o for o in bpy.data.objects if is_ours(o)]


def test_a_carrier_holds_what_geometry_instances_too(clean_file):
    tree = add_mesh("tree")
    results = opened()
    bpy.context.scene.collection.children.link(results.collection)
    inner = instances.add_instances(results, "inner 000", tree, matrices(), np.arange(4, dtype=np.int32))
    geometry = inner.evaluated_get(depsgraph()).evaluated_geometry()
    bare = Bare("bare", geometry)
    carrier = instances.carrier_of(results, bare)
    every = matrices()[[1, 3]]
    made = instances.add_instances(results, "outer 000", carrier, every, np.arange(2, dtype=np.int32))
    found = [
        np.array(i.matrix_world)
        for i in depsgraph().object_instances
        if i.is_instance and i.parent.original == made and i.object.original == tree
    ]
    expected = (every[:, None] @ matrices()[None]).reshape(-1, 4, 4)
    order = [np.lexsort(m[:, :3, 3].T.round(4)) for m in (np.array(found), expected)]
    assert np.array(found)[order[0]] == pytest.approx(expected[order[1]], abs=1e-5)
    before = len(bpy.data.collections)
    bpy.context.scene.collection.children.unlink(results.collection)
    results.finish()
    remove_results(bpy.context.scene)
    assert before > 0 and not len(bpy.data.collections)
    assert [o.name for o in bpy.data.objects] == ["tree"]
