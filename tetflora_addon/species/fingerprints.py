# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fingerprints of species: they identify what was measured of one, in tables and in the cache folder."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..leaves.models import LeafModel

#: Fields that depend on what other species there are, one that others give, and one that changes no area.
_PLACES = {"species", "next", "drawn_rows", "sunlit", "dead"}
#: Fields that came later, with the values that change nothing: species without them keep their fingerprint.
_LATER: dict[str, Callable[[NDArray[np.void]], NDArray[np.float64] | float]] = {
    "leaf_light_tip": lambda rows: rows["leaf_light"][:, 0],
    "leaf_size_young": lambda _: 1.0,
    "leaf_colour_young": lambda rows: rows["leaf_colour"][:, 0],
    "envelope": lambda _: 0.0,
    "envelope_radius": lambda _: 0.0,
    "inclination": lambda _: 0.0,
    **{name: lambda _: 0.0 for name in ("growing", "settled", "conical", "ramps", "least")},
}
#: Sorts of children in the first tables that were kept; others count where a species has them.
_FIRST_SORTS = 3


def fingerprint(rows: NDArray[np.void], forms: Sequence[Sequence[LeafModel]], method: int) -> str:
    """Hash of a species' parameters and the forms of its leaves: 16 hexadecimal digits.

    Parameters
    ----------
    rows : (r,) parameter table
        Of this species alone.
    forms : by kind
        Models of leaves.
    method : int
        Counts the ways in which results were found so far.
    """
    content = hashlib.sha256(f"{method}".encode())
    unused = {name for name, neutral in _LATER.items() if (rows[name] == neutral(rows)).all()}
    for name in sorted(set(rows.dtype.names) - _PLACES - unused):
        # Rounded, because versions of numpy may differ in the last digit.
        value = np.round(rows[name].astype(np.float64), 6) + 0.0
        if name in ("count", "start", "fraction") and not (rows["next"][:, _FIRST_SORTS:] >= 0).any():
            value = value[:, :_FIRST_SORTS]
        content.update(name.encode() + np.ascontiguousarray(value).tobytes())
    for form in (model for models in forms for model in models):
        content.update(np.ascontiguousarray(form.positions).tobytes())
        content.update(np.ascontiguousarray(form.corner_verts).tobytes())
    return content.hexdigest()[:16]
