# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The brush in a scene: strokes on empties and fields, and the ground under it."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Vector

from devtools import session
from tests.blender.scenes import add_mesh, add_plant, depsgraph, select
from tetflora_addon.blender.materials import nodes
from tetflora_addon.blender.placing import brush, ground, properties
from tetflora_addon.blender.scene import fields
from tetflora_addon.errors import SceneError

pytestmark = pytest.mark.usefixtures("clean_file")

FLAT = [(x, 0.0, 0.0) for x in (-6.0, 0.0, 6.0)]


def _brush(**changes):
    settings = bpy.context.scene.tetflora.brush
    options = dict(radius=5.0, density=20.0, min_distance=0.0, store='EMPTIES', source='ONE', species="bush")
    for name, value in {**options, **changes}.items():
        setattr(settings, name, value)
    return settings


def _stroke(mode='PAINT', places=FLAT):
    bpy.context.view_layer.update()
    stroke = ", ".join(" ".join(str(number) for number in place) for place in places)
    assert bpy.ops.tetflora.paint_plants(mode=mode, stroke=stroke) == {'FINISHED'}
    bpy.context.view_layer.update()


def _plants():
    return [o for o in bpy.data.objects if o.tetflora.is_plant]


def _field():
    found = [o for o in bpy.data.objects if o.tetflora.is_field]
    assert len(found) == 1
    return found[0]


def _places(field):
    return np.array([field.matrix_world @ v.co for v in field.data.vertices])


def test_painted_plants_stand_on_the_ground_under_the_brush():
    ground = add_mesh("ground", size=30.0)
    ground.data.vertices[1].co.z = ground.data.vertices[2].co.z = 6.0  # rises along x
    _brush()
    _stroke()
    plants = _plants()
    places = np.array([o.location for o in plants])
    assert len(plants) == pytest.approx(0.2 * (np.pi * 25.0 + 120.0), rel=0.25)
    assert np.allclose(places[:, 2], 3.0 + 0.1 * places[:, 0], atol=1e-4)
    assert (np.abs(places[:, 1]) <= 5.0).all()
    assert {o.tetflora.species for o in plants} == {"bush"}
    assert len({o.tetflora.seed for o in plants}) == len(plants)
    assert all(0.8 <= o.scale.x <= 1.2 + 1e-6 for o in plants)
    assert bpy.context.scene.tetflora.brush.strokes == 1
    _stroke()
    assert len(_plants()) - len(plants) <= 12  # only at the border, where the cells are cut


def test_the_least_distance_holds_against_plants_of_fields_and_by_hand():
    ground = add_mesh("ground", size=30.0)
    add_plant("by hand", location=(1.0, 0.0, 0.0))
    _brush(store='FIELD', min_distance=1.5)
    _stroke()
    first = len(_field().data.vertices)
    _brush(store='EMPTIES', min_distance=1.5, seed=9, density=60.0)
    _stroke()
    places = np.concatenate([_places(_field()), [o.location for o in _plants()]])[:, :2]
    gaps = np.linalg.norm(places[:, None] - places[None], axis=-1)[np.triu_indices(len(places), 1)]
    assert first > 10
    assert len(places) > first + 1
    assert gaps.min() >= 1.5 - 1e-4
    assert ground.name == "ground"


def test_the_mixture_is_that_of_populate():
    add_mesh("ground", size=30.0)
    for species, weight in (("bush", 3.0), ("conifer", 1.0)):
        entry = bpy.context.scene.tetflora.populate.mix.add()
        entry.species, entry.weight = species, weight
    _brush(source='MIX', density=60.0)
    _stroke()
    fraction = np.mean([o.tetflora.species == "bush" for o in _plants()])
    assert 0.6 < fraction < 0.9


def test_many_plants_go_to_one_field_with_all_that_says_how_they_grow():
    add_mesh("ground", size=60.0)
    settings = _brush(store='AUTOMATIC', radius=25.0, density=90.0)
    limit = properties.MOST_PAINTED_EMPTIES
    for x in (-30.0, 0.0, 30.0):
        _stroke(places=[(x, 0.0, 0.0)])
    field = _field()
    assert 0 < len(_plants()) <= limit < len(_plants()) + len(field.data.vertices)
    settings.species = "conifer"
    settings.store = 'FIELD'
    before = len(field.data.vertices)
    _stroke(places=[(0.0, 40.0, 0.0)])
    assert _field() == field
    assert [entry.species for entry in field.tetflora.field_species] == ["bush", "conifer"]
    read = fields.read_field(field, depsgraph(), np.eye(4)[None])
    assert (read.species[:before] == 0).all()
    assert (read.species[before:] == 1).all()
    assert (read.scale > 0.79).all()
    assert len(read) == len(field.data.vertices) > before
    assert field.name == bpy.data.objects["Painted plants"].name


def test_erase_and_thin_reach_empties_and_fields_and_keep_attributes():
    add_mesh("ground", size=30.0)
    _brush(store='FIELD', density=60.0)
    _stroke()
    _brush(store='EMPTIES', seed=5, density=120.0)
    _stroke()
    field = _field()
    number = len(field.data.vertices)
    field.data.attributes.new("mine", 'FLOAT', 'POINT').data.foreach_set("value", np.arange(number, dtype=np.float32))
    before = {tuple(np.round(v.co, 4)): i for i, v in enumerate(field.data.vertices)}
    seeds = [d.value for d in field.data.attributes["seed"].data]
    singles = len(_plants())
    _brush(density=5.0)
    _stroke('THIN', [(0.0, 0.0, 0.0)])
    inside = [p for p in [*_places(field), *(o.location for o in _plants())] if np.hypot(p[0], p[1]) <= 5.0]
    assert 1 <= len(inside) <= 12
    assert 0 < len(field.data.vertices) < number
    assert 0 < len(_plants()) < singles
    # What is left is what was there.
    for vertex, mine, seed in zip(
        field.data.vertices, field.data.attributes["mine"].data, field.data.attributes["seed"].data, strict=True
    ):
        assert mine.value == before[tuple(np.round(vertex.co, 4))]
        assert seed.value == seeds[int(mine.value)]
    _stroke('ERASE')
    assert not _plants()
    assert len(_field().data.vertices) == 0


def test_fields_from_elsewhere_and_hidden_plants_are_left_alone():
    add_mesh("ground", size=30.0)
    foreign = add_mesh("foreign", size=2.0, z=0.0)
    foreign.tetflora.is_field = True
    hidden = add_plant("hidden", location=(1.0, 1.0, 0.0))
    hidden.hide_viewport = True
    seen = add_plant("seen", location=(2.0, 1.0, 0.0))
    _brush()
    assert seen.name == "seen"
    _stroke('ERASE')
    assert [o.name for o in _plants()] == ["hidden"]
    assert len(bpy.data.objects["foreign"].data.vertices) == 4


def test_a_field_that_was_moved_gets_plants_where_the_brush_is():
    add_mesh("ground", size=30.0)
    _brush(store='FIELD')
    _stroke()
    field = _field()
    first = len(field.data.vertices)
    field.location, field.rotation_euler, field.scale = (0.0, 40.0, 0.0), (0.0, 0.0, 1.0), (2.0, 2.0, 2.0)
    _stroke()
    new = _places(field)[first:]
    assert len(new) > 10
    assert (np.abs(new[:, 1]) <= 5.0 + 1e-3).all()
    read = fields.read_field(field, depsgraph(), np.array(field.matrix_world)[None])
    assert 0.79 <= read.scale[first:].min() <= read.scale[first:].max() <= 1.21
    assert np.allclose(read.frame[first:, :, 2], (0.0, 0.0, 1.0), atol=1e-5)
    assert bpy.data.objects["Painted plants"] == field


def test_a_field_without_any_point_gets_plants_where_the_brush_is():
    add_mesh("ground", size=30.0)
    _brush(store='FIELD')
    _stroke()
    field = _field()
    field.data = bpy.data.meshes.new("never had a point")  # nor an attribute for their places
    _stroke(places=[(9.0, 3.0, 0.0)])
    places = _places(_field())
    assert len(places) and (np.abs(places - [9.0, 3.0, 0.0]).max(axis=0) < [5.1, 5.1, 0.01]).all()


def test_a_linked_duplicate_keeps_its_plants():
    add_mesh("ground", size=30.0)
    _brush(store='FIELD')
    _stroke()
    field = _field()
    number = len(field.data.vertices)
    copy = field.copy()
    copy.location = (0.0, 50.0, 0.0)
    bpy.context.scene.collection.objects.link(copy)
    _stroke('ERASE')
    assert len(copy.data.vertices) == number
    assert len(field.data.vertices) == 0


def test_plants_and_results_are_no_ground():
    add_mesh("ground", size=30.0)
    roof = add_mesh("TetFlora result", size=10.0, z=4.0)
    nodes.tag(roof)
    tree = add_mesh("scanned tree", size=10.0, z=5.0)
    tree.tetflora.is_explicit = True
    _brush()
    _stroke()
    assert _plants()
    assert np.allclose([o.location.z for o in _plants()], 0.0, atol=1e-5)


def test_rays_find_the_nearest_ground_of_many():
    for i in range(12):
        add_mesh(f"step {i}", size=1.0, z=float(i)).location = (3.0 * i, 0.0, 0.0)
    surface = ground.Ground(depsgraph())
    assert len(surface) == 12
    places = np.array([[3.0 * i, 0.2] for i in range(12)] + [[1.5, 0.0]])
    heights = surface.heights(places, 100.0, -100.0)
    assert np.allclose(heights[:12], np.arange(12), atol=1e-4)
    assert np.isnan(heights[12])
    bent = bpy.data.objects["step 3"]
    bent.scale, bent.rotation_euler = (1.0, 3.0, 2.0), (0.0, 0.5, 0.0)
    surface = ground.Ground(depsgraph())

    place, normal = surface.cast(Vector((9.0 + 6.0 * np.sin(0.5), 0.0, 50.0)), Vector((0.0, 0.0, -2.0)))
    assert normal.z > 0.8
    assert (bent.matrix_world.inverted() @ place).z == pytest.approx(3.0, abs=1e-4)


def test_plants_of_a_field_that_is_hidden_are_left_alone_and_others_are_seen():
    add_mesh("ground", size=40.0)
    _brush(store='FIELD')
    _stroke()
    hidden = _field()
    before = len(_places(hidden))
    hidden.hide_set(True)
    _stroke(places=[(0.0, 12.0, 0.0)])
    (new,) = (o for o in bpy.data.objects if o.tetflora.is_field and o != hidden)
    assert new.visible_get()
    assert len(_places(new)) > 0
    assert len(_places(hidden)) == before
    _stroke(places=[(0.0, -12.0, 0.0)])
    assert sum(o.tetflora.is_field for o in bpy.data.objects) == 2


def test_a_species_that_is_no_more_is_not_painted_but_can_be_erased():
    add_mesh("ground", size=40.0)
    _brush()
    _stroke()
    before, settings = len(_plants()), _brush(source='MIX', strength=1.0)
    bpy.context.scene.tetflora.populate.mix.add().species = "gone_tree"
    with pytest.raises(RuntimeError, match='Unknown species "gone_tree"; choose one of'):
        _stroke()
    assert len(_plants()) == before
    assert settings.strokes == 1
    _stroke('ERASE')
    assert _plants() == []


def test_settings_that_cannot_work_are_told_and_change_nothing():
    add_mesh("ground", size=30.0)
    _brush(radius=1000.0, density=1000.0)
    with pytest.raises(RuntimeError, match="lower Radius or Density"):
        _stroke()
    assert not _plants()
    select()
    with pytest.raises(RuntimeError, match="is not a stroke"):
        bpy.ops.tetflora.paint_plants(stroke="1 2, 3")
    with pytest.raises(RuntimeError, match="requires a 3D viewport"):
        bpy.ops.tetflora.paint_plants()
    with pytest.raises(RuntimeError, match="requires a 3D viewport"):
        bpy.ops.tetflora.place_plant()


REMOVALS = {
    "plants": lambda: bpy.data.batch_remove(_plants()),
    "ground": lambda: bpy.data.objects.remove(bpy.data.objects["ground"]),
    "scene": lambda: bpy.data.scenes.remove(bpy.context.scene),
    "undo": lambda: bpy.ops.ed.undo(),
    "load": lambda: session.clean_file(),
}


@pytest.mark.parametrize("removal", REMOVALS)
@pytest.mark.parametrize("mode", ["PAINT", "ERASE"])
def test_a_stroke_whose_plants_or_ground_go_ends_with_a_message(removal, mode):
    """In its middle, by another window or a script; what it had shown by then stays, what it had not is dropped."""
    bpy.data.scenes.new("another")
    add_mesh("ground", size=30.0)
    _brush()
    bpy.ops.ed.undo_push(message="Begin")
    for n in range(4):
        add_plant(f"bush {n}", location=(n - 2.0, 0.0, 0.0))
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="Planted")
    stroke = brush.Stroke(bpy.context.scene, depsgraph(), mode)
    stroke.dab((0.0, 0.0, 0.0))
    REMOVALS[removal]()
    before = sorted(o.name for o in bpy.data.objects)
    if mode == 'PAINT' and removal == "plants":
        stroke.finish()  # it adds some, and needs none of those that stood there
        return
    with pytest.raises(SceneError, match=r"Paint Plants was stopped because .* was deleted; start it again"):
        stroke.finish()
    assert sorted(o.name for o in bpy.data.objects) == before
    assert not stroke.changed
