# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results of functions of arrays, kept while the session lasts: asked the same again, they need not work it out again.

What is kept is known by a digest of all that it follows from, so that it is never wrong, only unused.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import wraps

import numpy as np
from numpy.typing import NDArray

Arrays = tuple[NDArray, ...]


def keeping(most_bytes: int) -> Callable[[Callable[..., Arrays]], Callable[..., Arrays]]:
    """Decorator for functions that take arrays alone, and give arrays that follow from these alone.

    Results are read only, for all who ask for the same get the same arrays. What nobody has asked for longest goes
    first; what is too large for the limit by itself is given, not kept, and makes nothing else go.

    Parameters
    ----------
    most_bytes : int
        That all results of the function together take.
    """

    def decorated(function: Callable[..., Arrays]) -> Callable[..., Arrays]:
        kept: dict[bytes, Arrays] = {}  # least recently asked for first

        @wraps(function)
        def remembering(*given: NDArray) -> Arrays:
            key = _digest(given)
            found = kept.pop(key, None)
            if found is None:
                found = tuple(np.array(result) for result in function(*given))
                for result in found:
                    result.flags.writeable = False
            if _size(found) > most_bytes:
                return found
            kept[key] = found
            while sum(map(_size, kept.values())) > most_bytes:
                del kept[next(iter(kept))]
            return found

        return remembering

    return decorated


def _size(arrays: Arrays) -> int:
    return sum(array.nbytes for array in arrays)


def _digest(arrays: Arrays) -> bytes:
    content = hashlib.sha256()
    for array in arrays:
        content.update(f"{array.dtype}{array.shape}".encode())
        content.update(np.ascontiguousarray(array))
    return content.digest()
