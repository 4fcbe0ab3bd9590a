"""Plans: walls from features, from DXF, from tables; what is no plan; written and read again."""

import math
import os
import sys
from functools import partial

import ezdxf
import numpy as np
import pytest
from crafted_plans import ROOM
from ezdxf.units import METER_FACTOR
from handmade import arc, features, segment

import lineament as ln
from lineament.cli import run
from lineament.drawings import UNITS
from lineament.logs import save_log
from lineament.mapping import Grid, LineMap, LocalMap, locate, merge_features
from lineament.simulation import SENSORS, drive, office, room


def line(start, end, sigma=0.01, sigma_angle=0.005, misfit=0.0):
    row = segment(start, end, 0, 9, sigma=(sigma, sigma_angle))
    row["misfit"] = misfit
    return row


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


@pytest.mark.parametrize(
    ("other", "walls"),
    [
        (line((1.0, 0.0), (3.0, 0.0)), 1),  # the same again
        (line((2.1, 0.0), (4.0, 0.0)), 1),  # 10 cm further on
        (line((2.3, 0.0), (4.0, 0.0)), 2),  # a gap of a door
        (line((0.0, 0.02), (2.0, 0.02)), 1),  # 1.4 deviations beside it
        (line((0.0, 0.06), (2.0, 0.06)), 2),  # 4.2 deviations
        (line((0.0, 0.06), (2.0, 0.06), misfit=0.02), 1),  # of a wall that bows
        (line((0.0, 0.06), (2.0, 0.06), sigma=0.03), 1),  # less well known
        (line((0.0, 0.0), (2.0, 0.06)), 2),  # turned by 4.2 deviations
        (line((0.0, 0.0), (2.0, 0.06), sigma_angle=0.03), 1),
        (line((2.0, 0.0), (0.0, 0.0)), 2),  # its other side
    ],
)
def test_segments_are_one_wall_by_chi_square(other, walls):
    plan = LineMap.from_features(
        [features(segments=[one]) for one in (line((0, 0), (2, 0)), other)]
    )
    assert len(plan.walls) == walls
    assert plan.walls["side"].tolist() == [1] * walls
    assert plan.walls["views"].sum() == 2


def test_joint_line_is_the_least_squares_one():
    both = line((0, 0), (2, 0), 0.01, 0.01), line((2.1, 0.01), (5, 0.03), 0.02, 0.004)
    wall = LineMap.from_features([features(segments=[one]) for one in both]).walls[0]
    # By definition: offset at x = 0 and slope of least χ².
    rows, values, weights = [], [], []
    for s in both:
        x, y = s["centroid"]
        rows += [[1.0, x], [0.0, 1.0]]
        values += [y, s["angle"]]
        weights += (1 / np.diag(s["covariance"])).tolist()
    rows, weights = np.array(rows), np.diag(weights)
    normal = np.linalg.inv(rows.T @ weights @ rows)
    offset, slope = normal @ rows.T @ weights @ values
    x, y = wall["centroid"]
    lever = np.array([[1.0, x], [0.0, 1.0]])
    np.testing.assert_allclose([y, wall["angle"]], [offset + slope * x, slope], atol=2e-5)
    np.testing.assert_allclose(wall["covariance"], lever @ normal @ lever.T, rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose([wall["start"][0], wall["end"][0]], [0, 5], atol=1e-3)


def test_arcs_are_one_column_by_chi_square():
    wall = line((0, 0), (2, 0))
    scans = [features(segments=[wall], arcs=[arc(x, 1.0, 0.2, 0, 9)]) for x in (1.0, 1.02, 1.2)]
    columns = LineMap.from_features(scans).columns
    often = LineMap.from_features(scans, min_views=2)
    assert (len(often.walls), len(often.columns)) == (1, 1)
    np.testing.assert_allclose(columns["center"], [[1.01, 1.0], [1.2, 1.0]])
    np.testing.assert_allclose(columns["covariance"][0], np.eye(3) * 5e-5)
    assert columns["views"].tolist() == [2, 1]


def test_corners_know_their_opening_and_on_which_side_the_wall_is():
    free = LineMap.from_lines(ROOM, side=1).corners
    np.testing.assert_allclose(free["opening"], math.pi / 2)
    assert free["solid"].tolist() == [0] * 4
    solid = LineMap.from_lines(ROOM[:, [2, 3, 0, 1]], side=1).corners
    assert solid["solid"].tolist() == [1] * 4
    unknown = LineMap.from_lines(ROOM).corners
    assert unknown["solid"].tolist() == [-1] * 4
    to_middle = np.array([2, 1.5]) - unknown["position"]
    off = np.cos(unknown["bisector"] - np.arctan2(to_middle[:, 1], to_middle[:, 0]))
    assert (off > 0.9).all()
    tee = LineMap.from_lines([[0, 0, 4, 0], [2, 0, 2, 3]]).corners
    assert len(tee) == 2


def draw(path, unit=6, **more):
    drawing = ezdxf.new("R2010", units=unit)
    scale = {6: 1.0, 4: 1000.0, 1: 1 / 0.0254, 0: 1.0}[unit]
    space = drawing.modelspace()
    space.add_lwpolyline(scale * np.array([(0, 0), (4, 0), (4, 3)]), dxfattribs={"layer": "A-WALL"})
    block = drawing.blocks.new("corner")
    block.add_line((0, 0), (-4 * scale, 0))
    block.add_line((-4 * scale, 0), (-4 * scale, -3 * scale))
    space.add_blockref("corner", (4 * scale, 3 * scale), dxfattribs={"layer": "A-WALL"})
    space.add_line((1, 1), (1, 1), dxfattribs={"layer": "A-WALL"})
    space.add_arc((0, 0), scale, 0, 90, dxfattribs={"layer": "DOORS"})
    space.add_circle((2 * scale, scale), 0.2 * scale, dxfattribs={"layer": "A-WALL-COLS"})
    space.add_text("room 1", dxfattribs={"layer": "TEXT"})
    for name in more.get("only", ()):
        for entity in list(space):
            if entity.dxf.layer != name:
                space.delete_entity(entity)
    drawing.saveas(path)
    return path


@pytest.mark.parametrize("unit", [6, 4, 1, 0])
def test_dxf_in_any_unit_with_blocks_and_polylines(tmp_path, unit):
    plan = LineMap.read(draw(tmp_path / "plan.dxf", unit))
    lines = np.sort(plan.ends.reshape(-1, 4).round(6), axis=0)
    np.testing.assert_allclose(lines, np.sort(ROOM, axis=0), atol=1e-6)
    assert (plan.walls["side"] == 0).all()
    np.testing.assert_allclose(plan.columns["radius"], [0.2])
    np.testing.assert_allclose(plan.columns["center"], [[2, 1]])


def test_units_of_a_dxf_are_those_of_the_format():
    known = {number: per for number, per in enumerate(METER_FACTOR) if per is not None}
    assert len(known.keys() & UNITS.keys()) >= 10
    for number in known.keys() & UNITS.keys():
        assert UNITS[number] == pytest.approx(1.0 / known[number], rel=1e-4)


def test_an_arc_however_small_has_two_chords_for_a_quarter(tmp_path):
    for radius, chords in ((1e-3, 2), (1.0, 6)):
        drawing = ezdxf.new("R2010", units=6)
        drawing.modelspace().add_line((0, 5), (4, 5))
        drawing.modelspace().add_arc((0, 0), radius, 0, 90)
        drawing.saveas(tmp_path / "plan.dxf")
        assert len(LineMap.read(tmp_path / "plan.dxf").walls) == 1 + chords


def test_walls_whose_covariance_has_one_number_that_is_none_are_left_out():
    walls = LineMap.from_lines([[0, 0, 4, 0], [0, 0, 0, 3]]).walls.copy()
    walls["covariance"][1, 0, 1] = math.nan
    plan = LineMap(walls)
    assert plan.ends.tolist() == [[[0, 0], [4, 0]]]
    assert plan.left_out == 1


def test_dxf_layers_are_chosen_by_name(tmp_path):
    path = draw(tmp_path / "plan.dxf")
    with pytest.warns(ln.LineamentWarning, match=r"is 1 m x 1 m: is it drawn in other units\?"):
        doors = LineMap.read(path, layers=["door*"])
    assert len(doors.walls) > 5
    np.testing.assert_allclose(np.linalg.norm(doors.ends, axis=2), 1.0, atol=1e-6)
    everything = LineMap.read(path, layers=["*"])
    assert len(everything.walls) == 4 + len(doors.walls)


@pytest.mark.parametrize(
    ("name", "make", "line"),
    [
        ("a.dxf", lambda p: p.write_text("no"), r"a\.dxf: is no DXF"),
        ("a.dxf", lambda _: None, r"a\.dxf: No such file"),
        ("a.dxf", lambda p: draw(p, only=["TEXT"]), r"a\.dxf: has no walls: 0 entities"),
        ("a.parquet", lambda p: p.write_text("no"), r"a\.parquet: is no table of features"),
    ],
)
def test_what_is_no_plan_is_one_clear_line(tmp_path, name, make, line):
    make(tmp_path / name)
    with pytest.raises(ln.LineamentError, match=line) as caught:
        LineMap.read(tmp_path / name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("ending", [".yaml", ".svg", ".parquet"])
def test_layers_and_units_are_of_a_dxf(tmp_path, ending):
    path = tmp_path / f"plan{ending}"
    LineMap.from_lines([[0.0, 0.0, 9.0, 0.0], [9.0, 0.0, 9.0, 9.0]]).write(path)
    for asked in ({"layers": ["walls"]}, {"units": "mm"}):
        with pytest.raises(ln.LineamentError, match=rf"plan\{ending}: \w+ are of a DXF, expected"):
            LineMap.read(path, **asked)


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are bytes on Linux alone")
@pytest.mark.parametrize("ending", [".dxf", ".svg", ".parquet"])
def test_a_plan_whose_path_is_no_text_is_read(tmp_path, ending):
    path = tmp_path / (os.fsdecode(b"plan-\xff") + ending)
    LineMap.from_lines(ROOM, side=1).write(path)
    assert len(LineMap.read(path).walls) == len(ROOM)
    path.write_bytes(b"")
    with pytest.raises(ln.LineamentError) as caught:
        LineMap.read(path)
    assert str(caught.value).count("plan-") == 1


def test_layer_that_is_not_there_names_those_that_are(tmp_path):
    path = draw(tmp_path / "a.dxf")
    with pytest.raises(ln.LineamentError, match=r"no layer is B-\*; there are: A-WALL, DOORS"):
        LineMap.read(path, layers=["B-*"])


@pytest.mark.parametrize(
    ("lines", "line"),
    [
        ([], "no walls: 0 lines"),
        ([[1, 1, 1, 1]], "no walls: 1 lines, none has a length"),
        ([[0, 0, np.nan, 1]], "no walls"),
        (1000 * ROOM, "is 4000 m wide, .* is it drawn in other units"),
    ],
)
def test_walls_without_length_and_plans_without_walls(lines, line):
    with pytest.raises(ln.LineamentError, match=line):
        LineMap.from_lines(lines)
    plan = LineMap.from_lines([*ROOM, [1, 1, 1, 1], [0, 0, np.inf, 1]])
    assert len(plan.walls) == 4


@pytest.mark.parametrize("ending", ["dxf", "parquet"])
def test_written_maps_are_read_again(tmp_path, ending):
    world = room()
    scans = [SENSORS["utm30lx"].scan(world, (x, 0, 0.3), np.random.default_rng(1)) for x in (-2, 0)]
    extract = ln.Extractor()
    plan = LineMap.from_features(map(extract, scans), [scan.pose for scan in scans])
    plan.write(tmp_path / f"a.{ending}")
    again = LineMap.read(tmp_path / f"a.{ending}")
    was, read = (np.sort(one.ends.reshape(-1, 4), axis=0) for one in (plan, again))
    np.testing.assert_allclose(read, was, atol=1e-5)
    if ending == "parquet":
        order = [w["centroid"].tolist() for w in plan.walls]
        back = {tuple(np.round(w["centroid"], 5)): w["covariance"] for w in again.walls}
        for wall, place in zip(plan.walls, order, strict=True):
            np.testing.assert_allclose(back[tuple(np.round(place, 5))], wall["covariance"])


def test_table_of_extract_in_the_world_is_a_plan(tmp_path):
    log, table = str(tmp_path / "log.npz"), str(tmp_path / "log.parquet")
    save_log(log, drive(room(), [(-2, 0), (1, 0)], SENSORS["utm30lx"], rate=1))
    assert run(["extract", log, "--world", "-o", table, "-q"]) == 0
    walls = LineMap.read(table).walls
    often = walls[walls["views"] > 1]
    ends = np.stack((often["start"], often["end"]), axis=1)
    lines = room().segments.reshape(-1, 2, 2)
    along = lines[:, 1] - lines[:, 0]
    off = [cross(along, end[:, None] - lines[:, 0]) for end in ends] / np.linalg.norm(along, axis=1)
    assert np.abs(off).max(axis=1).min(axis=1).max() < 0.02
    assert 4 <= len(often) <= 12


LINES, SEEN, EMPTY, EYE = LineMap.from_lines, LineMap.from_features, features(), np.eye(3)


@pytest.mark.parametrize(
    ("call", "given", "problem"),
    [
        (LINES, [[[0, 0], [1, 1]]], r"lines have shape \(2, 2\), expected \(n, 4\)"),
        (LINES, [[0, 0, 1, 1]], r"lines have shape \(4,\)"),
        (LINES, [ROOM, [[1, 1]]], r"columns have shape \(1, 2\), expected \(n, 3\)"),
        (SEEN, [[EMPTY] * 2, [(0, 0, 0)]], "poses are 1, expected 2, one for each scan"),
        (SEEN, [[EMPTY], [(0, 0, 0)], [EYE] * 2], "pose_covariances are 2, expected 1"),
        (EMPTY.transform, [0, math.nan, 0], "pose is .* expected three finite numbers"),
        (EMPTY.transform, ["0", 0, 0], "pose is .* expected three finite numbers"),
        (locate, [EMPTY, LINES(ROOM), None, EYE], "a covariance is given without a guess"),
        (office, [1, (30_000, 20_000)], "expected 20 m x 16 m to 300 m x 300 m"),
        (
            LINES,
            ["plan.dxf"],
            r"^lines are 'plan.dxf', expected numbers of shape \(n, 4\) or \(n, 2, 2\)$",
        ),
        (
            LINES,
            [ROOM, [[1, 1, 1], [1, 1]]],
            r"^columns are \[\[1, 1, 1\], \[1, 1\]\], expected numbers of shape \(n, 3\)$",
        ),
        (partial(LINES, side=2), [ROOM], "^side is 2, expected 0 or 1$"),
        *(
            (
                partial(LINES, sigma=sigma),
                [ROOM],
                f"^sigma is {sigma}, expected less than 1 in metr",
            )
            for sigma in (-0.1, math.nan, 45)  # in millimetres
        ),
        (
            partial(LineMap.read, layers="A-WALL*"),
            ["plan.dxf"],
            r"^layers are 'A-WALL\*', expected a list of names$",
        ),
        (
            Grid,
            [np.zeros((3, 3)), 0.05],
            r"^cells are float64 of shape \(3, 3\), expected int8 in rows and columns$",
        ),
        (Grid, [np.zeros((3, 3), np.int8), 0], "^resolution is 0 m a cell, expected 0.0001 to 10$"),
        (Grid, [np.zeros((3, 3), np.int8), 1, (0, 1)], r"^origin is \(0, 1"),
        (Grid, [np.zeros((3, 3), np.int8), 1, (0, math.nan, 1)], r"^origin is \(0, nan, 1\), expe"),
        (Grid, [np.zeros((3, 3), np.int8), 1, (0, 0, 90)], "^origin has theta = 90 rad, more than"),
    ],
)
def test_what_would_be_half_taken_is_refused(call, given, problem):
    with pytest.raises(ValueError, match=problem):
        call(*given)


SEEN = ln.LaserScan([2.0] * 5, -0.02, 0.01)


@pytest.mark.parametrize(
    ("given", "kind", "problem"),
    [
        ({"query": SEEN}, TypeError, "features is of type LaserScan, expected Features: what ext"),
        ({"plan": "plan.dxf"}, TypeError, "plan is of type str, expected LineMap: LineMap.read"),
        (
            {"guess": (0.0, 1.0)},
            ValueError,
            r"guess is \(0.0, 1.0\), expected three finite numbers",
        ),
        ({"guess": (math.nan, 1, 0)}, ValueError, r"guess is \(nan, 1, 0\), expected three finite"),
        ({"guess": 5}, ValueError, r"guess is 5, expected \(x, y, theta\)"),
    ],
)
def test_what_would_be_looked_for_in_vain_is_refused(given, kind, problem):
    with pytest.raises(kind, match=problem):
        locate(**{"query": ln.extract(SEEN), "plan": LineMap.from_lines(ROOM)} | given)


def test_a_scan_is_no_features():
    tracks = ln.Tracker()(ln.extract(SEEN))
    for call in (
        partial(LocalMap().add, SEEN, tracks),
        partial(merge_features, [SEEN], [(0, 0, 0)]),
    ):
        with pytest.raises(TypeError, match="features is of type LaserScan, expected Features"):
            call()


def test_pairs_of_ends_are_lines():
    pairs, rows = LineMap.from_lines(ROOM.reshape(-1, 2, 2)), LineMap.from_lines(ROOM)
    assert pairs.walls.tobytes() == rows.walls.tobytes()


def test_what_is_no_record_of_a_wall_is_refused():
    walls = LineMap.from_lines(ROOM).walls
    with pytest.raises(TypeError, match="walls are no records of walls"):
        LineMap(ROOM)
    with pytest.raises(TypeError, match="columns are no records of columns"):
        LineMap(walls, walls)
