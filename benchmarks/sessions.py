"""Maps of two sessions as one: ``python benchmarks/sessions.py --buildings 60 --seed 1001``.

Three sessions in each simulated storey, along other ways into other rooms, of the second with other
furniture: a drive is merged with the map of another session there, of another storey, of the same
one mirrored, and with a map on which it has two places that look the same. Then the halves of real
logs, each on the map of the other (``LINEAMENT_DATA``), by the corrected poses of the logs.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass, replace
from itertools import islice, permutations
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from lineament_lab.evaluation.maps import absolute_errors, alignment, doubled_walls
from mapping import drive, nees
from matplotlib.collections import LineCollection
from recordings import DATA, LOGS

from lineament.errors import NothingFoundError
from lineament.logs import open_log
from lineament.mapping import LineMap
from lineament.mapping.making import DriveMap, make_map
from lineament.mapping.sessions import Merged, merge_onto, placements
from lineament.scan.poses import compose, relative
from lineament.simulation import SENSORS, Wheels, office
from lineament.simulation.layouts import way_along
from lineament.walls import moved, turned_back

SIZE, RATE, PEOPLE, VISITS = (24.0, 16.0), 2.0, 3, 0.3
#: A session drives so much of its way.
SHARE = 0.75
#: A drive is placed rightly within, as a root mean square and on average [m, rad].
RIGHT = 0.1, math.radians(1)
#: Sessions overlap where one is nearer to the way of the other [m].
NEAR = 2.0


@dataclass
class Session:
    made: DriveMap
    truth: list
    segments: np.ndarray


def session(seed: int, number: int) -> Session:
    """Drive through the storey of a seed, and make a map of it."""
    storey = office(seed, SIZE, identical=(0.5, 1.0, 0.0)[seed % 3])
    if number == 1:
        storey = storey.refurnished(seed + 10_000)
    is_level = np.diff(storey.corridors[:, ::2])[:, 0] > np.diff(storey.corridors[:, 1::2])[:, 0]
    level, upright = storey.corridors[is_level], storey.corridors[~is_level]
    way = way_along(
        level, upright, list(storey.rooms), VISITS, np.random.default_rng([seed, number])
    )
    storey = replace(storey, waypoints=way[::-1] if number == 2 else way)
    wheels, run = Wheels(), 3 * seed + number
    scans, truth = storey.drive(
        SENSORS["utm30lx"], seed=run, rate=RATE, people=PEOPLE, wheels=wheels
    )
    count = int(SHARE * len(truth))
    found = drive(list(islice(scans, count)), odometry=True)
    made = make_map(found.frames, found.scans)
    return Session(made, truth[:count], storey.world.segments)


def mirrored(plan: LineMap) -> LineMap:
    """Return a plan mirrored in x; walls are seen from the other end on, so from their left."""
    walls = plan.walls.copy()
    for name in ("start", "end", "centroid"):
        walls[name][:, 0] *= -1
    walls["angle"] = math.pi - walls["angle"]
    walls["covariance"] *= [[1, -1], [-1, 1]]
    return LineMap(turned_back(walls), sigma=plan.sigma)


def twice(plan: LineMap) -> LineMap:
    """Return a plan and, beside it, the same turned by half a turn."""
    high, low = plan.ends.max(axis=(0, 1)), plan.ends.min(axis=(0, 1))
    # The frame is at the far corner of the two, and turned.
    far = high[0] + 1.0 + high[0], low[1] + high[1]
    copy = moved(plan.walls, (*far, math.pi))
    return LineMap(np.append(plan.walls, copy), sigma=plan.sigma)


def merged(new: Session, plan: LineMap):
    """Merge a drive with a plan; None where that is refused."""
    try:
        return merge_onto(new.made, plan, placements(new.made, plan))
    except NothingFoundError:
        return None


def overlap(old: Session, new: Session) -> float:
    """Share of the way of a session that is near that of another."""
    a, b = (np.array(of.truth)[:, None, :2] for of in (old, new))
    return float((np.linalg.norm(b - a[:, 0], axis=2).min(axis=1) < NEAR).mean())


def judged(old: Session, new: Session, found) -> tuple[float, float, float]:
    """How far a drive is off on the map of another: RMS and largest [m], mean turn [rad]."""
    at = [relative(old.truth[0], pose) for pose in new.truth]
    off = np.array([relative(a, b) for a, b in zip(at, found.made.poses, strict=True)])
    way = np.hypot(off[:, 0], off[:, 1])
    return math.sqrt((way**2).mean()), way.max(), abs(off[:, 2]).mean()


def sampled(ends: np.ndarray) -> np.ndarray:
    """Return places along walls, one each 10 cm (n, 2)."""
    counts = np.ceil(10 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)).astype(int)
    return np.concatenate(
        [
            a + (np.arange(n)[:, None] + 0.5) / n * (b - a)
            for (a, b), n in zip(ends, counts, strict=True)
        ]
    )


def beside(places: np.ndarray, ends: np.ndarray, near: float) -> np.ndarray:
    """Whether places lie so near to walls [m]."""
    found = np.zeros(len(places), bool)
    for a, b in ends:
        t = np.clip((places - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        found |= np.hypot(*(places - a - t[:, None] * (b - a)).T) < near
    return found


def fate(old: Session, new: Session, found) -> np.ndarray:
    """Length of old walls that stand no more, of these left out; that stand, of these left out."""
    places = sampled(old.made.map.ends)
    world = new.segments.reshape(-1, 2, 2)
    stand = beside(places, moved_ends(world, old.truth[0]), 0.05)
    kept = beside(places, found.made.map.ends, 0.1)
    of = [~stand, ~stand & ~kept, stand, stand & ~kept]
    return np.array([0.1 * chosen.sum() for chosen in of])


def moved_ends(ends: np.ndarray, frame) -> np.ndarray:
    x, y, theta = frame
    c, s = math.cos(theta), math.sin(theta)
    return (ends - (x, y)) @ np.array([[c, -s], [s, c]])


def length(plan: LineMap) -> float:
    return float(np.linalg.norm(plan.ends[:, 1] - plan.ends[:, 0], axis=1).sum())


def doubled(plan: LineMap) -> float:
    return doubled_walls(plan.ends.reshape(-1, 4))


class Tally:
    """What became of pairs: right, wrong or refused (None), by what the map is of."""

    def __init__(self) -> None:
        self.verdicts: dict[str, list[bool | None]] = {}
        self.errors: list = []
        self.fates: list = []
        self.squares: list = []
        self.lengths: list = []

    def add(self, name: str, is_right: bool | None) -> None:
        self.verdicts.setdefault(name, []).append(is_right)

    def same(self, old: Session, new: Session) -> None:
        """Count a pair of sessions of one storey."""
        found = merged(new, old.made.map)
        shared = "half of the way or more" if overlap(old, new) >= 0.5 else "less of the way"
        name = f"the same storey, {shared}"
        if found is None:
            self.add(name, None)
            return
        error = judged(old, new, found)
        self.add(name, bool(error[0] < RIGHT[0] and error[2] < RIGHT[1]))
        self.errors.append(error)
        self.fates.append(fate(old, new, found))
        self.squares.append(nees(found.made, old.truth, new.segments))
        plans = old.made.map, new.made.map, found.made.map
        self.lengths.append([*map(doubled, plans), length(plans[-1])])

    def other(self, name: str, new: Session, plan: LineMap) -> None:
        """Count a pair of which the drive is nowhere on the map, or in two places."""
        self.add(name, None if merged(new, plan) is None else False)

    def show(self) -> None:
        print("| the map is of | pairs | right | wrong | refused |\n|---|--:|--:|--:|--:|")
        for name, found in self.verdicts.items():
            counts = [sum(of is value for of in found) for value in (True, False, None)]
            print(f"| {name} | {len(found)} | " + " | ".join(map(str, counts)) + " |")
        way, most, turn = np.array(self.errors).T
        gone, left, stand, lost = np.sum(self.fates, axis=0)
        old, new, both, total = np.sum(self.lengths, axis=0)
        squares = np.concatenate(self.squares)
        mean, median = squares.mean(axis=0), np.median(squares, axis=0)
        print(
            f"\nplaced: RMS of a drive {1000 * np.median(way):.1f} mm in the median, at most "
            f"{1000 * way.max():.0f} mm; a pose at most {1000 * most.max():.0f} mm; turn at most "
            f"{math.degrees(turn.max()):.2f}°\ndoubled walls: {old:.1f} m in the old maps, "
            f"{new:.1f} m in the new, {both:.1f} m of {total:.0f} m merged\nold walls that stand "
            f"no more: {gone:.0f} m, of these left out {left:.0f} m; that stand: {stand:.0f} m, of "
            f"these left out {lost:.1f} m\nsquares of {len(squares)} walls over their variances: "
            f"offsets {mean[0]:.2f} (median {median[0]:.2f}), angles {mean[1]:.2f} "
            f"({median[1]:.2f})"
        )


def simulated(first: int, buildings: int) -> None:
    """Print the table of simulated pairs, 21 of each storey; Ctrl-C ends it early."""
    tally, before = Tally(), []
    try:
        for seed in range(first, first + buildings):
            here = [session(seed, k) for k in range(3)]
            for old, new in permutations(here, 2):
                tally.same(old, new)
            for new in here:
                tally.other("that storey mirrored", new, mirrored(here[0].made.map))
                tally.other("that storey twice", new, twice(new.made.map))
                for old in before[-3:]:
                    tally.other("another storey", new, old.made.map)
            before.append(here[seed % 3])
            print(f"{sum(map(len, tally.verdicts.values()))} pairs", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        print(f"{len(before)} storeys")
    tally.show()


def real(pictures: Path | None) -> None:
    """Print what becomes of the halves of real logs, each on the map of the other."""
    print("\n| log | map, drive | placed, of [m] | off (RMS, most) [m] ", end="")
    print("| ATE map | drive | both [m] | doubled | walls [m] |")
    print("|---|---|--:|--:|--:|--:|--:|--:|--:|")
    for name, log in LOGS.items():
        if not (DATA / log).exists():
            continue
        scans = list(open_log(DATA / log))
        halves = []
        for half in (scans[: len(scans) // 2], scans[len(scans) // 2 :]):
            found = drive(half, odometry=False)
            made = make_map(found.frames, found.scans)
            halves.append(Session(made, [scan.pose for scan in half], np.empty((0, 4))))
        for order, (old, new) in zip(("1, 2", "2, 1"), permutations(halves, 2), strict=True):
            found = merged(new, old.made.map)
            print("| " + " | ".join([name, order, *outcome(old, new, found)]) + " |", flush=True)
            if found is not None and pictures is not None:
                target = pictures / f"sessions_{log.split('/')[1].split('_')[0]}_{order[0]}.png"
                draw(target, old.made.map, new.made.map, found.made.map)


def outcome(old: Session, new: Session, found: Merged | None) -> list[str]:
    """Return what becomes of a drive on the map of another, by the sure poses of both.

    Errors are those beside the longest part of the map.
    """
    part, of = old.made.parts.numbers[old.made.frame_of], new.made.parts
    chosen = (part == int(np.argmax(old.made.ways))) & old.made.parts.is_sure[old.made.frame_of]
    at, true = (list(np.array(of)[chosen]) for of in (old.made.poses, old.truth))
    if found is None:
        return ["refused", "", f"{ate(at, true):.3f}"]
    located = list(found.made.located)
    is_in = np.isin(of.numbers[new.made.frame_of], located) & of.is_sure[new.made.frame_of]
    alone, both, truth = (
        list(np.array(poses)[is_in]) for poses in (new.made.poses, found.made.poses, new.truth)
    )
    frame, united = alignment(at, true), found.made.map
    off = [relative(b, compose(frame, a)) for a, b in zip(both, truth, strict=True)]
    away = np.hypot(*np.array(off)[:, :2].T)
    # Parts that are drawn beside each other have no common error.
    by_itself = f"{ate(alone, truth):.3f}" if len(located) == 1 else f"in {len(located)} parts"
    ways = new.made.ways
    return [
        f"{sum(ways[k] for k in located):.0f} of {sum(ways):.0f}",
        f"{math.sqrt((away**2).mean()):.3f}, {away.max():.2f}",
        f"{ate(at, true):.3f}", by_itself, f"{ate(at + both, true + truth):.3f}",
        f"{doubled(united):.1f}", f"{length(united):.0f}",
    ]  # fmt: skip


def ate(poses, truth) -> float:
    return absolute_errors(poses, truth).summary()["way_rmse"]


def draw(path: Path, old: LineMap, new: LineMap, both: LineMap) -> None:
    """Draw two maps and what they are together."""
    figure, axes = plt.subplots(1, 3, figsize=(15, 5), layout="constrained")
    titles = "first session", "second session", "both, by map --merge"
    for axis, plan, title in zip(axes, (old, new, both), titles, strict=True):
        axis.add_collection(LineCollection(plan.ends, colors="k", linewidths=0.6))
        axis.autoscale()
        axis.set(aspect="equal", title=title)
    figure.savefig(path, dpi=80)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--buildings", type=int, default=0, help="so many simulated storeys")
    parser.add_argument("--seed", type=int, default=1001, help="of the first")
    parser.add_argument("--real", action="store_true", help="the halves of real logs")
    parser.add_argument("--pictures", type=Path, help="folder for maps of them")
    chosen = parser.parse_args()
    if chosen.buildings:
        simulated(chosen.seed, chosen.buildings)
    if chosen.real:
        real(chosen.pictures)


if __name__ == "__main__":
    main()
