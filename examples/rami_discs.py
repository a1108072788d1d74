# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Canopies of RAMI as numbers: which crowns of discs stand where, and the discs themselves, drawn anew from seeds.

Definitions and published curves are in ``examples/data/rami.json``. What that does not tell follows the descriptions of
RAMI-IV and V: HET10 and HET20 are crowns like HET01's, a twentieth as large; homogeneous layers are 1 m thick, of discs
of 0.05 m; HOM26 is an erectophile layer of leaf area index 1 above a planophile one of 5. No crown crosses the border
of its scene or another crown.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from math import exp, pi, sin, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

DATA = Path(__file__).resolve().parent / "data" / "rami.json"
CURVES = ("HET01", "HET04", "HET06")
COVERS = ("HOM23", "HOM33", "HOM26", "HET10", "HET20")
CORNERS = 8
#: Side of HET06, meters: the data gives the size of one tree under this name, the definition says 500.
_HET06_SIDE = 500.0
#: Side of the scenes that are seen from above only, and radius of the discs of layers, meters.
_LAYER_SIDE = 10.0
_LAYER_DISC = 0.05
#: Places that are tried for a crown.
_TRIES = 10_000


@dataclass(frozen=True)
class Solid:
    """Discs evenly distributed in a solid.

    Attributes
    ----------
    shape : str
        ``sphere`` (around the origin), ``cylinder``, ``cone`` or ``box``; these stand on z = 0.
    radius, height : float
        Meters; half of the side of a box.
    discs : int
    disc_radius : float
        Meters.
    reflectance, transmittance : float
    inclination : str
        ``spherical``, ``planophile`` or ``erectophile``.
    trunk : tuple of float
        Height, radius (meters) and reflectance of a cylinder below; empty without.
    apart : bool
        No disc cuts another: so in RAMI's own files. What Eradiate draws itself, HET06, is independent.
    """

    shape: str
    radius: float
    height: float
    discs: int
    disc_radius: float
    reflectance: float = 0.5
    transmittance: float = 0.4
    inclination: str = "spherical"
    trunk: tuple[float, ...] = ()
    apart: bool = True

    @property
    def leaf_area(self) -> float:
        """One side of all discs, square meters."""
        return self.discs * pi * self.disc_radius**2

    @property
    def across(self) -> float:
        """Width, meters."""
        return 2 * self.radius


@dataclass(frozen=True)
class Canopy:
    """A scene of RAMI.

    Attributes
    ----------
    name : str
    side, top : float
        Of the square target around the origin, and the height that it is at, meters.
    ground : float
        Reflectance.
    sun_zenith : float
        Degrees.
    padding : int
        Copies on each side that a view at 75 degrees and a few scatterings reach; 0 for open borders.
    solids : dict of str to Solid
    places : dict of str to (n, 3)
        Origins of the crowns of each kind, meters.
    """

    name: str
    side: float
    top: float
    ground: float
    sun_zenith: float
    padding: int
    solids: dict[str, Solid]
    places: dict[str, NDArray[np.float64]]

    @property
    def leaf_area_index(self) -> float:
        """Leaf area over ground area."""
        areas = {kind: solid.leaf_area * len(self.places[kind]) for kind, solid in self.solids.items()}
        grounds = {kind: s.across if s.shape == "box" else self.side for kind, s in self.solids.items()}
        return sum(area / grounds[kind] ** 2 for kind, area in areas.items())

    @property
    def expected_cover(self) -> float:
        """Share of the ground that is covered from above, if leaves are infinitely small and independent.

        1 − e^{−G L} under a layer. Under a sphere of optical depth τ along its diameter, 1 − 2 (1 − (1 + τ) e^{−τ})
        / τ² of its disc, the mean of 1 − e^{−τ c} over chords of c diameters, whose density is 2 c.
        """
        depths = {kind: extinction(solid.inclination) * solid.leaf_area for kind, solid in self.solids.items()}
        clear, covered = 1.0, 0.0
        for kind, solid in self.solids.items():
            if solid.shape == "box":
                clear *= exp(-depths[kind] / solid.across**2)
            else:
                depth = depths[kind] / (4 / 3 * pi * solid.radius**3) * solid.across
                share = 1 - 2 * (1 - (1 + depth) * exp(-depth)) / depth**2
                covered += share * len(self.places[kind]) * pi * solid.radius**2 / self.side**2
        return 1 - clear + covered

    def padded(self, kind: str, rings: int | None = None) -> NDArray[np.float64]:
        """Places (n, 3) of a kind with those of the copies around, the scene itself first."""
        rings = self.padding if rings is None else rings
        steps = np.arange(-rings, rings + 1)
        shifts = np.array([(i, j, 0.0) for i in steps for j in steps]) * self.side
        shifts = shifts[np.argsort(np.abs(shifts).max(axis=1), kind="stable")]
        return (shifts[:, None] + self.places[kind][None]).reshape(-1, 3)


@cache
def data() -> dict:
    """All that the file holds."""
    return json.loads(DATA.read_text(encoding="utf-8"))


def published(name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """View zeniths (76,), degrees, negative on the sun's side, and the factors (76,) there.

    The list has a 4 where its even steps of two degrees have 5, and the factor lies on the curve at 5.
    """
    return np.arange(-75.0, 75.5, 2.0), np.array(data()[name]["brf"])


@cache
def canopy(name: str, seed: int = 0) -> Canopy:
    """A scene by its name in `CURVES` or `COVERS`.

    Parameters
    ----------
    name : str
    seed : int
        For places that are not published.
    """
    given = data().get(name, {})
    ground, sun = given.get("ground", 0.0), given.get("sun_zenith_deg", 20)
    if name == "HET01":
        crown = given["crown"]
        solid = _solid("sphere", crown, radius=crown["radius_m"])
        return Canopy(name, 100.0, 30.0, ground, sun, 4, {"crown": solid}, {"crown": np.array(given["centers_m"])})
    if name == "HET04":
        spheres, cylinders = given["spheres"], given["cylinders"]
        solids = {
            "sphere": _solid("sphere", spheres, radius=spheres["radius_m"]),
            "cylinder": _solid("cylinder", cylinders, cylinders["radius_m"], cylinders["height_m"]),
        }
        heights = {"sphere": spheres["center_z_m"], "cylinder": cylinders["base_z_m"]}
        numbers = {"sphere": spheres["count"], "cylinder": cylinders["count"]}
        places = _scattered(solids, numbers, heights, given["x_y_range_m"], seed)
        return Canopy(name, 270.0, 15.0, ground, sun, 1, solids, places)
    if name == "HET06":
        tree = given["trees"]
        trunk = (tree["trunk_height_m"], tree["trunk_radius_m"], tree["trunk_reflectance"])
        solids = {"tree": _solid("cone", tree, tree["cone_radius_m"], tree["cone_height_m"], trunk)}
        places = _scattered(solids, {"tree": tree["count"]}, {"tree": (0.0, 0.0)}, given["x_y_range_m"], seed)
        return Canopy(name, _HET06_SIDE, 6.75, ground, sun, 0, solids, places)
    if name in ("HET10", "HET20"):
        share = 0.2 if name == "HET10" else 0.4
        solids = {"crown": Solid("sphere", 0.5, 1.0, 49_999, 0.005)}
        number = round(share * _LAYER_SIDE**2 / (pi * 0.25))
        side = sqrt(number * pi * 0.25 / share)
        places = _scattered(solids, {"crown": number}, {"crown": (0.51, 0.51)}, side / 2 - 0.5, seed)
        return Canopy(name, side, 1.01, ground, sun, 0, solids, places)
    layers = {"HOM23": ((1.0, "planophile"),), "HOM33": ((1.0, "erectophile"),)}
    layers["HOM26"] = (5.0, "planophile"), (1.0, "erectophile")
    # Discs of the surroundings reach over the border of the target.
    half = _LAYER_SIDE / 2 + 2 * _LAYER_DISC
    solids = {}
    for index, inclination in layers[name]:
        number = round(index * (2 * half) ** 2 / (pi * _LAYER_DISC**2))
        solids[inclination] = Solid("box", half, 1.0, number, _LAYER_DISC, inclination=inclination)
    places = {kind: np.array([(0.0, 0.0, float(layer))]) for layer, kind in enumerate(solids)}
    return Canopy(name, _LAYER_SIDE, float(len(solids)), ground, sun, 0, solids, places)


def _solid(shape: str, given: dict, radius: float, height: float = 0.0, trunk: tuple[float, ...] = ()) -> Solid:
    size = given["discs"], given["disc_radius_m"], given["reflectance"], given["transmittance"]
    return Solid(shape, radius, height or 2 * radius, *size, trunk=trunk, apart=not trunk)


def _scattered(
    solids: dict[str, Solid], numbers: dict[str, int], heights: dict[str, tuple], reach: float, seed: int
) -> dict[str, NDArray[np.float64]]:
    """Even random places, one after the other where none of those before is too near, seen from above."""
    random = np.random.default_rng(seed)
    kinds = np.concatenate([np.full(n, i) for i, n in enumerate(numbers.values())])
    random.shuffle(kinds)
    radii = np.array([solid.radius for solid in solids.values()])
    cell = 2 * radii.max()
    grid: dict[tuple[int, int], list[tuple[float, float, float]]] = {}
    found: dict[int, list[tuple[float, float]]] = {i: [] for i in range(len(radii))}
    for kind in kinds.tolist():
        radius = radii[kind]
        for _ in range(_TRIES):
            x, y = random.uniform(-reach, reach, 2).tolist()
            i, j = int(x // cell), int(y // cell)
            near = [p for a in (i - 1, i, i + 1) for b in (j - 1, j, j + 1) for p in grid.get((a, b), ())]
            if all((x - u) ** 2 + (y - v) ** 2 >= (radius + r) ** 2 for u, v, r in near):
                grid.setdefault((i, j), []).append((x, y, radius))
                found[kind].append((x, y))
                break
        else:
            raise RuntimeError("no room for all crowns")
    places = {}
    for number, kind in enumerate(solids):
        plane = np.array(found[number])
        places[kind] = np.column_stack([plane, random.uniform(*heights[kind], len(plane))])
    return places


def discs(solid: Solid, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centers (n, 3), meters, evenly in the solid, and unit normals (n, 3) of its discs.

    Where they do not cut each other they hide less of each other: a crown of HET01 covers .877 instead of .874.
    """
    random = np.random.default_rng(seed)
    centers, normals = _drawn(random, solid, solid.discs)
    while solid.apart:
        again = np.unique(intersecting(centers, normals, solid.disc_radius)[1])
        if not len(again):
            break
        centers[again], normals[again] = _drawn(random, solid, len(again))
    return centers, normals


def _drawn(random: np.random.Generator, solid: Solid, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Independent ones."""
    normals = _directions(random, n, solid.inclination)
    if solid.shape == "sphere":
        centers = _directions(random, n, "spherical") * (solid.radius * np.cbrt(random.random(n)))[:, None]
        centers[:, 2] *= random.choice((-1.0, 1.0), n)
        return centers, normals
    if solid.shape == "box":
        plane = random.uniform(-solid.radius, solid.radius, (n, 2))
        return np.column_stack([plane, random.random(n) * solid.height]), normals
    # Cross-sections of a cone grow with the square of the distance from its tip.
    above = 1 - np.cbrt(random.random(n)) if solid.shape == "cone" else random.random(n)
    widths = solid.radius * np.sqrt(random.random(n)) * (1 - above if solid.shape == "cone" else 1.0)
    turn = random.uniform(0, 2 * pi, n)
    base = solid.trunk[0] if solid.trunk else 0.0
    return np.column_stack([widths * np.cos(turn), widths * np.sin(turn), base + above * solid.height]), normals


def intersecting(
    centers: NDArray[np.float64], normals: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs (p,), (p,) of discs of one radius that cut each other.

    Two discs do if they reach over the line in which their planes meet, and the chords of that line overlap.
    """
    cells = np.floor((centers - centers.min(axis=0)) / (2 * radius)).astype(np.int64) + 1
    size = cells.max(axis=0) + 2
    weights = np.array([size[1] * size[2], size[2], 1])
    key = cells @ weights
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    steps = [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if (i, j, k) >= (0, 0, 0)]
    firsts, seconds = [], []
    for step in steps:
        low = np.searchsorted(ordered, key + np.array(step) @ weights, "left")
        number = np.searchsorted(ordered, key + np.array(step) @ weights, "right") - low
        first = np.repeat(np.arange(len(key)), number)
        second = order[np.repeat(low - (np.cumsum(number) - number), number) + np.arange(len(first))]
        kept = first < second if step == (0, 0, 0) else np.full(len(first), True)
        firsts.append(first[kept])
        seconds.append(second[kept])
    a, b = np.concatenate(firsts), np.concatenate(seconds)
    between = centers[b] - centers[a]
    near = (between**2).sum(axis=1) < 4 * radius**2
    a, b, between = a[near], b[near], between[near]
    line = np.cross(normals[a], normals[b])
    squared = (line**2).sum(axis=1)
    cosine = (normals[a] * normals[b]).sum(axis=1)
    sine = np.sqrt(np.maximum(squared, 1e-12))
    # Distance from each center to the line, in its own plane, and where along the line it is nearest.
    away_a = np.abs((between * normals[b]).sum(axis=1)) / sine
    away_b = np.abs((between * normals[a]).sum(axis=1)) / sine
    apart = np.abs((between * line).sum(axis=1)) / sine
    half_a, half_b = (np.sqrt(np.maximum(radius**2 - away**2, 0)) for away in (away_a, away_b))
    cut = (away_a < radius) & (away_b < radius) & (apart < half_a + half_b) & (np.abs(cosine) < 1 - 1e-9)
    return a[cut], b[cut]


def _directions(random: np.random.Generator, n: int, inclination: str) -> NDArray[np.float64]:
    """Unit normals (n, 3) of the upper half-space by the distribution of their zenith (Bunnik 1978, as RAMI has it)."""
    if inclination == "spherical":
        cosine = random.random(n)
    else:
        # Density (2 / π) (1 ± cos 2θ): the distribution function (2 θ ± sin 2θ) / π, inverted on a table.
        table = np.linspace(0, pi / 2, 4001)
        sign = 1 if inclination == "planophile" else -1
        cosine = np.cos(np.interp(random.random(n), (2 * table + sign * np.sin(2 * table)) / pi, table))
    turn, sine = random.uniform(0, 2 * pi, n), np.sqrt(1 - cosine**2)
    return np.column_stack([sine * np.cos(turn), sine * np.sin(turn), cosine])


def polygons(centers: NDArray[np.float64], normals: NDArray[np.float64], radius: float) -> NDArray[np.float32]:
    """Corners (n, `CORNERS`, 3) of regular polygons that have the area of the discs."""
    helper = np.where(np.abs(normals[:, 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    first = np.cross(normals, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    reach = radius * sqrt(2 * pi / (CORNERS * sin(2 * pi / CORNERS)))
    turn = np.arange(CORNERS) * (2 * pi / CORNERS)
    around = np.cos(turn)[:, None] * first[:, None] + np.sin(turn)[:, None] * second[:, None]
    return (centers[:, None] + reach * around).astype(np.float32)


def extinction(inclination: str) -> float:
    """Mean area that leaves of a distribution show to the zenith, as a fraction (G)."""
    return {"spherical": 0.5, "planophile": 8 / (3 * pi), "erectophile": 4 / (3 * pi)}[inclination]
