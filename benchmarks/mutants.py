"""Mutants: does a test fail when the code is wrong?

    python benchmarks/mutants.py --count 300 --seed 1 [--area output] [--jobs 2]

The suite runs once under coverage, uncompiled, to know which tests reach which line. Then one
place at a time is changed (a comparison, an operator, a constant, a min for a max, a statement
left out), and the tests that reach it run, the quickest first, until one fails. Mutants are drawn
at random, the same ones for a seed, spread evenly over the areas. Survivors are listed with their
lines: each is either equivalent, or a test that is missing.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from coverage.numbits import numbits_to_nums

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "lineament"
AREAS = {
    "kernels": ("kernels",),
    "methods": ("methods", "extractor.py", "scan", "features", "explain", "bounds.py"),
    "logs": ("logs", "rosmsg"),
    "output": ("output",),
    "motion": ("motion",),
    "evaluation": ("evaluation", "simulation", "reproduce"),
    "commands": ("tasks", "cli", "view", "live", "files.py", "errors.py"),
}
#: Seconds that the tests of one mutant may take: a mutant that loops is killed by the clock.
PATIENCE = 120.0
#: The most tests that run for one mutant, the quickest of those that reach it.
MOST_TESTS = 60

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
    ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.Pow: ast.Mult,
}  # fmt: skip
SWAPS = {"min": "max", "max": "min", "any": "all", "all": "any", "sin": "cos", "cos": "sin"}


@dataclass(frozen=True)
class Mutant:
    """One change of one file."""

    area: str
    file: Path
    line: int
    what: str
    text: str


def files_of(area: str) -> Iterator[Path]:
    """Yield the source files of an area."""
    for part in AREAS[area]:
        place = SOURCE / part
        yield from sorted(place.rglob("*.py")) if place.is_dir() else [place]


def mutants_of(area: str, file: Path) -> Iterator[Mutant]:
    """Yield every mutant of a file."""
    source = file.read_text(encoding="utf-8")
    lines = source.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line.encode()))
    data = source.encode()

    def changed(node: ast.expr | ast.stmt, new: str) -> Mutant:
        first = starts[node.lineno - 1] + node.col_offset
        last = starts[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0)
        old = data[first:last].decode()
        text = (data[:first] + new.encode() + data[last:]).decode()
        return Mutant(area, file, node.lineno, f"{old!r} -> {new!r}"[:150], text)

    tree = ast.parse(source)
    skipped = {
        id(child)
        for node in ast.walk(tree)
        if isinstance(node, ast.AnnAssign | ast.arg | ast.JoinedStr | ast.Raise | ast.Import)
        or (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test))
        for child in ast.walk(getattr(node, "annotation", None) or node)
        if not (isinstance(node, ast.AnnAssign) and child is node)
    }
    for node in ast.walk(tree):
        if id(node) in skipped or getattr(node, "col_offset", None) is None:
            continue
        yield from (changed(place, new) for place, new in _changes(node))


def _changes(node: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    """Yield the places of a node that change, and what they become."""
    if isinstance(node, ast.expr):
        yield from ((node, f"({ast.unparse(new)})") for new in (*_operations(node), *_values(node)))
    elif isinstance(node, ast.AugAssign) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    ):
        yield node, "pass"


def _operations(node: ast.expr) -> Iterator[ast.expr]:
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        yield ast.Compare(node.left, [COMPARISONS[type(node.ops[0])]()], node.comparators)
    elif isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        if not isinstance(node.left, ast.Constant) or not isinstance(node.left.value, str):
            yield ast.BinOp(node.left, OPERATORS[type(node.op)](), node.right)
    elif isinstance(node, ast.BoolOp):
        yield ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield node.operand


def _values(node: ast.expr) -> Iterator[ast.expr]:
    if isinstance(node, ast.Constant) and type(node.value) is int:
        yield ast.Constant(node.value + 1)
    elif isinstance(node, ast.Constant) and type(node.value) is float:
        yield ast.Constant(node.value * 1.5 if node.value else 1.0)
    elif isinstance(node, ast.Name) and node.id in SWAPS and isinstance(node.ctx, ast.Load):
        yield ast.Name(SWAPS[node.id])
    elif isinstance(node, ast.Attribute) and node.attr in SWAPS:
        yield ast.Attribute(node.value, SWAPS[node.attr])


def covering(folder: Path) -> tuple[dict[tuple[str, int], list[str]], dict[str, float]]:
    """Run the suite once; return the tests that reach each line, and the seconds of each test."""
    data, report = folder / "coverage", folder / "durations"
    config = folder / "coveragerc"
    config.write_text(
        f"[run]\nsource = {SOURCE}\ndata_file = {data}\ndynamic_context = test_function\n"
    )
    run = [sys.executable, "-m", "coverage", "run", f"--rcfile={config}", "-m", "pytest"]
    run += ["-q", "-p", "no:cacheprovider", "--durations=0", "--durations-min=0", "-m", "not slow"]
    done = subprocess.run(
        [*run, "tests"], cwd=ROOT, env=environment(SOURCE.parent), capture_output=True, text=True
    )
    report.write_text(done.stdout)
    seconds: dict[str, float] = defaultdict(float)
    for line in done.stdout.splitlines():
        parts = line.split()
        if len(parts) == 3 and parts[1] in ("call", "setup", "teardown") and "::" in parts[2]:
            seconds[plain_id(parts[2])] += float(parts[0].rstrip("s"))
    tests: dict[tuple[str, int], list[str]] = defaultdict(list)
    with sqlite3.connect(data) as base:
        query = (
            "select path, context, numbits from line_bits join file on file.id = file_id "
            "join context on context.id = context_id where context != ''"
        )
        for path, context, bits in base.execute(query):
            for line_number in numbits_to_nums(bits):
                tests[path, line_number].append(context)
    return tests, seconds


def plain_id(test: str) -> str:
    """Return the name of a test function as coverage has it: ``test_x.test_name``."""
    file, _, name = test.partition("::")
    return f"{Path(file).stem}.{name.split('[')[0].replace('::', '.')}"


def environment(source: Path) -> dict[str, str]:
    """Return the environment of a run without compilation on some sources."""
    return {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(source)}


def survives(mutant: Mutant, tests: list[str], work: Path) -> bool:
    """Run the tests on the mutant; whether all pass."""
    copy = work / f"{os.getpid()}-{id(mutant)}"
    shutil.copytree(SOURCE.parent, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / mutant.file.relative_to(SOURCE.parent)).write_text(mutant.text, encoding="utf-8")
    by_file = defaultdict(list)
    for test in tests:
        name = test.split(".")
        by_file[name[0]].append(name[-1])
    chosen = [f"tests/{file}.py" for file in by_file]
    # The names select; a name that another file has too runs there as well.
    names = " or ".join(sorted({name for found in by_file.values() for name in found}))
    run = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not slow"]
    try:
        done = subprocess.run(
            [*run, "-k", names, *chosen],
            cwd=ROOT,
            env=environment(copy),
            capture_output=True,
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return False
    finally:
        shutil.rmtree(copy, ignore_errors=True)
    return done.returncode in (0, 5)


def main() -> None:
    """Run the mutants of each area; print the shares that were killed, and the survivors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300, help="mutants in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--area", action="append", choices=AREAS, help="these areas alone")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    given = parser.parse_args()
    areas = given.area or list(AREAS)
    work = Path(tempfile.mkdtemp())
    try:
        print("which tests reach which line", file=sys.stderr, flush=True)
        tests, seconds = covering(work)
        with ThreadPoolExecutor(given.jobs) as pool:
            for area in areas:
                run_area(area, given.count // len(areas), given.seed, tests, seconds, work, pool)
    finally:
        shutil.rmtree(work, ignore_errors=True)


def run_area(
    area: str,
    count: int,
    seed: int,
    tests: dict[tuple[str, int], list[str]],
    seconds: dict[str, float],
    work: Path,
    pool: ThreadPoolExecutor,
) -> None:
    """Draw the mutants of an area among the lines that run, and print what became of them."""
    started = time.monotonic()
    every = [mutant for file in files_of(area) for mutant in mutants_of(area, file)]
    drawn = random.Random(f"{seed} {area}").sample(every, min(count, len(every)))

    by_file: dict[str, list[str]] = defaultdict(list)
    for (path, _), names in tests.items():
        by_file[path] += names

    def fate(mutant: Mutant) -> bool:
        # A line that runs at import alone: whatever reaches its file.
        reached = tests.get((str(mutant.file), mutant.line)) or by_file[str(mutant.file)]
        order = sorted(set(reached), key=lambda test: seconds.get(test, 0.0))[:MOST_TESTS]
        return not order or survives(mutant, order, work)

    alive = [m for m, lives in zip(drawn, pool.map(fate, drawn), strict=True) if lives]
    killed = len(drawn) - len(alive)
    share = 100 * killed / max(len(drawn), 1)
    print(
        f"{area}: {killed} of {len(drawn)} killed, {share:.0f} %, "
        f"{time.monotonic() - started:.0f} s",
        flush=True,
    )
    for mutant in alive:
        note = "" if (str(mutant.file), mutant.line) in tests else "  (no test reaches the line)"
        place = mutant.file.relative_to(SOURCE)
        print(f"  {place}:{mutant.line}: {mutant.what}{note}", flush=True)


if __name__ == "__main__":
    main()
