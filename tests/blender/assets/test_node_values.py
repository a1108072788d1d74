# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes between images and shaders are followed, on numbers that are known exactly."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from benchmarks import pictures
from tests.blender.assets.surfaces import SQUARE, Paint, cards, image, look
from tests.blender.scenes import add_camera, add_mesh, depsgraph, tiny_render
from tetflora_addon.blender.materials.face_looks import FaceReader
from tetflora_addon.blender.materials.node_values import BLENDS, MATHS, NodeValues

pytestmark = pytest.mark.usefixtures("clean_file")


def _through(paint, node, socket="Color", output=0):
    """Put a node between the image and the base color."""
    texture = next(n for n in paint.tree.nodes if n.type == 'TEX_IMAGE')
    paint.link(texture.outputs["Color"], node.inputs[socket])
    paint.link(node.outputs[output], paint.shader.inputs["Base Color"])
    return node


def test_nodes_that_change_colors_are_followed():
    """An even image, so that each result is known exactly."""
    given = np.array((0.5, 0.25, 0.125))
    cases = {
        "Gamma": ({"Gamma": 2.0}, given**2),
        "BrightContrast": ({"Bright": 0.1, "Contrast": 0.2}, 1.2 * given + 0.1 - 0.1),
        "Invert": ({"Fac": 1.0}, 1 - given),
        "HueSaturation": ({"Saturation": 0.0, "Value": 0.5}, np.full(3, 0.25)),
        "RGBCurve": ({}, given),
    }
    for kind, (inputs, expected) in cases.items():
        paint = Paint(kind)
        paint.texture(image(np.tile(given, (4, 4, 1)), space="Non-Color"))
        node = _through(paint, paint.node(kind))
        for key, value in inputs.items():
            node.inputs[next(s.name for s in node.inputs if s.identifier == key)].default_value = value
        np.testing.assert_allclose(look(paint)[0][0], expected, atol=0.004, err_msg=kind)


def test_ramp_and_mix_are_followed():
    paint = Paint()
    paint.texture(image(np.tile((0.5, 0.5, 0.5), (4, 4, 1)), space="Non-Color"))
    ramp = _through(paint, paint.node("ValToRGB"), "Fac")
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (1, 0, 0, 1), (0, 0, 1, 1)
    np.testing.assert_allclose(look(paint)[0][0], (0.5, 0, 0.5), atol=0.004)
    mix = paint.node("Mix", data_type='RGBA', blend_type='MULTIPLY')
    by_id = {s.identifier: s for s in mix.inputs}
    by_id["Factor_Float"].default_value = 0.5
    by_id["B_Color"].default_value = (0.0, 0.0, 0.5, 1)
    paint.link(ramp.outputs["Color"], by_id["A_Color"])
    paint.link(next(s for s in mix.outputs if s.identifier == "Result_Color"), paint.shader.inputs["Base Color"])
    np.testing.assert_allclose(look(paint)[0][0], (0.25, 0, 0.375), atol=0.004)


def test_ramps_and_curves_that_change_are_the_new_ones():
    """One reader serves many steps, between which an artist, or the next frame, has other nodes at these addresses."""
    paint, reader = Paint(), FaceReader()
    paint.texture(image(np.tile((0.5, 0.5, 0.5), (4, 4, 1)), space="Non-Color"))
    curves, ramp = paint.node("RGBCurve"), paint.node("ValToRGB")
    paint.link(_through(paint, ramp, "Fac").outputs["Color"], curves.inputs["Color"])
    paint.link(curves.outputs["Color"], paint.shader.inputs["Base Color"])
    mesh = cards([paint.material], (SQUARE,)).data

    def color():
        return reader.prepare(mesh, [paint.material]).plans[0].constant[1:4]

    found = [color()]
    ramp.color_ramp.elements[1].color = (1, 0, 0, 1)
    found.append(color())
    curves.mapping.curves[3].points[1].location = (1.0, 0.5)
    curves.mapping.update()
    found.append(color())
    np.testing.assert_allclose(found, [(0.5, 0.5, 0.5), (0.5, 0, 0), (0.25, 0, 0)], atol=0.004)


def test_nodes_that_are_switched_off_let_colors_pass():
    paint = Paint()
    paint.texture(image(np.tile((0.5, 0.25, 0.125), (4, 4, 1)), space="Non-Color"))
    node = _through(paint, paint.node("Invert"))
    node.mute = True
    np.testing.assert_allclose(look(paint)[0][0], (0.5, 0.25, 0.125), atol=0.003)


def _of_blender(kind, inputs, prepare=lambda node: None, **settings):
    """What a node of Blender's makes of constants, found by geometry nodes."""
    group = bpy.data.node_groups.new("nodes", 'GeometryNodeTree')
    group.interface.new_socket("Geometry", in_out='INPUT', socket_type='NodeSocketGeometry')
    group.interface.new_socket("Geometry", in_out='OUTPUT', socket_type='NodeSocketGeometry')
    nodes, link = group.nodes, group.links.new
    node, store = nodes.new(kind), nodes.new("GeometryNodeStoreNamedAttribute")
    for name, value in settings.items():
        setattr(node, name, value)
    prepare(node)
    given = [socket for socket in node.inputs if socket.enabled]
    for socket, value in zip(given, inputs, strict=False):
        socket.default_value = value
    store.data_type, store.domain = 'FLOAT_VECTOR', 'POINT'
    store.inputs["Name"].default_value = "found"
    link(nodes.new("NodeGroupInput").outputs[0], store.inputs["Geometry"])
    link(next(s for s in node.outputs if s.enabled), next(s for s in store.inputs if s.name == "Value" and s.enabled))
    link(store.outputs["Geometry"], nodes.new("NodeGroupOutput").inputs[0])
    point = add_mesh("point")
    point.modifiers.new("nodes", 'NODES').node_group = group
    return np.array(point.evaluated_get(depsgraph()).data.attributes["found"].data[0].vector)


_COLORS = [
    ((0.5, 0.25, 0.125), (0.2, 0.9, 0.4), 0.7),
    ((0.1, 0.0, 0.8), (0.6, 0.6, 0.6), 0.3),
    ((0.9, 0.4, 0.0), (1.0, 0.0, 0.3), 1.0),
]


def test_all_ways_to_mix_colors_are_those_of_blender():
    kinds = bpy.types.ShaderNodeMix.bl_rna.properties["blend_type"].enum_items.keys()
    assert set(kinds) == set(BLENDS)
    for kind in kinds:
        for a, b, t in _COLORS:
            wanted = _of_blender("ShaderNodeMix", [t, (*a, 1), (*b, 1)], data_type='RGBA', blend_type=kind)
            columns = (np.array(color, np.float32)[:, None] for color in (a, b))
            found = BLENDS[kind](*columns, np.full(1, t, np.float32))
            np.testing.assert_allclose(np.ravel(found), wanted, atol=1e-5, err_msg=kind)


def _operands(kind):
    node = bpy.data.node_groups.new("nodes", 'GeometryNodeTree').nodes.new("ShaderNodeMath")
    node.operation = kind
    return sum(socket.enabled for socket in node.inputs)


def test_operations_of_math_are_those_of_blender():
    kinds = set(bpy.types.ShaderNodeMath.bl_rna.properties["operation"].enum_items.keys())
    unknown = {name for name in kinds if name.startswith(("SMOOTH_", "ARC", "TAN", "SINH", "COSH"))}
    assert kinds - unknown <= set(MATHS)
    for kind in sorted(kinds & set(MATHS)):
        for given in ((0.7, 0.4, 0.2), (2.6, 0.5, 0.25), (-1.3, 0.8, 0.1)):
            operands = [np.full(1, value, np.float32) for value in given[: _operands(kind)]]
            with np.errstate(all="ignore"):  # as where nodes are read
                made = MATHS[kind](*operands)
            wanted = _of_blender("ShaderNodeMath", given, operation=kind)[0]
            assert float(made[0]) == pytest.approx(wanted, abs=1e-4), (kind, given)


def _followed(kind, inputs, **settings):
    """The same by the add-on: what it makes of a node in a material, without the limits of colors; None if unknown."""
    paint, unknown = Paint(), []
    node = paint.node(kind, **settings)
    for socket, value in zip([s for s in node.inputs if s.enabled], inputs, strict=False):
        socket.default_value = value
    paint.link(next(s for s in node.outputs if s.enabled), paint.shader.inputs["Base Color"])
    points = SimpleNamespace(uneven=False, unknown=lambda: unknown.append(node))
    made = NodeValues(points, {}).color(paint.shader, "Base Color", ())
    return None if unknown else np.ravel(made)


_VECTORS = [
    ((0.7, 0.4, 0.2), (0.3, -0.5, 1.2), (0.1, 0.6, 0.9)),
    ((-1.3, 2.6, 0.5), (0.8, 0.25, -0.4), (-0.7, 0.2, 0.3)),
    ((4.2, -0.1, -3.5), (0.0, 1.5, 2.0), (0.5, 0.0, -1.0)),
]


def test_operations_of_vectors_are_those_of_blender():
    kinds = set(bpy.types.ShaderNodeVectorMath.bl_rna.properties["operation"].enum_items.keys())
    left_out = {"CROSS_PRODUCT", "PROJECT", "REFLECT", "REFRACT", "FACEFORWARD", "NORMALIZE", "TANGENT"}
    for kind in sorted(kinds):
        for given in _VECTORS:
            inputs = {'SCALE': (given[0], 0.7), 'REFRACT': (*given[:2], 0.7)}.get(kind, given)
            found = _followed("VectorMath", inputs, operation=kind)
            assert (found is None) == (kind in left_out), kind
            if found is not None:
                wanted = _of_blender("ShaderNodeVectorMath", inputs, operation=kind)
                known = np.isfinite(wanted)  # geometry nodes of 4.5 know no remainder of a division by 0
                np.testing.assert_allclose(found[known], wanted[known], atol=1e-4, err_msg=f"{kind} {given}")


@pytest.mark.parametrize("kind", ['MINMAX', 'RANGE'])
@pytest.mark.parametrize("given", [(0.4, 0.0, 1.0), (1.7, -0.5, 0.6), (0.4, 0.9, 0.2), (-2.0, 0.9, 0.2)])
def test_numbers_are_clamped_as_by_blender(kind, given):
    wanted = _of_blender("ShaderNodeClamp", given, clamp_type=kind)
    np.testing.assert_allclose(_followed("Clamp", given, clamp_type=kind), wanted, atol=1e-6)


@pytest.mark.parametrize("clamp", [False, True])
@pytest.mark.parametrize("kind", ['LINEAR', 'SMOOTHSTEP', 'SMOOTHERSTEP'])
@pytest.mark.parametrize("given", [(0.4, 0.1, 0.8, -1.0, 3.0), (1.4, 1.0, 0.2, 2.0, 0.5), (-0.3, 0.5, 0.5, 0.2, 0.9)])
def test_ranges_are_mapped_as_by_blender(kind, clamp, given):
    settings = {"interpolation_type": kind, "clamp": clamp}
    wanted = _of_blender("ShaderNodeMapRange", given, **settings)
    np.testing.assert_allclose(_followed("MapRange", given, **settings), wanted, atol=1e-5)


def _rendered(node, path):
    """What a node of a material makes of constants, by a picture: some are in no other trees."""
    tree, material = node.id_data, next(m for m in bpy.data.materials if m.node_tree == node.id_data)
    light, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(next(s for s in node.outputs if s.enabled), light.inputs["Color"])
    tree.links.new(light.outputs[0], output.inputs["Surface"])
    output.is_active_output = True
    add_mesh("plane", size=50.0).data.materials.append(material)
    add_camera(location=(0.0, -5.0, 5.0), rotation=(0.8, 0.0, 0.0))
    scene = tiny_render()
    scene.view_settings.view_transform = 'Raw'
    pictures.render(scene, path, 1, form='OPEN_EXR')
    return pictures.read_picture(path)[0, 0, :3]


_PLACE, _TURNED = (0.4, 0.2, 0.7), [(0.3, -0.2, 0.4), (0.8, 1.6, 1.25)]


@pytest.mark.parametrize(
    ("kind", "inputs", "settings"),
    [
        ("SeparateXYZ", [(0.3, 2.0, 0.9)], {}),
        ("CombineXYZ", [0.3, 2.0, 0.9], {}),
        ("SeparateColor", [(0.3, 0.7, 0.9, 1.0)], {}),
        ("CombineColor", [0.3, 0.7, 0.9], {}),
        ("RGBToBW", [(0.3, 0.7, 0.9, 1.0)], {}),
        *[("Mapping", [_PLACE, (-0.3, -0.5, -0.2), *_TURNED], {"vector_type": kind}) for kind in ('POINT', 'TEXTURE')],
        *[("Mapping", [_PLACE, *_TURNED], {"vector_type": kind}) for kind in ('VECTOR', 'NORMAL')],
    ],
)
def test_what_is_in_materials_alone_is_as_it_is_rendered(kind, inputs, settings, tmp_path):
    node = Paint().node(kind, **settings)
    for socket, value in zip([s for s in node.inputs if s.enabled], inputs, strict=True):
        socket.default_value = value
    wanted = _rendered(node, tmp_path / "picture.exr")
    np.testing.assert_allclose(_followed(kind, inputs, **settings), wanted, atol=1e-3)


def test_curves_are_those_of_blender():
    """By numbers within the curve's ends, which is where tables of it lie."""

    def bent(node):
        curve = node.mapping.curves[0 if node.type == 'CURVE_FLOAT' else 3]
        curve.points.new(0.3, 0.8)
        node.mapping.update()

    for kind, color in (("FloatCurve", 0.45), ("RGBCurve", (0.1, 0.45, 0.9, 1.0))):
        inputs = [0.6, color]
        paint = Paint()
        node = paint.node(kind)
        bent(node)
        for socket, value in zip(node.inputs, inputs, strict=True):
            socket.default_value = value
        paint.link(node.outputs[0], paint.shader.inputs["Base Color"])
        found = NodeValues(SimpleNamespace(uneven=False), {}).color(paint.shader, "Base Color", ())
        wanted = _of_blender(f"ShaderNode{kind}", inputs, prepare=bent)
        np.testing.assert_allclose(np.ravel(found), wanted, atol=2e-3, err_msg=kind)
