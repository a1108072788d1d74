# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Planes of the faces of leaves: facets lie in one of them each, drawn in proportion to their areas.

A leaf that is folded along its midrib shows less to the sky than a flat one and scatters more light aside, and a spray
of needles has no plane at all. Facets in the plane of a leaf's own axes made beeches a quarter too bright from above.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..arrays import perpendicular
from ..compiled.flora import Flora

#: Planes of each kind of leaf: quantiles of the areas of its faces.
_PLANES = 32


@lru_cache(maxsize=8)
def leaf_planes(flora: Flora) -> NDArray[np.float64]:
    """Rotations (r, `_PLANES`, 3, 3) from axes of a face to those of the leaf that each row's own branch bears.

    The third axis is the normal of the face, the second as near as may be to the leaf's midrib. Each stands for the
    same area.
    """
    rows = flora.rows
    own = np.stack([rows["species"], rows["leaf_kind"]], axis=1)
    kinds, kind = np.unique(own, axis=0, return_inverse=True)
    return np.array([_planes_of(flora, s, k) for s, k in kinds.tolist()])[kind.ravel()]


def _planes_of(flora: Flora, species: int, kind: int) -> NDArray[np.float64]:
    """Rotations (`_PLANES`, 3, 3) of a kind of leaves of a species."""
    vectors = np.concatenate([np.zeros((0, 3)), *(model.face_vectors for model in flora.forms[species][kind])])
    areas = np.linalg.norm(vectors, axis=1)
    if areas.sum() <= 0.0:
        return np.tile(np.eye(3), (_PLANES, 1, 1))
    # Faces that are turned alike lie side by side, so that quantiles tell them apart.
    normals = vectors / np.maximum(areas, 1e-300)[:, None]
    order = np.lexsort(np.round(normals, 6).T)
    share = np.cumsum(areas[order]) / areas.sum()
    normal = normals[order[np.searchsorted(share, (np.arange(_PLANES) + 0.5) / _PLANES)]]
    along = np.array([0.0, 1.0, 0.0]) - normal[:, 1:2] * normal
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.where(length > 1e-6, along / np.maximum(length, 1e-6), perpendicular(normal))
    return np.stack([np.cross(along, normal), along, normal], axis=2)
