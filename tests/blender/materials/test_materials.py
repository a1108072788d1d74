# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials return no more light than they get, look alike at a distance, and leave the artist's work alone."""

import bpy
import numpy as np
import pytest

from devtools import session
from tests.blender.renders import picture, small_scene
from tetflora_addon import buffers, errors
from tetflora_addon.blender import compat
from tetflora_addon.blender.materials import bark, materials, microsphere, nodes
from tetflora_addon.blender.results import meshes
from tetflora_addon.species import species

pytestmark = [pytest.mark.usefixtures("clean_file"), pytest.mark.fine]

#: How light linear red, green and blue are.
LIGHT = np.array([0.2126, 0.7152, 0.0722])


def tube(radius, color, material, turns=0, start=2):
    """A branch along x, seven perimeters long, in the middle of the view; u starts at `turns`, v at `start`."""
    sides, rings = 16, 8
    step, angle = np.arange(rings + 1) / rings, 2 * np.pi * np.arange(sides) / sides
    length = 7 * 2 * np.pi * radius
    ring = np.stack([np.zeros(sides), radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    along = np.stack([length * (step - 0.5), 0 * step, 0 * step], axis=1)
    i, k = (a.ravel() for a in np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij"))
    corners = np.stack([i * sides + k, i * sides + (k + 1) % sides], axis=1)
    corners = np.concatenate([corners, corners[:, ::-1] + sides], axis=1)
    u, v = np.stack([k, k + 1, k + 1, k], axis=1) / sides + turns, np.stack([i, i, i + 1, i + 1], axis=1)
    v = start + 7 * v / rings
    pairs = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, edge_of_corner = np.unique(pairs, axis=0, return_inverse=True)
    polygons = buffers.MeshBuffers(
        (along[:, None] + ring).reshape(-1, 3).astype(np.float32),
        edges.astype(np.int32),
        corners.reshape(-1).astype(np.int32),
        edge_of_corner.reshape(-1).astype(np.int32),
        np.arange(0, 4 * len(corners) + 1, 4, dtype=np.int32),
        {
            "UVMap": ("CORNER", np.stack([u, v], axis=2).reshape(-1, 2).astype(np.float32)),
            "tf_color": ("FACE", np.tile(np.float32(color), (len(corners), 1))),
            "tf_transmission": ("FACE", np.zeros(len(corners), np.float32)),
            "tf_girth": ("FACE", np.full(len(corners), 2 * np.pi * radius, np.float32)),
        },
        smooth=True,
    )
    return added("tube", polygons, material)


def bark_seen(character, radius, engine="CYCLES", turns=0, color=(0.4, 0.3, 0.2), start=2, material=None):
    """Picture of the middle half of a branch, five perimeters of it, under an even sky of 1; no moss on such a one."""
    session.clean_file()
    engine = compat.eevee_engine() if engine == "EEVEE" else engine
    small_scene(sky=1.0, samples=16, size=96, engine=engine, width=4 * 2 * np.pi * radius)
    tube(radius, color, material() if material else materials.bark_material("Oak", character), turns, start)
    seen = picture()
    tall = len(seen)
    reach = int(0.8 * tall / (8 * np.pi))  # from the axis, of the radius
    return seen[tall // 2 - reach : tall // 2 + reach]


def sheet(color, transmission, material):
    """A square of 8 m across the view, facing up; the leaf's length is that of the view."""
    corners = np.array([[-4, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0]], dtype=np.float32)
    polygons = buffers.MeshBuffers(
        corners,
        np.array([[0, 1], [1, 2], [2, 3], [3, 0]], dtype=np.int32),
        np.arange(4, dtype=np.int32),
        np.arange(4, dtype=np.int32),
        np.array([0, 4], dtype=np.int32),
        {
            "UVMap": ("CORNER", corners[:, :2] / 2 + np.float32(0.5)),
            "tf_color": ("FACE", np.array([color], dtype=np.float32)),
            "tf_transmission": ("FACE", np.array([transmission], dtype=np.float32)),
        },
    )
    return added("sheet", polygons, material)


def added(name, buffers, material):
    mesh = meshes.write_mesh(name, buffers, [material])
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


@pytest.mark.parametrize("transmission", [0.0, 0.4, 1.0])
def test_leaves_return_what_they_are_said_to_on_the_mean_of_both_sides(transmission):
    small_scene(sky=1.0, samples=64, size=32)
    made = sheet((0.5, 0.4, 0.6), transmission, materials.leaf_material("Oak"))
    upper = picture().mean(axis=(0, 1))
    made.rotation_euler = (0.0, np.pi, 0.0)
    lower = picture().mean(axis=(0, 1))
    tint, gloss = np.array(microsphere.THROUGH_TINT[:3]), materials.GLOSS
    wanted = (1.0 - gloss) * np.array([0.5, 0.4, 0.6]) * ((1.0 - transmission) + transmission * tint) + gloss
    np.testing.assert_allclose((upper + lower) / 2, wanted, atol=0.01)
    if transmission < 1.0:
        assert (lower > 1.03 * upper).all()


@pytest.mark.parametrize("transmission", [0.0, 0.4, 1.0])
def test_a_white_leaf_in_a_white_world_returns_no_more_than_it_gets(transmission):
    small_scene(sky=1.0, samples=64)
    sheet((1.0, 1.0, 1.0), transmission, materials.leaf_material("Oak"))
    seen = picture()
    assert (seen.mean(axis=(0, 1)) <= 1.002).all()
    assert (seen <= 1.02).all()


def test_a_leaf_lit_from_behind_shows_its_transmission_only():
    """The sun from below, S = π W/m²: radiance is color times tint times share, times what gloss leaves."""
    small_scene(sky=0.0, samples=64, sun=180.0, size=32)
    sheet((0.2, 0.4, 0.1), 0.5, materials.leaf_material("Oak"))
    tint = np.array(microsphere.THROUGH_TINT[:3])
    wanted = np.array([0.2, 0.4, 0.1]) * tint * 0.5 * (1.0 - materials.GLOSS)
    seen = picture()
    np.testing.assert_allclose(seen.mean(axis=(0, 1)), wanted, rtol=0.01)
    assert np.ptp(seen[..., 1]) > 0.05 * wanted[1], "no veins"


def test_needles_have_no_veins():
    small_scene(sky=0.0, samples=64, sun=180.0, size=32)
    sheet((0.2, 0.4, 0.1), 0.12, materials.leaf_material("Pine", "needle"))
    seen = picture()
    assert np.ptp(seen[..., 1]) < 0.25 * seen[..., 1].mean(), "more than mottling"


@pytest.mark.parametrize(
    ("character", "engine"), [*((character, "CYCLES") for character in species.BARKS), ("ridged", "EEVEE")]
)
def test_bark_keeps_the_mean_color(character, engine):
    """Proxies have the flat color; 4 % is what eyes pass over. High up a pine is orange, but as light."""
    color = np.array((0.2, 0.15, 0.1))  # as light as bark is
    seen = bark_seen(character, 0.05 if character == "jointed" else 0.4, engine, color=color)
    if character == "papery":
        np.testing.assert_allclose(seen.mean(axis=(0, 1)) @ LIGHT, color @ LIGHT, rtol=0.04)
    else:
        np.testing.assert_allclose(seen.mean(axis=(0, 1)), color, rtol=0.04)
    assert seen.std(axis=(0, 1))[0] > 0.005, "no pattern"


def flat_bark(character, **inputs):
    """A material that gives off what bark reflects, whatever the light."""

    def build(graph, _material):
        group = bark.bark_group(character)
        given = {"Color": graph.attribute("tf_color", "Color"), **inputs}
        looks = graph.node("ShaderNodeGroup", given, node_tree=group)
        shine = graph.node("ShaderNodeEmission", {"Color": looks.outputs["Color"], "Strength": 1.0})
        graph.node("ShaderNodeOutputMaterial", {"Surface": shine})

    return nodes.surface_material("flat bark", 1, build)


@pytest.mark.parametrize("radius", [0.15, 0.4])
@pytest.mark.parametrize("character", species.BARKS)
def test_mean_albedo_of_bark_is_the_color_of_its_proxies(character, radius):
    """Moss too is as light as what it covers: within .01, at the foot, but for black ones of birches, and above it."""
    wanted = np.array([0.3, 0.24, 0.18])
    for start in (2,) if character in ("peeling", "pitted") else (-1, 2):
        seen = bark_seen(character, radius, color=wanted, start=start, material=lambda: flat_bark(character))
        mean = seen.mean(axis=(0, 1))
        assert mean @ LIGHT == pytest.approx(wanted @ LIGHT, abs=0.01)
        if start > 0 and character != "papery":
            np.testing.assert_allclose(mean, wanted, atol=0.01)


def test_papery_bark_is_orange_high_up_and_on_limbs_as_their_color_says():
    def red(radius, start):
        seen = bark_seen("papery", radius, start=start, material=lambda: flat_bark("papery")).mean(axis=(0, 1))
        return seen[0] / seen[1]

    assert red(0.4, 5) > 1.3 * red(0.4, -4)
    assert red(0.05, -4) == pytest.approx(4 / 3, rel=0.03)


def knots():
    """A material that shines with 1 in the eyes of large knots, with .25 where ridges give way to them."""

    def build(graph, _material):
        place = graph.outputs("ShaderNodeGroup", node_tree=bark._place_group())["Place"]
        where = bark.Place(place, None, None, None, None, None, None)
        eye = bark._knot(graph, where, 0.8, graph.xyz(0.5, 0.5, 0.5))
        seen = bark.lips(graph, eye)[1] + graph.vector('LENGTH', bark.aside(graph, eye, 1.0)) * 0.25
        graph.node("ShaderNodeOutputMaterial", {"Surface": graph.node("ShaderNodeEmission", {"Color": seen})})

    return nodes.surface_material("knots", 1, build)


def test_knots_are_sparse_and_ridges_give_way_around_them():
    seen = np.stack([bark_seen("ridged", 0.4, color=(c, 0.3, 0.2), material=knots)[..., 0] for c in (0.1, 0.2, 0.3)])
    eyes, around = seen > 0.6, (seen > 0.05) & (seen < 0.6)
    assert 0.002 < eyes.mean() < 0.1
    assert 2 * eyes.mean() < around.mean() < 0.9


def test_moss_grows_low_on_thick_wood_and_not_on_thin():
    def green(radius, start):
        seen = bark_seen("ridged", radius, start=start, material=lambda: flat_bark("ridged")).mean(axis=(0, 1))
        return seen[1] / seen[0]

    assert green(0.4, -4) > 1.1 * green(0.4, 3)
    assert green(0.04, -4) == pytest.approx(green(0.04, 3), rel=0.05)


def test_features_are_as_many_as_the_root_of_the_girth():
    """A limb of a quarter of the bole's radius has half as many plates around, so they are half as wide."""

    def seen(radius, scale):
        inputs = {"Scale": scale, "Lichen": 0.0, "Moss": 0.0, "Full Over": 0.1, "Smooth Under": 0.0}
        return bark_seen("plated", radius, material=lambda: flat_bark("plated", **inputs))

    np.testing.assert_allclose(seen(0.4, 4.0), seen(0.1, 8.0), atol=0.05)
    assert np.abs(seen(0.4, 4.0) - seen(0.1, 4.0)).mean() > 0.02


def test_young_twigs_are_smooth():
    """But for the few pixels where a ray slips past so thin a tube, seen from 50 m."""
    flat = (np.abs(bark_seen("ridged", 0.01) - (0.4, 0.3, 0.2)) < 1e-3).all(axis=2)
    assert flat.mean() > 0.9
    trunk = (np.abs(bark_seen("ridged", 0.4) - (0.4, 0.3, 0.2)) < 1e-3).all(axis=2)
    assert trunk.mean() < 0.1


def test_bark_has_no_seam():
    """Where u goes over from 1 to 0, as where it goes on to 1 and further; rounding moves fine features a little."""
    np.testing.assert_allclose(bark_seen("plated", 0.4, turns=1), bark_seen("plated", 0.4), atol=0.02)


def test_branches_of_other_colors_have_other_patterns():
    one, other = (bark_seen("ridged", 0.4, color=np.full(3, c))[..., 0] for c in (0.3, 0.36))
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.5


def test_another_bark_is_another_material_and_the_old_one_is_kept():
    old = materials.bark_material("Oak", "ridged")
    new = materials.bark_material("Oak", "banded")
    assert new != old
    assert new.name == "TetFlora Oak bark"
    assert materials.bark_material("Oak", "banded") == new


def test_a_bark_that_is_not_there_is_named():
    with pytest.raises(errors.SpeciesError, match='"wooly"; choose one of ridged'):
        materials.bark_material("Oak", "wooly")


def test_bark_lets_no_light_through():
    small_scene(sky=0.0, samples=16, sun=180.0)
    sheet((0.3, 0.2, 0.1), 0.0, materials.bark_material("Oak"))
    assert picture().max() == 0.0


def test_microsurfaces_match_leaves_and_bark():
    """From afar all that is left of bark is its mean; so small a piece of it is a tenth off. Leaves have two sides."""
    color = (0.3, 0.2, 0.1)
    seen = {}
    for name, transmission in (("leaf", 0.4), ("bark", 0.0)):
        for kind in (name, "proxy"):
            session.clean_file()
            small_scene(sky=0.5, samples=64, sun=30.0)
            made = materials.proxy_material() if kind == "proxy" else getattr(materials, f"{name}_material")("Oak")
            flat = sheet(color, transmission, made)
            sides = [picture().mean(axis=(0, 1))]
            flat.rotation_euler = (0.0, np.pi, 0.0)
            seen[name, kind] = np.mean([*sides, picture().mean(axis=(0, 1))], axis=0)
    np.testing.assert_allclose(seen["leaf", "proxy"], seen["leaf", "leaf"], rtol=0.1)
    np.testing.assert_allclose(seen["bark", "proxy"], seen["bark", "bark"], rtol=0.1)


def test_names_and_marks():
    made = [
        materials.leaf_material("Oak"),
        materials.bark_material("Oak"),
        materials.proxy_material(),
        microsphere.shell_material(),
        microsphere.scatter_group(),
    ]
    names = ["TetFlora Oak leaf", "TetFlora Oak bark", "TetFlora proxy", "TetFlora shell", "TetFlora Scatter"]
    assert [m.name for m in made] == names
    assert all(nodes.is_ours(m) for m in made)
    assert materials.leaf_material("Oak") == made[0]


def test_an_edited_material_stays_as_it_is():
    made = materials.leaf_material("Oak")
    made.node_tree.nodes.clear()
    assert materials.leaf_material("Oak") == made
    assert len(made.node_tree.nodes) == 0


def test_copies_and_renamed_materials_are_the_artists():
    made = materials.leaf_material("Oak")
    copy = made.copy()
    assert not nodes.is_ours(copy)
    made.name = "My oak"
    assert not nodes.is_ours(made)
    assert materials.leaf_material("Oak") != made


def test_an_outdated_material_is_kept_beside_the_new_one():
    old = materials.leaf_material("Oak")
    old[nodes.VERSION] = 0
    new = materials.leaf_material("Oak")
    assert new != old
    assert new.name == "TetFlora Oak leaf"
    assert old.name == "TetFlora Oak leaf (version 0)"
    assert not nodes.is_ours(old)


def test_a_material_that_the_artist_made_under_our_name_is_used():
    theirs = bpy.data.materials.new("TetFlora Oak bark")
    assert materials.bark_material("Oak") == theirs
    assert not nodes.is_ours(theirs)


def test_every_link_is_valid_and_every_species_shares_the_group():
    for made in (materials.leaf_material("Oak"), materials.bark_material("Fir"), materials.proxy_material()):
        groups = [n.node_tree for n in made.node_tree.nodes if n.bl_idname == "ShaderNodeGroup"]
        assert bpy.data.node_groups["TetFlora Scatter"] in groups
        assert all(link.is_valid for link in made.node_tree.links)
    assert len([g for g in bpy.data.node_groups if g.name.startswith("TetFlora Scatter")]) == 1


def test_every_bark_that_species_may_name_is_there():
    """In the same order: the number of a character is part of its materials' version."""
    assert bark.BARKS == species.BARKS


def test_patterns_are_built_of_small_trees():
    """Blender looks through all of a tree after each node and link: one of 120 nodes took as long as four of 60."""
    materials.bark_material("Oak", "smooth")
    materials.leaf_material("Oak", "palmate")
    assert max(len(group.nodes) for group in bpy.data.node_groups) <= 70
