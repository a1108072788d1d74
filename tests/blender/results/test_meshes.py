# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes written from buffers are what Blender itself would have made of them."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from tetflora_addon import buffers
from tetflora_addon.blender.attributes import face_offsets, members
from tetflora_addon.blender.results import meshes

pytestmark = pytest.mark.usefixtures("clean_file")


def write_mesh(*args):
    return meshes.write_mesh(*args)


def read_mesh_arrays(mesh):
    """What a mesh has of buffers, as Blender's own collections tell it."""
    uv = mesh.uv_layers.active
    return MeshBuffers(
        members(mesh.vertices, "co", 3),
        members(mesh.edges, "vertices", 2, np.int32),
        members(mesh.loops, "vertex_index", dtype=np.int32),
        members(mesh.loops, "edge_index", dtype=np.int32),
        face_offsets(mesh),
        {"UVMap": ("CORNER", members(uv.uv, "vector", 2))} if uv is not None and len(mesh.loops) else {},
        bool(members(mesh.polygons, "use_smooth", dtype=bool).any()),
    )


def MeshBuffers(*args, **fields):  # noqa: N802 - stands for the class of the enabled extension
    return buffers.MeshBuffers(*args, **fields)


def prism():
    """A triangular prism: faces of three and four corners, closed."""
    edges = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]
    corners = [0, 2, 1, 3, 4, 5, 0, 1, 4, 3, 1, 2, 5, 4, 2, 0, 3, 5]
    corner_edges = [2, 1, 0, 3, 4, 5, 0, 7, 3, 6, 1, 8, 4, 7, 2, 6, 5, 8]
    rng = np.random.default_rng(0)
    return MeshBuffers(
        positions=np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=np.float32),
        edge_verts=np.array(edges, dtype=np.int32),
        corner_verts=np.array(corners, dtype=np.int32),
        corner_edges=np.array(corner_edges, dtype=np.int32),
        face_offsets=np.array([0, 3, 6, 10, 14, 18], dtype=np.int32),
        attributes={
            "UVMap": ("CORNER", rng.random((18, 2), dtype=np.float32)),
            "tf_color": ("FACE", rng.random((5, 3), dtype=np.float32)),
            "tf_transmission": ("FACE", rng.random(5, dtype=np.float32)),
            "tf_bary": ("POINT", rng.random((6, 3), dtype=np.float32)),
            "material_index": ("FACE", np.array([0, 0, 1, 1, 1], dtype=np.int32)),
        },
    )


def test_blender_finds_nothing_to_repair():
    mesh = write_mesh("prism", prism())
    assert mesh.validate(verbose=True) is False
    # Blender's own edges from the faces are the same set.
    before = {tuple(sorted(edge.vertices)) for edge in mesh.edges}
    mesh.update(calc_edges=True)
    assert {tuple(sorted(edge.vertices)) for edge in mesh.edges} == before


def test_what_was_written_can_be_read():
    buffers = prism()
    back = read_mesh_arrays(write_mesh("prism", buffers))
    for field in ("positions", "edge_verts", "corner_verts", "corner_edges", "face_offsets"):
        np.testing.assert_array_equal(getattr(back, field), getattr(buffers, field))
        assert getattr(back, field).dtype == getattr(buffers, field).dtype
    np.testing.assert_array_equal(back.attributes["UVMap"][1], buffers.attributes["UVMap"][1])


def test_attributes_have_the_domains_and_types_of_the_contract():
    buffers = prism()
    mesh = write_mesh("prism", buffers)
    kinds = {a.name: (a.domain, a.data_type) for a in mesh.attributes}
    assert kinds["UVMap"] == ("CORNER", "FLOAT2")
    assert kinds["tf_color"] == ("FACE", "FLOAT_VECTOR")
    assert kinds["tf_transmission"] == ("FACE", "FLOAT")
    assert kinds["tf_bary"] == ("POINT", "FLOAT_VECTOR")
    assert mesh.uv_layers.active.name == "UVMap"
    assert [p.material_index for p in mesh.polygons] == [0, 0, 1, 1, 1]
    values = np.zeros(15, dtype=np.float32)
    mesh.attributes["tf_color"].data.foreach_get("vector", values)
    np.testing.assert_array_equal(values.reshape(5, 3), buffers.attributes["tf_color"][1])


def test_normals_point_outwards():
    mesh = write_mesh("prism", prism())
    assert len(mesh.polygons) == 5
    for polygon in mesh.polygons:
        assert polygon.normal.dot(polygon.center - mesh.polygons[0].center.lerp(mesh.polygons[1].center, 0.5)) > 0.0


@pytest.mark.parametrize("smooth", [True, False])
def test_shading(smooth):
    mesh = write_mesh("prism", replace(prism(), smooth=smooth))
    assert {p.use_smooth for p in mesh.polygons} == {smooth}
    assert mesh.normals_domain == ("POINT" if smooth else "FACE")
    assert read_mesh_arrays(mesh).smooth is smooth


def test_materials_fill_the_slots():
    materials = [bpy.data.materials.new("a"), None, bpy.data.materials.new("b")]
    assert list(write_mesh("prism", prism(), materials).materials) == materials


def test_an_empty_mesh():
    none = np.zeros(0, dtype=np.int32)
    mesh = write_mesh(
        "empty",
        MeshBuffers(
            np.zeros((0, 3), dtype=np.float32),
            none.reshape(0, 2),
            none,
            none,
            np.zeros(1, dtype=np.int32),
            {
                "tf_color": ("FACE", np.zeros((0, 3), dtype=np.float32)),
                "UVMap": ("CORNER", np.zeros((0, 2), np.float32)),
            },
        ),
    )
    assert len(mesh.polygons) == 0
    assert read_mesh_arrays(mesh).polygons == 0


def test_a_mesh_of_an_artist():
    bpy.ops.mesh.primitive_cube_add()
    mesh = bpy.context.object.data
    back = read_mesh_arrays(mesh)
    assert back.polygons == 6
    assert np.diff(back.face_offsets).tolist() == [4] * 6
    assert back.attributes["UVMap"][1].shape == (24, 2)
    # Reading and writing again gives the same cube.
    again = write_mesh("again", back)
    assert again.validate() is False
    assert sorted(p.area for p in again.polygons) == sorted(p.area for p in mesh.polygons)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"positions": np.zeros((6, 2), np.float32)}, "positions must be"),
        ({"positions": np.zeros((6, 3))}, "positions must be float32"),
        ({"positions": np.zeros((5, 3), np.float32)}, "edge_verts must lie between 0 and 4"),
        ({"corner_edges": np.zeros(17, np.int32)}, "corner_edges must be"),
        ({"corner_edges": np.full(18, 9, np.int32)}, "corner_edges must lie"),
        ({"corner_verts": np.full(18, -1, np.int32)}, "corner_verts must lie"),
        ({"face_offsets": np.array([0, 3, 6, 10, 14, 17], np.int32)}, "face_offsets must rise"),
        ({"face_offsets": np.array([0, 2, 6, 10, 14, 18], np.int32)}, "face_offsets must rise"),
        ({"attributes": {"a": ("FACE", np.zeros(4, np.float32))}}, "has 4 values, but FACE has 5 elements"),
        ({"attributes": {"a": ("EDGE", np.zeros(9, np.float32))}}, "domain must be one of"),
        ({"attributes": {"a": ("FACE", np.zeros(5))}}, "no type for float64"),
        ({"attributes": {"UVMap": ("FACE", np.zeros((5, 2), np.float32))}}, "on CORNER"),
    ],
)
def test_broken_buffers_are_refused_and_leave_nothing(change, message):
    with pytest.raises(ValueError, match=message):
        write_mesh("broken", replace(prism(), **change))
    assert len(bpy.data.meshes) == 0
