# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where assets stand: scatters by nodes, collections and particles."""

from __future__ import annotations

import time

import bpy
import numpy as np
import pytest

from tests.blender.assets.scatters import Nodes, read, scattered, scene, tree
from tests.blender.scenes import add_camera, add_mesh, depsgraph
from tetflora_addon.blender.assets import marks, places
from tetflora_addon.blender.job import frame_cache
from tetflora_addon.blender.scene.objects import has_contents
from tetflora_addon.errors import SceneError

pytestmark = pytest.mark.usefixtures("clean_file")


def test_what_nodes_scatter_is_read_as_one_array():
    asset = tree()
    asset.scale = (3.0, 1.0, 1.0)  # of no account, as in what Blender shows
    ground = scattered(asset, 5, 2.0)
    ground.location = (0.0, 10.0, 0.0)
    (found,) = read()
    assert found.target.datablock == asset and found.owner == ground and found.owners == (ground,)
    wanted = np.tile(np.diag([2.0, 2.0, 2.0, 1.0]), (5, 1, 1))
    wanted[:, 0, 3], wanted[:, 1, 3] = np.arange(5), 10.0
    assert found.matrices == pytest.approx(wanted, abs=1e-5)
    assert found.keys.dtype == np.uint64 and len(set(found.keys.tolist())) == 5


def test_places_are_those_that_blender_shows():
    asset = tree()
    ground = scattered(asset, 7, 0.5)
    ground.matrix_world = ((0.0, -2.0, 0.0, 1.0), (1.0, 0.0, 0.5, 2.0), (0.0, 0.0, 1.0, 3.0), (0.0, 0.0, 0.0, 1.0))
    (found,) = read()
    shown = [np.array(i.matrix_world) for i in depsgraph().object_instances if i.is_instance]
    assert len(shown) == 7
    shown = sorted(shown, key=lambda m: tuple(m[:, 3]))
    mine = sorted(found.matrices, key=lambda m: tuple(np.float32(m[:, 3])))
    assert np.array(mine) == pytest.approx(np.array(shown), abs=1e-5)


def test_keys_stay_while_an_animation_goes_on():
    ground = scattered(tree(), 6)
    before = read()[0]
    ground.location.x = 3.0
    after = read()[0]
    assert (before.keys == after.keys).all() and not (before.matrices == after.matrices).all()
    other = scattered(bpy.data.objects["tree"], 6, name="other")
    keys = {one.owner: set(one.keys.tolist()) for one in read()}
    assert not keys[ground] & keys[other]


def test_a_scatterer_that_is_not_marked_or_not_rendered_is_left_alone():
    ground = scattered(tree())
    assert has_contents(scene()) and len(read()) == 1
    ground.hide_render = True
    assert read() == []
    ground.hide_render, ground.tetflora.is_scatter = False, False
    assert read() == [] and not has_contents(scene())


def test_a_collection_is_one_asset_and_its_children_are_each_one():
    one, other = tree("one"), tree("other")
    held = one.users_collection[0]
    ground = add_mesh("ground")
    nodes = Nodes(ground)
    info, socket = nodes.asset(held)
    nodes.show(nodes.scatter(info, 4, socket=socket))
    ground.tetflora.is_scatter = True
    (found,) = read()
    assert found.target.datablock == held and len(found) == 4
    info.inputs["Separate Children"].default_value = True
    ground.update_tag()
    assert {(p.target.datablock, len(p)) for p in read()} == {(one, 4), (other, 4)}


def test_a_group_of_instances_is_opened_and_an_asset_of_many_parts_is_not():
    asset = tree()
    ground = add_mesh("ground")
    nodes = Nodes(ground)
    source, socket = nodes.asset(asset)
    patch = nodes.scatter(source, 3, socket=socket)
    many = nodes.scatter(source, places.MOST_IN_GROUP + 1, socket=socket)
    nodes.show(nodes.scatter(patch, 10, socket="Instances"), nodes.scatter(many, 2, socket="Instances"))
    ground.tetflora.is_scatter = True
    small = [p for p in read() if p.target.datablock == asset]
    assert sum(map(len, small)) == 30
    (large,) = [p for p in read() if p.target.datablock is None]
    assert len(large) == 2 and large.target.owner == ground


def test_a_mesh_with_instances_is_one_asset_of_its_own():
    leaf = tree("leaf")
    ground = add_mesh("ground")
    nodes = Nodes(ground)
    trunk = nodes.add("GeometryNodeMeshCube")
    source, socket = nodes.asset(leaf)
    join = nodes.add("GeometryNodeJoinGeometry")
    nodes.link(trunk, join, "Geometry")
    nodes.link(nodes.scatter(source, 8, socket=socket), join, "Geometry")
    nodes.show(nodes.scatter(join, 5))
    ground.tetflora.is_scatter = True
    (found,) = read()
    assert found.target.datablock is None and found.target.geometry is not None and len(found) == 5


def test_collection_instances_and_empties_that_nodes_scatter_are_their_collection():
    asset = tree()
    held = asset.users_collection[0]
    shown = bpy.data.objects.new("shown", None)
    shown.instance_type, shown.instance_collection = 'COLLECTION', held
    scene().collection.objects.link(shown)
    shown.location.z, shown.tetflora.is_scatter = 4.0, True
    (found,) = read()
    assert found.target.datablock == held and found.matrices[0, 2, 3] == pytest.approx(4.0)
    scattered(shown, 3)
    assert sorted((p.target.datablock.name, len(p)) for p in read()) == [(held.name, 1), (held.name, 3)]


def test_what_has_no_faces_is_no_asset_but_is_told_of():
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", 'POINT'))
    scene().collection.objects.link(lamp)
    ground = add_mesh("ground")
    nodes = Nodes(ground)
    shown = [nodes.scatter(node, 4, socket=socket) for node, socket in (nodes.asset(lamp), nodes.asset(tree()))]
    bare = tree("bare", faces=())
    node, socket = nodes.asset(bare)
    nodes.show(*shown, nodes.scatter(node, 2, socket=socket))
    scatter = places.read_scatters([ground], depsgraph())[ground]
    assert [(p.target.name, len(p)) for p in scatter.places] == [("tree", 4)]
    assert scatter.left == {"lamp": 4, "bare": 2}


def test_instances_of_no_size_are_dropped():
    ground = add_mesh("ground")
    nodes = Nodes(ground)
    source, socket = nodes.asset(tree())
    on_points = nodes.scatter(source, 6, socket=socket)
    index, scale = nodes.add("GeometryNodeInputIndex"), nodes.add("ShaderNodeMath")
    scale.operation = 'MODULO'
    scale.inputs[1].default_value = 2.0
    nodes.link(index, scale, 0)
    nodes.link(scale, on_points, "Scale")
    nodes.show(on_points)
    ground.tetflora.is_scatter = True
    (found,) = read()
    assert found.matrices[:, 0, 3].tolist() == [1.0, 3.0, 5.0]


def test_a_moved_place_that_is_no_number_names_the_scatterer():
    ground = scattered(tree())
    ground.location.x = np.nan
    with pytest.raises(
        SceneError, match=r'"ground": 5 of 5 instances of "tree".*Refine Scatter in Properties > Object$'
    ):
        read()


def test_particles_and_instances_on_vertices_are_read_too():
    asset = tree()
    ground = add_mesh("ground")
    ground.modifiers.new("particles", 'PARTICLE_SYSTEM')
    settings = ground.particle_systems[0].settings
    settings.type, settings.count, settings.render_type, settings.instance_object = 'HAIR', 9, 'OBJECT', asset
    ground.tetflora.is_scatter = True
    (found,) = read()
    assert found.target.datablock == asset and len(found) == 9 and len(set(found.keys.tolist())) == 9
    shown = [np.array(i.matrix_world) for i in depsgraph().object_instances if i.is_instance]
    assert found.matrices == pytest.approx(np.array(shown), abs=1e-5)

    child = add_mesh("child")
    parent = add_mesh("parent")
    child.parent, parent.instance_type = parent, 'VERTS'
    parent.tetflora.is_scatter = True
    (found,) = [p for p in read() if p.owner == parent]
    assert found.target.datablock == child and len(found) == 4


def test_an_instancer_that_changes_is_another_scene():
    add_camera()
    ground = scattered(tree(), 5)

    def digest():
        return frame_cache.scene_digest(scene(), depsgraph())

    before = digest()
    assert digest() == before
    points = next(n for n in ground.modifiers[0].node_group.nodes if n.bl_idname == "GeometryNodePoints")
    points.inputs["Count"].default_value = 6
    ground.update_tag()
    assert len(read()[0]) == 6 and digest() != before
    points.inputs["Count"].default_value = 5
    ground.update_tag()
    assert digest() == before
    bpy.data.objects["tree"].data.vertices[0].co.z += 1.0
    bpy.data.objects["tree"].data.update()
    assert digest() != before


def test_collections_that_instance_each_other_are_told():
    """Blender refuses to make such a circle at once, but not link by link; in a scene it would crash."""
    held, other = bpy.data.collections.new("held"), bpy.data.collections.new("other")
    for shown, home in ((held, other), (other, held)):
        obj = bpy.data.objects.new(f"shows {shown.name}", None)
        obj.instance_type, obj.instance_collection = 'COLLECTION', shown
        obj.instance_type = 'NONE'
        home.objects.link(obj)
        obj.instance_type = 'COLLECTION'
    for variants in (False, True):
        with pytest.raises(SceneError, match="instances itself"):
            marks.use_as_species(scene(), depsgraph(), held, variants)
    assert len(scene().tetflora.asset_species) == 0


def test_a_million_instances_are_read_in_two_seconds():
    scattered(tree(), 1_000_000)
    graph = depsgraph()
    best = np.inf
    for _ in range(3):
        begin = time.process_time()
        (found,) = places.read_places(scene(), graph)
        best = min(best, time.process_time() - begin)
    assert len(found) == 1_000_000 and len(np.unique(found.keys)) == 1_000_000
    assert best < 2.0
