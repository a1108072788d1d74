# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines in species files: what they may be, and what is said of those that may not."""

from __future__ import annotations

from typing import Any

import pytest

from tests.engine import support
from tetflora_addon.errors import SpeciesError
from tetflora_addon.leaves.levels import leaf_levels
from tetflora_addon.leaves.models import _PAGES, LEAF_MODELS, LeafModel
from tetflora_addon.leaves.outlines import Blade
from tetflora_addon.leaves.surfaces import Compound, Needles
from tetflora_addon.species.catalog import species_from_dict


def leaf(data: Any) -> LeafModel:
    """The leaf of a species file with this leaf."""
    return species_from_dict({**support.SMALL, "leaf": data}, "s", "s.json").leaf[0]


@pytest.mark.parametrize("name", LEAF_MODELS)
def test_built_in_leaves_are_those_of_species_files(name: str) -> None:
    assert leaf({key: value for key, value in _PAGES[name].items() if key != "about"}) == LEAF_MODELS[name]


def test_outlines_are_read() -> None:
    """Beside a model or vertices, which stay what they are, or alone."""
    own = {"width": 0.3, "lobes": 3, "base": "cordate"}
    with_model = leaf({"model": "lobed", "outline": own})
    assert with_model.content == LEAF_MODELS["lobed"].content
    assert with_model.shape == Blade(width=0.3, lobes=3, base="cordate") != LEAF_MODELS["lobed"].shape
    square = {"vertices": [[-0.2, 0, 0], [0.2, 0, 0], [0.2, 1, 0], [-0.2, 1, 0]], "faces": [[0, 1, 2, 3]]}
    polygons = leaf({**square, "outline": {"kind": "needles", "needles": 40, "bundle": 2}})
    assert polygons.polygons == 1
    assert polygons.shape == Needles(needles=40, bundle=2)
    compound = leaf({"outline": {"kind": "compound", "pairs": 3, "leaflet": {"width": 0.4}}})
    assert compound.shape == Compound(pairs=3, leaflet=Blade(width=0.4))
    for made in (with_model, polygons, compound):
        assert len(leaf_levels(made)) >= 2
    assert leaf(square).shape is None


def test_outlines_tell_species_apart() -> None:
    """What is compiled for one is not taken for the other; tables that are measured from afar are."""
    one, other = (leaf({"model": "lobed", "outline": {"lobes": n}}) for n in (3, 4))
    assert one != other
    assert one.content == other.content


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        ({"width": 9}, r"leaf\.outline\.width: must be from 0\.005 to 2, not 9"),
        ({"wdith": 0.3}, r'leaf\.outline\.wdith: unknown key; did you mean "width"'),
        ({"base": "pointed"}, r"leaf\.outline\.base: must be one of attenuate, cuneate, rounded, truncate, cordate"),
        ({"teeth": 2.5}, r"leaf\.outline\.teeth: must be a whole number, not 2\.5"),
        ({"teeth": "many"}, r"leaf\.outline\.teeth: must be a number from 0 to 60"),
        ({"kind": "flower"}, r"leaf\.outline\.kind: must be one of blade, needles, compound, not"),
        ({"kind": "needles", "width": 0.3}, r"leaf\.outline\.width: unknown key"),
        ({"lobing": "palmate", "lobes": 2}, r"leaf\.outline\.lobes: must be 0, or 3 to 12 with palmate lobes, not 2"),
        ({"kind": "compound", "leaflet": {"kind": "needles"}}, r"leaf\.outline\.leaflet\.kind: must be blade"),
        ({"kind": "compound", "leaflet": {"curl": -7}}, r"leaf\.outline\.leaflet\.curl: must be from -1 to 1"),
        ({"kind": "compound", "pairs": 0, "terminal": 0}, r"leaf\.outline\.pairs: must be at least 1"),
        ([], r"leaf\.outline: must be an object"),
    ],
)
def test_mistakes_are_named(outline: Any, message: str) -> None:
    with pytest.raises(SpeciesError, match=message):
        leaf({"model": "lobed", "outline": outline})


def test_objects_have_no_outline() -> None:
    with pytest.raises(SpeciesError, match=r"leaf\.outline: must be left out where the leaf is an object"):
        leaf({"object": "Leaf", "outline": {}})
    with pytest.raises(SpeciesError, match="or an outline"):
        leaf({"faces": []})


def test_outlines_that_cross_themselves_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rays never meet within what plants have; what is beyond is found by looking at the line."""
    wild = {"width": 2, "widest": 0.1, "base": "truncate", "teeth": 60, "tooth_size": 0.15, "tooth": "serrate"}
    monkeypatch.setattr("tetflora_addon.leaves.surfaces.crossings", lambda points: 1)
    with pytest.raises(SpeciesError, match=r"leaf\.outline: the outline crosses itself; use a smaller tooth_size"):
        leaf({"model": "lobed", "outline": wild})
