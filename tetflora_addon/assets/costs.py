# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What instances of assets cost a renderer, and which are therefore drawn as the originals.

Cycles keeps an asset once, and a few bytes for each instance: rays find their way through ten thousand instances nearly
as fast as through ten. Where all assets fit into memory, plain instances are the cheapest. EEVEE and the viewport draw
every triangle of every instance. ``python -m benchmarks assets`` measures both.
"""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Integers, Mask

#: How many times as far plain instances are kept where the renderer shows a mesh in many places for the cost of one.
FARTHER = 20.0


@dataclass(frozen=True)
class OriginalPolicy:
    """When an instance is drawn as the original."""

    always: Mask  # (a,): assets of which every instance is
    fraction: float = 0.6  # fraction of its faces that are to be real; more than 1 for never
    #: Meshes of clusters cost the renderer as much as one of them, in however many places. Else each place counts.
    shared: bool = False
    #: Leaves of few pixels are kites. Without them nothing is gained by any, and all that is seen is real, but for
    #: specks: `FARTHER` times as far as else.
    kites: bool = True


#: Bytes that Cycles takes for a triangle of an asset with its tree, and for an instance; what Blender takes for one.
CYCLES_TRIANGLE, CYCLES_INSTANCE, BLENDER_INSTANCE = 290.0, 1_670.0, 160.0
#: Fraction of the memory that is left which assets that Cycles loads may take.
SAFE = 0.8
#: Triangles of all instances up to which EEVEE draws them as fast as what would take their place.
EEVEE_FEW = 2_000_000
#: Fraction of an instance that is to be real for EEVEE to draw all of it.
EEVEE_WHOLE = 0.6
#: The same for Cycles, which is better off with one instance than with some hundred of clusters.
CYCLES_WHOLE = 0.1
#: More than any fraction.
NEVER = 2.0


@dataclass(frozen=True)
class AssetCosts:
    """What there is of each asset (a)."""

    triangles: Integers  # (a,)
    instances: Integers  # (a,)
    #: (a,): pixels of the image that its instances would cover if nothing hid them; infinite where that is not known.
    pixels: Floats

    def plain(self, cycles: bool, left: float) -> bool:
        """Whether all instances are best left as they are, with so many bytes left."""
        if not cycles:
            return bool((self.triangles * self.instances).sum() <= EEVEE_FEW)
        return bool(self._bytes.sum() <= SAFE * left)

    def originals(self, cycles: bool, left: float, always: bool = True) -> OriginalPolicy:
        """How instances are drawn that are refined: because not all can be the originals, or whatever it costs.

        always: whether some assets may be the originals everywhere.
        """
        kept = np.zeros(len(self.triangles), bool)
        if not cycles:
            return OriginalPolicy(kept, EEVEE_WHOLE)
        if not always and self.plain(cycles, left):
            return OriginalPolicy(kept, CYCLES_WHOLE, shared=True, kites=False)
        # Those that cover most for what they take; none but these is loaded at all.
        cost = self._bytes
        if always:
            order = np.argsort(-self.pixels / np.maximum(cost, 1.0), kind="stable")
            room = SAFE / 2 * left
            for one in order.tolist():  # of some dozens; one that does not fit keeps no other out
                kept[one] = cost[one] <= room
                room -= cost[one] if kept[one] else 0.0
        return OriginalPolicy(kept, NEVER, shared=True)

    @property
    def _bytes(self) -> Floats:
        return CYCLES_TRIANGLE * self.triangles + (CYCLES_INSTANCE + BLENDER_INSTANCE) * self.instances
