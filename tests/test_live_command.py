"""`lineament live` as a whole: what others hear of it, its options, and how it ends."""

import gc
import math
import re
import signal
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from live_driving import Running, eventually, heard, points_of, scan_message, scan_of, scene

import lineament as ln
from lineament.cli import run
from lineament.live import Counts, LiveConfig, Report, run_live
from lineament.live.running import _is_for_foxglove_alone
from lineament.logs import save_npz
from lineament.output.feature_points import feature_points
from lineament.simulation import SENSORS, drive, room

BELOW = {"features": "PointCloud2", "corners": "PoseArray", "markers": "MarkerArray"}


@pytest.fixture
def log(tmp_path: Path) -> str:
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
    return str(tmp_path / "drive.npz")


def assert_same(cloud: dict, features: ln.Features) -> None:
    """A cloud holds, to the bit, what the library finds; tracks are compared elsewhere."""
    points, expected = points_of(cloud), feature_points(features)
    assert points.dtype == expected.dtype
    for name in set(points.dtype.names) - {"track"}:
        np.testing.assert_array_equal(points[name], expected[name], err_msg=name)


# What is heard.


def test_features_are_published_with_the_stamp_of_the_scan(peer, domain):
    for name, kind in BELOW.items():
        peer.listen(f"/scan/{name}", kind)
    peer.listen("/diagnostics", "DiagnosticArray")
    peer.publish("/scan", "LaserScan")
    message = scan_message(1_700_000_000, scene())
    features = ln.extract(scan_of(message))
    assert min(map(len, (features.segments, features.corners, features.arcs))) > 0
    with Running(domain=domain) as node:

        def publish() -> None:
            peer.write("/scan", message)

        cloud, poses, markers = (heard(peer, f"/scan/{name}", publish) for name in BELOW)
        report = heard(peer, "/diagnostics", publish)
        counts = node.stop().total
    assert cloud["header"] == poses["header"] == message["header"]
    assert_same(cloud, features)
    assert set(points_of(cloud)["track"]) == {-1}
    places = [(pose["position"]["x"], pose["position"]["y"]) for pose in poses["poses"]]
    np.testing.assert_array_equal(places, features.corners["position"])
    layers = {marker["ns"]: marker for marker in markers["markers"]}
    assert list(layers) == ["segments", "arcs", "corners", "edges", "ellipses"]
    assert all(layer["header"] == message["header"] for layer in layers.values())
    ends = [(point["x"], point["y"]) for point in layers["segments"]["points"]]
    np.testing.assert_array_equal(ends[::2], features.segments["start"])
    np.testing.assert_array_equal(ends[1::2], features.segments["end"])
    (status,) = report["status"]
    assert (status["name"], status["hardware_id"]) == ("lineament: /scan", "/scan")
    assert abs(report["header"]["stamp"]["sec"] - time.time()) < 600
    assert status["values"][0]["key"] == "rate [1/s]"
    assert counts.scans > 0
    assert counts.malformed == counts.unsent == 0
    assert node.lines[0] == "lineament finds features on /scan by optimal"


def test_one_echo_a_namespace_and_tracks(peer, domain):
    topic = "/robot1/front/scan"
    peer.publish(topic, "MultiEchoLaserScan")
    peer.listen(f"{topic}/features", "PointCloud2")
    message = scan_message(0, scene())
    echoes = [{"echoes": [0.5, distance]} for distance in message["ranges"]]

    def publish() -> None:
        message["header"]["stamp"]["sec"] += 1
        peer.write(topic, {**message, "ranges": echoes})

    options = {"type": "MultiEchoLaserScan", "echo": "last", "method": "iepf", "noise": 0.004}
    parameters = {"noise_factor": 3.0, "min_points": 6}
    with Running(
        domain=domain,
        topic="front/scan",
        namespace="robot1",
        track=True,
        **{"parameters": parameters, **options},
    ):
        first, later = (heard(peer, f"{topic}/features", publish) for _ in range(2))
    extractor = ln.Extractor("iepf", noise=ln.RangeNoise(sigma=0.004), **parameters)
    assert_same(first, extractor(scan_of(message)))
    # The sensor stands still: what it sees keeps its number.
    assert first["header"]["stamp"]["sec"] < later["header"]["stamp"]["sec"]
    numbers = points_of(first)["track"].tolist()
    assert len(numbers) > 0
    assert numbers == points_of(later)["track"].tolist()


def test_a_log_is_played_until_its_end(peer, domain, log):
    kinds = {"/scan": "LaserScan", "/tf": "TFMessage", "/scan/features": "PointCloud2"}
    for topic, kind in kinds.items():
        peer.listen(topic, kind, 1000)
    scans = list(ln.open_log(log))
    with Running(domain=domain, log=log, rate=20.0) as node:
        counts = node.end().total
        assert counts.scans + counts.dropped == len(scans)
        eventually(lambda: peer._readers["/scan/features"].read(1))
    played, links, clouds = (peer.take(topic) for topic in kinds)
    links = [link for message in links for link in message["transforms"]]
    by_stamp = {round(1e9 * scan.stamp): scan for scan in scans}
    for messages in (played, links, clouds):
        headers = [message["header"] for message in messages]
        stamps = [h["stamp"]["sec"] * 10**9 + h["stamp"]["nanosec"] for h in headers]
        # Some come before others are connected, but the last comes before the node is gone.
        assert stamps == sorted(set(stamps))
        assert set(stamps) <= set(by_stamp)
        assert stamps[-1] == max(by_stamp)
    last = scans[-1]
    np.testing.assert_array_equal(played[-1]["ranges"], last.ranges.astype(np.float32))
    # /tf needs a frame that has a name.
    assert played[-1]["header"]["frame_id"] == links[-1]["child_frame_id"] == "laser"
    place = links[-1]["transform"]["translation"]
    assert (place["x"], place["y"]) == last.pose[:2]
    assert_same(clouds[-1], ln.extract(last))


def test_the_motion_of_a_log_and_the_pose_of_a_corner_are_published(peer, domain, log):
    """Of a drive of 4 m straight on, at whose begin the corner is 5 m ahead and 2 m to the left."""
    kinds = {"/scan/odometry": "Odometry", "/scan/dock": "PoseWithCovarianceStamped"}
    for topic, kind in kinds.items():
        peer.listen(topic, kind, 1000)
    scans = [round(1e9 * scan.stamp) for scan in ln.open_log(log)]
    with Running(domain=domain, log=log, rate=0.0, track=True, dock=(5.3, 1.8)) as node:
        node.end()
        eventually(lambda: all(peer._readers[topic].read(1) for topic in kinds))
    motion, dock = (peer.take(topic)[-1] for topic in kinds)
    for one, frame in ((motion, "odom"), (dock, "laser")):
        stamp = one["header"]["stamp"]
        assert stamp["sec"] * 10**9 + stamp["nanosec"] == max(scans)
        assert one["header"]["frame_id"] == frame
    assert motion["child_frame_id"] == "laser"
    assert motion["twist"]["twist"]["linear"]["x"] == pytest.approx(1.0, abs=0.1)
    place = motion["pose"]["pose"]["position"]
    assert (place["x"], place["y"]) == pytest.approx((4.0, 0.0), abs=0.05)
    of_pose, of_twist, of_dock = (
        np.reshape(one["covariance"], (6, 6))[np.ix_((0, 1, 5), (0, 1, 5))]
        for one in (motion["pose"], motion["twist"], dock["pose"])
    )
    for covariance in (of_pose, of_twist):
        assert (np.linalg.eigvalsh(covariance) > 0).all()
        assert (np.diag(covariance) < 0.5**2).all()
    place, turned = dock["pose"]["pose"]["position"], dock["pose"]["pose"]["orientation"]
    yaw = 2 * math.atan2(turned["z"], turned["w"])
    off = np.subtract((place["x"], place["y"], yaw), (1.0, 2.0, -0.75 * math.pi))
    assert off @ np.linalg.solve(of_dock, off) < 30
    assert np.abs(off).max() < 0.03


def test_a_log_is_shown_in_foxglove_without_dds(log, monkeypatch):
    """Of the extra ``foxglove`` alone, as the README names it."""
    pytest.importorskip("foxglove", reason="no foxglove-sdk for this Python")
    monkeypatch.setitem(sys.modules, "cyclonedds", None)
    lines: list[str] = []
    report = run_live(LiveConfig(log=log, rate=0, foxglove=0), write=lines.append)
    assert report.total.scans == 41
    assert lines[0].startswith("without ROS 2, for Foxglove alone: needs cyclonedds, which is not")
    assert lines[1].startswith("Foxglove: open a connection to ws://127.0.0.1:")
    # What else needs ROS goes on to fail without it.
    for options in ({"log": log}, {"foxglove": 0}):
        assert not _is_for_foxglove_alone(LiveConfig(**options), pytest.fail)


def test_a_log_is_shown_in_foxglove(log):
    pytest.importorskip("foxglove", reason="no foxglove-sdk for this Python")
    from foxglove_client import FoxgloveClient

    with Running(log=log, loop=True, ros=0, foxglove=0, deskew="poses") as node:
        address = eventually(lambda: node.lines[:1])[0]
        assert address.startswith("Foxglove: open a connection to ws://127.0.0.1:")
        with closing(FoxgloveClient(int(address.rpartition(":")[2]))) as viewer:
            # A deskewed scan has irregular bearings: it is shown by its points.
            viewer.subscribe("/scan/points")
            points = viewer.take_decoded("/scan/points")
            assert points["frame_id"] == "laser"
            assert len(points["data"]) == 12 * SENSORS["lms181"].n_beams
            viewer.unsubscribe("/scan/points")
        with closing(FoxgloveClient(int(address.rpartition(":")[2]))) as viewer:
            viewer.subscribe("/scan/features")
            entities = viewer.take_decoded("/scan/features")["entities"]
            names = ["segments", "arcs", "corners", "edges", "ellipses"]
            assert [entity["id"] for entity in entities] == names


def test_garbage_collection_is_as_before_after_a_run(tmp_path, log):
    class StoppedError(Exception):
        pass

    def stop(line: str) -> None:
        raise StoppedError(line)

    report = run_live(LiveConfig(log=log, rate=0, ros=0), write=[].append, show=[].append)
    assert report.total.scans == 41
    assert (gc.isenabled(), gc.get_freeze_count()) == (True, 0)
    with pytest.raises(StoppedError, match="lineament finds features on /scan by optimal"):
        run_live(LiveConfig(log=log, rate=0, ros=0), write=stop)
    assert (gc.isenabled(), gc.get_freeze_count()) == (True, 0)
    with pytest.raises(ln.LineamentError, match=r"missing\.npz"):
        run_live(LiveConfig(log=str(tmp_path / "missing.npz"), ros=0))
    assert (gc.isenabled(), gc.get_freeze_count()) == (True, 0)


# Options.


def test_a_file_and_flags_that_go_before_it(tmp_path, monkeypatch, capfd):
    (tmp_path / "robot.toml").write_text("""
topic = "front/scan"
domain = 7
laser_pose = [0.2, 0, 0.0]
method = "liu"
echo = "first"
track = true
[parameters]
noise_factor = 99.0
min_points = 6
[limits]
beams = 9
scans = 8
""")

    def kept(config: LiveConfig, is_stopped, *, write, show) -> Report:
        assert not is_stopped()
        write("begun")
        configs.append(config)
        report = Report(1.0, Counts(), Counts(3, 2, 1), (0, 0), 0, {}, 0)
        show(report)
        return report

    configs: list[LiveConfig] = []
    monkeypatch.setattr("lineament.live.run_live", kept)
    flags = "--echo last -m iepf --set noise_factor=3.0 --localhost --foxglove --noise 0.1"
    flags += " --dock 2 -1.5 --limit scans=7 --from a.bag --rate 2"
    assert run(["live", "--config", str(tmp_path / "robot.toml"), *flags.split()]) == 0
    assert capfd.readouterr() == ("3 scans, 2 dropped, 1 lost, 0 malformed messages\n", "begun\n")
    assert run(["live", "--ros", "1", "__name:=front", "-q"]) == 0
    assert capfd.readouterr() == ("", "")
    both = {"topic": "front/scan", "domain": 7, "laser_pose": (0.2, 0, 0.0), "echo": "last"}
    both |= {"method": "iepf", "parameters": {"noise_factor": 3.0, "min_points": 6}, "track": True}
    both |= {"limits": {"beams": 9, "scans": 7}, "localhost": True, "foxglove": 8765}
    both |= {"log": "a.bag", "rate": 2.0}
    assert configs == [LiveConfig(**both, noise=0.1, dock=(2.0, -1.5)), LiveConfig(ros=1)]


@pytest.mark.parametrize(
    ("arguments", "status", "text"),
    [
        ("--topic 1a", 1, "topic is '/1a', expected a name as in ROS 2"),
        ("--ros 3", 2, "'--ros': 3 is not in the range"),
        ("--ros 0", 2, "ros is 0, which leaves nothing to listen to"),
        ("--laser-pose nan 0 0", 2, "laser_pose is (nan, 0.0, 0.0), expected three"),
        ("-m hough2", 2, "method 'hough2' is unknown"),
        ("--set evidence", 2, "expected NAME=VALUE"),
        ("--set evidence=x", 2, "evidence is 'x', expected a number"),
        (f"--set evidence=1{'0' * 400}", 2, "expected a number"),
        ("--set evidence={[]:1}", 2, "expected a number"),
        ("--set noise=1", 2, "method 'optimal' has no parameter 'noise'"),
        ("--set method=liu", 2, "method 'optimal' has no parameter 'method'"),
        ("--from none.bag", 1, "none.bag: there is no such file"),
        ("--config none.toml", 1, "none.toml: cannot be read"),
        ("something", 2, "got an unexpected argument 'something'"),
        ("__name:=a", 2, "got an unexpected argument '__name:=a'"),
    ],
)
def test_wrong_use_is_one_line(domain, refused, arguments, status, text):
    assert text in refused(f"live --localhost --domain {domain} {arguments}", status)


@pytest.mark.parametrize("package", ["cyclonedds", "foxglove"])
def test_a_package_that_is_missing_is_one_line(monkeypatch, log, capfd, package):
    for name in ("dds", "foxglove", "participant", "raw_dds"):
        monkeypatch.delitem(sys.modules, f"lineament.live.{name}", raising=False)
    for name in ("cyclonedds", "cyclonedds.builtin", "cyclonedds.core", "foxglove"):
        monkeypatch.setitem(sys.modules, name, None)
    options = ["--ros", "0", "--foxglove", "0"] if package == "foxglove" else []
    assert run(["live", "--from", log, *options]) == 1
    extra = {"cyclonedds": "live", "foxglove": "foxglove"}[package]
    install = f"pip install 'lineament[{extra}]'"
    message = f"lineament: live needs {package}, which is not installed: {install}\n"
    assert capfd.readouterr() == ("", message)


# Processes.


def signals_are_handled(pid: int) -> bool:
    """Whether a process handles SIGTERM, as Python itself does not."""
    caught = re.search(r"SigCgt:\s*(\w+)", Path(f"/proc/{pid}/status").read_text())
    return bool(int(caught[1], 16) >> (signal.SIGTERM - 1) & 1)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("stage", ["starting", "loading", "running"])
def test_a_signal_ends_it(started, stage, number):
    if stage == "loading":
        pytest.importorskip("foxglove", reason="no foxglove-sdk for this Python")
    node = started(*(["--foxglove", 0] if stage == "loading" else []))
    if stage == "starting":
        eventually(lambda: signals_are_handled(node.process.pid))
    elif stage == "loading":
        node.until_it_writes("Foxglove: open a connection")
    else:
        node.until_it_writes("lineament finds features on /scan by optimal")
    nothing = "0 scans, 0 dropped, 0 lost, 0 malformed messages\n"
    early = () if stage == "running" else ("stopped before the first scan\n",)
    assert node.stop(number) in (nothing, *early)


@pytest.mark.slow
def test_a_burst_is_accounted_for_and_leaves_no_memory(started, peer):
    n, bursts = 1000, 3
    node = started("--depth", 1000)
    peer.publish("/scan", "LaserScan")
    peer.listen("/scan/features", "PointCloud2", bursts * n)
    peer.listen("/diagnostics", "DiagnosticArray")
    eventually(lambda: peer.listeners("/scan") == 1)
    memory = []
    for _ in range(bursts):
        peer.write_scans("/scan", n, 2000.0, scan_message(0, [2.0] * 541))
        peer.take("/diagnostics")
        (status,) = heard(peer, "/diagnostics")["status"]
        memory.append(node.memory)
    values = {pair["key"]: pair["value"] for pair in status["values"]}
    total = [int(values[f"{name} in all"]) for name in ("scans", "dropped", "lost", "malformed")]
    assert list(map(int, re.findall(r"\d+", node.stop()))) == total
    assert total[-1] == 0
    # What a busy machine loses below DDS is not known to it.
    assert 0 < sum(total) <= bursts * n
    assert 0 < len(peer.take("/scan/features")) <= total[0]
    assert max(memory[1:]) - memory[0] < 10
