# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user decides about refinement."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ..setting import setting


@dataclass(frozen=True)
class RefinementSettings:
    """Limits of the loop of visibility, refinement and update.

    Fields with a label are properties of a scene, and documented by their tooltips. Sizes are in pixels of the final
    image. With ``anchored``, tetrahedra begin with `tetrahedra.world_root` instead of the view.

    Attributes
    ----------
    hidden_block : float
        Longest edge, in pixels at its depth, down to which hidden tetrahedra are divided. Facets take their places from
        the plants, so that they need no such limit; a shell fills its whole tetrahedron and does.
    proxy_block : float
        The same for proxies that are seen; infinite for facets, which need no finer tetrahedra than their visibility.
    margin : float
        Fraction of the image's width and height by which the view is widened on each side: leaves that grow outside
        but reach in are real leaves.
    """

    cutoff: float = setting(
        2.0,
        "Cutoff",
        "Tetrahedra smaller than this many pixels are not split further. Smaller values give finer results and take "
        "longer; 1 to 4 pixels are hard to tell apart",
        subtype='PIXEL',
        min=0.25,
        soft_min=0.5,
        soft_max=16.0,
        max=1000.0,
    )
    leaf_limit: float = setting(
        0.6,
        "Leaf Limit",
        "Leaves narrower than this become facets; up to 2.5 times this width, a growing fraction stays real. About "
        "half the facet size; below that, leaves cost more polygons than facets",
        subtype='PIXEL',
        min=0.05,
        soft_max=4.0,
        max=1000.0,
    )
    block: float = setting(
        32.0,
        "Block Size",
        "Visible tetrahedra larger than this are always split, even where all their contents become polygons, to find "
        "hidden parts. Smaller values find more of them and take longer",
        subtype='PIXEL',
        min=1.0,
        soft_max=256.0,
        max=10_000.0,
    )
    few_polygons: int = setting(
        200,
        "Split Threshold",
        "Tetrahedra holding fewer polygons than this are not split further",
        min=0,
        soft_max=5_000,
    )
    hidden: float = setting(
        0.02,
        "Hidden Below",
        "Visibility below which a tetrahedron counts as hidden. Larger values save polygons in thickets",
        subtype='FACTOR',
        min=0.0,
        max=1.0,
    )
    hidden_block: float = math.inf
    proxy_block: float = math.inf
    margin: float = 0.04
    visibility_resolution: int = setting(
        256,
        "Visibility Resolution",
        "Longer side, in pixels, of the buffer that determines what hides what. Larger values are more exact; time "
        "grows with the square",
        subtype='PIXEL',
        min=16,
        soft_min=64,
        soft_max=1024,
        max=4096,
    )
    max_tetrahedra: int = setting(
        400_000,
        "Max Tetrahedra",
        "Refinement stops before exceeding this many tetrahedra, which bounds time and memory",
        min=100,
        soft_min=10_000,
        soft_max=2_000_000,
    )
    max_levels: int = setting(60, "Max Levels", "Maximum number of times that space can be halved", min=1, max=200)
    max_passes: int = setting(
        0,
        "Max Passes",
        "Stop refinement after this many passes, to inspect an intermediate state; 0 for no limit. Tetrahedra that "
        "would be split further become polygons or proxies as they are",
        min=0,
        soft_max=40,
    )
    facet: float = setting(
        1.2,
        "Facet Size",
        "Size in pixels of the small facets that stand for leaves, at most: where there are few, they are finer. "
        "Larger values give fewer, coarser facets",
        subtype='PIXEL',
        min=0.1,
        soft_max=4.0,
        max=100.0,
    )
    max_polygons: int = setting(
        0,
        "Max Polygons",
        "Maximum number of polygons in the result, proxies included; 0 for no limit. The most visible plants get "
        "polygons first, and the rest becomes coarser proxies",
        min=0,
        soft_max=100_000_000,
        step=100_000,
    )
    max_memory: float = setting(
        0.0,
        "Max Memory",
        "Maximum memory of Blender in gigabytes, for refinement, its result and rendering together. 0 is automatic: "
        "half of the machine's memory. Plants that would not fit become coarser",
        min=0.0,
        soft_max=256.0,
        precision=1,
    )
    anchored: bool = setting(
        False,
        "Anchored",
        "Divide space the same way in every frame of an animation, whatever the camera does, so that less changes "
        "between frames. Creates somewhat more geometry. Always on for panoramas",
    )
    shadow_cutoff: float = setting(
        0.0,
        "Shadow Cutoff",
        "Size in pixels below which shadows of hidden plants are refined no further; 0 leaves them coarse. About 4 "
        "pixels sharpens shadows of trees behind the camera, for roughly a quarter more polygons",
        subtype='PIXEL',
        min=0.0,
        soft_max=16.0,
        max=1000.0,
    )

    def first_look(self) -> RefinementSettings:
        """Settings of a result that is there within a second or so and shows where everything is.

        Meant for an image of `FIRST_LOOK` pixels; coarser than these settings in every respect. Limits stay.
        """
        coarse = QUALITIES["DRAFT"]
        return replace(
            self,
            cutoff=max(self.cutoff, coarse["cutoff"]),
            leaf_limit=max(self.leaf_limit, coarse["leaf_limit"]),
            facet=max(self.facet, 2.0 * coarse["facet"]),
            visibility_resolution=min(self.visibility_resolution, _FIRST_RESOLUTION),
            max_tetrahedra=min(self.max_tetrahedra, _FIRST_TETRAHEDRA),
            shadow_cutoff=0.0,
        )


#: Longest side of the image that a first look is made for, pixels; its tetrahedra, and its alpha buffer.
FIRST_LOOK = 320
_FIRST_TETRAHEDRA, _FIRST_RESOLUTION = 4_000, 96
#: What the qualities of the panel stand for.
QUALITIES: dict[str, dict[str, float]] = {
    "DRAFT": {"cutoff": 6.0, "leaf_limit": 1.25, "facet": 2.5, "visibility_resolution": 128},
    "PREVIEW": {"cutoff": 3.0, "leaf_limit": 0.9, "facet": 1.8, "visibility_resolution": 192},
    "FINAL": {"cutoff": 2.0, "leaf_limit": 0.6, "facet": 1.2, "visibility_resolution": 256},
}
