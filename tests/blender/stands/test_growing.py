# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stands in Blender: growing on a ground, its masks, growing again, keys, and keeping a year."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from operators.layers import TETFLORA_OT_keep_year
from tests.blender.scenes import add_mesh, depsgraph, select
from tetflora_addon import errors
from tetflora_addon.blender.placing.brush import Standing
from tetflora_addon.blender.scene.fields import has_history, read_aged_field, stored_now, year_curves
from tetflora_addon.blender.stands import growing

pytestmark = pytest.mark.usefixtures("clean_file")


def stand_on(ground, years=12, **settings):
    """A stand of birches that has grown on a ground; ``settings`` are those of new stands."""
    group = bpy.context.scene.tetflora.stand
    for name, value in {"years": years, "interval": 4, "density": 1500.0, **settings}.items():
        setattr(group, name, value)
    if not group.species:
        group.species.add().species = "birch"
    select(ground)
    assert bpy.ops.tetflora.grow_stand() == {'FINISHED'}
    return bpy.context.active_object


def plants_of(field, year):
    field.tetflora.stand_year = year
    return read_aged_field(field, depsgraph(), np.array(field.matrix_world)[None])


def digest(field):
    return [attribute.name for attribute in field.data.attributes], plants_of(field, 8.0)[0].position.tolist()


def test_a_stand_grows_on_its_ground_and_has_a_history():
    ground = add_mesh("ground", size=15.0)
    ground.location = (500.0, 20.0, 7.0)
    bpy.context.view_layer.update()
    field = stand_on(ground)
    assert growing.is_stand(field)
    assert field.tetflora.stand_year == 12.0
    young, old = plants_of(field, 4.0), plants_of(field, 12.0)
    assert len(old[0]) > 50
    assert np.median(old[2].height) > 1.5 * np.median(young[2].height)
    place = old[0].position - [500.0, 20.0, 7.0]
    assert np.abs(place[:, :2]).max() <= 15.0
    np.testing.assert_allclose(place[:, 2], 0.0, atol=1e-3)


def test_the_same_settings_grow_the_same_stand_and_others_another():
    field = stand_on(add_mesh("ground", size=12.0))
    before = digest(field)
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}
    assert digest(field) == before
    field.tetflora.stand.seed = 1
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}
    assert digest(field) != before
    assert len([obj for obj in bpy.data.objects if obj.tetflora.is_field]) == 1


def test_masks_keep_the_stand_away():
    ground = add_mesh("ground", size=15.0)
    ground.vertex_groups.new(name="west").add([0, 3], 1.0, 'REPLACE')
    field = stand_on(ground, vertex_group="west", density=4000.0)
    west = plants_of(field, 12.0)[0].position[:, 0]
    assert (west < 0.0).mean() > 0.65


@pytest.mark.parametrize(
    ("size", "settings", "says"),
    [
        (0.4, {"relief": 0.0}, "too small for a stand: no square of 1 m"),
        (0.5, {"years": 100, "density": 2500.0}, "too small for a stand of 2,500 plants per hectare"),
        (20.0, {"slope_max": 0.1}, "steeper than Max Slope"),
        (20.0, {"vertex_group": "none"}, "Vertex Group, Areas, Paths"),
    ],
)
def test_what_leaves_no_ground_is_what_is_told(size, settings, says):
    ground = add_mesh("ground", size=size)
    ground.vertex_groups.new(name="none")
    ground.location.x = ground.location.y = 0.0 if size < 0.5 else 0.3
    ground.rotation_euler.x = 0.0 if size < 1.0 or "vertex_group" in settings else 0.5
    with pytest.raises(RuntimeError, match=says):
        stand_on(ground, **settings)


def test_a_year_is_kept_as_a_plain_field():
    field = stand_on(add_mesh("ground", size=12.0))
    seeds, _, sizes = plants_of(field, 6.5)
    assert bpy.ops.tetflora.keep_year() == {'FINISHED'}
    assert not has_history(field)
    kept, _, now = plants_of(field, 0.0)
    np.testing.assert_array_equal(kept.seed, seeds.seed)
    np.testing.assert_allclose(kept.position, seeds.position, atol=1e-5)
    np.testing.assert_allclose(kept.frame, seeds.frame, atol=1e-5)
    np.testing.assert_allclose(now.height, sizes.height, rtol=1e-6)
    assert len(stored_now(field)) == len(seeds)
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}
    assert has_history(field)


def test_growth_is_keyed_from_the_first_year_to_the_last():
    field, scene = stand_on(add_mesh("ground", size=10.0)), bpy.context.scene
    scene.frame_start, scene.frame_end = 11, 31
    assert bpy.ops.tetflora.animate_growth() == {'FINISHED'}
    assert field.tetflora.stand_smooth
    for frame, subframe, year in ((11, 0.0, 0.0), (21, 0.0, 6.0), (21, 0.5, 6.3), (31, 0.0, 12.0)):
        scene.frame_set(frame, subframe=subframe)
        assert field.tetflora.stand_year == pytest.approx(year, abs=1e-4)


def test_the_brush_leaves_histories_alone():
    field = stand_on(add_mesh("ground", size=10.0))
    standing = Standing(bpy.context.scene, depsgraph(), covers=True)
    assert len(standing.places) == len(plants_of(field, 12.0)[0])
    assert not standing.removable.any()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"degree_days": 0.0}, "climate"),
        ({"density": 0.0, "recruits": 0.0}, "planted"),
        ({"slope_max": 0.0}, "steeper"),
    ],
)
def test_what_cannot_grow_is_told_and_changes_nothing(settings, message):
    ground = add_mesh("ground", size=10.0)
    ground.rotation_euler = (0.3, 0.0, 0.0)
    before = len(bpy.data.objects), len(bpy.data.meshes)
    with pytest.raises((errors.TetFloraError, RuntimeError), match=message):
        stand_on(ground, **settings)
    assert (len(bpy.data.objects), len(bpy.data.meshes)) == before


def test_the_slider_ends_with_the_stand_and_keys_go_with_its_years():
    field = stand_on(add_mesh("ground", size=10.0))
    group = field.tetflora
    there = len(plants_of(field, 12.0)[0])
    group.stand_year = 150.0
    assert group.stand_year == 12.0
    assert len(plants_of(field, 150.0)[0]) == there > 0
    group.stand.years = 8
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}
    assert group.stand_year == 8.0
    assert bpy.ops.tetflora.animate_growth(first=1, last=9) == {'FINISHED'}
    field.keyframe_insert("location", frame=3)
    bpy.context.scene.frame_set(9)
    assert year_curves(field)
    assert bpy.ops.tetflora.keep_year() == {'FINISHED'}
    assert not year_curves(field)
    assert len(field.animation_data.action.layers[0].strips[0].channelbags[0].fcurves) == 3  # those of the location


def test_keeping_a_year_asks_first():
    """With its button, which invokes it; scripts and Adjust Last Operation are not asked."""
    asked = []
    manager = SimpleNamespace(invoke_confirm=lambda *_, message, **__: asked.append(message) or {'RUNNING_MODAL'})
    context = SimpleNamespace(window_manager=manager)
    tool = SimpleNamespace(bl_label="Keep Year")
    assert TETFLORA_OT_keep_year.invoke(tool, context, None) == {'RUNNING_MODAL'}
    assert "years" in asked[0]


def test_leaving_early_changes_nothing():
    ground = add_mesh("ground", size=10.0)
    before = len(bpy.data.objects), len(bpy.data.meshes)
    steps = growing.new_stand_steps(bpy.context.scene, depsgraph(), [ground])
    for _ in range(4):
        next(steps)
    steps.close()
    assert (len(bpy.data.objects), len(bpy.data.meshes)) == before


def test_stands_grow_within_areas_and_beside_paths():
    """By cells of a meter: what is left of a cell at their border counts in full."""
    scene, ground = bpy.context.scene, add_mesh("ground", size=15.0)
    held = {}
    for name, points in (("areas", [(-15, -15), (3, -15), (3, 15), (-15, 15)]), ("paths", [(-6, -20), (-6, 20)])):
        curve = bpy.data.curves.new(name, 'CURVE')
        curve.dimensions = '3D'
        spline = curve.splines.new('POLY')
        spline.points.add(len(points) - 1)
        spline.points.foreach_set("co", np.ravel([(*point, 0, 1) for point in points]))
        spline.use_cyclic_u, curve.bevel_depth = name == "areas", 2.0 * (name == "paths")
        held[name] = bpy.data.collections.new(name)
        held[name].objects.link(bpy.data.objects.new(name, curve))
        scene.collection.children.link(held[name])
    field = stand_on(ground, density=6000.0, **held)
    x = plants_of(field, 12.0)[0].position[:, 0]
    assert len(x) > 40
    assert x.max() < 4.1 and x.min() < -9.0
    assert np.abs(x + 6.0).min() > 0.9
    assert ((x > -4.0) & (x < 3.0)).mean() > 0.3
