# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Summaries of tetrahedra: optical area, color, orientation of what they hold (paper, 6.5), and extinction."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, chunks, unit
from ..compiled.clumping import factors
from ..compiled.flora import Flora
from ..compiled.orientation import leaf_moments, own_leaf_moments, wood_moments
from ..subplants.pieces import Pieces, outward_ends, piece_leaf_colors
from .contents import Contents, InCells
from .polygons import MEASURE_BATCH
from .shared_parts import AssetParts, PlacedAssets

#: κ along an axis is ⟨|n·e|⟩, the moment gives ⟨(n·e)²⟩. The power of the second that is the first at 0, ⅓ (all ways:
#: ½) and 1; at ½ (normals around a circle) it gives .646 for 2/π = .637.
_ROOT = np.log(2) / np.log(3)


@dataclass(frozen=True)
class Summaries:
    """Area-weighted means over what each of n tetrahedra holds."""

    optical_area: Floats  # (n,): m², as it is; leaves count once, the closed surfaces of branches and other solids half
    color: Floats  # (n, 3): linear RGB
    transmission: Floats  # (n,): fraction of scattered light that goes through
    moment: Floats  # (n, 3, 3): mean of n nᵀ; its trace is 1 where there is anything
    #: (n, 2): determines the factor on extinction, see `compiled.clumping.factors`; 1 if not given, and of polygons.
    clumping: Floats | None = None

    def effective_area(self, volumes: Floats) -> Floats:
        """Area (n,) of an even fog, as dark as the tetrahedra, in given volumes (n,); m²."""
        if self.clumping is None:
            return self.optical_area
        return self.optical_area * factors(self.clumping, volumes)


def summarize(
    flora: Flora,
    contents: Contents,
    index: Integers,
    count: int,
    assets: tuple[PlacedAssets, InCells[AssetParts]] | None = None,
) -> Summaries:
    """Sum up contents by tetrahedron.

    Parameters
    ----------
    index : (nodes,) int
        Number of the summary that each node of the tree contributes to; contents of nodes with −1 are skipped.
    assets : PlacedAssets, Held of AssetParts, optional
        Clusters of instances, from `SharedAssets.held`.
    """
    sums = np.zeros((count, 16))  # area, then times area: color, transmission, moment, clumping
    for held in (contents.subplants, contents.pieces):
        keep = np.flatnonzero(index[held.cell] >= 0)
        if len(keep) == 0:  # clumping and orientation are computed only for plants
            continue
        held, clumping = held.take(keep), flora.clumping
        parts, totals = held.items, held.totals
        branches = parts.branches if isinstance(parts, Pieces) else parts
        row = branches.row
        # A sub-plant shows the mean of all that grows on it, a piece only its own bark and leaves.
        if branches is parts:
            leaf_color, wood_color = flora.leaf_colors(branches), flora.wood_color[row]
            leaf_moment = leaf_moments(flora.orientation, branches)
            wood_moment, transmission = wood_moments(flora.orientation, branches), flora.transmission[row]
            clumped = clumping.coefficients(branches, clumping.whole)
        else:
            axis = unit(parts.end - parts.start)
            leaf_color, wood_color = piece_leaf_colors(flora, parts), flora.rows["branch_color"][row, 0]
            outward = np.mean(outward_ends(flora, parts), axis=0)
            leaf_moment = own_leaf_moments(flora.orientation, row, axis, outward)
            wood_moment = (np.eye(3) - axis[:, :, None] * axis[:, None, :]) / 2
            transmission = flora.leaf.transmission[row]
            clumped = clumping.coefficients(branches, clumping.branch_only)
        leaf, wood = totals.leaf_area, totals.wood_area / 2
        moment = leaf[:, None, None] * leaf_moment + wood[:, None, None] * wood_moment
        color = leaf[:, None] * leaf_color + wood[:, None] * wood_color
        area = (leaf + wood)[:, None]
        values = [area, color, (leaf * transmission)[:, None], moment.reshape(-1, 9), area * clumped]
        _add(sums, index[held.cell], np.concatenate(values, axis=1))
    _add_polygons(sums, contents, index)
    if assets is not None:
        _add_assets(sums, *assets, index)
    area = sums[:, 0]
    mean = sums / np.where(area > 0, area, 1)[:, None]
    return Summaries(area, mean[:, 1:4], mean[:, 4], _moments(mean[:, 5:14].reshape(-1, 3, 3)), mean[:, 14:])


def _add(sums: Floats, to: Integers, values: Floats) -> None:
    for k in range(values.shape[1]):
        sums[:, k] += np.bincount(to, values[:, k], len(sums))


def _add_polygons(sums: Floats, contents: Contents, index: Integers) -> None:
    """Polygons are summed up triangle by triangle, which is exact under any sequence of cuts."""
    chosen = np.flatnonzero(index[contents.polygons.cell] >= 0)
    meshes = contents.polygons.items.meshes
    for run in chunks(contents.polygons.items.triangle_counts[chosen], MEASURE_BATCH):
        rows = chosen[run]
        polygons = contents.polygons.items.take(rows)
        owner, triangle, fraction = polygons.triangles()
        face = polygons.face[owner]
        slot, solid = meshes.slot[face], meshes.solid[face]
        vector = meshes.vectors(triangle, polygons.instance[owner])
        area = np.linalg.norm(vector, axis=1)
        normal = vector / np.maximum(area, 1e-300)[:, None]
        optical = (area * fraction * meshes.coverage[slot] * np.where(solid, 0.5, 1.0))[:, None]
        moment = (normal[:, :, None] * normal[:, None, :]).reshape(-1, 9)
        even = np.broadcast_to([1.0, 0.0], (len(face), 2))
        look = meshes.colors[slot], meshes.transmission[slot][:, None]
        seen = np.concatenate([np.ones_like(optical), *look, moment, even], axis=1)
        _add(sums, index[contents.polygons.cell[rows]][owner], optical * seen)


def _add_assets(sums: Floats, placed: PlacedAssets, held: InCells[AssetParts], index: Integers) -> None:
    held = held.take(np.flatnonzero(index[held.cell] >= 0))
    clusters, cluster, area = placed.assets.clusters, held.items.cluster, held.totals.optical_area[:, None]
    local, full = clusters.moment[cluster], np.empty((len(cluster), 3, 3))
    for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
        full[:, i, j] = full[:, j, i] = local[:, k]
    turn = placed.cofactors(held.items.instance)
    moment = turn @ full @ turn.transpose(0, 2, 1)
    moment /= np.maximum(np.trace(moment, axis1=1, axis2=2), 1e-300)[:, None, None]
    even = np.broadcast_to([1.0, 0.0], (len(cluster), 2))
    look = clusters.color[cluster], clusters.transmission[cluster][:, None]
    seen = np.concatenate([np.ones_like(area), *look, moment.reshape(-1, 9), even], axis=1)
    _add(sums, index[held.cell], area * seen)


def _moments(sums: Floats) -> Floats:
    """Moments of trace 1 (n, 3, 3) of sums of polynomials, whose least eigenvalue may lie a little below 0."""
    values, vectors = np.linalg.eigh((sums + sums.transpose(0, 2, 1)) / 2)
    values = np.maximum(values, 0)
    trace = values.sum(axis=1, keepdims=True)
    return (vectors * (values / np.where(trace > 0, trace, 1))[:, None]) @ vectors.transpose(0, 2, 1)


def extinction_matrices(summaries: Summaries, volumes: Floats) -> tuple[NDArray, NDArray, NDArray]:
    """Extinction by direction, as it is between clusters of leaves, and the plane that the surfaces resemble.

    Returns
    -------
    S : (n, 6) float64
        Sxx, Syy, Szz, Sxy, Sxz, Syz with κ(ω) = √(ωᵀSω), 1/m² (the form of Heitz, Dupuy, Crassin and Dachsbacher, "The
        SGGX Microflake Distribution", 2015).
    normal : (n, 3) float64
        Axis in which most normals lie.
    plane : (n,) float64
        0 for surfaces that face all ways, 1 for parallel ones: (3 λmax − 1) / 2 of the moment, the weight of the
        paper's plane term (section 7) for two-sided surfaces.
    """
    values, vectors = np.linalg.eigh(summaries.moment)
    density = summaries.effective_area(volumes) / volumes
    axes_squared = np.clip(values, 0, 1) ** (2 * _ROOT) * density[:, None] ** 2
    s = np.einsum("nik,nk,njk->nij", vectors, axes_squared, vectors)
    packed = np.stack([s[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], axis=1)
    return packed, vectors[:, :, 2], np.clip((3 * values[:, 2] - 1) / 2, 0, 1)
