# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a population's plants stand by the settings that it has now: what the list shows beside their number."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from tests.blender.scenes import add_mesh, depsgraph, select
from tetflora_addon.blender.biomes import layers
from tetflora_addon.blender.placing import populations, rules
from tetflora_addon.blender.placing.terrain import ground_form, lies_elsewhere
from tetflora_addon.blender.viewport import points
from tetflora_addon.jobs import run_to_end

pytestmark = pytest.mark.usefixtures("clean_file")


def _population():
    return bpy.context.scene.tetflora.layers[0]


def _outdated():
    return rules.awaits_update(_population())


def _populate():
    select(add_mesh("ground", size=10.0))
    bpy.ops.tetflora.populate(count=20, species="bush:2, conifer")
    return _population()


def _other(prop, population):
    """A value that a setting does not have now."""
    value = getattr(population, prop.identifier)
    if prop.type == 'POINTER':
        images = prop.fixed_type.identifier == "Image"
        return bpy.data.images.new("mask", 2, 2) if images else bpy.data.collections.new("curves")
    if prop.type == 'BOOLEAN':
        return not value
    if prop.type == 'ENUM':
        return next(item.identifier for item in prop.enum_items if item.identifier != value)
    if prop.type == 'STRING':
        return "another"
    return value - 0.5 if prop.type == 'FLOAT' and value - 0.5 >= prop.hard_min else value + 1


def test_every_setting_counts_and_taking_it_back_too():
    population = _populate()
    population.distance_by_species = False
    assert not _outdated()
    simple = [p for p in rules.settings_of(population) if p.type != 'COLLECTION']
    simple = [p for p in simple if p.identifier != "distance_by_species"]  # only the distance itself counts
    assert len(simple) > 25
    for prop in simple:
        before = getattr(population, prop.identifier)
        setattr(population, prop.identifier, _other(prop, population))
        assert _outdated(), prop.identifier
        setattr(population, prop.identifier, before)
        assert not _outdated(), prop.identifier


def test_species_companions_and_grounds_count():
    population = _populate()
    entry = population.mix[1]
    for name, value in (("weight", 3.0), ("species", "birch"), ("companion", "bush"), ("companion_strength", 0.5)):
        before = getattr(entry, name)
        setattr(entry, name, value)
        assert _outdated(), name
        setattr(entry, name, before)
        assert not _outdated(), name
    populations.set_grounds(population, [add_mesh("other ground")])
    assert _outdated()


@pytest.mark.parametrize("options", [{}, {"which": 'ACTIVE', "reroll": True}])
def test_placing_settles_it(options):
    _populate().count = 12
    assert _outdated()
    bpy.ops.tetflora.update_layers(**options)
    assert not _outdated()


def test_frozen_plants_are_as_they_shall_be():
    population = _populate()
    population.frozen = True
    population.count = 3
    assert not _outdated()
    population.frozen = False
    assert _outdated()


def test_a_name_and_what_became_of_it_are_no_settings():
    population = _populate()
    population.name, population.message = "Bushes", "no room"
    assert not _outdated()


def test_populations_know_what_was_removed():
    population = _populate()
    select(*populations.own_objects(bpy.context.scene, population)[:3])
    bpy.ops.tetflora.remove_plants(which='SELECTED')
    assert population.made == 17
    bpy.ops.tetflora.remove_plants(which='ALL')
    assert population.made == 0


def test_the_panel_tells_the_plants_that_are_there_or_that_an_update_would_place():
    status = points.status
    waits = rules.awaits_update
    population = _populate()
    rules.note_erased(population, [(0.0, 0.0)], 5.0)
    bpy.ops.tetflora.update_layers(which='ACTIVE')
    assert 0 < population.made < 20
    assert (status(population), waits(population)) == (f"{population.made} plants, as empties", False)
    population.count = 33
    assert (status(population), waits(population)) == ("33 plants, as empties", True)
    population.by_density = True
    assert (status(population), waits(population)) == ("As many plants as fit", True)
    bpy.ops.tetflora.update_layers(which='ACTIVE', forget_erased=True)
    assert (status(population), waits(population)) == (f"{population.made:,} plants, as empties", False)
    bpy.ops.tetflora.duplicate_layer()
    assert waits(bpy.context.scene.tetflora.layers[1])
    assert not waits(bpy.context.scene.tetflora.populate)


def test_it_is_known_in_a_file_that_is_opened(tmp_path):
    _populate().density = 123.4
    bpy.ops.tetflora.update_layers(which='ACTIVE')
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "forest.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "forest.blend"))
    assert not _outdated()
    _population().density += 1.0
    assert _outdated()


@pytest.mark.parametrize("store", ['EMPTIES', 'FIELD'])
def test_a_layer_whose_plants_were_all_deleted_is_due(store):
    population = _populate()
    population.as_field = store
    assert bpy.ops.tetflora.update_layers(which='ACTIVE') == {'FINISHED'}
    own = populations.own_objects(bpy.context.scene, population)
    elsewhere = bpy.data.collections.new("elsewhere")
    bpy.context.scene.collection.children.link(elsewhere)
    for obj in own:  # plants that were only moved are there
        population.collection.objects.unlink(obj)
        elsewhere.objects.link(obj)
    assert not rules.awaits_update(population)
    select(*own)
    bpy.ops.object.delete()
    assert rules.awaits_update(population)
    assert bpy.ops.tetflora.update_layers() == {'FINISHED'}
    assert len(own) and populations.own_number(populations.own_objects(bpy.context.scene, population)) == 20


def _set(name, **values):
    for key, value in values.items():
        setattr(bpy.data.objects[name], key, value)


def _shift(*vertices):
    mesh = bpy.data.objects["ground"].data
    for vertex in vertices:
        mesh.vertices[vertex].co.z += 1.0
    mesh.update()


def _apply_scale():
    ground = bpy.data.objects["ground"]
    ground.data.transform(Matrix.Diagonal((*ground.scale, 1.0)))
    ground.scale = (1.0, 1.0, 1.0)


def _swap_faces():
    mesh = bpy.data.objects["ground"].data
    points = [vertex.co[:] for vertex in mesh.vertices]
    mesh.clear_geometry()
    mesh.from_pydata(points, [], [(0, 1, 2)])


#: Changes of a ground, what takes each back if anything does, and whether plants would then stand elsewhere.
GROUNDS = {
    "moved": (lambda: _set("ground", location=(0.0, 0.0, 0.01)), lambda: _set("ground", location=(0, 0, 0)), True),
    "carried": (lambda: _set("carrier", location=(5.0, 0.0, 0.0)), lambda: _set("carrier", location=(0, 0, 0)), True),
    "turned": (
        lambda: _set("ground", rotation_euler=(0, 0, 0.1)),
        lambda: _set("ground", rotation_euler=(0, 0, 0)),
        True,
    ),
    "scaled": (lambda: _set("ground", scale=(1.0, 1.1, 1.0)), lambda: _set("ground", scale=(1.0, 1.0, 1.0)), True),
    "edited": (lambda: _shift(2), None, True),
    "without a face": (_swap_faces, None, True),
    "with a modifier": (lambda: bpy.data.objects["ground"].modifiers.new("more", 'SUBSURF'), None, True),
    "scale applied": (_apply_scale, None, False),
    "selected": (lambda: select(bpy.data.objects["ground"]), None, False),
    "painted": (lambda: bpy.data.objects["ground"].data.materials.append(bpy.data.materials.new("soil")), None, False),
    "another mesh moved": (lambda: _set("rock", location=(0.0, 0.0, 1.0)), None, False),
}


def _on_ground(kind):
    """A layer of a kind on a ground that hangs on another object."""
    ground = add_mesh("ground", size=20.0)
    add_mesh("rock")
    ground.parent = carrier = bpy.data.objects.new("carrier", None)
    bpy.context.scene.collection.objects.link(carrier)
    select(ground)
    scene = bpy.context.scene
    scene.tetflora.stand.years, scene.tetflora.stand.density = 2, 2000.0
    grown = bpy.ops.tetflora.grow_stand if kind == 'STAND' else bpy.ops.tetflora.populate
    assert grown(**({} if kind == 'STAND' else {"count": 5, "species": "bush"})) == {'FINISHED'}
    bpy.context.view_layer.update()
    return scene


def _due(scene):
    bpy.context.view_layer.update()
    found = layers.due_layers(scene)
    assert [layer.uid for layer in scene.tetflora.layers if layers.is_due(layer)] == found
    return len(found)


@pytest.mark.parametrize("kind", ['SCATTER', 'STAND'])
@pytest.mark.parametrize("change", GROUNDS)
def test_a_ground_that_is_another_makes_its_layers_due(change, kind):
    """They stood in the air where it had been, and Update said that nothing was to do."""
    make, take_back, counts = GROUNDS[change]
    scene = _on_ground(kind)
    if change == "scale applied":
        _set("ground", scale=(1.5, 1.0, 0.7))
        bpy.ops.tetflora.update_layers()
    assert _due(scene) == 0
    make()
    assert _due(scene) == counts
    if take_back:
        take_back()
        assert _due(scene) == 0
        make()
    if counts:
        assert bpy.ops.tetflora.update_layers() == {'FINISHED'}
    assert _due(scene) == 0


def test_plants_follow_a_ground_that_was_lifted():
    scene = _on_ground('SCATTER')
    _set("ground", location=(0.0, 0.0, 7.0))
    bpy.context.view_layer.update()
    bpy.ops.tetflora.update_layers()
    bpy.context.view_layer.update()
    own = populations.own_objects(scene, scene.tetflora.layers[0])
    assert [plant.matrix_world.translation.z for plant in own] == pytest.approx([7.0] * 5)


def test_undo_of_a_move_takes_the_mark_away():
    scene = _on_ground('SCATTER')
    bpy.ops.ed.undo_push(message="planted")
    _set("ground", location=(0.0, 0.0, 2.0))
    bpy.ops.ed.undo_push(message="moved")
    assert _due(scene) == 1
    bpy.ops.ed.undo()
    assert _due(bpy.context.scene) == 0
    bpy.ops.ed.redo()
    assert _due(bpy.context.scene) == 1


def test_grounds_of_a_collection_count_and_so_does_one_more():
    ground, home = add_mesh("ground", size=10.0), bpy.data.collections.new("grounds")
    home.objects.link(ground)
    select(ground)
    bpy.ops.tetflora.populate(count=5, species="bush")
    scene, population = bpy.context.scene, _population()
    populations.set_grounds(population, [])
    population.ground_collection = home
    bpy.ops.tetflora.update_layers()
    assert _due(scene) == 0
    home.objects.link(add_mesh("one more"))
    assert _due(scene) == 1
    bpy.ops.tetflora.update_layers()
    ground.location.x = 1.0
    assert _due(scene) == 1


def test_neither_frozen_layers_nor_those_without_a_ground_nor_those_of_older_files_become_due():
    scene = _on_ground('SCATTER')
    population = _population()
    known = population.stood_on
    _set("ground", location=(0.0, 0.0, 2.0))
    assert _due(scene) == 1
    for text in ("", "no numbers", "1 2 3"):  # of a file from before this was noted, and of one that is broken
        population.stood_on = text
        assert _due(scene) == 0
    population.stood_on, population.frozen = known, True
    assert _due(scene) == 0
    population.frozen = False
    ground = bpy.data.objects["ground"]
    ground.hide_set(True)
    assert _due(scene) == 0
    ground.hide_set(False)
    assert _due(scene) == 1
    scene.collection.objects.unlink(ground)
    assert _due(scene) == 0


def test_grounds_are_looked_up_and_nothing_lists_all_objects_for_them(monkeypatch):
    """With 100,000 objects each of ten layers took 60 ms."""
    scene = _on_ground('SCATTER')
    monkeypatch.setattr(bpy.types.Object, "users_scene", property(lambda _: pytest.fail("listed all objects")))
    assert rules.grounds_of(scene, _population()) == [bpy.data.objects["ground"]]
    scene.collection.objects.unlink(bpy.data.objects["ground"])
    assert rules.grounds_of(scene, _population()) == []


def test_grounds_in_sight_are_found_without_the_names_of_all_objects():
    """Of 2,000 grounds among 20,000 objects that took 230 ms, and of one that was made last 20 ms."""

    class Scene:
        view_layers = bpy.context.scene.view_layers

        @property
        def objects(self):
            pytest.fail("looked through all objects")

    scene = _on_ground('SCATTER')
    assert rules.grounds_of(Scene(), _population()) == [bpy.data.objects["ground"]]
    bpy.data.objects["ground"].hide_set(True)  # what is hidden is looked for
    assert rules.grounds_of(scene, _population()) == [bpy.data.objects["ground"]]


@pytest.mark.parametrize("many", [False, True])
def test_objects_of_the_file_are_not_counted_while_panels_are_drawn(monkeypatch, many):
    """Of 20,000 that took 5 ms for each layer that was not placed yet, twice in each draw."""

    class Objects:
        def __len__(self):
            pytest.fail("counted all objects")

        def __getitem__(self, some):
            assert some.stop - some.start == 1 and some.start <= 500
            return [None] * many

    population = _populate()
    for obj in list(population.collection.objects):
        bpy.data.objects.remove(obj)
    data = SimpleNamespace(objects=Objects())
    monkeypatch.setattr(rules, "bpy", SimpleNamespace(data=data, context=bpy.context, types=bpy.types))
    assert _outdated() is not many  # of many, their plants are not looked for


def test_where_it_stands_goes_neither_into_copies_nor_into_files():
    scene = _on_ground('SCATTER')
    assert "stood_on" not in {prop.identifier for prop in rules.settings_of(_population())}
    bpy.ops.tetflora.duplicate_layer()
    assert scene.tetflora.layers[1].stood_on == ""


def test_a_ground_is_not_looked_at_while_panels_are_drawn(monkeypatch):
    """In a window; what was found last counts."""
    _on_ground('SCATTER')
    seen = rules.SeenGrounds("ground", (), _population().stood_on)
    monkeypatch.setattr(rules, "ground_form", lambda *_: pytest.fail("looked at a ground"))
    monkeypatch.setattr(rules.seen_grounds, "of", lambda *_: {_population().uid: seen})
    assert layers.is_due(_population())
    monkeypatch.setattr(rules.seen_grounds, "of", lambda *_: None)
    assert not layers.is_due(_population())


@pytest.mark.parametrize("kind", ['SCATTER', 'STAND'])
def test_after_update_nothing_is_due_at_once_though_grounds_were_not_looked_at_again(monkeypatch, kind):
    """In a window, marks stayed until the next look."""
    scene = _on_ground(kind)
    _set("ground", location=(0.0, 0.0, 2.0))
    bpy.context.view_layer.update()
    found = run_to_end(rules.ground_steps(scene, bpy.context.view_layer))
    monkeypatch.setattr(rules.seen_grounds, "of", lambda *_: found)
    assert layers.is_due(_population())
    assert bpy.ops.tetflora.update_layers() == {'FINISHED'}
    assert not layers.is_due(_population())


def test_what_single_precision_moves_counts_for_nothing():
    """A mesh far from the middle of the world whose scale is applied lies where it lay, but for single precision."""
    side = 200
    mesh = bpy.data.meshes.new("land")
    x, y = np.meshgrid(np.linspace(-500, 500, side), np.linspace(-500, 500, side))
    mesh.from_pydata(np.stack([x, y, np.sin(x)], axis=-1).reshape(-1, 3).tolist(), [], [])
    land = bpy.data.objects.new("land", mesh)
    bpy.context.scene.collection.objects.link(land)
    land.scale, land.location = (1.7, 1.3, 0.9), (3000.0, -2000.0, 40.0)
    before = ground_form(land, depsgraph())
    mesh.transform(Matrix.Diagonal((*land.scale, 1.0)))
    land.scale = (1.0, 1.0, 1.0)
    assert not lies_elsewhere(before, ground_form(land, depsgraph()))
    for number in range(50):  # a dent of 20 cm
        mesh.vertices[10_000 + number].co.z -= 0.2
    mesh.update()
    assert lies_elsewhere(before, ground_form(land, depsgraph()))
