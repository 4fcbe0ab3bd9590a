"""A robot on a plan: its frames, what it is asked, and that it is never said to be where it is not.

The robot drives through a simulated storey; its scanner is mounted ahead, and turned.
"""

from __future__ import annotations

import math
import struct
import time
from copy import copy
from functools import partial
from itertools import count

import numpy as np
import pytest
from in_memory import Given, Taken
from live_driving import Running, eventually, heard
from robot_driving import (
    MOUNTING,
    Moment,
    carried,
    driven,
    link_message,
    moment_of,
    off,
    placing,
    pose_of,
    written,
)

from lineament.live import Frame, LiveConfig, Node, Pipeline, Received, RosSink
from lineament.live.received import GUESS, JUDGED, LINKS, MAP, MOUNTINGS, ODOMETRY, RELOCATE, wanted
from lineament.mapping import LineMap
from lineament.output.ros_messages import RosMessages
from lineament.rosmsg.frames import Frames
from lineament.rosmsg.grids import OccupancyGrid
from lineament.rosmsg.poses import Odometry, StampedPose, stamped_poses
from lineament.scan import Pose
from lineament.scan.poses import compose
from lineament.simulation import office

POSE = "geometry_msgs/PoseWithCovarianceStamped"


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> str:
    return written(tmp_path_factory.mktemp("plan") / "own.dxf", 1)


class Robot:
    """A pipeline on a plan, and what a robot says to it."""

    def __init__(self, plan: str, **options) -> None:
        self.pipeline = Pipeline(LiveConfig(map=plan, **options))
        # Where the scanner is, by way of a frame between.
        self.say(MOUNTINGS, StampedPose(0.0, "base_footprint", "/base_link", (0.0, 0.0, 0.0)))
        self.say(MOUNTINGS, StampedPose(0.0, "base_link", "laser", MOUNTING))

    def say(self, what: str, *links: StampedPose) -> None:
        self.pipeline.hear(list(links), what)

    def move(self, moment: Moment, late: float = 0.0) -> None:
        stamp = moment.scan.stamp - late
        self.say(LINKS, StampedPose(stamp, "odom", "base_footprint", moment.believed))

    def see(self, moment: Moment) -> Frame:
        return self.pipeline("scanner", moment.scan)

    def drive(self, moments) -> list[Frame]:
        frames = []
        for moment in moments:
            self.move(moment)
            frames.append(self.see(moment))
        return frames


def assert_right(frame: Frame, moment: Moment, most: float = 0.05) -> None:
    """The robot is where it is said to be, also by way of its odometry."""
    on_plan = compose(frame.placed.odom, moment.believed)
    for pose in (frame.placed.base, on_plan):
        way, turn = off(pose, moment.base)
        assert way < most
        assert turn < 0.02
    error = np.subtract(frame.placed.base, moment.base)
    error[2] = math.remainder(error[2], 2 * math.pi)
    assert error @ np.linalg.solve(frame.placed.covariance, error) < 40


def test_a_robot_is_placed_with_its_scanner_mounted_and_its_odometry(plan):
    frames = Robot(plan).drive(driven())
    placed = [(f, m) for f, m in zip(frames, driven(), strict=True) if f.placed]
    assert len(placed) > 30
    for frame, moment in placed:
        assert_right(frame, moment)
    assert frames[-1].placed
    assert all(bool(f.placed) == f.where.is_known for f in frames)


def test_a_scanner_upside_down_and_odometry_by_a_topic(plan):
    """Its frame is turned about x: bearings count the other way."""
    robot = Robot(plan, odometry="/odom")
    fixed = StampedPose(0.0, "base_link", "laser", MOUNTING, None, True)
    robot.say(MOUNTINGS, fixed)
    for moment in driven():
        odometry = Odometry(
            moment.scan.stamp, (0.0, 0.0, 0.0), moment.believed, "odom", "base_footprint"
        )
        robot.pipeline.hear(odometry, ODOMETRY)
        robot.say(LINKS, StampedPose(moment.scan.stamp, "odom", "base_footprint", (9.0, 9.0, 1.0)))
        frame = robot.pipeline("scanner", moment.scan.turned_over())
    assert_right(frame, moment)


def located(plan: str, count: int = 30, **options) -> tuple[Robot, list[Frame]]:
    robot = Robot(plan, **options)
    frames = robot.drive(driven()[:count])
    assert frames[-1].placed
    return robot, frames


def test_a_robot_that_is_carried_away_is_nowhere_within_half_a_second(plan):
    robot, _ = located(plan)
    lifted = carried(driven()[29], 140)
    assert off(driven()[29].base, lifted[0].base)[0] > 2.5
    frames = robot.drive(lifted)
    for frame, moment in list(zip(frames, lifted, strict=True))[2:]:
        if frame.placed:
            assert off(frame.placed.base, moment.base)[0] < 0.2
    assert not frames[1].placed


def test_initial_poses_are_guesses_that_scans_have_to_confirm(plan):
    moments = driven()
    robot, here = Robot(plan), moments[0].base

    def guess(by: Pose, **fields) -> None:
        said = StampedPose(fields.pop("stamp", 0.0), "map", "", compose(here, by))
        robot.say(GUESS, said._replace(**fields))

    # Of two the later counts, and the wrong one does no harm.
    guess((4.0, 2.0, 1.0))
    guess((0.2, -0.1, 0.1), covariance=np.diag((0.25, 0.25, 0.07)))
    frames = robot.drive(moments[:3])
    assert_right(frames[-1], moments[2])
    # That is forgotten where another is said; a wrong one is refused, and the robot found again.
    guess((6.0, 3.0, 2.0))
    frames = robot.drive(moments[3:60])
    assert not frames[0].placed
    for frame, moment in zip(frames, moments[3:60], strict=True):
        assert frame.placed is None or off(frame.placed.base, moment.base)[0] < 0.2
    assert frames[-1].placed


def test_an_initial_pose_of_a_while_ago_is_moved_by_the_odometry(plan):
    moments, robot = driven(), Robot(plan)
    robot.drive(moments[:20])
    robot.say(GUESS, StampedPose(moments[10].scan.stamp, "/map", "", moments[10].base))
    (frame,) = robot.drive(moments[20:21])
    assert_right(frame, moments[20])


def test_initial_poses_that_make_no_sense(plan):
    robot = Robot(plan)
    with pytest.raises(ValueError, match="it is in frame 'odom', expected 'map'"):
        robot.say(GUESS, StampedPose(0.0, "odom", "", (0.0, 0.0, 0.0)))
    (initial,) = (one for one in wanted(LiveConfig(map=plan)) if one.what == GUESS)
    header = struct.pack("<3I4s", 1, 0, 4, b"map\0")
    numbers = struct.pack("<7d36d", math.nan, *[0.0] * 5, 1.0, *[0.0] * 36)
    with pytest.raises(ValueError, match="expected numbers below"):
        initial.received("a", b"\0\1\0\0" + header + numbers, "cdr").read()


def test_a_robot_is_looked_for_anew(plan):
    robot, _ = located(plan)
    robot.pipeline.hear(None, RELOCATE)
    frames = robot.drive(driven()[30:60])
    assert not frames[0].placed
    assert_right(frames[-1], driven()[59])


@pytest.mark.parametrize("seed", [2, 3])
def test_on_the_plan_of_another_building_there_is_no_transform(tmp_path, seed):
    robot = Robot(written(tmp_path / "other.dxf", seed))
    for k, moment in enumerate(driven()):
        if k % 7 == 0:
            robot.say(GUESS, StampedPose(0.0, "map", "", moment.base))
        robot.move(moment)
        assert robot.see(moment).placed is None


def test_a_gap_in_the_tree_is_a_line_and_no_transform(plan):
    robot, _ = located(plan)
    frames = [robot.see(moment) for moment in driven()[30:60]]  # without odometry
    assert frames[0].placed
    assert all(frame.placed is None or frame.placed.odom is None for frame in frames)
    (problem,) = robot.pipeline.problems()
    assert problem.startswith("the robot is not placed: base_footprint in odom is known only at e")
    robot.move(driven()[59])
    assert list(robot.pipeline.problems()) == [problem]
    robot.pipeline = Pipeline(LiveConfig(map=plan))
    frames = robot.drive(driven()[:30])
    assert not any(frame.placed for frame in frames)
    assert "no transforms lead from base_link to laser" in " ".join(robot.pipeline.problems())
    assert any(frame.where.is_known for frame in frames)  # the scanner itself is


class Seconds:
    """A clock by which a second passes each time that it is asked."""

    time_ns = staticmethod(time.time_ns)

    def __init__(self) -> None:
        self.monotonic = partial(next, count(1.0))


def test_a_gap_that_lasts_is_one_line(plan, monkeypatch):
    """Of a node that reports after each scan."""
    robot, _ = located(plan)
    monkeypatch.setattr("lineament.live.node.time", Seconds())
    batches = [[Received("a", partial(copy, moment.scan), 0.0)] for moment in driven(1, 150)[30:]]
    lines: list[str] = []
    Node(Given(*batches, []), robot.pipeline, [], write=lines.append).run()
    assert [line for line in lines if "not placed" in line] == [
        "the robot is not placed: base_footprint in odom is known only at earlier stamps, "
        "expected on /tf, or a topic of odometry"
    ]


def test_a_driver_that_is_started_again_goes_on(plan):
    robot, _ = located(plan)
    robot.move(driven()[30])
    frame = robot.pipeline("another publisher", driven()[30].scan)
    assert_right(frame, driven()[30])


def test_somebody_else_who_places_the_robot_is_a_line(plan):
    robot, frames = located(plan)
    ours = StampedPose(200.0, "map", "odom", frames[-1].placed.odom)
    robot.say(LINKS, ours)
    assert not list(robot.pipeline.problems())
    robot.say(LINKS, ours._replace(pose=(1.0, 2.0, 3.0)))
    (problem,) = robot.pipeline.problems()
    assert problem.startswith("map → odom is on /tf from another node as well")
    quiet, _ = located(plan, broadcast=False)
    quiet.say(LINKS, ours._replace(pose=(1.0, 2.0, 3.0)))
    assert not list(quiet.pipeline.problems())


# Another localiser is judged.


def believes(robot: Robot, moment: Moment, by: Pose = (0.03, -0.04, 0.01)) -> None:
    robot.say(JUDGED, StampedPose(moment.scan.stamp, "map", "", compose(moment.base, by)))


def test_a_pose_that_is_right_and_one_after_the_robot_was_carried(plan):
    robot, moments = Robot(plan, judge="/amcl_pose"), driven()
    assert robot.drive(moments[:1])[0].judgement is None  # nobody has said anything
    believes(robot, moments[0])
    frames = robot.drive(moments[1:40])
    # It is judged with each scan: between its poses it moves on with the odometry.
    assert all(frame.judgement.verdict != "wrong" for frame in frames)
    assert all(frame.judgement for frame in frames[20:])
    last = frames[-1].judgement
    assert off(last.pose, compose(moments[39].base, MOUNTING))[0] < 0.25
    assert math.hypot(*last.off[:2]) < 0.25
    first, second, *_ = robot.drive(carried(moments[39], 100))
    assert not first.judgement
    assert second.judgement.verdict == "wrong"


def test_poses_to_judge_that_make_no_sense(plan):
    robot, moments = Robot(plan, judge="/amcl_pose"), driven()
    with pytest.raises(ValueError, match="it is in frame 'world', expected 'map'"):
        robot.say(JUDGED, StampedPose(0.0, "world", "", (0.0, 0.0, 0.0)))
    robot.say(JUDGED, StampedPose(7.0, "map", "", moments[0].base))  # a clock that is another one
    frames = robot.drive(moments[:30])
    assert not any(frame.judgement for frame in frames)
    (problem,) = robot.pipeline.problems()
    assert problem.startswith("the robot is not judged: base_footprint in odom is known only at la")


def test_what_is_published_of_a_pose_that_is_judged(plan):
    config, robot = LiveConfig(map=plan, judge="amcl_pose"), Robot(plan, judge="x")
    taken = Taken(("/amcl_pose/verdict", "/amcl_pose/ours", "/tf"))
    sink = RosSink(taken, RosMessages("cdr"), config)
    assert not {"/tf", "/amcl_pose"} & set(taken._topics)  # that is for the other one
    for k, moment in enumerate(driven()[:40]):
        believes(robot, moment, (0.0, 0.0, 0.0) if k < 38 else (5.0, 1.0, 1.5))
        robot.move(moment)
        sink.publish(robot.see(moment))
        if k == 37:
            assert not taken.data("/amcl_pose/ours")
            assert b"right\0" in taken.data("/amcl_pose/verdict")[-1]
    assert len(taken.data("/amcl_pose/verdict")) == 40
    assert b"wrong\0" in taken.data("/amcl_pose/verdict")[-1]
    assert b"wrong\0" in taken.data("/diagnostics")[-1]
    (ours,) = stamped_poses(taken.data("/amcl_pose/ours")[-1], "cdr", POSE)
    assert off(ours.pose, moment.base)[0] < 0.05


# Frames.


def test_frames_move_at_constant_velocity_between_poses_and_a_little_after():
    frames, ring = Frames(), math.remainder
    for k in range(5):
        turn = 3.0 + 0.1 * k
        pose = (math.sin(turn), -math.cos(turn), ring(turn, 2 * math.pi))
        frames.add(StampedPose(10 + 0.1 * k, "odom", "base", pose))
    for stamp in (10.0, 10.07, 10.2, 10.33, 10.4, 10.55):
        turn = 3.0 + stamp - 10
        expected = (math.sin(turn), -math.cos(turn), ring(turn, 2 * math.pi))
        assert frames.find("odom", "base", stamp).pose == pytest.approx(expected)
    for stamp, where in (
        (9.99, "later stamps"),
        (10.61, "earlier stamps"),
        (1.7e9, "stamps hours away, by another clock"),
    ):
        with pytest.raises(LookupError, match=f"base in odom is known only at {where}$"):
            frames.find("odom", "base", stamp)
    # What comes late changes nothing; a clock that is set back begins anew.
    frames.add(StampedPose(10.1, "odom", "base", (9.0, 9.0, 9.0)))
    assert frames.find("odom", "base", 10.4).pose[0] < 1.1
    frames.add(StampedPose(3.0, "odom", "base", (1.0, 0.0, 0.0)))
    frames.add(StampedPose(3.6, "odom", "base", (2.0, 0.0, 0.0)))
    assert frames.find("odom", "base", 3.6).pose == (2.0, 0.0, 0.0)
    with pytest.raises(LookupError, match=r"known only around a gap of more than 0\.5 s"):
        frames.find("odom", "base", 3.3)


def test_odometry_that_begins_anew_is_not_a_way():
    """Between its last pose and the first one after it, and behind that alone, nothing is known."""
    frames = Frames()
    for stamp, x in ((1.0, 0.0), (1.1, 0.9), (1.2, 9.0), (1.3, 9.1)):
        frames.add(StampedPose(stamp, "odom", "base", (x, 0.0, 0.0)))
        if x == 9.0:
            with pytest.raises(LookupError, match="base in odom jumps"):
                frames.find("odom", "base", 1.25)
    assert frames.find("odom", "base", 1.05).pose[0] == pytest.approx(0.45)
    with pytest.raises(LookupError, match="base in odom jumps"):
        frames.find("odom", "base", 1.15)
    assert frames.find("odom", "base", 1.2).pose[0] == 9.0
    assert frames.find("odom", "base", 1.25).pose[0] == pytest.approx(9.05)


def test_a_tree_that_is_a_ring_or_leads_elsewhere_is_refused():
    frames = Frames()
    for parent, child in (("a", "b"), ("b", "a"), ("c", "d")):
        frames.add(StampedPose(0.0, parent, child, (1.0, 0.0, 0.0)), is_fixed=True)
    for child in ("a", "d", "unknown"):
        with pytest.raises(LookupError, match=f"no transforms lead from odom to {child}"):
            frames.find("odom", child, 0.0)
    assert frames.find("c", "c", 0.0).pose == (0.0, 0.0, 0.0)
    frames.add(StampedPose(0.0, "d", "e", (0.0, 1.0, 0.5), None, True), is_fixed=True)
    frames.add(StampedPose(0.0, "e", "f", (0.0, 1.0, 0.0)), is_fixed=True)
    x, y, theta = frames.find("c", "f", 0.0).pose
    assert frames.find("c", "f", 0.0).is_upside_down
    assert (x, y, theta) == pytest.approx((1 + math.sin(0.5), 1 - math.cos(0.5), 0.5))


# What is published.


@pytest.mark.parametrize("broadcast", [True, False])
def test_what_is_published_of_a_robot_that_is_found_and_lost(plan, broadcast):
    config = LiveConfig(map=plan, broadcast=broadcast, transform_tolerance=0.25, map_frame="floor")
    robot, taken = Robot(plan, map_frame="floor"), Taken(("/tf", "/scan/pose"))
    sink = RosSink(taken, RosMessages("cdr"), config)
    counts = []
    moments = driven()[:40]
    for k, moment in enumerate(moments):
        if k == 30:
            robot.pipeline.hear(None, RELOCATE)
        if k < 39:
            robot.move(moment)
        frame = robot.see(moment)
        sink.publish(frame)
        counts.append((len(taken.data("/tf")), len(taken.data("/amcl_pose"))))
        assert (counts[-1] != (counts[-2] if k else (0, 0))) == bool(frame.placed)
        if k == 29:
            statuses = len(taken.data("/diagnostics"))
        if k == 30:  # at once, not with the next report
            assert len(taken.data("/diagnostics")) == statuses + 1
            assert b"not on this map" in taken.data("/diagnostics")[-1] or frame.placed is None
        if k == 29 and broadcast:
            (link,) = stamped_poses(taken.data("/tf")[-1], "cdr", "tf2_msgs/TFMessage")
            assert (link.frame, link.child_frame) == ("floor", "odom")
            assert link.stamp == pytest.approx(moment.scan.stamp + 0.25)
            assert link.pose == pytest.approx(frame.placed.odom)
    (base,) = stamped_poses(taken.data("/amcl_pose")[29 - 1], "cdr", POSE)
    assert base.frame == "floor"
    assert (counts[-1][0] > 0) == broadcast
    assert "/amcl_pose" in taken._latched


def test_over_dds_as_nav2_has_it(peer, domain, plan):
    """A mounting that was said before the node came, and a pose for who comes after it."""
    peer.publish("/scan", "LaserScan")
    peer.publish("/tf", "TFMessage")
    peer.publish("/tf_static", "TFMessage", True, True)
    peer.publish("/initialpose", "PoseWithCovarianceStamped")
    peer.publish("/scan/relocate", "Empty")
    peer.listen("/tf", "TFMessage", 100)
    peer.write("/tf_static", link_message(0.0, "base_link", "laser", MOUNTING))
    with Running(domain=domain, map=plan, base_frame="base_link") as node:
        told = ("/scan", "/tf", "/tf_static", "/initialpose", "/scan/relocate")
        eventually(lambda: all(map(peer.listeners, told)))
        found, *_ = eventually(placing(peer, "/scan", driven()), pause=0.05)
        peer.listen("/amcl_pose", "PoseWithCovarianceStamped", 1, True)
        pose = heard(peer, "/amcl_pose")  # nothing is sent meanwhile
    moment = moment_of(found, later=1.0)
    base = compose(pose_of(found["transform"]), moment.believed)
    assert off(base, moment.base)[0] < 0.05
    assert found["child_frame_id"] == "odom"
    assert pose["header"]["frame_id"] == "map"
    assert not any("sense" in line for line in node.lines)


def test_a_map_that_is_not_latched_is_a_line(peer, domain):
    peer.publish("/map", "OccupancyGrid")
    with Running(domain=domain, map="/map") as node:
        line = "/map is published with another QoS policy 2, expected transient local (latched)"
        eventually(lambda: line in node.lines)


# A map on a topic.


def grid_of(seed: int, resolution: float = 0.05) -> OccupancyGrid:
    """The storey as a robot has mapped it: what is around it is unknown."""
    grid = LineMap.from_lines(office(seed, (30, 20)).plan.segments, side=1).to_grid(resolution)
    cells = np.where(grid.occupied, 100, 0).astype(np.int8)
    return OccupancyGrid("map", cells, resolution, grid.origin)


def test_a_map_on_a_topic_and_another_one_that_follows():
    robot, moments = Robot("/map"), driven()
    frame = robot.drive(moments[:1])[0]
    assert (frame.where, frame.placed) == (None, None)
    taken = Taken(())
    RosSink(taken, RosMessages("cdr"), LiveConfig(map="/map")).publish(frame)
    assert b"no map on /map\0" in taken.data("/diagnostics")[-1]
    robot.pipeline.hear(grid_of(1), MAP)
    frames = robot.drive(moments[1:30])
    assert_right(frames[-1], moments[29], 0.1)
    # The same once more changes nothing; one that is finer is gone on with from where it is.
    robot.pipeline.hear(grid_of(1), MAP)
    robot.pipeline.hear(grid_of(1, 0.04), MAP)
    frames = robot.drive(moments[30:38])
    assert_right(frames[-1], moments[37], 0.1)
    for seed, at in ((2, 38), (5, 60), (12, 80)):  # they are storeys of the same size
        robot.pipeline.hear(grid_of(seed), MAP)
        frames = robot.drive(moments[at : at + 20])
        assert not any(frame.placed for frame in frames)
    for grid, problem in (
        (grid_of(1)._replace(frame="world"), "it is in frame 'world', expected 'map'"),
        (grid_of(1)._replace(cells=np.zeros((9, 9), np.int8)), "has no walls: 0 of 81"),
    ):
        with pytest.raises(ValueError, match=problem):
            robot.pipeline.hear(grid, MAP)


def grid_message(resolution=0.05, size=(2, 3), n=6, turned=(0.0, 0.0, 0.0, 1.0)) -> bytes:
    header = struct.pack("<3I4s", 1, 0, 4, b"map\0")
    about = struct.pack("<2If2I4x7d", 0, 0, resolution, *size, 1.0, 2.0, 0.0, *turned)
    return b"\0\1\0\0" + header + about + struct.pack(f"<I{n}b", n, *range(-1, n - 1))


def test_maps_as_they_are_sent():
    (wanted_map,) = (one for one in wanted(LiveConfig(map="map")) if one.what == MAP)
    assert (wanted_map.topic, wanted_map.is_latched) == ("/map", True)
    read = partial(wanted_map.read, encoding="cdr")
    grid = read(grid_message(turned=(0.0, 0.0, math.sin(0.25), math.cos(0.25))))
    assert grid.cells.tolist() == [[-1, 0], [1, 2], [3, 4]]
    assert (grid.frame, grid.origin) == ("map", pytest.approx((1.0, 2.0, 0.5)))
    assert read(grid_message(turned=(0.0, 0.0, 1.0, 1.0))).origin[2] == pytest.approx(math.pi / 2)
    for message, problem in (
        (grid_message(0.0), "has cells of 0 m"),
        (grid_message(math.nan), "has cells of nan m"),
        (grid_message(size=(2, 2)), "has 6 cells, expected 2 x 2"),
        (grid_message(size=(0, 0), n=0), "has 0 cells"),
        (grid_message()[:-3], "ends early"),
        (grid_message(turned=(1.0, 0.0, 0.0, 0.0)), "its origin is not level"),
        (grid_message(turned=(math.nan, 0.0, 0.0, 1.0)), "has cells of 0.05 m"),
    ):
        with pytest.raises(ValueError, match=problem):
            read(message)
