# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Thumbnails of species in menus, and the catalog as an asset library."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest

from devtools import session
from tests.blender.scenes import add_camera, add_plant, datablocks, depsgraph, select
from tetflora_addon.blender import preferences, saved_files
from tetflora_addon.blender.job import contents
from tetflora_addon.blender.placing import assets
from tetflora_addon.blender.settings import SEASONS
from tetflora_addon.blender.species import catalog
from tetflora_addon.blender.species.catalog import FALLBACK_ICON, icon_of, items_for, thumbnail_file
from tetflora_addon.species.catalog import builtin_folder, list_species

pytestmark = pytest.mark.usefixtures("clean_file", "thumbnails_looked_for")


@pytest.fixture
def own_folder(tmp_path):
    own = bpy.context.preferences.addons[preferences.ROOT_PACKAGE].preferences
    folder = tmp_path / "species"
    (folder / "thumbnails").mkdir(parents=True)
    own.species_folder = str(folder)
    yield folder
    own.species_folder = ""


def _shipped():
    return list_species()


def test_thumbnails_are_small_squares_of_known_species():
    folder = builtin_folder() / "thumbnails"
    thumbnails = sorted(folder.glob("*"))
    assert {p.stem.partition(".")[0] for p in thumbnails} <= set(_shipped())
    assert {p.stem.partition(".")[2] for p in thumbnails} <= {"", *SEASONS}
    assert len(thumbnails) >= 3
    for path in thumbnails:
        assert path.suffix == ".png"
        assert path.stat().st_size <= 30_000
        image = bpy.data.images.load(str(path))
        assert tuple(image.size) == (128, 128)
        pixels = np.zeros(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        colors = pixels.reshape(-1, 4)[:, :3]
        plant = np.abs(colors - colors[-1]).max(axis=1) > 0.1  # the upper right corner is behind the plant
        assert 0.01 < plant.mean() < 0.9, path.name
        bpy.data.images.remove(image)


def _loaded(identifier):
    """Names of the thumbnails that Blender has loaded for a species; their icons have numbers only in a window."""
    icon_of(identifier)
    return [name for name in catalog.thumbnails.loaded if Path(name.partition("|")[0]).stem == identifier]


def test_a_species_without_a_picture_gets_an_icon(own_folder):
    shutil.copy(_shipped()["bush"].path, own_folder / "mine.json")
    assert [_loaded(identifier) for identifier in ("mine", "", "gone")] == [[], [], []]
    mine = next(i for i in items_for() if i[0] == "mine")
    assert mine[3] == FALLBACK_ICON


def test_a_picture_is_loaded_once_and_again_when_it_changes(own_folder):
    thumbnail = own_folder / "thumbnails" / "mine.png"
    shutil.copy(thumbnail_file("bush"), thumbnail)
    assert thumbnail_file("mine") == thumbnail
    (first,) = _loaded("mine")
    assert tuple(catalog.thumbnails.loaded[first].image_size) == (128, 128)
    assert _loaded("mine") == [first]
    os.utime(thumbnail, ns=(0, 0))
    assert set(_loaded("mine")) > {first}
    assert _loaded("bush")


def test_a_season_has_a_picture_of_its_own_where_there_is_one(own_folder):
    for name in ("mine.png", "mine.autumn.png"):
        shutil.copy(thumbnail_file("bush"), own_folder / "thumbnails" / name)
    year = bpy.context.scene.tetflora.year
    names = {}
    for season in ('SUMMER', 'AUTUMN', 'WINTER'):
        bpy.context.scene.tetflora.year.season = season
        catalog.thumbnails.loaded.clear()
        icon_of("mine")
        names[season] = [Path(name.partition("|")[0]).name for name in catalog.thumbnails.loaded]
    assert names == {'SUMMER': ["mine.png"], 'AUTUMN': ["mine.autumn.png"], 'WINTER': ["mine.png"]}
    year.enabled = False
    assert thumbnail_file("mine", "autumn").name == "mine.autumn.png"


def test_the_library_holds_a_plant_of_each_species(tmp_path):
    add_plant("Bush", "conifer", seed=5)  # has the name of an asset
    before = datablocks()
    assert bpy.ops.tetflora.create_asset_library(directory=str(tmp_path / "lib")) == {'FINISHED'}
    assert datablocks() == before
    path = tmp_path / "lib" / assets.FILE
    with bpy.data.libraries.load(str(path), assets_only=True) as (there, _here):
        names = list(there.objects)
    assert sorted(names) == sorted(info.name for info in _shipped().values())
    assert "TetFlora" in (tmp_path / "lib" / "blender_assets.cats.txt").read_text(encoding="utf-8")
    bpy.ops.tetflora.create_asset_library(directory=str(tmp_path / "lib"))  # over the first one
    catalogs = (tmp_path / "lib" / "blender_assets.cats.txt").read_text(encoding="utf-8")
    assert catalogs.count(":TetFlora:") == 1


def test_an_asset_becomes_a_working_plant(tmp_path):
    path, _ = assets.write_asset_library(tmp_path)
    session.clean_file()
    scene = bpy.context.scene
    add_camera()
    assert not scene.render.use_lock_interface
    bpy.ops.wm.append(directory=f"{path}/Object/", filename="Bush")
    (plant,) = (o for o in scene.objects if o.tetflora.is_plant)
    assert (plant.tetflora.species, plant.tetflora.seed, plant.tetflora.enabled) == ("bush", 1, True)
    assert plant.tetflora.version == saved_files.VERSION
    assert scene.render.use_lock_interface
    assert "tetflora_temporary" not in plant
    assert contents.estimate(scene, depsgraph()).polygons_full > 1000
    select(plant)
    bpy.ops.tetflora.reseed()
    assert plant.tetflora.seed != 1


def test_assets_have_picture_and_tags(tmp_path):
    path, _ = assets.write_asset_library(tmp_path)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    bush = next(o for o in bpy.data.objects if o.tetflora.species == "bush")
    assert {"plant", "TetFlora", "bush"} == {t.name for t in bush.asset_data.tags}
    assert bush.asset_data.description == _shipped()["bush"].description
    assert tuple(bush.preview.image_size) == (128, 128)
    pixels = np.zeros(4 * 128 * 128, np.float32)
    bush.preview.image_pixels_float.foreach_get(pixels)
    assert pixels[1::4].max() > 0.1


def test_preferences_change_only_when_asked(tmp_path):
    libraries = bpy.context.preferences.filepaths.asset_libraries
    before = len(libraries)
    bpy.ops.tetflora.create_asset_library(directory=str(tmp_path))
    assert len(libraries) == before
    try:
        for _ in range(2):
            bpy.ops.tetflora.create_asset_library(directory=str(tmp_path), add_library=True)
        assert len(libraries) == before + 1
    finally:
        while len(libraries) > before:
            libraries.remove(libraries[len(libraries) - 1])


def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    before = datablocks()
    with pytest.raises(RuntimeError, match="Cannot write the asset library"):
        bpy.ops.tetflora.create_asset_library(directory=str(tmp_path / "file"))
    assert datablocks() == before


def test_a_file_of_catalogs_that_is_no_text_is_said_and_stays(tmp_path):
    catalogs = tmp_path / "blender_assets.cats.txt"
    catalogs.write_bytes(b"VERSION 1\n# Geh\xf6lze\n")
    before = datablocks()
    with pytest.raises(RuntimeError, match=r"blender_assets.cats.txt is not a UTF-8 text file"):
        bpy.ops.tetflora.create_asset_library(directory=str(tmp_path))
    assert datablocks() == before
    assert catalogs.read_bytes() == b"VERSION 1\n# Geh\xf6lze\n"
