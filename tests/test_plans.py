"""Plans: walls that are one, worked by hand; and what SVG and DXF draw of a scan and of a log."""

import math
import re
import xml.etree.ElementTree as ET
from itertools import pairwise

import ezdxf
import numpy as np
import pytest
from handmade import arc, corner, edge, features, segment
from hypothesis import given, settings
from hypothesis import strategies as st

from lineament import LaserScan, LineamentError
from lineament.output import open_writer
from lineament.output.canvas import CORNER_COLOR, EDGE_COLOR
from lineament.output.floor_plan import ROUGH, Averages, FloorPlan
from lineament.output.markers import arc_span, ellipses_of, markers_of
from lineament.output.scene import Layer, layers_of
from lineament.walls import lengths_of

SVG = "{http://www.w3.org/2000/svg}"
WALL = (0, 0), (4, 0)


def line(start, end, sigma=(0.002, 0.002)):
    return segment(start, end, 0, 9, sigma=sigma)


def plan_of(*scans):
    """Plan of scans, each a list of segments or of their ends."""
    plan = FloorPlan()
    for scan in scans:
        plan.add(features(segments=[line(*s) if isinstance(s, tuple) else s for s in scan]))
    return plan


def turned(angle):
    return np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])


# 1 m once, 1 m twice, 1 m once; the third is not seen to touch, but is near: one wall.
OVERLAPPING = [((0, 1), (2, 1))], [((1, 1), (3, 1))], [((3.1, 1), (4, 1))]
OPEN, SHUT = [((0, 0), (2, 0)), ((3, 0), (5, 0))], [((0, 0), (5, 0))]
BAD = [
    line(*WALL, sigma=(0.06, 0.001)),
    line(*WALL, sigma=(0.001, 0.03)),  # 6 cm at its ends
    *(((0, 2), (0.1, 2)), ((0, 3), (2000, 3)), ((0, 4), (np.nan, 4)), ((1e300, 5), (1e300, 8))),
]
X, Y = 448_000, 5_412_000  # UTM


@pytest.mark.parametrize(
    ("scans", "least", "walls"),
    [
        (OVERLAPPING, 1, [(0, 1, 4, 1, 3)]),
        (OVERLAPPING, 2, [(1, 1, 2, 1, 2)]),
        (OVERLAPPING, 3, []),
        # A door that was shut once stays open.
        ((OPEN, OPEN, SHUT, OPEN), 2, [(0, 0, 2, 0, 4), (3, 0, 5, 0, 4)]),
        # Both faces of a partition.
        (([WALL], [((4, 0.04), (0, 0.04))]), 1, [(0, 0, 4, 0, 1), (4, 0.04, 0, 0.04, 1)]),
        # The line goes through all that was seen: the mean of 0, 0 and 0.012 is 0.004.
        (([WALL], [WALL], [((0, 0.012), (4, 0.012))]), 1, [(0, 0.004, 4, 0.004, 3)]),
        # 20 cm are less than a door.
        (([((0, 0), (2, 0))], [((2.19, 0), (4, 0))]), 1, [(0, 0, 4, 0, 2)]),
        (([((0, 0), (2, 0))], [((2.21, 0), (4, 0))]), 1, [(0, 0, 2, 0, 1), (2.21, 0, 4, 0, 1)]),
        # Uncertain, short and impossible segments are left out, and short pieces.
        ((BAD,), 1, []),
        (([*BAD, ((0, 6), (4, 6)), ((4, 6), (4.15, 6))],), 1, [(0, 6, 4, 6, 1)]),
        (([((X, Y), (X + 3, Y))], [((X + 2, Y), (X + 4, Y))]), 1, [(X, Y, X + 4, Y, 2)]),
    ],
)
def test_walls(scans, least, walls):
    found = plan_of(*scans).walls(least)
    rows = np.column_stack((found["start"], found["end"], found["views"]))
    np.testing.assert_allclose(rows[np.argsort(rows[:, 0])], walls_sorted(walls), rtol=0, atol=1e-3)


def walls_sorted(walls):
    return np.reshape(sorted(walls), (-1, 5))


@pytest.mark.parametrize(
    ("other", "count"),
    [
        # χ² of two lines, of which the offsets have √(0.002² + 0.005²) m, and walls 0.03 m more, is
        # within 9.21 up to 9.39 cm.
        (((0, 0.093), (4, 0.093)), 1),
        (((0, 0.095), (4, 0.095)), 2),
        (((1, 0.04), (2, 0.04)), 1),
        (((4.19, 0), (6, 0)), 1),
        (((4.21, 0), (6, 0)), 2),
        (((4.1, 0.1), (8, 0.1)), 2),
        (((0, 0.0), (4, 0.2)), 2),  # turned by 2.9 degrees
        # A short one may be turned more.
        (segment((1, 0.0), (2, 0.05), 0, 9, sigma=(0.002, 0.02)), 1),
        (segment((1, 0.0), (2, 0.2), 0, 9, sigma=(0.002, 0.02)), 2),
        (((3.9, 0.01), (9, -0.6)), 2),  # ends on it, turned by 6.8 degrees
        (((4, 0), (0, 0)), 2),  # the other face
    ],
)
def test_what_is_one_wall(other, count):
    assert len(plan_of([WALL], [other, ((-20, -20), (-20, 24))]).walls()) == count + 1


def test_what_is_joined_later_is_the_same(monkeypatch):
    """Many copies of a room: whatever is joined at a time, its walls are four."""
    rng = np.random.default_rng(3)
    views = [np.array([WALL, ((4, 0), (4, 3)), ((4, 3), (0, 3)), ((0, 3), (0, 0))])] * 40
    noisy = [room + rng.normal(0, 0.003, (4, 2, 2)) for room in views]
    found = []
    for together in (1, 7, 2000):
        monkeypatch.setattr("lineament.output.floor_plan.TOGETHER", together)
        walls = plan_of(*([tuple(map(tuple, side)) for side in room] for room in noisy)).walls(3)
        assert walls["views"].tolist() == [40] * 4
        found.append(walls[np.lexsort(walls["centroid"].round(1).T)])
    for walls in found[:2]:
        np.testing.assert_allclose(walls["start"], found[2]["start"], atol=1e-6)
        np.testing.assert_allclose(walls["end"], found[2]["end"], atol=1e-6)


def test_the_line_is_that_of_least_squares():
    """Of two lines of one direction, the surer one counts more, by its variance."""
    sure, vague = 0.002, 0.02
    plan = plan_of(
        [line(*WALL, sigma=(sure, 1e-3)), line((0, 0.05), (4, 0.05), sigma=(vague, 1e-3))]
    )
    (wall,) = plan.walls()
    weights = 1 / (np.square([sure, vague]) + ROUGH**2)
    assert wall["centroid"][1] == pytest.approx(0.05 * weights[1] / weights.sum(), abs=1e-4)


@settings(max_examples=10)
@given(st.integers(0, 10_000))
def test_many_noisy_views_give_the_room(seed):
    rng = np.random.default_rng(seed)
    room = np.array([(0, 0), (5, 0), (5, 4), (0, 4), (0, 0)]) @ turned(rng.uniform(0, 6))
    sides = [
        (a, b - a, turned(-math.pi / 2) @ (b - a) / math.dist(a, b)) for a, b in pairwise(room)
    ]
    plan = FloorPlan()
    for _ in range(30):
        seen = []
        for start, way, normal in sides:
            along = np.sort(rng.uniform(0, 1, 2))
            across = rng.normal(0, 0.008) + rng.normal(0, 0.004, 2)
            length = math.dist(*(start + along[:, None] * way))
            sigma = 0.009, 0.008 / max(length, 0.2)
            seen.append(line(*start + along[:, None] * way + across[:, None] * normal, sigma=sigma))
        plan.add(features(segments=seen))
    walls = plan.walls(3)
    main = walls[np.argsort(-walls["views"])[:4]]
    ends = np.stack((main["start"], main["end"]), axis=1)
    for start, _, normal in sides:
        assert np.abs((ends - start) @ normal).max(axis=1).min() < 0.03
    lengths = lengths_of(walls)
    assert lengths[np.argsort(-walls["views"])[:4]].sum() > 0.9 * lengths.sum()


def test_plans_are_bounded(monkeypatch):
    for name, most in (("TOGETHER", 10), ("MOST_SEGMENTS", 40), ("MOST", 40)):
        monkeypatch.setattr(f"lineament.output.floor_plan.{name}", most)
    plan, sizes = FloorPlan(), []
    for y in range(1, 300):
        walls = [line((0, 0), (5, 0)), line((0, y), (1, y))]
        plan.add(features(segments=walls, corners=[corner(0, y), corner(0, 0)]))
        sizes.append((len(plan._sights), len(plan._corners.seen(1))))
    assert np.max(sizes, axis=0).tolist() == [40, 40]
    assert np.min(sizes[60:], axis=0).tolist() == [21, 20]
    assert plan.every == 16
    # What was seen most is there, and what was seen once is of all times.
    (wall,) = plan.walls(3)
    assert (wall["start"].round(9).tolist(), wall["end"].tolist()) == ([0, 0], [5, 0])
    once = np.sort(plan.walls()["start"][:, 1])[1:]
    assert once[0] < 60
    assert once[-1] > 240
    np.testing.assert_allclose(plan._corners.seen(299), [(0, 0)])


def test_a_plan_of_a_part_of_the_scans_says_so(tmp_path, monkeypatch):
    for name, most in (("TOGETHER", 2), ("MOST_SEGMENTS", 20)):
        monkeypatch.setattr(f"lineament.output.floor_plan.{name}", most)
    scan, found = scan_at(0, 0, 0), features(100, segments=[line(*WALL)])
    with open_writer(tmp_path / "a.svg") as writer:
        for _ in range(30):
            writer.write(found, scan)
    assert "each seen 3 times at least; walls of one scan in 2<" in (tmp_path / "a.svg").read_text()


def test_what_is_forgotten_was_seen_least_and_not_last(monkeypatch):
    """Walls and corners that are seen again and again, but only behind many others."""
    for name, most in (("TOGETHER", 5), ("MOST", 40)):
        monkeypatch.setattr(f"lineament.output.floor_plan.{name}", most)
    plan, counts = FloorPlan(), []
    for y in range(1, 60):
        again = y > 30
        walls = [line((0, y), (1, y)), *[line((0, 0), (5, 0))] * again]
        plan.add(features(segments=walls, corners=[corner(0, y), *[corner(9, 0)] * again]))
        counts.append(len(plan._lines))
        assert plan._sights["wall"].max(initial=-1) == counts[-1] - 1
    assert 30 < max(counts) <= 40
    assert 20 in counts[30:]  # half of what there may be
    (wall,) = plan.walls(2)
    assert (wall["start"].tolist(), wall["end"].tolist(), wall["views"]) == ([0, 0], [5, 0], 29)
    np.testing.assert_allclose(plan._corners.seen(29), [(9, 0)])


def test_averages_join_what_is_near_and_edges_stay_apart_from_corners():
    means = Averages(2, 0.1)
    means.add(np.array([(0, 0), (1, 0), (np.nan, 0), (1e300, 0)]))
    means.add(np.array([(0.06, 0), (1.2, 0)]))
    np.testing.assert_allclose(means.seen(1), [(0.03, 0), (1, 0), (1.2, 0)])
    np.testing.assert_allclose(means.seen(2), [(0.03, 0)])
    plan = FloorPlan()
    for shift in (0.0, 0.02):
        plan.add(features(corners=[corner(shift, 1)], edges=[edge(0.05, 1 + shift)]))
    markers, _ = plan.markers(min_views=2)
    np.testing.assert_allclose(markers.corners, [(0.01, 1)])
    np.testing.assert_allclose(markers.edges, [(0.05, 1.01)])


# Files.


def write(path, *written):
    with open_writer(path) as writer:
        for found, scan in written:
            writer.write(found, scan)


def scan_at(*pose, ranges=(2.0,) * 100):
    return LaserScan(ranges, angle_min=-1.0, angle_increment=0.02, pose=pose or None)


def numbers(element, *names):
    return [float(element.get(name)) for name in names]


def shapes(path):
    """Read a plan: rows of walls (ends, views), points, circles, arcs and ellipses, by layer."""
    return {".svg": svg_shapes, ".dxf": dxf_shapes}[path.suffix](path)


def svg_shapes(path):
    groups = {group.get("id"): group for group in ET.parse(path).iter(f"{SVG}g")}
    found = {
        "walls": [numbers(e, "x1", "y1", "x2", "y2", "data-views") for e in groups["walls"]],
        "arcs": [],
        "ellipses": [],
    }
    for name in ("corners", "edges"):
        assert groups[name].get("fill") == {"corners": CORNER_COLOR, "edges": EDGE_COLOR}[name]
        found[name] = [numbers(e, "cx", "cy") for e in groups[name]]
    for e in groups["arcs"]:
        if e.tag == f"{SVG}circle":
            found["arcs"].append(numbers(e, "cx", "cy", "r"))
            continue
        x1, y1, r, _, turn, is_large, sweep, x2, y2 = map(float, re.findall(r"[-.\d]+", e.get("d")))
        assert (turn, sweep) == (0, 1)
        # The centre lies beside the chord, to the left of it if the arc is small.
        chord = np.array([x2 - x1, y2 - y1])
        height = math.sqrt(max(r**2 - (chord @ chord) / 4, 0)) * (-1) ** is_large
        normal = np.array([-chord[1], chord[0]]) / np.linalg.norm(chord)
        x, y = np.array([x1 + x2, y1 + y2]) / 2 + height * normal
        ends = math.atan2(y1 - y, x1 - x), math.atan2(y2 - y, x2 - x)
        found["arcs"].append([x, y, r, *ends])
    for e in groups["ellipses"]:
        x, y, turn = map(float, re.findall(r"[-.\d]+", e.get("transform")))
        found["ellipses"].append([x, y, *numbers(e, "rx", "ry"), math.radians(turn)])
    return found


def dxf_shapes(path):
    drawing = ezdxf.readfile(path)
    audit = drawing.audit()
    assert not audit.errors
    assert not audit.fixes
    assert drawing.header["$INSUNITS"] == 6  # metres
    colors = {layer.dxf.name: layer.dxf.color for layer in drawing.layers}
    assert colors["CORNERS"] != colors["EDGES"]
    found = {name: [] for name in ("walls", "arcs", "ellipses", "corners", "edges")}
    for e in drawing.modelspace():
        kind, layer = e.dxftype(), found[e.dxf.layer.lower()]
        if kind == "LINE":
            views = e.get_xdata("LINEAMENT")[1].value
            layer.append([*e.dxf.start.vec2, *e.dxf.end.vec2, views])
        elif kind == "POINT":
            layer.append([*e.dxf.location.vec2])
        elif kind == "ELLIPSE":
            axis = e.dxf.major_axis.vec2
            size = axis.magnitude, e.dxf.ratio * axis.magnitude
            layer.append([*e.dxf.center.vec2, *size, axis.angle])
        else:
            turn = (e.dxf.start_angle, e.dxf.end_angle) if kind == "ARC" else ()
            layer.append([*e.dxf.center.vec2, e.dxf.radius, *map(math.radians, turn)])
    return found


@pytest.fixture(params=[".svg", ".dxf"])
def target(request, tmp_path):
    return tmp_path / f"a{request.param}"


@pytest.mark.parametrize("part", [slice(0, 100), slice(0, 20), slice(70, 73)])
def test_one_scan_is_drawn_in_its_own_frame(target, part):
    scan, beams = scan_at(5, 5, 1), range(100)[part]
    turn = turned(-0.5)
    found = features(
        100,
        segments=[line((1, -0.5), (1, 2.25)), line((1, 2.25), (-0.123456, 2.25))],
        corners=[corner(1, 2.25), corner(2, 2, sigma=0.0)],
        edges=[edge(-0.125, 2.25)],
        arcs=[arc(1.0, 0.0, 1.0, beams[0], beams[-1]), arc(0.0, 5.0, 0.5, 0, 200)],
    )
    found.corners["covariance"][0] = turn @ np.diag([0.04, 0.01]) @ turn.T
    write(target, (found, scan))
    drawn, markers = shapes(target), markers_of(found, scan)
    assert drawn["walls"] == [[1, -0.5, 1, 2.25, 1], [1, 2.25, -0.123456, 2.25, 1]]
    assert (drawn["corners"], drawn["edges"]) == ([[1, 2.25], [2, 2]], [[-0.125, 2.25]])
    partial, whole = drawn["arcs"]
    assert whole == [0, 5, 0.5]  # of unknown beams
    assert partial[:3] == pytest.approx([1, 0, 1], abs=1e-4)
    off = np.subtract(partial[3:], markers.arcs[0, 3:]) / (2 * math.pi)
    assert off == pytest.approx(np.rint(off), abs=1e-4)
    kept = [k for k, row in enumerate(markers.ellipses) if row[2] > 0 or target.suffix == ".svg"]
    expected = markers.ellipses[kept]
    assert np.array(drawn["ellipses"])[:, :4] == pytest.approx(expected[:, :4], abs=1e-6)
    assert drawn["ellipses"][0][4] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize(
    ("width", "height", "scale", "bar"),
    [
        (7.9, 0.5, 20, 1),  # wide: 395 mm of 400
        (0.5, 5.1, 20, 0.1),  # tall: 255 mm of 260
        (0.5, 13.0, 50, 0.1),  # just as tall as the sheet
        (0.5, 5.3, 50, 0.1),
        (3.0, 90.0, 500, 0.5),
        (399.0, 20.0, 1000, 50),
        (401.0, 20.0, 2000, 100),
        (0.21, 0.1, 1, 0.05),
    ],
)
def test_svg_is_to_scale_on_a_sheet(tmp_path, width, height, scale, bar):
    x, y = 30.0, -70.0
    walls = [line((x, y), (x + width, y)), line((x, y), (x, y + height))]
    write(tmp_path / "a.svg", (features(100, segments=walls), scan_at()))
    root = ET.parse(tmp_path / "a.svg").getroot()
    paper = [float(root.get(name).removesuffix("mm")) for name in ("width", "height")]
    assert [float(number) for number in root.get("viewBox").split()] == [0, 0, *paper]
    assert paper[0] <= 420
    assert paper[1] <= 297
    plan = next(root.iter(f"{SVG}g"))
    a, b, c, d, e, f = map(float, plan.get("transform")[7:-1].split())
    assert (a, b, c, d) == (1000 / scale, 0, 0, -1000 / scale)
    assert float(plan.get("stroke-width")) == pytest.approx(0.45 / a, rel=1e-3)
    # The plan stands between the margins, above the bar and the caption.
    left, right, bottom, top = a * x + e, a * (x + width) + e, d * y + f, d * (y + height) + f
    assert (left, bottom, top) == pytest.approx((10, paper[1] - 27, 10), abs=1e-3)
    assert paper[0] - 10 == pytest.approx(max(right, 130), abs=1e-3)
    (path,) = root.findall(f"{SVG}path")
    assert float(path.get("d").split()[6]) == pytest.approx(1000 * bar / scale)
    assert [text.text for text in root.findall(f"{SVG}text")] == [
        f"{bar:g} m, 1 : {scale}",
        "2 walls and 0 corners of 1 scan",
    ]


def test_log_is_drawn_by_its_poses(target):
    # One wall, seen from three places: in the frame of the plan it is (2, 0) to (2, 3).
    with open_writer(target) as writer:
        writer.min_views = 2
        for k, pose in enumerate([(0, 0, 0), (1, 1, math.pi / 2), (-1, 2, -0.3)]):
            extra = [line((0, 9 + k), (1, 9 + k))]  # seen once each
            world = features(100, segments=[line((2, 0), (2, 3)), *extra])
            world.arcs = np.array([arc(4, 4, 0.2, 0, 9)])
            x, y, theta = pose
            back = world.transform(0, 0, -theta).transform(*(-turned(theta) @ (x, y)).tolist(), 0)
            writer.write(back, scan_at(*pose))
    drawn = shapes(target)
    (wall,) = drawn["walls"]
    assert wall[:4] == pytest.approx([2, 0, 2, 3], abs=0.026)  # a cell, along the wall
    assert wall[:4:2] == pytest.approx([2, 2], abs=1e-6)
    assert wall[4] == 3
    assert drawn["arcs"] == [pytest.approx([4, 4, 0.2])]


@pytest.mark.parametrize(("n", "walls"), [(9, 2), (10, 1)])
def test_few_scans_are_drawn_as_they_are_and_many_by_their_views(tmp_path, n, walls):
    seen = features(100, segments=[line((2, 0), (2, 3))])
    once = features(100, segments=[line((2, 0), (2, 3)), line((7, 0), (7, 3))])
    log = [(once if k == 4 else seen, scan_at(0, 0, 0)) for k in range(n)]
    write(tmp_path / "a.svg", *log)
    assert len(shapes(tmp_path / "a.svg")["walls"]) == walls
    often = ", each seen 3 times at least" if n == 10 else ""
    caption = f"{walls} wall{'s' * (walls > 1)} and 0 corners of {n} scans{often}"
    assert ET.parse(tmp_path / "a.svg").find(f"{SVG}title").text == caption


@pytest.mark.parametrize("without", [0, 2])
def test_several_scans_need_poses(target, without):
    scans = [scan_at(*(() if k == without else (0, 0, 0))) for k in range(3)]
    with pytest.raises(LineamentError, match=f"scan {without} has no pose, expected pose") as error:
        write(target, *((features(100), scan) for scan in scans))
    assert "\n" not in str(error.value)
    assert not list(target.parent.iterdir())
    write(target, (features(100), scan_at()))  # one needs none


def test_odd_features_are_drawn_or_left_out(target):
    odd = features(
        100,
        segments=[line((0, 0), (0, 0)), line((np.nan, 0), (1, 0)), line((1e300, 0), (1, 0))],
        corners=[corner(1, 1, sigma=0.0), corner(np.inf, 0), corner(2, 2, sigma=1e-9)],
        arcs=[arc(0, 0, 0.1, 0, 99), arc(0, 0, np.nan, 0, 9), arc(0, 0, 1e300, 0, 9)],
    )
    odd.corners["covariance"][2] = np.diag([1e-4, 1e-24])  # no wider than a line
    write(target, (odd, scan_at(0, 0, 0)))
    drawn = shapes(target)
    assert [len(drawn[name]) for name in ("walls", "corners", "arcs")] == [1, 2, 1]
    assert all(np.isfinite(row).all() for rows in drawn.values() for row in rows)
    ratios = re.findall(r"AcDbEllipse[^A]*?\n 40\n(\S+)", target.read_text())  # as it is written
    assert [float(ratio) for ratio in ratios] == [1e-6, 1] * (target.suffix == ".dxf")


# Marks, as the plain ways of numpy have them.


@given(st.integers(0, 10_000))
def test_ellipses_are_those_of_the_eigenvectors(seed):
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(6, 2, 2)) * 10.0 ** rng.uniform(-6, 1, (6, 1, 1))
    covariances = roots @ roots.swapaxes(1, 2)
    _, _, *axes, direction = ellipses_of(np.zeros((6, 2)), covariances, 0.5).T
    # They are R diag(a², b²) Rᵀ.
    turns = np.array([turned(-angle) for angle in direction])
    scaled = turns * np.square(axes).T[:, None] / (-2 * math.log(0.5))
    sizes = np.trace(covariances, axis1=1, axis2=2)[:, None, None]
    np.testing.assert_allclose(
        scaled @ turns.swapaxes(1, 2) / sizes, covariances / sizes, atol=1e-12
    )
    assert (axes[0] >= axes[1]).all()
    assert ((direction >= 0) & (direction <= math.pi)).all()


def test_ellipses_of_covariances_that_are_none():
    nowhere, impossible = np.full((2, 2), np.nan), np.diag([1.0, -1.0])
    given = np.stack([np.diag([4.0, 0.0]), np.eye(2), nowhere, impossible])
    size = math.sqrt(-2 * math.log(0.5))
    expected = [[2 * size, 0], [size, size], [size, 0]]
    np.testing.assert_allclose(ellipses_of(np.zeros((4, 2)), given, 0.5)[:, 2:4], expected)
    assert ellipses_of(np.zeros((0, 2)), np.zeros((0, 2, 2))).shape == (0, 5)


@given(st.integers(0, 10_000), st.integers(0, 99), st.integers(0, 99))
def test_span_of_an_arc_is_that_of_its_unwrapped_directions(seed, first, last):
    rng = np.random.default_rng(seed)
    ranges = np.where(rng.random(100) < 0.1, np.nan, rng.uniform(1, 3, 100))
    scan = LaserScan(ranges, 0.0, 2 * math.pi / 100)
    record = features(100, arcs=[arc(*rng.uniform(-2, 2, 2), 1, first, last)]).arcs[0]
    beams = np.arange(first, last + 1 if first <= last else last + 101) % 100
    points = scan.points[beams[scan.valid[beams]]] - record["center"]
    expected = 0.0, 2 * math.pi
    if len(points):
        directions = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
        expected = directions.min(), directions.max()
    np.testing.assert_allclose(arc_span(record, scan), expected, atol=1e-12)


def test_edges_are_marks_of_their_own():
    corners = [corner(0, 1), corner(2, 1, kind="slit")]
    found = features(corners=corners, edges=[edge(1, 1), edge(math.nan, 1)])
    markers = markers_of(found)
    assert markers.points.tolist() == [[0, 1], [2, 1], [1, 1]]
    assert markers.ellipses[:, 0].tolist() == [0, 2, 1]
    layers = {layer.name: layer for layer in layers_of(markers)}
    corners, edges = layers["corners"], layers["edges"]
    assert (corners.points.tolist(), edges.points.tolist()) == ([[0, 1], [2, 1]], [[1, 1]])
    assert min(edges.color) > min(corners.color)  # lighter
    assert [layer.size for layer in layers.values()] == [0.03, 0.03, 0.08, 0.05, 0.01]
    assert layers["segments"].color == (0.16, 0.47, 0.84, 1.0)


def test_pieces_of_strips_are_the_same_in_one_array():
    strips = np.arange(12.0).reshape(2, 3, 2)
    expected = [[0, 1], [2, 3], [2, 3], [4, 5], [6, 7], [8, 9], [8, 9], [10, 11]]
    for given_strips, pairs in (
        (strips, expected),
        (list(strips), expected),
        (strips[:0], []),
        ([], []),
    ):
        found = Layer("a", (0, 0, 0, 1), 0.1, given_strips).pairs
        np.testing.assert_array_equal(found, np.reshape(pairs, (-1, 2)))
