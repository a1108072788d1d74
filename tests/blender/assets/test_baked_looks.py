# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that only Cycles knows are baked to faces, and nothing of it is left in the file."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.assets.surfaces import SQUARE, Paint, cards, image, read
from tests.blender.scenes import datablocks, select
from tetflora_addon.blender.assets import baked_looks

pytestmark = pytest.mark.usefixtures("clean_file")

QUARTERS = [[(x + 0.5 * u, y + 0.5 * v) for u, v in SQUARE] for y in (0, 0.5) for x in (0, 0.5)]


def _noisy(scale=0.7):
    """A material whose red is the noise, and whose green is the gradient along U; and the noise as an attribute."""
    paint = Paint("noisy")
    noise = paint.node("TexNoise")
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = scale, 0.0
    paint.link(paint.node("UVMap").outputs[0], noise.inputs["Vector"])
    paint.link(noise.outputs[0], paint.shader.inputs["Base Color"])
    return paint


def _gradient(paint, axis='X'):
    """What the gradient texture gives is the coordinate itself, so all means are known."""
    gradient, place, turn = paint.node("TexGradient"), paint.node("UVMap"), paint.node("Mapping")
    turn.inputs["Rotation"].default_value = (0, 0, 0 if axis == 'X' else -np.pi / 2)
    paint.link(place.outputs[0], turn.inputs[0])
    paint.link(turn.outputs[0], gradient.inputs[0])
    return gradient


def test_pattern_has_its_mean_on_each_face():
    paint = Paint()
    paint.link(_gradient(paint).outputs["Color"], paint.shader.inputs["Base Color"])
    source, warnings = read(cards([paint.material], QUARTERS), bake=True)
    surface = source.surfaces[0]
    np.testing.assert_allclose(surface.colour, np.repeat([[0.25], [0.75], [0.25], [0.75]], 3, axis=1), rtol=0.02)
    np.testing.assert_allclose(surface.coverage, 1, atol=1e-3)
    np.testing.assert_allclose(surface.transmission, 0, atol=1e-3)
    assert warnings == ()


def test_noise_is_what_cycles_renders():
    """Against a fine grid of the same card, whose faces are small enough to be even."""
    paint, n = _noisy(4.0), 24
    x, y = (a.ravel() / n for a in np.meshgrid(np.arange(n), np.arange(n)))
    fine = np.stack([x, y], axis=1)[:, None] + np.array(SQUARE) / n
    small = read(cards([paint.material], fine), bake=True)[0].surfaces[0].colour.astype(np.float64)
    large = read(cards([paint.material], QUARTERS), bake=True)[0].surfaces[0].colour.astype(np.float64)
    expected = small.reshape(2, n // 2, 2, n // 2, 3).mean(axis=(1, 3)).reshape(4, 3)
    assert np.ptp(small[:, 0]) > 0.3
    np.testing.assert_allclose(large, expected, rtol=0.05)


def test_holes_and_what_goes_through_are_baked_with_mixes_and_groups():
    """A group of a leaf that is half translucent, mixed with a hole by a pattern."""
    paint = Paint()
    tree = bpy.data.node_groups.new("leaf", "ShaderNodeTree")
    tree.interface.new_socket(name="Surface", in_out='OUTPUT', socket_type='NodeSocketShader')
    kinds = ("NodeGroupOutput", "ShaderNodeMixShader", "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTranslucent")
    end, inner, front, back = (tree.nodes.new(kind) for kind in kinds)
    for shader, socket in zip((front, back), inner.inputs[1:3], strict=True):
        shader.inputs["Color"].default_value = (0.2, 0.4, 0.1, 1)
        tree.links.new(shader.outputs[0], socket)
    tree.links.new(inner.outputs[0], end.inputs[0])
    group, mix, hole = paint.node("Group", node_tree=tree), paint.node("MixShader"), paint.node("BsdfTransparent")
    paint.link(_gradient(paint).outputs["Fac"], mix.inputs[0])
    paint.link(hole.outputs[0], mix.inputs[1])
    paint.link(group.outputs[0], mix.inputs[2])
    paint.link(mix.outputs[0], paint.output.inputs["Surface"])
    surface = read(cards([paint.material], QUARTERS), bake=True)[0].surfaces[0]
    np.testing.assert_allclose(surface.coverage, [0.25, 0.75, 0.25, 0.75], rtol=0.02)
    np.testing.assert_allclose(surface.colour, np.tile((0.2, 0.4, 0.1), (4, 1)), rtol=0.02)
    np.testing.assert_allclose(surface.transmission, 0.5, rtol=0.02)


def test_only_slots_that_need_it_are_baked_and_the_file_stays_as_it_was():
    plain, noisy = Paint("plain"), _noisy()
    plain.texture(image(np.tile((0.2, 0.4, 0.6), (8, 8, 1)), space="Non-Color"))
    obj = cards([plain.material, noisy.material], QUARTERS, slots=[0, 1, 0, 1])
    other = cards([None], name="other")
    select(other)
    scene = bpy.context.scene
    scene.render.engine = 'CYCLES'
    scene.cycles.samples = 77
    before = datablocks(), [o.select_get() for o in scene.objects], len(noisy.tree.nodes)
    surface = read(obj, bake=True)[0].surfaces[0]
    assert (datablocks(), [o.select_get() for o in scene.objects], len(noisy.tree.nodes)) == before
    assert (bpy.context.scene, scene.cycles.samples, bpy.context.view_layer.objects.active) == (scene, 77, other)
    np.testing.assert_allclose(surface.colour[[0, 2]], np.tile((0.2, 0.4, 0.6), (2, 1)), atol=0.003)
    assert (surface.colour[1] != surface.colour[3]).any()


def test_pieces_of_a_larger_mesh_are_baked_one_after_the_other(monkeypatch):
    monkeypatch.setattr(baked_looks, "_BLOCKS", 3)
    paint = Paint()
    paint.link(_gradient(paint).outputs["Color"], paint.shader.inputs["Base Color"])
    uvs = [[(0.04 * i + 0.04 * u, v) for u, v in SQUARE] for i in range(25)]
    surface = read(cards([paint.material], uvs), bake=True)[0].surfaces[0]
    np.testing.assert_allclose(surface.colour[:, 0], 0.04 * np.arange(25) + 0.02, atol=0.003)


def test_where_baking_fails_means_stay_and_are_told(monkeypatch):
    def fails(*_arguments):
        raise RuntimeError("out of memory")

    monkeypatch.setattr(baked_looks, "_bake", fails)
    before = datablocks()
    obj = cards([_noisy().material], QUARTERS)
    surface, (warning,) = (lambda found: (found[0].surfaces[0], found[1]))(read(obj, bake=True))
    assert "out of memory" in warning
    assert '"noisy"' in warning
    assert np.ptp(surface.colour.astype(np.float64), axis=0).max() == 0
    bpy.data.objects.remove(obj)
    assert not any(name.startswith("TetFlora") for names in datablocks().values() for name in names), before
