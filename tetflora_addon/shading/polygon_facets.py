# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Facets that stand for explicit polygons: stochastic simplification (Cook, Halstead, Planck and Ryu, SIGGRAPH 2007).

Of many small triangles few are chosen by chance, in proportion to their area, and the facets of
each make up for those that are left out. What a triangle gets follows from its own number and nothing else, so that its
facets stay where they are when others come into view or are kept as they are. Chances are spread evenly along the
triangles of a mesh, so that the area of all is that of the mesh with little noise.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..arrays import spread
from ..plants.expansion import chunks
from ..plants.hashing import child_key, key_of_seed, mix, stepped, uniform
from ..plants.vectors import unit
from ..refinement.camera import Camera
from ..refinement.contents import Contents
from ..refinement.decisions import Decision
from ..refinement.loop import Refinement
from ..refinement.polygons import Polygons
from .facet_sizes import HIDDEN_FACES, polygon_facet_sizes
from .microsurfaces import Facets, kept_out_of_view

_PLACE_U, _PLACE_V = 222, 223


def polygon_facets(
    contents: Contents, result: Refinement, camera: Camera, facet_pixels: float, at_once: float = np.inf
) -> Iterator[tuple[Facets, bool]]:
    """Facets of the polygons of proxies (``contents``) that are not kept as they are, see `facet_sizes`.

    Parameters
    ----------
    at_once : float
        Facets that are made at a time, about.

    Yields
    ------
    (Facets, bool)
        Some of them, and whether they are seen: neither hidden nor beside the view.
    """
    sizes = polygon_facet_sizes(contents, camera, result.chosen(Decision.HIDDEN))
    side, inside = sizes.sides(facet_pixels), result.in_view[contents.polygons.cell]
    left, expected = ~sizes.kept(facet_pixels), sizes.counts(facet_pixels) + 1  # polygons take memory too
    for alike, seen, beside in (
        (inside & ~sizes.hidden, True, False),
        (inside & sizes.hidden, False, False),
        (~inside, False, True),
    ):
        chosen = np.flatnonzero(left & alike)
        for run in chunks(expected[chosen], at_once):
            some = chosen[run]
            made = chosen_facets(contents.polygons.items.take(some), sizes.optical[some], side[some])
            yield kept_out_of_view(made, camera.clearance, HIDDEN_FACES**-0.5) if beside else made, seen


def chosen_facets(polygons: Polygons, optical: NDArray[np.float64], side: NDArray[np.float64]) -> Facets:
    """Facets of polygons.

    Parameters
    ----------
    polygons : Polygons of n
        Whole faces and fragments, in any order.
    optical : (n,) float64
        Area that they stand for, m².
    side : (n,) float64
        Of facets, metres. Their number is a matter of chance; its expectation is the area over that of a facet.
    """
    meshes = polygons.meshes
    owner, triangle, share = polygons.triangles()
    vector = meshes.vectors(triangle, polygons.instance[owner])
    own = share * np.linalg.norm(vector, axis=1)
    of_polygon = np.bincount(owner, own, len(polygons))
    rate = optical / (np.maximum(of_polygon, 1e-300) * np.maximum(side, 1e-12) ** 2)
    key = _keys(polygons, owner)
    pick, number = spread(np.floor(own * rate[owner] + stepped(key, triangle)).astype(np.int64))

    thing = owner[pick]
    face, instance = polygons.face[thing], polygons.instance[thing]
    key = child_key(mix(key_of_seed(triangle[pick]) ^ key[pick]), number)  # several facets of a triangle lie apart
    weights = np.broadcast_to(np.eye(3), (len(pick), 3, 3)).copy()
    cut = np.flatnonzero(polygons.part[thing] >= 0)
    weights[cut] = polygons.weights[polygons.part[thing[cut]]]
    corners = weights @ meshes.corners(triangle[pick], instance)
    root, v = np.sqrt(uniform(key, _PLACE_U)), uniform(key, _PLACE_V)
    at = np.stack([1 - root, root * (1 - v), root * v], axis=1)
    centre = np.einsum("nk,nki->ni", at, corners)
    normal = unit(vector[pick])
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(edges, axis=2).argmax(axis=1)
    along = unit(edges[np.arange(len(pick)), longest])
    slot = meshes.slot[face]
    return Facets(
        centre,
        np.cross(along, normal),
        along,
        side[thing],
        meshes.colours[slot],
        meshes.transmission[slot],
    )


def _keys(polygons: Polygons, owner: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Keys (m,) of the instances that triangles of polygons (m,) belong to, and of the very fragments that they are."""
    key = key_of_seed(polygons.instance)
    cut = np.flatnonzero(polygons.part >= 0)
    corners = polygons.weights[polygons.part[cut]].reshape(-1, 9) + 0.0  # no negative zeros, which have other bits
    for bits in np.ascontiguousarray(corners).view(np.uint64).T:
        key[cut] = mix(key[cut] ^ bits)
    return key[owner]
