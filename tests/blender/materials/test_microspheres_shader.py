# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The microsphere group gives back what it takes: uniform light is neither gained nor lost, in either engine."""

import bpy
import numpy as np
import pytest

from devtools import session
from tests.blender.renders import few_directions, picture, small_scene
from tetflora_addon.blender import compat
from tetflora_addon.blender.materials import microsphere

pytestmark = pytest.mark.usefixtures("clean_file")

#: Particle, planes, and half of each, with weak and strong highlights, with and without transmission.
MIXTURES = ((0.0, 0.04, 0.0), (0.0, 0.04, 0.5), (1.0, 0.04, 0.5), (1.0, 0.3, 0.0), (0.5, 0.3, 0.5))


def place(tilt=0.0, **inputs):
    """A square of 2 m in the middle, its face `tilt` off the viewer, with the group's inputs as named."""
    material = bpy.data.materials.new("microspheres")
    tree = compat.shader_tree(material)
    tree.nodes.clear()
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = microsphere.microsphere_group()
    given = {"Color": (1.0, 1.0, 1.0, 1.0), "Through Tint": (1.0, 1.0, 1.0, 1.0), **inputs}
    for name, value in given.items():
        group.inputs[name].default_value = value
    # Not linked, EEVEE takes the object's extent for its thickness.
    thin = tree.nodes.new("ShaderNodeValue")
    thin.outputs[0].default_value = 0.0
    for target in ("Cycles", "EEVEE"):
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        output.target = target.upper()
        tree.links.new(thin.outputs[0], output.inputs["Thickness"])
        tree.links.new(group.outputs[target], output.inputs["Surface"])
    compat.disable_bump_correction(material)
    bpy.ops.mesh.primitive_plane_add(size=2.0, rotation=(0.0, tilt, 0.0))
    square = bpy.context.scene.objects["Plane"]
    square.data.materials.append(material)
    return square


def engine_and_samples(name: str, samples: int) -> dict:
    """Arguments of `small_scene`. EEVEE adds nothing by chance to even light, and a sample takes it half a second."""
    return {"engine": compat.eevee_engine(), "samples": 1} if name == "EEVEE" else {"engine": name, "samples": samples}


@pytest.mark.parametrize("tilt", [0.0, 0.9])
@pytest.mark.parametrize(("plane", "s", "transmission"), MIXTURES)
def test_a_white_cloud_vanishes_in_white_surroundings(plane, s, transmission, tilt):
    """A constant sky is found by scattered rays alone."""
    small_scene(sky=1.0, samples=256, size=8, width=0.5)
    place(tilt, Plane=plane, s=s, Transmission=transmission, Normal=(0.3, 0.2, 0.9))
    assert picture().mean() == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("transmission", [0.0, 0.5])
@pytest.mark.parametrize("plane", [0.0, 1.0])
def test_light_that_is_sampled_counts_as_light_that_is_hit(plane, transmission):
    """The same sky with a texture of which all colors are one: Cycles then also picks directions in the sky."""
    small_scene(sky=1.0, samples=256, size=8, width=0.5)
    place(0.9, Plane=plane, s=0.0, Transmission=transmission, Normal=(0.3, 0.2, 0.9))
    few_directions(bpy.context.scene.world)
    tree = bpy.context.scene.world.node_tree
    texture, where = tree.nodes.new("ShaderNodeTexChecker"), tree.nodes.new("ShaderNodeTexCoord")
    texture.inputs["Color1"].default_value = texture.inputs["Color2"].default_value = (1.0, 1.0, 1.0, 1.0)
    tree.links.new(where.outputs["Generated"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    assert picture().mean() == pytest.approx(1.0, abs=0.01)


def test_eevee_gains_and_loses_no_more():
    for plane, s, transmission in MIXTURES[1:4]:
        session.clean_file()
        small_scene(sky=1.0, samples=1, size=8, width=0.5, engine=compat.eevee_engine())
        place(0.5, Plane=plane, s=s, Transmission=transmission, Normal=(0.3, 0.2, 0.9))
        assert picture().mean() == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("name", ["CYCLES", "EEVEE"])
def test_planes_follow_the_cosine_to_the_light(name):
    """p cos α, whatever the face: sun from the zenith, planes 40° off."""
    for face in (0.0, 0.6):
        session.clean_file()
        small_scene(sky=0.0, size=8, sun=0.0, width=0.4, **engine_and_samples(name, 4))
        place(face, Plane=1.0, s=0.0, p=0.5, Normal=(np.sin(0.7), 0.0, np.cos(0.7)))
        assert picture().mean() == pytest.approx(0.5 * np.cos(0.7), rel=0.02)


@pytest.mark.parametrize("name", ["CYCLES", "EEVEE"])
def test_light_from_behind_passes_through(name):
    """A sun below the square, seen from above: the share that is transmitted, times the tint."""
    small_scene(sky=0.0, size=8, sun=180.0, width=0.4, **engine_and_samples(name, 64))
    tint = (1.0, 0.5, 0.25, 1.0)
    square = place(Transmission=0.4, Roundness=0.0, **{"Through Tint": tint, "Color": (0.5, 0.5, 0.5, 1.0)})
    # In EEVEE's shadow map a sheet of no thickness shadows its own far side.
    square.visible_shadow = False
    assert bpy.context.scene.objects["sun"].rotation_euler[1] > 3.0
    np.testing.assert_allclose(picture().mean(axis=(0, 1)), 0.2 * np.array(tint[:3]), rtol=0.02)


def test_round_particles_have_the_phase_of_a_lambert_sphere():
    """Light at an angle γ to the viewer: 2/3 (sin γ + (π − γ) cos γ) / π of what a white sheet facing both returns."""
    for angle in (0.0, 60.0):
        session.clean_file()
        small_scene(sky=0.0, samples=1024, sun=angle, size=8, width=0.4)
        place(Roundness=1.0)
        gamma = np.radians(angle)
        wanted = 2.0 / 3.0 * (np.sin(gamma) + (np.pi - gamma) * np.cos(gamma)) / np.pi
        assert picture().mean() == pytest.approx(wanted, rel=0.02)


def test_particles_with_a_surface_of_their_own_use_its_normal():
    small_scene(sky=0.0, samples=4, size=8, sun=0.0, width=0.4)
    place(Facing=(np.sin(0.7), 0.0, np.cos(0.7)))
    assert picture().mean() == pytest.approx(np.cos(0.7), rel=0.02)


def test_haze_dims_it_and_adds_its_own_light():
    """A world volume between viewer and cloud, in both engines: Blender's own, so the surface only has to take part."""
    for name in ("CYCLES", "EEVEE"):
        session.clean_file()
        small_scene(sky=0.0, size=8, width=0.4, **engine_and_samples(name, 8))
        scene = bpy.context.scene
        scene.camera.location.z = 5.0
        lamp = bpy.data.lights.new("lamp", 'POINT')
        lamp.energy, lamp.shadow_soft_size = 100.0, 0.05
        light = bpy.data.objects.new("lamp", lamp)
        light.location = (0.5, 0.0, 1.0)
        scene.collection.objects.link(light)
        place()
        clear = picture().mean()
        tree = scene.world.node_tree
        haze = tree.nodes.new("ShaderNodeVolumeAbsorption")
        haze.inputs["Density"].default_value = 0.2
        haze.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
        tree.links.new(haze.outputs[0], tree.nodes["World Output"].inputs["Volume"])
        assert clear > 0.1
        assert picture().mean() < 0.6 * clear


def test_every_socket_is_described_and_every_link_valid():
    group = microsphere.microsphere_group()
    sockets = [item for item in group.interface.items_tree if item.item_type == 'SOCKET']
    assert {s.name for s in sockets if s.in_out == 'INPUT'} >= {"Color", "Transmission", "Normal", "Plane", "p", "s"}
    assert all(s.description for s in sockets if s.in_out == 'INPUT')
    assert [s.name for s in sockets if s.in_out == 'OUTPUT'] == ["Cycles", "EEVEE"]
    assert all(link.is_valid for link in group.links)
