# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of plants: those of one kind are compiled once, and are results of their own.

Seeds have kinds as texts, which are compared and sorted as such.
"""

from dataclasses import dataclass, replace
from typing import Self

#: Most years that a plant may be old.
MOST_YEARS = 10_000.0
# Neither identifiers of species nor names of objects contain a line break.
_BREAK = "\n"
_CROWDED = " crowded"  # behind the age of plants of a dense stand


@dataclass(frozen=True)
class Kind:
    """A species and what else plants of it have in common."""

    species: str  # identifier
    skeleton: str = ""  # name of the object that draws them; empty where they grow by themselves
    age: float = 0.0  # years; 0 is full-grown
    dead: float = 0.0  # years since they died at that age; 0 alive
    crowded: bool = False  # whether they are those of a dense stand
    look: str = ""  # what else of their objects results take over; empty for nothing

    @classmethod
    def read(cls, text: str) -> Self:
        """The kind that a text stands for."""
        species, skeleton, age, dead, look = (*text.split(_BREAK), *[""] * 4)[:5]
        years = float(age.removesuffix(_CROWDED) or 0.0)
        return cls(species, skeleton, years, float(dead or 0.0), age.endswith(_CROWDED), look)

    def __str__(self) -> str:
        age = f"{self.age!r}{_CROWDED * self.crowded}" if self.age else ""
        dead = f"{self.dead!r}" if self.age and self.dead > 0.0 else ""
        return _BREAK.join((self.species, self.skeleton, age, dead, self.look)).rstrip(_BREAK)

    @property
    def plain(self) -> Self:
        """The kind of full-grown plants."""
        return Kind(self.species, self.skeleton)

    def aged(self, age: float, dead: float = 0.0, crowded: bool = False) -> Self:
        """The kind at an age, or so long after death at it; the same where the age is 0."""
        return replace(self, age=age, dead=dead, crowded=crowded) if age else self

    def later(self, years: float) -> Self:
        """The kind after so many years, whatever it looks like."""
        age, dead = (self.age, self.dead + years) if self.dead > 0.0 else (self.age + years, 0.0)
        return replace(self, age=age, dead=dead, look="")


def species_of(kind: str) -> str:
    """Identifier of the species of a kind, as a text."""
    return kind.partition(_BREAK)[0]
