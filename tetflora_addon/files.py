# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files and names that anybody may have made: which are used at all, and how they are read and written.

All that goes wrong is an `OSError` with a text for the user. Links are never followed, neither to read nor to write:
in a folder that several users share, one of them could lead another one's program anywhere. Folders above may be links.
"""

import errno
import json
import os
import re
import stat
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from .errors import NAME, readable

#: Names of files that are being written begin and end like this, whatever they are to become.
PART = (".tetflora-", ".part")

_IDENTIFIER = re.compile(r"[A-Za-z0-9_-]{1,64}")
#: Names of devices on Windows, whatever the ending.
_RESERVED = re.compile(r"con|prn|aux|nul|(com|lpt)[0-9]", re.IGNORECASE)
IDENTIFIER_RULE = 'letters from a to z, digits, "_" and "-", at most 64, and no name that Windows reserves, such as con'

_NO_LINKS = getattr(os, "O_NOFOLLOW", 0)  # Windows has none
# A pipe would let whoever opens it wait for its other end.
_READING = os.O_RDONLY | _NO_LINKS | sum(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_CLOEXEC", "O_BINARY"))
#: Windows' errors of a file that another program has open, and seconds between tries to replace it.
_HELD, _WAITS = (5, 32), (0.01, 0.03, 0.1, 0.3, 0.6)
_DIGITS = 300  # of integers that every float can hold


def is_identifier(text: str) -> bool:
    """Whether a text may name a file that TetFlora writes, reads or deletes by it, on every system."""
    return bool(_IDENTIFIER.fullmatch(text)) and not _RESERVED.fullmatch(text)


def path_in(folder: Path, name: str) -> Path:
    """The path of a file right in a folder.

    Raises
    ------
    OSError
        The name leads anywhere else.
    """
    path = folder / name
    _refuse_nul(path)
    alone = name not in ("", ".", "..") and not set(name) & set("/\\:")
    if not alone or os.path.realpath(path.parent) != os.path.realpath(folder):
        raise OSError(errno.EINVAL, f'"{readable(name, NAME)}" does not lie in its folder')
    return path


def is_regular(path: Path) -> bool:
    """Whether there is a file that is neither a folder nor a link, pipe or device."""
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except (OSError, ValueError):
        return False


def read_whole(path: Path, most: int) -> bytes:
    """The content of a regular file.

    Parameters
    ----------
    most : int
        Bytes; a larger file is not read.

    Raises
    ------
    OSError
        It cannot be read, is too large, or is a link, folder, pipe or device.
    """
    _refuse_nul(path)
    before = os.lstat(path)
    _refuse_special(before)
    # It may be another one by now.
    with os.fdopen(os.open(path, _READING), "rb") as file:
        status = os.fstat(file.fileno())
        _refuse_special(status)
        if not _NO_LINKS and not os.path.samestat(before, status):
            raise OSError(errno.ELOOP, "it was replaced meanwhile; try again")
        content = file.read(most + 1) if status.st_size <= most else None
    if content is None or len(content) > most:
        raise OSError(errno.EFBIG, f"larger than {most:,} bytes, the limit for such a file")
    return content


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file beside its place and then put it there; text becomes UTF-8.

    Readers in other processes see the old file or the new one, never a part. A link is replaced, not what it leads to.

    Raises
    ------
    OSError
        It cannot be written; an earlier file stays as it was.
    """
    _refuse_nul(path)
    part = path.with_name(uuid.uuid4().hex.join(PART))
    try:
        with part.open("xb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())  # drives in the network only say here that they are full
        replace(part, path)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def replace(part: Path, path: Path) -> None:
    """Put a file in the place of another one; on Windows wait a moment for whoever has that open, as virus scanners do.

    Raises
    ------
    OSError
        It cannot be put there.
    """
    for wait in (*_WAITS, None):
        try:
            part.replace(path)
            return
        except PermissionError as error:
            if wait is None or getattr(error, "winerror", None) not in _HELD:
                raise
            time.sleep(wait)


def parse_json(content: bytes | str, constant: Callable[[str], float] = float) -> Any:
    """Decode JSON of which every part is a Python value that texts and floats can hold.

    Integers beyond floats become infinite, so that whoever checks a number refuses it by the name of its key.

    Parameters
    ----------
    constant : callable
        Makes numbers of ``NaN``, ``Infinity`` and ``-Infinity``, which JSON does not have.

    Raises
    ------
    ValueError
        It is no JSON, or a key comes twice in an object: Python's reader would take the last one and say nothing.
    """
    try:
        # Some editors begin a file with a mark of its encoding.
        text = content.decode("utf-8-sig") if isinstance(content, bytes) else content
        text.encode()
        data = json.loads(
            text,
            parse_constant=constant,
            parse_int=lambda number: int(number) if len(number) <= _DIGITS else float(number),
            object_pairs_hook=_once,
        )
        if "\\u" in text:
            json.dumps(data, ensure_ascii=False).encode()
    except _Twice:
        raise
    except UnicodeDecodeError:
        raise ValueError("is not valid JSON: not UTF-8 text; save the file as UTF-8") from None
    except UnicodeEncodeError:
        raise ValueError("is not valid JSON: half of a surrogate pair; write the whole character") from None
    except RecursionError:
        raise ValueError("is not valid JSON: too many brackets within each other") from None
    except ValueError as error:
        raise ValueError(f"is not valid JSON: {error}") from None
    return data


class _Twice(ValueError):
    """A key comes twice."""


def beside(module: str, name: str) -> Any:
    """What a JSON file of ours beside a module holds, each time anew."""
    return json.loads(Path(module).with_name(name).read_text(encoding="utf-8"))


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data = dict(pairs)
    if len(data) < len(pairs):
        seen: set[str] = set()
        twice = next(name for name, _ in pairs if name in seen or seen.add(name))
        raise _Twice(f"{readable(twice, NAME)}: duplicate key in one object; remove one of them")
    return data


def _refuse_nul(path: Path) -> None:
    """Refuse what no system takes for a path, which Python tells by errors of several kinds."""
    try:
        bad = b"\0" in os.fsencode(path)
    except ValueError:
        bad = True
    if bad:
        raise OSError(errno.EINVAL, "no file can have such a name")


def _refuse_special(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        kinds = {stat.S_IFLNK: "it is a link; use the file that it leads to", stat.S_IFDIR: "it is a folder"}
        raise OSError(errno.EINVAL, kinds.get(stat.S_IFMT(status.st_mode), "it is not a regular file"))
