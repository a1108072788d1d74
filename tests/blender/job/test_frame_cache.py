# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of an animation share their results, and each of them is the frame alone."""

from __future__ import annotations

import hashlib
import itertools
import json
import random

import bpy
import numpy as np
import pytest

from tests.blender.digests import these
from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, depsgraph
from tetflora_addon import memory
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import contents, frame_cache, refine, render
from tetflora_addon.blender.results.output import MEGABYTES, PURPOSE, megabytes_held, result_collections
from tetflora_addon.blender.scene.camera import read_camera
from tetflora_addon.processes import pool

FRAMES = 12


@pytest.fixture
def animation(clean_file):
    """Two bushes and a camera that walks past them, 12 frames in which it goes through several cells."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 64, 36
    camera = add_camera(location=(-1.5, -9.0, 1.0))
    camera.keyframe_insert("location", frame=1)
    camera.location = (1.5, -5.0, 1.3)
    camera.keyframe_insert("location", frame=FRAMES)
    add_plant("one", seed=1, location=(-1.0, 0.0, 0.0))
    add_plant("two", seed=2, location=(1.5, 3.0, 0.0))
    settings = scene.tetflora
    settings.leaf_limit, settings.cutoff, settings.visibility_resolution = 1.0, 6.0, 64
    settings.cell_length = 1.0
    depsgraph()
    yield scene
    render.on_render_end(scene)


@pytest.fixture
def made(monkeypatch):
    """Frames for which something was refined."""
    frames, real = [], refine.refine

    def counted(scene, *arguments, **options):
        frames.append(scene.frame_current)
        return real(scene, *arguments, **options)

    monkeypatch.setattr(refine, "refine", counted)
    return frames


def go(scene, frame):
    """Go to a frame as a render does; gives what is rendered."""
    scene.frame_set(frame)
    render.on_render_pre(scene)
    assert render.render_errors() == []
    (collection,) = result_collections(scene, 'RENDER')
    assert len(collection.objects)
    return collection


def at(scene, frame):
    """What a frame is rendered with, datablock by datablock."""
    collection = go(scene, frame)
    bpy.context.view_layer.update()
    objects = collection.objects
    found = {"objects": these(objects)}
    found["meshes"] = these(o.data for o in objects if o.type == 'MESH')
    found["pointclouds"] = these(o.data for o in objects if o.type == 'POINTCLOUD')
    found["materials"] = these({m for o in objects if o.data for m in o.data.materials if m})
    return collection.name, found


def alone(scene, frame):
    """A frame of a render of its own."""
    render.on_render_end(scene)
    render.on_render_init(scene)
    found = at(scene, frame)
    render.on_render_end(scene)
    return found


def test_neighboring_frames_share_and_each_is_the_frame_alone(animation, made):
    sequence = {n: at(animation, n) for n in range(1, FRAMES + 1)}
    cells = len({name for name, _ in sequence.values()})
    assert made[0] == 1
    assert 2 <= cells == len(made) <= FRAMES // 2
    order = list(range(1, FRAMES + 1))
    random.Random(5).shuffle(order)
    again = {n: at(animation, n) for n in order}
    assert again == sequence
    assert {n: alone(animation, n) for n in order[::4]} == {n: sequence[n] for n in order[::4]}


def test_frames_are_alike_where_memory_is_the_limit(animation, made, monkeypatch):
    """What earlier frames have made is there still, other processes are known to need more, and some bytes are lost."""
    lost = itertools.count()
    monkeypatch.setattr(memory, "LEAST", 0.0)
    monkeypatch.setattr(memory, "resident", lambda: 2e7 + 2e3 * next(lost) + held())
    monkeypatch.setattr(pool, "share", lambda _limit: 1e5 * (len(made) > 1))
    animation.tetflora.max_memory = 0.022
    sequence = {n: at(animation, n) for n in range(1, FRAMES + 1)}
    assert json.loads(animation.tetflora.statistics)["facet_pixels"] > 1.5 * animation.tetflora.facet
    for n in (FRAMES, FRAMES // 2):
        lost = itertools.count()
        made.clear()
        contents._left.clear()  # as in another Blender
        assert alone(animation, n) == sequence[n]


def test_results_that_wait_go_where_the_renderer_needs_their_memory(animation, made, monkeypatch):
    left = [1e9]
    monkeypatch.setattr(frame_cache, "memory_left", lambda *_: left[0])
    go(animation, 1)
    go(animation, FRAMES // 2)
    assert len(frame_cache._entries) == 2
    left[0] = 0.0
    go(animation, FRAMES)
    assert len(frame_cache._entries) == 1
    assert made == [1, FRAMES // 2, FRAMES]


def test_only_results_that_are_replaced_count_as_gone(animation):
    other = bpy.data.scenes.new("other")
    kept, own = bpy.data.collections.new("kept"), go(animation, 1)
    other.collection.children.link(kept)
    kept[PURPOSE], kept[MEGABYTES] = 'RENDER', 50.0
    assert megabytes_held('RENDER') == pytest.approx(own[MEGABYTES] + 50.0)
    assert megabytes_held('RENDER', animation) == pytest.approx(own[MEGABYTES])
    frame_cache.stow(animation, [])
    assert megabytes_held('RENDER', animation) == pytest.approx(own[MEGABYTES])
    assert megabytes_held('VIEW', animation) == 0.0


def held():
    """Bytes of all results, about."""
    return 110.0 * sum(len(mesh.polygons) for mesh in bpy.data.meshes)


def test_what_is_seen_again_comes_back_without_being_made_again(animation, made):
    first = at(animation, 1)
    go(animation, FRAMES)
    count = len(made)
    assert at(animation, 1) == first
    assert len(made) == count


def test_without_memory_only_the_frame_itself_is_there_and_comes_back_identical(animation, made, keep_memory):
    keep_memory(0.0)
    first = at(animation, 1)
    before = {kind: len(names) for kind, names in datablocks().items()}
    for n in (FRAMES, 1, FRAMES):
        go(animation, n)
    assert {kind: len(names) for kind, names in datablocks().items()}["collections"] == before["collections"]
    assert len(made) == 4
    assert at(animation, 1) == first


def test_what_was_not_seen_for_longest_goes_first(animation, made, keep_memory):
    sizes = []
    for n in (1, FRAMES // 2, FRAMES):
        go(animation, n)
        sizes.append(megabytes_held('RENDER'))
    render.on_render_end(animation)
    made.clear()
    keep_memory((sizes[-1] - sizes[0] / 2.0) / 1e3)  # room for two of three
    for n in (1, FRAMES // 2, 1, FRAMES):  # the one in the middle is the oldest now
        go(animation, n)
    assert made == [1, FRAMES // 2, FRAMES]
    go(animation, 1)
    assert made == [1, FRAMES // 2, FRAMES]
    go(animation, FRAMES // 2)
    assert made[3:] == [FRAMES // 2]


def test_nothing_is_left_when_the_render_ends(animation):
    before = datablocks()
    for n in range(1, FRAMES + 1):
        go(animation, n)
    render.on_render_end(animation)
    assert datablocks() == before
    assert frame_cache._entries == {}


def test_nothing_that_is_kept_goes_into_a_file(animation, tmp_path):
    go(animation, 1)
    go(animation, FRAMES)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "animation.blend"), copy=True)
    with bpy.data.libraries.load(str(tmp_path / "animation.blend")) as (inside, _):
        assert not [name for name in (*inside.collections, *inside.meshes) if "TetFlora" in name or "leaf" in name]


@pytest.mark.parametrize(
    "change",
    ["plant", "seed", "lens", "settings", "terrain", "camera", "species", "form", "material", "pass index", "engine"],
)
def test_what_changes_is_noticed(animation, made, change):
    ground = add_mesh("ground", size=20.0)
    ground.tetflora.is_occluder = True
    animation.tetflora.output.species.add().species = "fern"
    depsgraph()
    go(animation, 1)
    go(animation, 1)
    assert made == [1]
    if change == "plant":
        bpy.data.objects["one"].location.x += 0.01
    elif change == "seed":
        bpy.data.objects["one"].tetflora.seed += 1
    elif change == "lens":
        animation.camera.data.lens *= 1.5
    elif change == "settings":
        animation.tetflora.facet *= 2.0
    elif change == "terrain":
        ground.data.vertices[0].co.z += 0.5
        ground.data.update()
    elif change == "camera":  # a cut
        other = bpy.data.objects.new("other", animation.camera.data)
        animation.collection.objects.link(other)
        other.location, other.rotation_euler = (0.0, 12.0, 1.0), (np.pi / 2, 0.0, np.pi)
        animation.camera = other
    elif change == "species":
        bpy.data.objects["one"].tetflora.species = "fern"
    elif change == "form":
        animation.tetflora.proxy_kind = 'MICROSPHERES'
    elif change == "material":
        animation.tetflora.output.species.add().species = "bush"
        animation.tetflora.output.species[1].leaf = bpy.data.materials.new("mine")
    elif change == "pass index":
        animation.tetflora.output.species[0].pass_index = 7
    elif change == "engine":  # which draws points in another size
        animation.render.engine = 'CYCLES' if animation.render.engine != 'CYCLES' else compat.eevee_engine()
    depsgraph()
    go(animation, 1)
    assert made == [1, 1]


def test_animated_lenses_share_while_they_change_little(animation, made):
    animation.camera.animation_data_clear()
    data = animation.camera.data
    for frame, lens in ((1, 50.0), (FRAMES, 56.0)):
        data.lens = lens
        data.keyframe_insert("lens", frame=frame)
    for n in range(1, FRAMES + 1):
        go(animation, n)
    assert 2 <= len(made) <= 4


def test_a_camera_that_stands_still_is_refined_for_exactly(animation, made):
    animation.camera.animation_data_clear()
    animation.camera.location = (0.0, -8.0, 1.0)
    depsgraph()
    exact = read_camera(animation, depsgraph(), region_only=True)
    shared = frame_cache.shared_camera(animation, depsgraph())
    assert shared.position.tolist() == exact.position.tolist()
    assert (shared.window, shared.width, shared.setback) == (exact.window, exact.width, 0.0)
    for n in (1, 2, 3):
        go(animation, n)
    assert made == [1]  # nothing changes, so nothing is made again


@pytest.mark.parametrize("mover", ["parent", "constraint", "driver", "parent's parent"])
def test_whatever_moves_the_camera_counts_as_animation(animation, mover):
    animation.camera.animation_data_clear()
    moves = frame_cache.camera_moves
    assert not moves(animation)
    carrier = bpy.data.objects.new("carrier", None)
    animation.collection.objects.link(carrier)
    if mover == "constraint":
        animation.camera.constraints.new('COPY_LOCATION').target = carrier
    elif mover == "driver":
        animation.camera.driver_add("location", 0).driver.expression = "frame * .1"
    else:
        animation.camera.parent = carrier
        assert not moves(animation)
        if mover == "parent's parent":
            carrier.parent = carrier = bpy.data.objects.new("outer", None)
            animation.collection.objects.link(carrier)
        carrier.keyframe_insert("location", frame=1)
    assert moves(animation)


def test_switched_off_each_frame_is_refined_for_its_own_camera(animation, made):
    animation.tetflora.share_frames = False
    names = {go(animation, n).name for n in (1, 2, 3)}
    assert made == [1, 2, 3]
    assert len(names) == 3


def test_explicit_objects_are_hidden_for_what_is_shown_and_shown_at_the_end(animation, made):
    bush = add_mesh("foreign", size=0.5, z=0.3)
    bush.tetflora.is_explicit = True
    depsgraph()
    for n in (1, FRAMES, 1, 2):
        go(animation, n)
        assert bush.hide_render
    render.on_render_end(animation)
    assert not bush.hide_render
    assert "tetflora_hidden_for_render" not in bpy.data.objects["foreign"]


def test_a_frame_that_fails_leaves_nothing_and_the_next_one_is_right(animation, made):
    good = at(animation, 1)
    camera, animation.camera = animation.camera, None
    render.on_render_pre(animation)
    assert len(render.render_errors()) == 1
    assert result_collections(animation, 'RENDER') == []
    animation.camera = camera
    render.on_render_init(animation)
    assert at(animation, 1) == good


@pytest.mark.parametrize("change", ["attribute", "material"])
def test_what_changes_of_explicit_objects_is_noticed(animation, made, change):
    count = 400  # corners; numbers print short where there are more than a thousand
    foreign = add_mesh("foreign", size=0.5)
    foreign.data.clear_geometry()
    foreign.data.from_pydata(
        [(i % 20 / 20.0, i // 20 / 20.0, 0.0) for i in range(count)],
        [],
        [(i, i + 1, i + 21, i + 20) for i in range(count - 21) if i % 20 < 19],
    )
    tint = foreign.data.attributes.new("tint", 'FLOAT', 'POINT')
    foreign.data.materials.append(bpy.data.materials.new("one"))
    foreign.tetflora.is_explicit = True
    depsgraph()
    go(animation, 1)
    if change == "attribute":
        tint.data[count // 2].value = 1.0
        foreign.data.update()
    else:
        foreign.data.materials[0] = bpy.data.materials.new("two")
    depsgraph()
    go(animation, 1)
    assert made == [1, 1]


def test_materials_of_leaf_objects_are_noticed(animation, made):
    leaf = add_mesh("blade", size=0.5)
    leaf.hide_render = True
    animation.tetflora.leaf_limit = 0.05  # real ones in so small a picture
    leaf.data.materials.append(bpy.data.materials.new("one"))
    entry = animation.tetflora.leaf_objects.add()
    entry.species, entry.leaf = "bush", leaf
    depsgraph()
    go(animation, 1)
    leaf.data.materials[0] = bpy.data.materials.new("two")
    depsgraph()
    assert "two" in at(animation, 1)[1]["materials"]
    assert made == [1, 1]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ((1, 11), (11, 1)),
        ((1.0, 12.0), (1.01, 2.0)),
        ({"many": np.zeros(2000)}, {"many": np.eye(2000)[1000]}),
        ({"exact": np.ones(20)}, {"exact": np.ones(20) + 1e-12}),
        (np.arange(6).reshape(2, 3).T, np.arange(6).reshape(3, 2)),
    ],
)
def test_digests_tell_values_apart(one, other):
    digests = hashlib.sha256(), hashlib.sha256()
    for digest, value in zip(digests, (one, other), strict=True):
        frame_cache.add_to_digest(digest, value)
    assert digests[0].digest() != digests[1].digest()


def test_shells_that_come_back_are_shaded_as_they_were(animation, made):
    animation.tetflora.proxy_kind = 'SHELLS'
    first = at(animation, 1)
    animation.tetflora.shell_diffuse = 0.5
    assert at(animation, 1)[1]["materials"] != first[1]["materials"]
    animation.tetflora.shell_diffuse = 1.0
    assert at(animation, 1) == first
    assert made == [1, 1]


def test_materials_put_on_the_artists_results_do_not_change_the_next_frame(animation, made):
    animation.tetflora.leaf_limit = 0.05
    refine.refine(animation, depsgraph())
    made.clear()
    (results_of_artist,) = result_collections(animation, 'VIEW')
    leaves = next(o for o in results_of_artist.objects if o.get("tetflora_kind") == "leaf")
    leaves.material_slots[0].material = bpy.data.materials.new("mine")
    first = at(animation, 1)
    assert "mine" in first[1]["materials"]
    assert at(animation, 1) == first
    assert made == [1]


def test_view_layers_go_together_as_if_nothing_were_hidden(animation, made):
    foreign = add_mesh("foreign", size=0.5)
    foreign.tetflora.is_explicit = True
    apart = bpy.data.collections.new("apart")
    animation.collection.children.link(apart)
    apart.objects.link(foreign)
    animation.collection.objects.unlink(foreign)
    second = animation.view_layers.new("second")
    second.layer_collection.children["apart"].exclude = True

    def shown():
        render.on_render_pre(animation)
        assert render.render_errors() == []
        return [
            sorted(c.collection.name for c in layer.layer_collection.children if not c.exclude)
            for layer in animation.view_layers
        ]

    first = shown()
    assert first[0] != first[1]
    assert shown() == first
    assert made == [1, 1]


def test_scenes_that_are_rendered_within_a_render_leave_its_results_alone(animation, made):
    first = at(animation, 1)
    other = bpy.data.scenes.new("other")
    for obj in animation.objects:
        other.collection.objects.link(obj)
    other.camera = animation.camera
    for prop in ("leaf_limit", "cutoff", "visibility_resolution", "cell_length"):
        setattr(other.tetflora, prop, getattr(animation.tetflora, prop))
    other.render.resolution_x, other.render.resolution_y = 64, 36
    names = {collection.name for collection in result_collections(animation)}
    render.on_render_pre(other)
    assert render.render_errors() == []
    theirs = {collection.name for collection in result_collections(other)}
    assert theirs and not theirs & names
    render.on_render_end(other)
    assert at(animation, 1) == first
    assert made == [1, 1]


def test_names_that_are_too_long_still_tell_cells_apart(animation, made):
    add_mesh("x" * 60, size=0.5).tetflora.is_explicit = True
    depsgraph()
    go(animation, 1)
    _, last = at(animation, FRAMES)
    assert len(made) == 2
    assert last == alone(animation, FRAMES)[1]
    assert not [name for kind in ("objects", "meshes") for name in last[kind] if name[-4] == "."]
