# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether tests can fail: each that a commit adds or changes, run on the commit before.

    python -m devtools.proofs              commits since the last tag; without a tag, the last one
    python -m devtools.proofs BASE         commits since BASE
    python -m devtools.proofs --commits A B @FILE      these alone, and those that begin the lines of FILE

A test that comes with a mend has to fail without it. The commit's ``tests`` are laid over the code of its parent, in
a worktree of its own, and each test gets a line: ``fails``, as it should, with what it says, or ``passes``. Commits
that leave the product alone, but for pictures, are left out: of these the tests pass before, too. Tests of a full
Blender run where ``BLENDER`` is set.

Some tests that pass are right to: they guard what was never wrong, or follow another name. ``proofs.json`` says of each
what shows that there was no fault; it gets a line with that, ``guards``. One that fails there is told, too: its reason
is wrong.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
FULL = ("tests/full/", "tests/window/")
#: Commits, and of each the tests without a fault before it: what shows that.
GUARDS = Path(__file__).with_suffix(".json")
#: Letters of what a failure says.
SHOWN = 100
NOT_CODE = (":!tests", ":!docs", ":!*.md", ":!*.png", ":!*.exr", ":!.ci", ":!Makefile", ":!pyproject.toml")


def _git(root: Path, *arguments: str) -> str:
    return subprocess.run(("git", *arguments), cwd=root, check=True, capture_output=True, text=True).stdout


def last_tag(root: Path) -> str:
    """The last tag, or the commit before the last one."""
    found = subprocess.run(("git", "describe", "--tags", "--abbrev=0"), cwd=root, capture_output=True, text=True)
    return found.stdout.strip() or "HEAD~1"


def functions(source: str) -> dict[str, str]:
    """Tests in the source of a file: their text by name (``test_a``, ``TestB::test_c``), decorators included.

    Without docstrings: these say nothing that could fail.
    """

    def found(nodes: list[ast.stmt], prefix: str) -> Iterator[tuple[str, str]]:
        for node in nodes:
            if isinstance(node, ast.ClassDef):
                yield from found(node.body, f"{prefix}{node.name}::")
            elif isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                if ast.get_docstring(node) is not None:
                    node.body = node.body[1:] or [ast.Pass()]
                yield prefix + node.name, ast.unparse(node)

    return dict(found(ast.parse(source).body, ""))


def changed_tests(root: Path, commit: str) -> list[str]:
    """Tests that a commit adds or changes, as pytest names them: ``tests/engine/test_a.py::test_b``."""
    files = _git(root, "diff-tree", "-r", "--diff-filter=AM", "--name-only", f"{commit}^", commit, "--", "tests")
    names = []
    for path in (path for path in files.splitlines() if Path(path).match("test_*.py")):
        was_there = _git(root, "ls-tree", "--name-only", f"{commit}^", path)
        before = functions(_git(root, "show", f"{commit}^:{path}")) if was_there else {}
        after = functions(_git(root, "show", f"{commit}:{path}"))
        names += [f"{path}::{name}" for name, text in after.items() if before.get(name) != text]
    return names


def _run(tree: Path, path: str, names: list[str]) -> dict[str, str]:
    """Outcomes of tests of one file, by name. One of several parameters that fails is enough, and says why."""
    report = tree / "report.xml"
    report.unlink(missing_ok=True)
    command = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--junitxml={report}", *names)
    subprocess.run(command, cwd=tree, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    module = path.removesuffix(".py").replace("/", ".")
    seen: defaultdict[str, set[str]] = defaultdict(set)
    why: dict[str, str] = {}
    for case in ElementTree.parse(report).iter("testcase") if report.is_file() else ():
        within = case.get("classname", "").removeprefix(module).strip(".").split(".")
        name = "::".join((path, *filter(None, within), case.get("name", "").split("[")[0]))
        seen[name] |= {child.tag for child in case} & {"failure", "error", "skipped"} or {"passed"}
        for child in case:
            if child.tag in {"failure", "error"} and child.get("message"):
                why.setdefault(name, f"fails ({child.get('message', '').splitlines()[0][:SHOWN]})")
    if not seen.keys() & set(names):  # The parent lacks what the file, or a conftest, imports.
        return dict.fromkeys(names, "fails (cannot be imported)")
    worst = (("failure", "fails"), ("error", "fails"), ("passed", "passes"), ("skipped", "skipped"))
    found = {name: next((word for mark, word in worst if mark in seen[name]), "not run") for name in names}
    return {name: why.get(name, word) if word == "fails" else word for name, word in found.items()}


@contextmanager
def _worktree(root: Path) -> Iterator[Path]:
    """One for all commits: what Python compiles of files that stay the same is compiled once."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder, "parent")
        _git(root, "worktree", "add", "--detach", str(tree), "HEAD")
        try:
            yield tree
        finally:
            _git(root, "worktree", "remove", "--force", str(tree))


def of_commit(root: Path, commit: str, tree: Path) -> Iterator[tuple[str, str]]:
    """For each test of a commit: its name, and how it ends on the commit's parent.

    Parameters
    ----------
    root : Path
        The repository.
    commit : str
        The commit, by anything that git takes.
    tree : Path
        A worktree of the repository, whose files are replaced.
    """
    code = _git(root, "diff-tree", "-r", "--name-only", f"{commit}^", commit, "--", ".", *NOT_CODE)
    names = changed_tests(root, commit) if code else []
    full = [] if "BLENDER" in os.environ else [name for name in names if name.startswith(FULL)]
    by_file = defaultdict(list)
    for name in names:
        if name not in full:
            by_file[name.split("::")[0]].append(name)
    yield from ((name, "not run: set BLENDER") for name in full)
    if by_file:
        _git(tree, "checkout", "--force", "--detach", f"{commit}^")
        _git(tree, "clean", "-fdq")
        _git(tree, "checkout", commit, "--", "tests")
    for path, some in by_file.items():
        yield from _run(tree, path, some).items()


def since(root: Path, base: str) -> list[str]:
    """Commits since ``base`` that touch the tests, oldest first; no merges."""
    return _git(root, "rev-list", "--no-merges", "--reverse", f"{base}..HEAD", "--", "tests").split()


def proofs(root: Path, commits: Iterable[str]) -> Iterator[tuple[str, str, str]]:
    """For each test of each commit: commit, test, and how it ends on the commit's parent."""
    with _worktree(root) as tree:
        for commit in commits:
            yield from ((commit, name, outcome) for name, outcome in of_commit(root, commit, tree))


def named(root: Path, words: Iterable[str]) -> list[str]:
    """Commits in full, by their names or, after an ``@``, by a file each of whose lines begins with one."""
    names: list[str] = []
    for word in words:
        lines = Path(word[1:]).read_text(encoding="utf-8").splitlines() if word.startswith("@") else [word]
        names += [line.split()[0] for line in lines if line.strip() and not line.startswith("#")]
    return [_git(root, "rev-parse", "--verify", f"{name}^{{commit}}").strip() for name in names]


def judged(outcome: str, reason: str) -> tuple[bool, str]:
    """Whether a test ends on the commit before its own as it should, and what to say of it.

    Parameters
    ----------
    outcome : str
        How it ends.
    reason : str
        Why it is right to pass; empty where nobody has said so.
    """
    if not reason:
        return outcome.startswith("fails"), outcome
    return (
        outcome == "passes",
        f"guards ({reason})" if outcome == "passes" else f"{outcome}, though it is said to guard",
    )


def main() -> int:
    """Print a line for each test; 1 if any does not end as it should."""
    parser = argparse.ArgumentParser(prog="python -m devtools.proofs", description=__doc__.splitlines()[0])
    parser.add_argument("base", nargs="?", help="the commits after this one (default: the last tag)")
    parser.add_argument("--commits", nargs="+", help="these commits alone; @FILE stands for those in a file")
    arguments = parser.parse_args()
    commits = named(ROOT, arguments.commits) if arguments.commits else since(ROOT, arguments.base or last_tag(ROOT))
    guards = json.loads(GUARDS.read_text(encoding="utf-8"))
    counted: Counter[str] = Counter()
    for commit, name, outcome in proofs(ROOT, commits):
        right, text = judged(outcome, guards.get(commit[:8], {}).get(name, ""))
        print(f"{commit[:9]}  {text:6}  {name}", flush=True)
        counted[text.split()[0] if right else "wrong"] += 1
    print(f"{counted['fails']} of {counted.total()} tests fail on the commit before theirs, {counted['guards']} guard")
    return int(counted["wrong"] > 0)


if __name__ == "__main__":
    sys.exit(main())
