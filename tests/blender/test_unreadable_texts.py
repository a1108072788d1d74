# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A .blend whose texts are not UTF-8, at which Python raises an error: they are empty after loading, all else works."""

from __future__ import annotations

import json

import bpy
import pytest

from tests.blender.scenes import add_camera, add_mesh, add_plant, select
from tetflora_addon.blender.placing import populations
from tetflora_addon.blender.species import catalog, edits

pytestmark = pytest.mark.usefixtures("clean_file")

MARK, JUNK = "QQQQ", b"\xff\xfe\x1b\x80"


def test_texts_that_are_no_text_are_emptied_and_told(tmp_path, capfd):
    scene = bpy.context.scene
    add_camera()
    add_plant("plant", species="bush" + MARK)
    field, ground = add_mesh("field"), add_mesh("ground", size=10.0)
    field.tetflora.is_field = True
    field.tetflora.field_species.add().species = MARK
    population = populations.add_population(scene, [ground], name="name" + MARK)
    population.uv_layer = population.erased = MARK
    entry = population.mix.add()
    entry.species = entry.companion = MARK
    sound = json.dumps(edits.species_data(None, "oak"))
    for identifier, text in ((MARK, sound), ("oak", sound.replace("Oak", MARK)), ("../secret", sound)):
        edit = scene.tetflora.species_edits.add()
        edit.identifier, edit.text = identifier, text
    scene.tetflora.species_editor.species = scene.tetflora.statistics = MARK
    scene.tetflora.wind.loop = 7
    path = tmp_path / "a.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    path.write_bytes(path.read_bytes().replace(MARK.encode(), JUNK))
    capfd.readouterr()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    said = capfd.readouterr().err
    assert "11 texts of this file are not UTF-8 and are empty now" in said
    assert "'../secret' cannot name a species" in said
    assert "Traceback" not in said
    group = bpy.context.scene.tetflora
    population = group.layers[0]
    assert (population.name, population.uv_layer, population.erased, population.mix[0].companion) == ("",) * 4
    assert group.wind.loop == 7
    assert len(population.uid) == 32
    assert "oak" in edits.catalog()
    assert catalog.items_for(bpy.data.objects["plant"].tetflora.species)
    with pytest.raises(RuntimeError, match='"plant", "field": unknown species ""'):
        bpy.ops.tetflora.refine()
    select(bpy.data.objects["ground"])
    bpy.data.objects.remove(bpy.data.objects["field"])
    bpy.data.objects["plant"].tetflora.species = population.mix[0].species = "bush"
    bpy.ops.tetflora.update_layers(which='ACTIVE')
