"""A robot that drives through a simulated storey, and what nav2's nodes would send of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import cache
from itertools import islice
from typing import Any, NamedTuple

import lineament as ln
from lineament.mapping import LineMap
from lineament.scan import Pose
from lineament.scan.poses import compose, inverse, relative
from lineament.simulation import SENSORS, Wheels, office

MOUNTING = (0.25, -0.1, 0.4)
RATE = 5.0


class Moment(NamedTuple):
    """A scan, where the robot believes that it has come to, and where it is."""

    scan: ln.LaserScan
    believed: Pose
    base: Pose


@cache
def driven(seed: int = 1, count: int = 60) -> tuple[Moment, ...]:
    """Drive through a storey, from the time 100 s on."""
    storey = office(seed, (30, 20))
    scans, truth = storey.drive(
        SENSORS["lms181"], seed=seed, speed=0.7, rate=RATE, wheels=Wheels(), people=2
    )
    on_robot = inverse(MOUNTING)
    return tuple(
        Moment(
            scan.with_pose(None).stamped("first", round(1e9 * (100 + scan.stamp))),
            compose(scan.pose, on_robot),
            compose(true, on_robot),
        )
        for scan, true in islice(zip(scans, truth, strict=True), count)
    )


@cache
def storey_driven(
    seed: int = 3, count: int = 150, sensor: str = "utm30lx", rate: float = 2.0
) -> tuple[Any, list[ln.LaserScan], list[Pose]]:
    """Return a small storey, scans of a drive with wheels that slip, and where they were taken."""
    storey = office(seed, (24.0, 16.0), visits=0.1)
    scans, truth = storey.drive(SENSORS[sensor], seed=1, rate=rate, people=2, wheels=Wheels())
    return storey, list(islice(scans, count)), truth[:count]


def written(path, seed: int) -> str:
    LineMap.from_lines(office(seed, (30, 20)).plan.segments, side=1).write(path)
    return str(path)


def carried(before: Moment, first: int, count: int = 10) -> list[Moment]:
    """Return moments of a robot that was carried to another part of the drive after one.

    Its wheels do not notice, and its stamps go on.
    """
    elsewhere = driven(1, 150)[first : first + count]
    stamps = (before.scan.stamp_ns + (k + 1) * 200_000_000 for k in range(count))
    return [
        moment._replace(scan=moment.scan.stamped("first", stamp), believed=before.believed)
        for moment, stamp in zip(elsewhere, stamps, strict=True)
    ]


def off(pose: Pose, true: Pose) -> tuple[float, float]:
    x, y, turn = relative(true, pose)
    return math.hypot(x, y), abs(turn)


def placing(peer: Any, scans: str, moments: Iterable[Moment]) -> Callable[[], list[dict]]:
    """Return what lets a robot send the next moment, and gives what has come of `map` → `odom`."""
    following = iter(moments)

    def step() -> list[dict]:
        moment = next(following)
        stamp = moment.scan.stamp
        peer.write("/tf", link_message(stamp, "odom", "base_link", moment.believed))
        peer.write(scans, message_of(moment.scan, stamp))
        came = (one for message in peer.take("/tf") for one in message["transforms"])
        return [one for one in came if one["header"]["frame_id"] == "map"]

    return step


def moment_of(message: dict, later: float = 0.0) -> Moment:
    """Return the moment that a message is of, or a time before it."""
    stamp = message["header"]["stamp"]
    time = stamp["sec"] + stamp["nanosec"] / 1e9 - later
    (moment,) = (one for one in driven(1, 150) if abs(one.scan.stamp - time) < 1e-6)
    return moment


def header(stamp: float, frame: str) -> dict:
    sec = math.floor(stamp)
    return {"stamp": {"sec": sec, "nanosec": round(1e9 * (stamp - sec))}, "frame_id": frame}


def link_message(stamp: float, parent: str, child: str, pose: Pose) -> dict:
    x, y, theta = pose
    turned = {"z": math.sin(theta / 2), "w": math.cos(theta / 2)}
    transform = {"translation": {"x": x, "y": y}, "rotation": turned}
    link = {"header": header(stamp, parent), "child_frame_id": child, "transform": transform}
    return {"transforms": [link]}


def pose_of(link: dict) -> Pose:
    place, turned = link["translation"], link["rotation"]
    return place["x"], place["y"], 2 * math.atan2(turned["z"], turned["w"])


def message_of(scan: ln.LaserScan, stamp: float) -> dict[str, Any]:
    """A LaserScan as a driver writes it, at another time."""
    return {
        "header": header(stamp, scan.frame_id),
        "angle_min": scan.angle_min,
        "angle_increment": scan.angle_increment,
        "range_max": 30.0,
        "ranges": scan.ranges.tolist(),
    }
