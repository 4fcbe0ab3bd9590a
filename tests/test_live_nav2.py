"""The command as nav2's localiser, beside a robot of another process, at 40 Hz.

The node is killed and started again, then the robot; clocks jump an hour ahead, and back to the
start of a bag that is played anew; an initial pose is wrong. A transform that places the robot
farther off than is claimed is never sent, and the status says when it is not known where it is.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import cycle
from typing import Any

import numpy as np
import pytest
from live_driving import Remote, eventually
from robot_driving import MOUNTING, Moment, driven, link_message, message_of, off, pose_of, written

from lineament.mapping import LineMap
from lineament.scan import Pose
from lineament.scan.poses import compose
from lineament.simulation import office

pytestmark = pytest.mark.slow

RATE = 40.0
#: What the node listens to, and its types.
HEARD = {"/scan": "LaserScan", "/tf": "TFMessage", "/initialpose": "PoseWithCovarianceStamped"}
#: Levels of the status.
LOCATED, NOT_KNOWN, NO_SCANS = 0, 2, 3


class Robot:
    """Sends scans and odometry of a drive, and checks each transform that comes back.

    With a map it sends that, too, and odometry on a topic of its own in place of /tf.
    """

    def __init__(self, domain: int, map_message: dict[str, Any] | None = None) -> None:
        self.peer = Remote("dds_peer", domain, "2s")
        self.told = HEARD if map_message is None else HEARD | {"/odom": "Odometry"}
        for topic, kind in self.told.items():
            self.peer.publish(topic, kind)
        self.peer.publish("/tf_static", "TFMessage", True, True)
        self.peer.write("/tf_static", link_message(0.0, "base_link", "laser", MOUNTING))
        if map_message is not None:
            self.peer.publish("/map", "OccupancyGrid", True, True)
            self.peer.write("/map", map_message)
        self.peer.listen("/tf", "TFMessage", 1000)
        self.peer.listen("/amcl_pose", "PoseWithCovarianceStamped", 1000)
        self.peer.listen("/diagnostics", "DiagnosticArray", 1000)
        self.sent: dict[int, Moment] = {}
        self.claimed: dict[int, tuple[float, float]] = {}
        self.due = time.perf_counter()

    def close(self) -> None:
        self.peer.close()

    def wait_for_the_node(self) -> None:
        eventually(lambda: all(self.peer.listeners(topic) for topic in self.told))

    def send(self, moment: Moment, later: float) -> None:
        """Send what a robot has at a moment, by a clock that is that much later."""
        stamp = moment.scan.stamp + later
        self.sent[round(1e3 * stamp)] = moment
        link = link_message(stamp, "odom", "base_link", moment.believed)
        if "/odom" in self.told:
            self.peer.write("/odom", odometry_of(*link["transforms"]))
        else:
            self.peer.write("/tf", link)
        self.peer.write("/scan", message_of(moment.scan, stamp))
        self.due = max(self.due + 1 / RATE, time.perf_counter() - 1.0)
        time.sleep(max(0.0, self.due - time.perf_counter()))

    def placed(self) -> int:
        """Check the transforms that have come, and count them.

        Where a busy machine has held up scans for seconds of the drive, the pose is less sure, and
        says so: its message is sent before the transform.
        """
        links = [link for message in self.peer.take("/tf") for link in message["transforms"]]
        for claim in self.peer.take("/amcl_pose"):
            covariance = np.reshape(claim["pose"]["covariance"], (6, 6))
            of_way = math.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[1])
            self.claimed[milliseconds(claim)] = of_way, math.sqrt(covariance[5, 5])
        placed = [link for link in links if link["header"]["frame_id"] == "map"]
        for link in placed:
            stamp = milliseconds(link) - 1000  # They hold for a second from the scan on.
            moment = self.sent[stamp]
            way, turn = off(compose(pose_of(link["transform"]), moment.believed), moment.base)
            of_way, of_turn = self.claimed.get(stamp, (0.0, 0.0))
            assert way < max(0.1, 3 * of_way), "a transform places the robot wrongly"
            assert turn < max(0.03, 3 * of_turn)
        return len(placed)

    def levels(self) -> set[int]:
        """Return the levels of the status of the pose that have come."""
        statuses = (one for told in self.peer.take("/diagnostics") for one in told["status"])
        return {one["level"] for one in statuses if one["name"] == "lineament: /scan/pose"}

    def guess(self, pose: Pose) -> None:
        """Send an initial pose, as RViz does."""
        (link,) = link_message(0.0, "map", "", pose)["transforms"]
        placed = {"header": link["header"], "pose": {"pose": pose_message(link)}}
        self.peer.write("/initialpose", placed)

    def until_placed(self, moments: Iterator[Moment], later: float) -> None:
        """Drive on until the robot has been placed ten times, and the status says so."""
        counts, levels = [], set()

        def is_placed() -> bool:
            self.send(next(moments), later)
            counts.append(self.placed())
            levels.update(self.levels())
            return sum(counts) >= 10 and LOCATED in levels

        eventually(is_placed, pause=0.0)


def milliseconds(message: dict[str, Any]) -> int:
    """The stamp of a message."""
    stamp = message["header"]["stamp"]
    return round(1e3 * stamp["sec"] + stamp["nanosec"] / 1e6)


def pose_message(link: dict[str, Any]) -> dict[str, Any]:
    """A Pose, by what says the same as a transform."""
    transform = link["transform"]
    return {"position": transform["translation"], "orientation": transform["rotation"]}


def odometry_of(link: dict[str, Any]) -> dict[str, Any]:
    """An Odometry, by what says the same on /tf."""
    return {
        "header": link["header"],
        "child_frame_id": link["child_frame_id"],
        "pose": {"pose": pose_message(link)},
    }


def map_message() -> dict[str, Any]:
    """The storey as map_server sends it."""
    walls = office(1, (30, 20)).plan.segments
    grid = LineMap.from_lines(walls, side=1).to_grid(0.05)
    cells = np.where(grid.occupied, 100, 0).astype(np.int8)
    height, width = cells.shape
    x, y, _ = grid.origin
    info = {"resolution": 0.05, "width": width, "height": height}
    info["origin"] = {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}}
    return {"header": {"frame_id": "map"}, "info": info, "data": cells.ravel().tolist()}


@pytest.mark.parametrize("is_topic", [False, True], ids=["file and tf", "topics"])
def test_killed_started_again_and_with_clocks_that_jump(started, domain, tmp_path, is_topic):
    options = ["--map", "/map", "--odometry", "/odom"]
    if not is_topic:
        options = ["--map", written(tmp_path / "own.dxf", 1)]
    message = map_message() if is_topic else None
    moments = cycle(driven(count=300))
    with closing(Robot(domain, message)) as robot:
        node = started(*options)
        node.until_it_writes("finds features")
        robot.wait_for_the_node()
        robot.until_placed(moments, 0.0)
        node.kill()
        node = started(*options)
        # The mounting and the map, which were sent once, are latched.
        node.until_it_writes("finds features")
        robot.wait_for_the_node()
        robot.until_placed(moments, 0.0)
        # An hour ahead, and back to the start: a bag that is played anew.
        robot.until_placed(moments, 3600.0)
        robot.until_placed(moments, -90.0)
        # A guess that scans deny: it is not known where the robot is until it was found again.
        robot.guess((-6.0, -3.0, 2.0))
        levels: set[int] = set()

        def is_denied() -> bool:
            robot.send(next(moments), -90.0)
            robot.placed()
            levels.update(robot.levels())
            return NOT_KNOWN in levels

        eventually(is_denied, pause=0.0)
        robot.until_placed(moments, -90.0)
    with closing(Robot(domain, message)) as robot:
        robot.wait_for_the_node()
        eventually(lambda: NO_SCANS in robot.levels())
        robot.until_placed(cycle(driven(count=300)), 7200.0)
    assert not any("Traceback" in line for line in node.lines)
    assert node.stop().endswith("malformed messages\n")
