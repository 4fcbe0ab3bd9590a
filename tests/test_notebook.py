"""Python as one would guess it: what is passed, indexed, drawn and shown without reading first."""

import inspect
import math
import re
import sys
import xml.etree.ElementTree as ET
from dataclasses import fields, replace

import matplotlib as mpl
import numpy as np
import pytest
from approved import assert_approved, figure_lines
from handmade import arc, breakpoint_at, corner, edge, features, segment
from lineament_lab.methods import IEPF
from matplotlib import pyplot
from worlds import BOX, full_circle, room

import lineament as ln
from lineament.cli import run
from lineament.features import TABLES, noise_row
from lineament.methods import METHODS, method_names, stages
from lineament.simulation import Sensor
from lineament.view import notebook

mpl.use("agg")
RING = full_circle(360)
FRAME = {"angle_min": float(RING[0]), "angle_increment": 2 * math.pi / 360}


@pytest.fixture
def scan():
    ranges = np.array(room(RING, BOX)) + 0.002 * np.random.default_rng(3).normal(size=360)
    ranges[100:103] = np.nan
    return ln.LaserScan(ranges, **FRAME, range_max=5.0, stamp=2.5, frame_id="laser")


@pytest.fixture
def log(tmp_path, scan):
    path = tmp_path / "drive.npz"
    scans = [scan, *(scan.with_pose((k, 0.0, 0.0)) for k in range(1, 5))]
    ln.logs.save_npz(path, scans)
    return ln.open_log(path)


@pytest.fixture(autouse=True)
def _no_open_figures():
    yield
    pyplot.close("all")


# What is passed


@pytest.mark.parametrize("call", [ln.extract, lambda *a, **b: ln.trace(*a, **b).features])
def test_ranges_are_taken_as_a_scan(scan, call):
    limits = {"range_min": 0.5, "range_max": 2.2}
    expected = ln.extract(ln.LaserScan(scan.ranges, **FRAME, **limits), method="liu")
    found = call(scan.ranges.tolist(), **FRAME, **limits, method="liu")
    for name in TABLES:
        assert found[name].tobytes() == expected[name].tobytes()
    assert found.scan.range_max == 2.2
    found = call(scan.ranges, angles=scan.angles, **limits, method="liu")
    assert found.segments.tobytes() == expected.segments.tobytes()
    assert len(found.segments) != len(ln.extract(scan, method="liu").segments)


def test_methods_are_given_by_name_object_or_class(scan):
    by_name = ln.extract(scan, method="iepf", min_piece=9)
    for made in (IEPF(min_piece=9), ln.methods.get_method("iepf", min_piece=9)):
        assert ln.extract(scan, method=made).segments.tobytes() == by_name.segments.tobytes()
    extractor = ln.Extractor(IEPF, noise=0.01, min_piece=9)
    assert extractor.method == IEPF(min_piece=9)
    assert repr(extractor) == f"Extractor({extractor.method!r}, noise={ln.RangeNoise(0.01)!r})"
    assert set(METHODS.values()) < set(dir(ln.methods))
    for name, cls in METHODS.items():
        method = getattr(ln.methods, cls)
        assert method.name == name
        given = inspect.signature(method).parameters
        assert {k: p.default for k, p in given.items()} == {
            f.name: f.default for f in fields(method)
        }
    with pytest.raises(AttributeError):
        _ = ln.methods.Optimum


def test_a_number_is_the_sigma_of_a_noise(scan):
    noise = ln.RangeNoise(sigma=0.02)
    pairs = (
        lambda noise: ln.extract(scan, method="iepf", noise=noise).segments.tobytes(),
        lambda noise: ln.extract(scan, noise=noise).noise,
        lambda noise: noise_row(noise).tolist(),
        lambda noise: stages.adaptive_clusters(scan, noise=noise).tolist(),
        lambda noise: stages.fit_line([(2, 0), (2, 1)], noise=noise)["covariance"].tolist(),
        lambda noise: ln.bounds.line_bound([0, 0.1], (2, 0), 1.5, noise).covariance.tolist(),
        lambda noise: ln.bounds.arc_bound([0, 0.01, 0.03], (2, 0), 0.1, noise).tolist(),
        lambda noise: Sensor("a", 9, 0.0, 0.1, noise=noise).noise,
    )
    for of in pairs:
        assert of(0.02) == of(noise)
    assert ln.Extractor(noise=0).noise == ln.RangeNoise()
    assert stages.fit_line([(2, 0), (2, 1)], noise=0)["covariance"][0, 0] < 1e-6  # not the default
    with pytest.raises(ValueError, match=r"RangeNoise.sigma is -1.0"):
        ln.Extractor(noise=-1)


@pytest.mark.parametrize(
    ("call", "hint"),
    [
        (lambda _: ln.extract(np.ones(10)), "ndarray.*angle_min=.*from_points"),
        (lambda _: ln.extract("a.log"), r"str.*open_log\(path\)"),
        (lambda s: ln.Extractor()(s.ranges), "ndarray.*angle_min="),
        (
            lambda _: ln.extract(ln.Tracker, angle_min=0.0, angle_increment=1.0),
            "numbers in an array",
        ),
        (lambda s: ln.extract(s, range_max=3.0), "own bearings, limits and times"),
        (lambda s: ln.extract(s, angle_increment=3.0), "own bearings, limits and times"),
        (lambda s: ln.Extractor().batch(s), "no LaserScan, expected a matrix"),
        (lambda s: ln.Extractor().batch([s, s]), "no LaserScan, expected a matrix"),
        (lambda s: ln.Tracker()(s), "LaserScan, expected Features"),
        (lambda s: ln.extract(s, noise="little"), "'little'.*RangeNoise.*sigma"),
        (lambda s: ln.extract(s, noise=True), "True.*RangeNoise"),
        (lambda s: ln.extract(s, method=3), "method is 3, expected.*optimal"),
        (lambda _: ln.plot(3), "int.*a path, a log"),
        (lambda s: ln.extract(s)["lines"], "'lines', expected one of: segments"),
        (lambda _: ln.LaserScan.from_points([1, 2]), r"shape \(2,\), expected \(n, 2\)"),
        (lambda _: ln.LaserScan.from_points(["a"]), r"\['a'\], expected numbers"),
    ],
)
def test_something_else_gives_one_sentence_that_says_what_to_pass(scan, call, hint):
    with pytest.raises((TypeError, ValueError, KeyError)) as caught:
        call(scan)
    text = str(caught.value)
    assert re.search(hint, text)
    assert "\n" not in text
    assert len(text) < 250


def test_a_log_or_a_message_in_place_of_a_scan(log, scan):
    with pytest.raises(TypeError, match=r"log\[i\]"):
        ln.extract(log)

    class Message:
        ranges = scan.ranges

    with pytest.raises(TypeError, match="from_message"):
        ln.extract(Message())


# Points


def test_points_become_the_scan_that_they_came_from(scan):
    rng = np.random.default_rng(1)
    for begin, end in ((0, 360), (20, 200), (150, 359)):
        part = scan[begin:end]
        points = rng.permutation(part.points)
        again = ln.LaserScan.from_points(points, stamp=1.5, range_max=5.0)
        np.testing.assert_allclose(again.points[again.valid], part.points[part.valid], atol=1e-12)
        # Missing beams are there again, the three from 100 on, but for those at an end.
        assert len(again) == len(part)
        np.testing.assert_array_equal(again.valid, part.valid)
        assert again.is_full_circle == part.is_full_circle
        assert (again.stamp, again.range_max) == (1.5, 5.0)


def test_of_points_with_one_bearing_the_nearest_stays():
    points = [(3, 3), (0, 0), (1, 1), (2, 2), (math.nan, 1), (math.inf, 0), (1, -1)]
    again = ln.LaserScan.from_points(points)
    assert again.ranges[again.valid] == pytest.approx([math.sqrt(2)] * 2)
    assert len(ln.LaserScan.from_points([])) == 0
    assert ln.LaserScan.from_points([(0, 2)]).angles == pytest.approx([math.pi / 2])
    many = ln.LaserScan.from_points([*((1, 1e-6 * k) for k in range(9)), (1, 1)])
    assert 2000 < len(many) < 20_000  # a tiny step does not make a beam for each


@pytest.mark.parametrize(("steps", "missing"), [(1.4, 0), (1.6, 1), (2.4, 1), (5.0, 4)])
def test_beams_between_points_are_as_many_as_fit(steps, missing):
    angles = np.array([0.0, 0.1, 0.2, 0.3, 0.3 + 0.1 * steps])
    again = ln.LaserScan.from_points(np.column_stack((np.cos(angles), np.sin(angles))))
    assert len(again) == 5 + missing
    assert np.isnan(again.ranges).sum() == missing


def test_a_doorway_between_points_parts_the_wall():
    bearings = np.linspace(-1, 1, 201)
    ranges = 2 / np.cos(bearings)
    ranges[90:110] = np.nan
    wall = ln.LaserScan(ranges, -1, 0.01)
    for method in ("optimal", "liu"):
        found = ln.extract(ln.LaserScan.from_points(wall.points), method=method)
        assert len(found.segments) == len(ln.extract(wall, method=method).segments) == 2


# len, bool, iteration, indexing


def test_features_are_tables_by_name(scan):
    features = ln.extract(scan)
    assert list(features) == [*TABLES]
    assert all(features[name] is getattr(features, name) for name in features)
    assert len(features) == sum(len(features[name]) for name in features) > 4
    assert bool(features)
    assert not ln.extract(ln.LaserScan([], 0.0, 0.1))
    assert features.scan is scan
    assert features.transform(0, 0, 1).scan is None


def test_beams_of_a_scan(scan):
    assert scan[3] == (scan.angles[3], scan.ranges[3])
    assert scan[-1] == scan[359]
    assert len([*scan]) == len(scan)
    with pytest.raises(IndexError):
        scan[360]
    with pytest.raises(ValueError, match="step is -1"):
        scan[::-1]
    timed = ln.LaserScan(
        scan.ranges, **FRAME, stamp=2.0, time_increment=0.5, intensities=scan.ranges, pose=(1, 2, 3)
    )
    for whole in (timed, ln.LaserScan(scan.ranges, angles=RING, intensities=scan.ranges)):
        assert len(whole.points) == len(whole)  # is made once, and not that of the part
        part = whole[10:50:2]
        assert len(part) == len(part.points) == len(part.valid) == 20
        np.testing.assert_allclose(part.angles, whole.angles[10:50:2], atol=1e-14)
        np.testing.assert_array_equal(part.ranges, whole.ranges[10:50:2])
        np.testing.assert_array_equal(part.intensities, whole.ranges[10:50:2])
        assert part.is_regular == whole.is_regular
        assert (part.pose, part.stamp) == (whole.pose, whole.stamp)
        # The stamp stays at its beam, which may be before the first: beams keep their times.
        assert part.time_increment == 2 * whole.time_increment
        assert -part.stamp_beam * part.time_increment == 10 * whole.time_increment
    assert not scan[5:5]
    limited = scan[5:]
    assert (limited.range_max, limited.frame_id) == (5.0, "laser")


def test_parts_of_a_batch(scan):
    rows = np.array([scan.ranges, np.full(360, np.nan), scan.ranges[::-1], scan.ranges])
    batch = ln.Extractor("iepf").batch(rows, **FRAME, stamps=range(4))
    for part, kept in (
        (batch[1:3], [1, 2]),
        (batch[2:], [2, 3]),
        (batch[3:1], []),
        (batch[:], range(4)),
    ):
        assert len(part) == len(kept)
        for one, i in zip(part, kept, strict=True):
            assert one.to_dict() == batch[i].to_dict()
    assert batch[2:].to_arrow(scan=2).equals(batch.to_arrow().slice(len(batch[:2].to_arrow())))
    with pytest.raises(ValueError, match="step is 2"):
        batch[::2]


def test_scans_of_a_log(log):
    assert log[np.int64(-2)].pose == (3.0, 0.0, 0.0)
    assert [scan.pose for scan in log[1:4:2]] == [(1.0, 0.0, 0.0), (3.0, 0.0, 0.0)]
    for index in (5, -6):
        with pytest.raises(IndexError, match=f"has no scan {index}, expected 0 to 4"):
            log[index]
    with pytest.raises(ValueError, match="forwards"):
        log[::-1]


# Tables


@pytest.mark.parametrize("package", ["pandas", "polars"])
def test_data_frames(scan, package):
    pytest.importorskip(package, reason=f"{package} is not installed")
    features = ln.extract(scan)
    frame = getattr(features, f"to_{package}")(scan=3)
    table = features.to_arrow(scan=3)
    assert [*frame.columns] == table.column_names
    assert frame.shape == (table.num_rows, table.num_columns)
    assert frame["x"].to_list()[:2] == table["x"].to_pylist()[:2]
    assert frame["kind"].to_list() == table["kind"].to_pylist()
    batch = ln.Extractor().batch([scan.ranges] * 2, **FRAME)
    assert len(getattr(batch, f"to_{package}")()) == batch.to_arrow().num_rows


@pytest.mark.parametrize("package", ["pandas", "polars"])
def test_missing_package_of_data_frames(scan, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    line = rf"to_{package} needs {package}, .*: pip install 'lineament\[{package}\]'$"
    with pytest.raises(ln.LineamentError, match=line):
        getattr(ln.extract(scan), f"to_{package}")()


# Pictures


def parsed(html):
    """Hold HTML to be sound XML; return its elements by tag, without their name space."""
    found = {}
    for element in ET.fromstring(html).iter():
        found.setdefault(element.tag.rpartition("}")[2], []).append(element)
    return found


def test_notebooks_show_what_was_approved(scan, log):
    """A scan with each kind of feature, a log, nothing, and what `plot` draws."""
    found = ln.extract(scan)
    corners = np.repeat(found.corners[:1], 7)
    corners["covariance"][0], corners["quality"] = [[0.04, 0.01], [0.01, 0.02]], np.arange(7) / 7
    corners["position"] += 0.1 * np.arange(7)[:, np.newaxis]
    by_hand = features(
        n=360,
        edges=[edge(1, 0.2, segment=3), edge(1.2, 0.1)],
        arcs=[arc(0.5, -0.5, 0.25, 300, 320, sigma=0.02), arc(-1, 0, 0.1, 500, 501)],
        breakpoints=[breakpoint_at(3, 4)],
        clusters=np.arange(360) // 30 - 1,
    )
    every = replace(by_hand, segments=found.segments, corners=corners, scan=scan)
    axes = [ln.plot(every), ln.plot(replace(every, scan=None)), ln.plot(scan, method="liu")]
    shown = every, replace(every, scan=None), scan.with_pose((1.0, 2.0, 0.3)), log, scan[:0]
    lines = [line for one in shown for line in one._repr_html_().splitlines()]
    drawn = [line for of in axes for line in figure_lines(of.figure)]
    lines = [line.replace(log.name, "drive.npz") for line in lines]
    assert_approved("notebook", [*lines, *drawn])


@pytest.mark.parametrize(("pixels", "shown"), [(3.9, 0), (4.1, 1)])
def test_ellipses_that_a_diamond_hides_are_not_drawn(scan, pixels, shown):
    found = ln.extract(scan)
    bar = re.search(r"v4H([\d.]+)v-4.*?>([\d.]+) m", found._repr_html_(), re.DOTALL)
    metre = (float(bar[1]) - notebook.MARGIN) / float(bar[2])
    corners = found.corners[:1].copy()
    corners["covariance"] = (pixels / metre) ** 2 / (-2 * math.log(0.05)) * np.eye(2)
    html = notebook.svg(scan, replace(found, corners=corners))
    assert html.count("<ellipse") == shown


@pytest.mark.parametrize("size", [0.02, 1.0, 200.0, 1e6])
def test_scans_of_any_size_fill_their_picture(size):
    ranges = size * np.array(room(RING, BOX))
    svg = notebook.svg(ln.LaserScan(ranges, **FRAME), features(len(ranges)))
    points = np.array(re.findall(r"M([-\d.]+) ([-\d.]+)h0", svg), float)
    assert np.ptp(points, axis=0).max() > 350
    length = float(re.search(r">([\d.e+-]+) m", svg)[1])
    assert 0.3 * size < length < 1.5 * size


@pytest.mark.parametrize("ranges", [[], [np.nan] * 5, [1.0], [1e300, 1.0], [1e-9] * 4])
def test_hostile_scans_have_pictures(ranges):
    scan = ln.LaserScan(ranges, 0.0, 0.1)
    for shown in (scan, ln.extract(scan), ln.extract(scan).transform(1, 2, 3)):
        assert parsed(shown._repr_html_())["svg"]
    assert ln.plot(scan).get_xlim()[0] < ln.plot(scan).get_xlim()[1]


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_finite_by_half_is_left_out_of_a_picture(bad):
    """A feature of each kind of which one number alone is not known; the whole ones are drawn."""
    rings = [breakpoint_at(0, 1), breakpoint_at(1, 2)]
    found = features(
        9,
        segments=[segment((1, 0), (1, 1), 0, 3), segment((bad, 0), (1, 1), 0, 3)],
        corners=[corner(1, 1), corner(1, bad)],
        edges=[edge(1, 0), edge(bad, 1)],
        arcs=[arc(2, 1, 0.25, 0, 3), arc(2, 1, bad, 0, 3), arc(2, bad, 0.25, 0, 3)],
        breakpoints=rings,
    )
    found.breakpoints["position"] = [(1, 0), (1, bad)]
    whole = replace(found, **{name: found[name][:1] for name in TABLES})
    scan = ln.LaserScan([1.0] * 9, 0.0, 0.1)
    drawn = notebook.svg(scan, found)
    assert "nan" not in drawn
    assert "inf" not in drawn
    marks, legend = drawn.split("<text ")
    assert marks == notebook.svg(scan, whole).split("<text ")[0]
    assert legend.count("tspan") == 10


def test_control_characters_of_names_do_not_reach_a_page():
    hostile = ln.LaserScan([1.0] * 9, -0.5, 0.05, frame_id="a\x1b]0;b\x07\u202e<b>")
    html = hostile._repr_html_()
    assert "a\\x1b]0;b\\x07\\u202e&lt;b&gt;" in html
    assert not any(letter in html for letter in "\x1b\x07\u202e")


def test_a_log_that_cannot_be_read_shows_why(tmp_path):
    path = tmp_path / "a&b.log"
    path.write_text("FLASER 2 1.0 1.0 0 0 0 0 0 0 1.0 h 1.0\nFLASER 3 1.0\n")
    log = ln.open_log(path)
    path.unlink()
    html = log._repr_html_()
    assert re.search(r"<b>\S+a&amp;b.log</b>", html)
    assert "there is no such file" in html


def test_plot_of_features_scans_and_logs(scan, log):
    features = ln.extract(scan)
    _, ax = pyplot.subplots()
    assert features.plot(ax) is ax
    assert features.plot() is not ax  # a figure of its own
    labels = ax.get_legend_handles_labels()[1]
    assert {"segment", "corner", "sensor", "no return"} <= set(labels)
    low, high = ax.get_ylim()
    assert low < -1.7
    assert high > 1.3
    flat = ln.plot(ln.LaserScan([1.0, 9.0], angles=[0.0, 0.01]))  # its panel is flat
    flat.figure.draw_without_rendering()
    legend, label = flat.get_legend(), flat.xaxis.label
    assert legend.get_window_extent().y1 < label.get_window_extent().y0
    title = ln.plot(log, scan=4, method="iepf", min_piece=5).get_title(loc="left")
    assert title == "drive.npz · scan 4 · iepf"
    assert ln.plot(log.path).get_title(loc="left") == "drive.npz · scan 0 · optimal"
    assert ln.plot(scan, method=ln.methods.Liu()).get_title(loc="left") == "laser · liu"


def test_plot_of_features_without_a_scan_takes_one(scan):
    row = ln.Extractor().batch([scan.ranges], **FRAME)[0]
    alone, over = row.plot(), row.plot(scan=scan)
    assert "no return" not in alone.get_legend_handles_labels()[1]
    assert "no return" in over.get_legend_handles_labels()[1]
    with pytest.raises(ValueError, match="scan has 10 beams, expected the 360"):
        row.plot(scan=scan[:10])


@pytest.mark.parametrize(("walls", "is_flat"), [(3, False), (4, True)])
def test_features_alone_are_drawn_with_the_sensor(walls, is_flat):
    """Their ends, corners and the sensor: where these are fewer than nine, no plan is flat."""
    along = [segment((k, 0), (k + 1, 0), 0, 9) for k in range(walls)]
    ax = features(0, segments=along, corners=[corner(walls, 0)] * (walls == 3)).plot()
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    assert (left, right) == pytest.approx((-0.04 * walls, 1.04 * walls))
    assert (low, high) == pytest.approx((-walls / 4, walls / 4) if not is_flat else (-0.02, 0.02))


# The command


def test_methods_are_listed(capsys):
    assert run(["methods"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ln.methods.method_names()
    assert all(len(line.split()) > 1 for line in lines)


@pytest.mark.parametrize("name", [*method_names(presets=False), "liu:paper"])
def test_parameters_are_listed_with_units_defaults_and_bounds(name, capsys):
    assert run(["methods", name]) == 0
    out = capsys.readouterr().out
    method = ln.methods.get_method(name)
    for field in fields(method):
        value = getattr(method, field.name)
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        unit, bounds = field.metadata["unit"], str(field.metadata["bounds"])
        row = rf"^{field.name} +{re.escape(shown)} +{re.escape(unit)} *{re.escape(bounds)}$"
        assert re.search(row, out, re.MULTILINE)


# Reprs


def test_reprs_fit_a_line(scan):
    tracker, features = ln.Tracker(3), ln.extract(scan)
    assert repr(tracker) == "Tracker(3, gate=0.99, roughness=0.01: 0 tracks)"
    tracks = tracker(features)
    found = len(features.segments) + len(features.corners)
    assert repr(tracker).endswith(f": {found} tracks)")
    assert f"{len(features.corners)} corners, 0 arcs, {found} born, 0 ended, None" in repr(tracks)
    motion = tracker(features).motion
    assert repr(motion).startswith("Motion(0.0000 ± 0.0")
    liu = ln.trace(scan, method="liu")
    assert repr(liu) == f"Trace(liu: {len(liu.candidates)} candidates, {liu.features})"
    shown = (tracker, tracks, motion, liu, scan, features, ln.Extractor(), ln.RangeNoise())
    assert all(len(repr(one)) < 200 and "object at" not in repr(one) for one in shown)
