"""How fast a map is made while its scans come, on one core: ``python benchmarks/live_mapping.py``.

A simulated storey with people and wheels that slip. Scans come at their rate, or with ``--no-wait``
as fast as they are taken; the process that closes loops runs on the same core.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from itertools import islice

import numpy as np

from lineament import Extractor
from lineament.mapping.mapper import Mapper
from lineament.scan.poses import relative
from lineament.simulation import SENSORS, Wheels, office


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--size", type=float, nargs=2, default=(60.0, 40.0), metavar="M")
    parser.add_argument("--rate", type=float, default=40.0, help="scans in a second")
    parser.add_argument("--scans", type=int, default=4000)
    parser.add_argument("--people", type=int, default=8)
    parser.add_argument("--no-wait", action="store_true")
    chosen = parser.parse_args()
    building = office(chosen.seed, tuple(chosen.size))
    scans, truth = building.drive(
        SENSORS["utm30lx"],
        seed=chosen.seed,
        rate=chosen.rate,
        people=chosen.people,
        wheels=Wheels(),
    )
    scans = list(islice(scans, chosen.scans))
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    extract, mapper, taken, off, drafts = Extractor(), Mapper(), [], [], set()
    extract(scans[0])
    began = time.perf_counter()
    for k, scan in enumerate(scans):
        if not chosen.no_wait:
            time.sleep(max(began + k / chosen.rate - time.perf_counter(), 0.0))
        at = time.perf_counter()
        where = mapper.step(extract(scan), scan.pose)
        taken.append(1e3 * (time.perf_counter() - at))
        off.append(math.dist(where.pose[:2], relative(truth[0], truth[k])[:2]))
        drafts.add(mapper.draft and mapper.draft.frames)
    seconds = time.perf_counter() - began
    p50, p99, most = np.quantile(taken, (0.5, 0.99, 1.0))
    print(
        f"{len(scans)} scans of {len(scans[0])} beams, {len(mapper.drive.frames)} key frames, "
        f"{len(scans) / seconds:.0f} scans/s; a scan takes {p50:.2f} ms, 99 % at most "
        f"{p99:.1f} ms, all {most:.1f} ms; {len(drafts - {None})} drafts; live poses are off by "
        f"{np.median(off):.3f} m, at most {max(off):.3f} m"
    )
    at = time.perf_counter()
    made = mapper.finish()
    print(f"{made.map}, {made.parts.count} part(s), made in {time.perf_counter() - at:.1f} s")


if __name__ == "__main__":
    main()
