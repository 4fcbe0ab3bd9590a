"""Messages of ROS as they arrive: decoded when, and if, they are processed."""

import time
from functools import cache, partial

from ..rosmsg.poses import odometry
from ..rosmsg.scans import Decoder, decoders
from ..rosmsg.wire import Buffer, WireReader
from .received import Received, Time


def received_scan(
    publisher: str, data: Buffer, encoding: str, kind: str, echo: str = "first"
) -> Received:
    r"""Return what a source gives of a serialised scan that has just arrived.

    Parameters
    ----------
    publisher : str
        Who sent it.
    data : bytes-like
        The message; `Received.read` decodes it.
    encoding : {"ros1", "cdr"}
        How it is serialised.
    kind : {"sensor_msgs/LaserScan", "sensor_msgs/MultiEchoLaserScan"}
        Its type.
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
    """Return what a source gives of a serialised ``nav_msgs/Odometry`` that has just arrived."""
    return Received(publisher, partial(odometry, data, encoding), time.monotonic(), True)


def _stamp(data: Buffer, encoding: str) -> Time | None:
    """Stamp in the header of a message, exactly; None if there is no header."""
    try:
        seconds, nanoseconds, _ = WireReader(data, encoding).numbers("header")
    except ValueError:
        return None
    return seconds, nanoseconds
