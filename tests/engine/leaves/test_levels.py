# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Finer levels of leaves: the area of their model, errors that hold, and the coarsest that suffices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tetflora_addon.leaves.levels import (
    TOLERANCES,
    LeafLevel,
    _finer,
    chosen_level,
    coarse_error,
    fitted,
    hidden_gloss,
    leaf_levels,
    level_errors,
    surface_of,
)
from tetflora_addon.leaves.models import LEAF_MODELS, LeafModel, mean_silhouette
from tetflora_addon.leaves.outlines import distance_to_links
from tetflora_addon.leaves.surfaces import SPARSE, Needles
from tetflora_addon.optics import GLOSS
from tetflora_addon.species import catalog
from tetflora_addon.species.species import LEAF_KINDS

#: Polygons that no level has.
MOST = 4000


def single_edges(model: LeafModel) -> np.ndarray:
    """Edges (e, 2) of one face only."""
    edges, of_corner = model.edges
    return edges[np.bincount(of_corner, minlength=len(edges)) == 1]


def one_sided(level: LeafLevel, variant: int, solid: np.ndarray) -> float:
    model = replace(level.model, positions=level.shapes[variant].astype(float))
    return float((np.linalg.norm(model.face_vectors, axis=1) * np.where(solid, 0.5, 1.0)).sum())


@pytest.mark.parametrize("name", LEAF_MODELS)
def test_models_are_what_they_were(name: str) -> None:
    """What stands for leaves from afar, and what tables are stored by, does not know of finer levels."""
    coarse = replace(LEAF_MODELS[name], shape=None)
    assert LEAF_MODELS[name].content == coarse.content
    assert LEAF_MODELS[name] != coarse
    assert leaf_levels(coarse) == ()
    assert (chosen_level(coarse, np.array([0.0, 1e9])) == 0).all()


@pytest.mark.parametrize("name", LEAF_MODELS)
def test_levels_have_the_area_of_their_model(name: str) -> None:
    model = LEAF_MODELS[name]
    for level in leaf_levels(model):
        made = fitted(model.shape, level.error, model.area, model.reach)
        if not isinstance(model.shape, Needles):
            np.testing.assert_allclose(made.areas(), model.area, rtol=1e-5)
    assert len(leaf_levels(model)) >= 3


@pytest.mark.parametrize("species", ["scots_pine", "silver_fir", "spruce"])
def test_needles_hide_as_much_as_the_polygons_that_stand_for_them(species: str) -> None:
    """From any side on average, though needles hide each other: bundles, sprays and brushes are no denser from afar."""
    (model,) = catalog.load_species(species).leaf
    for level in leaf_levels(model)[:2]:
        assert 2.0 * mean_silhouette(level.model) == pytest.approx(model.area, rel=0.03)
        assert level.model.area > 1.1 * model.area


@pytest.mark.parametrize("name", catalog.list_species())
def test_what_counts_as_wide_shows_as_much(name: str) -> None:
    """Leaves are drawn one by one from a width on: were it the reach of needles, shoots would be far too many."""
    species = catalog.load_species(name)
    for form in (form for kind in LEAF_KINDS for form in species.forms(kind) if isinstance(form, LeafModel)):
        assert form.shown_area >= 0.75 * form.width**2


@pytest.mark.parametrize("name", LEAF_MODELS)
def test_levels_are_sound(name: str) -> None:
    """Finer and finer, of faces with an area, whose edges have one or two of them, and within reach of the image."""
    model = LEAF_MODELS[name]
    errors = level_errors(model)
    polygons = np.array([model.polygons, *(level.model.polygons for level in leaf_levels(model))])
    assert (np.diff(errors) < 0).all()
    assert (np.diff(polygons) > 0).all()
    assert leaf_levels(model)[-1].error <= 0.0005
    assert polygons[-1] <= MOST
    for level in leaf_levels(model):
        for shape in level.shapes:
            made = replace(level.model, positions=shape.astype(float))
            areas = np.linalg.norm(made.face_vectors, axis=1)
            assert areas.min() > 0
            assert (areas > 1e-12 * model.area).mean() > 0.99
        assert np.bincount(level.model.edges[1]).max() <= 2
        assert np.isfinite(level.model.uv).all()
        assert level.shapes.shape[0] >= 4
        assert np.linalg.norm(level.shapes, axis=2).max() <= 1.02 * model.reach  # what bounds count on
        assert not np.array_equal(level.shapes[0], level.shapes[1])


@pytest.mark.parametrize("name", [n for n, m in LEAF_MODELS.items() if not isinstance(m.shape, Needles)])
def test_margins_are_within_their_errors(name: str) -> None:
    """Measured from each variant's margin at a tolerance that is far finer."""
    model = LEAF_MODELS[name]
    finest = surface_of(model.shape, 2e-4)
    fine = LeafModel(finest.positions[0], finest.corner_verts, finest.face_offsets, finest.uv.astype(np.float32))
    # Petioles and stems, whose texture lies below that of blades, are not in the coarsest levels.
    true = np.setdiff1d(single_edges(fine), fine.corner_verts[fine.uv[:, 1] < -1e-6])
    for level in leaf_levels(model)[:-1]:
        made = surface_of(model.shape, level.error)
        coarse = LeafModel(made.positions[0], made.corner_verts, made.face_offsets, made.uv.astype(np.float32))
        own = single_edges(coarse)
        for variant in range(0, len(made.positions), 2):
            points, ends = finest.positions[variant][true], made.positions[variant][own]
            off = distance_to_links(points[:, None], ends[None, :, 0], ends[None, :, 1]).min(axis=1)
            assert off.max() <= 1.05 * made.error + 2e-4


@given(st.sampled_from(sorted(LEAF_MODELS)), st.floats(1e-3, 1e5))
def test_the_coarsest_level_that_suffices_is_chosen(name: str, length: float) -> None:
    model = LEAF_MODELS[name]
    errors = level_errors(model)
    level = int(chosen_level(model, np.array([length]))[0])
    assert errors[level] * length <= 1.0 + 1e-9
    assert level == 0 or errors[level - 1] * length > 1.0


@pytest.mark.parametrize("name", ["kite", "needles"])
def test_stems_have_a_tint(name: str) -> None:
    """Petioles and shoots, and nothing else: what lies below the blade in the texture; needles are all as bright."""
    level = leaf_levels(LEAF_MODELS[name])[-1]
    low = np.minimum.reduceat(level.model.uv[:, 1], level.model.face_offsets[:-1])
    brown = np.ptp(level.tint, axis=1) > 0.0
    assert (brown == (low < -1e-6)).all()
    assert 0.001 < brown.mean() < 0.2
    assert (level.tint[~brown] == 1.0).all()
    assert (level.again[brown] == 0.0).all() and (level.again[~brown] > 0.2).all() == (name == "needles")


@pytest.mark.parametrize("number", [1, 2, 3])
def test_shoots_are_as_bright_as_the_polygons_that_stand_for_them(number: int) -> None:
    """What their needles scatter meets others as often as these hide each other."""
    level = leaf_levels(LEAF_MODELS["needles"], number)[number - 1]
    needles, shoots = level.again > 0.0, np.random.default_rng(3).random((20, 1, 3), np.float32)
    shown = 2.0 * mean_silhouette(level.model)
    color = np.repeat(shoots, level.model.polygons, axis=1)
    one, p = level.colors(color)[:, needles], level.again[needles].max()
    one = (1.0 - GLOSS) * one + GLOSS  # all that a needle sends on
    mirrored = GLOSS * (1.0 - p)
    assert one * (1.0 - p) / (1.0 - p * one) == pytest.approx((1 - mirrored) * color[:, needles] + mirrored, abs=1e-4)
    areas = np.linalg.norm(level.model.face_vectors, axis=1)  # of closed things both sides are there
    assert 1.0 - p == pytest.approx(shown / np.where(needles & (not level.solid), areas, areas / 2).sum(), rel=0.02)


def test_coarse_shoots_lack_the_gloss_that_needles_hide_from_each_other() -> None:
    model = LEAF_MODELS["needles"]
    assert hidden_gloss(model) == pytest.approx(leaf_levels(model, 2)[1].again.max(), abs=0.01)
    assert hidden_gloss(LEAF_MODELS["kite"]) == 0.0


def test_needles_are_as_many_as_they_should_be() -> None:
    """From the second finer level on each stands for itself: a prism with its own texture up close."""
    shape = LEAF_MODELS["needles"].shape
    for tolerance, sides in ((0.012, 1), (0.0015, 3), (0.0002, 4)):
        made = surface_of(shape, tolerance)
        tips = np.isclose(made.uv[:, 1], 1.0) & np.isclose(made.uv[:, 0], 0.5)
        assert tips.sum() // sides >= shape.needles // shape.bundle


def test_before_all_needles_there_are_some() -> None:
    """Each is broader for several; their tips are those of some of them."""
    shape = LEAF_MODELS["needles"].shape
    few, every = surface_of(shape, 2.0 * SPARSE), surface_of(shape, TOLERANCES[0])
    assert few.polygons < every.polygons / 4
    level = leaf_levels(LEAF_MODELS["needles"])[0]
    assert level.model.polygons == few.polygons and level.error > shape.gap
    tips = [made.positions[0][np.unique(made.corner_verts[np.isclose(made.uv[:, 1], 1.0)])] for made in (few, every)]
    away = np.linalg.norm(tips[0][:, None] - tips[1], axis=2).min(axis=1)
    assert 10 < len(tips[0]) < len(tips[1]) / 2 and away.max() < 1e-9


@pytest.mark.parametrize("name", [name for name, model in LEAF_MODELS.items() if model.shape is not None])
def test_levels_are_made_as_far_as_they_are_asked_for(name: str) -> None:
    """Which one is chosen does not depend on which ones there were before."""
    model = LEAF_MODELS[name]
    every = level_errors(model)
    _finer.cache_clear()
    for pixels in (20.0, 60.0, 400.0) if name == "needles" else (20.0, 400.0, 5000.0):  # the last takes seconds there
        chosen = int(chosen_level(model, np.array([pixels]))[0])
        assert chosen == int(np.searchsorted(-every, -1.0 / pixels))
        known = level_errors(model, 1.0 / pixels)
        np.testing.assert_array_equal(known, every[: len(known)])


def test_leaflets_that_close_up_are_one_surface_from_afar() -> None:
    """A frond of moss is its outline until gaps between leaflets can be seen, though they are deeper than wide."""
    model = catalog.load_species("moss").leaf[0]
    gap = (model.shape.last - model.shape.first) / (model.shape.pairs - 1)
    assert coarse_error(model) < 1.3 * gap
