"""What a live node counts and reports, and where messages wait for it."""

import numpy as np
from live_driving import cdr_scan, received_scan, waited_for

import lineament as ln
from lineament.live import Received
from lineament.live.counters import Counters
from lineament.live.received import ODOMETRY, Inbox

BEARINGS = np.linspace(-0.5, 0.5, 101)


def test_reports_worked_by_hand():
    counters = Counters(10.0)
    scan = ln.LaserScan([2.0, 2.0, np.nan, 2.0], 0.0, 0.01)
    features = ln.extract(ln.LaserScan(2.0 / np.cos(BEARINGS), -0.5, 0.01))
    for latency in (0.001, 0.003, 0.002):
        counters.add(scan, features, latency)
    counters.dropped, counters.malformed = 2, 1
    report = counters.report(11.5, publishers=1, lost=4, unsent=5)
    assert (report.since, report.rate, report.level) == ((3, 2, 4, 1, 5), 2, 1)

    assert report.values == {
        "rate [1/s]": "2.00",
        "latency p50 [ms]": "2.000",
        "latency p99 [ms]": "2.980",
        "dropped": "2",
        "lost": "4",
        "malformed": "1",
        "unsent": "5",
        "invalid beams [%]": "25.0",
        **{f"{name} per scan": f"{n:.1f}" for name, n in features.counts().items()},
        "publishers": "1",
        "scans in all": "3",
        "dropped in all": "2",
        "lost in all": "4",
        "malformed in all": "1",
    }
    assert str(report).startswith(
        "2.0 scans/s, latency 2.00 ms (p99 2.98), 2 dropped, 4 lost, 1 malformed, "
        "25.0 % of beams invalid, per scan: 1.0 segments, 0.0 corners"
    )
    counters.add(scan, features, 0.001)
    report = counters.report(12.5, publishers=1, lost=4, unsent=5)
    assert (report.since, report.level) == ((1, 0, 0, 0, 0), 0)
    assert report.totals == "4 scans, 2 dropped, 4 lost, 1 malformed messages"
    assert report.taken == "4 scans, 6 came too fast"
    counters.add(scan, features, 0.001)
    assert counters.report(13.0, publishers=1, lost=4, unsent=6).level == 1
    report = counters.report(13.5, publishers=0, lost=4, unsent=6)
    assert (report.level, str(report)) == (3, "no scans, 0 publishers")
    assert np.isnan(report.invalid)
    assert counters.report(13.5, publishers=1).rate == 0.0


def test_a_message_is_read_when_it_is_processed():
    scan = received_scan("a", cdr_scan(5))
    assert (len(scan.read()), scan.read().stamp) == (5, 7.0)


def test_an_inbox_keeps_the_newest_of_each_publisher():
    inbox = Inbox(depth=2)
    for arrived, name in enumerate("aabaa"):
        inbox.put(Received(name, list, float(arrived)), missing=arrived == 2)
    for arrived in (0.5, 3.5, 9.0):
        inbox.put(Received("a", list, arrived, ODOMETRY))
    assert [one.arrived for one in inbox.take(0)] == [2.0, 3.0, 3.5, 4.0, 9.0]
    assert (inbox.lost, inbox.take(0)) == (3, [])
    for number in range(100):
        inbox.put(Received(f"{number}", list, 0.0))
    assert (len(inbox.take(0)), inbox.lost) == (64, 39)


def test_an_inbox_is_waited_for():
    inbox = Inbox(depth=2)
    (came,) = waited_for(inbox.take, lambda: inbox.put(Received("a", list, 1.0)))
    assert came.arrived == 1.0
