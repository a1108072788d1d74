# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m devtools.proofs`` tells tests that can fail from those that cannot."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from devtools import proofs


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A commit with a fault, one that mends it, and one that only adds a test."""
    root = tmp_path / "a house"
    folder = root / "tests" / "engine"
    folder.mkdir(parents=True)
    for key in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE"):
        monkeypatch.delenv(key, raising=False)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # tests of these commits use none
    for role in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{role}_NAME", "nobody")
        monkeypatch.setenv(f"GIT_{role}_EMAIL", "nobody@example.org")

    def commit(subject: str, **files: str) -> None:
        for name, text in files.items():
            (root / f"{name}.py" if name == "code_" else folder / f"{name}.py").write_text(text, encoding="utf-8")
        for command in (("add", "-A"), ("commit", "-qm", subject)):
            subprocess.run(("git", *command), cwd=root, check=True, capture_output=True)

    subprocess.run(("git", "init", "-q"), cwd=root, check=True)
    (root / "conftest.py").write_text("", encoding="utf-8")  # pytest finds code_.py beside it
    old = "import code_\ndef test_a():\n    assert code_.one\n"
    commit("fault", code_="one = 1\n", test_a=old)
    new = (
        "import pytest\n"
        "class TestTwo:\n"
        "    @pytest.mark.parametrize('n', [0, 2])\n"
        "    def test_b(self, n):\n"
        "        assert n in (0, getattr(code_, 'two', 1))\n"
        "def test_c():\n"
        "    assert code_.one == 1\n"
    )
    imports = "from code_ import two\ndef test_d():\n    assert two\n"
    commit("mend", code_="one = 1\ntwo = 2\n", test_a=old + new, test_d=imports)
    commit("more tests", test_e="def test_e():\n    pass\n")
    return root


def test_tests_run_on_the_code_before_theirs(repository: Path) -> None:
    """New tests alone, of commits with code; a parameter that fails is enough; the worktree is gone afterward."""
    found = {name: outcome for _, name, outcome in proofs.proofs(repository, proofs.since(repository, "HEAD~2"))}
    assert found == {
        "tests/engine/test_a.py::TestTwo::test_b": "fails (assert 2 in (0, 1))",
        "tests/engine/test_a.py::test_c": "passes",
        "tests/engine/test_d.py::test_d": "fails (cannot be imported)",
    }
    listed = subprocess.run(("git", "worktree", "list"), cwd=repository, check=True, capture_output=True, text=True)
    assert len(listed.stdout.splitlines()) == 1


def test_a_changed_test_is_one(repository: Path) -> None:
    """By its statements, not by how they are written, where they stand and what a docstring says of them."""
    path = repository / "tests" / "engine" / "test_a.py"
    text = path.read_text(encoding="utf-8").replace("code_.one == 1", "code_.one == 3").replace("'n', [", "'n',  [")
    text = text.replace("def test_a():\n", 'def test_a():\n    """All."""\n')
    path.write_text("# Moved.\n" + text, encoding="utf-8")
    subprocess.run(("git", "commit", "-qam", "changed"), cwd=repository, check=True)
    assert proofs.changed_tests(repository, "HEAD") == ["tests/engine/test_a.py::test_c"]


def test_pictures_are_no_code(repository: Path) -> None:
    """A test that comes with a picture alone has nothing to fail on."""
    (repository / "reference.exr").write_bytes(b"picture")
    (repository / "tests" / "engine" / "test_f.py").write_text("def test_f():\n    pass\n", encoding="utf-8")
    for command in (("add", "-A"), ("commit", "-qm", "picture")):
        subprocess.run(("git", *command), cwd=repository, check=True, capture_output=True)
    assert list(proofs.proofs(repository, proofs.since(repository, "HEAD~1"))) == []


def test_commits_are_named_one_by_one_or_in_a_file(repository: Path, tmp_path: Path) -> None:
    """And each is run on its own parent, whatever stood in the worktree before."""
    listed = tmp_path / "commits"
    listed.write_text("# Mends.\nHEAD~1 mend\n\n", encoding="utf-8")
    commits = proofs.named(repository, ["HEAD", f"@{listed}"])
    assert [len(commit) for commit in commits] == [40, 40]
    assert [name for _, name, _ in proofs.proofs(repository, commits)] == [
        "tests/engine/test_a.py::TestTwo::test_b",
        "tests/engine/test_a.py::test_c",
        "tests/engine/test_d.py::test_d",
    ]


def test_each_commit_finds_its_parent_alone(repository: Path) -> None:
    """Nothing of what the one before has left: neither its code nor its tests."""
    (repository / "code_.py").write_text("one = 1\n", encoding="utf-8")
    test = repository / "tests" / "engine" / "test_g.py"
    test.write_text("import code_\ndef test_g():\n    assert not hasattr(code_, 'two')\n", encoding="utf-8")
    for command in (("add", "-A"), ("commit", "-qm", "back")):
        subprocess.run(("git", *command), cwd=repository, check=True, capture_output=True)
    found = [
        outcome.split()[0] for _, _, outcome in proofs.proofs(repository, proofs.named(repository, ["HEAD~2", "HEAD"]))
    ]
    assert found == ["fails", "passes", "fails", "fails"]


def test_without_a_tag_it_is_the_last_commit(repository: Path) -> None:
    assert proofs.last_tag(repository) == "HEAD~1"
    subprocess.run(("git", "tag", "1.0"), cwd=repository, check=True)
    assert proofs.last_tag(repository) == "1.0"


def test_a_guard_is_told_with_its_reason_and_must_pass() -> None:
    assert proofs.judged("fails", "") == (True, "fails")
    assert proofs.judged("passes", "") == (False, "passes")
    assert proofs.judged("passes", "a name") == (True, "guards (a name)")
    assert not proofs.judged("fails", "a name")[0]
