# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadows of what is hidden: what stands in the light of something seen is refined, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine import support
from tests.engine.refinement.test_loop import FAST, check
from tetflora_addon.camera.camera import Camera
from tetflora_addon.compiled.flora import Flora
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.refinement.decisions import Decision
from tetflora_addon.refinement.lights import GROUND, Light, seen_ground
from tetflora_addon.refinement.loop import Refinement, refine
from tetflora_addon.refinement.settings import RefinementSettings

# The camera looks along +y and down; plants stand behind it, and some far to the side.
CAMERA = support.camera((0, 0, 3), (0, 6, 0), pixels=256, view=1.2)
BEHIND = [(x, -3.0, 0.0) for x in (-3, 0, 3)]
ASIDE = [(x, -3.0, 0.0) for x in (57, 60, 63)]

SLANT, LOW = (np.array([0.0, 1.0, -z]) / np.hypot(1.0, z) for z in (0.6, 0.4))
NOWHERE = np.zeros(3)
LIGHTS = {
    "sun": Light("SUN", NOWHERE, LOW),
    "spot": Light("SPOT", np.array([0.0, -12.0, 6.0]), SLANT, 0.02, 0.6),
    "wide spot": Light("SPOT", np.array([0.0, -12.0, 6.0]), SLANT, 0.02, 1.5),
    "point": Light("POINT", np.array([0.0, -12.0, 6.0]), SLANT, 0.02),
}


def last(flora: Flora, seeds: Seeds, lights: list[Light], camera: Camera = CAMERA, **options: float) -> Refinement:
    """The loop's result."""
    loop = refine(flora, seeds, camera, RefinementSettings(**{**FAST, "shadow_cutoff": 4.0, **options}), lights=lights)
    while True:
        try:
            next(loop)
        except StopIteration as stop:
            return stop.value


def refined(result: Refinement) -> np.ndarray:
    """Which cells are more than coarse, and where: (t,) bool."""
    return result.decision != Decision.HIDDEN


@pytest.mark.parametrize(("kind", "anchored"), [*((kind, False) for kind in LIGHTS), ("point", True)])
def test_shadows_that_fall_into_the_image_are_refined(kind: str, anchored: bool) -> None:
    flora, seeds = support.small_flora(), support.plants(np.arange(6), position=BEHIND + ASIDE)
    plain = last(flora, seeds, [LIGHTS[kind]], shadow_cutoff=0.0, anchored=anchored)
    result = last(flora, seeds, [LIGHTS[kind]], anchored=anchored)
    for one in (plain, result):
        check(flora, seeds, one)
    assert not refined(plain).any()
    middle = result.tree.vertices(result.nodes).mean(axis=1)
    aside = result.totals.polygons[refined(result) & (middle[:, 0] > 40)].sum()
    # What has its shadow in the image is refined; where space is still coarse, so are the images that lights see.
    points = result.plants.points
    way = LOW if kind == "sun" else points.position - LIGHTS[kind].position
    ground = points.position - way * (points.position[:, 2] / way[..., 2])[:, None]
    shown = points.optical_area * (CAMERA.distance_to_view(ground) < 0) * (points.position[:, 0] < 20)
    made = result.chosen(Decision.EXPLICIT, Decision.PROXY)[points.cell]
    assert shown[made].sum() > 0.5 * shown.sum() > 0
    # A piece of space with few polygons may reach from one to the other.
    assert aside <= RefinementSettings().few_polygons


def test_light_from_the_other_side_changes_nothing() -> None:
    """Shadows that fall away from the image."""
    flora, seeds = support.small_flora(), support.plants(np.arange(3), position=BEHIND)
    result = last(flora, seeds, [Light("SUN", NOWHERE, SLANT * [1, -1, 1])])
    assert not refined(result).any()


def test_a_penumbra_needs_no_leaves() -> None:
    """The wider the sun, the less is divided."""
    flora, seeds = support.small_flora(), support.plants(np.arange(3), position=BEHIND)
    made = [last(flora, seeds, [Light("SUN", NOWHERE, SLANT, width)]) for width in (0.0, 0.1, 1.0)]
    polygons = [r.totals.polygons[r.decision == Decision.EXPLICIT].sum() for r in made]
    assert polygons == sorted(polygons, reverse=True)
    assert polygons[-1] < 0.8 * polygons[0]


def test_a_coarser_cutoff_divides_less() -> None:
    flora, seeds = support.small_flora(), support.grove(9, 2.0)
    camera = support.camera((0, 12, 3), (0, 18, 0), pixels=256, view=1.2)
    made = [last(flora, seeds, [LIGHTS["sun"]], camera, shadow_cutoff=c).tree.tetrahedra_made for c in (2.0, 8.0, 64.0)]
    assert made == sorted(made, reverse=True)


@pytest.mark.parametrize("limit", [40, 150])
def test_a_limit_leaves_shadows_coarse(limit: int) -> None:
    """What may not be divided any more stays hidden, and does not become polygons all at once."""
    flora, seeds = support.small_flora(), support.plants(np.arange(3), position=BEHIND)
    free, result = (
        last(flora, seeds, [LIGHTS["sun"]], few_polygons=0, block=8.0, max_tetrahedra=n) for n in (20_000, limit)
    )
    check(flora, seeds, result)
    assert not result.complete
    explicit = [r.totals.polygons[refined(r)].sum() for r in (free, result)]
    assert explicit[1] <= explicit[0]


def test_ground_is_where_rays_meet_it() -> None:
    points = seen_ground(CAMERA, None, 0.5)
    assert points[:, 2] == pytest.approx(0.5)
    assert (CAMERA.distance_to_view(points) < 1e-9).all()
    wall = np.array([[(-50, 5, -50), (50, 5, -50), (0, 5, 90)]], float)
    before = seen_ground(CAMERA, wall, 0.0)
    assert (before[:, 1] <= 5 + 1e-9).all()
    assert np.isclose(before[:, 1], 5).any()
    around = Camera("PANO", CAMERA.position, CAMERA.frame, (-np.pi, np.pi, -np.pi / 2, np.pi / 2), 0.1, 90.0, 64, 32)
    every = seen_ground(around, None, 0.0)
    assert every[:, 2] == pytest.approx(0.0, abs=1e-9)
    assert np.ptp(np.arctan2(every[:, 1], every[:, 0])) > 6.0
    assert len(every) <= 6 * (GROUND // 2) ** 2  # each side of the cube has half of the rays across
