# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species while an animation is rendered: files are looked at once a frame, and whatever changes in them is noticed."""

from __future__ import annotations

import json

import bpy
import pytest

from tests.blender.scenes import add_camera, add_plant, depsgraph
from tetflora_addon.blender import preferences
from tetflora_addon.blender.job import render
from tetflora_addon.blender.results.output import result_collections
from tetflora_addon.blender.species import edits


@pytest.fixture
def scene(clean_file, tmp_path):
    """Two plants of a species, and an empty folder for species of the user's own."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 32, 18
    add_camera()
    add_plant("one")
    add_plant("two", species="fern", location=(1.0, 0.0, 0.0))
    depsgraph()
    own = bpy.context.preferences.addons[preferences.ROOT_PACKAGE].preferences
    own.species_folder = str(tmp_path)
    yield scene
    render.on_render_end(scene)
    own.species_folder = ""
    edits.look_again()


def prepared(scene):
    """Names of what the frame is rendered with."""
    render.on_render_pre(scene)
    assert render.render_errors() == []
    (collection,) = result_collections(scene, 'RENDER')
    return {obj.name for obj in collection.objects}


def test_files_are_looked_at_once_a_frame_and_as_ever_between_frames(scene, monkeypatch):
    looks = []
    real = edits.list_species
    monkeypatch.setattr(edits, "list_species", lambda folders: looks.append(1) or real(folders))
    for _ in range(2):
        prepared(scene)
        assert len(looks) == 1
        looks.clear()
    for _ in range(2):  # in the background
        edits.listed()
    assert len(looks) == 2


def test_species_files_that_change_between_frames_are_noticed(scene, tmp_path):
    shipped = edits.species_data(scene, "bush")
    first = prepared(scene)
    assert prepared(scene) == first
    for name in ("Mine", "Ours"):  # a file that comes, and one that changes
        (tmp_path / "bush.json").write_text(json.dumps({**shipped, "name": name}))
        assert any(name in found for found in prepared(scene))
    (tmp_path / "bush.json").unlink()
    assert prepared(scene) == first


def test_a_frame_that_fails_leaves_looking_as_it_was(scene, monkeypatch):
    scene.camera = None
    render.on_render_pre(scene)
    assert len(render.render_errors()) == 1
    assert edits._looking
