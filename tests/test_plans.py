"""Plans: walls that are one, worked by hand; and what SVG and DXF draw of a scan and of a log."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from itertools import islice, pairwise

import ezdxf
import numpy as np
import pytest
from handmade import arc, corner, features, segment
from hypothesis import given, settings
from hypothesis import strategies as st

from lineament import Extractor, LaserScan, LineamentError, open_log
from lineament.output import open_writer
from lineament.output.canvas import CORNER_COLOR, EDGE_COLOR
from lineament.output.dxf import DxfWriter
from lineament.output.floor_plan import Averages, FloorPlan
from lineament.output.markers import Markers, ellipses_of, markers_of
from lineament.output.svg import SvgWriter

SVG = "{http://www.w3.org/2000/svg}"


def line(start, end, sigma=(0.002, 0.002)):
    return segment(start, end, 0, 9, sigma=sigma)


def plan_of(*scans):
    plan = FloorPlan()
    for segments in scans:
        plan.add(features(segments=segments))
    return plan


def walls_of(*scans, min_views=1):
    walls = plan_of(*scans).walls(min_views)
    return [(*w["start"].round(3).tolist(), *w["end"].round(3).tolist(), w["views"]) for w in walls]


def turned(angle):
    return np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])


def test_overlapping_views_are_one_wall_with_its_views():
    scans = [[line((0, 1), (2, 1))], [line((1, 1), (3, 1))], [line((3.1, 1), (4, 1))]]
    # 1 m once, 1 m twice, 1 m once; the third is not seen to touch, but is near: one line.
    first, second = walls_of(*scans)
    assert first == (0, 1, 3, 1, pytest.approx(4 / 3))
    assert second == (3.1, 1, 4, 1, 1)
    assert len(plan_of(*scans)._walls) == 1
    assert walls_of(*scans, min_views=2) == [(1, 1, 2, 1, 2)]
    assert walls_of(*scans, min_views=3) == []


def test_doorway_stays_open_though_the_door_was_shut_once():
    open_door = [line((0, 0), (2, 0)), line((3, 0), (5, 0))]
    shut = [line((0, 0), (5, 0))]
    walls = walls_of(open_door, open_door, shut, open_door, min_views=2)
    assert walls == [(0, 0, 2, 0, 4), (3, 0, 5, 0, 4)]


def test_both_faces_of_a_partition_stay_apart():
    walls = walls_of([line((0, 0), (4, 0))], [line((4, 0.04), (0, 0.04))])
    assert walls == [(0, 0, 4, 0, 1), (4, 0.04, 0, 0.04, 1)]


@pytest.mark.parametrize(
    ("other", "count"),
    [
        (((0, 0.04), (4, 0.04)), 1),  # on the line
        (((1, 0.04), (2, 0.04)), 1),
        (((4.15, 0), (6, 0)), 1),  # touches
        (((4.25, 0), (6, 0)), 2),
        (((0, 0.0), (4, 0.2)), 2),  # turned by 2.9 degrees
        (((0, 0.09), (4, 0.09)), 1),  # a copy that the poses have moved
        (((4.1, 0.1), (8, 0.1)), 2),  # beside it stands nothing: another wall
        (((0, 0.2), (4, 0.2)), 2),
        (((3.9, 0.01), (9, -0.6)), 2),  # ends on it, turned by 6.8 degrees
    ],
)
def test_what_is_one_wall(other, count):
    plan = plan_of([line((0, 0), (4, 0))], [line(*other)])
    plan.walls()
    assert len(plan._walls) == count


def test_uncertain_direction_joins_a_wall_that_is_turned():
    # By 2.9 degrees; three deviations of its angle are 3.4.
    short = segment((1, 0.0), (2, 0.05), 0, 9, sigma=(0.002, 0.02))
    assert len(plan_of([line((0, 0), (4, 0))], [short])._walls) == 1


def test_copies_are_one_wall_only_if_all_that_was_seen_lies_on_one_line():
    # 12 cm apart: 6 cm about the middle line, more than the 5 that one wall may spread.
    assert len(walls_of([line((0, 0), (4, 0))], [line((0, 0.12), (4, 0.12))])) == 2
    # Of one seen ten times and one seen once, the line lies near the first.
    often = [[line((0, 0), (4, 0))]] * 10
    (wall,) = walls_of(*often, [line((0, 0.12), (4, 0.12))])
    assert wall == (0, pytest.approx(0.011, abs=1e-3), 4, pytest.approx(0.011, abs=1e-3), 11)


def test_line_goes_through_all_metres_seen():
    # Two views of 3 m at y = 0 and one of 3 m at y = 0.03: the mean is 0.01.
    wall = [line((0, 0), (3, 0))]
    assert walls_of(wall, wall, [line((0, 0.03), (3, 0.03))]) == [(0, 0.01, 3, 0.01, 3)]


def test_uncertain_short_or_impossible_segments_are_left_out():
    bad = [
        line((0, 0), (4, 0), sigma=(0.06, 0.001)),
        line((0, 1), (4, 1), sigma=(0.001, 0.03)),  # 6 cm at its ends
        line((0, 2), (0.1, 2)),
        line((0, 3), (2000, 3)),
        line((0, 4), (np.nan, 4)),
        line((1e300, 5), (1e300, 8)),
    ]
    assert walls_of(bad) == []
    assert walls_of([*bad, line((0, 6), (4, 6))]) == [(0, 6, 4, 6, 1)]


def test_plan_far_from_its_origin_is_as_good():
    x, y = 448_000.0, 5_412_000.0  # UTM
    scans = [[line((x, y), (x + 3, y + 0.01))], [line((x + 2, y), (x + 4, y))]]
    (wall,) = plan_of(*scans).walls()
    assert wall["start"] == pytest.approx((x, y), abs=0.02)
    assert wall["end"] == pytest.approx((x + 4, y), abs=0.02)


@settings(max_examples=10)
@given(st.integers(0, 10_000))
def test_many_noisy_views_give_the_room(seed):
    rng = np.random.default_rng(seed)
    room = np.array([(0, 0), (5, 0), (5, 4), (0, 4), (0, 0)]) @ turned(rng.uniform(0, 6))
    plan = FloorPlan()
    for _ in range(30):
        seen = []
        for a, b in pairwise(room):
            normal = np.array([a[1] - b[1], b[0] - a[0]]) / math.dist(a, b)
            along, across = np.sort(rng.uniform(0, 1, 2)), rng.normal(0, 0.008, 2)
            ends = a + along[:, None] * (b - a) + across[:, None] * normal
            seen.append(line(*ends))
        plan.add(features(segments=seen))
    plan.walls()
    main = sorted(plan._walls, key=lambda wall: -wall.length)[:4]
    for a, b in pairwise(room):
        normal = np.array([a[1] - b[1], b[0] - a[0]]) / math.dist(a, b)
        assert min(np.abs((wall.ends() - a) @ normal).max() for wall in main) < 0.03
    assert sum(wall.length for wall in main) > 0.9 * sum(wall.length for wall in plan._walls)


def test_plans_are_bounded(monkeypatch):
    monkeypatch.setattr("lineament.output.floor_plan.MOST", 40)
    plan = FloorPlan()
    for y in range(1, 300):
        walls = [line((0, 0), (5, 0)), line((0, y), (1, y))]
        plan.add(features(segments=walls, corners=[corner(0, y), corner(0, 0)]))
        assert len(plan._walls) == len(plan._ends) <= 41
        assert len(plan._corners.seen(1)) <= 41
    assert plan.walls()[0]["views"] == 299  # those seen least are forgotten
    np.testing.assert_allclose(plan._corners.seen(299), [(0, 0)])


def test_edges_stay_apart_from_corners():
    plan = FloorPlan()
    for shift in (0.0, 0.02):
        plan.add(features(corners=[corner(shift, 1), corner(0.05, 1 + shift, kind="edge")]))
    markers, _ = plan.markers(min_views=2)
    np.testing.assert_allclose(markers.corners, [(0.01, 1)])
    np.testing.assert_allclose(markers.edges, [(0.05, 1.01)])


def test_averages_join_what_is_near():
    means = Averages(2, 0.1)
    means.add(np.array([(0, 0), (1, 0), (np.nan, 0), (1e300, 0)]))
    means.add(np.array([(0.06, 0), (1.2, 0)]))
    np.testing.assert_allclose(means.seen(1), [(0.03, 0), (1, 0), (1.2, 0)])
    np.testing.assert_allclose(means.seen(2), [(0.03, 0)])


def test_arcs_are_where_their_points_were():
    angles = np.linspace(-0.2, 0.2, 9)
    scan = LaserScan(np.full(9, 2.0), angle_min=-0.2, angle_increment=0.05)
    # A circle about (1, 0) through (2, 0): the points lie at its right.
    markers = markers_of(features(9, arcs=[arc(1, 0, 1, 0, 8)]), scan)
    first = math.atan2(2 * math.sin(angles[0]), 2 * math.cos(angles[0]) - 1)
    np.testing.assert_allclose(markers.arcs, [[1, 0, 1, first, -first]])
    whole = markers_of(features(9, arcs=[arc(1, 0, 1, 0, 8)]))
    assert whole.arcs[0, 4] - whole.arcs[0, 3] == 2 * math.pi
    assert len(whole.arc_strips()[0]) == 49


@given(st.floats(0.01, 1), st.floats(0.01, 1), st.floats(-3, 3))
def test_ellipses_hold_95_percent(a, b, turn):
    rotation = turned(turn)
    covariance = rotation @ np.diag([a**2, b**2]) @ rotation.T
    ellipses = ellipses_of(np.array([[1.0, 2.0]]), covariance[None])
    none = np.zeros((0, 2))
    markers = Markers(none.reshape(0, 2, 2), none, none, np.zeros((0, 5)), ellipses)
    offset = markers.ellipse_strips()[0] - (1.0, 2.0)
    squared = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(covariance), offset)
    np.testing.assert_allclose(squared, -2 * math.log(0.05), rtol=1e-6)


# Files.


def write(path, *written):
    with open_writer(path) as writer:
        for found, scan in written:
            writer.write(found, scan)


def scan_at(*pose, ranges=(2.0,) * 100):
    return LaserScan(ranges, angle_min=-1.0, angle_increment=0.02, pose=pose or None)


ONE = features(
    100,
    segments=[line((1, -0.5), (1, 2.25)), line((1, 2.25), (-0.123456, 2.25))],
    corners=[corner(1, 2.25), corner(-0.125, 2.25, kind="edge")],
    arcs=[arc(1.0, 0.0, 1.0, 0, 99)],
)


def groups_of(path):
    root = ET.parse(path).getroot()
    return root, {group.get("id"): list(group) for group in root.iter(f"{SVG}g") if group.get("id")}


def numbers(element, *names):
    return [float(element.get(name)) for name in names]


def test_svg_of_one_scan_in_its_own_frame(tmp_path):
    scan = scan_at(5, 5, 1)
    write(tmp_path / "a.svg", (ONE, scan))
    root, groups = groups_of(tmp_path / "a.svg")
    assert list(groups) == ["walls", "arcs", "ellipses", "edges", "corners"]
    lines = [numbers(e, "x1", "y1", "x2", "y2") for e in groups["walls"]]
    assert lines == [[1, -0.5, 1, 2.25], [1, 2.25, -0.123456, 2.25]]
    (dot,), (edge,) = groups["corners"], groups["edges"]
    assert numbers(dot, "cx", "cy") == [1, 2.25]
    assert numbers(edge, "cx", "cy") == [-0.125, 2.25]
    fills = {e.get("id"): e.get("fill") for e in root.iter(f"{SVG}g")}
    assert (fills["corners"], fills["edges"]) == (CORNER_COLOR, EDGE_COLOR)
    (arc_path,) = groups["arcs"]
    words = arc_path.get("d").split()
    first, last = markers_of(ONE, scan).arcs[0, 3:]
    ends = [float(words[k]) for k in (1, 2, 9, 10)]
    expected = [1 + math.cos(first), math.sin(first), 1 + math.cos(last), math.sin(last)]
    assert ends == pytest.approx(expected, abs=1e-6)
    assert words[4:9] == ["1", "1", "0", str(int(last - first > math.pi)), "1"]
    ellipse = groups["ellipses"][0]
    size = 0.01 * math.sqrt(-2 * math.log(0.05))
    assert numbers(ellipse, "rx", "ry") == pytest.approx([size, size], abs=1e-6)
    assert ellipse.get("transform").startswith("translate(1 2.25) rotate(")
    assert len(groups["ellipses"]) == 3
    assert "2 walls, 1 corner and 1 edge (lighter) of 1 scan" in "".join(root.itertext())


@pytest.mark.parametrize(
    ("width", "height", "scale", "bar"),
    [
        (7.9, 0.5, 20, 1),  # wide: 395 mm of 400
        (0.5, 5.1, 20, 0.1),  # tall: 255 mm of 260
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
    root, _ = groups_of(tmp_path / "a.svg")
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


def test_dxf_of_one_scan_is_whole_and_clean(tmp_path):
    scan = scan_at(5, 5, 1)
    write(tmp_path / "a.dxf", (ONE, scan))
    drawing = ezdxf.readfile(tmp_path / "a.dxf")
    audit = drawing.audit()
    assert not audit.errors
    assert not audit.fixes
    assert drawing.header["$INSUNITS"] == 6  # metres
    colors = {layer.dxf.name: layer.dxf.color for layer in drawing.layers}
    assert {"WALLS", "CORNERS", "EDGES", "ARCS", "ELLIPSES"} <= set(colors)
    assert colors["CORNERS"] != colors["EDGES"]
    space = drawing.modelspace()
    lines = [(tuple(e.dxf.start)[:2], tuple(e.dxf.end)[:2]) for e in space.query("LINE")]
    assert lines == [((1, -0.5), (1, 2.25)), ((1, 2.25), (-0.123456, 2.25))]
    assert all(e.dxf.layer == "WALLS" for e in space.query("LINE"))
    for layer, place in (("CORNERS", (1, 2.25)), ("EDGES", (-0.125, 2.25))):
        (point,) = space.query(f"POINT[layer=='{layer}']")
        assert tuple(point.dxf.location)[:2] == place
    (found,) = space.query("ARC[layer=='ARCS']")
    _, _, _, first, last = markers_of(ONE, scan).arcs[0]
    assert found.dxf.radius == 1
    assert math.radians(found.dxf.start_angle) == pytest.approx(first % (2 * math.pi))
    assert math.radians(found.dxf.end_angle) == pytest.approx(last % (2 * math.pi))
    ellipses = space.query("ELLIPSE[layer=='ELLIPSES']")
    assert [e.dxf.ratio for e in ellipses] == pytest.approx([1, 1, 1])


def test_dxf_has_ellipses_with_their_axes(tmp_path):
    found = corner(3, 4)
    found["covariance"] = turned(-0.5) @ np.diag([0.04, 0.01]) @ turned(0.5)
    write(tmp_path / "a.dxf", (features(100, corners=[found]), scan_at()))
    (ellipse,) = ezdxf.readfile(tmp_path / "a.dxf").modelspace().query("ELLIPSE")
    size = 0.2 * math.sqrt(-2 * math.log(0.05))
    axis = np.array(ellipse.dxf.major_axis.vec2)
    assert axis == pytest.approx(size * np.array([math.cos(0.5), math.sin(0.5)]))
    assert ellipse.dxf.ratio == pytest.approx(0.5)
    assert tuple(ellipse.dxf.center.vec2) == (3, 4)


@pytest.mark.parametrize("writer", [SvgWriter, DxfWriter])
def test_log_is_drawn_by_its_poses(tmp_path, writer):
    # One wall, seen from three places: in the frame of the plan it is (2, 0) to (2, 3).
    target = tmp_path / f"a{'.svg' if writer is SvgWriter else '.dxf'}"
    poses = [(0, 0, 0), (1, 1, math.pi / 2), (-1, 2, -0.3)]
    with writer(target, min_views=2) as out:
        for k, pose in enumerate(poses):
            extra = [line((0, 9 + k), (1, 9 + k))]  # seen once each
            world = features(100, segments=[line((2, 0), (2, 3)), *extra])
            world.arcs = np.array([arc(4, 4, 0.2, 0, 9)])
            x, y, theta = pose
            back = world.transform(0, 0, -theta).transform(*(-turned(theta) @ (x, y)).tolist(), 0)
            out.write(back, scan_at(*pose))
    if writer is SvgWriter:
        _, groups = groups_of(target)
        (wall,) = groups["walls"]
        found, views = numbers(wall, "x1", "y1", "x2", "y2"), int(wall.get("data-views"))
        circle = numbers(groups["arcs"][0], "cx", "cy", "r")
    else:
        space = ezdxf.readfile(target).modelspace()
        (wall,) = space.query("LINE")
        found = [*wall.dxf.start.vec2, *wall.dxf.end.vec2]
        views = wall.get_xdata("LINEAMENT")[1].value
        (round_one,) = space.query("CIRCLE")
        circle = [*round_one.dxf.center.vec2, round_one.dxf.radius]
    assert found == pytest.approx([2, 0, 2, 3], abs=0.026)  # a cell, along the wall
    assert found[::2] == pytest.approx([2, 2], abs=1e-6)
    assert views == 3
    assert circle == pytest.approx([4, 4, 0.2])


@pytest.mark.parametrize(("n", "walls"), [(9, 2), (10, 1)])
def test_few_scans_are_drawn_as_they_are_and_many_by_their_views(tmp_path, n, walls):
    seen = features(100, segments=[line((2, 0), (2, 3))])
    once = features(100, segments=[line((2, 0), (2, 3)), line((7, 0), (7, 3))])
    log = [(once if k == 4 else seen, scan_at(0, 0, 0)) for k in range(n)]
    write(tmp_path / "a.svg", *log)
    root, groups = groups_of(tmp_path / "a.svg")
    assert len(groups["walls"]) == walls
    often = ", each seen 3 times at least" if n == 10 else ""
    caption = f"{walls} wall{'s' * (walls > 1)} and 0 corners of {n} scans{often}"
    assert root.find(f"{SVG}title").text == caption


@pytest.mark.parametrize("ending", [".svg", ".dxf"])
@pytest.mark.parametrize("without", [0, 2])
def test_several_scans_need_poses(tmp_path, ending, without):
    scans = [scan_at(*(() if k == without else (0, 0, 0))) for k in range(3)]
    with pytest.raises(LineamentError, match=f"scan {without} has no pose, expected pose") as error:
        write(tmp_path / f"a{ending}", *((ONE, scan) for scan in scans))
    assert "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())
    write(tmp_path / f"a{ending}", (ONE, scan_at()))  # one needs none


@pytest.mark.parametrize("ending", [".svg", ".dxf"])
def test_odd_features_are_drawn_or_left_out(tmp_path, ending):
    odd = features(
        100,
        segments=[line((0, 0), (0, 0)), line((np.nan, 0), (1, 0)), line((1e300, 0), (1, 0))],
        corners=[corner(1, 1, sigma=0.0), corner(np.inf, 0), corner(2, 2, sigma=1e-9)],
        arcs=[arc(0, 0, 0.1, 0, 99), arc(0, 0, np.nan, 0, 9), arc(0, 0, 1e300, 0, 9)],
    )
    target = tmp_path / f"a{ending}"
    write(target, (odd, scan_at(0, 0, 0)))
    if ending == ".svg":
        assert "nan" not in target.read_text()
        assert "inf" not in target.read_text()
        assert len(groups_of(target)[1]["corners"]) == 2
    else:
        assert not ezdxf.readfile(target).audit().errors


@pytest.mark.slow
def test_floor_plan_of_a_recording(tmp_path, data_dir):
    log = open_log(data_dir / "carmen" / "intel-corrected.log.gz")
    extractor = Extractor("optimal")
    write(tmp_path / "a.dxf", *((extractor(scan), scan) for scan in islice(log, 300)))
    drawing = ezdxf.readfile(tmp_path / "a.dxf")
    assert not drawing.audit().errors
    lengths = [math.dist(e.dxf.start, e.dxf.end) for e in drawing.modelspace().query("LINE")]
    assert 100 < len(lengths) < 500  # of some 3000 segments
    assert max(lengths) > 5
