# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real places: inventories of 100,000 trees, sizes of refined ones, canopy heights there and back, broken files.

Sizes are those of fully grown meshes: height to the highest vertex, crown width the mean of the extents to east and
north. The canopy height model is that of a mixed stand of beeches and spruces that was planted 5 to 7 m apart, with
heights about 20 m and crown widths after Popescu and Wynne within 15 %, grown in full, rasterized at half a meter (the
highest vertex of each cell) and averaged to cells of a meter; what is imported from it is grown and rasterized in the
same way, with the right mixture but other individuals, and species by chance.
"""

from __future__ import annotations

import random
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from devtools import session
from tests import places_files as files
from tests import places_inventories as inventories
from tests import places_maps as maps
from tetflora_addon.blender.job.contents import compile_for, read_scene
from tetflora_addon.emission.plants import expanded_blocks
from tetflora_addon.geodata.inventories import preview
from tetflora_addon.growth.seeds import Seeds

from .report import Targets, apart

TREES, QUICK_TREES = 100_000, 10_000
#: Trees that are grown in full, and those of the stand.
SAMPLE, QUICK_SAMPLE = 120, 24
#: Side of the stand in meters, and of the strip within its border that does not count.
STAND, QUICK_STAND, BORDER = 36, 30, 4
MUTATED, QUICK_MUTATED = 500, 5  # of each kind
#: Species, and how wide their crowns are over their height, from trees in a row to those by themselves.
SPECIES = {
    "Quercus robur": (0.5, 1.0),
    "Fagus sylvatica": (0.35, 0.7),
    "Tilia cordata": (0.35, 0.65),
    "Picea abies": (0.2, 0.4),
    "Acer platanoides": (0.4, 0.7),
    "Betula pendula": (0.3, 0.5),
}
_CLOSE = 0.05
_SLOW = 5.0  # seconds that nobody waits for a small file

TARGETS: Targets = {
    "inventory_s": {"max": 30.0},
    "preview_s": {"max": 1.0},
    "cases_wrong": {"max": 0.0},
    "titles_read": {"min": 0.95},
    "names_unknown": {"max": 12.0},
    "within_5_percent": {"min": 0.95},
    "chm_rmse_m": {"max": 1.0},
    "mutated_files": {"min": 500.0 * len(files.FILES)},
    "mutated_bad": {"max": 0.0},
}
QUICK_TARGETS: Targets = {name: t for name, t in TARGETS.items() if name not in ("mutated_files", "chm_rmse_m")}


def inventory(number: int, rng: np.random.Generator) -> str:
    """Trees of six species in equal parts: heights 4 to 28 m, crowns as `SPECIES` has them, longitude and latitude."""
    height = rng.uniform(4.0, 28.0, number)
    girth = np.pi * height * rng.uniform(1.2, 2.2, number)
    name = rng.integers(0, len(SPECIES), number)
    width = height * rng.uniform(*np.array(list(SPECIES.values()))[name].T)
    x, y = rng.uniform(9.0, 9.05, number), rng.uniform(48.0, 48.04, number)
    rows = zip(name.tolist(), *(v.tolist() for v in (height, girth, width, x, y)), strict=True)
    names = tuple(SPECIES)
    lines = (f"{n},{names[s]},{h:.1f},{g:.0f},{w:.1f},{a:.7f},{b:.7f}" for n, (s, h, g, w, a, b) in enumerate(rows))
    return "id,species,height_m,girth_cm,crown_width_m,lon,lat\n" + "\n".join(lines) + "\n"


def grown() -> tuple[Any, Seeds]:
    """Compiled species and plants of the scene."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seeds = read_scene(scene, depsgraph).seeds
    return compile_for(seeds.identifiers, scene, depsgraph), seeds


def positions(flora: Any, seeds: Seeds) -> NDArray[np.float32]:
    """Vertices of plants that are grown in full."""
    return np.concatenate([block.buffers.positions for block in expanded_blocks(flora, seeds)])


def refined_sizes(sample: int) -> dict[str, float]:
    """How near the sizes of a sample of the field's plants are to what is recorded, grown in full."""
    field = bpy.context.view_layer.objects.active
    recorded = np.zeros((2, len(field.data.vertices)), np.float32)
    for row, name in zip(recorded, ("tf_height", "tf_crown_width"), strict=True):
        field.data.attributes[name].data.foreach_get("value", row)
    flora, seeds = grown()
    off = []
    for i in np.random.default_rng(5).choice(len(seeds), sample, replace=False).tolist():
        points = positions(flora, seeds.take(np.array([i]))) - seeds.position[i].astype(np.float32)
        extent = np.ptp(points, axis=0)
        off.append([points[:, 2].max() / recorded[0, i] - 1.0, extent[:2].mean() / recorded[1, i] - 1.0])
    off = np.abs(np.array(off))
    return {
        "height_within_5_percent": float((off[:, 0] < _CLOSE).mean()),
        "width_within_5_percent": float((off[:, 1] < _CLOSE).mean()),
        "within_5_percent": float((off < _CLOSE).all(axis=1).mean()),
        "worst_height": float(off[:, 0].max()),
        "worst_width": float(off[:, 1].max()),
    }


def rasterized(points: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Canopy heights (side, side) of a square about the origin, cells of a meter, the northernmost row first."""
    cells = 2 * side
    column, row = np.floor(2.0 * (points[:, :2].T + side / 2.0)).astype(np.int64)
    inside = (column >= 0) & (row >= 0) & (column < cells) & (row < cells)
    out = np.zeros(cells * cells, np.float32)
    np.maximum.at(out, row[inside] * cells + column[inside], points[inside, 2])
    out = out.reshape(side, 2, side, 2).mean(axis=(1, 3))
    return np.ascontiguousarray(out[::-1])


def averaged(values: NDArray[np.float32], step: int) -> NDArray[np.float32]:
    """Means of blocks of cells."""
    h, w = (n // step * step for n in values.shape)
    return values[:h, :w].reshape(h // step, step, w // step, step).mean(axis=(1, 3))


def stand(side: int, rng: np.random.Generator) -> str:
    """An inventory of a closed stand in meters, around the origin."""
    places: list[NDArray[np.float64]] = []
    for place in rng.uniform(-side / 2.0, side / 2.0, (4000, 2)):
        if all(np.hypot(*(place - other)) > 5.0 for other in places):
            places.append(place)
    height = np.clip(rng.normal(20.0, 3.0, len(places)), 12.0, 27.0)
    width = (2.51503 + 0.00901 * height**2) * rng.uniform(0.85, 1.15, len(places))
    names = np.where(rng.random(len(places)) < 0.6, "Fagus sylvatica", "Picea abies")
    rows = zip(names, height, width, *np.array(places).T, strict=True)
    return "species,height_m,crown_width_m,x,y\n" + "".join(
        f"{n},{h:.2f},{w:.2f},{x:.2f},{y:.2f}\n" for n, h, w, x, y in rows
    )


def canopy(folder: Path, side: int) -> dict[str, float]:
    """Root mean square of the difference of canopy heights, imported and of what became of them."""
    session.clean_file()
    path = folder / "stand.csv"
    path.write_text(stand(side, np.random.default_rng(7)))
    bpy.ops.tetflora.import_inventory(filepath=str(path))
    planted = len(bpy.context.view_layer.objects.active.data.vertices)
    corner = np.array([bpy.context.scene["tetflora_place"][name] for name in ("east", "north")])
    flora, seeds = grown()
    given = rasterized(positions(flora, seeds) + np.array([*corner, 0.0], np.float32), side)
    session.clean_file()
    path = folder / "chm.tif"
    path.write_bytes(files.geotiff(given, 1.0, west=-side / 2.0, north=side / 2.0, epsg=32767))
    bpy.ops.tetflora.import_canopy(filepath=str(path), species="beech:3, spruce:2")
    found = len(bpy.context.view_layer.objects.active.data.vertices)
    flora, seeds = grown()
    made = rasterized(positions(flora, seeds), side)
    inner = np.s_[BORDER:-BORDER, BORDER:-BORDER]
    given, made = given[inner], made[inner]
    out = {"chm_trees_planted": float(planted), "chm_trees_found": float(found), "chm_mean_m": float(given.mean())}
    for step, name in (
        (1, "chm_rmse_m"),
        (2, "chm_rmse_2m_cells"),
        (5, "chm_rmse_5m_cells"),
        (10, "chm_rmse_10m_cells"),
    ):
        out[name] = float(np.sqrt(((averaged(given, step) - averaged(made, step)) ** 2).mean()))
    return out | {"chm_bias_m": float((made - given).mean())}


def mutate(number: int, folder: str) -> dict[str, float]:
    """Import so many broken files of each kind through their operators; what is refused must leave nothing behind."""
    counts, slowest = {"imported": 0, "refused": 0, "bad": 0}, 0.0
    kinds = list(files.FILES)
    session.clean_file()
    for seed in range(number * len(kinds)):
        kind = kinds[seed % len(kinds)]
        operator, path = files.write(Path(folder), kind, files.mutated(random.Random(seed), files.FILES[kind][2]))
        before = _counted()
        start = time.monotonic()
        try:
            getattr(bpy.ops.tetflora, operator)(filepath=str(path))
            counts["imported"] += 1
            session.clean_file()
        except RuntimeError as error:
            counts["refused"] += 1
            counts["bad"] += "Traceback" in str(error) or _counted() != before
        spent = time.monotonic() - start
        counts["bad"] += spent > _SLOW
        slowest = max(slowest, spent)
    return {**{f"mutated_{k}": float(v) for k, v in counts.items()}, "mutated_slowest_s": slowest}


def _counted() -> list[int]:
    lists = ("objects", "meshes", "curves", "collections", "images", "materials")
    return [*(len(getattr(bpy.data, name)) for name in lists), len(bpy.context.scene.keys())]


def run(quick: bool) -> dict[str, Any]:
    """The figures."""
    out: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "trees.csv"
        path.write_text(inventory(QUICK_TREES if quick else TREES, np.random.default_rng(1)))
        out |= inventories.figures()
        found = maps.figures()
        out |= {key: out[key] + found[key] for key in found}
        start = time.monotonic()
        preview(path)
        out["preview_s"] = time.monotonic() - start
        session.clean_file()
        start = time.monotonic()
        bpy.ops.tetflora.import_inventory(filepath=str(path))
        out["inventory_s"] = time.monotonic() - start
        out |= refined_sizes(QUICK_SAMPLE if quick else SAMPLE)
        out |= canopy(folder, QUICK_STAND if quick else STAND)
        # A process of its own, so that a crash is one figure and not the end of all.
        number = QUICK_MUTATED if quick else MUTATED
        out |= {"mutated_files": float(number * len(files.FILES)), "mutated_bad": 1.0}
        with suppress(RuntimeError):
            out |= apart(mutate, number, str(folder), timeout=1800)
    return out
