# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of the artist's own in refinement: as they are where near, proxies where far, and originals come back."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.assets.scatters import scattered
from tests.blender.renders import picture
from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, depsgraph, select
from tetflora_addon import errors
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import refine, render
from tetflora_addon.blender.materials import face_looks
from tetflora_addon.blender.scene.explicit import read_explicit
from tetflora_addon.blender.species import edits

pytestmark = pytest.mark.usefixtures("clean_file")


def _material(name="paint", color=(0.2, 0.5, 0.1, 1.0), image=None):
    material = bpy.data.materials.new(name)
    tree = compat.shader_tree(material)
    principled = next(n for n in tree.nodes if n.type == 'BSDF_PRINCIPLED')
    principled.inputs["Base Color"].default_value = color
    if image is not None:
        texture = tree.nodes.new("ShaderNodeTexImage")
        texture.image = image
        tree.links.new(texture.outputs["Color"], principled.inputs["Base Color"])
        tree.links.new(texture.outputs["Alpha"], principled.inputs["Alpha"])
    return material


def _leaves(name="leaves", count=400, spread=2.0, size=0.1, seed=0, material=None):
    """Loose quads, the last of them without area."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform([-spread, -spread, 0], [spread, spread, 2 * spread], (count, 1, 3))
    a, b = size * rng.normal(size=(2, count, 1, 3))
    b[-1] = 0
    corners = np.concatenate([middle, middle + a, middle + a + b, middle + b], axis=1).reshape(-1, 3)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners.tolist(), [], np.arange(4 * count).reshape(-1, 4).tolist())
    layer = mesh.uv_layers.new(name="Foil")
    layer.uv.foreach_set("vector", (corners[:, :2] * 0.5).astype(np.float32).ravel())
    mesh.materials.append(material or _material())
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    obj.tetflora.is_explicit = True
    return obj


def _scene():
    add_camera(location=(0.0, -16.0, 2.0))
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 320, 240
    scene.render.resolution_percentage = 100
    return scene


def _refine(scene, **settings):
    for name, value in settings.items():
        setattr(scene.tetflora, name, value)
    return refine.refine(scene, depsgraph())


def _made(scene, kind="explicit"):
    return [o for o in scene.objects if o.get("tetflora_kind") == kind]


def _points(objects):
    return np.array([o.matrix_world @ v.co for o in objects for v in o.data.vertices])


def _area(objects):
    return sum(p.area for o in objects for p in o.data.polygons)


def _read():
    return read_explicit(depsgraph())


@pytest.mark.fine
def test_near_meshes_come_out_as_they_are_without_any_plant():
    """Faces, material, texture coordinates; the original is hidden meanwhile."""
    scene = _scene()
    leaves = _leaves()
    broken = scene.tetflora.species_edits.add()  # none of the scene's business
    broken.identifier, broken.text = min(edits.catalog()), "{"
    statistics = _refine(scene)
    made = _made(scene)
    assert sum(len(o.data.polygons) for o in made) == 400 == statistics.polygons_meshed == statistics.polygons_full
    assert {len(p.vertices) for o in made for p in o.data.polygons} == {4}
    assert _area(made) == pytest.approx(_area([leaves]), rel=1e-5)
    assert made[0].data.materials[0] == leaves.data.materials[0]
    uv, place = np.zeros((1600, 2), np.float32), np.zeros((1600, 3), np.float32)
    made[0].data.uv_layers["Foil"].uv.foreach_get("vector", uv.ravel())
    place = np.array([made[0].data.vertices[loop.vertex_index].co for loop in made[0].data.loops])
    np.testing.assert_allclose(uv, 0.5 * place[:, :2], atol=1e-5)
    assert (leaves.hide_render, leaves.hide_viewport) == (True, True)
    assert statistics.plants == 0


def test_far_meshes_become_proxies_of_their_color():
    scene = _scene()
    leaves = _leaves(size=0.02, count=4_000)
    leaves.location.y = 500.0
    statistics = _refine(scene)
    assert not _made(scene)
    (proxies,) = _made(scene, "proxy")
    assert 0 < len(proxies.data.polygons) == statistics.polygons_proxy < 2_000
    assert _area([proxies]) == pytest.approx(_area([leaves]), rel=4 * statistics.polygons_proxy**-0.5)
    color = np.zeros((len(proxies.data.polygons), 3), np.float32)
    proxies.data.attributes["tf_color"].data.foreach_get("vector", color.ravel())
    np.testing.assert_allclose(color, np.tile([0.2, 0.5, 0.1], (len(color), 1)), atol=1e-6)
    assert _points([proxies])[:, 1].min() > 490


@pytest.mark.parametrize("flags", [(False, False), (False, True)])
def test_clear_gives_visibility_back(flags):
    """Also after refining again, and after a rename."""
    scene = _scene()
    leaves = _leaves()
    leaves.hide_render, leaves.hide_viewport = flags
    before = datablocks()
    first = _refine(scene)
    second = _refine(scene)
    assert first.polygons_meshed == second.polygons_meshed
    assert len(_made(scene)) > 0
    leaves.name = "renamed"
    refine.clear(scene)
    assert (leaves.hide_render, leaves.hide_viewport) == flags
    leaves.name = "leaves"
    assert datablocks() == before
    assert not [key for key in list(leaves.keys()) if key.startswith("tetflora_")]


def test_a_job_that_is_closed_or_fails_leaves_originals_visible(monkeypatch):
    scene = _scene()
    leaves = _leaves()
    before = datablocks()
    steps = refine.refine_steps(scene, depsgraph())
    for progress in steps:
        if "Keeping" in progress.message:
            break
    steps.close()
    assert datablocks() == before
    assert not (leaves.hide_render or leaves.hide_viewport)

    def broken(*_arguments):
        raise MemoryError

    _refine(scene)
    monkeypatch.setattr(refine, "_write_polygons", broken)
    with pytest.raises(MemoryError):
        _refine(scene)
    assert leaves.hide_render  # earlier results are still there
    assert _made(scene)
    refine.clear(scene)
    assert not (leaves.hide_render or leaves.hide_viewport)


def test_results_for_a_render_and_those_of_the_artist_do_not_meet():
    scene = _scene()
    leaves = _leaves()
    _refine(scene)
    refine.refine(scene, depsgraph(), for_render=True)
    assert leaves.hide_render
    refine.clear(scene, for_render=True)
    assert (leaves.hide_render, leaves.hide_viewport) == (True, True)
    refine.clear(scene)
    assert (leaves.hide_render, leaves.hide_viewport) == (False, False)
    refine.refine(scene, depsgraph(), for_render=True)
    assert (leaves.hide_render, leaves.hide_viewport) == (True, False)
    refine.clear(scene, for_render=True)
    assert not leaves.hide_render


def test_a_render_refines_a_scene_that_has_meshes_alone():
    """Refine at Render needs no plant; afterward the original is as it was."""
    scene = _scene()
    leaves = _leaves()
    assert scene.tetflora.refine_at_render
    render.on_render_pre(scene)
    assert render.render_errors() == []
    assert _made(scene)
    assert leaves.hide_render
    render.on_render_end(scene)
    assert not _made(scene)
    assert not leaves.hide_render


def test_instances_of_collections_take_part_each_in_its_place():
    """With all that the collection shows; the empty is hidden, the collection is not."""
    scene = _scene()
    group = bpy.data.collections.new("group")
    for obj in (_leaves(), add_mesh("rock")):
        group.objects.link(obj)
        scene.collection.objects.unlink(obj)
    for i in range(3):
        empty = bpy.data.objects.new(f"copy {i}", None)
        empty.instance_type, empty.instance_collection = 'COLLECTION', group
        empty.location, empty.scale = (6.0 * i - 6, 0.0, 0.0), (1.0, 1.0, 1.0 + i)
        scene.collection.objects.link(empty)
    explicit = _read()
    assert len(explicit.meshes.surfaces) == 2
    assert explicit.meshes.faces == 3 * 401
    assert [o.name for o in explicit.originals] == ["copy 0", "copy 1", "copy 2"]
    np.testing.assert_allclose(sorted(set(explicit.meshes.origin[:, 0])), [-6, 0, 6])
    _refine(scene)
    assert all(o.hide_render for o in explicit.originals)
    height = [_points(_made(scene))[:, 2][np.abs(_points(_made(scene))[:, 0] - x) < 2].max() for x in (-6, 0, 6)]
    assert height[0] < 0.7 * height[1] < 0.7 * height[2]
    refine.clear(scene)
    assert not any(o.hide_render or o.hide_viewport for o in explicit.originals)


def test_modifiers_and_curves_count():
    scene = _scene()
    box = add_mesh("sheet")
    box.modifiers.new("array", 'ARRAY').count = 5
    curve = bpy.data.curves.new("stem", 'CURVE')
    curve.dimensions, curve.bevel_depth = '3D', 0.1
    curve.splines.new('POLY').points.add(1)
    curve.splines[0].points[1].co = (0, 0, 3, 1)
    stem = bpy.data.objects.new("stem", curve)
    scene.collection.objects.link(stem)
    box.tetflora.is_explicit = stem.tetflora.is_explicit = True
    explicit = _read()
    faces = {s.name: len(s.material) for s in explicit.meshes.surfaces}
    assert faces["sheet"] == 5
    assert faces["stem"] > 3
    assert explicit.meshes.solid[-faces["stem"] :].all() or explicit.meshes.solid[: faces["stem"]].all()


def test_colors_come_from_materials_images_and_attributes():
    looks = face_looks.Looks()
    image = bpy.data.images.new("picture", 8, 8, alpha=True)
    pixels = np.zeros((8, 8, 4), np.float32)
    pixels[:4] = (1.0, 0.5, 0.0, 1.0)  # the other half is transparent, and counts for nothing
    image.pixels.foreach_set(pixels.ravel())
    look = looks.of(_material(image=image), {})
    np.testing.assert_allclose(look.color, (1.0, 0.214, 0.0), atol=2e-3)
    assert look.coverage == pytest.approx(0.5)
    assert look.transmission == 0
    np.testing.assert_allclose(looks.of(_material(), {}).color, (0.2, 0.5, 0.1), atol=1e-6)
    assert looks.of(None, {}).color == (0.8, 0.8, 0.8)
    image = bpy.data.images.new("broken", 4, 4, alpha=True, float_buffer=True)
    pixels = np.full((16, 4), (0.5, 0.25, 0.0, 1.0), np.float32)
    pixels[3, 1], pixels[5, 3] = np.nan, np.inf
    image.pixels.foreach_set(pixels.ravel())
    look = looks.of(_material("broken", image=image), {})
    np.testing.assert_allclose(look.color, (0.5, 0.25, 0.0), atol=1e-6)
    assert look.coverage == pytest.approx(14 / 16)
    painted = _material("painted")
    tree = painted.node_tree
    node = tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = "Paint"
    tree.links.new(node.outputs["Color"], next(n for n in tree.nodes if n.type == 'BSDF_PRINCIPLED').inputs[0])
    found = looks.of(painted, {"Paint": np.array([[0, 0.2, 0.4], [0.2, 0.2, 0.0]], np.float32)})
    np.testing.assert_allclose(found.color, (0.1, 0.2, 0.2), atol=1e-6)


def test_nodes_that_are_switched_off_have_no_say():
    material = _material(color=(0.2, 0.5, 0.1, 1.0))
    material.diffuse_color = (0.7, 0.1, 0.3, 1.0)
    if bpy.app.version < (5, 0, 0):  # from then on nodes cannot be switched off
        material.use_nodes = False
    expected = (0.7, 0.1, 0.3) if bpy.app.version < (5, 0, 0) else (0.2, 0.5, 0.1)
    np.testing.assert_allclose(face_looks.Looks().of(material, {}).color, expected, atol=1e-6)


@pytest.mark.parametrize("what", ["faces", "numbers"])
def test_what_cannot_be_refined_is_named(what):
    scene = _scene()
    stone = add_mesh("stone", faces=[] if what == "faces" else [(0, 1, 2)])
    stone.tetflora.is_explicit = True
    if what == "numbers":
        stone.data.vertices[1].co.x = float("nan")
    before = datablocks()
    with pytest.raises(errors.SceneError, match="stone"):
        _refine(scene)
    assert datablocks() == before
    assert not stone.hide_render


def test_what_is_linked_is_refused_because_its_file_keeps_its_flags(tmp_path):
    scene, path = _scene(), str(tmp_path / "rocks.blend")
    bpy.data.libraries.write(path, {_leaves("source")})
    bpy.data.batch_remove([bpy.data.objects["source"]])
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["source"]
    scene.collection.objects.link(wanted.objects[0])
    with pytest.raises(errors.SceneError, match=r'"source" is linked.*Library Override'):
        _refine(scene)


def test_plants_meshes_and_occluders_together():
    """A mesh that hides plants takes part as well, and a hidden plant costs less than one that is seen."""
    scene = _scene()
    add_plant()
    free = _refine(scene)
    wall = add_mesh("wall", size=6.0)
    wall.location, wall.rotation_euler = (0, -4, 0), (np.pi / 2, 0, 0)
    wall.tetflora.is_explicit = wall.tetflora.is_occluder = True
    both = _refine(scene)
    assert sum(len(o.data.polygons) for o in _made(scene)) == 1
    assert _area(_made(scene)) == pytest.approx(144, rel=1e-5)
    assert both.polygons_meshed < 0.5 * free.polygons_meshed
    assert both.polygons_full == free.polygons_full + 1


@pytest.mark.fine
def test_the_refined_picture_is_that_of_the_mesh():
    """Mean radiance over blocks of the picture; the leaf limit makes most of it proxies."""

    scene = _scene()
    leaves = _leaves(count=30_000, size=0.025, spread=3.0)
    leaves.location.z = -1.0
    scene.world = bpy.data.worlds.new("sky")
    compat.shader_tree(scene.world).nodes["Background"].inputs["Color"].default_value = (0.8, 0.8, 0.8, 1.0)
    scene.render.engine = 'CYCLES'
    scene.render.resolution_x, scene.render.resolution_y = 96, 72
    scene.cycles.samples = 64
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.tetflora.refine_at_render = False

    def blocks():
        return picture()[..., :3].mean(axis=2).reshape(9, 8, 12, 8).mean(axis=(1, 3))

    truth = blocks()
    statistics = _refine(scene, leaf_limit=24.0, facet=2.4)
    assert statistics.polygons_meshed < 0.2 * statistics.polygons_full
    assert 5_000 < statistics.polygons_proxy < 0.5 * statistics.polygons_full
    refined = blocks()
    assert np.ptp(truth) > 0.2
    assert np.sqrt(((refined - truth) ** 2).mean()) < 0.03


def test_smooth_normals_survive_turning_and_mirroring():
    scene = _scene()
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    ball = bpy.context.object
    ball.data.shade_smooth()
    ball.scale, ball.rotation_euler = (-2.0, 1.0, 1.5), (0.3, 0.2, 0.1)
    ball.tetflora.is_explicit = True
    matrix = np.array(depsgraph().id_eval_get(ball).matrix_world)
    _refine(scene)
    (made,) = _made(scene)
    mesh = made.data
    assert len(mesh.polygons) == len(ball.data.polygons)
    normals, place = np.zeros((len(mesh.loops), 3), np.float32), _points([made])
    mesh.corner_normals.foreach_get("vector", normals.ravel())
    verts = np.zeros(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", verts)
    # Of an ellipsoid they are the gradient of its equation; those of the polyhedron differ by a few degrees.
    inverse = np.linalg.inv(matrix[:3, :3])
    expected = place[verts] @ inverse.T @ inverse
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.einsum("ni,ni->n", normals, expected).min() > 0.97


def test_instances_of_nodes_take_part_and_their_maker_is_hidden():
    _scene()
    leaves = _leaves(count=50)
    leaves.hide_render = True  # as who scatters it would have it; its instances render all the same
    points = add_mesh("points", size=4.0)
    tree = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
    tree.interface.new_socket(name="Geometry", in_out='INPUT', socket_type="NodeSocketGeometry")
    tree.interface.new_socket(name="Geometry", in_out='OUTPUT', socket_type="NodeSocketGeometry")
    given, made, info, place = (
        tree.nodes.new(name)
        for name in ("NodeGroupInput", "NodeGroupOutput", "GeometryNodeObjectInfo", "GeometryNodeInstanceOnPoints")
    )
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = leaves, True
    tree.links.new(given.outputs[0], place.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], place.inputs["Instance"])
    tree.links.new(place.outputs[0], made.inputs[0])
    points.modifiers.new("scatter", 'NODES').node_group = tree
    points.tetflora.is_explicit = True
    explicit = _read()
    assert explicit.meshes.faces == 4 * 50
    assert len(explicit.meshes.surfaces) == 1
    assert [o.name for o in explicit.originals] == ["points"]
    assert sorted(map(tuple, explicit.meshes.origin[:, :2])) == [(-4, -4), (-4, 4), (4, -4), (4, 4)]
    points.tetflora.is_explicit, leaves.hide_render = False, False  # marked is what is instanced
    assert (_read().meshes.faces, len(_read().originals)) == (5 * 50, 2)


def test_the_operator_marks_and_unmarks():
    add_camera()
    stone, plant = add_mesh("stone"), add_plant()
    select(stone, plant)
    bpy.ops.tetflora.mark(what='EXPLICIT')
    assert stone.tetflora.is_explicit
    assert not plant.tetflora.is_explicit
    bpy.ops.tetflora.mark(what='EXPLICIT')
    assert not stone.tetflora.is_explicit
    select(plant)
    with pytest.raises(RuntimeError, match="Select meshes, or objects that instance them, first"):
        bpy.ops.tetflora.mark(what='EXPLICIT')


@pytest.mark.parametrize("what", ["mesh", "collection", "outer collection"])
@pytest.mark.parametrize("fails", [False, True])
def test_what_is_disabled_in_viewports_has_its_modifiers(fails, what):
    """As renders show it; afterward it is disabled, and its eye as it was. Viewports do not show results either."""
    scene = _scene()
    outer, inner = (bpy.data.collections.new(name) for name in ("outer", "inner"))
    scene.collection.children.link(outer)
    outer.children.link(inner)
    sheet = add_mesh("sheet")
    inner.objects.link(sheet)
    scene.collection.objects.unlink(sheet)
    sheet.modifiers.new("array", 'ARRAY').count = 5
    sheet.tetflora.is_explicit = True
    disabled = {"mesh": sheet, "collection": inner, "outer collection": outer}[what]
    disabled.hide_viewport = True
    before = datablocks()
    if fails:
        sheet.matrix_world[0][3] = float("nan")
        with pytest.raises(errors.SceneError):
            _refine(scene)
    else:
        assert _refine(scene).polygons_full == 5
        made = _made(scene)
        assert made and all(o.hide_viewport and not o.hide_render for o in made)
        refine.clear(scene)
    assert datablocks() == before or not fails
    assert [one.hide_viewport for one in (sheet, inner, outer)] == [one is disabled for one in (sheet, inner, outer)]
    assert not sheet.visible_get()
    disabled.hide_viewport = False
    assert (sheet.hide_render, sheet.hide_get(), sheet.visible_get()) == (False, False, True)
    assert sheet.users_collection == (inner,)


def test_plants_that_a_mesh_instances_render_where_it_is_disabled_in_viewports():
    scene = _scene()
    ground = scattered(add_plant("source", collection=bpy.data.collections.new("apart")), 4)
    ground.tetflora.is_scatter = False
    assert _refine(scene).plants == 4
    refine.clear(scene)
    ground.hide_viewport = True
    assert _refine(scene).plants == 4
    ground.hide_viewport = False
    home = bpy.data.collections.new("home")
    scene.collection.children.link(home)
    scene.collection.objects.unlink(ground)
    home.objects.link(ground)
    home.hide_viewport = True
    refine.clear(scene)
    assert _refine(scene).plants == 4
    refine.clear(scene)
    home.hide_viewport = False
    bpy.context.view_layer.layer_collection.children["home"].hide_viewport = True  # the eye
    assert _refine(scene).plants == 4


def test_what_is_linked_and_disabled_in_its_file_shows_its_instances(tmp_path):
    scene, path = _scene(), str(tmp_path / "ground.blend")
    ground = scattered(add_plant("source", collection=bpy.data.collections.new("apart")), 4)
    ground.tetflora.is_scatter, ground.hide_viewport = False, True
    bpy.data.libraries.write(path, {ground})
    bpy.data.batch_remove([ground, bpy.data.objects["source"]])
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["ground"]
    linked = wanted.objects[0]
    scene.collection.objects.link(linked)
    assert _refine(scene).plants == 4
    assert linked.hide_viewport and not linked.visible_get() and linked.users_collection == (scene.collection,)
