# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of exported forests, as programs read them that share no code with what writes them."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pygltflib
import pytest
import trimesh
from PIL import Image

from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.errors import TetFloraError
from tetflora_addon.export.forest import (
    BakedSurface,
    Forest,
    ForestPart,
    Variant,
    identifiers,
    leaf_roughness,
    written_whole,
)
from tetflora_addon.export.gltf import write_gltf
from tetflora_addon.export.images import TEXELS, Palette, atlas, halved, in_atlas, outline, palette_of, png, tiled
from tetflora_addon.export.levels import levels_of
from tetflora_addon.export.obj import write_obj
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.optics import FACING
from tetflora_addon.species.catalog import load_species

NUMBER = 7


@pytest.fixture(scope="module")
def forest() -> Forest:
    """Some plants of one variant, far from the origin, turned about an oblique axis."""
    levels = levels_of(compile_species([load_species("bush")]), Seeds.upright(1), 3)
    looks = {part: BakedSurface(f"bush_{part}", (0.1, 0.2, 0.05)) for part, _ in levels[0].parts}
    rng, each = np.random.default_rng(2), np.zeros(NUMBER, np.int32)
    turn = rng.normal(size=(NUMBER, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    place = rng.uniform(-9, 9, (NUMBER, 3)).astype(np.float32)
    ones, seed = np.ones(NUMBER, np.float32), np.array([1, -5, 2**40, 3, 2**62, 7, 8])
    given = turn.astype(np.float32), 2 * ones, each, each, seed, 3 * ones, 4 * ones, {}, np.eye(4)
    part = ForestPart("Wäldchen", (("bush", ""),), np.array([1000.0, -50.0, 2.0]), place, *given)
    return Forest((Variant("bush_1", "bush", levels, 2.2, looks),), (part,))


def values(read: pygltflib.GLTF2, index: int) -> np.ndarray:
    """An accessor of floats."""
    accessor = read.accessors[index]
    view, width = read.bufferViews[accessor.bufferView], {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor.type]
    content = read.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    return np.frombuffer(content, np.float32).reshape(-1, width)


def test_gltf_has_all_places_and_levels(forest, tmp_path):
    path = tmp_path / "f.glb"
    list(write_gltf(path, forest))
    assert [p.name for p in tmp_path.iterdir()] == ["f.glb"]
    read = pygltflib.GLTF2().load(str(path))
    # Polygons have the outlines of leaves, and twigs are sheets, too.
    assert {(m.alphaMode, m.doubleSided) for m in read.materials} == {("OPAQUE", True)}
    assert set(read.extensionsUsed) == {"EXT_mesh_gpu_instancing", "KHR_materials_ior", "MSFT_lod"}
    (root,) = read.scenes[0].nodes
    node, part = read.nodes[root], forest.parts[0]
    assert node.extensions["MSFT_lod"]["ids"] == [1, 2]
    assert len(node.extras["MSFT_screencoverage"]) == 3
    given = node.extensions["EXT_mesh_gpu_instancing"]["attributes"]
    place = values(read, given["TRANSLATION"])
    world = part.origin + part.position
    np.testing.assert_allclose(place, np.column_stack([world[:, 0], world[:, 2], -world[:, 1]]), rtol=1e-6)
    quarters = values(read, given["_SEED"]).astype(np.int64)
    np.testing.assert_array_equal((quarters << (16 * np.arange(4))).sum(axis=1), part.seed)
    np.testing.assert_array_equal(values(read, given["SCALE"]), np.full((NUMBER, 3), 2.0))
    for name, value in (("_SPECIES", 0.0), ("_AGE", 3.0), ("_HEIGHT", 4.0)):
        np.testing.assert_array_equal(values(read, given[name]), np.full((NUMBER, 1), value))
    # A rotation about an axis that is turned like all points is the same rotation.
    swap = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    for (x, y, z, w), (a, b, c, d) in zip(values(read, given["ROTATION"]), part.rotation, strict=True):
        one = trimesh.transformations.quaternion_matrix((w, x, y, z))[:3, :3]
        other = trimesh.transformations.quaternion_matrix((a, b, c, d))[:3, :3]
        np.testing.assert_allclose(one, swap @ other @ swap.T, atol=1e-6)


def test_gltf_has_roughness_as_a_number_or_a_texture(forest, tmp_path):
    (tmp_path / "rough.png").write_bytes(png(np.full((2, 2, 3), 0.3, np.float32), linear=True))
    (variant,) = forest.variants
    rough = replace(variant.surfaces["leaf"], textures={"roughness": "rough.png"}, gloss=0.02)
    given = replace(variant, surfaces={**variant.surfaces, "leaf": rough})
    list(write_gltf(tmp_path / "f.glb", replace(forest, variants=(given,))))
    materials = {m.name: m for m in pygltflib.GLTF2().load(str(tmp_path / "f.glb")).materials}
    assert materials["bush_leaf"].extensions["KHR_materials_ior"]["ior"] == pytest.approx(rough.index) != 1.0
    found = {name: m.pbrMetallicRoughness for name, m in materials.items()}
    assert found["bush_bark"].metallicRoughnessTexture is None
    assert found["bush_bark"].roughnessFactor == rough.roughness
    assert found["bush_leaf"].metallicRoughnessTexture is not None
    assert (found["bush_leaf"].roughnessFactor, found["bush_leaf"].metallicFactor) == (1.0, 0.0)


def test_rough_surfaces_mirror_as_much_by_a_larger_index():
    smooth, rough = (BakedSurface("leaf", (0.1, 0.2, 0.05), gloss=0.02, roughness=r).index for r in (0.0, 0.5))
    assert 1.0 < smooth < 1.1
    assert rough == pytest.approx(1.2)
    assert BakedSurface("bark", (0.1, 0.1, 0.1), roughness=0.9).index == 1.0


@pytest.mark.parametrize("gloss", [0.01, 0.02, 0.04])
def test_leaves_mirror_as_much_facing_the_eye_by_their_roughness(gloss):
    leaf = BakedSurface("leaf", (0.1, 0.2, 0.05), gloss=gloss, roughness=leaf_roughness(gloss))
    assert ((leaf.index - 1.0) / (leaf.index + 1.0)) ** 2 == pytest.approx(FACING * gloss, rel=0.05)


def test_gltf_has_the_surface_of_each_level(forest, tmp_path):
    list(write_gltf(tmp_path / "f.glb", forest))
    read = trimesh.load_scene(tmp_path / "f.glb")
    for number, level in enumerate(forest.variants[0].levels):
        own = [mesh for name, mesh in read.geometry.items() if name.startswith(f"bush_1_LOD{number}")]
        assert len(own) == len(level.parts)
        every = np.concatenate([mesh.positions for _, mesh in level.parts])
        low, high = (np.array(f([m.bounds for m in own], axis=0)) for f in (np.min, np.max))
        np.testing.assert_allclose(low[0], [every[:, 0].min(), every[:, 2].min(), -every[:, 1].max()], atol=1e-4)
        np.testing.assert_allclose(high[1], [every[:, 0].max(), every[:, 2].max(), -every[:, 1].min()], atol=1e-4)
        assert sum(len(mesh.faces) for mesh in own) >= level.polygons


def test_obj_has_each_level_and_a_table_of_places(forest, tmp_path):
    list(write_obj(tmp_path / "f.obj", forest))
    read = trimesh.load_scene(tmp_path / "f.obj", split_object=True, group_material=False)
    polygons = sum(level.polygons for level in forest.variants[0].levels)
    assert sum(len(mesh.faces) for mesh in read.geometry.values()) >= polygons
    head, *rows = (tmp_path / "f.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == NUMBER
    first = dict(zip(head.split(","), rows[1].split(","), strict=True))
    assert (first["variant"], first["species"], first["seed"], first["scale"]) == ("bush_1", "bush", "-5", "2")
    assert float(first["x"]) == pytest.approx(1000.0 + forest.parts[0].position[1, 0])
    assert "newmtl bush_leaf" in (tmp_path / "f.mtl").read_text()


def test_leaves_find_their_color_in_the_atlas(forest):
    level = forest.variants[0].levels[0]
    leaf = next(mesh for part, mesh in level.parts if part == "leaf")
    palette = palette_of([leaf], False)
    shown = outline(palette, leaf)
    assert 0.2 < shown.mean() < 0.9
    texels = atlas(palette, np.ones((TEXELS, TEXELS, 3), np.float32))
    placed = next(mesh for part, mesh in in_atlas(level, {"leaf": palette}).parts if part == "leaf")
    uv, color = placed.attributes["UVMap"][1], leaf.attributes["tf_color"][1]
    first = placed.face_offsets[:-1]
    middle = np.add.reduceat(uv, first) / np.diff(placed.face_offsets)[:, None]
    at = (middle * len(texels)).astype(int)
    found = texels[at[:, 1], at[:, 0]]
    assert shown[at[:, 1] % TEXELS, at[:, 0] % TEXELS].mean() > 0.99
    assert np.abs(found - color).max() < 0.05
    np.testing.assert_allclose(found.mean(axis=0), color.mean(axis=0), rtol=0.01)


def test_cells_of_an_atlas_have_their_colors_and_the_detail_of_one_leaf():
    palette = Palette(np.arange(24, dtype=np.float32).reshape(8, 3), np.zeros(2), np.ones(2), (4, 2))
    detail = np.random.default_rng(0).random((TEXELS, TEXELS, 3), np.float32)
    texels = atlas(palette, detail)
    assert texels.shape == (2 * TEXELS, 4 * TEXELS, 3)
    for cell, color in enumerate(palette.colors):
        y, x = (TEXELS * of for of in divmod(cell, 4))
        np.testing.assert_array_equal(texels[y : y + TEXELS, x : x + TEXELS], color * detail)


@pytest.mark.parametrize("channels", [3, 4])
def test_png_files_hold_what_was_given(channels):
    texels = np.random.default_rng(0).random((6, 10, channels), np.float32)
    for linear in (True, False):
        read = np.asarray(Image.open(io.BytesIO(png(texels, linear))))[::-1] / 255.0
        if not linear:
            color = read[..., :3]
            read[..., :3] = np.where(color > 0.04045, ((color + 0.055) / 1.055) ** 2.4, color / 12.92)
        np.testing.assert_allclose(read, texels, atol=0.01)


def test_smaller_textures_keep_colors_and_tiles_have_no_seam():
    texels = np.random.default_rng(0).random((6, 4, 3), np.float32)
    np.testing.assert_allclose(halved(texels)[1, 0], texels[2:4, :2].mean(axis=(0, 1)), rtol=1e-6)
    ramp = np.tile(np.linspace(0.0, 1.0, 64, dtype=np.float32)[:, None, None], (1, 4, 3))
    steps = np.abs(np.diff(np.concatenate([tiled(ramp)] * 2), axis=0))
    assert steps.max() < 0.1 < np.abs(np.diff(np.concatenate([ramp] * 2), axis=0)).max()


def test_names_are_plain_and_all_different():
    assert identifiers(["Birke 1", "Birke_1", "木", "", "9a"]) == ["Birke_1", "Birke_1_2", "plant", "plant_2", "_9a"]


def test_nothing_is_left_of_what_went_wrong(tmp_path):
    path = tmp_path / "f.glb"
    path.write_text("earlier")
    with pytest.raises(RuntimeError, match="broken"), written_whole(path) as folder:
        (folder / "f.glb").write_text("half")
        raise RuntimeError("broken")
    assert (path.read_text(), len(list(tmp_path.iterdir()))) == ("earlier", 1)
    with written_whole(path) as folder:
        (folder / "f_textures").mkdir()
        (folder / "f_textures" / "a.png").write_text("picture")
        (folder / "f.glb").write_text("whole")
    assert (path.read_text(), (tmp_path / "f_textures" / "a.png").read_text()) == ("whole", "picture")
    assert len(list(tmp_path.iterdir())) == 2
    with pytest.raises(TetFloraError, match="is a folder; add a file name"), written_whole(tmp_path):
        pass


def test_a_folder_that_cannot_be_written_is_named(tmp_path, monkeypatch):
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.mkdir", refuse)
    told = pytest.raises(TetFloraError, match=r"Permission denied\. Choose another folder")
    with told, written_whole(tmp_path / "f.glb"):
        pass
