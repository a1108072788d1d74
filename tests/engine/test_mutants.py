# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m devtools.mutants`` draws changes of results, and none that no test could see."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from devtools import mutants


def found(source: str) -> list[str]:
    """Changes of a file, without where they are."""
    finder = mutants._Finder("a.py", source.encode())
    finder.visit(ast.parse(source))
    return [f"{one.before} -> {one.text}" for one in finder.found]


@pytest.mark.parametrize(
    ("source", "changes"),
    [
        ("a = b + c", ["+ -> -"]),
        ("a = b < 3", ["< -> >=", "3 -> 4"]),
        ("def f(a=True):\n    return not a", ["True -> False", "not  -> "]),
        ("class A:\n    b: float = limited(0.5, 2.0)", ["0.5 -> 0.75", "2.0 -> 3.0"]),
        ("a = 0.0, 1e-6", ["0.0 -> 1.0", "1e-6 -> 1.5e-06"]),
        ("a = 99, 100, 8001", ["99 -> 100", "100 -> 150", "8001 -> 12001"]),
    ],
)
def test_results_are_changed(source: str, changes: list[str]) -> None:
    assert found(source) == changes


@pytest.mark.parametrize(
    "source",
    [
        '"""3 + 4."""',
        "a: Annotated[int, 3]",
        'raise ValueError("5 < 4")',
        'a = f"{b + 1}"',
        "@dataclass(frozen=True)\nclass A:\n    pass",
        "@lru_cache(maxsize=64)\ndef f():\n    pass",
        "a = zip(b, c, strict=True)",
        "_BATCH = 4096",
        "POINT_CHUNK = 1 << 18",
        "a = b[c, 1e-300:1e-9]",
        '__version__ = "1" * 3',
    ],
)
def test_what_no_test_could_see_is_left_alone(source: str) -> None:
    assert found(source) == []


def test_a_change_stands_where_it_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes count, not letters."""
    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    path = tmp_path / "a.py"
    path.write_text('# é\nb = "ü" if c > 2.5 else d\n', encoding="utf-8")
    source = path.read_bytes()
    changed = {source[: one.start] + one.text.encode() + source[one.end :] for one in mutants.possible(path)}
    assert {text.decode() for text in changed} == {
        '# é\nb = "ü" if c <= 2.5 else d\n',
        '# é\nb = "ü" if c > 3.75 else d\n',
    }
