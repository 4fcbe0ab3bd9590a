"""Damaged logs of every format against what every reader promises.

Run for long: python tests/fuzzing.py --seconds 600. Each input is a small log of the project's own
writers, or the beginning of a recording in the folder LINEAMENT_DATA, that was damaged. The run
ends at the first input that breaks the promise, which is left in a folder.
"""

import argparse
import faulthandler
import gc
import os
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
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

#: Ways to open; what is wrong with the topic of poses must be one clear line too.
OPTIONS: tuple[dict[str, Any], ...] = (
    {},
    {"echo": "strongest"},
    {"echo": "last"},
    {"ring": 0},
    {"pose_topic": "/odom"},
    {"pose_topic": "/tf:odom->base"},
)


def check(sample: Sample, folders: tuple[Path, Path], options: dict[str, Any]) -> bool:
    """Read a log in every way there is; True if a scan came out.

    `folders` are those of `scratch`: the input stays in the first one until the next, and from the
    second one temporary files must go with their logs, and not wait for the collector.
    """
    folder, temporary = folders
    for path in folder.iterdir():
        path.unlink()
    for name, data in sample.files.items():
        (folder / name).write_bytes(data)
    path = folder / sample.opened
    count = 0
    for found in one_line_or(folder, lambda: find_logs(path), default=[str(path)]):
        for keep in (False, True):
            count += one_line_or(folder, lambda f=found, k=keep: read(f, k, options), default=0)
    left = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert left == sample.files, f"files changed: {sorted(sample.files)} are {sorted(left)}"
    assert not list(temporary.iterdir()), list(temporary.iterdir())
    return count > 0


def one_line_or(folder: Path, call: Any, default: Any) -> Any:
    """Call; a LogError gives the default, if it is one line that names a file in the folder."""
    try:
        return call()
    except LogError as error:
        line = str(error)
    assert line.isprintable(), repr(line)
    assert line.startswith(str(folder)), line
    return default


def read(path: str, keep_going: bool, options: dict[str, Any]) -> int:
    """Use all that a log offers; how many scans came out."""
    log = open_log(path, keep_going=keep_going, **options)
    assert len(log) >= 0
    assert all(isinstance(topic, Topic) for topic in log.contents())
    count = 0
    for topic, scan in log.items():
        check_scan(scan)
        assert topic in log.topics
        count += 1
    assert log.skipped == 0 or keep_going
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


def _too_slow(*_: object) -> None:
    raise TimeoutError(f"took more than {SECONDS} s of processor time")


def main() -> None:
    import resource  # There is none on Windows.

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as own:
        samples = own_samples(Path(own))
    if "LINEAMENT_DATA" in os.environ:
        samples += recorded_samples(Path(os.environ["LINEAMENT_DATA"]))
    folders = scratch(Path(tempfile.mkdtemp(prefix="fuzzing-")))
    print(f"an input that breaks the promise is left in {folders[0]}", flush=True)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    signal.signal(signal.SIGPROF, _too_slow)
    warnings.simplefilter("error")
    unraisable: list[Any] = []
    sys.unraisablehook = unraisable.append
    gc.disable()  # What only the collector would remove shows, as it comes only now and then.
    chance, counts = Random(given.seed), Counter[tuple[str, str]]()
    deadline = time.monotonic() + given.seconds
    while time.monotonic() < deadline:
        sample = mutated(chosen(samples, chance), samples, chance)
        faulthandler.dump_traceback_later(PATIENCE, exit=True)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        came = check(sample, folders, chance.choice(OPTIONS))
        signal.setitimer(signal.ITIMER_PROF, 0)
        assert not unraisable, unraisable
        counts[sample.kind, "read" if came else "refused"] += 1
        if counts.total() % 100 == 0:
            gc.collect()
    for (kind, outcome), count in sorted(counts.items()):
        print(f"{kind:<16}{outcome:>10}{count:>10}")
    print(f"\n{counts.total()} inputs, no fault")


if __name__ == "__main__":
    main()
