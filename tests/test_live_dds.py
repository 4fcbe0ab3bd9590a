"""Topics of ROS 2 over DDS, against another participant that has types of its own."""

import math
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
from live_driving import (
    DEADLINE,
    Remote,
    cdr_scan,
    connected,
    eventually,
    garbage,
    odometry_message,
    received,
    scan_message,
    waited_for,
)
from ros_bags import store

pytest.importorskip("cyclonedds", reason="no cyclonedds for this Python")

from cyclonedds.core import Policy
from dds_peer import KINDS, Peer

from lineament.errors import LineamentError
from lineament.live import LiveConfig, dds, raw_dds
from lineament.live.dds import DdsPublisher, DdsSource
from lineament.live.participant import _HASHES, Participant, type_hash
from lineament.output.scene import Message

SCAN = "sensor_msgs/msg/LaserScan"
RELIABLE = Policy.Reliability.Reliable(10**10), Policy.History.KeepLast(4)


@pytest.fixture
def participant(peer: Peer, domain: int) -> Iterator[Participant]:  # noqa: ARG001
    with closing(Participant(domain)) as made:
        yield made


@pytest.fixture
def remote(domain: int) -> Iterator[Remote]:
    with closing(Remote("dds_peer", domain, "1s")) as process:
        yield process


def source_of(participant: Participant, depth: int = 64, **options: object) -> DdsSource:
    return DdsSource(participant, LiveConfig(**options), depth)


def test_hashes_are_those_of_ros():
    from rosbags.typesys import Stores, get_typestore

    assert set(KINDS) == set(_HASHES)
    for name in (Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY, Stores.LATEST):
        for kind, package in KINDS.items():
            full = f"{package}/msg/{kind}"
            assert get_typestore(name).hash_rihs01(full) == type_hash(full)


def test_scan(participant, peer):
    source = source_of(participant)
    assert source.receive(0.0) == []
    connected(peer, source, "/scan", "LaserScan")
    ranges = [1.0, math.inf, 2.5, 3.0]
    peer.write("/scan", scan_message(7, ranges))
    (came,) = received(source)
    scan = came.read()
    np.testing.assert_array_equal(scan.ranges, ranges)
    assert (scan.stamp, scan.frame_id) == (7.500000001, "laser")
    assert scan.stamp_ns == 7_500_000_001
    assert (scan.angle_min, scan.angle_increment, scan.scan_time) == (-0.75, 0.5, 0.125)
    assert came.what == "a scan"
    assert (source.publishers, source.lost, source.ended, source.problems()) == (1, 0, False, [])
    source_of(participant, topic="other")
    assert peer.listeners("/scan") == 1
    participant.close()
    eventually(lambda: peer.listeners("/scan") == 0)


def test_a_message_is_waited_for(participant, peer):
    source = source_of(participant)
    connected(peer, source, "/scan", "LaserScan")
    (came,) = waited_for(source.receive, lambda: peer.write("/scan", scan_message(7)))
    assert came.read().stamp == 7.500000001


def test_the_memory_of_each_message_is_given_back(participant, peer, monkeypatch):
    release, given = raw_dds._release, []

    def counting(message):
        given.append(message)
        release(message)

    monkeypatch.setattr(raw_dds, "_release", counting)
    source = source_of(participant)
    connected(peer, source, "/scan", "LaserScan")
    for k in range(3):
        before = len(given)
        peer.write("/scan", scan_message(k))
        assert len(received(source)) == 1
        assert len(given) == before + 1
        assert given[-1]


def test_odometry_comes_before_the_scan(participant, peer):
    source = source_of(participant, namespace="robot", deskew="odom", topic="/scan")
    connected(peer, source, "/scan", "LaserScan")
    peer.publish("/robot/odom", "Odometry")
    eventually(lambda: peer.listeners("/robot/odom") == 1)
    peer.write("/scan", scan_message())
    peer.write("/robot/odom", odometry_message(0.5, 3))
    eventually(lambda: all(topic.condition.triggered for topic in source._topics))
    first, second = source.receive(0.0)
    assert (first.what, second.what) == ("an odometry", "a scan")
    pose = pytest.approx((1.0, 2.0, 0.5))
    assert first.read() == (3.5, (0.5, -1.0, 0.25), pose, "odom", "base")
    peer.write("/robot/odom", odometry_message(math.nan))
    with pytest.raises(ValueError, match="expected finite numbers"):
        received(source)[0].read()


def test_a_scan_that_comes_meanwhile_waits_for_its_odometry(participant, peer, monkeypatch):
    source = source_of(participant, deskew="odom", topic="/scan")
    connected(peer, source, "/scan", "LaserScan")
    peer.publish("/odom", "Odometry")
    eventually(lambda: peer.listeners("/odom"))
    take, sent = raw_dds.RawReader.take_raw, []

    def interrupted(reader):
        """Take messages; both are sent after the first topic was looked at."""
        found = take(reader)
        if not sent:
            sent.append(peer.write("/odom", odometry_message(0.5)))
            peer.write("/scan", scan_message())
            time.sleep(0.1)
        return found

    monkeypatch.setattr(raw_dds.RawReader, "take_raw", interrupted)
    came = source.receive(0.0) + received(source)
    assert [one.what for one in came] == ["an odometry", "a scan"]


def test_garbage_comes_and_is_refused_in_one_line(participant, peer):
    good, noise = cdr_scan(), random.Random(0)
    messages = [data for name, data in garbage().items() if "beams" not in name]
    messages += [good[:length] for length in range(8, len(good), 4)]
    messages += [b"\0\1\0\0" + noise.randbytes(4 * k) for k in range(1, 40)]
    source = source_of(participant, depth=200)
    peer.garble("/scan", "LaserScan")
    eventually(lambda: peer.listeners("/scan") == source.publishers == 1)
    for data in (*messages, good):
        peer.write("/scan", data)
    *bad, last = received(source, len(messages) + 1)
    for one in bad:
        with pytest.raises(ValueError, match=r"^[ -~]+$"):
            one.read()
    assert len(last.read()) == 3
    assert (len(bad), source.lost) == (len(messages), 0)


@pytest.mark.slow
def test_a_publisher_that_is_killed_and_comes_again_beside_another(
    participant, peer, remote, domain
):
    source = source_of(participant)
    connected(remote, source, "/scan", "LaserScan")
    remote.write("/scan", scan_message(1))
    assert [int(m.read().stamp) for m in received(source)] == [1]
    remote.close()
    eventually(lambda: source.publishers == 0)  # when its lease has ended
    assert source.receive(0.0) == []  # its end is no message
    with closing(Remote("dds_peer", domain)) as again:
        for stamp, publisher in enumerate((peer, again)):
            connected(publisher, source, "/scan", "LaserScan")
            publisher.write("/scan", scan_message(stamp))
        names = {int(m.read().stamp): m.publisher for m in received(source, 2)}
    assert set(names) == {0, 1}
    assert names[0] != names[1]


@pytest.mark.slow
@pytest.mark.parametrize("reliability", ["best-effort", "reliable"])
def test_a_burst_is_accounted_for(participant, remote, reliability):
    source, n = source_of(participant, depth=8, reliability=reliability), 50
    connected(remote, source, "/scan", "LaserScan")
    remote.write_scans("/scan", n, 1e4, scan_message(0, [2.0] * 10))
    if reliability == "best-effort":  # drops the newest, and counts them
        eventually(lambda: source.lost == n - 8)
        assert [int(m.read().stamp) for m in received(source)] == list(range(8))
        assert source.receive(0.0) == []
    else:  # forgets the oldest
        stamps = [int(m.read().stamp) for m in received(source)]
        while stamps[-1] != n - 1:
            stamps += [int(m.read().stamp) for m in received(source)]
        assert stamps == sorted(set(stamps))


def test_a_flood_of_a_million_beams_is_bounded(participant, peer):
    source = source_of(participant, depth=2, reliability="reliable", limits={"beams": 1_000_000})
    peer.garble("/scan", "LaserScan")
    eventually(lambda: peer.listeners("/scan") == source.publishers == 1)
    for _ in range(5):
        peer.write("/scan", cdr_scan(1_000_000, increment=1e-6))
    assert [len(one.read()) for one in received(source)] == [1_000_000] * 2


@pytest.mark.parametrize(
    ("kind", "reliable", "problem"),
    [
        ("LaserScan", False, "as best effort, expected reliable"),
        ("PoseArray", True, f"as geometry_msgs/msg/PoseArray, expected {SCAN}"),
    ],
)
def test_what_keeps_scans_away_is_reported_once(participant, peer, kind, reliable, problem):
    source = source_of(participant, reliability="reliable")
    peer.publish("/scan", kind, reliable)
    assert eventually(source.problems) == [f"/scan is published {problem}"]
    assert (source.problems(), source.publishers) == ([], 0)


def test_publisher_is_known_by_the_hash_of_its_type(participant, peer):
    publisher = DdsPublisher(participant)
    for number, (kind, package) in enumerate(KINDS.items()):
        topic, full = f"/made/number_{number}", f"{package}/msg/{kind}"
        peer.listen(topic, kind)
        assert publisher.listeners(topic) == 0
        publisher.advertise(topic, full)
        eventually(lambda topic=topic: publisher.listeners(topic) == 1)
        eventually(lambda topic=topic: peer.user_data(topic))
        assert peer.user_data(topic) == [f"typehash={type_hash(full)};"]


def test_a_message_serialised_by_others_is_read_by_others(participant, remote):
    # What lineament itself makes of each type is read in test_live_command.
    types, kind = store(2).types, "diagnostic_msgs/msg/DiagnosticArray"
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](7, 5), "läser")
    pair = types["diagnostic_msgs/msg/KeyValue"]("rate", "9 Hz!")
    status = types["diagnostic_msgs/msg/DiagnosticStatus"](1, "n", "m", "h", [pair])
    data = bytes(store(2).serialize_cdr(types[kind](header, [status]), kind))
    assert len(data) % 4 != 0
    publisher = DdsPublisher(participant)
    publisher.advertise("/made", kind)
    remote.listen("/made", "DiagnosticArray")
    eventually(lambda: publisher.listeners("/made") == 1)
    publisher.publish(Message("/made", kind, data))
    (came,) = eventually(lambda: remote.take("/made"))
    assert came["header"] == {"stamp": {"sec": 7, "nanosec": 5}, "frame_id": "läser"}
    assert came["status"][0]["values"] == [{"key": "rate", "value": "9 Hz!"}]
    assert publisher.unsent == 0
    with pytest.raises(ValueError, match="message begins with '07070707', expected CDR"):
        publisher.publish(Message("/made", kind, b"\7\7\7\7"))


def test_messages_of_any_length_are_filled_to_a_word(participant):
    topic, qos = participant.topic("/made", SCAN), dds._qos(SCAN, *RELIABLE)
    writer = raw_dds.RawWriter(participant.entity, topic, qos)
    assert writer.listeners == 0
    reader = raw_dds.RawReader(participant.entity, topic, qos, 4)
    eventually(lambda: writer.listeners == 1)
    for n in range(1, 9):
        data = b"\0\1\0\0" + bytes(range(1, n + 1))
        assert writer.write_raw(data)
        ((came, _),) = eventually(reader.take_raw)
        assert came[4:] == data[4:] + bytes(-n % 4)


@pytest.mark.slow
def test_a_reader_that_stands_still_delays_nobody(participant, remote):
    publisher = DdsPublisher(participant)
    publisher.advertise("/scan", SCAN)
    remote.listen("/scan", "LaserScan")
    eventually(lambda: publisher.listeners("/scan") == 1)
    remote.signal(signal.SIGSTOP)
    for n in range(200):
        publisher.publish(Message("/scan", SCAN, cdr_scan(50_000 + n)))
    remote.signal(signal.SIGCONT)
    lost = publisher.unsent

    def is_sent() -> bool:
        before = publisher.unsent
        publisher.publish(Message("/scan", SCAN, cdr_scan(3)))
        return publisher.unsent == before

    # It has the newest that could be sent, if nothing else: while it wakes up, it may be slow.
    eventually(is_sent)
    sizes: list[int] = []
    eventually(lambda: sizes.extend(len(m["ranges"]) for m in remote.take("/scan")) or 3 in sizes)
    assert len(sizes) + lost <= 201


@pytest.mark.parametrize("topic", ["1a", "/a/2", "a/1b/c"])
def test_a_topic_that_ros_does_not_have(participant, topic):
    with pytest.raises(LineamentError, match="expected a name as in ROS 2"):
        source_of(participant, topic=topic)


@pytest.mark.parametrize("text", ["x", "-1", "233", "1.0", "٣"])
def test_a_domain_that_does_not_exist(monkeypatch, text):
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(LineamentError, match=f"^ROS_DOMAIN_ID is '{text}', expected 0 to 232$"):
        Participant(localhost=True)
    if text in ("-1", "233"):
        with pytest.raises(LineamentError, match=f"^domain is {text}, expected 0 to 232$"):
            Participant(int(text), localhost=True)


@pytest.mark.parametrize("number", [0, 232])
def test_the_first_and_the_last_domain(monkeypatch, number):
    monkeypatch.setattr("lineament.live.participant.DomainParticipant", lambda domain: domain)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    assert [Participant(number).entity, Participant().entity] == [number, number]


def test_the_environment_gives_domain_and_configuration(monkeypatch, domain, capfd):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    with closing(Participant(localhost=True)) as made:
        assert made.domain == domain
    no_such = "<General><Interfaces><NetworkInterface name='none7'/></Interfaces></General>"
    monkeypatch.setenv("CYCLONEDDS_URI", f"<CycloneDDS><Domain>{no_such}</Domain></CycloneDDS>")
    with pytest.raises(LineamentError, match=rf"^DDS cannot start in domain {domain}"):
        Participant(localhost=True)
    assert "none7" in capfd.readouterr().err


PROGRAM = """
from lineament.live import LiveConfig
from lineament.live.dds import DdsPublisher, DdsSource, Participant
participant = Participant({domain}, localhost=True)
source = DdsSource(participant, LiveConfig(deskew="/odom"))
publisher = DdsPublisher(participant)
publisher.advertise("/scan", "sensor_msgs/msg/LaserScan")
source.receive(0.01)
{end}
"""


@pytest.mark.slow
@pytest.mark.parametrize("end", ["", "participant.close()", "raise SystemExit(0)"])
def test_a_process_ends_cleanly(domain, end):
    text = PROGRAM.format(domain=domain, end=end)
    command = [sys.executable, "-c", text]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
