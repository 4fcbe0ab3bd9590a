"""Threads: one object that eight of them share gives each what it would give it alone."""

import signal
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from threading import Barrier

import numba
import numpy as np
import pytest
from test_copies import BEARINGS, WALLS, scans_of
from text_logs import flaser

from lineament import Extractor, LaserScan, Tracker, open_log, progress
from lineament.checks.claims import taking_turns, words_of
from lineament.checks.sound import difference
from lineament.mapping import LocalMap
from lineament.methods import get_method
from lineament.motion import Odometer
from lineament.output import open_writer

pytestmark = pytest.mark.slow

OTHERS = [LaserScan(x / np.cos(BEARINGS[:61]), angles=BEARINGS[:61]) for x in (2.0, 3.5)]


@pytest.fixture(autouse=True)
def _switching():
    with taking_turns():
        yield


def in_threads(work, count=8):
    """Run ``work(k)`` in so many threads that begin together; return the results."""
    barrier = Barrier(count)

    def begin(k):
        barrier.wait()
        return work(k)

    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(begin, range(count)))


def test_threads_share_an_extractor_in_batches_and_traces():
    rows = np.array([scan.ranges for scan in WALLS])
    fields = {"angles": BEARINGS, "range_max": 30.0}
    shared = Extractor("optimal")
    expected = [Extractor("optimal")(scan) for scan in WALLS]

    def work(k):
        for i in range(8):
            order = np.roll(np.arange(4), i * k)
            found = shared.batch(rows[order], **fields, workers=1 + k % 3)
            assert not any(difference(a, expected[j]) for a, j in zip(found, order, strict=True))
            trace = shared.trace(WALLS[k % 4])
            assert difference(trace.features, expected[k % 4]) == ""
            assert trace.filtered.tolist() == WALLS[k % 4].ranges.tolist()

    in_threads(work)


class Interrupted:
    """A method after whose kernels something else happens, before the features are copied out."""

    name, presets = "interrupted", ()

    def __init__(self):
        self.inner, self.after = get_method("liu"), []

    def own_arrays(self, beams):
        return self.inner.own_arrays(beams)

    def run(self, block):
        self.inner.run(block)
        if self.after:
            self.after.pop()()


def test_a_call_within_a_call_leaves_it_alone():
    method = Interrupted()
    extractor, expected = Extractor(method), [Extractor("liu")(scan) for scan in WALLS]
    inner = []
    for _ in range(2):  # without buffers from before, and with them
        method.after = [lambda: inner.append(extractor(WALLS[1]))]
        assert difference(extractor(WALLS[0]), expected[0]) == ""
        assert difference(inner.pop(), expected[1]) == ""
    rows = np.array([scan.ranges for scan in WALLS])
    fields = {"angles": BEARINGS, "range_max": 30.0}
    extractor.batch(rows, **fields)
    method.after = [lambda: inner.append(extractor.batch(rows[::-1], **fields))]
    found = extractor.batch(rows, **fields)
    assert not any(map(difference, found, expected))
    assert not any(map(difference, inner[0], expected[::-1]))


def test_a_signal_handler_calls_the_extractor_that_it_interrupts():
    method = Interrupted()
    extractor, inner = Extractor(method), []
    before = signal.signal(signal.SIGINT, lambda *_: inner.append(extractor(WALLS[1])))
    try:
        method.after = [lambda: signal.raise_signal(signal.SIGINT)]
        found = extractor(WALLS[0])
    finally:
        signal.signal(signal.SIGINT, before)
    assert difference(found, Extractor("liu")(WALLS[0])) == ""
    assert difference(inner[0], Extractor("liu")(WALLS[1])) == ""


def test_threads_that_compile_a_kernel_at_the_same_time():
    @numba.njit
    def turned(values):
        for i in range(len(values)):
            values[i] = -values[i]

    class Compiled(Interrupted):
        def run(self, block):
            turned(block.ranges[0])
            turned(block.ranges[0])
            self.inner.run(block)

    extractor, shown = Extractor(Compiled()), []
    with progress.compiling_said(shown.append):
        found = in_threads(lambda k: extractor(WALLS[k % 4]))
    expected = [Extractor("liu")(scan) for scan in WALLS]
    assert not any(difference(one, expected[k % 4]) for k, one in enumerate(found))
    assert progress.compiling_now() == ""
    assert (progress._compiler._open, progress._compiler._depth) == (0, 0)
    assert len(turned.overloads) == 1


def test_threads_share_a_tracker():
    """They all give it the same frame: whatever the order, only one of them sees tracks born."""
    features = Extractor()(WALLS[0])
    expected = Tracker()(features)
    assert len(expected.born) >= 1
    for _ in range(5):
        shared = [Tracker()] * 32
        found = in_threads(lambda k, shared=shared: [of(features) for of in shared[k::8]])
        found = list(chain(*found))
        born = np.concatenate([tracks.born for tracks in found])
        assert born.tolist() == expected.born.tolist()
        assert all(tracks.segments.tolist() == expected.segments.tolist() for tracks in found)


def test_threads_share_an_odometer_and_a_local_map():
    tracker, features = Tracker(), Extractor()(WALLS[0])
    tracker(features)
    tracks = tracker(features)
    odometer, local = Odometer(), LocalMap()

    def work(_):
        for k in range(50):
            odometer(tracks, float(k))
            local.add(features, tracks, (0.0, 0.0, 0.0))
            assert repr(local).startswith("LocalMap(")

    in_threads(work)
    alone, once = LocalMap(), Odometer()
    for _ in range(400):
        alone.add(features, tracks, (0.0, 0.0, 0.0))
        once(tracks, 1.0)
    assert words_of(local.query()) == words_of(alone.query())
    np.testing.assert_array_equal(odometer(tracks, 1.0).covariance, once(tracks, 1.0).covariance)


def test_threads_read_a_log(write):
    lines = [flaser([1.5, 2.5, x], stamp=x) for x in range(40)]
    log = open_log(write("FLASER 3 1.5 x\n".join(lines), "a.log"), keep_going=True)
    expected = scans_of(log)
    assert log.skipped == 39
    assert in_threads(lambda _: scans_of(log)) == [expected] * 8
    assert log.skipped == 39


def test_threads_share_a_scan_and_a_writer(tmp_path):
    scan = LaserScan(WALLS[0].ranges, float(BEARINGS[0]), 0.02)
    points = in_threads(lambda _: words_of(scan.points))
    assert points == [words_of(LaserScan(scan.ranges, scan.angle_min, 0.02).points)] * 8
    features = Extractor()(scan)
    path = tmp_path / "a.jsonl"
    with open_writer(path) as writer:
        in_threads(lambda _: [writer.write(features, scan) for _ in range(20)])
    lines = path.read_text().splitlines()
    assert len(lines) == 160
    assert len(set(lines)) == 160  # by the numbers of the scans
