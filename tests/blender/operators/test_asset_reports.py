# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist is told of assets: the report of Refine, statistics, hints of panels, and what renders warn of."""

from __future__ import annotations

import json
from types import SimpleNamespace

import bpy
import pytest

from devtools.layouts import Layout
from panels import outputs, refine
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph
from tetflora_addon.blender.assets import marks
from tetflora_addon.blender.compat import shader_tree
from tetflora_addon.blender.job import render
from tetflora_addon.blender.scene.objects import has_contents, has_plants

pytestmark = pytest.mark.usefixtures("clean_file")


def scene():
    return bpy.context.scene


@pytest.fixture
def scatter():
    """Four instances of a square on the corners of another one, before a camera."""
    add_camera(location=(0.0, -20.0, 2.0))
    ground, child = add_mesh("ground", size=4.0), add_mesh("child")
    child.parent, ground.instance_type = ground, 'VERTS'
    ground.tetflora.is_scatter = True
    scene().render.resolution_percentage = 5
    return ground


def test_instances_are_counted_and_said_to_stay_where_that_is_cheapest(scatter, capfd):
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    out = capfd.readouterr().out
    assert "4 instances of assets stay the originals, as the renderer draws these at the least cost" in out
    assert "plant" not in out
    text = scene().tetflora.statistics
    assert outputs.made_of(text) == "4 instances stay the originals"
    rows = dict(outputs.rows_of(text))
    assert (rows["Instances"], rows["    Originals"], rows["    Clusters"]) == ("4", "4", "0")


def test_refined_instances_are_counted_beside_plants(scatter, capfd):
    scene().tetflora.asset_detail = 'REFINE'
    add_plant(species="bush")
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    figures = json.loads(scene().tetflora.statistics)
    whole, clusters = figures["instances_whole"], figures["instances_clusters"]
    out = capfd.readouterr().out
    assert "1 plant and 4 instances of assets: " in out
    assert f"{whole} original" in out and f"{clusters} cluster" in out


def test_statistics_of_plants_alone_say_nothing_of_instances(capfd):
    add_camera(location=(0.0, -20.0, 2.0))
    add_plant(species="bush")
    scene().render.resolution_percentage = 5
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    text = scene().tetflora.statistics
    assert "Instances" not in dict(outputs.rows_of(text))
    figures = json.loads(text)
    made = figures["polygons_meshed"] + figures["polygons_proxy"]
    assert made > figures["polygons_meshed"]
    assert f"1 plant: {made:,} polygons instead of {figures['polygons_full']:,} in " in capfd.readouterr().out


def test_reports_count_polygons_as_the_panel_does(scatter, capfd):
    scene().tetflora.asset_detail = 'REFINE'
    add_plant(species="bush")
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    figures = json.loads(scene().tetflora.statistics)
    assert f", {figures['polygons_meshed'] + figures['polygons_proxy']:,} polygons in " in capfd.readouterr().out


def test_what_is_wrong_with_an_asset_is_told_by_refine_and_by_renders(scatter, capfd):
    bare = bpy.data.materials.new("bare")
    tree = shader_tree(bare)
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    bpy.data.objects["child"].data.materials.append(bare)
    scene().tetflora.asset_detail = 'REFINE'
    text = 'arning: Material "bare" has no surface shader; its viewport color stands for it.'
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    assert text in capfd.readouterr().out
    bare.diffuse_color = (0.1, 0.2, 0.3, 1.0)  # else the asset would be known, and was told of
    render.on_render_init(scene())
    render.on_render_pre(scene())
    render.on_render_end(scene())
    assert capfd.readouterr().err.count(text) == 1
    assert bpy.ops.tetflora.refine() == {'FINISHED'}
    assert "bare" not in capfd.readouterr().out


def test_only_plants_are_missed_in_renders_of_what_is_not_refined(scatter, monkeypatch):
    """What objects scatter shows without; plants of an asset do not."""
    warned = []
    monkeypatch.setattr(render, "_warn", lambda text, about: warned.append("shows no plants" in text))
    settings = scene().tetflora
    settings.refine_at_render = False
    for expected in ("", "Not refined: renders show no plants"):
        assert has_contents(scene()) and has_plants(scene()) == bool(expected)
        assert refine.hint(scene()) == expected
        render.on_render_init(scene())
        render.on_render_pre(scene())
        render.on_render_end(scene())
        assert warned == [True] * bool(expected)
        add_plant(species=marks.use_as_species(scene(), depsgraph(), bpy.data.objects["child"]).identifier)


def test_the_panel_shows_the_settings_of_assets():
    layout = Layout()
    outputs.TETFLORA_PT_render.draw(SimpleNamespace(layout=layout), bpy.context)
    assert "asset_detail" in layout.names("prop", 1)
