# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are written whole or not at all: a full disk or a killed process leaves what was there before."""

from __future__ import annotations

import os
import uuid
from contextlib import suppress
from pathlib import Path

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
