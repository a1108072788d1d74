# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Spines stand on closed parts of a leaf, apart from each other, and only up close."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.engine import support
from tests.engine.leaves.test_bodies import CORNERS, SIDES
from tetflora_addon.errors import SpeciesError
from tetflora_addon.leaves.levels import leaf_levels
from tetflora_addon.species import catalog
from tetflora_addon.species.catalog import species_from_dict

BODY = {"vertices": (CORNERS * [0.3, 0.5, 0.2] + [0, 0.5, 0]).tolist(), "faces": SIDES}


def species(**leaf: Any) -> Any:
    return species_from_dict(support.small(leaf=leaf), "cactus", "cactus.json")


def test_only_the_finest_level_has_spines() -> None:
    """All others, and the model itself, are those of a leaf without."""
    bare, spiny = species(**BODY).leaf[0], species(**BODY, spines={"number": 3}).leaf[0]
    assert bare != spiny and hash(bare) != hash(spiny)
    assert bare.content == spiny.content
    *coarser, last = leaf_levels(spiny)
    *others, plain = leaf_levels(bare)
    for one, other in zip(coarser, others, strict=True):
        np.testing.assert_array_equal(one.shapes, other.shapes)
        assert (one.tint == 1).all()
    more = last.model.polygons - plain.model.polygons
    assert more > 0 and more % (5 + 3 * 3) == 0  # a cushion and three spines each
    assert len(last.tint) == last.model.polygons
    np.testing.assert_array_equal(last.shapes[0, : plain.shapes.shape[1]], plain.shapes[0])
    assert (last.tint[: plain.model.polygons] == 1).all() and (last.tint[plain.model.polygons :, 0] > 1).all()


def test_spines_stand_out_and_apart() -> None:
    """Tips lie off the pad by about their length, none beyond what bounds know; areoles keep their distance."""
    model = catalog.load_species("prickly_pear").leaf[0]
    last = leaf_levels(model)[-1]
    assert last.model.reach <= model.reach * (1 + 1e-9)
    faces = last.model.corner_verts.reshape(-1, 3)
    tips = last.model.positions[np.unique(faces[(last.tint[:, 0] > 3), 2])]
    assert np.abs(tips[:, 2]).max() > 0.045 + 0.3 * model.spines.length
    felt = faces[(last.tint[:, 0] > 1) & (last.tint[:, 0] < 3)]
    tops = last.model.positions[felt[:, 2]][::5]
    away = np.linalg.norm(tops[:, None] - tops[None], axis=2) + np.eye(len(tops))
    assert len(tops) > 50
    assert away.min() > 0.7 * model.spines.distance


@pytest.mark.parametrize("number", [2, 3, 5])
def test_spines_of_an_areole_stand_all_around_it(number: int) -> None:
    """No gap between neighbors is much wider than if they were spread evenly."""
    model = species(**BODY, spines={"number": number, "length": 0.02}).leaf[0]
    last = leaf_levels(model)[-1]
    faces = last.model.positions[
        last.model.corner_verts[last.model.face_offsets[-1] - 3 * (last.tint != 1).any(axis=1).sum() :]
    ]
    felt, needles = np.split(faces.reshape(-1, 3, 3), [len(faces) // 3 * 5 // (5 + 3 * number)])
    felt, needles = felt.reshape(-1, 5, 3, 3), needles.reshape(-1, number, 3, 3, 3)
    normal = felt[:, 0, 2] - felt[:, :, 0].mean(axis=1)
    x = felt[:, 0, 0] - felt[:, :, 0].mean(axis=1)
    x -= (x * normal).sum(axis=1, keepdims=True) / (normal**2).sum(axis=1, keepdims=True) * normal
    y = np.cross(normal, x) / np.linalg.norm(normal, axis=1, keepdims=True)
    way = needles[:, :, 0, 2] - needles[:, :, :, 0].mean(axis=2)
    turn = np.sort(np.arctan2((way * y[:, None]).sum(axis=2), (way * x[:, None]).sum(axis=2)), axis=1)
    gap = np.diff(turn, append=turn[:, :1] + 2 * np.pi, axis=1)
    inner = np.linalg.norm(needles[:, :, 0, 2], axis=-1).max(axis=1) < 0.98 * model.reach  # others are cut there
    assert inner.sum() > 20
    assert gap[inner].max() < 1.4 * 2 * np.pi / number


@pytest.mark.parametrize(
    ("leaf", "part"),
    [
        ({**BODY, "spines": {"number": 0}}, "leaf.spines.number: must be from 1 to 12"),
        ({**BODY, "spines": {"number": 1.5}}, "leaf.spines.number: must be a whole number"),
        ({**BODY, "spines": {"lengths": 1}}, "leaf.spines.lengths: unknown key"),
        ({**BODY, "spines": 3}, "leaf.spines: must be an object"),
        ({"vertices": BODY["vertices"], "faces": SIDES[:4], "spines": {}}, "leaf.spines: must be left out"),
        ({"model": "kite", "spines": {}}, "leaf.spines: must be left out"),
    ],
)
def test_mistakes(leaf: dict[str, Any], part: str) -> None:
    with pytest.raises(SpeciesError) as caught:
        species(**leaf)
    assert part in str(caught.value)
