# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Levels of detail of single plants, by the method that refinement has: leaves are thinned by hashes of their keys.

A level is made for the size that a pixel has at the plant. Leaves that are smaller are fewer and larger, so that their
area stays, and have the form of kites (`leaves.levels`); wood that is thin is triangles, and of very thin wood fewer
are wider. Facets hide each other in another way than leaves do, so that the area of each level is corrected by what it
covers from afar: cover, mean color and outline are measured in parallel views of small cells.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats, Floats32, Integers, Keys, Mask, chunks, connected, in_axes, perpendicular, spiral, spread
from ..buffers import MeshBuffers, concatenate_buffers
from ..compiled.flora import Flora
from ..growth.growth import WholeBranches, leaf_counts, trunks
from ..growth.hashing import uniform
from ..growth.seeds import Seeds
from ..species.species import LEAF_KINDS
from ..subplants.leaf_meshes import leaf_meshes
from ..subplants.pieces import expand
from ..subplants.tubes import tube_buffers, twig_buffers

#: Pixels that a leaf or a twig is long, or wide, where it is not thinned.
_LONG, _WIDE = 1.7, 1.0
#: Leaves of the last level, and levels beside the full plant.
_LAST, _FEWEST, _MOST = 260, 2, 5
#: Pixels of width from which on wood has four sides, not three.
_BROAD = 4.0
#: Pixels to an image's height, and the angle of view over it: where levels take over is told for these.
PIXELS, ANGLE = 1080, np.radians(40.0)
#: Cells to a leaf's length in which cover is measured, and the fewest and most along a plant.
_CELLS, _FEWEST_CELLS, _MOST_CELLS = 2.0, 160, 700
_ROUNDS = 5
_CLOSE = 0.005  # of the cover
_WIDER = 3.0  # times as wide at most is wood that stands for more: beyond that, branches would be sheets
_KEPT, _TWIG = 241, 242  # draws of this module
_WHITE = (1.0, 1.0, 1.0)
#: Polygons of one kind, as ``'bark'`` or ``'leaf'``.
Parts = tuple[tuple[str, MeshBuffers], ...]


@dataclass(frozen=True)
class PlantLevel:
    """One level of detail of a plant, in the plant's own space."""

    parts: Parts
    pixel: float  # meters that a pixel spans at the plant from which on it is enough; 0 of the full plant
    larger: float = 1.0  # factor on the area of leaves by which they cover what those of the full plant do
    tint: tuple[float, float, float] = _WHITE  # factors on colors by which the mean is that of the full plant
    #: How far it is off the full plant: fractions of its cover and of its color, and pixels of its outline.
    cover: float = 0.0
    color: float = 0.0
    outline: float = 0.0

    @property
    def polygons(self) -> int:
        """Number of faces."""
        return sum(mesh.polygons for _, mesh in self.parts)

    @property
    def distance(self) -> float:
        """Meters from which on it is enough, for an image as of `PIXELS`."""
        return self.pixel * PIXELS / (2.0 * np.tan(ANGLE / 2.0))

    def screen_size(self, height: float) -> float:
        """Part of the image's height that a plant of a height has from there on, as Unity and Unreal count."""
        return 1.0 if self.pixel == 0.0 else min(height / (self.pixel * PIXELS), 1.0)


def levels_of(flora: Flora, seed: Seeds, number: int = 0, like: tuple[PlantLevel, ...] = ()) -> tuple[PlantLevel, ...]:
    """The levels of a plant of scale 1, the full one first.

    Parameters
    ----------
    seed : Seeds of 1
    number : int
        Levels, with the full one; 0 for as many as suit the plant, three to six.
    like : tuple of PlantLevel, optional
        Levels of another plant of the same kind, whose sizes of pixels hold, and with whose areas corrections begin.
    """
    grown = list(expand(flora, trunks(flora.rows, replace(seed, scale=np.ones(1), position=np.zeros((1, 3))))))
    back = seed.frame[0].astype(np.float32)
    full = PlantLevel(_parts(flora, grown, back), 0.0)
    if len(like) > 1:
        leaf, pixels = like[1].pixel * _LONG, [one.pixel for one in like[1:]]
        sizes = [float(np.log(one.larger)) for one in like[1:]]
    else:
        leaf, count = _leaves(flora, grown)
        first, last = leaf / _LONG, leaf / _LONG * np.sqrt(max(count / _LAST, 4.0))
        steps = number - 1 if number else int(np.clip(round(np.log2(last / first)), _FEWEST, _MOST))
        pixels = (first * (last / first) ** (np.arange(1, steps + 1) / max(steps, 1))).tolist()
        sizes = [0.0] * steps
    grids = _grids(full, leaf, pixels[-1] if pixels else leaf)
    truth, each = _views(grids, full.parts), zip(pixels, sizes, strict=True)
    return (full, *(_corrected(flora, grown, back, pixel, grids, truth, size) for pixel, size in each))


def _leaves(flora: Flora, grown: list[WholeBranches]) -> tuple[float, float]:
    """Mean length of the leaves of a plant, weighted by area, and their number; of its thinnest wood without any."""
    sums = np.zeros(3)
    for whole in grown:
        count = leaf_counts(flora.rows, whole.branches)
        size = flora.leaf_reach[whole.branches.row] * whole.branches.scale
        sums += [(count * size**3).sum(), (count * size**2).sum(), count.sum()]
    if sums[1] > 0.0:
        return float(sums[0] / sums[1]), float(sums[2])
    wood = np.concatenate([whole.branches.length for whole in grown])
    return float(np.median(wood)), float(len(wood))


def _grids(full: PlantLevel, leaf: float, margin: float) -> list[Grid]:
    points = np.concatenate([mesh.positions for _, mesh in full.parts])
    extent = float(np.ptp(points, axis=0).max())
    cell = float(np.clip(leaf / _CELLS, extent / _MOST_CELLS, extent / _FEWEST_CELLS))
    return [Grid.around(toward, cell, points, 2.0 * margin) for toward in VIEWS]


def _corrected(
    flora: Flora,
    grown: list[WholeBranches],
    back: Floats,
    pixel: float,
    grids: list[Grid],
    truth: list[PlantView],
    size: float,
) -> PlantLevel:
    """A level whose leaves are so much larger that it covers as much as the full plant on average over views, and whose
    colors are so much brighter that what is seen of it has the same mean. It begins with a size, the logarithm of area.
    """
    wanted, tried = sum(view.cover for view in truth), []
    plain = _parts(flora, grown, back, pixel)
    for _ in range(_ROUNDS):
        seen = _views(grids, _changed(plain, float(np.exp(size))))
        off = np.log(max(sum(view.cover for view in seen), 1) / wanted)
        tried.append((abs(off), size, off, seen))
        if abs(off) < _CLOSE:
            break
        # By secants of logarithms; at first, cover follows area a little less than in proportion.
        slope = 0.6 if len(tried) < 2 else (off - tried[-2][2]) / ((size - tried[-2][1]) or 1.0)
        size = float(np.clip(size - off / np.clip(slope, 0.2, 1.2), -1.5, 1.5))
    off, size, _, seen = min(tried, key=lambda one: one[0])
    larger, tint = float(np.exp(size)), tuple((_mean_color(truth) / np.maximum(_mean_color(seen), 1e-9)).tolist())
    parts = _changed(plain, larger, tint)
    color = _mean_color(_views(grids, parts)) / _mean_color(truth)
    outline = _outlines(seen, truth, grids, pixel)
    return PlantLevel(parts, pixel, larger, tint, float(np.expm1(off)), float(np.abs(color - 1.0).max()), outline)


def _changed(parts: Parts, larger: float, tint: tuple[float, float, float] = _WHITE) -> Parts:
    """Parts with leaves of so many times the area, and factors on all colors."""
    changed = []
    for kind, mesh in parts:
        color = np.clip(mesh.attributes["tf_color"][1] * np.array(tint, np.float32), 0.0, 1.0)
        mesh = replace(mesh, attributes={**mesh.attributes, "tf_color": ("FACE", color)})
        changed.append((kind, mesh if kind == "bark" else with_area(mesh, larger)))
    return tuple(changed)


def with_area(mesh: MeshBuffers, larger: float) -> MeshBuffers:
    """Leaves of so many times the area, each about its first vertex."""
    base = mesh.positions[connected(len(mesh.positions), *mesh.edge_verts.T)]
    return replace(mesh, positions=base + np.float32(np.sqrt(larger)) * (mesh.positions - base))


def _views(grids: list[Grid], parts: Parts) -> list[PlantView]:
    return [grid.view([mesh for _, mesh in parts]) for grid in grids]


def _mean_color(views: list[PlantView]) -> Floats:
    """Mean color (3,) of what is covered in views."""
    return np.average([view.color for view in views], axis=0, weights=[max(view.cover, 1) for view in views])


def _outlines(seen: list[PlantView], truth: list[PlantView], grids: list[Grid], pixel: float) -> float:
    """How far outlines are off on average, in pixels."""
    pairs = zip(seen, truth, grids, strict=True)
    return float(np.mean([one.outline_off(other) * grid.cell / pixel for one, other, grid in pairs]))


def _parts(flora: Flora, grown: list[WholeBranches], back: Floats, pixel: float = 0.0) -> Parts:
    """Polygons of a plant as they are enough for a size of pixels, turned back into its own space."""
    meshes, parts = [*_leaf_parts(flora, grown, pixel), *_wood_parts(flora, grown, pixel)], []
    for kind in dict.fromkeys(kind for kind, _ in meshes):
        mesh = concatenate_buffers([mesh for name, mesh in meshes if name == kind])
        if mesh is not None:
            parts.append((kind, replace(mesh, positions=in_axes(mesh.positions, back.T))))
    return tuple(parts)


def _leaf_parts(flora: Flora, grown: list[WholeBranches], pixel: float) -> Iterator[tuple[str, MeshBuffers]]:
    def thin(key: Keys, _center: Floats, radius: Floats) -> tuple[Integers, Floats]:
        part = np.clip((2.0 * radius / (_LONG * pixel)) ** 2, 0.0, 1.0)
        kept = np.flatnonzero(uniform(key, _KEPT) < part)
        return kept, 1.0 / part[kept]

    given = (lambda branches: (np.ones(len(branches)),) * 3, None, thin) if pixel else ()
    for mesh in leaf_meshes(flora, 0, grown, *given):
        yield LEAF_KINDS[mesh.kind], mesh.buffers


def _wood_parts(flora: Flora, grown: list[WholeBranches], pixel: float) -> Iterator[tuple[str, MeshBuffers]]:
    for whole in grown:
        if not pixel:
            meshes = [tube_buffers(flora, [whole])]
        else:
            branches = whole.branches
            wide = 2.0 * branches.radius / pixel
            slender, broad = ((wide >= low) & (wide < high) for low, high in ((_WIDE, _BROAD), (_BROAD, np.inf)))
            meshes = [
                tube_buffers(flora, [whole.take(np.flatnonzero(limbs))], None, sides)
                for limbs, sides in ((slender, 3), (broad, 4))
            ]
            likely = np.clip(np.pi * branches.radius * branches.length / (_LONG * pixel) ** 2, 1e-4, 1.0)
            limbs = np.flatnonzero((wide < _WIDE) & (uniform(branches.key, _TWIG) < likely))
            if len(limbs):
                wider, straight = np.minimum(1.0 / likely[limbs], _WIDER), np.ones(len(limbs), np.int64)
                meshes.append(twig_buffers(flora, whole.take(limbs), wider, straight))
        yield from (("bark", mesh) for mesh in meshes if mesh is not None)


#: Directions to look from: level ones and such that look down a little, as distant plants are seen.
VIEWS = spiral(np.array([0.0, 0.25, 0.1, 0.35]), np.arange(4), 2.4)
_BATCH = 2_000_000  # pairs of triangles and cells that are tested together
#: What of a row is beside its outline: single leaves beyond it are none.
_BESIDE = 0.02


@dataclass(frozen=True)
class PlantView:
    """A plant from one direction, in cells."""

    shown: Mask  # (h, w): cells that are covered
    color: tuple[float, float, float]  # mean of the surfaces that are seen, linear RGB

    @property
    def cover(self) -> int:
        """Cells that are covered."""
        return int(np.count_nonzero(self.shown))

    def _ends(self) -> Floats:
        """Left and right ends (h, 2) of what each row shows; single leaves beyond them count little."""
        total = np.cumsum(self.shown, axis=1)
        every = total[:, -1:]
        return np.stack([(total >= part * every).argmax(axis=1) for part in (_BESIDE, 1.0 - _BESIDE)], axis=1)

    def outline_off(self, other: PlantView) -> float:
        """How far ends of rows are off those of another view, in cells, on average over rows in which both show some;
        a row in which only one shows anything counts with half of its width.
        """
        shown, all_of = (view.shown.sum(axis=1) for view in (self, other))
        both = (shown > 0) & (all_of > 0)
        off = np.abs(self._ends() - other._ends()).mean(axis=1)
        alone = (shown > 0) != (all_of > 0)
        return float((off[both].sum() + (shown + all_of)[alone].sum() / 2.0) / max(both.sum() + alone.sum(), 1))


@dataclass(frozen=True)
class Grid:
    """Cells that several meshes are seen in from a direction."""

    toward: Floats  # (3,): unit, to the eye
    cell: float  # meters
    low: Integers  # (2,): first column and row
    shape: tuple[int, int]  # rows and columns

    @classmethod
    def around(cls, toward: Floats, cell: float, points: Floats32, margin: float) -> Grid:
        """Cells around points (v, 3), and so many meters beside them."""
        flat = in_axes(points, _axes(toward))[:, :2]
        low = np.floor((flat.min(axis=0) - margin) / cell).astype(np.int64)
        width, height = np.ceil((flat.max(axis=0) + margin) / cell).astype(np.int64) - low + 1
        return cls(toward, cell, low, (int(height), int(width)))

    def view(self, meshes: Sequence[MeshBuffers]) -> PlantView:
        """Meshes from the direction: a cell shows what is nearest to the eye at its middle."""
        depth, face = self.nearest(meshes)
        shown = depth > -np.inf
        colors = np.concatenate([mesh.attributes["tf_color"][1] for mesh in meshes])
        mean = colors[face[shown]].mean(axis=0, dtype=np.float64) if shown.any() else np.zeros(3)
        return PlantView(shown.reshape(self.shape), tuple(mean.tolist()))

    def nearest(self, meshes: Sequence[MeshBuffers]) -> tuple[Floats32, Integers]:
        """How far toward the eye what cells (h × w) show is, -inf where nothing is, and its face, counted through."""
        number = self.shape[0] * self.shape[1]
        depth, face, first = np.full(number, -np.inf, np.float32), np.zeros(number, np.int64), 0
        for mesh in meshes:
            owner, corners = triangles(mesh)
            seen = in_axes(mesh.positions, _axes(self.toward))
            self._draw([seen[:, k].take(corners.T) for k in range(3)], owner + first, depth, face)
            first += mesh.polygons
        return depth, face

    def places(self, depth: Floats32) -> Floats:
        """Places (k, 3) in the middle of cells that show something, by their depths (h × w)."""
        shown = np.flatnonzero(depth > -np.inf)
        row, column = np.divmod(shown, self.shape[1])
        flat = self.cell * (np.stack([column, row], axis=1) + self.low + 0.5)
        return np.column_stack([flat, depth[shown]]) @ _axes(self.toward).T

    def reaches(self, places: Floats, depth: Floats32, slack: float) -> Mask:
        """Places (k, 3) that nothing hides from the eye, by depths (h × w), but what is within so many meters."""
        local = in_axes(places, _axes(self.toward))
        cells = np.floor(local[:, :2] / self.cell).astype(np.int64) - self.low
        column, row = np.clip(cells, 0, np.array(self.shape)[::-1] - 1).T
        return local[:, 2] >= depth[row * self.shape[1] + column] - slack

    def _draw(self, corners: Sequence[Floats32], owner: Integers, depth: Floats32, face: Integers) -> None:
        """Put triangles of faces (t,) into the cells where they are nearest, by coordinates (3, t) of their corners."""
        rows, columns = self.shape
        *flat, z = corners
        # Middles of cells are whole numbers.
        x, y = (of / np.float32(self.cell) - np.float32(low + 0.5) for of, low in zip(flat, self.low, strict=True))
        left, below = (np.maximum(np.ceil(_least(of)), 0.0).astype(np.int32) for of in (x, y))
        wide = np.minimum(np.floor(-_least(-x)), columns - 1).astype(np.int32) - left + 1
        tall = np.minimum(np.floor(-_least(-y)), rows - 1).astype(np.int32) - below + 1
        drawn = np.flatnonzero((wide > 0) & (tall > 0))  # most triangles of fine plants have no middle of a cell
        for run in chunks((wide[drawn] * tall[drawn]).astype(np.float64), _BATCH):
            batch = drawn[run]
            of, index = spread((wide[batch] * tall[batch]).astype(np.int64))
            of = batch[of]
            row, column = np.divmod(index.astype(np.int32), wide[of])
            row, column = below[of] + row, left[of] + column
            ax, ay = x.take(of, axis=1) - column.astype(np.float32), y.take(of, axis=1) - row.astype(np.float32)
            weights = [ax[i] * ay[j] - ay[i] * ax[j] for i, j in ((1, 2), (2, 0), (0, 1))]
            inside = np.flatnonzero((_least(weights) >= 0.0) | (-_least([-w for w in weights]) <= 0.0))
            of, weights = of[inside], [w[inside] for w in weights]
            total = weights[0] + weights[1] + weights[2]
            near = sum(w * z[k].take(of) for k, w in enumerate(weights)) / np.where(total == 0.0, 1.0, total)
            cell = row[inside] * columns + column[inside]
            nearer = np.flatnonzero(near > depth[cell])
            near, cell, of = near[nearer], cell[nearer], of[nearer]
            np.maximum.at(depth, cell, near)
            kept = near == depth[cell]
            face[cell[kept]] = owner[of[kept]]


def _least(parts: Sequence[Floats32]) -> Floats32:
    return np.minimum(np.minimum(parts[0], parts[1]), parts[2])


def corner_triangles(mesh: MeshBuffers) -> tuple[Integers, Integers]:
    """Faces (t,) of the triangles that fan out over those of a mesh, and the corners (t, 3) of these."""
    owner, index = spread(np.maximum(np.diff(mesh.face_offsets) - 2, 0).astype(np.int64))
    first = mesh.face_offsets[owner]
    return owner, np.stack([first, first + index + 1, first + index + 2], axis=1)


def triangles(mesh: MeshBuffers) -> tuple[Integers, Integers]:
    """The same with the vertices (t, 3) of the triangles."""
    owner, corner = corner_triangles(mesh)
    return owner, mesh.corner_verts[corner]


def _axes(toward: Floats) -> Floats:
    """Columns (3, 3): to the right and up as seen from a direction (3,), and that itself."""
    right = np.cross([0.0, 0.0, 1.0], toward) if abs(toward[2]) < 0.99 else perpendicular(toward[None])[0]
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward], axis=1)
