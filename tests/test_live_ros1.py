"""ROS 1 against a real master and rospy's own nodes; skipped where rospy is not installed."""

import gc
import logging
import math
import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from importlib.machinery import PathFinder
from pathlib import Path

import numpy as np
import pytest
from live_driving import (
    DEADLINE,
    Remote,
    connected,
    eventually,
    heard,
    odometry_message,
    points_of,
    received,
    scan_message,
)
from robot_driving import (
    MOUNTING,
    driven,
    link_message,
    moment_of,
    off,
    placing,
    pose_of,
    written,
)

import lineament as ln
from lineament import LineamentError
from lineament.live import LiveConfig, Node, Pipeline, RosSink
from lineament.live.received import GUESS, MAP, ODOMETRY, RELOCATE
from lineament.live.received import SCAN as SCANS
from lineament.live.ros1 import Ros1Node, Ros1Publisher, Ros1Source
from lineament.output.feature_points import feature_points
from lineament.output.ros_messages import RosMessages
from lineament.output.scene import Message
from lineament.scan.poses import compose
from lineament.tasks.warmup import warm_up

# rospy leaves sockets open, and calls what is deprecated.
pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture(autouse=True)
def _sockets_of_rospy() -> Iterator[None]:
    """Let go of the sockets that rospy leaves open here, where no warning of them counts."""
    yield
    gc.collect()


#: Where Debian installs rospy, for the Python that it has.
DEBIAN = Path("/usr/lib/python3/dist-packages")
SCAN = "sensor_msgs/LaserScan"


@pytest.fixture(scope="module")
def rospy() -> Iterator[None]:
    """Make rospy importable, here and in child processes, where it is installed."""
    with pytest.MonkeyPatch.context() as patch:
        # By the path alone: a module that an earlier fixture loaded is not there for children.
        if PathFinder.find_spec("rospy") is None and (DEBIAN / "rospy").is_dir():
            patch.setattr(sys, "path", [*sys.path, str(DEBIAN)])
        pytest.importorskip("rospy", reason="ROS 1 is not installed: see make ros1")
        yield
        # Its files of what all loggers say are not for the tests that follow.
        for handler in logging.getLogger().handlers[:]:
            if not type(handler).__module__.startswith("_pytest"):
                logging.getLogger().removeHandler(handler)
                handler.close()


@pytest.fixture(scope="module")
def master(rospy: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:  # noqa: ARG001
    """Run a master that this process and its children find."""
    rosmaster = shutil.which("rosmaster") or pytest.skip("ROS 1 is not installed: no rosmaster")
    with pytest.MonkeyPatch.context() as patch:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        patch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{port}")
        patch.setenv("ROS_HOSTNAME", "127.0.0.1")
        patch.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros")))

        def is_open() -> bool:
            with socket.socket() as client:
                return client.connect_ex(("127.0.0.1", port)) == 0

        with subprocess.Popen([rosmaster, "--core", "-p", str(port)]) as process:
            try:
                eventually(is_open, pause=0.05)
                yield
            finally:
                process.kill()


@pytest.fixture(scope="module")
def node(master: None) -> Iterator[Ros1Node]:  # noqa: ARG001
    with closing(Ros1Node("lineament_test")) as node:
        yield node
        assert not node.ended
    assert node.ended


@pytest.fixture(scope="module")
def scanner(master: None) -> Iterator[Remote]:  # noqa: ARG001
    """A node of rospy in another process, that the tests share."""
    with closing(Remote("ros1_peer", "scanner")) as peer:
        yield peer


@pytest.fixture
def peer(master: None) -> Iterator[Remote]:  # noqa: ARG001
    """Another node, that may be killed or stopped."""
    with closing(Remote("ros1_peer", "other")) as peer:
        yield peer


@pytest.fixture
def topic(request: pytest.FixtureRequest) -> str:
    """Name of a topic that no other test has."""
    return f"/{request.node.name}/scan"


def test_scan_of_a_genuine_publisher(node, scanner, topic):
    source = Ros1Source(node, LiveConfig(topic=topic))
    connected(scanner, source, topic, SCAN)
    scanner.write(topic, {**scan_message(12, [1.0, 2.5, 0.0]), "intensities": [7.0, 8.0, 9.0]})
    (came,) = received(source, 1)
    scan = came.read()
    assert (came.publisher, scan.stamp_ns, came.what) == ("/scanner", 12_500_000_001, SCANS)
    assert scan.ranges.tolist() == [1.0, 2.5, 0.0]
    assert scan.intensities.tolist() == [7.0, 8.0, 9.0]
    assert (scan.angle_min, scan.angle_increment) == (-0.75, 0.75)
    assert (source.lost, source.ended, source.problems()) == (0, False, [])


def test_echo_that_is_asked_for(node, scanner, topic):
    kind = "MultiEchoLaserScan"
    source = Ros1Source(node, LiveConfig(topic=topic, type=kind, echo="strongest"))
    connected(scanner, source, topic, f"sensor_msgs/{kind}")
    ranges = [{"echoes": [1.0, 4.0]}, {"echoes": []}, {"echoes": [2.0]}]
    intensities = [{"echoes": [5.0, 6.0]}, {"echoes": []}, {"echoes": [5.0]}]
    scanner.write(topic, {**scan_message(), "ranges": ranges, "intensities": intensities})
    (came,) = received(source, 1)
    assert came.read().ranges.tolist() == pytest.approx([4.0, math.nan, 2.0], nan_ok=True)


def test_odometry_comes_with_the_scans(node, scanner, topic):
    source = Ros1Source(node, LiveConfig(topic=topic, deskew="/odom"))
    connected(scanner, source, topic, SCAN)
    scanner.publish("/odom", "nav_msgs/Odometry")
    eventually(lambda: scanner.listeners("/odom"))
    scanner.write("/odom", odometry_message(0.5, 3))
    scanner.write(topic, scan_message())
    odometry, scan = sorted(received(source, 2), key=lambda one: one.what == SCANS)
    assert (odometry.what, scan.what) == (ODOMETRY, SCANS)
    pose = pytest.approx((1.0, 2.0, 0.5))
    assert odometry.read() == (3.5, (0.5, -1.0, 0.25), pose, "odom", "base")


def test_a_flood_of_one_publisher_leaves_the_scan_of_another(node, scanner, peer, topic):
    source = Ros1Source(node, LiveConfig(topic=topic, depth=3))
    connected(scanner, source, topic, SCAN)
    connected(peer, source, topic, SCAN)
    peer.write(topic, scan_message(1))
    scanner.write(topic, *(scan_message(k) for k in range(50)))
    eventually(lambda: source.lost == 47 and len(source._inbox._waiting) == 2)
    came = sorted((one.publisher, int(one.read().stamp)) for one in source.receive(0))
    assert came == [("/other", 1), ("/scanner", 47), ("/scanner", 48), ("/scanner", 49)]


def raw_scan(number: int, ranges: tuple[float, ...] = (1.0, 2.0), *, seconds: int = 5) -> bytes:
    head = struct.pack("<IIII5s7f", number, seconds, 0, 5, b"laser", 0, 1, 1, 0, 0, 0.1, 30)
    return head + struct.pack(f"<I{len(ranges)}fI", len(ranges), *ranges, 0)


def test_gaps_in_the_numbers_are_lost_scans(node, scanner, topic):
    source = Ros1Source(node, LiveConfig(topic=topic))
    connected(scanner, source, topic, SCAN, True)
    # Three are missing; then another begins to count; then none is numbered.
    numbers = [7, 8, 12, 1, 2_000_000_000, 0, 0]
    scans = [raw_scan(number, seconds=k) for k, number in enumerate(numbers)]
    scanner.write(topic, *scans)
    received(source, len(numbers))
    assert source.lost == 3


def test_garbage_comes_and_is_refused_in_one_line(node, scanner, topic):
    source = Ros1Source(node, LiveConfig(topic=topic))
    connected(scanner, source, topic, SCAN, True)
    good = raw_scan(1)
    many = good[:-16] + struct.pack("<I", 1_000_000)
    garbage = [b"", b"\xff", good[:-5], good + b"12345", raw_scan(1, ()), many]
    scanner.write(topic, *garbage, good)
    *bad, last = received(source, len(garbage) + 1)
    for one in bad:
        with pytest.raises(ValueError, match=r"^[ -~]+$"):
            one.read()
    assert last.read().ranges.tolist() == [1.0, 2.0]
    assert source.publishers == 1


@pytest.mark.slow
def test_a_publisher_that_is_killed_is_waited_for(node, topic):
    source = Ros1Source(node, LiveConfig(topic=topic))
    for stamp in (1, 2):
        with closing(Remote("ros1_peer", "dying")) as dying:
            connected(dying, source, topic, SCAN)
            dying.write(topic, scan_message(stamp))
            (came,) = received(source, 1)
            assert int(came.read().stamp) == stamp
        eventually(lambda: source.publishers == 0)
    assert source.lost == 0


def test_a_map_a_guess_and_a_call_as_map_server_rviz_and_amcl_have_them(node, scanner, topic):
    """The map was sent before the node came: it is latched, as map_server's is."""
    info = {"resolution": 0.5, "width": 3, "height": 2, "origin": {"position": {"x": -1.0}}}
    scanner.publish(f"{topic}/map", "nav_msgs/OccupancyGrid", False, True)
    scanner.write(f"{topic}/map", {"info": info, "data": [0, 100, -1, 0, 0, 0]})
    config = LiveConfig(topic=topic, map=f"{topic}/map", namespace=topic)
    with closing(Ros1Source(node, config)) as source:
        (came,) = received(source, 1)
        assert (came.what, came.read().cells.tolist()) == (MAP, [[0, 100, -1], [0, 0, 0]])
        assert came.read().resolution == 0.5
        placed = "geometry_msgs/PoseWithCovarianceStamped"
        guess = f"{topic}/initialpose"
        scanner.publish(guess, placed)
        eventually(lambda: scanner.listeners(guess))
        scanner.write(
            guess, {"header": {"frame_id": "map"}, "pose": {"pose": {"position": {"x": 2.0}}}}
        )
        (came,) = received(source, 1)
        assert came.what == GUESS
        (pose,) = came.read()
        assert pose.pose[:2] == (2.0, 0.0)
        scanner.call(f"{topic}/global_localization", "std_srvs/Empty")
        (came,) = received(source, 1)
        assert (came.what, came.read()) == (RELOCATE, None)
    assert not node.ended
    eventually(lambda: not scanner.listeners(guess))


def test_a_robot_on_a_plan_is_placed_for_a_genuine_listener(node, peer, topic, tmp_path):
    """As nav2's predecessor, move_base, has it: by `amcl_pose`, and `map` → `odom` on `/tf`."""
    links, placed = "tf2_msgs/TFMessage", "geometry_msgs/PoseWithCovarianceStamped"
    plan = written(tmp_path / "own.dxf", 1)
    config = LiveConfig(topic=topic, map=plan, namespace=topic)
    peer.publish("/tf_static", links, False, True)
    peer.write("/tf_static", link_message(0.0, "base_link", "laser", MOUNTING))
    peer.publish("/tf", links)
    peer.publish(topic, SCAN)
    peer.listen("/tf", links)
    peer.listen(f"{topic}/amcl_pose", placed)
    publisher = Ros1Publisher(node)
    sink = RosSink(publisher, RosMessages("ros1"), config)
    stopped = threading.Event()
    with (
        closing(Ros1Source(node, config)) as source,
        ThreadPoolExecutor(1) as pool,
        ExitStack() as stack,
    ):
        stack.callback(stopped.set)
        running = pool.submit(Node(source, Pipeline(config), [sink]).run, stopped.is_set)
        eventually(lambda: peer.listeners("/tf") > 1 and peer.listeners(topic))
        found, *_ = eventually(placing(peer, topic, driven(1, 150)), pause=0.1)
        pose = heard(peer, f"{topic}/amcl_pose")
        stopped.set()
        assert running.result(DEADLINE).total.malformed == 0
    peer.close()  # Other tests are not to have it as a listener.
    eventually(lambda: not publisher.listeners("/tf"))
    placed = pose["pose"]["pose"]
    assert (found["header"]["frame_id"], found["child_frame_id"]) == ("map", "odom")
    moment = moment_of(found, later=1.0)
    assert off(compose(pose_of(found["transform"]), moment.believed), moment.base)[0] < 0.05
    assert pose["header"]["frame_id"] == "map"
    base = pose_of({"translation": placed["position"], "rotation": placed["orientation"]})
    assert off(base, moment_of(pose).base)[0] < 0.05
    assert pose["pose"]["covariance"][0] > 0


def test_what_keeps_scans_away_is_reported(node, scanner, topic, monkeypatch):
    scanner.publish(topic, "sensor_msgs/PointCloud2")
    source = Ros1Source(node, LiveConfig(topic=topic))
    problem = f"{topic} is published as sensor_msgs/PointCloud2, expected {SCAN}"
    assert source.problems() == [problem]
    eventually(lambda: not source.publishers)
    monkeypatch.setattr(node, "_uri", "http://127.0.0.1:1")
    (problem,) = source.problems()
    assert problem.startswith("the ROS master at http://127.0.0.1:1 does not answer")


def test_messages_are_read_by_a_genuine_listener(node, scanner, topic):
    # What each message holds is tested in test_ros_messages.
    config = LiveConfig(topic=topic, log="played.npz", dock=(2.0, 1.0))
    publisher = Ros1Publisher(node)
    sink = RosSink(publisher, RosMessages("ros1"), config)
    kinds = {
        topic: SCAN,
        "/tf": "tf2_msgs/TFMessage",
        f"{topic}/markers": "visualization_msgs/MarkerArray",
        f"{topic}/corners": "geometry_msgs/PoseArray",
        f"{topic}/features": "sensor_msgs/PointCloud2",
        f"{topic}/odometry": "nav_msgs/Odometry",
        f"{topic}/dock": "geometry_msgs/PoseWithCovarianceStamped",
    }
    for name, kind in kinds.items():
        assert publisher.listeners(name) == 0
        scanner.listen(name, kind)
    eventually(lambda: all(publisher.listeners(name) == 1 for name in kinds))
    fields = {"range_max": 8.0, "stamp": 5.5, "frame_id": "laser", "pose": (1.0, 2.0, math.pi)}
    bearings = np.linspace(-0.5, 1.2, 400)
    ranges = np.minimum(2 / np.cos(bearings), 1 / np.maximum(np.sin(bearings), 1e-9))
    step = bearings[1] - bearings[0]
    frame = Pipeline(config)("a", ln.LaserScan(ranges, -0.5, step, **fields))
    sink.publish(frame)
    found, transforms, markers, corners, cloud, odometry, dock = (
        heard(scanner, name) for name in kinds
    )
    place = dock["pose"]["pose"]["position"]
    assert (place["x"], place["y"]) == pytest.approx((2.0, 1.0), abs=1e-3)
    assert dock["pose"]["covariance"][35] > 0
    assert (odometry["header"]["frame_id"], odometry["child_frame_id"]) == ("odom", "laser")
    assert (
        odometry["twist"]["covariance"] == np.diag([2500.0, 2500, 0, 0, 0, 2500]).ravel().tolist()
    )
    (transform,) = transforms["transforms"]
    for one in (found, corners, cloud, dock, transform, markers["markers"][0]):
        assert one["header"]["stamp"] == {"sec": 5, "nanosec": 500_000_000}
        assert one["header"]["frame_id"] == ("map" if one is transform else "laser")
    assert points_of(cloud).tobytes() == feature_points(frame.features).tobytes()
    assert publisher.unsent == 0


def test_a_listener_that_stands_still_delays_nobody(node, peer, topic):
    publisher = Ros1Publisher(node, depth=2)
    publisher.advertise(topic, "std_msgs/String")
    peer.listen(topic, "std_msgs/String")
    eventually(lambda: publisher.listeners(topic))
    message = Message(topic, "std_msgs/String", struct.pack("<I", 1_000_000) + b"x" * 1_000_000)
    peer.signal(signal.SIGSTOP)
    for _ in range(50):
        publisher.publish(message)
    assert publisher.unsent > 0
    peer.signal(signal.SIGCONT)
    assert heard(peer, topic)


def test_a_type_that_ros_does_not_have(node, topic):
    with pytest.raises(LineamentError, match="ROS 1 has no nowhere_msgs/Nothing: its package"):
        Ros1Publisher(node).publish(Message(topic, "nowhere_msgs/Nothing", b""))


@pytest.mark.usefixtures("rospy")
@pytest.mark.parametrize("uri", ["nonsense", "http://127.0.0.1:1"])
def test_no_master(uri, monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    with pytest.raises(LineamentError, match=f"the ROS master at {uri} does not answer"):
        Ros1Node()


@pytest.mark.usefixtures("rospy")
def test_a_name_that_ros_does_not_have():
    with pytest.raises(ValueError, match="name is 'a/b', expected letters, digits and _"):
        Ros1Node("a/b")


def test_without_rospy(monkeypatch):
    monkeypatch.setitem(sys.modules, "rosgraph", None)
    with pytest.raises(LineamentError, match="ROS 1 needs the package rosgraph, which is not"):
        Ros1Node()


#: A node in a process of its own, which is where it can end: it says when it is up, waits for a
#: listener or to be ended, then for a line of input.
NODE = """
from lineament.live import LiveConfig
from lineament.live.ros1 import Ros1Node, Ros1Publisher, Ros1Source
from lineament.output.scene import Message
import time
node = Ros1Node("another")
source, publisher = Ros1Source(node, LiveConfig(topic="/nothing")), Ros1Publisher(node)
publisher.advertise("/out", "std_msgs/String")
print("up", flush=True)
while not publisher.listeners("/out") and not source.ended:
    time.sleep(0.05)
print("ended" if source.ended else "heard", flush=True)
sys.stdin.readline()
for _ in range(20):
    publisher.publish(Message("/out", "std_msgs/String", b"\\0\\0\\x10\\0" + b"x" * 0x100000))
print(*source.problems(), flush=True)
node.close()
print("closed", flush=True)
"""

#: The command.
LIVE = """
from lineament.cli import run
sys.exit(run(["live", "--ros", "1", "--topic", "/whole/scan", "__log:=x"]))
"""


@pytest.fixture
def program(master: None) -> Iterator[subprocess.Popen]:  # noqa: ARG001
    """Start a program with the path of this process; it is killed at the end."""
    processes = []

    def start(code: str) -> subprocess.Popen:
        command = [sys.executable, "-c", f"import sys\nsys.path[:] = {sys.path}\n{code}"]
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        processes.append(subprocess.Popen(command, **pipes, text=True))
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.communicate()


@pytest.mark.slow
@pytest.mark.parametrize("listens", [False, True])
def test_a_node_ends_when_it_is_replaced_or_though_a_listener_stands_still(program, listens):
    node = program(NODE)
    assert node.stdout.readline() == "up\n"
    with closing(Remote("ros1_peer", "other" if listens else "another")) as peer:
        if listens:
            peer.listen("/out", "std_msgs/String")
            assert node.stdout.readline() == "heard\n"
            peer.signal(signal.SIGSTOP)
        output, _ = node.communicate(timeout=DEADLINE)
    assert output.endswith("closed\n" if listens else "ended\n\nclosed\n")
    assert node.returncode == 0


@pytest.mark.slow
def test_the_command_from_scan_to_features(program, scanner):
    warm_up(["optimal"])  # The program should not wait for a compiler.
    live = program(LIVE)
    below = {"features": "sensor_msgs/PointCloud2", "markers": "visualization_msgs/MarkerArray"}
    for name, kind in below.items():
        scanner.listen(f"/whole/scan/{name}", kind)
    scanner.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    scanner.publish("/whole/scan", SCAN)
    wall = scan_message(12, [2 / math.cos(bearing) for bearing in (-0.75, 0.0, 0.75)])

    def publish() -> None:
        assert live.poll() is None
        scanner.write("/whole/scan", wall)

    cloud, markers = (heard(scanner, f"/whole/scan/{name}", publish) for name in below)
    for message in (cloud, markers["markers"][0]):
        assert message["header"]["stamp"] == {"sec": 12, "nanosec": 500_000_001}
        assert message["header"]["frame_id"] == "laser"
    (status,) = heard(scanner, "/diagnostics")["status"]
    assert status["name"] == "lineament: /whole/scan"
    os.kill(live.pid, signal.SIGTERM)
    output, errors = live.communicate(timeout=DEADLINE)
    assert (live.returncode, output.count("\n")) == (0, 1)
    assert " lost, 0 malformed messages\n" in output
    assert "1 publisher of scans" in errors
