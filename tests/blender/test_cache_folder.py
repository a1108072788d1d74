# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's side of the cache folder: where it is, switching it off, emptying it."""

from __future__ import annotations

import bpy
import pytest

from tests.blender.scenes import add_camera, add_plant, depsgraph
from tetflora_addon import storage
from tetflora_addon.blender import preferences
from tetflora_addon.blender.job import refine
from tetflora_addon.proxies import facet_weights

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def cache():
    """The engine's module; afterward it uses the folder that it used before."""
    before = storage.current_folder()
    yield storage
    own = preferences.preferences()
    own.use_cache, own.cache_folder = True, ""
    storage.set_folder(before)


def test_it_lies_where_blender_keeps_what_belongs_to_the_extension(cache, monkeypatch):
    own = preferences.preferences()
    own.cache_folder = ""
    assert cache.current_folder().is_relative_to(bpy.utils.user_resource('EXTENSIONS'))
    assert not cache.current_folder().exists()
    own.use_cache = False
    assert cache.current_folder() is None
    assert bpy.ops.tetflora.delete_file(cache=True) == {'CANCELLED'}


def test_the_environment_has_the_first_word(cache, monkeypatch, tmp_path):
    own = preferences.preferences()
    monkeypatch.setenv("TETFLORA_CACHE", str(tmp_path / "shared"))
    own.use_cache = False
    assert cache.current_folder() == tmp_path / "shared"
    monkeypatch.setenv("TETFLORA_CACHE", "OFF")
    own.use_cache = True
    assert cache.current_folder() is None
    monkeypatch.setenv("TETFLORA_CACHE", "")
    own.cache_folder = str(tmp_path / "mine")
    assert cache.current_folder() == tmp_path / "mine"


def test_an_edited_species_is_looked_at_once(cache, tmp_path, monkeypatch):
    preferences.preferences().cache_folder = str(tmp_path / "cache")
    scene = bpy.context.scene
    add_camera(location=(0.0, -8.0, 2.0))
    add_plant("fern", "fern")
    scene.render.resolution_x = scene.render.resolution_y = 32
    editor = scene.tetflora.species_editor
    editor.species, editor.order = "fern", "0"
    editor.length[0] = 0.05
    monkeypatch.setattr(facet_weights, "_measured", {})
    refine.refine(scene, depsgraph())
    (kept,) = (tmp_path / "cache").iterdir()
    (tmp_path / "cache" / "notes.txt").write_text("mine")

    monkeypatch.setattr(facet_weights, "_measured", {})
    facet_weights._of_states.cache_clear()
    monkeypatch.setattr(facet_weights, "fitting", lambda *_: pytest.fail("looked at again"))
    refine.refine(scene, depsgraph())
    assert bpy.ops.tetflora.delete_file(cache=True) == {'FINISHED'}
    assert [p.name for p in (tmp_path / "cache").iterdir()] == ["notes.txt"]
    assert not kept.exists()
