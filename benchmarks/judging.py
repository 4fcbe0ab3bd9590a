"""How often `Judge` is wrong of a localiser that is right, and how soon it notices a kidnapping.

A robot drives through simulated storeys among people, with furniture that the map does not have,
or has elsewhere; another localiser believes in poses as AMCL does, 5 cm and 1° off, each 0.25 m or
11°, and moves on with the wheels between. Once in two minutes the robot is carried to another
place, unnoticed by its wheels; 20 s later it is where it is believed to be again. Counted are the
seconds until the verdict is not "right", and until it is "wrong"; and each time that a pose that is
right is called wrong, apart from the 5 s after the robot comes back.

``--real`` judges poses of real logs instead. With ``--into FILE`` each storey is a line of a file:
a run that is ended goes on where it was, runs with other seeds can be put into one file, and
``--hours 0`` shows what is in it.
"""

import argparse
import itertools
import json
import math
import os
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from evidence import LOGS, mapped
from grids import grid_of, viewpoints
from recordings import DATA

import lineament as ln
from lineament.logs import open_log
from lineament.mapping import LineMap
from lineament.mapping.following import Follower
from lineament.mapping.judging import RIGHT, WRONG, Judge
from lineament.scan import Pose
from lineament.scan.poses import compose, relative
from lineament.simulation import SENSORS, Building, Wheels, World, office

SPEED, PEOPLE = 0.8, 8
#: A kidnapping is noticed soon enough after so long [s].
SOON = 0.5 + 1e-6
#: A robot is carried away after so long, for so long; after that nothing counts for so long [s].
EACH, AWAY, SETTLING = 120.0, 20.0, 5.0
#: How the other localiser is off, and when it looks at its scans [m, m, rad].
ERROR, UPDATE = (0.05, 0.05, math.radians(1)), (0.25, math.radians(11))


class Found(NamedTuple):
    """What is counted on one drive."""

    plan: str
    seconds: float
    right: float
    alarms: int
    alarmed: float
    not_right: list[float]
    wrong: list[float]


def believed(truth: list[Pose], wheels: list[Pose], rng: np.random.Generator) -> Iterator[Pose]:
    """Yield what a localiser that is right believes, which moves on with the wheels."""
    known, at = None, wheels[0]
    for true, wheel in zip(truth, wheels, strict=True):
        moved = relative(at, wheel)
        if known is None or math.hypot(*moved[:2]) > UPDATE[0] or abs(moved[2]) > UPDATE[1]:
            known, at = compose(true, tuple(rng.normal(0, ERROR))), wheel
        yield compose(known, relative(at, wheel))


def judged(seed: int, sensor: str, rate: float) -> list[Found]:
    """Drive through one storey, on two plans of it."""
    return [_driven(*of_plan, seed, sensor, rate) for of_plan in on_plans(seed)]


def on_plans(seed: int) -> Iterator[tuple[Building, str, LineMap]]:
    """Yield a storey, and what is known of it: grids of 5 cm, as robots have them."""
    storey = office(seed, (40.0, 24.0))
    at = viewpoints(storey)
    yield storey, "walls alone", LineMap.from_grid(grid_of(storey.plan, at))
    furnished = LineMap.from_grid(grid_of(storey.world, at))
    yield moved(storey, seed), "furniture, a third moved", furnished


def drive_through(
    building: Building, seed: int, sensor: str, rate: float, **options: bool
) -> tuple[Iterator[ln.LaserScan], list[Pose]]:
    """Return the scans of a drive among people, with poses by the wheels, and the true poses."""
    among = {"people": PEOPLE, "wheels": Wheels(), **options}
    return building.drive(SENSORS[sensor], seed=seed, speed=SPEED, rate=rate, **among)


def moved(storey: Building, seed: int, share: float = 1 / 3) -> Building:
    """Return a storey a share of whose furniture stands elsewhere."""
    rng, n = np.random.default_rng([seed, 78]), len(storey.plan.segments)
    new = storey.refurnished(seed + 5000, share).world
    kept = np.repeat(rng.random((len(storey.world.segments) - n) // 4) > share, 4)
    circles = storey.world.circles[rng.random(len(storey.world.circles)) > share]
    walls = np.vstack((new.segments, storey.world.segments[n:][kept]))
    return replace(storey, world=World(walls, np.vstack((new.circles, circles))))


def _driven(
    world: Building, name: str, plan: LineMap, seed: int, sensor: str, rate: float
) -> Found:
    rng = np.random.default_rng([seed, 77])
    scans, truth = drive_through(world, seed, sensor, rate)
    scans = list(scans)
    wheels = [scan.pose for scan in scans]
    extract, follower, judge = ln.Extractor(), Follower(plan), Judge(plan)
    seconds = right = alarmed = 0.0
    alarms, was_wrong, not_right, wrong = 0, False, [], []
    carried, since, elsewhere = None, -math.inf, None
    for k, belief in enumerate(believed(truth, wheels, rng)):
        stamp = k / rate
        scan = scans[k]
        if carried is None and stamp % EACH >= EACH - AWAY and stamp > EACH / 2:
            carried, elsewhere = stamp, world.free_pose(rng)
            not_right.append(math.inf)
            wrong.append(math.inf)
        elif carried is not None and stamp - carried >= AWAY:
            carried, since = None, stamp
        if carried is not None:
            # Where it was put down it goes on by the same motions, as far as it stands free.
            scene = world.with_people(seed, stamp, elsewhere, PEOPLE)
            scan = SENSORS[sensor].scan(scene, elsewhere, rng, scan.stamp).with_pose(wheels[k])
        features = extract(scan)
        verdict = judge(features, belief, follower(features, scan.pose)).verdict
        if carried is not None:
            after = stamp - carried + 1 / rate  # it may have been put down just behind a scan
            if math.hypot(*relative(belief, elsewhere)[:2]) < 1.0:
                not_right[-1] = wrong[-1] = math.nan  # by chance near where it is believed to be
            if verdict != RIGHT:
                not_right[-1] = min(not_right[-1], after)
            if verdict == WRONG:
                wrong[-1] = min(wrong[-1], after)
        elif stamp - since > SETTLING:
            seconds += 1 / rate
            right += (verdict == RIGHT) / rate
            alarms += verdict == WRONG and not was_wrong
            alarmed += (verdict == WRONG) / rate
        was_wrong = carried is None and stamp - since > SETTLING and verdict == WRONG
    return Found(name, seconds, right, alarms, alarmed, not_right, wrong)


def real() -> None:
    """Judge poses of real scans on the map of every other one: right ones, and of a robot carried.

    Of each 125 scans the last 25 are believed to be where the 400th later one was taken, and to go
    on from there as the robot does.
    """
    for name in ("ACES", "Intel lab"):
        scans = list(open_log(DATA / LOGS[name]))
        plan, at, *_ = mapped(scans[::2])
        follower, judge, extract = Follower(plan), Judge(plan), ln.Extractor()
        rng, there, counts = np.random.default_rng(0), len(at), {False: Counter(), True: Counter()}
        for k, scan in enumerate(scans[: 2 * there - 1]):
            true = compose(at[k // 2], relative(scans[k - k % 2].pose, scan.pose))
            if k % 125 < 100:
                belief = compose(true, tuple(rng.normal(0, ERROR)))
            elif k % 125 == 100:
                belief = at[(k + 400) % (2 * there) // 2]
            else:
                belief = compose(belief, relative(scans[k - 1].pose, scan.pose))
            features = extract(scan)
            verdict = judge(features, belief, follower(features, scan.pose)).verdict
            is_carried = k % 125 >= 100
            is_off = math.hypot(*relative(belief, true)[:2]) > 1.0
            if is_off == is_carried and k % 125 > 5:
                counts[is_carried][verdict] += 1
        print(f"{name}: right {dict(counts[False])}, carried {dict(counts[True])}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="of driving, at least")
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--sensor", default="lms181")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--rate", type=float, default=5.0, help="scans a second")
    parser.add_argument("--into", type=Path, help="file of what was found, which goes on")
    parser.add_argument("--real", action="store_true", help="judge poses of real logs instead")
    options = parser.parse_args()
    if options.real:
        real()
        return
    kept = options.into.read_text().splitlines() if options.into and options.into.exists() else []
    done = {tuple(key): [Found(*one) for one in found] for key, found in map(json.loads, kept)}
    about = options.sensor, options.rate
    left = (seed for seed in itertools.count(options.seed) if (seed, *about) not in done)
    drive = partial(judged, sensor=options.sensor, rate=options.rate)
    with ProcessPoolExecutor(options.workers) as pool:
        while (hours := driven(done)) < options.hours:
            print(f"{hours:.2f} h", file=sys.stderr)
            seeds = list(itertools.islice(left, options.workers))
            for seed, found in zip(seeds, pool.map(drive, seeds), strict=True):
                done[seed, *about] = found
                if options.into:
                    with options.into.open("a") as file:
                        print(json.dumps([[seed, *about], found]), file=file)
    for sensor, rate in dict.fromkeys(key[1:] for key in done):
        some = {key: found for key, found in done.items() if key[1:] == (sensor, rate)}
        seeds = [seed for seed, *_ in some]
        print(f"{sensor}, {rate:g} scans/s, seeds {min(seeds)} to {max(seeds)}")
        report([one for found in some.values() for one in found])


def driven(done: dict[tuple, list[Found]]) -> float:
    """How long the robot was driven where it was believed to be [h]."""
    return sum(one.seconds for found in done.values() for one in found) / 3600


def at_most(count: int) -> float:
    """Largest mean of a Poisson distribution that shows no more than this in 5 % of the cases."""
    means = np.arange(0.0, 10.0 * (count + 1), 0.001)
    terms = [np.exp(-means) * means**k / math.factorial(k) for k in range(count + 1)]
    return float(means[np.sum(terms, axis=0) > 0.05][-1])


def report(found: list[Found]) -> None:
    """Print a row for each plan, and one for both."""
    print(
        "| plan | hours | right | wrong alarms | a day, at most (95 %) | kidnapped "
        "| not right in .5 s | wrong in .5 s | in 2 s |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|"
    )
    for name in (*dict.fromkeys(one.plan for one in found), "both"):
        some = [one for one in found if name in (one.plan, "both")]
        hours = sum(one.seconds for one in some) / 3600
        alarms = sum(one.alarms for one in some)
        most = 24 / hours * at_most(alarms)
        off, wrong = (
            np.array([t for times in lists for t in times if not math.isnan(t)])
            for lists in ([one.not_right for one in some], [one.wrong for one in some])
        )
        share = sum(one.right for one in some) / (36 * hours)
        print(
            f"| {name} | {hours:.1f} | {share:.1f} % | {alarms} | {24 * alarms / hours:.1f}, "
            f"{most:.1f} | {len(off)} | {(off < SOON).sum()} | "
            f"{100 * (wrong < SOON).mean():.1f} % | {100 * (wrong < 2).mean():.1f} % |"
        )


if __name__ == "__main__":
    main()
