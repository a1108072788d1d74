# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials return no more light than they get, look alike at a distance, and leave the artist's work alone."""

import numpy as np
import pytest

from devtools import session
from tests.blender.renders import picture, small_scene

pytestmark = pytest.mark.usefixtures("clean_file")


def materials():
    return session.part("tetflora_addon.blender.materials")


def tools():
    return session.part("tetflora_addon.blender.node_tools")


def sheet(colour, transmission, material):
    """A square of 8 m across the view, facing up."""
    import bpy

    buffers = session.part("tetflora_addon.buffers").MeshBuffers(
        np.array([[-4, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0]], dtype=np.float32),
        np.array([[0, 1], [1, 2], [2, 3], [3, 0]], dtype=np.int32),
        np.arange(4, dtype=np.int32),
        np.arange(4, dtype=np.int32),
        np.array([0, 4], dtype=np.int32),
        {
            "tf_colour": ("FACE", np.array([colour], dtype=np.float32)),
            "tf_transmission": ("FACE", np.array([transmission], dtype=np.float32)),
        },
    )
    mesh = session.part("tetflora_addon.blender.meshes").write_mesh("sheet", buffers, [material])
    made = bpy.data.objects.new("sheet", mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


@pytest.mark.parametrize("transmission", [0.0, 0.4, 1.0])
def test_a_white_leaf_in_a_white_world_returns_what_it_gets(transmission):
    small_scene(sky=1.0, samples=64)
    sheet((1.0, 1.0, 1.0), transmission, materials().leaf_material("Oak"))
    seen = picture().mean(axis=(0, 1))
    tint = np.minimum(materials().THROUGH_TINT[:3], 1.0)
    gloss = materials().GLOSS
    wanted = (1.0 - gloss) * ((1.0 - transmission) + transmission * tint) + gloss
    np.testing.assert_allclose(seen, wanted, atol=0.01)
    assert (seen <= 1.002).all()


def test_a_leaf_lit_from_behind_shows_its_transmission_only():
    """The sun from below, S = π W/m²: radiance is colour times tint times share, times what gloss leaves."""
    small_scene(sky=0.0, samples=16, sun=180.0)
    sheet((0.2, 0.4, 0.1), 0.5, materials().leaf_material("Oak"))
    tint = np.array(materials().THROUGH_TINT[:3])
    wanted = np.array([0.2, 0.4, 0.1]) * tint * 0.5 * (1.0 - materials().GLOSS)
    np.testing.assert_allclose(picture().mean(axis=(0, 1)), wanted, rtol=0.01)


def test_bark_lets_no_light_through():
    small_scene(sky=0.0, samples=16, sun=180.0)
    sheet((0.3, 0.2, 0.1), 0.0, materials().bark_material("Oak"))
    assert picture().max() == 0.0


def test_microsurfaces_match_leaves_and_bark():
    """From afar all that is left of bark is its mean; within the noise's own spread of the mean."""
    colour = (0.3, 0.2, 0.1)
    seen = {}
    for name, transmission in (("leaf", 0.4), ("bark", 0.0)):
        for kind in (name, "proxy"):
            session.clean_file()
            small_scene(sky=0.5, samples=64, sun=30.0)
            made = materials().proxy_material() if kind == "proxy" else getattr(materials(), f"{name}_material")("Oak")
            sheet(colour, transmission, made)
            seen[name, kind] = picture().mean(axis=(0, 1))
    np.testing.assert_allclose(seen["leaf", "proxy"], seen["leaf", "leaf"], rtol=1e-5)
    np.testing.assert_allclose(seen["bark", "proxy"], seen["bark", "bark"], rtol=0.06)


def test_names_and_marks():
    made = [
        materials().leaf_material("Oak"),
        materials().bark_material("Oak"),
        materials().proxy_material(),
        materials().shell_material(),
        materials().scatter_group(),
    ]
    names = ["TetFlora Oak leaf", "TetFlora Oak bark", "TetFlora proxy", "TetFlora shell", "TetFlora Scatter"]
    assert [m.name for m in made] == names
    assert all(tools().is_ours(m) for m in made)
    assert materials().leaf_material("Oak") == made[0]


def test_an_edited_material_stays_as_it_is():
    made = materials().leaf_material("Oak")
    made.node_tree.nodes.clear()
    assert materials().leaf_material("Oak") == made
    assert len(made.node_tree.nodes) == 0


def test_copies_and_renamed_materials_are_the_artists():
    made = materials().leaf_material("Oak")
    copy = made.copy()
    assert not tools().is_ours(copy)
    made.name = "My oak"
    assert not tools().is_ours(made)
    assert materials().leaf_material("Oak") != made


def test_an_outdated_material_is_kept_beside_the_new_one():
    old = materials().leaf_material("Oak")
    old[tools().VERSION] = 0
    new = materials().leaf_material("Oak")
    assert new != old
    assert new.name == "TetFlora Oak leaf"
    assert old.name == "TetFlora Oak leaf (version 0)"
    assert not tools().is_ours(old)


def test_a_material_that_the_artist_made_under_our_name_is_used():
    import bpy

    theirs = bpy.data.materials.new("TetFlora Oak bark")
    assert materials().bark_material("Oak") == theirs
    assert not tools().is_ours(theirs)


def test_every_link_is_valid_and_every_species_shares_the_group():
    import bpy

    for made in (materials().leaf_material("Oak"), materials().bark_material("Fir"), materials().proxy_material()):
        groups = [n.node_tree for n in made.node_tree.nodes if n.bl_idname == "ShaderNodeGroup"]
        assert groups == [bpy.data.node_groups["TetFlora Scatter"]]
        assert all(link.is_valid for link in made.node_tree.links)
    assert len([g for g in bpy.data.node_groups if g.name.startswith("TetFlora Scatter")]) == 1
