"""Places of real logs on maps of them: ``python benchmarks/evidence.py``.

Each log is mapped with its corrected poses as odometry; local maps of 5 m of way, one each 1.3 m,
are looked for without a guess on the map of the whole log, on that of its even scans alone, and on
the map of another log, which shows another building. A place is right within 0.3 m and 3° of where
the log's poses put it beside a scan of the map: that which was taken then, or the nearest, as parts
of a map may show the same rooms.
``--fit`` counts instead what `lineament.mapping.evidence` has of maps, by the first halves of three
logs.
"""

from __future__ import annotations

import argparse
import math
import os
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from mapping import drive
from recordings import DATA, logs

import lineament as ln
from lineament.logs import open_log
from lineament.mapping import VERDICTS, LineMap, LocalMap, Query, locate
from lineament.mapping.evidence import OF_MAPS, RIGHT_ON_MAP, WRONG_ON_MAP, evidence_of
from lineament.mapping.locate import _TIGHT as TIGHT
from lineament.mapping.locate import voted
from lineament.mapping.making import make_map
from lineament.scan import Pose
from lineament.scan.poses import compose, relative

#: The map of another log is that of the next one.
LOGS = logs("ACES", "fr079", "CSAIL", "Intel lab", "Acapulco", "Killian")
#: Logs by whose first halves constants are chosen.
FITTED = "ACES", "fr079", "CSAIL"
#: Way of a local map, and between two of them; a gap in a log [m].
WAY, STEP, GAP = 5.0, 1.3, 2.0
#: A place is right within [m, rad].
RIGHT = 0.3, math.radians(3)
#: A pose that is farther from a place is elsewhere [m].
ELSEWHERE = 1.0


class Place(NamedTuple):
    """What is looked for, and where it is by its log."""

    query: Query
    pose: Pose
    scan: int


class Mapped(NamedTuple):
    """A map of every so many scans of a log, and their poses: on it, and by the log."""

    plan: LineMap
    poses: list[Pose]
    logged: list[Pose]
    every: int

    def expected(self, place: Place, found: Pose) -> list[Pose]:
        """Return where a place is on the map beside its scan, and beside the nearest to one found.

        A map may show the same rooms twice, in two parts or where a loop is not closed; passes of
        a log through the same rooms are off by up to a metre.
        """
        beside = min(place.scan // self.every, len(self.poses) - 1), nearest(self.poses, found)
        return [compose(self.poses[k], relative(self.logged[k], place.pose)) for k in beside]


def nearest(poses: list[Pose], to: Pose) -> int:
    return int(np.hypot(*(np.array(poses)[:, :2] - to[:2]).T).argmin())


def mapped(scans: list[ln.LaserScan], every: int = 1) -> Mapped:
    scans = scans[::every]
    found = drive(scans, odometry=True)
    made = make_map(found.frames, found.scans)
    return Mapped(made.map, made.poses, [scan.pose for scan in scans], every)


def surveyed(scans: list[ln.LaserScan]) -> tuple[Mapped, Mapped, list[Place]]:
    """Return the maps of a whole log and of its even scans, and its places."""
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
            found.append(Place(local.query(), scan.pose, k))
    return mapped(scans), mapped(scans, 2), found


def looked_for(place: Place, on: Mapped) -> tuple[float, ...]:
    """Return the verdict, whether the best pose is right, and the shares of the beams there."""
    where = locate(place.query, on.plan)
    off = [relative(pose, where.pose) for pose in on.expected(place, where.pose)]
    right = any(math.hypot(x, y) < RIGHT[0] and abs(turn) < RIGHT[1] for x, y, turn in off)
    of = where.evidence
    return VERDICTS.index(where.verdict), right, of.explained, of.short, of.contradicted


def judged(places: list[Place], on: Mapped, *, is_there: bool = True) -> np.ndarray:
    rows = np.array([looked_for(place, on) for place in places])
    rows[:, 1] *= is_there
    return rows


def report(logs: dict[str, tuple[Mapped, Mapped, list[Place]]]) -> None:
    print("| log | map | places | best pose right | located, right | ambiguous | false |")
    print("|---|---|--:|--:|--:|--:|--:|", flush=True)
    names = list(logs)
    for k, (name, (whole, half, found)) in enumerate(logs.items()):
        maps = [("the whole log", whole, True), ("its even scans", half, True)]
        if len(names) > 1:
            other = names[(k + 1) % len(names)]
            maps.append((f"of {other}", logs[other][0], False))
        for about, on, is_there in maps:
            rows = judged(found, on, is_there=is_there)
            located, right = rows[:, 0] == 0, rows[:, 1] > 0
            shares = (right, located & right, rows[:, 0] == 1)
            cells = " | ".join(f"{100 * of.mean():.1f} %" for of in shares)
            print(f"| {name} | {about} | {len(rows)} | {cells} | {(located & ~right).sum()} |",
                  flush=True)  # fmt: skip


def fit(logs: dict[str, tuple[Mapped, Mapped, list[Place]]]) -> None:
    """Print shares of the beams at right poses, and at the best ones on plans of other places.

    And those where the log says that a place is, and at all poses that are tried elsewhere.
    """
    right, wrong, there, tried = [], [], [], []
    for k, name in enumerate(FITTED):
        whole, half, found = logs[name]
        found = found[: len(found) // 2]
        right += [judged(found, on) for on in (whole, half)]
        wrong.append(judged(found, logs[FITTED[(k + 1) % len(FITTED)]][0], is_there=False))
        both = np.array([elsewhere(place, whole) for place in found])
        there.append(both[:, 0])
        tried.append(both[:, 1])
    # Each log counts alike.
    at_right = np.mean([rows[rows[:, 1] > 0, 2:].mean(axis=0) for rows in right], axis=0)
    at_wrong = np.mean([rows[:, 2:].mean(axis=0) for rows in wrong], axis=0)
    print(f"right {at_right.round(3)}, best wrong {at_wrong.round(3)}; now {OF_MAPS}")
    of_log, of_tried = (
        np.mean([of.mean(axis=0) for of in rows], axis=0) for rows in (there, tried)
    )
    now = RIGHT_ON_MAP, WRONG_ON_MAP
    print(f"of the log {of_log.round(3)}, tried elsewhere {of_tried.round(3)}; now {now}")


def elsewhere(place: Place, on: Mapped) -> tuple[np.ndarray, np.ndarray]:
    """Return the shares of the beams where the log puts a place, and at poses tried elsewhere."""
    k = nearest(on.logged, place.pose)
    here = compose(on.poses[k], relative(on.logged[k], place.pose))
    poses = voted(place.query.anchors, place.query, on.plan)
    far = poses[np.hypot(*(poses[:, :2] - here[:2]).T) > ELSEWHERE]
    return tuple(
        evidence_of(of, place.query.beams, on.plan.index, TIGHT)[:, 1:].mean(axis=0)
        for of in (np.array([here]), far)
    )


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
