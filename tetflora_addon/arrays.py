# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures of arrays: many things of one kind, with one array for each of their properties.

Vectors are (n, 3) and frames (n, 3, 3), but memory holds one component of all n after the other. Arithmetic on such
arrays runs along n without strides, and its results keep the layout; in indexing and stacking the functions below do.

Where things come and go in small steps, what that costs goes with what changes, not with what is there: `Growing` has
room to spare and is changed in place, for few columns. `Chunks` only collects, for many.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any, Generic, Self, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

#: Arrays by what they hold. A table has one structured row for each kind of branch, see `growth.rows`.
Floats, Floats32, Floats16 = NDArray[np.float64], NDArray[np.float32], NDArray[np.float16]
Integers, Integers32 = NDArray[np.integer], NDArray[np.int32]
Keys = NDArray[np.uint64]
Mask = NDArray[np.bool_]
Table = NDArray[np.void]
#: Steps in radians that spread directions evenly about an axis: full turns by the golden section, and the golden angle.
GOLDEN_TURN, GOLDEN_ANGLE = np.pi * (1.0 + np.sqrt(5.0)), np.pi * (3.0 - np.sqrt(5.0))
#: Room to spare where columns of `Growing` are made larger: one part in so many of what is there.
_SPARE = 3


@dataclass(frozen=True)
class _Components:
    """An array (n, ...) as its components, each of all n."""

    components: NDArray

    @classmethod
    def of(cls, value: Any) -> Any:
        """Such an array with more than two dimensions; everything else stays what it is."""
        if not isinstance(value, np.ndarray) or value.ndim < 3:
            return value
        turned = np.moveaxis(value, 0, -1)
        return cls(turned) if turned.flags.c_contiguous else value

    def array(self) -> NDArray:
        """The array."""
        return np.moveaxis(self.components, -1, 0)


def srgb_of(linear: NDArray[np.floating]) -> NDArray[np.floating]:
    """Linear values from 0 to 1 as images store them (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def linear_of(stored: NDArray[np.floating]) -> NDArray[np.floating]:
    """The opposite of `srgb_of`."""
    return np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)


def bilinear(values: NDArray[np.floating], place: NDArray[np.floating]) -> Floats:
    """Values (n,) of a grid (h, w) at places (n, 2) in columns and rows, linear between; beyond, of its border."""
    rows, columns = values.shape
    place = np.clip(place, 0.0, (columns - 1, rows - 1))
    low = place.astype(np.int64)
    (x, y), (right, above) = low.T, np.minimum(low + 1, (columns - 1, rows - 1)).T
    part, rise = (place - low).T
    bottom = values[y, x] * (1.0 - part) + values[y, right] * part
    top = values[above, x] * (1.0 - part) + values[above, right] * part
    return bottom * (1.0 - rise) + top * rise


def smoothstep(x: Floats, low: float = 0.0, high: float = 1.0) -> Floats:
    """0 up to ``low``, 1 from ``high`` on, without a bend between (Hermite)."""
    part = np.clip((x - low) / (high - low), 0.0, 1.0)
    return part * part * (3.0 - 2.0 * part)


class Arrays:
    """Base of dataclasses whose fields are columns: one row for each of n things.

    A column is an array, or an `Arrays` of the same length; absent where its default is None. Other fields are kept.
    """

    def __getstate__(self) -> dict[str, Any]:
        """All there is, with arrays of matrices as they lie in memory: pickles would put one matrix after the other."""
        return {name: _Components.of(value) for name, value in vars(self).items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """The same again."""
        attributes = {n: value.array() if isinstance(value, _Components) else value for n, value in state.items()}
        vars(self).update(attributes)

    def __len__(self) -> int:
        return next(len(c) for c in vars(self).values() if isinstance(c, np.ndarray | Arrays))

    @property
    def nbytes(self) -> int:
        """Bytes of all columns."""
        columns = (getattr(self, name) for name in _names(type(self)))
        return sum(c.nbytes for c in columns if isinstance(c, np.ndarray | Arrays))

    def take(self, index: NDArray | slice) -> Self:
        """Rows by indices (k,), mask (n,) or slice.

        A mask that is all true returns the object itself: never write into what this returns.
        """
        if not isinstance(index, slice) and index.dtype == bool:
            if index.all():
                return self
            index = np.flatnonzero(index)  # once, not for each column
        columns = [getattr(self, name) for name in _names(type(self))]
        columns = (gathered(c, index) if isinstance(c, np.ndarray) else c for c in columns)
        return type(self)(*(c.take(index) if isinstance(c, Arrays) else c for c in columns))

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """All things of several in one; what is not a column comes from the first part."""
        if not parts:
            return cls.empty()
        full = [p for p in parts if len(p)]  # what is empty lacks columns that are optional
        owners = ((name, full if name in _optional(cls) else parts) for name in _names(cls))
        return cls(*(_joined([getattr(p, name) for p in those]) for name, those in owners))

    @classmethod
    def zeros(cls, number: int) -> Self:
        """So many things, all columns 0; these are (n,) float64 unless their fields are by `column` or `nested`."""
        every = (f.metadata.get("zeros", np.zeros) for f in fields(cls) if f.name not in _optional(cls))
        return cls(*(zeros(number) for zeros in every))

    @classmethod
    def empty(cls) -> Self:
        """No things."""
        return cls.zeros(0)

    @classmethod
    def typed(cls, *columns: NDArray) -> Self:
        """Things from all their columns, which get the types that fields have."""
        return cls(*(c.astype(of.dtype) for c, of in zip(columns, vars(cls.empty()).values(), strict=True)))


def column(*shape: int, dtype: DTypeLike = np.float64) -> Any:
    """Field of a structure that is an array (n, *shape), see `Arrays.zeros`."""
    return field(metadata={"zeros": lambda number: np.zeros((number, *shape), dtype)})


def nested(kind: type[Arrays]) -> Any:
    """Field of a structure that is another structure of arrays, see `Arrays.zeros`."""
    return field(metadata={"zeros": kind.zeros})


def gathered(array: NDArray, index: NDArray | slice) -> NDArray:
    """``array[index]`` of an array (n, ...), by component; ``index`` is integers (k,), a mask (n,) or a slice."""
    if isinstance(index, slice):
        return array[index]
    index = np.flatnonzero(index) if index.dtype == bool else index
    if array.ndim <= 2:  # most are, and the order of a matrix's axes takes as long as its numbers
        return array.T.take(index, axis=-1).T
    # As it lies in memory, or numpy would copy it first; np.moveaxis and np.stack cost as much as a thousand numbers.
    order = sorted(range(1, array.ndim), key=array.strides.__getitem__, reverse=True)
    picked = array.transpose(*order, 0).take(index, axis=-1)
    return picked.transpose(-1, *(order.index(axis) for axis in range(1, array.ndim)))


def spread(counts: Integers) -> tuple[Integers, Integers]:
    """Owner (m,) and running index within the owner (m,) for ``counts`` things each; m is their sum."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - (np.cumsum(counts) - counts)[owner]


def chunks(counts: NDArray, limit: float) -> Iterator[slice]:
    """Runs of things, of which ``counts`` (n,), perhaps expected ones, sum up to about a limit each."""
    edges = np.flatnonzero(np.diff((np.cumsum(counts) / limit).astype(np.int64))) + 1
    for start, stop in zip([0, *edges], [*edges, len(counts)], strict=True):
        if stop > start:
            yield slice(int(start), int(stop))


def connected(n: int, a: Integers, b: Integers) -> Integers32:
    """(n,) smallest index in the part of each of n things, of which a (e,) and b (e,) are connected."""
    label = np.arange(n, dtype=np.int32)
    while True:
        one, other = label[a], label[b]
        apart = one != other
        if not apart.any():
            return label
        a, b, one, other = a[apart], b[apart], one[apart], other[apart]
        np.minimum.at(label, np.maximum(one, other), np.minimum(one, other))
        label = top(label)


def top(up: Integers) -> Integers:
    """Where each thing (n,) comes to by following ``up`` until it stays; the steps double each time."""
    while (up[up] != up).any():
        up = up[up]
    return up


def _joined(columns: list[Any]) -> Any:
    if not columns or columns[0] is None:
        return None
    if isinstance(columns[0], Arrays):
        return type(columns[0]).concatenate(columns)
    return np.concatenate(columns) if isinstance(columns[0], np.ndarray) else columns[0]


@cache
def _names(kind: type[Arrays]) -> tuple[str, ...]:
    return tuple(f.name for f in fields(kind))


@cache
def _optional(kind: type[Arrays]) -> frozenset[str]:
    return frozenset(f.name for f in fields(kind) if f.default is None)


def by_component(array: NDArray) -> NDArray:
    """The same values (n, ...), with memory laid out component by component."""
    by = np.ascontiguousarray(array.transpose(*range(1, array.ndim), 0))  # np.moveaxis would take longer
    return by.transpose(-1, *range(array.ndim - 1))


def columns(x: NDArray, y: NDArray, z: NDArray) -> NDArray:
    """Frames (n, 3, 3) with columns x, y, z (n, 3)."""
    return np.stack([x.T, y.T, z.T], axis=1).transpose(2, 0, 1)


def dot(a: NDArray, b: NDArray) -> NDArray:
    """Scalar products (n, 1) of vectors (n, 3)."""
    return (a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])[:, None]


def cross(a: NDArray, b: NDArray) -> NDArray:
    """Vector products (n, 3); numpy's own shuffles axes."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]).T


def products(a: NDArray, b: NDArray) -> NDArray:
    """Matrix products (n, 3, 3) of matrices (n, 3, 3), by component: numpy multiplies small ones one by one."""
    a, b = a.transpose(1, 2, 0), b.transpose(1, 2, 0)
    out = a[:, 0, None] * b[None, 0]
    out += a[:, 1, None] * b[None, 1]
    out += a[:, 2, None] * b[None, 2]
    return out.transpose(2, 0, 1)


def in_axes(points: NDArray, frame: NDArray, origin: NDArray | tuple[float, ...] = (0.0, 0.0, 0.0)) -> NDArray:
    """Coordinates (..., 3) of points along the columns of a frame (3, 3), in the points' precision, by component.

    A product with a matrix of three rows takes ten times as long.
    """
    x, y, z = (points[..., i] - points.dtype.type(origin[i]) for i in range(3))
    frame = frame.astype(points.dtype)
    out = np.array([x * frame[0, k] + y * frame[1, k] + z * frame[2, k] for k in range(3)])
    return out.transpose(*range(1, out.ndim), 0)


def length(a: NDArray) -> NDArray:
    """Lengths (n,) of vectors (n, 3), by component."""
    return np.sqrt(dot(a, a)[:, 0])


def unit(a: NDArray) -> NDArray:
    """Vectors (n, 3) scaled to length 1, in the precision that they have; zero vectors stay."""
    return a / np.maximum(np.sqrt(dot(a, a)), np.finfo(a.dtype).tiny)


def perpendicular(axis: NDArray) -> NDArray:
    """A unit vector (n, 3) across each of unit vectors (n, 3), turned about it as may be."""
    return unit(cross(axis, np.where(np.abs(axis[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])))


def spiral(z: NDArray, index: NDArray, step: float = GOLDEN_ANGLE) -> NDArray:
    """Unit vectors (n, 3) of a Fibonacci lattice: heights z (n,), turned by ``index`` (n,) × ``step`` radians."""
    turn, level = step * index, np.sqrt(1.0 - z * z)
    return np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=1)


Rows = TypeVar("Rows", bound=Arrays)


class Growing(Generic[Rows]):
    """Things of one kind in columns that have room to spare; takes them over and changes them in place.

    All columns must be arrays. They lie row by row, as a few rows of many are asked for.
    """

    def __init__(self, rows: Rows) -> None:
        self._kind, self._number = type(rows), len(rows)
        self._columns = {name: np.ascontiguousarray(getattr(rows, name)) for name in _names(self._kind)}

    def __len__(self) -> int:
        return self._number

    @property
    def rows(self) -> Rows:
        """All things, not a copy: valid until some are appended or exchanged; whoever writes there changes them."""
        return self._kind(*(array[: self._number] for array in self._columns.values()))

    @property
    def nbytes(self) -> int:
        """Bytes of all columns, with the room to spare."""
        return sum(array.nbytes for array in self._columns.values())

    def append(self, new: Rows) -> None:
        """Put things behind all others."""
        start, self._number = self._number, self._number + len(new)
        for name, array in self._columns.items():
            if self._number > len(array):  # one column after the other: only one is there twice
                wider = np.empty((self._number + self._number // _SPARE, *array.shape[1:]), array.dtype)
                wider[:start] = array[:start]
                self._columns[name] = array = wider
            array[start : self._number] = getattr(new, name)

    def exchange(self, gone: Integers, new: Rows) -> None:
        """Drop rows (k,), ascending, and put new things in their places first, then behind all others.

        Those that stay keep their order, and so do new ones: what is in one order stays so.
        """
        reused = gone[: len(new)]
        for name, array in self._columns.items():
            array[reused] = getattr(new, name)[: len(reused)]
        if len(new) > len(gone):
            self.append(new.take(slice(len(gone), None)))
        elif len(gone) > len(new):
            self._drop(gone[len(new) :])

    def _drop(self, gone: Integers) -> None:
        """Move up all that is behind rows (k,) that are dropped; rare, as what is opened is more than it was."""
        first, kept = int(gone[0]), np.ones(self._number, bool)
        kept[gone] = False
        stay = first + np.flatnonzero(kept[first:])
        self._number = first + len(stay)
        for array in self._columns.values():
            array[first : self._number] = np.take(array, stay, axis=0)


class Chunks(Generic[Rows]):
    """Things of one kind in the chunks that they came in; what is taken out is only marked until all are joined."""

    def __init__(self, first: Rows) -> None:
        self.kind, self._chunks, self._unmarked, self._number = type(first), [], [], 0
        self.marked = 0
        self.append(first)

    def __len__(self) -> int:
        """Rows, with those that are marked."""
        return self._number

    @property
    def nbytes(self) -> int:
        """Bytes of all columns, with rows that are marked."""
        return sum(chunk.nbytes for chunk in self._chunks) + self._number

    def append(self, new: Rows) -> None:
        """Put things behind all others, not copied."""
        self._chunks.append(new)
        self._unmarked.append(np.ones(len(new), bool))
        self._number += len(new)

    def take_out(self, rows: Integers) -> Rows:
        """Mark and return rows (k,), ascending, none of which is marked."""
        out, start = [], 0
        runs = np.split(rows, np.searchsorted(rows, np.cumsum([len(chunk) for chunk in self._chunks])[:-1]))
        for (chunk, kept), run in zip(self.chunks(), runs, strict=True):
            if len(run):
                out.append(chunk.take(run - start))
                kept[run - start] = False
            start += len(chunk)
        self.marked += len(rows)
        return self.kind.concatenate(out or [self._chunks[0].take(slice(0))])

    @property
    def unmarked(self) -> Mask:
        """Rows (n,) that are not marked."""
        return np.concatenate(self._unmarked)

    def chunks(self) -> Iterator[tuple[Rows, Mask]]:
        """Each chunk (k), and which of its rows (k,) are not marked."""
        return zip(self._chunks, self._unmarked, strict=True)

    def joined(self) -> Rows:
        """All that is not marked, as the only chunk from now on: rows have new numbers, in the same order."""
        if len(self._chunks) > 1 or self.marked:
            one = self.kind.concatenate([chunk.take(kept) for chunk, kept in self.chunks()])
            self._chunks, self._unmarked, self._number, self.marked = [], [], 0, 0
            self.append(one)
        return self._chunks[0]


def quaternions(frame: Floats) -> Floats:
    """Unit quaternions, (n, 4) with w first, of rotations, (n, 3, 3).

    Of four ways to write it, that of the largest component is exact (Shepperd, Journal of Guidance and Control, 1978).
    """
    r = frame
    trace, first = np.trace(r, axis1=1, axis2=2), 1 + r[:, 0, 0] + r[:, 1, 1] + r[:, 2, 2]
    w = np.stack([first, *(1.0 + 2.0 * r[:, i, i] - trace for i in range(3))], axis=1)
    a, b, c = r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]
    d, e, f = r[:, 1, 0] + r[:, 0, 1], r[:, 0, 2] + r[:, 2, 0], r[:, 2, 1] + r[:, 1, 2]
    rows = ((w[:, 0], a, b, c), (a, w[:, 1], d, e), (b, d, w[:, 2], f), (c, e, f, w[:, 3]))
    ways = np.stack([np.stack(row, axis=1) for row in rows], axis=1)
    best = ways[np.arange(len(r)), np.argmax(w, axis=1)]
    return best / np.linalg.norm(best, axis=1, keepdims=True)
