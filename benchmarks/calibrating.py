"""The tables of docs/calibrate.md: ``python benchmarks/calibrating.py --drives 40 --seed 500``.

A robot drives along rooms of simulated storeys with furniture and people, a scanner mounted
anywhere on it; its wheels have other radii and another track than is believed, slip, and jolt now
and then. Odometry is counted 100 times a second.
"""

from __future__ import annotations

import argparse
import math
import os
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from lineament.logs import save_npz
from lineament.scan import LaserScan
from lineament.scan.poses import compose
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=40)
    parser.add_argument("--seed", type=int, default=500)
    parser.add_argument("--metres", type=float, default=150.0)
    given = parser.parse_args()
    errors, squares = [], []
    for seed in range(given.seed, given.seed + given.drives):
        scans, truth, believed = scans_of(seed, given.metres)
        done = calibrated(scans, believed)
        found = done.found
        if found.unknown:
            print(f"{seed}: {found}")
            continue
        error = np.array([found.values[name] for name in found.names]) - truth
        error[2] = math.remainder(error[2], 2 * math.pi)
        squares.append(error @ np.linalg.solve(found.covariance, error) / len(error))
        errors.append(error * (1e3, 1e3, 180 / math.pi, 100, 100, 100 / TRACK))
        shown = " ".join(f"{part:7.3f}" for part in errors[-1])
        print(
            f"{seed}: {len(scans)} scans, {done.steps} steps: {shown}  {squares[-1]:.2f}",
            flush=True,
        )
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    names = ("x [mm]", "y [mm]", "θ [°]", "left [%]", "right [%]", "track [%]")
    worst = np.abs(errors).max(axis=0)
    for name, one, most in zip(names, rms, worst, strict=True):
        print(f"| {name} | {one:.3f} | {most:.3f} |")
    within = 1.96 * math.sqrt(2 / 6 / len(errors))
    print(f"NEES of {len(errors)} drives: {np.mean(squares):.2f} (95 %: ± {within:.2f})")


if __name__ == "__main__":
    main()
