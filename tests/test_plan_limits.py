"""Plans that are hostile or damaged: one line, or walls with numbers, within bounds."""

import json
import re
import subprocess
import sys
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from crafted_plans import PLANS, ROOM, drawn, put, table

import lineament as ln
from lineament.cli import run
from lineament.limits import LIMITS
from lineament.logs import save_log
from lineament.mapping import LineMap, hypotheses
from lineament.mapping.hypotheses import REACH, beside, meetings
from lineament.mapping.index import make_index
from lineament.simulation import SENSORS, drive, room
from lineament.walls import walls_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there are no pipes to open")

#: Reads plans, and prints how each ends; the most memory that was added [MB]; bounds time.
READ = """
import json, resource, sys, warnings
import ezdxf, pyarrow.parquet
from lineament import LineamentError, LineamentWarning
from lineament.mapping import LineMap

resource.setrlimit(resource.RLIMIT_CPU, (120, 120))
room = LineMap.from_lines([[0, 0, 4, 0], [4, 0, 4, 3]])
room.corners
before, ends = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, []
for path, limits in json.load(sys.stdin):
    try:
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always", LineamentWarning)
            plan = LineMap.read(path, limits=limits)
        assert heard or not plan.left_out
        ends.append(f"{path}: read, {len(plan.walls)} walls, {plan.left_out} left out")
    except LineamentError as error:
        ends.append(str(error))
after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([(after - before) / 1024, ends]))
"""


@pytest.fixture(scope="module")
def ends(tmp_path_factory):
    """How each crafted plan ends, by its name; read by one process, whose memory is bounded."""
    folder, given = tmp_path_factory.mktemp("plans"), []
    for name, (_, write, limits, _) in PLANS.items():
        write(folder / name)
        given.append((str(folder / name), limits))
    command = [sys.executable, "-W", "error", "-c", READ]
    text = json.dumps(given)
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    memory, lines = json.loads(done.stdout)
    assert memory < 200
    return {name: line.removeprefix(f"{folder}/") for name, line in zip(PLANS, lines, strict=True)}


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANS)
def test_a_crafted_plan_ends_in_one_line(name, ends):
    limit, _, limits, said = PLANS[name]
    if limit:
        most = limits.get(limit, getattr(LIMITS, limit))
        said = rf"more than the limit of {most} \(raise it by --limit {limit}=N, in Python "
    assert re.match(rf"{re.escape(name)}: .*({said}|^$)", ends[name]), ends[name]
    assert ends[name].isprintable()
    assert len(ends[name]) < 400


def test_limits_of_plans_can_be_raised_and_lowered(tmp_path):
    path = tmp_path / "a.dxf"
    drawn(path, lambda space, _: space.add_arc((0, 0), 1.0, 0, 90))
    arc = 5  # a quarter of a turn, each chord 8 · 1 cm under √: 0.283 rad
    assert len(LineMap.read(path, limits={"chords": arc + 1, "walls": arc + 5}).walls) == 10
    for limits in ({"chords": arc}, {"walls": arc + 4}, {"entities": 4}, {"drawing": 1000}):
        (name, most), *_ = limits.items()
        with pytest.raises(ln.LineamentError, match=rf"a\.dxf: has \d+ .*limit of {most} \(raise"):
            LineMap.read(path, limits=limits)
        assert name in LIMITS.__slots__
    with pytest.raises(ValueError, match="limit 'lines' is unknown"):
        LineMap.read(path, limits={"lines": 3})
    with pytest.raises(ValueError, match="units are 'furlong', expected one of in, ft"):
        LineMap.read(path, units="furlong")


def test_chords_are_as_near_to_the_curve_as_they_say(tmp_path):
    path = tmp_path / "a.dxf"
    for unit, scale in ((6, 1.0), (4, 1000.0)):
        drawing = ezdxf.new("R2010", units=unit)
        block = drawing.blocks.new("a")
        block.add_arc((0, 0), 2.0 * scale / 500, 10, 200)
        drawing.modelspace().add_blockref("a", (0, 0), dxfattribs={"xscale": 500, "yscale": 500})
        drawing.saveas(path)
        ends = LineMap.read(path).ends
        np.testing.assert_allclose(np.linalg.norm(ends, axis=2), 2.0)
        off = 2.0 - np.linalg.norm(ends.mean(axis=1), axis=1)
        assert 0.005 < off.max() <= 0.01


def test_blocks_stand_where_their_inserts_say(tmp_path):
    """A grid of blocks in a block, turned, mirrored, stretched, with a base point."""
    path = tmp_path / "a.dxf"
    drawing = ezdxf.new("R2010", units=6)
    inner = drawing.blocks.new("inner", base_point=(1, 0))
    inner.add_line((1, 0), (2, 0), dxfattribs={"layer": "0"})
    inner.add_circle((1, 1), 0.25, dxfattribs={"layer": "0"})
    outer = drawing.blocks.new("outer")
    grid = {"row_count": 2, "column_count": 3, "row_spacing": 10, "column_spacing": 5}
    outer.add_blockref("INNER", (0, 0), dxfattribs={**grid, "layer": "0"})
    given = {"xscale": -2, "yscale": 2, "rotation": 90, "layer": "A-WALL"}
    drawing.modelspace().add_blockref("outer", (100, 0), dxfattribs=given)
    drawing.modelspace().add_line((0, 0), (9, 9), dxfattribs={"layer": "DOORS"})
    drawing.saveas(path)
    plan = LineMap.read(path)
    # x, y of the block is mirrored to -2x, 2y, then turned to -2y, -2x, and moved.
    starts = [(100 - 2 * y, -2 * x) for y in (0, 10) for x in (0, 5, 10)]
    key = lambda rows: np.array(sorted(np.round(rows, 9).tolist()))  # noqa: E731
    np.testing.assert_allclose(key(plan.walls["start"]), key(np.array(starts, float)), atol=1e-9)
    steps = plan.walls["end"] - plan.walls["start"]
    np.testing.assert_allclose(steps, np.tile((0.0, -2.0), (6, 1)), atol=1e-9)
    np.testing.assert_allclose(plan.columns["radius"], 0.5)
    centers = np.array(starts) - (2, 0)
    np.testing.assert_allclose(key(plan.columns["center"]), key(centers), atol=1e-9)
    given["xscale"] = 1  # stretched: columns are ellipses, which become chords
    drawing.modelspace().delete_all_entities()
    drawing.modelspace().add_blockref("outer", (100, 0), dxfattribs=given)
    drawing.saveas(path)
    plan = LineMap.read(path)
    assert len(plan.columns) == 0
    first = plan.ends[np.linalg.norm(plan.ends - (98, 0), axis=2).max(axis=1) < 1]
    x, y = (first - (98, 0)).reshape(-1, 2).T
    np.testing.assert_allclose((x / 0.5) ** 2 + (y / 0.25) ** 2, 1)


def test_rows_without_numbers_are_left_out_and_said(tmp_path, capsys, refused):
    log, path, poses = (str(tmp_path / name) for name in ("a.npz", "a.parquet", "a.tum"))
    save_log(log, drive(room(), [(-2, 0), (-1.8, 0)], SENSORS["utm30lx"], rate=5))
    table(Path(path), change=put("length", [None]))
    said = "a.parquet: 1 walls or columns have impossible numbers, left out"
    with pytest.warns(ln.LineamentWarning, match=said):
        plan = LineMap.read(path)
    assert (len(plan.walls), plan.left_out) == (3, 1)
    run(["locate", log, "--map", path, "-o", poses, "-q"])
    assert "1 walls or columns have impossible numbers" in capsys.readouterr().err
    found = str(tmp_path / "found.parquet")
    for command in (["locate", log, "--map", path], ["map", log, "--onto", path]):
        said = refused([*command, "-o", found, "--limit", "entities=2"])
        assert "a.parquet: has 8 entities, rows" in said


# Corners, and what lists walls


def naive_pairs(walls):
    """Walls whose boxes overlap, by definition."""
    ends = np.stack((walls["start"], walls["end"]), axis=1)
    low, high = ends.min(axis=1) - REACH, ends.max(axis=1) + REACH
    overlap = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    return np.column_stack(np.nonzero(np.triu(overlap, 1)))


def random_walls(seed):
    rng = np.random.default_rng(seed)
    n, size = rng.integers(0, 120), rng.choice([1, 5, 30, 1000])
    start, turn = rng.uniform(-size, size, (n, 2)), rng.uniform(0, 7, n)
    if seed % 3 == 0:  # on a grid, at right angles, some twice
        start, turn = np.round(start), np.round(turn) * np.pi / 2
    length = rng.uniform(0.01, rng.choice([0.3, 6, 100]), n)
    along = length[:, None] * np.stack((np.cos(turn), np.sin(turn)), axis=1)
    walls = walls_of(np.stack((start, start + along), axis=1))
    walls["side"] = rng.integers(0, 2, n)
    return walls


@pytest.mark.parametrize("seed", range(60))
def test_corners_are_those_of_all_pairs(seed, monkeypatch):
    walls = random_walls(seed)
    found = meetings(walls)
    monkeypatch.setattr(hypotheses, "beside", naive_pairs)
    np.testing.assert_array_equal(found, meetings(walls))


def test_pairs_grow_with_walls_and_not_with_their_square():
    def pairs(n):
        rng = np.random.default_rng(n)
        start = rng.uniform(0, 1.5 * n**0.5, (n, 2))
        return len(beside(walls_of(np.stack((start, start + rng.uniform(-3, 3, (n, 2))), axis=1))))

    assert pairs(8000) < 5 * pairs(2000)


@pytest.mark.slow
def test_long_walls_are_listed_in_bounds():
    rng = np.random.default_rng(0)
    start = rng.uniform(0, 100, (3000, 2))
    plan = LineMap.from_lines(np.hstack((start, start + 900)))
    assert len(make_index(plan.walls, plan.columns, 0.0).members) < 20_000_000
    few = LineMap.from_lines(ROOM).index
    assert few.grid[2] == 0.75
