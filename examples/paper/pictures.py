# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of the documentation: JPEGs of at most half a megabyte, single or side by side with a line of text each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

LARGEST = 500_000  # bytes
_LINE, _LETTERS, _TEXT, _PAPER, _GAP = 24, 16, (30, 30, 30), (255, 255, 255), 4


def save_jpeg(picture: Image.Image, path: Path, largest: int = LARGEST) -> None:
    """Store an image as well as so many bytes allow."""
    for quality in (92, 88, 84, 78, 70, 60, 50, 40):
        picture.save(path, quality=quality, subsampling=0 if quality > 85 else 2, optimize=True)
        if path.stat().st_size <= largest:
            return


def save_sheet(
    cells: Sequence[tuple[Path | Image.Image | None, str]], columns: int, path: Path, width: int | None = None
) -> None:
    """Store images of one width side by side, row by row, as a JPEG.

    Parameters
    ----------
    cells : sequence of (Path or Image or None, str)
        Images, those of a row of one height, and what stands above each; None leaves a place empty.
    columns : int
    path : Path
    width : int, optional
        Pixels that each image is made as wide as.
    """
    shown = [(_opened(source, width), text) for source, text in cells]
    rows = [shown[first : first + columns] for first in range(0, len(cells), columns)]
    across = _GAP + max(picture.width for row in rows for picture, _ in row if picture)
    down = [_LINE + max(picture.height for picture, _ in row if picture) for row in rows]
    sheet = Image.new("RGB", (columns * across - _GAP, sum(down)), _PAPER)
    draw, font, top = ImageDraw.Draw(sheet), ImageFont.load_default(_LETTERS), 0
    for row, height in zip(rows, down, strict=True):
        for column, (picture, text) in enumerate(row):
            if picture:
                draw.text((column * across + 2, top + 2), text, fill=_TEXT, font=font)
                sheet.paste(picture, (column * across, top + _LINE))
        top += height
    save_jpeg(sheet, path)


def _opened(source: Path | Image.Image | None, width: int | None) -> Image.Image | None:
    picture = Image.open(source).convert("RGB") if isinstance(source, Path) else source
    if picture is None or width is None:
        return picture
    return picture.resize((width, round(width * picture.height / picture.width)), Image.Resampling.LANCZOS)
