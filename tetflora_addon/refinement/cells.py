# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Terminal tetrahedra that hold something, and what is known of each as long as it is not divided."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Arrays
from ..tetrahedra.geometry import squared_edges, volume
from ..tetrahedra.tree import TetrahedralTree
from .amounts import Amounts
from .camera import Camera
from .visibility import AlphaBuffer


@dataclass(frozen=True)
class Terminals(Arrays):
    """Terminal tetrahedra that hold something.

    Attributes
    ----------
    nodes : (n,) int
        Their nodes in the tree.
    amounts : Amounts of n
    pixels, opacity : (n,) float64
        As in `visibility.Outline`.
    feature : (n,) float64
        Width in pixels of what they hold, where it is nearest to the eye.
    least_feature : (n,) float64
        The same where it is farthest away.
    span : (n,) float64
        Longest edge in pixels at their distance.
    whole : (n,) bool
        Whether all of each is in view. What crosses the border of the view has pixels of its seen part only.
    """

    nodes: NDArray[np.intp]
    amounts: Amounts
    pixels: NDArray[np.float64]
    opacity: NDArray[np.float64]
    feature: NDArray[np.float64]
    least_feature: NDArray[np.float64]
    span: NDArray[np.float64]
    whole: NDArray[np.bool_]

    @classmethod
    def seen(
        cls, tree: TetrahedralTree, nodes: NDArray[np.intp], amounts: Amounts, camera: Camera, buffer: AlphaBuffer
    ) -> Terminals:
        """Draw tetrahedra into the alpha buffer and keep what it says of each by itself."""
        vertices = tree.vertices(nodes)
        outline = buffer.add(nodes, vertices, mean_extinction(amounts, volume(vertices)))
        span = np.sqrt(squared_edges(vertices).max(axis=1)) / camera.extent_around(vertices.mean(axis=1))
        features = feature_pixels(vertices, amounts.width, camera)
        return cls(nodes, amounts, outline.pixels, outline.opacity, *features, span, outline.whole)


def mean_extinction(amounts: Amounts, volumes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Extinction κ (n,) of tetrahedra in 1/m, as if surfaces faced all ways.

    Notes
    -----
    Randomly turned, a leaf shows half its one-sided area and a closed branch a quarter of its surface (Cauchy 1832).
    """
    return (amounts.leaf_area / 2 + amounts.wood_area / 4) / volumes


def feature_pixels(
    vertices: NDArray[np.float64], width: NDArray[np.float64], camera: Camera
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Size on the picture of what tetrahedra hold, where it is nearest to the eye and where it is farthest away.

    Parameters
    ----------
    vertices : (n, 4, 3) float64
    width : (n,) float64
        Width of leaves or branches, metres.

    Returns
    -------
    (n,), (n,) float64
        Pixels.
    """
    extent = camera.pixel_extent(vertices)
    return width / extent.min(axis=1), width / extent.max(axis=1)
