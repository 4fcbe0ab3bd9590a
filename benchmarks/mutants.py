"""Mutants: does a test fail when the code is wrong?

    python benchmarks/mutants.py --area mapping [--area output ...] --count 40 --seed 1

The tests of an area run once under coverage, to know which of them reach which line. Then one
place at a time is changed (a comparison, an operator, a constant, a min for a max, a statement left
out), and the tests that reach the line run, the quickest first, then others that reach its file,
until one fails. Mutants are drawn at random, the same ones for a seed. Survivors are listed with
their lines: each is either equivalent, or a test that is missing.

Sources are copied to ``build/mutants``, where each job changes its own copy. What a file of tests
reaches is kept there, too, until it or any source changes.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import multiprocessing
import os
import random
import resource
import shutil
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import coverage
import numba
import pytest
from mutating import Mutant, mutants_of

ROOT = Path(__file__).parents[1]
SOURCES = ROOT / "src", ROOT / "lab" / "src"
WORK = ROOT / "build" / "mutants"
#: The parts of each area, and the tests that belong to it: ``tests/test_NAME.py``.
AREAS: dict[str, tuple[str, str]] = {
    "kernels": ("kernels", "*"),
    "methods": ("methods extractor.py scan features explain bounds.py", "*"),
    "logs": ("logs rosmsg", "*log* ros* source* info saving limits bulk* pdbs"),
    "output": (
        "output",
        "output output_* plans* figures notebook writers_mcap ros_messages feature_points world "
        "tables experiment_pictures live_foxglove",
    ),
    "mapping": ("mapping", "mapping* locating* relocation"),
    "motion": (
        "motion",
        "motion tracking* docking odometry deskewing relocation evaluation_tracking",
    ),
    "live": ("live", "live* relocation ros_messages locating"),
    "evaluation": (
        "evaluation",
        "evaluation* ple partition* consistency liu* compare line_fits pooled_recordings "
        "experiment_scans",
    ),
    "simulation": ("simulation", "simulation scenes truth buildings world scanners"),
    "reproduce": ("reproduce compare.py", "experiment* reproduce compare"),
    "commands": (
        "tasks cli view files.py errors.py",
        "cli ends view* bulk* progress locating* mapping* extractor explaining dependencies limits",
    ),
}
#: Areas of the laboratory.
LAB = "evaluation", "reproduce"
#: Kernels are compiled unless they change: numba does not see that what they call did.
UNCOMPILED = ("kernels", "methods")
#: Tests run for one mutant until they would take so long; a mutant that loops is killed by its
#: processor time, one that hangs by the clock [s].
ENOUGH, MOST, PATIENCE = 30.0, 100, 400.0
#: Imported before the tests are started, each time as a fork of this process.
LIBRARIES = "hypothesis numpy.testing pyarrow.parquet matplotlib.pyplot scipy.sparse.linalg"

#: Of each test its seconds, and the lines that it reaches in each file.
Reached = dict[str, tuple[float, dict[str, list[int]]]]


class Contexts:
    """A plugin of pytest that records what each test reaches, its seconds, and if it passes."""

    def __init__(self) -> None:
        self.coverage = coverage.Coverage(
            data_file=None, source=[str(WORK / "0")], config_file=False
        )
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.coverage.switch_context(nodeid)
        self.seconds[nodeid] = -sum(os.times()[:4])

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        self.seconds[nodeid] += sum(os.times()[:4])

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.outcome != "passed":
            self.failed.add(report.nodeid)

    def reached(self) -> Reached:
        data = self.coverage.get_data()
        lines: dict[str, dict[str, list[int]]] = defaultdict(dict)
        for path in data.measured_files():
            short = str(Path(path).relative_to(WORK / "0"))
            for line, tests in data.contexts_by_lineno(path).items():
                for test in tests:
                    lines[test].setdefault(short, []).append(line)
        good = self.seconds.keys() - self.failed
        return {test: (self.seconds[test], lines[test]) for test in sorted(good)}


def prepare(job: str, compiled: bool) -> None:
    """Turn this process, a fork, to the sources of a job."""
    os.setsid()
    copy = str(WORK / job)
    os.environ |= {"PYTHONPATH": copy, "NUMBA_DISABLE_JIT": str(int(not compiled))}
    sys.path.insert(0, copy)
    numba.config.DISABLE_JIT = int(not compiled)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    log = os.open(WORK / f"{job}.log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(log, 1)
    os.dup2(log, 2)


def arguments(compiled: bool) -> list[str]:
    """Return those of pytest; uncompiled, what is slow is left out."""
    what = ["-q", "-p", "no:cacheprovider", f"--rootdir={ROOT}"]
    what += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
    return what if compiled else [*what, "-m", "not slow"]


def cover(file: str, kept: Path, compiled: bool) -> None:
    """Run a file of tests, and keep what its tests reach."""
    prepare("0", compiled)
    contexts = Contexts()
    contexts.coverage.start()
    pytest.main([*arguments(compiled), file], plugins=[contexts])
    contexts.coverage.stop()
    kept.write_text(json.dumps(contexts.reached()))


def run(tests: list[str], job: str, compiled: bool) -> None:
    """Run tests; the exit status is that of pytest."""
    prepare(job, compiled)
    # The files of the mutant before may have the same size and second.
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    sys.dont_write_bytecode = True
    resource.setrlimit(resource.RLIMIT_CPU, (MOST, MOST))
    os._exit(int(pytest.main([*arguments(compiled), "-x", *tests])))


def forked(target: Callable[..., None], *arguments: Any) -> int | None:
    """Return the exit status of a function that runs in a fork, or None if it takes too long."""
    patience = PATIENCE if target is run else None
    process = multiprocessing.get_context("fork").Process(target=target, args=arguments)
    process.start()
    process.join(patience)
    if process.exitcode is None:
        os.killpg(process.pid or 0, signal.SIGKILL)
        process.join()
        return None
    return process.exitcode


def copied(job: str) -> str:
    """Copy the sources, with their times, for numba to know them by."""
    for source in SOURCES:
        apart = shutil.ignore_patterns("__pycache__")
        shutil.copytree(source, WORK / job, dirs_exist_ok=True, ignore=apart)
    return job


def covering(files: list[Path], compiled: bool) -> Reached:
    """Return what the tests of some files reach."""
    common = b"".join(
        file.read_bytes() for source in SOURCES for file in sorted(source.rglob("*.py"))
    )
    reached: Reached = {}
    for file in files:
        state = hashlib.sha256(common + file.read_bytes() + bytes([compiled])).hexdigest()[:16]
        kept = WORK / f"{file.stem}-{state}.json"
        if not kept.exists():
            started = time.monotonic()
            print(f"{file.name}: ", end="", file=sys.stderr, flush=True)
            forked(cover, str(file), kept, compiled)
            print(f"{time.monotonic() - started:.0f} s", file=sys.stderr, flush=True)
        reached |= json.loads(kept.read_text())
    return reached


def files_of(area: str) -> Iterator[Path]:
    """Yield the source files of an area."""
    for part in AREAS[area][0].split():
        source, package = (
            (SOURCES[1], "lineament_lab") if area in LAB else (SOURCES[0], "lineament")
        )
        place = source / package / part
        yield from sorted(place.rglob("*.py")) if place.is_dir() else [place]


def within(file: Path) -> str:
    """Return the path of a source file within the folder of its package."""
    return str(file.relative_to(next(s for s in SOURCES if file.is_relative_to(s))))


def tests_of(area: str) -> list[Path]:
    """Return the files of tests of an area."""
    names = AREAS[area][1].split()
    return sorted({file for name in names for file in (ROOT / "tests").glob(f"test_{name}.py")})


def order_of(mutant: Mutant, reached: Reached) -> list[str]:
    """Return the tests that reach the line of a mutant, and then those that reach its file.

    And those that reach nothing: they look at constants.
    """
    path = within(mutant.file)
    near = {test: of.get(path, []) for test, (_, of) in reached.items() if path in of or not of}
    by_seconds = sorted(near, key=lambda test: (mutant.line not in near[test], reached[test][0]))
    tests, seconds = [], 0.0
    for test in by_seconds:
        seconds += reached[test][0]
        if tests and seconds > ENOUGH:
            break
        tests.append(test)
    # Those of a file together: what they share is made once, and a node of ROS 1 cannot come back.
    files = {test.partition("::")[0]: k for k, test in reversed([*enumerate(tests)])}
    return sorted(tests, key=lambda test: files[test.partition("::")[0]])


def survives(mutant: Mutant, tests: list[str], job: str, compiled: bool) -> bool:
    """Run the tests on the mutant; whether all pass."""
    file = WORK / job / within(mutant.file)
    file.write_text(mutant.text, encoding="utf-8")
    try:
        return forked(run, tests, job, compiled) in (0, 5)
    finally:
        shutil.copy2(mutant.file, file)


def run_area(area: str, drawn: list[Mutant], jobs: SimpleQueue[str], threads: int) -> None:
    """Print what becomes of the mutants of an area."""
    started, compiled = time.monotonic(), area not in UNCOMPILED
    reached = covering(tests_of(area), compiled)

    def lives(mutant: Mutant) -> bool:
        tests, job = order_of(mutant, reached), jobs.get()
        try:
            return not tests or survives(mutant, tests, job, compiled)
        finally:
            jobs.put(job)

    killed = 0
    with ThreadPoolExecutor(threads) as pool:
        for done, (mutant, left) in enumerate(zip(drawn, pool.map(lives, drawn), strict=True), 1):
            print(f"\r{done} of {len(drawn)}", end="", file=sys.stderr, flush=True)
            killed += not left
            if left:
                place = within(mutant.file)
                seen = any(mutant.line in of.get(place, ()) for _, of in reached.values())
                note = "" if seen else "  (no test reaches the line)"
                print(f"  {place}:{mutant.line}: {mutant.what}{note}", flush=True)
    share, seconds = 100 * killed / max(len(drawn), 1), time.monotonic() - started
    print(f"{area}: {killed} of {len(drawn)} killed, {share:.0f} %, {seconds:.0f} s", flush=True)


def main() -> None:
    """Run the mutants of each area; print the shares that were killed, and the survivors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=40, help="mutants of each area")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--area", action="append", choices=AREAS, help="these areas alone")
    parser.add_argument("--skip", action="append", default=[], help="leave out such paths")
    parser.add_argument("--at", help="all mutants of this FILE:LINE instead, of one area")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    given = parser.parse_args()
    for name in LIBRARIES.split():
        importlib.import_module(name)
    WORK.mkdir(parents=True, exist_ok=True)
    jobs: SimpleQueue[str] = SimpleQueue()
    for job in range(given.jobs):
        jobs.put(copied(str(job)))
    os.chdir(ROOT)
    for area in given.area or AREAS:
        files = [f for f in files_of(area) if not any(part in str(f) for part in given.skip)]
        every = [mutant for file in files for mutant in mutants_of(file)]
        drawn = random.Random(f"{given.seed} {area}").sample(every, min(given.count, len(every)))
        if given.at:
            drawn = [m for m in every if f"{m.file}:{m.line}".endswith(given.at)]
        run_area(area, drawn, jobs, given.jobs)


if __name__ == "__main__":
    main()
