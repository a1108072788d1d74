# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground that plants grow on, read from the scene."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_mesh, depsgraph
from tetflora_addon import errors
from tetflora_addon.blender.placing import terrain
from tetflora_addon.planting import places, rules

pytestmark = pytest.mark.usefixtures("clean_file")


def _read(*objects, **options):
    return terrain.read_ground(objects, depsgraph(), **options)


def _collection(name, *objects):
    collection = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(collection)
    for obj in objects:
        collection.objects.link(obj)
    return collection


def _curve(kind='POLY', points=((0, 0, 0), (4, 0, 0), (4, 3, 0)), cyclic=False, **data):
    curve = bpy.data.curves.new("curve", 'CURVE')
    curve.dimensions = '3D'
    spline = curve.splines.new(kind)
    if kind == 'BEZIER':
        spline.bezier_points.add(len(points) - 1)
        for knot, co in zip(spline.bezier_points, points, strict=True):
            knot.co, knot.handle_left_type, knot.handle_right_type = co, 'AUTO', 'AUTO'
    else:
        spline.points.add(len(points) - 1)
        for knot, co in zip(spline.points, points, strict=True):
            knot.co = (*co, 1.0)
    spline.use_cyclic_u = cyclic
    for key, value in data.items():
        setattr(curve, key, value)
    return bpy.data.objects.new("curve", curve)


def _image(values):
    height, width = values.shape
    image = bpy.data.images.new("mask", width, height, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.repeat(values[..., None], 4, axis=-1).astype(np.float32).ravel())
    return image


def _with_uv(ground):
    """The square's corners at the corners of the image."""
    layer = ground.data.uv_layers.new(name="Map")
    for loop in ground.data.loops:
        x, y, _ = ground.data.vertices[loop.vertex_index].co
        layer.uv[loop.index].vector = ((x + 1.0) / 2.0, (y + 1.0) / 2.0)
    return ground


def test_triangles_and_border_are_in_world_space_with_modifiers():
    ground = add_mesh("ground")
    ground.location, ground.scale = (10.0, 0.0, 1.0), (2.0, 2.0, 2.0)
    ground.modifiers.new("more", 'SUBSURF').subdivision_type = 'SIMPLE'
    read = _read(ground)
    assert read.triangles.shape == (8, 3, 3)
    assert np.allclose(read.triangles.min(axis=(0, 1)), (8.0, -2.0, 1.0))
    assert read.border.shape == (8, 2, 3)  # two for each side; the four edges inside are none
    assert np.allclose(np.abs(read.border[..., :2] - (10.0, 0.0)).max(axis=-1), 2.0)
    assert read.weight is None and read.uv is None and read.image is None


def test_vertex_groups_are_weights_of_corners():
    ground = add_mesh("ground")
    group = ground.vertex_groups.new(name="Trees")
    for index, weight in ((0, 0.25), (1, 1.0), (3, 0.5)):
        group.add([index], weight, 'REPLACE')
    for inverted in (False, True):
        read = _read(ground, vertex_group="Trees", invert_group=inverted)
        assert read.triangles.shape == (2, 3, 3)
        expected = {(-1, -1): 0.25, (1, -1): 1.0, (1, 1): 0.0, (-1, 1): 0.5}
        for corner, weight in zip(read.triangles.reshape(-1, 3), read.weight.ravel(), strict=True):
            wanted = expected[tuple(corner[:2])]
            assert weight == pytest.approx(1.0 - wanted if inverted else wanted)


def test_float_attributes_serve_as_groups():
    ground = add_mesh("ground")
    ground.data.attributes.new("Trees", 'FLOAT', 'POINT').data.foreach_set("value", [0.0, 0.5, 1.0, 0.5])
    read = _read(ground, vertex_group="Trees")
    assert set(read.weight.ravel().tolist()) == {0.0, 0.5, 1.0}


def test_plants_grow_where_the_image_is_bright():
    ground = _with_uv(add_mesh("ground"))
    values = np.zeros((16, 16))
    values[8:, :8] = 1.0  # north-west: rows of pixels go up
    wanted = rules.Rules(count=200)
    place = places.place
    for inverted in (False, True):
        placed = place(_read(ground, image=_image(values), invert_image=inverted), wanted).position
        # Half a texel of the border is neither black nor white.
        bright = (placed[:, 0] < 1.0 / 8.0) & (placed[:, 1] > -1.0 / 8.0)
        dark = (placed[:, 0] > -1.0 / 8.0) | (placed[:, 1] < 1.0 / 8.0)
        assert len(placed) == 200 and (dark if inverted else bright).all()


def test_colors_count_by_their_luminance():
    ground = _with_uv(add_mesh("ground"))
    image = bpy.data.images.new("green", 2, 2, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.tile([0.0, 1.0, 0.0, 1.0], 4).astype(np.float32))
    assert np.allclose(_read(ground, image=image, uv_layer="Map").image, 0.7152)


def test_cyclic_curves_are_areas_and_all_are_paths():
    ground = add_mesh("ground", size=10.0)
    closed, open_ = _curve(cyclic=True), _curve()
    closed.location, closed.scale = (1.0, 2.0, 5.0), (2.0, 2.0, 2.0)
    both = _collection("curves", closed, open_)
    read = _read(ground, areas=both, paths=both, path_distance=1.5)
    assert len(read.areas) == 1
    assert np.allclose(read.areas[0], [(1, 2), (9, 2), (9, 8)])
    by_length = sorted(read.paths, key=lambda p: len(p.points))
    assert [len(p.points) for p in by_length] == [3, 4]
    assert np.allclose(by_length[0].points, [(0, 0), (4, 0), (4, 3)])
    assert np.allclose(by_length[1].points[0], by_length[1].points[-1])
    assert all(p.half_width == 1.5 for p in read.paths)


@pytest.mark.parametrize("cyclic", [False, True])
def test_bezier_curves_are_the_same_with_a_bevel_and_wider(cyclic):
    ground = add_mesh("ground", size=10.0)
    thin = _read(ground, paths=_collection("thin", _curve('BEZIER', cyclic=cyclic))).paths
    thick = _read(ground, paths=_collection("thick", _curve('BEZIER', cyclic=cyclic, bevel_depth=0.5))).paths
    assert len(thin[0].points) > 20
    assert np.allclose(thin[0].points, thick[0].points, atol=1e-5)
    assert (thin[0].half_width, thick[0].half_width) == (0.0, 0.5)


def test_each_spline_is_a_line_of_its_own():
    ground = add_mesh("ground", size=10.0)
    curve = _curve(cyclic=True)
    spline = curve.data.splines.new('POLY')
    spline.points.add(1)
    spline.points[0].co, spline.points[1].co = (7, 7, 0, 1), (8, 8, 0, 1)
    read = _read(ground, areas=_collection("areas", curve), paths=_collection("paths", curve))
    assert [len(a) for a in read.areas] == [3]
    assert [len(p.points) for p in read.paths] == [4, 2]


def test_nurbs_curves_work_without_a_bevel():
    ground = add_mesh("ground", size=10.0)
    points = ((0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0))
    read = _read(ground, areas=_collection("areas", _curve('NURBS', points, cyclic=True)))
    assert len(read.areas[0]) > 10
    with pytest.raises(errors.SceneError, match=r'NURBS curve "curve\.001" has a bevel'):
        _read(ground, areas=_collection("bevelled", _curve('NURBS', points, cyclic=True, bevel_depth=0.1)))


def test_hair_curves_are_lines():
    curves = bpy.data.hair_curves.new("hair")
    curves.add_curves([3, 2])
    curves.attributes["position"].data.foreach_set("vector", np.arange(15, dtype=np.float32))
    curves.attributes.new("cyclic", 'BOOLEAN', 'CURVE').data.foreach_set("value", [True, False])
    collection = _collection("hair", bpy.data.objects.new("hair", curves))
    read = _read(add_mesh("ground"), areas=collection, paths=collection)
    assert np.allclose(read.areas[0], [(0, 1), (3, 4), (6, 7)])
    assert [len(p.points) for p in read.paths] == [4, 2]


def _missing_group(ground):
    return dict(vertex_group="Trees")


def _missing_uv(ground):
    return dict(image=_image(np.ones((2, 2))))


def _missing_layer(ground):
    return dict(image=_image(np.ones((2, 2))), uv_layer="Other")


def _missing_file(ground):
    _with_uv(ground)
    image = bpy.data.images.new("lost", 1, 1)
    image.source, image.filepath = 'FILE', "//nowhere.png"
    return dict(image=image)


def _no_curves(ground):
    return dict(paths=_collection("Roads"))


def _open_curves(ground):
    return dict(areas=_collection("Meadows", _curve()))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (_missing_group, '"ground" has no vertex group "Trees"'),
        (_missing_uv, '"ground" has no UV map for the image'),
        (_missing_layer, '"ground" has no UV map "Other"'),
        (_missing_file, 'Cannot load the image "lost"'),
        (_no_curves, 'The Paths collection "Roads" has no curves'),
        (_open_curves, 'The Areas collection "Meadows" has no closed curves'),
    ],
)
def test_what_is_missing_is_named(options, says):
    ground = add_mesh("ground")
    with pytest.raises(errors.SceneError, match=says):
        _read(ground, **options(ground))


def test_ground_without_faces_is_named():
    with pytest.raises(errors.SceneError, match='"Bare" has no faces'):
        _read(add_mesh("Bare", faces=()))
    with pytest.raises(errors.SceneError, match="No ground"):
        _read()
    with pytest.raises(errors.SceneError, match='"curve" is not a mesh'):
        _read(_curve())
    assert not [m for m in bpy.data.meshes if not m.users]
