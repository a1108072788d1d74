# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimates follow picture, plants and settings in the right direction, and keep to limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled.crowns import Crown, crown_of
from tetflora_addon.refinement import estimate as model
from tetflora_addon.refinement.estimate import Stand, estimate, seen
from tetflora_addon.refinement.settings import QUALITIES, RefinementSettings
from tetflora_addon.species.catalog import load_species

SETTINGS = RefinementSettings()


def _stand(number=1000, near=20.0, far=300.0, width=100.0, leaf=0.001):
    """Trees of 15 m on the ground before a camera that looks along +y; by default all their leaves are facets."""
    rng = np.random.default_rng(number)
    foot = np.zeros((number, 3))
    foot[:, 0], foot[:, 1] = rng.uniform(-width, width, number), rng.uniform(near, far, number)
    return Stand(number, foot, np.ones(number), np.zeros(number, np.int64), (Crown(2.7, 15.0, 86_000.0, leaf=leaf),))


def _camera(width=1920, height=1080, kind="PERSP", window=(-0.36, 0.36, -0.2025, 0.2025)):
    """At 5 m, looking along +y."""
    frame = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return Camera(kind, np.array([0.0, 0.0, 5.0]), frame, window, 0.1, 1000.0, width, height)


def _estimate(stand, camera=None, settings=SETTINGS, used=1e9, allowed=np.inf, **options):
    return estimate(stand, camera or _camera(), settings, used, allowed, **options)


def test_one_tree_covers_its_ellipse_and_none_behind_the_camera():
    camera = _camera()
    tree = replace(_stand(1), foot=np.array([[0.0, 100.0, -2.5]]))
    side = camera.pixel_size * 100.0
    assert seen(tree, camera)[1].sum() == pytest.approx(np.pi * 2.7 * 7.5 / side**2, rel=1e-6)
    behind = replace(tree, foot=np.array([[0.0, -100.0, 0.0]]))
    assert seen(behind, camera)[1].sum() == 0.0
    beyond = replace(tree, foot=np.array([[0.0, 10.0 * camera.far, 0.0]]))
    assert seen(beyond, camera)[1].sum() == 0.0
    beside = replace(tree, foot=np.array([[500.0, 100.0, 0.0]]))
    assert seen(beside, camera)[1].sum() == 0.0
    around = replace(tree, foot=camera.position[None] - [0.0, 0.0, 7.5])
    assert seen(around, camera)[1].max() <= 1920 * 1080


def test_numbers_follow_pixels_and_not_plants_once_the_picture_is_full():
    wood = _estimate(_stand(10_000))
    more = _estimate(_stand(40_000))
    assert more.primitives < 1.05 * wood.primitives
    assert more.seconds > wood.seconds
    half = _estimate(_stand(10_000), _camera(960, 540))
    assert wood.primitives == pytest.approx(4.0 * half.primitives, rel=0.1)
    assert _estimate(_stand(10)).primitives < 0.2 * wood.primitives
    assert _estimate(_stand(10_000), shown=4e6).primitives == 4e6


def test_near_trees_have_all_their_polygons_up_to_what_the_picture_shows():
    near, coarse = _estimate(_stand(20, leaf=0.5)), replace(SETTINGS, **QUALITIES["DRAFT"])
    assert near.primitives < (1.0 + model.UNSEEN) * 20 * 86_000
    assert _estimate(_stand(20, leaf=0.5), settings=coarse).primitives == near.primitives > 10_000


MIXED = ("beech", "oak", "spruce", "birch", "ash")


@pytest.mark.parametrize(
    ("species", "number", "low", "high", "eye", "made"),
    [
        (("birch",), 14, (-6.0, 5.0), (6.0, 17.0), 1.7, 1_092_308),
        (("beech",), 14, (-6.0, 5.0), (6.0, 17.0), 1.7, 1_362_091),
        (("spruce",), 14, (-6.0, 5.0), (6.0, 17.0), 1.7, 3_690_269),
        (("birch",), 200, (-30.0, -30.0), (30.0, 30.0), 1.7, 1_551_426),
        (MIXED, 150, (-30.0, -30.0), (30.0, 30.0), 1.7, 2_625_401),
        (MIXED, 300, (-60.0, 150.0), (60.0, 270.0), 6.0, 2_144_047),
    ],
    ids=["near birches", "near beeches", "near spruces", "birches around", "wood around", "wood far away"],
)
def test_levels_of_leaves_near_the_camera_count(species, number, low, high, eye, made):
    """The last number is what refining such a scene made at 1280 × 720 (polygons and facets)."""
    foot = np.zeros((number, 3))
    foot[:, :2] = np.random.default_rng(3).uniform(low, high, (number, 2))
    which = np.arange(number) % len(species)
    stand = Stand(number, foot, np.ones(number), which, tuple(crown_of(load_species(name)) for name in species))
    camera = replace(_camera(1280, 720), position=np.array([0.0, 0.0, eye]))
    assert 0.5 * made < _estimate(stand, camera, shown=3_840_000.0).primitives < 2.0 * made


def test_a_sample_stands_for_all():
    wood = _stand(20_000)
    some = replace(wood, **{name: getattr(wood, name)[::20] for name in ("foot", "scale", "which")})
    assert some.weight == 20.0
    assert _estimate(some).primitives == pytest.approx(_estimate(wood).primitives, rel=0.05)
    assert _estimate(some).seconds == pytest.approx(_estimate(wood).seconds, rel=0.05)


def test_no_plant_gets_more_polygons_than_it_has():
    tufts = replace(_stand(50, 5.0, 10.0, 5.0), crowns=(Crown(2.7, 15.0, 100.0, leaf=0.001),))
    assert _estimate(tufts).primitives <= (1.0 + model.UNSEEN) * 5_000
    assert _estimate(tufts, everything=True).primitives == 5_000


def test_drafts_take_less():
    sizes = [_estimate(_stand(), settings=replace(SETTINGS, **QUALITIES[name])).primitives for name in QUALITIES]
    assert sizes[0] < 0.3 * sizes[2]
    assert sizes[0] < sizes[1] < sizes[2]


def test_limits_hold():
    free = _estimate(_stand())
    assert not free.limited
    few = _estimate(_stand(), settings=replace(SETTINGS, max_polygons=10_000))
    assert (few.primitives, few.limited) == (10_000, True)
    tight = _estimate(_stand(), allowed=1e8)
    assert tight.limited
    assert tight.memory == pytest.approx(1e9 + 1e8, rel=0.01)
    assert tight.seconds < free.seconds
    assert not _estimate(_stand(), allowed=1e8, everything=True).limited


def test_nothing_is_nothing():
    empty = Stand(0, np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int64), ())
    found = _estimate(empty)
    assert (found.plants, found.primitives, found.memory) == (0, 0.0, 1e9)


@pytest.mark.parametrize("kind", ["ORTHO", "PANO"])
def test_other_cameras_have_estimates_too(kind):
    window = (-60.0, 60.0, -34.0, 34.0) if kind == "ORTHO" else (-np.pi, np.pi, -np.pi / 2.0, np.pi / 2.0)
    found = _estimate(_stand(), _camera(kind=kind, window=window))
    assert 10_000 < found.primitives < np.inf
