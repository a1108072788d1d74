# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""RAMI's scenes are those that were published, and the factor that is measured is that of the definition."""

from __future__ import annotations

from math import pi, radians

import bpy
import numpy as np
import pytest

from examples import rami, rami_discs, rami_species
from tetflora_addon.species.catalog import species_from_dict

SOLID = rami_discs.Solid("sphere", 1.0, 2.0, 2000, 0.05)


@pytest.mark.parametrize("name", (*rami_discs.CURVES, *rami_discs.COVERS))
def test_canopies_have_the_published_numbers(name):
    stand = rami_discs.canopy(name)
    given = rami_discs.data().get(name, {})
    numbers = {kind: len(places) for kind, places in stand.places.items()}
    if name == "HET01":
        assert numbers == {"crown": 15} and stand.solids["crown"].discs == 49_999
    elif name == "HET04":
        assert numbers == {"sphere": given["spheres"]["count"], "cylinder": given["cylinders"]["count"]}
    elif name == "HET06":
        assert numbers["tree"] * stand.solids["tree"].discs == 64_800_000
    else:
        index = {"HOM26": 6.0, "HET20": 2.0}.get(name, 1.0)
        assert stand.leaf_area_index == pytest.approx(index, rel=1e-3)
    if name in rami_discs.COVERS:
        published = next(v for key, v in rami_discs.data()["cover_nadir"].items() if key.startswith(name))
        assert stand.expected_cover == pytest.approx(published, abs=0.005)


@pytest.mark.parametrize("name", ("HET01", "HET04", "HET06", "HET10", "HET20"))
def test_crowns_stand_apart_and_within_the_border(name):
    stand = rami_discs.canopy(name)
    places = np.concatenate(list(stand.places.values()))
    radii = np.concatenate([np.full(len(p), stand.solids[kind].radius) for kind, p in stand.places.items()])
    # Published centers have no slack.
    assert np.all(np.abs(places[:, :2]) + radii[:, None] <= stand.side / 2 + 1e-3)
    some = slice(None, 1000)
    apart = np.linalg.norm(places[some, None, :2] - places[None, :, :2], axis=-1) - radii[some, None] - radii[None]
    apart[np.arange(len(apart)), np.arange(len(apart))] = 1.0
    if name == "HET01":
        # These are given in space; seen from above two overlap slightly.
        apart = np.linalg.norm(places[:, None] - places[None], axis=-1) - 20.0 + 40.0 * np.eye(len(places))
    assert apart.min() > -1e-3


def test_copies_around_repeat_the_scene():
    stand = rami_discs.canopy("HET01")
    padded = stand.padded("crown", 1)
    assert np.array_equal(padded[:15], stand.places["crown"])
    moved = (padded.reshape(9, 15, 3) - stand.places["crown"]) / stand.side
    assert np.allclose(moved, np.round(moved))
    assert len(np.unique(np.round(moved[:, 0, :2]), axis=0)) == 9


@pytest.mark.parametrize("shape", ("sphere", "cylinder", "cone", "box"))
def test_discs_fill_their_solid_evenly(shape):
    solid = rami_discs.Solid(shape, 1.0, 2.0, 20_000, 0.001, apart=False)
    centers, _ = rami_discs.discs(solid, 3)
    x, y, z = centers.T
    width = np.hypot(x, y)
    inside, middle = {
        "sphere": (np.linalg.norm(centers, axis=1) <= 1.0, 0.0),
        "cylinder": ((width <= 1.0) & (z >= 0.0) & (z <= 2.0), 1.0),
        # The centroid of a cone lies a quarter of its height above its base.
        "cone": ((width <= 1.0 - z / 2.0 + 1e-12) & (z >= 0.0), 0.5),
        "box": ((np.abs(x) <= 1.0) & (np.abs(y) <= 1.0) & (z >= 0.0) & (z <= 2.0), 1.0),
    }[shape]
    assert inside.all()
    assert np.allclose(centers.mean(axis=0), (0.0, 0.0, middle), atol=0.02)


@pytest.mark.parametrize("inclination", ("spherical", "planophile", "erectophile"))
def test_normals_show_the_expected_area_from_above(inclination):
    solid = rami_discs.Solid("box", 1.0, 1.0, 50_000, 0.0001, inclination=inclination, apart=False)
    _, normals = rami_discs.discs(solid, 5)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert np.abs(normals[:, 2]).mean() == pytest.approx(rami_discs.extinction(inclination), abs=0.005)


def test_discs_do_not_cut_each_other():
    centers, normals = rami_discs.discs(SOLID, 1)
    assert len(rami_discs.intersecting(centers, normals, SOLID.disc_radius)[0]) == 0
    # Two crossed discs do, beside each other they do not.
    upright, flat = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    for shift, number in ((0.5, 1), (1.5, 0)):
        pair = np.array([(0.0, 0.0, 0.0), (0.0, shift, 0.0)])
        assert len(rami_discs.intersecting(pair, np.array([upright, flat]), 0.5)[0]) == number
    assert len(rami_discs.intersecting(np.array([(0.0, 0, 0), (0, 0, 0.1)]), np.array([flat, flat]), 0.5)[0]) == 0


def test_polygons_have_the_area_of_the_discs(clean_file):
    mesh = rami.crown_mesh("test", SOLID, 1)
    area = sum(face.area for face in mesh.polygons)
    assert area == pytest.approx(SOLID.leaf_area, rel=1e-5)


def test_species_have_the_discs_of_the_solid():
    for name in (*rami_discs.CURVES, *rami_discs.COVERS):
        for kind, solid in rami_discs.canopy(name).solids.items():
            species = species_from_dict(rami_species.species_data(kind, solid), "test", "test")
            order = species.orders[-1]
            assert order.leaves[0] == solid.discs
            assert species.leaf_transmission * order.leaf_color[0][0] == pytest.approx(solid.transmittance)


def test_bare_ground_reflects_the_same_everywhere(clean_file, tmp_path):
    scene, stand = bpy.context.scene, rami_discs.canopy("HET01")
    rami.build(scene, stand, plants=False)
    for zenith in (-75.0, -20.0, 0.0, 60.0):
        rami.set_view(scene, stand, zenith, 16)
        found = rami.reflectance_factor(rami.radiance(scene, tmp_path / "view.exr", 1), stand)
        assert found == pytest.approx(stand.ground, rel=1e-4)


@pytest.mark.parametrize("zenith", (-75.0, 0.0, 40.0))
def test_image_shows_just_the_target(clean_file, zenith):
    scene, stand = bpy.context.scene, rami_discs.canopy("HET01")
    rami.build(scene, stand, plants=False)
    rami.set_view(scene, stand, zenith, 10)
    bpy.context.view_layer.update()
    camera, render = scene.camera, scene.render
    half = stand.side / 2
    projection = camera.calc_matrix_camera(
        bpy.context.evaluated_depsgraph_get(),
        x=render.resolution_x,
        y=render.resolution_y,
        scale_x=render.pixel_aspect_x,
        scale_y=render.pixel_aspect_y,
    )
    both = np.array(projection @ camera.matrix_world.inverted())
    corners = np.array([(x, y, stand.top, 1.0) for x in (-half, half) for y in (-half, half)])
    assert np.allclose(np.abs((corners @ both.T)[:, :2]), 1.0, atol=1e-4)
    # On the sun's side of nadir for negative zeniths: the sun stands above +x.
    assert np.sign(camera.location.x) == -np.sign(round(np.sin(radians(zenith)), 9))
    sun = next(o for o in scene.objects if o.type == 'LIGHT')
    assert (sun.matrix_world.to_3x3() @ camera.location.__class__((0, 0, 1))).x > 0.0
    assert sun.data.energy == pytest.approx(pi)
