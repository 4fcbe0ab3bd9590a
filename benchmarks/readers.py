"""Scans per second that the readers of logs reach. Run: python benchmarks/readers.py."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from lineament.logs import open_log
from lineament.reproduce.report import machine

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import ros_bags

KINDS = ("mcap", "mcap-lz4", "mcap-zstd", "mcap-plain", "sqlite3", "rosbag1", "rosbag1-lz4")


def write(folder: Path, kind: str, scans: int, beams: int, intensities: bool) -> Path:
    """Write a bag of scans that differ, with the usual size of chunks."""
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    rng = np.random.default_rng(1)
    step = 1.5 * np.pi / beams
    ranges = np.round(rng.uniform(0.5, 30.0, beams), 3)

    def items():
        for i in range(scans):
            distances = ranges + 0.001 * (i % 50)
            strengths = 100 * ranges if intensities else ()
            scan = messages.scan(i / 40, distances, strengths, angle_increment=step)
            yield "/scan", i * 25_000_000, scan

    return ros_bags.write_bag(folder / f"{kind}{ros_bags.ending(kind)}", kind, items())


def rate(path: Path, repetitions: int) -> float:
    """Scans per second of processor time through open_log, of the fastest reading."""
    rates = []
    for _ in range(repetitions):
        started = time.process_time()
        count = sum(1 for _ in open_log(path))
        rates.append(count / (time.process_time() - started))
    return max(rates)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=10_000)
    parser.add_argument("--beams", type=int, default=1081)
    parser.add_argument("--repetitions", type=int, default=5)
    given = parser.parse_args()
    ros_bags.CHUNK = 1 << 20
    print(f"{machine()}; {given.scans} scans of {given.beams} beams, fastest of")
    print(f"{given.repetitions} readings by `for scan in open_log(path)`; processor time, one core")
    print(f"\n{'scans/s':<12}{'ranges':>10}{'+ intensities':>16}")
    for kind in KINDS:
        rates = []
        for intensities in (False, True):
            with tempfile.TemporaryDirectory() as folder:
                path = write(Path(folder), kind, given.scans, given.beams, intensities)
                rates.append(rate(path, given.repetitions))
        print(f"{kind:<12}{rates[0]:>10.0f}{rates[1]:>16.0f}", flush=True)


if __name__ == "__main__":
    main()
