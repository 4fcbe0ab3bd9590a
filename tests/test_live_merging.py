"""Several scanners live: their scans come one by one, and go out as one set of features."""

from dataclasses import replace

import numpy as np
import pytest
import ros_bags
from in_memory import Kept
from live_driving import Running, eventually, points_of
from robot_driving import link_message, message_of
from test_merge_command import MOUNTINGS as PLACES

import lineament as ln
from lineament.cli import run
from lineament.live import LiveConfig, MergingPipeline, Node, ReplaySource
from lineament.live.received import MOUNTINGS
from lineament.rosmsg.poses import Odometry, StampedPose
from lineament.scan.poses import compose
from lineament.simulation import SENSORS, room

SENSOR = replace(SENSORS["utm30lx"], rate=10.0)
MERGING = {"topic": "/front", "merge": ("/rear",), "unsure": (0.0, 0.0), "noise": 0.01}


def scan_of(topic, stamp=0.0, robot=(0.0, 0.0, 0.0), seed=0):
    """Make the scan of a scanner of a robot in a room, whose frame is named as its topic."""
    rng = np.random.default_rng([seed, len(topic)])
    scan = SENSOR.scan(room(), compose(robot, PLACES[topic]), rng, stamp)
    return ln.LaserScan(
        scan.ranges, scan.angle_min, scan.angle_increment, stamp=stamp, frame_id=topic[1:]
    )


def links(places=PLACES, **fields):
    return [StampedPose(0, "base_link", name[1:], at, **fields) for name, at in places.items()]


def pipeline_of(**options):
    """Make a pipeline that knows where the scanners are."""
    pipeline = MergingPipeline(LiveConfig(**MERGING, **options))
    pipeline.hear(links(), MOUNTINGS)
    return pipeline


def test_what_both_see_is_one_in_the_frame_of_the_robot():
    pipeline = pipeline_of()
    alone = pipeline.frames("/front", scan_of("/front"))[0].features
    assert pipeline.frames("/rear", scan_of("/rear", 0.04)) == ()
    (frame,) = pipeline.frames("/front", scan_of("/front", 0.05))
    assert frame.features.frame_id == frame.scan.frame_id == "base_link"
    assert (frame.features.stamp, frame.scan.stamp) == (0.05, 0.05)
    rear = ln.extract(scan_of("/rear"), noise=0.01)
    both = len(alone.segments) + len(rear.segments)
    assert len(alone.segments) < len(frame.features.segments) < both
    for corner in frame.features.corners["position"]:
        assert np.linalg.norm(room().segments[:, :2] - corner, axis=1).min() < 0.05


def test_motion_between_two_scans_is_undone_where_odometry_is_known():
    found = {}
    for how in ("off", "/odom"):
        pipeline = pipeline_of(deskew=how)
        pipeline.hear(Odometry(0.0, (1.0, 0.0, 0.5), (0.0, 0.0, 0.0), "odom", "base_link"))
        pipeline.frames("/rear", scan_of("/rear"))
        robot = (0.1 * np.sinc(0.025 / np.pi) * np.cos(0.025), 0.1 * np.sin(0.025), 0.05)
        (frame,) = pipeline.frames("/front", scan_of("/front", 0.1, robot))
        found[how] = len(frame.features.segments)
    assert found["/odom"] < found["off"]


def test_a_scanner_that_is_silent_is_left_out_and_a_line():
    pipeline = pipeline_of()
    pipeline.frames("/rear", scan_of("/rear"))
    for k in range(30):
        (frame,) = pipeline.frames("/front", scan_of("/front", k / 10))
    assert len(frame.scan) == np.count_nonzero(scan_of("/front", 2.9).valid)
    (line,) = pipeline.problems()
    assert line == "scans of /rear are left out: it has none within 0.15 s of those of /front"


def test_a_scanner_that_is_nowhere_is_left_out_and_a_line():
    pipeline = MergingPipeline(LiveConfig(**MERGING, mountings={"/front": PLACES["/front"]}))
    for k in range(20):
        assert pipeline.frames("/rear", scan_of("/rear", k / 10)) == ()
    (line,) = pipeline.problems()
    assert "no transforms lead from base_link to rear, expected on /tf_static" in line
    assert len(pipeline.frames("/front", scan_of("/front"))) == 1


def test_a_scanner_may_hang_upside_down():
    pipeline, turned = pipeline_of(), pipeline_of()
    turned.hear(links({"/rear": PLACES["/rear"]}, is_upside_down=True), MOUNTINGS)
    pipeline.frames("/rear", scan_of("/rear"))
    turned.frames("/rear", scan_of("/rear").turned_over())
    for one in (pipeline, turned):
        (frame,) = one.frames("/front", scan_of("/front"))
        assert len(frame.features.segments) == len(
            pipeline.frames("/front", scan_of("/front"))[0].features.segments
        )


def test_tracks_are_those_of_the_robot():
    pipeline = pipeline_of(track=True)
    for k in range(4):
        robot = (0.05 * k, 0.0, 0.0)
        pipeline.frames("/rear", scan_of("/rear", k / 10, robot, k))
        (frame,) = pipeline.frames("/front", scan_of("/front", k / 10, robot, k))
    assert len(frame.tracks.segments) == len(frame.features.segments)
    assert frame.travel.pose == pytest.approx((0.15, 0.0, 0.0), abs=0.01)


def test_topics_and_mountings_have_the_namespace():
    rig = LiveConfig("a", merge=("b",), mountings={"b": (1, 0, 0)}, namespace="robot").rig
    assert rig.topics == ("/robot/a", "/robot/b")
    assert rig.mountings == {"/robot/b": (1, 0, 0)}


# A log


@pytest.fixture
def log(tmp_path):
    """A log of two scanners whose scans have the same stamps, the rear ones before."""
    messages = ros_bags.Messages(2)
    items = [("/tf_static", 0, messages.mountings(PLACES))]
    for k in range(8):
        for topic in ("/rear", "/front"):
            scan = scan_of(topic, 5 + k / 10, (0.02 * k, 0.0, 0.0), k)
            items.append((topic, int(1e9 * scan.stamp), messages.of(scan)))
    return str(ros_bags.write(tmp_path, "mcap", items))


def test_a_log_is_played_as_if_its_scanners_were_running(log):
    config = LiveConfig(**MERGING, log=log)
    kept = Kept()
    source = ReplaySource(log, 0, merge=config.rig.topics)
    report = Node(source, MergingPipeline(config), [kept]).run()
    assert report.total.scans == len(kept.frames) == 8
    # Of the scans of one time, those of the first topic come last: none is merged with older ones.
    assert all(len(frame.scan) > 1100 for frame in kept.frames)


def test_scans_of_one_time_are_played_together(log):
    source = ReplaySource(log, 100.0, merge=("/front", "/rear"))
    stamps = []
    while not source.ended:
        stamps += [one.arrived for one in source.receive(1.0) if one.what == "a scan"]
    steps = np.diff(stamps)
    assert steps[::2] == pytest.approx(0, abs=1e-9)
    assert steps[1::2] == pytest.approx(0.001, abs=1e-9)


def test_the_command_plays_it(log, capsys, refused):
    pytest.importorskip("foxglove")
    given = ["--ros", "0", "--foxglove", "0", "--rate", "0", "--unsure", "0.01", "0.5"]
    topics = ["--topic", "/front", "--topic", "/rear"]
    assert run(["live", "--from", log, *topics, *given]) == 0
    said = capsys.readouterr()
    assert "finds features on /front, /rear by optimal" in said.err
    assert said.out.startswith("8 scans")
    said = refused(["live", "--from", log, *topics[:3], "/side", *given])
    assert "/side" in said
    said = refused(["live", "--from", log, *topics, *given, "--mounting", "/side=0,0,0"], 2)
    assert "the mounting is of /side, expected one of /front, /rear" in said


# DDS


def test_two_topics_over_dds(peer, domain):
    fixed = [
        link
        for name, at in PLACES.items()
        for link in link_message(0.0, "base_link", name[1:], at)["transforms"]
    ]
    peer.publish("/tf_static", "TFMessage", True, True)
    for topic in PLACES:
        peer.publish(topic, "LaserScan")
    peer.listen("/front/features", "PointCloud2", 1)
    peer.write("/tf_static", {"transforms": fixed})
    options = {**MERGING, "unsure": (0.01, 0.01)}
    with Running(domain=domain, **options) as node:
        eventually(lambda: all(map(peer.listeners, ("/front", "/rear", "/tf_static"))))

        def cloud():
            for topic in ("/rear", "/front"):
                peer.write(topic, message_of(scan_of(topic), 7.0))
            found = peer.take("/front/features")
            # The first one may be of one scanner alone.
            whole = [one for one in found if len(points_of(one)) > 9]
            return whole[-1] if whole else None

        found = eventually(cloud, pause=0.1)
    assert found["header"]["frame_id"] == "base_link"
    corners = points_of(found)
    assert node.lines[0] == "lineament finds features on /front, /rear by optimal"
    assert len(corners) < 40
