"""How soon the localiser of `lineament live --map` notices that it was carried away.

A robot drives through simulated storeys among people, with furniture that the plan does not have,
or has elsewhere. Each 30 s it is carried to another place of its way, at least 2 m off, unnoticed
by its wheels, and drives on there. `Localiser` hears its odometry and its scans as in the node.
Counted are, of each time that it was located rightly before: the seconds until the status is not
"located" any more, or is so at the new place, and until it is that; and transforms that are
published after it and are wrong, by 0.3 m or 3°. The robot may have been put down just behind a
scan: the first scan of the new place counts as one period after it.

With ``--real``, real logs are followed on grids of maps of themselves, with their poses as
odometry: as they are, and in pieces of 25 to 60 scans, each somewhere else. With ``--agreement``,
scans of real logs are compared with the next one, by the log's poses, and with one elsewhere.
"""

import argparse
import math
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import chain, pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from evidence import LOGS, mapped
from judging import SOON, drive_through, on_plans
from recordings import DATA

import lineament as ln
from lineament.live import Frame, LiveConfig
from lineament.live.localiser import Localiser
from lineament.live.plan_topics import statuses
from lineament.live.received import LINKS, MOUNTINGS
from lineament.logs import open_log
from lineament.mapping import LineMap
from lineament.mapping.consistency import agreement
from lineament.mapping.following import Follower
from lineament.rosmsg.poses import StampedPose
from lineament.scan import LaserScan, Pose
from lineament.scan.poses import compose, relative
from lineament.simulation import Building

#: The robot is carried away each so many seconds, so far at least [m].
EACH, FAR = 30.0, 2.0
#: A transform that places the robot so far off is wrong [m, rad].
WRONG = 0.3, math.radians(3)
HERE = (0.0, 0.0, 0.0)


class Found(NamedTuple):
    """What is counted of one kidnapping; times are infinite where it did not happen [s]."""

    plan: str
    noticed: float
    wrong: int
    last_wrong: float
    again: float


class Driven(NamedTuple):
    """A scan, what its wheels say, and where it was taken."""

    scan: LaserScan
    wheels: Pose
    truth: Pose


def kidnapped(seed: int, sensor: str, rate: float, times: int) -> list[Found]:
    """Carry a robot away in one storey, on two plans of it."""
    drives = (_kidnapped(*of_plan, seed, sensor, rate, times) for of_plan in on_plans(seed))
    return list(chain.from_iterable(drives))


def _kidnapped(
    building: Building, name: str, plan: LineMap, seed: int, sensor: str, rate: float, times: int
) -> Iterator[Found]:
    scans, truth = drive_through(building, seed, sensor, rate, moving=True)
    way = [Driven(scan, scan.pose, true) for scan, true in zip(scans, truth, strict=True)]
    rng, n = np.random.default_rng([seed, 79]), round(EACH * rate)
    robot, at, was_right = Robot(plan), -1, False
    for _ in range(times + 1):
        before, at = way[at].truth, int(rng.integers(len(way) - n))
        while math.dist(before[:2], way[at].truth[:2]) < FAR:
            at = int(rng.integers(len(way) - n))
        noticed = again = math.inf
        wrong, last_wrong, counts = 0, 0.0, was_right
        robot.lift(way[at].wheels)
        for k in range(n):
            driven = way[at]
            is_located, sent = robot.see(driven, rate)
            is_right = sent is not None and not _is_wrong(sent, driven.truth)
            after = (k + 1) / rate
            if sent is not None and not is_right:
                wrong, last_wrong = wrong + 1, after
            if is_right or not is_located:
                noticed = min(noticed, after)
            if is_right and is_located:
                again = min(again, after)
            was_right, at = is_located and is_right, at + 1
        at -= 1
        if counts:
            yield Found(name, noticed, wrong, last_wrong, again)


def _is_wrong(pose: Pose, truth: Pose) -> bool:
    x, y, turn = relative(truth, pose)
    return math.hypot(x, y) > WRONG[0] or abs(turn) > WRONG[1]


class Robot:
    """A localiser, and what it hears of a robot whose wheels do not notice that it is lifted."""

    def __init__(self, plan: LineMap) -> None:
        extract = ln.Extractor()
        self._config, self._extract = LiveConfig(map="plan.dxf"), extract
        self._localiser = Localiser(self._config, plan, extract)
        self._localiser.hear([StampedPose(0.0, "base_link", "laser", HERE)], MOUNTINGS)
        self._believed, self._wheels, self._scans = HERE, HERE, 0

    def lift(self, wheels: Pose) -> None:
        """Put it down where its wheels, had it driven there, would say this."""
        self._wheels = wheels

    def see(self, driven: Driven, rate: float) -> tuple[bool, Pose | None]:
        """Drive to the next scan; return the status, and where the transform places the robot."""
        self._believed = compose(self._believed, relative(self._wheels, driven.wheels))
        self._wheels, self._scans = driven.wheels, self._scans + 1
        stamp = 1_000_000_000_000 + round(1e9 * self._scans / rate)
        scan = driven.scan.with_pose(None).stamped("first", stamp)
        link = StampedPose(stamp / 1e9, "odom", "base_link", self._believed)
        self._localiser.hear([link], LINKS)
        features = self._extract(scan)
        where, placed, _ = self._localiser(features, scan, scan)
        status, *_ = statuses(Frame(scan, scan, features, None, where=where), self._config)
        is_sent = placed is not None and placed.odom is not None
        sent = compose(placed.odom, self._believed) if is_sent else None
        return where.verdict == "located" and status.level < 2, sent


def real(name: str) -> str:
    """Follow a log on the grid of its map, as it is and carried away; return a row of the table."""
    scans = [scan for scan in open_log(DATA / LOGS[name]) if scan.pose is not None]
    made = mapped(scans)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "map.yaml"
        made.plan.write(path)
        plan = LineMap.read(path)
    extract, rng = ln.Extractor(), np.random.default_rng(5)
    features = [extract(scan) for scan in scans]
    cells = [name]
    for carried in (False, True):
        order = (
            list(in_pieces(made.poses, rng)) if carried else [(k, False) for k in range(len(scans))]
        )
        follower, believed, verdicts, kidnapped = Follower(plan), HERE, [], []
        is_counted = was_right = False
        for i, (k, is_carried) in enumerate(order):
            if i and not is_carried:
                believed = compose(believed, relative(scans[order[i - 1][0]].pose, scans[k].pose))
            where = follower(replace(features[k], stamp=0.5 * i), believed)
            is_right = not _is_wrong(where.pose, made.poses[k])
            lies = where.is_known and not is_right
            if is_carried:
                is_counted = was_right
                if is_counted:
                    kidnapped.append([not lies, True])
            if is_counted and lies:
                kidnapped[-1][1] = False
            was_right = bool(where) and is_right
            verdicts.append((bool(where), bool(where) and not is_right))
        located, wrong = np.mean(verdicts, axis=0)[0], np.sum(verdicts, axis=0)[1]
        cells += [f"{100 * located:.1f} %", f"{wrong}"]
    noticed, honest = np.sum(kidnapped, axis=0)
    return "| " + " | ".join([*cells, f"{len(kidnapped)}", f"{noticed}", f"{honest}"]) + " |"


def agreements(name: str) -> str:
    """Return the row of a log: how scans agree with the next one, and with one elsewhere."""
    scans = [scan for scan in open_log(DATA / LOGS[name]) if scan.pose is not None]
    rng, right, elsewhere = np.random.default_rng(5), [], []
    for before, scan in pairwise(scans):
        if math.dist(before.pose[:2], scan.pose[:2]) < FAR:
            right.append(agreement(before, scan, [relative(before.pose, scan.pose)])[0])
        other = scans[int(rng.integers(len(scans)))]
        if math.dist(before.pose[:2], other.pose[:2]) > FAR:
            elsewhere.append(agreement(before, other, [(0.05, 0.0, 0.02)])[0])
    shares = *np.nanquantile(right, (0.01, 0.5)), *np.nanquantile(elsewhere, (0.5, 0.99))
    return f"| {name} | {len(right)} | " + " | ".join(f"{share:.2f}" for share in shares) + " |"


def in_pieces(truth: list[Pose], rng: np.random.Generator) -> Iterator[tuple[int, bool]]:
    """Yield as many scans as there are, in pieces, and whether the robot was carried there."""
    k, left, last = 0, 0, None
    for _ in truth:
        is_carried = not left and last is not None
        if not left:
            left = int(rng.integers(25, 60))
            k = int(rng.integers(len(truth) - left))
            while last is not None and math.dist(truth[k][:2], truth[last][:2]) < FAR:
                k = int(rng.integers(len(truth) - left))
        yield k, is_carried
        k, left, last = k + 1, left - 1, k


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--storeys", type=int, default=20)
    parser.add_argument("--times", type=int, default=10, help="kidnappings in each, on each plan")
    parser.add_argument("--seed", type=int, default=7000)
    parser.add_argument("--sensor", default="lms181")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--rate", type=float, default=5.0, help="scans a second")
    parser.add_argument("--real", action="store_true", help="real logs instead")
    parser.add_argument("--agreement", action="store_true", help="scans of real logs, in pairs")
    options = parser.parse_args()
    if options.agreement:
        print(
            "| log | pairs | right, 1 % | median | elsewhere, median | 99 % |\n"
            "|---|--:|--:|--:|--:|--:|"
        )
        for name in LOGS:
            print(agreements(name), flush=True)
        return
    if options.real:
        print(
            "| log | located | wrong | carried: located | wrong | kidnapped | noticed at once "
            "| no wrong pose |\n|---|--:|--:|--:|--:|--:|--:|--:|"
        )
        for name in LOGS:
            print(real(name), flush=True)
        return
    drive = partial(kidnapped, sensor=options.sensor, rate=options.rate, times=options.times)
    seeds = range(options.seed, options.seed + options.storeys)
    with ProcessPoolExecutor(options.workers) as pool:
        report([one for found in pool.map(drive, seeds) for one in found])


def report(found: list[Found]) -> None:
    """Print a row for each plan, and one for both."""
    print(
        "| plan | kidnapped | noticed within 0.5 s | the last after | no wrong transform "
        "| one | more | the last after | again: median | 90 % | never |\n"
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    )
    for name in (*dict.fromkeys(one.plan for one in found), "both"):
        some = [one for one in found if name in (one.plan, "both")]
        noticed = np.array([one.noticed for one in some])
        wrong = np.array([one.wrong for one in some])
        again = np.array([one.again for one in some])
        print(
            f"| {name} | {len(some)} | {(noticed < SOON).sum()} | {noticed.max():.1f} s | "
            f"{(wrong == 0).sum()} | {(wrong == 1).sum()} | {(wrong > 1).sum()} | "
            f"{max(one.last_wrong for one in some):.1f} s | {np.median(again):.1f} s | "
            f"{np.quantile(again, 0.9, method='higher'):.1f} s | {np.isinf(again).sum()} |"
        )


if __name__ == "__main__":
    main()
