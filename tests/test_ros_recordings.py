"""The recordings in bags: each opens, or says what it has instead."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lineament import LogError
from lineament.logs import open_log


@pytest.mark.parametrize(
    ("name", "form", "counts", "beams"),
    [
        ("mcap/scans_demo.mcap", "mcap", {"/front_scan": 331, "/rear_scan": 330}, (726, 726)),
        ("rosbag1/scans_demo.bag", "rosbag1", {"/front_scan": 331, "/rear_scan": 330}, (726, 726)),
        ("rosbag1/demo_stationary_simple_environment.bag", "rosbag1", {"/scan": 1265}, (512, 512)),
        ("rosbag1/jackal_mocap.bag", "rosbag1", {"/scan": 414}, (897, 897)),
        ("rosbag1/corridor_alternating_beams.bag", "rosbag1", {"/scan_filtered": 4752}, (179, 180)),
        ("rosbag1/urg_handheld_v2_old.bag", "rosbag1", {"/scan": 360}, (681, 681)),
        ("rosbag1/urg_v1_2.bag", "rosbag1", {"scan": 123}, (512, 512)),
        ("rosbag2/jackal_mocap", "rosbag2", {"/scan": 189}, (897, 897)),
        ("rosbag2/ld19", "rosbag2", {"/scan": 436}, (452, 456)),
        ("rosbag2/ld19/data1_nov1_0.db3", "rosbag2", {"/scan": 436}, (452, 456)),
        ("rosbag2/two_publishers", "rosbag2", {"/scan": 507}, (82, 524)),
    ],
)
def test_recordings_open(data_dir, name, form, counts, beams):
    log = open_log(data_dir / name)
    assert (log.format, log.topics, len(log)) == (form, list(counts), sum(counts.values()))
    found = dict.fromkeys(counts, 0)
    lengths = set()
    for topic, scan in log.items():
        found[topic] += 1
        lengths.add(len(scan))
    assert found == counts
    assert (min(lengths), max(lengths)) == beams


def test_a_recording_without_scans_lists_what_it_has(data_dir):
    with pytest.raises(LogError) as caught:
        open_log(data_dir / "mcap" / "nav2_turtlebot_no_scan.mcap")
    assert caught.value.problem == (
        "has no LaserScan or MultiEchoLaserScan; topics there are: "
        "/amcl_pose (geometry_msgs/PoseWithCovarianceStamped, 135), /odom (nav_msgs/Odometry, "
        "2639), /tf (tf2_msgs/TFMessage, 5422), /tf_static (tf2_msgs/TFMessage, 1)"
    )


def test_the_same_recording_in_two_containers(data_dir):
    bag, mcap = (
        open_log(data_dir / name) for name in ("rosbag1/scans_demo.bag", "mcap/scans_demo.mcap")
    )
    for (topic, scan), (other_topic, other) in zip(bag.items(), mcap.items(), strict=True):
        assert (topic, scan.stamp, scan.frame_id) == (other_topic, other.stamp, other.frame_id)
        np.testing.assert_array_equal(scan.ranges, other.ranges)


def test_codes_below_range_min_are_invalid(data_dir):
    log = open_log(data_dir / "rosbag1" / "demo_stationary_simple_environment.bag")
    valid = np.mean([scan.valid.mean() for scan in log])
    assert 0.3 < valid < 0.4


def test_the_increment_changes_with_the_number_of_beams(data_dir):
    steps = {len(scan): scan.angle_increment for scan in open_log(data_dir / "rosbag2" / "ld19")}
    for n, step in steps.items():
        assert step == pytest.approx(2 * math.pi / n, rel=0.01)


def test_two_publishers_on_a_topic(data_dir):
    log = open_log(data_dir / "rosbag2" / "two_publishers")
    scans = list(log)
    stamps = np.array([scan.stamp for scan in scans])
    assert (np.diff(stamps) < 0).sum() > 100
    is_blind = np.array([not scan.valid.any() for scan in scans])
    assert 200 < is_blind.sum() < len(scans) - 200


def test_poses_of_motion_capture(data_dir):
    """The truth of this run was refined from them: they agree to centimetres."""
    topic = "/vrpn_client_node/jackal/pose"
    log = open_log(data_dir / "rosbag1" / "jackal_mocap.bag", pose_topic=topic)
    scans = list(log)
    poses = np.array([scan.pose for scan in scans])
    with np.load(data_dir / "truth" / "jackal_mocap_02171554.npz") as truth:
        stamps, expected = truth["stamps"], truth["poses"]
    nearest = np.abs(stamps[:, None] - [scan.stamp for scan in scans]).argmin(axis=1)
    off = poses[nearest] - expected
    turn = np.remainder(off[:, 2] + math.pi, 2 * math.pi) - math.pi
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.05
    assert np.abs(turn).max() < 0.15
