# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's figures on time and memory (section 8) beside those that were measured, as tables in docs/results.md.

Tables stand between two comments, ``<!-- measured: NAME -->`` and ``<!-- end -->``; what is between them comes from the
records of the figures, never from a hand.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from devtools.result_tables import put

Figures = dict[str, float]
#: What a row is about, what the paper says of it, and what was measured, from the figures of a record.
Row = tuple[str, str, Callable[[Figures], str]]

_HEAD = ("", "paper, 1997", "TetFlora")


def _count(key: str) -> Callable[[Figures], str]:
    return lambda f: f"{f[key]:,.0f}"


def _seconds(*keys: str) -> Callable[[Figures], str]:
    return lambda f: f"{sum(f[key] for key in keys):.1f} s"


def _megabytes(key: str) -> Callable[[Figures], str]:
    return lambda f: f"{f[key]:,.1f} MB" if f[key] < 10 else f"{f[key]:,.0f} MB"


def _fraction(part: str, whole: str) -> Callable[[Figures], str]:
    return lambda f: f"{f[part]:,.0f} ({100 * f[part] / f[whole]:.1f} %)"


def _scene(paper: dict[str, str]) -> tuple[Row, ...]:
    """Rows of one of the paper's scenes (section 8.1)."""
    return (
        ("plants", paper["plants"], _count("plants")),
        ("polygons if expanded", paper["full"], _count("polygons_full")),
        ("polygons in the image", paper["polygons"], _fraction("polygons_meshed", "polygons_full")),
        ("facets and spheres of approximations", "–", _count("polygons_proxy")),
        ("tetrahedra made", paper["made"], _count("tetrahedra_made")),
        ("tetrahedra drawn as approximations", paper["drawn"], _count("tetrahedra_proxy")),
        ("model and refine", paper["refine"], _seconds("refine_s")),
        ("render", paper["render"], _seconds("render_s")),
    )


#: Rows of each table, and the records that they are made from; figures of the first go by their own names alone.
TABLES: dict[str, tuple[tuple[str, ...], tuple[Row, ...]]] = {
    "row": (
        ("figure6",),
        _scene(
            {
                "plants": "80",
                "full": "3,790,000",
                "polygons": "784,049 (20.7 %)",
                "made": "15,857",
                "drawn": "2,053",
                "refine": "21 min",
                "render": "6 min",
            }
        ),
    ),
    "landscape": (
        ("figure9",),
        _scene(
            {
                "plants": "8,636",
                "full": "78,200,000",
                "polygons": "9,400,000 (12.0 %)",
                "made": "108,217",
                "drawn": "18,512",
                "refine": "68 min",
                "render": "28 min",
            }
        ),
    ),
    "animation": (
        ("animation",),
        (
            ("first frame: model and refine", "21 min", _seconds("first_refine_s")),
            ("first frame: render", "6 min", _seconds("first_render_s")),
            ("later frames, mean, total", "6.64 min", _seconds("later_refine_s", "later_render_s")),
            ("of which model and refine", "–", lambda f: f"{f['later_refine_s']:.2f} s"),
            ("frames refined again", "all", lambda f: f"{f['refined']:.0f} of {f['frames']:.0f}"),
            (
                "tetrahedra divided that the previous frame did not divide",
                "40 to 70",
                lambda f: (
                    f"{f['divided_anew_min']:.0f} to {f['divided_anew_max']:.0f}, mean {f['divided_anew_mean']:.0f}, "
                    f"of {f['divided']:,.0f}"
                ),
            ),
        ),
    ),
    "memory": (
        ("figure6", "figure9"),
        (
            (
                "polygons of an image of 512 × 512 pixels (figure 9)",
                "on the order of 4 million",
                lambda f: f"{f['figure9.polygons_meshed']:,.0f} and {f['figure9.polygons_proxy']:,.0f} facets",
            ),
            ("polygons and facets, stored (figure 6)", "the greatest demand", _megabytes("polygons_mb")),
            (
                "tetrahedra, plants and branches",
                "an order of magnitude less",
                lambda f: f"{_megabytes('tetrahedra_mb')(f)} (1/{round(f['polygons_mb'] / f['tetrahedra_mb'])})",
            ),
            ("file with polygons, compressed", "–", _megabytes("stored_file_mb")),
            ("file with all polygons deferred (figure 7)", "–", _megabytes("seeds_file_mb")),
            (
                "model, refine and render: stored",
                "27 min",
                lambda f: f"{f['refine_s']:.1f} s + {f['render_s']:.1f} s",
            ),
            (
                "everything in the render: deferred, with light by tetrahedra",
                "about the same",
                _seconds("deferred_render_s"),
            ),
            ("FLIP between the two images, where plants are", "–", lambda f: f"{f['flip']:.3f}"),
        ),
    ),
}


def write_tables(out: Path, page: Path) -> None:
    """Write all tables of which there are records into a page.

    Parameters
    ----------
    out : Path
        Folder of the records.
    page : Path
        Markdown; only what is between the comments of a table changes.

    Raises
    ------
    ValueError
        The page has no place for a table.
    """
    records = {path.stem: json.loads(path.read_text()) for path in sorted(out.glob("*.json"))}
    text = page.read_text(encoding="utf-8")
    every = {f"{name}.{key}": value for name, record in records.items() for key, value in record["figures"].items()}
    for name, (sources, rows) in TABLES.items():
        if all(source in records for source in sources):
            text = put(text, name, table(rows, every | records[sources[0]]["figures"]))
    if records:
        text = put(text, "machine", _machine(records))
    page.write_text(text, encoding="utf-8")


def table(rows: tuple[Row, ...], figures: Figures) -> str:
    """A table of the paper's figures and ours in Markdown."""
    cells = [_HEAD, ("---",) * 3, *((what, paper, ours(figures)) for what, paper, ours in rows)]
    return "\n".join("| " + " | ".join(row) + " |" for row in cells)


def _machine(records: dict[str, dict]) -> str:
    """Where, with what and in how long it was made."""
    last = list(records.values())[-1]
    minutes = sum(record["figures"]["seconds"] for record in records.values()) / 60
    return f"{last['machine']}, Blender {last['blender']}; {len(records)} figures in {minutes:.0f} minutes."
