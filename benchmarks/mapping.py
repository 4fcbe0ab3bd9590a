"""Maps of logs, without odometry, beside ICP with the same loops: ``python benchmarks/mapping.py``.

Recordings are looked for in ``LINEAMENT_DATA``. ``--storey SEED`` adds a simulated storey, with
odometry and without.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

from lineament import Extractor
from lineament.evaluation.icp import icp
from lineament.evaluation.maps import absolute_errors, doubled_walls
from lineament.evaluation.relations import read_relations
from lineament.logs import open_log
from lineament.mapping.adjust import edges_of, optimise
from lineament.mapping.drive_map import Drive
from lineament.mapping.making import make_map
from lineament.scan.poses import compose
from lineament.simulation import SENSORS, Wheels, office

DATA = Path(os.environ.get("LINEAMENT_DATA", "../shared/data"))
LOGS = {
    "Intel lab": ("truth/intel_graph.npz", "graph/intel-lab.relations"),
    "fr079": ("truth/fr079_graph.npz", "../relations/fr079.relations"),
}
COLUMNS = (
    "log",
    "poses",
    "way [mm]",
    "median",
    "turn [°]",
    "over 60 s [mm]",
    "ATE [m]",
    "doubled [m]",
)
#: Errors of ICP from key frame to key frame [m, m, rad].
ICP = np.diag((0.02, 0.02, 0.005)) ** 2


def drive(scans, odometry):
    extract, found = Extractor(), Drive()
    for scan in scans:
        found.add(scan, extract(scan), scan.pose if odometry else None)
    return found


def rival(found, loops):
    """Poses of all scans by ICP from key frame to key frame, with the same loops."""
    frames = found.frames
    motions = [icp(a.scan, b.scan) for a, b in pairwise(frames)]
    start = [(0.0, 0.0, 0.0)]
    for motion in motions:
        start.append(compose(start[-1], motion))
    n = len(motions)
    pairs = [(k, k + 1) for k in range(n)]
    both = np.append(edges_of(pairs, motions, np.tile(ICP, (n, 1, 1))), loops)
    both["loop"] = True  # a lost turn is one wrong motion of many: all may be wrong
    poses = optimise(np.array(start), both, rounds=40).poses
    return placed(found, poses)


def placed(found, frames):
    return [compose(tuple(frames[k]), pose) for k, pose in found.scans]


def judged(name, about, poses, truth, relations, doubled=None):
    cells = [name, about]
    if relations is None:
        cells += ["–"] * 4
    else:
        every, far = (of.errors(poses).summary() for of in (relations, relations.far_apart()))
        cells += [
            f"{1e3 * every['way_mean']:.1f} ± {1e3 * every['way_std']:.1f}",
            f"{1e3 * every['way_median']:.1f}",
            f"{math.degrees(every['turn_mean']):.3f} ± {math.degrees(every['turn_std']):.3f}",
            f"{1e3 * far['way_mean']:.1f} ({far['motions']})",
        ]
    cells.append(f"{absolute_errors(poses, truth).summary()['way_rmse']:.3f}")
    cells.append("–" if doubled is None else doubled)
    print("|" + "|".join(cells) + "|", flush=True)


def rows(name, scans, truth, relations, odometry=False):
    started = time.process_time()
    found = drive(scans, odometry)
    made = make_map(found.frames, found.scans)
    seconds = time.process_time() - started
    ends = np.column_stack((made.map.walls["start"], made.map.walls["end"]))
    length = np.hypot(*(ends[:, 2:] - ends[:, :2]).T).sum()
    judged(name, "motions alone", placed(found, [f.pose for f in found.frames]), truth, relations)
    judged(
        name, "`map`", made.poses, truth, relations, f"{doubled_walls(ends):.0f} of {length:.0f}"
    )
    judged(name, "ICP, the same loops", rival(found, made.loops), truth, relations)
    played = scans[-1].stamp - scans[0].stamp
    lost = sum(frame.is_lost for frame in found.frames)
    print(
        f"<!-- {name}: {len(scans)} scans, {len(found.frames)} key frames, lost {lost}, "
        f"{len(made.loops)} loops; {seconds:.0f} s of processor, played in {played:.0f} s -->"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--storey", type=int, help="seed of a simulated storey of 60 m x 40 m")
    chosen = parser.parse_args()
    print("|" + "|".join(COLUMNS) + "|\n" + "|---" * len(COLUMNS) + "|")
    for name, (path, relations) in LOGS.items():
        if chosen.storey is not None or not (DATA / path).exists():
            continue
        scans = sorted(open_log(DATA / path), key=lambda scan: scan.stamp)
        stamps = np.array([scan.stamp for scan in scans])
        verified = read_relations(DATA / relations, stamps)
        truth = [scan.pose for scan in scans]
        judged(name, "the log’s corrected poses", truth, truth, verified)
        rows(name, scans, truth, verified)
    if chosen.storey is not None:
        for odometry in (True, False):
            made, truth = office(chosen.storey).drive(
                SENSORS["utm30lx"], seed=chosen.storey, rate=5, people=8, wheels=Wheels()
            )
            about = "a storey, wheels" if odometry else "a storey, no odometry"
            rows(about, list(made), truth, None, odometry)


if __name__ == "__main__":
    main()
