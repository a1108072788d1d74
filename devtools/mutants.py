# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the tests see what they should: random lines of the engine are changed, and the tests have to fail.

    python -m devtools.mutants --json PATH                    fifty lines, the same in every run with one seed
    python -m devtools.mutants --seed 7 --count 20            others
    python -m devtools.mutants --show                         only say what would be changed
    python -m devtools.mutants --json PATH --again            only those that survived, of the record that is there

A mutant is the engine with one change: an operator swapped, a comparison turned, a number changed, *and* for *or*, a
*not* dropped. It lives in a copy of the tree in out/mutants. It gets the files of tests that import the file in which
it stands, itself or by way of others: the one of its own name first, then the nearest, then the quickest, until a
test fails. A test that hangs has failed as well. Tests of the engine come before those in Blender, and neither get
more time than `BUDGET`; what survives may still be found by a test that there was no time for.

Prints a line for each mutant; ``mutants_found`` in the JSON is the share that a test has found.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import queue
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from tests.durations import Durations

from . import house, rooms

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "out" / "mutants"
ENGINE_TESTS = ("tests/engine", "tests/attack/engine")
BLENDER_TESTS = ("tests/blender", "tests/attack/blender")
#: Tests of files under version control, which the copy is not.
NO_USE = {"test_house.py", "test_readability.py"}
#: CPU seconds of tests, by what they took in their last run, that a mutant gets in the engine and in Blender.
BUDGET = {ENGINE_TESTS: 40.0, BLENDER_TESTS: 12.0}
#: A run that takes so many times as many CPU seconds as its tests did, and so many more, hangs.
PATIENCE, STARTING = 6, 60
#: Seconds by the clock after which a run waits for something that does not come; long, as others may be at work beside.
ASLEEP = 7200.0

#: Whole numbers from here on grow by half. Smaller numbers than the second only keep quotients defined.
HUNDRED, AS_GOOD_AS_0 = 100, 1e-9

_SWAPS = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"), ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"), ast.Pow: ("**", "*"), ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&"), ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"), ast.Lt: ("<", ">="), ast.LtE: ("<=", ">"), ast.Gt: (">", "<="), ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="), ast.In: ("in", "not in"), ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"), ast.NotIn: ("not in", "in"), ast.And: ("and", "or"), ast.Or: ("or", "and"),
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One change of a file: ``text`` stands from ``start`` to ``end`` (bytes) instead of ``before``."""

    path: str
    line: int
    function: str
    start: int
    end: int
    before: str
    text: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line} {self.function}: {self.before} -> {self.text}"


class _Finder(ast.NodeVisitor):
    """All changes of one file that are possible; types, docstrings and texts have none.

    Nor has what no test could tell, as results stay the same: see `visit_ClassDef`, `visit_keyword`, `visit_Assign` and
    `visit_Constant`.
    """

    def __init__(self, path: str, source: bytes) -> None:
        self.path, self.source = path, source
        self.starts = [0]
        for line in source.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.function = "<module>"
        self.found: list[Mutant] = []

    def _begin(self, node: ast.expr) -> int:
        return self.starts[node.lineno - 1] + node.col_offset

    def _end(self, node: ast.expr) -> int:
        return self.starts[node.end_lineno - 1] + node.end_col_offset

    def _add(self, start: int, end: int, text: str) -> None:
        line = self.source.count(b"\n", 0, start) + 1
        self.found.append(Mutant(self.path, line, self.function, start, end, self.source[start:end].decode(), text))

    def _swap(self, left: ast.expr, right: ast.expr, operator: ast.AST) -> None:
        """The operator between two expressions; comments and brackets may stand there, too."""
        before, after = _SWAPS.get(type(operator), ("", ""))
        begin, end = self._end(left), self._begin(right)
        at = self.source.find(before.encode(), begin, end) if before else -1
        if at >= 0 and b"#" not in self.source[begin:end]:
            self._add(at, at + len(before), after)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        """Its decorators, as those of functions, decide what a mistake would raise, and how much is remembered."""
        for statement in node.body:
            self.visit(statement)

    def visit_keyword(self, node: ast.keyword) -> None:
        """``strict`` of a zip turns a mistake into an error, and changes no result without one."""
        if node.arg != "strict":
            self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for default in (*node.args.defaults, *filter(None, node.args.kw_defaults)):
            self.visit(default)
        outer, self.function = self.function, node.name
        for statement in node.body:
            self.visit(statement)
        self.function = outer

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value:
            self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        """Names with two underscores are Python's; a batch or chunk is how work is cut, and results do not know it."""
        names = [target.id for target in node.targets if isinstance(target, ast.Name)]
        if not any(name.startswith("__") or name.endswith(("BATCH", "CHUNK")) for name in names):
            self.visit(node.value)

    def visit_Raise(self, node: ast.Raise) -> None:
        """What an error says is no result."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Neither is a text."""

    def visit_Subscript(self, node: ast.Subscript) -> None:
        if not (isinstance(node.value, ast.Name) and node.value.id[:1].isupper()):  # tuple[int, ...] and its like
            self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        words = (ast.walk(node.left), ast.walk(node.right))
        if not any(isinstance(part, ast.Constant) and isinstance(part.value, str) for some in words for part in some):
            self._swap(node.left, node.right, node.op)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        for left, operator, right in zip((node.left, *node.comparators), node.ops, node.comparators, strict=False):
            self._swap(left, right, operator)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        if len(node.values) == 2:  # of more, one swap would change how they belong together
            self._swap(*node.values, node.op)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, (ast.Not, ast.USub, ast.Invert)):
            self._add(self._begin(node), self._begin(node.operand), "")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        """A number grows by half, a small whole one by 1: 1 more than a hundred or a thousand is next to nothing.

        What is as good as 0 only keeps a quotient defined; half as much more is as good as 0 again.
        """
        value = node.value
        if isinstance(value, bool):
            self._add(self._begin(node), self._end(node), str(not value))
        elif isinstance(value, int):
            self._add(self._begin(node), self._end(node), str(value + (1 if value < HUNDRED else value // 2)))
        elif isinstance(value, float) and (not value or value > AS_GOOD_AS_0):
            self._add(self._begin(node), self._end(node), repr(value * 1.5 if value else 1.0))


def possible(path: Path) -> list[Mutant]:
    """All mutants of one file that Python can still read."""
    source = path.read_bytes()
    finder = _Finder(path.relative_to(ROOT).as_posix(), source)
    finder.visit(ast.parse(source))
    return finder.found


def draw(count: int, seed: int) -> list[Mutant]:
    """One mutant each of so many lines of the engine, all lines that have one being alike."""
    lines: dict[tuple[str, int], list[Mutant]] = defaultdict(list)
    for path in sorted((ROOT / rooms.ADDON).rglob("*.py")):
        if "blender" not in path.relative_to(ROOT).parts:
            for mutant in possible(path):
                lines[mutant.path, mutant.line].append(mutant)
    chance = random.Random(seed)
    return [chance.choice(lines[key]) for key in chance.sample(sorted(lines), count)]


def copy_tree(folder: Path) -> Path:
    """A copy of what is under version control, and of new files; what an earlier run has left there goes."""
    shutil.rmtree(folder, ignore_errors=True)
    for path in house.files():
        target = folder / path.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    return folder


class Tests:
    """Files of tests of a copy of the tree: what they import, and what they cost when they last ran."""

    def __init__(self, tree: Path) -> None:
        self.tree = tree
        self.seconds: dict[str, float] = defaultdict(float)
        for name, seconds in Durations(ROOT / "out").kept().items():
            self.seconds[name.split("::")[0]] += seconds
        self.groups = {
            group: sorted(p for folder in group for p in (tree / folder).rglob("test_*.py") if p.name not in NO_USE)
            for group in BUDGET
        }

    def steps(self, module: str) -> dict[str, int]:
        """How many imports lead from each module of the product to this one."""
        found, border = {module: 0}, [module]
        while border:
            border = [n for n, others in rooms.imports().items() if n not in found and not others.isdisjoint(border)]
            found |= dict.fromkeys(border, 1 + max(found.values()))
        return found

    def of(self, mutant: Mutant, group: tuple[str, ...]) -> list[Path]:
        """Files that may see a mutant: that of its own file first, then the nearest, then the quickest."""
        name = Path(mutant.path)
        steps = self.steps(mutant.path.removesuffix(".py").replace("/", "."))
        ranked = []
        for path in self.groups[group]:
            imported = _product_imports(path)
            near = min((steps[module] for module in imported if module in steps), default=len(rooms.sources()))
            mirror = path.name == f"test_{name.stem}.py", path.parent.name == name.parent.name
            relative = path.relative_to(self.tree)
            ranked.append((not all(mirror), near - mirror[1], self.seconds[relative.as_posix()], relative))
        chosen, total = [], 0.0
        for *_, seconds, path in sorted(ranked):
            # One long file must not keep out the many short ones behind it.
            if not chosen or total + seconds <= BUDGET[group]:
                chosen.append(path)
                total += seconds
        return chosen

    def run(self, files: list[Path]) -> tuple[int, str]:
        """Run files until a test fails: the exit code, and the end of what is said."""
        command = [sys.executable, "-m", "pytest", "-qx", "-p", "no:cacheprovider", "--tb=line", *map(str, files)]
        environment = os.environ | {"TETFLORA_THREADS": "1", "CI": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        limit = int(STARTING + PATIENCE * sum(self.seconds[path.as_posix()] for path in files))
        with subprocess.Popen(
            command, cwd=self.tree, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, start_new_session=True,
        ) as process:  # fmt: skip
            resource.prlimit(process.pid, resource.RLIMIT_CPU, (limit, limit + 1))
            try:
                said = process.communicate(timeout=ASLEEP)[0]
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)  # its children as well
                return -1, "it hangs"
            return process.returncode, said


def _product_imports(path: Path) -> set[str]:
    """Modules of the product that a file of tests imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def tried(mutant: Mutant, tests: Tests) -> str:
    """The test that finds a mutant, empty where none does; the tree is as it was afterward."""
    path = tests.tree / mutant.path
    source = path.read_bytes()
    path.write_bytes(source[: mutant.start] + mutant.text.encode() + source[mutant.end :])
    try:
        for group in BUDGET:
            code, said = tests.run(tests.of(mutant, group))
            if code:
                failed = [line for line in said.splitlines() if line.startswith(("FAILED", "ERROR"))]
                return failed[0] if failed else said.strip()[-200:] or f"exit code {code}"
        return ""
    finally:
        path.write_bytes(source)


def results(mutants: list[Mutant], jobs: int) -> Iterator[dict]:
    """What became of each mutant, so many at once, as they come."""
    free: queue.SimpleQueue[Tests] = queue.SimpleQueue()
    for number in range(jobs):
        free.put(Tests(copy_tree(FOLDER / f"tree{number}")))

    def one(mutant: Mutant) -> dict:
        tests = free.get()
        try:
            begin, by = time.monotonic(), tried(mutant, tests)
        finally:
            free.put(tests)
        return asdict(mutant) | {"found": bool(by), "by": by, "seconds": round(time.monotonic() - begin, 1)}

    with ThreadPoolExecutor(jobs) as threads:
        for done in as_completed([threads.submit(one, mutant) for mutant in mutants]):
            yield done.result()


def _mutant(entry: dict) -> Mutant:
    return Mutant(**{field.name: entry[field.name] for field in fields(Mutant)})


def main() -> int:
    """Try the mutants that the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m devtools.mutants", description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="PATH", help="write the record here")
    parser.add_argument("--seed", type=int, default=43, help="which lines (default: 43)")
    parser.add_argument("--count", type=int, default=50, help="how many (default: 50)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="how many at once (default: all cores)")
    parser.add_argument("--show", action="store_true", help="only list the mutants")
    parser.add_argument("--again", action="store_true", help="only those that survived in the record")
    options = parser.parse_args()
    mutants = draw(options.count, options.seed)
    if options.show:
        print("\n".join(map(str, mutants)))
        return 0
    done: list[dict] = []
    if options.again:
        done = [one for one in json.loads(options.json.read_text(encoding="utf-8"))["each"] if one["found"]]
        mutants = [mutant for mutant in mutants if str(mutant) not in {str(_mutant(one)) for one in done}]
    for each in results(mutants, options.jobs):
        done.append(each)
        word = "found   " if each["found"] else "SURVIVES"
        print(f"{word} {each['seconds']:5.0f} s  {_mutant(each)}   {each['by'][:120]}", flush=True)
        share = sum(one["found"] for one in done) / len(done)
        record = {"mutants": len(done), "mutants_found": share, "seed": options.seed, "each": done}
        if options.json:  # as it goes: all take a while
            options.json.parent.mkdir(parents=True, exist_ok=True)
            options.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(f"{sum(one['found'] for one in done)} of {len(done)} mutants found")
    return 0


if __name__ == "__main__":
    sys.exit(main())
