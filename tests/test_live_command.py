"""`lineament live` as it is run: what it tells others, by what it is told."""

from __future__ import annotations

import base64
import socket
import time

import numpy as np
import pytest
from protobuf import decode, messages_of
from websocket import FoxgloveClient

pytest.importorskip("cyclonedds", reason="no cyclonedds for this Python")

from dds_messages import odometry_message
from live_driving import heard, message_of, points_of, scan_of, scene

import lineament as ln
from lineament.cli import run
from lineament.live.motion import twist_of_laser
from lineament.logs import save_npz
from lineament.output.feature_points import feature_points
from lineament.simulation import SENSORS, drive, room

BELOW = {"features": "PointCloud2", "corners": "PoseArray", "markers": "MarkerArray"}


def assert_same(cloud: dict, features: ln.Features) -> None:
    """What has come is to the bit what the library finds; tracks are seen to elsewhere."""
    points, expected = points_of(cloud), feature_points(features)
    assert points.dtype == expected.dtype
    for name in set(points.dtype.names) - {"track"}:
        np.testing.assert_array_equal(points[name], expected[name], err_msg=name)


@pytest.mark.slow
def test_what_is_found_is_told_with_the_stamp_of_the_scan(started, peer):
    node = started()
    for name, kind in BELOW.items():
        peer("listen", f"rt/scan/{name}", kind)
    peer("listen", "rt/diagnostics", "DiagnosticArray")
    peer("publish", "rt/scan", "LaserScan")
    message = message_of(scene())
    header, features = message["header"], ln.extract(scan_of(message))
    assert min(map(len, (features.segments, features.corners, features.arcs))) > 0

    def publish() -> None:
        peer("write", "rt/scan", message)

    cloud, poses, markers = (heard(peer, f"rt/scan/{name}", publish) for name in BELOW)
    assert cloud["header"] == poses["header"] == header
    assert_same(cloud, features)
    assert set(points_of(cloud)["track"]) == {-1}

    places = [(pose["position"]["x"], pose["position"]["y"]) for pose in poses["poses"]]
    np.testing.assert_array_equal(places, features.corners["position"])

    layers = {marker["ns"]: marker for marker in markers["markers"]}
    assert list(layers) == ["segments", "arcs", "corners", "edges", "ellipses"]
    assert all(layer["header"] == header for layer in layers.values())
    ends = [(point["x"], point["y"]) for point in layers["segments"]["points"]]
    np.testing.assert_array_equal(ends[::2], features.segments["start"])
    np.testing.assert_array_equal(ends[1::2], features.segments["end"])

    report = heard(peer, "rt/diagnostics", publish)
    (status,) = report["status"]
    assert (status["name"], status["hardware_id"]) == ("lineament: /scan", "/scan")
    assert abs(report["header"]["stamp"]["sec"] - time.time()) < 600
    assert node.stop().endswith(" 0 malformed messages\n")
    assert node.said[0] == "lineament finds features on /scan by optimal"


@pytest.mark.slow
def test_a_file_and_flags_that_go_before_it(started, peer, tmp_path):
    (tmp_path / "robot.toml").write_text("""
topic = "front/scan"
namespace = "robot1"
domain = 120
type = "MultiEchoLaserScan"
echo = "first"
method = "liu"
noise = 0.004
track = true
[parameters]
noise_factor = 99.0
min_points = 6
""")
    flags = ("--echo", "last", "-m", "iepf", "--set", "noise_factor=3.0")
    started("--config", tmp_path / "robot.toml", *flags)
    topic = "rt/robot1/front/scan"
    peer("publish", topic, "MultiEchoLaserScan")
    peer("listen", f"{topic}/features", "PointCloud2")
    message = message_of(scene())
    echoes = [{"echoes": [0.5, distance]} for distance in message["ranges"]]

    def publish() -> None:
        message["header"]["stamp"]["sec"] += 1
        peer("write", topic, {**message, "ranges": echoes})

    first, later = (heard(peer, f"{topic}/features", publish) for _ in range(2))
    noise = ln.RangeNoise(sigma=0.004)
    extractor = ln.Extractor("iepf", noise=noise, noise_factor=3.0, min_points=6)
    assert_same(first, extractor(scan_of(message)))
    # The sensor stands still: what it sees keeps its number.
    assert first["header"]["stamp"]["sec"] < later["header"]["stamp"]["sec"]
    numbers = points_of(first)["track"].tolist()
    assert sorted(numbers) == list(range(len(numbers)))
    assert points_of(later)["track"].tolist() == numbers


@pytest.mark.slow
def test_a_moving_scanner_is_made_straight_by_its_odometry(started, peer):
    started("--deskew", "odom", "--laser-pose", "0.2", "0.1", "0.5", "--namespace", "robot")
    for topic, kind in (("rt/robot/scan", "LaserScan"), ("rt/robot/odom", "Odometry")):
        peer("publish", topic, kind)
    peer("listen", "rt/robot/scan/features", "PointCloud2")
    message, odometry = message_of(scene(), time_increment=1e-4), odometry_message(1.5)
    odometry["header"]["stamp"] = message["header"]["stamp"]
    bent = scan_of(message)
    twist = twist_of_laser((1.5, -1.0, 0.25), (0.2, 0.1, 0.5))
    expected = ln.extract(ln.deskew(bent, twist))
    x = feature_points(expected)["x"].tolist()
    assert x != feature_points(ln.extract(bent))["x"].tolist()

    def publish() -> None:
        peer("write", "rt/robot/odom", odometry)
        peer("write", "rt/robot/scan", message)

    # The first scans may have come before the first odometry.
    while points_of(cloud := heard(peer, "rt/robot/scan/features", publish))["x"].tolist() != x:
        assert_same(cloud, ln.extract(bent))
    assert_same(cloud, expected)


@pytest.fixture
def log(tmp_path):
    """A drive of 4 s at 1 m/s, whose scanner takes 50 ms for a sweep, and names no frame."""
    scans = [
        ln.LaserScan(
            *(scan.ranges, scan.angle_min, scan.angle_increment),
            stamp=1000 + scan.stamp,
            time_increment=0.05 / len(scan),
            pose=scan.pose,
        )
        for scan in drive(room(), [(-2, 0), (2, 0)], SENSORS["lms181"], speed=1.0, rate=10)
    ]
    save_npz(tmp_path / "drive.npz", scans)
    return tmp_path / "drive.npz"


@pytest.mark.slow
def test_a_log_is_played_until_its_end(started, peer, log):
    kinds = {"rt/scan": "LaserScan", "rt/tf": "TFMessage", "rt/scan/features": "PointCloud2"}
    for topic, kind in kinds.items():
        peer("listen", topic, kind, True, 1000)
    node = started("--from", log, "--rate", "2")
    scans = list(ln.open_log(log))
    out = node.end()
    assert int(out.split()[0]) + int(out.split()[2]) == len(scans)
    told, links, clouds = (peer("take", topic) for topic in kinds)
    links = [link for message in links for link in message["transforms"]]

    by_stamp = {round(1e9 * scan.stamp): scan for scan in scans}
    for messages in (told, links, clouds):
        headers = [message["header"] for message in messages]
        stamps = [h["stamp"]["sec"] * 10**9 + h["stamp"]["nanosec"] for h in headers]
        # Who comes late misses the first, but the last comes before the node is gone.
        assert stamps == sorted(set(stamps))
        assert set(stamps) <= set(by_stamp)
        assert stamps[-1] == max(by_stamp)
    last = scans[-1]
    np.testing.assert_array_equal(told[-1]["ranges"], last.ranges.astype(np.float32))
    # /tf knows no frame without a name.
    assert told[-1]["header"]["frame_id"] == links[-1]["child_frame_id"] == "laser"
    place = links[-1]["transform"]["translation"]
    assert (place["x"], place["y"]) == last.pose[:2]
    assert_same(clouds[-1], ln.extract(last))


@pytest.mark.slow
def test_a_log_is_shown_in_foxglove(started, log):
    pytest.importorskip("foxglove", reason="no foxglove-sdk for this Python")
    node = started("--from", log, "--loop", "--ros", 0, "--foxglove", 0, "--deskew", "poses")
    node.until_it_says("Foxglove: open a connection to ws://127.0.0.1:")
    viewer = FoxgloveClient(int(node.said[0].rpartition(":")[2]))

    def take(topic: str) -> dict:
        viewer.subscribe(topic)
        channel = viewer.channels[topic]
        number, data = viewer.take_message()
        assert number == channel["id"]
        schema = messages_of(base64.b64decode(channel["schema"]))
        viewer.unsubscribe(topic)
        return decode(data, f".{channel['schemaName']}", schema)

    # What was made straight has irregular bearings: it is shown by its points.
    points = take("/scan/points")
    assert points["frame_id"] == "laser"
    assert len(points["data"]) == 12 * SENSORS["lms181"].n_beams
    viewer.close()
    viewer = FoxgloveClient(int(node.said[0].rpartition(":")[2]))
    scene_of_scan = take("/scan/features")
    entities = [entity["id"] for entity in scene_of_scan["entities"]]
    assert entities == ["segments", "arcs", "corners", "edges", "ellipses"]
    viewer.close()
    node.stop()


@pytest.mark.parametrize(
    ("arguments", "status", "text"),
    [
        (["--topic", "a b"], 2, "topic is 'a b', expected a name"),
        (["--topic", "1a"], 1, "topic is '/1a', expected a name as in ROS 2"),
        (["--ros", "3"], 2, "'--ros': 3 is not in the range"),
        (["--ros", "0"], 2, "ros is 0, which leaves nothing to listen to"),
        (["--rate", "nan"], 2, "rate is nan, expected 0 to"),
        (["--laser-pose", "nan", "0", "0"], 2, "laser_pose is (nan, 0.0, 0.0), expected three"),
        (["--deskew", "poses"], 2, "which only a log has"),
        (["--from", "a.log", "--deskew", "/odom"], 2, "but a log is played"),
        (["-m", "hough2"], 2, "method 'hough2' is unknown"),
        (["--set", "evidence"], 2, "expected NAME=VALUE"),
        (["--set", "evidence=x"], 2, "evidence is 'x', expected a number"),
        (["--set", f"evidence=1{'0' * 400}"], 2, "expected a number"),
        (["--set", "evidence={[]:1}"], 2, "expected a number"),
        (["--set", "noise=1"], 2, "method 'optimal' has no parameter 'noise'"),
        (["--set", "method=liu"], 2, "method 'optimal' has no parameter 'method'"),
        (["--from", "none.bag"], 1, "none.bag: there is no such file"),
        (["--config", "none.toml"], 1, "none.toml: cannot be read"),
        (["something"], 2, "got an unexpected argument 'something'"),
    ],
)
def test_wrong_use_is_told_in_a_line(domain, capfd, arguments, status, text):
    assert run(["live", "--localhost", "--domain", str(domain), *arguments]) == status
    out, err = capfd.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert text in err


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("topic = ", "is no TOML"),
        (f"a = {'[' * 5000}", "is no TOML"),
        (f"noise = {'9' * 5000}", "is no TOML"),
        (f"noise = {'9' * 400}", "expected 0 to 1000"),
        (f"laser_pose = [{'9' * 400}, 0, 0]", "expected three finite numbers"),
        ("parameters = 3", "parameters is 3, expected a table"),
        ("[parameters]\nnoise = 1", "method 'optimal' has no parameter 'noise'"),
        ('from = "a.log"', "has 'from', expected one of topic"),
    ],
)
def test_a_wrong_file_is_told_in_a_line(tmp_path, domain, capfd, content, text):
    (tmp_path / "a.toml").write_text(content)
    here = ["--localhost", "--domain", str(domain), "--set", "max_missing=4"]
    assert run(["live", "--config", str(tmp_path / "a.toml"), *here]) in (1, 2)
    out, err = capfd.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert text in err


def test_a_port_that_is_taken_is_told_in_a_line(log, capfd):
    pytest.importorskip("foxglove", reason="no foxglove-sdk for this Python")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert run(["live", "--from", str(log), "--ros", "0", "--foxglove", port]) == 1
    _, err = capfd.readouterr()
    assert err.startswith(f"lineament: Foxglove cannot be served at 127.0.0.1, port {port}: ")
    assert err.count("\n") == 1


def test_quiet_says_nothing(log, capfd):
    assert run(["live", "--from", str(log), "--ros", "0", "--rate", "0", "-q"]) == 0
    assert capfd.readouterr() == ("", "")
