# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Links of documents lead somewhere and the README stays short; and the check of this finds what breaks it."""

from __future__ import annotations

import pytest

from devtools import readability

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


def test_a_long_readme_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(readability, "MOST_WORDS", 100)
    assert [problem.split(":")[0] for problem in readability.problems()] == ["README.md"]
