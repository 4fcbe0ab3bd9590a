"""The loop of a node over messages in memory, and its pipeline."""

import math
import time
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np
import pytest
from in_memory import Given, Kept, Taken
from live_driving import garbage, received_scan

import lineament as ln
from lineament.live import (
    LiveConfig,
    Node,
    Odometry,
    Pipeline,
    Received,
    ReplaySource,
    RosSink,
)
from lineament.live.pipeline import stamp_of, twist_of_laser
from lineament.live.received import ODOMETRY
from lineament.output.ros_messages import RosMessages
from lineament.scan.poses import compose, poses_along, twist_between
from lineament.simulation import SENSORS, building, drive, room

BEARINGS = np.linspace(-0.5, 0.5, 101)
WALL = 2.0 / np.cos(BEARINGS)


def sweep(stamp: float = 1.0, **fields) -> ln.LaserScan:
    return ln.LaserScan(WALL, -0.5, 0.01, stamp=stamp, **fields)


def wall(publisher: str, stamp: float = 1.0, **fields) -> Received:
    scan = sweep(stamp, **fields)
    return Received(publisher, lambda: scan, 0.0)


def moving(*twist: float, stamp: float = 1.0) -> Odometry:
    return Odometry(stamp, twist, (0.0, 0.0, 0.0), "odom", "base")


def heard(odometry: Odometry) -> Received:
    return Received("o", lambda: odometry, 0.0, ODOMETRY)


class Clock:
    """The time of a node, which passes only when it is changed."""

    now = 0.0
    time_ns = staticmethod(time.time_ns)

    def monotonic(self) -> float:
        return self.now


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr("lineament.live.node.time", clock)
    return clock


def run(*batches, source=None, **options):
    """Run a node to its end: its totals, its frames, and the lines that it wrote."""
    sink, lines = Kept(), []
    pipeline = Pipeline(LiveConfig(**options))
    report = Node(source or Given(*batches), pipeline, [sink], write=lines.append).run()
    return report.total, sink.frames, lines


# The loop.


def test_only_the_newest_scan_of_each_publisher_is_processed():
    batch = [wall("a", 1.0), wall("b", 1.5), wall("a", 2.0), wall("a", 3.0)]
    total, frames, lines = run(batch, [wall("b", 4.0)])
    assert [frame.scan.stamp for frame in frames] == [3.0, 1.5, 4.0]
    assert (total.scans, total.dropped, total.malformed, lines) == (3, 2, 0, [])


@pytest.mark.parametrize("name", garbage())
def test_a_malformed_message_is_counted_written_once_and_survived(name):
    bad = received_scan("bad", garbage()[name])
    total, frames, lines = run([bad], [bad], [wall("good", 1.0)], [wall("bad", 2.0)])
    assert (total.scans, total.malformed) == (2, 2)
    assert [frame.scan.stamp for frame in frames] == [1.0, 2.0]
    (line,) = lines
    assert line.startswith("a scan of bad makes no sense: ")
    assert "\n" not in line


def test_most_beams():
    """The limits of logs hold for messages too."""
    pipeline = Pipeline(LiveConfig(limits={"beams": 500}))
    for n in (1, 500):
        pipeline("a", ln.LaserScan(np.ones(n), 0.0, 5e-4))
    for n, problem in ((0, "has no beams"), (501, "has 501 beams in a scan, more than the limit")):
        with pytest.raises(ValueError, match=problem):
            pipeline("a", ln.LaserScan(np.ones(n), 0.0, 5e-4))


def test_odometry_is_used_before_the_scans_of_its_batch():
    scan = wall("a", 1.1, time_increment=0.001)
    total, (first, second), lines = run(
        [heard(moving(np.nan, 0.0, 0.0)), scan],
        [scan, heard(moving(0.0, math.inf, 0.0)), heard(moving(1.0, 0.0, 0.0))],
        deskew="/odom",
        laser_pose=(0.2, 0.1, 0.5),
    )
    assert (total.scans, total.dropped, total.malformed) == (2, 0, 2)
    assert first.straight is first.scan
    expected = ln.deskew(second.scan, twist_of_laser((1.0, 0.0, 0.0), (0.2, 0.1, 0.5)))
    np.testing.assert_array_equal(second.straight.ranges, expected.ranges)
    assert lines[0].startswith("an odometry of o makes no sense: its twist is (nan, 0.0, 0.0), ex")


def test_a_sweep_that_makes_no_sense_is_refused_and_survived():
    batch = [heard(moving(1.0, 0.0, 0.0)), wall("a", time_increment=1e20)]
    total, _, lines = run(batch, [wall("a", time_increment=1e-3)], deskew="/odom")
    assert (total.scans, total.malformed) == (1, 1)
    assert lines[0].startswith("a scan of a makes no sense: twist (1.0, 0.0, 0.0) for 1e+22 s")


def test_publishers_whose_names_are_made_up_do_not_fill_the_screen(monkeypatch):
    monkeypatch.setattr("lineament.live.node._MOST_FAULTY", 2)
    bad = [received_scan(name, b"") for name in "abca"]
    total, _, lines = run(bad[:2], bad[2:])
    assert total.malformed == 4
    faults = [line.partition(" makes no sense")[0] for line in lines]
    assert faults == ["a scan of a", "a scan of b"]


def test_what_was_skipped_in_a_log_is_written_at_its_end(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("FLASER x\nFLASER 2 1 2 0 0 0 0 0 0 1 robot 1\n")
    total, _, lines = run(source=ReplaySource(path, rate=0, keep_going=True))
    assert total.scans == len(lines) == 1
    assert lines[0].startswith(f"skipped: {path}:1: FLASER")


def test_publishers_problems_and_reports_second_by_second(clock):
    source, sink, lines, shown = Given(), Kept(), [], []

    def after(publishers: int, *problems: str, seconds: float = 1.0):
        def batch() -> list[Received]:
            clock.now += seconds
            source.publishers, source.lines = publishers, list(problems)
            return []

        return batch

    source.batches = [
        after(0),
        after(0, seconds=0.9),  # not long enough for a report
        after(0, "another type\nof messages"),
        *(after(number, "another type\nof messages") for number in (0, 1, 1, 2, 0, 0)),
        after(1, "the master has gone"),
        [],
    ]
    node = Node(source, Pipeline(LiveConfig()), [sink], write=lines.append, show=shown.append)
    node.run()
    waiting = "no publisher of scans: waiting for one"
    assert lines == [
        *("another type\\nof messages", waiting, "1 publisher of scans", "2 publishers of scans"),
        *(waiting, "the master has gone", "1 publisher of scans"),
    ]
    assert shown == [report for report, _ in sink.reports]
    seconds = [1.0, 1.9, 1, 1, 1, 1, 1, 1, 1, 0.0]
    assert [report.seconds for report in shown] == pytest.approx(seconds)
    assert {report.level for report in shown} == {3}


def test_reports_have_the_time_of_day(clock, monkeypatch):
    monkeypatch.setattr(clock, "time_ns", lambda: 1_700_000_000_123_456_789, raising=False)
    sink = Kept()
    Node(Given([wall("a")]), Pipeline(LiveConfig()), [sink], write=[].append).run()
    assert [time for _, time in sink.reports] == [(1_700_000_000, 123_456_789)]


def test_latency_counts_from_when_a_scan_came(clock):
    clock.now, sink = 7.0, Kept()
    came = [Received("a", sweep, 4.5), Received("b", sweep, 6.5)]
    Node(Given(came), Pipeline(LiveConfig()), [sink], write=[].append).run()
    ((report, _),) = sink.reports
    assert report.latency == pytest.approx((1.5, 0.5 + 0.99 * 2.0))


def test_a_publisher_that_comes_again_may_be_reported_again(clock):
    source, lines = Given(), []
    bad = received_scan("bad", b"")

    def batch(publishers: int) -> list[Received]:
        clock.now += 3.0
        source.publishers = publishers
        return [bad]

    source.batches = [partial(batch, number) for number in (1, 0, 1, 1)]
    Node(source, Pipeline(LiveConfig()), [], write=lines.append).run()
    assert sum("makes no sense" in line for line in lines) == 2


def test_a_stop_ends_it():
    asked = iter([False, False, True])
    source = Given(*[[wall("a", float(i))] for i in range(10)])
    assert Node(source, Pipeline(LiveConfig()), []).run(lambda: next(asked)).total.scans == 2


@pytest.mark.parametrize("log", ["a.npz", None])
@pytest.mark.parametrize(
    ("scan", "topics"),
    [
        (sweep(pose=(1.0, 2.0, 0.5)), ["/tf", "/scan"]),
        (sweep(), ["/scan"]),
        (ln.LaserScan(WALL, angles=BEARINGS**3), ["/scan/points"]),
    ],
)
@pytest.mark.parametrize(
    "options", [{}, {"track": True}, {"deskew": "scans"}, {"dock": (9, 9)}, {"dock_track": 1}]
)
def test_what_is_published_of_a_scan_and_only_where_somebody_listens(log, scan, topics, options):
    publisher, config = Taken(), LiveConfig(log=log, **options)
    sink = RosSink(publisher, RosMessages("cdr"), config)
    frame = Pipeline(config)("a", scan)
    below = [f"/scan/{name}" for name in ("features", "corners", "markers")]
    if options:
        below.append("/scan/odometry")
    assert ("/scan/odometry" in publisher._topics) == bool(options)
    # The scan has no corner.
    assert ("/scan/dock" in publisher._topics) == any("dock" in name for name in options)
    made = below + topics if log else below
    for heard in (None, [], *([topic] for topic in made)):
        publisher.heard = heard
        publisher.messages.clear()
        sink.publish(frame)
        assert [one.topic for one in publisher.messages] == (made if heard is None else heard)


# The pipeline.


def test_stamps_that_no_message_holds_are_clipped():
    times = [stamp_of(sweep(stamp).stamp_ns) for stamp in (7.25, -1.0, 1e300, 1.9999999999)]
    assert times == [(7, 250_000_000), (0, 0), (2**31 - 1, 999_999_999), (2, 0)]


def test_each_publisher_has_tracks_of_the_last_eight():
    _, frames, _ = run(*[[wall("a", i), wall("b", i)] for i in range(3)], track=True)
    # The same wall of two scanners: each has its own numbers, which last.
    assert [frame.tracks.segments.tolist() for frame in frames] == [[0]] * 6
    pipeline = Pipeline(LiveConfig())
    for i in range(100):
        assert len(pipeline(f"publisher {i}", sweep()).features.segments) == 1
    assert len(pipeline._publishers) == 8


@pytest.mark.parametrize("options", [{"method": "houghton"}, {"parameters": {"houghton": 3}}])
def test_an_unknown_method_or_parameter_is_an_error_at_once(options):
    with pytest.raises(ValueError, match="houghton"):
        Pipeline(LiveConfig(**options))


def test_twist_of_a_mounted_scanner_is_the_motion_of_its_pose():
    rng = np.random.default_rng(3)
    for _ in range(50):
        twist = tuple(rng.normal(size=3))
        laser = (*rng.normal(size=2), rng.uniform(-3, 3))
        start, later = (compose(tuple(p), laser) for p in poses_along(twist, [0.0, 0.1]))
        assert twist_of_laser(twist, laser) == pytest.approx(twist_between(start, later, 0.1))


def deskewed(pipeline: Pipeline, scan: ln.LaserScan) -> bool:
    return pipeline("one", scan).straight is not scan


def test_ranges_in_millimetres_and_a_stamp_of_the_last_beam():
    """A wall 2 m ahead; 101 beams in 0.1 s, by the time of the last of them."""
    scan = ln.LaserScan(1e3 * WALL, -0.5, 0.01, stamp=5.0, time_increment=1e-3, range_max=1e4)
    frame = Pipeline(LiveConfig(scale=1e-3, stamp="last", deskew="/odom"))("one", scan)
    np.testing.assert_allclose(frame.scan.ranges, WALL)
    assert (frame.scan.range_max, frame.scan.stamp_beam) == (10.0, 100)
    assert frame.features.segments["centroid"][0, 0] == pytest.approx(2.0)


def test_odometry_holds_for_half_a_second():
    pipeline = Pipeline(LiveConfig(deskew="/odom"))
    scan = sweep(10.0, time_increment=1e-3)
    assert not deskewed(pipeline, scan)
    for stamp, holds in [(9.5, True), (9.49, False), (10.5, True), (10.51, False)]:
        pipeline.hear(moving(1.0, 0.0, 0.0, stamp=stamp))
        assert deskewed(pipeline, scan) == holds


@pytest.mark.parametrize(
    ("deskew", "times", "scans", "why"),
    [
        ("/odom", {}, 1, "they have neither time_increment nor scan_time"),
        ("scans", {}, 1, "they have neither time_increment nor scan_time"),
        ("/odom", {"scan_time": 0.1}, 20, "no odometry on /odom is within 0.5 s of their stamps"),
        ("poses", {"scan_time": 0.1}, 20, "the log has no poses less than a second apart"),
        ("/odom", {"scan_time": 0.1}, 19, None),
        ("/odom", {"time_increment": 1.0}, 20, "their time_increment or scan_time is far longer "),
        ("scans", {"time_increment": 1.0}, 20, "their time_increment or scan_time is far longer "),
        ("scans", {"time_increment": 1.0}, 19, None),
        ("off", {}, 30, None),
    ],
)
def test_scans_that_cannot_be_deskewed_are_a_line(deskew, times, scans, why):
    log = {"log": "a.log"} if deskew == "poses" else {}
    batches = [[wall("a", k / 10, **times)] for k in range(scans)]
    total, _, lines = run(*batches, deskew=deskew, **log)
    assert total.scans == scans
    assert total.malformed == 0
    assert len(lines) == (why is not None)
    assert all(line.startswith(f"scans are not deskewed: {why}") for line in lines)


def test_twenty_scans_in_a_row_without_a_motion_are_a_line():
    pipeline = Pipeline(LiveConfig(deskew="/odom"))
    known = {0, 20}
    for k in range(41):
        if k in known:
            pipeline.hear(moving(1.0, 0.0, 0.0, stamp=float(k)))
        pipeline("one", sweep(float(k), time_increment=1e-4))
        assert len(list(pipeline.problems())) == (k >= 40)


def test_what_is_docked_to_and_never_seen_is_a_line():
    pipeline = Pipeline(LiveConfig(dock=(50.0, 50.0)))
    for k in range(20):
        assert not list(pipeline.problems())
        pipeline("one", sweep(float(k)))
    (line,) = pipeline.problems()
    assert line.startswith("what is docked to is not seen in 20 scans in a row: expected it")


def test_poses_give_the_motion_between_scans():
    pipeline = Pipeline(LiveConfig(deskew="poses", log="a.log"))
    poses = [
        (1.0, (0.0, 0.0, 0.0), False),
        (1.5, (0.5, 0.0, 0.0), True),
        (9.0, (0.7, 0.0, 0.0), False),  # too long ago
        (8.0, (0.9, 0.0, 0.0), False),  # time runs backwards
        (8.0, (0.9, 0.0, 0.0), False),  # or stands still
        (8.1, None, False),
        (8.2, (0.9, 0.0, 0.0), False),
        (9.19, (1.0, 0.0, 0.0), True),
        (10.24, (1.1, 0.0, 0.0), False),
    ]
    for stamp, pose, moves in poses:
        assert deskewed(pipeline, sweep(stamp, pose=pose, time_increment=1e-3)) == moves, stamp


@pytest.mark.parametrize(
    ("deskew", "scan_time", "sweep_time"),
    [("off", 0.05, 0.05), ("off", -0.05, 0.05), ("off", 0.0, math.inf), ("/odom", 0.05, 0.0)],
)
def test_odometry_knows_how_long_a_sweep_took_that_is_not_deskewed(deskew, scan_time, sweep_time):
    pipeline, swept = Pipeline(LiveConfig(deskew=deskew, dock=(5.0, 2.0))), []
    kept = pipeline._publisher("one")
    odometer = kept.odometer
    kept.odometer = lambda tracks, stamp, sweep, *, deskewed: (
        swept.append((sweep, deskewed)) or odometer(tracks, stamp, sweep, deskewed=deskewed)
    )
    pipeline.hear(moving(1.0, 0.0, 0.0))
    frame = pipeline("one", sweep(scan_time=scan_time))
    assert (frame.straight is frame.scan) == (deskew == "off")
    assert swept == [(sweep_time, deskew != "off")]


def test_the_dock_is_looked_for_where_the_odometry_is(monkeypatch):
    poses = []
    monkeypatch.setattr(
        "lineament.live.configured.Dock", lambda *_, **__: lambda *at: poses.append(at)
    )
    pipeline = Pipeline(LiveConfig(dock=(5.0, 2.0)))
    walk = [(-2.0, 0.0), (-1.0, 0.0)]
    for scan in drive(room(), walk, SENSORS["lms181"], speed=1.0, rate=5):
        frame = pipeline("one", scan)
        features, tracks, pose, covariance = poses.pop()
        assert (features, pose) == (frame.features, frame.travel.pose)
        assert covariance is frame.travel.covariance
        assert len(tracks.corners) == len(features.corners)
    assert pose[0] == pytest.approx(1.0, abs=0.02)


def test_moving_scans_of_a_log_are_deskewed_by_its_poses():
    walk = [(-2.0, 0.0), (-1.0, 0.0)]
    scans = list(drive(room(), walk, SENSORS["lms361"], speed=1.0, rate=10, moving=True))
    pipeline = Pipeline(LiveConfig(deskew="poses", log="a.log"))
    for scan in scans[:6]:
        frame = pipeline("one", scan)
        assert frame.scan is scan
        assert frame.tracks is None
    expected = ln.deskew(scan, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(frame.straight.ranges, expected.ranges, atol=1e-6)
    assert np.nanmax(np.abs(frame.straight.ranges - scan.ranges)) > 0.005


def test_a_scan_is_deskewed_by_the_motion_before_it_or_where_none_is_known_by_its_own():
    way, speed = [(-2.0, 0.0), (-1.4, 0.1)], 1.0
    scans = drive(room(), way, SENSORS["lms361"], speed=speed, rate=10, moving=True)
    pipeline, extract, track = Pipeline(LiveConfig(deskew="scans")), ln.Extractor(), ln.Tracker()
    for k, scan in enumerate(scans):
        frame, before = pipeline("one", scan), track.twist
        straight = ln.deskew(scan, before)
        track(extract(straight))
        if before is None:
            straight = ln.deskew(scan, track.twist)
            if k > 0:
                track.again(extract(straight))
        np.testing.assert_array_equal(frame.straight.ranges, straight.ranges)
        assert (frame.straight is scan) == (k == 0)
        assert frame.features.to_dict() == extract(straight).to_dict()
    assert k >= 4


def test_a_method_changes_while_the_node_runs_and_tracks_stay():
    """What is read once, at the start, cannot change; and what is refused changes nothing."""
    config = LiveConfig(track=True)
    pipeline = Pipeline(config)
    scans = list(islice(drive(*building(), SENSORS["utm30lx"], rate=4.0, seed=3), 4))
    before = [pipeline("front", scan).tracks.segments for scan in scans[:2]]
    pipeline.change(replace(config, noise=0.02, scale=1.0, parameters={"evidence": 14.0}))
    frame = pipeline("front", scans[2])
    known = ln.Extractor("optimal", noise=0.02, evidence=14.0)
    assert frame.features.segments.tobytes() == known(scans[2]).segments.tobytes()
    assert set(frame.tracks.segments) & set(before[1])
    for other, why in (
        (replace(config, topic="other"), "topic is read at the start, expected a change of one of"),
        (replace(config, method="nonsense"), "method 'nonsense' is unknown"),
    ):
        with pytest.raises(ValueError, match=why):
            pipeline.change(other)
    again = pipeline("front", scans[3]).features
    assert again.segments.tobytes() == known(scans[3]).segments.tobytes()
