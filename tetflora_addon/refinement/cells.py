# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Terminal tetrahedra that hold something, and what is known of each as long as it is not divided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ..tetrahedra.geometry import squared_edges, volume
from ..tetrahedra.tree import TetrahedralTree
from .amounts import Amounts
from .camera import Camera
from .visibility import AlphaBuffer


@dataclass(frozen=True)
class Terminals:
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

    def __len__(self) -> int:
        return len(self.nodes)

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

    def take(self, index: NDArray) -> Terminals:
        """Selection by indices or mask."""
        own = {f.name: getattr(self, f.name)[index] for f in fields(self) if f.name != "amounts"}
        return Terminals(amounts=self.amounts.take(index), **own)

    @classmethod
    def joined(cls, parts: Sequence[Terminals]) -> Terminals:
        """All of several together."""
        own = {f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls) if f.name != "amounts"}
        return cls(amounts=Amounts.concatenate([p.amounts for p in parts]), **own)


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
