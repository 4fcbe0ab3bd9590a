"""The tables of docs/merging.md: ``python benchmarks/merging.py --scenes 100``.

A robot with two scanners of 270°, at its front left and its rear right, stands in random scenes.
The first table has the errors of what is one over its covariances, χ² a degree of freedom, beside
those of what one scanner sees alone; the second how often what both see becomes one, and what is
wrongly joined, by the quantile.
"""

import argparse
import math
import time

import numpy as np

import lineament as ln
from lineament.features import Features
from lineament.mapping import merge_features
from lineament.mapping.merging import grouped, squares_of_segments
from lineament.motion.association import chi_square
from lineament.scan.poses import compose
from lineament.simulation import SCENES, World, scene, sensor_like

MOUNTINGS = [(0.3, 0.25, math.pi / 4), (-0.3, -0.25, -3 * math.pi / 4)]
SENSOR = sensor_like("utm30lx", mixed_pixel=0.0, dropout=0.0, outlier=0.0)
GATES = (0.99, 0.999, 0.9999)
#: Farther from all walls and corners, a feature is of none [m].
NEAR = 0.1


def wall_of(segment: np.void, world: World) -> tuple[int, float] | None:
    """The wall that a segment lies on, and the χ² of its offset and angle a degree of freedom."""
    ends = world.segments.reshape(-1, 2, 2)
    along = np.array([segment["start"], segment["end"]])[:, None] - ends[:, 0]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    u = (ends[:, 1] - ends[:, 0]) / lengths[:, None]
    reach = np.einsum("kni,ni->kn", along, u)
    arm = segment["centroid"] - ends[:, 0]
    offset = u[:, 0] * arm[:, 1] - u[:, 1] * arm[:, 0]
    turn = segment["angle"] - np.arctan2(u[:, 1], u[:, 0])
    angle = np.angle(np.exp(2j * turn)) / 2
    on = (reach.min(axis=0) > -NEAR) & (reach.max(axis=0) < lengths + NEAR)
    on &= (abs(offset) < NEAR) & (abs(angle) < 0.2)
    if not on.any():
        return None
    k = int(np.where(on, abs(offset), np.inf).argmin())
    off = np.array([offset[k] * np.sign(np.cos(turn[k])), angle[k]])
    return k, float(off @ np.linalg.solve(segment["covariance"], off)) / 2


def corner_error(corner: np.void, world: World) -> float | None:
    """The χ² of the position of a corner a degree of freedom; None if there is none near."""
    off = corner["position"] - world.segments.reshape(-1, 2)
    off = off[np.linalg.norm(off, axis=1).argmin()]
    if np.linalg.norm(off) > NEAR:
        return None
    return float(off @ np.linalg.solve(corner["covariance"], off)) / 2


def is_one(merged: np.ndarray, parts: list[np.ndarray]) -> np.ndarray:
    """Whether each record of the merged ones is of two: its covariance is that of none of them."""
    known = np.concatenate([np.linalg.det(part["covariance"]) for part in parts])
    ratio = np.linalg.det(merged["covariance"])[:, None] / known
    return (abs(ratio - 1) > 1e-6).all(axis=1)


def errors(parts: list[Features], merged: Features, base: tuple, world: World) -> dict:
    """χ² of walls and corners that are of two scanners, and of those that are of one."""
    found: dict[tuple[str, bool], list[float]] = {}
    placed = merged.transform(*base)
    for name in ("segments", "corners"):
        both = is_one(placed[name], [part[name] for part in parts])
        for record, of_two in zip(placed[name], both.tolist(), strict=True):
            of = wall_of(record, world) if name == "segments" else corner_error(record, world)
            value = of[1] if isinstance(of, tuple) else of
            if value is not None:
                found.setdefault((name, of_two), []).append(value)
    return found


def pairs(parts: list[Features], base: tuple, world: World) -> dict:
    """By the quantile: how many pairs of one wall there are and are found, and wrong ones."""
    moved = [f.transform(*at) for f, at in zip(parts, MOUNTINGS, strict=True)]
    segments = np.concatenate([one.segments for one in moved])
    owners = np.repeat(np.arange(2), [len(one.segments) for one in moved])
    placed = np.concatenate([one.transform(*base).segments for one in moved])
    walls = np.array([-1 if (of := wall_of(one, world)) is None else of[0] for one in placed])
    squares = squares_of_segments(segments, owners)
    same = np.triu((walls[:, None] == walls) & (walls >= 0) & np.isfinite(squares))
    known = (walls[:, None] >= 0) & (walls >= 0)
    found = {}
    for gate in GATES:
        labels = grouped(squares, chi_square(gate, 2))
        joined = np.triu(labels[:, None] == labels, 1)
        found[gate] = np.array([same.sum(), (joined & same).sum(), (joined & known & ~same).sum()])
    return found


def row(values: list[float]) -> str:
    """Mean and median of χ² a degree of freedom, and how many there are."""
    return f"{np.mean(values):.2f} ({np.median(values):.2f}), {len(values)}" if values else "–"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1000)
    given = parser.parse_args()
    extractor, seconds, count = ln.Extractor(), 0.0, 0
    totals = {gate: np.zeros(3, int) for gate in GATES}
    print("| scenes | walls of two | walls of one | corners of two | corners of one |")
    print("|---|--:|--:|--:|--:|")
    for kind in SCENES:
        found: dict[tuple[str, bool], list[float]] = {}
        for seed in range(given.seed, given.seed + given.scenes):
            world, base = scene(kind, seed)
            rng = np.random.default_rng([seed, 7])
            scans = [SENSOR.scan(world, compose(base, at), rng) for at in MOUNTINGS]
            parts = [extractor(scan) for scan in scans]
            started = time.perf_counter()
            merged = merge_features(parts, MOUNTINGS)
            seconds, count = seconds + time.perf_counter() - started, count + 1
            for key, values in errors(parts, merged, base, world).items():
                found.setdefault(key, []).extend(values)
            for gate, numbers in pairs(parts, base, world).items():
                totals[gate] += numbers
        cells = [(n, two) for n in ("segments", "corners") for two in (True, False)]
        print(f"| {kind} | {' | '.join(row(found.get(cell, [])) for cell in cells)} |")
    print(f"\n{1e3 * seconds / count:.1f} ms a merge\n")
    print("| quantile | walls that both see | become one | of two walls |")
    print("|---|--:|--:|--:|")
    for gate, (same, joined, wrong) in totals.items():
        print(f"| {gate} | {same} | {100 * joined / same:.1f} % | {wrong} |")


if __name__ == "__main__":
    main()
