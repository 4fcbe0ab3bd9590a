"""Walls through occupancy grids, and places on them: ``python benchmarks/grids.py``.

Storeys are turned by any angle, as a robot's map is that begins where the robot did; beams from all
rooms and corridors say what is free. The walls that `LineMap.from_grid` finds are compared with
those that were drawn. With ``--locate`` local maps are looked for on the grid of their storey, of
that with walls moved, mirrored, and of another, beside the drawing itself; with ``--plans FOLDER``
scans in the cells of real maps are looked for on their walls.
"""

from __future__ import annotations

import argparse
import math
import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from locating import RIGHT, places, storey

import lineament as ln
from lineament.mapping import LineMap, locate
from lineament.mapping.grids import Grid
from lineament.mapping.locate import AMBIGUOUS, LOCATED, LOST
from lineament.simulation import SENSORS, World

#: A wall is there within [m]; points of walls are looked at each so much [m].
NEAR, STEP = 0.01, 0.02
#: Where scans are taken from that say what is free [m].
APART = 2.5


def turned(world: World, angle: float) -> World:
    c, s = math.cos(angle), math.sin(angle)
    lines = world.segments.reshape(-1, 2, 2) @ np.array([[c, s], [-s, c]])
    return World(lines.reshape(-1, 4))


def viewpoints(building: object) -> np.ndarray:
    """Return places (n, 2) in all rooms and along all corridors [m]."""
    rooms = [((*r.low, *r.high)) for r in building.rooms]  # type: ignore[attr-defined]
    found = []
    for x, y, to_x, to_y in [*rooms, *building.corridors]:  # type: ignore[attr-defined]
        along = [np.arange(a, b, APART) + min(b - a, APART) / 2 for a, b in ((x, to_x), (y, to_y))]
        found.append(np.stack(np.meshgrid(*along), axis=-1).reshape(-1, 2))
    return np.concatenate(found)


def grid_of(world: World, at: np.ndarray) -> Grid:
    """Draw the walls of a storey at 5 cm, with what is seen as free."""
    sensor, rng = SENSORS["utm30lx"], np.random.default_rng(0)
    poses = [(x, y, turn) for x, y in at.tolist() for turn in (0.0, math.pi)]
    seen = ((sensor.scan(world, pose, rng), pose) for pose in poses)
    return Grid.drawn(world.segments.reshape(-1, 2, 2), seen)


def offsets(true: np.ndarray, found: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far points of true walls are beside the nearest wall that faces the same way [m].

    Positive is towards the free side; inf without such a wall. And the length of each wall.
    """
    starts, along = true[:, 0], true[:, 1] - true[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    counts = np.maximum((lengths / STEP).astype(int), 1)
    wall = np.repeat(np.arange(len(true)), counts)
    share = (np.arange(len(wall)) - (np.cumsum(counts) - counts)[wall] + 0.5) / counts[wall]
    points, u = starts[wall] + share[:, None] * along[wall], (along / lengths[:, None])[wall]
    best = np.full(len(points), np.inf)
    for start, end in found:
        way = math.dist(start, end)
        v = (end - start) / way
        arm = points - start
        t = arm @ v
        there = (t > -STEP) & (t < way + STEP) & (u @ v > 0.9)
        off = arm[there] @ (v[1], -v[0])
        closer = abs(off) < abs(best[there])
        best[np.flatnonzero(there)[closer]] = off[closer]
    return best, lengths[wall]


def walls(storeys: int, seed: int) -> None:
    """Print which share of the walls is found, and how far off."""
    for name, angles in (("turned", None), ("along the cells", 0.0)):
        all_off, lengths, counts = [], [], []
        for k in range(seed, seed + storeys):
            building, rng = storey(k), np.random.default_rng(k)
            angle = rng.uniform(-math.pi, math.pi) if angles is None else angles
            world = turned(building.plan, angle)
            c, s = math.cos(angle), math.sin(angle)
            at = viewpoints(building) @ np.array([[c, s], [-s, c]])
            plan = LineMap.from_grid(grid_of(world, at), sigma=0.0)
            off, of = offsets(world.segments.reshape(-1, 2, 2), plan.ends)
            all_off.append(off)
            lengths.append(of)
            counts.append((len(world.segments), len(plan.walls)))
        off, of = np.concatenate(all_off), np.concatenate(lengths)
        known = abs(off) < 0.05
        shares = ", ".join(
            f"{100 * (abs(off) < near).mean():.2f} % within {1000 * near:g} mm"
            for near in (NEAR, 0.026, 0.05)
        )
        drawn, found = np.sum(counts, axis=0)
        print(
            f"{name}, {storeys} storeys, {drawn} walls drawn, {found} found: "
            f"{shares} of the length; "
            f"of walls over 1 m {100 * (abs(off[of > 1]) < NEAR).mean():.2f} % within 10 mm; "
            f"median {1000 * np.median(off[known]):+.1f} mm, "
            f"rms {1000 * np.sqrt((off[known] ** 2).mean()):.1f} mm"
        )


def located(storeys: int, seed: int, most: int, sigmas: list[float]) -> None:
    """Print how often places are found on the drawings of storeys, and on their grids."""
    rows: dict[str, list[tuple[int, str, bool, float]]] = {}
    for k in range(seed, seed + storeys):
        building, other, angle = (
            storey(k),
            storey(k + 6000),
            np.random.default_rng(k).uniform(-3, 3),
        )
        at, c, s = viewpoints(building), math.cos(angle), math.sin(angle)
        image = np.column_stack((building.size[0] - at[:, 0], at[:, 1]))
        moved = building.moved(0)
        worlds = (
            (building.plan, at), (moved.plan, viewpoints(moved)), (building.mirrored(), image),
            (other.plan, viewpoints(other)),
        )  # fmt: skip
        found = places(k, most)
        for number, (world, views) in enumerate(worlds):
            drawn = LineMap.from_lines(turned(world, angle).segments, side=1)
            grid = grid_of(turned(world, angle), views @ np.array([[c, s], [-s, c]]))
            tried = {"drawing": drawn} | {
                f"grid, sigma={s:g}": LineMap.from_grid(grid, sigma=s) for s in sigmas
            }
            for name, plan in tried.items():
                for place in found:
                    where = locate(place.query, plan)
                    x, y, theta = place.truth
                    off = np.subtract(where.pose, (c * x - s * y, s * x + c * y, theta + angle))
                    turn = abs(math.remainder(off[2], 2 * math.pi))
                    right = number < 2 and math.hypot(*off[:2]) < RIGHT[0] and turn < RIGHT[1]
                    rows.setdefault(name, []).append(
                        (number, where.verdict, right, math.hypot(*off[:2]))
                    )
    print(f"{storeys} storeys from seed {seed} on, {most} places each at most")
    for name, judged in rows.items():
        number, verdict, right, off = map(np.array, zip(*judged, strict=True))
        own, hit = number == 0, (verdict == LOCATED) & right
        of_own = " | ".join(str((verdict[own] == kind).sum()) for kind in (AMBIGUOUS, LOST))
        print(
            f"| {name} | {own.sum()} | {100 * hit[own].mean():.1f} % | {of_own} | "
            f"{100 * hit[number == 1].mean():.1f} % | {len(number)} | "
            f"{((verdict == LOCATED) & ~hit).sum()} | {1000 * np.median(off[own & hit]):.1f} mm |"
        )


def scan_of(grid: Grid, pose: tuple[float, float, float], rng: np.random.Generator) -> ln.LaserScan:
    """Follow beams of a laser of 20 m through the cells of a grid, in its frame of cells."""
    angles = np.radians(np.arange(-180, 180, 0.5))
    way = np.arange(0.05, 20.0, grid.resolution / 4)
    x, y, theta = pose
    at = np.stack((np.cos(angles + theta), np.sin(angles + theta)), axis=-1)[:, None] * way[:, None]
    column, row = np.moveaxis(
        np.floor((at + np.array((x, y))) / grid.resolution).astype(int), -1, 0
    )
    rows, columns = grid.cells.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    hit = inside & grid.occupied[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
    ranges = np.where(hit.any(axis=1), way[hit.argmax(axis=1)], np.nan)
    return ln.LaserScan(ranges + rng.normal(0, 0.01, len(ranges)), angles=angles)


def on_plans(folder: Path, most: int) -> None:
    """Print how often single scans in the cells of maps of robots are found on their walls."""
    extract, rng = ln.Extractor(), np.random.default_rng(0)
    for path in sorted(folder.glob("*.yaml")):
        try:
            grid, plan = Grid.read(path), LineMap.read(path)
        except ln.LineamentError as error:
            print(error)
            continue
        image = plan.walls.copy()  # the plan mirrored: nothing is on it
        for name in ("start", "end"):
            image[{"start": "end", "end": "start"}[name]] = plan.walls[name] * (-1, 1)
        image["centroid"] = plan.walls["centroid"] * (-1, 1)
        image["angle"] = np.arctan2(*(image["end"] - image["start"]).T[::-1])
        mirrored, clear = LineMap(image), grid.free.copy()
        reach = round(0.3 / grid.resolution)
        for axis in (0, 1):
            clear &= np.all([np.roll(grid.free, k, axis) for k in range(-reach, reach + 1)], axis=0)
        free = np.argwhere(clear)
        counts, errors, tried = np.zeros(3, int), [], 0
        while tried < most:
            row, column = free[rng.integers(len(free))]
            x, y, theta = (column + 0.5) * grid.resolution, (row + 0.5) * grid.resolution, 0.3
            scan = scan_of(grid, (x, y, theta), rng)
            if scan.valid.sum() < 200:
                continue
            tried += 1
            features = extract(scan)
            where, wrong = locate(features, plan), locate(features, mirrored)
            at = grid.placed(np.array((x, y)) / grid.resolution)
            turn = math.remainder(where.pose[2] - theta - grid.origin[2], 2 * math.pi)
            off = math.dist(where.pose[:2], at)
            right = bool(where) and off < RIGHT[0] and abs(turn) < RIGHT[1]
            counts += (right, bool(where) and not right, bool(wrong))
            errors += [off] * right
        middle = 1000 * np.median(errors) if errors else math.nan
        print(
            f"| {path.stem} | {tried} | {counts[0]} | {counts[1]} | {counts[2]} | {middle:.0f} mm |"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--storeys", type=int, default=6)
    parser.add_argument("--seed", type=int, default=900)
    parser.add_argument("--most", type=int, default=40, help="places of a storey, for --locate")
    parser.add_argument("--locate", action="store_true", help="look for places on grids instead")
    parser.add_argument("--plans", type=Path, help="look for scans in the maps of a folder instead")
    parser.add_argument("--sigma", type=float, nargs="+", default=[0.0])
    options = parser.parse_args()
    if options.plans is not None:
        on_plans(options.plans, options.most)
    elif options.locate:
        located(options.storeys, options.seed, options.most, options.sigma)
    else:
        walls(options.storeys, options.seed)
