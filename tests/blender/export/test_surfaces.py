# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures of exported leaves show all that polygons do, and relief as deep as it is on them."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from tetflora_addon.blender.attributes import image_pixels
from tetflora_addon.blender.export.surfaces import baked, with_surfaces
from tetflora_addon.blender.results.leaf_objects import materials_of
from tetflora_addon.blender.species.edits import species_for
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.buffers import MeshBuffers
from tetflora_addon.export.forest import BakedSurface, Variant
from tetflora_addon.export.images import MARGIN
from tetflora_addon.export.levels import PlantLevel

pytestmark = pytest.mark.usefixtures("clean_file")
MIDDLE = slice(2 * MARGIN, -2 * MARGIN)


def triangle(*corners: tuple[float, float], meters: float = 0.01) -> MeshBuffers:
    """A leaf of one triangle, so many meters to a unit of its texture coordinates."""
    uv, ring = np.array(corners, np.float32), np.arange(3, dtype=np.int32)
    attributes = {"tf_color": ("FACE", np.full((1, 3), 0.2, np.float32)), "UVMap": ("CORNER", uv)}
    attributes["tf_transmission"] = "FACE", np.full(1, 0.4, np.float32)
    positions = np.pad(uv * np.float32(meters), ((0, 0), (0, 1)))
    return MeshBuffers(positions, np.stack([ring, np.roll(ring, -1)], axis=1), ring, ring, np.int32([0, 3]), attributes)


def exported(folder: Path, species: str, bake: bool, *leaves: MeshBuffers) -> BakedSurface:
    levels = tuple(PlantLevel((("leaf", leaf),), float(number)) for number, leaf in enumerate(leaves))
    given = bpy.context.scene, [Variant("one", species, levels, 1.0, {})], folder, "textures", bake
    (variant,) = run_to_end(with_surfaces(*given))
    return variant.surfaces["leaf"]


def test_leaves_of_no_level_are_cut_off(blender, tmp_path):
    halves = triangle((0, 0), (1, 0), (0, 1)), triangle((1, 1), (0, 1), (1, 0))
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
    leaf = triangle((0, 0), (1, 0), (0, 1), meters=meters)
    assert exported(tmp_path, "birch", True, leaf).textures.keys() == expected


def test_relief_is_as_deep_in_any_part_of_a_leaf(blender):
    material = materials_of(bpy.context.scene, species_for(bpy.context.scene, "birch"), "leaf", 0)[0]
    slopes = []
    for width in (1.0, 0.25):
        given = np.zeros(2), np.array([width, 1.0]), 0.05
        found = 2.0 * baked(material, np.full(3, 0.2), 0.4, 64, *given)["normal"] - 1.0
        slopes.append(np.median(np.abs((found[..., 0] / found[..., 2])[:, : round(16 / width)])))
    assert slopes[1] == pytest.approx(slopes[0], rel=0.2)
