"""The tables of docs/calibrate.md: ``python benchmarks/calibrating.py --drives 32 --seed 700``.

A robot drives along rooms of simulated storeys with furniture and people, a scanner mounted
anywhere on it; its wheels have other radii and another track than is believed, slip, and jolt now
and then. Odometry is counted 100 times a second.

``--real intel_wheels.npz`` measures a recording with wheels in place of it: `ranges`, `angle_min`,
`angle_increment`, the poses by the wheels (`odometry`), and corrected poses of the laser
(`known_poses`) of some scans (`known`). Each half of it is calibrated by itself, too.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import ros_bags

from lineament.logs import save_npz
from lineament.scan import LaserScan
from lineament.scan.poses import compose, poses_along, twist_between
from lineament.simulation import SENSORS
from lineament.simulation.buildings import office
from lineament.simulation.drive import drive_poses
from lineament.simulation.wheels import Wheels
from lineament.tasks.calibrate import Calibrated, calibrate_log

TRACK, SPEED, RATE, TICKS = 0.4, 0.8, 10, 100


def errors_of(wheels: Wheels, seed: int) -> tuple[np.ndarray, float]:
    """Return by what the radii of both wheels and the track are believed to be larger."""
    rng = np.random.default_rng([seed, 5])  # as `Wheels.odometry` draws them
    radii = 1.0 + wheels.radius * rng.standard_normal(2)
    return radii, 1.0 + wheels.base * rng.standard_normal()


def scans_of(seed: int, metres: float) -> tuple[list[LaserScan], np.ndarray, float]:
    """Drive; the scans with the poses of the wheels, what is to be found, the believed track."""
    rng = np.random.default_rng([seed, 11])
    building, sensor, wheels = office(seed, (40.0, 24.0)), SENSORS["utm30lx"], Wheels(TRACK)
    stamps, poses = drive_poses(building.waypoints, SPEED, 1.0, TICKS)
    x, y, theta = rng.uniform((-0.3, -0.15, -math.pi), (0.3, 0.15, math.pi)).tolist()
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T).cumsum()
    n = int(np.searchsorted(steps, metres)) + 1
    truth = [(px, py, turn) for px, py, turn in poses[:n].tolist()]
    believed = wheels.odometry(truth, seed)
    scans = []
    for i in range(0, n, TICKS // RATE):
        world = building.with_people(seed, float(stamps[i]), truth[i], 6)
        at = compose(truth[i], (x, y, theta))
        scan = sensor.scan(world, at, np.random.default_rng([seed, i]), float(stamps[i]))
        scans.append(scan.with_pose(believed[i]))
    radii, base = errors_of(wheels, seed)
    return scans, np.array((x, y, theta, 1 / radii[0], 1 / radii[1], TRACK)), TRACK * base


def calibrated(scans: list[LaserScan], believed: float) -> Calibrated:
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.npz"
        save_npz(log, scans)
        return calibrate_log(log, track_width=believed, deskewed=False)


def against(seed: int, metres: float) -> tuple[str, np.ndarray, np.ndarray]:
    """Drive with two scanners; about the drive, errors of the mounting, and its covariance."""
    rng, messages, items = np.random.default_rng([seed, 12]), ros_bags.Messages(2), []
    building, sensor = office(seed, (40.0, 24.0)), SENSORS["utm30lx"]
    stamps, poses = drive_poses(building.waypoints, SPEED, 1.0, RATE)
    x, y, theta = rng.uniform((-0.4, -0.4, -math.pi), (0.4, 0.4, math.pi)).tolist()
    n = int(np.searchsorted(np.hypot(*np.diff(poses[:, :2], axis=0).T).cumsum(), metres)) + 1
    for i, (stamp, pose) in enumerate(zip(stamps[:n].tolist(), poses[:n].tolist(), strict=True)):
        front = (pose[0], pose[1], pose[2])
        world = building.with_people(seed, stamp, front, 6)
        for k, at in enumerate((front, compose(front, (x, y, theta)))):
            scan = sensor.scan(world, at, np.random.default_rng([seed, i, k]))
            names = ("angle_min", "angle_increment", "range_min", "range_max")
            fields = {name: getattr(scan, name) for name in names} | {"scan_time": 0.0}
            ranges = np.where(scan.valid, scan.ranges, np.inf).tolist()
            items.append((f"/{k}", int(stamp * 1e9), messages.scan(stamp, ranges, **fields)))
    with tempfile.TemporaryDirectory() as folder:
        log = ros_bags.write(Path(folder), "mcap-zstd", items)
        done = calibrate_log(log, against="/0", topic="/1", roughness=0.0)
    error = np.array(list(done.found.values.values())) - (x, y, theta)
    return f"{done.steps} steps, {done.shared} sights", error, done.found.covariance


def wheels(seed: int, metres: float) -> tuple[str, np.ndarray, np.ndarray]:
    """Drive by wheels; about the drive, errors of all values, and their covariance."""
    scans, truth, believed = scans_of(seed, metres)
    done = calibrated(scans, believed)
    found = done.found
    error = np.array([found.values.get(name, math.nan) for name in found.names]) - truth
    return f"{len(scans)} scans, {done.steps} steps", error, found.covariance


def recorded(path: Path) -> list[LaserScan]:
    """Return the scans of a recording with the poses by its wheels."""
    data = np.load(path)
    bearings = float(data["angle_min"]), float(data["angle_increment"])
    places: list[tuple[float, float, float]] = [(x, y, a) for x, y, a in data["odometry"].tolist()]
    return [
        LaserScan(ranges, *bearings, stamp=float(i), pose=pose)
        for i, (ranges, pose) in enumerate(zip(data["ranges"], places, strict=True))
    ]


def real(path: Path) -> None:
    """Calibrate the whole of a recording, each half, and correct the second by the first."""
    data, scans = dict(np.load(path)), recorded(path)
    places = [scan.pose for scan in scans]
    half = len(scans) // 2
    parts = {"whole": scans, "first half": scans[:half], "second half": scans[half:]}
    done = {name: calibrated(part, 0.0) for name, part in parts.items()}
    for name, about in done.items():
        print(f"{name}: {str(about).partition(': ')[2]}")
    first, second = done["first half"], done["second half"]
    for name, value in first.found.values.items():
        spread = math.hypot(first.found.deviations[name], second.found.deviations[name])
        off = (second.found.values[name] - value) / spread
        print(f"| {name} | the second half differs by {off:.1f} deviations |")
    is_second = data["known"] >= half
    known, truth = data["known"][is_second] - half, data["known_poses"][is_second, :2]
    for name, way in (
        ("as recorded", places[half:]),
        ("corrected by the first half", corrected(places[half:], first.found.values)),
    ):
        apart = misplaced(np.array(way)[known, :2], truth)
        print(f"the second half {name}: ATE {apart:.1f} m over {len(known)} poses")


def corrected(
    places: list[tuple[float, float, float]], values: dict[str, float]
) -> list[tuple[float, float, float]]:
    """Return the poses of the scanner by odometry as a calibration corrects it."""
    mounting, pose, found = (values["x"], values["y"], values["theta"]), (0.0, 0.0, 0.0), []
    for before, after in pairwise((places[0], *places)):
        forward, left, turn = twist_between(before, after, 1.0)
        forward, left = values["way"] * forward, values["way"] * left
        twist = forward, left, values["turn"] * (turn - values["drift"] * forward)
        x, y, theta = poses_along(twist, [1.0])[0].tolist()
        pose = compose(pose, (x, y, theta))
        found.append(compose(pose, mounting))
    return found


def misplaced(places: np.ndarray, truth: np.ndarray) -> float:
    """Return how far places (n, 2) are from others, once they are laid on them: rms [m]."""
    one, other = ((of - of.mean(axis=0)) @ (1, 1j) for of in (places, truth))
    turn = np.vdot(one, other)
    return float(np.sqrt(np.mean(np.abs(one * turn / abs(turn) - other) ** 2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=32)
    parser.add_argument("--seed", type=int, default=700)
    parser.add_argument("--against", action="store_true")
    parser.add_argument("--real", type=Path, metavar="FILE")
    given = parser.parse_args()
    if given.real:
        real(given.real)
        return
    measure, metres = (against, 40.0) if given.against else (wheels, 150.0)
    errors, squares = [], []
    for seed in range(given.seed, given.seed + given.drives):
        about, error, covariance = measure(seed, metres)
        error[2] = math.remainder(error[2], 2 * math.pi)
        squares.append(error @ np.linalg.solve(covariance, error) / len(error))
        units = (1e3, 1e3, 180 / math.pi, 100, 100, 100 / TRACK)[: len(error)]
        errors.append(error * units)
        shown = " ".join(f"{part:7.3f}" for part in errors[-1])
        print(f"{seed}: {about}: {shown}  {squares[-1]:.2f}", flush=True)
    rms, worst = np.sqrt(np.mean(np.square(errors), axis=0)), np.abs(errors).max(axis=0)
    names = ("x [mm]", "y [mm]", "θ [°]", "left [%]", "right [%]", "track [%]")
    for name, one, most in zip(names, rms, worst, strict=False):
        print(f"| {name} | {one:.3f} | {most:.3f} |")
    within = 1.96 * math.sqrt(2 / len(rms) / len(errors))
    print(f"NEES of {len(errors)} drives: {np.mean(squares):.2f} (95 %: ± {within:.2f})")


if __name__ == "__main__":
    main()
