# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Light as it is read from a scene against Cycles' own, and the material that shows baked light."""

from __future__ import annotations

from math import pi, radians

import bpy
import numpy as np
import pytest

from tests.blender.renders import few_directions, picture, same_samples, small_scene
from tests.blender.scenes import add_mesh, add_plant, datablocks, depsgraph
from tetflora_addon.blender import compat
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.materials import materials, nodes
from tetflora_addon.blender.scene import lights
from tetflora_addon.light import scattering, sources
from tetflora_addon.light.illumination import baked_attributes

pytestmark = pytest.mark.usefixtures("clean_file")
UP = np.array([[0.0, 0.0, 1.0]])


def white_plane():
    """A white diffuse square of 4 m at the origin."""
    plane = add_mesh(size=2.0)
    material = bpy.data.materials.new("white")
    tree = compat.shader_tree(material)
    tree.nodes.clear()
    diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    plane.data.materials.append(material)
    return plane


def add_light(kind, location=(0.3, 0.2, 3.0), turn=(0.0, 0.0, 0.0), **properties):
    data = bpy.data.lights.new("light", kind)
    for key, value in properties.items():
        setattr(data, key, value)
    made = bpy.data.objects.new("light", data)
    made.location, made.rotation_euler = location, turn
    bpy.context.scene.collection.objects.link(made)


def irradiance_of_lights():
    """W/m² at the origin on level ground, by the engine."""
    found = lights.read_lights(depsgraph())
    total = np.zeros(3)
    for light in sources.split_areas(found):
        toward, arriving = sources.arriving(light, np.zeros((1, 3)))
        total += arriving[0] * max(toward[0, 2], 0.0)
    return total


LIGHTS = {
    "sun": ('SUN', {"energy": 2.5, "color": (1.0, 0.8, 0.6), "turn": (0.0, radians(35.0), 0.0)}),
    "point": ('POINT', {"energy": 100.0, "shadow_soft_size": 0.1}),
    "spot": ('SPOT', {"energy": 100.0, "spot_size": 0.5, "spot_blend": 0.6, "shadow_soft_size": 0.01}),
    "square": ('AREA', {"energy": 100.0, "size": 1.0}),
    "ellipse": ('AREA', {"energy": 100.0, "shape": 'ELLIPSE', "size": 1.0, "size_y": 0.3, "turn": (0.2, 0.1, 0.0)}),
    "exposed": ('POINT', {"energy": 25.0, "exposure": 2.0, "shadow_soft_size": 0.1}),
}


@pytest.mark.parametrize("name", LIGHTS)
def test_irradiance_is_that_of_cycles(name):
    kind, properties = LIGHTS[name]
    small_scene(sky=0.0, samples=64, size=8, width=0.02)
    white_plane()
    add_light(kind, **properties)
    assert irradiance_of_lights() / pi == pytest.approx(picture().mean(axis=(0, 1)), rel=0.012)


def world_irradiance(world, normals=UP):
    return scattering.irradiance(np.tile(world.parts.sum(axis=0), (len(normals), 1, 1)), normals)


def test_a_plain_world():
    small_scene(sky=0.25, samples=1)
    found = lights.read_world(bpy.context.scene)
    assert world_irradiance(found.world)[0] == pytest.approx(0.25 * pi, rel=1e-3)
    assert not found.suns
    assert not found.note
    bpy.context.scene.world = None
    assert lights.read_world(bpy.context.scene).world.dark


def feed_background(kind):
    tree = bpy.context.scene.world.node_tree
    node = tree.nodes.new(kind)
    tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Color"])
    return node


@pytest.mark.parametrize(("tilt", "broken"), [(0.0, 0.0), (90.0, 0.0), (0.0, np.inf), (90.0, np.nan)])
def test_an_image_is_the_right_way_round(tilt, broken):
    """Irradiance of planes that face up and +X, under a sky with one bright side, as in Cycles."""
    small_scene(sky=0.0, samples=256, size=8, width=0.02)
    rng = np.random.default_rng(3)
    image = bpy.data.images.new("sky", 32, 16, float_buffer=True)
    pixels = np.ones((16, 32, 4), np.float32)
    pixels[..., :3] = rng.uniform(0.0, 0.2, 3)
    pixels[9:14, 12:19, :3] += rng.uniform(1.0, 2.0, 3)
    pixels[13, 3, 1] += broken  # as the sun is in some pictures of skies
    image.pixels.foreach_set(pixels.ravel())
    feed_background("ShaderNodeTexEnvironment").image = image
    few_directions(bpy.context.scene.world)
    plane, camera = white_plane(), bpy.context.scene.camera
    plane.rotation_euler = camera.rotation_euler = (0.0, radians(tilt), 0.0)
    normal = np.array([[np.sin(radians(tilt)), 0.0, np.cos(radians(tilt))]])
    camera.location = 50.0 * normal[0]
    found = lights.read_world(bpy.context.scene)
    wanted = picture().mean(axis=(0, 1)) * pi
    assert world_irradiance(found.world, normal)[0] == pytest.approx(wanted, rel=0.08)


def test_skies_give_ground_as_much_light_as_in_cycles():
    small_scene(sky=0.0, samples=256, size=8, width=0.02)
    white_plane()
    sky = feed_background("ShaderNodeTexSky")
    for kind in (item.identifier for item in sky.bl_rna.properties["sky_type"].enum_items):
        sky.sky_type = kind
        sky.sun_elevation, sky.sun_rotation = radians(40.0), 1.0
        sky.sun_direction = (0.5, 0.5, 0.6)
        found = lights.read_world(bpy.context.scene)
        total = world_irradiance(found.world)[0]
        for sun in found.suns:
            total = total + sun.color * -sun.direction[2]
        assert not found.note
        assert total == pytest.approx(picture().mean(axis=(0, 1)) * pi, rel=0.12)


def test_what_cannot_be_read_is_said():
    small_scene(sky=0.0, samples=1)
    feed_background("ShaderNodeTexNoise")
    found = lights.read_world(bpy.context.scene)
    assert "gray" in found.note
    assert not found.world.dark


def baked_square(front, back, color=0.5):
    square = add_mesh(size=0.5, z=1.0)
    attributes = baked_attributes('FACE', np.array([front], np.float32), np.array([back], np.float32))
    attributes = {**attributes, "tf_color": ('FACE', np.full((1, 3), color, np.float32))}
    for name, (domain, values) in attributes.items():
        square.data.attributes.new(name, 'FLOAT_VECTOR', domain).data.foreach_set("vector", values.ravel())
    square.data.materials.append(materials.baked_material())
    bpy.context.view_layer.update()
    return square


@pytest.mark.parametrize("engine", ["CYCLES", "EEVEE"])
def test_the_camera_sees_what_was_baked(engine):
    """Front and back, whatever lights there are."""
    small_scene(
        sky=0.7, samples=1, sun=20.0, width=0.5, engine="CYCLES" if engine == "CYCLES" else compat.eevee_engine()
    )
    square = baked_square((0.1, 0.2, 0.3), (0.4, 0.05, 0.6))
    assert picture().mean(axis=(0, 1)) == pytest.approx([0.1, 0.2, 0.3], rel=0.01)
    square.rotation_euler = (pi, 0.0, 0.0)
    assert picture().mean(axis=(0, 1)) == pytest.approx([0.4, 0.05, 0.6], rel=0.01)


def test_it_throws_a_shadow_and_lights_nothing():
    small_scene(sky=0.0, samples=32, sun=0.0, width=0.4)
    bpy.context.scene.camera.location = (0.0, 0.0, 0.6)
    white_plane()
    assert picture().mean() == pytest.approx(1.0, rel=0.02)
    baked_square((50.0, 50.0, 50.0), (50.0, 50.0, 50.0), color=0.0)
    assert picture().mean() < 0.02


FORMS = ['MICROSURFACES', 'SHELLS', 'MICROSPHERES']


def bush_before_the_sky(engine='CYCLES', samples=16, size=48):
    """A bush that is proxies for the most part, in sun and skylight, so many pixels wide; gives the scene."""
    samples = samples if engine == 'CYCLES' else same_samples(engine)  # of half a second each, without a GPU
    small_scene(sky=0.4, samples=samples, sun=40.0, size=size, width=3.6, shadows=True)
    scene = bpy.context.scene
    scene.render.engine = engine if engine == 'CYCLES' else compat.eevee_engine()
    scene.cycles.transparent_max_bounces = scene.cycles.min_transparent_bounces = 256
    scene.camera.location, scene.camera.rotation_euler = (0.0, -50.0, 1.3), (pi / 2, 0.0, 0.0)
    add_plant("bush", "bush")
    scene.tetflora.refine_at_render = False
    scene.tetflora.leaf_limit = 2.5
    return scene


def refined(scene, **settings):
    for name, value in settings.items():
        setattr(scene.tetflora, name, value)
    return refine.refine(scene, depsgraph())


def results(scene, *kinds):
    return [o for o in scene.objects if o.get("tetflora_kind") in kinds]


@pytest.mark.parametrize("engine", ['CYCLES', 'EEVEE'])
@pytest.mark.parametrize(("form", "bound"), [('MICROSURFACES', 0.2), ('MICROSPHERES', 0.25), ('SHELLS', 0.35)])
def test_baked_proxies_are_as_bright_as_lit_ones(form, bound, engine):
    """Mean over the plant, told by what its darkness leaves of the sky; EEVEE lights shells and spheres its own way."""
    scene = bush_before_the_sky(engine, size=32 if engine == 'CYCLES' else 48)
    lit = refined(scene, proxy_kind=form)
    assert lit.polygons_proxy > 200
    one = picture()
    baked = refined(scene, baked_light='PROXIES')
    other = picture()
    assert baked.polygons_proxy == lit.polygons_proxy
    assert "light" in baked.seconds
    plant = one.mean(axis=2) < 0.36  # the sky is .4
    assert plant.mean() > 0.1
    assert other[plant].mean() == pytest.approx(one[plant].mean(), rel=bound if engine == 'CYCLES' else 2 * bound)


@pytest.mark.parametrize("form", FORMS)
def test_baked_pictures_have_next_to_no_noise(form):
    """Two seeds: what a pixel of the plant differs by, in the median, as edges of facets are noise by themselves.

    For the same reason all samples are taken in the middle of their pixel.
    """
    scene = bush_before_the_sky(size=32)
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = 'BLACKMAN_HARRIS', 0.01

    def noise():
        pictures = []
        for seed in (1, 2):
            scene.cycles.seed = seed
            pictures.append(picture())
        return np.median(np.abs(pictures[1] - pictures[0])[pictures[0].mean(axis=2) < 0.35])

    refined(scene, proxy_kind=form)
    lit = noise()
    refined(scene, baked_light='ALL')
    assert noise() < 0.1 * lit


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("baked", ['PROXIES', 'ALL'])
def test_clear_and_esc_leave_nothing_of_baked_light(form, baked):
    scene = bush_before_the_sky(size=16)
    scene.tetflora.proxy_kind, scene.tetflora.baked_light = form, baked
    before = datablocks()
    refined(scene)
    assert results(scene, "proxy")
    refine.clear(scene)
    assert datablocks() == before
    steps = refine.refine_steps(scene, depsgraph())
    for progress in steps:
        if "shadows" in progress.message:
            break
    steps.close()
    assert datablocks() == before


def test_real_leaves_show_baked_light_only_if_asked_for_and_materials_stay():
    scene = bush_before_the_sky()
    scene.tetflora.leaf_limit = 0.5
    refined(scene)
    assert len(results(scene, "leaf", "bark")) > 1
    lit = [m.name for o in results(scene, "leaf", "bark") for m in o.data.materials]
    assert materials.BAKED not in lit
    refined(scene, baked_light='PROXIES')
    assert [m.name for o in results(scene, "leaf", "bark") for m in o.data.materials] == lit
    assert all("tf_light_front" not in o.data.attributes for o in results(scene, "leaf", "bark"))
    refined(scene, baked_light='ALL')
    real = results(scene, "leaf", "bark")
    assert {m.name for o in real for m in o.data.materials} == {materials.BAKED}
    for made in real:
        layer = made.data.attributes["tf_light_front"]
        assert layer.domain == ('POINT' if made["tetflora_kind"] == "bark" else 'FACE')
        values = np.zeros(3 * len(layer.data), np.float32)
        layer.data.foreach_get("vector", values)
        assert np.isfinite(values).all()
        assert values.min() >= 0.0
        assert values.max() > 0.01


def test_meshes_that_hide_plants_throw_shadows_and_light():
    """A roof takes the sun away; black ground takes what white ground gives."""
    scene = bush_before_the_sky()
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)

    def mean():
        refined(scene, baked_light='PROXIES')
        layer = results(scene, "proxy")[0].data.attributes["tf_light_front"]
        values = np.zeros(3 * len(layer.data), np.float32)
        layer.data.foreach_get("vector", values)
        return values.mean()

    free = mean()
    ground = add_mesh(size=8.0, z=-0.05)
    ground.tetflora.is_occluder = True
    material = bpy.data.materials.new("ground")
    tree = compat.shader_tree(material)
    principled = next(n for n in tree.nodes if n.type == 'BSDF_PRINCIPLED')
    ground.data.materials.append(material)
    colors = {}
    for value in (0.0, 0.8):
        principled.inputs["Base Color"].default_value = (value, value, value, 1.0)
        colors[value] = mean()
    assert colors[0.0] == pytest.approx(free, rel=0.05)
    assert colors[0.8] > 1.1 * free
    ground.location.z = 4.0
    principled.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    assert mean() < 0.02 * free


def test_shells_follow_the_scene_and_old_groups_give_way():
    scene = bush_before_the_sky(size=16)
    refined(scene, proxy_kind='SHELLS', shell_diffuse=0.5, shell_spear=20.0, shell_roundness=0.25)

    def group():
        material = results(scene, "proxy")[0].data.materials[0]
        return next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeGroup")

    found = {name: group().inputs[name].default_value for name in ("p", "s", "spear", "Roundness", "Variation")}
    assert found == pytest.approx({"p": 0.5, "s": 0.04, "spear": 20.0, "Roundness": 0.25, "Variation": 0.05})
    refined(scene, shell_diffuse=1.0)
    assert group().inputs["p"].default_value == 1.0
    version = nodes.VERSION
    old, material = group().node_tree, results(scene, "proxy")[0].data.materials[0]
    old[version] -= 1
    material[version] -= 1
    refined(scene)
    assert group().node_tree != old
    assert "(version " in old.name
