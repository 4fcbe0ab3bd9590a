"""Time of the kernels against those of another commit, in turns: the same scans, two processes.

Run: python benchmarks/against.py [--commit f90e5f6] [--than liu]. By default it is `liu` of commit
f90e5f6, on which the aims of speed are set. The commit's own source is compiled by numba, in
``build/against``; it needs the whole history.
"""

from __future__ import annotations

import argparse
import io
import os
import pickle
import statistics
import subprocess
import sys
import tarfile
import time
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from recordings import DATA

ROOT = Path(__file__).parents[1]
SENSORS = ("paper", "utm30lx", "noisy", "rplidar", "lms361")
#: Of each log so many scans are taken, spread over its first ones.
LOGS = (
    "carmen/intel-corrected.log.gz", "carmen/csail-corrected.log.gz",
    "carmen/aces-corrected.log.gz", "carmen/acapulco-corrected.log.gz", "graph/killian.g2o.zip",
    "truth/fr079_graph.npz", "truth/jackal_mocap_02171554.npz", "truth/jackal_static_data.npz",
    "rosbag2/ld19", "text/csm_scans.json",
)  # fmt: skip
SCANS, STEP, ROUNDS, REPETITIONS = 60, 8, 15, 20


def scans_by_name() -> dict[str, tuple[dict[str, float], Any]]:
    """Bearings and limits, and ranges, by sensor and by log."""
    import lineament as ln
    from lineament.simulation import SENSORS as KNOWN
    from lineament.simulation import building, drive

    found = {}
    world, way = building()
    for name in SENSORS:
        found[name] = list(islice(drive(world, way, KNOWN[name], rate=0.4, seed=11), SCANS))
    for log in LOGS:
        if (DATA / log).exists():
            found[log] = list(islice(ln.open_log(DATA / log), 0, SCANS * STEP, STEP))
    sets = {}
    for name, scans in found.items():
        first = scans[0]
        fields = ("angle_min", "angle_increment", "range_min", "range_max")
        rows = [scan.ranges for scan in scans if len(scan) == len(first)]
        sets[name] = {field: getattr(first, field) for field in fields}, np.array(rows)
    return sets


def serve(path: Path) -> None:
    """Answer each line "method name" by the least time of a scan in the kernels [µs]."""
    import lineament as ln

    sets, blocks = pickle.loads(path.read_bytes()), {}
    for line in sys.stdin:
        method, name = key = tuple(line.split())
        if key not in blocks:
            fields, rows = sets[name]
            extractor = ln.Extractor(method)
            first = ln.LaserScan(rows[0], **fields)
            block = extractor._new_block(first, len(rows))
            block.load(rows)
            extractor.method.run(block)
            blocks[key] = extractor, block
        extractor, block = blocks[key]
        times = []
        for _ in range(REPETITIONS):
            started = time.thread_time_ns()
            extractor.method.run(block)
            times.append(time.thread_time_ns() - started)
        print(min(times) / len(sets[name][1]) / 1000, flush=True)


class Worker:
    """A process that measures the kernels of one tree."""

    def __init__(self, source: Path, sets: Path) -> None:
        command = [sys.executable, "-W", "ignore", __file__, "--serve", str(sets)]
        environment = os.environ | {"PYTHONPATH": str(source)}
        self._process = subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def time_of(self, method: str, name: str) -> float:
        """Least time of a scan [µs]."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(method, name, file=self._process.stdin, flush=True)
        return float(self._process.stdout.readline())


def source_of(commit: str) -> Path:
    """Return a folder with the package as it was at a commit."""
    folder = ROOT / "build" / "against" / commit
    if not folder.exists():
        made = subprocess.run(
            ["git", "archive", commit, "src"], cwd=ROOT, check=True, capture_output=True
        )
        with tarfile.open(fileobj=io.BytesIO(made.stdout)) as archive:
            archive.extractall(folder, filter="data")
    return folder / "src"


def main() -> None:
    """Print a table: µs of the other commit, and of each method the ratio to it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--commit", default="f90e5f6")
    parser.add_argument("--than", default="liu", help="the method of that commit")
    parser.add_argument("--methods", nargs="+", default=["optimal", "liu"])
    parser.add_argument("--serve", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve(given.serve)
        return
    before = source_of(given.commit)
    sets = scans_by_name()
    kept = ROOT / "build" / "against" / "scans.pickle"
    kept.write_bytes(pickle.dumps(sets))
    old, new = Worker(before, kept), Worker(ROOT / "src", kept)
    print(f"|scans|beams|{given.than} of {given.commit} [µs]|" + "|".join(given.methods) + "|")
    print("|---" * (3 + len(given.methods)) + "|")
    ratios: dict[str, list[float]] = {method: [] for method in given.methods}
    for name, (_, rows) in sets.items():
        times, shown = [], []
        for method in given.methods:
            rounds = [
                (old.time_of(given.than, name), new.time_of(method, name)) for _ in range(ROUNDS)
            ]
            times += [one for one, _ in rounds]
            ratios[method].append(statistics.median(two / one for one, two in rounds))
            shown.append(f"{ratios[method][-1]:.2f}")
        print(f"|{name}|{rows.shape[1]}|{statistics.median(times):.1f}|{'|'.join(shown)}|")
    print("|median|||" + "|".join(f"{statistics.median(r):.2f}" for r in ratios.values()) + "|")


if __name__ == "__main__":
    main()
