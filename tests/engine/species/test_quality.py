# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One factor for a species' level of detail: polygons as asked, the plant's look kept."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.engine import support
from tetflora_addon.compiled.bounds import unit_bounds
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.errors import SpeciesError
from tetflora_addon.growth.axes import axes
from tetflora_addon.growth.rows import build_rows
from tetflora_addon.species.catalog import ORDER_KEYS, load_species, species_from_dict
from tetflora_addon.species.members import expected_members, expected_polygons
from tetflora_addon.species.quality import with_quality
from tetflora_addon.species.species import QUALITY_LIMITS, Range, Species

KINDS = st.sampled_from(support.SPECIES)
TOLERANCE = 0.1  # how far the expected polygons may be from those asked for, as a fraction of them
QUALITIES = st.floats(math.log(0.05), math.log(20)).map(math.exp)


@cache
def kind(identifier: str) -> Species:
    return load_species(identifier)


def leaf_area(species: Species) -> float:
    """Expected area of all leaves of a plant, m², but for what differs between inside and outside of the crown."""
    members = expected_members(species)
    bearers = list(zip(species.orders, members.leaves, strict=True))
    if species.spur is not None:
        bearers.append((species.spur, members.spur_leaves))
    total = 0.0
    for order, number in bearers:
        forms = species.forms(order.leaf_kind) or species.leaf
        size, variation = order.leaf_size
        total += number * (size**2 + variation**2 / 3) * np.mean([form.area for form in forms])
    return total


def test_expected_polygons_are_those_of_the_compiled_species() -> None:
    """Few and many; the rings of a flared base are left out."""
    for quality in (0.2, 1.0, 2.0):
        changed = [with_quality(kind(name), quality) for name in ("oak", "cherry_blossom", "palm")]
        flora = compile_species(changed)
        assert flora.polygons[flora.first_row] == pytest.approx([expected_polygons(s) for s in changed], rel=0.03)


@given(name=KINDS, quality=QUALITIES)
@settings(max_examples=12, deadline=None)
def test_polygons_are_as_asked(name: str, quality: float) -> None:
    wanted = quality * expected_polygons(kind(name))
    assume(500 <= wanted <= 500_000)
    assert expected_polygons(with_quality(kind(name), quality)) == pytest.approx(wanted, rel=TOLERANCE)


@pytest.mark.parametrize("name", support.SPECIES)
@pytest.mark.parametrize("polygons", [500, 500_000])
def test_every_species_reaches_500_to_500_000_polygons(name: str, polygons: int) -> None:
    changed = with_quality(kind(name), polygons / expected_polygons(kind(name)))
    assert expected_polygons(changed) == pytest.approx(polygons, rel=TOLERANCE)


@given(name=KINDS, quality=QUALITIES)
@settings(max_examples=12, deadline=None)
def test_leaf_area_and_height_of_the_bound_are_kept(name: str, quality: float) -> None:
    before, after = kind(name), with_quality(kind(name), quality)
    assert leaf_area(after) == pytest.approx(leaf_area(before), rel=0.05)
    low, high = (unit_bounds(build_rows([s]))[0, 2] * s.orders[0].length.high for s in (before, after))
    # The bound of a mat a hand or two high is mostly what its runners might do.
    assert high <= (1.25 if low < 0.6 else 1.06) * low


@given(name=KINDS, quality=st.floats(math.log(QUALITY_LIMITS[0]), math.log(30)).map(math.exp))
@settings(max_examples=12, deadline=None)
def test_the_result_is_a_species_that_the_format_allows(name: str, quality: float) -> None:
    for i, order in enumerate(with_quality(kind(name), quality).orders):
        assert isinstance(order.sides, int) and isinstance(order.segments, int)
        for key, limits in ORDER_KEYS.items():
            value = getattr(order, key)
            if isinstance(value, Range):
                assert limits.low <= value.low + 1e-9, (i, key)
                assert value.high <= limits.high + 1e-9, (i, key)
            elif limits.kind in ("number", "integer"):
                assert limits.low <= value <= limits.high, (i, key)


@pytest.mark.parametrize("name", support.SPECIES)
def test_quality_1_is_the_species_itself(name: str) -> None:
    with_quality.cache_clear()  # of an equal species that another test has loaded
    assert with_quality(kind(name), 1.0) is kind(name)


@given(name=KINDS, qualities=st.tuples(QUALITIES, QUALITIES))
@settings(max_examples=10, deadline=None)
def test_more_quality_never_means_fewer_polygons(name: str, qualities: tuple[float, float]) -> None:
    low, high = (expected_polygons(with_quality(kind(name), q)) for q in sorted(qualities))
    assert low <= high * (1 + 1e-9)


@cache
def extents(name: str, quality: float) -> list[float]:
    """Height and distance from the trunk within which 90 % of the surface of two plants lies."""
    flora = compile_species([with_quality(kind(name), quality)])
    tubes, leaves = support.meshes(flora, support.grown(flora, support.plants(np.arange(2)))[1])
    centers = np.concatenate([support.face_centers(m) for m in (*tubes, *leaves)])
    weight = np.concatenate([support.face_areas(m) for m in (*tubes, *leaves)])
    found = []
    for measure in (centers[:, 2], np.hypot(centers[:, 0], centers[:, 1])):
        order = np.argsort(measure)
        found.append(measure[order][np.searchsorted(np.cumsum(weight[order]), 0.9 * weight.sum())])
    return found


@pytest.mark.parametrize("quality", [0.05, 0.2, 1.0])
@pytest.mark.parametrize("name", ["birch", "conifer", "palm"])
def test_plants_keep_their_height_and_width(name: str, quality: float) -> None:
    """Where their surface lies, over the same few seeds."""
    assert extents(name, quality) == pytest.approx(extents(name, 0.5), rel=0.12)


def limb_bark(species: Species) -> float:
    """Area of the tubes of all limbs, over the trunk's length and their taper: number, length, and perimeter."""
    trunk, limb, *_ = species.orders
    perimeter = 2.0 * limb.sides * math.sin(math.pi / limb.sides) * trunk.thickness.mean * limb.thickness.mean
    return expected_members(species).branches[1] * limb.length.mean * perimeter


@pytest.mark.parametrize("quality", [0.1, 0.4, 3.0])
@pytest.mark.parametrize("name", ["conifer", "spruce", "palm", "aspen"])
def test_fewer_and_shorter_limbs_show_as_much_bark(name: str, quality: float) -> None:
    """They are thicker; of fewer sides as well."""
    assert limb_bark(with_quality(kind(name), quality)) == pytest.approx(limb_bark(kind(name)), rel=0.005)


def test_bent_branches_end_where_they_did() -> None:
    """A trunk of other segments leans aside as far: by its curvature on the mean, and by chance as much."""
    data = support.small(order0={"curvature": [50, 0], "curvature_tip": 80, "angle": [0, 0], "segments": 8})
    swaying = support.small(order0={"curvature": [0, 40], "angle": [0, 0], "segments": 8})
    for file, tolerance in ((data, 0.1), (swaying, 0.15)):
        species = species_from_dict(file, "s", "s.json")
        aside = []
        for quality in (0.4, 1.0, 3.0):
            rows = build_rows([with_quality(species, quality)])
            trunks = support.trunks(rows, support.plants(np.arange(400)))
            tips = axes(rows, trunks).knots[:, -1] / trunks.length[:, None]
            aside.append(np.sqrt((tips[:, :2] ** 2).sum(1).mean()))
        assert aside == pytest.approx([aside[1]] * 3, rel=tolerance)


@given(quality=st.floats(math.log(0.3), math.log(20)).map(math.exp))
@settings(max_examples=15, deadline=None)
def test_forks_short_shoots_and_the_pipe_model(quality: float) -> None:
    data = support.small(
        order0={"forks": [2, 0.5], "fork_at": 0.4, "pipe": 2.3, "flare": 0.5},
        order1={"attraction": [40, 10], "spurs": [3, 1]},
        spur={"length": [0.05, 0.01], "thickness": [0.1, 0], "leaves": [4, 1], "leaf_kind": "blossom"},
        blossom={"model": "round"},
    )
    before = species_from_dict(data, "s", "s.json")
    after = with_quality(before, quality)
    assert expected_polygons(after) == pytest.approx(quality * expected_polygons(before), rel=TOLERANCE)
    assert leaf_area(after) == pytest.approx(leaf_area(before), rel=0.05)
    assert after.quality == 1
    # The pipe model itself divides a stem's section among its limbs.
    assert after.orders[1].thickness == before.orders[1].thickness


@pytest.mark.parametrize("quality", [0.0, -1.0, 0.00009, 1001.0, math.inf, math.nan])
def test_what_a_quality_may_be(quality: float) -> None:
    with pytest.raises(SpeciesError, match=r"oak: quality must be from 0\.0001 to 1000"):
        with_quality(kind("oak"), quality)


def test_what_cannot_be_reached_is_said() -> None:
    with pytest.raises(SpeciesError, match=r"the limit is 2e\+07; lower the quality"):
        with_quality(kind("oak"), QUALITY_LIMITS[1])
