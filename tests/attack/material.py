# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an attacker would hand over: names, paths, JSON texts and cache entries, each from a generator with a seed."""

from __future__ import annotations

import io
import json
import random
import struct
import zipfile
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np

#: Names that must not become part of a path, and some that a system reserves or takes for another.
IDENTIFIERS = (
    *("", ".", "..", "...", "../secret", "..\\secret", "a/b", "a\\b", "/etc/passwd", "C:secret", "C:\\secret", "~"),
    *("\\\\server\\share", "//server/share", "a\0b", "a\nb", "oak\n", "a b", " oak", "oak ", "oak.", "oak.json", "a.b"),
    *(
        "con",
        "CON",
        "nul",
        "Aux",
        "prn",
        "com1",
        "LPT9",
        "com0",
        "a" * 65,
        "é",
        "ﬁr",
        "oak\u202exe",
        "\ud800",
        "\udcff",
    ),
    *("oak:stream", "oak%00", "*", "?", "a|b", "<oak>", '"', "$HOME", "`id`", "ö" * 64, "\x1b[2J", "２", "ª"),
)
_PARTS = (
    "..",
    ".",
    "/",
    "\\",
    "\0",
    "secret",
    "oak",
    "a",
    "_",
    "-",
    ":",
    "C:",
    "\n",
    " ",
    "\ud800",
    "é",
    "con",
    "x" * 40,
)
_JSON = ("{", "}", "[", "]", ",", '"a"', '"a": 1', '"\\ud800"', '"\\u0000"', "1", "-1", "1e999", "NaN", "1" * 400,
         "true", "null", " ", "\n", "\x00", '"', "\\", '"orders"', '{"a": 1, "a": 2}', "\ufeff")  # fmt: skip
#: Values that no key of any file takes, or only some.
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 0.5, 1e9, -1e9, 2**31, 2**63, 10**30, 10**400, 1e308, 5e-324, -0.0),
    *(
        float("nan"),
        float("inf"),
        float("-inf"),
        "",
        "a",
        "a" * 2000,
        "\0",
        "\x1b[31m",
        "\u202e",
        "../secret",
        "\ud800",
    ),
    *([], {}, [[]], [None], {"a": 1}, [1, 2, 3], ["a"], [[0, 1]], [[[[1]]]]),
)


def identifier(rng: random.Random, folder: Path) -> str:
    """A name of a species, or a path in its place; some lead to a folder that exists."""
    way = rng.randrange(4)
    if way == 0:
        return rng.choice(IDENTIFIERS)
    if way == 1:
        return f"{folder}/{rng.choice(['secret', '../secret', 'a/../secret'])}"
    if way == 2:
        return "".join(rng.choice("abcXYZ019_-") for _ in range(rng.randint(1, 70)))
    return "".join(rng.choice(_PARTS) for _ in range(rng.randint(1, 6)))


def json_text(rng: random.Random) -> bytes | str:
    """A text that may be JSON, as bytes of a file or as a text of a .blend."""
    if rng.random() < 0.4:
        text = json.dumps(json_value(rng, 4))
    else:
        text = "".join(rng.choice(_JSON) for _ in range(rng.randint(0, 12)))
    if rng.random() < 0.3:
        text = text[: rng.randint(0, len(text))]
    if rng.random() < 0.5:
        return text
    content = bytearray(text.encode(errors="surrogatepass"))
    if content and rng.random() < 0.3:
        content[rng.randrange(len(content))] = rng.randrange(256)
    return bytes(content)


def json_value(rng: random.Random, depth: int) -> Any:
    """A value of lists, objects, and what is in `VALUES`."""
    if depth and rng.random() < 0.6:
        inner = [json_value(rng, depth - 1) for _ in range(rng.randint(0, 4))]
        return inner if rng.random() < 0.5 else {rng.choice(["a", "b", "name", "\x1b", "x" * 300]): v for v in inner}
    return deepcopy(rng.choice(VALUES))


def mutated(rng: random.Random, data: Any, most: int = 3) -> Any:
    """A decoded file with up to so many values replaced or taken away; the data itself stays as it is."""
    data = json.loads(json.dumps(data))
    for _ in range(rng.randint(1, most)):
        places = _places(data)[1:]
        if not places:
            break
        *parents, last = rng.choice(places)
        inner = data
        for step in parents:
            inner = inner[step]
        if rng.random() < 0.2:
            inner.pop(last)
        else:
            inner[last] = deepcopy(rng.choice(VALUES))  # or a later change would be one of the values, and hold itself
    return data


def _places(data: Any, path: tuple = ()) -> list[tuple]:
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [path, *(p for k, v in items for p in _places(v, (*path, k)))]


def cache_entry(rng: random.Random, name: str, values: np.ndarray) -> bytes:
    """A file of the cache that is damaged, packed, or says to be what it is not; seldom a sound one."""
    way = rng.randrange(7)
    if way == 0:
        return rng.randbytes(rng.randint(0, 3000))
    if way == 1:  # packed: a few kilobytes become many megabytes
        return _archive({"values": np.zeros(rng.randint(1, 4) * 1_000_000), "name": np.array(name)}, packed=True)
    if way == 2:  # a header of more numbers than there are
        shape = tuple(10 ** rng.randint(0, 6) for _ in range(rng.randint(1, 5)))
        return _archive({"values": _header(shape, rng.choice(["<f8", "|S1000000000", "<U100000000", "|O"]))})
    if way == 3:
        other = rng.choice([values.astype(np.float32), values * np.nan, values[:1], np.array("text")])
        return _archive({"values": other, "name": np.array(name)})
    if way == 4:
        return _archive({"values": values, "name": np.array(rng.choice([name + "x", "", "../" + name]))})
    content = bytearray(_archive({"values": values, "name": np.array(name)}))
    if way == 5:
        for _ in range(rng.randint(1, 20)):
            content[rng.randrange(len(content))] = rng.randrange(256)
        return bytes(content[: rng.randint(0, len(content))] if rng.random() < 0.5 else content)
    return bytes(content)


def _archive(parts: dict[str, np.ndarray | bytes], packed: bool = False) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED) as archive:
        for name, part in parts.items():
            content = io.BytesIO(part if isinstance(part, bytes) else b"")
            if not isinstance(part, bytes):
                np.lib.format.write_array(content, part)
            archive.writestr(f"{name}.npy", content.getvalue())
    return made.getvalue()


def _header(shape: Sequence[int], kind: str) -> bytes:
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {tuple(shape)}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode() + bytes(64)
