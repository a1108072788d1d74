# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""GeoTIFF: what its values are, and where on Earth they lie.

Tags are those of TIFF 6.0 (Adobe, 1992), its 64-bit kin BigTIFF, and OGC GeoTIFF 1.1 (OGC 19-008r4, 2019); what stands
for "nothing known", scale and offset are GDAL's.
"""

from __future__ import annotations

import math
import re
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import shown
from ..jobs import Progress
from .methods import Definition, Ellipsoid
from .pixels import TABLES, TAGS, Tags
from .prj import described, system_in, utm_zone
from .projection import System, known_systems
from .rasters import Raster, check_regular, system_beside, without_nodata, world_file

_KEYS = {int(number): name for number, name in TABLES["keys"].items()}
_UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}
_OWN, _UTM_ZONES = 32767, 16000  # "user-defined"; and 16100 in the south
_PALETTE = 3


def read_tiff(path: Path) -> Generator[Progress, object, Raster]:
    """Read a GeoTIFF, or a TIFF with a world file; yields progress."""
    check_regular(path)
    with path.open("rb") as file:
        tags = _Tags(file, path.name)
        tags.check_bands()
        (place, system), notes = _place(path, tags), []
        values, absent = yield from tags.pixels()
        absent |= ~(yield from tags.mask(values.shape))
        if (nothing := tags.nothing()) is not None:
            absent |= values == nothing
        values = without_nodata(values.astype(np.float32), nothing if values.dtype.kind == "f" else None)
        values[absent] = np.nan
        scale, offset = tags.scale()
        height = _UNITS.get(tags.keys().get("VerticalUnits", 9001), 1.0)
        if (scale, offset, height) != (1.0, 0.0, 1.0):
            values = without_nodata((values * scale + offset) * np.float32(height), None)
            notes += ["scale and offset of the file used"] * ((scale, offset) != (1.0, 0.0))
            notes += ["heights in feet read as such"] * (height != 1.0)
        if tags.one("PhotometricInterpretation", 1) == _PALETTE:
            notes.append("its values are numbers of colors in a palette; check that they are heights")
        return Raster(values, *place, system, tuple(notes))


def place_of_image(path: Path) -> Raster:
    """Where the pixels of an image lie, as a raster of one value: a TIFF by its tags, others by world files."""
    check_regular(path)
    if path.suffix.lower() not in (".tif", ".tiff"):
        place, system = _place(path)
    else:
        with path.open("rb") as file:
            place, system = _place(path, _Tags(file, path.name))
    return Raster(np.zeros((1, 1), np.float32), *place, system)


def _place(path: Path, tags: _Tags | None = None) -> tuple[list[NDArray[np.float64]], System]:
    """Middle of the first pixel, steps along and down, and the system, by tags or else by files beside the image."""
    place, system = (tags.place(), tags.system()) if tags is not None else (None, System())
    return world_file(path) if place is None else place, system_beside(path) if system == System() else system


class _Tags(Tags):
    """Tags of heights on Earth."""

    def scale(self) -> tuple[np.float32, np.float32]:
        """Factor and summand of values, as GDAL's metadata have them."""
        text, out = self.text("GDAL_METADATA"), []
        for role, usual in (("scale", 1.0), ("offset", 0.0)):
            found = re.search(rf'<Item[^>]*\brole="{role}"[^>]*>([^<]*)<', text)
            try:
                value = float(found[1]) if found else usual
            except ValueError:
                value = math.nan
            if not abs(value) < 1e6:
                raise self.broken("GDAL_METADATA", f"has a {role} of {shown(found[1])}")
            out.append(np.float32(value))
        return out[0], out[1]

    def system(self) -> System:
        """The system that its keys tell."""
        geo, known = self.keys(), known_systems()
        for key in ("ProjectedCitation", "GTCitation", "GeodeticCitation"):
            text = re.search(r"(?:PROJCS|GEOGCS)\s*\[.*", str(geo.get(key, "")), re.DOTALL)
            if text and (found := system_in(text[0])).code:
                return found
        flat, degrees = geo.get("GeodeticCRS", 0), geo.get("GTModelType") == 2
        code = flat if degrees else geo.get("ProjectedCRS", 0)
        unit = float(geo.get("ProjLinearUnitSize", 0.0) or _UNITS.get(geo.get("ProjLinearUnits", 9001), 1.0))
        if code not in (0, _OWN):
            return System(int(code))
        datum = known.get(flat, known[4326])
        axis, flattening = geo.get("EllipsoidSemiMajorAxis", 0.0), geo.get("EllipsoidInvFlattening", 0.0)
        if flat not in known and 6.2e6 < axis < 6.5e6 and flattening > 100.0:
            shift = geo.get("GeogTOWGS84", ())
            shift = shift if isinstance(shift, tuple) and len(shift) in (3, 7) else ()
            datum = Definition("geo", Ellipsoid(axis, flattening), (*shift, *[0.0] * (7 - len(shift))))
        if degrees:
            return System(-2, own=datum)
        south, zone = divmod(int(geo.get("Projection", 0)) - _UTM_ZONES, 100)
        if south in (0, 1) and 1 <= zone <= 60:
            return described("transverse mercator", utm_zone(zone, south == 1), datum)
        numbers = {key: value for key, value in geo.items() if isinstance(value, int | float)}
        given = {name: float(numbers[key]) for key, name in TABLES["figures"].items() if key in numbers}
        given |= {name: unit * given[name] for name in ("east", "north") if name in given}
        try:
            return described(TABLES["methods"].get(str(geo.get("ProjMethod")), ""), given, replace(datum, unit=unit))
        except (ValueError, ZeroDivisionError, OverflowError):
            return System(unit=unit)

    def place(self) -> list[NDArray[np.float64]] | None:
        """Middle of the first pixel, and steps along and down, in the units of the file."""
        matrix = self.numbers("ModelTransformation", 16)
        if matrix:
            m = np.array(matrix[:16], np.float64).reshape(4, 4)
            place, tag = (m[:2, 3], m[:2, 0], m[:2, 1]), "ModelTransformation"
        else:
            scale, tie, tag = self.numbers("ModelPixelScale", 2), self.numbers("ModelTiepoint", 6), "ModelPixelScale"
            if not scale or not tie:
                return None
            along, down = np.array([scale[0], 0.0]), np.array([0.0, -scale[1]])
            place = np.array(tie[3:5]) - tie[0] * along - tie[1] * down, along, down
        place = [*place]
        if self.keys().get("GTRasterType", 1) != 2:  # values belong to areas, whose corner is told
            place[0] = place[0] + (place[1] + place[2]) / 2.0
        if not np.abs(np.concatenate(place)).max() < 1e10 or not abs(np.linalg.det(np.stack(place[1:]))) > 0.0:
            raise self.broken(tag, "gives cells without a size or a place")
        return place

    def keys(self) -> dict[str, Any]:
        """Geographic keys that are known here: whole numbers, numbers, tuples of numbers, and texts."""
        values = self.numbers("GeoKeyDirectory", 4)
        if not values:
            return {}
        if len(values) < 4 + 4 * int(values[3]):
            raise self.broken("GeoKeyDirectory", f"tells of {values[3]} keys and is too short for them")
        doubles, texts = self.numbers("GeoDoubleParams"), self.text("GeoAsciiParams")
        out: dict[str, Any] = {}
        for key, place, number, at in np.array(values[4 : 4 + 4 * int(values[3])], np.int64).reshape(-1, 4).tolist():
            if place == 0:
                out[_KEYS.get(key, "")] = at
            elif TAGS.get(place) == "GeoDoubleParams" and 0 <= at < len(doubles):
                out[_KEYS.get(key, "")] = doubles[at] if number == 1 else doubles[at : at + number]
            elif TAGS.get(place) == "GeoAsciiParams":
                out[_KEYS.get(key, "")] = texts[at : at + number]
        return out

    def nothing(self) -> float | None:
        """Value of pixels of which nothing is known."""
        text = self.text("GDAL_NODATA")
        try:
            return float(text.split("\0")[0]) if text.strip("\0 ") else None
        except ValueError:
            raise self.broken("GDAL_NODATA", f"is {shown(text)}, which is not a number; correct it") from None
