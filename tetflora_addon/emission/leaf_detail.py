# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How finely near leaves are drawn: lengths in the image, from which `leaves.levels` says the level.

The coarsest level whose margin is within a tolerance of the leaf's own is enough. What counts is how long leaves of a
branch are in the image where it comes nearest: nothing depends on the order of branches or on earlier images.
"""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..camera.camera import Camera
from ..compiled.flora import Flora
from ..growth.foliage import envelope_reach
from ..growth.growth import WholeBranches
from ..leaves.levels import coarse_error
from ..species.species import LEAF_KINDS
from ..subplants.rings import Pixels

#: Pixels by which the margin of a leaf may be off.
TOLERANCE = 0.5
#: A leaf is no more than so many times as near as its branch, as far as this counts.
NEARER = 4.0


@dataclass(frozen=True)
class LeafDetail:
    """Lengths of leaves in the image."""

    flora: Flora
    camera: Camera
    tolerance: float = TOLERANCE  # pixels by which margins may be off; infinite for none but the models of the species
    beside: float = 0.0  # meters that a pixel spans at least at what is out of view, over the distance from the view

    @property
    def wood(self) -> Pixels | None:
        """How large pixels are at wood, that is as fine as leaves; None where it is coarse everywhere."""
        coarser, camera = self.tolerance / TOLERANCE, self.camera
        if not np.isfinite(coarser):
            return None
        slope = 0.0 if camera.kind == "ORTHO" else camera.pixel_size
        return Pixels(lambda points, reach: coarser * self._extent(points, reach), coarser * slope)

    def lengths(self, whole: WholeBranches) -> Floats:
        """Lengths (n,) of the leaves of branches in tolerances, where they come nearest.

        0 where the models of the species are certainly fine enough.
        """
        branches, camera = whole.branches, self.camera
        out = np.zeros(len(branches))
        most = 1.0 / np.maximum(self._errors()[self.flora.rows["species"][branches.row]], 1e-300)
        size = self.flora.rows["leaf_size"][branches.row].sum(axis=1) * branches.scale
        for factor in ("leaf_size_tip", "leaf_size_young"):
            size = size * np.maximum(self.flora.rows[factor][branches.row], 1.0)
        beside = size + envelope_reach(self.flora.rows)[branches.row] * branches.length
        # The base tells of most branches that they are too far away.
        around = camera.extent_around(branches.position)
        pixels = size / self._nearest(around, branches.length + beside) / self.tolerance
        near = np.flatnonzero(pixels > most)
        if not len(near):
            return out
        knots = whole.lines.knots[near]
        reach = np.linalg.norm(np.diff(knots, axis=1), axis=2).max(axis=1) / 2.0 + beside[near]
        extent = self._extent(knots.reshape(-1, 3), np.repeat(reach, knots.shape[1])).reshape(len(near), -1).min(axis=1)
        nearest = self._nearest(extent, reach)
        out[near] = size[near] / np.maximum(nearest, extent / NEARER) / self.tolerance
        return out

    def _errors(self) -> Floats:
        """Largest error (species,) of a species' models."""
        forms = ([f for kind in range(len(LEAF_KINDS)) for f in own[kind]] for own in self.flora.forms)
        return np.array([max((coarse_error(f) for f in own), default=0.0) for own in forms])

    def _extent(self, points: Floats, reach: Floats | float) -> Floats:
        """Meters (n,) that a pixel spans at what reaches so far around points (n, 3), in view or not."""
        moments = self.camera, *self.camera.shutter
        away = np.min([moment.distance_to_view(points) for moment in moments], axis=0) - reach
        return np.maximum(self.camera.extent_around(points), self.beside * np.maximum(away, 0.0))

    def _nearest(self, extent: Floats, away: Floats) -> Floats:
        """Meters (n,) that a pixel spans at things up to a distance (n,) nearer than where it spans ``extent`` (n,)."""
        if self.camera.kind == "ORTHO":
            return extent
        return np.maximum(extent - self.camera.pixel_size * away, 1e-9)
