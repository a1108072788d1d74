# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist says of an object, a collection or a layer collection holds for the results that stand for it."""

from __future__ import annotations

import json

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, tiny_render
from tetflora_addon.blender.attributes import read
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.scene import looks
from tetflora_addon.blender.scene.fields import write_field
from tetflora_addon.blender.scene.looks import LayerLooks
from tetflora_addon.blender.scene.objects import view_layer_groups

LEFT, RIGHT = (-3.0, 0.0, 0.0), (3.0, 0.0, 0.0)


@pytest.fixture
def scene(clean_file):
    """Two bushes of one species side by side; the left one, or what stands for it, is `special`."""
    scene = tiny_render(samples=2, size=24)
    scene.render.film_transparent = True
    settings = scene.tetflora  # no test looks at leaves
    settings.leaf_limit, settings.cutoff, settings.visibility_resolution = 1.0, 6.0, 64
    add_camera(location=(0.0, -13.0, 1.2))
    add_plant("plain", location=RIGHT, seed=2)
    return scene


def in_collection(scene, *objects):
    """A new collection of the scene with some objects, and its layer collection."""
    made = bpy.data.collections.new("special")
    scene.collection.children.link(made)
    for obj in objects:
        for home in obj.users_collection:
            home.objects.unlink(obj)
        made.objects.link(obj)
    bpy.context.view_layer.update()
    return bpy.context.view_layer.layer_collection.children["special"]


def as_plant(scene):
    return add_plant("special", location=LEFT)


def as_field(scene):
    one = np.zeros(1, np.int32)
    field = write_field("special", np.array([LEFT]), np.array([[1.0, 0, 0, 0]]), np.ones(1), one, one + 1, ["bush"])
    scene.collection.objects.link(field)
    return field


def as_collection_instance(scene):
    inner = bpy.data.collections.new("inner")
    add_plant("within", collection=inner)
    shown = bpy.data.objects.new("special", None)
    shown.instance_type, shown.instance_collection, shown.location = 'COLLECTION', inner, LEFT
    scene.collection.objects.link(shown)
    return shown


def as_mesh(scene):
    rock = add_mesh("special", size=0.6)
    rock.location, rock.rotation_euler.x = (LEFT[0], 0.0, 1.2), np.pi / 2
    rock.tetflora.is_explicit = True
    return rock


MADE = (as_plant, as_field, as_collection_instance, as_mesh)


def alpha(scene, tmp_path):
    """Alpha of the left and the right half of the render, summed."""
    scene.render.filepath = str(tmp_path / "render.png")
    scene.render.image_settings.color_mode = 'RGBA'
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.array(image.pixels).reshape(24, 24, 4)[..., 3]
    bpy.data.images.remove(image)
    return pixels[:, :12].sum(), pixels[:, 12:].sum()


@pytest.mark.fine
@pytest.mark.parametrize("make", MADE)
def test_holdout_and_indirect_only_of_a_layer_collection_are_what_the_renderer_sees(scene, tmp_path, make):
    layer = in_collection(scene, make(scene))
    full, other = alpha(scene, tmp_path)
    assert full > 10.0
    for said in ("holdout", "indirect_only"):
        setattr(layer, said, True)
        left, same = alpha(scene, tmp_path)
        setattr(layer, said, False)
        assert left < 0.02 * full
        assert same == pytest.approx(other, rel=0.1)


def results(scene):
    """Result objects by whether they stand for what is special: they lie on its side."""
    refine.refine(scene, depsgraph())
    made = [o for o in scene.objects if o.get("tetflora_kind", "species") != "species"]
    assert made
    found = {True: [], False: []}
    for obj in made:
        x = read(obj.data, "position")[:, 0] + obj.location.x
        assert (x < 0.0).all() or (x > 0.0).all(), obj.name
        found[bool((x < 0.0).all())].append(obj)
    return found[True], found[False]


SAID = {
    "is_holdout": True,
    "is_shadow_catcher": True,
    "hide_viewport": True,
    "pass_index": 7,
    "lightgroup": "key",
    "visible_camera": False,
    "visible_diffuse": False,
    "visible_glossy": False,
    "visible_transmission": False,
    "visible_volume_scatter": False,
    "visible_shadow": False,
}


@pytest.mark.parametrize("make", MADE)
def test_what_is_said_of_an_object_is_said_of_its_results_each_time(scene, make):
    special = make(scene)
    lit = bpy.data.collections.new("lit by")
    # As in Blender, pass index and light group are those of what is instanced.
    shown = special if special.instance_collection is None else special.instance_collection.objects[0]
    for name, value in SAID.items():
        setattr(shown if name in ("pass_index", "lightgroup") else special, name, value)
    special.light_linking.receiver_collection = special.light_linking.blocker_collection = lit
    for _ in range(2):  # and again
        own, others = results(scene)
        for obj in own:
            assert {name: getattr(obj, name) for name in SAID} == SAID
            assert obj.light_linking.receiver_collection == obj.light_linking.blocker_collection == lit
        for obj in others:
            assert not obj.is_holdout and not obj.is_shadow_catcher and obj.visible_camera and not obj.pass_index
            assert obj.light_linking.receiver_collection is None
    refine.clear(scene)  # objects that results replace are hidden meanwhile
    for name, value in SAID.items():
        for obj in {special, shown}:
            setattr(obj, name, not value if isinstance(value, bool) else type(value)())
    special.light_linking.receiver_collection = special.light_linking.blocker_collection = None
    refine.refine(scene, depsgraph())
    made = [o for o in scene.objects if o.get("tetflora_kind", "species") != "species"]
    assert not any(o.is_holdout or o.hide_viewport or o.pass_index or not o.visible_camera for o in made)


def test_collections_hidden_in_viewports_hide_their_results_there(scene):
    layer = in_collection(scene, as_plant(scene))
    layer.collection.hide_viewport = True
    own, others = results(scene)
    assert all(o.hide_viewport and not o.hide_render for o in own) and not any(o.hide_viewport for o in others)


@pytest.mark.parametrize("make", MADE)
@pytest.mark.parametrize("closed", ["object", "collection"])
def test_what_has_its_eye_closed_has_results_that_viewports_hide_and_renders_show(scene, tmp_path, make, closed):
    special = make(scene)
    layer = in_collection(scene, special)
    if special.type == 'MESH':
        special.modifiers.new("two", 'ARRAY')
    before = alpha(scene, tmp_path)
    for _ in range(2):  # that originals are hidden for results says nothing
        refine.refine(scene, depsgraph())
        assert not any(o.hide_viewport for o in scene.objects if o.get("tetflora_kind"))
    if closed == "object":
        refine.clear(scene)
        special.hide_set(True)
    else:
        layer.hide_viewport = True
    own, others = results(scene)
    assert all(o.hide_viewport and not o.hide_render for o in own) and not any(o.hide_viewport for o in others)
    refine.clear(scene)
    assert alpha(scene, tmp_path) == pytest.approx(before)


def test_eyes_of_view_layers_divide_no_render(scene):
    special = as_plant(scene)
    in_collection(scene, special)
    second = scene.view_layers.new("second")
    second.layer_collection.children["special"].hide_viewport = True
    assert len(view_layer_groups(scene)) == 1
    second.layer_collection.children["special"].holdout = True
    assert len(view_layer_groups(scene)) == 2


@pytest.mark.fine
def test_view_layers_with_other_holdouts_have_results_of_their_own(scene, tmp_path):
    special = as_plant(scene)
    in_collection(scene, special)
    second = scene.view_layers.new("second")
    second.layer_collection.children["special"].holdout = True
    scene.view_layers[0].use = False
    held, _ = alpha(scene, tmp_path)
    scene.view_layers[0].use, second.use = True, False
    full, _ = alpha(scene, tmp_path)
    assert full > 10.0 and held < 0.02 * full


def test_output_settings_hide_what_an_object_shows_but_not_the_other_way(scene):
    special = as_plant(scene)
    special.visible_shadow = False
    scene.tetflora.output.pass_index = 3
    own, others = results(scene)
    assert {o.pass_index for o in (*own, *others)} == {3}
    scene.tetflora.output.camera = False
    assert not any(o.visible_camera for o in (*own, *others))
    assert not any(o.visible_shadow for o in own) and all(o.visible_shadow for o in others)


@pytest.fixture
def viewport(scene):
    """Context of a 3D viewport, as operators have it that are called from its sidebar; it shows no empties."""
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    before, area.type = area.type, 'VIEW_3D'
    region = next(region for region in area.regions if region.type == 'WINDOW')
    area.spaces[0].show_object_viewport_empty = False  # as artists do who see crowns in place of axes
    yield {"window": window, "area": area, "region": region}
    area.spaces[0].show_object_viewport_empty = True
    area.type = before


def asked_one_by_one(layer, obj):
    """What `LayerLooks` says that a view layer adds to an object, by Blender's own words for each object."""
    with bpy.context.temp_override(area=None):
        shown = obj.visible_get(view_layer=layer)
    return not shown, obj.holdout_get(view_layer=layer), obj.indirect_only_get(view_layer=layer)


@pytest.mark.parametrize("seed", range(6))
def test_looks_are_those_that_blender_tells_of_each_object(clean_file, monkeypatch, seed):
    """Collections in collections, objects in several, flags of both at random; in the first two scenes few flags.

    Every other one is read in a render's thread.
    """
    monkeypatch.setattr(looks, "on_main_thread", lambda: seed % 2 == 0)
    rng, scene, layer = np.random.default_rng(seed), bpy.context.scene, bpy.context.view_layer
    often = 0.02 if seed < 2 else 0.25
    homes = [scene.collection]
    for number in range(12):
        made = bpy.data.collections.new(f"c{number}")
        homes[rng.integers(len(homes))].children.link(made)
        made.hide_viewport = bool(rng.random() < often)
        homes.append(made)
    objects = [bpy.data.objects.new(f"o{number}", None) for number in range(150)]
    for obj in objects:
        for home in rng.choice(len(homes), rng.integers(1, 4), replace=False):
            homes[home].objects.link(obj)
        obj.hide_viewport = bool(rng.random() < often)
    waiting = list(layer.layer_collection.children)
    while waiting:
        one = waiting.pop()
        for flag in ("exclude", "hide_viewport", "holdout", "indirect_only"):
            if rng.random() < often:
                setattr(one, flag, True)
        waiting += one.children
    for obj in objects:
        if rng.random() < often and obj.name in layer.objects:
            obj.hide_set(True, view_layer=layer)
    bpy.data.objects.new("in no collection", None)
    found, seen = LayerLooks(layer), LayerLooks(layer, viewports=False)
    for obj in bpy.data.objects:
        hidden, holdout, indirect = asked_one_by_one(layer, obj)
        said = json.loads(found.of(obj) or "{}")
        assert bool(said.get("hide_viewport")) == (hidden or obj.hide_viewport), obj.name
        assert bool(said.get("is_holdout")) == holdout and ("camera" in said.get("off", ())) == indirect, obj.name
        assert "hide_viewport" not in json.loads(seen.of(obj) or "{}") or obj.hide_viewport


def test_what_one_viewport_leaves_out_is_not_hidden_in_all(scene, viewport):
    plant = as_plant(scene)
    with bpy.context.temp_override(**viewport):
        assert not plant.visible_get()
        refine.refine(scene, depsgraph())
    made = [o for o in scene.objects if o.get("tetflora_kind")]
    assert made and not any(o.hide_viewport for o in made)
