# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of clusters together look like the asset that they are of, whatever its materials read."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from tests.blender.renders import picture, small_scene
from tests.blender.scenes import depsgraph
from tetflora_addon.blender import compat
from tetflora_addon.blender.attributes import face_offsets, members, read, values_of, write
from tetflora_addon.blender.results.collection import Results
from tetflora_addon.blender.results.instances import add_cluster, add_cluster_instances
from tetflora_addon.blender.results.meshes import AssetMeshes, SurfaceArrays, cluster_mesh_steps, read_mesh
from tetflora_addon.jobs import run_to_end

ENGINES = ["CYCLES", compat.eevee_engine()]
#: What a material emits: node, output, properties.
READS = [
    ("ShaderNodeTexCoord", "UV", {}),
    ("ShaderNodeUVMap", "UV", {"uv_map": "second"}),
    ("ShaderNodeTexCoord", "Generated", {}),
    ("ShaderNodeTexCoord", "Object", {}),
    ("ShaderNodeTexCoord", "Normal", {}),
    ("ShaderNodeVertexColor", "Color", {}),
    ("ShaderNodeVertexColor", "Color", {"layer_name": "other"}),
    ("ShaderNodeAttribute", "Color", {"attribute_name": "of face"}),
    ("ShaderNodeAttribute", "Fac", {"attribute_name": "number"}),
    ("ShaderNodeAttribute", "Fac", {"attribute_name": "flag"}),
    None,
]


def material(how):
    made = bpy.data.materials.new("reads" if how else "diffuse")
    tree = compat.shader_tree(made)
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse" if how is None else "ShaderNodeEmission")
    if how is not None:
        node = tree.nodes.new(how[0])
        for key, value in how[2].items():
            setattr(node, key, value)
        tree.links.new(node.outputs[how[1]], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return made


def ball(name="ball", materials=None, seed=0, uv=("first", "second"), flat=False):
    """A bumpy sphere of triangles and quads with every kind of attribute and a material for what reads each."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=13, radius=0.8)
    obj = bpy.context.object
    obj.name, mesh = name, obj.data
    rng = np.random.default_rng(seed)
    write(mesh, "position", read(mesh, "position") * rng.uniform(0.9, 1.1, (len(mesh.vertices), 1)))
    while mesh.uv_layers:
        mesh.uv_layers.remove(mesh.uv_layers[0])
    corners, faces = len(mesh.loops), len(mesh.polygons)
    for key in uv:
        mesh.uv_layers.new(name=key)
        write(mesh, key, rng.uniform(0, 1, (corners, 2)))
    mesh.uv_layers[uv[-1]].active_render = False
    mesh.uv_layers[uv[0]].active_render = True
    write(mesh, "other", rng.uniform(0, 1, (len(mesh.vertices), 4)), 'POINT', 'FLOAT_COLOR')
    write(mesh, "bytes", rng.uniform(0, 1, (corners, 4)), 'CORNER', 'BYTE_COLOR')
    mesh.color_attributes.render_color_index = mesh.color_attributes.find("bytes")
    write(mesh, "of face", rng.uniform(0, 1, (faces, 3)), 'FACE', 'FLOAT_VECTOR')
    write(mesh, "number", rng.integers(0, 3, len(mesh.vertices)), 'POINT', 'INT')
    write(mesh, "flag", rng.integers(0, 2, faces), 'FACE', 'BOOLEAN')
    for made in [material(how) for how in READS] if materials is None else materials:
        mesh.materials.append(made)
    write(mesh, "material_index", rng.integers(0, len(mesh.materials), faces), 'FACE', 'INT')
    # Where nobody looks: Cycles 4.5 has one normal for each vertex, of whichever face comes last.
    sharp = members(mesh.polygons, "center", 3)[:, 2] < 0.0
    write(mesh, "sharp_face", np.ones(faces, bool) if flat else sharp, 'FACE', 'BOOLEAN')
    mesh.update()
    return obj


def clusters_of(asset, number, seed=1):
    """All faces of all parts in so many meshes, at random."""
    faces = [len(asset.surfaces[s].slots) for s in asset.surface]
    part = np.repeat(np.arange(len(faces)), faces)
    face = np.concatenate([np.arange(count) for count in faces])
    which = np.random.default_rng(seed).integers(0, number, len(part))
    meshes = []
    for n in range(number):
        meshes.append(run_to_end(cluster_mesh_steps(asset, f"cluster {n}", part[which == n], face[which == n])))
    return meshes


def read_surface(evaluated: bpy.types.Object) -> SurfaceArrays:
    try:
        return read_mesh(evaluated.to_mesh(), [slot.material.original for slot in evaluated.material_slots] or [None])
    finally:
        evaluated.to_mesh_clear()


def shown(meshes):
    for mesh in meshes:
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(mesh.name, mesh))


@pytest.mark.parametrize("engine", ENGINES)
def test_clusters_of_a_mesh_look_like_it(clean_file, engine):
    small_scene(0.5, 16, 50.0, 64, engine, 2.0)
    obj = ball()
    obj.material_slots[0].link = 'OBJECT'
    obj.material_slots[0].material = material(READS[7])
    expected = picture()
    asset = AssetMeshes([read_surface(obj.evaluated_get(depsgraph()))], np.zeros(1), np.eye(4))
    results = Results(bpy.context.scene, 'VIEW')
    results.open()
    made = [add_cluster(results, "ball", n, mesh, obj) for n, mesh in enumerate(clusters_of(asset, 12))]
    bpy.data.objects.remove(obj)
    places, numbers = np.broadcast_to(np.eye(4), (12, 4, 4)), np.arange(12, dtype=np.int32)
    add_cluster_instances(results, "clusters 000", made, numbers, places, numbers)
    results.finish()
    seen = picture()
    assert expected.std() > 0.1
    # EEVEE's edges between clusters differ from run to run, by .0010 to .0021; a material alone counts at least .010.
    assert np.abs(seen - expected).mean() < (0.002 if engine == "CYCLES" else 0.003)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_cluster_of_several_surfaces_looks_like_its_objects(clean_file, engine):
    """Mirrored, stretched and turned, with other UV maps, attributes and materials."""
    small_scene(0.5, 16, 50.0, 64, engine, 4.0)
    first = ball()
    wanted = [*first.data.materials[:2], *first.data.materials[5:]]  # not what counts from the object
    bpy.data.objects.remove(first)
    balls = [
        ball("a", wanted[:1] + wanted[2:], 1, ("uv a", "second")),
        ball("b", wanted[::-1], 2, ("uv b", "second"), True),
    ]
    balls[1].data.attributes.remove(balls[1].data.attributes["number"])
    write(balls[1].data, "number", np.linspace(0, 1, len(balls[1].data.polygons)), 'FACE', 'FLOAT')
    every = [np.diag([1.0, 1.0, 1.0, 1.0]) for _ in range(3)]
    every[0][:3, 3], every[1][:3, 3], every[2][:3, 3] = (-0.9, 0.9, 0), (0.9, -0.8, 0.1), (0.8, 0.9, 0)
    every[1][0, 0], every[2][:3, :3] = -1.0, [[0, -0.8, 0], [1.1, 0, 0], [0, 0, 0.9]]
    copies = [balls[0], balls[0].copy(), balls[1]]
    bpy.context.scene.collection.objects.link(copies[1])
    for obj, matrix in zip(copies, every, strict=True):
        obj.matrix_world = Matrix(matrix.tolist())
    expected = picture()
    surfaces = [read_surface(b.evaluated_get(depsgraph())) for b in balls]
    asset = AssetMeshes(surfaces, np.array([0, 0, 1]), np.array(every))
    for obj in copies:
        bpy.data.objects.remove(obj)
    meshes = clusters_of(asset, 3)
    assert [len(m.materials) for m in meshes] == [len(wanted)] * 3
    shown(meshes)
    seen = picture()
    assert expected.std() > 0.1
    assert np.abs(seen - expected).mean() < 0.002


def test_all_faces_attributes_and_names_are_there(clean_file):
    obj = ball()
    mesh = obj.data
    asset = AssetMeshes([read_surface(obj.evaluated_get(depsgraph()))], np.zeros(1), np.eye(4))
    order = np.random.default_rng(3).permutation(len(mesh.polygons))
    made = run_to_end(cluster_mesh_steps(asset, "all", np.zeros(len(order), int), order))
    assert not made.validate(verbose=True)
    assert len(made.vertices) == len(mesh.vertices) and len(made.edges) == len(mesh.edges)
    assert [layer.name for layer in made.uv_layers if layer.active_render] == ["first"]
    assert made.color_attributes[made.color_attributes.render_color_index].name == "bytes"
    assert list(made.materials) == list(mesh.materials)
    offsets = face_offsets(mesh)
    corner = np.concatenate([np.arange(offsets[f], offsets[f + 1]) for f in order])
    vertex = read(mesh, ".corner_vert")[corner]
    own = read(made, ".corner_vert")
    for key in ("first", "second", "other", "bytes", "of face", "number", "flag", "material_index", "position"):
        a, b = mesh.attributes[key], made.attributes[key]
        assert (a.domain, a.data_type) == (b.domain, b.data_type)
        expected = {"POINT": vertex, "CORNER": corner, "FACE": order}[a.domain]
        found = values_of(b)[own] if a.domain == 'POINT' else values_of(b)
        assert np.array_equal(values_of(a)[expected], found)
    normals = members(mesh.corner_normals, "vector", 3)[corner]
    np.testing.assert_allclose(members(made.corner_normals, "vector", 3), normals, atol=1e-4)
    assert np.array_equal(values_of(made.attributes["sharp_face"]), values_of(mesh.attributes["sharp_face"])[order])


@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.0), (2.0, 0.5, -3.0)])
def test_generated_coordinates_are_those_of_the_part(clean_file, stretch):
    obj = ball()
    matrix = np.diag([*stretch, 1.0])
    matrix[:3, 3] = 1.0, 2.0, 3.0
    asset = AssetMeshes([read_surface(obj.evaluated_get(depsgraph()))], np.zeros(1), matrix)
    made = run_to_end(cluster_mesh_steps(asset, "some", np.zeros(9, int), np.arange(100, 109)))
    inside = (read(made, "position") - np.array(made.texspace_location)) / np.array(made.texspace_size)
    local = (read(made, "position") - matrix[:3, 3]) / np.diag(matrix)[:3]
    own = (local - np.array(obj.data.texspace_location)) / np.array(obj.data.texspace_size)
    np.testing.assert_allclose(inside, own, atol=1e-5)


def test_an_empty_cluster_and_one_that_is_stopped_leave_nothing(clean_file):
    obj = ball()
    asset = AssetMeshes([read_surface(obj.evaluated_get(depsgraph()))], np.zeros(1), np.eye(4))
    none = np.zeros(0, int)
    assert len(run_to_end(cluster_mesh_steps(asset, "none", none, none)).polygons) == 0
    before = len(bpy.data.meshes)
    steps = cluster_mesh_steps(asset, "some", np.zeros(9, int), np.arange(9))
    for number in range(30):
        if next(steps, "ended") == "ended":
            break
        if number == 8:
            steps.close()
    assert len(bpy.data.meshes) == before
