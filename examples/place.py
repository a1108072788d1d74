# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A place from files: a valley with a wood, an avenue, a lake and a hamlet, through all four imports.

    python -m examples.place --out out/place.png
    python -m examples.place --data out/place           # only the files, to try the imports with

The files are made here: elevation as an ASCII grid, an inventory as CSV, canopy height as a GeoTIFF, a map as GeoJSON.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from devtools import session
from tests import places_files as files

from . import stage
from .close_ups import render
from .seasons import LOOKS, sky

#: South-western corner in UTM zone 32, and side of the land, meters.
EAST, NORTH, SIDE = 500_000.0, 5_316_000.0, 400.0
_STEP = 4.0
_LAKE, _WOOD = (255.0, 190.0), (110.0, 275.0)
_SUN = (34.0, 245.0)


def height(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Altitude at places from the corner, meters: a valley that rises to the north, with a hollow for the lake."""
    valley = 430.0 + 26.0 * (y / SIDE) ** 2 + 9.0 * np.cos(x / 70.0) + 3.0 * np.sin(x / 31.0 + y / 43.0)
    away = np.hypot(x - _LAKE[0], (y - _LAKE[1]) * 1.3)
    return valley - 7.0 * np.exp(-((away / 45.0) ** 2))


def write(folder: Path) -> None:
    """Write the files."""
    rng = np.random.default_rng(4)
    along = np.arange(0.0, SIDE, _STEP) + _STEP / 2.0
    x, y = np.meshgrid(along, along[::-1])
    (folder / "elevation.asc").write_text(files.ascii_grid(height(x, y), _STEP, EAST, NORTH))
    (folder / "elevation.prj").write_text("EPSG:25832")
    (folder / "trees.csv").write_text(_inventory(rng), encoding="utf-8")
    along = np.arange(SIDE) + 0.5
    x, y = np.meshgrid(along, along[::-1])
    (folder / "canopy.tif").write_bytes(files.geotiff(_canopy(x, y, rng), 1.0, EAST, NORTH + SIDE, 25832))
    (folder / "map.geojson").write_text(_map())


def _road(y: NDArray[np.float64]) -> NDArray[np.float64]:
    return 190.0 + 22.0 * np.sin(y / 80.0)


def _inventory(rng: np.random.Generator) -> str:
    """An avenue of limes and maples along the road, and some old oaks, larches and willows."""
    y = np.repeat(np.arange(8.0, 330.0, 11.0), 2)
    x = _road(y) + np.tile([-6.5, 6.5], len(y) // 2)
    names = np.where(np.arange(len(y)) % 6 < 4, "Tilia cordata", "Acer platanoides 'Globosum'").tolist()
    tall = rng.uniform(11.0, 16.0, len(y))
    rows = [(n, h, 0.5 * h, a, b) for n, h, a, b in zip(names, tall, x, y, strict=True)]
    for name, low, wide, places in (
        ("Stiel-Eiche", 17.0, 1.05, ((60.0, 60.0), (95.0, 105.0), (150.0, 70.0), (290.0, 90.0))),
        ("Lärche", 21.0, 0.35, ((240.0, 110.0), (249.0, 117.0), (236.0, 120.0))),
        ("Salix babylonica", 11.0, 0.9, ((218.0, 168.0), (300.0, 205.0), (285.0, 228.0))),
        ("Betula pendula", 14.0, 0.4, ((300.0, 150.0), (306.0, 143.0), (312.0, 152.0))),
    ):
        rows += [(name, low * rng.uniform(0.85, 1.15), wide * low, *place) for place in places]
    lines = (f"{n};{h:.1f};{w:.1f};{EAST + a:.2f};{NORTH + b:.2f}" for n, h, w, a, b in rows)
    return "Baumart;Höhe (m);Kronendurchmesser (m);X;Y\n" + "\n".join(lines) + "\n"


def _canopy(x: NDArray, y: NDArray, rng: np.random.Generator) -> NDArray[np.float32]:
    """Heights of a wood on the hillside: round crowns 5 m apart or more."""
    out, places = np.zeros_like(x), []
    for east, north in rng.uniform((20.0, 190.0), (190.0, 390.0), (3000, 2)):
        inside = ((east - _WOOD[0]) / 75.0) ** 2 + ((north - _WOOD[1] - 20.0) / 85.0) ** 2 < 1.0
        if inside and all((east - a) ** 2 + (north - b) ** 2 > 25.0 for a, b in places):
            places.append((east, north))
            top = rng.normal(19.0, 3.0)
            off = np.hypot(x - east, y - north) / (2.0 + 0.0075 * top**2)
            out = np.maximum(out, np.where(off < 1.0, top * (1.0 - 0.4 * off**2), 0.0))
    return out.astype(np.float32)


def _map() -> str:
    """Lake, wood, road and houses, as longitude and latitude."""
    from tetflora_addon.geodata.projection import System, to_degrees

    def degrees(points: NDArray[np.float64]) -> list[list[float]]:
        return to_degrees(System(25832), points + [EAST, NORTH]).round(9).tolist()

    def ring(middle: tuple[float, float], wide: float, deep: float, corners: int = 40) -> list[list[list[float]]]:
        turn = np.linspace(0.0, 2.0 * np.pi, corners + 1) + np.pi / corners
        return [degrees(np.stack([wide * np.cos(turn), deep * np.sin(turn)], axis=1) + middle)]

    y = np.arange(0.0, SIDE, 10.0)
    houses = ((220.0, 60.0), (243.0, 72.0), (226.0, 92.0), (160.0, 118.0), (262.0, 55.0))
    return files.collection(
        files.feature("Polygon", ring(_LAKE, 46.0, 30.0), natural="water", name="Lake"),
        files.feature("Polygon", ring((_WOOD[0], _WOOD[1] + 20.0), 75.0, 85.0), landuse="forest"),
        files.feature("LineString", degrees(np.stack([_road(y), y], axis=1)), highway="tertiary"),
        *(files.feature("Polygon", ring(p, 8.0, 6.0, 4), building="yes", height="6") for p in houses),
    )


def build(scene: bpy.types.Scene, folder: Path) -> None:
    """Import everything into an empty scene, with a camera, the sun and a sky."""
    for name, file, options in (
        ("terrain", "elevation.asc", {}),
        ("outlines", "map.geojson", {}),
        ("canopy", "canopy.tif", {"species": "beech:3, spruce:2, maple"}),
        ("inventory", "trees.csv", {}),
    ):
        for obj in bpy.context.selected_objects:
            obj.select_set(False)
        getattr(bpy.ops.tetflora, f"import_{name}")(filepath=str(folder / file), **options)
    origin = scene["tetflora_place"]
    shift = Vector((EAST - origin["east"], NORTH - origin["north"], 0.0))
    stage.camera(scene, Vector((262.0, -50.0, 492.0)) + shift, Vector((190.0, 190.0, 434.0)) + shift, lens=32.0)
    stage.sun(scene, _SUN[0], _SUN[1] - 180.0)
    scene.world = sky(LOOKS["summer"])


def main() -> int:
    """Make the files, and the picture."""
    parser = stage.words(__doc__, Path("out/place.png"), (640, 360), 24)
    parser.add_argument("--data", type=Path, help="write the files here, and nothing else")
    chosen = parser.parse_args()
    session.start()
    if chosen.data:
        chosen.data.mkdir(parents=True, exist_ok=True)
        write(chosen.data)
        return 0
    session.clean_file()
    scene = bpy.context.scene
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder))
        build(scene, Path(folder))
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    render(chosen.out, (chosen.width, chosen.width * 9 // 16), chosen.samples)
    return 0


if __name__ == "__main__":
    sys.exit(main())
