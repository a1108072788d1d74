# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of the benchmark `exact`: blobs, areas of polygons, and sides in pixels."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import exact


def test_blobs_are_spots_that_three_pixels_keep_and_one_pixel_does_not() -> None:
    truth = np.full((12, 20), 0.4)
    found = truth.copy()
    found[2:5, 2:5] += 0.2  # a facet that is too bright
    found[7:10, 9:12] -= 0.2
    found[5, 17] += 0.9  # one noisy pixel: a tenth in its surroundings
    bright, dark = exact.blobs(truth, found, np.ones(truth.shape, bool))
    assert bright[3, 3] and dark[8, 10]
    # 0.2 × 6 / 9 of the spot is above the limit, × 4 / 9 is not.
    assert bright.sum() == dark.sum() == 5
    assert not bright[4:7, 16:19].any()


def test_blobs_are_counted_where_plants_are() -> None:
    truth = np.zeros((6, 6))
    mask = np.zeros(truth.shape, bool)
    mask[:, :2] = True
    bright, dark = exact.blobs(truth, truth + 0.5, mask)
    assert (bright == mask).all()
    assert not dark.any()


def test_areas_of_polygons_of_any_number_of_corners() -> None:
    position = np.array([[0, 0, 1], [2, 0, 1], [2, 1, 1], [1, 1, 1], [1, 2, 1], [0, 2, 1]], np.float32)
    # A triangle, and an L of six corners.
    corners = np.array([0, 1, 2, 0, 1, 2, 3, 4, 5], np.int32)
    areas = exact.polygon_areas(position, corners, np.array([0, 3], np.int32), np.array([3, 6], np.int32))
    assert areas == pytest.approx([1.0, 3.0])


def test_sides_are_weighted_by_pixels_and_only_facets_count() -> None:
    kinds = {name: exact.KINDS.index(name) for name in exact.KINDS}
    kind = np.array([[0, kinds["proxy"], kinds["proxy"], kinds["triangle"], kinds["leaf"], kinds["bark"]]])
    side = np.array([[99.0, 1.0, 2.0, 6.0, 40.0, 80.0]])
    found = exact.sums_of_sides(side, kind)
    assert found["facet_px"] == pytest.approx(3.0)
    assert found["facet_px_largest"] == 6.0
    assert found["proxy_px"] == pytest.approx(1.5)
    assert found["leaf_px"] == 40.0
    assert found["proxy_share"] == pytest.approx(0.4)


def test_the_name_of_a_truth_follows_from_what_is_seen() -> None:
    spec = exact.Spec("edge", ("birch", "spruce"))
    assert spec.digest == exact.Spec("edge", ("birch", "spruce")).digest
    others = [exact.Spec("low", spec.species), exact.Spec("edge", ("oak",)), exact.Spec("edge", spec.species, "bare")]
    assert len({spec.digest, *(other.digest for other in others)}) == 4
