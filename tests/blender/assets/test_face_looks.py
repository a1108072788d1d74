# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces look like the part of the image that they show."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.assets.surfaces import SQUARE, Paint, cards, image, linear, look, read
from tetflora_addon.blender.materials.face_looks import Looks
from tetflora_addon.blender.materials.snow import add_snow

pytestmark = pytest.mark.usefixtures("clean_file")

QUARTERS = [[(x + 0.5 * u, y + 0.5 * v) for u, v in SQUARE] for y in (0, 0.5) for x in (0, 0.5)]


def _leaves(side=1024, seed=1):
    """Many round leaves of different colors, with holes between them."""
    rng = np.random.default_rng(seed)
    pixels = np.zeros((side, side, 4), np.float32)
    pixels[..., :3] = (0.9, 0.1, 0.7)  # what nobody must see
    y, x = np.mgrid[0:side, 0:side] / side
    for _ in range(60):
        at, radius = rng.random(2), rng.uniform(0.03, 0.1)
        inside = (x - at[0]) ** 2 + 2 * (y - at[1]) ** 2 < radius**2
        pixels[inside] = (*(rng.uniform(0.1, 0.6, 3) * (0.4 + 0.6 * at[0])), 1.0)
    return pixels


def _mean(pixels):
    """Mean color of what is not transparent, and coverage."""
    weight = pixels[..., 3:].astype(np.float64)
    stored = np.rint(pixels[..., :3] * 255) / 255
    return (linear(stored) * weight).sum(axis=(0, 1)) / weight.sum(), float(weight.mean())


def _mean_between_texels(pixels):
    """The same where color and mask are two images: both are linear between texels, which shows what is masked."""
    shown = np.concatenate([linear(np.rint(pixels[..., :3] * 255) / 255), pixels[..., 3:]], axis=2)
    parts = (np.arange(8) + 0.5) / 8
    color, cover = np.zeros(3), 0.0
    for x in parts:
        along = (1 - x) * shown + x * np.roll(shown, -1, axis=1)
        for y in parts:
            texel = (1 - y) * along + y * np.roll(along, -1, axis=0)
            color += (texel[..., :3] * texel[..., 3:]).sum(axis=(0, 1))
            cover += texel[..., 3].sum()
    return color / cover, cover / pixels[..., 3].size / 64


def test_card_of_a_whole_image_covers_as_much_as_the_image():
    paint, pixels = Paint(), _leaves()
    paint.texture(image(pixels), alpha=True)
    color, transmission, coverage, warnings = look(paint)
    expected, alpha = _mean(pixels)
    assert coverage[0] == pytest.approx(alpha, abs=0.003)
    np.testing.assert_allclose(color[0], expected, rtol=0.01)
    assert transmission[0] == 0
    assert warnings == ()


def test_face_of_a_quarter_has_the_color_of_that_quarter():
    paint, pixels = Paint(), _leaves()
    paint.texture(image(pixels), alpha=True)
    color, _, coverage, _ = look(paint, QUARTERS)
    for i, (rows, columns) in enumerate((a, b) for a in (0, 512) for b in (0, 512)):
        expected, alpha = _mean(pixels[rows : rows + 512, columns : columns + 512])
        assert coverage[i] == pytest.approx(alpha, abs=0.004)
        np.testing.assert_allclose(color[i], expected, rtol=0.01)


def test_opaque_image_of_odd_size_counts_all_pixels():
    """Alpha that is not linked does not hide anything, and colors are those of light."""
    rng = np.random.default_rng(0)
    pixels = rng.random((301, 150, 4)).astype(np.float32)
    paint = Paint()
    paint.texture(image(pixels))
    color, _, coverage, _ = look(paint)
    np.testing.assert_allclose(color[0], linear(np.rint(pixels[..., :3] * 255) / 255).mean(axis=(0, 1)), rtol=0.01)
    assert coverage[0] == 1


def test_threshold_of_alpha_cuts_at_the_texel_and_not_at_the_mean():
    """Alpha of .3 everywhere but in a tenth is nothing above a half."""
    pixels = np.full((256, 256, 4), 0.3, np.float32)
    pixels[:26, :, 3] = 0.9
    paint = Paint()
    node = paint.texture(image(pixels))
    cut = paint.node("Math", operation='GREATER_THAN')
    cut.inputs[1].default_value = 0.5
    paint.link(node.outputs["Alpha"], cut.inputs[0])
    paint.link(cut.outputs[0], paint.shader.inputs["Alpha"])
    assert look(paint)[2][0] == pytest.approx(26 / 256, abs=0.01)


@pytest.mark.parametrize("by", ["alpha", "lightness"])
def test_mix_with_transparent_covers_where_the_mask_is_light(by):
    paint, pixels = Paint(), _leaves(256)
    color, mask = image(pixels), image(pixels)
    if by == "lightness":
        mask = image(np.repeat(pixels[..., 3:], 3, axis=2), space="Non-Color")
    texture = paint.texture(color)
    other = texture if by == "alpha" else paint.node("TexImage", image=mask)
    mix, hole = paint.node("MixShader"), paint.node("BsdfTransparent")
    paint.link(other.outputs["Alpha" if by == "alpha" else "Color"], mix.inputs[0])
    paint.link(hole.outputs[0], mix.inputs[1])
    paint.link(paint.shader.outputs[0], mix.inputs[2])
    paint.link(mix.outputs[0], paint.output.inputs["Surface"])
    found, _, coverage, _ = look(paint)
    if by == "alpha":
        expected, alpha = _mean(pixels)
    else:
        expected, alpha = _mean_between_texels(pixels)
    assert coverage[0] == pytest.approx(alpha, abs=0.005)
    np.testing.assert_allclose(found[0], expected, rtol=0.01 if by == "alpha" else 0.05)  # a fringe of one texel


@pytest.mark.parametrize(
    ("kind", "first", "colors", "color", "transmission"),
    [
        ("MixShader", 1, ((0.1, 0.2, 0.1), (0.1, 0.2, 0.1)), (0.1, 0.2, 0.1), 0.5),
        ("AddShader", 0, ((0.3, 0.3, 0.3), (0.1, 0.1, 0.1)), (0.4, 0.4, 0.4), 0.25),
    ],
)
def test_translucent_parts_let_their_light_through(kind, first, colors, color, transmission):
    """Mixed by halves, or added."""
    paint = Paint()
    both, *sheets = (paint.node(name) for name in (kind, "BsdfDiffuse", "BsdfTranslucent"))
    for sheet, own, socket in zip(sheets, colors, both.inputs[first : first + 2], strict=True):
        sheet.inputs["Color"].default_value = (*own, 1)
        paint.link(sheet.outputs[0], socket)
    paint.link(both.outputs[0], paint.output.inputs["Surface"])
    found = look(paint)
    np.testing.assert_allclose(found[0][0], color, rtol=2e-3)
    assert (found[1][0], found[2][0]) == (pytest.approx(transmission, abs=1e-3), 1)


def _halves():
    """Left half red, right half green."""
    pixels = np.zeros((64, 64, 3), np.float32)
    pixels[:, :32, 0] = pixels[:, 32:, 1] = 1
    return image(pixels)


@pytest.mark.parametrize(
    ("extension", "place", "expected", "cover"),
    [
        ('REPEAT', 1.0, (1, 0, 0), 1),
        ('EXTEND', 1.0, (0, 1, 0), 1),
        ('MIRROR', 1.0, (0, 1, 0), 1),
        ('CLIP', 1.0, None, 0),
        ('REPEAT', -0.5, (0, 1, 0), 1),
    ],
)
def test_beside_the_image_its_extension_counts(extension, place, expected, cover):
    paint = Paint()
    paint.texture(_halves(), alpha=True, extension=extension)
    uv = [(place + 0.1 + 0.3 * u, 0.3 * v + 0.1) for u, v in SQUARE]
    color, _, coverage, _ = look(paint, [uv])
    assert coverage[0] == pytest.approx(cover, abs=1e-3)
    if expected:
        np.testing.assert_allclose(color[0], expected, atol=0.01)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"Location": (0.5, 0, 0)}, (0, 1, 0)),
        ({"Scale": (0.4, 1, 1)}, (1, 0, 0)),
        ({"Rotation": (0, 0, np.pi)}, (0, 1, 0)),
        ({"Scale": (2, 2, 1)}, (0.5, 0.5, 0)),
    ],
)
def test_mapping_moves_turns_and_scales(settings, expected):
    paint = Paint()
    texture = paint.texture(_halves())
    mapping, place = paint.node("Mapping"), paint.node("TexCoord")
    for key, value in settings.items():
        mapping.inputs[key].default_value = value
    paint.link(place.outputs["UV"], mapping.inputs["Vector"])
    paint.link(mapping.outputs[0], texture.inputs["Vector"])
    uv = [(0.49 * u if "Scale" not in settings else u, v) for u, v in SQUARE]
    color, *_ = look(paint, [uv])
    np.testing.assert_allclose(color[0], expected, atol=0.03)


def test_uv_map_node_chooses_its_map():
    paint = Paint()
    texture, node = paint.texture(_halves()), paint.node("UVMap", uv_map="Other")
    paint.link(node.outputs[0], texture.inputs["Vector"])
    obj = cards([paint.material], [[(0.4 * u, v) for u, v in SQUARE]])
    other = np.array([[(0.6 + 0.4 * u, v) for u, v in SQUARE]], np.float32)
    obj.data.uv_layers.new(name="Other").uv.foreach_set("vector", other.ravel())
    np.testing.assert_allclose(read(obj)[0].surfaces[0].color[0], (0, 1, 0), atol=1e-3)
    node.uv_map = ""
    np.testing.assert_allclose(read(obj)[0].surfaces[0].color[0], (1, 0, 0), atol=1e-3)
    obj.data.uv_layers["Other"].active_render = True
    np.testing.assert_allclose(read(obj)[0].surfaces[0].color[0], (0, 1, 0), atol=1e-3)


@pytest.mark.parametrize("domain", ['POINT', 'CORNER', 'FACE'])
@pytest.mark.parametrize("kind", ["VertexColor", "Attribute"])
def test_color_attributes_color_each_face(domain, kind):
    paint = Paint()
    node = paint.node(kind)
    setattr(node, "layer_name" if kind == "VertexColor" else "attribute_name", "dye")
    paint.link(node.outputs["Color"], paint.shader.inputs["Base Color"])
    obj = cards([paint.material], [SQUARE] * 3)
    dye = obj.data.attributes.new("dye", 'FLOAT_COLOR', domain)
    values = np.repeat(np.array([(0.1, 0.2, 0.3, 1), (0.4, 0.5, 0.6, 1), (0.7, 0, 0, 1)]), len(dye.data) // 3, axis=0)
    dye.data.foreach_set("color", values.astype(np.float32).ravel())
    found = read(obj)[0].surfaces[0].color
    np.testing.assert_allclose(found, [(0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0.7, 0, 0)], atol=1e-3)


def test_groups_are_entered_with_what_feeds_them():
    """The group holds the shader and a hole; color and alpha come from outside, or from the group's own inputs."""
    paint, pixels = Paint(), _leaves(128)
    tree = bpy.data.node_groups.new("leaf", "ShaderNodeTree")
    tree.interface.new_socket(name="Tint", in_out='INPUT', socket_type='NodeSocketColor')
    tree.interface.new_socket(name="Alpha", in_out='INPUT', socket_type='NodeSocketFloat')
    tree.interface.new_socket(name="Surface", in_out='OUTPUT', socket_type='NodeSocketShader')
    start, end, inner = (tree.nodes.new(k) for k in ("NodeGroupInput", "NodeGroupOutput", "ShaderNodeBsdfPrincipled"))
    tree.links.new(start.outputs["Tint"], inner.inputs["Base Color"])
    tree.links.new(start.outputs["Alpha"], inner.inputs["Alpha"])
    tree.links.new(inner.outputs[0], end.inputs["Surface"])
    group = paint.node("Group", node_tree=tree)
    paint.link(group.outputs[0], paint.output.inputs["Surface"])
    group.inputs["Tint"].default_value, group.inputs["Alpha"].default_value = (0.1, 0.2, 0.3, 1), 0.25
    color, _, coverage, _ = look(paint)
    np.testing.assert_allclose((*color[0], coverage[0]), (0.1, 0.2, 0.3, 0.25), atol=1e-3)
    texture = paint.node("TexImage", image=image(pixels))
    paint.link(texture.outputs["Color"], group.inputs["Tint"])
    paint.link(texture.outputs["Alpha"], group.inputs["Alpha"])
    color, _, coverage, _ = look(paint)
    expected, alpha = _mean(pixels)
    assert coverage[0] == pytest.approx(alpha, abs=0.005)
    np.testing.assert_allclose(color[0], expected, rtol=0.01)


def test_each_slot_has_its_own_look_and_none_is_gray():
    red, blue = Paint("red"), Paint("blue")
    red.shader.inputs["Base Color"].default_value = (0.5, 0, 0, 1)
    blue.texture(image(np.tile((0, 0, 0.5), (8, 8, 1)), space="Non-Color"))
    obj = cards([red.material, None, blue.material], [SQUARE] * 4, slots=[2, 1, 0, 2])
    surface = read(obj)[0].surfaces[0]
    expected = [(0, 0, 0.5), (0.8, 0.8, 0.8), (0.5, 0, 0), (0, 0, 0.5)]
    np.testing.assert_allclose(surface.color, expected, atol=0.003)


def test_missing_images_and_surfaces_are_told_and_have_the_viewport_color(tmp_path):
    lost, bare, empty = Paint("lost"), Paint("bare"), Paint("empty")
    gone = bpy.data.images.new("gone", 4, 4)
    gone.source, gone.filepath = 'FILE', str(tmp_path / "gone.png")
    lost.texture(gone, alpha=True)
    empty.texture(None)
    for link in list(bare.output.inputs["Surface"].links):
        bare.tree.links.remove(link)
    for paint in (lost, bare, empty):
        paint.material.diffuse_color = (0.1, 0.2, 0.3, 1)
        color, transmission, coverage, warnings = look(paint)
        np.testing.assert_allclose(color[0], (0.1, 0.2, 0.3), atol=1e-3)
        assert coverage[0] == 1
        assert np.isnan(transmission[0]) == (paint is bare)
        (warning,) = warnings
        assert f'"{paint.material.name}"' in warning


def test_what_only_a_renderer_knows_has_its_middle_and_is_told():
    paint, pixels = Paint("noisy"), _leaves(128)
    paint.texture(image(pixels), alpha=True)
    noise, mix = paint.node("TexNoise"), paint.node("MixRGB")
    texture = next(n for n in paint.tree.nodes if n.type == 'TEX_IMAGE')
    paint.link(noise.outputs["Color"], mix.inputs["Color1"])
    paint.link(texture.outputs["Color"], mix.inputs["Color2"])
    paint.link(mix.outputs[0], paint.shader.inputs["Base Color"])
    color, _, coverage, (warning,) = look(paint, QUARTERS)
    assert "Bake" in warning
    assert '"noisy"' in warning
    assert np.ptp(color, axis=0).max() > 0.01  # the image that is mixed in keeps its pattern
    # What is understood counts all the same.
    assert coverage[0] == pytest.approx(_mean(pixels[:64, :64])[1], abs=0.01)


def test_sampling_equal_faces_once_changes_nothing():
    """A card among thousands of its kind looks as it does alone."""
    paint = Paint()
    paint.texture(image(_leaves(256)), alpha=True)
    alone = look(paint, QUARTERS, name="alone")
    many = look(paint, QUARTERS * 500, name="many")
    for one, all_ in zip(alone[:3], many[:3], strict=True):
        assert (all_.reshape(500, 4, -1) == one.reshape(1, 4, -1)).all()


def test_small_faces_of_a_large_mesh_add_up_to_the_image():
    """40,000 faces with 25 texels each."""
    paint, pixels, n = Paint(), _leaves(), 200
    paint.texture(image(pixels), alpha=True)
    x, y = (a.ravel() / n for a in np.meshgrid(np.arange(n), np.arange(n)))
    uvs = np.stack([x, y], axis=1)[:, None] + np.array(SQUARE) / n
    color, _, coverage, _ = look(paint, uvs)
    expected, alpha = _mean(pixels)
    assert coverage.mean() == pytest.approx(alpha, abs=0.001)
    np.testing.assert_allclose((color * coverage[:, None]).sum(axis=0) / coverage.sum(), expected, rtol=0.005)
    cells = pixels[:1000, :1000, 3]  # each face shows about five texels across
    shown = cells.reshape(n, 5, n, 5).mean(axis=(1, 3)).ravel()
    assert np.corrcoef(shown, coverage)[0, 1] > 0.5


def test_very_wide_images_are_read_at_half_their_size():
    """Wider than what is kept, with rows that are no power of two."""
    pixels = np.zeros((90, 5000, 4), np.float32)
    pixels[..., 0] = np.linspace(0, 1, 5000)
    pixels[:45, :, 3] = 1
    paint = Paint()
    paint.texture(image(pixels, space="Non-Color"), alpha=True)
    color, _, coverage, _ = look(paint, QUARTERS)
    np.testing.assert_allclose(coverage, [1, 1, 0, 0], atol=0.03)  # half a texel of 23
    np.testing.assert_allclose(color[:2, 0], [0.25, 0.75], rtol=0.01)


def test_pixels_of_floating_point_images_are_associated_with_their_alpha():
    picture = image(np.tile((0.2, 0.1, 0.4, 0.5), (8, 8, 1)), float_buffer=True, space="Non-Color")
    paint = Paint()
    paint.texture(picture, alpha=True)
    color, _, coverage, _ = look(paint)
    np.testing.assert_allclose((*color[0], coverage[0]), (0.4, 0.2, 0.8, 0.5), rtol=2e-3)


def test_tiled_images_are_told():
    paint = Paint()
    paint.texture(bpy.data.images.new("tiles", 16, 16, tiled=True))
    (warning,) = look(paint)[3]
    assert '"tiles"' in warning


def test_two_images_meet_texel_by_texel():
    """Stripes of one image hide those of another: means of each would not show it."""
    stripes = np.zeros((512, 512, 3), np.float32)
    stripes[:, np.arange(512) % 32 < 16] = (1, 0.5, 0.25)
    mask = np.zeros((512, 512, 3), np.float32)
    mask[:, np.arange(512) % 32 < 16] = 1
    paint = Paint()
    paint.texture(image(stripes, space="Non-Color"))
    other = paint.node("TexImage", image=image(mask, space="Non-Color"))
    paint.link(other.outputs["Color"], paint.shader.inputs["Alpha"])
    color, _, coverage, _ = look(paint)
    assert coverage[0] == pytest.approx(0.5, abs=0.01)
    np.testing.assert_allclose(color[0], (1, 0.5, 0.25), rtol=0.03)


def test_faces_without_area_and_coordinates_that_are_no_numbers_are_borne():
    paint = Paint()
    paint.texture(image(np.full((8, 8, 3), 0.5), space="Non-Color"), alpha=True)
    obj = cards([paint.material], [SQUARE] * 3)
    for vertex in range(4, 8):
        obj.data.vertices[vertex].co = (0, 0, 0)
    obj.data.uv_layers[0].uv[9].vector = (np.nan, np.inf)
    surface = read(obj)[0].surfaces[0]
    np.testing.assert_allclose(surface.color, 0.5, atol=0.003)
    np.testing.assert_allclose(surface.coverage, 1)


def test_looks_are_those_without_snow():
    paint = Paint()
    paint.shader.inputs["Base Color"].default_value = (0.1, 0.3, 0.05, 1.0)
    before, mean = look(paint), Looks().of(paint.material, {})
    assert add_snow(paint.material)
    for with_snow, without in zip(look(paint)[:3], before[:3], strict=True):
        np.testing.assert_array_equal(with_snow, without)
    assert Looks().of(paint.material, {}) == mean
