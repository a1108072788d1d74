# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf blades: their mean is that of proxies, sides differ, veins show against the light, few leaves are worn."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from tests.blender.renders import few_directions, picture, small_scene
from tetflora_addon.blender import compat
from tetflora_addon.blender.materials import blade, materials, nodes
from tetflora_addon.blender.results import meshes
from tetflora_addon.leaves.models import LEAF_MODELS
from tetflora_addon.subplants.leaf_meshes import LeafCopies

pytestmark = [pytest.mark.usefixtures("clean_file"), pytest.mark.fine]

COLOR, TRANSMISSION = np.array([0.11, 0.2, 0.035]), 0.4
MODELS = {"palmate": "maple", "lobed": "lobed", "narrow": "lanceolate", "petal": "round", "plain": "deltoid"}
ROWS = 6
WIDTH = 2.0


def half_sky(below):
    """Light of radiance 1 from above only, or from below only."""
    world = bpy.context.scene.world
    few_directions(world)
    graph = nodes.Graph(compat.shader_tree(world))
    up = graph.node("ShaderNodeSeparateXYZ", {"Vector": graph.node("ShaderNodeTexCoord").outputs["Generated"]})
    lit = graph.math('LESS_THAN' if below else 'GREATER_THAN', up.outputs["Z"], 0.0)
    graph.node("ShaderNodeOutputWorld", {"Surface": graph.node("ShaderNodeBackground", {"Strength": lit})})


def leaves(model, material, sides, rows=ROWS, spread=0.03):
    """Rows of one leaf model, each copy of another color; rows show one of the sides (1 upper, -1 lower) in turn."""
    number, step = rows * rows, WIDTH / rows
    copies = LeafCopies(model, number, TRANSMISSION)
    column, row = (a.ravel() for a in np.meshgrid(np.arange(rows), np.arange(rows)))
    place = np.stack([column + 0.5, row + 0.1, 0 * row], axis=1) * step - [WIDTH / 2, WIDTH / 2, 0.0]
    side = np.array(sides)[row % len(sides)]
    frame = np.zeros((number, 3, 3), np.float32)
    frame[:, 0, 0], frame[:, 1, 1], frame[:, 2, 2] = side, 1.0, side
    tone = 1.0 + spread * np.linspace(-1, 1, number)
    copies.add(np.arange(number, dtype=np.uint64), place, frame, np.full(number, 0.8 * step), COLOR * tone[:, None])
    made = bpy.data.objects.new("leaves", meshes.write_mesh("leaves", copies.buffers(), [material]))
    bpy.context.scene.collection.objects.link(made)


def seen(model, material, sides, below, engine="CYCLES", size=60, rows=ROWS):
    """Picture of leaves under half a sky of 1."""
    for things in (bpy.data.objects, bpy.data.worlds):
        for thing in things:
            things.remove(thing)
    small_scene(sky=0.0, samples=16, size=size, engine=compat.eevee_engine() if engine == "EEVEE" else engine)
    half_sky(below)
    leaves(model, material, sides, rows)
    return picture()


def means(kind, engine="CYCLES"):
    """Reflected and transmitted light (2, 3), mean of both sides, of leaves and of proxies in their place by Cycles."""
    model = LEAF_MODELS[MODELS.get(kind, "ovate")]
    flat = replace(model, positions=model.positions * [1, 1, 0])
    share = flat.area * 0.8**2
    made = (materials.leaf_material("Oak", kind), engine), (materials.proxy_material(), "CYCLES")
    return [
        np.array([seen(flat, one, (1, -1), below, by).mean(axis=(0, 1)) for below in (0, 1)]) / share
        for one, by in made
    ]


@pytest.mark.parametrize("kind", list(blade.BLADES))
def test_the_mean_over_leaves_is_that_of_proxies(kind):
    """Reflectance and transmittance, each within .01."""
    ours, proxies = means(kind)
    assert (proxies[:, 1] > 0.05).all()
    np.testing.assert_allclose(ours, proxies, atol=0.01)


def test_the_mean_is_the_same_in_eevee():
    ours, proxies = means("pinnate", "EEVEE")
    np.testing.assert_allclose(ours, proxies, atol=0.012)


def test_the_underside_is_paler():
    model, material = LEAF_MODELS["ovate"], materials.leaf_material("Oak")
    upper, lower = (seen(model, material, (side,), below=False).mean(axis=(0, 1)) for side in (1, -1))
    assert (lower > 1.08 * upper).all()


@pytest.mark.parametrize(("below", "lighter"), [(False, 1.06), (True, 0.87)])
def test_veins_are_lighter_and_the_midrib_is_darker_against_the_light(below, lighter):
    """On one leaf, whose midrib lies in the middle of the image."""
    green = seen(LEAF_MODELS["ovate"], materials.leaf_material("Oak"), (1,), below, size=192, rows=1)[48:96, :, 1]
    rib, beside = green[:, 95:97].mean(), np.median(green[:, 76:116])
    assert rib > lighter * beside if lighter > 1.0 else rib < lighter * beside


def test_few_leaves_are_worn():
    material = materials.leaf_material("Oak", "pinnate")
    found = seen(LEAF_MODELS["ovate"], material, (1,), below=False, size=240, rows=12)
    leaf = found.sum(axis=2) > 0.1
    brown = leaf & (found[..., 0] > found[..., 1])
    assert 0.0 < brown.sum() / leaf.sum() < 0.08


def test_leaves_of_one_color_look_alike_at_any_place():
    """Numbers of a leaf follow from its color alone, so they do not flicker when a mesh is made anew."""
    one, other = (seen(LEAF_MODELS["ovate"], materials.leaf_material("Oak"), (1,), False) for _ in range(2))
    np.testing.assert_allclose(one, other, atol=1e-6)


def test_another_kind_is_another_material_and_the_old_one_is_kept():
    old, new = materials.leaf_material("Oak", "needle"), materials.leaf_material("Oak", "lobed")
    assert new != old
    assert new.name == "TetFlora Oak leaf"
    assert materials.leaf_material("Oak", "lobed") == new


@pytest.mark.parametrize("kind", list(blade.BLADES))
def test_every_link_is_valid(kind):
    group = blade.blade_group(kind)
    assert all(link.is_valid for link in group.links)
    assert group.name == f"TetFlora {kind.capitalize()} Leaf Blade"
