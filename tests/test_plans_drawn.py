"""What plans are drawn of: segments that are sure, corners and arcs that are one, strips, views."""

import math
import xml.etree.ElementTree as ET

import ezdxf
import numpy as np
import pytest
from approved import assert_approved, numbers_of
from handmade import arc, corner, edge, features
from test_plans import SVG, line, turned

from lineament import LaserScan
from lineament.output import open_writer
from lineament.output.floor_plan import FloorPlan
from lineament.output.markers import Markers


def test_corners_of_one_thing_are_within_15_cm():
    for off, count in ((0.14, 1), (0.16, 2)):
        plan = FloorPlan()
        for y in (0.0, off):
            plan.add(features(corners=[corner(1, y)]))
        assert len(plan.markers(1)[0].corners) == count


@pytest.mark.parametrize(
    ("other", "is_one"),
    [((0, 0, 0.59), True), ((0, 0, 0.61), False), ((0.09, 0, 0.5), True), ((0, 0.11, 0.5), False)],
)
def test_arcs_of_one_thing_are_within_10_cm(other, is_one):
    plan = FloorPlan()
    for x, y, radius in ((0, 0, 0.5), other):
        plan.add(features(arcs=[arc(x, y, radius, 0, 9)]))
    arcs = plan.markers(1)[0].arcs
    assert len(arcs) == 2 - is_one
    np.testing.assert_array_equal(arcs[:, 3:], [(0.0, 2 * math.pi)] * len(arcs))  # whole circles


@pytest.mark.parametrize(
    ("segment", "is_kept"),
    [
        (line((0, 0), (0.21, 0)), True),
        (line((0, 0), (0.19, 0)), False),
        (line((0, 0), (999, 0), sigma=(0.002, 1e-5)), True),
        (line((0, 0), (1001, 0), sigma=(0.002, 1e-5)), False),
        # At its ends a wall is known to 5 cm: its offset, and half of its length by its angle.
        (line((0, 0), (4, 0), sigma=(0.03, 0.0195)), True),
        (line((0, 0), (4, 0), sigma=(0.03, 0.0205)), False),
        (line((0, 0), (4, 0), sigma=(0.04, 0.0145)), True),
        (line((0, 0), (4, 0), sigma=(0.04, 0.0155)), False),
        (line((0, 0), (1, 0), sigma=(0.03, 0.079)), True),
        (line((0, 0), (1, 0), sigma=(0.03, 0.081)), False),
        (line((0, 0), (9, 0), sigma=(0.03, 0.0088)), True),
        (line((0, 0), (9, 0), sigma=(0.03, 0.009)), False),
    ],
)
def test_segments_that_a_plan_takes(segment, is_kept):
    plan = FloorPlan()
    plan.add(features(segments=[segment]))
    assert len(plan.walls()) == is_kept


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("covariance", [[1e-6, 2e-6], [2e-6, 1e-6]]),  # a correlation of 2
        ("covariance", [[-1e-6, 0], [0, 1e-6]]),
        ("covariance", [[math.nan, 0], [0, 1e-6]]),
        *((name, math.nan) for name in ("angle", "misfit", "rms", "centroid")),
    ],
)
def test_impossible_segments_make_no_wall(name, value):
    good, bad = line((0, 0), (4, 0)), line((0, 1), (4, 1))
    bad[name] = value
    plan = FloorPlan()
    plan.add(features(segments=[good, bad]))
    (wall,) = plan.walls()
    assert wall["end"].tolist() == [4, 0]


@pytest.mark.parametrize("count", [2, 3, 5])
def test_each_scan_is_drawn_once(tmp_path, count):
    """A wall that all scans show, one that the first shows, one that the last shows."""
    shared, first, last = line((0, 0), (4, 0)), line((0, 2), (4, 2)), line((0, 4), (4, 4))
    scan = LaserScan([1.0] * 100, 0.0, 0.01, pose=(1.0, 0.0, 0.0))
    with open_writer(tmp_path / "a.svg") as writer:
        for k in range(count):
            own = [first] * (k == 0) + [last] * (k == count - 1)
            writer.write(features(segments=[shared, *own]), scan)
    lines = [of.attrib for of in ET.parse(tmp_path / "a.svg").iter(f"{SVG}line")]
    views = {float(of["y1"]): int(of["data-views"]) for of in lines}
    assert views == {0.0: count, 2.0: 1, 4.0: 1}
    assert {float(of["x1"]) for of in lines} == {1.0}


def test_arcs_and_ellipses_become_strips():
    """A quarter of a circle of 2 m, from below to the right, and an ellipse that is turned."""
    nothing = np.zeros((0, 2))
    arcs = np.array([(1, 2, 2.0, -math.pi / 2, 0.0)])
    ellipses = np.array([(1, 2, 0.4, 0.1, math.pi / 6)])
    markers = Markers(np.zeros((0, 2, 2)), nothing, nothing, arcs, ellipses)
    (strip,) = markers.arc_strips()
    angles = np.linspace(-math.pi / 2, 0, 13)  # 48 to a turn
    np.testing.assert_allclose(strip, (1, 2) + 2 * np.stack((np.cos(angles), np.sin(angles)), 1))
    (strip,) = markers.ellipse_strips()
    along, across = ((strip - (1, 2)) @ turned(math.pi / 6).T).T
    np.testing.assert_allclose((along / 0.4) ** 2 + (across / 0.1) ** 2, 1)
    np.testing.assert_allclose(strip[0], strip[-1])
    assert len(strip) == 49
    assert np.ptp(along) == pytest.approx(0.8)
    np.testing.assert_allclose(markers.points, [(3, 2), (-1, 2), (1, 4), (1, 0)])


@pytest.mark.parametrize(
    ("first", "last", "is_whole"),
    [
        *((first, first + 2 * math.pi, True) for first in (0.0, -math.pi, -6.0, 4.0)),
        *((first, first + 2 * math.pi - 1e-3, False) for first in (0.0, -math.pi, -6.0, 4.0)),
        (3.0, 4.0, False),
    ],
)
def test_an_arc_of_a_whole_turn_is_a_circle(first, last, is_whole):
    nothing, row = np.zeros((0, 2)), [1.0, 2.0, 0.5, first, last]
    ellipses = np.zeros((0, 5))
    markers = Markers(np.zeros((0, 2, 2)), nothing, nothing, np.array([row]), ellipses)
    assert markers.arc_rows() == [(row, is_whole)]


@pytest.mark.parametrize("ending", [".svg", ".dxf"])
@pytest.mark.parametrize("n", [1, 12])
def test_plans_show_what_was_approved(tmp_path, ending, n):
    """A room with a column and a noisy wall, as one scan shows it, and twelve that drift."""
    rng, path = np.random.default_rng(3), tmp_path / f"a{ending}"
    with open_writer(path) as writer:
        for k in range(n):
            noise = rng.normal(0, 0.004, (4, 2))
            walls = [((0, 0), (4, 0.3)), ((4, 0.3), (3.7, 3)), ((1, 3), (0.9, 2)), ((2, 2), (2, 3))]
            found = features(
                segments=[
                    line(start + off, end - off, sigma=(0.01, 0.003 * (1 + i)))
                    for i, (start, end), off in zip(range(4 - k % 3), walls, noise, strict=False)
                ],
                corners=[corner(4, 0.3, sigma=0.02), corner(3.7, 3 + 0.02 * (k % 2))],
                edges=[edge(0, 0), edge(2, 2)],
                arcs=[arc(1.5, 1, 0.25, 20, 60 + k), arc(3, 1.5, 0.1, 0, 200)],
            )
            found.corners["covariance"][0, 0, 1] = found.corners["covariance"][0, 1, 0] = 2e-4
            scan = LaserScan([1.3] * 100, 0.0, 0.01, pose=(0.01 * k, 0.0, 0.001 * k))
            writer.write(found, scan)
    if ending == ".dxf":
        unlike = {"handle", "owner"}  # numbers that ezdxf gives
        space = ezdxf.readfile(path).modelspace()
        lines = [
            f"{e.dxftype()} { ({k: v for k, v in e.dxfattribs().items() if k not in unlike}) }"
            for e in space
        ]
    else:
        lines = path.read_text(encoding="utf-8").splitlines()
    assert_approved(f"plans/{n}{ending}", lines)


def test_views_of_a_wall_are_added_up_as_was_approved():
    """Noisy views of three walls, two of which the poses have moved: all that a plan holds."""
    rng, plan = np.random.default_rng(5), FloorPlan()
    for k in range(40):
        y = 0.1 * (k % 2) * (k < 30)
        ends = np.sort(rng.uniform(0, 6, 2)), rng.uniform(0, 3, 2)
        segments = [line((ends[0][0], y), (ends[0][1], y + rng.normal(0, 0.01)))]
        segments += [line((6.1, ends[1][0]), (6.1 + rng.normal(0, 0.01), ends[1][1]))]
        plan.add(features(segments=segments))
    walls = [plan.walls(least) for least in (1, 2, 9)]
    rows = [
        [*w["start"].tolist(), *w["end"].tolist(), float(w["views"])] for of in walls for w in of
    ]
    assert_approved("plans/walls", numbers_of(rows))
