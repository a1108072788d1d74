# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages between processes: any object of the engine, its arrays as they lie in memory (pickle protocol 5, PEP 574).

Both ends are this very code in the same installation, so pickles are never read from anybody else.
"""

import pickle
import struct
from collections.abc import Sequence
from typing import BinaryIO

#: Bytes up to which arrays go within the pickle.
_SMALL = 4096
_NUMBER = struct.Struct("<Q")


class Closed(EOFError):
    """The other process has ended."""


class Packed:
    """An object as the bytes that are sent, so that they are made once for several receivers."""

    def __init__(self, thing: object) -> None:
        arrays: list[memoryview] = []

        def apart(buffer: pickle.PickleBuffer) -> bool:
            raw = buffer.raw()
            if raw.nbytes <= _SMALL:
                return True  # in the pickle
            arrays.append(raw)
            return False

        data = pickle.dumps(thing, protocol=5, buffer_callback=apart)
        self.parts: Sequence[bytes | memoryview] = (data, *arrays)


def send(stream: BinaryIO, *things: object) -> None:
    """Write objects, or what is packed already, as one message.

    Raises
    ------
    Closed, OSError
        The receiver has ended.
    """
    if stream.closed:
        raise Closed
    packed = [thing if isinstance(thing, Packed) else Packed(thing) for thing in things]
    parts = [part for one in packed for part in one.parts]
    counts = [len(packed), *(len(one.parts) for one in packed), *(memoryview(part).nbytes for part in parts)]
    stream.write(b"".join(_NUMBER.pack(n) for n in counts))
    for part in parts:
        stream.write(part)
    stream.flush()


def receive(stream: BinaryIO) -> list[object]:
    """Objects of the next message; their arrays can be written to.

    Raises
    ------
    Closed
        The sender has ended.
    """
    if stream.closed:
        raise Closed
    (number,) = _numbers(stream, 1)
    counts = _numbers(stream, number)
    parts = iter([_read(stream, size) for size in _numbers(stream, sum(counts))])
    objects = []
    for count in counts:
        data, *arrays = (next(parts) for _ in range(count))
        objects.append(pickle.loads(data, buffers=arrays))
    return objects


def _numbers(stream: BinaryIO, count: int) -> list[int]:
    return [n for (n,) in _NUMBER.iter_unpack(_read(stream, count * _NUMBER.size))]


def _read(stream: BinaryIO, size: int) -> bytearray:
    data = bytearray(size)
    view, done = memoryview(data), 0
    while done < size:
        got = stream.readinto(view[done:])
        if not got:
            raise Closed
        done += got
    return data
