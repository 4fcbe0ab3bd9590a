"""Maps of logs, without odometry or with, beside ICP: ``python benchmarks/mapping.py``.

ICP has the same loops.
Recordings are looked for in ``LINEAMENT_DATA``. ``--storey SEED`` is a simulated storey instead,
with odometry and without; ``--storeys 12 --storey 61`` many smaller ones, with odometry.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
import zipfile
from itertools import islice, pairwise, permutations
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from lineament_lab.evaluation.icp import icp
from lineament_lab.evaluation.maps import absolute_errors, contradicted, doubled_walls
from lineament_lab.evaluation.relations import Relations, read_relations
from matplotlib.collections import LineCollection
from recordings import DATA, LOGS

from lineament import Extractor
from lineament.logs import open_log
from lineament.mapping import LineMap
from lineament.mapping.adjust import edges_of, optimise
from lineament.mapping.drive_map import Drive
from lineament.mapping.making import make_map
from lineament.scan.poses import compose, inverse, relative
from lineament.simulation import SENSORS, Wheels, office
from lineament.walls import moved, walls_of, wrapped

#: What motions are compared with: verified relations, or the loops of the log itself.
RELATIONS = {
    "Intel lab": "graph/intel-lab.relations",
    "fr079": "../relations/fr079.relations",
    "Killian": LOGS["Killian"],
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


def closures(path, stamps):
    """Return the loop closures of a g2o in a zip, which its poses were corrected with."""
    with zipfile.ZipFile(path) as packed:
        name = next(name for name in packed.namelist() if name.endswith(".g2o"))
        rows = [line.split() for line in packed.read(name).decode("latin-1").splitlines()]
    vertices = [row[1] for row in rows if row[:1] == ["VERTEX_SE2"]]
    number = {vertex: k for k, vertex in enumerate(vertices)}
    edges = [row for row in rows if row[:1] == ["EDGE_SE2"]]
    scans = np.array([[number[a], number[b]] for _, a, b, *_ in edges])
    motions = np.array([row[3:6] for row in edges], float)
    far = abs(np.diff(scans)[:, 0]) > 1
    return Relations(scans[far], motions[far], abs(np.diff(stamps[scans])[:, 0])[far])


def backwards(scans):
    """Return scans in the reverse order, with stamps that grow."""
    last = scans[-1].stamp_ns
    return [scan.stamped(scan.stamp_beam, last - scan.stamp_ns) for scan in scans[::-1]]


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


def wrong_steps(found, truth):
    """Whether each step from scan to scan, but where it is lost, is off by over 0.3 m or rad."""
    poses = placed(found, [frame.pose for frame in found.frames])
    lost = [frame.index for frame in found.frames if frame.is_torn]
    kept = np.setdiff1d(np.arange(1, len(poses)), lost).tolist()
    off = [relative(relative(*truth[k - 1 : k + 1]), relative(*poses[k - 1 : k + 1])) for k in kept]
    return [math.hypot(x, y) > 0.3 or abs(theta) > 0.3 for x, y, theta in off]


def by_part(made, truth):
    """Way of each part [m], its ATE [m] where it is sure, and the deviation that it claims [m]."""
    part, is_sure = (of[made.frame_of] for of in (made.parts.numbers, made.parts.is_sure))
    for k, (way, known) in enumerate(zip(made.ways, made.parts.deviations, strict=True)):
        chosen = np.flatnonzero((part == k) & is_sure).tolist()
        found = absolute_errors(*([of[i] for i in chosen] for of in (made.poses, truth)))
        yield f"{way:.0f} m, ATE {found.summary()['way_rmse']:.3f} m, claimed {known:.3f} m"


def seen_again(found, made, truth):
    """Pairs of key frames of one part that look at a place again, and how many contradict there.

    By the poses of the map, and by the corrected ones.
    """
    part, pairs = made.parts.numbers, []
    for k in range(made.parts.count):
        frames = [found.frames[i] for i in np.flatnonzero(part == k)]
        poses = [[of[frame.index] for frame in frames] for of in (made.poses, truth)]
        pairs.append(contradicted([frame.scan for frame in frames], *poses))
    count = sum(n for n, _ in pairs)
    ours, reference = sum(n * np.nan_to_num(shares) for n, shares in pairs) / max(count, 1)
    return (
        f"{count} pairs of scans look at a place again, {100 * ours:.1f} % contradict each other "
        f"({100 * reference:.1f} % at the corrected poses)"
    )


def judged(name, about, poses, truth, relations, doubled=None, parts=1):
    cells = [name, about]
    if relations is None or parts > 1:  # parts lie beside each other
        cells += ["–"] * 4
    else:
        every, far = (of.errors(poses).summary() for of in (relations, relations.far_apart()))
        cells += [
            f"{1e3 * every['way_mean']:.1f} ± {1e3 * every['way_std']:.1f}",
            f"{1e3 * every['way_median']:.1f}",
            f"{math.degrees(every['turn_mean']):.3f} ± {math.degrees(every['turn_std']):.3f}",
            f"{1e3 * far['way_mean']:.1f} ({far['motions']})",
        ]
    apart = f"in {parts} parts"  # drawn beside each other: they have no common error
    error = absolute_errors(poses, truth).summary()["way_rmse"]
    cells.append(f"{error:.3f}" if parts == 1 else apart)
    cells.append("–" if doubled is None else doubled)
    print("|" + "|".join(cells) + "|", flush=True)


def rows(name, scans, truth, relations, odometry=False):
    clocks = time.process_time, time.perf_counter
    started = [clock() for clock in clocks]
    found = drive(scans, odometry)
    made = make_map(found.frames, found.scans)
    used, seconds = (clock() - start for clock, start in zip(clocks, started, strict=True))
    ends = made.map.ends.reshape(-1, 4)
    length = np.hypot(*(ends[:, 2:] - ends[:, :2]).T).sum()
    about = f"{doubled_walls(ends):.0f} of {length:.0f}"
    judged(name, "motions alone", placed(found, [f.pose for f in found.frames]), truth, relations)
    judged(name, "`map`", made.poses, truth, relations, about, made.parts.count)
    judged(name, "ICP, the same loops", rival(found, made.loops), truth, relations)
    played = scans[-1].stamp - scans[0].stamp
    lost, wrong = sum(frame.is_lost for frame in found.frames), wrong_steps(found, truth)
    print(
        f"<!-- {name}: {len(scans)} scans, {len(found.frames)} key frames, lost {lost}, "
        f"{sum(wrong)} of {len(wrong)} steps off by over 0.3 m or rad, "
        f"{len(made.loops)} loops, {len(made.refused)} refused; played in {played:.0f} s; "
        f"{used:.1f} s of processor: {played / used:.1f} x; "
        f"{seconds:.1f} s by the clock: {played / seconds:.1f} x; not sure on "
        f"{sum(way for *_, way in made.unsure):.1f} m; parts: {'; '.join(by_part(made, truth))}; "
        f"{seen_again(found, made, truth)} -->"
    )
    return found, made


def loops_off(found, made, truth):
    """How far loops are off the true motions, shape (n, 3) [m, m, rad]."""
    at = [truth[frame.index] for frame in found.frames]
    pairs = zip(made.loops["ends"].tolist(), made.loops["motion"].tolist(), strict=True)
    off = [relative(relative(at[a], at[b]), tuple(motion)) for (a, b), motion in pairs]
    return np.array(off).reshape(-1, 3)


def wrong_loops(off):
    """Whether each loop is off by more than 0.2 m or 1°."""
    return (np.hypot(off[:, 0], off[:, 1]) > 0.2) | (abs(off[:, 2]) > math.radians(1))


def nees(made, truth, segments):
    """Squares of offset and angle of walls off the true ones (n, 2), over their variances."""
    lines, found = segments[:, 2:] - segments[:, :2], []
    lengths = np.hypot(*lines.T)
    u, angles = lines / lengths[:, None], np.arctan2(lines[:, 1], lines[:, 0])
    for wall in moved(made.map.walls, inverse(truth[0])):
        arm = wall["centroid"] - segments[:, :2]
        along, off = (arm * u).sum(axis=1), u[:, 0] * arm[:, 1] - u[:, 1] * arm[:, 0]
        turn = wrapped(wall["angle"] - angles)
        near = (abs(turn) < 0.2) & (abs(off) < 0.05) & (along > -0.1) & (along < lengths + 0.1)
        if near.any() and math.dist(wall["start"], wall["end"]) > 0.3:
            k = np.where(near, abs(off), np.inf).argmin()
            found.append(np.square((off[k], turn[k])) / np.diag(wall["covariance"]))
    return np.array(found)


def against_truth(found, made, truth, segments):
    """Return how far loops are off, spans of over 10 m by their lengths, and `nees` of walls."""
    a, b = (np.array(poses)[::20, None, :2] for poses in (made.poses, truth))
    a, b = (np.linalg.norm(of - of[:, 0], axis=2) for of in (a, b))
    far = b > 10
    return loops_off(found, made, truth), a[far] / b[far] - 1, nees(made, truth, segments)


def print_truth(off, spans, squares):
    """Print what is known of simulated storeys alone."""
    mean, median = squares.mean(axis=0), np.median(squares, axis=0)
    print(
        f"<!-- {len(off)} loops, {wrong_loops(off).sum()} wrong; spans over 10 m off by "
        f"{100 * np.std(spans):.4f} %, at most {100 * abs(spans).max():.4f} %; squares of "
        f"{len(squares)} walls over their variances: offsets {mean[0]:.2f} (median "
        f"{median[0]:.2f}), angles {mean[1]:.2f} ({median[1]:.2f}) -->",
        flush=True,
    )


def draw(path, made, walls, about):
    """Draw a map beside another."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
    for axis, ends, title in zip(
        axes, (made.map.ends, walls), ("lineament map", about), strict=True
    ):
        axis.add_collection(LineCollection(ends, colors="k", linewidths=0.5))
        axis.autoscale()
        axis.set(aspect="equal", title=title)
    figure.savefig(path, dpi=80)


def corrected(found, truth):
    """Walls of the key frames at poses that were corrected, in the frame of the first."""
    features = (frame.features for frame in found.frames)
    poses = [relative(truth[0], truth[frame.index]) for frame in found.frames]
    return LineMap.from_features(features, poses, min_views=3).ends


def driven(seed, size, rate):
    """Return a building, the scans of a drive with wheels that slip, and where they were taken."""
    building = office(seed, size)
    scans, truth = building.drive(
        SENSORS["utm30lx"], seed=seed, rate=rate, people=8, wheels=Wheels()
    )
    return building, list(scans), truth


def storey(seed, rate, pictures):
    building, scans, truth = driven(seed, (60.0, 40.0), rate)
    for odometry in (True, False):
        about = f"storey {seed}, {'wheels' if odometry else 'no odometry'}"
        found, made = rows(about, scans, truth, None, odometry)
        print_truth(*against_truth(found, made, truth, building.world.segments))
        if pictures and odometry:
            walls = moved(walls_of(building.world.segments.reshape(-1, 2, 2)), truth[0])
            ends = np.stack((walls["start"], walls["end"]), axis=1)
            draw(pictures / "map_storey.png", made, ends, "the building")


def storeys(first, count, rate):
    """Print what many storeys of 30 m x 20 m say together, with wheels."""
    parts = []
    for seed in range(first, first + count):
        building, scans, truth = driven(seed, (30.0, 20.0), rate)
        found = drive(scans, odometry=True)
        made = make_map(found.frames, found.scans)
        parts.append(against_truth(found, made, truth, building.world.segments))
        print(f"{len(parts)} of {count} storeys", file=sys.stderr)
    print_truth(*(np.concatenate(of) for of in zip(*parts, strict=True)))


def floors(seeds):
    """Print how often two floors in one log are parts of their own, without odometry and with.

    Odometry stands still in the lift.
    """
    drives = {}
    for seed in seeds:
        storey = office(seed, (24.0, 16.0), visits=0.1)
        scans, _ = storey.drive(SENSORS["utm30lx"], seed=1, rate=2, people=2, wheels=Wheels())
        drives[seed] = list(islice(scans, 80))
    pairs = list(permutations(drives.values(), 2))
    for odometry in (False, True):
        apart = 0
        for below, above in pairs:
            lift = compose(below[-1].pose, inverse(above[0].pose))
            both = [*below, *(scan.with_pose(compose(lift, scan.pose)) for scan in above)]
            found = drive(both, odometry)
            made = make_map(found.frames, found.scans)
            of = made.parts.numbers[made.frame_of].tolist()
            apart += not set(of[: len(below)]) & set(of[len(below) :])
        about = "with odometry" if odometry else "without"
        print(f"{len(pairs)} pairs of floors {about}: {apart} in parts of their own", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--storey", type=int, help="seed of a simulated storey of 60 m x 40 m")
    parser.add_argument("--storeys", type=int, help="so many of 30 m x 20 m, the seed is the first")
    parser.add_argument("--rate", type=float, default=5.0, help="scans of it in a second")
    parser.add_argument("--log", choices=LOGS, help="this log alone")
    parser.add_argument("--odometry", action="store_true", help="the poses of the log are it")
    parser.add_argument("--backwards", action="store_true", help="the last scan comes first")
    parser.add_argument("--first", type=int, default=0, help="leave out so many scans before")
    parser.add_argument("--every", type=int, default=1, help="every so many scans alone")
    parser.add_argument("--pictures", type=Path, help="folder for maps beside what they are of")
    parser.add_argument("--floors", type=int, nargs="+", help="seeds of floors, each two one log")
    chosen = parser.parse_args()
    if chosen.floors:
        floors(chosen.floors)
        return
    if chosen.storeys is not None:
        storeys(chosen.storey or 1, chosen.storeys, chosen.rate)
        return
    print("|" + "|".join(COLUMNS) + "|\n" + "|---" * len(COLUMNS) + "|")
    if chosen.storey is not None:
        storey(chosen.storey, chosen.rate, chosen.pictures)
        return
    for name, path in LOGS.items():
        if chosen.log not in (None, name) or not (DATA / path).exists():
            continue
        scans = list(open_log(DATA / path))[chosen.first :: chosen.every]
        relations = RELATIONS.get(name)
        if chosen.backwards:
            scans, relations = backwards(scans), None
        stamps = np.array([scan.stamp for scan in scans])
        read = closures if relations == path else read_relations
        verified = relations and read(DATA / relations, stamps)
        truth = [scan.pose for scan in scans]
        judged(name, "the log’s corrected poses", truth, truth, verified)
        found, made = rows(name, scans, truth, verified, chosen.odometry)
        if chosen.pictures:
            path = chosen.pictures / f"map_{name.split()[0].lower()}.png"
            draw(path, made, corrected(found, truth), "walls at the log’s corrected poses")


if __name__ == "__main__":
    main()
