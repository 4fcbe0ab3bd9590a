"""Topics of ROS 2 over DDS, with another process that has types of its own."""

from __future__ import annotations

import math
import os
import random
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
from ros_bags import store

pytest.importorskip("cyclonedds", reason="no cyclonedds for this Python")

from dds_driving import DEADLINE, PeerProcess, connected, eventually, receive
from dds_messages import cdr_scan, odometry_message, published, scan_message

from lineament.errors import LineamentError
from lineament.live.dds import DdsPublisher, DdsSource, Participant
from lineament.live.received import Odometry
from lineament.live.ros_names import HASHES
from lineament.output.scene import Message

SCAN = "sensor_msgs/msg/LaserScan"


@pytest.fixture
def participant(monkeypatch: pytest.MonkeyPatch) -> Iterator[Participant]:
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    # Domains above have ports that the system lends to others.
    with closing(Participant(random.SystemRandom().randint(1, 100), localhost=True)) as made:
        yield made


@pytest.fixture
def peer(participant: Participant) -> Iterator[PeerProcess]:
    with closing(PeerProcess(participant.domain)) as process:
        yield process


def test_hashes_are_those_of_ros():
    from rosbags.typesys import Stores, get_typestore

    for name in (Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY, Stores.LATEST):
        types = get_typestore(name)
        assert {kind: types.hash_rihs01(kind) for kind in HASHES} == HASHES


def test_scan(participant, peer):
    source = DdsSource(participant, "/scan")
    assert source.receive(0.0) == []
    connected(peer, source, "LaserScan")
    ranges = (1.0, math.inf, 2.5)
    peer("write", "rt/scan", scan_message(7, ranges))
    (received,) = receive(source)
    scan = received.read()
    np.testing.assert_array_equal(scan.ranges, ranges)
    assert (scan.stamp, scan.frame_id) == (7.5, "laser")
    assert received.time == (7, 500_000_000)
    assert (scan.angle_min, scan.angle_increment, scan.scan_time) == (-0.5, 0.25, 0.125)
    assert not received.is_odometry
    assert received.arrived <= time.monotonic()
    assert (source.publishers, source.lost, source.ended, source.problems()) == (1, 0, False, [])


def test_multi_echo(participant, peer):
    kind = "sensor_msgs/msg/MultiEchoLaserScan"
    source = DdsSource(participant, "/scan", kind, echo="last")
    connected(peer, source, "MultiEchoLaserScan")
    echoes = [{"echoes": [1.0, 4.0]}, {"echoes": []}, {"echoes": [2.0]}]
    peer("write", "rt/scan", {**scan_message(), "ranges": echoes})
    scan = receive(source)[0].read()
    np.testing.assert_array_equal(scan.ranges, [4.0, math.nan, 2.0])


def test_odometry_comes_before_the_scan(participant, peer):
    source = DdsSource(participant, "/scan", odometry="/odom")
    connected(peer, source, "LaserScan")
    connected(peer, source, "Odometry", "rt/odom")
    peer("write", "rt/scan", scan_message())
    peer("write", "rt/odom", odometry_message(0.5))
    eventually(lambda: source._scans.condition.triggered and source._topics[0].condition.triggered)
    first, second = source.receive(0.0)
    assert (first.is_odometry, second.is_odometry) == (True, False)
    odometry = first.read()
    assert isinstance(odometry, Odometry)
    assert (odometry.stamp, odometry.frame, odometry.child_frame) == (3.0, "odom", "base")
    assert odometry.twist == (0.5, -1.0, 0.25)
    assert odometry.pose == pytest.approx((1.0, 2.0, 0.5))
    peer("write", "rt/odom", odometry_message(math.nan))
    with pytest.raises(ValueError, match="expected finite numbers"):
        receive(source)[0].read()


def test_garbage_is_told_in_one_line(participant, peer):
    good = cdr_scan()
    swapped = b"\0\0\0\0" + cdr_scan(order=">")[4:]
    xcdr2 = b"\0\7\0\0" + good[4:]
    many = bytearray(good)
    many[52:56] = struct.pack("<I", 2**32 - 1)
    noise = random.Random(0)
    garbage = [swapped, xcdr2, bytes(many), b"\0\1\0\0\0\0\0\0"]
    garbage += [good[:length] for length in range(8, len(good), 4)]
    garbage += [b"\0\1\0\0" + noise.randbytes(4 * k) for k in range(1, 40)]

    source = DdsSource(participant, "/scan")
    peer("garble", "rt/scan", "LaserScan")
    eventually(lambda: peer("listeners", "rt/scan") == source.publishers == 1)
    for data in garbage:
        peer("write_bytes", "rt/scan", data.hex())
        (received,) = receive(source)
        with pytest.raises(ValueError, match=r"expected|ends|has ") as error:
            received.read()
        assert "\n" not in str(error.value)
    peer("write_bytes", "rt/scan", good.hex())
    assert len(receive(source)[0].read()) == 3
    assert source.lost == 0


def test_two_publishers(participant, peer):
    source = DdsSource(participant, "/scan")
    connected(peer, source, "LaserScan")
    with closing(PeerProcess(participant.domain)) as other:
        connected(other, source, "LaserScan")
        peer("write", "rt/scan", scan_message(1))
        other("write", "rt/scan", scan_message(2))
        names = {m.read().stamp: m.publisher for m in receive(source, 2)}
        assert set(names) == {1.5, 2.5}
        assert names[1.5] != names[2.5]
        assert source.publishers == 2
    # It has left, not vanished: this takes no lease.
    eventually(lambda: source.publishers == 1)


def test_killed_publisher_is_missed_and_found_again(participant):
    source = DdsSource(participant, "/scan")
    peer = PeerProcess(participant.domain, lease="1s")
    connected(peer, source, "LaserScan")
    peer("write", "rt/scan", scan_message(1))
    receive(source)
    peer.kill()
    eventually(lambda: source.publishers == 0)
    assert source.receive(0.0) == []
    with closing(PeerProcess(participant.domain)) as again:
        connected(again, source, "LaserScan")
        again("write", "rt/scan", scan_message(2))
        assert receive(source)[0].read().stamp == 2.5


def test_burst(participant, peer):
    source, n = DdsSource(participant, "/scan"), 2000
    connected(peer, source, "LaserScan")
    peer.begin("write_scans", "rt/scan", n, 2000.0, 1081)
    stamps = [m.read().stamp for m in receive(source)]
    while came := source.receive(2.0):
        stamps += [m.read().stamp for m in came]
    assert stamps == sorted(set(stamps))
    # What a busy machine drops below DDS is not known to it.
    assert 0 < len(stamps) <= n - source.lost


def test_what_finds_no_place_is_counted(participant, peer):
    source = DdsSource(participant, "/scan", depth=8)
    connected(peer, source, "LaserScan")
    peer("write_scans", "rt/scan", 50, 200.0, 10)
    eventually(lambda: source.lost == 42)
    assert [m.read().stamp for m in receive(source)] == list(range(8))
    assert source.receive(0.0) == []


def test_flood_of_a_million_beams_is_bounded(participant, peer):
    source = DdsSource(participant, "/scan", reliability="reliable", depth=2)
    peer("garble", "rt/scan", "LaserScan")
    eventually(lambda: peer("listeners", "rt/scan") == source.publishers == 1)
    data = cdr_scan(1_000_000).hex()
    for _ in range(5):
        peer("write_bytes", "rt/scan", data)
    received = receive(source)
    assert len(received) <= 2
    assert len(received[-1].read()) == 1_000_000


def test_other_reliability_is_told_once(participant, peer):
    source = DdsSource(participant, "/scan", reliability="reliable")
    peer("publish", "rt/scan", "LaserScan", False)
    lines: list[str] = []
    eventually(lambda: bool(lines.extend(source.problems()) or lines))
    assert lines == ["/scan is published as best effort, expected reliable"]
    assert source.problems() == []
    assert source.publishers == 0


def test_other_type_is_told(participant, peer):
    source = DdsSource(participant, "/scan")
    peer("publish", "rt/scan", "PoseArray")
    lines: list[str] = []
    eventually(lambda: bool(lines.extend(source.problems()) or lines))
    assert lines == [f"/scan is published as geometry_msgs/msg/PoseArray, expected {SCAN}"]


def test_published_messages_are_read_by_other_types(participant, peer):
    publisher = DdsPublisher(participant)
    for number, (kind, (message, has_come)) in enumerate(published().items()):
        topic = f"/made/number_{number}"
        peer("listen", "rt" + topic, kind.rpartition("/")[2])
        assert publisher.listeners(topic) == 0
        publisher.advertise(topic, kind)
        eventually(lambda topic=topic: publisher.listeners(topic) == 1)
        data = bytes(store(2).serialize_cdr(message, kind))
        publisher.publish(Message(topic, kind, data))
        came: list[dict] = []
        eventually(lambda topic=topic, came=came: came.extend(peer("take", "rt" + topic)) or came)
        assert len(came) == 1
        assert has_come(came[0]), kind
        assert peer("user_data", "rt" + topic) == [f"typehash={HASHES[kind]};"]
    assert publisher.unsent == 0


def test_reader_that_stands_still_holds_nobody_up(participant, peer):
    publisher = DdsPublisher(participant)
    publisher.advertise("/scan", SCAN)
    peer("listen", "rt/scan", "LaserScan")
    eventually(lambda: publisher.listeners("/scan") == 1)
    os.kill(peer.process.pid, signal.SIGSTOP)
    try:
        for n in range(200):
            publisher.publish(Message("/scan", SCAN, cdr_scan(100_000 + n)))
    finally:
        os.kill(peer.process.pid, signal.SIGCONT)
    # It has the newest, if nothing else.
    publisher.publish(Message("/scan", SCAN, cdr_scan(3)))
    sizes: list[int] = []
    eventually(
        lambda: sizes.extend(len(m["ranges"]) for m in peer("take", "rt/scan")) or 3 in sizes
    )
    assert len(sizes) + publisher.unsent <= 201


def test_listeners_and_publishers_leave(participant, peer):
    publisher, source = DdsPublisher(participant), DdsSource(participant, "/scan")
    connected(peer, source, "LaserScan")
    source.close()
    eventually(lambda: peer("listeners", "rt/scan") == 0)
    publisher.advertise("/out", SCAN)
    peer("listen", "rt/out", "LaserScan")
    eventually(lambda: publisher.listeners("/out") == 1)
    publisher.close()
    assert publisher.listeners("/out") == 0
    eventually(lambda: peer("user_data", "rt/out") == [])
    publisher.close()
    source.close()


def test_participant_takes_all_with_it(participant, peer):
    source = DdsSource(participant, "/scan")
    connected(peer, source, "LaserScan")
    participant.close()
    eventually(lambda: peer("listeners", "rt/scan") == 0)


@pytest.mark.parametrize("topic", ["", "/", "scan laser", "/a//b", "/1a", "/a/", "/é", "/a\n"])
def test_bad_topic(participant, topic):
    with pytest.raises(LineamentError, match="expected a name as in ROS 2") as error:
        DdsSource(participant, topic)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("domain", [-1, 233])
def test_bad_domain(domain):
    with pytest.raises(LineamentError, match=f"^domain is {domain}, expected 0 to 232$"):
        Participant(domain, localhost=True)


@pytest.mark.parametrize("text", ["x", "-1", "233", "1.0", "٣"])
def test_bad_domain_of_the_environment(monkeypatch, text):
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(LineamentError, match=f"^ROS_DOMAIN_ID is '{text}', expected 0 to 232$"):
        Participant(localhost=True)


def test_domain_of_the_environment(monkeypatch):
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    with closing(Participant(localhost=True)) as made:
        assert made.domain == 42


def test_configuration_of_the_environment_holds(monkeypatch, capfd):
    no_such = "<General><Interfaces><NetworkInterface name='none7'/></Interfaces></General>"
    monkeypatch.setenv("CYCLONEDDS_URI", f"<CycloneDDS><Domain>{no_such}</Domain></CycloneDDS>")
    with pytest.raises(LineamentError, match=r"^DDS cannot begin in domain 7"):
        Participant(7, localhost=True)
    assert "none7" in capfd.readouterr().err


PROGRAM = """
import signal, sys
from lineament.live.dds import *
signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
participant = Participant({domain}, localhost=True)
source, publisher = DdsSource(participant, "/scan", odometry="/odom"), DdsPublisher(participant)
publisher.advertise("/scan", "sensor_msgs/msg/LaserScan")
print("ready", flush=True)
{rest}
"""
AT_ONCE = ""
ON_SIGNAL = """
try:
    while True:
        source.receive(0.1)
finally:
    source.close()
    publisher.close()
    participant.close()
"""


@pytest.mark.parametrize("rest", [AT_ONCE, ON_SIGNAL])
def test_process_ends_cleanly(participant, rest):
    text = PROGRAM.format(domain=participant.domain, rest=rest)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", text], **pipes) as process:
        assert process.stdout.readline() == "ready\n"
        if rest:
            process.terminate()
        assert process.communicate(timeout=DEADLINE) == ("", "")
    assert process.returncode == 0
