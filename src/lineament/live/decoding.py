"""Messages of ROS as they come: decoded when, and if, they are worked at."""

from __future__ import annotations

import math
import time
from functools import cache, partial

from ..logs.ros_bag import Buffer
from ..logs.ros_poses import plane_pose
from ..rosmsg.messages import Decoder, decoders
from ..rosmsg.wire import Wire
from .received import Odometry, Received, Time

__all__ = ["odometry", "received_odometry", "received_scan"]

#: Bytes of a covariance of six numbers.
_COVARIANCE_SIZE = 36 * 8


def received_scan(
    publisher: str, data: Buffer, encoding: str, kind: str, echo: str = "first"
) -> Received:
    r"""Make what a source gives of a serialised scan that came just now.

    Parameters
    ----------
    publisher : str
        Who sent it.
    data : bytes-like
        The message, not yet looked at: it is decoded when it is worked at.
    encoding : str
        ``ros1`` or ``cdr``.
    kind : str
        ``sensor_msgs/LaserScan`` or ``sensor_msgs/MultiEchoLaserScan``.
    echo : {"first", "last", "strongest"}
        Which echo of the latter.

    Raises
    ------
    ValueError
        If the type is another one; from `Received.read`: if the message is malformed.

    Examples
    --------
    >>> scan = received_scan("scanner", b"\x01\0\0\0\x02\0", "ros1", "sensor_msgs/LaserScan")
    >>> scan.read()
    Traceback (most recent call last):
    ValueError: ends early: 16 bytes expected from byte 0, 6 are left
    """
    read = partial(_decoder(kind, echo), data, encoding)
    return Received(publisher, read, time.monotonic(), time=_stamp(data, encoding))


@cache
def _decoder(kind: str, echo: str) -> Decoder:
    known = decoders(echo, ring=None)
    if kind not in known:
        raise ValueError(f"type of scans is {kind!r}, expected one of {', '.join(known)}")
    return known[kind]


def received_odometry(publisher: str, data: Buffer, encoding: str) -> Received:
    """Make what a source gives of a serialised ``nav_msgs/Odometry`` that came just now."""
    return Received(publisher, partial(odometry, data, encoding), time.monotonic(), True)


def _stamp(data: Buffer, encoding: str) -> Time | None:
    """Give the stamp in the header of a message, exactly; None if there is no header."""
    try:
        seconds, nanoseconds, _ = Wire(data, encoding).numbers("header")
    except ValueError:
        return None
    return seconds, nanoseconds


def odometry(data: Buffer, encoding: str) -> Odometry:
    r"""Read a ``nav_msgs/Odometry``: what it says of the plane, without covariances.

    Parameters
    ----------
    data : bytes-like
        The message.
    encoding : str
        ``ros1`` or ``cdr``.

    Raises
    ------
    ValueError
        If the message is malformed, or its pose or twist is not finite.

    Examples
    --------
    >>> import struct
    >>> names = struct.pack("<4I4sI4s", 0, 7, 500_000_000, 4, b"odom", 4, b"base")
    >>> pose = struct.pack("<7d", 1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0) + bytes(288)
    >>> twist = struct.pack("<6d", 0.5, 0.0, 0.0, 0.0, 0.0, 0.25) + bytes(288)
    >>> odometry(names + pose + twist, "ros1")
    Odometry(stamp=7.5, twist=(0.5, 0.0, 0.25), pose=(1.0, 2.0, 0.0),
             frame='odom', child_frame='base')
    """
    wire = Wire(data, encoding)
    stamp, frame = wire.header()
    child_frame = wire.text()
    pose = plane_pose(wire)
    wire.raw(_COVARIANCE_SIZE)
    vx, vy, _, _, _, wz = wire.numbers("6d")
    wire.raw(_COVARIANCE_SIZE)
    wire.end()
    if not all(map(math.isfinite, (*pose, vx, vy, wz))):
        raise ValueError(f"has pose {pose} and twist {(vx, vy, wz)}, expected finite numbers")
    return Odometry(stamp, (vx, vy, wz), pose, frame, child_frame)
