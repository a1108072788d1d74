# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist links from a file with saved results stays as it is, whatever becomes of the results of this file."""

from __future__ import annotations

import bpy
import pytest

from devtools import session
from tests.blender.scenes import add_camera, add_plant, depsgraph, tiny_render
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.materials import materials
from tetflora_addon.blender.results import collection


def refined(seed):
    """A scene with one plant and its results; their collection."""
    scene = tiny_render(size=48)
    add_plant("bush", seed=seed)
    add_camera(location=(0.0, -6.0, 1.5))
    refine.refine(scene, depsgraph())
    bpy.context.view_layer.update()
    return collection.result_collections(scene, 'VIEW')[0]


def save(path):
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    session.clean_file()
    return str(path)


@pytest.mark.parametrize("overridden", [False, True], ids=["linked", "overridden"])
def test_results_of_another_file_are_not_results_of_this(clean_file, tmp_path, overridden):
    bpy.context.scene.tetflora.output.save_results = True
    name = refined(seed=3).name
    path = save(tmp_path / "forest.blend")
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.collections = [name]
    linked, scene = wanted.collections[0], bpy.context.scene
    scene.collection.children.link(linked)
    if overridden:
        linked = linked.override_hierarchy_create(scene, bpy.context.view_layer, do_fully_editable=True)
    held = {obj.session_uid for obj in linked.objects}
    assert held and not collection.result_collections(scene) and not collection.has_results(scene)

    own = refined(seed=4)
    assert own.library is None and own.objects
    assert all(obj.parent.library is None and obj.parent.override_library is None for obj in own.objects if obj.parent)
    scene.tetflora.output.show_render = False
    assert own.hide_render and not linked.hide_render

    refine.clear(scene)
    assert not collection.result_collections(scene)
    assert {obj.session_uid for obj in linked.objects} == held
    assert linked in scene.collection.children_recursive


def test_an_outdated_material_of_another_file_keeps_its_name(clean_file, tmp_path):
    old = materials.proxy_material()
    name, old["tetflora_version"], old.use_fake_user = old.name, 1, True
    path = save(tmp_path / "old.blend")
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.materials = [name]
    linked = wanted.materials[0]
    made = materials.proxy_material()
    assert made != linked and made.library is None and made["tetflora_version"] != 1
    assert materials.proxy_material() == made
    assert linked.name == name and linked["tetflora_version"] == 1
