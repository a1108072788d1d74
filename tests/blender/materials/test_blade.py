# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaf blades: their mean is that of proxies, sides differ, veins show against the light, few leaves are worn."""

import bpy
import numpy as np
import pytest

from tests.blender.renders import picture, small_scene
from tetflora_addon.blender import compat
from tetflora_addon.blender.materials import blade, materials, nodes
from tetflora_addon.blender.results import meshes
from tetflora_addon.species.leaf_models import LEAF_MODELS
from tetflora_addon.subplants.leaf_copies import LeafCopies

pytestmark = pytest.mark.usefixtures("clean_file")

COLOUR, TRANSMISSION = np.array([0.11, 0.2, 0.035]), 0.4
MODELS = {"palmate": "maple", "lobed": "lobed", "narrow": "lanceolate", "petal": "round", "plain": "deltoid"}
ROWS = 6
WIDTH = 2.0


def half_sky(below):
    """Light of radiance 1 from above only, or from below only."""
    tree = compat.shader_tree(bpy.context.scene.world)
    graph = nodes.Graph(tree)
    up = graph.node("ShaderNodeSeparateXYZ", {"Vector": graph.node("ShaderNodeTexCoord").outputs["Generated"]})
    lit = graph.math('LESS_THAN' if below else 'GREATER_THAN', up.outputs["Z"], 0.0)
    graph.node("ShaderNodeOutputWorld", {"Surface": graph.node("ShaderNodeBackground", {"Strength": lit})})


def leaves(model, material, upper, spread=0.03):
    """Rows of one leaf model, each copy of another colour, that show their upper side to the camera or the other."""
    copies = LeafCopies(model, ROWS * ROWS, TRANSMISSION)
    step = WIDTH / ROWS
    column, row = np.meshgrid(np.arange(ROWS), np.arange(ROWS))
    place = np.stack([column.ravel() + 0.5, row.ravel() + 0.1, 0 * row.ravel()], axis=1) * step
    place -= [WIDTH / 2, WIDTH / 2, 0.0]
    frame = np.diag([1.0, 1.0, 1.0] if upper else [-1.0, 1.0, -1.0]).astype(np.float32)
    tone = 1.0 + spread * np.linspace(-1, 1, ROWS * ROWS)
    n = len(place)
    copies.add(
        np.arange(n, dtype=np.uint64), place, np.tile(frame, (n, 1, 1)), np.full(n, 0.8 * step), COLOUR * tone[:, None]
    )
    made = bpy.data.objects.new("leaves", meshes.write_mesh("leaves", copies.buffers(), [material]))
    bpy.context.scene.collection.objects.link(made)
    return made


def seen(model, material, upper, below, engine="CYCLES", size=96):
    """Mean radiance of leaves over the image under half a sky, and the picture."""
    for thing in (*bpy.data.objects, *bpy.data.worlds):
        (bpy.data.objects if isinstance(thing, bpy.types.Object) else bpy.data.worlds).remove(thing)
    small_scene(sky=0.0, samples=24, size=size, engine=compat.eevee_engine() if engine == "EEVEE" else engine)
    bpy.context.scene.render.film_transparent = True
    half_sky(below)
    leaves(model, material, upper)
    return picture()


def means(kind, engine="CYCLES"):
    """Reflected and transmitted light (2, 3) of leaves and of proxies in their place, the mean of both sides."""
    model = LEAF_MODELS[MODELS.get(kind, "ovate")]
    flat = type(model)(model.positions * [1, 1, 0], model.corner_verts, model.face_offsets, model.uv)
    share = flat.area * (0.8 / ROWS * WIDTH) ** 2 * ROWS**2 / WIDTH**2
    out = []
    for material in (materials.leaf_material("Oak", kind), materials.proxy_material()):
        sides = [[seen(flat, material, up, below, engine).mean(axis=(0, 1)) for up in (1, 0)] for below in (0, 1)]
        out.append(np.mean(sides, axis=1) / share)
    return out


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
    upper, lower = (seen(model, material, up, below=False).mean(axis=(0, 1)) for up in (True, False))
    assert (lower[:2] > 1.1 * upper[:2]).all()


def test_veins_are_lighter_in_reflected_light_and_the_midrib_is_darker_against_the_light():
    """On a sheet whose midrib lies in the middle of the image."""
    for below in (False, True):
        picture_of = seen(LEAF_MODELS["ovate"], materials.leaf_material("Oak"), True, below, size=288)
        leaf = picture_of[48:96, 48:96, 1]  # one of them
        middle = np.argmax((leaf > 0.5 * leaf.max()).sum(axis=0))
        rib, beside = leaf[16:24, 23:25].max(axis=1), np.median(leaf[16:24, 12:20])
        assert middle > 0
        if below:
            assert leaf[16:24, 22:26].min(axis=1).mean() < 0.9 * beside
        else:
            assert rib.mean() > 1.1 * beside


def test_few_leaves_are_worn():
    material = materials.leaf_material("Oak", "pinnate")
    picture_of = seen(LEAF_MODELS["ovate"], material, True, below=False)
    leaf = picture_of.sum(axis=2) > 0.1
    brown = leaf & (picture_of[..., 0] > picture_of[..., 1])
    assert 0.0 < brown.sum() / leaf.sum() < 0.08


def test_leaves_of_one_colour_look_alike_at_any_place():
    """Numbers of a leaf follow from its colour alone, so they do not flicker when a mesh is made anew."""
    one, other = (seen(LEAF_MODELS["ovate"], materials.leaf_material("Oak"), True, False) for _ in range(2))
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
