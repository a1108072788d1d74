# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an asset is before it is compiled: all of its faces, in its own space, and what each of them looks like."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class AssetSurface:
    """Faces of one mesh.

    Attributes
    ----------
    name : str
    positions : (v, 3) float32
        In the space of the mesh, metres.
    triangles : (t, 3) int32
        Vertices of each.
    face : (t,) int32
        The mesh's face that each is a part of; ascending.
    colour : (f, 3) float16
        Mean linear colour of what is not transparent of each face.
    transmission : (f,) float16
        Fraction of light that is scattered through; NaN where nobody knows.
    coverage : (f,) float16
        Fraction of each that is not transparent.
    roughness : (f,) float16 or None
        Of its gloss; None where nobody knows.
    """

    name: str
    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    face: NDArray[np.int32]
    colour: NDArray[np.float16]
    transmission: NDArray[np.float16]
    coverage: NDArray[np.float16]
    roughness: NDArray[np.float16] | None = None

    @property
    def faces(self) -> int:
        """Number of faces f."""
        return len(self.coverage)


@dataclass(frozen=True)
class AssetSource:
    """All surfaces of an asset, and where it shows them: a leaf may be a surface that it shows ten thousand times.

    Attributes
    ----------
    name : str
        Of the object or collection, for messages.
    surfaces : tuple of AssetSurface
    surface : (n,) int32
        Surface of each part.
    matrices : (n, 4, 4) float64
        From the space of that surface to that of the asset.
    digest : str
        Hexadecimal; of all that the above follows from.
    """

    name: str
    surfaces: tuple[AssetSurface, ...]
    surface: NDArray[np.int32]
    matrices: NDArray[np.float64]
    digest: str

    @property
    def faces(self) -> int:
        """Number of faces of all parts."""
        return int(sum(np.array([s.faces for s in self.surfaces], np.int64)[self.surface]))
