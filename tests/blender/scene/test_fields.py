# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields: points of an object are the same plants as empties at their places would be."""

from __future__ import annotations

from itertools import pairwise

import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mathutils import Euler, Matrix, Vector

from devtools import session
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, select
from tetflora_addon import errors
from tetflora_addon.arrays import quaternions
from tetflora_addon.blender.job import contents
from tetflora_addon.blender.scene import fields as scene_fields
from tetflora_addon.blender.scene import objects
from tetflora_addon.blender.scene.plants import NoPlantsError, read_plants

pytestmark = pytest.mark.usefixtures("clean_file")

KEYS = {'INT': "value", 'FLOAT': "value", 'QUATERNION': "value", 'FLOAT_VECTOR': "vector"}
PLACES = ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (-4.0, 0.5, 0.0))


def _field(places=PLACES, name="field", kinds=("bush", "conifer"), collection=None, cloud=False, **attributes):
    """A field whose attributes are given as (type, values)."""
    data = (bpy.data.pointclouds if cloud else bpy.data.meshes).new(name)
    data.resize(len(places)) if cloud else data.vertices.add(len(places))
    attributes = {"position": ('FLOAT_VECTOR', places), **attributes}
    for key, (kind, values) in attributes.items():
        attribute = data.attributes.get(key) or data.attributes.new(key, kind, 'POINT')
        values = np.asarray(values, np.int32 if kind == 'INT' else np.float32)
        attribute.data.foreach_set(KEYS[kind], values.reshape(-1))
    obj = bpy.data.objects.new(name, data)
    obj.tetflora.is_field = True
    for identifier in kinds:
        obj.tetflora.field_species.add().species = identifier
    (collection or bpy.context.scene.collection).objects.link(obj)
    return obj


def _nodes(obj, *chain, **inputs):
    """Give an object geometry nodes, one after the other from its own geometry; the group's links and nodes."""
    group = bpy.data.node_groups.new("nodes", "GeometryNodeTree")
    for in_out in ('INPUT', 'OUTPUT'):
        group.interface.new_socket("Geometry", in_out=in_out, socket_type='NodeSocketGeometry')
    made = [group.nodes.new(kind) for kind in ("NodeGroupInput", *chain, "NodeGroupOutput")]
    for first, second in pairwise(made):
        group.links.new(first.outputs[0], second.inputs[0])
    obj.modifiers.new("nodes", 'NODES').node_group = group
    return group, made


def _instance_on_points(obj, instanced):
    """Let geometry nodes put an object or a collection on an object's points."""
    group, (_, on_points, _) = _nodes(obj, "GeometryNodeInstanceOnPoints")
    kind = "Object" if hasattr(instanced, "matrix_world") else "Collection"
    info = group.nodes.new(f"GeometryNode{kind}Info")
    info.inputs[kind].default_value = instanced
    if kind == "Object":
        info.inputs["As Instance"].default_value = True
    group.links.new(info.outputs[-1], on_points.inputs["Instance"])


def _plants():
    return read_plants(bpy.context.scene, depsgraph())[0]


def _same(first, second):
    """Whether two sets of plants are equal, whatever their order."""
    assert first.identifiers == second.identifiers
    order = [np.lexsort(np.round(s.position.T, 3)) for s in (first, second)]
    for name, tolerance in (("species", 0), ("seed", 0), ("position", 1e-4), ("frame", 1e-5), ("scale", 1e-4)):
        a, b = (getattr(s, name)[o] for s, o in zip((first, second), order, strict=True))
        assert a.shape == b.shape
        assert a.dtype == b.dtype
        assert np.allclose(a, b, rtol=1e-5, atol=tolerance), name


angles = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(
    turns=st.lists(angles, min_size=3, max_size=3),
    written=st.sampled_from(['QUATERNION', 'FLOAT_VECTOR', None]),
    scales=st.lists(st.floats(0.1, 5.0), min_size=3, max_size=3),
    stretch=st.sampled_from([None, (1.0, 1.0, 1.0), (1.0, 2.0, 0.5), (-1.0, 1.0, 1.0)]),
    own=st.tuples(angles, st.sampled_from([(1.0, 1.0, 1.0), (2.0, 2.0, 2.0), (-1.0, 1.0, 1.0), (1.0, 3.0, 0.5)])),
)
def test_points_are_the_plants_that_empties_would_be(turns, written, scales, stretch, own):
    bpy.data.batch_remove(list(bpy.data.objects))
    turns = turns if written else [(0.0, 0.0, 0.0)] * 3
    attributes = {"species": ('INT', [1, 0, 1]), "seed": ('INT', [7, -3, 2**31 - 1])}
    if written == 'QUATERNION':
        attributes["rotation"] = (written, [1.7 * np.array(Euler(t).to_quaternion()) for t in turns])
    elif written:
        attributes["rotation"] = (written, turns)
    along = np.array(scales)[:, None] * np.array(stretch or (1.0, 1.0, 1.0))
    attributes["scale"] = ('FLOAT_VECTOR', along) if stretch else ('FLOAT', scales)
    field = _field(**attributes)
    world = Matrix.LocRotScale((3.0, -2.0, 1.0), Euler(own[0]), Vector(own[1]))
    field.matrix_basis = world
    read = _plants()
    bpy.data.objects.remove(field)
    parent = bpy.data.objects.new("parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.matrix_basis = world
    for i, kind in enumerate(("conifer", "bush", "conifer")):
        plant = add_plant(f"{i}", kind, seed=attributes["seed"][1][i], location=PLACES[i], parent=parent)
        plant.rotation_euler, plant.scale = turns[i], along[i]
    _same(read, _plants())


def test_a_bare_mesh_is_a_field_of_the_first_species_with_seeds_of_its_own():
    field = _field()
    bare = _plants()
    assert bare.identifiers == ("bush",)
    assert np.allclose(bare.position, PLACES)
    assert np.allclose(bare.frame, np.eye(3))
    assert np.allclose(bare.scale, 1.0)
    assert len(set(bare.seed.tolist())) == 3
    assert np.array_equal(_plants().seed, bare.seed)
    field.tetflora.seed = 1
    assert not set(_plants().seed.tolist()) & set(bare.seed.tolist())
    field.tetflora.field_species.clear()
    field.tetflora.species = "conifer"
    assert _plants().identifiers == ("conifer",)


def test_seeds_follow_ids_and_not_the_order_of_points():
    first = _field(id=('INT', [10, 20, 30]))
    seeds = _plants().seed
    first.tetflora.is_field = False
    _field(PLACES[::-1], id=('INT', [30, 20, 10]))
    assert _plants().seed.tolist() == seeds[::-1].tolist()


def test_names_with_the_prefix_go_first():
    _field(scale=('FLOAT', [2.0] * 3), tf_scale=('FLOAT', [3.0] * 3), tf_seed=('INT', [1, 2, 3]))
    read = _plants()
    assert np.allclose(read.scale, 3.0)
    assert read.seed.tolist() == [1, 2, 3]


def test_point_clouds_and_what_nodes_make_of_meshes():
    seeds = ('INT', [4, 5, 6])
    field = _field(seed=seeds)
    as_mesh = _plants()
    field.location = (1.0, 0.0, 0.0)
    _nodes(field, "GeometryNodeMeshToPoints")
    assert depsgraph() and field.evaluated_get(depsgraph()).evaluated_geometry().pointcloud is not None
    as_cloud = _plants()
    assert np.allclose(as_cloud.position, np.array(PLACES) + (1.0, 0.0, 0.0))
    assert as_cloud.seed.tolist() == as_mesh.seed.tolist()


def test_point_cloud_objects():
    cloud = bpy.data.pointclouds.new("probe")
    if not hasattr(cloud, "resize"):  # before 5.1 scripts cannot make points, but an empty cloud
        obj = bpy.data.objects.new("probe", cloud)
        bpy.context.scene.collection.objects.link(obj)
        obj.tetflora.is_field = True
        with pytest.raises(NoPlantsError):
            _plants()
        return
    _field(cloud=True, seed=('INT', [4, 5, 6]), kinds=("conifer",))
    read = _plants()
    assert np.allclose(read.position, PLACES)
    assert read.seed.tolist() == [4, 5, 6]


def test_empties_points_and_instances_make_one_forest():
    add_plant("single", "conifer", seed=9, location=(0.0, 9.0, 0.0))
    _field(kinds=("oak", "bush"), species=('INT', [0, 0, 0]), seed=('INT', [1, 2, 3]))
    _field(kinds=("bush", "conifer"), name="other", seed=('INT', [4, 5, 6]))
    read = _plants()
    assert read.identifiers == ("bush", "conifer", "oak")  # what is listed and does not occur is not compiled
    assert read.species.tolist() == [1, 2, 2, 2, 0, 0, 0]
    assert read.seed.tolist() == [9, 1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("what", ["plant", "field", "collection"])
def test_nodes_instance_plants_and_fields(what):
    hidden = bpy.data.collections.new("sources")
    plant = add_plant("plant", seed=3, collection=hidden)
    if what == "field":
        plant = _field([(0.0, 0.0, 0.0)], kinds=("bush",), seed=('INT', [3]), collection=hidden)
    if what == "collection":
        hidden.instance_offset = (0.0, 0.0, -2.0)
    ground = _field(name="ground")
    ground.tetflora.is_field = False
    ground.location, ground.scale = (10.0, 0.0, 0.0), (2.0, 2.0, 2.0)
    _instance_on_points(ground, hidden if what == "collection" else plant)
    read = _plants()
    wanted = 2.0 * np.array(PLACES) + (10.0, 0.0, 4.0 if what == "collection" else 0.0)
    assert np.allclose(np.sort(read.position, axis=0), np.sort(wanted, axis=0), atol=1e-5)
    assert np.allclose(read.scale, 2.0)
    assert len(set(read.seed.tolist()) - {3}) == 3
    assert _plants().seed.tolist() == read.seed.tolist()
    assert objects.has_contents(bpy.context.scene)
    plant.hide_render = True
    with pytest.raises(errors.SceneError, match="No plants"):
        _plants()


def test_instances_of_nodes_stand_where_blender_says():
    hidden = bpy.data.collections.new("sources")
    grove = bpy.data.collections.new("grove")
    hidden.children.link(grove)
    add_plant("a", location=(1.0, 0.0, 0.0), collection=grove, rotation_euler=(0.3, 0.2, 0.1))
    inner = bpy.data.objects.new("inner", None)
    inner.instance_type, inner.instance_collection, inner.location = 'COLLECTION', grove, (0.0, 0.0, 5.0)
    hidden.objects.link(inner)
    ground = _field(name="ground")
    ground.tetflora.is_field = False
    ground.matrix_basis = ground.matrix_basis.Rotation(0.7, 4, 'X')
    _instance_on_points(ground, hidden)
    outer = bpy.data.objects.new("outer", None)
    outer.instance_type, outer.instance_collection, outer.location = 'COLLECTION', hidden, (0.0, 40.0, 0.0)
    bpy.context.scene.collection.objects.link(outer)
    read = _plants()
    graph = depsgraph()
    listed = [i.matrix_world.copy() for i in graph.object_instances if i.is_instance and i.object.tetflora.is_plant]
    blenders = np.array(listed)
    assert len(read) == len(blenders) == 8
    order, others = np.lexsort(np.round(read.position.T, 3)), np.lexsort(np.round(blenders[:, :3, 3].T, 3))
    assert np.allclose(read.position[order], blenders[others][:, :3, 3], atol=1e-4)
    assert np.allclose(read.frame[order], blenders[others][:, :3, :3], atol=1e-5)


def test_instances_on_vertices_are_read_as_well():
    parent = add_mesh("parent")
    parent.instance_type = 'VERTS'
    add_plant("child", parent=parent)
    read = _plants()
    assert len(read) == 5  # the plant itself and one at each corner
    assert len(set(read.seed.tolist())) == 5


def test_instanced_collections_hold_fields():
    grove = bpy.data.collections.new("grove")
    _field(collection=grove, seed=('INT', [1, 1, 1]))
    for x in (0.0, 100.0):
        instance = bpy.data.objects.new("instance", None)
        instance.instance_type, instance.instance_collection, instance.location = 'COLLECTION', grove, (x, 0.0, 0.0)
        bpy.context.scene.collection.objects.link(instance)
    read = _plants()
    assert len(read) == 6
    assert np.allclose(np.sort(read.position[:, 0]), np.sort([x + p[0] for x in (0.0, 100.0) for p in PLACES]))
    assert len(set(read.seed.tolist())) == 2  # equal seeds in a field are meant; its copies are others


@pytest.mark.parametrize(
    ("attributes", "says"),
    [
        (dict(scale=('FLOAT', [1.0, 0.0, -1.0])), '"field": 2 of 3 points .*scale.*the first is point 1\\.'),
        (dict(scale=('FLOAT_VECTOR', [1.0] * 6 + [0.0] * 3)), "1 of 3 .* point 2\\."),
        (dict(rotation=('FLOAT_VECTOR', [np.nan] + [0.0] * 8)), "1 of 3 points .*rotation.*point 0\\."),
        (dict(rotation=('QUATERNION', [np.inf] + [0.0] * 11)), "1 of 3 points .*rotation.*point 0\\."),
        (dict(rotation=('FLOAT', [0.0] * 3)), '"rotation" is FLOAT on POINT; .*FLOAT_VECTOR or QUATERNION'),
        (dict(position=('FLOAT_VECTOR', [0.0] * 3 + [np.inf] + [0.0] * 5)), "1 of 3 points .*point 1\\."),
        (dict(species=('INT', [0, 2, -1])), "2 of 3 points have a species .*list of 2 .*point 1\\."),
        (dict(species=('FLOAT', [0.0] * 3)), '"species" is FLOAT'),
    ],
)
def test_fields_that_cannot_be_used_are_named(attributes, says):
    _field(**attributes)
    with pytest.raises(errors.SceneError, match=says):
        _plants()


def test_a_quaternion_of_no_length_turns_nothing():
    _field(rotation=('QUATERNION', [0.0] * 12))
    assert np.allclose(_plants().frame, np.eye(3))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda field: setattr(field.tetflora, "enabled", False), "are disabled"),
        (lambda field: setattr(field, "hide_render", True), "No plants to render"),
        (lambda field: field.data.clear_geometry(), '"field": the field of plants has no points'),
        (lambda field: setattr(field.tetflora.field_species[0], "species", "nix"), '"field": unknown species "nix"'),
    ],
)
def test_fields_without_plants_say_so(change, says):
    change(_field())
    with pytest.raises(errors.SceneError, match=says):
        _plants()


def test_linked_fields_are_read(tmp_path):

    _field(seed=('INT', [1, 2, 3])).location = (0.0, 0.0, 7.0)
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    session.clean_file()
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = ["field"]
    bpy.context.scene.collection.objects.link(into.objects[0])
    read = _plants()
    assert np.allclose(read.position, np.array(PLACES) + (0.0, 0.0, 7.0))
    assert read.seed.tolist() == [1, 2, 3]


def test_a_field_that_is_hidden_in_viewports_renders():
    _field(seed=('INT', [1, 2, 3])).hide_viewport = True
    assert _plants().seed.tolist() == [1, 2, 3]


def test_a_field_that_is_being_edited_is_read():
    field = _field(seed=('INT', [1, 2, 3]))
    select(field)
    bpy.ops.object.mode_set(mode='EDIT')
    try:
        assert _plants().seed.tolist() == [1, 2, 3]
        field.modifiers.new("more", 'ARRAY').count = 2
        assert _plants().seed.tolist() == [1, 2, 3] * 2
    finally:
        bpy.ops.object.mode_set(mode='OBJECT')


def test_a_field_and_its_plants_are_the_same_forest():
    camera = add_camera()
    plants = [
        add_plant(f"{i}", kind, seed=i - 1, location=(i, 0.0, 0.0), scale=[0.5 + i] * 3, rotation_euler=(i, 2.0, 0.3))
        for i, kind in enumerate(("bush", "oak", "bush", "conifer"))
    ]
    disabled = add_plant("disabled")
    disabled.tetflora.enabled = False
    before = _plants()
    select(*plants, disabled)
    assert bpy.ops.tetflora.convert_plants(to='FIELD') == {'FINISHED'}
    assert {o.name for o in bpy.data.objects if o != camera} == {"disabled", "Field of plants"}
    _same(before, _plants())
    assert bpy.context.active_object.name == "Field of plants"
    assert bpy.ops.tetflora.convert_plants(to='OBJECTS') == {'FINISHED'}
    assert not bpy.data.meshes
    assert {o.type for o in bpy.data.objects} == {'CAMERA', 'EMPTY'}
    _same(before, _plants())


def test_marking_and_removing():
    ground = add_mesh("ground")
    select(ground)
    bpy.ops.tetflora.mark(what='FIELD')
    assert len(_plants()) == 4
    bpy.ops.tetflora.mark(what='FIELD')
    assert not ground.tetflora.is_field
    bpy.ops.tetflora.populate(count=20, min_distance=0.0, as_field='FIELD', species="bush")
    ground.tetflora.is_field = True
    add_plant("single")
    bpy.ops.tetflora.remove_plants(which='ALL')
    assert [o.name for o in bpy.data.objects] == ["ground"]
    assert [m.name for m in bpy.data.meshes] == ["ground"]
    assert not ground.tetflora.is_field


def test_a_field_alone_is_a_forest_for_renders_and_estimates():
    scene = bpy.context.scene
    assert not objects.has_contents(scene)
    seeds = [1, 2, 3]
    field = _field(seed=('INT', seeds))
    assert objects.has_contents(scene)
    of_field = contents.estimate(scene, depsgraph())
    bpy.data.objects.remove(field)
    for seed, place in zip(seeds, PLACES, strict=True):
        add_plant(f"{seed}", seed=seed, location=place)
    of_empties = contents.estimate(scene, depsgraph())
    assert of_field.plants == of_empties.plants == 3
    assert of_field.polygons_full == of_empties.polygons_full > 0


def test_rotations_to_quaternions_and_back():
    frames = np.linalg.qr(np.random.default_rng(3).normal(size=(200, 3, 3)))[0]
    frames *= np.sign(np.linalg.det(frames))[:, None, None]
    frames = np.concatenate([frames, [np.diag(d) for d in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))]])
    back = scene_fields._from_quaternions(np.ascontiguousarray(quaternions(frames).T))
    assert np.allclose(back.transpose(2, 0, 1), frames, atol=1e-9)


def test_trunks_lean_evenly_from_record_to_record_and_fall_at_once():
    """What leans stays upright enough to be turned; a trunk that lies in the next record stands until then."""
    rng = np.random.default_rng(3)
    turns = [
        Euler((lean, 0.0, spin)).to_matrix()
        for lean, spin in zip([0.0, 0.1, 0.4, 0.5, 0.4, 1.5], rng.random(6), strict=True)
    ]
    rotation = np.array(turns, np.float64).transpose(1, 2, 0)  # (3, 3, records)
    a, b = np.array([0, 1, 2, 4]), np.array([1, 2, 3, 5])
    for part in (0.0, 0.25, 1.0):
        made = scene_fields._turned(rotation, a, b, np.full(4, part))
        square = np.einsum("ikn,jkn->nij", made, made)
        np.testing.assert_allclose(square, np.tile(np.eye(3), (4, 1, 1)), atol=1e-6)
        assert np.linalg.det(made.transpose(2, 0, 1)) == pytest.approx(np.ones(4))
        axis = rotation[:, 2]
        between = (1.0 - part) * axis[:, a] + part * axis[:, b]
        np.testing.assert_allclose(made[:, 2, :3], (between / np.linalg.norm(between, axis=0))[:, :3], atol=1e-6)
        np.testing.assert_array_equal(made[:, :, 3], rotation[:, :, 4])
    assert np.array_equal(scene_fields._turned(rotation, a, a, np.full(4, 0.5)), rotation[:, :, a])
