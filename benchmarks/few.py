"""Covariances of features where few measurements tell how large the noise is, as Markdown tables.

Run: python benchmarks/few.py [--sigma 0.01] [--given] [--method NAME]... One object in view, or
thirty small ones around, of n measurements each (corners: n a wall), with white noise. Cells are
the NEES over its degrees of freedom: mean (median over that of chi-square) of the features found; 1
if covariances are those of the errors; – where fewer than 50 were found. `--given` gives each
method the noise: what differs from 1 then is the method's own.
"""

import argparse
import math
from collections.abc import Callable

import numpy as np
from lineament_lab.evaluation import NormalisedErrors
from numpy.typing import NDArray

from lineament import Extractor, FeatureBatch
from lineament.methods import method_names

Array = NDArray[np.float64]
COUNTS = (4, 5, 6, 8, 10, 12, 16, 20, 23, 24, 30, 60)
#: Beams of one object in view are so far apart [rad], and those of a column.
STEP, COLUMN_STEP = math.radians(1 / 3), math.radians(1.0)
#: Objects around, and free beams between them.
OBJECTS, FREE = 30, 8
#: A corner that is farther off is of something else [m].
GATE = 0.3
Shape = Callable[[int, float, np.random.Generator], tuple[Array, Array]]


def wall(distance: float, incidence: float) -> Shape:
    """Make walls whose middle is so far off; their truth is a bearing and distance of the foot."""

    def shape(n: int, step: float, rng: np.random.Generator) -> tuple[Array, Array]:
        far = distance if distance > 0 else rng.uniform(1.0, 4.0)
        normal = math.radians(incidence if incidence < 90 else rng.uniform(-50, 50))
        bearings = (np.arange(n) - (n - 1) / 2) * step
        foot = far * math.cos(normal)
        return foot / np.cos(bearings - normal), np.array([normal, foot, 0.0])

    return shape


def corner(distance: float, least: float = 90.0) -> Shape:
    """Make corners of two walls that are seen alike; their truth is a place.

    Their angle is right, or any from the `least` to 180°.
    """

    def shape(n: int, step: float, rng: np.random.Generator) -> tuple[Array, Array]:
        far = distance if distance > 0 else rng.uniform(1.0, 4.0)
        half = math.radians(rng.uniform(least, 180.0) if least < 90 else least) / 2
        bearings = abs(np.arange(2 * n) - (2 * n - 1) / 2) * step
        return far * math.sin(half) / np.sin(half + bearings), np.array([far, 0.0, 0.0])

    return shape


def column(distance: float) -> Shape:
    """Make columns as wide as n beams; their truth is centre and radius."""

    def shape(n: int, step: float, rng: np.random.Generator) -> tuple[Array, Array]:
        far = distance if distance > 0 else rng.uniform(1.0, 4.0)
        radius = far * math.sin(min(0.5 * n * step, 1.2))
        bearings = (np.arange(n) - (n - 1) / 2) * step
        off = far * np.sin(bearings)
        return far * np.cos(bearings) - np.sqrt(radius**2 - off**2), np.array([far, 0.0, radius])

    return shape


#: Name: shape, table, objects, step of the beams [rad].
SCENES = {
    "wall at 2 m": (wall(2.0, 0.0), "segments", 1, STEP),
    "wall at 5 m": (wall(5.0, 0.0), "segments", 1, STEP),
    "wall at 2 m, 60°": (wall(2.0, 60.0), "segments", 1, STEP),
    "wall at 5 m, 60°": (wall(5.0, 60.0), "segments", 1, STEP),
    "corner at 2 m": (corner(2.0), "corners", 1, STEP),
    "corner at 2 m, 60–180°": (corner(2.0, 60.0), "corners", 1, STEP),
    "column at 1 m": (column(1.0), "arcs", 1, COLUMN_STEP),
    "30 walls": (wall(0.0, 90.0), "segments", OBJECTS, 0.0),
    "30 corners": (corner(0.0), "corners", OBJECTS, 0.0),
    "30 trunks": (column(0.0), "arcs", OBJECTS, 0.0),
}


def errors_of(batch: FeatureBatch, table: str, owner: Array, turns: Array, truths: Array) -> tuple:
    """Errors and covariances of the features whose beams are all of one object."""
    found = getattr(batch, table)
    beam = found["beam"] if table == "corners" else found["first_beam"]
    last = beam if table == "corners" else found["last_beam"]
    which = owner[beam]
    kept = (which >= 0) & (which == owner[last])
    if table == "corners":
        kept &= found["kind"] == "corner"
    found, which = found[kept], which[kept]
    scan = np.repeat(np.arange(len(batch)), np.diff(batch.offsets[table]))[kept]
    truth, turn = truths[scan, which], turns[which]
    if table == "segments":
        normal = truth[:, 0] + turn
        across = np.column_stack((np.cos(normal), np.sin(normal)))
        off = truth[:, 1] - np.einsum("ij,ij->i", found["centroid"], across)
        angle = found["angle"] - normal - math.pi / 2
        return np.column_stack((off, np.arctan2(np.sin(angle), np.cos(angle)))), found["covariance"]
    place = truth[:, :1] * np.column_stack((np.cos(turn), np.sin(turn)))
    if table == "corners":
        errors = found["position"] - place
        near = np.hypot(*errors.T) < GATE
        return errors[near], found["covariance"][near]
    return np.column_stack((found["center"] - place, found["radius"] - truth[:, 2])), found[
        "covariance"
    ]


def measure(extractor: Extractor, name: str, n: int, sigma: float, seed: int) -> NormalisedErrors:
    """Normalised errors of the features of some random scans of a scene."""
    shape, table, objects, step = SCENES[name]
    rng, runs = np.random.default_rng((seed, n)), 4000 if objects == 1 else 64
    beams = (2 if table == "corners" else 1) * n
    step = step if objects == 1 else 2 * math.pi / (objects * (beams + FREE))
    width = beams + FREE
    ranges, truths = np.full((runs, objects * width), np.nan), np.empty((runs, objects, 3))
    for run in range(runs):
        for k in range(objects):
            ideal, truths[run, k] = shape(n, step, rng)
            ranges[run, k * width : k * width + beams] = ideal + rng.normal(0.0, sigma, beams)
    owner = np.tile(np.where(np.arange(width) < beams, 0, -1), (objects, 1))
    owner[owner == 0] = np.repeat(np.arange(objects), beams)
    turns = (np.arange(objects) * width + (beams - 1) / 2) * step
    batch = extractor.batch(ranges, angle_min=0.0, angle_increment=step)
    return NormalisedErrors.of(*errors_of(batch, table, owner.ravel(), turns, truths))


def main() -> None:
    """Print a table for each method."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sigma", type=float, default=0.01)
    parser.add_argument("--given", action="store_true")
    parser.add_argument("--method", action="append")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    for method in options.method or method_names(presets=False):
        extractor = Extractor(method, noise=options.sigma if options.given else None)
        print(f"\n| {method} | " + " | ".join(map(str, COUNTS)) + " |\n" + "|---" * 13 + "|")
        for name in SCENES:
            cells = [measure(extractor, name, n, options.sigma, options.seed) for n in COUNTS]
            print(
                f"| {name} | "
                + " | ".join(
                    f"{c.mean_ratio:.2f} ({c.median_ratio:.2f})" if len(c.whitened) >= 50 else "–"
                    for c in cells
                )
                + " |",
                flush=True,
            )


if __name__ == "__main__":
    main()
