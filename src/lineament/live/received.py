"""Messages that a live node receives, where they come from, and where they wait."""

import time
from collections import deque
from collections.abc import Callable
from functools import cache, partial
from threading import Condition
from typing import NamedTuple, Protocol

from ..limits import LIMITS, Limits
from ..rosmsg.poses import Odometry, odometry
from ..rosmsg.scans import Decoder, decoders
from ..rosmsg.wire import Buffer
from ..scan import LaserScan

#: Publishers that an inbox has room for: a robot has fewer, unless names are made up.
_MOST_PUBLISHERS = 64


class Received(NamedTuple):
    """A message as it came; it is decoded by `read`, since most of those that wait never are.

    Attributes
    ----------
    publisher : str
        Who sent it; only the newest scan of each publisher is processed.
    read : callable
        Decodes it; raises ValueError, in one line, if it is malformed.
    arrived : float
        When it was taken, by the clock `time.monotonic` [s].
    is_odometry : bool
        Whether it is an odometry rather than a scan.
    """

    publisher: str
    read: Callable[[], LaserScan | Odometry]
    arrived: float
    is_odometry: bool = False


class Source(Protocol):
    """Where scans come from: a topic, or a log that is played."""

    @property
    def lost(self) -> int:
        """Scans that are known to have been lost before they could be received."""

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""

    @property
    def publishers(self) -> int:
        """Number of publishers of scans at the moment."""

    def receive(self, timeout: float) -> list[Received]:
        """Wait up to `timeout` seconds, and return all messages that came, oldest first."""

    def problems(self) -> list[str]:
        """Return what keeps messages from coming, a line each."""

    def close(self) -> None:
        """Stop listening."""


class Inbox:
    """The newest messages of each publisher, from a transport's threads until they are taken.

    Up to `depth` of a publisher wait. One that sends faster than is taken displaces its own
    messages, never another's; `lost` counts the scans that were displaced, or lost on the way.
    """

    def __init__(self, depth: int) -> None:
        self.lost = 0
        self._depth = depth
        self._waiting: dict[tuple[str, bool], deque[Received]] = {}
        self._changed = Condition()

    def put(self, received: Received, missing: int = 0) -> None:
        """Add a message; `missing` scans are known to have been lost just before it."""
        key = received.publisher, received.is_odometry
        with self._changed:
            if key not in self._waiting and len(self._waiting) < _MOST_PUBLISHERS:
                self._waiting[key] = deque(maxlen=self._depth)
            queue = self._waiting.get(key)
            is_full = queue is None or len(queue) == self._depth
            self.lost += missing + (is_full and not received.is_odometry)
            if queue is not None:
                queue.append(received)
                self._changed.notify()

    def take(self, timeout: float) -> list[Received]:
        """Wait up to `timeout` seconds for a message; return all that wait, oldest first."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting, timeout)
            queues = list(self._waiting.values())
            self._waiting.clear()
        return sorted((one for queue in queues for one in queue), key=lambda one: one.arrived)


def received_scan(
    publisher: str,
    data: Buffer,
    encoding: str,
    kind: str,
    echo: str = "first",
    limits: Limits = LIMITS,
) -> Received:
    """Return what a source gives of a serialised scan, of type `kind`, that has just arrived."""
    read = partial(_decoder(kind, echo, limits), data, encoding)
    return Received(publisher, read, time.monotonic())


@cache
def _decoder(kind: str, echo: str, limits: Limits) -> Decoder:
    known = decoders(echo, None, limits)
    if kind not in known:
        raise ValueError(f"type of scans is {kind!r}, expected one of {', '.join(known)}")
    return known[kind]


def received_odometry(publisher: str, data: Buffer, encoding: str) -> Received:
    """Return what a source gives of a serialised ``nav_msgs/Odometry`` that has just arrived."""
    return Received(publisher, partial(odometry, data, encoding), time.monotonic(), True)
