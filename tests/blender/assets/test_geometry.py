# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Assets are read with all that they show, each mesh once, and places of what is instanced as arrays."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from tests.blender.assets.surfaces import SQUARE, Paint, cards, image, read, target_of
from tests.blender.scenes import add_mesh
from tetflora_addon import errors
from tetflora_addon.blender.assets.places import Target, digest_of, read_source_steps
from tetflora_addon.blender.scene.objects import references_of
from tetflora_addon.jobs import run_to_end

pytestmark = pytest.mark.usefixtures("clean_file")


def _collection(name, *objects):
    made = bpy.data.collections.new(name)
    for obj in objects:
        made.objects.link(obj)
        for home in list(obj.users_collection):
            if home != made:
                home.objects.unlink(obj)
    return made


def _empty(name="empty", **settings):
    made = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(made)
    for key, value in settings.items():
        setattr(made, key, value)
    return made


def _showing(collection, name="empty", **settings):
    return _empty(name, instance_type='COLLECTION', instance_collection=collection, **settings)


def _points(source):
    """Where all vertices of all triangles are, in the asset's space."""
    found = []
    for number, matrix in zip(source.surface, source.matrices, strict=True):
        surface = source.surfaces[number]
        corners = surface.positions[surface.triangles].reshape(-1, 3)
        found.append(corners @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(found)


def _instancing(obj, build, name="nodes"):
    """Give an object nodes; `build` gets the tree and the input's geometry and returns the output's."""
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for way in ('INPUT', 'OUTPUT'):
        tree.interface.new_socket(name="Geometry", in_out=way, socket_type='NodeSocketGeometry')
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(build(tree, start.outputs[0]), end.inputs[0])
    obj.modifiers.new(name, 'NODES').node_group = tree
    return tree


def _scatter(tree, points, instance):
    node = tree.nodes.new("GeometryNodeInstanceOnPoints")
    tree.links.new(points, node.inputs["Points"])
    tree.links.new(instance, node.inputs["Instance"])
    return node.outputs[0]


def _object_node(tree, obj):
    node = tree.nodes.new("GeometryNodeObjectInfo")
    node.inputs["Object"].default_value = obj
    node.inputs["As Instance"].default_value = True
    return next(s for s in node.outputs if s.name == "Geometry")


def _digest(datablock):
    bpy.context.view_layer.update()
    return digest_of(target_of(datablock), bpy.context.evaluated_depsgraph_get())


def test_object_is_read_in_its_own_space_with_modifiers():
    obj = add_mesh("leaf", size=0.5)
    obj.location, obj.scale = (3, 4, 5), (2, 2, 2)
    obj.modifiers.new("twice", 'ARRAY').count = 2
    source, warnings = read(obj)
    (surface,) = source.surfaces
    assert (source.faces, surface.faces, len(surface.triangles)) == (2, 2, 4)
    np.testing.assert_array_equal(surface.face, [0, 0, 1, 1])
    np.testing.assert_allclose(source.matrices, [np.eye(4)])
    np.testing.assert_allclose(surface.positions[:, 0].max(), 1.5)
    assert surface.positions.dtype == np.float32
    assert (surface.triangles.dtype, surface.face.dtype) == (np.int32, np.int32)
    assert source.name == "leaf"
    assert warnings == ()


def test_collection_is_read_from_its_offset_and_without_what_does_not_render():
    leaf, twig, hidden = add_mesh("leaf"), add_mesh("twig"), add_mesh("hidden")
    twig.data = leaf.data
    twig.matrix_world = Matrix.Translation((5, 0, 0)) @ Matrix.Scale(2, 4)
    hidden.hide_render = True
    inner = _collection("inner", twig)
    outer = _collection("outer", leaf, hidden)
    outer.children.link(inner)
    bpy.context.scene.collection.children.link(outer)
    outer.instance_offset = (1, 0, 0)
    source, _ = read(outer)
    assert len(source.surfaces) == 1  # both objects have the same mesh
    np.testing.assert_array_equal(source.surface, [0, 0])
    np.testing.assert_allclose(source.matrices[:, :3, 3], [(-1, 0, 0), (4, 0, 0)])
    np.testing.assert_allclose(source.matrices[1, 0, 0], 2)


def test_collections_outside_the_scene_are_read_as_they_are_stored():
    """Nothing evaluates them, so modifiers do not count."""
    leaf = add_mesh("leaf")
    leaf.location = (1, 2, 3)
    group = _collection("group", leaf)
    source, _ = read(group)
    np.testing.assert_allclose(source.matrices[0, :3, 3], (1, 2, 3))
    assert source.faces == 1


def test_collections_within_collections_multiply_their_places():
    leaf = add_mesh("leaf")
    leaf.location = (1, 0, 0)
    leaves = _collection("leaves", leaf)
    twigs = _collection("twigs", *(_showing(leaves, f"twig{i}", location=(0, i, 0)) for i in range(3)))
    tree = _showing(twigs, "tree", location=(9, 9, 9))
    branch = _showing(twigs, "branch", location=(0, 0, 1))
    forest = _collection("forest", tree, branch)
    source, _ = read(_showing(forest, "top"))
    assert len(source.surfaces) == 1
    places = sorted(source.matrices[:, :3, 3].round(5).tolist())
    assert places == sorted([[1, i, 1] for i in range(3)] + [[10, 9 + i, 9] for i in range(3)])


def test_leaves_that_nodes_instance_are_one_surface_beside_the_wood():
    """Instances of instances: leaves on twigs on a skeleton, and the skeleton's own faces."""
    leaf = add_mesh("leaf", size=0.1)
    twig = cards([None], [SQUARE] * 3, name="twig")
    _instancing(twig, lambda tree, given: _scatter(tree, given, _object_node(tree, leaf)), "twig")
    trunk = cards([None], [SQUARE] * 2, name="trunk")
    trunk.location = (7, 7, 7)

    def build(tree, given):
        join = tree.nodes.new("GeometryNodeJoinGeometry")
        tree.links.new(_scatter(tree, given, _object_node(tree, twig)), join.inputs[0])
        tree.links.new(given, join.inputs[0])
        return join.outputs[0]

    _instancing(trunk, build, "trunk")
    source, warnings = read(trunk)
    names = [surface.name for surface in source.surfaces]
    assert sorted(names) == ["leaf", "trunk"]  # nodes of the twig replace its faces
    counts = np.bincount(source.surface)
    assert counts[names.index("leaf")] == 8 * 12
    assert counts[names.index("trunk")] == 1
    own = source.matrices[source.surface == names.index("leaf"), :3, 3]
    points = np.array([v.co for v in trunk.data.vertices])
    inner = np.array([v.co for v in twig.data.vertices])
    expected = (points[:, None] + inner).reshape(-1, 3)
    np.testing.assert_allclose(sorted(own.tolist()), sorted(expected.tolist()), atol=1e-5)
    assert warnings == ()


def test_geometry_without_an_object_is_a_target():
    owner = cards([None], [SQUARE] * 2, name="owner")

    def build(tree, given):
        grid = tree.nodes.new("GeometryNodeMeshGrid")
        return _scatter(tree, given, grid.outputs["Mesh"])

    _instancing(owner, build)
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    geometry = owner.evaluated_get(graph).evaluated_geometry()
    ((shown, _),) = references_of(geometry)
    target = Target(None, shown, owner, "grid")
    source, _ = run_to_end(read_source_steps(target, graph))
    assert source.faces == 4
    assert digest_of(target, graph) == source.digest
    whole, _ = read(owner)
    assert whole.faces == 4 * 8
    assert len(whole.surfaces) == 1


def test_thousands_of_leaves_are_one_array():
    trunk = cards([None], [SQUARE] * 2_500, name="trunk")
    leaf = add_mesh("leaf")
    _instancing(trunk, lambda tree, given: _scatter(tree, given, _object_node(tree, leaf)))
    source, _ = read(trunk)
    assert source.matrices.shape == (10_000, 4, 4)
    assert len(source.surfaces) == 1


@pytest.mark.parametrize("kind", ['VERTS', 'FACES'])
def test_instances_on_vertices_and_faces_count(kind):
    base, leaf = cards([None], [SQUARE] * 3, name="base"), add_mesh("leaf", size=0.1)
    base.location = (4, 0, 0)
    leaf.parent, base.instance_type = base, kind
    base.show_instancer_for_render = False
    source, _ = read(base)
    assert [surface.name for surface in source.surfaces] == ["leaf"]
    assert len(source.matrices) == (12 if kind == 'VERTS' else 3)
    middle = _points(source).mean(axis=0)
    np.testing.assert_allclose(middle, np.mean([v.co for v in base.data.vertices], axis=0), atol=1e-4)


def test_particles_count():
    base, leaf = cards([None], [SQUARE] * 4, name="base"), add_mesh("leaf", size=0.1)
    base.location = (0, 0, 9)
    settings = base.modifiers.new("particles", 'PARTICLE_SYSTEM').particle_system.settings
    settings.type, settings.count, settings.render_type = 'HAIR', 50, 'OBJECT'
    settings.instance_object, settings.particle_size = leaf, 1.0
    source, _ = read(base)
    names = [surface.name for surface in source.surfaces]
    assert sorted(names) == ["base", "leaf"]
    assert np.bincount(source.surface)[names.index("leaf")] == 50
    places = source.matrices[source.surface == names.index("leaf"), :3, 3]
    assert np.abs(places[:, 2]).max() < 1


def test_curves_texts_and_balls_have_faces():
    scene = bpy.context.scene.collection
    text = bpy.data.objects.new("text", bpy.data.curves.new("text", 'FONT'))
    text.data.body = "oak"
    curve = bpy.data.curves.new("curve", 'CURVE')
    curve.dimensions, curve.bevel_depth = '3D', 0.1
    spline = curve.splines.new('POLY')
    spline.points.add(3)
    for i, point in enumerate(spline.points):
        point.co = (i, 0, 0, 1)
    ball = bpy.data.objects.new("ball", bpy.data.metaballs.new("ball"))
    ball.data.elements.new()
    for obj in (text, bpy.data.objects.new("curve", curve), ball):
        scene.objects.link(obj)
        source, _ = read(obj)
        assert source.faces > 0
        assert source.name == obj.name


def test_objects_that_are_switched_off_in_viewports_are_read():
    obj = add_mesh("leaf")
    obj.hide_viewport = True
    assert read(obj)[0].faces == 1


def test_materials_of_objects_and_not_only_of_meshes_count():
    red, blue = Paint("red"), Paint("blue")
    red.shader.inputs["Base Color"].default_value = (0.5, 0, 0, 1)
    blue.shader.inputs["Base Color"].default_value = (0, 0, 0.5, 1)
    first = cards([red.material], name="first")
    second = first.copy()
    bpy.context.scene.collection.objects.link(second)
    second.material_slots[0].link = 'OBJECT'
    second.material_slots[0].material = blue.material
    group = bpy.data.collections.new("group")
    bpy.context.scene.collection.children.link(group)
    for obj in (first, second):
        group.objects.link(obj)
    source, _ = read(group)
    assert len(source.surfaces) == 2
    colors = sorted(surface.color[0].tolist() for surface in source.surfaces)
    np.testing.assert_allclose(colors, [(0, 0, 0.5), (0.5, 0, 0)], atol=1e-3)


def test_polygons_of_many_corners_are_one_face():
    mesh = bpy.data.meshes.new("mixed")
    angle = np.linspace(0, 2 * np.pi, 9)[:-1]
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    mesh.from_pydata([*ring.tolist(), (2, 0, 0), (3, 0, 0), (2, 1, 0)], [], [list(range(8)), [8, 9, 10]])
    obj = bpy.data.objects.new("mixed", mesh)
    bpy.context.scene.collection.objects.link(obj)
    surface = read(obj)[0].surfaces[0]
    assert surface.faces == 2
    np.testing.assert_array_equal(np.bincount(surface.face), [6, 1])
    corners = surface.positions[surface.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normal[:, 2] > 0).all()


# What artists can do wrong.


@pytest.mark.parametrize("kind", ["mesh", "empty", "collection"])
def test_assets_without_faces_are_named(kind):
    bare = add_mesh("bare", faces=()) if kind == "mesh" else _empty("bare")
    shown = _collection("bare group", bare) if kind == "collection" else bare
    with pytest.raises(errors.SceneError, match=r'"bare.*" has no faces.*add faces'):
        read(shown)


def test_vertices_that_are_no_numbers_are_named():
    obj = add_mesh("broken")
    obj.data.vertices[1].co.x = np.nan
    with pytest.raises(errors.SceneError, match='"broken" has vertices that are not finite'):
        read(obj)


def test_collections_that_show_each_other_are_named():
    """Blender refuses such a circle at once, but not link by link. It is not in the scene, which would crash."""
    first, second = bpy.data.collections.new("first"), bpy.data.collections.new("second")
    for home, other, name in ((first, second, "a"), (second, first, "b")):
        obj = bpy.data.objects.new(name, None)
        obj.instance_type = 'COLLECTION'
        obj.instance_collection = other
        home.objects.link(obj)
    with pytest.raises(errors.SceneError, match='"first" instances itself, by way of "b"'):
        read(first)


# Digests.


def test_digest_follows_what_is_seen_and_nothing_else():
    paint = Paint()
    picture = image(np.full((4, 4, 3), 0.5))
    paint.texture(picture)
    curves = paint.node("RGBCurve").mapping
    obj = cards([paint.material])
    before = _digest(obj)
    assert before == read(obj)[0].digest == _digest(obj)
    int(before, 16)
    obj.location.x, obj.name = 5, "elsewhere"
    paint.shader.location.x += 10
    assert _digest(obj) == before

    def uv():
        obj.data.uv_layers[0].uv[0].vector.x += 0.1

    def vertex():
        obj.data.vertices[0].co.z += 0.1
        obj.data.update()

    def pixel():
        picture.pixels[0] = 0.75
        picture.update()

    def socket():
        paint.shader.inputs["Alpha"].default_value = 0.5

    def node():
        next(n for n in paint.tree.nodes if n.type == 'TEX_IMAGE').extension = 'CLIP'

    def ends():
        curves.extend = 'HORIZONTAL' if curves.extend == 'EXTRAPOLATED' else 'EXTRAPOLATED'

    def link():
        paint.tree.links.remove(paint.tree.links[-1])

    def modifier():
        obj.modifiers.new("twice", 'ARRAY')

    seen = {before}
    for change in (uv, vertex, pixel, socket, node, ends, link, modifier):
        change()
        found = _digest(obj)
        assert found not in seen, change.__name__
        seen.add(found)


def test_digest_follows_places_of_instances():
    leaf = add_mesh("leaf")
    group = _collection("group", leaf)
    bpy.context.scene.collection.children.link(group)
    before = _digest(group)
    leaf.location.x = 1
    assert _digest(group) != before
    bpy.context.view_layer.update()
    target = target_of(group)
    assert target == target_of(group)
    assert len({target, target_of(group)}) == 1
