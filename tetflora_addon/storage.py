# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What takes long to compute is kept: in a folder across sessions, in memory within one.

The cache folder has one file for each result, named after its kind and a digest of all that it follows from, so a file
may become unused but never wrong. Processes may share the folder: files are written whole or not at all, even on a full
disk. Damaged, foreign or unreadable files count as absent. Trouble with the folder is reported once on stderr and stops
nothing. `keeping` does the same in memory for functions of arrays.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import wraps
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import TetFloraError

#: Names of files that are being written begin and end like this, whatever they are to become.
PART = (".tetflora-", ".part")


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file beside its place and then put it there; text becomes UTF-8.

    Readers in other processes see the old file or the new one, never a part of either.

    Raises
    ------
    OSError
        It cannot be written; an earlier file stays as it was.
    """
    place = Path(os.path.realpath(path))  # what a link leads to is replaced, not the link
    part = place.with_name(uuid.uuid4().hex.join(PART))
    try:
        with part.open("xb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())  # drives in the network only say here that they are full
        part.replace(place)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


#: Raise it when files are written in another way.
_FORMAT = 1
#: All files together take no more than so many bytes; those that were not used for longest go first. Each has a few
#: kilobytes.
MOST_BYTES = 64 << 20
#: Seconds after which a file that was begun and not ended is taken for one of a process that was killed.
_ABANDONED = 3600.0

_OURS = re.compile(r"tetflora-[a-z_]+-\d+-[0-9a-f]+\.npz")
_BEGUN = re.compile("[0-9a-f]+".join(map(re.escape, PART)))

_folder: Path | None = None
_trouble = ""


def use(folder: Path | None) -> None:
    """Keep results in a folder from now on, which is made when there is a first one; None for nowhere."""
    global _folder, _trouble
    if folder != _folder:
        _folder, _trouble = folder, ""


def used() -> Path | None:
    """The folder that results are kept in."""
    return _folder


def trouble() -> str:
    """What went wrong with the folder since it is used; empty if nothing did."""
    return _trouble


def remembered(
    kind: str, content: str, shape: tuple[int, ...], find_out: Callable[[], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """A result from the cache folder, or computed now and stored there.

    Parameters
    ----------
    kind : str
        What it is; small letters and underscores.
    content : str
        Hash, in hexadecimal, of everything that the result follows from, the method included.
    shape : tuple of int
        Of the result; a file with another one does not count.
    find_out : callable
        Returns the result: finite numbers, always the same ones to the last bit.
    """
    if _folder is None:
        return find_out()
    path = _folder / f"tetflora-{kind}-{_FORMAT}-{content}.npz"
    values = _read(path, shape)
    if values is None:
        values = find_out()
        _write(path, values)
    return values


def clear() -> int:
    """Delete all results in the folder, and nothing else that lies there; returns how many there were.

    Raises
    ------
    TetFloraError
        Some cannot be deleted.
    """
    number = 0
    try:
        for entry in _entries(_OURS):
            Path(entry).unlink(missing_ok=True)
            number += 1
    except OSError as error:
        raise TetFloraError(
            f"Cannot clear the cache folder {_folder}: {error.strerror}. Check its permissions"
        ) from None
    return number


def _read(path: Path, shape: tuple[int, ...]) -> NDArray[np.float64] | None:
    try:
        # Read first: numpy leaves damaged files open.
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as stored:
            values, name = stored["values"], str(stored["name"])
    except FileNotFoundError:
        return None
    except Exception:  # there is no end to what zipfile and numpy raise for what is not theirs
        return _damaged(path)
    if name != path.name or values.dtype != np.float64 or values.shape != shape or not np.isfinite(values).all():
        return _damaged(path)
    with suppress(OSError):  # a folder of somebody else's, to be read only
        os.utime(path)
    return values


def _damaged(path: Path) -> None:
    _warn(f"{path} is damaged or unreadable and will be rebuilt")


def _write(path: Path, values: NDArray[np.float64]) -> None:
    content = io.BytesIO()
    np.savez(content, values=values, name=np.array(path.name))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, content.getvalue())
        _make_room()
    except OSError as error:
        _warn(f"cannot write to the cache folder {path.parent}: {error.strerror}")


def _make_room() -> None:
    """Delete files that were not used for longest, as long as all are too large, and those that nobody will end.

    Any of them may be gone already: other processes tidy up as well.
    """
    now, files = time.time(), []
    for entry in _entries(_BEGUN):
        with suppress(FileNotFoundError):
            if now - entry.stat().st_mtime > _ABANDONED:
                os.unlink(entry)
    for entry in _entries(_OURS):
        with suppress(FileNotFoundError):
            status = entry.stat()
            files.append((status.st_mtime_ns, status.st_size, entry.path))
    total = sum(size for _, size, _ in files)
    for _, size, path in sorted(files):
        if total <= MOST_BYTES:
            break
        Path(path).unlink(missing_ok=True)
        total -= size


def _entries(pattern: re.Pattern[str]) -> Iterator[os.DirEntry[str]]:
    """Files of the folder by name; none if there is no folder."""
    if _folder is not None and _folder.is_dir():
        with os.scandir(_folder) as entries:
            yield from (e for e in entries if pattern.fullmatch(e.name) and e.is_file(follow_symlinks=False))


def _warn(text: str) -> None:
    global _trouble
    if not _trouble:
        print(f"TetFlora: warning: {text}", file=sys.stderr, flush=True)
        _trouble = text


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
