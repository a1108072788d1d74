# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ecology of a species: what it needs, how it grows beside others, and how it spreads. It changes no plant.

Tolerances are those of Niinemets and Valladares ("Tolerance to shade, drought, and waterlogging of temperate northern
hemisphere trees and shrubs", Ecological Monographs 76, 2006), from 0, none, to 5.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class Ecology:
    """What a species needs and does; where a number is from is said in ``source``.

    Attributes
    ----------
    shade, drought, waterlogging : float
        Tolerance, 0 none to 5.
    warmth : float
        Sum of daily mean temperatures over 5 °C that it needs at least.
    winter : float
        Coldest mean of a month that it survives, °C.
    fertility : float
        Fertility of the soil below which it grows less, 0 to 1.
    seeds : float
        Seeds that can germinate, for each square metre of crown and year.
    dispersal : float
        Mean distance that seeds travel, metres.
    height, diameter : float
        Of the largest on a good site, metres.
    slenderness : tuple of float
        b and c of the height in closed stands, 1.3 + (``height`` − 1.3)(1 − exp(−b diameter))^c, diameter in metres.
    crown : tuple of float
        Width of the crown of a tree that stands free, first + second × diameter, metres.
    top : float
        Form of the crown: 0 a dome, 1 a cone.
    leaves : float
        Leaf area over the ground below a crown that is free to its foot.
    extinction : float
        Fraction of the light that a thin layer of leaves takes, over its leaf area.
    limit : float
        Light at which the lowest limbs die, over that in the open.
    wood : float
        Dry mass of the wood over its fresh volume, kg/m³.
    form : float
        Wood above ground, with limbs, over diameter² × π/4 × height.
    yields : float
        Dry wood that all light on a square metre makes in a year on a good site, kg.
    thickening : float
        Most by which the diameter grows in a year, metres.
    source : str
        Where the numbers are from.
    """

    shade: float = 2.7
    drought: float = 2.7
    waterlogging: float = 1.7
    warmth: float = 700.0
    winter: float = -15.0
    fertility: float = 0.4
    seeds: float = 30.0
    dispersal: float = 25.0
    height: float = 32.0
    diameter: float = 1.2
    slenderness: tuple[float, float] = (4.0, 0.9)
    crown: tuple[float, float] = (1.2, 20.0)
    top: float = 0.3
    leaves: float = 6.0
    extinction: float = 0.5
    limit: float = 0.08
    wood: float = 530.0
    form: float = 0.6
    yields: float = 0.9
    thickening: float = 0.012
    source: str = ""


#: Limits of numbers, and of each of a pair.
_LIMITS: dict[str, tuple[float, float]] = {
    "shade": (0, 5), "drought": (0, 5), "waterlogging": (0, 5), "warmth": (0, 8000), "winter": (-70, 30),
    "fertility": (0, 1), "seeds": (0, 1e6), "dispersal": (0.1, 1e5), "height": (0.01, 130), "diameter": (0.001, 12),
    "slenderness": (0.1, 1000), "crown": (0, 300), "top": (0, 1), "leaves": (0.05, 20), "extinction": (0.1, 1),
    "limit": (0.001, 0.9), "wood": (20, 1400), "form": (0.05, 3), "yields": (0.001, 10), "thickening": (1e-5, 0.1),
}  # fmt: skip
ECOLOGY_KEYS = tuple(one.name for one in fields(Ecology))


def read_ecology(reader: Any, data: Any) -> Ecology | None:
    """The key ``ecology`` of a species; None where there is none.

    Raises
    ------
    SpeciesError
        Names the field and what it may be.
    """
    if data is None:
        return None
    reader.keys(data, "ecology", ECOLOGY_KEYS)
    values: dict[str, Any] = {}
    for key, value in data.items():
        name = f"ecology.{key}"
        if key == "source":
            values[key] = reader.text(value, name, least=0)
        elif isinstance(getattr(Ecology, key), tuple):
            if not isinstance(value, list) or len(value) != 2:
                raise reader.fail(name, "must be a pair of numbers, [first, second]")
            values[key] = tuple(reader.number(one, f"{name}[{i}]", *_LIMITS[key]) for i, one in enumerate(value))
        else:
            values[key] = reader.number(value, name, *_LIMITS[key])
    return Ecology(**values)
