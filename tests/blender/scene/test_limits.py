# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers beyond what sliders give, cameras that see nothing, fields of nothing: said by name, never a traceback."""

from __future__ import annotations

import math
import re

import bpy
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, select
from tetflora_addon import errors
from tetflora_addon.blender import settings
from tetflora_addon.blender.job import contents, forecast, refine
from tetflora_addon.blender.placing import brush, populations
from tetflora_addon.blender.worker import run_to_end

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def scene():
    """One plant before a camera of a few pixels."""
    add_camera(location=(0.0, -6.0, 1.5))
    add_plant()
    found = bpy.context.scene
    found.render.resolution_x = found.render.resolution_y = 32
    return found


def _stored(owner):
    """Custom properties in which Blender keeps an object's or a scene's group."""
    found = owner.bl_system_properties_get() if hasattr(owner, "bl_system_properties_get") else owner
    return found["tetflora"]


def _store(group, name, value):
    """Write a number as a custom property, past Blender's own checks."""
    setattr(group, name, getattr(group, name))  # so that there is one
    owner = group.id_data
    inner = _stored(owner)
    path = group.path_from_id().split(".")[1:]
    for step in path:
        key, _, index = step.partition("[")
        inner = inner[key][int(index[:-1])] if index else inner[key]
    inner[name] = value
    assert getattr(group, name) == value or math.isnan(value)


NUMBERS = [
    ("max_levels", 10**6),
    ("max_levels", -5),
    ("cutoff", math.nan),
    ("cutoff", 0.0),
    ("cutoff", -1.0),
    ("leaf_limit", math.inf),
    ("visibility_resolution", 0),
    ("visibility_resolution", 10**6),
    ("facet", 0.0),
    ("facet", math.nan),
    ("max_tetrahedra", -1),
    ("max_memory", -1.0),
    ("shadow_cutoff", math.nan),
    ("cell_length", math.nan),
    ("shell_gloss", 7.0),
]


@pytest.mark.parametrize(("name", "value"), NUMBERS)
def test_a_number_beyond_its_limits_is_refused_by_name(scene, name, value):
    _store(scene.tetflora, name, value)
    label = scene.tetflora.bl_rna.properties[name].name
    objects = len(bpy.data.objects)
    for do in (
        lambda: refine.refine(scene, depsgraph()),
        lambda: contents.estimate(scene, depsgraph()),
        lambda: bpy.ops.tetflora.refine(),
        lambda: bpy.ops.tetflora.preview_levels(),
    ):
        with pytest.raises(
            (errors.SceneError, RuntimeError), match=f'Scene "Scene": {re.escape(label)} is .*; it must'
        ):
            do()
    assert forecast.forecast(scene, bpy.context.view_layer) is None
    assert len(bpy.data.objects) == objects
    setattr(scene.tetflora, name, scene.tetflora.bl_rna.properties[name].default)
    contents.estimate(scene, depsgraph())


def test_every_setting_that_can_be_set_is_within_its_limits(scene):
    every = scene.tetflora
    for group in (every, every.wind, every.year, every.output, every.brush):
        for prop in group.bl_rna.properties:
            if prop.type in {'INT', 'FLOAT'} and not prop.is_readonly:
                for value in (prop.hard_min, prop.hard_max):
                    setattr(group, prop.identifier, (value,) * prop.array_length if prop.is_array else value)
                    settings.check_limits(group, "x")
                group.property_unset(prop.identifier)


def test_choices_that_no_menu_has_are_refused(scene):
    scene.tetflora.baked_light = 'ALL'
    _stored(scene)["baked_light"] = 99
    with pytest.raises(errors.SceneError, match="Lighting is ''; it must be one of the choices of its menu"):
        refine.refine(scene, depsgraph())


def test_wind_populations_and_brush_have_limits_too(scene):
    scene.tetflora.wind.enabled = True
    _store(scene.tetflora.wind, "speed", math.nan)
    with pytest.raises(errors.SceneError, match=r'Scene "Scene": .*Speed is nan; it must be'):
        contents.estimate(scene, depsgraph())
    ground = add_mesh("ground", size=10.0)
    select(ground)
    population = populations.add_population(scene, [ground])
    population.mix.add().species = "bush"
    for group, name in ((population, "slope_max"), (population, "count"), (population.mix[0], "weight")):
        good = getattr(group, name)
        _store(group, name, -5 if name == "count" else math.nan)
        with pytest.raises(errors.SceneError, match=r'"Scatter": .* is (nan|-5); it must be '):
            run_to_end(populations.make_plants_steps(scene, depsgraph(), population))
        setattr(group, name, good)
    _store(scene.tetflora.brush, "radius", math.nan)
    with pytest.raises(errors.SceneError, match="Brush: Radius is nan; it must be"):
        brush._brush_of(scene)


@pytest.mark.parametrize(
    "text", ["{", "3", "[3]", '[["a"]]', "[[1, 2]]", "[[1, 1e999, 0]]", "[[1, NaN, 0]]", '{"a": 1}']
)
def test_erased_places_that_cannot_be_read_are_said(scene, text):
    ground = add_mesh("ground", size=10.0)
    population = populations.add_population(scene, [ground])
    population.mix.add().species = "bush"
    population.erased = text
    with pytest.raises(errors.SceneError, match='"Scatter": its erased places cannot be read; click Clear Erased'):
        run_to_end(populations.make_plants_steps(scene, depsgraph(), population))


def test_an_orthographic_scale_of_nothing_is_said(scene):
    scene.camera.data.type = 'ORTHO'
    scene.camera.data.ortho_scale = 0.0
    with pytest.raises(errors.SceneError, match='camera "camera" sees nothing; raise its Orthographic Scale above 0'):
        refine.refine(scene, depsgraph())
    scene.camera.data.ortho_scale = 5.0
    refine.refine(scene, depsgraph())


@pytest.mark.parametrize(("mark", "label"), [("is_occluder", "Occluder"), ("is_explicit", "Refine This Mesh")])
def test_a_mesh_without_faces_is_told_where_its_mark_is_turned_off(scene, mark, label):
    odd = bpy.data.objects.new("odd", bpy.data.meshes.new("odd"))
    scene.collection.objects.link(odd)
    setattr(odd.tetflora, mark, True)
    with pytest.raises(errors.SceneError, match=f'"odd" .*turn off {label} in Properties > Object$'):
        refine.refine(scene, depsgraph())


@pytest.mark.parametrize("kind", ["EMPTY", "CAMERA", "LIGHT", "ARMATURE", "SPEAKER"])
def test_a_field_that_can_have_no_points_is_named(scene, kind):
    data = {
        "EMPTY": lambda: None,
        "CAMERA": lambda: bpy.data.cameras.new("c"),
        "LIGHT": lambda: bpy.data.lights.new("l", 'SUN'),
        "ARMATURE": lambda: bpy.data.armatures.new("a"),
        "SPEAKER": lambda: bpy.data.speakers.new("s"),
    }[kind]()
    odd = bpy.data.objects.new("odd", data)
    scene.collection.objects.link(odd)
    odd.tetflora.is_field = True
    odd.tetflora.field_species.add().species = "bush"
    ground = add_mesh("ground", size=10.0)
    population = populations.add_population(scene, [ground])
    population.mix.add().species = "bush"
    for do in (
        lambda: refine.refine(scene, depsgraph()),
        lambda: run_to_end(populations.make_plants_steps(scene, depsgraph(), population)),
        lambda: brush.Standing(scene, depsgraph(), covers=True),
    ):
        with pytest.raises(errors.SceneError, match=r'"odd" is no mesh .*Stop Using as Field in Properties > Object$'):
            do()
    select(odd)
    assert bpy.ops.tetflora.mark(what='FIELD') == {'FINISHED'}  # off again
    refine.refine(scene, depsgraph())
