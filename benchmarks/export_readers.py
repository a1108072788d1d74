# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Exported files in programs that share no code with Blender: glTF's validator, assimp, and mitsuba's pictures.

They are not among what development needs: ``npm install gltf-validator`` in a folder that is named, and the packages
``assimp_py`` and ``mitsuba`` where this Python finds them.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector
from numpy.typing import NDArray

from devtools import session

from .reimport import pictures, read_by_blender
from .report import ROOT
from .side_views import SIDE, VIEWS

_VALIDATE = """
const fs = require('fs'), bytes = new Uint8Array(fs.readFileSync(process.argv[1]));
require('gltf-validator').validateBytes(bytes).then(found => console.log(JSON.stringify(found.issues)));
"""


def validate(folder: Path, path: Path) -> None:
    """Print what Khronos' validator, installed in a folder, says of a file.

    Raises
    ------
    subprocess.CalledProcessError
        It is not there.
    """
    command = ["node", "-e", _VALIDATE, str(path)]
    found = json.loads(subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout)
    codes = {message["code"]: message["severity"] for message in found["messages"]}
    print(f"gltf-validator: {found['numErrors']} errors; severities {codes}", flush=True)


def compare_silhouettes(path: Path) -> None:
    """Print how far the cover of an OBJ set is off in mitsuba from Cycles, and the share of it that is elsewhere."""
    ours, points = _in_cycles(path)
    places, alpha = (path.with_name(f"{name}.npy") for name in ("points", "alpha"))
    np.save(places, points)
    command = [sys.executable, "-m", "benchmarks.mitsuba_views", *map(str, (path, places, alpha))]
    subprocess.run(command, cwd=ROOT, check=True)
    other = np.load(alpha)
    cover = abs(other.sum() / ours.sum() - 1.0)
    elsewhere = np.abs(ours - other).sum() / 2.0 / ours.sum()
    print(f"mitsuba beside Cycles: cover {cover:.4f} off, {elsewhere:.4f} of it elsewhere", flush=True)


def _places(path: Path) -> list[tuple[str, Matrix]]:
    """The variant and the transform of each plant in a table."""
    with path.open(encoding="utf-8") as file:
        return [(row["variant"], _matrix(row)) for row in csv.DictReader(file)]


def _matrix(row: Mapping[str, str]) -> Matrix:
    turn = Quaternion([float(row[key]) for key in ("qw", "qx", "qy", "qz")])
    place, scale = Vector([float(row[key]) for key in "xyz"]), float(row["scale"])
    return Matrix.LocRotScale(place, turn, Vector([scale] * 3))


def _in_cycles(path: Path) -> tuple[NDArray, NDArray]:
    """Alpha (views, h, w), and points around all plants."""
    session.clean_file()
    read_by_blender(path)
    models = {obj.name.removesuffix("_LOD0"): obj.data for obj in bpy.data.objects}
    bpy.data.batch_remove(list(bpy.data.objects))
    found = []
    for variant, matrix in _places(path.with_suffix(".csv")):
        obj = bpy.data.objects.new(variant, models[variant])
        obj.matrix_world = matrix
        bpy.context.scene.collection.objects.link(obj)
        found += [matrix @ Vector(corner) for corner in obj.bound_box]
    points = np.array(found)
    bpy.context.scene.cycles.pixel_filter_type = 'BOX'
    views = pictures(points, path.with_name("view.exr"), number=VIEWS, side=SIDE)
    return np.array(views)[..., 3], points
