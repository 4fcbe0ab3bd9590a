"""The loop of a node, over messages in memory: what is worked at, dropped, counted and told."""

import struct
import time
from functools import partial

import numpy as np
import pytest

import lineament as ln
from lineament.live import LiveConfig, Node, Odometry, Pipeline, Received, ReplaySource
from lineament.live.counters import Counters
from lineament.live.pipeline import MOST_BEAMS, time_of
from lineament.logs import save_npz
from lineament.rosmsg.scans import laser_scan


class Given:
    """A source of given batches of messages; each is received at once."""

    lost = 0

    def __init__(self, *batches, publishers=()):
        self.batches, self.numbers = list(batches), list(publishers)
        self.publishers = 1
        self.said = []

    @property
    def ended(self):
        return not self.batches

    def receive(self, timeout):
        assert timeout > 0
        if self.numbers:
            self.publishers = self.numbers.pop(0)
        batch = self.batches.pop(0)
        if callable(batch):
            batch = batch()
        return batch

    def problems(self):
        return self.said

    def close(self):
        pass


class Kept:
    """A sink that keeps what it is told."""

    unsent = 0

    def __init__(self):
        self.frames, self.reports = [], []

    def tell(self, frame):
        self.frames.append(frame)

    def diagnose(self, report, time):
        self.reports.append((report, time))

    def close(self):
        pass


def message(stamp, ranges, increment=0.1, first=0.0, declared=None):
    ranges = np.asarray(ranges, "<f4")
    count = len(ranges) if declared is None else declared
    text = struct.pack("<4sIII4s", b"\0\1\0\0", *divmod(round(stamp * 1e9), 10**9), 4, b"las\0")
    fields = struct.pack("<7fI", first, 1.0, increment, 0.0, 0.1, 0.1, 30.0, count)
    return text + fields + ranges.tobytes() + struct.pack("<I", 0)


def received(publisher, data, time=None):
    return Received(publisher, partial(laser_scan, data, "cdr"), 0.0, False, time)


def run(*batches, config=None, publishers=()):
    source, sink, told = Given(*batches, publishers=publishers), Kept(), []
    report = Node(source, Pipeline(config or LiveConfig()), [sink], tell=told.append).run()
    return report, sink, told


WALL = 2.0 / np.cos(np.linspace(-0.5, 0.5, 101))


def wall(publisher, stamp):
    return received(publisher, message(stamp, WALL, 0.01, -0.5))


def test_only_the_newest_scan_of_each_publisher_is_worked_at():
    report, sink, told = run(
        [wall("a", 1.0), wall("b", 1.5), wall("a", 2.0), wall("a", 3.0)], [wall("b", 4.0)]
    )
    assert [frame.scan.stamp for frame in sink.frames] == [3.0, 1.5, 4.0]
    assert (report.total_scans, report.total_dropped, report.total_malformed) == (3, 2, 0)
    assert told == []


def test_frames_have_the_stamp_of_the_message_exactly():
    exactly = (1_700_000_000, 123_456_789)
    _, sink, _ = run([received("a", message(1.0, WALL, 0.01, -0.5), exactly)], [wall("a", 2.5)])
    assert [frame.time for frame in sink.frames] == [exactly, (2, 500_000_000)]


@pytest.mark.parametrize(
    ("stamp", "time"),
    [(7.25, (7, 250_000_000)), (-1.0, (0, 0)), (1e300, (2**31 - 1, 0)), (1.9999999999, (2, 0))],
)
def test_stamps_that_no_message_holds_are_clipped(stamp, time):
    assert time_of(stamp) == time


BROKEN = {
    "empty": (b"", "begins with"),
    "cut off": (message(1.0, WALL)[:60], "ends early"),
    "too many ranges declared": (message(1.0, WALL, declared=2**31), "ends early"),
    "nan increment": (message(1.0, WALL, increment=float("nan")), "angle_increment is nan"),
    "zero increment": (message(1.0, WALL, increment=0.0), "angle_increment is 0"),
    "no beams": (message(1.0, []), ""),
    "a million beams": (
        message(1.0, np.ones(1_000_000), increment=1e-6),
        f"has 1000000 beams, expected 1 to {MOST_BEAMS}",
    ),
    "noise": (bytes(range(256)) * 4, ""),
    "behind the end": (message(1.0, WALL) + bytes(40), "behind its last field"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_message_that_makes_no_sense_is_counted_told_once_and_survived(name):
    data, why = BROKEN[name]
    report, sink, told = run(
        [received("bad", data)], [received("bad", data)], [wall("good", 1.0)], [wall("bad", 2.0)]
    )
    assert (report.total_scans, report.total_malformed) == (2, 2)
    assert [frame.scan.stamp for frame in sink.frames] == [1.0, 2.0]
    (line,) = told
    assert line.startswith("a scan of bad makes no sense: ")
    assert why in line
    assert "\n" not in line


def test_odometry_is_heard_and_never_a_scan():
    def odometry(twist):
        heard = Odometry(1.0, twist, (0.0, 0.0, 0.0), "odom", "base")
        return Received("o", lambda: heard, 0.0, is_odometry=True)

    sweep = ln.LaserScan(WALL, -0.5, 0.01, stamp=1.1, time_increment=0.001)
    scan = Received("a", lambda: sweep, 0.0)
    report, sink, told = run(
        [odometry((np.nan, 0.0, 0.0)), scan],
        [odometry((9.0, 9.0, 9.0)), odometry((1.0, 0.0, 0.0)), scan],
        config=LiveConfig(deskew="/odom"),
    )
    assert (report.total_scans, report.total_dropped, report.total_malformed) == (2, 0, 1)
    first, second = sink.frames
    assert first.straight is sweep
    np.testing.assert_allclose(second.straight.ranges, ln.deskew(sweep, (1.0, 0, 0)).ranges)
    assert told[0].startswith("an odometry of o makes no sense: its twist is")


def test_a_sweep_that_makes_no_sense_is_refused_and_survived():
    def scan(seconds):
        sweep = ln.LaserScan(WALL, -0.5, 0.01, stamp=1.1, time_increment=seconds)
        return Received("a", lambda: sweep, 0.0)

    heard = Odometry(1.0, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), "odom", "base")
    motion = Received("o", lambda: heard, 0.0, is_odometry=True)
    report, _, told = run([motion, scan(1e20)], [scan(0.001)], config=LiveConfig(deskew="/odom"))
    assert (report.total_scans, report.total_malformed) == (1, 1)
    assert told[0].startswith("a scan of a makes no sense: twist (1.0, 0.0, 0.0) for 1e+22 s")


def test_what_was_skipped_in_a_log_is_told_at_its_end(tmp_path):
    (tmp_path / "a.log").write_text("FLASER x\nFLASER 2 1 2 0 0 0 0 0 0 1 robot 1\n")
    source, told = ReplaySource(tmp_path / "a.log", rate=0, keep_going=True), []
    Node(source, Pipeline(LiveConfig()), [], tell=told.append).run()
    assert len(told) == 1
    assert told[0].startswith(f"skipped: {tmp_path / 'a.log'}:1: FLASER")


def test_publishers_that_come_and_go_are_told(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])

    def after(seconds):
        def batch():
            now[0] += seconds
            return []

        return batch

    publishers = [0, 0, 0, 1, 1, 2, 0, 0, 1]
    steps = [after(1.0) for _ in publishers]
    _, _, told = run(*steps, [], publishers=publishers)
    waiting = "no publisher of scans: waiting for one"
    assert told == [
        waiting, "1 publisher of scans", "2 publishers of scans", waiting, "1 publisher of scans",
    ]  # fmt: skip


def test_problems_of_the_source_are_told_once(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    source, told = Given(), []

    def batch():
        now[0] += 1.0
        source.said = ["a writer offers\nbest effort"]
        return []

    source.batches = [batch] * 4
    Node(source, Pipeline(LiveConfig()), [], tell=told.append).run()
    assert told == ["a writer offers\\nbest effort", "1 publisher of scans"]


def test_a_stop_ends_it():
    asked = iter([False, False, True])
    source = Given(*[[wall("a", float(i))] for i in range(10)])
    report = Node(source, Pipeline(LiveConfig()), []).run(lambda: next(asked))
    assert report.total_scans == 2


def test_tracks_are_kept_for_each_publisher():
    _, sink, _ = run(
        *[[wall("a", float(i)), wall("b", float(i))] for i in range(3)],
        config=LiveConfig(track=True),
    )
    # The same wall of two scanners: each has numbers of its own, which last.
    assert [frame.tracks.segments.tolist() for frame in sink.frames] == [[0]] * 6


def test_many_publishers_do_not_fill_the_memory():
    pipeline = Pipeline(LiveConfig())
    scan = ln.LaserScan(WALL, -0.5, 0.01)
    for i in range(100):
        assert len(pipeline(f"publisher {i}", scan).features.segments) == 1
    assert len(pipeline._lines) <= 8


def test_features_are_those_of_the_extractor(recorded_scans):
    pipeline = Pipeline(LiveConfig(method="iepf", noise=0.01))
    extractor = ln.Extractor("iepf", noise=ln.RangeNoise(sigma=0.01))
    for scan in recorded_scans[:5]:
        frame = pipeline("a", scan)
        np.testing.assert_array_equal(frame.features.segments, extractor(scan).segments)


def test_an_unknown_method_is_told_at_once():
    with pytest.raises(ValueError, match="houghton"):
        Pipeline(LiveConfig(method="houghton"))
    with pytest.raises(ValueError, match="evidenz"):
        Pipeline(LiveConfig(parameters={"evidenz": 3}))


def test_reports_worked_by_hand():
    counters = Counters(10.0)
    scan = ln.LaserScan([2.0, 2.0, np.nan, 2.0], 0.0, 0.01)
    features = ln.extract(ln.LaserScan(WALL, -0.5, 0.01))
    for latency in (0.001, 0.003, 0.002):
        counters.add(scan, features, latency)
    counters.dropped = 2
    report = counters.report(11.5, publishers=1, lost=4)
    assert (report.scans, report.rate, report.dropped, report.lost, report.level) == (3, 2, 2, 4, 1)
    assert report.latency == pytest.approx((0.002, 0.00298))
    assert report.invalid == 0.25
    assert report.features["segments"] == 1
    assert report.values["latency p50 [ms]"] == "2.000"
    counters.add(scan, features, 0.001)
    report = counters.report(12.5, publishers=1, lost=4)
    assert (report.scans, report.dropped, report.lost, report.level) == (1, 0, 0, 0)
    assert (report.total_scans, report.total_dropped, report.total_lost) == (4, 2, 4)
    assert report.totals == "4 scans, 2 dropped, 4 lost, 0 malformed messages"
    report = counters.report(13.5, publishers=0, lost=4)
    assert (report.level, str(report)) == (3, "no scans, 0 publishers")
    assert np.isnan(report.invalid)


def test_a_recorded_drive_is_played_whole(tmp_path, recorded_scans):
    save_npz(tmp_path / "log.npz", recorded_scans[:8])
    sink = Kept()
    source = ReplaySource(tmp_path / "log.npz", rate=0)
    report = Node(source, Pipeline(LiveConfig()), [sink]).run()
    assert report.total_scans == len(sink.frames) == 8
    assert len(sink.reports) >= 1
