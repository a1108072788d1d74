# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistics of a refinement, for the panel, the command line and the benchmarks; time of jobs."""

import time
from dataclasses import asdict, dataclass, field

from ..errors import listed

#: How much coarser than asked for facets are before somebody is told.
COARSER = 1.5


@dataclass(frozen=True)
class Step:
    """The state after one pass through the loop."""

    #: tetrahedra_made and levels: all tetrahedra ever made, and how deep their tree is.
    tetrahedra_made: int
    levels: int
    #: split, proxy, hidden and explicit: tetrahedra that hold something, by what was decided on them.
    split: int
    proxy: int
    hidden: int
    explicit: int
    #: subplants, pieces and foreign: their contents: sub-plants, pieces of branches, polygons of other meshes.
    subplants: int
    pieces: int
    foreign: int
    polygons: int  # expected polygons of what is to be explicit
    seconds: float  # wall clock since the loop began
    memory_mb: float  # megabytes of the tree and of what it holds


@dataclass
class Statistics:
    """Counts and seconds of one refinement; ``as_dict`` is what JSON output holds."""

    plants: int = 0  # plants that took part
    polygons_full: int = 0  # polygons of all plants expanded (compiled estimate)
    #: polygons_meshed and polygons_proxy: polygons of the plants' meshes, and faces of proxies.
    polygons_meshed: int = 0
    polygons_proxy: int = 0
    #: instances, instances_whole and instances_clusters: instances of assets that took part; those that are drawn as
    #: the originals, and clusters as meshes of their own.
    instances: int = 0
    instances_whole: int = 0
    instances_clusters: int = 0
    #: tetrahedra_made, tetrahedra_terminal and tetrahedra_proxy: all tetrahedra ever made; those that are not divided;
    #: those of them that are drawn as proxies.
    tetrahedra_made: int = 0
    tetrahedra_terminal: int = 0
    tetrahedra_proxy: int = 0
    #: Passes through the loop; ``levels`` in `as_dict`, as in saved files and the output of the command line.
    passes: int = 0
    facet_pixels: float = 0.0  # side of the facets of proxies, pixels, which a budget may have increased; 0 for shells
    facet_asked: float = 0.0  # that which the settings ask for
    complete: bool = True  # false where a limit of the settings stopped the loop
    #: Wall clock by stage: ``read``, ``compile``, ``refine``, ``emit``.
    seconds: dict[str, float] = field(default_factory=dict)
    memory_mb: float = 0.0  # estimated megabytes of the meshes in Blender
    steps: list[Step] = field(default_factory=list)  # one for each pass through the loop
    #: Objects that were left out at least in part, because they are far beyond all others, and how far from the camera
    #: that is, meters.
    outliers: dict[str, float] = field(default_factory=dict)
    unknown: str = ""  # tells of plants that were left out because nobody has their species

    @property
    def left_out(self) -> str:
        """A warning about what is unknown, or about outliers; empty where there are none."""
        if not self.outliers or self.unknown:
            return self.unknown
        far = f"{listed(sorted(self.outliers))}, {min(self.outliers.values()) / 1e3:,.0f} km from the camera"
        return f"Left out, because too far to be seen: {far}, far beyond all else; move it closer or delete it"

    @property
    def coarser(self) -> str:
        """A warning where facets are coarser than asked for by a half or more; else an empty text."""
        if not self.facet_asked or self.facet_pixels < COARSER * self.facet_asked:
            return ""
        return (
            f"Facets are {self.facet_pixels:.2g} pixels large, where {self.facet_asked:.2g} are set: no more fit into "
            "Max Memory or Max Polygons. Raise these, or render a smaller image"
        )

    def as_dict(self) -> dict:
        """Plain dictionary, ready for JSON."""
        fields_ = {"levels" if name == "passes" else name: value for name, value in asdict(self).items()}
        return {**fields_, "coarser": self.coarser}


class Stopwatch:
    """Adds up wall clock by stage, in ``seconds``."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Add the time since the last lap to a stage."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
