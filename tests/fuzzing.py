"""A million inputs of every kind, on both cores: python tests/fuzzing.py --inputs 1000000.

Damaged logs, scans for all methods with any parameters, all writers, requests to the viewer,
messages to the node, plans and places on them. The state is in a folder: a run that was interrupted
goes on. An input that raises, hangs, crashes, or takes too long is kept there, with what was
raised, and the run goes on; the table at the end counts them. Recordings in the folder
LINEAMENT_DATA lend their beginnings.

An input is a function of the seed, its number, and, for logs, of the corpus: inputs that ran lines
of the readers which none had run before.
"""

import argparse
import faulthandler
import gc
import json
import os
import pickle
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from types import CodeType, FrameType
from typing import Any

from lineament import LineamentWarning
from lineament.methods import method_names

#: Bounds for each input: processor time [s], wall clock [s], address space [bytes].
SECONDS, PATIENCE, MEMORY = 5.0, 90, 6 << 30
#: What is fuzzed, and in how many of a hundred inputs.
SHARES: dict[str, float] = {
    "methods": 34,
    "forms": 25,
    "readers": 20,
    "messages": 9,
    "viewer": 4,
    "writers": 3,
}
SHARES |= {"plans": 3.0, "results": 1.5, "locate": 0.5}
#: Inputs after which the state is saved.
SAVED = 200


class Lines:
    """Lines of some files that no input has run yet: watched by the tracer of Python."""

    def __init__(self, watched: tuple[str, ...]) -> None:
        self._watched = watched
        self._missing: dict[CodeType, set[int]] = {}
        self._new = 0

    def new(self, call: Callable[[], Any]) -> tuple[Any, int]:
        """Call, and return what it gives and how many lines were run for the first time."""
        self._new = 0
        sys.settrace(self._called)
        try:
            return call(), self._new
        finally:
            sys.settrace(None)

    def _called(self, frame: FrameType, *_: Any) -> Any:
        code = frame.f_code
        missing = self._missing.get(code)
        if missing is None:
            is_watched = any(name in code.co_filename for name in self._watched)
            lines = {line for *_, line in code.co_lines() if line} if is_watched else set()
            missing = self._missing[code] = lines
        return self._ran if missing else None

    def _ran(self, frame: FrameType, event: str, _: Any) -> Any:
        missing = self._missing[frame.f_code]
        if event == "line" and frame.f_lineno in missing:
            missing.discard(frame.f_lineno)
            self._new += 1
        return self._ran


def targets_in(scratch: Path) -> dict[str, Any]:
    """Return what is fuzzed, by the names of `SHARES`."""
    from fuzz_forms import Forms, Results
    from fuzz_plans import Locating, Plans
    from fuzz_readers import Readers
    from fuzz_targets import Messages, Methods, Viewer, Writers

    recordings = os.environ.get("LINEAMENT_DATA")
    return {
        "methods": Methods(scratch),
        "messages": Messages(scratch),
        "viewer": Viewer(scratch),
        "writers": Writers(scratch),
        "forms": Forms(scratch),
        "results": Results(scratch),
        "plans": Plans(scratch),
        "locate": Locating(scratch),
        "readers": Readers(scratch, Path(recordings) if recordings else None),
    }


def check_again(kept: Path) -> str:
    """Check an input that was kept: what came of it, or what it raises."""
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", LineamentWarning)  # of what is made by chance
    with tempfile.TemporaryDirectory(prefix="fuzzing-") as scratch:
        target = targets_in(Path(scratch))[kept.stem.partition("-")[2]]
        try:
            return str(target.check(pickle.loads(kept.read_bytes())))
        finally:
            target.close()


def work(state: Path, seed: int, worker: int, workers: int, inputs: int) -> None:
    """Check the inputs of one worker, from where its state ends."""
    from fuzz_readers import Readers

    scratch = Path(tempfile.mkdtemp(prefix="fuzzing-"))
    targets = targets_in(scratch)
    corpus = state / f"corpus-{worker}"
    corpus.mkdir(exist_ok=True)
    for path in sorted(corpus.iterdir()):
        targets["readers"].keep(pickle.loads(path.read_bytes()))
    lines = Lines(Readers.watched)
    saved = state / f"worker-{worker}.json"
    found = _state(saved)
    counts, slowest, hours = Counter(found["counts"]), found["slowest"], found["hours"]
    begin = found.get("next", worker)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", LineamentWarning)  # of what is made by chance
    unraisable: list[Any] = []
    sys.unraisablehook = unraisable.append
    gc.disable()  # What only the collector would remove shows, as it comes only now and then.
    names = list(SHARES)
    started = time.monotonic()
    current = state / f"worker-{worker}.now"
    for number in range(begin, inputs, workers):
        chance = Random(f"{seed} {number}")
        name = chance.choices(names, list(SHARES.values()))[0]
        target = targets[name]
        made = target.make(chance)
        current.write_bytes(pickle.dumps((number, name, made)))
        faulthandler.dump_traceback_later(PATIENCE, exit=True)
        before = time.process_time()
        try:
            call = lambda: target.check(made)  # noqa: B023, E731
            outcome, new = lines.new(call) if name == "readers" else (call(), 0)
            assert not unraisable, str(unraisable)
        except Exception:
            unraisable.clear()
            _keep(state, number, name, made, traceback.format_exc())
            outcome, new = "FAULT", 0
        spent = time.process_time() - before
        faulthandler.cancel_dump_traceback_later()
        if spent > SECONDS:
            _keep(state, number, name, made, f"took {spent:.1f} s")
            outcome = "SLOW"
        if new:
            targets["readers"].keep(made)
            (corpus / f"{number:08}").write_bytes(pickle.dumps(made))
        kind = f"{name}/{outcome}"
        counts[kind] += 1
        slowest[name] = max(slowest.get(name, 0.0), spent)
        if number // workers % SAVED == SAVED - 1 or number + workers >= inputs:
            gc.collect()
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            found = {
                "next": number + workers,
                "hours": hours + (time.monotonic() - started) / 3600,
                "memory": memory,
                "slowest": slowest,
                "counts": counts,
            }
            beside = saved.with_suffix(".part")
            beside.write_text(json.dumps(found))
            beside.replace(saved)
    for target in targets.values():
        target.close()
    shutil.rmtree(scratch)


def _keep(state: Path, number: int, name: str, made: Any, what: str) -> None:
    (state / "faults").mkdir(exist_ok=True)
    path = state / "faults" / f"{number:08}-{name}"
    path.with_suffix(".pickle").write_bytes(pickle.dumps(made))
    path.with_suffix(".txt").write_text(what)


def run(state: Path, seed: int, workers: int, inputs: int) -> None:
    """Keep the workers at work to the end; one that crashes or hangs goes on with its next."""
    state.mkdir(parents=True, exist_ok=True)
    # No input is charged with the time to compile.
    methods = (word for name in method_names() for word in ("-m", name))
    subprocess.run([sys.executable, "-m", "lineament", "warmup", "-q", *methods], check=True)
    running: dict[int, subprocess.Popen[bytes]] = {}
    waiting = set(range(workers))
    try:
        while waiting or running:
            for worker in sorted(waiting):
                words = [str(state), str(seed), str(worker), str(workers), str(inputs)]
                with (state / f"worker-{worker}.txt").open("ab") as log:
                    running[worker] = subprocess.Popen(
                        [sys.executable, __file__, "--work", *words], stdout=log, stderr=log
                    )
            waiting.clear()
            time.sleep(2)
            for worker, process in list(running.items()):
                if process.poll() is None:
                    continue
                del running[worker]
                if process.returncode:
                    _blame(state, worker, process.returncode)
                    waiting.add(worker)
            done = sum(found.get("next", 0) // workers for found in _states(state))
            print(f"\r{done} of {inputs}, {len(list(state.glob('faults/*.txt')))} faults", end="")
    finally:
        for process in running.values():
            process.send_signal(signal.SIGTERM)
    print()


def _blame(state: Path, worker: int, status: int) -> None:
    """Keep the input at which a worker ended, and skip it."""
    number, name, made = pickle.loads((state / f"worker-{worker}.now").read_bytes())
    _keep(state, number, name, made, f"ended the worker with status {status}")
    saved = state / f"worker-{worker}.json"
    workers = len(list(state.glob("worker-*.now")))
    found = _state(saved) | {"next": number + workers}
    found["counts"][f"{name}/CRASH OR HANG"] = found["counts"].get(f"{name}/CRASH OR HANG", 0) + 1
    saved.write_text(json.dumps(found))


def _state(saved: Path) -> dict[str, Any]:
    """Return what a worker has saved, or what it begins with."""
    empty = {"hours": 0.0, "memory": 0.0, "slowest": {}, "counts": {}}
    return empty | (json.loads(saved.read_text()) if saved.exists() else {})


def _states(state: Path) -> list[dict[str, Any]]:
    with suppress(OSError, ValueError):
        return [json.loads(path.read_text()) for path in sorted(state.glob("worker-*.json"))]
    return []


def table(state: Path) -> str:
    """Return what was found as a table in Markdown."""
    states = _states(state)
    counts = sum((Counter(found["counts"]) for found in states), Counter())
    rows = [
        "|class|inputs|faults|crashes, hangs|over 5 s|slowest [s]|",
        "|---|---|---|---|---|---|",
    ]
    for name in SHARES:
        own = {kind: n for kind, n in counts.items() if kind.startswith(f"{name}/")}
        bad = [own.get(f"{name}/{kind}", 0) for kind in ("FAULT", "CRASH OR HANG", "SLOW")]
        slowest = max(found["slowest"].get(name, 0.0) for found in states)
        rows.append(f"|{name}|{sum(own.values())}|{'|'.join(map(str, bad))}|{slowest:.2f}|")
    hours = sum(found["hours"] for found in states)
    memory = max(found["memory"] for found in states)
    kept = len(list(state.glob("corpus-*/*")))
    rows += [
        "",
        f"{counts.total()} inputs in {hours:.1f} hours of {len(states)} processes, "
        f"{memory:.0f} MB of memory at most in one, {kept} logs in the corpus.",
    ]
    outcomes = ", ".join(f"{kind} {n}" for kind, n in sorted(counts.items()))
    return "\n".join([*rows, "", outcomes])


def main() -> None:
    if sys.argv[1:2] == ["--work"]:
        state, *numbers = sys.argv[2:]
        work(Path(state), *map(int, numbers))
        return
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--state", type=Path, default=Path("build/fuzzing"))
    parser.add_argument("--again", type=Path, help="check one kept input (.pickle) alone")
    given = parser.parse_args()
    if given.again:
        print(check_again(given.again))
        return
    run(given.state, given.seed, given.workers, given.inputs)
    print(table(given.state))
    sys.exit(bool(list(given.state.glob("faults/*.txt"))))


if __name__ == "__main__":
    main()
