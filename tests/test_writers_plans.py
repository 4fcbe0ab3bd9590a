"""Plans: SVG and DXF that read back the same, of one scan and of a log."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from itertools import islice

import ezdxf
import numpy as np
import pytest
from handmade import arc, corner, features
from test_writers_floor_plan import line, turned

from lineament import Extractor, LaserScan, LineamentError, open_log
from lineament.output import open_writer
from lineament.output.canvas import CORNER_COLOR, EDGE_COLOR
from lineament.output.dxf import DxfWriter
from lineament.output.markers import markers_of
from lineament.output.svg import SvgWriter

SVG = "{http://www.w3.org/2000/svg}"


def write(path, *written):
    with open_writer(path) as writer:
        for found, scan in written:
            writer.write(found, scan)


def scan_at(x, y, theta, *, ranges=(2.0,) * 100):
    return LaserScan(ranges, angle_min=-1.0, angle_increment=0.02, pose=(x, y, theta))


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
    assert len(groups["ellipses"]) == 3
    # A metre is as long on paper as the scale says.
    transform = next(e.get("transform") for e in root.iter(f"{SVG}g"))
    per_metre = float(transform.removeprefix("matrix(").split()[0])
    text = "".join(root.itertext())
    assert f"1 : {1000 / per_metre:.0f}" in text
    assert root.get("width").endswith("mm")
    assert "2 walls, 1 corner and 1 edge (lighter) of 1 scan" in text


def test_dxf_of_one_scan_is_whole_and_clean(tmp_path):
    scan = scan_at(5, 5, 1)
    write(tmp_path / "a.dxf", (ONE, scan))
    drawing = ezdxf.readfile(tmp_path / "a.dxf")
    audit = drawing.audit()
    assert not audit.errors
    assert not audit.fixes
    assert drawing.header["$INSUNITS"] == 6  # metres
    layers = {layer.dxf.name for layer in drawing.layers}
    assert {"WALLS", "CORNERS", "EDGES", "ARCS", "ELLIPSES"} <= layers
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


def test_few_scans_are_drawn_as_they_are_and_many_by_their_views(tmp_path):
    seen = features(100, segments=[line((2, 0), (2, 3))])
    once = features(100, segments=[line((2, 0), (2, 3)), line((7, 0), (7, 3))])
    for n, walls in ((9, 2), (10, 1)):
        log = [(once if k == 4 else seen, scan_at(0, 0, 0)) for k in range(n)]
        write(tmp_path / "a.svg", *log)
        root, groups = groups_of(tmp_path / "a.svg")
        assert len(groups["walls"]) == walls
        assert ("each seen 3 times at least" in "".join(root.itertext())) == (n == 10)


@pytest.mark.parametrize("ending", [".svg", ".dxf"])
@pytest.mark.parametrize("without", [0, 2])
def test_several_scans_need_poses(tmp_path, ending, without):
    bare = LaserScan([2.0] * 100, angle_min=-1.0, angle_increment=0.02)
    scans = [bare if k == without else scan_at(0, 0, 0) for k in range(3)]
    with pytest.raises(LineamentError, match=f"scan {without} has no pose, expected pose") as told:
        write(tmp_path / f"a{ending}", *((ONE, scan) for scan in scans))
    assert "\n" not in str(told.value)
    assert not list(tmp_path.iterdir())
    write(tmp_path / f"a{ending}", (ONE, bare))  # one needs none


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
