# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaves as polygons: copies of the species' leaf models, written straight into the arrays of their mesh.

See section 5 of the paper. What is small in the image may be a kite; what is large has levels, see `leaves.levels`.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Keys, chunks, gathered, spread
from ..buffers import MeshBuffers
from ..compiled.flora import Flora
from ..growth import foliage
from ..growth.growth import WholeBranches, leaf_counts
from ..growth.hashing import Draw, uniform
from ..growth.seasons import is_seasonal, leaf_colors
from ..growth.seeds import Branches
from ..growth.wind import moment
from ..leaves.levels import KITE, LeafKites, LeafLevel, chosen_level, hidden_gloss, leaf_kites, leaf_levels, leaf_planes
from ..leaves.models import LeafModel
from .pieces import Thin

_ROW_BATCH = 4096


class LeafCopies:
    """A mesh of copies under construction.

    Parameters
    ----------
    of : LeafModel, LeafKites or LeafLevel
        A model; kites for one, of which keys choose a plane; or a finer, smooth level, of which they choose a variant.
    number : int
        Of copies in the end, at most.
    transmission : float
        Fraction of the light scattered through the leaf, the same for all.
    moving : bool
        Whether they have velocities.
    dull : float
        Part of the gloss of leaves that these hide from each other.
    """

    def __init__(
        self,
        of: LeafModel | LeafKites | LeafLevel,
        number: int,
        transmission: float,
        moving: bool = False,
        dull: float = 0.0,
    ) -> None:
        self.of, self.dull, self.done, self.transmission = of, dull, 0, transmission
        shapes = of.shapes if isinstance(of, LeafLevel) else of.positions
        self.model = of.model if isinstance(of, LeafLevel) else KITE if isinstance(of, LeafKites) else of
        self._corners = shapes.reshape(-1, 3)
        self.shapes = shapes.reshape(-1, *self.model.positions.shape).astype(np.float32).transpose(1, 2, 0)
        self._variant = np.zeros(number, np.int8)  # which of the shapes each has
        self.positions = np.zeros((number, 3 * len(self.model.positions)), np.float32)
        self.velocity = np.zeros_like(self.positions) if moving else None
        self.color = np.zeros((number, self.model.polygons, 3), np.float32)

    def add(
        self,
        key: Keys,
        position: Floats,
        frame: Floats32,
        size: Floats,
        color: Floats,
        motion: tuple[Floats, Floats32] | None = None,
    ) -> None:
        """Place the next n copies.

        Parameters
        ----------
        key : (n,) uint64
            Of the leaves.
        position : (n, 3) float64
            Of the model's origin, meters.
        frame : (n, 3, 3) float32
            Columns are the model's axes.
        size : (n,) float64
            Meters for one unit of the model.
        color : (n, 3) float64
            Linear RGB.
        motion : (n, 3) float64 and (n, 3, 3) float32, optional
            How fast the origin moves and the columns change, a second.
        """
        new = slice(self.done, self.done + len(size))
        self.done = new.stop
        if isinstance(self.of, LeafKites):
            self._variant[new] = self.of.chosen(uniform(key, Draw.LEAF_PLANE))
        elif isinstance(self.of, LeafLevel):
            self._variant[new] = uniform(key, Draw.LEAF_VARIANT) * self.shapes.shape[2]
        shape = self.shapes if isinstance(self.of, LeafModel) else self.shapes[:, :, self._variant[new]]
        self.positions[new] = _placed(shape, position, frame, size)
        if motion is not None:
            self.velocity[new] = _placed(shape, *motion, size)
        self.color[new] = color[:, None]

    def spheres(self, position: Floats, frame: Floats32, size: Floats) -> tuple[Floats, Floats]:
        """Middles (n, 3) and radii (n,) of spheres that hold copies, placed as by `add`, whichever shape they have."""
        corners = self._corners
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        reach = float(np.linalg.norm(corners - middle, axis=1).max())
        middle = sum(frame[:, :, axis] * np.float32(middle[axis]) for axis in range(3))
        return position + size[:, None] * middle, reach * size

    def buffers(self) -> MeshBuffers:
        """The mesh, once all copies are placed."""
        model, n, level = self.model, self.done, isinstance(self.of, LeafLevel)
        if level:
            self.color = np.asarray(self.of.colors(self.color[: self.done]), np.float32)
            if self.of.solid:
                self.transmission = self._through()
        edges, edge_of_corner = model.edges
        vertices, corners = len(model.positions), len(model.corner_verts)
        starts = _stepped(model.face_offsets[:-1], corners, n)
        uv, index = model.uv, model.material_index
        if isinstance(self.of, LeafKites):
            uv, index = self.of.uv[self._variant[:n]], self.of.material_index
            index = None if index is None else index[self._variant[:n]]
        else:
            uv = _stepped(uv.reshape(-1), 0, n)
            index = None if index is None else _stepped(index, 0, n)
        faces = n * model.polygons
        attributes = {"UVMap": ("CORNER", uv.reshape(-1, 2)), "tf_color": ("FACE", self.color[:n].reshape(-1, 3))}
        attributes["tf_transmission"] = "FACE", np.full(faces, self.transmission, np.float32)
        if self.dull:
            attributes["tf_dull"] = "FACE", np.full(faces, self.dull, np.float32)
        if index is not None:
            attributes["material_index"] = "FACE", index
        if self.velocity is not None:
            attributes["velocity"] = "POINT", self.velocity[:n].reshape(-1, 3)
        return MeshBuffers(
            positions=self.positions[:n].reshape(-1, 3),
            edge_verts=_stepped(edges.reshape(-1), vertices, n).reshape(-1, 2),
            corner_verts=_stepped(model.corner_verts, vertices, n),
            corner_edges=_stepped(edge_of_corner, len(edges), n),
            face_offsets=np.append(starts, np.int32(n * corners)),
            attributes=attributes,
            smooth=level or (model.closed and not model.textured),  # fruit and fleshy leaves are round
        )

    def _through(self) -> float:
        """Transmission of the faces of solid needles, which light passes twice; their colors are changed to it.

        A sheet of color c reflects (1 - T) c and lets T c through. Faces that reflect r and let t through send
        r + t² / (1 - r) on together: what is within meets faces until it comes out.
        """
        color, part = self.color, self.transmission
        reflected, passed = (1.0 - part) * color, part * color
        entering = float(np.sqrt(passed * (1.0 - reflected)).mean(dtype=np.float64))
        through = entering / max(entering + float(reflected.mean(dtype=np.float64)), 1e-9)
        a, b = 1.0 - through, through**2 - (1.0 - through) ** 2
        root = np.sqrt(np.maximum((a * (1.0 + color)) ** 2 + 4.0 * b * color, 0.0))
        np.minimum(2.0 * color / np.maximum(a * (1.0 + color) + root, 1e-9), 1.0, out=color)
        return through


def _placed(shape: Floats32, position: Floats, frame: Floats32, size: Floats) -> Floats32:
    """Vertices (n, 3 v) of copies of shapes (v, 3, n or 1); linear in position and frame, and so serves velocities."""
    scaled = frame.transpose(1, 2, 0) * size.astype(np.float32)  # (3, 3, n)
    points = np.zeros((len(shape), 3, len(size)), np.float32)
    for axis in range(3):
        point = points[:, axis]
        np.multiply(shape[:, 0], scaled[axis, 0], out=point)
        for column in (1, 2):
            point += shape[:, column] * scaled[axis, column]
        point += position[:, axis].astype(np.float32)
    return points.reshape(3 * len(shape), len(size)).T


def _stepped(pattern: NDArray, step: int, rows: int) -> NDArray:
    """A pattern (k,) over and over, greater by a step each time; as one row (rows * k,), in the pattern's own type.

    What is filled is the source of what follows: additions then run along many rows, not along one short pattern.
    """
    out = np.zeros((rows, len(pattern)), pattern.dtype)
    out[:1] = pattern
    done = 1
    while done < rows:
        more = min(done, _ROW_BATCH, rows - done)  # a source of no more than so many rows stays in the cache
        np.add(out[:more], out.dtype.type(done * step), out=out[done : done + more])
        done += more
    return out.reshape(-1)


_VERTEX_BATCH = 120_000  # vertices of leaves that are worked on at a time: some ten megabytes
#: Steps of leaves that are a kite, and a kite for each plane; that of others is their level, 0 for the species' model.
_KITE, _PLANES = -2, -1
#: Leaves change their level at lengths from this fraction of that of the first ones on, each by its own number.
_EARLIEST = 0.7


@dataclass(frozen=True)
class LeafMesh:
    """Copies of one form of leaf."""

    kind: int  # index into `species.LEAF_KINDS`
    form: int  # which of the species' forms of that kind
    buffers: MeshBuffers  # faces with ``UVMap``, ``tf_color`` and ``tf_transmission``


def leaf_meshes(
    flora: Flora,
    species: int,
    whole: Sequence[WholeBranches],
    fractions_of: Callable[[Branches], tuple[Floats, Floats, Floats]] | None = None,
    lengths_of: Callable[[WholeBranches], Floats] | None = None,
    thin: Thin | None = None,
) -> Iterator[LeafMesh]:
    """Copies of the leaf models for the leaves on branches of one species, form by form.

    Parameters
    ----------
    species : int
        Index into the flora's species.
    fractions_of : callable, optional
        Fractions (n,), (n,), (n,) of the leaves of branches that are wanted, and of these that are kites, and kites or
        a kite for each plane; the leaves' own random numbers decide which.
    lengths_of : callable, optional
        Lengths (n,) of the leaves of branches in the image, in errors that do not show; those of long ones are finer.
    """
    groups = [group for wood in whole for group in _bearers(flora, wood)]
    if fractions_of is not None:
        groups = [part for group in groups for part in group.parts(*fractions_of(group.whole.branches))]
    if lengths_of is not None:
        groups = [level for group in groups for level in group.levels(lengths_of(group.whole))]
    for kind, step in sorted({(group.kind, group.step) for group in groups}):
        bearers = [group for group in groups if (group.kind, group.step) == (kind, step)]
        forms = flora.forms[species][kind]
        numbers = sum(group.numbers() for group in bearers)
        for form in np.flatnonzero(numbers):
            given = int(numbers[form]), float(flora.leaf.transmission[bearers[0].row[0]]), moment(flora.rows) > 0
            copies = _copies(forms[form], step, *given)
            for group in bearers:
                group.add(copies, int(form), thin)
            if copies.done:
                yield LeafMesh(kind, int(form), copies.buffers())


def _copies(model: LeafModel, step: int, number: int, transmission: float, moving: bool) -> LeafCopies:
    """Room for a number of leaves of one step."""
    if step > 0:
        return LeafCopies(leaf_levels(model, step)[step - 1], number, transmission, moving)
    of = model if model.textured or step == 0 else leaf_kites(model) if step == _KITE else leaf_planes(model)
    return LeafCopies(of, number, transmission, moving, hidden_gloss(model))


def _bearers(flora: Flora, whole: WholeBranches) -> "Iterator[_LeafBearers]":
    """Those of branches that bear leaves, row by row."""
    row = whole.branches.row
    for one in np.unique(row[flora.rows["leaves"][row].sum(axis=1) > 0]).tolist():
        yield _LeafBearers(flora, one, whole.take(row == one))


class _LeafBearers:
    """Branches (n,) of one row, and which of their leaves are wanted.

    ``step`` says which: kites, kites for each plane, 0 models of the species, from 1 on their levels. ``fraction``
    (n,) of the leaves is wanted at all, and of these those with a random number from ``low`` (n,) to ``high`` (n,);
    where ``lengths`` (n,) of leaves are given, as of `leaf_meshes`, only those of the step are.
    """

    def __init__(
        self,
        flora: Flora,
        row: int,
        whole: WholeBranches,
        step: int = 0,
        fraction: Floats | None = None,
        low: Floats | None = None,
        high: Floats | None = None,
        lengths: Floats | None = None,
    ) -> None:
        self.flora, self.whole, self.counts = flora, whole, leaf_counts(flora.rows, whole.branches)
        self.step, self.fraction, self.low, self.high, self.lengths = step, fraction, low, high, lengths
        self.row = np.array([row])
        self.kind = int(flora.rows["leaf_kind"][row])
        self.forms = flora.forms[int(flora.rows["species"][row])][self.kind]

    def parts(self, fraction: Floats, kites: Floats, planes: Floats) -> Iterator[Self]:
        """The branches some of whose leaves are wanted as they are, and those with leaves as kites of both kinds."""
        none, every = np.zeros_like(kites), np.ones_like(kites)
        for step, low, high in ((0, planes, every), (_PLANES, kites, planes), (_KITE, none, kites)):
            bearing = (fraction > 0.0) & (low < high)
            if bearing.any():
                given = fraction[bearing], low[bearing], high[bearing]
                yield _LeafBearers(self.flora, int(self.row[0]), self.whole.take(bearing), step, *given)

    def levels(self, lengths: Floats) -> Iterator[Self]:
        """The branches by the levels that some of their leaves have; kites stay what they are."""
        if self.step < 0:
            yield self
            return
        ends = [[chosen_level(form, lengths * share) for form in self.forms] for share in (_EARLIEST, 1.0)]
        low, high = np.min(ends[0], axis=0), np.max(ends[1], axis=0)
        for step in range(int(high.max(initial=0)) + 1):
            bearing = np.flatnonzero((low <= step) & (step <= high))
            if len(bearing):
                given = (None if of is None else of[bearing] for of in (self.fraction, self.low, self.high))
                mixed = lengths[bearing] if (low[bearing] < high[bearing]).any() else None
                yield _LeafBearers(self.flora, int(self.row[0]), self.whole.take(bearing), step, *given, mixed)

    def numbers(self) -> Integers:
        """How many leaves there are of each form."""
        if len(self.forms) == 1 and self.fraction is None and self.lengths is None and not is_seasonal(self.flora.rows):
            return np.array([self.counts.sum()])
        out = np.zeros(len(self.forms), np.int64)
        for part in self._chunks(1):
            out += np.bincount(self._leaves(part)[3], minlength=len(self.forms))
        return out

    def add(self, copies: LeafCopies, form: int, thin: Thin | None) -> None:
        """Place all leaves of one of the forms that are worth it."""
        rows, vertices = self.flora.rows, len(copies.model.positions)
        for bearers, counts, owner, index, key in self._runs(form, vertices):
            t, larger = foliage.leaf_places(rows, bearers.branches, owner, index, counts, key), None
            leaves = foliage.place_leaves(rows, bearers.branches, bearers.lines, owner, index, key, t)
            frame = foliage.settled_in_wind(rows, bearers.branches, leaves)
            if thin is not None and not rows["envelope"][self.row[0]]:
                kept, times = thin(key, *copies.spheres(leaves.position, frame, leaves.size))
                owner, index, key, t, frame = (gathered(of, kept) for of in (owner, index, key, t, frame))
                leaves, larger = leaves.take(kept), np.sqrt(times)
            places, motion = (), None
            if rows["gradient"][self.row[0]]:
                places = foliage.outwardness(rows, bearers.branches, owner, t), foliage.youth(rows, self.row, t)
            if bearers.lines.later is not None:
                branches, seconds = bearers.branches.moved(), moment(rows)
                again = foliage.place_leaves(rows, branches, bearers.lines.later, owner, index, key, t)
                turned = foliage.settled_in_wind(rows, branches, again, seconds)
                motion = (again.position - leaves.position) / seconds, (turned - frame) / np.float32(seconds)
            if leaves.stages is not None:
                places = (*(places or (None, None)), leaves.stages, np.take(bearers.branches.year[:, 1], owner))
            size = leaves.size if larger is None else larger * leaves.size
            copies.add(key, leaves.position, frame, size, leaf_colors(rows, self.row, key, *places), motion)

    def _runs(self, form: int, vertices: int) -> Iterator[tuple[WholeBranches, *tuple[NDArray, ...]]]:
        """Branches and their counts; branch, number and key of some leaves of a form, which has a number of vertices.

        A single branch may bear a crown.
        """
        most = max(_VERTEX_BATCH // vertices, 1)
        for part in self._chunks(vertices):
            *leaves, forms = self._leaves(part)
            if len(self.forms) > 1:
                chosen = np.flatnonzero(forms == form)
                leaves = [of[chosen] for of in leaves]
            bearers = self.whole.take(part)
            for begin in range(0, len(leaves[0]), most):
                yield bearers, self.counts[part], *(of[begin : begin + most] for of in leaves)

    def _chunks(self, vertices: int) -> Iterator[slice]:
        """Runs of branches, for leaves of a number of vertices."""
        for run in chunks(self.counts * vertices, _VERTEX_BATCH):
            if self.counts[run].any():
                yield run

    def _leaves(self, part: slice) -> tuple[Integers, ...]:
        """Branch within the run, number on it, key and form of each wanted leaf."""
        owner, index = spread(self.counts[part])
        key = foliage.leaf_keys(self.whole.branches.take(part), owner, index)
        kept = np.ones(len(key), bool)
        if self.fraction is not None:
            wanted, low, high = self.fraction[part], self.low[part], self.high[part]
            if (wanted < 1.0).any():
                kept &= uniform(key, Draw.TRANSITION) < wanted[owner]
            if (low > 0.0).any() or (high < 1.0).any():
                number = uniform(key, Draw.LEAF_KITE)
                kept &= (low[owner] <= number) & (number < high[owner])
        form = foliage.leaf_forms(len(self.forms), key) if len(self.forms) > 1 else np.zeros(len(key), np.int64)
        if self.lengths is not None:
            length = self.lengths[part][owner] * (_EARLIEST + (1.0 - _EARLIEST) * uniform(key, Draw.LEAF_LEVEL))
            for number, model in enumerate(self.forms):
                kept &= (form != number) | (chosen_level(model, length) == self.step)
        stages = foliage.stages_of(self.flora.rows, self.whole.branches.take(part), owner, key)
        if stages is not None:
            kept &= stages.present
        if kept.all():
            return owner, index, key, form
        kept = np.flatnonzero(kept)
        return owner[kept], index[kept], key[kept], form[kept]
