# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants that move are blurred: their vertices have the velocity of their object."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, datablocks, depsgraph, tiny_render
from tetflora_addon.blender.assets.marks import use_as_species
from tetflora_addon.blender.attributes import read
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.scene.camera import read_camera
from tetflora_addon.blender.scene.fields import write_field
from tetflora_addon.blender.scene.plants import read_plants

PACE, TURN, RATE = 2.0, 0.4, 24.0  # meters and radians a frame


@pytest.fixture
def scene(clean_file):
    scene = tiny_render(samples=1, size=64)
    scene.render.fps, scene.render.fps_base = 24, 1.0
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    scene.render.film_transparent = True
    add_camera(location=(0.0, -13.0, 1.2))
    scene.frame_set(2)
    return scene


def animated(obj, path="location", index=0, step=PACE):
    """Let a channel change steadily, and be 0 at frame 2."""
    for frame in (0, 4):
        value = list(getattr(obj, path))
        value[index] = step * (frame - 2)
        setattr(obj, path, value)
        obj.keyframe_insert(path, index=index, frame=frame)
    for layer in obj.animation_data.action.layers:
        for curve in layer.strips[0].channelbag(obj.animation_data.action_slot).fcurves:
            for key in curve.keyframe_points:
                key.interpolation = 'LINEAR'
    bpy.context.scene.frame_set(2)


def directly(scene, **how):
    animated(add_plant(), **how)


def by_a_parent(scene, **how):
    parent, between = (bpy.data.objects.new(name, None) for name in ("parent", "between"))
    for obj in (parent, between):
        scene.collection.objects.link(obj)
    between.parent = parent
    add_plant().parent = between
    animated(parent, **how)


def in_a_field(scene, **how):
    one = np.zeros(1, np.int32)
    field = write_field("field", np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]), np.ones(1), one, one + 1, ["bush"])
    scene.collection.objects.link(field)
    animated(field, **how)


def as_a_collection_instance(scene, **how):
    inner = bpy.data.collections.new("inner")
    add_plant("within", collection=inner)
    shown = bpy.data.objects.new("shown", None)
    shown.instance_type, shown.instance_collection = 'COLLECTION', inner
    scene.collection.objects.link(shown)
    animated(shown, **how)


def within_a_collection_instance(scene, **how):
    inner = bpy.data.collections.new("inner")
    animated(add_plant("within", collection=inner), **how)
    shown = bpy.data.objects.new("shown", None)
    shown.instance_type, shown.instance_collection = 'COLLECTION', inner
    scene.collection.objects.link(shown)


def _moving_target(scene, **how):
    target = bpy.data.objects.new("target", None)
    scene.collection.objects.link(target)
    animated(target, **how)
    return target


def by_a_constraint(scene, **how):
    add_plant().constraints.new('COPY_TRANSFORMS').target = _moving_target(scene, **how)


def by_a_constraint_of_what_viewports_do_not_show(scene, **how):
    by_a_constraint(scene, **how)
    bpy.data.objects["plant"].hide_viewport = True


def by_a_driver(scene, **how):
    driver = add_plant().driver_add("location", 0).driver
    driver.type = 'SUM'
    target = driver.variables.new()
    target.type = 'TRANSFORMS'
    target.targets[0].id = _moving_target(scene, **how)
    target.targets[0].transform_type = 'LOC_X'


def in_the_nla(scene, **how):
    plant = add_plant()
    animated(plant, **how)
    data = plant.animation_data
    strip = data.nla_tracks.new().strips.new("strip", 0, data.action)
    strip.action_slot, strip.extrapolation = data.action_slot, 'HOLD'
    data.action = None


SIMPLE = (directly, by_a_parent, in_a_field, as_a_collection_instance, within_a_collection_instance)
OTHERS = (by_a_constraint, by_a_constraint_of_what_viewports_do_not_show, by_a_driver, in_the_nla)


@pytest.mark.parametrize("way", (*SIMPLE, *OTHERS))
@pytest.mark.parametrize("position", ['START', 'CENTER', 'END'])
def test_plants_have_the_motion_of_what_moves_them(scene, way, position):
    scene.render.motion_blur_position = position
    way(scene)
    seeds = read_plants(scene, depsgraph())[0]
    assert seeds.motion == pytest.approx(np.array([[PACE * RATE, 0, 0, 0, 0, 0]]), abs=1e-3)
    middle = {'START': 0.5, 'CENTER': 0.0, 'END': -0.5}[position]
    assert seeds.position == pytest.approx(np.array([[PACE * middle, 0, 0]]), abs=1e-4)


@pytest.mark.parametrize("way", (directly, *OTHERS))
def test_who_asks_for_motion_changes_nothing(scene, way):
    scene.render.motion_blur_position = 'START'
    way(scene)
    told, graph = [], depsgraph()
    for handlers in (bpy.app.handlers.depsgraph_update_post, bpy.app.handlers.frame_change_post):
        handlers.append(lambda scene, depsgraph=None: told.append(scene.name))
    moving = bpy.data.objects.get("target", bpy.data.objects["plant"])

    def state():
        return (
            datablocks(),
            scene.frame_current_final,
            [o.matrix_world.copy() for o in scene.objects],
            moving.location[:],
        )

    before = state()
    assert read_plants(scene, graph)[0].motion is not None
    assert state() == before
    bpy.context.view_layer.update()
    assert not told


def test_a_plant_that_turns_about_its_parent_has_both_motions(scene):
    by_a_parent(scene, path="rotation_euler", index=2, step=TURN)
    bpy.data.objects["plant"].location.x = 3.0
    seeds = read_plants(scene, depsgraph())[0]
    assert seeds.motion[0, 5] == pytest.approx(TURN * RATE, rel=1e-5)
    chord = 3.0 * 2 * np.sin(TURN / 2) * RATE
    assert seeds.motion[0, :3] == pytest.approx([0.0, chord, 0.0], abs=1e-3)


@pytest.mark.parametrize(
    ("off", "value"), [("render", False), ("cycles", False), ("curves", None)], ids=["scene", "object", "nothing"]
)
def test_plants_without_motion_have_none(scene, off, value):
    add_plant()
    if off != "curves":
        animated(bpy.data.objects["plant"])
        (scene.render if off == "render" else bpy.data.objects["plant"].cycles).use_motion_blur = value
    assert read_plants(scene, depsgraph())[0].motion is None


@pytest.mark.fine
def test_every_part_of_a_plant_that_turns_has_the_velocity_of_its_place(scene):
    directly(scene, path="rotation_euler", index=2, step=TURN)
    refine.refine(scene, depsgraph())
    made = [o for o in scene.objects if o.get("tetflora_kind", "species") != "species"]
    assert {o["tetflora_kind"] for o in made} >= {"bark", "leaf"}
    for obj in made:
        place, velocity = (read(obj.data, name).astype(np.float64) for name in ("position", "velocity"))
        expected = TURN * RATE * np.stack([-place[:, 1], place[:, 0], 0.0 * place[:, 0]], axis=1)
        off = np.abs(velocity - expected)
        if (
            obj["tetflora_kind"] == "proxy" and obj.type == 'MESH' and obj.data.polygons
        ):  # triangles move as a whole, with their middle
            off = np.abs([(velocity - expected)[list(face.vertices)].mean(axis=0) for face in obj.data.polygons])
        assert off.mean() < 0.15  # a wide triangle that stands for many twigs has the speeds of its axis
        assert np.abs(velocity).max() > 4.0


def test_a_moving_plant_is_drawn_blurred(scene, tmp_path):
    spread = []
    for moving in (False, True):
        (directly if moving else lambda _: add_plant())(scene)
        scene.render.filepath = str(tmp_path / "render.png")
        scene.render.image_settings.color_mode = 'RGBA'
        scene.cycles.samples = 16
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        alpha = np.array(image.pixels).reshape(64, 64, 4)[..., 3].sum(axis=0)
        bpy.data.images.remove(image)
        across = np.arange(64) - (alpha * np.arange(64)).sum() / alpha.sum()
        spread.append(np.sqrt((alpha * across**2).sum() / alpha.sum()))
        bpy.data.objects.remove(bpy.data.objects["plant"])
    pixels = 64 / (2 * 13.0 * np.tan(bpy.data.cameras["camera"].angle / 2))
    assert spread[1] ** 2 - spread[0] ** 2 == pytest.approx((PACE * pixels) ** 2 / 12, rel=0.25)


def test_what_a_plant_looks_like_does_not_change_because_it_moves(scene):
    directly(scene)
    positions = []
    for blurred in (True, False):
        scene.render.use_motion_blur = blurred
        scene.tetflora.expand_everything = True
        refine.refine(scene, depsgraph())
        bark = next(o for o in scene.objects if o.get("tetflora_kind") == "bark")
        positions.append(read(bark.data, "position"))
    assert positions[0] == pytest.approx(positions[1], abs=1e-4)


def test_a_camera_moved_by_its_parent_is_read_while_its_shutter_is_open(scene):
    parent = bpy.data.objects.new("dolly", None)
    scene.collection.objects.link(parent)
    scene.camera.parent = parent
    animated(parent)
    camera = read_camera(scene, depsgraph())
    assert [round(float(other.position[0]), 4) for other in camera.shutter] == [-PACE / 2, PACE / 2]


def test_a_camera_on_a_path_is_read_while_its_shutter_is_open(scene):
    scene.camera.location = (0.0, 0.0, 0.0)
    scene.camera.constraints.new('COPY_LOCATION').target = _moving_target(scene)
    camera = read_camera(scene, depsgraph())
    assert [round(float(other.position[0]), 4) for other in camera.shutter] == [-PACE / 2, PACE / 2]


@pytest.mark.parametrize("detail", ['AUTO', 'REFINE'])
def test_models_are_carried_by_what_moves_them(scene, detail):
    """Meshes that are refined, and plants whose species is a model; others stay."""
    rock, model = add_mesh("rock", size=0.5), add_mesh("model", size=0.5)
    rock.tetflora.is_explicit = True
    species = use_as_species(scene, depsgraph(), model).identifier
    for obj in (rock, add_plant("moving", species)):
        animated(obj)
    add_plant("still", species, location=(0.0, 3.0, 0.0))
    scene.tetflora.asset_detail = detail
    for blurred in (True, False):
        scene.render.use_motion_blur = blurred
        scene.frame_set(2)
        refine.refine(scene, depsgraph())
        scene.frame_set(3)
        made = [o for o in scene.objects if o.get("tetflora_kind", "species") != "species"]
        moved = [round(o.evaluated_get(depsgraph()).matrix_world.translation.x, 3) for o in made]
        assert moved.count(PACE) == 2 * blurred and moved.count(0.0) == len(moved) - 2 * blurred > 0
