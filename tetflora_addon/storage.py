# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What takes long to compute is kept: in a folder across sessions, in memory within one.

The cache folder has one file for each result, named after its kind and a digest of all that it follows from, so a file
may become unused but never wrong. Processes and users may share the folder: files are written whole or not at all, even
on a full disk, never through links, and each user clears away what is his own. Damaged, foreign or unreadable files
count as absent, and none is taken for larger than the result that is looked for. Trouble with the folder is reported
once on stderr and stops nothing. `memoized` does the same in memory for functions of arrays.
"""

import hashlib
import io
import os
import re
import sys
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import wraps
from itertools import islice
from math import prod
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .errors import TetFloraError
from .files import PART, path_in, read_whole, write_whole

Result = TypeVar("Result")
Found = TypeVar("Found", Floats, None)
_FORMAT = 1  # raise it when files are written in another way
#: All files of a user take no more than so many bytes, each a few thousand; those not used for longest go first.
MOST_BYTES = 64 << 20
#: Entries of the folder that are looked at to make room: whoever fills it must not stop the others.
_MOST_ENTRIES = 50_000
_HEADERS = 4096  # bytes of a file beside its values: names and headers
#: Seconds after which a file that was begun and not ended is taken for one of a process that was killed.
_ABANDONED = 3600.0

_OURS = re.compile(r"tetflora-[a-z_]+-\d+-[0-9a-f]+\.npz")
_BEGUN = re.compile("[0-9a-f]+".join(map(re.escape, PART)))

_folder: Path | None = None
_problem = ""


def set_folder(folder: Path | None) -> None:
    """Keep results in a folder from now on, which is made when there is a first one; None for nowhere."""
    global _folder, _problem
    if folder != _folder:
        _folder, _problem = folder, ""


def current_folder() -> Path | None:
    """The folder that results are kept in."""
    return _folder


def last_problem() -> str:
    """What went wrong with the folder since it is used; empty if nothing did."""
    return _problem


def cached(kind: str, content: str, shape: tuple[int, ...], compute: Callable[[], Found]) -> Floats | Found:
    """A result from the cache folder, or computed now and stored there.

    Parameters
    ----------
    kind : str
        What it is; small letters and underscores.
    content : str
        Hash, in hexadecimal, of everything that the result follows from, the method included.
    shape : tuple of int
        Of the result; a file with another one does not count.
    compute : callable
        Returns the result: finite numbers, always the same ones to the last bit. What is None is not stored.
    """
    if _folder is None:
        return compute()
    path = _folder / f"tetflora-{kind}-{_FORMAT}-{content}.npz"
    if not _OURS.fullmatch(path.name):
        raise ValueError(f"{path.name} is no name of a result")
    values = _read(path, shape)
    if values is None and (values := compute()) is not None:
        write_arrays(path, _OURS, MOST_BYTES, values=values, name=np.array(path.name))
    return values


def clear(folder: Path | None = None, names: re.Pattern[str] | None = None) -> int:
    """Delete all results of this user in the folder, and nothing else that lies there; returns how many there were.

    Parameters
    ----------
    folder : Path, optional
        Another one than that which is used, for files of other names.
    names : re.Pattern, optional
        Of these.

    Raises
    ------
    TetFloraError
        Some cannot be deleted.
    """
    number, folder = 0, folder or _folder
    try:
        for entry in _entries(names or _OURS, folder):
            if _is_own(entry.stat(follow_symlinks=False)):
                Path(entry).unlink(missing_ok=True)
                number += 1
    except OSError as error:
        problem = f"Cannot clear the cache folder {folder}: {error.strerror}. Check its permissions"
        raise TetFloraError(problem) from None
    return number


def _read(path: Path, shape: tuple[int, ...]) -> Floats | None:
    def checked(stored: Mapping[str, NDArray]) -> Floats:
        values, name = stored["values"], str(stored["name"])
        if name != path.name or values.dtype != np.float64 or values.shape != shape or not np.isfinite(values).all():
            raise ValueError(path.name)
        return values

    return read_arrays(path, 8 * prod(shape) + _HEADERS, checked)


def read_arrays(path: Path, most: int, checked: Callable[[Mapping[str, NDArray]], Result]) -> Result | None:
    """What a function makes of the arrays in a file of at most so many bytes; None where it is absent or damaged.

    The function refuses by an error of any kind what is not sound.
    """
    try:
        content = read_whole(path, most)
        _refuse_packed(content, most)
        with np.load(io.BytesIO(content), allow_pickle=False) as stored:
            result = checked(stored)
    except FileNotFoundError:
        return None
    except Exception:  # there is no end to what zipfile and numpy raise for what is not theirs
        warn(f"{path} is damaged or unreadable and will be rebuilt")
        return None
    with suppress(OSError):  # a folder of somebody else's, to be read only
        os.utime(path, follow_symlinks=os.utime not in os.supports_follow_symlinks)
    return result


def _refuse_packed(content: bytes, most: int) -> None:
    """Refuse an archive that would take more memory than it has bytes: ours are not compressed, and say their size."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        for info in archive.infolist():
            if info.compress_type != zipfile.ZIP_STORED or info.file_size > most:
                raise ValueError("it is compressed")
            with archive.open(info) as file:
                if np.lib.format.read_magic(file) != (1, 0):
                    raise ValueError("it has another format")
                shape, _, dtype = np.lib.format.read_array_header_1_0(file)
                if prod(shape) * dtype.itemsize > most:
                    raise ValueError("it says to be larger than it is")


def write_arrays(path: Path, names: re.Pattern[str], most: int, **arrays: NDArray) -> None:
    """Store arrays in a file, and make room for it among those of some names; trouble is reported and stops nothing."""
    content = io.BytesIO()
    np.savez(content, **arrays)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path_in(path.parent, path.name), content.getvalue())
        _make_room(path.parent, names, most)
    except OSError as error:
        warn(f"cannot write to the cache folder {path.parent}: {error.strerror}")


def _make_room(folder: Path, names: re.Pattern[str], most: int) -> None:
    """Delete this user's files of some names in a folder, longest unused first, down to ``most`` bytes; and left-overs.

    Any may be gone: other processes tidy up as well. What others own counts for them alone, or they could empty it.
    """
    now, files = time.time(), []
    for entry in islice(_entries(re.compile(f"{names.pattern}|{_BEGUN.pattern}"), folder), _MOST_ENTRIES):
        with suppress(OSError):
            status = entry.stat(follow_symlinks=False)
            if not _is_own(status):
                continue
            if names.fullmatch(entry.name):
                files.append((status.st_mtime_ns, status.st_size, entry.path))
            elif now - status.st_mtime > _ABANDONED:
                os.unlink(entry)
    total = sum(size for _, size, _ in files)
    for _, size, path in sorted(files):
        if total <= most:
            break
        with suppress(OSError):
            os.unlink(path)
        total -= size


def _is_own(status: os.stat_result) -> bool:
    """Whether this user owns a file; everybody all of them where the system does not tell."""
    return not hasattr(os, "getuid") or status.st_uid == os.getuid()


def _entries(pattern: re.Pattern[str], folder: Path | None) -> Iterator[os.DirEntry[str]]:
    """Regular files of a folder by name; none if there is no folder."""
    if folder is not None and folder.is_dir():
        with os.scandir(folder) as entries:
            yield from (e for e in entries if pattern.fullmatch(e.name) and e.is_file(follow_symlinks=False))


def warn(text: str) -> None:
    """Report trouble with the folder, once."""
    global _problem
    if not _problem:
        print(f"TetFlora: warning: {text}", file=sys.stderr, flush=True)
        _problem = text


Arrays = tuple[NDArray, ...]


def memoized(most_bytes: int) -> Callable[[Callable[..., Arrays]], Callable[..., Arrays]]:
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
        def memo(*given: NDArray) -> Arrays:
            content = hashlib.sha256()
            for array in given:
                content.update(f"{array.dtype}{array.shape}".encode())
                content.update(np.ascontiguousarray(array))
            key = content.digest()
            results = kept.pop(key, None)
            if results is None:
                results = tuple(np.array(result) for result in function(*given))
                for result in results:
                    result.flags.writeable = False
            if _size(results) > most_bytes:
                return results
            kept[key] = results
            while sum(map(_size, kept.values())) > most_bytes:
                del kept[next(iter(kept))]
            return results

        return memo

    return decorated


def _size(arrays: Arrays) -> int:
    return sum(array.nbytes for array in arrays)
