"""Damaged logs of every format against what every reader promises.

Run for long: python tests/fuzzing.py --seconds 600. Each input is a small log of the project's own
writers, or the beginning of a recording in the folder LINEAMENT_DATA, that was damaged. What breaks
the promise is kept in a folder with its traceback.
"""

from __future__ import annotations

import argparse
import faulthandler
import gc
import multiprocessing
import os
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from mutations import Sample, mutated, own_samples, recorded_samples

from lineament import LaserScan, LogError
from lineament.logs import find_logs, open_log, summarize
from lineament.logs.base import Topic

#: Bounds for each input in a long run: processor time [s], wall clock [s], address space [bytes].
SECONDS, PATIENCE, MEMORY = 2.0, 60, 3 << 30
#: Inputs of a process before it gives way to a fresh one.
ROUND = 5000

#: Ways to open; what is wrong with the topic of poses must be one clear line too.
OPTIONS: tuple[dict[str, Any], ...] = (
    {},
    {"echo": "strongest"},
    {"echo": "last"},
    {"ring": 0},
    {"pose_topic": "/odom"},
    {"pose_topic": "/tf:odom->base"},
)


def check(sample: Sample, folder: Path, options: dict[str, Any]) -> bool:
    """Read a log in every way there is; True if a scan came out.

    `folder` is empty before and after; temporary files go to the folder of the same name with
    ".tmp" at its end, which must be empty when all logs are gone.
    """
    for name, data in sample.files.items():
        (folder / name).write_bytes(data)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    path = folder / sample.opened
    count = 0
    for found in one_line_or(lambda: find_logs(path), default=[str(path)]):
        for keep_going in (False, True):
            count += one_line_or(
                lambda f=found, k=keep_going: read(f, keep_going=k, **options), default=0
            )
    left = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert left == before, f"files changed: {sorted(before)} are {sorted(left)}"
    for path in folder.iterdir():
        path.unlink()
    return count > 0


def one_line_or(call: Any, default: Any) -> Any:
    """Call; a LogError gives the default, if it is one line."""
    try:
        return call()
    except LogError as error:
        assert str(error).isprintable(), repr(str(error))  # noqa: PT017
        return default


def read(path: str, **options: Any) -> int:
    """Use all that a log offers; how many scans came out."""
    log = open_log(path, **options)
    assert len(log) >= 0
    assert all(isinstance(topic, Topic) for topic in log.contents())
    count = 0
    for topic, scan in log.items():
        check_scan(scan)
        assert topic in log.topics
        count += 1
    assert log.skipped == 0 or options["keep_going"]
    assert all(fault.isprintable() for fault in log.faults)
    lines = summarize(log).lines()
    assert all(line.isprintable() for line in lines), lines
    return count


def check_scan(scan: LaserScan) -> None:
    """Check that a scan is one, whoever made it."""
    assert type(scan) is LaserScan
    n = len(scan)
    for values in (scan.ranges, scan.angles):
        assert values.shape == (n,)
        assert values.dtype == np.float64
        assert not values.flags.writeable
    assert np.isfinite(scan.angles).all()
    assert (np.diff(scan.angles) > 0).all(), scan.angles
    assert np.isfinite([scan.stamp, scan.scan_time, scan.time_increment]).all()
    assert 0 <= scan.range_min < scan.range_max
    assert scan.intensities is None or scan.intensities.shape == (n,)
    assert scan.pose is None or np.isfinite(scan.pose).all()
    assert isinstance(scan.frame_id, str)
    assert scan.points.shape == (n, 2)
    assert repr(scan)


# The long run: processes that may be slow, large or killed, and one that counts


def scratch(work: Path) -> tuple[Path, Path]:
    """Make a folder for inputs, and one for temporary files, which readers then use."""
    folders = work / "input", work / "temporary"
    for folder in folders:
        folder.mkdir(exist_ok=True)
    tempfile.tempdir = str(folders[1])
    return folders


def chosen(samples: list[Sample], chance: Random) -> Sample:
    """Choose a format, then one of its samples."""
    kind = chance.choice(sorted({sample.kind for sample in samples}))
    return chance.choice([sample for sample in samples if sample.kind == kind])


def check_nothing_left(temporary: Path) -> None:
    """Check that temporary files went with their logs, and do not wait for the collector."""
    assert not list(temporary.iterdir()), list(temporary.iterdir())


def run_round(seed: int, deadline: float, work: Path, kept: Path, counts: Any) -> None:
    """Try inputs in this process until the deadline, and put its counts into a queue."""
    import resource  # There is none on Windows.

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    warnings.simplefilter("error")
    unraisable: list[Any] = []
    sys.unraisablehook = unraisable.append
    signal.signal(signal.SIGPROF, _too_slow)
    with tempfile.TemporaryDirectory() as own:
        samples = own_samples(Path(own))
    if "LINEAMENT_DATA" in os.environ:
        samples += recorded_samples(Path(os.environ["LINEAMENT_DATA"]))
    folder, temporary = scratch(work)
    # What only the collector would remove shows, as it comes only now and then.
    gc.disable()
    chance, found = Random(seed), Counter[tuple[str, str]]()
    for number in range(ROUND):
        if time.time() > deadline:
            break
        sample = mutated(chosen(samples, chance), samples, chance)
        options = chance.choice(OPTIONS)
        # Where this process dies, its parent finds what it died of.
        for name, data in sample.files.items():
            (folder / name).write_bytes(data)
        faulthandler.dump_traceback_later(PATIENCE, exit=True)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        try:
            outcome = "read" if check(sample, folder, options) else "refused"
            signal.setitimer(signal.ITIMER_PROF, 0)
            check_nothing_left(temporary)
            assert not unraisable, unraisable
        except Exception:
            outcome = "FAULT"
            signal.setitimer(signal.ITIMER_PROF, 0)
            keep(sample, kept / f"{sample.kind}-{seed}-{number}", options)
            for path in folder.iterdir():
                path.unlink()
        if outcome == "FAULT" or number % 100 == 0:
            gc.collect()
        found[sample.kind, outcome] += 1
    faulthandler.cancel_dump_traceback_later()
    counts.put(found)


def keep(sample: Sample, place: Path, options: dict[str, Any]) -> None:
    """Keep an input that broke the promise, and how."""
    place.mkdir(parents=True)
    for name, data in sample.files.items():
        (place / name).write_bytes(data)
    text = f"opened: {sample.opened}, options: {options}\n\n{traceback.format_exc()}"
    (place / "traceback.txt").write_text(text)


def _too_slow(*_: object) -> None:
    raise TimeoutError(f"took more than {SECONDS} s of processor time")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kept", type=Path, help="folder for inputs that break the promise")
    given = parser.parse_args()
    kept = given.kept or Path(tempfile.mkdtemp(prefix="fuzzing-"))
    deadline, seed, deaths = time.time() + given.seconds, given.seed, 0
    total: Counter[tuple[str, str]] = Counter()
    processes = multiprocessing.get_context("spawn")
    while time.time() < deadline:
        with tempfile.TemporaryDirectory() as work:
            counts = processes.SimpleQueue()
            child = processes.Process(
                target=run_round, args=(seed, deadline, Path(work), kept, counts)
            )
            child.start()
            child.join()
            if child.exitcode == 0:
                total += counts.get()
            else:
                deaths += 1
                with suppress(OSError):
                    Path(work, "input").rename(kept / f"died-{seed}")
        seed += 1
    for (kind, outcome), count in sorted(total.items()):
        print(f"{kind:<16}{outcome:>10}{count:>10}")
    faults = sum(count for (_, outcome), count in total.items() if outcome == "FAULT")
    print(f"\n{total.total()} inputs, {faults} faults, {deaths} processes died; see {kept}")
    return min(faults + deaths, 1)


if __name__ == "__main__":
    sys.exit(main())
