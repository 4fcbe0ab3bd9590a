"""The figures of the README's speed table. Run: make bench."""

from __future__ import annotations

import argparse
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
import numpy as np
from lineament_lab.reproduce.machine import machine
from recordings import DATA

import lineament as ln
from lineament.simulation import SENSORS, building, drive
from lineament.tasks.extract import extract_log


def median_seconds(call: Callable[[], object], least: float = 0.2, repetitions: int = 7) -> float:
    """Median over repetitions of the mean time of a call, each at least `least` seconds."""
    call()
    started = time.perf_counter()
    call()
    loops = max(1, round(least / max(time.perf_counter() - started, 1e-7)))
    times = []
    for _ in range(repetitions):
        started = time.perf_counter()
        for _ in range(loops):
            call()
        times.append((time.perf_counter() - started) / loops)
    return statistics.median(times)


def scans_of(sensor: str) -> list[ln.LaserScan]:
    world, waypoints = building()
    return list(drive(world, waypoints, SENSORS[sensor], rate=0.4, seed=11))


def reference_filter(r, weights, sums, w, half_width, sigma_d, scale):  # type: ignore[no-untyped-def]
    """A bilateral filter in float64, by exp(-u) ≈ (1 - t + t²/2)^64, t = min(u, 48)/64.

    It takes 2.6 µs for 481 beams and 8 offsets on the machine from which the aims come: what it
    takes here tells how the two machines compare.
    """
    for k in range(1, half_width + 1):
        closeness = math.exp(-0.5 * (k / sigma_d) ** 2)
        for i in range(len(r) - k):
            d = r[i + k] - r[i]
            u = scale * d * d
            t = (u if u < 48.0 else 48.0) * (1.0 / 64.0)
            e = 1.0 - t * (1.0 - 0.5 * t)
            e = e * e
            e = e * e
            e = e * e
            e = e * e
            e = e * e
            w[i] = closeness * e * e
        for i in range(len(r) - k):
            weights[i] += w[i]
            sums[i] += w[i] * r[i + k]
        for i in range(len(r) - k):
            weights[i + k] += w[i]
            sums[i + k] += w[i] * r[i]


def reference_microseconds() -> float:
    compiled = numba.njit(nogil=True, error_model="numpy")(reference_filter)
    ranges = 3.0 + np.random.default_rng(0).normal(0.0, 0.01, 481)
    scratch = [np.zeros(481) for _ in range(3)]
    full = median_seconds(lambda: compiled(ranges, *scratch, 8, 4.0, 0.5 / 0.3**2))
    call = median_seconds(lambda: compiled(ranges, *scratch, 0, 4.0, 0.5 / 0.3**2))
    return 1e6 * (full - call)


def arithmetic(n: int) -> float:
    """Work that needs nothing but a processor: what workers can gain at all, here and now."""
    total = 0.0
    for i in range(n):
        total += (i * 0.5) % 3.0
    return total


def in_turns(calls: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Times of the calls, one after the other: the machine's moods meet all."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            started = time.perf_counter()
            call()
            times[name].append(time.perf_counter() - started)
    return times


def gain_of_two(one: Callable[[], object], two: Callable[[], object]) -> float:
    """Ratio of the median times of two calls."""
    first, second = map(statistics.median, in_turns({"one": one, "two": two}, 15).values())
    return first / second


def gain_of_the_machine() -> float:
    compiled = numba.njit(nogil=True)(arithmetic)
    compiled(1)
    with ThreadPoolExecutor(2) as pool:
        return gain_of_two(
            lambda: compiled(20_000_000), lambda: list(pool.map(compiled, [10_000_000] * 2))
        )


def microseconds(times: list[float], scans: int) -> str:
    """Median time of a scan, and that of the best tenth."""
    best, *_ = statistics.quantiles(times, n=10)
    return f"{1e6 * statistics.median(times) / scans:.1f} ({1e6 * best / scans:.1f}) µs"


def speed_of_method(method: str, sensor: str) -> tuple[int, str, str, float]:
    """Beams; time of a scan in the kernels and through the call; gain of a second thread."""
    scans = scans_of(sensor)
    extractor, first = ln.Extractor(method), scans[0]
    ranges = np.array([scan.ranges for scan in scans])
    rows = np.tile(ranges, (round(6e6 / ranges.size), 1))

    def batch(workers: int) -> object:
        return extractor.batch(
            rows,
            angle_min=first.angle_min,
            angle_increment=first.angle_increment,
            range_min=first.range_min,
            range_max=first.range_max,
            workers=workers,
        )

    block = extractor._new_block(first, len(scans))
    block.load(ranges)
    calls = {
        "kernels": lambda: extractor.method.run(block),
        "call": lambda: [extractor(scan) for scan in scans],
    }
    kernels, call = (microseconds(of, len(scans)) for of in in_turns(calls, 1500).values())
    gain = gain_of_two(lambda: batch(1), lambda: batch(2))
    return len(first), kernels, call, gain


def seconds_of(*arguments: str, **environment: str) -> float:
    """Median wall time of a fresh process."""
    times = []
    for _ in range(5):
        started = time.perf_counter()
        subprocess.run(
            [sys.executable, *arguments],
            env={**os.environ, **environment},
            check=True,
            capture_output=True,
        )
        times.append(time.perf_counter() - started)
    return statistics.median(times)


FIRST = """
import sys, time
start = time.perf_counter()
import lineament as ln
extract, ranges = ln.extract, [2.0] * 99
imported = time.perf_counter()
ln.extract(ranges, angle_min=0.0, angle_increment=0.01, method=sys.argv[1])
print(imported - start, time.perf_counter() - imported, time.process_time())
"""


def first_features(method: str = "optimal", **variables: str) -> tuple[float, float, float, float]:
    """Time of a process that finds features once; of its imports, of these; of the processor."""
    env = {name: value for name, value in os.environ.items() if name != "LINEAMENT_JIT"}
    start = time.perf_counter()
    run = [sys.executable, "-c", FIRST, method]
    ran = subprocess.run(run, env=env | variables, check=True, capture_output=True, text=True)
    whole = time.perf_counter() - start
    imports, features, processor = map(float, ran.stdout.split())
    return whole, imports, features, processor


def compile_seconds(method: str) -> float:
    """Processor time of the first scan where numba compiles the kernels, and has cached none."""
    with tempfile.TemporaryDirectory() as cache:
        return first_features(method, LINEAMENT_JIT="1", NUMBA_CACHE_DIR=cache)[3]


def start_up() -> list[tuple[str, str]]:
    runs = [first_features() for _ in range(9)]
    whole, imports, features, _ = map(statistics.median, zip(*runs, strict=True))
    return [
        ("first features of a new process, by the clock", f"{whole:.2f} s"),
        ("of these, imports", f"{imports:.2f} s"),
        ("of these, the first scan", f"{features:.3f} s"),
        *(
            (f"the same by {name}, compiled by numba, processor", f"{compile_seconds(name):.1f} s")
            for name in ("optimal", "liu")
        ),
        ("float64 filter for reference (2.6 µs elsewhere)", f"{reference_microseconds():.1f} µs"),
        ("`lineament --help`", f"{1e3 * seconds_of('-m', 'lineament', '--help'):.0f} ms"),
    ]


def throughput() -> list[tuple[str, str]]:
    log = DATA / "carmen" / "intel-corrected.log.gz"
    if not log.exists():
        return [("Intel log to Parquet", f"not measured: no {log}")]
    extractor = ln.Extractor()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "features.parquet"
        rates = [(e := extract_log(log, out, extractor)).scans / e.seconds for _ in range(8)]
    return [
        (
            "Intel log to Parquet, in a process that has started",
            f"{statistics.median(rates):.0f} scans/s",
        ),
        ("the same, first in its process", f"{rates[0]:.0f} scans/s"),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", action="append", help="may be given again")
    methods = parser.parse_args().method or ["optimal", "liu"]
    print(f"Machine: {machine()}\n")
    rates = throughput()
    print("| method | beams | in the kernels | `Extractor.__call__` | `batch`, 2 threads |")
    print("|---|---|---|---|---|")  # times: median (best tenth)
    for method in methods:
        for sensor in ("paper", "utm30lx"):
            beams, kernels, call, gain = speed_of_method(method, sensor)
            print(f"| `{method}` | {beams} | {kernels} | {call} | {gain:.2f} × |")
    print(f"| arithmetic alone | | | | {gain_of_the_machine():.2f} × |")
    print("\n| | |\n|---|---|")
    for name, value in [*start_up(), *rates]:
        print(f"| {name} | {value} |")


if __name__ == "__main__":
    main()
