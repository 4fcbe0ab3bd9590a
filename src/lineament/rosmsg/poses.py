"""Poses in the plane from serialised ROS messages: odometry, stamped poses, transforms."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..limits import LIMITS, Limits
from ..scan import Array, Pose
from ..scan.fields import NANO, covariance_of_pose
from ..scan.poses import Twist
from .wire import Buffer, WireReader

#: Types of messages that hold one pose, and whether the name of a frame comes before it.
POSE_TYPES = {
    "geometry_msgs/PoseStamped": False,
    "geometry_msgs/PoseWithCovarianceStamped": False,
    "geometry_msgs/TransformStamped": True,
    "nav_msgs/Odometry": True,
}
#: Types of messages that hold many, each of a frame in another one.
TRANSFORMS = ("tf2_msgs/TFMessage", "tf/tfMessage")
#: Those whose pose has a covariance.
_WITH_COVARIANCE = ("geometry_msgs/PoseWithCovarianceStamped", "nav_msgs/Odometry")
#: Rows of x, y and the turn about z in a covariance of six numbers.
IN_PLANE = np.ix_((0, 1, 5), (0, 1, 5))
#: Bytes of a covariance of six numbers.
_COVARIANCE_SIZE = 36 * 8


class StampedPose(NamedTuple):
    """The pose of a frame, or of what the message is about (""), in another at a time [s].

    Its covariance, (3, 3) of x, y, theta, is None where the message does not give a valid one. The
    frame is upside down, turned about its x axis, where its z axis points down.
    """

    stamp: float
    frame: str
    child_frame: str
    pose: Pose
    covariance: Array | None = None
    is_upside_down: bool = False


class Odometry(NamedTuple):
    """A ``nav_msgs/Odometry`` in the plane, without covariances.

    The time [s]; the velocity in the frame of what moves [m/s, m/s, rad/s]; its pose [m, m, rad];
    and the names of the frames of the pose and of what moves.
    """

    stamp: float
    twist: Twist
    pose: Pose
    frame: str
    child_frame: str


def stamped_poses(
    data: Buffer, encoding: str, kind: str, limits: Limits = LIMITS
) -> Iterator[StampedPose]:
    """Decode the poses in a message of a type that has some; ValueError if it is malformed."""
    reader = WireReader(data, encoding, limits)
    for _ in range(reader.count() if kind in TRANSFORMS else 1):
        found = _stamped_pose(reader, POSE_TYPES.get(kind, True))
        if kind in _WITH_COVARIANCE:
            found = found._replace(covariance=_covariance(reader.numbers("36d")))
        yield found


def odometry(data: Buffer, encoding: str) -> Odometry:
    """Decode a ``nav_msgs/Odometry``; ValueError if it is malformed or not finite."""
    reader = WireReader(data, encoding)
    stamp, frame, child_frame, pose, *_ = _stamped_pose(reader, True)
    reader.raw(_COVARIANCE_SIZE)
    vx, vy, _, _, _, wz = reader.numbers("6d")
    reader.raw(_COVARIANCE_SIZE)
    reader.end()
    if not all(map(math.isfinite, (*pose, vx, vy, wz))):
        raise ValueError(f"has pose {pose} and twist {(vx, vy, wz)}, expected finite numbers")
    return Odometry(stamp, (vx, vy, wz), pose, frame, child_frame)


def _covariance(values: tuple[float, ...]) -> Array | None:
    """Covariance in the plane of one of six numbers; None if it is all 0, which means unknown."""
    matrix = np.reshape(values, (6, 6))[IN_PLANE]
    if not matrix.any():
        return None
    try:
        return covariance_of_pose((matrix + matrix.T) / 2)
    except ValueError:
        return None


def _stamped_pose(reader: WireReader, has_child: bool) -> StampedPose:
    stamp, frame = reader.header()
    child_frame = reader.text() if has_child else ""
    x, y, _, *turned = reader.numbers("7d")
    theta, is_upside_down = turn_of(*turned)
    return StampedPose(stamp / NANO, frame, child_frame, (x, y, theta), None, is_upside_down)


def turn_of(qx: float, qy: float, qz: float, qw: float) -> tuple[float, bool]:
    """Turn about z [rad] of a quaternion of any length, as of tf2, and whether z points down.

    One that is typed by hand seldom has length 1; one that is all 0 does not turn.
    """
    theta = math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
    return theta, qx * qx + qy * qy > qz * qz + qw * qw
