# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What plants may stand on: triangles, masks on them, and areas, paths and borders on the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Floats32, bilinear
from ..errors import SceneError


@dataclass(frozen=True)
class Path:
    """A line on the map to keep free."""

    points: Floats  # (k, 2): meters, k at least 1; a cyclic line repeats its first point
    half_width: float  # meters to either side in which nothing grows; 0 keeps nothing free


@dataclass(frozen=True)
class Terrain:
    """A terrain with everything that is drawn on it. Only the triangles are needed."""

    triangles: Floats  # (t, 3, 3): corners, meters in world space; either side may be up
    weight: Floats | None = None  # (t, 3): how suitable the corners are, 0 to 1 (vertex groups); linear between
    uv: Floats | None = None  # (t, 3, 2): where the corners are in the image; it repeats beyond 0 and 1
    #: (h, w): how suitable texels are, 0 to 1; the first row is at the bottom. Read between texels (bilinear).
    image: Floats32 | None = None
    #: tuple of (k, 2): closed polygons on the map. If there are any, plants grow in at least one of them.
    areas: tuple[Floats, ...] = ()
    paths: tuple[Path, ...] = ()
    #: (e, 2, 3): edges where the ground ends; found from the triangles if they are asked for and not given.
    border: Floats | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be stood on.

        Raises
        ------
        SceneError
            No triangles, or some with places that are no numbers.
        ValueError
            Arrays that do not fit each other: a mistake of the caller, not of the artist.
        """
        count = len(self.triangles)
        if not count:
            raise SceneError("The ground has no faces; select a mesh with faces")
        broken = int((~np.isfinite(self.triangles).all(axis=(1, 2))).sum())
        if broken:
            raise SceneError(
                f"{broken:,} of {count:,} triangles of the ground have corners that are not finite numbers; "
                "check its transform, modifiers and drivers, or run Mesh > Clean Up > Degenerate Dissolve"
            )
        if self.weight is not None and np.shape(self.weight) != (count, 3):
            raise ValueError(f"weight has shape {np.shape(self.weight)}, expected ({count}, 3)")
        if (self.uv is None) != (self.image is None):
            raise ValueError("image and uv must be given together")
        if self.uv is not None and np.shape(self.uv) != (count, 3, 2):
            raise ValueError(f"uv has shape {np.shape(self.uv)}, expected ({count}, 3, 2)")

    @property
    def map_area(self) -> float:
        """Area of all triangles on the map, m²; what lies above other ground counts as well."""
        return float(map_areas(self.triangles).sum())


def map_areas(triangles: Floats) -> Floats:
    """Areas (t,) of triangles (t, 3, 3) on the map, m²."""
    a, b, c = np.moveaxis(triangles[..., :2], 1, 0)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return 0.5 * np.abs(ux * vy - uy * vx)


def border_of(triangles: Floats) -> Floats:
    """Edges of only one triangle, (e, 2, 3); corners at exactly the same place are one."""
    # Adding 0 makes -0.0 and 0.0 the same bytes.
    rows = np.ascontiguousarray(triangles.reshape(-1, 3) + 0.0).view(np.dtype((np.void, 24)))[:, 0]
    _, corner = np.unique(rows, return_inverse=True)
    corner = corner.reshape(-1, 3)
    ends = np.stack([corner, np.roll(corner, -1, axis=1)], axis=2).reshape(-1, 2)
    places = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    key = ends.min(axis=1) * np.int64(len(rows)) + ends.max(axis=1)
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    return places[first[(count == 1)]]


def sampled(image: Floats32, uv: Floats) -> Floats:
    """Values of an image (h, w) at places (n, 2), linear between the middles of texels, (n,).

    It repeats, but opposite borders do not mix: a mask that is black on one side would let plants stray to the other.
    """
    return bilinear(image, (uv - np.floor(uv)) * image.shape[::-1] - 0.5)
