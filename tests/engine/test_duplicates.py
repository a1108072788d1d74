# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m devtools.duplicates`` finds near-copies, and nothing else."""

from __future__ import annotations

import pytest

from devtools import duplicates

LINES = [f"    value{i} = made(first[{i}], second.part{i} + {i})" for i in range(11)]
ONE = "def one(first, second):\n" + "\n".join(LINES) + "\n    return value0\n"


@pytest.mark.parametrize(
    "other",
    [
        ONE.replace("one", "two").replace("[3]", "[99]"),
        "import math\n\n" + ONE.replace("    value4", '    """A text."""\n    # A remark.\n\n    value4'),
        ONE.replace(LINES[5], "    assert value4"),
        ONE.replace("value7", "last"),
    ],
    ids=("numbers and name", "remarks", "one line", "one name"),
)
def test_near_copies_are_found(other: str) -> None:
    (copy,) = duplicates.copies({"a.py": ONE, "b.py": other})
    assert (copy.one, copy.other) == ("a.py", "b.py")
    assert copy.lines >= 10 and copy.same >= duplicates.SAME
    assert copy.one_lines[0] == 1


def test_a_copy_in_the_same_file_is_one() -> None:
    (copy,) = duplicates.copies({"a.py": ONE + "\n\n" + ONE.replace("one", "two")})
    assert copy.one_lines == (1, 13) and copy.other_lines == (16, 28)


@pytest.mark.parametrize(
    "other",
    [
        "\n".join(ONE.splitlines()[:8]) + "\n",
        ONE.replace("+ ", "+ 7.5 * "),
        "".join(f"import numpy{i}\n" for i in range(20)),
        "class A:\n" + "".join(f"    field{i}: int = {i}\n" for i in range(20)),
        ONE.replace("value", "other").replace("made", "grown").replace("first", "one").replace("part", "own"),
    ],
    ids=("short", "other shape", "imports", "fields", "other names"),
)
def test_what_is_alike_by_chance_is_none(other: str) -> None:
    assert duplicates.copies({"a.py": ONE, "b.py": other, "c.py": other if "def" not in other else ""}) == []
