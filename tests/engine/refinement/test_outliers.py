# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outliers are few, far beyond all others, and nobody sees them; what is seen is none, and neither is a far forest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine import support
from tetflora_addon.camera.camera import Camera
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.refinement.loop import FRACTION, MOST, NEAR, far_off, outliers_of
from tetflora_addon.refinement.polygons import Polygons
from tetflora_addon.refinement.shared_parts import PlacedAssets


def _camera(**other: object) -> Camera:
    """At the origin, looking along +Y."""
    frame = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    camera = Camera("PERSP", np.zeros(3), frame, (-0.5, 0.5, -0.4, 0.4), 0.1, 1e8, 400, 320)
    return replace(camera, **other)


def _plants(*places: tuple[float, float, float], scale: float = 1.0) -> Seeds:
    seeds = support.plants(np.arange(len(places)), position=(0.0, 0.0, 0.0))
    return replace(seeds, position=np.array(places, float), scale=np.full(len(places), scale))


NEARBY = [(0.0, float(y), 0.0) for y in (5, 20, 70)]


@pytest.mark.parametrize("far", [(1e6, 0, 0), (0, 1e6, 0), (0, -1e6, 0), (0, 0, 2e4)])
def test_one_plant_far_beyond_all_others_is_a_stray(far: tuple) -> None:
    outliers = outliers_of(support.small_flora(), _plants(NEARBY[0], far, *NEARBY[1:]), _camera())
    assert outliers.plants.tolist() == [1]
    assert outliers.away == pytest.approx(np.linalg.norm(far))
    seeds, polygons, _ = outliers.others(_plants(NEARBY[0], far, *NEARBY[1:]), Polygons.empty(), PlacedAssets.none())
    assert np.array_equal(seeds.position, NEARBY)
    assert len(polygons) == 0


def test_what_is_seen_is_no_stray() -> None:
    far, flora = (0.0, 3e4, 0.0), support.small_flora()
    assert len(outliers_of(flora, _plants(*NEARBY, far), _camera()).plants) == 1
    giants = _plants(*NEARBY, far, scale=3000.0)
    assert len(outliers_of(flora, giants, _camera()).plants) == 0
    # Through a telescope a speck is a plant, and so it is for parallel rays, unless it is beyond the range.
    telescope = _camera(window=(-1e-4, 1e-4, -1e-4, 1e-4))
    assert len(outliers_of(flora, _plants(*NEARBY, far), telescope).plants) == 0
    parallel = _camera(kind="ORTHO", window=(-50.0, 50.0, -40.0, 40.0))
    assert len(outliers_of(flora, _plants(*NEARBY, far), parallel).plants) == 0
    assert len(outliers_of(flora, _plants(*NEARBY, far), replace(parallel, far=1000.0)).plants) == 1
    # Nor is what another moment of the shutter sees.
    blurred = _camera(window=telescope.window, far=1000.0, shutter=(telescope,))
    assert len(outliers_of(flora, _plants(*NEARBY, far), blurred).plants) == 0


def test_a_forest_far_away_is_none() -> None:
    rng = np.random.default_rng(1)
    near, far = rng.uniform(0, 90, 50), 1e6 + rng.uniform(0, 900, 50)
    assert len(far_off(np.concatenate([near, far]))) == 0
    assert len(far_off(far)) == 0
    assert len(far_off(np.geomspace(1.0, 1e7, 500))) == 0


@pytest.mark.parametrize("number", [2, 20, 5000])
def test_strays_are_few(number: int) -> None:
    most = min(max(MOST, int(FRACTION * number)), number // 2)
    away = np.full(number, 50.0)
    away[:most] = 1e6
    assert far_off(away).tolist() == list(range(most))
    away[: most + 1] = 1e6
    assert len(far_off(away)) == 0


def test_nothing_within_some_kilometers_is_a_stray() -> None:
    assert len(far_off(np.array([0.1, 0.2, 15.9 * NEAR]))) == 0
    assert far_off(np.array([0.1, 16.1 * NEAR, 0.2, 1e9])).tolist() == [1, 3]
    assert len(far_off(np.zeros(0))) == len(far_off(np.ones(1))) == 0
