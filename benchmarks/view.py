"""What `view` costs on a long log: reading it, memory, and any scan of it once it is read.

`python benchmarks/view.py`: as many scans as the Intel log has, of 1081 beams.
"""

from __future__ import annotations

import resource
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from lineament import Extractor
from lineament.logs import open_log, save_npz
from lineament.scan import LaserScan
from lineament.simulation import SENSORS, simulate_log
from lineament.view import Session
from lineament.view.api import answer
from lineament.view.store import ScanStore

SCANS = 13631
ASKED = 200


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        drive, log = Path(folder, "drive.npz"), Path(folder, "log.npz")
        simulate_log(drive, "building", SENSORS["utm30lx"], rate=4.0, seed=1)
        some = list(open_log(drive))
        save_npz(log, (some[k % len(some)] for k in range(SCANS)))
        print(f"{SCANS} scans of {len(some[0])} beams, {log.stat().st_size / 1e6:.0f} MB on disk")
        _measure_store(some)
        _measure_answers(log)


def _measure_store(some: list[LaserScan]) -> None:
    def items(count: int) -> Iterator[tuple[str, LaserScan]]:
        return (("scan", some[k % len(some)]) for k in range(count))

    for count in (SCANS, 4 * SCANS):
        with closing(ScanStore(lambda: ())) as store:
            started = time.perf_counter()
            store.fill(items(count))
            seconds = time.perf_counter() - started
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(f"kept {count}: {seconds:.1f} s, {count / seconds:.0f}/s, peak {peak:.0f} MB")


def _measure_answers(log: Path) -> None:
    with Session(log, {"optimal": Extractor("optimal")}) as session:
        started = time.perf_counter()
        session.wait()
        print(f"log read: {time.perf_counter() - started:.1f} s")
        answer(session, "/api/scan?log=0&i=0&method=optimal")  # the kernels are ready then
        rng = np.random.default_rng(1)
        for what, beam in (("scan", ""), ("trace", "&beam=500")):
            times = []
            for index in rng.integers(SCANS, size=ASKED):
                started = time.perf_counter()
                answer(session, f"/api/{what}?log=0&i={index}&method=optimal{beam}")
                times.append(1e3 * (time.perf_counter() - started))
            middle, late = statistics.median(times), statistics.quantiles(times, n=10)[-1]
            print(f"/api/{what}: median {middle:.1f} ms, nine of ten within {late:.1f} ms")
        started, step = time.perf_counter(), -(-SCANS // 400)
        size = sum(
            len(answer(session, f"/api/drive?log=0&first={first}&step={step}&count=32"))
            for first in range(0, SCANS, 32 * step)
        )
        print(f"the drive: {time.perf_counter() - started:.2f} s, {size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
