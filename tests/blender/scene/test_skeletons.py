# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Forms by hand: what is read from curves, hair curves and meshes of edges, and the button that uses them."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_mesh, add_plant, depsgraph, select
from tetflora_addon import errors
from tetflora_addon.blender.scene.skeletons import read_skeleton
from tetflora_addon.species import skeletons

pytestmark = pytest.mark.usefixtures("clean_file")

FORK = ((0, 0, 0), (0, 0, 4), (0, 0, 8), (2, 0, 5))
EDGES = ((0, 1), (1, 2), (1, 3))


def _link(name, data):
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def add_edges(points=FORK, edges=EDGES, radius=None, name="edges"):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, edges, [])
    if radius is not None:
        mesh.attributes.new("radius", 'FLOAT', 'POINT').data.foreach_set("value", np.array(radius, np.float32))
    return _link(name, mesh)


def add_curve(*splines, kind='POLY', radius=None, bevel=0.0, name="curve"):
    """A curve object; each spline is a list of points, ``radius`` a list for each."""
    curve = bpy.data.curves.new(name, 'CURVE')
    curve.dimensions, curve.bevel_depth = '3D', bevel
    for number, places in enumerate(splines):
        spline = curve.splines.new(kind)
        points = spline.bezier_points if kind == 'BEZIER' else spline.points
        points.add(len(places) - 1)
        for i, (point, place) in enumerate(zip(points, places, strict=True)):
            point.co = place if kind == 'BEZIER' else (*place, 1.0)
            point.radius = radius[number][i] if radius is not None else 1.0
            if kind == 'BEZIER':
                point.handle_left_type = point.handle_right_type = 'AUTO'
    return _link(name, curve)


def read(obj):
    return read_skeleton(obj, depsgraph())


def branches(skeleton):
    return skeletons.drawn_branches(skeleton)


def _wire(obj):
    """Points of a curve without a tube, as Blender itself evaluates them."""
    mesh = obj.evaluated_get(depsgraph()).to_mesh()
    return np.array([v.co[:] for v in mesh.vertices])


def _same_points(found, expected, within=1e-5):
    gap = np.linalg.norm(found[:, None] - expected[None], axis=2)
    return len(found) == len(expected) and gap.min(axis=0).max() < within and gap.min(axis=1).max() < within


def test_a_mesh_of_edges_with_an_attribute():
    skeleton = read(add_edges(radius=(0.4, 0.3, 0.2, 0.1)))
    np.testing.assert_allclose(skeleton.points, np.array(FORK)[[0, 1, 2, 3]])
    np.testing.assert_allclose(skeleton.radius, [0.4, 0.3, 0.2, 0.1], rtol=1e-6)
    np.testing.assert_array_equal(skeleton.parent, [-1, 0, 1, 1])


def test_a_mesh_without_radii_gets_them():
    skeleton = read(add_edges())
    assert skeleton.radius[0] == pytest.approx(8 / 40)
    assert (np.diff(skeleton.radius[:3]) < 0).all()


def test_skin_is_taken_off_and_gives_the_radii():
    obj = add_edges()
    select(obj)
    bpy.ops.object.modifier_add(type='SKIN')  # makes the radii, too
    obj.modifiers.new("Subdivision", 'SUBSURF')
    for vertex, radius in zip(obj.data.skin_vertices[0].data, (0.4, 0.3, 0.2, 0.1), strict=True):
        vertex.radius = (radius + 0.05, radius - 0.05)
    skeleton = read(obj)
    np.testing.assert_allclose(skeleton.radius, [0.4, 0.3, 0.2, 0.1], rtol=1e-6)
    assert len(skeleton.points) == 4


def test_modifiers_that_leave_edges_count():
    obj = add_edges(points=((0, 0, 0), (0, 0, 4), (1, 0, 6)), edges=((0, 1), (1, 2)))
    mirror = obj.modifiers.new("Mirror", 'MIRROR')
    mirror.use_axis[0] = True
    assert len(branches(read(obj))) == 2


@pytest.mark.parametrize("kind", ['POLY', 'BEZIER', 'NURBS'])
def test_curves_run_where_blender_draws_them(kind):
    places = [(0, 0, 0), (0.5, 0, 2), (0, 1, 4), (1, 1, 7), (0, 0, 9)]
    obj = add_curve(places, kind=kind, radius=[(0.5, 0.4, 0.3, 0.2, 0.1)])
    spline = obj.data.splines[0]
    spline.use_endpoint_u, spline.order_u, spline.resolution_u = True, 4, 6
    skeleton, wire = read(obj), _wire(obj)
    # Blender 4.5 cuts NURBS into other pieces than 5.2, along the same line.
    if kind != 'NURBS' or len(wire) == len(skeleton.points):
        assert _same_points(skeleton.points, wire)
    else:
        assert np.linalg.norm(skeleton.points[:, None] - wire[None], axis=2).min(axis=1).max() < 0.3
    assert len(branches(skeleton)) == 1
    assert (np.diff(skeleton.radius) < 0).all()
    np.testing.assert_allclose(skeleton.radius[[0, -1]], [0.5, 0.1], rtol=1e-6)


def test_a_tube_says_how_thick_a_curve_is():
    obj = add_curve(FORK[:3], radius=[(1.0, 0.5, 0.5)], bevel=0.3)
    np.testing.assert_allclose(read(obj).radius, [0.3, 0.15, 0.15], rtol=1e-6)
    obj.data.bevel_mode = 'OBJECT'
    profile = add_curve([(0.2, 0, 0), (0, 0.2, 0), (-0.2, 0, 0), (0, -0.2, 0)], name="profile")
    profile.data.splines[0].use_cyclic_u = True
    obj.data.bevel_object = profile
    np.testing.assert_allclose(read(obj).radius, [0.2, 0.1, 0.1], rtol=1e-6)


def test_equal_radii_that_nothing_shows_mean_nothing():
    obj = add_curve(FORK[:3], radius=[(1.0, 1.0, 1.0)])
    assert read(obj).radius[0] == pytest.approx(8 / 40)
    obj.data.bevel_depth = 0.25
    np.testing.assert_allclose(read(obj).radius, 0.25)


def test_a_spline_that_starts_on_another_is_its_branch():
    skeleton = read(add_curve(FORK[:3], [(0.05, 0, 3), (3, 0, 5), (4, 0, 7)], [(3, 0, 5), (3, 2, 6)], kind='BEZIER'))
    found = branches(skeleton)
    np.testing.assert_array_equal(found.order, [0, 1, 2])
    assert found.insertion[1] == pytest.approx(3 / 8, abs=0.01)


def test_shape_keys_and_switched_off_curves():
    obj = add_curve(FORK[:3])
    obj.shape_key_add()
    obj.shape_key_add().data[2].co = (1.0, 0.0, 8.0)
    obj.data.shape_keys.key_blocks[1].value = 1.0
    np.testing.assert_allclose(read(obj).points[-1], [1, 0, 8])
    obj.hide_render = True
    np.testing.assert_allclose(read(obj).points[-1], [1, 0, 8])
    obj.hide_viewport = True  # not evaluated then: as it was modeled
    assert len(read(obj).points) == 3


@pytest.mark.parametrize("kind", ['CATMULL_ROM', 'POLY', 'BEZIER', 'NURBS'])
def test_hair_curves(kind):
    data = bpy.data.hair_curves.new("hair")
    data.add_curves([4, 3])
    trunk, limb = [(0, 0, 0), (0.2, 0, 2), (0, 0, 5), (0, 0, 8)], [(0, 0, 5), (1, 0, 6), (2, 0, 6)]
    data.points.foreach_set("position", np.array(trunk + limb, np.float32).ravel())
    data.points.foreach_set("radius", np.array([0.3, 0.2, 0.2, 0.1, 0.1, 0.1, 0.05], np.float32))
    data.set_types(type=kind)
    obj = _link("hair", data)
    skeleton = read(obj)
    found = branches(skeleton)
    assert skeleton.radius.max() < 0.3 + 1e-6 and skeleton.radius.min() > 0.05 - 1e-6
    if kind != 'NURBS':  # which passes its points by
        assert skeleton.radius[0] == pytest.approx(0.3)
        np.testing.assert_array_equal(found.order, [0, 1])
        np.testing.assert_allclose(found.knots[found.first[1]], [0, 0, 5], atol=1e-6)
        assert (len(skeleton.points) == 6) == (kind == 'POLY')


def test_scale_and_tilt_count_place_and_turn_do_not():
    obj = add_edges(radius=(0.4, 0.3, 0.2, 0.1))
    plain = read(obj)
    obj.location, obj.rotation_euler, obj.scale = (5, 6, 7), (0, 0, 1.2), (2, 2, 2)
    moved = read(obj)
    np.testing.assert_allclose(moved.points, 2 * plain.points, atol=1e-6)
    np.testing.assert_allclose(moved.radius, 2 * plain.radius, atol=1e-6)
    # An import whose up is y, stood up by its object.
    for vertex, (x, y, z) in zip(obj.data.vertices, FORK, strict=True):
        vertex.co = (x, z, -y)
    obj.rotation_euler, obj.scale = (np.pi / 2, 0, 0), (1, 1, 1)
    np.testing.assert_allclose(read(obj).points, plain.points, atol=1e-5)


def test_equal_forms_are_equal_skeletons():
    one, other = read(add_edges()), read(add_edges(name="again"))
    assert one == other and hash(one) == hash(other)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: add_mesh("Cube"), '"Cube".*has faces'),
        (lambda: add_edges(edges=(), name="Dots"), '"Dots".*no edges'),
        (lambda: add_curve(name="Nothing"), '"Nothing".*no edges'),
        (lambda: add_plant("Oak"), '"Oak".*choose a curve'),
        (lambda: add_edges(radius=(-1, 1, 1, 1), name="Thin"), '"Thin".*invalid position or radius'),
    ],
)
def test_what_cannot_be_a_form_is_named(make, message):
    with pytest.raises(errors.SpeciesError, match=message):
        read(make())


def test_scale_0_is_named():
    obj = add_edges()
    obj.scale = (1, 1, 0)
    with pytest.raises(errors.SpeciesError, match=r'"edges".*scale is 0'):
        read(obj)


def test_the_button_makes_a_plant_in_the_forms_place():
    form = add_curve(FORK[:3], name="Old oak")
    form.location, form.rotation_euler = (3, 4, 5), (0.2, 0, 0.7)
    bpy.context.scene.tetflora.species_editor.species = "oak"
    select(form)
    assert bpy.ops.tetflora.use_as_skeleton() == {'FINISHED'}
    plant = bpy.context.active_object
    assert plant.tetflora.is_plant and plant.tetflora.skeleton == form and plant.tetflora.species == "oak"
    assert form.hide_render and bpy.context.selected_objects == [plant]
    # Plant and skeleton together are where the form is.
    bpy.context.view_layer.update()
    points = read(form).points @ np.array(plant.matrix_world)[:3, :3].T + np.array(plant.matrix_world)[:3, 3]
    world = np.array([(form.matrix_world @ p.co.to_3d())[:] for p in form.data.splines[0].points])
    np.testing.assert_allclose(points, world, atol=1e-5)
    assert plant.empty_display_size == pytest.approx(read(form).points[:, 2].max())  # the arrow is as tall as the form


def test_the_button_gives_selected_plants_their_form():
    form, plants = add_edges(), [add_plant(str(i)) for i in range(2)]
    other = add_plant("other")
    select(form, *plants)
    assert bpy.ops.tetflora.use_as_skeleton() == {'FINISHED'}
    assert [p.tetflora.skeleton for p in (*plants, other)] == [form, form, None]
    assert sorted(o.name for o in bpy.context.selected_objects) == ["0", "1"]


def test_the_button_refuses_and_changes_nothing():
    cube = add_mesh("Cube")
    select(cube)
    with pytest.raises(RuntimeError, match=r"Cube.*has faces"):
        bpy.ops.tetflora.use_as_skeleton()
    assert not cube.hide_render and list(bpy.data.objects) == [cube]
    select(add_plant())
    assert not bpy.ops.tetflora.use_as_skeleton.poll()


def test_only_what_can_be_a_form_is_offered():
    """A plant keeps its form through copies and lets it go when it is deleted."""
    form, plant = add_edges(), add_plant()
    plant.tetflora.skeleton = form
    assert plant.copy().tetflora.skeleton == form
    bpy.data.objects.remove(form)
    assert plant.tetflora.skeleton is None
