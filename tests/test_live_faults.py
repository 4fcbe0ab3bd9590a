"""`lineament live` where things go wrong: signals, garbage, what dies, what floods, what hangs."""

from __future__ import annotations

import math
import os
import re
import signal
import struct
from pathlib import Path

import pytest

pytest.importorskip("cyclonedds", reason="no cyclonedds for this Python")

from dds_driving import eventually
from dds_messages import cdr_scan, scan_message
from live_driving import heard, totals

pytestmark = pytest.mark.slow

#: What one says that has worked at nothing.
NOTHING = "0 scans, 0 dropped, 0 lost, 0 malformed messages\n"
STOPPED = ("stopped before the first scan\n", NOTHING)
WAITING = "no publisher of scans: waiting for one"
FEATURES = "rt/scan/features"


def stamps(messages: list[dict]) -> list[int]:
    return [message["header"]["stamp"]["sec"] for message in messages]


def until_heard(listener, topic, stamp, publish):
    """Publish again and again, until what is told of the scan with this stamp is heard."""
    eventually(lambda: publish() or stamp in stamps(listener("take", topic)), pause=0.05)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_though_nobody_publishes(started, number):
    node = started()
    node.until_it_says(WAITING)
    assert node.stop(number) == NOTHING
    assert node.said == ["lineament finds features on /scan by optimal", WAITING]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_while_it_starts(started, number):
    node = started()
    status = Path(f"/proc/{node.process.pid}/status")

    def is_handled() -> bool:
        caught = re.search(r"SigCgt:\s*(\w+)", status.read_text())
        # Python itself handles SIGINT, but not SIGTERM.
        return bool(int(caught[1], 16) >> (signal.SIGTERM - 1) & 1)

    eventually(is_handled)
    assert node.stop(number) in STOPPED


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_while_kernels_are_loaded(started, number):
    pytest.importorskip("foxglove", reason="no foxglove-sdk for this Python")
    node = started("--foxglove", 0)
    node.until_it_says("Foxglove: open a connection")
    assert node.stop(number) in STOPPED


def test_what_makes_no_sense_is_counted_and_survived(started, joined):
    good = cdr_scan()
    increment = 4 + 8 + 4 + 8 + 8  # behind the header and two of the geometry
    garbage = {
        "noise": b"\0\1\0\0" + random_bytes(400),
        "cut off": good[:-12],
        "too long": good + bytes(40),
        "big-endian, swapped": b"\0\0\0\0" + good[4:],
        "XCDR2": b"\0\7\0\0" + good[4:],
        "too many beams": good[:52] + struct.pack("<I", 2**32 - 1) + good[56:],
        "no beams": cdr_scan(2)[:52] + bytes(8),
        "NaN": good[:increment] + struct.pack("<f", math.nan) + good[increment + 4 :],
        "a million beams": cdr_scan(1_000_000),
    }
    faulty, sound = joined(), joined()
    # What is larger than the buffers of sockets comes reliably only.
    node = started("--reliability", "reliable")
    faulty("garble", "rt/scan", "LaserScan")
    sound("publish", "rt/scan", "LaserScan")
    sound("listen", FEATURES, "PointCloud2")
    sound("listen", "rt/diagnostics", "DiagnosticArray")
    for talker in (faulty, sound):
        eventually(lambda talker=talker: talker("listeners", "rt/scan") == 1)
    for number, data in enumerate(garbage.values(), 1):
        faulty("write_bytes", "rt/scan", data.hex())
        until_heard(
            sound, FEATURES, number, lambda n=number: sound("write", "rt/scan", scan_message(n))
        )

    def is_counted() -> bool:
        # One that came while the one before was not yet looked at has taken its place.
        found = totals(sound)
        assert found["malformed"] <= len(garbage)
        return found["malformed"] + found["dropped"] >= len(garbage)

    eventually(is_counted)
    assert totals(sound)["malformed"] >= len(garbage) - 1
    node.stop()
    (told,) = [line for line in node.said if "makes no sense" in line]
    assert re.fullmatch("a scan of [0-9a-f]+ makes no sense: .*", told)


def random_bytes(n: int) -> bytes:
    return bytes((37 * i * i + 11 * i) % 251 for i in range(n))


def test_publishers_are_worked_at_side_by_side_and_missed(started, joined):
    listener, first, second = joined(), joined(), joined("1s")
    node = started()
    listener("listen", FEATURES, "PointCloud2")
    for talker in (first, second):
        talker("publish", "rt/scan", "LaserScan")
    for stamp, talker in ((1, first), (2, second)):
        message = scan_message(stamp)
        until_heard(listener, FEATURES, stamp, lambda t=talker, m=message: t("write", "rt/scan", m))
    node.until_it_says("2 publishers of scans")
    second.kill()
    node.until_it_says("1 publisher of scans")
    first.close()
    node.until_it_says(WAITING)
    again = joined()
    again("publish", "rt/scan", "LaserScan")
    message = scan_message(3)
    until_heard(listener, FEATURES, 3, lambda: again("write", "rt/scan", message))
    node.until_it_says("1 publisher of scans", times=2)
    node.stop()
    assert node.said.count(WAITING) == 1


def test_a_node_that_was_killed_is_heard_again(started, peer):
    peer("publish", "rt/scan", "LaserScan")
    peer("listen", FEATURES, "PointCloud2")
    for number in (1, 2):
        node = started()
        message = scan_message(number)
        until_heard(peer, FEATURES, number, lambda m=message: peer("write", "rt/scan", m))
        node.kill()


def test_a_burst_is_accounted_for_and_leaves_no_memory(started, joined):
    talker, listener = joined(), joined()
    n, bursts = 1000, 3
    node = started("--depth", 1000)
    talker("publish", "rt/scan", "LaserScan")
    listener("listen", FEATURES, "PointCloud2", True, bursts * n)
    listener("listen", "rt/diagnostics", "DiagnosticArray")
    eventually(lambda: talker("listeners", "rt/scan") == 1)
    memory = []
    for _ in range(bursts):
        talker("write_scans", "rt/scan", n, 2000.0, 541)
        totals(listener)
        memory.append(node.memory)
    found = totals(listener)
    scans, *rest = map(int, re.findall(r"\d+", node.stop()))
    assert [scans, *rest] == [found[name] for name in ("scans", "dropped", "lost", "malformed")]
    assert found["malformed"] == 0
    # What a busy machine loses below DDS is not known to it.
    assert 0 < sum(found.values()) <= bursts * n
    came = stamps(listener("take", FEATURES))
    assert 0 < len(came) <= scans
    assert max(memory[1:]) - memory[0] < 10


def test_a_listener_that_stands_still_holds_nobody(started, joined):
    talker, still, listener = joined(), joined(), joined()
    node = started()
    talker("publish", "rt/scan", "LaserScan")
    for one in (still, listener):
        for name, kind in (("features", "PointCloud2"), ("markers", "MarkerArray")):
            one("listen", f"rt/scan/{name}", kind)
        until_heard(one, FEATURES, 0, lambda: talker("write", "rt/scan", scan_message(0)))
    os.kill(still.process.pid, signal.SIGSTOP)
    try:
        for number in range(1, 300):
            talker("write", "rt/scan", scan_message(number))
        message = scan_message(300)
        until_heard(listener, FEATURES, 300, lambda: talker("write", "rt/scan", message))
        heard(listener, "rt/scan/markers")
        node.stop()
    finally:
        os.kill(still.process.pid, signal.SIGCONT)
