# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Forests as files of other programs: a million plants there and back, levels beside their plants, validators.

A field of birches and spruces goes to USD and comes back; plants count that are the same in all bytes. Levels are those
of a variant whose corrections were found for another one of its species, seen from the distances where they take over.
Readers are USD's own checker, pygltflib and trimesh: each fault that they find, and each number of plants or polygons
that they read otherwise, is an error. ``million_s`` is what passes, which means little beside other programs. With
options: pictures of what Blender reads back, and readers that development does not need.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

from devtools import session
from tests.blender.scenes import depsgraph
from tetflora_addon.blender import compat
from tetflora_addon.blender.export.forest import Exported, ExportOrder, export_steps
from tetflora_addon.blender.export.usd import forest_steps
from tetflora_addon.blender.geodata.origin import Import
from tetflora_addon.blender.scene.fields import write_field
from tetflora_addon.blender.scene.plants import read_plants
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.export.levels import levels_of
from tetflora_addon.growth.seeds import Seeds
from tetflora_addon.species.catalog import load_species

from . import export_readers, reimport
from .report import Targets, cpu_s

PLANTS, QUICK_PLANTS = 1_000_000, 20_000
SPECIES, QUICK_SPECIES = ("birch", "spruce", "beech", "bush", "fern"), ("bush", "fern")
#: Polygons of a level in the file of all plants.
_POLYGONS = 20_000

TARGETS: Targets = {
    "plants_back": {"min": PLANTS},
    "million_mb": {"max": 120.0},
    "million_s": {"max": 60.0},
    "cover_error_max": {"max": 0.02},
    "color_error_max": {"max": 0.03},
    "silhouette_px_max": {"max": 1.5},
    "validator_errors": {"max": 0.0},
}
QUICK_TARGETS: Targets = {**TARGETS, "plants_back": {"min": QUICK_PLANTS}}


def options(parser: argparse.ArgumentParser) -> None:
    """What else can be asked for."""
    parser.add_argument("--species", help="species of levels and of pictures, with commas")
    parser.add_argument("--pictures", action="store_true", help="colors of what Blender's importers read, and no else")
    parser.add_argument("--engine", choices=("CYCLES", "EEVEE"), default="CYCLES", help="of these pictures")
    parser.add_argument("--readers", type=Path, help="a folder with npm's gltf-validator; with assimp and mitsuba")


def run(given: argparse.Namespace) -> dict[str, float] | None:
    """All figures, or a part that prints its own."""
    chosen = given.species.split(",") if given.species else QUICK_SPECIES if given.quick else SPECIES
    with tempfile.TemporaryDirectory() as folder:
        if given.pictures:
            return reimport.color_errors(Path(folder), chosen, given.engine)
        if given.readers:
            return _read_elsewhere(Path(folder), given.readers.resolve())
        figures = _there_and_back(Path(folder), QUICK_PLANTS if given.quick else PLANTS)
        figures["validator_errors"] = float(_validated(Path(folder)))
    return figures | _levels(chosen)


def _forest(number: int, species: tuple[str, ...]) -> None:
    """An open field of upright plants of some species."""
    session.clean_file()
    rng = np.random.default_rng(0)
    side, turn = np.sqrt(number * 20.0), rng.uniform(0.0, 2.0 * np.pi, number)
    place = np.column_stack([rng.uniform(0.0, side, (number, 2)), rng.uniform(0.0, 50.0, number)])
    rotation = np.column_stack([np.cos(turn / 2), 0.0 * turn, 0.0 * turn, np.sin(turn / 2)])
    kind, seed = rng.integers(0, len(species), number), rng.integers(0, 2**31, number)
    scale = rng.uniform(0.6, 1.2, number)
    field = write_field("forest", place, rotation, scale, kind.astype(np.int32), seed.astype(np.int32), species)
    bpy.context.scene.collection.objects.link(field)


def _exported(path: Path, **settings: int) -> Exported:
    return run_to_end(export_steps(bpy.context.scene, depsgraph(), ExportOrder(path, **settings)))


def _plants() -> Seeds:
    return read_plants(bpy.context.scene, depsgraph())[0]


def _there_and_back(folder: Path, number: int) -> dict[str, float]:
    _forest(number, ("birch", "spruce"))
    before, path = _plants(), folder / "million.usdc"
    begin, used = time.perf_counter(), cpu_s()
    made = _exported(path, variants=2, polygons=_POLYGONS)
    seconds, used = time.perf_counter() - begin, cpu_s() - used
    session.clean_file()
    begin = time.perf_counter()
    run_to_end(forest_steps(Import(bpy.context.scene, depsgraph(), path), {}))
    after = _plants()
    same = np.ones(number, bool)
    for name in ("species", "seed", "position", "frame", "scale"):
        one, other = (
            np.ascontiguousarray(getattr(s, name)).view(np.uint8).reshape(number, -1) for s in (before, after)
        )
        same &= (one == other).all(axis=1)
    return {
        "plants_back": int(same.sum()) if before.identifiers == after.identifiers else 0,
        "million_mb": made.megabytes,
        "million_s": seconds,
        "million_processor_s": used,
        "back_s": time.perf_counter() - begin,
    }


def _validated(folder: Path) -> int:
    """Faults that independent readers find in files of a small forest."""
    import pygltflib
    import trimesh

    _forest(40, ("bush", "fern"))
    pxr = compat.usd()
    usd, glb = (_exported(folder / f"small.{ending}", variants=2) for ending in ("usdc", "glb"))
    checker = pxr.UsdUtils.ComplianceChecker()
    checker.CheckCompliance(str(usd.path))
    errors = len(checker.GetErrors()) + len(checker.GetFailedChecks()) + len(checker.GetWarnings())
    stage = pxr.Usd.Stage.Open(str(usd.path))
    instancers = [pxr.UsdGeom.PointInstancer(p) for p in stage.Traverse() if p.IsA(pxr.UsdGeom.PointInstancer)]
    errors += sum(one.GetInstanceCount() for one in instancers) != usd.plants
    read = pygltflib.GLTF2().load(str(glb.path))
    first = [node for node in read.nodes if "MSFT_lod" in (node.extensions or {})]
    places = [node.extensions["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] for node in first]
    errors += sum(read.accessors[index].count for index in places) != glb.plants
    meshes = trimesh.load_scene(glb.path).geometry.values()
    indices = [read.accessors[p.indices].count // 3 for mesh in read.meshes for p in mesh.primitives]
    errors += sum(len(mesh.faces) for mesh in meshes) > sum(indices)
    return errors + sum(not np.isfinite(mesh.vertices).all() for mesh in meshes)


def _read_elsewhere(folder: Path, validator: Path) -> None:
    """Let programs read a small set that share no code with Blender."""
    _forest(6, ("bush", "fern"))
    glb, obj = (_exported(folder / f"small.{ending}", variants=1).path for ending in ("glb", "obj"))
    export_readers.validate(validator, glb)
    export_readers.compare_silhouettes(obj)


def _levels(species: tuple[str, ...]) -> dict[str, float]:
    """The largest differences of levels from their plants."""
    found = {"cover_error_max": 0.0, "color_error_max": 0.0, "silhouette_px_max": 0.0, "levels": 0}
    for name in species:
        flora = compile_species([load_species(name)])
        plants = Seeds.upright(2)
        like = levels_of(flora, plants.take(slice(0, 1)))
        for level in levels_of(flora, plants.take(slice(1, 2)), 0, like)[1:]:
            found["cover_error_max"] = max(found["cover_error_max"], abs(level.cover))
            found["color_error_max"] = max(found["color_error_max"], level.color)
            found["silhouette_px_max"] = max(found["silhouette_px_max"], level.outline)
            found["levels"] += 1
            print(
                f"{name}: {level.polygons:,} polygons from {level.distance:,.0f} m on: cover {level.cover:+.4f}, "
                f"color {level.color:.4f}, outline {level.outline:.2f} px",
                flush=True,
            )
    return found
