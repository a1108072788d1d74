# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Microspheres: the facets of microsurfaces as opaque spheres, the particles of the paper's volumes (paper, section 7).

A facet covers the more the more it faces the eye, a sphere covers the same from everywhere. So a sphere can take over
what its facet covers as the camera sees it, but not from all lights as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..buffers import PointBuffers
from ..refinement.camera import Camera
from .microsurfaces import Facets, concatenate_facets

#: Least share of a facet's area that its sphere covers, where the facet is seen from its edge.
LEAST_COVER = 0.1
#: Mean of |cos| over all directions.
MEAN_COVER = 0.5


def spheres(parts: Sequence[tuple[Facets, bool]], camera: Camera, disc: float = np.pi) -> PointBuffers:
    """Spheres in the place of facets, one each, with their colours and transmission.

    Parameters
    ----------
    parts : sequence of (Facets, bool)
        Facets, n in all, and whether the camera sees them. Spheres of those cover what facets cover for it, others what
        facets cover as a mean over all directions: they only cast shadows and light up others.
    camera : Camera
    disc : float
        Area that a renderer draws for a sphere of radius 1; some draw fewer pixels than there are in a circle.

    Returns
    -------
    PointBuffers of n
        With ``tf_colour`` and ``tf_transmission``, and ``velocity`` where facets have one.
    """
    cover = np.concatenate([cover_of(facets, camera if seen else None) for facets, seen in parts])
    facets = concatenate_facets([facets for facets, _ in parts])
    return PointBuffers(
        positions=facets.centre.astype(np.float32),
        radius=(facets.side * np.sqrt(cover / disc)).astype(np.float32),
        attributes={
            "tf_colour": facets.colour.astype(np.float32),
            "tf_transmission": facets.transmission.astype(np.float32),
            **({} if facets.velocity is None else {"velocity": facets.velocity.astype(np.float32)}),
        },
    )


def cover_of(facets: Facets, camera: Camera | None) -> NDArray[np.float64]:
    """Share (n,) of a facet's area that its sphere covers; without a camera, the mean over all directions."""
    if camera is None:
        return np.full(len(facets), MEAN_COVER)
    return np.maximum(facing(facets, camera), LEAST_COVER)


def facing(facets: Facets, camera: Camera) -> NDArray[np.float64]:
    """Share (n,) of its area that each facet shows to the camera, 0 to 1."""
    if camera.kind == "ORTHO":
        return np.abs(facets.normal @ camera.frame[:, 2])
    ray = facets.centre - camera.eye
    return np.abs(np.einsum("ni,ni->n", facets.normal, ray)) / np.maximum(np.linalg.norm(ray, axis=1), 1e-300)
