"""Plans and places on them, fuzzed: damaged files, drawings by definition, scans at any pose."""

import math
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import crafted_plans
import ezdxf
import numpy as np
import pyarrow.parquet as pq
from fuzz_targets import Target
from mutations import damaged

import lineament as ln
from lineament import LineamentError
from lineament.drawings import UNITS
from lineament.limits import LIMITS
from lineament.mapping import LineMap, locate
from lineament.mapping.index import FARTHEST, LONGEST
from lineament.simulation import SENSORS, World
from lineament.simulation.buildings import office
from lineament.simulation.raycast import cast_rays

Lines = list[tuple[complex, complex]]


def any_drawing(chance: Random, path: Path) -> tuple[Lines, float]:
    """Draw lines in blocks in blocks into a DXF; returns where they are by definition, in units.

    A block stands at ``at + turn · stretch(p - base)``, in each place of a grid that is turned with
    it and not stretched.
    """
    number = chance.choice(list(UNITS))
    drawing = ezdxf.new(chance.choice(("R2000", "R2010", "R2018")), units=number)
    size = 10.0 / UNITS[number]
    place = lambda: complex(chance.uniform(-size, size), chance.uniform(-size, size))  # noqa: E731
    holds: dict[str, Lines] = {}
    for level in range(chance.randrange(4)):
        base = chance.choice((0j, place()))
        block = drawing.blocks.new(f"b{level}", base_point=(base.real, base.imag))
        inside = _fill(block, chance, place, holds)
        holds[f"B{level}"] = [(start - base, end - base) for start, end in inside]
    lines = _fill(drawing.modelspace(), chance, place, holds, least=1)
    drawing.saveas(path, fmt=chance.choice(("asc", "asc", "bin")))
    return lines, UNITS[number]


def _fill(
    to: Any, chance: Random, place: Callable[[], complex], holds: dict[str, Lines], least: int = 0
) -> Lines:
    lines: Lines = []
    for _ in range(max(least, chance.randrange(4))):
        ends = [place() for _ in range(chance.choice((2, 2, 3, 5)))]
        points = [(end.real, end.imag) for end in ends]
        add = chance.choice((to.add_lwpolyline, to.add_polyline2d, None))
        if add is None:
            to.add_line(*points[:2])
            ends = ends[:2]
        else:
            add(points)
        lines += pairwise(ends)
    for name in holds:
        if chance.random() < 0.5:
            continue
        at, turn = place(), chance.choice((0.0, 90.0, chance.uniform(-360, 360)))
        wide, high = (chance.choice((1.0, 1.0, -1.0, 0.5, 2.0)) for _ in range(2))
        rows, columns, step = chance.choice((1, 1, 2)), chance.choice((1, 1, 3)), place()
        grid = {"row_count": rows, "row_spacing": step.imag}
        grid |= {"column_count": columns, "column_spacing": step.real}
        given = {"xscale": wide, "yscale": high, "rotation": turn, **grid}
        to.add_blockref(name, (at.real, at.imag), dxfattribs=given)
        turned = complex(math.cos(math.radians(turn)), math.sin(math.radians(turn)))
        for i in range(rows):
            for j in range(columns):
                shift = at + turned * complex(j * step.real, i * step.imag)
                lines += [
                    tuple(shift + turned * complex(wide * p.real, high * p.imag) for p in line)
                    for line in holds[name]
                ]  # type: ignore[misc]
    return lines


def sorted_ends(lines: Any) -> np.ndarray:
    """Return lines (n, 4) in an order that does not depend on that of a file, or of their ends."""
    ends = np.array(lines, float).reshape(-1, 2, 2)
    swap = ends[:, 0, 0] > ends[:, 1, 0]
    ends[swap] = ends[swap, ::-1]
    rows = ends.reshape(-1, 4)
    return rows[np.lexsort(np.round(rows, 5).T)]


class Plans(Target):
    """Files that are damaged end in a line or in walls with numbers; others are what was drawn."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "plans"
        self._folder.mkdir()
        self._samples = {".dxf": [], ".parquet": []}
        chance = Random(0)
        for k in range(8):
            path = self._folder / f"{k}.dxf"
            any_drawing(chance, path)
            self._samples[".dxf"].append(path.read_bytes())
        for k, draw in enumerate((_curves, _columns)):
            path = self._folder / f"curves{k}.dxf"
            crafted_plans.drawn(path, draw)
            self._samples[".dxf"].append(path.read_bytes())
        for k, packed in enumerate(("none", "snappy", "zstd")):
            path = self._folder / f"{k}.parquet"
            crafted_plans.table(path, compression=packed)
            self._samples[".parquet"].append(path.read_bytes())

    def make(self, chance: Random) -> tuple[str, Any]:
        kind = chance.choice(("damaged", "damaged", "drawn", "rows"))
        if kind != "damaged":
            return kind, chance.getrandbits(64)
        ending = chance.choice((".dxf", ".dxf", ".parquet"))
        own, other = (chance.choice(self._samples[ending]) for _ in range(2))
        return ending, damaged(own, chance, other)

    def check(self, made: tuple[str, Any]) -> str:
        kind, given = made
        if kind == "drawn":
            return self._drawn(Random(given))
        if kind == "rows":
            return self._rows(Random(given))
        path = self._folder / f"damaged{kind}"
        path.write_bytes(given)
        line = ""
        try:
            plan = LineMap.read(path)
        except LineamentError as error:
            line = str(error)
        if not line:
            assert_sound(plan)
            return f"{kind}: read"
        assert line.isprintable(), repr(line)
        assert line.startswith(f"{path}: "), line
        assert len(line) < 1200
        return f"{kind}: refused"

    def _drawn(self, chance: Random) -> str:
        path = self._folder / "drawn.dxf"
        lines, unit = any_drawing(chance, path)
        expected = [(unit * a.real, unit * a.imag, unit * b.real, unit * b.imag) for a, b in lines]
        plan = LineMap.read(path)
        assert_sound(plan)
        assert plan.left_out == 0
        np.testing.assert_allclose(sorted_ends(plan.ends), sorted_ends(expected), atol=2e-5)
        return "as drawn"

    def _rows(self, chance: Random) -> str:
        """Read rows that have no numbers as if they were not there."""
        path = self._folder / "rows.parquet"
        crafted_plans.table(path)
        table = pq.read_table(path)
        odd = sorted(chance.sample(range(4), chance.randrange(4)))
        columns = ("start_x", "end_y", "x", "angle", "length", "cov_00", "cov_11")
        values: dict[str, list[Any]] = {}
        for row in odd:
            name = chance.choice(columns)
            column = values.setdefault(name, table[name].to_pylist())
            column[row] = chance.choice((None, math.nan, math.inf, -math.inf))
        for name, column in values.items():
            table = crafted_plans.put(name, column)(table)
        pq.write_table(table, path)
        plan = LineMap.read(path)
        rest = np.delete(crafted_plans.ROOM, odd, axis=0)
        assert plan.left_out == len(odd)
        np.testing.assert_allclose(sorted_ends(plan.ends), sorted_ends(rest), atol=1e-6)
        return f"{len(odd)} rows left out"


def assert_sound(plan: LineMap) -> None:
    """Check what any plan promises, wherever it is from."""
    assert 1 <= len(plan.walls) <= LIMITS.walls
    for table in (plan.walls, plan.columns, plan.corners):
        for name in table.dtype.names:
            assert np.isfinite(table[name]).all(), name
    assert np.abs(plan.ends).max() <= FARTHEST
    assert max(plan.size) <= LONGEST
    assert (plan.columns["radius"] > 0).all()
    assert "\n" not in repr(plan)
    index = plan.index
    assert (np.diff(index.begins) >= 0).all()
    assert len(index.members) == 0 or index.members.max() < len(index.walls)


def _curves(space: Any, _: Any) -> None:
    space.add_arc((1, 1), 0.9, 0, 90)
    space.add_ellipse((2, 1), (1, 0.2), 0.5, 0, 3)
    space.add_spline([(0, 0), (1, 2), (3, 1)])
    space.add_lwpolyline([(0, 0, 0.3), (2, 0, 0), (2, 2, -0.5)], "xyb")
    space.add_mline([(0, 0), (3, 0), (3, 2)])


def _columns(space: Any, blocks: Any) -> None:
    blocks.new("c").add_circle((0, 0), 0.2)
    grid = {"row_count": 2, "column_count": 3, "row_spacing": 1, "column_spacing": 1.1}
    space.add_blockref("c", (0.5, 0.5), dxfattribs={**grid, "rotation": 10, "xscale": -1})


@lru_cache(8)
def _storey(seed: int, folder: Path) -> tuple[Any, LineMap, LineMap]:
    """Return a storey, its plan as read from a file, and that of its mirror image."""
    storey, plans = office(seed, (24.0, 18.0), identical=0.0), []
    for name, world in (("own", storey.plan), ("mirrored", storey.mirrored())):
        path = folder / f"{name}{seed}.dxf"
        LineMap.from_lines(world.segments).write(path)
        plans.append(LineMap.read(path))
    return storey, *plans


def _looks_alike(world: World, pose: Any, scan: ln.LaserScan) -> bool:
    """Whether a scan from this pose of a world would be this one, but for a tenth: furniture."""
    expected, _ = cast_rays(world, pose, scan.angles)
    alike = np.abs(expected - scan.ranges)[scan.valid] < 0.1
    return bool(alike.mean() > 0.9)


class Locating(Target):
    """A scan on the plan of a storey: what is called located is right; on a mirror image it is not.

    But where the scan sees the same there: the end of a corridor may be its own mirror image.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._extract = folder, ln.Extractor()

    def make(self, chance: Random) -> tuple[int, int, str]:
        return chance.randrange(40), chance.getrandbits(32), chance.choice(("utm30lx", "lms181"))

    def check(self, made: tuple[int, int, str]) -> str:
        seed, seed_of_scan, sensor = made
        storey, plan, mirrored = _storey(seed, self._folder)
        rng = np.random.default_rng(seed_of_scan)
        pose = storey.free_pose(rng)
        scan = SENSORS[sensor].scan(storey.world, pose, rng)
        features = self._extract(scan)
        where = locate(features, plan, scan=scan)
        if where:
            x, y, turn = np.subtract(where.pose, pose)
            off = (*where.pose, pose, np.sqrt(np.diag(where.covariance)))
            assert math.hypot(x, y) < 0.1, off
            assert abs(math.remainder(turn, 2 * math.pi)) < 0.03, off
        elsewhere = locate(features, mirrored, scan=scan)
        assert not elsewhere or _looks_alike(storey.mirrored(), elsewhere.pose, scan), elsewhere
        return where.verdict
