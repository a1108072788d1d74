# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the built-in leaf models stand for: the leaves that they are when they are near, by name."""

from __future__ import annotations

from .compounds import Compound
from .needles import Needles
from .outlines import Blade

LEAF_SHAPES: dict[str, Blade | Needles | Compound] = {
    # A silver birch: rhombic, drawn out to a tip, doubly serrate.
    "kite": Blade(
        width=0.68, widest=0.34, base="cuneate", apex="acuminate", teeth=13, tooth="doubly serrate", tooth_size=0.035,
        fold=0.16, curl=0.06, wave=0.012, waves=3.5, petiole=0.1,
    ),
    # A beech: entire, with a shallow wave for each vein.
    "ovate": Blade(
        width=0.62, widest=0.42, base="rounded", apex="acute", teeth=8, tooth="sinuate", tooth_size=0.012,
        fold=0.24, curl=0.1, wave=0.014, waves=8.0, petiole=0.06,
    ),
    # An aspen: as broad as it is long, on a long stalk, with blunt teeth.
    "round": Blade(
        width=0.88, widest=0.38, base="truncate", apex="acute", teeth=15, tooth="crenate", tooth_size=0.022,
        fold=0.11, curl=0.06, wave=0.018, waves=2.5, petiole=0.12,
    ),
    # A willow: narrow, finely serrate.
    "lanceolate": Blade(
        width=0.27, widest=0.38, base="cuneate", apex="acuminate", teeth=34, tooth="serrate", tooth_size=0.006,
        fold=0.22, curl=0.12, wave=0.006, waves=5.0, petiole=0.03,
    ),
    # Four shoots of a conifer.
    "needles": Needles(
        needles=200, length=0.11, thickness=0.011, angle=48.0, angle_tip=24.0, flat=0.45, bend=0.1,
        shoot=0.95, shoots=4, spread=82.5, lift=0.25, stem=0.016,
    ),
    # An oak: rounded lobes, the largest beyond the middle.
    "lobed": Blade(
        width=0.58, widest=0.62, base="cuneate", apex="rounded", lobes=4, lobe_depth=0.5, lobe_round=1.0,
        fold=0.16, curl=0.08, wave=0.018, waves=3.5, petiole=0.04,
    ),
    # A Norway maple: five pointed lobes with few large teeth.
    "maple": Blade(
        width=1.12, widest=0.4, base="truncate", apex="acute", lobing="palmate", lobes=5, lobe_depth=0.44,
        lobe_round=0.1, teeth=10, tooth="serrate", tooth_size=0.075, fold=0.14, curl=0.1, wave=0.015, waves=2.0,
    ),
    # A poplar or downy birch: triangular, doubly serrate.
    "deltoid": Blade(
        width=0.76, widest=0.24, base="truncate", apex="acuminate", teeth=14, tooth="doubly serrate", tooth_size=0.03,
        fold=0.16, curl=0.08, wave=0.012, waves=3.0, petiole=0.08,
    ),
    # A cherry blossom: five petals around a cup.
    "blossom": Compound(
        leaflet=Blade(
            width=0.85, widest=0.6, base="cuneate", apex="rounded", fold=0.1, curl=-0.12, wave=0.03, waves=2.0,
        ),
        pairs=0, around=5, first=0.5, terminal=0, length=0.5, cup=0.22, curl=0.0, stem=0.02,
    ),
}  # fmt: skip
