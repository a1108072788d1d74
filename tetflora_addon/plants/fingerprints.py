# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A short text that tells a species from all others, under which results about it are kept."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .leaf_models import LeafModel

#: Fields that depend on what other species there are.
_PLACES = {"species", "next", "drawn_rows"}


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
    for name in sorted(set(rows.dtype.names) - _PLACES):
        # Rounded, because versions of numpy may differ in the last digit.
        value = np.round(rows[name].astype(np.float64), 6) + 0.0
        content.update(name.encode() + np.ascontiguousarray(value).tobytes())
    for form in (model for models in forms for model in models):
        content.update(np.ascontiguousarray(form.positions).tobytes())
        content.update(np.ascontiguousarray(form.corner_verts).tobytes())
    return content.hexdigest()[:16]
