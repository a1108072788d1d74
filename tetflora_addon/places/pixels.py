# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of TIFF files: strips and tiles, compressed without loss, with predictors.

Blender's own reader makes flat ground or noise of what it cannot decode; here damage is an error. Compressions are
those of TIFF 6.0, Adobe's supplements, and libtiff (LZMA, Zstandard).
"""

from __future__ import annotations

import lzma
import zlib
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..jobs import Progress

#: Compressions that cannot be read, by name.
OTHERS = {
    2: "CCITT", 3: "CCITT fax", 4: "CCITT fax", 6: "JPEG", 7: "JPEG", 33003: "JPEG 2000", 33005: "JPEG 2000",
    34712: "JPEG 2000", 34887: "LERC", 50000: "Zstandard", 50001: "WebP", 50002: "JPEG XL", 52546: "JPEG XL",
}  # fmt: skip
_CLEAR, _END, _ZSTANDARD = 256, 257, 50000
_PROGRESS = 64  # pieces between two signs of life


@dataclass(frozen=True)
class Layout:
    """How pixels lie in a file.

    Attributes
    ----------
    width, height : int
        Of the image.
    across, down : int
        Size of a piece: a tile, or a strip of all columns.
    tiled : bool
        Tiles at the border are whole, strips end with the image.
    bits, samples : int
        Of a value, and values of a pixel in a piece.
    dtype : numpy.dtype
        Of values, in the file's order of bytes.
    compression, predictor : int
    reversed : bool
        Bits of a byte begin with the lowest.
    """

    width: int
    height: int
    across: int
    down: int
    tiled: bool
    bits: int
    samples: int
    dtype: np.dtype[Any]
    compression: int
    predictor: int
    reversed: bool = False


def read_pixels(
    file: Any, layout: Layout, offsets: Sequence[int], sizes: Sequence[int], name: str
) -> Generator[Progress, object, tuple[NDArray[Any], NDArray[np.bool_]]]:
    """Values (h, w) of the first sample, and which pixels are not in the file, (h, w); yields progress.

    Raises
    ------
    SceneError
        A piece is damaged, or compressed in a way that cannot be read; ``name`` is the file's.
    """
    own = layout
    if own.compression not in _READERS:
        how = OTHERS.get(own.compression, f"a way without a name ({own.compression})")
        raise SceneError(
            f"{name}: tag Compression (259): it is compressed with {how}, which TetFlora does not read; write it anew, "
            "for example with gdal_translate -co COMPRESS=DEFLATE"
        )
    columns, rows = -(-own.width // own.across), -(-own.height // own.down)
    kind = "tile" if own.tiled else "strip"
    if (
        len(offsets) < columns * rows
        or own.predictor not in (1, 2, 3)
        or (own.predictor == 3 and own.dtype.kind != "f")
    ):
        raise SceneError(
            f"{name}: {len(offsets):,} of {columns * rows:,} {kind}s, or an unknown predictor; damaged: get it again"
        )
    values = np.zeros((own.height, own.width), np.uint8 if own.bits == 1 else own.dtype.newbyteorder("="))
    absent = np.zeros((own.height, own.width), bool)
    for number in range(columns * rows):
        if number % _PROGRESS == 0:
            yield Progress(0.9 * number / (columns * rows), f"Reading {name}")
        top, left = number // columns * own.down, number % columns * own.across
        place = np.s_[top : min(top + own.down, own.height), left : min(left + own.across, own.width)]
        if not sizes[number]:
            absent[place] = True
            continue
        high = own.down if own.tiled else values[place].shape[0]
        row = (own.across * own.samples * own.bits + 7) // 8
        file.seek(offsets[number])
        try:
            data = file.read(sizes[number])
            data = _READERS[own.compression](data.translate(_TURNED) if own.reversed else data, high * row)
        except (zlib.error, lzma.LZMAError, EOFError, ValueError, IndexError) as error:
            raise SceneError(
                f"{name}: {kind} {number + 1:,} of {columns * rows:,} is damaged: {error}; get it again"
            ) from None
        if len(data) < high * row:
            raise SceneError(f"{name}: {kind} {number + 1:,} of {columns * rows:,} ends too early; get it again")
        piece = _values(np.frombuffer(data, np.uint8, high * row).reshape(high, row), own)
        values[place] = piece[: values[place].shape[0], : values[place].shape[1]]
    return values, absent


def _values(rows: NDArray[np.uint8], own: Layout) -> NDArray[Any]:
    """First sample of the pixels of a piece, from the bytes (h, n) of its rows."""
    if own.bits == 1:
        return np.unpackbits(rows, axis=1)[:, :: own.samples]
    size, number = own.dtype.itemsize, own.across * own.samples
    if own.predictor == 3:  # bytes apart by their weight, the highest first, each as the difference from the one before
        rows = _running(rows.reshape(len(rows), -1, own.samples)).reshape(len(rows), size, number)
        return np.ascontiguousarray(rows.transpose(0, 2, 1)).view(own.dtype.newbyteorder(">"))[:, :: own.samples, 0]
    found = rows.view(own.dtype)
    if own.predictor == 2:
        whole = found.view(np.dtype(f"{own.dtype.byteorder}u{size}") if size > 1 else np.uint8)
        whole = whole.astype(whole.dtype.newbyteorder("="))
        found = _running(whole.reshape(len(rows), -1, own.samples)).reshape(len(rows), number)
        found = found.view(own.dtype.newbyteorder("="))
    return found[:, :: own.samples]


def _running(values: NDArray[Any]) -> NDArray[Any]:
    """Sums along rows that begin anew after the largest number."""
    return np.cumsum(values, axis=1, dtype=values.dtype)


#: Bytes by those with the lowest bit first.
_TURNED = bytes(int(f"{n:08b}"[::-1], 2) for n in range(256))


#: Widths of codes, and how many of each there are until the table is full: it grows one code early.
_WIDTHS = ((9, 254), (10, 512), (11, 1024), (12, 2310))


def _lzw(data: bytes, most: int) -> bytes:
    """Lempel, Ziv and Welch: codes of 9 to 12 bits, the highest bit first.

    What a code stands for is a part of what came before, from where the one that made it began: so lengths follow from
    codes by jumping along chains, and then bytes, each round twice as far.
    """
    bits = np.unpackbits(np.frombuffer(data, np.uint8))
    out, at, size, ended = [], 0, 0, False
    while size < most and not ended:
        found: list[NDArray[np.int64]] = []
        for width, number in _WIDTHS:
            whole = min(number, (len(bits) - at) // width)
            codes = bits[at : at + whole * width].reshape(whole, width) @ _PLACES[12 - width :]
            marks = np.flatnonzero((codes == _CLEAR) | (codes == _END))
            stop = int(marks[0]) if len(marks) else whole
            found.append(codes[:stop])
            at += (stop + 1) * width
            if len(marks) or whole < number:
                ended = not len(marks) or codes[stop] == _END
                break
            at -= width
        else:
            raise ValueError("its table of codes overflows")
        part, broken = _strings(np.concatenate(found))
        out.append(part)
        size, ended = size + len(part), ended or broken
    return b"".join(out)[:most]


_PLACES = 1 << np.arange(11, -1, -1, dtype=np.int64)


def _strings(codes: NDArray[np.int64]) -> tuple[bytes, bool]:
    """Bytes that codes (n,) after a cleared table stand for, up to one that cannot be, and whether there is such."""
    index = np.arange(len(codes))
    bad = np.flatnonzero(codes - _END > index)
    codes, index = (codes[: bad[0]], index[: bad[0]]) if len(bad) else (codes, index)
    if not len(codes):
        return b"", bool(len(bad))
    literal = codes < _CLEAR
    maker = np.where(literal, index, codes - _END - 1)
    steps, root = (~literal).astype(np.int64), maker
    while (root[root] != root).any():
        steps, root = steps + steps[root], root[root]
    length = steps + 1
    start = np.cumsum(length) - length
    code = np.repeat(index, length)
    offset = np.arange(len(code)) - start[code]
    source = start[maker[code]] + offset
    while (source[source] != source).any():
        source = source[source]
    return codes[code[source]].astype(np.uint8).tobytes(), bool(len(bad))


def _packed(data: bytes, most: int) -> bytes:
    """PackBits: pieces to take as they are, and bytes to repeat."""
    out, at, size = [], 0, 0
    while size < most and at < len(data):
        head = data[at]
        part = data[at + 1 : at + 2 + head] if head < 128 else data[at + 1 : at + 2] * (257 - head) * (head != 128)
        at += 2 + head if head < 128 else 1 if head == 128 else 2
        out.append(part)
        size += len(part)
    return b"".join(out)[:most]


def _inflated(data: bytes, most: int) -> bytes:
    """Deflate."""
    return zlib.decompressobj().decompress(data, most + 1)  # one more, so that the sum at the end is checked


_READERS: dict[int, Callable[[bytes, int], bytes]] = {
    1: lambda data, _most: data,
    5: _lzw,
    8: _inflated,
    32946: _inflated,
    32773: _packed,
    34925: lambda data, most: lzma.LZMADecompressor().decompress(data, most + 1),
}


def use_zstandard(module: Any) -> None:
    """Read what is compressed with Zstandard by the module of that name, which Blender has and Python lacks."""

    def read(data: bytes, most: int) -> bytes:
        try:
            return module.ZstdDecompressor().stream_reader(data).read(most + 1)
        except module.ZstdError as error:
            raise ValueError(str(error)) from None

    _READERS[_ZSTANDARD] = read
