# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of the documentation: JPEGs of at most half a megabyte, single or side by side with a line of text each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

LARGEST = 500_000  # bytes
_LINE, _LETTERS, _TEXT, _PAPER, _GAP = 24, 16, (30, 30, 30), (255, 255, 255), 4


def save_jpeg(picture: Image.Image, path: Path) -> None:
    """Store an image as well as `LARGEST` bytes allow."""
    for quality in (92, 88, 84, 78, 70, 60):
        picture.save(path, quality=quality, subsampling=0 if quality > 85 else 2)
        if path.stat().st_size <= LARGEST:
            return


def save_sheet(cells: Sequence[tuple[Path, str]], columns: int, path: Path, width: int | None = None) -> None:
    """Store images of one size side by side, row by row, as a JPEG.

    Parameters
    ----------
    cells : sequence of (Path, str)
        Images, and what stands above each.
    columns : int
    path : Path
    width : int, optional
        Pixels that each image is made as wide as.
    """
    pictures = [Image.open(source).convert("RGB") for source, _ in cells]
    if width is not None:
        height = round(width * pictures[0].height / pictures[0].width)
        pictures = [picture.resize((width, height), Image.Resampling.LANCZOS) for picture in pictures]
    across, down = pictures[0].width + _GAP, pictures[0].height + _LINE
    sheet = Image.new("RGB", (columns * across - _GAP, math.ceil(len(cells) / columns) * down), _PAPER)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(_LETTERS)
    for number, (picture, (_, text)) in enumerate(zip(pictures, cells, strict=True)):
        row, column = divmod(number, columns)
        draw.text((column * across + 2, row * down + 2), text, fill=_TEXT, font=font)
        sheet.paste(picture, (column * across, row * down + _LINE))
    save_jpeg(sheet, path)
