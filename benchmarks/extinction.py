# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How much light passes through plants, and through the even fogs that stand for them.

Rays are cast through the polygons of whole plants, and through tetrahedra of several sizes that are filled evenly with
the polygons whose middle they hold. |dT| is the difference of what both let through, as a mean over the rays that meet
a polygon or a tetrahedron with contents: the error of the mean opacity of a plant's silhouette. *before* has the
extinction that follows from the area alone, *after* the fitted one (`compiled.clumping`). *crown* are tetrahedra
of a sixteenth of the plant's extent, *fine* those of three leaves, *coarse* those of a sixth of the extent, seen from
3, 17, 37 and 64 degrees above the horizon. Neither seeds nor directions are those of the fit. With a few thousand rays,
chance alone makes .005.

*seconds* is what the fit takes, processor time once for each species; compiling does not wait for it.
"""

from __future__ import annotations

import time
from statistics import mean, median
from typing import Any

import numpy as np

from tetflora_addon.compiled import clumping, rays
from tetflora_addon.compiled.flora import _compiled
from tetflora_addon.growth import growth, seeds
from tetflora_addon.refinement import contents
from tetflora_addon.species import catalog
from tetflora_addon.subplants import leaf_meshes, pieces, tubes

from .plants import Targets

SPECIES = ("oak", "birch", "spruce", "scots_pine", "willow", "maple", "bush", "fern")
QUICK_SPECIES = ("birch", "bush")
SEEDS, QUICK_SEEDS = (5001, 5002, 5003), (5001,)
HEIGHTS = (0.05, 0.3, 0.6, 0.9)  # sines of the angles above the horizon
RAYS = 72  # to a side of what is looked at
KINDS = ("fine", "crown", "coarse")

TARGETS: Targets = {
    "crown_after_mean": {"max": 0.03},
    "after_mean": {"max": 0.03},
    "seconds_median": {"max": 0.3},
}
QUICK_TARGETS: Targets = {"after_mean": {"max": 0.05}}


def run(quick: bool) -> dict[str, float]:
    """Measure the species one by one."""
    figures: dict[str, float] = {}
    all_errors: dict[str, list[float]] = {f"{kind}_{when}": [] for kind in KINDS for when in ("before", "after")}
    taken = []
    for name in QUICK_SPECIES if quick else SPECIES:
        flora = _compiled.__wrapped__((catalog.load_species(name),))
        start = time.process_time()
        _ = flora.clumping
        taken.append(time.process_time() - start)
        errors = species_errors(flora, QUICK_SEEDS if quick else SEEDS)
        figures[f"seconds_{name}"] = taken[-1]
        for key, values in errors.items():
            all_errors[key] += values
            figures[f"{key}_mean_{name}"] = mean(values)
            figures[f"{key}_max_{name}"] = max(values)
    whole = {f"{key}_mean": mean(values) for key, values in all_errors.items()}
    whole |= {f"{key}_max": max(values) for key, values in all_errors.items()}
    for when in ("before", "after"):
        values = [v for key, some in all_errors.items() if key.endswith(when) for v in some]
        whole |= {f"{when}_mean": mean(values), f"{when}_max": max(values)}
    return whole | {"seconds_median": median(taken), "seconds_max": max(taken)} | figures


def species_errors(flora: Any, seeds: tuple[int, ...]) -> dict[str, list[float]]:
    """|dT| of each plant and direction, by size of the cells and before or after the fit."""
    out: dict[str, list[float]] = {f"{kind}_{when}": [] for kind in KINDS for when in ("before", "after")}
    for seed in seeds:
        surfaces, places, weights, coefficients = grown(flora, seed)
        points = np.concatenate([center for _, _, _, center, _, _ in surfaces])
        low, high = points.min(axis=0), points.max(axis=0)
        extent = float((high - low).max())
        width = float(flora.leaf_width[flora.first_row[0]])
        sizes = (max(3 * width, extent / 60), max(extent / 16, 2 * width), max(extent / 6, 3 * width))
        for d, height in enumerate(HEIGHTS):
            turn, level = 2.4 * d + seed, np.sqrt(1 - height * height)
            direction = np.array([level * np.cos(turn), level * np.sin(turn), height])
            origin, met = seen(surfaces, direction)
            for kind, size in zip(KINDS, sizes, strict=True):
                fogs = depths(surfaces, places, weights, coefficients, (low, high), direction, origin, size)
                used = met | (fogs[0] > 0)
                for when, depth in zip(("before", "after"), fogs, strict=True):
                    out[f"{kind}_{when}"].append(abs(float((np.exp(-depth) - ~met)[used].mean())))
    return out


def grown(flora: Any, seed: int) -> tuple[list[tuple], np.ndarray, np.ndarray, np.ndarray]:
    """Polygons of a plant, and the places, expected areas and coefficients of the pieces of its branches.

    Polygons are corners (c, 3), first corners and numbers (f,), middles and area vectors (f, 3), and a weight.
    """
    plant = seeds.Seeds(("",), np.zeros(1, np.int32), np.array([seed]), np.zeros((1, 3)), np.eye(3)[None], np.ones(1))
    surfaces, places, weights, coefficients = [], [], [], []
    for whole in pieces.expand(flora, growth.trunks(flora.rows, plant)):
        own, _ = pieces.whole_pieces(flora.rows, whole)
        held = contents.piece_totals(flora, own)
        places.append((own.start + own.end) / 2)
        weights.append(held.leaf_area + held.wood_area / 2)
        coefficients.append(flora.clumping.coefficients(own.branches, flora.clumping.own))
        leaves = leaf_meshes.leaf_meshes(flora, 0, [whole])
        surfaces += [polygons(leaf.buffers, 1.0) for leaf in leaves]
        surfaces.append(polygons(tubes.tube_buffers(flora, [whole]), 0.5))
    return surfaces, np.concatenate(places), np.concatenate(weights), np.concatenate(coefficients)


def polygons(buffers: Any, weight: float) -> tuple:
    """Faces of a mesh as `grown` describes them."""
    first, number = buffers.face_offsets[:-1].astype(np.int64), np.diff(buffers.face_offsets)
    corners = buffers.positions[buffers.corner_verts].astype(np.float64)
    following = np.arange(1, len(corners) + 1)
    following[first + number - 1] = first
    x, y, z = np.ascontiguousarray(corners.T)
    center = np.stack([np.add.reduceat(axis, first) / number for axis in (x, y, z)], axis=1)
    x, y, z = (axis - np.repeat(middle, number) for axis, middle in zip((x, y, z), center.T, strict=True))
    pairs = ((y, z), (z, x), (x, y))
    vector = [np.add.reduceat(a * b[following] - b * a[following], first) / 2 for a, b in pairs]
    return corners, first, number, center, np.stack(vector, axis=1), weight


def seen(surfaces: list[tuple], direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origins (k, 3) of parallel rays over polygons, and whether each meets any (k,)."""
    across = np.stack(rays.basis(direction), axis=1)
    flat = [corners @ across for corners, *_ in surfaces]
    low, high = np.min([f.min(axis=0) for f in flat], axis=0), np.max([f.max(axis=0) for f in flat], axis=0)
    spacing = float(np.sqrt((high - low).prod())) / RAYS
    low = low / spacing - 0.37
    shape = np.ceil(high / spacing - low + 1).astype(np.int64)
    met = np.zeros(shape.prod(), bool)
    for one, (_, first, number, *_) in zip(flat, surfaces, strict=True):
        _, ray = rays.covered(one / spacing - low, first, number)
        inside = ((ray >= 0) & (ray < shape)).all(axis=1)
        met[ray[inside, 0] * shape[1] + ray[inside, 1]] = True
    i = np.arange(len(met))
    return ((np.stack([i // shape[1], i % shape[1]], axis=1) + low) * spacing) @ across.T, met


def depths(
    surfaces: list[tuple],
    places: np.ndarray,
    weights: np.ndarray,
    coefficients: np.ndarray,
    box: tuple[np.ndarray, np.ndarray],
    direction: np.ndarray,
    origin: np.ndarray,
    size: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Optical depths (k,), (k,) of rays through evenly filled tetrahedra: by area alone, and as fitted."""
    side = size * 6 ** (1 / 3)
    corner = box[0] - 0.41 * side
    shape = np.maximum(np.ceil((box[1] - corner) / side), 1).astype(np.int64)
    count = 6 * int(shape.prod())
    kappa = np.zeros(count)
    for _, _, _, center, vector, weight in surfaces:
        cell = rays.cell_numbers((center - corner).T / side, shape)
        kappa += np.bincount(cell, weight * np.abs(vector @ direction), count) / size**3
    cell = rays.cell_numbers((places - corner).T / side, shape)
    area = np.bincount(cell, weights, count)
    sums = np.stack([np.bincount(cell, weights * coefficients[:, k], count) for k in (0, 1)], axis=1)
    usual = weights @ coefficients / weights.sum()  # leaves reach into cells that hold no branch
    mean_coefficients = np.where(area[:, None] > 0, sums / np.where(area > 0, area, 1)[:, None], usual)
    factor = clumping.factors(mean_coefficients, np.full(count, size**3))
    ray, at, length = rays.path_lengths((origin - corner) / side, direction, shape)
    depth = kappa[at] * length * side
    return np.bincount(ray, depth, len(origin)), np.bincount(ray, depth * factor[at], len(origin))
