"""Messages that a live node receives, where they come from, and where they wait."""

import time
from collections import deque
from collections.abc import Callable
from functools import partial
from threading import Condition
from typing import NamedTuple, Protocol

from ..limits import Limits
from ..rosmsg.grids import OccupancyGrid, occupancy_grid
from ..rosmsg.poses import Odometry, StampedPose, odometry, stamped_poses
from ..rosmsg.scans import decoders
from ..rosmsg.wire import Buffer
from ..scan import LaserScan
from .config import LiveConfig

#: What messages are, as a line calls one that makes no sense.
SCAN, ODOMETRY, LINKS, MOUNTINGS = "a scan", "an odometry", "a transform", "a mounting"
GUESS, RELOCATE, JUDGED = "an initial pose", "a call to relocate", "a pose to judge"
MAP = "a map"

#: Scans in a row that lack something before this is a message: it may begin late.
MANY = 20

Heard = LaserScan | Odometry | OccupancyGrid | list[StampedPose] | None
#: Poses are nearer [m]: what is computed from them stays finite.
FARTHEST = 1e9
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
    what : str
        `SCAN` or another of these names.
    """

    publisher: str
    read: Callable[[], Heard]
    arrived: float
    what: str = SCAN


class Wanted(NamedTuple):
    """A topic that is listened to, and what its messages are.

    Attributes
    ----------
    topic, kind : str
        Full name of the topic, and of its type: ``sensor_msgs/LaserScan``.
    what : str
        `SCAN` or another of these names.
    read : callable
        Decodes a serialised message of an encoding; ValueError, in one line, if it is malformed.
    is_latched : bool
        Whether the last message of each publisher is wanted that was sent before.
    publisher : str
        What receivers call the sender; "" for the publisher's own name.
    """

    topic: str
    kind: str
    what: str
    read: Callable[[Buffer, str], Heard]
    is_latched: bool = False
    publisher: str = ""

    @property
    def is_command(self) -> bool:
        """Whether each message counts: none may be lost on the way."""
        return self.what in (GUESS, RELOCATE, JUDGED) or self.is_latched

    def received(self, publisher: str, data: Buffer, encoding: str) -> Received:
        """Return what a source gives of a serialised message that has just arrived."""
        read = partial(self.read, data, encoding)
        return Received(self.publisher or publisher, read, time.monotonic(), self.what)


def relocation() -> Received:
    """Return what a source gives of a call of the service that has a robot looked for anew."""
    return Received("the service", lambda: None, time.monotonic(), RELOCATE)


def wanted(config: LiveConfig) -> list[Wanted]:
    """Return the topics that a node listens to: the scans, then what has to be known before."""
    kind, limits = f"sensor_msgs/{config.type}", Limits.of(config.limits)
    decoder = decoders(config.echo, None, limits)[kind]
    found = [Wanted(config.scan_topic, kind, SCAN, decoder)]
    if config.merge:  # A scanner is known by its topic, whoever sends.
        names = config.rig.topics
        found = [Wanted(name, kind, SCAN, decoder, publisher=name) for name in names]
    if (topic := config.odometry_topic) is not None:
        found.append(Wanted(topic, "nav_msgs/Odometry", ODOMETRY, odometry))
    links, placed = "tf2_msgs/TFMessage", "geometry_msgs/PoseWithCovarianceStamped"
    read = partial(_poses, limits=limits)
    if config.is_localiser or config.merge:
        mountings = partial(read, kind=links)
        found.append(Wanted("/tf_static", links, MOUNTINGS, mountings, is_latched=True))
    if config.is_localiser:
        found.append(Wanted("/tf", links, LINKS, partial(read, kind=links)))
    if config.can_relocate:
        found += [
            Wanted(config.resolved("initialpose"), placed, GUESS, partial(read, kind=placed)),
            Wanted(f"{config.scan_topic}/relocate", "std_msgs/Empty", RELOCATE, _nothing),
        ]
    if (topic := config.map_topic) is not None:
        read_map = partial(occupancy_grid, limits=limits)
        found.append(Wanted(topic, "nav_msgs/OccupancyGrid", MAP, read_map, is_latched=True))
    if (topic := config.judge_topic) is not None:
        found.append(Wanted(topic, placed, JUDGED, partial(read, kind=placed)))
    return found


def _poses(data: Buffer, encoding: str, kind: str, limits: Limits) -> list[StampedPose]:
    """Decode all poses of a message; ValueError if one of them is not finite."""
    found = list(stamped_poses(data, encoding, kind, limits))
    for one in found:
        if not all(abs(value) < FARTHEST for value in one.pose):
            raise ValueError(f"has pose {one.pose}, expected numbers below {FARTHEST:g}")
    return found


def _nothing(data: Buffer, encoding: str) -> None:
    """Decode a ``std_msgs/Empty``: that it has come is all that it says."""


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
        self._waiting: dict[tuple[str, str], deque[Received]] = {}
        self._changed = Condition()

    def put(self, received: Received, missing: int = 0) -> None:
        """Add a message; `missing` scans are known to have been lost just before it."""
        key = received.publisher, received.what
        with self._changed:
            if key not in self._waiting and len(self._waiting) < _MOST_PUBLISHERS:
                self._waiting[key] = deque(maxlen=self._depth)
            queue = self._waiting.get(key)
            is_full = queue is None or len(queue) == self._depth
            self.lost += missing + (is_full and received.what == SCAN)
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
