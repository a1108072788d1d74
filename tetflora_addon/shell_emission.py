# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to buffers: proxies as shells, the tetrahedra themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .baked_emission import BakedLight
from .buffers import MeshBuffers
from .plants.compiled import Flora
from .refinement.decisions import Decision
from .refinement.loop import Refinement
from .shading.shells import shell_buffers
from .shading.summaries import extinction_matrices, summarise
from .tetrahedra.geometry import volume

#: Fraction of its size by which a shell is smaller than its tetrahedron, at least and at most.
GAP, MOST_GAP = 1e-3, 0.05
# Steps between neighbouring numbers of single precision by which faces stand apart at least.
_STEPS = 8.0


def proxy_shells(flora: Flora, result: Refinement, light: BakedLight | None = None) -> MeshBuffers | None:
    """Proxies as shells: the tetrahedra themselves, filled with a cloud of their extinction, colour and orientation.

    They are written back to front, which is how EEVEE blends them. Tetrahedra that hold nothing but large polygons have
    an extinction of 0. With ``light`` shells carry the radiance of their contents, for the material of baked light.
    """
    proxies = np.isin(result.decision, (Decision.PROXY, Decision.HIDDEN))
    nodes = result.nodes[proxies]
    if len(nodes) == 0:
        return None
    index = np.full(len(result.tree), -1, dtype=np.int64)
    index[nodes] = np.arange(len(nodes))
    contents = result.contents
    # Large polygons are drawn as they are; a fog in their place would be no wall.
    fine = np.isfinite(contents.polygons.amounts.width)
    if not fine.all():
        contents = replace(contents, polygons=contents.polygons.take(fine))
    summaries = summarise(flora, contents, index, len(nodes))
    vertices = result.tree.vertices(nodes)
    matrices, normal, plane = extinction_matrices(summaries, volume(vertices))
    vertices, matrices = set_apart(vertices, matrices)
    rank = result.rank[proxies]
    baked = None if light is None else light.of_shells()[proxies]
    colour, transmission = summaries.colour, summaries.transmission
    return shell_buffers(vertices, colour, transmission, matrices, normal, plane, rank=rank, light=baked)


def set_apart(
    vertices: NDArray[np.float64], matrices: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Tetrahedra (n, 4, 3) a little smaller, and their S (n, 6) so much larger that they are as dark as before.

    Of faces at the very same distance Cycles meets only one: where a ray leaves one shell and enters the next through a
    face that both have, the second would be lost, and with it a good part of a crown.
    """
    middle = vertices.mean(axis=1, keepdims=True)
    away = vertices - middle
    inwards = np.maximum(np.abs(away).max(axis=(1, 2)) / 8.0, 1e-300)  # a slender one is about so thick
    step = np.abs(vertices).max(axis=(1, 2), initial=0.0) * np.finfo(np.float32).eps
    fraction = np.clip(_STEPS * step / inwards, GAP, MOST_GAP)
    return middle + away * (1.0 - fraction)[:, None, None], matrices / ((1.0 - fraction) ** 2)[:, None]
