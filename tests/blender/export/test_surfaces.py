# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures of exported leaves show all that polygons do, and relief as deep as it is on them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from PIL import Image

from tests.blender.scenes import add_mesh
from tetflora_addon.blender.attributes import image_pixels, linear_rgb
from tetflora_addon.blender.export.surfaces import _baked, with_surfaces
from tetflora_addon.blender.materials.nodes import Graph, surface_material, untag
from tetflora_addon.blender.results.leaf_objects import materials_of
from tetflora_addon.blender.species.edits import species_for
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.buffers import MeshBuffers, concatenate_buffers
from tetflora_addon.export.forest import BakedSurface, Variant
from tetflora_addon.export.images import MARGIN
from tetflora_addon.export.levels import PlantLevel

pytestmark = [pytest.mark.usefixtures("clean_file"), pytest.mark.fine]
MIDDLE = slice(2 * MARGIN, -2 * MARGIN)
SQUARE = (0, 0), (1, 0), (1, 1), (0, 1)


def leaf(*corners: tuple[float, float], meters: float = 0.01) -> MeshBuffers:
    """A leaf of one polygon, so many meters to a unit of its texture coordinates."""
    uv, ring = np.array(corners, np.float32), np.arange(len(corners), dtype=np.int32)
    attributes = {"tf_color": ("FACE", np.full((1, 3), 0.2, np.float32)), "UVMap": ("CORNER", uv)}
    attributes["tf_transmission"] = "FACE", np.full(1, 0.4, np.float32)
    positions = np.pad(uv * np.float32(meters), ((0, 0), (0, 1)))
    return MeshBuffers(
        positions, np.stack([ring, np.roll(ring, -1)], axis=1), ring, ring, np.int32([0, len(ring)]), attributes
    )


def exported(folder: Path, species: str, bake: bool, *leaves: MeshBuffers) -> BakedSurface:
    return variant_of(folder, species, bake, *leaves).surfaces["leaf"]


def variant_of(folder: Path, species: str, bake: bool, *leaves: MeshBuffers) -> Variant:
    levels = tuple(PlantLevel((("leaf", mesh),), float(number)) for number, mesh in enumerate(leaves))
    given = bpy.context.scene, [Variant("one", species, levels, 1.0, {})], folder, "textures", bake
    (variant,) = run_to_end(with_surfaces(*given))
    return variant


def own_leaf(pixels: np.ndarray, *others: bpy.types.Material) -> bpy.types.Material:
    """A leaf of the artist's for bushes, whose material has an image's color and alpha."""
    image = bpy.data.images.new("leaf", pixels.shape[1], pixels.shape[0], alpha=True)
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
    material = surface_material("my card", 1, lambda graph, _material: _shaded(graph, image))
    untag(material)
    obj = add_mesh("card")
    for one in (material, *others):
        obj.data.materials.append(one)
    entry = bpy.context.scene.tetflora.leaf_objects.add()
    entry.species, entry.leaf = "bush", obj
    return material


def _shaded(graph: Graph, image: bpy.types.Image) -> None:
    texel = graph.outputs("ShaderNodeTexImage", image=image)
    shader = graph.node("ShaderNodeBsdfPrincipled", {"Base Color": texel["Color"], "Alpha": texel["Alpha"]})
    graph.node("ShaderNodeOutputMaterial", {"Surface": shader})


def half_painted() -> np.ndarray:
    """Texels (64, 64, 4), sRGB: the left half is a leaf, the right one transparent in another color."""
    pixels = np.zeros((64, 64, 4), np.float32)
    pixels[:, :32], pixels[:, 32:] = (0.3, 0.7, 0.2, 1.0), (0.9, 0.0, 0.9, 0.0)
    return pixels


def test_cards_of_the_artist_keep_their_colors_and_alpha(blender, tmp_path):
    """Near ones are cut. Far ones are smaller: textures show their mean, by which they would vanish."""
    material = own_leaf(half_painted())
    before = material.node_tree.nodes[:]
    card = leaf(*SQUARE)
    variant = variant_of(tmp_path, "bush", True, card, card)
    assert material.node_tree.nodes[:] == before
    assert [one.name for one in bpy.data.materials if one.name.startswith("my card")] == ["my card"]
    (near_kind, near), (far_kind, far) = (level.parts[0] for level in variant.levels)
    wide, narrow = (np.ptp(mesh.positions, axis=0)[0] for mesh in (near, far))
    assert narrow == pytest.approx(np.sqrt(0.5) * wide, rel=0.05)
    cut, whole = (variant.surfaces[kind] for kind in (near_kind, far_kind))
    assert (cut.cut, whole.cut) == (pytest.approx(0.25, rel=0.1), 0.0)
    assert (cut.problems, set(whole.textures)) == ((), {"color"})
    cell = np.asarray(Image.open(tmp_path / cut.textures["card"]))[::-1][:256, :256] / 255.0
    assert (cell[MIDDLE, 20:120, 3].min(), cell[MIDDLE, 136:236, 3].max()) == (1.0, 0.0)
    colors = cell[MIDDLE, :, :3]  # beneath alpha too, which renderers mix in at the edge
    np.testing.assert_allclose(colors, np.broadcast_to([0.3, 0.7, 0.2], colors.shape), atol=0.04)


def test_what_cannot_be_baked_of_a_material_is_named(blender, tmp_path):
    own_leaf(0.3 * half_painted(), bpy.data.materials.new("stalk"))
    surface = exported(tmp_path, "bush", False, leaf(*SQUARE))
    assert surface.cut == 0.0
    several, clear = surface.problems
    assert several == 'bush_leaf has several materials; "my card" stands for all'
    assert clear == 'Material "my card" is transparent everywhere; its leaves are opaque in the file'


def test_trunks_are_as_dark_near_the_ground_as_their_bark(blender, tmp_path):
    """Textures repeat what is further up. A birch is black at its foot."""
    strips = [leaf((0, low), (1, low), (1, low + 1), (0, low + 1), meters=1.0) for low in (0.0, 10.0)]
    bark = concatenate_buffers(strips)
    bark = replace(bark, attributes={**bark.attributes, "tf_girth": ("FACE", np.full(2, 1.0, np.float32))})
    levels = (PlantLevel((("bark", bark),), 0.0),)
    given = bpy.context.scene, [Variant("one", "birch", levels, 1.0, {})], tmp_path, "textures", True
    (variant,) = run_to_end(with_surfaces(*given))
    texture = bpy.data.images.load(str(tmp_path / variant.surfaces["bark"].textures["color"]))
    pixels = linear_rgb(texture, image_pixels(texture))
    u = variant.levels[0].parts[0][1].attributes["UVMap"][1][::4, 0]
    low, high = (pixels[:, int(4 * of) * 256 : int(4 * of + 1) * 256].mean() for of in u)
    assert low < 0.6 * high


def test_leaves_of_no_level_are_cut_off(blender, tmp_path):
    halves = leaf((0, 0), (1, 0), (0, 1)), leaf((1, 1), (0, 1), (1, 0))
    surface = exported(tmp_path, "bush", False, *halves)
    for half, name in enumerate(("bush_leaf_opacity.png", "bush_leaf_opacity_half.png")):
        image = bpy.data.images.load(str(tmp_path / "textures" / name))
        shown = image_pixels(image)[: 256 >> half, : 256 >> half, 0]
        assert (shown[MIDDLE, MIDDLE] == 1.0).all()
        assert (shown[[0, -1]] == 0.0).all()
    color = bpy.data.images.load(str(tmp_path / surface.textures["color"]))
    assert color.depth == 24  # without alpha, which EEVEE multiplies colors by
    assert surface.textures.keys() == {"color"}


@pytest.mark.parametrize(("meters", "expected"), [(0.05, {"color", "normal"}), (2.0, {"color"})])
def test_what_has_no_relief_has_no_texture_for_it(blender, tmp_path, meters, expected):
    """Leaves of coarse levels are large and nearly flat."""
    flat = leaf((0, 0), (1, 0), (0, 1), meters=meters)
    assert exported(tmp_path, "birch", True, flat).textures.keys() == expected


def test_relief_is_as_deep_in_any_part_of_a_leaf(blender):
    material = materials_of(bpy.context.scene, species_for(bpy.context.scene, "birch"), "leaf", 0)[0]
    slopes = []
    for width in (1.0, 0.25):
        given = np.zeros(2), np.array([width, 1.0]), 0.05
        found = 2.0 * _baked(material, np.full(3, 0.2), 0.4, 64, *given)["normal"] - 1.0
        slopes.append(np.median(np.abs((found[..., 0] / found[..., 2])[:, : round(16 / width)])))
    assert slopes[1] == pytest.approx(slopes[0], rel=0.2)
