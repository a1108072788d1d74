# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Snow whitens what faces the sky, as the scene's number says, and is not there where no scene has any."""

import bpy
import numpy as np
import pytest

from tests.blender.renders import picture, small_scene
from tests.blender.scenes import add_camera, add_plant, depsgraph
from tetflora_addon import buffers
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import frame_cache, refine
from tetflora_addon.blender.materials import materials, microsphere, nodes, snow, soil
from tetflora_addon.blender.results import meshes

pytestmark = [pytest.mark.usefixtures("clean_file"), pytest.mark.fine]

GREEN = (0.05, 0.2, 0.05)


def _year(amount, enabled=True):
    year = bpy.context.scene.tetflora.year
    year.enabled, year.snow = enabled, amount
    return year


def _sheet(material, transmission=0.4, **attributes):
    """A square that fills the view and faces up."""
    size = np.float32(4.0)
    corners = size * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float32)
    every = {"tf_color": np.array([GREEN], np.float32), "tf_transmission": np.array([transmission], np.float32)}
    every |= {name: np.array([value], np.float32) for name, value in attributes.items()}
    polygons = buffers.MeshBuffers(
        corners,
        np.array([[0, 1], [1, 2], [2, 3], [3, 0]], dtype=np.int32),
        np.arange(4, dtype=np.int32),
        np.arange(4, dtype=np.int32),
        np.array([0, 4], dtype=np.int32),
        {name: ("FACE", values) for name, values in every.items()},
    )
    made = bpy.data.objects.new("sheet", meshes.write_mesh("sheet", polygons, [material]))
    bpy.context.scene.collection.objects.link(made)
    return made


def _nodes(tree):
    """A node tree as what can be compared: kinds, values and links."""
    every = sorted(
        (n.bl_idname, n.name, *(str(getattr(s, "default_value", "")) for s in n.inputs if not s.is_linked))
        for n in tree.nodes
    )
    links = [(k.from_node.name, k.from_socket.name, k.to_node.name, k.to_socket.name) for k in tree.links]
    return every, sorted(links)


def _mean():
    return picture().mean(axis=(0, 1))


def test_the_side_that_faces_up_is_white_and_the_other_is_not():
    small_scene(sky=1.0, samples=32)
    _year(1.0)
    material = materials.leaf_material("Oak")
    snow.fit([material])
    made = _sheet(material)
    above = _mean()
    made.rotation_euler = (np.pi, 0.0, 0.0)
    np.testing.assert_allclose(_mean(), above, atol=0.01)  # a leaf upside down has snow on its other side
    bpy.context.scene.camera.location.z, bpy.context.scene.camera.rotation_euler = -50.0, (np.pi, 0.0, 0.0)
    below = _mean()
    np.testing.assert_allclose(above, snow.WHITE[:3], atol=0.02)
    assert below.max() < 0.3
    bpy.context.scene.tetflora.year.snow = 0.0
    assert (below < _mean()).all()  # less light comes through


@pytest.mark.parametrize("amount", [0.1, 0.25, 0.5, 1.0])
def test_the_flatter_a_sheet_lies_the_whiter_it_is(amount):
    small_scene(sky=1.0, samples=16, width=7.0)
    _year(amount)
    material = materials.leaf_material("Oak")
    snow.fit([material])
    made = _sheet(material)
    seen = []
    for degrees in (0.0, 45.0, 75.0, 89.0):
        made.rotation_euler = (0.0, np.radians(degrees), 0.0)
        made.scale = (1.0 / np.cos(np.radians(degrees)), 1.0, 1.0)
        bpy.context.scene.tetflora.year.snow = amount
        with_snow = _mean()[1]
        bpy.context.scene.tetflora.year.snow = 0.0
        seen.append(with_snow - _mean()[1])
    assert (np.diff(seen) < 0.01).all()
    assert seen[-1] == pytest.approx(0.0, abs=0.02)


def test_more_snow_is_never_less_white():
    small_scene(sky=1.0, samples=16)
    material = materials.leaf_material("Oak")
    _year(0.1)
    snow.fit([material])
    _sheet(material)
    seen = []
    for amount in (0.0, 0.1, 0.2, 0.4, 1.0):
        bpy.context.scene.tetflora.year.snow = amount
        seen.append(_mean()[1])
    assert (np.diff(seen) > -0.003).all()
    assert seen[-1] > seen[0] + 0.5


def test_thin_wood_carries_less_than_stout_wood():
    small_scene(sky=1.0, samples=16)
    _year(0.3)
    material = materials.bark_material("Oak", "smooth")
    snow.fit([material])
    made = [_sheet(material, 0.0, tf_girth=girth) for girth in (0.02, 2.0)]
    seen = []
    for one in made:
        one.location.z = 1.0  # above the other
        seen.append(_mean()[1])
        one.location.z = -1.0
    assert seen[1] > seen[0] + 0.05


@pytest.mark.parametrize("amount", [0.3, 1.0])
def test_leaves_facets_and_spheres_of_the_same_kind_are_as_white(amount):
    small_scene(sky=1.0, samples=32)
    _year(amount)
    leaf, facet = materials.leaf_material("Oak"), materials.proxy_material()
    snow.fit([leaf, facet])
    made = _sheet(leaf)
    real = _mean()
    made.data.materials[0] = facet
    np.testing.assert_allclose(_mean(), real, atol=0.03)


def test_leaves_of_a_cluster_shade_each_others_snow():
    """Where most of a cluster is hidden, little of the light that one leaf scatters gets out of it."""
    small_scene(sky=1.0, samples=32)
    _year(1.0)
    facet = materials.proxy_material()
    snow.fit([facet])
    seen = []
    for dull in (0.0, 0.3, 0.6):
        _sheet(facet, tf_dull=dull).location.z = dull  # above the others
        seen.append(_mean())
    for dull, one in zip((0.3, 0.6), seen[1:], strict=True):
        white = np.array(snow.WHITE[:3])
        np.testing.assert_allclose(one / seen[0], (1.0 - dull) / (1.0 - 0.5 * dull * white), atol=0.03)


@pytest.mark.parametrize(
    "make",
    [
        lambda: materials.leaf_material("Oak"),
        lambda: materials.bark_material("Oak"),
        materials.proxy_material,
        materials.sphere_material,
        materials.baked_material,
        microsphere.shell_material,
        microsphere.baked_shell_material,
    ],
)
def test_materials_are_as_before_when_no_scene_has_snow(make):
    material = make()
    trees = [material.node_tree, *(bpy.data.node_groups.get(n) for n in (microsphere.SHELL, microsphere.BAKED_SHELL))]
    trees = [tree for tree in trees if tree is not None]
    before = [_nodes(tree) for tree in trees]
    _year(0.5, enabled=False)
    snow.fit([material])
    assert [_nodes(tree) for tree in trees] == before
    assert snow.SNOW not in bpy.data.node_groups
    _year(0.5)
    for _ in range(2):  # the second time nothing happens
        snow.fit([material])
        changed = [_nodes(tree) for tree in trees]
        assert changed != before
    _year(0.0)
    snow.fit([material])
    assert [_nodes(tree) for tree in trees] == before


def test_materials_of_the_artist_are_left_alone():
    _year(0.5)
    own = bpy.data.materials.new("mine")
    graph = nodes.Graph(compat.shader_tree(own))
    graph.node("ShaderNodeOutputMaterial", {"Surface": graph.node("ShaderNodeBsdfDiffuse")})
    stands_for_it = materials.proxy_material(asset=True)
    before = [_nodes(one.node_tree) for one in (own, stands_for_it)]
    snow.fit([own, stands_for_it, None])
    assert [_nodes(one.node_tree) for one in (own, stands_for_it)] == before
    assert snow.add_snow(own)
    assert not snow.add_snow(own)
    _year(0.0)
    snow.fit([own])
    assert _nodes(own.node_tree) != before[0]  # what the artist asked for stays


def test_each_frame_has_its_own_snow():
    small_scene(sky=1.0, samples=8)
    year, scene = _year(0.0), bpy.context.scene
    for frame, amount in ((1, 0.0), (5, 1.0)):
        year.snow = amount
        year.keyframe_insert("snow", frame=frame)
    scene.frame_set(1)
    assert year.snow == 0.0 and snow.has_snow(scene)
    material = materials.leaf_material("Oak")
    snow.fit([material])
    _sheet(material)
    seen = []
    for frame in (1, 5):
        scene.frame_set(frame)
        seen.append(_mean()[1])
    assert seen[0] < 0.25 and seen[1] > 0.8
    year.enabled = False
    assert _mean()[1] < 0.25


def test_results_get_snow_and_lose_it_with_the_scene():
    add_camera()
    add_plant(species="bush")
    _year(0.5)
    refine.refine(bpy.context.scene, depsgraph())
    made = [m for m in bpy.data.materials if m.name.startswith("TetFlora")]
    assert made and all(any(snow._is_snow(node) for node in m.node_tree.nodes) for m in made)
    digest = frame_cache.choices(bpy.context.scene)
    bpy.context.scene.tetflora.year.snow = 0.7
    assert repr(frame_cache.choices(bpy.context.scene)) == repr(digest)  # the same results serve
    bpy.context.scene.tetflora.year.snow = 0.0
    assert repr(frame_cache.choices(bpy.context.scene)) != repr(digest)
    refine.refine(bpy.context.scene, depsgraph())
    made = [m for m in bpy.data.materials if m.name.startswith("TetFlora") and m.users]
    assert made and not any(snow._is_snow(node) for m in made for node in m.node_tree.nodes)


@pytest.mark.parametrize("plane", [0.0, 1.0])
def test_clouds_are_white_from_above_and_not_from_below(plane):
    """The group of shells, on a plane that has their attributes."""
    small_scene(sky=1.0, samples=64)
    _year(1.0)

    def build(graph, _material):
        cloud = graph.node(
            "ShaderNodeGroup", {"Color": (*GREEN, 1.0), "Transmission": 0.4}, node_tree=snow._cloud_group()
        )
        emission = graph.node("ShaderNodeEmission", {"Color": cloud.outputs["Color"]})
        graph.node("ShaderNodeOutputMaterial", {"Surface": emission})

    _sheet(nodes.surface_material("cloud", 1, build), tf_normal=(0.0, 0.0, -1.0), tf_plane=plane)
    above = _mean()
    camera = bpy.context.scene.camera
    camera.location.z, camera.rotation_euler = -50.0, (np.pi, 0.0, 0.0)
    below = _mean()
    np.testing.assert_allclose(below, GREEN, atol=0.02)
    assert above[1] > 0.7
    assert microsphere.MICROSPHERE not in bpy.data.node_groups  # asks no more than it needs


def test_soil_has_snow_while_a_scene_has():
    cells = np.full((2, 2, 3), 0.1)
    made = soil.soil_material("soil", cells, np.zeros((2, 2)), np.full(3, 0.1), -4 * np.ones(2), 8 * np.ones(2))
    small_scene(sky=1.0, samples=8)
    _sheet(made)
    before, dark = _nodes(made.node_tree), _mean()
    _year(1.0)
    snow.fit(bpy.data.materials)
    assert _mean().min() > 0.8 > 2 * dark.max()
    _year(0.0)
    snow.fit(bpy.data.materials)
    assert _nodes(made.node_tree) == before


def test_a_crown_of_facets_is_as_white_as_its_leaves():
    """From above and from the side; facets and leaves differ by up to a seventh, in summer too."""
    small_scene(sky=0.5, sun=35.0, samples=24, size=48, width=14.0)
    scene = bpy.context.scene
    scene.render.film_transparent = True  # without the sky behind
    add_plant(species="beech")
    _year(0.5)
    seen = []
    for everything in (False, True):
        scene.tetflora.expand_everything = everything
        for turn in (0.0, np.pi / 2):
            scene.camera.location = (0.0, -50.0 * np.sin(turn), 7.0 + 50.0 * np.cos(turn))
            scene.camera.rotation_euler = (turn, 0.0, 0.0)
            if not (everything and turn):  # all leaves are the same from wherever they are seen
                refine.refine(scene, depsgraph())
            seen.append(_mean())
    np.testing.assert_allclose(seen[:2], seen[2:], rtol=0.15)
