# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures of arrays: many things of one kind, with one array for each of their properties.

Vectors are (n, 3) and frames (n, 3, 3), but memory holds one component of all n after the other. Arithmetic on such
arrays runs along n without strides, and its results keep the layout. Only indexing and stacking have to take care of
it; the functions below do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import DTypeLike, NDArray

#: Steps of `spiral` that spread directions evenly: the golden section twice, and the golden angle over π.
GOLDEN_TURN, GOLDEN_ANGLE = 1.0 + np.sqrt(5.0), 3.0 - np.sqrt(5.0)


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


class Arrays:
    """Base of dataclasses whose fields are columns: one row for each of n things.

    A column is an array, or another `Arrays` of the same length. One whose default is None may be absent. All other
    fields belong to the whole and are kept as they are.
    """

    def __getstate__(self) -> dict[str, Any]:
        """All there is, with arrays of matrices as they lie in memory: pickles would put one matrix after the other."""
        return {name: _Components.of(value) for name, value in vars(self).items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """The same again."""
        own = {n: value.array() if isinstance(value, _Components) else value for n, value in state.items()}
        vars(self).update(own)

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
        columns = (getattr(self, name) for name in _names(type(self)))
        return type(self)(*(self._rows(c, index) if isinstance(c, np.ndarray | Arrays) else c for c in columns))

    @staticmethod
    def _rows(own: NDArray | Arrays, index: NDArray | slice) -> NDArray | Arrays:
        return own.take(index) if isinstance(own, Arrays) else gathered(own, index)

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """All things of several in one; what is not a column comes from the first part."""
        if not parts:
            return cls.empty()
        some = [p for p in parts if len(p)]  # what is empty lacks columns that are optional
        return cls(
            *(_joined([getattr(p, name) for p in (some if name in _optional(cls) else parts)]) for name in _names(cls))
        )

    @classmethod
    def empty(cls) -> Self:
        """No things. Columns are (0,) float64 unless their fields have metadata by `column` or `nested`."""
        return cls(*(f.metadata.get("empty", _no_numbers)() for f in fields(cls) if f.name not in _optional(cls)))


def column(*shape: int, dtype: DTypeLike = np.float64) -> dict[str, Callable]:
    """Metadata of a field that is an array (n, *shape), for `Arrays.empty`."""
    return {"empty": lambda: np.zeros((0, *shape), dtype)}


def nested(kind: type[Arrays]) -> dict[str, Callable]:
    """Metadata of a field that is another structure of arrays, for `Arrays.empty`."""
    return {"empty": kind.empty}


def gathered(array: NDArray, index: NDArray | slice) -> NDArray:
    """``array[index]`` of an array (n, ...), by component; ``index`` is integers (k,), a mask (n,) or a slice."""
    if isinstance(index, slice):
        return array[index]
    if index.dtype == bool:
        index = np.flatnonzero(index)
    if array.ndim == 1:
        return np.take(array, index)
    # As np.moveaxis, which takes as long as arithmetic on a thousand numbers.
    picked = np.take(array.transpose(*range(1, array.ndim), 0), index, axis=-1)
    return picked.transpose(-1, *range(array.ndim - 1))


def spread(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Owner (m,) and running index within the owner (m,) for ``counts`` things each; m is their sum."""
    owner = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    return owner, np.arange(len(owner)) - first[owner]


def _joined(columns: list[Any]) -> Any:
    if not columns or columns[0] is None:
        return None
    if isinstance(columns[0], Arrays):
        return type(columns[0]).concatenate(columns)
    return np.concatenate(columns) if isinstance(columns[0], np.ndarray) else columns[0]


def _no_numbers() -> NDArray[np.float64]:
    return np.zeros(0)


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
    return np.stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ]
    ).T


def products(a: NDArray, b: NDArray) -> NDArray:
    """Matrix products (n, 3, 3) of matrices (n, 3, 3), by component: numpy multiplies small ones one by one."""
    a, b = np.moveaxis(a, 0, -1), np.moveaxis(b, 0, -1)
    out = a[:, 0, None] * b[None, 0]
    out += a[:, 1, None] * b[None, 1]
    out += a[:, 2, None] * b[None, 2]
    return np.moveaxis(out, -1, 0)


def unit(a: NDArray) -> NDArray:
    """Vectors (n, 3) scaled to length 1, in the precision that they have; zero vectors stay."""
    return a / np.maximum(np.sqrt(dot(a, a)), np.finfo(a.dtype).tiny)


def perpendicular(axis: NDArray) -> NDArray:
    """A unit vector (n, 3) across each of unit vectors (n, 3), turned about it as may be."""
    helper = np.where(np.abs(axis[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    return unit(np.cross(axis, helper))


def spiral(z: NDArray, index: NDArray, step: float) -> NDArray:
    """Unit vectors (n, 3) of a Fibonacci lattice: heights z (n,), turned by ``index`` (n,) × π × ``step``."""
    turn, level = np.pi * step * index, np.sqrt(1.0 - z * z)
    return np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=1)
