"""How well shapes that a robot docks to are found at 2 m, turned by up to 20°, by single scans."""

import argparse
import math

import numpy as np

import lineament as ln
from lineament.docking import Shape, find_shape
from lineament.scan.poses import compose
from lineament.simulation import SENSORS, World

FEET = -0.6, -0.05, 0.5
SHAPES = {
    "V, arms of 0.36 m": [[(-0.2, 0.3), (0.0, 0.0), (-0.2, -0.3)]],
    "V, arms of 0.58 m": [[(-0.3, 0.5), (0.0, 0.0), (-0.3, -0.5)]],
    "recess, 0.8 m x 0.3 m": [[(0, -0.8), (0, -0.4), (0.3, -0.4), (0.3, 0.4), (0, 0.4), (0, 0.8)]],
    "pallet, three feet of 0.1 m": [[(0.1, y), (0, y), (0, y + 0.1), (0.1, y + 0.1)] for y in FEET],
    "the same, fronts alone": [[(0, y), (0, y + 0.1)] for y in FEET],
}
WALLS = [(5.0, -4.0, 5.0, 4.0), (-3.0, -4.0, 5.0, -4.0), (-3.0, 4.0, 5.0, 4.0)]


def measured(shape: Shape, sensor: str, scans: int, seed: int) -> tuple[np.ndarray, int]:
    """Return rows of (error [m], turn [rad], χ²/3), and how often it was not found."""
    rng, rows, missed = np.random.default_rng(seed), [], 0
    for _ in range(scans):
        bearing = rng.uniform(-0.3, 0.3)
        true = 2 * math.cos(bearing), 2 * math.sin(bearing), bearing + rng.uniform(-0.35, 0.35)
        world = World([*shape.placed(true).reshape(-1, 4), *WALLS])
        features = ln.extract(SENSORS[sensor].scan(world, (0.0, 0.0, 0.0), rng))
        guess = compose(true, tuple(rng.uniform(-1, 1, 3) * (0.3, 0.3, 0.4)))
        if (found := find_shape(features, shape, guess)) is None:
            missed += 1
            continue
        off = np.subtract(found.pose, true)
        off[2] = math.remainder(off[2], 2 * math.pi)
        nees = off @ np.linalg.solve(found.covariance, off) / 3
        rows.append((math.hypot(off[0], off[1]), abs(off[2]), nees))
    return np.array(rows), missed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=300)
    parser.add_argument("--seed", type=int, default=100)
    options = parser.parse_args()
    print("| scanner | shape | found | off, rms | turn, rms | > 0.1 m off | χ²/3 |")
    print("|---|---|--:|--:|--:|--:|--:|")
    for sensor in ("utm30lx", "lms361"):
        for name, polylines in SHAPES.items():
            rows, missed = measured(Shape(polylines), sensor, options.scans, options.seed)
            right = rows[rows[:, 0] < 0.1]
            off, turn = np.sqrt(np.square(right[:, :2]).mean(axis=0))
            print(
                f"| `{sensor}` | {name} | {100 * (1 - missed / options.scans):.1f} % | "
                f"{1000 * off:.1f} mm | {math.degrees(turn):.2f}° | {len(rows) - len(right)} | "
                f"{right[:, 2].mean():.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
