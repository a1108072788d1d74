# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's side of the cache folder: where it is, switching it off, emptying it."""

from __future__ import annotations

import pytest

from devtools import session
from tests.blender.scenes import add_camera, add_plant, depsgraph, part

pytestmark = pytest.mark.usefixtures("clean_file")


@pytest.fixture
def cache():
    """The engine's module; afterwards it uses the folder that it used before."""
    module = session.part("tetflora_addon.cache_folder")
    before = module.used()
    yield module
    own = part("preferences").preferences()
    own.use_cache, own.cache_folder = True, ""
    module.use(before)


def test_it_lies_where_blender_keeps_what_belongs_to_the_extension(cache, monkeypatch):
    import bpy

    own = part("preferences").preferences()
    own.cache_folder = ""
    assert cache.used().is_relative_to(bpy.utils.user_resource('EXTENSIONS'))
    assert not cache.used().exists()
    own.use_cache = False
    assert cache.used() is None
    assert not bpy.ops.tetflora.clear_cache.poll()


def test_the_environment_has_the_first_word(cache, monkeypatch, tmp_path):
    own = part("preferences").preferences()
    monkeypatch.setenv("TETFLORA_CACHE", str(tmp_path / "shared"))
    own.use_cache = False
    assert cache.used() == tmp_path / "shared"
    monkeypatch.setenv("TETFLORA_CACHE", "OFF")
    own.use_cache = True
    assert cache.used() is None
    monkeypatch.setenv("TETFLORA_CACHE", "")
    own.cache_folder = str(tmp_path / "mine")
    assert cache.used() == tmp_path / "mine"


def test_an_edited_species_is_looked_at_once(cache, tmp_path, monkeypatch):
    import bpy

    part("preferences").preferences().cache_folder = str(tmp_path / "cache")
    scene = bpy.context.scene
    add_camera(location=(0.0, -8.0, 2.0))
    add_plant("fern", "fern")
    scene.render.resolution_x = scene.render.resolution_y = 32
    editor = scene.tetflora.species_editor
    editor.species, editor.order = "fern", "0"
    editor.length = 0.05
    job, shares = part("job"), session.part("tetflora_addon.shading.facet_shares")
    monkeypatch.setattr(shares, "_found", {})
    job.refine(scene, depsgraph())
    (kept,) = (tmp_path / "cache").iterdir()
    (tmp_path / "cache" / "notes.txt").write_text("mine")

    monkeypatch.setattr(shares, "_found", {})
    shares._shares.cache_clear()
    monkeypatch.setattr(shares, "fitted_shares", lambda *_: pytest.fail("looked at again"))
    job.refine(scene, depsgraph())
    assert bpy.ops.tetflora.clear_cache() == {'FINISHED'}
    assert [p.name for p in (tmp_path / "cache").iterdir()] == ["notes.txt"]
    assert not kept.exists()
