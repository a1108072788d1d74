# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refining and clearing again and again leaves nothing behind: no datablock, and no memory that grows."""

from __future__ import annotations

import gc
import os
from pathlib import Path

import bpy
import numpy as np
import pytest

from tests.blender.scenes import add_camera, add_plant, datablocks, depsgraph

CYCLES = 10
#: Megabytes by which the last half of the cycles may lie above the first, in the median. A result of this scene takes a
#: third of a megabyte or more, so one that stayed behind in each cycle would lie far above; measured is .1.
MOST_GROWTH = 2.0


def resident() -> float:
    """Megabytes of the process that are in memory."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def size(data: object) -> int:
    """Vertices or points."""
    return len(getattr(data, "vertices", None) or getattr(data, "points", ()))


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="asks Linux how much memory there is in use")
@pytest.mark.parametrize("form", ['MICROSURFACES', 'MICROSPHERES'])
def test_cycles_of_refine_and_clear_leave_nothing_behind(clean_file, form):
    scene = bpy.context.scene
    add_camera(location=(0.0, -14.0, 3.0), rotation=(1.4, 0.0, 0.0))
    scene.render.resolution_x = scene.render.resolution_y = 48
    for n, species in enumerate(("bush", "fern")):
        add_plant(species, species, seed=n, location=(3.0 * n - 1.5, 0.0, 0.0))
    settings = scene.tetflora
    settings.proxy_kind, settings.leaf_limit, settings.cutoff, settings.visibility_resolution = form, 0.5, 8.0, 64
    depsgraph()
    before, memory, made = datablocks(), [], set()
    for cycle in range(CYCLES + 1):
        assert bpy.ops.tetflora.refine() == {'FINISHED'}
        bpy.context.view_layer.update()
        results = bpy.data.collections["TetFlora"].objects
        made.add(tuple(sorted((o.name, size(o.data)) for o in results)))
        assert bpy.ops.tetflora.clear() == {'FINISHED'}
        bpy.context.view_layer.update()
        assert datablocks() == before
        gc.collect()
        if cycle:  # the first one fills caches: species are compiled, tables are read
            memory.append(resident())
    assert len(made) == 1  # the same each time; names do not count upwards either
    first, last = np.median(memory[: CYCLES // 2]), np.median(memory[CYCLES // 2 :])
    print(f"{form}: {first:.1f} MB, then {last:.1f} MB; {sum(n for _, n in made.pop()):,} vertices")
    assert last - first <= MOST_GROWTH
