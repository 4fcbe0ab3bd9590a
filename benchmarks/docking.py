"""How well shapes that a robot docks to are found at 2 m, turned by up to 20°.

By single scans, beside the bounds of what a scan can show; then, for a V, by the mean of the poses
of several scans of a scanner that stands.
"""

import argparse
import math

import numpy as np

import lineament as ln
from lineament.docking import Shape, ShapePose, find_shape
from lineament.scan import Pose
from lineament.scan.poses import compose
from lineament.simulation import SENSORS, Sensor, World, cast_rays

FEET = -0.6, -0.05, 0.5
SHAPES = {
    "V, arms of 0.36 m": [[(-0.2, 0.3), (0.0, 0.0), (-0.2, -0.3)]],
    "V, arms of 0.58 m": [[(-0.3, 0.5), (0.0, 0.0), (-0.3, -0.5)]],
    "recess, 0.8 m x 0.3 m": [[(0, -0.8), (0, -0.4), (0.3, -0.4), (0.3, 0.4), (0, 0.4), (0, 0.8)]],
    "pallet, three feet of 0.1 m": [[(0.1, y), (0, y), (0, y + 0.1), (0.1, y + 0.1)] for y in FEET],
    "the same, fronts alone": [[(0, y), (0, y + 0.1)] for y in FEET],
}
WALLS = [(5.0, -4.0, 5.0, 4.0), (-3.0, -4.0, 5.0, -4.0), (-3.0, 4.0, 5.0, 4.0)]


MEANS = 1, 2, 4, 8
_SMALL = 1e-6


def drawn(rng: np.random.Generator) -> Pose:
    bearing = rng.uniform(-0.3, 0.3)
    return 2 * math.cos(bearing), 2 * math.sin(bearing), bearing + rng.uniform(-0.35, 0.35)


def find(shape: Shape, true: Pose, sensor: Sensor, rng: np.random.Generator) -> ShapePose | None:
    world = World([*shape.placed(true).reshape(-1, 4), *WALLS])
    features = ln.extract(sensor.scan(world, (0.0, 0.0, 0.0), rng))
    guess = compose(true, tuple(rng.uniform(-1, 1, 3) * (0.3, 0.3, 0.4)))
    return find_shape(features, shape, guess)


def off_by(found: ShapePose, true: Pose) -> np.ndarray:
    off = np.subtract(found.pose, true)
    off[2] = math.remainder(off[2], 2 * math.pi)
    return off


def bounds(shape: Shape, pose: Pose, sensor: Sensor) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of x, y, turn [m², rad²]: by ranges, and by ranges and ends that show.

    The first is that of Cramér and Rao, by differences of the true ranges of the beams that meet
    the shape. An end has none: it is taken for known to a spacing of the beams, its variance /12.
    """

    def rays(pose: Pose, bearings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return cast_rays(World(shape.placed(pose).reshape(-1, 4)), (0.0, 0.0, 0.0), bearings)

    def ends(pose: Pose) -> np.ndarray:
        x, y = np.moveaxis(shape.placed(pose)[shape.free], -1, 0)
        return np.arctan2(y, x)

    ranges, pieces = rays(pose, sensor.angles)
    owner = np.nonzero(shape.free)[0]
    seen = [
        any(rays(pose, np.array([end + side * 1e-3]))[1][0] == piece for side in (-1, 1))
        for piece, end in zip(owner, ends(pose), strict=True)
    ]
    by_range, by_end = [], []
    for k in range(3):
        more, less = (np.add(pose, sign * _SMALL * np.eye(3)[k]) for sign in (1, -1))
        (far, one), (near, other) = rays(more, sensor.angles), rays(less, sensor.angles)
        met = (pieces >= 0) & (one == pieces) & (other == pieces)
        by_range.append(np.where(met, np.where(met, far, 0) - np.where(met, near, 0), 0))
        by_end.append((ends(more) - ends(less))[seen])
    by_range, by_end = np.array(by_range) / (2 * _SMALL), np.array(by_end) / (2 * _SMALL)
    variances = sensor.noise.range_variance(np.where(pieces >= 0, ranges, 1.0))
    information = (by_range / variances) @ by_range.T
    with_ends = information + 12 / sensor.angle_increment**2 * by_end @ by_end.T
    # A direction that nothing shows is known to kilometres, and printed as a dash.
    return tuple(np.diag(np.linalg.inv(one + 1e-9 * np.eye(3))) for one in (information, with_ends))


def row(shape: Shape, sensor: Sensor, scans: int, seed: int) -> str:
    rng, offs, squares, limits = np.random.default_rng(seed), [], [], []
    for _ in range(scans):
        true = drawn(rng)
        if (found := find(shape, true, sensor, rng)) is None:
            continue
        limits.append(bounds(shape, true, sensor))
        offs.append(off_by(found, true))
        squares.append(offs[-1] @ np.linalg.solve(found.covariance, offs[-1]) / 3)
    squares = np.array(squares)
    place, turn = places_and_turns(np.square(offs).mean(axis=0))
    least = [places_and_turns(one) for one in np.mean(limits, axis=0)]
    wrong = sum(math.hypot(*off[:2]) > 0.1 for off in offs)
    cells = [f"{100 * len(offs) / scans:.1f} %", str(wrong), f"{place:.1f} mm"]
    cells += [f"{one:.1f}" if one < 1000 else "–" for one, _ in least]
    cells += [f"{turn:.2f}°", *(f"{one:.2f}" for _, one in least)]
    error = squares.std() / math.sqrt(len(squares))
    return " | ".join([*cells, f"{squares.mean():.2f} ± {error:.2f}"])


def places_and_turns(squares: np.ndarray) -> tuple[float, float]:
    return 1000 * math.sqrt(squares[0] + squares[1]), math.degrees(math.sqrt(squares[2]))


def standing(shape: Shape, sensor: Sensor, poses: int, seed: int) -> list[str]:
    """Return turn and χ²/3 of the mean of several scans of a scanner that stands."""
    rng, turns, squares = np.random.default_rng(seed), [], []
    for _ in range(poses):
        true = drawn(rng)
        found = [find(shape, true, sensor, rng) for _ in range(MEANS[-1])]
        seen = [one for one in found if one is not None]
        means = [np.mean([off_by(one, true) for one in seen[:n]], axis=0) for n in MEANS]
        spreads = [sum(one.covariance for one in seen[:n]) / len(seen[:n]) ** 2 for n in MEANS]
        turns.append([mean[2] for mean in means])
        squares.append(
            [off @ np.linalg.solve(c, off) / 3 for off, c in zip(means, spreads, strict=True)]
        )
    turn = np.degrees(np.sqrt(np.square(turns).mean(axis=0)))
    return [f"{a:.2f}°, {b:.2f}" for a, b in zip(turn, np.mean(squares, axis=0), strict=True)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=400)
    parser.add_argument("--seed", type=int, default=100)
    options = parser.parse_args()
    sensors = SENSORS["utm30lx"], SENSORS["lms361"]
    print(
        "| scanner | shape | found | > 0.1 m off | off, rms | bound | with ends "
        "| turn, rms | bound | with ends | χ²/3 |"
    )
    print("|---|---|" + "--:|" * 9)
    for sensor in sensors:
        for name, polylines in SHAPES.items():
            cells = row(Shape(polylines), sensor, options.scans, options.seed)
            print(f"| `{sensor.name}` | {name} | {cells} |", flush=True)
    print("\n| mean of so many scans | " + " | ".join(map(str, MEANS)) + " |")
    print("|---|" + "--:|" * len(MEANS))
    small = Shape(next(iter(SHAPES.values())))
    for sensor in sensors:
        cells = standing(small, sensor, options.scans // 4, options.seed)
        print(f"| `{sensor.name}` | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
