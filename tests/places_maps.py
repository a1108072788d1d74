# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rasters and outlines that are written in unusual ways: what is right of each, and what is read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import zstandard

from tetflora_addon.errors import SceneError
from tetflora_addon.geodata.canopy import checked_canopy
from tetflora_addon.geodata.geotiff import use_zstandard
from tetflora_addon.geodata.grids import read_grid
from tetflora_addon.geodata.outlines import read_outlines
from tetflora_addon.geodata.projection import between, chosen_system, place_about
from tetflora_addon.geodata.rasters import in_degrees
from tetflora_addon.jobs import run_to_end

use_zstandard(zstandard)
FOLDER = Path(__file__).parent.parent / "tests" / "data" / "geodata"


def cases() -> dict[str, dict[str, Any]]:
    """What is right of each file."""
    return json.loads((FOLDER / "maps.json").read_text(encoding="utf-8"))


def problems(name: str) -> list[str]:
    """What is wrong with how a file is read; empty when all is right."""
    expected = dict(cases()[name])
    refused = expected.pop("refused", None)
    try:
        found = (
            _outlines(FOLDER / name) if name.endswith("json") else _raster(FOLDER / name, expected.pop("canopy", False))
        )
    except SceneError as error:
        if refused is None:
            return [f"refused: {error}"]
        return [f"{text!r} is not in {str(error)!r}" for text in refused if text not in str(error)]
    if refused is not None:
        return ["not refused"]
    wrong = []
    for key, right in expected.items():
        if key == "told":
            wrong += [f"{right!r} is not in {found[key]!r}"] * (right not in found[key])
        else:
            exact = isinstance(right, str | int) or (right and isinstance(right[0], str))
            same = found[key] == right if exact else np.allclose(found[key], right, rtol=1e-4, atol=1e-3)
            wrong += [f"{key}: {found[key]} and not {right}"] * (not same)
    return wrong


def _raster(path: Path, canopy: bool) -> dict[str, Any]:
    what = f"{path.name}: "
    raster = run_to_end(read_grid(path))
    raster = in_degrees(raster, what)
    system = chosen_system(0, raster.system, what)
    outline = raster.outline
    place = place_about(system, outline.min(axis=0), outline.max(axis=0), what)
    if canopy:
        checked_canopy(raster.values, what)
    middle = between(raster.places(np.array([0, 1, 0]), np.array([0, 0, 1])), system, place.system)
    return {
        "range": [float(np.nanmin(raster.values)), float(np.nanmax(raster.values))],
        "nothing": int(np.isnan(raster.values).sum()),
        "epsg": system.epsg,
        "cell": np.linalg.norm(middle[1:] - middle[0], axis=1).tolist(),
        "told": "; ".join(raster.notes),
    }


def _outlines(path: Path) -> dict[str, Any]:
    found, system, notes = read_outlines(path)
    points = np.concatenate([ring for outline in found for ring in outline.rings])
    place_about(system, points.min(axis=0), points.max(axis=0), f"{path.name}: ")
    return {
        "kinds": [outline.kind for outline in found],
        "heights": [outline.height for outline in found],
        "widths": [outline.width for outline in found],
        "epsg": system.epsg,
        "told": "; ".join(notes),
    }


def figures() -> dict[str, float]:
    """The figures of the benchmark."""
    right = sum(not problems(name) for name in cases())
    return {"cases": float(len(cases())), "cases_right": float(right), "cases_wrong": float(len(cases()) - right)}
