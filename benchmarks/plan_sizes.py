"""How long a plan takes to make, and a query to locate on it: ``python benchmarks/plan_sizes.py``.

Storeys of growing size whose rooms differ; local maps of 3 m of way, without a guess, on the plan
of their storey. A plan is made when it knows its corners, what votes for poses, and the directions
of its walls. Processor time: medians over three plans of the same lines, and over the queries.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from itertools import pairwise

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import lineament as ln
from lineament.mapping import LineMap, LocalMap, Query, locate
from lineament.simulation import SENSORS, Building, drive, office

SIZES = ((55.0, 40.0), (105.0, 75.0), (250.0, 170.0), (300.0, 300.0))
#: Way of a local map, and between two of them [m].
WAY, STEP = 3.0, 1.5
#: A place is right within [m, rad].
RIGHT = 0.2, math.radians(1)


def queries(storey: Building, count: int) -> list[tuple[Query, tuple[float, float, float]]]:
    """Return local maps along the way through a storey, and where they are."""
    extract, tracker, local = ln.Extractor(), ln.Tracker(), LocalMap(WAY, roughness=0.0)
    scans = drive(storey.world, storey.waypoints, SENSORS["utm30lx"], rate=5.0, seed=1)
    found, since = [], -WAY
    for before, scan in pairwise(scans):
        features = extract(scan)
        local.add(features, tracker(features, scan.pose), scan.pose)
        since += math.dist(before.pose[:2], scan.pose[:2])
        if since > STEP:
            since = 0.0
            found.append((local.query(), scan.pose))
            if len(found) == count:
                break
    return found


def made(storey: Building) -> tuple[LineMap, float]:
    """Return the plan of a storey, and how long it takes to make [ms]."""
    started = time.thread_time()
    plan = LineMap.from_lines(storey.plan.segments, side=1)
    _ = plan.corners, plan.anchors, plan.spectrum, plan.index
    return plan, 1e3 * (time.thread_time() - started)


def row(size: tuple[float, float], count: int, seed: int) -> str:
    """Return a row of the table: lines, the plan's time, and those of queries on it."""
    storey = office(seed, size, identical=0.0)
    plans, making = zip(*(made(storey) for _ in range(3)), strict=True)
    spent, right, false = [], 0, 0
    for query, pose in queries(storey, count):
        started = time.thread_time()
        where = locate(query, plans[0])
        spent.append(1e3 * (time.thread_time() - started))
        turn = abs(math.remainder(where.pose[2] - pose[2], 2 * math.pi))
        is_right = math.dist(where.pose[:2], pose[:2]) < RIGHT[0] and turn < RIGHT[1]
        right += bool(where) and is_right
        false += bool(where) and not is_right
    middle, most = np.quantile(spent, (0.5, 0.95))
    return (
        f"| {size[0]:g} m × {size[1]:g} m | {len(plans[0].walls):,} | {np.median(making):.0f} ms "
        f"| {middle:.0f} ms | {most:.0f} ms | {right} of {len(spent)} | {false} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--queries", type=int, default=60, help="on each plan")
    parser.add_argument("--seed", type=int, default=3)
    chosen = parser.parse_args()
    print("| storey | lines | plan made in | a query | of 95 % at most | located, right | false |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    for size in SIZES:
        print(row(size, chosen.queries, chosen.seed), flush=True)


if __name__ == "__main__":
    main()
