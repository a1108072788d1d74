# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user decides about refinement."""

import math
from dataclasses import dataclass, replace
from typing import Self

from ..parameters import script_setting, setting, within


@dataclass(frozen=True)
class RefinementSettings:
    """Limits of the loop of visibility, refinement and update.

    Fields with a label are properties of a scene, documented by their tooltips. Sizes are pixels of the final image.
    """

    cutoff: float = setting(
        2.0,
        "Cutoff",
        "Tetrahedra smaller than this many pixels are not split further. Smaller values give finer results and take "
        "longer; 1 to 4 pixels are hard to tell apart",
        subtype='PIXEL',
        soft_min=0.5,
        **within(0.25, 16.0, 1000.0),
    )
    #: Leaves narrower than so many pixels become facets; up to 2.5 times this width, a growing fraction stays real.
    #: About half of ``facet``: below that, leaves cost more polygons than facets.
    leaf_limit: float = script_setting(0.6, min=0.05, max=1000.0)
    #: Visible tetrahedra larger than so many pixels are always split, even if all become polygons: parts may hide.
    block: float = script_setting(32.0, min=1.0, max=10_000.0)
    few_polygons: int = script_setting(200, min=0)  # tetrahedra holding fewer polygons are not split further
    #: Visibility below which a tetrahedron counts as hidden. Larger values save polygons in thickets.
    hidden: float = script_setting(0.02, min=0.0, max=1.0)
    #: Longest edge, in pixels at its depth, down to which hidden tetrahedra are divided. Facets take their places from
    #: the plants, so that they need no such limit; a shell fills its whole tetrahedron and does.
    hidden_block: float = math.inf
    #: The same for proxies that are seen; infinite for facets, which need no finer tetrahedra than their visibility.
    proxy_block: float = math.inf
    #: Fraction of the image by which the view is widened on each side: leaves that reach in from outside are real.
    margin: float = 0.04
    #: Longer side of the buffer that says what is hidden, pixels; at most the image's or 256. Time grows by its square.
    visibility_resolution: int = script_setting(256, min=16, max=4096)
    #: Refinement stops before exceeding so many, which bounds time and memory.
    max_tetrahedra: int = script_setting(400_000, min=100)
    max_levels: int = script_setting(60, min=1, max=200)  # how often space can be halved
    #: Stop after so many passes, to inspect an intermediate state; 0 for no limit.
    max_passes: int = script_setting(0, min=0)
    #: Size in pixels of the facets that stand for leaves, at most: where there are few, they are finer.
    facet: float = script_setting(1.2, min=0.1, max=100.0)
    max_polygons: int = setting(
        0,
        "Max Polygons",
        "Maximum number of polygons in the result, proxies included; 0 for no limit. The most visible plants get "
        "polygons first, and the rest becomes coarser proxies",
        **within(0, 100_000_000),
        step=100_000,
    )
    #: Gigabytes of Blender, for refinement, its result and rendering together; 0 is half of the machine's memory.
    #: Plants that would not fit become coarser.
    max_memory: float = script_setting(0.0, min=0.0)
    #: Divide space the same way in every frame of an animation, whatever the camera does: tetrahedra begin with
    #: `tetrahedra.world_root` instead of the view. Always so for panoramas.
    anchored: bool = script_setting(False)
    shadow_cutoff: float = setting(
        0.0,
        "Shadow Cutoff",
        "Size in pixels below which shadows of hidden plants are refined no further; 0 refines those that fall into "
        "the picture with few polygons. About 4 pixels sharpens them for roughly a quarter more",
        subtype='PIXEL',
        **within(0.0, 16.0, 1000.0),
    )

    def first_look(self) -> Self:
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
