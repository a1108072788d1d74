# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Links of documents lead somewhere, pages stay short and sentences plain; and the check finds what breaks this."""

from __future__ import annotations

from pathlib import Path

import pytest

from devtools import prose, readability, result_tables

PAGE = """# A `b_c` *d*, e/f

## Twice
## Twice

```
# in code
[in code](missing.md)
```

<a id="by-hand"></a>
"""
NAMES = ("page.md", "docs/other.md", "docs/images/a b.png")


def test_documents_keep_to_it() -> None:
    assert readability.problems() == []


def test_headings_are_found_as_links_name_them() -> None:
    assert readability.anchors(PAGE) == {"a-b_c-d-ef", "twice", "twice-1", "by-hand"}
    assert readability.anchors("## The [year](a.md) of `x`") == {"the-year-of-x"}


@pytest.mark.parametrize(
    "link",
    [
        "[a](../page.md)",
        "[a](../page.md#twice-1)",
        "[a](#here)",
        "[a](.)",
        "[![a](images/a%20b.png)](images)",
        "[a](<../page.md>)",
        "[a](https://example.org/missing.md#x)",
        "`[a](missing.md)`",
        "<!-- [a](missing.md) -->",
    ],
)
def test_links_that_lead_somewhere(link: str) -> None:
    pages = {"page.md": PAGE, "docs/other.md": f"# Here\n\n{link}\n"}
    assert readability.broken_links(pages, NAMES) == []


@pytest.mark.parametrize(
    "link",
    [
        "[a](missing.md)",
        "[a\nb](missing.md)",
        "[a](page.md)",  # as if it lay beside this one
        "[a](../Page.md)",
        "![a](images/b.png)",
        "[![a](images/b.png)](images)",
        "[a](#nowhere)",
        "[a](../page.md#in-code)",
        "[a](../page.md#twice-2)",
        "[a]: missing.md",
        '<img src="images/b.png">',
    ],
)
def test_links_that_lead_nowhere(link: str) -> None:
    pages = {"page.md": PAGE, "docs/other.md": f"# Here\n\n```\ncode\n```\n{link}\n"}
    found = readability.broken_links(pages, NAMES)
    assert len(found) == 1
    assert found[0].startswith(("docs/other.md:6: ", "docs/other.md:7: "))


def test_words_are_those_that_are_read() -> None:
    assert readability.words("<!-- not this -->\n# One `two`\n\n- [three *four*](not/this.md) – 5 | 6\n") == 6


def test_long_pages_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(readability, "MOST_WORDS", {"README.md": 100, "docs/manual": 100, "docs/results.md": 10_000})
    assert [problem.split(":")[0] for problem in readability.problems()] == ["README.md", "docs/manual"]


def test_tutorials_do_not_count() -> None:
    pages = {"docs/manual.md": "one two", "docs/manual/tutorials.md": "three", "docs/manual/a.md": "four"}
    assert readability.length(pages, "docs/manual") == 3


@pytest.mark.parametrize(
    "text",
    [
        "What is near becomes leaves.",
        "Here there is a tree.",
        "This is no mesh.",
        "It takes .63 seconds.",
        "Ten pixels a crown are enough.",
        "The name stands beside the field.",
        "The goal is ten.",
        "This no longer works.",
        "Place it where it stands.",
        "word " * 37 + ".",
        "One two three. " * 31,
        "| " + "word " * 28 + "|",
        "- an item\n  that goes on",
    ],
)
def test_poor_sentences_are_found(text: str) -> None:
    found = prose.problems("docs/manual/page.md", f"# Page\n\n{text}\n")
    assert len(found) == 1
    assert found[0].startswith("docs/manual/page.md:3: ")
    assert prose.problems("docs/architecture.md", text) == []  # a page for developers


@pytest.mark.parametrize(
    "text",
    [
        "What do you need?",
        "`what is .63 beside`",
        "The message *… what is this* says so.",
        "A budget of 0.63 pixels per crown; see [here](what/.5.md).",
        "It stands. It grows.",
        "```\nthere is .5\n```",
        "<!-- what -->",
    ],
)
def test_good_sentences_and_code_pass(text: str) -> None:
    assert prose.problems("README.md", f"# Page\n\n{text}\n") == []


def test_tables_of_results_are_those_of_the_records(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    page = tmp_path / "results.md"
    page.write_text(result_tables.PAGE.read_text("utf-8").replace("40, 25, 24", "40, 25, 23"), "utf-8")
    monkeypatch.setattr(result_tables, "PAGE", page)
    assert [line.split(";")[0] for line in result_tables.problems()] == [
        "docs/results.md: tables are not those of docs/results"
    ]
    with pytest.raises(ValueError, match="measured: nothing"):
        result_tables.put("page", "nothing", "")
