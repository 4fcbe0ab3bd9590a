"""Poses of topics, at the stamps of scans."""

import math

import numpy as np
import pytest
import ros_bags
from text_logs import check_refused

from lineament import LaserScan, LineamentWarning, LogError
from lineament.logs import open_log, ros_poses, save_npz
from lineament.scan.poses import carried

SECOND = 1_000_000_000
both = pytest.mark.parametrize("kind", ["rosbag1", "mcap"])


def write(path, kind, make):
    """Write a bag of what `make` gives of messages: (topic, time of receipt [s], message)."""
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    items = [(topic, round(time * SECOND), message) for topic, time, message in make(messages)]
    return ros_bags.write(path, kind, items)


#: The scanner is where the poses are of.
AT_BODY = (0.0, 0.0, 0.0)


def poses(path, pose_topic, laser_pose=AT_BODY):
    log = open_log(path, pose_topic=pose_topic, laser_pose=laser_pose)
    return [scan.pose for scan in log]


def scans(messages, *stamps, time=None):
    """Scans with their stamps, received at them or at `time`."""
    for stamp in stamps:
        yield "/scan", stamp if time is None else time, messages.scan(stamp, [1.0, 2.0])


def beside(x, *stamps):
    """Odometry at 1 s that is at x, and scans."""

    def make(messages):
        yield "/odom", 1.0, messages.odometry(1.0, x, 0.0, 0.0)
        yield from scans(messages, *stamps)

    return make


@both
@pytest.mark.parametrize("maker", ["odometry", "pose_stamped", "pose_with_covariance"])
def test_between_two_poses(tmp_path, kind, maker):
    def make(messages):
        pose = getattr(messages, maker)
        yield from scans(messages, 0.4, 0.5)
        yield "/pose", 2.0, pose(2.0, 1.0, 2.0, 3.0)
        yield from scans(messages, 2.0, 2.25)
        yield "/pose", 3.0, pose(3.0, 5.0, 0.0, -3.0)
        yield from scans(messages, 3.5)

    path = write(tmp_path, kind, make)
    with pytest.warns(LineamentWarning, match=r"log\.\w+: 1 of 5 scans have no pose: /pose"):
        long_before, before, at, between, after = poses(path, "/pose")
    assert long_before is None
    assert before == pytest.approx((1.0, 2.0, 3.0))
    assert at == pytest.approx((1.0, 2.0, 3.0))
    # The heading goes on through π, the shorter way from 3 to -3.
    assert between == pytest.approx((2.0, 1.5, 3.0 + 0.25 * (2 * math.pi - 6.0)))
    assert after == pytest.approx((5.0, 0.0, -3.0))
    log = open_log(path)  # No pose is asked for, and none is missed.
    assert [scan.pose for scan in log] == [None] * 5
    assert [scan.stamp for scan in log] == [0.4, 0.5, 2.0, 2.25, 3.5]


@both
def test_a_stamped_transform(tmp_path, kind):
    def make(messages):
        yield "/vicon", 1.0, messages.transform(1.0, "world", "robot", 1.0, 2.0, 0.5)
        yield from scans(messages, 1.0)

    assert poses(write(tmp_path, kind, make), "/vicon") == [pytest.approx((1.0, 2.0, 0.5))]


@both
def test_a_chain_of_transforms(tmp_path, kind):
    def make(messages):
        at = messages.transform
        fixed = at(0.0, "base_link", "laser", 0.5, 0.0, math.pi)
        yield "/tf_static", 0.0, messages.transforms(fixed, at(0.0, "a", "b", 7.0, 7.0, 7.0))
        yield "/tf", 1.0, messages.transforms(at(1.0, "odom", "/base_link", 1.0, 0.0, 0.0))
        yield "/tf", 1.0, messages.transforms(at(1.0, "map", "odom", 0.0, 10.0, math.pi / 2))
        yield from scans(messages, 1.5)
        yield "/tf", 2.0, messages.transforms(at(2.0, "odom", "base_link", 3.0, 0.0, 0.0))
        yield from scans(messages, 2.5)

    path = write(tmp_path, kind, make)
    between, last = poses(path, "/tf:odom->base_link")
    assert between == pytest.approx((2.0, 0.0, 0.0))
    assert last == pytest.approx((3.0, 0.0, 0.0))
    # base_link is 2 m along the odom frame, which looks along the y axis of the map.
    between, _ = poses(path, "/tf:map -> /odom -> base_link -> laser")
    assert between == pytest.approx((0.0, 12.5, -math.pi / 2))
    gap = "/tf has no map->laser, .* links there are: a->b, base_link->laser, map->odom, odom->base"
    with pytest.warns(LineamentWarning, match=gap):
        assert poses(path, "/tf:map->laser") == [None, None]


@both
def test_the_mounting_is_found_in_static_transforms(tmp_path, kind):
    """The scanner is turned by a quarter on a mast 0.5 m ahead; the robot looks along y."""

    def make(messages):
        at = messages.transform
        yield from scans(messages, 1.0)  # It waits for the mounting, as for its pose.
        yield "/odom", 1.0, messages.odometry(1.0, 1.0, 2.0, math.pi / 2)
        mast, laser = at(0, "base_link", "mast", 0.5, 0, 0), at(0, "mast", "laser", 0, 0.1, 1.0)
        yield "/tf_static", 1.5, messages.transforms(laser, mast)
        yield from scans(messages, 2.0)

    path = write(tmp_path, kind, make)
    expected = pytest.approx((0.9, 2.5, math.pi / 2 + 1.0))
    assert poses(path, "/odom", None) == [expected] * 2
    assert poses(path, "/odom") == [pytest.approx((1.0, 2.0, math.pi / 2))] * 2
    assert poses(path, "/odom", (0.5, 0.1, 1.0)) == [expected] * 2


@pytest.mark.parametrize("links", [[], [("base_link", "camera")], [("laser", "laser")]])
@pytest.mark.parametrize("maker", ["odometry", "pose_stamped"])
def test_a_mounting_that_is_not_known_is_warned_of(tmp_path, links, maker):
    def make(messages):
        made = [messages.transform(0.0, *link, 1.0, 1.0, 1.0) for link in links]
        yield "/tf_static", 0.0, messages.transforms(*made)
        yield "/odom", 1.0, getattr(messages, maker)(1.0, 1.0, 2.0, 3.0)
        yield from scans(messages, 1.0, 1.5, 2.0)

    path = write(tmp_path, "mcap", make)
    of = "are those of 'base_link'" if maker == "odometry" else "do not say what they are of"
    problem = f"poses of /odom {of}, and where 'laser' is on it is not known: .*laser_pose"
    with pytest.warns(LineamentWarning, match=problem) as caught:
        assert poses(path, "/odom", None) == [pytest.approx((1.0, 2.0, 3.0))] * 3
    assert len(caught) == 1


def test_a_mounting_that_is_given_carries_poses_and_their_covariance(tmp_path):
    """Seen from the robot, the scanner is 2 m to the left: as it turns, it goes along x."""
    npz = tmp_path / "log.npz"
    save_npz(npz, [LaserScan([1.0], 0.0, 0.1, pose=(1.0, 1.0, 0.0))])
    assert open_log(npz, laser_pose=(0.0, 2.0, 0.5))[0].pose == (1.0, 3.0, 0.5)
    covariance = carried(np.diag([0.0, 0.0, 0.01]), (1.0, 1.0, 0.0), (1.0, 3.0, 0.5))
    expected = [[0.04, 0.0, -0.02], [0.0, 0.0, 0.0], [-0.02, 0.0, 0.01]]
    np.testing.assert_allclose(covariance, expected, atol=1e-15)
    for given, problem in (
        ((0.0, 0.0, 90.0), r"laser_pose has theta = 90 rad, .*degrees"),
        ((0.0, 0.0), r"laser_pose is \(0.0, 0.0\), expected three finite numbers"),
    ):
        with pytest.raises(ValueError, match=problem):
            open_log(npz, laser_pose=given)


def test_a_static_link_holds_at_all_times(tmp_path):
    """Before and after its stamp, and though it was sent twice."""

    def make(messages):
        for stamp, x in ((5.0, 1.0), (9.0, 2.0)):
            link = messages.transform(stamp, "base_link", "laser", x, 0.0, 0.0)
            yield "/tf_static", 0.0, messages.transforms(link)
        later = messages.transform(50.0, "base_link", "laser", 3.0, 0.0, 0.0)
        yield "/tf", 0.0, messages.transforms(later)
        yield from scans(messages, 1.0, 7.0, 20.0, time=1.0)

    found = poses(write(tmp_path, "mcap", make), "/tf:base_link->laser")
    assert found == [(2.0, 0.0, 0.0)] * 3


def test_a_scanner_that_hangs_upside_down(tmp_path):
    """It is on a plate that is turned about x, and by 0.5 rad, on a robot."""
    yaw = 0.5

    def make(messages):
        header = messages.header(0.0, "base")
        turned = (0.2, 0.1, 1.0), (math.cos(yaw / 2), math.sin(yaw / 2), 0.0, 0.0)
        link = messages.new("geometry_msgs/TransformStamped", header, "plate", turned)
        on_it = messages.transform(0.0, "plate", "laser", 0.3, 0.2, 0.1)
        yield "/tf_static", 0.0, messages.transforms(link, on_it)
        at = messages.transform(0.0, "map", "base", 3.0, 4.0, math.pi / 2)
        yield "/tf", 0.0, messages.transforms(at)
        yield "/scan", 0.1, messages.scan(0.1, [1.0, 2.0], [7.0, 8.0], time_increment=0.25)

    path = write(tmp_path, "mcap", make)
    (plain,) = open_log(path)
    (scan,) = open_log(path, pose_topic="/tf:map->base->plate->laser")
    x, y, theta = scan.pose
    plate = math.pi / 2 + yaw
    assert theta == pytest.approx(plate - 0.1)
    assert x == pytest.approx(2.9 + 0.3 * math.cos(plate) + 0.2 * math.sin(plate))
    assert y == pytest.approx(4.2 + 0.3 * math.sin(plate) - 0.2 * math.cos(plate))
    c, s = math.cos(theta), math.sin(theta)
    mirrored = plain.points * (1, -1)
    np.testing.assert_allclose(
        scan.points @ [[c, s], [-s, c]] + (x, y), (mirrored @ [[c, s], [-s, c]] + (x, y))[::-1]
    )
    assert scan.intensities.tolist() == [8.0, 7.0]
    # The first beam is still that of the stamp.
    assert (scan.stamp_beam, scan.time_increment) == (1, -0.25)
    # A chain that ends before is continued by the mounting.
    assert open_log(path, pose_topic="/tf:map->base").scan(0).pose == pytest.approx(scan.pose)
    found = open_log(path, pose_topic="/tf:map->base", laser_pose=AT_BODY).scan(0)
    assert found.intensities.tolist() == [7.0, 8.0]


def test_a_scan_with_the_stamp_of_a_pose_does_not_wait(tmp_path, monkeypatch):
    learned = []

    class Finder(ros_poses.PoseFinder):
        def wait(self, topic, scan):
            learned.append(len(super().wait(topic, scan)))
            return []

    monkeypatch.setattr("lineament.logs.ros_poses.PoseFinder", Finder)
    poses(write(tmp_path, "mcap", beside(7.0, 1.0, 1.5)), "/odom")
    assert learned == [1, 0]


def test_stamps_that_run_backwards_find_their_poses(tmp_path):
    def make(messages):
        for stamp in (1.0, 2.0, 3.0):
            yield "/odom", stamp, messages.odometry(stamp, stamp, 0.0, 0.0)
        yield from scans(messages, 2.5, 1.5, 2.0, time=4.0)

    found = poses(write(tmp_path, "mcap", make), "/odom")
    assert [pose[0] for pose in found] == pytest.approx([2.5, 1.5, 2.0])


def test_scans_do_not_wait_for_ever(tmp_path, monkeypatch):
    """What stands far behind in the bag, or was recorded long ago, is not held in memory."""
    monkeypatch.setattr(ros_poses, "MAX_WAITING", 250)  # Two scans of two beams.
    monkeypatch.setattr(ros_poses, "MAX_POSES", 12)

    def make(messages):
        yield from scans(messages, *(0.2 * i for i in range(5)))
        for i in range(100):
            yield "/odom", 1 + i, messages.odometry(0.2 * i, 0.2 * i, 0.0, 0.0)
        yield from scans(messages, 0.2, 0.7, time=200.0)

    path = write(tmp_path, "mcap-plain", make)
    with pytest.warns(LineamentWarning, match="5 of 7 scans have no pose: /odom has none near"):
        found = poses(path, "/odom")
    assert found[:3] == [None] * 3  # Given up when the next two came.
    assert [pose and pose[0] for pose in found[3:5]] == pytest.approx([0.6, 0.8])
    assert found[5:] == [None, None]  # Of the poses, only the newest are kept.


@pytest.mark.parametrize("x", [math.nan, math.inf, -1e308, 1e100])
def test_a_pose_without_measure_is_reported(tmp_path, x):
    path = write(tmp_path, "mcap", beside(x, 1.0))
    with pytest.raises(LogError, match=r"/odom message 0: pose is \(.*, 0.0, 0.0\), expected"):
        poses(path, "/odom")
    log = open_log(path, pose_topic="/odom", keep_going=True, laser_pose=AT_BODY)
    with pytest.warns(LineamentWarning, match="1 of 1 scans have no pose: /odom has none near"):
        assert [scan.pose for scan in log] == [None]
    assert log.skipped == 1


def test_scans_that_wait_where_a_bag_breaks_are_returned(tmp_path):
    path = write(tmp_path, "mcap-plain", beside(7.0, 1.0, 2.0, 3.0))
    data = path.read_bytes()
    path.write_bytes(data[: data.rindex(b"laser") + 20])
    found = []
    log = open_log(path, pose_topic="/odom", laser_pose=AT_BODY)
    with pytest.raises(LogError, match="is cut off"):
        found.extend(scan.pose for scan in log)
    assert found == [(7.0, 0.0, 0.0)] * 2


@pytest.mark.parametrize(
    ("pose_topic", "problem"),
    [
        ("/pose", r"has no .*nav_msgs/Odometry on '/pose'; topics there are: /odom \(nav_msgs"),
        ("/scan", "has no .*PoseStamped or .* on '/scan'"),
        ("/odom:a->b", "has no tf2_msgs/TFMessage or tf/tfMessage on '/odom'"),
        ("/tf:odom", "pose topic is '/tf:odom', expected frames as in /tf:odom->base_link"),
        ("/tf:odom->", "expected frames as in /tf:odom->base_link"),
    ],
)
def test_topics_that_have_no_poses(tmp_path, pose_topic, problem):
    path = write(tmp_path, "mcap", beside(0.0, 1.0))
    check_refused(problem, path, pose_topic=pose_topic)


def test_a_log_without_topics_has_its_own_poses(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("FLASER 2 1.5 1.6 7 8 0 0 0 0 7.5 robot 7.5")
    with pytest.warns(LineamentWarning, match=r"its own are taken, not '/odom'"):
        assert open_log(path, pose_topic="/odom").scan(0).pose == (7.0, 8.0, 0.0)


@pytest.mark.parametrize("option", [{"ring": 3}, {"echo": "last"}])
def test_a_log_without_rings_and_echoes_says_so(tmp_path, option):
    path = tmp_path / "a.log"
    path.write_text("FLASER 2 1.5 1.6 7 8 0 0 0 0 7.5 robot 7.5")
    with pytest.warns(LineamentWarning, match=r"a\.log: has neither rings nor echoes: all of it"):
        assert len(open_log(path, **option)) == 1


@pytest.mark.parametrize(
    ("option", "line"),
    [
        ({"ring": 3}, r"log\.mcap: has no PointCloud2: ring changes nothing"),
        ({"echo": "last"}, r"log\.mcap: has no MultiEchoLaserScan: echo changes nothing"),
    ],
)
def test_a_bag_without_rings_or_echoes_says_so(tmp_path, option, line):
    path = write(tmp_path, "mcap", lambda messages: scans(messages, 1.0))
    with pytest.warns(LineamentWarning, match=line):
        assert len(open_log(path, **option)) == 1


def test_poses_of_motion_capture(data_dir):
    """The truth of this run was refined from them: they agree to centimetres."""
    topic = "/vrpn_client_node/jackal/pose"
    path = data_dir / "rosbag1" / "jackal_mocap.bag"
    with pytest.warns(LineamentWarning, match="do not say what they are of, and where 'velodyne'"):
        found = list(open_log(path, pose_topic=topic))
    with np.load(data_dir / "truth" / "jackal_mocap_02171554.npz") as truth:
        stamps, expected = truth["stamps"], truth["poses"]
    nearest = np.abs(stamps[:, None] - [scan.stamp for scan in found]).argmin(axis=1)
    off = np.array([scan.pose for scan in found])[nearest] - expected
    turn = np.remainder(off[:, 2] + math.pi, 2 * math.pi) - math.pi
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.05
    assert np.abs(turn).max() < 0.15
