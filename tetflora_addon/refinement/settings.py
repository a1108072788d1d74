# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user decides about refinement."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class RefinementSettings:
    """Limits of the loop of visibility, refinement and update.

    Attributes
    ----------
    cutoff : float
        Side, in pixels of the final picture, under which a tetrahedron gains nothing from being split (section 6.4).
    leaf_limit : float
        Width in pixels from which on some leaves are real; from 2.5 times that on all are, see `transition`.
    block : float
        Side, in pixels, from which on a visible tetrahedron is split further although all in it will become polygons,
        so that hidden parts can be told from visible ones.
    few_polygons : int
        A tetrahedron that holds fewer polygons than this gains nothing from being split.
    hidden : float
        Mean visibility, 0 to 1, under which a tetrahedron counts as hidden.
    hidden_block : float
        Longest edge, in pixels at its depth, down to which hidden tetrahedra are divided. Facets take their places from
        the plants, so that they need no such limit; a shell fills its whole tetrahedron and does.
    proxy_block : float
        The same for proxies that are seen.
    margin : float
        Share of the picture's width and height by which the view is widened on each side: leaves that grow outside but
        reach in are real leaves.
    visibility_resolution : int
        Longer side of the alpha buffer, pixels.
    max_tetrahedra : int
        Refinement stops before it makes more.
    max_levels : int
        Generations of bisection at most.
    max_passes : int
        Passes of the loop at most, to show the state after each; 0 for no limit.
    facet : float
        Side of the facets of proxies, pixels.
    max_polygons : int
        Polygons that may be made in all, facets included; 0 for no limit.
    anchored : bool
        The tetrahedra stay where they are in the world while the camera moves, see `tetrahedra.world_root`; otherwise
        they begin with the view. Panoramas are always anchored.
    shadow_cutoff : float
        Side, in pixels where it falls, under which the shadow of what is hidden gains nothing from being finer, see
        `lights`; 4 is fine enough. With 0 shadows are as coarse as what is hidden.
    max_memory : float
        Gigabytes that they may take in Blender and a renderer together, about; 0 for no limit.
    """

    cutoff: float = 2.0
    leaf_limit: float = 0.4
    block: float = 32.0
    few_polygons: int = 200
    hidden: float = 0.02
    hidden_block: float = math.inf
    proxy_block: float = math.inf
    margin: float = 0.04
    visibility_resolution: int = 256
    max_tetrahedra: int = 400_000
    max_levels: int = 60
    max_passes: int = 0
    facet: float = 0.33
    max_polygons: int = 0
    max_memory: float = 0.0
    anchored: bool = False
    shadow_cutoff: float = 0.0


#: What the qualities of the panel stand for.
QUALITIES: dict[str, dict[str, float]] = {
    "DRAFT": {"cutoff": 6.0, "leaf_limit": 1.6, "facet": 1.2, "visibility_resolution": 128},
    "PREVIEW": {"cutoff": 3.0, "leaf_limit": 0.8, "facet": 0.7, "visibility_resolution": 192},
    "FINAL": {"cutoff": 2.0, "leaf_limit": 0.4, "facet": 0.33, "visibility_resolution": 256},
}
