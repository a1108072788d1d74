# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species while a film is rendered: files are looked at once a frame, and whatever changes in them is noticed."""

from __future__ import annotations

import json

import pytest

from tests.blender.scenes import add_camera, add_plant, depsgraph, part


@pytest.fixture
def scene(clean_file, tmp_path):
    """Two plants of a species, and an empty folder for species of the user's own."""
    import bpy

    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 32, 18
    add_camera()
    add_plant("one")
    add_plant("two", species="fern", location=(1.0, 0.0, 0.0))
    depsgraph()
    preferences = bpy.context.preferences.addons[part("preferences").ROOT_PACKAGE].preferences
    preferences.species_folder = str(tmp_path)
    yield scene
    part("handlers").on_render_end(scene)
    preferences.species_folder = ""
    part("species_edits").look_again()


def prepared(scene):
    """Names of what the frame is rendered with."""
    part("handlers").on_render_pre(scene)
    assert part("handlers").render_errors() == []
    (collection,) = part("emit").result_collections(scene, 'RENDER')
    return {obj.name for obj in collection.objects}


def test_files_are_looked_at_once_a_frame_and_as_ever_between_frames(scene, monkeypatch):
    edits, looks = part("species_edits"), []
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
    shipped = part("species_edits").species_data(scene, "bush")
    first = prepared(scene)
    assert prepared(scene) == first
    for name in ("Mine", "Ours"):  # a file that comes, and one that changes
        (tmp_path / "bush.json").write_text(json.dumps({**shipped, "name": name}))
        assert any(name in found for found in prepared(scene))
    (tmp_path / "bush.json").unlink()
    assert prepared(scene) == first


def test_a_frame_that_fails_leaves_looking_as_it_was(scene, monkeypatch):
    scene.camera = None
    part("handlers").on_render_pre(scene)
    assert len(part("handlers").render_errors()) == 1
    assert part("species_edits")._looking
