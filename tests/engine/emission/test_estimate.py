# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimates follow picture, plants and settings in the right direction, and keep to limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.compiled.sizes import Crown, CrownParts, crown_of
from tetflora_addon.emission import budget
from tetflora_addon.emission.budget import Stand, estimate, expanded_faces
from tetflora_addon.emission.drawing import LIT_LEAVES, Parts, drawing, drawn_blocks
from tetflora_addon.emission.plants import Block, Transition
from tetflora_addon.jobs import run_to_end
from tetflora_addon.proxies.facet_weights import facet_weights
from tetflora_addon.refinement.loop import refine
from tetflora_addon.refinement.settings import QUALITIES, RefinementSettings
from tetflora_addon.species.catalog import load_species

SETTINGS = RefinementSettings()


#: A tree of 15 m with leaves of 3 cm.
TREE = Crown(2.7, 15.0, 86_000.0, 3.0, 86.0)


def _stand(number=1000, near=20.0, far=300.0, width=100.0):
    """Trees on the ground before a camera that looks along +y."""
    rng = np.random.default_rng(number)
    foot = np.zeros((number, 3))
    foot[:, 0], foot[:, 1] = rng.uniform(-width, width, number), rng.uniform(near, far, number)
    return Stand(np.ones(number), foot, np.ones(number), np.zeros(number, np.int64), (TREE,))


def _part(stand, which):
    return replace(stand, **{name: getattr(stand, name)[which] for name in ("number", "foot", "scale", "which")})


def _camera(width=1920, height=1080, kind="PERSP", window=(-0.36, 0.36, -0.2025, 0.2025)):
    """At 5 m, looking along +y."""
    frame = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return Camera(kind, np.array([0.0, 0.0, 5.0]), frame, window, 0.1, 1000.0, width, height)


def _estimate(stand, camera=None, settings=SETTINGS, used=1e9, allowed=np.inf, **options):
    return estimate(stand, camera or _camera(), settings, used, allowed, **options)


def test_of_a_plant_that_is_not_in_view_few_facets_are_made():
    camera = _camera()
    tree = replace(_stand(1), foot=np.array([[0.0, 60.0, 0.0]]))
    shown = _estimate(tree, camera).primitives
    for foot in ([0.0, -60.0, 0.0], [0.0, 10.0 * camera.far, 0.0], [500.0, 60.0, 0.0], [0.0, 60.0, -200.0]):
        unseen = _estimate(replace(tree, foot=np.array([foot])), camera).primitives
        assert 0.01 * 86_000.0 < unseen < 86_000.0 / LIT_LEAVES
        assert shown > 4.0 * unseen


def test_numbers_follow_pixels_and_not_plants_once_the_picture_is_full():
    wood = _estimate(_stand(10_000))
    more = _estimate(_stand(40_000))
    assert more.primitives < 1.2 * wood.primitives
    assert more.seconds == pytest.approx(wood.seconds, rel=0.1)
    half = _estimate(_stand(10_000), _camera(960, 540))
    assert 2.0 * half.primitives < wood.primitives < 4.0 * half.primitives  # where there are few, they are finer
    assert _estimate(_stand(10)).primitives < 0.2 * wood.primitives


def test_processes_take_what_the_tiles_take_that_they_draw():
    """Of an image of one tile one of them has work, and of one of many all; an empty picture takes what they are."""
    small, wood = _camera(240, 240), _stand(10_000)
    alone, two, four = (_estimate(wood, small, processes=number) for number in (0, 2, 4))
    each = (four.memory - two.memory) / 2.0
    assert 5e7 < each < 3e8 and two.memory - alone.memory == pytest.approx(2.0 * each)
    wide = _camera(8 * 240, 1080)
    at_work = [_estimate(wood, wide, processes=number).memory - number * each for number in (0, 2, 4, 8, 16)]
    tile = at_work[1] - at_work[0]
    assert 200.0 < tile * 8 / _estimate(wood, wide).primitives < 600.0
    assert np.diff(at_work) == pytest.approx(tile * np.array([1.0, 2.0, 4.0, 0.0]), rel=1e-3)


def test_plants_that_are_near_and_seen_are_looked_at_most():
    camera, stand = _camera(), _stand(3000)
    near = replace(stand, foot=np.concatenate([[[0.0, 8.0, 0.0]], stand.foot[1:]]))
    parts, plant = near.parts(camera)
    looked = np.bincount(plant, minlength=3000)
    assert looked[0] > 10 * looked[1:].mean() and looked.min() == 1 and 3000 <= len(parts) < 10_000
    assert parts.number.sum() == pytest.approx(3000 * 86_000.0)
    assert not np.array_equal(parts.position[plant == 1] - near.foot[1], parts.position[plant == 2] - near.foot[2])


#: Scenes by species, number, lower and upper corner of the ground that they stand on, and slope of the camera's look.
SCENES = {
    "birch at 3 m": (("birch",), 1, (0.0, 3.0), (0.0, 3.0), 0.8),
    "bushes": (("bush",), 12, (-3.0, 2.0), (3.0, 9.0), 0.0),
    "near birches": (("birch",), 5, (-3.0, 5.0), (3.0, 12.0), 0.3),
    "spruce": (("spruce",), 1, (0.0, 14.0), (0.0, 14.0), 0.2),
    "mixed": (("spruce", "beech"), 6, (-5.0, 12.0), (5.0, 24.0), 0.2),
    "far away": (("oak", "birch"), 12, (-8.0, 25.0), (8.0, 40.0), 0.0),
}


def _seeds(name):
    """Plants of a scene, before a camera at the height of eyes, and the stand that they are."""
    species, number, low, high, slope = SCENES[name]
    foot = np.zeros((number, 3))
    foot[:, :2] = np.random.default_rng(3).uniform(low, high, (number, 2))
    which = np.arange(number) % len(species)
    known = [load_species(one) for one in species]
    eye = np.array([0.0, 0.0, 1.7])
    camera = support.camera(eye, eye + [0.0, 1.0, slope], pixels=120, view=0.72)
    seeds = support.plants(1 + np.arange(number), which, foot)
    return (
        compile_species(known),
        seeds,
        camera,
        Stand(np.ones(number), foot, np.ones(number), which, tuple(map(crown_of, known))),
    )


@pytest.mark.parametrize("name", SCENES)
def test_as_many_are_made(name, monkeypatch):
    """Within one and a half, in a small picture with facets of the size that they have in a large one."""
    monkeypatch.setattr(budget, "PLENTY", 0.01 * budget.PLENTY)
    flora, seeds, camera, stand = _seeds(name)
    result = run_to_end(refine(flora, seeds, camera, SETTINGS))
    detail = budget.fit_to_budget(result, camera, SETTINGS)
    view = detail.camera
    how = Transition(flora, view, detail.leaf_limit, detail.tolerance), facet_weights(flora)
    options = {"facet": detail.facet, "hidden": detail.coarser}
    made = 0
    for one in drawn_blocks(drawing(flora, detail.refinement, *how, **options)):
        if isinstance(one, Parts):
            made += sum(len(facets) for facets, _ in one)
        elif isinstance(one, Block):
            made += one.buffers.polygons
    assert 1 / 1.5 < _estimate(stand, camera).primitives / made < 1.5


def test_as_many_leaves_hang_at_the_height_of_eyes():
    """Next to none of a birch's are there, but these are all that somebody sees who stands before it."""
    species = load_species("birch")
    flora, parts, height = compile_species([species]), crown_of(species).parts, 3.5
    leaf = parts.form >= 0
    low = np.array([0, 0])
    for seed in range(1, 4):
        whole = support.whole_of(flora, support.grown(flora, support.plants(seed))[1])
        place = support.leaves_of(flora, whole.branches)[1]
        low += (place[:, 2] < height).sum(), len(place)
    share = parts.number[leaf & (parts.position[:, 2] < height)].sum() / parts.number[leaf].sum()
    assert 1 / 1.5 < share / (low[0] / low[1]) < 1.5


@pytest.mark.parametrize("name", ["birch at 3 m", "bushes", "near birches", "mixed"])
def test_as_many_are_expanded(name):
    """Polygons of all plants, those at hand as finely as the camera sees them, and the memory for these."""
    flora, seeds, camera, stand = _seeds(name)
    *_, (polygons, triangles) = expanded_faces(flora, seeds, camera)
    found = _estimate(stand, camera, everything=True)
    assert 1 / 1.5 < found.primitives / polygons < 1.5
    assert 1 / 1.5 < (found.memory - 1e9) / (budget.BYTES_PER_TRIANGLE * triangles) < 1.5


def test_a_sample_stands_for_all():
    wood = _stand(20_000)
    some = replace(_part(wood, slice(None, None, 20)), number=np.full(1000, 20.0))
    assert _estimate(some).primitives == pytest.approx(_estimate(wood).primitives, rel=0.05)
    assert _estimate(some).seconds == pytest.approx(_estimate(wood).seconds, rel=0.05)


def test_few_that_are_near_count_as_themselves_beside_many_that_stand_for_others():
    """A tree at hand and a thousand tufts of which each stands for a hundred are what all of them are."""
    rng = np.random.default_rng(2)
    tuft = Crown(0.1, 0.3, 40.0, 0.0, 0.05)
    foot = np.concatenate([[[0.0, 20.0, 0.0]], np.zeros((100_000, 3))])
    foot[1:, :2] = rng.uniform((-60.0, 20.0), (60.0, 200.0), (100_000, 2))
    which = np.minimum(np.arange(len(foot)), 1)
    every = Stand(np.ones(len(foot)), foot, np.ones(len(foot)), which, (TREE, tuft))
    some = _part(every, np.r_[0, 1 : len(foot) : 100])
    some = replace(some, number=np.where(some.which == 0, 1.0, 100.0))
    assert _estimate(some).plants == 100_001
    assert _estimate(some).primitives == pytest.approx(_estimate(every).primitives, rel=0.1)


def test_no_plant_gets_more_polygons_than_it_has():
    tufts = replace(_stand(50, 5.0, 10.0, 5.0), crowns=(replace(TREE, polygons=100.0, parts=CrownParts.empty()),))
    assert _estimate(tufts).primitives <= 5_000
    assert _estimate(tufts, everything=True).primitives == pytest.approx(5_000)


def test_drafts_take_less():
    sizes = [_estimate(_stand(), settings=replace(SETTINGS, **QUALITIES[name])).primitives for name in QUALITIES]
    assert sizes[0] < 0.5 * sizes[2]
    assert sizes[0] < sizes[1] < sizes[2]


def test_branches_take_time_where_leaves_take_little():
    """A wood without leaves has less than half of the polygons, and takes about as long at least."""
    crowns = crown_of(load_species("birch")), crown_of(load_species("spruce"))
    wood = replace(_stand(), which=np.arange(1000) % 2, crowns=crowns)
    bare = replace(wood, crowns=tuple(replace(crown, parts=crown.parts.with_leaves(0.0)) for crown in crowns))
    summer, winter = _estimate(wood), _estimate(bare)
    assert winter.primitives < 0.5 * summer.primitives
    assert winter.seconds > 0.8 * summer.seconds


def test_with_fewer_leaves_there_is_as_much_wood():
    parts = crown_of(load_species("birch")).parts
    some, wood = parts.with_leaves(0.25), parts.form < 0
    assert wood.any() and not wood.all()
    np.testing.assert_array_equal(some.number, np.where(wood, parts.number, 0.25 * parts.number))


def test_limits_hold():
    free = _estimate(_stand())
    assert not free.limit
    few = _estimate(_stand(), settings=replace(SETTINGS, max_polygons=10_000))
    assert few.limit == "Max Polygons" and few.primitives == pytest.approx(
        7225
    )  # reserves: what is expected may be more
    tight = _estimate(_stand(), allowed=1e8)
    assert tight.limit == "Max Memory"
    assert 1e9 < tight.memory < 1e9 + 1e8
    assert tight.seconds < free.seconds
    assert not _estimate(_stand(), allowed=1e8, everything=True).limit


def test_nothing_is_nothing():
    empty = Stand(np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int64), ())
    found = _estimate(empty)
    assert (found.plants, found.primitives, found.memory) == (0, 0.0, 1e9)


@pytest.mark.parametrize("kind", ["ORTHO", "PANO"])
def test_other_cameras_have_estimates_too(kind):
    window = (-60.0, 60.0, -34.0, 34.0) if kind == "ORTHO" else (-np.pi, np.pi, -np.pi / 2.0, np.pi / 2.0)
    found = _estimate(_stand(), _camera(kind=kind, window=window))
    assert 10_000 < found.primitives < np.inf


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e300])
def test_plants_without_a_place_or_a_size_count_as_nothing(wrong):
    """Refine names them; an estimate that failed would come before."""
    stand = _stand(50)
    foot, scale = stand.foot.copy(), stand.scale.copy()
    foot[3, 1], scale[7] = wrong, wrong
    rest = np.setdiff1d(np.arange(50), [3, 7])
    alone = _part(stand, rest)
    with np.errstate(all="ignore"):
        found = _estimate(replace(stand, foot=foot, scale=scale)).primitives
    assert found == pytest.approx(_estimate(alone).primitives, rel=0.2)
    assert np.isfinite(_estimate(replace(stand, foot=np.full((50, 3), np.nan))).primitives)
