# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What results replace is hidden, linked or not, with what it shows of its own in their place; and shown as it was."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from devtools import session
from tests.blender.renders import picture, small_scene
from tests.blender.scenes import add_camera, add_mesh, datablocks, depsgraph, tiny_render
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.results import hiding, instances
from tetflora_addon.blender.results.collection import Results
from tetflora_addon.blender.results.instances import add_stand_in
from tetflora_addon.errors import SceneError

#: EEVEE draws it where a full Blender does: the bpy wheel tries instances of all kinds with it, in test_instances.py.
ENGINES = ["CYCLES"] if bpy.app.module else ["CYCLES", compat.eevee_engine()]


def seen():
    """Names of the objects that render, without cameras and lamps."""
    bpy.context.view_layer.update()
    return sorted(
        i.object.original.name
        for i in bpy.context.evaluated_depsgraph_get().object_instances
        if i.object.type == 'MESH' and not i.object.hide_render
    )


def hide(*originals, purpose='VIEW'):
    """Results that replace objects."""
    results = Results(bpy.context.scene, purpose)
    results.open()
    hiding.hide_originals(bpy.context.scene, purpose, originals)
    results.finish()
    return results


def library(path):
    """A file with a collection "woods" of "scatter", "house" and, in "shed", "spade"."""
    session.clean_file()
    woods, shed = (bpy.data.collections.new(name) for name in ("woods", "shed"))
    bpy.context.scene.collection.children.link(woods)
    woods.children.link(shed)
    for name, home in (("scatter", woods), ("house", woods), ("spade", shed)):
        obj = add_mesh(name)
        bpy.context.scene.collection.objects.unlink(obj)
        home.objects.link(obj)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    session.clean_file()
    return str(path)


def linked(path, collections=(), objects=()):
    with bpy.data.libraries.load(path, link=True, relative=False) as (_, wanted):
        wanted.collections, wanted.objects = list(collections), list(objects)
    return [*wanted.collections, *wanted.objects]


@pytest.fixture
def woods(clean_file, tmp_path):
    (found,) = linked(library(tmp_path / "library.blend"), ["woods"])
    bpy.context.scene.collection.children.link(found)
    return found


def layer_of(name, view_layer=None):
    waiting = [(view_layer or bpy.context.view_layer).layer_collection]
    while waiting:
        layer = waiting.pop()
        if layer.collection.name == name:
            return layer
        waiting += layer.children
    return None


@pytest.mark.parametrize("purpose", ['VIEW', 'RENDER'])
def test_a_linked_object_is_hidden_and_what_lies_beside_it_is_not(woods, purpose):
    scatter, before = woods.objects["scatter"], datablocks()
    layer_of("woods").holdout = True
    for _ in range(2):  # again and again
        hide(scatter, purpose=purpose)
        assert seen() == ["house", "spade"]
        assert not scatter.hide_render and not scatter.hide_viewport
        assert layer_of("woods (TetFlora)").holdout
        assert hiding.hidden_originals(bpy.context.scene) == [scatter]
    with hiding.originals_shown(bpy.context.scene, depsgraph()):
        assert seen() == ["house", "scatter", "spade"]
    assert seen() == ["house", "spade"]
    hiding.remove_results(bpy.context.scene)
    assert seen() == ["house", "scatter", "spade"]
    assert datablocks() == before
    assert not layer_of("woods").exclude and not layer_of("shed").exclude
    assert not hiding.hidden_originals(bpy.context.scene)


def test_excluded_collections_stay_excluded(woods):
    layer_of("shed").exclude = True
    other = bpy.context.scene.view_layers.new("other")
    layer_of("woods", other).exclude = True
    layer_of("shed", other).exclude = False
    hide(woods.objects["scatter"])
    assert seen() == ["house"]
    assert layer_of("woods (TetFlora)", other).exclude and not layer_of("shed", other).exclude
    hiding.remove_results(bpy.context.scene)
    assert seen() == ["house", "scatter"]
    assert layer_of("shed").exclude and layer_of("woods", other).exclude and not layer_of("shed", other).exclude


def test_a_linked_object_in_collections_of_this_file(clean_file, tmp_path):
    scatter, house = linked(library(tmp_path / "library.blend"), objects=["scatter", "house"])
    home = bpy.data.collections.new("home")
    bpy.context.scene.collection.children.link(home)
    for collection in (home, bpy.context.scene.collection):
        collection.objects.link(scatter)
    home.objects.link(house)
    hide(scatter)
    assert seen() == ["house"]
    hiding.remove_results(bpy.context.scene)
    assert seen() == ["house", "scatter"]
    assert scatter.name in home.objects and scatter.name in bpy.context.scene.collection.objects


def test_local_and_linked_objects_for_both_purposes(woods):
    rock = add_mesh("rock")
    hide(rock, woods.objects["scatter"])
    hide(rock, woods.objects["scatter"], woods.objects["house"], purpose='RENDER')
    assert seen() == ["spade"]
    hiding.remove_results(bpy.context.scene, 'RENDER')
    assert seen() == ["house", "spade"]
    hiding.remove_results(bpy.context.scene)
    assert seen() == ["house", "rock", "scatter", "spade"]


def test_the_empty_that_instances_a_linked_collection_is_hidden_as_any(clean_file, tmp_path):
    (found,) = linked(library(tmp_path / "library.blend"), ["woods"])
    empty = bpy.data.objects.new("instance", None)
    empty.instance_type, empty.instance_collection = 'COLLECTION', found
    bpy.context.scene.collection.objects.link(empty)
    assert seen() == ["house", "scatter", "spade"]
    with pytest.raises(SceneError, match=r'"scatter" is linked.*Library\s+Override'):
        hide(found.objects["scatter"])
    hiding.remove_results(bpy.context.scene)
    hide(empty)
    assert seen() == []
    hiding.remove_results(bpy.context.scene)
    assert seen() == ["house", "scatter", "spade"]


@pytest.mark.parametrize("saved", [False, True])
def test_saved_files_show_linked_objects_or_their_results(woods, tmp_path, saved):
    bpy.context.scene.tetflora.output.save_results = saved
    hide(woods.objects["scatter"])
    path = str(tmp_path / "forest.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert seen() == ["house", "spade"]
    bpy.ops.wm.open_mainfile(filepath=path)
    assert seen() == (["house", "spade"] if saved else ["house", "scatter", "spade"])
    hiding.remove_results(bpy.context.scene)
    assert seen() == ["house", "scatter", "spade"]
    assert [c.name for c in bpy.data.collections if c.library is None] == []


@pytest.mark.parametrize("renamed", [False, True])
def test_what_saved_results_replace_is_hidden_in_the_file_whatever_the_scene_is_called(clean_file, tmp_path, renamed):
    scene, original = bpy.context.scene, add_mesh("original")
    scene.tetflora.output.save_results = True
    hide(original)
    if renamed:
        scene.name = "another"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    original, scene = bpy.data.objects["original"], bpy.context.scene
    assert original.hide_render
    refine.clear(scene)
    assert not original.hide_render


def test_kept_results_leave_linked_objects_hidden(woods):
    hide(woods.objects["scatter"])
    hiding.keep_results(bpy.context.scene)
    hiding.remove_results(bpy.context.scene)
    assert seen() == ["house", "spade"]
    assert not hiding.hidden_originals(bpy.context.scene)


def scattered(ground, tree, realized=False):
    """Let nodes scatter a tree on the vertices of an object, and show the object as well."""
    tree_of = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
    for in_out in ('INPUT', 'OUTPUT'):
        tree_of.interface.new_socket(name="Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    new, link = tree_of.nodes.new, tree_of.links.new
    given, info, points, joined, out = (
        new(kind)
        for kind in (
            "NodeGroupInput",
            "GeometryNodeObjectInfo",
            "GeometryNodeInstanceOnPoints",
            "GeometryNodeJoinGeometry",
            "NodeGroupOutput",
        )
    )
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = tree, True
    link(given.outputs[0], points.inputs["Points"])
    link(info.outputs["Geometry"], points.inputs["Instance"])
    link(points.outputs[0], joined.inputs[0])
    link(given.outputs[0], joined.inputs[0])
    link(joined.outputs[0], out.inputs[0])
    ground.modifiers.new("scatter", 'NODES').node_group = tree_of


def forest():
    """A ground of two colors that nodes and a modifier change, with trees on it; (ground, tree)."""
    ground, tree = add_mesh("ground"), add_mesh("tree", size=0.2, z=0.3)
    bpy.context.scene.collection.objects.unlink(tree)
    for color, obj in (((0.7, 0.2, 0.1, 1.0), ground), ((0.1, 0.6, 0.2, 1.0), tree)):
        made = bpy.data.materials.new("paint")
        compat.shader_tree(made).nodes["Principled BSDF"].inputs["Base Color"].default_value = color
        obj.data.materials.append(made)
    ground.modifiers.new("grid", 'SUBSURF').levels = 2
    ground.location, ground.rotation_euler = (0.1, 0.2, 0.0), (0.2, 0.1, 0.5)
    return ground, tree


@pytest.mark.parametrize("engine", ENGINES)
def test_results_and_a_stand_in_look_like_the_scatterer(clean_file, engine):
    small_scene(0.6, 16, 40.0, 48, engine, 3.0, shadows=True)
    ground, tree = forest()
    scattered(ground, tree)
    expected = picture()
    graph = depsgraph()
    places = [np.array(i.matrix_world) for i in graph.object_instances if i.is_instance]
    assert len(places) == 25
    results = Results(bpy.context.scene, 'VIEW')
    results.open()
    before = datablocks()
    ids = np.arange(len(places), dtype=np.int32)
    instances.add_instances(results, "trees 000", tree, np.array(places), ids, ground)
    made = add_stand_in(results, "ground 000", ground, graph)
    hiding.hide_originals(bpy.context.scene, 'VIEW', [ground])
    results.finish()
    assert made.data == ground.data and not made.hide_render
    found = picture()
    assert expected.std() > 0.1
    assert np.abs(found - expected).mean() < 0.01 * expected.mean()
    hiding.remove_results(bpy.context.scene)
    before["collections"] = []
    assert datablocks() == before


def test_stand_ins_of_linked_and_hidden_objects_and_of_nothing(woods):
    scatter = woods.objects["scatter"]
    rock = add_mesh("rock")
    empty = bpy.data.objects.new("empty", None)
    bpy.context.scene.collection.objects.link(empty)
    bare = add_mesh("bare", faces=())
    results = hide(scatter, rock)
    with hiding.originals_shown(bpy.context.scene, depsgraph()):
        graph = depsgraph()
        assert add_stand_in(results, "empty 000", empty, graph) is None
        assert add_stand_in(results, "bare 000", bare, graph) is None
        add_stand_in(results, "scatter 000", scatter, graph)
        made = add_stand_in(results, "rock 000", rock, graph)
    assert seen() == ["bare", "house", "rock 000", "scatter 000", "spade"]
    assert hiding.HIDDEN['VIEW'] not in made
    assert set(hiding.hidden_originals(bpy.context.scene)) == {scatter, rock}
    hiding.remove_results(bpy.context.scene)
    assert seen() == ["bare", "house", "rock", "scatter", "spade"]


def test_all_that_is_switched_while_originals_are_read_is_handed_to_the_main_thread(woods, monkeypatch):
    """In a render its own thread hid them again: Blender crashed in the second frame of an animation."""
    sheet, rock, called = add_mesh("sheet"), add_mesh("rock"), []
    home = bpy.data.collections.new("home")
    bpy.context.scene.collection.children.link(home)
    home.objects.link(sheet)
    bpy.context.scene.collection.objects.unlink(sheet)
    home.hide_viewport = True

    def switches():
        flags = [(o.name, o.hide_render, o.hide_viewport, len(o.users_collection)) for o in bpy.data.objects]
        return flags, seen(), len(bpy.data.collections)

    def watched(function):
        before = switches()
        function()
        called.append((before, switches()))

    hide(woods.objects["scatter"], rock)
    for name in ("in_main_thread", "restore_in_main_thread"):
        monkeypatch.setattr(hiding, name, watched, raising=False)
    outside, graph = switches(), depsgraph()
    with hiding.originals_shown(bpy.context.scene, graph):
        inside = switches()
    assert inside != outside
    assert called == [(outside, inside), (inside, outside)]
    assert switches() == outside


def test_particles_that_instance_go_and_hair_stays(clean_file):
    ground, tree = forest()
    for kind in ('OBJECT', 'PATH'):
        ground.modifiers.new(kind, 'PARTICLE_SYSTEM')
        settings = ground.particle_systems[-1].settings
        settings.type, settings.count, settings.render_type = 'HAIR', 20, kind
        if kind == 'OBJECT':
            settings.instance_object = tree
    assert seen().count("tree") == 20
    results = hide(ground)
    with hiding.originals_shown(bpy.context.scene, depsgraph()):
        made = add_stand_in(results, "ground 000", ground, depsgraph())
    assert seen() == ["ground 000"]
    assert [system.settings.render_type for system in made.particle_systems] == ['PATH']
    assert len(ground.particle_systems) == 2
    hiding.remove_results(bpy.context.scene)
    assert seen().count("tree") == 20


def test_what_was_simulated_is_copied_as_it_is(clean_file):
    ground = add_mesh("ground")
    ground.modifiers.new("cloth", 'CLOTH')
    ground.location.x = 3.0
    ground.data.materials.append(bpy.data.materials.new("paint"))
    before = datablocks()
    results = Results(bpy.context.scene, 'VIEW')
    results.open()
    made = add_stand_in(results, "ground 000", ground, depsgraph())
    results.finish()
    assert made.data != ground.data and not len(made.modifiers)
    assert made.matrix_world.translation.x == 3.0 and made.data.materials[0] == ground.data.materials[0]
    hiding.remove_results(bpy.context.scene)
    assert datablocks() == before


@pytest.mark.parametrize("how", ["keyed", "driven", "by the NLA"])
def test_an_original_whose_visibility_is_animated_is_not_rendered_beside_its_results(clean_file, tmp_path, how):
    scene = tiny_render()
    add_camera(location=(0.0, -6.0, 1.0))
    rock = add_mesh("rock", size=0.6)
    rock.location.z, rock.rotation_euler.x = 1.0, np.pi / 2
    rock.tetflora.is_explicit = True
    if how == "driven":
        rock.driver_add("hide_render").driver.expression = "frame > 2"
    else:
        for frame, hidden in ((1, False), (3, True)):
            rock.hide_render = hidden
            rock.keyframe_insert("hide_render", frame=frame)
        rock.hide_render = False
        if how == "by the NLA":
            action = rock.animation_data.action
            rock.animation_data.nla_tracks.new().strips.new("hide", 1, action)
            rock.animation_data.action = None
    scene.render.film_transparent = True
    scene.render.image_settings.color_mode = 'RGBA'
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(tmp_path / "frame")

    def seen():
        bpy.ops.render.render(animation=True)
        for frame in (1, 2, 3):
            image = bpy.data.images.load(str(tmp_path / f"frame{frame:04d}.png"))
            yield float(np.array(image.pixels).reshape(-1, 4)[:, 3].sum())
            bpy.data.images.remove(image)

    shown = list(seen())
    assert shown[0] > 1.0 and shown[1] == pytest.approx(shown[0], rel=0.1) and shown[2] == 0.0
    scene.tetflora.output.camera = False  # of results: what is seen now is the original
    assert list(seen()) == [0.0, 0.0, 0.0]
    assert rock.name in scene.collection.objects
    scene.frame_set(1)
    refine.refine(scene, depsgraph())
    scene.frame_set(2)
    assert rock.name not in scene.collection.objects
    refine.clear(scene)
    assert rock.name in scene.collection.objects and not rock.hide_render
