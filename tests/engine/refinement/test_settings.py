# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings: a first look is coarser than what it is a first look at, whatever the artist has chosen."""

from __future__ import annotations

from dataclasses import fields

from hypothesis import given
from hypothesis import strategies as st

from tetflora_addon.refinement.settings import QUALITIES, RefinementSettings

_LARGER = ("cutoff", "leaf_limit", "facet")
_SMALLER = ("visibility_resolution", "max_tetrahedra")
_KEPT = ("max_polygons", "max_memory", "hidden", "margin", "block")


def _settings():
    return st.builds(
        RefinementSettings,
        cutoff=st.floats(0.25, 1000.0),
        leaf_limit=st.floats(0.05, 1000.0),
        facet=st.floats(0.1, 100.0),
        block=st.floats(1.0, 10_000.0),
        visibility_resolution=st.integers(16, 4096),
        max_tetrahedra=st.integers(100, 2_000_000),
        max_polygons=st.integers(0, 10**8),
        max_memory=st.floats(0.0, 256.0),
    )


@given(_settings())
def test_a_first_look_is_coarser(settings):
    """And its pixels are larger as well."""
    first = settings.first_look()
    assert all(getattr(first, name) >= getattr(settings, name) for name in _LARGER)
    assert all(getattr(first, name) <= getattr(settings, name) for name in _SMALLER)
    assert all(getattr(first, name) == getattr(settings, name) for name in _KEPT)
    for quality in QUALITIES.values():
        assert all(getattr(first, name) >= quality[name] for name in _LARGER)


def test_qualities_name_settings():
    names = {field.name for field in fields(RefinementSettings)}
    assert all(set(quality) <= names for quality in QUALITIES.values())
