# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of benchmarks is true: each is there and has its answer in a document, and what documents call exists."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from benchmarks.__main__ import NAMES
from devtools.readability import anchors

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = ROOT / "benchmarks"
#: What benchmarks share, and the other programs that read what is exported.
SHARED = {"__init__", "__main__", "report", "pictures", "asset_trees", "side_views"}
READERS = {"reimport", "export_readers", "mitsuba_views"}
DOCUMENTS = [*sorted((ROOT / "docs").glob("*.md")), *sorted(ROOT.glob("*.md")), ROOT / "Makefile"]


def test_every_file_is_a_benchmark_or_shared() -> None:
    assert {path.stem for path in BENCHMARKS.glob("*.py")} == {*NAMES, *SHARED, *READERS}


@pytest.mark.parametrize("name", NAMES)
def test_it_has_what_the_runner_asks_for_and_an_answer(name: str) -> None:
    nodes = ast.parse((BENCHMARKS / f"{name}.py").read_text(encoding="utf-8")).body
    defined = {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    defined |= {t.id for node in nodes if isinstance(node, ast.Assign) for t in node.targets if isinstance(t, ast.Name)}
    defined |= {
        node.target.id for node in nodes if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }
    assert {"run", "TARGETS"} <= defined
    document, anchor = NAMES[name][0].split("#")
    assert anchor in anchors((ROOT / "docs" / document).read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_commands_of_documents_exist(path: Path) -> None:
    """`python -m` of benchmarks, examples and devtools."""
    text = path.read_text(encoding="utf-8")
    for name in re.findall(r"-m benchmarks ([a-z_0-9]+)", text):
        assert name in {*NAMES, "all"}, name
    for package, name in re.findall(r"-m (examples|devtools|benchmarks)\.([a-z_0-9]+)", text):
        assert package != "benchmarks", f"benchmarks.{name}: one runner, python -m benchmarks NAME"
        assert (ROOT / package / f"{name}.py").exists() or (ROOT / package / name / "__main__.py").exists(), name


@pytest.mark.parametrize("path", sorted(BENCHMARKS.glob("*.py")), ids=lambda path: path.stem)
def test_names_of_the_extension_that_it_imports_exist(path: Path) -> None:
    """No other test runs what takes minutes, so a name that is gone would be missed by whoever measures next."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tetflora_addon"):
            place = ROOT.joinpath(*node.module.split("."))
            modules = {other.stem for other in place.iterdir()} if place.is_dir() else set()
            assert {alias.name for alias in node.names} <= modules | _bound(place.with_suffix(".py")), node.module


def _bound(source: Path) -> set[str]:
    """Names that a module has, none where it is a package."""
    tree = ast.parse(source.read_text(encoding="utf-8") if source.exists() else "")
    found = {node.name for node in tree.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    found |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    imports = (node for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom)))
    return found | {alias.asname or alias.name for node in imports for alias in node.names}
