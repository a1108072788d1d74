# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A forest as it leaves: variants in levels of detail, and where plants show them; and the folder that it goes to."""

import re
import shutil
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Integers32
from ..errors import TetFloraError
from ..files import PART, replace
from ..optics import FACING
from .levels import PlantLevel

#: Light from everywhere that surfaces mirror: a row for each roughness, for indices of refraction. Smooth ones by
#: Fresnel's formulas, others as measured of Cycles' Principled BSDF in a white world.
_ROUGHNESS, _INDEX = (0.0, 0.25, 0.5, 0.75, 1.0), (1.0, 1.1, 1.2, 1.3, 1.5)
_MIRRORED = (
    (0.0, 0.0263, 0.0447, 0.061, 0.0918),
    (0.0, 0.0142, 0.0312, 0.0474, 0.0777),
    (0.0, 0.0083, 0.02, 0.0323, 0.0578),
    (0.0, 0.0039, 0.0106, 0.0186, 0.0367),
    (0.0, 0.0018, 0.0055, 0.0101, 0.0211),
)


def leaf_roughness(gloss: float) -> float:
    """Roughness at which a surface by Fresnel mirrors as much as leaves do, both facing it and on the whole."""
    amplitude = np.sqrt(FACING * gloss)
    index = (1.0 + amplitude) / (1.0 - amplitude)
    return float(np.interp(gloss, [np.interp(index, _INDEX, row) for row in _MIRRORED[::-1]], _ROUGHNESS[::-1]))


#: Attributes of points by name, each with its type and values.
PointAttributes = Mapping[str, tuple[str, NDArray]]


@dataclass(frozen=True)
class BakedSurface:
    """A material as other programs have it: files of its textures, below the folder of the forest, and numbers."""

    name: str
    color: tuple[float, float, float]  # mean, linear RGB
    transmission: float = 0.0
    roughness: float = 0.6
    gloss: float = 0.0  # fraction of light that is mirrored, mean of directions
    #: Files by names of textures: ``color``, ``normal``, ``roughness``, ``opacity``, and ``card``, color with alpha.
    textures: Mapping[str, str] = field(default_factory=dict)
    cut: float = 0.0  # alpha of its color texture below which nothing is shown; 0 without alpha
    kept: float = 1.0  # part of leaves that alpha leaves
    problems: tuple[str, ...] = ()  # what is not as the artist has it

    @property
    def index(self) -> float:
        """Index of refraction of a surface as rough that mirrors as much, on average over directions."""
        return float(np.interp(self.roughness, _ROUGHNESS, [np.interp(self.gloss, row, _INDEX) for row in _MIRRORED]))


@dataclass(frozen=True)
class Variant:
    """A plant that stands for others, in its own space, with scale 1."""

    name: str  # an identifier in all formats, different from all others of the forest
    species: str
    levels: tuple[PlantLevel, ...]
    height: float  # meters
    surfaces: Mapping[str, BakedSurface]  # by the kind of parts


@dataclass(frozen=True)
class ForestPart:
    """Plants (n) of one object."""

    name: str
    kinds: tuple[tuple[str, str], ...]  # species that ``species`` counts through, each with the object of its form
    origin: Floats  # (3,): of positions, meters in the world
    position: Floats32  # (n, 3): from the origin
    rotation: Floats32  # (n, 4): quaternions, w first
    scale: Floats32  # (n,): of the variant
    variant: Integers32  # (n,): index into those of the forest
    species: Integers32  # (n,)
    seed: Integers  # (n,)
    age: Floats32  # (n,): years; 0 full-grown
    height: Floats32  # (n,): meters
    #: What makes a field of the same plants: attributes of its points, its matrix (4, 4), and settings of the object.
    points: PointAttributes
    matrix: Floats
    settings: Mapping[str, float | int | str | list[float]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.seed)


@dataclass(frozen=True)
class Forest:
    """Everything that is written."""

    variants: tuple[Variant, ...]
    parts: tuple[ForestPart, ...]

    @property
    def surfaces(self) -> list[BakedSurface]:
        """Different materials."""
        return list({one.name: one for variant in self.variants for one in variant.surfaces.values()}.values())

    def __len__(self) -> int:
        return sum(map(len, self.parts))


def identifiers(names: Sequence[str]) -> list[str]:
    """Names of letters from a to z, digits and underscores that all formats take, all different."""
    unique: list[str] = []
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_")[:60] or "plant"
        plain = f"_{plain}" if plain[0].isdigit() else plain
        number = 1
        while (other := plain if number == 1 else f"{plain}_{number}") in unique:
            number += 1
        unique.append(other)
    return unique


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A new folder beside a file, of which all goes to the file's folder when nothing went wrong; else nothing does.

    The file itself, which has the same name in the new folder, goes last.

    Raises
    ------
    TetFloraError
        Something cannot be written; an earlier file stays as it was.
    """
    part = path.with_name(uuid.uuid4().hex.join(PART))
    try:
        if not path.parent.is_dir():
            raise TetFloraError(f"The folder {path.parent} does not exist; create it or choose another")
        if path.is_dir():
            raise TetFloraError(f"{path} is a folder; add a file name")
        part.mkdir()
        yield part
        for file in sorted((f for f in part.rglob("*") if f.is_file()), key=lambda f: f.name == path.name):
            target = path.parent / file.relative_to(part)
            target.parent.mkdir(parents=True, exist_ok=True)
            replace(file, target)
    except OSError as error:
        reason = error.strerror or str(error)
        raise TetFloraError(f"Cannot write {path}: {reason}. Choose another folder, or free some space") from None
    finally:
        with suppress(OSError):
            shutil.rmtree(part)
