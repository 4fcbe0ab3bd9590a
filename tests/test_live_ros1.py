"""ROS 1 against a real master and rospy's own nodes; skipped where rospy is not installed."""

from __future__ import annotations

import math
import signal
import struct
import sys
from collections.abc import Iterator

import pytest
from ros1_driving import ECHOES, SCAN, Peer, running_master, scan_of, until

import lineament as ln
from lineament import LineamentError
from lineament.live.received import Received
from lineament.live.ros1 import Ros1Node, Ros1Publisher, Ros1Source
from lineament.output.markers import markers_of
from lineament.output.ros_messages import RosMessages
from lineament.output.scene import Message, Moment, layers_of

# rospy leaves sockets open, calls what is deprecated, and takes any exception for a dead master.
pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning:ros"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]


@pytest.fixture(scope="module")
def master(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with running_master(tmp_path_factory.mktemp("ros")):
        yield


@pytest.fixture(scope="module")
def node(master: None) -> Iterator[Ros1Node]:  # noqa: ARG001
    node = Ros1Node("lineament_test")
    yield node
    node.close()


@pytest.fixture
def peer(master: None) -> Iterator[Peer]:  # noqa: ARG001
    peer = Peer("scanner")
    yield peer
    peer.close()


@pytest.fixture
def topic(request: pytest.FixtureRequest) -> str:
    """Name of a topic that no other test has."""
    return f"/{request.node.name}/scan"


def connected(peer: Peer, source: Ros1Source, topic: str, kind: str = SCAN, raw=False) -> None:
    peer.advertise(topic=topic, kind=kind, raw=raw)
    until(lambda: source.publishers and peer.connections(topic=topic))


def received(source: Ros1Source, n: int) -> list[Received]:
    """Take the next `n` messages."""
    found: list[Received] = []
    until(lambda: found.extend(source.receive(0.1)) or len(found) >= n)
    assert len(found) == n
    return found


def test_scan_of_a_genuine_publisher(node, peer, topic):
    source = Ros1Source(node, topic)
    connected(peer, source, topic)
    peer.publish(topic=topic, messages=[scan_of(intensities=[7.0, 8.0, 9.0])])
    (came,) = received(source, 1)
    scan = came.read()
    assert came.publisher == "/scanner"
    assert came.time == (12, 345_678_901)
    assert not came.is_odometry
    assert scan.ranges.tolist() == [1.0, 2.5, 0.0]
    assert scan.intensities.tolist() == [7.0, 8.0, 9.0]
    assert scan.frame_id == "laser"
    assert scan.stamp == pytest.approx(12.345678901)
    assert (scan.angle_min, scan.angle_increment) == (-0.5, 0.5)
    assert (scan.time_increment, scan.scan_time) == (0.25, 0.5)
    assert (scan.range_min, scan.range_max) == (0.125, 30.0)
    assert (source.lost, source.ended, source.problems()) == (0, False, [])
    source.close()
    until(lambda: not peer.connections(topic=topic))


def test_echo_that_is_asked_for(node, peer, topic):
    source = Ros1Source(node, topic, ECHOES, echo="strongest")
    connected(peer, source, topic, ECHOES)
    echoes = scan_of(ranges=[[1.0, 4.0], [], [2.0]], intensities=[[5.0, 6.0], [], [5.0]])
    peer.publish(topic=topic, messages=[echoes])
    (came,) = received(source, 1)
    assert came.read().ranges.tolist() == pytest.approx([4.0, math.nan, 2.0], nan_ok=True)
    source.close()


def test_odometry_comes_with_the_scans(node, peer, topic):
    source = Ros1Source(node, topic, odometry="/odom")
    connected(peer, source, topic)
    peer.advertise(topic="/odom", kind="nav_msgs/Odometry")
    until(lambda: peer.connections(topic="/odom"))
    turned = {"z": math.sin(0.25), "w": math.cos(0.25)}
    odometry = {
        "header": {"stamp": [3, 250_000_000], "frame_id": "odom"},
        "child_frame_id": "base",
        "pose": {"pose": {"position": {"x": 1.0, "y": 2.0}, "orientation": turned}},
        "twist": {"twist": {"linear": {"x": 0.5, "y": 0.25}, "angular": {"z": -1.5}}},
    }
    peer.publish(topic="/odom", messages=[odometry])
    (came,) = received(source, 1)
    assert came.is_odometry
    assert came.read() == (3.25, (0.5, 0.25, -1.5), pytest.approx((1.0, 2.0, 0.5)), "odom", "base")
    peer.publish(topic=topic, messages=[scan_of()])
    (came,) = received(source, 1)
    assert not came.is_odometry
    source.close()


def test_flood_of_one_publisher_leaves_the_scan_of_another(node, peer, topic):
    source = Ros1Source(node, topic, depth=3)
    connected(peer, source, topic)
    other = Peer("other")
    other.advertise(topic=topic, kind=SCAN)
    until(lambda: source.publishers == 2 and other.connections(topic=topic))
    other.publish(topic=topic, messages=[scan_of(stamp=(1, 0))])
    peer.publish(topic=topic, messages=[scan_of(stamp=(k, 0)) for k in range(50)])
    until(lambda: source.lost == 47)
    came = source.receive(0)
    assert sorted((one.publisher, one.time[0]) for one in came) == [
        ("/other", 1),
        ("/scanner", 47),
        ("/scanner", 48),
        ("/scanner", 49),
    ]
    other.close()
    source.close()


def raw_scan(number: int, ranges: list[float] | None = None) -> bytes:
    ranges = [1.0, 2.0] if ranges is None else ranges
    head = struct.pack("<IIII5s7f", number, 5, 0, 5, b"laser", 0, 1, 1, 0, 0, 0.1, 30)
    n = len(ranges)
    return head + struct.pack(f"<I{n}fI", n, *ranges, 0)


def test_gaps_in_the_numbers_are_lost_scans(node, peer, topic):
    source = Ros1Source(node, topic)
    connected(peer, source, topic, raw=True)
    # Three are missing; then another begins to count; then none is numbered.
    numbers = [7, 8, 12, 1, 2_000_000_000, 0, 0]
    peer.publish_raw(topic=topic, messages=[raw_scan(k).hex() for k in numbers])
    received(source, len(numbers))
    assert source.lost == 3
    source.close()


def test_garbage_is_told_in_one_line_and_survived(node, peer, topic):
    source = Ros1Source(node, topic)
    connected(peer, source, topic, raw=True)
    good = raw_scan(1)
    many = struct.pack("<I", 1_000_000)
    at = len(good) - 16
    garbage = [b"", b"\xff", good[:-5], good + b"12345", raw_scan(1, []), good[:at] + many]
    peer.publish_raw(topic=topic, messages=[data.hex() for data in (*garbage, good)])
    *bad, last = received(source, len(garbage) + 1)
    for one in bad:
        with pytest.raises(ValueError, match=r"^[ -~]+$"):
            one.read()
    assert last.read().ranges.tolist() == [1.0, 2.0]
    assert source.publishers == 1
    source.close()


def test_publisher_that_is_killed_is_waited_for(node, topic):
    source = Ros1Source(node, topic)
    for stamp in (1, 2):
        scanner = Peer("dying")
        connected(scanner, source, topic)
        scanner.publish(topic=topic, messages=[scan_of(stamp=(stamp, 0))])
        (came,) = received(source, 1)
        assert came.time == (stamp, 0)
        scanner.close()
        until(lambda: source.publishers == 0)
    assert source.lost == 0
    source.close()


def test_topic_of_another_type_is_told(node, peer, topic):
    peer.advertise(topic=topic, kind="sensor_msgs/PointCloud2")
    source = Ros1Source(node, topic)
    assert source.problems() == [
        f"{topic} is published as sensor_msgs/PointCloud2, expected sensor_msgs/LaserScan"
    ]
    until(lambda: not source.publishers)
    source.close()


def test_messages_are_read_by_a_genuine_listener(node, peer, topic):
    publisher = Ros1Publisher(node)
    scan = ln.LaserScan(
        [2.0, 2.0 / math.cos(0.25), 9.0],
        angle_min=0.0,
        angle_increment=0.25,
        range_max=8.0,
        frame_id="laser",
        stamp=5.5,
        pose=(1.0, 2.0, math.pi),
    )
    features = ln.extract(scan)
    make, moment = RosMessages("ros1"), Moment(5, 500_000_000, "laser", "map")
    layers = layers_of(markers_of(features, scan))
    sent = [
        make.scan(topic, moment, scan),
        make.transform("/tf", moment, scan.pose),
        make.features(f"{topic}/markers", moment, layers),
        make.corners(f"{topic}/corners", moment, features),
        make.cloud(f"{topic}/features", moment, features),
        make.diagnostics("/diagnostics", moment, "node", "laser", 1, "slow", {"rate": "9 Hz"}),
    ]
    for message in sent:
        assert publisher.listeners(message.topic) == 0
        publisher.advertise(message.topic, message.kind)
        peer.listen(topic=message.topic, kind=message.kind)
    until(lambda: all(publisher.listeners(message.topic) == 1 for message in sent))
    for message in sent:
        publisher.publish(message)
    found, transforms, markers, corners, cloud, diagnostics = (
        until(lambda message=message: peer.take(topic=message.topic))[0] for message in sent
    )
    for one in (found, corners, cloud, transforms["transforms"][0], markers["markers"][0]):
        assert one["header"]["stamp"] == [5, 500_000_000]
        assert one["header"]["frame_id"] == ("map" if "child_frame_id" in one else "laser")
    assert found["ranges"] == pytest.approx([2.0, 2.0 / math.cos(0.25), 9.0])
    moved = transforms["transforms"][0]["transform"]
    assert moved["translation"] == {"x": 1.0, "y": 2.0, "z": 0.0}
    assert moved["rotation"]["z"] == pytest.approx(1.0)
    assert {one["ns"] for one in markers["markers"]} == {layer.name for layer in layers}
    assert len(corners["poses"]) == len(features.corners)
    assert cloud["width"] == len(features.segments) + len(features.corners) + len(features.arcs)
    assert diagnostics["status"][0]["values"] == [{"key": "rate", "value": "9 Hz"}]
    assert publisher.unsent == 0
    publisher.close()


def test_listener_that_stands_still_delays_nobody(node, peer, topic):
    publisher = Ros1Publisher(node, depth=2)
    publisher.advertise(topic, "std_msgs/String")
    peer.listen(topic=topic, kind="std_msgs/String")
    until(lambda: publisher.listeners(topic))
    message = Message(topic, "std_msgs/String", struct.pack("<I", 1_000_000) + b"x" * 1_000_000)
    peer.process.send_signal(signal.SIGSTOP)
    for _ in range(50):
        publisher.publish(message)
    assert publisher.unsent > 0
    peer.process.send_signal(signal.SIGCONT)
    assert until(lambda: peer.take(topic=topic))
    publisher.close()


def test_type_that_ros_has_not(node, topic):
    with pytest.raises(LineamentError, match="ROS 1 has no nowhere_msgs/Nothing: its package"):
        Ros1Publisher(node).publish(Message(topic, "nowhere_msgs/Nothing", b""))


def test_master_that_has_gone_is_told(node, topic, monkeypatch):
    source = Ros1Source(node, topic)
    monkeypatch.setattr(node, "_uri", "http://127.0.0.1:1")
    (problem,) = source.problems()
    assert problem.startswith("the ROS master at http://127.0.0.1:1 does not answer")
    source.close()


@pytest.mark.parametrize("uri", ["nonsense", "http://127.0.0.1:1"])
def test_no_master(uri, monkeypatch):
    pytest.importorskip("rospy", reason="ROS 1 is not installed: rospy cannot be imported")
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    with pytest.raises(LineamentError, match=f"the ROS master at {uri} does not answer"):
        Ros1Node()


def test_name_that_is_none():
    pytest.importorskip("rospy", reason="ROS 1 is not installed: rospy cannot be imported")
    with pytest.raises(ValueError, match="name is 'a/b', expected letters, digits and _"):
        Ros1Node("a/b")


def test_without_rospy(monkeypatch):
    monkeypatch.setitem(sys.modules, "rosgraph", None)
    with pytest.raises(LineamentError, match="ROS 1 needs the package rosgraph, which is not"):
        Ros1Node()
