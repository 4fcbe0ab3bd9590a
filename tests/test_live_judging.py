"""The poses of a localiser in a bag are judged as those of a robot, and lines say what changes."""

from __future__ import annotations

import pytest
import ros_bags
from robot_driving import MOUNTING, Moment, carried, driven, written

from lineament import LogError
from lineament.live import Frame, LiveConfig, Pipeline, run_live
from lineament.live.received import JUDGED, LINKS, MOUNTINGS
from lineament.live.terminal import Terminal
from lineament.mapping.evidence import Evidence
from lineament.mapping.following import Whereabouts
from lineament.mapping.locate import LOCATED, LOST, UNKNOWN
from lineament.rosmsg.poses import StampedPose
from lineament.scan.poses import compose

#: The bag has so many scans of a robot where it is believed to be, and then some of elsewhere.
RIGHT, CARRIED = 40, 10


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> str:
    return written(tmp_path_factory.mktemp("plan") / "own.dxf", 1)


def moments() -> list[Moment]:
    """A drive whose robot is carried away in its course."""
    kept = driven()[:RIGHT]
    return [*kept, *carried(kept[-1], 100, CARRIED)]


def claims() -> list[StampedPose]:
    """What the other localiser says: with each second scan, 5 cm off, until the robot is gone."""
    return [
        StampedPose(moment.scan.stamp, "map", "", compose(moment.base, (0.03, -0.04, 0.01)))
        for moment in moments()[:RIGHT:2]
    ]


def bag_of(folder, kind: str, *, odometry: str = "/tf"):
    """Write what a robot beside AMCL records: its pose comes after the scan that it is of."""
    messages, items = ros_bags.Messages(ros_bags.ros_of(kind)), []

    def add(topic: str, stamp: float, message) -> None:
        items.append((topic, round(stamp * 1e9), message))

    fixed = messages.transform(0.0, "base_link", "laser", *MOUNTING)
    add("/tf_static", 90.0, messages.transforms(fixed))
    for moment in moments():
        scan, stamp = moment.scan, moment.scan.stamp
        if odometry == "/tf":
            moved = messages.transform(stamp, "odom", "base_link", *moment.believed)
            ahead = messages.transform(stamp + 1.0, "map", "odom", 1.0, 2.0, 3.0)  # AMCL's own
            add("/tf", stamp, messages.transforms(ahead))
            add("/tf", stamp, messages.transforms(moved))
        else:
            add(odometry, stamp, messages.odometry(stamp, *moment.believed))
        add("/scan", stamp + 0.01, messages.of(scan))
        for claim in claims():
            if claim.stamp == stamp:
                add("/amcl_pose", stamp + 0.02, messages.pose_with_covariance(stamp, *claim.pose))
    return ros_bags.write(folder, kind, items)


def judged(plan: str, path, **options) -> list[str]:
    """Judge a bag as `lineament live --ros 0 --rate 0` does; return its lines."""
    lines: list[str] = []
    given = {"ros": 0, "rate": 0, "map": plan, "log": str(path), "judge": "/amcl_pose", **options}
    run_live(LiveConfig(**given), write=lines.append)
    return lines


def as_live(plan: str) -> list[str]:
    """Verdicts of a node that hears the same of a robot; "" where there is none."""
    pipeline, verdicts, said = Pipeline(LiveConfig(map=plan, judge="/amcl_pose")), [], claims()
    pipeline.hear([StampedPose(0.0, "base_link", "laser", MOUNTING)], MOUNTINGS)
    for moment in moments():
        stamp = moment.scan.stamp
        pipeline.hear([StampedPose(stamp, "odom", "base_link", moment.believed)], LINKS)
        ranges = moment.scan.ranges.astype("f4").astype(float)  # as the bag has them
        scan = moment.scan._changed(ranges=ranges, range_min=0.1, range_max=30.0)
        judgement = pipeline("a", scan).judgement
        verdicts.append("" if judgement is None else judgement.verdict)
        if said and said[0].stamp == stamp:
            pipeline.hear([said.pop(0)], JUDGED)
    return verdicts


@pytest.mark.parametrize("kind", ["rosbag1", "sqlite3", "mcap"])
def test_a_bag_is_judged_as_the_robot_is(tmp_path, plan, kind):
    lines, expected = judged(plan, bag_of(tmp_path, kind)), as_live(plan)
    shares = ", ".join(
        f"{name} {100 * expected.count(name) / (len(expected) - 1):.1f} %"
        for name in ("right", "wrong", "not sure")
    )
    assert expected.count("") == 1  # nothing is said before the first scan
    assert expected.count("wrong") >= CARRIED - 3
    assert lines[-1] == f"/amcl_pose: 49 scans judged, {shares}; 1 without a pose"
    changes = [line.rpartition(" since ")[0] for line in lines if line.startswith("/amcl_pose: ")]
    assert changes[:2] == ["/amcl_pose: right,", "/amcl_pose: wrong,"]
    (since,) = (float(line.split()[-2]) for line in lines if "wrong, since" in line)
    stamp = moments()[RIGHT].scan.stamp
    assert stamp <= since < stamp + 0.5


def test_odometry_by_a_topic_of_the_bag(tmp_path, plan):
    path = bag_of(tmp_path, "mcap", odometry="/odom")
    assert judged(plan, path, odometry="/odom")[-1].startswith("/amcl_pose: 49 scans judged, right")
    (problem,) = (line for line in judged(plan, path) if "not placed" in line)
    assert "no transforms lead from odom to base_link" in problem


def test_a_bag_without_such_poses_and_logs_that_are_none(tmp_path, plan):
    path = bag_of(tmp_path, "rosbag1")
    has_none = "has no geometry_msgs/PoseWithCovarianceStamped on '/pose', to be judged"
    with pytest.raises(LogError, match=has_none):
        judged(plan, path, judge="/pose")
    text = tmp_path / "a.log"
    text.write_text("FLASER 2 1 2 0 0 0 0 0 0 1 robot 1\n")
    with pytest.raises(LogError, match="has no geometry_msgs/PoseWithCovarianceStamped on"):
        judged(plan, text)


# Lines of a status that changes.


def lines_of(*verdicts: str) -> list[str]:
    lines, laser = [], driven()[0].scan
    terminal = Terminal(lines.append, LiveConfig(map="plan.dxf", log="a.bag"))
    for k, verdict in enumerate(verdicts):
        scan = laser.stamped("first", round(1e9 * (100 + k / 5)))
        where = Whereabouts(verdict, (0, 0, 0), UNKNOWN * 0, Evidence(0.0, 0.0, 0.0, 0.0, 9))
        terminal.publish(Frame(scan, scan, None, None, where=where))
    assert not terminal.summary
    return lines


def test_a_robot_that_is_found_and_lost_is_a_line_each():
    assert lines_of(*[LOST] * 5) == []  # it may be found soon
    assert lines_of(*[LOST] * 20) == ["/scan/pose: not on this map, since 100.000 s"]
    assert lines_of(*[LOST] * 3, *[LOCATED] * 9, *[LOST] * 6) == [
        "/scan/pose: located, since 100.600 s",
        "/scan/pose: not on this map, since 102.400 s",
    ]


def test_a_status_that_changes_to_and_fro_is_no_line_each():
    """Nor is one direction that is not observed, with which the pose goes on."""
    flickering = [LOCATED] * 6 + [LOST, LOCATED] * 30 + ["direction unobserved", LOCATED] * 10
    assert lines_of(*flickering) == ["/scan/pose: located, since 100.000 s"]
