# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks of polygons as they are made, into objects of a result; and the light that is baked into them.

While Blender takes one block over, the engine makes the next in its thread.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import replace
from itertools import groupby
from typing import TypeVar

import bpy

from ...buffers import MeshBuffers, concatenate_buffers
from ...compiled.flora import Flora
from ...emission.forms import Refined
from ...emission.plants import Block
from ...emission.polygons import PolygonBlock
from ...jobs import Progress
from ...refinement.statistics import Statistics
from ..materials.materials import baked_material
from ..results.collection import Results
from ..results.leaf_objects import material_steps
from ..results.proxies import Baking
from ..scene.explicit import Explicit
from ..worker import in_thread, steps_in_thread

_Block = TypeVar("_Block")


def write_blocks(
    results: Results,
    flora: Flora,
    blocks: Iterator[Block],
    statistics: Statistics,
    start: float,
    baking: Baking | None = None,
) -> Generator[Progress, None, None]:
    """Write blocks of plants; progress goes from a given fraction to .95, and the statistics count."""
    materials: dict[tuple[int, str, int], list[bpy.types.Material]] = {}

    def write(block: Block) -> Generator[None, None, Progress]:
        species, what = flora.species[block.species], (block.species, block.kind, block.form)
        if what not in materials:
            if baking is not None and baking.leaves:
                materials[what] = [baked_material()]
            else:
                materials[what] = yield from material_steps(results.scene, species, block.kind, block.form)
        name = f"{species.name} {block.kind} {block.number:03d}"
        yield
        look = results.look_of(block.species)
        obj = yield from results.add(name, block.kind, block.buffers, materials[what], species, look)
        _made(obj, block.buffers, statistics, baking, lit=True)
        return Progress(start + (0.95 - start) * block.fraction, f"Making polygons: {statistics.polygons_meshed:,}")

    yield from _written(_of_all_ages(results, flora, blocks), write, Progress(start, "Making polygons"))


def _of_all_ages(results: Results, flora: Flora, blocks: Iterator[Block]) -> Iterator[Block]:
    """Blocks of which those of one species and look at several ages are one mesh: each object costs a renderer time."""
    first: dict[tuple[str, str], int] = {}
    named = [(one.identifier, results.look_of(n)) for n, one in enumerate(flora.species)]
    same = [first.setdefault(named[n], n) if one.form is None else n for n, one in enumerate(flora.species)]
    if same == list(range(len(same))):
        yield from blocks
        return
    for _, run in groupby(blocks, key=lambda block: block.number):
        parts: dict[tuple[int, str, int], list[Block]] = {}
        for block in run:
            parts.setdefault((same[block.species], block.kind, block.form), []).append(block)
        for some in parts.values():
            yield replace(some[-1], buffers=concatenate_buffers([block.buffers for block in some]))


def write_polygons(
    results: Results,
    explicit: Explicit,
    blocks: Iterator[PolygonBlock],
    statistics: Statistics,
    baking: Baking | None = None,
) -> Generator[Progress, None, None]:
    """Write polygons of meshes that take part, with their own materials; the statistics count."""

    def write(block: PolygonBlock) -> Generator[None, None, Progress]:
        name = explicit.meshes.surfaces[block.surface].name
        materials = explicit.materials[block.surface]
        look = explicit.meshes.surfaces[block.surface].look
        name = f"{name} {block.number:03d}"
        obj = yield from results.add(name, "explicit", block.buffers, materials, look=look)
        _made(obj, block.buffers, statistics, baking, lit=False)
        return Progress(0.95, f"Keeping polygons: {statistics.polygons_meshed:,}")

    yield from _written(blocks, write, Progress(0.95, "Keeping polygons"))


def _written(
    blocks: Iterator[_Block], write: Callable[[_Block], Generator[None, None, Progress]], progress: Progress
) -> Generator[Progress, None, None]:
    """Write blocks one by one, while the next is computed."""
    with closing(in_thread(blocks, ahead=1)) as made:
        for block in made:
            if block is not None:
                progress = yield from progress.during(write(block))
            yield progress.again if block is None else progress


def _made(
    obj: bpy.types.Object, buffers: MeshBuffers, statistics: Statistics, baking: Baking | None, lit: bool
) -> None:
    if baking is not None:
        baking.add(obj, buffers, lit)
    statistics.polygons_meshed += buffers.polygons
    statistics.memory_mb += buffers.nbytes / 1e6


def bake_light(baking: Baking, refined: Refined) -> Generator[Progress, None, None]:
    """Compute the light of everything, and write that of meshes."""
    if refined.facet_pixels is not None:
        facets = (Progress(0.9, f"Baking light: {count:,} facets") for count in baking.add_facets(refined))
        yield from steps_in_thread(facets, Progress(0.9, "Baking light"))
    shadows = (Progress(0.9 + 0.03 * done, f"Baking light: {done:.0%} of the shadows") for done in baking.look(refined))
    yield from steps_in_thread(shadows, Progress(0.9, "Baking light"))
    progress = Progress(0.93, "Baking light")
    for done in baking.light_meshes():
        if done is not None:
            progress = Progress(0.93 + 0.02 * done, f"Baking light: {done:.0%} of the leaves")
        yield progress.again if done is None else progress
