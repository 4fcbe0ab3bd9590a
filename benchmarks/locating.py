"""The tables of docs/locate.md: ``python benchmarks/locating.py --queries 20000 --seed 700``.

Simulated storeys with furniture and people that the plan does not have; a local map of up to 5 m
of way is looked for on its plan, on that plan with walls moved by 0.3 m, mirrored, and on that of
another storey. Then the scans of the real arena, each by itself, where they were recorded: errors
from the motion capture, and from its poses refined on the walls. With ``--follow`` logs are
followed instead.
"""

from __future__ import annotations

import argparse
import math
import os
import pickle
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from recordings import DATA

import lineament as ln
from lineament.mapping import VERDICTS, LineMap, LocalMap, Query, locate
from lineament.mapping.evidence import evidence_of
from lineament.mapping.following import follow
from lineament.mapping.index import MAPPED
from lineament.mapping.refine import COARSE, refined
from lineament.simulation import SENSORS
from lineament.simulation.buildings import Building, office
from lineament.simulation.wheels import Wheels

PLANS = ("own", "moved", "moved", "mirrored", "other", "other")
#: A pose is right within [m, rad].
RIGHT = 0.2, math.radians(1)
WAYS = (2.0, 3.5, 5.0)
SIZES = ((60.0, 40.0), (40.0, 24.0))
SPEED, RATE, STEP = 1.0, 5.0, 1.3


@dataclass
class Place:
    """A local map, where it is, and whether nothing else on the plan looks like it."""

    query: Query
    truth: tuple[float, float, float]
    way: float
    unique: bool
    mirrored: bool


def storey(seed: int) -> Building:
    """Return the storey of a seed: half, all or none of the rows are identical rooms."""
    return office(seed, SIZES[seed % 2], identical=(0.5, 1.0, 0.0)[seed % 3])


def plan_of(world: object) -> LineMap:
    return LineMap.from_lines(world.segments, side=1)  # type: ignore[attr-defined]


def plans(seed: int) -> list[LineMap]:
    own, moved = storey(seed), [storey(seed).moved(k).plan for k in range(2)]
    others = [storey(seed + 6000 + k).plan for k in range(2)]
    return [plan_of(world) for world in (own.plan, *moved, own.mirrored(), *others)]


def places(seed: int, most: int | None = None) -> list[Place]:
    """Drive through the storey of a seed; a local map each few metres."""
    building, plan = storey(seed), plan_of(storey(seed).plan)
    scans, truth = building.drive(
        SENSORS["utm30lx"],
        seed=seed,
        speed=SPEED,
        rate=RATE,
        people=8,
        wheels=Wheels() if seed % 4 < 2 else None,
    )
    tracker, extract = ln.Tracker(roughness=0.0), ln.Extractor()
    maps = [LocalMap(way, roughness=0.0) for way in WAYS]
    found: list[Place] = []
    since = 0.0
    for k, (scan, pose) in enumerate(zip(scans, truth, strict=True)):
        features = extract(scan)
        tracks = tracker(features, scan.pose)
        for local in maps:
            local.add(features, tracks, scan.pose)
        since += math.dist(pose[:2], truth[k - 1][:2]) if k else -WAYS[-1] / 2
        if since < STEP:
            continue
        since = 0.0
        query = maps[len(found) % 3].query()
        unique, mirrored = likenesses(query, pose, plan, building)
        found.append(Place(query, pose, WAYS[len(found) % 3], unique, mirrored))
        if len(found) == most:
            break
    return found


def likenesses(
    query: Query, pose: tuple[float, ...], plan: LineMap, building: Building
) -> tuple[bool, bool]:
    """Whether no other pose explains what the right one does of the plan; whether a mirrored does.

    Tried are poses to which a room, turned by quarters, is moved onto another, and slides along
    both axes. Beams that do not end on the plan are left out, as are all limits of `locate`.
    """
    right = np.array([pose])
    of_plan = [evidence_of(right, b[None], plan.index, 0.03)[0, 1] > 0 for b in query.beams]
    if sum(of_plan) < 10:
        return False, False
    query = Query(query.walls, query.covariance, query.beams[of_plan])
    slides = [np.add(pose, (x, y, 0)) for x in SLIDES for y in SLIDES if (x == 0) != (y == 0)]
    centers = np.array([(r.low[0] + r.high[0], r.low[1] + r.high[1]) for r in building.rooms]) / 2
    own = centers[np.hypot(*(centers - pose[:2]).T).argsort()[:2]]
    poses = moved_onto(query, slides + onto(pose, own, centers), plan)
    off = poses - pose
    turned = np.abs(np.remainder(off[:, 2] + math.pi, 2 * math.pi) - math.pi)
    distinct = poses[(np.hypot(off[:, 0], off[:, 1]) > RIGHT[0]) | (turned > RIGHT[1])]
    # The mirror image of the local map has the pose of the mirror image of the plan.
    image, wide = query.mirrored(), building.size[0]
    turned_over = (wide - pose[0], pose[1], math.pi - pose[2])
    own = np.column_stack((wide - own[:, 0], own[:, 1]))
    others = moved_onto(image, onto(turned_over, own, centers), plan)
    return not explained(query, distinct, plan), explained(image, others, plan)


def onto(pose: tuple[float, ...], own: np.ndarray, centers: np.ndarray) -> list[np.ndarray]:
    """Return the poses that are to the centers as a pose is to its own, turned by quarters."""
    poses = []
    for center in own:
        for turn in range(4):
            c, s = round(math.cos(turn * math.pi / 2)), round(math.sin(turn * math.pi / 2))
            moved = centers + np.array([[c, -s], [s, c]]) @ (np.array(pose[:2]) - center)
            poses += [np.array([x, y, pose[2] + turn * math.pi / 2]) for x, y in moved]
    return poses


def moved_onto(query: Query, poses: list[np.ndarray], plan: LineMap) -> np.ndarray:
    return refined(np.array(poses), query, plan.index, COARSE)[0]


def explained(query: Query, poses: np.ndarray, plan: LineMap) -> bool:
    shares = evidence_of(poses, query.beams, plan.index, 0.03)
    return bool(((shares[:, 1] > 0.9) & (shares[:, 3] < 0.05)).any())


SLIDES = (-3.0, -2.0, -1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0, 2.0, 3.0)


def judge(seed: int, most: int | None, kept: Path | None) -> np.ndarray:
    """Return rows of (plan, verdict, right, unique, error, turn, NEES, time, explained, ...)."""
    file = None if kept is None else kept / f"{seed}.pickle"
    if file is not None and file.exists():
        found = pickle.loads(file.read_bytes())
    else:
        found = places(seed, most)
        if file is not None:
            file.write_bytes(pickle.dumps(found))
    rows = []
    for number, plan in enumerate(plans(seed)):
        if len(found):
            locate(found[0].query, plan)
        for place in found[:most]:
            started = time.process_time()
            where = locate(place.query, plan)
            spent = time.process_time() - started
            off = off_by(where.pose, place.truth)
            way, right = math.hypot(off[0], off[1]), is_right(off) and number < 3
            nees = off @ np.linalg.solve(where.covariance, off) / 3
            rows.append((
                number, VERDICTS.index(where.verdict), right, place.unique, way, abs(off[2]), nees,
                spent, where.evidence.log_odds, len(where.alternatives), where.evidence.explained,
                where.evidence.contradicted, place.way, seed, len(plan), place.mirrored,
            ))  # fmt: skip
    return np.array(rows)


def off_by(found: tuple[float, ...], true: tuple[float, ...] | np.ndarray) -> np.ndarray:
    """Return how far a pose is off [m, m, rad]."""
    off = np.subtract(found, true)
    off[2] = math.remainder(off[2], 2 * math.pi)
    return off


def is_right(off: np.ndarray) -> bool:
    return math.hypot(off[0], off[1]) < RIGHT[0] and abs(off[2]) < RIGHT[1]


def table(rows: np.ndarray) -> None:
    """Print verdicts by plan, and what is to be reached."""
    number, verdict, right, unique = rows[:, 0], rows[:, 1], rows[:, 2] > 0, rows[:, 3] > 0
    names = np.array(PLANS)[number.astype(int)]
    print(f"| plan | queries | {' | '.join(VERDICTS)} | false located |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    for name in (*dict.fromkeys(PLANS), "all"):
        of = (names == name) | (name == "all")
        shares = " | ".join(f"{100 * (verdict[of] == v).mean():.1f} %" for v in range(4))
        false = (verdict[of] == 0) & ~right[of]
        print(f"| {name} | {of.sum()} | {shares} | {false.sum()} ({100 * false.mean():.2f} %) |")
    own, wheels, mirrored = number == 0, rows[:, 13] % 4 < 2, rows[:, 15] > 0
    located = own & (verdict == 0) & right
    print("\n| own plan | places | located, right |\n|---|--:|--:|")
    for name, of in (
        ("unique", unique),
        ("unique, nor is its mirror image there", unique & ~mirrored),
        ("the same, with odometry", unique & ~mirrored & wheels),
        ("the same, without", unique & ~mirrored & ~wheels),
        ("not unique", ~unique),
    ):
        share = located[own & of].sum() / max((own & of).sum(), 1)
        print(f"| {name} | {(own & of).sum()} | {100 * share:.1f} % |")
    print(
        f"\nlocated on the own plan: median error {1000 * np.median(rows[located, 4]):.1f} mm, "
        f"{math.degrees(np.median(rows[located, 5])):.3f}°; NEES {rows[located, 6].mean():.2f} "
        f"(by three degrees of freedom), median {np.median(rows[located, 6]):.2f} (0.79)"
    )
    print(
        f"time a query: median {1000 * np.median(rows[:, 7]):.1f} ms, 95 % "
        f"{1000 * np.quantile(rows[:, 7], 0.95):.1f} ms of processor time, on "
        f"{np.median(rows[:, 14]):.0f} features"
    )


ARENA = (("standing", "static_data"), ("moving", "mocap_02171554"))


def arena_of(file: str) -> tuple[np.lib.npyio.NpzFile, list[ln.LaserScan]] | None:
    """Return a recording of the arena: its archive and its scans; None where it is not there."""
    path = DATA / "truth" / f"jackal_{file}.npz"
    return (np.load(path), list(ln.open_log(path))) if path.exists() else None


def arena() -> None:
    """Print where single scans of the real arena are found on its fitted walls."""
    print("\n| arena | scans | located | right | median error | by refined poses |")
    print("|---|--:|--:|--:|--:|--:|")
    for name, file in ARENA:
        errors, extract, recorded = [], ln.Extractor(), arena_of(file)
        if recorded is None:
            continue
        archive, scans = recorded
        plan = LineMap.from_lines(archive["gt_segments"], sigma=0.005)
        for k, scan in enumerate(scans):
            if where := locate(extract(scan), plan):
                truths = archive["poses"][k], archive["poses_refined"][k]
                errors.append([math.dist(where.pose[:2], truth[:2]) for truth in truths])
        by_capture, refined_ones = np.median(errors, axis=0) * 1000
        right = 100 * (np.max(errors, axis=1) < RIGHT[0]).mean()
        print(
            f"| {name} | {len(scans)} | {len(errors)} | {right:.1f} % | {by_capture:.1f} mm | "
            f"{refined_ones:.1f} mm |"
        )


def followed(
    scans: list[ln.LaserScan], truth: np.ndarray, plan: LineMap, odometry: bool, known: float = 0.0
) -> np.ndarray:
    """Return rows of (located, error [m], turn, χ²/3) of the scans of a log on a plan.

    The truth itself is `known` so well [m].
    """
    rows = []
    found = follow(scans, plan, ln.Extractor(), odometry=odometry)
    for (_, where), true in zip(found, truth, strict=True):
        off = off_by(where.pose, true)
        spread = where.covariance + known**2 * np.diag((1, 1, 0))
        nees = off @ np.linalg.solve(spread, off) / 3
        rows.append((bool(where), math.hypot(off[0], off[1]), abs(off[2]), nees))
    return np.array(rows)


def built(seed: int) -> None:
    """Print how often places are found on drawings from which the building is some centimetres off.

    All walls of one line are off together.
    """
    rows: dict[tuple[float, float], list[tuple[bool, bool, float]]] = {}
    for k in range(seed, seed + 8):
        lines, rng = storey(k).plan.segments.reshape(-1, 2, 2), np.random.default_rng(k)
        along = lines[:, 1] - lines[:, 0]
        normal = abs(along[:, ::-1]) / np.linalg.norm(along, axis=1)[:, None]
        line = np.column_stack((normal, abs((lines[:, 0] * normal).sum(axis=1)))).round(2)
        _, line = np.unique(line, axis=0, return_inverse=True)
        off = rng.standard_normal(line.max() + 1)[line.ravel()]
        found = places(k, 30)
        for error in (0.0, 0.01, 0.02, 0.03):
            drawn = lines + (error * off[:, None] * normal)[:, None]
            for sigma in (0.0, MAPPED):
                plan = LineMap.from_lines(drawn, side=1, sigma=sigma)
                for place in found:
                    where = locate(place.query, plan)
                    out = off_by(where.pose, place.truth)
                    nees = out @ np.linalg.solve(where.covariance, out) / 3
                    rows.setdefault((error, sigma), []).append((bool(where), is_right(out), nees))
    print("| walls off | sigma | places | located, right | false | χ²/3, median |")
    print("|--:|--:|--:|--:|--:|--:|")
    for (error, sigma), of in rows.items():
        located, right, nees = map(np.array, zip(*of, strict=True))
        print(
            f"| {100 * error:g} cm | {100 * sigma:g} cm | {len(of)} | "
            f"{100 * (located & right).mean():.1f} % | {(located & ~right).sum()} | "
            f"{np.median(nees[located & right]):.2f} |"
        )


def follow_all() -> None:
    """Print how logs are followed: six storeys on four plans, and the arena."""
    found: dict[str, list[np.ndarray]] = {}
    for seed in range(11, 17):
        building = office(seed, SIZES[1])
        driven = building.drive(
            SENSORS["utm30lx"],
            seed=seed,
            speed=SPEED,
            rate=4.0,
            people=6,
            wheels=Wheels(),
            moving=True,
        )
        scans, truth = list(islice(driven[0], 240)), np.array(driven[1][:240])
        worlds = building.plan, building.moved(seed).plan, building.mirrored()
        other = office(seed + 6000, SIZES[1]).plan
        for name, world in zip(
            ("own", "moved", "mirrored", "other"), (*worlds, other), strict=True
        ):
            plan = plan_of(world)
            found.setdefault(name, []).append(followed(scans, truth, plan, True))
            plan = LineMap(plan.walls, sigma=MAPPED)
            found.setdefault(f"{name}, sigma={MAPPED:g}", []).append(
                followed(scans, truth, plan, True)
            )
        sparse = followed(scans[::3], truth[::3], plan_of(worlds[2]), True)
        found.setdefault("mirrored, a scan each 0.75 m", []).append(sparse)
    print("| plan | scans | located | right | median error | χ²/3 |\n|---|--:|--:|--:|--:|--:|")
    for name, parts in found.items():
        _print_followed(name, np.concatenate(parts))
    for name, file in ARENA:
        if (recorded := arena_of(file)) is not None:
            archive, scans = recorded
            for sigma, known in ((0.005, 0.0), (0.015, 0.0), (0.015, 0.01)):
                plan = LineMap.from_lines(archive["gt_segments"], sigma=sigma)
                rows = followed(scans[::2], archive["poses_refined"][::2], plan, False, known)
                _print_followed(f"arena, {name}, sigma={sigma}, truth ± {1000 * known:g} mm", rows)


def _print_followed(name: str, rows: np.ndarray) -> None:
    where = rows[rows[:, 0] > 0]
    right = (where[:, 1] < RIGHT[0]) & (where[:, 2] < RIGHT[1])
    print(
        f"| {name} | {len(rows)} | {len(where)} | {right.sum()} | "
        + (f"{1000 * np.median(where[:, 1]):.1f} mm | {where[:, 3].mean():.2f} |" if len(where)
           else "– | – |")
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--queries", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--keep", type=Path, help="folder where the local maps are kept")
    parser.add_argument("--most", type=int, help="local maps of a storey")
    parser.add_argument("--follow", action="store_true", help="follow logs instead")
    parser.add_argument("--built", action="store_true", help="places in buildings off their plans")
    options = parser.parse_args()
    if options.built:
        built(options.seed)
        return
    if options.follow:
        follow_all()
        return
    done: list[np.ndarray] = []
    seed, running = options.seed, set()
    with ProcessPoolExecutor(options.workers) as pool:
        while sum(map(len, done)) < options.queries:
            while len(running) < options.workers:
                running.add(pool.submit(judge, seed, options.most, options.keep))
                seed += 1
            ready = next(as_completed(running))
            running.remove(ready)
            done.append(ready.result())
            if options.keep is not None:
                np.save(options.keep / "rows.npy", np.concatenate(done))
            print(f"{sum(map(len, done))} of {options.queries} queries", file=sys.stderr)
        for waiting in running:
            waiting.cancel()
    rows = np.concatenate(done)
    table(rows)
    arena()


if __name__ == "__main__":
    main()
