"""Places of real logs on maps of them: ``python benchmarks/evidence.py``.

Each log is mapped with its corrected poses as odometry; local maps of 5 m of way, one each 1.3 m,
are looked for without a guess on the map of the whole log, on that of its even scans alone, and on
the map of another log, which shows another building. A place is right within 0.3 m and 3° of where
the same log's poses put it. ``--fit`` counts instead what `lineament.mapping.evidence` has as
`OF_MAPS`, by the first halves of three logs.
"""

from __future__ import annotations

import argparse
import math
import os
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import lineament as ln
from lineament.logs import open_log
from lineament.mapping import VERDICTS, LineMap, LocalMap, Query, locate
from lineament.mapping.drive_map import Drive
from lineament.mapping.evidence import OF_MAPS
from lineament.mapping.making import make_map
from lineament.scan.poses import compose, relative

DATA = Path(os.environ.get("LINEAMENT_DATA", "../shared/data"))
LOGS = {
    "ACES": "carmen/aces-corrected.log.gz",
    "fr079": "truth/fr079_graph.npz",
    "CSAIL": "carmen/csail-corrected.log.gz",
    "Intel lab": "truth/intel_graph.npz",
    "Acapulco": "carmen/acapulco-corrected.log.gz",
    "Killian": "graph/killian.g2o.zip",
}
#: Logs by whose first halves constants are chosen.
FITTED = "ACES", "fr079", "CSAIL"
#: Way of a local map, and between two of them; a gap in a log [m].
WAY, STEP, GAP = 5.0, 1.3, 2.0
#: A place is right within [m, rad].
RIGHT = 0.3, math.radians(3)


class Place(NamedTuple):
    """What is looked for, and where it is on the map of the whole log, and of half of it."""

    query: Query
    whole: tuple[float, float, float]
    half: tuple[float, float, float]


def mapped(scans: list[ln.LaserScan]) -> tuple[LineMap, list[tuple[float, float, float]]]:
    """Return the map of scans, and their poses on it."""
    drive, extract = Drive(), ln.Extractor()
    for scan in scans:
        drive.add(scan, extract(scan), scan.pose)
    made = make_map(drive.frames, drive.scans)
    return made.map, made.poses


def surveyed(scans: list[ln.LaserScan]) -> tuple[LineMap, LineMap, list[Place]]:
    """Return the maps of a whole log and of its even scans, and its places."""
    whole, at = mapped(scans)
    half, of_even = mapped(scans[::2])
    extract, found, since, last = ln.Extractor(), [], 0.0, scans[0].pose
    tracker, local = ln.Tracker(), LocalMap(WAY)
    for k, scan in enumerate(scans):
        way = math.dist(scan.pose[:2], last[:2])
        if way > GAP:
            tracker, local, since = ln.Tracker(), LocalMap(WAY), 0.0
        features = extract(scan)
        local.add(features, tracker(features, scan.pose), scan.pose)
        since, last = since + min(way, GAP), scan.pose
        if since > STEP and local.way_seen > 2.0:
            since = 0.0
            beside = compose(of_even[k // 2], relative(at[2 * (k // 2)], at[k]))
            found.append(Place(local.query(), at[k], beside))
    return whole, half, found


def looked_for(place: Query, truth, plan: LineMap) -> tuple[float, ...]:
    """Return the verdict, whether the best pose is right, and the shares of the beams there."""
    where = locate(place, plan)
    x, y, turn = (9.0, 9.0, 9.0) if truth is None else relative(truth, where.pose)
    of = where.evidence
    right = math.hypot(x, y) < RIGHT[0] and abs(turn) < RIGHT[1]
    return VERDICTS.index(where.verdict), right, of.explained, of.short, of.contradicted


def judged(places, truths, plan) -> np.ndarray:
    return np.array([looked_for(p.query, t, plan) for p, t in zip(places, truths, strict=True)])


def report(logs: dict[str, tuple[LineMap, LineMap, list[Place]]]) -> None:
    print("| log | map | places | best pose right | located, right | ambiguous | false |")
    print("|---|---|--:|--:|--:|--:|--:|", flush=True)
    names = list(logs)
    for k, (name, (whole, half, found)) in enumerate(logs.items()):
        maps = [
            ("the whole log", whole, [p.whole for p in found]),
            ("its even scans", half, [p.half for p in found]),
        ]
        if len(names) > 1:
            other = names[(k + 1) % len(names)]
            maps.append((f"of {other}", logs[other][0], [None] * len(found)))
        for about, plan, truths in maps:
            rows = judged(found, truths, plan)
            located, right = rows[:, 0] == 0, rows[:, 1] > 0
            shares = (right, located & right, rows[:, 0] == 1)
            cells = " | ".join(f"{100 * of.mean():.1f} %" for of in shares)
            print(f"| {name} | {about} | {len(rows)} | {cells} | {(located & ~right).sum()} |",
                  flush=True)  # fmt: skip


def fit(logs: dict[str, tuple[LineMap, LineMap, list[Place]]]) -> None:
    """Print shares of the beams at right poses, and at the best ones on plans of other places."""
    right, wrong = [], []
    for k, name in enumerate(FITTED):
        whole, half, found = logs[name]
        found = found[: len(found) // 2]
        for plan, truths in ((whole, [p.whole for p in found]), (half, [p.half for p in found])):
            right.append(judged(found, truths, plan))
        other = logs[FITTED[(k + 1) % len(FITTED)]][0]
        wrong.append(judged(found, [None] * len(found), other))
    # Each log counts alike.
    at_right = np.mean([rows[rows[:, 1] > 0, 2:].mean(axis=0) for rows in right], axis=0)
    at_wrong = np.mean([rows[:, 2:].mean(axis=0) for rows in wrong], axis=0)
    print(f"right {at_right.round(3)}, best wrong {at_wrong.round(3)}; now {OF_MAPS}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fit", action="store_true", help="count the constants of the evidence")
    parser.add_argument("--log", action="append", choices=LOGS, help="these logs alone")
    chosen = parser.parse_args()
    names = FITTED if chosen.fit else chosen.log or LOGS
    logs = {}
    for name in names:
        if (path := DATA / LOGS[name]).exists():
            scans = list(open_log(path))
            logs[name] = surveyed(scans)
    (fit if chosen.fit else report)(logs)


if __name__ == "__main__":
    main()
