"""Runs a program of others on our scenes and scores what it finds: by files alone, see README.md.

python benchmarks/peers/run.py ./peer --sensor paper --frames 10
"""

import argparse
import csv
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from lineament_lab.evaluation import Scores, evaluate
from lineament_lab.reproduce.findings import Table
from lineament_lab.reproduce.scans import Frame, scene_numbers, simulated_frames

from lineament import Extractor, LaserScan
from lineament.features import TABLES, Features
from lineament.simulation import SCENES, SENSORS

#: Lines meet in a corner if both end within so much of where they do [m].
REACH = 0.3
COLUMNS = {
    "corner F1": "corner_f1_0.10",
    "precision": "corner_precision_0.10",
    "recall": "corner_recall_0.10",
    "median error [mm]": "corner_median_error",
    "segment F1": "segment_f1",
    "µs a scan": "time",
}

#: What a program wrote of one scan: segments (n, 4), corners (m, 2) [m], and its time [µs].
Found = tuple[list[list[float]], list[list[float]], list[float]]


def write_scans(scans: Sequence[LaserScan], path: Path) -> None:
    """Write a line for each scan: bearings, limits, ranges; what is invalid is empty."""
    with path.open("w", encoding="utf-8", newline="") as file:
        for scan in scans:
            limits = scan.angle_min, scan.angle_increment, scan.range_min, scan.range_max
            ranges = np.where(scan.valid, scan.ranges, np.nan).tolist()
            row = [*map(repr, map(float, limits)), *("" if r != r else repr(r) for r in ranges)]
            csv.writer(file).writerow(row)


def read_features(path: Path, count: int) -> list[Found]:
    """Read what a program found in so many scans; ValueError names the line that is wrong."""
    found: dict[int, Found] = {number: ([], [], []) for number in range(count)}
    kinds = {"segment": (0, 4), "corner": (1, 2), "time": (2, 1)}
    for number, row in enumerate(csv.reader(path.read_text(encoding="utf-8").splitlines()), 1):
        try:
            place, width = kinds[row[1].strip()]
            values = [float(value) for value in row[2:]]
            if len(values) != width or not np.isfinite(values).all():
                raise ValueError
            of_scan = found[int(row[0])]
        except (LookupError, ValueError):
            kind = "scan,segment,x1,y1,x2,y2, scan,corner,x,y or scan,time,microseconds"
            raise ValueError(f"{path}, line {number}: {','.join(row)!r}, expected {kind}") from None
        of_scan[place].append(values if width > 1 else values[0])
    return list(found.values())


def features_of(scan: LaserScan, found: Found) -> Features:
    """Make features of what a program found, for our metrics; without covariances."""
    ends = np.reshape(found[0], (-1, 4))
    bearings = np.arctan2(ends[:, 1::2], ends[:, ::2])
    beams = np.rint((bearings - scan.angle_min) / scan.angle_increment)
    beams = np.clip(np.sort(beams, axis=1), 0, len(scan) - 1).astype(int)
    order = np.argsort(beams[:, 0], kind="stable")
    ends, beams = ends[order], beams[order]
    tables = {name: np.zeros(0, dtype) for name, dtype in TABLES.items()}
    tables["segments"] = segments = np.zeros(len(ends), TABLES["segments"])
    start, end = ends[:, :2], ends[:, 2:]
    segments["start"], segments["end"], segments["centroid"] = start, end, (start + end) / 2
    x, y = (end - start).T
    segments["angle"], segments["length"] = np.arctan2(y, x), np.hypot(x, y)
    segments["first_beam"], segments["last_beam"] = beams.T
    segments["n_points"] = beams[:, 1] - beams[:, 0] + 1
    corners = np.reshape(found[1], (-1, 2)) if found[1] else intersections(ends)
    tables["corners"] = np.zeros(len(corners), TABLES["corners"])
    tables["corners"]["position"], tables["corners"]["segments"] = corners, -1
    return Features(**tables, clusters=np.full(len(scan), -1, np.int32))


def intersections(ends: np.ndarray) -> np.ndarray:
    """Return where neighbouring segments meet, if both end within `REACH` of it; (m, 2) [m]."""
    corners = []
    for one, other in pairwise(ends.reshape(-1, 2, 2)):
        arms = np.column_stack((one[1] - one[0], other[0] - other[1]))
        if abs(np.linalg.det(arms)) > 1e-6:
            along = np.linalg.solve(arms, other[0] - one[0])[0]
            point = one[0] + along * (one[1] - one[0])
            near = [np.hypot(*(wall - point).T).min() <= REACH for wall in (one, other)]
            if all(near):
                corners.append(point)
    return np.reshape(corners, (-1, 2))


def run(command: Sequence[str], frames: Sequence[Frame]) -> dict[str, float]:
    """Run a program on scans and score what it finds."""
    scans = [frame.scan for frame in frames]
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder, "scans.csv"), Path(folder, "features.csv")
        write_scans(scans, given)
        subprocess.run([*command, str(given), str(made)], check=True)
        found = read_features(made, len(scans))
    scores = (
        evaluate(features_of(frame.scan, of), frame.truth)
        for frame, of in zip(frames, found, strict=True)
    )
    taken = [time for _, _, times in found for time in times]
    return {
        **Scores.total(scores).summary(),
        **({"time": float(np.median(taken))} if taken else {}),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("command", nargs="+", help="the program and its arguments")
    parser.add_argument("--sensor", choices=SENSORS, default="paper")
    parser.add_argument("--frames", type=int, default=10, help="scans of each kind of scene")
    given = parser.parse_args()
    numbers = scene_numbers(len(SCENES) * given.frames, 0)
    frames = list(simulated_frames(SENSORS[given.sensor], SCENES, numbers))
    ours = (evaluate(Extractor()(frame.scan), frame.truth) for frame in frames)
    try:
        rows = {Path(given.command[0]).name: run(given.command, frames)}
    except (OSError, ValueError, subprocess.CalledProcessError) as error:
        sys.exit(f"run.py: {error}")
    rows["optimal"] = Scores.total(ours).summary()
    title = f"{given.sensor}, {len(frames)} scans"
    print(Table.of_numbers(title, rows, COLUMNS, first="program"))


if __name__ == "__main__":
    main()
