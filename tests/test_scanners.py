"""Every scanner there is, on a drive in a simulated room: offline, and through a live node.

Clockwise or not, upside down or not, with a gap at the back or without, stamped at the first, the
middle or the last beam, with the time of each beam or of a turn alone.
"""

import json
import math
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
import ros_bags
from in_memory import Given, Taken
from live_driving import received_scan
from mcap.reader import make_reader
from pyarrow import csv, parquet

import lineament as ln
from lineament.live import LiveConfig, Node, Odometry, Pipeline, Received, RosSink
from lineament.live.received import ODOMETRY
from lineament.logs import open_log, save_npz
from lineament.motion import Tracker
from lineament.output.ros_messages import RosMessages
from lineament.output.scene import Moment
from lineament.rosmsg.scans import laser_scan
from lineament.scan.fields import STAMPS
from lineament.scan.poses import compose, poses_along, relative
from lineament.simulation import World, cast_rays
from lineament.simulation.placing import clearance
from lineament.tasks.extract import extract_log

RING = [(-3, -3), (4, -3.5), (5, 0), (3, 1), (3.5, 4), (-1, 5), (-4, 2)]
ROOM = World([[*a, *b] for a, b in zip(RING, [*RING[1:], RING[0]], strict=True)])
TWIST, START, NANO, RATE = (0.8, -0.2, 0.9), (-1.5, -1.0, 0.3), 1_000_000_000, 10.0
#: A time that no float holds [ns].
EPOCH = 1_700_000_000_123_456_789
LASER_SCAN = "sensor_msgs/msg/LaserScan"
#: Field of view and step [rad]: with a gap at the back, all around, all around without a seam.
VIEWS = ((1.5 * math.pi, 1080), (2 * math.pi - 0.3, 1380), (2 * math.pi, 1440))


class Scanner(NamedTuple):
    is_clockwise: bool
    is_upside_down: bool
    stamp: str
    has_increment: bool
    view: tuple[float, int]

    @property
    def twist(self):
        forward, left, turn = TWIST
        return (forward, -left, -turn) if self.is_upside_down else TWIST

    def pose(self, scan):
        """Pose of the robot at the stamp of a scan."""
        return compose(START, tuple(poses_along(TWIST, [scan / RATE])[0].tolist()))

    def in_world(self, scan, points):
        """Points (n, 2) in the frame of the scanner, in the world."""
        x, y, theta = self.pose(scan)
        px, py = np.transpose(points) * [[1], [-1 if self.is_upside_down else 1]]
        c, s = math.cos(theta), math.sin(theta)
        return np.column_stack((c * px - s * py + x, s * px + c * py + y))

    def message(self, scan, sigma=0.0):
        """What it sends of a sweep: beams and times in the order in which they are taken."""
        width, n = self.view
        step = width / n * (-1 if self.is_clockwise else 1)
        increment = width / n / (2 * math.pi * RATE)
        stamped = {"first": 0.0, "middle": (n - 1) / 2, "last": n - 1.0}[self.stamp]
        bearings = -n // 2 * step + step * np.arange(n)
        times = increment * (np.arange(n) - stamped) + scan / RATE
        x, y, theta = START
        dx, dy, turn = poses_along(TWIST, times).T
        c, s = math.cos(theta), math.sin(theta)
        poses = np.column_stack((x + c * dx - s * dy, y + s * dx + c * dy, theta + turn))
        ranges, _ = cast_rays(ROOM, poses, -bearings if self.is_upside_down else bearings)
        seed = scan, self.is_clockwise, self.is_upside_down, len(self.stamp), self.has_increment
        ranges += sigma * np.random.default_rng(seed).standard_normal(n)
        stamp = divmod(EPOCH + round(scan * NANO / RATE), NANO)
        geometry = float(bearings[0]), float(bearings[-1]), step
        times = increment if self.has_increment else 0.0, 1 / RATE
        values = np.float32(ranges), np.zeros(0, np.float32)
        new = ros_bags.Messages(2).new
        return new(LASER_SCAN, (stamp, "laser"), *geometry, *times, 0.0, 30.0, *values)

    def data(self, scan, sigma=0.0):
        """The same in CDR."""
        return bytes(ros_bags.store(2).serialize_cdr(self.message(scan, sigma), LASER_SCAN))


ALL = [
    Scanner(*kind, VIEWS[i % len(VIEWS)])
    for i, kind in enumerate(
        product((False, True), (False, True), ("first", "middle", "last"), (True, False))
    )
]
every = pytest.mark.parametrize("scanner", ALL, ids=lambda s: "-".join(map(str, s[:4])))


@every
def test_a_deskewed_scan_is_where_the_walls_are(scanner):
    scan = ln.LaserScan.from_message(scanner.message(3), stamp=scanner.stamp)
    assert scan.stamp_ns == EPOCH + 3 * NANO // 10
    still = ln.deskew(scan, scanner.twist)
    assert still.stamp_ns == scan.stamp_ns
    assert still.valid.sum() > 0.95 * len(scan)
    points = scanner.in_world(3, still.points[still.valid])
    np.testing.assert_allclose(clearance(ROOM, points), 0, atol=1e-6)
    # As it came, it is not.
    skewed = scanner.in_world(3, scan.points)
    assert clearance(ROOM, skewed).max() > 0.03
    # A part of it is as the whole.
    part = ln.deskew(scan[100:900:2], scanner.twist)
    points = scanner.in_world(3, part.points[part.valid])
    np.testing.assert_allclose(clearance(ROOM, points), 0, atol=1e-6)


@every
def test_bytes_and_objects_are_the_same_scan_and_are_written_as_they_came(scanner):
    data = scanner.data(2)
    scan = laser_scan(data, "cdr").stamped(scanner.stamp)
    same = ln.LaserScan.from_message(scanner.message(2), stamp=scanner.stamp)
    np.testing.assert_allclose(scan.points, same.points, atol=1e-5)
    assert (scan.stamp_ns, scan.stamp_beam) == (same.stamp_ns, same.stamp_beam)
    written = RosMessages("cdr").scan(
        "/scan", Moment(*divmod(scan.stamp_ns, NANO), "laser", ""), scan
    )
    again = laser_scan(written.data, "cdr")
    if scanner.stamp == "middle":
        again = again.stamped("middle")
    np.testing.assert_allclose(again.points, scan.points, atol=1e-5)
    assert (again.stamp_ns, again.stamp_beam) == (scan.stamp_ns, scan.stamp_beam)
    np.testing.assert_allclose(
        ln.deskew(again, TWIST).angles, ln.deskew(scan, TWIST).angles, atol=1e-5
    )


@pytest.mark.slow
def test_the_motion_between_scans_is_that_of_the_sensor_at_their_stamps():
    """NEES a degree of freedom of 288 motions has a deviation of √(2/864) = 0.05."""
    squares = []
    for scanner in ALL:
        extract, tracker = ln.Extractor(), Tracker(roughness=0.0)
        for k in range(13):
            scan = laser_scan(scanner.data(k, 0.01), "cdr").stamped(scanner.stamp)
            tracks = tracker(extract(ln.deskew(scan, scanner.twist)))
            if k:
                x, y, turn = relative(scanner.pose(k - 1), scanner.pose(k))
                true = (x, -y, -turn) if scanner.is_upside_down else (x, y, turn)
                off = np.subtract(tracks.motion.pose, true)
                squares.append(off @ np.linalg.solve(tracks.motion.covariance, off) / 3)
                assert tracks.motion.observable
    assert 0.9 < np.mean(squares) < 1.1
    assert np.max(squares) < 7


def test_beams_of_stamps_that_there_are_not():
    with pytest.raises(ValueError, match="stamp is 'end', expected first, middle, last"):
        ln.LaserScan([1.0], 0.0, 0.1).stamped("end")
    with pytest.raises(ValueError, match="stamp is 'end', expected first or middle or last"):
        open_log("a.npz", stamp="end")
    with pytest.raises(ValueError, match="stamp is 'end', expected one of first, middle, last"):
        LiveConfig(stamp="end")


@pytest.mark.parametrize("name", ["a.mcap", "a.ros2.mcap", "a.parquet", "a.csv", "a.jsonl"])
def test_nanoseconds_are_whole_in_every_output(name, tmp_path):
    scans = [laser_scan(ALL[k].data(k, 0.002), "cdr") for k in range(3)]
    save_npz(tmp_path / "scans.npz", [scan.stamped(20.0) for scan in scans[:1]])
    ((_, scan),) = open_log(tmp_path / "scans.npz").items()
    assert (scan.stamp_ns, scan.stamp_beam) == (EPOCH, 20.0)
    beams = [open_log(tmp_path / "scans.npz", stamp=beam).scan(0).stamp_beam for beam in STAMPS]
    assert beams == [20.0, (len(scan) - 1) / 2, len(scan) - 1]
    extract_log(tmp_path / "scans.npz", tmp_path / name, ln.Extractor())
    if name.endswith("mcap"):
        with (tmp_path / name).open("rb") as file:
            times = {message.log_time for _, _, message in make_reader(file).iter_messages()}
    elif name.endswith("jsonl"):
        lines = (tmp_path / name).read_text().splitlines()
        times = {json.loads(line)["stamp_ns"] for line in lines}
    else:
        read = csv.read_csv if name.endswith("csv") else parquet.read_table
        times = set(read(tmp_path / name)["stamp_ns"].to_pylist())
    assert times == {EPOCH}


@every
@pytest.mark.parametrize("deskew", ["/odom", "scans"])
def test_what_a_node_publishes_is_where_the_walls_are_at_the_stamp(scanner, deskew):
    config = LiveConfig(
        deskew=deskew, stamp=scanner.stamp, upside_down=scanner.is_upside_down, noise=0.002
    )
    came = []
    for k in range(6):
        moving = Odometry((EPOCH + k * NANO / RATE) / NANO, TWIST, (0, 0, 0), "odom", "base")
        came.append([Received("o", lambda moving=moving: moving, 0.0, ODOMETRY)])
        came.append([received_scan("s", scanner.data(k, 0.002))])
    publisher = Taken()
    sink = RosSink(publisher, RosMessages("cdr"), config)
    total = Node(Given(*came), Pipeline(config), [sink]).run().total
    assert (total.scans, total.malformed) == (6, 0)
    kind = publisher.kinds["/scan/features"]
    for k, data in enumerate(publisher.data("/scan/features")):
        cloud = ros_bags.store(2).deserialize_cdr(data, kind)
        stamp = cloud.header.stamp
        assert stamp.sec * NANO + stamp.nanosec == EPOCH + k * NANO // 10
        if k == 0 and deskew == "scans":
            continue  # The motion is not known yet.
        forms = {5: "<i4", 6: "<u4", 7: "<f4"}
        fields = [(field.name, forms[field.datatype]) for field in cloud.fields]
        found = np.frombuffer(cloud.data.tobytes(), fields)
        places = np.column_stack((found["x"], found["y"]))[found["kind"] == 0]
        assert len(places) >= 5
        off = clearance(ROOM, scanner.in_world(k, places))
        assert off.max() < (0.005 if deskew == "/odom" else 0.02)
