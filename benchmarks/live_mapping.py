"""How fast a map is made while its scans come, on one core: ``python benchmarks/live_mapping.py``.

A simulated storey with people and wheels that slip. Scans come at their rate, or with ``--no-wait``
as fast as they are taken; the process that closes loops runs on the same core. ``--picture FILE``
simulates scans meanwhile, on all cores, and writes a moving picture of what is known.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import time
from itertools import islice
from pathlib import Path

import numpy as np
from lineament_lab.evaluation.maps import absolute_errors
from mapping import loops_off, wrong_loops
from moving_picture import BEAM, LOST, ROBOT, SEEN, WALL, Film
from moving_picture import moved as placed

from lineament import Extractor
from lineament.mapping.making import DriveMap
from lineament.mapping.mapper import Mapper
from lineament.scan import Pose
from lineament.scan.poses import compose, relative
from lineament.simulation import SENSORS, Wheels, office

#: Pictures of a film, and how long each is shown [ms].
_PICTURES, _SHOWN = 90, 130


def film(path: Path, taken: list, made: DriveMap, way: np.ndarray, start: Pose) -> None:
    """Write a film of the drafts, scans, poses and places that were not sure, one after the other.

    Loops are those of the last map, shown once both of their ends are on the draft. All is drawn in
    the frame of the building, in which the robot begins at `start`.
    """
    shown, way = Film(placed(made.map.ends.reshape(-1, 2), start)), placed(way, start)
    for k, draft, scan, where, unsure in taken:
        known = draft.frames if draft else 0
        loops = made.loops["ends"][(made.loops["ends"] < known).all(axis=1)]
        axes = shown.begin(
            f"$ lineament live --mapping plan.svg   {k:5d} scans {len(loops):3d} loops"
        )
        if draft:
            walls = placed(draft.map.ends.reshape(-1, 2), start)
            shown.lines(walls[::2], walls[1::2], WALL, 0.7)
        here = compose(start, where.pose)
        points = placed(scan.points[scan.valid][::12], here)
        shown.lines(np.tile(here[:2], (len(points), 1)), points, BEAM, 0.4)
        axes.plot(*way[: k + 1].T, color=LOST, linewidth=0.6)
        axes.plot(*way[unsure].T, ".", color=SEEN, markersize=3)
        ends = placed(made.survey.poses[loops.ravel(), :2], start)
        shown.lines(ends[::2], ends[1::2], ROBOT, 2.0)
        axes.plot(*ends.T, ".", color=ROBOT, markersize=3)
        large = np.array([(3.0, 0.0), (-2.0, 1.6), (-2.0, -1.6)])
        axes.fill(*placed(large, here).T, color=ROBOT if where else SEEN, zorder=5)
        shown.take()
    shown.take(12)
    shown.save(path, _SHOWN)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--size", type=float, nargs=2, default=(60.0, 40.0), metavar="M")
    parser.add_argument("--rate", type=float, default=40.0, help="scans in a second")
    parser.add_argument("--scans", type=int, default=4000)
    parser.add_argument("--people", type=int, default=8)
    parser.add_argument("--no-wait", action="store_true")
    parser.add_argument("--faster", type=float, default=1.0, help="so often as fast as they play")
    parser.add_argument("--picture", type=Path, help="GIF of what is known, from scan to scan")
    chosen = parser.parse_args()
    building = office(chosen.seed, tuple(chosen.size))
    scans, truth = building.drive(
        SENSORS["utm30lx"],
        seed=chosen.seed,
        rate=chosen.rate,
        people=chosen.people,
        wheels=Wheels(),
    )
    truth = truth[: chosen.scans]
    count, scans = len(truth), islice(scans, len(truth))
    if chosen.picture is None:
        scans = list(scans)
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    extract, mapper, taken, used, off, drafts = Extractor(), Mapper(), [], [], [], set()
    way, unsure, pictures = np.zeros((count, 2)), [], []
    extract(SENSORS["utm30lx"].scan(building.world, truth[0], np.random.default_rng(0)))
    began = time.perf_counter()
    for k, scan in enumerate(scans):
        if not chosen.no_wait:
            due = began + k / (chosen.rate * chosen.faster)
            time.sleep(max(due - time.perf_counter(), 0.0))
        at, used_at = time.perf_counter(), time.thread_time()
        where = mapper.step(extract(scan), scan.pose)
        taken.append(1e3 * (time.perf_counter() - at))
        used.append(1e3 * (time.thread_time() - used_at))
        off.append(math.dist(where.pose[:2], relative(truth[0], truth[k])[:2]))
        drafts.add(mapper.draft and mapper.draft.frames)
        way[k] = where.pose[:2]
        unsure += [] if where else [k]
        if chosen.picture and (k * _PICTURES // count != (k + 1) * _PICTURES // count):
            pictures.append((k, mapper.draft, scan, where, list(unsure)))
    seconds = time.perf_counter() - began
    p50, p99, most = np.quantile(taken, (0.5, 0.99, 1.0))
    print(
        f"{count} scans of {len(scan)} beams, {len(mapper.drive.frames)} key frames, "
        f"{count / seconds:.0f} scans/s; a scan takes {p50:.2f} ms, 99 % at most "
        f"{p99:.1f} ms, all {most:.1f} ms; {len(drafts - {None})} drafts; live poses are off by "
        f"{np.median(off):.3f} m, at most {max(off):.3f} m; not sure at {len(unsure)} scans"
    )
    at = time.perf_counter()
    made = mapper.finish()
    print(f"{made.map}, {made.parts.count} part(s), made in {time.perf_counter() - at:.1f} s")
    loops = loops_off(mapper.drive, made, truth)
    kinds = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    memory = [f"{resource.getrusage(of).ru_maxrss / 1024:.0f} MB" for of in kinds]
    p50, p99 = np.quantile(used, (0.5, 0.99))
    print(
        f"{sum(made.ways):.0f} m, not sure on {sum(of for *_, of in made.unsure):.1f} m; ATE "
        f"{absolute_errors(made.poses, truth).summary()['way_rmse']:.3f} m; {len(loops)} loops, "
        f"{wrong_loops(loops).sum()} wrong; a scan takes {p50:.2f} ms of processor, 99 % at most "
        f"{p99:.1f} ms; memory {memory[0]}, the process beside it {memory[1]}"
    )
    if chosen.picture:
        film(chosen.picture, pictures, made, way, truth[0])
        print(f"{chosen.picture}: {chosen.picture.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
