# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Facets that stand for explicit polygons: stochastic simplification (Cook, Halstead, Planck and Ryu, SIGGRAPH 2007).

Of many small triangles few are chosen by chance, in proportion to their area, and each is drawn as a square that makes
up for those that are left out. Choices are spread evenly along the list of triangles, which is in the order of
tetrahedra and faces, so that each region of space gets its share to within one facet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..buffers import MeshBuffers
from ..plants.hashing import key_of_seed, mix, uniform
from ..refinement.camera import Camera
from ..refinement.contents import Contents
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..refinement.polygons import Polygons
from .facet_sizes import HIDDEN_FACES, polygon_facet_sizes
from .microsurfaces import Facets, facet_mesh, kept_out_of_view

_FIRST, _PLACE_U, _PLACE_V = 221, 222, 223


def polygon_facets(
    contents: Contents, result: Refinement, camera: Camera, facet_pixels: float
) -> list[MeshBuffers | None]:
    """Facets of the polygons of proxies (``contents``) that are not kept as they are, see `facet_sizes`."""
    if not len(contents.polygons):
        return []
    sizes = polygon_facet_sizes(contents, camera, result.chosen(Decision.HIDDEN))
    left = np.flatnonzero(~sizes.kept(facet_pixels))
    left = left[np.argsort(contents.polygon_cell[left], kind="stable")]
    side, inside = sizes.sides(facet_pixels), result.in_view[contents.polygon_cell]
    parts = []
    for some, seen in ((left[inside[left]], True), (left[~inside[left]], False)):
        made = facet_mesh(chosen_facets(contents.polygons.take(some), sizes.optical[some], side[some]))
        parts.append(made if seen else kept_out_of_view(made, camera.clearance, HIDDEN_FACES**-0.5))
    return parts


def chosen_facets(polygons: Polygons, optical: NDArray[np.float64], side: NDArray[np.float64]) -> Facets:
    """Facets of polygons.

    Parameters
    ----------
    polygons : Polygons of n
        In the order in which facets are to be spread.
    optical : (n,) float64
        Area that they stand for, m².
    side : (n,) float64
        Wanted side of facets, metres. All are made larger or smaller by one common factor, close to 1, so that their
        area is that of the polygons exactly.
    """
    meshes = polygons.meshes
    owner, triangle, share = polygons.triangles()
    vector = meshes.vectors(triangle, polygons.instance[owner])
    own = share * np.linalg.norm(vector, axis=1)
    of_polygon = np.bincount(owner, own, len(polygons))
    rate = optical / (np.maximum(of_polygon, 1e-300) * np.maximum(side, 1e-12) ** 2)
    sums = np.cumsum(own * rate[owner])
    total = sums[-1] if len(sums) else 0.0
    # The first place is chance; so is the number of facets that a fraction of one asks for.
    first = float(uniform(key_of_seed(len(owner)), _FIRST))
    places = first + np.arange(int(np.ceil(total - first)) if total > first else 0)
    pick = np.searchsorted(sums, places, side="right")
    pick = pick[pick < len(owner)]
    area = np.einsum("n,n->", side[owner[pick]], side[owner[pick]])
    factor = np.sqrt(optical.sum() / area) if area > 0 and total >= 1 else 1.0

    thing = owner[pick]
    face, instance = polygons.face[thing], polygons.instance[thing]
    # Alike for a triangle wherever it is held; several facets of one lie apart.
    key = mix(key_of_seed(triangle[pick]) ^ key_of_seed(instance) + np.arange(len(pick)).astype(np.uint64))
    weights = np.broadcast_to(np.eye(3), (len(pick), 3, 3)).copy()
    cut = np.flatnonzero(polygons.part[thing] >= 0)
    weights[cut] = polygons.weights[polygons.part[thing[cut]]]
    corners = weights @ meshes.corners(triangle[pick], instance)
    root, v = np.sqrt(uniform(key, _PLACE_U)), uniform(key, _PLACE_V)
    at = np.stack([1 - root, root * (1 - v), root * v], axis=1)
    centre = np.einsum("nk,nki->ni", at, corners)
    normal = _unit(vector[pick])
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(edges, axis=2).argmax(axis=1)
    along = _unit(edges[np.arange(len(pick)), longest])
    slot = meshes.slot[face]
    return Facets(
        centre,
        np.cross(along, normal),
        along,
        factor * side[thing],
        meshes.colours[slot],
        meshes.transmission[slot],
    )


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
