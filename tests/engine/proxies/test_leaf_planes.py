# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Facets are turned as the faces of the leaves that they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.compiled.orientation import leaf_moments
from tetflora_addon.growth.growth import trunks
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.proxies.microsurfaces import FacetRules, subplant_facets
from tetflora_addon.species.catalog import load_species

SPECIES = ("beech", "oak", "palm", "willow", "spruce")


@pytest.mark.parametrize("identifier", SPECIES)
def test_planes_are_rotations_and_as_the_faces_of_leaves(identifier: str) -> None:
    flora = compile_species([load_species(identifier)])
    planes = flora.face_planes
    assert np.allclose(planes @ planes.swapaxes(2, 3), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(planes), 1.0)
    for row, kind in enumerate(flora.rows["leaf_kind"].tolist()):
        models = flora.forms[0][kind]
        areas = np.array([model.area for model in models])
        moment = np.einsum("f,fij->ij", areas / areas.sum(), np.array([model.moment for model in models]))
        normal = planes[row, :, :, 2]
        assert np.abs(np.einsum("ni,nj->ij", normal, normal) / len(normal) - moment).max() < 0.05


@pytest.mark.parametrize("identifier", ["beech", "willow", "aspen"])
def test_facets_are_turned_as_the_leaves_of_the_compiled_plant(identifier: str) -> None:
    flora = compile_species([load_species(identifier)])
    n = 4
    seeds = Seeds(
        (identifier,), np.zeros(n, np.int32), np.arange(n), np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), np.ones(n)
    )
    plants = trunks(flora.rows, seeds)
    facets = subplant_facets(flora, plants, FacetRules(np.full(n, 0.2), np.full(n, 1e6)))
    area, normal = facets.side**2, facets.normal
    found = np.einsum("n,ni,nj->ij", area, normal, normal) / area.sum()
    expected = leaf_moments(flora.orientation, plants).mean(axis=0)
    assert np.abs(found - expected / np.trace(expected)).max() < 0.03
