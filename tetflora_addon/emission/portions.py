# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen of each part of a plant, and how far parts are opened before they are drawn.

The loop leaves parts that are shared by several tetrahedra. What lies in hidden ones and beside the view only casts
shadows and sends light back: few facets stand for it. A part that is seen in some of its tetrahedra and hidden in
others is opened until its own parts are on one side, or too small to matter. The *visibility* of a part is the
fraction of its light that reaches the eye; leaves that hardly show become facets earlier, and facets larger, so that
each draws about as much of the image.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..arrays import nested
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..proxies.thrown_shadows import ThrownShadows
from ..refinement.contents import PlantParts, feature_width
from ..refinement.loop import Refinement
from ..refinement.shared_parts import SharePoints, lowered
from ..refinement.shares import opened, share_points
from .seen import CLOSE, Seen, SeenNodes

#: Pixels from which on a part that is seen only here and there is opened.
MIXED = 24.0
#: Pixels from which on wood is looked for where no point of it is seen, and the fraction of it that is expected to be.
CLOSE_WOOD, _OF_WOOD = 4.0, 0.05
#: How far from its middle a part reaches, over its extent.
_REACH = 0.6
#: Points on the leaves of such a part, at most, that tell where it is seen.
POINTS = 12


@dataclass(frozen=True)
class Portions(Seen):
    """Parts of plants (n), and what is seen of them.

    Attributes
    ----------
    parts : PlantParts of n
    within : (n,) float64
        Fraction of their polygons and facets that are expected within the view; less than 1 only where no point tells.
    """

    parts: PlantParts = field(metadata=nested(PlantParts))
    within: NDArray[np.float64]


class Sight:
    """What the loop has found for all nodes of the tree, and what that means for parts of plants.

    Parameters
    ----------
    flora : Flora
    result : Refinement
    camera : Camera
    facets : bool
        Whether proxies are facets or spheres. If not, only what is explicit counts as seen: the rest are shells.
    """

    def __init__(self, flora: Flora, result: Refinement, camera: Camera, facets: bool = True) -> None:
        self.flora, self.camera, self.tree, self.plants = flora, camera, result.tree, result.plants
        self.nodes, self._facets = SeenNodes(result, facets), facets
        lowest = result.plants.parts.branches.position[:, 2].min(initial=np.inf)
        self.shadows = ThrownShadows(camera, result.lights, float(lowest))
        self._every: Portions | None = None

    def __getstate__(self) -> dict[str, object]:
        """What other processes need to open portions: all but the plants themselves."""
        return {**vars(self), "plants": self.plants.without_parts(), "_every": None}

    def portions(self) -> Portions:
        """All parts, front to back; kept, as polygons and facets are made of the same ones."""
        if self._every is None:
            self._every = self._sorted_portions()
        return self._every

    def _sorted_portions(self) -> Portions:
        made = self._portions(self.plants.parts, self.plants.points)
        branches = made.parts.branches
        # Ties are broken by the plants themselves, so that their order in the scene does not matter.
        return made.take(np.lexsort([*branches.position.T, branches.key, made.rank]))

    def _portions(self, parts: PlantParts, points: SharePoints) -> Portions:
        seen = self.nodes.of(points, len(parts), self._close_points(parts, points))
        made = Portions(**vars(seen), parts=parts, within=np.ones(len(parts)))
        if self._facets:
            self._let_in(made, np.bincount(points.part, minlength=len(parts)))
        return made

    def _close_points(self, parts: PlantParts, points: SharePoints) -> NDArray[np.intp]:
        """Points of what is hidden and large in the image.

        Visibility is that of an even fog. Between leaves of so many pixels one sees farther than that, and a facet or
        a sphere as large as a leaf is known for what it is. Leaves take their place, as if just enough of their light
        arrived that those of `CLOSE` pixels count as wide as a limit of one.
        """
        at = np.flatnonzero(self.nodes.close[points.cell])
        width = feature_width(self.flora, parts.branches.take(points.part[at]))
        return at[width >= CLOSE * self.camera.extent_around(points.position[at].astype(np.float64))]

    def _let_in(self, portions: Portions, points: NDArray[np.int64]) -> None:
        """Have opened, in place, what is seen at none of its points (n,), reaches into the view and is large there.

        Points are a few places of very many; beside the camera the rest may cross the image.
        """
        at = np.flatnonzero(portions.visibility <= 0.0)
        parts = portions.parts.take(at)
        some, reach = parts.branches, _REACH * parts.extent
        middle = some.position + 0.5 * some.length[:, None] * some.frame[:, :, 2]
        slope = 0.0 if self.camera.kind == "ORTHO" else self.camera.pixel_size
        nearest = self.camera.extent_around(middle) - slope * reach
        inside = self.camera.clearance(middle) < reach
        leafy = inside & (feature_width(self.flora, some) >= CLOSE * nearest)
        wooden = at[inside & ~leafy & (2.0 * some.radius >= CLOSE_WOOD * nearest)]
        at = at[leafy]
        portions.visibility[at] = portions.best[at] = CLOSE**-2.0
        portions.real[at] = portions.mixed[at] = True
        portions.beside[at], portions.within[at] = False, 1.0 / (1.0 + points[at])
        # Only their wood is drawn: light between leaves as even as a fog shows the trunk behind them here and there.
        portions.visibility[wooden] = portions.best[wooden] = CLOSE_WOOD**-4.0
        portions.mixed[wooden], portions.beside[wooden], portions.within[wooden] = True, False, _OF_WOOD

    def opened(self, portions: Portions) -> Portions:
        """Open sub-plants (n,); where their visibility differs from place to place, that of the new parts is found."""
        parts, points, parent, count = [PlantParts.empty()], [SharePoints.empty()], [np.zeros(0, np.int64)], 0
        for new, owner, lines in opened(self.flora, portions.parts):
            unclear = np.flatnonzero(portions.mixed[owner])
            if len(unclear):
                some = new.take(unclear)
                own = share_points(
                    self.flora, some, self.plants.pixels(some), None if lines is None else lines.take(unclear), POINTS
                )
                points.append(SharePoints(unclear[own.part].astype(np.int32) + np.int32(count), *_rest(own)))
            parts.append(new)
            parent.append(owner)
            count += len(new)
        every, owner, found = PlantParts.concatenate(parts), np.concatenate(parent), SharePoints.concatenate(points)
        made = Portions(parts=every, **{name: getattr(portions, name)[owner] for name in _INHERITED})
        if not len(found):
            return made
        known = self._portions(every, SharePoints(found.part, lowered(self.tree, found), *_rest(found)[1:]))
        mixed = portions.mixed[owner]
        columns = {name: np.where(mixed, getattr(known, name), getattr(made, name)) for name in _INHERITED}
        return Portions(parts=every, **columns)

    def pixels(self, portions: Portions) -> NDArray[np.float64]:
        """Extent (n,) of parts in the image."""
        return self.plants.pixels(portions.parts)


_INHERITED = (*vars(Seen.empty()), "within")


def _rest(points: SharePoints) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    return points.cell, points.position, points.leaf, points.wood


def in_chunks(expected: NDArray[np.float64], limit: float) -> Iterator[NDArray[np.int64]]:
    """Things (n,) in runs of about so many expected polygons, opened parts included."""
    block = (np.cumsum(expected) / limit).astype(np.int64)
    edges = np.flatnonzero(np.diff(block)) + 1
    yield from np.split(np.arange(len(expected)), edges)
