# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Grow a stand: year after year plants shade each other, grow, die, fall, and seeds of the others come up.

All random numbers are hashes of the seed, the plant and the year, and sums are of whole numbers: the stand is the same
whatever the number of threads.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Mask
from ..errors import TetFloraError
from ..jobs import Progress
from ..parallel import blocks, on_all_cores
from ..parameters import script_setting, setting, within
from .change import MOST_PLANTS, DeadPlants, Plants, Records, SeedDispersal, dying, fallen, grown, in_order, planted
from .light import LightGrid
from .site import StandSite, StandSpecies, StandTraits

#: Plants that are looked at together.
_BLOCK = 1 << 15
#: Most records of a stand, some 70 bytes each here and again in the file.
MOST_RECORDS = 20_000_000
#: Meters of open ground beyond open edges.
_MARGIN = 12.0
#: Meters between the highest and the lowest ground up to which it counts as level.
_LEVEL = 0.5


@dataclass(frozen=True)
class StandSettings:
    """How a stand grows. Fields with a label are properties of the scene, and documented by their tooltips."""

    years: int = setting(80, "Years", "How long the stand grows", min=1, soft_max=300, max=2000)
    interval: int = script_setting(5, min=0)  # years between two records of the stand; 0 keeps the last year only
    seed: int = setting(0, "Seed", "A different seed gives a different stand")
    density: float = setting(
        2500.0,
        "Planted",
        "Young plants per hectare at the beginning; 0 leaves the ground bare",
        **within(0.0, 20_000.0),
    )
    recruits: float = setting(
        300.0,
        "Seedlings",
        "Most plants that come up from seed per hectare and year; light and soil allow fewer. 0 for none",
        **within(0.0, 2000.0),
    )
    outside: float = setting(
        1.0,
        "Incoming Seeds",
        "Factor on the seeds that arrive from beyond the ground; at 0, only the stand itself bears seeds",
        **within(0.0, 10.0),
    )
    min_height: float = script_setting(1.0, min=0.0)  # meters; lower plants are not part of the result
    cell: float = script_setting(1.0, min=0.1)  # width, meters, of the columns in which light is computed
    #: Light comes in from all sides, as at the edge of a wood. Otherwise the stand goes on beyond the ground, and what
    #: grows at one side shades what grows at the opposite one.
    open_edges: bool = script_setting(False)


def grow(
    site: StandSite, species: Sequence[StandSpecies], settings: StandSettings
) -> Generator[Progress, object, Records]:
    """Grow a stand; a job, which yields after each year and returns its records.

    These are of plants at year 0, each ``interval`` years, at the end, and whenever one appears, dies, falls or is
    gone; with an interval of 0 those of the end alone.

    Raises
    ------
    TetFloraError
        A setting cannot be, or the ground is too large; names it.
    """
    stand = begun(site, species, settings)
    for year in range(settings.years):
        yield Progress(year / settings.years, f"Growing the stand: year {year} of {settings.years}")
        stand.step(year)
    return stand.finished()


def begun(site: StandSite, species: Sequence[StandSpecies], settings: StandSettings) -> "GrowingStand":
    """A stand at its beginning, which whoever has it steps from year to year; see `grow`."""
    _check(settings)
    return GrowingStand(site, StandTraits(species), settings)


def _check(settings: StandSettings) -> None:
    for name, value, low, high in (
        ("Years", settings.years, 1, 2000),
        ("Interval", settings.interval, 0, 2000),
        ("Planted", settings.density, 0, 1e7),
        ("Seedlings", settings.recruits, 0, 1e6),
        ("Incoming Seeds", settings.outside, 0, 1e6),
        ("Min Height", settings.min_height, 0, 200),
        ("Cell", settings.cell, 0.05, 50),
    ):
        if not low <= value <= high:  # false for NaN as well
            raise TetFloraError(f"{name} of a stand must be from {low:g} to {high:g}, not {value:g}")


class GrowingStand:
    """A stand in a year.

    Attributes
    ----------
    plants : Plants
        Those that live.
    dead : DeadPlants
    """

    def __init__(self, site: StandSite, traits: StandTraits, settings: StandSettings) -> None:
        self.site, self.traits, self.settings = site, traits, settings
        width, depth = site.size
        margin = _MARGIN if settings.open_edges else 0.0
        rows, columns = (max(round((size + 2.0 * margin) / settings.cell), 3) for size in (depth, width))
        # Columns are square: the last row and column may lie a little beyond the ground.
        cell = max((width + 2.0 * margin) / columns, (depth + 2.0 * margin) / rows)
        ground = None
        if np.ptp(site.height) > _LEVEL:
            x, y = np.meshgrid((np.arange(columns) + 0.5) * cell - margin, (np.arange(rows) + 0.5) * cell - margin)
            ground = site.ground(x.ravel(), y.ravel())
        self.light = LightGrid(rows, columns, cell, margin, ground)
        suitability = np.stack([site.suitability(needs) for needs in traits.needs])
        if not suitability.any():
            raise TetFloraError(
                "None of the species can grow in this climate and soil; change Degree Days, Coldest Month or species"
            )
        self.slope = site.slope()
        self.plants = planted(site, traits, suitability, settings.density, settings.seed)
        if not len(self.plants) and settings.recruits * settings.outside * traits.incoming_seeds.sum() <= 0.0:
            raise TetFloraError("Nothing is planted and no seeds come; raise Planted, or Seedlings and Incoming Seeds")
        self.seeds = SeedDispersal(site, traits, suitability, settings.recruits, settings.outside)
        self.count, self.dead, self.kept = len(self.plants), DeadPlants.empty(), []

    def step(self, year: int) -> None:
        """One year."""
        every = self.settings.interval
        record = every > 0 and year % every == 0
        plants = self._recorded(year, record)
        self._decay(year, record)
        crowns = plants.crowns(self.traits)
        strips = self.light.fill(crowns)
        taken = np.zeros(len(plants))
        for index, own in zip(strips, on_all_cores(self.light.taken, range(len(strips))), strict=True):
            taken[index] = own

        def changed(block: slice) -> tuple[Plants, Mask]:
            after = grown(plants, crowns, taken, self.light, self.traits, block)
            return after, dying(after, self.traits, year)

        parts = list(on_all_cores(changed, blocks(len(plants), _BLOCK)))
        new = Plants.empty()
        if self.settings.recruits > 0.0:
            new = self.seeds.plants(plants, self.light, year, self.count, self.settings.seed)
        if parts:
            dead = np.concatenate([part[1] for part in parts])
            self._die(plants.take(np.flatnonzero(dead)), year, record)
            plants = Plants.concatenate([part[0].take(~part[1]) for part in parts])
        self.plants = Plants.concatenate([plants, new])
        self.count += len(new)
        if sum(map(len, self.kept)) > MOST_RECORDS:
            raise TetFloraError(
                f"The stand has more than {MOST_RECORDS:,} records; raise Interval or Min Height, or choose a smaller "
                "ground"
            )
        if len(self.plants) > MOST_PLANTS:
            raise TetFloraError(
                f"The stand has more than {MOST_PLANTS:,} plants; lower Seedlings, or choose a smaller ground"
            )

    def _recorded(self, year: int, record: bool) -> Plants:
        """Plants, of which those that are tall enough are recorded, or only those that are new."""
        plants = self.plants
        if not self.settings.interval:
            return plants
        tall = plants.height >= self.settings.min_height
        index = np.flatnonzero(tall if record else tall & ~plants.known)
        if len(index):
            self.kept.append(plants.take(index).records(year, self.traits, self.site))
            plants = replace(plants, known=plants.known | tall)
        return plants

    def _die(self, plants: Plants, year: int, record: bool) -> None:
        """Plants that do not see the next year."""
        last = plants.records(year, self.traits, self.site)
        if self.settings.interval and not record:
            self.kept.append(last.take(np.flatnonzero(plants.known)))
        tall = np.flatnonzero(plants.height >= self.settings.min_height)
        plants, last = plants.take(tall), last.take(tall)
        cells = self.site.cells(plants.x, plants.y)
        self.dead = DeadPlants.concatenate([self.dead, fallen(plants, last, self.slope, cells, year)])

    def _decay(self, year: int, record: bool) -> None:
        """Dead trees: some fall, some are gone."""
        dead = self.dead
        if self.settings.interval and len(dead):
            # Records of the year in which one falls, of the next, when it lies, and of its last.
            at = record | (dead.falls == year) | (dead.falls == year - 1) | (dead.gone == year)
            self.kept.append(dead.take(np.flatnonzero(at & (dead.died < year))).records(year))
        self.dead = dead.take(np.flatnonzero(dead.gone > year))

    def finished(self) -> Records:
        """Records of the whole, with plants numbered from 0."""
        year = self.settings.years
        self._decay(year, False)
        end = [self.plants.records(year, self.traits, self.site), self.dead.records(year)]
        tall = np.flatnonzero(end[0].height >= self.settings.min_height)
        known = Records.concatenate([*self.kept, end[0].take(tall), end[1]])
        first = in_order(known)
        if not len(first):
            return first
        # A dead tree that falls in the last year is recorded twice: the same row.
        again = np.flatnonzero(
            np.append(True, (first.plant[1:] != first.plant[:-1]) | (first.year[1:] != first.year[:-1]))
        )
        first = first.take(again)
        new = np.append(True, first.plant[1:] != first.plant[:-1])
        return replace(first, plant=(np.cumsum(new) - 1).astype(np.int32))
