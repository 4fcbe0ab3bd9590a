"""Bare corridors without odometry, errors beside claims: ``python benchmarks/corridors.py``.

A robot drives from one room to another through a corridor of 25 to 45 m that a scanner of 12 m
(LD19) does not see the ends of. Its speed walks at random between 0.15 and 1.1 m/s, by 0.14 m/s in
a second. How far it came is compared with what the motions between key frames claim. Drives that
were lost are left out: they claim nothing.
"""

from __future__ import annotations

import argparse
import math
from itertools import pairwise

import numpy as np
from recordings import DATA, logs

from lineament import Extractor
from lineament.logs import open_log
from lineament.mapping.adjust import edges_of, optimise
from lineament.mapping.chain import loosened, spread_of, unseen
from lineament.mapping.drive_map import Drive
from lineament.mapping.parts import between
from lineament.scan.poses import relative
from lineament.simulation import SENSORS, World
from lineament.walls.sights import sights_of

#: Variance of the change of speed in a second [m²/s³], and its limits [m/s].
CHANGES, SLOWEST, FASTEST = 0.02, 0.15, 1.1
#: Depth and width of the recess of a door, and roughness of surfaces [m].
DEPTH, WIDTH, ROUGH = 0.12, 0.9, 0.01


ARENA = {"arena": "truth/jackal_mocap_02171554.npz"}
LOGS = logs("fr079", "ACES") | ARENA | logs("Acapulco", "Killian")
#: Times over which changes of speed are averaged [s]; slower, a robot stands [m/s].
TIMES, STANDING = (1.0, 2.0, 4.0, 8.0), 0.1
COLUMNS = (
    "scans/s",
    "doors",
    "drives",
    "lost",
    "off [m]",
    "by scans [m]",
    "claimed [m]",
    "square over variance",
    "median",
    "within two deviations",
)


def box(x, y, right, top):
    return [[x, y, right, y], [right, y, right, top], [right, top, x, top], [x, top, x, y]]


def corridor(rng, length, doors):
    """Return walls of two rooms with furniture and of the corridor between them, (n, 4) [m]."""
    half = rng.uniform(0.9, 1.3)
    walls = [[-8, -3, -8, 4], [-8, -3, 0, -3], [-8, 4, 0, 4], [0, -3, 0, -half], [0, half, 0, 4]]
    walls += (
        np.array([[8, -3.5, 8, 3], [0, -3.5, 8, -3.5], [0, 3, 8, 3]]) + (length, 0) * 2
    ).tolist()
    walls += [[length, -3.5, length, -half], [length, half, length, 3]]
    for side in (-half, half):
        x = 0.0
        for door in sorted(rng.uniform(3, length - 3, doors)):
            if door - x > 0.5:
                back, end = side + math.copysign(DEPTH, side), door + WIDTH
                walls += [[x, side, door, side], [door, side, door, back]]
                walls += [[door, back, end, back], [end, back, end, side]]
                x = end
        walls.append([x, side, length, side])
    for left in (-8, length):
        for _ in range(4):
            x, y = left + rng.uniform(1, 6.5), rng.uniform(-2.6, 2.0)
            if abs(y + 0.3) > 1.1:
                walls += box(x, y, x + rng.uniform(0.3, 1), y + rng.uniform(0.3, 0.8))
    return walls


def course(rng, length, rate):
    """Return the poses of a robot that weaves a little, so many a second."""
    x, speed, poses, began = -6.0, 0.6, [], rng.uniform(0, 6)
    steps = max(int(20 / rate), 1)
    while x < length + 6:
        phase = 0.9 * len(poses) / rate + began
        poses.append((x, 0.1 * math.sin(phase - 1.5), 0.08 * math.sin(phase)))
        for _ in range(steps):
            speed += rng.normal() * math.sqrt(CHANGES / rate / steps)
            speed = 2 * SLOWEST - speed if speed < SLOWEST else speed
            speed = 2 * FASTEST - speed if speed > FASTEST else speed
            x += speed / rate / steps
    return poses


def off_and_claimed(seed, rate, doors):
    """Return how far the way is off, and what is claimed, with speeds and without [m].

    None if it was lost.
    """
    rng, extract, drive = np.random.default_rng([seed, 7]), Extractor(), Drive()
    length = rng.uniform(25, 45)
    world = World(corridor(rng, length, doors))
    truth = course(rng, length, rate)
    for k, pose in enumerate(truth):
        scan = SENSORS["ld19"].scan(world, pose, np.random.default_rng([seed, k]), k / rate)
        drive.add(scan, extract(scan))
    frames = drive.frames
    if any(frame.is_lost for frame in frames):
        return None
    sights = sights_of([(frame.features.segments, frame.walls) for frame in frames], ROUGH)
    pairs = [(k, k + 1) for k in range(len(frames) - 1)]
    motions = [frame.motion.pose for frame in frames[1:]]
    chain = edges_of(pairs, motions, [spread_of(frame) for frame in frames[1:]])
    found = optimise(np.array([frame.pose for frame in frames]), chain, sights)
    known = optimise(found.poses, loosened(chain, unseen(frames)), sights, rounds=0)
    first, last = ((tuple(found.poses[k]), truth[frames[k].index]) for k in (0, -1))
    came, true = (relative(*of) for of in zip(first, last, strict=True))
    ends = np.array([(0, len(frames) - 1)])
    spreads = [between(found.poses, ends, of.solver())[0, 0, 0] for of in (known, found)]
    return came[0] - true[0], *np.sqrt(spreads)


def changes(scans):
    """Return the mean square of the change of speed over each of the times [m²/s²]."""
    stamps = np.array([scan.stamp for scan in scans])
    steps = [relative(a.pose, b.pose)[0] for a, b in pairwise(scans)]
    times, at = np.diff(stamps), (stamps[1:] + stamps[:-1]) / 2
    speeds = np.where((times > 0.05) & (times < 5), steps / np.maximum(times, 1e-6), np.nan)
    found = []
    for time in TIMES:
        later = np.searchsorted(at, at + time)
        first = np.flatnonzero(later < len(at))
        later = later[first]
        is_near = abs(at[later] - at[first] - time) < time / 2
        is_going = (speeds[first] > STANDING) | (speeds[later] > STANDING)
        found.append(np.nanmean((speeds[later] - speeds[first])[is_near & is_going] ** 2))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=24)
    parser.add_argument("--rates", type=float, nargs="+", default=[1.0, 10.0, 40.0])
    parser.add_argument(
        "--doors", type=int, nargs="+", default=[0, 8], help="recesses to each side"
    )
    parser.add_argument("--speeds", action="store_true", help="of recordings")
    chosen = parser.parse_args()
    if chosen.speeds:
        print("|log|" + "|".join(f"{time:g} s" for time in TIMES) + "|\n" + "|---" * 5 + "|")
        for name, path in LOGS.items():
            found = changes(list(open_log(DATA / path)))
            print(f"|{name}|" + "|".join(f"{square:.3f}" for square in found) + "|")
        return
    print("|" + "|".join(COLUMNS) + "|\n" + "|---" * len(COLUMNS) + "|")
    for rate in chosen.rates:
        for doors in chosen.doors:
            found = [off_and_claimed(seed, rate, doors) for seed in range(chosen.drives)]
            rows = np.array([each for each in found if each is not None])
            off, claimed, by_scans = rows.T
            squares = (off / claimed) ** 2
            rms = "|".join(f"{math.sqrt(np.mean(of**2)):.2f}" for of in (off, by_scans, claimed))
            print(
                f"|{rate:g}|{doors}|{chosen.drives}|{chosen.drives - len(off)}|{rms}|"
                f"{squares.mean():.2f}|{np.median(squares):.2f}|"
                f"{100 * np.mean(squares < 4):.0f} %|",
                flush=True,
            )


if __name__ == "__main__":
    main()
